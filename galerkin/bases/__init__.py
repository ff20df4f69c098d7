"""Global bases on the cable: functions of s in [0, 1] that vanish at both supports."""

from typing import Protocol

import numpy as np

from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier


class Basis(Protocol):
    """A set phi_1 .. phi_n on 0 <= s <= 1 with phi(0) = phi(1) = 0.

    s is the static arc length over the cable length.  Derivatives are with respect to s.
    """

    @property
    def n(self) -> int:
        """Number of (independent) functions."""

    @property
    def smooth(self) -> bool:
        """Whether phi'' exists at every s, as the centrifugal term of (23) needs."""

    def at(self, s: float) -> np.ndarray:
        """phi, phi', phi'' (0 where there is none) and two primitives at one s, (5, n)."""

    def phi(self, s: np.ndarray, m: int = 0) -> np.ndarray:
        """The m-th derivative of phi, (n_s, n); m = -1 and -2 are a primitive of phi and one of that."""

    def split(self, s_o: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points and weights of both sides of s_o, (n_q,), phi' and, last, the hat's slope, (n + 1, n_q)."""

    def mass(self) -> np.ndarray:
        """int phi_m phi_n ds, (n, n)."""

    def stiffness(self) -> np.ndarray:
        """int phi_m' phi_n' ds, (n, n)."""

    def integral(self) -> np.ndarray:
        """int phi_n ds, (n,)."""

    def quadrature(self) -> tuple[np.ndarray, np.ndarray]:
        """Points and weights on [0, 1] for products of first derivatives with smooth coefficients, each (n_q,)."""
