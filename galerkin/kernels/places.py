"""Quadrature points, and terms of the mass, for a place of the mass."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from galerkin.bases.fourier import split, values_at
from galerkin.bases.kink import Array, Carried, carry
from galerkin.bases.riding import ride, spread
from galerkin.kernels.cable import Cable, Points, static
from galerkin.law import inner


class Line(NamedTuple):
    """The cable over sines, and quadrature rules for it."""

    cable: Cable
    behind: Array  # Gauss rules on [0, 1] of both sides, (2, m)
    ahead: Array
    mass: Array  # these three of `Moving`
    left: Array
    chord: Array
    grading: float
    riding: Any = None  # `Tables` of riding sines; then `mass`, `left`, `chord` only give sizes
    tau: float = 0.0  # of internal damping, with `riding`


class Ground(NamedTuple):
    x: Carried
    slope: Array  # X' at the mass, (2,)
    load: Array  # X.. - sigma j, (2,)
    s_o: float
    ds_o: float
    dds_o: float


class Moment(NamedTuple):
    at: Points
    ground: Ground


@inner
def carried_at(line, riding, place):
    if riding is None:
        at = values_at(place[0], line.left.size, line.grading)
        return carry(at, line.mass, line.left, line.chord, place, line.cable.damping)
    return ride(riding, place, line.cable.damping)


@inner
def ground_at(line, place):
    """`Ground` of s_o, ds_o, dds_o; the load of a force alone is its weight."""
    cable = line.cable
    s_o, ds_o, dds_o = place
    x = carried_at(line, line.riding, place)
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
    return Ground(x, slope, load, s_o, ds_o, dds_o)


@inner
def spread_at(line, riding, s_o):
    """Points, weights, Phi' and `Points.bend`."""
    if riding is None:
        return *split(s_o, line.behind, line.ahead, line.left.size, line.grading), None
    s, weights, phi = spread(riding, riding.slope, s_o)
    return s, weights, phi, spread(riding, riding.bend, s_o)[2] if line.tau > 0.0 else phi


@inner
def points_at(line, s_o):
    s, weights, phi, bend = spread_at(line, line.riding, s_o)
    T, r_static = static(s, line.cable.sigma, line.cable.c)
    return Points(s, phi, weights, T, r_static, bend)


@inner
def moment(line, place):
    return Moment(points_at(line, place[0]), ground_at(line, place))


@inner
def place_of(states, i):
    """s_o, ds_o, dds_o of row i."""
    return states[i, 0], states[i, 1], states[i, 2]


@inner
def free_place(state):
    last = state.shape[1] - 1
    return state[0, last], state[1, last], state[2, last]
