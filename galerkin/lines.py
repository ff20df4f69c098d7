"""A line in motion by sines: unknowns, rows, start at rest and events; see README.md, "A line in motion"."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cablefem.motion import LineMotion
from cablefem.newmark import Solve, State, StepFailure, System
from cablefem.scene.contacts import (
    NEAREST,
    Array,
    Car,
    Contact,
    MovingLine,
    Wheel,
    lift_off_event_name,
    meeting_event_name,
)
from cablefem.shoes import passage_exists_between, possible_passages
from galerkin.bodies import Body, CarBody, ContactState, Counterweight, Friction, PointCar, Saddle, Spring, dot
from galerkin.equations import lu_solver_overwriting
from galerkin.line_observe import observe
from galerkin.segments import Layout, Rope, Softness
from galerkin.trolley import Trolley, rotate

SAG = 0.02  # of the first guess, over the chord
ITERATIONS = 100  # of the search for rest
TOL = 1e-11  # of EA
SOFTENED = 4  # steps from a soft rope to the stiff one
TURNING = 1e-9  # [m/s] slower cars keep the direction of their friction
CACHED_INSTANTS = 8  # instants whose prescribed coordinates are kept: a step's nodes are evaluated several times
NUDGE = 1e-4  # [s] for the velocity of a line that starts in motion


def body_of(line: MovingLine, contact: Contact | Car | Wheel) -> Body:
    """What a contact is tied to; a car on two wheels stands at the rear one."""
    if isinstance(contact, Wheel):
        return Body() if contact.front else Trolley(contact.car, line)
    if isinstance(contact, Car):
        return PointCar(contact, line)
    if contact.kind == "counterweight":
        return Counterweight(contact, 1.0 if contact is line.contacts[-1] else -1.0, line)
    if contact.kind == "spring":
        return Spring(contact)
    return Saddle() if contact.kind == "saddle" else Body()


class Equations:
    """Rows of a line, one for each unknown."""

    def __init__(self, layout: Layout, bodies: Sequence[Body]) -> None:
        self.layout, self.bodies = layout, bodies
        x, y, t, u, v = layout.moving.T
        at = {"x": x, "y": y, "t": t, "u": u, "v": v, "s": layout.s, "S": np.roll(layout.s, -1), "F": layout.F}
        ends = [at[name][k] for k, body in enumerate(bodies) for name in body.unknown]
        # coordinates of the unknowns; the rows of the last ones are set by `LineSines`
        self.free = np.array([*layout.shapes, *ends, *layout.angle_off_rope.values()])
        self.forces = np.isin(self.free, layout.F)
        self.size = self.free.size
        # columns of coordinates: unknowns; those that follow and the last, of known ones, are cut off
        following = [i for follower in layout.followers for i in follower.p]
        last = self.size + len(following)
        self._column = np.full(layout.size, last)
        self._column[[*self.free, *following]] = np.arange(last)
        self._tangent = np.zeros((3, self.size, last + 1))

    def contact_values(self, rope: Rope, Z: Array) -> Array:
        """The values of `ContactState` at all contacts (..., contacts, 26)."""
        layout = self.layout
        x = np.zeros((*Z.shape[1:-1], layout.contacts, ContactState.size))
        x[..., 1:, 0:2], x[..., :-1, 2:4] = rope.rows[..., -1, :], -rope.rows[..., -2, :]
        x[..., 1:, 4:6], x[..., :-1, 6:8] = rope.end_slopes[..., 1, :], rope.end_slopes[..., 0, :]
        for order in range(3):
            x[..., 8 + 5 * order : 13 + 5 * order] = Z[order][..., layout.moving]
        x[..., 23], x[..., 24], x[..., 25] = Z[1][..., layout.s], Z[2][..., layout.s], Z[2][..., layout.F]
        return x

    def contact_state(self, contact_values: Array, k: int) -> Any:
        """What acts on the body at contact k, as its equations take it."""
        body = self.bodies[k]
        return body.state_from_values(contact_values[..., k : k + body.contacts, :])

    def residual(self, rope: Rope, contact_values: Array, frictions: Sequence[Friction]) -> Array:
        """The rows (..., n) of a rope with the values of its contacts."""
        ends = [
            body.balance_rows(self.contact_state(contact_values, k), frictions[k])
            for k, body in enumerate(self.bodies)
            if body.unknown
        ]
        inner = rope.rows[..., :-2, :].reshape(*contact_values.shape[:-2], self.layout.inner)[..., self.layout.shapes]
        off_rope = np.zeros((*inner.shape[:-1], len(self.layout.angle_off_rope)))
        return np.concatenate([inner, *ends, off_rope], axis=-1)

    def linearise(self, Z: Array, frictions: Sequence[Friction]) -> tuple[Array, Array]:
        """The residual, and its derivatives (3, n, n) by unknowns, their velocities and accelerations.

        The next call overwrites the derivatives.
        """
        rope, layout = Rope(self.layout, Z), self.layout
        of_rows, of_slopes = rope.fill_row_derivatives(), rope.end_slope_derivatives
        K = self._tangent
        K[:] = 0.0
        r = np.zeros(self.size)
        r[: layout.shapes.size] = rope.rows[:, :-2].ravel()[layout.shapes]
        at = self._column[layout.columns]
        row = 0
        for i, shapes in enumerate(layout.functions_of):
            block = of_rows[:, i, :-2].reshape(3, 2 * layout.functions, -1)[:, shapes]
            K[:, row : row + block.shape[1], at[i]] = block
            row += block.shape[1]
        x = self.contact_values(rope, Z)
        for k, body in enumerate(self.bodies):
            if not body.unknown:
                continue
            rows = slice(row, row + len(body.unknown))
            r[rows] = body.balance_rows(self.contact_state(x, k), frictions[k])
            derivatives = body.row_derivatives(x[k : k + body.contacts], frictions[k])
            here = K[:, rows]
            for j in range(k, k + body.contacts):
                by = derivatives[:, j - k]  # by the values of `ContactState`, (rows, 26)
                if j > 0:
                    here[:, :, at[j - 1]] += by[:, 0:2] @ of_rows[:, j - 1, -1]
                    here[0][:, at[j - 1]] += by[:, 4:6] @ of_slopes[j - 1, 1]
                if j < layout.segments:
                    here[:, :, at[j]] -= by[:, 2:4] @ of_rows[:, j, -2]
                    here[0][:, at[j]] += by[:, 6:8] @ of_slopes[j, 0]
                for order in range(3):
                    here[order][:, self._column[layout.moving[j]]] += by[:, 8 + 5 * order : 13 + 5 * order]
                here[1:, :, self._column[layout.s[j]]] += by[:, 23:25].T
                here[2, :, self._column[layout.F[j]]] += by[:, 25]
            row = rows.stop
        for follower in reversed(layout.followers):
            follower.fold_derivatives(K, Z, self._column)
        return r, K[:, :, : self.size]


class CarOffRope(NamedTuple):
    """A car off the rope."""

    body: PointCar
    saddle: int | None  # row of s of the saddle, on which its grip acts
    angle: int | None  # row of the angle of its cabin


class LineSines(System):
    """A line in motion, in SI.  The acceleration of a hauled car's last unknown is the haul force."""

    reuses_factors = True

    def __init__(self, line: MovingLine, terms: int) -> None:
        self.line, self.layout, self.phases = line, Layout(line, terms), line.phases
        bodies = [body_of(line, contact) for contact in line.contacts_and_wheels]
        self.cars = {k: body for k, body in enumerate(bodies) if isinstance(body, CarBody)}
        self.travel_contact = {
            k: k + body.contacts - 1 for k, body in self.cars.items()
        }  # contact that the travel is of
        self.free_cars = {k: body for k, body in self.cars.items() if body.car.drive_kind == "free"}
        self.equations = Equations(self.layout, bodies)
        self.held_equations = Equations(
            self.layout, [body.held_copy() if isinstance(body, CarBody) else body for body in bodies]
        )
        self.n_dof = self.equations.size
        self.force_scale = max(
            (line.gravity * car.mass for car in line.cars), default=line.weight_per_length * self._line_length
        )
        self.force_floor = 16.0 * sys.float_info.epsilon * line.rope.EA
        self.frictions = [Friction() for _ in bodies]
        self.holds = dict.fromkeys(self.free_cars, 0.0)  # [N] on free cars before they are released
        self._name_events(bodies)
        self._prescribed: dict[tuple[float, int], Array] = {}
        self._loaded: tuple[State | None, list[float]] = (None, [])  # of the last state that was watched
        # t, a, tensions of the rope and contact values at the last instant of the last residuals
        self._last: tuple[float, Array, Array, Array] | None = None
        self._instants: tuple[Array, int, Array] | None = None  # t, phase and what is prescribed of the last residuals
        self._linearised: tuple[Array, float, int, Array, Array] | None = None
        rows = {int(at): row for row, at in enumerate(self.equations.free)}
        self.off_rope = {
            car.name: CarOffRope(
                PointCar(car, line),
                rows[int(self.layout.s[self.below[car.name]])] if car.drive_kind == "grip" else None,
                rows[self.layout.angle_off_rope[car.name]] if car.hanger is not None else None,
            )
            for car in line.over
        }
        acting = [x for x in self.off_rope.values() if x.saddle is not None or x.angle is not None]
        self._acting_off_rope = acting  # with a row of theirs

    def _name_events(self, bodies: list[Body]) -> None:
        """Set the events, and what each kind of them watches."""
        names = [c.name for c in self.line.contacts_and_wheels]
        touching = self.line.contacts_and_wheels
        self.passages = possible_passages(self.line)
        pairs = [i for i in self.layout.outer if i in self.travel_contact.values() or i + 1 in self.cars]
        self.gaps = [i for i in pairs if not passage_exists_between(self.passages, names[i], names[i + 1])]
        meetings = [meeting_event_name(touching[i], touching[i + 1]) for i in self.gaps]
        self._set_stops_and_brakes()
        stops = [f"{self.cars[k].car.name} stops" for k in self.stops]
        brakes = [f"{self.cars[k].car.name} brakes" for k, _ in self.brakes]
        lifted = [lift_off_event_name(c) for c in touching if not isinstance(c, Contact)]
        self.saddles = [k for k, body in enumerate(bodies) if isinstance(body, Saddle)]
        self.rope_events = ["rope falls slack", *(f"rope lifts off {names[k]}" for k in self.saddles)]
        loose = [f"{self.cars[k].car.name} breaks loose" for k in self.stops]
        self.events = (*meetings, *stops, *brakes, *lifted, *self.rope_events, *loose, *map(str, self.passages))
        self.below = {car.name: names.index(car.rail.saddle) for car in self.line.over if car.rail is not None}

    def _set_stops_and_brakes(self) -> None:
        """Set the free cars that may stop, and the positions where their brakes begin."""
        self.stops = [k for k, body in self.free_cars.items() if body.car.drive.has_friction_or_brakes]
        self.brakes = [(k, position) for k in self.stops for position, _ in self.cars[k].car.drive.brakes]

    @property
    def _line_length(self) -> float:
        points = np.array([c.point for c in self.line.supports])
        return float(np.hypot(*np.diff(points, axis=0).T).sum())

    # --- coordinates -------------------------------------------------------------------------------------------------
    def prescribed(self, t: float, phase: int) -> Array:
        """Jets of all coordinates (3, layout.size), zero where unknown."""
        if (t, phase) not in self._prescribed:
            if len(self._prescribed) >= CACHED_INSTANTS:
                self._prescribed.clear()
            self._prescribed[t, phase] = self._prescribe(t, phase)
        return self._prescribed[t, phase].copy()

    def _prescribe(self, t: float, phase: int) -> Array:
        line, layout = self.line, self.layout
        Z = np.zeros((3, layout.size))
        for k, contact in enumerate(line.contacts_and_wheels):
            if isinstance(contact, Contact):
                Z[0, layout.x[k]], Z[0, layout.y[k]] = contact.point
        for k, body in self.cars.items():
            car, lead = body.car, self.travel_contact[k]
            if car.travel is not None:
                at = layout.x if car.drive_kind == "haul_x" else layout.s
                Z[:, at[lead]] = line.position_with_rates(car, t, phase)
            else:
                Z[0, layout.s[lead]] = car.drive.start
                Z[2, layout.F[k]] = line.thrust(car, t, phase)
        Z[0, layout.s[-1]] = line.rope.length or 0.0
        return Z

    def coordinates_with_rates(self, x: State) -> Array:
        """All coordinates of a state with their rates (3, layout.size)."""
        return self._with_unknowns(self.prescribed(x.t, x.phase), x.q, x.v, x.a)

    def _with_unknowns(self, Z: Array, q: Array, v: Array, a: Array) -> Array:
        """Z with the unknowns, and what follows from them."""
        Z[..., self.equations.free] = q, v, a
        self.layout.set_followers(Z)
        return Z

    def frictions_at(self, t: Array | float) -> list[Friction]:
        """Friction at all contacts at the time or times t."""
        present = list(self.frictions)
        for k, body in self.free_cars.items():
            hold = np.array([body.car.drive.remaining_hold_fraction(at) for at in np.ravel(t).tolist()]).reshape(
                np.shape(t)
            )
            present[k] = present[k]._replace(hold=self.holds[k] * hold)
        return present

    # --- the system --------------------------------------------------------------------------------------------------
    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        return self.residuals(np.array([t]), q[None], v[None], a[None], phase)[0]

    def residuals(self, t: Array, q: Array, v: Array, a: Array, phase: int) -> Array:
        instants = self._instants
        if instants is None or instants[0] is not t or instants[1] != phase:
            prescribed = np.stack([self.prescribed(at, phase) for at in t.tolist()], axis=1)
            instants = self._instants = t, phase, prescribed  # the same for all residuals of a step
        Z = instants[2].copy()  # (3, n, layout.size)
        s = self._with_unknowns(Z, q, v, a)[0][:, self.layout.s]
        if not (s[:, 1:] > s[:, :-1]).all():
            return np.full(q.shape, np.nan)
        rope = Rope(self.layout, Z)
        contact_values = self.equations.contact_values(rope, Z)
        self._last = t.item(-1), a[-1], rope.law.N[-1], contact_values[-1]
        r = self.equations.residual(rope, contact_values, self.frictions_at(t))
        for body, saddle, angle in self._acting_off_rope:
            x = self.state_off_rope(body.car, t, Z, phase)
            if saddle is not None:
                r[:, saddle] -= dot(body.contact_force(x), x.tau)
            if angle is not None:
                r[:, angle] = body.swing_row(x)[:, 0]
        r[:, self._sticking] = 0.0
        return r

    def state_off_rope(self, car: Car, t: Array, Z: Array, phase: int) -> ContactState:
        """What the body of a car off the rope takes, at the times t (n,), from Z (3, n, layout.size)."""
        assert car.rail is not None
        flow = Z[:, :, self.layout.s[self.below[car.name]]].T
        points = [
            self.line.point_with_rates_off_rope(car, at, phase, s) for at, s in zip(t.tolist(), flow, strict=True)
        ]
        x = np.zeros((t.size, ContactState.size))
        x[:, [4, 6]] = 1.0  # the rail in the place of the rope
        for order, point in enumerate(np.swapaxes(points, 0, 1)):
            x[:, 8 + 5 * order : 10 + 5 * order] = point
            if car.hanger is not None:
                x[:, 10 + 5 * order] = Z[order][:, self.layout.angle_off_rope[car.name]]
        x[:, [5, 7]] = car.rail.depth_with_derivatives(x[:, 8])[1][:, None]
        return ContactState(x)

    def _add_cars_off_rope(self, t: float, Z: Array, phase: int, r: Array, K: Array) -> None:
        """Add cars off the rope to the residual and its derivatives; drag and motion of their points change little."""
        for body, saddle, angle in self._acting_off_rope:
            x = self.state_off_rope(body.car, np.array([t]), Z[:, None], phase)
            stretch = body.car.rail.stretch if body.car.rail is not None else 1.0
            if saddle is not None:
                r[saddle] -= dot(body.contact_force(x), x.tau).item()
                K[2, saddle, saddle] += body.car.mass * stretch
            if angle is not None:
                r[angle] = body.swing_row(x).item()
                weight = body.m * body.h * self.line.gravity * math.cos(x.angle.item())
                K[:, angle, angle] = weight, body.damping, body.about_hanger
            if saddle is not None and angle is not None:
                K[2, saddle, angle] = -body.m * body.h * dot(body.axes(x)[0], x.tau).item()
                K[2, angle, saddle] = stretch * K[2, saddle, angle]

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, *c: complex) -> tuple[Array, Solve]:
        state = np.array([q, v, a])
        linearised = self._linearised
        if linearised is None or linearised[1:3] != (t, phase) or not np.array_equal(linearised[0], state):
            Z = self.coordinates_with_rates(State(t, q, v, a, phase))
            r, K = self.equations.linearise(Z, self.frictions_at(t))
            self._add_cars_off_rope(t, Z, phase, r, K)
            for row in self._sticking:  # s.. = 0, exactly: its column has no part in the rest
                r[row] = 0.0
                K[:, row] = K[:, :, row] = 0.0
                K[2, row, row] = 1.0
            linearised = self._linearised = (state, t, phase, r, K)
        c0, c1, c2 = c
        by_q, by_v, by_a = linearised[4]
        return linearised[3], lu_solver_overwriting(c0 * by_q + c1 * by_v + c2 * by_a)

    def begin_step(self, x: State) -> None:
        """Keep the direction of friction, and the brakes that act, for one step."""
        Z = self.coordinates_with_rates(x)
        for k, body in self.cars.items():
            if not body.car.drive.has_friction_or_brakes or body.car.rail is not None:  # a shoe has no friction
                continue
            ds, sign = Z[1, self.layout.s[self.travel_contact[k]]], self.frictions[k].sign
            if k not in self.free_cars:
                sign = self.line.travel_direction(body.car, x.phase)
            elif abs(ds) > TURNING:
                sign = float(np.sign(ds))
            self._set_friction(k, float(Z[0, self.layout.s[self.travel_contact[k]]]), sign)

    def _sticks(self, k: int) -> bool:
        """Whether friction holds a car."""
        return self.frictions[k].sign == 0.0

    @property
    def _sticking(self) -> list[int]:
        """Rows of s of the cars that friction holds."""
        return [self._row_of_travel(k) for k in self.stops if self._sticks(k)]

    def _row_of_travel(self, k: int) -> int:
        """Row of s of a free car."""
        return int(np.flatnonzero(self.equations.free == self.layout.s[self.travel_contact[k]])[0])

    def _set_friction(self, k: int, s: float, sign: float) -> None:
        body = self.cars[k]
        self.frictions[k] = Friction(body.car.drive.mu_r, body.brake_forces_by_wheel(s), sign)
        self._linearised = None

    def _balance_at(self, x: State, Z: Array) -> tuple[Array, Array]:
        """Tensions (S, G) and contact values of x; at the end of a step those of its residual."""
        last = self._last
        if last is None or last[0] != x.t or not np.array_equal(last[1], x.a):
            rope = Rope(self.layout, Z)
            return rope.law.N, self.equations.contact_values(rope, Z)
        return last[2:]

    def event_values(self, x: State) -> tuple[float, ...]:
        Z = self.coordinates_with_rates(x)
        s, ds = Z[0, self.layout.s], Z[1, self.layout.s]
        gaps = [float(s[i + 1] - s[i]) - NEAREST for i in self.gaps]
        slips = [float(ds[self.travel_contact[k]]) * self.frictions[k].sign for k in self.stops]
        speeds = [math.inf if self._sticks(k) else slip for k, slip in zip(self.stops, slips, strict=True)]
        ahead = [position - float(s[self.travel_contact[k]]) for k, position in self.brakes]
        wheels = sum(body.contacts for body in self.cars.values())
        loads = [math.inf] * (wheels + len(self.rope_events) + len(self.stops))
        if min(gaps, default=1.0) > 0.0:
            if self._loaded[0] is not x:
                N, contact_values = self._balance_at(x, Z)
                pressing = []
                for k, body in self.cars.items():
                    state = self.equations.contact_state(contact_values, k)
                    pressing.append(np.array([math.inf]) if body.car.rail else body.wheel_loads(state))
                margins = [self._friction_margin(k, x.t, contact_values) for k in self.stops]
                of_rope = self._tension_and_pressures(N, contact_values)
                self._loaded = x, np.concatenate([*pressing, of_rope, margins]).tolist()
            loads = self._loaded[1]
        passing = [p.distance_to_go(*self.car_point_and_rates(p.car, x)[:2, 0].tolist()) for p in self.passages]
        return (*gaps, *speeds, *ahead, *loads, *passing)

    def _tension_and_pressures(self, N: Array, contact_values: Array) -> list[float]:
        """The smallest of the tensions (S, G), and the force of the rope down on each saddle [N]."""
        down = contact_values[:, 3] - contact_values[:, 1]
        return [float(N[self.layout.outer].min()), *(float(down[k]) for k in self.saddles)]

    def apply_event(self, name: str, x: State) -> State | None:
        """A car that friction cannot hold goes on, and so does one that reaches a brake; else the run ends."""
        for k in self.stops:
            car = self.cars[k].car.name
            if name == f"{car} stops":
                after = self._come_to_rest(k, x)
                return after if self._goes_on(x) else None
            if name == f"{car} breaks loose":
                return self._start_slipping(k, x)
            if name == f"{car} brakes":
                self.begin_step(x)
                return self.with_acceleration(x)
        return None

    def system_after(self, name: str, x: State) -> tuple[LineSines, State] | None:
        """The line after a car passes an end of a shoe, and its state; None if another event has ended the run."""
        for passage in self.passages:
            if str(passage) == name:
                from galerkin.carrying import system_after_passage

                return system_after_passage(self, passage, x)
        return None

    def car_point_and_rates(self, name: str, x: State) -> Array:
        """Point of a car on one contact, or off the rope, with its rates (3, 2)."""
        Z, layout = self.coordinates_with_rates(x), self.layout
        for k, body in self.cars.items():
            if body.car.name == name:
                return Z[:, [layout.x[k], layout.y[k]]]
        at = self.state_off_rope(self.off_rope[name].body.car, np.array([x.t]), Z[:, None], x.phase)
        return np.stack([at.p[0], at.dp[0], at.ddp[0]])

    def _goes_on(self, x: State) -> bool:
        """Whether a free car rolls, or one has a timetable or forces that go on to change."""
        rolling = any(k not in self.stops or not self._sticks(k) for k in self.free_cars)
        return rolling or self.line.travel_or_force_changes_after(x.t, x.phase)

    def _come_to_rest(self, k: int, x: State) -> State:
        """The state after a standstill: friction holds the car, or it slips."""
        held = self._state_with_slip(k, x, 0.0)
        contact_values = self._contact_values_of(held)
        if self._friction_margin(k, held.t, contact_values) > 0.0:
            return held
        return self._start_slipping(k, held)

    def _start_slipping(self, k: int, x: State) -> State:
        """The state in which a car that sticks gives way to what pulls it."""
        pulled = -self._needed_friction(k, x.t, self._contact_values_of(x))
        return self._state_with_slip(k, x, math.copysign(1.0, pulled))

    def _state_with_slip(self, k: int, x: State, sign: float) -> State:
        """The state with the car at rest, about to slip by the sign, or to stay for a sign 0."""
        row = self._row_of_travel(k)
        self._set_friction(k, float(x.q[row]), sign)
        v, a = x.v.copy(), x.a.copy()
        v[row], a[row] = sign * 1e-12, 0.0  # [m/s] not 0, else its next standstill is no event
        return self.with_acceleration(x._replace(v=v, a=a))

    def _contact_values_of(self, x: State) -> Array:
        Z = self.coordinates_with_rates(x)
        return self.equations.contact_values(Rope(self.layout, Z), Z)

    def _needed_friction(self, k: int, t: float, contact_values: Array) -> float:
        """Force [N] along the rope that friction and brakes give a car which sticks, at its last wheel."""
        body = self.cars[k]
        state = self.equations.contact_state(contact_values, k)
        given = body.rope_force_along(state) / body.wheels(state)[-1].projection
        return float(given - self.frictions_at(t)[k].hold)

    def _friction_margin(self, k: int, t: float, contact_values: Array) -> float:
        """What friction and brakes could give a car which sticks, less what they give [N]; inf while it slips."""
        if not self._sticks(k):
            return math.inf
        body = self.cars[k]
        loads = body.wheel_loads(self.equations.contact_state(contact_values, k))
        largest = float(body.friction_and_brakes(loads, self.frictions[k]).sum())
        return largest - abs(self._needed_friction(k, t, contact_values))

    def observe(self, states: Sequence[State], s: Array) -> LineMotion:
        """The motion at all states and at the stations s (m,)."""
        return observe(self, states, s)

    # --- start -------------------------------------------------------------------------------------------------------
    def start(self, phase: int, state: State | None) -> State:
        if state is not None:
            state = state._replace(phase=phase)
            self.begin_step(state)
            return self.with_acceleration(state)
        rest = self.coordinates_at_rest()
        rope = Rope(self.layout, rest)
        contact_values = self.held_equations.contact_values(rope, rest)
        slack, *pressures = self._tension_and_pressures(rope.law.N, contact_values)
        if min(slack, *pressures, 0.0) < 0.0:
            lowest = min(pressures, default=0.0)
            cause = (
                f"at rest the smallest tension is {slack:.6g} N and the smallest pressure on a saddle {lowest:.6g} N"
            )
            raise StepFailure(0.0, cause, "tighten the rope")
        for k in self.free_cars:
            self._release(k, rest, contact_values)
        v = np.zeros(self.n_dof)
        moving = self.prescribed(0.0, 0)[1]
        if moving.any():
            near = [self.coordinates_at_rest(dt, start=rest)[0, self.equations.free] for dt in (-NUDGE, NUDGE)]
            v = np.where(self.equations.forces, 0.0, (near[1] - near[0]) / (2.0 * NUDGE))
        free = self.equations.free
        x = State(0.0, np.where(self.equations.forces, 0.0, rest[0, free]), v, rest[2, free], 0)
        self.begin_step(x)
        return self.with_acceleration(x)

    def _release(self, k: int, Z: Array, contact_values: Array) -> None:
        """Let a free car at rest go; StepFailure if friction holds it."""
        body = self.cars[k].held_copy()
        name = body.car.name
        state = self.held_equations.contact_state(contact_values, k)
        projection = float(body.wheels(state)[-1].projection)
        self.holds[k] = float(body.rope_force_along(state)) / projection
        thrust = self.line.thrust(body.car, 0.0, 0) * math.cos(body.car.drive.thrust_angle)
        needed = self.holds[k] - thrust / projection
        self._set_friction(k, float(Z[0, self.layout.s[self.travel_contact[k]]]), -float(np.sign(needed)))
        if body.car.drive.has_friction_or_brakes and abs(needed) <= float(
            body.friction_and_brakes(body.wheel_loads(state), self.frictions[k]).sum()
        ):
            raise StepFailure(0.0, f"friction or brakes hold {name} where it begins", "begin on steeper rope")

    def with_acceleration(self, x: State) -> State:
        """The state with the accelerations that its balance asks for."""
        a = x.a.copy()
        bound = 1e-6 * self.force_scale + math.sqrt(self.n_dof) * self.force_floor
        for _ in range(20):
            r, solve = self.linearise(x.t, x.q, x.v, a, x.phase, 0.0, 0.0, 1.0)
            a = a - solve(r.copy())
            if np.linalg.norm(r) <= bound:
                return State(x.t, x.q, x.v, a, x.phase)
        raise StepFailure(x.t, "no acceleration balances the forces", "start the cars elsewhere")

    # --- rest --------------------------------------------------------------------------------------------------------
    def coordinates_at_rest(self, shift: float = 0.0, start: Array | None = None) -> Array:
        """Coordinates (3, layout.size) of the line at rest, free cars held; F stands in the last row.

        shift : [s] by which the prescribed positions are ahead of the start, at their first speed.
        """
        layout = self.layout
        Z = self.prescribed(0.0, 0)
        Z[0] += shift * Z[1]
        Z[1] = 0.0
        for k in self.free_cars:
            Z[2, layout.F[k]] = 0.0
        Z[2, layout.s] = Z[2, layout.x] = 0.0
        if start is not None:
            return self._solve_rest(Z, start)
        for times in (1.0, 4.0, 0.25):
            try:
                return self._rest_of_stiff_rope(Z, times * self._tension_scale)
            except StepFailure:
                continue
        raise StepFailure(0.0, "no rest of the line was found", "start the cars elsewhere")

    def _rest_of_stiff_rope(self, Z: Array, about: float) -> Array:
        """Rest of a rope that resists changes of its tension little at first."""
        rest = self._first_guess(Z)
        soft = min(1.0, 5.0 * about / self.line.rope.EA)
        for fraction in np.geomspace(soft, 1.0, SOFTENED + 1).tolist():
            self.layout.softness = Softness(about, fraction)
            rest = self._solve_rest(Z, rest)
        return rest

    @property
    def _tension_scale(self) -> float:
        """Order of the tension [N]."""
        line = self.line
        weights = [c.force for c in line.supports if c.force is not None]
        if weights:
            return weights[0]
        return 4.0 * (line.weight_per_length * self._line_length + sum(line.gravity * car.mass for car in line.cars))

    def _solve_rest(self, Z: Array, guess: Array) -> Array:
        """Rest by Newton's method with shorter steps where the residual grows; Z holds what is prescribed."""
        layout, held = self.layout, self.held_equations
        Z = Z.copy()
        values = np.where(held.forces, guess[2, held.free], guess[0, held.free])
        frictions = [Friction() for _ in held.bodies]
        for k, body in self.cars.items():
            if body.car.travel is not None:
                frictions[k] = Friction(body.car.drive.mu_r, sign=self.line.travel_direction(body.car, 0))

        def put(values: Array) -> Array:
            Z[0, held.free] = np.where(held.forces, 0.0, values)
            layout.set_followers(Z)
            Z[2, held.free[held.forces]] = values[held.forces]
            return Z

        def norm(values: Array) -> float:
            if not (np.diff(put(values)[0, layout.s]) > 0.0).all():
                return math.inf
            rope = Rope(layout, Z)
            return float(np.linalg.norm(held.residual(rope, held.contact_values(rope, Z), frictions)))

        before, bound = math.inf, TOL * self.line.rope.EA
        for _ in range(ITERATIONS):
            r, K = held.linearise(put(values), frictions)
            step = np.linalg.solve(np.where(held.forces, K[2], K[0]), r)
            now, fraction = float(np.linalg.norm(r)), 1.0
            if now <= bound and now >= 0.5 * before:
                return put(values)
            while norm(values - fraction * step) > now and now > bound and fraction > 1e-6:
                fraction *= 0.5
            values, before = values - fraction * step, now
        raise StepFailure(0.0, "no rest of the line was found", "start the cars elsewhere")

    def _first_guess(self, Z: Array) -> Array:
        """Chords with a little sag."""
        line, layout = self.line, self.layout
        Z = Z.copy()
        at = [k for k, c in enumerate(line.contacts_and_wheels) if isinstance(c, Contact)]
        points = np.array([c.point for c in line.supports])
        chords = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        kinds = [c.kind for c in line.supports]
        ends = 0.0, chords[-1]
        if "counterweight" not in kinds:
            ends = 0.0, line.rope.length
        elif kinds[0] == "counterweight":
            ends = (line.rope.length or 0.0) - chords[-1], line.rope.length or 0.0
        Z[0, layout.s[at]] = ends[0] + (ends[1] - ends[0]) * chords / chords[-1]
        sags = 4.0 * SAG * np.diff(chords)
        for k, body in self.cars.items():
            lead = self.travel_contact[k]
            i = int(np.searchsorted(at, k)) - 1
            (x, y), way = points[i], points[i + 1] - points[i]
            s = Z[0, layout.s[at[i : i + 2]]]
            if body.car.drive_kind == "haul_x":
                z = (Z[0, layout.x[lead]] - x) / way[0]
                Z[0, layout.s[lead]] = s[0] + z * (s[1] - s[0])
            else:
                z = (Z[0, layout.s[lead]] - s[0]) / (s[1] - s[0])
                Z[0, layout.x[lead]] = x + z * way[0]
            Z[0, layout.y[lead]] = y + z * way[1] + sags[i] * z * (1.0 - z)
            if lead > k:
                front = layout.wheels[lead]
                Z[0, layout.s[k]] = Z[0, layout.s[lead]] - (front.arm[0] - layout.wheels[k].arm[0])
                Z[0, front.pitch] = math.atan2(way[1], way[0])
                Z[0, front.c] = Z[0, front.p] - rotate(front.arm, Z[0, front.pitch, None])
        return Z
