"""A line at rest by exact catenaries and by elements: do they agree?

Bars: change in one more Newton step (catenaries), three times the change on halving (elements); at least rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from cablefem import catenary_line
from cablefem.elements import line as elements
from cablefem.response import Array, write_json
from cablefem.scene import SceneError
from cablefem.scene.line import Line, LineRest, LineState, NoLine, NotFound
from validation.commands.run.line import Answers, Row, extremes, many, of, rows_of, write
from validation.core import store
from validation.core.agreement import APART, Verdict, three_lines
from validation.page import report, terminal
from validation.page.line import tell
from validation.page.options import Point

FINEST = 32  # elements on each piece, at most
BY_ELEMENTS = 0.5  # their largest bar over the tolerance
HALVED = 3.0  # bar over the change on halving the elements
ROUNDING = 256 * np.finfo(float).eps  # of the reach for lengths, of EA for forces
TOL = 1e-6  # [m], and of the largest tension
TOL_RANGE = (1e-9, 1e-2)
NAMES = ("catenaries", "elements")


METRES = ("place", "rope_place", "s", "rope_length")  # quantities in metres; the others are forces


def numbers(state: LineState) -> dict[str, Array]:
    """Compared quantities of a state, (n, 1) or (n, 2) over stations; nan where there is none."""
    case = state.case
    saddle = np.array([p.kind == "saddle" for p in case.stations])[:, None]
    nowhere = np.full((1, 2), np.nan)
    length = np.full((len(state.s), 1), np.nan)
    length[-1] = np.ptp(state.s)
    return {
        "place": np.where(np.isnan(case.fixed_places), state.place, np.nan),
        "rope_place": np.concatenate([state.middle, nowhere]),
        "s": np.where(np.isnan(case.fixed_s), state.s, np.nan)[:, None], "rope_length": length,
        "tension_behind": state.tensions[:, :1], "tension_ahead": state.tensions[:, 1:], "haul": state.haul[:, None],
        "pressure": np.where(saddle, state.pressure, np.nan),
    }  # fmt: skip


def compared(
    a: LineRest, less_a: LineRest, b: LineRest, less_b: LineRest, tol: float, tol_tension: float
) -> list[Row]:  # fmt: skip
    """One judged row a quantity, of the worst station and position. `less`: coarser answers.

    Row `rest` is for positions with one solution: a disagreement, unless the other search did not end.
    """
    positions = list(zip(a.positions, less_a.positions, b.positions, less_b.positions, strict=True))
    both: dict[int, Any] = {
        i: states for i, states in enumerate(positions) if all(isinstance(x, LineState) for x in states)
    }
    if not both:
        return _alone(positions)[:1]
    at = [f"{p.name}, position {i + 1}" for i, states in both.items() for p in states[0].case.stations]
    values = [_joined(states) for states in zip(*both.values(), strict=True)]
    tension = float(np.nanmax([values[0]["tension_behind"], values[0]["tension_ahead"]]))
    asked = {"m": tol, "N": tol_tension * tension}
    rounding = {"m": ROUNDING * float(np.ptp(a.empty.place[:, 0])), "N": ROUNDING * a.empty.case.EA}
    units = {quantity: "m" if quantity in METRES else "N" for quantity in values[0]}
    worst = {quantity: _worst(rounding[unit], *(x[quantity] for x in values)) for quantity, unit in units.items()}
    rows = [_row(quantity, *x[:3], asked[units[quantity]], at[x[3]]) for quantity, x in worst.items() if x]
    return rows + _alone(positions)[:1]


def _joined(states: Sequence[LineState]) -> dict[str, Array]:
    """The numbers of several states, one after another."""
    told = [numbers(state) for state in states]
    return {quantity: np.concatenate([x[quantity] for x in told]) for quantity in told[0]}


def _worst(
    rounding: float, x: Array, less_x: Array, y: Array, less_y: Array
) -> tuple[float, float, float, int] | None:  # fmt: skip
    """Gap, both bars and station of the worst number; None without any."""
    gap, bar_a = np.abs(x - y), np.fmax(np.abs(x - less_x), rounding)
    bar_b = np.fmax(HALVED * np.abs(y - less_y), rounding)
    worst = np.where(gap > APART * (bar_a + bar_b), gap / ROUNDING, np.maximum(gap, bar_a + bar_b))
    if not np.isfinite(worst).any():
        return None
    k = np.unravel_index(np.nanargmax(worst), worst.shape)
    return float(gap[k]), float(bar_a[k]), float(bar_b[k]), int(k[0])


def _alone(positions: Sequence[tuple[LineState | NoLine, ...]]) -> list[Row]:
    """A row for each position with only one solution."""
    out = []
    for i, (x, _, y, _) in enumerate(positions):
        if isinstance(x, LineState) != isinstance(y, LineState):
            unknown = isinstance(x, NotFound) or isinstance(y, NotFound)
            out.append(_row("rest", 1.0, 1.0 if unknown else 0.0, 0.0, 0.0, f"position {i + 1}"))
    return out


def _row(quantity: str, gap: float, bar_a: float, bar_b: float, asked_for: float, where: str) -> Row:
    return {
        "quantity": quantity, "gap": gap, "bar_a": bar_a, "bar_b": bar_b, "allowed": bar_a + bar_b,
        "asked_for": asked_for, "asked": True, "where": where, "unit": "m" if quantity in METRES else "N",
        "verdict": three_lines(gap, bar_a + bar_b, asked_for).value,
    }  # fmt: skip


def _parts(line: Line) -> list[tuple[str, ...]]:
    cars = [(car.name, *(str(line.shoe(line.place(car, i))) for i in range(line.count))) for car in line.car]
    return [tuple(f"{c.name} {c.kind}" for c in line.contact), *cars]


def _refined(line: Line, second: Line, tol: float, tol_tension: float) -> tuple[LineRest, LineRest, list[Row]]:
    """Both answers and their rows; elements are doubled until gap and bars are small enough, up to FINEST."""
    n = 4
    a, less_a = line.rest(partial(catenary_line.solve, more=1)), line.rest(catenary_line.solve)
    less_b = second.rest(partial(elements.solve, elements=n // 2))
    while True:
        b = second.rest(partial(elements.solve, elements=n))
        rows = compared(a, less_a, b, less_b, tol, tol_tension)
        coarse = any(row["bar_b"] > BY_ELEMENTS * row["asked_for"] for row in rows if row["quantity"] != "rest")
        if not coarse or n >= FINEST:
            return a, b, rows
        less_b, n = b, 2 * n


@dataclass(frozen=True, slots=True)
class Checked:
    """A line at rest by both solvers: the catenaries' answers, judged rows, and the verdict of all."""

    answers: Answers
    rows: list[Row]
    verdict: Verdict

    @property
    def design(self) -> list[Row]:
        return self.answers.design

    def __repr__(self) -> str:
        return f"Checked({self.answers.line.name}: {self.verdict.value}, {self.answers.line.count} positions at rest)"


def checked(
    line: Line, tol: float = TOL, tol_tension: float | None = None, second: Line | None = None
) -> Checked:  # fmt: skip
    """Compute a line at rest by exact catenaries and by elements, and compare them.

    tol : [m];  tol_tension : of the largest tension, default `tol`;  second : a line for the elements alone.
    """
    begun = perf_counter()
    try:
        a, b, rows = _refined(line, second or line, tol, tol if tol_tension is None else tol_tension)
    except SceneError as error:
        raise store.Refused([f"{line.name}: {fault}" for fault in error.faults]) from None
    found = of(line, a, begun)
    other = {d["quantity"]: d["value"] for d in extremes(line, rows_of(line, b))}
    for d in found.design:
        d["bar"] = abs(d["value"] - other.get(d["quantity"], d["value"]))
    words = {row["verdict"] for row in rows}
    return Checked(found, rows, next(v for v in Verdict if v.value in words))


def check(
    points: Sequence[Point], tol: float | None, tol_tension: float | None, out: Path | None, second: Line | None
) -> int:  # fmt: skip
    """Check a line or a grid of lines; 1 unless they agree, 2 for a position without rest."""
    tol = TOL if tol is None else tol
    low, high = TOL_RANGE
    if not low <= tol <= high:
        raise store.Refused(f"--tol must lie in [{low:g}, {high:g}] m for a line at rest, got {tol:g}")
    for point in points:
        if second is not None and _parts(second) != _parts(point.scene):
            raise store.Refused("--second: must be a line with the same contacts, cars and positions")
    asked = tol, tol_tension
    line: Line = points[0].scene
    if len(points) > 1:

        def answered(point: Point) -> tuple[Answers, Row]:
            each = checked(point.scene, *asked, second)
            return each.answers, {"verdict": each.verdict.value}

        return many("check", points, out, answered)
    folder = store.claim(out, "check", line, ["agreement.json", "rest-check"])
    with terminal.progress() as progress:
        progress("both", 0.0)
        begun = perf_counter()
        judged = checked(line, *asked, second)
        found, rows, verdict = judged.answers, judged.rows, judged.verdict.value
        seconds = perf_counter() - begun
        progress("both", 1.0)
    write(folder / "rest-check", found)
    write_json(folder / "agreement.json", {"verdict": verdict, "methods": NAMES, "rows": rows})
    report.write(folder, "check")
    terminal.say(
        f"{verdict}: exact catenaries and elements, {line.count} positions, {seconds:.1f} s",
        style=terminal.STYLES[verdict],
    )
    tell(line, found.design, found.refused)
    worst = max(rows, key=lambda row: row["gap"] / row["allowed"] if row["allowed"] else np.inf)
    terminal.say(
        f"  {sum(row['verdict'] == 'agree' for row in rows)} of {len(rows)} comparisons agree; the worst: "
        f"{worst['quantity']} at {worst['where']}, gap {worst['gap']:.1e} {worst['unit']}, bars {worst['allowed']:.1e}"
    )
    terminal.say(f"  written to {folder}: report.html, agreement.json, rest-check/")
    return 1 if verdict != "agree" else 2 if found.refused else 0
