"""The damping force in both wings: Rayleigh's function, tangents, the twin without damping, steps and balances."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem.elements.fixed import FixedElements
from cablefem.elements.following import FollowingElements
from cablefem.elements.observing import kinetic_energy
from cablefem.elements.rolling import RollingElements
from cablefem.newmark import Newton, integrate, iterate, scheme, step_times
from cablefem.scene.drive import Drive
from galerkin import Daubechies, Fourier, GalerkinSystem, RollingSystem
from tests.elements.test_recovered import STEEP as STEADY
from tests.elements.test_recovered import momentum_defect
from tests.elements.test_rolling import SECOND, G, given, some_state, zip_line
from tests.galerkin.test_equations import STEEP, random_state
from tests.galerkin.test_equations import kinetic_energy as galerkin_energy
from tests.runs import march, observe, stack, tangent_defect

RATE = 0.83
DAMPED = replace(STEEP, damping=RATE)
KINDS = (
    lambda g, **kind: FollowingElements(g, elements=3, **kind),
    lambda g, **kind: FixedElements(g, elements=5, **kind),
    lambda g, **kind: FixedElements(g, elements=5, element="p2", coupling="path", **kind),
    lambda g, **kind: GalerkinSystem(g, Fourier(5), kink=True, **kind),
    lambda g, **kind: GalerkinSystem(g, Fourier(5), **kind),
    lambda g, **kind: GalerkinSystem(g, Daubechies(2, 1), kink=True, **kind),
)
NAMES = ("following", "hermite", "p2 path", "sines and hat", "sines", "wavelets and hat")


def force(make, *state):
    """What damping adds to a residual."""
    damped, plain = (make(replace(STEEP, damping=x)) for x in (RATE, 0.0))
    return damped.residual(*state) - plain.residual(*state)


def by_rates(energy, v):
    """dT/dv by central differences: exact, as T is quadratic."""
    return np.array([0.5 * (energy(v + e) - energy(v - e)) for e in np.eye(v.size)])


@pytest.mark.parametrize("model", ["full", "stretching"])
def test_damping_is_the_momentum_of_the_cable(model):
    """-c_d times dT/dv of the cable alone, T = int |w.|^2/2 ds, w. at fixed s."""
    x = q, v, a = 0.1 * np.random.default_rng(3).standard_normal((3, 2 * 11))[:, : 22 if model == "full" else 11]
    elements = FollowingElements(STEEP, elements=3, model=model)
    at = np.array([STEEP.motion.at(0.7, 0)])

    def of_elements(v):
        shape = (1, elements.n_scalar, elements.fields)
        return float(kinetic_energy(elements, at, q.reshape(shape), v.reshape(shape))[0])

    got = force(lambda g: FollowingElements(g, elements=3, model=model), 0.7, *x, 0)
    np.testing.assert_allclose(got, RATE * by_rates(of_elements, v), rtol=0.0, atol=1e-10)
    for kink in (True, False):
        sines = GalerkinSystem(replace(STEEP, mu=0.0), Fourier(5), kink=kink, model=model)
        q, v, a = random_state(sines, 5, 0.3)
        got = force(lambda g, kink=kink: GalerkinSystem(g, Fourier(5), kink=kink, model=model), 0.7, q, v, a, 0)
        want = RATE * by_rates(lambda v, of=sines, q=q: galerkin_energy(of, 0.7, 0, q, v), v)
        np.testing.assert_allclose(got, want, rtol=0.0, atol=1e-10)
        if kink:  # twin: the hat's own rate forgotten
            still = RATE * by_rates(lambda v, of=sines, q=q: galerkin_energy(of, 0.7, 0, 0.0 * q, v), v)
            assert np.abs(got - still).max() > 1e-3


def test_the_row_of_the_place_has_damping_too():
    groups = replace(G, alpha=83.0)
    q, v, a = some_state(plain := RollingElements(groups, elements=3, grading=1.4), 0.01)
    damped = RollingElements(replace(groups, damping=RATE), elements=3, grading=1.4)

    def energy(v):
        of = (x[:-1].reshape(1, -1, 2) for x in (q, v))
        return float(kinetic_energy(plain, np.array([[q[-1], v[-1], 0.0]]), *of)[0])

    got = damped.residual(0.4, q, v, a, 0) - plain.residual(0.4, q, v, a, 0)
    np.testing.assert_allclose(got, RATE * by_rates(energy, v), rtol=0.0, atol=1e-10)
    assert abs(got[-1]) > 1e-4, "the last row vanishes: the test shows nothing"


def test_the_balance_of_a_car_on_sines_feels_damping_through_the_tension_alone():
    drive = Drive(mode="free", start=0.4)
    plain, damped = (RollingSystem(replace(STEEP, drive=drive, damping=x), Fourier(5)) for x in (0.0, RATE))
    q, v, a = random_state(plain, 3)
    q[-1], v[-1], a[-1] = 0.43, 0.37, 0.21
    got = damped.residual(0.9, q, v, a, 0) - plain.residual(0.9, q, v, a, 0)
    grips = [GalerkinSystem(replace(STEEP, damping=x), Fourier(5), kink=True) for x in (0.0, RATE)]
    for x in grips:  # the same place and speed
        x._instants[0.9, 0] = x._instant(0.43, 0.37, 0.21)
    q, v, a = (y[:-1] for y in (q, v, a))
    want = grips[1].residual(0.9, q, v, a, 0) - grips[0].residual(0.9, q, v, a, 0)
    np.testing.assert_allclose(got[:-1], want, rtol=0.0, atol=1e-10)
    assert 1e-8 < abs(got[-1]) < np.abs(want).max()


@pytest.mark.parametrize("model", ["full", "sagged"])
@pytest.mark.parametrize("kind", range(len(KINDS)), ids=NAMES)
def test_the_tangent_holds_damping(kind, model):
    system = KINDS[kind](DAMPED, model=model)
    rng = np.random.default_rng(21)
    assert tangent_defect(system, 1.07, rng, size=0.02) < 1e-5
    assert tangent_defect(_deaf(system), 1.07, rng, size=0.02) > 1e-4


def _deaf(system):
    """The system with a tangent without damping."""
    other = type(system).__new__(type(system))
    other.__dict__.update(system.__dict__)
    right = system.linearise

    def linearise(t, q, v, a, phase, c0, c1, c2):
        return right(t, q, v, a, phase, c0, c1, c2 - RATE * c1)

    other.linearise = linearise
    return other


@pytest.mark.parametrize("mode", ["free", "haul"])
def test_the_bordered_tangent_holds_damping(mode):
    forces = replace(G.drive, mode=mode, end_time=9.0, nominal=9.0)
    motion = {} if mode == "free" else {"motion": STEEP.motion}
    system = RollingElements(replace(G, drive=forces, damping=RATE, **motion), elements=3, grading=1.4)
    q, v, a = some_state(system, 1e-4)
    x = np.random.default_rng(62).standard_normal(system.n_dof)
    for c, bound in (((0.0, 0.9, 1.3), 1e-6), ((1e-4, 0.05, 1.3), 1e-3)):
        _, solve = system.linearise(0.9, q, v, a, 0, *c)
        near = [system.residual(0.9, q + h * c[0] * x, v + h * c[1] * x, a + h * c[2] * x, 0) for h in (1e-6, -1e-6)]
        assert np.abs(solve((near[0] - near[1]) / 2e-6) - x).max() < bound * np.abs(x).max()


@pytest.mark.parametrize("kind", [0, 3], ids=[NAMES[0], NAMES[3]])
def test_compiled_steps_are_the_interpreted_ones(kind):
    ends = []
    for compiled in (True, False):
        system = KINDS[kind](DAMPED)
        if not compiled:
            system.strides = False
            system.settle = lambda *step, of=system: iterate(of, *step[:-1], Newton())
        ends.append(stack(list(integrate(system, scheme("trapezoidal"), step_times(system, 60)))).q[-20])
    assert np.abs(ends[0] - ends[1]).max() < 1e-9


@pytest.mark.parametrize("kind", [0, 3], ids=[NAMES[0], NAMES[3]])
def test_reactions_balance_the_damped_cable(kind):
    """Damping pulls at the whole cable by -c_d times its momentum: weight and damping stand for sigma."""
    system = KINDS[kind](replace(STEADY, damping=RATE))
    states, _ = march(system, 300, until=0.6)
    s = np.linspace(0.0, 1.0, 4001)
    o = observe(system, states, s, [states.t.size - 1])
    drag = -RATE * np.trapezoid(np.stack([o.du[0], o.dv[0]]), s, axis=1)
    assert momentum_defect(system, states, np.array([0.0, DAMPED.sigma]) + drag) < 1e-3
    assert momentum_defect(system, states, np.array([0.0, DAMPED.sigma])) > 3e-3


def test_the_energy_rule_loses_what_damping_takes():
    system = RollingElements(replace(zip_line(release=1.0).groups, damping=RATE), elements=3)
    grids = [np.linspace(0.0, SECOND, 11), np.linspace(SECOND, 8.0 * SECOND, 71)]
    states = stack(list(integrate(system, scheme("energy"), grids, newton=Newton(tol=1e-11, max_iter=60))))
    o = observe(system, states)
    lost = np.concatenate(
        [[0.0], np.cumsum(0.5 * np.diff(states.t) * (o.powers["lost_viscous"][1:] + o.powers["lost_viscous"][:-1]))]
    )
    off = o.energy - o.energy[0] - given(system, states) - lost
    assert np.abs(off).max() < 0.02 * np.abs(lost).max()
