"""Sines that ride with the mass, one set on each side of it; see README.md, "Riding sines"."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from galerkin.bases.fourier import _unit_gauss
from galerkin.bases.kink import Array, InertiaTerms
from galerkin.law import compiled, inner


class Tables(NamedTuple):
    """One side, 0 <= xi <= 1 with the mass at 1: phi_k = sin(k pi xi), k = 1 .. n, and the hat xi, which comes last."""

    xi: Array  # (m,) Gauss points
    weights: Array  # (m,)
    slope: Array  # phi', (n + 1, m)
    bend: Array  # (xi phi')', (n + 1, m)
    mean: Array  # int phi dxi, (n + 1,)
    cosines: Array  # cos(k pi xi), (2 n + 1, m)
    sines: Array  # xi sin(k pi xi), (2 n + 1, m)
    mass: Array  # int phi_i phi_j dxi, (n + 1, n + 1)
    drift: Array  # int phi_i xi phi_j' dxi
    swirl: Array  # int phi_i (2 xi phi_j' + xi^2 phi_j'') dxi - phi_i(1) phi_j'(1)


@lru_cache(maxsize=64)
def riding_tables(n: int) -> Tables:
    """2 n + 24 Gauss points integrate cos(2 n pi xi), of a product of two slopes, to rounding."""
    xi, weights = _unit_gauss(2 * n + 24)
    values, slopes, bends = shape_functions(n, xi)
    tested = values * weights
    swirl = tested @ (2.0 * xi * slopes + xi * xi * bends).T
    at_mass, slope_at_mass, _ = shape_functions(n, np.ones(1))
    swirl -= at_mass @ slope_at_mass.T
    waves = np.pi * np.multiply.outer(np.arange(2 * n + 1), xi)
    return Tables(
        xi, weights, slopes, slopes + xi * bends, tested.sum(axis=1), np.cos(waves), xi * np.sin(waves),
        tested @ values.T, tested @ (xi * slopes).T, swirl,
    )  # fmt: skip


def shape_functions(n: int, xi: Array) -> tuple[Array, Array, Array]:
    """phi, phi', phi'' by xi, (n + 1, m) each."""
    wave = np.pi * np.arange(1, n + 1)[:, None]
    sine = np.sin(wave * xi)
    cosine = np.cos(wave * xi)
    return (
        np.vstack([sine, xi]), np.vstack([wave * cosine, np.ones_like(xi)]),
        np.vstack([-wave * wave * sine, np.zeros_like(xi)]),
    )  # fmt: skip


@inner
def side_length(kinematics, side):
    """Length of the side behind the mass (0) or ahead of it (1), and its rates."""
    s_o, ds_o, dds_o = kinematics
    return (s_o, ds_o, dds_o) if side == 0 else (1.0 - s_o, -ds_o, -dds_o)


@inner
def index_of_sine(side, j, n):
    """Index of sine j = 1 .. n of a side, or of the hat, j = 0."""
    return side * n + j - 1 if j else 2 * n


@compiled
def riding_inertia_terms(tables, kinematics, damping):
    """`InertiaTerms` at s_o, ds_o, dds_o.
    On a side of length h, at fixed s,
        dphi/dt = -(h./h) xi phi',   d2phi/dt2 = -(h../h) xi phi' + (h./h)^2 (2 xi phi' + xi^2 phi'').
    At the mass d2phi/dt2 holds -ds_o^2 [phi'] delta(s - s_o), which is the last term of `swirl`.
    """
    n = tables.mass.shape[0] - 1
    size = 2 * n + 1
    M = np.zeros((size, size))
    gyroscopic = np.zeros((size, size))
    centrifugal = np.zeros((size, size))
    for side in range(2):
        h, dh, ddh = side_length(kinematics, side)
        flux = dh * dh / h
        ddh = ddh + damping * dh
        for i in range(n + 1):
            row = index_of_sine(side, i, n)
            for j in range(n + 1):
                column = index_of_sine(side, j, n)
                M[row, column] += h * tables.mass[i - 1, j - 1]
                gyroscopic[column, row] -= 2.0 * dh * tables.drift[i - 1, j - 1]
                centrifugal[column, row] += flux * tables.swirl[i - 1, j - 1] - ddh * tables.drift[i - 1, j - 1]
    at_mass = np.zeros(size)
    none = np.zeros(size)
    at_mass[-1] = 1.0
    return InertiaTerms(M, gyroscopic, centrifugal, at_mass, none, none, none, none)


@compiled
def riding_quadrature(tables, slope, s_o):
    """Points s and weights (2 m,), and Phi' (2 n + 1, 2 m) from `slope`, phi' by xi."""
    n = slope.shape[0] - 1
    m = tables.xi.size
    s = np.empty(2 * m)
    weights = np.empty(2 * m)
    phi = np.zeros((2 * n + 1, 2 * m))
    for side in range(2):
        h, sign, _ = side_length((s_o, 1.0, 0.0), side)
        for q in range(m):
            i = q + side * (2 * m - 1 - 2 * q)  # s ascends
            s[i] = side + sign * h * tables.xi[q]
            weights[i] = h * tables.weights[q]
            for k in range(n + 1):
                phi[index_of_sine(side, k, n), i] = sign / h * slope[k - 1, q]
    return s, weights, phi


class RidingSines:
    """Riding sines behind the mass, k = 1 .. terms, those ahead of it, and the hat."""

    smooth = True
    kink = True

    def __init__(self, terms: int) -> None:
        self.terms = terms
        self.n = 2 * terms + 1
        self.tables = riding_tables(terms)

    def inertia_terms(self, s_o: float, ds_o: float, dds_o: float, damping: float = 0.0) -> InertiaTerms:
        return riding_inertia_terms(self.tables, (s_o, ds_o, dds_o), damping)

    def slopes(self, s_o: float) -> tuple[Array, Array, Array]:
        return riding_quadrature(self.tables, self.tables.slope, s_o)

    def stiffness(self, s_o: float) -> Array:
        _, weights, phi = self.slopes(s_o)
        return (phi * weights) @ phi.T

    def integral(self, s_o: float) -> Array:
        own = self.tables.mean
        return np.concatenate([s_o * own[:-1], (1.0 - s_o) * own[:-1], own[-1:]])
