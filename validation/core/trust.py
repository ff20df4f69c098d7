"""How far an answer can be trusted: to where its path differs from that of finer runs."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from cablefem.response import Array, Response


def _path_at_positions(r: Response, at: Array) -> Array:
    """(u, v) of the mass at s_o/l (n,), (n, 2); nan beyond the last step."""
    position = r.s_o / r.length
    rising = np.diff(position, prepend=-math.inf) > 0.0
    path = np.stack([r.u, r.v], axis=1)
    return PchipInterpolator(position[rising], path[rising], extrapolate=False)(at)


def path_distances_over_deflection(a: Response, b: Response, positions: Array) -> Array:
    """Distances (n,) of two paths at s_o/l (n,), over the largest deflection; nan where one does not reach."""
    distance = np.linalg.norm(_path_at_positions(a, positions) - _path_at_positions(b, positions), axis=1)
    return distance / max(a.max_deflection, b.max_deflection)


def max_relative_path_gap_past_slack(a: Response, b: Response, stop: float) -> float:
    """Largest relative gap from slack onset to s_o/l = `stop`, which both reach; nan without slack before."""
    onset = min(a.slack_onset_position_or_inf, b.slack_onset_position_or_inf)
    if not onset < stop:
        return math.nan
    return float(np.nanmax(path_distances_over_deflection(a, b, np.linspace(onset, stop, 400))))


def _rms_of_known(x: Array) -> float:
    """Without values that are nan."""
    return float(np.sqrt(np.nanmean(x**2)))


def convergence_limit(runs: Sequence[Response]) -> float:
    """The s_o/l beyond which finer runs do not approach each other.

    A gap over a stretch of 0.02 closes if refinement brings it below 0.8 of it, or below 0.001.

    runs : three or more of one method, each about twice as fine in space and time.
    """
    if len(runs) < 3:
        raise ValueError(f"three runs are needed to see a gap close, got {len(runs)}")
    coarse, middle, fine = runs[-3:]
    end = min(r.reached for r in (coarse, middle, fine))
    edges = np.append(np.arange(0.0, end, 0.02), end)
    for low, high in pairwise(edges.tolist()):
        at = np.linspace(low, high, 41)[1:]
        before = _rms_of_known(path_distances_over_deflection(coarse, middle, at))
        after = _rms_of_known(path_distances_over_deflection(middle, fine, at))
        if not after <= max(0.8 * before, 1e-3):
            return float(low)
    return float(end)
