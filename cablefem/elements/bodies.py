"""Cars on the rope: what they need from it.

C = M (p.. - g j) - F_ext is the force that the rope must give to the car's point; the row of s takes Q = <lam> f.

    tau = <r'>/|<r'>|        F_ext = (F + thrust) tau - k |p. - wind| (p. - wind)
    f = hold - (mu_r |n . C| + brake) sign        n across tau

A cabin of mass m swings by phi at the arm h below p: its centre is p_c = p + h (sin phi, cos phi). Its drag acts there.

    C = M p.. + m h (phi.. e1 - phi.^2 e2) - M g j - F_ext        e1 = (cos phi, - sin phi), e2 = (sin phi, cos phi)
    row of phi: (J + m h^2) phi.. + m h (p.. . e1 + g sin phi) + c phi. - h e1 . drag
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cablefem.elements.segments import dot
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
    """On the cars, (n,) or (n, 2)."""

    contact: Array  # C
    drive: Array  # Q
    tau: Array
    stretch: Array  # <lam>
    haul: Array  # F
    friction: Array  # f without the hold
    normal: Array  # - n . C: the car presses on the rope
    swing: Array  # row of phi
    air_power: Array  # [W] of the drag


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
    y = slopes_and_motion
    behind = y[..., 0:2]
    ahead = y[..., 2:4]
    velocity = y[..., 4:6]
    acceleration = y[..., 6:8]
    haul = cars.mass * y[..., 8]
    angle = y[..., 9]
    rate = y[..., 10]
    turning = y[..., 11]
    forward = np.stack([np.cos(angle), -np.sin(angle)], axis=-1)
    out = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    mean = 0.5 * (behind + ahead)
    tau = mean / vector_length(mean)[..., None]
    stretch = 0.5 * (vector_length(behind) + vector_length(ahead))
    cabin_velocity = velocity + (cars.arm * rate)[..., None] * forward  # what the air meets
    air = cabin_velocity - np.stack([cars.wind, np.zeros_like(cars.wind)], axis=-1)
    speed = np.sqrt(air[..., 0] ** 2 + air[..., 1] ** 2 + 1e-24)  # differentiable at rest
    drag = -(cars.drag * speed)[..., None] * air
    weight = cars.mass[:, None] * np.array([0.0, cars.gravity])
    driven = (haul + cars.thrust)[..., None] * tau
    contact = cars.mass[:, None] * acceleration - weight - driven - drag
    contact = contact + (cars.lever * turning)[..., None] * forward - (cars.lever * rate**2)[..., None] * out
    normal = contact[..., 0] * tau[..., 1] - contact[..., 1] * tau[..., 0]
    load = np.where(normal.real < 0.0, -normal, normal)
    friction = -(cars.friction * load + cars.brake) * cars.sign
    about_hinge = cars.lever * (dot(acceleration, forward) + cars.gravity * np.sin(angle))
    swing = cars.inertia * turning + about_hinge + cars.resistance * rate - cars.arm * dot(drag, forward)
    return ForcesOnCars(
        contact=contact,
        drive=stretch * (cars.hold + friction),
        tau=tau,
        stretch=stretch,
        haul=haul,
        friction=friction,
        normal=normal,
        swing=swing,
        air_power=dot(drag, cabin_velocity),
    )


def car_force_jacobian(cars: CarLoadsAndMasses, slopes_and_motion: Array) -> Array:
    """Derivatives (n, 4, INPUTS) of C, - Q and the row of phi by slopes and motions (n, INPUTS)."""
    shifted = slopes_and_motion + 1j * STEP * np.eye(INPUTS)[:, None, :]  # (INPUTS, n, INPUTS)
    at = forces_on_cars(cars, shifted)
    values = np.concatenate([at.contact, -at.drive[..., None], at.swing[..., None]], axis=-1)  # (INPUTS, n, 4)
    return np.moveaxis(values.imag / STEP, 0, -1)
