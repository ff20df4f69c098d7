"""A car on two wheels; wheel i puts P_i on the rope, by the balance of the pieces beside it (`kernels.bodies`).

    sum P_i + m (c.. - g j) = f,  sum n_i . P_i + J th.. = M,  P_i . tau_i + f_i |<t>_i| = 0

e1 = (cos th, sin th), e2 = (-sin th, cos th), p_i = c + a_i e1 - d e2, n_i = dp_i/dth; f, M: force, moment about c.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.scene.contacts import Array, Car, MovingLine, Wheel
from galerkin import kernels
from galerkin.bodies import CarBody, ContactState, dot

Pair = tuple[float, float]


def vectors_from_turned_axes(components: Pair, angle: Array) -> Array:
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

    @property
    def kernel_records(self) -> list[tuple[Any, ...]]:
        """Of `kernels.FOLLOWER`, one for each axis."""
        x, y = self.arm
        return [(*places, self.pitch, *arm) for *places, arm in zip(self.p, self.c, ((x, y), (y, -x)), strict=False)]


def wheel_arm_in_car_axes(wheel: Wheel) -> Pair:
    """p - c along e1 and e2 [m]."""
    wheels = wheel.car.wheels
    assert wheels is not None
    return (0.5 if wheel.front else -0.5) * wheels.base - wheels.ahead, -wheels.below


class Trolley(CarBody):
    """A rigid car on two wheels; unless S or F is unknown, the front wheel grips the rope."""

    kind = kernels.TROLLEY
    contacts = 2

    def __init__(self, car: Car, line: MovingLine) -> None:
        super().__init__(car, line)
        self.unknown = {"grip": "tuvs", "haul": "tuvsF", "haul_x": "tvsSF", "free": "tuvsS"}[car.drive_mode_or_haul_x]
        self.arms = [wheel_arm_in_car_axes(Wheel(car=car, front=front)) for front in (False, True)]
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

    def turning_body_centre_and_velocity(self, x: ContactState) -> tuple[Array, Array]:
        return x.c, x.dc

    def energies(self, x: ContactState) -> Array:
        mass = self.car.mass
        kinetic = 0.5 * (mass * dot(x.dc, x.dc) + self.inertia * x.dangle[..., 0] ** 2)
        potential = -mass * self.gravity * x.c[..., 1]
        return np.stack([kinetic, 0.0 * kinetic, potential])

    def drag_drive_and_swing_powers(self, x: ContactState) -> dict[str, Array]:
        if self.car.drive_mode_or_haul_x == "grip":
            return {}
        direction = vectors_from_turned_axes(self.thrust_axes, x.angle)
        speed = dot(direction, x.dc) + self.lever * x.dangle[..., 0]  # of where F acts
        return {"drag": self.drag_power(x), self.driven: x.F * speed}
