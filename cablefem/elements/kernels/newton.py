"""Newton's method of steps of Newmark's family, compiled with the balance."""

import math

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import Contact, Mesh, assemble, combine, combine_following, coupling, follow
from cablefem.elements.kernels.banded import Tangent, dot, factorise_coupled, solve_coupled
from cablefem.elements.kernels.car import Car, Rolling, driven, factorise_bordered, roll, solve_bordered, under_way


@compiled
def settle(grip, ride, mesh, cable, work, start, now, rules, told, bound, newton):
    """Find the ends of steps one after another by Newton's method as `cablefem.newmark.iterate` does.

    grip : operators, coefficients, bands and `Contact` of a mass whose place is given, elements left of it, and of a
        following mesh places (m, 3) s_o, ds_o, dds_o and loads (m, n_fields) of `Contact`, else empty; or None.
    ride : `Rolling` and `Car` of one that rolls, what instants bring it (m, 3), see `driven`, and its course, see
        `under_way`; or None: numba compiles what is there only.
    mesh, work and the rest as plain tuples: it is slow to take in named ones.
    now : (m, 3, n) receives the ends;  rules : (m, 3, 5);  newton : max_iter, reuse, patience.
    told : (m, 6) |r|, iterations, factorisations, residuals, the least tension and its s.
    Return how many came to be in balance with no element slack, before anything happens to the car.
    """
    mesh, work, (max_iter, reuse, patience) = Mesh(*mesh), Tangent(*work), newton
    n = start.shape[1]
    balanced, r, da = np.empty((3, n)), np.empty(n), np.empty(n)
    q, v, a = balanced[0], balanced[1], balanced[2]
    if grip is not None:
        operators, coefficients, bands, contact, n_left, places, loads = grip
        contact = Contact(*contact)
    if ride is not None:
        rolling, at, course = Rolling(*ride[0]), ride[2], ride[3]
        patience = 0  # near a support a correction that overshoots ends on another root
    for k in range(rules.shape[0]):
        begin, end, rule = start if k == 0 else now[k - 1], now[k], rules[k]
        if grip is not None:
            if places.shape[0] > 0:
                follow(places[k, 0], places[k, 1], places[k, 2], n_left, coefficients, mesh.span)
                for i in range(loads.shape[1]):
                    contact.load[i] = loads[k, i]
                m = contact.dofs[0, 0]
                combine_following(operators, places[k, 0], places[k, 1], places[k, 2], m, m + loads.shape[1], bands)
            else:
                combine(operators, coefficients, bands)
        if ride is not None:
            car = driven(ride[1], at[k])
        for i in range(3):
            w = rule[i, 4]
            for j in range(n):
                end[i, j] = rule[i, 0] * begin[0, j] + rule[i, 1] * begin[1, j] + rule[i, 2] * begin[2, j]
                balanced[i, j] = w * end[i, j] + (1.0 - w) * begin[i, j]
        c0, c1, c2 = rule[0, 3] * rule[0, 4], rule[1, 3] * rule[1, 4], rule[2, 3] * rule[2, 4]
        norm, iterations, factorisations, residuals, anew, regular = 0.0, 0, 0, 0, True, True
        while iterations < max_iter:
            if anew:
                if grip is not None:
                    assemble(bands, mesh, cable, contact, q, v, a, r, work, c0, c1, c2)
                    regular = factorise_coupled(work, c0 * coupling(cable))
                if ride is not None:
                    roll(mesh, rolling, cable, Car(*car), q, v, a, r, work.ab, c0, c1, c2)
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
            for j in range(n):
                da[j] = r[j]
            share = 1.0
            for _ in range(6):
                for i in range(3):
                    part, w = share * rule[i, 3], rule[i, 4]
                    for j in range(n):
                        end[i, j] -= part * da[j]
                        balanced[i, j] = w * end[i, j] + (1.0 - w) * begin[i, j]
                share = -0.5 if share == 1.0 else 0.5 * share  # corrections are halved by taking the rest back
                if grip is not None:
                    least, where = assemble(bands, mesh, cable, contact, q, v, a, r, work, 0.0, 0.0, 0.0)
                if ride is not None:
                    least, where, _, _, _ = roll(mesh, rolling, cable, Car(*car), q, v, a, r, work.ab, 0.0, 0.0, 0.0)
                residuals += 1
                norm = math.sqrt(dot(r, r))
                if norm < before or (iterations < patience and norm < math.inf):
                    break
            iterations += 1
            if norm <= bound or not norm < math.inf:
                break
            anew = norm > reuse * before
        told[k, 0], told[k, 1], told[k, 2] = norm, iterations, factorisations
        told[k, 3], told[k, 4], told[k, 5] = residuals, least, where
        if not (norm <= bound and least >= 0.0):
            return k
        if ride is not None and not under_way(course, mesh.dofs, rolling, cable, car, end[0], end[1], end[2]):
            return k
    return rules.shape[0]
