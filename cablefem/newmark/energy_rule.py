"""A step with averaged balance (average vector field)."""

import numpy as np

from cablefem.newmark.newton import Newton, find_root
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.states import Array, State
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Solve, System

# bound of Newton's method over the load: errors add up
LEAVES = 1e-9


class EnergyRule(Stepper):
    """v1 = v0 + dt a,  q1 = q0 + dt (v0 + v1)/2,  average of r over the step = 0."""

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, newton._replace(tol=min(newton.tol, LEAVES)), work)
        # a and length of the last step
        self._memory: list[tuple[State, tuple[Array, float]]] = []

    def __call__(self, x: State, t1: float) -> State:
        dt = t1 - x.t
        system = self.system
        self._memory = [kept for kept in self._memory if kept[0] is x]
        before = self._memory[0][1] if self._memory else None
        a = x.a if before is None else before[0]

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
            done = find_root(residual, linearise, update, self.newton)
        if not self.balanced(done):
            raise self.stalled(t1, done)
        # extrapolated to the end
        after = end()
        if before is not None:
            after = after._replace(a=a + dt / (dt + before[1]) * (a - before[0]))
        self._memory.append((after, (a, dt)))
        return after
