"""Cars over the shoes of saddles: each event changes what the rope touches.

At the end of a shoe a car lands on a rail.  It leaves the rope TIP of the shoe before the saddle, or where the rope no
longer presses on a car that rolls: a kink set free there would run along the rope, and no mesh resolves it.  As far
behind the saddle it takes the rope again, and at the other end of the shoe it leaves the rail.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from cablefem.motion import CarMotion, ContactMotion, Turning
from cablefem.newmark import State, StepFailure
from cablefem.scene.contacts import Array, Car, Contact, MovingLine
from cablefem.scene.line import Case, LineState, NoLineAtRest, Station
from cablefem.scene.rail import Rail, RailEnd

TIP = 0.2  # of a shoe
BESIDE = 1e-6  # [m] for slopes on one side of a contact


class Passage(NamedTuple):
    """What a car may do next at a saddle."""

    car: str
    action: Literal["lands on the shoe of", "leaves the rope at", "takes the rope behind", "leaves the shoe of"]
    saddle: Contact
    ends_with_pressure: bool = False  # of the rope on the car, if that comes earlier

    def __str__(self) -> str:
        return f"{self.car} {self.action} {self.saddle.name}"

    def distance_to_go(self, x: float, velocity: float, turn: float) -> float:
        """[m] from x to this passage; inf: not that way.

        turn : `upward_turn` of the rope, whose end is the passage if it `ends_with_pressure`.
        """
        shoe = self.saddle.shoe or 0.0
        offset = x - self.saddle.point[0]
        outwards = offset * velocity  # > 0: away from the saddle
        approaches = outwards < 0.0
        match self.action:
            case "takes the rope behind":
                return TIP * shoe - math.copysign(offset, outwards)
            case "lands on the shoe of":
                to_go = abs(offset) - shoe
            case "leaves the rope at":
                to_go = abs(offset) - TIP * shoe
                if approaches and self.ends_with_pressure:
                    to_go = min(to_go, turn)
            case "leaves the shoe of":
                to_go = shoe - abs(offset)
                approaches = outwards > 0.0
        return to_go if to_go > 0.0 or approaches else math.inf


class LineSnapshot(NamedTuple):
    """A line at an event, by names of contacts and cars; [m], [m/s], [m/s2]."""

    s: dict[str, float]
    ds: dict[str, float]
    points: dict[str, Array]  # with rates (3, 2)
    rope: Callable[[float], Array]  # r, r' and the velocity at fixed s (3, 2), of s

    def rope_slope_beside(self, contact: str, side: float) -> Array:
        """r' (2,) on one side of a contact or car: 1 ahead of it, -1 behind."""
        return self.rope(self.s[contact] + side * BESIDE)[1]


def line_snapshot(
    line: MovingLine, points: Array, s: Array, points_off_rope: dict[str, Array], rope: Callable[[float], Array]
) -> LineSnapshot:
    """From points (3, contacts, 2) and s (3, contacts) of all contacts, and points (3, 2) of cars off the rope."""
    names = [c.name for c in line.contacts_and_wheels]
    s_by_name = dict(zip(names, s[0].tolist(), strict=True))
    ds_by_name = dict(zip(names, s[1].tolist(), strict=True))
    points_by_name = dict(zip(names, points.swapaxes(0, 1), strict=True))
    s_by_name |= {car.name: s_by_name[car.rail.saddle] for car in line.cars_off_rope if car.rail is not None}
    return LineSnapshot(s_by_name, ds_by_name, points_by_name | points_off_rope, rope)


def possible_passages(line: MovingLine) -> tuple[Passage, ...]:
    """All that may come next."""
    by_name = {c.name: c for c in line.supports}
    out = [passage for k in range(len(line.contacts)) for passage in _passages_of_contact(line, k, by_name)]
    for car in line.cars_off_rope:
        if car.rail is not None:
            out.append(Passage(car.name, "takes the rope behind", by_name[car.rail.saddle]))
    return tuple(out)


def _passages_of_contact(line: MovingLine, k: int, supports: Mapping[str, Contact]) -> Iterator[Passage]:
    """Passages of contact k, if it is a car; supports : by name."""
    car = line.contacts[k]
    if not isinstance(car, Car):
        return
    if car.rail is not None:
        saddle = supports[car.rail.saddle]
        rolls = car.drive_mode_or_haul_x != "grip"  # a grip holds the rope
        yield Passage(car.name, "leaves the rope at", saddle, ends_with_pressure=rolls)
        yield Passage(car.name, "leaves the shoe of", saddle)
    elif car.drive_mode_or_haul_x != "free" and car.wheels is None:
        for neighbour in (line.contacts[k - 1], line.contacts[k + 1]):
            if isinstance(neighbour, Contact) and neighbour.shoe is not None:
                yield Passage(car.name, "lands on the shoe of", neighbour)


def car_may_pass_saddle(passages: Sequence[Passage], left: str, right: str) -> bool:
    """Whether one of two neighbours, by name, is a car that may pass the other, a saddle."""
    return any({p.car, p.saddle.name} == {left, right} for p in passages)


def line_and_snapshot_after_passage(
    line: MovingLine, passage: Passage, t: float, phase: int, snapshot: LineSnapshot
) -> tuple[MovingLine, LineSnapshot]:
    """The line after a passage, and the snapshot with the point of the rope that the car takes, if it does."""
    car = next(c for c in line.all_cars if c.name == passage.car)
    if passage.action == "takes the rope behind":
        snapshot = _snapshot_with_rope_point_below(line, car, t, phase, snapshot)
    at_shoe = _CarAtShoe(line, car, passage.saddle, t, snapshot)
    match passage.action:
        case "lands on the shoe of":
            return at_shoe.line_after_landing(), snapshot
        case "leaves the rope at":
            return at_shoe.line_after_rope_left(), snapshot
        case "takes the rope behind":
            return at_shoe.line_after_rope_taken(), snapshot
        case "leaves the shoe of":
            return at_shoe.line_with_car_on_rail(None), snapshot


class _CarAtShoe(NamedTuple):
    """A car at a passage, and what the line is after it."""

    line: MovingLine  # before
    car: Car
    saddle: Contact
    t: float
    snapshot: LineSnapshot

    @property
    def side_of_saddle(self) -> float:
        """1 where the car is to the right of the saddle, else -1."""
        x, _ = self.snapshot.points[self.car.name][0].tolist()
        return math.copysign(1.0, x - self.saddle.point[0])

    @property
    def _path_of_car(self) -> RailEnd:
        """Where a rail goes on from the car without a jump of its velocity or acceleration."""
        (x, y), velocity, acceleration = self.snapshot.points[self.car.name].tolist()
        slope = velocity[1] / velocity[0]
        bend = (acceleration[1] - slope * acceleration[0]) / velocity[0] ** 2
        return RailEnd(x, y, slope, bend)

    def line_with_car_on_rail(self, rail: Rail | None) -> MovingLine:
        """The line with the car, on the rope, on this rail, or on none."""
        moved = replace(self.car, rail=rail)
        contacts = tuple(moved if contact is self.car else contact for contact in self.line.contacts)
        return replace(self.line, contacts=contacts)

    def line_after_landing(self) -> MovingLine:
        """The line with the car on a rail, from its path on the rope to the slope of the rope beside it."""
        if any(c.rail is not None and c.rail.saddle == self.saddle.name for c in self.line.all_cars):
            raise StepFailure(self.t, f"two cars on the shoe of {self.saddle.name}", "let one follow later")
        side = self.side_of_saddle
        end = self._straight_rail_end(side, self.snapshot.rope_slope_beside(self.car.name, side))
        return self.line_with_car_on_rail(Rail(self.saddle.name, self._path_of_car, end))

    def line_after_rope_left(self) -> MovingLine:
        """The line with the car off the rope, on a rail over the saddle to as far behind it."""
        snapshot = self.snapshot
        car = self.car.name
        saddle = self.saddle.name
        behind = -self.side_of_saddle
        end = self._straight_rail_end(behind, snapshot.rope_slope_beside(saddle, behind))
        rope_speed = abs(snapshot.ds[car] - snapshot.ds[saddle])
        stretch = float(np.hypot(*snapshot.points[car][1])) / rope_speed
        rail = Rail(saddle, self._path_of_car, end, snapshot.s[car] - snapshot.s[saddle], stretch)
        contacts = tuple(contact for contact in self.line.contacts if contact is not self.car)
        off_rope = (*self.line.cars_off_rope, replace(self.car, rail=rail))
        return replace(self.line, contacts=contacts, cars_off_rope=off_rope)

    def line_after_rope_taken(self) -> MovingLine:
        """The line with the car on the rope again, on a rail to the end of the shoe."""
        rail = Rail(self.saddle.name, self._path_of_car, self._rail_end_on_load_path())
        contacts = list(self.line.contacts)
        contacts.insert(contacts.index(self.saddle) + (self.side_of_saddle > 0.0), replace(self.car, rail=rail))
        off_rope = tuple(c for c in self.line.cars_off_rope if c is not self.car)
        return replace(self.line, contacts=tuple(contacts), cars_off_rope=off_rope)

    def _straight_rail_end(self, side: float, tangent: Array) -> RailEnd:
        """The end at the tip of the shoe on a side, on a straight line of this tangent r' through the saddle."""
        slope = tangent[1] / tangent[0]
        away = side * TIP * (self.saddle.shoe or 0.0)
        x, y = self.saddle.point
        return RailEnd(x + away, y + away * slope, slope)

    def _rail_end_on_load_path(self) -> RailEnd:
        """The end of the shoe on the path of the car at rest, in that one span between anchors at their present s."""
        span, length = self._stations_and_length_of_span()
        shoe = self.saddle.shoe or 0.0
        step = 0.25 * shoe
        at = self.saddle.point[0] + self.side_of_saddle * shoe + step * np.array([-1.0, 0.0, 1.0])
        line = self.line
        cases = []
        for x in at.tolist():
            stations = tuple(sorted([*span, self.car.station_at(x, line.gravity)], key=lambda p: p.x))
            cases.append(Case(stations, line.weight_per_length, line.rope.EA, length=length))
        assert line.solve is not None
        before, y, after = map(self._car_depth_at_rest, line.solve(cases))
        slope = (after - before) / (2.0 * step)
        bend = (after - 2.0 * y + before) / step**2
        return RailEnd(float(at[1]), y, slope, bend)

    def _stations_and_length_of_span(self) -> tuple[list[Station], float]:
        """Saddle, cars and next contact of the span on the side of the car, and the length [m] of its rope."""
        contacts = self.line.contacts
        k = contacts.index(self.saddle)
        others = contacts[k + 1 :] if self.side_of_saddle > 0.0 else contacts[k - 1 :: -1]
        stations: list[Station] = []
        for contact in (self.saddle, *others):
            name = contact.name if contact.name in self.snapshot.points else f"{contact.name}.front"
            x, y = self.snapshot.points[name][0]
            if isinstance(contact, Car):
                stations.append(contact.station_at(x, self.line.gravity))
                continue
            stations.append(Station(contact.name, "anchor", x, y))
            if contact is not self.saddle:
                break
        return stations, abs(self.snapshot.s[contact.name] - self.snapshot.s[self.saddle.name])

    def _car_depth_at_rest(self, state: LineState | NoLineAtRest) -> float:
        """Depth [m] of the car in a state of rest; StepFailure where there is none."""
        car = self.car.name
        if not isinstance(state, LineState):
            cause = f"no path of {car} behind {self.saddle.name}: {state}"
            raise StepFailure(self.t, cause, "give more rope or less load")
        names = [p.name for p in state.case.stations]
        return float(state.points[names.index(car), 1])


def _snapshot_with_rope_point_below(
    line: MovingLine, car: Car, t: float, phase: int, snapshot: LineSnapshot
) -> LineSnapshot:
    """The snapshot with s of the rope below a car off the rope, and the car's point there, with their rates.

    The rope, which is light, comes across to the car: a car that came to the rope would need an impulse of the shoe.
    """
    assert car.rail is not None
    saddle = car.rail.saddle
    with_rates = snapshot.points[car.name]
    point, velocity, _ = with_rates
    if car.along == "s":
        s, ds, _ = line.prescribed_position_with_rates(car, t, phase)
        r, tangent, w = snapshot.rope(s)
        # the grip has acted on the saddle: the rope up to the car takes the stretch of its other side
        behind, ahead = (np.hypot(*snapshot.rope_slope_beside(saddle, side)) for side in (-1.0, 1.0))
        r = r + (behind - ahead) * abs(s - snapshot.s[saddle]) * tangent / np.hypot(*tangent)
    else:
        s = snapshot.s[car.name]
        for _ in range(8):  # to find the nearest point of the rope
            r, tangent, w = snapshot.rope(s)
            s += (point - r) @ tangent / (tangent @ tangent)
        ds = (velocity - w) @ tangent / (tangent @ tangent)
    normal = np.array([-tangent[1], tangent[0]]) / np.hypot(*tangent)
    of_rope = np.array([r, w + ds * tangent])
    across = (with_rates[:2] - of_rope) @ normal
    point_with_rates = np.array([*(of_rope + np.outer(across, normal)), with_rates[2]])
    return snapshot._replace(
        s=snapshot.s | {car.name: s},
        ds=snapshot.ds | {car.name: ds},
        points=snapshot.points | {car.name: point_with_rates},
    )


class OffRopeState(NamedTuple):
    """What a wing finds of a car off the rope."""

    points: Array  # with their rates (n, 3, 2)
    force: Array  # (n, 2) [N] that rail and drive give it
    powers: dict[str, Array]  # (n,) [W] by cause, without that of the drive
    turning: Turning | None  # of its cabin that swings


def off_rope_motion_and_powers(
    line: MovingLine, car: Car, states: Sequence[State], off_rope: OffRopeState, contacts: tuple[ContactMotion, ...]
) -> tuple[CarMotion, dict[str, Array]]:
    """Motion of a car off the rope, driven along its rail, and its powers, named as in `LineMotion`."""
    assert car.rail is not None
    saddle = next(c for c in contacts if c.name == car.rail.saddle)
    point, velocity, acceleration = off_rope.points.swapaxes(0, 1)
    normal = downward_normals(car.rail, point[:, 0])
    tangent = _tangents_of(normal)
    force_along = np.sum(off_rope.force * tangent, axis=1)
    pressing = np.sum(off_rope.force * -normal, axis=1)
    speed = np.sum(velocity * tangent, axis=1)
    none = np.full(len(states), np.nan)
    grips = car.drive.mode == "grip"
    if grips:
        s, ds, _ = np.array([line.prescribed_position_with_rates(car, x.t, x.phase) for x in states]).T
        slope = car.rail.stretch * tangent
        powers = {"grip": car.rail.stretch * force_along * ds}
    else:
        s = saddle.s + point[:, 0] - saddle.point[:, 0]
        ds = speed
        slope = tangent
        powers = {"haul": force_along * speed, "friction": 0.0 * speed}
    motion = CarMotion(
        name=car.name, s=s, ds=ds, point=point, velocity=velocity, acceleration=acceleration,
        tension_behind=saddle.tension_behind, tension_ahead=saddle.tension_ahead, slope_behind=slope,
        slope_ahead=slope, haul_force=none if grips else force_along, grip_force=force_along if grips else none,
        contact_force=pressing, shoe_force=pressing, turning=off_rope.turning,
    )  # fmt: skip
    return motion, {f"{car.name} {cause}": power for cause, power in (off_rope.powers | powers).items()}


def upward_turn(slopes: Array) -> Array:
    """Sine (...) of the angle by which the rope turns upwards at a car; slopes : r' behind and ahead (..., 4)."""
    bx, by, ax, ay = np.moveaxis(slopes, -1, 0)
    return (by * ax - bx * ay) / (np.hypot(bx, by) * np.hypot(ax, ay))


def downward_normals(rail: Rail, x: Array) -> Array:
    """Normals of the rail (n, 2) at x (n,), downwards."""
    slope = rail.depth_with_derivatives(x)[1]
    return np.stack([-slope, np.ones_like(slope)], axis=1) / np.hypot(1.0, slope)[:, None]


def _tangents_of(normals: Array) -> Array:
    """Tangents (n, 2) to the right, from `downward_normals`."""
    return normals[:, ::-1] * np.array([1.0, -1.0])


def contacts_with_shoe_forces(
    line: MovingLine, cars: tuple[CarMotion, ...], contacts: tuple[ContactMotion, ...]
) -> tuple[ContactMotion, ...]:  # fmt: skip
    """The contacts with what cars put on their shoes."""
    rails = {car.name: car.rail for car in line.all_cars}
    off_rope = [car.name for car in line.cars_off_rope]
    for car in cars:
        rail = rails[car.name]
        if rail is not None:
            normal = downward_normals(rail, car.point[:, 0])
            force = car.shoe_force[:, None] * normal
            if car.name in off_rope:  # its grip acts on the rope on the saddle
                force -= np.nan_to_num(car.grip_force)[:, None] * _tangents_of(normal)
            contacts = tuple(replace(c, pressure=c.pressure + force * (c.name == rail.saddle)) for c in contacts)
    return contacts
