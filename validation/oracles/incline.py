"""A car on a straight incline with drag, rolling friction and a brake.

From rest, drag -k v |v|:   v_t^2 = mu g sin/k,   s = (mu/k) ln cosh(t v_t k/mu).
Friction mu_r, brake force F_b from s_b on:   a = g (sin - mu_r cos),   v_b^2 = 2 a s_b,
    stop at s_b + v_b^2/(2 (F_b/mu - a)).
The functions call mu the mass (over that of the cable), k the drag factor and s_b the position of the brake.
Limit of a car on a cable for sigma -> 0, g = sigma.

Source: Newton's law
Validity: sin > mu_r cos, F_b/mu > a
Accuracy: rounding
Group: A car that rolls
"""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cablefem.scene import Scene
from validation.oracles.case import RIDERS, Array, Limit, Solvers, refuse_unless, scene_in_units_of_cable


def terminal_speed(*, mass: float, g: float, sin: float, drag_factor: float) -> float:
    return math.sqrt(mass * g * sin / drag_factor)


def distance_with_drag(t: ArrayLike, *, mass: float, g: float, sin: float, drag_factor: float) -> Array:
    """s(t) from the release, with drag."""
    v_t = terminal_speed(mass=mass, g=g, sin=sin, drag_factor=drag_factor)
    x = np.asarray(t, float) * v_t * drag_factor / mass
    log_cosh = x + np.log1p(np.exp(-2.0 * x)) - math.log(2.0)
    return mass / drag_factor * log_cosh


def time_and_position_of_stop(
    brake_position: float, *, mass: float, g: float, sin: float, rolling_friction: float, brake_force: float
) -> tuple[float, float]:
    """Time and position (t, s), both from the release, at which the brake stops the car."""
    a = g * (sin - rolling_friction * math.sqrt(1.0 - sin * sin))
    back = brake_force / mass - a
    refuse_unless("the car must roll, the brake must hold it", a > 0.0, back > 0.0)
    v_b = math.sqrt(2.0 * a * brake_position)
    t_stop = v_b / a + v_b / back
    return t_stop, brake_position + v_b * v_b / (2.0 * back)


def distance_with_brake(
    t: ArrayLike, brake_position: float, *,
    mass: float, g: float, sin: float, rolling_friction: float, brake_force: float,
) -> Array:  # fmt: skip
    """s(t) from the release, with friction and brake."""
    t = np.asarray(t, float)
    t_stop, s_stop = time_and_position_of_stop(
        brake_position, mass=mass, g=g, sin=sin, rolling_friction=rolling_friction, brake_force=brake_force
    )
    a = g * (sin - rolling_friction * math.sqrt(1.0 - sin * sin))
    t_brake = math.sqrt(2.0 * brake_position / a)
    remaining = np.maximum(t_stop - t, 0.0)
    rolling = 0.5 * a * t**2
    braking = s_stop - 0.5 * (brake_force / mass - a) * remaining**2
    before_brake = remaining > t_stop - t_brake
    return np.where(before_brake, rolling, braking)


MU = 0.3
SIN = 0.2
START = 0.1


def _free_ride_on_straight_rope(sigma: float, **drive: Any) -> Scene:
    drive = {"mode": "free", "start": START} | drive
    return scene_in_units_of_cable(sigma, 500.0, MU, drive, span=math.sqrt(1.0 - SIN**2), drop=SIN)


def _deviation_with_drag(solvers: Solvers, method: str, sigma: float) -> Array:
    drag_factor = 1.5
    exact: Any = {"mass": MU, "g": sigma, "sin": SIN, "drag_factor": drag_factor}
    x_end = math.acosh(math.exp(0.7 * drag_factor / MU))  # distance 0.7
    t_end = x_end * MU / drag_factor / terminal_speed(**exact)
    scene = _free_ride_on_straight_rope(sigma, air_density=1.0, drag_area=2.0 * drag_factor, end={"time": t_end})
    r = solvers.run_scene(scene, method, steps=200, scheme="generalized-alpha")
    return r.s_o - START - distance_with_drag(r.t, **exact)


def _deviation_with_brake(solvers: Solvers, method: str, sigma: float) -> Array:
    shoe = 0.6
    mu_r = 0.04
    force = 3.0 * MU * sigma * SIN
    brake = [{"from": shoe, "force": force}]
    scene = _free_ride_on_straight_rope(sigma, rolling_friction=mu_r, brake=brake)
    r = solvers.run_scene(scene, method, steps=200, scheme="generalized-alpha")
    t = np.linspace(0.0, r.t[-1], 2001)
    s_o = np.interp(t, r.t, r.s_o)
    exact: Any = {"mass": MU, "g": sigma, "sin": SIN, "rolling_friction": mu_r, "brake_force": force}
    return s_o - START - distance_with_brake(t, shoe - START, **exact)


def cases() -> Iterator[Limit]:
    """Comparisons with the solvers, wrong ones among them."""
    because = "the cable sags and gives way like sigma"
    taut = partial(Limit, refined="sigma", order=1.0, because=because, methods=RIDERS)
    drag = "drag, taut cable: place over l"
    yield taut(name=drag, values=(0.1, 0.01, 0.001), deviation=_deviation_with_drag)
    brake = "friction and brake, taut cable: place over l"
    yield taut(name=brake, values=(0.01, 0.003, 0.0003), deviation=_deviation_with_brake)
