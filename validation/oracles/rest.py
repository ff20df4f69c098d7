"""The loaded cable at rest, the force that holds the car, and the place that needs none.

    int lam n/N ds = (span, drop),  n = (h, V - sigma s), less (0, mu sigma) ahead of the car,  N = T + alpha eps,
    F_hold = [N lam - W],  W = T eps + alpha eps^2/2,

by `cablefem.scene.statics`; the solvers use statics of their own.

Source: Balance of forces (Irvine, Cable Structures 1981), material force
Validity: any sag, slope, mass and stiffness
Accuracy: 1e-10
Group: A car that rolls
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import brentq

from cablefem.scene import Groups, Scene
from cablefem.scene.statics import Rest, gripped_rest
from validation.oracles.case import RIDERS, Array, Defect, Law, Solvers, defect_of_ride

ZIP = """
    [cable]
    mass_per_length = 1.1
    EA = 1.2e7
    sag = 6.0
    [supports]
    span = 300.0
    drop = 15.0
    [mass]
    mass = 95.0
    [drive]
    mode = "free"
"""
TENTH = 0.1  # s_o of a held car


def relative_rest_position(groups: Groups, low: float = 0.05, high: float = 0.95) -> float:
    """s_o/l in [low, high] at which a car needs no force to stay."""
    return float(brentq(lambda s: gripped_rest(s, groups).hold[0], low, high, xtol=1e-14))


def holding_force_by_car_balance(rest: Rest) -> float:
    """F_hold by the car's balance, <lam> tau.C/cos(phi); 1e-6 off."""
    mean = 0.5 * (rest.slope_behind[0] + rest.slope_ahead[0])
    return float(mean @ rest.jump[0] * rest.mean_stretch_at_car[0] ** 2 / (mean @ mean))


Quantity = Callable[[Callable[[float], float], Groups], float]  # of a solver's holding force over s_o, on a rope


def _force_at_a_tenth(holding_force: Callable[[float], float], groups: Groups) -> float:
    """Force that holds a car at s_o = 0.1."""
    return holding_force(TENTH)


def _relative_rest_position_by_force(holding_force: Callable[[float], float], groups: Groups) -> float:
    """s_o/l near the exact one at which the force vanishes."""
    exact = relative_rest_position(groups)
    return float(brentq(holding_force, exact - 0.06, exact + 0.06, xtol=1e-14))


def _deviation_on_ropes(ropes: Sequence[Groups], quantity: Quantity, exact: Array, scale: Any = 1.0) -> Defect:
    """A defect as `Law` takes it: one number per rope."""

    def defect(solvers: Solvers, method: str, settings: dict[str, Any]) -> Array:
        values = []
        for groups in ropes:
            force = partial(solvers.holding_force, groups, method, **settings)
            values.append(quantity(force, groups))
        return (np.array(values) - exact) / scale

    return defect


def _laws_of_held_car() -> Iterator[Law]:
    """A held car: force at s_o = 0.1, or place of rest."""
    zip_line = Scene.from_toml(ZIP + "start = 2.0")
    ropes = [scene.groups for scene in (zip_line, Scene.load("level"), Scene.load("inclined"))]
    rests = [gripped_rest(TENTH, g) for g in ropes]
    holds = np.array([rest.hold[0] for rest in rests])
    balanced = np.array([holding_force_by_car_balance(rest) for rest in rests])
    places = np.array([relative_rest_position(g) for g in ropes])
    # wrong on purpose: on the empty cable's shape
    weights = np.array([-g.mu * g.sigma * g.tension_and_slope(TENTH)[2] for g in ropes])
    lowest = np.array([g.c / g.sigma for g in ropes])

    statics = "statics alone"
    gives = "the cable gives way under the car"
    force = "force that holds a car at 0.1 l, over itself"
    force_off = partial(_deviation_on_ropes, ropes, _force_at_a_tenth, scale=holds)
    elements, sines = RIDERS
    on_empty_rope = partial(Law, methods=RIDERS, order=1.0, because=gives, expected="disagree")
    wrong = " on the empty cable's shape"
    yield Law(name=force, methods=(elements,), defect=force_off(holds), order=3.0, because=statics)
    yield on_empty_rope(name=force + wrong, defect=force_off(weights))
    yield Law(
        name=force, methods=(sines,), defect=force_off(balanced), order=1.9, because=statics + ", by the car's balance"
    )
    place = "place of rest over l"
    place_off = partial(_deviation_on_ropes, ropes, _relative_rest_position_by_force)
    yield Law(name=place, methods=RIDERS, defect=place_off(places), order=2.4, because=statics)
    yield on_empty_rope(name=place + wrong, defect=place_off(lowest))


def cases() -> Iterator[Law]:
    """Comparisons with the solvers, wrong ones among them."""
    yield from _laws_of_held_car()
    start = 30.0
    scene = Scene.from_toml(ZIP + f"start = {start}\nrelease = 5.0\nend = {{time = 0.02}}")
    exact = gripped_rest(start / scene.length, scene.groups)
    l = scene.length
    H = scene.horizontal_tension
    x, y = exact.car_point[0] * l
    N = np.array([exact.behind[0], exact.ahead[0]]) * H
    sag = y - float(scene.catenary.y(start))

    def start_defect(r: Any) -> float:
        tensions = np.array([r.T_behind[0], r.T_ahead[0]])
        off = np.abs(tensions - N).max() / H
        return max(np.hypot(r.x[0] - x, r.y[0] - y) / sag, off)

    statics = partial(Law, order=1.9, because="statics alone", methods=RIDERS)
    held = "held car: place over deflection, tension over H"
    yield statics(name=held, defect=defect_of_ride(scene, start_defect))
    at = relative_rest_position(scene.groups)
    still = Scene.from_toml(ZIP + f"start = {at * l!r}\nend = {{time = 6.0}}\nrest_speed = 1e-12")
    stays = "car at its place of rest stays: way over l"
    yield statics(name=stays, defect=defect_of_ride(still, lambda r: r.s_o / l - at))
