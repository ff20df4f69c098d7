"""A harmonic force at constant speed on an infinite string, steady.

    v_tt - v_xx = P e^(i omega t) delta(x - V t):

    V < 1 :  v = (P/(2 i omega)) e^(i omega tau),  tau = (t-x)/(1-V) ahead, (t+x)/(1+V) behind
    V > 1 :  v = (P/(2 i omega)) [ e^(i omega (x+t)/(V+1)) - e^(i omega (x-t)/(V-1)) ] behind, 0 ahead

Source: Pierucci (reference 12 of Al-Qassab, Nair & O'Leary 2003)
Validity: infinite string, omega > 0, V >= 0, V != 1
Accuracy: rounding of the phase, 1e-16 omega (|x|+t)/|1-V|
Group: Loads and cables that the solvers do not have
Unreached: the solvers' load is a weight, which does not oscillate
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from validation.oracles.case import positive


def displacement(x: ArrayLike, t: ArrayLike, *, P: float, V: float, omega: float) -> NDArray[np.complex128]:
    """Complex v(x, t)."""
    if not (math.isfinite(V) and V >= 0.0) or V == 1.0:
        raise ValueError(f"speed must be >= 0 and not the wave speed 1, got {V!r}")
    positive(omega=omega)
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    behind = np.exp(1j * omega * (t + x) / (1.0 + V))
    if V < 1.0:
        v = np.where(x > V * t, np.exp(1j * omega * (t - x) / (1.0 - V)), behind)
    else:
        v = np.where(x < V * t, behind - np.exp(1j * omega * (x - t) / (V - 1.0)), 0.0)
    return P / (2j * omega) * v
