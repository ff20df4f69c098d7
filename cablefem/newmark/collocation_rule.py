"""A step by collocation: the balance holds at several nodes of the step (Radau IIA, Gauss)."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Protocol, runtime_checkable

import numpy as np

from cablefem.newmark.failures import StepFailure
from cablefem.newmark.newton import Newton, Settled, find_root
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Array, Collocated, Inside, Solve, State, System, consistent_acceleration
from cablefem.newmark.tableau import Tableau, further, tableau

# One tangent for all nodes errs by what it changes along the step, and so does a new one: it is kept while it serves.
REUSE = 0.8
ENOUGH = 18  # iterations in which a step must promise to settle, or two of half its length come there sooner


@runtime_checkable
class Collocating(Protocol):
    """What a system may bring to be faster than `collocate` with its residuals and tangents."""

    def collocate(
        self, t: Array, phase: int, ends: Array, a: Array, further: Array, rule: Tableau, bound: float, newton: Newton
    ) -> Iterator[Settled]:
        """Take steps from t[0] to t[1], on to t[2] and so on: as many as it takes in one go, and at least the first.

        ends : (m + 1, 2, n_dof) q and v at t, those at t[0] given, the others set.
        a : (m, s, n_dof) accelerations at the nodes, to be found; the first ones hold a guess.
        further : (m, s, s) from the accelerations of the step before to the guess of the others.
        Ends with the first step that is not settled, or before it, or after which something is to be looked at.
        """


class CollocationRule(Stepper):
    """With a the polynomial through the accelerations a_j at the nodes t0 + c_j dt, v and q its integrals,

        v_i = v0 + dt sum_j A_ij a_j,   q_i = q0 + c_i dt v0 + dt^2 sum_j (A A)_ij a_j,   r(t_i, q_i, v_i, a_i) = 0 .

    Where the last node is the step's end (Radau IIA) its state is the step's; else (Gauss) q and v at the end follow
    from the polynomial and a from the balance, which a constraint on positions does not determine: StepFailure.
    """

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, replace(newton, reuse=REUSE, enough=ENOUGH), work)
        self.rule = tableau(method.nodes)
        self.collocate = system.collocate if isinstance(system, Collocating) else partial(collocate, system)

    def stride(self, x: State, times: Array) -> Iterator[Sequence[State]]:
        if not (self.strides and isinstance(x, Collocated)):
            return
        t, ends, a, go_on = self._steps(x, times)
        a[0] = go_on[0] @ x.inside.a
        steps = self.collocate(t, x.phase, ends, a, go_on, self.rule, self.bound, self.newton)
        for k, done in enumerate(steps):
            if not done.norm <= self.bound:
                return
            self.balanced(done)
            yield [self._end(x.phase, t[k : k + 2], ends[k + 1], a[k])]

    def __call__(self, x: State, t1: float) -> State:
        """Return the state at t1.

        First guess: the polynomial of the step before goes on; where unresolved waves make that absurd, or there is
        none: a stays as it was; at a start, where a may be gone at once: it vanishes; where the tangent may change too
        much along the step: a as it was, with all nodes' own tangents.
        """
        t, ends, a, go_on = self._steps(x, np.array([t1]))
        if isinstance(x, Collocated):
            tries = [(go_on[0] @ x.inside.a, self.collocate), (x.a, self.collocate)]
        else:
            tries = [(x.a, self.collocate), (0.0, self.collocate), (x.a, partial(collocate_coupled, self.system))]
        for a[0], solver in tries:
            done = next(iter(solver(t, x.phase, ends, a, go_on, self.rule, self.bound, self.newton)))
            if self.balanced(done):
                return self._end(x.phase, t, ends[1], a[0])
        raise self.stalled(t1, done)

    def _steps(self, x: State, times: Array) -> tuple[Array, Array, Array, Array]:
        """Return what `Collocating` takes of steps from x to times ahead (m,)."""
        t, s = np.concatenate([[x.t], times]), self.rule.c.size
        ends, a = np.empty((t.size, 2, x.q.size)), np.empty((times.size, s, x.q.size))
        ends[0, 0], ends[0, 1] = x.q, x.v
        dt = t[1:] - t[:-1]
        before = np.concatenate([[x.inside.dt if isinstance(x, Collocated) else dt[0]], dt[:-1]])
        ratios = np.round(dt / before, 9).tolist()  # rounded: guesses is all they are for
        return t, ends, a, np.array([further(self.method.nodes, ratio) for ratio in ratios])

    def _end(self, phase: int, t: Array, end: Array, a: Array) -> State:
        """Return the state after a step from t to t, (2,), by q and v there and the accelerations at its nodes."""
        t0, t1 = t.tolist()
        if self.rule.c[-1] == 1.0:
            x = Collocated(t1, end[0], end[1], a[-1], phase)
        else:
            x = Collocated(*consistent_acceleration(self.system, t1, end[0], end[1], phase))
        if not math.isfinite(x.a.sum()):
            raise StepFailure(
                t1, "the balance does not determine the acceleration (a constraint on positions)",
                "take scheme radau, newmark or generalized-alpha",
            )  # fmt: skip
        x.inside = Inside(self.method.nodes, t1 - t0, a)
        return x


class _Nodes:
    """The balances of all nodes of a step as functions of the accelerations there, a (s, n_dof)."""

    def __init__(self, system: System, t: Array, phase: int, ends: Array, a: Array, rule: Tableau) -> None:
        self.system, self.t, self.dt, self.phase, self.rule = system, rule.instants(t)[0], t[1] - t[0], phase, rule
        self.a, self.ends, self.v0 = a[0], ends, ends[0, 1]
        self.drift = ends[0, 0] + np.outer(rule.c * self.dt, self.v0)

    def at(self, i: int) -> tuple[Array, Array, Array]:
        q, v = self.drift[i] + self.dt**2 * (self.rule.AA[i] @ self.a), self.v0 + self.dt * (self.rule.A[i] @ self.a)
        return q, v, self.a[i]

    def finish(self) -> None:
        """Set q and v at the step's end."""
        twice, once = self.rule.ends @ self.a
        self.ends[1] = self.ends[0, 0] + self.dt * (self.v0 + self.dt * twice), self.v0 + self.dt * once

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
    system: System, t: Array, phase: int, ends: Array, a: Array, further: Array, rule: Tableau, bound: float,
    newton: Newton,
) -> Iterator[Settled]:  # fmt: skip
    """Take the first step as `Collocating` has it."""
    nodes = _Nodes(system, t, phase, ends, a, rule)
    with np.errstate(over="ignore", invalid="ignore"):
        done = find_root(nodes.residual, lambda: (nodes.residual(), nodes.tangent()), nodes.update, bound, newton)
        nodes.finish()
    yield done


def collocate_coupled(
    system: System, t: Array, phase: int, ends: Array, a: Array, further: Array, rule: Tableau, bound: float,
    newton: Newton,
) -> Iterator[Settled]:  # fmt: skip
    """The same with the full tangent of all nodes, by Krylov's subspaces preconditioned with the one of `collocate`.

    For steps along which the tangent itself changes as a whole, as a start where it is proportional to a power of t.
    """
    from scipy.optimize import NoConvergence, newton_krylov  # rarely needed, long to load
    from scipy.sparse.linalg import LinearOperator

    nodes, count = _Nodes(system, t, phase, ends, a, rule), 0

    def residual(y: Array) -> Array:
        nonlocal count
        count += 1
        nodes.a[:] = y.reshape(nodes.a.shape)
        return nodes.residual()

    norm, iterations, y = math.inf, 0, nodes.a.ravel().copy()
    with np.errstate(all="ignore"):
        if np.isfinite(residual(y)).all():
            precondition = LinearOperator((y.size, y.size), matvec=nodes.tangent(), dtype=float)
            try:
                y = newton_krylov(
                    residual, y, inner_M=precondition, f_tol=bound, maxiter=newton.max_iter, tol_norm=np.linalg.norm
                )
                norm, iterations = float(np.linalg.norm(residual(y))), 1
            except (NoConvergence, ValueError):  # ValueError: a direction without a residual
                iterations = newton.max_iter
        nodes.finish()
    yield Settled(norm, iterations, min(iterations, 1), count)
