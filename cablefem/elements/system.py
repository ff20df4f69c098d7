"""A line in motion on elements, for the time driver: its start, cars that stick and slip, and its events."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cablefem.elements.bodies import CarLoadsAndMasses, forces_on_cars, vector_length
from cablefem.elements.line_balance import LineBalance, RopeAndCars
from cablefem.elements.line_coordinates import Coordinates
from cablefem.elements.line_observe import observe_line
from cablefem.motion import LineMotion
from cablefem.newmark import (
    Array,
    MarchingSystem,
    State,
    StepFailure,
    StepsWithFactors,
    consistent_acceleration,
)
from cablefem.scene.contacts import (
    AT_REST,
    NEAREST,
    Car,
    Contact,
    MovingLine,
    Wheel,
    lift_off_event_name,
    meeting_event_name,
)
from cablefem.shoes import Passage, car_may_pass_saddle, possible_passages

SHIFT = 1e-4  # [s] for velocities through states of rest


class LineElements(LineBalance, MarchingSystem):
    """A rope over contacts with cars; `elements` of `degree` on each segment.

    compiled : loops of `segment_kernels` in the place of numpy.
    Events end the run: "A meets B" and "CAR reaches SUPPORT" at NEAREST; "CAR lifts off" where the rope would have to
    hold it down; "rope falls slack" and "rope lifts off SADDLE"; AT_REST.
    The run goes on after "CAR brakes" and "CAR stops", where friction may hold it until "CAR breaks loose".
    """

    def __init__(self, line: MovingLine, *, elements: int = 6, degree: int = 4, compiled: bool = True) -> None:
        super().__init__(line, elements, degree, compiled)
        MarchingSystem.__init__(self)
        self.many_steps = compiled and not line.cars_off_rope
        self._set_event_watchers()
        self.events = tuple(self._event_names())

    def _set_event_watchers(self) -> None:
        """Set what the events watch."""
        line = self.line
        contacts = line.contacts_and_wheels
        self.passages = possible_passages(line)
        self._gaps = [k for k in range(len(contacts) - 1) if self._may_meet(contacts[k], contacts[k + 1])]
        self._stops: list[int] = []  # cars that friction or brakes may stop
        self._brakes: list[tuple[int, float]] = []  # a car, and where one of its brakes begins
        self._pressing: list[int] = []  # the car of each wheel or point that may lift off
        for i, car in enumerate(line.cars_on_rope):
            self._pressing += [i] if car.wheels is None else [i, i]
            if i in self.free_cars and car.drive.has_friction_or_brakes:
                self._stops.append(i)
                self._brakes += [(i, position) for position, _ in car.drive.brakes]

    def _event_names(self) -> list[str]:
        """In the order of `event_values`."""
        contacts = self.line.contacts_and_wheels
        cars = [car.name for car in self.line.cars_on_rope]
        names = [meeting_event_name(contacts[k], contacts[k + 1]) for k in self._gaps]
        names += [f"{cars[i]} stops" for i in self._stops]
        names += [f"{cars[i]} brakes" for i, _ in self._brakes]
        names += [lift_off_event_name(c) for c in contacts if not isinstance(c, Contact)]
        names += ["rope falls slack"]
        names += [f"rope lifts off {c.name}" for c in self.line.supports[1:-1]]
        names += [f"{cars[i]} breaks loose" for i in self._stops]
        names += [AT_REST]
        return names + [str(p) for p in self.passages]

    def _may_meet(self, first: Contact | Car | Wheel, second: Contact | Car | Wheel) -> bool:
        """Whether two neighbours may meet: one of them is a car, and neither passes the other over a shoe."""
        if isinstance(first, Contact) and isinstance(second, Contact):
            return False
        one, other = (c.car.name if isinstance(c, Wheel) else c.name for c in (first, second))
        return one != other and not car_may_pass_saddle(self.passages, one, other)

    # --- start ---------------------------------------------------------------------------------------------
    def start(self, phase: int, state: State | None) -> State:
        """At rest with the cars held; prescribed cars move through states of rest with the first speed of theirs."""
        t = self.phases[phase][0]
        self.set_travel_directions(phase)
        if state is not None:
            return consistent_acceleration(self, t, state.q, state.v, phase)
        from cablefem.elements.rest import car_loads_at_rest, coordinates_at_rest, resting_coordinates_with_forces

        q = coordinates_at_rest(self, t, phase)
        v = np.zeros(self.size)
        if self.prescribed_coordinates(t, phase)[1].any():
            before = coordinates_at_rest(self, t, phase, -SHIFT, q)
            after = coordinates_at_rest(self, t, phase, SHIFT, q)
            v = (after - before) / (2.0 * SHIFT)
        at_rest = resting_coordinates_with_forces(self, q)
        if self.car_contacts:
            self._release_free_cars(t, phase, at_rest, car_loads_at_rest(self, t, phase))
        self._refuse_slack_rope(t, self.balance_rows(t, at_rest, phase))
        q[self.force] = 0.0
        v[self.force] = 0.0
        return consistent_acceleration(self, t, q[self.free], v[self.free], phase)

    def _refuse_slack_rope(self, t: float, rows: Array) -> None:
        """Raise StepFailure where the rope at rest is slack or lifts off a saddle; rows : of the last balance."""
        slack, *pressures = self._min_tension_and_saddle_pressures(rows, self.loads[0])
        if min(slack, *pressures, 0.0) < 0.0:
            cause = f"at rest the smallest tension is {slack:.6g} N and the smallest pressure on a saddle"
            cause = f"{cause} {min(pressures, default=0.0):.6g} N"
            raise StepFailure(t, cause, "tighten the rope or lower its saddles")

    def set_travel_directions(self, phase: int) -> None:
        """Set the directions of prescribed cars."""
        self._steady_cars = None
        for i, car in enumerate(self.line.cars_on_rope):
            if car.travel:
                self.signs[i] = self.line.travel_direction(car, phase)

    def _release_free_cars(self, t: float, phase: int, x: Coordinates, held: CarLoadsAndMasses) -> None:
        """Let free cars go; they must move against friction."""
        slots = self.s[self.car_contacts]
        y = self.slopes_and_motion_at_cars(x)
        forces = forces_on_cars(held, y)
        stretch = forces.stretch
        rows = self.balance_rows(t, x, phase, RopeAndCars(self.law, held))
        self.hold = rows[slots] / stretch
        for i in self.free_cars:
            self._set_brakes(i, x.q[slots[i]])
        now = self.car_loads_and_masses(t, phase)
        rows = self.balance_rows(t, x, phase, RopeAndCars(self.law, now))
        pressing = np.abs(self._pressing_forces(x, rows, self.loads[0], now))
        loads = np.bincount(self._pressing, pressing)
        none = np.zeros_like(now.hold)
        frictionless = now._replace(hold=none, brake=none, friction=none)
        rows = self.balance_rows(t, x, phase, RopeAndCars(self.law, frictionless))
        needed = rows[slots] / stretch
        behind = y[:, 0:2]
        cos_phi = np.sum(behind * forces.tau, axis=1) / vector_length(behind)
        thrust_angles = [car.drive.thrust_angle for car in self.line.cars_on_rope]
        needed -= now.thrust * np.cos(thrust_angles) / cos_phi
        for i in self.free_cars:
            self.signs[i] = -np.sign(needed[i]) or 1.0
            car = self.line.cars_on_rope[i]
            holding = car.drive.mu_r * loads[i] + self.brakes[i]
            if car.drive.has_friction_or_brakes and abs(needed[i]) <= holding:
                cause = f"friction or brakes hold {car.name} where it begins"
                raise StepFailure(t, cause, "begin on steeper rope, or with less of both")

    # --- cars that stick and slip ------------------------------------------------------------------------------
    def begin_step(self, x: State) -> None:
        """Keep the direction of friction, and the brakes that act, for one step."""
        if not self._stops:
            return
        z = self.coordinates_from_unknowns(*x)
        for i in self._stops:
            slot = self.slot_of_s(i)
            self.signs[i] = np.sign(z.v[slot]) or self.signs[i]
            self._set_brakes(i, z.q[slot])

    def _time_at_rest(self, phase: int) -> float:
        """When all free cars, which friction holds, are at rest; inf where it does not hold them, or there are none."""
        if not self.free_cars or not all(self._sticks(i) for i in self.free_cars):
            return math.inf
        return self.line.time_at_rest(float(self.held_since[self.free_cars].max()), phase)

    def _sticks(self, i: int) -> bool:
        """Whether friction holds car i."""
        return bool(self.signs[i] == 0.0)

    @property
    def sticking_unknowns(self) -> list[int]:
        """Numbers among the unknowns of s of cars that friction holds on the rope."""
        return [self._travel_unknown(i) for i in self._stops if self._sticks(i)]

    def _travel_unknown(self, i: int) -> int:
        """Number of s of the free car i among the unknowns."""
        return int(np.searchsorted(self._unknown, self.slot_of_s(i)))

    def _set_brakes(self, i: int, s: float) -> None:
        """Set the brakes of car i at s."""
        self.reached[i] = s
        drive = self.line.cars_on_rope[i].drive
        self.brakes[i] = drive.brake_force(s)
        self.rear_brakes[i] = drive.rear_brake_force(s)

    def _stop_or_slip_on(self, i: int, x: State) -> State:
        """Car i sticks, or slips if friction and brakes cannot hold it."""
        self.signs[i] = 0.0
        self.held_since[i] = x.t
        after = self._state_with_slip(i, x, 0.0)
        margin = self.event_values(after)[self.events.index(f"{self.line.cars_on_rope[i].name} breaks loose")]
        return after if margin > 0.0 else self._start_slipping(i, after)

    def _start_slipping(self, i: int, x: State) -> State:
        """Car i, which sticks, slips against the force that has held it."""
        z = self.coordinates_from_unknowns(*x)
        rows = self.balance_rows(x.t, z, x.phase)
        self.signs[i] = -np.sign(self._holding_force(i, z, rows)) or 1.0
        return self._state_with_slip(i, x, self.signs[i] * 1e-12)  # a first slip arms the event of a standstill

    def _state_with_slip(self, i: int, x: State, ds: float) -> State:
        """The state where car i slips with ds."""
        v = x.v.copy()
        v[self._travel_unknown(i)] = ds
        return consistent_acceleration(self, x.t, x.q, v, x.phase)

    def _holding_force(self, i: int, z: Coordinates, rows: Array) -> Array:
        """Force [N] of friction and brakes along the rope that a car which sticks needs; of two wheels all of it."""
        y = self.slopes_and_motion_at_cars(z)[..., i, :]
        stretch = 0.5 * (vector_length(y[..., 0:2]) + vector_length(y[..., 2:4]))
        return rows[..., self.slot_of_s(i)] / stretch

    def _friction_margin(self, i: int, z: Coordinates, rows: Array, pressing: Array) -> Array:
        """Largest force [N] of friction and brakes less the one that holds car i."""
        load = np.abs(pressing[..., np.equal(self._pressing, i)]).sum(axis=-1)
        largest = self._unloaded_cars.friction[i] * load + self.brakes[i]
        return largest - np.abs(self._holding_force(i, z, rows))

    # --- steps ---------------------------------------------------------------------------------------------
    def take_steps_with_factors(self, phase: int, node_times: Array, march: StepsWithFactors) -> int:
        cars = self.car_loads_and_masses(node_times, phase)
        prescribed = self.prescribed_coordinates(node_times, phase)
        return self._kernel.take_steps_with_factors(self.law, cars, self._unknown, self.moving, prescribed, march)

    def count_ends_before_change(self, q: Array) -> int:
        """Up to the first one from which other brakes act."""
        others = np.zeros(len(q), bool)
        for i in self._stops:
            others |= self.line.cars_on_rope[i].drive.brake_force(q[:, self._travel_unknown(i)]) != self.brakes[i]
        return int(np.argmax(others)) + 1 if others.any() else len(q)

    # --- events --------------------------------------------------------------------------------------------
    def event_values_at(self, t: Any, q: Array, v: Array, a: Array, phase: int) -> Array:
        z = self.coordinates_from_unknowns(t, q, v, a, phase)
        gaps = np.diff(z.q[..., self.s])[..., self._gaps] - NEAREST
        ahead = [z.v[..., self.slot_of_s(i)] * self.signs[i] for i in self._stops]
        sticks = [self._sticks(i) for i in self._stops]
        to_brakes = []
        for i, position in self._brakes:
            away = position - z.q[..., self.slot_of_s(i)]
            to_brakes.append(away if position > self.reached[i] else np.full_like(away, np.inf))
        with np.errstate(all="ignore"):  # contacts that meet
            rows = self.balance_rows(t, z, phase)
            loads = self.loads.reshape(*np.shape(t), self.loads.shape[-1])
            pressing = self._pressing_forces(z, rows, loads, self.car_loads_and_masses(t, phase))
            margins = [self._friction_margin(i, z, rows, pressing) for i in self._stops]
        others = [
            *(np.where(holds, np.inf, x) for holds, x in zip(sticks, ahead, strict=True)),
            *to_brakes,
            *np.moveaxis(pressing, -1, 0),
            *np.moveaxis(self._min_tension_and_saddle_pressures(rows, loads), -1, 0),
            *(np.where(holds, x, np.inf) for holds, x in zip(sticks, margins, strict=True)),
            self._time_at_rest(phase) - np.asarray(t),
            *(self._distance_to_passage(passage, t, z, phase) for passage in self.passages),
        ]
        values = np.stack(others, axis=-1)
        values[gaps.min(axis=-1, initial=np.inf) <= 0.0] = np.inf  # they have no meaning there
        return np.concatenate([gaps, values], axis=-1)

    def _distance_to_passage(self, passage: Passage, t: Any, z: Coordinates, phase: int) -> Array:
        """`Passage.distance_to_go` at t (...)."""
        points = self._car_points_and_rates(passage.car, t, z, phase).reshape(-1, 3, 2)
        distances = [passage.distance_to_go(*of_car[:2, 0].tolist()) for of_car in points]
        return np.reshape(distances, np.shape(t))

    def car_point_and_rates(self, car: str, x: State) -> Array:
        """Point of a car with its rates (3, 2)."""
        return self._car_points_and_rates(car, x.t, self.coordinates_from_unknowns(*x), x.phase)

    def _car_points_and_rates(self, car: str, t: Any, z: Coordinates, phase: int) -> Array:
        """Points of a car with their rates (..., 3, 2) at t (...)."""
        for k, on_rope in zip(self.car_contacts, self.line.cars_on_rope, strict=True):
            if on_rope.name == car:
                return np.stack([x[..., self.xy[k]] for x in z], axis=-2)
        flat = np.array(z).reshape(3, -1, self.size)
        points = self.off_rope[car].points_with_rates(np.ravel(t), flat, phase)
        return points.reshape(*np.shape(t), 3, 2)

    def _pressing_forces(self, x: Coordinates, rows: Array, loads: Array, cars: CarLoadsAndMasses) -> Array:
        """Contact forces [N] of all that may lift off (..., .); `rows` and `loads` are those of x."""
        by_car: dict[int, Any] = {}
        for i, load in zip(self.point_cars, np.moveaxis(loads, -1, 0), strict=False):
            by_car[i] = [load]
        for trolley in self.trolleys:
            inputs = trolley.force_inputs(x, rows[..., trolley.points.ravel()])
            forces = trolley.forces(cars, inputs)
            by_car[trolley.i] = [forces.rear.load, forces.front.load]
        for i, car in enumerate(self.line.cars_on_rope):
            if car.rail is not None:
                by_car[i] = [np.full(rows.shape[:-1], np.inf)]
        pressing = [load for i in range(len(by_car)) for load in by_car[i]]
        return np.stack(pressing, axis=-1) if pressing else rows[..., :0]

    def _min_tension_and_saddle_pressures(self, rows: Array, loads: Array) -> Array:
        """Smallest tension, and pressures of the rope on the saddles [N] (..., .)."""
        depth = self.xy[self.support_contacts[1:-1], 1]
        return np.concatenate([loads[..., -1:], -rows[..., depth]], axis=-1)

    def apply_event(self, name: str, x: State) -> State | None:
        """The state after a car stops, breaks loose or reaches a brake; None: other events end the run."""
        for i in self._stops:
            car = self.line.cars_on_rope[i].name
            if name == f"{car} stops":
                return self._stop_or_slip_on(i, x)
            if name == f"{car} breaks loose":
                return self._start_slipping(i, x)
            if name == f"{car} brakes":
                self.begin_step(x)
                return consistent_acceleration(self, x.t, x.q, x.v, x.phase)
        return None

    def system_after(self, event: str, x: State) -> tuple[LineElements, State] | None:
        """The line after a car passes an end of a shoe, and its state; None if another event has ended the run."""
        for passage in self.passages:
            if str(passage) == event:
                from cablefem.elements.carrying import system_after_passage

                return system_after_passage(self, passage, x)
        return None

    def observe(self, states: Sequence[State], s: Array) -> LineMotion:
        """What the states show, with the rope at the stations s (m,)."""
        return observe_line(self, states, s)
