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

from typing import Any, NamedTuple

import numpy as np
import skfem
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from cablefem.elements.bodies import STEP
from cablefem.elements.reference import (
    QuadraturePoints,
    element_unknowns,
    lagrange_element,
    shape_polynomial_coefficients,
    shape_table,
)
from cablefem.newmark import Array
from cablefem.scene.contacts import Elastic


class Motion(NamedTuple):
    """r, v, a of the nodes of K segments (K, nn, 2); s, ds, dds of their ends (K, 2)."""

    r: Array
    v: Array
    a: Array
    s: Array
    ds: Array
    dds: Array


class Law(NamedTuple):
    """N = N_r + EA (lam - 1), W = W_r + N_r (lam - 1) + EA (lam - 1)^2/2; arrays (K, G)."""

    EA: Array
    N_r: Array
    W_r: Array


class PointFields(NamedTuple):
    """Fields at points of the rope, numbers or arrays."""

    h: Any
    dh: Any
    c: Any
    flow: Any  # c/h
    depth: Any  # y
    x_xi: Any  # d/dxi of r
    y_xi: Any
    vx_xi: Any
    vy_xi: Any
    w_x: Any
    w_y: Any
    dw_x: Any
    dw_y: Any
    lam: Any
    N: Any
    W: Any


# --- of arrays, and in `segment_kernels` of numbers --------------------------------------------------------------
def fields_at_point(damping: float, law: Any, xi: Any, motion: Any) -> PointFields:
    """Fields under a `Law`; motion : r, r_xi and s of both ends, six numbers, with two rates (3, 6, ...)."""
    (_, y, x_xi, y_xi, begin, end), velocities, accelerations = motion
    v_x, v_y, vx_xi, vy_xi, ds_begin, ds_end = velocities
    a_x, a_y, _, _, dds_begin, dds_end = accelerations
    EA, N_r, W_r = law
    h = end - begin
    dh = ds_end - ds_begin
    c = ds_begin * (1.0 - xi) + ds_end * xi
    dc = dds_begin * (1.0 - xi) + dds_end * xi  # at fixed xi
    per_h = 1.0 / h
    flow = c * per_h
    slowing = (flow * dh - dc) * per_h  # -d(c/h)/dt
    w_x = v_x - flow * x_xi
    w_y = v_y - flow * y_xi
    dw_x = a_x - flow * vx_xi + slowing * x_xi + damping * w_x
    dw_y = a_y - flow * vy_xi + slowing * y_xi + damping * w_y
    lam = np.sqrt(x_xi * x_xi + y_xi * y_xi) * per_h
    N = N_r + EA * (lam - 1.0)
    W = W_r + (N_r + 0.5 * EA * (lam - 1.0)) * (lam - 1.0)
    return PointFields(h, dh, c, flow, y, x_xi, y_xi, vx_xi, vy_xi, w_x, w_y, dw_x, dw_y, lam, N, W)


def row_densities(rho: float, q: float, xi: Any, p: PointFields) -> Any:
    """Factors of phi (2), of phi_xi (2), and the rows of s at both ends (2)."""
    momentum = p.dw_x * p.x_xi + p.dw_y * p.y_xi + p.w_x * p.vx_xi + p.w_y * p.vy_xi
    kinetic = 0.5 * (p.w_x * p.w_x + p.w_y * p.w_y) + p.flow * (p.w_x * p.x_xi + p.w_y * p.y_xi)
    material = p.W - p.N * p.lam - q * p.depth - rho * kinetic
    per_length = p.N / (p.lam * p.h)
    return (
        rho * (p.h * p.dw_x + p.dh * p.w_x),
        rho * (p.h * p.dw_y + p.dh * p.w_y) - q * p.h,
        rho * p.c * p.w_x + per_length * p.x_xi,
        rho * p.c * p.w_y + per_length * p.y_xi,
        -material - (1.0 - xi) * rho * momentum,
        material - xi * rho * momentum,
    )


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
        table = shape_table(skfem.Basis(mesh, lagrange_element(degree), intorder=2 * degree + 2))
        self.xi = table[..., 0].ravel()  # (G,)
        self.psi = np.stack([1.0 - self.xi, self.xi], axis=1)  # (G, 2)
        self.weights = table[..., 1].ravel()  # (G,)
        # of an element's shape functions at its own points, (points, n_loc)
        self.phi, self.phi_xi = np.split(table[0, :, 2:].copy(), 2, axis=1)
        points = QuadraturePoints.from_table(self.dofs, table, 0, self.nn)
        self.values = points.values.toarray()  # of the segment's shape functions, (G, nn)
        self.slopes = points.slopes.toarray()
        both_ends = np.array([[0.0, 1.0]]), np.ones(2)
        at_ends = shape_table(skfem.Basis(mesh, lagrange_element(degree), quadrature=both_ends))
        slopes = QuadraturePoints.from_table(self.dofs, at_ends, 0, self.nn).slopes.toarray()
        self.end_slopes = slopes[[0, -1]]  # of the shape functions, (2, nn)

    # --- fields --------------------------------------------------------------------------------------------
    def rope_law(self, count: int) -> Law:
        """The rope's law in `count` segments."""
        none = np.zeros((count, self.xi.size))
        return Law(none + self.rope.EA, none, none)

    def motion_at_points(self, motion: Motion) -> Array:
        """What `fields_at_point` takes (3, 6, K, G)."""
        nodes = np.array(motion[:3])
        ends = np.array(motion[3:])
        values = np.moveaxis(self.values @ nodes, -1, 1)
        slopes = np.moveaxis(self.slopes @ nodes, -1, 1)
        at_all_points = np.broadcast_to(np.moveaxis(ends, -1, 1)[..., None], values.shape)
        return np.concatenate([values, slopes, at_all_points], axis=1)

    def fields_of_motion(self, motion: Motion) -> PointFields:
        """Fields (K, G) at the Gauss points under the rope's own law."""
        return fields_at_point(self.damping, self.rope_law(1), self.xi, self.motion_at_points(motion))

    # --- rows ------------------------------------------------------------------------------------------------
    def rows_of_nodes_and_segment_ends(self, p: PointFields) -> tuple[Array, Array]:
        """Rows of the nodes (K, nn, 2) and of s at both ends (2, K)."""
        density = np.stack(row_densities(self.rho, self.q, self.xi, p)) * self.weights  # (6, K, G)
        of_nodes = density[0:2] @ self.values + density[2:4] @ self.slopes
        return np.moveaxis(of_nodes, 0, -1), density[4:].sum(axis=-1)

    def element_derivatives(self, motion: Motion, law: Law) -> Array:
        """D^T W J D: those of the rows by r, v and a, (3, K, elements, m, m), m : x and y of the nodes and both s."""
        y = self.motion_at_points(motion)
        count, points = y.shape[2], len(self.phi)
        shifts = np.eye(18).reshape(3, 6, 18, 1, 1)
        shifted = y[:, :, None] + 1j * STEP * shifts
        fields = fields_at_point(self.damping, law, self.xi, shifted)
        densities = row_densities(self.rho, self.q, self.xi, fields)
        J = np.stack([x.imag for x in densities]) * (self.weights / STEP)  # (6, 18, K, G)
        by_order = J.reshape(6, 3, 6, count, self.elements, points)
        D = np.zeros((points, 6, 2 * self.degree + 4))
        for axis in range(2):
            D[:, axis, axis:-2:2] = self.phi
            D[:, 2 + axis, axis:-2:2] = self.phi_xi
        D[:, 4:, -2:] = np.eye(2)
        m = D.shape[2]
        by_coordinates = by_order.transpose(5, 0, 1, 3, 4, 2).reshape(points, -1, 6) @ D
        rows = D.reshape(-1, m).T @ by_coordinates.reshape(6 * points, -1)
        return np.moveaxis(rows.reshape(m, 3, count, self.elements, m), 0, 3)

    def element_shapes(self, xi: Array) -> ElementShapes:
        """The shape functions at positions xi (...) in a segment; beyond it those of its first or last element."""
        element = np.clip((xi * self.elements).astype(int), 0, self.elements - 1)
        local = xi * self.elements - element
        coefficients = shape_polynomial_coefficients(lagrange_element(self.degree)).T
        slopes = polyval(local, polyder(coefficients))
        return ElementShapes(self.dofs[element], polyval(local, coefficients), slopes)
