"""Compiled loops of a line in motion; tests hold them to numpy's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.elements.segment_kernels import balance
from cablefem.newmark import Array

if TYPE_CHECKING:
    from cablefem.elements.bodies import Cars
    from cablefem.elements.segments import Segments
    from cablefem.elements.system import Bordered


NONE = np.zeros((1, 1))


class Kernel:
    """Rows and tangent of segments and of cars at some of the contacts."""

    def __init__(self, segments: Segments, contacts: Array, force: Array, gravity: float) -> None:
        """force : slots of F/M of the cars, or -1."""
        points, n_loc = segments.xi.size // segments.elements, segments.degree + 1
        first = segments.dofs[0]
        phi, phi_xi = (np.ascontiguousarray(x[:points, first]) for x in (segments.values, segments.slopes))
        assert phi.shape == (points, n_loc)
        xi = segments.xi.reshape(segments.elements, points)
        dofs = np.ascontiguousarray(segments.dofs)
        mesh = balance.Mesh(phi, phi_xi, segments.weights[:points].copy(), xi, dofs, segments.end_slopes)
        rope = balance.Rope(segments.rho, segments.q, float(segments.rope.EA), float(segments.rope.damping))
        self.segments, self.mesh, self.rope = segments, mesh, rope
        self.cars = contacts, force, float(gravity)

    def _law(self, z: Array, count: int) -> tuple[Array, Array]:
        """N_r and dN_r/ds at the points, (K, G) or (1, 1)."""
        if self.segments.rope.rest_tension is None:
            return NONE, NONE
        first = 2 * (count * (self.segments.nn - 1) + 1)
        s = z[0, first : first + count + 1]
        return self.segments.rope.at_rest(s[:-1, None] + np.diff(s)[:, None] * self.segments.xi)

    def _car_arguments(self, cars: Cars) -> tuple[Any, ...]:
        contacts, force, gravity = self.cars
        return contacts, np.ascontiguousarray(np.array(cars[:8]).T), gravity, force

    def add_rows(self, count: int, x: Sequence[Array], cars: Cars | None, rows: Array) -> None:
        """Add rows to (size,); x : q, v, a of all slots of `count` segments."""
        z = np.array(x)
        balance.add_rows(self.mesh, self.rope, count, z, *self._law(z, count), rows)
        if cars is not None:
            balance.add_cars(self.mesh, count, *self._car_arguments(cars), z, rows)

    def loads(self, count: int, x: Sequence[Array], cars: Cars) -> Array:
        """Loads (cars,) [N] of the cars on the rope."""
        z = np.array(x)
        return balance.add_cars(self.mesh, count, *self._car_arguments(cars), z, np.empty(z.shape[1]))

    def add_tangent(
        self, count: int, x: Sequence[Array], cars: Cars | None, c: Sequence[complex], matrix: Bordered
    ) -> None:
        z = np.array(x)
        border = balance.Border(matrix.ab, matrix.columns, matrix.rows, matrix.corner)
        balance.add_tangent(self.mesh, self.rope, count, z, *self._law(z, count), *c, border)
        if cars is not None:
            balance.add_car_tangent(self.mesh, count, *self._car_arguments(cars), z, *c, border)
