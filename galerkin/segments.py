"""A rope between its contacts: on each segment sines, two polynomials and the points of its ends.

    r = sum_j B_j(xi) u_j,  xi = (s - s_L)/h,  h = s_R - s_L,  u = q_1, q_2, ..., p_L, p_R
    B = sin(j pi xi), xi (1 - xi), xi (1 - xi)(1 - 2 xi), 1 - xi, xi

The polynomials carry the curvature at the ends; sines alone converge slowly there.
Velocity and acceleration are those at fixed s, where xi changes as the ends L and R move.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cablefem.scene.contacts import Array, Car, MovingLine, Wheel
from galerkin import kernels
from galerkin.bodies import rail_kernel_record
from galerkin.trolley import Follower, wheel_arm_in_car_axes

# coefficients of xi (1 - xi), xi (1 - xi)(1 - 2 xi), 1 - xi, xi by rising powers, one a column
POLYNOMIALS = np.array([[0.0, 1.0, -1.0, 0.0], [0.0, 1.0, -3.0, 2.0], [1.0, -1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]).T


def sines_and_polynomials(xi: Array, terms: int, order: int) -> Array:
    """B, or their first or second derivatives by xi, (points, terms + 4)."""
    k = np.pi * np.arange(1, terms + 1)
    wave = np.cos if order == 1 else np.sin
    sines = (1.0, k, -(k**2))[order] * wave(k * xi[:, None])
    polynomials = polyval(xi, polyder(POLYNOMIALS, order)).T
    return np.concatenate([sines, polynomials], axis=1)


def segment_function_tables(terms: int) -> kernels.Tables:
    """The functions B of a segment at Gauss points of [0, 1]."""
    points, weights = np.polynomial.legendre.leggauss(2 * terms + 12)
    points = 0.5 + 0.5 * points
    weights = 0.5 * weights
    B, slopes, bends = (sines_and_polynomials(points, terms, order) for order in range(3))
    end_slopes = sines_and_polynomials(np.array([0.0, 1.0]), terms, 1)
    return kernels.Tables(
        points=points, weights=weights, B=B,
        of_q=np.concatenate([slopes, bends, end_slopes]), tests=np.concatenate([B, slopes]).T.copy(),
    )  # fmt: skip


def weights_of_means_over_shortest_waves(tables: kernels.Tables, terms: int) -> Array:
    """Weights (P, G) of means over equal pieces of a segment, about as long as the shortest wave of its sines."""
    pieces = max(1, terms // 2)
    within = np.arange(pieces)[:, None] == np.floor(pieces * tables.points)
    weights = within * tables.weights
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
        self.tables = segment_function_tables(terms)
        self.means = weights_of_means_over_shortest_waves(self.tables, terms)
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
        followers = [*self._driven_centres(wheels), *self.wheels.values()]
        # y of the cars on rails, from their x
        rails = {k: contact.rail for k, contact in contacts.items() if isinstance(contact, Car) and contact.rail}
        on_rails = [(self.y[k], self.x[k], rail_kernel_record(rail)) for k, rail in rails.items()]
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
        self.coordinates = kernels.Coordinates(
            columns=self.columns, moving=self.moving, s=self.s.copy(), F=self.F.copy(),
            followers=np.array([record for x in followers for record in x.kernel_records], kernels.FOLLOWER),
            on_rails=np.array(on_rails, kernels.ON_RAIL),
        )  # fmt: skip

    def _wheel_on_car(self, k: int, wheel: Wheel) -> Follower:
        """x and y of a wheel at contact k by centre and pitch of its car, which are those of the rear wheel."""
        rear = k - wheel.front
        return Follower(self.moving[k, :2], self.moving[rear, 3:5], int(self.angle[rear]), wheel_arm_in_car_axes(wheel))

    def _driven_centres(self, wheels: dict[int, Wheel]) -> list[Follower]:
        """x of the centres of cars whose front wheel has a prescribed x."""
        centres = []
        for k, wheel in wheels.items():
            if wheel.front and wheel.car.drive_mode_or_haul_x == "haul_x":
                x, y = wheel_arm_in_car_axes(wheel)
                rear = self.moving[k - 1]
                centres.append(Follower(rear[3:4], self.moving[k, :1], int(self.angle[k - 1]), (-x, -y)))
        return centres

    def set_dependent_coordinates(self, Z: Array) -> None:
        """Set what follows from other coordinates in Z (3, ..., size)."""
        kernels.set_dependent_coordinates(self.coordinates, Z.reshape(3, -1, self.size))
