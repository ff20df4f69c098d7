"""A line in motion by elements and by sines: do they agree?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from cablefem import catenary_line
from cablefem.response import Array
from cablefem.scene.line import Line
from validation.commands.check import sensitivity as sensitivities
from validation.commands.run.motion import (
    ELEMENTS,
    SINES,
    LineRuns,
    MotionAnswers,
    largest_car_deflection,
    motion_answers,
    run_ladders,
)
from validation.core import motion_laws, refine, store
from validation.core.agreement import DEFAULT_TOL, FORCES, Agreement, Verdict, worst_deciding_verdict
from validation.core.ladder import Ladder
from validation.core.motion_rows import (
    LineComparison,
    LineRun,
    LineTolerance,
    Scales,
    largest_tension_at_start,
    law_row,
)
from validation.core.sidebyside import Progress, no_progress
from validation.page.options import tolerance_faults

TOL = DEFAULT_TOL


def deflection_tension_and_weight_scales(line: Line, run: LineRun) -> Scales:
    """Largest deflection of a car in the run, largest tension at its start, and weights of the cars."""
    path = largest_car_deflection(line, line.solve_empty_line(catenary_line.solve), run.motion)
    tension = largest_tension_at_start(run.motion)
    weights = {car.name: car.mass * line.gravity for car in line.car}
    return Scales(path, tension, weights)


def compare_and_check_laws(
    line: Line, a: Ladder[LineRun], b: Ladder[LineRun], tolerance: LineTolerance
) -> list[Agreement]:
    """All rows of two ladders of runs: comparisons, and laws of both from the TOML."""
    comparison = LineComparison(a, b, deflection_tension_and_weight_scales(line, a.finest), tolerance)
    return [*comparison.rows(), *law_rows(line.to_toml(), (a, b), comparison.compared_until)]


def law_rows(toml: str, ladders: Sequence[Ladder[LineRun]], end_time: float) -> Iterator[Agreement]:
    """A row for each law that applies to the line in the TOML and each ladder, up to the time `end_time`."""
    line = motion_laws.LineTables(toml)
    laws = motion_laws.laws_that_apply(line, [ladder.finest.motion for ladder in ladders])
    samples: dict[tuple[int, int], tuple[LineRun, motion_laws.SampledMotion]] = {}  # by run and step, for all laws

    def defects(law: motion_laws.Law, moved: LineRun, every: int = 1) -> Array:
        key = id(moved), every
        if key not in samples:
            samples[key] = moved, motion_laws.SampledMotion(line, moved, every)  # an id lives with its run
        return law(samples[key][1], end_time)

    for ladder in ladders:
        for name, law in laws.items():
            yield law_row(ladder, "laws_si", name, partial(defects, law), end_time)


def check_line(
    line: Line, tol: float = TOL, tol_tension: float | None = None, second: Line | None = None, *,
    report: Progress = no_progress,
) -> MotionAnswers:  # fmt: skip
    """Run both methods on a line in motion and compare them; refine until they agree or the budget is spent.

    Where they disagree, one refinement is a second look.

    tol : of the path, over its largest deflection;  tol_tension : of forces, default 10 tol.
    second : a line for the sines alone;  report : is called with the part of the runs that is done.
    """
    if faults := [*tolerance_faults(tol), *tolerance_faults(tol_tension, "--tol-tension", 1e-6, 1.0)]:
        raise store.Refused(faults)
    asked = LineTolerance(tol, FORCES * tol if tol_tension is None else tol_tension)
    first = LineRuns(ELEMENTS, line)
    both = first, LineRuns(SINES, second or line, first)
    space = 2
    time = 2
    before = None
    while True:
        run_ladders(both, space, time, report)
        a, b = (runs.ladder(space, time) for runs in both)
        rows = compare_and_check_laws(line, a, b, asked)
        verdict = worst_deciding_verdict(rows)
        again = verdict is before is Verdict.DISAGREE
        if verdict is Verdict.AGREE or again or not _may_be_refined(space * time, (a.finest, b.finest)):
            return motion_answers(line, a, b, rows)
        before = verdict
        space, time = _doubled_where_coarse(space, time, rows)


def _may_be_refined(refinement: int, finest: Sequence[LineRun]) -> bool:
    """Whether twice as fine runs may follow, or a comparison stays too coarse.

    refinement : times the coarsest resolution and steps together.
    """
    enough = 64
    cheap = 4.0 * refine.BUDGET  # unknowns times Newton iterations: some seconds
    return refinement < enough or all(run.n_dof * run.work.newton_iterations <= cheap for run in finest)


def _doubled_where_coarse(space: int, time: int, rows: Sequence[Agreement]) -> tuple[int, int]:
    """Double space, time or both: where bars of both solvers are over half of what is asked, or the larger one."""
    excess = []  # of bars over half of what is asked, in space and in time
    for row in rows:
        if row.verdict is not Verdict.AGREE and row.parts:
            excess.append(2.0 * np.sum(row.parts, axis=0) / (row.required or 1.0))
    largest = np.array(excess or [(0.0, 1.0)]).max(axis=0)
    in_space, in_time = (largest >= min(1.0, largest.max())).tolist()
    if in_space:
        space *= 2
    if in_time or not in_space:
        time *= 2
    return space, time


def detectable_relative_changes(result: MotionAnswers) -> dict[str, float]:
    """Smallest relative change of each input key that this check would detect, by one of the coarsest runs a key."""
    line = result.line
    first = LineRuns(ELEMENTS, line)
    base = Ladder.of_one_run(first.run(1, 1))
    asked = LineTolerance(TOL, FORCES * TOL)  # decides no gap

    def gaps_to(changed_line: Line) -> sensitivities.Gaps:
        changed = Ladder.of_one_run(LineRuns(ELEMENTS, changed_line, first).run(1, 1))
        comparison = LineComparison(base, changed, deflection_tension_and_weight_scales(line, result.moved), asked)
        return {(row.quantity, row.law): row.gap for row in comparison.rows() if row.bound.kind == "error bars"}

    return sensitivities.detectable_relative_changes_by_gaps(line, result.rows, gaps_to)
