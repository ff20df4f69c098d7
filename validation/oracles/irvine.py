"""Frequencies of a flat elastic cable.

    w_tt = w_ss + h y'',  h = alpha int y' w_s ds,  y'' = -sigma,  w(0) = w(1) = 0:
antisymmetric W = 2 n pi, symmetric tan(W/2) = W/2 - (4/L^2)(W/2)^3, L^2 = alpha sigma^2 cos(theta)^5.
Unit sqrt(tau/rho)/l, tau the tension along a chord inclined by theta.

Source: Irvine & Caughey 1974, with the arc length in place of the span
Validity: small sag; 8e-4 off the exact catenary at sigma = 0.17, falling like sigma^2 at fixed L
Accuracy: 1e-14 relative
Group: Frequencies of the bare cable
"""

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from validation.oracles.case import BARE, Array, Modes, refuse_unless


def irvine_parameter(sigma: float, alpha: float, chord_cos: float = 1.0) -> float:
    """L^2."""
    refuse_unless("sigma, alpha > 0 and 0 < chord_cos <= 1", sigma > 0.0, alpha > 0.0, 0.0 < chord_cos <= 1.0)
    return alpha * sigma**2 * chord_cos**5


def symmetric_frequencies(L2: float, count: int) -> Array:
    """L2 = inf: a cable that cannot stretch."""
    refuse_unless("L^2 > 0, count >= 1", L2 > 0.0, count >= 1)

    def scaled_equation(z: float) -> float:  # scaled against overflow for L -> 0
        scale = 1.0 / (1.0 + 4.0 * z * z / L2)
        return scale * math.sin(z) - z * (scale - (1.0 - scale)) * math.cos(z)

    half = []
    for n in range(1, count + 1):
        low = (n - 0.5) * math.pi
        high = (n + 0.5) * math.pi
        half.append(brentq(scaled_equation, low, high, xtol=1e-15, rtol=1e-15))
    return 2.0 * np.array(half)


def lowest_frequencies(L2: float, count: int) -> Array:
    """Symmetric and antisymmetric ones."""
    antisymmetric = 2.0 * math.pi * np.arange(1, count + 1)
    both = np.append(symmetric_frequencies(L2, count), antisymmetric)
    return np.sort(both)[:count]


def cases() -> Iterator[Modes]:
    exact = lowest_frequencies(irvine_parameter(BARE.sigma, BARE.alpha), 4)
    yield Modes(name="first four, model sagged", groups=BARE, model="sagged", exact=exact)
