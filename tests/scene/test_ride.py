"""The loaded cable at rest, and the quasi-static ride along it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.interpolate import CubicSpline

from cablefem import Scene
from cablefem.scene import Drive, Groups, LoadPath
from cablefem.scene.catenary import static_tension
from cablefem.scene.ride import roll_ride
from cablefem.scene.statics import gripped_rest, hauled_rest
from tests.scene.test_scene import scene_numbers
from validation.oracles.rest import ZIP as ROPE

# The zip line of the shared reference figures: 300 m, 95 kg, drag throughout.
ZIP = ROPE + "start = 2.0\ndrag_area = 0.6\n"
BRAKED = ZIP + "rolling_friction = 0.02\nbrake = [{from = 280.0, force = 600.0}]\nend = {time = 60.0}"


SLOW = """
[cable]
mass_per_length = 0.62
EA = 8e6
horizontal_tension = {0}
[supports]
span = 420.0
drop = 31.0
[mass]
mass = 50.0
[drive]
mode = "free"
start = 2.0
rolling_friction = 0.02
drag_area = 0.6
wind = -4.0
brake = [{{from = 395.0, force = 500.0}}]
"""


@pytest.mark.timeout(60)
@pytest.mark.parametrize("tension", [30270.0, 30300.0, 30450.0])
def test_who_reaches_a_brake_slowly_is_stopped_by_it(tension):
    """Without the brake he turns there: in one step he is beyond it, and back."""
    ride = Scene.from_toml(SLOW.format(tension)).ride
    assert [x.event for x in ride.events] == ["brake", "stop"]
    assert 0.0 <= ride.events[1].s_o - ride.events[0].s_o < 1e-5


@given(scene_numbers())
@settings(deadline=None, max_examples=15)
def test_the_cable_at_rest_ends_at_its_supports_and_carries_the_car(choice):
    """Put into its own equation: dr/ds = lam n/N from the left support with the tension that was found."""
    g = Scene.from_groups(**choice).groups
    s_o, l, ends, mu_r = 0.37, gripped_rest(0.37, g), np.stack(g.coordinates(1.0)), 0.07
    for r in (l, hauled_rest(s_o, replace(g, drive=replace(g.drive, mu_r=mu_r)))):

        def slope(s, y, r=r):
            n = r.left_force[0] - [0.0, g.sigma * s] + (r.jump[0] if s > s_o else 0.0)
            N = math.hypot(*n)
            return n / N * (1.0 + (N - static_tension(s, g.sigma, g.c)) / g.alpha)

        there = solve_ivp(slope, (0.0, s_o), [0.0, 0.0], rtol=1e-11, atol=1e-13).y[:, -1]
        np.testing.assert_allclose(there, r.car_point[0], rtol=0.0, atol=1e-9)
        end = solve_ivp(slope, (np.nextafter(s_o, 1.0), 1.0), there, rtol=1e-11, atol=1e-13).y[:, -1]
        np.testing.assert_allclose(end, ends, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(l.jump[0], [0.0, -g.mu * g.sigma], rtol=1e-15)
    tau = r.slope_behind[0] + r.slope_ahead[0]
    lean = math.hypot(*tau) / (math.hypot(*r.slope_behind[0]) + math.hypot(*r.slope_ahead[0]))
    tau /= math.hypot(*tau)
    pressing = r.jump[0] @ [tau[1], -tau[0]]
    assert pressing > 0.0
    assert abs(r.jump[0] @ tau + mu_r * pressing * lean) <= 1e-11
    np.testing.assert_allclose(r.jump[0] + [0.0, g.mu * g.sigma] + r.haul[0] * tau, 0.0, atol=1e-11)


def test_derivatives_of_the_load_path_are_those_of_its_places():
    g = Scene.from_toml(ZIP).groups
    s, h = np.linspace(0.02, 0.98, 7), 1e-5
    here, there, back = gripped_rest(s, g), gripped_rest(s + h, g), gripped_rest(s - h, g)
    np.testing.assert_allclose((there.car_point - back.car_point) / (2 * h), here.along, atol=1e-9)
    np.testing.assert_allclose((there.along - back.along) / (2 * h), here.bend, atol=1e-8)
    # the force that holds the car is the slope of the energy of cable and car
    x, w = np.polynomial.legendre.leggauss(60)

    def energy(s_o):
        r = gripped_rest(s_o, g)
        total = -g.mu * g.sigma * r.car_point[0, 1]
        for a, b, jump in ((0.0, s_o, 0.0 * r.jump[0]), (s_o, 1.0, r.jump[0])):
            p = a + 0.5 * (b - a) * (1.0 + x)
            n = r.left_force[0] - np.stack([0 * p, g.sigma * p], -1) + jump
            N, T = np.linalg.norm(n, axis=1), static_tension(p, g.sigma, g.c)
            eps = (N - T) / g.alpha
            weights = 0.5 * (b - a) * w
            dy = (1.0 + eps) * n[:, 1] / N  # - int sigma y ds = - sigma (1 - p) dy, up to the far end
            total += weights @ (T * eps + 0.5 * g.alpha * eps**2 - g.sigma * (1.0 - p) * dy)
        return total

    for s_o, hold in zip(s, here.hold, strict=True):
        # moving P along itself: dPi = hold ds
        assert (energy(s_o + 1e-4) - energy(s_o - 1e-4)) / 2e-4 == pytest.approx(hold, abs=1e-8)


@pytest.mark.parametrize("factor", [1.0, 1.02])
def test_a_quasi_static_ride_keeps_its_energy(factor):
    """mu |P'|^2 ds^2/2 + int Pi' ds stays; with a holding force 2 percent off (must fail) it does not."""
    g = Scene.from_toml(ZIP).groups
    path = LoadPath.on_loaded_cable(g)
    r = roll_ride(path, g.mu, g.sigma, Drive(mode="free", start=0.05, end_position=0.9, end_time=30.0))
    t = np.linspace(0.0, r.duration, 400)
    s = np.linspace(0.04, 0.91, 4001)
    hold = factor * np.array([path(x)[4] for x in s])
    potential = CubicSpline(s, np.concatenate([[0.0], cumulative_simpson(hold, x=s)]))
    energy = 0.5 * g.mu * r.point_speed(t) ** 2 + potential(r.position_and_speed(t)[0])
    drift = np.ptp(energy) / np.ptp(potential(s))
    assert (drift < 1e-7) == (factor == 1.0)


def test_the_ride_is_the_one_that_two_dynamic_prototypes_found():
    scene = Scene.from_toml(ZIP + "end = {time = 30.0}")
    s, _ = scene.ride.position_and_speed(30.0 / scene.time_scale)
    assert s * scene.length == pytest.approx(284.744, abs=2e-4 * scene.length)  # the model's limit; it gives 284.777
    scene = Scene.from_toml(BRAKED)
    brake, stop = scene.ride.events
    assert (brake.event, stop.event) == ("brake", "stop")
    assert brake.t * scene.time_scale == pytest.approx(34.800, abs=0.01)
    assert stop.t * scene.time_scale == pytest.approx(35.43, abs=0.01)
    assert stop.s_o * scene.length == pytest.approx(281.375, abs=0.01)
    assert scene.groups.drive.nominal == stop.t
    assert f"{scene.arrival_time:.4g} s (quasi-static)" in str(scene)


# --- on the chord all has closed form ---

FLAT = Groups(
    mu=0.3, alpha=400.0, sigma=0.02, c=0.21, chord_cos=0.98, chord_sin=0.2, motion=None
)  # falls by 0.2 of its length


def test_drag_on_the_chord():
    path = LoadPath.on_chord(FLAT)
    px, py, *_, p = path(0.5)
    k, mu, start = 1.5, FLAT.mu, 0.1
    r = roll_ride(path, mu, FLAT.sigma, Drive(mode="free", start=start, k=k, end_time=15.0))
    terminal = math.sqrt(mu * FLAT.sigma * py / p / k)
    t = np.linspace(0.3, 15.0, 9)
    distance = mu / k * np.log(np.cosh(t * terminal * k / mu))
    np.testing.assert_allclose((r.position_and_speed(t)[0] - start) * p, distance, rtol=1e-8)
    np.testing.assert_allclose(r.point_speed(t), terminal * np.sqrt(-np.expm1(-2 * k * distance / mu)), rtol=1e-8)
    assert p == pytest.approx(math.hypot(px, py), rel=1e-14)


def test_wind_drives_a_car_up_to_its_own_speed():
    level = Groups(mu=0.3, alpha=400.0, sigma=1e-5, c=0.5e-5, chord_cos=1.0, chord_sin=0.0, motion=None)
    r = roll_ride(LoadPath.on_chord(level), 0.3, 1e-5, Drive(mode="free", start=0.1, k=2.0, wind=0.05, end_time=15.0))
    t = 11.0  # v' = k/mu (w - v)^2
    assert r.point_speed(t) == pytest.approx(0.05 - 1.0 / (1.0 / 0.05 + 2.0 / 0.3 * t), rel=1e-8)


def test_friction_and_brake_on_the_chord():
    path = LoadPath.on_chord(FLAT)
    _, py, _, _, _, p = path(0.5)
    sin, cos = py / p, math.sqrt(1.0 - (py / p) ** 2)
    mu_r, force, at = 0.07, 0.004, 0.5
    brakes = (at, 0.25 * force), (at + 0.1, 0.75 * force)
    drive = Drive(mode="free", start=0.1, mu_r=mu_r, brakes=brakes, end_time=1e3)
    r = roll_ride(path, FLAT.mu, FLAT.sigma, drive)
    a = FLAT.sigma * (sin - mu_r * cos)
    first, second, stop = r.events
    assert (first.event, second.event, stop.event) == ("brake", "brake", "stop")
    assert first.s_o == at
    v2 = 2.0 * a * 0.4 * p
    assert first.speed == pytest.approx(math.sqrt(v2), rel=1e-8)
    v2 += 2.0 * (a - 0.25 * force / FLAT.mu) * 0.1 * p
    assert second.speed == pytest.approx(math.sqrt(v2), rel=1e-8)
    assert stop.s_o == pytest.approx(at + 0.1 + v2 / (2.0 * p * (force / FLAT.mu - a)), rel=1e-8)


def test_a_car_that_friction_holds_stays_until_thrust_moves_it():
    path = LoadPath.on_chord(FLAT)
    _, py, *_, p = path(0.5)
    held, most = Drive(mode="free", start=0.1, mu_r=0.3, end_time=50.0), 0.002
    (stop,) = roll_ride(path, FLAT.mu, FLAT.sigma, held).events
    assert (stop.event, stop.t, stop.s_o) == ("stop", 0.0, 0.1)
    pushed = replace(held, thrust_table=((2.0, 0.0), (12.0, most), (12.5, most)))
    r = roll_ride(path, FLAT.mu, FLAT.sigma, pushed)
    weight, sin = FLAT.mu * FLAT.sigma, py / p
    missing = 0.3 * weight * math.sqrt(1.0 - sin**2) - weight * sin
    assert r.sections[0][1] == pytest.approx(2.0 + 10.0 * missing / most, rel=1e-9)
    assert r.position_and_speed(1.01 * r.sections[0][1])[1] > 0.0 == r.position_and_speed(0.99 * r.sections[0][1])[1]
    assert [e.event for e in r.events] == ["thrust_end", "stop"]


def test_a_slow_release_starts_the_ride_slowly():
    path, start = LoadPath.on_chord(FLAT), 0.1
    drive = Drive(mode="free", start=start, release=2.0, end_time=9.0)
    r = roll_ride(path, FLAT.mu, FLAT.sigma, drive)
    a = FLAT.sigma * path(start)[1] / path(start)[5]
    # dds = a (1 - hold); int int (1 - x)^2 (1 + 2x) = tau^2 (7/20), int hold = tau/2
    t = 7.0
    distance = 0.5 * a * t**2 - a * (2.0**2 * 0.35 + 0.5 * 2.0 * (t - 2.0))
    assert (r.position_and_speed(t)[0] - start) * path(start)[5] == pytest.approx(distance, rel=1e-8)
    assert r.events[0].event == "release"


def test_a_ride_that_swings_counts_as_over_at_its_second_turn_and_ends_after_ten_of_them():
    scene = Scene.from_toml(ZIP.replace("drop = 15.0", "drop = 1.0"))
    d, (first, second, *_) = scene.groups.drive, scene.ride.events
    assert (first.event, second.event) == ("turn", "turn")
    assert d.nominal == second.t
    assert d.end_time == 10.0 * d.nominal
    assert scene.ride.duration == d.end_time
    assert 2.0 / scene.length < second.s_o < 0.4 < first.s_o < 0.99


def test_a_car_that_never_moves_has_a_nominal_time_all_the_same():
    scene = Scene.from_toml(ZIP + "rolling_friction = 0.5")
    assert scene.groups.drive.nominal == 1.0
    assert [e.event for e in scene.ride.events] == ["stop"]
    assert scene.top_speed == 0.0


CREEPER = Scene(
    cable={"mass_per_length": 0.62, "EA": 8e6, "horizontal_tension": 14e3}, supports={"span": 420.0, "drop": 31.0},
    mass={"mass": 40.0},
    drive={
        "mode": "free", "start": 2.0, "rolling_friction": 0.02, "drag_area": 0.6, "wind": -8.0,
        "brake": [{"from": 395.0, "force": 500.0}],
    },
)  # fmt: skip


def test_a_rider_who_creeps_to_rest_has_an_end():
    """Wind damps him beyond what swings: he comes to his place of rest like exp(-t/24 s), and never gets there."""
    l, tau = CREEPER.length, CREEPER.time_scale
    (stop,) = CREEPER.ride.events
    assert stop.event == "stop"
    assert stop.speed == 0.0
    forever = CREEPER.replace({"drive.rest_speed": 1e-9, "drive.rest_distance": 1e-9})
    (late,) = forever.ride.events
    assert late.t > 2.0 * stop.t
    assert 0.005 < (late.s_o - stop.s_o) * l < 0.011  # rest_distance
    speed = forever.ride.point_speed(np.array([stop.t]))[0] * l / tau
    assert speed < 1e-3  # rest_speed
    before = forever.ride.point_speed(np.array([0.9 * stop.t]))[0] * l / tau
    assert before > 1e-3


def test_places_where_a_car_at_rest_stays():
    """Friction of 0.02 holds a rider around the lowest point of his path, a brake beyond its place."""
    drive, l = CREEPER.groups.drive, CREEPER.length
    directions = [drive.departure_direction(x / l) for x in (50.0, 199.0, 201.0, 289.0, 291.0, 394.0, 396.0)]
    assert directions == [1, 1, 0, 0, -1, -1, 0]
    assert drive.is_near_rest_position(199.96 / l)
    assert not drive.is_near_rest_position(199.94 / l)  # 0.023 m before friction holds it
