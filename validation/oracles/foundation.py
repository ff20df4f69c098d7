"""A force at constant speed on a string on an elastic foundation, steady.

    v_tt - v_xx + k v = P delta(x - V t),  z = x - V t:

    V < 1 :  v = P e^(-|z| sqrt(k/(1-V^2))) / (2 sqrt(k (1-V^2)))
    V > 1 :  v = P sin(|z| sqrt(k/(V^2-1))) / sqrt(k (V^2-1)) behind, 0 ahead

Source: Yen & Tang 1970, the linear part
Validity: infinite string, k > 0, V >= 0, V != 1
Accuracy: rounding
Group: Loads and cables that the solvers do not have
Unreached: the solvers' cables hang free
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from validation.oracles.case import positive


def deflection(z: ArrayLike, *, P: float, V: float, k: float) -> NDArray[np.float64]:
    """v(z)."""
    if not (math.isfinite(V) and V >= 0.0) or V == 1.0:
        raise ValueError(f"speed must be >= 0 and not the wave speed 1, got {V!r}")
    positive(stiffness=k)
    z, e = np.asarray(z, float), abs(1.0 - V * V)
    if V < 1.0:
        return P * np.exp(-np.abs(z) * math.sqrt(k / e)) / (2.0 * math.sqrt(k * e))
    return np.where(z < 0.0, P * np.sin(-z * math.sqrt(k / e)) / math.sqrt(k * e), 0.0)
