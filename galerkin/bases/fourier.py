"""Sines (33)-(34): the paper's first basis."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import roots_legendre

from galerkin.law import compiled


@lru_cache(maxsize=256)
def _unit_gauss(n: int) -> np.ndarray:
    """n Gauss points and weights on [0, 1], (2, n)."""
    x, w = roots_legendre(n)
    return np.array([0.5 * (1.0 + x), 0.5 * w])


@compiled
def values_at(s, n):
    """`Fourier.at`."""
    out = np.empty((5, n))
    for k in range(n):
        wave = (k + 1) * math.pi
        c, sn = math.cos(wave * s), math.sin(wave * s)
        out[0, k], out[1, k], out[2, k] = sn, wave * c, -wave * wave * sn
        out[3, k], out[4, k] = -c / wave, -sn / (wave * wave)
    return out


@compiled
def split(s_o, behind, ahead, n):
    """`Fourier.split` for rules (2, m) on [0, 1] of both sides: k pi cos(k pi s) by turning (cos, sin) k times by pi s.

    Each turn adds a rounding to the angle: k eps after k of them, no more than rounding the argument k pi s costs.
    """
    m, both = behind.shape[1], behind.shape[1] + ahead.shape[1]
    s, weights, phi = np.empty(both), np.empty(both), np.empty((n + 1, both))
    for q in range(m):
        s[q], weights[q] = s_o * behind[0, q], s_o * behind[1, q]
    for q in range(both - m):
        s[m + q], weights[m + q] = s_o + (1.0 - s_o) * ahead[0, q], (1.0 - s_o) * ahead[1, q]
    c1, s1, c, sn = np.empty(both), np.empty(both), np.empty(both), np.empty(both)
    for q in range(both):
        c1[q] = c[q] = math.cos(math.pi * s[q])
        s1[q] = sn[q] = math.sin(math.pi * s[q])
    for k in range(n):
        wave, row = (k + 1) * math.pi, phi[k]
        for q in range(both):
            row[q] = wave * c[q]
            c[q], sn[q] = c[q] * c1[q] - sn[q] * s1[q], sn[q] * c1[q] + c[q] * s1[q]
    for q in range(both):
        phi[n, q] = 1.0 / s_o if q < m else -1.0 / (1.0 - s_o)
    return s, weights, phi


@dataclass(frozen=True, slots=True)
class Fourier:
    """phi_k(s) = sin(k pi s), k = 1 .. n: every integral in closed form, no locality.

    Gauss points: a product of two highest derivatives is cos(2 n pi s), which Gauss' rule integrates to rounding with
    about n pi/2 points plus a margin growing like n^(1/3); the strain multiplies a few more factors, hence
    2 n + 40. A side of the mass may be nearly the whole cable, so its count depends on n, not on its length
    (n + 12 points a side destroy the path at n = 60).
    """

    n: int

    def __post_init__(self) -> None:
        if self.n < 1:
            raise ValueError(f"Fourier.n must be at least 1, got {self.n!r}")

    smooth = harmonic = True

    @property
    def wavenumbers(self) -> np.ndarray:
        """k pi, (n,)."""
        return np.pi * np.arange(1, self.n + 1)

    def at(self, s: float) -> np.ndarray:
        """phi, phi', phi'' and both primitives at one s, (5, n)."""
        return values_at(s, self.n)

    def phi(self, s: np.ndarray, m: int = 0) -> np.ndarray:
        """The m-th derivative of sin(k pi s), (n_s, n); primitives for m < 0."""
        x, sign = np.multiply.outer(s, self.wavenumbers), (1.0, 1.0, -1.0, -1.0)[m % 4]
        return sign * self.wavenumbers**m * (np.cos(x) if m % 2 else np.sin(x))

    def mass(self) -> np.ndarray:
        """int phi_m phi_n ds = 1/2 on the diagonal."""
        return 0.5 * np.eye(self.n)

    def stiffness(self) -> np.ndarray:
        """int phi_m' phi_n' ds = (n pi)^2/2 on the diagonal."""
        return np.diag(0.5 * self.wavenumbers**2)

    def integral(self) -> np.ndarray:
        """int phi_k ds = (1 - (-1)^k)/(k pi)."""
        return np.arange(1, self.n + 1) % 2 * 2.0 / self.wavenumbers

    def quadrature(self) -> tuple[np.ndarray, np.ndarray]:
        """2 n + 40 Gauss points on the cable."""
        x, w = _unit_gauss(2 * self.n + 40)
        return x, w

    def side_rule(self, length: float) -> np.ndarray:
        """Gauss points and weights on [0, 1] for a piece of this length, (2, m), m in steps of 16."""
        return _unit_gauss(20 + 16 * math.ceil(self.n * length / 8.0))

    def split(self, s_o: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points, weights, phi' and the hat's slope on both sides of s_o, without a cosine per entry."""
        return split(s_o, self.side_rule(s_o), self.side_rule(1.0 - s_o), self.n)
