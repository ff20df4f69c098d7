"""Steps through the phases and events of a run."""

import itertools
import math
from collections.abc import Generator, Iterator, Sequence
from typing import Any

import numpy as np

from cablefem.newmark.collocation_rule import CollocationRule
from cablefem.newmark.events import events_due, first_event, pass_events, rounding
from cablefem.newmark.failures import EndlessEvents, NewtonStalled, StepUnderflow
from cablefem.newmark.newmark_rule import NewmarkRule
from cablefem.newmark.newton import STANDARD, Newton
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.states import Array, State
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import System

# pieces of a step from an abrupt acceleration, and their damped rule (Rannacher 1984)
GENTLE = 4
GENTLY = Scheme("gentle", 0.5, 1.0)
MOST_HALVINGS = 6  # of a step
MOST_CUTS = 100  # failed steps beyond half of the grid's number
MOST_EVENTS = 20  # without a step between them
# longest many_steps, of the grid and adaptive
MAX_STEPS = 256
MAX_ADAPTIVE_STEPS = 32
SINGLE_STEPS = 16  # single steps after a failed solve_steps
MAX_GROWTH = 2.0  # longest over shortest step of a solve_steps


def integrate(system: System, method: Scheme, times: Sequence[Array], **kind: Any) -> Iterator[State]:
    for states in integrate_blocks(system, method, times, **kind):
        yield from states


def integrate_blocks(
    system: System, method: Scheme, times: Sequence[Array], *, newton: Newton = STANDARD, work: Work | None = None,
    start: State | None = None,
) -> Iterator[Sequence[State]]:  # fmt: skip
    """Yield the first state and those after all steps, in groups.

    times : per phase the instants to step on, ends included (`step_times`).
    start : state to go on from, inside its phase; events due there happen first.
    Events are steps, too; the state before the change is yielded.

    Raises StepFailure; states yielded stay valid.
    """
    work = Work() if work is None else work
    rule = CollocationRule if method.nodes else NewmarkRule
    step = rule(system, method, newton, work)
    gentle = NewmarkRule(system, GENTLY, newton, work) if rule is NewmarkRule else None
    state = start
    if state is None:
        state = system.start(0, None)
        yield [state]
    else:
        state = pass_events(system, events_due(system, state), state, state.t, work)
    while state is not None:
        state = yield from _March(step, gentle, state, work).through(times[state.phase])
        if state is None or state.phase == len(system.phases) - 1:
            return
        state = system.start(state.phase + 1, state)


class _March:
    def __init__(self, step: Stepper, gentle: Stepper | None, state: State, work: Work) -> None:
        self.system = step.system
        self.step = step
        self.gentle = gentle
        self.work = work
        self.state = state
        self.shown = self.jumped = state.t  # times of the last output, last event
        self.fresh = True
        self.alone = 1  # single steps before a solve_steps
        self.pieces = 0
        self.halvings = 0
        self.crowd = 0

    def through(self, grid: Array) -> Generator[Sequence[State], None, State | None]:
        """Yield states to the end of the phase; return the last one, or None."""
        edges = [self.state.t, *grid[grid > self.state.t].tolist()]
        for i, (before, t) in enumerate(itertools.pairwise(edges)):
            self.halvings = self.crowd = 0
            while t - self.state.t > rounding(t):
                if (yield from self._many(edges[i:])):
                    continue
                found = self._one(before, t, grid.size)
                if found is None:
                    continue
                x, names = found
                if x.t - self.shown > rounding(x.t):
                    self.shown = x.t
                    yield [x]
                after = self._pass(x, names)
                if after is None:
                    return None
                self.state = after
        return self.state

    def _many(self, edges: list[float]) -> Generator[Sequence[State], None, bool]:
        """Take a solve_steps if the system can; return whether any step was taken."""
        if not self.system.many_steps or self.alone or self.halvings or self.pieces:
            return False
        ahead = self._pieces(edges) if self.system.adaptive else edges[1 : 1 + MAX_STEPS]
        self.alone = SINGLE_STEPS
        for states in self.step.solve_steps(self.state, np.array(ahead)) if ahead else ():
            x = states[-1]
            if not all(value > 0.0 for value in self.system.watch(x)):
                break
            self.work.steps += len(states)
            self.state = x
            self.shown = x.t
            self.fresh = False
            self.alone = int(x.t < ahead[-1])
            yield states
        return self.alone < SINGLE_STEPS

    def _one(self, before: float, t: float, size: int) -> tuple[State, list[str]] | None:
        """Take a step towards t; return its end and events, None to try half the length."""
        state = self.state
        system = self.system
        length = t - before
        if system.adaptive:
            length *= system.step_fraction(state, state.t - self.jumped)
        if self.fresh and self.gentle is not None and system.abrupt(state, length):
            self.pieces = GENTLE
        self.fresh = False
        rule = self.gentle if self.pieces and self.gentle is not None else self.step
        length *= 0.5**self.halvings / (GENTLE if self.pieces else 1)
        t1 = _piece(state.t, t, length)
        if not t1 > state.t:
            raise StepUnderflow(state.t, f"a step of {length:.2g} is lost in rounding", "take fewer steps")
        self.alone = max(0, self.alone - 1)
        system.begin_step(state)
        try:
            x = rule(state, t1)
            found = first_event(system, rule, state, x) if system.events else (x, [])
        except NewtonStalled:
            self.work.rejected += 1
            self.halvings += 1
            if self.halvings > MOST_HALVINGS or self.work.rejected > MOST_CUTS + size // 2:
                raise
            return None
        self.work.steps += 1
        self.pieces = max(0, self.pieces - 1)
        return found

    def _pass(self, x: State, names: list[str]) -> State | None:
        self.crowd = self.crowd + len(names) if names else 0
        if not names:
            return x
        if self.crowd > MOST_EVENTS:
            raise EndlessEvents(
                x.t, f"more than {MOST_EVENTS} events without a step between them, at last {names[-1]!r}",
                "what changes at the event does not keep it from happening again at once",
            )  # fmt: skip
        self.jumped = x.t
        self.alone = 1
        self.fresh = True
        return pass_events(self.system, names, x, self.shown, self.work)

    def _pieces(self, edges: list[float]) -> list[float]:
        x = self.state
        now = self.state.t
        most = math.inf
        ends = list[float]()
        for before, t in itertools.pairwise(edges):
            while t - now > rounding(t):
                t1 = _piece(now, t, (t - before) * self.system.step_fraction(x, now - self.jumped, now - x.t))
                if not t1 > now or len(ends) == MAX_ADAPTIVE_STEPS or t1 - now > most:
                    return ends
                ends.append(t1)
                now, most = t1, min(most, MAX_GROWTH * (t1 - now))
        return ends


def _piece(t0: float, t: float, piece: float) -> float:
    count = math.ceil((t - t0) / piece - 1e-3) if piece > 0.0 else math.inf
    return t0 + (t - t0) / count if count > 1 else t
