"""Dense products and solutions by BLAS and LAPACK, through what numba has of them for its own np.dot and np.linalg.

Not by `get_cython_function_address` of scipy's: what holds such an address cannot be cached.
Called directly: what numba makes of np.dot and np.linalg.solve takes seconds to compile, for its tests and messages.
Arrays are in C order; column by column, as the libraries read them, they are their transposes.
"""

import math
from typing import Any

import numpy as np
from numba import types
from numba.np.linalg import F_INT_nbtype, F_INT_nptype

from galerkin.law import compiled

_real, _single, _any = types.CPointer(types.float64), types.CPointer(types.float32), types.voidptr
_size, _char = types.intp, types.char
_gemm: Any = types.ExternalFunction(
    "numba_xxgemm",
    types.intc(
        _char, _char, _char, _size, _size, _size, _any, _any, _size, _any, _size, _any, _any, _size
    ),
)  # fmt: skip
_gesv: Any = types.ExternalFunction(
    "numba_xgesv", types.intc(_char, _size, _size, _real, _size, types.CPointer(F_INT_nbtype), _real, _size)
)
_potrf: Any = types.ExternalFunction("numba_xxpotrf", types.intc(_char, _char, _size, _single, _size))
SINGLE, DOUBLE, PLAIN, TRANSPOSED, LOWER = ord("s"), ord("d"), ord("n"), ord("t"), ord("l")


@compiled
def multiply(a, b, flip, out):
    """Set out (m, n) to a b, or where `flip` to a b^T; a (m, k), all in double or all in single precision."""
    if not (a.flags.c_contiguous and b.flags.c_contiguous and out.flags.c_contiguous):
        raise ValueError("arrays in C order are wanted")
    if not (a.itemsize == out.itemsize and b.itemsize == out.itemsize):
        raise ValueError("arrays of one precision are wanted")
    factors = np.empty(2, out.dtype)
    factors[0], factors[1] = 1.0, 0.0
    m, k, n = a.shape[0], a.shape[1], out.shape[1]
    kind, way = SINGLE if out.itemsize == 4 else DOUBLE, TRANSPOSED if flip else PLAIN
    _gemm(
        kind, way, PLAIN, n, m, k, factors.ctypes, b.ctypes, b.shape[1], a.ctypes, k, factors[1:].ctypes, out.ctypes,
        n,
    )  # fmt: skip


@compiled
def solve(K, b, x):
    """Set x (n,) to K^-1 b, to NaN if K is singular."""
    n = b.size
    columns, pivots = np.empty((n, n)), np.empty(n, dtype=F_INT_nptype)
    for i in range(n):
        x[i] = b[i]
        for j in range(n):
            columns[j, i] = K[i, j]
    if _gesv(DOUBLE, n, 1, columns.ctypes, n, pivots.ctypes, x.ctypes, n) != 0:
        x[:] = math.nan


@compiled
def halve(S, half):
    """Set half (n, n) to L^-1, S = L L^T, in single precision; return whether S is positive definite.

    S : in single precision, its upper triangle; receives L^T.
    """
    n = S.shape[0]
    if _potrf(SINGLE, LOWER, n, S.ctypes, n) != 0:
        return False
    for i in range(n):
        row = half[i]
        row[:] = 0.0
        for j in range(i):
            factor, other = S[j, i], half[j]
            for k in range(j + 1):
                row[k] -= factor * other[k]
        over = np.float32(1.0) / S[i, i]
        for k in range(i):
            row[k] *= over
        row[i] = over
    return True
