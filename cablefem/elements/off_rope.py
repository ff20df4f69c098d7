"""A car off the rope, on the shoe of a saddle: what it needs of its rail, and how its cabin swings."""

from __future__ import annotations

import numpy as np

from cablefem.elements.bodies import INPUTS, ForcesOnCars, forces_on_cars, masses_drag_and_friction, swing_constants
from cablefem.elements.bordered import BandDerivatives
from cablefem.elements.segments import dot
from cablefem.newmark import Array
from cablefem.scene.contacts import Car, MovingLine


class CarOnShoeOffRope:
    """Its grip acts on the row of s of its saddle; the angle phi of its cabin is an unknown.

    saddle : slot of s there;  swing : slot of phi, None without a cabin.
    """

    def __init__(self, line: MovingLine, car: Car, saddle: int, swing: int | None) -> None:
        assert car.rail is not None
        self.line = line
        self.car = car
        self.rail = car.rail
        self.saddle = saddle
        self.swing = swing
        self.grips = car.drive_mode_or_haul_x == "grip"
        self.data = masses_drag_and_friction([car], line.gravity)
        self.lever, _, self.inertia, self.resistance = swing_constants(car, line.gravity)

    @property
    def acts_in_rows(self) -> bool:
        """Whether the car acts in a row."""
        return self.grips or self.swing is not None

    def points_with_rates(self, t: Array, z: Array, phase: int) -> Array:
        """Its points with their rates (n, 3, 2) at the times t (n,), from coordinates with rates z (3, n, size)."""
        points = self.line.points_with_rates_off_rope(self.car, t, phase, z[..., self.saddle])
        return points.swapaxes(0, 1)

    def forces(self, points: Array, z: Array) -> ForcesOnCars:
        """Forces (n, 1), of which `contact` is what rail and drive take; z : coordinates with rates (3, n, size)."""
        slope = self.rail.depth_with_derivatives(points[:, 0, 0])[1]
        y = np.zeros((len(points), 1, INPUTS))
        y[:, 0, [0, 2]] = 1.0  # the rail in the place of the rope
        y[:, 0, [1, 3]] = slope[:, None]
        y[:, 0, 4:8] = points[:, 1:].reshape(-1, 4)
        if self.swing is not None:
            y[:, 0, 9:12] = z[..., self.swing].T
        return forces_on_cars(self.data, y)

    def add_to_rows(self, rows: Array, t: Array, z: Array, phase: int) -> None:
        """Add to rows (n, size) at the times t (n,)."""
        on = self.forces(self.points_with_rates(t, z, phase), z)
        if self.grips:
            along = dot(on.contact, on.tau)[:, 0]
            rows[:, self.saddle] -= self.rail.stretch * along
        if self.swing is not None:
            rows[:, self.swing] = on.swing[:, 0]

    def add_derivatives(self, out: BandDerivatives, q: Array) -> None:
        """Add those at coordinates q (size,); drag and motion of the point change little."""
        stretch = self.rail.stretch
        if self.grips:
            out.values[2, self.saddle, self.saddle] += self.car.mass * stretch**2
        if self.swing is None:
            return
        angle = q[self.swing]
        stiffness = self.lever * self.line.gravity * np.cos(angle)
        out.values[:, self.swing, self.swing] += stiffness, self.resistance, self.inertia
        if self.grips:
            middle = 0.5 * (self.rail.begin.x + self.rail.end.x)
            slope = self.rail.depth_with_derivatives(middle)[1]
            forward = np.cos(angle) - slope * np.sin(angle)
            along = forward / np.hypot(1.0, slope)  # of a turn forward
            coupling = self.lever * stretch * along
            out.values[2, self.swing, self.saddle] -= coupling
            out.values[2, self.saddle, self.swing] -= coupling

    def swing_rate_jump(self, angle: Array, dv: Array) -> Array:
        """Jump of dphi/dt where the velocity of the point jumps by dv (2,)."""
        forward = dv[0] * np.cos(angle) - dv[1] * np.sin(angle)
        return -self.lever * forward / self.inertia
