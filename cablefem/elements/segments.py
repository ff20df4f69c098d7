"""Segments of rope between contacts that move along it: one segment's balance, on scikit-fem's matrices.

A segment from s_k to s_k+1 is a mesh on 0 <= xi <= 1, s = s_k + xi h.  Nodes move with c = ds_k (1 - xi) + ds_k+1 xi.
The unknowns are absolute points r of the nodes and the s_k.  With w = dr/dt - c r' at fixed s and the Lagrangian
L = sum of int rho w^2/2 - W(lam, s) + q y ds, the rows are

    r :    int rho (h dw + dh w) phi - q h j phi + (rho c w + N t) phi_xi dxi
    s_k :  int - rho psi (dw . r_xi + w . v_xi) - e rho (w^2/2 + c w . r')
               + e (W - N lam - q y) dxi,    dw: rate of w at fixed xi, and c_d w of the damping force -c_d rho w

psi and e are xi and 1 at a right end, 1 - xi and -1 at a left one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import skfem
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from cablefem.elements.bodies import STEP
from cablefem.elements.reference import element_unknowns, lagrange_element, shape_polynomial_coefficients
from cablefem.newmark import Array
from cablefem.scene.contacts import Elastic

SIGN = np.array([-1.0, 1.0])  # e of the left end and of the right one
DOWN = np.array([0.0, 1.0])


class Motion(NamedTuple):
    """r, v, a of the nodes of K segments (K, nn, 2); s, ds, dds of their ends (K, 2)."""

    r: Array
    v: Array
    a: Array
    s: Array
    ds: Array
    dds: Array

    @property
    def h(self) -> Array:
        """Lengths (K, 1)."""
        return self.s[:, 1:] - self.s[:, :1]


class Law(NamedTuple):
    """N = N_r + EA (lam - 1), W = W_r + N_r (lam - 1) + EA (lam - 1)^2/2; arrays (K, G)."""

    EA: Array
    N_r: Array
    W_r: Array


class PointFields(NamedTuple):
    """Fields at the Gauss points: (..., K, G), vectors (..., K, G, 2)."""

    h: Array
    dh: Array
    c: Array
    y: Array
    r_xi: Array
    v_xi: Array
    w: Array
    dw: Array
    lam: Array
    N: Array
    W: Array


class ElementShapes(NamedTuple):
    """Shape functions of the elements that hold some positions (...)."""

    nodes: NDArray[np.int64]  # (..., n_loc) of the segment
    values: Array  # (n_loc, ...)
    slopes: Array  # (n_loc, ...) by the position over the length of the element


def dot(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


class Segments:
    """Segments of `elements` each, with G Gauss points and nn nodes; any number K of them at once."""

    def __init__(self, rope: Elastic, gravity: float, elements: int, degree: int) -> None:
        self.rope = rope
        self.elements = elements
        self.degree = degree
        self.rho = rope.mass_per_length
        self.damping = rope.damping
        self.q = rope.mass_per_length * gravity
        self.nn = elements * degree + 1
        self.dofs = element_unknowns(degree, elements)
        mesh = skfem.MeshLine(np.linspace(0.0, 1.0, elements + 1))
        basis = skfem.Basis(mesh, lagrange_element(degree), intorder=2 * degree + 2)
        self.values, self.slopes = self._shape_values_and_slopes(basis)  # of the shape functions, (G, nn)
        self.xi = np.asarray(basis.global_coordinates())[0].ravel()  # (G,)
        self.psi = np.stack([1.0 - self.xi, self.xi], axis=1)  # (G, 2)
        self.weights = basis.dx.ravel()  # (G,)
        both_ends = np.array([[0.0, 1.0]]), np.ones(2)
        at_ends = skfem.Basis(mesh, lagrange_element(degree), quadrature=both_ends)
        _, slopes = self._shape_values_and_slopes(at_ends)
        self.end_slopes = slopes[[0, -1]]  # of the shape functions, (2, nn)

    def _shape_values_and_slopes(self, basis: skfem.Basis) -> tuple[Array, Array]:
        """Values and slopes of the nodes' shape functions at the points, (G, nn) each."""
        shape = basis.dx.shape  # (elements, points)
        out = np.zeros((2, *shape, self.nn))
        for k in range(basis.Nbfun):
            field = basis.basis[k][0]
            of_elements = np.broadcast_to(field.get(0), shape)
            slopes_of_elements = np.broadcast_to(field.grad[0], shape)
            for element, node in enumerate(self.dofs[:, k]):
                out[0, element, :, node] = of_elements[element]
                out[1, element, :, node] = slopes_of_elements[element]
        values, slopes = out.reshape(2, -1, self.nn)
        return values, slopes

    # --- fields --------------------------------------------------------------------------------------------
    def rope_law(self, count: int) -> Law:
        """The rope's law in `count` segments."""
        none = np.zeros((count, self.xi.size))
        return Law(none + self.rope.EA, none, none)

    def motion_at_points(self, motion: Motion) -> Array:
        """r, v, a, r_xi, v_xi, and s, ds, dds at both ends: (K, G, 16)."""
        r, v, a, s, ds, dds = motion
        values = self.values @ np.concatenate([r, v, a], axis=2)
        slopes = self.slopes @ np.concatenate([r, v], axis=2)
        ends = np.concatenate([s, ds, dds], axis=1)
        at_all_points = np.broadcast_to(ends[:, None], (*values.shape[:2], 6))
        return np.concatenate([values, slopes, at_all_points], axis=2)

    def fields_at_points(self, motion: Array, law: Law) -> PointFields:
        """Fields from `motion_at_points` (..., K, G, 16), which may be complex."""
        r, v, a, r_xi, v_xi, s, ds, dds = (motion[..., i : i + 2] for i in range(0, 16, 2))
        h = s[..., 1] - s[..., 0]
        dh = ds[..., 1] - ds[..., 0]
        c = dot(ds, self.psi)
        dc = dot(dds, self.psi)  # rate of c at fixed xi
        flow = (c / h)[..., None]
        slowing = (c * dh / h - dc) / h  # -d(c/h)/dt
        w = v - flow * r_xi
        dw = a - flow * v_xi + slowing[..., None] * r_xi + self.damping * w
        lam = np.sqrt(dot(r_xi, r_xi)) / h
        strain = lam - 1.0
        N = law.N_r + law.EA * strain
        W = law.W_r + (law.N_r + 0.5 * law.EA * strain) * strain
        return PointFields(h=h, dh=dh, c=c, y=r[..., 1], r_xi=r_xi, v_xi=v_xi, w=w, dw=dw, lam=lam, N=N, W=W)

    def fields_of_motion(self, motion: Motion) -> PointFields:
        """Fields at the Gauss points under the rope's own law."""
        return self.fields_at_points(self.motion_at_points(motion), self.rope_law(1))

    # --- rows ------------------------------------------------------------------------------------------------
    def row_densities(self, p: PointFields) -> Array:
        """At Gauss points: factors of phi (2), of phi_xi (2), and the rows of s at both ends (2); (..., K, G, 6)."""
        rho = self.rho
        rate = p.h[..., None] * p.dw + p.dh[..., None] * p.w  # of h w
        by_value = rho * rate - (self.q * p.h)[..., None] * DOWN
        momentum_flux = (rho * p.c)[..., None] * p.w
        per_length = p.N / (p.lam * p.h)
        by_slope = momentum_flux + per_length[..., None] * p.r_xi
        momentum = dot(p.dw, p.r_xi) + dot(p.w, p.v_xi)
        kinetic = 0.5 * dot(p.w, p.w) + p.c / p.h * dot(p.w, p.r_xi)
        material = p.W - p.N * p.lam - self.q * p.y - rho * kinetic
        of_s = SIGN * material[..., None] - rho * self.psi * momentum[..., None]
        return np.concatenate([by_value, by_slope, of_s], axis=-1)

    def node_and_end_rows(self, p: PointFields) -> tuple[Array, Array]:
        """Rows of the nodes (K, nn, 2) and of s at both ends (2, K)."""
        density = self.row_densities(p) * self.weights[:, None]
        by_value, by_slope, of_s = np.split(density, 3, axis=-1)
        of_nodes = self.values.T @ by_value + self.slopes.T @ by_slope
        return of_nodes, of_s.sum(axis=1).T

    def derivatives(self, motion: Motion, law: Law) -> Array:
        """D^T W J D: those of the rows by r, v and a, (3, K, m, m) for m = 2 nn + 2 nodes' x, y and s."""
        y = self.motion_at_points(motion)
        shifted = y + 1j * STEP * np.eye(16)[:, None, None, :]  # (16, K, G, 16)
        density = self.row_densities(self.fields_at_points(shifted, law))
        J = density.imag / STEP * self.weights[:, None]
        by_value, by_slope, by_ends = np.split(J.reshape(8, 2, *y.shape[:2], 6), [3, 5])  # slopes have no part in a
        by_nodes = np.einsum("dbkgo,gj->dkgojb", by_value, self.values)
        by_nodes[:2] += np.einsum("dbkgo,gj->dkgojb", by_slope, self.slopes)
        by_all_nodes = by_nodes.reshape(*by_nodes.shape[:4], -1)
        columns = np.concatenate([by_all_nodes, np.moveaxis(by_ends, 1, -1)], axis=4)  # (3, K, G, 6, m)
        of_value, of_slope, of_s = np.split(columns, 3, axis=3)
        of_nodes = np.einsum("gi,dkgam->dkiam", self.values, of_value)
        of_nodes = of_nodes + np.einsum("gi,dkgam->dkiam", self.slopes, of_slope)
        of_all_nodes = of_nodes.reshape(*of_nodes.shape[:2], 2 * self.nn, -1)
        return np.concatenate([of_all_nodes, of_s.sum(axis=2)], axis=2)

    def element_shapes(self, xi: Array) -> ElementShapes:
        """The shape functions at positions xi (...) in a segment; beyond it those of its first or last element."""
        element = np.clip((xi * self.elements).astype(int), 0, self.elements - 1)
        local = xi * self.elements - element
        coefficients = shape_polynomial_coefficients(lagrange_element(self.degree)).T
        slopes = polyval(local, polyder(coefficients))
        return ElementShapes(self.dofs[element], polyval(local, coefficients), slopes)
