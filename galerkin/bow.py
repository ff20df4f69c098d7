"""How the two pieces of a loaded cable bend: bubbles that ride with the hat, their amplitudes those of a cable at rest.

Where the cable kinks, u'' jumps by its curvature times the kink, and sines alone lock u' against v'^2/2.  Bubbles that
are unknowns take that away, but they ring with the axial waves that a released car sends, and the car's balance turns
that into speed (1e-2 with 90 terms).  As functions of s_o they are part of the shape that displacements start from, and
ring with nothing: any amplitude is a basis; that of the cable at rest leaves the sines the least.

On a piece of length h, at the distance z from its support, the bubble is B (z/h) (1 - z/h).
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from cablefem.scene import Groups, statics
from galerkin.law import compiled

NONE = np.empty((17, 0))  # `table` of no bubbles


def bow(groups: Groups) -> CubicSpline:
    """Amplitudes B by s_o, of the pieces behind and ahead of the car, of u and v: (..., 2, 2).

    A bubble changes the slope by 2 B/h from end to end: half the change of w' times h.
    """
    s = statics.nodes()
    rest = statics.gripped(s, groups)
    right = rest.left + rest.jump - np.array([0.0, groups.sigma])
    here = np.stack(groups.static(s)[1:3], axis=1)
    B = np.empty((s.size, 2, 2))
    for i, (force, end, h, slope) in enumerate(
        ((rest.left, 0.0, s, rest.slope_behind), (right, 1.0, 1.0 - s, rest.slope_ahead))
    ):
        T, x, y = (float(z) for z in groups.static(end)[:3])
        N = np.linalg.norm(force, axis=1)[:, None]
        turned = force / N * (1.0 + (N - T) / groups.alpha) - np.array([x, y]) - (slope - here)
        B[:, i] = 0.5 * h[:, None] * (turned if i == 0 else -turned)
    return CubicSpline(s, B)


def table(spline: CubicSpline) -> np.ndarray:
    """Places, and of each amplitude the coefficients of s^3, s^2, s and 1 from there on: (17, n)."""
    rows = spline.c.reshape(4, -1, 4).transpose(2, 0, 1).reshape(16, -1)
    return np.concatenate([spline.x[None], np.pad(rows, ((0, 0), (0, 1)))])


@compiled
def bent(bows, s_o, ds_o, dds_o):
    """Of each piece: B/h, its rate, and what its acceleration has of z and z^2; (piece, 4, field).

    bows : `table`, or `NONE`
    """
    out = np.zeros((2, 4, 2))
    low, high = 0, bows.shape[1] - 1
    if high < 0:
        return out
    while high - low > 1:
        middle = (low + high) // 2
        if bows[0, middle] <= s_o:
            low = middle
        else:
            high = middle
    d = s_o - bows[0, low]
    for i in range(2):
        h, dh, ddh = (s_o, ds_o, dds_o) if i == 0 else (1.0 - s_o, -ds_o, -dds_o)
        for a in range(2):
            first = 1 + 4 * (2 * i + a)
            c3, c2, c1, c0 = bows[first, low], bows[first + 1, low], bows[first + 2, low], bows[first + 3, low]
            B, by_s = ((c3 * d + c2) * d + c1) * d + c0, (3.0 * c3 * d + 2.0 * c2) * d + c1
            dB, ddB = by_s * ds_o, by_s * dds_o + (6.0 * c3 * d + 2.0 * c2) * ds_o * ds_o
            out[i, 0, a], out[i, 1, a] = B / h, (dB - B * dh / h) / h
            out[i, 2, a] = (ddB - (2.0 * dh * dB + ddh * B) / h + 2.0 * dh * dh / h * B / h) / h
            out[i, 3, a] = -(ddB - (4.0 * dh * dB + 2.0 * ddh * B) / h + 6.0 * dh * dh / h * B / h) / (h * h)
    return out


@compiled
def slopes(s, s_o, behind, ahead):
    """Slope of the bubbles at s (m,): (2, m); behind, ahead : B/h of either piece, (2,)."""
    out = np.empty((2, s.size))
    for q in range(s.size):
        over = 1.0 - 2.0 * (s[q] / s_o if s[q] < s_o else (1.0 - s[q]) / (1.0 - s_o))
        for a in range(2):
            out[a, q] = over * (behind[a] if s[q] < s_o else -ahead[a])
    return out


@compiled
def add_bows(x, bows, R):
    """Add the inertia of the bubbles off the mass to R (2, n), over sines with a hat; x : `Carried`;  bows : `bent`."""
    last = x.f.size - 1
    s_o = 3.0 * x.behind[last]  # int_0^s_o hat^2 ds
    for i in range(2):
        h = s_o if i == 0 else 1.0 - s_o
        for k in range(last + 1):
            first = h * (x.behind[k] if i == 0 else x.mass[last, k] - x.behind[k])
            for a in range(2):
                R[a, k] += bows[i, 2, a] * first + bows[i, 3, a] * x.square[i, k]
