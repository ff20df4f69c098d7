"""Compiled inner loops of the full cable.

Compiled because a step of these small systems costs more in interpreter than in arithmetic otherwise.

    cable     stress, forces, tangent, inertia
    dense     BLAS and LAPACK
    rolling   a car that rolls
    steps     a step, and many in one go

Common arguments
    T         (m,) static tension;  r_static (2, m) rows x', y' of the static shape
    slope     (2, m) w' = (u', v');  phi (n, m) Phi' at the points, weights (m,) of Gauss' rule
    alpha, law  EA/H, and the index of the law in `galerkin.law.LAWS`
    x         a `Carried` of the moving basis
    Q, V, A   (fields, n) coefficients, their velocities and accelerations

Loops stand where numpy would have an expression of arrays: numba takes seconds to compile the latter.
"""

from galerkin.kernels.cable import Cable, Points, balance, least, stiffness, stress
from galerkin.kernels.rolling import Rolling, averaged, by_force, car, taut
from galerkin.kernels.steps import FREE, HAULED, STUCK, Course, Line, Ride, look, roll_on, seen, stride, surveyed

__all__ = [
    "FREE", "HAULED", "STUCK", "Cable", "Course", "Line", "Points", "Ride", "Rolling", "averaged", "balance",
    "by_force", "car", "least", "look", "roll_on", "seen", "stiffness", "stress", "stride", "surveyed", "taut",
]  # fmt: skip
