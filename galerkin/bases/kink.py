"""The basis as the mass sees it: standing still, or enriched by one hat that travels with the mass.

A mass bends the cable sharply, and a sum of smooth functions meets that kink at first order only.  One hat function
with its peak at the mass takes the kink away from the sum.  Since the hat moves, Lagrange's equations for
w = sum_j Phi_j(s; s_o(t)) q_j read

    M q.. + 2 A q. + (A. - B) q + R(q) = F,
    M_ij = int Phi_i Phi_j ds,  A_ij = int Phi_i dPhi_j/dt ds,  B_ij = int dPhi_i/dt dPhi_j/dt ds,

with the mass on top (`galerkin.equations`).  Both classes here answer the same questions; one stands, A = B = 0.
"""

from typing import Protocol

import numpy as np

from galerkin.bases import Basis

Array = np.ndarray


def _with_hat(standing: Array, hat: float) -> Array:
    """What belongs to the standing functions and, last, to the hat."""
    out = np.empty(standing.size + 1)
    out[:-1], out[-1] = standing, hat
    return out


class MovingBasis(Protocol):
    """Functions Phi_1 .. Phi_n of s that may depend on where the mass is; s and s_o in [0, 1]."""

    basis: Basis
    n: int

    def inertia(self, s_o: float, ds_o: float, dds_o: float) -> tuple[Array, Array, Array]:
        """M (n, n) and the last columns of 2 A and of A. - B, each (n,); their other columns are zero."""

    def stiffness(self, s_o: float) -> Array:
        """int Phi_i' Phi_j' ds, (n, n)."""

    def integral(self, s_o: float) -> Array:
        """int Phi_i ds, (n,)."""

    def at_mass(self, s_o: float) -> tuple[Array, Array, Array]:
        """Phi_j(s_o) followed along the path: its value, first and second derivative by s_o; each (n,)."""

    def sides(self, s_o: float) -> tuple[float, ...]:
        """Ends of the pieces on which Phi' is continuous."""

    def slopes(self, s_o: float) -> tuple[Array, Array, Array]:
        """Points (n_q,), ascending, weights (n_q,) and Phi' there (n, n_q), piece by piece."""

    def gram(self, phi: Array, f: Array) -> Array:
        """sum_q f_abq Phi_i'(s_q) Phi_j'(s_q) over the points of `slopes`, (m n, m n) by a i, b j; f_ab = f_ba."""


class Standing:
    """The given basis unchanged: it does not know the mass."""

    def __init__(self, basis: Basis) -> None:
        self.basis, self.n = basis, basis.n
        self._mass, self._stiffness, self._integral = basis.mass(), basis.stiffness(), basis.integral()
        self._zero = np.zeros(basis.n)
        s, weights = basis.quadrature()
        phi = np.empty((basis.n, s.size))
        basis.d1_into(s, phi)
        self._slopes = s, weights, phi

    def inertia(self, s_o: float, ds_o: float, dds_o: float) -> tuple[Array, Array, Array]:
        return self._mass, self._zero, self._zero

    def stiffness(self, s_o: float) -> Array:
        return self._stiffness

    def integral(self, s_o: float) -> Array:
        return self._integral

    def at_mass(self, s_o: float) -> tuple[Array, Array, Array]:
        """phi, phi', phi'' at s_o; the last is zero where the basis has none, and then must not be used."""
        s = np.array([s_o])
        second = self.basis.d2(s)[0] if self.basis.smooth else np.zeros(self.n)
        return self.basis.values(s)[0], self.basis.d1(s)[0], second

    def sides(self, s_o: float) -> tuple[float, ...]:
        return 0.0, 1.0

    def slopes(self, s_o: float) -> tuple[Array, Array, Array]:
        return self._slopes

    def gram(self, phi: Array, f: Array) -> Array:
        m, n = len(f), self.n
        out = np.empty((m, n, m, n))
        self.basis.gram_into(phi, f, out)
        return out.reshape(m * n, m * n)


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
    """

    def __init__(self, basis: Basis) -> None:
        self.basis, self.n = basis, basis.n + 1
        self._mass, self._stiffness = (np.zeros((self.n, self.n)) for _ in range(2))
        self._mass[:-1, :-1], self._stiffness[:-1, :-1] = basis.mass(), basis.stiffness()
        self._mass[-1, -1] = 1.0 / 3.0
        self._integral = np.append(basis.integral(), 0.5)
        self._left, right = basis.primitive2(np.array([0.0, 1.0]))
        self._chord = right - self._left

    def overlap(self, s_o: Array) -> tuple[Array, Array, Array]:
        """I, I', I'' = int hat phi ds and its derivatives by s_o; s_o (m,) in [0, 1), each (m, n - 1).

        At s_o = 0, where E = E'(0) s + O(s^3), the limits are I = I' = -E'(0); I'' there is not needed and is 0.
        """
        s = s_o[:, None]
        entry = s_o == 0.0
        w, dw = s * (1.0 - s) + entry[:, None], 1.0 - 2.0 * s
        value = (self._left + s * self._chord - self.basis.primitive2(s_o)) / w
        first = (self._chord - self.basis.primitive1(s_o) - dw * value) / w  # from I w = -E; at s_o = 0 its limit
        second = (2.0 * (value - dw * first) - self.basis.values(s_o)) / w
        value[entry], second[entry] = first[entry], 0.0
        return value, first, second

    def inertia(self, s_o: float, ds_o: float, dds_o: float) -> tuple[Array, Array, Array]:
        value, first, second = (x[0] for x in self.overlap(np.array([s_o])))
        matrix = self._mass.copy()
        matrix[-1, :-1] = matrix[:-1, -1] = value
        gyroscopic = _with_hat((2.0 * ds_o) * first, 0.0)
        centrifugal = _with_hat(ds_o**2 * second + dds_o * first, -(ds_o**2) / (3.0 * s_o * (1.0 - s_o)))
        return matrix, gyroscopic, centrifugal

    def stiffness(self, s_o: float) -> Array:
        matrix, steepness = self._stiffness.copy(), 1.0 / (s_o * (1.0 - s_o))
        matrix[-1, :-1] = matrix[:-1, -1] = steepness * self.basis.values(np.array([s_o]))[0]
        matrix[-1, -1] = steepness
        return matrix

    def integral(self, s_o: float) -> Array:
        return self._integral

    def at_mass(self, s_o: float) -> tuple[Array, Array, Array]:
        """phi and its derivatives; the hat rides along and stays 1: that is why its kink costs no phi''."""
        s = np.array([s_o])
        second = self.basis.d2(s)[0] if self.basis.smooth else np.zeros(self.n - 1)
        return _with_hat(self.basis.values(s)[0], 1.0), _with_hat(self.basis.d1(s)[0], 0.0), _with_hat(second, 0.0)

    def sides(self, s_o: float) -> tuple[float, ...]:
        return 0.0, s_o, 1.0

    def slopes(self, s_o: float) -> tuple[Array, Array, Array]:
        """Points on each side of the mass; each side must resolve the highest phi over the whole cable."""
        left, w_left = self.basis.quadrature_on(0.0, s_o)
        right, w_right = self.basis.quadrature_on(s_o, 1.0)
        s = np.concatenate([left, right])
        phi = np.empty((self.n, s.size))
        self.basis.d1_into(s, phi[:-1])
        phi[-1, : left.size], phi[-1, left.size :] = 1.0 / s_o, -1.0 / (1.0 - s_o)
        return s, np.concatenate([w_left, w_right]), phi

    def gram(self, phi: Array, f: Array) -> Array:
        m, n = len(f), self.n
        out = np.empty((m, n, m, n))
        self.basis.gram_into(phi[:-1], f, out[:, :-1, :, :-1])
        out[:, -1] = hat = (f * phi[-1]) @ phi.T
        out[..., -1] = hat.transpose(0, 2, 1)
        return out.reshape(m * n, m * n)
