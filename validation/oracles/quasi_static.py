"""A slow free ride along the load path, the curve of the car's places at rest.

Its equation is that of `cablefem.scene.ride`, which the solvers share.

Source: Lagrange's equation for s_o without the cable's inertia
Validity: speeds small against the waves'; error (V/c)^2, 1e-3 l at V/c = 0.4
Accuracy: 3e-8 l
Group: A car that rolls
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from cablefem.scene import Scene
from cablefem.scene.ride import LoadPath, Ride, roll_ride
from validation.oracles.case import RIDERS, Array, Limit, Solvers, scene_in_units_of_cable
from validation.oracles.rest import ZIP

Curve = Callable[[Any], LoadPath]


def quasi_static_ride(scene: Scene, curve: Curve = LoadPath.on_loaded_cable) -> Ride:
    g = scene.groups
    return roll_ride(curve(g), g.mu, g.sigma, g.drive)


def _path_deviations_over_time(solvers: Solvers, method: str, drag_area: float) -> Array:
    """Distance of s_o(t) from the quasi-static ride, over l."""
    scene = Scene.from_toml(ZIP + f"start = 60.0\nrelease = 4.0\ndrag_area = {drag_area!r}\nend = {{place = 110.0}}")
    r = solvers.run_scene(scene, method, steps=400, scheme="generalized-alpha")
    exact, _ = quasi_static_ride(scene).position_and_speed(r.t / scene.time_scale)
    return np.abs(r.s_o / r.length - exact)


def _deviation_with_fast_waves(quantity: str, curve: Curve, solvers: Solvers, method: str, sigma: float) -> Array:
    """Error of place over l, or of speed over the largest."""
    drive = {"mode": "free", "start": 0.02, "end": {"place": 0.9}}
    scene = scene_in_units_of_cable(sigma, 1200.0, 0.3, drive, span=0.96, drop=0.28, horizontal_tension=1.0)
    r = solvers.run_scene(scene, method, steps=600)
    other = quasi_static_ride(scene, curve)
    t = r.t / scene.time_scale
    there = t <= other.duration
    t = np.minimum(t, other.duration)
    if quantity == "place":
        s_o, _ = other.position_and_speed(t)
        return (s_o - r.s_o / r.length)[there]
    speed = r.speed * scene.time_scale / r.length
    return ((other.point_speed(t) - speed) / speed.max())[there]


def cases() -> Iterator[Limit]:
    """Limits in which rides become quasi-static: much drag, and waves that are fast against the car."""
    slow = "the cable's inertia counts like the speed's square, which falls like one over the drag"
    yield Limit(
        name="much drag: place over l", refined="drag area", values=(2.5, 10.0, 40.0), order=1.0, because=slow,
        deviation=_path_deviations_over_time, methods=RIDERS,
    )  # fmt: skip
    yield _fast_waves_limit("place over l", "place", LoadPath.on_loaded_cable)
    yield _fast_waves_limit("speed over the largest", "speed", LoadPath.on_loaded_cable)
    yield _fast_waves_limit("speed along the empty cable's shape", "speed", LoadPath.on_empty_cable, "disagree")


def _fast_waves_limit(name: str, quantity: str, curve: Curve, expected: str = "agree") -> Limit:
    waves = "waves take (V/c)² of what the car bends, and both fall like sigma"
    deviation = partial(_deviation_with_fast_waves, quantity, curve)
    return Limit(
        name=f"up to V/c = 0.4: {name}", refined="sigma", values=(0.32, 0.16, 0.08), order=1.6, because=waves,
        deviation=deviation, methods=RIDERS, expected=expected,
    )  # fmt: skip
