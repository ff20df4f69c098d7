"""Compiled collocation steps of a line with the factors of a step before, see `newmark.newton.find_root`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import literal_unroll
from numpy.typing import NDArray

from cablefem.elements.bordered import BandFactors
from cablefem.elements.kernels.banded import solve_factored_band_in_place
from cablefem.elements.kernels.collocation import set_end_state, set_node_state, set_weighted_sums
from cablefem.elements.segment_kernels.balance import compiled, inner
from cablefem.elements.segment_kernels.contacts import Contacts, Slots, set_dependent_coordinates, set_rows_and_loads
from cablefem.newmark import Array, Newton, Tableau

Mask = NDArray[np.bool_]


class Mode(NamedTuple):
    """An eigenvector of the rule with the factors of its tangent, real or complex."""

    weights: Array  # (s,) see `Tableau.to_modes`
    shares: Array  # (s,) see `Tableau.from_modes`
    factors: BandFactors


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


class March(NamedTuple):
    line: Contacts
    slots: Slots  # of unknowns (n_dof,)
    moving: Mask  # (size,) whether a slot is one of those, and of no car that sticks
    modes: Any  # tuple of `Mode`
    steps: Steps
    rule: Tableau
    newton: Newton
    space: Workspace


@compiled
def take_steps_with_factors(
    line: Contacts, slots: Slots, moving: Mask, modes: tuple[Mode, ...], steps: Steps, rule: Tableau, newton: Newton
) -> int:
    """Take as many steps as there are results while the factors serve; return how many have converged.

    The step after these has its guess; one that has not converged keeps the corrections that helped.
    """
    nodes, n = steps.a.shape[1:]
    size = moving.size
    space = Workspace(
        np.empty((3, size)),
        np.empty(line.line.cars.contacts.size + 1),
        np.empty((3, n)),
        np.empty((nodes, size)),
        np.empty((nodes, size)),
    )
    march = March(line, slots, moving, modes, steps, rule, newton, space)
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
    march.space.da[:] = 0.0
    for mode in literal_unroll(march.modes):
        add_correction_along(mode, march.space)


@inner
def add_correction_along(mode: Mode, space: Workspace) -> None:
    """Add the corrections along an eigenvector."""
    nodes, size = space.r.shape
    along = np.empty(size, mode.weights.dtype)
    for j in range(size):
        x = 0.0 * mode.weights[0]
        for i in range(nodes):
            x += mode.weights[i] * space.r[i, j]
        along[j] = x
    solve_bordered_in_place(mode.factors, along)
    for i in range(nodes):
        for j in range(size):
            space.da[i, j] += (mode.shares[i] * along[j]).real


@inner
def subtract_corrections(march: March, k: int, fraction: float) -> None:
    """Subtract a fraction of the corrections from the accelerations of what moves in step k."""
    slots = march.slots
    a = march.steps.a[k]
    for i in range(a.shape[0]):
        for j in range(slots.size):
            if march.moving[slots[j]]:
                a[i, j] -= fraction * march.space.da[i, slots[j]]


@compiled
def solve_bordered_in_place(factors: BandFactors, b: Array) -> None:
    """Overwrite b (size,) with the solution."""
    n = factors.band.shape[0]
    solve_factored_band_in_place(factors.band, b[:n])
    right = np.empty_like(b[n:])
    for i in range(right.size):
        x = b[n + i]
        row = factors.rows[i]
        for j in range(n):
            x -= row[j] * b[j]
        right[i] = x
    for i in range(right.size):
        x = 0.0 * b[0]
        for k in range(right.size):
            x += factors.inverse[i, k] * right[k]
        b[n + i] = x
        column = factors.from_border[i]
        for j in range(n):
            b[j] -= column[j] * x
