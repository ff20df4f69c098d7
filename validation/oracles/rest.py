"""A cable under a car that is held is an elastic catenary of two pieces; where it needs no force, the car is at rest.

    int lam n/N ds = (span, drop),  n = (h, V - sigma s), less (0, mu sigma) ahead of the car,  N = T + alpha eps,
with the car held along the cable by F_hold = [N lam - W], W = T eps + alpha eps^2/2; at rest without it n_y = +- mu
sigma/2 beside the car.

Balance of forces; material force.  Solved by `cablefem.scene.statics`, the common ground, which tests put into the
differential equation; both wings find their start by their own statics.  Validity: any sag, slope, mass and stiffness.
Accuracy: 1e-10.
"""

import numpy as np
from scipy.optimize import brentq

from cablefem.scene import Groups, Scene
from cablefem.scene.statics import gripped
from validation.oracles.case import RIDERS, ROLLS, Error, Law, Oracle, largest_and_rms

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


def place_of_rest(groups: Groups, low: float = 0.05, high: float = 0.95) -> float:
    """s_o at which a car that rolls stays; ValueError where there is none between low and high."""
    return float(brentq(lambda s: gripped(s, groups).hold[0], low, high, xtol=1e-14))


def _cases() -> list[Law]:
    start = 30.0
    scene = Scene.from_toml(ZIP + f"start = {start}\nrelease = 5.0\nend = {{time = 0.02}}")
    exact = gripped(start / scene.length, scene.groups)
    l, H = scene.length, scene.horizontal_tension
    (x, y), N = exact.place[0] * l, np.array([exact.behind[0], exact.ahead[0]]) * H
    sag = y - float(scene.catenary.y(start))

    def defect(r) -> Error:
        """Of place over deflection and of tensions over H, at the start."""
        off = max(np.hypot(r.x[0] - x, r.y[0] - y) / sag, np.abs(np.array([r.T_behind[0], r.T_ahead[0]]) - N).max() / H)
        return float(off), float(off)

    at = place_of_rest(scene.groups)
    still = Scene.from_toml(ZIP + f"start = {at * l!r}\nend = {{time = 6.0}}")

    def moved(r) -> Error:
        """Way over l that a car makes which should stay."""
        way = np.abs(r.s_o / l - at)
        return largest_and_rms(way)

    return [
        Law(name=name, scene=at, defect=law, falls=1.9, because="statics alone", methods=RIDERS)
        for name, at, law in (
            ("held car: place over deflection, tension over H", scene, defect),
            ("car at its place of rest stays: way over l", still, moved),
        )
    ]


ORACLE = Oracle(
    title="loaded cable at rest, the force that holds the car, the place that needs none",
    source="Balance of forces (Irvine, Cable Structures 1981), material force",
    validity="any cable",
    group=ROLLS,
    cases=_cases,
)
