"""Events: a value falls to zero inside a step."""

import math

import numpy as np

from cablefem.newmark.failures import StepFailure
from cablefem.newmark.states import State
from cablefem.newmark.stepper import PassedEvent, Stepper, Work
from cablefem.newmark.system import System

EPS = float(np.finfo(float).eps)


def shortest_step_above_rounding(t: float) -> float:
    """Shortest step at t."""
    return 16.0 * EPS * abs(t)


def events_due(system: System, x: State) -> list[str]:
    """Names of the events that happen at a state."""
    return [name for name, value in zip(system.events, system.event_values(x), strict=True) if value <= 0.0]


def apply_events(system: System, names: list[str], x: State, t_noted: float, work: Work) -> State | None:
    """Let events happen and note them in `work` at a time; return the state after them, None at the end of the run."""
    for name in names:
        if name is not names[0] and name not in events_due(system, x):
            continue
        work.events.append(PassedEvent(name, t_noted))
        work.after_event = after = system.apply_event(name, x)
        if after is None:
            return None
        x = after
    return x


def locate_first_event(system: System, step: Stepper, x0: State, x1: State) -> tuple[State, list[str]]:
    """The state at the first event in a step, and the names of all events there; (x1, []) if there is none."""

    def checked_values(x: State) -> tuple[float, ...]:
        values = system.event_values(x)
        for name, value in zip(system.events, values, strict=True):
            if math.isnan(value):
                raise StepFailure(x.t, f"event {name!r} has no value", "take more steps")
        return values

    before = checked_values(x0)
    evaluated = {x0.t: (x0, before), x1.t: (x1, checked_values(x1))}  # once each: rounding may turn a sign
    end = x1.t
    crossing = list[int]()

    def newly_due() -> list[int]:
        at_end = evaluated[end][1]
        return [i for i, value in enumerate(at_end) if 0.0 < before[i] < math.inf and value <= 0.0]

    def min_event_value(t: float) -> float:
        if t not in evaluated:
            x = step(x0, t)
            evaluated[t] = x, checked_values(x)
        return min(evaluated[t][1][i] for i in crossing)

    # at the first event others may be due that have risen again at the end of the step
    while not set(newly_due()) <= set(crossing):
        from scipy.optimize import brentq  # slow to load

        crossing = newly_due()
        brentq(min_event_value, x0.t, end, xtol=shortest_step_above_rounding(x1.t) / 4.0, rtol=4.0 * EPS, disp=False)
        end = min(t for t in evaluated if min_event_value(t) <= 0.0)
    state, at_end = evaluated[end]
    return state, [system.events[i] for i in crossing if at_end[i] <= 0.0]
