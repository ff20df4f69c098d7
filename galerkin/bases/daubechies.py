"""Anti-derivatives of Daubechies wavelets (35)-(39) at any real s.

Relative errors are 1e-12 up to order 6.  Functions of higher orders are nearly dependent: 1e-11 at order 8.

Construction: Xu & Shann 1992; Chen, Hwang & Shih 1996.
With v(x) = [phi(x), phi(x + 1), ...] the refinement equation reads v(x) = T_d v(2x - d), d the first binary digit of x.
So v(x) is a product of T_0 and T_1 in the order of the digits.
Derivatives and primitives are sums over functions phi_m with masks 2 ((1 + z)/2)^(p-m) q(z).
"""

from dataclasses import dataclass
from functools import lru_cache
from math import comb, sqrt
from typing import Literal, NamedTuple

import numpy as np
import pywt
from scipy.linalg import solve_triangular, svd

from galerkin.law import compiled, inner

Reading = Literal["literal", "scaling", "shifted"]

BLOCK = 5  # binary digits taken at once
DIGIT_BLOCKS = 16  # 80 binary digits of the place within a cell
DEEPEST = -3  # phi_m for m = 1 .. -3


# --- the scaling function, once per order ----------------------------------------------------------------------


def _mask_factor_without_zeros(order: int) -> np.ndarray:
    """Return the factor q without zeros at z = -1 of h(z) = 2 ((1 + z)/2)^p q(z), shape (p,), from PyWavelets' filter.

    One Newton step takes q back to |q|^2 = sum_k binom(p-1+k, k) y^k, y = (2 - z - 1/z)/4 (Daubechies 1988).
    """
    p = order
    target = np.zeros(2 * p - 1)
    power = np.ones(1)
    for k in range(p):
        target[p - 1 - k : p + k] += comb(p - 1 + k, k) * power
        power = np.convolve(power, [-0.25, 0.5, -0.25])  # y z
    zeros = np.ones(1)
    for _ in range(p):
        zeros = np.convolve(zeros, [0.5, 0.5])
    convolution = np.array([np.convolve(2.0 * zeros, row) for row in np.eye(p)]).T
    h = sqrt(2.0) * np.array(pywt.Wavelet(f"db{p}").rec_lo)
    q = np.linalg.lstsq(convolution, h, rcond=None)[0]
    padded = np.pad(q, p)
    residual = np.empty(p)
    jacobian = np.empty((p, p))
    for k in range(p):
        residual[k] = target[p - 1 + k] - q[k:] @ q[: p - k]
        jacobian[k] = padded[p + k : 2 * p + k] + padded[p - k : 2 * p - k]
    return np.asarray(q + np.linalg.solve(jacobian, residual))


def _transition_matrix(mask: np.ndarray, digit: int) -> np.ndarray:
    """(T_d)_ij = h_(2i-j+d), h the mask."""
    n = mask.size - 1
    k = 2 * np.arange(n)[:, None] - np.arange(n) + digit
    return _taps_or_zero(mask, k)


def _taps_or_zero(mask: np.ndarray, k: np.ndarray) -> np.ndarray:
    """h_k of the mask, 0 where it has none."""
    last = mask.size - 1
    return np.where((k >= 0) & (k <= last), mask[np.clip(k, 0, last)], 0.0)


class _DyadicTable(NamedTuple):
    at_integers: np.ndarray  # v(0)
    blocks: np.ndarray  # transposed products T_d1 .. T_dBLOCK
    T: np.ndarray


class _MotherFunctions(NamedTuple):
    """Tables of one order."""

    h: np.ndarray  # phi(x) = sum h_k phi(2x - k)
    g: np.ndarray  # psi(x) = sum g_k phi(2x - k), g_k = (-1)^k h_(R-k)
    tables: dict[int, _DyadicTable]
    left: np.ndarray  # L of L L^T = int_0^inf phi(x-k) phi(x-l) dx, k, l = 1-R .. -1
    right: np.ndarray  # the same of int_-inf^0


def _cholesky_factors_of_cut_grams(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factors `left` and `right` of `_MotherFunctions`: gram matrices of shifts of phi that an end of the cable cuts.

    W = (H W H^T + B B^T)/2, H = taps that stay cut, B = taps inside; summed by doubling (Smith 1968).
    """
    R = mask.size - 1
    k = np.arange(1 - R, R) - 2 * np.arange(1 - R, 0)[:, None]  # t - 2 l
    taps = _taps_or_zero(mask, k)
    B = taps[:, R - 1 :]
    W = B @ B.T / 2
    step = taps[:, : R - 1] / sqrt(2.0)
    for _ in range(8):
        W = W + step @ W @ step.T
        step = step @ step
    return np.linalg.cholesky(W), np.linalg.cholesky(np.eye(R - 1) - W)


@lru_cache(maxsize=16)
def _mother_functions(order: int) -> _MotherFunctions:
    """The tables of an order."""
    p = order
    R = 2 * p - 1
    q = _mask_factor_without_zeros(p)
    tables = {}
    for m in range(DEEPEST, 2 if p > 2 else 1):
        mask = 2.0 * q
        for _ in range(p - m):
            mask = np.convolve(mask, [0.5, 0.5])
        if m == 0:
            h = mask
        tables[m] = _dyadic_table(mask)
    left, right = _cholesky_factors_of_cut_grams(h)
    g = (-1.0) ** np.arange(R + 1) * h[::-1]
    return _MotherFunctions(h, g, tables, left, right)


def _dyadic_table(mask: np.ndarray) -> _DyadicTable:
    """Return the tables of the function with this mask."""
    n = mask.size - 1
    T = np.array([_transition_matrix(mask, 0), _transition_matrix(mask, 1)])
    system = T[0] - np.eye(n)  # v(0) = T_0 v(0) has a factor free: sum v(0) = 1 replaces the first row
    system[0] = 1.0
    at_integers = np.linalg.solve(system, np.eye(n)[0])
    blocks = T
    for _ in range(BLOCK - 1):
        blocks = np.concatenate([T[0] @ blocks, T[1] @ blocks])
    return _DyadicTable(at_integers, np.ascontiguousarray(blocks.transpose(0, 2, 1)), T)


@inner
def _set_blocks_return_last_nonzero(fraction: float, digits: np.ndarray) -> int:
    """Set the blocks of binary digits of a fraction; return the index of the last that is not zero, else -1."""
    last = -1
    for i in range(DIGIT_BLOCKS):
        fraction *= 2**BLOCK
        digits[i] = int(fraction)
        fraction -= digits[i]
        if digits[i] > 0:
            last = i
    return last


@compiled
def _set_sums_of_shifts(
    y: np.ndarray, at_integers: np.ndarray, blocks: np.ndarray, c: np.ndarray, out: np.ndarray
) -> None:
    """Set out[q] = sum_l c_l phi_m(y_q - l), rows of c from l = 1 - n_m on."""
    n = at_integers.size
    v = np.empty(n)
    w = np.empty(n)
    digits = np.empty(DIGIT_BLOCKS, np.int64)
    for q in range(y.size):
        cell = int(y[q])
        last = _set_blocks_return_last_nonzero(y[q] - cell, digits)
        for j in range(n):  # a slice would compile its error message for seconds
            v[j] = at_integers[j]
        for i in range(last, -1, -1):  # T_0 v(0) = v(0): trailing zeros change nothing
            w[:] = 0.0
            for j in range(n):
                for k in range(n):
                    w[k] += blocks[digits[i], j, k] * v[j]
            v, w = w, v
        for k in range(c.shape[1]):
            out[q, k] = 0.0
        for i in range(n):
            for k in range(c.shape[1]):
                out[q, k] += v[i] * c[cell - i + n - 1, k]


class _SumsOfShifts(NamedTuple):
    """sum_l c_l phi_m(y - l) by m, each the derivative of the next; rows of c from l = 1 - n_m on."""

    order: int
    level: int
    c: dict[int, np.ndarray]

    def __call__(self, s: np.ndarray, m: int) -> np.ndarray:
        """The sums at s (n_s,), (n_s, functions); ValueError outside [0, 1]."""
        if s.size and not (s.min() >= 0.0 and s.max() <= 1.0):
            raise ValueError(f"s must lie in [0, 1], got [{s.min()!r}, {s.max()!r}]")
        table = _mother_functions(self.order).tables[m]
        out = np.empty((s.size, self.c[m].shape[1]))
        y = 2**self.level * (2 * self.order - 1) * s
        _set_sums_of_shifts(y, table.at_integers, table.blocks, self.c[m], out)
        return out


def _running_sum_outwards(c: np.ndarray, first: int) -> np.ndarray:
    """b with b_l - b_(l-1) = c_l and b_-1 = 0, summed outwards: left coefficients are large."""
    inwards = np.cumsum(c[:-first][::-1], axis=0)[::-1]
    none = np.zeros((1, c.shape[1]))
    outwards = np.cumsum(c[-first:], axis=0)
    return np.concatenate([-inwards, none, outwards])


def _sums_of_shifts_from_derivative(order: int, level: int, c: np.ndarray) -> _SumsOfShifts:
    """The functions whose derivative by s is sum_l c_l phi(y - l), 0 at s = 0; rows of c from l = 1-R on."""
    R = 2 * order - 1
    cells = 2**level * (2 * order - 1)
    mother = _mother_functions(order)
    family = {0: np.concatenate([np.ascontiguousarray(c), np.zeros((1, c.shape[1]))])}
    if 1 in mother.tables:
        family[1] = cells * np.diff(family[0], axis=0)
    for m in range(-1, DEEPEST - 1, -1):
        b = _running_sum_outwards(family[m + 1], 1 - (R - m - 1)) / cells
        n = R - m
        at_left = mother.tables[m].at_integers @ b[n - 1 :: -1]
        family[m] = np.ascontiguousarray(b - at_left)
    return _SumsOfShifts(order, level, family)


def _refined_coefficients(c: np.ndarray, mask: np.ndarray, cells: int) -> np.ndarray:
    """Coefficients of sum_l c_l phi(y - l) in phi(2y - l)."""
    R = mask.size - 1
    fine = np.zeros((2 * len(c) + R, c.shape[1]))
    for i, tap in enumerate(mask):
        fine[i : i + 2 * len(c) : 2] += tap * c
    return fine[R - 1 : R - 1 + 2 * cells + R - 1]


def _derivative_coefficients_of_paper(order: int, level: int, reading: Reading) -> np.ndarray:
    """Theta_jk' of (37)-(39) plus a constant as sum_l c_l phi(y - l); columns by j, then k."""
    p = order
    R = 2 * order - 1
    mother = _mother_functions(order)
    shift = p - 1 if reading == "shifted" else 0
    c = np.zeros((2 * R - 1, 0))
    for j in range(-1, level):
        cells = 2 ** (j + 1) * R
        if j >= 0:
            c = _refined_coefficients(c, mother.h, cells // 2)
        places = np.arange(1 - R, p) if j < 0 else np.arange(p - R, 2**j * R - p + 1)
        if reading == "scaling" and j < 0:
            first = places
            taps = np.ones(1)
            scale = 1.0
        else:
            first = 2 * (places - shift)
            taps = mother.g
            scale = 2.0 ** (j / 2)
        new = np.zeros((cells + R - 1, places.size))
        for i, tap in enumerate(taps):
            row = first + i + R - 1
            seen = np.flatnonzero((row >= 0) & (row < len(new)))
            new[row[seen], seen] = tap
        c = np.hstack([c, R * scale * new])
    return c


@lru_cache(maxsize=16)
def _orthonormal_functions(order: int, level: int, reading: Reading) -> _SumsOfShifts:
    """Orthonormal functions (in int f' g' ds) with the span of the printed ones."""
    mother = _mother_functions(order)
    c = _derivative_coefficients_of_paper(order, level, reading)
    edge = len(mother.left)

    def coordinates(c: np.ndarray) -> np.ndarray:
        left = mother.left.T @ c[:edge]
        right = mother.right.T @ c[-edge:]
        return np.concatenate([left, c[edge:-edge], right])

    constant = coordinates(np.ones((len(c), 1)))
    constant /= np.linalg.norm(constant)
    A = coordinates(c)
    A -= constant * (constant.T @ A)
    norm = np.linalg.norm(A, axis=0)
    U, singular, _ = svd(A / np.where(norm > 0.0, norm, 1.0), full_matrices=False)
    tolerance = 1e-12  # least singular value over the largest
    U = U[:, singular > tolerance * singular[0]]
    left = solve_triangular(mother.left, U[:edge], lower=True, trans="T")
    right = solve_triangular(mother.right, U[-edge:], lower=True, trans="T")
    c = sqrt(2**level * (2 * order - 1)) * np.concatenate([left, U[edge:-edge], right])
    rounding = _sums_of_shifts_from_derivative(order, level, c)(np.array([1.0]), -1)  # they vanish at s = 1 but for it
    return _sums_of_shifts_from_derivative(order, level, c - rounding)


def _gram_matrix_on_cell(T: np.ndarray) -> np.ndarray:
    """int_0^1 v v^T dx, the fixed point of G -> (T_0 G T_0^T + T_1 G T_1^T)/2."""
    n = T.shape[1]
    G = np.full((n, n), 1.0 / n**2)
    for _ in range(60):
        G = 0.5 * (T[0] @ G @ T[0].T + T[1] @ G @ T[1].T)
    return G


@lru_cache(maxsize=16)
def _slopes_at_quadrature_points(basis: "Daubechies") -> tuple[np.ndarray, np.ndarray]:
    """Points (n_q,) of the quadrature, and phi' there (n, n_q)."""
    s, _ = basis.quadrature()
    return s, np.ascontiguousarray(basis.phi(s, 1).T)


@dataclass(frozen=True, slots=True)
class Daubechies:
    """Orthonormal functions with the span of Theta_jk, j = -1 .. level-1.

        Theta_jk(x) = 2^(-j/2) [theta(2^j x - k) - theta(-k) - (x/R)(theta(2^j R - k) - theta(-k))],  x = R s     (39)
        1-R <= k <= order-1 for j = -1,   order-R <= k <= 2^j R - order for j >= 0,   R = 2 order - 1             (37)

    order : vanishing moments, 2 to 8; (23) needs 4.
    level : levels after j = -1, at most 8; 2^level R + order - 1 functions.
    reading : "literal"; "scaling" has phi(x - k) for j = -1 and lacks functions at the right end; "shifted" has psi on
        [1-p, p] and loses rank.
    """

    order: int = 4
    level: int = 0
    reading: Reading = "literal"

    @property
    def cell_count(self) -> int:
        return 2**self.level * (2 * self.order - 1)

    @property
    def _functions(self) -> _SumsOfShifts:
        return _orthonormal_functions(self.order, self.level, self.reading)

    @property
    def n(self) -> int:
        return self._functions.c[0].shape[1]

    @property
    def has_second_derivative(self) -> bool:
        """Whether phi'' exists, as (23) needs."""
        return self.order >= 4

    def values_derivatives_primitives(self, s: float) -> np.ndarray:
        """phi, phi', phi'' (0 where it does not exist) and two primitives at one s, (5, n)."""
        x = np.array([s])
        second = self.phi(x, 2) if self.has_second_derivative else np.zeros((1, self.n))
        return np.concatenate([self.phi(x), self.phi(x, 1), second, self.phi(x, -1), self.phi(x, -2)])

    def phi(self, s: np.ndarray, derivative: Literal[-2, -1, 0, 1, 2] = 0) -> np.ndarray:
        """A derivative of phi of this order, (n_s, n); primitives for a negative one."""
        return self._functions(s, derivative - 1)

    def quadrature_with_kinked_slopes(self, s_o: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points and weights (n_q,) of both sides of s_o; phi' and the hat's slope, (n + 1, n_q)."""
        left, w_left = self.quadrature(0.0, s_o)
        right, w_right = self.quadrature(s_o)
        s = np.concatenate([left, right])
        tabulated, table = _slopes_at_quadrature_points(self)
        i = np.searchsorted(tabulated, s)
        phi = np.empty((self.n + 1, s.size))
        np.take(table, i, axis=1, out=phi[:-1], mode="clip")
        new = tabulated.take(i, mode="clip") != s
        phi[:-1, new] = self.phi(s[new], 1).T
        phi[-1, : left.size] = 1.0 / s_o
        phi[-1, left.size :] = -1.0 / (1.0 - s_o)
        return s, np.concatenate([w_left, w_right]), phi

    def mass_matrix(self) -> np.ndarray:
        """int phi_j phi_k ds, (n, n), exact: cell by cell from the Gram matrix of the mother function."""
        T = _mother_functions(self.order).tables[-1].T
        c = self._functions.c[-1]
        G = _gram_matrix_on_cell(T)
        n = T.shape[1]
        M = np.zeros((self.n, self.n))
        for cell in range(self.cell_count):
            part = c[cell : cell + n][::-1]
            M += part.T @ G @ part
        return 0.5 * (M + M.T) / self.cell_count

    def stiffness_matrix(self) -> np.ndarray:
        """int phi_j' phi_k' ds, (n, n)."""
        return np.eye(self.n)

    def integrals(self) -> np.ndarray:
        """int phi_j ds, (n,)."""
        return self.phi(np.array([1.0]), -1)[0]

    def quadrature(self, a: float = 0.0, b: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Two Gauss points on each 1/8 of a cell (1/32 in the first two), as psi is not smooth."""
        n = self.cell_count
        fine = np.arange(64) / (32 * n)
        coarse = np.arange(16, 8 * n + 1) / (8 * n)
        edges = np.concatenate([fine, coarse])
        first = np.searchsorted(edges, a, side="right")
        inside = edges[first : np.searchsorted(edges, b)]
        edges = np.concatenate([[a], inside, [b]])
        centre = 0.5 * (edges[1:] + edges[:-1])
        half = 0.5 * np.diff(edges)
        offsets = half[:, None] * np.array([-1.0, 1.0]) / sqrt(3.0)
        points = centre[:, None] + offsets
        return points.ravel(), np.repeat(half, 2)
