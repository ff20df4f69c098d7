"""Compiled inner loops of the cable elements: forces, banded tangents, energies.

All take tables that scikit-fem filled on the reference meshes; nothing is assembled symbolically in time.
Compiled because a step of these small systems costs more in interpreter than in arithmetic otherwise.

Common arguments
    q, v, a   (n_dof,)  unknowns, field index running fastest: dof * n_fields + field
    span      (n_el, 4) rows (s at xi = 0, ds/dxi, mesh velocity at xi = 0, d/dxi of it) of the element's side
    dofs      (n_el, n_loc) scalar dof, -1 on a support
    tab       (n_el, n_q, 2 + 2 n_loc) rows: xi, weight, shape values, shape d/dxi
    cable     (alpha, sigma, c, law)  law 0 elastic, 1 tension-only
    ab        (n_dof, 3 b + 1) rows of a matrix of half-width b: ab[i, b + j - i] = A[i, j]; the last b columns are
              empty until rows are exchanged
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

compiled: Any = njit(cache=True, error_model="numpy")  # no test for a zero divisor: norms catch NaN and infinity


@compiled
def follow(s_o, ds, dds, n_left, coefficients, span):
    """Set the factors of M^, G^, G^T, H^, left and right each, in M, C and K of a following mesh, and its spans."""
    coefficients[:] = 0.0
    for side in range(2):
        h, dh = (s_o, ds) if side == 0 else (1.0 - s_o, -ds)
        coefficients[side, 0] = h
        coefficients[side, 1] = dh
        coefficients[2 + side, 1] = -ds
        coefficients[2 + side, 2] = -dds
        coefficients[4 + side, 1] = ds
        coefficients[6 + side, 2] = -ds * ds / h
    for e in range(span.shape[0]):
        left = e < n_left
        span[e, 0] = 0.0 if left else s_o
        span[e, 1] = s_o if left else 1.0 - s_o
        span[e, 2] = 0.0 if left else ds
        span[e, 3] = ds if left else -ds


@compiled
def combine(operators, coefficients, bands):
    """Set the bands of M, C and K: sums of operators with their factors at this instant.

    operators : (n_op, n, 2 b + 1);  coefficients : (n_op, 3);  bands : (3, n, 2 b + 1).
    """
    bands[:] = 0.0
    for o in range(operators.shape[0]):
        for k in range(3):
            factor = coefficients[o, k]
            if factor != 0.0:
                for i in range(bands.shape[1]):
                    for j in range(bands.shape[2]):
                        bands[k, i, j] += factor * operators[o, i, j]


@compiled
def add_banded(bands, n_fields, q, v, a, r, ab, tangent, c0, c1, c2):
    """Add M a + C v + K q and its tangent for scalar operators shared by all fields; bands : (3, n, 2 b + 1)."""
    _, n, width = bands.shape
    b = width // 2
    band = (ab.shape[1] - 1) // 3
    for i in range(n):
        row = i * n_fields
        for k in range(max(0, b - i), min(width, n + b - i)):
            away = (k - b) * n_fields
            m, c, stiffness = bands[0, i, k], bands[1, i, k], bands[2, i, k]
            for at in range(row, row + n_fields):
                r[at] += m * a[at + away] + c * v[at + away] + stiffness * q[at + away]
            if tangent:
                x = c2 * m + c1 * c + c0 * stiffness
                for at in range(row, row + n_fields):
                    ab[at, band + away] += x


@compiled
def add_contact(dofs, shape, m_row, c_row, k_row, load, q, v, a, r, ab, tangent, c0, c1, c2):
    """Add the mass, N^T (m a + c v + k q + load): shape functions N and rows m, c, k over the dofs (n, n_fields)."""
    band = (ab.shape[1] - 1) // 3
    for f in range(dofs.shape[1]):
        force = load[f]
        for j in range(dofs.shape[0]):
            d = dofs[j, f]
            force += m_row[j] * a[d] + c_row[j] * v[d] + k_row[j] * q[d]
        for i in range(dofs.shape[0]):
            row = dofs[i, f]
            r[row] += shape[i] * force
            if tangent:
                for j in range(dofs.shape[0]):
                    ab[row, band + dofs[j, f] - row] += shape[i] * (c2 * m_row[j] + c1 * c_row[j] + c0 * k_row[j])


@compiled
def add_catenary(span, dofs, tab, cable, q, r, ab, tangent, c0):
    """Add int (N t - T t_static) . phi' ds of the full cable; return the least mean tension of an element and its s.

    N t = (N/|r'|) r', r' = X' + w', N = T + alpha eps (3)-(4); the static part is taken off under the integral,
    in a form without cancellation, so that the hanging cable is in equilibrium to the last bit.
    """
    n_el, n_loc = dofs.shape
    alpha, sigma, slope, law = cable[0], cable[1], cable[2], cable[3]
    band = (ab.shape[1] - 1) // 3
    least = math.inf
    where = 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        pull = 0.0
        length = 0.0
        for g in range(tab.shape[1]):
            s = s_0 + h * tab[e, g, 0]
            weight = tab[e, g, 1]
            p = slope - sigma * s
            T = math.sqrt(1.0 + p * p)
            xp, yp = 1.0 / T, p / T
            du = 0.0
            dv = 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    grad = tab[e, g, 2 + n_loc + k]
                    du += grad * q[2 * d]
                    dv += grad * q[2 * d + 1]
            du /= h
            dv /= h
            rx, ry = xp + du, yp + dv
            stretch = math.sqrt(rx * rx + ry * ry)
            eps = (2.0 * (xp * du + yp * dv) + du * du + dv * dv) / (stretch + 1.0)
            N = T + alpha * eps
            pull += weight * N
            length += weight
            if law == 1.0 and N <= 0.0:
                fx, fy, k_geo, k_mat = -1.0, -p, 0.0, 0.0
            else:
                k_geo = N / stretch
                k_mat = (alpha - T) / (stretch * stretch * stretch)
                excess = (alpha - T) * eps / stretch
                fx, fy = excess * xp + k_geo * du, excess * yp + k_geo * dv
            if tangent:
                scale = c0 * weight / h
                j11 = scale * (k_geo + k_mat * rx * rx)
                j12 = scale * k_mat * rx * ry
                j22 = scale * (k_geo + k_mat * ry * ry)
            for i in range(n_loc):
                row = dofs[e, i]
                if row < 0:
                    continue
                gi = tab[e, g, 2 + n_loc + i]
                r[2 * row] += weight * gi * fx
                r[2 * row + 1] += weight * gi * fy
                if tangent:
                    for j in range(n_loc):
                        col = dofs[e, j]
                        if col < 0:
                            continue
                        gg = gi * tab[e, g, 2 + n_loc + j]
                        at = band + 2 * (col - row)
                        ab[2 * row, at] += gg * j11
                        ab[2 * row, at + 1] += gg * j12
                        ab[2 * row + 1, at - 1] += gg * j12
                        ab[2 * row + 1, at] += gg * j22
        if least * length > pull:
            least, where = pull / length, s_0 + 0.5 * h * (tab[e, 0, 0] + tab[e, -1, 0])
    return least, where


@compiled
def add_chord(span, dofs, tab, chord, q, r, ab, increment, tangent, c0):
    """Add the internal force of the one-field models; return the tension along the chord, tau + h.

    Tested with phi': tau w' + h (y_n' + kap w'), h = alpha lam int (y_n' w' + kap w'^2 / 2) ds;
    chord = (alpha, tau, curvature, lam, kap, law), y_n' = curvature (1/2 - s).  `increment` (n_dof,) receives
    int (y_n' + kap w') phi' ds: the tangent is banded plus alpha lam increment increment^T.
    """
    n_el, n_loc = dofs.shape
    alpha, tau, curvature, lam, kap, law = chord[0], chord[1], chord[2], chord[3], chord[4], chord[5]
    band = (ab.shape[1] - 1) // 3
    h_t = 0.0
    n_q = tab.shape[1]
    slope = np.empty((n_el, n_q))
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        for g in range(n_q):
            w = 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    w += tab[e, g, 2 + n_loc + k] * q[d]
            w /= h
            slope[e, g] = w
            y = curvature * (0.5 - (s_0 + h * tab[e, g, 0]))
            h_t += tab[e, g, 1] * h * (y * w + 0.5 * kap * w * w)
    h_t *= alpha * lam
    tension = tau + h_t
    slack = law == 1.0 and tension <= 0.0
    if slack:
        h_t = -tau
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        for g in range(n_q):
            weight = tab[e, g, 1]
            w = slope[e, g]
            y = curvature * (0.5 - (s_0 + h * tab[e, g, 0])) + kap * w
            f = tau * w + h_t * y
            stiffness = c0 * weight / h * (tau + kap * h_t)
            for i in range(n_loc):
                row = dofs[e, i]
                if row < 0:
                    continue
                gi = tab[e, g, 2 + n_loc + i]
                r[row] += weight * gi * f
                if not slack:
                    increment[row] += weight * gi * y
                if tangent:
                    for j in range(n_loc):
                        col = dofs[e, j]
                        if col >= 0:
                            ab[row, band + col - row] += gi * tab[e, g, 2 + n_loc + j] * stiffness
    return tension


@compiled
def assemble(
    bands, span, dofs, tab, cable, contact, shape, m_row, c_row, k_row, load, q, v, a, r, ab, increment, tangent,
    c0, c1, c2,
):  # fmt: skip
    """Set the residual of the cable with its mass and, if asked, the banded tangent; return as `add_catenary`.

    One field per node is a one-field model, `add_chord`, whose tension is least at no place in particular.
    """
    n_fields = contact.shape[1]
    r[:] = 0.0
    if tangent:
        ab[:] = 0.0
    add_banded(bands, n_fields, q, v, a, r, ab, tangent, c0, c1, c2)
    if n_fields == 2:
        least, where = add_catenary(span, dofs, tab, cable, q, r, ab, tangent, c0)
    else:
        increment[:] = 0.0
        least, where = add_chord(span, dofs, tab, cable, q, r, ab, increment, tangent, c0), 0.5
    add_contact(contact, shape, m_row, c_row, k_row, load, q, v, a, r, ab, tangent, c0, c1, c2)
    return least, where


KEEP = 0.1  # a diagonal pivot stays while it is at least this part of its column's largest: rows then keep their width


@compiled
def factorise(ab, pivots):
    """Factorise a banded matrix in place, P A = L U, and return whether it is regular.

    Gaussian elimination with threshold pivoting (Duff, Erisman & Reid 1986, section 5.2): the tangents here are nearly
    always diagonally strong, and a row that keeps its place brings no new column in.  LAPACK's dgbtrf spends most of
    its time on calls for bands this narrow.

    pivots : (2, n); row exchanged with each row, and the last column that each row of U reaches.
    """
    n, width = ab.shape
    band = (width - 1) // 3
    for i in range(n):  # rows inside an element do not reach as far as the band
        last = min(n - 1, i + band)
        while last > i and ab[i, band + last - i] == 0.0:
            last -= 1
        pivots[1, i] = last
    for i in range(n):
        last = min(n - 1, i + band)
        largest, at = abs(ab[i, band]), i
        own = largest
        for k in range(i + 1, last + 1):
            size = abs(ab[k, band + i - k])
            if size > largest:
                largest, at = size, k
        if not (largest > 0.0 and largest < math.inf):
            return False
        if own >= KEEP * largest:
            at = i
        pivots[0, i] = at
        if at != i:
            end = max(pivots[1, i], pivots[1, at])
            for j in range(i, end + 1):
                x = ab[i, band + j - i]
                ab[i, band + j - i] = ab[at, band + j - at]
                ab[at, band + j - at] = x
            pivots[1, i], pivots[1, at] = pivots[1, at], pivots[1, i]
        reach = pivots[1, i]
        inverse = 1.0 / ab[i, band]
        for k in range(i + 1, last + 1):
            below = ab[k, band + i - k]
            if below != 0.0:
                factor = below * inverse
                ab[k, band + i - k] = factor
                shift = band - k
                for j in range(i + 1, reach + 1):
                    ab[k, shift + j] -= factor * ab[i, band - i + j]
                if reach > pivots[1, k]:
                    pivots[1, k] = reach
    return True


@compiled
def solve(ab, pivots, b):
    """Overwrite b (n,) with A^-1 b, A as `factorise` left it."""
    n, width = ab.shape
    band = (width - 1) // 3
    for i in range(n):
        at = pivots[0, i]
        x = b[at]
        if at != i:
            b[at] = b[i]
            b[i] = x
        for k in range(i + 1, min(n, i + band + 1)):
            b[k] -= ab[k, band + i - k] * x
    for i in range(n - 1, -1, -1):
        x = b[i]
        for j in range(i + 1, pivots[1, i] + 1):
            x -= ab[i, band + j - i] * b[j]
        b[i] = x / ab[i, band]


@compiled
def coupling(chord):
    """Return alpha lam, the strength of `add_chord`'s increment in the tangent; meaningless for the full cable."""
    return chord[0] * chord[3]


@compiled
def factorise_coupled(ab, pivots, increment, coupled, strength):
    """Factorise A + strength increment increment^T, A banded; return whether it is regular.

    Sherman & Morrison: a uniform tension increment couples all nodes through one vector.  `coupled` receives what
    `solve_coupled` takes; the full cable has no such vector, its increment is empty.
    """
    regular = factorise(ab, pivots)
    if regular and increment.size > 0:
        coupled[:] = increment
        solve(ab, pivots, coupled)
        coupled *= strength / (1.0 + strength * dot(increment, coupled))
    return regular


@compiled
def solve_coupled(ab, pivots, increment, coupled, b):
    """Overwrite b (n,) with the solution for the matrix that `factorise_coupled` has left."""
    solve(ab, pivots, b)
    if increment.size > 0:
        b -= dot(increment, b) * coupled


@compiled
def dot(a, b):
    """Return the scalar product; a call of BLAS takes longer at this length."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled
def correct(start, rule, share, da, now, balanced):
    """Take share da off the rows q, v, a of the step's end, and set where the balance is taken; (3, n)."""
    for i in range(3):
        part, w = share * rule[i, 3], rule[i, 4]
        for j in range(da.size):
            now[i, j] -= part * da[j]
            balanced[i, j] = w * now[i, j] + (1.0 - w) * start[i, j]


@compiled
def settle(
    operators, coefficients, bands, span, dofs, tab, cable, contact, shape, m_row, c_row, k_row, load,
    ab, pivots, increment, coupled, start, now, rule, bound, max_iter, reuse, patience,
):  # fmt: skip
    """Find the end of a step by Newton's method as `cablefem.newmark.iterate` does, compiled with the balance.

    Return |r|, iterations, factorisations, residuals, the least tension and its s.
    """
    n = start.shape[1]
    balanced, r, da, idle = np.empty((3, n)), np.empty(n), np.zeros(n), np.empty_like(increment)
    q, v, a = balanced[0], balanced[1], balanced[2]
    combine(operators, coefficients, bands)
    for i in range(3):
        for j in range(n):
            now[i, j] = rule[i, 0] * start[0, j] + rule[i, 1] * start[1, j] + rule[i, 2] * start[2, j]
    c0, c1, c2 = rule[0, 3] * rule[0, 4], rule[1, 3] * rule[1, 4], rule[2, 3] * rule[2, 4]
    norm, factorisations, residuals, anew, regular = 0.0, 0, 0, True, True
    for iteration in range(max_iter):
        if anew:
            correct(start, rule, 0.0, da, now, balanced)
            assemble(
                bands, span, dofs, tab, cable, contact, shape, m_row, c_row, k_row, load, q, v, a, r, ab, increment,
                True, c0, c1, c2,
            )  # fmt: skip
            norm = math.sqrt(dot(r, r))
            regular = factorise_coupled(ab, pivots, increment, coupled, c0 * coupling(cable))
            factorisations += 1
        before = norm
        if regular:
            solve_coupled(ab, pivots, increment, coupled, r)
        else:
            r[:] = math.nan  # the norm will tell
        da[:] = r
        for halving in range(6):
            correct(start, rule, 1.0 if halving == 0 else -(0.5**halving), da, now, balanced)
            least, where = assemble(
                bands, span, dofs, tab, cable, contact, shape, m_row, c_row, k_row, load, q, v, a, r, ab, idle,
                False, c0, c1, c2,
            )  # fmt: skip
            residuals += 1
            norm = math.sqrt(dot(r, r))
            if norm < before or (iteration < patience and norm < math.inf):
                break
        if norm <= bound or not norm < math.inf:
            break
        anew = norm > reuse * before
    return norm, iteration + 1, factorisations, residuals, least, where


@compiled
def sample(knots, shapes, dofs, s_o, ds, s, q, v, out):
    """Set w, dw/dt at fixed s and w' at the places s (m,) of a following mesh, out (3, m, n_fields); at s_o behind.

    knots : (2, n_el + 1) of the two sides;  shapes : polynomial coefficients, see `reference.shape_polynomials`.
    """
    n_el, n_loc = knots.shape[1] - 1, shapes.shape[0]
    n_fields = out.shape[2]
    out[:] = 0.0
    for p in range(s.size):
        side = 0 if s[p] <= s_o and s_o > 0.0 else 1
        s_0, h = (0.0, s_o) if side == 0 else (s_o, 1.0 - s_o)
        xi = min(1.0, max(0.0, (s[p] - s_0) / h))
        pull = ds * (xi if side == 0 else 1.0 - xi)
        low, high = 0, n_el  # the element left of a knot answers there
        while high - low > 1:
            middle = (low + high) // 2
            if knots[side, middle] < xi:
                low = middle
            else:
                high = middle
        length = knots[side, low + 1] - knots[side, low]
        x = (xi - knots[side, low]) / length
        for k in range(n_loc):
            d = dofs[side * n_el + low, k]
            if d < 0:
                continue
            value, slope = 0.0, 0.0
            for m in range(n_loc - 1, -1, -1):
                slope = slope * x + value
                value = value * x + shapes[k, m]
            slope /= length * h
            for f in range(n_fields):
                w = q[n_fields * d + f]
                out[0, p, f] += value * w
                out[1, p, f] += value * v[n_fields * d + f] - pull * slope * w
                out[2, p, f] += slope * w


@compiled
def cable_energy(span, dofs, tab, cable, q, v):
    """Return int( |w.|^2/2 + T eps + alpha eps^2/2 - sigma v ) ds, the least tension and its s; full cable.

    w. = dq/dt phi - c q phi', the velocity at fixed s on a mesh that moves with c.
    """
    n_el, n_loc = dofs.shape
    alpha, sigma, slope = cable[0], cable[1], cable[2]
    energy = 0.0
    least = math.inf
    where = 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        for g in range(tab.shape[1]):
            xi = tab[e, g, 0]
            s = s_0 + h * xi
            c = span[e, 2] + span[e, 3] * xi
            p = slope - sigma * s
            T = math.sqrt(1.0 + p * p)
            xp, yp = 1.0 / T, p / T
            du, dv, v0, ut, vt = 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, grad = tab[e, g, 2 + k], tab[e, g, 2 + n_loc + k] / h
                    du += grad * q[2 * d]
                    dv += grad * q[2 * d + 1]
                    v0 += phi * q[2 * d + 1]
                    ut += phi * v[2 * d] - c * grad * q[2 * d]
                    vt += phi * v[2 * d + 1] - c * grad * q[2 * d + 1]
            stretch = math.sqrt((xp + du) ** 2 + (yp + dv) ** 2)
            eps = (2.0 * (xp * du + yp * dv) + du * du + dv * dv) / (stretch + 1.0)
            N = T + alpha * eps
            if least > N:
                least, where = N, s
            # a slack point of the tension-only law has spent its energy at eps = -T/alpha
            stored = T * eps + 0.5 * alpha * eps * eps
            if cable[3] == 1.0 and N < 0.0:
                stored = -0.5 * T * T / alpha
            energy += tab[e, g, 1] * h * (0.5 * (ut * ut + vt * vt) + stored - sigma * v0)
    return energy, least, where


@compiled
def chord_energy(span, dofs, tab, chord, q, v):
    """Return int( w.^2/2 + tau w'^2/2 ) ds + h^2/(2 alpha) of the one-field models, and the tension tau + h."""
    n_el, n_loc = dofs.shape
    alpha, tau, curvature, lam, kap = chord[0], chord[1], chord[2], chord[3], chord[4]
    energy = 0.0
    h_t = 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        for g in range(tab.shape[1]):
            xi = tab[e, g, 0]
            c = span[e, 2] + span[e, 3] * xi
            w, wt = 0.0, 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, grad = tab[e, g, 2 + k], tab[e, g, 2 + n_loc + k] / h
                    w += grad * q[d]
                    wt += phi * v[d] - c * grad * q[d]
            y = curvature * (0.5 - (s_0 + h * xi))
            h_t += tab[e, g, 1] * h * (y * w + 0.5 * kap * w * w)
            energy += tab[e, g, 1] * h * 0.5 * (wt * wt + tau * w * w)
    h_t *= alpha * lam
    if lam != 0.0:
        energy += 0.5 * h_t * h_t / alpha
    return energy, tau + h_t
