"""Balances at the contacts of a rope, as functions of the numbers in `Touch`; derivatives by complex steps.

    C = M (p.. - g j) - F_ext,  [N t] = C + rho ds^2 [r'],  C . tau = f |<r'>|/<|r'|>,  tau = <r'>/|<r'>|

[ ] is ahead less behind and < > their mean; C is the force that the rope gives to the car; f acts between both.
"""

from __future__ import annotations

import copy
import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cablefem.scene.contacts import Array, Car, Contact, MovingLine

TINY = 1e-30  # complex step
DOWN = np.array([0.0, 1.0])


def length(v: Array) -> Array:
    """|v|, also of complex vectors."""
    return np.sqrt(v[..., 0] ** 2 + v[..., 1] ** 2)


class Touch:
    """Numbers (..., 17) at a contact: N t behind, ahead; r' behind, ahead; p, p., p..; s., s..; F."""

    size = 17

    def __init__(self, x: Array) -> None:
        self.behind, self.ahead = x[..., 0:2], x[..., 2:4]  # 0 beyond the ends of the rope
        self.slope_behind, self.slope_ahead = x[..., 4:6], x[..., 6:8]
        self.p, self.dp, self.ddp = x[..., 8:10], x[..., 10:12], x[..., 12:14]
        self.ds, self.dds, self.F = x[..., 14], x[..., 15], x[..., 16]

    @cached_property
    def tau(self) -> Array:
        mean = self.slope_behind + self.slope_ahead
        return mean / length(mean)[..., None]

    @cached_property
    def projection(self) -> Array:
        """|<r'>|/<|r'|>."""
        return length(self.slope_behind + self.slope_ahead) / (length(self.slope_behind) + length(self.slope_ahead))


class Friction(NamedTuple):
    """f = hold - sign (rolling |N_c| + brake)."""

    rolling: float = 0.0
    brake: float = 0.0
    sign: float = 0.0
    hold: float | Array = 0.0  # (...)


class Body:
    """What a contact is tied to: an anchor unless a subclass says more."""

    unknown = ""  # of x, y, s and F

    def rows(self, x: Touch, of: Friction) -> Array:
        """The balances (..., n), one per unknown, zero where they hold."""
        return np.empty((*x.ds.shape, 0))

    def derivatives(self, numbers: Array, of: Friction) -> Array:
        """d(rows)/d(numbers) (n, 17)."""
        shifted = numbers + 1j * TINY * np.eye(Touch.size)
        return (self.rows(Touch(shifted), of).imag / TINY).T

    def energies(self, x: Touch) -> Array:
        """Kinetic, strain and potential energy (3, ...) [J]."""
        return np.zeros((3, *x.ds.shape))


class Saddle(Body):
    unknown = "s"

    def rows(self, x: Touch, of: Friction) -> Array:
        return (length(x.ahead) - length(x.behind))[..., None]


class Spring(Body):
    unknown = "xy"

    def __init__(self, contact: Contact) -> None:
        self.stiffness, self.point = np.array(contact.stiffness), np.array(contact.point)
        self.mass = contact.mass or 0.0

    def rows(self, x: Touch, of: Friction) -> Array:
        return x.behind - x.ahead + self.stiffness * (x.p - self.point) + self.mass * x.ddp

    def energies(self, x: Touch) -> Array:
        kinetic = 0.5 * self.mass * (x.dp**2).sum(axis=-1)
        strain = 0.5 * (self.stiffness * (x.p - self.point) ** 2).sum(axis=-1)
        return np.stack([kinetic, strain, 0.0 * strain])


class Counterweight(Body):
    """The rope beyond the pulley has the strain of G and no mass."""

    unknown = "s"

    def __init__(self, contact: Contact, outward: float, line: MovingLine) -> None:
        """outward : 1 at the right end of the rope, -1 at its left end."""
        self.force, self.outward = contact.force or math.nan, outward
        self.mass = self.force / line.gravity if contact.mass is None else contact.mass
        self.lift = outward * (1.0 + self.force / line.rope.EA)  # of the weight, over the motion of s

    def rows(self, x: Touch, of: Friction) -> Array:
        return (length(x.ahead + x.behind) - self.force - self.mass * self.lift * x.dds)[..., None]


class PointCar(Body):
    """A point mass; without an unknown s or F it grips the rope."""

    def __init__(self, car: Car, line: MovingLine) -> None:
        self.car, self.gravity, self.rho = car, line.gravity, line.rope.mass_per_length
        self.k = car.drive.k  # of drag [kg/m]
        self.unknown = {"grip": "xy", "haul": "xyF", "haul_x": "ysF", "free": "xys"}[car.kind]

    def held(self) -> PointCar:
        """The car at rest: a free one is held, and no wind blows."""
        other = copy.copy(self)
        other.k = 0.0
        if self.car.kind == "free":
            other.unknown = "xy"
        return other

    def drag(self, x: Touch) -> Array:
        air = x.dp - np.array([self.car.drive.wind, 0.0])
        return -self.k * length(air)[..., None] * air

    def contact_force(self, x: Touch) -> Array:
        """C."""
        own = self.car.mass * (x.ddp - self.gravity * DOWN)
        return own - self.drag(x) - x.F[..., None] * x.tau

    def pressing(self, x: Touch) -> Array:
        """Force on the rope normal to tau, positive down."""
        C, tau = self.contact_force(x), x.tau
        return C[..., 0] * tau[..., 1] - C[..., 1] * tau[..., 0]

    def friction(self, x: Touch, of: Friction) -> Array:
        """f."""
        if of.sign == 0.0:
            return of.hold + 0.0 * x.F
        pressing = self.pressing(x)
        return of.hold - of.sign * (of.rolling * pressing * np.sign(pressing.real) + of.brake)

    def rows(self, x: Touch, of: Friction) -> Array:
        kink = (self.rho * x.ds**2)[..., None] * (x.slope_ahead - x.slope_behind)
        C = self.contact_force(x)
        balance = x.behind - x.ahead + kink + C
        if self.unknown == "xy":
            return balance
        rolling = (C * x.tau).sum(axis=-1) - self.friction(x, of) * x.projection
        return np.concatenate([balance, rolling[..., None]], axis=-1)

    def energies(self, x: Touch) -> Array:
        kinetic = 0.5 * self.car.mass * (x.dp**2).sum(axis=-1)
        return np.stack([kinetic, 0.0 * kinetic, -self.car.mass * self.gravity * x.p[..., 1]])


def body_of(line: MovingLine, contact: Contact | Car) -> Body:
    if isinstance(contact, Car):
        return PointCar(contact, line)
    if contact.kind == "counterweight":
        return Counterweight(contact, 1.0 if contact is line.contacts[-1] else -1.0, line)
    if contact.kind == "spring":
        return Spring(contact)
    return Saddle() if contact.kind == "saddle" else Body()
