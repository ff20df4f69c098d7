"""Tangents as band matrices with border rows and columns."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import Array, TangentFactors


class BandDerivatives:
    """Derivatives by q, v and a whose first n rows and columns are a band; the others are its border."""

    def __init__(self, n: int, size: int, b: int) -> None:
        """Zero at first; b : half-width of the band."""
        self.n = n
        self.b = b
        self.values = np.zeros((3, size, size))

    def add_blocks(self, slots: NDArray[np.intp], blocks: Array) -> None:
        """Add blocks (3, ..., m, m) of the rows and columns slots (..., m)."""
        size = self.values.shape[1]
        entries = slots[..., :, None] * size + slots[..., None, :]
        for values, block in zip(self.values.reshape(3, -1), blocks, strict=True):
            np.add.at(values, entries.ravel(), block.ravel())

    def drop_unknowns(self, at: NDArray[np.intp]) -> None:
        """Make rows and columns `at` zero; the solutions have zeros there."""
        self.values[:, at] = 0.0
        self.values[:, :, at] = 0.0
        self.dropped = at

    @cached_property
    def _band_border_and_corner(self) -> list[Array]:
        """The band, ab[:, i, b + j - i] = A[:, i, j], columns and rows of the border, and its corner."""
        n = self.n
        i = np.arange(n)[:, None]
        j = i + np.arange(-self.b, self.b + 1)
        ab = self.values[:, i, np.clip(j, 0, n - 1)]
        ab[:, (j < 0) | (j >= n)] = 0.0
        return [ab, self.values[:, :n, n:], self.values[:, n:, :n], self.values[:, n:, n:]]

    def factorise(self, c: TangentFactors) -> BandFactors:
        """The factors of c0 d/dq + c1 d/dv + c2 d/da, of what is not dropped."""
        from cablefem.elements.kernels.banded import factorise_in_place, solve_factored_in_place  # slow to load

        n = self.n
        weights: Any = np.array(c)
        ab, columns, rows, corner = (np.tensordot(weights, part, 1) for part in self._band_border_and_corner)
        of_border = self.dropped[self.dropped >= n] - n
        ab[self.dropped[self.dropped < n], self.b] = 1.0
        corner[of_border, of_border] = 1.0
        factorise_in_place(ab, None)
        from_border = columns.T.copy()
        for column in from_border:
            solve_factored_in_place(ab, None, column)
        schur = corner - rows @ from_border.T
        return BandFactors(ab, from_border, rows, np.linalg.inv(schur))


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
