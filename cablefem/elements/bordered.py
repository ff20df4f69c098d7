"""A band matrix with border rows and columns."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import Array

Indices = Any


class BandMatrix:
    """A band matrix of n unknowns with border rows and columns; numbers count through."""

    def __init__(self, n: int, border: int, b: int, dtype: Any) -> None:
        """Zero at first; border : number K of its rows;  b : half-width of the band."""
        self.n = n
        self.b = b
        self.ab = np.zeros((n, 2 * b + 1), dtype)  # ab[i, b + j - i] = A[i, j]
        self.columns = np.zeros((n, border), dtype)
        self.rows = np.zeros((border, n), dtype)
        self.corner = np.zeros((border, border), dtype)

    def _in_band(self, i: Indices, j: Indices) -> tuple[Indices, Indices]:
        """Where `ab` has the entries (i, j)."""
        return i, self.b + j - i

    def add_entry(self, row: int, column: int, value: complex) -> None:
        """Add one entry inside the band or in the corner."""
        if row < self.n:
            self.ab[self._in_band(row, column)] += value
        else:
            self.corner[row - self.n, column - self.n] += value

    def add_row(self, row: int, values: Array) -> None:
        """Add a full row (n + K,), of which what the matrix does not hold is zero."""
        n = self.n
        if row < n:
            j = self._columns_in_band(row)
            self.ab[self._in_band(row, j)] += values[j]
            self.columns[row] += values[n:]
        else:
            self.rows[row - n] += values[:n]
            self.corner[row - n] += values[n:]

    def _columns_in_band(self, i: int) -> NDArray[np.intp]:
        """Numbers within the band beside i < n."""
        return np.arange(max(0, i - self.b), min(self.n, i + self.b + 1))

    def add_multiple_of_row(self, source: int, border_row: int, factor: complex = 1.0) -> None:
        """Add a factor times row `source`, of the band or of the border, to a border row."""
        to = border_row - self.n
        if source >= self.n:
            self.rows[to] += factor * self.rows[source - self.n]
            self.corner[to] += factor * self.corner[source - self.n]
            return
        j = self._columns_in_band(source)
        self.rows[to, j] += factor * self.ab[self._in_band(source, j)]
        self.corner[to] += factor * self.columns[source]

    def add_multiple_of_column(self, source: int, border_column: int, factor: complex) -> None:
        """Add a factor times column `source` < n to a border column."""
        to = border_column - self.n
        i = self._columns_in_band(source)
        self.columns[i, to] += factor * self.ab[self._in_band(i, source)]
        self.corner[:, to] += factor * self.rows[:, source]

    def let_unknown_follow_previous(self, j: int, factor: float) -> None:
        """Let unknown j < n follow j - 1: add its row and its column to those before, times the factor."""
        i = np.arange(max(0, j - self.b), min(self.n, j + self.b))
        self.ab[self._in_band(j - 1, i)] += factor * self.ab[self._in_band(j, i)]
        self.columns[j - 1] += factor * self.columns[j]
        self.ab[self._in_band(i, j - 1)] += factor * self.ab[self._in_band(i, j)]
        self.rows[:, j - 1] += factor * self.rows[:, j]

    def fix_unknowns_at_zero(self, at: NDArray[np.intp]) -> None:
        """Make rows and columns `at` zero but for ones on the diagonal: these unknowns drop out."""
        inner = at[at < self.n]
        border = at[at >= self.n] - self.n
        i = inner[:, None] + np.arange(-self.b, self.b + 1)
        j = np.broadcast_to(inner[:, None], i.shape)
        inside = (i >= 0) & (i < self.n)
        self.ab[self._in_band(i[inside], j[inside])] = 0.0
        self.ab[inner] = 0.0
        self.ab[inner, self.b] = 1.0
        self.columns[inner] = 0.0
        self.columns[:, border] = 0.0
        self.rows[:, inner] = 0.0
        self.rows[border] = 0.0
        self.corner[border] = 0.0
        self.corner[:, border] = 0.0
        self.corner[border, border] = 1.0

    def factorise_in_place(self) -> BandFactors:
        """Return the factors; the band is overwritten."""
        from cablefem.elements.kernels.banded import factorise_in_place, solve_factored_in_place  # slow to load

        factorise_in_place(self.ab, None)
        from_border = self.columns.T.copy()
        for column in from_border:
            solve_factored_in_place(self.ab, None, column)
        schur = self.corner - self.rows @ from_border.T
        return BandFactors(self.ab, from_border, self.rows, np.linalg.inv(schur))


class BandFactors(NamedTuple):
    """Of a bordered band."""

    band: Any  # (n, 2 b + 1) see `kernels.banded`
    from_border: Any  # (K, n)
    rows: Any  # (K, n)
    inverse: Any  # (K, K)

    def __call__(self, b: Array) -> Array:
        """The solution for a right-hand side."""
        from cablefem.elements.segment_kernels.march import solve_bordered_in_place  # slow to load

        x = b.astype(self.band.dtype)
        solve_bordered_in_place(self, x)
        return x
