"""Steps by Newton's method: of a mass that grips, and of a car that rolls."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from galerkin.bases.fourier import split, values_at
from galerkin.bases.kink import Carried, carry
from galerkin.bases.riding import ride as carry_riding
from galerkin.bases.riding import spread
from galerkin.kernels.cable import (
    Array,
    Cable,
    Points,
    acceleration,
    add_inertia,
    add_inertia_tangent,
    add_rates,
    balance,
    least,
    static,
    stiffness,
    survey,
)
from galerkin.kernels.dense import solve
from galerkin.kernels.riding import add_rate_tangent, riding_tangent, solve_sides
from galerkin.kernels.rolling import (
    NO_CAR,
    STEP,
    Coefficients,
    Ground,
    Rolling,
    averaged,
    car,
    motion,
    pulls,
    roll,
    row,
)
from galerkin.law import compiled, inner

STUCK, FREE, HAULED = 0, 1, 2


class Line(NamedTuple):
    """The cable over sines with a hat, and rules for its integrals."""

    cable: Cable
    behind: Array  # Gauss rules on [0, 1] of both sides, (2, m)
    ahead: Array
    mass: Array  # these three of `Moving`
    left: Array
    chord: Array
    grading: float
    riding: Any = None  # `Tables` of sines that ride with the mass; `mass`, `left` and `chord` have their sizes alone
    tau: Any = None  # of internal damping, with `riding`


class Ride(NamedTuple):
    """A rolling car in a step."""

    mode: int  # FREE, STUCK: the last unknown is s_o; HAULED: its acceleration is the haul force
    on: Rolling
    thrust: float
    s_o: float  # these three of a hauled car
    ds_o: float
    dds_o: float


class Course(NamedTuple):
    """A car between two events."""

    t: Array  # (m,) balances of the steps
    places: Array  # (m, 3) there s_o, ds_o, dds_o of a hauled car
    thrust: Array  # (m,) there
    past: Array  # (k + m, 3) for `averaged`, m rows still empty
    window: float
    smooth: Array  # (6,) what `averaged` returns for the last step
    low: float  # between these the car has to stay
    high: float
    sign: float  # of ds_o, 0 where it may turn round
    forward: float  # of its speed
    slow: float  # the least speed
    lifted: bool


class Moment(NamedTuple):
    """Points and ground of an instant."""

    at: Points
    ground: Ground


class Space(NamedTuple):
    """Work arrays of a step."""

    balanced: Array  # (3, n_dof) the state that is weighed
    r: Array  # (n_dof,) its residual
    internal: Array  # (2, n) the internal force in it
    gram: Array  # (3, m), `pull` and `sides` see `balance`
    pull: Array
    sides: Array
    K: Array  # (1, n_dof, n_dof); riding sines: see `riding_tangent`
    step: Array  # (n_dof,)
    rates: Any  # None, or (5, m) see `add_rates`


@inner
def space_for(size, line):
    m, n = line.behind.shape[1] + line.ahead.shape[1], line.left.size + 1
    return Space(
        np.empty((3, size)), np.empty(size), np.empty((2, n)), np.empty((3, m)), np.empty(m), np.empty((2, 2)),
        tangent_for(line.riding, size), np.empty(size), rates_for(line.tau, m),
    )  # fmt: skip


@inner
def rates_for(tau, m):
    if tau is None:
        return None
    return np.empty((5, m))


@inner
def tangent_for(riding, size):
    if riding is None:
        return np.empty((1, size, size))
    return np.empty((2, size // 2 + 1, size // 2 + 1))


@inner
def carried_at(line, riding, s_o, ds_o, dds_o):
    if riding is None:
        at = values_at(s_o, line.left.size, line.grading)
        M, rows = carry(at, line.mass, line.left, line.chord, s_o, ds_o, dds_o, line.cable.damping)
        return Carried(M, rows[0:1], rows[1:2], rows[2], rows[3], rows[4], rows[5], rows[6])
    M, gyroscopic, centrifugal = carry_riding(riding, s_o, ds_o, dds_o, line.cable.damping)
    at_mass, none = np.zeros(M.shape[0]), np.zeros(M.shape[0])
    at_mass[-1] = 1.0
    return Carried(M, gyroscopic, centrifugal, at_mass, none, none, none, none)


@inner
def ground_at(line, s_o, ds_o, dds_o):
    """`Ground` where the mass is at s_o; the load of a force alone is its weight."""
    cable = line.cable
    x = carried_at(line, line.riding, s_o, ds_o, dds_o)
    p = cable.c - cable.sigma * s_o
    T = math.sqrt(1.0 + p * p)
    slope, load = np.empty(2), np.zeros(2)
    slope[0], slope[1] = 1.0 / T, p / T
    if cable.inertia != 0.0:
        load[0] = dds_o / T + ds_o * ds_o * cable.sigma * p / T**3
        load[1] = dds_o * p / T - ds_o * ds_o * cable.sigma / T**3
    load[1] -= cable.sigma
    return Ground(x, slope, load, s_o, ds_o, dds_o)


@inner
def spread_at(line, riding, s_o):
    if riding is None:
        return split(s_o, line.behind, line.ahead, line.left.size, line.grading)
    return spread(riding, riding.slope, s_o)


@inner
def bend_at(riding, tau, s_o):
    if tau is None:
        return None
    return spread(riding, riding.bend, s_o)[2]


@inner
def points_at(line, s_o):
    s, weights, phi = spread_at(line, line.riding, s_o)
    T, r_static = static(s, line.cable.sigma, line.cable.c)
    return Points(s, phi, weights, T, r_static, bend_at(line.riding, line.tau, s_o))


@inner
def moment(line, s_o, ds_o, dds_o):
    return Moment(points_at(line, s_o), ground_at(line, s_o, ds_o, dds_o))


@inner
def strained(here, y, cable, tau, R, of):
    """Set the internal force R, gram, pull, sides and rates; return the power of internal damping."""
    balance(here.at, y.Q, cable, R, of.gram, of.pull, of.sides)
    if tau is None:
        return 0.0
    return add_rates(here.at, here.ground, y.Q, y.V, cable, tau, R, of.gram, of.pull, of.sides, of.rates)


@compiled
def lost(line, places, states, internal, power):
    """Set `internal` of `survey` and the power that internal damping takes, of states (m, 3, n_dof)."""
    of = space_for(states.shape[2], line)
    n = of.r.size // 2
    for i in range(power.size):
        here = moment(line, places[i, 0], places[i, 1], places[i, 2])
        power[i] = strained(here, coefficients(states[i], n), line.cable, line.tau, of.r.reshape(2, n), of)
        for side in range(2):
            internal[i, 0, side], internal[i, 1, side] = of.sides[side, 0], of.sides[side, 1]


@compiled
def weighed(line, place, state, r, parts):
    """`look` of a mass that grips over riding sines; parts (3 or 0, 2, 2 n + 2, 2 n + 2) as `riding_tangent`."""
    of = space_for(state.shape[1], line)
    here = moment(line, place[0], place[1], place[2])
    of.balanced[:] = state
    out = evaluate(here, None, line, of)
    r[:] = of.r
    for k in range(parts.shape[0]):
        c = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        set_tangent(line.riding, here, None, line, of, out, c)
        parts[k] = of.K
    return least(here.at, place[0], of.pull, line.riding)


@compiled
def surveyed(line, s_o, Q, internal, strain):
    """`survey` of states Q (m, 2, n) with the mass at s_o (m,)."""
    for i in range(s_o.size):
        strain[i] = survey(points_at(line, s_o[i]), Q[i], line.cable, internal[i])


@inner
def travel(ride, state):
    last = state.shape[1] - 1
    if ride.mode == HAULED:
        return ride.s_o, ride.ds_o, ride.dds_o
    return state[0, last], state[1, last], state[2, last]


@inner
def coefficients(state, n):
    return Coefficients(
        state[0, : 2 * n].reshape(2, n), state[1, : 2 * n].reshape(2, n), state[2, : 2 * n].reshape(2, n)
    )


@compiled
def seen(ride, line, state):
    """`car` at a state, rows q, v, a, by the slopes of the basis and without thrust."""
    s_o, ds_o, dds_o = travel(ride, state)
    here = ground_at(line, s_o, ds_o, dds_o)
    velocity, p, behind, ahead = motion(here, coefficients(state, line.left.size + 1))
    p[1] += line.cable.sigma
    return car(ride.on, 0.0, velocity, p, behind, ahead)


@inner
def evaluate(here, ride, line, of):
    """Set residual, internal force, gram, pull and sides; return the car where it rolls."""
    x, cable = here.ground.x, line.cable
    n = x.f.size
    R, y = of.r[: 2 * n].reshape(2, n), coefficients(of.balanced, n)
    strained(here, y, cable, line.tau, R, of)
    if ride is None:
        C = acceleration(x, y.Q, y.V, y.A)
        for a in range(2):
            C[a] = cable.inertia * C[a] + cable.mu * here.ground.load[a]
        add_inertia(x, y.Q, y.V, y.A, cable.damping, C, R)
        return NO_CAR
    for a in range(2):
        for i in range(n):
            of.internal[a, i] = R[a, i]
    force = of.balanced[2, 2 * n]
    thrust = force if ride.mode == HAULED else ride.thrust
    out = roll(here.ground, y, of.sides, cable, ride.on, thrust, R)
    of.r[2 * n] = cable.mu * force if ride.mode == STUCK else out.car.defect
    return out


@inner
def tangent(here, ride, line, of, out, c, K):
    """Set K to c0 dr/dq + c1 dr/dv + c2 dr/da after `evaluate`, which returned `out`.

    The column of s_o is a difference without dr/ds_o.
    """
    at, ground = here
    c0, c1, c2 = c
    n = ground.x.f.size
    last = 2 * n
    block = K[:last, :last]
    stiffness(at.phi, of.gram, line.grading, block)
    add_inertia_tangent(ground.x, line.cable.inertia, line.cable.damping, c0, c1, c2, block)
    if ride is None:
        return
    for i in range(last + 1):
        K[last, i] = K[i, last] = 0.0
    if ride.mode == STUCK:
        K[last, last] = c2 * line.cable.mu
        return
    row(ground, out, pulls(at.phi, of.gram), ride.on, line.cable.damping, c, K[last])
    if ride.mode == HAULED:
        for i in range(n):
            K[i, last], K[n + i, last] = -c2 * out.car.tx * ground.x.f[i], -c2 * out.car.ty * ground.x.f[i]
        K[last, last] = -c2
    elif c1 + c2 != 0.0:
        h, R = STEP / (c1 + c2), np.zeros((2, n))
        moved = ground_at(line, of.balanced[0, last], ground.ds_o + h * c1, ground.dds_o + h * c2)
        y = coefficients(of.balanced, n)
        other = roll(moved, y, of.sides, line.cable, ride.on, ride.thrust, R).car
        K[last, last] = (other.defect - out.car.defect) / h
        for a in range(2):
            for i in range(n):
                K[a * n + i, last] = (R[a, i] + of.internal[a, i] - of.r[a * n + i]) / h


@compiled
def look(ride, line, state, r, parts):
    """Set r, and as many of dr/dq, dr/dv, dr/da as parts (3 or 0, n_dof, n_dof) holds; state : rows q, v, a.

    Return the car, the least tension and its s.
    """
    of = space_for(state.shape[1], line)
    s_o, ds_o, dds_o = travel(ride, state)
    here = moment(line, s_o, ds_o, dds_o)
    of.balanced[:] = state
    out = evaluate(here, ride, line, of)
    r[:] = of.r
    for k in range(parts.shape[0]):
        c = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        tangent(here, ride, line, of, out, c, parts[k])
    return out, least(here.at, s_o, of.pull)


@inner
def weigh(here, ride, line, ends, w, of):
    """Evaluate w end + (1 - w) begin; return its moment, car and |r|, NaN off the cable."""
    begin, end = ends
    for k in range(3):
        for i in range(of.r.size):
            of.balanced[k, i] = w[k] * end[k, i] + (1.0 - w[k]) * begin[k, i]
    if ride is not None and ride.mode != HAULED:
        s_o, ds_o, dds_o = travel(ride, of.balanced)
        if not 0.0 < s_o < 1.0:
            return here, NO_CAR, math.nan
        here = moment(line, s_o, ds_o, dds_o)
    out = evaluate(here, ride, line, of)
    square = 0.0
    for i in range(of.r.size):
        square += of.r[i] * of.r[i]
    return here, out, math.sqrt(square)


@inner
def set_tangent(riding, here, ride, line, of, out, c):
    if riding is None:
        tangent(here, ride, line, of, out, c, of.K[0])
    else:
        riding_tangent(riding, here.ground, of.gram, line.cable, c, of.K)
        set_rate_tangent(riding, here.ground, of.rates, c, of.K)


@inner
def set_rate_tangent(riding, ground, rates, c, K):
    if rates is not None:
        add_rate_tangent(riding, ground, rates, c, K)


@inner
def solve_for(riding, K, r, step):
    if riding is None:
        solve(K[0], r, step)
    else:
        solve_sides(K, r, step)


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
def newton(here, ride, line, ends, rule, limits, of):
    """Solve one step for its end, as `cablefem.newmark.iterate` does.

    ends : start, and end to be set, (3, n_dof);  limits : bound of |r|, max_iter, reuse, patience, most halvings
    Return |r|, counts of iterations, factorisations, evaluations, the least tension and its s.
    """
    bound, most, reuse, patience, halvings = limits
    w = rule[:, 4]
    c = w[0] * rule[0, 3], w[1] * rule[1, 3], w[2] * rule[2, 3]
    predict(rule, ends[0], ends[1])
    here, out, norm = weigh(here, ride, line, ends, w, of)
    iterations, factorisations, evaluations, before = 0, 0, 0, math.inf
    if math.isnan(norm):
        return norm, 1, 0, 1, math.inf, 0.0
    while iterations == 0 or (bound < norm < math.inf and iterations < most):
        if iterations == 0 or norm > reuse * before:
            factorisations += 1
            set_tangent(line.riding, here, ride, line, of, out, c)
        solve_for(line.riding, of.K, of.r, of.step)
        before, share = norm, 1.0
        for _ in range(int(halvings) + 1):
            correct(rule, ends[1], of.step, share)
            here, out, norm = weigh(here, ride, line, ends, w, of)
            evaluations += 1
            if norm < before or (iterations < patience and norm < math.inf):
                break
            share = -0.5 * abs(share)  # take back half of the last one
        iterations += 1
    lowest, where = least(here.at, here.ground.s_o, of.pull, line.riding)
    return norm, iterations, factorisations, evaluations, lowest, where


@compiled
def stride(line, places, start, rules, limits):
    """Steps of a mass that grips at places (m, 3) s_o, ds_o, dds_o, until one fails or is slack.

    Return how many are good, their ends (m, 3, n_dof), and results of `newton`, (m, 6).
    """
    m, size = rules.shape[0], start.shape[1]
    now, told, of = np.empty((m, 3, size)), np.full((m, 6), math.nan), space_for(size, line)
    for i in range(m):
        here = moment(line, places[i, 0], places[i, 1], places[i, 2])
        found = newton(here, None, line, (start if i == 0 else now[i - 1], now[i]), rules[i], limits, of)
        tell(found, told[i])
        if not (found[0] <= limits[0] and found[4] >= 0.0):
            return i, now, told
    return m, now, told


@inner
def tell(found, told):
    told[0], told[1], told[2], told[3], told[4], told[5] = found


@compiled
def roll_on(ride, course, line, start, rules, limits):
    """`stride` of a car that rolls: one step, or with a `Course` steps up to an event."""
    m, size = rules.shape[0], start.shape[1]
    now, told, of, now_ride = np.empty((m, 3, size)), np.full((m, 6), math.nan), space_for(size, line), ride
    here = moment(line, ride.s_o, ride.ds_o, ride.dds_o)
    if course is not None:
        first, newest, now_car = 0, course.past.shape[0] - m, seen(ride, line, start)
    for i in range(m):
        rule = rules[i]
        if course is not None and ride.mode == HAULED:
            now_ride = Ride(ride.mode, ride.on, 0.0, course.places[i, 0], course.places[i, 1], course.places[i, 2])
            here = moment(line, now_ride.s_o, now_ride.ds_o, now_ride.dds_o)
        elif course is not None:
            t0, past = course.t[i] - rule[0, 4] * rule[0, 1], course.past
            past[newest, 0], past[newest, 1], past[newest, 2] = t0, now_car.vx, now_car.vy
            smooth = averaged(past, first, newest, course.window)
            first, newest = int(smooth[0]), newest + 1
            for k in range(6):
                course.smooth[k] = smooth[k]
            now_ride = at_time(ride, smooth, course.t[i], course.thrust[i])
        found = newton(here, now_ride, line, (start if i == 0 else now[i - 1], now[i]), rule, limits, of)
        tell(found, told[i])
        if not (found[0] <= limits[0] and found[4] >= 0.0):
            return i, now, told
        if course is not None:
            end = now_ride if ride.mode == HAULED else at_time(ride, smooth, t0 + rule[0, 1], 0.0)
            now_car = seen(end, line, now[i])
            if lifts(course, now_car) or (ride.mode != HAULED and has_event(course, now[i], now_car)):
                return i, now, told
    return m, now, told


@inner
def at_time(ride, smooth, t, thrust):
    """`Ride` at t by `averaged`."""
    d, on = t - smooth[1], ride.on
    ax, ay = smooth[2] + d * smooth[4], smooth[3] + d * smooth[5]
    on = Rolling(on.mu, on.sigma, on.drag, on.wind, on.hold, on.rub, on.brake, ax, ay)
    return Ride(ride.mode, on, thrust, ride.s_o, ride.ds_o, ride.dds_o)


@inner
def has_event(course, end, car):
    last = end.shape[1] - 1
    s_o, ds_o = end[0, last], end[1, last]
    if not course.low < s_o < course.high or (course.sign != 0.0 and not course.sign * ds_o > 0.0):
        return True
    return not course.forward * car.speed > course.slow


@inner
def lifts(course, car):
    return not (course.lifted or max(car.pressing, car.normal) > 0.0)
