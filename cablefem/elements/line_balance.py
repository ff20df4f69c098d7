"""Balance of a line in motion: rows of all coordinates, and the solution with their tangent."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cablefem.elements.bodies import (
    INPUTS,
    CarLoadsAndMasses,
    car_force_jacobian,
    counterweight_row,
    forces_on_cars,
    masses_drag_and_friction,
)
from cablefem.elements.bordered import BandDerivatives, BandFactors
from cablefem.elements.line_coordinates import Coordinates, LineCoordinates, Mask
from cablefem.elements.segments import Law
from cablefem.elements.trolley import Slots
from cablefem.newmark import Array, Solve, TangentFactors
from cablefem.scene.contacts import MovingLine

if TYPE_CHECKING:
    from cablefem.elements.segment_kernels import Kernel


Derivatives = list[tuple[Array, Array]]  # see `Trolley.derivatives`


class RopeAndCars(NamedTuple):
    """What the balance depends on beside the coordinates."""

    law: Array  # (3, K, G) of the rope, see `segments.Law`
    cars: CarLoadsAndMasses


class CoordinateSolve(NamedTuple):
    """The solution for some of the coordinates."""

    factors: BandFactors  # of all
    size: int
    slots: Slots

    def __call__(self, b: Array) -> Array:
        full = np.zeros(self.size, b.dtype)
        full[self.slots] = b
        return self.factors(full)[self.slots]


class LineBalance(LineCoordinates):
    """The balance of a rope over contacts with cars.

    compiled : rows and tangents of segments, and many steps, by `segment_kernels` in the place of numpy; solutions are
    compiled anyway.
    """

    def __init__(self, line: MovingLine, elements: int, degree: int, compiled: bool) -> None:
        super().__init__(line, elements, degree)
        self.compiled = compiled
        count = len(self.nodes)
        self.law = np.array(self.segments.rope_law(count))  # (3, K, G)
        self.band = 2 * degree + 1
        self._set_springs_and_counterweights()
        weights = [car.mass * line.gravity for car in line.cars_on_rope]
        self.force_scale = min(weights, default=line.weight_per_length * line.supports[-1].point[0])
        self.force_floor = 16.0 * sys.float_info.epsilon * line.rope.EA * elements * degree * count
        self._unloaded_cars = masses_drag_and_friction(line.cars_on_rope, line.gravity)
        self._steady_cars: CarLoadsAndMasses | None = None  # those of cars that do not change
        self.signs = np.array([line.travel_direction(c, 0) if c.travel else 1.0 for c in line.cars_on_rope])
        self.brakes = np.zeros(len(line.cars_on_rope))  # [N] that act on free cars
        self.reached = np.zeros(len(line.cars_on_rope))  # [m] s up to which the brakes of free cars act
        self.held_since = np.zeros(len(line.cars_on_rope))  # [s] when friction last stopped free cars
        self.rear_brakes = np.zeros(len(line.cars_on_rope))  # [N] of them at the rear one of two wheels
        self.hold = np.zeros(len(line.cars_on_rope))  # [N] f that holds free cars at the start

    def _set_springs_and_counterweights(self) -> None:
        springs: list[tuple[Any, ...]] = []  # slot, stiffness and unloaded coordinate, along x and down
        weights = []  # slot, and numbers of `bodies.counterweight_row`
        EA = self.line.rope.EA
        for k, sign in ((0, -1.0), (-1, 1.0)):
            end = self.line.supports[k]
            if end.stiffness is not None:
                springs += zip(self.xy[k], end.stiffness, end.point, strict=True)
            if end.force is not None:
                mass = end.force / self.line.gravity * (1.0 + end.force / EA)
                potential = self.line.weight_per_length * end.point[1]
                weights.append((self.s[k], end.force, sign, mass, potential, self.segments.rho, EA))
        slots, self.stiffness, self.unloaded = np.array(springs).reshape(-1, 3).T.copy()  # rows, as kernels take them
        self.springs = slots.astype(int)
        table = np.array(weights).reshape(-1, 7)
        self.weights = table[:, 0].astype(int)
        self.weight_numbers = table[:, 1:]

    @cached_property
    def _kernel(self) -> Kernel:
        from cablefem.elements.segment_kernels import Kernel  # slow to load

        return Kernel(self)

    @property
    def sticking_unknowns(self) -> list[int]:
        """Numbers among the unknowns of s of cars that stick to the rope."""
        return []

    # --- rows --------------------------------------------------------------------------------------------------
    def residual(self, t: Any, q: Array, v: Array, a: Array, phase: int) -> Array:
        x = self.coordinates_from_unknowns(t, q, v, a, phase)
        return self._select_unknown_rows(self.balance_rows(t, x, phase))

    def _select_unknown_rows(self, rows: Array) -> Array:
        """Rows of the unknowns (..., n_dof), of rows (..., size); a car that sticks needs none, its s.. stays 0."""
        out = rows[..., self._unknown]
        out[..., self.sticking_unknowns] = 0.0
        return out

    def residuals(self, t: Array, q: Array, v: Array, a: Array, phase: int) -> Array:
        if not self.compiled:
            return super().residuals(t, q, v, a, phase)
        return self.residual(t, q, v, a, phase)

    def balance_rows(
        self, t: Array | float, x: Coordinates, phase: int, rope_and_cars: RopeAndCars | None = None
    ) -> Array:
        """Rows of all coordinates (..., size): what is missing from balance; of prescribed ones the force they need.

        x : (..., size) at the time or times t.  rope_and_cars : other than those of t.
        """
        law, cars = rope_and_cars or RopeAndCars(self.law, self.car_loads_and_masses(t, phase))
        rows = self._rope_rows_noting_loads(x, law, cars)
        self._add_support_rows(rows, x)
        for trolley in self.trolleys:
            inputs = trolley.force_inputs(x, rows[..., trolley.points.ravel()])
            forces = trolley.forces(cars, inputs)
            rows[..., trolley.rows] += np.stack(forces.rows, axis=-1)
        for slot, rail in self.rails:
            slope = rail.depth_with_derivatives(x.q[..., slot])[1]
            rows[..., slot] += slope * rows[..., slot + 1]
        for car in self.acting_off_rope:
            car.add_rows(rows.reshape(-1, self.size), np.ravel(t), np.reshape(x, (3, -1, self.size)), phase)
        rows[..., self.force] = rows[..., self.force_rows]
        return rows

    def _rope_rows_noting_loads(self, x: Coordinates, law: Array, cars: CarLoadsAndMasses) -> Array:
        """Rows (..., size) of segments and of cars on one contact; sets `loads` of these and the smallest tension."""
        rows = np.zeros(x.q.shape)
        each = rows.reshape(-1, self.size)
        self.loads = np.empty((len(each), len(self.point_cars) + 1))
        if self.compiled:
            at = [z.reshape(each.shape) for z in x]
            self._kernel.add_rows_and_set_loads(at, law, cars, each, self.loads)
        else:
            self._add_rope_rows_by_numpy(rows, x, Law(*law), cars)
        return rows

    def _add_rope_rows_by_numpy(self, rows: Array, x: Coordinates, law: Law, cars: CarLoadsAndMasses) -> None:
        values = self.segments.motion_at_points(self.segment_motion(x))
        fields = self.segments.fields_at_points(values, law)
        nodes, ends = self.segments.node_and_end_rows(fields)
        points = rows[: 2 * self.n].reshape(-1, 2)  # of all nodes, a view
        points[:-1] += nodes[:, :-1].reshape(-1, 2)
        points[self.node[1:]] += nodes[:, -1]
        rows[self.s[:-1]] += ends[0]
        rows[self.s[1:]] += ends[1]
        if self.point_cars:
            forces = forces_on_cars(cars, self.slopes_and_motion_at_cars(x))
            k = np.array(self.car_contacts, int)[self.point_cars]
            points[self.node[k]] += forces.contact[self.point_cars]
            rows[self.s[k]] -= forces.drive[self.point_cars]
            rows[self.swing] += forces.swing[self.of_swing]
            self.loads[0, :-1] = forces.normal[self.point_cars]
        shares = (fields.N * self.segments.weights).reshape(len(fields.N), self.segments.elements, -1)
        self.loads[0, -1] = self.segments.elements * shares.sum(axis=2).min()  # means over elements

    def _add_support_rows(self, rows: Array, x: Coordinates) -> None:
        rows[..., self.springs] += self.stiffness * (x.q[..., self.springs] - self.unloaded)
        ds = x.v[..., self.weights]
        dds = x.a[..., self.weights]
        rows[..., self.weights] += counterweight_row(self.weight_numbers.T, ds, dds)

    def slopes_and_motion_at_cars(self, x: Coordinates) -> Array:
        """Slopes beside each car, its v and a, F/M and the swing (..., cars, INPUTS), for `bodies.forces_on_cars`."""
        k = np.array(self.car_contacts, int)
        out = np.zeros((*x.q.shape[:-1], k.size, INPUTS))
        out[..., 0:4] = self.slopes_beside(k, x.q)
        out[..., 4:6] = x.v[..., self.xy[k]]
        out[..., 6:8] = x.a[..., self.xy[k]]
        out[..., self.of_force, 8] = x.a[..., self.force]
        out[..., self.of_swing, 9] = x.q[..., self.swing]
        out[..., self.of_swing, 10] = x.v[..., self.swing]
        out[..., self.of_swing, 11] = x.a[..., self.swing]
        return out

    def car_loads_and_masses(self, t: Array | float, phase: int) -> CarLoadsAndMasses:
        """At the time or at times t (n,); thrust and hold are (n, cars) then, if a car rolls freely."""
        if self._steady_cars is not None:
            return self._steady_cars
        cars = self._unloaded_cars._replace(brake=self.brakes, rear_brake=self.rear_brakes, sign=self.signs)
        if not self.free_cars:
            self._steady_cars = cars
            return cars
        times = np.ravel(t).tolist()
        thrust = np.empty((len(times), len(self.car_contacts)))
        remaining = np.empty(thrust.shape)
        for i, car in enumerate(self.line.cars_on_rope):
            thrust[:, i] = [self.line.thrust(car, at, phase) for at in times]
            remaining[:, i] = [car.drive.remaining_hold_fraction(at) for at in times]
        shape = (*np.shape(t), len(self.car_contacts))
        hold = self.hold * remaining
        return cars._replace(thrust=thrust.reshape(shape), hold=hold.reshape(shape))

    # --- tangent ---------------------------------------------------------------------------------------------
    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        return self.residual(t, q, v, a, phase), self.factorised_tangents(t, q, v, a, phase, [c])[0]

    def factorised_tangents(
        self, t: float, q: Array, v: Array, a: Array, phase: int, cs: Sequence[TangentFactors]
    ) -> list[Solve]:
        """The solutions for all unknowns; cars that stick have 0 in both sides."""
        x = self.coordinates_from_unknowns(t, q, v, a, phase)
        rope_and_cars = RopeAndCars(self.law, self.car_loads_and_masses(t, phase))
        derivatives = self._derivatives(x, rope_and_cars, self.moving_coordinates)
        solves: list[Any] = [CoordinateSolve(derivatives.factorise(c), self.size, self._unknown) for c in cs]
        return solves

    @property
    def moving_coordinates(self) -> Mask:
        """Which coordinates are unknown, and not of a car that sticks."""
        moving = self.free.copy()
        moving[self._unknown[self.sticking_unknowns]] = False
        return moving

    def rest_solver(self, x: Coordinates, rope_and_cars: RopeAndCars, free: Mask) -> CoordinateSolve:
        """The solution for free coordinates at rest, and F/M."""
        derivatives = self._derivatives(x, rope_and_cars, free)
        forces = self.force - derivatives.n
        for by_q, _, by_a in (derivatives.columns, derivatives.corner):
            by_q[:, forces] = by_a[:, forces]
        return CoordinateSolve(derivatives.factorise((1.0, 0.0, 0.0)), self.size, np.flatnonzero(free))

    def _derivatives(self, x: Coordinates, rope_and_cars: RopeAndCars, free: Mask) -> BandDerivatives:
        """Those of all rows, from which coordinates that are not free are dropped."""
        rope_rows = np.empty(0)
        if self.trolleys:
            rope_rows = self._rope_rows_noting_loads(x, *rope_and_cars)
        cars = rope_and_cars.cars
        points = self._point_car_derivatives(x, cars)
        wheels = [trolley.derivatives(x, rope_rows[trolley.points.ravel()], cars) for trolley in self.trolleys]
        out = self._rope_derivatives(x, rope_and_cars)
        self._add_contact_derivatives(out, x, points, wheels)
        out.drop_unknowns(np.flatnonzero(np.logical_not(free)))
        return out

    def _rope_derivatives(self, x: Coordinates, rope_and_cars: RopeAndCars) -> BandDerivatives:
        """Those of segments."""
        out = BandDerivatives(2 * self.n, self.size - 2 * self.n, self.band)
        if self.compiled:
            self._kernel.add_rope_derivatives(x, rope_and_cars, out)
            return out
        of_segments = self.segments.derivatives(self.segment_motion(x), Law(*rope_and_cars.law))
        of_nodes = self.xy_of_nodes.reshape(len(self.nodes), -1)
        slots = np.column_stack([of_nodes, self.s[:-1], self.s[1:]])  # (K, m)
        full = np.zeros((3, self.size, self.size))
        for to, of in zip(full, of_segments, strict=True):
            np.add.at(to, (slots[:, :, None], slots[:, None, :]), of)
        for row, values in enumerate(full.swapaxes(0, 1)):
            out.add_row(row, values)
        return out

    def _add_contact_derivatives(
        self, out: BandDerivatives, x: Coordinates, points: Derivatives, wheels: Derivatives
    ) -> None:
        """Add supports, cars, and the rows that determine F."""
        self._add_support_derivatives(out, x)
        slots = list(map(self._row_slots_of_car, self.point_cars))
        slots += [trolley.rows.tolist() for trolley in self.trolleys]
        for rows, (by_input, inputs) in zip(slots, [*points, *wheels], strict=True):
            for slot, values in zip(rows, (by_input @ inputs).swapaxes(0, 1), strict=False):
                out.add_row(slot, values)
        for trolley, (by_input, _) in zip(self.trolleys, wheels, strict=True):
            trolley.add_rope_and_follow(out, x.q[trolley.body[2]], by_input[:, 8:12])
        for slot, rail in self.rails:
            slope = rail.depth_with_derivatives(x.q[slot])[1]
            out.let_unknown_follow_previous(slot + 1, slope)
        for car in self.acting_off_rope:
            car.add_derivatives(out, x.q)
        for slot, row in zip(self.force.tolist(), self.force_rows.tolist(), strict=True):
            out.add_multiple_of_row(row, slot)

    def _add_support_derivatives(self, out: BandDerivatives, x: Coordinates) -> None:
        for slot, stiffness in zip(self.springs.tolist(), self.stiffness.tolist(), strict=True):
            out.add_entry(slot, slot, stiffness)
        for slot, numbers in zip(self.weights.tolist(), self.weight_numbers.tolist(), strict=True):
            force, sign, mass, _, rho, EA = numbers
            ds = x.v[slot]
            lam = 1.0 + (force + sign * mass * x.a[slot]) / EA
            by_dds = mass * (lam - rho * ds**2 * lam / EA)
            by_ds = sign * rho * ds * lam**2
            out.add_entry(slot, slot, 0.0, -by_ds, by_dds)

    def _row_slots_of_car(self, i: int) -> list[int]:
        """Slots of the rows of car i on one contact."""
        k = self.car_contacts[i]
        return [*self.xy[k], self.s[k], *self.swing[np.equal(self.of_swing, i)]]

    def _point_car_derivatives(self, x: Coordinates, cars: CarLoadsAndMasses) -> Derivatives:
        """Of the rows of cars on one contact, see `Trolley.derivatives`."""
        if not self.point_cars:
            return []
        jacobian = car_force_jacobian(cars, self.slopes_and_motion_at_cars(x))
        return [(jacobian[i], self._car_inputs_by_coordinates(i, x.q)) for i in self.point_cars]

    def _car_inputs_by_coordinates(self, i: int, q: Array) -> Array:
        k = self.car_contacts[i]
        out = np.zeros((3, INPUTS, self.size))
        out[0, :4] = self.slopes_beside_by_coordinates(k, q)
        out[1, [4, 5], self.xy[k]] = 1.0
        out[2, [6, 7], self.xy[k]] = 1.0
        out[2, 8, self.force[np.equal(self.of_force, i)]] = 1.0
        for order in range(3):
            out[order, 9 + order, self.swing[np.equal(self.of_swing, i)]] = 1.0
        return out
