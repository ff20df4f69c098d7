"""Cars over the shoes of saddles: each event changes what the rope touches.

At the end of a shoe a car lands on a rail.  TIP of the shoe before the saddle it leaves the rope, which has no kink
there; as far behind it takes the rope again, and at the other end of the shoe it leaves the rail.
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

    def __str__(self) -> str:
        return f"{self.car} {self.action} {self.saddle.name}"

    def distance_to_go(self, x: float, dx: float) -> float:
        """[m] from x with the velocity dx to this passage; inf: not that way."""
        shoe = self.saddle.shoe or 0.0
        way = x - self.saddle.point[0]
        if self.action == "takes the rope behind":
            return TIP * shoe - math.copysign(way, way * dx)
        outwards = self.action == "leaves the shoe of"
        to_go = abs(way) - (shoe if self.action == "lands on the shoe of" else TIP * shoe)
        if outwards:
            to_go = shoe - abs(way)
        return to_go if to_go > 0.0 or way * dx * (1.0 if outwards else -1.0) > 0.0 else math.inf


class LineSnapshot(NamedTuple):
    """A line at an event, by names of contacts and cars; [m], [m/s], [m/s2]."""

    s: dict[str, float]
    ds: dict[str, float]
    points: dict[str, Array]  # with rates (3, 2)
    rope: Callable[[float], Array]  # r, r' and the velocity at fixed s (3, 2), of s


def line_snapshot(
    line: MovingLine, points: Array, s: Array, points_off_rope: dict[str, Array], rope: Callable[[float], Array]
) -> LineSnapshot:
    """From points (3, contacts, 2) and s (3, contacts) of all contacts, and points (3, 2) of cars off the rope."""
    names = [c.name for c in line.contacts_and_wheels]
    at, rates = (dict(zip(names, values, strict=True)) for values in s[:2].tolist())
    by_name = dict(zip(names, points.swapaxes(0, 1), strict=True))
    at |= {car.name: at[car.rail.saddle] for car in line.cars_off_rope if car.rail is not None}
    return LineSnapshot(at, rates, by_name | points_off_rope, rope)


def possible_passages(line: MovingLine) -> tuple[Passage, ...]:
    """All that may come next."""
    by_name = {c.name: c for c in line.supports}
    out = [passage for k in range(len(line.contacts)) for passage in _passages_of_contact(line, k, by_name)]
    out += [
        Passage(car.name, "takes the rope behind", by_name[car.rail.saddle]) for car in line.cars_off_rope if car.rail
    ]
    return tuple(out)


def _passages_of_contact(line: MovingLine, k: int, supports: Mapping[str, Contact]) -> Iterator[Passage]:
    """Passages of contact k, if it is a car; supports : by name."""
    car = line.contacts[k]
    if not isinstance(car, Car):
        return
    if car.rail is not None:
        saddle = supports[car.rail.saddle]
        yield Passage(car.name, "leaves the rope at", saddle)
        yield Passage(car.name, "leaves the shoe of", saddle)
    elif car.drive_kind != "free" and car.wheels is None:
        for neighbour in (line.contacts[k - 1], line.contacts[k + 1]):
            if isinstance(neighbour, Contact) and neighbour.shoe is not None:
                yield Passage(car.name, "lands on the shoe of", neighbour)


def passage_exists_between(passages: Sequence[Passage], left: str, right: str) -> bool:
    """Whether one of two neighbours, by name, is a car that may pass the other, a saddle."""
    return any({p.car, p.saddle.name} == {left, right} for p in passages)


def line_and_snapshot_after_passage(
    line: MovingLine, passage: Passage, t: float, phase: int, snapshot: LineSnapshot
) -> tuple[MovingLine, LineSnapshot]:
    """The line after a passage, and the snapshot with the point of the rope that the car takes, if it does."""
    car = next(c for c in (*line.cars_on_rope, *line.cars_off_rope) if c.name == passage.car)
    match passage.action:
        case "lands on the shoe of":
            return _line_after_landing(line, car, passage.saddle, t, snapshot), snapshot
        case "leaves the rope at":
            return _line_after_rope_left(line, car, passage.saddle, snapshot), snapshot
        case "leaves the shoe of":
            return _line_with_car_on_rail(line, car, None), snapshot
        case "takes the rope behind":
            snapshot = _snapshot_with_rope_point_below(line, car, t, phase, snapshot)
            return _line_after_rope_taken(line, car, passage.saddle, t, snapshot), snapshot


def _line_with_car_on_rail(line: MovingLine, car: Car, rail: Rail | None) -> MovingLine:
    """The line with that car of its contacts on this rail, or on none."""
    contacts = tuple(replace(car, rail=rail) if contact is car else contact for contact in line.contacts)
    return replace(line, contacts=contacts)


def _side_of_saddle(car: Car, saddle: Contact, snapshot: LineSnapshot) -> float:
    """1 where the car is to the right of the saddle, else -1."""
    return math.copysign(1.0, float(snapshot.points[car.name][0, 0]) - saddle.point[0])


def _line_after_landing(line: MovingLine, car: Car, saddle: Contact, t: float, snapshot: LineSnapshot) -> MovingLine:
    """The line with the car on a rail, from its path on the rope to the slope of the rope beside it."""
    if any(c.rail is not None and c.rail.saddle == saddle.name for c in (*line.cars_on_rope, *line.cars_off_rope)):
        raise StepFailure(t, f"two cars on the shoe of {saddle.name}", "let one follow later")
    (x, y), velocity, acceleration = snapshot.points[car.name].tolist()
    slope = velocity[1] / velocity[0]
    bend = (acceleration[1] - slope * acceleration[0]) / velocity[0] ** 2
    side = _side_of_saddle(car, saddle, snapshot)
    tangent = snapshot.rope(snapshot.s[car.name] + side * BESIDE)[1]
    end = _straight_rail_end(saddle, side, tangent)
    return _line_with_car_on_rail(line, car, Rail(saddle.name, RailEnd(x, y, slope, bend), end))


def _line_after_rope_left(line: MovingLine, car: Car, saddle: Contact, snapshot: LineSnapshot) -> MovingLine:
    """The line with the car over it, on a rail over the saddle to as far behind it."""
    (x, y), velocity, _ = snapshot.points[car.name].tolist()
    side = _side_of_saddle(car, saddle, snapshot)
    tangent = snapshot.rope(snapshot.s[saddle.name] - side * BESIDE)[1]
    end = _straight_rail_end(saddle, -side, tangent)
    stretch = float(np.hypot(*velocity)) / abs(snapshot.ds[car.name] - snapshot.ds[saddle.name])
    begin = RailEnd(x, y, velocity[1] / velocity[0])
    rail = Rail(saddle.name, begin, end, snapshot.s[car.name] - snapshot.s[saddle.name], stretch)
    contacts = tuple(contact for contact in line.contacts if contact is not car)
    return replace(line, contacts=contacts, cars_off_rope=(*line.cars_off_rope, replace(car, rail=rail)))


def _line_after_rope_taken(line: MovingLine, car: Car, saddle: Contact, t: float, snapshot: LineSnapshot) -> MovingLine:
    """The line with a car from over it on the rope again, on a rail to the end of the shoe."""
    side = _side_of_saddle(car, saddle, snapshot)
    x, y = snapshot.points[car.name][0]
    r_x, r_y = snapshot.rope(snapshot.s[car.name])[1]
    rail = Rail(saddle.name, RailEnd(x, y, r_y / r_x), _rail_end_on_load_path(line, car, saddle, side, t, snapshot))
    contacts = list(line.contacts)
    contacts.insert(contacts.index(saddle) + (side > 0.0), replace(car, rail=rail))
    off_rope = tuple(c for c in line.cars_off_rope if c is not car)
    return replace(line, contacts=tuple(contacts), cars_off_rope=off_rope)


def _straight_rail_end(saddle: Contact, side: float, tangent: Array) -> RailEnd:
    """The end of a rail at the tip of the shoe on a side, on a straight line of this tangent r' through the saddle."""
    slope = tangent[1] / tangent[0]
    away = side * TIP * (saddle.shoe or 0.0)
    x, y = saddle.point
    return RailEnd(x + away, y + away * slope, slope)


def _snapshot_with_rope_point_below(
    line: MovingLine, car: Car, t: float, phase: int, snapshot: LineSnapshot
) -> LineSnapshot:
    """The snapshot with s and the point of the rope below a car off the rope, with their rates."""
    position, speed, _ = line.prescribed_position_with_rates(car, t, phase)
    if car.along == "s":
        s, ds = position, speed
        r, along, w = snapshot.rope(s)
        # the grip has acted on the saddle: the rope up to the car takes the stretch of its other side
        at = snapshot.s["" if car.rail is None else car.rail.saddle]
        behind, ahead = (np.hypot(*snapshot.rope(at + side * BESIDE)[1]) for side in (-1.0, 1.0))
        r = r + (behind - ahead) * abs(s - at) * along / np.hypot(*along)
    else:
        s = snapshot.s[car.name]
        for _ in range(8):  # to find the rope below a car
            r, along, w = snapshot.rope(s)
            s += (position - r[0]) / along[0]
        ds = (speed - w[0]) / along[0]
        r = np.array([position, r[1]])
    return snapshot._replace(
        s=snapshot.s | {car.name: s},
        ds=snapshot.ds | {car.name: ds},
        points=snapshot.points | {car.name: np.array([r, w + ds * along, 0.0 * r])},
    )


def _rail_end_on_load_path(
    line: MovingLine, car: Car, saddle: Contact, side: float, t: float, snapshot: LineSnapshot
) -> RailEnd:
    """The end of the shoe on the path of the car at rest, in that one span between anchors at their present s."""
    k = line.contacts.index(saddle)
    others = line.contacts[k + 1 :] if side > 0.0 else line.contacts[k - 1 :: -1]
    span: list[Station] = []
    for contact in (saddle, *others):
        name = contact.name if contact.name in snapshot.points else f"{contact.name}.front"
        x, y = snapshot.points[name][0]
        if isinstance(contact, Car):
            span.append(contact.station_at(x, line.gravity))
            continue
        span.append(Station(contact.name, "anchor", x, y))
        if contact is not saddle:
            break
    length = abs(snapshot.s[contact.name] - snapshot.s[saddle.name])
    shoe = saddle.shoe or 0.0
    step = 0.25 * shoe
    at = saddle.point[0] + side * shoe + step * np.array([-1.0, 0.0, 1.0])
    cases = []
    for x in at.tolist():
        stations = tuple(sorted([*span, car.station_at(x, line.gravity)], key=lambda p: p.x))
        cases.append(Case(stations, line.weight_per_length, line.rope.EA, length=length))
    assert line.solve is not None
    before, y, after = (_car_depth_at_rest(car, saddle, state, t) for state in line.solve(cases))
    return RailEnd(float(at[1]), y, (after - before) / (2.0 * step), (after - 2.0 * y + before) / step**2)


def _car_depth_at_rest(car: Car, saddle: Contact, state: LineState | NoLineAtRest, t: float) -> float:
    """Depth [m] of the car in a state of rest; StepFailure where there is none."""
    if not isinstance(state, LineState):
        raise StepFailure(t, f"no path of {car.name} behind {saddle.name}: {state}", "give more rope or less load")
    names = [p.name for p in state.case.stations]
    return float(state.points[names.index(car.name), 1])


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
    name, near = car.name, car.rail.saddle
    saddle = next(c for c in contacts if c.name == near)
    point, velocity, acceleration = off_rope.points.swapaxes(0, 1)
    normal = downward_normals(car.rail, point[:, 0])
    tangent = normal[:, ::-1] * np.array([1.0, -1.0])
    along, pressing = (np.sum(off_rope.force * axis, axis=1) for axis in (tangent, -normal))
    speed = np.sum(velocity * tangent, axis=1)
    none = np.full(len(states), np.nan)
    s, ds, stretch = saddle.s + point[:, 0] - saddle.point[:, 0], speed, 1.0
    powers = {f"{name} {cause}": power for cause, power in off_rope.powers.items()}
    grips = car.drive.mode == "grip"
    if grips:
        s, ds, _ = np.array([line.prescribed_position_with_rates(car, x.t, x.phase) for x in states]).T
        stretch = car.rail.stretch
        powers[f"{name} grip"] = stretch * along * ds
    else:
        powers |= {f"{name} haul": along * speed, f"{name} friction": 0.0 * speed}
    motion = CarMotion(
        name=name, s=s, ds=ds, point=point, velocity=velocity, acceleration=acceleration,
        tension_behind=saddle.tension_behind, tension_ahead=saddle.tension_ahead, slope_behind=stretch * tangent,
        slope_ahead=stretch * tangent, haul_force=none if grips else along, grip_force=along if grips else none,
        contact_force=pressing, shoe_force=pressing, turning=off_rope.turning,
    )  # fmt: skip
    return motion, powers


def downward_normals(rail: Rail, x: Array) -> Array:
    """Normals of the rail (n, 2) at x (n,), downwards."""
    slope = rail.depth_with_derivatives(x)[1]
    return np.stack([-slope, np.ones_like(slope)], axis=1) / np.hypot(1.0, slope)[:, None]


def contacts_with_shoe_forces(
    line: MovingLine, cars: tuple[CarMotion, ...], contacts: tuple[ContactMotion, ...]
) -> tuple[ContactMotion, ...]:  # fmt: skip
    """The contacts with what cars put on their shoes."""
    rails = {car.name: car.rail for car in (*line.cars_on_rope, *line.cars_off_rope)}
    off = [car.name for car in line.cars_off_rope]
    for car in cars:
        rail = rails[car.name]
        if rail is not None:
            normal = downward_normals(rail, car.point[:, 0])
            force = car.shoe_force[:, None] * normal
            if car.name in off:  # its grip acts on the rope on the saddle
                force -= np.nan_to_num(car.grip_force)[:, None] * normal[:, ::-1] * np.array([1.0, -1.0])
            contacts = tuple(replace(c, pressure=c.pressure + force * (c.name == rail.saddle)) for c in contacts)
    return contacts
