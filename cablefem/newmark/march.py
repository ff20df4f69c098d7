"""Step after step through the phases of a run."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence

from cablefem.newmark.energy_rule import EnergyRule
from cablefem.newmark.failures import NewtonStalled, StepUnderflow
from cablefem.newmark.newmark_rule import NewmarkRule
from cablefem.newmark.newton import STANDARD, Newton
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Array, State, System

MOST_HALVINGS = 6  # 1/64 of a step: where that does not converge the equations themselves have lost their solution
MOST_CUTS = 100  # and half the steps: a run that has to cut more steps than that creeps


def integrate(
    system: System, method: Scheme, times: Sequence[Array], *, newton: Newton = STANDARD, work: Work | None = None,
    start: State | None = None,
) -> Iterator[State]:  # fmt: skip
    """Yield the states of a run, the first one included.

    times : per phase the instants to step on, its ends included (`step_times`).
    start : go on from this state, inside its phase (with another law, say), instead of from the beginning.

    Raises StepFailure; what was yielded before stays valid.  NaN never counts as converged.
    """
    work = Work() if work is None else work
    step = (EnergyRule if method.average else NewmarkRule)(system, method, newton, work)
    if start is None:
        state = system.start(0, None)
        yield state
    else:
        state = start
    for phase in range(state.phase, len(system.phases)):
        if phase > state.phase:
            state = system.start(phase, state)
        state = yield from _through(step, times[phase], state, work)


def _through(step: Stepper, grid: Array, state: State, work: Work) -> Generator[State, None, State]:
    """Yield a state for each instant of the grid that lies ahead; return the last one."""
    for t in grid[grid > state.t].tolist():
        whole, halvings = t - state.t, 0
        while state.t < t:
            piece = whole * 0.5**halvings
            t1 = state.t + piece if state.t + 1.001 * piece < t else t
            if not t1 > state.t:
                raise StepUnderflow(state.t, f"a step of {piece:.2g} is lost in rounding", "take fewer steps")
            try:
                state = step(state, t1)
                work.steps += 1
            except NewtonStalled:
                # a step may be too long for Newton's method: take it in pieces
                work.rejected += 1
                halvings += 1
                if halvings > MOST_HALVINGS or work.rejected > MOST_CUTS + grid.size // 2:
                    raise
        yield state
    return state
