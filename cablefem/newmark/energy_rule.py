"""A step whose balance is averaged along the way (average vector field): the energy is kept."""

from dataclasses import replace
from functools import partial
from typing import Protocol, runtime_checkable

import numpy as np

from cablefem.newmark.newton import Newton, find_root
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Array, Solve, State, System

# Gauss-Legendre points of the average over a step: a potential is not polynomial in q in general, four points leave
# a quadrature error far below rounding for slopes that change by a few percent per step.
_TAU, _WEIGHT = np.polynomial.legendre.leggauss(4)
_TAU, _WEIGHT = 0.5 * (_TAU + 1.0), 0.5 * _WEIGHT

# What Newton's method leaves of the balance is energy, and adds up over the steps: to 1e-7 with the standard bound.
LEAVES = 1e-9


@runtime_checkable
class Averaged(Protocol):
    """What a system answers besides if the average of r along the way does not keep its energy: with a mass M(q).

    There, with momenta M v and the average over q(x) = q0 + x (q1 - q0), the balance that keeps it is

        [ M(q1) v1 - M(q0) v0 ] / dt - average of d/dq { v0 . M(q) v1 / 2 - potential } - other forces = 0 .
    """

    def averaged(self, start: State, end: State) -> Array:
        """Return the residual (n_dof,) of a whole step; end.v = start.v + dt end.a, end.q = start.q + dt <v>."""


def average(system: System, start: State, end: State) -> Array:
    """Return the average of r over a step on the straight line from start.q to end.q, with the mean of v and end.a."""
    dt, v = end.t - start.t, 0.5 * (start.v + end.v)
    r = np.zeros_like(end.a)
    for tau, weight in zip(_TAU, _WEIGHT, strict=True):
        r += weight * system.residual(start.t + tau * dt, start.q + tau * dt * v, v, end.a, start.phase)
    return r


class EnergyRule(Stepper):
    """v1 = v0 + dt a,  q1 = q0 + dt (v0 + v1)/2,  average of r over the step = 0."""

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, replace(newton, tol=min(newton.tol, LEAVES)), work)
        # accelerations of the middle of the last steps, and their lengths: steps may be tried and dropped
        self._memory: list[tuple[State, tuple[Array, float]]] = []
        self.averaged = system.averaged if isinstance(system, Averaged) else partial(average, system)

    def __call__(self, x: State, t1: float) -> State:
        dt, system = t1 - x.t, self.system
        self._memory = [kept for kept in self._memory if kept[0] is x]
        before = self._memory[0][1] if self._memory else None
        a = x.a if before is None else before[0]

        def end() -> State:
            return State(t1, x.q + dt * x.v + (0.5 * dt * dt) * a, x.v + dt * a, a, x.phase)

        def residual() -> Array:
            return self.averaged(x, end())

        def linearise() -> tuple[Array, Solve]:
            q, v = x.q + (0.5 * dt) * x.v + (0.25 * dt * dt) * a, x.v + (0.5 * dt) * a
            _, solve = system.linearise(x.t + 0.5 * dt, q, v, a, x.phase, 0.25 * dt * dt, 0.5 * dt, 1.0)
            return residual(), solve

        def update(da: Array) -> None:
            nonlocal a
            a = a - da

        with np.errstate(over="ignore", invalid="ignore"):
            done = find_root(residual, linearise, update, self.bound, self.newton)
        if not self.balanced(done):
            raise self.stalled(t1, done)
        # the rule knows the acceleration of the middle of the step; the last two carry it to the end, second order
        after = end()
        if before is not None:
            after = after._replace(a=a + dt / (dt + before[1]) * (a - before[0]))
        self._memory.append((after, (a, dt)))
        return after
