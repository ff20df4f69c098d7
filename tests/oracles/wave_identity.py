"""The wave equation with a moving source, tested exactly: no difference quotients, valid across fronts and kinks.

Integrating v_tt - v_xx = P delta(x - xi) over a parallelogram of characteristics gives
    v(top) + v(bottom) - v(right) - v(left) = 1/2 int P dt over the times at which the source is inside.
"""

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
    for i, (x, t, a, b) in enumerate(zip(x0, t0, p, q, strict=True)):
        end = min(t_source, t + a + b)
        if end <= t:
            continue
        edges = [t, *sorted(u for u in turns if t < u < end), end]
        cuts = list(edges)
        for sign, levels in ((-1.0, (t - x, t - x + 2.0 * b)), (1.0, (t + x, t + x + 2.0 * a))):
            for lo, hi in pairwise(edges):
                for level in levels:
                    f = [u + sign * float(xi(u)) - level for u in (lo, hi)]
                    if f[0] * f[1] < 0.0:
                        cuts.append(brentq(lambda u, s=sign, c=level: u + s * float(xi(u)) - c, lo, hi, xtol=1e-15))
        cuts.sort()
        for lo, hi in pairwise(cuts):
            mid = 0.5 * (lo + hi)
            if t - x < mid - xi(mid) < t - x + 2.0 * b and t + x < mid + xi(mid) < t + x + 2.0 * a:
                right[i] += 0.5 * (impulse(hi) - impulse(lo))
        for when, strength in blows:
            if t - x < when - xi(when) < t - x + 2.0 * b and t + x < when + xi(when) < t + x + 2.0 * a:
                right[i] += 0.5 * strength
    return left - right
