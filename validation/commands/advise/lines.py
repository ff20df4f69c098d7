"""What a line in motion needs: states of rest, points for cars whose cabins swing or that have two wheels, or bodies.

By run, and of points by formula, too: the line with its bodies against the same line with points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cablefem import catenary_line
from cablefem.motion import CarMotion
from cablefem.response import Array, write_json
from cablefem.scene.bodies import Hanger, Wheels
from cablefem.scene.contacts import Car
from cablefem.scene.drive import Thrust
from cablefem.scene.line import Line
from validation.commands.check.motion import deflection_tension_and_weight_scales
from validation.commands.run.motion import ELEMENTS, LineRuns
from validation.commands.run.quasi import largest_distances_from_rest, line_at_timetable_positions_or_refused
from validation.core import store
from validation.core.agreement import FORCES
from validation.core.motion_rows import LineRun, turning_and_wheel_load_series
from validation.core.sidebyside import Progress, no_progress
from validation.core.wheels import approximate_pitch_period, neglected_wheel_load

Row = dict[str, Any]


def advise_on_line_and_write(line: Line, tol: float, out: Path, report: Progress = no_progress) -> Row:
    """Write advice.json: distances of states of rest from the motion, those of points from bodies, and periods."""
    report("with all bodies", 0.0)
    runs = LineRuns(ELEMENTS, _line_with_car_model(line, "rigid"))
    run = runs.run(2, 2)
    scales = deflection_tension_and_weight_scales(line, run)
    allowed = _Allowed(tol * scales.path, FORCES * tol * scales.tension, FORCES * tol, scales.weights)
    content: Row = {"scene": line.name, "scene_toml": line.to_toml(), "tol": tol, "bodies": [], "periods": []}
    report("states of rest", 0.5)
    content["at_rest"], content["no_rest"] = [], ""
    try:
        rest = line_at_timetable_positions_or_refused(line).solve_at_rest(catenary_line.solve)
    except store.Refused as refused:
        content["no_rest"] = str(refused)
    else:
        distances = largest_distances_from_rest(rest, runs.line, run)
        content["at_rest"] = [
            allowed.row(name, need, distance) for name, of in distances.items() for need, distance in of.items()
        ]
    if any(car.turning is not None for car in run.motion.cars):
        report("with points", 0.6)
        content["bodies"], content["periods"] = _point_mass_rows(line, runs, run, allowed)
    write_json(out / "advice.json", store.nulls_for_nonfinite(content))
    return content


@dataclass(frozen=True, slots=True)
class _Allowed:
    """Largest distances within the tolerance."""

    path: float  # [m]
    tension: float  # [N]
    share: float  # of the weight of a car, for other forces
    weights: dict[str, float]  # [N] by car

    def row(self, name: str, need: str, distance: float, formula: float | None = None) -> Row:
        """The row of advice.json of a contact or car."""
        limits = {"path": self.path, "tension": self.tension}
        allowed = limits[need] if need in limits else self.share * self.weights[name]
        row: Row = {"car": name, "need": need.replace("_", " "), "unit": "m" if need == "path" else "N"}
        return row | {"formula": formula, "run": distance, "allowed": allowed, "enough": distance <= allowed}


def _point_mass_rows(line: Line, bodies: LineRuns, body_run: LineRun, allowed: _Allowed) -> tuple[list[Row], list[Row]]:
    """Distances of points from bodies, and periods of these beside starts and stops."""
    points = LineRuns(ELEMENTS, _line_with_car_model(line, "point"), bodies)
    point_run = points.run(2, 2)
    rows: list[Row] = []
    periods: list[Row] = []
    short = 0.1  # period over the duration of a start or stop that a point follows
    cars = zip(line.car, bodies.line.cars_on_rope, body_run.motion.cars, point_run.motion.cars, strict=True)
    for table, car, body, point in cars:
        if body.turning is None:
            continue
        ramp = _shortest_start_or_stop(car)
        formulas: dict[str, float] = {}
        if table.wheels is not None:
            # the pitch is slowest where the rope is least taut
            period = approximate_pitch_period(table.wheels, table.mass, float(np.min(point.tension_ahead)))
            formulas = _errors_without_two_wheels(table.wheels, table.mass, line.gravity, point_run.motion.t, point)
        else:
            assert table.hanger is not None
            period = _swing_period(table.hanger, line.gravity)
            formulas["haul force"] = _haul_force_error_without_cabin(table.hanger, point, ramp, period)
        periods.append({"car": car.name, "period": period, "ramp": ramp, "short": period <= short * ramp})
        for need, distance in _max_distances_by_need(body_run, body, point_run, point).items():
            rows.append(allowed.row(car.name, need, distance, formulas.get(need)))
    return rows, periods


def _line_with_car_model(line: Line, model: Literal["rigid", "point"]) -> Line:
    """The line whose cars are bodies or points; a point has no cabin and no thrust at an angle."""
    changes: dict[str, Any] = {}
    for car in line.car:
        if car.wheels is not None and car.wheels.inertia:
            changes[f"car.{car.name}.wheels.model"] = model
        if model == "point":
            changes[f"car.{car.name}.hanger"] = None
            if car.drive is not None and isinstance(car.drive.thrust, Thrust):
                changes[f"car.{car.name}.drive.thrust.angle"] = 0.0
    return line.replace(changes)


def _shortest_start_or_stop(car: Car) -> float:
    """Shortest phase [s] of a timetable that accelerates; 0 of a free car, whose forces jump."""
    if car.travel is None:
        return 0.0
    durations = []
    for i, (t0, t1) in enumerate(car.travel.phases):
        acceleration = car.travel.position_with_rates(0.5 * (t0 + t1), i)[2]
        if acceleration:
            durations.append(t1 - t0)
    return min(durations, default=math.inf)


def _swing_period(hanger: Hanger, gravity: float) -> float:
    """Period [s] of a cabin that swings through small angles."""
    h = hanger.length
    inertia_per_mass = hanger.gyration**2 + h**2
    return 2.0 * math.pi * math.sqrt(inertia_per_mass / (gravity * h))


def _errors_without_two_wheels(
    wheels: Wheels, mass: float, gravity: float, t: Array, motion: CarMotion
) -> dict[str, float]:  # fmt: skip
    """By need, what a point misses of two wheels: m g cos(beta) b/(4 N) [m] of the path, loads of wheels [N]."""
    lever = 0.5 * wheels.base / (motion.tension_behind + motion.tension_ahead)  # b/(4 N)
    path = float(np.max(motion.contact_force * lever))
    load = neglected_wheel_load(wheels, mass, gravity, t, motion)
    return {"path": path, "haul force": 0.0, "wheel_rear": load, "wheel_front": load}


def _haul_force_error_without_cabin(hanger: Hanger, motion: CarMotion, ramp: float, period: float) -> float:
    """2 m a |sin(w t/2)| [N], what a point misses of a cabin that swings after a stop of t = ramp."""
    largest = float(np.max(np.linalg.norm(motion.acceleration, axis=1)))
    swings = abs(math.sin(math.pi * ramp / period)) if math.isfinite(ramp) else 0.0
    return 2.0 * hanger.mass * largest * swings


def _max_distances_by_need(
    body_run: LineRun, body: CarMotion, point_run: LineRun, point: CarMotion
) -> dict[str, float]:  # fmt: skip
    """By need, the largest distance of a body from a point at equal times.

    That of the path [m] is across the rope, those of forces [N] are of means over an axial round trip.
    """
    assert body.turning is not None
    end = min(body_run.end_time, point_run.end_time)
    wheel_points = [wheel.point for wheel in body.turning.wheels] or [body.point]
    middle = np.mean(wheel_points, axis=0)  # of both wheels (n, 2)
    distance = body_run.at_common_instants(middle, end) - point_run.at_common_instants(point.point, end)
    along = point_run.at_common_instants(point.slope_behind + point.slope_ahead, end)
    across = along[:, 0] * distance[:, 1] - along[:, 1] * distance[:, 0]
    out = {"path": float(np.max(np.abs(across) / np.linalg.norm(along, axis=1)))}

    forces = {"tension": (body.tension_ahead, point.tension_ahead), "haul force": (body.haul_force, point.haul_force)}
    point_loads = turning_and_wheel_load_series(point)
    for name, values in turning_and_wheel_load_series(body).items():
        if name in point_loads:
            forces[name] = values, point_loads[name]
    for need, (of_body, of_point) in forces.items():
        if np.isfinite(of_body).all():
            mean = body_run.at_common_instants(body_run.mean_over_axial_round_trip(of_body), end)
            point_mean = point_run.at_common_instants(point_run.mean_over_axial_round_trip(of_point), end)
            out[need] = float(np.max(np.abs(mean - point_mean)))
    return out
