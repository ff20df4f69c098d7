"""Newton's method for collocation steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cablefem.newmark.newton import Newton, StepResult, find_root
from cablefem.newmark.states import Array, Steps
from cablefem.newmark.tableau import Tableau

if TYPE_CHECKING:
    from cablefem.newmark.system import System

SAME_STEP = 1e-6  # relative change of the length of a step to which factors are kept


class Factors(NamedTuple):
    """Of the tangents of a step, which the next steps try first."""

    dt: float
    solves: list[Callable[[Array], Array]]  # of each of `Tableau.values`


class _StepNodes:
    """Balances at the nodes of one step as functions of the accelerations a (s, n_dof)."""

    def __init__(self, system: System, phase: int, steps: Steps, rule: Tableau) -> None:
        self.system = system
        self.phase = phase
        self.rule = rule
        self.t = rule.node_times(steps.t)[0]
        self.dt = steps.t[1] - steps.t[0]
        self.a = steps.a[0]
        self.ends = steps.ends
        self.v0 = self.ends[0, 1]
        self.drift = self.ends[0, 0] + np.outer(rule.c * self.dt, self.v0)  # q without a, (s, n_dof)
        self.r: Array | None = None  # residual at the present a
        self.solves: list[Callable[[Array], Array]] = []  # see `Factors`
        earlier = system.factors
        if earlier is not None and abs(earlier.dt - self.dt) <= SAME_STEP * self.dt:
            self.solves = earlier.solves

    def node_states(self) -> tuple[Array, Array, Array]:
        """q, v and a at the nodes, (s, n_dof) each."""
        q = self.drift + self.dt**2 * (self.rule.AA @ self.a)
        v = self.v0 + self.dt * (self.rule.A @ self.a)
        return q, v, self.a

    def set_end_state(self) -> None:
        """Set q and v at the end of the step."""
        twice, once = self.rule.ends @ self.a
        self.ends[1, 0] = self.ends[0, 0] + self.dt * (self.v0 + self.dt * twice)
        self.ends[1, 1] = self.v0 + self.dt * once

    def residual(self) -> Array:
        if self.r is None:
            self.r = self.system.residuals(self.t, *self.node_states(), self.phase).ravel()
        return self.r

    def factorise_tangent(self) -> Callable[[Array], Array]:
        """Factorise M + dt A C + dt^2 A^2 K, the same M, C, K for all nodes; return `solve_with_tangent`.

        A's eigenvalues lam split it into M + dt lam C + (dt lam)^2 K (Hairer & Wanner 1996, section IV.8).
        """
        rule = self.rule
        middle = rule.middle
        q, v, a = (x[middle] for x in self.node_states())
        lams = [self.dt * (value if value.imag else value.real) for value in rule.eigenvalues]
        cs = [(lam * lam, lam, 1.0) for lam in lams]
        self.solves = self.system.factorised_tangents(self.t[middle], q, v, a, self.phase, cs)
        return self.solve_with_tangent

    def solve_with_tangent(self, residual: Array) -> Array:
        """The solution with the last tangents."""
        along = self.rule.to_modes @ residual.reshape(self.a.shape)  # eigenvectors (m, n_dof)
        for x, value, solve_one in zip(along, self.rule.eigenvalues, self.solves, strict=True):
            x[:] = solve_one(x if value.imag else x.real.copy())
        return (self.rule.from_modes @ along).real.ravel()

    def subtract_correction(self, da: Array) -> None:
        self.a -= da.reshape(self.a.shape)
        self.r = None


def collocate_first_step(
    system: System, phase: int, steps: Steps, rule: Tableau, newton: Newton
) -> Iterator[StepResult]:
    """Take the first of the steps, with the tangent of its middle node, or with that of a step before."""
    nodes = _StepNodes(system, phase, steps, rule)
    with np.errstate(over="ignore", invalid="ignore"):
        earlier = nodes.solve_with_tangent if nodes.solves else None
        result = find_root(
            nodes.residual,
            lambda: (nodes.residual(), nodes.factorise_tangent()),
            nodes.subtract_correction,
            newton,
            earlier,
        )
        nodes.set_end_state()
    if system.reuses_factors:
        system.factors = Factors(nodes.dt, nodes.solves) if result.serves_next_step else None
    yield result


def collocate_first_step_by_krylov(
    system: System, phase: int, steps: Steps, rule: Tableau, newton: Newton
) -> Iterator[StepResult]:
    """Take the first of the steps with the full tangent, by a preconditioned Krylov method.

    For a start where the tangent is proportional to a power of t.
    """
    from scipy.optimize import NoConvergence, newton_krylov  # slow to load
    from scipy.sparse.linalg import LinearOperator

    nodes = _StepNodes(system, phase, steps, rule)
    residuals = 0

    def residual(y: Array) -> Array:
        nonlocal residuals
        residuals += 1
        nodes.a[:] = y.reshape(nodes.a.shape)
        nodes.r = None
        return nodes.residual()

    norm = math.inf
    iterations = 0
    y = nodes.a.ravel().copy()
    with np.errstate(all="ignore"):
        if np.isfinite(residual(y)).all():
            precondition = LinearOperator((y.size, y.size), matvec=nodes.factorise_tangent(), dtype=float)
            try:
                y = newton_krylov(
                    residual, y, inner_M=precondition, f_tol=newton.bound, maxiter=newton.max_iter,
                    tol_norm=np.linalg.norm,
                )  # fmt: skip
                norm = float(np.linalg.norm(residual(y)))
                iterations = 1
            except (NoConvergence, ValueError):
                iterations = newton.max_iter
        nodes.set_end_state()
    yield StepResult(norm, iterations, min(iterations, 1), residuals)
