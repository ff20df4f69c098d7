"""Numbers of a line at rest at each position of its cars, their extremes, and the envelope.

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

from cablefem import catenary_line
from cablefem.response import Array, write_csv, write_json, write_text
from cablefem.scene import SceneError
from cablefem.scene.line import Car, Line, LineRest, LineState, NoLine
from validation.core import store
from validation.core.agreement import Verdict
from validation.core.answers import PLACES
from validation.page import report, terminal
from validation.page.answer import many as table
from validation.page.line import WORDS, columns, kind_of, tell
from validation.page.options import Point

Row = dict[str, Any]


def row(line: Line, i: int, state: LineState, empty: LineState) -> Row:
    """Numbers of position i; None for what a car on a shoe has not."""
    names = [p.name for p in state.case.stations]
    found: Row = {}
    for car in line.car:
        found |= _at_car(line, car, line.place(car, i), state)
    held = [names.index(contact.name) for contact in line.contact]
    for j, k in enumerate(held):
        found |= _at_contact(line, j, k, state, empty)
    for (a, b), (m, n) in zip(itertools.pairwise(line.contact), itertools.pairwise(held), strict=True):
        found[f"sag:{a.name} to {b.name}"] = catenary_line.deepest(state, m, n)
    found["tension_max"] = float(np.nanmax(state.tensions))
    found["tension_min"] = catenary_line.least_tension(state)
    if line.cable.breaking_load is not None:
        found["safety_factor"] = line.cable.breaking_load / found["tension_max"]
    return found | _room(line, i, state)


def _at_car(line: Line, car: Car, x: float, state: LineState) -> Row:
    shoe = line.shoe(x)
    k = [p.name for p in state.case.stations].index(car.name) if shoe is None else None
    forces = {"tension_behind": state.tensions[:, 0], "tension_ahead": state.tensions[:, 1]}
    forces |= {"haul": state.haul} if car.hauled else {}
    found: Row = {f"x:{car.name}": x, f"depth:{car.name}": _depth(state, x), f"on:{car.name}": shoe}
    return found | {f"{name}:{car.name}": None if k is None else float(N[k]) for name, N in forces.items()}


def _depth(state: LineState, x: float) -> float:
    return float(catenary_line.at(state, np.array([x]))[0][0])


def _at_contact(line: Line, j: int, k: int, state: LineState, empty: LineState) -> Row:
    """Numbers of contact j, which is station k."""
    contact, case = line.contact[j], state.case
    found = {f"tension:{contact.name}": float(np.nanmax(state.tensions[k]))}
    if contact.kind == "saddle":
        across, down = (float(x) for x in state.pressure[k])
        found[f"pressure:{contact.name}"] = math.hypot(across, down)
        found[f"pressure_down:{contact.name}"] = down
        found[f"direction:{contact.name}"] = math.degrees(math.atan2(across, down))
        found[f"rope_over:{contact.name}"] = float(empty.s[j] - state.s[k])
    elif contact.kind == "counterweight":
        taken = float(np.ptp(state.s) - np.ptp(empty.s))
        found[f"rise:{contact.name}"] = case.heat * (1.0 + case.stations[k].force / case.EA) * taken
    elif contact.kind == "spring":
        found[f"shift:{contact.name}"] = math.dist(state.place[k], contact.at)
    return found


def _room(line: Line, i: int, state: LineState) -> Row:
    """Free heights over obstacles and ground at position i; negative: something hits."""
    found = {f"clearance_rope:{o.name}": o.top - _depth(state, o.at) for o in line.obstacle}
    if not line.ground:
        return found
    x, depth = np.array(line.ground).T
    low, high = max(x[0], 0.0), min(x[-1], line.contact[-1].at[0])
    here = np.union1d(x[(x >= low) & (x <= high)], np.linspace(low, high, PLACES))
    found["clearance_rope:ground"] = float(np.min(np.interp(here, x, depth) - catenary_line.at(state, here)[0]))
    for car in line.car:
        if x[0] <= (at := line.place(car, i)) <= x[-1]:
            found[f"clearance_car:{car.name} over the ground"] = (
                float(np.interp(at, x, depth)) - _depth(state, at) - car.below
            )
    return found


def _passing(line: Line, rows: list[Row | None]) -> list[tuple[str, int, float]]:
    """Free heights of cars over obstacles that they pass, linear between two positions."""
    found = []
    for car, o in itertools.product(line.car, line.obstacle):
        told = [(i, r[f"x:{car.name}"], r[f"depth:{car.name}"]) for i, r in enumerate(rows) if r]
        for (i, a, y), (_, b, z) in zip(told, told[1:] or told, strict=False):
            if min(a, b) <= o.at <= max(a, b):
                w = (o.at - a) / (b - a) if b != a else 0.0
                found.append((f"clearance_car:{car.name} over {o.name}", i, o.top - y - w * (z - y) - car.below))
    return found


def _series(line: Line, rows: list[Row | None]) -> dict[str, list[tuple[float, int]]]:
    """Values of each quantity, with their positions."""
    told = [(name, i, value) for i, each in enumerate(rows) for name, value in (each or {}).items()]
    series: dict[str, list[tuple[float, int]]] = {}
    for name, i, value in (*told, *_passing(line, rows)):
        if isinstance(value, float) and kind_of(name) != "x":
            series.setdefault(name, []).append((value, i))
    return series


def extremes(line: Line, rows: list[Row | None]) -> list[Row]:
    """Largest and least value of each quantity, and where it occurs."""
    out = []
    for name, values in _series(line, rows).items():
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


def envelope(line: Line, rest: LineRest) -> dict[str, Array]:
    """Columns of profile.csv: the empty rope, and the extremes of depth and tension over all positions."""
    x = np.linspace(0.0, line.contact[-1].at[0], PLACES)
    found = [catenary_line.at(state, x) for state in rest.positions if isinstance(state, LineState)]
    y, T = (np.array([part[i] for part in found]) for i in (0, 1))
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
    rows: list[Row] = field(default_factory=list)

    def __repr__(self) -> str:
        found = self.verdict.value if self.verdict else self.status
        return f"Answers({self.line.name}: {found}, {self.line.count} positions at rest)"

    @property
    def verdict(self) -> Verdict | None:
        """Of all rows; None if nothing was compared."""
        return next((v for v in Verdict if any(row["verdict"] == v.value for row in self.rows)), None)

    @property
    def refused(self) -> list[Row]:
        told = enumerate(self.rest.positions)
        return [{"position": i + 1, "reason": str(x)} for i, x in told if isinstance(x, NoLine)]

    @property
    def status(self) -> str:
        return "incomplete" if self.refused else "complete"


def answers(line: Line, rest: LineRest | None = None) -> Answers:
    """Solve a line by catenaries; an error where the empty line or every position has no rest.

    rest : its solution, if there is one.
    """
    rest = rest or line.rest(catenary_line.solve)
    numbers = numbers_of(line, rest)
    if not any(numbers):
        raise store.Refused(f"{line.name}: no position has a rest; at the first {rest.positions[0]}")
    return Answers(line, rest, numbers, extremes(line, numbers))


def numbers_of(line: Line, rest: LineRest) -> list[Row | None]:
    """Numbers of all positions."""
    told = enumerate(rest.positions)
    return [row(line, i, x, rest.empty) if isinstance(x, LineState) else None for i, x in told]


def write(folder: Path, found: Answers, seconds: float) -> None:
    """Write positions.csv, profile.csv, summary.json, scene.toml, and the ropes that the page draws."""
    line, told = found.line, envelope(found.line, found.rest)
    table.write_rows(folder / "positions.csv", [{"position": i + 1} | (x or {}) for i, x in enumerate(found.numbers)])
    write_csv(folder / "profile.csv", ",".join(told), np.stack(list(told.values()), axis=1))
    write_text(folder / "scene.toml", line.to_toml())
    write_json(folder / "summary.json", {
        "scene": line.name, "title": line.title, "method": "catenaries", "status": found.status,
        "refused": found.refused, "positions": line.count, "empty_length": float(np.ptp(found.rest.empty.s)),
        "design": found.design, "seconds": seconds,
    })  # fmt: skip
    standing = [i for i, x in enumerate(found.rest.positions) if isinstance(x, LineState)]
    # the ropes of some positions are drawn
    drawn = [standing[k] for k in np.unique(np.linspace(0, len(standing) - 1, 7).round().astype(int))]
    depths = {str(i + 1): catenary_line.at(found.rest.positions[i], told["x"])[0].tolist() for i in drawn}
    write_json(folder / "ropes.json", {"profile": {k: v.tolist() for k, v in told.items()}, "depths": depths})


def course(command: str, points: Sequence[Point], out: Path | None, answered: Callable[[Line], Answers]) -> int:
    """Answer a line or a grid, store, draw and print; 1 where solvers do not agree, 2 where a position has no rest."""
    line: Line = points[0].scene
    if len(points) > 1:
        rows = _many(command, points, out, answered)
    else:
        home = "rest-check" if command == "check" else "rest"
        folder = store.claim(out, command, line, [home, "agreement.json"] if command == "check" else [home])
        with terminal.progress() as progress:
            progress(line.name, 0.0)
            begun = perf_counter()
            found = answered(line)
            seconds = perf_counter() - begun
        write(folder / home, found, seconds)
        rows = [_outcome(found)]
        if found.verdict:
            agreement = {"verdict": found.verdict.value, "methods": ["catenaries", "elements"], "rows": found.rows}
            write_json(folder / "agreement.json", agreement)
            terminal.say(found.verdict.value, style=terminal.STYLES[found.verdict.value])
        report.write(folder, command)
        tell(line, found.design, found.refused)
        terminal.say(f"  {line.count} positions in {seconds:.2g} s")
        if found.verdict:
            terminal.say(f"  {worst(found.rows)}")
        terminal.say(f"  written to {folder}: report.html, {home}/")
    if any(x.get("verdict", "agree") != "agree" for x in rows):
        return 1
    return 2 if any(x["status"] != "complete" for x in rows) else 0


def _outcome(found: Answers, **numbers: Any) -> Row:
    verdict = {"verdict": found.verdict.value} if found.verdict else {}
    return {"status": found.status, **numbers, **verdict}


def worst(rows: Sequence[Row]) -> str:
    """How many comparisons agree, and the worst of them."""
    x = max(rows, key=lambda row: row["gap"] / row["allowed"] if row["allowed"] else math.inf)
    return (
        f"{sum(row['verdict'] == 'agree' for row in rows)} of {len(rows)} comparisons agree; the worst: "
        f"{x['quantity']} at {x['where']}, gap {x['gap']:.1e} {x['unit']}, bars {x['allowed']:.1e}"
    )


def _many(command: str, points: Sequence[Point], out: Path | None, answered: Callable[[Line], Answers]) -> list[Row]:
    def row(point: Point) -> tuple[Row, Any]:
        try:
            found = answered(point.scene)
        except (store.Refused, SceneError) as error:
            return {"status": "incomplete", "why": str(error)}, None
        told = envelope(point.scene, found.rest)
        entry = _outcome(found, **{d["quantity"]: d["value"] for d in found.design})
        return entry, [told["x"].tolist(), told["y_lowest"].tolist()]

    return table.grid(command, f"grid-rest-{command}", points[0].scene, points, out, row, columns)
