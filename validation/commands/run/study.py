"""One answer: the run that was asked for, its design numbers and events, and bars from coarser runs."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from cablefem.response import LazyValue, Response
from cablefem.scene import Scene
from validation.commands.run import QUASI_STATIC, option_faults, setting_faults
from validation.core import laws, limits, recomputed
from validation.core.agreement import Verdict
from validation.core.answers import outcome_of_run
from validation.core.design import design_numbers
from validation.core.flags import with_flag
from validation.core.methods import Method, find_method
from validation.core.quasi_static import quasi_static, with_inertia_error_bars
from validation.core.refine import TooCoarse, refine_to_tolerance, refine_until_goal_met, run_with_error_bars
from validation.core.rows import events_with_error_bars, worst_force_goal
from validation.core.running import run
from validation.core.sampling import FRAMES
from validation.core.sidebyside import no_progress
from validation.page.answer import many as table
from validation.page.options import GridPoint

Fields = dict[str, Any]  # values of a response, by name
_ERRORS = ("path_error", "tension_error", "error_parts", "error_window")


class AnsweredRun(NamedTuple):
    """A run with its design numbers, and why the tolerance is out of reach, else ""."""

    response: Response
    missed_tolerance: str = ""


def run_with_design_numbers(
    scene: Scene,
    method: Method | None,
    *,
    tol: float | None,
    bars: bool,
    progress: Callable[..., None],
    **options: Any,
) -> AnsweredRun:
    """Run a method with the settings in `options`, or with those that its bar needs to meet `tol`.

    Without a method: by the quasi-static model.
    """
    if method is None:
        return AnsweredRun(rechecked_quasi_static_run(scene, quasi_static(scene)))
    if tol is None:
        r = run(scene, method, **options, progress=progress)
        return AnsweredRun(_with_lazy_design_numbers(scene, r, method, bars, options))
    missed = ""
    try:
        ladder = refine_to_tolerance(scene, method, tol, **options, progress=progress)
        # mean forces, as in `check`
        ladder = refine_until_goal_met(scene, ladder, lambda x: worst_force_goal(scene, x, tol), **options)
    except TooCoarse as error:
        ladder = error.ladder
        missed = str(error)
    return AnsweredRun(
        replace(ladder.finest, design=design_numbers(ladder), events=events_with_error_bars(ladder)), missed
    )


def _with_lazy_design_numbers(
    scene: Scene, r: Response, method: Method, bars: bool, options: dict[str, Any]
) -> Response:
    """The response with its design numbers; with bars, coarser runs are made when one is looked at."""
    if not bars:
        return r.with_lazy_fields(design=design_numbers)

    def numbers_by_coarser_runs() -> Fields:
        ladder = run_with_error_bars(scene, method, earlier_runs=[r], **options)
        numbers = {name: getattr(ladder.finest, name) for name in ("flags", *_ERRORS)}
        return numbers | {"design": design_numbers(ladder), "events": events_with_error_bars(ladder)}

    return _with_fields_computed_together(r, ("flags", *_ERRORS, "design", "events"), numbers_by_coarser_runs)


def _with_fields_computed_together(r: Response, names: Sequence[str], compute: Callable[[], Fields]) -> Response:
    """The response with these fields from one computation, made when one is looked at; only they are kept of it."""
    values = LazyValue(compute)
    return r.with_lazy_fields(**{name: lambda _, name=name: values()[name] for name in names})


def quasi_static_with_bars(scene: Scene) -> Response:
    """The quasi-static ride; SceneError if its cable at rest is not found, ValueError without a car.

    Path and events are there at once; design numbers, with bars, are computed when they are looked at.
    A line in motion gives states of rest along its timetables.
    quasi_static("zipline").events
    """

    r = quasi_static(scene)

    def checked_numbers() -> Fields:
        checked = rechecked_quasi_static_run(scene, r)
        return {"design": checked.design, "flags": checked.flags}

    return _with_fields_computed_together(r, ("design", "flags"), checked_numbers)


def rechecked_quasi_static_run(scene: Scene, r: Response) -> Response:
    """The quasi-static ride r with design numbers and bars, and a flag for each that its second computation denies."""
    r = with_inertia_error_bars(scene, replace(r, design=design_numbers(r)))
    rows = [*recomputed.recomputed_rows(r, None, outcome_of_run(scene, r)), *laws.quasi_static_law_rows(r)]
    if r.drive != "grip":
        rows.append(recomputed.quasi_static_energy_row(r))
    for row in rows:
        if row.verdict is not Verdict.AGREE:
            what = f"{row.quantity} {row.law}".strip()
            r = with_flag(r, "recomputed", what=what, gap=row.gap, allowed=row.allowed)
    return r


def run_with_bars(
    scene: Scene, method: str | Method = "following-p2", *, tol: float | None = None, bars: bool = True,
    model: str = "full", load: str = "mass", law: str = "auto", frames: int = FRAMES, until: float | None = None,
    **settings: Any,
) -> Response:  # fmt: skip
    """Run one method as `cablefem run` does: with design numbers, events and their bars.

    method : see `cablefem methods`, or one of your own; settings : of the method, as elements=20, steps=800.
    tol : of the path, relative to its largest deflection, in [1e-6, 0.2]; resolution and steps are then chosen.
    frames : least number of instants at which the fields are kept, for `Response.at`.
    until : s_o/l at which the run may end; default: the end of the travel.
    The run is made at once. Fields, forces, design numbers and bars are computed when they are looked at.
    Raises ValueError for a tolerance out of range or beside a resolution, and for settings that no such method has.
    A line takes no method and no settings: its answers have `design` and `outcome`, in motion `cars` and `contacts`.
    run("zipline", tol=1e-3).design
    """
    options = {"model": model, "load": load, "law": law}
    solver = find_method(method)
    faults = option_faults(options, tol, solver)
    if model == QUASI_STATIC:
        faults.append(f"model = {QUASI_STATIC!r}: no method has it; cf.quasi_static computes it")
    if faults := faults or setting_faults(scene, solver, options, settings, tol):
        raise ValueError("\n".join(faults))
    how = {"frames": frames, "until": until, **options, **settings}
    return run_with_design_numbers(scene, solver, tol=tol, bars=bars, progress=no_progress, **how).response


def answer_and_store_run_grid(
    scene: Scene,
    points: Sequence[GridPoint],
    answer_at: Callable[..., AnsweredRun],
    out: Path | None,
    require_limits: bool,
) -> int:
    """Answer every point of a grid and store its table; return the exit code.

    2 where a run broke, 1 where limits are required and one fails.
    """

    def row_and_path(point: GridPoint) -> tuple[table.Row, Any]:
        r = answer_at(point, no_progress).response
        return table.answer_table_row(point.scene, r), table.sparse_path_columns(r)

    rows = table.answer_and_store_grid("run", "grid", scene, points, out, row_and_path, table.run_table_columns)
    if any(x["outcome_kind"] == "incomplete" for x in rows):
        return 2
    return int(require_limits and limits.any_scene_may_break_limits(rows))
