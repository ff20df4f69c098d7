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
Mask = NDArray[np.bool_]


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


class March(NamedTuple):
    line: Contacts
    slots: Slots  # of unknowns (n_dof,)
    moving: Mask  # (size,) whether a slot is one of those, and of no car that sticks
    factors: Factors
    steps: Steps
    rule: Tableau
    newton: Newton
    space: Workspace


@compiled
def take_steps_with_factors(
    line: Contacts, slots: Slots, moving: Mask, factors: Factors, steps: Steps, rule: Tableau, newton: Newton
) -> int:
    """Take as many steps as there are results while the factors serve; return how many have converged.

    The step after these has its guess; one that has not converged keeps the corrections that helped.
    """
    nodes, n = steps.a.shape[1:]
    size = moving.size
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
    march = March(line, slots, moving, factors, steps, rule, newton, space)
    for k in range(steps.results.shape[0]):
        if not correct_until_converged(march, k):
            return k
        set_end_state(step_of(march, k), steps.ends[k + 1])
        if k + 1 < steps.a.shape[0]:
            set_weighted_sums(steps.extrapolation[k + 1], steps.a[k], steps.a[k + 1])
        if steps.results[k, 4] == 0.0:
            return k + 1
    return steps.results.shape[0]


@inner
def step_of(march: March, k: int) -> Step:
    """Step number k."""
    steps = march.steps
    return Step(steps.ends[k], steps.t[k + 1] - steps.t[k], steps.a[k], march.rule)


@inner
def correct_until_converged(march: March, k: int) -> bool:
    """Set the accelerations of step k and its result; see `newmark.newton` for when factors serve no longer."""
    newton = march.newton
    norm = set_residuals_return_norm(march, k)
    iterations = 0
    converged = False
    while iterations < newton.max_iter and not converged:
        before = norm
        set_corrections(march)
        subtract_corrections(march, k, 1.0)
        norm = set_residuals_return_norm(march, k)
        iterations += 1
        converged = norm <= newton.bound and norm <= newton.fast * max(before, newton.bound)
        if converged:
            set_corrections(march)
            subtract_corrections(march, k, 1.0)
        elif not norm < before:
            subtract_corrections(march, k, -1.0)
        if not norm <= newton.reuse * before:
            break
    result = march.steps.results[k]
    result[0] = norm
    result[1] = iterations
    result[3] = iterations + 1
    result[4] = 1.0 if norm <= newton.fast * before else 0.0
    return converged


@inner
def set_residuals_return_norm(march: March, k: int) -> float:
    """Set the residuals of all nodes of step k, 0 for what is no moving unknown; return their norm."""
    x = march.space.x
    z = march.space.z
    step = step_of(march, k)
    nodes = step.a.shape[0]
    square = 0.0
    for i in range(nodes):
        set_node_state(step, i, x)
        z[:] = march.steps.prescribed[:, k, i]
        for j in range(x.shape[1]):
            for row in range(3):
                z[row, march.slots[j]] = x[row, j]
        set_dependent_coordinates(march.line, z)
        rows = march.space.r[i]
        set_rows_and_loads(march.line, k * nodes + i, z, rows, march.space.loads)
        for j in range(rows.size):
            if not march.moving[j]:
                rows[j] = 0.0
            square += rows[j] * rows[j]
    return math.sqrt(square)


@inner
def set_corrections(march: March) -> None:
    """Set the corrections of all nodes for their residuals."""
    along = march.space.along
    da = march.space.da
    set_weighted_sums(march.rule.to_modes, march.space.r, along)
    da[:] = 0.0
    for m in range(along.shape[0]):
        solve_bordered(march.factors, m, along[m], march.space.border)
        for i in range(da.shape[0]):
            for j in range(da.shape[1]):
                da[i, j] += (march.rule.from_modes[i, m] * along[m, j]).real


@inner
def subtract_corrections(march: March, k: int, fraction: float) -> None:
    """Subtract a fraction of the corrections from the accelerations of what moves in step k."""
    slots = march.slots
    a = march.steps.a[k]
    for i in range(a.shape[0]):
        for j in range(slots.size):
            if march.moving[slots[j]]:
                a[i, j] -= fraction * march.space.da[i, slots[j]]


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
