"""A line in motion from its file."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from cablefem.scene.contacts import NEAREST, Array, Car, Contact, Elastic, MovingLine
from cablefem.scene.drive import GRIP, Drive
from cablefem.scene.errors import SceneError, shown
from cablefem.scene.line import Car as CarTable
from cablefem.scene.line import Case, Line, NoLine, Solver, Station
from cablefem.scene.motion import Motion
from cablefem.scene.travel import Law, Table, Trapezoid

SAMPLES = 100  # of timetables, in each phase
HEAVIEST = 0.3  # M g/N of a car that runs over a shoe


def moving(line: Line, solve: Solver) -> MovingLine:
    """The line in motion; `solve` finds the length of the empty line.  SceneError with all its faults.

    A hot rope is the same rope with s a times as long, a = 1 + thermal strain.
    """
    empty, rope, heat = line.empty(solve), line.cable, 1.0 + line.cable.warmer
    fixed_right = line.contact[-1].kind != "counterweight"
    elastic = Elastic(
        mass_per_length=(rope.mass_per_length + rope.ice_per_length) / heat,
        EA=rope.EA,
        length=float(empty.s[-1]) * heat if fixed_right else None,
    )
    contacts = [
        Contact(name=c.name, kind=c.kind, point=c.at, stiffness=c.stiffness, force=c.tension, shoe=c.shoe)
        for c in line.contact
    ]
    in_x = len(contacts) > 2
    faults = [fault for car in line.car if (fault := _travel_fault(car))]
    lowest = int(np.nanargmin(np.nanmin(empty.tensions, axis=1)))
    N = float(np.nanmin(empty.tensions[lowest]))
    for car in line.car:
        weight = car.mass * line.gravity
        if weight >= N:
            at = line.contact[lowest].name
            faults.append(
                f"car.{car.name}.mass: M g = {weight:.6g} N; must be < {N:.6g} N, N at {at} of the empty line"
            )
    if faults:
        raise SceneError(faults)
    cars = [_car(car, in_x, heat) for car in line.car]
    ends = [car.travel.phases[-1][1] if car.travel is not None else car.drive.end_time for car in cars]
    s, x = empty.s * heat, np.array([c.point[0] for c in contacts])
    places = {c.name: place for c, place in zip(contacts, x.tolist(), strict=True)}
    places |= {car.name: _x_of(car, _start(car), s, x) for car in cars}
    passing = {car.name: _passed(car, contacts, s, x) for car in cars}
    if faults := [*_order_faults(cars, places), *_saddle_faults(cars, passing, places)]:
        raise SceneError(faults)
    everything: list[Contact | Car] = [*contacts, *cars]
    order = sorted(everything, key=lambda c: places[c.name])
    found = MovingLine(
        rope=elastic, contacts=tuple(order), t_end=max(ends, default=0.0), gravity=line.gravity, solve=solve
    )
    _refuse_meeting(found, passing, s, x)
    if faults := [fault for car in cars for saddle in passing[car.name] for fault in _shoe_faults(found, car, saddle)]:
        raise SceneError(faults)
    return found


def _x_of(car: Car, position: float, s: Array, x: Array) -> float:
    """x [m], of a position along the rope about; s and x (k,) [m] of the contacts at rest."""
    return position if car.along == "x" else float(np.interp(position, s, x))


def _order_faults(cars: Sequence[Car], places: Mapping[str, float]) -> list[str]:
    faults = []
    for a, b in itertools.pairwise(cars):
        between = places[b.name] - places[a.name]
        if between < NEAREST:
            where = f"car.{b.name}: begins {between:.4g} m to the right of {a.name}"
            faults.append(f"{where}; must be >= {NEAREST:g} m; cars are listed from left to right and cannot pass")
    return faults


def _passed(car: Car, contacts: Sequence[Contact], s: Array, x: Array) -> list[Contact]:
    """Saddles that a car with a travel comes to; s and x (k,) [m] of the contacts at rest."""
    if car.travel is None:
        return []
    last = len(car.travel.phases) - 1
    positions = (_start(car), car.travel.at(car.travel.phases[last][1], last)[0])
    low, high = sorted(_x_of(car, position, s, x) for position in positions)
    base = 0.0 if car.wheels is None else car.wheels.base
    return [c for c in contacts[1:-1] if low - base - (c.shoe or 0.0) <= c.point[0] <= high + (c.shoe or 0.0)]


def _saddle_faults(
    cars: Sequence[Car], passing: Mapping[str, Sequence[Contact]], places: Mapping[str, float]
) -> list[str]:  # fmt: skip
    """Faults of cars that cannot pass the saddles in their way."""
    faults = []
    for car in cars:
        for saddle in passing[car.name]:
            body = "wheels" if car.wheels is not None else "hanger"
            if car.wheels is not None or car.hanger is not None:
                why = "two wheels stay" if car.wheels is not None else "a cabin that swings stays"
                faults.append(f"car.{car.name}.{body}: {saddle.name} is in the way; {why} on one span")
            elif saddle.shoe is None:
                faults.append(f"contact.{saddle.name}.shoe: missing; must be given where a car passes, here {car.name}")
            elif abs(places[car.name] - saddle.point[0]) <= saddle.shoe:
                faults.append(f"car.{car.name}: begins on the shoe of {saddle.name}; must begin beside it")
    return faults


def _shoe_faults(line: MovingLine, car: Car, saddle: Contact) -> Iterator[str]:
    """Fault of a car that is too heavy for the rope at the ends of a shoe, where all others are off the rope."""
    weight, shoe = car.mass * line.gravity, saddle.shoe or 0.0
    assert line.solve is not None
    for x in (saddle.point[0] - shoe, saddle.point[0] + shoe):
        stations = [
            Station(c.name, c.kind, *c.point, force=c.force or 0.0, stiffness=c.stiffness) for c in line.supports
        ]
        stations.append(car.hanging(x, line.gravity))
        stations.sort(key=lambda p: p.x)
        state = line.solve([Case(tuple(stations), line.weight, line.rope.EA, length=line.rope.length)])[0]
        if isinstance(state, NoLine):
            yield f"car.{car.name}: does not come onto the shoe of {saddle.name}: {state}"
            return
        N = float(np.nanmin(state.tensions[[p.name for p in stations].index(saddle.name)]))
        if weight > HEAVIEST * N:
            ratio = f"M g/N = {weight / N:.3g} at the shoe of {saddle.name}; must be <= {HEAVIEST:g}"
            yield f"car.{car.name}.mass = {car.mass:.6g} kg: {ratio}, or it does not run over it"
            return


def _refuse_meeting(line: MovingLine, passing: Mapping[str, Sequence[Contact]], s: Array, x: Array) -> None:
    """SceneError where a timetable along the rope meets one in x, or two cars are on one shoe.

    s and x (k,) [m] of the contacts at rest.
    """
    for a, b in itertools.combinations(line.cars, 2):
        shoes = [saddle for saddle in passing[a.name] if saddle in passing[b.name]]
        if a.travel is None or b.travel is None or (a.along == b.along and not shoes):
            continue
        for phase, (t0, t1) in enumerate(line.phases):
            for t in np.linspace(t0, t1, SAMPLES).tolist():
                at = [_x_of(car, line.position(car, t, phase)[0], s, x) for car in (a, b)]
                if at[1] - at[0] < NEAREST:
                    must = f"must be >= {NEAREST:g} m; cars are listed from left to right and cannot pass"
                    raise SceneError(
                        [f"{b.name}.travel: about {at[1] - at[0]:.3g} m ahead of {a.name} at t = {t:.4g} s; {must}"]
                    )
                for saddle in shoes:
                    if max(abs(place - saddle.point[0]) for place in at) <= (saddle.shoe or 0.0):
                        where = f"on the shoe of {saddle.name} together with {a.name} at t = {t:.4g} s"
                        raise SceneError([f"car.{b.name}.travel: {where}; must be there alone"])


def _start(car: Car) -> float:
    return car.drive.start if car.travel is None else car.travel.at(0.0, 0)[0]


def _car(car: CarTable, in_x: bool, heat: float) -> Car:
    drive: Drive = GRIP if car.drive is None else car.drive.scaled(1.0, 1.0, 1.0, 1.0)
    along: Literal["s", "x"] = "x" if in_x and drive.mode == "haul" else "s"
    travel = None
    if car.travel is not None:
        travel = _motion(car.travel)
        travel = travel.scaled(1.0 / heat, 1.0) if along == "s" else travel
    wheels = car.wheels if car.wheels is not None and car.wheels.model == "rigid" else None
    return Car(name=car.name, mass=car.mass, hanger=car.hanger, wheels=wheels, drive=drive, travel=travel, along=along)


def _ends(law: Law) -> tuple[float, float]:
    """First and last position [m]."""
    begin = law.position or 0.0
    if isinstance(law, Trapezoid):
        return begin, law.to or 0.0
    assert isinstance(law, Table)
    return begin, begin + law.positions[-1]


def _motion(law: Law) -> Motion:
    begin, end = _ends(law)
    motion = law.motion(abs(end - begin))
    return (motion.scaled(-1.0, 1.0) if end < begin else motion).shifted(begin)


def _travel_fault(car: CarTable) -> str:
    law = car.travel
    if law is None:
        late = car.drive is None or car.drive.end is None or car.drive.end.time is None
        start = car.drive is not None and car.drive.start is not None
        missing = ("" if start else "drive.start") or ("drive.end.time" if late else "")
        return f"car.{car.name}.{missing}: missing; must be given on a line" if missing else ""
    if not isinstance(law, Trapezoid | Table):
        return f"car.{car.name}.travel.kind = {shown(law.kind)}: must be trapezoid or table on a line"
    if law.position is None or (isinstance(law, Trapezoid) and law.to is None):
        return f"car.{car.name}.travel.{'from' if law.position is None else 'to'}: missing; must be given on a line"
    begin, end = _ends(law)
    fault = law.fault(abs(end - begin), begin)
    return f"car.{car.name}.travel.{fault}" if fault else ""
