"""What second computations share, and no writer: units of printed numbers, ice, means, and heights of polylines."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

Array = NDArray[np.float64]

# prefixes of a unit, and units that are no prefix and SI unit
FACTORS = {"": 1.0, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9, "km/h": 1.0 / 3.6, "%": 0.01, "°": 1.0}


def si_factor(printed: str, unit: str) -> float:
    """What a number in a printed unit is multiplied by to be in `unit`; nan if they do not fit."""
    return FACTORS.get(printed.removesuffix(unit), math.nan)


def ice_mass(cable: dict[str, Any]) -> float:
    """Mass per length [kg/m] of the ice of a TOML's cable."""
    ice = cable.get("ice", 0.0)
    if not isinstance(ice, dict):
        return float(ice)
    thickness = ice["thickness"]
    return float(ice["density"] * math.pi * thickness * (cable["diameter"] + thickness))


def mean_around(t: Array, values: Array, at: Array, period: float) -> Array:
    """Means of a signal (n,) or (n, c) over a period around times (k,), within the signal's own range."""
    total = make_interp_spline(t, values, k=1).antiderivative()
    begin = np.clip(at - 0.5 * period, t[0], t[-1])
    end = np.clip(at + 0.5 * period, t[0], t[-1])
    duration = (end - begin).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((total(end) - total(begin)) / duration)


def deepest(at: Array, x: Array, y: Array) -> Array:
    """Deepest y of a polyline (n,) at each x of `at` (m,); -inf where it does not pass."""
    low = np.minimum(x[:-1], x[1:])
    high = np.maximum(x[:-1], x[1:])
    depths = np.full(at.size, -math.inf)
    for j, x_j in enumerate(at):
        i = np.flatnonzero((low <= x_j) & (x_j <= high) & (low < high))
        w = (x_j - x[i]) / (x[i + 1] - x[i])
        depths[j] = np.max(y[i] + w * (y[i + 1] - y[i]), initial=-math.inf)
    return depths
