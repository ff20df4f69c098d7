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
_getrf: Any = types.ExternalFunction(
    "numba_xxgetrf", types.intc(_char, _size, _size, _real, _size, types.CPointer(F_INT_nbtype))
)
DOUBLE = ord("d")
PLAIN = ord("n")
TRANSPOSED = ord("t")


@inner
def set_matrix_product(a: Any, b: Any, transpose_b: bool, out: Any) -> None:
    """Set out (m, n) to a b, or to a b^T; ValueError unless all are in C order."""
    if not (a.flags.c_contiguous and b.flags.c_contiguous and out.flags.c_contiguous):
        raise ValueError("arrays must be in C order")
    factors = np.empty(2)
    factors[0] = 1.0
    factors[1] = 0.0
    m = a.shape[0]
    k = a.shape[1]
    n = out.shape[1]
    one = factors.ctypes
    zero = factors[1:].ctypes
    b_order = TRANSPOSED if transpose_b else PLAIN
    _gemm(DOUBLE, b_order, PLAIN, n, m, k, one, b.ctypes, b.shape[1], a.ctypes, k, zero, out.ctypes, n)


@inner
def allocate_lu_factors(n: int) -> Any:
    """Memory for `set_lu_factors`: the columns of L and U (n, n), and the rows that change places (n,)."""
    return np.empty((n, n)), np.empty(n, dtype=F_INT_nptype)


@inner
def set_lu_factors(K: Any, factors: Any) -> None:
    """Set the factors of K (n, n), NaN if it is singular."""
    columns, pivots = factors
    n = pivots.size
    for j in range(n):
        for i in range(n):
            columns[j, i] = K[i, j]
    if _getrf(DOUBLE, n, n, columns.ctypes, n, pivots.ctypes) != 0:
        columns[0, 0] = math.nan


@inner
def solve_factored_in_place(factors: Any, x: Any) -> None:
    """Overwrite x (n,) by K^-1 x."""
    columns, pivots = factors
    n = pivots.size
    for i in range(n):
        other = pivots[i] - 1
        x[i], x[other] = x[other], x[i]
    for j in range(n):
        for i in range(j + 1, n):
            x[i] -= columns[j, i] * x[j]
    for j in range(n - 1, -1, -1):
        x[j] /= columns[j, j]
        for i in range(j):
            x[i] -= columns[j, i] * x[j]
