"""The table [drive]: what it admits, and what the solvers get of it."""

import math

import numpy as np
import pytest

from cablefem import Scene, SceneError
from cablefem.scene import Drive
from cablefem.scene.drive import RollingCarState
from tests.scene.test_faults import GOOD, NUMBER, TRAVEL, scene_faults

FREE = GOOD.replace(f"[travel]\n{TRAVEL}", '[drive]\nmode = "free"')
HAUL = GOOD + '[drive]\nmode = "haul"\n'
# of 330 m: 0.99 l, 1e-4 l
PLACES = "must be from 0.033 to 326.7 m, between the left support and the end of the ride"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (FREE + "star = 3", ["drive.star = 3: unknown key. Did you mean start? Known: mode, start, release, "
                             "rolling_friction, drag_area, air_density, wind, thrust, brake, end, hitch, rest_speed, "
                             "rest_distance."]),
        (FREE.replace('"free"', '"fee"'), ["drive.mode = 'fee': unknown. Did you mean free? Known: grip, haul, free."]),
        (FREE + "start = 0", [f"drive.start = 0: must be a number > 0, {NUMBER}"]),
        (FREE + "start = 0.01", [f"drive.start = 0.01: {PLACES}"]),
        (FREE + "start = 40.0\nend = {place = 30}", [f"drive.start = 40.0: {PLACES.replace('326.7', '30')}"]),
        (FREE + "release = -1", [f"drive.release = -1: must be a number >= 0: 0, or {NUMBER}"]),
        (FREE + "rolling_friction = 1.5", ["drive.rolling_friction = 1.5: must be a number from 0 to 1"]),
        (FREE + "wind = -5.0", ["drive.wind = -5.0: acts through drag alone; must be given with drag_area"]),
        (FREE + "thrust = true",
         ["drive.thrust = True: must be a number from -1e+15 to 1e+15, or a table {times, forces, angle, at}"]),
        (FREE + "thrust = {times = [0, 2, 2], forces = [5.0, 6.0]}",
         ["drive.thrust.forces: 2 values; must be 3, as times",
          "drive.thrust.times[2] = 2.0: must be > 2.0, the one before it"]),
        (FREE + "thrust = {times = [0, 2], force = [5.0, nan]}",
         ["drive.thrust.forces: missing; must be a list of at least two numbers",
          "drive.thrust.force = [5.0, nan]: unknown key. Did you mean forces? Known: times, forces, angle, at."]),
        (FREE + "brake = 600", ["drive.brake = 600: must be a list of tables {from = ..., force = ...}"]),
        (FREE + "brake = [{from = 280, force = 3}, {at = 290, force = 0}]",
         ["drive.brake[1].from: missing; must be a number > 0, " + NUMBER,
          f"drive.brake[1].force = 0: must be a number > 0, {NUMBER}",
          "drive.brake[1].at = 290: unknown key. Known: from, force, wheel."]),
        (FREE + "brake = [{from = 331, force = 3}]",
         ["drive.brake[0].from = 331.0: must be < 330 m, the length of the cable"]),
        (FREE + "end = {time = 3, place = 4}",
         ["drive.end.place = 4: too much beside time = 3; exactly one of time, place must be given"]),
        (FREE + "end = {place = 328.0}",
         ["drive.end.place = 328.0: must be < 326.7 m, 0.99 of the length of the cable: next to the support no answer "
          "converges"]),
        (FREE + f"[travel]\n{TRAVEL}",
         ["travel: too much beside drive.mode = 'free', whose travel is an answer; leave it out"]),
        (FREE.replace("[mass]\nmass = 75.0", ""), ["mass: missing; must be given with drive.mode = 'free'"]),
        (HAUL.replace("[mass]\nmass = 75.0", "").replace(f"[travel]\n{TRAVEL}", ""),
         ["mass: missing; must be given, and [travel] too, with drive.mode = 'haul'"]),
        (HAUL + "thrust = 5.0", ["drive.thrust = 5.0: has no meaning with mode = 'haul', where the rope supplies "
                                 "whatever force the travel needs; leave it out, or take free"]),
        (HAUL.replace('"haul"', '"grip"') + "start = 5.0",
         ["drive.start = 5.0: has no meaning with mode = 'grip', where the car takes its travel from [travel] and "
          "nothing else; leave it out, or take haul or free"]),
        (HAUL.replace(TRAVEL, 'kind = "constant_acceleration"\nacceleration = -0.3\ninitial_speed = 13.0'),
         ["travel.acceleration = -0.3: must be >= -0.26128633271490415 m/s^2 with initial_speed = 13.0, or the mass "
          "stops after 281.667 m of 323.4 m"]),
    ],
)  # fmt: skip
def test_a_fault_of_a_drive_is_one_line(text, expected):
    assert scene_faults(text) == expected


FULL = (
    FREE
    + """
start = 2.0
release = 1.5
rolling_friction = 0.03
drag_area = 0.7
air_density = 1.1
wind = -4.0
thrust = {times = [0.5, 2.0, 3.0], forces = [10.0, 40.0, -20.0]}
brake = [{from = 300.0, force = 60.0}, {from = 290.0, force = 50.0}]
end = {time = 20.0}
"""
)


def test_the_groups_hold_the_drive_without_units():
    scene = Scene.from_toml(FULL)
    d, tau, l, H = scene.groups.drive, scene.time_scale, scene.length, scene.horizontal_tension
    assert (d.mode, d.mu_r, scene.groups.motion) == ("free", 0.03, None)
    np.testing.assert_allclose([d.start * l, d.release * tau, d.wind * scene.wave_speed], [2.0, 1.5, -4.0], rtol=1e-14)
    # N of drag at 7 m/s: rho_air c_d A v^2/2
    assert d.k * (7.0 / scene.wave_speed) ** 2 * H == pytest.approx(0.5 * 1.1 * 0.7 * 49.0, rel=1e-14)
    np.testing.assert_allclose(np.array(d.phases) * tau, [(0, 0.5), (0.5, 1.5), (1.5, 2), (2, 3), (3, 20)], rtol=1e-14)
    forces = [d.brake_force(x / l) * H for x in (289.0, 290.5, 301.0)]
    np.testing.assert_allclose(forces, [0.0, 50.0, 110.0], rtol=1e-14)
    assert [place * l for place, _ in d.brakes] == pytest.approx([290.0, 300.0], rel=1e-14)


def test_thrust_is_linear_in_a_phase_and_nothing_outside_its_table():
    scene = Scene.from_toml(FULL)
    d, tau, H = scene.groups.drive, scene.time_scale, scene.horizontal_tension
    known = (0, 0.5, 0), (1, 0.5, 10), (1, 1.25, 25), (2, 2, 40), (3, 2.75, -5), (3, 3, -20), (4, 3, 0)
    for phase, t, force in known:
        assert d.thrust(t / tau, phase) * H == pytest.approx(force, abs=1e-12 * H), (phase, t)
    np.testing.assert_allclose(H * d.thrust(np.array([1.25, 2.75]) / tau, np.array([1, 3])), [25.0, -5.0], rtol=1e-12)
    lasting = Scene.from_toml(FREE + "thrust = 33.0").groups.drive
    assert len(lasting.phases) == 1
    assert lasting.thrust(0.7 * lasting.end_time, 0) * H == pytest.approx(33.0, rel=1e-14)


def test_the_hold_goes_from_all_to_nothing_without_a_jump_of_its_slope():
    d = Drive(mode="free", release=0.8)
    assert (d.remaining_hold_fraction(0.0), d.remaining_hold_fraction(0.8), d.remaining_hold_fraction(3.0)) == (
        1.0,
        0.0,
        0.0,
    )
    assert d.remaining_hold_fraction(0.4) == pytest.approx(0.5, rel=1e-15)
    assert abs(d.remaining_hold_fraction(1e-7) - 1.0) < 1e-12 > d.remaining_hold_fraction(0.8 - 1e-7)
    assert Drive(mode="free").remaining_hold_fraction(0.0) == 0.0


@pytest.mark.parametrize(
    "text",
    [FULL, FREE, FREE + "thrust = -3.0", FREE + "end = {place = 100.0}", HAUL + "start = 9.0", GOOD],
    ids=["full", "free", "thrust", "place", "haul", "grip"],
)
def test_a_drive_round_trips(text):
    scene = Scene.from_toml(text)
    again = Scene.from_toml(scene.to_toml())
    assert again == scene
    assert again.to_toml() == scene.to_toml()
    assert again.groups == scene.groups
    assert hash(again) == hash(scene)
    assert scene.variant(mu=0.31).drive == scene.drive
    assert str(scene.drive) in str(scene)


def test_a_drive_that_grips_is_not_written():
    scene = Scene.from_toml(GOOD + '[drive]\nmode = "grip"')
    assert scene == Scene.from_toml(GOOD)
    assert "drive" not in scene.to_toml()
    assert scene.groups.drive == Drive()


def test_a_hauled_car_runs_its_law_between_start_and_end():
    law = 'kind = "accelerate_cruise_brake"\ntop_speed = 6.0'
    scene = Scene.from_toml(HAUL.replace(TRAVEL, law) + "start = 10.0\nend = {place = 310.0}")
    motion = scene.groups.motion
    assert motion.start_position * scene.length == pytest.approx(10.0, rel=1e-14)
    assert motion.end_position * scene.length == pytest.approx(310.0, rel=1e-14)
    assert scene.arrival_time == pytest.approx(5.0 / 3.0 * 300.0 / 6.0, rel=1e-14)
    (s0, v0, _), (s1, v1, _) = motion.position_with_rates(0.0, 0), motion.position_with_rates(motion.end_time, 2)
    assert (v0, v1, s1) == (0.0, 0.0, motion.end_position)
    assert s0 == motion.start_position
    assert motion.time_at_position(motion.start_position) == 0.0
    with pytest.raises(ValueError, match="never at"):
        motion.time_at_position(0.9 * motion.start_position)
    d = scene.groups.drive
    assert (d.mode, d.start, d.end_position, d.nominal) == (
        "haul",
        motion.start_position,
        motion.end_position,
        motion.end_time,
    )
    default = Scene.from_toml(HAUL)
    assert (default.groups.motion.start_position, default.groups.motion.end_position) == pytest.approx(
        (0.01, 0.99), rel=1e-13
    )
    assert default.arrival_time == pytest.approx(0.98 * 330.0 / 14.0, rel=1e-13)
    assert Scene.from_toml(HAUL + "end = {time = 3.0}").arrival_time == 3.0


def test_a_hauled_table_is_broken_off_where_the_ride_ends():
    table = 'kind = "table"\ntimes = [0.0, 10.0, 25.0, 40.0]\npositions = [0.0, 60.0, 200.0, 330.0]'
    scene = Scene.from_toml(HAUL.replace(TRAVEL, table) + "start = 20.0")
    grip = Scene.from_toml(GOOD.replace(TRAVEL, table))
    t = scene.arrival_time / scene.time_scale
    assert scene.groups.motion.position(t) * 330.0 == pytest.approx(0.99 * 330.0, rel=1e-12)
    for x in (0.3, 0.7, 1.0):
        here, there = scene.groups.motion.position(x * t), grip.groups.motion.position(x * t)
        assert (here - there) * 330.0 == pytest.approx(20.0, rel=1e-10)


def test_a_free_ride_has_no_pace_of_its_own():
    with pytest.raises(SceneError, match="a free ride finds its own"):
        Scene.from_toml(FREE).variant(speed_ratio=0.2)
    assert math.isfinite(Scene.from_toml(FREE).arrival_time)


@pytest.mark.parametrize(("mu_r", "speed", "part"), [
    (0.02, 1e-3, 0.5), (0.02, 1e-4, 0.05), (0.02, 1e-9, 1.0 / 240.0), (0.02, 1e-2, 1.0), (0.0, 1e-4, 1.0),
])  # fmt: skip
def test_steps_are_short_where_friction_may_turn_round(mu_r, speed, part):
    """Half the time in which weight alone stops the car, and no less than axial waves ask for; only with friction."""
    sigma, axial = 0.1, 0.01
    drive = Drive(mode="free", mu_r=mu_r, nominal=10.0)  # steps of 0.01
    assert drive.step_fraction(axial, sigma, RollingCarState(0.5, speed, 0.0, math.inf, False)) == pytest.approx(
        part, rel=1e-12
    )
