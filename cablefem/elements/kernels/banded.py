"""Factors and solutions of banded matrices."""

import math
from typing import Any, NamedTuple

from cablefem.elements.kernels import inner

KEEP = 0.1  # a diagonal pivot of at least this part of the column's largest stays


class Tangent(NamedTuple):
    """A banded tangent and its factors."""

    ab: Any  # (n_dof, 3 b + 1) ab[i, b + j - i] = A[i, j], half-width b; the last b columns take fill-in
    pivots: Any  # (2, n_dof) see `factorise`


@inner
def size_of(x):
    """Return |Re x| + |Im x|, as LAPACK does."""
    return abs(x.real) + abs(x.imag)


@inner
def factorise(ab, pivots, pairs):
    """Factorise a banded matrix in place, P A = L U; return whether it is regular.

    Threshold pivoting (Duff, Erisman & Reid 1986, section 5.2) keeps rows short.

    pairs : whether rows come in pairs, two fields of a node.
    pivots : (2, n) row exchanged, last column of each row of U; of blocks the last node.
        If there are blocks, pivots[0, 0] is minus their number.
    """
    n, width = ab.shape
    band = (width - 1) // 3
    first = 2 * eliminated(ab, pivots) if pairs else 0
    if first == n:
        return True
    for i in range(first, n):
        last = min(n - 1, i + band)
        while last > i and ab[i, band + last - i] == 0.0:
            last -= 1
        pivots[1, i] = last
    for i in range(first, n):
        last = min(n - 1, i + band)
        largest, at = size_of(ab[i, band]), i
        own = largest
        for k in range(i + 1, last + 1):
            size = size_of(ab[k, band + i - k])
            if size > largest:
                largest, at = size, k
        if not (largest > 0.0 and largest < math.inf):
            return False
        if own >= KEEP * largest:
            at = i
        pivots[0, i] = at
        if at != i:
            end = max(pivots[1, i], pivots[1, at])
            for j in range(i, end + 1):
                x = ab[i, band + j - i]
                ab[i, band + j - i] = ab[at, band + j - at]
                ab[at, band + j - at] = x
            pivots[1, i], pivots[1, at] = pivots[1, at], pivots[1, i]
        reach = pivots[1, i]
        inverse = 1.0 / ab[i, band]
        for k in range(i + 1, last + 1):
            below = ab[k, band + i - k]
            if below != 0.0:
                factor = below * inverse
                ab[k, band + i - k] = factor
                shift = band - k
                for j in range(i + 1, reach + 1):
                    ab[k, shift + j] -= factor * ab[i, band - i + j]
                if reach > pivots[1, k]:
                    pivots[1, k] = reach
    return True


@inner
def empty(ab, p, k):
    band, i, j = (ab.shape[1] - 1) // 3, 2 * p, 2 * k
    at, back = band + j - i, band + i - j
    upper = ab[i, at] == 0.0 and ab[i, at + 1] == 0.0 and ab[i + 1, at - 1] == 0.0 and ab[i + 1, at] == 0.0
    return (
        upper
        and ab[j, back] == 0.0
        and ab[j, back + 1] == 0.0
        and ab[j + 1, back - 1] == 0.0
        and ab[j + 1, back] == 0.0
    )


@inner
def eliminated(ab, pivots):
    """Eliminate blocks of two rows while no factor is above 1 / KEEP; return how many.

    A block becomes its inverse.
    """
    nodes, band = ab.shape[0] // 2, (ab.shape[1] - 1) // 3
    for p in range(nodes):
        far = min(nodes - 1, p + band // 2)
        while far > p and empty(ab, p, far):
            far -= 1
        pivots[1, 2 * p] = far
    done = nodes
    for p in range(nodes):
        i, far = 2 * p, pivots[1, 2 * p]
        a, b, c, d = ab[i, band], ab[i, band + 1], ab[i + 1, band - 1], ab[i + 1, band]
        determinant = a * d - b * c
        if determinant == 0.0:  # complex division by zero raises
            done = p
            break
        inverse = 1.0 / determinant
        a, b, c, d = d * inverse, -b * inverse, -c * inverse, a * inverse
        strong = size_of(a) + size_of(b) + size_of(c) + size_of(d) < math.inf
        for k in range(p + 1, far + 1):
            j, at = 2 * k, band + i - 2 * k
            e, f, g, h = ab[j, at], ab[j, at + 1], ab[j + 1, at - 1], ab[j + 1, at]
            largest = max(size_of(e * a + f * c), size_of(e * b + f * d))
            strong = strong and KEEP * max(largest, max(size_of(g * a + h * c), size_of(g * b + h * d))) <= 1.0
        if not strong:
            done = p
            break
        ab[i, band], ab[i, band + 1], ab[i + 1, band - 1], ab[i + 1, band] = a, b, c, d
        for k in range(p + 1, far + 1):
            j, at = 2 * k, band + i - 2 * k
            e, f, g, h = ab[j, at], ab[j, at + 1], ab[j + 1, at - 1], ab[j + 1, at]
            e, f, g, h = e * a + f * c, e * b + f * d, g * a + h * c, g * b + h * d
            ab[j, at], ab[j, at + 1], ab[j + 1, at - 1], ab[j + 1, at] = e, f, g, h
            for m in range(p + 1, far + 1):
                o, to = band + 2 * (m - p), band + 2 * (m - k)
                w, x, y, z = ab[i, o], ab[i, o + 1], ab[i + 1, o - 1], ab[i + 1, o]
                ab[j, to] -= e * w + f * y
                ab[j, to + 1] -= e * x + f * z
                ab[j + 1, to - 1] -= g * w + h * y
                ab[j + 1, to] -= g * x + h * z
            if far > pivots[1, j]:
                pivots[1, j] = far
    if done > 0:
        pivots[0, 0] = -done
    return done


@inner
def solve(ab, pivots, b):
    """Overwrite b (n,) with A^-1 b."""
    n, width = ab.shape
    band, nodes = (width - 1) // 3, max(0, -pivots[0, 0])
    for p in range(nodes):
        i = 2 * p
        u, v = b[i], b[i + 1]
        for k in range(p + 1, pivots[1, i] + 1):
            j, at = 2 * k, band + i - 2 * k
            b[j] -= ab[j, at] * u + ab[j, at + 1] * v
            b[j + 1] -= ab[j + 1, at - 1] * u + ab[j + 1, at] * v
    for i in range(2 * nodes, n):
        at = pivots[0, i]
        x = b[at]
        if at != i:
            b[at] = b[i]
            b[i] = x
        for k in range(i + 1, min(n, i + band + 1)):
            b[k] -= ab[k, band + i - k] * x
    for i in range(n - 1, 2 * nodes - 1, -1):
        x = b[i]
        for j in range(i + 1, pivots[1, i] + 1):
            x -= ab[i, band + j - i] * b[j]
        b[i] = x / ab[i, band]
    for p in range(nodes - 1, -1, -1):
        i = 2 * p
        u, v = b[i], b[i + 1]
        for k in range(p + 1, pivots[1, i] + 1):
            j, o = 2 * k, band + 2 * (k - p)
            u -= ab[i, o] * b[j] + ab[i, o + 1] * b[j + 1]
            v -= ab[i + 1, o - 1] * b[j] + ab[i + 1, o] * b[j + 1]
        b[i], b[i + 1] = ab[i, band] * u + ab[i, band + 1] * v, ab[i + 1, band - 1] * u + ab[i + 1, band] * v


# loops are faster than BLAS at this length


@inner
def dot(a, b):
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@inner
def copy(a, b):
    for i in range(a.size):
        b[i] = a[i]


@inner
def subtract(factor, a, b):
    """Subtract factor a from b."""
    for i in range(a.size):
        b[i] -= factor * a[i]


class Border(NamedTuple):
    lines: Any  # (3, n) column, row, and the column solved
    corner: Any  # (1,)


@inner
def times(operator, n_fields, rows, x, y):
    """Set y = A x in the rows (from, to); operator : (2 b + 1, n) diagonals of A."""
    half, n = operator.shape[0] // 2, operator.shape[1]
    y[:] = 0.0
    for d in range(operator.shape[0]):
        away = n_fields * (d - half)
        first, last = max(rows[0], -away), min(rows[1], n - away)
        of, near, to = operator[d, first:last], x[first + away : last + away], y[first:last]
        for i in range(to.size):  # contiguous slices: vectorised
            to[i] += of[i] * near[i]
