"""A line in motion by sines: unknowns, rows, friction and events; see README.md, "A line in motion"."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from cablefem.line_in_motion import LineInMotion
from cablefem.motion import LineMotion
from cablefem.newmark import (
    ACCELERATION_ONLY,
    Solve,
    State,
    StepFailure,
    StepsWithFactors,
    TangentFactors,
)
from cablefem.scene.contacts import Array, Contact, MovingLine
from cablefem.shoes import Passage
from galerkin import kernels
from galerkin.bodies import CarBody, Friction, Saddle
from galerkin.kernels import LineValues
from galerkin.line_equations import LineEquations, make_body_at_contact
from galerkin.line_observe import observe
from galerkin.line_off_rope import CarOnShoeOffRope
from galerkin.line_rest import chord_lengths, coordinates_at_rest
from galerkin.segments import Layout

NUDGE = 1e-4  # [s] for the velocity of a line that starts in motion
SIGN = Friction._fields.index("sign")
HOLD = Friction._fields.index("hold")


class LineSines(LineInMotion):
    """A line in motion, in SI.  The acceleration of a hauled car's last unknown is the haul force."""

    of_cars = "frictions", "holds", "held_since", "reached"

    def __init__(self, line: MovingLine, terms: int) -> None:
        self.line = line
        self.layout = Layout(line, terms)
        self.phases = line.phases
        bodies = [make_body_at_contact(line, contact) for contact in line.contacts_and_wheels]
        held = [body.copy_held() if isinstance(body, CarBody) else body for body in bodies]
        self.cars = {k: body for k, body in enumerate(bodies) if isinstance(body, CarBody)}
        # contact of each car that its travel is of: the front wheel
        self.travel_contact = {k: k + body.contacts - 1 for k, body in self.cars.items()}
        self.free_cars = {k: body for k, body in self.cars.items() if body.car.drive_mode_or_haul_x == "free"}
        self.equations = LineEquations(self.layout, bodies)
        self.held_equations = LineEquations(self.layout, held)
        self.n_dof = self.equations.size
        weight_of_rope = line.weight_per_length * float(chord_lengths(line).sum())
        self.force_scale = max((line.gravity * car.mass for car in line.cars_on_rope), default=weight_of_rope)
        self.force_floor = 16.0 * sys.float_info.epsilon * line.rope.EA
        self.frictions = np.zeros((len(bodies), len(Friction._fields)))
        self.reached = np.zeros(len(bodies))  # [m] s up to which the brakes of free cars act
        self.holds = np.zeros(len(bodies))  # [N] on free cars before they are released
        self.held_since = np.zeros(len(bodies))  # [s] when friction stopped free cars last
        self.set_watched_events({k: body.car for k, body in self.cars.items()})
        self.saddles = [k for k, body in enumerate(bodies) if isinstance(body, Saddle)]
        self.off_rope = self._cars_off_rope()
        self._acting_off_rope = [car for car in self.off_rope.values() if car.acts_in_rows]
        self.many_steps = not self._acting_off_rope
        self._fixed_coordinates = self._coordinates_of_supports()

    def _cars_off_rope(self) -> dict[str, CarOnShoeOffRope]:
        """Cars off the rope by name."""
        contacts = {contact.name: k for k, contact in enumerate(self.line.contacts_and_wheels)}
        rows = {coordinate: row for row, coordinate in enumerate(self.equations.free.tolist())}
        cars = {}
        for car in self.line.cars_off_rope:
            if car.rail is not None:
                saddle = contacts[car.rail.saddle]
                cars[car.name] = CarOnShoeOffRope(self.line, car, self.layout, saddle, rows)
        return cars

    # --- coordinates -------------------------------------------------------------------------------------------------
    def _coordinates_of_supports(self) -> Array:
        """What supports prescribe, (3, layout.size)."""
        layout = self.layout
        Z = np.zeros((3, layout.size))
        for k, contact in enumerate(self.line.contacts_and_wheels):
            if isinstance(contact, Contact):
                Z[0, layout.x[k]], Z[0, layout.y[k]] = contact.point
        Z[0, layout.s[-1]] = self.line.rope.length or 0.0
        return Z

    def prescribed_coordinates(self, t: Array | float, phase: int) -> Array:
        """All coordinates with their rates (3, ..., layout.size) at t (...), zero where unknown."""
        layout = self.layout
        Z = np.empty((3, *np.shape(t), layout.size))
        for of_supports, values in zip(self._fixed_coordinates, Z, strict=True):
            values[:] = of_supports
        for k, body in self.cars.items():
            car = body.car
            front = self.travel_contact[k]
            if car.travel is not None:
                at = layout.x if car.drive_mode_or_haul_x == "haul_x" else layout.s
                Z[..., at[front]] = self.line.prescribed_positions_with_rates(car, t, phase)
            else:
                Z[0, ..., layout.s[front]] = car.drive.start
                Z[2, ..., layout.F[k]] = self.line.thrust_of_free_car(car, t, phase)
        return Z

    def all_coordinates_with_rates(self, x: State) -> Array:
        """All coordinates of a state with their rates (3, layout.size)."""
        return self.all_coordinates_from_unknowns(*x)[:, 0]

    def all_coordinates_from_unknowns(self, t: Any, q: Array, v: Array, a: Array, phase: int) -> Array:
        """All coordinates with their rates (3, n, layout.size)."""
        Z = self.prescribed_coordinates(np.ravel(t), phase)
        for rates, unknowns in zip(Z, (q, v, a), strict=True):
            rates[:, self.equations.free] = unknowns
        self.layout.set_dependent_coordinates(Z)
        return Z

    def frictions_at(self, times: Any) -> Array:
        """Frictions at all contacts at times (...), (..., contacts, 5)."""
        t = np.asarray(times)
        frictions = np.broadcast_to(self.frictions, (*t.shape, *self.frictions.shape)).copy()
        for k, body in self.free_cars.items():
            frictions[..., k, HOLD] = self.holds[k] * body.car.drive.remaining_hold_fraction(t)
        return frictions

    # --- the system --------------------------------------------------------------------------------------------------
    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        return self.residuals(np.array([t]), q[None], v[None], a[None], phase)[0]

    def residuals(self, t: Array, q: Array, v: Array, a: Array, phase: int) -> Array:
        x = np.stack([q, v, a], axis=1)
        prescribed = self.prescribed_coordinates(t, phase)
        values = kernels.evaluate_line_with_unknowns(self.equations.line, prescribed, x, self.frictions_at(t))
        for car in self._acting_off_rope:
            car.complete_residuals(car.contact_state(t, values.Z, phase), values.r)
        for row in self.sticking_unknown_indices:
            values.r[:, row] = 0.0
        return values.r

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        r, K = self._residual_and_derivatives(State(t, q, v, a, phase))
        return r, self.equations.inverse_or_nan(c, K)

    def factorised_tangents(
        self, t: float, q: Array, v: Array, a: Array, phase: int, cs: Sequence[TangentFactors]
    ) -> list[Solve]:
        _, K = self._residual_and_derivatives(State(t, q, v, a, phase))
        return [self.equations.inverse_or_nan(c, K) for c in cs]

    def take_steps_while_factors_serve(self, phase: int, node_times: Array, march: StepsWithFactors) -> int:
        prescribed = self.prescribed_coordinates(node_times, phase)
        line = kernels.LineInSteps(
            line=self.equations.line,
            prescribed=np.ascontiguousarray(prescribed.swapaxes(0, 1)),
            frictions=self.frictions_at(node_times),
        )
        moving = np.ones(self.n_dof, bool)
        moving[self.sticking_unknown_indices] = False
        return int(kernels.take_steps_while_factors_serve(line, moving, march))

    def _residual_and_derivatives(self, x: State) -> tuple[Array, Array]:
        """The residual, and its derivatives (3, n_dof, n_dof) by q, v, a."""
        Z = self.all_coordinates_with_rates(x)[:, None]
        values, K = self.equations.evaluate_with_derivatives(Z, self.frictions_at([x.t]))
        for car in self._acting_off_rope:
            state = car.contact_state(np.array([x.t]), Z, x.phase)
            car.complete_residuals(state, values.r)
            car.complete_derivatives(state, K)
        r = values.r[0]
        for row in self.sticking_unknown_indices:  # s.. = 0, exactly: its column has no part in the rest
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
        self.refuse_slack_rope(0.0, self.min_tension_and_saddle_pressures(values)[:, 0])
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
        return self.hold_until_released(self.with_acceleration(x))

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

    def car_points_and_rates(self, name: str, t: Any, coordinates: Array, phase: int) -> Array:
        shape = np.shape(t)
        for k, body in self.cars.items():
            if body.car.name == name:
                return coordinates[..., self.layout.moving[k, :2]].reshape(3, *shape, 2)
        at = self.off_rope[name].contact_state(np.ravel(t), coordinates, phase)
        return np.stack([at.p, at.dp, at.ddp]).reshape(3, *shape, 2)

    # --- friction: a car is named by its contact k, of two wheels the rear one ----------------------------------------
    def set_travel_directions(self, phase: int) -> None:
        """Set friction against the motion of prescribed cars; a shoe has none."""
        for k, body in self.cars.items():
            if body.car.travel is not None and body.car.rail is None:
                self.frictions[k] = Friction(body.car.drive.mu_r, sign=self.line.travel_direction(body.car, phase))

    def slip_sign(self, i: int) -> float:
        return float(self.frictions[i, SIGN])

    def set_friction_and_brakes(self, i: int, s: float, sign: float) -> None:
        body = self.cars[i]
        *rear, last = body.brake_forces_of_wheels(s).tolist()
        self.frictions[i] = Friction(body.car.drive.mu_r, sum(rear), last, sign)

    def _set_release_friction_or_raise(self, k: int, Z: Array, values: LineValues) -> None:
        """Let a free car at rest go; StepFailure if friction holds it."""
        body = self.cars[k].copy_held()
        state = self.held_equations.contact_state(values.contact_values[-1], k)
        cos_phi = float(state.wheels[-1].cos_phi)
        drive = body.car.drive
        thrust = self.line.thrust_of_free_car(body.car, 0.0, 0) * math.cos(drive.thrust_angle)
        self.holds[k] = float(body.tangential_force_on_last_wheel(state)) / cos_phi
        needed = self.holds[k] - thrust / cos_phi
        s = float(Z[0, self.layout.s[self.travel_contact[k]]])
        self.set_friction_and_forget_event_values(k, s, -float(np.sign(needed)))
        available = body.max_friction_plus_brake_force(state, Friction(*self.frictions[k]))
        if drive.has_friction_or_brakes and abs(needed) <= available:
            raise StepFailure(0.0, f"friction or brakes hold {body.car.name} where it begins", "begin on steeper rope")

    def travel_unknown_index(self, i: int) -> int:
        coordinate = self.layout.s[self.travel_contact[i]]
        return int(np.flatnonzero(self.equations.free == coordinate)[0])

    def holding_force(self, i: int, x: State) -> float:
        values = self.equations.evaluate(self.all_coordinates_with_rates(x)[:, None], self.frictions[None])
        return self._needed_friction(i, np.array([x.t]), values).item()

    def _needed_friction(self, k: int, t: Array, values: LineValues) -> Array:
        """Force (n,) [N] along the rope that friction and brakes give a car which sticks, at its last wheel."""
        state = self.equations.contact_state(values.contact_values, k)
        needed = self.cars[k].tangential_force_on_last_wheel(state) / state.wheels[-1].cos_phi
        return np.asarray(needed - self.frictions_at(t)[:, k, HOLD])

    def _friction_margin(self, k: int, t: Array, values: LineValues) -> Array:
        """What friction and brakes could give a car which sticks, less what they give (n,) [N]; inf while it slips."""
        if not self.sticks(k):
            return np.full(t.size, np.inf)
        state = self.equations.contact_state(values.contact_values, k)
        available = self.cars[k].max_friction_plus_brake_force(state, Friction(*self.frictions[k]))
        return available - np.abs(self._needed_friction(k, t, values))

    # --- events ------------------------------------------------------------------------------------------------------
    def contact_positions_and_forces(self, t: Any, coordinates: Array, phase: int) -> tuple[Array, list[Array]]:
        times = np.ravel(t)
        values = self.equations.evaluate(coordinates, self.frictions_at(times))
        forces = []
        for k, body in self.cars.items():
            loads = values.forces_on_cars[:, k, 6 : 6 + body.contacts].real
            if body.car.rail is not None:  # a car does not leave a shoe
                loads = np.full_like(loads, np.inf)
            forces += [*loads.T]
        forces += [*self.min_tension_and_saddle_pressures(values)]
        forces += [self._friction_margin(k, times, values) for k in self.stops]
        shape = np.shape(t)
        return coordinates[0, :, self.layout.s].T.reshape(*shape, -1), [x.reshape(shape) for x in forces]

    def slopes_beside_car(self, name: str, coordinates: Array) -> Array:
        layout = self.layout
        k = [contact.name for contact in self.line.contacts_and_wheels].index(name)
        first, last = layout.tables.of_q[-2:]  # slopes of the functions at both ends of a segment
        segments = zip((last, first), (k - 1, k), strict=True)
        slopes = []
        for of_functions, i in segments:
            columns = layout.columns[i]
            h = coordinates[0, :, columns[-1]] - coordinates[0, :, columns[-2]]
            q = coordinates[0][:, columns[:-2]].reshape(h.size, -1, 2)
            slopes.append(of_functions @ q / h[:, None])
        return np.concatenate(slopes, axis=1)

    def min_tension_and_saddle_pressures(self, values: LineValues) -> Array:
        """The smallest mean of tensions over a shortest wave, and the force of the rope down on each saddle (., n) [N].

        EA multiplies the error of a strain: at a point a coarse sum of sines may be compressed where the rope is taut.
        """
        x = values.contact_values.real
        pressures = (x[..., 3] - x[..., 1])[:, self.saddles]
        means = values.N[:, self.layout.outer] @ self.layout.means.T  # (n, S, P)
        return np.stack([means.min(axis=(1, 2)), *pressures.T])

    def system_after_passage(self, passage: Passage, x: State) -> tuple[LineSines, State]:
        from galerkin.carrying import system_after_passage

        return system_after_passage(self, passage, x)
