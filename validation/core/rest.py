"""A car at rest on a cable, in SI: the elastic catenary of two pieces, for the laws.

n is the force in the cable, N its size, T(s) the tension of the empty cable at s:

    r' = [1 + (N - T)/EA] n/N,    n = left - (0, w s), and `jump` more ahead of the car,    int r' ds = (span, drop).

Both forces are searched together.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.optimize import root

from cablefem.response import Array


@cache
def car_position_at_rest(
    supports: tuple[float, float], EA: float, w: float, length: float, H: float, s_o: float, weight: float,
    friction: float | None,
) -> Array:  # fmt: skip
    """Point (2,) of a car at s_o; nan if there is no solution.

    w : weight of the cable per length.  H : horizontal tension of the empty cable.
    friction : of a car on its rope over its contact force; None: the car is clamped to the cable.
    """
    points = 200  # of Gauss on each side of the car
    x, weights = np.polynomial.legendre.leggauss(points)
    half = 0.5 * np.array([s_o, length - s_o])
    s = np.concatenate([half[0] * (1.0 + x), s_o + half[1] * (1.0 + x)])
    ds = np.concatenate([half[0] * weights, half[1] * weights])
    reach = 0.5 * supports[0] * w / H
    risen = math.sinh(math.asinh(0.5 * supports[1] * w / H / math.sinh(reach)) + reach)  # V/H at the left support
    load = np.array([0.0, -weight])

    def slope(n: Array, s: Array) -> Array:
        """r' (k, 2)."""
        T = np.hypot(H, H * risen - w * s)
        N = np.hypot(n[:, 0], n[:, 1])
        return ((1.0 - T / EA) / N + 1.0 / EA)[:, None] * n

    def slopes_by_force(left: Array, jump: Array) -> Array:
        ahead = (s > s_o)[:, None]  # (k, 1)
        return slope(left - w * np.outer(s, [0.0, 1.0]) + jump * ahead, s)

    def jump_of_car(left: Array, jump: Array) -> Array:
        """The jump by weight, and by what holds a car on its rope."""
        if friction is None:
            return load
        n = left - [0.0, w * s_o]
        both = slope(np.array([n, n + jump]), np.array([s_o, s_o]))
        mean = both.sum(axis=0)
        size = math.hypot(*mean)
        tau = mean / size
        stretch = float(np.hypot(both[:, 0], both[:, 1]).sum())
        held = friction * weight * abs(tau[0]) * size / stretch - weight * tau[1]
        return np.asarray(load - held * tau)

    def end_and_balance_gaps(forces: Array) -> Array:
        left, jump = forces.reshape(2, 2) * [[H], [weight]]
        missing = ds @ slopes_by_force(left, jump) - supports
        return np.concatenate([missing / length, (jump - jump_of_car(left, jump)) / weight])

    guess = np.array([1.0, risen + weight / H * (1.0 - s_o / length), 0.0, -1.0])
    forces = root(end_and_balance_gaps, guess, tol=1e-14).x
    if not np.abs(end_and_balance_gaps(forces)).max() < 1e-10:
        return np.full(2, math.nan)
    left, jump = forces.reshape(2, 2) * [[H], [weight]]
    behind = s < s_o
    return np.asarray(ds[behind] @ slopes_by_force(left, jump)[behind])
