"""Numbers of a line at rest at each position of its cars, their extremes, its outcome, and the envelope.

Quantities are named `quantity:contact`, `quantity:car` or `quantity:obstacle`. SI; depths below the first contact.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from cablefem import catenary_line
from cablefem.response import Array, write_csv, write_json, write_text
from cablefem.scene import SceneError
from cablefem.scene.line import Car, Line, LineRest, LineState, NoLine
from cablefem.scene.surroundings import GROUND
from validation.core import limits, store
from validation.core.agreement import Agreement, Verdict, overall
from validation.core.answers import STATIONS, Outcome
from validation.page import report, terminal
from validation.page.answer import many as table
from validation.page.line import WORDS, columns, kind_of, tell
from validation.page.options import Point

NAMED = 3  # collisions in an outcome
TOUCHES = -1e-6  # [m] a rope that ends on the ground does not hit it
Row = dict[str, Any]


def numbers_of(rest: LineRest) -> list[Row | None]:
    """Numbers of all positions; None without rest."""
    return [_numbers(rest, i) if i in rest.states else None for i in range(len(rest.positions))]


def _numbers(rest: LineRest, i: int) -> Row:
    """Numbers of position i; None for what a car on a shoe has not, and for what is not finite."""
    line = rest.line
    state = rest.states[i]
    out: Row = {}
    for car in line.car:
        out |= _at_car(rest, i, car)
    index = {p.name: k for k, p in enumerate(state.case.stations)}
    for j in range(len(line.contact)):
        out |= _at_contact(rest, i, j, index)
    for a, b in itertools.pairwise(line.contact):
        out[f"sag:{a.name} to {b.name}"] = catenary_line.sag(state, index[a.name], index[b.name])
    out["tension_max"] = float(np.nanmax(state.tensions))
    out["tension_min"] = catenary_line.min_tension(state)
    if line.cable.breaking_load is not None:
        out["safety_factor"] = line.cable.breaking_load / out["tension_max"]
    for o in line.obstacle:
        out[f"clearance_rope:{o.name}"] = o.top - float(catenary_line.at(state, np.array([o.at]))[0][0])
    if line.ground:
        out["clearance_rope:ground"] = catenary_line.clearance(state, np.array(line.ground))
    return {name: None if isinstance(x, float) and not math.isfinite(x) else x for name, x in out.items()}


def _at_car(rest: LineRest, i: int, car: Car) -> Row:
    line = rest.line
    state = rest.states[i]
    x = line.place(car, i)
    shoe = line.shoe(x)
    forces = {"tension_behind": state.tensions[:, 0], "tension_ahead": state.tensions[:, 1]}
    if car.hauled:
        forces["haul"] = state.haul
    if shoe is None:
        k = [p.name for p in state.case.stations].index(car.name)
        depth = float(state.place[k, 1])
        values: Row = {f"{name}:{car.name}": float(N[k]) for name, N in forces.items()}
    else:
        depth = _depth_on_shoe(rest, i, car, shoe.at)
        values = {f"{name}:{car.name}": None for name in forces}
    out = {f"x:{car.name}": x, f"depth:{car.name}": depth, f"on:{car.name}": shoe and shoe.name} | values
    ground = np.array(line.ground).reshape(-1, 2)  # (m, 2)
    if line.ground and ground[0, 0] <= x <= ground[-1, 0]:
        out[_over(car, GROUND)] = float(np.interp(x, *ground.T)) - depth - car.below
    return out


def _depth_on_shoe(rest: LineRest, i: int, car: Car, saddle: tuple[float, float]) -> float:
    """Depth of a car on a shoe: a smooth rail over the saddle, from and to where the car hangs on the rope.

    At its ends the rail runs along the chords to the saddle, there with their mean slope.
    """
    states = rest.shoe_ends[i, car.name]
    left, right = (x.place[[p.name for p in x.case.stations].index(car.name)] for x in states)
    x, y = np.array([left, saddle, right]).T
    chords = np.diff(y) / np.diff(x)
    rail = CubicHermiteSpline(x, y, [chords[0], chords.mean(), chords[1]])
    return float(rail(rest.line.place(car, i)))


def _at_contact(rest: LineRest, i: int, j: int, index: dict[str, int]) -> Row:
    """Numbers of contact j at position i; index : station by name."""
    line = rest.line
    state = rest.states[i]
    contact = rest.line.contact[j]
    name = contact.name
    k = index[contact.name]
    out = {f"tension:{name}": float(np.nanmax(state.tensions[k]))}
    if contact.kind == "saddle":
        across, down = state.pressure[k].tolist()
        cars = sum(car.mass for car in line.car if line.shoe(line.place(car, i)) is contact) * line.gravity
        out[f"load:{name}"] = math.hypot(across, down + cars)
        out[f"load_down:{name}"] = down + cars
        out[f"pressure:{name}"] = math.hypot(across, down)
        out[f"pressure_down:{name}"] = down
        out[f"knee:{name}"] = _knee(state, k)
        out[f"knee_empty:{name}"] = _knee(rest.empty, j)
        out[f"direction:{name}"] = math.degrees(math.atan2(across, down))
        out[f"rope_over:{name}"] = float(rest.empty.s[j] - state.s[k])
    elif contact.kind == "counterweight":
        taken = float(np.ptp(state.s) - np.ptp(rest.empty.s))
        out[f"rise:{name}"] = state.case.heat * (1.0 + state.case.stations[k].force / state.case.EA) * taken
    elif contact.kind == "spring":
        out[f"shift:{name}"] = math.dist(state.place[k], contact.at)
    return out


def _knee(state: LineState, k: int) -> float:
    """Angle [deg] by which the rope bends down at a station."""
    behind, ahead = (math.atan2(pull[1], pull[0]) for pull in (state.behind[k], state.ahead[k]))
    return math.degrees(ahead - behind)


def _over(car: Car, what: str) -> str:
    return f"clearance_car:{car.name} over {what}"


def _passing(line: Line, rows: Sequence[Row | None]) -> list[tuple[str, int, float]]:
    """Clearances of cars over obstacles and corners of the ground that they pass, linear between two positions."""
    out = []
    tops = [(o.name, o.at, o.top) for o in line.obstacle] + [(GROUND, *point) for point in line.ground]
    for car in line.car:
        depths = [(i, r[f"depth:{car.name}"]) for i, r in enumerate(rows) if r and r[f"depth:{car.name}"] is not None]
        track = [(i, line.place(car, i), depth) for i, depth in depths]
        for (i, a, y), (_, b, z) in itertools.pairwise([*track, *track[-1:]]):
            for name, at, top in tops:
                if min(a, b) <= at <= max(a, b):
                    w = (at - a) / (b - a) if b != a else 0.0
                    out.append((_over(car, name), i, top - y - w * (z - y) - car.below))
    return out


def extremes(line: Line, rows: Sequence[Row | None]) -> list[Row]:
    """Largest and smallest value of each quantity, and the position of each."""
    known = [(name, i, value) for i, row in enumerate(rows) for name, value in (row or {}).items()]
    series: dict[str, list[tuple[float, int]]] = {}
    for name, i, value in (*known, *_passing(line, rows)):
        if isinstance(value, float) and kind_of(name) != "x":
            series.setdefault(name, []).append((value, i))
    out = []
    for name, values in series.items():
        kind, _, of = name.partition(":")
        for word, pick in (("max", max), ("min", min)):
            if WORDS[kind].get("only", word) == word:
                value, i = pick(values)
                quantity = kind if kind.endswith(f"_{word}") else f"{kind}_{word}"
                out.append({
                    "quantity": f"{quantity}:{of}" if of else quantity, "value": value, "bar": None,
                    "unit": WORDS[kind]["unit"], "position": i + 1, "at": {c.name: line.place(c, i) for c in line.car},
                })  # fmt: skip
    return out


def envelope(rest: LineRest) -> dict[str, Array]:
    """Columns of profile.csv: the empty rope, and the extremes of depth and tension over all positions."""
    x = np.linspace(0.0, rest.line.contact[-1].at[0], STATIONS)
    curves = [catenary_line.at(state, x) for state in rest.states.values()]
    y, T = (np.array([curve[part] for curve in curves]) for part in (0, 1))  # (positions, STATIONS)
    return {
        "x": x, "y_rest": catenary_line.at(rest.empty, x)[0], "y_highest": y.min(axis=0), "y_lowest": y.max(axis=0),
        "tension_max": T.max(axis=0), "tension_min": T.min(axis=0),
    }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Answers:
    """A line at rest and its numbers; of a check also the judged rows."""

    line: Line
    rest: LineRest
    numbers: list[Row | None]  # None: a position without rest
    design: list[Row]
    rows: list[Agreement] = field(default_factory=list)

    def __repr__(self) -> str:
        result = self.verdict.value if self.verdict else self.status
        return f"Answers({self.line.name}: {result}; {self.outcome.sentence})"

    @property
    def verdict(self) -> Verdict | None:
        """Of all rows; None if nothing was compared."""
        return overall(self.rows) if self.rows else None

    @property
    def refused(self) -> list[Row]:
        positions = enumerate(self.rest.positions)
        return [{"position": i + 1, "reason": str(x)} for i, x in positions if isinstance(x, NoLine)]

    @property
    def limits(self) -> list[Row]:
        """Verdicts on the limits of the line."""
        return limits.rows(self.line, self.design)

    @property
    def status(self) -> str:
        return "incomplete" if self.refused else "complete"

    @property
    def outcome(self) -> Outcome:
        """Kinds: breaks, collides, the deepest first, incomplete, carries."""
        tension = next((d for d in self.design if d["quantity"] == "tension_max"), None)
        breaking_load = self.line.cable.breaking_load
        parts = []
        kinds = []
        if tension and breaking_load is not None and tension["value"] > breaking_load:
            kinds.append("breaks")
            force = f"{tension['value'] / 1e3:.1f} kN in a rope of {breaking_load / 1e3:.1f} kN"
            parts.append(f"the rope is loaded beyond its breaking load: {force}{_cars(tension)}")
        hits = [d for d in self.design if d["quantity"].startswith("clearance") and d["value"] < TOUCHES]
        hits.sort(key=lambda d: d["value"])
        if hits:
            kinds.append("collides")
            more = [f"{len(hits) - NAMED} more"] if len(hits) > NAMED else []
            parts.append(f"would collide: {', '.join([*map(_hit, hits[:NAMED]), *more])}")
        if self.refused:
            kinds.append("incomplete")
            parts.append(f"{len(self.refused)} of {self.line.count} positions have no rest")
        if not parts:
            kinds.append("carries")
            force = "" if tension is None else f"; largest tension {tension['value'] / 1e3:.1f} kN{_cars(tension)}"
            parts.append(f"at rest at {_positions(self.line.count)}{force}")
        return Outcome(kinds[0], "; ".join(parts))


def _positions(count: int) -> str:
    return "1 position" if count == 1 else f"{count} positions"


def _cars(number: Row) -> str:
    return f" with {', '.join(f'{name} at {x:.0f} m' for name, x in number['at'].items())}" if number["at"] else ""


def _hit(number: Row) -> str:
    kind, _, of = number["quantity"].partition(":")
    name = f"the rope over {of}" if kind.startswith("clearance_rope") else of
    who, _, what = name.partition(" over ")
    return f"{who} hits {what} by {-number['value']:.2f} m{_cars(number)}"


def answers(line: Line, rest: LineRest | None = None) -> Answers:
    """Solve a line by catenaries; an error where the empty line or every position has no rest.

    rest : its solution, if there is one.
    """
    if rest is None:
        from validation.commands.run.worst import located

        line = located(line)
        rest = line.rest(catenary_line.solve)
    numbers = numbers_of(rest)
    if not any(numbers):
        raise store.Refused(f"{line.name}: no position has a rest; at the first {rest.positions[0]}")
    return Answers(line, rest, numbers, extremes(line, numbers))


def write(folder: Path, result: Answers, seconds: float) -> None:
    """Write positions.csv, profile.csv, summary.json, scene.toml, and the ropes that the page draws."""
    line = result.line
    profile = envelope(result.rest)
    rows = [{"position": i + 1} | (x or {}) for i, x in enumerate(result.numbers)]
    table.write_rows(folder / "positions.csv", rows)
    write_csv(folder / "profile.csv", ",".join(profile), np.stack(list(profile.values()), axis=1))
    write_text(folder / "scene.toml", line.to_toml())
    write_json(folder / "summary.json", {
        "scene": line.name, "title": line.title, "method": "catenaries", "status": result.status,
        "outcome": result.outcome.sentence, "outcome_kind": result.outcome.kind,
        "refused": result.refused, "positions": line.count, "empty_length": float(np.ptp(result.rest.empty.s)),
        "design": result.design, "limits": result.limits, "seconds": seconds,
    })  # fmt: skip
    at_rest = list(result.rest.states)
    # the ropes of some positions are drawn
    drawn = [at_rest[k] for k in np.unique(np.linspace(0, len(at_rest) - 1, 7).round().astype(int))]
    depths = {str(i + 1): catenary_line.at(result.rest.states[i], profile["x"])[0].tolist() for i in drawn}
    ropes = {"profile": {name: values.tolist() for name, values in profile.items()}, "depths": depths}
    write_json(folder / "ropes.json", store.plain(ropes))


def answer(
    command: str, points: Sequence[Point], out: Path | None, solve: Callable[[Line], Answers], require: bool = False
) -> int:
    """Answer a line or a grid, store, draw and print; 1 where solvers do not agree, 2 where a position has no rest."""
    line: Line = points[0].scene
    rows = _many(command, points, out, solve) if len(points) > 1 else [_one(command, line, out, solve)]
    if any(x.get("verdict", "agree") != "agree" for x in rows):
        return 1
    if any(x["status"] != "complete" for x in rows):
        return 2
    return int(require and limits.failed_columns(rows))


def _one(command: str, line: Line, out: Path | None, solve: Callable[[Line], Answers]) -> Row:
    home = "rest-check" if command == "check" else "rest"
    folder = store.claim(out, command, line, [home, "agreement.json"] if command == "check" else [home])
    with terminal.progress() as progress:
        progress(line.name, 0.0)
        begun = perf_counter()
        result = solve(line)
        seconds = perf_counter() - begun
    write(folder / home, result, seconds)
    if result.verdict:
        verdict = result.verdict.value
        rows = [row.row() for row in result.rows]
        agreement = {"verdict": verdict, "methods": ["catenaries", "elements"], "rows": rows, "limits": result.limits}
        write_json(folder / "agreement.json", agreement)
        terminal.say(verdict, style=terminal.STYLES[verdict])
    report.write(folder, command)
    tell(line, result.outcome.sentence, result.design, result.refused, result.limits)
    terminal.say(f"  {_positions(result.line.count)} in {seconds:.2g} s")
    if result.verdict:
        terminal.say(f"  {sure(result.rows)}")
    terminal.say(f"  written to {folder}: report.html, {home}/")
    return _entry(result)


def _entry(result: Answers, **numbers: Any) -> Row:
    """A row of a grid's table."""
    words = {"outcome": result.outcome.sentence, "status": result.status}
    words |= limits.columns(result.limits)
    return words | numbers | ({"verdict": result.verdict.value} if result.verdict else {})


def sure(rows: Sequence[Agreement]) -> str:
    """How many comparisons agree, laws hold and printed numbers are as computed, and the worst comparison."""
    groups = {"laws_si": "laws hold", "printed": "kinds of printed numbers are as computed"}
    counts = []
    for quantity, words in {"": "comparisons of two solvers agree", **groups}.items():
        group = [row for row in rows if row.quantity == quantity or (not quantity and row.quantity not in groups)]
        counts.append(f"{sum(row.verdict is Verdict.AGREE for row in group)} of {len(group)} {words}")
    wrong = [f"{row.law or row.quantity} ({row.where})" for row in rows if row.verdict is not Verdict.AGREE]
    return "; ".join(counts) + (f"; not so: {', '.join(wrong[:4])}" if wrong else "")


def _many(command: str, points: Sequence[Point], out: Path | None, solve: Callable[[Line], Answers]) -> list[Row]:
    def row(point: Point) -> tuple[Row, Any]:
        try:
            result = solve(point.scene)
        except (store.Refused, SceneError) as error:
            return {"status": "incomplete", "why": str(error)}, None
        profile = envelope(result.rest)
        entry = _entry(result, **{d["quantity"]: d["value"] for d in result.design})
        return entry, store.plain([profile["x"].tolist(), profile["y_lowest"].tolist()])

    return table.grid(command, f"grid-rest-{command}", points[0].scene, points, out, row, columns)
