"""A car on two wheels; wheel i puts P_i on the rope, by the balance of the pieces beside it.

    sum P_i + m (c.. - g j) = f,  sum n_i . P_i + J th.. = M,  P_i . tau_i + f_i |<r'>|/<|r'|> = 0

e1 = (cos th, sin th), e2 = (-sin th, cos th), p_i = c + a_i e1 - d e2, n_i = dp_i/dth; f, M: force, moment about c.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.scene.contacts import Array, Car, MovingLine, Wheel
from galerkin.bodies import DOWN, CarBody, ContactState, Friction, dot, downward_normal_component

Pair = tuple[float, float]


def rotate(components: Pair, angle: Array) -> Array:
    """The vectors (..., 2) with these components along e1 and e2; angle (..., 1)."""
    cos = np.cos(angle)
    sin = np.sin(angle)
    x, y = components
    return np.concatenate([x * cos - y * sin, x * sin + y * cos], axis=-1)


class Follower(NamedTuple):
    """Coordinates p = c + arm, where the arm turns with a car."""

    p: NDArray[np.intp]  # indices of the coordinates, x and y or x alone
    c: NDArray[np.intp]
    pitch: int
    arm: Pair  # [m] along e1, e2

    def arm_and_derivative(self, pitch: Array) -> tuple[Array, Array]:
        """The arm and d(arm)/d(pitch), (..., 2) or (..., 1)."""
        arm = rotate(self.arm, pitch)
        derivative = rotate(arm_derivative(self.arm), pitch)
        axes = slice(self.p.size)
        return arm[..., axes], derivative[..., axes]

    def set_dependent_coordinates(self, Z: Array) -> None:
        """Set p and its rates in Z (3, ..., coordinates)."""
        th, dth, ddth = Z[..., self.pitch, None]
        arm, n = self.arm_and_derivative(th)
        Z[0][..., self.p] = Z[0][..., self.c] + arm
        Z[1][..., self.p] = Z[1][..., self.c] + dth * n
        Z[2][..., self.p] = Z[2][..., self.c] + ddth * n - dth**2 * arm

    def fold_dependent_derivatives(self, K: Array, Z: Array, column: Array) -> None:
        """Add the derivatives by p and its rates to those by c and pitch; K (3, rows, columns)."""
        th, dth, ddth = Z[:, self.pitch, None]
        arm, n = self.arm_and_derivative(th)
        by = K[..., column[self.p]]  # (3, rows, p.size)
        K[..., column[self.c]] += by
        by_p, by_v, by_a = by
        at = column[self.pitch]
        dn = -dth * arm
        ddn = -(ddth * arm + dth**2 * n)
        K[0, :, at] += by_p @ n + by_v @ dn + by_a @ ddn
        K[1, :, at] += by_v @ n + by_a @ (2.0 * dn)
        K[2, :, at] += by_a @ n


def arm_derivative(arm: Pair) -> Pair:
    """d(arm)/d(pitch): the arm turned by 90 degrees."""
    return -arm[1], arm[0]


def wheel_arm_in_car_axes(wheel: Wheel) -> Pair:
    """p - c along e1 and e2 [m]."""
    wheels = wheel.car.wheels
    assert wheels is not None
    return (0.5 if wheel.front else -0.5) * wheels.base - wheels.ahead, -wheels.below


class WheelPair(NamedTuple):
    """What acts on a car on two wheels; angle, centre and F of the car are with the rear one."""

    rear: ContactState
    front: ContactState


class Trolley(CarBody):
    """A rigid car on two wheels; unless S or F is unknown, the front wheel grips the rope."""

    contacts = 2

    def __init__(self, car: Car, line: MovingLine) -> None:
        super().__init__(car, line)
        self.unknown = {"grip": "tuvs", "haul": "tuvsF", "haul_x": "tvsSF", "free": "tuvsS"}[car.drive_kind]
        self.arms_in_car_axes = [wheel_arm_in_car_axes(Wheel(car=car, front=front)) for front in (False, True)]
        self.inertia = car.wheels.inertia if car.wheels is not None else 0.0
        drive = car.drive
        ahead, below = drive.hitch if drive.mode == "haul" else drive.thrust_at
        forward = math.cos(drive.thrust_angle)
        down = -math.sin(drive.thrust_angle)
        self.thrust_axes = forward, down  # of a unit force
        self.lever = ahead * down - below * forward

    def brake_forces_of_wheels(self, s: Any) -> Array:
        rear = np.asarray(self.car.drive.rear_brake_force(s))
        return np.stack([rear, self.car.drive.brake_force(s) - rear], axis=-1)

    def turning_body_centre_and_velocity(self, x: WheelPair) -> tuple[Array, Array]:
        return x.rear.c, x.rear.dc

    def state_from_contact_values(self, contact_values: Array) -> WheelPair:
        rear = ContactState(contact_values[..., 0, :])
        front = ContactState(contact_values[..., 1, :])
        return WheelPair(rear, front)

    def wheel_states(self, x: WheelPair) -> Sequence[ContactState]:
        return x

    def normal_wheel_loads(self, x: WheelPair) -> Array:
        loads = [downward_normal_component(self.force_on_rope(wheel), wheel.tau) for wheel in x]
        return np.stack(loads, axis=-1)

    def tangential_force_on_last_wheel(self, x: WheelPair) -> Array:
        return -dot(self.force_on_rope(x.front), x.front.tau)

    def balance_rows(self, x: WheelPair, friction: Friction) -> Array:
        car = x.rear  # with the angle, the centre and F
        P_rear, P_front = (self.force_on_rope(wheel) for wheel in x)
        n_rear, n_front = (rotate(arm_derivative(arm), car.angle) for arm in self.arms_in_car_axes)
        driven = car.F[..., None] * rotate(self.thrust_axes, car.angle)
        drag = self.drag_force(car.dc)
        inertia_and_weight = self.car.mass * (car.ddc - self.gravity * DOWN)
        force = P_rear + P_front + inertia_and_weight - driven - drag
        of_wheels = dot(n_rear, P_rear) + dot(n_front, P_front)
        moment = of_wheels + self.inertia * car.ddangle[..., 0] - self.lever * car.F
        slip = self.signed_friction_and_hold(self.normal_wheel_loads(x), friction)
        scalars = [moment, dot(P_rear, x.rear.tau) + slip[..., 0] * x.rear.cos_phi]
        if self.unknown[-1] != "s":
            scalars.append(dot(P_front, x.front.tau) + slip[..., 1] * x.front.cos_phi)
        return np.concatenate([force, np.stack(scalars, axis=-1)], axis=-1)

    def energies(self, x: WheelPair) -> Array:
        car = x.rear
        mass = self.car.mass
        kinetic = 0.5 * (mass * dot(car.dc, car.dc) + self.inertia * car.dangle[..., 0] ** 2)
        potential = -mass * self.gravity * car.c[..., 1]
        return np.stack([kinetic, 0.0 * kinetic, potential])

    def drag_drive_and_swing_powers(self, x: WheelPair) -> dict[str, Array]:
        if self.car.drive_kind == "grip":
            return {}
        car = x.rear
        drag = dot(self.drag_force(car.dc), car.dc)
        direction = rotate(self.thrust_axes, car.angle)
        speed = dot(direction, car.dc) + self.lever * car.dangle[..., 0]  # of where F acts
        return {"drag": drag, self.driven: car.F * speed}
