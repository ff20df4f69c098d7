"""Compiled loops of a line in motion; tests hold them to numpy's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.elements.segment_kernels import balance
from cablefem.newmark import Array

if TYPE_CHECKING:
    from cablefem.elements.bodies import Cars
    from cablefem.elements.bordered import Bordered
    from cablefem.elements.segments import Law, Segments


class Kernel:
    """Rows and tangent of `count` segments and of cars on one contact each."""

    def __init__(
        self, segments: Segments, count: int, cars: Array, contacts: Array, slots: Sequence[Array], gravity: float
    ) -> None:
        """cars : their numbers among all.  slots : of F/M and of phi of these cars, or -1."""
        points, first = segments.xi.size // segments.elements, segments.dofs[0]
        phi, phi_xi = (np.ascontiguousarray(x[:points, first]) for x in (segments.values, segments.slopes))
        xi = segments.xi.reshape(segments.elements, points)
        dofs = np.ascontiguousarray(segments.dofs)
        self.mesh = balance.Mesh(phi, phi_xi, segments.weights[:points].copy(), xi, dofs, segments.end_slopes)
        self.rope = balance.Rope(segments.rho, segments.q, float(segments.rope.damping))
        self.count, self.cars, self.contacts, self.slots, self.gravity = count, cars, contacts, slots, float(gravity)

    def _cars(self, cars: Cars) -> tuple[Any, ...]:
        data = np.ascontiguousarray(np.array(cars[:12]).T[self.cars])
        return self.mesh, self.count, self.contacts, data, self.gravity, *self.slots

    def add_rows(self, x: Sequence[Array], law: Law, cars: Cars | None, rows: Array) -> float:
        """Add rows to (size,) and return the smallest tension; x : q, v, a of all slots."""
        z = np.array(x)
        lowest = balance.add_rows(self.mesh, self.rope, np.array(law), z, rows)
        if cars is not None:
            balance.add_cars(*self._cars(cars), z, rows)
        return lowest

    def loads(self, x: Sequence[Array], cars: Cars) -> Array:
        """Loads [N] of these cars on the rope."""
        z = np.array(x)
        return balance.add_cars(*self._cars(cars), z, np.empty(z.shape[1]))

    def add_tangent(
        self, x: Sequence[Array], law: Law, cars: Cars | None, c: Sequence[complex], matrix: Bordered
    ) -> None:
        z = np.array(x)
        border = balance.Border(matrix.ab, matrix.columns, matrix.rows, matrix.corner)
        balance.add_tangent(self.mesh, self.rope, np.array(law), z, *c, border)
        if cars is not None:
            balance.add_car_tangent(*self._cars(cars), z, *c, border)
