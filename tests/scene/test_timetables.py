"""Travel as engineers give it: trapezoids, emergency stops, starts on the way, standstills, a rest after the stop."""

import math
import tomllib

import numpy as np
import pytest

from cablefem import Scene
from cablefem.scene import Trapezoid
from tests.scene.test_faults import GOOD, TRAVEL, scene_faults
from validation.core import timetable

TRAPEZOID = 'kind = "trapezoid"\ntop_speed = 8.0\nacceleration = 0.5\ndeceleration = 0.4\n'
HAUL = '\n[drive]\nmode = "haul"\n'
# of a cable of 330 m
LAWS = {
    "trapezoid": TRAPEZOID,
    "jerk": TRAPEZOID + "jerk = 0.3",
    "from, to": TRAPEZOID + "from = 40.0\nto = 300.0\nrest = 12.0",
    "too short for the top speed": TRAPEZOID + "from = 40.0\nto = 90.0",
    "short, jerk": TRAPEZOID + "from = 40.0\nto = 90.0\njerk = 0.25",
    "stop while cruising": TRAPEZOID + "stop = {time = 20.0, deceleration = 1.5}\nrest = 9.0",
    "stop while accelerating": TRAPEZOID + "jerk = 0.3\nstop = {time = 7.0, deceleration = 1.5}",
    "stop of a constant speed": TRAVEL + "\nfrom = 33.0\nstop = {time = 3.0, deceleration = 2.0}",
    "ramp": TRAVEL + "\nentry_ramp = 30.0\nstop = {time = 9.0, deceleration = 2.0}",
    "law (40)": 'kind = "accelerate_cruise_brake"\ntop_speed = 9.0\nfrom = 50.0',
    "accelerating": 'kind = "constant_acceleration"\nacceleration = 0.7\ninitial_speed = 2.0\nfrom = 20.0',
}
# a car that grips is refused with jerk at a support
CASES = [(n, d) for n in LAWS for d in ("", HAUL) if d or "jerk" not in LAWS[n] or "from" in LAWS[n]]


def scene_with_travel(law, drive=""):
    return Scene.from_toml(GOOD.replace(TRAVEL, law) + drive)


def motion_in_si_and_scene(law, drive=""):
    made = scene_with_travel(law, drive)
    return made.groups.motion.in_units(1.0 / made.length, 1.0 / made.time_scale), made


@pytest.mark.parametrize(("name", "drive"), CASES)
def test_the_judge_s_timetable_is_the_solvers_travel(name, drive):
    """Two programs read the same keys; another key's value is seen."""
    m, made = motion_in_si_and_scene(LAWS[name], drive)
    t = np.linspace(0.0, m.end_time * (1.0 - 1e-9), 301)
    x = tomllib.loads(made.to_toml())
    said = timetable.Timetable(x["travel"], x.get("drive", {}), made.length).positions_at(t)
    np.testing.assert_allclose(m.position(t), said, rtol=0.0, atol=1e-9 * made.length)
    for key in x["travel"].keys() & {"acceleration", "speed", "from", "stop"}:
        value = x["travel"][key]
        wrong = {**value, "time": value["time"] * 1.001} if isinstance(value, dict) else value * 1.001
        other = timetable.Timetable({**x["travel"], key: wrong}, x.get("drive", {}), made.length).positions_at(t)
        assert np.nanmax(np.abs(other - said)) > 1e-4, key


def test_a_trapezoid_takes_the_times_of_the_textbook():
    m, made = motion_in_si_and_scene(TRAPEZOID)
    (_, t1), (_, t2), (_, t3) = m.phases
    np.testing.assert_allclose([t1, t3 - t2], [16.0, 20.0], rtol=1e-12)
    assert t3 == pytest.approx(18.0 + made.length / 8.0, rel=1e-12)
    assert m.top_speed == pytest.approx(8.0, rel=1e-12)
    assert m.position_with_rates(t3, 2)[:2] == (pytest.approx(made.length, rel=1e-15), pytest.approx(0.0, abs=1e-13))


def test_a_way_too_short_for_the_top_speed_is_run_with_what_it_allows():
    m, _ = motion_in_si_and_scene(LAWS["too short for the top speed"])
    assert m.top_speed == pytest.approx(math.sqrt(2.0 * 50.0 / (1.0 / 0.5 + 1.0 / 0.4)), rel=1e-10)
    assert (m.start_position, m.end_position) == (pytest.approx(40.0), pytest.approx(90.0))


def test_with_jerk_the_acceleration_is_continuous_and_bounded():
    m, _ = motion_in_si_and_scene(LAWS["jerk"], HAUL)
    t = np.linspace(0.0, m.end_time, 20001)
    a = m.positions_with_rates(t, 0)[2]
    assert len(m.phases) == 1
    assert a.max() == pytest.approx(0.5, rel=1e-6)
    assert a.min() == pytest.approx(-0.4, rel=1e-6)
    assert np.abs(np.diff(a)).max() <= 0.3 * (t[1] - t[0]) * (1.0 + 1e-6)
    faster = Trapezoid(top_speed=3.0, acceleration=0.5, deceleration=0.4, jerk=0.2).faster(2.0)
    assert (faster.top_speed, faster.acceleration, faster.jerk) == (6.0, 2.0, 1.6)


def test_an_emergency_stop_ends_after_its_braking_way_and_is_rested():
    m, made = motion_in_si_and_scene(LAWS["stop of a constant speed"])
    assert m.end_position == pytest.approx(33.0 + 3.0 * 14.0 + 14.0**2 / 4.0, rel=1e-12)
    assert made.arrival_time == pytest.approx(3.0 + 7.0, rel=1e-12)
    rested = scene_with_travel(LAWS["stop of a constant speed"] + "\nrest = 8.0")
    assert rested.arrival_time == pytest.approx(18.0, rel=1e-12)
    assert rested.groups.motion.standstill_phases == [rested.groups.motion.phases[-1]]
    assert Scene.from_toml(rested.to_toml()) == rested


def test_equal_positions_are_a_standstill():
    table = "kind = 'table'\ntimes = [0, 5, 10, 15, 20, 30, 40, 50]\npositions = [0, 20, 45, 75, 100, 100, 150, 200]"
    m, _ = motion_in_si_and_scene(table)
    (stands,) = m.standstill_phases
    np.testing.assert_allclose(stands, [20.0, 30.0], rtol=1e-12)
    t = np.linspace(*stands, 11)
    np.testing.assert_allclose(m.position(t), 100.0, rtol=1e-14)
    np.testing.assert_allclose([m.position_with_rates(20.0, 0)[1], m.position_with_rates(30.0, 2)[1]], 0.0, atol=1e-12)
    np.testing.assert_allclose(m.position([5.0, 10.0, 40.0, 50.0]), [20.0, 45.0, 150.0, 200.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (TRAPEZOID + "to = 331.0", "travel.to = 331.0: must be at most 330 m, the end of the ride"),
        (TRAPEZOID + "from = 100.0\nto = 90.0",
         "travel.from = 100.0: must be from 0.033 m to less than 90 m, the end of the travel"),
        (TRAVEL + "\nrest = 3.0", "travel.rest = 3.0: the mass still moves with 14 m/s at the end of its travel"),
        (TRAPEZOID + "rest = 3.0", "travel.rest = 3.0: the mass is on the far support then; must stop before 330 m"),
        (TRAVEL + "\nstop = {time = 30.0, deceleration = 1.0}",
         "travel.stop.time = 30.0: must be < 23.5714 s, the end of the travel"),
        (TRAVEL + "\nstop = {time = 23.0, deceleration = 1.0}",
         "travel.stop.deceleration = 1.0: the mass comes to rest at 420 m; must be by 330 m"),
        (TRAVEL + "\nstop = {time = 3.0}",
         "travel.stop.deceleration: missing; must be a number > 0, from 1e-12 to 1e+15"),
        ("kind = 'table'\ntimes = [0, 1, 2]\npositions = [0, 0, 0]", "travel.positions: the mass never moves"),
        (TRAPEZOID + "jerk = 0.3", "travel.jerk = 0.3: not yet from a support; must be let in on the way by from"),
        (TRAVEL + "\nfrom = 20.0" + HAUL + "start = 30.0",
         "travel.from = 20.0: too much beside drive.start = 30.0; give one of them"),
    ],
)  # fmt: skip
def test_what_no_car_can_do_is_said_in_one_line(law, expected):
    (line,) = scene_faults(GOOD.replace(TRAVEL, law))
    assert line.startswith(expected)


OBSTACLES = """
[[obstacle]]
name = "tree"
at = 180.0
top = 22.0
[[obstacle]]
name = "road"
at = 300.0
top = 40
"""


def test_obstacles_and_ground_are_read_and_written(tmp_path):
    text = "ground = [[0, 30.0], [200.0, 55], [320.0, 28.0]]\n" + GOOD.replace(
        "mass = 75.0", "mass = 75.0\nbelow = 2.5"
    )
    made = Scene.from_toml(text + OBSTACLES)
    assert [(o.name, o.at, o.top) for o in made.obstacle] == [("tree", 180.0, 22.0), ("road", 300.0, 40.0)]
    assert made.ground == ((0.0, 30.0), (200.0, 55.0), (320.0, 28.0))
    assert made.mass.below == 2.5
    assert Scene.from_toml(made.to_toml()) == made
    assert made.groups == Scene.from_toml(GOOD).groups
    (tmp_path / "terrain.csv").write_text("x,depth\n0,30\n200,55\n320,28\n")
    (tmp_path / "line.toml").write_text('ground = "terrain.csv"\n' + GOOD)
    assert Scene.load(tmp_path / "line.toml").ground == made.ground


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ground = [[0, 1], [0, 2]]", "ground = [[0, 1], [0, 2]]: must be a list of at least two points"),
        ('ground = "nowhere.csv"', "ground = 'nowhere.csv': must be a readable CSV file in"),
        ("obstacle = 3", "obstacle = 3: must be a list of tables {name = ..., at = ..., top = ...}"),
    ],
)
def test_bad_ground_is_refused(text, expected):
    (line,) = scene_faults(text + GOOD)
    assert line.startswith(expected)


def test_bad_obstacles_are_refused():
    text = GOOD + OBSTACLES.replace("road", "tree").replace("at = 300.0", "at = 330")
    assert scene_faults(text) == [
        "obstacle[1].name = 'tree': given twice; names must differ",
        "obstacle[1].at = 330.0: must be from 0 to 320 m, between the supports",
    ]
    taken = "obstacle[0].name = 'the ground': stands for `ground`; must be another name"
    assert scene_faults(GOOD + OBSTACLES.replace("tree", "the ground")) == [taken]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("x,depth\n0,30\n\nhill,55\n", r"line 4 \['hill', '55'\]"),
        ("O,3O\n200,55\n320,28\n", "line 1"),  # letters for zeros
        ("0,3O\n200,55\n320,28\n", "line 1"),
        ("x,depth\n0,30,5\n200,55\n", "line 2"),  # a decimal comma
        ("x,depth\n0;30\n200;55\n", "line 2"),
    ],
)
def test_a_mistyped_row_of_the_ground_is_refused_with_its_line(tmp_path, text, line):
    (tmp_path / "terrain.csv").write_text(text)
    (tmp_path / "line.toml").write_text('ground = "terrain.csv"\n' + GOOD)
    with pytest.raises(ValueError, match=f"{line}.* must hold two numbers"):
        Scene.load(tmp_path / "line.toml")


def test_a_table_that_ends_slowly_ends_at_rest():
    """A curve through these rows alone would swing back before its end, with -1.5 m/s."""
    m, _ = motion_in_si_and_scene("kind = 'table'\ntimes = [0, 10, 20, 30, 34]\npositions = [0, 66, 132, 198, 202]")
    assert m.position_with_rates(34.0, 0)[1] == pytest.approx(0.0, abs=1e-12)
    assert min(speed for _, speed in m.speeds_where_extreme) >= -1e-12
