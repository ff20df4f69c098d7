"""Step after step through the phases and past the events of a run."""

from __future__ import annotations

import itertools
import math
from collections.abc import Generator, Iterator, Sequence
from typing import Any

import numpy as np

from cablefem.newmark.collocation_rule import CollocationRule
from cablefem.newmark.energy_rule import EnergyRule
from cablefem.newmark.events import Watched, first_event, pass_events, rounding
from cablefem.newmark.failures import EndlessEvents, NewtonStalled, StepUnderflow
from cablefem.newmark.newmark_rule import NewmarkRule
from cablefem.newmark.newton import STANDARD, Newton
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Abrupt, Array, Prepared, Ringing, State, System

# Where an unresolved jump has left an acceleration that soon is gone, steps of Newmark's family start anew with that
# many pieces of the rule that does not use it, beta = 1/2 and gamma = 1; so few of first order leave the second one
# intact (Rannacher 1984; Luskin & Rannacher 1982).
GENTLE, GENTLY = 4, Scheme("gentle", 0.5, 1.0)
MOST_HALVINGS = 6  # 1/64 of a step: where that does not converge the equations themselves have lost their solution
MOST_CUTS = 100  # and half the steps: a run that has to cut more steps than that creeps
# most steps in one go, and where they have to be foreseen; how many alone after the first of them would not do
STRIDE, AHEAD, ALONE = 256, 32, 16
# Times the shortest of them: longer ones are foreseen anew, as the velocity that they follow has changed by then.  With
# an undamped rule steps that jump where foresight ends leave twice the ringing of those that grow evenly.
GROWN = 2.0
MOST_EVENTS = 20  # without a whole step between them: more is an event that happens again as soon as it is passed


def integrate(system: System, method: Scheme, times: Sequence[Array], **kind: Any) -> Iterator[State]:
    """Yield the states of a run one by one, see `stretches`."""
    for states in stretches(system, method, times, **kind):
        yield from states


def stretches(
    system: System, method: Scheme, times: Sequence[Array], *, newton: Newton = STANDARD, work: Work | None = None,
    start: State | None = None,
) -> Iterator[Sequence[State]]:  # fmt: skip
    """Yield the states of a run, the first one included, some by some as steps are taken.

    times : per phase the instants to step on, its ends included (`step_times`).
    start : go on from this state, inside its phase (with another law, say), instead of from the beginning; events that
        are due there happen first.
    Events (`events.Watched`) are landed on besides, their states yielded as they are before the change, and noted in
    `work.events`; the last one may end the run.

    Raises StepFailure; what was yielded before stays valid.  NaN never counts as converged.
    """
    work = Work() if work is None else work
    rule = CollocationRule if method.nodes else EnergyRule if method.average else NewmarkRule
    step = rule(system, method, newton, work)
    if start is None:
        state = system.start(0, None)
        yield [state]
    else:
        state = start
        # who stops at an event's state has not seen the change
        if isinstance(system, Watched) and system.events:
            due = [name for name, value in zip(system.events, system.watch(state), strict=True) if value <= 0.0]
            after = pass_events(system, due, state, state.t, work)
            if after is None:
                return
            state = after
    for phase in range(state.phase, len(system.phases)):
        if phase > state.phase:
            state = system.start(phase, state)
        gentle = (
            NewmarkRule(system, GENTLY, newton, work) if rule is NewmarkRule and isinstance(system, Abrupt) else None
        )
        after = yield from _through(step, gentle, times[phase], state, work)
        if after is None:
            return
        state = after


def _through(
    step: Stepper, gentle: Stepper | None, grid: Array, state: State, work: Work
) -> Generator[Sequence[State], None, State | None]:
    """Yield a state for each instant of the grid that lies ahead, and for each event; return the one to go on from."""
    fresh, pieces = True, 0  # whether a jump was just passed, and what is left of a gentle start
    watched = step.system if isinstance(step.system, Watched) and step.system.events else None
    prepared = step.system if isinstance(step.system, Prepared) else None
    ringing = step.system if isinstance(step.system, Ringing) else None
    shown = jumped = state.t  # of the last state yielded, of the last event
    edges = [state.t, *grid[grid > state.t].tolist()]
    alone = 1  # steps to take one by one: the first leaves what others go on from
    for i, t in enumerate(edges[1:]):
        whole, halvings, passed = t - edges[i], 0, 0
        while t - state.t > rounding(t):
            if alone == halvings == pieces == 0 and step.strides:
                ahead = edges[i + 1 : i + 1 + STRIDE] if ringing is None else _pieces(ringing, state, jumped, edges[i:])
                alone = ALONE
                for states in step.stride(state, np.array(ahead)) if ahead else ():
                    x = states[-1]
                    if watched is not None and not min(watched.watch(x)) > 0.0:
                        break
                    work.steps += len(states)
                    state, alone, shown = x, int(x.t < ahead[-1]), x.t
                    yield states
                if alone < ALONE:
                    fresh = False
                    continue
            alone = max(0, alone - 1)
            piece = whole if ringing is None else whole * ringing.part(state, state.t - jumped)
            if fresh and gentle is not None and isinstance(step.system, Abrupt) and step.system.abrupt(state, piece):
                pieces = GENTLE
            fresh = False
            piece *= 0.5**halvings / (GENTLE if pieces else 1)
            rule = gentle if pieces and gentle is not None else step
            t1 = _piece(state.t, t, piece)
            if not t1 > state.t:
                raise StepUnderflow(state.t, f"a step of {piece:.2g} is lost in rounding", "take fewer steps")
            names: list[str] = []
            if prepared is not None:
                prepared.begin_step(state)
            try:
                x = rule(state, t1)
                if watched is not None:
                    x, names = first_event(watched, rule, state, x)
            except NewtonStalled:
                # a step may be too long for Newton's method: take it in pieces
                work.rejected += 1
                halvings += 1
                if halvings > MOST_HALVINGS or work.rejected > MOST_CUTS + grid.size // 2:
                    raise
                continue
            work.steps += 1
            pieces, fresh = max(0, pieces - 1), bool(names)
            if names:
                jumped, alone = x.t, 1
            if (names or ringing is not None or x.t == t) and x.t - shown > rounding(x.t):
                shown = x.t
                yield [x]
            passed = passed + len(names) if names else 0
            if passed > MOST_EVENTS:
                raise EndlessEvents(
                    x.t, f"more than {MOST_EVENTS} events without a step between them, at last {names[-1]!r}"
                )
            after = x if watched is None else pass_events(watched, names, x, shown, work)
            if after is None:
                return None
            state = after
    return state


def _piece(t0: float, t: float, piece: float) -> float:
    """Return the end of the next of equal pieces up to t: a short last one would leave a meaningless acceleration."""
    count = math.ceil((t - t0) / piece - 1e-3) if piece > 0.0 else math.inf
    return t0 + (t - t0) / count if count > 1 else t


def _pieces(ringing: Ringing, x: State, jumped: float, edges: list[float]) -> list[float]:
    """Return the ends of the next few steps, as they come if x goes on at its velocity; edges : of the grid."""
    now, most, ends = x.t, math.inf, list[float]()
    for before, t in itertools.pairwise(edges):
        while t - now > rounding(t):
            t1 = _piece(now, t, (t - before) * ringing.part(x, now - jumped, now - x.t))
            if not t1 > now or len(ends) == AHEAD or t1 - now > most:
                return ends
            ends.append(t1)
            now, most = t1, min(most, GROWN * (t1 - now))
    return ends
