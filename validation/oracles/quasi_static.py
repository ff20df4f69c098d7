"""A slow car runs along its load path, the curve of its places at rest, whatever waves it leaves behind.

    mu |P'|^2 dds + mu P'.P'' ds^2 = -F_hold(s) + F_ext.P',   P(s) and F_hold(s) of `rest`,
the limit of a free ride for speeds small against the waves'.

Lagrange's equation for s_o with the cable's inertia left out.  Solved by `cablefem.scene.ride`, the common ground;
tests hold it against closed forms on the chord and against energy.  Validity: error (V/c)^2; 1e-3 l at V/c = 0.4.
Accuracy: 3e-8 l.
"""

import numpy as np

from cablefem.scene import Scene
from cablefem.scene.ride import LoadPath, Ride, ride
from validation.oracles.case import RIDERS, ROLLS, Error, Limit, Oracle, Solvers, largest_and_rms
from validation.oracles.rest import ZIP


def rolled(scene: Scene) -> Ride:
    """The ride of a free car along the load path."""
    g = scene.groups
    return ride(LoadPath.loaded(g), g.mu, g.sigma, g.drive)


def _deviation(solvers: Solvers, method: str, drag: float) -> Error:
    """Distance of s_o(t) from the quasi-static ride, over l; a car with so much drag, let go over a while."""
    scene = Scene.from_toml(ZIP + f"start = 60.0\nrelease = 4.0\ndrag_area = {drag!r}\nend = {{place = 110.0}}")
    r = solvers.ride(scene, method, steps=400, scheme="generalized-alpha")
    off = np.abs(r.s_o / r.length - rolled(scene).at(r.t / scene.time_scale)[0])
    return largest_and_rms(off)


def _cases() -> list[Limit]:
    return [
        Limit(
            name="much drag: place over l", parameter="drag area", values=(2.5, 10.0, 40.0), falls=1.0,
            deviation=_deviation, methods=RIDERS,
            because="the cable's inertia counts like the speed's square, which falls like one over the drag",
        )
    ]  # fmt: skip


ORACLE = Oracle(
    title="slow free ride along the load path",
    source="Lagrange's equation without the cable's inertia",
    validity="speeds small against the waves'",
    group=ROLLS,
    cases=_cases,
)
