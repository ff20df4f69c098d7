"""How far an answer can be trusted: settings for start and exit, and where refinement stops helping.

A light mass sends a front of width mu ahead, which uniform steps and elements miss.  The contact force grows like
1/distance at the far support, and the path stops converging.
"""

import math
from collections.abc import Sequence
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core.methods import Method, find

# First step and smallest element, as parts of the start-up layer mu.
STEPS_PER_LAYER, ELEMENTS_PER_LAYER = 20.0, 4.0
MOST_GRADING = 30.0  # more coarsens the rest of the cable
LAST_STEP = 0.05  # of an equal one


def recommended(scene: Scene, method: str | Method, **changes: Any) -> dict[str, Any]:
    """Return settings with entry, exit and grading fit for the scene; `changes` stay.

    First step <= mu/20, smallest element <= mu/4, last step 1/20 of an equal one unless the mass arrives at rest.
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
    """Return largest over smallest of `elements` geometric lengths that sum to 1."""

    def excess(log_ratio: float) -> float:
        lengths = np.exp(np.linspace(0.0, log_ratio, elements))
        return float(lengths[0] / lengths.sum()) - smallest

    if elements < 2 or excess(0.0) <= 0.0:
        return 1.0
    most = math.log(MOST_GRADING)
    return MOST_GRADING if excess(most) >= 0.0 else math.exp(brentq(excess, 0.0, most))


def _path(r: Response, place: Array) -> Array:
    """(u, v) of the mass at places s_o/l, (n, 2); nan beyond the last step."""
    s = r.s_o / r.length
    rising = np.concatenate([[True], np.diff(s) > 0.0])
    return np.asarray(PchipInterpolator(s[rising], np.stack([r.u, r.v], axis=1)[rising], extrapolate=False)(place))


def gap(a: Response, b: Response, place: Array) -> Array:
    """Return the distance of two paths at s_o/l (n,), over the largest deflection."""
    difference = _path(a, place) - _path(b, place)
    return np.hypot(difference[:, 0], difference[:, 1]) / max(a.max_deflection, b.max_deflection)


def post_slack_spread(runs: Sequence[Response], stop: float = 0.95) -> float | None:
    """Return the largest gap of any two paths from slack onset to `stop`, over the largest deflection.

    None without slack or with one run past it.
    """
    onsets = [r.slack_onset for r in runs if r.slack_onset is not None]
    if not onsets or not min(onsets) < stop:
        return None
    place = np.linspace(min(onsets), stop, 400)
    gaps = [gap(a, b, place) for a, b in combinations(runs, 2)]
    known = [float(np.nanmax(g)) for g in gaps if np.isfinite(g).any()]
    return max(known) if known else None


# A gap closes if refinement by two leaves less than CLOSING of it (first order: 1/2), or than FLOOR. Stretches of s_o,
# because single places converge unevenly.
CLOSING, FLOOR, STRETCH = 0.8, 1e-3, 0.02


def convergence_limit(runs: Sequence[Response]) -> float:
    """Return the s_o/l beyond which finer runs do not approach each other.

    runs : three or more of one method, each about twice as fine in space and time.
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
