"""Steps by Newton's method, for a mass that grips or a car that rolls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.kernels import rolling
from galerkin.kernels.cable import (
    Array,
    add_gripping_mass,
    min_tension,
    set_gripping_tangent,
    set_internal_force,
)
from galerkin.kernels.dense import empty_factors, set_factors, solve
from galerkin.kernels.instant import instant_at, kinematics_in_row, kinematics_of_state, points_at
from galerkin.law import compiled, inner


class Workspace(NamedTuple):
    balanced: Array  # (3, n_dof) the state that is balanced
    r: Array  # (n_dof,) its residual
    internal: Array  # (2, n) the internal force in it
    gram: Array  # (3, m) weighted tangent xx, xy, yy
    tensions: Array  # (m,) tension of the elastic law
    side_forces: Array  # (2, 2) int (N t - T t_static) ds behind and ahead of the mass
    K: Array  # (n_dof, n_dof)
    factors: tuple[Array, Array]  # of K, see `set_factors`
    step: Array  # (n_dof,)


@inner
def make_workspace(size, sines):
    m = sines.behind.shape[1] + sines.ahead.shape[1]
    n = sines.left.size + 1
    return Workspace(
        np.empty((3, size)), np.empty(size), np.empty((2, n)), np.empty((3, m)), np.empty(m), np.empty((2, 2)),
        np.empty((size, size)), empty_factors(size), np.empty(size),
    )  # fmt: skip


@inner
def copy(values, into):
    """Set into[:] = values; the slice would compile its error message for seconds."""
    a = values.reshape(values.size)
    b = into.reshape(into.size)
    for i in range(a.size):
        b[i] = a[i]


@compiled
def internal_forces_of_history(sines, s_o, Q, internal, strain):
    """`set_internal_force` at s_o (m,), Q (m, 2, n); set internal (m, 2, 2) to `side_forces`, and strain (m,)."""
    workspace = make_workspace(2 * Q.shape[2], sines)
    for i in range(strain.size):
        strain[i] = set_internal_force(points_at(sines, s_o[i]), Q[i], sines.cable, workspace.internal, workspace)
        copy(workspace.side_forces, internal[i])


@inner
def set_residual(now, ride, sines, workspace):
    """Set r, internal, gram, tensions and side_forces of `Workspace`; return the car if it rolls."""
    n = now.at_mass.inertia.f.size
    R = workspace.r[: 2 * n].reshape(2, n)
    coefficients = rolling.split_state(workspace.balanced, n)
    set_internal_force(now.points, coefficients.Q, sines.cable, R, workspace)
    if ride is None:
        add_gripping_mass(now.at_mass, coefficients, sines.cable, R)
        return rolling.NO_CAR
    return rolling.add_car_and_set_its_row(now.at_mass, ride, sines, workspace, R)


@compiled
def residual_and_derivatives(ride, sines, kinematics, state, r, parts):
    """Set r (n_dof,), and parts: the first len(parts) of dr/dq, dr/dv, dr/da, each (n_dof, n_dof).

    state : rows q, v, a
    Return the car, the least tension and its s.
    """
    workspace = make_workspace(state.shape[1], sines)
    now = instant_at(sines, kinematics)
    copy(state, workspace.balanced)
    out = set_residual(now, ride, sines, workspace)
    copy(workspace.r, r)
    for k in range(parts.shape[0]):
        c = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        set_tangent(now, ride, sines, workspace, out, c)
        copy(workspace.K, parts[k])
    return out, min_tension(now.points, kinematics[0], workspace.tensions)


@inner
def set_residual_between(now, ride, sines, ends, weights, workspace):
    """Evaluate w end + (1 - w) begin; return `Instant`, car and |r|, NaN off the cable."""
    begin, end = ends
    for k in range(3):
        for i in range(workspace.r.size):
            workspace.balanced[k, i] = weights[k] * end[k, i] + (1.0 - weights[k]) * begin[k, i]
    if ride is not None and ride.mode != rolling.HAULED:
        kinematics = kinematics_of_state(workspace.balanced)
        if not 0.0 < kinematics[0] < 1.0:
            return now, rolling.NO_CAR, math.nan
        now = instant_at(sines, kinematics)
    out = set_residual(now, ride, sines, workspace)
    square = 0.0
    for i in range(workspace.r.size):
        square += workspace.r[i] * workspace.r[i]
    return now, out, math.sqrt(square)


@inner
def set_tangent(now, ride, sines, workspace, out, c):
    n = now.at_mass.inertia.f.size
    set_gripping_tangent(now, sines, workspace.gram, c, workspace.K[: 2 * n, : 2 * n])
    if ride is not None:
        rolling.set_car_tangent(now, ride, sines, workspace, out, c)


@inner
def predict_end(rule, begin, end):
    for k in range(3):
        for i in range(begin.shape[1]):
            end[k, i] = rule[k, 0] * begin[0, i] + rule[k, 1] * begin[1, i] + rule[k, 2] * begin[2, i]


@inner
def correct_end(rule, end, step, share):
    for k in range(3):
        for i in range(step.size):
            end[k, i] -= share * rule[k, 3] * step[i]


@inner
def solve_step(now, ride, sines, ends, rule, newton, workspace):
    """Solve one step for its end, like `cablefem.newmark.find_root`.

    ends : start, and end to be set, (3, n_dof);  newton : `cablefem.newmark.Newton`
    Return |r|, counts of iterations, factorisations, evaluations, the least tension and its s.
    """
    weights = rule[:, 4]
    c = weights[0] * rule[0, 3], weights[1] * rule[1, 3], weights[2] * rule[2, 3]
    predict_end(rule, ends[0], ends[1])
    now, out, norm = set_residual_between(now, ride, sines, ends, weights, workspace)
    iterations = 0
    factorisations = 0
    evaluations = 0
    before = math.inf
    if math.isnan(norm):
        return norm, 1, 0, 1, math.inf, 0.0
    while iterations == 0 or (newton.bound < norm < math.inf and iterations < newton.max_iter):
        if iterations == 0 or norm > newton.reuse * before:
            factorisations += 1
            set_tangent(now, ride, sines, workspace, out, c)
            set_factors(workspace.K, workspace.factors)
        copy(workspace.r, workspace.step)
        solve(workspace.factors, workspace.step)
        before = norm
        share = 1.0
        for _ in range(newton.halvings + 1):
            correct_end(rule, ends[1], workspace.step, share)
            now, out, norm = set_residual_between(now, ride, sines, ends, weights, workspace)
            evaluations += 1
            if norm < before or (iterations < newton.patience and norm < math.inf):
                break
            share = -0.5 * abs(share)  # take back half of the last one
        iterations += 1
    lowest, where = min_tension(now.points, now.at_mass.s_o, workspace.tensions)
    return norm, iterations, factorisations, evaluations, lowest, where


@compiled
def solve_steps(ride, history, sines, kinematics, start, rules, newton):
    """Take m steps, up to one that fails, falls slack or ends in an event of the `CarHistory`.

    kinematics : (m, 3) s_o, ds_o, dds_o;  for a free car (1, 3), those at the start
    Return the number of good steps, their ends (m, 3, n_dof), and results of `solve_step` (m, 6).
    """
    m = rules.shape[0]
    size = start.shape[1]
    ends = np.empty((m, 3, size))
    results = np.full((m, 6), math.nan)
    workspace = make_workspace(size, sines)
    now_ride = ride
    now = instant_at(sines, kinematics_in_row(kinematics, 0))
    if history is not None:
        now_car = rolling.car_by_slopes(ride.loads, sines, kinematics_in_row(kinematics, 0), start)
    for i in range(m):
        rule = rules[i]
        begin = start if i == 0 else ends[i - 1]
        if history is not None and history.t.size > 0 and ride.mode != rolling.HAULED:
            now_ride = rolling.record_car_and_update_ride(ride, history, rule, i, now_car)
        elif i > 0:
            now = instant_at(sines, kinematics_in_row(kinematics, i))
        result = solve_step(now, now_ride, sines, (begin, ends[i]), rule, newton, workspace)
        results[i, 0], results[i, 1], results[i, 2], results[i, 3], results[i, 4], results[i, 5] = result
        slack = sines.cable.slack_ends and not result[4] >= 0.0
        if slack or not result[0] <= newton.bound:
            return i, ends, results
        if history is not None and history.t.size > 0:
            now_car = rolling.car_at_step_end(ride, history, sines, kinematics, rule, i, ends[i])
            if rolling.has_event(ride, history, ends[i], now_car):
                return i, ends, results
    return m, ends, results
