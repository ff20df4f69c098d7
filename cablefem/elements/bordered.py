"""Tangents as band matrices with border rows and columns."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import Array, TangentFactors

Indices = Any


class BandDerivatives:
    """Derivatives by q, v and a: band matrices of n unknowns with border rows and columns; numbers count through."""

    def __init__(self, n: int, border: int, b: int) -> None:
        """Zero at first; border : number K of its rows;  b : half-width of the band."""
        self.n = n
        self.b = b
        self.ab = np.zeros((3, n, 2 * b + 1))  # ab[:, i, b + j - i] = A[:, i, j]
        self.columns = np.zeros((3, n, border))
        self.rows = np.zeros((3, border, n))
        self.corner = np.zeros((3, border, border))

    def _in_band(self, i: Indices, j: Indices) -> tuple[Indices, Indices, Indices]:
        """Where `ab` has the entries (i, j)."""
        return slice(None), i, self.b + j - i

    def add_entry(self, row: int, column: int, by_q: float, by_v: float = 0.0, by_a: float = 0.0) -> None:
        """Add one entry inside the band or in the corner."""
        values = by_q, by_v, by_a
        if row < self.n:
            self.ab[self._in_band(row, column)] += values
        else:
            self.corner[:, row - self.n, column - self.n] += values

    def add_row(self, row: int, values: Array) -> None:
        """Add a full row (3, n + K), of which what the matrices do not hold is zero."""
        n = self.n
        if row < n:
            j = self._columns_in_band(row)
            self.ab[self._in_band(row, j)] += values[:, j]
            self.columns[:, row] += values[:, n:]
        else:
            self.rows[:, row - n] += values[:, :n]
            self.corner[:, row - n] += values[:, n:]

    def _columns_in_band(self, i: int) -> NDArray[np.intp]:
        """Numbers within the band beside i < n."""
        return np.arange(max(0, i - self.b), min(self.n, i + self.b + 1))

    def add_multiple_of_row(self, source: int, border_row: int, factor: float = 1.0) -> None:
        """Add a factor times row `source`, of the band or of the border, to a border row."""
        to = border_row - self.n
        if source >= self.n:
            self.rows[:, to] += factor * self.rows[:, source - self.n]
            self.corner[:, to] += factor * self.corner[:, source - self.n]
            return
        j = self._columns_in_band(source)
        self.rows[:, to, j] += factor * self.ab[self._in_band(source, j)]
        self.corner[:, to] += factor * self.columns[:, source]

    def add_multiple_of_column(self, source: int, border_column: int, factor: float) -> None:
        """Add a factor times column `source` < n to a border column."""
        to = border_column - self.n
        i = self._columns_in_band(source)
        self.columns[:, i, to] += factor * self.ab[self._in_band(i, source)]
        self.corner[:, :, to] += factor * self.rows[:, :, source]

    def let_unknown_follow_previous(self, j: int, factor: float) -> None:
        """Let unknown j < n follow j - 1: add its row and its column to those before, times the factor."""
        i = np.arange(max(0, j - self.b), min(self.n, j + self.b))
        self.ab[self._in_band(j - 1, i)] += factor * self.ab[self._in_band(j, i)]
        self.columns[:, j - 1] += factor * self.columns[:, j]
        self.ab[self._in_band(i, j - 1)] += factor * self.ab[self._in_band(i, j)]
        self.rows[:, :, j - 1] += factor * self.rows[:, :, j]

    def drop_unknowns(self, at: NDArray[np.intp]) -> None:
        """Make rows and columns `at` zero; the solutions have zeros there."""
        inner = self.dropped = at[at < self.n]
        border = self.dropped_of_border = at[at >= self.n] - self.n
        i = inner[:, None] + np.arange(-self.b, self.b + 1)
        j = np.broadcast_to(inner[:, None], i.shape)
        inside = (i >= 0) & (i < self.n)
        self.ab[self._in_band(i[inside], j[inside])] = 0.0
        self.ab[:, inner] = 0.0
        self.columns[:, inner] = 0.0
        self.columns[:, :, border] = 0.0
        self.rows[:, :, inner] = 0.0
        self.rows[:, border] = 0.0
        self.corner[:, border] = 0.0
        self.corner[:, :, border] = 0.0

    def factorise(self, c: TangentFactors) -> BandFactors:
        """The factors of c0 d/dq + c1 d/dv + c2 d/da, of what is not dropped."""
        from cablefem.elements.kernels.banded import factorise_in_place, solve_factored_in_place  # slow to load

        parts = (self.ab, self.columns, self.rows, self.corner)
        ab, columns, rows, corner = (_weighted_sum(np.array(c), part) for part in parts)
        ab[self.dropped, self.b] = 1.0
        corner[self.dropped_of_border, self.dropped_of_border] = 1.0
        factorise_in_place(ab, None)
        from_border = columns.T.copy()
        for column in from_border:
            solve_factored_in_place(ab, None, column)
        schur = corner - rows @ from_border.T
        return BandFactors(ab, from_border, rows, np.linalg.inv(schur))


def _weighted_sum(weights: Any, arrays: Array) -> Any:
    """Sum of the arrays (3, ...) times real or complex weights (3,), whose parts are multiplied as real numbers."""
    parts = weights.view(float).reshape(3, -1)
    sums = arrays.reshape(3, -1).T @ parts  # (entries, 1 or 2)
    return sums.view(weights.dtype).reshape(arrays.shape[1:])


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
