"""The basis as the mass sees it: standing still, or enriched by one hat that travels with the mass.

A mass bends the cable sharply, and a sum of smooth functions meets that kink at first order only.  One hat function
with its peak at the mass takes the kink away from the sum.  Since the hat moves, Lagrange's equations for
w = sum_j Phi_j(s; s_o(t)) q_j read

    M q.. + 2 A q. + (A. - B) q + R(q) = F,
    M_ij = int Phi_i Phi_j ds,  A_ij = int Phi_i dPhi_j/dt ds,  B_ij = int dPhi_i/dt dPhi_j/dt ds,

with the mass on top (`galerkin.equations`).  Both classes here answer the same questions; one stands, A = B = 0.
"""

import math
from typing import NamedTuple

import numpy as np

from galerkin.bases import Basis
from galerkin.bases.fourier import Fourier
from galerkin.law import compiled

Array = np.ndarray


class Carried(NamedTuple):
    """What the equations need of a moving basis at an instant; n functions."""

    mass: Array  # M, (n, n)
    gyroscopic: Array  # columns of 2 A of the k functions that travel, (k, n); its others are zero
    centrifugal: Array  # the same of A. - B, (k, n)
    f: Array  # Phi(s_o), (n,)
    f_s: Array  # Phi'(s_o) along the path: the hat rides along and stays 1, that is why its kink costs no phi''
    f_v: Array  # 2 ds_o Phi'(s_o), as in (22), (n,)
    f_q: Array  # dds_o Phi'(s_o) + ds_o^2 Phi''(s_o), as in (23), (n,)
    behind: Array  # int_0^s_o hat Phi ds, (n,); 0 without a hat


@compiled
def _overlap(phi, first, second, left, chord, s_o):
    """I, I', I'' of `TravellingKink` for one function; first, second : its primitives.

    At s_o = 0, where E = E'(0) s + O(s^3), the limits are I = I' = -E'(0); I'' there is not needed and is 0.
    """
    if s_o == 0.0:
        return chord - first, chord - first, 0.0
    w, dw = s_o * (1.0 - s_o), 1.0 - 2.0 * s_o
    value = (left + s_o * chord - second) / w
    slope = (chord - first - dw * value) / w  # from I w = -E
    return value, slope, (2.0 * (value - dw * slope) - phi) / w


@compiled
def _overlaps(phi, first, second, left, chord, s_o):
    """The same for all functions (m, n) at m places: (3, m, n)."""
    out = np.empty((3, *phi.shape))
    for i in range(s_o.size):
        for k in range(phi.shape[1]):
            out[0, i, k], out[1, i, k], out[2, i, k] = _overlap(
                phi[i, k], first[i, k], second[i, k], left[k], chord[k], s_o[i]
            )
    return out


@compiled
def _bubble(x, c, s):
    """G = k pi int_0^a (s/a) (1 - s/a) sin(k pi s) ds = 2 (1 - cos x)/x^2 - sin(x)/x, x = k pi a, G' and G''.

    c, s : cos x, sin x
    """
    if x > 1.0:
        y = 1.0 / x
        bow = (1.0 - c) * y * y
        return (
            2.0 * bow - s * y,
            3.0 * s * y * y - c * y - 4.0 * bow * y,
            4.0 * c * y * y - 10.0 * s * y**3 + s * y + 12.0 * bow * y * y,
        )
    value, slope, bend, term = 0.0, 0.0, 0.0, 1.0 / 12.0  # of the series, of x^(2 m) 2 m/(2 m + 2)!
    for m in range(1, 11):
        value += term * x * x
        slope += term * 2 * m * x
        bend += term * 2 * m * (2 * m - 1)
        term *= -x * x * (m + 1.0) / (m * (2.0 * m + 3.0) * (2.0 * m + 4.0))
    return value, slope, bend


@compiled
def _bubbles(k, phi, first, s_o):
    """int bubble sin((k + 1) pi s) ds behind and ahead of s_o and its derivatives by s_o, (2, 3).

    phi, first : the sine and its slope at s_o
    """
    out, wave = np.empty((2, 3)), (k + 1) * math.pi
    sign = 1.0 - 2.0 * (k % 2)  # the sine seen from the right support
    out[0, 0], out[0, 1], out[0, 2] = _bubble(wave * s_o, first / wave, phi)
    out[1, 0], out[1, 1], out[1, 2] = _bubble(wave * (1.0 - s_o), -sign * first / wave, sign * phi)
    out[1, 1] *= -1.0
    for i in range(3):
        out[0, i] *= wave ** (i - 1)
        out[1, i] *= sign * wave ** (i - 1)
    return out


@compiled
def carry(at, mass, left, chord, s_o, ds_o, dds_o):
    """M, the gyroscopic and centrifugal columns (k, n) and the other entries of `Carried` as rows, (5, n).

    at : `Basis.at`;  mass, left, chord : of `TravellingKink`
    """
    n, size = at.shape[1], mass.shape[0]
    travels, M, rows, hat = size - n, np.empty((size, size)), np.zeros((5, size)), size - 1
    gyroscopic, centrifugal = np.zeros((travels, size)), np.zeros((travels, size))
    for k in range(size):
        for i in range(size):
            M[k, i] = mass[k, i]
    for k in range(n):
        phi, first, second = at[0, k], at[1, k], at[2, k]
        rows[0, k], rows[1, k], rows[2, k] = phi, first, 2.0 * ds_o * first
        rows[3, k] = dds_o * first + ds_o * ds_o * second
        if travels > 0:
            value, slope, bend = _overlap(phi, at[3, k], at[4, k], left[k], chord[k], s_o)
            M[hat, k] = M[k, hat] = value
            gyroscopic[travels - 1, k] = 2.0 * ds_o * slope
            centrifugal[travels - 1, k] = ds_o * ds_o * bend + dds_o * slope
            rows[4, k] = at[3, k] + (left[k] - at[4, k]) / s_o
        if travels > 1:
            overlaps = _bubbles(k, phi, first, s_o)
            for i in range(2):
                M[n + i, k] = M[k, n + i] = overlaps[i, 0]
                gyroscopic[i, k] = 2.0 * ds_o * overlaps[i, 1]
                centrifugal[i, k] = ds_o * ds_o * overlaps[i, 2] + dds_o * overlaps[i, 1]
    if travels > 0:
        centrifugal[travels - 1, hat] = -ds_o * ds_o / (3.0 * s_o * (1.0 - s_o))
        rows[0, hat], rows[4, hat] = 1.0, s_o / 3.0
    if travels > 1:
        rows[4, n] = s_o / 12.0
        for i in range(2):
            # of either piece by its length h, which grows at dh; see `TravellingKink`
            h, dh, ddh = (s_o, ds_o, dds_o) if i == 0 else (1.0 - s_o, -ds_o, -dds_o)
            M[n + i, n + i], M[n + 1 - i, n + i] = h / 30.0, 0.0
            M[n + i, hat] = M[hat, n + i] = h / 12.0
            gyroscopic[i, n + i], gyroscopic[i, hat], gyroscopic[2, n + i] = dh / 30.0, dh / 3.0, -dh / 6.0
            centrifugal[i, n + i] = ddh / 60.0 - 2.0 / 15.0 * dh * dh / h
            centrifugal[i, hat] = ddh / 6.0 + dh * dh / (6.0 * h)
            centrifugal[2, n + i] = -ddh / 12.0 + dh * dh / (6.0 * h)
    return M, gyroscopic, centrifugal, rows


@compiled
def _bubble_overlaps(phi, first, s_o):
    out = np.empty((2, 2, *phi.shape))
    for i in range(s_o.size):
        for k in range(phi.shape[1]):
            out[:, :, i, k] = _bubbles(k, phi[i, k], first[i, k], s_o[i])[:, :2]
    return out


class Standing:
    """The given basis unchanged: it does not know the mass."""

    travels = 0  # how many functions do, which come last

    def __init__(self, basis: Basis) -> None:
        self.basis, self.n = basis, basis.n
        self.at_rest, self._stiffness, self._integral = basis.mass(), basis.stiffness(), basis.integral()
        s, weights = basis.quadrature()
        self._slopes = s, weights, np.ascontiguousarray(basis.phi(s, 1).T)

    def carried(self, s_o: float, ds_o: float, dds_o: float) -> Carried:
        """Its part in the equations at this instant."""
        none = self._integral
        mass, gyroscopic, centrifugal, rows = carry(self.basis.at(s_o), self.at_rest, none, none, s_o, ds_o, dds_o)
        return Carried(mass, gyroscopic, centrifugal, *rows)

    def stiffness(self, s_o: float) -> Array:
        """int Phi_i' Phi_j' ds, (n, n)."""
        return self._stiffness

    def integral(self, s_o: float) -> Array:
        """int Phi_i ds, (n,)."""
        return self._integral

    def slopes(self, s_o: float) -> tuple[Array, Array, Array]:
        """Points (n_q,), ascending, weights (n_q,) and Phi' there (n, n_q), piece by piece."""
        return self._slopes


class TravellingKink:
    """Any basis plus the hat that is 1 at the mass and falls linearly to 0 at both supports; the hat comes last.

    All its integrals are in closed form.  hat'' is a delta of weight -1/(s_o (1 - s_o)) at s_o, so with E'' = phi,
    E(0) = E(1) = 0 (the second primitive less its chord)

        I(s_o) = int hat phi ds = int hat'' E ds = -E(s_o)/(s_o (1 - s_o)),
        int phi dhat/dt ds = I' ds_o,    int phi d2hat/dt2 ds = I'' ds_o^2 + I' dds_o   (phi stands still),
        int hat^2 = 1/3,  int hat dhat/dt = 0,  int (dhat/dt)^2 = ds_o^2/(3 s_o (1 - s_o)),
        int hat' phi' = phi(s_o)/(s_o (1 - s_o)),  int hat'^2 = 1/(s_o (1 - s_o)),  int hat = 1/2.

    The left slope 1/s_o grows without bound towards a support: nothing but `overlap` may be asked for at s_o = 0,
    and nothing at s_o = 1.

    bubbles : with sines also x (1 - x) behind and ahead of the mass, x = s/s_o and (1 - s)/(1 - s_o), before the hat,
    for the jump of w'' there, see `galerkin.bow`.  On a piece of length h that grows at dh, with f, g of x,

        int f g ds = h int f g dx,  int f dg/dt ds = -dh int f x g' dx,  int df/dt dg/dt ds = dh^2/h int x^2 f' g' dx.
    """

    def __init__(self, basis: Basis, bubbles: bool = False) -> None:
        self.travels = 3 if bubbles else 1
        self.basis, self.n = basis, basis.n + self.travels
        self.at_rest, self._stiffness = (np.zeros((self.n, self.n)) for _ in range(2))
        self.at_rest[: basis.n, : basis.n], self._stiffness[: basis.n, : basis.n] = basis.mass(), basis.stiffness()
        self.at_rest[-1, -1] = 1.0 / 3.0
        self._integral = np.append(basis.integral(), 0.5)
        self.left, right = basis.phi(np.array([0.0, 1.0]), -2)
        self.chord = right - self.left

    def overlap(self, s_o: Array) -> Array:
        """I, I', I'' = int hat phi ds and its derivatives by s_o; s_o (m,) in [0, 1), (3, m, n - 1)."""
        tables = (self.basis.phi(s_o, m) for m in (0, -1, -2))
        return _overlaps(*tables, self.left, self.chord, s_o)

    def carried(self, s_o: float, ds_o: float, dds_o: float) -> Carried:
        at = self.basis.at(s_o)
        mass, gyroscopic, centrifugal, rows = carry(at, self.at_rest, self.left, self.chord, s_o, ds_o, dds_o)
        return Carried(mass, gyroscopic, centrifugal, *rows)

    def bubble_overlap(self, s_o: Array) -> Array:
        """int bubble phi ds and its derivative by s_o, behind and ahead; s_o (m,), (2, 2, m, n - 3)."""
        return _bubble_overlaps(self.basis.phi(s_o), self.basis.phi(s_o, 1), s_o)

    def stiffness(self, s_o: float) -> Array:
        matrix, steepness = self._stiffness.copy(), 1.0 / (s_o * (1.0 - s_o))
        matrix[-1, :-1] = matrix[:-1, -1] = steepness * self.basis.phi(np.array([s_o]))[0]
        matrix[-1, -1] = steepness
        return matrix

    def integral(self, s_o: float) -> Array:
        return self._integral

    def slopes(self, s_o: float) -> tuple[Array, Array, Array]:
        """Points on each side of the mass; each side must resolve the highest phi over the whole cable."""
        if self.travels == 1:
            return self.basis.split(s_o)
        assert isinstance(self.basis, Fourier)
        return self.basis.split(s_o, self.travels)


MovingBasis = Standing | TravellingKink
