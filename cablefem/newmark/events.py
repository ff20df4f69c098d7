"""Events: a value falls to zero inside a step."""

import math

import numpy as np

from cablefem.newmark.failures import StepFailure
from cablefem.newmark.states import State
from cablefem.newmark.stepper import Passed, Stepper, Work
from cablefem.newmark.system import System

EPS = float(np.finfo(float).eps)


def rounding(t: float) -> float:
    """Least length of a step."""
    return 16.0 * EPS * abs(t)


def events_due(system: System, x: State) -> list[str]:
    return [name for name, value in zip(system.events, system.watch(x), strict=True) if value <= 0.0]


def pass_events(system: System, names: list[str], x: State, t: float, work: Work) -> State | None:
    """Let events happen, noted at t; return the state after them or None."""
    for name in names:
        if name is not names[0] and name not in events_due(system, x):
            continue
        work.events.append(Passed(name, t))
        after = system.pass_event(name, x)
        if after is None:
            return None
        x = after
    return x


def first_event(system: System, step: Stepper, x0: State, x1: State) -> tuple[State, list[str]]:
    """The first event in a step with all names due there; (x1, []) if none."""

    def values(x: State) -> tuple[float, ...]:
        found = system.watch(x)
        for name, value in zip(system.events, found, strict=True):
            if math.isnan(value):
                raise StepFailure(x.t, f"event {name!r} has no value", "take more steps")
        return found

    before = values(x0)
    end = x1
    at_end = values(x1)
    fallen = list[int]()

    def falls() -> list[int]:
        return [i for i, value in enumerate(at_end) if 0.0 < before[i] < math.inf and value <= 0.0]

    def least(t: float) -> float:
        nonlocal end, at_end
        x = x0 if t <= x0.t else end if t >= end.t else step(x0, t)
        found = before if x is x0 else at_end if x is end else values(x)  # once each: rounding may turn a sign
        lowest = min(found[i] for i in fallen)
        if lowest <= 0.0 and x.t <= end.t:
            end = x
            at_end = found
        return lowest

    while set(falls()) - set(fallen):  # at the first event others may show that are gone at the end of the step
        from scipy.optimize import brentq  # slow to load

        fallen = falls()
        brentq(least, x0.t, end.t, xtol=rounding(x1.t) / 4.0, rtol=4.0 * EPS, disp=False)
    return end, [system.events[i] for i in fallen if at_end[i] <= 0.0]
