"""Compiled Newton's method for steps of Newmark's family."""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import banded, compiled, inner
from cablefem.elements.kernels.balance import Instant, assemble, weigh
from cablefem.elements.kernels.banded import copy, dot, subtract
from cablefem.elements.kernels.car import roll, under_way

NO_TANGENT = 0.0, 0.0, 0.0
HALVINGS = 5  # of one correction, at most


class Steps(NamedTuple):
    """Consecutive steps, see `cablefem.newmark.System.settle`."""

    places: Any  # (m, 3 + n_fields) see `balance.Instant`; with a car (m, 3), see `car.driven`
    contact: Any
    start: Any  # (3, n)
    rules: Any  # (m, 3, 5)
    ends: Any  # (m, 3, n) output
    told: Any  # (m, 6) output: |r|, iterations, factorisations, residuals, least tension, its s


class Limits(NamedTuple):
    bound: float
    max_iter: int
    reuse: float
    patience: int
    enough: float


@inner
def balance(cable, ride, now, x, r, ab, factors):
    """Set r and, unless the factors are 0, the tangent; return the least tension and its s."""
    if ride is None:
        return assemble(cable, now, x, r, ab, factors)
    least, where, _, _ = roll(cable, ride, now, x, r, ab, factors)
    return least, where


@compiled
def factorise(work, chord, ride, strength):
    """Factorise a tangent; return whether it is regular.

    chord : adds strength increment increment^T (Sherman & Morrison's formula).
    """
    regular = banded.factorise(work.ab, work.pivots, chord is None)
    if chord is not None:
        copy(chord.increment, chord.coupled)
        banded.solve(work.ab, work.pivots, chord.coupled)
        share = strength / (1.0 + strength * dot(chord.increment, chord.coupled))
        for i in range(chord.coupled.size):
            chord.coupled[i] *= share
    if ride is not None:
        lines, corner = ride.border
        copy(lines[0], lines[2])
        banded.solve(work.ab, work.pivots, lines[2])
        corner[0] -= dot(lines[1], lines[2])
        regular = regular and corner[0] != 0.0
    return regular


@compiled
def solve(work, chord, ride, b):
    n = work.ab.shape[0]
    banded.solve(work.ab, work.pivots, b[:n])
    if chord is not None:
        subtract(dot(chord.increment, b), chord.coupled, b)
    if ride is not None:
        lines, corner = ride.border
        b[n] = (b[n] - dot(lines[1], b)) / corner[0]
        subtract(b[n], lines[2], b)


@compiled
def coupling(cable, c0):
    """Return alpha lam c0, the strength of a chord's increment."""
    return c0 * (cable.law[0] * cable.law[3])


@compiled
def settle(cable, ride, work, bands, steps, limits):
    """Take steps one after another; return how many converged before a slack element or an event of the car."""
    n, x = steps.start.shape[1], np.empty_like(steps.start)
    r, da = np.empty(n), np.empty(n)
    patience = limits.patience if ride is None else 0  # else another root near a support
    for k in range(steps.rules.shape[0]):
        begin, end, rule = steps.start if k == 0 else steps.ends[k - 1], steps.ends[k], steps.rules[k]
        now = Instant(steps.places[k], bands, steps.contact)
        if now.place.size > 3:  # with a car, `roll` does this
            weigh(cable, now)
        predict(begin, rule, end, x)
        factors = rule[0, 3] * rule[0, 4], rule[1, 3] * rule[1, 4], rule[2, 3] * rule[2, 4]
        norm, before, factorisations, residuals, regular = math.inf, 0.0, 0, 0, True
        least, where = math.inf, 0.0
        for iteration in range(limits.max_iter):
            if not norm <= limits.reuse * before:
                balance(cable, ride, now, x, r, work.ab, factors)
                norm = math.sqrt(dot(r, r))
                regular = factorise(work, cable.chord, ride, coupling(cable, factors[0]))
                factorisations += 1
            before = norm
            if regular:
                solve(work, cable.chord, ride, r)
            else:
                r[:] = math.nan
            copy(r, da)
            share = 1.0
            for _ in range(HALVINGS + 1):
                correct(begin, rule, share, da, end, x)
                least, where = balance(cable, ride, now, x, r, work.ab, NO_TANGENT)
                residuals += 1
                norm = math.sqrt(dot(r, r))
                if norm < before or (iteration < patience and norm < math.inf):
                    break
                share = -0.5 if share == 1.0 else 0.5 * share  # takes half of the correction back
            if norm <= limits.bound or not norm < math.inf:
                break
        told = steps.told[k]
        told[0], told[1], told[2], told[3] = norm, iteration + 1, factorisations, residuals
        told[4], told[5] = least, where
        if not (norm <= limits.bound and least >= 0.0 and under_way(cable, ride, steps.places[k], end)):
            return k
    return steps.rules.shape[0]


@inner
def predict(begin, rule, end, x):
    for i in range(3):
        w = rule[i, 4]
        for j in range(end.shape[1]):
            end[i, j] = rule[i, 0] * begin[0, j] + rule[i, 1] * begin[1, j] + rule[i, 2] * begin[2, j]
            x[i, j] = w * end[i, j] + (1.0 - w) * begin[i, j]


@inner
def correct(begin, rule, share, da, end, x):
    for i in range(3):
        part, w = share * rule[i, 3], rule[i, 4]
        for j in range(end.shape[1]):
            end[i, j] -= part * da[j]
            x[i, j] = w * end[i, j] + (1.0 - w) * begin[i, j]
