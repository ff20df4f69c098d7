"""Whether a point mass is enough for a line in motion whose cars have two wheels or a cabin that swings.

By formula and by run: the line with its bodies against the same line with points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.motion import CarMotion
from cablefem.response import write_json
from cablefem.scene.contacts import Car
from cablefem.scene.drive import Thrust
from cablefem.scene.line import Car as CarTable
from cablefem.scene.line import Line
from validation.commands.check.motion import reference_scales
from validation.commands.run.motion import ELEMENTS, LineRuns
from validation.core import store
from validation.core.agreement import FORCES
from validation.core.motion_rows import LineRun, turning_and_wheel_load_series
from validation.core.sidebyside import Progress, no_progress
from validation.core.wheels import approximate_pitch_period, neglected_wheel_load

Row = dict[str, Any]


def advise_on_bodies(line: Line, tol: float, out: Path, report: Progress = no_progress) -> Row:
    """Write advice.json: distances of points from bodies, and periods beside starts and stops."""
    runs: list[LineRuns] = []
    for model in ("rigid", "point"):
        report("bodies and points", 0.5 * len(runs))
        runs.append(LineRuns(ELEMENTS, _line_with_body_model(line, model), runs[0] if runs else None))
    body, point = (x.run(2, 2) for x in runs)
    scales = reference_scales(line, body)
    allowed = {"path": tol * scales.path, "tension": FORCES * tol * scales.tension}
    rows: list[Row] = []
    periods: list[Row] = []
    short = 0.1  # period over the duration of a start or stop that a point follows
    for table, car, a, b in zip(line.car, runs[0].line.cars_on_rope, body.motion.cars, point.motion.cars, strict=True):
        if a.turning is None:
            continue
        period = _pitch_or_swing_period(table, line.gravity, b)
        ramp = _shortest_ramp_duration(car)
        periods.append({"car": car.name, "period": period, "ramp": ramp, "short": period <= short * ramp})
        formulas = _point_errors_by_formula(table, line.gravity, point, b, ramp, period)
        for need, distance in _point_errors_by_runs(body, a, point, b):
            limit = allowed.get(need, FORCES * tol * scales.weights[car.name])
            rows.append({
                "car": car.name, "need": need.replace("_", " "), "unit": "m" if need == "path" else "N",
                "formula": formulas.get(need), "run": distance, "allowed": limit, "enough": distance <= limit,
            })  # fmt: skip
    content = {"scene": line.name, "scene_toml": line.to_toml(), "tol": tol, "bodies": rows, "periods": periods}
    write_json(out / "advice.json", store.nulls_for_nonfinite(content))
    return content


def _line_with_body_model(line: Line, model: str) -> Line:
    """The line whose cars are bodies ("rigid") or points ("point"), which have no cabin and no thrust at an angle."""
    changes: dict[str, Any] = {}
    for car in line.car:
        if car.wheels is not None and car.wheels.inertia:
            changes[f"car.{car.name}.wheels.model"] = model
        if model == "point":
            changes[f"car.{car.name}.hanger"] = None
            if car.drive is not None and isinstance(car.drive.thrust, Thrust):
                changes[f"car.{car.name}.drive.thrust.angle"] = 0.0
    return line.replace(changes)


def _shortest_ramp_duration(car: Car) -> float:
    """Shortest start or stop [s] of a timetable; 0 of a free car, whose forces jump."""
    if car.travel is None:
        return 0.0
    ramps = []
    for i, (t0, t1) in enumerate(car.travel.phases):
        if car.travel.position_with_rates(0.5 * (t0 + t1), i)[2]:
            ramps.append(t1 - t0)
    return min(ramps, default=math.inf)


def _pitch_or_swing_period(table: CarTable, gravity: float, motion: CarMotion) -> float:
    """Period [s] of the pitch, longest where the rope is least taut, or of the swing."""
    if table.wheels is not None:
        return approximate_pitch_period(table.wheels, table.mass, float(np.min(motion.tension_ahead)))
    assert table.hanger is not None
    h = table.hanger.length
    return 2.0 * math.pi * math.sqrt((table.hanger.gyration**2 + h**2) / (gravity * h))


def _point_errors_by_formula(
    table: CarTable, gravity: float, run: LineRun, motion: CarMotion, ramp: float, period: float
) -> dict[str, float]:
    """Distances of a point from a body by need: m g cos(beta) b/(4 N) of the path.

    Of a cabin 2 m a |sin(w t/2)| after a stop of t.
    """
    if table.wheels is not None:
        lever = 0.5 * table.wheels.base / (motion.tension_behind + motion.tension_ahead)  # b/(4 N)
        load = neglected_wheel_load(table.wheels, table.mass, gravity, run.motion.t, motion)
        path = float(np.max(motion.contact_force * lever))
        return {"path": path, "haul force": 0.0, "wheel_rear": load, "wheel_front": load}
    assert table.hanger is not None
    largest = float(np.max(np.linalg.norm(motion.acceleration, axis=1)))
    swings = abs(math.sin(math.pi * ramp / period)) if math.isfinite(ramp) else 0.0
    return {"haul force": 2.0 * table.hanger.mass * largest * swings}


def _point_errors_by_runs(body: LineRun, a: CarMotion, point: LineRun, b: CarMotion) -> Iterator[tuple[str, float]]:
    """Needs, and the largest distance of a body from a point at equal times: across the rope, and of mean forces.

    a, b : the car in the runs with bodies and with points.
    """
    assert a.turning is not None
    end = min(body.end, point.end)
    middle = np.mean([wheel.point for wheel in a.turning.wheels] or [a.point], axis=0)  # of both wheels (n, 2)
    distance = body.at_common_instants(middle, end) - point.at_common_instants(b.point, end)
    along = point.at_common_instants(b.slope_behind + b.slope_ahead, end)
    across = along[:, 0] * distance[:, 1] - along[:, 1] * distance[:, 0]
    yield "path", float(np.max(np.abs(across) / np.linalg.norm(along, axis=1)))
    forces = [("tension", a.tension_ahead, b.tension_ahead), ("haul force", a.haul_force, b.haul_force)]
    loads = turning_and_wheel_load_series(b)
    for name, values in turning_and_wheel_load_series(a).items():
        if name in loads:
            forces.append((name, values, loads[name]))
    for need, of_body, of_point in forces:
        if np.isfinite(of_body).all():
            mean = body.at_common_instants(body.mean_over_axial_round_trip(of_body), end)
            point_mean = point.at_common_instants(point.mean_over_axial_round_trip(of_point), end)
            yield need, float(np.max(np.abs(mean - point_mean)))
