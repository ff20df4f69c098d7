"""Compiled Newton's method for steps of Newmark's family."""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import compiled, inner
from cablefem.elements.kernels.balance import (
    Cable,
    Factors,
    Instant,
    MassCoupling,
    MinTension,
    assemble_cable,
    set_mass_damping_stiffness_bands,
)
from cablefem.elements.kernels.banded import Tangent, dot, factorise_in_place, solve_factored_in_place
from cablefem.elements.kernels.car import CarOnMesh, assemble_cable_and_car, car_has_had_no_event
from cablefem.newmark import Array, Newton

NO_TANGENT = 0.0, 0.0, 0.0


class Steps(NamedTuple):
    """Consecutive steps, see `cablefem.newmark.System.solve_step`."""

    inputs: Any  # (m, 3 + n_fields) see `balance.Instant`; with a car (m, 3), see `car.Car`
    coupling: MassCoupling
    start: Any  # (3, n)
    rules: Any  # (m, 3, 5)
    ends: Any  # (m, 3, n) output
    results: Any  # (m, 6) output: |r|, iterations, factorisations, residuals, least tension, its s
    slack_ends: bool  # whether they may end at a slack state only


class Step(NamedTuple):
    begin: Any  # (3, n)
    end: Any  # (3, n) output
    rule: Any  # (3, 5)
    instant: Instant


class Workspace(NamedTuple):
    tangent: Tangent
    x: Any  # (3, n) where the step is balanced
    r: Any  # (n,)
    da: Any  # (n,)


@inner
def assemble_balance(
    cable: Cable, rolling_car: CarOnMesh | None, instant: Instant, x: Array, r: Array, tangent: Tangent,
    factors: Factors,
) -> MinTension:  # fmt: skip
    """Set the residual r of the cable, and of its car, and, unless the factors are 0, the tangent."""
    if rolling_car is None:
        return assemble_cable(cable, instant, x, r, tangent, factors)
    balance = assemble_cable_and_car(cable, rolling_car, instant, x, r, tangent, factors)
    return balance.min_tension, balance.min_at


@compiled
def solve_newmark_steps(
    cable: Cable, rolling_car: CarOnMesh | None, tangent: Tangent, bands: Array, steps: Steps, newton: Newton
) -> int:
    """Take steps; return how many converged before an event of the car, or before a slack element that ends them."""
    n = steps.start.shape[1]
    workspace = Workspace(tangent, np.empty_like(steps.start), np.empty(n), np.empty(n))
    for k in range(steps.rules.shape[0]):
        begin = steps.start if k == 0 else steps.ends[k - 1]
        instant = Instant(steps.inputs[k], bands, steps.coupling)
        if instant.inputs.size > 3:  # with a car, `assemble_cable_and_car` does this
            set_mass_damping_stiffness_bands(cable, instant)
        step = Step(begin, steps.ends[k], steps.rules[k], instant)
        result = steps.results[k]
        solve_newmark_step(cable, rolling_car, workspace, step, newton, result)
        norm = result[0]
        min_tension = result[4]
        slack = steps.slack_ends and not min_tension >= 0.0
        if slack or not (norm <= newton.bound and car_has_had_no_event(cable, rolling_car, steps.inputs[k], step.end)):
            return k
    return steps.rules.shape[0]


@inner
def solve_newmark_step(
    cable: Cable, rolling_car: CarOnMesh | None, workspace: Workspace, step: Step, newton: Newton, result: Array
) -> None:
    """Set the end of a step by Newton's method, and its row of `Steps.results`."""
    rule = step.rule
    r = workspace.r
    tangent = workspace.tangent
    patience = newton.patience if rolling_car is None else 0  # else another root near a support
    set_predicted_end_and_balance_states(step, workspace.x)
    factors = rule[0, 3] * rule[0, 4], rule[1, 3] * rule[1, 4], rule[2, 3] * rule[2, 4]
    norm = math.inf
    before = 0.0
    result[2] = 0
    result[3] = 0
    for iteration in range(newton.max_iter):
        if not norm <= newton.reuse * before:
            assemble_balance(cable, rolling_car, step.instant, workspace.x, r, tangent, factors)
            norm = math.sqrt(dot(r, r))
            factorise_in_place(tangent.ab, tangent.border)
            result[2] += 1
        before = norm
        solve_factored_in_place(tangent.ab, tangent.border, r)
        for j in range(r.size):  # a slice would compile its error message for seconds
            workspace.da[j] = r[j]
        result[1] = iteration + 1
        limit = math.inf if iteration < patience else before
        fraction = 1.0
        for _ in range(newton.halvings + 1):
            correct_end_and_balance_states(step, fraction, workspace.da, workspace.x)
            result[4], result[5] = assemble_balance(
                cable, rolling_car, step.instant, workspace.x, r, tangent, NO_TANGENT
            )
            result[3] += 1
            norm = math.sqrt(dot(r, r))
            if norm < limit:
                break
            fraction = -0.5 if fraction == 1.0 else 0.5 * fraction  # takes half of the correction back
        if norm <= newton.bound or not norm < math.inf:
            break
    result[0] = norm


@inner
def set_predicted_end_and_balance_states(step: Step, x: Array) -> None:
    """Set the end for no unknown, and x where the step is balanced, between begin and end."""
    begin = step.begin
    end = step.end
    rule = step.rule
    for i in range(3):
        w = rule[i, 4]
        for j in range(end.shape[1]):
            end[i, j] = rule[i, 0] * begin[0, j] + rule[i, 1] * begin[1, j] + rule[i, 2] * begin[2, j]
            x[i, j] = w * end[i, j] + (1.0 - w) * begin[i, j]


@inner
def correct_end_and_balance_states(step: Step, fraction: float, da: Array, x: Array) -> None:
    """Take a fraction of da from the unknown of the end, and set x again."""
    begin = step.begin
    end = step.end
    rule = step.rule
    for i in range(3):
        part = fraction * rule[i, 3]
        w = rule[i, 4]
        for j in range(end.shape[1]):
            end[i, j] -= part * da[j]
            x[i, j] = w * end[i, j] + (1.0 - w) * begin[i, j]
