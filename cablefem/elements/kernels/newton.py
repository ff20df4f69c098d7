"""Compiled Newton's method for steps of Newmark's family."""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import compiled, inner
from cablefem.elements.kernels.balance import Instant, assemble, assemble_inertia_and_damping
from cablefem.elements.kernels.banded import dot, factorise_in_place, solve
from cablefem.elements.kernels.car import assemble_with_car, is_before_event

NO_TANGENT = 0.0, 0.0, 0.0


class Steps(NamedTuple):
    """Consecutive steps, see `cablefem.newmark.System.solve_step`."""

    inputs: Any  # (m, 3 + n_fields) see `balance.Instant`; with a car (m, 3), see `car.Car`
    contact: Any
    start: Any  # (3, n)
    rules: Any  # (m, 3, 5)
    ends: Any  # (m, 3, n) output
    results: Any  # (m, 6) output: |r|, iterations, factorisations, residuals, least tension, its s
    slack_ends: bool  # whether they may end at a slack state only


@inner
def assemble_balance(cable, rolling_car, now, x, r, tangent, factors):
    """Set r and, unless the factors are 0, the tangent; return the least tension and its s."""
    if rolling_car is None:
        return assemble(cable, now, x, r, tangent, factors)
    min_tension, min_at, _, _ = assemble_with_car(cable, rolling_car, now, x, r, tangent, factors)
    return min_tension, min_at


@compiled
def solve_steps(cable, rolling_car, tangent, bands, steps, newton):
    """Take steps; return how many converged before an event of the car, or before a slack element that ends them.

    newton : `cablefem.newmark.Newton`.
    """
    n = steps.start.shape[1]
    x = np.empty_like(steps.start)
    bound = newton.bound
    r = np.empty(n)
    da = np.empty(n)
    patience = newton.patience if rolling_car is None else 0  # else another root near a support
    for k in range(steps.rules.shape[0]):
        begin = steps.start if k == 0 else steps.ends[k - 1]
        end = steps.ends[k]
        rule = steps.rules[k]
        now = Instant(steps.inputs[k], bands, steps.contact)
        if now.inputs.size > 3:  # with a car, `assemble_with_car` does this
            assemble_inertia_and_damping(cable, now)
        predict_end_and_balance_state(begin, rule, end, x)
        factors = rule[0, 3] * rule[0, 4], rule[1, 3] * rule[1, 4], rule[2, 3] * rule[2, 4]
        norm = math.inf
        before = 0.0
        factorisations = 0
        residuals = 0
        min_tension = math.inf
        min_at = 0.0
        for iteration in range(newton.max_iter):
            if not norm <= newton.reuse * before:
                assemble_balance(cable, rolling_car, now, x, r, tangent, factors)
                norm = math.sqrt(dot(r, r))
                factorise_in_place(tangent.ab, tangent.border)
                factorisations += 1
            before = norm
            solve(tangent.ab, tangent.border, r)
            for j in range(n):
                da[j] = r[j]
            fraction = 1.0
            for _ in range(newton.halvings + 1):
                correct_end_and_balance_state(begin, rule, fraction, da, end, x)
                min_tension, min_at = assemble_balance(cable, rolling_car, now, x, r, tangent, NO_TANGENT)
                residuals += 1
                norm = math.sqrt(dot(r, r))
                if norm < before or (iteration < patience and norm < math.inf):
                    break
                fraction = -0.5 if fraction == 1.0 else 0.5 * fraction  # takes half of the correction back
            if norm <= bound or not norm < math.inf:
                break
        result = steps.results[k]
        result[0] = norm
        result[1] = iteration + 1
        result[2] = factorisations
        result[3] = residuals
        result[4] = min_tension
        result[5] = min_at
        slack = steps.slack_ends and not min_tension >= 0.0
        if slack or not (norm <= bound and is_before_event(cable, rolling_car, steps.inputs[k], end)):
            return k
    return steps.rules.shape[0]


@inner
def predict_end_and_balance_state(begin, rule, end, x):
    """Set the end for no unknown, and x where the step is balanced, between begin and end."""
    for i in range(3):
        w = rule[i, 4]
        for j in range(end.shape[1]):
            end[i, j] = rule[i, 0] * begin[0, j] + rule[i, 1] * begin[1, j] + rule[i, 2] * begin[2, j]
            x[i, j] = w * end[i, j] + (1.0 - w) * begin[i, j]


@inner
def correct_end_and_balance_state(begin, rule, fraction, da, end, x):
    """Take a fraction of da from the unknown of the end, and set x again."""
    for i in range(3):
        part = fraction * rule[i, 3]
        w = rule[i, 4]
        for j in range(end.shape[1]):
            end[i, j] -= part * da[j]
            x[i, j] = w * end[i, j] + (1.0 - w) * begin[i, j]
