"""From a tolerance to a resolution: refine space or steps for the least cost, and read each from its own refinement."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cablefem.newmark import scheme
from cablefem.response import MassPath, Response
from cablefem.scene import Scene
from cablefem.scene.bisection import bisected
from validation.core import measures, richardson
from validation.core.design import Refinement, of_ladder
from validation.core.estimate import KIND, SAME_ONSET, Estimated, companions, rings, until, weighted, window_of
from validation.core.methods import Method, find, refined
from validation.core.richardson import NO_ORDER, UNCONFIRMED, space_order, time_order
from validation.core.running import Run, run, whole
from validation.core.sidebyside import Progress, side_by_side

FIRST_STEPS, MOST_STEPS = 110, 64_000
LARGEST = 2e6  # steps x resolution: half a gigabyte of states
# Between these a refinement tells enough and does not outrun what orders promise (tolerance_survey: with refinements up
# to 4 the bars of 13 percent of the runs are too small, up to 2 of 3 percent).
LEAST, FURTHEST = 1.4, 2.0
STRIDES = np.array([1.0, *np.geomspace(LEAST, 50.0, 30)])
# Roache's factor of safety where the part fell with refinement as its order says, or nearly so.
CONFIRMED, NEARLY = 1.25, 1.3
LOWEST, HIGHEST = 0.01, 8.0  # orders between which one is looked for
ATTEMPTS = 20
AIM = 0.8  # of the tolerance, so that a prediction that is a little short does not cost another run
STUCK = 0.8  # of what it was: where a finer mesh leaves more than that of its part, steps are too long for it
UNRESOLVED = 0.05  # of the deflection: while time costs more than that, space is not judged
# s_o/l that trial runs go on past their slack onset: no comparison goes beyond the finer run's, whose may be later
PAST = 2.0 * SAME_ONSET
LITTLE = 1e5  # `work` that nobody waits for
SPARSE = 4  # every so-manieth frame is enough of trial runs that nobody else will look at

# Where steps are chosen, so is the rule: axial waves run some sqrt(alpha) times faster than the answer moves, and steps
# that do not resolve them must damp them, or they gain energy by the nonlinearity until Newton's method ends in folded
# elements.  On the nine hardest of 128 random scenes with tol 1e-2 the trapezoidal rule took 3.5 times the work of this
# one.  Of 51 bars 50 hold with rho_inf 0.8 and 48 with 0.6, at three quarters of the work.
QUIET = {"scheme": "generalized-alpha", "rho_inf": 0.8}

# A car of at most this mass that enters with speed sends a front of width mu over the cable and meets it again: what
# counts is how little the front disperses on all its way, in space and time.  Elements graded towards the car make it
# worse, degree 6 or 8 with as many unknowns is no better, nor are short steps alone; FRONT is, see `elements.front`.
# For a tolerance beyond FINE only cars of a third of that: at 1e-2 QUIET took a third to a fiftieth of the time on five
# random scenes with mu = 0.05 to 0.09; at 5e-4 it took 1.7 times as much, and with mu = 0.015 at 5e-3 5 times.
# Heavier ones ride with SHARP on a following mesh beyond FINEST: with tol 1e-4 all trial runs of following-p2 took 5.7
# times less then on `tramway`, 3.6 on `cruise`, 2.8 on `kevlar`, 1.3 on `inclined` and `level`; with 1e-3 it is as much
# or more.  Such steps, and their companions alike, damp axial waves that they do not resolve: `loud` tells what those
# do to the extremes of forces.  Bases over the whole cable smear a front whatever the rule, and on the long steps
# Newton's method stalls: with mu = 0.053 on `level` Radau's left a bar of 1.4e-2 in 9 s, QUIET's one of 1.1e-3 in 6 s.
LIGHT, SHARP, FINE, FINEST = 0.1, {"scheme": "radau"}, 2e-3, 3e-4
FRONT, AT_FRONT = {"nodes": "front"}, (20, 120)  # and elements and steps to begin with there
# V/c from which the front, back from both supports, catches up with the car past the window only, 2V/(1 - V) = 0.8: of
# slower cars too many fronts are under way to travel with.  With V/c = 0.21, mu = 0.011 a bar was 0.6 of the error.
ONCE = 2.0 / 7.0
# Friction hears what rings, and short steps damp less of it.  A rider who swings to rest on a soft rope (197 m, 108 kg)
# errs by 6e-5 of the length with 20 sines, 6000 steps and this; with 0.7, which halves the error of the speed after a
# sudden stop, by 2e-4 with 12,000 and 2.9e-4 with 48,000, and ten sines err alike, so that no bar told.
SWINGING = {"rho_inf": 0.5}
AUDIBLE = 10.0  # steps on an axial wave's way there and back


class TooCoarse(RuntimeError):
    """No resolution within reach meets the tolerance; `best` is the finest run made, with its error bar."""

    def __init__(self, message: str, best: Response) -> None:
        super().__init__(message)
        self.best = best


@dataclass(frozen=True, slots=True)
class _Part:
    """What one refinement says is left of the error of the path: the estimate, and the factor of safety."""

    left: float
    safety: float
    read: tuple[MassPath, MassPath, float, float] | None = None  # from the finer and the coarser run, ratio, order

    @property
    def path(self) -> float:
        return self.safety * self.left

    @property
    def shows_none(self) -> bool:
        """Whether the part fell more slowly than anything that has an order."""
        return self.safety > UNCONFIRMED

    @property
    def refinement(self) -> list[Refinement]:
        """What the same two runs say of everything else."""
        if self.read is None:
            return []
        fine, coarse, ratio, order = self.read
        of_path, of_force = (richardson.left(p, ratio) for p in (order, 1.0))
        return [Refinement(whole(fine), whole(coarse), self.safety * of_path, richardson.SAFETY * of_force)]

    def tension(self, rings: bool = False) -> float:
        """What is left of the tension's; of first order where steps miss waves that ring, in a ride of none."""
        if self.read is None or not math.isfinite(self.left):
            return self.path
        fine, coarse, ratio, order = self.read
        weight = self.safety * richardson.left(order, ratio)
        if rings:
            free = fine.drive == "free"
            missed = richardson.no_order(ratio) if free else richardson.SAFETY * richardson.left(1.0, ratio)
            weight = max(weight, missed)
        return weight * measures.tension_gap(whole(coarse), whole(fine), window_of(fine, coarse))

    def seen(self, last: MassPath, response: Response) -> _Part:
        """Return the same, read from responses: of the last run from this one."""
        if self.read is None:
            return self
        fine, coarse, ratio, order = self.read
        return replace(self, read=(response if fine is last else whole(fine), whole(coarse), ratio, order))


@dataclass(slots=True)
class _Rung:
    """A run and what space and time contribute to the error bar of its path."""

    response: MassPath
    space: _Part
    time: _Part

    @property
    def bar(self) -> float:
        return self.space.path + self.time.path


class _Climb:
    """Runs of a method on a scene, refined rung by rung until the bar of the last is at most the tolerance."""

    def __init__(
        self, scene: Scene, method: Method, how: dict[str, Any], settings: dict[str, Any], tol: float,
        until: float | None, runs: list[MassPath] | None, rung: _Rung | None,
    ) -> None:  # fmt: skip
        self.scene, self.method, self.how, self.settings, self.tol, self.until = (
            scene, method, how, settings, tol, until
        )  # fmt: skip
        self.halves = runs is not None  # the run with half the steps is wanted, too
        self.made, self.every = ([], SPARSE) if runs is None else (runs, 1)
        self._finest: Run | None = None
        self.rung = rung or self._first()
        self.read_at = settings["steps"]  # for which space was read last
        self.stuck = False  # the last refinement of space did not lower its part
        self.coarser: MassPath | None = None  # the run before space was refined last

    @property
    def finest(self) -> Run:
        """That of the rung, to go on with."""
        if self._finest is None:  # no refinement of the rung it began with
            self._run(self.settings)
        assert self._finest is not None
        return self._finest

    def go(self, budget: float, report: Progress) -> None:
        """Refine until the bar is met, nothing finer is within reach, or its work on the way exceeds the budget."""
        space = self.method.resolution
        for attempt in range(ATTEMPTS):
            report(
                min(0.5, 0.1 + 0.05 * attempt), f"{len(self.made)} runs, bar {self.rung.bar:.1g} of {self.tol:g} wanted"
            )
            met, settings = self.rung.bar <= self.tol, self.settings
            finer = _next(self.method, self.rung, settings, self.tol, self.stuck, self.halves)
            if met and _doubtful(self.rung.response, self.coarser):
                finer = settings | {space.setting: space.finer(self.method.value(settings), FURTHEST)}
            in_space = finer[space.setting] != settings[space.setting]
            # where steps go alone although space costs more, it is as fine as it gets
            alone = self.rung.space.path > self.rung.time.path
            if settings["steps"] >= 2 * self.read_at and (in_space or met or alone):
                self._read_space_again()
            elif (met and not in_space) or finer == settings or self._dear(finer, budget):
                return
            else:  # steps first, on the coarser mesh: that costs less and tells as much
                if finer["steps"] != settings["steps"]:
                    self._refine_steps(finer["steps"])
                if in_space and (met or self.rung.bar > self.tol):  # steps alone may have told enough
                    self._refine_space(finer[space.setting])

    def _run(self, settings: dict[str, Any], keep: bool = True) -> MassPath:
        marched = Run(self.scene, self.method, **self.how, **settings)
        if keep:
            self._finest = marched
        self.made.append(marched.try_to(self.until, every=self.every, past=PAST))
        return self.made[-1]

    def _first(self) -> _Rung:
        """Run the method with both companions, itself last."""
        halves = {"space": 0.5}, {"time": 0.5}
        in_space, in_time = (self._run(refined(self.method, self.settings, **half)) for half in halves)
        fine = self._run(self.settings)
        return _Rung(
            fine,
            _part(fine, in_space, 2.0, space_order(self.method.space_order)),
            _part(fine, in_time, 2.0, time_order(self.settings)),
        )

    def _dear(self, finer: dict[str, Any], budget: float) -> bool:
        """Return whether a run is too large, or too much work beside all others."""
        count, now = self.method.value(finer), self.method.value(self.settings)
        ahead = work(self.method, self.rung.response) * finer["steps"] / self.settings["steps"]
        ahead *= self.method.resolution.cost(count) / self.method.resolution.cost(now)
        return finer["steps"] * count > LARGEST or sum(work(self.method, r) for r in self.made) + ahead > budget

    def _read_space_again(self) -> None:
        """Coarse steps may have blown up what space contributes, or smeared the fronts that tell it."""
        fine, before = self.rung.response, self.rung.space
        coarse = self._run(refined(self.method, self.settings, space=0.5), keep=False)
        self.rung.space = _part(fine, coarse, 2.0, space_order(self.method.space_order), before, 1.0)
        self.read_at = self.settings["steps"]

    def _refine_steps(self, steps: int) -> None:
        ratio, before = steps / self.settings["steps"], self.rung
        self.settings, self.stuck = self.settings | {"steps": steps}, False
        fine = self._run(self.settings)
        part = _part(fine, before.response, ratio, time_order(self.settings), before.time)
        self.rung = _Rung(fine, before.space, part)

    def _refine_space(self, count: int) -> None:
        space, before = self.method.resolution, self.rung
        ratio, self.coarser = space.ratio(self.method.value(self.settings), count), before.response
        self.settings = self.settings | {space.setting: count}
        fine, self.read_at = self._run(self.settings), self.settings["steps"]
        part = _part(fine, before.response, ratio, space_order(self.method.space_order), before.space)
        self.stuck = not part.left < STUCK * before.space.left
        self.rung = _Rung(fine, part, before.time)


def resolve(
    scene: Scene, method: str | Method, tol: float, *, progress: Progress | None = None,
    runs: list[MassPath] | None = None, budget: float = math.inf, past: float = math.inf,
    ladder: list[_Rung] | None = None, **kind: Any,
) -> Response:  # fmt: skip
    """Return a run whose path error bar is at most `tol`, at nearly the least cost, with its design numbers.

    Two companions of a coarse run (half the resolution, half the steps) give the parts s and t of its error.  Refining
    space by a and time by b leaves s/a^p + t/b^2: a and b between 1.4 and 2, or 1, are chosen for the least cost.
    Steps are refined first, on the coarser mesh, and after steps alone have doubled space is read again before it is
    refined; the distance to the run before gives the part anew, with the smaller factor of safety if it has fallen as
    predicted.
    Only the run that is returned goes beyond the window of comparison.

    kind : as in `run`;  runs : receives every run that is made on the way;  budget : of the `work` on the way;
    past : how far in s_o/l the run that is returned goes on once its cable is slack;
    ladder : receives its last rung, and begins with what it holds.

    Steps are equal.  Step sizes from local error were measured and are not used: for the same largest
    path error they take 0.8 to 1.1 times the steps on `level`, for the same rms error and on `inclined` more than equal
    ones do.

    Raises TooCoarse, with the finest run, if the tolerance is out of reach.
    """
    method = find(method) if isinstance(method, str) else method
    if method.wrong:
        raise ValueError(f"{method.name} converges to a wrong answer: no resolution meets a tolerance")
    report = progress or (lambda *told: None)
    how = {k: kind[k] for k in KIND if k in kind}
    end = how.pop("until", None)
    ends = [x for x in (until(scene), end) if x is not None]
    short = min(ends) if ends else None
    if ladder:
        settings = dict(ladder[-1].response.settings)
    else:
        named = {k: v for k, v in kind.items() if k not in KIND}
        settings = method.settings_on(scene.groups, _rule(scene, method, named, tol) | _begin(scene, method, tol))
    climb = _Climb(scene, method, how, settings, tol, short, runs, ladder[-1] if ladder else None)
    climb.go(budget, report)
    rung, settings, made = climb.rung, climb.settings, climb.made
    if ladder and rung is ladder[-1]:
        raise TooCoarse("nothing finer is within reach", whole(rung.response))
    jobs: list[Callable[[Progress], Response]] = []
    there = end == short and climb.every == 1  # all that is wanted of the last run
    if not there:
        jobs.append(lambda told: climb.finest.to(end, lambda x: told(0.5 + 0.5 * x), past=past))
    if runs is not None:  # who wants all runs wants the companions of the last one
        halves = (refined(method, settings, **half) for half in ({"space": 0.5}, {"time": 0.5}))
        missing = (half for half in halves if all(r.settings != half for r in made))
        jobs += [partial(_companion, scene, method, how | {"until": short}, half) for half in missing]
    heard = loud(scene, method, settings)
    if heard is not None:
        jobs.append(partial(_companion, scene, method, how | {"until": short}, heard))
    made += reversed(side_by_side(jobs, report))
    response = whole(rung.response if there else made[-1])
    report(1.0)
    if ladder is not None:  # who goes on from here has bars of its own for all but the path
        ladder.append(_Rung(response, replace(rung.space, read=None), replace(rung.time, read=None)))
        response = replace(response, path_error=rung.bar if math.isfinite(rung.bar) else None)
    else:
        response = _told(scene, response, rung, [whole(r) for r in made if r.settings == heard])
    if rung.bar <= tol:
        return response
    reached = f"an error bar of {rung.bar:.2g}" if math.isfinite(rung.bar) else "no end of the window"
    raise TooCoarse(
        f"{method.name} reaches {reached} with {method.resolution.setting} = {method.value(settings)}, "
        f"steps = {settings['steps']}, not the {tol:g} asked for; loosen the tolerance or take another method "
        "(cablefem advise)",
        response,
    )


def _told(scene: Scene, response: Response, rung: _Rung, loud: list[Response]) -> Response:
    """Return the response of a rung with its design numbers and its bars."""
    space, time = (part.seen(rung.response, response) for part in (rung.space, rung.time))
    rung_to = space.refinement + time.refinement
    rung_to += [Refinement(response, r, 0.0, richardson.SAFETY) for r in loud]
    response = replace(response, design=[number.row() for number in of_ladder(response, rung_to)])
    if not math.isfinite(rung.bar):
        return response
    parts = {
        "path_space": space.path, "path_time": time.path,
        "tension_space": space.tension(), "tension_time": time.tension(rings(scene, response)),
    }  # fmt: skip
    tension = parts["tension_space"] + parts["tension_time"]
    return replace(response, path_error=rung.bar, tension_error=tension, error_parts=parts)


def resolved(
    scene: Scene, method: str | Method, tol: float, *, progress: Progress | None = None, budget: float = math.inf,
    past: float = math.inf, before: Estimated | None = None, **kind: Any,
) -> Estimated:  # fmt: skip
    """Return the run of `resolve`, or the finest within reach and budget, with companions for all other bars.

    The path's bar is that of its own ladder, which has seen its orders; all others are those of the companions.

    before : what was returned for a larger tolerance, whose ladder goes on by its rule.
    """
    method = find(method) if isinstance(method, str) else method
    made: list[MassPath] = []
    ladder: list[_Rung] = []
    if before is not None and before.rung is not None:
        if before.rung.bar <= tol:
            return before
        made, ladder = [before.in_space, before.in_time], [before.rung]
    try:
        finest = resolve(
            scene, method, tol, progress=progress, runs=made, budget=budget, past=past, ladder=ladder, **kind
        )
    except TooCoarse as error:
        finest = error.best
    if before is not None and ladder and ladder[-1] is before.rung:
        return before
    how = {k: kind[k] for k in KIND if k in kind}
    e = companions(scene, method, known=made, **how, **finest.settings)
    heard = loud(scene, method, finest.settings)
    loudly = next((whole(r) for r in made if r.settings == heard), None)
    order = _order_in_time(e, made) or (before.order if before is not None else None)
    return _told_of(replace(e, order=order, loud=loudly), ladder[-1])


def again(
    scene: Scene, method: Method, before: Estimated, space: float, time: float, *, past: float = math.inf,
    progress: Callable[[float], None] | None = None, **kind: Any,
) -> Estimated:  # fmt: skip
    """Return what was resolved anew with `space` times the resolution and `time` times the steps, and both companions.

    For what the path did not ask for; its ladder can go on from there.
    """
    finer = refined(method, before.run.settings, space=space, time=time)
    how = {k: kind[k] for k in KIND if k in kind}
    end = how.pop("until", None)
    run = Run(scene, method, **how, **finer).to(end, progress, past=past)
    e = companions(scene, method, known=[*before.runs, run], **kind, **finer)
    e = replace(e, loud=before.loud, order=before.order)
    orders = space_order(method.space_order), time_order(finer)
    known = (None, None) if before.rung is None else (before.rung.space, before.rung.time)
    parts = [
        _part(e.run, coarse, 2.0, order, part, ratio)
        for coarse, order, part, ratio in zip((e.in_space, e.in_time), orders, known, (space, time), strict=True)
    ]
    return _told_of(e, _Rung(e.run, *parts))


def _told_of(e: Estimated, rung: _Rung) -> Estimated:
    """Return the estimate with the path's bar of its ladder; what shows no order there has none elsewhere."""
    weights = tuple(
        NO_ORDER / own if part.shows_none else x
        for part, own, x in zip((rung.space, rung.time), (e.own, 1.0), e.weights, strict=True)
    )
    e = weighted(replace(e, rung=rung, weights=(weights[0], weights[1])), 1.0)
    return weighted(e, rung.bar / e.run.path_error) if e.run.path_error and math.isfinite(rung.bar) else e


def past_window(scene: Scene, method: Method, r: Response, made: list[MassPath], **kind: Any) -> Response:
    """Return the run, or one in more steps, whose slack onset past the window of comparison coarser runs share.

    A tolerance is asked of the path in the window.  What takes few steps there may fold up beyond it, or tell its slack
    late: on `level` with 1e-2 at s_o/l = 0.93, where 0.83 is right.  As long as one of half the resolution or half the
    steps is off by more than SAME_ONSET, steps are doubled, for no more work than went before, or little.

    made : all runs so far; receives those that are made.
    """
    end = until(scene)
    while end is not None and r.reached > end and (r.slack_onset is not None or r.status != "complete"):
        stop = min(1.0, (r.slack_onset or 1.0) + SAME_ONSET)
        halves = [refined(method, r.settings, **half) for half in ({"space": 0.5}, {"time": 0.5})]
        coarse = [run(scene, method, **kind | half | {"until": stop}) for half in halves]
        made += coarse
        onsets = [x.slack_onset for x in coarse]
        if r.slack_onset is not None and all(x and abs(x - r.slack_onset) <= SAME_ONSET for x in onsets):
            break
        finer = refined(method, r.settings, time=2.0)
        if 2.0 * work(method, r) > max(LITTLE, sum(work(method, x) for x in made)) or finer["steps"] > MOST_STEPS:
            break
        r = run(scene, method, **kind | finer)
        made.append(r)
    return r


def loud(scene: Scene, method: Method, settings: dict[str, Any]) -> dict[str, Any] | None:
    """Return the settings of a run that lets axial waves ring, None where those given damp none or resolve them.

    On `tramway` with Radau's 220 steps the least contact force is off by 475 N and the largest of the rope by 353 N,
    which half of these steps do not tell.  With AUDIBLE steps on a wave's way there and back this run is apart by 296
    and 182 N, with twice as many by 471 and 264 N; with rho_inf = 1 by 467 N and, of noise, 14 kN.
    """
    motion = scene.groups.motion
    if settings["scheme"] != SHARP["scheme"] or motion is None:
        return None
    steps = math.ceil(AUDIBLE * motion.phases[-1][1] * math.sqrt(scene.groups.alpha) / 2.0)
    return settings | QUIET | {"steps": min(steps, MOST_STEPS)} if steps > settings["steps"] else None


def work(method: Method, r: MassPath) -> float:
    """Return what a run has cost: Newton's iterations, each at all nodes of a step, times what the resolution makes."""
    nodes = max(1, len(scheme(r.settings["scheme"]).nodes))
    return r.work["newton_iterations"] * nodes * method.resolution.cost(method.value(r.settings))


def _companion(
    scene: Scene, method: Method, how: dict[str, Any], settings: dict[str, Any], told: Progress
) -> Response:  # fmt: skip
    return run(scene, method, **how, **settings)


def _order_in_time(e: Estimated, made: list[MassPath]) -> float | None:
    """Return the order in time that half the steps and fewer show together, None where no run has a quarter or less.

    What a coarser mesh adds to the distance of the run with fewer makes it seem higher, never lower.
    """
    steps = e.run.settings["steps"]
    fewer = [r for r in made if 3.0 * r.settings["steps"] <= steps and r.reached >= e.in_time.reached]
    if not fewer:
        return None
    r = max(fewer, key=lambda r: r.settings["steps"])
    ratio = steps / r.settings["steps"]
    try:
        window = measures.window_of(r, *e.runs)
        less, half = (measures.path_gap(e.run, x, window)[1] for x in (r, e.in_time))
    except measures.NotComparable:
        return None
    if not half > 0.0:
        return None

    def over(p: float) -> float:
        return (ratio**p - 1.0) / (2.0**p - 1.0) - less / half

    return 0.0 if over(LOWEST) > 0.0 else HIGHEST if over(HIGHEST) < 0.0 else bisected(over, LOWEST, HIGHEST)


def _light(scene: Scene, tol: float) -> bool:
    return scene.mu <= (LIGHT if tol <= FINE else 0.3 * LIGHT)


def _rule(scene: Scene, method: Method, named: dict[str, Any], tol: float) -> dict[str, Any]:
    """Return the settings that are named, with a rule that damps where none is and scene and method bring none."""
    if scene.drive.mode == "free" and not method.follows:
        return SWINGING | named
    damps = scene.drive.mode == "free" or method.knobs["scheme"].default != "trapezoidal"
    if damps or "scheme" in named:
        return named
    sharp = method.follows and (_light(scene, tol) or tol <= FINEST)
    return (SHARP if sharp else QUIET) | (FRONT if _sends(scene, method, tol) else {}) | named


def _sends(scene: Scene, method: Method, tol: float) -> bool:
    """Return whether nodes travel with a front: that of a light car which enters, and is fast."""
    motion = scene.groups.motion
    light = method.follows and _light(scene, tol) and scene.drive.mode == "grip"
    return light and motion is not None and motion.at(0.0, 0)[1] > ONCE


def _doubtful(r: MassPath, coarser: MassPath | None) -> bool:
    """Return whether slack cuts the window where one of half the resolution has not: coarse bases fake slack."""
    stop = measures.WINDOWS[r.drive][1]
    if r.drive == "free" or r.slack_onset is None or r.slack_onset > stop - SAME_ONSET:
        return False
    return coarser is None or coarser.slack_onset is None or abs(coarser.slack_onset - r.slack_onset) > SAME_ONSET


def _begin(scene: Scene, method: Method, tol: float) -> dict[str, int]:
    """Return the resolution and the steps to begin with: for a light car an unknown and a step per width of its front.

    Coarser ones would only show that they do not see it.  A ride begins with half its default steps: where brakes
    set in and friction turns round, half of too few err by as much as they do.
    """
    space, motion, groups = method.resolution, scene.groups.motion, scene.groups
    if motion is None:
        return {space.setting: space.first, "steps": method.settings_on(groups, {})["steps"] // 2}
    if not _light(scene, tol):
        return {space.setting: space.first, "steps": FIRST_STEPS}
    if _sends(scene, method, tol):
        return {space.setting: AT_FRONT[0], "steps": AT_FRONT[1]}
    fine = min(space.with_unknowns(2.0 / scene.mu), space.most // 2)  # both sides of the mass
    return {
        space.setting: max(space.first, fine),
        "steps": max(FIRST_STEPS, math.ceil(motion.phases[-1][1] / scene.mu)),
    }


def _part(
    fine: MassPath, coarse: MassPath, ratio: float, order: float, before: _Part | None = None,
    since: float | None = None,
) -> _Part:  # fmt: skip
    """Return what a refinement by `ratio` leaves of the error of the path, infinite if it cannot be read.

    since : how much finer the run is than the one that `before` was read for, if that is not `ratio`.
    """
    read = fine, coarse, ratio, order
    try:
        gap = measures.path_gap(coarse, fine, window_of(fine, coarse))[0]
    except measures.NotComparable:
        return _Part(math.inf, UNCONFIRMED, read)
    left, finer, safety = richardson.left(order, ratio) * gap, since or ratio, UNCONFIRMED
    if before is not None and before.left < math.inf:
        if left <= NEARLY * before.left / finer**order:
            safety = CONFIRMED
        elif finer > 1.0 and left > before.left / finer**richardson.LEAST_ORDER:
            safety = max(UNCONFIRMED, richardson.no_order(ratio) / richardson.left(order, ratio))
    return _Part(left, safety, read)


def _next(
    method: Method, rung: _Rung, settings: dict[str, Any], tol: float, stuck: bool = False, halves: bool = False
) -> dict[str, Any]:  # fmt: skip
    """Return the settings that are predicted to meet AIM * tol at the least cost, as far as they go in one stride.

    With parts s and t, a times the resolution and b times the steps leave s/a^p + t/b^r.

    stuck : the last refinement of space did not lower its part.
    halves : the run with half the steps is wanted too, so that doubling costs less than a shorter stride.
    """
    space, count, steps = method.resolution, method.value(settings), settings["steps"]
    p, r, s, t = space_order(method.space_order), time_order(settings), rung.space.path, rung.time.path

    def at(a: float, b: float) -> dict[str, int]:
        return {space.setting: space.finer(count, a), "steps": min(math.ceil(steps * b), MOST_STEPS)}

    if stuck or not t <= max(UNRESOLVED, tol):
        return settings | at(1.0, FURTHEST)
    if not math.isfinite(s):
        return settings | at(FURTHEST, 1.0)
    # the cheapest way there, however far, and of it one stride
    a, b = FURTHEST, FURTHEST
    meets = STRIDES[:, None] ** -p * s + STRIDES**-r * t <= AIM * tol
    if meets.any():
        costs = np.array([space.cost(count, x) for x in STRIDES.tolist()])[:, None] * STRIDES
        i, k = np.unravel_index(np.where(meets, costs, math.inf).argmin(), meets.shape)
        a, b = float(STRIDES[i]), float(STRIDES[k])
    # what is a stride further from its end than the other goes alone
    a, b = (a if b <= FURTHEST * a else 1.0), (b if a <= FURTHEST * b else 1.0)
    return settings | at(min(a, FURTHEST), FURTHEST if halves and b > 1.0 else min(b, FURTHEST))
