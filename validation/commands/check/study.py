"""The main job: two solvers that share no formula run the same scene, and their answers are held against each other."""

from __future__ import annotations

import importlib
import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from cablefem.response import Flag, Response, write_json
from cablefem.scene import Scene
from validation.core import foreign, measures
from validation.core.agreement import (
    DEFAULT_TOL,
    UNBOUNDED,
    Agreement,
    Verdict,
    agree,
    doubts,
    overall,
    settled,
    wanting,
    wide,
    with_bars,
)
from validation.core.design import design, numbers
from validation.core.estimate import SHORT, Estimated, past_slack
from validation.core.foreign import WITH_TOL, ForeignPath
from validation.core.methods import Method, find
from validation.core.resolution import again, resolved, work
from validation.core.running import run
from validation.core.sidebyside import Progress, side_by_side
from validation.core.store import Refused

SOLVERS = ("following-p2", "fourier-kink")
# How many times the cost of a run rows that are too coarse ask for, and the tolerance, divided by it in every round, to
# which they may.  Most want bars 1.1 to 2.5 times less, most of them of steps: with 80 sines on a stiff cable twice the
# steps left 0.056 H of tension at the mass of 0.105 H, and took a fifth of what an aim of half for the path had taken.
FINER, FINER_FROM = 2.0, 5e-4
Finer = tuple[float, float]  # so many times the resolution and the steps
ENOUGH: Finer = (1.0, 1.0)
# Parts of the tolerance: dense bases cost more than elements do, and grow faster.  With half of it they took a third
# more on `level`; with 0.7 the default would leave elements to Radau's steps, which tell less of tension.
ELEMENTS, OTHERS = 1.0, 2.0
# Times the resolution and the steps of both, to see whether a disagreement stays: a ladder leaves coarse what the path
# does not mind.
CONFIRMS = 1.5
SECOND_LOOK: list[Finer | None] = [(CONFIRMS, CONFIRMS)] * 2
# Of `work` for each solver, half a minute to a minute, and in proportion more below a third of the default tolerance.
# With a third of it five of ten random scenes remained too coarse.
BUDGET = 1.2e6
LADDER = 2.0  # times the work of the run that is returned, at least, is that of all before it


@dataclass(frozen=True, slots=True)
class Check:
    """Two estimated runs of one scene and the verdict on them."""

    scene: Scene
    a: Estimated
    b: Estimated
    tol: float
    window: tuple[float, float]
    rows: list[Agreement]
    grip: Response | None = None  # of a hauled car: what a car that grips the cable would have said
    entry: dict[str, float] | None = None  # what a smooth entry would change, where that was asked for

    @property
    def verdict(self) -> Verdict:
        return overall(self.rows)

    @property
    def design(self) -> list[dict[str, Any]]:
        """The design numbers, each by the solver that knows it better; its bar is no less than the gap to the other."""
        other = {row["quantity"]: row for row in self.b.run.design}
        pairs = [(row, other.get(row["quantity"], row)) for row in self.a.run.design]
        return [min(pair, key=lambda row: math.inf if row["bar"] is None else row["bar"]) for pair in pairs]

    @property
    def doubts(self) -> list[tuple[str, Flag]]:
        """Methods and flags that say that a bar may be too small."""
        return doubts(self.a, self.b)

    def agreement(self) -> dict[str, Any]:
        """Return the content of agreement.json."""
        return {
            "scene": self.scene.name, "verdict": self.verdict.value, "range": list(self.window), "tol": self.tol,
            "methods": [self.a.run.method, self.b.run.method], "rows": [row.row() for row in self.rows],
            "design": self.design, "events": self.a.run.events, **({"entry": self.entry} if self.entry else {}),
            "doubts": [{"method": name, "kind": flag.kind, "words": str(flag)} for name, flag in self.doubts],
        }  # fmt: skip

    def write(self, out: Path) -> None:
        """Write scene.toml, one folder per method (with its companions) and agreement.json."""
        for e in (self.a, self.b):
            e.run.write_tables(out / e.run.method)
        self.store(out)

    def store(self, out: Path) -> None:
        """Write the same but the tables of both runs."""
        out.mkdir(parents=True, exist_ok=True)
        (out / "scene.toml").write_text(self.scene.to_toml(), encoding="utf-8")
        for e in (self.a, self.b):
            folder = out / e.run.method
            e.run.store(folder)
            write_json(folder / "estimate.json", {"basis": e.basis, "weights": list(e.weights)})
            if e.extrapolated:
                e.response.write(folder / "extrapolated")
            for name, companion in (("half-resolution", e.in_space), ("half-steps", e.in_time)):
                companion.store(folder / name)
        if self.grip is not None:
            self.grip.store(out / "grip")
        write_json(out / "agreement.json", self.agreement())


@dataclass(frozen=True, slots=True)
class _Round:
    """Two runs, each as fine as was asked of it, and the rows that judge them."""

    methods: list[Method]
    aims: list[float]
    runs: tuple[Estimated, Estimated]
    rows: list[Agreement]
    before: _Round | None
    asked: list[Finer | None]  # how both came to be: so many times finer than before, or by their ladders

    @property
    def confirms(self) -> bool:
        """Whether it is the second look at a disagreement, by runs finer in space and time."""
        return self.asked == SECOND_LOOK

    @property
    def unbounded(self) -> bool:
        return any(flag.kind in UNBOUNDED for e in self.runs for flag in e.run.flags)

    @property
    def apart(self) -> bool:
        return overall(self.rows) is Verdict.DISAGREE

    @property
    def doubted(self) -> bool:
        far = overall(settled(self.rows, None)) is Verdict.DISAGREE if self.unbounded else self.apart
        return far and not self.confirms

    @property
    def settled(self) -> list[Agreement]:
        # of a gap that stays although nothing confirms it, something may be as coarse as it was
        tol = 0.0 if self.unbounded else sum(self.aims)
        rows = self.rows if self.confirms and not self.unbounded else settled(self.rows, None, tol=tol)
        # and one that refinement takes away is the answers' own
        ratio = CONFIRMS if self.confirms else 2.0
        return rows if self.before is None else settled(rows, self.before.rows, ratio, tol)

    def ahead(self, budget: float) -> list[Finer | None] | None:
        """Return how many times finer both are to be next, None where that would tell no more, or cost too much.

        A disagreement is looked at once more with both finer in space and time, whatever is asked of the path, and not
        within three times bars that are said to be no bound; rows that are too coarse refine whose bars make them so,
        and of it what leaves more of tension, space or steps.  Whose ladder is to go on for the path is None.
        """
        names, aims, rows = [m.name for m in self.methods], self.aims, self.settled
        errors = [math.inf if e.run.path_error is None else e.run.path_error for e in self.runs]
        met = all(row.verdict is Verdict.AGREE for row in rows if row.quantity in ("path_max", "path_rms"))
        missed = [error > aim and not met for error, aim in zip(errors, aims, strict=True)]
        if any(x and how is None for x, how in zip(missed, self.asked, strict=True)) or math.inf in errors:
            return None  # no ladder went further
        # a companion that breaks or falls slack early cuts the range, and what is compared there says little
        short = [any(flag.kind == "short bar" for flag in e.run.flags) for e in self.runs]
        coarse = overall(rows) is Verdict.TOO_COARSE or any(short)
        if not (self.doubted or coarse) or (self.unbounded and self.apart and not self.doubted):
            return None
        if not self.doubted and sum(aims) / FINER**self.depth < 0.99 * FINER_FROM:
            return None
        asked: list[Finer | None]
        if self.doubted:
            asked = SECOND_LOOK
        elif any(missed):
            asked = [None if x else ENOUGH for x in missed]
        else:
            which = short if any(short) else [name in wanting(rows, names) for name in names]
            far = max((row.allowed / (row.bound.tol or math.inf) for row in wide(rows)), default=0.0) > FINER
            pairs = zip(self.methods, self.runs, which, strict=True)
            asked = [_coarse(m, e, far) if x else ENOUGH for m, e, x in pairs]
        known = zip(asked, self.methods, self.runs, strict=True)
        return asked if all(_cost(*x) <= budget for x in known if x[0] != ENOUGH) else None

    @property
    def depth(self) -> int:
        """How many rounds went before."""
        return 0 if self.before is None else 1 + self.before.depth


def _coarse(method: Method, e: Estimated, far: bool) -> Finer:
    """Return how to refine a run: the companion that cuts its range tells, or what takes more of tension's error.

    Either costs FINER times as much; an error of order 3/2 then falls by so much, but not past all the method has.

    far : one of both would not do.
    """
    space, count = method.resolution, method.value(e.run.settings)
    finer = FINER ** (1.0 / space.growth)
    end = measures.window_of(e.run)[1] - SHORT
    which = [measures.window_of(e.run, c)[1] < end for c in (e.in_space, e.in_time)]
    if not any(which):
        parts = e.run.error_parts or {"tension_space": 0.0, "tension_time": 0.0}
        gains = parts["tension_space"] * (1.0 - finer**-1.5), parts["tension_time"] * (1.0 - FINER**-1.5)
        which = [far or gains[0] > gains[1], far or gains[0] <= gains[1]]
    if which[0] and space.nearest(count, finer) > space.most:
        which = [False, True]
    return finer if which[0] else 1.0, FINER if which[1] else 1.0


def _cost(finer: Finer | None, method: Method, e: Estimated) -> float:
    """Return about how much `work` so much finer runs are; of a ladder, one stride's."""
    space, time = finer or (1.0, FINER)
    count, of = method.value(e.run.settings), method.resolution
    return LADDER * time * of.cost(count, space) / of.cost(count) * work(method, e.run)


def check(
    scene: Scene | str | Path, *, tol: float = DEFAULT_TOL, tol_tension: float | None = None,
    methods: tuple[str | Method, str | Method] = SOLVERS, deep: bool = False, progress: Progress | None = None,
    made: Callable[..., None] | None = None, until: float | None = None,
) -> Check:  # fmt: skip
    """Run two methods on a scene, each as fine as its own error bar needs to meet `tol`, and compare them.

    tol : asked of the error of the mass path, relative to the largest deflection; in [1e-6, 0.2].
    tol_tension : asked of the tension, relative to H; default ten times `tol`.  Where the path's bar is met but
        tension, fields or laws are too coarse to tell, the solver whose bars make them so, or cover less than the
        range, is refined further; where the solvers disagree, both are.
    deep : hold what both share against third parties, too.
    progress : called with the method's name, the fraction done and what was reached.
    made : called with both runs before they are judged, again where that makes them finer.
    until : how far in s_o/l both runs go, and once their cable is slack no further; by default to the end.
    """
    if not (math.isfinite(tol) and 1e-6 <= tol <= 0.2):
        raise ValueError(f"tol must lie in [1e-6, 0.2], got {tol!r}")
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    found = [find(m) if isinstance(m, str) else m for m in methods]
    grip: list[Callable[[Progress], Any]] = [partial(_gripped, scene, found[0])] if scene.drive.mode == "haul" else []
    gripped: list[Response] = []
    budget = BUDGET * max(1.0, DEFAULT_TOL / 3.0 / tol)
    # the sum of both bars is held against tol
    shares = [ELEMENTS if m.wing == "elements" else OTHERS for m in found]
    aims = [tol * share / sum(shares) for share in shares]
    judged: _Round | None = None
    asked: list[Finer | None] | None = [None, None]
    while asked is not None:
        known = (None, None) if judged is None else judged.runs
        jobs: list[Callable[[Progress], Any]] = [
            partial(_resolved, scene, m, aim, budget, until, e, finer)
            for m, aim, e, finer in zip(found, aims, known, asked, strict=True)
        ]
        first, second, *once = side_by_side([*jobs, *grip], progress, _load)
        gripped, grip = gripped or once, []
        if made is not None:
            made(first.run, second.run)
        runs: tuple[Estimated, Estimated] = first, second
        judged = _Round(found, aims, runs, agree(scene, *runs, tol=tol, tol_tension=tol_tension), judged, asked)
        asked = judged.ahead(budget)
    assert judged is not None
    runs, rows = judged.runs, judged.settled
    try:
        window = measures.window_of(*runs[0].runs, *runs[1].runs)
    except measures.NotComparable:
        window = (measures.WINDOW[0], measures.WINDOW[0])
    a, b = (_told(scene, e, twin) for e, twin in (runs, runs[::-1]))
    smooth = None
    if deep or overall(rows) is Verdict.TOO_COARSE:
        from validation.commands.check import deep as third

        rows += third.deep(scene, runs[0], rows) if deep else []
        smooth = third.entry(scene, runs[0].in_time)  # of which half the steps tell enough
    return Check(scene, a, b, tol, window, rows, gripped[0] if gripped else None, smooth)


def _load() -> None:
    """Load what judging and drawing need: that takes as long as they do, and a core is idle while one solver runs."""
    for name in ("core.laws", "core.trust", "commands.check.page"):
        importlib.import_module(f"validation.{name}")


def _told(scene: Scene, e: Estimated, twin: Estimated) -> Estimated:
    """Return the run with its design numbers and events, and their bars."""
    rows = [number.row() for number in numbers(e, twin)]
    return replace(e, run=replace(e.run, design=rows, events=with_bars(scene, e)))


def _gripped(scene: Scene, method: Method, progress: Progress) -> Response:
    """Return the answer for a car that grips the cable, by the defaults of the method: for the eye."""
    data = tomllib.loads(scene.to_toml())
    del data["drive"]
    response = run(Scene(**{"name": scene.name, **data}), method, progress=partial(progress, "gripped"))
    return replace(response, method="gripped car", design=design(response))


def _resolved(
    scene: Scene, method: Method, tol: float, budget: float, until: float | None, before: Estimated | None,
    finer: Finer | None, progress: Progress,
) -> Estimated:  # fmt: skip
    if before is not None and finer == ENOUGH:
        return before
    told = partial(progress, method.name)
    told(0.0)
    ends: dict[str, Any] = {} if until is None else {"until": until}
    past = 0.0 if ends else math.inf
    if before is not None and finer is not None:
        e = again(scene, method, before, *finer, past=past, progress=told, **ends)
    else:
        e = resolved(scene, method, tol, budget=budget, past=past, before=before, progress=told, **ends)
    return e if e is before or ends else past_slack(scene, method, e)


def joined(check: Check, path: ForeignPath | Response, with_tol: float = WITH_TOL) -> Check:
    """Return the check with the rows of a third party, held against whichever of our solvers has the smaller bar."""
    best = min((check.a, check.b), key=lambda e: math.inf if e.run.path_error is None else e.run.path_error)
    return replace(check, rows=[*check.rows, *foreign.rows(path, best, check.window, with_tol)])


def check_solver(
    scene: Scene | str | Path, solver: Callable[[Scene], Any], *, name: str | None = None, tol: float = DEFAULT_TOL,
    with_tol: float = WITH_TOL, ours: Check | None = None,
    progress: Progress | None = None,
) -> Check:  # fmt: skip
    """Run a user's own solver on a scene and hold it against both of ours; its rows come last in the verdict.

    solver : scene -> (s_o, v) or (s_o, v, u) in [m], v down, along the scene's travel; of a free ride (t, x, y) in [s]
        and [m], from the left support, y down; or a Response.
    tol, progress : of our own solvers, as in `check`.
    with_tol : allowed to the solver beside our error bar, relative to the largest deflection.
    ours : a check of this scene that was made before.

    Raises Refused if what it returns is no path on that scene.
    """
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    name = name or str(getattr(solver, "__name__", type(solver).__name__))
    answer = solver(scene)
    if not isinstance(answer, Response):
        free = scene.drive.mode == "free"
        columns, counts = (("t", "x", "y"), (3,)) if free else (("s_o", "v", "u"), (2, 3))
        if not (isinstance(answer, tuple | list) and len(answer) in counts):
            wanted = "(t, x, y)" if free else "(s_o, v) or (s_o, v, u)"
            got = type(answer).__name__ + (f" of {len(answer)}" if isinstance(answer, tuple | list) else "")
            raise Refused(f"{name}: must return {wanted}, or a Response; got {got}")
        answer = ForeignPath.of(scene, **dict(zip(columns, answer, strict=False)), name=name)
    ours = ours or check(scene, tol=tol, progress=progress)
    foreign.refuse_misnamed(answer, ours.a.run)
    return joined(ours, answer, with_tol)
