"""Two right answers on the level scene with their coarser runs, shared by the tests of verdicts."""

from functools import cache

from cablefem import Scene
from validation.core.climb import laddered
from validation.core.ladder import Ladder

LEVEL = Scene.load("level")
DAMPED = {"scheme": "generalized-alpha", "rho_inf": 0.8}
ELEMENTS = {"elements": 18, "steps": 1000, **DAMPED}
SINES = {"terms": 40, "steps": 1000, **DAMPED}


@cache
def answer(name: str) -> Ladder:
    """Return a run of the level scene, past its slack onset, with coarser ones."""
    return laddered(LEVEL, name, until=0.95, **(ELEMENTS if name == "following-p2" else SINES))


def right() -> tuple[Ladder, Ladder]:
    return answer("following-p2"), answer("fourier-kink")
