"""The hat that travels with the mass; see README.md, "Kink"."""

from typing import NamedTuple

import numpy as np

from galerkin.bases import Basis
from galerkin.law import compiled, inner

Array = np.ndarray


class InertiaTerms(NamedTuple):
    mass: Array  # M, (n, n)
    gyroscopic: Array  # last column of 2 A, (n,); other columns are zero
    centrifugal: Array  # the same of A. - B + c_d A
    f: Array  # Phi(s_o), (n,)
    f_s: Array  # dPhi/ds_o along the path; 0 for the hat
    f_v: Array  # 2 ds_o Phi'(s_o), as in (22), (n,)
    f_q: Array  # dds_o Phi'(s_o) + ds_o^2 Phi''(s_o), as in (23), (n,)
    behind: Array  # int_0^s_o hat Phi ds, (n,)

    def convective_terms(self, V: Array, Q: Array) -> Array:
        """2 A V + (A. - B) Q, (fields, n)."""
        return np.multiply.outer(V[:, -1], self.gyroscopic) + np.multiply.outer(Q[:, -1], self.centrifugal)


@inner
def _hat_overlap_with_derivatives(
    phi: float, primitive: float, second_primitive: float, left: float, chord: float, s_o: float
) -> tuple[float, float, float]:
    """I, I', I'' of `KinkedBasis` from phi and its two primitives at s_o; I'' at s_o = 0 is not needed and 0."""
    if s_o == 0.0:
        return chord - primitive, chord - primitive, 0.0
    w = s_o * (1.0 - s_o)
    dw = 1.0 - 2.0 * s_o
    value = (left + s_o * chord - second_primitive) / w  # I w = -E
    slope = (chord - primitive - dw * value) / w
    bend = (2.0 * (value - dw * slope) - phi) / w
    return value, slope, bend


@compiled
def _hat_overlaps_with_derivatives(
    phi: Array, primitive: Array, second_primitive: Array, left: Array, chord: Array, s_o: Array
) -> Array:
    """The same for functions (m, n) at m positions s_o, (3, m, n)."""
    out = np.empty((3, *phi.shape))
    for i in range(s_o.size):
        for k in range(phi.shape[1]):
            value, slope, bend = _hat_overlap_with_derivatives(
                phi[i, k], primitive[i, k], second_primitive[i, k], left[k], chord[k], s_o[i]
            )
            out[0, i, k] = value
            out[1, i, k] = slope
            out[2, i, k] = bend
    return out


@compiled
def inertia_terms_with_hat(
    functions: Array, mass: Array, left: Array, chord: Array, kinematics: tuple[float, float, float], damping: float
) -> InertiaTerms:
    """`InertiaTerms` of sines or wavelets, with a hat if `mass` has one.

    functions : `Fourier.values_derivatives_primitives` at s_o;  kinematics : s_o, ds_o, dds_o
    """
    n = functions.shape[1]
    size = mass.shape[0]
    s_o, ds_o, dds_o = kinematics
    hat = size > n
    M = mass.copy()
    rows = np.zeros((7, size))
    for k in range(n):
        phi = functions[0, k]
        first = functions[1, k]
        second = functions[2, k]
        rows[2, k] = phi
        rows[3, k] = first
        rows[4, k] = 2.0 * ds_o * first
        rows[5, k] = dds_o * first + ds_o * ds_o * second
        if hat:
            value, slope, bend = _hat_overlap_with_derivatives(
                phi, functions[3, k], functions[4, k], left[k], chord[k], s_o
            )
            M[n, k] = M[k, n] = value
            rows[0, k] = 2.0 * ds_o * slope
            rows[1, k] = ds_o * ds_o * bend + (dds_o + damping * ds_o) * slope
            rows[6, k] = functions[3, k] + (left[k] - functions[4, k]) / s_o
    if hat:
        rows[1, n] = -ds_o * ds_o / (3.0 * s_o * (1.0 - s_o))
        rows[2, n] = 1.0
        rows[6, n] = s_o / 3.0
    return InertiaTerms(M, rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6])


class KinkedBasis:
    """A basis; with `kink` the hat comes last.

    I(s_o) = int hat phi ds = -E(s_o)/(s_o (1 - s_o)),  E'' = phi, E(0) = E(1) = 0;
    int phi dhat/dt ds = I' ds_o;    int phi d2hat/dt2 ds = I'' ds_o^2 + I' dds_o;
    int hat^2 = 1/3,  int (dhat/dt)^2 = ds_o^2/(3 s_o (1 - s_o)),  int hat'^2 = 1/(s_o (1 - s_o)),  int hat = 1/2.
    """

    def __init__(self, basis: Basis, kink: bool) -> None:
        self.basis = basis
        self.kink = kink
        self.n = basis.n + kink
        self.mass_at_rest = np.diag([1.0 / 3.0] * self.n)
        self._stiffness = np.zeros((self.n, self.n))
        standing = slice(basis.n), slice(basis.n)
        self.mass_at_rest[standing] = basis.mass_matrix()
        self._stiffness[standing] = basis.stiffness_matrix()
        self._integrals = np.append(basis.integrals(), 0.5)[: self.n]
        self.left, right = basis.phi(np.array([0.0, 1.0]), -2)
        self.chord = right - self.left
        if not kink:
            s, weights = basis.quadrature()
            self._slopes = s, weights, np.ascontiguousarray(basis.phi(s, 1).T)

    def hat_overlaps_and_derivatives(self, s_o: Array) -> Array:
        """I, I', I'' at s_o (m,) in [0, 1), (3, m, basis.n)."""
        phi = self.basis.phi(s_o)
        primitive = self.basis.phi(s_o, -1)
        second_primitive = self.basis.phi(s_o, -2)
        return _hat_overlaps_with_derivatives(phi, primitive, second_primitive, self.left, self.chord, s_o)

    def inertia_terms(self, s_o: float, ds_o: float, dds_o: float, damping: float = 0.0) -> InertiaTerms:
        functions = self.basis.values_derivatives_primitives(s_o)
        kinematics = s_o, ds_o, dds_o
        return inertia_terms_with_hat(functions, self.mass_at_rest, self.left, self.chord, kinematics, damping)

    def stiffness_matrix(self, s_o: float) -> Array:
        """int Phi_j' Phi_k' ds with the hat at s_o, (n, n)."""
        if not self.kink:
            return self._stiffness
        matrix = self._stiffness.copy()
        steepness = 1.0 / (s_o * (1.0 - s_o))
        matrix[-1, :-1] = matrix[:-1, -1] = steepness * self.basis.phi(np.array([s_o]))[0]
        matrix[-1, -1] = steepness
        return matrix

    def integrals(self) -> Array:
        """int Phi_j ds, (n,)."""
        return self._integrals

    def quadrature_with_slopes(self, s_o: float) -> tuple[Array, Array, Array]:
        """Points (n_q,), weights and Phi' (n, n_q)."""
        return self.basis.quadrature_with_kinked_slopes(s_o) if self.kink else self._slopes
