"""Steps through the phases and events of a run."""

import itertools
import math
from collections.abc import Generator, Iterator, Sequence
from typing import Any

import numpy as np

from cablefem.newmark.collocation_rule import CollocationRule
from cablefem.newmark.events import apply_events, events_due, locate_first_event, shortest_step_above_rounding
from cablefem.newmark.failures import EndlessEvents, NewtonStalled, StepUnderflow
from cablefem.newmark.newmark_rule import NewmarkRule
from cablefem.newmark.newton import STANDARD, Newton
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.states import Array, State
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import System

# where `System.needs_damped_steps`: steps per step of the grid, and their damped rule (Rannacher 1984)
DAMPED_STEPS = 4
DAMPED = Scheme("damped", 0.5, 1.0)
MAX_HALVINGS = 6  # of a step
MAX_FAILED = 100  # steps, beyond half of the grid's number
MAX_EVENTS = 20  # without a step between them
MAX_EVENTS_OF_RUN = 200  # rides that come to an end have at most 20
MAX_STEPS = 256  # at once, on the grid
MAX_ADAPTIVE_STEPS = 32  # at once
MAX_GROWTH = 2.0  # longest over shortest of adaptive steps taken at once
SINGLE_STEPS = 16  # before many are tried again


def integrate(system: System, method: Scheme, times: Sequence[Array], **options: Any) -> Iterator[State]:
    """Yield the states of `integrate_blocks` one by one."""
    for states in integrate_blocks(system, method, times, **options):
        yield from states


def integrate_blocks(
    system: System, method: Scheme, times: Sequence[Array], *, newton: Newton = STANDARD, work: Work | None = None,
    start: State | None = None,
) -> Iterator[Sequence[State]]:  # fmt: skip
    """Yield the first state and those after all steps, in groups.

    times : per phase the instants to step on, ends included (`step_times_by_phase`).
    start : state to continue from, inside its phase; events due there happen first.
    Events are steps, too; the state before the change is yielded.

    Raises StepFailure; states yielded stay valid.
    """
    if work is None:
        work = Work()
    rule = CollocationRule if method.nodes else NewmarkRule
    step = rule(system, method, newton, work)
    damped = NewmarkRule(system, DAMPED, newton, work) if rule is NewmarkRule else None
    state = start
    if state is None:
        state = system.start(0, None)
        yield [state]
    else:
        state = apply_events(system, events_due(system, state), state, state.t, work)
    while state is not None:
        state = yield from _TimeIntegration(step, damped, state, work).integrate_phase(times[state.phase])
        if state is None or state.phase == len(system.phases) - 1:
            return
        state = system.start(state.phase + 1, state)


class _TimeIntegration:
    """The steps through one phase."""

    def __init__(self, step: Stepper, damped: Stepper | None, state: State, work: Work) -> None:
        self.system = step.system
        self.step = step
        self.damped = damped
        self.work = work
        self.state = state
        self.last_output = state.t
        self.last_event = state.t
        self.first_step = True  # of the phase or after an event
        self.single_steps = 1  # before many are tried
        self.damped_steps = 0
        self.halvings = 0
        self.events = 0  # since the last instant of the grid

    def integrate_phase(self, grid: Array) -> Generator[Sequence[State], None, State | None]:
        """Yield states to the end of the phase; return the last one, or None."""
        edges = [self.state.t, *grid[grid > self.state.t].tolist()]
        for i, (before, t) in enumerate(itertools.pairwise(edges)):
            self.halvings = 0
            self.events = 0
            while t - self.state.t > shortest_step_above_rounding(t):
                if (yield from self._try_many_steps(edges[i:])):
                    continue
                end = self._take_one_step(before, t, grid.size)
                if end is None:
                    continue
                x, names = end
                if x.t - self.last_output > shortest_step_above_rounding(x.t):
                    self.last_output = x.t
                    yield [x]
                after = self._apply_events_unless_endless(x, names)
                if after is None:
                    return None
                self.state = after
        return self.state

    def _try_many_steps(self, edges: list[float]) -> Generator[Sequence[State], None, bool]:
        """Take many steps if the system can; return whether any step was taken."""
        if not self.system.many_steps or self.single_steps or self.halvings or self.damped_steps:
            return False
        times = self._plan_adaptive_times(edges) if self.system.adaptive else edges[1 : 1 + MAX_STEPS]
        self.single_steps = SINGLE_STEPS
        if not times:
            return False
        for states in self.step.solve_steps(self.state, np.array(times)):
            x = states[-1]
            if not all(value > 0.0 for value in self.system.event_values(x)):
                break
            self.work.steps += len(states)
            self.state = x
            self.last_output = x.t
            self.first_step = False
            self.single_steps = int(x.t < times[-1])
            yield states
        return self.single_steps < SINGLE_STEPS

    def _take_one_step(self, grid_begin: float, grid_end: float, grid_size: int) -> tuple[State, list[str]] | None:
        """Take a step inside one of the grid; return its end and events, None to try half the length."""
        state = self.state
        system = self.system
        rule, t1 = self._choose_rule_and_end_time(grid_begin, grid_end)
        self.single_steps = max(0, self.single_steps - 1)
        system.begin_step(state)
        try:
            x = rule(state, t1)
            end = locate_first_event(system, rule, state, x) if system.events else (x, [])
        except NewtonStalled:
            self.work.rejected += 1
            self.halvings += 1
            if self.halvings > MAX_HALVINGS or self.work.rejected > MAX_FAILED + grid_size // 2:
                raise
            return None
        self.work.steps += 1
        self.damped_steps = max(0, self.damped_steps - 1)
        return end

    def _choose_rule_and_end_time(self, grid_begin: float, grid_end: float) -> tuple[Stepper, float]:
        """Rule and end of the next step; StepUnderflow where it is lost in rounding."""
        state = self.state
        length = grid_end - grid_begin
        if self.system.adaptive:
            length *= self.system.step_fraction(state, state.t - self.last_event)
        if self.first_step and self.damped is not None and self.system.needs_damped_steps(state, length):
            self.damped_steps = DAMPED_STEPS
        self.first_step = False
        rule = self.step
        length *= 0.5**self.halvings
        if self.damped_steps and self.damped is not None:
            rule = self.damped
            length /= DAMPED_STEPS
        t1 = _end_time_of_equal_step(state.t, grid_end, length)
        if not t1 > state.t:
            raise StepUnderflow(state.t, f"a step of {length:.2g} is lost in rounding", "take fewer steps")
        return rule, t1

    def _apply_events_unless_endless(self, x: State, names: list[str]) -> State | None:
        """The state after the events at x, None at the end of the run; EndlessEvents if they do not end."""
        if not names:
            self.events = 0
            return x
        self.events += len(names)
        if self.events > MAX_EVENTS:
            raise EndlessEvents(
                x.t, f"more than {MAX_EVENTS} events without a step between them, at last {names[-1]!r}",
                "what changes at the event does not keep it from happening again at once",
            )  # fmt: skip
        if len(self.work.events) > MAX_EVENTS_OF_RUN:
            raise EndlessEvents(
                x.t, f"more than {MAX_EVENTS_OF_RUN} events, at last {names[-1]!r}", "let the ride end before that",
            )  # fmt: skip
        self.last_event = x.t
        self.single_steps = 1
        self.first_step = True
        return apply_events(self.system, names, x, self.last_output, self.work)

    def _plan_adaptive_times(self, edges: list[float]) -> list[float]:
        """Ends of the next steps, by the present velocity; few, and of similar length."""
        x = self.state
        now = x.t
        longest = math.inf
        ends = list[float]()
        for before, t in itertools.pairwise(edges):
            while t - now > shortest_step_above_rounding(t):
                fraction = self.system.step_fraction(x, now - self.last_event, now - x.t)
                t1 = _end_time_of_equal_step(now, t, (t - before) * fraction)
                fits = shortest_step_above_rounding(t1) < t1 - now <= longest
                if not fits or len(ends) == MAX_ADAPTIVE_STEPS:
                    return ends
                ends.append(t1)
                longest = min(longest, MAX_GROWTH * (t1 - now))
                now = t1
        return ends


def _end_time_of_equal_step(t0: float, t_end: float, max_length: float) -> float:
    """The end of the first of equal steps from t0 to t_end, each at most `max_length`."""
    if not max_length > 0.0:
        return t0
    count = math.ceil((t_end - t0) / max_length - 1e-3)
    return t0 + (t_end - t0) / count if count > 1 else t_end
