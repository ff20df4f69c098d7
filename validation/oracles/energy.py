"""A car that rolls without friction, drag and thrust keeps the energy of cable and car.

    E = int rho |r.|^2/2 + W - rho g y ds + M |p.|^2/2 - M g y_p = const,   W = T eps + EA eps^2/2.

Source: Hamilton's principle with s_o as a coordinate
Validity: no friction, drag or thrust
Accuracy: exact
Group: A car that rolls
"""

from functools import partial

import numpy as np

from cablefem.scene import Scene
from validation.oracles.case import RIDERS, Case, Error, Law, Limit, Solvers, largest_and_rms
from validation.oracles.rest import ZIP


def drift(r, weight: float) -> Error:
    """Change of the energy over M g l."""
    off = np.abs(r.energy - r.energy[0]) / (weight * r.length)
    return largest_and_rms(off)


def ride(drag: float = 0.0) -> Scene:
    air = f"drag_area = {drag}\n" if drag else ""
    return Scene.from_toml(ZIP + f"start = 2.0\n{air}end = {{time = 20.0}}")


def _of(scene: Scene, r) -> Error:
    assert scene.mass is not None
    return drift(r, scene.mass.mass * scene.gravity)


def _rule(scheme: str, solvers: Solvers, method: str, steps: float) -> Error:
    coarse = {"elements": 10} if method == "following-p2" else {}
    return _of(scene := ride(), solvers.ride(scene, method, steps=round(steps), scheme=scheme, **coarse))


def cases() -> list[Case]:
    lossy = ride(drag=0.6)
    return [
        Limit(
            name="damped rule: drift over M g l", parameter="steps", values=(500.0, 1000.0, 2000.0), falls=1.0,
            because="the rule's own damping is of first order", deviation=partial(_rule, "newmark"), methods=RIDERS,
        ),
        Limit(
            name="generalised alpha: drift over M g l", parameter="steps", values=(500.0, 2000.0), falls=0.5,
            because="what the start rings with is shorter than any step", methods=RIDERS[:1],
            deviation=partial(_rule, "generalized-alpha"),
        ),
        Law(
            name="sines: drift over M g l", scene=ride(), defect=partial(_of, ride()), falls=2.0, methods=RIDERS[1:],
            because="what of the car's balance the terms leave, whatever the steps",
        ),
        Law(
            name="the same with drag, which takes it", scene=lossy, defect=partial(_of, lossy), falls=2.0,
            methods=RIDERS, because="air takes what the weight gives", expected="disagree",
        ),
    ]  # fmt: skip
