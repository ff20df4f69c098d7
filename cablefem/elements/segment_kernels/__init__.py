"""Compiled loops of a line in motion; tests hold them to numpy's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.elements.segment_kernels import balance
from cablefem.newmark import Array

if TYPE_CHECKING:
    from cablefem.elements.bodies import CarLoadsAndMasses
    from cablefem.elements.bordered import BandMatrix
    from cablefem.elements.segments import Segments


class Kernel:
    """Rows and tangent of segments and of cars on one contact each."""

    def __init__(self, segments: Segments, cars: Any, contacts: Any, slots: Sequence[Any], gravity: float) -> None:
        """cars : their numbers among all;  contacts : theirs;  slots : of F/M and of phi of these cars, or -1."""
        points = segments.xi.size // segments.elements
        first = segments.dofs[0]
        phi = np.ascontiguousarray(segments.values[:points, first])
        phi_xi = np.ascontiguousarray(segments.slopes[:points, first])
        xi = segments.xi.reshape(segments.elements, points)
        dofs = np.ascontiguousarray(segments.dofs)
        weights = segments.weights[:points].copy()
        self.mesh = balance.Mesh(phi, phi_xi, weights, xi, dofs, segments.end_slopes)
        self.rope = balance.Rope(segments.rho, segments.q)
        self.cars = cars
        self.contacts = contacts
        self.gravity = float(gravity)
        self.forces, self.swings = slots
        self._known: tuple[Any, Any] = None, None  # the last data, and as an array

    def _line(self, law: Array, cars: CarLoadsAndMasses) -> balance.Line:
        return balance.Line(self.mesh, self.rope, law, self._kernel_cars(cars))

    def _kernel_cars(self, cars: CarLoadsAndMasses) -> balance.Cars:
        """The cars with their data, made once if the same `cars` come again."""
        if cars is self._known[0]:
            return self._known[1]
        shape = (cars.thrust + cars.hold).shape
        data = np.empty((*shape, 12))
        for i, values in enumerate(cars[:12]):
            data[..., i] = values
        instants = math.prod(shape[:-1])
        data = data.reshape(instants, shape[-1], 12)[:, self.cars]
        self._known = cars, balance.Cars(self.contacts, self.forces, self.swings, self.gravity, data)
        return self._known[1]

    def add_rows_and_set_loads(
        self, x: Sequence[Array], law: Array, cars: CarLoadsAndMasses, rows: Array, loads_and_min_tension: Array
    ) -> None:
        """Add rows to (n, size), and set (n, cars + 1) to the loads [N] on the rope and the smallest tension.

        x : q, v, a of all coordinates (n, size); law : (3, K, G).
        """
        at = balance.Coordinates(*x)
        balance.add_rows_and_set_loads(self._line(law, cars), at, rows, loads_and_min_tension)

    def add_tangent(
        self, x: Sequence[Array], law: Array, cars: CarLoadsAndMasses, factors: Array, matrix: BandMatrix
    ) -> None:
        """Add c0 d/dq + c1 d/dv + c2 d/da of the rows at one instant; x : q, v, a (size,).

        factors : (4,) c0, c1, c2, and that of F/M.
        """
        at = balance.Coordinates(*x)
        band = balance.Band(matrix.ab, matrix.columns, matrix.rows, matrix.corner)
        balance.add_tangent(self._line(law, cars), at, tuple(factors.tolist()), band)
