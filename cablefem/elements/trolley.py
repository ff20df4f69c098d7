"""A rigid car on two wheels: its rows, which stand in the place of those of the two nodes below it.

Both nodes follow X, the point of the front wheel, and the pitch th, front down.
e1 = (cos th, sin th), e2 = (-sin th, cos th).

    rear wheel X - b e1        centre of mass c = X - (b/2 - e) e1 + d e2        n = d/dth of these
    row of X:  P_1 + P_2 + C,  C = m (c.. - g j) - f        P_i: row of the rope at wheel i
    row of th: n_1 . P_1 + n_c . C + J th.. - Mo
    row of s_i: - <lam>_i f_i,  f_i = hold - (mu_r |load_i| + brake_i) sign,  load_i across <r'>_i

f holds thrust, haul force and drag, Mo their moments about c; the hold acts at the front wheel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.elements.bodies import STEP, CarLoadsAndMasses
from cablefem.newmark import Array, TangentFactors
from cablefem.scene.contacts import Car

if TYPE_CHECKING:
    from cablefem.elements.bordered import Matrix

# inputs: r' behind and ahead of the rear wheel (4) and of the front one (4), P_1, P_2 (4), th, X. (2), th., X.. (2),
# th.., F/M
INPUTS = 20


Slot = NDArray[np.intp]


class TrolleyForces(NamedTuple):
    """On a trolley, each (...), and its rows."""

    rows: tuple[Array, ...]  # of X, th and s of both wheels
    centre: tuple[Array, Array]  # c - X
    loads: tuple[Array, Array]  # of the rear wheel and of the front one
    friction: tuple[Array, Array]  # <lam> f without the hold
    hold: Array  # <lam> times it, at the front wheel
    stretch: Array  # <lam> there
    thrust: Array  # [W] of it, as the others below
    haul: Array
    drag: Array


class WheelForces(NamedTuple):
    load: Array  # on the rope
    friction: Array  # <lam> f without the hold
    stretch: Array  # <lam>


def _wheel_forces(slopes: Any, rope_row: Any, mu_r: float, brake: Array, sign: Array) -> WheelForces:
    """At a wheel with r' behind and ahead (4, ...) and the row P of the rope (2, ...); sign of the motion."""
    bx, by, ax, ay = slopes
    tx, ty = bx + ax, by + ay
    load = (tx * rope_row[1] - ty * rope_row[0]) / np.sqrt(tx * tx + ty * ty)
    stretch = 0.5 * (np.sqrt(bx * bx + by * by) + np.sqrt(ax * ax + ay * ay))
    friction = -stretch * (mu_r * load * np.sign(load.real) + brake) * sign
    return WheelForces(load, friction, stretch)


class Trolley:
    """Car number `i`, whose front wheel is contact `k`."""

    def __init__(self, car: Car, i: int, k: int) -> None:
        assert car.wheels is not None
        self.car, self.i, self.k, self.wheels = car, i, k, car.wheels
        self.ahead = car.wheels.ahead - 0.5 * car.wheels.base  # [m] of the centre of mass ahead of the front wheel

    def set_slots(self, body: Slot, force: int, nodes: Slot, s: Slot, end_slopes: Array) -> None:
        """Slots of X and th, of F/M or -1; nodes (K, nn) of the segments; slots of s of all contacts.

        end_slopes : of shape functions at the left and the right end of a segment, (2, nn).
        """
        self.body, self.force = body, force
        behind, between, ahead = self.k - 2, self.k - 1, self.k
        self.points = 2 * nodes[[between, ahead], 0][:, None] + np.arange(2)  # (wheel, 2)
        self.rows = np.array([*body, *s[[between, ahead]]])
        near = [np.flatnonzero(x) for x in end_slopes]
        sides = [(behind, 1), (between, 0), (between, 1), (ahead, 0)]  # segment and end
        self.near = np.array([2 * nodes[segment, near[end], None] + np.arange(2) for segment, end in sides])
        self.shapes = np.array([end_slopes[end, near[end]] for _, end in sides])  # (4, near)
        self.ends = np.array([s[[segment, segment + 1]] for segment, _ in sides])  # (4, 2)

    def set_wheel_points(self, z: Array) -> None:
        """Set the points of the wheels in q, v, a of all coordinates (3, ..., size)."""
        base = self.wheels.base
        th, rate, turning = z[..., self.body[2]]
        cos, sin = base * np.cos(th), base * np.sin(th)
        X = z[..., self.body[:2]]
        z[..., self.points[1]] = X
        x = [cos, -rate * sin, -turning * sin - rate**2 * cos]
        y = [sin, rate * cos, turning * cos - rate**2 * sin]
        z[..., self.points[0]] = X - np.stack([x, y], axis=-1)

    def rope_slopes_at_wheels(self, q: Array) -> Array:
        """r' at the sides of both wheels (..., 4, 2), from all coordinates (..., size)."""
        h = q[..., self.ends[:, 1]] - q[..., self.ends[:, 0]]
        return (self.shapes[:, None] @ q[..., self.near])[..., 0, :] / h[..., None]

    def force_inputs(self, coordinates: Sequence[Array], rope_rows: Array) -> Any:
        """Inputs (INPUTS, ...) of `forces`, from q, v, a (..., size) and P of both wheels (..., 4)."""
        q, v, a = coordinates
        slopes = self.rope_slopes_at_wheels(q).reshape(*rope_rows.shape[:-1], 8)
        force = a[..., self.force] if self.force >= 0 else 0.0 * rope_rows[..., 0]
        parts = [slopes, rope_rows, q[..., self.body[2:]], v[..., self.body], a[..., self.body], force[..., None]]
        return np.concatenate(parts, axis=-1).T

    def forces(self, cars: CarLoadsAndMasses, inputs: Any) -> TrolleyForces:
        """Forces on the car, and rows.

        inputs : (INPUTS, ...), which may be complex;  cars : of all of them (..., cars).
        """
        drive, i, w, m = self.car.drive, self.i, self.wheels, self.car.mass
        y = inputs.tolist() if inputs.ndim == 1 else inputs  # plain numbers are faster
        th, X_v, Y_v, rate, X_a, Y_a, turning, force = y[12:]
        F, T, sign = m * force, cars.thrust.T[i], cars.sign.T[i]
        cos, sin = np.cos(th), np.sin(th)
        cx, cy = self.ahead * cos - w.below * sin, self.ahead * sin + w.below * cos  # c - X; n_c = (- cy, cx)
        vx, vy = X_v - rate * cy, Y_v + rate * cx
        air = vx - drive.wind
        drag = -drive.k * np.sqrt(air * air + vy * vy + 1e-24)
        along, down = drive.thrust_at
        up, level = math.sin(drive.thrust_angle), math.cos(drive.thrust_angle)
        thrust_x, thrust_y = T * (level * cos + up * sin), T * (level * sin - up * cos)
        thrust_turns = -(along * up + down * level) * T
        haul_turns = -drive.hitch[1] * F
        C_x = m * (X_a - turning * cy - rate * rate * cx) - thrust_x - F * cos - drag * air
        C_y = m * (Y_a + turning * cx - rate * rate * cy - cars.gravity) - thrust_y - F * sin - drag * vy
        of_th = w.base * (sin * y[8] - cos * y[9]) - cy * C_x + cx * C_y
        of_th = of_th + w.inertia * turning - thrust_turns - haul_turns
        rear_brake = cars.rear_brake.T[i]
        rear = _wheel_forces(y[0:4], y[8:10], drive.mu_r, rear_brake, sign)
        front = _wheel_forces(y[4:8], y[10:12], drive.mu_r, cars.brake.T[i] - rear_brake, sign)
        hold = front.stretch * cars.hold.T[i]
        return TrolleyForces(
            rows=(y[8] + y[10] + C_x, y[9] + y[11] + C_y, of_th, -rear.friction, -front.friction - hold),
            centre=(cx, cy), loads=(rear.load, front.load), friction=(rear.friction, front.friction), hold=hold,
            stretch=front.stretch,
            thrust=thrust_x * vx + thrust_y * vy + thrust_turns * rate,
            haul=F * (cos * vx + sin * vy) + haul_turns * rate, drag=drag * (air * vx + vy * vy),
        )  # fmt: skip

    def add_tangent(
        self, matrix: Matrix, coordinates: Sequence[Array], rope_rows: Array, cars: CarLoadsAndMasses, c: TangentFactors
    ) -> None:
        """Add c0 d/dq + c1 d/dv + c2 d/da of the rows; the nodes follow the body in the columns of `matrix`.

        What the pitch rate adds there to c1 and c2 is left out: it is of the order of the rate times the step.
        """
        c0, c1, c2 = c
        y = self.force_inputs(coordinates, rope_rows)
        rows = self.forces(cars, y[:, None] + 1j * STEP * np.eye(INPUTS)).rows
        by = np.array([row.imag / STEP for row in rows])  # (5, INPUTS)
        factors = np.zeros((INPUTS, 4), matrix.dtype)  # of X, th and F in the inputs
        factors[[13, 14, 15], [0, 1, 2]], factors[[16, 17, 18], [0, 1, 2]] = c1, c2
        factors[12, 2], factors[19, 3] = c0, c2 or 1.0
        count = 4 if self.force >= 0 else 3
        matrix.add_block(self.rows, [*self.body, self.force][:count], (by @ factors)[:, :count])
        q, slopes = coordinates[0], y[:8].reshape(4, 2)
        for side in range(4):
            by_slope = c0 / (q[self.ends[side, 1]] - q[self.ends[side, 0]]) * by[:, 2 * side : 2 * side + 2]
            block = self.shapes[side, :, None] * by_slope[:, None, :]  # (5, near, 2)
            matrix.add_block(self.rows, self.near[side].ravel(), block.reshape(5, -1))
            matrix.add_block(self.rows, self.ends[side], np.outer(by_slope @ slopes[side], [1.0, -1.0]))
        b_sin, b_cos = self.wheels.base * math.sin(q[self.body[2]]), self.wheels.base * math.cos(q[self.body[2]])
        for axis, turned in enumerate((b_sin, -b_cos)):
            rear, front = self.points[:, axis]
            matrix.add_multiple_of_column(front, self.body[axis], 1.0)
            matrix.add_multiple_of_column(rear, self.body[axis], 1.0)
            matrix.add_multiple_of_column(rear, self.body[2], turned)
        for row, slot in np.argwhere(by[:, 8:12]).tolist():
            matrix.add_multiple_of_row(int(self.points.flat[slot]), int(self.rows[row]), by[row, 8 + slot])
