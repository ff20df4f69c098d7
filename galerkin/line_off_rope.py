"""Cars that run on the rail of a saddle, off the rope: their grip acts on the saddle, and their cabins swing."""

from __future__ import annotations

import math

import numpy as np

from cablefem.scene.contacts import Array, Car, MovingLine
from galerkin.bodies import ContactState, PointCar, dot
from galerkin.segments import Layout


class CarOnShoeOffRope:
    """A car off the rope, and its part in the rows of a line."""

    def __init__(self, line: MovingLine, car: Car, layout: Layout, saddle: int, rows: dict[int, int]) -> None:
        """saddle : contact below the car;  rows : numbers of the rows by coordinate."""
        assert car.rail is not None
        self.line = line
        self.rail = car.rail
        self.layout = layout
        self.saddle = saddle
        self.body = PointCar(car, line)
        # row of s of the saddle, on which the grip acts
        self.saddle_row = rows[int(layout.s[saddle])] if car.drive_mode_or_haul_x == "grip" else None
        self.angle_row = rows[layout.angle_off_rope[car.name]] if car.hanger is not None else None

    @property
    def acts_in_rows(self) -> bool:
        """Whether the car acts in a row."""
        return self.saddle_row is not None or self.angle_row is not None

    def contact_state(self, t: Array, Z: Array, phase: int) -> ContactState:
        """What the body takes, at the times t (n,), from Z (3, n, layout.size)."""
        car = self.body.car
        rope_at_saddle = Z[:, :, self.layout.s[self.saddle]]  # s with its rates (3, n)
        x = np.zeros((t.size, ContactState.size))
        x[:, 8:10], x[:, 13:15], x[:, 18:20] = self.line.points_with_rates_off_rope(car, t, phase, rope_at_saddle)
        if car.hanger is not None:
            x[:, [10, 15, 20]] = Z[:, :, self.layout.angle_off_rope[car.name]].T
        x[:, [4, 6]] = 1.0  # the rail in the place of the rope
        x[:, [5, 7]] = self.rail.depth_with_derivatives(x[:, 8])[1][:, None]
        return ContactState(x[:, None])

    def complete_residuals(self, x: ContactState, r: Array) -> None:
        """Add the grip to the residuals r (n, rows) of n instants, and set the row of the cabin."""
        if self.saddle_row is not None:
            r[:, self.saddle_row] -= dot(self.body.force_needed_from_rope(x), x.tau)
        if self.angle_row is not None:
            r[:, self.angle_row] = self.body.forces(x)[:, 8]

    def complete_derivatives(self, x: ContactState, K: Array) -> None:
        """The same for the derivatives K (3, rows, rows) at one instant; drag and motion of the point change little."""
        body = self.body
        saddle = self.saddle_row
        angle = self.angle_row
        stretch = self.rail.stretch
        if saddle is not None:
            K[2, saddle, saddle] += body.car.mass * stretch
        if angle is not None:
            weight = body.m * body.h * self.line.gravity * math.cos(x.angle.item())
            K[:, angle, angle] = weight, body.damping, body.about_hanger
        if saddle is not None and angle is not None:
            K[2, saddle, angle] = -body.m * body.h * dot(body.cabin_axes(x)[0], x.tau).item()
            K[2, angle, saddle] = stretch * K[2, saddle, angle]
