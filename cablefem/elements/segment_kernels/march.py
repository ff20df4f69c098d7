"""Compiled collocation steps of a line with the factors of a step before, see `newmark.newton.find_root`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.elements.kernels.collocation import set_end_state, set_node_state, set_weighted_sums
from cablefem.elements.segment_kernels.balance import compiled, inner
from cablefem.elements.segment_kernels.contacts import Contacts, Slots, set_dependent_coordinates, set_rows_and_loads
from cablefem.newmark import Array, Newton, Tableau

Complex = NDArray[np.complex128]


class Unknowns(NamedTuple):
    slots: Slots  # (n_dof,)
    moving: NDArray[np.bool_]  # (size,) whether a slot is one of those, and of no car that sticks


class Factors(NamedTuple):
    """`bordered.BandFactors` of the tangents of each of the rule's eigenvalues, complex."""

    lu: Complex  # (m, n, 3 b + 1) columns; the diagonal is inverted
    pivots: NDArray[np.int32]  # (m, n)
    from_border: Complex  # (m, n, K)
    rows: Complex  # (m, K, n)
    inverse: Complex  # (m, K, K)


class Steps(NamedTuple):
    """See `cablefem.newmark.Steps`."""

    t: Array  # (m + 1,)
    ends: Array  # (m + 1, 2, n_dof)
    a: Array  # (m, s, n_dof)
    extrapolation: Array  # (m, s, s)
    prescribed: Array  # (3, m, s, size) coordinates with rates
    results: Array  # (m, 5) output: see `newmark.StepResult`


class Step(NamedTuple):
    """See `kernels.collocation.Step`."""

    start: Array  # (2, n_dof)
    dt: float
    a: Array  # (s, n_dof)
    rule: Tableau


class Workspace(NamedTuple):
    """Of the nodes of a step."""

    z: Array  # (3, size)
    loads: Array  # (cars + 1,)
    x: Array  # (3, n_dof)
    r: Array  # (s, size) residuals
    da: Array  # (s, size) corrections
    along: Complex  # (m, size) along the eigenvectors
    border: Complex  # (K,)


@compiled
def take_steps_with_factors(
    line: Contacts, unknowns: Unknowns, factors: Factors, steps: Steps, rule: Tableau, newton: Newton
) -> int:
    """Take as many steps as there are results while the factors serve; return how many have converged.

    The step after these has its guess; one that has not converged keeps the corrections that helped.
    """
    nodes, n = steps.a.shape[1:]
    size = unknowns.moving.size
    modes, borders = factors.inverse.shape[:2]
    space = Workspace(
        np.empty((3, size)),
        np.empty(line.line.cars.contacts.size + 1),
        np.empty((3, n)),
        np.empty((nodes, size)),
        np.empty((nodes, size)),
        np.empty((modes, size), np.complex128),
        np.empty(borders, np.complex128),
    )
    for k in range(steps.results.shape[0]):
        if not correct_until_converged(line, unknowns, factors, steps, k, rule, newton, space):
            return k
        step = Step(steps.ends[k], steps.t[k + 1] - steps.t[k], steps.a[k], rule)
        set_end_state(step, steps.ends[k + 1])
        if k + 1 < steps.a.shape[0]:
            set_weighted_sums(steps.extrapolation[k + 1], steps.a[k], steps.a[k + 1])
        if steps.results[k, 4] == 0.0:
            return k + 1
    return steps.results.shape[0]


@inner
def correct_until_converged(
    line: Contacts, unknowns: Unknowns, factors: Factors, steps: Steps, k: int, rule: Tableau, newton: Newton,
    space: Workspace,
) -> bool:  # fmt: skip
    """Set the accelerations of step k and its result; see `newmark.newton` for when factors serve no longer."""
    result = steps.results[k]
    norm = set_residuals_return_norm(line, unknowns, steps, k, rule, space)
    iterations = 0
    converged = False
    while iterations < newton.max_iter and not converged:
        before = norm
        set_corrections(factors, rule, space)
        subtract_corrections(unknowns, space, 1.0, steps.a[k])
        norm = set_residuals_return_norm(line, unknowns, steps, k, rule, space)
        iterations += 1
        converged = norm <= newton.bound and norm <= newton.fast * max(before, newton.bound)
        if converged:
            set_corrections(factors, rule, space)
            subtract_corrections(unknowns, space, 1.0, steps.a[k])
        elif not norm < before:
            subtract_corrections(unknowns, space, -1.0, steps.a[k])
        if not norm <= newton.reuse * before:
            break
    result[0] = norm
    result[1] = iterations
    result[2] = 0.0
    result[3] = iterations + 1
    result[4] = 1.0 if norm <= newton.fast * before else 0.0
    return converged


@inner
def set_residuals_return_norm(
    line: Contacts, unknowns: Unknowns, steps: Steps, k: int, rule: Tableau, space: Workspace
) -> float:
    """Set the residuals of all nodes of step k, 0 for what is no moving unknown; return their norm."""
    x = space.x
    z = space.z
    step = Step(steps.ends[k], steps.t[k + 1] - steps.t[k], steps.a[k], rule)
    square = 0.0
    for i in range(step.a.shape[0]):
        set_node_state(step, i, x)
        z[:] = steps.prescribed[:, k, i]
        for j in range(x.shape[1]):
            for row in range(3):
                z[row, unknowns.slots[j]] = x[row, j]
        set_dependent_coordinates(line, z)
        rows = space.r[i]
        set_rows_and_loads(line, k * step.a.shape[0] + i, z, rows, space.loads)
        for j in range(rows.size):
            if not unknowns.moving[j]:
                rows[j] = 0.0
            square += rows[j] * rows[j]
    return math.sqrt(square)


@inner
def set_corrections(factors: Factors, rule: Tableau, space: Workspace) -> None:
    """Set the corrections of all nodes for their residuals."""
    along = space.along
    set_weighted_sums(rule.to_modes, space.r, along)
    for m in range(along.shape[0]):
        solve_bordered(factors, m, along[m], space.border)
    for i in range(space.da.shape[0]):
        for j in range(space.da.shape[1]):
            x = 0.0
            for m in range(along.shape[0]):
                x += (rule.from_modes[i, m] * along[m, j]).real
            space.da[i, j] = x


@inner
def subtract_corrections(unknowns: Unknowns, space: Workspace, fraction: float, a: Array) -> None:
    """Subtract a fraction of the corrections from the accelerations a (s, n_dof) of what moves."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            slot = unknowns.slots[j]
            if unknowns.moving[slot]:
                a[i, j] -= fraction * space.da[i, slot]


@inner
def solve_bordered(factors: Factors, m: int, b: Complex, border: Complex) -> None:
    """Overwrite b (size,) with the solution by factors m; border (K,) is a workspace."""
    lu = factors.lu[m]
    pivots = factors.pivots[m]
    n = pivots.size
    band = lu.shape[1] // 3
    for j in range(n):
        p = pivots[j]
        x = b[p]
        b[p] = b[j]
        b[j] = x
        for i in range(1, min(band, n - 1 - j) + 1):
            b[j + i] -= lu[j, 2 * band + i] * x
    for j in range(n - 1, -1, -1):
        x = b[j] * lu[j, 2 * band]
        b[j] = x
        for i in range(1, min(2 * band, j) + 1):
            b[j - i] -= lu[j, 2 * band - i] * x
    for i in range(border.size):
        row = factors.rows[m, i]
        x = b[n + i]
        for j in range(n):
            x -= row[j] * b[j]
        border[i] = x
    for i in range(border.size):
        x = 0.0j
        for k in range(border.size):
            x += factors.inverse[m, i, k] * border[k]
        b[n + i] = x
    for j in range(n):
        for i in range(border.size):
            b[j] -= factors.from_border[m, j, i] * b[n + i]
