"""How far an answer can be trusted: up to where its path and a finer one part."""

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from cablefem.response import Array, Response


def _path(r: Response, place: Array) -> Array:
    """(u, v) of the mass at places s_o/l, (n, 2); nan beyond the last step."""
    s = r.s_o / r.length
    rising = np.concatenate([[True], np.diff(s) > 0.0])
    return np.asarray(PchipInterpolator(s[rising], np.stack([r.u, r.v], axis=1)[rising], extrapolate=False)(place))


def gap(a: Response, b: Response, place: Array) -> Array:
    """The distance of two paths at s_o/l (n,), over the largest deflection."""
    difference = _path(a, place) - _path(b, place)
    return np.hypot(difference[:, 0], difference[:, 1]) / max(a.max_deflection, b.max_deflection)


def post_slack_spread(runs: Sequence[Response], stop: float = 0.95) -> float | None:
    """Largest gap of any two paths from slack onset to `stop`; None without slack or with one run past it."""
    onsets = [r.slack_onset for r in runs if r.slack_onset is not None]
    if not onsets or not min(onsets) < stop:
        return None
    place = np.linspace(min(onsets), stop, 400)
    gaps = [gap(a, b, place) for a, b in combinations(runs, 2)]
    known = [float(np.nanmax(g)) for g in gaps if np.isfinite(g).any()]
    return max(known) if known else None


# A gap over a STRETCH of s_o closes if refinement by two leaves less than CLOSING of it, or than FLOOR.
CLOSING, FLOOR, STRETCH = 0.8, 1e-3, 0.02


def convergence_limit(runs: Sequence[Response]) -> float:
    """The s_o/l beyond which finer runs do not approach each other.

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
