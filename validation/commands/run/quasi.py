"""A line in motion by the quasi-static model: states of rest, the cars as points where their timetables have them.

It leaves out inertia, friction, drag, and what swings or pitches.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np

from cablefem import catenary_line
from cablefem.motion import CarMotion, ContactMotion
from cablefem.response import Array
from cablefem.scene.contacts import MovingLine
from cablefem.scene.line import Line, LineRest, LineState
from cablefem.scene.moving import line_in_motion
from validation.commands.run.line import RestAnswers, answer_line
from validation.core import store
from validation.core.motion_rows import LineRun


def answer_line_quasi_statically(line: Line) -> RestAnswers:
    """States of rest at the positions of the timetables; Refused for a car that rolls freely."""
    if not line.moves:
        return answer_line(line)
    return replace(answer_line(line_at_timetable_positions_or_refused(line)), quasi_static=True)


def line_at_timetable_positions_or_refused(line: Line) -> Line:
    """A line at rest whose positions are those of the timetables at many times; Refused for a car that rolls freely."""
    for car in line.car:
        if car.mode == "free":
            where = "where it is follows from the motion; must be hauled or grip for --model quasi-static"
            raise store.Refused(line.fault_in_own_keys(f"car.{car.name}.drive.mode = 'free': {where}"))
    moving = line_in_motion(line, catenary_line.solve)
    x = _timetable_positions_by_car(moving, timetable_instants(moving))
    thermal_stretch = 1.0 + line.cable.thermal_strain
    s_by_car = {car.name: x[car.name] / thermal_stretch for car in moving.cars_on_rope if car.along == "s"}
    empty = line.solve_empty_line(catenary_line.solve)
    for name, s in s_by_car.items():
        x[name] = np.interp(s, empty.s, empty.points[:, 0])
    exact = 1e-6  # [m] from where a car is to where its timetable has it
    for _ in range(30 if s_by_car else 0):
        shifts = _x_shifts_to_reach_s(_at_rest_with_cars_at(line, x), s_by_car)
        if max(np.abs(shift).max() for shift in shifts.values()) < exact:
            break
        for name, shift in shifts.items():
            x[name] = x[name] + shift
    return _at_rest_with_cars_at(line, x)


def timetable_instants(moving: MovingLine) -> Array:
    """Instants (n,) [s] of the states of rest, without those at which all cars stand still."""
    count = 81
    t = np.linspace(0.0, moving.t_end, count)
    positions = list(_timetable_positions_by_car(moving, t).values())
    moves = np.any(np.diff(positions, axis=1) != 0.0, axis=0)
    return t[np.append(True, moves)]


def largest_distances_from_rest(rest: LineRest, moving: MovingLine, moved: LineRun) -> dict[str, dict[str, float]]:
    """By contact or car, and by need, the largest distance of a motion from the states of rest at equal times.

    Needs: tension [N] behind or ahead, path [m] of cars, haul force [N] of hauled ones.  Forces of the motion are means
    over an axial round trip.  A car on a shoe does not count.

    rest : of `line_at_timetable_positions_or_refused`.
    """
    states = rest.states
    t = timetable_instants(moving)[[*states]]
    motion = moved.motion
    distances: dict[str, dict[str, float]] = {}
    bodies: list[ContactMotion | CarMotion] = [*motion.contacts, *motion.cars]
    for body in bodies:
        haul_force = body.haul_force if isinstance(body, CarMotion) else np.full(motion.t.size, np.nan)
        forces = [body.tension_behind, body.tension_ahead, haul_force]
        columns = [*body.point.T, *map(moved.mean_over_axial_round_trip, forces)]
        in_motion = np.stack([np.interp(t, motion.t, column) for column in columns])  # (5, m)
        at_rest = np.stack([_numbers_of_station(state, body.name) for state in states.values()], axis=1)
        x, y, behind, ahead, haul = np.abs(in_motion - at_rest)[:, t <= moved.end_time]
        by_need = {"tension": np.fmax(behind, ahead), "haul force": haul}
        if isinstance(body, CarMotion):
            by_need["path"] = np.hypot(x, y)
        known = {need: off[np.isfinite(off)] for need, off in by_need.items()}
        distances[body.name] = {need: float(off.max()) for need, off in known.items() if off.size}
    return distances


def _numbers_of_station(state: LineState, name: str) -> Array:
    """Point [m], tensions behind and ahead and haul force [N] (5,) of a contact or car; nan of what it has not."""
    names = [station.name for station in state.case.stations]
    if name not in names:
        return np.full(5, np.nan)
    k = names.index(name)
    return np.array([*state.points[k], *state.station_tensions[k], state.haul[k]])


def _timetable_positions_by_car(moving: MovingLine, t: Array) -> dict[str, Array]:
    """Prescribed positions (n,) [m] along each car's axis at times t (n,)."""
    ends = [end for _, end in moving.phases]
    phases = np.minimum(np.searchsorted(ends, t), len(ends) - 1)
    positions: dict[str, Array] = {}
    for car in moving.cars_on_rope:
        at = zip(t.tolist(), phases.tolist(), strict=True)
        positions[car.name] = np.array([moving.prescribed_position_with_rates(car, *x)[0] for x in at])
    return positions


def _at_rest_with_cars_at(line: Line, x_by_car: dict[str, Array]) -> Line:
    """The line at rest with its cars as points at x (n,) [m]."""
    data = tomllib.loads(line.to_toml())
    for car, table in zip(line.car, data["car"], strict=True):
        for name in ("travel", "drive", "hanger", "wheels"):
            table.pop(name, None)
        table |= {"hauled": car.mode == "haul", "at": x_by_car[car.name].tolist()}
    return Line(**data)


def _x_shifts_to_reach_s(at_rest: Line, s_by_car: dict[str, Array]) -> dict[str, Array]:
    """How much farther in x (n,) [m] each car must be for its s (n,) [m]; 0 where there is no rest."""
    shifts = {name: np.zeros(s.size) for name, s in s_by_car.items()}
    for i, state in at_rest.solve_at_rest(catenary_line.solve).states.items():
        for name, s in s_by_car.items():
            shifts[name][i] = _x_shift_to_s(state, name, float(s[i]))
    return shifts


def _x_shift_to_s(state: LineState, car_name: str, s: float) -> float:
    """Distance in x [m] along the tangent ahead of a car from where it is to s."""
    k = state.station_index(car_name)
    level, down = state.ahead[k].tolist()
    N = float(np.hypot(level, down))
    case = state.case
    return case.thermal_stretch * (s - float(state.s[k])) * level * (1.0 / N + 1.0 / case.EA)
