"""Balances at the contacts of a rope, whose equations stand in `galerkin.bodies` and `galerkin.trolley`.

x (2, 26), complex for derivatives: `ContactState` of a contact, and of the next one for the front of two wheels.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from galerkin.law import compiled, inner

ANCHOR, SADDLE, SPRING, COUNTERWEIGHT, POINT_CAR, TROLLEY = range(6)
RAIL = np.dtype([("x", "f8"), ("length", "f8"), ("coefficients", "f8", 6)])  # Y by powers of (x - x_0)/length
NUMBERS = "force mass_of_rise rho gravity mass k wind m h about_hanger damping turns on_rail inertia lever"
BODY = np.dtype(
    [
        *[(name, "i8") for name in ("kind", "balance_count", "contacts")],
        *[(name, "f8") for name in NUMBERS.split()],
        *[(name, "f8", 2) for name in ("stiffness", "point", "thrust_axes")],
        ("arms", "f8", (2, 2)),  # of two wheels
        ("rail", RAIL),
    ]
)
FORCES = 11  # of a car: C (2), P of the wheels (4), their loads (2), the balance of its moments, and drag (2)


class Wheel(NamedTuple):
    """The rope at a contact."""

    Px: complex  # the force on it
    Py: complex
    tx: complex  # tau
    ty: complex
    cos_phi: complex


@inner
def length(x: complex, y: complex) -> complex:
    return np.sqrt(x * x + y * y)


@inner
def rope_at_wheel(rho: float, x: Any) -> Wheel:
    """Force of the rope, its unit mean tangent and |<t>| at a wheel, from the values x (26,) of its contact."""
    behind = length(x[4], x[5])
    ahead = length(x[6], x[7])
    tx = x[4] / behind + x[6] / ahead
    ty = x[5] / behind + x[7] / ahead
    size = length(tx, ty)
    flow = rho * (x[23] * x[23])
    Px = x[0] - x[2] + flow * (x[6] - x[4])
    Py = x[1] - x[3] + flow * (x[7] - x[5])
    return Wheel(Px, Py, tx / size, ty / size, 0.5 * size)


@inner
def depth_with_derivatives(rail: Any, x: Any) -> Any:
    """Y, Y', Y'' of a rail at x."""
    u = (x - rail.x) / rail.length
    Y = 0.0 * u
    first = 0.0 * u
    half_second = 0.0 * u
    for k in range(5, -1, -1):
        half_second = first + u * half_second
        first = Y + u * first
        Y = rail.coefficients[k] + u * Y
    return Y, first / rail.length, 2.0 * half_second / rail.length**2


@inner
def set_drag(car: Any, vx: complex, vy: complex, drag: Any) -> None:
    """Set the force (2,) of the air, wind included."""
    air = vx - car.wind
    factor = -car.k * length(air, vy) if car.k > 0.0 else 0.0 * vx
    drag[0] = factor * air
    drag[1] = factor * vy


@inner
def set_forces_on_car(car: Any, x: Any, forces: Any) -> None:
    """Set the forces (FORCES,) on a car."""
    at = x[0]
    rear = rope_at_wheel(car.rho, at)
    cos = np.cos(at[10])
    sin = np.sin(at[10])
    drag = forces[9:]
    forces[2] = rear.Px
    forces[3] = rear.Py
    if car.kind == POINT_CAR:
        set_drag(car, at[13] + car.h * at[15] * cos, at[14] - car.h * at[15] * sin, drag)
        faster = car.m * car.h * at[20]
        turning = car.m * car.h * (at[15] * at[15])
        forces[0] = car.mass * at[18] - at[25] * rear.tx + (faster * cos - turning * sin) - drag[0]
        forces[1] = car.mass * (at[19] - car.gravity) - at[25] * rear.ty - (faster * sin + turning * cos) - drag[1]
        forces[6] = forces[0] * rear.ty - forces[1] * rear.tx
        about_hinge = car.m * car.h * (at[18] * cos - at[19] * sin + car.gravity * sin)
        hanging = about_hinge - car.h * (drag[0] * cos - drag[1] * sin)
        forces[8] = car.about_hanger * at[20] + car.damping * at[15] + hanging
        return
    front = rope_at_wheel(car.rho, x[1])
    forward = car.thrust_axes[0]
    down = car.thrust_axes[1]
    set_drag(car, at[16], at[17], drag)
    forces[0] = car.mass * at[21] - at[25] * (forward * cos - down * sin) - drag[0]
    forces[1] = car.mass * (at[22] - car.gravity) - at[25] * (forward * sin + down * cos) - drag[1]
    forces[4] = front.Px
    forces[5] = front.Py
    forces[6] = rear.Py * rear.tx - rear.Px * rear.ty
    forces[7] = front.Py * front.tx - front.Px * front.ty
    forces[8] = car.inertia * at[20] - car.lever * at[25]
    for i in range(2):
        along = car.arms[i, 0]
        below = car.arms[i, 1]
        Px = forces[2 + 2 * i]
        Py = forces[3 + 2 * i]
        forces[8] += (along * cos - below * sin) * Py - (below * cos + along * sin) * Px


@inner
def resisting_force(load: complex, friction: Any, wheel: int) -> complex:
    """Friction and brake of a wheel 0 or 1; friction (5,) of a `Friction`."""
    pressing = -load if load.real < 0.0 else load
    return friction[3] * (friction[0] * pressing + friction[1 + wheel])


@inner
def set_balance_rows_and_car_forces(body: Any, x: Any, friction: Any, forces: Any, rows: Any) -> None:
    """Set the first of rows (5,) to the balances of a body, zero where they hold, and forces (FORCES,) of a car."""
    at = x[0]
    if body.kind == SADDLE:
        rows[0] = length(at[2], at[3]) - length(at[0], at[1])
    elif body.kind == SPRING:
        for i in range(2):
            rows[i] = at[i] - at[2 + i] + body.stiffness[i] * (at[8 + i] - body.point[i])
    elif body.kind == COUNTERWEIGHT:
        rows[0] = length(at[0] + at[2], at[1] + at[3]) - body.force - body.mass_of_rise * at[24]
    elif body.kind >= POINT_CAR:
        set_forces_on_car(body, x, forces)
        set_car_rows_from_forces(body, x, friction, forces, rows)


@inner
def set_car_rows_from_forces(car: Any, x: Any, friction: Any, forces: Any, rows: Any) -> None:
    """Set the balances of a car by its forces (FORCES,)."""
    rear = rope_at_wheel(car.rho, x[0])
    rows[0] = forces[2] + forces[0]
    rows[1] = forces[3] + forces[1]
    rows[2] = forces[8]
    if car.kind == TROLLEY:
        front = rope_at_wheel(car.rho, x[1])
        rows[0] += forces[4]
        rows[1] += forces[5]
        along = forces[2] * rear.tx + forces[3] * rear.ty
        rows[3] = along - resisting_force(forces[6], friction, 0) * rear.cos_phi
        along = forces[4] * front.tx + forces[5] * front.ty
        rows[4] = along + (friction[4] - resisting_force(forces[7], friction, 1)) * front.cos_phi
        return
    along = forces[0] * rear.tx + forces[1] * rear.ty
    own = 3 if car.turns > 0.0 else 2
    if car.on_rail > 0.0:  # the shoe is normal to the path
        rows[0] += depth_with_derivatives(car.rail, x[0, 8])[1] * rows[1]
        rows[1] = rows[2]
        own -= 1
        along = -(forces[2] * rear.tx + forces[3] * rear.ty)
    rows[own] = along - (friction[4] - resisting_force(forces[6], friction, 1)) * rear.cos_phi


@compiled
def forces_on_car(cars: Any, values: Any) -> Any:
    """Forces (n, FORCES) on the first of cars, by the values (n, contacts, 26), complex, of its contacts."""
    out = np.zeros((values.shape[0], FORCES), np.complex128)
    for i in range(out.shape[0]):
        set_forces_on_car(cars[0], values[i], out[i])
    return out.real
