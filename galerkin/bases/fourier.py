"""Sines (33)-(34): the paper's first basis."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from scipy.special import roots_legendre


@lru_cache(maxsize=32)
def _unit_gauss(n: int) -> tuple[np.ndarray, np.ndarray]:
    """n Gauss points and weights on [0, 1]."""
    x, w = roots_legendre(n)
    return 0.5 * (1.0 + x), 0.5 * w


@lru_cache(maxsize=32)
def _wavenumbers(n: int) -> np.ndarray:
    """k pi, (n,), read-only."""
    k = np.pi * np.arange(1, n + 1)
    k.flags.writeable = False
    return k


@njit(cache=True)
def _slopes(c1, s1, out):
    """out[k - 1] = k pi cos(k pi s) by turning (cos, sin) k times by pi s, given cos(pi s) and sin(pi s); out (n, n_s).

    Each turn adds a rounding to the angle: k eps after k of them, no more than rounding the argument k pi s costs.
    """
    c, s = c1.copy(), s1.copy()
    for k in range(out.shape[0]):
        for q in range(c.size):
            out[k, q] = (k + 1) * np.pi * c[q]
            c[q], s[q] = c[q] * c1[q] - s[q] * s1[q], s[q] * c1[q] + c[q] * s1[q]


@njit(cache=True)
def _toeplitz_hankel(total, by_slope, out):
    """j k pi^2/2 (c_|j-k| + c_(j+k)), j, k = 1 .. n, into out_ajbk of each c_ab, m = 0 .. 2 n; out (m, n, m, n).

    total (m, m) : sum_q f_q.  by_slope (2, m, m, n) : sum_q f_q k pi cos(k x_q), and the same of f_q cos(n x_q),
    which gives c_(n+m) = 2 sum_q f_q cos(n x_q) cos(m x_q) - c_(n-m).
    """
    n = out.shape[1]
    c = np.empty(4 * n + 1)  # c_|m|, m = -2n .. 2n
    for a in range(out.shape[0]):
        for b in range(out.shape[0]):
            c[2 * n] = total[a, b]
            for m in range(1, n + 1):
                c[2 * n + m] = c[2 * n - m] = by_slope[0, a, b, m - 1] / (m * np.pi)
            for m in range(1, n + 1):
                c[3 * n + m] = c[n - m] = 2.0 * by_slope[1, a, b, m - 1] / (m * np.pi) - c[3 * n - m]
            for j in range(1, n + 1):
                minus, plus, row = c[2 * n - j :], c[2 * n + j :], out[a, j - 1, b]
                for k in range(1, n + 1):
                    row[k - 1] = (0.5 * np.pi**2 * j) * k * (minus[k] + plus[k])


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

    @property
    def smooth(self) -> bool:
        """Sines have every derivative."""
        return True

    @property
    def wavenumbers(self) -> np.ndarray:
        """k pi, (n,)."""
        return _wavenumbers(self.n)

    def values(self, s: np.ndarray) -> np.ndarray:
        """sin(k pi s), (n_s, n)."""
        return np.sin(np.multiply.outer(s, self.wavenumbers))

    def d1(self, s: np.ndarray) -> np.ndarray:
        """k pi cos(k pi s), (n_s, n)."""
        return self.wavenumbers * np.cos(np.multiply.outer(s, self.wavenumbers))

    def d1_into(self, s: np.ndarray, out: np.ndarray) -> None:
        """k pi cos(k pi s) into `out`, (n, n_s), without a cosine per entry."""
        _slopes(np.cos(np.pi * s), np.sin(np.pi * s), out)

    def d2(self, s: np.ndarray) -> np.ndarray:
        """-(k pi)^2 sin(k pi s), (n_s, n)."""
        return -(self.wavenumbers**2) * self.values(s)

    def primitive1(self, s: np.ndarray) -> np.ndarray:
        """-cos(k pi s)/(k pi), (n_s, n)."""
        return -np.cos(np.multiply.outer(s, self.wavenumbers)) / self.wavenumbers

    def primitive2(self, s: np.ndarray) -> np.ndarray:
        """-sin(k pi s)/(k pi)^2, (n_s, n)."""
        return -self.values(s) / self.wavenumbers**2

    def gram_into(self, table: np.ndarray, f: np.ndarray, out: np.ndarray) -> None:
        """By c_m = sum_q f_q cos(m pi s_q): phi_j' phi_k' = j k pi^2/2 (cos((j-k) x) + cos((j+k) x)), x = pi s.

        The table holds the cosines up to m = n; cos((n+m) x) = 2 cos(n x) cos(m x) - cos((n-m) x) gives the others.
        """
        both = np.array([f, f * (table[-1] / (self.n * np.pi))])
        by_slope = (both.reshape(-1, table.shape[1]) @ table.T).reshape(*both.shape[:3], self.n)
        _toeplitz_hankel(f.sum(axis=-1), by_slope, out)

    def mass(self) -> np.ndarray:
        """int phi_m phi_n ds = 1/2 on the diagonal."""
        return 0.5 * np.eye(self.n)

    def stiffness(self) -> np.ndarray:
        """int phi_m' phi_n' ds = (n pi)^2/2 on the diagonal."""
        return np.diag(0.5 * self.wavenumbers**2)

    def integral(self) -> np.ndarray:
        """int phi_k ds = (1 - (-1)^k)/(k pi)."""
        k = np.arange(1, self.n + 1)
        return (k % 2) * 2.0 / self.wavenumbers

    def quadrature(self) -> tuple[np.ndarray, np.ndarray]:
        """2 n + 40 Gauss points on the cable."""
        x, w = _unit_gauss(2 * self.n + 40)
        return x.copy(), w.copy()

    def quadrature_on(self, a: float, b: float) -> tuple[np.ndarray, np.ndarray]:
        """2 n + 20 Gauss points on [a, b]."""
        x, w = _unit_gauss(2 * self.n + 20)
        return a + (b - a) * x, (b - a) * w
