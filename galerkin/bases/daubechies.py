"""Anti-derivatives of Daubechies wavelets (35)-(39), the paper's second basis, at any real s to rounding.

No tables of samples and no cascade. Four facts carry everything:

1. A float is a dyadic rational. With v(x) = [phi(x), phi(x + 1), ...] on 0 <= x < 1 the refinement equation
   phi(x) = sum_k h_k phi(2x - k) reads v(x) = T_d v(2x - d), d the first binary digit of x, (T_d)_ij = h_(2i-j+d).
   So v(x) = T_d1 T_d2 ... v(0), finitely many factors, exact apart from rounding (Daubechies & Lagarias 1992).
2. The mask is h(z) = 2 ((1 + z)/2)^p q(z). Dropping or adding factors (1 + z)/2 differentiates or integrates:
   phi_m with mask 2 ((1 + z)/2)^(p-m) q(z) has phi_m' (x) = phi_(m+1)(x) - phi_(m+1)(x - 1), phi_0 = phi. As with
   B-splines, derivatives and primitives of sum_l c_l phi(y - l) are sums of phi_m(y - l) over differences and running
   sums of c. Each phi_m is walked with its own mask, so that no digit multiplies a rounding error by 2.
3. All Theta'_jk, j = -1 .. level-1, lie in the span of phi(y - l), y = 2^level R s, and of the constant.
4. The phi(y - l) are orthonormal on the line, so on the cable only the R-1 functions cut by either support need
   orthonormalising, with matrices that depend on p alone; then an SVD of well-scaled columns does the rest.

The filters are PyWavelets' `dbp`; nothing else is taken from there. They are right to their last bit, but dividing by
(1 + z)^p and orthonormalising tails of phi as small as 2e-19 (p = 10) multiply that bit: hence a Newton iteration in
60 digits on the spectral factorisation |q|^2 = sum_k binom(p-1+k, k) y^k, and 60 digits for all that depends on p
alone. Theta, Theta' and Theta'' then come out to 5e-15 of each function's own maximum for p = 2 .. 10 (p > 2 for
Theta''), at any float s (for Theta'' of p = 3, any from 2^-27 on).

Source of the construction: Xu & Shann 1992; Chen, Hwang & Shih 1996; index sets as printed in (37).
"""

from dataclasses import dataclass
from functools import lru_cache
from math import comb, sqrt
from typing import Literal, get_args

import mpmath as mp
import numpy as np
import pywt
from scipy.linalg import solve_triangular, svd

from galerkin.law import compiled

Reading = Literal["literal", "scaling", "shifted"]

DIGITS = 60  # decimal digits of everything computed once per order
BLOCK = 5  # binary digits taken at once: 32 products of T_0, T_1 fit the first-level cache
RANK_TOLERANCE = 1e-12  # singular values of unit columns: dependent sets fall to 1e-15, literal ones stay above 1e-11
DEEPEST = -3  # phi_m for m = 1 .. -3: theta'', theta', theta and two primitives


# --- the scaling function, once per order ----------------------------------------------------------------------


def _solve(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A x = b to DIGITS; A (n, n), b (n,) of mpf."""
    return np.array(list(mp.lu_solve(mp.matrix(A.tolist()), mp.matrix(b.tolist()))))


def _factor(p: int) -> np.ndarray:
    """q of h(z) = 2 ((1 + z)/2)^p q(z), ascending powers, (p,) of mpf, from PyWavelets' dbp by Newton.

    The p equations are the coefficients of |q|^2 = sum_k binom(p-1+k, k) y^k, y = (2 - z - 1/z)/4 (Daubechies 1988),
    which is orthonormality with the p vanishing moments built in.
    """
    y = np.array([mp.mpf("-0.25"), mp.mpf("0.5"), mp.mpf("-0.25")])  # times z
    wanted, power = np.array([mp.mpf(0)] * (2 * p - 1)), np.array([mp.mpf(1)])
    for k in range(p):
        wanted[p - 1 - k : p + k] += comb(p - 1 + k, k) * power
        power = np.convolve(power, y)
    zeros = np.array([1.0])
    for _ in range(p):
        zeros = np.convolve(zeros, [0.5, 0.5])
    deconvolve = np.array([np.convolve(2.0 * zeros, row) for row in np.eye(p)]).T
    h = sqrt(2.0) * np.array(pywt.Wavelet(f"db{p}").rec_lo)
    q = np.array([mp.mpf(c) for c in np.linalg.lstsq(deconvolve, h, rcond=None)[0].tolist()])
    for _ in range(12):
        residual = wanted[p - 1 :] - np.array([q[k:] @ q[: p - k] for k in range(p)])
        if max(abs(residual)) < mp.mpf(10) ** (10 - DIGITS):
            return q
        pad = np.concatenate([np.full(p, mp.mpf(0)), q, np.full(p, mp.mpf(0))])
        jacobian = np.array([pad[p + k : 2 * p + k] + pad[p - k : 2 * p - k] for k in range(p)])
        q = q + _solve(jacobian, residual)
    raise ArithmeticError(f"the filter db{p} does not polish")


def _transition(h: np.ndarray, digit: int) -> np.ndarray:
    """(T_d)_ij = h_(2i-j+d) for a mask of n + 1 taps, (n, n)."""
    n = h.size - 1
    k = 2 * np.arange(n)[:, None] - np.arange(n) + digit
    return np.where((k >= 0) & (k <= n), h[np.clip(k, 0, n)], h[0] * 0)


def _cholesky(W: np.ndarray) -> np.ndarray:
    """Lower L with L L^T = W, in float64; W (n, n) of mpf, symmetric positive definite."""
    return np.array(mp.cholesky(mp.matrix(W.tolist())).tolist()).astype(float)


@dataclass(frozen=True, slots=True)
class _Walk:
    """One phi_m, ready for the walk along binary digits."""

    at_integers: np.ndarray  # v(0) = phi_m(0 .. n_m - 1), (n_m,)
    blocks: np.ndarray  # (2^BLOCK, n_m, n_m): transposed products T_d1 .. T_dBLOCK
    T: np.ndarray  # (2, n_m, n_m)


@dataclass(frozen=True, slots=True)
class _Mother:
    """Everything that depends on the order p alone, in float64, each entry right to its own last bits."""

    h: np.ndarray  # (R + 1,) phi(x) = sum h_k phi(2x - k), sum h = 2
    g: np.ndarray  # (R + 1,) psi(x) = sum g_k phi(2x - k), g_k = (-1)^k h_(R-k)
    walks: dict[int, _Walk]
    left: np.ndarray  # L of L L^T = int_0^inf phi(x-k) phi(x-l) dx, k, l = 1-R .. -1: cut by the left support
    right: np.ndarray  # the same for int_-inf^0: cut by the right support


@lru_cache(maxsize=16)
def _mother(p: int) -> _Mother:
    """The scaling function of order p."""
    R = 2 * p - 1
    with mp.workdps(DIGITS):
        q = _factor(p)
        walks = {}
        for m in range(DEEPEST, 2 if p > 2 else 1):
            mask = 2 * q
            for _ in range(p - m):
                mask = np.convolve(mask, np.array([mp.mpf("0.5")] * 2))
            if m == 0:
                h = mask
            # v(0) = T_0 v(0) with sum 1; phi_m(0) = 0, so its equation gives way to the sum
            system = _transition(mask, 0) - np.diag([mp.mpf(1)] * (R - m))
            system[0] = mp.mpf(1)
            unit = np.array([mp.mpf(1)] + [mp.mpf(0)] * (R - m - 1))
            T = np.array([_transition(mask.astype(float), d) for d in (0, 1)])
            blocks = T
            for _ in range(BLOCK - 1):
                blocks = np.concatenate([T[0] @ blocks, T[1] @ blocks])
            walks[m] = _Walk(_solve(system, unit).astype(float), np.ascontiguousarray(blocks.transpose(0, 2, 1)), T)
        # Refining both functions: W = (H W H^T + B B^T)/2, H = taps that stay cut, B = taps that come to lie inside.
        # Summed by doubling (Smith 1968); the terms fall by 2 each.
        taps = np.array(
            [[h[t - 2 * l] if 0 <= t - 2 * l <= R else mp.mpf(0) for t in range(1 - R, R)] for l in range(1 - R, 0)]
        )
        step, W = taps[:, : R - 1] / mp.sqrt(2), taps[:, R - 1 :] @ taps[:, R - 1 :].T / 2
        for _ in range(8):
            W, step = W + step @ W @ step.T, step @ step
        left, right = _cholesky(W), _cholesky(np.diag([mp.mpf(1)] * (R - 1)) - W)
    g = np.array([(-1) ** k for k in range(R + 1)]) * h[::-1]
    return _Mother(h.astype(float), g.astype(float), walks, left, right)


# --- evaluation ------------------------------------------------------------------------------------------------


@compiled
def _evaluate(s, R, level, at_integers, blocks, c, out):
    """out[q] = sum_l c_l phi_m(2^level R s_q - l), rows of c starting at l = 1 - n_m; s in [0, 1].

    R s is formed in whole numbers of 2^-80, exactly from s = 2^-27 on: a rounded product would move theta'' by 1e-10.
    """
    n = at_integers.size
    v, w = np.empty(n), np.empty(n)
    for q in range(s.size):
        x = s[q] * 4294967296.0
        top = np.int64(x)
        low = np.int64((x - top) * 281474976710656.0) * R
        top = top * R + (low >> 48)
        low &= (np.int64(1) << 48) - 1
        cell = top >> (32 - level)  # y = cell + (first + second 2^-40) 2^-40
        first = ((top & ((np.int64(1) << (32 - level)) - 1)) << (8 + level)) | (low >> (40 - level))
        second = (low & ((np.int64(1) << (40 - level)) - 1)) << level
        v[:] = at_integers
        trailing = True
        for half in (second, first):
            for shift in range(0, 40, BLOCK):
                digits = (half >> shift) & ((1 << BLOCK) - 1)
                trailing = trailing and digits == 0
                if trailing:
                    continue  # T_0 v(0) = v(0)
                w[:] = 0.0
                for j in range(n):
                    for i in range(n):
                        w[i] += blocks[digits, j, i] * v[j]
                v, w = w, v
        for k in range(c.shape[1]):
            out[q, k] = 0.0
        for i in range(n):
            for k in range(c.shape[1]):
                out[q, k] += v[i] * c[cell - i + n - 1, k]


@dataclass(frozen=True, slots=True)
class _Sums:
    """Functions sum_l c_l phi_m(y - l) of s, y = cells s, for m = 1 .. DEEPEST, each the derivative of the next.

    `c` maps m to coefficients (n_l, n), rows l = 1 - n_m .. cells, where n_m = R - m is the length of the support of
    phi_m; the last row only ever meets phi_m(0) = 0.
    """

    order: int
    level: int
    c: dict[int, np.ndarray]

    def __call__(self, s: np.ndarray, m: int) -> np.ndarray:
        """The member with phi_m at s, (n_s, n)."""
        s = np.ascontiguousarray(s, dtype=float)
        if s.size and not (s.min() >= 0.0 and s.max() <= 1.0):
            raise ValueError(f"s must lie in [0, 1], got [{s.min()!r}, {s.max()!r}]")
        if m not in self.c:
            allowed = f"{DEEPEST + 1} .. {max(self.c) + 1}"
            raise ValueError(f"order {self.order} has derivatives {allowed} of Theta, not {m + 1}")
        walk = _mother(self.order).walks[m]
        out = np.empty((s.size, self.c[m].shape[1]))
        _evaluate(s, 2 * self.order - 1, self.level, walk.at_integers, walk.blocks, self.c[m], out)
        return out


def _running_sum(c: np.ndarray, first: int) -> np.ndarray:
    """b with b_l - b_(l-1) = c_l and b_-1 = 0, rows from l = first - 1; c has rows from l = first < 0.

    Sums run outwards from l = 0: coefficients grow like the inverse of the tiny tails that they multiply at the left
    support, and in a sum from left to right they would swamp all others.
    """
    left, right = c[:-first], c[-first:]
    return np.concatenate([-np.cumsum(left[::-1], axis=0)[::-1], np.zeros((1, c.shape[1])), np.cumsum(right, axis=0)])


def _sums(order: int, level: int, c: np.ndarray) -> _Sums:
    """Functions that vanish at s = 0 with derivative sum_l c_l phi(y - l), rows l = 1-R .. cells-1."""
    R, cells = 2 * order - 1, 2**level * (2 * order - 1)
    mother = _mother(order)
    family = {0: np.concatenate([c, np.zeros((1, c.shape[1]))])}
    if 1 in mother.walks:
        family[1] = cells * np.diff(family[0], axis=0)
    for m in range(-1, DEEPEST - 1, -1):
        b = _running_sum(family[m + 1], 1 - (R - m - 1)) / cells
        n = R - m
        at_left = mother.walks[m].at_integers @ b[n - 1 :: -1]  # l = 0, -1, .. against phi_m(0), phi_m(1), ..
        family[m] = np.ascontiguousarray(b - at_left)  # sum_l phi_m(y - l) = 1
    return _Sums(order, level, family)


# --- the printed set ---------------------------------------------------------------------------------------------


def _refine(c: np.ndarray, h: np.ndarray, cells: int) -> np.ndarray:
    """sum_l c_l phi(y - l) in phi(2y - l); rows of c from l = 1-R .. cells-1, of the answer to 2 cells - 1."""
    R = h.size - 1
    fine = np.zeros((2 * len(c) + R, c.shape[1]))  # first row: l = 2 - 2R
    for i, tap in enumerate(h):
        fine[i : i + 2 * len(c) : 2] += tap * c
    return fine[R - 1 : R - 1 + 2 * cells + R - 1]


def _printed(order: int, level: int, reading: Reading) -> np.ndarray:
    """Theta_jk' of (37)-(39) as sum_l c_l phi(y - l): (cells + R - 1, count), rows from l = 1-R, columns by j, then k.

    Scaled as printed, 2^(-j/2) theta(2^j x - k); derivative with respect to s, without the mean that (39) takes off.
    """
    p, R, mother = order, 2 * order - 1, _mother(order)
    shift = p - 1 if reading == "shifted" else 0  # psi(x + p - 1), supported on [1-p, p]
    c = np.zeros((2 * R - 1, 0))
    for j in range(-1, level):
        cells = 2 ** (j + 1) * R  # psi_jk is a sum of phi(2^(j+1) x - l)
        if j >= 0:
            c = _refine(c, mother.h, cells // 2)
        places = np.arange(1 - R, p) if j < 0 else np.arange(p - R, 2**j * R - p + 1)
        scaling = reading == "scaling" and j < 0
        first, taps = (places, np.ones(1)) if scaling else (2 * (places - shift), mother.g)
        new = np.zeros((cells + R - 1, places.size))
        for i, tap in enumerate(taps):
            row = first + i + R - 1
            seen = np.flatnonzero((row >= 0) & (row < len(new)))
            new[row[seen], seen] = tap
        c = np.hstack([c, R * 2.0 ** (0.0 if scaling else j / 2) * new])
    return c


@lru_cache(maxsize=16)
def _orthonormal(order: int, level: int, reading: Reading) -> _Sums:
    """Orthonormal functions (in int f' g' ds) with the span of the printed ones.

    In the coordinates A of Theta' along the orthonormalised phi(y - l) the inner product is the plain dot product, and
    the constant, which (39) takes off, is one direction: a Householder reflection turns it into the first axis, which
    is then left out. So Theta(1) = 0 and orthonormality hold to rounding, however dependent the printed functions are.
    """
    mother, c = _mother(order), _printed(order, level, reading)
    edge = len(mother.left)

    def coordinates(c: np.ndarray) -> np.ndarray:
        return np.concatenate([mother.left.T @ c[:edge], c[edge:-edge], mother.right.T @ c[-edge:]])

    axis = coordinates(np.ones((len(c), 1)))
    axis /= np.linalg.norm(axis)
    axis[0] += np.copysign(1.0, axis[0])
    axis /= np.linalg.norm(axis)
    A = coordinates(c)
    A = (A - 2.0 * axis * (axis.T @ A))[1:]
    norm = np.linalg.norm(A, axis=0)
    U, singular, _ = svd(A / np.where(norm > 0.0, norm, 1.0), full_matrices=False)
    U = U[:, singular > RANK_TOLERANCE * singular[0]]
    U = np.concatenate([np.zeros((1, U.shape[1])), U])
    U -= 2.0 * axis * (axis.T @ U)
    left = solve_triangular(mother.left, U[:edge], lower=True, trans="T")
    right = solve_triangular(mother.right, U[-edge:], lower=True, trans="T")
    cells = 2**level * (2 * order - 1)
    return _sums(order, level, sqrt(cells) * np.concatenate([left, U[edge:-edge], right]))


def _cell_gram(T: np.ndarray) -> np.ndarray:
    """int_0^1 v v^T dx of v(x) = [phi_m(x), phi_m(x + 1), ..], the fixed point of G -> (T_0 G T_0^T + T_1 G T_1^T)/2.

    The map halves all but G itself, whose entries sum to 1 and stay so. T (2, n, n); G (n, n).
    """
    n = T.shape[1]
    G = np.full((n, n), 1.0 / n**2)
    for _ in range(60):
        G = 0.5 * (T[0] @ G @ T[0].T + T[1] @ G @ T[1].T)
    return G


@lru_cache(maxsize=16)
def _own_table(basis: "Daubechies") -> tuple[np.ndarray, np.ndarray]:
    """Points of the rule for the whole cable, ascending, and phi' there, (n, n_q)."""
    s, _ = basis.quadrature()
    return s, np.ascontiguousarray(basis.phi(s, 1).T)


@lru_cache(maxsize=16)
def _edges(cells: int) -> np.ndarray:
    """Ends of the parts of the rule, 1/8 of a cell each, 1/32 in the first two cells."""
    return np.concatenate([np.arange(64) / (32 * cells), np.arange(16, 8 * cells + 1) / (8 * cells)])


@dataclass(frozen=True, slots=True)
class Daubechies:
    """The span of the anti-derivatives Theta_jk of Daubechies' wavelets, j = -1 .. level-1, made orthonormal.

        Theta_jk(x) = 2^(-j/2) [theta(2^j x - k) - theta(-k) - (x/R)(theta(2^j R - k) - theta(-k))],  x = R s     (39)
        theta(x) = int_0^x psi,  psi(x) = sum_k (-1)^k h_(R-k) phi(2x - k) on [0, R],  R = 2 order - 1
        1-R <= k <= order-1 for j = -1,   order-R <= k <= 2^j R - order for j >= 0                                (37)

    The functions handed out are not the Theta_jk but an orthonormal set (in int f' g' ds) with the same span, because
    the Gram matrix of the Theta_jk is nearly singular.

    order : p, number of vanishing moments, 2 .. 10. theta' is Hoelder continuous with exponent 0.55, 1.09, 1.62 for
        p = 2, 3, 4, so theta'' does not exist for p = 2 (`phi` refuses) and is hardly continuous for p = 3; `smooth`
        tells (23) from the path form.
    level : number of levels after j = -1; 2^level R + order - 1 functions (the paper prints 2^(level+1) R + R - order).
    reading : "literal" as above. Two misreadings fail instructively: "scaling" takes phi(x - k) for j = -1 and does
        not converge, for functions at the right end are missing; "shifted" puts psi on [1-p, p] and loses rank.
    """

    order: int = 4
    level: int = 0
    reading: Reading = "literal"

    def __post_init__(self) -> None:
        if self.order not in range(2, 11):
            raise ValueError(f"Daubechies.order must be 2 .. 10, got {self.order!r}")
        if self.level not in range(9):
            raise ValueError(f"Daubechies.level must be 0 .. 8, got {self.level!r}")
        if self.reading not in get_args(Reading):
            raise ValueError(f"Daubechies.reading must be one of {', '.join(get_args(Reading))}, got {self.reading!r}")

    @property
    def cells(self) -> int:
        """2^level R: unit intervals of the finest scaling functions along the cable."""
        return 2**self.level * (2 * self.order - 1)

    @property
    def _functions(self) -> _Sums:
        return _orthonormal(self.order, self.level, self.reading)

    @property
    def n(self) -> int:
        """Number of functions handed out: of the independent Theta_jk.

        Literal: all of them (rounding hides one for order 10 from level 5 on). Shifted: 7 of 10, 13 of 17, 25 of 31
        for order 4, as exact elimination confirms.
        """
        return self._functions.c[0].shape[1]

    @property
    def smooth(self) -> bool:
        """True from order 4 on: theta'' exists and is Hoelder continuous with exponent 0.6 or more."""
        return self.order >= 4

    def at(self, s: float) -> np.ndarray:
        """phi, phi', phi'' (0 where there is none) and both primitives at one s, (5, n)."""
        none, x = np.zeros((1, self.n)), np.array([s])
        return np.concatenate([none if m == 2 and not self.smooth else self.phi(x, m) for m in (0, 1, 2, -1, -2)])

    def phi(self, s: np.ndarray, m: int = 0) -> np.ndarray:
        """The m-th derivative of phi, (n_s, n); primitives from s = 0 on for m < 0."""
        return self._functions(s, m - 1)

    def split(self, s_o: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Both sides of s_o: phi' is looked up at points of the own rule, which a cut changes in one part."""
        (left, w_left), (right, w_right) = self.quadrature_on(0.0, s_o), self.quadrature_on(s_o, 1.0)
        s = np.concatenate([left, right])
        own, table = _own_table(self)
        i = np.searchsorted(own, s)
        phi = np.empty((self.n + 1, s.size))
        np.take(table, i, axis=1, out=phi[:-1], mode="clip")
        new = own.take(i, mode="clip") != s
        phi[:-1, new] = self.phi(s[new], 1).T
        phi[-1, : left.size], phi[-1, left.size :] = 1.0 / s_o, -1.0 / (1.0 - s_o)
        return s, np.concatenate([w_left, w_right]), phi

    def mass(self) -> np.ndarray:
        """int phi_m phi_n ds, (n, n), cell by cell from the Gram matrix of phi_-1 on one cell."""
        T, c = _mother(self.order).walks[-1].T, self._functions.c[-1]
        G, n = _cell_gram(T), T.shape[1]
        M = np.zeros((self.n, self.n))
        for cell in range(self.cells):
            part = c[cell : cell + n][::-1]  # phi_-1(y - l) = v_i, i = cell - l
            M += part.T @ G @ part
        return 0.5 * (M + M.T) / self.cells

    def stiffness(self) -> np.ndarray:
        """int phi_m' phi_n' ds = 1 on the diagonal, by construction."""
        return np.eye(self.n)

    def integral(self) -> np.ndarray:
        """int phi ds, (n,)."""
        return self.phi(np.array([1.0]), -1)[0]

    def quadrature(self) -> tuple[np.ndarray, np.ndarray]:
        """The rule of `quadrature_on` for the whole cable."""
        return self.quadrature_on(0.0, 1.0)

    def quadrature_on(self, a: float, b: float) -> tuple[np.ndarray, np.ndarray]:
        """Two Gauss points on each 1/8 of a cell (1/32 in the first two cells), cut at a and b.

        More points on fewer pieces do worse: phi'_m phi'_n is no smoother than psi. The functions next to s = 0 are
        tails of psi, steeper than psi itself, hence the finer start. Measured for p = 4, levels 0, 1, 2 (208, 320, 544
        points): int e^-s f' phi_n' ds of f = sin 2 pi s to 7e-5, 4e-5, 4e-5 of its norm, any single entry of the
        stiffness to 9e-4, 2e-4, 3e-4 of the diagonal; the first frequency of the level cable to 1e-6, 2e-7, 1e-8.
        """
        edges = _edges(self.cells)
        inside = slice(np.searchsorted(edges, a, side="right"), np.searchsorted(edges, b))
        edges = np.concatenate([[a], edges[inside], [b]])
        centre, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
        return (centre[:, None] + half[:, None] * np.array([-1.0, 1.0]) / sqrt(3.0)).ravel(), np.repeat(half, 2)
