"""Error bars from the changes of a value that is refined twice."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cablefem.response import Array

SAFETY = 1.25  # for three grids (Roache 1998, Verification and Validation, section 5)
MIN_ORDER = 0.5  # smallest order credited (Eca & Hoekstra 2014, J. Comput. Phys. 262): so a bar of at most 3 d
LARGEST = 12.0  # order that is observed: a smaller change is one of rounding
FIRST = 1.0  # largest order credited to forces and to velocities, which jump at fronts


def error_bar(change: ArrayLike, change_before: ArrayLike, ratios: Sequence[float], max_order: float) -> Any:
    """The bar F d / (r^p - 1) of a finest run, value by value: an array, or a float for a float.

    change : d, from half to finest;  change_before : from quarter to half, 0 if unknown.
    ratios : finest over half, half over quarter;  max_order : the most credited.

    p solves before/d = r^p (r'^p - 1)/(r^p - 1) (Celik et al. 2008, J. Fluids Eng. 130, 078001).  A change below the
    nominal fall is raised to it, unless the quarter is too far off.
    """
    d = np.abs(np.asarray(change, float))
    before = np.abs(np.asarray(change_before, float))
    r = ratios[0]
    coarser = ratios[-1]
    smallest = min(max_order, MIN_ORDER)
    nominal_fall = r**max_order * (coarser**max_order - 1.0)
    floor = before * (r**max_order - 1.0) / nominal_fall  # the change at the nominal order
    nonsense = 4.0  # times the nominal fall: a quarter run this far off is ignored
    sensible = floor <= nonsense * d
    d = np.where(sensible, np.maximum(d, floor), d)
    before = np.where(sensible, before, 0.0)
    p = _observed_order_within(d, before, (r, coarser), smallest, max_order)
    bar = SAFETY * d / (r ** np.nan_to_num(p, nan=smallest) - 1.0)
    bar = np.where(np.isfinite(bar), bar, np.inf)
    return bar if bar.ndim else float(bar)


def _observed_order_within(change: Array, before: Array, ratios: Sequence[float], low: float, high: float) -> Array:
    """The p of `error_bar` between low and high; nan if unknown."""
    r = ratios[0]
    coarser = ratios[-1]
    p = np.full(np.shape(change), high)
    with np.errstate(divide="ignore", invalid="ignore"):
        fall = np.where(change > 0.0, before / change, 0.0)
        for _ in range(10):
            before_it = p
            observed = np.log(fall * (r**p - 1.0) / (coarser**p - 1.0)) / math.log(r)
            p = np.clip(observed, low, high)
            if np.array_equal(p, before_it, equal_nan=True):
                break
    return p


def observed_order(levels: Sequence[float], ratios: Sequence[float]) -> float | None:
    """The order that a value shows; None: fewer than three resolutions, or none in the range.

    levels : values of the finest run, of half and of a quarter;  ratios : finest over half, half over quarter.
    """
    from scipy.optimize import brentq  # where bars are printed

    if len(levels) < 3 or levels[0] == levels[1]:
        return None
    finest, half, quarter = levels
    r, coarser = ratios
    fall = abs((half - quarter) / (finest - half))

    def equation(p: float) -> float:
        return math.log(r**p * (coarser**p - 1.0) / (r**p - 1.0)) - math.log(fall or math.ulp(0.0))

    in_range = equation(MIN_ORDER) < 0.0 < equation(LARGEST)
    return float(brentq(equation, MIN_ORDER, LARGEST)) if in_range else None
