"""What a system defines, and defaults for the rest."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from cablefem.newmark.collocation import Factors, collocate_first_step
from cablefem.newmark.newton import Newton, StepResult, find_root
from cablefem.newmark.states import Array, State, States, Steps
from cablefem.newmark.tableau import Tableau

Solve = Callable[[Array], Array]
TangentFactors = tuple[complex, complex, complex]  # c0, c1, c2 of c0 dr/dq + c1 dr/dv + c2 dr/da
ACCELERATION_ONLY: TangentFactors = (0.0, 0.0, 1.0)  # dr/da


class ManySteps(NamedTuple):
    """What `System.solve_steps` took; the results may end with that of a step that failed."""

    ends: Array  # (k, 3, n_dof) rows q, v, a
    results: Array  # (k or k + 1, 4 or more) norm, iterations, factorisations, residuals as in `StepResult`


NO_STEPS = ManySteps(np.empty((0, 3, 0)), np.empty((0, 4)))


class System(Protocol):
    """A system r(t, q, v, a) = 0, v = dq/dt, a = dv/dt, linear in a.

    A subclass sets the first four attributes and defines `start`, `residual` and `linearise`.
    """

    n_dof: int
    phases: tuple[tuple[float, float], ...]  # consecutive [t0, t1]
    force_scale: float
    force_floor: float
    events: tuple[str, ...] = ()
    many_steps: bool = False  # whether `solve_steps` or `collocate_steps` takes several
    slack_ends: bool = True  # whether several steps may end at a slack state only
    reuses_factors: bool = False  # whether collocation steps try the tangent of a step before
    factors: Factors | None = None  # of that step; its solutions stay valid
    events_from: float = -math.inf  # events are looked for after this time
    adaptive: bool = False  # `step_fraction` shortens steps
    at_support: bool = False  # `start` begins at the left support only

    def start(self, phase: int, state: State | None) -> State:
        """A consistent state at the beginning of `phase`; state : at the end of the phase before, None at the start."""
        raise NotImplementedError

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        raise NotImplementedError

    def residuals(self, t: Array, q: Array, v: Array, a: Array, phase: int) -> Array:
        """`residual` at n instants: t (n,), the others (n, n_dof)."""
        return np.array([self.residual(*x, phase) for x in zip(t.tolist(), q, v, a, strict=True)])

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        """r, and a function that applies (c0 dr/dq + c1 dr/dv + c2 dr/da)^-1, c = c0, c1, c2, until the next call.

        It may overwrite its argument.
        """
        raise NotImplementedError

    def factorised_tangents(
        self, t: float, q: Array, v: Array, a: Array, phase: int, cs: Sequence[TangentFactors]
    ) -> list[Solve]:
        """The second of `linearise` for each of several factors."""
        return [self.linearise(t, q, v, a, phase, c)[1] for c in cs]

    # --- steps -----------------------------------------------------------------------------------------
    def solve_step(self, t: float, phase: int, start: Array, end_out: Array, rule: Array, newton: Newton) -> StepResult:
        """Take one step of Newmark's family into `end_out`.

        start, end_out : (3, n_dof) rows q, v, a; `end_out` is overwritten with the end of the step.
        rule : (3, 5) predictor (3, 3), corrector c, balance w: end_out = predictor start - c da with
            |r(t, w end_out + (1 - w) start)| <= newton.bound.
        """
        return take_newmark_step(self, t, phase, start, end_out, rule, newton)

    def solve_steps(self, t: Array, phase: int, start: Array, rules: Array, newton: Newton) -> ManySteps:
        """Take many steps, up to one that fails or may hold an event.

        t, rules : (m,) and (m, 3, 5), see `solve_step`.
        """
        return NO_STEPS

    def collocate_steps(self, phase: int, steps: Steps, rule: Tableau, newton: Newton) -> Iterator[StepResult]:
        """Take collocation steps, at least the first."""
        return collocate_first_step(self, phase, steps, rule, newton)

    # --- the length of steps -----------------------------------------------------------------------------
    def balance_times(self, t0: Array, t1: Array, end_weight: float, phase: int) -> Array:
        """Times (n,) of the balance: means of t0 and t1, weighted 1 - end_weight and end_weight."""
        return (1.0 - end_weight) * t0 + end_weight * t1

    def step_fraction(self, x: State, since_event: float, time_ahead: float = 0.0) -> float:
        """The fraction of a grid step to take from x.

        since_event : time after the last event;  time_ahead : of the step after x, for steps planned at once.
        """
        return 1.0

    def needs_damped_steps(self, x: State, dt: float) -> bool:
        """Whether a jump of force makes x.a valid for less than a step dt; damped steps follow."""
        return False

    def states_over_time(self, states: States) -> States:
        """The states as functions of time, where the system's own variable may be s_o."""
        return states

    # --- events ------------------------------------------------------------------------------------------
    def begin_step(self, x: State) -> None:
        """Called before each single step; a system may set what it keeps constant in the step."""
        return None

    def event_values(self, x: State) -> tuple[float, ...]:
        """One value per event, which happens where it falls from > 0 to <= 0; inf: not armed."""
        return ()

    def apply_event(self, name: str, x: State) -> State | None:
        """A consistent state after the event, None to end the run."""
        return x


def take_newmark_step(
    system: System, t: float, phase: int, start: Array, end_out: Array, rule: Array, newton: Newton
) -> StepResult:
    """Take one step of Newmark's family by `residual` and `linearise`, see `System.solve_step`."""
    c = rule[:, 3:4]
    w = rule[:, 4:5]
    c0, c1, c2 = (w * c)[:, 0].tolist()
    from_start = (1.0 - w) * start
    end_out[:] = rule[:, :3] @ start

    def residual() -> Array:
        q, v, a = w * end_out + from_start
        return system.residual(t, q, v, a, phase)

    def linearise() -> tuple[Array, Solve]:
        q, v, a = w * end_out + from_start
        return system.linearise(t, q, v, a, phase, (c0, c1, c2))

    def subtract(da: Array) -> None:
        np.subtract(end_out, c * da, out=end_out)

    with np.errstate(over="ignore", invalid="ignore"):
        return find_root(residual, linearise, subtract, newton)


def consistent_acceleration(system: System, t: float, q: Array, v: Array, phase: int) -> State:
    """The state whose a solves r(t, q, v, a) = 0."""
    r, solve = system.linearise(t, q, v, np.zeros(system.n_dof), phase, ACCELERATION_ONLY)
    return State(t, q, v, -solve(r.copy()), phase)
