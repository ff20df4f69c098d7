"""A band matrix with border rows and columns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_lapack_funcs

from cablefem.newmark import Array


class Bordered:
    """A band matrix of n unknowns with border rows and columns; numbers count through."""

    def __init__(self, n: int, band: int, border: int, kind: type) -> None:
        self.n, self.b = n, band
        self.ab: Any = np.zeros((3 * band + 1, n), kind, order="F")  # as LAPACK's gbtrf
        self.columns: Any = np.zeros((n, border), kind)
        self.rows: Any = np.zeros((border, n), kind)
        self.corner: Any = np.zeros((border, border), kind)

    def add_diagonal(self, i: int, value: complex) -> None:
        if i < self.n:
            self.ab[2 * self.b, i] += value
        else:
            self.corner[i - self.n, i - self.n] += value

    def _row(self, i: int) -> tuple[Any, Any]:
        """Numbers of the columns of row i < n in the band, and their places in it."""
        j = np.arange(max(0, i - self.b), min(self.n, i + self.b + 1))
        return j, 2 * self.b + i - j

    def copy_row(self, to: int, i: int) -> None:
        """Copy row i to the border row `to`."""
        if i >= self.n:
            self.rows[to], self.corner[to] = self.rows[i - self.n], self.corner[i - self.n]
            return
        j, at = self._row(i)
        self.rows[to], self.corner[to] = 0.0, self.columns[i]
        self.rows[to, j] = self.ab[at, j]

    def fix(self, at: NDArray[np.intp]) -> None:
        """Make rows and columns `at` zero but for ones on the diagonal: these unknowns drop out."""
        inner, border = at[at < self.n], at[at >= self.n] - self.n
        j = inner[:, None] + np.arange(-self.b, self.b + 1)
        place = np.broadcast_to(np.arange(3 * self.b, self.b - 1, -1), j.shape)
        inside = (j >= 0) & (j < self.n)
        self.ab[place[inside], j[inside]] = 0.0
        self.ab[:, inner] = 0.0
        self.ab[2 * self.b, inner] = 1.0
        self.columns[inner], self.columns[:, border] = 0.0, 0.0
        self.rows[:, inner], self.rows[border] = 0.0, 0.0
        self.corner[border], self.corner[:, border] = 0.0, 0.0
        self.corner[border, border] = 1.0

    def factored(self) -> Callable[[Array], Array]:
        """The solution as a function of the right-hand side."""
        factor, substitute = get_lapack_funcs(("gbtrf", "gbtrs"), (self.ab,))
        lu, pivots, _ = factor(self.ab, self.b, self.b, overwrite_ab=True)
        beside = substitute(lu, self.b, self.b, self.columns, pivots)[0]
        schur = np.linalg.inv(self.corner - self.rows @ beside)

        def solve(b: Array) -> Array:
            inner = substitute(lu, self.b, self.b, b[: self.n], pivots)[0]
            border = schur @ (b[self.n :] - self.rows @ inner)
            return np.concatenate([inner - beside @ border, border])

        return solve
