"""What a run of a line in motion returns, in SI: n times, m stations; y down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class WheelMotion:
    """One of two wheels; arrays (n,), points and slopes (n, 2)."""

    name: str  # "CAR.rear", "CAR.front"
    s: Array  # [m]
    ds: Array  # [m/s] along the rope
    point: Array  # [m]
    load: Array  # [N] normal to the mean tangent, positive when the wheel presses down
    tension_behind: Array  # [N] by the balance of that segment
    tension_ahead: Array  # [N]
    slope_behind: Array  # r'
    slope_ahead: Array


@dataclass(frozen=True, kw_only=True)
class Turning:
    """A body that turns: the cabin of a hanger, which swings, or a car on two wheels, which pitches; arrays (n,)."""

    # [rad] swing: of the cabin forward, from below the contact; pitch: of the line of the wheels, front down
    angle: Array
    rate: Array  # [rad/s]
    acceleration: Array  # [rad/s2]
    centre: Array  # (n, 2) [m] centre of mass
    wheels: tuple[WheelMotion, ...] = ()  # rear and front


@dataclass(frozen=True, kw_only=True)
class CarMotion:
    """One car; arrays (n,), points and slopes (n, 2).

    Of two wheels s, point, velocity, acceleration and what is ahead are the front wheel's, what is behind the rear
    one's; the haul force acts along the line of the wheels, and the contact force is the sum of both loads.
    """

    name: str
    s: Array  # [m]
    ds: Array  # [m/s] along the rope
    point: Array  # [m]
    velocity: Array  # [m/s]
    acceleration: Array  # [m/s2]
    tension_behind: Array  # [N]
    tension_ahead: Array  # [N]
    slope_behind: Array  # r'
    slope_ahead: Array
    haul_force: Array  # [N] outside force along the mean tangent, positive to the right; nan: none
    grip_force: Array  # [N] along the rope that the grip gives the car, positive to the right; nan: no grip
    contact_force: Array  # [N] on rope and shoe, normal to the mean tangent, positive when the car presses down
    shoe_force: Array  # [N] of it on a shoe, normal to its path there; negative: the shoe pulls the car down
    turning: Turning | None = None
    wheel_loads: tuple[Array, Array] | None = None  # [N] by hand, of the rear and the front wheel of a point


@dataclass(frozen=True, kw_only=True)
class ContactMotion:
    """One contact that is no car; arrays (n,), points (n, 2)."""

    name: str
    kind: str
    s: Array  # [m] of the rope there
    ds: Array  # [m/s] the rope flows over it to the left with this speed
    point: Array  # [m]
    tension_behind: Array  # [N]; nan at the left end
    tension_ahead: Array  # [N]; nan at the right end
    pressure: Array  # (n, 2) [N] force on the contact: of the rope, and of a car on the shoe
    rise: Array  # [m] of a counterweight since the start; else nan


@dataclass(frozen=True, kw_only=True)
class LineMotion:
    """All cars and contacts, from left to right, and the rope at the stations s."""

    t: Array  # (n,) [s]
    cars: tuple[CarMotion, ...]
    contacts: tuple[ContactMotion, ...]
    s: Array  # (m,) [m]
    points: Array  # (n, m, 2) [m]; nan beyond the rope
    tension: Array  # (n, m) [N]; nan beyond the rope; at a contact that of the segment behind
    kinetic: Array  # (n,) [J] of the rope between its ends, cars and springs
    strain: Array  # (n,) [J] of that rope and springs
    potential: Array  # (n,) [J] - weight times depth of that rope and cars
    # (n,) [W] into them: "NAME grip", "NAME haul", "NAME thrust", "NAME drag", "NAME friction" and "NAME hold" of cars,
    # "NAME weight" of a counterweight with the rope that enters, "damping"
    powers: dict[str, Array] = field(default_factory=dict)

    @property
    def energy(self) -> Array:
        """(n,) [J]; its rate is the sum of the powers."""
        return self.kinetic + self.strain + self.potential


def join_motions_in_time(parts: Sequence[LineMotion]) -> LineMotion:
    """One motion of those of a line before and after each change of what the rope touches."""
    first = parts[0]
    order = [car.name for car in first.cars]
    risen = dict.fromkeys((c.name for c in first.contacts), 0.0)
    joined = []
    for part in parts:
        contacts = tuple(replace(c, rise=c.rise + risen[c.name]) for c in part.contacts)
        risen = {c.name: float(c.rise[-1]) for c in contacts}
        cars = sorted(part.cars, key=lambda car: order.index(car.name))
        joined.append(replace(part, cars=tuple(cars), contacts=contacts))
    return replace(_concatenate_nested_arrays(joined), s=first.s)


def _concatenate_nested_arrays(values: Sequence[Any]) -> Any:
    """Equal structures (arrays, tuples, dicts, dataclasses) as one, with the arrays of all one after another."""
    first = values[0]
    if isinstance(first, np.ndarray):
        return np.concatenate(values)
    if isinstance(first, tuple):
        return tuple(_concatenate_nested_arrays(x) for x in zip(*values, strict=True))
    if isinstance(first, dict):
        return {name: _concatenate_nested_arrays([x[name] for x in values]) for name in first}
    if is_dataclass(first):
        kind: Any = type(first)
        names = [f.name for f in fields(first)]
        return kind(**{name: _concatenate_nested_arrays([getattr(x, name) for x in values]) for name in names})
    return first
