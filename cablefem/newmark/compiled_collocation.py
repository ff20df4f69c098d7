"""Compiled collocation steps with the factors of a step before, see `newton.find_root`.

A wing calls `march_while_factors_serve` with two compiled functions of its own, see `March`.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import literal_unroll

from cablefem.compiled import compiling_decorator
from cablefem.newmark.marching import Mode, StepsWithFactors
from cablefem.newmark.newton import FAST
from cablefem.newmark.states import Array
from cablefem.newmark.tableau import Tableau

inner = compiling_decorator(__file__, inner=True)


class Step(NamedTuple):
    start: Array  # (2, n_dof)
    dt: float
    a: Array  # (s, n_dof)
    rule: Tableau


class March(NamedTuple):
    """Rows are numbered as the factors are, and hold the unknowns at `slots`.

    set_residuals(system, k, x, r) sets r for the nodes of step k;  solve(factors, b) overwrites b with the solution.
    """

    set_residuals: Any
    solve: Any
    system: Any
    slots: Any  # rows of the unknowns (n_dof,)
    moving: Any  # (rows,) whether a row is of an unknown that moves
    with_factors: StepsWithFactors
    x: Array  # (s, 3, n_dof) q, v, a at the nodes of a step
    r: Array  # (s, rows) residuals
    da: Array  # (s, rows) corrections


@inner
def march_while_factors_serve(
    set_residuals: Any, solve: Any, system: Any, slots: Any, moving: Any, with_factors: StepsWithFactors
) -> int:
    """Take as many steps as there are results while the factors serve; return how many have converged.

    The step after these has its guess; one that has not converged keeps the corrections that helped.
    """
    steps = with_factors.steps
    results = with_factors.results
    nodes, n = steps.a.shape[1:]
    x = np.empty((nodes, 3, n))
    r = np.empty((nodes, moving.size))
    march = March(set_residuals, solve, system, slots, moving, with_factors, x, r, np.empty_like(r))
    for k in range(results.shape[0]):
        if not correct_until_converged(march, k):
            return k
        set_end_state(step_of(march, k), steps.ends[k + 1])
        if k + 1 < steps.a.shape[0]:
            set_weighted_sums(steps.extrapolation[k + 1], steps.a[k], steps.a[k + 1])
        if results[k, 4] == 0.0:
            return k + 1
    return results.shape[0]


@inner
def step_of(march: March, k: int) -> Step:
    """Step number k."""
    steps = march.with_factors.steps
    return Step(steps.ends[k], steps.t[k + 1] - steps.t[k], steps.a[k], march.with_factors.rule)


@inner
def correct_until_converged(march: March, k: int) -> bool:
    """Set the accelerations of step k and its result; see `newmark.newton` for when factors serve no longer."""
    newton = march.with_factors.newton
    norm = set_residuals_return_norm(march, k)
    iterations = 0
    converged = False
    while iterations < newton.max_iter and not converged:
        before = norm
        set_corrections_from_residuals(march)
        subtract_corrections(march, k, 1.0)
        norm = set_residuals_return_norm(march, k)
        iterations += 1
        converged = norm <= newton.bound and norm <= FAST * max(before, newton.bound)
        if converged:
            set_corrections_from_residuals(march)
            subtract_corrections(march, k, 1.0)
        elif not norm < before:
            subtract_corrections(march, k, -1.0)
        if not norm <= newton.reuse * before:
            break
    result = march.with_factors.results[k]
    result[0] = norm
    result[1] = iterations
    result[3] = iterations + 1
    result[4] = 1.0 if norm <= FAST * before else 0.0
    return converged


@inner
def set_residuals_return_norm(march: March, k: int) -> float:
    """Set the residuals of all nodes of step k, 0 for what is no moving unknown; return their norm."""
    x = march.x
    step = step_of(march, k)
    for i in range(x.shape[0]):
        set_node_state_from_accelerations(step, i, x[i])
    march.set_residuals(march.system, k, x, march.r)
    square = 0.0
    for rows in march.r:
        for j in range(rows.size):
            if not march.moving[j]:
                rows[j] = 0.0
            square += rows[j] * rows[j]
    return math.sqrt(square)


@inner
def set_corrections_from_residuals(march: March) -> None:
    """Set the corrections of all nodes for their residuals."""
    march.da[:] = 0.0
    for mode in literal_unroll(march.with_factors.modes):
        add_correction_along_mode(mode, march)


@inner
def add_correction_along_mode(mode: Mode, march: Any) -> None:
    """Add the corrections along an eigenvector, if there is one."""
    if mode.weights.size == 0:
        return
    nodes, size = march.r.shape
    along = np.empty(size, mode.weights.dtype)
    for j in range(size):
        x = 0.0 * mode.weights[0]
        for i in range(nodes):
            x += mode.weights[i] * march.r[i, j]
        along[j] = x
    march.solve(mode.factors, along)
    for i in range(nodes):
        for j in range(size):
            march.da[i, j] += (mode.shares[i] * along[j]).real


@inner
def subtract_corrections(march: March, k: int, fraction: float) -> None:
    """Subtract a fraction of the corrections from the accelerations of what moves in step k."""
    slots = march.slots
    a = march.with_factors.steps.a[k]
    for i in range(a.shape[0]):
        for j in range(slots.size):
            if march.moving[slots[j]]:
                a[i, j] -= fraction * march.da[i, slots[j]]


@inner
def set_node_state_from_accelerations(step: Any, i: int, x: Array) -> None:
    """Set the state x at a node of a `Step`: q = q0 + c dt v0 + dt^2 (A A a), v = v0 + dt A a."""
    q0 = step.start[0]
    v0 = step.start[1]
    dt = step.dt
    q = x[0]
    v = x[1]
    a = x[2]
    for j in range(a.size):
        v[j] = v0[j]
        a[j] = step.a[i, j]
        q[j] = q0[j] + dt * step.rule.c[i] * v0[j]
    for k in range(step.a.shape[0]):
        of = step.a[k]
        once = dt * step.rule.A[i, k]
        twice = dt * dt * step.rule.AA[i, k]
        for j in range(a.size):
            v[j] += once * of[j]
            q[j] += twice * of[j]


@inner
def set_end_state(step: Any, end_state: Array) -> None:
    """Set q and v at the end of a step, from the accelerations of its nodes."""
    q0 = step.start[0]
    v0 = step.start[1]
    dt = step.dt
    for j in range(q0.size):
        twice = 0.0
        once = 0.0
        for i in range(step.a.shape[0]):
            twice += step.rule.ends[0, i] * step.a[i, j]
            once += step.rule.ends[1, i] * step.a[i, j]
        end_state[0, j] = q0[j] + dt * (v0[j] + dt * twice)
        end_state[1, j] = v0[j] + dt * once


@inner
def set_weighted_sums(weights: Array, vectors: Array, out: Array) -> None:
    """Set out = weights @ vectors."""
    out[:] = 0.0
    for i in range(weights.shape[0]):
        for k in range(weights.shape[1]):
            x = vectors[k]
            to = out[i]
            w = weights[i, k]
            for j in range(to.size):
                to[j] += w * x[j]
