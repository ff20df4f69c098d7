"""A step whose balance is averaged along the way (average vector field): the energy is kept."""

from __future__ import annotations

import numpy as np

from cablefem.newmark.newton import find_root
from cablefem.newmark.stepper import Stepper
from cablefem.newmark.system import Array, Solve, State

# Gauss-Legendre points of the average over a step: a potential is not polynomial in q in general, four points leave
# a quadrature error far below rounding for slopes that change by a few percent per step.
_TAU, _WEIGHT = np.polynomial.legendre.leggauss(4)
_TAU, _WEIGHT = 0.5 * (_TAU + 1.0), 0.5 * _WEIGHT


class EnergyRule(Stepper):
    """v1 = v0 + dt a,  q1 = q0 + dt (v0 + v1)/2,  average of r over the straight line from q0 to q1 = 0."""

    def __call__(self, x: State, t1: float) -> State:
        dt = t1 - x.t
        t_mid = x.t + 0.5 * dt
        before = self.remembered(x)
        a = x.a.copy() if before is None else before[0].copy()

        def mid() -> tuple[Array, Array]:
            return x.q + (0.5 * dt) * x.v + (0.25 * dt * dt) * a, x.v + (0.5 * dt) * a

        def residual() -> Array:
            v = mid()[1]
            r = np.zeros_like(a)
            for tau, weight in zip(_TAU, _WEIGHT, strict=True):
                r += weight * self.system.residual(x.t + tau * dt, x.q + tau * dt * v, v, a, x.phase)
            return r

        def linearise() -> tuple[Array, Solve]:
            q, v = mid()
            _, solve = self.system.linearise(t_mid, q, v, a, x.phase, 0.25 * dt * dt, 0.5 * dt, 1.0)
            return residual(), solve

        def update(da: Array) -> None:
            nonlocal a
            a = a - da

        with np.errstate(over="ignore", invalid="ignore"):
            done = find_root(residual, linearise, update, self.bound, self.newton)
        if not self.balanced(done):
            raise self.stalled(t1, done)
        # the rule knows the acceleration of the middle of the step; the last two carry it to the end, second order
        a1 = a if before is None else a + dt / (dt + before[1]) * (a - before[0])
        after = State(t1, x.q + dt * x.v + (0.5 * dt * dt) * a, x.v + dt * a, a1, x.phase)
        self.remember(after, (a, dt))
        return after
