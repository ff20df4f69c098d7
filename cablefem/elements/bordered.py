"""A band matrix with border rows and columns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
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

    def add(self, i: int, j: int, value: complex) -> None:
        n = self.n
        if i < n and j < n:
            self.ab[2 * self.b + i - j, j] += value
        elif i < n:
            self.columns[i, j - n] += value
        elif j < n:
            self.rows[i - n, j] += value
        else:
            self.corner[i - n, j - n] += value

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

    def set_diagonal(self, i: int, value: complex) -> None:
        """Make row i zero but for its diagonal."""
        if i < self.n:
            j, at = self._row(i)
            self.ab[at, j] = 0.0
            self.columns[i] = 0.0
        else:
            self.rows[i - self.n] = 0.0
            self.corner[i - self.n] = 0.0
        self.add(i, i, value)

    def clear_column(self, j: int) -> None:
        """Make column j zero but for its diagonal."""
        if j < self.n:
            diagonal = self.ab[2 * self.b, j]
            self.ab[:, j] = 0.0
            self.ab[2 * self.b, j] = diagonal
            self.rows[:, j] = 0.0
        else:
            diagonal = self.corner[j - self.n, j - self.n]
            self.columns[:, j - self.n] = 0.0
            self.corner[:, j - self.n] = 0.0
            self.corner[j - self.n, j - self.n] = diagonal

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
