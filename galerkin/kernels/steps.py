"""Steps by Newton's method, for a mass that grips or a car that rolls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.kernels import rolling
from galerkin.kernels.cable import Array, balance, damp, grip, grip_tangent, least
from galerkin.kernels.dense import factorise, factors_for, solve
from galerkin.kernels.places import free_place, moment, place_of, points_at
from galerkin.kernels.riding import riding_tangent, solve_sides
from galerkin.law import compiled, inner


class Space(NamedTuple):
    balanced: Array  # (3, n_dof) the state that is balanced
    r: Array  # (n_dof,) its residual
    internal: Array  # (2, n) the internal force in it
    gram: Array  # (3, m) weighted tangent xx, xy, yy
    pull: Array  # (m,) tension of the elastic law, with internal damping
    sides: Array  # (2, 2) int (N t - T t_static) ds behind and ahead of the mass
    K: Array  # (1, n_dof, n_dof); riding sines: see `riding_tangent`
    factors: tuple[Array, Array]  # of K, see `factorise`; riding sines have none
    step: Array  # (n_dof,)
    viscous: Array  # (m,) tension of internal damping
    rates: Array  # (5, m) t (2), then weighted: dN/d(deps/dt) d(deps/dt)/dr' (2), and dN/d(deps/dt)


@inner
def space_for(size, line):
    m = line.behind.shape[1] + line.ahead.shape[1]
    n = line.left.size + 1
    K = np.empty((1, size, size)) if line.riding is None else np.empty((2, size // 2 + 1, size // 2 + 1))
    return Space(
        np.empty((3, size)), np.empty(size), np.empty((2, n)), np.empty((3, m)), np.empty(m), np.empty((2, 2)), K,
        factors_for(size if line.riding is None else 0), np.empty(size), np.zeros(m), np.empty((5, m)),
    )  # fmt: skip


@inner
def copy(values, into):
    """Set into[:] = values; the slice would compile its error message for seconds."""
    a = values.reshape(values.size)
    b = into.reshape(into.size)
    for i in range(a.size):
        b[i] = a[i]


@inner
def strained(at, place, y, line, riding, R, of):
    """`balance` with internal damping; return int W ds and the power of damping."""
    lost = 0.0
    if riding is not None and line.tau > 0.0:
        lost = damp(at, place, y, line.cable, line.tau, of)
    return balance(at, y[0], line.cable, R, of), lost


@compiled
def surveyed(line, places, Q, V, internal, strain, lost):
    """`strained` of states Q, V (m, 2, n); set internal (m, 2, 2) to `sides`, and strain, lost (m,)."""
    of = space_for(2 * Q.shape[2], line)
    for i in range(strain.size):
        at = points_at(line, places[i, 0])
        R = of.internal
        strain[i], lost[i] = strained(at, place_of(places, i), (Q[i], V[i]), line, line.riding, R, of)
        copy(of.sides, internal[i])


@inner
def evaluate(here, ride, line, of):
    """Set r, internal, gram, pull and sides of `Space`; return the car if it rolls."""
    n = here.ground.x.f.size
    R = of.r[: 2 * n].reshape(2, n)
    y = rolling.coefficients(of.balanced, n)
    strained(here.at, (here.ground.s_o, here.ground.ds_o), (y.Q, y.V), line, line.riding, R, of)
    if ride is None:
        grip(here.ground, y, line.cable, R)
        return rolling.NO_CAR
    return rolling.ride_on(here.ground, ride, line, of, R)


@compiled
def look(ride, line, place, state, r, parts):
    """Set r (n_dof,), and parts: the first len(parts) of dr/dq, dr/dv, dr/da, each like `Space.K`.

    state : rows q, v, a
    Return the car, the least tension and its s.
    """
    of = space_for(state.shape[1], line)
    here = moment(line, place)
    copy(state, of.balanced)
    out = evaluate(here, ride, line, of)
    copy(of.r, r)
    for k in range(parts.shape[0]):
        c = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        set_tangent(line.riding, here, ride, line, of, out, c)
        copy(of.K, parts[k])
    return out, least(here.at, place[0], of.pull, line.riding)


@inner
def weigh(here, ride, line, ends, w, of):
    """Evaluate w end + (1 - w) begin; return `Moment`, car and |r|, NaN off the cable."""
    begin, end = ends
    for k in range(3):
        for i in range(of.r.size):
            of.balanced[k, i] = w[k] * end[k, i] + (1.0 - w[k]) * begin[k, i]
    if ride is not None and ride.mode != rolling.HAULED:
        place = free_place(of.balanced)
        if not 0.0 < place[0] < 1.0:
            return here, rolling.NO_CAR, math.nan
        here = moment(line, place)
    out = evaluate(here, ride, line, of)
    square = 0.0
    for i in range(of.r.size):
        square += of.r[i] * of.r[i]
    return here, out, math.sqrt(square)


@inner
def set_tangent(riding, here, ride, line, of, out, c):
    if riding is None:
        n = here.ground.x.f.size
        grip_tangent(here, line, of.gram, c, of.K[0, : 2 * n, : 2 * n])
        if ride is not None:
            rolling.ride_tangent(here, ride, line, of, out, c)
    else:
        riding_tangent(riding, here.ground, line, of, c)


@inner
def solve_for(riding, of):
    """Set the step of `Space` to K^-1 r."""
    if riding is None:
        copy(of.r, of.step)
        solve(of.factors, of.step)
    else:
        solve_sides(of.K, of.r, of.step)


@inner
def predict(rule, begin, end):
    for k in range(3):
        for i in range(begin.shape[1]):
            end[k, i] = rule[k, 0] * begin[0, i] + rule[k, 1] * begin[1, i] + rule[k, 2] * begin[2, i]


@inner
def correct(rule, end, step, share):
    for k in range(3):
        for i in range(step.size):
            end[k, i] -= share * rule[k, 3] * step[i]


@inner
def solve_step(here, ride, line, ends, rule, newton, of):
    """Solve one step for its end, like `cablefem.newmark.find_root`.

    ends : start, and end to be set, (3, n_dof);  newton : `cablefem.newmark.Newton`
    Return |r|, counts of iterations, factorisations, evaluations, the least tension and its s.
    """
    w = rule[:, 4]
    c = w[0] * rule[0, 3], w[1] * rule[1, 3], w[2] * rule[2, 3]
    predict(rule, ends[0], ends[1])
    here, out, norm = weigh(here, ride, line, ends, w, of)
    iterations = 0
    factorisations = 0
    evaluations = 0
    before = math.inf
    if math.isnan(norm):
        return norm, 1, 0, 1, math.inf, 0.0
    while iterations == 0 or (newton.bound < norm < math.inf and iterations < newton.max_iter):
        if iterations == 0 or norm > newton.reuse * before:
            factorisations += 1
            set_tangent(line.riding, here, ride, line, of, out, c)
            if line.riding is None:
                factorise(of.K[0], of.factors)
        solve_for(line.riding, of)
        before = norm
        share = 1.0
        for _ in range(newton.halvings + 1):
            correct(rule, ends[1], of.step, share)
            here, out, norm = weigh(here, ride, line, ends, w, of)
            evaluations += 1
            if norm < before or (iterations < newton.patience and norm < math.inf):
                break
            share = -0.5 * abs(share)  # take back half of the last one
        iterations += 1
    lowest, where = least(here.at, here.ground.s_o, of.pull, line.riding)
    return norm, iterations, factorisations, evaluations, lowest, where


@compiled
def solve_steps(ride, course, line, places, start, rules, newton):
    """Take m steps, up to one that fails, falls slack or ends in an event of the `Course`.

    places : (m, 3) s_o, ds_o, dds_o;  for a free car (1, 3), those at the start
    Return the number of good steps, their ends (m, 3, n_dof), and results of `solve_step` (m, 6).
    """
    m = rules.shape[0]
    size = start.shape[1]
    now = np.empty((m, 3, size))
    told = np.full((m, 6), math.nan)
    of = space_for(size, line)
    now_ride = ride
    here = moment(line, place_of(places, 0))
    if course is not None:
        now_car = rolling.seen(ride.on, line, place_of(places, 0), start)
    for i in range(m):
        rule = rules[i]
        begin = start if i == 0 else now[i - 1]
        if course is not None and course.t.size > 0 and ride.mode != rolling.HAULED:
            now_ride = rolling.begin_step(ride, course, rule, i, now_car)
        elif i > 0:
            here = moment(line, place_of(places, i))
        found = solve_step(here, now_ride, line, (begin, now[i]), rule, newton, of)
        told[i, 0], told[i, 1], told[i, 2], told[i, 3], told[i, 4], told[i, 5] = found
        slack = line.cable.slack_ends and not found[4] >= 0.0
        if slack or not found[0] <= newton.bound:
            return i, now, told
        if course is not None and course.t.size > 0:
            now_car = rolling.end_step(ride, course, line, places, rule, i, now[i])
            if rolling.has_event(ride, course, now[i], now_car):
                return i, now, told
    return m, now, told
