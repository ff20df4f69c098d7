"""Events of a line in motion, and cars that stick and slip along its rope, for both solvers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from cablefem.newmark import MarchingSystem, State, StepFailure, consistent_acceleration
from cablefem.newmark.states import Array
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
from cablefem.shoes import Passage, car_may_pass_saddle, possible_passages, upward_turn

TURNING = 1e-9  # [m/s] slower cars keep the direction of their friction


def positions_for_brakes_between_jumps(t: Array, s: Array) -> Array:
    """Positions s (n, ...) that tell which brakes act at times t (n,).

    Where a time stands twice a brake may begin or end to act, at a place known to rounding of a step only: both states
    there are moved half-way to their neighbours.
    """
    first = np.flatnonzero(np.diff(t) <= 0.0)
    out = s.copy()
    out[first] = 0.5 * (s[first] + s[np.maximum(first - 1, 0)])
    out[first + 1] = 0.5 * (s[first + 1] + s[np.minimum(first + 2, t.size - 1)])
    return out


class LineInMotion(MarchingSystem):
    """A subclass sets attributes, calls `set_watched_events`, defines the methods that raise, and numbers the cars."""

    line: MovingLine
    all_coordinates_from_unknowns: Callable[..., Any]  # all coordinates with their rates in states t, q, v, a, phase
    reached: Any  # s up to which the brakes of free cars act, by number
    held_since: Any  # [s] when friction last stopped free cars
    of_cars: tuple[str, ...]  # names of the arrays, by number, in which friction is kept
    free_cars: Any  # their numbers

    def set_watched_events(self, cars: Mapping[int, Car]) -> None:
        """Set what events watch; cars : on the rope, by number."""
        touching = self.line.contacts_and_wheels
        self.car_by_number = cars
        self.passages = possible_passages(self.line)
        self.gaps = [k for k, neighbours in enumerate(pairwise(touching)) if self._may_meet(*neighbours)]
        self.stops = [i for i in self.free_cars if cars[i].drive.has_friction_or_brakes]
        self.standstills = dict.fromkeys(self.stops, (-math.inf, -math.inf))  # time [s] and s [m] of the last ones
        self.adaptive = bool(self.stops) and self.line.longest_step < math.inf
        self.braked = [i for i in self.stops if cars[i].drive.brakes]
        names = [meeting_event_name(touching[k], touching[k + 1]) for k in self.gaps]
        names += [f"{cars[i].name} stops" for i in self.stops]
        for i in self.braked:
            names += [f"{cars[i].name} brakes", f"{cars[i].name} leaves a brake"]
        names += [lift_off_event_name(contact) for contact in touching if not isinstance(contact, Contact)]
        names += ["rope falls slack"]
        names += [f"rope lifts off {support.name}" for support in self.line.supports[1:-1]]
        names += [f"{cars[i].name} breaks loose" for i in self.stops]
        self.events = *names, AT_REST, *map(str, self.passages)

    def _may_meet(self, first: Contact | Car | Wheel, second: Contact | Car | Wheel) -> bool:
        """Whether two neighbours may meet: one of them is a car, and neither passes the other over a shoe."""
        if isinstance(first, Contact) and isinstance(second, Contact):
            return False
        one, other = (c.car.name if isinstance(c, Wheel) else c.name for c in (first, second))
        return one != other and not car_may_pass_saddle(self.passages, one, other)

    def copy_friction_from(self, before: LineInMotion) -> None:
        """Let free cars have the friction that they had in a line before."""
        numbers = {car.name: i for i, car in before.car_by_number.items()}
        for i in self.free_cars:
            j = numbers[self.car_by_number[i].name]
            for name in self.of_cars:
                getattr(self, name)[i] = getattr(before, name)[j]

    def refuse_slack_rope(self, t: float, tension_and_pressures: Array) -> None:
        """Raise StepFailure where the rope at rest is slack or lifts off a saddle.

        tension_and_pressures : [N] the smallest tension, and the force of the rope on each saddle.
        """
        tension, *pressures = tension_and_pressures.tolist()
        pressure = min(pressures, default=0.0)
        if min(tension, pressure) < 0.0:
            at_rest = f"at rest the smallest tension is {tension:.6g} N"
            cause = f"{at_rest} and the smallest pressure on a saddle {pressure:.6g} N"
            raise StepFailure(t, cause, "tighten the rope or lower its saddles")

    def slip_sign(self, i: int) -> float:
        """The sign of the slip that friction and brakes of a car act against; 0: they hold it."""
        raise NotImplementedError

    def set_friction_and_brakes(self, i: int, s: float, sign: float) -> None:
        """Let friction of a free car, and the brakes that begin up to s, act against a slip of this sign."""
        raise NotImplementedError

    def travel_unknown_index(self, i: int) -> int:
        """Number of s of a free car among the unknowns."""
        raise NotImplementedError

    def holding_force(self, i: int, x: State) -> float:
        """Force [N] along the rope that friction and brakes give a car which sticks."""
        raise NotImplementedError

    def with_acceleration(self, x: State) -> State:
        """The state with the accelerations that its balance asks for."""
        return consistent_acceleration(self, x.t, x.q, x.v, x.phase)

    # --- events ------------------------------------------------------------------------------------------------
    def contact_positions_and_forces(self, t: Any, coordinates: Any, phase: int) -> tuple[Array, list[Array]]:
        """s of contacts (..., contacts), and forces (...) [N] whose fall to 0 is an event.

        In the order of `set_watched_events`.
        """
        raise NotImplementedError

    def car_points_and_rates(self, name: str, t: Any, coordinates: Any, phase: int) -> Array:
        """Points of a car on one contact, or off the rope, with their rates (3, ..., 2)."""
        raise NotImplementedError

    def slopes_beside_car(self, name: str, coordinates: Any) -> Array:
        """r' behind and ahead of a car on one contact (..., 4)."""
        raise NotImplementedError

    def car_point_and_rates(self, name: str, x: State) -> Array:
        """The same (3, 2) in a state."""
        return self.car_points_and_rates(name, x.t, self.all_coordinates_from_unknowns(*x), x.phase)

    def event_values_at(self, t: Any, q: Array, v: Array, a: Array, phase: int) -> Array:
        coordinates = self.all_coordinates_from_unknowns(t, q, v, a, phase)
        with np.errstate(all="ignore"):  # contacts that meet
            s, forces = self.contact_positions_and_forces(t, coordinates, phase)
        gaps = np.diff(s)[..., self.gaps] - NEAREST
        in_order = gaps.min(axis=-1, initial=np.inf) > 0.0  # else forces have no meaning
        values = [*np.moveaxis(gaps, -1, 0)]
        for i in self.stops:
            values.append(np.where(self.sticks(i), np.inf, v[..., self.travel_unknown_index(i)] * self.slip_sign(i)))
        for i in self.braked:
            behind, ahead = self._last_and_next_brake_or_inf(i)
            position = q[..., self.travel_unknown_index(i)]
            values += [ahead - position, position - behind]
        values += [np.where(in_order, x, np.inf) for x in (*forces, self.time_when_at_rest(phase) - t)]
        for passage in self.passages:
            x, dx = self.car_points_and_rates(passage.car, t, coordinates, phase)[:2, ..., 0]
            turn = np.full(x.shape, np.inf)
            if passage.ends_with_pressure:
                turn = upward_turn(self.slopes_beside_car(passage.car, coordinates)).reshape(x.shape)
            values.append(np.vectorize(passage.distance_to_go)(x, dx, turn))
        return np.stack(values, axis=-1)

    # --- cars that stick and slip ------------------------------------------------------------------------------
    def sticks(self, i: int) -> bool:
        """Whether friction holds a car."""
        return self.slip_sign(i) == 0.0

    @property
    def sticking_unknown_indices(self) -> list[int]:
        """Numbers among the unknowns of s of cars that friction holds on the rope."""
        return [self.travel_unknown_index(i) for i in self.stops if self.sticks(i)]

    def set_friction_and_forget_event_values(self, i: int, s: float, sign: float) -> None:
        """`set_friction_and_brakes`; events' values that depend on what has changed are forgotten."""
        if (self.reached[i], self.slip_sign(i)) != (s, sign):
            self._known_values = None
        self.reached[i] = s
        self.set_friction_and_brakes(i, s, sign)

    def step_fraction(self, x: State, since_event: float, time_ahead: float = 0.0) -> float:
        """Less near a standstill of a car, where its friction turns; a power of 1/2, so that steps are often equal."""
        longest = self.line.longest_step
        steps = [self._longest_step_near_standstill(i, x, time_ahead) for i in self.stops]
        return 2.0 ** math.floor(math.log2(min(longest, *steps) / longest))

    def _longest_step_near_standstill(self, i: int, x: State, time_ahead: float) -> float:
        """Half the time [s] to and since a standstill of a car, or half of that for which it sticks then, if longer.

        A car that comes to a standstill sticks to the rope and sets it in motion until its friction has turned: for
        about M/(2 sqrt(rho EA)), its mass over the impedance of the rope on both sides.  Steps grow while it rattles
        within `rest_distance` of there: they damp the waves.
        """
        car = self.car_by_number[i]
        t_standstill, s_standstill = self.standstills[i]
        limit = x.t + time_ahead - t_standstill
        if abs(x.q.item(self.travel_unknown_index(i)) - s_standstill) > car.drive.rest_distance:
            velocity, acceleration = self.car_point_and_rates(car.name, x)[1:, 0].tolist()
            velocity += time_ahead * acceleration
            if velocity * acceleration < 0.0:
                limit = min(limit, -velocity / acceleration)
        rope = self.line.rope
        sticking_time = car.mass / (2.0 * math.sqrt(rope.mass_per_length * rope.EA))
        return 0.5 * max(limit, sticking_time)

    def begin_step(self, x: State) -> None:
        """Keep the direction of friction for one step."""
        for i in self.stops:
            ds = x.v.item(self.travel_unknown_index(i))
            sign = math.copysign(1.0, ds) if abs(ds) > TURNING else self.slip_sign(i)
            self.set_friction_and_forget_event_values(i, self.reached[i], sign)

    def _last_and_next_brake_or_inf(self, i: int) -> tuple[float, float]:
        """Where the last brake that acts on a car begins, and the next one; infinite where there is none."""
        return self.car_by_number[i].drive.brake_positions_around(self.reached[i])

    def time_when_at_rest(self, phase: int) -> float:
        """When all free cars, which friction holds, are at rest; inf where it does not hold them, or there are none."""
        if not self.free_cars or not all(self.sticks(i) for i in self.free_cars):
            return math.inf
        return self.line.time_when_at_rest(float(max(self.held_since[i] for i in self.free_cars)), phase)

    def hold_until_released(self, x: State) -> State:
        """The first state: friction holds each car with friction or brakes whose release takes time, or it slips."""
        for i in self.stops:
            if self.car_by_number[i].drive.release > 0.0:
                x = self._stop_or_slip_on(i, x)
        return x

    def _stop_or_slip_on(self, i: int, x: State) -> State:
        """The state after a standstill: friction holds the car, or it slips."""
        self.held_since[i] = x.t
        s = x.q.item(self.travel_unknown_index(i))
        if abs(s - self.standstills[i][1]) > self.car_by_number[i].drive.rest_distance:
            self.standstills[i] = x.t, s
        held = self._set_friction_return_state_at_rest(i, x, 0.0)
        margin = self.event_values(held)[self.events.index(f"{self.car_by_number[i].name} breaks loose")]
        return held if margin > 0.0 else self._start_slipping(i, held)

    def _start_slipping(self, i: int, x: State) -> State:
        """The state in which a car that sticks gives way to what pulls it."""
        return self._set_friction_return_state_at_rest(i, x, -math.copysign(1.0, self.holding_force(i, x)))

    def _set_friction_return_state_at_rest(self, i: int, x: State, sign: float) -> State:
        """Set friction against a slip of this sign, for 0 the car sticks; return the state with the car at rest."""
        row = self.travel_unknown_index(i)
        self.set_friction_and_forget_event_values(i, self.reached[i], sign)
        v = x.v.copy()
        a = x.a.copy()
        v[row] = sign * 1e-12  # [m/s] not 0, else its next standstill is no event
        a[row] = 0.0
        return self.with_acceleration(x._replace(v=v, a=a))

    def apply_event(self, name: str, x: State) -> State | None:
        """The state after a car stops, breaks loose, reaches or leaves a brake; None: other events end the run."""
        for i in self.stops:
            car = self.car_by_number[i].name
            if name == f"{car} stops":
                return self._stop_or_slip_on(i, x)
            if name == f"{car} breaks loose":
                return self._start_slipping(i, x)
            behind, ahead = self._last_and_next_brake_or_inf(i)
            if name == f"{car} brakes":
                self.set_friction_and_forget_event_values(i, ahead, self.slip_sign(i))
                return self.with_acceleration(x)
            if name == f"{car} leaves a brake":
                self.set_friction_and_forget_event_values(i, math.nextafter(behind, -math.inf), self.slip_sign(i))
                return self.with_acceleration(x)
        return None

    def system_after_event_or_none(self, event: str, x: State) -> tuple[Any, State] | None:
        """The line after a car passes an end of a shoe, and its state; None if another event has ended the run."""
        passages = {str(passage): passage for passage in self.passages}
        return self.system_after_passage(passages[event], x) if event in passages else None

    def system_after_passage(self, passage: Passage, x: State) -> tuple[Any, State]:
        """The line after a passage, and its state."""
        raise NotImplementedError
