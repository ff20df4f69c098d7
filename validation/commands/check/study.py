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
    with_bars,
)
from validation.core.design import design, numbers
from validation.core.estimate import Estimated, past_slack
from validation.core.foreign import WITH_TOL, ForeignPath
from validation.core.methods import Method, find
from validation.core.resolution import again, resolved, work
from validation.core.running import run
from validation.core.sidebyside import Progress, side_by_side
from validation.core.store import Refused

SOLVERS = ("following-p2", "fourier-kink")
# What too coarse rows divide the aim by, and the last aim that they may divide.  Most want 1.1 to 2.5 times less: of 74
# random scenes at 1e-2 that want more than one round or 3 s, steps of 3 with shares of 2:3 took a seventh more time; 7
# agreed less, 2 more.
FINER, FINER_FROM = 2.0, 5e-4
# Parts of the tolerance: dense bases cost more than elements do, and grow faster.  With half of it they took a third
# more on `level`; with 0.7 the default would leave elements to Radau's steps, which tell less of tension.
ELEMENTS, OTHERS = 1.0, 2.0
# Times the resolution and the steps of both, to see whether a disagreement stays: a ladder leaves coarse what the path
# does not mind.
CONFIRMS = 1.5
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
    confirms: bool  # a disagreement of the round before, by runs finer in space and time

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
        rows = self.rows if self.confirms and not self.unbounded else settled(self.rows, None)
        # and one that refinement takes away is the answers' own
        return rows if self.before is None else settled(rows, self.before.rows, CONFIRMS if self.confirms else 2.0)

    def ahead(self, budget: float) -> list[float] | None:
        """Return what to ask of both runs next, None where finer ones would tell no more, or cost too much.

        A disagreement is looked at once more with both finer in space and time, whatever is asked of the path, and not
        within three times bars that are said to be no bound; rows that are too coarse refine whose bars make them so.
        Who is finer already than it would be asked to be is refined from where it is, or nobody would be.
        """
        names = [m.name for m in self.methods]
        errors = [math.inf if e.run.path_error is None else e.run.path_error for e in self.runs]
        missed = [error > aim for error, aim in zip(errors, self.aims, strict=True)]
        if any(missed) and not self.confirms:
            return None  # no ladder went further
        rows = self.settled
        verdict = overall(rows)
        # a companion that breaks or falls slack early cuts the range, and what is compared there says little
        short = any(flag.kind in ("short bar", "no bar") for e in self.runs for flag in e.run.flags)
        coarse = (verdict is Verdict.TOO_COARSE or short) and sum(self.aims) > 0.99 * FINER_FROM
        if not (self.doubted or coarse) or (self.unbounded and not self.doubted and self.apart):
            return None
        which = [name in (names if self.doubted or short else wanting(rows, names)) for name in names]
        which = missed if any(missed) else which
        costs = [FINER * LADDER * work(m, e.run) for m, e in zip(self.methods, self.runs, strict=True)]
        if any(asked and cost > budget for asked, cost in zip(which, costs, strict=True)):
            return None
        if self.doubted or any(missed):
            return self.aims
        aims = [aim / FINER if asked else aim for aim, asked in zip(self.aims, which, strict=True)]
        if all(error <= aim for error, aim in zip(errors, aims, strict=True)):
            mended = zip(aims, errors, which, strict=True)
            aims = [min(aim, error / FINER) if asked else aim for aim, error, asked in mended]
        return aims


def check(
    scene: Scene | str | Path, *, tol: float = DEFAULT_TOL, tol_tension: float | None = None,
    methods: tuple[str | Method, str | Method] = SOLVERS, deep: bool = False, progress: Progress | None = None,
    made: Callable[..., None] | None = None, until: float | None = None,
) -> Check:  # fmt: skip
    """Run two methods on a scene, each as fine as its own error bar needs to meet `tol`, and compare them.

    tol : asked of the error of the mass path, relative to the largest deflection; in [1e-6, 0.2].
    tol_tension : asked of the tension, relative to H; default ten times `tol`.  Where the path's bar is met but
        tension, fields or laws are too coarse to tell, the solver whose bars make them so is refined further; where
        the bars cover less than the range, or the solvers disagree, both are.
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
    aims: list[float] | None = [tol * share / sum(shares) for share in shares]
    judged: _Round | None = None
    while aims is not None:
        known = (None, None) if judged is None else judged.runs
        confirms = judged is not None and judged.doubted
        jobs: list[Callable[[Progress], Any]] = [
            partial(_resolved, scene, m, aim, budget, until, e, confirms)
            for m, aim, e in zip(found, aims, known, strict=True)
        ]
        first, second, *once = side_by_side([*jobs, *grip], progress, _load)
        gripped, grip = gripped or once, []
        if made is not None:
            made(first.run, second.run)
        runs: tuple[Estimated, Estimated] = first, second
        judged = _Round(found, aims, runs, agree(scene, *runs, tol=tol, tol_tension=tol_tension), judged, confirms)
        aims = judged.ahead(budget)
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
    confirms: bool, progress: Progress,
) -> Estimated:  # fmt: skip
    told = partial(progress, method.name)
    told(0.0)
    ends: dict[str, Any] = {} if until is None else {"until": until}
    if before is not None and confirms:
        e = again(scene, method, before, CONFIRMS, progress=told, **ends)
    else:
        past = 0.0 if ends else math.inf
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
