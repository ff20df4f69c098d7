"""A line in motion from its file."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cablefem.scene.contacts import NEAREST, Array, Car, Contact, Elastic, MovingLine
from cablefem.scene.drive import GRIP, Drive, Driving
from cablefem.scene.errors import SceneError, short_text
from cablefem.scene.line import Car as CarTable
from cablefem.scene.line import Line, LineState, NoLineAtRest, Solver
from cablefem.scene.motion import Motion
from cablefem.scene.travel import Law, Table, Trapezoid


@dataclass(frozen=True, slots=True)
class EmptyLine:
    """Where the contacts touch the empty rope, which is hot."""

    s: Array  # (k,) [m]
    x: Array  # (k,) [m]

    def x_of_position(self, car: Car, position: float) -> float:
        """x [m] of a position of a car, about."""
        return position if car.along == "x" else float(np.interp(position, self.s, self.x))

    def right_end_position(self, car: Car) -> float:
        """Position [m] of the right end, in what the travel of a car prescribes."""
        return float((self.x if car.along == "x" else self.s)[-1])


def line_in_motion(line: Line, solve: Solver) -> MovingLine:
    """The line in motion; `solve` finds the length of the empty line.  SceneError with all its faults.

    A hot rope is the same rope with s a times as long, a = 1 + thermal strain.
    """
    state = line.solve_empty_line(solve)
    thermal_stretch = 1.0 + line.cable.thermal_strain
    _raise_if_any(line, [*_timetable_and_drive_faults(line.car), *_too_heavy_car_faults(line, state)])
    contacts = [
        Contact(name=c.name, kind=c.kind, point=c.at, stiffness=c.stiffness, force=c.tension, shoe=c.shoe)
        for c in line.contact
    ]
    x_of_contacts = np.array([c.point[0] for c in contacts])
    haul_in_x = len(contacts) > 2
    faults: list[str] = []
    for table in line.car:
        as_written = _moving_car(table, haul_in_x, 1.0)  # on the cold rope
        last = EmptyLine(state.s, x_of_contacts).right_end_position(as_written)
        faults += [*_travel_range_faults(table, as_written, last), *_brake_faults(as_written, last)]
    empty = EmptyLine(state.s * thermal_stretch, x_of_contacts)
    cars = [_moving_car(car, haul_in_x, thermal_stretch) for car in line.car]
    _raise_if_any(line, faults)
    start_x = {car.name: empty.x_of_position(car, _start_position(car)) for car in cars}
    saddles_by_car = {car.name: _saddles_passed(car, contacts, empty) for car in cars}
    faults += [*_order_faults(cars, start_x), *_unpassable_saddle_faults(cars, saddles_by_car, start_x)]
    _raise_if_any(line, faults)
    _raise_if_any(line, _saddle_at_start_faults(contacts[1:-1], start_x))
    x = {c.name: c.point[0] for c in contacts} | start_x
    everything: list[Contact | Car] = [*contacts, *cars]
    everything.sort(key=lambda c: x[c.name])
    rope = _rope_at_temperature(line, float(empty.s[-1]), thermal_stretch)
    t_end = max(map(_end_time, cars), default=0.0)
    moving_line = MovingLine(rope=rope, contacts=tuple(everything), t_end=t_end, gravity=line.gravity, solve=solve)
    faults += [*_timetable_ends_in_motion_faults(moving_line), *_rear_wheel_start_faults(moving_line)]
    faults += _timetable_meeting_or_shoe_faults(moving_line, saddles_by_car, empty)
    _raise_if_any(line, faults)
    for car in cars:
        for saddle in saddles_by_car[car.name]:
            faults += _too_heavy_for_shoe_faults(moving_line, car, saddle)
    _raise_if_any(line, faults)
    return moving_line


def _raise_if_any(line: Line, faults: list[str]) -> None:
    """SceneError with these faults of a line, if there are any."""
    if faults:
        raise SceneError([line.fault_in_own_keys(fault) for fault in faults])


def _rope_at_temperature(line: Line, length: float, thermal_stretch: float) -> Elastic:
    """The hot rope with ice; length : [m] of the empty line."""
    rope = line.cable
    fixed = line.contact[-1].kind != "counterweight"
    mass = (rope.mass_per_length + rope.ice_mass_per_length) / thermal_stretch
    rate = 0.0 if rope.damping is None else rope.damping.rate
    return Elastic(mass_per_length=mass, EA=rope.EA, length=length if fixed else None, damping=rate)


def _too_heavy_car_faults(line: Line, empty: LineState) -> list[str]:
    """Cars heavier than the smallest tension of the empty line."""
    tensions = np.nanmin(empty.station_tensions, axis=1)
    lowest = int(np.nanargmin(tensions))
    N = float(tensions[lowest])
    must = f"must be < {N:.6g} N, N at {line.contact[lowest].name} of the empty line"
    weights = {car.name: car.mass * line.gravity for car in line.car}
    return [f"car.{name}.mass: M g = {weight:.6g} N; {must}" for name, weight in weights.items() if weight >= N]


def _travel_range_faults(table: CarTable, car: Car, last: float) -> Iterator[str]:
    """Faults of a car that begins or ends within NEAREST of the ends of the rope or beyond; last : right end [m]."""
    must = f"must be from {NEAREST:g} to {last - NEAREST:.6g} m, {NEAREST:g} m within the ends of the "
    must += "line, in x" if car.along == "x" else "rope"
    prescribed = {"drive.start": car.drive.start}
    if table.travel is not None:
        end = "travel.to" if isinstance(table.travel, Trapezoid) else "travel.positions"
        prescribed = dict(zip(("travel.from", end), _first_and_last_position(table.travel), strict=True))
    for name, position in prescribed.items():
        if not NEAREST <= position <= last - NEAREST:
            yield f"car.{car.name}.{name}: {position:.6g} m; {must}"


def _brake_faults(car: Car, last: float) -> Iterator[str]:
    """Faults of brakes beyond the right end of the rope, or on from the start."""
    pushed = any(force > 0.0 for _, force in car.drive.thrust_table)
    for i, (position, _) in enumerate(car.drive.brakes):
        brake = f"car.{car.name}.drive.brake[{i}].from = {position:.6g}"
        if position >= last:
            yield f"{brake}: must be < {last:.6g} m, the end of the rope"
        elif position <= car.drive.start and not pushed:
            begins = f"must be > {car.drive.start:.6g} m, where the car begins without a thrust to the right"
            yield f"{brake}: {begins}; brakes act to the right of it: mirror a line whose car rolls to the left"


def _order_faults(cars: Sequence[Car], start_x: Mapping[str, float]) -> list[str]:
    """Cars that do not begin at least NEAREST to the right of the one before."""
    faults = []
    for a, b in itertools.pairwise(cars):
        between = start_x[b.name] - start_x[a.name]
        if between < NEAREST:
            where = f"car.{b.name}: begins {between:.4g} m to the right of {a.name}"
            faults.append(f"{where}; must be >= {NEAREST:g} m; cars are listed from left to right and cannot pass")
    return faults


def _saddle_at_start_faults(saddles: Sequence[Contact], start_x: Mapping[str, float]) -> list[str]:
    """Cars that begin within NEAREST of a saddle, over which they may put the rope as it sags."""
    faults = []
    for saddle in saddles:
        for name, x in start_x.items():
            distance = abs(x - saddle.point[0])
            if distance < NEAREST:
                faults.append(f"car.{name}: begins {distance:.3g} m from {saddle.name}; must be >= {NEAREST:g} m")
    return faults


def _saddles_passed(car: Car, contacts: Sequence[Contact], empty: EmptyLine) -> list[Contact]:
    """Saddles that a car with a travel comes to."""
    end = car.travel_end
    if end is None:
        return []
    low, high = sorted(empty.x_of_position(car, position) for position in (_start_position(car), end.position))
    base = 0.0 if car.wheels is None else car.wheels.base
    passed = []
    for saddle in contacts[1:-1]:
        shoe = saddle.shoe or 0.0
        if low - base - shoe <= saddle.point[0] <= high + shoe:
            passed.append(saddle)
    return passed


def _unpassable_saddle_faults(
    cars: Sequence[Car], passed_saddles: Mapping[str, Sequence[Contact]], start_x: Mapping[str, float]
) -> list[str]:  # fmt: skip
    """Faults of cars that cannot pass the saddles in their way."""
    faults = []
    for car in cars:
        for saddle in passed_saddles[car.name]:
            if car.wheels is not None:
                faults.append(f"car.{car.name}.wheels: {saddle.name} is in the way; two wheels stay on one span")
            elif saddle.shoe is None:
                faults.append(f"contact.{saddle.name}.shoe: missing; must be given where a car passes, here {car.name}")
            elif abs(start_x[car.name] - saddle.point[0]) <= saddle.shoe:
                faults.append(f"car.{car.name}: begins on the shoe of {saddle.name}; must begin beside it")
    return faults


def _too_heavy_for_shoe_faults(line: MovingLine, car: Car, saddle: Contact) -> Iterator[str]:
    """Fault of a car that is too heavy for the rope at the ends of a shoe, where all others are off the rope."""
    weight = car.mass * line.gravity
    shoe = saddle.shoe or 0.0
    assert line.solve is not None
    heaviest = 0.3  # M g/N of a car that runs over a shoe
    for x in (saddle.point[0] - shoe, saddle.point[0] + shoe):
        case = line.rest_case([(car, x)])
        state = line.solve([case])[0]
        if isinstance(state, NoLineAtRest):
            yield f"car.{car.name}: does not come onto the shoe of {saddle.name}: {state}"
            return
        names = [p.name for p in case.stations]
        N = float(np.nanmin(state.station_tensions[names.index(saddle.name)]))
        if weight > heaviest * N:
            ratio = f"M g/N = {weight / N:.3g} at the shoe of {saddle.name}; must be <= {heaviest:g}"
            yield f"car.{car.name}.mass = {car.mass:.6g} kg: {ratio}, or it does not run over it"
            return


def _timetable_ends_in_motion_faults(line: MovingLine) -> Iterator[str]:
    """Cars whose timetable ends in motion, before that of another car."""
    for car in line.cars_on_rope:
        end = car.travel_end
        if end is not None and end.t < line.t_end and abs(end.velocity) > 1e-9:
            must = f"must be 0, for another car moves until {line.t_end:.6g} s"
            yield f"car.{car.name}.travel: {end.velocity:.6g} m/s at its end, {end.t:.6g} s; {must}"


def _rear_wheel_start_faults(line: MovingLine) -> Iterator[str]:
    """Cars that begin with a wheel on the platform, where the left end of the rope is fixed."""
    if line.supports[0].kind == "counterweight":
        return
    nearest_wheel = 0.002  # of the length: from the left support to a rear wheel at the start
    nearest = max(NEAREST, nearest_wheel * (line.rope.length or 0.0))
    for car in line.cars_on_rope:
        if car.wheels is None or car.along == "x":
            continue
        smallest = nearest + car.wheels.base
        if _start_position(car) < smallest:
            must = f"must be >= {smallest:.6g} m: {nearest:.4g} m and the base, both wheels begin on the rope"
            yield f"car.{car.name}: begins with its front wheel at {_start_position(car):.6g} m; {must}"


def _timetable_meeting_or_shoe_faults(
    line: MovingLine, saddles_by_car: Mapping[str, Sequence[Contact]], empty: EmptyLine
) -> Iterator[str]:
    """The first fault of each two cars whose timetables meet, or that are on one shoe."""
    for a, b in itertools.combinations(line.cars_on_rope, 2):
        if a.travel is not None and b.travel is not None:
            shoes = [saddle for saddle in saddles_by_car[a.name] if saddle in saddles_by_car[b.name]]
            yield from itertools.islice(_faults_of_two_cars(line, a, b, shoes, empty), 1)


def _faults_of_two_cars(line: MovingLine, a: Car, b: Car, shoes: Sequence[Contact], empty: EmptyLine) -> Iterator[str]:
    """Faults of two cars at all instants; shoes : that both pass."""
    samples = 100  # of timetables, in each phase
    for phase, (t0, t1) in enumerate(line.phases):
        for t in np.linspace(t0, t1, samples).tolist():
            first, second = (line.prescribed_position_with_rates(car, t, phase)[0] for car in (a, b))
            x = empty.x_of_position(a, first), empty.x_of_position(b, second)
            distance = second - first if a.along == b.along else x[1] - x[0]
            fault = _too_close_fault(a, b, t, distance) or _same_shoe_fault(a, b, t, x, shoes)
            if fault:
                yield fault


def _too_close_fault(a: Car, b: Car, t: float, distance: float) -> str:
    if distance >= NEAREST:
        return ""
    must = f"must be >= {NEAREST:g} m; cars are listed from left to right and cannot pass"
    return f"car.{b.name}.travel: {distance:.4g} m ahead of {a.name} at t = {t:.4g} s; {must}"


def _same_shoe_fault(a: Car, b: Car, t: float, x: Sequence[float], shoes: Sequence[Contact]) -> str:
    for saddle in shoes:
        if max(abs(position - saddle.point[0]) for position in x) <= (saddle.shoe or 0.0):
            where = f"on the shoe of {saddle.name} together with {a.name} at t = {t:.4g} s"
            return f"car.{b.name}.travel: {where}; must be there alone"
    return ""


def _start_position(car: Car) -> float:
    return car.drive.start if car.travel is None else car.travel.position_with_rates(0.0, 0)[0]


def _end_time(car: Car) -> float:
    return car.drive.end_time if car.travel_end is None else car.travel_end.t


def _moving_car(car: CarTable, haul_in_x: bool, thermal_stretch: float) -> Car:
    """The car of a table; haul_in_x : whether a hauled car has its travel in x.

    Positions along the rope are of the cold one; a hot one has stretched by `thermal_stretch`.
    """
    drive: Drive = GRIP if car.drive is None else car.drive.in_units(1.0, 1.0, 1.0, 1.0)
    drive = replace(
        drive,
        start=thermal_stretch * drive.start,
        brakes=tuple((thermal_stretch * s, force) for s, force in drive.brakes),
        rear_brakes=tuple((thermal_stretch * s, force) for s, force in drive.rear_brakes),
    )
    along: Literal["s", "x"] = "x" if haul_in_x and drive.mode == "haul" else "s"
    travel = None
    if car.travel is not None:
        travel = _motion_of_law(car.travel)
        travel = travel.in_units(1.0 / thermal_stretch, 1.0) if along == "s" else travel
    wheels = car.wheels if car.wheels is not None and car.wheels.model == "rigid" else None
    return Car(name=car.name, mass=car.mass, hanger=car.hanger, wheels=wheels, drive=drive, travel=travel, along=along)


def _first_and_last_position(law: Law) -> tuple[float, float]:
    """[m] of a trapezoid or a table."""
    begin = law.position or 0.0
    if isinstance(law, Trapezoid):
        return begin, law.to or 0.0
    assert isinstance(law, Table)
    return begin, begin + law.positions[-1]


def _motion_of_law(law: Law) -> Motion:
    """The motion [m] from the first to the last position, to the left, too."""
    begin, end = _first_and_last_position(law)
    motion = law.motion(abs(end - begin))
    return (motion.in_units(-1.0, 1.0) if end < begin else motion).shifted(begin)


def _timetable_and_drive_faults(cars: Sequence[CarTable]) -> Iterator[str]:
    """What cars lack in motion, and faults of their timetables; one of each car."""
    for car in cars:
        law = car.travel
        if law is None:
            missing = _missing_drive_key(car.drive)
        elif isinstance(law, Trapezoid | Table):
            missing = _missing_travel_key(law)
        else:
            yield f"car.{car.name}.travel.kind = {short_text(law.kind)}: must be trapezoid or table on a line"
            continue
        if missing:
            yield f"car.{car.name}.{missing}: missing; must be given on a line"
        elif law is not None:
            begin, end = _first_and_last_position(law)
            if fault := law.fault_on_cable(abs(end - begin), begin):
                yield f"car.{car.name}.travel.{fault}"


def _missing_drive_key(drive: Driving | None) -> str:
    if drive is None or drive.start is None:
        return "drive.start"
    return "drive.end.time" if drive.end is None or drive.end.time is None else ""


def _missing_travel_key(law: Trapezoid | Table) -> str:
    if law.position is None:
        return "travel.from"
    return "travel.to" if isinstance(law, Trapezoid) and law.to is None else ""
