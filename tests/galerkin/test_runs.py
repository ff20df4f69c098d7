"""Whole runs: paths against elements, energy, momentum at the mass; against exact answers: tests/oracles."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from cablefem.elements.following import FollowingElements
from cablefem.newmark import NewtonStalled
from galerkin.bases import Daubechies, Fourier
from galerkin.equations import GalerkinSystem
from tests.runs import INCLINED, LEVEL, largest_and_rms_path_error, march_with_positions, observe, observed_orders


# --- the other wing ------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def level_path_by_elements():
    """Path of mass-following elements, which share no formula with this wing; 3e-4 or better."""
    system = FollowingElements(LEVEL, elements=12, degree=2)
    states, _ = march_with_positions(system, 800, until=0.82)
    v = observe(system, states).path[:, 1]
    return lambda t: np.interp(t, states.t, v)


@pytest.mark.parametrize(
    ("basis", "kink", "bound"),
    [
        (Fourier(30), False, (0.030, 0.037)),
        (Daubechies(4, 1), False, (0.075, 0.09)),
        (Fourier(30), True, (0.0, 8e-4)),
        (Daubechies(4, 1), True, (0.0, 6e-3)),
    ],
    ids=lambda x: str(x),
)
def test_level_scene_against_elements(level_path_by_elements, basis, kink, bound):
    """The paper's scene: plain bases are as far off as their kink costs, enriched ones agree with the elements."""
    error = largest_and_rms_path_error(GalerkinSystem(LEVEL, basis, kink=kink), 600, level_path_by_elements)[0]
    assert bound[0] <= error < bound[1]


def test_rough_wavelets_need_damping_in_the_path_form(level_path_by_elements):
    """A constraint on positions is unstable under the undamped rule; damped, db3 is as good as its number of terms.

    With the travelling kink the hat takes up the constraint, and the undamped rule is stable too.
    """
    plain, kink = (GalerkinSystem(LEVEL, Daubechies(3, 1), kink=k) for k in (False, True))
    assert largest_and_rms_path_error(plain, 600, level_path_by_elements, "generalized-alpha")[0] < 0.12
    try:
        blown_up = largest_and_rms_path_error(plain, 600, level_path_by_elements)[0]
    except NewtonStalled:
        blown_up = np.inf
    assert blown_up > 0.5
    assert largest_and_rms_path_error(kink, 600, level_path_by_elements)[0] < 8e-3


# --- balances ------------------------------------------------------------------------------------------------------
def energy_and_jump_defects(system, steps, *, power=1.0, until=0.69):
    """Defects of energy (over its range) and of the jump law at the mass (rms over the largest force)."""
    states, s_o = march_with_positions(system, steps, until=until)
    x = observe(system, states)
    work = cumulative_trapezoid(x.power, states.t, initial=0.0)
    energy = np.abs(x.energy - x.energy[0] - power * work).max() / np.ptp(x.energy)
    ds_o = np.array([system.motion.position_with_rates(t, k)[1] for t, k in zip(states.t, states.phase, strict=True)])[
        :, None
    ]

    def flux(slope, T):
        return T[:, None] * slope / np.hypot(*slope.T)[:, None] - ds_o**2 * slope

    force = system.mu * (x.path_acceleration - [0.0, system.groups.sigma])
    defect = flux(x.slope_ahead, x.T_ahead) - flux(x.slope_behind, x.T_behind) - force
    inside = s_o > 0.05
    return energy, float(np.sqrt(np.mean(defect[inside] ** 2)) / np.abs(force[inside]).max())


def test_energy_without_a_kink_is_kept_to_the_order_of_the_rule():
    """Galerkin's equations over a standing basis satisfy the energy balance exactly; what is left is time stepping."""
    errors = [energy_and_jump_defects(GalerkinSystem(INCLINED, Fourier(10)), n)[0] for n in (300, 600, 1200)]
    assert np.all(np.abs(observed_orders(errors) - 2.0) < 0.4)
    assert errors[-1] < 3e-6
    assert energy_and_jump_defects(GalerkinSystem(INCLINED, Fourier(10)), 300, power=-1.0)[0] > 0.5


def test_energy_and_jump_law_with_the_kink():
    """The kink is the mass's own, so the jump law holds better with more terms; without it there is no jump at all."""
    coarse, fine = (energy_and_jump_defects(GalerkinSystem(INCLINED, Fourier(n), kink=True), 600) for n in (10, 30))
    assert coarse[0] < 1e-3
    assert fine[0] < 1e-4
    assert coarse[1] < 6e-2
    assert fine[1] < 0.5 * coarse[1]
    assert energy_and_jump_defects(GalerkinSystem(INCLINED, Fourier(30)), 600)[1] > 0.3


@pytest.mark.parametrize(
    ("model", "load"), [("string", "mass"), ("sagged", "mass"), ("stretching", "mass"), ("stretching", "force")]
)
def test_energy_of_the_one_field_models(model, load):
    """Second order in time over a standing basis; with the kink it improves with the terms."""

    def defect(n, steps, kink):
        return energy_and_jump_defects(GalerkinSystem(INCLINED, Fourier(n), kink=kink, model=model, load=load), steps)[
            0
        ]

    plain = [defect(12, steps, False) for steps in (300, 600)]
    assert abs(observed_orders(plain)[0] - 2.0) < 0.15
    assert plain[-1] < 2e-4
    kinked = [defect(n, 400, True) for n in (10, 20)]
    assert kinked[0] < 8e-3
    assert kinked[1] < 0.6 * kinked[0]


# --- observation ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kink", [False, True])
@pytest.mark.parametrize("basis", [Fourier(12), Daubechies(2, 1)], ids=["sines", "db2"])
@pytest.mark.parametrize("model", ["full", "stretching"])
def test_observation_is_consistent(model, basis, kink):
    """Path, velocities, one-sided tensions and fields measured in different ways say the same."""
    system = GalerkinSystem(INCLINED, basis, kink=kink, model=model)
    states, s_o = march_with_positions(
        system, 400, "trapezoidal" if basis.has_second_derivative else "newmark", until=0.6
    )
    k = np.array([100, 200, len(s_o) - 2])
    x = observe(system, states, [0.0, *s_o[k], 1.0], k)
    at = np.arange(3), np.arange(1, 4)
    np.testing.assert_allclose(np.stack([x.u[at], x.v[at]], axis=1), x.path[k], rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(x.T[at], x.T_behind[k], rtol=1e-12)
    for field in (x.u, x.v, x.du, x.dv):
        np.testing.assert_allclose(field[:, [0, -1]], 0.0, rtol=0.0, atol=1e-12)
    # along the path by central differences of the stored steps: dt^2
    place = np.stack(INCLINED.coordinates(s_o), axis=1) + x.path
    dt = states.t[1] - states.t[0]
    np.testing.assert_allclose((place[2:] - place[:-2]) / (2 * dt), x.path_velocity[1:-1], rtol=0.0, atol=2e-4)
    # at a fixed s the trapezoidal rule itself says w1 - w0 = dt (w.0 + w.1)/2, but for the moving hat: dt^2
    near = observe(system, states, [0.3], np.arange(len(s_o)))
    rate = 0.5 * (near.dv[1:] + near.dv[:-1])[s_o[1:] < 0.29]
    atol = (1e-12 if basis.has_second_derivative and not kink else 2e-2) * np.abs(rate).max()
    np.testing.assert_allclose((np.diff(near.v, axis=0) / dt)[s_o[1:] < 0.29], rate, rtol=0.0, atol=atol)
    if model == "full":  # points lie close to the mass, not on it
        assert np.all((x.tension_min <= np.minimum(x.T_behind, x.T_ahead) + 0.02)[1:])
    absent = ("T_behind", "T_behind_pointwise", "reaction_left", "reaction_right", "haul", "powers")
    finite = [getattr(x, n) for n in x.__dataclass_fields__ if n not in absent]
    assert all(np.isfinite(y).all() for y in finite)
    assert np.isnan(x.T_behind[0])
    assert np.isfinite(x.T_behind[1:]).all()


def test_observation_at_the_entry_is_the_limit():
    """At t = 0 slopes and tension behind a mass that starts from rest are those of the first steps."""
    system = GalerkinSystem(INCLINED, Fourier(10), kink=True)
    states, _ = march_with_positions(system, 4000, until=1e-6)
    x = observe(system, states, [0.0, 0.4], [0])
    np.testing.assert_allclose(x.slope_behind[0], x.slope_behind[1], rtol=1e-4)
    np.testing.assert_allclose(x.energy[1], x.energy[0], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(x.v, 0.0, rtol=0.0, atol=0.0)


# --- the package ---------------------------------------------------------------------------------------------------
def test_a_fine_run_is_stable_to_the_exit():
    system = GalerkinSystem(replace(INCLINED, mu=0.31), Fourier(60), kink=True)
    states, s_o = march_with_positions(system, 500)
    assert s_o[-1] > 0.99
    assert np.abs(observe(system, states).path).max() < 0.02
