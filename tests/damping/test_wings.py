"""The damping force in both wings: Rayleigh's function and balances; tangents and steps stand with their systems."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from cablefem.elements.following import FollowingElements
from cablefem.elements.observing import kinetic_energy
from cablefem.elements.rolling import RollingElements
from cablefem.newmark import Newton, integrate, scheme, stack_states
from galerkin import Fourier, GalerkinSystem
from tests.elements.test_recovered import momentum_defect
from tests.elements.test_rolling import SECOND, G, random_rolling_state, zip_line_scene
from tests.galerkin.test_equations import STEEP, random_state
from tests.galerkin.test_equations import kinetic_energy as galerkin_energy
from tests.runs import DAMPED, march_with_positions, observe

RATE = DAMPED.damping


def damping_force(make, *state):
    """What damping adds to a residual."""
    damped, plain = (make(replace(STEEP, damping=x)) for x in (RATE, 0.0))
    return damped.residual(*state) - plain.residual(*state)


def derivative_by_rates(energy, v):
    """dT/dv by central differences: exact, as T is quadratic."""
    return np.array([0.5 * (energy(v + e) - energy(v - e)) for e in np.eye(v.size)])


@pytest.mark.parametrize("model", ["full", "stretching"])
def test_damping_is_the_momentum_of_the_cable(model):
    """-c_d times dT/dv of the cable alone, T = int |w.|^2/2 ds, w. at fixed s."""
    x = q, v, a = 0.1 * np.random.default_rng(3).standard_normal((3, 2 * 11))[:, : 22 if model == "full" else 11]
    elements = FollowingElements(STEEP, elements=3, model=model)
    at = np.array([STEEP.motion.position_with_rates(0.7, 0)]).T

    def of_elements(v):
        shape = (elements.n_scalar, elements.fields, 1)
        return float(kinetic_energy(elements, at, q.reshape(shape), v.reshape(shape))[0])

    got = damping_force(lambda g: FollowingElements(g, elements=3, model=model), 0.7, *x, 0)
    np.testing.assert_allclose(got, RATE * derivative_by_rates(of_elements, v), rtol=0.0, atol=1e-10)
    for kink in (True, False):
        sines = GalerkinSystem(replace(STEEP, mu=0.0), Fourier(5), kink=kink, model=model)
        q, v, a = random_state(sines, 5, 0.3)
        got = damping_force(lambda g, kink=kink: GalerkinSystem(g, Fourier(5), kink=kink, model=model), 0.7, q, v, a, 0)
        want = RATE * derivative_by_rates(lambda v, of=sines, q=q: galerkin_energy(of, 0.7, 0, q, v), v)
        np.testing.assert_allclose(got, want, rtol=0.0, atol=1e-10)
        if kink:  # twin: the hat's own rate forgotten
            still = RATE * derivative_by_rates(lambda v, of=sines, q=q: galerkin_energy(of, 0.7, 0, 0.0 * q, v), v)
            assert np.abs(got - still).max() > 1e-3


def test_the_row_of_the_place_has_damping_too():
    groups = replace(G, alpha=83.0)
    q, v, a = random_rolling_state(plain := RollingElements(groups, elements=3, grading=1.4), 0.01)
    damped = RollingElements(replace(groups, damping=RATE), elements=3, grading=1.4)

    def energy(v):
        of = (x[:-1].reshape(-1, 2, 1) for x in (q, v))
        return float(kinetic_energy(plain, np.array([[q[-1]], [v[-1]], [0.0]]), *of)[0])

    got = damped.residual(0.4, q, v, a, 0) - plain.residual(0.4, q, v, a, 0)
    np.testing.assert_allclose(got, RATE * derivative_by_rates(energy, v), rtol=0.0, atol=1e-10)
    assert abs(got[-1]) > 1e-4, "the last row vanishes: the test shows nothing"


@pytest.mark.parametrize(
    "system",
    [FollowingElements(DAMPED, elements=3), GalerkinSystem(DAMPED, Fourier(5), kink=True)],
    ids=["elements", "sines"],
)
def test_reactions_balance_the_damped_cable(system):
    """Damping pulls at the whole cable by -c_d times its momentum: weight and damping stand for sigma."""
    states, _ = march_with_positions(system, 300, until=0.6)
    s, weight = np.linspace(0.0, 1.0, 4001), np.array([0.0, DAMPED.sigma])
    o = observe(system, states, s, [states.t.size - 1])
    drag = -RATE * np.trapezoid(np.stack([o.du[0], o.dv[0]]), s, axis=1)
    assert momentum_defect(system, states, weight + drag) < 1e-3
    assert momentum_defect(system, states, weight) > 3e-3


def test_a_free_car_and_its_cable_lose_what_damping_takes():
    system = RollingElements(replace(zip_line_scene(release=1.0).groups, damping=RATE), elements=3)
    grids = [np.linspace(0.0, SECOND, 31), np.linspace(SECOND, 8.0 * SECOND, 211)]
    states = stack_states(list(integrate(system, scheme("gauss"), grids, newton=Newton(tol=1e-11, max_iter=60))))
    o = observe(system, states)
    given, lost = (cumulative_trapezoid(power, states.t, initial=0.0) for power in (o.power, o.powers["lost_viscous"]))
    assert np.abs(o.energy - o.energy[0] - given).max() < 0.02 * np.abs(lost).max()
