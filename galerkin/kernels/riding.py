"""Compiled tangent and solution for sines that ride with the mass.

The two sides meet in the hat alone.  A side's unknowns are its sines of u, those of v, and both hats.
"""

from __future__ import annotations

import math

import numpy as np

from galerkin.kernels.dense import multiply, solve_rows
from galerkin.law import inner


@inner
def riding_tangent(of, ground, gram, cable, c, K):
    """Set K (2, 2 n + 2, 2 n + 2), by sides, to the tangent of cable and mass; gram as in `stiffness`.

    phi_j' phi_k' = kappa_j kappa_k/2 (cos((j-k) pi xi) + cos((j+k) pi xi)); the hat is k = 0 with kappa_0 = 1.
    """
    x, (c0, c1, c2) = ground.x, c
    of_mass = c2 + c1 * cable.damping
    n, m = of.mass.shape[0] - 1, of.xi.size
    part, sums = np.empty((3, m)), np.empty((3, 2 * n + 1))
    for side in range(2):
        h = ground.s_o if side == 0 else 1.0 - ground.s_o
        for i in range(3):
            for q in range(m):
                part[i, q] = gram[i, q if side == 0 else 2 * m - 1 - q]
        multiply(part, of.cosines, True, sums)
        for a in range(2):
            for b in range(2):
                row_of_sums = sums[a + b]
                for j in range(n + 1):
                    wave = c0 * 0.5 / (h * h) * (j * math.pi if j else 1.0)
                    i, at = (a * n + j - 1, side * n + j - 1) if j else (2 * n + a, 2 * n)
                    for k in range(n + 1):
                        to, of_x = (b * n + k - 1, side * n + k - 1) if k else (2 * n + b, 2 * n)
                        kappa = k * math.pi if k else 1.0
                        value = wave * kappa * (row_of_sums[abs(j - k)] + row_of_sums[j + k])
                        if a == b and (j or k or side == 0):
                            value += (
                                of_mass * x.mass[at, of_x] + c1 * x.gyroscopic[of_x, at] + c0 * x.centrifugal[of_x, at]
                            )
                        K[side, i, to] = value
    for a in range(2):
        K[0, 2 * n + a, 2 * n + a] += c2 * cable.inertia


@inner
def add_rate_tangent(of, ground, rates, c, K):
    """Add internal damping to `riding_tangent`, int Phi_i' t (c1 d(deps/dt)/dv + c0 d(deps/dt)/dq) ds.

    dPhi'/dt = -(h./h) (phi' + xi phi'')/h: products of cosines, and of a cosine and a sine.
    """
    c0, c1, _ = c
    n, m = of.mass.shape[0] - 1, of.xi.size
    even, odd, cosine, sine = np.empty((4, m)), np.empty((4, m)), np.empty((4, 2 * n + 1)), np.empty((4, 2 * n + 1))
    C, S = np.empty(3 * n + 1), np.empty(3 * n + 1)  # sums over cos(k pi xi) and xi sin(k pi xi), k = -n .. 2 n
    for side in range(2):
        h, dh = (ground.s_o, ground.ds_o) if side == 0 else (1.0 - ground.s_o, -ground.ds_o)
        moves = c0 * dh / h
        for q in range(m):
            p = q if side == 0 else 2 * m - 1 - q
            for a in range(2):
                for b in range(2):
                    along = rates[4, p] * rates[a, p] * rates[b, p]
                    even[2 * a + b, q] = (c1 - moves) * along + c0 * rates[a, p] * rates[2 + b, p]
                    odd[2 * a + b, q] = moves * along
        multiply(even, of.cosines, True, cosine)
        multiply(odd, of.sines, True, sine)
        for ab in range(4):
            for k in range(2 * n + 1):
                C[n + k], S[n + k] = cosine[ab, k], sine[ab, k]
            for k in range(1, n + 1):
                C[n - k], S[n - k] = C[n + k], -S[n + k]
            a, b = ab // 2, ab % 2
            for j in range(n + 1):
                wave, i = 0.5 / (h * h) * (j * math.pi if j else 1.0), a * n + j - 1 if j else 2 * n + a
                less, more, less_odd, more_odd = C[n - j :], C[n + j :], S[n - j :], S[n + j :]
                row = K[side, i, b * n :]
                for k in range(1, n + 1):
                    kappa = k * math.pi
                    row[k - 1] += wave * kappa * (less[k] + more[k] + kappa * (less_odd[k] + more_odd[k]))
                K[side, i, 2 * n + b] += wave * (less[0] + more[0])


@inner
def solve_sides(K, r, x):
    """Set x to the solution of the tangent K of `riding_tangent`, to NaN if it is singular.

    The sines of each side are eliminated; the Schur complement is that of the hats.
    """
    n = K.shape[1] // 2 - 1
    rows, S, rest = np.empty((2, 3, 2 * n)), np.zeros((2, 2)), np.empty(2)
    for a in range(2):
        rest[a] = r[a * (2 * n + 1) + 2 * n]
    for side in range(2):
        for a in range(2):
            for k in range(n):
                rows[side, 0, a * n + k] = r[a * (2 * n + 1) + side * n + k]
        for i in range(2 * n):
            rows[side, 1, i], rows[side, 2, i] = K[side, i, 2 * n], K[side, i, 2 * n + 1]
        solve_rows(K[side], 2 * n, rows[side], 3)
        for a in range(2):
            border = K[side, 2 * n + a]
            S[a, 0] += border[2 * n]
            S[a, 1] += border[2 * n + 1]
            for i in range(2 * n):
                rest[a] -= border[i] * rows[side, 0, i]
                S[a, 0] -= border[i] * rows[side, 1, i]
                S[a, 1] -= border[i] * rows[side, 2, i]
    det = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
    u, v = (S[1, 1] * rest[0] - S[0, 1] * rest[1]) / det, (S[0, 0] * rest[1] - S[1, 0] * rest[0]) / det
    x[2 * n], x[4 * n + 1] = u, v
    for side in range(2):
        for a in range(2):
            for k in range(n):
                i = a * n + k
                x[a * (2 * n + 1) + side * n + k] = rows[side, 0, i] - u * rows[side, 1, i] - v * rows[side, 2, i]
