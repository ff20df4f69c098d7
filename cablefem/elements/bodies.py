"""Cars on the rope: what they need from it.

C = M (p.. - g j) - F_ext is the force that the rope must give to the car's point; the row of s takes Q = <lam> f.

    tau = <t>/|<t>|, t = r'/|r'|        F_ext = (F + thrust) tau - k |p. - wind| (p. - wind)
    f = hold - (mu_r |n . C| + brake) sign        n across tau

A cabin of mass m swings by phi at the arm h below p: its centre is p_c = p + h (sin phi, cos phi). Its drag acts there.

    C = M p.. + m h (phi.. e1 - phi.^2 e2) - M g j - F_ext        e1 = (cos phi, - sin phi), e2 = (sin phi, cos phi)
    row of phi: (J + m h^2) phi.. + m h (p.. . e1 + g sin phi) + c phi. - h e1 . drag
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cablefem.newmark import Array
from cablefem.scene.contacts import Car

STEP = 1e-30  # of derivatives by a complex step
INPUTS = 12  # of `forces_on_cars`: r' behind (2) and ahead (2), p. (2), p.. (2), F/M, phi, phi., phi..


class CarLoadsAndMasses(NamedTuple):
    """Masses, drag, friction, thrust, brakes, hold and cabins of the cars, (n,) each."""

    mass: Array
    drag: Array  # k [kg/m]
    wind: Array  # [m/s]
    friction: Array  # mu_r
    thrust: Array  # [N]
    brake: Array  # [N]
    hold: Array  # [N]
    sign: Array  # of the motion along the rope
    # of the cabin that swings, part of the mass; 0 without
    lever: Array  # m h [kg m]
    arm: Array  # h [m]
    inertia: Array  # J + m h^2 [kg m2]
    resistance: Array  # c [N m s]
    gravity: float
    rear_brake: Array  # [N] of `brake` at the rear one of two wheels


class ForcesOnCars(NamedTuple):
    """On the cars, (n,)."""

    contact_x: Array  # C
    contact_y: Array
    drive: Array  # Q
    tau_x: Array
    tau_y: Array
    stretch: Array  # <lam>
    haul: Array  # F
    friction: Array  # f without the hold
    normal: Array  # - n . C: the car presses on the rope
    swing: Array  # row of phi
    air_power: Array  # [W] of the drag

    @property
    def contact(self) -> Array:
        """C (n, 2)."""
        return np.stack([self.contact_x, self.contact_y], axis=-1)

    @property
    def tau(self) -> Array:
        """(n, 2)."""
        return np.stack([self.tau_x, self.tau_y], axis=-1)


class SwingConstants(NamedTuple):
    """Of the cabin of a car, see `CarLoadsAndMasses`; zero without."""

    lever: float
    arm: float
    inertia: float
    resistance: float


def swing_constants(car: Car, gravity: float) -> SwingConstants:
    """Those of the cabin of a car; zero without one."""
    cabin = car.hanger
    if cabin is None:
        return SwingConstants(0.0, 0.0, 0.0, 0.0)
    lever = cabin.mass * cabin.length
    inertia = cabin.inertia + lever * cabin.length
    return SwingConstants(lever, cabin.length, inertia, cabin.damping_moment_per_rate(gravity))


def masses_drag_and_friction(cars: Sequence[Car], gravity: float) -> CarLoadsAndMasses:
    """Data (n,) of cars without thrust, brakes and hold; a car on a shoe has no friction."""
    swings = [swing_constants(car, gravity) for car in cars]
    lever, arm, inertia, resistance = np.array(swings).reshape(-1, 4).T
    none = np.zeros(len(cars))
    return CarLoadsAndMasses(
        mass=np.array([car.mass for car in cars]),
        drag=np.array([car.drive.k for car in cars]),
        wind=np.array([car.drive.wind for car in cars]),
        friction=np.array([car.drive.mu_r if car.rail is None else 0.0 for car in cars]),
        thrust=none,
        brake=none,
        hold=none,
        sign=none,
        lever=lever,
        arm=arm,
        inertia=inertia,
        resistance=resistance,
        gravity=gravity,
        rear_brake=none,
    )


def vector_length(vectors: Array) -> Array:
    """Length of vectors (..., 2), also complex ones."""
    return np.sqrt(vectors[..., 0] ** 2 + vectors[..., 1] ** 2)


def forces_on_cars(cars: CarLoadsAndMasses, slopes_and_motion: Array) -> ForcesOnCars:
    """Forces at slopes and motions (..., n, INPUTS), which may be complex."""
    return car_forces(cars[:13], np.moveaxis(slopes_and_motion, -1, 0))


# --- of arrays, and in `segment_kernels` of numbers --------------------------------------------------------------
def car_forces(numbers: Any, inputs: Any) -> ForcesOnCars:
    """Forces on cars, by the first 13 of `CarLoadsAndMasses` and by their inputs (INPUTS, ...)."""
    mass, k, wind, mu_r, thrust, brake, hold, sign, lever, arm, inertia, resistance, gravity = numbers
    bx, by, ax, ay, vx, vy, x_a, y_a, force, angle, rate, turning = inputs
    behind = np.sqrt(bx * bx + by * by)
    ahead = np.sqrt(ax * ax + ay * ay)
    tangents_x = bx / behind + ax / ahead
    tangents_y = by / behind + ay / ahead
    size = np.sqrt(tangents_x * tangents_x + tangents_y * tangents_y)
    tau_x = tangents_x / size
    tau_y = tangents_y / size
    stretch = 0.5 * (behind + ahead)
    cos = np.cos(angle)
    sin = np.sin(angle)
    cabin_x = vx + arm * rate * cos  # what the air meets
    cabin_y = vy - arm * rate * sin
    air_x = cabin_x - wind
    drag = -k * np.sqrt(air_x * air_x + cabin_y * cabin_y + 1e-24)  # differentiable at rest
    drag_x = drag * air_x
    drag_y = drag * cabin_y
    haul = mass * force
    along = haul + thrust
    forward = lever * turning
    outward = lever * rate * rate
    contact_x = mass * x_a - along * tau_x - drag_x + forward * cos - outward * sin
    contact_y = mass * (y_a - gravity) - along * tau_y - drag_y - forward * sin - outward * cos
    normal = contact_x * tau_y - contact_y * tau_x
    friction = -(mu_r * normal * np.sign(normal.real) + brake) * sign
    drive = stretch * (hold + friction)
    about_hinge = lever * (x_a * cos - y_a * sin + gravity * sin)
    air_moment = arm * (drag_x * cos - drag_y * sin)
    swing = inertia * turning + about_hinge + resistance * rate - air_moment
    power = drag_x * cabin_x + drag_y * cabin_y
    return ForcesOnCars(contact_x, contact_y, drive, tau_x, tau_y, stretch, haul, friction, normal, swing, power)


def counterweight_balance_row(numbers: Any, ds: Any, dds: Any) -> Any:
    """e [N + N^2/(2 EA) + q y - rho (ds lam)^2/2], N = G + e m (1 + G/EA) dds, by rates of s there.

    numbers : G, e, m (1 + G/EA), q y, rho, EA; e is 1 at the right end, -1 at the left one.
    The rope that passes takes the energy of its weight and its motion along.
    """
    force, sign, mass, potential, rho, EA = numbers
    N = force + sign * mass * dds
    speed = ds * (1.0 + N / EA)
    return sign * (N + N**2 / (2.0 * EA) + (potential - 0.5 * rho * speed**2))


def car_force_jacobian(cars: CarLoadsAndMasses, slopes_and_motion: Array) -> Array:
    """Derivatives (n, 4, INPUTS) of C, - Q and the row of phi by slopes and motions (n, INPUTS)."""
    shifted = slopes_and_motion + 1j * STEP * np.eye(INPUTS)[:, None, :]  # (INPUTS, n, INPUTS)
    at = forces_on_cars(cars, shifted)
    values = np.stack([at.contact_x, at.contact_y, -at.drive, at.swing], axis=-1)  # (INPUTS, n, 4)
    return np.moveaxis(values.imag / STEP, 0, -1)
