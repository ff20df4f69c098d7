"""Global bases on the cable."""

from typing import Protocol

import numpy as np

from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier


class Basis(Protocol):
    """Functions phi_1 .. phi_n of s/l on [0, 1] that vanish at both ends."""

    @property
    def n(self) -> int:
        """Number of independent functions."""

    @property
    def smooth(self) -> bool:
        """Whether phi'' exists, as (23) needs."""

    def at(self, s: float) -> np.ndarray:
        """phi, phi', phi'' (or 0) and two primitives at one s, (5, n)."""

    def phi(self, s: np.ndarray, m: int = 0) -> np.ndarray:
        """The m-th derivative of phi, (n_s, n); primitives for m < 0."""

    def split(self, s_o: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points and weights (n_q,) of both sides of s_o; phi' and the hat's slope, (n + 1, n_q)."""

    def mass(self) -> np.ndarray:
        """int phi_m phi_n ds."""

    def stiffness(self) -> np.ndarray:
        """int phi_m' phi_n' ds."""

    def integral(self) -> np.ndarray:
        """int phi_n ds."""

    def quadrature(self) -> tuple[np.ndarray, np.ndarray]:
        """Points and weights on [0, 1] for products of first derivatives."""
