"""A rope over contacts, with cars in motion, as plain data in SI: x to the right and y down, s along the rope.

A contact touches the rope at s_k and holds it at p_k.  Neighbours bound a segment of rope.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cablefem.scene.bodies import Hanger, Wheels
from cablefem.scene.drive import GRIP, Drive, DriveMode
from cablefem.scene.line import Case, Solver, Station
from cablefem.scene.rail import Rail

Array = NDArray[np.float64]
NEAREST = 1.0  # [m] of rope between two contacts: forces grow like one over it


class Travel(Protocol):
    """A prescribed position; `Motion` is one.  Its acceleration jumps between phases."""

    @property
    def phases(self) -> tuple[tuple[float, float], ...]:
        """Consecutive [t0, t1]."""

    def position_with_rates(self, t: float, phase: int) -> tuple[float, float, float]:
        """Position, velocity and acceleration, smooth beyond the ends of the phase."""

    def positions_with_rates(self, t: Array, phase: int) -> Array:
        """The same (3, ...) at times t (...)."""


class TravelEnd(NamedTuple):
    """The end of a travel, with its velocity then."""

    t: float
    position: float
    velocity: float


@dataclass(frozen=True, kw_only=True)
class Elastic:
    """The rope.  N = EA (|r'| - 1); s is unstretched length."""

    mass_per_length: float  # rho [kg/m] per s
    EA: float  # [N]
    length: float | None = None  # [m] s of a right end that is no counterweight; 0 at a left one
    damping: float = 0.0  # c_d [1/s], force on the rope per momentum


@dataclass(frozen=True, kw_only=True)
class Contact:
    """What holds the rope at one point.

    anchor         s and point are fixed.
    spring         an end: s is fixed, `point` is where the spring is unstressed.
    saddle         between the ends: the rope slides over the point without friction.
    counterweight  an end: the rope runs over a pulley at the point to a weight.
    """

    name: str
    kind: Literal["anchor", "spring", "saddle", "counterweight"]
    point: tuple[float, float]  # [m] x and depth
    stiffness: tuple[float, float] | None = None  # [N/m] of a spring, along x and down
    force: float | None = None  # G [N] of a counterweight
    shoe: float | None = None  # [m] to either side of a saddle: what a car runs on there


@dataclass(frozen=True, kw_only=True)
class Car:
    """A point mass on the rope; with `hanger` a part of it swings; with `wheels` it is rigid and touches at two points.

    `drive`, in SI, is how it is driven: grip or haul with a `travel`, or free from s = `drive.start`.
    Of two wheels travel, start and the positions of brakes are the front wheel's, which is the right one.  A car that
    grips does so there, and its rear wheel rolls.
    """

    name: str
    mass: float  # [kg] all of it
    hanger: Hanger | None = None
    wheels: Wheels | None = None
    drive: Drive = GRIP
    travel: Travel | None = None  # [m] prescribed s, or x of a hauled car
    along: Literal["s", "x"] = "s"  # what `travel` prescribes
    rail: Rail | None = None  # its path while it is on a shoe

    @property
    def phases(self) -> tuple[tuple[float, float], ...]:
        """Consecutive [t0, t1] in which its travel, or the forces that drive it, are smooth."""
        return self.drive.phases if self.travel is None else self.travel.phases

    @cached_property
    def travel_end(self) -> TravelEnd | None:
        """Where and how a prescribed travel ends."""
        if self.travel is None:
            return None
        last = len(self.travel.phases) - 1
        t = self.travel.phases[last][1]
        position, velocity, _ = self.travel.position_with_rates(t, last)
        return TravelEnd(t, position, velocity)

    @property
    def drive_mode_or_haul_x(self) -> DriveMode | Literal["haul_x"]:
        """How it is driven; haul_x: hauled with its travel in x."""
        return "haul_x" if self.along == "x" else self.drive.mode

    def station_at(self, x: float, gravity: float) -> Station:
        """The car at rest at x."""
        return Station(
            self.name, "grips" if self.drive_mode_or_haul_x == "grip" else "hauled", x, math.nan, self.mass * gravity
        )


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """The rear or the front one of two wheels."""

    car: Car
    front: bool

    @property
    def name(self) -> str:
        return f"{self.car.name}.{'front' if self.front else 'rear'}"


def meeting_event_name(left: Contact | Car | Wheel, right: Contact | Car | Wheel) -> str:
    """Event of two neighbours, one of them a car, that come within NEAREST."""
    a, b = (x.car.name if isinstance(x, Wheel) else x.name for x in (left, right))
    if isinstance(left, Contact):
        return f"{b} reaches {a}"
    return f"{a} {'reaches' if isinstance(right, Contact) else 'meets'} {b}"


AT_REST = "at rest"  # event: friction holds all free cars, and nothing is still to change


def lift_off_event_name(touching: Car | Wheel) -> str:
    """Event of a car, or of one of its wheels, that the rope would have to hold down."""
    if isinstance(touching, Wheel):
        return f"{touching.car.name} {'front' if touching.front else 'rear'} wheel lifts off"
    return f"{touching.name} lifts off"


@dataclass(frozen=True, kw_only=True)
class MovingLine:
    """A rope, what it touches from left to right at the start, and how long it is followed."""

    rope: Elastic
    contacts: tuple[Contact | Car, ...]
    t_end: float  # [s]
    gravity: float = 9.81  # [m/s2]
    longest_step: float = math.inf  # [s] of the coarsest run, whose steps are shorter where friction turns
    cars_off_rope: tuple[Car, ...] = ()  # on rails over a saddle
    solve: Solver | None = field(default=None, compare=False)  # of lines at rest, where cars run over shoes

    @property
    def weight_per_length(self) -> float:
        """q = rho g [N/m]."""
        return self.rope.mass_per_length * self.gravity

    @cached_property
    def cars_on_rope(self) -> tuple[Car, ...]:
        return tuple(c for c in self.contacts if isinstance(c, Car))

    @cached_property
    def all_cars(self) -> tuple[Car, ...]:
        """Cars on the rope, then those off it."""
        return (*self.cars_on_rope, *self.cars_off_rope)

    @cached_property
    def contacts_and_wheels(self) -> tuple[Contact | Car | Wheel, ...]:
        """`contacts`, but of a car on two wheels the rear and the front one."""
        out: list[Contact | Car | Wheel] = []
        for contact in self.contacts:
            if isinstance(contact, Car) and contact.wheels is not None:
                out += [Wheel(car=contact, front=False), Wheel(car=contact, front=True)]
            else:
                out.append(contact)
        return tuple(out)

    @cached_property
    def supports(self) -> tuple[Contact, ...]:
        return tuple(c for c in self.contacts if isinstance(c, Contact))

    def rest_case(self, cars_at_x: Iterable[tuple[Car, float]]) -> Case:
        """The line at rest with these cars, each at its x [m]."""
        stations = [
            Station(c.name, c.kind, *c.point, force=c.force or 0.0, stiffness=c.stiffness) for c in self.supports
        ]
        stations += [car.station_at(x, self.gravity) for car, x in cars_at_x]
        stations.sort(key=lambda station: station.x)
        return Case(tuple(stations), self.weight_per_length, self.rope.EA, length=self.rope.length)

    @cached_property
    def phases(self) -> tuple[tuple[float, float], ...]:
        """Consecutive [t0, t1] in which all travels and forces are smooth."""
        phases = itertools.chain(*(car.phases for car in self.all_cars))
        times = {t for t in itertools.chain(*phases) if 0.0 < t < self.t_end}
        return tuple(itertools.pairwise([0.0, *sorted(times), self.t_end]))

    def prescribed_position_with_rates(self, car: Car, t: float, phase: int) -> tuple[float, float, float]:
        """Prescribed position, velocity and acceleration of a car in a phase of the line."""
        assert car.travel is not None
        assert car.travel_end is not None
        i = self._car_phase_numbers[car.name][phase]
        if i < len(car.travel.phases):
            return car.travel.position_with_rates(t, i)
        return car.travel_end.position, 0.0, 0.0

    def prescribed_positions_with_rates(self, car: Car, t: Any, phase: int) -> Array:
        """The same (3, ...) at times t (...)."""
        assert car.travel is not None
        if np.ndim(t) == 0:
            return np.array(self.prescribed_position_with_rates(car, t, phase))
        i = self._car_phase_numbers[car.name][phase]
        if i < len(car.travel.phases):
            return car.travel.positions_with_rates(t, i)
        at_rest = self.prescribed_position_with_rates(car, 0.0, phase)
        return np.array([np.full(np.shape(t), x) for x in at_rest])

    def points_with_rates_off_rope(self, car: Car, t: Array, phase: int, saddle_s_with_rates: Array) -> Array:
        """x and y with their rates (3, n, 2) of a car in `cars_off_rope` at t (n,); saddle_s_with_rates : (3, n)."""
        position = self.prescribed_positions_with_rates(car, t, phase)
        assert car.rail is not None
        x = position if car.along == "x" else car.rail.x_with_rates(position - saddle_s_with_rates)
        return np.stack([x, car.rail.y_with_rates(x)], axis=-1)

    @property
    def axial_round_trip(self) -> float:
        """Time [s] in which an axial wave runs along the rope and back, between the supports at least."""
        points = np.array([contact.point for contact in self.supports])
        length = self.rope.length or float(np.hypot(*np.diff(points, axis=0).T).sum())
        return 2.0 * length * math.sqrt(self.rope.mass_per_length / self.rope.EA)

    def time_when_at_rest(self, held_since: float, phase: int) -> float:
        """When cars that friction holds since then are at rest: after an axial round trip without a change of forces.

        Before, the rope has not answered, and the force on a car that stops is not yet the one at rest.  inf while a
        travel or a force is still to change.
        """
        if phase < len(self.phases) - 1:
            return math.inf
        ends = [car.travel_end.t for car in self.all_cars if car.travel_end is not None]
        return max(held_since, self.phases[-1][0], *ends) + self.axial_round_trip

    @property
    def swinging_cars_off_rope(self) -> list[Car]:
        """Cars off the rope with a cabin that swings."""
        return [car for car in self.cars_off_rope if car.hanger is not None]

    def travel_direction(self, car: Car, phase: int) -> float:
        """1 or -1: the direction of a prescribed travel in a phase.

        At a standstill it is that of the next motion; after the last one it stays, and so does the friction.
        """
        later = range(phase, len(self.phases))
        earlier = range(phase - 1, -1, -1)
        for i in (*later, *earlier):
            begin, end = (self.prescribed_position_with_rates(car, t, i)[0] for t in self.phases[i])
            if begin != end:
                return math.copysign(1.0, end - begin)
        return 1.0

    def thrust_of_free_car(self, car: Car, t: Any, phase: int) -> Any:
        """Thrust [N] of a free car along the mean tangent at t, of any shape; phase : of the line."""
        last = len(car.drive.phases) - 1  # another car may move for longer
        own = min(self._car_phase_numbers[car.name][phase], last)
        return car.drive.thrust(t, own) if car.drive.thrust_table else 0.0 * t

    @cached_property
    def _car_phase_numbers(self) -> dict[str, list[int]]:
        """Phase of each car in each phase of the line; after its last one their number."""
        middles = [0.5 * (t0 + t1) for t0, t1 in self.phases]
        return {car.name: [sum(t1 < t for _, t1 in car.phases) for t in middles] for car in self.all_cars}
