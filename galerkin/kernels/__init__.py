"""Compiled steps of the full cable over sines; loops compile faster than array expressions.

phi (n, m): Phi' at the points; x: a `Carried`; Q, V, A (2, n): coefficients and rates.
"""

from galerkin.kernels.cable import Cable, Points, least, stiffness, stress
from galerkin.kernels.places import Line
from galerkin.kernels.rolling import LEAST_PULL
from galerkin.kernels.steps import look, solve_steps, surveyed
