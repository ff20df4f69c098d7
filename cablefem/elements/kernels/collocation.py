"""Newton's method of collocation steps, compiled with the balance; see `cablefem.newmark.collocation_rule`."""

import math

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import Contact, Mesh, assemble, combine_following, coupling, follow
from cablefem.elements.kernels.banded import Tangent, factorise_coupled, solve_coupled
from cablefem.elements.kernels.car import Car, Rolling, driven, factorise_bordered, roll, solve_bordered, under_way
from cablefem.elements.kernels.front import follow_fronts, weigh

SAME = 1e-6  # relative difference of step lengths for which factors are kept
SERVES = 0.03  # what the last correction of a step must leave of the residual, or the next one gets factors of its own


@compiled
def at_nodes(start, dt, c, A, AA, a, q, v):
    """Set q and v at the nodes of a step from `start` (2, n) with the accelerations a there, (s, n) each."""
    q0, v0 = start[0], start[1]
    for i in range(a.shape[0]):
        to_q, to_v = q[i], v[i]
        for j in range(to_q.size):
            to_v[j] = v0[j]
            to_q[j] = q0[j] + dt * c[i] * v0[j]
        for k in range(a.shape[0]):
            x, once, twice = a[k], dt * A[i, k], dt * dt * AA[i, k]
            for j in range(to_q.size):
                to_v[j] += once * x[j]
                to_q[j] += twice * x[j]


@compiled
def spread(weights, of, out):
    """Set out to weights (m, s) of (s, n)."""
    out[:] = 0.0
    for i in range(weights.shape[0]):
        for k in range(weights.shape[1]):
            x, to, w = of[k], out[i], weights[i, k]
            for j in range(to.size):
                to[j] += w * x[j]


@compiled
def even(bands, spans, dofs, n_fields, parts, c0, middle, scales):
    """Set the factors (s, n) of rows of the nodes by which their tangents have the diagonal of that of the middle one.

    Behind a mass that starts from rest lengths grow as t^2, and stiffness falls: one tangent serves all nodes then.
    """
    half, band = bands.shape[2] // 2, (parts.shape[2] - 1) // 3
    scales[:] = 0.0
    for i in range(scales.shape[0]):
        for e in range(dofs.shape[0]):
            for d in dofs[e]:
                for k in range(n_fields if d >= 0 else 0):
                    scales[i, d * n_fields + k] += 1.0 / spans[i, e, 1]
    for j in range(scales.shape[1]):
        K, M, per_h = c0 * parts[0, j, band], parts[2, j, band], scales[middle, j]
        for i in range(scales.shape[0]):
            M_i = M + bands[i, 0, half, j] - bands[middle, 0, half, j]
            scales[i, j] = (K + M) / (K * scales[i, j] / per_h + M_i)


@compiled
def blend(c0, c1, parts, out):
    """Set the tangent of a node from its parts, dr/dq, dr/dv and dr/da; loops, as in `banded`."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = c0 * parts[0, i, j] + c1 * parts[1, i, j] + parts[2, i, j]


@compiled
def factorise_all(grip, ride, cable, works, parts, borders, corners, dt, values):
    """Factorise the tangents for all eigenvalues from their parts; return whether all are regular."""
    real_work, complex_work, regular = Tangent(*works[0]), Tangent(*works[1]), True
    if ride is not None:
        rolling, complex_rolling = Rolling(*ride[0]), Rolling(*ride[1])
    for k in range(values.size):
        c1 = dt * values[k]
        c0 = c1 * c1
        if c1.imag == 0.0:
            blend(c0.real, c1.real, parts, real_work.ab)
            if grip is not None:
                regular = factorise_coupled(real_work, c0.real * coupling(cable)) and regular
            if ride is not None:
                blend(c0.real, c1.real, borders, rolling.border)
                rolling.corner[0] = c0.real * corners[0] + c1.real * corners[1] + corners[2]
                regular = factorise_bordered(real_work, rolling) and regular
        else:
            blend(c0, c1, parts, complex_work.ab)
            if grip is not None:
                regular = factorise_coupled(complex_work, c0 * coupling(cable)) and regular
            if ride is not None:
                blend(c0, c1, borders, complex_rolling.border)
                complex_rolling.corner[0] = c0 * corners[0] + c1 * corners[1] + corners[2]
                regular = factorise_bordered(complex_work, complex_rolling) and regular
    return regular


@compiled
def solve_all(grip, ride, works, values, to, back, r, da, real, along):
    """Set da (s, n) to the solution for r with the factors of `factorise_all`; real, along : (n,) workspaces."""
    real_work, complex_work = Tangent(*works[0]), Tangent(*works[1])
    if ride is not None:
        rolling, complex_rolling = Rolling(*ride[0]), Rolling(*ride[1])
    s, n = r.shape
    da[:] = 0.0
    for k in range(values.size):
        if values[k].imag == 0.0:
            real[:] = 0.0
            for i in range(s):
                x, of = to[k, i].real, r[i]
                for j in range(n):
                    real[j] += x * of[j]
            if grip is not None:
                solve_coupled(real_work, real)
            if ride is not None:
                solve_bordered(real_work, rolling, real)
            for i in range(s):
                x, out = back[i, k].real, da[i]
                for j in range(n):
                    out[j] += x * real[j]
        else:
            for j in range(n):
                x, y = 0.0, 0.0
                for i in range(s):
                    x += to[k, i].real * r[i, j]
                    y += to[k, i].imag * r[i, j]
                along[j] = complex(x, y)
            if grip is not None:
                solve_coupled(complex_work, along)
            if ride is not None:
                solve_bordered(complex_work, complex_rolling, along)
            for i in range(s):
                x, y, out = back[i, k].real, back[i, k].imag, da[i]
                for j in range(n):
                    out[j] += x * along[j].real - y * along[j].imag


@compiled
def collocate(grip, fronts, ride, mesh, cable, works, kept, t, ends, a, further, rule, told, bound, newton):
    """Take steps from t to t, (m + 1,), as `cablefem.newmark.collocate` takes the first of them.

    grip : operators, coefficients, of each node bands, spans and `Contact`s, elements left of the mass; of following
        meshes places (m, s, 3) s_o, ds_o, dds_o and loads (m, s, n_fields), else empty; or None.
    fronts : that nodes travel with, `follow_fronts`'s xi, lines and p, instants (m, s) and table of inertia; or None.
    ride : `Rolling`, real and complex, `Car`, what instants bring it (m, s, 3), see `driven`, and its course, see
        `under_way`, of a rule whose last node is the step's end; or None.
    works : `Tangent`s, real and complex, for this alone: factors serve the next step as well, as in RADAU5 (Hairer &
        Wanner 1996, section IV.8).  kept : (1,) the length of the step that they are for.
    ends, a, further : as `Collocating` has them.  told : (m, 6) as in `newton.settle`.
    Return how many steps came to be in balance, before anything happens to the car; one with a slack element ends them.
    """
    for k in range(a.shape[0]):
        dt = t[k + 1] - t[k]
        if k > 0:
            spread(further[k], a[k - 1], a[k])
        of = mesh, cable, works, kept, ends[k], dt, rule, a[k], bound, newton
        if grip is not None:
            operators, coefficients, bands, spans, contacts, n_left, places, loads = grip
            for i in range(loads.shape[1] if places.shape[0] > 0 else 0):
                if fronts is None:
                    x = places[k, i]
                    follow(x[0], x[1], x[2], n_left, coefficients, spans[i])
                    m = contacts[i][0][0, 0]
                    combine_following(operators, x[0], x[1], x[2], m, m + loads.shape[2], bands[i])
                if fronts is not None:
                    xi, lines, p, instants, fine = fronts
                    follow_fronts(xi, lines, p, instants[k, i : i + 1], places[k, i : i + 1], spans[i : i + 1])
                    weigh(spans[i], mesh[1], fine, loads.shape[2], bands[i])
                contact = Contact(*contacts[i])
                for j in range(loads.shape[2]):
                    contact.load[j] = loads[k, i, j]
            done = settle((bands, spans, contacts), None, *of)
        if ride is not None:
            real, pair, car, at, course = ride
            cars = driven(car, at[k, 0]), driven(car, at[k, 1]), driven(car, at[k, -1])
            done = settle(None, (real, pair, cars), *of)
        norm, iterations, factorisations, residuals, least, where = done
        told[k, 0], told[k, 1], told[k, 2] = norm, iterations, factorisations
        told[k, 3], told[k, 4], told[k, 5] = residuals, least, where
        if not norm <= bound:
            return k
        twice, once = rule[3]
        for j in range(ends.shape[2]):
            x, y = 0.0, 0.0
            for i in range(once.size):
                x += twice[i] * a[k, i, j]
                y += once[i] * a[k, i, j]
            ends[k + 1, 0, j] = ends[k, 0, j] + dt * (ends[k, 1, j] + dt * x)
            ends[k + 1, 1, j] = ends[k, 1, j] + dt * y
        if ride is not None:
            at_end = ends[k + 1, 0], ends[k + 1, 1], a[k, -1]
            if not under_way(course, mesh[1], Rolling(*ride[0]), cable, cars[2], *at_end):
                return k
        if not least >= 0.0:
            return k + 1
    return a.shape[0]


@compiled
def settle(grip, ride, mesh, cable, works, kept, start, dt, rule, a, bound, newton):
    """Find the accelerations a (s, n) at the nodes of a step of length dt from `start`.

    grip : of each node bands, spans and `Contact`s, or None;  ride : `Rolling`, real and complex, and `Car`s, or None.
    rule : c, A, AA, ends, eigenvalues, to and back of its tableau, and the node next to the middle.
    Return |r|, iterations, factorisations, residuals, the least tension at the last node and its s.
    """
    (c, A, AA, _, values, to, back, middle), (max_iter, reuse, patience, enough) = rule, newton
    s, n = a.shape
    q, v, r, da = np.empty((s, n)), np.empty((s, n)), np.empty((s, n)), np.empty((s, n))
    real, along, spare = np.empty(n), np.empty(n, dtype=np.complex128), np.empty(n)
    work = Tangent(*works[0])
    parts, corners = np.empty((3, work.ab.shape[0], work.ab.shape[1])), np.empty(3)  # of the tangent: dr/dq, /dv, /da
    borders = np.empty((3, 3, n - 1))
    scales = np.ones((s, n))
    if ride is not None:
        rolling = Rolling(*ride[0])
    anew = not abs(kept[0] - dt) <= SAME * dt
    old, iterations, factorisations, residuals = not anew, 0, 0, -1
    before, least, where, share, halving, back_again = math.inf, math.inf, 0.0, 0.0, 0, False
    while True:
        if residuals >= 0:
            for i in range(s):
                x, of = a[i], da[i]
                for j in range(n):
                    x[j] -= share * of[j]
        at_nodes(start, dt, c, A, AA, a, q, v)
        square = 0.0
        for i in range(s):
            if grip is not None:
                mesh_i, contact = Mesh(grip[1][i], mesh[1], mesh[2]), Contact(*grip[2][i])
                least, where = assemble(grip[0][i], mesh_i, cable, contact, q[i], v[i], a[i], r[i], work, 0.0, 0.0, 0.0)
            if ride is not None:
                least, where, _, _, _ = roll(
                    Mesh(*mesh), rolling, cable, Car(*ride[2][i]), q[i], v[i], a[i], r[i], work.ab, 0.0, 0.0, 0.0
                )
            for j in range(n):
                square += r[i, j] * r[i, j]
        norm = math.sqrt(square)
        residuals += 1
        if residuals > 0 and not back_again:
            good = old or norm < before or (iterations <= patience and norm < math.inf)
            if not good and halving < 5:
                halving += 1
                share = -0.5 if halving == 1 else 0.5 * share
                continue
            if norm <= bound or not (old or norm < math.inf):
                break
            if not old and iterations > patience and norm * (norm / before) ** (enough - iterations) > bound:
                break
            anew = not norm <= reuse * before
            if old and not norm < before:  # a correction by a tangent that is out of date is not worth halving
                share, back_again = -1.0, True
                continue
        back_again = False
        if iterations == max_iter:
            break
        iterations += 1
        if anew:
            for k in range(3):
                c0, c1, c2 = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
                if grip is not None:
                    mesh_i, contact = Mesh(grip[1][middle], mesh[1], mesh[2]), Contact(*grip[2][middle])
                    into = Tangent(parts[k], work.pivots, work.increment, work.coupled)
                    at = q[middle], v[middle], a[middle], spare
                    assemble(grip[0][middle], mesh_i, cable, contact, *at, into, c0, c1, c2)
                if ride is not None:
                    part = Rolling(rolling.n_left, rolling.inertia, rolling.ends, borders[k], corners[k : k + 1])
                    car, at = Car(*ride[2][middle]), (q[middle], v[middle], a[middle], spare)
                    roll(Mesh(*mesh), part, cable, car, *at, parts[k], c0, c1, c2)
            if grip is not None:
                c1 = dt * abs(values[0])
                even(grip[0], grip[1], mesh[1], n // (mesh[1].max() + 1), parts, c1 * c1, middle, scales)
            regular = factorise_all(grip, ride, cable, works, parts, borders, corners, dt, values)
            old, kept[0] = False, dt
            factorisations += 1
            if not regular:
                norm = math.nan
                break
        if grip is not None:
            for i in range(s):
                for j in range(n):
                    r[i, j] *= scales[i, j]
        solve_all(grip, ride, works, values, to, back, r, da, real, along)
        before, share, halving = norm, 1.0, 0
    if not (norm <= bound and norm <= SERVES * before):
        kept[0] = math.nan
    return norm, iterations, factorisations, residuals, least, where
