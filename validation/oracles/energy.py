"""A car that rolls without friction, drag and thrust keeps the energy of cable and car.

    E = int rho |r.|^2/2 + W - rho g y ds + M |p.|^2/2 - M g y_p = const,   W = T eps + EA eps^2/2.

Hamilton's principle with s_o as one more coordinate.  Validity: gravity alone acts.  Accuracy: exact.
"""

import numpy as np

from cablefem.scene import Scene
from validation.oracles.case import RIDERS, ROLLS, Error, Limit, Oracle, Solvers, largest_and_rms
from validation.oracles.rest import ZIP


def drift(r, weight: float) -> Error:
    """Change of the energy over the car's weight times the cable's length."""
    off = np.abs(r.energy - r.energy[0]) / (weight * r.length)
    return largest_and_rms(off)


def _deviation(solvers: Solvers, method: str, steps: float) -> Error:
    """Drift of a ride by a rule that damps, in first order of the step; an undamped rule leaves rounding to look at."""
    scene = Scene.from_toml(ZIP + "start = 20.0\nend = {time = 10.0}")
    assert scene.mass is not None
    return drift(solvers.ride(scene, method, steps=round(steps), scheme="newmark"), scene.mass.mass * scene.gravity)


def _cases() -> list[Limit]:
    return [
        Limit(
            name="damped rule: drift over M g l", parameter="steps", values=(125.0, 250.0, 500.0), falls=1.0,
            because="the rule's own damping is of first order", deviation=_deviation, methods=RIDERS,
        )
    ]  # fmt: skip


ORACLE = Oracle(
    title="energy of a free ride under gravity alone",
    source="Hamilton's principle",
    validity="no friction, drag or thrust",
    group=ROLLS,
    cases=_cases,
)
