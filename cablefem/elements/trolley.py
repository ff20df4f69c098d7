"""A rigid car on two wheels: its rows, which stand in the place of those of the two nodes below it.

Both nodes follow X, the point of the front wheel, and the pitch th, front down.
e1 = (cos th, sin th), e2 = (-sin th, cos th).

    rear wheel X - b e1        centre of mass c = X - (b/2 - e) e1 + d e2        n = d/dth of these
    row of X:  P_1 + P_2 + C,  C = m (c.. - g j) - f        P_i: row of the rope at wheel i
    row of th: n_1 . P_1 + n_c . C + J th.. - Mo
    row of s_i: - <lam>_i f_i,  f_i = hold - (mu_r |load_i| + brake_i) sign,  load_i across tau_i

f holds thrust, haul force and drag, Mo their moments about c; the hold acts at the front wheel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.elements.bodies import STEP, CarLoadsAndMasses
from cablefem.newmark import Array
from cablefem.scene.contacts import Car

if TYPE_CHECKING:
    from cablefem.elements.bordered import BandDerivatives
    from cablefem.elements.line_coordinates import LineCoordinates

# inputs: r' behind and ahead of the rear wheel (4) and of the front one (4), P_1, P_2 (4), th, X. (2), th., X.. (2),
# th.., F/M
INPUTS = 20
Slots = NDArray[np.intp]  # numbers of coordinates


class WheelForces(NamedTuple):
    load: Array  # on the rope
    friction: Array  # <lam> f without the hold
    stretch: Array  # <lam>


class BodyForces(NamedTuple):
    """Rows of X and th, c - X and powers [W]."""

    of_X: Array
    of_Y: Array
    of_th: Array
    centre_x: Array
    centre_y: Array
    thrust: Array
    haul: Array
    drag: Array


class TrolleyForces(NamedTuple):
    """On a trolley."""

    body: BodyForces
    rear: WheelForces
    front: WheelForces
    hold: Array  # <lam> times it, at the front wheel

    @property
    def balance_rows(self) -> tuple[Array, ...]:
        """Rows of X, th and s of both wheels."""
        return (*self.body[:3], -self.rear.friction, -self.front.friction - self.hold)


# --- of arrays, and in `segment_kernels` of numbers --------------------------------------------------------------
def wheel_forces(slopes: Any, rope_row: Any, mu_r: float, brake: Any, sign: Any) -> WheelForces:
    """At a wheel with r' behind and ahead (4, ...) and the row P of the rope (2, ...); sign of the motion."""
    bx, by, ax, ay = slopes
    behind = np.sqrt(bx * bx + by * by)
    ahead = np.sqrt(ax * ax + ay * ay)
    tx = bx / behind + ax / ahead
    ty = by / behind + ay / ahead
    across = tx * rope_row[1] - ty * rope_row[0]
    load = across / np.sqrt(tx * tx + ty * ty)
    stretch = 0.5 * (behind + ahead)
    holding = mu_r * load * np.sign(load.real) + brake
    friction = -stretch * holding * sign
    return WheelForces(load, friction, stretch)


def body_forces(numbers: Any, thrust: Any, y: Any) -> BodyForces:
    """Forces on the body; numbers : `Trolley.numbers`;  y : inputs (INPUTS, ...), which may be complex."""
    mass, k, wind, base, ahead, below, inertia, hitch, along, down, level, up, gravity, _ = numbers
    th, X_v, Y_v, rate, X_a, Y_a, turning, force = y[12:]
    cos = np.cos(th)
    sin = np.sin(th)
    cx = ahead * cos - below * sin  # c - X; n_c = (- cy, cx)
    cy = ahead * sin + below * cos
    vx = X_v - rate * cy
    vy = Y_v + rate * cx
    ax = X_a - turning * cy - rate * rate * cx
    ay = Y_a + turning * cx - rate * rate * cy
    air = vx - wind
    drag = -k * np.sqrt(air * air + vy * vy + 1e-24)
    haul = mass * force
    haul_turns = -hitch * haul
    thrust_x = thrust * (level * cos + up * sin)
    thrust_y = thrust * (level * sin - up * cos)
    thrust_turns = -(along * up + down * level) * thrust
    C_x = mass * ax - thrust_x - haul * cos - drag * air
    C_y = mass * (ay - gravity) - thrust_y - haul * sin - drag * vy
    of_X = y[8] + y[10] + C_x
    of_Y = y[9] + y[11] + C_y
    of_th = base * (sin * y[8] - cos * y[9]) - cy * C_x + cx * C_y
    of_th = of_th + inertia * turning - thrust_turns - haul_turns
    thrust_power = thrust_x * vx + thrust_y * vy + thrust_turns * rate
    haul_power = haul * (cos * vx + sin * vy) + haul_turns * rate
    drag_power = drag * (air * vx + vy * vy)
    return BodyForces(of_X, of_Y, of_th, cx, cy, thrust_power, haul_power, drag_power)


class Trolley:
    """Car number `i`, whose front wheel is contact `k`."""

    def __init__(self, car: Car, i: int, k: int, gravity: float) -> None:
        assert car.wheels is not None
        self.car = car
        self.i = i
        self.k = k
        self.wheels = wheels = car.wheels
        drive = car.drive
        ahead = wheels.ahead - 0.5 * wheels.base  # [m] of the centre of mass ahead of the front wheel
        body = [car.mass, drive.k, drive.wind, wheels.base, ahead, wheels.below, wheels.inertia]
        angle = drive.thrust_angle
        forces = [drive.hitch[1], *drive.thrust_at, math.cos(angle), math.sin(angle), gravity, drive.mu_r]
        self.numbers = np.array(body + forces)

    def set_slots(self, body: Slots, force: int, system: LineCoordinates) -> None:
        """Slots of X and th, of F/M or -1."""
        self.body = body
        self.force = force
        self.system = system
        self.contacts = np.array([self.k - 1, self.k])
        self.points = system.xy[self.contacts]  # (wheel, 2)
        self.row_slots = np.array([*body, *system.s[self.contacts]])

    def rope_slopes_at_wheels(self, q: Array) -> Array:
        """r' at the sides of both wheels (..., 4, 2), from all coordinates (..., size)."""
        return self.system.slopes_beside(self.contacts, q).reshape(*q.shape[:-1], 4, 2)

    def force_inputs(self, coordinates: Sequence[Array], rope_rows: Array) -> Any:
        """Inputs (INPUTS, ...) of `forces`, from q, v, a (..., size) and P of both wheels (..., 4)."""
        q, v, a = coordinates
        slopes = self.rope_slopes_at_wheels(q).reshape(*rope_rows.shape[:-1], 8)
        force = a[..., self.force] if self.force >= 0 else 0.0 * rope_rows[..., 0]
        pitch = q[..., self.body[2:]]
        rates = [v[..., self.body], a[..., self.body]]
        inputs = [slopes, rope_rows, pitch, *rates, force[..., None]]
        return np.concatenate(inputs, axis=-1).T

    def forces(self, cars: CarLoadsAndMasses, inputs: Any) -> TrolleyForces:
        """Forces on the car, and rows.

        inputs : (INPUTS, ...), which may be complex;  cars : of all of them (..., cars).
        """
        sign = cars.sign.T[self.i]
        rear_brake = cars.rear_brake.T[self.i]
        front_brake = cars.brake.T[self.i] - rear_brake
        mu_r = self.car.drive.mu_r
        body = body_forces(self.numbers, cars.thrust.T[self.i], inputs)
        rear = wheel_forces(inputs[0:4], inputs[8:10], mu_r, rear_brake, sign)
        front = wheel_forces(inputs[4:8], inputs[10:12], mu_r, front_brake, sign)
        hold = front.stretch * cars.hold.T[self.i]
        return TrolleyForces(body, rear, front, hold)

    def derivatives(
        self, coordinates: Sequence[Array], rope_rows: Array, cars: CarLoadsAndMasses
    ) -> tuple[Array, Array]:
        """Of the rows, by the inputs (5, INPUTS), and of these by q, v and a (3, INPUTS, size)."""
        q = coordinates[0]
        y = self.force_inputs(coordinates, rope_rows)
        shifted = y[:, None] + 1j * STEP * np.eye(INPUTS)
        rows = self.forces(cars, shifted).balance_rows
        inputs = np.zeros((3, INPUTS, q.size))
        slopes = [self.system.slopes_beside_by_coordinates(k, q) for k in self.contacts.tolist()]
        inputs[0, :8] = np.concatenate(slopes)
        inputs[0, 12, self.body[2]] = 1.0
        inputs[1, [13, 14, 15], self.body] = 1.0
        inputs[2, [16, 17, 18], self.body] = 1.0
        if self.force >= 0:
            inputs[2, 19, self.force] = 1.0
        return np.array([row.imag / STEP for row in rows]), inputs

    def add_rope_and_follow(self, out: BandDerivatives, pitch: float, by_rope_rows: Array) -> None:
        """Let the nodes follow the body in the columns, and add the rows of the rope to its own, by_rope_rows (5, 4).

        What the pitch rate adds by v and a is left out: it is of the order of the rate times the step.
        """
        x, y, th = self.body
        rear, front = self.points
        values = out.values
        values[:, :, [x, y]] += values[:, :, rear] + values[:, :, front]
        by_pitch = self.wheels.base * np.array([math.sin(pitch), -math.cos(pitch)])
        values[:, :, th] += values[:, :, rear] @ by_pitch
        values[:, self.row_slots] += by_rope_rows @ values[:, self.points.ravel()]
