"""A line in motion on elements, for the time driver: its start, cars that stick and slip, and its events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cablefem.elements.bodies import CarLoadsAndMasses, forces_on_cars, vector_length
from cablefem.elements.line_balance import LineBalance
from cablefem.elements.line_coordinates import Coordinates
from cablefem.elements.line_observe import observe_line
from cablefem.line_in_motion import LineInMotion
from cablefem.motion import LineMotion
from cablefem.newmark import (
    Array,
    State,
    StepFailure,
    StepsWithFactors,
    consistent_acceleration,
)
from cablefem.scene.contacts import MovingLine
from cablefem.shoes import Passage

SHIFT = 1e-4  # [s] for velocities through states of rest


class LineElements(LineInMotion, LineBalance):
    """A rope over contacts with cars; `elements` of `degree` on each segment.

    Events end the run: "A meets B" and "CAR reaches SUPPORT" at NEAREST; "CAR lifts off" where the rope would have to
    hold it down; "rope falls slack" and "rope lifts off SADDLE"; AT_REST.
    The run goes on after "CAR brakes", "CAR leaves a brake" where it rolls back, and "CAR stops", where friction may
    hold it until "CAR breaks loose".
    """

    of_cars = "hold", "signs", "held_since", "brakes", "rear_brakes", "reached"

    def __init__(self, line: MovingLine, *, elements: int = 6, degree: int = 4) -> None:
        super().__init__(line, elements, degree)
        self.many_steps = not self.acting_off_rope
        cars = line.cars_on_rope
        self.set_watched_events(dict(enumerate(cars)))
        self._wheels_on_shoes = np.array([cars[i].rail is not None for i in self.car_of_wheel], bool)

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
        rows = self.balance_rows_storing_loads(t, at_rest, phase)
        self.refuse_slack_rope(t, self._min_tension_and_saddle_pressures(rows, self.loads[0]))
        q[self.force] = 0.0
        v[self.force] = 0.0
        x = consistent_acceleration(self, t, q[self.free], v[self.free], phase)
        return self.hold_until_released(x)

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
        rows = self.balance_rows_storing_loads(t, x, phase, cars=held)
        self.hold = rows[slots] / stretch
        for i in self.free_cars:
            self.set_friction_and_forget_event_values(i, x.q[slots[i]], self.slip_sign(i))
        now = self.car_loads_and_masses(t, phase)
        self.balance_rows_storing_loads(t, x, phase, cars=now)
        loads = np.bincount(self.car_of_wheel, np.abs(self.loads[0, :-1]))
        none = np.zeros_like(now.hold)
        frictionless = now._replace(hold=none, sign=none)
        rows = self.balance_rows_storing_loads(t, x, phase, cars=frictionless)
        needed = rows[slots] / stretch
        behind = y[:, 0:2]
        cos_phi = np.sum(behind * forces.tau, axis=1) / vector_length(behind)
        thrust_angles = [car.drive.thrust_angle for car in self.line.cars_on_rope]
        needed -= now.thrust * np.cos(thrust_angles) / cos_phi
        for i in self.free_cars:
            self.set_friction_and_forget_event_values(i, self.reached[i], -np.sign(needed[i]) or 1.0)
            car = self.line.cars_on_rope[i]
            holding = car.drive.mu_r * loads[i] + self.brakes[i]
            if car.drive.has_friction_or_brakes and abs(needed[i]) <= holding:
                cause = f"friction or brakes hold {car.name} where it begins"
                raise StepFailure(t, cause, "begin on steeper rope, or with less of both")

    # --- cars that stick and slip ------------------------------------------------------------------------------
    def slip_sign(self, i: int) -> float:
        return float(self.signs[i])

    def travel_unknown_index(self, i: int) -> int:
        return int(np.searchsorted(self._unknown, self.slot_of_s(i)))

    def set_friction_and_brakes(self, i: int, s: float, sign: float) -> None:
        drive = self.line.cars_on_rope[i].drive
        self.signs[i] = sign
        self.brakes[i] = drive.brake_force(s)
        self.rear_brakes[i] = drive.rear_brake_force(s)

    def holding_force(self, i: int, x: State) -> float:
        z = self.all_coordinates_from_unknowns(*x)
        return float(self._holding_force(i, z, self.balance_rows_storing_loads(x.t, z, x.phase)))

    def _holding_force(self, i: int, z: Coordinates, rows: Array) -> Array:
        """Force [N] of friction and brakes along the rope that a car which sticks needs; of two wheels all of it."""
        y = self.slopes_and_motion_at_cars(z)[..., i, :]
        stretch = 0.5 * (vector_length(y[..., 0:2]) + vector_length(y[..., 2:4]))
        return rows[..., self.slot_of_s(i)] / stretch

    def _friction_margin(self, i: int, z: Coordinates, rows: Array, wheel_loads: Array) -> Array:
        """Largest force [N] of friction and brakes less the one that holds car i."""
        load = np.abs(wheel_loads[..., np.equal(self.car_of_wheel, i)]).sum(axis=-1)
        largest = self._unloaded_cars.friction[i] * load + self.brakes[i]
        return largest - np.abs(self._holding_force(i, z, rows))

    # --- steps ---------------------------------------------------------------------------------------------
    def take_steps_while_factors_serve(self, phase: int, node_times: Array, march: StepsWithFactors) -> int:
        cars = self.car_loads_and_masses(node_times, phase)
        prescribed = self.prescribed_coordinates(node_times, phase)
        return self._kernel.take_steps_while_factors_serve(
            self.law, cars, self._unknown, self.moving_coordinates, prescribed, march
        )

    # --- events --------------------------------------------------------------------------------------------
    def contact_positions_and_forces(self, t: Any, coordinates: Coordinates, phase: int) -> tuple[Array, list[Array]]:
        rows = self.balance_rows_storing_loads(t, coordinates, phase)
        loads = self.loads.reshape(*np.shape(t), self.loads.shape[-1])
        wheel_loads = loads[..., :-1]
        pressing = np.where(self._wheels_on_shoes, np.inf, wheel_loads)  # a car does not leave a shoe
        of_rope = self._min_tension_and_saddle_pressures(rows, loads)
        forces = [*np.moveaxis(pressing, -1, 0), *np.moveaxis(of_rope, -1, 0)]
        for i in self.stops:
            margin = self._friction_margin(i, coordinates, rows, wheel_loads)
            forces.append(np.where(self.sticks(i), margin, np.inf))
        return coordinates.q[..., self.s], forces

    def slopes_beside_car(self, name: str, coordinates: Coordinates) -> Array:
        i = [car.name for car in self.line.cars_on_rope].index(name)
        return self.slopes_beside(self.car_contacts[i], coordinates.q)

    def car_points_and_rates(self, name: str, t: Any, coordinates: Coordinates, phase: int) -> Array:
        for k, on_rope in zip(self.car_contacts, self.line.cars_on_rope, strict=True):
            if on_rope.name == name:
                return np.stack([x[..., self.xy[k]] for x in coordinates])
        flat = np.array(coordinates).reshape(3, -1, self.size)
        points = self.off_rope[name].points_with_rates(np.ravel(t), flat, phase)
        return np.moveaxis(points.reshape(*np.shape(t), 3, 2), -2, 0)

    def _min_tension_and_saddle_pressures(self, rows: Array, loads: Array) -> Array:
        """Smallest tension, and pressures of the rope on the saddles [N] (..., .)."""
        depth = self.xy[self.support_contacts[1:-1], 1]
        return np.concatenate([loads[..., -1:], -rows[..., depth]], axis=-1)

    def system_after_passage(self, passage: Passage, x: State) -> tuple[LineElements, State]:
        from cablefem.elements.carrying import system_after_passage

        return system_after_passage(self, passage, x)

    def observe(self, states: Sequence[State], s: Array) -> LineMotion:
        """What the states show, with the rope at the stations s (m,)."""
        return observe_line(self, states, s)
