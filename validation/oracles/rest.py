"""The loaded cable at rest, the force that holds the car, and the place that needs none.

    int lam n/N ds = (span, drop),  n = (h, V - sigma s), less (0, mu sigma) ahead of the car,  N = T + alpha eps,
    F_hold = [N lam - W],  W = T eps + alpha eps^2/2,

by `cablefem.scene.statics`; the solvers use statics of their own.

Source: Balance of forces (Irvine, Cable Structures 1981), material force
Validity: any sag, slope, mass and stiffness
Accuracy: 1e-10
Group: A car that rolls
"""

from collections.abc import Callable
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


def rest_position(groups: Groups, low: float = 0.05, high: float = 0.95) -> float:
    """s_o/l in [low, high] at which a car needs no force to stay."""
    return float(brentq(lambda s: gripped_rest(s, groups).hold[0], low, high, xtol=1e-14))


def holding_force_by_car_balance(rest: Rest) -> float:
    """F_hold by the car's balance, <lam> tau.C/cos(phi); 1e-6 off."""
    mean = 0.5 * (rest.slope_behind[0] + rest.slope_ahead[0])
    return float(mean @ rest.jump[0] * rest.stretch_at_car[0] ** 2 / (mean @ mean))


def _laws_of_held_car() -> list[Law]:
    """A held car: force at s_o = 0.1, or place of rest."""
    lines = [Scene.from_toml(ZIP + "start = 2.0").groups, Scene.load("level").groups, Scene.load("inclined").groups]

    def for_each_line(quantity: Callable[[Groups], Any]) -> Array:
        return np.array(list(map(quantity, lines)))

    def hold(solvers: Solvers, method: str, settings: dict[str, Any]) -> Array:
        return for_each_line(lambda g: solvers.holding_force(g, method, TENTH, **settings))

    def position(solvers: Solvers, method: str, settings: dict[str, Any]) -> Array:
        """s_o/l of rest on each line."""

        def found(g: Groups) -> float:
            at = rest_position(g)
            return float(
                brentq(lambda s: solvers.holding_force(g, method, s, **settings), at - 0.06, at + 0.06, xtol=1e-14)
            )

        return for_each_line(found)

    def deviation(force: bool, exact: Array) -> Defect:
        answer, scale = (hold, holds) if force else (position, 1.0)
        return lambda solvers, method, settings: (answer(solvers, method, settings) - exact) / scale

    holds = for_each_line(lambda g: gripped_rest(TENTH, g).hold[0])
    positions = for_each_line(rest_position)
    balanced = for_each_line(lambda g: holding_force_by_car_balance(gripped_rest(TENTH, g)))
    # wrong on purpose: on the empty cable's shape
    weights = for_each_line(lambda g: -g.mu * g.sigma * g.tension_and_slope(TENTH)[2])
    lowest = for_each_line(lambda g: g.c / g.sigma)

    statics = "statics alone"
    gives = "the cable gives way under the car"
    empty = " on the empty cable's shape"
    variants = [
        (RIDERS[:1], True, holds, 3.0, statics, ""), (RIDERS, True, weights, 1.0, gives, empty),
        (RIDERS[1:], True, balanced, 1.9, statics + ", by the car's balance", ""),
        (RIDERS, False, positions, 2.4, statics, ""), (RIDERS, False, lowest, 1.0, gives, empty),
    ]  # fmt: skip
    return [
        Law(
            name=("force that holds a car at 0.1 l, over itself" if force else "place of rest over l") + where,
            methods=methods, defect=deviation(force, exact), order=falls, because=because,
            expected="disagree" if where else "agree",
        )
        for methods, force, exact, falls, because, where in variants
    ]  # fmt: skip


def cases() -> list[Law]:
    """Comparisons with the solvers, wrong ones among them."""
    start = 30.0
    scene = Scene.from_toml(ZIP + f"start = {start}\nrelease = 5.0\nend = {{time = 0.02}}")
    exact = gripped_rest(start / scene.length, scene.groups)
    l = scene.length
    H = scene.horizontal_tension
    x, y = exact.car_point[0] * l
    N = np.array([exact.behind[0], exact.ahead[0]]) * H
    sag = y - float(scene.catenary.y(start))

    def defect(r: Any) -> float:
        off = np.abs(np.array([r.T_behind[0], r.T_ahead[0]]) - N).max() / H
        return max(np.hypot(r.x[0] - x, r.y[0] - y) / sag, off)

    at = rest_position(scene.groups)
    still = Scene.from_toml(ZIP + f"start = {at * l!r}\nend = {{time = 6.0}}\nrest_speed = 1e-12")
    laws = {
        "held car: place over deflection, tension over H": defect_of_ride(scene, defect),
        "car at its place of rest stays: way over l": defect_of_ride(still, lambda r: r.s_o / l - at),
    }
    alone: dict[str, Any] = {"order": 1.9, "because": "statics alone", "methods": RIDERS}
    return _laws_of_held_car() + [Law(name=name, defect=law, **alone) for name, law in laws.items()]
