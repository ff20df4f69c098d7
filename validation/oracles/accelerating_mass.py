"""A mass that accelerates from rest through the wave speed of a taut string.

    v_tt - v_xx = R delta(x - xi),  mu y'' = mu sigma - R,  y = v(xi, t),  xi = a t^2/2,  at rest at t = 0:
    t < 1/a: y = (sigma mu/2) [ t - (mu/2)(1 - e^(-2t/mu)) ];   then y(t) = y(2/a - t), then 0.

At t = 1/a R has a blow 2 mu y'.

Source: Rodeman, Longcope & Shampine 1976
Validity: infinite string, t >= 0
Accuracy: rounding
Group: A mass on a taut string
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from validation.oracles.accelerating_force import A, faster, slower
from validation.oracles.case import MU, SIGMA, Array, Crossing, refuse_unless


def mass_displacement(t: ArrayLike, *, mu: float, sigma: float, a: float) -> Array:
    """y(t) of the mass; its shape is that of t."""
    t = np.asarray(t, float)
    refuse_unless("mu, sigma, a > 0 and t >= 0", mu > 0.0, sigma > 0.0, a > 0.0, t >= 0.0)
    mirrored = np.maximum(2.0 / a - t, 0.0)
    u = np.where(a * t <= 1.0, t, mirrored)
    return 0.5 * sigma * mu * (u + 0.5 * mu * np.expm1(-2.0 * u / mu))


def cases() -> Iterator[Crossing]:
    """Comparisons with the solvers, wrong ones among them."""

    def exact(t: Array) -> Array:
        return mass_displacement(t, mu=MU, sigma=SIGMA, a=A)

    blow = "none to speak of: the blow at the wave speed sends off two jumps of the string itself"
    yield slower(exact=exact)
    yield faster(exact=exact, because=blow, max_order=1.0, expected="disagree")
