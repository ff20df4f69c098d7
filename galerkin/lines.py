"""A line in motion by sines: unknowns, rows, friction and events; see README.md, "A line in motion"."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from cablefem.motion import LineMotion
from cablefem.newmark import (
    ACCELERATION_ONLY,
    MarchingSystem,
    Solve,
    State,
    StepFailure,
    StepsWithFactors,
    TangentFactors,
)
from cablefem.scene.contacts import NEAREST, Array, Contact, MovingLine
from galerkin import kernels
from galerkin.bodies import CarBody, Friction
from galerkin.kernels import LineValues
from galerkin.line_equations import LineEquations, body_at_contact
from galerkin.line_events import WatchedEvents
from galerkin.line_observe import observe
from galerkin.line_off_rope import CarOffRope
from galerkin.line_rest import chord_lengths, coordinates_at_rest
from galerkin.segments import Layout

TURNING = 1e-9  # [m/s] slower cars keep the direction of their friction
CACHED_INSTANTS = 8  # whose prescribed coordinates are kept: a step's nodes are evaluated several times
NUDGE = 1e-4  # [s] for the velocity of a line that starts in motion
REAR_BRAKE = Friction._fields.index("rear_brake")
SIGN = Friction._fields.index("sign")
HOLD = Friction._fields.index("hold")


class LineSines(MarchingSystem):
    """A line in motion, in SI.  The acceleration of a hauled car's last unknown is the haul force."""

    def __init__(self, line: MovingLine, terms: int) -> None:
        super().__init__()
        self.line = line
        self.layout = Layout(line, terms)
        self.phases = line.phases
        bodies = [body_at_contact(line, contact) for contact in line.contacts_and_wheels]
        held = [body.copy_held() if isinstance(body, CarBody) else body for body in bodies]
        self.cars = {k: body for k, body in enumerate(bodies) if isinstance(body, CarBody)}
        # contact of each car that its travel is of: the front wheel
        self.travel_contact = {k: k + body.contacts - 1 for k, body in self.cars.items()}
        self.free_cars = {k: body for k, body in self.cars.items() if body.car.drive_kind == "free"}
        self.equations = LineEquations(self.layout, bodies)
        self.held_equations = LineEquations(self.layout, held)
        self.n_dof = self.equations.size
        weight_of_rope = line.weight_per_length * float(chord_lengths(line).sum())
        self.force_scale = max((line.gravity * car.mass for car in line.cars_on_rope), default=weight_of_rope)
        self.force_floor = 16.0 * sys.float_info.epsilon * line.rope.EA
        self.frictions = np.zeros((len(bodies), len(Friction._fields)))
        self.reached = np.zeros(len(bodies))  # s of the cars where their brakes were set
        self.holds = dict.fromkeys(self.free_cars, 0.0)  # [N] on free cars before they are released
        self.held_since = dict.fromkeys(self.free_cars, 0.0)  # [s] when friction stopped them last
        self.watched = WatchedEvents(line, bodies, self.cars)
        self.events = self.watched.names
        self.off_rope = self._cars_off_rope()
        self._acting_off_rope = [car for car in self.off_rope.values() if car.acts_in_rows]
        self.many_steps = not self._acting_off_rope
        self._fixed_coordinates = self._coordinates_of_supports()
        self._prescribed = lru_cache(CACHED_INSTANTS)(self._compute_prescribed)

    def _cars_off_rope(self) -> dict[str, CarOffRope]:
        """Cars off the rope by name."""
        contacts = {contact.name: k for k, contact in enumerate(self.line.contacts_and_wheels)}
        rows = {coordinate: row for row, coordinate in enumerate(self.equations.free.tolist())}
        cars = {}
        for car in self.line.cars_off_rope:
            if car.rail is not None:
                saddle = contacts[car.rail.saddle]
                cars[car.name] = CarOffRope(self.line, car, self.layout, saddle, rows)
        return cars

    # --- coordinates -------------------------------------------------------------------------------------------------
    def prescribed_coordinates(self, t: float, phase: int) -> Array:
        """All coordinates with their rates (3, layout.size), zero where unknown; a copy."""
        return self._prescribed((t,), phase)[:, 0].copy()

    def _coordinates_of_supports(self) -> Array:
        """What supports prescribe, (3, 1, layout.size)."""
        layout = self.layout
        Z = np.zeros((3, 1, layout.size))
        for k, contact in enumerate(self.line.contacts_and_wheels):
            if isinstance(contact, Contact):
                Z[0, 0, layout.x[k]], Z[0, 0, layout.y[k]] = contact.point
        Z[0, 0, layout.s[-1]] = self.line.rope.length or 0.0
        return Z

    def _compute_prescribed(self, times: tuple[float, ...], phase: int) -> Array:
        """What is prescribed at these times, (3, n, layout.size)."""
        line = self.line
        layout = self.layout
        Z = self._fixed_coordinates.repeat(len(times), axis=1)
        for k, body in self.cars.items():
            car = body.car
            front = self.travel_contact[k]
            if car.travel is not None:
                at = layout.x if car.drive_kind == "haul_x" else layout.s
                Z[:, :, at[front]] = np.array([line.prescribed_position_with_rates(car, t, phase) for t in times]).T
            else:
                Z[0, :, layout.s[front]] = car.drive.start
                Z[2, :, layout.F[k]] = [line.thrust(car, t, phase) for t in times]
        return Z

    def coordinates_with_rates(self, x: State) -> Array:
        """All coordinates of a state with their rates (3, layout.size)."""
        return self._coordinates((x.t,), x.q, x.v, x.a, x.phase)[:, 0]

    def _coordinates(self, times: tuple[float, ...], q: Array, v: Array, a: Array, phase: int) -> Array:
        """All coordinates with their rates (3, n, layout.size)."""
        Z = self._prescribed(times, phase).copy()
        for rates, unknowns in zip(Z, (q, v, a), strict=True):
            rates[:, self.equations.free] = unknowns
        self.layout.set_dependent_coordinates(Z)
        return Z

    def frictions_at(self, times: Sequence[float]) -> Array:
        """Frictions at all contacts, (n, contacts, 5)."""
        frictions = self.frictions[None].repeat(len(times), axis=0)
        for k, hold in self.holds.items():
            drive = self.cars[k].car.drive
            frictions[:, k, HOLD] = [hold * drive.remaining_hold_fraction(t) for t in times]
        return frictions

    # --- the system --------------------------------------------------------------------------------------------------
    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        return self.residuals(np.array([t]), q[None], v[None], a[None], phase)[0]

    def residuals(self, t: Array, q: Array, v: Array, a: Array, phase: int) -> Array:
        times = tuple(t.tolist())
        x = np.stack([q, v, a], axis=1)
        values = kernels.evaluate_unknowns(
            self.equations.line, self._prescribed(times, phase), x, self.frictions_at(times)
        )
        for car in self._acting_off_rope:
            car.complete_residuals(car.contact_state(t, values.Z, phase), values.r)
        for row in self._sticking_rows:
            values.r[:, row] = 0.0
        return values.r

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        r, K = self._residual_and_derivatives(State(t, q, v, a, phase))
        return r, self.equations.inverse_or_nan(np.tensordot(c, K, 1))

    def factorised_tangents(
        self, t: float, q: Array, v: Array, a: Array, phase: int, cs: Sequence[TangentFactors]
    ) -> list[Solve]:
        _, K = self._residual_and_derivatives(State(t, q, v, a, phase))
        return [self.equations.inverse_or_nan(np.tensordot(c, K, 1)) for c in cs]

    def take_steps_with_factors(self, phase: int, node_times: Array, march: StepsWithFactors) -> int:
        times = tuple(node_times.ravel().tolist())
        prescribed = self._prescribed(times, phase).reshape(3, *node_times.shape, -1)
        line = kernels.LineInSteps(
            line=self.equations.line,
            prescribed=np.ascontiguousarray(prescribed.swapaxes(0, 1)),
            frictions=self.frictions_at(times).reshape(*node_times.shape, *self.frictions.shape),
        )
        moving = np.ones(self.n_dof, bool)
        moving[self._sticking_rows] = False
        return int(kernels.take_steps_with_factors(line, moving, march))

    def count_ends_before_change(self, q: Array) -> int:
        """Up to the first one from which other brakes act."""
        others = np.zeros(len(q), bool)
        for k in self.watched.stops:
            s = q[:, self._row_of_travel(k)]
            others |= self.cars[k].car.drive.brake_force(s) != self.frictions[k, REAR_BRAKE:SIGN].sum()
        return int(np.argmax(others)) + 1 if others.any() else len(q)

    def _residual_and_derivatives(self, x: State) -> tuple[Array, Array]:
        """The residual, and its derivatives (3, n_dof, n_dof) by q, v, a."""
        Z = self.coordinates_with_rates(x)[:, None]
        values, K = self.equations.evaluate_with_derivatives(Z, self.frictions_at([x.t]))
        for car in self._acting_off_rope:
            state = car.contact_state(np.array([x.t]), Z, x.phase)
            car.complete_residuals(state, values.r)
            car.complete_derivatives(state, K)
        r = values.r[0]
        for row in self._sticking_rows:  # s.. = 0, exactly: its column has no part in the rest
            r[row] = 0.0
            K[:, row] = K[:, :, row] = 0.0
            K[2, row, row] = 1.0
        return r, K

    def start(self, phase: int, state: State | None) -> State:
        self.set_travel_directions(phase)
        if state is not None:
            state = state._replace(phase=phase)
            self.begin_step(state)
            return self.with_acceleration(state)
        rest = coordinates_at_rest(self)
        values = self.held_equations.evaluate(rest[:, None], self.frictions[None])
        self._require_taut_rope_on_saddles(values)
        for k in self.free_cars:
            self._set_release_friction_or_raise(k, rest, values)
        free = self.equations.free
        forces = self.equations.forces
        q = np.where(forces, 0.0, rest[0, free])
        v = np.zeros(self.n_dof)
        if self.prescribed_coordinates(0.0, 0)[1].any():
            before = coordinates_at_rest(self, -NUDGE, rest)[0, free]
            after = coordinates_at_rest(self, NUDGE, rest)[0, free]
            v = np.where(forces, 0.0, (after - before) / (2.0 * NUDGE))
        x = State(0.0, q, v, rest[2, free], 0)
        self.begin_step(x)
        return self.with_acceleration(x)

    def _require_taut_rope_on_saddles(self, values: LineValues) -> None:
        """StepFailure where the rope at rest is slack or lifts off a saddle."""
        tension, *pressures = self.min_tension_and_saddle_pressures(values)[:, 0].tolist()
        pressure = min(pressures, default=0.0)
        if min(tension, pressure) < 0.0:
            at_rest = f"at rest the smallest tension is {tension:.6g} N"
            cause = f"{at_rest} and the smallest pressure on a saddle {pressure:.6g} N"
            raise StepFailure(0.0, cause, "tighten the rope")

    def with_acceleration(self, x: State) -> State:
        """The state with the accelerations that its balance asks for; StepFailure where there are none."""
        a = x.a.copy()
        bound = 1e-6 * self.force_scale + math.sqrt(self.n_dof) * self.force_floor
        for _ in range(20):
            r, solve = self.linearise(x.t, x.q, x.v, a, x.phase, ACCELERATION_ONLY)
            a = a - solve(r.copy())
            if np.linalg.norm(r) <= bound:
                return State(x.t, x.q, x.v, a, x.phase)
        raise StepFailure(x.t, "no acceleration balances the forces", "start the cars elsewhere")

    def observe(self, states: Sequence[State], s: Array) -> LineMotion:
        """The motion at all states and at the stations s (m,)."""
        return observe(self, states, s)

    def car_point_and_rates(self, name: str, x: State) -> Array:
        """Point of a car on one contact, or off the rope, with its rates (3, 2)."""
        Z = self.coordinates_with_rates(x)[:, None]
        return self._car_points_and_rates(name, np.array([x.t]), Z, x.phase)[:, 0]

    def _car_points_and_rates(self, name: str, t: Array, Z: Array, phase: int) -> Array:
        """The same (3, n, 2) at the times t (n,), with the coordinates Z."""
        for k, body in self.cars.items():
            if body.car.name == name:
                return Z[..., self.layout.moving[k, :2]]
        at = self.off_rope[name].contact_state(t, Z, phase)
        return np.stack([at.p, at.dp, at.ddp])

    # --- friction: a car is named by its contact k, of two wheels the rear one ----------------------------------------
    def set_travel_directions(self, phase: int) -> None:
        """Set friction against the motion of prescribed cars; a shoe has none."""
        for k, body in self.cars.items():
            if body.car.travel is not None and body.car.rail is None:
                self.frictions[k] = Friction(body.car.drive.mu_r, sign=self.line.travel_direction(body.car, phase))

    def begin_step(self, x: State) -> None:
        """Keep the direction of friction, and the brakes that act, for one step."""
        for k in self.watched.stops:
            row = self._row_of_travel(k)
            ds = x.v.item(row)
            sign = float(np.sign(ds)) if abs(ds) > TURNING else self.frictions[k, SIGN]
            if self.cars[k].car.rail is None:
                self._set_friction(k, x.q.item(row), sign)

    def _set_friction(self, k: int, s: float, sign: float) -> None:
        """Set friction and brakes of a car at s against a motion of this sign; 0: they hold it."""
        body = self.cars[k]
        *rear, last = body.brake_forces_of_wheels(s).tolist()
        friction = Friction(body.car.drive.mu_r, sum(rear), last, sign)
        self.reached[k] = s
        if Friction(*self.frictions[k]) != friction:
            self.frictions[k] = friction
            self._known_values = {}

    def _set_release_friction_or_raise(self, k: int, Z: Array, values: LineValues) -> None:
        """Let a free car at rest go; StepFailure if friction holds it."""
        body = self.cars[k].copy_held()
        state = self.held_equations.contact_state(values.contact_values[-1], k)
        cos_phi = float(state.wheels[-1].cos_phi)
        drive = body.car.drive
        thrust = self.line.thrust(body.car, 0.0, 0) * math.cos(drive.thrust_angle)
        self.holds[k] = float(body.tangential_force_on_last_wheel(state)) / cos_phi
        needed = self.holds[k] - thrust / cos_phi
        s = float(Z[0, self.layout.s[self.travel_contact[k]]])
        self._set_friction(k, s, -float(np.sign(needed)))
        available = body.max_friction_plus_brake_force(state, Friction(*self.frictions[k]))
        if drive.has_friction_or_brakes and abs(needed) <= available:
            raise StepFailure(0.0, f"friction or brakes hold {body.car.name} where it begins", "begin on steeper rope")

    def _sticks(self, k: int) -> bool:
        """Whether friction holds a car."""
        return self.frictions[k, SIGN] == 0.0

    @property
    def _sticking_rows(self) -> list[int]:
        """Rows of s of the cars that friction holds."""
        return [self._row_of_travel(k) for k in self.watched.stops if self._sticks(k)]

    def _row_of_travel(self, k: int) -> int:
        """Row of s of a free car."""
        coordinate = self.layout.s[self.travel_contact[k]]
        return int(np.flatnonzero(self.equations.free == coordinate)[0])

    def _needed_friction(self, k: int, times: tuple[float, ...], values: LineValues) -> Array:
        """Force (n,) [N] along the rope that friction and brakes give a car which sticks, at its last wheel."""
        state = self.equations.contact_state(values.contact_values, k)
        needed = self.cars[k].tangential_force_on_last_wheel(state) / state.wheels[-1].cos_phi
        return np.asarray(needed - self.frictions_at(times)[:, k, HOLD])

    def _friction_margin(self, k: int, times: tuple[float, ...], values: LineValues) -> Array:
        """What friction and brakes could give a car which sticks, less what they give (n,) [N]; inf while it slips."""
        if not self._sticks(k):
            return np.full(len(times), np.inf)
        state = self.equations.contact_state(values.contact_values, k)
        available = self.cars[k].max_friction_plus_brake_force(state, Friction(*self.frictions[k]))
        return available - np.abs(self._needed_friction(k, times, values))

    def _stick_or_slip_from_rest(self, k: int, x: State) -> State:
        """The state after a standstill: friction holds the car, or it slips."""
        self.held_since[k] = x.t
        held = self._set_slip_return_state(k, x, 0.0)
        margin = self._friction_margin(k, (held.t,), self._values_at(held))
        return held if margin > 0.0 else self._start_slipping(k, held)

    def _start_slipping(self, k: int, x: State) -> State:
        """The state in which a car that sticks gives way to what pulls it."""
        pulled = -self._needed_friction(k, (x.t,), self._values_at(x)).item()
        return self._set_slip_return_state(k, x, math.copysign(1.0, pulled))

    def _set_slip_return_state(self, k: int, x: State, slip_sign: float) -> State:
        """Set friction against a slip of this sign, for 0 the car sticks; return the state with the car at rest."""
        row = self._row_of_travel(k)
        self._set_friction(k, float(x.q[row]), slip_sign)
        v = x.v.copy()
        a = x.a.copy()
        v[row] = slip_sign * 1e-12  # [m/s] not 0, else its next standstill is no event
        a[row] = 0.0
        return self.with_acceleration(x._replace(v=v, a=a))

    def _values_at(self, x: State) -> LineValues:
        """What acts in a state."""
        return self.equations.evaluate(self.coordinates_with_rates(x)[:, None], self.frictions[None])

    # --- events ------------------------------------------------------------------------------------------------------
    def event_values_at(self, t: Any, q: Array, v: Array, a: Array, phase: int) -> Array:
        watched = self.watched
        shape = np.shape(t)
        t = np.ravel(t)
        times = tuple(t.tolist())
        Z = self._coordinates(times, q, v, a, phase)
        s, ds = Z[:2][..., self.layout.s]  # (n, contacts)
        gaps = np.diff(s)[:, watched.gaps] - NEAREST
        in_order = gaps.min(axis=1, initial=1.0) > 0.0
        never = np.full(t.size, np.inf)
        values = [*gaps.T]
        for k in watched.stops:
            values.append(never if self._sticks(k) else ds[:, self.travel_contact[k]] * self.frictions[k, SIGN])
        for k, position in watched.brakes:
            to_brake = position - s[:, self.travel_contact[k]]
            values.append(to_brake if position > self.reached[k] else never)
        values += [np.where(in_order, x, np.inf) for x in self._force_event_values(times, Z, phase)]
        for passage in watched.passages:
            x, dx = self._car_points_and_rates(passage.car, t, Z, phase)[:2, :, 0].tolist()
            values.append(np.array([*map(passage.distance_to_go, x, dx)]))
        return np.stack(values, axis=1).reshape(*shape, -1)

    def _force_event_values(self, times: tuple[float, ...], Z: Array, phase: int) -> list[Array]:
        """Loads of wheels, tension of the rope, pressures on saddles, margins of friction [N]; time until rest [s]."""
        values = self.equations.evaluate(Z, self.frictions_at(times))
        out = []
        for k, body in self.cars.items():
            loads = values.forces_on_cars[:, k, 6 : 6 + body.contacts].real
            if body.car.rail is not None:  # a car does not leave a shoe
                loads = np.full_like(loads, np.inf)
            out += [*loads.T]
        out += [*self.min_tension_and_saddle_pressures(values)]
        with np.errstate(all="ignore"):  # contacts that meet
            out += [self._friction_margin(k, times, values) for k in self.watched.stops]
        all_held = bool(self.free_cars) and all(self._sticks(k) for k in self.free_cars)
        rest = self.line.time_at_rest(max(self.held_since.values()), phase) if all_held else math.inf
        return [*out, rest - np.array(times)]

    def min_tension_and_saddle_pressures(self, values: LineValues) -> Array:
        """The smallest mean of tensions over a shortest wave, and the force of the rope down on each saddle (., n) [N].

        EA multiplies the error of a strain: at a point a coarse sum of sines may be compressed where the rope is taut.
        """
        x = values.contact_values.real
        pressures = (x[..., 3] - x[..., 1])[:, self.watched.saddles]
        means = values.N[:, self.layout.outer] @ self.layout.means.T  # (n, S, P)
        return np.stack([means.min(axis=(1, 2)), *pressures.T])

    def apply_event(self, name: str, x: State) -> State | None:
        """The state after a car stops, breaks loose or reaches a brake; None: other events end the run."""
        for k in self.watched.stops:
            car = self.cars[k].car.name
            if name == f"{car} stops":
                return self._stick_or_slip_from_rest(k, x)
            if name == f"{car} breaks loose":
                return self._start_slipping(k, x)
            if name == f"{car} brakes":
                self.begin_step(x)
                return self.with_acceleration(x)
        return None

    def system_after(self, event: str, x: State) -> tuple[LineSines, State] | None:
        """The line after a car passes an end of a shoe, and its state; None if another event has ended the run."""
        for passage in self.watched.passages:
            if str(passage) == event:
                from galerkin.carrying import system_after_passage

                return system_after_passage(self, passage, x)
        return None
