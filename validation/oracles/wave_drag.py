"""A sled hauled along a string is braked by the waves it sends.

    v_tt - v_xx = R delta(x - xi),  mu y'' = mu sigma - R,  y = v(xi, t),  mu xi'' = F + R <v_x>;
hauled at speed V from s0, no echoes, W = mu sigma:
    R = W [ 1 + V^2 (1 + 2 mu) - 2 V^2 (1 + mu) e^(-2t/mu) ],
    <v_x> = W (1/2 - s0) + W V (1/2 - t) - R V/(2 (1 - V^2)),
    F = mu x.. - R [ <v_x> + sigma (1/2 - s_o) ],   x.. of the solver's path.                    (1)

Source: D'Acunto (reference 9 of Al-Qassab, Nair & O'Leary 2003), solved here
Validity: small slopes, before the first echo
Accuracy: rounding
Group: A car that rolls
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from cablefem.scene import ConstantSpeed
from validation.oracles.case import RIDERS, Array, Limit, Solvers, scene_in_units_of_cable


def wave_resistance_over_weight_squared(t: ArrayLike, *, mu: float, V: float, s0: float, drag: bool = True) -> Array:
    """F - mu x.. of (1) over W^2; drag=False: without the waves of R."""
    t = np.asarray(t, float)
    load = 1.0 + V * V * (1.0 + 2.0 * mu) - 2.0 * V * V * (1.0 + mu) * np.exp(-2.0 * t / mu)
    own_waves = drag * load * V / (2.0 * (1.0 - V * V))
    slope = 0.5 - s0 + V * (0.5 - t) - own_waves
    shape = 0.5 - s0 - V * t
    return -load * (slope + shape / mu)


def _resistance_errors_over_time(solvers: Solvers, method: str, sigma: float, *, exact_with_drag: bool) -> Array:
    mu = 0.3
    V = 0.4
    s0 = 0.35
    t_end = 0.45
    drive = {"mode": "haul", "start": s0, "end": {"place": s0 + V * t_end}}
    scene = scene_in_units_of_cable(sigma, 300.0, mu, drive, travel=ConstantSpeed(speed=V))
    r = solvers.run_scene(scene, method, steps=400, scheme="generalized-alpha")
    exact = wave_resistance_over_weight_squared(r.t / scene.time_scale, mu=mu, V=V, s0=s0, drag=exact_with_drag)
    resistance = r.F_haul - mu * r.acceleration[:, 0]
    return resistance / (mu * sigma) ** 2 - exact


def _wave_drag_limit(name: str, drag: bool) -> Limit:
    deviation = partial(_resistance_errors_over_time, exact_with_drag=drag)
    return Limit(
        name=name, refined="sigma", values=(3e-1, 1e-1, 3e-2), order=0.8, deviation=deviation, methods=RIDERS,
        because="sag and stretch change the waves like sigma", expected="agree" if drag else "disagree",
    )  # fmt: skip


def cases() -> Iterator[Limit]:
    yield _wave_drag_limit("hauled, taut string: force over (mu sigma)²", True)
    yield _wave_drag_limit("the same without wave drag", False)
