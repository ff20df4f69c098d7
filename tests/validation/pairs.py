"""Two right answers on the level scene with their coarser runs, shared by the tests of verdicts."""

from functools import cache

from cablefem import Scene
from validation.core.ladder import Ladder
from validation.core.refine import run_with_error_bars

LEVEL = Scene.load("level")
DAMPED = {"scheme": "generalized-alpha", "rho_inf": 0.8}
ELEMENTS = {"elements": 18, "steps": 1000, **DAMPED}
SINES = {"terms": 40, "steps": 1000, **DAMPED}


@cache
def right_answer_of_elements() -> Ladder:
    return run_with_error_bars(LEVEL, "following-p2", until=0.95, **ELEMENTS)


@cache
def right_answers() -> tuple[Ladder, Ladder]:
    """Return runs of the level scene, past its slack onset, with coarser ones."""
    return right_answer_of_elements(), run_with_error_bars(LEVEL, "fourier-kink", until=0.95, **SINES)
