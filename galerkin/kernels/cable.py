"""The full cable at points: force, energy and tangent, internal force, tangent and inertia."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from galerkin.kernels.dense import set_matrix_product
from galerkin.law import compiled, inner, tension_stiffness_and_energy

if TYPE_CHECKING:
    from galerkin.bases.kink import InertiaTerms
    from galerkin.kernels.instant import CableSines, Instant, MassTerms
    from galerkin.kernels.rolling import Coefficients
    from galerkin.kernels.steps import Workspace

Array = np.ndarray
Pair = tuple[float, float]


RealTangentFactors = tuple[float, float, float]  # c0 dr/dq + c1 dr/dv + c2 dr/da


class Points(NamedTuple):
    """Quadrature points, and the static cable there."""

    s: Array  # (m,)
    phi: Array  # Phi', (n, m)
    weights: Array  # (m,)
    T: Array  # (m,)
    static_slope: Array  # x', y', (2, m)


class PointForce(NamedTuple):
    """Force, energy and stiffness at a point: k = N/|r'|, d = (dN/deps |r'| - N)/|r'|^3 of (28)-(32)."""

    W: float
    fx: float  # N t - T t_static
    fy: float
    k: float
    d: float
    N: float
    elastic: float  # the tension of the elastic law


class Cable(NamedTuple):
    """Constants of the cable and its load."""

    inertia: float  # mu, or 0 for a force
    mu: float
    alpha: float
    law: int  # of `LAWS`
    sigma: float
    c: float
    damping: float  # c_d
    slack_ends: bool  # whether several steps may end at a slack state only


@inner
def static_tension_and_slope(s: Array, sigma: float, c: float) -> tuple[Array, Array]:
    """T (m,), and x', y' as rows (2, m), of (9)-(10)."""
    T = np.empty(s.size)
    r = np.empty((2, s.size))
    for i in range(s.size):
        p = c - sigma * s[i]
        T[i] = math.sqrt(1.0 + p * p)
        r[0, i] = 1.0 / T[i]
        r[1, i] = p / T[i]
    return T, r


@inner
def force_energy_and_stiffness_at_point(T: float, static_slope: Pair, w_s: Pair, alpha: float, law: int) -> PointForce:
    """From X' and w'; the force is (k - T) X' + k w', without cancellation."""
    xp, yp = static_slope
    ux, vy = w_s
    e = (2.0 * xp + ux) * ux + (2.0 * yp + vy) * vy
    stretch = math.sqrt(1.0 + e)
    eps = e / (1.0 + stretch)  # sqrt(1 + e) - 1 without cancellation
    N, dN, W, elastic = tension_stiffness_and_energy(eps, T, alpha, law)
    k = N / stretch
    d = (dN - k) / (stretch * stretch)
    excess = (N - T - T * eps) / stretch
    fx = excess * xp + k * ux
    fy = excess * yp + k * vy
    return PointForce(W, fx, fy, k, d, N, elastic)


@compiled
def force_energy_and_tangent(T: Array, static_slope: Array, w_s: Array, alpha: float, law: int) -> Array:
    """From X', w' (2, m) the rows N, W, N t - T t_static (2), its tangent xx, xy, yy, and T + alpha eps: (8, m)."""
    out = np.empty((8, T.size))
    for i in range(T.size):
        xp = static_slope[0, i]
        yp = static_slope[1, i]
        ux = w_s[0, i]
        vy = w_s[1, i]
        x = force_energy_and_stiffness_at_point(T[i], (xp, yp), (ux, vy), alpha, law)
        rx = xp + ux
        ry = yp + vy
        out[0, i] = x.N
        out[1, i] = x.W
        out[2, i] = x.fx
        out[3, i] = x.fy
        out[4, i] = x.k + x.d * rx * rx
        out[5, i] = x.d * rx * ry
        out[6, i] = x.k + x.d * ry * ry
        out[7, i] = x.elastic
    return out


@inner
def set_internal_force_return_energy(
    points: Points, Q: Array, cable: Cable, force: Array, workspace: Workspace
) -> float:
    """Set the internal force (2, n), and what `Workspace` holds at Gauss points and of the sides; return int W ds."""
    slope = np.empty((2, points.weights.size))
    energy = 0.0
    set_matrix_product(Q, points.phi, False, slope)
    workspace.side_forces[:] = 0.0
    for i in range(points.weights.size):
        static_slope = (points.static_slope[0, i], points.static_slope[1, i])
        w_s = (slope[0, i], slope[1, i])
        weight = points.weights[i]
        x = force_energy_and_stiffness_at_point(points.T[i], static_slope, w_s, cable.alpha, cable.law)
        workspace.tensions[i] = x.elastic
        rx = static_slope[0] + w_s[0]
        ry = static_slope[1] + w_s[1]
        workspace.weighted_stiffness[0, i] = weight * (x.k + x.d * rx * rx)
        workspace.weighted_stiffness[1, i] = weight * (x.d * rx * ry)
        workspace.weighted_stiffness[2, i] = weight * (x.k + x.d * ry * ry)
        slope[0, i] = weight * x.fx
        slope[1, i] = weight * x.fy
        side = 0 if points.phi[-1, i] > 0.0 else 1
        workspace.side_forces[side, 0] += slope[0, i]
        workspace.side_forces[side, 1] += slope[1, i]
        energy += weight * x.W
    set_matrix_product(slope, points.phi, True, force)
    return energy


@inner
def set_cosine_and_hat_integrals(phi: Array, f: Array, dense: Array, rows: Array, sums: Array, c: Array) -> None:
    """Set c_|m| = int f g^2 cos(m x), m = -2N .. 2N, and sums[2] to int f Phi_j' hat'; f (m,) is weighted.

    cos((N+m) x) = 2 cos(N x) cos(m x) - cos((N-m) x).  rows (3, m) and sums (3, n) are memory.
    """
    N = phi.shape[0] - 1
    c[2 * N] = 0.0
    for q in range(f.size):
        rows[0, q] = f[q] * dense[q]
        rows[1, q] = f[q] * (phi[N - 1, q] / (N * math.pi))
        rows[2, q] = f[q] * phi[N, q]
        c[2 * N] += rows[0, q] * dense[q]
    set_matrix_product(rows, phi, True, sums)
    for k in range(1, N + 1):
        low = sums[0, k - 1] / (k * math.pi)
        c[2 * N + k] = low
        c[2 * N - k] = low
    for k in range(1, N + 1):
        high = 2.0 * sums[1, k - 1] / (k * math.pi) - c[3 * N - k]
        c[3 * N + k] = high
        c[N - k] = high


@compiled
def set_stiffness_matrix(phi: Array, weighted_stiffness: Array, grading: float, out: Array) -> None:
    """Set out (2 n, 2 n) to int Phi_i' f_ab Phi_j' ds; weighted_stiffness (3, m): weighted f_xx, f_xy, f_yy.

    phi_j' phi_k' = j k pi^2/2 g^2 (cos((j-k) x) + cos((j+k) x)), x = pi xi, g = dxi/ds = 1 + grading phi_2'/(2 pi).
    """
    n, m = phi.shape
    N = n - 1
    dense = np.empty(m)
    for q in range(m):
        dense[q] = 1.0 + grading * phi[1, q] / (2.0 * math.pi)
    rows = np.empty((3, m))
    sums = np.empty((3, n))
    c = np.empty(4 * N + 1)
    for i in range(3):
        a = i // 2
        b = (i + 1) // 2
        set_cosine_and_hat_integrals(phi, weighted_stiffness[i], dense, rows, sums, c)
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
def acceleration_along_mass_path(terms: InertiaTerms, Q: Array, V: Array, A: Array) -> Array:
    """w.. at the mass as it travels, (fields,)."""
    out = np.empty(A.shape[0])
    for a in range(out.size):
        out[a] = 0.0
        for i in range(terms.f.size):
            out[a] += A[a, i] * terms.f[i] + V[a, i] * terms.f_v[i] + Q[a, i] * terms.f_q[i]
    return out


@inner
def add_inertia_and_mass_force(
    terms: InertiaTerms, coefficients: Coefficients, damping: float, C: Array, R: Array
) -> None:
    """Add the cable's inertia and damping, and the force C (2,) at the mass, to R (2, n)."""
    Q, V, A = coefficients
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
def add_inertia_and_gripping_mass(at_mass: MassTerms, coefficients: Coefficients, cable: Cable, R: Array) -> None:
    """Add the cable's inertia and a mass that grips it, or a force, to R (2, n)."""
    C = acceleration_along_mass_path(at_mass.inertia, coefficients.Q, coefficients.V, coefficients.A)
    for a in range(2):
        C[a] = cable.inertia * C[a] + cable.mu * at_mass.load[a]
    add_inertia_and_mass_force(at_mass.inertia, coefficients, cable.damping, C, R)


@inner
def set_tangent_with_gripping_mass(
    now: Instant, sines: CableSines, weighted_stiffness: Array, c: RealTangentFactors, K: Array
) -> None:
    """Set K (2 n, 2 n) to the tangent c0 dr/dq + c1 dr/dv + c2 dr/da of cable and mass."""
    terms = now.at_mass.inertia
    mu = sines.cable.inertia
    c0, c1, c2 = c
    n = now.at_mass.inertia.f.size
    set_stiffness_matrix(now.points.phi, weighted_stiffness, sines.grading, K)
    for i in range(2 * n):
        k = i % n
        first = (i // n) * n
        for j in range(2 * n):
            K[i, j] *= c0
        for j in range(n):
            of_cable = (c2 + c1 * sines.cable.damping) * terms.mass[k, j]
            at_mass = c2 * terms.f[j] + c1 * terms.f_v[j] + c0 * terms.f_q[j]
            K[i, first + j] += of_cable + mu * terms.f[k] * at_mass
        K[i, first + n - 1] += c1 * terms.gyroscopic[k] + c0 * terms.centrifugal[k]


@compiled
def smoothed_min_tension_and_position(points: Points, s_o: float, tensions: Array, hat: int) -> tuple[float, float]:
    """Smallest tension and its s; a negative one counts as its mean over a shortest wave of the basis, 2/n.

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
