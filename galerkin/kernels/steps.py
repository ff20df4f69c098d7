"""Newton's method of steps, with a mass that grips or a car that rolls; sines with a hat make their own instants."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.bases.fourier import split, values_at
from galerkin.bases.kink import Carried, carry
from galerkin.bow import bent, slopes
from galerkin.kernels.cable import (
    Array,
    Points,
    acceleration,
    add_inertia,
    add_inertia_tangent,
    balance,
    least,
    static,
    static_at,
    stiffness,
    survey,
)
from galerkin.kernels.dense import solve
from galerkin.kernels.rolling import STEP, Rolling, add_shed_tangent, averaged, car, motion, pulls, roll, row
from galerkin.law import compiled

NO_CAR = (0.0,) * 18
STUCK, FREE, HAULED = 0, 1, 2


class Ride(NamedTuple):
    """A rolling car in a step, over sines with a hat."""

    mode: int  # FREE: the last unknown is s_o; STUCK: it stays; HAULED: its acceleration is the haul force
    on: Rolling
    thrust: float
    ds_o: float  # of a hauled car
    dds_o: float
    behind: Array  # rules of both sides, (2, m)
    ahead: Array
    mass: Array  # M without the moving overlaps, and what `_carry` wants to know
    left: Array
    chord: Array
    thirds: Array
    grading: float
    c: float
    bows: Array  # `galerkin.bow.table`


class Course(NamedTuple):
    """What a free car needs besides for many steps between two events."""

    t: Array  # (m,) balances of the steps
    thrust: Array  # (m,) there
    past: Array  # (k + m, 3) for `averaged`; of m rows nothing is known yet
    window: float
    smooth: Array  # (6,) receives what `averaged` tells of the last step
    low: float  # between these the car has to stay
    high: float
    sign: float  # of ds_o, 0 where it may turn round
    forward: float  # of its speed
    slow: float  # the least speed
    lifted: bool  # whether lift-off is none any more


class Grip(NamedTuple):
    """A mass that grips the cable, over sines with a hat; see `Ride`."""

    behind: Array
    ahead: Array
    mass: Array
    left: Array
    chord: Array
    thirds: Array
    grading: float
    c: float
    bows: Array


class Cable(NamedTuple):
    """The full cable with its car, as long as the law stays, and how tangents are made."""

    inertia: float  # of the mass; 0: its weight alone
    mu: float
    alpha: float
    law: int
    harmonic: bool  # see `stiffness`
    grading: float
    hat: int


class Moment(NamedTuple):
    """What an instant brings, whatever the state."""

    at: Points
    x: Carried
    slope: Array  # X' at the mass
    load: Array  # (2,) acceleration of the mass along its static path less gravity
    bows: Array  # `galerkin.bow.bent`


@compiled
def ground(on, sigma, s_o, ds_o, dds_o):
    """`Moment` where the mass is at s_o, but for the points; on : `Ride` or `Grip`."""
    at = values_at(s_o, on.left.size, on.grading)
    M, rows = carry(at, on.mass, on.left, on.chord, on.thirds, s_o, ds_o, dds_o)
    x = Carried(M, rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6], rows[7:])
    rest, load = static_at(s_o, sigma, on.c), np.empty(2)
    for a in range(2):
        load[a] = dds_o * rest[0, a] + ds_o * ds_o * rest[1, a] - a * sigma
    return x, rest[0], load, bent(on.bows, s_o, ds_o, dds_o)


@compiled
def moment(on, sigma, s_o, ds_o, dds_o):
    """`Moment` where the mass is at s_o; on : `Ride` or `Grip`."""
    x, slope, load, bows = ground(on, sigma, s_o, ds_o, dds_o)
    s, weights, phi = split(s_o, on.behind, on.ahead, on.left.size, on.grading)
    T, r_static = static(s, sigma, on.c)
    at = Points(s, phi, weights, T, r_static, slopes(s, s_o, bows[0, 0], bows[1, 0]))
    return Moment(at, x, slope, load, bows)


@compiled
def surveyed(behind, ahead, grading, sigma, c, alpha, law, s_o, Q, bows, internal, told):
    """`survey` of many states over sines with a hat, whose mass is at s_o (m,); behind, ahead : rules of both sides.

    Q : (m, 2, n);  bows : (m, 2, 2) B/h by fields and pieces
    internal : (m, 2, 2) receives integrals, see `survey`;  told : (m, 3) int W ds, the least N and its s
    """
    for i in range(s_o.size):
        s, weights, phi = split(s_o[i], behind, ahead, Q.shape[2] - 1, grading)
        T, r_static = static(s, sigma, c)
        at = Points(s, phi, weights, T, r_static, slopes(s, s_o[i], bows[i, :, 0], bows[i, :, 1]))
        told[i, 0], told[i, 1], where = survey(at, Q[i], alpha, law, internal[i])
        told[i, 2] = s[where]


@compiled
def seen(ride, on, state):
    """`car` at a state, rows q, v, a, with the slopes of the basis and without thrust; on : `Rolling`."""
    n, last = ride.left.size + 1, state.shape[1] - 1
    Q, V, A = state[0, :last].reshape(2, n), state[1, :last].reshape(2, n), state[2, :last].reshape(2, n)
    s_o, ds_o, dds_o = state[0, last], state[1, last], state[2, last]
    x, slope, load, bows = ground(ride, on.sigma, s_o, ds_o, dds_o)
    rays = 1.0 / s_o, -1.0 / (1.0 - s_o)
    velocity, p, behind, ahead = motion(x, slope, load, rays, bows, Q, V, A, ds_o)
    p[1] += on.sigma
    return car(on, 0.0, velocity, p, behind, ahead)


@compiled
def at_time(on, smooth, t):
    """`Rolling` with the acceleration that `averaged` tells of t."""
    d = t - smooth[1]
    return Rolling(
        on.mu, on.sigma, on.drag, on.wind, on.hold, on.rub, on.brake, smooth[2] + d * smooth[4],
        smooth[3] + d * smooth[5], on.sheds,
    )  # fmt: skip


@compiled
def evaluate(here, ride, cable, balanced, r, gram, pull, sides, internal):
    """Set the residual of a state, rows q, v, a, what `balance` receives, and for a car that rolls the internal force.

    Return the car where it rolls.
    """
    (at, x, slope, load, bows), alpha, mu = here, cable.alpha, cable.mu
    n = x.f.size
    R = r[: 2 * n].reshape(2, n)
    Q, V, A = balanced[0, : 2 * n].reshape(2, n), balanced[1, : 2 * n].reshape(2, n), balanced[2, : 2 * n].reshape(2, n)
    balance(at, Q, alpha, cable.law, R, gram, pull, sides)
    if ride is None:
        C = acceleration(x, Q, V, A)
        for a in range(2):
            C[a] = cable.inertia * C[a] + mu * load[a]
        add_inertia(x, Q, V, A, C, R)
        return NO_CAR
    for a in range(2):
        for i in range(n):
            internal[a, i] = R[a, i]
    hauled = ride.mode == HAULED
    ds_o, dds_o = (ride.ds_o, ride.dds_o) if hauled else (balanced[1, 2 * n], balanced[2, 2 * n])
    thrust = balanced[2, 2 * n] if hauled else ride.thrust
    rays = at.phi[n - 1, 0], at.phi[n - 1, at.s.size - 1]
    out = roll(x, slope, load, rays, bows, sides, alpha, Q, V, A, ds_o, dds_o, ride.on, thrust, R)
    r[2 * n] = mu * balanced[2, 2 * n] if ride.mode == STUCK else out[9]
    return out


@compiled
def tangent(here, ride, cable, balanced, r, out, gram, sides, internal, c0, c1, c2, K):
    """Set K to c0 dr/dq + c1 dr/dv + c2 dr/da where `evaluate` has been.

    The column of s_o is a difference of inertia and car, and leaves out dr/ds_o: 1e-3 of it for c0 of a step.
    """
    at, x, mu = here.at, here.x, cable.mu
    n, size = x.f.size, K.shape[0]
    block = K[: 2 * n, : 2 * n]
    stiffness(at.phi, gram, cable.harmonic, cable.grading, cable.hat, block)
    add_inertia_tangent(x, cable.inertia, c0, c1, c2, block)
    if ride is None:
        return
    hauled = ride.mode == HAULED
    ds_o, dds_o = (ride.ds_o, ride.dds_o) if hauled else (balanced[1, 2 * n], balanced[2, 2 * n])
    rays = at.phi[n - 1, 0], at.phi[n - 1, at.s.size - 1]
    add_shed_tangent(x, rays, ds_o, ride.on, c0, c1, block)
    for i in range(size):
        K[2 * n, i] = K[i, 2 * n] = 0.0
    if ride.mode == STUCK:
        K[2 * n, 2 * n] = c2 * mu
        return
    row(x, out, rays, pulls(at.phi, gram), ds_o, dds_o, ride.on, c0, c1, c2, K[2 * n])
    if hauled:
        for i in range(n):
            K[i, 2 * n], K[n + i, 2 * n] = -c2 * out[2] * x.f[i], -c2 * out[3] * x.f[i]
        K[2 * n, 2 * n] = -c2
        return
    if c1 + c2 == 0.0:
        return
    h, last = STEP / (c1 + c2), 2 * n
    Q, V, A = balanced[0, :last].reshape(2, n), balanced[1, :last].reshape(2, n), balanced[2, :last].reshape(2, n)
    ds, dds, R = ds_o + h * c1, dds_o + h * c2, np.zeros((2, n))
    x, slope, load, bows = ground(ride, ride.on.sigma, balanced[0, last], ds, dds)
    of = x, slope, load, rays, bows, sides, cable.alpha, Q, V, A, ds, dds, ride.on, ride.thrust
    K[last, last] = (roll(*of, R)[9] - out[9]) / h
    for a in range(2):
        for i in range(n):
            K[a * n + i, last] = (R[a, i] + internal[a, i] - r[a * n + i]) / h


@compiled
def look(here, ride, cable, balanced, r, pull, parts):
    """Set the residual of a state, rows q, v, a, and what there is room for of dr/dq, dr/dv, dr/da, parts (3 or 0)."""
    if ride.mode != HAULED:
        last = balanced.shape[1] - 1
        here = moment(ride, ride.on.sigma, balanced[0, last], balanced[1, last], balanced[2, last])
    gram, sides, internal = np.empty((2, 2, here.at.s.size)), np.empty((2, 2)), np.empty((2, here.x.f.size))
    out = evaluate(here, ride, cable, balanced, r, gram, pull, sides, internal)
    for k in range(parts.shape[0]):
        c = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        tangent(here, ride, cable, balanced, r, out, gram, sides, internal, *c, parts[k])


@compiled
def settle(grip, places, here, ride, course, cable, sigma, start, now, told, rules, bound, newton, pull):
    """`cablefem.newmark.System.settle` for the full cable, of steps one after another.

    Return how many came to be in balance, not slack, and with no event of the course.
    A mass that grips is looked at for mean tensions over a shortest wave, a car that rolls for those of points.

    grip : `Grip`, and places (m, 3) s_o, ds_o, dds_o; or None, and here : `Moment`, for one step
    ride : `Ride` or None;  course : `Course` or None
    now : (m, 3, size) receives the ends;  rules : (m, 3, 5);  newton : max_iter, reuse, patience, most halvings.
    told : (m, 6) |r|, how often it iterated, factorised, evaluated, the least tension and its s.
    pull : of the last step
    The factors are not kept but made again from the kept tangent: more than one iteration is rare, and for further
    steps the tangent does not do: the mass has gone a part of the highest sine's wave by then, and its kink turns r'.
    """
    size = start.shape[1]
    balanced, r, gram, sides = np.empty((3, size)), np.empty(size), np.empty((2, 2, pull.size)), np.empty((2, 2))
    K, step, internal = np.empty((size, size)), np.empty(size), np.empty((2, size // 2))
    of = ride
    if course is not None:
        first, newest, velocity = 0, course.past.shape[0] - rules.shape[0], seen(ride, ride.on, start)[11:13]
    for count in range(rules.shape[0]):
        begin, end, rule = start if count == 0 else now[count - 1], now[count], rules[count]
        if grip is not None:
            here = moment(grip, sigma, places[count, 0], places[count, 1], places[count, 2])
            if cable.inertia == 0.0:  # the weight alone
                here.load[0], here.load[1] = 0.0, -sigma
        if course is not None:
            t0, past = course.t[count] - rule[0, 4] * rule[0, 1], course.past
            past[newest, 0], past[newest, 1], past[newest, 2] = t0, velocity[0], velocity[1]
            smooth = averaged(past, first, newest, course.window)
            first, newest = int(smooth[0]), newest + 1
            for k in range(6):
                course.smooth[k] = smooth[k]
            of = Ride(
                ride.mode, at_time(ride.on, smooth, course.t[count]), course.thrust[count], 0.0, 0.0,
                ride.behind, ride.ahead, ride.mass, ride.left, ride.chord, ride.thirds, ride.grading, ride.c,
                ride.bows,
            )  # fmt: skip
        c0, c1, c2 = rule[0, 4] * rule[0, 3], rule[1, 4] * rule[1, 3], rule[2, 4] * rule[2, 3]
        for k in range(3):
            for i in range(size):
                end[k, i] = rule[k, 0] * begin[0, i] + rule[k, 1] * begin[1, i] + rule[k, 2] * begin[2, i]
        factorisations, residuals, anew, iterations = 0, 0, True, 0
        share, before, halving = 0.0, math.inf, -1  # the first residual follows no correction
        while True:
            for k in range(3):
                part, w = share * rule[k, 3], rule[k, 4]
                for i in range(size):
                    if halving >= 0:
                        end[k, i] -= part * step[i]
                    balanced[k, i] = w * end[k, i] + (1.0 - w) * begin[k, i]
            lost = False
            if ride is not None:  # a type of its own: no ride is compiled into the step of a mass that grips
                last = size - 1
                lost = ride.mode != HAULED and not 0.0 < balanced[0, last] < 1.0  # a trial that leaves the cable
                if ride.mode != HAULED and not lost:
                    here = moment(ride, ride.on.sigma, balanced[0, last], balanced[1, last], balanced[2, last])
            norm = math.nan
            if not lost:
                out = evaluate(here, of, cable, balanced, r, gram, pull, sides, internal)
                square = 0.0
                for i in range(size):
                    square += r[i] * r[i]
                norm = math.sqrt(square)
            elif halving < 0:
                iterations, residuals = 1, 1
                break
            if halving >= 0:
                residuals += 1
                if not (norm < before or (iterations < newton[2] and norm < math.inf)) and halving < newton[3]:
                    halving += 1
                    for i in range(size):
                        step[i] *= 0.5
                    share = -1.0
                    continue
                iterations += 1
                if norm <= bound or not norm < math.inf or iterations >= newton[0]:
                    break
                anew = norm > newton[1] * before
            before, share, halving = norm, 1.0, 0
            if anew:
                factorisations += 1
                tangent(here, of, cable, balanced, r, out, gram, sides, internal, c0, c1, c2, K)
            solve(K, r, step)
        lowest, where = pull[0], here.at.s[0]
        if grip is not None:
            lowest, where = least(here.at, places[count, 0], pull)
        else:
            for i in range(pull.size):
                if pull[i] < lowest:
                    lowest, where = pull[i], here.at.s[i]
        told[count, 0], told[count, 1], told[count, 2] = norm, iterations, factorisations
        told[count, 3], told[count, 4], told[count, 5] = residuals, lowest, where
        if not (norm <= bound and lowest >= 0.0):
            return count
        if course is not None:
            s_o, ds_o = end[0, size - 1], end[1, size - 1]
            if not course.low < s_o < course.high or (course.sign != 0.0 and not course.sign * ds_o > 0.0):
                return count
            then = seen(ride, at_time(ride.on, smooth, t0 + rule[0, 1]), end)
            if not (course.forward * then[10] > course.slow and (course.lifted or max(then[8], then[13]) > 0.0)):
                return count
            velocity = then[11:13]
    return rules.shape[0]
