"""A step by collocation: the balance holds at several nodes of the step (Radau IIA, Gauss)."""

from __future__ import annotations

import numpy as np

from cablefem.newmark.failures import StepFailure
from cablefem.newmark.newton import Newton, Settled, find_root
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Array, Inside, Solve, State, System, consistent_acceleration
from cablefem.newmark.tableau import Tableau, accelerations, tableau


class CollocationRule(Stepper):
    """With a the polynomial through the accelerations a_j at the nodes t0 + c_j dt, v and q its integrals,

        v_i = v0 + dt sum_j A_ij a_j,   q_i = q0 + c_i dt v0 + dt^2 sum_j (A A)_ij a_j,   r(t_i, q_i, v_i, a_i) = 0 .

    Where the last node is the step's end (Radau IIA) its state is the step's; else (Gauss) q and v at the end follow
    from the polynomial and a from the balance, which a constraint on positions does not determine: StepFailure.
    """

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, newton, work)
        self.rule = tableau(method.nodes)

    def __call__(self, x: State, t1: float) -> State:
        rule, dt, system = self.rule, t1 - x.t, self.system
        t = x.t + rule.c * dt
        if rule.c[-1] == 1.0:
            t[-1] = t1
        start = np.array([x.q, x.v])
        # first guess: the polynomial of the step before goes on; where unresolved waves make that absurd, a stays
        guesses = [np.tile(x.a, (t.size, 1))]
        if x.inside is not None:
            guesses.insert(0, accelerations(x.inside, 1.0 + rule.c * dt / x.inside.dt))
        for a in guesses:
            done = collocate(system, t, dt, x.phase, start, a, rule, self.bound, self.newton)
            if self.balanced(done):
                break
        else:
            raise self.stalled(t1, done)
        inside = Inside(self.method.nodes, dt, a)
        q, v = x.q + dt * x.v + dt * dt * (rule.bA @ a), x.v + dt * (rule.b @ a)
        if rule.c[-1] == 1.0:
            return State(t1, q, v, a[-1], x.phase, inside)
        end = consistent_acceleration(system, t1, q, v, x.phase)
        if not np.isfinite(end.a).all():
            raise StepFailure(
                t1, "the balance does not determine the acceleration (a constraint on positions)",
                "take scheme radau, newmark or generalized-alpha",
            )  # fmt: skip
        return end._replace(inside=inside)


def collocate(
    system: System, t: Array, dt: float, phase: int, start: Array, a: Array, rule: Tableau, bound: float, newton: Newton
) -> Settled:
    """Find the accelerations a (s, n_dof) at the nodes t (s,) of a step of length dt from start (2, n_dof) = q, v.

    Newton's method with one tangent M, C, K for all nodes wants M + dt A C + dt^2 A^2 K, block by block.  In the basis
    of A's eigenvectors it falls apart into M + dt lam C + (dt lam)^2 K, one real system for a real eigenvalue lam and a
    complex one for a pair (Hairer & Wanner 1996, section IV.8).
    """
    q0, v0 = start
    drift = q0 + np.outer(rule.c * dt, v0)
    middle = int(np.argmin(np.abs(rule.c - 0.5)))

    def balances(nodes: range) -> Array:
        q, v = drift + (dt * dt) * (rule.AA @ a), v0 + dt * (rule.A @ a)
        return np.array([system.residual(t[i], q[i], v[i], a[i], phase) for i in nodes])

    def residual() -> Array:
        return balances(range(t.size)).ravel()

    def linearise() -> tuple[Array, Solve]:
        q, v = drift[middle] + (dt * dt) * (rule.AA[middle] @ a), v0 + dt * (rule.A[middle] @ a)
        solves = []
        for value in rule.values:
            lam = value if value.imag else value.real
            c = (dt * lam) ** 2, dt * lam, 1.0
            solves.append(system.linearise(t[middle], q, v, a[middle], phase, *c)[1])

        def solve(r: Array) -> Array:
            along = rule.to @ r.reshape(a.shape)
            for k, value in enumerate(rule.values):
                along[k] = solves[k](along[k] if value.imag else along[k].real.copy())
            return (rule.back @ along).real.ravel()

        return residual(), solve

    def update(da: Array) -> None:
        np.subtract(a, da.reshape(a.shape), out=a)

    with np.errstate(over="ignore", invalid="ignore"):
        return find_root(residual, linearise, update, bound, newton)
