"""One rope at rest over anchors, springs, saddles and a counterweight, with cars.

SI; x to the right and y down from the first contact. s is unstretched rope at the reference temperature, from the left
end of the empty line.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from cablefem.scene.bisection import bisect_zero
from cablefem.scene.bodies import Hanger, Wheels, body_faults, missing_wire_faults
from cablefem.scene.cable import STEEPEST, Damping, Rope
from cablefem.scene.described import LINES, Described
from cablefem.scene.drive import DriveMode, Driving
from cablefem.scene.errors import NOT_MODELLED, SceneError, did_you_mean, short_text
from cablefem.scene.fields import (
    Admits,
    NonNegative,
    Pair,
    Part,
    Positive,
    Real,
    Switch,
    Word,
    described_field,
    integer_between,
    list_of_tables_like,
)
from cablefem.scene.surroundings import Ground, Obstacles, obstacle_faults
from cablefem.scene.travel import Travel

OWNED = {"tension": "counterweight", "stiffness": "spring", "shoe": "saddle"}  # of one kind of contact
ONE_SPAN = "it belongs to one span between two anchors; a line has [[contact]] and [[car]] instead"
MAX_POSITIONS = 10_000  # positions of the cars


class EvenPositions(Part):
    """So many positions between two, both included."""

    first: Real = Field(alias="from")
    last: Real = Field(alias="to")
    count: Annotated[int, integer_between(2, MAX_POSITIONS)]


def _listed_or_even_positions(value: Any) -> Any:
    if isinstance(value, dict):
        positions = EvenPositions(**value)
        return np.linspace(positions.first, positions.last, positions.count).tolist()
    return value if isinstance(value, list | tuple) else [value]


Positions = Annotated[
    tuple[Real, ...], Field(min_length=1, max_length=MAX_POSITIONS, strict=False),
    BeforeValidator(_listed_or_even_positions),
    Admits(f"a number, a list of numbers, or {{from, to, count}} with a count from 2 to {MAX_POSITIONS}"),
]  # fmt: skip


class Contact(Part):
    """What holds the rope at one point."""

    not_modelled: ClassVar = NOT_MODELLED | {"friction": "the rope runs over a saddle without friction"}
    name: Word = described_field("[-] its name in the results")
    kind: Literal["anchor", "spring", "saddle", "counterweight"] = described_field("[-] kind of the contact")
    at: Pair = described_field("[m] x and depth; of a spring: without load")
    tension: Positive | None = described_field("[N] of a counterweight", None)
    stiffness: Annotated[tuple[Positive, Positive], Admits("two numbers > 0 in brackets", strict=False)] | None = (
        described_field("[N/m] of a spring along x and down", None)
    )
    shoe: Positive | None = described_field(
        "[m] to either side of a saddle: a car within rests on it, or runs over it along curves y(x) of degree five, "
        "which have slope and curvature of its path on the rope at both ends",
        None,
    )

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults between fields, one line each."""
        faults = []
        for key, owner in OWNED.items():
            missing = written_values.get(key) is None
            if not missing and self.kind not in (None, owner):
                written = f"{key} = {short_text(written_values[key])}"
                faults.append(f"{written}: only a {owner} has it; this is kind = {self.kind!r}")
            elif missing and self.kind == owner and key != "shoe":
                faults.append(f"{key}: missing; must be given for a {owner}")
        return faults


class Car(Part):
    """A load on the rope, at one or more positions, or in motion."""

    name: Word = described_field("[-] its name in the results")
    mass: Positive = described_field("[kg]")
    hauled: Switch | None = described_field(
        "[-] at rest: true: it rolls, and a haul rope holds it; false: it grips the rope", None
    )
    at: Positions | None = described_field(
        "[m] x at rest, one for each position; those in between over an obstacle or a top of the ground are added; "
        "without it a single car is where its numbers are extreme", None,
        json_schema_extra={"type": ["number", "array", "object"]},
    )  # fmt: skip
    travel: Travel | None = described_field("[-] in motion: its timetable", None)
    drive: Driving | None = described_field("[-] in motion: what moves it; without it the car grips", None)
    below: NonNegative = described_field("[m] from the rope down to the lowest point of the car", 0.0)
    hanger: Hanger | None = described_field("[-] in motion: a part of the mass that swings below the rope", None)
    wheels: Wheels | None = described_field(
        "[-] in motion: wheels; travel, start and brakes are of the front one of two", None
    )

    @property
    def moves(self) -> bool:
        return self.at is None and self.hauled is None

    @property
    def x_at_rest(self) -> tuple[float, ...]:
        """x [m] of each position of a car at rest; none of a car in motion."""
        return self.at or ()

    @property
    def motion_or_position_text(self) -> str:
        """What moves it, or where it is at rest, in words."""
        if self.moves:
            return "rolls freely" if self.travel is None else f"{self.mode}, {self.travel.kind}"
        positions = self.x_at_rest
        if not positions:
            return "at rest where each number is extreme"
        if len(positions) == 1:
            return f"at rest at x = {positions[0]:.6g} m"
        return f"at rest at {len(positions)} positions, x = {min(positions):.6g} to {max(positions):.6g} m"

    @property
    def mode(self) -> DriveMode:
        return "grip" if self.drive is None else self.drive.mode

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults between fields, one line each."""
        at_rest = written_values.get("at") is not None
        hauled_given = written_values.get("hauled") is not None
        present = [name for name in ("travel", "drive", "hanger", "wheels") if written_values.get(name) is not None]
        if at_rest and present:
            return [f"{' and '.join(present)}: too much beside at, of a car at rest"]
        if not present:
            if hauled_given:
                return []
            missing = "hauled: missing; must be true or false for a car at rest"
            return [missing if at_rest else f"{missing}; one in motion has travel or drive"]
        if hauled_given:
            return [f"hauled: of a car at rest, which has no {' and no '.join(present)}; in motion drive.mode says it"]
        return self._faults_in_motion(present)

    def _faults_in_motion(self, present: Sequence[str]) -> list[str]:
        """Faults of a car in motion; present : what is written of its travel, drive and bodies."""
        if "drive" in present and self.drive is None:
            return []  # its own faults are reported
        if (self.mode == "free") is ("travel" in present):
            return ["travel: must be given for a car that grips or is hauled, and for no other"]
        return body_faults(self.mass, self.hanger, self.wheels, self.drive)


class TensionAtContact(Part):
    """Tension of the empty line at a contact."""

    at: Word = described_field("[-] name of the contact")
    value: Positive = described_field("[N] tension of the empty line there")


class LineRope(Rope):
    """The rope of a line; with two fixed ends it needs `length` or `tension`."""

    mass_per_length: Positive = described_field("[kg/m] mass of the rope per unstretched length")
    EA: Positive = described_field(
        "[N] axial stiffness per strain of the unstretched rope; of the stretched at rest: EA + T; default E section"
    )
    length: Positive | None = described_field("[m] unstretched length between two fixed ends", None)
    tension: TensionAtContact | None = described_field("[N] tension of the empty line at a contact", None)
    damping: Damping | None = described_field(
        "[-] in motion: its `rate`, 4 pi times a frequency (`cablefem modes`) times that mode's ratio of critical", None
    )


@dataclass(frozen=True, slots=True)
class Station:
    """A contact or a car; nan: unknown coordinate."""

    name: str
    kind: str  # or "grips", "hauled"
    x: float
    y: float
    force: float = 0.0  # [N] of a counterweight; weight of a car
    stiffness: tuple[float, float] | None = None

    @property
    def is_car(self) -> bool:
        return self.kind in ("grips", "hauled")


@dataclass(frozen=True, slots=True)
class Case:
    """A line at rest to be solved: stations from left to right."""

    stations: tuple[Station, ...]
    weight: float  # [N/m] per s
    EA: float  # [N]
    thermal_stretch: float = 1.0  # 1 + a dT
    length: float | None = None  # s of a fixed right end
    prescribed_tension: tuple[int, float] | None = None  # station and tension [N] that fix an unknown length

    @property
    def points_or_nan(self) -> np.ndarray:
        """Points of the stations (n, 2) [m], nan where unknown."""
        return np.array([[np.nan, np.nan] if p.kind == "spring" else [p.x, p.y] for p in self.stations])

    @property
    def s_or_nan(self) -> np.ndarray:
        """s of the stations (n,) [m], nan where unknown; without a length it starts where no pulley moves."""
        s = np.full(len(self.stations), np.nan)
        left, right = (self.stations[i].kind != "counterweight" for i in (0, -1))
        if left:
            s[0] = 0.0
        if right and (self.length is not None or not left):
            s[-1] = self.length or 0.0
        return s


@dataclass(frozen=True, slots=True)
class LineState:
    """A line at rest with n stations. Forces are N t, towards growing s."""

    case: Case
    s: np.ndarray  # (n,) [m]
    points: np.ndarray  # (n, 2) [m]
    behind: np.ndarray  # (n, 2) [N]; nan at the left end
    ahead: np.ndarray  # (n, 2) [N]; nan at the right end
    haul: np.ndarray  # (n,) [N] F of hauled cars, positive to the right; else nan
    middle: np.ndarray  # (n - 1, 2) [m] points halfway along the pieces

    def station_index(self, name: str) -> int:
        """Index of the station of a contact or car."""
        return [station.name for station in self.case.stations].index(name)

    @property
    def station_tensions(self) -> np.ndarray:
        """(n, 2) [N], behind and ahead of each station; nan beyond the rope."""
        return np.stack([np.linalg.norm(self.behind, axis=1), np.linalg.norm(self.ahead, axis=1)], axis=1)

    @property
    def rope_force_on_stations(self) -> np.ndarray:
        """Force of the rope on the inner stations (n, 2) [N]; nan at the ends."""
        return self.ahead - self.behind


class NoLineAtRest(ArithmeticError):
    """No state of rest was found, or none exists."""


class LineNotConverged(NoLineAtRest):
    """Newton's method did not converge."""


Solver = Callable[[Sequence[Case]], "list[LineState | NoLineAtRest]"]


def needed_counterweight_text(cases: Sequence[Case], solve: Solver) -> str:
    """What a counterweight must be for all cases to have a rest, as an end of a sentence; "" where that is unknown.

    A rope that hangs from a pulley has no rest below a smallest force: the more it sags, the more its own weight
    pulls off the pulley. Level and empty that force is 0.754 times span and weight per length. The one that is named
    was tried, and is at most 2 % above the smallest.
    """
    weight = next((p for case in cases for p in case.stations if p.kind == "counterweight"), None)
    if weight is None:
        return ""

    def without_rest(force: float, cases: Sequence[Case]) -> list[Case]:
        heavier = [replace(case, stations=_with_counterweight(case.stations, force)) for case in cases]
        return [case for case, x in zip(cases, solve(heavier), strict=True) if isinstance(x, NoLineAtRest)]

    force = weight.force
    while waiting := without_rest(force, cases):
        case = waiting[len(waiting) // 2]
        high = 2.0 * force
        while without_rest(high, [case]):
            high *= 2.0
            if high > case.EA:
                return ""
        smallest = bisect_zero(lambda force: 0.5 - len(without_rest(force, [case])), force, high, 0.008 * force)  # noqa: B023
        force = float(f"{1.006 * smallest:.3g}")  # not rounded down
    return f"; {weight.name} must hold it with at least {force:.6g} N" if force > weight.force else ""


def _with_counterweight(stations: Sequence[Station], force: float) -> tuple[Station, ...]:
    return tuple(replace(p, force=force) if p.kind == "counterweight" else p for p in stations)


@dataclass(frozen=True)
class LineRest:
    """A line at rest at all positions of its cars."""

    line: Line
    empty: LineState  # reference temperature, no ice
    positions: list[LineState | NoLineAtRest]
    # by position and car on a shoe: the line with that car on the rope at either end of the shoe
    shoe_ends: dict[tuple[int, str], tuple[LineState, LineState]]

    @cached_property
    def states(self) -> dict[int, LineState]:
        """States of the positions that have a rest."""
        return {i: x for i, x in enumerate(self.positions) if isinstance(x, LineState)}

    @property
    def refused(self) -> dict[int, NoLineAtRest]:
        """Reasons of the positions that have no rest."""
        return {i: x for i, x in enumerate(self.positions) if isinstance(x, NoLineAtRest)}

    def needed_counterweight_text(self, solve: Solver) -> str:
        """What a counterweight must be for all positions to have a rest; see `needed_counterweight_text`."""
        length = self.line.s_of_fixed_right_end(self.empty)
        return needed_counterweight_text([self.line.case_at_position(i, length) for i in self.refused], solve)


class Line(Described):
    """A rope over several contacts, and the positions of cars on it."""

    built_in: ClassVar[Sequence[str]] = LINES
    not_modelled: ClassVar = (
        NOT_MODELLED
        | dict.fromkeys(("supports", "mass", "travel", "drive"), ONE_SPAN)
        | {"wind": "[wind] across belongs to one span in motion; along a line, drive.wind blows on a car in motion"}
    )

    cable: LineRope
    contact: Annotated[tuple[Contact, ...], list_of_tables_like("[[contact]]")]
    car: Annotated[tuple[Car, ...], list_of_tables_like("[[car]]")] = described_field("[-] cars from left to right", ())
    obstacle: Obstacles = ()
    ground: Ground = ()

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults between fields, one line each."""
        rope = self.cable
        contacts = self.contact
        cars = self.car
        if None in (rope, contacts, cars):
            return []
        names = [*(c.name for c in contacts), *(c.name for c in cars)]
        faults = _contact_faults(contacts) + _repeated_name_faults(names)
        if faults:
            return faults
        faults = _length_or_tension_faults(rope, contacts) + _car_faults(cars, contacts)
        faults += [fault for car in cars for fault in missing_wire_faults(rope.wire, car.wheels)]
        return faults + obstacle_faults(self.obstacle or (), contacts[-1].at[0])

    @property
    def notes(self) -> list[str]:
        """Remarks on values probably mistaken."""
        return self.cable.notes

    def __str__(self) -> str:
        rope = self.cable
        length = "" if rope.length is None else f", {rope.length:.6g} m unstretched"
        tension = "" if rope.tension is None else f", empty {rope.tension.value:.4g} N at {rope.tension.at}"
        lines = [
            self._headline,
            f"  cable         {rope.mass_per_length:.4g} kg/m, EA = {rope.EA:.4g} N{length}{tension}",
        ]
        for contact in self.contact:
            x, y = contact.at
            pulls = "" if contact.tension is None else f", {contact.tension:.4g} N"
            lines.append(f"  {contact.kind:<13} {contact.name} at x = {x:.6g} m, depth {y:.6g} m{pulls}")
        for car in self.car:
            lines.append(f"  car           {car.name}, {car.mass:.5g} kg, {car.motion_or_position_text}")
        return "\n".join(lines)

    @property
    def position_count(self) -> int:
        """Number of positions of the cars."""
        return max((len(car.x_at_rest) for car in self.car), default=1)

    def _toml_tables(self, replaced_keys: Container[str] = ()) -> dict[str, Any]:
        data = super()._toml_tables(replaced_keys)
        for table, car in zip(data.get("car", ()), self.car, strict=True):
            if car.travel is not None:
                table["travel"]["kind"] = car.travel.kind
        for new, old in (("length", "tension"), ("tension", "length")):
            if f"cable.{new}" in replaced_keys:
                data["cable"].pop(old, None)
        return data

    @property
    def moves(self) -> bool:
        return any(car.moves for car in self.car)

    def position_of(self, car: Car, i: int) -> float:
        """x [m] of a car at position i."""
        assert car.at is not None
        return car.at[i] if len(car.at) > 1 else car.at[0]

    place = position_of  # its name in 0.3.0

    def saddle_with_shoe_at(self, x: float) -> Contact | None:
        """Saddle on whose shoe a car at x [m] rests."""
        return next((c for c in self.contact if c.shoe is not None and abs(x - c.at[0]) <= c.shoe), None)

    def empty_line_case(self, length: float | None) -> Case:
        """The empty rope at the reference temperature, without ice; with the tension that is given for it."""
        stations = self._contact_stations()
        rope = self.cable
        prescribed = None
        if rope.tension is not None:
            prescribed = [p.name for p in stations].index(rope.tension.at), rope.tension.value
        weight = rope.mass_per_length * self.gravity
        return Case(tuple(stations), weight, rope.EA, length=length, prescribed_tension=prescribed)

    def case_at_position(self, i: int, length: float | None, car_on_rope_at_x: tuple[str, float] | None = None) -> Case:
        """The rope with the cars at their position i.

        car_on_rope_at_x : name and x [m] of a car that hangs on the rope there, even within a shoe.
        """
        stations = self._contact_stations()
        rope = self.cable
        positions = {car.name: self.position_of(car, i) for car in self._cars_off_shoes(i)}
        if car_on_rope_at_x:
            name, x = car_on_rope_at_x
            positions[name] = x
        for car in self.car:
            if car.name in positions:
                kind = "hauled" if car.hauled else "grips"
                stations.append(Station(car.name, kind, positions[car.name], math.nan, car.mass * self.gravity))
        stations.sort(key=lambda p: p.x)
        weight = (rope.mass_per_length + rope.ice_mass_per_length) * self.gravity
        return Case(tuple(stations), weight, rope.EA, 1.0 + rope.thermal_strain, length)

    def _contact_stations(self) -> list[Station]:
        return [Station(c.name, c.kind, *c.at, force=c.tension or 0.0, stiffness=c.stiffness) for c in self.contact]

    def _cars_off_shoes(self, i: int) -> list[Car]:
        """Cars that hang on the rope at position i."""
        return [car for car in self.car if self.saddle_with_shoe_at(self.position_of(car, i)) is None]

    def _saddles_under_cars(self, positions: Sequence[int]) -> dict[tuple[int, str], Contact]:
        """The saddle by position and car on its shoe."""
        saddles = {
            (i, car.name): self.saddle_with_shoe_at(self.position_of(car, i)) for i in positions for car in self.car
        }
        return {key: saddle for key, saddle in saddles.items() if saddle is not None}

    def solve_empty_line(self, solve: Solver) -> LineState:
        """The line without cars, ice and heat, s from its left end; SceneError where it has no rest."""
        rope = self.cable
        case = self.empty_line_case(rope.length)
        result = solve([case])[0]
        if isinstance(result, NoLineAtRest):
            held = (
                f" with cable.tension.value = {rope.tension.value:.6g} N at {rope.tension.at}" if rope.tension else ""
            )
            held = held if isinstance(result, LineNotConverged) else ""
            raise SceneError([f"the empty line: {result}{held}{needed_counterweight_text([case], solve)}"])
        state = _refused_if_unsound(result)
        if isinstance(state, NoLineAtRest):
            raise SceneError([f"the empty line: {state}"])
        return replace(state, s=state.s - state.s[0])

    def fault_in_own_keys(self, fault: str) -> str:
        """A fault in the keys of the file that the line comes from."""
        return fault

    def s_of_fixed_right_end(self, empty: LineState) -> float | None:
        """s [m] of a fixed right end; None at a counterweight."""
        if self.contact[-1].kind == "counterweight":
            return None
        return self.cable.length or float(empty.s[-1])

    def solve_at_rest(self, solve: Solver, refused: Mapping[int, NoLineAtRest] | None = None) -> LineRest:
        """Solve all positions; SceneError where the empty line has no rest.

        refused : positions that are not tried again, with the reason.
        """
        if self.moves:
            raise SceneError([f"car.{self.car[0].name}: in motion; at must be given for a line at rest"])
        refused = refused or {}
        empty = self.solve_empty_line(solve)
        length = self.s_of_fixed_right_end(empty)
        tried = [i for i in range(self.position_count) if i not in refused]
        on_shoes = self._saddles_under_cars(tried)
        cases = [self.case_at_position(i, length) for i in tried]
        for (i, name), saddle in on_shoes.items():
            x = saddle.at[0]
            shoe = saddle.shoe or 0.0
            cases += [self.case_at_position(i, length, (name, end)) for end in (x - shoe, x + shoe)]
        states = list(map(_refused_if_unsound, solve(cases) if cases else []))
        at_ends = states[len(tried) :]
        pairs = zip(at_ends[::2], at_ends[1::2], strict=True)
        shoe_ends = dict(zip(on_shoes, pairs, strict=True))
        positions: dict[int, LineState | NoLineAtRest] = dict(refused)
        for i, state in zip(tried, states[: len(tried)], strict=True):
            positions[i] = self._with_loads_in_reason(state, i)
        positions |= _refused_on_shoes(positions, on_shoes, shoe_ends)
        in_order = [positions[i] for i in range(self.position_count)]
        return LineRest(self, empty, in_order, _shoes_solved_at_both_ends(shoe_ends))

    def _with_loads_in_reason(self, state: LineState | NoLineAtRest, i: int) -> LineState | NoLineAtRest:
        """Add to a search without result what the rope has to carry at position i, and what holds it."""
        if not isinstance(state, LineNotConverged):
            return state
        weight = sum(car.mass for car in self._cars_off_shoes(i)) * self.gravity
        weights = [c for c in self.contact if c.tension is not None]
        holds = f"{weights[0].name} holds it with {weights[0].tension:.6g} N" if weights else "both ends are fixed"
        return LineNotConverged(f"{state} with {weight:.6g} N of cars on the rope; {holds}")


def _refused_if_unsound(state: LineState | NoLineAtRest) -> LineState | NoLineAtRest:
    """The state, or why it is refused: numbers that are not finite, or a rope that pulls a saddle up."""
    if isinstance(state, NoLineAtRest):
        return state
    if not all(np.isfinite(x).all() for x in (state.s, state.points, state.behind[1:], state.ahead[:-1])):
        return LineNotConverged("no state of rest was found")
    for p, down in zip(state.case.stations, state.rope_force_on_stations[:, 1], strict=True):
        if p.kind == "saddle" and not down > 0.0:
            return NoLineAtRest(f"the rope lifts off {p.name}; kept on it, it would pull up with {-down:.6g} N")
    return state


Ends = dict[tuple[int, str], tuple[LineState | NoLineAtRest, LineState | NoLineAtRest]]  # by position and car on a shoe


def _shoes_solved_at_both_ends(shoe_ends: Ends) -> dict[tuple[int, str], tuple[LineState, LineState]]:
    """The shoes with a state of rest at both ends."""
    sound = {}
    for key, (left, right) in shoe_ends.items():
        if isinstance(left, LineState) and isinstance(right, LineState):
            sound[key] = left, right
    return sound


def _refused_on_shoes(
    positions: Mapping[int, LineState | NoLineAtRest], on_shoes: Mapping[tuple[int, str], Contact], shoe_ends: Ends
) -> dict[int, NoLineAtRest]:
    """Reasons of positions with a car that does not come onto its shoe, or with two cars on one shoe."""
    refused: dict[int, NoLineAtRest] = {}
    occupied = set()
    for (i, name), ends in shoe_ends.items():
        saddle = on_shoes[i, name].name
        why = next((end for end in ends if isinstance(end, NoLineAtRest)), None)
        if why is not None and i not in refused and isinstance(positions[i], LineState):
            refused[i] = NoLineAtRest(f"{name} does not come onto the shoe of {saddle}: {why}")
        if (i, saddle) in occupied:
            refused[i] = NoLineAtRest(f"two cars on the shoe of {saddle}")
        occupied.add((i, saddle))
    return refused


def _repeated_name_faults(names: Sequence[str]) -> list[str]:
    twice = sorted({x for x in names if names.count(x) > 1})
    return [f"name = {x!r}: given twice; names must differ" for x in twice]


def _contact_faults(contacts: Sequence[Contact]) -> list[str]:
    """Faults of the order, steepness and kinds of contacts."""
    if len(contacts) < 2:
        return ["contact: must be at least two, the ends of the rope"]
    if contacts[0].at != (0.0, 0.0):
        return [
            f"contact[0].at = {short_text(list(contacts[0].at))}: must be [0, 0]; places count from the first contact"
        ]
    faults = []
    for i, (a, b) in enumerate(itertools.pairwise(contacts), start=1):
        run = b.at[0] - a.at[0]
        drop = b.at[1] - a.at[1]
        where = f"contact[{i}].at = {short_text(list(b.at))}"
        if run <= 0.0:
            faults.append(f"{where}: x must be > {a.at[0]:.6g} m, that of {a.name}")
        elif abs(drop) > STEEPEST * run:
            faults.append(f"{where}: must be less steep than {STEEPEST:g} m per m from {a.name}")
    faults += _outer_and_inner_contact_kind_faults([contact.kind for contact in contacts])
    if [c.kind for c in contacts].count("counterweight") > 1:
        faults.append("contact: two counterweights; at most one, or the rope would run from one to the other")
    return faults


def _outer_and_inner_contact_kind_faults(kinds: Sequence[str]) -> list[str]:
    """Faults of ends that are saddles, and of others that are none."""
    faults = []
    for i, kind in enumerate(kinds):
        inner = 0 < i < len(kinds) - 1
        if inner is not (kind == "saddle"):
            ends = "an end must be an anchor, a spring or a counterweight"
            must = "between the ends it must be a saddle" if inner else ends
            faults.append(f"contact[{i}].kind = {kind!r}: {must}")
    return faults


def _length_or_tension_faults(rope: LineRope, contacts: Sequence[Contact]) -> list[str]:
    """Fault unless the rope has what its contacts leave open: a length, a tension, or neither."""
    present = [name for name in ("length", "tension") if getattr(rope, name) is not None]
    if any(c.kind == "counterweight" for c in contacts):
        return [f"cable.{name}: too much beside a counterweight, which sets the tension" for name in present]
    if len(present) != 1:
        return [f"cable.{'length' if not present else present[1]}: exactly one of length, tension must be given"]
    names = [c.name for c in contacts]
    if rope.tension is not None and rope.tension.at not in names:
        return [f"cable.tension.at = {rope.tension.at!r}: no such contact.{did_you_mean(rope.tension.at, names)}"]
    return []


def _car_faults(cars: Sequence[Car], contacts: Sequence[Contact]) -> list[str]:
    moving = [car.name for car in cars if car.moves]
    placed = [car for car in cars if car.at is not None]
    anywhere = [car.name for car in cars if not (car.moves or car.at)]
    if anywhere:
        return _faults_of_car_without_position(anywhere[0], len(cars), contacts)
    if moving and placed:
        return [f"car.{moving[0]}: in motion beside cars at rest; all must have at, or none"]
    return _position_faults(placed, contacts)


def _position_faults(placed: Sequence[Car], contacts: Sequence[Contact]) -> list[str]:
    """Faults of cars at rest at given positions."""
    counts = sorted({len(car.x_at_rest) for car in placed} - {1})
    if len(counts) > 1:
        lists = f"lists of {counts[0]} and of {counts[-1]} positions"
        return [f"car.at: {lists}; must be one number or lists of one length"]
    faults = []
    for car in placed:
        faults += _off_line_and_missing_shoe_faults(car, contacts)
    for a, b in itertools.pairwise(placed):
        faults += _order_faults(a, b)
    return faults + _overlapping_shoe_faults(contacts)


def _faults_of_car_without_position(name: str, car_count: int, contacts: Sequence[Contact]) -> list[str]:
    """Faults of a car without `at`, one of so many: it passes every saddle."""
    if car_count > 1:
        return [f"car.{name}.at: missing; must be given for each of several cars"]
    return _missing_shoe_faults(name, contacts[1:-1]) + _overlapping_shoe_faults(contacts)


def _missing_shoe_faults(name: str, passed: Sequence[Contact]) -> list[str]:
    """Faults of saddles without shoe that a car passes."""
    missing = [c.name for c in passed if c.shoe is None]
    return [f"contact.{x}.shoe: missing; must be given where a car passes, here {name}" for x in missing]


def _off_line_and_missing_shoe_faults(car: Car, contacts: Sequence[Contact]) -> list[str]:
    """Faults of positions off the line, and of saddles without shoe that a car passes."""
    low = min(car.x_at_rest)
    high = max(car.x_at_rest)
    end = contacts[-1].at[0]
    faults = []
    if not 0.0 < low <= high < end:
        faults.append(f"car.{car.name}.at: from {low:.6g} to {high:.6g} m; must be > 0 and < {end:.6g} m")
    return faults + _missing_shoe_faults(car.name, [c for c in contacts[1:-1] if low <= c.at[0] <= high])


def _order_faults(a: Car, b: Car) -> list[str]:
    """Fault at the first position where car b is not to the right of car a."""
    for i, (x, y) in enumerate(np.broadcast(a.x_at_rest, b.x_at_rest), start=1):
        if not x < y:
            must = f"must be > {x:.6g} m, that of {a.name}; cars are listed from left to right and cannot pass"
            return [f"car.{b.name}.at = {y:.6g} m at position {i}: {must}"]
    return []


def _overlapping_shoe_faults(contacts: Sequence[Contact]) -> list[str]:
    faults = []
    for left, right in itertools.pairwise(contacts):
        if (left.shoe or 0.0) + (right.shoe or 0.0) >= right.at[0] - left.at[0]:
            one, other = (right, left) if right.shoe else (left, right)
            faults.append(f"contact.{one.name}.shoe: reaches {other.name}; must be shorter")
    return faults
