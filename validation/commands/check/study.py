"""Run one scene on two solvers that share no formula, and compare their answers."""

import html
import importlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.response import Flag, Response, write_json, write_text
from cablefem.scene import Scene
from cablefem.scene.errors import did_you_mean, short_text
from validation.core import foreign, limits, measures, verification
from validation.core.agreement import (
    DEFAULT_TOL,
    TOL_HIGH,
    TOL_LOW,
    Agreement,
    Verdict,
    refuse_out_of_range,
    worst_deciding_verdict,
)
from validation.core.answers import Outcome, outcome_of_run
from validation.core.design import design_gap_rows, design_numbers, widen_error_bars_to_gaps
from validation.core.foreign import WITH_TOL, ForeignPath
from validation.core.ladder import Goal, Ladder
from validation.core.methods import CHECKED, Method, find_method, scaled_settings
from validation.core.quantities import design_row_texts, key_numbers
from validation.core.quasi_static import quasi_static_events_with_error_bars
from validation.core.refine import (
    BUDGET,
    TooCoarse,
    exceeds_work_budget,
    next_settings,
    path_error_bar_from_coarser_runs,
    refine_to_tolerance,
    run_with_error_bars,
)
from validation.core.remedy import Remedies, with_remedy_note
from validation.core.rows import (
    compare_answers,
    events_with_error_bars,
    events_with_widened_error_bars,
    quasi_static_event_rows,
    tolerance_of_quantity_kind,
    worse_law_rows,
    worse_recomputed_rows,
)
from validation.core.running import Run
from validation.core.sidebyside import Progress, no_progress, run_in_parallel
from validation.core.store import Refused
from validation.core.view import View

SHARES = {"elements": 1.0, "galerkin": 5.0}  # of the tolerance: dense bases cost about as much more
DECIDING_QUANTITIES = {"all": (), "path": ("path_max", "path_rms", "place", "speed")}  # rows that decide; (): all
DOUBTS = ("fast", "slow waves", "energy", "hidden slack", "no bar")  # flags of bars that may be too small

Settings = dict[str, Any]
Row = dict[str, Any]  # of a JSON file


@dataclass(frozen=True, slots=True)
class Check:
    """Two answers to one scene, coarser runs for their bars, and the verdict."""

    scene: Scene
    a: Ladder
    b: Ladder
    tol: float
    window: tuple[float, float]
    rows: list[Agreement]
    quasi_static: list[Row] = field(default_factory=list)  # events of the quasi-static ride
    verification: list[Row] = field(default_factory=list)  # of design numbers, see `verification`

    @property
    def methods(self) -> list[str]:
        """Names of both solvers."""
        return [self.a.finest.method, self.b.finest.method]

    @property
    def verdict(self) -> Verdict:
        return worst_deciding_verdict(self.rows)

    @property
    def own_verdict(self) -> Verdict:
        """Of both solvers alone, without a third party."""
        return worst_deciding_verdict([row for row in self.rows if not row.third_party])

    @property
    def design(self) -> list[Row]:
        """Design numbers, each by the better solver; the bar is at least the gap."""
        other = {row["quantity"]: row for row in self.b.finest.design}
        pairs = [(row, other.get(row["quantity"], row)) for row in self.a.finest.design]
        return [min(pair, key=lambda row: math.inf if row["bar"] is None else row["bar"]) for pair in pairs]

    @property
    def doubts(self) -> list[tuple[str, Flag]]:
        """Flags of bars that may be too small, each with the method of its run."""
        runs = self.a.finest, self.b.finest
        return [(r.method, flag) for r in runs for flag in r.flags if flag.kind in DOUBTS]

    @property
    def outcome(self) -> Outcome:
        """What becomes of the ride: its kind, and a sentence."""
        return outcome_of_run(self.scene, self.a.finest)

    def __repr__(self) -> str:
        rows = f"{len(self.rows)} rows, tol = {self.tol:g}"
        return f"Check({self.scene.name}: {self.verdict.value}, {rows}; {self.outcome.sentence})"

    def _repr_html_(self) -> str:
        from validation.page.page import html_table_by_heading  # for notebooks alone

        columns = {"quantity": "what", "value": "value", "when": "t", "where": "at"}
        rows = html_table_by_heading(map(design_row_texts, key_numbers(self.design)), columns)
        return f"<div><p>{html.escape(repr(self))}</p>{rows}{self.a.finest._repr_html_()}</div>"

    @property
    def limits(self) -> list[Row]:
        """Verdicts on the limits of the scene."""
        return limits.limit_rows(self.scene, self.design, self.a.finest.events)

    def agreement(self) -> Row:
        """Content of agreement.json."""
        content: Row = {"limits": self.limits} if self.scene.limits else {}
        content |= {"scene": self.scene.name, "verdict": self.verdict.value, "range": list(self.window)}
        content |= {"axis": View.of_scene(self.scene).axis, "tol": self.tol, "methods": self.methods}
        content["rows"] = [row.to_json() for row in self.rows]
        content |= {"design": self.design, "verification": self.verification}
        content |= {"events": self.a.finest.events, "quasi_static": self.quasi_static}
        content["doubts"] = [{"method": name, "kind": flag.kind, "words": str(flag)} for name, flag in self.doubts]
        return content

    def write(self, out: Path | str) -> None:
        """Write scene.toml, one folder per method and agreement.json."""
        out = Path(out)
        write_text(out / "scene.toml", self.scene.to_toml())
        for ladder in (self.a, self.b):
            ladder.finest.write(out / ladder.finest.method)
        write_json(out / "agreement.json", self.agreement())


def check(
    scene: Scene | str | Path, *, tol: float = DEFAULT_TOL, tol_tension: float | None = None,
    methods: tuple[str | Method, str | Method] = CHECKED, second: Scene | None = None, deep: bool = False,
    progress: Progress = no_progress, until: float | None = None, ask: str = "all",
) -> Check:  # fmt: skip
    """Run two methods on a scene, each as fine as its own error bars need, and compare them.

    tol : error of the mass path, relative to the largest deflection; in [1e-6, 0.2].
    methods : one of each wing.
    tol_tension : error of the tension, relative to H; default ten times `tol`.
    second : another scene for the second method, which plants a fault; the judge knows `scene` alone.
    deep : compare what both share with third parties, too.
    progress : called with a label and the fraction done.
    until : s_o/l at which both runs may end, once slack; not before the end of what is compared; default: the end.
    ask : "path": path, position and speed of the car decide, all else is shown; "all".
    A line takes tol, tol_tension and second alone, at rest tol in m; its answers have `verdict`, `rows` and `design`.
    check("zipline", tol=5e-3).verdict
    """
    refuse_out_of_range("tol", tol, TOL_LOW, TOL_HIGH)
    if tol_tension is not None:
        refuse_out_of_range("tol_tension", tol_tension, 1e-6, 1.0)
    if ask not in DECIDING_QUANTITIES:
        raise ValueError(f"ask = {short_text(ask)}: unknown.{did_you_mean(str(ask), DECIDING_QUANTITIES)}")
    if not isinstance(methods, tuple | list) or len(methods) != 2:
        raise ValueError(f"methods = {short_text(methods)}: must be two, one of each wing")
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    if scene.mass is None:
        raise ValueError(f"scene {scene.name!r} has no car: there is nothing to compare")
    if until is not None:
        refuse_out_of_range("until", until, View.of_scene(scene).last_needed_relative_position or 1.0, 1.0)
    tolerance = partial(tolerance_of_quantity_kind, tol=tol, tol_tension=tol_tension)
    sides = _methods_with_tolerance_shares((scene, second or scene), methods, tol, until)
    (first, other), rows = _refine_and_compare(scene, sides, tolerance, ask, progress)
    own_a = _with_design_and_events(first, other)
    own_b = _with_design_and_events(other, first)
    rows += design_gap_rows(own_a, own_b, tolerance("rest"))
    a = _with_widened_error_bars(own_a, own_b, rows)
    b = _with_widened_error_bars(own_b, own_a, rows)
    static = quasi_static_events_with_error_bars(scene, a.finest.max_deflection)
    rows += quasi_static_event_rows(a, static, tolerance("rest"))
    rows += mark_deciding_rows(worse_recomputed_rows(scene, a.finest, b.finest), ask)
    if deep:
        from validation.commands.check import deep as third

        rows += third.shared_part_check_rows(scene, a)
    verified = verification.verification_rows(own_a, own_b)
    return Check(scene, a, b, tol, _common_valid_position_range(scene, a, b), rows, static, verified)


def mark_deciding_rows(rows: Iterable[Agreement], ask: str) -> list[Agreement]:
    """The rows, of which those that `ask` does not name are shown only."""
    names = DECIDING_QUANTITIES[ask]
    return [replace(row, decides=row.decides and (not names or row.quantity in names)) for row in rows]


@dataclass(frozen=True, slots=True)
class _MethodOnScene:
    """A method with its scene, tolerance and budget, and the last s_o/l of its runs; None: the end."""

    scene: Scene
    method: Method
    tol: float
    budget: float
    until: float | None

    def refine_within_budget(self, progress: Progress) -> Ladder:
        """Run as fine as the tolerance needs, or as the budget allows."""
        report = partial(progress, self.method.name)
        try:
            return refine_to_tolerance(
                self.scene, self.method, self.tol, budget=self.budget, progress=report, until=self.until
            )
        except TooCoarse as error:
            return error.ladder

    def finer_settings(self, ladder: Ladder, rows: list[Agreement], for_larger_bar: bool) -> Settings | None:
        """Finer settings after a disagreement, or if bars are too large; None: there are none within the budget.

        for_larger_bar : of a row, else for the smaller one.
        """
        if worst_deciding_verdict(rows) is Verdict.DISAGREE:
            finer_by = 1.5  # factor on resolution and steps of both before they count as different
            finer = scaled_settings(self.method, ladder.finest.settings, space=finer_by, time=finer_by)
            return None if exceeds_work_budget(self.method, ladder, finer, self.budget) else finer
        coarse = [row for row in rows if row.decides and row.verdict is Verdict.TOO_COARSE and row.required]
        goals = [goal for row in coarse for goal in _goals_for_row(row, self.method.name, for_larger_bar)]
        if not goals:
            return None
        worst = max(goals, key=lambda goal: goal.bar_over_target)
        return next_settings(self.method, ladder, worst, self.budget)

    def rerun_unless_none(self, settings: Settings | None, before: Ladder, progress: Progress) -> Ladder:
        """The runs with finer settings; those before where there are none."""
        if settings is None:
            return before
        report = partial(progress, self.method.name)
        return run_with_error_bars(
            self.scene, self.method, earlier_runs=before.runs, progress=report, until=self.until, **settings
        )


def _methods_with_tolerance_shares(
    scenes: tuple[Scene, Scene], methods: Sequence[str | Method], tol: float, until: float | None
) -> list[_MethodOnScene]:
    """Each method with its scene, its share of the tolerance, and the budget."""
    loaded = [find_method(m) for m in methods]
    shares = [SHARES.get(m.wing, 1.0) for m in loaded]
    budget = BUDGET * max(1.0, DEFAULT_TOL / 3.0 / tol)
    sides = []
    for scene, m, share in zip(scenes, loaded, shares, strict=True):
        sides.append(_MethodOnScene(scene, m, tol * share / sum(shares), budget, until))
    return sides


def _refine_and_compare(
    scene: Scene, sides: list[_MethodOnScene], tolerance: Callable[[str], float], ask: str, progress: Progress
) -> tuple[list[Ladder], list[Agreement]]:  # fmt: skip
    """Refine both ladders until they agree or cannot get closer; return them and the rows."""
    jobs: list[Callable[[Progress], Any]] = [side.refine_within_budget for side in sides]
    confirmed = False
    toml = scene.to_toml()
    for side in sides:
        Run(side.scene, side.method)  # what that imports forked processes need not import each
    while True:
        first, other = run_in_parallel(jobs, progress, _import_judging_modules)
        second = other.map(lambda r: replace(r, scene_toml=toml))  # the judge knows one scene alone
        ladders = [first, second]
        rows = mark_deciding_rows(compare_answers(scene, first, second, tolerance), ask)
        finer = _finer_settings_of_sides(sides, ladders, rows, confirmed)
        if not any(finer):  # laws need not be checked on runs that are refined anyway
            rows += mark_deciding_rows(worse_law_rows(scene, first, second, tolerance), ask)
            finer = _finer_settings_of_sides(sides, ladders, rows, confirmed)
        if not any(finer):
            return ladders, rows
        confirmed = worst_deciding_verdict(rows) is Verdict.DISAGREE
        each = zip(sides, finer, ladders, strict=True)
        jobs = [partial(side.rerun_unless_none, settings, ladder) for side, settings, ladder in each]


def _finer_settings_of_sides(
    sides: list[_MethodOnScene], ladders: list[Ladder], rows: list[Agreement], confirmed: bool
) -> list[Settings | None]:
    """Finer settings of each side: for the larger bar of a row, or for the smaller one if that costs too much.

    confirmed : these runs are finer after a disagreement already, so that another one counts.
    """
    if confirmed and worst_deciding_verdict(rows) is Verdict.DISAGREE:
        return [None for _ in sides]
    finer: list[Settings | None] = []
    pairs = list(zip(sides, ladders, strict=True))
    for for_larger_bar in (True, False):
        finer = [side.finer_settings(ladder, rows, for_larger_bar) for side, ladder in pairs]
        if any(finer):
            break
    return finer


def _common_valid_position_range(scene: Scene, a: Ladder, b: Ladder) -> measures.Window:
    """The range of s_o/l over which both runs are valid; empty where there is none."""
    try:
        return View.of_scene(scene).cut_to_valid_range(a.finest, b.finest).window
    except measures.NotComparable:
        return measures.WINDOW[0], measures.WINDOW[0]


def _goals_for_row(row: Agreement, method: str, for_larger_bar: bool) -> Iterator[Goal]:
    """What the bar of a method in a row should be.

    for_larger_bar : only where it is the row's larger one, else only where the other one is and leaves room.
    """
    assert row.required is not None
    largest = max(sum(parts) for parts in row.parts)
    for parts, of in zip(row.parts, row.bound.parts, strict=False):
        bar = sum(parts)
        if of.name != method or (bar == largest) is not for_larger_bar:
            continue
        room = _room_for_error_bar(row, bar)
        if for_larger_bar:
            room = max(room, row.required / 2.0)
        if room <= 0.0:
            continue
        falls = min(1.0, row.allowed / row.gap) if row.gap else 1.0  # a gap beyond the bars falls as they do
        yield Goal(parts, room * falls, math.inf if "path" in row.quantity else 1.0)


def _room_for_error_bar(row: Agreement, bar: float) -> float:
    """What the other bars of a row leave of its tolerance."""
    assert row.required is not None
    others = row.allowed - bar if math.isfinite(row.allowed) else 0.0
    return row.required - others


def _import_judging_modules() -> None:
    """Import judging and drawing while a solver runs."""
    for name in ("core.laws", "core.readback", "core.recomputed", "core.trust", "commands.check.page"):
        importlib.import_module(f"validation.{name}")


def _with_design_and_events(ladder: Ladder, counterpart: Ladder) -> Ladder:
    """The ladder with design numbers and events of its finest run."""
    design = design_numbers(ladder, counterpart)
    finest = replace(ladder.finest, design=design, events=events_with_error_bars(ladder))
    return replace(ladder, finest=finest)


def _with_widened_error_bars(ladder: Ladder, counterpart: Ladder, rows: list[Agreement]) -> Ladder:
    """The ladder with bars of its finest run that are at least the gap to the other solver."""
    gap = {row.quantity: row.gap for row in rows if not row.law and math.isfinite(row.gap)}

    def at_least_gap(error: float | None, quantity: str) -> float | None:
        return None if error is None else max(error, gap.get(quantity, 0.0))

    r = ladder.finest
    other = counterpart.finest
    design = widen_error_bars_to_gaps(r.design, other.design)
    events = events_with_widened_error_bars(r.events, other.events)
    path_error = at_least_gap(r.path_error, "path_max")
    tension_error = at_least_gap(r.tension_error, "tension")
    widened = replace(r, design=design, events=events, path_error=path_error, tension_error=tension_error)
    return replace(ladder, finest=widened)


def with_third_party_rows(check: Check, path: ForeignPath | Response, with_tol: float = WITH_TOL) -> Check:
    """The check with rows of a third party, against our solver with the smaller bar."""
    ladders = check.a, check.b
    best = min(ladders, key=lambda ladder: path_error_bar_from_coarser_runs(ladder.finest))
    rows = list(foreign.third_party_rows(path, best, check.window, with_tol))
    if isinstance(path, ForeignPath):
        remedies = Remedies(path, check.scene, ladders, check.window, with_tol)
        rows = with_remedy_note(rows, remedies)
    return replace(check, rows=[*check.rows, *rows])


def check_solver(
    scene: Scene | str | Path, solver: Callable[[Scene], Any], *, name: str | None = None, tol: float = DEFAULT_TOL,
    with_tol: float = WITH_TOL, ours: Check | None = None, progress: Progress = no_progress,
) -> Check:  # fmt: skip
    """Run a user's own solver on a scene and compare it with both of ours; its rows come last in the verdict.

    solver : scene -> (s_o, v) or (s_o, v, u) in [m], v down, along the scene's travel; of a free ride (t, x, y) in [s]
        and [m], from the left support, y down; or an array whose rows these are; or a Response.
    tol, progress : of our own solvers, as in `check`.
    with_tol : allowed to the solver beside our error bar, relative to the largest deflection.
    ours : an earlier check of this scene.

    Raises Refused if the answer is no path on that scene.
    """
    refuse_out_of_range("with_tol", with_tol, 0.0, 1.0)
    if not callable(solver):
        raise Refused(f"solver = {short_text(solver)}: must be a function of a scene")
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    name = name or str(getattr(solver, "__name__", type(solver).__name__))
    answer = solver(scene)
    if not isinstance(answer, Response):
        answer = _path_of_columns_or_refused(scene, answer, name)
    ours = ours or check(scene, tol=tol, progress=progress)
    foreign.refuse_wrong_unit_or_direction(answer, ours.a.finest)
    return with_third_party_rows(ours, answer, with_tol)


def _path_of_columns_or_refused(scene: Scene, answer: Any, name: str) -> ForeignPath:
    """The path in what a user's solver returned; Refused unless it is the columns of one."""
    free = scene.drive.mode == "free"
    columns = ("t", "x", "y") if free else ("s_o", "v", "u")
    counts = (3,) if free else (2, 3)
    array = isinstance(answer, np.ndarray) and answer.ndim > 0  # its rows are the columns
    several = array or isinstance(answer, tuple | list)
    if not (several and len(answer) in counts):
        wanted = "(t, x, y)" if free else "(s_o, v) or (s_o, v, u)"
        got = type(answer).__name__
        if several:
            got += f" of shape {answer.shape}" if array else f" of {len(answer)}"
        raise Refused(f"{name}: must return {wanted}, or a Response; got {got}")
    return ForeignPath.of(scene, **dict(zip(columns, answer, strict=False)), name=name)
