"""A rope between its contacts: on each segment sines, two polynomials and the points of its ends.

    r = sum_j B_j(xi) u_j,  xi = (s - s_L)/h,  h = s_R - s_L,  u = q_1, q_2, ..., p_L, p_R
    B = sin(j pi xi), xi (1 - xi), xi (1 - xi)(1 - 2 xi), 1 - xi, xi

The polynomials carry the curvature at the ends; sines alone converge slowly there.
Velocity and acceleration are those at fixed s, where xi changes as the ends L and R move.
A jet is an array whose first axis holds a value and its first two time derivatives at fixed s.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cablefem.scene.contacts import Array, Car, MovingLine, Wheel
from galerkin.bodies import OnRail
from galerkin.trolley import Follower, wheel_arm_in_car_axes

# coefficients of xi (1 - xi), xi (1 - xi)(1 - 2 xi), 1 - xi, xi by rising powers, one a column
POLYNOMIALS = np.array([[0.0, 1.0, -1.0, 0.0], [0.0, 1.0, -3.0, 2.0], [1.0, -1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]).T


def jet_product(f: Array, g: Array) -> Array:
    """The jet of f g."""
    return np.stack([f[0] * g[0], f[1] * g[0] + f[0] * g[1], f[2] * g[0] + 2.0 * f[1] * g[1] + f[0] * g[2]])


def jet_quotient(f: Array, g: Array) -> Array:
    """The jet of f/g."""
    x = f[0] / g[0]
    dx = (f[1] - x * g[1]) / g[0]
    return np.stack([x, dx, (f[2] - 2.0 * dx * g[1] - x * g[2]) / g[0]])


def jet_composition(F: Array, xi: Array) -> Array:
    """The jet of F(xi, t); F[i, k] holds the i-th time derivative of the k-th xi derivative at fixed xi."""
    value = F[0, 0]
    slope = F[0, 1]
    bend = F[0, 2]
    dx = xi[1, ..., None]
    ddx = xi[2, ..., None]
    acceleration = F[2, 0] + (2.0 * F[1, 1] + bend * dx) * dx + slope * ddx
    out = np.empty((3, *acceleration.shape))
    out[0] = value
    out[1] = F[1, 0] + slope * dx
    out[2] = acceleration
    return out


def basis_functions_and_derivatives(xi: Array, terms: int) -> Array:
    """B and its derivatives by xi up to the third, (4, points, terms + 4)."""
    k = np.pi * np.arange(1, terms + 1)
    sin = np.sin(k * xi[:, None])
    cos = np.cos(k * xi[:, None])
    sines = np.stack([sin, k * cos, -(k**2) * sin, -(k**3) * cos])
    others = [polyval(xi, polyder(POLYNOMIALS, order)).T for order in range(4)]
    return np.concatenate([sines, np.array(others)], axis=2)


class FunctionTables:
    """The functions B of a segment at G Gauss points of [0, 1], and integrals over them."""

    def __init__(self, terms: int) -> None:
        points, weights = np.polynomial.legendre.leggauss(2 * terms + 12)
        self.points = 0.5 + 0.5 * points
        self.weights = 0.5 * weights
        self.B = basis_functions_and_derivatives(self.points, terms)  # (4, G, M)
        self.flat = self.B.reshape(-1, terms + 4)
        self.tests = np.concatenate([self.B[0], self.B[1]]).T.copy()  # (M, 2 G)
        powered = np.vander(self.points, 3, increasing=True).T * self.weights  # (3, G)
        moments = self.B[0].T @ (powered[..., None] * self.B[:3, None])  # int B xi^k (B, B', B'')
        self.moments = moments.reshape(9, terms + 4, -1)
        self.end_slopes = basis_functions_and_derivatives(np.array([0.0, 1.0]), terms)[1]  # B' at L and R


class Layout:
    """Order of the coordinates: q (segment, function, axis), then x, y, angle, centre, s, outside force of contacts.

    F stands where second time derivatives stand.  A car on two wheels has two contacts; the angle, centre and force
    of its rear one are its own.
    """

    def __init__(self, line: MovingLine, terms: int) -> None:
        self.line = line
        self.terms = terms
        self.contacts = len(line.contacts_and_wheels)
        self.segments = self.contacts - 1
        self.tables = FunctionTables(terms)
        self.functions = terms + 2  # without those of the ends
        self.inner = 2 * self.functions * self.segments
        of_contacts = self.inner + np.arange(7 * self.contacts).reshape(-1, 7)
        self.moving = of_contacts[:, :5]
        self.x, self.y, self.angle, _, _, self.s, self.F = of_contacts.T
        # angles of the cabins of cars off the rope
        first = self.inner + 7 * self.contacts
        self.angle_off_rope = {car.name: i for i, car in enumerate(line.swinging_cars_off_rope, start=first)}
        self.size = first + len(self.angle_off_rope)
        wheels = {k: contact for k, contact in enumerate(line.contacts_and_wheels) if isinstance(contact, Wheel)}
        self.wheels = {k: self._wheel_on_car(k, wheel) for k, wheel in wheels.items()}
        self.dependent = self._dependent_coordinates(wheels)
        between_wheels = [k for k, wheel in wheels.items() if not wheel.front]
        self.outer = [i for i in range(self.segments) if i not in between_wheels]
        # between two wheels the rope takes the polynomials alone
        self.functions_of = [slice(2 * terms * (i in between_wheels), 2 * self.functions) for i in range(self.segments)]
        q = np.arange(self.inner).reshape(self.segments, -1)
        self.shapes = np.concatenate([q[i, part] for i, part in enumerate(self.functions_of)])
        ends = [at[side] for side in (slice(-1), slice(1, None)) for at in (self.x, self.y)]
        # of a segment: q, p of L and R, s of L and R, (segments, 2 functions + 6)
        self.columns = np.column_stack([q, *ends, self.s[:-1], self.s[1:]])
        self.softness = Softness(0.0, 1.0)
        # of `Rope.row_derivatives_until_next_call`; the same at each call, large new arrays are slow
        self.blocks = np.empty((3, self.segments, terms + 4, 2, 2 * terms + 10))

    def _wheel_on_car(self, k: int, wheel: Wheel) -> Follower:
        """x and y of a wheel at contact k by centre and pitch of its car, which are those of the rear wheel."""
        rear = k - wheel.front
        return Follower(self.moving[k, :2], self.moving[rear, 3:5], int(self.angle[rear]), wheel_arm_in_car_axes(wheel))

    def _dependent_coordinates(self, wheels: dict[int, Wheel]) -> list[Follower | OnRail]:
        """Coordinates that follow from others: centres of cars whose front x is given, wheels, depths on rails."""
        centres = []
        for k, wheel in wheels.items():
            if wheel.front and wheel.car.drive_kind == "haul_x":
                x, y = wheel_arm_in_car_axes(wheel)
                rear = k - 1
                centres.append(Follower(self.moving[rear, 3:4], self.moving[k, :1], int(self.angle[rear]), (-x, -y)))
        cars = {k: c for k, c in enumerate(self.line.contacts_and_wheels) if isinstance(c, Car)}
        rails = {k: car.rail for k, car in cars.items() if car.rail is not None}
        depths = [OnRail(self.moving[k, 1:2], int(self.moving[k, 0]), rail) for k, rail in rails.items()]
        return [*centres, *self.wheels.values(), *depths]

    def set_dependent_coordinates(self, Z: Array) -> None:
        """Set what follows from other coordinates in Z (3, ..., size)."""
        for dependent in self.dependent:
            dependent.set_dependent_coordinates(Z)


class Softness(NamedTuple):
    """N is replaced by about + fraction (N - about), in the search for rest."""

    about: float
    fraction: float


class Tensions(NamedTuple):
    """Tension at the Gauss points of all segments, (..., S, G)."""

    N: Array
    N_stretch: float  # dN/d|r'|
    stretch: Array  # |r'|
    force: Array  # N t (..., S, G, 2)


class Rope:
    """All segments at instants (...): arrays (..., S segments, G points), and M functions with those of the ends."""

    def __init__(self, layout: Layout, Z: Array) -> None:
        """Z (3, ..., layout.size): the jets of all coordinates."""
        self.layout = layout
        tables = layout.tables
        u = Z[..., layout.columns[:, :-2]]  # (3, ..., S, 2 M)
        ends = Z[..., layout.columns[:, -2:]]  # s of L and R (3, ..., S, 2)
        self.h = (ends[..., 1] - ends[..., 0])[..., None]
        self.left = ends[..., :1]
        h, dh, ddh = self.h
        self.xi = np.empty((*self.h.shape[:-1], tables.points.size))
        self.xi[0] = tables.points
        self.xi[1] = -(self.left[1] + tables.points * dh) / h
        self.xi[2] = -(self.left[2] + 2.0 * self.xi[1] * dh + tables.points * ddh) / h
        u = u.reshape(*u.shape[:-1], -1, 2)  # (3, ..., S, M, 2)
        coefficients = np.moveaxis(u, -2, 0).reshape(u.shape[-2], -1)  # (M, 3 ... S 2)
        values = tables.flat @ coefficients  # one product for all instants and segments: the tables are large
        values = values.reshape(4, -1, *u.shape[:-2], 2)
        self.Y = np.moveaxis(values, (2, 1), (0, -2))  # (3, 4, ..., S, G, 2): time derivatives of xi derivatives
        self.r = jet_composition(self.Y, self.xi)
        self.slope = self.Y[0, 1] / h[..., None]  # r' (..., S, G, 2)
        self.end_slopes = tables.end_slopes @ u[0] / h[..., None]  # at L and R (..., S, 2, 2)

    @cached_property
    def tensions(self) -> Tensions:
        rope = self.layout.line.rope
        softness = self.layout.softness
        squared = self.slope[..., 0] ** 2 + self.slope[..., 1] ** 2
        stretch = np.sqrt(squared)
        N = rope.EA * (squared - 1.0) / (stretch + 1.0)
        N = softness.about + softness.fraction * (N - softness.about)
        force = (N / stretch)[..., None] * self.slope
        return Tensions(N, softness.fraction * rope.EA, stretch, force)

    @cached_property
    def inertia_and_weight(self) -> Array:
        """rho (r.. - g j) (..., S, G, 2)."""
        line = self.layout.line
        acceleration = self.r[2].copy()
        acceleration[..., 1] -= line.gravity
        return line.rope.mass_per_length * acceleration

    @cached_property
    def inertia_and_weight_rows(self) -> Array:
        """int rho (r.. - g j) B ds (..., S, M, 2)."""
        w = (self.layout.tables.weights * self.h[0])[..., None]  # (..., S, G, 1)
        return self.layout.tables.B[0].T @ (w * self.inertia_and_weight)

    @cached_property
    def balance_rows(self) -> Array:
        """int rho (r.. - g j) B + N t . B' ds (..., S, M, 2); the last two are - N t at L and N t at R."""
        w = self.layout.tables.weights[:, None]
        both = np.concatenate([self.h[0, ..., None] * self.inertia_and_weight, self.tensions.force], axis=-2)
        return self.layout.tables.tests @ (np.concatenate([w, w]) * both)

    # --- derivatives by the coordinates of a segment, in the order of `Layout.columns` -------------------------------
    @property
    def end_slope_derivatives(self) -> Array:
        """Derivatives of r' at L and R, (S, 2, 2, 2 M + 2)."""
        of_functions = self.layout.tables.end_slopes  # (2, M)
        M = of_functions.shape[1]
        h = self.h[0, :, :, None]
        out = np.zeros((self.layout.segments, 2, 2, 2 * M + 2))
        out[:, :, 0, 0:-2:2] = out[:, :, 1, 1:-2:2] = of_functions / h
        out[..., -2] = self.end_slopes / h
        out[..., -1] = -self.end_slopes / h
        return out

    @property
    def jet_mass_matrices(self) -> Array:
        """int B (jet of B) dxi (3, S, M, M): at fixed s, B changes with xi."""
        (_, dl, ddl), (h, dh, ddh) = self.left, self.h  # (S, 1) each
        rate = np.stack([-dl / h, -dh / h, 0.0 * h])  # of xi by rising powers of it, (3, S, 1)
        squared = np.stack([rate[0] ** 2, 2.0 * rate[0] * rate[1], rate[1] ** 2])
        faster = -np.stack([ddl, ddh, 0.0 * h]) / h - 2.0 * dh / h * rate
        none = 0.0 * rate
        one = none + np.array([1.0, 0.0, 0.0])[:, None, None]
        # factors (3 derivatives of B, 3 powers) of the jet, (3, S, 9)
        factors = np.array([[one, none, none], [none, rate, none], [none, faster, squared]])
        return np.tensordot(np.moveaxis(factors[..., 0], 3, 1).reshape(3, -1, 9), self.layout.tables.moments, 1)

    def row_derivatives_until_next_call(self) -> Array:
        """Derivatives of the rows by coordinates, velocities and accelerations, (3, S, M, 2, 2 M + 2).

        The next call overwrites them.
        """
        line = self.layout.line
        layout = self.layout
        tensions = self.tensions
        rho = line.rope.mass_per_length
        B = layout.tables.B[0].T  # (M, G)
        slopes = layout.tables.B[1].T
        h = self.h[0]
        weights = layout.tables.weights
        S = layout.segments
        M = len(B)
        G = layout.tables.points.size

        def acceleration_derivatives(jet: Array) -> Array:
            """d(r..) by a coordinate, its velocity and acceleration, from the jet of dr/d(coordinate)."""
            return np.stack([jet[2], 2.0 * jet[1], jet[0]])

        inertia = acceleration_derivatives(self.jet_mass_matrices) * (rho * h)[..., None]  # (3, S, M, M)
        out = layout.blocks
        out[:] = 0.0
        out[:, :, :, 0, 0:-2:2] = out[:, :, :, 1, 1:-2:2] = inertia

        unit = self.slope / tensions.stretch[..., None]
        ratio = (tensions.N / tensions.stretch)[..., None, None]
        along = unit[..., :, None] * unit[..., None, :]
        stiffness = ratio * np.eye(2) + (tensions.N_stretch - ratio) * along  # d(N t)/dr' (S, G, 2, 2)
        weighed = (weights / h)[..., None, None] * stiffness
        for i in range(S):  # both axes by one product of matrices
            moved = weighed[i, :, :, None] * layout.tables.B[1][:, None, :, None]  # (G, 2, M, 2)
            out[0, i, ..., :-2] += (slopes @ moved.reshape(G, -1)).reshape(M, 2, 2 * M)

        one = np.array([1.0, 0.0, 0.0])[:, None, None]
        slope = jet_quotient(jet_composition(self.Y[:, 1:], self.xi), self.h[..., None])  # the jet of r'
        for i, (shift, dh) in enumerate(((one - self.xi, -1.0), (self.xi, 1.0))):  # of points with s of L, of R
            at_s = acceleration_derivatives(-jet_product(slope, shift[..., None]))  # of r at fixed s
            at_s[0] += shift[0, ..., None] * slope[2]
            out[..., i - 2] = B @ ((rho * h * weights)[..., None] * at_s)
            force = -(dh / h)[..., None] * (stiffness @ self.slope[..., None])[..., 0]
            by_length = (dh / h)[..., None] * self.inertia_and_weight_rows
            out[0, ..., i - 2] += slopes @ (weights[:, None] * force) + by_length
        return out
