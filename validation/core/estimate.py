"""Error bars from a run's own coarser companions: half the resolution, half the steps, and a quarter of either.

What the bar means: the true mass path is expected to lie within `path_error` times the largest deflection of the
computed one, over the window, and the tension field within `tension_error` times H (rms off the jump).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cablefem.newmark import scheme
from cablefem.response import MassPath, Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.flags import flagged, without
from validation.core.methods import Method, find, refined
from validation.core.richardson import LEAST_ORDER, NO_ORDER, NONSENSE, SAFETY, left, space_order, time_order, weight
from validation.core.running import run, whole

# Companions that fall slack this much later in s_o/l than the run show that its own slack is not resolved.
SAME_ONSET = 0.05
SAME_END = 0.9  # of the time of a free ride that a coarser companion's must last

# Steps on an axial wave's way there and back below which halving them does not show what axial waves still ring.
RESOLVED = 20.0

# Below this, of the scale of the path, runs of one method agree by rounding alike: a rider held fast for a whole ride
# was off by 2e-13, and no refinement told more than 1e-14.
ROUNDING = 1e-12

# of the gap to half the resolution: what a next order p + 1/2 leaves of it after an extrapolation of first order
EXTRAPOLATED = 0.5 * left(1.5)

KIND = ("model", "load", "law", "until")  # what a run is told besides the method's own settings


@dataclass(frozen=True, slots=True)
class Estimated:
    """A run with its error bars and the companions they come from."""

    response: Response  # what is compared: the run, or its extrapolation where the ladder is regular
    run: Response  # the finest run itself
    in_space: Response  # half the resolution
    in_time: Response  # half the steps
    weights: tuple[float, float]  # what is left of the gaps to the companions in the finest run
    basis: str  # one sentence: where the bar comes from
    extrapolated: bool = False
    late: Response | None = None  # half of both, to where a slack cable is still compared
    loud: Response | None = None  # by a rule and with steps that let axial waves ring, where the run's damp them
    of_path: tuple[float, float] = (1.0, 1.0)  # how much more the path's own ladder says, in space and time
    order: float | None = None  # in time, as a ladder has shown it
    rung: Any = None  # where its ladder ended, to go on from
    rings: bool = False  # steps miss axial waves, so that what rings with them is of first order in time

    def bar(self, gap: Callable[[Response, Response], float]) -> float:
        """Return the error bar of a quantity from its gaps to the companions."""
        return self.weights[0] * gap(self.run, self.in_space) + self.weights[1] * gap(self.run, self.in_time)

    @property
    def path_weights(self) -> tuple[float, float]:
        """What is left of the gaps to the companions in the path of the finest run."""
        return self.of_path[0] * self.weights[0], self.of_path[1] * self.weights[1]

    @property
    def own(self) -> float:
        """How much more of the gap in space is left in the finest run than in what is compared."""
        return left(1.0) / EXTRAPOLATED if self.extrapolated else 1.0

    @property
    def tension_weights(self) -> tuple[float, float]:
        """What is left of the gaps to the companions in what rings with axial waves."""
        return self.weights[0], max(self.weights[1], SAFETY if self.rings else 0.0)

    @property
    def field_weights(self) -> tuple[float, float]:
        """The same in the tension field, into which letting go and braking send axial waves that never end.

        Of 129 hostile rides, 90 of which miss such waves, 101 bars hold so, and 79 did.
        """
        missed = NO_ORDER if self.rings and self.run.drive == "free" else 0.0
        in_space, in_time = self.tension_weights
        return max(in_space, missed), max(in_time, missed)

    @property
    def runs(self) -> tuple[Response, ...]:
        return self.run, self.in_space, self.in_time


def window_of(fine: MassPath, coarse: MassPath) -> measures.Window:
    """Return the whole window of the finer run, over which a coarser companion is held against it.

    The companion's slack does not cut the window: where it is too coarse to be right, the gap must say so.
    """
    window = measures.window_of(fine)
    _must_last(coarse, fine)
    if fine.drive != "free" and coarse.reached < window[1] * (1.0 - 1e-6):
        raise measures.NotComparable(f"the coarser companion ends at s_o/l = {coarse.reached:.3f}")
    if fine.slack_onset is not None and window[1] < measures.WINDOWS[fine.drive][1] - SAME_ONSET:
        later = math.inf if coarse.slack_onset is None else coarse.slack_onset
        if later > fine.slack_onset + SAME_ONSET:
            raise measures.NotComparable(f"slack at s_o/l = {fine.slack_onset:.3f}, in the coarser companion not yet")
    return window


def until(scene: Scene) -> float | None:
    """Return the s_o/l beyond which companions need not go; None where a ride is compared to its end."""
    return None if scene.drive.mode == "free" else measures.WINDOWS[scene.drive.mode][1]


def estimated(
    scene: Scene, method: str | Method, *, progress: Callable[[float], None] | None = None,
    known: Sequence[MassPath] = (), **kind: Any,
) -> Estimated:  # fmt: skip
    """Run a method with its companions; `kind` holds model, load, law, until and settings as in `run`.

    Companions go no further than the window of comparison.

    known : runs of the same kind that need not be made again; of several with the same settings the last counts.
    """
    method = find(method) if isinstance(method, str) else method
    report = progress or (lambda done: None)
    e = companions(scene, method, progress=lambda done: report(0.8 * done), known=known, **kind)
    short = {k: kind[k] for k in KIND if k in kind} | {"until": until(scene)}
    fall = []
    for i, (half, share) in enumerate(((e.in_space, {"space": 0.25}), (e.in_time, {"time": 0.25}))):
        report(0.8 + 0.1 * i)
        quarter = refined(method, e.run.settings, **share)
        worth = quarter not in (half.settings, e.run.settings) and e.run.path_error is not None
        fall.append(_fall(e, half, _ran(scene, method, quarter, short, known)) if worth else None)
    report(1.0)
    return confirmed(e, method, (fall[0], fall[1]))


def _ran(
    scene: Scene, method: Method, settings: dict[str, Any], how: dict[str, Any], known: Sequence[MassPath],
    progress: Callable[[float], None] | None = None,
) -> Response:  # fmt: skip
    there = [r for r in known if r.settings == settings]
    return whole(there[-1]) if there else run(scene, method, **how, **settings, progress=progress)


def _fall(e: Estimated, half: Response, quarter: Response) -> float | None:
    """Return how the path's rms gap falls from a quarter to half on to the run; None if no quarter has the window."""
    try:
        window = measures.window_of(*e.runs)
        if measures.window_of(quarter, *e.runs)[1] < window[1] - SHORT:
            return None
        _must_last(quarter, half)
        before, gap = (measures.path_gap(*pair, window)[1] for pair in ((quarter, half), (half, e.run)))
        return before / gap if gap > 0.0 else None
    except measures.NotComparable:
        return None


def _must_last(coarse: MassPath, fine: MassPath) -> None:
    """Raise NotComparable if the free ride of a coarser companion is too short to be compared."""
    if fine.drive == "free" and coarse.t[-1] < SAME_END * fine.t[-1]:
        raise measures.NotComparable(f"the coarser companion's ride ends after {coarse.t[-1]:.4g} s")


def companions(
    scene: Scene, method: Method, *, progress: Callable[[float], None] | None = None,
    known: Sequence[MassPath] = (), **kind: Any,
) -> Estimated:  # fmt: skip
    """Run a method with half the resolution and half the steps besides; nothing confirms the orders.

    Where the run goes slack past the window they go on as far, so that its onset has a bar.
    """
    how = {k: kind[k] for k in KIND if k in kind}
    settings = method.settings_on(scene.groups, {k: v for k, v in kind.items() if k not in KIND})
    short = how | {"until": until(scene)}
    half_space, half_time = refined(method, settings, space=0.5), refined(method, settings, time=0.5)

    def part(low: float, high: float) -> Callable[[float], None] | None:
        return None if progress is None else lambda x: progress(low + (high - low) * x)

    fine = _ran(scene, method, settings, how, known, part(0.0, 0.6))
    if short["until"] is not None and fine.slack_onset is not None:
        short["until"] = max(short["until"], min(1.0, fine.slack_onset + SAME_ONSET))
    if method.extrapolate:  # an extrapolation wants the coarser run all the way
        c_space = run(scene, method, **how, **half_space, progress=part(0.6, 0.8))
    else:
        c_space = _ran(scene, method, half_space, short, known, part(0.6, 0.8))
    c_time = _ran(scene, method, half_time, short, known, part(0.8, 1.0))
    p_time = time_order(settings)
    p = space_order(method.space_order)
    extrapolate = method.extrapolate and min(fine.t.size, c_space.t.size) > 1  # not a run that found no start
    if extrapolate:
        response = measures.extrapolated(fine, c_space, 1.0)
        w_space = SAFETY * EXTRAPOLATED
        basis = f"extrapolated 2 f({method.value(settings)}) - f({method.value(half_space)})"
    else:
        response, w_space = fine, SAFETY * left(p)
        basis = (
            f"gap to half the {method.resolution.setting} over 2^{p:g} - 1, gap to half the steps over "
            f"2^{p_time:g} - 1, times {SAFETY}"
        )
    weights = w_space, SAFETY * left(p_time)
    estimate = Estimated(response, fine, c_space, c_time, weights, basis, extrapolate)
    return _with_bars(replace(estimate, rings=rings(scene, fine)))


def rings(scene: Scene, r: MassPath) -> bool:
    """Return whether the steps of a run miss axial waves, so that tensions are of first order in time.

    On most of the way: where a brake rings a ride takes shorter ones, and may take most of its steps there.
    """
    steps = np.diff(r.t)
    period = 2.0 * scene.length / scene.axial_speed
    return bool(steps[steps < period / RESOLVED].sum() < 0.5 * steps.sum())


def confirmed(e: Estimated, method: Method, fall: tuple[float | None, float | None]) -> Estimated:
    """Return the same runs with the path's bar by the orders that the falls of its gaps in space and time show."""
    if e.run.path_error is None:
        return e
    window = tuple(e.run.error_window or ())
    gaps = [measures.path_gap(c, e.run, (window[0], window[1]))[0] for c in (e.in_space, e.in_time)]
    orders = space_order(method.space_order), time_order(e.run.settings)
    most = NONSENSE * 2.0 ** scheme(e.run.settings["scheme"]).order
    in_space, in_time = weight(orders[0], fall[0]), weight(orders[1], fall[1], most)
    if in_space * gaps[0] + in_time * gaps[1] > COARSE:
        in_space = in_time = NO_ORDER
        e = replace(e, weights=(NO_ORDER / e.own, NO_ORDER))
    e = _with_bars(replace(e, of_path=(in_space / (e.own * e.weights[0]), in_time / e.weights[1])))
    basis = f"{e.basis}; as a quarter shows, of the path {in_space / e.own:.2g} and {in_time:.2g} times the gaps"
    e = replace(e, basis=basis, order=math.log2(fall[1]) if fall[1] else None)
    parts = in_space * gaps[0], in_time * gaps[1]
    for what, part, x in zip((method.resolution.setting, "steps"), parts, fall, strict=True):
        if x is not None and x < 2.0**LEAST_ORDER and part > 0.5 * sum(parts):
            e = _flagged(e, "no order", what=what, fall=x)
    return e


SLACK_END = 0.95  # s_o/l to which an answer is compared once the cable is slack


def past_slack(scene: Scene, method: Method, e: Estimated) -> Estimated:
    """Return the run with a companion of half the resolution and half the steps where it goes slack before 0.95.

    The other companions end with the window of comparison: what bears on the slack cable is first order anyway.
    """
    if e.run.drive != "grip" or e.run.slack_onset is None or e.run.slack_onset >= SLACK_END:
        return e
    halved = refined(method, e.run.settings, space=0.5, time=0.5)
    return replace(e, late=run(scene, method, until=SLACK_END, **halved))


def weighted(e: Estimated, factor: float) -> Estimated:
    """Return the same runs with the path's bars times a factor: what a ladder says of the path says nothing else."""
    return _with_bars(replace(e, of_path=(factor * e.of_path[0], factor * e.of_path[1])))


OF_BARS = ("no bar", "short bar", "coarse", "no order")  # what bars say of themselves


def _bare(r: Response) -> Response:
    bare = without(r, OF_BARS)
    return replace(bare, path_error=None, tension_error=None, error_parts=None, error_window=None)


def _with_bars(e: Estimated) -> Estimated:
    e = replace(e, response=_bare(e.response), run=_bare(e.run))
    if e.in_space.settings == e.run.settings:
        return _flagged(e, "no bar", why="there is no coarser resolution to compare with")
    try:
        for companion in (e.in_space, e.in_time):
            _must_last(companion, e.run)
        window = measures.window_of(*e.runs)
        gaps = [measures.path_gap(c, e.run, window)[0] for c in (e.in_space, e.in_time)]
        tension = [measures.tension_gap(c, e.run, window) for c in (e.in_space, e.in_time)]
    except measures.NotComparable as error:
        return _flagged(e, "no bar", why=str(error))

    def bars(own: float) -> dict[str, Any]:
        parts = {
            "path_space": own * e.path_weights[0] * gaps[0], "path_time": e.path_weights[1] * gaps[1],
            "tension_space": own * e.field_weights[0] * tension[0], "tension_time": e.field_weights[1] * tension[1],
        }  # fmt: skip
        return {
            "path_error": max(ROUNDING, parts["path_space"] + parts["path_time"]),
            "tension_error": parts["tension_space"] + parts["tension_time"],
            "error_parts": parts,
            "error_window": list(window),
        }

    e = replace(e, response=replace(e.response, **bars(1.0)), run=replace(e.run, **bars(e.own)))
    # a coarse companion that goes slack or ends early cuts the window: nobody must read the bar as one to 0.80
    if window[1] < measures.window_of(e.run)[1] - SHORT:
        e = _flagged(e, "short bar", stop=window[1])
    assert e.run.path_error is not None
    return e if e.run.path_error <= COARSE else _flagged(e, "coarse", bar=e.run.path_error)


# Of the largest deflection: companions then are half as much again apart, and show no order.
COARSE = 0.1
SHORT = 0.01  # s_o/l by which a window may be shorter than the run's own before that is said


def _flagged(e: Estimated, kind: str, **numbers: float | str) -> Estimated:
    return replace(e, response=flagged(e.response, kind, **numbers), run=flagged(e.run, kind, **numbers))
