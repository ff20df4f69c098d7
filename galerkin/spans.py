"""Spans of a rope over contacts, by sines, two polynomials at the ends and a hat per car.

A span reaches from one contact that is no car to the next, a to b; a segment from a contact L to its neighbour R.

    y = sum_j q_j phi_j(z),  z = (s - s_a)/(s_b - s_a),  phi = sin(j pi z), z (1 - z), z (1 - z)(1 - 2 z)
    r = (1 - xi) (p_L - y_L) + xi (p_R - y_R) + y,  xi = (s - s_L)/(s_R - s_L)

p - y is the amplitude of a hat.  Velocity and acceleration are those at fixed s: contacts move, so z and xi do.
A jet is an array whose first axis holds a value and its first two time derivatives at fixed s.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from cablefem.scene.contacts import Array, Car, MovingLine

SIDES = 2  # of a segment: L and R
POLYNOMIALS = 2


def product(f: Array, g: Array) -> Array:
    """The jet of f g."""
    return np.stack([f[0] * g[0], f[1] * g[0] + f[0] * g[1], f[2] * g[0] + 2.0 * f[1] * g[1] + f[0] * g[2]])


def quotient(f: Array, g: Array) -> Array:
    """The jet of f/g."""
    x = f[0] / g[0]
    dx = (f[1] - x * g[1]) / g[0]
    return np.stack([x, dx, (f[2] - 2.0 * dx * g[1] - x * g[2]) / g[0]])


def composed(f: Array, z: Array) -> Array:
    """The jet of F(z, t); f[i, k] holds the i-th time derivative of the k-th z derivative of F, zero if not given."""
    z = z[..., None]
    jet = np.stack([f[0, 0], f[0, 1] * z[1], f[0, 2] * z[1] ** 2 + f[0, 1] * z[2]])
    if len(f) == 3:
        jet[1] += f[1, 0]
        jet[2] += f[2, 0] + 2.0 * f[1, 1] * z[1]
    return jet


def shapes(z: Array, terms: int) -> Array:
    """phi and its derivatives by z up to the third, (4, *z.shape, terms + 2)."""
    k = np.pi * np.arange(1, terms + 1)
    sin, cos = np.sin(k * z[..., None]), np.cos(k * z[..., None])
    out = np.empty((4, *z.shape, terms + POLYNOMIALS))
    out[..., :terms] = sin, k * cos, -(k**2) * sin, -(k**3) * cos
    one = np.ones_like(z)
    out[..., -2] = z * (1.0 - z), 1.0 - 2.0 * z, -2.0 * one, 0.0 * one
    out[..., -1] = z * (1.0 - z) * (1.0 - 2.0 * z), 1.0 - 6.0 * z * (1.0 - z), 12.0 * z - 6.0, 12.0 * one
    return out


class Layout:
    """Order of the coordinates: q (span, function, axis), then x, y, s and an outside force F of each contact.

    The last one has the force as its second time derivative.
    """

    def __init__(self, line: MovingLine, terms: int) -> None:
        self.line, self.terms, self.functions = line, terms, terms + POLYNOMIALS
        supports = [k for k, c in enumerate(line.contacts) if not isinstance(c, Car)]
        self.spans, self.contacts = len(supports) - 1, len(line.contacts)
        self.segments = self.contacts - 1
        self.span = np.searchsorted(supports, np.arange(self.segments), side="right") - 1  # of each segment
        self.first, self.last = np.array(supports)[self.span], np.array(supports)[self.span + 1]
        self.inner = 2 * self.functions * self.spans
        self.size = self.inner + 4 * self.contacts
        self.x, self.y, self.s, self.F = (self.inner + 4 * np.arange(self.contacts) + i for i in range(4))
        points, weights = np.polynomial.legendre.leggauss(2 * terms + 12)
        self.points = np.concatenate([[0.0], 0.5 + 0.5 * points, [1.0]])
        self.weights = np.concatenate([[0.0], 0.5 * weights, [0.0]])  # no weight at the ends
        self.softness = Softness(0.0, 1.0)

    @cached_property
    def columns(self) -> np.ndarray:
        """Coordinates that move a segment: q, points of L and R, s of L, R, a, b: (segments, 2 functions + 8)."""
        q = 2 * self.functions * self.span[:, None] + np.arange(2 * self.functions)
        L, R = np.arange(self.segments), np.arange(1, self.contacts)
        ends = [self.x[L], self.y[L], self.x[R], self.y[R], *(self.s[k] for k in (L, R, self.first, self.last))]
        return np.concatenate([q, np.stack(ends, axis=1)], axis=1)


class Softness(NamedTuple):
    """N is replaced by about + fraction (N - about), in the search for rest."""

    about: float
    fraction: float


class Law(NamedTuple):
    """Tension at points."""

    N: Array
    N_s: Array  # at fixed r'
    N_stretch: float
    stretch: Array  # |r'|
    force: Array  # N t


class Rope:
    """All segments at one instant: arrays over (segment, point)."""

    def __init__(self, layout: Layout, Z: Array) -> None:
        """Z (3, layout.size): the jets of all coordinates."""
        self.layout = layout
        q = Z[:, : layout.inner].reshape(3, layout.spans, layout.functions, 2)[:, layout.span]
        s, p = Z[:, layout.s], np.stack([Z[:, layout.x], Z[:, layout.y]], axis=-1)
        L, R, a, b = s[:, :-1], s[:, 1:], s[:, layout.first], s[:, layout.last]
        self.h, self.l = (R - L)[..., None], (b - a)[..., None]
        at = np.zeros((3, layout.segments, layout.points.size))
        at[0] = L[0][:, None] + self.h[0] * layout.points
        at[:, :, 0], at[:, :, -1] = L, R  # the ends move with their contacts
        self.s = at[0]
        self.z = quotient(at - a[..., None], self.l)
        self.xi = quotient(at - L[..., None], self.h)
        self.left = np.array([1.0, 0.0, 0.0])[:, None, None] - self.xi
        self.phi = shapes(self.z[0], layout.terms)  # (4, S, G, M)
        self.Y = self.phi @ q[:, None]  # (3, 4, S, G, 2): time derivatives of z derivatives
        y = composed(self.Y, self.z)
        self.hats = p[:, :-1] - y[:, :, 0], p[:, 1:] - y[:, :, -1]
        self.r = self._between(*self.hats) + y
        kink = (self.hats[1] - self.hats[0])[0, :, None] / self.h[0, ..., None]
        self.slope = kink + self.Y[0, 1] / self.l[0, ..., None]  # r' (S, G, 2)

    def _between(self, at_L: Array, at_R: Array) -> Array:
        """The jet of what the hats make of jets at both ends (3, S, n): (3, S, G, n)."""
        return product(self.left[..., None], at_L[:, :, None]) + product(self.xi[..., None], at_R[:, :, None])

    @cached_property
    def law(self) -> Law:
        rope = self.layout.line.rope
        N_r, N_s = rope.at_rest(self.s)
        squared = (self.slope**2).sum(axis=-1)
        stretch = np.sqrt(squared)
        N = N_r + rope.EA * (squared - 1.0) / (stretch + 1.0)
        about, fraction = self.layout.softness
        N = about + fraction * (N - about)
        return Law(N, fraction * N_s, fraction * rope.EA, stretch, (N / stretch)[..., None] * self.slope)

    @cached_property
    def load(self) -> Array:
        """rho (r.. + c r. - g j) (S, G, 2): inertia, damping and weight."""
        line = self.layout.line
        acceleration = self.r[2] + line.rope.damping * self.r[1] - [0.0, line.gravity]
        return line.rope.mass_per_length * acceleration

    @cached_property
    def tests(self) -> tuple[Array, Array]:
        """Functions of q, of p_L and of p_R and their slopes, (S, G, M + 2)."""
        phi, slope, h = self.phi[0], self.phi[1] / self.l[0, ..., None], self.h[0, ..., None]
        left, right = self.left[0, ..., None], self.xi[0, ..., None]
        values = phi - left * phi[:, :1] - right * phi[:, -1:]
        slopes = slope + (phi[:, :1] - phi[:, -1:]) / h
        ones = np.ones_like(left) / h
        return np.concatenate([values, left, right], axis=-1), np.concatenate([slopes, -ones, ones], axis=-1)

    @cached_property
    def rows(self) -> Array:
        """int rho (r.. + c r. - g j) test + N t . test' ds, (S, M + 2, 2); the last two: -N t at L, N t at R."""
        w = (self.layout.weights * self.h[0])[..., None]
        values, slopes = self.tests
        return values.transpose(0, 2, 1) @ (w * self.load) + slopes.transpose(0, 2, 1) @ (w * self.law.force)

    # --- derivatives: parts by coordinates, by velocities and by accelerations, first axis ---------------------------
    @cached_property
    def slope_columns(self) -> Array:
        """d(r')/d(columns) (S, G, 2, 2 M + 8), points at fixed xi."""
        n = self.tests[1].shape[-1]
        out = np.zeros((*self.slope.shape, 2 * n + 4))
        out[:, :, 0, 0 : 2 * n : 2] = out[:, :, 1, 1 : 2 * n : 2] = self.tests[1]
        out[..., 2 * n :] = np.moveaxis(self._border.slope, 0, -1)
        return out

    @property
    def columns(self) -> Array:
        """d(rows)/d(columns) (3, S, M + 2, 2, 2 M + 8)."""
        line, layout, law, border = self.layout.line, self.layout, self.law, self._border
        rho, c = line.rope.mass_per_length, line.rope.damping
        values, slopes = (x.transpose(0, 2, 1) for x in self.tests)  # (S, M + 2, G)
        w = layout.weights * self.h[0]

        def rates(jet: Array) -> Array:
            """d(r.. + c r.) where the jet is that of dr/d(coordinate)."""
            return np.stack([jet[2] + c * jet[1], 2.0 * jet[1] + c * jet[0], jet[0]])

        phi = composed(self.phi[None], self.z)
        psi = phi - self._between(phi[:, :, 0], phi[:, :, -1])
        hats = np.stack([self.left, self.xi], axis=-1)
        inertia = values @ (rho * w[..., None] * rates(np.concatenate([psi, hats], axis=-1)))  # (3, S, M + 2, M + 2)
        n = inertia.shape[-1]
        out = np.zeros((3, *inertia.shape[1:3], 2, 2 * n + 4))
        out[:, :, :, 0, 0 : 2 * n : 2] = out[:, :, :, 1, 1 : 2 * n : 2] = inertia

        unit = self.slope / law.stretch[..., None]
        along = (law.N_stretch - law.N / law.stretch)[..., None, None] * unit[..., :, None] * unit[..., None, :]
        stiffness = along + (law.N / law.stretch)[..., None, None] * np.eye(2)  # dN t/dr' (S, G, 2, 2)
        force = stiffness @ self.slope_columns  # (S, G, 2, 2 M + 8)
        force[..., 2 * n :] += np.moveaxis(border.shift * law.N_s, 0, -1)[:, :, None] * unit[..., None]
        S, G = w.shape
        out[0] += (slopes @ (w[..., None] * force.reshape(S, G, -1))).reshape(out.shape[1:])

        at_s = rho * w[..., None] * rates(border.jet)  # (3, 4, S, G, 2)
        at_s[0] += rho * w[..., None] * border.shift[..., None] * (self._slope_rates[2] + c * self._slope_rates[1])
        out[..., 2 * n :] += np.moveaxis(values @ at_s, 1, -1)
        moved = self._moved_tests(w[..., None] * self.load, w[..., None] * law.force)
        out[0, ..., 2 * n :] += np.moveaxis(moved, 0, -1)
        return out

    @cached_property
    def _slope_rates(self) -> Array:
        """The jet of r' (3, S, G, 2)."""
        kink = quotient(self.hats[1] - self.hats[0], self.h)[:, :, None]
        return kink + quotient(composed(self.Y[:, 1:], self.z), self.l[..., None])

    @cached_property
    def _border(self) -> Border:
        """Derivatives by s of L, R, a and b."""
        S, G = self.s.shape
        one = np.array([1.0, 0.0, 0.0])[:, None, None]
        per_l, per_h = quotient(one, self.l), quotient(one, self.h)
        z, xi = np.zeros((2, 3, 4, S, G))
        z[:, 2], z[:, 3] = -product(one - self.z, per_l), -product(self.z, per_l)
        z[:, 0, :, 0] = z[:, 1, :, -1] = per_l[..., 0]
        xi[:, 0], xi[:, 1] = -product(self.left, per_h), -product(self.xi, per_h)
        y = product(composed(self.Y[:, 1:], self.z)[:, None], z[..., None])  # (3, 4, S, G, 2)
        at_L, at_R = -y[:, :, :, 0], -y[:, :, :, -1]
        hats = product(self.left[:, None, ..., None], at_L[..., None, :])
        hats = hats + product(self.xi[:, None, ..., None], at_R[..., None, :])
        kink = (self.hats[1] - self.hats[0])[:, None, :, None]
        jet = y + hats + product(xi[..., None], kink)
        shift = np.zeros((4, S, G))  # of the points in s
        shift[0], shift[1] = self.left[0], self.xi[0]
        shift[:, :, [0, -1]] = 0.0  # in z already
        moved = z[0] + shift * per_l[0]
        h, l = self.h[0], self.l[0]
        dh, dl = np.array([[-1.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.0]])[:, :, None, None]
        slope = ((at_R - at_L)[0, :, :, None] - kink[0] * (dh / h)[..., None]) / h[..., None]
        slope = slope + (self.Y[0, 2] * moved[..., None] - self.Y[0, 1] * (dl / l)[..., None]) / l[..., None]
        return Border(jet, shift, moved, slope, dh / h, dl / l)

    def _moved_tests(self, load: Array, force: Array) -> Array:
        """int load d(test) + force . d(test') ds by the s of L, R, a and b, weight included: (4, S, M + 2, 2)."""
        border, rows = self._border, self.rows
        h, l = self.h[0, ..., None], self.l[0, ..., None]
        first, second = self.phi[1].transpose(0, 2, 1), self.phi[2].transpose(0, 2, 1)
        moved = border.moved[..., None]  # (4, S, G, 1)
        out = first @ (moved * load - border.dl[..., None] * force / l) + second @ (moved * force / l)
        total = force.sum(axis=1) / h[:, 0]  # (S, 2)
        to_L = (self.left[0, ..., None] * load).sum(axis=1) - total
        to_R = (self.xi[0, ..., None] * load).sum(axis=1) + total
        for point, to in ((0, to_L), (-1, to_R)):
            out = out - (self.phi[1][:, point] * moved[:, :, point])[..., None] * to[:, None]
        kink = border.dh * (self.phi[0][:, 0] - self.phi[0][:, -1])  # (4, S, M)
        out = out - kink[..., None] * total[:, None]
        ends = border.dh[..., None] * np.stack([total, -total], axis=1)  # (4, S, 2, 2)
        return np.concatenate([out, ends], axis=2) + border.dh[..., None] * rows


class Border(NamedTuple):
    """Derivatives by s of L, R, a and b, first axis or the second of a jet."""

    jet: Array  # of r at fixed s (3, 4, S, G, 2)
    shift: Array  # of s at fixed xi (4, S, G)
    moved: Array  # of z at fixed xi
    slope: Array  # of r' at fixed xi (4, S, G, 2)
    dh: Array  # of log h (4, 1, 1)
    dl: Array  # of log l
