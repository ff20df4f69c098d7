"""Wheels of a car: loads of two wheels of a point car by hand, and stresses of the rope under a wheel.

By hand: R_1 + R_2 = contact force, a_1 R_1 + a_2 R_2 = Mo - d (B_1 + B_2), a_1 and a_2 ahead of the centre of mass, d
above it.  Mo is the moment of thrust or haul rope about it; B_1 + B_2 are friction and brakes, and what a grip takes.
What turns the car is left out, and that the wheels' normals differ by the angle of the rope between them.

Bending of the rope under the load Q of a wheel, sigma = (Q/A) sqrt(E/(N/A)): Isaachsen, Zeitschrift des VDI 51 (1907).
A wheel of radius R bends wires of diameter delta by no more than E delta/(2 R).
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from cablefem.motion import CarMotion, LineMotion
from cablefem.newmark import State
from cablefem.response import Array
from cablefem.scene.bodies import Wheels
from cablefem.scene.cable import Rope
from cablefem.scene.contacts import Car, MovingLine
from cablefem.scene.line import Line


def with_wheel_loads_by_hand(motion: LineMotion, line: Line, moving: MovingLine, states: Sequence[State]) -> LineMotion:
    """The motion with wheel loads of those point cars that have a wheel base."""
    cars = list(motion.cars)
    for i, (table, car) in enumerate(zip(line.car, moving.cars_on_rope, strict=True)):
        wheels = table.wheels
        if wheels is not None and wheels.model == "point" and wheels.base:
            thrust = np.array([moving.thrust_of_free_car(car, x.t, x.phase) for x in states])
            loads = rear_and_front_loads_by_hand(wheels, car, cars[i], thrust, moving.gravity)
            cars[i] = dataclasses.replace(cars[i], wheel_loads=loads)
    return dataclasses.replace(motion, cars=tuple(cars))


def rear_and_front_loads_by_hand(
    wheels: Wheels, car: Car, motion: CarMotion, thrust: Array, gravity: float
) -> tuple[Array, Array]:
    """Loads (n,) [N] of the rear and the front wheel; thrust (n,) [N]."""
    drive = car.drive
    mean = motion.slope_behind + motion.slope_ahead  # (n, 2)
    tau = mean / np.linalg.norm(mean, axis=1)[:, None]
    air = motion.velocity - [drive.wind, 0.0]
    speed_in_air = np.linalg.norm(air, axis=1)
    drag = -drive.k * speed_in_air[:, None] * air
    needed = car.mass * (motion.acceleration - [0.0, gravity]) - drag
    hauled = drive.mode == "haul"
    driving = motion.haul_force if hauled else thrust
    resisting = np.sum(needed * tau, axis=1) - driving  # - B_1 - B_2
    below = drive.hitch[1] if hauled else drive.thrust_at[1]
    moment = wheels.below * resisting - below * driving
    rear = ((0.5 * wheels.base - wheels.ahead) * motion.contact_force - moment) / wheels.base
    return rear, motion.contact_force - rear


def approximate_pitch_period(wheels: Wheels, mass: float, N: float) -> float:
    """Of a car on two wheels where the tension is N [s]."""
    inertia = wheels.inertia + mass * wheels.below**2
    return 2.0 * math.pi * math.sqrt(inertia / (N * wheels.base))


def neglected_wheel_load(wheels: Wheels, mass: float, gravity: float, t: Array, motion: CarMotion) -> float:
    """The largest of what loads by hand at times t (n,) leave out [N].

    The normals of the wheels are R_1/(2 N) and R_2/(2 N) off that of the rope between them, which has turned by half of
    (R_2 - R_1)/N.  Pitch answers a change within half its period by as much again.
    """
    assert motion.wheel_loads is not None
    rear, front = motion.wheel_loads
    N = 0.5 * (motion.tension_behind + motion.tension_ahead)
    tau = motion.slope_behind + motion.slope_ahead  # (n, 2), not of unit length
    along = mass * gravity * np.abs(tau[:, 1]) / np.linalg.norm(tau, axis=1)
    lever = np.abs(wheels.below * motion.contact_force) / wheels.base + 0.5 * along
    tilted = lever * np.abs(front - rear) / (2.0 * N)
    period = approximate_pitch_period(wheels, mass, float(np.min(N)))
    later = np.interp(t + 0.5 * period, t, rear)
    change = np.abs(later - rear)
    return float(np.max(tilted) + np.max(change))


def rope_stresses_under_wheel(rope: Rope, wheels: Wheels, N: Array, Q: Array) -> dict[str, Array]:
    """Design numbers (n,) of the rope under a wheel, N and Q (n,) [N]: N/Q and stresses [Pa], nan where it is slack."""
    lightest = 1e-6  # of the tension: the load of a wheel that lifts off
    out = {"tension_over_wheel_min": N / np.maximum(Q, lightest * N)}
    if rope.E is None or rope.section is None:
        return out
    axial = np.where(N > 0.0, N, np.nan) / rope.section
    bending = Q / rope.section * np.sqrt(rope.E / axial)
    if rope.wire is not None and wheels.radius is not None:
        bending = np.minimum(bending, rope.E * rope.wire / (2.0 * wheels.radius))
    return out | {"stress_axial_max": axial, "stress_bending_max": bending, "stress_max": axial + bending}
