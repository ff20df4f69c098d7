"""From a tolerance to a resolution: refine space or time, whichever pays more."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from cablefem.newmark import scheme
from cablefem.response import Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.ladder import Branch, Ladder, itself
from validation.core.measures import SLACK_END, NotComparable
from validation.core.methods import Method, find
from validation.core.order import LEAST_ORDER
from validation.core.running import Run
from validation.core.sidebyside import Progress, silent
from validation.core.view import View
from validation.core.watch import flagged

KIND = ("model", "load", "law", "until", "frames")  # arguments beside the method's settings
FIRST_STEPS = 120
MOST_STEPS = 64_000
LARGEST = 2e6  # steps times resolution, about 0.5 GB
BUDGET = 1.2e6  # work (see `dear`) of the finest run of a ladder, which takes 30 to 60 s
AIM = 0.8  # planned bar over the one asked for
FINER = np.array([1.0, 1.25, 1.5, 1.75, 2.0])  # refinements of space in one stride; larger ones may cost too much
SHORTER = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0])  # of time; orders do not hold further
ROUNDING = 1e-12  # of the path's scale

# Affordable steps do not resolve axial waves, so the rule damps them.
SHARP = {"scheme": "radau"}  # of order 5; elements take a fraction of the steps
QUIET = {"scheme": "generalized-alpha", "rho_inf": 0.8}
SWINGING = {"rho_inf": 0.5}  # on free rides axial waves reverse the friction
LIGHT = 0.1  # mass ratio mu of a car whose front the first mesh must resolve


class TooCoarse(RuntimeError):
    """No affordable resolution meets the tolerance; `ladder` is the finest one."""

    def __init__(self, ladder: Ladder, bar: float, tol: float) -> None:
        reached = f"an error bar of {bar:.2g}" if math.isfinite(bar) else "no end of the window"
        told = ", ".join(f"{k} = {x}" for k, x in find(ladder.run.method).told(ladder.run.settings).items())
        super().__init__(
            f"{ladder.run.method} reaches {reached} with {told}, not the {tol:g} asked for; loosen the tolerance or "
            "take another method (cablefem advise)"
        )
        self.ladder = ladder


class Runs:
    """Runs of one method; `short` is where coarser ones may end, s_o/l."""

    def __init__(
        self, scene: Scene, method: str | Method, kind: dict[str, Any], view: View | None,
        known: Sequence[Response] = (),
    ) -> None:  # fmt: skip
        self.scene = scene
        self.method = find(method) if isinstance(method, str) else method
        self.view = view or View.of(scene)
        self.known = known
        self.made = list[Run]()
        self.how = {k: kind[k] for k in KIND if k in kind}
        self.named = {k: v for k, v in kind.items() if k not in KIND}
        self.end = self.how.pop("until", None)
        self.short = min((x for x in (self.view.stop, self.end) if x is not None), default=None)

    def at(self, settings: dict[str, Any], until: float | None, past: float = math.inf) -> Response:
        """The run with these settings to s_o/l = until or further."""
        for r in self.known:
            far = until is not None and r.reached >= until * (1.0 - 1e-9)
            if r.settings == settings and (until is None or far or r.status != "complete"):
                return r
        marched = next((x for x in self.made if x.settings == settings), None)
        if marched is None:
            marched = Run(self.scene, self.method, **self.how, **settings)
            self.made.append(marched)
        return marched.to(until, past=past)

    def ladder(self, settings: dict[str, Any]) -> Ladder:
        finest = self.at(settings, self.short)
        branches = []
        for name, values, nominal in self._coarser(settings):
            runs = tuple(self.at(settings | {name: x}, self.short) for x in values[1:])
            resolution = self.method.resolution
            count = resolution.ratio if name == resolution.setting else lambda a, b: b / a
            ratios = tuple(count(b, a) for a, b in pairwise(values))
            branches.append(Branch(runs, ratios, nominal))
        return Ladder(finest, *branches)

    def _coarser(self, settings: dict[str, Any]) -> list[tuple[str, list[int], float]]:
        """(setting, values from the finest on, nominal order) of space and time."""
        space = self.method.resolution
        count = self.method.value(settings)
        steps = settings["steps"]
        if space.doubling:
            counts = [count - k for k in range(3) if count - k >= 0]
        else:
            # no coarser than the method's first run, but ratios of at least 3/2
            quarter = max(count / 4.0, min(self.method.begins[0], count / 2.25))
            least = self.method.knobs[space.setting].allowed[0]
            counts = [count, round(math.sqrt(count * quarter)), round(quarter)]
            counts = [x for i, x in enumerate(counts) if x >= least and (i == 0 or x < counts[i - 1])]
        times = [steps, *(x for x in (round(steps / 2), round(steps / 4)) if x >= 2)]
        order = min(self.method.space_order, 1.5) if self.method.space_order > 1.0 else 1.0
        return [(space.setting, counts, order), ("steps", times, min(2.0, scheme(settings["scheme"]).order))]

    def finished(self, ladder: Ladder, past: float) -> Ladder:
        """The ladder with its finest run marched to the end, and bars."""
        finest = self.at(ladder.finest.settings, self.end, past)
        until = self.short
        if self.view.stop is not None and finest.slack_from < SLACK_END:
            until = SLACK_END if self.end is None else min(self.end, SLACK_END)
        ladder = ladder.map(lambda r: finest if r.settings == finest.settings else self.at(r.settings, until))
        return annotated(ladder, self.view)


def laddered(
    scene: Scene, method: str | Method, *, progress: Progress | None = None, known: Sequence[Response] = (),
    past: float = math.inf, view: View | None = None, **kind: Any,
) -> Ladder:  # fmt: skip
    """The ladder of a run; `kind` as in `run`, `known` runs are reused."""
    runs = Runs(scene, method, kind, view, known)
    ladder = runs.ladder(runs.method.settings_on(scene.groups, runs.named))
    if progress is not None:
        progress(0.5)
    return runs.finished(ladder, past)


def climb(
    scene: Scene, method: str | Method, tol: float, *, progress: Progress | None = None, budget: float = BUDGET,
    past: float = math.inf, view: View | None = None, **kind: Any,
) -> Ladder:  # fmt: skip
    """A ladder whose finest run has a path bar of at most `tol`; see README.md, "How fine a run is".

    budget : see `dear`;  past : s_o/l the finest run goes on once slack.
    view : range of the path's bar; default: of the scene.

    Raises TooCoarse.
    """
    runs = Runs(scene, method, kind, view)
    report = progress or silent
    method = runs.method
    space = runs.method.resolution
    if method.wrong:
        raise ValueError(f"{method.name} converges to a wrong answer: no resolution meets a tolerance")
    settings = method.settings_on(scene.groups, _rule(scene, method, runs.named) | _begin(scene, method))
    # last refinement of space, and the part before
    ratio = 1.0
    before = math.inf
    while True:
        ladder = runs.ladder(settings)
        parts = path_parts(ladder, runs.view)
        report(0.3, f"{len(runs.made)} runs, bar {sum(parts):.1g} of {tol:g} wanted")
        if sum(parts) <= tol:
            break
        stuck = ratio > 1.0 and not parts[0] < before / ratio**LEAST_ORDER  # steps too long for a finer mesh
        finer = _stride(method, ladder, parts, AIM * tol, stuck, budget)
        if finer is None:
            break
        ratio = space.ratio(method.value(settings), method.value(finer))
        before = parts[0]
        settings = finer
    ladder = runs.finished(ladder, past)
    report(1.0)
    if sum(parts) <= tol:
        return ladder
    raise TooCoarse(ladder, sum(parts), tol)


def _stride(
    method: Method, ladder: Ladder, parts: tuple[float, float], target: float, stuck: bool, budget: float
) -> dict[str, Any] | None:
    """The next settings: a stride, else half of one; if space is stuck, twice the steps; None: too dear."""
    settings = ladder.finest.settings
    if stuck:
        strides = [settings | {"steps": min(2 * settings["steps"], max(settings["steps"], MOST_STEPS))}]
    else:
        strides = [cheapest(method, settings, parts, target, most=most) for most in (1.0, 0.5)]
    return next((x for x in strides if x != settings and not dear(method, ladder, x, budget)), None)


def refined_until(
    scene: Scene, ladder: Ladder, left: Callable[[Ladder], tuple[float, float]], *, budget: float = BUDGET, **kind: Any
) -> Ladder:
    """A ladder refined until other bars are met or it costs too much.

    left : parts of space and time over what is asked; first order is credited.
    """
    method = find(ladder.run.method)
    while sum(parts := left(ladder)) > 1.0:
        finer = cheapest(method, ladder.run.settings, parts, AIM, 1.0)
        if finer == ladder.run.settings or dear(method, ladder, finer, budget):
            break
        ladder = laddered(scene, method, known=ladder.runs, **{**kind, **finer})
    return ladder


def path_parts(ladder: Ladder, view: View) -> tuple[float, float]:
    return parts_of(ladder, view, lambda x, y, view: measures.path_gap(x, y, view.window)[0])


def parts_of(ladder: Ladder, view: View, gap: Callable[..., float], order: float = math.inf) -> tuple[float, float]:
    """Parts of space and time in the bar of a gap(coarse, fine, view); infinite if unknown."""
    try:
        view = view.cut(ladder.finest)
    except NotComparable:
        return math.inf, math.inf
    return ladder.over(view).parts(itself, lambda a, b: gap(b, a, view), order)


def cheapest(
    method: Method, settings: dict[str, Any], parts: tuple[float, float], target: float, order: float = math.inf,
    most: float = 1.0,
) -> dict[str, Any]:  # fmt: skip
    """The cheapest settings predicted to leave at most `target`, within one stride.

    An infinite part doubles the steps, one of space also the resolution.
    order : the most credited;  most : part of a stride that may be taken.
    """
    space = method.resolution
    count = method.value(settings)
    steps = settings["steps"]
    p = min(order, 1.5, max(method.space_order, 1.0))
    q = min(order, 2.0, scheme(settings["scheme"]).order)
    if not all(math.isfinite(x) for x in parts):
        a = 1.0 if math.isfinite(parts[0]) else 2.0
        b = 1.0 if parts[1] <= target else 2.0
    else:
        longer, shorter = (x[x <= most * x[-1]] for x in (FINER, SHORTER))
        left_over = longer[:, None] ** -p * parts[0] + shorter**-q * parts[1]
        costs = np.array([space.cost(count, x) for x in longer.tolist()])[:, None] * shorter
        meets = left_over <= max(target, left_over.min() / AIM)
        i, k = np.unravel_index(np.where(meets, costs, math.inf).argmin(), costs.shape)
        a = float(longer[i])
        b = float(shorter[k])
    b = max(b, math.sqrt(a))  # shorter waves need shorter steps
    finer = space.finer(count, a) if a > 1.0 else count
    return settings | {space.setting: max(count, finer), "steps": min(math.ceil(steps * b), max(steps, MOST_STEPS))}


def dear(method: Method, ladder: Ladder, finer: dict[str, Any], budget: float) -> bool:
    """Whether finer settings exceed LARGEST or the budget.

    Work is Newton iterations, times nodes of a step, times cost of the resolution.
    """
    r = ladder.finest
    count = method.value(finer)
    nodes = max(1, len(scheme(r.settings["scheme"]).nodes))
    iterations = r.work["newton_iterations"] * finer["steps"] / r.settings["steps"]
    return finer["steps"] * count > LARGEST or iterations * nodes * method.resolution.cost(count) > budget


def annotated(ladder: Ladder, view: View) -> Ladder:
    """The ladder with bars of path and tension in its finest run, else a flag."""
    try:
        path = path_parts(ladder, view)
        view = view.cut(ladder.finest)
        tension = ladder.over(view).parts(itself, lambda a, b: measures.tension_gap(a, b, view.window), 1.0)
        measures.path_gap(ladder.finest, ladder.finest, view.window)
        if not math.isfinite(sum(path)):
            what = "resolution" if math.isinf(path[0]) else "steps"
            end = f"s_o/l = {view.window[1]:.3f}"
            raise NotComparable(f"the run with half the {what} ends before {end}, or there is none")
    except NotComparable as why:
        return replace(ladder, finest=flagged(ladder.finest, "no bar", why=str(why)))
    parts = {"path_space": path[0], "path_time": path[1]}
    told: dict[str, Any] = {"path_error": max(ROUNDING, sum(path)), "error_window": list(view.window)}
    if math.isfinite(sum(tension)):
        parts |= {"tension_space": tension[0], "tension_time": tension[1]}
        told["tension_error"] = sum(tension)
    return replace(ladder, finest=replace(ladder.finest, error_parts=parts, **told))


def own_path_error(r: Response) -> float:
    """The bar of the path by the solver's own coarser runs; `path_error` of a check is at least the gap."""
    parts = r.error_parts or {}
    return parts.get("path_space", math.inf) + parts.get("path_time", math.inf)


# --- the rule, and where to begin -----------------------------------------------------------------------------------


def _rule(scene: Scene, method: Method, named: dict[str, Any]) -> dict[str, Any]:
    if scene.drive.mode == "free":
        return named if method.follows else SWINGING | named
    if method.knobs["scheme"].default != "trapezoidal" or "scheme" in named:
        return named
    return (SHARP if method.follows else QUIET) | named


def _begin(scene: Scene, method: Method) -> dict[str, int]:
    """First resolution and steps; for a light car at least one unknown and step per front width."""
    space = method.resolution
    motion = scene.groups.motion
    groups = scene.groups
    first = method.begins[0] + 2 if space.doubling else math.ceil(2.25 * method.begins[0])
    if motion is None:
        return {space.setting: first, "steps": method.settings_on(groups, {})["steps"] // 2}
    if scene.mu > LIGHT:
        return {space.setting: first, "steps": FIRST_STEPS}
    fine = min(space.with_unknowns(2.0 / scene.mu), space.most // 2)
    return {space.setting: max(first, fine), "steps": max(FIRST_STEPS, math.ceil(motion.phases[-1][1] / scene.mu))}
