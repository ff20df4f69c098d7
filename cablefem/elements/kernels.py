"""Compiled inner loops of the cable elements: forces, banded tangents, energies.

All take tables that scikit-fem filled on the reference meshes; nothing is assembled symbolically in time.
Compiled because a step of these small systems costs more in interpreter than in arithmetic otherwise.

Common arguments
    q, v, a   (n_dof,)  unknowns, field index running fastest: dof * n_fields + field
    span      (n_el, 4) rows (s at xi = 0, ds/dxi, mesh velocity at xi = 0, d/dxi of it) of the element's side
    dofs      (n_el, n_loc) scalar dof, -1 on a support
    tab       (n_el, n_q, 2 + 2 n_loc) rows: xi, weight, shape values, shape d/dxi
    cable     (alpha, sigma, c, law)  law 0 elastic, 1 tension-only
    ab        (n_dof, 3 b + 1) transposed LAPACK band storage: ab[j, 2 b + i - j] = A[i, j]
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True)
def add_banded(kin, coefficients, n_fields, q, v, a, r, ab, tangent, c0, c1, c2):
    """Add M a + C v + K q and its tangent for scalar operators shared by all fields.

    kin : (n_op, n, 2 b + 1) bands of the operators; coefficients : (n_op, 3) their factors in M, C, K.
    """
    n_op, n, width = kin.shape
    b = width // 2
    band = (ab.shape[1] - 1) // 3
    for i in range(n):
        for k in range(width):
            j = i + k - b
            if j < 0 or j >= n:
                continue
            m = 0.0
            c = 0.0
            s = 0.0
            for o in range(n_op):
                x = kin[o, i, k]
                m += coefficients[o, 0] * x
                c += coefficients[o, 1] * x
                s += coefficients[o, 2] * x
            t = c2 * m + c1 * c + c0 * s
            for f in range(n_fields):
                row, col = i * n_fields + f, j * n_fields + f
                r[row] += m * a[col] + c * v[col] + s * q[col]
                if tangent:
                    ab[col, 2 * band + row - col] += t


@njit(cache=True)
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
                        at = 2 * band + 2 * (row - col)
                        ab[2 * col, at] += gg * j11
                        ab[2 * col, at + 1] += gg * j12
                        ab[2 * col + 1, at - 1] += gg * j12
                        ab[2 * col + 1, at] += gg * j22
        if least * length > pull:
            least, where = pull / length, s_0 + 0.5 * h * (tab[e, 0, 0] + tab[e, -1, 0])
    return least, where


@njit(cache=True)
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
                            ab[col, 2 * band + row - col] += gi * tab[e, g, 2 + n_loc + j] * stiffness
    return tension


@njit(cache=True)
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


@njit(cache=True)
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
