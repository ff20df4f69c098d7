"""Frequencies of a flat cable that cannot stretch.

    w_tt = w_ss + h,  int w ds = 0,  w(0) = w(1) = 0:   antisymmetric W = 2 n pi, symmetric tan(W/2) = W/2.

Unit sqrt(tau/rho)/l, tau the tension along the chord.

Source: Tadjbakhsh & Wang 1994
Validity: small sag, any inclination
Accuracy: 1e-14 relative
Group: Frequencies of the bare cable
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from validation.oracles.case import BARE, Error, Limit, Solvers


def symmetric(count: int) -> NDArray[np.float64]:
    """Roots of sin z = z cos z in (n pi, (n + 1/2) pi), times 2."""
    if count < 1:
        raise ValueError(f"count >= 1 needed, got {count!r}")
    half = [
        brentq(lambda z: math.sin(z) - z * math.cos(z), n * math.pi, (n + 0.5) * math.pi, xtol=1e-15, rtol=1e-15)
        for n in range(1, count + 1)
    ]
    return 2.0 * np.array(half)


def frequencies(count: int) -> NDArray[np.float64]:
    return np.sort(np.concatenate([symmetric(count), 2.0 * math.pi * np.arange(1, count + 1)]))[:count]


def cases() -> list[Limit]:
    exact = frequencies(4)

    def deviation(solvers: Solvers, basis: str, alpha: float) -> Error:
        omega = solvers.modes(basis, replace(BARE, alpha=alpha), "sagged", exact.size, size=120)
        worst = float(np.abs(omega / exact - 1.0).max())
        return worst, worst

    return [
        Limit(
            name="limit of a stiff cable, model sagged", parameter="alpha", values=(1.6e5, 6.4e5, 2.56e6), falls=1.0,
            because="the stretching that is left is 1/L²", deviation=deviation, methods=("P2 elements", "sines"),
        )
    ]  # fmt: skip
