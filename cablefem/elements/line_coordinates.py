"""Coordinates of a line in motion: which there are, which are prescribed, and which follow from others.

They are x and y of the nodes, s of the contacts, F/M of hauled cars, swing of cabins, point and pitch of cars on two
wheels; a slot is the index of one.  F/M is an acceleration.  Prescribed coordinates drop out; the row that a prescribed
one leaves determines F.  The nodes at two wheels follow their car.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.elements.off_rope import CarOnShoeOffRope
from cablefem.elements.segments import Motion, Segments
from cablefem.elements.trolley import Slots, Trolley
from cablefem.newmark import Array, System
from cablefem.scene.contacts import Car, Contact, MovingLine, Wheel
from cablefem.scene.rail import Rail

Mask = NDArray[np.bool_]


class Coordinates(NamedTuple):
    """Positions, velocities and accelerations of all coordinates, (..., size) each."""

    q: Array
    v: Array
    a: Array


class LineCoordinates(System):
    """The coordinates of a rope over contacts with cars; `elements` of `degree` on each segment."""

    def __init__(self, line: MovingLine, elements: int, degree: int) -> None:
        self.line = line
        count = len(line.contacts_and_wheels) - 1
        self.segments = Segments(line.rope, line.gravity, elements, degree)
        self.phases = line.phases
        self.node = (self.segments.nn - 1) * np.arange(count + 1)  # of each contact
        self.nodes = self.node[:-1, None] + np.arange(self.segments.nn)  # of each segment, (K, nn)
        self.n = int(self.node[-1]) + 1
        self._number_slots()
        self._number_body_slots(int(self.s[-1]) + 1 + len(self.force))
        self.force_rows = np.array([self.slot_set_by_travel(i) for i in self.of_force], int)  # rows that determine F
        self._set_rails_and_cars_off_rope()
        self._set_prescribed_coordinates()
        self._unknown = np.flatnonzero(self.free)
        self.n_dof = self._unknown.size

    def _number_slots(self) -> None:
        """Number contacts of cars and supports, and the slots of s and F/M."""
        self.xy = 2 * self.node[:, None] + np.arange(2)  # slots of x and y of the contacts, (contacts, 2)
        self.xy_of_nodes = 2 * self.nodes[..., None] + np.arange(2)  # of the nodes of segments, (K, nn, 2)
        self.s = 2 * self.n + np.arange(self.node.size)  # slots of s of the contacts
        self.car_contacts: list[int] = []  # contact of each car; of two wheels the front one
        self.support_contacts: list[int] = []  # contact of each support
        for k, contact in enumerate(self.line.contacts_and_wheels):
            if isinstance(contact, Contact):
                self.support_contacts.append(k)
            elif isinstance(contact, Car) or contact.front:
                self.car_contacts.append(k)
        # numbers of hauled cars, and their slots of F/M
        self.of_force = [i for i, car in enumerate(self.line.cars_on_rope) if car.drive.mode == "haul"]
        self.force = self.s[-1] + 1 + np.arange(len(self.of_force))
        self.free_cars = [i for i, car in enumerate(self.line.cars_on_rope) if car.drive_mode_or_haul_x == "free"]

    @property
    def _force_slots(self) -> Slots:
        """Slots of F/M of the cars, or -1."""
        slots = np.full(len(self.car_contacts), -1)
        slots[self.of_force] = self.force
        return slots

    def _number_body_slots(self, first: int) -> None:
        """Give cabins and cars on two wheels their slots, from `first` on."""
        cars = list(enumerate(self.line.cars_on_rope))
        self.of_swing = [i for i, car in cars if car.hanger is not None]
        self.swing = first + np.arange(len(self.of_swing))  # slots of phi
        first += len(self.of_swing)
        self.trolleys = [
            Trolley(car, i, self.car_contacts[i], self.line.gravity) for i, car in cars if car.wheels is not None
        ]
        for trolley in self.trolleys:
            force = int(self._force_slots[trolley.i])
            body = first + np.arange(3)
            trolley.set_slots(body, force, self)
            first += 3
        swinging = self.line.swinging_cars_off_rope
        self.swing_off_rope = {car.name: first + i for i, car in enumerate(swinging)}  # slots of phi
        self.size = first + len(self.swing_off_rope)
        self.point_cars = [i for i, car in cars if car.wheels is None]  # numbers of the cars on one contact
        self.car_of_wheel = [i for i, car in cars for _ in range(1 if car.wheels is None else 2)]

    def _set_rails_and_cars_off_rope(self) -> None:
        self.rails: list[tuple[int, Rail]] = []  # with slots of x
        for k, car in zip(self.car_contacts, self.line.cars_on_rope, strict=True):
            if car.rail is not None:
                self.rails.append((int(self.xy[k, 0]), car.rail))
        saddles = {self.line.contacts_and_wheels[k].name: int(self.s[k]) for k in self.support_contacts}  # slots of s
        self.off_rope: dict[str, CarOnShoeOffRope] = {}
        for car in self.line.cars_off_rope:
            if car.rail is not None:
                saddle = saddles[car.rail.saddle]
                self.off_rope[car.name] = CarOnShoeOffRope(self.line, car, saddle, self.swing_off_rope.get(car.name))
        self.acting_off_rope = [car for car in self.off_rope.values() if car.acts_in_rows]

    def slot_set_by_travel(self, i: int) -> int:
        """Slot that the travel of car i prescribes: s, or x of a car hauled in x."""
        if self.line.cars_on_rope[i].drive_mode_or_haul_x != "haul_x":
            return self.slot_of_s(i)
        trolley_slots = {trolley.i: int(trolley.body[0]) for trolley in self.trolleys}
        return trolley_slots.get(i, int(self.xy[self.car_contacts[i], 0]))

    def slot_of_s(self, i: int) -> int:
        """Slot of s of car i; of two wheels that of the front one."""
        return int(self.s[self.car_contacts[i]])

    def _set_prescribed_coordinates(self) -> None:
        """Set which coordinates are free, constants of the others, and the slots that travels prescribe."""
        self.free = np.ones(self.size, bool)
        self.constant = np.zeros(self.size)
        self.prescribed: list[tuple[Car, int]] = []
        for k, contact in enumerate(self.line.contacts_and_wheels):
            if isinstance(contact, Contact):
                self._prescribe_support(k, contact)
            elif isinstance(contact, Wheel):
                self.free[self.xy[k]] = False
            elif contact.rail is not None:
                self.free[self.xy[k, 1]] = False
        for i, car in enumerate(self.line.cars_on_rope):
            if car.travel is not None:
                slot = self.slot_set_by_travel(i)
                self.free[slot] = False
                self.prescribed.append((car, slot))

    def _prescribe_support(self, k: int, support: Contact) -> None:
        if support.kind != "spring":
            self.free[self.xy[k]] = False
            self.constant[self.xy[k]] = support.point
        if support.kind in ("anchor", "spring"):
            self.free[self.s[k]] = False
            self.constant[self.s[k]] = (self.line.rope.length or 0.0) if k else 0.0

    def prescribed_coordinates(self, t: Array | float, phase: int) -> Array:
        """Coordinates with rates (3, ..., size) with what is prescribed at t (...); zero elsewhere."""
        out = np.zeros((3, *np.shape(t), self.size))
        out[0] = self.constant
        for car, slot in self.prescribed:
            out[..., slot] = self.line.prescribed_positions_with_rates(car, t, phase)
        return out

    def segment_motion(self, coordinates: Coordinates) -> Motion:
        """Motion of the segments; coordinates : (..., size) each."""
        nodal = [z[..., self.xy_of_nodes] for z in coordinates]
        ends = np.stack([self.s[:-1], self.s[1:]], axis=1)  # slots (K, 2)
        return Motion(*nodal, *(z[..., ends] for z in coordinates))

    def slopes_at_segment_ends(self, q: Array) -> Array:
        """r' at the left and at the right end of the segments, (2, ..., K, 2); q : (..., size)."""
        h = np.diff(q[..., self.s])[..., None]
        return np.einsum("en,...kna->e...ka", self.segments.end_slopes, q[..., self.xy_of_nodes]) / h

    def slopes_beside(self, k: Any, q: Array) -> Array:
        """r' behind and ahead of contacts k (...), (..., 4) of one or many q (size,)."""
        left, right = self.slopes_at_segment_ends(q)
        return np.concatenate([right[..., k - 1, :], left[..., k, :]], axis=-1)

    def slopes_beside_by_coordinates(self, k: int, q: Array) -> Array:
        """Derivatives (4, size) of those of contact k by all coordinates."""
        slopes = self.slopes_beside(k, q)
        out = np.zeros((4, self.size))
        for i, row in enumerate(out):
            side, axis = divmod(i, 2)
            segment = k - 1 + side
            begin, end = self.s[segment : segment + 2]
            h = q[end] - q[begin]
            row[self.xy_of_nodes[segment, :, axis]] = self.segments.end_slopes[1 - side] / h
            row[begin] = slopes[i] / h
            row[end] = -slopes[i] / h
        return out
