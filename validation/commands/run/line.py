"""Numbers of a line at rest at each position of its cars, their extremes, its outcome, and the envelope.

Quantities are named `quantity:contact`, `quantity:car` or `quantity:obstacle`. SI; depths below the first contact.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from cablefem import catenary_line
from cablefem.response import Array, write_csv, write_json, write_text
from cablefem.scene.line import Car, Line, LineRest, LineState, NoLineAtRest
from cablefem.scene.surroundings import GROUND
from validation.commands.run.lines import TOUCHES, LineAnswers, Row
from validation.core import store
from validation.core.answers import STATIONS, Outcome
from validation.core.clearances import obstacle_and_ground_profiles
from validation.core.scene_data import ROUNDING
from validation.page import terminal
from validation.page.answer import many as table
from validation.page.line import (
    WORDS,
    base_quantity,
    extremes_table_rows,
    few_cars_text,
    names_of_extremes,
    print_line_summary,
    three_decimals_text,
)

# in the table of the terminal
NOT_PRINTED = ("tension", "tension_behind", "tension_ahead", "pressure", "pressure_down", "load")


def numbers_by_position(rest: LineRest) -> list[Row | None]:
    """Numbers of all positions; None without rest."""
    return [_numbers_at_position(rest, i) if i in rest.states else None for i in range(len(rest.positions))]


def _numbers_at_position(rest: LineRest, position: int) -> Row:
    """Numbers of a position by name; None for what a car on a shoe has not, and for what is not finite."""
    line = rest.line
    state = rest.states[position]
    out: Row = {}
    for car in line.car:
        out |= _numbers_at_car(rest, position, car)
    for j in range(len(line.contact)):
        out |= _numbers_at_contact(rest, position, j)
    for a, b in itertools.pairwise(line.contact):
        between = state.station_index(a.name), state.station_index(b.name)
        out[f"sag:{a.name} to {b.name}"] = catenary_line.sag_between_stations(state, *between)
    out |= _rope_tensions_and_clearances(line, state)
    return {name: None if isinstance(x, float) and not math.isfinite(x) else x for name, x in out.items()}


def _rope_tensions_and_clearances(line: Line, state: LineState) -> Row:
    """Extreme tensions, safety factor, and clearances of the rope over obstacles and the ground."""
    out: Row = {"tension_max": float(np.nanmax(state.station_tensions))}
    out["tension_min"] = catenary_line.min_tension(state)
    if line.cable.breaking_load is not None:
        out["safety_factor"] = line.cable.breaking_load / out["tension_max"]
    for obstacle in line.obstacle:
        depths, _ = catenary_line.depth_and_tension_at_x(state, np.array([obstacle.at]))
        out[f"clearance_rope:{obstacle.name}"] = obstacle.top - float(depths[0])
    if line.ground:
        out[f"clearance_rope:{GROUND}"] = catenary_line.min_rope_clearance(state, np.array(line.ground))
    return out


def _numbers_at_car(rest: LineRest, position: int, car: Car) -> Row:
    """Position, depth, shoe, clearance over the ground and forces of a car; no forces on a shoe."""
    line = rest.line
    state = rest.states[position]
    x = line.position_of(car, position)
    shoe = line.saddle_with_shoe_at(x)
    forces = {"tension_behind": state.station_tensions[:, 0], "tension_ahead": state.station_tensions[:, 1]}
    if car.hauled:
        forces["haul"] = state.haul
    if shoe is None:
        k = state.station_index(car.name)
        depth = float(state.points[k, 1])
        values: Row = {f"{name}:{car.name}": float(N[k]) for name, N in forces.items()}
    else:
        depth = _depth_on_shoe(rest, position, car, shoe.at)
        values = {f"{name}:{car.name}": None for name in forces}
    out: Row = {f"x:{car.name}": x, f"depth:{car.name}": depth, f"on:{car.name}": shoe and shoe.name}
    out |= values
    for name, profile in obstacle_and_ground_profiles(line).items():
        if profile[0, 0] <= x <= profile[-1, 0]:
            out[f"clearance_car:{car.name} over {name}"] = float(np.interp(x, *profile.T)) - depth - car.below
    return out


def _depth_on_shoe(rest: LineRest, position: int, car: Car, saddle: tuple[float, float]) -> float:
    """Depth of a car on a shoe: a smooth rail over the saddle, from and to where the car hangs on the rope.

    At its ends the rail runs along the chords to the saddle, there with their mean slope.
    """
    left, right = (state.points[state.station_index(car.name)] for state in rest.shoe_ends[position, car.name])
    x, y = np.array([left, saddle, right]).T
    slopes = np.diff(y) / np.diff(x)  # of both chords
    rail = CubicHermiteSpline(x, y, [slopes[0], slopes.mean(), slopes[1]])
    return float(rail(rest.line.position_of(car, position)))


def _numbers_at_contact(rest: LineRest, position: int, contact_index: int) -> Row:
    """Load, bend and travel of a contact at a position."""
    line = rest.line
    state = rest.states[position]
    contact = line.contact[contact_index]
    name = contact.name
    k = state.station_index(name)
    out = {f"tension:{name}": float(np.nanmax(state.station_tensions[k]))}
    if contact.kind == "saddle":
        across, down = state.rope_force_on_stations[k].tolist()
        shoes = [line.saddle_with_shoe_at(line.position_of(car, position)) for car in line.car]
        mass = sum(car.mass for car, shoe in zip(line.car, shoes, strict=True) if shoe is contact)
        load_down = down + mass * line.gravity
        out[f"load:{name}"] = math.hypot(across, load_down)
        out[f"load_down:{name}"] = load_down
        out[f"pressure:{name}"] = math.hypot(across, down)
        out[f"pressure_down:{name}"] = down
        out[f"knee:{name}"] = _downward_bend_degrees(state, k)
        out[f"knee_empty:{name}"] = _downward_bend_degrees(rest.empty, contact_index)
        out[f"direction:{name}"] = math.degrees(math.atan2(across, down))
        out[f"rope_over:{name}"] = float(rest.empty.s[contact_index] - state.s[k])
    elif contact.kind == "counterweight":
        taken = float(np.ptp(state.s) - np.ptp(rest.empty.s))
        case = state.case
        out[f"rise:{name}"] = case.thermal_stretch * (1.0 + case.stations[k].force / case.EA) * taken
    elif contact.kind == "spring":
        out[f"shift:{name}"] = math.dist(state.points[k], contact.at)
    return out


def _downward_bend_degrees(state: LineState, station: int) -> float:
    """Angle [deg] by which the rope bends down at a station."""
    behind, ahead = (math.atan2(pulls[station, 1], pulls[station, 0]) for pulls in (state.behind, state.ahead))
    return math.degrees(ahead - behind)


def max_and_min_rows(line: Line, rows: Sequence[Row | None]) -> list[Row]:
    """Design numbers: largest and smallest value of each quantity, with its position; rows : numbers by position."""
    out = []
    for name, values in _values_by_quantity(rows).items():
        unit = WORDS[name.partition(":")[0]]["unit"]
        for word, quantity in names_of_extremes(name).items():
            extreme, _ = max(values) if word == "max" else min(values)
            rounding = ROUNDING * abs(extreme)
            value, i = next(x for x in values if abs(x[0] - extreme) <= rounding)  # the first of equal ones
            cars = {car.name: line.position_of(car, i) for car in line.car}
            number = {"quantity": quantity, "value": value, "bar": None, "unit": unit}
            out.append(number | {"position": i + 1, "at": cars})
    return out


def _values_by_quantity(rows: Sequence[Row | None]) -> dict[str, list[tuple[float, int]]]:
    """Values of each quantity, each with the index of its position; rows : numbers by position."""
    values = [(name, i, value) for i, row in enumerate(rows) for name, value in (row or {}).items()]
    series: dict[str, list[tuple[float, int]]] = {}
    for name, i, value in values:
        if isinstance(value, float) and base_quantity(name) != "x":
            series.setdefault(name, []).append((value, i))
    return series


def envelope_columns(rest: LineRest) -> dict[str, Array]:
    """Columns of profile.csv: the empty rope, and the extremes of depth and tension over all positions.

    Where a car that grips is at a station, the tension has two values, and both count.
    """
    span = rest.line.contact[-1].at[0]
    x = np.linspace(0.0, span, STATIONS)
    beside = 1e-9 * span
    sides = [np.clip(x + dx, 0.0, span) for dx in (-beside, beside)]
    depths = []
    tensions = []
    for state in rest.states.values():
        depths.append(catenary_line.depth_and_tension_at_x(state, x)[0])
        tensions += [catenary_line.depth_and_tension_at_x(state, side)[1] for side in sides]
    y = np.array(depths)  # (positions, STATIONS)
    T = np.array(tensions)  # (2 positions, STATIONS)
    y_rest, _ = catenary_line.depth_and_tension_at_x(rest.empty, x)
    out = {"x": x, "y_rest": y_rest, "y_highest": y.min(axis=0), "y_lowest": y.max(axis=0)}
    return out | {"tension_max": T.max(axis=0), "tension_min": T.min(axis=0)}


@dataclass(frozen=True, kw_only=True, repr=False)
class RestAnswers(LineAnswers):
    """A line at rest and its numbers; of a check also the judged rows."""

    rest: LineRest
    numbers: list[Row | None]  # None: a position without rest
    quasi_static: bool = False  # of a line in motion

    @property
    def positions_without_rest(self) -> list[Row]:
        """Number of each such position, and the reason."""
        positions = enumerate(self.rest.positions)
        return [{"position": i + 1, "reason": str(x)} for i, x in positions if isinstance(x, NoLineAtRest)]

    @property
    def status(self) -> Literal["complete", "incomplete"]:
        return "incomplete" if self.positions_without_rest else "complete"

    @property
    def rope_breaks(self) -> bool:
        """Whether the rope is loaded beyond its breaking load."""
        breaking_load = self.line.cable.breaking_load
        return breaking_load is not None and self.tension_max["value"] > breaking_load

    @property
    def collisions(self) -> list[Row]:
        """Negative clearances, the deepest first."""
        clearances = [d for d in self.design if d["quantity"].startswith("clearance") and d["value"] < TOUCHES]
        return sorted(clearances, key=lambda d: d["value"])

    @cached_property
    def needed_counterweight_text(self) -> str:
        """What a counterweight must be for all positions to have a rest, as the end of a sentence."""
        return self.rest.needed_counterweight_text(catenary_line.solve)

    @property
    def outcome(self) -> Outcome:
        """Kinds: breaks, collides, the deepest first, incomplete, carries."""
        parts = []
        tension = self.tension_max
        load = f"{tension['value'] / 1e3:.1f} kN"
        if self.rope_breaks:
            strength = f"{(self.line.cable.breaking_load or 0.0) / 1e3:.1f} kN"
            force = f"{load} in a rope of {strength}{_car_positions_text(tension)}"
            parts.append(Outcome("breaks", f"the rope is loaded beyond its breaking load: {force}"))
        hits = list(map(_collision_text, self.collisions))
        if hits:
            most = 3  # collisions in an outcome
            more = [f"{len(hits) - most} more"] if len(hits) > most else []
            parts.append(Outcome("collides", f"would collide: {', '.join([*hits[:most], *more])}"))
        if self.positions_without_rest:
            without = f"{len(self.positions_without_rest)} of {self.line.position_count} positions have no rest"
            parts.append(Outcome("incomplete", without + self.needed_counterweight_text))
        if not parts:
            count = _position_count_text(self.line.position_count)
            carries = f"at rest at {count}; largest tension {load}{_car_positions_text(tension)}"
            parts.append(Outcome("carries", carries))
        model = "quasi-static, without inertia, friction and drag: " if self.quasi_static else ""
        return Outcome(parts[0].kind, model + "; ".join(part.sentence for part in parts))

    @property
    def methods(self) -> list[str]:
        """Names of both solvers."""
        return ["catenaries", "elements"]

    @property
    def curve_for_grid_page(self) -> list[list[float]]:
        """x and the lowest depths of the rope."""
        profile = envelope_columns(self.rest)
        return [profile["x"].tolist(), profile["y_lowest"].tolist()]

    def write(self, folder: Path | str, seconds: float | None = None) -> None:
        """Write positions.csv, profile.csv, summary.json, scene.toml, and the ropes that the page draws."""
        folder = Path(folder)
        line = self.line
        profile = envelope_columns(self.rest)
        rows = [{"position": i + 1} | (x or {}) for i, x in enumerate(self.numbers)]
        table.write_csv_rows(folder / "positions.csv", rows)
        write_csv(folder / "profile.csv", profile)
        write_text(folder / "scene.toml", line.to_toml())
        outcome = self.outcome
        length = float(np.ptp(self.rest.empty.s))
        write_json(folder / "summary.json", {
            "scene": line.name, "title": line.title, "method": "catenaries", "status": self.status,
            "outcome": outcome.sentence, "outcome_kind": outcome.kind, "refused": self.positions_without_rest,
            "positions": line.position_count, "empty_length": length, "design": self.design, "limits": self.limits,
            "seconds": seconds,
        })  # fmt: skip
        depths = self._sampled_depths_by_position_number(profile["x"])
        ropes = {"profile": {name: values.tolist() for name, values in profile.items()}, "depths": depths}
        write_json(folder / "ropes.json", store.nulls_for_nonfinite(ropes))

    def _sampled_depths_by_position_number(self, x: Array) -> dict[str, list[float]]:
        """Depths of the rope over x at seven positions or fewer, by number of the position."""
        at_rest = list(self.rest.states)
        some = np.unique(np.linspace(0, len(at_rest) - 1, 7).round().astype(int))
        depths = {}
        for k in some:
            i = at_rest[k]
            depth, _ = catenary_line.depth_and_tension_at_x(self.rest.states[i], x)
            depths[str(i + 1)] = depth.tolist()
        return depths

    def print_answer(self, seconds: float) -> None:
        """Print outcome, limits, design numbers, and the first three positions without rest."""
        rows = extremes_table_rows([d for d in self.design if base_quantity(d["quantity"]) not in NOT_PRINTED])
        zero = three_decimals_text(0.0, "m")
        printed = [row for row in rows if row["largest"] != zero or row["smallest"] != "the same"]
        count = len(extremes_table_rows(self.design))
        print_line_summary(self.line, self.outcome.sentence, self.limits, printed, count)
        without_rest = self.positions_without_rest
        most = 3  # reasons
        for x in without_rest[:most]:
            terminal.print_text(f"  position {x['position']}: {x['reason']}", style="bold red")
        if len(without_rest) > most:
            more = len(without_rest) - most
            terminal.print_text(f"  and {more} more positions without rest", style="bold red")
        terminal.print_text(f"  {_position_count_text(self.line.position_count)} in {seconds:.1f} s")


def _position_count_text(count: int) -> str:
    return "1 position" if count == 1 else f"{count} positions"


def _car_positions_text(extreme: Row) -> str:
    """Where the cars are at an extreme number, as the end of a sentence."""
    cars = few_cars_text(extreme, "{} at {:.0f} m")
    many = f" at position {extreme['position']}" if extreme["at"] else ""
    return f" with {cars}" if cars else many


def _collision_text(clearance: Row) -> str:
    """What hits what by how much; clearance : a design number below 0."""
    kind, _, of = clearance["quantity"].partition(":")
    name = f"the rope over {of}" if kind.startswith("clearance_rope") else of
    who, _, what = name.partition(" over ")
    return f"{who} hits {what} by {-clearance['value']:.2f} m{_car_positions_text(clearance)}"


def no_rest_refusal(rest: LineRest) -> store.Refused:
    """The exception for a line without any position at rest, which says what tension would do."""
    needed = rest.needed_counterweight_text(catenary_line.solve)
    return store.Refused(f"{rest.line.name}: no position has a rest; at the first {rest.positions[0]}{needed}")


def answer_line(line: Line, *, rest: LineRest | None = None) -> RestAnswers:
    """Solve a line by catenaries; an error where the empty line or every position has no rest.

    rest : its solution, if there is one.
    """
    if rest is None:
        from validation.commands.run.worst import with_added_positions

        line = with_added_positions(line)
        rest = line.solve_at_rest(catenary_line.solve)
    numbers = numbers_by_position(rest)
    if not any(numbers):
        raise no_rest_refusal(rest)
    return RestAnswers(line=line, rest=rest, numbers=numbers, design=max_and_min_rows(line, numbers))
