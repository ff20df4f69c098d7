"""The balance of a cable on its mesh with a mass whose place is given: forces and their banded tangent."""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.law import ELASTIC, pull, tension


class Mesh(NamedTuple):
    """Elements at an instant, each in the xi of its side of the mass."""

    span: Any  # (n_el, 6) s at xi = 0, ds/dxi, mesh velocity at xi = 0, d/dxi of it, and the same of its acceleration
    dofs: Any  # (n_el, n_loc) scalar unknowns, -1 on a support
    tab: Any  # (n_el, n_q, 2 + 2 n_loc) xi, weight, shape values, shape d/dxi


class Contact(NamedTuple):
    """The mass on its cable, N^T (m a + c v + k q + load): shape functions N and rows m, c, k over the dofs."""

    dofs: Any  # (n_loc, n_fields)
    shape: Any  # (n_loc,)
    m_row: Any
    c_row: Any
    k_row: Any
    load: Any  # (n_fields,)


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
        span[e, 4] = 0.0 if left else dds
        span[e, 5] = dds if left else -dds


@compiled
def combine(operators, coefficients, bands):
    """Set the diagonals of M, C and K: sums of operators with their factors at this instant.

    operators : (n_op, 2 b + 1, n);  coefficients : (n_op, 3);  bands : (3, 2 b + 1, n).
    """
    bands[:] = 0.0
    for o in range(operators.shape[0]):
        for k in range(3):
            factor = coefficients[o, k]
            if factor != 0.0:
                for d in range(bands.shape[1]):
                    of, to = operators[o, d], bands[k, d]
                    for i in range(to.size):
                        to[i] += factor * of[i]


@compiled
def combine_following(operators, s_o, ds, dds, first, last, bands):
    """Set the same of a following mesh with the factors of `follow`; rows up to `last` are of its left side.

    Those from `first` on are of the right one: at the mass they are of both.
    """
    n = bands.shape[2]
    for side in range(2):
        h, dh = (s_o, ds) if side == 0 else (1.0 - s_o, -ds)
        flux = ds * ds / h
        a, b = (0, last) if side == 0 else (last, n)
        for d in range(bands.shape[1]):
            M, G, GT, H = operators[side, d], operators[2 + side, d], operators[4 + side, d], operators[6 + side, d]
            m, c, k = bands[0, d], bands[1, d], bands[2, d]
            for i in range(first if side == 1 else last, last):
                m[i] += h * M[i]
                c[i] += dh * M[i] + ds * (GT[i] - G[i])
                k[i] -= dds * G[i] + flux * H[i]
            for i in range(a, b):
                m[i] = h * M[i]
                c[i] = dh * M[i] + ds * (GT[i] - G[i])
                k[i] = -dds * G[i] - flux * H[i]


@compiled
def add_banded(bands, n_fields, q, v, a, r, ab, tangent, c0, c1, c2):
    """Add M a + C v + K q, and set its tangent; bands : (3, 2 b + 1, n) as `cable.bands` has them, of all fields."""
    width, n = bands.shape[1:]
    band = (ab.shape[1] - 1) // 3
    for d in range(width):
        away = (d - width // 2) * n_fields
        first, last = max(0, -away), min(n, n - away)
        m, c, k = bands[0, d, first:last], bands[1, d, first:last], bands[2, d, first:last]
        of_q, of_v, of_a = q[first + away : last + away], v[first + away : last + away], a[first + away : last + away]
        to = r[first:last]
        for i in range(to.size):  # slices without a stride: compiled to vectors
            to[i] += m[i] * of_a[i] + c[i] * of_v[i] + k[i] * of_q[i]
    if not tangent:
        return
    ab[:] = 0.0
    blend = np.empty(n)
    for d in range(width):
        m, c, k, at = bands[0, d], bands[1, d], bands[2, d], band + (d - width // 2) * n_fields
        for i in range(n):
            blend[i] = c2 * m[i] + c1 * c[i] + c0 * k[i]
        for i in range(n):
            ab[i, at] = blend[i]


@compiled
def add_contact(contact, q, v, a, r, ab, tangent, c0, c1, c2):
    """Add the mass, see `Contact`."""
    dofs, shape, m_row, c_row, k_row, load = contact
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
def at_rest(cable, s):
    """Return x', y' and T of the hanging cable at s."""
    p = cable[2] - cable[1] * s
    T = math.sqrt(1.0 + p * p)
    xp = 1.0 / T
    return xp, p * xp, T


@compiled
def bend_at_rest(cable, yp, T):
    """Return x'' and y'' of the hanging cable where y' and T are these."""
    return cable[1] * yp / (T * T), -cable[1] / (T * T * T)


@compiled
def slopes(dofs, tab, q, e, g):
    """Return d/dxi of u and v at a point of an element."""
    du, dv = 0.0, 0.0
    for k in range(dofs.shape[1]):
        d = dofs[e, k]
        if d >= 0:
            grad = tab[e, g, 2 + dofs.shape[1] + k]
            du += grad * q[2 * d]
            dv += grad * q[2 * d + 1]
    return du, dv


@compiled
def add_stiffness(dofs, tab, e, g, row, gi, j11, j12, j22, ab):
    """Add gi j phi_k' of all functions k of an element at a point to two rows of the band; j of 2 fields, symmetric."""
    band = (ab.shape[1] - 1) // 3
    for k in range(dofs.shape[1]):
        col = dofs[e, k]
        if col >= 0:
            gg = gi * tab[e, g, 2 + dofs.shape[1] + k]
            at = band + 2 * (col - row)
            ab[2 * row, at] += gg * j11
            ab[2 * row, at + 1] += gg * j12
            ab[2 * row + 1, at - 1] += gg * j12
            ab[2 * row + 1, at] += gg * j22


@compiled
def add_block(ab, row, col, j11, j12, j22):
    """Add j of 2 fields, symmetric, to the rows of a node at the columns of another."""
    at = (ab.shape[1] - 1) // 3 + 2 * (col - row)
    ab[2 * row, at] += j11
    ab[2 * row, at + 1] += j12
    ab[2 * row + 1, at - 1] += j12
    ab[2 * row + 1, at] += j22


def add_catenary_of(n_loc, n_q):
    """Return `add_catenary` for elements of so many functions and points, whose loops are written out; 0: for any."""

    @compiled
    def add(mesh, cable, q, r, ab, tangent, c0):
        span, dofs, tab = mesh
        n_el = dofs.shape[0]
        functions, points = (n_loc, n_q) if n_loc > 0 else (dofs.shape[1], tab.shape[1])
        alpha, law = cable[0], cable[3]
        at = np.empty((7, n_el * points))
        s, du, dv, N, j11, j12, j22 = at[0], at[1], at[2], at[3], at[4], at[5], at[6]
        for e in range(n_el):
            per_h = 1.0 / span[e, 1]
            for g in range(points):
                x, y = 0.0, 0.0
                for k in range(functions):
                    d = dofs[e, k]
                    if d >= 0:
                        grad = tab[e, g, 2 + functions + k]
                        x += grad * q[2 * d]
                        y += grad * q[2 * d + 1]
                p = e * points + g
                s[p], du[p], dv[p] = span[e, 0] + span[e, 1] * tab[e, g, 0], x * per_h, y * per_h
        for p in range(s.size):
            xp, yp, T = at_rest(cable, s[p])
            rx, ry = xp + du[p], yp + dv[p]
            fx, fy, k_geo, k_mat, _, _, eps = pull(xp, yp, T, du[p], dv[p], alpha, law)
            N[p] = tension(eps, T, alpha, ELASTIC)[0]  # below zero where the cable is slack
            du[p], dv[p] = fx, fy
            j11[p], j12[p], j22[p] = k_geo + k_mat * rx * rx, k_mat * rx * ry, k_geo + k_mat * ry * ry
        least, where = math.inf, 0.0
        for e in range(n_el):
            total, length = 0.0, 0.0
            for g in range(points):
                total += tab[e, g, 1] * N[e * points + g]
                length += tab[e, g, 1]
            if least * length > total:
                least, where = total / length, span[e, 0] + 0.5 * span[e, 1] * (tab[e, 0, 0] + tab[e, -1, 0])
            per_h = c0 / span[e, 1]
            for i in range(functions):
                row = dofs[e, i]
                if row < 0:
                    continue
                fx, fy = 0.0, 0.0
                for g in range(points):
                    grad = tab[e, g, 1] * tab[e, g, 2 + functions + i]
                    fx += grad * du[e * points + g]
                    fy += grad * dv[e * points + g]
                r[2 * row] += fx
                r[2 * row + 1] += fy
                for k in range(i + 1 if tangent else 0):
                    col = dofs[e, k]
                    if col < 0:
                        continue
                    k11, k12, k22 = 0.0, 0.0, 0.0
                    for g in range(points):
                        p = e * points + g
                        both = tab[e, g, 1] * tab[e, g, 2 + functions + i] * tab[e, g, 2 + functions + k]
                        k11 += both * j11[p]
                        k12 += both * j12[p]
                        k22 += both * j22[p]
                    k11, k12, k22 = per_h * k11, per_h * k12, per_h * k22
                    add_block(ab, row, col, k11, k12, k22)
                    if k < i:
                        add_block(ab, col, row, k11, k12, k22)
        return least, where

    return add


add_catenary_of_p2, add_catenary_of_any = add_catenary_of(3, 2), add_catenary_of(0, 0)


@compiled
def add_catenary(mesh, cable, q, r, ab, tangent, c0):
    """Add int (N t - T X') . phi' ds of the full cable; return the least mean tension of an element and its s.

    Loops over all points that only compute are compiled to vectors, gathering and scattering have loops of their own.
    """
    if mesh.dofs.shape[1] == 3 and mesh.tab.shape[1] == 2:
        return add_catenary_of_p2(mesh, cable, q, r, ab, tangent, c0)
    return add_catenary_of_any(mesh, cable, q, r, ab, tangent, c0)


@compiled
def add_chord(mesh, chord, q, r, ab, increment, tangent, c0):
    """Add the internal force of the one-field models; return the tension along the chord, N = tau + h.

    Tested with phi': tau w' + h (y_n' + kap w'), h = alpha eps, eps = lam int (y_n' w' + kap w'^2 / 2) ds;
    chord = (alpha, tau, curvature, lam, kap, law), y_n' = curvature (1/2 - s).  With the tangent `increment` (n_dof,)
    receives int (y_n' + kap w') phi' ds: the tangent is banded plus lam dN/deps increment increment^T.
    """
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    alpha, tau, curvature, lam, kap, law = chord[0], chord[1], chord[2], chord[3], chord[4], chord[5]
    band = (ab.shape[1] - 1) // 3
    eps = 0.0
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
            eps += tab[e, g, 1] * h * (y * w + 0.5 * kap * w * w)
    eps *= lam
    N, dN, _ = tension(eps, tau, alpha, law)
    h_t = N - tau
    if tangent:
        increment[:] = 0.0
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
                if tangent:
                    if dN > 0.0:
                        increment[row] += weight * gi * y
                    for j in range(n_loc):
                        col = dofs[e, j]
                        if col >= 0:
                            ab[row, band + col - row] += gi * tab[e, g, 2 + n_loc + j] * stiffness
    return tension(eps, tau, alpha, ELASTIC)[0]


@compiled
def coupling(chord):
    """Return alpha lam, the strength of `add_chord`'s increment in the tangent; meaningless for the full cable."""
    return chord[0] * chord[3]


@compiled
def assemble(bands, mesh, cable, contact, q, v, a, r, work, c0, c1, c2):
    """Set the residual of the cable with its mass and, unless c0, c1, c2 vanish, its banded tangent.

    Return as `add_catenary`.  One field per node is a one-field model, `add_chord`, whose tension is least at no place
    in particular.
    """
    tangent = c0 != 0.0 or c1 != 0.0 or c2 != 0.0  # no argument: numba would compile all this for each of its values
    n_fields = contact.dofs.shape[1]
    r[:] = 0.0
    add_banded(bands, n_fields, q, v, a, r, work.ab, tangent, c0, c1, c2)
    if n_fields == 2:
        least, where = add_catenary(mesh, cable, q, r, work.ab, c0 != 0.0, c0)
    else:
        least, where = add_chord(mesh, cable, q, r, work.ab, work.increment, tangent, c0), 0.5
    add_contact(contact, q, v, a, r, work.ab, tangent, c0, c1, c2)
    return least, where
