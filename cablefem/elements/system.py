"""A line in motion on elements, for the time driver: which unknowns are free, and what acts at the contacts.

All coordinates have a slot: x and y of the nodes, s of the contacts, and F/M of hauled cars.  The last stands where
accelerations stand.  Prescribed slots drop out; the row that a prescribed one leaves determines F.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

from cablefem.elements.bodies import INPUTS, Cars, derivatives, forces
from cablefem.elements.observe import observe
from cablefem.elements.segments import Law, Motion, Segments, Tangent
from cablefem.motion import LineMotion
from cablefem.newmark import Array, Solve, State, StepFailure, System, consistent_acceleration
from cablefem.scene.contacts import NEAREST, Car, Contact, MovingLine

if TYPE_CHECKING:
    from cablefem.elements.segment_kernels import Kernel

SHIFT = 1e-4  # [s] for velocities through states of rest


class Slots(NamedTuple):
    """Positions, velocities and accelerations of all slots."""

    q: Array
    v: Array
    a: Array


class LineElements(System):
    """A rope over contacts with cars; `elements` of `degree` on each segment.

    Events end the run: "A meets B" at NEAREST of a car, "CAR lifts off" where the rope would have to hold it down,
    "CAR stops" where friction stops a free one.  compiled : loops of `segment_kernels` in the place of numpy.
    """

    def __init__(self, line: MovingLine, *, elements: int = 6, degree: int = 4, compiled: bool = True) -> None:
        self.line, self.compiled, contacts = line, compiled, line.contacts
        count = len(contacts) - 1
        self.segments = Segments(line.rope, line.gravity, elements, degree)
        self.phases = line.phases
        self.node = (self.segments.nn - 1) * np.arange(count + 1)  # of each contact
        self.nodes = self.node[:-1, None] + np.arange(self.segments.nn)  # of each segment, (K, nn)
        self.n = int(self.node[-1]) + 1
        self.cars = [k for k, c in enumerate(contacts) if isinstance(c, Car)]
        self.s = 2 * self.n + np.arange(count + 1)  # slots of s
        hauled = [k for k in self.cars if contacts[k].kind in ("haul", "haul_x")]
        self.force = self.s[-1] + 1 + np.arange(len(hauled))  # slots of F/M
        self.kept = np.array([self._slot(k) for k in hauled], int)  # rows that determine F
        self.of_force = np.searchsorted(self.cars, hauled)  # their numbers among the cars
        self.size = int(self.s[-1]) + 1 + len(hauled)
        self.free = np.ones(self.size, bool)
        self.constant = np.zeros(self.size)
        self.prescribed: list[tuple[Car, int]] = []
        for k, contact in enumerate(contacts):
            self._prescribe(k, contact)
        self._outer = [(k, contacts[k]) for k in (0, -1) if contacts[k].kind != "anchor"]
        self._fixed = np.array([(c.mass, c.drive.k, c.drive.wind, c.drive.mu_r) for c in line.cars]).reshape(-1, 4).T
        self.band = 2 * degree + 1
        self.n_dof = int(self.free.sum())
        self.signs = np.array([self._sign(c, 0) if c.travel else 1.0 for c in line.cars])
        self.brakes = np.zeros(len(self.cars))  # [N] that act on free cars
        self.hold = np.zeros(len(self.cars))  # [N] f that holds free cars at the start
        weights = [car.mass * line.gravity for car in line.cars] or [line.weight * line.supports[-1].point[0]]
        self.force_scale = min(weights)
        self.force_floor = 16.0 * sys.float_info.epsilon * line.rope.EA * elements * degree * count
        names = [c.name for c in contacts]
        self._gaps = [k for k in range(count) if k in self.cars or k + 1 in self.cars]
        self._stops = [i for i, car in enumerate(line.cars) if car.kind == "free" and car.drive.resists]
        self.events = (
            *(f"{names[k]} meets {names[k + 1]}" for k in self._gaps),
            *(f"{line.cars[i].name} stops" for i in self._stops),
            *(f"{car.name} lifts off" for car in line.cars),
        )

    @cached_property
    def _kernel(self) -> Kernel:
        from cablefem.elements.segment_kernels import Kernel  # slow to load

        force = np.full(len(self.cars), -1)
        force[self.of_force] = self.force
        return Kernel(self.segments, np.array(self.cars, int), force, self.line.gravity)

    # --- coordinates ---------------------------------------------------------------------------------------
    def _slot(self, k: int) -> int:
        """Slot that the travel of car k prescribes."""
        return 2 * int(self.node[k]) if self.line.contacts[k].kind == "haul_x" else int(self.s[k])

    def _prescribe(self, k: int, contact: Contact | Car) -> None:
        point = 2 * self.node[k] + np.arange(2)
        if isinstance(contact, Car):
            if contact.travel is not None:
                self.free[self._slot(k)] = False
                self.prescribed.append((contact, self._slot(k)))
            return
        if contact.kind != "spring":
            self.free[point] = False
            self.constant[point] = contact.point
        if contact.kind in ("anchor", "spring"):
            self.free[self.s[k]] = False
            self.constant[self.s[k]] = (self.line.rope.length or 0.0) if k else 0.0

    def _sign(self, car: Car, phase: int) -> float:
        """Of the motion of a hauled car in a phase; of one at rest that it is about to take."""
        for i in range(phase, len(self.phases)):
            t0, t1 = self.phases[i]
            moved = self.line.position(car, t1, i)[0] - self.line.position(car, t0, i)[0]
            if moved:
                return float(np.sign(moved))
        return 1.0

    def known(self, t: float, phase: int) -> Slots:
        """Slots with what is prescribed at t; zero elsewhere."""
        out = Slots(self.constant.copy(), np.zeros(self.size), np.zeros(self.size))
        for car, slot in self.prescribed:
            out.q[slot], out.v[slot], out.a[slot] = self.line.position(car, t, phase)
        return out

    def slots(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Slots:
        out = self.known(t, phase)
        for x, unknown in zip(out, (q, v, a), strict=True):
            x[self.free] = unknown
        return out

    def motion(self, x: Slots) -> Motion:
        nodal = [z[: 2 * self.n].reshape(-1, 2)[self.nodes] for z in x]
        ends = [np.stack([z[self.s[:-1]], z[self.s[1:]]], axis=1) for z in x]
        return Motion(*nodal, *ends)

    # --- balance ---------------------------------------------------------------------------------------------
    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        return self.rows(t, self.slots(t, q, v, a, phase), phase)[self.free]

    def rows(self, t: float, x: Slots, phase: int, law: Law | None = None, cars: Cars | None = None) -> Array:
        """Rows of all slots (size,): what is missing from balance; of prescribed ones the force that they need."""
        rows = np.zeros(self.size)
        if self.cars and cars is None:
            cars = self.car_data(t, phase)
        if self.compiled and law is None:
            self._kernel.add_rows(len(self.nodes), x, cars, rows)
        else:
            self._add_rows(x, law, cars, rows)
        self._add_supports(rows, x)
        rows[self.force] = rows[self.kept]
        return rows

    def _add_rows(self, x: Slots, law: Law | None, cars: Cars | None, rows: Array) -> None:
        """Add the rows of the segments and the cars."""
        m = self.motion(x)
        nodes, ends = self.segments.residual(self.segments.points(m, law))
        points = rows[: 2 * self.n].reshape(-1, 2)
        points[:-1] += nodes[:, :-1].reshape(-1, 2)
        points[self.node[1:]] += nodes[:, -1]
        rows[self.s[:-1]] += ends[0]
        rows[self.s[1:]] += ends[1]
        if cars is not None:
            at = forces(cars, self.car_inputs(x, m))
            points[self.node[self.cars]] += at.contact
            rows[self.s[self.cars]] -= at.drive

    def _add_supports(self, rows: Array, x: Slots) -> None:
        for k, contact in self._outer:
            if contact.kind == "spring":
                slot = slice(2 * self.node[k], 2 * self.node[k] + 2)
                rows[slot] += np.multiply(contact.stiffness, x.q[slot] - contact.point)
                rows[slot] += (contact.mass or 0.0) * x.a[slot]
            if contact.kind == "counterweight":
                rows[self.s[k]] += self.pulley(k, x.v.item(self.s[k]), x.a.item(self.s[k]))

    def _weight(self, k: int) -> tuple[float, float]:
        """Mass of a counterweight for d2s/dt2, and +1 at the right end, -1 at the left one."""
        contact, sign = self.line.contacts[k], 1.0 if k else -1.0
        mass = contact.force / self.line.gravity if contact.mass is None else contact.mass
        return mass * (1.0 + contact.force / self.line.rope.EA), sign

    def pulley(self, k: int, ds: float, dds: float) -> float:
        """e [N + N^2/(2 EA) + q y - rho (ds lam)^2/2], N = G + e m (1 + G/EA) dds.

        The rope that passes takes the energy of its weight and its motion along.
        """
        contact, EA = self.line.contacts[k], self.line.rope.EA
        mass, sign = self._weight(k)
        N = contact.force + sign * mass * dds
        speed = ds * (1.0 + N / EA)
        entering = self.line.weight * contact.point[1] - 0.5 * self.segments.rho * speed**2
        return sign * (N + N**2 / (2.0 * EA) + entering)

    def car_inputs(self, x: Slots, m: Motion) -> Array:
        """Inputs (cars, INPUTS) of `bodies.forces`."""
        out = np.zeros((len(self.cars), INPUTS))
        if self.cars:
            left, right = self.segments.slopes_at_ends(m)
            k = np.array(self.cars)
            out[:, 0:2], out[:, 2:4], out[:, 4:6], out[:, 6:8] = right[k - 1], left[k], m.v[k, 0], m.a[k, 0]
            out[self.of_force, 8] = x.a[self.force]
        return out

    def car_data(self, t: float, phase: int) -> Cars:
        cars, line = self.line.cars, self.line
        thrust = np.array([line.thrust(c, t, phase) for c in cars])
        released = np.array([c.drive.hold(t) for c in cars])
        return Cars(*self._fixed, thrust, self.brakes, self.hold * released, self.signs, line.gravity)

    # --- start ---------------------------------------------------------------------------------------------
    def start(self, phase: int, state: State | None) -> State:
        """At rest with the cars held; prescribed cars move through states of rest with the first speed of theirs."""
        t = self.phases[phase][0]
        self.signs = np.array(
            [self._sign(c, phase) if c.travel else x for c, x in zip(self.line.cars, self.signs, strict=True)]
        )
        if state is not None:
            return consistent_acceleration(self, t, state.q, state.v, phase)
        from cablefem.elements.rest import at_rest, held_cars, rest

        q, v = rest(self, t, phase), np.zeros(self.size)
        if self.known(t, phase).v.any():
            v = (rest(self, t, phase, SHIFT, q) - rest(self, t, phase, -SHIFT, q)) / (2.0 * SHIFT)
        if self.cars:
            self._release(t, phase, at_rest(self, q), held_cars(self, t, phase))
        for x in (q, v):
            x[self.force] = 0.0
        return consistent_acceleration(self, t, q[self.free], v[self.free], phase)

    def _release(self, t: float, phase: int, x: Slots, held: Cars) -> None:
        """Let free cars go; they must move against friction."""
        self.hold[:] = 0.0
        slots = self.s[self.cars]
        stretch = forces(held, self.car_inputs(x, self.motion(x))).stretch
        self.hold = self.rows(t, x, phase, cars=held)[slots] / stretch
        for i, car in enumerate(self.line.cars):
            if car.kind == "free":
                self.brakes[i] = car.drive.brake(x.q[slots[i]])
        now = self.car_data(t, phase)
        loads = forces(now, self.car_inputs(x, self.motion(x))).normal
        free = now._replace(hold=np.zeros_like(now.hold), brake=now.hold * 0.0, friction=now.hold * 0.0)
        needed = self.rows(t, x, phase, cars=free)[slots] / stretch
        for i, car in enumerate(self.line.cars):
            if car.kind != "free":
                continue
            self.signs[i] = -np.sign(needed[i]) or 1.0
            if car.drive.resists and abs(needed[i]) <= car.drive.mu_r * abs(loads[i]) + self.brakes[i]:
                cause = f"friction holds {car.name} where it begins"
                raise StepFailure(t, cause, "begin on steeper rope or with less friction")

    # --- events --------------------------------------------------------------------------------------------
    def begin_step(self, x: State) -> None:
        """Keep the direction of friction, and the brakes that act, for one step."""
        slots = self.slots(*x)
        for i in self._stops:
            slot = self.s[self.cars[i]]
            self.signs[i] = np.sign(slots.v[slot]) or self.signs[i]
            self.brakes[i] = self.line.cars[i].drive.brake(slots.q[slot])

    def watch(self, x: State) -> tuple[float, ...]:
        if not self.cars:
            return ()
        slots = self.slots(*x)
        gaps = np.diff(slots.q[self.s])[self._gaps] - NEAREST
        ahead = [float(slots.v[self.s[self.cars[i]]] * self.signs[i]) for i in self._stops]
        loads = np.full(len(self.cars), np.inf)
        if gaps.min() > 0.0:
            loads = self._kernel.loads(len(self.nodes), slots, self.car_data(x.t, x.phase))
        return (*gaps.tolist(), *ahead, *loads.tolist())

    def pass_event(self, name: str, x: State) -> None:
        return None

    def observe(self, states: Sequence[State], s: Array) -> LineMotion:
        """What the states show, with the rope at the stations s (m,)."""
        return observe(self, states, s)

    # --- tangent ---------------------------------------------------------------------------------------------
    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> tuple[Array, Solve]:
        x = self.slots(t, q, v, a, phase)
        solve = self.solver(t, x, phase, (c0, c1, c2), self.free)
        return self.rows(t, x, phase)[self.free], lambda b: solve(b, self.free)

    def solver(
        self, t: float, x: Slots, phase: int, c: tuple[complex, complex, complex], free: Array, law: Law | None = None,
        cars: Cars | None = None,
    ) -> Callable[[Array, Array], Array]:  # fmt: skip
        """The solution with c0 dr/dq + c1 dr/dv + c2 dr/da of free slots; without c2 forces F/M count once."""
        kind = complex if any(isinstance(z, complex) for z in c) else float
        matrix = Bordered(2 * self.n, self.band, self.size - 2 * self.n, kind)
        if self.cars and cars is None:
            cars = self.car_data(t, phase)
        if self.compiled and law is None:
            self._kernel.add_tangent(len(self.nodes), x, cars, [kind(z) for z in c], matrix)
        else:
            self._add_tangent(x, law, cars, c, matrix)
        self._add_support_tangent(matrix, x, *c)
        for slot, kept in zip(self.force - 2 * self.n, self.kept, strict=True):
            matrix.copy_row(slot, int(kept))
        for slot in np.flatnonzero(~free):
            matrix.set_diagonal(int(slot), 1.0)
            matrix.clear_column(int(slot))
        return matrix.factored()

    def _add_tangent(
        self, x: Slots, law: Law | None, cars: Cars | None, c: tuple[complex, complex, complex], matrix: Bordered
    ) -> None:
        m = self.motion(x)
        parts = self.segments.tangent(self.segments.points(m, law), *c)
        matrix.add_segments(self.nodes[:, self.segments.dofs].reshape(-1, self.segments.degree + 1), self.nodes, parts)
        if cars is not None:
            self._add_car_tangent(matrix, cars, self.car_inputs(x, m), m, c)

    def _add_support_tangent(self, matrix: Bordered, x: Slots, c0: complex, c1: complex, c2: complex) -> None:
        for k, contact in self._outer:
            if contact.kind == "spring":
                for axis in range(2):
                    matrix.add(2 * self.node[k] + axis, 2 * self.node[k] + axis,
                               contact.stiffness[axis] * c0 + (contact.mass or 0.0) * c2)  # fmt: skip
            if contact.kind == "counterweight":
                EA, (mass, sign) = self.line.rope.EA, self._weight(k)
                N = contact.force + sign * mass * x.a[self.s[k]]
                rho, lam, ds = self.segments.rho, 1.0 + N / EA, x.v[self.s[k]]
                by_s = mass * (lam - rho * ds**2 * lam / EA) * c2 - sign * rho * ds * lam**2 * c1
                matrix.add(self.s[k], self.s[k], by_s)

    def _add_car_tangent(
        self, matrix: Bordered, cars: Cars, inputs: Array, m: Motion, c: tuple[complex, complex, complex]
    ) -> None:
        c0, c1, c2 = c
        by_input = derivatives(cars, inputs)
        by_input[:, 2] *= -1.0  # the row of s has - Q
        h, nodes = m.h[:, 0], self.nodes
        left, right = self.segments.end_slopes
        force_of = dict(zip(self.of_force.tolist(), self.force.tolist(), strict=True))
        for i, k in enumerate(self.cars):
            rows = [2 * self.node[k], 2 * self.node[k] + 1, self.s[k]]
            for first, shapes, j in ((0, right, k - 1), (2, left, k)):
                near = np.flatnonzero(shapes)
                for axis in range(2):
                    column = by_input[i, :, first + axis] * (c0 / h[j])
                    for node in near:
                        matrix.add_column(rows, 2 * nodes[j, node] + axis, column * shapes[node])
                    by_h = -column * inputs[i, first + axis]
                    matrix.add_column(rows, self.s[j + 1], by_h)
                    matrix.add_column(rows, self.s[j], -by_h)
            for axis in range(2):
                column = by_input[i, :, 4 + axis] * c1 + by_input[i, :, 6 + axis] * c2
                matrix.add_column(rows, 2 * self.node[k] + axis, column)
            if i in force_of:
                matrix.add_column(rows, force_of[i], by_input[i, :, 8] * (c2 or 1.0))


class Bordered:
    """A band matrix of n unknowns with border rows and columns; numbers count through."""

    def __init__(self, n: int, band: int, border: int, kind: type) -> None:
        self.n, self.b = n, band
        self.ab = np.zeros((3 * band + 1, n), kind, order="F")  # as LAPACK's gbtrf
        self.columns = np.zeros((n, border), kind)
        self.rows = np.zeros((border, n), kind)
        self.corner = np.zeros((border, border), kind)

    def add_segments(self, dofs: Array, nodes: Array, t: Tangent) -> None:
        """Add tangents of elements with nodes dofs (K E, n_loc) in segments with nodes (K, nn)."""
        count, axes = len(nodes), np.arange(2)
        slot = 2 * dofs[:, None, :] + axes[:, None]  # (K E, 2, n_loc)
        i, j = np.broadcast_arrays(slot[:, :, None, :, None], slot[:, None, :, None, :])
        np.add.at(self.ab, (2 * self.b + i - j, j), t.elements)
        node = 2 * nodes[..., None] + axes  # (K, nn, 2)
        for end in range(2):
            s = end + np.arange(count)
            self.columns[node, s[:, None, None]] += t.columns[end]
            self.rows[s[:, None, None], node] += t.rows[end]
            for other in range(2):
                self.corner[s, other + np.arange(count)] += t.corners[end, other]

    def add(self, i: int, j: int, value: complex) -> None:
        n = self.n
        if i < n and j < n:
            self.ab[2 * self.b + i - j, j] += value
        elif i < n:
            self.columns[i, j - n] += value
        elif j < n:
            self.rows[i - n, j] += value
        else:
            self.corner[i - n, j - n] += value

    def add_column(self, rows: list[int], j: int, values: Array) -> None:
        for i, value in zip(rows, values, strict=True):
            self.add(i, j, value)

    def _row(self, i: int) -> tuple[Array, Array]:
        """Numbers of the columns of row i < n in the band, and their places in it."""
        j = np.arange(max(0, i - self.b), min(self.n, i + self.b + 1))
        return j, 2 * self.b + i - j

    def copy_row(self, to: int, i: int) -> None:
        """Copy row i to the border row `to`."""
        if i >= self.n:
            self.rows[to], self.corner[to] = self.rows[i - self.n], self.corner[i - self.n]
            return
        j, at = self._row(i)
        self.rows[to], self.corner[to] = 0.0, self.columns[i]
        self.rows[to, j] = self.ab[at, j]

    def set_diagonal(self, i: int, value: complex) -> None:
        """Make row i zero but for its diagonal."""
        if i < self.n:
            j, at = self._row(i)
            self.ab[at, j] = 0.0
            self.columns[i] = 0.0
        else:
            self.rows[i - self.n] = 0.0
            self.corner[i - self.n] = 0.0
        self.add(i, i, value)

    def clear_column(self, j: int) -> None:
        """Make column j zero but for its diagonal."""
        if j < self.n:
            diagonal = self.ab[2 * self.b, j]
            self.ab[:, j] = 0.0
            self.ab[2 * self.b, j] = diagonal
            self.rows[:, j] = 0.0
        else:
            diagonal = self.corner[j - self.n, j - self.n]
            self.columns[:, j - self.n] = 0.0
            self.corner[:, j - self.n] = 0.0
            self.corner[j - self.n, j - self.n] = diagonal

    def factored(self):
        """A function of b (free,) and of which slots are free that returns the solution."""
        factor, substitute = get_lapack_funcs(("gbtrf", "gbtrs"), (self.ab,))
        lu, pivots, _ = factor(self.ab, self.b, self.b, overwrite_ab=True)
        beside = substitute(lu, self.b, self.b, self.columns, pivots)[0]
        schur = np.linalg.inv(self.corner - self.rows @ beside)

        def solve(b: Array, free: Array) -> Array:
            full = np.zeros(free.size, np.result_type(lu, b))
            full[free] = b
            inner = substitute(lu, self.b, self.b, full[: self.n], pivots)[0]
            border = schur @ (full[self.n :] - self.rows @ inner)
            return np.concatenate([inner - beside @ border, border])[free]

        return solve
