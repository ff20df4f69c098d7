"""Balances at the contacts of a rope, as functions of the values in `ContactState`; derivatives by complex steps.

    C = M (p.. - g j) - F_ext,  [N t] = C + rho ds^2 [r'],  C . tau = f |<r'>|/<|r'|>,  tau = <r'>/|<r'>|

[ ] is ahead less behind and < > their mean; C is the force that the rope gives to the car; f acts between both.
A cabin m that hangs h below, its angle phi positive forward, has its centre at p + h e2, e2 = (sin phi, cos phi),
e1 = de2/dphi. It adds m h (phi.. e1 - phi.^2 e2) to C, and the balance of moments about the hanger

    (J + m h^2) phi.. + m h (p.. . e1 + g sin phi) + c phi. = h F_drag . e1.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.scene.contacts import Array, Car, Contact, MovingLine
from cablefem.scene.rail import Rail

TINY = 1e-30  # complex step
DOWN = np.array([0.0, 1.0])


def length(v: Array) -> Array:
    """|v|, also of complex vectors."""
    return np.sqrt(v[..., 0] ** 2 + v[..., 1] ** 2)


def dot(a: Array, b: Array) -> Array:
    """a . b of vectors (..., 2)."""
    return (a * b).sum(axis=-1)


def downward_normal_component(force: Array, tau: Array) -> Array:
    """The component normal to tau."""
    return force[..., 1] * tau[..., 0] - force[..., 0] * tau[..., 1]


class OnRail(NamedTuple):
    """The depth y = Y(x) of a car on a rail."""

    p: NDArray[np.intp]  # number of the coordinate y
    x: int
    rail: Rail

    def set_dependent_coordinates(self, Z: Array) -> None:
        """Set y and its rates in Z (3, ..., coordinates)."""
        Z[..., int(self.p[0])] = self.rail.y_with_rates(Z[..., self.x])

    def fold_dependent_derivatives(self, K: Array, Z: Array, column: Array) -> None:
        """Add the derivatives by y and its rates to those by x, without the third of Y; K (3, rows, columns)."""
        x, dx, ddx = Z[:, self.x]
        _, slope, bend = self.rail.depth_with_derivatives(x)
        by_y, by_dy, by_ddy = K[..., int(column[self.p[0]])]
        at = column[self.x]
        K[0, :, at] += by_y * slope + by_dy * bend * dx + by_ddy * bend * ddx
        K[1, :, at] += by_dy * slope + by_ddy * 2.0 * bend * dx
        K[2, :, at] += by_ddy * slope


class ContactState:
    """Numbers (..., 26) at a contact: N t behind, ahead; r' behind, ahead; p, angle, c and their rates; s., s..; F."""

    size = 26

    def __init__(self, values: Array) -> None:
        self.values = x = values
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
        self.ddc = x[..., 21:23]
        self.ds = x[..., 23]
        self.dds = x[..., 24]
        self.F = x[..., 25]

    @cached_property
    def tau(self) -> Array:
        """The unit mean tangent (..., 2)."""
        mean = self.slope_behind + self.slope_ahead
        return mean / length(mean)[..., None]

    @property
    def mean_stretch(self) -> Array:
        """<|r'|>."""
        return 0.5 * (length(self.slope_behind) + length(self.slope_ahead))

    @cached_property
    def cos_phi(self) -> Array:
        """|<r'>|/<|r'|>."""
        mean = 0.5 * length(self.slope_behind + self.slope_ahead)
        return mean / self.mean_stretch


class Friction(NamedTuple):
    """f = hold - sign (rolling |N_c| + brake)."""

    rolling: float = 0.0
    brake: float | Array = 0.0  # (..., wheels)
    sign: float = 0.0
    hold: float | Array = 0.0  # (...)


class Body:
    """What a contact is tied to: an anchor unless a subclass says more."""

    unknown = ""  # coordinates: x, y, angle t, centre u and v, s, that of the next contact S, F
    contacts = 1

    def state_from_contact_values(self, contact_values: Array) -> Any:
        """What `balance_rows` takes, from the values (..., contacts, 26)."""
        return ContactState(contact_values[..., 0, :])

    def balance_rows(self, x: Any, friction: Friction) -> Array:
        """The balances (..., n), one per unknown, zero where they hold."""
        return np.empty((*x.ds.shape, 0))

    def balance_row_derivatives(self, contact_values: Array, friction: Friction) -> Array:
        """d(balance rows)/d(contact values) (n, contacts, 26)."""
        shape = contact_values.shape
        shifts = 1j * TINY * np.eye(contact_values.size).reshape(-1, *shape)
        shifted = self.state_from_contact_values(contact_values + shifts)
        by = self.balance_rows(shifted, friction).imag / TINY
        return by.T.reshape(-1, *shape)

    def energies(self, x: Any) -> Array:
        """Kinetic, strain and potential energy (3, ...) [J]."""
        return np.zeros((3, *x.ds.shape))


class Saddle(Body):
    """A support over which the rope runs without friction."""

    unknown = "s"

    def balance_rows(self, x: ContactState, friction: Friction) -> Array:
        return (length(x.ahead) - length(x.behind))[..., None]


class Spring(Body):
    """An elastic support."""

    unknown = "xy"

    def __init__(self, contact: Contact) -> None:
        self.stiffness = np.array(contact.stiffness)
        self.point = np.array(contact.point)

    def balance_rows(self, x: ContactState, friction: Friction) -> Array:
        return x.behind - x.ahead + self.stiffness * (x.p - self.point)

    def energies(self, x: ContactState) -> Array:
        strain = 0.5 * (self.stiffness * (x.p - self.point) ** 2).sum(axis=-1)
        none = 0.0 * strain
        return np.stack([none, strain, none])


class Counterweight(Body):
    """The rope beyond the pulley has the strain of G and no mass."""

    unknown = "s"

    def __init__(self, contact: Contact, outward: float, line: MovingLine) -> None:
        """outward : 1 at the right end of the rope, -1 at its left end."""
        self.force = contact.force or math.nan
        self.outward = outward
        self.mass = self.force / line.gravity
        self.lift = outward * (1.0 + self.force / line.rope.EA)  # of the weight, over the motion of s

    def balance_rows(self, x: ContactState, friction: Friction) -> Array:
        return (length(x.ahead + x.behind) - self.force - self.mass * self.lift * x.dds)[..., None]


class CarBody(Body):
    """What cars on one and on two wheels have in common."""

    turns = True

    def __init__(self, car: Car, line: MovingLine) -> None:
        self.car = car
        self.gravity = line.gravity
        self.rho = line.rope.mass_per_length
        self.k = car.drive.k  # of drag [kg/m]
        self.driven = "haul" if car.drive.mode == "haul" else "thrust"

    def copy_held_without_drag(self) -> Any:
        """The car at rest: a free one is held, and no wind blows."""
        other = copy.copy(self)
        other.k = 0.0
        if self.car.drive_kind == "free":
            other.unknown = self.unknown[:-1]
        return other

    def brake_forces_of_wheels(self, s: Any) -> Array:
        """Forces of the brakes on the wheels (..., wheels) [N], from left to right, with the car at s (...)."""
        return np.asarray(self.car.drive.brake_force(s))[..., None]

    def turning_body_centre_and_velocity(self, x: Any) -> tuple[Array, Array]:
        """Point and velocity (..., 2) of the centre of mass of what turns, else of the car."""
        raise NotImplementedError

    def drag_drive_and_swing_powers(self, x: Any) -> dict[str, Array]:
        """Powers (...) [W] by cause, but those of friction, grip and hold."""
        raise NotImplementedError

    def force_on_rope(self, wheel: ContactState) -> Array:
        """The force (..., 2) on the rope at a wheel, by the balance of the pieces beside it."""
        flow = (self.rho * wheel.ds**2)[..., None]
        turning = flow * (wheel.slope_ahead - wheel.slope_behind)
        return wheel.behind - wheel.ahead + turning

    def wheel_states(self, x: Any) -> Sequence[ContactState]:
        """The contacts, from left to right."""
        return (x,)

    def normal_wheel_loads(self, x: Any) -> Array:
        """Forces of the wheels on the rope (..., wheels) [N] normal to tau, positive down."""
        raise NotImplementedError

    def tangential_force_on_last_wheel(self, x: Any) -> Array:
        """Force (...) [N] of the rope on the last wheel along tau."""
        raise NotImplementedError

    def drag_force(self, velocity: Array) -> Array:
        """Force (..., 2) [N] of the air, wind included."""
        if self.k == 0.0:
            return np.zeros_like(velocity)
        air = velocity - np.array([self.car.drive.wind, 0.0])
        return -self.k * length(air)[..., None] * air

    @staticmethod
    def friction_and_brake_forces(loads: Array, friction: Friction) -> Array:
        """Sizes (..., wheels) [N] of both, of wheels that press on the rope with loads (..., wheels) [N]."""
        return friction.rolling * loads * np.sign(loads.real) + friction.brake

    def max_friction_plus_brake_force(self, x: Any, friction: Friction) -> float:
        """Sum over the wheels [N] of what friction and brakes can give."""
        return float(self.friction_and_brake_forces(self.normal_wheel_loads(x), friction).sum())

    def signed_friction_and_hold(self, loads: Array, friction: Friction) -> Array:
        """f of each wheel (..., wheels) [N]; what holds a car holds the last one."""
        out = -friction.sign * self.friction_and_brake_forces(loads, friction)
        out[..., -1] += friction.hold
        return out


class PointCar(CarBody):
    """A point mass, with a cabin that swings or without; unless s or F is unknown it grips the rope."""

    def __init__(self, car: Car, line: MovingLine) -> None:
        super().__init__(car, line)
        hanger = car.hanger
        self.unknown = {"grip": "xy", "haul": "xyF", "haul_x": "ysF", "free": "xys"}[car.drive_kind]
        if car.rail is not None:
            self.unknown = self.unknown.replace("y", "")
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

    def force_needed_from_rope(self, x: ContactState) -> Array:
        """C (..., 2) [N], the force that car and cabin need, by their motion."""
        own = self.car.mass * (x.ddp - self.gravity * DOWN) - x.F[..., None] * x.tau
        if not self.turns:
            return own - self.drag_force(x.dp)
        e1, e2 = self.cabin_axes(x)
        swinging = self.m * self.h * (x.ddangle * e1 - x.dangle**2 * e2)
        return own + swinging - self.drag_force(self.turning_body_centre_and_velocity(x)[1])

    def normal_wheel_loads(self, x: ContactState) -> Array:
        return -downward_normal_component(self.force_needed_from_rope(x), x.tau)[..., None]

    def tangential_force_on_last_wheel(self, x: ContactState) -> Array:
        return dot(self.force_needed_from_rope(x) if self.car.rail is None else -self.force_on_rope(x), x.tau)

    def balance_rows(self, x: ContactState, friction: Friction) -> Array:
        C = self.force_needed_from_rope(x)
        on_rope = self.force_on_rope(x)
        balance = on_rope + C
        if self.car.rail is not None:  # the shoe is normal to the path
            slope = self.car.rail.depth_with_derivatives(x.p[..., 0])[1]
            balance = (balance[..., 0] + slope * balance[..., 1])[..., None]
        rows = [balance]
        if self.turns:
            rows.append(self.cabin_moment_balance(x))
        if self.unknown[-1] in "sF":
            loads = -downward_normal_component(C, x.tau)[..., None]
            slip = self.signed_friction_and_hold(loads, friction)[..., 0]
            along = dot(C if self.car.rail is None else -on_rope, x.tau)
            rows.append((along - slip * x.cos_phi)[..., None])
        return np.concatenate(rows, axis=-1)

    def cabin_moment_balance(self, x: ContactState) -> Array:
        """Balance of moments of the cabin about the hanger (..., 1)."""
        e1, e2 = self.cabin_axes(x)
        weight = self.gravity * e2[..., 0]
        drag = self.drag_force(self.turning_body_centre_and_velocity(x)[1])
        hanging = self.m * self.h * (dot(x.ddp, e1) + weight) - self.h * dot(drag, e1)
        return self.about_hanger * x.ddangle + self.damping * x.dangle + hanging[..., None]

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
        if self.car.drive_kind != "grip":
            velocity = self.turning_body_centre_and_velocity(x)[1]
            powers["drag"] = dot(self.drag_force(velocity), velocity)
            powers[self.driven] = x.F * dot(x.tau, x.dp)
        return powers
