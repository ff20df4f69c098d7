"""The wave equation with a moving source, tested exactly: no difference quotients, valid across fronts and kinks.

Integrating v_tt - v_xx = P delta(x - xi) over a parallelogram of characteristics gives
    v(top) + v(bottom) - v(right) - v(left) = 1/2 int P dt over the times at which the source is inside.
"""

import itertools
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq


def random_parallelograms(rng, n, *, x, t, size, clip):
    """Random parallelograms (x0, t0, p, q): from the bottom corner p up to the right and q up to the left.

    clip : keep all corners inside the x range (a string with supports).
    """
    x0, t0 = rng.uniform(*x, n), rng.uniform(*t, n)
    p, q = rng.uniform(0.0, size, n), rng.uniform(0.0, size, n)
    if clip:
        p, q = np.minimum(p, x[1] - x0), np.minimum(q, x0 - x[0])
    return x0, t0, p, q


def wave_defect(v, impulse, xi, quads, t_source, turns=(), blows=()):
    """Left minus right side of the identity.

    impulse : int_0^t P, without the blows (time, strength);  t_source : the source has left by then;
    turns : times at which xi' passes +1 or -1, so that t -+ xi are monotone in between.
    """
    x0, t0, p, q = quads
    left = v(x0 + p - q, t0 + p + q) + v(x0, t0) - v(x0 + p, t0 + p) - v(x0 - q, t0 + q)
    right = np.zeros(len(x0), dtype=np.asarray(left).dtype)
    for i, quad in enumerate(zip(x0, t0, p, q, strict=True)):
        _, t, a, b = quad
        end = min(t_source, t + a + b)
        if end <= t:
            continue
        edges = [t, *sorted(u for u in turns if t < u < end), end]
        for lo, hi in pairwise(_times_of_crossings(xi, quad, edges)):
            if _is_inside(xi, quad, 0.5 * (lo + hi)):
                right[i] += 0.5 * (impulse(hi) - impulse(lo))
        right[i] += sum(0.5 * strength for when, strength in blows if _is_inside(xi, quad, when))
    return left - right


def _is_inside(xi, quad, t):
    """Whether the source is in the parallelogram at time t."""
    x0, t0, p, q = quad
    return t0 - x0 < t - xi(t) < t0 - x0 + 2.0 * q and t0 + x0 < t + xi(t) < t0 + x0 + 2.0 * p


def _times_of_crossings(xi, quad, edges):
    """The edges, and times between them at which the source crosses a side of the parallelogram, in order."""
    x0, t0, p, q = quad
    sides = [(-1.0, t0 - x0), (-1.0, t0 - x0 + 2.0 * q), (1.0, t0 + x0), (1.0, t0 + x0 + 2.0 * p)]  # t + sign x = level
    times = list(edges)
    for (sign, level), (lo, hi) in itertools.product(sides, pairwise(edges)):

        def distance(t, sign=sign, level=level):
            return t + sign * float(xi(t)) - level

        if distance(lo) * distance(hi) < 0.0:
            times.append(brentq(distance, lo, hi, xtol=1e-15))
    return sorted(times)
