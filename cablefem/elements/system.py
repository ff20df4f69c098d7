"""A line in motion on elements, for the time driver: which unknowns are free, and what acts at the contacts.

Coordinates are x and y of the nodes, s of the contacts, F/M of hauled cars, swing of cabins, point and pitch of
cars on two wheels; a slot is the index of one.  F/M is an acceleration.  Prescribed coordinates drop out; the row
that a prescribed one leaves determines F.  The nodes at two wheels follow their car.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from cablefem.elements.bodies import INPUTS, Cars, cabin_data, force_jacobian, forces, vector_length
from cablefem.elements.bordered import Bordered, Dense, Matrix
from cablefem.elements.line_observe import observe
from cablefem.elements.off_rope import CarOffRope
from cablefem.elements.segments import Law, Motion, Segments
from cablefem.elements.trolley import Trolley
from cablefem.motion import LineMotion
from cablefem.newmark import Array, Solve, State, StepFailure, System, consistent_acceleration
from cablefem.scene.contacts import NEAREST, Car, Contact, MovingLine, Wheel, lift_off_event_name, meeting_event_name
from cablefem.shoes import passage_exists_between, possible_passages

if TYPE_CHECKING:
    from cablefem.elements.segment_kernels import Kernel

SHIFT = 1e-4  # [s] for velocities through states of rest
CACHED_INSTANTS = 8  # instants whose prescribed coordinates are kept: a step's nodes are evaluated several times


class Coordinates(NamedTuple):
    """Positions, velocities and accelerations of all coordinates, (..., size) each."""

    q: Array
    v: Array
    a: Array


class LineElements(System):
    """A rope over contacts with cars; `elements` of `degree` on each segment.

    compiled : loops of `segment_kernels` in the place of numpy.
    Events end the run: "A meets B" and "CAR reaches SUPPORT" at NEAREST; "CAR lifts off" where the rope would have to
    hold it down; "rope falls slack" and "rope lifts off SADDLE"; "CAR stops" where friction holds a free one and no
    other moves.  Else it sticks to the rope, until "CAR breaks loose".
    The run goes on after "CAR brakes", and where nothing holds a car.
    """

    reuses_factors = True

    def __init__(self, line: MovingLine, *, elements: int = 6, degree: int = 4, compiled: bool = True) -> None:
        self.line = line
        self.compiled = compiled
        count = len(line.contacts_and_wheels) - 1
        self.segments = Segments(line.rope, line.gravity, elements, degree)
        self.law = np.array(self.segments.law(count))  # (3, K, G)
        self.phases = line.phases
        self.node = (self.segments.nn - 1) * np.arange(count + 1)  # of each contact
        self.nodes = self.node[:-1, None] + np.arange(self.segments.nn)  # of each segment, (K, nn)
        self.n = int(self.node[-1]) + 1
        self._number_slots()
        self._prescribed_cache: dict[tuple[float, int], Array] = {}
        self._loaded: tuple[State | None, list[float]] = (None, [])  # of the last state that was watched
        # t, a, rows and loads at the last instant of the last residuals
        self._last: tuple[float, Array, Array, Array] | None = None
        self._steady: Cars | None = None  # data of cars that do not change
        self._instants: tuple[Array, int, Array] | None = None  # t, phase, prescribed ones of the last residuals
        outer = [(k, line.supports[k]) for k in (0, -1)]
        springs = [(k, c) for k, c in outer if c.stiffness is not None]
        self._springs = [(2 * int(self.node[k]) + np.arange(2), np.array(c.stiffness), c) for k, c in springs]
        self._weights = [(int(self.s[k]), k) for k, c in outer if c.force is not None]
        self._masses = np.array([c.mass for c in line.cars])
        # a shoe has no friction
        air = [(c.drive.k, c.drive.wind, c.drive.mu_r if c.rail is None else 0.0) for c in line.cars]
        self._air = np.array(air).reshape(-1, 3).T
        self.band = 2 * degree + 1
        self._unknown = np.flatnonzero(self.free)
        self.n_dof = self._unknown.size
        self.signs = np.array([line.travel_direction(c, 0) if c.travel else 1.0 for c in line.cars])
        self.brakes = np.zeros(len(self.cars))  # [N] that act on free cars
        self.rear_brakes = np.zeros(len(self.cars))  # [N] of them at the rear one of two wheels
        self.hold = np.zeros(len(self.cars))  # [N] f that holds free cars at the start
        weights = [car.mass * line.gravity for car in line.cars] or [
            line.weight_per_length * line.supports[-1].point[0]
        ]
        self.force_scale = min(weights)
        self.force_floor = 16.0 * sys.float_info.epsilon * line.rope.EA * elements * degree * count
        self._name_events()

    def _number_slots(self) -> None:
        """Number the slots of s, forces and bodies, and set what is prescribed."""
        line = self.line
        # contact of each car; of two wheels the front one
        self.cars = [
            k
            for k, c in enumerate(line.contacts_and_wheels)
            if isinstance(c, Car) or (isinstance(c, Wheel) and c.front)
        ]
        self.supports = [k for k, c in enumerate(line.contacts_and_wheels) if isinstance(c, Contact)]
        self.s = 2 * self.n + np.arange(self.node.size)  # slots of s
        hauled = [k for k, car in zip(self.cars, line.cars, strict=True) if car.drive.mode == "haul"]
        self.force = self.s[-1] + 1 + np.arange(len(hauled))  # slots of F/M
        self.of_force = np.searchsorted(self.cars, hauled)  # their numbers among the cars
        self._set_up_cabins_and_trolleys(int(self.s[-1]) + 1 + len(hauled))
        self.force_rows = np.array([self.travel_slot(k) for k in hauled], int)  # rows that determine F
        rails = zip(self.node[self.cars].tolist(), line.cars, strict=True)
        self.rails = [(2 * node, car.rail) for node, car in rails if car.rail is not None]  # slots of x
        saddles = {line.contacts_and_wheels[k].name: int(self.s[k]) for k in self.supports}  # slots of s
        self.off_rope = {
            car.name: CarOffRope(line, car, saddles[car.rail.saddle], self.swing_off_rope.get(car.name))
            for car in line.over
            if car.rail is not None
        }
        self.free = np.ones(self.size, bool)
        self.constant = np.zeros(self.size)
        self.prescribed: list[tuple[Car, int]] = []
        for k, contact in enumerate(line.contacts_and_wheels):
            self._prescribe(k, contact)

    def _name_events(self) -> None:
        """Set the events, and what each kind of them watches."""
        line, contacts = self.line, self.line.contacts_and_wheels
        self.passages = possible_passages(line)
        self._gaps = [k for k in range(len(contacts) - 1) if self._may_meet(contacts[k], contacts[k + 1])]
        self._rolls = any(car.drive_kind == "free" for car in line.cars)
        self._stops = [
            i for i, car in enumerate(line.cars) if car.drive_kind == "free" and car.drive.has_friction_or_brakes
        ]
        self._brakes = [(i, position) for i in self._stops for position, _ in line.cars[i].drive.brakes]
        self.events = (
            *(meeting_event_name(contacts[k], contacts[k + 1]) for k in self._gaps),
            *(f"{line.cars[i].name} stops" for i in self._stops),
            *(f"{line.cars[i].name} brakes" for i, _ in self._brakes),
            *(lift_off_event_name(c) for c in contacts if not isinstance(c, Contact)),
            "rope falls slack",
            *(f"rope lifts off {c.name}" for c in line.supports[1:-1]),
            *(f"{line.cars[i].name} breaks loose" for i in self._stops),
            *(str(p) for p in self.passages),
        )

    def _may_meet(self, first: Contact | Car | Wheel, second: Contact | Car | Wheel) -> bool:
        """Whether two neighbours may meet: one of them is a car, and neither passes the other over a shoe."""
        if isinstance(first, Contact) and isinstance(second, Contact):
            return False
        names = [c.car.name if isinstance(c, Wheel) else c.name for c in (first, second)]
        return names[0] != names[1] and not passage_exists_between(self.passages, *names)

    @cached_property
    def _kernel(self) -> Kernel:
        from cablefem.elements.segment_kernels import Kernel  # slow to load

        on_one, contacts = np.array(self.points, int), np.array(self.cars, int)
        swings = np.full(len(contacts), -1)
        swings[self.of_swing] = self.swing
        slots = [self._force_slots[on_one], swings[on_one]]
        return Kernel(self.segments, on_one, contacts[on_one], slots, self.line.gravity)

    # --- coordinates ---------------------------------------------------------------------------------------
    @property
    def _force_slots(self) -> NDArray[np.intp]:
        """Slots of F/M of the cars, or -1."""
        slots = np.full(len(self.cars), -1)
        slots[self.of_force] = self.force
        return slots

    def _set_up_cabins_and_trolleys(self, first: int) -> None:
        """Give cabins and cars on two wheels their slots, from `first` on."""
        line, cars = self.line, list(enumerate(self.line.cars))
        self.of_swing = [i for i, car in cars if car.hanger is not None]
        self.swing = first + np.arange(len(self.of_swing))  # slots of phi
        first += len(self.of_swing)
        self.trolleys = [Trolley(car, i, self.cars[i]) for i, car in cars if car.wheels is not None]
        for trolley in self.trolleys:
            force = int(self._force_slots[trolley.i])
            trolley.set_slots(first + np.arange(3), force, self.nodes, self.s, self.segments.end_slopes)
            first += 3
        self.swing_off_rope = {car.name: first + i for i, car in enumerate(line.swinging_cars_off_rope)}  # slots of phi
        self.size = first + len(self.swing_off_rope)
        self.points = [i for i, car in cars if car.wheels is None]  # numbers of the cars on one contact
        self._cabins = np.array([cabin_data(car, line.gravity) for car in line.cars]).reshape(-1, 4).T
        self._pressing = [i for i, car in cars for _ in range(1 if car.wheels is None else 2)]  # all that may lift off

    def travel_slot(self, k: int) -> int:
        """Slot that the travel of the car at contact k prescribes."""
        i = self.cars.index(k)
        if self.line.cars[i].drive_kind != "haul_x":
            return int(self.s[k])
        return next((int(x.body[0]) for x in self.trolleys if x.i == i), 2 * int(self.node[k]))

    def _prescribe(self, k: int, contact: Contact | Car | Wheel) -> None:
        point = 2 * self.node[k] + np.arange(2)
        if isinstance(contact, Wheel):
            self.free[point] = False
        if isinstance(contact, Car) and contact.rail is not None:
            self.free[point[1]] = False
        if k in self.cars:
            car = self.line.cars[self.cars.index(k)]
            if car.travel is not None:
                self.free[self.travel_slot(k)] = False
                self.prescribed.append((car, self.travel_slot(k)))
        if not isinstance(contact, Contact):
            return
        if contact.kind != "spring":
            self.free[point] = False
            self.constant[point] = contact.point
        if contact.kind in ("anchor", "spring"):
            self.free[self.s[k]] = False
            self.constant[self.s[k]] = (self.line.rope.length or 0.0) if k else 0.0

    def prescribed_coordinates(self, t: float, phase: int) -> Coordinates:
        """Coordinates with what is prescribed at t; zero elsewhere."""
        return Coordinates(*self._prescribed_array(t, phase).copy())

    def _prescribed_array(self, t: float, phase: int) -> Array:
        """What is prescribed at t (3, size), from the cache."""
        if (t, phase) not in self._prescribed_cache:
            if len(self._prescribed_cache) >= CACHED_INSTANTS:
                self._prescribed_cache.clear()
            out = np.zeros((3, self.size))
            out[0] = self.constant
            for car, slot in self.prescribed:
                out[:, slot] = self.line.position_with_rates(car, t, phase)
            self._prescribed_cache[t, phase] = out
        return self._prescribed_cache[t, phase]

    def coordinates_with_rates(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Coordinates:
        out = self._prescribed_array(t, phase).copy()
        out[:, self._unknown] = q, v, a
        return self.fill_dependent_coordinates(out)

    def fill_dependent_coordinates(self, z: Array) -> Coordinates:
        """Coordinates of (3, ..., size), where wheels follow their cars, and cars on shoes their rails."""
        for trolley in self.trolleys:
            trolley.set_wheel_points(z)
        for x, rail in self.rails:
            z[..., x + 1] = rail.y_with_rates(z[..., x])
        return Coordinates(*z)

    def segment_motion(self, x: Coordinates) -> Motion:
        nodal = [z[: 2 * self.n].reshape(-1, 2)[self.nodes] for z in x]
        ends = [np.stack([z[self.s[:-1]], z[self.s[1:]]], axis=1) for z in x]
        return Motion(*nodal, *ends)

    # --- balance ---------------------------------------------------------------------------------------------
    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        return self._rows_of_unknowns(self.balance_rows(t, self.coordinates_with_rates(t, q, v, a, phase), phase))

    def _rows_of_unknowns(self, rows: Array) -> Array:
        """Rows (..., n_dof) of (..., size); a car that sticks needs none, its s.. stays 0."""
        out = rows[..., self._unknown]
        out[..., self._sticking] = 0.0
        return out

    def residuals(self, t: Array, q: Array, v: Array, a: Array, phase: int) -> Array:
        if not self.compiled:
            return super().residuals(t, q, v, a, phase)
        instants = self._instants
        if instants is None or instants[0] is not t or instants[1] != phase:
            prescribed = np.stack([self._prescribed_array(at, phase) for at in t.tolist()], axis=1)
            instants = self._instants = t, phase, prescribed  # the same for all residuals of a step
        z = instants[2].copy()  # (3, n, size)
        z[..., self._unknown] = q, v, a
        x = self.fill_dependent_coordinates(z)
        rows = self.balance_rows(t, x, phase)
        self._last = t.item(-1), a[-1], rows[-1], self.loads[-1]
        return self._rows_of_unknowns(rows)

    def balance_rows(
        self, t: Array | float, x: Coordinates, phase: int, law: Array | None = None, cars: Cars | None = None
    ) -> Array:
        """Rows of all coordinates (..., size): what is missing from balance; of prescribed ones the force they need.

        x : (..., size) at the time or times t.
        """
        cars = cars or self.car_data(t, phase)
        rows = self._rope_rows(x, self.law if law is None else law, cars)
        self._add_supports(rows, x)
        for trolley in self.trolleys:
            y = trolley.force_inputs(x, rows[..., trolley.points.ravel()])
            rows[..., trolley.rows] += np.stack(trolley.forces(cars, y).rows, axis=-1)
        for slot, rail in self.rails:
            rows[..., slot] += rail.depth_with_derivatives(x.q[..., slot])[1] * rows[..., slot + 1]
        each, z = rows.reshape(-1, self.size), np.array(x).reshape(3, -1, self.size)
        for car in self.off_rope.values():
            car.add_rows(each, np.ravel(t), z, phase)
        rows[..., self.force] = rows[..., self.force_rows]
        return rows

    def _rope_rows(self, x: Coordinates, law: Array, cars: Cars) -> Array:
        """Rows (..., size) of segments and of cars on one contact; notes loads of these and the smallest tension."""
        rows = np.zeros(x.q.shape)
        each = rows.reshape(-1, self.size)
        self.loads = np.empty((len(each), len(self.points) + 1))
        if self.compiled:
            at = [z.reshape(each.shape) for z in x]
            self._kernel.add_rows_and_set_loads(at, law, cars, each, self.loads)
        else:
            self._add_rope_and_cars(rows, x, Law(*law), cars)
        return rows

    def _add_rope_and_cars(self, rows: Array, x: Coordinates, law: Law, cars: Cars) -> None:
        m = self.segment_motion(x)
        fields = self.segments.fields(self.segments.values_at_points(m), law)
        nodes, ends = self.segments.residual(fields)
        points = rows[: 2 * self.n].reshape(-1, 2)
        points[:-1] += nodes[:, :-1].reshape(-1, 2)
        points[self.node[1:]] += nodes[:, -1]
        rows[self.s[:-1]] += ends[0]
        rows[self.s[1:]] += ends[1]
        if self.points:
            at, k = forces(cars, self.slopes_and_motion_at_cars(x, m)), np.array(self.cars, int)[self.points]
            points[self.node[k]] += at.contact[self.points]
            rows[self.s[k]] -= at.drive[self.points]
            rows[self.swing] += at.swing[self.of_swing]
            self.loads[0, :-1] = at.normal[self.points]
        self.loads[0, -1] = fields.N.min()

    def _add_supports(self, rows: Array, x: Coordinates) -> None:
        for slots, stiffness, spring in self._springs:
            rows[..., slots] += stiffness * (x.q[..., slots] - spring.point)
        for slot, k in self._weights:
            rows[..., slot] += self.counterweight_row(k, x.v[..., slot], x.a[..., slot])

    def _counterweight_mass_and_sign(self, end: int, force: float) -> tuple[float, float]:
        """Mass of a counterweight for d2s/dt2, and +1 at the right end, -1 at the left one."""
        return force / self.line.gravity * (1.0 + force / self.line.rope.EA), 1.0 if end else -1.0

    def counterweight_row(self, end: int, ds: Array, dds: Array) -> Array:
        """e [N + N^2/(2 EA) + q y - rho (ds lam)^2/2], N = G + e m (1 + G/EA) dds, at end 0 or -1.

        ds, dds : rates of s there; the rope that passes takes the energy of its weight and its motion along.
        """
        contact, EA = self.line.supports[end], self.line.rope.EA
        force = contact.force or 0.0
        mass, sign = self._counterweight_mass_and_sign(end, force)
        N = force + sign * mass * dds
        speed = ds * (1.0 + N / EA)
        entering = self.line.weight_per_length * contact.point[1] - 0.5 * self.segments.rho * speed**2
        return sign * (N + N**2 / (2.0 * EA) + entering)

    def slopes_and_motion_at_cars(self, x: Coordinates, m: Motion) -> Array:
        """Slopes beside each car, its v and a, F/M and the swing (cars, INPUTS), for `bodies.forces`."""
        out = np.zeros((len(self.cars), INPUTS))
        if self.cars:
            left, right = self.segments.slopes_at_ends(m)
            k = np.array(self.cars)
            out[:, 0:2], out[:, 2:4], out[:, 4:6], out[:, 6:8] = right[k - 1], left[k], m.v[k, 0], m.a[k, 0]
            out[self.of_force, 8] = x.a[self.force]
            out[self.of_swing, 9:12] = np.stack([z[self.swing] for z in x], axis=1)
        return out

    def car_data(self, t: Array | float, phase: int) -> Cars:
        """Data at the time or at times t (n,); thrust and hold are (n, cars) then, if a car rolls freely."""
        if self._steady is not None:
            return self._steady
        cars, line = self.line.cars, self.line
        thrust = released = np.zeros(len(cars))
        if self._rolls:
            times = np.ravel(t).tolist()
            thrust, released = np.empty((2, *np.shape(t), len(cars)))
            for i, car in enumerate(cars):
                thrust[..., i] = np.reshape([line.thrust(car, at, phase) for at in times], np.shape(t))
                released[..., i] = np.reshape([car.drive.remaining_hold_fraction(at) for at in times], np.shape(t))
        k, wind, friction = self._air
        lever, arm, inertia, resistance = self._cabins
        data = Cars(
            self._masses, k, wind, friction, thrust, self.brakes, self.hold * released, self.signs, lever, arm,
            inertia, resistance, line.gravity, self.rear_brakes,
        )  # fmt: skip
        self._steady = None if self._rolls else data
        return data

    # --- start ---------------------------------------------------------------------------------------------
    def start(self, phase: int, state: State | None) -> State:
        """At rest with the cars held; prescribed cars move through states of rest with the first speed of theirs."""
        t = self.phases[phase][0]
        self.set_directions(phase)
        if state is not None:
            return consistent_acceleration(self, t, state.q, state.v, phase)
        from cablefem.elements.rest import cars_at_rest, coordinates_at_rest, coordinates_with_zero_rates

        q, v = coordinates_at_rest(self, t, phase), np.zeros(self.size)
        if self.prescribed_coordinates(t, phase).v.any():
            before, after = (coordinates_at_rest(self, t, phase, shift, q) for shift in (-SHIFT, SHIFT))
            v = (after - before) / (2.0 * SHIFT)
        if self.cars:
            self._release(t, phase, coordinates_with_zero_rates(self, q), cars_at_rest(self, t, phase))
        slack, *pressures = self._tension_and_pressures(
            self.balance_rows(t, coordinates_with_zero_rates(self, q), phase), self.loads[0]
        )
        if min(slack, *pressures, 0.0) < 0.0:
            cause = f"at rest the smallest tension is {slack:.6g} N and the smallest pressure on a saddle"
            cause = f"{cause} {min(pressures, default=0.0):.6g} N"
            raise StepFailure(t, cause, "tighten the rope or lower its saddles")
        for x in (q, v):
            x[self.force] = 0.0
        return consistent_acceleration(self, t, q[self.free], v[self.free], phase)

    def set_directions(self, phase: int) -> None:
        """Set the directions of prescribed cars."""
        self._steady = None
        self.signs = np.array(
            [
                self.line.travel_direction(c, phase) if c.travel else x
                for c, x in zip(self.line.cars, self.signs, strict=True)
            ]
        )

    def _release(self, t: float, phase: int, x: Coordinates, held: Cars) -> None:
        """Let free cars go; they must move against friction."""
        self.hold[:] = 0.0
        slots = self.s[self.cars]
        inputs = self.slopes_and_motion_at_cars(x, self.segment_motion(x))
        stretch = forces(held, inputs).stretch
        self.hold = self.balance_rows(t, x, phase, cars=held)[slots] / stretch
        for i, car in enumerate(self.line.cars):
            if car.drive_kind == "free":
                self._set_brakes(i, x.q[slots[i]])
        now = self.car_data(t, phase)
        each = np.abs(self._pressing_forces(x, self.balance_rows(t, x, phase, cars=now), self.loads[0], now))
        loads = np.bincount(self._pressing, each)
        none = np.zeros_like(now.hold)
        free = now._replace(hold=none, brake=none, friction=none)
        needed = self.balance_rows(t, x, phase, cars=free)[slots] / stretch
        projection = vector_length(inputs[:, 0:2] + inputs[:, 2:4]) / (2.0 * stretch)  # |<r'>|/<lam>
        needed -= now.thrust * np.cos([car.drive.thrust_angle for car in self.line.cars]) / projection
        for i, car in enumerate(self.line.cars):
            if car.drive_kind != "free":
                continue
            self.signs[i] = -np.sign(needed[i]) or 1.0
            if car.drive.has_friction_or_brakes and abs(needed[i]) <= car.drive.mu_r * loads[i] + self.brakes[i]:
                cause = f"friction or brakes hold {car.name} where it begins"
                raise StepFailure(t, cause, "begin on steeper rope, or with less of both")

    # --- events --------------------------------------------------------------------------------------------
    def begin_step(self, x: State) -> None:
        """Keep the direction of friction, and the brakes that act, for one step."""
        if not self._stops:
            return
        z = self.coordinates_with_rates(*x)
        for i in self._stops:
            slot = self.s[self.cars[i]]
            self.signs[i] = np.sign(z.v[slot]) or self.signs[i]
            self._set_brakes(i, z.q[slot])

    def _sticks(self, i: int) -> bool:
        """Whether friction holds car i."""
        return bool(self.signs[i] == 0.0)

    @property
    def _sticking(self) -> list[int]:
        """Numbers of s among the unknowns, of cars that friction holds."""
        return [self._number_of_travel(i) for i in self._stops if self._sticks(i)]

    def _number_of_travel(self, i: int) -> int:
        """Number of s of the free car i among the unknowns."""
        return int(np.searchsorted(self._unknown, self.s[self.cars[i]]))

    def _set_brakes(self, i: int, s: float) -> None:
        """Set the brakes of car i at s."""
        drive = self.line.cars[i].drive
        self.brakes[i], self.rear_brakes[i] = drive.brake_force(s), drive.rear_brake_force(s)

    def _balance_at(self, x: State, z: Coordinates) -> tuple[Array, Array]:
        """Rows, and loads with the smallest tension, of x; of the end of a step those of its residual."""
        last = self._last
        if last is None or last[0] != x.t or not np.array_equal(last[1], x.a):
            return self.balance_rows(x.t, z, x.phase), self.loads[0]
        return last[2:]

    def event_values(self, x: State) -> tuple[float, ...]:
        z = self.coordinates_with_rates(*x)
        gaps = np.diff(z.q[self.s])[self._gaps] - NEAREST
        ahead = [np.inf if self._sticks(i) else float(z.v[self.s[self.cars[i]]] * self.signs[i]) for i in self._stops]
        ahead += [position - float(z.q[self.s[self.cars[i]]]) for i, position in self._brakes]
        if gaps.min(initial=np.inf) <= 0.0:  # the rest has no meaning there
            return (*gaps.tolist(), *[np.inf] * (len(self.events) - len(self._gaps)))
        if self._loaded[0] is not x:
            rows, loads = self._balance_at(x, z)
            pressing = self._pressing_forces(z, rows, loads, self.car_data(x.t, x.phase))
            margins = [self._friction_margin(i, z, rows, pressing) if self._sticks(i) else np.inf for i in self._stops]
            self._loaded = x, pressing + self._tension_and_pressures(rows, loads) + margins
        passing = [p.distance_to_go(*self.car_point_and_rates(p.car, x)[:2, 0].tolist()) for p in self.passages]
        return (*gaps.tolist(), *ahead, *self._loaded[1], *passing)

    def car_point_and_rates(self, car: str, x: State) -> Array:
        """Point of a car with its rates (3, 2)."""
        z = np.array(self.coordinates_with_rates(*x))
        for k, of in zip(self.cars, self.line.cars, strict=True):
            if of.name == car:
                return z[:, 2 * self.node[k] + np.arange(2)]
        return self.off_rope[car].points(np.array([x.t]), z[:, None], x.phase)[0]

    def _pressing_forces(self, x: Coordinates, rows: Array, loads: Array, cars: Cars) -> list[float]:
        """Contact forces [N] of all that may lift off; `rows` and `loads` are those of x."""
        if not self.cars:
            return []
        each: dict[int, Any] = {i: [load] for i, load in zip(self.points, loads[:-1].tolist(), strict=True)}
        for trolley in self.trolleys:
            y = trolley.force_inputs(x, rows[trolley.points.ravel()])
            each[trolley.i] = trolley.forces(cars, y).loads
        for i, car in enumerate(self.line.cars):
            if car.rail is not None:
                each[i] = [np.inf]
        return [load for _, of_car in sorted(each.items()) for load in of_car]

    def _tension_and_pressures(self, rows: Array, loads: Array) -> list[float]:
        """Smallest tension, and pressures of the rope on the saddles [N]."""
        saddles = self.node[self.supports[1:-1]]
        return [loads.item(-1), *(-rows[2 * saddles + 1]).tolist()]

    def apply_event(self, name: str, x: State) -> State | None:
        """A car that friction cannot hold goes on, and so does one that reaches a brake; else the run ends."""
        for i in self._stops:
            car = self.line.cars[i].name
            if name == f"{car} stops":
                after = self._come_to_rest(i, x)
                return after if self._goes_on(x) else None
            if name == f"{car} breaks loose":
                return self._start_slipping(i, x)
            if name == f"{car} brakes":
                self.begin_step(x)
                return consistent_acceleration(self, x.t, x.q, x.v, x.phase)
        return None

    def system_after(self, name: str, x: State) -> tuple[LineElements, State] | None:
        """The line after a car passes an end of a shoe, and its state; None if another event has ended the run."""
        for passage in self.passages:
            if str(passage) == name:
                from cablefem.elements.carrying import system_after_passage

                return system_after_passage(self, passage, x)
        return None

    def _goes_on(self, x: State) -> bool:
        """Whether a free car rolls, or a force or a travel is still to change."""
        rolling = any(car.drive_kind == "free" and not self._sticks(i) for i, car in enumerate(self.line.cars))
        return rolling or self.line.travel_or_force_changes_after(x.t, x.phase)

    def _come_to_rest(self, i: int, x: State) -> State:
        """Car i sticks, or slips if friction and brakes cannot hold it."""
        self.signs[i] = 0.0
        after = self._with_slip(i, x, 0.0)
        z = self.coordinates_with_rates(*after)
        rows = self.balance_rows(x.t, z, x.phase)
        pressing = self._pressing_forces(z, rows, self.loads[0], self.car_data(x.t, x.phase))
        return after if self._friction_margin(i, z, rows, pressing) > 0.0 else self._start_slipping(i, after)

    def _start_slipping(self, i: int, x: State) -> State:
        """Car i, which sticks, slips against the force that has held it."""
        z = self.coordinates_with_rates(*x)
        self.signs[i] = -np.sign(self._holding_force(i, z, self.balance_rows(x.t, z, x.phase))) or 1.0
        return self._with_slip(i, x, self.signs[i] * 1e-12)  # a first slip arms the event of a standstill

    def _with_slip(self, i: int, x: State, ds: float) -> State:
        """The state where car i slips with ds."""
        v = x.v.copy()
        v[self._number_of_travel(i)] = ds
        return consistent_acceleration(self, x.t, x.q, v, x.phase)

    def _holding_force(self, i: int, z: Coordinates, rows: Array) -> float:
        """Force [N] of friction and brakes along the rope that a car which sticks needs; of two wheels all of it."""
        inputs = self.slopes_and_motion_at_cars(z, self.segment_motion(z))[i]
        stretch = 0.5 * (vector_length(inputs[0:2]) + vector_length(inputs[2:4]))
        return float(rows[self.s[self.cars[i]]] / stretch)

    def _friction_margin(self, i: int, z: Coordinates, rows: Array, pressing: Sequence[float]) -> float:
        """Largest force [N] of friction and brakes less the one that holds car i."""
        load = sum(abs(load) for of, load in zip(self._pressing, pressing, strict=True) if of == i)
        return float(self._air[2][i] * load + self.brakes[i] - abs(self._holding_force(i, z, rows)))

    def observe(self, states: Sequence[State], s: Array) -> LineMotion:
        """What the states show, with the rope at the stations s (m,)."""
        return observe(self, states, s)

    # --- tangent ---------------------------------------------------------------------------------------------
    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> tuple[Array, Solve]:
        x = self.coordinates_with_rates(t, q, v, a, phase)
        rows = self._rows_of_unknowns(self.balance_rows(t, x, phase))
        return rows, self._solver_of_unknowns(t, x, phase, (c0, c1, c2))

    def factorised_tangent(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> Solve:
        return self._solver_of_unknowns(t, self.coordinates_with_rates(t, q, v, a, phase), phase, (c0, c1, c2))

    def _solver_of_unknowns(self, t: float, x: Coordinates, phase: int, c: tuple[complex, complex, complex]) -> Solve:
        """The solution for all unknowns, 0 for s of cars that stick."""
        sticking = self._sticking
        moving = self.free.copy()
        moving[self._unknown[sticking]] = False
        solve_moving = self.tangent_solver(t, x, phase, c, moving)
        if not sticking:
            return solve_moving

        def solve(b: Array) -> Array:
            return np.insert(solve_moving(np.delete(b, sticking)), gaps, 0.0)

        gaps = np.array(sticking) - np.arange(len(sticking))  # places of the zeros among the others
        return solve

    def tangent_solver(
        self, t: float, x: Coordinates, phase: int, c: tuple[complex, complex, complex], free: NDArray[np.bool_],
        law: Array | None = None, cars: Cars | None = None,
    ) -> Solve:  # fmt: skip
        """The solution with c0 dr/dq + c1 dr/dv + c2 dr/da of free coordinates; without c2 forces F/M count once."""
        cars = cars or self.car_data(t, phase)
        law = self.law if law is None else law
        rope = self._rope_rows(x, law, cars) if self.trolleys else np.empty(0)
        if not self.compiled:
            return self._sparse_solver(x, Law(*law), cars, c, free, rope)
        factors = np.array([*c, c[2] or 1.0])
        matrix = Bordered(2 * self.n, self.band, self.size - 2 * self.n)
        self._kernel.add_tangent(x, law, cars, factors.real, matrix)
        if np.iscomplexobj(factors):  # real loops twice: compiled once
            other = Bordered(2 * self.n, self.band, self.size - 2 * self.n)
            self._kernel.add_tangent(x, law, cars, factors.imag, other)
            matrix.add_imaginary(other)
        self._add_contacts(matrix, x, rope, cars, c)
        matrix.fix_unknowns(np.flatnonzero(np.logical_not(free)))
        solve_all, unknown = matrix.factorised(), np.flatnonzero(free)

        def solve(b: Array) -> Array:
            full = np.zeros(free.size, b.dtype)
            full[unknown] = b
            return solve_all(full)[unknown]

        return solve

    def _sparse_solver(
        self, x: Coordinates, law: Law, cars: Cars, c: tuple[complex, complex, complex], free: NDArray[np.bool_],
        rope: Array,
    ) -> Solve:  # fmt: skip
        """`solver` by numpy and a sparse factorisation."""
        m = self.segment_motion(x)
        parts = self.segments.tangent(m, law, c)
        own = (2 * self.nodes[..., None] + np.arange(2)).reshape(len(self.nodes), -1)
        slots = np.column_stack([own, self.s[:-1], self.s[1:]])  # (K, m)
        matrix = np.zeros((self.size, self.size), parts.dtype)
        np.add.at(matrix, (slots[:, :, None], slots[:, None, :]), parts)
        if self.points:
            self._add_car_tangent(Dense(matrix), force_jacobian(cars, self.slopes_and_motion_at_cars(x, m)), m, c)
        self._add_contacts(Dense(matrix), x, rope, cars, c)
        return splu(csc_array(matrix[free][:, free])).solve

    def _add_contacts(
        self, matrix: Matrix, x: Coordinates, rope: Array, cars: Cars, c: tuple[complex, complex, complex]
    ) -> None:
        """Add supports, cars on two wheels, and the rows that determine F."""
        for slot, value in self._support_tangent(x, c):
            matrix.add([slot], [slot], np.array([[value]]))
        for trolley in self.trolleys:
            trolley.add_tangent(matrix, x, rope[trolley.points.ravel()], cars, c)
        for slot, rail in self.rails:
            matrix.tie_to_previous(slot + 1, rail.depth_with_derivatives(x.q[slot])[1])
        for car in self.off_rope.values():
            car.add_tangent(matrix, x.q[car.swing] if car.swing is not None else 0.0, c)
        for slot, row in zip(self.force.tolist(), self.force_rows.tolist(), strict=True):
            matrix.add_row(slot, row)

    def _support_tangent(self, x: Coordinates, c: tuple[complex, complex, complex]) -> Iterator[tuple[int, complex]]:
        """Diagonal entries of springs and counterweights."""
        (c0, c1, c2), EA, rho = c, self.line.rope.EA, self.segments.rho
        for slots, stiffnesses, _ in self._springs:
            for slot, stiffness in zip(slots.tolist(), stiffnesses.tolist(), strict=True):
                yield slot, stiffness * c0
        for slot, k in self._weights:
            force = self.line.supports[k].force or 0.0
            mass, sign = self._counterweight_mass_and_sign(k, force)
            ds, lam = x.v[slot], 1.0 + (force + sign * mass * x.a[slot]) / EA
            yield slot, mass * (lam - rho * ds**2 * lam / EA) * c2 - sign * rho * ds * lam**2 * c1

    def _add_car_tangent(self, matrix: Dense, by_input: Array, m: Motion, c: tuple[complex, complex, complex]) -> None:
        """Add the chain of `force_jacobian` (n, 4, INPUTS) and of the inputs by the coordinates."""
        (c0, c1, c2), slopes = c, self.segments.slopes_at_ends(m)
        for i in self.points:
            k = self.cars[i]
            inputs = np.zeros((INPUTS, self.size), matrix.kind)
            point = 2 * self.node[k] + np.arange(2)
            for side in range(2):  # behind, ahead
                j, end = k - 1 + side, 1 - side
                for axis in range(2):
                    row = inputs[2 * side + axis]
                    row[2 * self.nodes[j] + axis] = c0 / m.h[j, 0] * self.segments.end_slopes[end]
                    row[self.s[[j, j + 1]]] += c0 / m.h[j, 0] * slopes[end, j, axis] * np.array([1.0, -1.0])
            inputs[[4, 5], point], inputs[[6, 7], point] = c1, c2
            inputs[8, self.force[self.of_force == i]] = c2 or 1.0
            swing = self.swing[np.equal(self.of_swing, i)]
            for row, factor in zip(inputs[9:], c, strict=True):
                row[swing] = factor
            rows = [*point, self.s[k], *swing]
            matrix.matrix[rows] += by_input[i, : len(rows)] @ inputs
