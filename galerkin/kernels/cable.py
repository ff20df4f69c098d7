"""The full cable at points: force, energy and tangent, internal force, tangent and inertia."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.kernels.dense import multiply
from galerkin.law import compiled, inner, tension

Array = np.ndarray


class Points(NamedTuple):
    """Quadrature points, and the static cable there."""

    s: Array  # (m,)
    phi: Array  # Phi', (n, m)
    weights: Array  # (m,)
    T: Array  # (m,)
    r_static: Array  # x', y', (2, m)


class Cable(NamedTuple):
    inertia: float  # mu, or 0 for a force
    mu: float
    alpha: float
    law: int  # of `LAWS`
    sigma: float
    c: float
    damping: float  # c_d
    slack_ends: bool  # whether several steps may end at a slack state only


@inner
def hanging_cable_at(s, sigma, c):
    """T, and x', y' as rows, of (9)-(10)."""
    T = np.empty(s.size)
    r = np.empty((2, s.size))
    for i in range(s.size):
        p = c - sigma * s[i]
        T[i] = math.sqrt(1.0 + p * p)
        r[0, i] = 1.0 / T[i]
        r[1, i] = p / T[i]
    return T, r


@inner
def force_energy_and_stiffness_at_point(T, X, w, alpha, law):
    """N, W, N t - T t_static (2), k, d, and the tension of the elastic law, from X' and w'.

    k = N/|r'|, d = (dN/deps |r'| - N)/|r'|^3 of (28)-(32).  The force is (k - T) X' + k w', without cancellation.
    """
    xp, yp = X
    ux, vy = w
    e = (2.0 * xp + ux) * ux + (2.0 * yp + vy) * vy
    stretch = math.sqrt(1.0 + e)
    eps = e / (1.0 + stretch)  # sqrt(1 + e) - 1 without cancellation
    N, dN, W, elastic = tension(eps, T, alpha, law)
    k = N / stretch
    d = (dN - k) / (stretch * stretch)
    excess = (N - T - T * eps) / stretch
    return N, W, excess * xp + k * ux, excess * yp + k * vy, k, d, elastic


@compiled
def force_energy_and_tangent(T, r_static, slope, alpha, law):
    """Rows N, W, N t - T t_static (2), its tangent xx, xy, yy, and the elastic T + alpha eps: (8, m)."""
    out = np.empty((8, T.size))
    for i in range(T.size):
        xp = r_static[0, i]
        yp = r_static[1, i]
        ux = slope[0, i]
        vy = slope[1, i]
        out[0, i], out[1, i], out[2, i], out[3, i], k, d, out[7, i] = force_energy_and_stiffness_at_point(
            T[i], (xp, yp), (ux, vy), alpha, law
        )
        rx = xp + ux
        ry = yp + vy
        out[4, i] = k + d * rx * rx
        out[5, i] = d * rx * ry
        out[6, i] = k + d * ry * ry
    return out


@inner
def set_internal_force(points, Q, cable, force, workspace):
    """Set the internal force (2, n) and gram, tensions and side_forces of `Workspace`; return int W ds."""
    slope = np.empty((2, points.weights.size))
    energy = 0.0
    multiply(Q, points.phi, False, slope)
    workspace.side_forces[:] = 0.0
    for i in range(points.weights.size):
        X = (points.r_static[0, i], points.r_static[1, i])
        w = (slope[0, i], slope[1, i])
        weight = points.weights[i]
        _, W, fx, fy, k, d, workspace.tensions[i] = force_energy_and_stiffness_at_point(
            points.T[i], X, w, cable.alpha, cable.law
        )
        rx = X[0] + w[0]
        ry = X[1] + w[1]
        workspace.gram[0, i] = weight * (k + d * rx * rx)
        workspace.gram[1, i] = weight * (d * rx * ry)
        workspace.gram[2, i] = weight * (k + d * ry * ry)
        slope[0, i] = weight * fx
        slope[1, i] = weight * fy
        side = 0 if points.phi[-1, i] > 0.0 else 1
        workspace.side_forces[side, 0] += weight * fx
        workspace.side_forces[side, 1] += weight * fy
        energy += weight * W
    multiply(slope, points.phi, True, force)
    return energy


@compiled
def stiffness(phi, gram, grading, out):
    """Set out (2 n, 2 n) to int Phi_i' f_ab Phi_j' ds; gram (3, m): weighted f_xx, f_xy, f_yy.

    phi_j' phi_k' = j k pi^2/2 g^2 (cos((j-k) x) + cos((j+k) x)), x = pi xi, g = dxi/ds = 1 + grading phi_2'/(2 pi), and
    cos((N+m) x) = 2 cos(N x) cos(m x) - cos((N-m) x).
    """
    n, m = phi.shape
    N = n - 1
    dense = np.empty(m)
    for q in range(m):
        dense[q] = 1.0 + grading * phi[1, q] / (2.0 * math.pi)
    # c_|m|, m = -2N .. 2N
    rows = np.empty((3, m))
    sums = np.empty((3, n))
    c = np.empty(4 * N + 1)
    for i in range(3):
        a = i // 2
        b = (i + 1) // 2
        c[2 * N] = 0.0
        for q in range(m):
            rows[0, q] = gram[i, q] * dense[q]
            rows[1, q] = gram[i, q] * (phi[N - 1, q] / (N * math.pi))
            rows[2, q] = gram[i, q] * phi[N, q]
            c[2 * N] += rows[0, q] * dense[q]
        multiply(rows, phi, True, sums)
        for k in range(1, N + 1):
            c[2 * N + k] = c[2 * N - k] = sums[0, k - 1] / (k * math.pi)
        for k in range(1, N + 1):
            c[3 * N + k] = c[N - k] = 2.0 * sums[1, k - 1] / (k * math.pi) - c[3 * N - k]
        for j in range(1, N + 1):
            minus = c[2 * N - j :]
            plus = c[2 * N + j :]
            row = out[a * n + j - 1, b * n :]
            for k in range(1, N + 1):
                row[k - 1] = (0.5 * math.pi**2 * j) * k * (minus[k] + plus[k])
        for k in range(n):
            out[a * n + N, b * n + k] = out[a * n + k, b * n + N] = sums[2, k]
    for j in range(n):
        for k in range(n):
            out[n + j, k] = out[j, n + k]


@inner
def acceleration_on_path(terms, Q, V, A):
    """w.. along the path."""
    out = np.empty(A.shape[0])
    for a in range(out.size):
        out[a] = 0.0
        for i in range(terms.f.size):
            out[a] += A[a, i] * terms.f[i] + V[a, i] * terms.f_v[i] + Q[a, i] * terms.f_q[i]
    return out


@inner
def add_inertia(terms, Q, V, A, damping, C, R):
    """Add the cable's inertia and damping, and the force C (2,) at the mass, to R."""
    last = terms.f.size - 1
    for a in range(R.shape[0]):
        for k in range(terms.f.size):
            rate = A[a, k] + damping * V[a, k]
            for i in range(R.shape[1]):
                R[a, i] += rate * terms.mass[k, i]
        v = V[a, last]
        q = Q[a, last]
        for i in range(R.shape[1]):
            R[a, i] += v * terms.gyroscopic[i] + q * terms.centrifugal[i]
        for i in range(R.shape[1]):
            R[a, i] += C[a] * terms.f[i]


@inner
def add_gripping_mass(at_mass, coefficients, cable, R):
    """Add the cable's inertia and a mass that grips it, or a force, to R (2, n)."""
    C = acceleration_on_path(at_mass.inertia, coefficients.Q, coefficients.V, coefficients.A)
    for a in range(2):
        C[a] = cable.inertia * C[a] + cable.mu * at_mass.load[a]
    add_inertia(at_mass.inertia, coefficients.Q, coefficients.V, coefficients.A, cable.damping, C, R)


@inner
def set_gripping_tangent(now, sines, gram, c, K):
    """Set K (2 n, 2 n) to the tangent c0 dr/dq + c1 dr/dv + c2 dr/da of cable and mass."""
    terms = now.at_mass.inertia
    mu = sines.cable.inertia
    c0, c1, c2 = c
    n = now.at_mass.inertia.f.size
    stiffness(now.points.phi, gram, sines.grading, K)
    for i in range(2 * n):
        k = i % n
        first = (i // n) * n
        for j in range(2 * n):
            K[i, j] *= c0
        for j in range(n):
            K[i, first + j] += (c2 + c1 * sines.cable.damping) * terms.mass[k, j] + mu * terms.f[k] * (
                c2 * terms.f[j] + c1 * terms.f_v[j] + c0 * terms.f_q[j]
            )
        K[i, first + n - 1] += c1 * terms.gyroscopic[k] + c0 * terms.centrifugal[k]


@compiled
def min_tension(points, s_o, tensions, hat=1):
    """Least tension and its s; a negative one counts as its mean over a shortest wave of the basis, 2/n.

    hat : 0 for a basis without one
    """
    s = points.s
    where = tensions.argmin()
    lowest = tensions[where]
    min_at = s[where]
    if lowest >= 0.0:
        return lowest, min_at
    lowest = math.inf
    first = 0
    for side in range(2):
        begin, length = (0.0, s_o) if side == 0 else (s_o, 1.0 - s_o)
        waves = (points.phi.shape[0] - hat) * length
        pieces = max(1, round(0.5 * waves))
        for piece in range(1, pieces + 1):
            end = begin + length * piece / pieces
            weight = 0.0
            mean = 0.0
            middle = 0.0
            while first < s.size and s[first] < end:
                weight += points.weights[first]
                mean += points.weights[first] * tensions[first]
                middle += points.weights[first] * s[first]
                first += 1
            if weight > 0.0 and mean < lowest * weight:
                lowest = mean / weight
                min_at = middle / weight
    return lowest, min_at
