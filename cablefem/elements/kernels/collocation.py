"""Compiled Newton's method for collocation steps; see `cablefem.newmark.collocation`.

As in RADAU5 (Hairer & Wanner 1996, section IV.8), the middle node's tangent serves all nodes.
Factors are kept for the next steps.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import compiled, inner, shared
from cablefem.elements.kernels.balance import (
    Cable,
    Instant,
    MassCoupling,
    set_mass_damping_stiffness_bands,
    side_begin_and_length,
)
from cablefem.elements.kernels.banded import Tangent, factorise_in_place, solve_factored_in_place
from cablefem.elements.kernels.car import CarOnMesh, car_has_had_no_event
from cablefem.elements.kernels.newton import NO_TANGENT, assemble_balance
from cablefem.newmark import Array, Newton, Tableau
from cablefem.newmark.collocation import SAME_STEP
from cablefem.newmark.compiled_collocation import (
    add_correction_along_mode,
    set_end_state,
    set_node_state_from_accelerations,
    set_weighted_sums,
)
from cablefem.newmark.marching import Mode

FAST_ENOUGH = 0.03  # rate of convergence with kept factors


class Steps(NamedTuple):
    """See `cablefem.newmark.System.collocate_steps`."""

    inputs: Any  # (m, s, .) at the nodes, see `newton.Steps`
    coupling: MassCoupling  # of the nodes, (s, ...) each
    t: Any  # (m + 1,)
    ends: Any  # (m + 1, 2, n)
    a: Any  # (m, s, n)
    extrapolation: Any  # (m, s, s)
    results: Any  # (m, 6) see `newton.Steps`
    slack_ends: bool  # whether they may end at a slack state only


class Workspace(NamedTuple):
    real: Tangent
    complex_pair: Tangent  # complex
    parts: Tangent  # dr/dq, dr/dv, dr/da, (3, ...) each
    bands: Any  # (s, 3, 2 b + 1, .)
    kept_step: Any  # (1,) step of the factors, nan: none
    scales: Any  # (s, n_dof) see `set_row_scales_in_workspace`
    x: Any  # (s, 3, n_dof)
    r: Any  # (s, n_dof)
    da: Any  # (s, n_dof)


class Step(NamedTuple):
    inputs: Any  # (s, .)
    coupling: MassCoupling
    start: Any  # (2, n)
    dt: float
    a: Any  # (s, n)
    rule: Tableau


@compiled
def collocate_until_event(
    cable: Cable, rolling_car: CarOnMesh | None, workspace: Workspace, steps: Steps, rule: Tableau, newton: Newton
) -> int:
    """Take steps; return how many converged before an event of the car.

    A step with a slack element is the last one where `slack_ends`.
    """
    x = workspace.x
    for k in range(steps.a.shape[0]):
        if k > 0:
            set_weighted_sums(steps.extrapolation[k], steps.a[k - 1], steps.a[k])
        step = Step(steps.inputs[k], steps.coupling, steps.ends[k], steps.t[k + 1] - steps.t[k], steps.a[k], rule)
        for i in range(x.shape[0]):
            if steps.inputs.shape[2] > 3:  # with a car, `assemble_cable_and_car` does this
                set_mass_damping_stiffness_bands(cable, instant_at_node(step, workspace.bands, i))
        result = steps.results[k]
        solve_collocation_step(cable, rolling_car, workspace, step, newton, result)
        if not result[0] <= newton.bound:
            return k
        set_end_state(step, steps.ends[k + 1])
        if not car_has_had_no_event(cable, rolling_car, step.inputs[-1], x[-1]):
            return k
        if steps.slack_ends and not result[4] >= 0.0:
            return k + 1
    return steps.a.shape[0]


@inner
def instant_at_node(step: Step, bands: Array, i: int) -> Instant:
    """`Instant` of node i of a step; bands : of all nodes."""
    dofs, shape, m_row, c_row, k_row = step.coupling
    return Instant(step.inputs[i], bands[i], MassCoupling(dofs[i], shape[i], m_row[i], c_row[i], k_row[i]))


@inner
def copy_matrix_into_part(matrix: Array | None, parts: Array, k: int) -> None:
    """Copy a matrix, or none, to part k of `Workspace.parts`."""
    if matrix is None:
        return
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            parts[k, i, j] = matrix[i, j]


@inner
def solve_collocation_step(
    cable: Cable, rolling_car: CarOnMesh | None, workspace: Workspace, step: Step, newton: Newton,
    result: Array,
) -> None:  # fmt: skip
    """Set the accelerations of a step by Newton's method, and its row of `Steps.results`.

    With old factors, a correction that does not help is taken back.
    """
    old = abs(workspace.kept_step[0] - step.dt) <= SAME_STEP * step.dt
    anew = not old
    iterations = 0
    factorisations = 0
    norm = set_states_and_residuals_return_norm(cable, rolling_car, workspace, step, result)
    result[3] = 0  # counts those of corrections
    before = math.inf
    while iterations < newton.max_iter:
        iterations += 1
        if anew:
            old = False
            workspace.kept_step[0] = step.dt
            factorisations += 1
            assemble_and_factorise_tangents(cable, rolling_car, workspace, step)
        set_corrections_from_residuals(workspace, step.rule)
        before = norm
        limit = math.inf if iterations <= newton.patience else before
        fraction = 1.0
        for _ in range(newton.halvings + 1):
            subtract_fraction_in_place(fraction, workspace.da, step.a)
            norm = set_states_and_residuals_return_norm(cable, rolling_car, workspace, step, result)
            if old or norm < limit:
                break
            fraction = -0.5 if fraction == 1.0 else 0.5 * fraction  # takes half of the correction back
        anew = not norm <= newton.reuse * before
        if norm <= newton.bound:
            break
        if old and not norm < before:
            subtract_fraction_in_place(-1.0, workspace.da, step.a)
            norm = set_states_and_residuals_return_norm(cable, rolling_car, workspace, step, result)
        elif not old and needs_too_many_corrections(norm, before, iterations, newton):
            break
    forget_slow_factors(workspace, norm, before, newton)
    result[0] = norm
    result[1] = iterations
    result[2] = factorisations


@inner
def forget_slow_factors(workspace: Workspace, norm: float, before: float, newton: Newton) -> None:
    """Let the next step make new factors, unless the last iteration with these was fast."""
    if not (norm <= newton.bound and norm <= FAST_ENOUGH * before):
        workspace.kept_step[0] = math.nan


@inner
def needs_too_many_corrections(norm: float, before: float, iterations: int, newton: Newton) -> bool:
    if not norm < math.inf:
        return True
    if iterations <= newton.patience:
        return False
    return norm * (norm / before) ** (newton.enough - iterations) > newton.bound


@shared
def set_states_and_residuals_return_norm(
    cable: Cable, rolling_car: CarOnMesh | None, workspace: Workspace, step: Step, result: Array
) -> float:
    """Set states and residuals of the nodes, and the least tension at the last one; return |r| of all."""
    square = 0.0
    for i in range(step.a.shape[0]):
        set_node_state_from_accelerations(step, i, workspace.x[i])
        r = workspace.r[i]
        instant = instant_at_node(step, workspace.bands, i)
        result[4], result[5] = assemble_balance(
            cable, rolling_car, instant, workspace.x[i], r, workspace.real, NO_TANGENT
        )
        for j in range(r.size):
            square += r[j] * r[j]
    result[3] += 1
    return math.sqrt(square)


@inner
def subtract_fraction_in_place(fraction: float, da: Array, a: Array) -> None:
    """Take a fraction of da from a."""
    for i in range(a.shape[0]):
        x = a[i]
        of = da[i]
        for j in range(x.size):
            x[j] -= fraction * of[j]


@inner
def assemble_and_factorise_tangents(
    cable: Cable, rolling_car: CarOnMesh | None, workspace: Workspace, step: Step
) -> None:
    """Set `real` and `complex_pair` of a workspace to factors of the middle node's tangent, and its `scales`."""
    rule = step.rule
    middle = rule.middle
    spare = np.empty(workspace.r.shape[1])
    instant = instant_at_node(step, workspace.bands, middle)
    for k in range(3):
        unit = (1.0 if k == 0 else 0.0), (1.0 if k == 1 else 0.0), (1.0 if k == 2 else 0.0)
        assemble_balance(cable, rolling_car, instant, workspace.x[middle], spare, workspace.real, unit)
        copy_matrix_into_part(workspace.real.ab, workspace.parts.ab, k)
        copy_matrix_into_part(workspace.real.border, workspace.parts.border, k)
    c1 = step.dt * abs(rule.eigenvalues[0])
    set_row_scales_in_workspace(cable, rolling_car, workspace, step, c1 * c1, middle)
    for k in range(rule.eigenvalues.size):
        c1 = step.dt * rule.eigenvalues[k]
        c0 = c1 * c1
        if c1.imag == 0.0:
            set_factors_of_combination(c0.real, c1.real, workspace.parts, workspace.real)
        else:
            set_factors_of_combination(c0, c1, workspace.parts, workspace.complex_pair)


@inner
def set_factors_of_combination(c0: complex, c1: complex, parts: Tangent, tangent: Tangent) -> None:
    """Set a tangent to the factors of c0 dr/dq + c1 dr/dv + dr/da, the parts."""
    set_weighted_sum_if_wanted(c0, c1, parts.ab, tangent.ab)
    set_weighted_sum_if_wanted(c0, c1, parts.border, tangent.border)
    factorise_in_place(tangent.ab, tangent.border)


@inner
def set_weighted_sum_if_wanted(c0: complex, c1: complex, parts: Array, out: Array | None) -> None:
    """Set out, if there is one, to c0 parts[0] + c1 parts[1] + parts[2]."""
    if out is None:
        return
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = c0 * parts[0, i, j] + c1 * parts[1, i, j] + parts[2, i, j]


@inner
def set_row_scales_in_workspace(
    cable: Cable, rolling_car: CarOnMesh | None, workspace: Workspace, step: Step, c0: float, middle: int
) -> None:
    """Set scales of the rows of each node so that the middle tangent fits its diagonal; with a car they stay 1."""
    if rolling_car is not None:
        return
    bands = workspace.bands
    scales = workspace.scales
    mesh = cable.mesh
    K_c = workspace.parts.ab[0]
    M_c = workspace.parts.ab[2]
    half = bands.shape[2] // 2
    band = M_c.shape[1] // 2
    n_fields = step.coupling.dofs.shape[2]
    scales[:] = 0.0
    for i in range(scales.shape[0]):
        for e in range(mesh.dofs.shape[0]):
            for d in mesh.dofs[e]:
                for k in range(n_fields if d >= 0 else 0):
                    scales[i, d * n_fields + k] += 1.0 / side_begin_and_length(mesh, step.inputs[i, 0], e)[1]
    for j in range(scales.shape[1]):
        K = c0 * K_c[j, band]
        M = M_c[j, band]
        per_h = scales[middle, j]
        for i in range(scales.shape[0]):
            M_i = M + bands[i, 0, half, j] - bands[middle, 0, half, j]
            scales[i, j] = (K + M) / (K * scales[i, j] / per_h + M_i)


class Corrections(NamedTuple):
    """See `compiled_collocation.March`."""

    solve: Any
    r: Any
    da: Any


@inner
def solve_factored_tangent_in_place(tangent: Tangent, b: Array) -> None:
    """Overwrite b with the solution; tangent : factors."""
    solve_factored_in_place(tangent.ab, tangent.border, b)


@inner
def set_corrections_from_residuals(workspace: Workspace, rule: Tableau) -> None:
    """Set `da` of a workspace to the corrections of all nodes, from `r`, which is scaled in place."""
    workspace.da[:] = 0.0
    for i in range(workspace.r.shape[0]):
        for j in range(workspace.r.shape[1]):
            workspace.r[i, j] *= workspace.scales[i, j]
    corrections = Corrections(solve_factored_tangent_in_place, workspace.r, workspace.da)
    for k in range(rule.eigenvalues.size):
        weights = rule.to_modes[k]
        shares = rule.from_modes[:, k]
        if rule.eigenvalues[k].imag == 0.0:
            add_correction_along_mode(Mode(weights.real, shares.real, workspace.real), corrections)
        else:
            add_correction_along_mode(Mode(weights, shares, workspace.complex_pair), corrections)
