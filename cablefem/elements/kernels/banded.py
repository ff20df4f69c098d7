"""Factors and solutions of banded matrices."""

import math
from typing import Any, NamedTuple

from cablefem.elements.kernels import compiled, inner
from cablefem.newmark import Array


class Tangent(NamedTuple):
    """A banded tangent with one more column and row, and their factors."""

    ab: Any  # (n, 2 b + 1) ab[i, b + j - i] = A[i, j], half-width b
    border: Any  # (3, n + 1) column with the corner last, row, and the column solved; or None


@compiled
def factorise_in_place(ab: Array, border: Array | None) -> None:
    """Overwrite a `Tangent` with its factors; those of a singular one are NaN."""
    factorise_band_in_place(ab)
    if border is None:
        return
    n = ab.shape[0]
    column = border[0]
    row = border[1]
    solved = border[2]
    for i in range(n):
        solved[i] = column[i]
    solve_factored_band_in_place(ab, solved)
    for i in range(n):
        column[n] -= row[i] * solved[i]
    if column[n] == 0.0:
        column[n] = math.nan


@inner
def factorise_band_in_place(ab: Array) -> None:
    """Overwrite a band with L, whose diagonal is 1, and U, whose diagonal is inverted.

    Rows are not exchanged: mass and taut cable give large diagonals.
    """
    n = ab.shape[0]
    band = ab.shape[1] // 2
    for i in range(n):
        inverse = 1.0 / ab[i, band] if ab[i, band] != 0.0 else math.nan
        ab[i, band] = inverse
        far = min(band, n - 1 - i)
        while far > 0 and ab[i, band + far] == 0.0 and ab[i + far, band - far] == 0.0:
            far -= 1
        for k in range(1, far + 1):
            factor = ab[i + k, band - k] * inverse
            ab[i + k, band - k] = factor
            for j in range(1, far + 1):
                ab[i + k, band - k + j] -= factor * ab[i, band + j]


@compiled
def solve_factored_in_place(factors: Array, border: Array | None, b: Array) -> Array:
    """Overwrite b with the solution, and return it; factors, border : of `factorise_in_place`.

    b without an entry for the border counts as 0 there.
    """
    solve_factored_band_in_place(factors, b)
    if border is None:
        return b
    n = factors.shape[0]
    row = border[1]
    solved = border[2]
    last = b[n] if b.size > n else 0.0 * b[0]
    for i in range(n):
        last -= row[i] * b[i]
    last /= border[0, n]
    for i in range(n):
        b[i] -= last * solved[i]
    if b.size > n:
        b[n] = last
    return b


@inner
def solve_factored_band_in_place(factors: Array, b: Array) -> None:
    """Overwrite b with the solution; factors : of `factorise_band_in_place`."""
    n = factors.shape[0]
    band = factors.shape[1] // 2
    for i in range(n):
        x = b[i]
        for k in range(min(band, i), 0, -1):  # the newest last: its wait is short
            x -= factors[i, band - k] * b[i - k]
        b[i] = x
    for i in range(n - 1, -1, -1):
        x = b[i]
        for k in range(min(band, n - 1 - i), 0, -1):
            x -= factors[i, band + k] * b[i + k]
        b[i] = x * factors[i, band]


@inner
def dot(a: Array, b: Array) -> float:
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@inner
def set_banded_product(operator: Array, rows: tuple[int, int], x: Array, y: Array) -> None:
    """Set y = A x in the rows (from, to), and 0 elsewhere; operator : (2 b + 1, n), every second diagonal of A."""
    half = operator.shape[0] // 2
    n = operator.shape[1]
    y[:] = 0.0
    for d in range(operator.shape[0]):
        away = 2 * (d - half)  # fields in turn
        first = max(rows[0], -away)
        last = min(rows[1], n - away)
        of = operator[d, first:last]
        near = x[first + away : last + away]
        to = y[first:last]
        for i in range(to.size):  # contiguous slices: vectorised
            to[i] += of[i] * near[i]
