"""Segments of rope between contacts that move along it: one segment's balance, on scikit-fem's matrices.

A segment from s_k to s_k+1 is a mesh on 0 <= xi <= 1, s = s_k + xi h.  Nodes move with c = ds_k (1 - xi) + ds_k+1 xi.
The unknowns are absolute points r of the nodes and the s_k.  With w = dr/dt - c r' at fixed s and the Lagrangian
L = sum of int rho w^2/2 - W(lam, s) + q y ds, the rows are

    r :    int rho (h dw + dh w + c_d h w) phi - q h j phi + (rho c w + N t) phi_xi dxi
    s_k :  int - rho psi (dw . r_xi + w . v_xi + c_d w . r_xi) - e rho (w^2/2 + c w . r')
               + e (W - N lam - q y) + W_s h psi dxi,    dw: rate of w at fixed xi

psi and e are xi and 1 at a right end, 1 - xi and -1 at a left one.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
import skfem

from cablefem.elements.reference import lagrange_element, numbered
from cablefem.newmark import Array
from cablefem.scene.contacts import Elastic

ENDS = np.array([-1.0, 1.0])[:, None, None]  # e of the left end and of the right one
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
    """N = N_r + EA (lam - 1), W = W_r + N_r (lam - 1) + EA (lam - 1)^2/2; arrays broadcast to (K, G)."""

    EA: Array
    N_r: Array
    slope: Array  # dN_r/ds
    W_r: Array


class Points(NamedTuple):
    """Fields at the Gauss points: (K, G) or (K, G, 2); lengths (K, 1)."""

    h: Array
    dh: Array
    c: Array
    dc: Array  # rate of c at fixed xi
    y: Array
    r_xi: Array
    v_xi: Array
    w: Array
    dw: Array
    lam: Array
    t: Array
    law: Law
    N: Array
    W: Array


class Tangent(NamedTuple):
    """Derivatives of the rows of each segment by its nodes and by s at its ends, times c0, c1, c2."""

    elements: Array  # (K E, 2, 2, n_loc, n_loc)
    columns: Array  # (2, K, nn, 2) of the nodes' rows by s at the left end and at the right one
    rows: Array  # (2, K, nn, 2) of the rows of s by the nodes
    corners: Array  # (2, 2, K) of the rows of s by s


def dot(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


class Segments:
    """Segments of `elements` each, with G Gauss points and nn nodes; any number K of them at once."""

    def __init__(self, rope: Elastic, gravity: float, elements: int, degree: int) -> None:
        self.rope, self.elements, self.degree = rope, elements, degree
        self.rho, self.q = rope.mass_per_length, rope.mass_per_length * gravity
        self.nn = elements * degree + 1
        mesh = skfem.MeshLine(np.linspace(0.0, 1.0, elements + 1))
        basis = skfem.Basis(mesh, lagrange_element(degree), intorder=2 * degree + 2)
        fields = [basis.basis[k][0] for k in range(basis.Nbfun)]
        shape = basis.dx.shape  # (elements, points)
        self.dofs = numbered(degree, elements)
        self.values, self.slopes = (
            self._matrix([np.broadcast_to(np.asarray(x), shape) for x in table])
            for table in ([f.get(0) for f in fields], [f.grad[0] for f in fields])
        )
        self.xi = np.asarray(basis.global_coordinates())[0].ravel()  # (G,)
        self.weights = basis.dx.ravel()  # (G,)
        self._weighted_values, self._weighted_slopes = self.weights * self.values.T, self.weights * self.slopes.T
        self.psi = np.stack([1.0 - self.xi, self.xi])[:, None]  # (2, 1, G)
        # slopes of the shape functions at both ends of a segment, (2, nn)
        both_ends = np.array([[0.0, 1.0]]), np.ones(2)
        outer = skfem.Basis(mesh, lagrange_element(degree), quadrature=both_ends)
        self.end_slopes = np.zeros((2, self.nn))
        for k in range(degree + 1):
            grad = outer.basis[k][0].grad[0]  # (elements, 2)
            self.end_slopes[0, self.dofs[0, k]], self.end_slopes[1, self.dofs[-1, k]] = grad[0, 0], grad[-1, 1]

    def _matrix(self, table: list[Array]) -> Array:
        """Values of the nodes' shape functions at the points, (G, nn), from (n_loc, elements, points)."""
        values = np.moveaxis(np.array(table), 0, -1)  # (elements, points, n_loc)
        out = np.zeros((*values.shape[:2], self.nn))
        for element, dofs in enumerate(self.dofs):
            out[element][:, dofs] = values[element]
        return out.reshape(-1, self.nn)

    @cached_property
    def _products(self) -> Array:
        """Products of two local shape functions or slopes with the weights: (4, points, n_loc^2).

        test phi and trial phi, phi and phi_xi, phi_xi and phi, phi_xi and phi_xi; equal elements share them.
        """
        points, n_loc = self.xi.size // self.elements, self.degree + 1
        phi, phi_xi = (x[:points, self.dofs[0]] for x in (self.values, self.slopes))
        pairs = [(phi, phi), (phi, phi_xi), (phi_xi, phi), (phi_xi, phi_xi)]
        w = self.weights[:points, None, None]
        return np.array([(w * test[:, :, None] * trial[:, None, :]).reshape(points, n_loc**2) for test, trial in pairs])

    # --- fields --------------------------------------------------------------------------------------------
    def law(self, x: Motion) -> Law:
        EA = np.array(self.rope.EA)
        if self.rope.rest_tension is None:
            return Law(EA, np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
        N_r, slope = self.rope.at_rest(x.s[:, :1] + x.h * self.xi)
        return Law(EA, N_r, slope, np.zeros((1, 1)))

    def points(self, x: Motion, law: Law | None = None) -> Points:
        law = law or self.law(x)
        h, dh = x.h, x.ds[:, 1:] - x.ds[:, :1]
        c, dc = (z[:, :1] * self.psi[0] + z[:, 1:] * self.psi[1] for z in (x.ds, x.dds))
        values = self.values @ np.concatenate([x.r, x.v, x.a], axis=2)
        slopes = self.slopes @ np.concatenate([x.r, x.v], axis=2)
        r_xi, v_xi = slopes[..., :2], slopes[..., 2:]
        w = values[..., 2:4] - (c / h)[..., None] * r_xi
        dw = values[..., 4:6] - (c / h)[..., None] * v_xi + ((c * dh / h - dc) / h)[..., None] * r_xi
        size = np.sqrt(dot(r_xi, r_xi))
        lam = size / h
        more = lam - 1.0
        N = law.N_r + law.EA * more
        W = law.W_r + (law.N_r + 0.5 * law.EA * more) * more
        return Points(h, dh, c, dc, values[..., 1], r_xi, v_xi, w, dw, lam, r_xi / size[..., None], law, N, W)

    def slopes_at_ends(self, x: Motion) -> Array:
        """r' at the left and at the right end, (2, K, 2)."""
        return np.einsum("en,kna->eka", self.end_slopes, x.r) / x.h

    # --- rows ------------------------------------------------------------------------------------------------
    def integrate(self, by_value: Array, by_slope: Array) -> Array:
        """int by_value phi + by_slope phi_xi dxi: rows (..., K, nn, 2) of fields (..., K, G, 2)."""
        return self._weighted_values @ by_value + self._weighted_slopes @ by_slope

    def residual(self, p: Points) -> tuple[Array, Array]:
        """Rows of the nodes (K, nn, 2) and of s at the left and right ends (2, K)."""
        rho, c_d = self.rho, self.rope.damping
        inertia = rho * (p.h[..., None] * p.dw + (p.dh + c_d * p.h)[..., None] * p.w)
        flux = (rho * p.c)[..., None] * p.w + p.N[..., None] * p.t
        nodes = self.integrate(inertia - (self.q * p.h)[..., None] * DOWN, flux)
        momentum = dot(p.dw + c_d * p.w, p.r_xi) + dot(p.w, p.v_xi)
        kinetic = 0.5 * dot(p.w, p.w) + p.c / p.h * dot(p.w, p.r_xi)
        material = p.W - p.N * p.lam - self.q * p.y
        density = ENDS * (material - rho * kinetic) + self.psi * (p.h * self._W_s(p) - rho * momentum)
        return nodes, density @ self.weights

    def _W_s(self, p: Points) -> Array:
        return p.law.slope * (p.lam - 1.0)

    def tangent(self, p: Points, c0: complex, c1: complex, c2: complex) -> Tangent:
        """c0 d/dr + c1 d/dv + c2 d/da of `residual`; without the second derivative of N_r."""
        return Tangent(self._elements(p, c0, c1, c2), *self._border(p, c0, c1, c2))

    def _elements(self, p: Points, c0: complex, c1: complex, c2: complex) -> Array:
        rho, c_d, n_loc = self.rho, self.rope.damping, self.degree + 1
        by_direction = p.N / p.lam
        alike = rho * np.stack([  # factors of the unit matrix, (4, K, G)
            np.broadcast_to(p.h * c2 + (p.dh + c_d * p.h) * c1, p.c.shape),
            -(p.dc + c_d * p.c) * c0 - p.c * c1,
            p.c * c1,
            (by_direction / rho - p.c**2) / p.h * c0,
        ])  # fmt: skip
        along = (p.law.EA - by_direction) / p.h * c0
        outer = np.stack([along * p.t[..., 0] ** 2, along * p.t[..., 0] * p.t[..., 1], along * p.t[..., 1] ** 2])
        count, products = len(p.h) * self.elements, self._products
        per_element = np.moveaxis(alike.reshape(4, count, -1), 0, 1).reshape(count, -1)  # (K E, 4 points)
        same = (per_element @ products.reshape(-1, n_loc**2)).reshape(count, n_loc, n_loc)
        xx, xy, yy = (outer.reshape(3, count, -1) @ products[3]).reshape(3, count, n_loc, n_loc)
        out = np.empty((count, 2, 2, n_loc, n_loc), same.dtype)
        out[:, 0, 0], out[:, 1, 1] = same + xx, same + yy
        out[:, 0, 1] = out[:, 1, 0] = xy
        return out

    def _border(self, p: Points, c0: complex, c1: complex, c2: complex) -> tuple[Array, Array, Array]:
        rho, c_d, psi, q = self.rho, self.rope.damping, self.psi, self.q
        h, dh, c, dc, r_xi, v_xi, w, dw = (np.asarray(x) for x in (p.h, p.dh, p.c, p.dc, p.r_xi, p.v_xi, p.w, p.dw))
        slope, W_s, EA = p.law.slope, self._W_s(p), p.law.EA
        r_s = r_xi / h[..., None]  # r'
        # rates of h, dh, c, dc by s at either end, (2, K or 1, G or 1)
        h_s, dh_s, c_s, dc_s, s_s = ENDS * c0, ENDS * c1, psi * c1, psi * c2, psi * c0
        lam_s = -p.lam * h_s / h
        N_s = slope * s_s + EA * lam_s
        w_s = (c * h_s / h - c_s)[..., None] * r_s  # (2, K, G, 2)
        dw_s = (dc * h_s / h - dc_s + (c_s * dh + c * dh_s) / h - 2.0 * c * dh * h_s / h**2)[..., None] * r_s + (
            (c * h_s / h - c_s) / h
        )[..., None] * v_xi
        inertia = rho * (
            h_s[..., None] * (dw + c_d * w) + h[..., None] * (dw_s + c_d * w_s) + dh_s[..., None] * w
            + dh[..., None] * w_s
        )  # fmt: skip
        flux = rho * (c_s[..., None] * w + c[..., None] * w_s) + N_s[..., None] * p.t
        columns = self.integrate(inertia - (q * h_s)[..., None] * DOWN, flux)

        # rows of s by the nodes: factors of phi and phi_xi
        e, weight = ENDS[..., None], psi[..., None]
        by_value = (
            -rho * (weight * ((c2 + c_d * c1) * r_xi + c1 * v_xi) + e * c1 * (w + c[..., None] * r_s))
            - e * (q * c0) * DOWN
        )
        momentum = (
            ((c * dh / h - dc) / h * c0 - (c1 + c_d * c0) * c / h)[..., None] * r_xi
            + c0 * (dw + c_d * w) - (c0 * c / h)[..., None] * v_xi + c1 * w
        )  # fmt: skip
        stretch = (c0 * (psi * slope - ENDS * p.lam * EA / h))[..., None] * p.t
        by_slope = -rho * (weight * momentum - e * (c0 * (c / h) ** 2)[..., None] * r_xi) + stretch
        rows = self.integrate(by_value, by_slope)

        # rows of s (first axis) by s (second axis)
        momentum = dot(dw_s + c_d * w_s, r_xi) + dot(w_s, v_xi)
        c_r = c_s * dot(w, r_s) + c * dot(w_s, r_s) - c * dot(w, r_s) * h_s / h
        kinetic = dot(w, w_s) + c_r
        material = -p.lam * (EA * lam_s + slope * s_s) + W_s * s_s
        inner = ENDS[:, None] * (material - rho * kinetic) + psi[:, None] * (
            slope * lam_s * h + W_s * h_s - rho * momentum
        )
        return columns, rows, inner @ self.weights
