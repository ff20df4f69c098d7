"""A car on a straight incline with drag, rolling friction and a brake.

From rest, drag -k v |v|:   v_t^2 = mu g sin/k,   s = (mu/k) ln cosh(t v_t k/mu).
Friction mu_r, brake force F_b from s_b on:   a = g (sin - mu_r cos),   v_b^2 = 2 a s_b,
    stop at s_b + v_b^2/(2 (F_b/mu - a)).
Limit of a car on a cable for sigma -> 0, g = sigma.

Source: Newton's law
Validity: sin > mu_r cos, F_b/mu > a
Accuracy: rounding
Group: A car that rolls
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cablefem.scene import Scene
from validation.oracles.case import RIDERS, Array, Limit, Solvers, refuse_unless, scene_in_units_of_cable


def terminal_speed(*, mu: float, g: float, sin: float, k: float) -> float:
    return math.sqrt(mu * g * sin / k)


def distance_with_drag(t: ArrayLike, *, mu: float, g: float, sin: float, k: float) -> Array:
    """s(t) with drag."""
    x = np.asarray(t, float) * terminal_speed(mu=mu, g=g, sin=sin, k=k) * k / mu
    return mu / k * (x + np.log1p(np.exp(-2.0 * x)) - math.log(2.0))


def stop_by_brake(s_b: float, *, mu: float, g: float, sin: float, mu_r: float, F_b: float) -> tuple[float, float]:
    """(t, s) at which the brake stops the car."""
    a = g * (sin - mu_r * math.sqrt(1.0 - sin * sin))
    back = F_b / mu - a
    refuse_unless("the car must roll, the brake must hold it", a > 0.0, back > 0.0)
    v_b = math.sqrt(2.0 * a * s_b)
    return v_b / a + v_b / back, s_b + v_b * v_b / (2.0 * back)


def distance_with_brake(t: ArrayLike, s_b: float, *, mu: float, g: float, sin: float, mu_r: float, F_b: float) -> Array:
    """s(t) with friction and brake."""
    end, last = stop_by_brake(s_b, mu=mu, g=g, sin=sin, mu_r=mu_r, F_b=F_b)
    a = g * (sin - mu_r * math.sqrt(1.0 - sin * sin))
    remaining = np.maximum(end - np.asarray(t, float), 0.0)
    return np.where(remaining > end - math.sqrt(2.0 * s_b / a), 0.5 * a * np.asarray(t, float) ** 2,
                    last - 0.5 * (F_b / mu - a) * remaining**2)  # fmt: skip


MU = 0.3
SIN = 0.2
START = 0.1


def _straight_rope_scene(sigma: float, **drive: Any) -> Scene:
    drive = {"mode": "free", "start": START} | drive
    return scene_in_units_of_cable(sigma, 500.0, MU, drive, span=math.sqrt(1.0 - SIN**2), drop=SIN)


def _drag_deviation(solvers: Solvers, method: str, sigma: float) -> Any:
    k = 1.5
    t_end = math.acosh(math.exp(0.7 * k / MU)) * MU / k / terminal_speed(mu=MU, g=sigma, sin=SIN, k=k)
    scene = _straight_rope_scene(sigma, air_density=1.0, drag_area=2.0 * k, end={"time": t_end})
    r = solvers.run_ride(scene, method, steps=200, scheme="generalized-alpha")
    return r.s_o - START - distance_with_drag(r.t, mu=MU, g=sigma, sin=SIN, k=k)


def _stop_deviation(solvers: Solvers, method: str, sigma: float) -> Any:
    shoe = 0.6
    mu_r = 0.04
    force = 3.0 * MU * sigma * SIN
    scene = _straight_rope_scene(sigma, rolling_friction=mu_r, brake=[{"from": shoe, "force": force}])
    r = solvers.run_ride(scene, method, steps=200, scheme="generalized-alpha")
    t = np.linspace(0.0, r.t[-1], 2001)
    return (
        np.interp(t, r.t, r.s_o)
        - START
        - distance_with_brake(t, shoe - START, mu=MU, g=sigma, sin=SIN, mu_r=mu_r, F_b=force)
    )


def cases() -> list[Limit]:
    """Comparisons with the solvers, wrong ones among them."""
    variants = [
        ("drag, taut cable: place over l", (0.1, 0.01, 0.001), _drag_deviation),
        ("friction and brake, taut cable: place over l", (0.01, 0.003, 0.0003), _stop_deviation),
    ]
    return [
        Limit(name=name, refined="sigma", values=values, order=1.0, because="the cable sags and gives way like sigma",
              deviation=deviation, methods=RIDERS)
        for name, values, deviation in variants
    ]  # fmt: skip
