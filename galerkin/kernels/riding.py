"""Compiled tangent and solution for sines that ride with the mass.

The two sides meet in the hat alone.  A side's unknowns are its sines of u, those of v, and both hats.
"""

from __future__ import annotations

import math

import numpy as np

from galerkin.bases.riding import index_of_sine, side_length
from galerkin.kernels.dense import empty_factors, factorise, multiply, solve
from galerkin.law import inner


@inner
def set_riding_tangent(tables, at_mass, sines, workspace, c):
    """Set K of `Workspace` (2, 2 n + 2, 2 n + 2), by sides, to the tangent of cable and mass."""
    terms = at_mass.inertia
    K = workspace.K
    c0, c1, c2 = c
    n = tables.mass.shape[0] - 1
    of_mass = c2 + c1 * sines.cable.damping
    for side in range(2):
        h, dh, _ = side_length((at_mass.s_o, at_mass.ds_o, 0.0), side)
        cosine, sine = tangent_sums(tables, sines.tau, workspace, c, side, dh / h)
        for ab in range(4):
            set_field_block(cosine[ab], sine[ab], 0.5 / (h * h), sines.tau, ab // 2, ab % 2, K[side])
        for j in range(n + 1):
            for k in range(n + 1):
                at = index_of_sine(side, j, n)
                to = index_of_sine(side, k, n)
                value = of_mass * terms.mass[at, to] + c1 * terms.gyroscopic[to, at] + c0 * terms.centrifugal[to, at]
                for a in range(2):
                    if j or k or side == 0:
                        K[side, row_of_sine(a, j, n), row_of_sine(a, k, n)] += value
    for a in range(2):
        K[0, 2 * n + a, 2 * n + a] += c2 * sines.cable.inertia


@inner
def row_of_sine(a, j, n):
    """Row of sine j of field a, or of its hat, j = 0."""
    return a * n + j - 1 if j else 2 * n + a


@inner
def tangent_sums(tables, tau, workspace, c, side, grows):
    """Sums of tangents xx, xy, yx, yy over cos(k pi xi) and xi sin(k pi xi), (4, 2 n + 1) each.

    With internal damping also of t (c1 d(deps/dt)/dv + c0 d(deps/dt)/dq), dPhi'/dt = -(h./h) (phi' + xi phi'')/h.
    """
    m = tables.xi.size
    count = tables.cosines.shape[0]
    c0, c1, _ = c
    even = np.empty((4, m))
    odd = np.empty((4, m))
    cosine = np.empty((4, count))
    sine = np.empty((4, count))
    moves = c0 * grows
    rates = workspace.rates
    for ab in range(4):
        a = ab // 2
        b = ab % 2
        for q in range(m):
            p = q if side == 0 else 2 * m - 1 - q
            even[ab, q] = c0 * workspace.gram[a + b, p]
            if tau > 0.0:
                along = rates[4, p] * rates[a, p] * rates[b, p]
                even[ab, q] += (c1 - moves) * along + c0 * rates[a, p] * rates[2 + b, p]
                odd[ab, q] = moves * along
    multiply(even, tables.cosines, True, cosine)
    if tau > 0.0:
        multiply(odd, tables.sines, True, sine)
    return cosine, sine


@inner
def set_field_block(C, S, scale, tau, a, b, K):
    """Set the block of fields a, b from the sums of `tangent_sums`; the hat is k = 0 with kappa_0 = 1.

    phi_j' phi_k' = kappa_j kappa_k/2 (cos((j-k) pi xi) + cos((j+k) pi xi)), and sines likewise.
    """
    n = C.size // 2
    for j in range(n + 1):
        wave = scale * (j * math.pi if j else 1.0)
        for k in range(n + 1):
            kappa = k * math.pi if k else 1.0
            value = C[abs(j - k)] + C[j + k]
            if tau > 0.0 and k:
                value += kappa * (S[j + k] + (S[k - j] if k > j else -S[j - k]))
            K[row_of_sine(a, j, n), row_of_sine(b, k, n)] = wave * kappa * value


@inner
def solve_sides(K, r, x):
    """Set x to the solution of the tangent K of `set_riding_tangent`, to NaN if it is singular.

    The sines of each side are eliminated; the Schur complement is that of the hats.
    """
    n = K.shape[1] // 2 - 1
    rows = np.empty((2, 3, 2 * n))
    S = np.zeros((2, 2))
    rest = np.empty(2)
    for a in range(2):
        rest[a] = r[a * (2 * n + 1) + 2 * n]
    for side in range(2):
        for a in range(2):
            for k in range(n):
                rows[side, 0, a * n + k] = r[a * (2 * n + 1) + side * n + k]
        for i in range(2 * n):
            rows[side, 1, i] = K[side, i, 2 * n]
            rows[side, 2, i] = K[side, i, 2 * n + 1]
        factors = empty_factors(2 * n)
        factorise(K[side], factors)
        for row in range(3):
            solve(factors, rows[side, row])
        for a in range(2):
            border = K[side, 2 * n + a]
            S[a, 0] += border[2 * n]
            S[a, 1] += border[2 * n + 1]
            for i in range(2 * n):
                rest[a] -= border[i] * rows[side, 0, i]
                S[a, 0] -= border[i] * rows[side, 1, i]
                S[a, 1] -= border[i] * rows[side, 2, i]
    det = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
    u = (S[1, 1] * rest[0] - S[0, 1] * rest[1]) / det
    v = (S[0, 0] * rest[1] - S[1, 0] * rest[0]) / det
    x[2 * n] = u
    x[4 * n + 1] = v
    for side in range(2):
        for a in range(2):
            for k in range(n):
                i = a * n + k
                x[a * (2 * n + 1) + side * n + k] = rows[side, 0, i] - u * rows[side, 1, i] - v * rows[side, 2, i]
