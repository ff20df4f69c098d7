"""What a system defines, and defaults for the rest."""

import math
from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np

from cablefem.newmark.collocation import collocate
from cablefem.newmark.newton import Newton, StepResult, find_root
from cablefem.newmark.states import Array, State, Steps
from cablefem.newmark.tableau import Tableau

Solve = Callable[[Array], Array]
NO_STEPS = np.empty((0, 3, 0)), np.empty((0, 4))


class System(Protocol):
    """A system r(t, q, v, a) = 0, v = dq/dt, a = dv/dt, linear in a.

    A subclass sets the first four attributes and defines `start`, `residual` and `linearise`.
    """

    n_dof: int
    phases: tuple[tuple[float, float], ...]  # consecutive [t0, t1]
    force_scale: float
    force_floor: float
    events: tuple[str, ...] = ()
    many_steps: bool = False  # many steps at once
    events_from: float = -math.inf  # no event up to this time
    adaptive: bool = False  # `step_fraction` shortens steps
    at_support: bool = False  # `start` begins at the support only

    def start(self, phase: int, state: State | None) -> State:
        """A consistent state at the beginning of `phase`; state=None: of the run."""
        raise NotImplementedError

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        raise NotImplementedError

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> tuple[Array, Solve]:
        """r, and a function that applies (c0 dr/dq + c1 dr/dv + c2 dr/da)^-1 until the next call.

        It may overwrite its argument.
        """
        raise NotImplementedError

    # --- steps -----------------------------------------------------------------------------------------
    def solve_step(self, t: float, phase: int, start: Array, now: Array, rule: Array, newton: Newton) -> StepResult:
        """Take a step of Newmark's family.

        start, now : (3, n_dof) rows q, v, a; `now` is set.
        rule : (3, 5) predictor (3, 3), corrector c, balance w: now = predictor start - c da with
            |r(t, w now + (1 - w) start)| <= newton.bound.
        """
        return iterate(self, t, phase, start, now, rule, newton)

    def solve_steps(self, t: Array, phase: int, start: Array, rules: Array, newton: Newton) -> tuple[Array, Array]:
        """Ends (k, 3, n_dof) of steps, and the fields of `StepResult` of each.

        t, rules : (m,) and (m, 3, 5), see `solve_step`.
        Stops before a step that fails or may hold an event; `StepResult` of a failed step may follow.
        """
        return NO_STEPS

    def collocate(self, phase: int, steps: Steps, rule: Tableau, newton: Newton) -> Iterator[StepResult]:
        """Take collocation steps, at least the first."""
        return collocate(self, phase, steps, rule, newton)

    # --- the length of steps -----------------------------------------------------------------------------
    def between(self, t0: Array, t1: Array, w: float, phase: int) -> Array:
        """Times (n,) of the mean places, weighted 1 - w and w."""
        return (1.0 - w) * t0 + w * t1

    def step_fraction(self, x: State, since: float, ahead: float = 0.0) -> float:
        """The fraction of a grid step to take from x, or `ahead` of it, `since` after an event."""
        return 1.0

    def abrupt(self, x: State, dt: float) -> bool:
        """Whether x.a is too short-lived for a step."""
        return False

    # --- events ------------------------------------------------------------------------------------------
    def begin_step(self, x: State) -> None:
        return None

    def watch(self, x: State) -> tuple[float, ...]:
        """One value per event, which happens where it falls from > 0 to <= 0; inf: not armed."""
        return ()

    def pass_event(self, name: str, x: State) -> State | None:
        """A consistent state after the event, None to end the run."""
        return x


def iterate(system: System, t: float, phase: int, start: Array, now: Array, rule: Array, newton: Newton) -> StepResult:
    predictor = rule[:, :3]
    c = rule[:, 3:4]
    w = rule[:, 4:5]
    linear = (w * c)[:, 0].tolist()
    rest = (1.0 - w) * start
    now[:] = predictor @ start
    q, v, a = at = np.empty_like(now)
    correction = np.empty_like(now)

    def residual() -> Array:
        np.add(np.multiply(w, now, out=at), rest, out=at)
        return system.residual(t, q, v, a, phase)

    def linearise() -> tuple[Array, Solve]:
        np.add(np.multiply(w, now, out=at), rest, out=at)
        return system.linearise(t, q, v, a, phase, *linear)

    def update(da: Array) -> None:
        np.subtract(now, np.multiply(c, da, out=correction), out=now)

    with np.errstate(over="ignore", invalid="ignore"):
        return find_root(residual, linearise, update, newton)


def consistent_acceleration(system: System, t: float, q: Array, v: Array, phase: int) -> State:
    """The state whose a solves r(t, q, v, a) = 0."""
    r, solve = system.linearise(t, q, v, np.zeros(system.n_dof), phase, 0.0, 0.0, 1.0)
    return State(t, q, v, -solve(r.copy()), phase)
