"""A car that rolls without friction, drag and thrust keeps the energy of cable and car.

    E = int rho |r.|^2/2 + W - rho g y ds + M |p.|^2/2 - M g y_p = const,   W = T eps + EA eps^2/2.

Source: Hamilton's principle with s_o as a coordinate
Validity: no friction, drag or thrust
Accuracy: exact
Group: A car that rolls
"""

from functools import partial
from typing import Any

import numpy as np

from cablefem.scene import Scene
from validation.oracles.case import RIDERS, Case, Law, Limit, Solvers, ridden
from validation.oracles.rest import ZIP

LOSSLESS = Scene.from_toml(ZIP + "start = 2.0\nend = {time = 20.0}")


def drift(r: Any) -> Any:
    """Change of the energy over M g l."""
    assert LOSSLESS.mass is not None
    return np.abs(r.energy - r.energy[0]) / (LOSSLESS.mass.mass * LOSSLESS.gravity * r.length)


def _rule(scheme: str, solvers: Solvers, method: str, steps: float) -> Any:
    coarse = {"elements": 10} if method == "following-p2" else {}
    return drift(solvers.ride(LOSSLESS, method, steps=round(steps), scheme=scheme, **coarse))


def cases() -> list[Case]:
    return [
        Limit(
            name="damped rule: drift over M g l", refined="steps", values=(500.0, 1000.0, 2000.0), falls=1.0,
            because="the rule's own damping is of first order", deviation=partial(_rule, "newmark"), methods=RIDERS,
        ),
        Limit(
            name="generalised alpha: drift over M g l", refined="steps", values=(500.0, 2000.0), falls=0.5,
            because="what the start rings with is shorter than any step", methods=RIDERS[:1],
            deviation=partial(_rule, "generalized-alpha"),
        ),
        Law(
            name="sines: drift over M g l", defect=ridden(LOSSLESS, drift), falls=2.0, methods=RIDERS[1:],
            because="what of the car's balance the terms leave, whatever the steps",
        ),
        Law(
            name="the same with drag, which takes it", defect=ridden(LOSSLESS.replace({"drive.drag_area": 0.6}), drift),
            falls=2.0, methods=RIDERS, because="air takes what the weight gives", expected="disagree",
        ),
    ]  # fmt: skip
