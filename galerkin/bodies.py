"""Bodies at the contacts of a rope; `kernels.bodies` has their balances, by the values in `ContactState`.

    C = M (p.. - g j) - F_ext,  [N t] = C + rho ds^2 [r'],  C . tau = f |<t>|,  tau = <t>/|<t>|,  t = r'/|r'|

[ ] is ahead less behind and < > their mean; C is the force that the rope gives to the car; f acts between both.
A cabin m that hangs h below, its angle phi positive forward, has its centre at p + h e2, e2 = (sin phi, cos phi),
e1 = de2/dphi. It adds m h (phi.. e1 - phi.^2 e2) to C, and the balance of moments about the hanger

    (J + m h^2) phi.. + m h (p.. . e1 + g sin phi) + c phi. = h F_drag . e1.
"""

from __future__ import annotations

import copy
import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cablefem.scene.contacts import Array, Car, Contact, MovingLine
from cablefem.scene.rail import Rail
from galerkin import kernels


def length(v: Array) -> Array:
    """|v| of vectors (..., 2)."""
    return np.sqrt(v[..., 0] ** 2 + v[..., 1] ** 2)


def dot(a: Array, b: Array) -> Array:
    """a . b of vectors (..., 2)."""
    return (a * b).sum(axis=-1)


def rail_kernel_record(rail: Rail) -> tuple[Any, ...]:
    """What compiled functions take of a rail."""
    return rail.begin.x, rail.end.x - rail.begin.x, rail.coefficients


class ContactState:
    """Numbers (..., wheels, 26): N t behind, ahead; r' behind, ahead; p, angle, c and their rates; s., s..; F.

    A contact has one wheel; what acts at the rear one of two, where angle, centre and F of the car stand, comes first.
    """

    size = 26

    def __init__(self, values: Array) -> None:
        self.values = values
        x = values[..., 0, :]
        self.behind = x[..., 0:2]  # 0 beyond the ends of the rope
        self.ahead = x[..., 2:4]
        self.slope_behind = x[..., 4:6]
        self.slope_ahead = x[..., 6:8]
        self.p = x[..., 8:10]
        self.dp = x[..., 13:15]
        self.ddp = x[..., 18:20]
        self.angle = x[..., 10, None]  # (..., 1)
        self.dangle = x[..., 15, None]
        self.ddangle = x[..., 20, None]
        self.c = x[..., 11:13]
        self.dc = x[..., 16:18]
        self.ds = x[..., 23]
        self.F = x[..., 25]

    @property
    def wheels(self) -> list[ContactState]:
        """Each wheel, from left to right."""
        return [ContactState(self.values[..., j : j + 1, :]) for j in range(self.values.shape[-2])]

    @cached_property
    def mean_tangent(self) -> Array:
        """<t> (..., 2)."""
        behind = self.slope_behind / length(self.slope_behind)[..., None]
        ahead = self.slope_ahead / length(self.slope_ahead)[..., None]
        return 0.5 * (behind + ahead)

    @cached_property
    def tau(self) -> Array:
        """The unit mean tangent (..., 2)."""
        return self.mean_tangent / self.cos_phi[..., None]

    @property
    def mean_stretch(self) -> Array:
        """<|r'|>."""
        return 0.5 * (length(self.slope_behind) + length(self.slope_ahead))

    @cached_property
    def cos_phi(self) -> Array:
        """|<t>|."""
        return length(self.mean_tangent)


class Friction(NamedTuple):
    """f = hold - sign (rolling |N_c| + brake) at the last wheel, and the same without hold at the rear one of two."""

    rolling: float = 0.0
    rear_brake: float = 0.0
    brake: float = 0.0
    sign: float = 0.0
    hold: float = 0.0


class Body:
    """What a contact is tied to: an anchor unless a subclass says more."""

    kind = kernels.ANCHOR
    unknown = ""  # coordinates: x, y, angle t, centre u and v, s, that of the next contact S, F
    contacts = 1

    @property
    def balance_count(self) -> int:
        """Number of its balances, one per unknown."""
        return len(self.unknown)

    @property
    def kernel_record(self) -> Any:
        """What its compiled balances take: attributes of these names."""
        out = np.zeros(1, kernels.BODY)
        for name in kernels.BODY.names or ():
            out[name] = getattr(self, name, 0)
        return out

    def energies(self, x: ContactState) -> Array:
        """Kinetic, strain and potential energy (3, ...) [J]."""
        return np.zeros((3, *x.ds.shape))


class Saddle(Body):
    """A support over which the rope runs without friction."""

    kind = kernels.SADDLE
    unknown = "s"


class Spring(Body):
    """An elastic support."""

    kind = kernels.SPRING
    unknown = "xy"

    def __init__(self, contact: Contact) -> None:
        self.stiffness = np.array(contact.stiffness)
        self.point = np.array(contact.point)

    def energies(self, x: ContactState) -> Array:
        strain = 0.5 * (self.stiffness * (x.p - self.point) ** 2).sum(axis=-1)
        none = 0.0 * strain
        return np.stack([none, strain, none])


class Counterweight(Body):
    """The rope beyond the pulley has the strain of G and no mass."""

    kind = kernels.COUNTERWEIGHT
    unknown = "s"

    def __init__(self, contact: Contact, outward: float, line: MovingLine) -> None:
        """outward : 1 at the right end of the rope, -1 at its left end."""
        self.force = contact.force or math.nan
        self.outward = outward
        self.lift = outward * (1.0 + self.force / line.rope.EA)  # of the weight, over the motion of s
        self.mass_of_rise = self.force / line.gravity * self.lift


class CarBody(Body):
    """What cars on one and on two wheels have in common."""

    turns = True

    def __init__(self, car: Car, line: MovingLine) -> None:
        self.car = car
        self.mass = car.mass
        self.wind = car.drive.wind
        self.gravity = line.gravity
        self.rho = line.rope.mass_per_length
        self.k = car.drive.k  # of drag [kg/m]
        self.driven = "haul" if car.drive.mode == "haul" else "thrust"

    def copy_held(self) -> Any:
        """The car at rest in the wind: a free one is held."""
        other = copy.copy(self)
        if self.car.drive_mode_or_haul_x == "free":
            other.unknown = self.unknown[:-1]
        return other

    def brake_forces_of_wheels(self, s: Any) -> Array:
        """Forces of the brakes on the wheels (..., wheels) [N], from left to right, with the car at s (...)."""
        return np.asarray(self.car.drive.brake_force(s))[..., None]

    def turning_body_centre_and_velocity(self, x: ContactState) -> tuple[Array, Array]:
        """Point and velocity (..., 2) of the centre of mass of what turns, else of the car."""
        raise NotImplementedError

    def drag_drive_and_swing_powers(self, x: ContactState) -> dict[str, Array]:
        """Powers (...) [W] by cause, but those of friction, grip and hold."""
        raise NotImplementedError

    def forces(self, x: ContactState) -> Array:
        """Of `kernels.set_forces_on_car`, (..., FORCES)."""
        *instants, wheels, size = x.values.shape
        forces = kernels.forces_on_car(self.kernel_record, x.values.reshape(-1, wheels, size).astype(complex))
        return np.asarray(forces.reshape(*instants, -1))

    def force_needed_from_rope(self, x: ContactState) -> Array:
        """C (..., 2) [N], the force that car and cabin need, by their motion."""
        return self.forces(x)[..., 0:2]

    def force_on_rope(self, x: ContactState) -> Array:
        """The force (..., 2) on the rope at the last wheel, by the balance of the pieces beside it."""
        return self.forces(x)[..., 2 * self.contacts : 2 * self.contacts + 2]

    def normal_wheel_loads(self, x: ContactState) -> Array:
        """Forces of the wheels on the rope (..., wheels) [N] normal to tau, positive down."""
        return self.forces(x)[..., 6 : 6 + self.contacts]

    def tangential_force_on_last_wheel(self, x: ContactState) -> Array:
        """Force (...) [N] of the rope on the last wheel along tau."""
        return dot(-self.force_on_rope(x), x.wheels[-1].tau)

    def drag_power(self, x: ContactState) -> Array:
        """[W], wind included."""
        return dot(self.forces(x)[..., 9:], self.turning_body_centre_and_velocity(x)[1])

    def max_friction_plus_brake_force(self, x: ContactState, friction: Friction) -> Array:
        """Sum over the wheels (...) [N] of what friction and brakes can give."""
        loads = np.abs(self.normal_wheel_loads(x))
        return np.asarray((friction.rolling * loads).sum(axis=-1) + friction.rear_brake + friction.brake)


class PointCar(CarBody):
    """A point mass, with a cabin that swings or without; unless s or F is unknown it grips the rope."""

    kind = kernels.POINT_CAR

    def __init__(self, car: Car, line: MovingLine) -> None:
        super().__init__(car, line)
        hanger = car.hanger
        self.unknown = {"grip": "xy", "haul": "xyF", "haul_x": "ysF", "free": "xys"}[car.drive_mode_or_haul_x]
        self.on_rail = car.rail is not None
        if car.rail is not None:
            self.unknown = self.unknown.replace("y", "")
            self.rail = rail_kernel_record(car.rail)
        self.m = self.h = self.about_hanger = self.damping = 0.0
        self.turns = hanger is not None
        if hanger is not None:
            self.unknown = "t" + self.unknown
            self.m = hanger.mass
            self.h = hanger.length
            self.damping = hanger.damping_moment_per_rate(line.gravity)
            self.about_hanger = hanger.inertia + self.m * self.h**2

    @staticmethod
    def cabin_axes(x: ContactState) -> tuple[Array, Array]:
        """e1 forward and e2 down along the hanger (..., 2)."""
        cos = np.cos(x.angle)
        sin = np.sin(x.angle)
        return np.concatenate([cos, -sin], axis=-1), np.concatenate([sin, cos], axis=-1)

    def turning_body_centre_and_velocity(self, x: ContactState) -> tuple[Array, Array]:
        e1, e2 = self.cabin_axes(x)
        return x.p + self.h * e2, x.dp + self.h * x.dangle * e1

    def tangential_force_on_last_wheel(self, x: ContactState) -> Array:
        return super().tangential_force_on_last_wheel(x) if self.on_rail else dot(self.force_needed_from_rope(x), x.tau)

    def energies(self, x: ContactState) -> Array:
        carriage = self.car.mass - self.m
        inertia = self.about_hanger - self.m * self.h**2
        c, dc = self.turning_body_centre_and_velocity(x)
        turning = inertia * x.dangle[..., 0] ** 2
        kinetic = 0.5 * (carriage * dot(x.dp, x.dp) + self.m * dot(dc, dc) + turning)
        height = carriage * x.p[..., 1] + self.m * c[..., 1]
        return np.stack([kinetic, 0.0 * kinetic, -self.gravity * height])

    def drag_drive_and_swing_powers(self, x: ContactState) -> dict[str, Array]:
        powers = {}
        if self.damping:
            powers["swing"] = -self.damping * x.dangle[..., 0] ** 2
        if self.car.drive_mode_or_haul_x != "grip":
            powers["drag"] = self.drag_power(x)
            powers[self.driven] = x.F * dot(x.tau, x.dp)
        return powers
