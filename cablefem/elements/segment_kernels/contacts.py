"""Compiled rows of all that touches the rope: of a whole line at one instant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.elements import bodies, trolley
from cablefem.elements.line_coordinates import Coordinates
from cablefem.elements.segment_kernels.balance import (
    Cars,
    Rope,
    add_car_rows_and_set_loads,
    add_rope_rows_return_min_tension,
    compiled,
    first_slot_of_s,
    inner,
    set_slope_at_segment_end,
)
from cablefem.newmark import Array

Slots = NDArray[np.int64]

counterweight_balance_row = inner(bodies.counterweight_balance_row)
wheel_forces = inner(trolley.wheel_forces)
body_forces = inner(trolley.body_forces)


class Supports(NamedTuple):
    """Springs (m,), one for each direction, and counterweights (n,)."""

    springs: Slots  # of x or y
    stiffness: Array
    unloaded: Array  # x or y
    weights: Slots  # of s
    numbers: Array  # (n, 6) of `bodies.counterweight_balance_row`


class Trolleys(NamedTuple):
    """Cars on two wheels (m,)."""

    contacts: Slots  # of the front wheel
    points: Slots  # (m, 2, 2) of x and y of the rear and the front wheel
    bodies: Slots  # (m, 3) of X and th
    forces: Slots  # of F/M, or -1
    loads: Slots  # numbers of the rear wheels
    numbers: Array  # (m, 14) see `trolley.body_forces`


class Rails(NamedTuple):
    """Cars on rails over shoes (m,)."""

    points: Slots  # of x
    begin: Array  # [m] x
    length: Array  # [m] in x
    coefficients: Array  # (m, 6) see `Rail.coefficients`


class Line(NamedTuple):
    """A rope in K segments, and all that touches it."""

    rope: Rope
    law: Array  # (3, K, G) see `segments.Law`
    cars: Cars
    supports: Supports
    trolleys: Trolleys
    rails: Rails
    forces: Slots  # (f, 2) of F/M and of the row that determines it
    car_data: Array  # (1 or instants, m, 13) the first of `bodies.CarLoadsAndMasses`
    trolley_data: Array  # (1 or instants, m, 5) thrust, brake, hold, sign, rear brake


@compiled
def set_dependent_coordinates(trolleys: Trolleys, rails: Rails, z: Array) -> None:
    """Let wheels follow their cars, and cars on shoes their rails, in coordinates with rates z (3, n, size)."""
    for i in range(z.shape[1]):
        for j in range(trolleys.contacts.size):
            x, _, th = trolleys.bodies[j]
            rear = trolleys.points[j, 0]
            front = trolleys.points[j, 1]
            base = trolleys.numbers[j, 3]
            cos = base * np.cos(z[0, i, th])
            sin = base * np.sin(z[0, i, th])
            rate = z[1, i, th]
            turning = z[2, i, th]
            ahead = (cos, sin), (-rate * sin, rate * cos), (
                -turning * sin - rate * rate * cos, turning * cos - rate * rate * sin,
            )  # fmt: skip
            for k in range(3):
                for axis in range(2):
                    z[k, i, front[axis]] = z[k, i, x + axis]
                    z[k, i, rear[axis]] = z[k, i, x + axis] - ahead[k][axis]
        for j in range(rails.points.size):
            x = rails.points[j]
            Y, slope, bend = depth_with_derivatives(rails, j, z[0, i, x])
            z[0, i, x + 1] = Y
            z[1, i, x + 1] = slope * z[1, i, x]
            z[2, i, x + 1] = slope * z[2, i, x] + bend * z[1, i, x] ** 2


@inner
def depth_with_derivatives(rails: Rails, j: int, x: float) -> tuple[float, float, float]:
    """Y, Y' and Y'' of rail j at x."""
    L = rails.length[j]
    u = (x - rails.begin[j]) / L
    Y = 0.0
    first = 0.0
    half_second = 0.0
    for k in range(5, -1, -1):
        half_second = half_second * u + first
        first = first * u + Y
        Y = Y * u + rails.coefficients[j, k]
    return Y, first / L, 2.0 * half_second / L**2


@compiled
def set_rows_and_loads(line: Line, first: int, z: Array, rows: Array, loads: Array) -> None:
    """Set the rows (n, size) and loads (n, m + 1) of instants from number `first` on.

    z : coordinates with rates (3, n, size).  loads : of all m wheels, and last the smallest mean tension of an element.
    """
    for i in range(rows.shape[0]):
        set_rows_and_loads_of_instant(line, first + i, Coordinates(z[0, i], z[1, i], z[2, i]), rows[i], loads[i])


@inner
def set_rows_and_loads_of_instant(line: Line, i: int, at: Coordinates, rows: Array, loads: Array) -> None:
    rows[:] = 0.0
    loads[-1] = add_rope_rows_return_min_tension(line, at, rows)
    add_car_rows_and_set_loads(line, i, at, rows, loads)
    add_spring_and_counterweight_rows(line, at, rows)
    for j in range(line.trolleys.contacts.size):
        add_trolley_rows_and_set_loads(line, i, j, at, rows, loads)
    for j in range(line.rails.points.size):
        x = line.rails.points[j]
        rows[x] += depth_with_derivatives(line.rails, j, at.q[x])[1] * rows[x + 1]
    for j in range(line.forces.shape[0]):
        rows[line.forces[j, 0]] = rows[line.forces[j, 1]]


@inner
def add_spring_and_counterweight_rows(line: Line, at: Coordinates, rows: Array) -> None:
    """Add springs and counterweights."""
    supports = line.supports
    for i in range(supports.springs.size):
        slot = supports.springs[i]
        rows[slot] += supports.stiffness[i] * (at.q[slot] - supports.unloaded[i])
    for i in range(supports.weights.size):
        slot = supports.weights[i]
        rows[slot] += counterweight_balance_row(supports.numbers[i], at.v[slot], at.a[slot])


@inner
def add_trolley_rows_and_set_loads(line: Line, i: int, j: int, at: Coordinates, rows: Array, loads: Array) -> None:
    """Add the rows of the car j on two wheels at instant i, see `trolley`, and set their loads."""
    trolleys = line.trolleys
    front = trolleys.contacts[j]
    thrust, brake, hold, sign, rear_brake = line.trolley_data[min(i, line.trolley_data.shape[0] - 1), j]
    y = np.zeros(trolley.INPUTS)
    for wheel in range(2):
        contact = front - 1 + wheel
        for side in range(2):
            set_slope_at_segment_end(line, at.q, contact - 1 + side, 1 - side, y[4 * wheel + 2 * side :])
        for axis in range(2):
            y[8 + 2 * wheel + axis] = rows[trolleys.points[j, wheel, axis]]
    body = trolleys.bodies[j]
    y[12] = at.q[body[2]]
    for axis in range(3):
        y[13 + axis] = at.v[body[axis]]
        y[16 + axis] = at.a[body[axis]]
    if trolleys.forces[j] >= 0:
        y[19] = at.a[trolleys.forces[j]]
    numbers = trolleys.numbers[j]
    forces = body_forces(numbers, thrust, y)
    rows[body[0]] += forces.of_X
    rows[body[1]] += forces.of_Y
    rows[body[2]] += forces.of_th
    rear = wheel_forces(y[0:4], y[8:10], numbers[13], rear_brake, sign)
    ahead = wheel_forces(y[4:8], y[10:12], numbers[13], brake - rear_brake, sign)
    loads[trolleys.loads[j]] = rear.load
    loads[trolleys.loads[j] + 1] = ahead.load
    S = first_slot_of_s(line)
    rows[S + front - 1] -= rear.friction
    rows[S + front] -= ahead.friction + ahead.stretch * hold
