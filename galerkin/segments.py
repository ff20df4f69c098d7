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
    x = f[0] * g[0]
    dx = f[1] * g[0] + f[0] * g[1]
    ddx = f[2] * g[0] + 2.0 * f[1] * g[1] + f[0] * g[2]
    return np.stack([x, dx, ddx])


def jet_quotient(f: Array, g: Array) -> Array:
    """The jet of f/g."""
    x = f[0] / g[0]
    dx = (f[1] - x * g[1]) / g[0]
    ddx = (f[2] - 2.0 * dx * g[1] - x * g[2]) / g[0]
    return np.stack([x, dx, ddx])


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
    phase = k * xi[:, None]
    sin = np.sin(phase)
    cos = np.cos(phase)
    sines = np.stack([sin, k * cos, -(k**2) * sin, -(k**3) * cos])
    polynomials = [polyval(xi, polyder(POLYNOMIALS, order)).T for order in range(4)]
    return np.concatenate([sines, polynomials], axis=2)


def acceleration_derivatives(jet: Array) -> Array:
    """d(r..) by a coordinate, its velocity and acceleration, from the jet of dr/d(coordinate)."""
    return np.stack([jet[2], 2.0 * jet[1], jet[0]])


class FunctionTables:
    """The functions B of a segment at G Gauss points of [0, 1], and integrals over them."""

    def __init__(self, terms: int) -> None:
        points, weights = np.polynomial.legendre.leggauss(2 * terms + 12)
        self.points = 0.5 + 0.5 * points
        self.weights = 0.5 * weights
        self.means = self._means_over_shortest_waves(terms)  # (P, G)
        self.B = basis_functions_and_derivatives(self.points, terms)  # (4, G, M)
        self.flat = self.B.reshape(-1, terms + 4)
        self.weights_of_tests = np.tile(self.weights, 2)[:, None]  # (2 G, 1)
        self.tests = np.concatenate([self.B[0], self.B[1]]).T.copy()  # (M, 2 G)
        powers = np.vander(self.points, 3, increasing=True).T  # (3, G)
        weighted = (powers * self.weights)[..., None]
        moments = self.B[0].T @ (weighted * self.B[:3, None])  # int B xi^k (B, B', B'')
        self.moments = moments.reshape(9, terms + 4, -1)
        ends = np.array([0.0, 1.0])
        self.end_slopes = basis_functions_and_derivatives(ends, terms)[1]  # B' at L and R

    def _means_over_shortest_waves(self, terms: int) -> Array:
        """Weights of means over equal pieces of a segment, about as long as the shortest wave of its sines."""
        pieces = max(1, terms // 2)
        within = np.arange(pieces)[:, None] == np.floor(pieces * self.points)
        weights = within * self.weights
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))


class Layout:
    """Order of the coordinates: q (segment, function, axis), then x, y, angle, centre, s, outside force of contacts.

    F stands where second time derivatives stand.  A car on two wheels has two contacts; the angle, centre and force
    of its rear one are its own.
    """

    def __init__(self, line: MovingLine, terms: int) -> None:
        self.line = line
        self.terms = terms
        contacts = dict(enumerate(line.contacts_and_wheels))
        self.contacts = len(contacts)
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
        wheels = {k: contact for k, contact in contacts.items() if isinstance(contact, Wheel)}
        self.wheels = {k: self._wheel_on_car(k, wheel) for k, wheel in wheels.items()}
        cars = {k: contact for k, contact in contacts.items() if isinstance(contact, Car)}
        self.dependent: list[Follower | OnRail] = [*self._driven_centres(wheels), *self.wheels.values()]
        self.dependent += self._depths_on_rails(cars)
        between_wheels = [k for k, wheel in wheels.items() if not wheel.front]
        segments = range(self.segments)
        self.outer = [i for i in segments if i not in between_wheels]
        # between two wheels the rope takes the polynomials alone
        first_function = [terms if i in between_wheels else 0 for i in segments]
        self.functions_of = [slice(2 * first, 2 * self.functions) for first in first_function]
        q = np.arange(self.inner).reshape(self.segments, -1)
        self.shapes = np.concatenate([q[i, part] for i, part in enumerate(self.functions_of)])
        points = of_contacts[:, :2]
        # of a segment: q, p of L and R, s of L and R, (segments, 2 functions + 6)
        self.columns = np.column_stack([q, points[:-1], points[1:], self.s[:-1], self.s[1:]])
        self.softness = Softness(0.0, 1.0)
        # of `Rope.row_derivatives_until_next_call`; the same at each call, large new arrays are slow
        self.blocks = np.empty((3, self.segments, terms + 4, 2, 2 * terms + 10))

    def _wheel_on_car(self, k: int, wheel: Wheel) -> Follower:
        """x and y of a wheel at contact k by centre and pitch of its car, which are those of the rear wheel."""
        rear = k - wheel.front
        return Follower(self.moving[k, :2], self.moving[rear, 3:5], int(self.angle[rear]), wheel_arm_in_car_axes(wheel))

    def _driven_centres(self, wheels: dict[int, Wheel]) -> list[Follower]:
        """x of the centres of cars whose front wheel has a prescribed x."""
        centres = []
        for k, wheel in wheels.items():
            if wheel.front and wheel.car.drive_kind == "haul_x":
                x, y = wheel_arm_in_car_axes(wheel)
                rear = self.moving[k - 1]
                centres.append(Follower(rear[3:4], self.moving[k, :1], int(self.angle[k - 1]), (-x, -y)))
        return centres

    def _depths_on_rails(self, cars: dict[int, Car]) -> list[OnRail]:
        """y of the cars on rails, from their x."""
        rails = {k: car.rail for k, car in cars.items() if car.rail is not None}
        return [OnRail(self.moving[k, 1:2], int(self.x[k]), rail) for k, rail in rails.items()]

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
        points = tables.points
        self.xi = np.empty((*self.h.shape[:-1], points.size))
        self.xi[0] = points
        self.xi[1] = -(self.left[1] + points * dh) / h
        self.xi[2] = -(self.left[2] + 2.0 * self.xi[1] * dh + points * ddh) / h
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
        EA = self.layout.line.rope.EA
        about, fraction = self.layout.softness
        squared = self.slope[..., 0] ** 2 + self.slope[..., 1] ** 2
        stretch = np.sqrt(squared)
        N = EA * (squared - 1.0) / (stretch + 1.0)
        N = about + fraction * (N - about)
        force = (N / stretch)[..., None] * self.slope
        return Tensions(N, fraction * EA, stretch, force)

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
        tables = self.layout.tables
        load = self.h[0, ..., None] * self.inertia_and_weight
        both = np.concatenate([load, self.tensions.force], axis=-2)  # (..., S, 2 G, 2)
        return tables.tests @ (tables.weights_of_tests * both)

    # --- derivatives by the coordinates of a segment, in the order of `Layout.columns` -------------------------------
    @property
    def end_slope_derivatives(self) -> Array:
        """Derivatives of r' at L and R, (S, 2, 2, 2 M + 2)."""
        of_functions = self.layout.tables.end_slopes  # (2, M)
        M = of_functions.shape[1]
        h = self.h[0, :, :, None]
        out = np.zeros((self.layout.segments, 2, 2, 2 * M + 2))
        out[:, :, 0, 0:-2:2] = of_functions / h
        out[:, :, 1, 1:-2:2] = of_functions / h
        out[..., -2] = self.end_slopes / h
        out[..., -1] = -self.end_slopes / h
        return out

    @property
    def jet_mass_matrices(self) -> Array:
        """int B (jet of B) dxi (3, S, M, M): at fixed s, B changes with xi."""
        _, dl, ddl = self.left[..., 0]  # (S,) each
        h, dh, ddh = self.h[..., 0]
        none = 0.0 * h
        # rate of xi, its square and its own rate at fixed s, by rising powers of xi, (3, S)
        a = -dl / h
        b = -dh / h
        rate = np.stack([a, b, none])
        squared = np.stack([a**2, 2.0 * a * b, b**2])
        faster = -np.stack([ddl, ddh, none]) / h - 2.0 * dh / h * rate
        # factors of the derivatives of B times powers of xi in the jet
        factors = np.zeros((3, h.size, 3, 3))
        factors[0, :, 0, 0] = 1.0
        factors[1, :, 1] = rate.T
        factors[2, :, 1] = faster.T
        factors[2, :, 2] = squared.T
        return np.tensordot(factors.reshape(3, -1, 9), self.layout.tables.moments, 1)

    @cached_property
    def slope_jet(self) -> Array:
        """The jet of r', (3, S, G, 2)."""
        return jet_quotient(jet_composition(self.Y[:, 1:], self.xi), self.h[..., None])

    @cached_property
    def force_derivatives(self) -> Array:
        """d(N t)/dr' (S, G, 2, 2)."""
        tensions = self.tensions
        unit = self.slope / tensions.stretch[..., None]
        along = unit[..., :, None] * unit[..., None, :]
        ratio = (tensions.N / tensions.stretch)[..., None, None]
        return ratio * np.eye(2) + (tensions.N_stretch - ratio) * along

    def row_derivatives_until_next_call(self) -> Array:
        """Derivatives of the rows by coordinates, velocities and accelerations, (3, S, M, 2, 2 M + 2).

        The next call overwrites them.
        """
        out = self.layout.blocks
        out[:] = 0.0
        self._set_derivatives_by_functions(out[..., :-2])
        for side in range(2):
            out[..., side - 2] = self._derivatives_by_end_position(side)
        return out

    def _set_derivatives_by_functions(self, out: Array) -> None:
        """Set those by the coefficients of the functions in `out` (3, S, M, 2, 2 M), zero before."""
        tables = self.layout.tables
        h = self.h[0]  # (S, 1)
        mass = self.layout.line.rope.mass_per_length * h
        inertia = acceleration_derivatives(self.jet_mass_matrices) * mass[..., None]  # (3, S, M, M)
        out[:, :, :, 0, 0::2] = inertia
        out[:, :, :, 1, 1::2] = inertia
        slopes = tables.B[1]  # (G, M)
        weighted = (tables.weights / h)[..., None, None] * self.force_derivatives
        for of_segment, weight in zip(out[0], weighted, strict=True):  # both axes by one product of matrices
            forces = weight[:, :, None] * slopes[:, None, :, None]  # (G, 2, M, 2)
            of_segment += (slopes.T @ forces.reshape(len(forces), -1)).reshape(of_segment.shape)

    def _derivatives_by_end_position(self, side: int) -> Array:
        """Those by s of L (0) or R (1), (3, S, M, 2)."""
        tables = self.layout.tables
        rho = self.layout.line.rope.mass_per_length
        h = self.h[0]  # (S, 1)
        dh = 2.0 * side - 1.0  # dh/ds of this end
        one = np.array([1.0, 0.0, 0.0])[:, None, None]
        shift = self.xi if side == 1 else one - self.xi  # of a point at this xi
        by_s = acceleration_derivatives(-jet_product(self.slope_jet, shift[..., None]))  # of r at fixed s
        by_s[0] += shift[0, ..., None] * self.slope_jet[2]
        out = tables.B[0].T @ ((rho * h * tables.weights)[..., None] * by_s)
        force = -(dh / h)[..., None] * (self.force_derivatives @ self.slope[..., None])[..., 0]
        by_length = (dh / h)[..., None] * self.inertia_and_weight_rows
        out[0] += tables.B[1].T @ (tables.weights[:, None] * force) + by_length
        return out
