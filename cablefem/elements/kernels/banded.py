"""Banded matrices: factors, solutions, and those of a matrix that a uniform tension couples."""

import math
from typing import Any, NamedTuple

from cablefem.elements.kernels import compiled

KEEP = 0.1  # a diagonal pivot stays while it is at least this part of its column's largest: rows then keep their width


class Tangent(NamedTuple):
    """Workspace of a banded tangent and its factors; of the one-field models with `add_chord`'s increment."""

    ab: Any
    pivots: Any  # (2, n_dof) see `factorise`
    increment: Any  # (n_dof,) or empty
    coupled: Any


@compiled
def size_of(x):
    """Return |x|, of a complex number that of its parts together, as LAPACK does: no root."""
    return abs(x.real) + abs(x.imag)


@compiled
def factorise(ab, pivots):
    """Factorise a banded matrix in place, P A = L U, and return whether it is regular.

    Gaussian elimination with threshold pivoting (Duff, Erisman & Reid 1986, section 5.2): the tangents here are nearly
    always diagonally strong, and a row that keeps its place brings no new column in.  LAPACK's dgbtrf spends most of
    its time on calls for bands this narrow.

    pivots : (2, n); row exchanged with each row, and the last column that each row of U reaches.
    """
    n, width = ab.shape
    band = (width - 1) // 3
    for i in range(n):  # rows inside an element do not reach as far as the band
        last = min(n - 1, i + band)
        while last > i and ab[i, band + last - i] == 0.0:
            last -= 1
        pivots[1, i] = last
    for i in range(n):
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


@compiled
def solve(ab, pivots, b):
    """Overwrite b (n,) with A^-1 b, A as `factorise` left it."""
    n, width = ab.shape
    band = (width - 1) // 3
    for i in range(n):
        at = pivots[0, i]
        x = b[at]
        if at != i:
            b[at] = b[i]
            b[i] = x
        for k in range(i + 1, min(n, i + band + 1)):
            b[k] -= ab[k, band + i - k] * x
    for i in range(n - 1, -1, -1):
        x = b[i]
        for j in range(i + 1, pivots[1, i] + 1):
            x -= ab[i, band + j - i] * b[j]
        b[i] = x / ab[i, band]


# written out: a call of BLAS takes longer at this length, and numba compiles all that an assignment of arrays may raise


@compiled
def dot(a, b):
    """Return the scalar product."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled
def copy(a, b):
    """Set b to a."""
    for i in range(a.size):
        b[i] = a[i]


@compiled
def subtract(factor, a, b):
    """Take factor a off b."""
    for i in range(a.size):
        b[i] -= factor * a[i]


@compiled
def factorise_coupled(work, strength):
    """Factorise A + strength increment increment^T, A banded; return whether it is regular.

    Sherman & Morrison: a uniform tension increment couples all nodes through one vector.  The full cable has no such
    vector, its increment is empty.
    """
    regular = factorise(work.ab, work.pivots)
    if regular and work.increment.size > 0:
        copy(work.increment, work.coupled)
        solve(work.ab, work.pivots, work.coupled)
        share = strength / (1.0 + strength * dot(work.increment, work.coupled))
        for i in range(work.coupled.size):
            work.coupled[i] *= share
    return regular


@compiled
def solve_coupled(work, b):
    """Overwrite b (n,) with the solution for the matrix that `factorise_coupled` has left."""
    solve(work.ab, work.pivots, b)
    if work.increment.size > 0:
        subtract(dot(work.increment, b), work.coupled, b)
