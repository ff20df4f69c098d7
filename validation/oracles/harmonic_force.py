"""A harmonic force at constant speed sends Doppler-shifted waves; above the wave speed none run ahead of it.

    v_tt - v_xx = P e^(i omega t) delta(x - V t) on the infinite string, acting since ever (steady).

Pierucci (reference 12 of Al-Qassab, Nair & O'Leary 2003).  Half the integral of the force over the times heard:
    V < 1 :  v = (P/(2 i omega)) e^(i omega tau),  tau = (t-x)/(1-V) ahead, (t+x)/(1+V) behind,
    V > 1 :  v = (P/(2 i omega)) [ e^(i omega (x+t)/(V+1)) - e^(i omega (x-t)/(V-1)) ] behind (both run left seen
        from the force), 0 ahead.
Take the real part for P cos(omega t).  A force switched on at t = 0 has instead int_0^tau inside the waves it has
sent since then.

Validity: omega > 0, V >= 0, V != 1.  Accuracy: rounding of the phase, 1e-16 omega (|x|+t)/|1-V|.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from validation.oracles.case import Oracle, positive


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


ORACLE = Oracle(
    title="harmonic force at constant speed, steady",
    source="Pierucci (reference 12 of Al-Qassab et al. 2003)",
    validity="infinite string, not at the wave speed",
    group="Loads and cables that the solvers do not have",
    unreached="the solvers' load is a weight, which does not oscillate",
)
