"""Frequencies of a flat cable that cannot stretch.

    w_tt = w_ss + h,  int w ds = 0,  w(0) = w(1) = 0:   antisymmetric W = 2 n pi, symmetric tan(W/2) = W/2.

Source: Tadjbakhsh & Wang 1994
Validity: small sag, any inclination
Accuracy: 1e-14 relative
Group: Frequencies of the bare cable
"""

import math
from dataclasses import replace

import numpy as np

from validation.oracles import irvine
from validation.oracles.case import BARE, Array, Limit, Solvers


def frequencies(count: int) -> Array:
    return irvine.frequencies(math.inf, count)


def cases() -> list[Limit]:
    exact, setting = frequencies(4), {"P2 elements": "elements", "sines": "terms"}

    def deviation(solvers: Solvers, basis: str, alpha: float) -> float:
        omega = solvers.modes(basis, replace(BARE, alpha=alpha), "sagged", exact.size, **{setting[basis]: 120})
        return float(np.abs(omega / exact - 1.0).max())

    return [
        Limit(
            name="limit of a stiff cable, model sagged", refined="alpha", values=(1.6e5, 6.4e5, 2.56e6), falls=1.0,
            because="the stretching that is left is 1/L²", deviation=deviation, methods=tuple(setting),
        )
    ]  # fmt: skip
