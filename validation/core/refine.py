"""From a tolerance to a resolution: refine space or time, whichever pays more."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np

from cablefem.newmark import scheme
from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.flags import with_flag
from validation.core.ladder import ROUNDING, Branch, Goal, Ladder, identity
from validation.core.measures import SLACK_END, NotComparable, relative_path_gap
from validation.core.methods import Method, find_method
from validation.core.order import FIRST, MIN_ORDER
from validation.core.running import Run
from validation.core.sidebyside import Progress, no_progress
from validation.core.view import View

RUN_OPTIONS = ("model", "load", "law", "until", "frames")  # arguments beside the method's settings
FIRST_STEPS = 120
MAX_STEPS = 64_000
MAX_SIZE = 2e6  # steps times resolution, about 0.5 GB
BUDGET = 1.2e6  # work (see `exceeds_work_budget`) of the finest run of a ladder, which takes 30 to 60 s
AIM = 0.8  # planned bar over its target
FINER = np.linspace(1.0, 2.0, 5).tolist()  # refinements of space in one step of planning; larger ones may cost too much
SHORTER = np.linspace(1.0, 4.0, 7).tolist()  # of time; orders do not hold further

# Affordable steps do not resolve axial waves, so the rule damps them.
SHARP = {"scheme": "radau"}  # of order 5; elements take a fraction of the steps
QUIET = {"scheme": "generalized-alpha", "rho_inf": 0.8}
SWINGING = {"rho_inf": 0.5}  # on free rides axial waves reverse the friction


class TooCoarse(RuntimeError):
    """No affordable resolution meets the tolerance; `ladder` is the finest one."""

    def __init__(self, ladder: Ladder, bar: float, tol: float) -> None:
        run = ladder.finest
        reached = f"an error bar of {bar:.2g}" if math.isfinite(bar) else "no end of the window"
        chosen = find_method(run.method).resolution_and_steps(run.settings)
        settings = ", ".join(f"{key} = {value}" for key, value in chosen.items())
        super().__init__(
            f"{run.method} reaches {reached} with {settings}, not the {tol:g} asked for; loosen the tolerance or "
            "take another method (cablefem advise)"
        )
        self.ladder = ladder


class RunsOfMethod:
    """Runs of one method; coarser ones may end at s_o/l = `window_end`."""

    def __init__(
        self, scene: Scene, method: str | Method, options: dict[str, Any], earlier_runs: Sequence[Response] = ()
    ) -> None:
        self.scene = scene
        self.method = find_method(method)
        self.view = View.of_scene(scene)
        self.earlier = earlier_runs
        self.made = list[Run]()
        self.model = {key: options[key] for key in RUN_OPTIONS if key in options}
        self.settings = {key: value for key, value in options.items() if key not in RUN_OPTIONS}
        self.end = self.model.pop("until", None)
        ends = [end for end in (self.view.last_needed_relative_position, self.end) if end is not None]
        self.window_end = min(ends, default=None)

    def run_or_reuse(self, settings: dict[str, Any], until: float | None) -> Response:
        """The run with these settings to s_o/l = until or further."""
        for path in self.earlier:
            far = until is None or path.reached >= until * (1.0 - 1e-9)
            if path.settings == settings and (far or path.status != "complete"):
                return path
        run = next((x for x in self.made if x.settings == settings), None)
        if run is None:
            run = Run(self.scene, self.method, **self.model, **settings)
            self.made.append(run)
        return run.run_to(until)

    def compute_ladder(self, settings: dict[str, Any]) -> Ladder:
        """The run with these settings and coarser ones, of which only the paths are computed."""
        finest = self.run_or_reuse(settings, self.window_end)
        space = self.method.resolution
        resolutions = self._resolutions_from_finest(settings)
        in_space = Branch(
            runs=self._coarser_runs(settings, space.setting, resolutions[1:]),
            ratios=tuple(space.refinement_ratio(coarse, fine) for fine, coarse in pairwise(resolutions)),
            order=min(self.method.space_order, 1.5) if self.method.space_order > 1.0 else 1.0,
        )
        steps = settings["steps"]
        all_steps = [steps, *(x for x in (round(steps / 2), round(steps / 4)) if x >= 2)]
        in_time = Branch(
            runs=self._coarser_runs(settings, "steps", all_steps[1:]),
            ratios=tuple(fine / coarse for fine, coarse in pairwise(all_steps)),
            order=min(2.0, scheme(settings["scheme"]).order),
        )
        return Ladder(finest, in_space, in_time)

    def _coarser_runs(self, settings: dict[str, Any], name: str, values: Sequence[int]) -> tuple[Response, ...]:
        """Runs with these values of the setting `name`."""
        return tuple(self.run_or_reuse(settings | {name: value}, self.window_end) for value in values)

    def _resolutions_from_finest(self, settings: dict[str, Any]) -> list[int]:
        """Resolutions from the finest on: half and quarter, or fewer."""
        count = self.method.resolution_value(settings)
        if self.method.resolution.doubling:
            return [count - k for k in range(3) if count - k >= 0]
        # no coarser than the method's first run, but ratios of at least 3/2
        quarter = max(count / 4.0, min(self.method.coarsest_settings[0], count / 2.25))
        smallest = self.method.all_settings[self.method.resolution.setting].allowed[0]
        counts = [count]
        for coarser in (round(math.sqrt(count * quarter)), round(quarter)):
            if smallest <= coarser < counts[-1]:
                counts.append(coarser)
        return counts

    def continued_with_error_bars(self, ladder: Ladder) -> Ladder:
        """The ladder with its finest run marched to the end, and bars."""
        finest = self.run_or_reuse(ladder.finest.settings, self.end)
        until = self.window_end
        if self.scene.obstacle or self.scene.ground:
            until = self.end  # clearances are told up to there
        elif self.view.last_needed_relative_position is not None and finest.slack_onset_position_or_inf < SLACK_END:
            until = SLACK_END if self.end is None else min(self.end, SLACK_END)

        def continued(run: Response) -> Response:
            return finest if run.settings == finest.settings else self.run_or_reuse(run.settings, until)

        ladder = replace(ladder.map(continued), start_gap=self._relative_start_gap(finest))
        return with_error_bars(ladder, self.view)

    def _relative_start_gap(self, finest: Response) -> Array | float:
        """See `Ladder`; zero where the coarser runs resolve the distance, or no run needs to."""
        start = float(finest.s_o[0]) / finest.length
        space = self.method.resolution.setting
        if self.method.mesh_follows_mass or self.scene.drive.mode == "grip" or not start > 0.0:
            return 0.0
        resolves = 1.2  # waves times start/l with which the start converges
        enough = min(math.ceil(resolves / start), self.method.all_settings[space].allowed[1])
        if 2 * self.method.resolution_value(finest.settings) >= enough:
            return 0.0
        resolved = self.run_or_reuse(finest.settings | {space: enough}, start * (1.0 + 1e-9))
        off = np.array([finest.x[0] - resolved.x[0], finest.y[0] - resolved.y[0]])
        return np.abs(off) / finest.max_deflection


def run_with_error_bars(
    scene: Scene, method: str | Method, *, progress: Progress = no_progress, earlier_runs: Sequence[Response] = (),
    **options: Any,
) -> Ladder:  # fmt: skip
    """The ladder of a run; `options` as in `run`, `earlier_runs` runs are reused."""
    runs = RunsOfMethod(scene, method, options, earlier_runs)
    ladder = runs.compute_ladder(runs.method.settings_for_scene(scene.groups, runs.settings))
    progress(0.5)
    return runs.continued_with_error_bars(ladder)


def refine_to_tolerance(
    scene: Scene, method: str | Method, tol: float, *, progress: Progress = no_progress, budget: float = BUDGET,
    **options: Any,
) -> Ladder:  # fmt: skip
    """A ladder whose finest run has a path bar of at most `tol`; see README.md, "How fine a run is".

    budget : see `exceeds_work_budget`.

    Raises TooCoarse.
    """
    runs = RunsOfMethod(scene, method, options)
    method = runs.method
    if method.wrong:
        raise ValueError(f"{method.name} converges to a wrong answer: no resolution meets a tolerance")
    chosen = _settings_with_default_scheme(scene, method, runs.settings)
    settings = method.settings_for_scene(scene.groups, chosen | _first_resolution_and_steps(scene, method))
    ratio = 1.0  # last refinement of space
    bar_before = math.inf  # in space, before it
    broken = 0
    max_broken = 3  # ladders one after the other that do not reach the end of the window
    while True:
        ladder = runs.compute_ladder(settings)
        goal = Goal(path_error_bar_parts(ladder, runs.view), tol)
        known = f"{goal.bar:.1g}" if math.isfinite(goal.bar) else "not known yet"
        progress(0.3, f"{len(runs.made)} runs, bar {known}, {tol:.2g} wanted")
        broken = 0 if math.isfinite(goal.bar) else broken + 1
        if goal.bar_over_target <= 1.0 or broken == max_broken:
            break
        in_space, _ = goal.parts
        steps_too_long = ratio > 1.0 and not in_space < bar_before / ratio**MIN_ORDER  # for a finer mesh
        if steps_too_long:
            finer = _settings_with_doubled_steps(method, ladder, budget)
        else:
            finer = next_settings(method, ladder, goal, budget, allow_half=True)
        if finer is None:
            break
        ratio = method.resolution.refinement_ratio(method.resolution_value(settings), method.resolution_value(finer))
        bar_before = in_space
        settings = finer
    ladder = runs.continued_with_error_bars(ladder)
    progress(1.0)
    if goal.bar_over_target <= 1.0:
        return ladder
    raise TooCoarse(ladder, goal.bar, tol)


def refine_until_goal_met(
    scene: Scene, ladder: Ladder, goal: Callable[[Ladder], Goal], *, budget: float = BUDGET, **options: Any
) -> Ladder:
    """A ladder refined until the goal that it has is met, or it costs too much."""
    method = find_method(ladder.finest.method)
    while (now := goal(ladder)).bar_over_target > 1.0:
        finer = next_settings(method, ladder, now, budget)
        if finer is None:
            break
        ladder = run_with_error_bars(scene, method, earlier_runs=ladder.runs, **{**options, **finer})
    return ladder


# --- the planner ----------------------------------------------------------------------------------------------------


def next_settings(
    method: Method, ladder: Ladder, goal: Goal, budget: float, *, allow_half: bool = False
) -> dict[str, Any] | None:
    """The cheapest finer settings predicted to meet a goal with a margin, else just; None: none within the budget.

    allow_half : half of that refinement will do where the full one costs too much.
    """
    now = ladder.finest.settings
    candidates = [cheapest_settings(method, now, goal, AIM), cheapest_settings(method, now, goal, 1.0)]
    if allow_half:
        candidates.append(cheapest_settings(method, now, goal, AIM, share=0.5))
    return _first_candidate_within_budget(method, ladder, candidates, budget)


def _settings_with_doubled_steps(method: Method, ladder: Ladder, budget: float) -> dict[str, Any] | None:
    now = ladder.finest.settings
    steps = min(2 * now["steps"], max(now["steps"], MAX_STEPS))
    return _first_candidate_within_budget(method, ladder, [now | {"steps": steps}], budget)


def _first_candidate_within_budget(
    method: Method, ladder: Ladder, candidates: list[dict[str, Any]], budget: float
) -> dict[str, Any] | None:
    """The first settings that are not those of the ladder and within the budget; None: none is."""
    for settings in candidates:
        if settings != ladder.finest.settings and not exceeds_work_budget(method, ladder, settings, budget):
            return settings
    return None


def cheapest_settings(
    method: Method, settings: dict[str, Any], goal: Goal, aim: float = AIM, share: float = 1.0
) -> dict[str, Any]:
    """The cheapest settings predicted to leave a bar of at most `aim` times the target, by one refinement.

    share : of the largest refinements of space and time.

    An infinite part of time, or of both, doubles the steps; one of space the resolution.
    """
    space = method.resolution
    count = method.resolution_value(settings)
    steps = settings["steps"]
    target = aim * goal.target
    in_space, in_time = goal.parts
    if math.isfinite(goal.bar):
        p = min(goal.order, 1.5, max(method.space_order, 1.0))
        q = min(goal.order, 2.0, scheme(settings["scheme"]).order)
        finer = [x for x in FINER if x <= share * FINER[-1]]
        shorter = [x for x in SHORTER if x <= share * SHORTER[-1]]
        predicted = {(a, b): in_space / a**p + in_time / b**q for a, b in product(finer, shorter)}
        enough = max(target, min(predicted.values()) / AIM)
        sufficient = [factors for factors, bar in predicted.items() if bar <= enough]
        a, b = min(sufficient, key=lambda factors: space.step_cost_over_fixed_cost(count, factors[0]) * factors[1])
    else:
        a = 1.0 if math.isfinite(in_space) else 2.0
        b = 1.0 if in_time <= target else 2.0
    b = max(b, math.sqrt(a))  # shorter waves need shorter steps
    resolution = max(count, space.scaled_at_least(count, a)) if a > 1.0 else count
    return settings | {space.setting: resolution, "steps": min(math.ceil(steps * b), max(steps, MAX_STEPS))}


def exceeds_work_budget(method: Method, ladder: Ladder, finer: dict[str, Any], budget: float) -> bool:
    """Whether finer settings exceed MAX_SIZE or the budget.

    Work is Newton iterations, times nodes of a step, times cost of the resolution.
    """
    r = ladder.finest
    count = method.resolution_value(finer)
    nodes = max(1, len(scheme(r.settings["scheme"]).nodes))
    iterations = r.work["newton_iterations"] * finer["steps"] / r.settings["steps"]
    work = iterations * nodes * method.resolution.step_cost_over_fixed_cost(count)
    return finer["steps"] * count > MAX_SIZE or work > budget


# --- bars -----------------------------------------------------------------------------------------------------------


Gap = Callable[[Response, Response, View], float]  # of a coarse run to a fine one


def path_error_bar_parts(ladder: Ladder, view: View) -> tuple[float, float]:
    """The parts of the bar of the path; infinite if unknown."""
    return gap_error_bar_parts(
        ladder, view, lambda coarse, fine, view: relative_path_gap(coarse, fine, view.window).largest
    )


def _tension_gap(coarse: Response, fine: Response, view: View) -> float:
    return measures.rms_tension_gap_over_H(fine, coarse, view.window)


def gap_error_bar_parts(ladder: Ladder, view: View, gap: Gap, order: float = math.inf) -> tuple[float, float]:
    """The parts of the bar of a gap; infinite if unknown;  order : the most credited."""
    try:
        view = view.cut_to_valid_range(ladder.finest)
    except NotComparable:
        return math.inf, math.inf
    covering = ladder.only_runs_covering(view)
    return covering.error_bars_in_space_and_time(identity, lambda fine, coarse: gap(coarse, fine, view), order)


def with_error_bars(ladder: Ladder, view: View) -> Ladder:
    """The ladder with bars of path and tension in its finest run, else a flag."""
    finest = ladder.finest
    path = path_error_bar_parts(ladder, view)
    tension = gap_error_bar_parts(ladder, view, _tension_gap, FIRST)
    try:
        window = view.cut_to_valid_range(finest).window
        relative_path_gap(finest, finest, window)
        if not math.isfinite(sum(path)):
            what = "resolution" if math.isinf(path[0]) else "steps"
            raise NotComparable(f"the run with half the {what} ends before s_o/l = {window[1]:.3f}, or there is none")
    except NotComparable as why:
        return replace(ladder, finest=with_flag(finest, "no bar", why=str(why)))
    parts = {"path_space": path[0], "path_time": path[1]}
    tension_error = None
    if math.isfinite(sum(tension)):
        parts |= {"tension_space": tension[0], "tension_time": tension[1]}
        tension_error = sum(tension)
    barred = replace(
        finest, error_parts=parts, path_error=max(ROUNDING, sum(path)), tension_error=tension_error,
        error_window=list(window),
    )  # fmt: skip
    return replace(ladder, finest=barred)


def path_error_bar_from_coarser_runs(r: Response) -> float:
    """The bar of the path by the solver's own coarser runs; `path_error` of a check is at least the gap."""
    parts = r.error_parts or {}
    return parts.get("path_space", math.inf) + parts.get("path_time", math.inf)


# --- the rule, and where to begin -----------------------------------------------------------------------------------


def _settings_with_default_scheme(scene: Scene, method: Method, settings: dict[str, Any]) -> dict[str, Any]:
    """The user's settings with the time scheme, if they name none."""
    if scene.drive.mode == "free":
        return settings if method.mesh_follows_mass else SWINGING | settings
    if method.all_settings["scheme"].default != "trapezoidal" or "scheme" in settings:
        return settings
    return (SHARP if method.mesh_follows_mass else QUIET) | settings


def _first_resolution_and_steps(scene: Scene, method: Method) -> dict[str, int]:
    """First resolution and steps; for a light car at least one unknown and step per front width."""
    space = method.resolution
    groups = scene.groups
    motion = groups.motion
    first = math.ceil(2.25 * method.coarsest_settings[0])
    if space.doubling:
        first = method.coarsest_settings[0] + 2
    if motion is None:
        if scene.drive.mode == "free" and not method.mesh_follows_mass:
            # waves of fixed functions times start/l of a rider: fewer do not know that he is off the support
            resolved = 0.15
            first = max(first, math.ceil(resolved / groups.drive.start))
        return {space.setting: first, "steps": method.settings_for_scene(groups, {})["steps"] // 2}
    light = 0.1  # mass ratio mu of a car whose front the first mesh must resolve
    if scene.mu > light:
        return {space.setting: first, "steps": FIRST_STEPS}
    fine = min(space.value_for_unknowns(2.0 / scene.mu), space.max_value // 2)
    return {space.setting: max(first, fine), "steps": max(FIRST_STEPS, math.ceil(motion.end_time / scene.mu))}
