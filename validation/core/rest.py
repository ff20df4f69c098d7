"""A car at rest on a cable, in SI: the elastic catenary of two pieces, for the laws.

n is the force in the cable, N its size, T(s) the tension of the empty cable at s:

    r' = [1 + (N - T)/EA] n/N,    n = left - (0, w s), and `jump` more ahead of the car,    int r' ds = (span, drop).

Of all `left` the solution has the least int (1 - T/EA) N + N^2/(2 EA) ds - left . (span, drop), which is convex.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.optimize import minimize

from cablefem.response import Array

POINTS = 200  # of Gauss on each side of the car
TURNS = 200  # of the rope that holds a car


@cache
def place(
    supports: tuple[float, float], EA: float, w: float, length: float, H: float, s_o: float, weight: float,
    friction: float | None,
) -> Array:  # fmt: skip
    """Place (2,) of a car at s_o; nan if it is not found.

    w : weight of the cable per length.  H : horizontal tension of the empty cable.
    friction : of a car on its rope over its contact force; None: the car is clamped to the cable.
    """
    x, weights = np.polynomial.legendre.leggauss(POINTS)
    half = 0.5 * np.array([s_o, length - s_o])
    s = np.concatenate([half[0] * (1.0 + x), s_o + half[1] * (1.0 + x)])
    ds = np.concatenate([half[0] * weights, half[1] * weights])
    behind = np.arange(2 * POINTS) < POINTS
    reach = 0.5 * supports[0] * w / H
    risen = math.sinh(math.asinh(0.5 * supports[1] * w / H / math.sinh(reach)) + reach)  # V/H at the left support

    def slope(n: Array, s: Array) -> tuple[Array, Array, Array]:
        """r' (k, 2), N (k,) and 1 - T/EA (k,)."""
        N = np.hypot(n[:, 0], n[:, 1])
        q = 1.0 - np.hypot(H, H * risen - w * s) / EA
        return (q / N + 1.0 / EA)[:, None] * n, N, q

    def hung(left: Array, jump: Array) -> Array:
        """The force at the left support under a force on the car."""

        def force(x: Array) -> Array:
            n = H * x - w * np.outer(s, [0.0, 1.0])
            n[~behind] += jump
            return n

        def energy(x: Array) -> float:
            _, N, q = slope(force(x), s)
            return float(ds @ (q * N + 0.5 * N**2 / EA) / H - x @ supports)

        def gap(x: Array) -> Array:
            return np.asarray(ds @ slope(force(x), s)[0] - supports)

        def bends(x: Array) -> Array:
            n = force(x)
            _, N, q = slope(n, s)
            across = np.stack([-n[:, 1], n[:, 0]], axis=1) / N[:, None]
            return H * ((across.T * (ds * q / N)) @ across + np.eye(2) * ds.sum() / EA)

        found = minimize(energy, left / H, jac=gap, hess=bends, method="trust-exact", options={"gtol": 1e-6 * length})
        x = found.x
        for _ in range(5):  # to rounding
            x = x - np.linalg.solve(bends(x), gap(x))
        return H * x if np.abs(gap(x)).max() < 1e-10 * length else np.full(2, math.nan)

    def sides(left: Array, jump: Array) -> Array:
        n = left - [0.0, w * s_o]
        return slope(np.array([n, n + jump]), np.array([s_o, s_o]))[0]

    jump = np.array([0.0, -weight])
    left = hung(np.array([H, H * risen + weight * (1.0 - s_o / length)]), jump)
    for _ in range(0 if friction is None else TURNS):
        both = sides(left, jump)
        mean = both.sum(axis=0)
        size = math.hypot(*mean)
        tau = mean / size
        stretch = float(np.hypot(both[:, 0], both[:, 1]).sum())
        pull = (friction or 0.0) * weight * abs(tau[0]) * size / stretch - weight * tau[1]
        before = jump
        jump = np.array([0.0, -weight]) - pull * tau
        left = hung(left, jump)
        if not np.abs(jump - before).max() > 1e-12 * weight:
            break
    n = left - w * np.outer(s[behind], [0.0, 1.0])
    return np.asarray(ds[behind] @ slope(n, s[behind])[0])
