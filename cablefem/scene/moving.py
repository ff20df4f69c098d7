"""A line in motion from its file."""

from __future__ import annotations

from typing import Literal

from cablefem.scene.contacts import Car, Contact, Elastic, MovingLine
from cablefem.scene.drive import GRIP, Drive
from cablefem.scene.errors import SceneError, shown
from cablefem.scene.line import Car as CarTable
from cablefem.scene.line import Line, Solver
from cablefem.scene.motion import Motion
from cablefem.scene.travel import Law, Table, Trapezoid


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
        Contact(name=c.name, kind=c.kind, point=c.at, stiffness=c.stiffness, force=c.tension) for c in line.contact
    ]
    in_x = len(contacts) > 2
    faults = [fault for car in line.car if (fault := _travel_fault(car))]
    if faults:
        raise SceneError(faults)
    cars = [_car(car, in_x, heat) for car in line.car]
    ends = [car.travel.phases[-1][1] if car.travel is not None else car.drive.end_time for car in cars]
    supports = {c.name: (c.point[0] if in_x else s) for c, s in zip(contacts, (empty.s * heat).tolist(), strict=True)}
    starts = {car.name: _start(car) for car in cars}
    everything: list[Contact | Car] = [*contacts, *cars]
    order = sorted(everything, key=lambda c: {**supports, **starts}[c.name])
    return MovingLine(rope=elastic, contacts=tuple(order), t_end=max(ends, default=0.0), gravity=line.gravity)


def _start(car: Car) -> float:
    return car.drive.start if car.travel is None else car.travel.at(0.0, 0)[0]


def _car(car: CarTable, in_x: bool, heat: float) -> Car:
    drive: Drive = GRIP if car.drive is None else car.drive.scaled(1.0, 1.0, 1.0, 1.0)
    along: Literal["s", "x"] = "x" if in_x and drive.mode == "haul" else "s"
    travel = None
    if car.travel is not None:
        travel = _motion(car.travel)
        travel = travel.scaled(1.0 / heat, 1.0) if along == "s" else travel
    return Car(name=car.name, mass=car.mass, drive=drive, travel=travel, along=along)


def _ends(law: Law) -> tuple[float, float]:
    """First and last position [m]."""
    begin = law.place or 0.0
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
    if law.place is None or (isinstance(law, Trapezoid) and law.to is None):
        return f"car.{car.name}.travel.{'from' if law.place is None else 'to'}: missing; must be given on a line"
    begin, end = _ends(law)
    fault = law.fault(abs(end - begin), begin)
    return f"car.{car.name}.travel.{fault}" if fault else ""
