"""A line in motion by sines: unknowns, rows, friction and events; see README.md, "A line in motion"."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cablefem.motion import LineMotion
from cablefem.newmark import ACCELERATION_ONLY, Solve, State, StepFailure, System, TangentFactors
from cablefem.scene.contacts import NEAREST, Array, Contact, MovingLine
from galerkin.bodies import CarBody, Friction
from galerkin.equations import overwriting_lu_solver_or_nan
from galerkin.line_equations import LineEquations, body_at_contact
from galerkin.line_events import WatchedEvents
from galerkin.line_observe import observe
from galerkin.line_off_rope import CarOffRope
from galerkin.line_rest import chord_lengths, coordinates_at_rest
from galerkin.segments import Layout, Rope

TURNING = 1e-9  # [m/s] slower cars keep the direction of their friction
CACHED_INSTANTS = 8  # instants whose prescribed coordinates are kept: a step's nodes are evaluated several times
NUDGE = 1e-4  # [s] for the velocity of a line that starts in motion


class Balance(NamedTuple):
    """Forces of the rope at the end of a step."""

    t: float
    a: Array  # of the state
    N: Array  # (S, G) [N]
    contact_values: Array  # (contacts, 26)


class Linearised(NamedTuple):
    """A residual and its derivatives, and the state that they belong to."""

    state: Array  # (3, n_dof)
    t: float
    phase: int
    r: Array  # (n_dof,)
    K: Array  # (3, n_dof, n_dof)


class LineSines(System):
    """A line in motion, in SI.  The acceleration of a hauled car's last unknown is the haul force."""

    reuses_factors = True

    def __init__(self, line: MovingLine, terms: int) -> None:
        self.line = line
        self.layout = Layout(line, terms)
        self.phases = line.phases
        bodies = [body_at_contact(line, contact) for contact in line.contacts_and_wheels]
        held = [body.copy_held_without_drag() if isinstance(body, CarBody) else body for body in bodies]
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
        self.frictions = [Friction() for _ in bodies]
        self.holds = dict.fromkeys(self.free_cars, 0.0)  # [N] on free cars before they are released
        self.watched = WatchedEvents(line, bodies, self.cars)
        self.events = self.watched.names
        self.off_rope = self._cars_off_rope()
        self._acting_off_rope = [car for car in self.off_rope.values() if car.acts_in_rows]
        self._prescribed: dict[tuple[float, int], Array] = {}
        self._force_events: tuple[State | None, list[float]] = (None, [])  # of the last state that was watched
        self._last_balance: Balance | None = None  # of the last residuals
        self._instants: tuple[Array, int, Array] | None = None  # t, phase and what is prescribed of the last residuals
        self._linearised: Linearised | None = None

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
        if (t, phase) not in self._prescribed:
            if len(self._prescribed) >= CACHED_INSTANTS:
                self._prescribed.clear()
            self._prescribed[t, phase] = self._compute_prescribed(t, phase)
        return self._prescribed[t, phase].copy()

    def _compute_prescribed(self, t: float, phase: int) -> Array:
        line = self.line
        layout = self.layout
        Z = np.zeros((3, layout.size))
        for k, contact in enumerate(line.contacts_and_wheels):
            if isinstance(contact, Contact):
                Z[0, layout.x[k]], Z[0, layout.y[k]] = contact.point
        for k, body in self.cars.items():
            car = body.car
            front = self.travel_contact[k]
            if car.travel is not None:
                at = layout.x if car.drive_kind == "haul_x" else layout.s
                Z[:, at[front]] = line.prescribed_position_with_rates(car, t, phase)
            else:
                Z[0, layout.s[front]] = car.drive.start
                Z[2, layout.F[k]] = line.thrust(car, t, phase)
        Z[0, layout.s[-1]] = line.rope.length or 0.0
        return Z

    def coordinates_with_rates(self, x: State) -> Array:
        """All coordinates of a state with their rates (3, layout.size)."""
        return self._set_unknown_and_dependent_coordinates(self.prescribed_coordinates(x.t, x.phase), x.q, x.v, x.a)

    def _set_unknown_and_dependent_coordinates(self, Z: Array, q: Array, v: Array, a: Array) -> Array:
        """Set the unknowns in Z (3, ..., layout.size), and what follows from them; return Z."""
        Z[..., self.equations.free] = q, v, a
        self.layout.set_dependent_coordinates(Z)
        return Z

    def frictions_at(self, t: Array | float) -> list[Friction]:
        """Friction at all contacts at the time or times t."""
        present = list(self.frictions)
        for k, body in self.free_cars.items():
            drive = body.car.drive
            fractions = [drive.remaining_hold_fraction(at) for at in np.ravel(t).tolist()]
            hold = self.holds[k] * np.reshape(fractions, np.shape(t))
            present[k] = present[k]._replace(hold=hold)
        return present

    # --- the system --------------------------------------------------------------------------------------------------
    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        return self.residuals(np.array([t]), q[None], v[None], a[None], phase)[0]

    def residuals(self, t: Array, q: Array, v: Array, a: Array, phase: int) -> Array:
        Z = self._prescribed_at_times(t, phase)  # (3, n, layout.size)
        Z = self._set_unknown_and_dependent_coordinates(Z, q, v, a)
        s = Z[0][:, self.layout.s]
        if not (s[:, 1:] > s[:, :-1]).all():
            return np.full(q.shape, np.nan)
        rope = Rope(self.layout, Z)
        contact_values = self.equations.contact_values(rope, Z)
        self._last_balance = Balance(t.item(-1), a[-1], rope.tensions.N[-1], contact_values[-1])
        r = self.equations.residual(rope, contact_values, self.frictions_at(t))
        for car in self._acting_off_rope:
            car.complete_residuals(car.contact_state(t, Z, phase), r)
        r[:, self._sticking_rows] = 0.0
        return r

    def _prescribed_at_times(self, t: Array, phase: int) -> Array:
        """Prescribed coordinates (3, n, layout.size), kept for the same array t: residuals of a step have the same."""
        last = self._instants
        if last is None or last[0] is not t or last[1] != phase:
            prescribed = [self.prescribed_coordinates(at, phase) for at in t.tolist()]
            last = self._instants = t, phase, np.stack(prescribed, axis=1)
        return last[2].copy()

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        state = np.array([q, v, a])
        last = self._linearised
        if last is None or (last.t, last.phase) != (t, phase) or not np.array_equal(last.state, state):
            r, K = self._residual_and_derivatives(State(t, q, v, a, phase))
            last = Linearised(state, t, phase, r, K)
            self._linearised = last
        c0, c1, c2 = c
        by_q, by_v, by_a = last.K
        return last.r, overwriting_lu_solver_or_nan(c0 * by_q + c1 * by_v + c2 * by_a)

    def _residual_and_derivatives(self, x: State) -> tuple[Array, Array]:
        """The residual, and its derivatives (3, n_dof, n_dof) by q, v, a."""
        Z = self.coordinates_with_rates(x)
        r, K = self.equations.residual_and_derivatives(Z, self.frictions_at(x.t))
        for car in self._acting_off_rope:
            state = car.contact_state(np.array([x.t]), Z[:, None], x.phase)
            car.complete_residuals(state, r[None])
            car.complete_derivatives(state, K)
        for row in self._sticking_rows:  # s.. = 0, exactly: its column has no part in the rest
            r[row] = 0.0
            K[:, row] = K[:, :, row] = 0.0
            K[2, row, row] = 1.0
        return r, K

    def start(self, phase: int, state: State | None) -> State:
        if state is not None:
            state = state._replace(phase=phase)
            self.begin_step(state)
            return self.with_acceleration(state)
        rest = coordinates_at_rest(self)
        rope = Rope(self.layout, rest)
        contact_values = self.held_equations.contact_values(rope, rest)
        self._require_taut_rope_on_saddles(rope.tensions.N, contact_values)
        for k in self.free_cars:
            self._set_release_friction_or_raise(k, rest, contact_values)
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

    def _require_taut_rope_on_saddles(self, N: Array, contact_values: Array) -> None:
        """StepFailure where the rope at rest is slack or lifts off a saddle."""
        tension, *pressures = self._min_tension_and_saddle_pressures(N, contact_values)
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
        Z = self.coordinates_with_rates(x)
        layout = self.layout
        for k, body in self.cars.items():
            if body.car.name == name:
                return Z[:, layout.moving[k, :2]]
        at = self.off_rope[name].contact_state(np.array([x.t]), Z[:, None], x.phase)
        return np.stack([at.p[0], at.dp[0], at.ddp[0]])

    # --- friction: a car is named by its contact k, of two wheels the rear one ----------------------------------------
    def begin_step(self, x: State) -> None:
        """Keep the direction of friction, and the brakes that act, for one step."""
        Z = self.coordinates_with_rates(x)
        for k, body in self.cars.items():
            if not body.car.drive.has_friction_or_brakes or body.car.rail is not None:  # a shoe has no friction
                continue
            at = self.layout.s[self.travel_contact[k]]
            s = float(Z[0, at])
            ds = Z[1, at]
            sign = self.frictions[k].sign
            if k not in self.free_cars:
                sign = self.line.travel_direction(body.car, x.phase)
            elif abs(ds) > TURNING:
                sign = float(np.sign(ds))
            self._set_friction(k, s, sign)

    def _set_friction(self, k: int, s: float, sign: float) -> None:
        """Set friction and brakes of a car at s against a motion of this sign; 0: they hold it."""
        body = self.cars[k]
        self.frictions[k] = Friction(body.car.drive.mu_r, body.brake_forces_of_wheels(s), sign)
        self._linearised = None

    def _set_release_friction_or_raise(self, k: int, Z: Array, contact_values: Array) -> None:
        """Let a free car at rest go; StepFailure if friction holds it."""
        body = self.cars[k].copy_held_without_drag()
        state = self.held_equations.contact_state(contact_values, k)
        cos_phi = float(body.wheel_states(state)[-1].cos_phi)
        drive = body.car.drive
        thrust = self.line.thrust(body.car, 0.0, 0) * math.cos(drive.thrust_angle)
        self.holds[k] = float(body.tangential_force_on_last_wheel(state)) / cos_phi
        needed = self.holds[k] - thrust / cos_phi
        s = float(Z[0, self.layout.s[self.travel_contact[k]]])
        self._set_friction(k, s, -float(np.sign(needed)))
        available = body.max_friction_plus_brake_force(state, self.frictions[k])
        if drive.has_friction_or_brakes and abs(needed) <= available:
            raise StepFailure(0.0, f"friction or brakes hold {body.car.name} where it begins", "begin on steeper rope")

    def _sticks(self, k: int) -> bool:
        """Whether friction holds a car."""
        return self.frictions[k].sign == 0.0

    @property
    def _sticking_rows(self) -> list[int]:
        """Rows of s of the cars that friction holds."""
        return [self._row_of_travel(k) for k in self.watched.stops if self._sticks(k)]

    def _row_of_travel(self, k: int) -> int:
        """Row of s of a free car."""
        coordinate = self.layout.s[self.travel_contact[k]]
        return int(np.flatnonzero(self.equations.free == coordinate)[0])

    def _needed_friction(self, k: int, t: float, contact_values: Array) -> float:
        """Force [N] along the rope that friction and brakes give a car which sticks, at its last wheel."""
        body = self.cars[k]
        state = self.equations.contact_state(contact_values, k)
        last_wheel = body.wheel_states(state)[-1]
        needed = body.tangential_force_on_last_wheel(state) / last_wheel.cos_phi
        return float(needed - self.frictions_at(t)[k].hold)

    def _friction_margin(self, k: int, t: float, contact_values: Array) -> float:
        """What friction and brakes could give a car which sticks, less what they give [N]; inf while it slips."""
        if not self._sticks(k):
            return math.inf
        state = self.equations.contact_state(contact_values, k)
        available = self.cars[k].max_friction_plus_brake_force(state, self.frictions[k])
        return available - abs(self._needed_friction(k, t, contact_values))

    def _stick_or_slip_from_rest(self, k: int, x: State) -> State:
        """The state after a standstill: friction holds the car, or it slips."""
        held = self._set_slip_return_state(k, x, 0.0)
        margin = self._friction_margin(k, held.t, self._contact_values_of(held))
        return held if margin > 0.0 else self._start_slipping(k, held)

    def _start_slipping(self, k: int, x: State) -> State:
        """The state in which a car that sticks gives way to what pulls it."""
        pulled = -self._needed_friction(k, x.t, self._contact_values_of(x))
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

    def _contact_values_of(self, x: State) -> Array:
        Z = self.coordinates_with_rates(x)
        return self.equations.contact_values(Rope(self.layout, Z), Z)

    # --- events ------------------------------------------------------------------------------------------------------
    def event_values(self, x: State) -> tuple[float, ...]:
        Z = self.coordinates_with_rates(x)
        watched = self.watched
        s, ds = Z[:2, self.layout.s].tolist()
        gaps = [s[i + 1] - s[i] - NEAREST for i in watched.gaps]
        speeds = []
        for k in watched.stops:
            slip = ds[self.travel_contact[k]] * self.frictions[k].sign
            speeds.append(math.inf if self._sticks(k) else slip)
        to_brakes = [position - s[self.travel_contact[k]] for k, position in watched.brakes]
        forces = self._force_event_values(x, Z, contacts_in_order=min(gaps, default=1.0) > 0.0)
        passing = []
        for passage in watched.passages:
            position, speed = self.car_point_and_rates(passage.car, x)[:2, 0].tolist()
            passing.append(passage.distance_to_go(position, speed))
        return *gaps, *speeds, *to_brakes, *forces, *passing

    def _force_event_values(self, x: State, Z: Array, contacts_in_order: bool) -> list[float]:
        """Loads of wheels, tension of the rope, pressures on saddles, margins of friction [N]; stored for one state."""
        watched = self.watched
        if not contacts_in_order:
            wheels = sum(body.contacts for body in self.cars.values())
            return [math.inf] * (wheels + 1 + len(watched.saddles) + len(watched.stops))
        if self._force_events[0] is not x:
            N, contact_values = self._tensions_and_contact_values(x, Z)
            loads = [self._watched_wheel_loads(k, contact_values) for k in self.cars]
            margins = [self._friction_margin(k, x.t, contact_values) for k in watched.stops]
            of_rope = self._min_tension_and_saddle_pressures(N, contact_values)
            values = np.concatenate([*loads, of_rope, margins])
            self._force_events = x, values.tolist()
        return self._force_events[1]

    def _watched_wheel_loads(self, k: int, contact_values: Array) -> Array:
        """Loads (wheels,) [N] of a car; inf on a shoe, which a car does not leave."""
        body = self.cars[k]
        if body.car.rail is not None:
            return np.array([math.inf])
        state = self.equations.contact_state(contact_values, k)
        return body.normal_wheel_loads(state)

    def _tensions_and_contact_values(self, x: State, Z: Array) -> tuple[Array, Array]:
        """Tensions (S, G) and contact values of x; at the end of a step those of its residual."""
        last = self._last_balance
        if last is None or last.t != x.t or not np.array_equal(last.a, x.a):
            rope = Rope(self.layout, Z)
            return rope.tensions.N, self.equations.contact_values(rope, Z)
        return last.N, last.contact_values

    def _min_tension_and_saddle_pressures(self, N: Array, contact_values: Array) -> list[float]:
        """The smallest mean of the tensions (S, G) over a shortest wave, and the rope's force down on each saddle [N].

        EA multiplies the error of a strain: at a point a coarse sum of sines may be compressed where the rope is taut.
        """
        down = contact_values[:, 3] - contact_values[:, 1]
        pressures = down[self.watched.saddles].tolist()
        means = N[self.layout.outer] @ self.layout.tables.means.T  # (S, P)
        return [float(means.min()), *pressures]

    def apply_event(self, name: str, x: State) -> State | None:
        """A car that friction cannot hold goes on, and so does one that reaches a brake; else the run ends."""
        for k in self.watched.stops:
            car = self.cars[k].car.name
            if name == f"{car} stops":
                after = self._stick_or_slip_from_rest(k, x)
                return after if self._run_goes_on(x) else None
            if name == f"{car} breaks loose":
                return self._start_slipping(k, x)
            if name == f"{car} brakes":
                self.begin_step(x)
                return self.with_acceleration(x)
        return None

    def _run_goes_on(self, x: State) -> bool:
        """Whether a free car rolls, or one has a timetable or forces that go on to change."""
        sticking = [k for k in self.watched.stops if self._sticks(k)]
        rolling = len(sticking) < len(self.free_cars)
        return rolling or self.line.travel_or_force_changes_after(x.t, x.phase)

    def system_after(self, event: str, x: State) -> tuple[LineSines, State] | None:
        """The line after a car passes an end of a shoe, and its state; None if another event has ended the run."""
        for passage in self.watched.passages:
            if str(passage) == event:
                from galerkin.carrying import system_after_passage

                return system_after_passage(self, passage, x)
        return None
