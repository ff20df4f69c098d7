"""A car that rolls: its balance along the mean tangent, and the row of the tangent that goes with it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.bow import add_bows
from galerkin.kernels.cable import acceleration, add_inertia
from galerkin.kernels.dense import multiply
from galerkin.law import compiled

LEAST_PULL = 1e-3  # of a cable that is not slack, over H
STEP = 1e-6  # of differences
LEAST_WINDOW = 6.0  # steps over which the car's acceleration is averaged for friction, where they are long


class Rolling(NamedTuple):
    """What acts on a rolling car at an instant."""

    mu: float
    sigma: float
    drag: float  # of the air
    wind: float
    hold: float  # F_hold
    rub: float  # mu_r, with the sign that friction acts in
    brake: float  # of brakes, with the sign they act in
    ax: float = 0.0  # p.. as friction goes by it; nan: by the one that the car has
    ay: float = 0.0
    sheds: float = 0.0  # how fast a kink that changes loses what sines cannot carry, over |ds_o|


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
    normal = pressing
    if not math.isnan(on.ax):
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
def recover(x, slope, rays, bows, sides, alpha, Q, V, A, ds_o, dds_o, behind, ahead):
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
        for i in range(2):
            h, sign = abs(1.0 / rays[i]), 1.0 - 2.0 * i
            force[i, a] += sign * h * h * (bows[i, 2, a] / 3.0 + h * bows[i, 3, a] / 4.0)
    return taut(force[0], behind, T, alpha), taut(force[1], ahead, T, alpha)


@compiled
def by_force(on, thrust, velocity, p, behind, ahead, turn, defect, side):
    """How the defect of `car` follows the force behind (side 0) or ahead of it, (2,); turn : lam/N there.

    By differences of r', which a force turns and hardly stretches: friction and brake go by the kink, too.  Without
    that Newton's method diverges on graded sines, where a braked car nears a support on a soft rope.
    """
    moved, got = np.empty((2, 2)), np.empty(2)
    slope = behind if side == 0 else ahead
    square = slope[0] * slope[0] + slope[1] * slope[1]
    for a in range(2):
        for b in range(2):
            moved[0, b], moved[1, b] = behind[b], ahead[b]
        for b in range(2):
            moved[side, b] += STEP * ((1.0 if a == b else 0.0) - slope[a] * slope[b] / square)
        got[a] = turn * (car(on, thrust, velocity, p, moved[0], moved[1])[9] - defect) / STEP
    return got[0], got[1]


@compiled
def shed(x, ds_o, on):
    """Weight of the rate of the kink in the hat's own rows.

    What the N sines leave of the hat, of mass 1/3 - I M^-1 I with their overlaps I, is a mode that moves neither them
    nor the car, several times as fast as the highest sine.  A car that runs over the sines excites it; where its side
    shortens, its waves gain energy as all waves there, and unlike those have no physics to lose it: a dashpot lets it
    go.  The mass falls like N^-3 off the supports, and a steady kink, q_hat ~ s_o (1 - s_o), feels nothing.
    On a side shorter than the sines' waves it is that side's own waves that it takes, and the car gets their energy.
    """
    last = x.f.size - 1
    left, pivot, over = x.mass[last, last], np.empty(last), np.empty(last)
    for k in range(last):  # M = L D L^T, which couples every other sine
        pivot[k], over[k] = x.mass[k, k], x.mass[last, k]
        if k > 1:
            ratio = x.mass[k, k - 2] / pivot[k - 2]
            pivot[k] -= ratio * x.mass[k, k - 2]
            over[k] -= ratio * over[k - 2]
        left -= over[k] * over[k] / pivot[k]
    return on.sheds * abs(ds_o) * left


@compiled
def add_shed_tangent(x, rays, ds_o, on, c0, c1, K):
    """Add the rates of kinks to c0 dr/dq + c1 dr/dv, (2 n, 2 n)."""
    n, weight = x.f.size, shed(x, ds_o, on)
    for last in (n - 1, 2 * n - 1):
        K[last, last] += weight * (c1 - c0 * ds_o * (rays[0] + rays[1]))


@compiled
def motion(x, slope, load, rays, bows, Q, V, A, ds_o):
    """p., p.. - sigma j, and r' behind and ahead of the car as the slopes of the basis show it, (2,) each."""
    last, p = x.f.size - 1, acceleration(x, Q, V, A)
    velocity, behind, ahead = np.empty(2), np.empty(2), np.empty(2)
    for a in range(2):
        along, speed = slope[a], 0.0
        for i in range(last + 1):
            along += Q[a, i] * x.f_s[i]
            speed += V[a, i] * x.f[i]
        velocity[a] = speed + ds_o * along
        behind[a] = along + rays[0] * Q[a, last] - bows[0, 0, a]
        ahead[a] = along + rays[1] * Q[a, last] + bows[1, 0, a]
        p[a] += load[a]
    return velocity, p, behind, ahead


@compiled
def line(past, first, t):
    """p. (2,) at t between instants of `past` from `first` on."""
    i = first + 1
    while past[i, 0] < t:
        i += 1
    w = (t - past[i - 1, 0]) / (past[i, 0] - past[i - 1, 0])
    return (1.0 - w) * past[i - 1, 1] + w * past[i, 1], (1.0 - w) * past[i - 1, 2] + w * past[i, 2]


@compiled
def averaged(past, first, last, least):
    """The first row still wanted, t of the last one, the car's acceleration then by its velocities, and its rate.

    past : (m, 3) rows t and p.
    least : of the window, which where steps are long holds so many of them
    """
    t = past[last, 0]
    window = max(least, LEAST_WINDOW * (t - past[last - 1, 0])) if last > first else least
    while last > first + 1 and past[first + 1, 0] <= t - window:
        first += 1
    since = past[first, 0]
    if since > t - window:  # from rest
        span = t - since if t > since else math.inf
        return (
            float(first),
            t,
            (past[last, 1] - past[first, 1]) / span,
            (past[last, 2] - past[first, 2]) / span,
            0.0,
            0.0,
        )
    half = 0.5 * window
    ox, oy = line(past, first, t - window)
    mx, my = line(past, first, t - half)
    ax, ay, jx, jy = past[last, 1] - mx, past[last, 2] - my, mx - ox, my - oy
    jx, jy = (ax - jx) / half**2, (ay - jy) / half**2
    return float(first), t, ax / half + 0.5 * half * jx, ay / half + 0.5 * half * jy, jx, jy


@compiled
def roll(x, slope, load, rays, bows, sides, alpha, Q, V, A, ds_o, dds_o, on, thrust, R):
    """Add the cable's inertia and the car to R (2, n), and return `car`, and `by_force` of both sides.

    slope, load, rays, bows : of an `Instant`
    sides : as for `recover`.  tau is that of the tension from equilibrium: sines do not resolve a side that is shorter
        than their waves, and the balance of the car by their slopes errs by a hundred times as much.
    """
    last = x.f.size - 1
    velocity, p, behind, ahead = motion(x, slope, load, rays, bows, Q, V, A, ds_o)
    p[1] += on.sigma
    turns = recover(x, slope, rays, bows, sides, alpha, Q, V, A, ds_o, dds_o, behind, ahead)
    out = car(on, thrust, velocity, p, behind, ahead)
    bx, by = by_force(on, thrust, velocity, p, behind, ahead, turns[0], out[9], 0)
    ax, ay = by_force(on, thrust, velocity, p, behind, ahead, turns[1], out[9], 1)
    for a in range(2):  # with what it takes to shift the kink of the bubbles
        p[a] = out[a] + ds_o * ds_o * (bows[0, 0, a] + bows[1, 0, a])
    add_inertia(x, Q, V, A, p, R)
    add_bows(x, bows, R)
    weight = shed(x, ds_o, on)
    for a in range(2):
        R[a, last] += weight * (V[a, last] - Q[a, last] * ds_o * (rays[0] + rays[1]))
        # what bubbles kink is not the hat's to carry
        R[a, last] -= weight * (bows[0, 1, a] + bows[1, 1, a]) / (rays[0] - rays[1])
    return (*out, bx, by, ax, ay)


@compiled
def pulls(phi, gram):
    """How int (N t - T t_static) ds behind and ahead of the mass follow Q, (2, 2, 2, n): side, its field, Q's.

    gram : as `balance` leaves it
    """
    n, m = phi.shape
    both, sums, out = np.zeros((6, m)), np.empty((6, n)), np.empty((2, 2, 2, n))
    for q in range(m):
        first = 0 if phi[n - 1, q] > 0.0 else 3
        for i in range(3):
            both[first + i, q] = gram[i // 2, (i + 1) // 2, q]
    multiply(both, phi, True, sums)
    for side in range(2):
        for a in range(2):
            for b in range(2):
                for k in range(n):
                    out[side, a, b, k] = sums[3 * side + a + b, k]
    return out


@compiled
def row(x, out, rays, pulls, ds_o, dds_o, on, c0, c1, c2, into):
    """The car's row of the tangent, (2 n + 1,), by `roll`; tau turns with the forces of `recover`."""
    n, mu = x.f.size, on.mu
    rub = out[4] * math.copysign(on.rub, on.rub * out[8]) if math.isnan(on.ax) else 0.0
    along = out[2] - rub * out[3], out[3] + rub * out[2]
    for b in range(2):
        for j in range(n):
            own = along[b] * mu * (c2 * x.f[j] + c1 * x.f_v[j] + c0 * x.f_q[j])
            by_a = out[14 + b] * x.behind[j] - out[16 + b] * (x.mass[n - 1, j] - x.behind[j])
            by_q = 0.0
            for a in range(2):
                by_q += out[14 + a] * rays[0] * pulls[0, a, b, j] - out[16 + a] * rays[1] * pulls[1, a, b, j]
            into[b * n + j] = own + c2 * by_a + c0 * by_q
        by_v = -2.0 / 3.0 * ds_o * (out[14 + b] + out[16 + b])
        by_q = 2.0 * ds_o * ds_o * (out[14 + b] * rays[0] + out[16 + b] * rays[1])
        by_q -= dds_o * (out[14 + b] + out[16 + b])
        into[b * n + n - 1] += c1 * by_v + c0 * by_q / 3.0
