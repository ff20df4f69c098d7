"""Quadrature points, and terms of the mass, for a position of the mass."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.bases.fourier import quadrature_with_kinked_slopes, values_derivatives_primitives
from galerkin.bases.kink import Array, InertiaTerms, inertia_terms_with_hat
from galerkin.kernels.cable import Cable, Points, static_tension_and_slope
from galerkin.law import inner

Kinematics = tuple[float, float, float]  # s_o, ds_o, dds_o


class CableSines(NamedTuple):
    """The cable over sines, and quadrature rules for it."""

    cable: Cable
    behind: Array  # Gauss rules on [0, 1] of both sides, (2, m)
    ahead: Array
    mass: Array  # these three of `KinkedBasis`
    left: Array
    chord: Array
    grading: float


class MassTerms(NamedTuple):
    """Terms of the mass at its position s_o."""

    inertia: InertiaTerms
    slope: Array  # X' at the mass, (2,)
    load: Array  # X.. - sigma j, (2,)
    s_o: float
    ds_o: float
    dds_o: float


class Instant(NamedTuple):
    """What the position and motion of the mass fix."""

    points: Points
    at_mass: MassTerms


@inner
def mass_terms_at(sines: CableSines, kinematics: Kinematics) -> MassTerms:
    """`MassTerms` of s_o, ds_o, dds_o; the load of a force alone is its weight."""
    cable = sines.cable
    s_o, ds_o, dds_o = kinematics
    at = values_derivatives_primitives(s_o, sines.left.size, sines.grading)
    x = inertia_terms_with_hat(at, sines.mass, sines.left, sines.chord, kinematics, cable.damping)
    p = cable.c - cable.sigma * s_o
    T = math.sqrt(1.0 + p * p)
    slope = np.empty(2)
    load = np.zeros(2)
    slope[0] = 1.0 / T
    slope[1] = p / T
    if cable.inertia != 0.0:
        load[0] = dds_o / T + ds_o * ds_o * cable.sigma * p / T**3
        load[1] = dds_o * p / T - ds_o * ds_o * cable.sigma / T**3
    load[1] -= cable.sigma
    return MassTerms(x, slope, load, s_o, ds_o, dds_o)


@inner
def quadrature_points_at(sines: CableSines, s_o: float) -> Points:
    s, weights, phi = quadrature_with_kinked_slopes(s_o, sines.behind, sines.ahead, sines.left.size, sines.grading)
    T, static_slope = static_tension_and_slope(s, sines.cable.sigma, sines.cable.c)
    return Points(s, phi, weights, T, static_slope)


@inner
def instant_at(sines: CableSines, kinematics: Kinematics) -> Instant:
    return Instant(quadrature_points_at(sines, kinematics[0]), mass_terms_at(sines, kinematics))


@inner
def kinematics_in_row(rows: Array, i: int) -> Kinematics:
    """s_o, ds_o, dds_o of row i."""
    return rows[i, 0], rows[i, 1], rows[i, 2]


@inner
def kinematics_of_free_car(state: Array) -> Kinematics:
    """s_o, ds_o, dds_o, the last unknown of a state (3, n_dof)."""
    last = state.shape[1] - 1
    return state[0, last], state[1, last], state[2, last]
