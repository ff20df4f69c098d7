"""The paper's last paragraph on its own cable: a trolley on two wheels, a thrust at an angle, brakes."""

from collections.abc import Callable
from typing import Any

import numpy as np

from cablefem.response import Array
from cablefem.scene.line import Line
from validation.commands.run.motion import ELEMENTS, LineRuns
from validation.core.ladder import Ladder
from validation.core.motion_rows import design_with_error_bars, turning_and_wheel_load_series
from validation.page.motion import motion_unit

ANGLES = ("0", "5", "15")  # [deg] of the thrust above the line of the wheels
POINT_MASS = {"car.sled.wheels": None, "car.sled.drive.thrust.angle": 0.0}
POSITIONS = np.linspace(70.0, 1000.0, 187)  # [m] that all rides pass
Row = dict[str, Any]


def rides_by_thrust_angle(quick: bool) -> Row:
    """Numbers with bars, and series at POSITIONS, of a point mass and of the trolley, by the angle of the thrust."""
    line = Line.load("rocket-trolley")
    coarser = 3.0 if quick else 1.0
    ladders = {}
    for angle in ANGLES:
        thrust = line.replace({"car.sled.drive.thrust.angle": float(angle)})
        ladders[angle] = LineRuns(ELEMENTS, thrust, coarser=coarser).ladder(2, 2)
    # without pitch the coarsest run has few elements
    point_mass = LineRuns(ELEMENTS, line.replace(POINT_MASS)).ladder(8, 2)
    ladders["point"] = point_mass
    rides = {name: _ride_numbers(ladder, point_mass, line) for name, ladder in ladders.items()}
    return {"x": POSITIONS.tolist(), **rides}


def _ride_numbers(ladder: Ladder, point_mass: Ladder, line: Line) -> Row:
    """Design numbers; besides where the ride ends, how far its path is from the point mass's, and series over x."""
    car = _first_car(ladder.finest)
    weight = line.car[0].mass * line.gravity
    span = line.contact[-1].at[0]
    depths_of_point_mass = _car_depths_at_positions(point_mass.finest)

    def end(run: Any) -> float:
        return float(_first_car(run).point[-1, 0] / span)

    def distance_from_point_mass(run: Any) -> float:
        return float(np.abs(_car_depths_at_positions(run) - depths_of_point_mass).max())

    away = _value_with_error_bar(ladder, distance_from_point_mass)
    away["bar"] += point_mass.error_bar(distance_from_point_mass)
    numbers = {"end": _value_with_error_bar(ladder, end), "away": away}
    for row in design_with_error_bars(ladder, None, line, motion_unit):
        numbers[row["quantity"]] = row
    loads = {}
    for name, load in turning_and_wheel_load_series(car).items():
        if name != "pitch":
            loads[name] = (np.interp(POSITIONS, car.point[:, 0], load) / weight).tolist()
    change = _car_depths_at_positions(ladder.finest) - depths_of_point_mass
    return numbers | {"change": change.tolist(), "loads": loads}


def _first_car(run: Any) -> Any:
    return run.motion.cars[0]


def _car_depths_at_positions(run: Any) -> Array:
    """Depth y of the first car at POSITIONS [m]."""
    x, y = _first_car(run).point.T
    return np.interp(POSITIONS, x, y)


def _value_with_error_bar(ladder: Ladder, value_of_run: Callable[[Any], float]) -> Row:
    return {"value": value_of_run(ladder.finest), "bar": ladder.error_bar(value_of_run)}
