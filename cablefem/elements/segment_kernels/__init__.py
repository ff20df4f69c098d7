"""Compiled rows of a line in motion, of all coordinates, and its steps."""

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
    from cablefem.elements.line_balance import LineBalance
    from cablefem.scene.rail import Rail

TROLLEY_DATA = ("thrust", "brake", "hold", "sign", "rear_brake")  # of `contacts.Line`


def rails_for_kernels(rails: Sequence[tuple[int, Rail]]) -> contacts.Rails:
    """Those of cars on shoes; rails : with slots of x."""
    return contacts.Rails(
        np.array([x for x, _ in rails], int),
        np.array([rail.begin.x for _, rail in rails]),
        np.array([rail.end.x - rail.begin.x for _, rail in rails]),
        np.array([rail.coefficients for _, rail in rails]).reshape(-1, 6),
    )


class Kernel:
    """Rows and steps of a line but for what its cars off the rope add."""

    def __init__(self, system: LineBalance) -> None:
        segments = system.segments
        xi = segments.xi.reshape(segments.elements, -1)
        weights = segments.weights[: xi.shape[1]].copy()
        dofs = np.ascontiguousarray(segments.dofs)
        self.rope = balance.Rope(
            segments.phi,
            segments.phi_xi,
            weights,
            xi,
            dofs,
            segments.end_slopes,
            segments.rho,
            segments.q,
            segments.damping,
        )
        self.cars = np.array(system.point_cars, int)
        car_contacts = np.array(system.car_contacts, int)
        swings = np.full(car_contacts.size, -1)
        swings[system.of_swing] = system.swing
        first_wheel = np.searchsorted(system.car_of_wheel, np.arange(car_contacts.size))
        self.points = balance.Cars(
            car_contacts[self.cars], system._force_slots[self.cars], swings[self.cars], first_wheel[self.cars]
        )
        self.wheels = len(system.car_of_wheel)
        self.supports = contacts.Supports(
            system.springs, system.stiffness, system.unloaded, system.weights, system.weight_numbers
        )
        trolleys = system.trolleys
        self.of_trolleys = np.array([trolley.i for trolley in trolleys], int)
        self.trolleys = contacts.Trolleys(
            np.array([trolley.k for trolley in trolleys], int),
            np.array([trolley.points for trolley in trolleys], int).reshape(-1, 2, 2),
            np.array([trolley.body for trolley in trolleys], int).reshape(-1, 3),
            np.array([trolley.force for trolley in trolleys], int),
            first_wheel[self.of_trolleys],
            np.array([trolley.numbers for trolley in trolleys]).reshape(-1, 14),
        )
        self.rails = rails_for_kernels(system.rails)
        self.force_rows = np.stack([system.force, system.force_rows], axis=1)
        self._known: tuple[Any, Any] = None, None  # the last data of cars, and as arrays

    def _line_for_kernels(self, law: Array, cars: CarLoadsAndMasses) -> contacts.Line:
        """All that touches the rope under a law (3, K, G)."""
        if cars is not self._known[0]:
            self._known = cars, self._car_data_on_one_and_two_contacts(cars)
        return contacts.Line(
            self.rope, law, self.points, self.supports, self.trolleys, self.rails, self.force_rows, *self._known[1]
        )

    def _car_data_on_one_and_two_contacts(self, cars: CarLoadsAndMasses) -> tuple[Array, Array]:
        """Data of cars on one contact, and of those on two."""
        shape = (cars.thrust + cars.hold).shape
        data = np.empty((*shape, len(cars)))
        for i, values in enumerate(cars):
            data[..., i] = values
        data = data.reshape(math.prod(shape[:-1]), shape[-1], len(cars))
        of_trolleys = [cars._fields.index(name) for name in TROLLEY_DATA]
        on_two = np.ascontiguousarray(data[:, self.of_trolleys][..., of_trolleys])
        return np.ascontiguousarray(data[:, self.cars, :13]), on_two

    def set_dependent_coordinates(self, z: Array) -> None:
        """Let wheels follow their cars, and cars on shoes their rails, in coordinates with rates z (3, n, size)."""
        contacts.set_dependent_coordinates(self.trolleys, self.rails, z)

    def rows_and_loads(self, z: Array, law: Array, cars: CarLoadsAndMasses) -> tuple[Array, Array]:
        """Rows (n, size) of coordinates with rates z (3, n, size), and what `contacts.set_rows_and_loads` has more."""
        rows = np.empty(z.shape[1:])
        loads = np.empty((len(rows), self.wheels + 1))
        contacts.set_rows_and_loads(self._line_for_kernels(law, cars), 0, z, rows, loads)
        return rows, loads

    def take_steps_while_factors_serve(
        self, law: Array, cars: CarLoadsAndMasses, slots: Any, moving: Any, prescribed: Array, steps: StepsWithFactors
    ) -> int:
        """See `newmark.MarchingSystem`.

        cars : at all nodes of all steps;  prescribed : coordinates with rates there (3, m, s, size).
        slots, moving : see `compiled_collocation.March`.
        """
        at_nodes = np.ascontiguousarray(np.moveaxis(prescribed, 0, 1))
        system = march.System(self._line_for_kernels(law, cars), slots, at_nodes)
        return int(march.take_steps_while_factors_serve(system, moving, steps))
