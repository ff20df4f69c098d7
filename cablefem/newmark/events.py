"""Events: a value of the system falls to zero inside a step, and the system goes on as another one."""

import math
from typing import Protocol, runtime_checkable

import numpy as np

from cablefem.newmark.failures import StepFailure
from cablefem.newmark.stepper import Passed, Stepper, Work
from cablefem.newmark.system import State


@runtime_checkable
class Watched(Protocol):
    """What a system with events answers besides; a system without these members has none.

    An event happens where its value goes from > 0 at the beginning of a step to <= 0 at its end; the state where it
    first is <= 0, to rounding of t, is the event's.  `inf` at the beginning means not armed, and so does <= 0: an event
    that may come again within the step needs a state in which its value is positive, if only by rounding.  A value that
    falls and rises again inside a step goes unseen.
    """

    @property
    def events(self) -> tuple[str, ...]: ...

    def watch(self, x: State) -> tuple[float, ...]:
        """Return one value per event."""

    def pass_event(self, name: str, x: State) -> State | None:
        """Change over to what holds after the event; return a consistent state to go on from, None to end the run.

        Events at the same instant are passed one after another, as long as their value stays <= 0.
        """


@runtime_checkable
class Heeding(Protocol):
    """A watched system that looks for events by itself in steps it takes in one go."""

    @property
    def heeded(self) -> float:
        """Until when it has looked and found none."""


def pass_events(system: Watched, names: list[str], x: State, t: float, work: Work) -> State | None:
    """Let the system change over, event by event, noted at t; return the state to go on from, None for the end."""
    for name in names:
        if name is not names[0] and not system.watch(x)[system.events.index(name)] <= 0.0:
            continue
        work.events.append(Passed(name, t))
        after = system.pass_event(name, x)
        if after is None:
            return None
        x = after
    return x


EPS = float(np.finfo(float).eps)


def rounding(t: float) -> float:
    """Length of a step that rounding of t does not resolve."""
    return 16.0 * EPS * abs(t)


def first_event(system: Watched, step: Stepper, x0: State, x1: State) -> tuple[State, list[str]]:
    """Return the state of the first event between x0 and x1, with the names of all that happen there; (x1, []) if none.

    Each trial is a step from x0.
    """

    def values(x: State) -> tuple[float, ...]:
        found = system.watch(x)
        for name, value in zip(system.events, found, strict=True):
            if math.isnan(value):
                raise StepFailure(x.t, f"event {name!r} has no value", "take more steps")
        return found

    before, after, end = values(x0), values(x1), x1
    fallen = [i for i, value in enumerate(after) if 0.0 < before[i] < math.inf and value <= 0.0]
    if fallen:
        from scipy.optimize import brentq  # not for runs without events: it takes longer to load than many a run

    for i in fallen:
        last = end

        def value(t: float, i: int = i, last: State = last) -> float:
            nonlocal end
            if t <= x0.t:
                return before[i]
            x = last if t >= last.t else step(x0, t)
            found = values(x)[i]
            if found <= 0.0 and x.t <= end.t:
                end = x
            return found

        if values(end)[i] <= 0.0:  # not later than the events located so far
            brentq(value, x0.t, last.t, xtol=rounding(last.t) / 4.0, rtol=4.0 * EPS, disp=False)
    at_end = values(end) if fallen else after
    names = [system.events[i] for i in fallen if at_end[i] <= 0.0]
    return end, names
