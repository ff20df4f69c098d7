"""Timetables and shoes of a line: both solvers share their reading of the TOML, a law reads it again."""

import pytest

from cablefem.scene.line import Line
from tests.motion.lines import OVER, broken_laws
from validation.commands.run.motion import ELEMENTS, SINES, LineRuns

LAW = "timetables"
TRAPEZOID = {"kind": "trapezoid", "top_speed": 4.0, "acceleration": 1.0, "deceleration": 2.0}
TRAVELS = {
    "to the left, with jerk": TRAPEZOID | {"jerk": 1.5, "from": 250.0, "to": 240.0},
    "an emergency stop": TRAPEZOID | {"from": 150.0, "to": 250.0, "stop": {"time": 3.0, "deceleration": 3.0}},
    "a table": {"kind": "table", "times": [0, 1.5, 3, 4.5, 6], "positions": [0, 1, 4, 7, 8], "from": 90.0},
}  # fmt: skip


def hot_line(mode, travel, saddle):
    """A line of 400 m at 40 K above its reference, with or without a saddle at 300 m."""
    supports = [{"name": "left", "kind": "anchor", "at": [0.0, 0.0]}]
    supports += [{"name": "tower", "kind": "saddle", "at": [300.0, -16.0]}] * saddle
    supports.append({"name": "right", "kind": "anchor", "at": [400.0, -20.0]})
    rope = {"mass_per_length": 6.0, "EA": 9e7, "length": 401.5, "expansion": 1.2e-5}
    rope |= {"reference_temperature": 0.0, "temperature": 40.0}
    car = {"name": "car", "mass": 500.0, "drive": {"mode": mode}, "travel": travel}
    return Line(cable=rope, contact=supports, car=[car])


@pytest.mark.parametrize("solver", [ELEMENTS, SINES], ids=lambda x: x.name)
@pytest.mark.parametrize(
    ("travel", "mode", "saddle"),
    [("to the left, with jerk", "grip", False), ("an emergency stop", "haul", False), ("a table", "haul", True)],
)
def test_both_solvers_keep_the_timetable_and_another_one_is_seen(solver, travel, mode, saddle):
    line = hot_line(mode, TRAVELS[travel], saddle)
    ladder = LineRuns(solver, line).ladder(2, 2)
    assert LAW not in broken_laws(line.to_toml(), ladder)
    late = line.replace({"car.car.travel.from": TRAVELS[travel]["from"] + 0.05})
    assert LAW in broken_laws(late.to_toml(), ladder)


@pytest.mark.parametrize("key", ["top_speed", "acceleration", "deceleration"])
def test_a_percent_of_speed_or_acceleration_is_seen(key):
    line = hot_line("haul", TRAPEZOID | {"from": 150.0, "to": 180.0}, False)
    ladder = LineRuns(ELEMENTS, line).ladder(2, 2)
    assert LAW in broken_laws(line.replace({f"car.car.travel.{key}": "+1%"}).to_toml(), ladder)


@pytest.mark.parametrize("solver", [ELEMENTS, SINES], ids=lambda x: x.name)
def test_a_car_that_comes_to_a_shoe_of_another_length_is_seen(solver):
    line = Line.from_toml(OVER)
    ladder = LineRuns(solver, line).ladder(2, 2)
    assert "places of events" not in broken_laws(OVER, ladder)
    assert "places of events" in broken_laws(line.replace({"contact.tower.shoe": 5.1}).to_toml(), ladder)
