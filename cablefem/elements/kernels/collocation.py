"""Newton's method of a collocation step, compiled with the balance; see `cablefem.newmark.collocation_rule`."""

import math

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import Contact, Mesh, assemble, combine, coupling
from cablefem.elements.kernels.banded import Tangent, factorise_coupled, solve_coupled
from cablefem.elements.kernels.car import Car, Rolling, factorise_bordered, roll, solve_bordered


@compiled
def at_nodes(start, dt, c, A, AA, a, q, v):
    """Set q and v at the nodes of a step from `start` (2, n) with the accelerations a there, (s, n) each."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            once, twice = 0.0, 0.0
            for k in range(a.shape[0]):
                once += A[i, k] * a[k, j]
                twice += AA[i, k] * a[k, j]
            v[i, j] = start[1, j] + dt * once
            q[i, j] = start[0, j] + dt * (c[i] * start[1, j] + dt * twice)


@compiled
def balances(grip, ride, mesh, cable, q, v, a, r, work):
    """Set r (s, n) at all nodes; return |r|, the least tension at the last node, and its s."""
    least, where, square = math.inf, 0.0, 0.0
    for i in range(a.shape[0]):
        at = q[i], v[i], a[i], r[i]
        if grip is not None:
            of = grip[2][i], Mesh(*grip[3][i]), cable, Contact(*grip[4][i])
            least, where = assemble(*of, *at, work, 0.0, 0.0, 0.0)
        if ride is not None:
            rolling, car = Rolling(*ride[0]), Car(*ride[2][i])
            least, where, _, _, _ = roll(Mesh(*mesh), rolling, cable, car, *at, work.ab, 0.0, 0.0, 0.0)
        for j in range(a.shape[1]):
            square += r[i, j] * r[i, j]
    return math.sqrt(square), least, where


@compiled
def keep(x, out):
    """Copy a matrix; loops, as in `banded`."""
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            out[i, j] = x[i, j]


@compiled
def blend(c0, c1, parts, out):
    """Set the tangent of a node from its parts, dr/dq, dr/dv and dr/da."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = c0 * parts[0, i, j] + c1 * parts[1, i, j] + parts[2, i, j]


@compiled
def collocate(
    grip, ride, mesh, cable, real_work, complex_work, start, dt, rule, a, bound, max_iter, reuse, patience
):  # fmt: skip
    """Find the accelerations a (s, n) at the nodes of a step as `cablefem.newmark.collocate` does.

    grip : operators, and of each node coefficients, bands, meshes and `Contact`s, or None.
    ride : `Rolling`, real and complex, and `Car`s of each node, or None; mesh is theirs.  As in `newton.settle`.
    rule : c, A, AA, eigenvalues, to and back of its tableau, and the node next to the middle.
    Return |r|, iterations, factorisations, residuals, the least tension at the last node and its s.
    """
    c, A, AA, values, to, back, middle = rule
    real_work, complex_work = Tangent(*real_work), Tangent(*complex_work)
    s, n = a.shape
    m = values.size
    q, v, r, da = np.empty((s, n)), np.empty((s, n)), np.empty((s, n)), np.empty((s, n))
    real, along = np.empty(n), np.empty((m, n), dtype=np.complex128)
    one = np.eye(3)
    parts = np.empty((3, *real_work.ab.shape))  # of the tangent: dr/dq, dr/dv, dr/da
    if grip is not None:
        for i in range(s):
            combine(grip[0], grip[1][i], grip[2][i])
    if ride is not None:
        rolling, complex_rolling = Rolling(*ride[0]), Rolling(*ride[1])
        borders, corners = np.empty((3, *rolling.border.shape)), np.empty(3)
    factorisations, residuals, anew, regular = 0, 0, True, True
    at_nodes(start, dt, c, A, AA, a, q, v)
    norm, least, where = balances(grip, ride, mesh, cable, q, v, a, r, real_work)
    for iteration in range(max_iter):
        if anew:
            at = q[middle], v[middle], a[middle], da[0]
            for k in range(3):
                if grip is not None:
                    of = grip[2][middle], Mesh(*grip[3][middle]), cable, Contact(*grip[4][middle])
                    assemble(*of, *at, real_work, one[k, 0], one[k, 1], one[k, 2])
                if ride is not None:
                    car = Car(*ride[2][middle])
                    roll(Mesh(*mesh), rolling, cable, car, *at, real_work.ab, one[k, 0], one[k, 1], one[k, 2])
                    keep(rolling.border, borders[k])
                    corners[k] = rolling.corner[0]
                keep(real_work.ab, parts[k])
            for k in range(m):
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
            factorisations += 1
        if not regular:
            norm = math.nan
            break
        for k in range(m):
            for j in range(n):
                x = 0.0j
                for i in range(s):
                    x += to[k, i] * r[i, j]
                along[k, j] = x
            if values[k].imag == 0.0:
                for j in range(n):
                    real[j] = along[k, j].real
                if grip is not None:
                    solve_coupled(real_work, real)
                if ride is not None:
                    solve_bordered(real_work, rolling, real)
                for j in range(n):
                    along[k, j] = real[j]
            else:
                if grip is not None:
                    solve_coupled(complex_work, along[k])
                if ride is not None:
                    solve_bordered(complex_work, complex_rolling, along[k])
        for i in range(s):
            for j in range(n):
                x = 0.0j
                for k in range(m):
                    x += back[i, k] * along[k, j]
                da[i, j] = x.real
        before, share = norm, 1.0
        for halving in range(6):
            for i in range(s):
                for j in range(n):
                    a[i, j] -= share * da[i, j]
            share = -(0.5 ** (halving + 1))
            at_nodes(start, dt, c, A, AA, a, q, v)
            norm, least, where = balances(grip, ride, mesh, cable, q, v, a, r, real_work)
            residuals += 1
            if norm < before or (iteration < patience and norm < math.inf):
                break
        if norm <= bound or not norm < math.inf:
            break
        anew = norm > reuse * before
    return norm, iteration + 1, factorisations, residuals, least, where
