"""Fixed elements: what converges and at which order, what does not, and the couplings of the mass."""

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from cablefem.elements.fixed import FixedElements
from cablefem.newmark import NewtonStalled, State, integrate, scheme, step_times_by_phase
from tests.runs import (
    CRUISE,
    DAMPED,
    INCLINED,
    MODELS,
    STEEP,
    crossed_cable,
    largest_and_rms_path_error,
    march_with_positions,
    observe,
    observed_orders,
    tangent_defect,
)
from validation.oracles import moving_force, moving_mass

PAIRS = (
    ("hermite", "chain"), ("hermite", "path"), ("p1", "path"), ("p1", "naive"),
)  # fmt: skip
RULES = {"p1": ("newmark", {}), "hermite": ("generalized-alpha", {"rho_inf": 0.5})}


# --- the equations ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("law", ["elastic", "tension-only"])
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("element", "coupling"), PAIRS)
def test_the_tangent_is_the_derivative_of_the_residual(element, coupling, model, law):
    system = FixedElements(DAMPED, elements=5, element=element, coupling=coupling, model=model, law=law)
    rng = np.random.default_rng(31)
    for t in (0.13, 1.07, 2.15):  # in the first, the third and the last element
        assert tangent_defect(system, t, rng) < 3e-6  # as for the following elements
    force = FixedElements(DAMPED, elements=5, element=element, coupling=coupling, model=model, load="force")
    assert tangent_defect(force, 1.07, rng) < 3e-6


def test_a_particle_has_no_explicit_scheme():
    system = FixedElements(STEEP, elements=5, element="p1", coupling="path")
    with pytest.raises(ValueError, match="needs an implicit scheme"):
        list(integrate(system, scheme("central-difference"), step_times_by_phase(system, 50)))


def test_settings_that_make_no_sense_are_refused():
    for faulty, message in (({"model": "rod"}, "model must be one of full, string, sagged, stretching, got 'rod'"),):
        with pytest.raises(ValueError, match=message):
            FixedElements(STEEP, **faulty)


@pytest.mark.parametrize("model", ["full", "sagged"])
@pytest.mark.parametrize(("element", "coupling"), PAIRS)
def test_a_jump_of_the_drive_is_a_jump_of_forces_in_balance(element, coupling, model):
    """r is linear in a: what the new drive asks for and what the accelerations give must cancel, q and v kept."""
    system = FixedElements(CRUISE, elements=7, element=element, coupling=coupling, model=model)
    t = CRUISE.motion.phases[1][0]
    q, v, a = 0.01 * np.random.default_rng(32).standard_normal((3, system.n_dof))
    before = State(t, q, v, a, 0)
    after = system.start(1, before)
    assert after.q is q
    assert after.v is v
    old, new = (system.residual(x.t, x.q, x.v, x.a, x.phase) for x in (before, after))
    np.testing.assert_allclose(new, old if coupling == "path" else 0.0, rtol=0.0, atol=1e-11)
    kept = system.residual(t, q, v, a, 1)
    assert np.abs(kept - (old if coupling == "path" else 0.0)).max() > 1e-4


# --- the taut string ----------------------------------------------------------------------------------------------
MU, SIGMA, V = 1.3, 0.12, 0.35
CROSSING = crossed_cable(mu=MU, sigma=SIGMA, c=0.5 * SIGMA, alpha=323.0, speed=V)
RIDE = moving_mass.solve_moving_mass(CROSSING.motion, mu=MU, sigma=SIGMA)


def path_with_sag_curvature(t):
    """Path on the taut string, the mass heavier by 1 + V^2 from the sag's curvature."""
    return (1.0 + V * V) * RIDE.mass_displacement(t)


def test_the_constrained_particle_converges_with_order_one():
    """The kink under the mass lies inside an element: first order, whatever the degree.  P1 and P2: tests/oracles."""
    method, settings = RULES["hermite"]
    errors = np.array([
        largest_and_rms_path_error(
            FixedElements(CROSSING, elements=e, coupling="path", model="string"), 25 * e, path_with_sag_curvature,
            method, **settings,
        )
        for e in (10, 20, 40)
    ])  # fmt: skip
    assert errors[-1, 0] < 8e-3
    assert np.all(np.abs(observed_orders(errors[:, 0]) - 1.0) < 0.15)
    assert np.all(np.abs(observed_orders(errors[:, 1]) - 1.0) < 0.15)


def test_hermite_by_the_chain_rule_needs_ever_finer_steps():
    """Its time error goes like elements^2/steps: 50 steps per element are the worse the finer the mesh.

    In the limit of small steps it solves the same equations as the constrained particle, which needs few.
    """

    def time_error(elements, steps):
        particle = FixedElements(CROSSING, elements=elements, coupling="path", model="string")
        states, _ = march_with_positions(particle, 25 * elements, "generalized-alpha", until=0.81, rho_inf=0.5)
        limit = CubicSpline(states.t, observe(particle, states).path[:, 1])
        return largest_and_rms_path_error(FixedElements(CROSSING, elements=elements, model="string"), steps, limit)[0]

    coarse = time_error(8, 400)
    assert 0.015 < coarse < 0.6 * time_error(16, 800)
    assert time_error(8, 3200) < 0.15 * coarse


@pytest.mark.parametrize("element", ["p1", "hermite"])
def test_the_constrained_particle_blows_up_without_damping(element):
    system = FixedElements(CROSSING, elements=20, element=element, coupling="path", model="string")
    try:
        states, _ = march_with_positions(system, 500, until=0.8)
        largest = np.abs(observe(system, states).path[:, 1]).max()
    except NewtonStalled:  # the numbers have outgrown the tolerance
        largest = math.inf
    assert largest > 10.0 * path_with_sag_curvature(np.linspace(0.0, 0.8 / V, 200)).max()


@pytest.mark.parametrize(("element", "coupling"), [("p1", "naive"), ("p1", "path"), ("hermite", "chain")])
def test_a_massless_load_needs_no_care(element, coupling):
    """Without inertia there is no acceleration under the load: every coupling is right, first order by the kink."""

    def exact(t):
        return moving_force.displacement(V * t, t, P=MU * SIGMA, V=V)

    errors = np.array([
        largest_and_rms_path_error(
            FixedElements(CROSSING, elements=e, element=element, coupling=coupling, model="string", load="force"),
            20 * e, exact,
        )
        for e in (20, 40, 80)
    ])  # fmt: skip
    assert errors[-1, 0] < 0.03
    assert np.all(np.abs(observed_orders(errors[:, 1]) - 1.0) < 0.15)


# --- observation --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("model", ["full", "stretching"])
def test_energy_is_what_the_drive_puts_in(model):
    """Chain-rule Hermite is Lagrange's equations of a cable of few unknowns: the power closes but for the time step."""
    system = FixedElements(INCLINED, elements=6, model=model)
    states, _ = march_with_positions(system, 2000, until=0.7)
    o = observe(system, states)
    work = cumulative_trapezoid(o.power, states.t, initial=0.0)
    gained = o.energy - o.energy[0]
    # the tenth mode, omega = 31, has (omega dt)^2/12 = 6e-4
    assert np.abs(gained - work).max() < 5e-4 * np.ptp(work)
    assert np.abs(gained - 1.01 * work).max() > 5e-3 * np.ptp(work)


@pytest.mark.parametrize(("element", "coupling"), PAIRS)
def test_fields_and_paths_belong_together(element, coupling):
    system = FixedElements(STEEP, elements=8, element=element, coupling=coupling)
    method, settings = RULES[element] if coupling == "path" else ("trapezoidal", {})
    states, s_o = march_with_positions(system, 300, method, until=0.4, **settings)
    i = s_o.size - 1
    o = observe(system, states, [0.0, 0.25, s_o[i], 1.0], [0, i])
    # generalised-alpha holds the constraint inside the step, not at its end
    inside = 1e-3 if method == "generalized-alpha" else 1e-9
    assert o.v[1, 2] == pytest.approx(o.path[i, 1], rel=inside)
    assert o.u[1, 2] == pytest.approx(o.path[i, 0], rel=inside)
    assert np.abs(o.v[:, [0, 3]]).max() < 1e-17  # the supports, to rounding
    assert np.all(o.v[0] == 0.0)
    T, xp, yp = STEEP.tension_and_slope(np.array([0.25]))
    step = 1e-6
    near = observe(system, states, [0.25 - step, 0.25], [i])  # a node: the side behind answers
    slope = np.array([xp[0] + np.diff(near.u[0])[0] / step, yp[0] + np.diff(near.v[0])[0] / step])
    assert o.T_pointwise[1, 1] == pytest.approx(T[0] + STEEP.alpha * (np.hypot(*slope) - 1.0), rel=1e-4)
    assert np.isfinite(o.T_behind[1:]).all()
    assert math.isnan(o.T_behind[0])
