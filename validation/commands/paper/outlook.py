"""The paper's last paragraph on its own cable: a trolley on two wheels, a thrust at an angle, brakes."""

from collections.abc import Callable
from typing import Any

import numpy as np

from cablefem.response import Array
from cablefem.scene.line import Line
from validation.commands.run.motion import ELEMENTS, LineRuns
from validation.core.ladder import Ladder
from validation.core.motion_rows import design_with_bars, turning_and_wheel_load_series
from validation.page.motion import motion_unit

ANGLES = ("0", "5", "15")  # [deg] of the thrust above the line of the wheels
POINT = {"car.sled.wheels": None, "car.sled.drive.thrust.angle": 0.0}
POSITIONS = np.linspace(70.0, 1000.0, 187)  # [m] that all rides pass
Row = dict[str, Any]


def ride_numbers_by_angle(quick: bool) -> Row:
    """Numbers with bars, and series at POSITIONS, of a point mass and of the trolley, by the angle of the thrust."""
    line = Line.load("rocket-trolley")
    lines = {angle: line.replace({"car.sled.drive.thrust.angle": float(angle)}) for angle in ANGLES}
    coarser = 3.0 if quick else 1.0
    ladders = {name: LineRuns(ELEMENTS, each, coarser=coarser).ladder(2, 2) for name, each in lines.items()}
    point = LineRuns(ELEMENTS, line.replace(POINT)).ladder(8, 2)  # without pitch the coarsest run has few elements
    ladders["point"] = point
    return {"x": POSITIONS.tolist(), **{name: _ride_numbers(ladder, point, line) for name, ladder in ladders.items()}}


def _ride_numbers(ladder: Ladder, point: Ladder, line: Line) -> Row:
    """Design numbers; besides where the ride ends, how far its path is from the point mass's, and series over x."""
    at_point = _depths_at_positions(point.finest)
    x = _first_car(ladder.finest).point[:, 0]
    loads = {
        name: of for name, of in turning_and_wheel_load_series(_first_car(ladder.finest)).items() if name != "pitch"
    }
    weight = line.car[0].mass * line.gravity

    def distance_from_point(run: Any) -> float:
        return float(np.abs(_depths_at_positions(run) - at_point).max())

    numbers = {"end": _value_with_bar(ladder, lambda run: float(_first_car(run).point[-1, 0] / line.contact[-1].at[0]))}
    numbers["away"] = _value_with_bar(ladder, distance_from_point)
    numbers["away"]["bar"] += point.bar(distance_from_point)
    for row in design_with_bars(ladder, None, line, motion_unit):
        numbers[row["quantity"]] = row
    return numbers | {
        "change": (_depths_at_positions(ladder.finest) - at_point).tolist(),
        "loads": {name: (np.interp(POSITIONS, x, of) / weight).tolist() for name, of in loads.items()},
    }


def _first_car(run: Any) -> Any:
    return run.motion.cars[0]


def _depths_at_positions(run: Any) -> Array:
    """Depth y of the first car at POSITIONS [m]."""
    x, y = _first_car(run).point.T
    return np.interp(POSITIONS, x, y)


def _value_with_bar(ladder: Ladder, number_of_run: Callable[[Any], float]) -> Row:
    return {"value": number_of_run(ladder.finest), "bar": ladder.bar(number_of_run)}
