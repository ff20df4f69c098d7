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
    """The balance of a rope over contacts with cars; `segment_kernels` has the rows."""

    def __init__(self, line: MovingLine, elements: int, degree: int) -> None:
        super().__init__(line, elements, degree)
        count = len(self.nodes)
        self.law = np.array(self.segments.rope_law(count))  # (3, K, G)
        nodes = self.xy_of_nodes[:, self.segments.dofs].reshape(count, elements, -1)
        ends = np.stack([self.s[:-1], self.s[1:]], axis=1)
        of_elements = np.broadcast_to(ends[:, None], (count, elements, 2))
        self._element_slots = np.concatenate([nodes, of_elements], axis=2)  # x and y of nodes, and both s
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
        weights = []  # slot, and numbers of `bodies.counterweight_balance_row`
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
    def sticking_unknown_indices(self) -> list[int]:
        """Numbers among the unknowns of s of cars that stick to the rope."""
        return []

    # --- coordinates ---------------------------------------------------------------------------------------------
    def all_coordinates_from_unknowns(self, t: Array | float, q: Array, v: Array, a: Array, phase: int) -> Coordinates:
        """All coordinates (..., size), from the unknowns (..., n_dof) and what is prescribed at t (...)."""
        out = self.prescribed_coordinates(t, phase)
        out[..., self._unknown] = q, v, a
        return self.fill_dependent_coordinates(out)

    def fill_dependent_coordinates(self, z: Array) -> Coordinates:
        """Coordinates of z (3, ..., size), where wheels are set to follow their cars, and cars on shoes their rails."""
        self._kernel.set_dependent_coordinates(z.reshape(3, -1, self.size))
        return Coordinates(*z)

    # --- rows --------------------------------------------------------------------------------------------------
    def residual(self, t: Any, q: Array, v: Array, a: Array, phase: int) -> Array:
        x = self.all_coordinates_from_unknowns(t, q, v, a, phase)
        rows = self.balance_rows_storing_loads(t, x, phase)[..., self._unknown]
        rows[..., self.sticking_unknown_indices] = 0.0  # needs none, its s.. stays 0
        return rows

    def residuals(self, t: Array, q: Array, v: Array, a: Array, phase: int) -> Array:
        return self.residual(t, q, v, a, phase)

    def balance_rows_storing_loads(
        self,
        t: Array | float,
        x: Coordinates,
        phase: int,
        *,
        cars: CarLoadsAndMasses | None = None,
        law: Array | None = None,
    ) -> Array:
        """Rows of all coordinates (..., size): what is missing from balance; of prescribed ones the force they need.

        Sets `loads` (n, .) [N] of all wheels, and last the smallest tension, the mean over an element.
        x : (..., size) at the time or times t.  cars : other than those of t.  law : (3, K, G), other than the rope's.
        """
        cars = cars or self.car_loads_and_masses(t, phase)
        law = self.law if law is None else law
        z = np.reshape(x, (3, -1, self.size))
        rows, self.loads = self._kernel.rows_and_loads(z, law, cars)
        for car in self.acting_off_rope:
            car.add_to_rows(rows, np.ravel(t), z, phase)
        return rows.reshape(x.q.shape)

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
        thrust = np.empty((*np.shape(t), len(self.car_contacts)))
        hold = np.empty(thrust.shape)
        for i, car in enumerate(self.line.cars_on_rope):
            thrust[..., i] = self.line.thrust_of_free_car(car, t, phase)
            hold[..., i] = self.hold[i] * car.drive.remaining_hold_fraction(t)
        return cars._replace(thrust=thrust, hold=hold)

    # --- tangent ---------------------------------------------------------------------------------------------
    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        return self.residual(t, q, v, a, phase), self.factorised_tangents(t, q, v, a, phase, [c])[0]

    def factorised_tangents(
        self, t: float, q: Array, v: Array, a: Array, phase: int, cs: Sequence[TangentFactors]
    ) -> list[Solve]:
        """The solutions for all unknowns; cars that stick have 0 in both sides."""
        x = self.all_coordinates_from_unknowns(t, q, v, a, phase)
        cars = self.car_loads_and_masses(t, phase)
        derivatives = self._derivatives_of_free_rows(x, self.law, cars, self.moving_coordinates)
        solves: list[Any] = [CoordinateSolve(derivatives.factorise(c), self.size, self._unknown) for c in cs]
        return solves

    @property
    def moving_coordinates(self) -> Mask:
        """Which coordinates are unknown, and not of a car that sticks."""
        moving = self.free.copy()
        moving[self._unknown[self.sticking_unknown_indices]] = False
        return moving

    def rest_solver(self, x: Coordinates, law: Array, cars: CarLoadsAndMasses, free: Mask) -> CoordinateSolve:
        """The solution for free coordinates at rest, and F/M."""
        derivatives = self._derivatives_of_free_rows(x, law, cars, free)
        by_q, _, by_a = derivatives.values
        by_q[:, self.force] = by_a[:, self.force]
        return CoordinateSolve(derivatives.factorise((1.0, 0.0, 0.0)), self.size, np.flatnonzero(free))

    def _derivatives_of_free_rows(
        self, x: Coordinates, law: Array, cars: CarLoadsAndMasses, free: Mask
    ) -> BandDerivatives:
        """Those of all rows, from which coordinates that are not free are dropped."""
        out = BandDerivatives(2 * self.n, self.size, self.band)
        blocks = self.segments.element_derivatives(self.segment_motion(x), Law(*law))
        out.add_blocks(self._element_slots, blocks)
        wheels: Derivatives = []
        if self.trolleys:
            rows, _ = self._kernel.rows_and_loads(np.reshape(x, (3, 1, self.size)), law, cars)
            wheels = [trolley.derivatives(x, rows[0, trolley.points.ravel()], cars) for trolley in self.trolleys]
        self._add_contact_derivatives(out, x, self._point_car_derivatives(x, cars), wheels)
        out.drop_unknowns(np.flatnonzero(np.logical_not(free)))
        return out

    def _add_contact_derivatives(
        self, out: BandDerivatives, x: Coordinates, points: Derivatives, wheels: Derivatives
    ) -> None:
        """Add supports, cars, and the rows that determine F."""
        self._add_support_derivatives(out, x)
        slots = list(map(self._row_slots_of_car, self.point_cars))
        slots += [trolley.row_slots.tolist() for trolley in self.trolleys]
        for rows, (by_input, inputs) in zip(slots, [*points, *wheels], strict=True):
            for slot, values in zip(rows, (by_input @ inputs).swapaxes(0, 1), strict=False):
                out.values[:, slot] += values
        for trolley, (by_input, _) in zip(self.trolleys, wheels, strict=True):
            trolley.add_rope_and_follow(out, x.q[trolley.body[2]], by_input[:, 8:12])
        for slot, rail in self.rails:
            slope = rail.depth_with_derivatives(x.q[slot])[1]
            out.values[:, slot] += slope * out.values[:, slot + 1]
            out.values[:, :, slot] += slope * out.values[:, :, slot + 1]
        for car in self.acting_off_rope:
            car.add_derivatives(out, x.q)
        out.values[:, self.force] += out.values[:, self.force_rows]

    def _add_support_derivatives(self, out: BandDerivatives, x: Coordinates) -> None:
        for slot, stiffness in zip(self.springs.tolist(), self.stiffness.tolist(), strict=True):
            out.values[0, slot, slot] += stiffness
        for slot, numbers in zip(self.weights.tolist(), self.weight_numbers.tolist(), strict=True):
            force, sign, mass, _, rho, EA = numbers
            ds = x.v[slot]
            lam = 1.0 + (force + sign * mass * x.a[slot]) / EA
            by_dds = mass * (lam - rho * ds**2 * lam / EA)
            by_ds = sign * rho * ds * lam**2
            out.values[1:, slot, slot] += -by_ds, by_dds

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
