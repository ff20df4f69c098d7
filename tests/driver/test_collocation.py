"""Radau IIA and Gauss: orders, stiffness, energy, agreement with scipy, and where they refuse."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cablefem import Scene
from cablefem.elements.fixed import FixedElements
from cablefem.elements.following import FollowingElements
from cablefem.newmark import (
    Newton,
    Scheme,
    StepFailure,
    Work,
    collocate_first_step,
    consistent_acceleration,
    integrate,
    scheme,
    state_inside_step,
    step_times_by_phase,
)
from cablefem.newmark.newton import find_root
from cablefem.newmark.schemes import GAUSS, RADAU
from cablefem.newmark.tableau import tableau
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from tests.driver.systems import DoublePendulum, Follower, Guided, Spring

TIGHT = Newton(tol=1e-13)
LEVEL = Scene.load("level").groups


def integrate_tightly(system, method, times, **kw):
    method = scheme(method) if isinstance(method, str) else method
    return list(integrate(system, method, times, newton=kw.pop("newton", TIGHT), **kw))


def equal_steps(end, n, begin=0.0):
    return [np.linspace(begin, end, n + 1)]


def position_by_scipy(system, begin, end, rtol=1e-12, atol=1e-13):
    """Return q at the end by scipy on the same equations."""
    n, zero = system.n_dof, np.zeros(system.n_dof)

    def rate(t, y):
        r, solve = system.linearise(t, y[:n], y[n:], zero, 0, (0.0, 0.0, 1.0))
        return np.concatenate([y[n:], -solve(r.copy())])

    y0 = np.concatenate([begin.q, begin.v])
    return solve_ivp(rate, (begin.t, end), y0, method="DOP853", rtol=rtol, atol=atol).y[:n, -1]


# --- the tables -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("nodes", "order"), [(RADAU, 5), (GAUSS, 4)])
def test_tables_fulfil_the_simplifying_assumptions_of_their_order(nodes, order):
    """B(p): b integrates x^(k-1) for k <= p; C(s): so do the rows of A for k <= s (Hairer & Wanner 1996, IV.5)."""
    rule, s = tableau(nodes), len(nodes)
    for k in range(1, order + 1):
        assert rule.ends[1] @ rule.c ** (k - 1) == pytest.approx(1.0 / k, rel=1e-14)
    assert rule.ends[1] @ rule.c**order != pytest.approx(1.0 / (order + 1), rel=1e-3)
    for k in range(1, s + 1):
        np.testing.assert_allclose(rule.A @ rule.c ** (k - 1), rule.c**k / k, rtol=1e-13, atol=1e-15)
    # and A comes back from its eigenvalues, one of each pair
    np.testing.assert_allclose((rule.from_modes * rule.eigenvalues @ rule.to_modes).real, rule.A, rtol=0.0, atol=1e-14)


# --- orders -----------------------------------------------------------------------------------------------------------
SYSTEMS = {
    "spring": (lambda: Spring(d=0.37, k3=11.0, f=1.9, end=2.0), (10, 20, 40)),
    "pendulum": (lambda: DoublePendulum(end=1.0), (12, 24, 48)),
}


def observed_order_and_errors(system, method, steps, truth):
    error = [
        np.abs(integrate_tightly(system, method, equal_steps(system.phases[-1][1], n))[-1].q - truth).max()
        for n in steps
    ]
    return -np.polyfit(np.log(steps), np.log(error), 1)[0], error


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize(("method", "order", "finest"), [("radau", 5.0, 3e-9), ("gauss", 4.0, 2e-7)])
def test_order_on_smooth_nonlinear_systems(name, method, order, finest):
    make, steps = SYSTEMS[name]
    system = make()
    truth = position_by_scipy(system, system.start(0, None), system.phases[-1][1])
    slope, error = observed_order_and_errors(system, method, steps, truth)
    assert abs(slope - order) < 0.25, (slope, error)
    assert error[-1] < finest


def test_nodes_a_little_off_lose_two_orders():
    """The twin: three nodes that are none of Radau's are of order three."""
    system = Spring(d=0.37, k3=11.0, f=1.9, end=2.0)
    truth = position_by_scipy(system, system.start(0, None), 2.0)
    off = Scheme("off", nodes=(RADAU[0] + 0.05, RADAU[1] + 0.02, 1.0))
    slope, error = observed_order_and_errors(system, off, (10, 20, 40), truth)
    assert slope < 4.0, (slope, error)


# --- stiffness and energy ---------------------------------------------------------------------------------------------
def test_radau_annihilates_what_it_cannot_resolve_and_gauss_keeps_it():
    stiff = Spring(k=5.3e8, q0=0.31, v0=0.0)
    start = stiff.start(0, None)
    dying, ringing = (integrate_tightly(stiff, method, equal_steps(3.0, 20))[-1] for method in ("radau", "gauss"))
    assert abs(dying.q[0]) < 1e-9 * 0.31
    # quadratic energies are kept to rounding (Cooper 1987), at any step
    assert stiff.energy(ringing) == pytest.approx(stiff.energy(start), rel=1e-10)


@pytest.mark.parametrize("stiffness", [1e1, 1e12])
def test_a_stiff_system_is_followed_at_any_stiffness(stiffness):
    """Prothero & Robinson (1974) with second derivatives: errors stay those of the smooth solution."""
    error = []
    for n in (20, 40):
        stiff = Follower(m=1.7, d=2.0 * math.sqrt(stiffness), k=stiffness, k3=11.0, w=2.1, q0=0.0, v0=2.1)
        x = integrate_tightly(stiff, "radau", equal_steps(3.0, n), newton=Newton(tol=1e-12))[-1]
        error.append(abs(x.q[0] - math.sin(2.1 * 3.0)))
    assert error[1] < 1e-6
    assert error[1] < 0.2 * error[0] + 1e-12


# --- cables -----------------------------------------------------------------------------------------------------------
def state_after_entry(system):
    """A state early in the travel, where all that the sudden entry excites is resolved."""
    t1 = 0.02 * system.phases[0][1]
    x = integrate_tightly(system, "radau", equal_steps(t1, 41), newton=Newton(tol=1e-11))[-1]
    return consistent_acceleration(system, x.t, x.q, x.v, 0)


@pytest.mark.parametrize(
    "system",
    [FollowingElements(LEVEL, elements=1), GalerkinSystem(LEVEL, Fourier(2), kink=True)],
    ids=["elements", "sines"],
)
def test_cables_by_radau_and_by_scipy(system):
    """The same equations by Dormand and Prince's explicit rule with its own step sizes."""
    begin, end = state_after_entry(system), 0.06 * system.phases[0][1]
    truth = position_by_scipy(system, begin, end, rtol=1e-9, atol=1e-12)
    how = {"start": begin, "newton": Newton(tol=1e-9)}
    q, late = (integrate_tightly(system, "radau", equal_steps(x, 60, begin.t), **how)[-1].q for x in (end, 0.999 * end))
    assert np.abs(q - truth).max() < 1e-6 * np.abs(truth).max()
    assert np.abs(late - truth).max() > 1e-4 * np.abs(truth).max()  # twin: a step left out is seen


@pytest.mark.parametrize("method", ["radau", "gauss"])
@pytest.mark.parametrize("model", ["full", "stretching"])
@pytest.mark.parametrize("kind", [FollowingElements, FixedElements])
def test_compiled_steps_are_those_of_the_residuals_and_tangents(kind, model, method):
    class Plain(kind):
        def collocate_steps(self, *step):
            return collocate_first_step(self, *step)

    ends, works = [], []
    for cls in (Plain, kind):
        system, work = cls(LEVEL, elements=4, model=model), Work()
        times = [step_times_by_phase(system, 200)[0][:40]]
        ends.append(integrate_tightly(system, method, times, newton=Newton(tol=1e-6), work=work)[-1])
        works.append(work)
    # factors that serve several steps give the same to Newton's tolerance
    assert np.abs(ends[1].q - ends[0].q).max() <= 1e-6 * np.abs(ends[0].q).max()
    assert works[1].factorisations < works[0].factorisations


def test_a_start_from_rest_takes_its_first_step_whole():
    """Behind a mass that starts from rest all lengths grow like t^2: no one tangent fits all nodes of a first step."""
    system, work = FollowingElements(Scene.load("inclined").groups, elements=3), Work()
    integrate_tightly(
        system, "radau", [step_times_by_phase(system, 40)[0][:2]], newton=Newton(tol=1e-6, max_iter=16), work=work
    )
    assert work.rejected == 0


def test_a_constraint_on_positions_is_kept_by_radau_and_refused_by_gauss():
    guided = Guided(end=2.0)
    error = []
    for n in (20, 40, 80):
        states = integrate_tightly(guided, "radau", equal_steps(2.0, n))
        assert max(abs(x.q[1] - math.sin(2.1 * x.t)) for x in states) < 1e-12
        # m q'' + k q = (k + 0.4 w^2) sin(w t)
        w0, force = math.sqrt(5.3 / 1.7), (5.3 + 0.4 * 2.1**2) / (5.3 - 1.7 * 2.1**2)
        exact = force * math.sin(2.1 * 2.0) + (0.3 - force * 2.1) / w0 * math.sin(w0 * 2.0)
        error.append(abs(states[-1].q[0] - exact))
    assert error[-1] < 1e-5
    assert error[1] < 0.4 * error[0]
    with pytest.raises(StepFailure, match="constraint on positions"):
        integrate_tightly(guided, "gauss", equal_steps(2.0, 20))
    system = FixedElements(LEVEL, elements=4, element="p1", coupling="path")
    with pytest.raises(ValueError, match="constraint on positions"):
        integrate_tightly(system, "gauss", step_times_by_phase(system, 20))


# --- between the steps ------------------------------------------------------------------------------------------------
def test_between_steps_the_polynomial_of_the_step_answers():
    system = Spring(d=0.37, k3=11.0, f=1.9, end=2.0)
    fine = integrate_tightly(system, "radau", equal_steps(2.0, 800))
    worst = {}
    for method in ("radau", "gauss"):
        for n in (20, 40):
            states = integrate_tightly(system, method, equal_steps(2.0, n))
            step = 800 // n
            found = [state_inside_step(states[i // step + 1], x.t) for i, x in enumerate(fine[:-1])]
            worst[method, n] = max(abs(x.q[0] - y.q[0]) for x, y in zip(fine[:-1], found, strict=True))
            ends = state_inside_step(states[5], states[5].t)
            np.testing.assert_allclose([ends.q, ends.v], [states[5].q, states[5].v], rtol=1e-13)
    # three nodes: degree four in q, error of order five; two: order three within the step
    assert worst["radau", 40] < 2e-6
    assert worst["radau", 20] / worst["radau", 40] > 18.0
    assert worst["gauss", 20] / worst["gauss", 40] > 6.0


def test_a_correction_by_an_old_tangent_that_does_not_help_is_taken_back():
    """x^3 = 8 from 2.2, with the slope 12 of the root and with one of the wrong sign."""
    for old, anew in ((12.0, 0), (-12.0, 1)):
        x = np.array([2.2])

        def residual(x=x):
            return x**3 - 8.0

        def linearise(x=x):
            slope = 3.0 * x**2
            return residual(x), lambda r: r / slope

        def update(dx, x=x):
            x -= dx

        result = find_root(residual, linearise, update, Newton(bound=1e-10), lambda r, old=old: r / old)
        assert abs(x[0] - 2.0) < 1e-10
        assert min(result.factorisations, 1) == anew
