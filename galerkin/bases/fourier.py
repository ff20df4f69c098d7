"""Sines (33)-(34): the paper's first basis."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.special import roots_legendre

from galerkin.law import compiled, inner


@lru_cache(maxsize=256)
def _gauss_rule_on_unit_interval(n: int) -> np.ndarray:
    """n Gauss points on [0, 1], and weights, (2, n)."""
    x, w = roots_legendre(n)
    return np.array([0.5 * (1.0 + x), 0.5 * w])


@compiled
def xi_of_s(s: float, grading: float) -> float:
    """xi of s = xi - grading sin(2 pi xi)/(2 pi), by Newton's method with bisection."""
    if grading == 0.0 or s <= 0.0 or s >= 1.0:
        return s
    low = 0.0
    high = 1.0
    x = s
    for _ in range(100):
        off = x - grading * math.sin(2.0 * math.pi * x) / (2.0 * math.pi) - s
        if off > 0.0:
            high = x
        else:
            low = x
        step = off / (1.0 - grading * math.cos(2.0 * math.pi * x))
        if abs(step) <= 1e-15:  # rounding of off, over the least 1 - grading
            break
        x = x - step if low < x - step < high else 0.5 * (low + high)
    return x


@inner
def set_first_two_primitives(xi: float, n: int, grading: float, out: np.ndarray) -> None:
    """Set out (2, n) to the first two primitives of sin(k pi xi) by s.

    ds/dxi = 1 - grading cos(2 pi xi) couples j and j +- 2.  D, F belong to sines, odd in j.
    """
    size = n + 5
    b = 0.5 * grading
    D = np.zeros(size)
    I = np.zeros(size)
    F = np.zeros(size)
    I[0] = xi
    for j in range(1, size):
        D[j] = math.cos(j * math.pi * xi) / (j * math.pi)
        I[j] = math.sin(j * math.pi * xi) / (j * math.pi)
    for j in range(1, size - 2):
        F[j] = (I[j] - b * (I[j + 2] + I[abs(j - 2)])) / (j * math.pi)
    for k in range(1, n + 1):
        i = abs(k - 2)
        sign = 1.0 if k > 1 else -1.0
        out[0, k - 1] = b * (D[k + 2] + sign * D[i]) - D[k]
        out[1, k - 1] = b * (F[k + 2] + sign * F[i]) - F[k]


@inner
def set_functions_and_derivatives(xi: float, n: int, grading: float, out: np.ndarray) -> None:
    """Set rows of out (3, n) to phi, phi', phi''."""
    g = 1.0 / (1.0 - grading * math.cos(2.0 * math.pi * xi))
    bend = 2.0 * math.pi * grading * math.sin(2.0 * math.pi * xi) * g
    for k in range(n):
        wave = (k + 1) * math.pi
        c = wave * math.cos(wave * xi)
        sn = math.sin(wave * xi)
        out[0, k] = sn
        out[1, k] = c * g
        out[2, k] = -(wave * wave * sn + c * bend) * g * g


@compiled
def values_derivatives_primitives(s: float, n: int, grading: float) -> np.ndarray:
    """`Fourier.values_derivatives_primitives`."""
    out = np.empty((5, n))
    xi = xi_of_s(s, grading)
    set_functions_and_derivatives(xi, n, grading, out[:3])
    set_first_two_primitives(xi, n, grading, out[3:])
    return out


@compiled
def derivative_or_primitive_at_points(s: np.ndarray, n: int, grading: float, row: int) -> np.ndarray:
    """One row of `values_derivatives_primitives` at many points s (m,), (m, n)."""
    out = np.empty((s.size, n))
    for i in range(s.size):
        values = values_derivatives_primitives(s[i], n, grading)
        for k in range(n):
            out[i, k] = values[row, k]
    return out


@compiled
def quadrature_with_kinked_slopes(
    s_o: float, behind: np.ndarray, ahead: np.ndarray, n: int, grading: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`Fourier.quadrature_with_kinked_slopes` with rules (2, m) on [0, 1], by k rotations of (cos, sin)."""
    m = behind.shape[1]
    both = behind.shape[1] + ahead.shape[1]
    x_o = xi_of_s(s_o, grading)
    s = np.empty(both)
    weights = np.empty(both)
    phi = np.empty((n + 1, both))
    c1 = np.empty(both)
    s1 = np.empty(both)
    c = np.empty(both)
    sn = np.empty(both)
    dense = np.empty(both)
    for q in range(both):
        if q < m:
            x = x_o * behind[0, q]
            w = x_o * behind[1, q]
        else:
            x = x_o + (1.0 - x_o) * ahead[0, q - m]
            w = (1.0 - x_o) * ahead[1, q - m]
        c1[q] = c[q] = math.cos(math.pi * x)
        s1[q] = sn[q] = math.sin(math.pi * x)
        stretch = 1.0 - grading * (2.0 * c1[q] * c1[q] - 1.0)
        s[q] = x - grading * c1[q] * s1[q] / math.pi
        weights[q] = w * stretch
        dense[q] = 1.0 / stretch
    for k in range(n):
        wave = (k + 1) * math.pi
        row = phi[k]
        for q in range(both):
            row[q] = wave * c[q] * dense[q]
            turned = c[q] * c1[q] - sn[q] * s1[q]
            sn[q] = sn[q] * c1[q] + c[q] * s1[q]
            c[q] = turned
    for q in range(both):
        phi[n, q] = 1.0 / s_o if q < m else -1.0 / (1.0 - s_o)
    return s, weights, phi


@dataclass(frozen=True, slots=True)
class Fourier:
    """phi_k(s) = sin(k pi xi), k = 1 .. n, s = xi - grading sin(2 pi xi)/(2 pi).

    n pi/2 Gauss points integrate cos(2 n pi s), a product of two highest derivatives.
    The strain has more factors: 2 n + 40.  With grading, at least two sines.
    """

    n: int
    grading: float = 0.0

    has_second_derivative = True  # phi'' exists, as (23) needs

    def values_derivatives_primitives(self, s: float) -> np.ndarray:
        """phi, phi', phi'' and two primitives at one s, (5, n)."""
        return values_derivatives_primitives(s, self.n, self.grading)

    def phi(self, s: np.ndarray, derivative: Literal[-2, -1, 0, 1, 2] = 0) -> np.ndarray:
        """A derivative of phi of this order, (n_s, n); primitives for a negative one."""
        row = (0, 1, 2, 4, 3)[derivative]
        return derivative_or_primitive_at_points(s, self.n, self.grading, row)

    def mass_matrix(self) -> np.ndarray:
        """int phi_m phi_n ds."""
        k = np.arange(1, self.n + 1)
        difference = np.subtract.outer(k, k)
        couples = 1.0 * (np.abs(difference) == 2) - (np.add.outer(k, k) == 2)
        return 0.5 * (difference == 0) - 0.25 * self.grading * couples

    def stiffness_matrix(self) -> np.ndarray:
        """int phi_m' phi_n' ds."""
        rule = self.gauss_rule_of_side(1.0)
        _, weights, phi = quadrature_with_kinked_slopes(0.5, rule, rule, self.n, self.grading)
        return (phi[:-1] * weights) @ phi[:-1].T

    def integrals(self) -> np.ndarray:
        """int phi_n ds."""
        left, right = self.phi(np.array([0.0, 1.0]), -1)
        return right - left

    def quadrature(self) -> tuple[np.ndarray, np.ndarray]:
        """Points and weights on [0, 1] for products of first derivatives."""
        xi, weights = _gauss_rule_on_unit_interval(2 * self.n + 40)
        turn = 2.0 * np.pi * xi
        s = xi - self.grading * np.sin(turn) / (2.0 * np.pi)
        stretch = 1.0 - self.grading * np.cos(turn)
        return s, weights * stretch

    def gauss_rules_of_sides(self, s_o: float) -> tuple[np.ndarray, np.ndarray]:
        """Gauss points and weights on [0, 1] for the sides behind and ahead of s_o, (2, m) each."""
        xi = float(xi_of_s(s_o, self.grading))
        return self.gauss_rule_of_side(xi), self.gauss_rule_of_side(1.0 - xi)

    def runs_of_equal_gauss_rules(self, s_o: np.ndarray) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Runs of consecutive places s_o (m,) with equal rules, and these rules."""
        xi = s_o
        if self.grading:
            xi = np.array([xi_of_s(s, self.grading) for s in s_o.tolist()])
        sides = np.stack([xi, 1.0 - xi])
        counts = np.ceil(self.n * sides / 8.0)
        changes = np.diff(counts, axis=1).any(axis=0)
        ends = np.flatnonzero(changes) + 1
        for first, end in pairwise([0, *ends.tolist(), s_o.size]):
            behind, ahead = self.gauss_rules_of_sides(float(s_o[first]))
            yield slice(first, end), behind, ahead

    def gauss_rule_of_side(self, length_in_xi: float) -> np.ndarray:
        """Gauss points and weights on [0, 1] for a side of this length, (2, m)."""
        return _gauss_rule_on_unit_interval(20 + 16 * math.ceil(self.n * length_in_xi / 8.0))

    def quadrature_with_kinked_slopes(self, s_o: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points and weights (n_q,) of both sides of s_o; phi' and the hat's slope, (n + 1, n_q)."""
        return quadrature_with_kinked_slopes(s_o, *self.gauss_rules_of_sides(s_o), self.n, self.grading)
