"""Compiled steps of the full cable over sines with a hat, as loops, which compile fast.

phi (n, m): Phi' at the points; x: a `Carried`; Q, V, A (2, n): coefficients and rates.
"""

from galerkin.kernels.cable import Cable, Points, balance, least, stiffness, stress
from galerkin.kernels.rolling import LEAST_PULL, Car, Rolling, averaged, by_force, car, taut, weighed_car
from galerkin.kernels.steps import (
    FREE,
    HAULED,
    STUCK,
    Course,
    Line,
    Ride,
    look,
    lost,
    roll_on,
    seen,
    stride,
    surveyed,
    weighed,
)

__all__ = [
    "FREE", "HAULED", "LEAST_PULL", "STUCK", "Cable", "Car", "Course", "Line", "Points", "Ride", "Rolling", "averaged",
    "balance", "by_force", "car", "least", "look", "lost", "roll_on", "seen", "stiffness", "stress", "stride",
    "surveyed", "taut", "weighed", "weighed_car",
]  # fmt: skip
