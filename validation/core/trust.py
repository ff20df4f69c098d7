"""How far an answer can be trusted: settings that resolve start and exit, and where refinement stops helping.

Start: a light mass comes to terms with the cable within a time of about mu, during which a front of that width runs
ahead of it; uniform steps and elements that suit the crossing miss both.  Far support: the contact force grows like
1/distance, and past some place the path no longer converges.  After the slack onset the answer is worth what runs that
should agree leave between them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core.methods import Method, find

# First step and smallest element as parts of the start-up layer mu (time and width: the wave speed is 1).  With these
# the path of a mass of 0.01 on the level cable is right to 2e-4 of its largest deflection at s_o/l = 0.02 and 0.05.
STEPS_PER_LAYER, ELEMENTS_PER_LAYER = 20.0, 4.0
MOST_GRADING = 30.0  # more takes from the rest of the cable what the start does not need
LAST_STEP = 0.05  # of the distance that an equal step leaves in front of the far support


def recommended(scene: Scene, method: str | Method, **changes: Any) -> dict[str, Any]:
    """Return a method's settings with entry, exit and grading fit for the scene; `changes` (steps, elements) stay.

    entry : first step <= mu/20 of the time unit; exit : the last step is 1/20 of an equal one, unless the mass arrives
    at rest, where equal steps shorten the way by themselves; grading : smallest element <= mu/4.
    A heavy mass (mu of order one) gets equal steps and elements at entry.
    """
    method = find(method) if isinstance(method, str) else method
    settings = method.settings(changes)
    motion = scene.groups.motion
    if motion is None:
        raise ValueError(f"scene {scene.name!r} has no travelling mass")
    t_end = motion.phases[-1][1]
    if "entry" not in changes:
        dt = t_end / settings["steps"]
        settings["entry"] = min(1.0, max(1e-4, scene.mu / STEPS_PER_LAYER / dt))
    if "exit" not in changes:
        speed = motion.at(t_end, len(motion.phases) - 1)[1]
        settings["exit"] = LAST_STEP if speed * t_end > 0.1 else 1.0
    if "grading" in settings and "grading" not in changes:
        settings["grading"] = grading(method.value(settings), scene.mu / ELEMENTS_PER_LAYER)
    return settings


def grading(elements: int, smallest: float) -> float:
    """Return largest over smallest of `elements` geometric ones on a unit length whose smallest is `smallest`."""

    def excess(log_ratio: float) -> float:
        lengths = np.exp(np.linspace(0.0, log_ratio, elements))
        return float(lengths[0] / lengths.sum()) - smallest

    if elements < 2 or excess(0.0) <= 0.0:
        return 1.0
    most = math.log(MOST_GRADING)
    return MOST_GRADING if excess(most) >= 0.0 else math.exp(brentq(excess, 0.0, most))


def _path(r: Response, place: Array) -> Array:
    """Displacement of the mass (u, v) at places s_o/l, (n, 2); monotone cubic between steps, nan beyond the last."""
    s = r.s_o / r.length
    rising = np.concatenate([[True], np.diff(s) > 0.0])
    return np.asarray(PchipInterpolator(s[rising], np.stack([r.u, r.v], axis=1)[rising], extrapolate=False)(place))


def gap(a: Response, b: Response, place: Array) -> Array:
    """Return the distance of two mass paths at places s_o/l (n,), over the larger of their largest deflections."""
    difference = _path(a, place) - _path(b, place)
    return np.hypot(difference[:, 0], difference[:, 1]) / max(a.max_deflection, b.max_deflection)


def post_slack_spread(runs: Sequence[Response], stop: float = 0.95) -> float | None:
    """Return the largest gap of any two paths between the earliest slack onset and `stop`, over the largest deflection.

    runs : of different methods or resolutions that ought to give one answer.  None where no run goes slack before
    `stop` or fewer than two go on.  A run that ends before `stop` counts as far as it goes.
    """
    onsets = [r.slack_onset for r in runs if r.slack_onset is not None]
    if not onsets or not min(onsets) < stop:
        return None
    place = np.linspace(min(onsets), stop, 400)
    gaps = [gap(a, b, place) for a, b in combinations(runs, 2)]
    known = [float(np.nanmax(g)) for g in gaps if np.isfinite(g).any()]
    return max(known) if known else None


MEANINGFUL = 1e-2  # of the largest deflection: paths further apart are two answers


@dataclass(frozen=True, slots=True)
class Reach:
    """How far two answers are still one: where they part by more than `gap`, or the most that they differ by."""

    place: float | None  # s_o/l; None where they do not part
    gap: float  # of the largest deflection
    end: float  # s_o/l where the shorter one ends


def reach(a: Response, b: Response, start: float, allowed: float | None) -> Reach | None:
    """Return how far past `start` two answers are one: within 1 percent, or twice the gap that was allowed up to there.

    None where there is nothing past it.
    """
    end = min(a.reached, b.reached)
    place = np.arange(start + 0.005, end, 0.005)
    if not place.size:
        return None
    bound, apart = max(MEANINGFUL, 2.0 * (allowed or 0.0)), gap(a, b, place)
    far = place[apart > bound]
    return Reach(float(far[0]), bound, end) if far.size else Reach(None, float(np.nanmax(apart)), end)


# A gap that refinement by two leaves above this part of itself is not closing (first order leaves 1/2), unless it is
# below the floor; judged over stretches of s_o, because wave fronts make single places converge unevenly.
CLOSING, FLOOR, STRETCH = 0.8, 1e-3, 0.02


def convergence_limit(runs: Sequence[Response]) -> float:
    """Return the s_o/l up to which the path converges: beyond it, finer runs do not come closer to one another.

    runs : three or more of one method, each with about twice the resolution and the steps of the one before.  In
    stretches of 0.02 the rms gap of the two finest is held against that of the two before; the first stretch where it
    is neither below 0.8 of it nor below 1e-3 of the largest deflection ends the answer; at most the shortest run's end.
    """
    if len(runs) < 3:
        raise ValueError(f"three runs are needed to see a gap close, got {len(runs)}")
    coarse, middle, fine = runs[-3:]
    end = min(r.reached for r in (coarse, middle, fine))
    edges = np.append(np.arange(0.0, end, STRETCH), end)
    for low, high in pairwise(edges.tolist()):
        place = np.linspace(low, high, 41)[1:]
        before, after = (
            float(np.sqrt(np.nanmean(gap(a, b, place) ** 2))) for a, b in ((coarse, middle), (middle, fine))
        )
        if not after <= max(CLOSING * before, FLOOR):
            return float(low)
    return float(end)
