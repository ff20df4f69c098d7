"""A step with averaged balance (average vector field)."""

import numpy as np

from cablefem.newmark.newton import Newton, find_root
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.states import Array, State
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Solve, System

MAX_TOL = 1e-9  # of Newton's method, over the load: errors of the energy add up


class EnergyRule(Stepper):
    """v1 = v0 + dt a,  q1 = q0 + dt (v0 + v1)/2,  average of r over the step = 0."""

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, newton._replace(tol=min(newton.tol, MAX_TOL)), work)
        # ends of the last steps, with their a and length; an event may take several from one state
        self._taken: list[tuple[State, Array, float]] = []

    def __call__(self, x: State, t1: float) -> State:
        dt = t1 - x.t
        system = self.system
        self._taken = [step for step in self._taken if step[0] is x]
        before = self._taken[0] if self._taken else None
        a = x.a if before is None else before[1]

        def end() -> State:
            return State(t1, x.q + dt * x.v + (0.5 * dt * dt) * a, x.v + dt * a, a, x.phase)

        def residual() -> Array:
            return system.averaged(x, end())

        def linearise() -> tuple[Array, Solve]:
            q = x.q + (0.5 * dt) * x.v + (0.25 * dt * dt) * a
            v = x.v + (0.5 * dt) * a
            _, solve = system.linearise(x.t + 0.5 * dt, q, v, a, x.phase, 0.25 * dt * dt, 0.5 * dt, 1.0)
            return residual(), solve

        def update(da: Array) -> None:
            nonlocal a
            a = a - da

        with np.errstate(over="ignore", invalid="ignore"):
            result = find_root(residual, linearise, update, self.newton)
        if not self.balanced(result):
            raise self.stalled(t1, result)
        after = end()
        if before is not None:
            _, a_before, dt_before = before
            after = after._replace(a=a + dt / (dt + dt_before) * (a - a_before))  # extrapolated to the end
        self._taken.append((after, a, dt))
        return after
