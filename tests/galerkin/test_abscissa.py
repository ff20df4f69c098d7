"""The place of the mass as independent variable gives what time gives."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.newmark import Newton, integrate, scheme, stack_states, step_times_by_phase
from cablefem.scene.motion import Motion, Piece
from galerkin.abscissa import SystemOverPosition
from galerkin.bases import Daubechies, Fourier
from galerkin.equations import GalerkinSystem
from tests.galerkin.test_equations import PLACE, STEEP
from tests.runs import CRUISE, INCLINED, LEVEL, march_with_positions, tangent_defect


def states_up_to_position(system, steps, until=0.8):
    """States in s_o up to a place, stacked."""
    states = []
    for x in integrate(system, scheme("trapezoidal"), step_times_by_phase(system, steps)):
        states.append(x)
        if x.t > until:
            break
    return stack_states(states)


@pytest.mark.parametrize("kink", [False, True])
def test_residual_is_that_of_the_wrapped_system(kink):
    """Any g, g', g'' at a place against q, dq/dt, d2q/dt2 at its time: (45) is (19) by the chain rule."""
    system = GalerkinSystem(STEEP, Fourier(4), kink=kink)
    wrapped = SystemOverPosition(system)
    g, g1, g2 = 0.02 * np.random.default_rng(2).standard_normal((3, system.n_dof))
    t = 1.7
    s_o, ds_o, dds_o = STEEP.motion.position_with_rates(t, 1)
    r = wrapped.residual(s_o, g, g1, g2, 1)
    want = system.residual(t, g, ds_o * g1, ds_o**2 * g2 + dds_o * g1, 1)
    np.testing.assert_allclose(r, want, rtol=0.0, atol=1e-12)
    assert np.abs(r - system.residual(t, g, ds_o * g1, ds_o**2 * g2 - dds_o * g1, 1)).max() > 1e-5
    assert tangent_defect(wrapped, s_o, np.random.default_rng(3), phase=1, size=0.02) < 1e-5
    np.testing.assert_allclose(wrapped.phases, [(0.0, PLACE), (PLACE, 1.0)], rtol=1e-15)


def test_start_from_rest_tends_to_the_papers():
    """(48), g''(0) = M^-1(0) dF(0)/ds_o / (3 dds_o) with F of (27), is the limit of a balance close to the support."""
    wrapped = SystemOverPosition(GalerkinSystem(INCLINED, Daubechies(4, 1)))
    _, xp, yp = INCLINED.tension_and_slope(0.0)
    a, mu, sigma = INCLINED.motion.position_with_rates(0.0, 0)[2], INCLINED.mu, INCLINED.sigma
    basis = wrapped.system.basis.basis
    dF = -mu * np.multiply.outer([a * xp, a * yp - sigma], basis.phi(np.array([0.0]), 1)[0])
    paper = np.linalg.solve(basis.mass_matrix(), dF.T).T.ravel() / (3.0 * a)
    zero = np.zeros(wrapped.n_dof)
    defects = [
        np.abs(wrapped.second_derivative_at_rest_start(zero, d) - paper).max() / np.abs(paper).max()
        for d in (1e-8, 1e-9, 1e-10)
    ]
    np.testing.assert_allclose(np.array(defects[:-1]) / defects[1:], 10.0, rtol=0.15)  # first order in d
    assert defects[-1] < 2e-3
    start = wrapped.start(0, None)
    assert np.abs(start.v).max() == 0.0
    assert np.abs(start.q).max() == 0.0


@pytest.mark.parametrize(
    ("groups", "kink"),
    [
        pytest.param(LEVEL, False, id="level"),
        pytest.param(INCLINED, True, id="inclined", marks=pytest.mark.slow),
        pytest.param(CRUISE, True, id="cruise", marks=pytest.mark.slow),
    ],
)
def test_path_is_that_of_time(groups, kink):
    """At speed, from rest, with jumps of acceleration: steps of t and of s_o meet in one path."""
    system = GalerkinSystem(groups, Fourier(8), kink=kink)
    states, s_o = march_with_positions(system, 800, until=0.31)
    fine = system.observe(states, s_o[:1], np.arange(0)).path[:, 1]
    wrapped = SystemOverPosition(system)

    def gap(steps):
        x = states_up_to_position(wrapped, steps, until=0.3)
        v = wrapped.observe(wrapped.states_over_time(x), s_o[:1], np.arange(0)).path[:, 1]
        return np.sqrt(np.mean((v - np.interp(x.t, s_o, fine)) ** 2)) / np.abs(fine).max()

    assert gap(400) < 1e-3
    assert gap(800) < 2e-4  # second order


def test_states_in_time():
    wrapped = SystemOverPosition(GalerkinSystem(CRUISE, Fourier(5), kink=True))
    x = states_up_to_position(wrapped, 60, until=0.5)
    y = wrapped.states_over_time(x)
    at = [CRUISE.motion.position_with_rates(t, k) for t, k in zip(y.t, y.phase, strict=True)]
    s_o, ds_o, dds_o = np.array(at).T
    np.testing.assert_allclose(s_o, x.t, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(y.v, ds_o[:, None] * x.v, rtol=1e-12, atol=1e-15)
    r = [
        wrapped.system.residual(*(getattr(y, n)[i] for n in ("t", "q", "v", "a")), y.phase[i])
        for i in range(1, y.t.size)
    ]
    # the balance of the steps taken in s_o holds in time, to Newton's tolerance
    assert np.abs(r).max() <= Newton().tol * wrapped.force_scale
    assert y.a[0] == pytest.approx(dds_o[0] * x.v[0])  # from rest ds_o^2 g'' is nothing


def test_a_law_is_passed_on():
    wrapped = SystemOverPosition(GalerkinSystem(INCLINED, Fourier(5)))
    other = wrapped.with_law("tension-only")
    assert (other.system.law, wrapped.system.law) == ("tension-only", "elastic")
    assert other.system.basis is wrapped.system.basis
    other.residual(0.2, np.zeros(10), np.zeros(10), np.zeros(10), 0)
    assert other.min_tension_and_position == other.system.min_tension_and_position


def test_a_halt_on_the_way_is_refused():
    """Where the mass stands still its place cannot tell the time."""
    halt = Piece(1.0, 1.0, 0.4, 0.0, 0.1)
    stop = Motion(((0.0, 1.0), (1.0, 2.0)), ((Piece(0.0, 0.0, 0.0, 0.8, -0.4),), (halt,)), 0.5)
    with pytest.raises(ValueError, match="stands still"):
        SystemOverPosition(GalerkinSystem(replace(INCLINED, motion=stop), Fourier(3)))
    lazy = Motion(((0.0, 2.0),), ((Piece(0.0, 0.0, 0.0, 0.0, 0.0, 0.1),),), 0.8)
    with pytest.raises(ValueError, match="neither speed nor acceleration"):
        SystemOverPosition(GalerkinSystem(replace(INCLINED, motion=lazy), Fourier(3)))
    assert Scene.load("level").groups.motion.phases  # a plain travel is not refused
    SystemOverPosition(GalerkinSystem(LEVEL, Fourier(3)))
