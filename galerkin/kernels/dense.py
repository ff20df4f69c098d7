"""Dense products and solutions by numba's entries to BLAS and LAPACK; np.dot compiles slowly.

Arrays in C order are transposed ones for these libraries.
"""

import math
from typing import Any

import numpy as np
from numba import types
from numba.np.linalg import F_INT_nbtype, F_INT_nptype

from galerkin.law import inner

_real = types.CPointer(types.float64)
_any = types.voidptr
_size = types.intp
_char = types.char
_gemm: Any = types.ExternalFunction(
    "numba_xxgemm",
    types.intc(_char, _char, _char, _size, _size, _size, _any, _any, _size, _any, _size, _any, _any, _size),
)
_gesv: Any = types.ExternalFunction(
    "numba_xgesv", types.intc(_char, _size, _size, _real, _size, types.CPointer(F_INT_nbtype), _real, _size)
)
DOUBLE = ord("d")
PLAIN = ord("n")
TRANSPOSED = ord("t")


@inner
def multiply(a, b, flip, out):
    """Set out (m, n) to a b, or where `flip` to a b^T."""
    if not (a.flags.c_contiguous and b.flags.c_contiguous and out.flags.c_contiguous):
        raise ValueError("arrays in C order are wanted")
    factors = np.empty(2)
    factors[0] = 1.0
    factors[1] = 0.0
    m = a.shape[0]
    k = a.shape[1]
    n = out.shape[1]
    one = factors.ctypes
    zero = factors[1:].ctypes
    way = TRANSPOSED if flip else PLAIN
    _gemm(DOUBLE, way, PLAIN, n, m, k, one, b.ctypes, b.shape[1], a.ctypes, k, zero, out.ctypes, n)


@inner
def solve_rows(K, n, x, count):
    """Overwrite `count` rows of x (n,) by K[:n, :n]^-1 times them, by NaN if K is singular."""
    columns = np.empty((n, n))
    pivots = np.empty(n, dtype=F_INT_nptype)
    for i in range(n):
        for j in range(n):
            columns[j, i] = K[i, j]
    if _gesv(DOUBLE, n, count, columns.ctypes, n, pivots.ctypes, x.ctypes, n) != 0:
        x[:] = math.nan
