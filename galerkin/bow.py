"""How the two pieces of a loaded cable bend at rest: amplitudes of the bubbles that ride with the hat.

Where the cable kinks, u'' jumps by its curvature times the kink, and sines alone lock u' against v'^2/2.  Bubbles that
are unknowns of their own take that away, but they ring with the axial waves that a released car sends, and the car's
balance turns that into speed (1e-2 with 90 terms).  As functions of s_o alone they cost no step and ring with nothing:
any amplitude is a basis; that of the cable at rest leaves the sines the least.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from cablefem.scene import Groups, statics


def bow(groups: Groups) -> CubicSpline:
    """Amplitudes by s_o, of u behind and ahead of the car, then of v: (..., 4).

    x (1 - x) over a piece of length h changes the slope by 2/h from end to end: half the change of w' times h.
    """
    s = statics.nodes()
    rest = statics.gripped(s, groups)
    right = rest.left + rest.jump - np.array([0.0, groups.sigma])
    here = np.stack(groups.static(s)[1:3], axis=1)
    q = np.empty((s.size, 2, 2))
    for i, (force, end, h, slope) in enumerate(
        ((rest.left, 0.0, s, rest.slope_behind), (right, 1.0, 1.0 - s, rest.slope_ahead))
    ):
        T, x, y = (float(z) for z in groups.static(end)[:3])
        N = np.linalg.norm(force, axis=1)[:, None]
        turned = force / N * (1.0 + (N - T) / groups.alpha) - np.array([x, y]) - (slope - here)
        q[:, :, i] = 0.5 * h[:, None] * (turned if i == 0 else -turned)
    return CubicSpline(s, q.reshape(-1, 4))


def table(spline: CubicSpline) -> np.ndarray:
    """Places, and of each amplitude the coefficients of s^3, s^2, s and 1 from there on: (17, n)."""
    rows = spline.c.transpose(2, 0, 1).reshape(16, -1)
    return np.concatenate([spline.x[None], np.pad(rows, ((0, 0), (0, 1)))])
