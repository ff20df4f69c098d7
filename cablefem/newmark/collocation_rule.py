"""A step by collocation: the balance holds at several nodes of the step (Radau IIA, Gauss)."""

import math
from dataclasses import replace
from functools import partial
from typing import Protocol, runtime_checkable

import numpy as np

from cablefem.newmark.failures import StepFailure
from cablefem.newmark.newton import Newton, Settled, find_root
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Array, Collocated, Inside, Solve, State, System, consistent_acceleration
from cablefem.newmark.tableau import Tableau, continued, tableau

# One tangent for all nodes errs by what it changes along the step, and so does a new one: it is kept while it serves.
REUSE = 0.8


@runtime_checkable
class Collocating(Protocol):
    """What a system may bring to be faster than `collocate` with its residuals and tangents."""

    def collocate(
        self, t: Array, dt: float, phase: int, start: Array, a: Array, rule: Tableau, bound: float, newton: Newton
    ) -> Settled: ...


class CollocationRule(Stepper):
    """With a the polynomial through the accelerations a_j at the nodes t0 + c_j dt, v and q its integrals,

        v_i = v0 + dt sum_j A_ij a_j,   q_i = q0 + c_i dt v0 + dt^2 sum_j (A A)_ij a_j,   r(t_i, q_i, v_i, a_i) = 0 .

    Where the last node is the step's end (Radau IIA) its state is the step's; else (Gauss) q and v at the end follow
    from the polynomial and a from the balance, which a constraint on positions does not determine: StepFailure.
    """

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, replace(newton, reuse=REUSE), work)
        self.rule = tableau(method.nodes)
        self.collocate = system.collocate if isinstance(system, Collocating) else partial(collocate, system)

    def __call__(self, x: State, t1: float) -> State:
        rule, dt = self.rule, t1 - x.t
        t = x.t + rule.c * dt
        if rule.c[-1] == 1.0:
            t[-1] = t1
        a = self._accelerations(x, t, dt)
        twice, once = rule.ends @ a
        q, v = x.q + dt * (x.v + dt * twice), x.v + dt * once
        if rule.c[-1] == 1.0:
            end = Collocated(t1, q, v, a[-1], x.phase)
        else:
            end = Collocated(*consistent_acceleration(self.system, t1, q, v, x.phase))
        if not np.isfinite(end.a.sum()):
            raise StepFailure(
                t1, "the balance does not determine the acceleration (a constraint on positions)",
                "take scheme radau, newmark or generalized-alpha",
            )  # fmt: skip
        end.inside = Inside(self.method.nodes, dt, a)
        return end

    def _accelerations(self, x: State, t: Array, dt: float) -> Array:
        """Return the accelerations at the nodes t.

        First guess: the polynomial of the step before goes on; where unresolved waves make that absurd, or there is
        none: a stays as it was; at a start, where the tangent may change too much along the step: the same, with all
        nodes' own tangents.
        """
        step = dt, x.phase, np.array([x.q, x.v])
        how = self.rule, self.bound, self.newton
        if isinstance(x, Collocated):
            a = continued(x.inside, dt)
            if self.balanced(self.collocate(t, *step, a, *how)):
                return a
        solvers = [self.collocate]
        if not isinstance(x, Collocated):
            solvers.append(partial(collocate_coupled, self.system))
        for solver in solvers:
            a = np.repeat(x.a[None, :], t.size, axis=0)
            done = solver(t, *step, a, *how)
            if self.balanced(done):
                return a
        raise self.stalled(float(t[-1]), done)


class _Nodes:
    """The balances of all nodes as functions of the accelerations there, a (s, n_dof)."""

    def __init__(
        self, system: System, t: Array, dt: float, phase: int, start: Array, a: Array, rule: Tableau
    ) -> None:  # fmt: skip
        self.system, self.t, self.dt, self.phase, self.a, self.rule = system, t, dt, phase, a, rule
        self.v0, self.drift = start[1], start[0] + np.outer(rule.c * dt, start[1])

    def at(self, i: int) -> tuple[Array, Array, Array]:
        q, v = self.drift[i] + self.dt**2 * (self.rule.AA[i] @ self.a), self.v0 + self.dt * (self.rule.A[i] @ self.a)
        return q, v, self.a[i]

    def residual(self) -> Array:
        return np.concatenate([self.system.residual(t, *self.at(i), self.phase) for i, t in enumerate(self.t)])

    def tangent(self) -> Solve:
        """Return the solution with one tangent M, C, K for all nodes: M + dt A C + dt^2 A^2 K, block by block.

        In the basis of A's eigenvectors it falls apart into M + dt lam C + (dt lam)^2 K, one real system for a real
        eigenvalue lam and a complex one for a pair (Hairer & Wanner 1996, section IV.8).
        """
        rule, middle = self.rule, self.rule.middle
        at = self.t[middle], *self.at(middle), self.phase
        lams = [self.dt * (value if value.imag else value.real) for value in rule.values]
        solves = [self.system.linearise(*at, lam * lam, lam, 1.0)[1] for lam in lams]

        def solve(r: Array) -> Array:
            along = rule.to @ r.reshape(self.a.shape)
            for x, lam, solve_one in zip(along, lams, solves, strict=True):
                x[:] = solve_one(x if isinstance(lam, complex) else x.real.copy())
            return (rule.back @ along).real.ravel()

        return solve

    def update(self, da: Array) -> None:
        self.a -= da.reshape(self.a.shape)


def collocate(
    system: System, t: Array, dt: float, phase: int, start: Array, a: Array, rule: Tableau, bound: float, newton: Newton
) -> Settled:
    """Find the accelerations a (s, n_dof) at the nodes t (s,) of a step of length dt from start (2, n_dof) = q, v."""
    nodes = _Nodes(system, t, dt, phase, start, a, rule)
    with np.errstate(over="ignore", invalid="ignore"):
        return find_root(nodes.residual, lambda: (nodes.residual(), nodes.tangent()), nodes.update, bound, newton)


def collocate_coupled(
    system: System, t: Array, dt: float, phase: int, start: Array, a: Array, rule: Tableau, bound: float, newton: Newton
) -> Settled:
    """The same with the full tangent of all nodes, by Krylov's subspaces preconditioned with the one of `collocate`.

    For steps along which the tangent itself changes as a whole, as a start where it is proportional to a power of t.
    """
    from scipy.optimize import NoConvergence, newton_krylov  # rarely needed, long to load
    from scipy.sparse.linalg import LinearOperator

    nodes, count = _Nodes(system, t, dt, phase, start, a, rule), 0

    def residual(y: Array) -> Array:
        nonlocal count
        count += 1
        a[:] = y.reshape(a.shape)
        return nodes.residual()

    with np.errstate(all="ignore"):
        shape = (a.size, a.size)
        if not np.isfinite(residual(a.ravel().copy())).all():
            return Settled(math.inf, 0, 0, count)
        precondition = LinearOperator(shape, matvec=nodes.tangent(), dtype=float)
        try:
            y = newton_krylov(
                residual, a.ravel().copy(), inner_M=precondition, f_tol=bound, maxiter=newton.max_iter,
                tol_norm=np.linalg.norm,
            )  # fmt: skip
        except (NoConvergence, ValueError):  # ValueError: a direction without a residual
            return Settled(math.inf, newton.max_iter, 1, count)
        norm = float(np.linalg.norm(residual(y)))
    return Settled(norm, 1, 1, count)
