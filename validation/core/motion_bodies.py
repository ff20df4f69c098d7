"""What a car in motion does, from its TOML and its motion alone; arrays (n,) of samples, vectors as x + i y.

A body turns by the pitch of its wheel line, or by the swing of its cabin backward; `e` is its x axis and c its centre.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.core.scene_data import ROUNDING, Array, air_drag_factor, thrust_times_and_forces

ComplexVector = NDArray[np.complex128]
Sampled = Callable[[Array], Array]  # takes samples of values at steps


def dot(a: ComplexVector, b: ComplexVector) -> Array:
    """a_x b_x + a_y b_y."""
    return (np.conj(a) * b).real


def cross_product(a: ComplexVector, b: ComplexVector) -> Array:
    """a_x b_y - a_y b_x."""
    return (np.conj(a) * b).imag


def to_complex(points: Array) -> ComplexVector:
    return points[..., 0] + 1j * points[..., 1]


def to_vectors(v: ComplexVector) -> Array:
    """(n, 2) of (n,)."""
    return np.stack([v.real, v.imag], axis=1)


def unit_vector(v: ComplexVector) -> ComplexVector:
    return v / np.abs(v)


class RopeContact:
    """One contact with the rope; where a shoe guides it, the shoe takes a part of the load."""

    def __init__(self, contact: Any, load: Array, sampled: Sampled) -> None:
        self.load = sampled(load)
        self.ds = sampled(contact.ds)
        behind = to_complex(sampled(contact.slope_behind))
        ahead = to_complex(sampled(contact.slope_ahead))
        tangent_behind = unit_vector(behind)
        tangent_ahead = unit_vector(ahead)
        mean_tangent = 0.5 * (tangent_behind + tangent_ahead)
        self.projection = np.abs(mean_tangent)
        self.tau = mean_tangent / self.projection
        self.stretch = 0.5 * (np.abs(behind) + np.abs(ahead))
        pull_behind = sampled(contact.tension_behind) * tangent_behind
        pull_ahead = sampled(contact.tension_ahead) * tangent_ahead
        self.kink = pull_behind - pull_ahead
        self.turn = ahead - behind
        self.along = np.zeros(self.ds.size)  # f along the rope inside the pair
        self.load_taken_by_shoe = np.zeros(self.ds.size)  # of the load, normal to tau

    @property
    def force_on_rope(self) -> ComplexVector:
        """By the load, without what a shoe takes, and the forces along the rope [N]."""
        return self.tau * (1j * (self.load - self.load_taken_by_shoe) - self.along * self.projection)

    def force_on_rope_by_kink(self, rho: float) -> ComplexVector:
        """`force_on_rope` by the rope's tensions, slopes and mass per length rho [N]."""
        return self.kink + rho * self.ds**2 * self.turn


def drive_mode(car: dict[str, Any]) -> str:
    """How the car of a table is driven: grip, haul or free."""
    return str(car.get("drive", {}).get("mode", "grip"))


def is_hauled_in_x(car: dict[str, Any], contact_count: int) -> bool:
    """Whether the travel of a car is of its x: of one that is hauled over several spans."""
    return drive_mode(car) == "haul" and contact_count > 2


class CarBody:
    """The body of a car."""

    def __init__(self, data: dict[str, Any], car: Any, motion: Any, sampled: Sampled, gravity: float) -> None:
        """data : of the car, from the TOML."""
        self.g = gravity
        self.data = data
        self.t = sampled(motion.t)
        self.turning = car.turning
        self.inertia = 0.0
        self.damping = 0.0
        self.rate: Array = np.zeros(self.t.size)
        self.resistance: Array = np.zeros(self.t.size)  # largest of friction and brakes [N]
        self.held_by_friction = np.zeros(self.t.size, bool)  # a free car that stands on the rope
        point = to_complex(sampled(car.point))
        velocity = to_complex(sampled(car.velocity))
        in_x = is_hauled_in_x(data, len(motion.contacts))
        self.travel_rate = velocity.real if in_x else sampled(car.ds)
        self.arms = [0.0 * point]  # contact less c
        self.touching = [RopeContact(car, car.contact_force, sampled)]
        self.e = self.touching[0].tau
        # a shoe pushes across the car's path, which is not quite along the rope; standing cars keep their direction
        latest = np.maximum.accumulate(np.where(velocity != 0.0, np.arange(velocity.size), 0))
        moving = velocity[latest]
        speed = np.abs(moving)
        cosine = np.divide(np.abs(dot(moving, self.e)), speed, out=np.ones_like(speed), where=speed > 0.0)
        self.touching[0].load_taken_by_shoe = sampled(car.shoe_force) * cosine
        mass = data["mass"]
        contact_mass = 0.0  # mass at the contact
        if self.has_cabin:
            contact_mass = mass - data["hanger"]["mass"]
            self._set_cabin(car, sampled)
        elif car.turning is not None:
            self._set_two_wheels(car, sampled)
        self.c = point - self.arms[-1]
        self.dc = velocity - 1j * self.rate * self.arms[-1]
        self.masses = [(contact_mass, point, velocity), (mass - contact_mass, self.c, self.dc)]
        self._set_drive_forces_and_powers(car, sampled)
        self._set_forces_along_rope(car, motion, sampled)

    @property
    def has_cabin(self) -> bool:
        return "hanger" in self.data

    def _set_cabin(self, car: Any, sampled: Sampled) -> None:
        hanger = self.data["hanger"]
        m = hanger["mass"]
        self.size = hanger["length"]
        self.inertia = m * hanger.get("gyration", 0.0) ** 2
        stiffness = m * self.g * self.size
        about_contact = self.inertia + m * self.size**2
        self.damping = 2.0 * hanger.get("damping", 0.0) * math.sqrt(about_contact * stiffness)
        self.rate = -sampled(car.turning.rate)
        self.arms = [-1j * self.size * np.exp(-1j * sampled(car.turning.angle))]

    def _set_two_wheels(self, car: Any, sampled: Sampled) -> None:
        wheels = self.data["wheels"]
        self.size = wheels["base"]
        self.inertia = wheels["inertia"]
        self.rate = sampled(car.turning.rate)
        rear, front = car.turning.wheels
        self.e = unit_vector(to_complex(sampled(car.point)) - to_complex(sampled(rear.point)))
        middle = -wheels.get("ahead", 0.0) - 1j * wheels.get("below", 0.0)
        self.arms = [self.e * (middle + side * 0.5 * self.size) for side in (-1.0, 1.0)]
        self.touching = [RopeContact(x, x.load, sampled) for x in (rear, front)]

    def _set_drive_forces_and_powers(self, car: Any, sampled: Sampled) -> None:
        """Set `force` and `moment` of thrust or haul rope, `drag`, and `powers` of these and of damping."""
        drive = self.data.get("drive", {})
        after = np.append(False, np.diff(self.t) <= 0.0)  # a thrust may jump where a time stands twice
        times = self.t + 1e-9 * self.t[-1] * after
        force = np.interp(times, *thrust_times_and_forces(drive), left=0.0, right=0.0)
        thrust = drive.get("thrust", {})
        described = thrust if isinstance(thrust, dict) else {}
        at = described.get("at", (0.0, 0.0))
        angle = math.radians(described.get("angle", 0.0))
        if drive_mode(self.data) == "haul":
            force = sampled(car.haul_force)
            at = drive.get("hitch", at)
            angle = 0.0
        lever = self.arms[0] if self.has_cabin else self.e * complex(*at)
        self.force = force * np.exp(-1j * angle) * self.e
        self.moment = cross_product(lever, self.force)
        air = self.dc - drive.get("wind", 0.0)
        self.drag = -air_drag_factor(drive) * np.abs(air) * air
        of_force = dot(self.force, self.dc + 1j * self.rate * lever)
        of_drag = dot(self.drag, self.dc)
        self.powers = [of_force, of_drag, -self.damping * self.rate**2]

    def _direction_of_travel(self) -> Array:
        """Sign (n,) of the travel; at a standstill that of the next motion, after the last one it stays.

        Rope that creeps under a car which stands in x does not turn its friction.
        """
        rate = self.travel_rate
        moving = np.flatnonzero(np.abs(rate) > ROUNDING * np.max(np.abs(rate)))
        if not moving.size:
            return np.zeros_like(rate)
        following = np.searchsorted(moving, np.arange(rate.size))
        return np.sign(rate[moving[np.minimum(following, moving.size - 1)]])

    def _braking_force(self, wheel: str, s: Array) -> Array:
        """Force (n,) [N] of all brakes on the "front" or "rear" wheel of a car at s (n,)."""
        force = np.zeros(self.t.size)
        for row in self.data.get("drive", {}).get("brake", []):
            both = row.get("wheel", "both") == "both"
            share = (both or row["wheel"] == wheel) / (len(self.touching) if both else 1)
            force += share * row["force"] * (s > row["from"])
        return force

    def _set_forces_along_rope(self, car: Any, motion: Any, sampled: Sampled) -> None:
        """Set friction, brakes, grip and hold on each contact, and their powers."""
        drive = self.data.get("drive", {})
        front = self.touching[-1]
        direction = self._direction_of_travel()
        at_steps = sampled(car.s)
        before = np.append(np.diff(self.t) <= 0.0, False)  # a brake begins or ends to act between this and the next
        after = np.append(False, before[:-1])
        s = np.where(before, 0.5 * (at_steps + np.roll(at_steps, 1)), at_steps)
        s = np.where(after, 0.5 * (at_steps + np.roll(at_steps, -1)), s)
        for x, wheel in zip(self.touching[::-1], ("front", "rear"), strict=False):
            brake = self._braking_force(wheel, s)
            off_shoe = x.load_taken_by_shoe == 0.0  # a shoe has no friction
            rolling = drive.get("rolling_friction", 0.0) * np.abs(x.load) * off_shoe
            self.resistance = self.resistance + rolling + brake
            x.along = -direction * (rolling + brake)
        if drive_mode(self.data) == "grip":
            front.along = sampled(car.grip_force)
        held = motion.powers.get(f"{car.name} hold")
        if held is not None:
            speed = front.stretch * front.ds
            front.along += np.divide(sampled(held), speed, out=0.0 * speed, where=speed != 0.0)
            sticks = front.ds == 0.0
            self.held_by_friction = sticks & (self.t >= drive.get("release", 0.0))
            for x in self.touching:  # held at the front wheel
                along = -dot(x.tau, x.kink) / x.projection * (x is front)
                x.along = np.where(sticks, along, x.along)
        self.powers += [x.stretch * x.along * x.ds for x in self.touching]

    @property
    def kinetic_energy(self) -> Array:
        """(n,) [J]."""
        energies = [0.5 * m * np.abs(v) ** 2 for m, _, v in self.masses]
        return sum(energies) + 0.5 * self.inertia * self.rate**2

    @property
    def potential_energy(self) -> Array:
        """(n,) [J]."""
        return -self.g * sum(m * point.imag for m, point, _ in self.masses)

    @property
    def momentum(self) -> ComplexVector:
        (contact_mass, _, v), (m, _, dc) = self.masses
        return contact_mass * v + m * dc

    def moment_and_angular_momentum(self) -> tuple[Array, Array]:
        """M [N m] and L [N m s] with int (W M + W' L) dt = 0 for a weight W: those of mechanics with the other sign.

        About c; of a cabin about its contact.
        """
        m = self.masses[1][0]
        if self.has_cabin:
            arm = self.arms[0]
            pulled = m * cross_product(arm, self.dc)
            turned = m * cross_product(1j * self.rate * arm, self.dc)
            weights = cross_product(arm, 1j * m * self.g + self.drag)
            return turned + weights + self.damping * self.rate, pulled - self.inertia * self.rate
        moments = [cross_product(arm, x.force_on_rope) for arm, x in zip(self.arms, self.touching, strict=True)]
        return sum(moments) - self.moment, -self.inertia * self.rate
