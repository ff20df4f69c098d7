"""A line in motion by elements and by sines: do they agree?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cablefem import catenary_line
from cablefem.scene.line import Line
from validation.commands.run.motion import ELEMENTS, SINES, Answers, Runs, answer, answer_of, at_rest_points
from validation.core import motion_laws, store
from validation.core.agreement import Agreement, Verdict, overall
from validation.core.ladder import Ladder
from validation.core.motion_rows import Comparison, Moved, Scales, Tolerance, law_row, tension_of
from validation.page.options import Point, tol_faults

TOL = 1e-3
SECOND = SINES.name  # solver that a planted fault is for
LOOSER = 10.0  # forces over the path
FINEST = 16  # times the coarsest resolution and steps together, before a comparison stays too coarse


def scales_of(line: Line, moved: Moved) -> Scales:
    """Largest deflection of a car, largest tension at the start, and weights."""
    empty = line.empty(catenary_line.solve)
    heat = 1.0 + line.cable.warmer
    away = [car.point - at_rest_points(empty, car.s / heat) for car in moved.motion.cars]
    path = max((float(np.hypot(*w.T).max()) for w in away), default=1.0)
    tension = max(float(tension_of(contact)[0]) for contact in moved.motion.contacts)
    weights = {car.name: car.mass * line.gravity for car in line.car}
    return Scales(path, tension, weights)


def judged(line: Line, a: Ladder, b: Ladder, asked: Tolerance) -> list[Agreement]:
    """All rows of two ladders of runs: comparisons, and laws of both from the TOML."""
    finest: Any = a.finest
    comparison = Comparison(a, b, scales_of(line, finest), asked)
    return [*comparison.rows(), *laws(line.to_toml(), (a, b), comparison.end)]


def laws(toml: str, ladders: Sequence[Ladder], end: float) -> Iterator[Agreement]:
    finest: Any = ladders[0].finest
    turns = any(car.turning is not None for car in finest.motion.cars)
    known = motion_laws.LAWS | (motion_laws.OF_BODIES if turns else {})
    for ladder in ladders:
        for name, law in known.items():

            def defect(moved: Any, every: int = 1, law: Any = law) -> Any:
                return law(toml, moved.motion, end, every)

            finest = ladder.finest
            yield law_row(ladder, "laws_si", name, defect, end, finest.method)


def checked(
    line: Line, tol: float = TOL, tol_tension: float | None = None, second: Line | None = None
) -> Answers:  # fmt: skip
    """Run both methods on a line in motion and compare them; refine until they agree or the budget is spent.

    Where they disagree, one refinement is a second look.

    tol : of the path, over its largest deflection;  tol_tension : of forces, default 10 tol.
    second : a line for the sines alone.
    """
    asked = Tolerance(tol, LOOSER * tol if tol_tension is None else tol_tension)
    first = Runs(ELEMENTS, line)
    both = first, Runs(SINES, second or line, first)
    space = 2
    time = 2
    before = None
    while True:
        a, b = (runs.ladder(space, time) for runs in both)
        rows = judged(line, a, b, asked)
        verdict = overall(rows)
        again = verdict is before is Verdict.DISAGREE
        if verdict is Verdict.AGREE or again or space * time >= FINEST:
            return answer_of(line, a, b, rows)
        before = verdict
        coarse = [row for row in rows if row.verdict is not Verdict.AGREE and row.parts]
        # bars of both solvers over half of what is asked, in space and in time
        excess = np.array([2.0 * np.sum(row.parts, axis=0) / (row.required or 1.0) for row in coarse] or [(0.0, 1.0)])
        in_space, in_time = (excess.max(axis=0) >= min(1.0, excess.max())).tolist()
        space *= 2 if in_space else 1
        time *= 2 if in_time or not in_space else 1


def check(
    points: Sequence[Point], tol: float, tol_tension: float | None, out: Path | None, second: Line | None,
    require: bool = False,
) -> int:  # fmt: skip
    """Check a line in motion or a grid of them; 1 unless they agree, 2 where a run broke."""
    if faults := [*tol_faults(tol), *tol_faults(tol_tension, "--tol-tension", 1e-6, 1.0)]:
        raise store.Refused(faults)
    if second is not None and any(_names(second) != _names(point.scene) for point in points):
        raise store.Refused("--second: must be a line in motion with the same contacts and cars")
    solve = partial(checked, tol=tol, tol_tension=tol_tension, second=second)
    return answer("check", points, out, solve, require)


def _names(line: Line) -> list[Any]:
    return [line.moves, *(x.name for x in line.contact), *(x.name for x in line.car)]
