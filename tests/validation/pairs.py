"""Two right answers on the level scene with their companions, coarse and shared by the tests of verdicts."""

from __future__ import annotations

import dataclasses
from functools import cache

from cablefem import Scene
from validation.core.estimate import Estimated, companions, past_slack
from validation.core.methods import METHODS

LEVEL = Scene.load("level")
ELEMENTS = {"elements": 18, "steps": 1000}
SINES = {"terms": 40, "steps": 1000}


@cache
def answer(name: str) -> Estimated:
    """Return an estimated run of the level scene, past its slack onset."""
    settings = ELEMENTS if name == "following-p2" else SINES
    return past_slack(LEVEL, METHODS[name], companions(LEVEL, METHODS[name], until=0.95, **settings))


def right() -> tuple[Estimated, Estimated]:
    return answer("following-p2"), answer("fourier-kink")


def altered(e: Estimated, change) -> Estimated:
    """Return an estimated run with one thing changed in all its responses: a fault of the method, not of a run."""
    runs = {name: change(getattr(e, name)) for name in ("response", "run", "in_space", "in_time")}
    return dataclasses.replace(e, **runs, late=None if e.late is None else change(e.late))
