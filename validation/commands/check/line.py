"""A line at rest by exact catenaries and by elements: do they agree?

Bars: change in one more Newton step (catenaries), three times the change on halving (elements); at least rounding.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from cablefem import catenary_line
from cablefem.elements import line as elements
from cablefem.response import Array
from cablefem.scene.line import Line, LineRest, LineState, NoLine, NotFound
from validation.commands.run.line import Answers, Row, answers, course, extremes, numbers_of
from validation.core import store
from validation.core.agreement import APART, three_lines
from validation.page.options import Point

FINEST = 32  # elements on each piece, at most
BY_ELEMENTS = 0.5  # their largest bar over the tolerance
HALVED = 3.0  # bar over the change on halving the elements
ROUNDING = 256 * np.finfo(float).eps  # of the reach for lengths, of EA for forces
TOL = 1e-6  # [m], and of the largest tension
TOL_RANGE = (1e-9, 1e-2)
METRES = ("place", "rope_place", "s", "rope_length")  # quantities in metres; the others are forces

Four = tuple[LineState | NoLine, ...]  # a position by catenaries and by elements, each followed by a coarser answer


def numbers(state: LineState) -> dict[str, Array]:
    """The compared quantities of a state, (n, 1) or (n, 2) over stations; nan where there is none."""
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


def compared(four: Sequence[LineRest], tol: float, tol_tension: float) -> list[Row]:
    """One judged row a quantity, of the worst station and position; four : both answers, each before a coarser one."""
    positions = list(zip(*(x.positions for x in four), strict=True))
    both = [i for i, told in enumerate(positions) if all(isinstance(x, LineState) for x in told)]
    return (_judged(four, both, tol, tol_tension) if both else []) + _alone(positions)


def _judged(four: Sequence[LineRest], both: list[int], tol: float, tol_tension: float) -> list[Row]:
    """The row of each quantity, of its worst number; both : positions with all four answers."""
    a = four[0]
    at = [f"{p.name}, position {i + 1}" for i in both for p in a.positions[i].case.stations]  # type: ignore[union-attr]
    values = [_joined([x.positions[i] for i in both]) for x in four]
    tension = float(np.nanmax([values[0]["tension_behind"], values[0]["tension_ahead"]]))
    units = {"m": (float(np.ptp(a.empty.place[:, 0])), tol), "N": (a.empty.case.EA, tol_tension * tension)}
    rows = []
    for quantity in values[0]:
        reach, asked_for = units["m" if quantity in METRES else "N"]
        x, less_x, y, less_y = (each[quantity] for each in values)
        rounding = float(ROUNDING * reach)
        gap, bar_a = np.abs(x - y), np.fmax(np.abs(x - less_x), rounding)
        bar_b = np.fmax(HALVED * np.abs(y - less_y), rounding)
        worst = np.where(gap > APART * (bar_a + bar_b), gap / ROUNDING, np.maximum(gap, bar_a + bar_b))
        if np.isfinite(worst).any():
            k = np.unravel_index(np.nanargmax(worst), worst.shape)
            rows.append(_row(quantity, float(gap[k]), float(bar_a[k]), float(bar_b[k]), asked_for, at[int(k[0])]))
    return rows


def _joined(states: Sequence[LineState | NoLine]) -> dict[str, Array]:
    told = [numbers(state) for state in states if isinstance(state, LineState)]
    return {quantity: np.concatenate([x[quantity] for x in told]) for quantity in told[0]}


def _alone(positions: Sequence[Four]) -> list[Row]:
    """A row `rest` for the first position that only one solver solves: a disagreement, unless a search did not end."""
    for i, (x, _, y, _) in enumerate(positions):
        if isinstance(x, LineState) != isinstance(y, LineState):
            unknown = isinstance(x, NotFound) or isinstance(y, NotFound)
            return [_row("rest", 1.0, 1.0 if unknown else 0.0, 0.0, 0.0, f"position {i + 1}")]
    return []


def _row(quantity: str, gap: float, bar_a: float, bar_b: float, asked_for: float, where: str) -> Row:
    return {
        "quantity": quantity, "gap": gap, "bar_a": bar_a, "bar_b": bar_b, "allowed": bar_a + bar_b,
        "asked_for": asked_for, "asked": True, "where": where, "unit": "m" if quantity in METRES else "N",
        "verdict": three_lines(gap, bar_a + bar_b, asked_for).value,
    }  # fmt: skip


def _refined(line: Line, second: Line, tol: float, tol_tension: float) -> tuple[LineRest, LineRest, list[Row]]:
    """Both answers and their rows; elements are doubled until bars are small enough, up to FINEST."""
    n = 4
    a, less_a = line.rest(partial(catenary_line.solve, more=1)), line.rest(catenary_line.solve)
    less_b = second.rest(partial(elements.solve, elements=n // 2))
    while True:
        b = second.rest(partial(elements.solve, elements=n))
        rows = compared((a, less_a, b, less_b), tol, tol_tension)
        coarse = any(row["bar_b"] > BY_ELEMENTS * row["asked_for"] for row in rows if row["quantity"] != "rest")
        if not coarse or n >= FINEST:
            return a, b, rows
        less_b, n = b, 2 * n


def checked(line: Line, tol: float = TOL, tol_tension: float | None = None, second: Line | None = None) -> Answers:
    """Compare both solvers on a line at rest.

    tol : [m];  tol_tension : of the largest tension, default `tol`;  second : a line for the elements alone.
    """
    a, b, rows = _refined(line, second or line, tol, tol if tol_tension is None else tol_tension)
    found = replace(answers(line, a), rows=rows)
    other = {d["quantity"]: d["value"] for d in extremes(line, numbers_of(line, b))}
    for d in found.design:
        d["bar"] = abs(d["value"] - other.get(d["quantity"], d["value"]))
    return found


def check(
    points: Sequence[Point], tol: float | None, tol_tension: float | None, out: Path | None, second: Line | None
) -> int:
    """Check a line or a grid of lines; 1 unless they agree, 2 for a position without rest."""
    tol = TOL if tol is None else tol
    low, high = TOL_RANGE
    if not low <= tol <= high:
        raise store.Refused(f"--tol must lie in [{low:g}, {high:g}] m for a line at rest, got {tol:g}")
    if second is not None and any(_parts(second) != _parts(point.scene) for point in points):
        raise store.Refused("--second: must be a line with the same contacts, cars and positions")
    return course("check", points, out, lambda line: checked(line, tol, tol_tension, second))


def _parts(line: Line) -> list[tuple[str, ...]]:
    cars = [(car.name, *(str(line.shoe(line.place(car, i))) for i in range(line.count))) for car in line.car]
    return [tuple(f"{c.name} {c.kind}" for c in line.contact), *cars]
