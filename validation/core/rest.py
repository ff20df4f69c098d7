"""A car at rest on a cable, in SI: the elastic catenary of two pieces, for the laws.

n is the force in the cable, N its size, T(s) the tension of the empty cable at s:

    r' = [1 + (N - T)/EA] n/N,    n = left - (0, w s), and `jump` more ahead of the car,    int r' ds = (span, drop).

Both forces are searched together.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import root

from cablefem.response import Array, Response
from validation.core.scene_data import OneSpanData


class EmptyCable(NamedTuple):
    """A cable at rest without a car, in SI."""

    supports: tuple[float, float]  # span and drop [m]
    EA: float  # [N]
    weight: float  # per length [N/m]
    length: float  # [m]
    H: float  # horizontal tension [N]


def empty_cable(data: OneSpanData, r: Response) -> EmptyCable:
    """The cable of a run without its car."""
    return EmptyCable((data.span, data.drop), data.EA, data.rho * data.gravity, r.length, r.horizontal_tension)


@cache
def car_point_at_rest(cable: EmptyCable, s_o: float, car_weight: float, friction: float | None) -> Array:
    """Point (2,) [m] of a car at s_o [m]; nan if there is no solution.

    friction : of a car on its rope over its contact force; None: the car is clamped to the cable.
    """
    supports, EA, w, length, H = cable
    points = 200  # of Gauss on each side of the car
    x, weights = np.polynomial.legendre.leggauss(points)
    half = 0.5 * np.array([s_o, length - s_o])
    s = np.concatenate([half[0] * (1.0 + x), s_o + half[1] * (1.0 + x)])
    ds = np.concatenate([half[0] * weights, half[1] * weights])
    half_span = 0.5 * supports[0] * w / H
    middle = math.asinh(0.5 * supports[1] * w / H / math.sinh(half_span))
    risen = math.sinh(middle + half_span)  # V/H at the left support
    load = np.array([0.0, -car_weight])

    def slope(n: Array, s: Array) -> Array:
        """r' (k, 2)."""
        T = np.hypot(H, H * risen - w * s)
        N = np.hypot(n[:, 0], n[:, 1])
        return ((1.0 - T / EA) / N + 1.0 / EA)[:, None] * n

    def slopes_at_points(left: Array, jump: Array) -> Array:
        """r' (k, 2) at all Gauss points, from the force at the left support and the jump at the car."""
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
        resisting = friction * car_weight * abs(tau[0]) * size / stretch
        held = resisting - car_weight * tau[1]
        return load - held * tau

    def end_and_balance_gaps(forces: Array) -> Array:
        left, jump = forces.reshape(2, 2) * [[H], [car_weight]]
        missing = ds @ slopes_at_points(left, jump) - supports
        return np.concatenate([missing / length, (jump - jump_of_car(left, jump)) / car_weight])

    guess = np.array([1.0, risen + car_weight / H * (1.0 - s_o / length), 0.0, -1.0])
    forces = root(end_and_balance_gaps, guess, tol=1e-14).x
    if not np.abs(end_and_balance_gaps(forces)).max() < 1e-10:
        return np.full(2, math.nan)
    left, jump = forces.reshape(2, 2) * [[H], [car_weight]]
    behind = s < s_o
    return ds[behind] @ slopes_at_points(left, jump)[behind]
