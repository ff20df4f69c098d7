"""Sines (33)-(34): the paper's first basis."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.special import roots_legendre

from galerkin.law import compiled


@lru_cache(maxsize=256)
def _unit_gauss(n: int) -> np.ndarray:
    """n Gauss points and weights on [0, 1], (2, n)."""
    x, w = roots_legendre(n)
    return np.array([0.5 * (1.0 + x), 0.5 * w])


@compiled
def stretched(s, grading):
    """xi of a place s = xi - grading sin(2 pi xi)/(2 pi), by Newton's method between bounds that close in."""
    if grading == 0.0 or s <= 0.0 or s >= 1.0:
        return s
    low, high, x = 0.0, 1.0, s
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


@compiled
def integrals(x, n, grading, out):
    """Set rows of out (2, n) to primitives of sin(k pi xi) by s, and of those.

    ds/dxi = 1 - grading cos(2 pi xi) shifts the number of waves by two: a sum of neighbours for each primitive.
    D and F are those of sines, odd in j; I of cosines, even in j.
    """
    size, b = n + 5, 0.5 * grading
    D, I, F = np.zeros(size), np.zeros(size), np.zeros(size)
    I[0] = x
    for j in range(1, size):
        D[j], I[j] = math.cos(j * math.pi * x) / (j * math.pi), math.sin(j * math.pi * x) / (j * math.pi)
    for j in range(1, size - 2):
        F[j] = (I[j] - b * (I[j + 2] + I[abs(j - 2)])) / (j * math.pi)
    for k in range(1, n + 1):
        i, sign = abs(k - 2), 1.0 if k > 1 else -1.0
        out[0, k - 1] = b * (D[k + 2] + sign * D[i]) - D[k]
        out[1, k - 1] = b * (F[k + 2] + sign * F[i]) - F[k]


@compiled
def derivatives(x, n, grading, out):
    """Set rows of out (3, n) to sin(k pi xi) and its first and second derivative by s."""
    g = 1.0 / (1.0 - grading * math.cos(2.0 * math.pi * x))
    bend = 2.0 * math.pi * grading * math.sin(2.0 * math.pi * x) * g
    for k in range(n):
        wave = (k + 1) * math.pi
        c, sn = wave * math.cos(wave * x), math.sin(wave * x)
        out[0, k], out[1, k], out[2, k] = sn, c * g, -(wave * wave * sn + c * bend) * g * g


@compiled
def values_at(s, n, grading):
    """`Fourier.at`, (5, n)."""
    out, x = np.empty((5, n)), stretched(s, grading)
    derivatives(x, n, grading, out[:3])
    integrals(x, n, grading, out[3:])
    return out


@compiled
def values_along(s, n, grading, row):
    """One row of `values_at` at many places (m,), (m, n)."""
    out = np.empty((s.size, n))
    for i in range(s.size):
        out[i] = values_at(s[i], n, grading)[row]
    return out


@compiled
def split(s_o, behind, ahead, n, grading):
    """`Fourier.split` for rules (2, m) on [0, 1] of both sides.

    k pi cos(k pi xi) by turning (cos, sin) k times by pi xi: each turn adds a rounding to the angle, k eps after k of
    them, no more than rounding the argument costs.
    """
    m, both, x_o = behind.shape[1], behind.shape[1] + ahead.shape[1], stretched(s_o, grading)
    s, weights, phi = np.empty(both), np.empty(both), np.empty((n + 1, both))
    c1, s1, c, sn, dense = np.empty(both), np.empty(both), np.empty(both), np.empty(both), np.empty(both)
    for q in range(both):
        x, w = (x_o * behind[0, q], x_o * behind[1, q]) if q < m else (
            x_o + (1.0 - x_o) * ahead[0, q - m], (1.0 - x_o) * ahead[1, q - m]
        )  # fmt: skip
        c1[q] = c[q] = math.cos(math.pi * x)
        s1[q] = sn[q] = math.sin(math.pi * x)
        stretch = 1.0 - grading * (2.0 * c1[q] * c1[q] - 1.0)
        s[q], weights[q], dense[q] = x - grading * c1[q] * s1[q] / math.pi, w * stretch, 1.0 / stretch
    for k in range(n):
        wave, row = (k + 1) * math.pi, phi[k]
        for q in range(both):
            row[q] = wave * c[q] * dense[q]
            c[q], sn[q] = c[q] * c1[q] - sn[q] * s1[q], sn[q] * c1[q] + c[q] * s1[q]
    for q in range(both):
        phi[n, q] = 1.0 / s_o if q < m else -1.0 / (1.0 - s_o)
    return s, weights, phi


@dataclass(frozen=True, slots=True)
class Fourier:
    """phi_k(s) = sin(k pi xi), k = 1 .. n: every integral in closed form, no locality.

    s = xi - grading sin(2 pi xi)/(2 pi): the paper's sines with 0; else 1/(1 - grading) times as fine next to the
    supports as those, and 1 + grading times as coarse halfway.

    Gauss points: a product of two highest derivatives is cos(2 n pi s), which Gauss' rule integrates to rounding with
    about n pi/2 points plus a margin growing like n^(1/3); the strain multiplies a few more factors, hence
    2 n + 40. A side of the mass may be nearly the whole cable, so its count depends on n, not on its length
    (n + 12 points a side destroy the path at n = 60).
    """

    n: int
    grading: float = 0.0

    def __post_init__(self) -> None:
        if self.n < 1:
            raise ValueError(f"Fourier.n must be at least 1, got {self.n!r}")
        if not 0.0 <= self.grading < 1.0:
            raise ValueError(f"Fourier.grading must lie in [0, 1), got {self.grading!r}")
        if self.grading and self.n < 2:
            raise ValueError("a graded basis takes two sines at least")

    smooth = True

    @property
    def wavenumbers(self) -> np.ndarray:
        """k pi, (n,)."""
        return np.pi * np.arange(1, self.n + 1)

    def at(self, s: float) -> np.ndarray:
        """phi, phi', phi'', both primitives at one s, (5, n)."""
        return values_at(s, self.n, self.grading)

    def phi(self, s: np.ndarray, m: int = 0) -> np.ndarray:
        """The m-th derivative of phi, (n_s, n), m = -2 .. 2; primitives for m < 0."""
        if self.grading:
            return values_along(np.asarray(s, float), self.n, self.grading, (0, 1, 2, 4, 3)[m])
        x, sign = np.multiply.outer(s, self.wavenumbers), (1.0, 1.0, -1.0, -1.0)[m % 4]
        return sign * self.wavenumbers**m * (np.cos(x) if m % 2 else np.sin(x))

    def mass(self) -> np.ndarray:
        """int phi_m phi_n ds: 1/2 on the diagonal, and what the grading mixes."""
        k = np.arange(1, self.n + 1)
        apart, sums = np.subtract.outer(k, k), np.add.outer(k, k)
        return 0.5 * (apart == 0) - 0.25 * self.grading * ((np.abs(apart) == 2) * 1.0 - (sums == 2))

    def stiffness(self) -> np.ndarray:
        """int phi_m' phi_n' ds, (n pi)^2/2 on the diagonal without a grading."""
        if not self.grading:
            return np.diag(0.5 * self.wavenumbers**2)
        _, weights, phi = split(0.5, self.side_rule(1.0), self.side_rule(1.0), self.n, self.grading)
        return (phi[:-1] * weights) @ phi[:-1].T

    def integral(self) -> np.ndarray:
        """int phi_k ds."""
        left, right = self.phi(np.array([0.0, 1.0]), -1)
        return right - left

    def quadrature(self) -> tuple[np.ndarray, np.ndarray]:
        """2 n + 40 Gauss points on the cable."""
        x, w = _unit_gauss(2 * self.n + 40)
        turn = 2.0 * np.pi * x
        return x - self.grading * np.sin(turn) / (2.0 * np.pi), w * (1.0 - self.grading * np.cos(turn))

    def side_rules(self, s_o: float) -> tuple[np.ndarray, np.ndarray]:
        """Gauss rules on [0, 1] for both sides of s_o."""
        x = float(stretched(s_o, self.grading))
        return self.side_rule(x), self.side_rule(1.0 - x)

    def alike(self, s_o: np.ndarray) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Places next to each other that have the same rules of both sides, and these; s_o (m,)."""
        x = np.array([stretched(s, self.grading) for s in s_o.tolist()]) if self.grading else s_o
        counts = np.ceil(self.n * np.stack([x, 1.0 - x]) / 8.0)
        ends = np.flatnonzero((counts[:, 1:] != counts[:, :-1]).any(axis=0)) + 1
        for first, end in pairwise([0, *ends.tolist(), s_o.size]):
            yield slice(first, end), *self.side_rules(float(s_o[first]))

    def side_rule(self, length: float) -> np.ndarray:
        """Gauss points and weights on [0, 1] for a piece of this length in xi, (2, m), m in steps of 16."""
        return _unit_gauss(20 + 16 * math.ceil(self.n * length / 8.0))

    def split(self, s_o: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points, weights, phi' and the hat's slope on both sides of s_o, without a cosine per entry."""
        return split(s_o, *self.side_rules(s_o), self.n, self.grading)
