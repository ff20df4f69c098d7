import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from cablefem.newmark.failures import NewtonStalled
from cablefem.newmark.newton import Newton, StepResult
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.states import Array, State
from cablefem.newmark.system import System


class PassedEvent(NamedTuple):
    """An event; a state with its t has been yielded."""

    name: str
    t: float


@dataclass(slots=True)
class Work:
    """Counts of a run, and its events."""

    steps: int = 0
    rejected: int = 0
    newton_iterations: int = 0
    factorisations: int = 0
    residuals: int = 0
    events: list[PassedEvent] = field(default_factory=list)
    after_event: State | None = None  # that after the last one; None at the end of the run


class Stepper:
    """Rule of a step: `stepper(x, t1)` returns the state at t1 after a step from x."""

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        self.system = system
        self.method = method
        self.work = work
        self.bound = newton.tol * system.force_scale + math.sqrt(system.n_dof) * system.force_floor
        self.newton = newton._replace(bound=self.bound)

    def __call__(self, x: State, t1: float) -> State:
        raise NotImplementedError

    def solve_steps(self, x: State, times: Array) -> Iterator[Sequence[State]]:
        """Yield states at the times as far as the system can take many steps; an event may end a group."""
        return iter(())

    def has_converged(self, result: StepResult) -> bool:
        return result.norm <= self.bound

    def count_work(self, iterations: int, factorisations: int, residuals: int) -> None:
        self.work.newton_iterations += iterations
        self.work.factorisations += factorisations
        self.work.residuals += residuals

    def count_result(self, result: StepResult) -> None:
        self.count_work(int(result.iterations), int(result.factorisations), int(result.residuals))

    def newton_stalled_error(self, t1: float, result: StepResult) -> NewtonStalled:
        return NewtonStalled(
            t1, f"Newton's method stalled (|r| = {result.norm:.2g}, allowed {self.bound:.2g})",
            "take more steps or a damped scheme (newmark, generalized-alpha)",
        )  # fmt: skip
