"""Compiled loops of a line in motion; tests hold them to numpy's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.elements.segment_kernels import balance, contacts, march
from cablefem.newmark import Array
from cablefem.newmark.marching import StepsWithFactors

if TYPE_CHECKING:
    from cablefem.elements.bodies import CarLoadsAndMasses
    from cablefem.elements.bordered import BandDerivatives
    from cablefem.elements.line_balance import LineBalance, RopeAndCars

TROLLEY_DATA = ("thrust", "brake", "hold", "sign", "rear_brake")  # columns of `contacts.Trolleys.data`


class Kernel:
    """Rows and tangent of segments and of cars on one contact each; steps of whole lines without cars off the rope."""

    def __init__(self, system: LineBalance) -> None:
        segments = system.segments
        points = segments.xi.size // segments.elements
        first = segments.dofs[0]
        phi = np.ascontiguousarray(segments.values[:points, first])
        phi_xi = np.ascontiguousarray(segments.slopes[:points, first])
        xi = segments.xi.reshape(segments.elements, points)
        dofs = np.ascontiguousarray(segments.dofs)
        weights = segments.weights[:points].copy()
        self.mesh = balance.Mesh(phi, phi_xi, weights, xi, dofs, segments.end_slopes)
        self.rope = balance.Rope(segments.rho, segments.q, segments.damping)
        self.cars = np.array(system.point_cars, int)
        car_contacts = np.array(system.car_contacts, int)
        self.contacts = car_contacts[self.cars]
        swings = np.full(car_contacts.size, -1)
        swings[system.of_swing] = system.swing
        self.swings = swings[self.cars]
        self.forces = system._force_slots[self.cars]
        self.trolleys = np.array([trolley.i for trolley in system.trolleys], int)
        self._known: tuple[Any, Any] = None, None  # the last data, and as arrays
        self._set_contacts(system)

    def _set_contacts(self, system: LineBalance) -> None:
        """Set what else touches the rope."""
        self.supports = contacts.Supports(
            system.springs, system.stiffness, system.unloaded, system.weights, system.weight_numbers
        )
        trolleys = system.trolleys
        self.on_wheels = (
            np.array([trolley.k for trolley in trolleys], int),
            np.array([trolley.body for trolley in trolleys], int).reshape(-1, 3),
            np.array([trolley.force for trolley in trolleys], int),
            np.array([trolley.numbers for trolley in trolleys]).reshape(-1, 14),
        )
        self.rails = contacts.Rails(
            np.array([x for x, _ in system.rails], int),
            np.array([rail.begin.x for _, rail in system.rails]),
            np.array([rail.end.x - rail.begin.x for _, rail in system.rails]),
            np.array([rail.coefficients for _, rail in system.rails]).reshape(-1, 6),
        )
        self.force_rows = np.stack([system.force, system.force_rows], axis=1)

    def _line(self, law: Array, cars: CarLoadsAndMasses) -> balance.Line:
        return balance.Line(self.mesh, self.rope, law, self._car_data(cars)[0])

    def _car_data(self, cars: CarLoadsAndMasses) -> tuple[balance.Cars, contacts.Trolleys]:
        """The cars with their data, made once if the same `cars` come again."""
        if cars is self._known[0]:
            return self._known[1]
        shape = (cars.thrust + cars.hold).shape
        data = np.empty((*shape, len(cars)))
        for i, values in enumerate(cars):
            data[..., i] = values
        data = data.reshape(math.prod(shape[:-1]), shape[-1], len(cars))
        points = np.ascontiguousarray(data[:, self.cars, :13])
        of_trolleys = [cars._fields.index(name) for name in TROLLEY_DATA]
        trolleys = np.ascontiguousarray(data[:, self.trolleys][..., of_trolleys])
        on_one = balance.Cars(self.contacts, self.forces, self.swings, points)
        self._known = cars, (on_one, contacts.Trolleys(*self.on_wheels, trolleys))
        return self._known[1]

    def add_rows_and_set_loads(
        self, x: Sequence[Array], law: Array, cars: CarLoadsAndMasses, rows: Array, loads_and_min_tension: Array
    ) -> None:
        """Add rows to (n, size), and set (n, cars + 1): loads [N] on the rope, smallest mean tension of an element.

        x : q, v, a of all coordinates (n, size); law : (3, K, G).
        """
        at = balance.Coordinates(*x)
        balance.add_rows_and_set_loads(self._line(law, cars), at, rows, loads_and_min_tension)

    def add_rope_derivatives(self, x: Sequence[Array], rope_and_cars: RopeAndCars, out: BandDerivatives) -> None:
        """See `balance.add_rope_derivatives`; x : q, v, a (size,)."""
        line = self._line(*rope_and_cars)
        bands = balance.Bands(out.ab, out.columns, out.rows, out.corner)
        balance.add_rope_derivatives(line, balance.Coordinates(*x), bands)

    def take_steps_with_factors(
        self, law: Array, cars: CarLoadsAndMasses, slots: Any, moving: Any, prescribed: Array, steps: StepsWithFactors
    ) -> int:
        """See `newmark.MarchingSystem`.

        cars : at all nodes of all steps;  prescribed : coordinates with rates there (3, m, s, size).
        slots, moving : see `compiled_collocation.March`.
        """
        on_one, trolleys = self._car_data(cars)
        line = balance.Line(self.mesh, self.rope, law, on_one)
        whole = contacts.Contacts(line, self.supports, trolleys, self.rails, self.force_rows)
        system = march.System(whole, slots, np.ascontiguousarray(np.moveaxis(prescribed, 0, 2)))
        return int(march.take_steps_with_factors(system, moving, steps))
