"""Cars on the rope: what they need from it.

C = M (p.. - g j) - F_ext is the force that the rope must give to the car's point; the row of s takes Q = <lam> f.

    tau = <r'>/|<r'>|        F_ext = (F + thrust) tau - k |p. - wind| (p. - wind)
    f = hold - (mu_r |n . C| + brake) sign        n across tau
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cablefem.newmark import Array

STEP = 1e-30  # of derivatives by a complex step
INPUTS = 9  # of `forces`: r' behind (2) and ahead (2), p. (2), p.. (2), F/M


class Cars(NamedTuple):
    """Data of the cars, (n,) each."""

    mass: Array
    drag: Array  # k [kg/m]
    wind: Array  # [m/s]
    friction: Array  # mu_r
    thrust: Array  # [N]
    brake: Array  # [N]
    hold: Array  # [N]
    sign: Array  # of the motion along the rope
    gravity: float


class Forces(NamedTuple):
    """On the cars, (n,) or (n, 2)."""

    contact: Array  # C
    drive: Array  # Q
    tau: Array
    stretch: Array  # <lam>
    haul: Array  # F
    drag: Array
    friction: Array  # f without the hold
    normal: Array  # - n . C: the car presses on the rope


def size(x: Array) -> Array:
    """Length of vectors (..., 2), also complex ones."""
    return np.sqrt(x[..., 0] ** 2 + x[..., 1] ** 2)


def forces(cars: Cars, inputs: Array) -> Forces:
    """Forces at inputs (..., n, INPUTS), which may be complex."""
    behind, ahead, velocity, acceleration = (inputs[..., i : i + 2] for i in (0, 2, 4, 6))
    mean = 0.5 * (behind + ahead)
    tau = mean / size(mean)[..., None]
    air = velocity - np.stack([cars.wind, np.zeros_like(cars.wind)], axis=-1)
    speed = np.sqrt(air[..., 0] ** 2 + air[..., 1] ** 2 + 1e-24)  # differentiable at rest
    drag = -(cars.drag * speed)[..., None] * air
    haul = cars.mass * inputs[..., 8]
    weight = cars.mass[:, None] * np.array([0.0, cars.gravity])
    contact = cars.mass[:, None] * acceleration - weight - (haul + cars.thrust)[..., None] * tau - drag
    normal = contact[..., 0] * tau[..., 1] - contact[..., 1] * tau[..., 0]
    load = np.where(normal.real < 0.0, -normal, normal)
    friction = -(cars.friction * load + cars.brake) * cars.sign
    stretch = 0.5 * (size(behind) + size(ahead))
    return Forces(contact, stretch * (cars.hold + friction), tau, stretch, haul, drag, friction, normal)


def derivatives(cars: Cars, inputs: Array) -> Array:
    """Derivatives (n, 3, INPUTS) of C and Q by the inputs (n, INPUTS)."""
    shifted = inputs + 1j * STEP * np.eye(INPUTS)[:, None, :]  # (INPUTS, n, INPUTS)
    at = forces(cars, shifted)
    values = np.concatenate([at.contact, at.drive[..., None]], axis=-1)  # (INPUTS, n, 3)
    return np.moveaxis(values.imag / STEP, 0, -1)
