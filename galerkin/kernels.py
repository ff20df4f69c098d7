"""Compiled inner loops of the full cable: stress at points, internal force, tangent, and Newton's method of a step.

Compiled because a step of these small systems costs more in interpreter than in arithmetic otherwise.

Common arguments
    T         (m,) static tension;  r_static (2, m) rows x', y' of the static shape
    slope     (2, m) w' = (u', v');  phi (n, m) Phi' at the points, weights (m,) of Gauss' rule
    alpha, law  EA/H, and the index of the law in `galerkin.law.LAWS`
    x         a `Carried` of the moving basis
    Q, V, A   (fields, n) coefficients, their velocities and accelerations

Loops stand where numpy would have an expression of arrays: numba takes seconds to compile the latter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.bases.fourier import split, values_at
from galerkin.bases.kink import Carried, carry
from galerkin.law import compiled, tension

Array = np.ndarray
ELASTIC = 0


class Points(NamedTuple):
    """Where the full cable takes its integrals, with the static cable there."""

    s: Array  # (n_q,)
    phi: Array  # Phi', (n, n_q); with a hat its slope is the last row
    weights: Array
    T: Array
    r_static: Array  # x', y', (2, n_q)


@compiled
def static(s, sigma, c):
    """T, and x', y' as rows, of (9)-(10): T^2 = 1 + p^2, p = c - sigma s."""
    T, r = np.empty(s.size), np.empty((2, s.size))
    for i in range(s.size):
        p = c - sigma * s[i]
        T[i] = math.sqrt(1.0 + p * p)
        r[0, i], r[1, i] = 1.0 / T[i], p / T[i]
    return T, r


@compiled
def static_at(s, sigma, c):
    """X' and X'' at one place, rows (2, 2)."""
    p = c - sigma * s
    T = math.sqrt(1.0 + p * p)
    out = np.empty((2, 2))
    out[0, 0], out[0, 1], out[1, 0], out[1, 1] = 1.0 / T, p / T, sigma * p / T**3, -sigma / T**3
    return out


@compiled
def at_point(T, xp, yp, ux, vy, alpha, law):
    """N, W, N t - T t_static (2), k, d, |r'| and the elastic T + alpha eps, whatever the law.

    The tangent of N t is k I + d r' r'^T, k = N/|r'|, d = (dN/deps |r'| - N)/|r'|^3 of (28)-(32).  The force is formed
    as (k - T) X' + k w', k - T = ((N - T) - T eps)/|r'|: nothing cancels next to the hanging cable.
    """
    e = (2.0 * xp + ux) * ux + (2.0 * yp + vy) * vy
    stretch = math.sqrt(1.0 + e)
    eps = e / (1.0 + stretch)  # sqrt(1 + e) - 1 without cancellation
    N, dN, W = tension(eps, T, alpha, law)
    k = N / stretch
    d = (dN - k) / (stretch * stretch)
    excess = (N - T - T * eps) / stretch
    return N, W, excess * xp + k * ux, excess * yp + k * vy, k, d, tension(eps, T, alpha, ELASTIC)[0]


@compiled
def stress(T, r_static, slope, alpha, law):
    """Rows N, W, N t - T t_static (2), and the three entries of its tangent, xx, xy, yy: (7, m)."""
    out = np.empty((7, T.size))
    for i in range(T.size):
        xp, yp, ux, vy = r_static[0, i], r_static[1, i], slope[0, i], slope[1, i]
        N, W, fx, fy, k, d, _ = at_point(T[i], xp, yp, ux, vy, alpha, law)
        rx, ry = xp + ux, yp + vy
        out[0, i], out[1, i], out[2, i], out[3, i] = N, W, fx, fy
        out[4, i], out[5, i], out[6, i] = k + d * rx * rx, d * rx * ry, k + d * ry * ry
    return out


@compiled
def balance(at, Q, alpha, law, force, gram, pull, sides):
    """Internal force (2, n) of coefficients Q; at : `Points`.

    gram : (2, 2, m) receives the weighted tangent at the points;  pull : (m,) the elastic T + alpha eps
    sides : (2, 2) receives int (N t - T t_static) ds behind and ahead of the mass, each a row, where there is a hat
    """
    T, r_static, weights = at.T, at.r_static, at.weights
    slope = np.dot(Q, at.phi)
    sides[:] = 0.0
    for i in range(weights.size):
        xp, yp, ux, vy = r_static[0, i], r_static[1, i], slope[0, i], slope[1, i]
        _, _, fx, fy, k, d, pull[i] = at_point(T[i], xp, yp, ux, vy, alpha, law)
        rx, ry, w = xp + ux, yp + vy, weights[i]
        gram[0, 0, i], gram[1, 1, i] = w * (k + d * rx * rx), w * (k + d * ry * ry)
        gram[0, 1, i] = gram[1, 0, i] = w * (d * rx * ry)
        slope[0, i], slope[1, i] = w * fx, w * fy
        side = 0 if at.phi[-1, i] > 0.0 else 1
        sides[side, 0] += w * fx
        sides[side, 1] += w * fy
    np.dot(slope, at.phi.T, force)


@compiled
def stiffness(phi, f, harmonic, hat, out):
    """Set out[:2 n, :2 n] to sum_q f_ab Phi_i' Phi_j', by a i, b j; f (2, 2, m), f_ab = f_ba.

    harmonic : phi_j' phi_k' = j k pi^2/2 (cos((j-k) x) + cos((j+k) x)), x = pi s, and c_m = sum_q f_q cos(m x_q).  The
    table holds the cosines up to m = N; cos((N+m) x) = 2 cos(N x) cos(m x) - cos((N-m) x) gives the others.
    """
    n, m = phi.shape
    N = n - hat
    both = np.empty((9, m))
    for i in range(3):
        for q in range(m):
            value = f[i // 2, (i + 1) // 2, q]
            both[i, q] = value
            both[3 + i, q] = value * (phi[N - 1, q] / (N * math.pi))
            both[6 + i, q] = value * phi[n - 1, q]
    sums = np.dot(both, phi.T)
    if harmonic:
        c = np.empty(4 * N + 1)  # c_|m|, m = -2N .. 2N
        for i in range(3):
            a, b = i // 2, (i + 1) // 2
            c[2 * N] = 0.0
            for q in range(m):
                c[2 * N] += both[i, q]
            for k in range(1, N + 1):
                c[2 * N + k] = c[2 * N - k] = sums[i, k - 1] / (k * math.pi)
            for k in range(1, N + 1):
                c[3 * N + k] = c[N - k] = 2.0 * sums[3 + i, k - 1] / (k * math.pi) - c[3 * N - k]
            for j in range(1, N + 1):
                minus, plus, row = c[2 * N - j :], c[2 * N + j :], out[a * n + j - 1, b * n :]
                for k in range(1, N + 1):
                    row[k - 1] = (0.5 * math.pi**2 * j) * k * (minus[k] + plus[k])
    else:
        scaled = np.empty((N, m))
        for i in range(3):
            a, b = i // 2, (i + 1) // 2
            for k in range(N):
                for q in range(m):
                    scaled[k, q] = f[a, b, q] * phi[k, q]
            products = np.dot(scaled, phi[:N].T)
            for j in range(N):
                for k in range(N):
                    out[a * n + j, b * n + k] = products[j, k]
    if hat:
        for i in range(3):
            a, b = i // 2, (i + 1) // 2
            for k in range(n):
                out[a * n + N, b * n + k] = out[a * n + k, b * n + N] = sums[6 + i, k]
    for j in range(n):
        for k in range(n):
            out[n + j, k] = out[j, n + k]


@compiled
def acceleration(x, Q, V, A):
    """d2/dt2 of w(s_o, t) along the path, (fields,)."""
    out = np.zeros(A.shape[0])
    for a in range(out.size):
        for i in range(x.f.size):
            out[a] += A[a, i] * x.f[i] + V[a, i] * x.f_v[i] + Q[a, i] * x.f_q[i]
    return out


@compiled
def add_inertia(x, Q, V, A, C, R):
    """Add M A + 2 A V + (A. - B) Q of the cable and the force C (fields,) at the mass to R (fields, n)."""
    last = x.f.size - 1
    for a in range(R.shape[0]):
        for k in range(last + 1):
            for i in range(R.shape[1]):
                R[a, i] += A[a, k] * x.mass[k, i]
        for i in range(R.shape[1]):
            R[a, i] += V[a, last] * x.gyroscopic[i] + Q[a, last] * x.centrifugal[i] + C[a] * x.f[i]


@compiled
def add_inertia_tangent(x, mu, c0, c1, c2, K):
    """Make c0 K, K = dR/dQ (fields n, fields n), the tangent c0 dr/dq + c1 dr/dv + c2 dr/da of all but C's own load."""
    n = x.f.size
    last = n - 1
    for i in range(K.shape[0]):
        k, first = i % n, (i // n) * n
        for j in range(K.shape[1]):
            K[i, j] *= c0
        for j in range(n):
            K[i, first + j] += c2 * x.mass[k, j] + mu * x.f[k] * (c2 * x.f[j] + c1 * x.f_v[j] + c0 * x.f_q[j])
        K[i, first + last] += c1 * x.gyroscopic[k] + c0 * x.centrifugal[k]


@compiled
def survey(at, Q, alpha, law, internal):
    """int W ds, the least N and the index of its point; at : `Points` with a hat, rising behind the mass.

    internal : (2, 2) receives int (N t - T t_static) ds behind and ahead of the mass, each a column
    """
    T, r_static, weights = at.T, at.r_static, at.weights
    slope = np.dot(Q, at.phi)
    energy, least, where = 0.0, math.inf, 0
    internal[:] = 0.0
    for i in range(weights.size):
        N, W, fx, fy, _, _, _ = at_point(T[i], r_static[0, i], r_static[1, i], slope[0, i], slope[1, i], alpha, law)
        side = 0 if at.phi[-1, i] > 0.0 else 1
        internal[0, side] += weights[i] * fx
        internal[1, side] += weights[i] * fy
        energy += weights[i] * W
        if least > N:
            least, where = N, i
    return energy, least, where


class Rolling(NamedTuple):
    """What acts on a rolling car at an instant."""

    mu: float
    sigma: float
    drag: float  # of the air
    wind: float
    hold: float  # F_hold
    rub: float  # mu_r, with the sign that friction acts in
    brake: float  # of brakes, with the sign they act in
    ax: float = 0.0  # p.. as friction goes by it
    ay: float = 0.0


@compiled
def car(on, thrust, velocity, acceleration, behind, ahead):
    """The car by its p., p.. and r' behind and ahead (2,); on : `Rolling`;  thrust, or the haul force.

    C = mu (p.. - sigma j) - F_ext (2), tau (2), cos(phi), <lam>, the force of the air (2), the normal part of the force
    on the cable, downward, the defect tau . C - f cos(phi), the speed tau . p., p. (2), and what friction takes for the
    normal part.
    """
    mx, my = 0.5 * (behind[0] + ahead[0]), 0.5 * (behind[1] + ahead[1])
    size = math.hypot(mx, my)
    tx, ty = mx / size, my / size
    stretch = 0.5 * (math.hypot(behind[0], behind[1]) + math.hypot(ahead[0], ahead[1]))
    x, y = velocity[0] - on.wind, velocity[1]
    air = -on.drag * math.hypot(x, y)
    Cx = on.mu * acceleration[0] - thrust * tx - air * x
    Cy = on.mu * (acceleration[1] - on.sigma) - thrust * ty - air * y
    pressing, cos_phi = ty * Cx - tx * Cy, size / stretch
    normal = ty * (on.mu * on.ax - air * x) - tx * (on.mu * (on.ay - on.sigma) - air * y)
    defect = tx * Cx + ty * Cy - cos_phi * (on.hold / stretch + on.brake + on.rub * abs(normal))
    speed = tx * velocity[0] + ty * velocity[1]
    return (
        Cx, Cy, tx, ty, cos_phi, stretch, air * x, air * y, pressing, defect, speed, velocity[0], velocity[1], normal
    )  # fmt: skip


@compiled
def taut(force, slope, T, alpha):
    """Turn r' at a point (2,), as the basis has it, into that of the force N t; return lam/N.

    Where the cable is slack r' stays, and the return is 0.
    """
    N = math.hypot(force[0], force[1])
    if not (N > LEAST_PULL and force[0] * slope[0] + force[1] * slope[1] > 0.0):
        return 0.0
    size = (1.0 + (N - T) / alpha) / N
    slope[0], slope[1] = size * force[0], size * force[1]
    return size


@compiled
def recover(x, slope, rays, sides, alpha, Q, V, A, ds_o, dds_o, behind, ahead):
    """Turn r' behind and ahead of the mass (2,) into that of the tension from equilibrium; return lam/N there.

    See `galerkin.equilibrium`.
    sides : int (N t - T t_static) ds behind and ahead, rows (2, 2); the hat's two rays weigh the balances.
    """
    last, T, force = x.f.size - 1, 1.0 / slope[0], np.empty((2, 2))
    for a in range(2):
        v, q = 2.0 / 3.0 * ds_o * V[a, last], Q[a, last] / 3.0
        force[0, a] = T * slope[a] + rays[0] * sides[0, a] - v + q * (2.0 * ds_o * ds_o * rays[0] - dds_o)
        force[1, a] = T * slope[a] - rays[1] * sides[1, a] - v + q * (2.0 * ds_o * ds_o * rays[1] - dds_o)
        for i in range(last + 1):
            force[0, a] += A[a, i] * x.behind[i]
            force[1, a] -= A[a, i] * (x.mass[last, i] - x.behind[i])
    return taut(force[0], behind, T, alpha), taut(force[1], ahead, T, alpha)


@compiled
def across(slope, tx, ty, turn):
    """What r' = slope (2,) gains across tau with the force there: two weights of dF; turn : lam/N."""
    size = math.hypot(slope[0], slope[1])
    x, y = slope[0] / size, slope[1] / size
    off = tx * y - ty * x
    return turn * (-ty - off * x), turn * (tx - off * y)


@compiled
def roll(x, slope, load, rays, sides, alpha, Q, V, A, ds_o, dds_o, on, thrust, R):
    """Add the cable's inertia and the car to R (2, n), and return `car`, and `across` of both sides.

    slope, rays, load : of an `Instant`

    sides : as for `recover`, or None.  With it tau is that of the tension from equilibrium: sines do not resolve a side
        that is shorter than their waves, and the balance of the car by their slopes errs by a hundred times as much.
    """
    last = x.f.size - 1
    velocity, behind, ahead, p = np.empty(2), np.empty(2), np.empty(2), acceleration(x, Q, V, A)
    for a in range(2):
        along, speed = slope[a], 0.0
        for i in range(last + 1):
            along += Q[a, i] * x.f_s[i]
            speed += V[a, i] * x.f[i]
        velocity[a] = speed + ds_o * along
        behind[a], ahead[a] = along + rays[0] * Q[a, last], along + rays[1] * Q[a, last]
        p[a] += load[a]
    p[1] += on.sigma
    turns = 0.0, 0.0
    if sides is not None:
        turns = recover(x, slope, rays, sides, alpha, Q, V, A, ds_o, dds_o, behind, ahead)
    out = car(on, thrust, velocity, p, behind, ahead)
    p[0], p[1] = out[0], out[1]
    add_inertia(x, Q, V, A, p, R)
    bx, by = across(behind, out[2], out[3], turns[0])
    ax, ay = across(ahead, out[2], out[3], turns[1])
    return (*out, bx, by, ax, ay)


@compiled
def pulls(phi, gram):
    """How int (N t - T t_static) ds behind and ahead of the mass follow Q, (2, 2, 2, n): side, its field, Q's.

    gram : as `balance` leaves it
    """
    n, m = phi.shape
    out, middle = np.zeros((2, 2, 2, n)), 0
    while middle < m and phi[n - 1, middle] > 0.0:
        middle += 1
    for side in range(2):
        first, last = (0, middle) if side == 0 else (middle, m)
        for a in range(2):
            for b in range(2):
                for k in range(n):
                    total = 0.0
                    for q in range(first, last):
                        total += gram[a, b, q] * phi[k, q]
                    out[side, a, b, k] = total
    return out


@compiled
def row(x, out, rays, pulls, ds_o, dds_o, mu, c0, c1, c2, into):
    """The car's row of the tangent, (2 n + 1,), by `roll`; tau turns with the forces of `recover`."""
    n = x.f.size
    turn = -0.5 * out[8] / (out[4] * out[5])
    for b in range(2):
        for j in range(n):
            own = out[2 + b] * mu * (c2 * x.f[j] + c1 * x.f_v[j] + c0 * x.f_q[j])
            by_a = out[14 + b] * x.behind[j] - out[16 + b] * (x.mass[n - 1, j] - x.behind[j])
            by_q = 0.0
            for a in range(2):
                by_q += out[14 + a] * rays[0] * pulls[0, a, b, j] - out[16 + a] * rays[1] * pulls[1, a, b, j]
            into[b * n + j] = own + turn * (c2 * by_a + c0 * by_q)
        by_v = -2.0 / 3.0 * ds_o * (out[14 + b] + out[16 + b])
        by_q = 2.0 * ds_o * ds_o * (out[14 + b] * rays[0] + out[16 + b] * rays[1])
        by_q -= dds_o * (out[14 + b] + out[16 + b])
        into[b * n + n - 1] += turn * (c1 * by_v + c0 * by_q / 3.0)


NO_CAR = (0.0,) * 18
STUCK, FREE, HAULED = 0, 1, 2
LEAST_PULL = 1e-3  # of a cable that is not slack, over H
STEP = 1e-6  # of differences by s_o, ds_o and dds_o together: rounding of r, 1e-16 alpha, stays below 1e-7


class Ride(NamedTuple):
    """A rolling car in a step, over sines with a hat."""

    mode: int  # FREE: the last unknown is s_o; STUCK: it stays; HAULED: its acceleration is the haul force
    on: Rolling
    thrust: float
    ds_o: float  # of a hauled car
    dds_o: float
    behind: Array  # rules of both sides, (2, m)
    ahead: Array
    mass: Array  # M without the moving overlaps, and what `_carry` wants to know
    left: Array
    chord: Array
    c: float


class Grip(NamedTuple):
    """A mass that grips the cable, over sines with a hat; see `Ride`."""

    behind: Array
    ahead: Array
    mass: Array
    left: Array
    chord: Array
    c: float


@compiled
def moment(on, sigma, s_o, ds_o, dds_o):
    """Points, what the basis carries, X' and the load of the mass at an instant; on : `Ride` or `Grip`."""
    n = on.left.size
    M, rows = carry(values_at(s_o, n), on.mass, 1, on.left, on.chord, s_o, ds_o, dds_o)
    x = Carried(M, rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6])
    s, weights, phi = split(s_o, on.behind, on.ahead, n)
    T, r_static = static(s, sigma, on.c)
    rest = static_at(s_o, sigma, on.c)
    load = np.empty(2)
    for a in range(2):
        load[a] = dds_o * rest[0, a] + ds_o * ds_o * rest[1, a] - a * sigma
    return Points(s, phi, weights, T, r_static), x, rest[0], load


@compiled
def evaluate(at, x, slope, load, ride, inertia, mu, alpha, law, balanced, r, gram, pull):
    """Set the residual of a state, rows q, v, a; return the car where it rolls."""
    n = x.f.size
    R = r[: 2 * n].reshape(2, n)
    Q, V, A = balanced[0, : 2 * n].reshape(2, n), balanced[1, : 2 * n].reshape(2, n), balanced[2, : 2 * n].reshape(2, n)
    sides = np.empty((2, 2))
    balance(at, Q, alpha, law, R, gram, pull, sides)
    if ride is None:
        C = acceleration(x, Q, V, A)
        for a in range(2):
            C[a] = inertia * C[a] + mu * load[a]
        add_inertia(x, Q, V, A, C, R)
        return NO_CAR
    hauled = ride.mode == HAULED
    ds_o, dds_o = (ride.ds_o, ride.dds_o) if hauled else (balanced[1, 2 * n], balanced[2, 2 * n])
    thrust = balanced[2, 2 * n] if hauled else ride.thrust
    rays = at.phi[n - 1, 0], at.phi[n - 1, at.s.size - 1]
    out = roll(x, slope, load, rays, sides, alpha, Q, V, A, ds_o, dds_o, ride.on, thrust, R)
    r[2 * n] = mu * balanced[2, 2 * n] if ride.mode == STUCK else out[9]
    return out


@compiled
def tangent(
    at, x, slope, load, ride, inertia, mu, alpha, law, harmonic, hat, balanced, r, out, gram, c0, c1, c2, K
):  # fmt: skip
    """Set K to c0 dr/dq + c1 dr/dv + c2 dr/da where `evaluate` has been; the column of s_o is a difference."""
    n, size = x.f.size, r.size
    block = K[: 2 * n, : 2 * n]
    stiffness(at.phi, gram, harmonic, hat, block)
    add_inertia_tangent(x, inertia, c0, c1, c2, block)
    if ride is None:
        return
    hauled = ride.mode == HAULED
    K[2 * n], K[:, 2 * n] = 0.0, 0.0
    if ride.mode == STUCK:
        K[2 * n, 2 * n] = c2 * mu
        return
    ds_o, dds_o = (ride.ds_o, ride.dds_o) if hauled else (balanced[1, 2 * n], balanced[2, 2 * n])
    rays = at.phi[n - 1, 0], at.phi[n - 1, at.s.size - 1]
    row(x, out, rays, pulls(at.phi, gram), ds_o, dds_o, mu, c0, c1, c2, K[2 * n])
    if hauled:
        for i in range(n):
            K[i, 2 * n], K[n + i, 2 * n] = -c2 * out[2] * x.f[i], -c2 * out[3] * x.f[i]
        K[2 * n, 2 * n] = -c2
        return
    h, moved, beyond = STEP / (c0 + c1 + c2), balanced.copy(), np.empty(size)
    moved[0, 2 * n] += h * c0
    moved[1, 2 * n] += h * c1
    moved[2, 2 * n] += h * c2
    there = moment(ride, ride.on.sigma, moved[0, 2 * n], moved[1, 2 * n], moved[2, 2 * n])
    evaluate(
        there[0], there[1], there[2], there[3], ride, inertia, mu, alpha, law, moved, beyond,
        np.empty(gram.shape), np.empty(at.s.size),
    )  # fmt: skip
    for i in range(size):
        K[i, 2 * n] = (beyond[i] - r[i]) / h


@compiled
def look(at, x, slope, load, ride, inertia, mu, alpha, law, harmonic, hat, balanced, r, pull, parts):
    """Set the residual of a state, rows q, v, a, and what there is room for of dr/dq, dr/dv, dr/da, parts (3 or 0)."""
    if ride.mode != HAULED:
        last = balanced.shape[1] - 1
        at, x, slope, load = moment(ride, ride.on.sigma, balanced[0, last], balanced[1, last], balanced[2, last])
    gram, one = np.empty((2, 2, at.s.size)), np.eye(3)
    out = evaluate(at, x, slope, load, ride, inertia, mu, alpha, law, balanced, r, gram, pull)
    for k in range(parts.shape[0]):
        c = one[k, 0], one[k, 1], one[k, 2]
        tangent(at, x, slope, load, ride, inertia, mu, alpha, law, harmonic, hat, balanced, r, out, gram, *c, parts[k])


@compiled
def correct(now, c, share, step):
    """Take share step off the rows q, v, a of the step's end."""
    for k in range(3):
        for i in range(step.size):
            now[k, i] -= share * c[k] * step[i]


@compiled
def settle(at, x, slope, load, ride, inertia, mu, alpha, law, harmonic, hat, start, now, rule, bound, newton, pull):
    """`cablefem.newmark.System.settle` for the full cable; return |r| and how often it iterated, factorised, evaluated.

    load : (2,) acceleration of the mass along its static path less gravity
    ride : `Ride` or None;  newton : max_iter, reuse, patience, most halvings.
    The factors are not kept but made again from the kept tangent: more than one iteration is rare, and for further
    steps the tangent does not do: the mass has gone a part of the highest sine's wave by then, and its kink turns r'.
    """
    size = start.shape[1]
    c, w = rule[:, 3], rule[:, 4]
    c0, c1, c2 = w[0] * c[0], w[1] * c[1], w[2] * c[2]
    balanced, r, gram = np.empty((3, size)), np.empty(size), np.empty((2, 2, pull.size))
    for k in range(3):
        for i in range(size):
            now[k, i] = rule[k, 0] * start[0, i] + rule[k, 1] * start[1, i] + rule[k, 2] * start[2, i]
    K = np.empty((size, size))
    factorisations, residuals, anew, iterations = 0, 0, True, 0
    step, before, halving = np.empty(size), math.inf, -1  # the first residual follows no correction
    while True:
        for k in range(3):
            for i in range(size):
                balanced[k, i] = w[k] * now[k, i] + (1.0 - w[k]) * start[k, i]
        lost = False
        if ride is not None:  # a type of its own: no ride is compiled into the step of a mass that grips
            lost = ride.mode != HAULED and not 0.0 < balanced[0, size - 1] < 1.0  # a trial that leaves the cable
            if ride.mode != HAULED and not lost:
                made = moment(ride, ride.on.sigma, balanced[0, size - 1], balanced[1, size - 1], balanced[2, size - 1])
                at, x, slope, load = made
        norm = math.nan
        if not lost:
            out = evaluate(at, x, slope, load, ride, inertia, mu, alpha, law, balanced, r, gram, pull)
            square = 0.0
            for i in range(size):
                square += r[i] * r[i]
            norm = math.sqrt(square)
        elif halving < 0:
            return norm, 1, 0, 1
        if halving >= 0:
            residuals += 1
            if not (norm < before or (iterations < newton[2] and norm < math.inf)) and halving < newton[3]:
                halving += 1
                for i in range(size):
                    step[i] *= 0.5
                correct(now, c, -1.0, step)
                continue
            iterations += 1
            if norm <= bound or not norm < math.inf or iterations >= newton[0]:
                return norm, iterations, factorisations, residuals
            anew = norm > newton[1] * before
        if anew:
            tangent(
                at, x, slope, load, ride, inertia, mu, alpha, law, harmonic, hat, balanced, r, out, gram, c0, c1, c2, K
            )
            factorisations += 1
        before = norm
        step = np.linalg.solve(K, r)
        correct(now, c, 1.0, step)
        halving = 0


@compiled
def stride(grip, sigma, places, inertia, mu, alpha, law, start, now, told, rules, bound, newton, pull):
    """Settle steps of a mass that grips one after another; return how many came to be in balance with no point slack.

    places : (m, 3) s_o, ds_o, dds_o;  now : (m, 3, size) receives the ends;  told : (m, 6) what `settle` returns, the
    least tension and its s;  pull : of the last step.
    """
    for k in range(places.shape[0]):
        at, x, slope, load = moment(grip, sigma, places[k, 0], places[k, 1], places[k, 2])
        if inertia == 0.0:  # the weight alone
            load[0], load[1] = 0.0, -sigma
        norm, iterations, factorisations, residuals = settle(
            at, x, slope, load, None, inertia, mu, alpha, law, True, 1, start if k == 0 else now[k - 1], now[k],
            rules[k], bound, newton, pull,
        )  # fmt: skip
        least = pull.argmin()
        told[k, 0], told[k, 1], told[k, 2] = norm, iterations, factorisations
        told[k, 3], told[k, 4], told[k, 5] = residuals, pull[least], at.s[least]
        if not (norm <= bound and pull[least] >= 0.0):
            return k
    return places.shape[0]
