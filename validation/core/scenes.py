"""Scenes drawn at random, over the range in which the solvers are meant to work."""

import math
from typing import Any

import numpy as np

from cablefem.scene import Scene, SceneError

LOGARITHMIC = {"sag_ratio": (0.005, 0.2), "mu": (0.05, 5.0), "alpha": (50.0, 1e4)}
UNIFORM = {"slope": (0.0, 45.0), "speed_ratio": (0.1, 0.8)}


def logarithmic(rng: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def random_groups(rng: np.random.Generator) -> dict[str, Any]:
    """Return what `Scene.from_groups` takes; it may refuse the combination."""
    ratios = {name: logarithmic(rng, *between) for name, between in LOGARITHMIC.items()}
    return ratios | {name: float(rng.uniform(*between)) for name, between in UNIFORM.items()}


def random_scene(rng: np.random.Generator, **more: Any) -> Scene:
    """Return a scene; refused combinations (stretched to twice the length by its own weight) are drawn again."""
    while True:
        try:
            return Scene.from_groups(**random_groups(rng), **more)
        except SceneError:
            continue
