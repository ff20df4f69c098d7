"""Newton's method of a step of Newmark's family, compiled with the balance."""

import math

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import Contact, Mesh, assemble, combine, coupling, follow
from cablefem.elements.kernels.banded import Tangent, copy, dot, factorise_coupled, solve_coupled
from cablefem.elements.kernels.car import Car, Rolling, factorise_bordered, roll, solve_bordered


@compiled
def correct(start, rule, share, da, now, balanced):
    """Take share da off the rows q, v, a of the step's end, and set where the balance is taken; (3, n)."""
    for i in range(3):
        part, w = share * rule[i, 3], rule[i, 4]
        for j in range(da.size):
            now[i, j] -= part * da[j]
            balanced[i, j] = w * now[i, j] + (1.0 - w) * start[i, j]


@compiled
def settle(grip, ride, mesh, cable, work, start, now, rule, bound, max_iter, reuse, patience):
    """Find the end of a step by Newton's method as `cablefem.newmark.iterate` does, compiled with the balance.

    grip : operators, coefficients, bands and `Contact` of a mass whose place is given, or None.
    ride : `Rolling` and `Car` of one that rolls, or None; numba compiles what is there only.
    mesh, work and the rest as plain tuples: it is slow to take in named ones.
    Return |r|, iterations, factorisations, residuals, the least tension and its s.
    """
    mesh, work = Mesh(*mesh), Tangent(*work)
    n = start.shape[1]
    balanced, r, da = np.empty((3, n)), np.empty(n), np.zeros(n)
    q, v, a = balanced[0], balanced[1], balanced[2]
    if grip is not None:
        bands, contact = grip[2], Contact(*grip[3])
        combine(grip[0], grip[1], bands)
    if ride is not None:
        rolling, car = Rolling(*ride[0]), Car(*ride[1])
    for i in range(3):
        for j in range(n):
            now[i, j] = rule[i, 0] * start[0, j] + rule[i, 1] * start[1, j] + rule[i, 2] * start[2, j]
    c0, c1, c2 = rule[0, 3] * rule[0, 4], rule[1, 3] * rule[1, 4], rule[2, 3] * rule[2, 4]
    norm, factorisations, residuals, anew, regular = 0.0, 0, 0, True, True
    for iteration in range(max_iter):
        if anew:
            correct(start, rule, 0.0, da, now, balanced)
            if grip is not None:
                assemble(bands, mesh, cable, contact, q, v, a, r, work, c0, c1, c2)
                regular = factorise_coupled(work, c0 * coupling(cable))
            if ride is not None:
                roll(mesh, rolling, cable, car, q, v, a, r, work.ab, c0, c1, c2)
                regular = factorise_bordered(work, rolling)
            norm = math.sqrt(dot(r, r))
            factorisations += 1
        before = norm
        if not regular:  # pivots may never have been set
            r[:] = math.nan  # the norm will tell
        elif grip is not None:
            solve_coupled(work, r)
        elif ride is not None:
            solve_bordered(work, rolling, r)
        copy(r, da)
        for halving in range(6):
            correct(start, rule, 1.0 if halving == 0 else -(0.5**halving), da, now, balanced)
            if grip is not None:
                least, where = assemble(bands, mesh, cable, contact, q, v, a, r, work, 0.0, 0.0, 0.0)
            if ride is not None:
                least, where, _, _, _ = roll(mesh, rolling, cable, car, q, v, a, r, work.ab, 0.0, 0.0, 0.0)
            residuals += 1
            norm = math.sqrt(dot(r, r))
            if norm < before or (iteration < patience and norm < math.inf):
                break
        if norm <= bound or not norm < math.inf:
            break
        anew = norm > reuse * before
    return norm, iteration + 1, factorisations, residuals, least, where


@compiled
def stride(grip, n_left, places, loads, mesh, cable, work, start, now, rules, told, bound, max_iter, reuse, patience):
    """Settle steps on a following mesh one after another; return how many came to be in balance with no element slack.

    places : (m, 3) s_o, ds_o, dds_o;  loads : (m, n_fields) of `Contact`;  now : (m, 3, n) receives the ends;
    told : (m, 6) what `settle` returns.
    """
    for k in range(places.shape[0]):
        follow(places[k, 0], places[k, 1], places[k, 2], n_left, grip[1], mesh[0])
        copy(loads[k], grip[3][5])
        before = start if k == 0 else now[k - 1]
        norm, iterations, factorisations, residuals, least, where = settle(
            grip, None, mesh, cable, work, before, now[k], rules[k], bound, max_iter, reuse, patience
        )
        told[k, 0], told[k, 1], told[k, 2] = norm, iterations, factorisations
        told[k, 3], told[k, 4], told[k, 5] = residuals, least, where
        if not (norm <= bound and least >= 0.0):
            return k
    return places.shape[0]
