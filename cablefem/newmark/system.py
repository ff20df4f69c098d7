"""What the time loop asks of a system."""

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark.newton import Newton, Settled

Array = NDArray[np.float64]
Solve = Callable[[Array], Array]


class Inside(NamedTuple):
    """What a collocation step leaves besides its end: accelerations at its nodes, see `tableau.between`."""

    nodes: tuple[float, ...]  # in units of the step
    dt: float
    a: Array  # (len(nodes), n_dof)


class State(NamedTuple):
    """One instant of a discretised system; `phase` is the interval between events it belongs to."""

    t: float
    q: Array  # (n_dof,) generalised displacements
    v: Array  # (n_dof,) dq/dt
    a: Array  # (n_dof,) d2q/dt2
    phase: int = 0


class Collocated(State):
    """The end of a collocation step, which remembers the step."""

    inside: Inside


class System(Protocol):
    """A second-order system r(t, q, dq/dt, d2q/dt2) = 0, linear in d2q/dt2.

    `phases` are consecutive time intervals within which everything is smooth; steps land on their ends,
    and every call names its phase, because at an end the accelerations may have two values.
    """

    @property
    def n_dof(self) -> int: ...
    @property
    def phases(self) -> tuple[tuple[float, float], ...]: ...
    @property
    def force_scale(self) -> float:
        """Size of the loads: Newton has converged when |r| <= newton.tol * force_scale + sqrt(n_dof) * force_floor."""

    @property
    def force_floor(self) -> float:
        """Rounding error of a component of r, below which Newton's method cannot get."""

    def start(self, phase: int, state: State | None) -> State:
        """Return a consistent state at the beginning of `phase` (state=None: of the run)."""

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        """Return r, shape (n_dof,)."""

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> tuple[Array, Solve]:
        """Return r and a function that applies (c0 dr/dq + c1 dr/dv + c2 dr/da)^-1; it may overwrite its argument.

        Factors are real or complex, and so is the argument then.  An earlier function may be void.
        """

    def settle(
        self, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
    ) -> Settled:
        """Find the end of a step of Newmark's family by Newton's method; `iterate` does it for any system.

        start, now : (3, n_dof) rows q, v, a at the beginning, and at the end, which is set.
        rule : (3, 5) columns predictor (3, 3), corrector c, balance w: now = predictor start - c da with da such that
            |r(t, w now + (1 - w) start)| <= bound; w works on rows.
        """


@runtime_checkable
class Prepared(Protocol):
    """What a system answers besides if signs are kept for a step: friction that turns within one has no balance."""

    def begin_step(self, x: State) -> None:
        """Be ready for steps from x: what depends on a sign goes by the one at x, until the next call."""


@runtime_checkable
class Travelling(Protocol):
    """What a system answers besides if time enters it as the place of something that travels."""

    def between(self, t0: Array, t1: Array, w: float, phase: int) -> Array:
        """Return the instants (n,) that go with unknowns which are means, weighted 1 - w and w, of those at t0, t1."""


@runtime_checkable
class Paced(Protocol):
    """What a system answers besides if it wants short steps at times that it knows."""

    @property
    def pace(self) -> tuple[Array, Array]:
        """Return instants (m,), both ends of the run included, and what a clock shows then, steady between them."""


@runtime_checkable
class Striding(Protocol):
    """What a system answers besides if it takes many steps in one go.

    strides : whether it does; of its events each is looked for at the end of a step then, and its steps are whole.
    Who changes `settle` changes this.
    """

    strides: bool

    def stride(
        self, t: Array, phase: int, start: Array, rules: Array, bound: float, newton: Newton
    ) -> tuple[Array, Array]:
        """Return the ends (k, 3, n_dof) of steps, each from the one before, as `settle` finds them, and what is told.

        t, rules : of each step, (m,) and (m, 3, 5).  Ends before the first step that Newton's method does not settle,
        or in which an event may happen, or after which something is to be looked at: who asks takes that one alone.
        Told (k, 4 or more): of each what `Settled` has, and of one more where that was not settled.  k = 0: none is to
        be taken in one go.
        """


@runtime_checkable
class Abrupt(Protocol):
    """What a system answers besides if its acceleration may be too short-lived to carry it over a step."""

    def abrupt(self, x: State, dt: float) -> bool:
        """Return whether the acceleration at x, kept for dt, would carry the system where it never goes."""


@runtime_checkable
class Ringing(Protocol):
    """What a system answers besides if a jump of force rings faster than the steps of a run are long."""

    def part(self, x: State, since: float, ahead: float = 0.0) -> float:
        """Return which part of a step of the grid to take, `since` after the last event; in (0, 1].

        From x, or `ahead` of it in time, as it comes to be there at its velocity.  A function of time alone, whatever
        the steps: then all of them shrink together where a run is refined.
        """


def consistent_acceleration(system: System, t: float, q: Array, v: Array, phase: int) -> State:
    """Solve r(t, q, v, a) = 0 for a: r is linear in a, one solve does it."""
    zero = np.zeros(system.n_dof)
    r, solve = system.linearise(t, q, v, zero, phase, 0.0, 0.0, 1.0)
    return State(t, q, v, -solve(r.copy()), phase)
