"""Sines (33)-(34): the paper's first basis."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import roots_legendre


@lru_cache(maxsize=32)
def _unit_gauss(n: int) -> tuple[np.ndarray, np.ndarray]:
    """n Gauss points and weights on [0, 1]."""
    x, w = roots_legendre(n)
    return 0.5 * (1.0 + x), 0.5 * w


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
        return np.pi * np.arange(1, self.n + 1)

    def values(self, s: np.ndarray) -> np.ndarray:
        """sin(k pi s), (n_s, n)."""
        return np.sin(np.multiply.outer(s, self.wavenumbers))

    def d1(self, s: np.ndarray) -> np.ndarray:
        """k pi cos(k pi s), (n_s, n)."""
        return self.wavenumbers * np.cos(np.multiply.outer(s, self.wavenumbers))

    def d2(self, s: np.ndarray) -> np.ndarray:
        """-(k pi)^2 sin(k pi s), (n_s, n)."""
        return -(self.wavenumbers**2) * self.values(s)

    def primitive1(self, s: np.ndarray) -> np.ndarray:
        """-cos(k pi s)/(k pi), (n_s, n)."""
        return -np.cos(np.multiply.outer(s, self.wavenumbers)) / self.wavenumbers

    def primitive2(self, s: np.ndarray) -> np.ndarray:
        """-sin(k pi s)/(k pi)^2, (n_s, n)."""
        return -self.values(s) / self.wavenumbers**2

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
