"""Mass-following elements against exact answers, their own tangent, and the balances of energy and momentum."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from cablefem.elements.following import FollowingElements
from cablefem.newmark import integrate, scheme, step_times_by_phase
from cablefem.scene import Scene
from tests.runs import (
    CRUISE,
    DAMPED,
    INCLINED,
    MODELS,
    STEEP,
    largest_and_rms_path_error,
    march_with_positions,
    observe,
    observed_orders,
    tangent_defect,
)


# --- the equations ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("load", ["mass", "force"])
@pytest.mark.parametrize("law", ["elastic", "tension-only"])
@pytest.mark.parametrize("model", MODELS)
def test_the_tangent_is_the_derivative_of_the_residual(model, law, load):
    system = FollowingElements(DAMPED, elements=2, degree=3, grading=1.7, model=model, law=law, load=load)
    rng = np.random.default_rng(21)
    for t in (0.13, 1.07, 2.15):
        # central differences at 1e-6: 1e-12 times third derivatives of order alpha, through a solve of condition 1e4
        assert tangent_defect(system, t, rng) < 3e-6


@pytest.mark.parametrize("model", MODELS)
def test_the_hanging_cable_feels_the_mass_alone(model):
    system = FollowingElements(STEEP, elements=3, model=model)
    zero = np.zeros(system.n_dof)
    r = system.residual(1.07, zero, zero, zero, 0).reshape(-1, system.fields)
    ds, s_o = 0.45, 0.45 * 1.07
    *_, xpp, ypp = STEEP.tension_and_shape_derivatives(s_o)
    weight = np.array([0.0, STEEP.mu * STEEP.sigma])
    if model == "full":
        expected = STEEP.mu * ds**2 * np.array([xpp, ypp]) - weight
    else:
        # parabola of the chord: tau y_n'' = -sigma cos with tension tau = 1/cos along the chord
        curvature = STEEP.sigma * STEEP.chord_cos**2
        expected = np.array([-STEEP.mu * ds**2 * curvature - STEEP.mu * STEEP.sigma * STEEP.chord_cos])
    np.testing.assert_allclose(r[system.node], expected, rtol=1e-13)
    assert np.all(np.delete(r, system.node, axis=0) == 0.0)


def test_settings_that_make_no_sense_are_refused():
    for faulty, message in (
        ({"model": "beam"}, "model must be one of full, string, sagged, stretching, got 'beam'"),
        ({"load": "weight"}, "load must be mass or force, got 'weight'"),
        ({"law": "rubber"}, "law must be elastic or tension-only, got 'rubber'"),
    ):
        with pytest.raises(ValueError, match=message):
            FollowingElements(STEEP, **faulty)


@pytest.mark.parametrize("s_o", [0.0, 1.0])
def test_a_side_without_length_is_refused(s_o):
    system = FollowingElements(STEEP, elements=2)
    zero = np.zeros(system.n_dof)
    with pytest.raises(ValueError, match="no length"):
        system.residual(s_o / 0.45, zero, zero, zero, 0)


def test_the_entry_is_consistent_with_the_mass_matrix():
    """Second order in time from the very start; moving the mass alone, the nodes ahead at rest, costs an order."""
    system = FollowingElements(STEEP, elements=2, degree=6, model="string")
    states, _ = march_with_positions(system, 6400, until=0.8)
    fine = CubicSpline(states.t, observe(system, states).path[:, 1])
    assert np.all(
        np.abs(observed_orders([largest_and_rms_path_error(system, n, fine)[1] for n in (100, 200, 400)]) - 2.0) < 0.15
    )


# --- balances -----------------------------------------------------------------------------------------------------
def energy_defect(o, t):
    work = cumulative_trapezoid(o.power, t, initial=0.0)
    return float(np.abs(o.energy - o.energy[0] - work).max() / np.ptp(work))


def jump_defect(system, o, states):
    """rms of [ N t - ds_o^2 r' ] - mu (p.. - sigma j) over its right side, off the entry."""
    s_o, ds, _ = np.array(
        [system.motion.position_with_rates(t, p) for t, p in zip(states.t, states.phase, strict=True)]
    ).T
    force = system.inertia * o.path_acceleration - np.array([0.0, system.groups.mu * system.groups.sigma])

    def flux(N, slope):
        return (N / np.hypot(*slope.T) - ds**2)[:, None] * slope

    inside = s_o > 0.05
    N = o.T_behind_pointwise, o.T_ahead_pointwise
    defect = (flux(N[1], o.slope_ahead) - flux(N[0], o.slope_behind) - force)[inside]
    return float(np.sqrt(np.mean(defect**2) / np.mean(force[inside] ** 2)))


@pytest.mark.parametrize("load", ["mass", "force"])
@pytest.mark.parametrize("model", MODELS)
def test_energy_is_what_the_drive_puts_in(model, load):
    """dE/dt = power; both refined together: order 2 of the trapezoidal rule, and of the slopes of P2 in the power."""
    defects, jumps = [], []
    for elements, steps in ((5, 400), (10, 800), (20, 1600)):
        system = FollowingElements(INCLINED, elements=elements, model=model, load=load)
        states, _ = march_with_positions(system, steps, until=0.7)
        o = observe(system, states)
        defects.append(energy_defect(o, states.t))
        jumps.append(jump_defect(system, o, states))
    assert defects[-1] < 1e-4
    assert np.all(observed_orders(defects) > 1.75)  # fronts leave kinks in the power; more than 2 is luck, not a fault
    shifted = energy_defect(replace(o, power=1.01 * o.power), states.t)
    assert shifted > 5e-3
    if model == "full":
        assert jumps[-1] < 1e-3
        assert np.all(np.abs(observed_orders(jumps) - 2.0) < 0.15)
        still = jump_defect(
            system, replace(o, slope_ahead=o.slope_behind, T_ahead_pointwise=o.T_behind_pointwise), states
        )
        assert still > 0.9


def test_a_jump_of_the_drive_keeps_place_and_speed():
    system = FollowingElements(CRUISE, elements=4)
    grid = step_times_by_phase(system, 300)
    before = [x for x in integrate(system, scheme("trapezoidal"), grid[:2] + grid[2:]) if x.phase == 0][-1]
    assert before.t == CRUISE.motion.phases[0][1]
    after = system.start(1, before)
    assert after.q is before.q
    assert after.v is before.v
    assert np.abs(system.residual(after.t, after.q, after.v, after.a, 1)).max() < 1e-11
    assert np.abs(system.residual(after.t, after.q, after.v, before.a, 1)).max() > 1e-3


# --- observation --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("model", MODELS)
def test_fields_paths_and_their_rates_belong_together(model):
    system = FollowingElements(STEEP, elements=5, degree=3, model=model)
    states, s_o = march_with_positions(system, 400, until=0.6)
    i = s_o.size - 2
    stations = np.array([0.0, 0.2, s_o[i], 0.83, 1.0])
    o = observe(system, states, stations, [0, i - 1, i, i + 1])
    for path, field in ((o.path[:, 0], o.u), (o.path[:, 1], o.v)):
        assert field[2, 2] == pytest.approx(path[i], rel=1e-12)
        assert np.abs(field[:, [0, -1]]).max() < 1e-17  # the supports, to rounding
    assert np.all(o.u[0] == 0.0)
    dt = states.t[i] - states.t[i - 1]
    for field, rate in ((o.u, o.du), (o.v, o.dv)):
        # away from the mass fields are smooth in t: Newmark's own differences, of second order
        quotient = (field[3] - field[1])[[1, 3]] / (2.0 * dt)
        np.testing.assert_allclose(quotient, rate[2, [1, 3]], rtol=0.02, atol=2e-4)
    place = o.path + np.stack(STEEP.coordinates(s_o), axis=1)
    velocity = np.gradient(place, states.t, axis=0)
    if model == "full":
        np.testing.assert_allclose(velocity[50:-5], o.path_velocity[50:-5], rtol=0.0, atol=2e-4)
    # the rate of the mass is that of the cable under it, carried along the slope: v. + ds_o (y' + v') (1)
    slope = np.array([o.slope_behind[i], o.slope_ahead[i]])
    T = STEEP.static_tension(s_o[i])
    carried = np.array([o.du[2, 2], o.dv[2, 2]]) + 0.45 * slope[0]
    np.testing.assert_allclose(carried, o.path_velocity[i], rtol=0.0, atol=1e-12)
    if model == "full":
        expected = T + STEEP.alpha * (np.hypot(*slope[0]) - 1.0)
        assert o.T_pointwise[2, 2] == pytest.approx(expected, rel=1e-12)
        assert o.T_behind_pointwise[i] == pytest.approx(expected, rel=1e-12)
        assert abs(o.T_ahead_pointwise[i] - expected) > 1e-3
        assert o.T[2, 2] == pytest.approx(o.T_behind[i], rel=1e-12)
    assert math.isnan(o.T_behind[0])
    assert np.all(np.isfinite(o.T_behind[1:]))
    assert np.all(np.isfinite(o.T_ahead))


# --- locking ------------------------------------------------------------------------------------------------------
def test_a_deep_stiff_cable_does_not_lock():
    # length 1000 over a span of 900: sag/span 0.21
    deep = Scene.from_groups(sag_ratio=0.2119, alpha=2e4, mu=0.5, speed_ratio=0.4).groups

    def path(elements, degree):
        system = FollowingElements(deep, elements=elements, degree=degree)
        return observe(system, march_with_positions(system, 800, until=0.45)[0]).path

    fine = path(16, 4)
    assert np.abs(path(8, 2) - fine).max() < 1e-2 * np.abs(fine).max()  # one that locks: 2e-2
