"""Random realistic scenes: a gripped car on a locked rope, a hauled one, a rider on a thin rope."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cablefem.scene import Scene

Draw = Callable[[float, float], float]
Tables = dict[str, Any]


def _locked(draw: Draw) -> Tables:
    """Cable, supports and mass of a ropeway.

    A full locked rope: 0.87 of its circle is metal, 8450 kg/m^3 with filling, 160 GPa.
    """
    span, diameter = draw(200.0, 1500.0), draw(0.025, 0.055)
    area = 0.87 * math.pi * diameter**2 / 4.0
    H = area * draw(200e6, 400e6)
    cable = {"mass_per_length": 8450.0 * area, "EA": 160e9 * area, "horizontal_tension": H}
    supports = {"span": span, "drop": span * draw(-0.6, 0.6)}
    return {"cable": cable, "supports": supports, "mass": {"mass": H * draw(0.02, 0.2) / 9.81}}


def gripped(draw: Draw) -> Scene:
    """A car that grips a locked rope, at 0.1 to 0.5 of the wave speed."""
    x = _locked(draw)
    speed = draw(0.1, 0.5) * math.sqrt(x["cable"]["horizontal_tension"] / x["cable"]["mass_per_length"])
    travel = {"kind": "constant_speed", "speed": speed}
    if draw(0.0, 1.0) > 0.5:
        travel = {"kind": "accelerate_cruise_brake", "top_speed": speed}
    return Scene(**x | {"travel": travel}, name="gripped")


def hauled(draw: Draw) -> Scene:
    """A car that rolls on a locked rope and is hauled at 4 to 12 m/s."""
    x = _locked(draw)
    travel = {"kind": "accelerate_cruise_brake", "top_speed": draw(4.0, 12.0)}
    x |= {"travel": travel, "drive": {"mode": "haul", "rolling_friction": draw(0.0, 0.02)}}
    return Scene(**x, name="hauled")


def free(draw: Draw) -> Scene:
    """A rider on a thin rope, with a brake at 0.93 of the span.

    A stranded rope of diameter d [mm]: 0.0045 d^2 kg/m, 56 d^2 kN.
    """
    span, d = draw(60.0, 600.0), draw(10.0, 20.0)
    supports = {"span": span, "drop": span * draw(0.03, 0.12)}
    cable = {"mass_per_length": 0.0045 * d**2, "EA": 56e3 * d**2, "sag": span * draw(0.012, 0.03)}
    x: Tables = {"cable": cable, "supports": supports, "mass": {"mass": draw(40.0, 120.0)}}
    x["drive"] = {"mode": "free", "rolling_friction": draw(0.005, 0.03), "drag_area": draw(0.3, 0.8)}
    x["drive"]["brake"] = [{"from": 0.93 * span, "force": draw(200.0, 600.0)}]
    return Scene(**x, name="free")


FAMILIES = (gripped, hauled, free)


def realistic(seed: int, index: int) -> Scene:
    """A scene of the families in turn."""
    rng = np.random.default_rng([seed, index])
    return FAMILIES[index % len(FAMILIES)](lambda low, high: float(rng.uniform(low, high)))


SOUND = 60  # cases without a fault
FAULTS = ("mass.mass", "cable.EA", "cable.mass_per_length", "travel.top_speed")


def case(seed: int, number: int) -> tuple[Scene, str | None]:
    """The scene of a case of the study `power`, and the key that the second solver is told 1 percent larger."""
    if number < SOUND:
        return realistic(seed, number), None
    index = number - SOUND
    scene = realistic(seed, index)
    key = FAULTS[index // len(FAMILIES) % (3 if scene.drive.mode == "free" else 4)]
    return scene, "travel.speed" if key == FAULTS[-1] and "top_speed" not in scene.to_toml() else key
