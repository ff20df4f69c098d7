"""A car that rolls: its balance along the mean tangent, and that row of the tangent."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.bases.kink import Carried
from galerkin.kernels.cable import Array, acceleration, add_inertia
from galerkin.kernels.dense import multiply
from galerkin.law import compiled, inner

LEAST_PULL = 1e-3  # over H, of a taut cable
STEP = 1e-6  # of differences
LEAST_WINDOW = 6.0  # least length of the window of `averaged`, in steps


class Rolling(NamedTuple):
    """What acts on a rolling car at an instant."""

    mu: float
    sigma: float
    drag: float  # of the air
    wind: float
    hold: float  # F_hold
    rub: float  # mu_r with the sign of friction
    brake: float  # with its sign
    ax: float = 0.0  # mean p.. for the friction; nan: the present one
    ay: float = 0.0


class Car(NamedTuple):
    """A car that rolls, at an instant."""

    Cx: float  # C = mu (p.. - sigma j) - F_ext, the force of the cable on it
    Cy: float
    tx: float  # tau
    ty: float
    cos_phi: float
    stretch: float  # <lam>
    drag_x: float
    drag_y: float
    pressing: float  # normal part of its force on the cable, downward
    defect: float  # tau . C - f cos(phi)
    speed: float  # tau . p.
    vx: float  # p.
    vy: float
    normal: float  # `pressing` for friction

    @property
    def along(self) -> float:
        return (self.tx * self.Cx + self.ty * self.Cy) / self.cos_phi


class Rolled(NamedTuple):
    """A car, and how its defect follows the forces behind and ahead."""

    car: Car
    behind: tuple[float, float]
    ahead: tuple[float, float]


NO_CAR = Rolled(Car(*(0.0,) * 14), (0.0, 0.0), (0.0, 0.0))


class Ground(NamedTuple):
    """What an instant brings at the mass."""

    x: Carried
    slope: Array  # X' at the mass, (2,)
    load: Array  # X.. - sigma j, (2,)
    s_o: float
    ds_o: float
    dds_o: float


class Coefficients(NamedTuple):
    """Coefficients of a state and their rates, (2, n) each."""

    Q: Array
    V: Array
    A: Array


def weighed_car(on, thrust, velocity, acceleration, behind, ahead):
    """The car from p., p.. and r' behind and ahead, (2,) or of n instants (2, n); thrust may be the haul force."""
    mx, my = 0.5 * (behind[0] + ahead[0]), 0.5 * (behind[1] + ahead[1])
    size = np.hypot(mx, my)
    tx, ty = mx / size, my / size
    stretch = 0.5 * (np.hypot(behind[0], behind[1]) + np.hypot(ahead[0], ahead[1]))
    x, y = velocity[0] - on.wind, velocity[1]
    air = -on.drag * np.hypot(x, y)
    Cx = on.mu * acceleration[0] - thrust * tx - air * x
    Cy = on.mu * (acceleration[1] - on.sigma) - thrust * ty - air * y
    pressing, cos_phi = ty * Cx - tx * Cy, size / stretch
    normal = pressing
    if not math.isnan(on.ax):
        normal = ty * (on.mu * on.ax - air * x) - tx * (on.mu * (on.ay - on.sigma) - air * y)
    defect = tx * Cx + ty * Cy - cos_phi * (on.hold / stretch + on.brake + on.rub * np.abs(normal))
    speed = tx * velocity[0] + ty * velocity[1]
    return Car(
        Cx, Cy, tx, ty, cos_phi, stretch, air * x, air * y, pressing, defect, speed, velocity[0], velocity[1], normal
    )


car = compiled(weighed_car)


@compiled
def taut(force, slope, T, alpha):
    """Turn r' (2,) into that of the force N t; return lam/N, 0 if slack."""
    N = math.hypot(force[0], force[1])
    if not (N > LEAST_PULL and force[0] * slope[0] + force[1] * slope[1] > 0.0):
        return 0.0
    size = (1.0 + (N - T) / alpha) / N
    slope[0], slope[1] = size * force[0], size * force[1]
    return size


@inner
def recover(here, y, sides, cable, behind, ahead):
    """Turn r' behind and ahead into those of the tension from equilibrium; return lam/N."""
    x, ds_o, dds_o, alpha = here.x, here.ds_o, here.dds_o + cable.damping * here.ds_o, cable.alpha
    last, near, far = x.f.size - 1, 1.0 / here.s_o, 1.0 / (1.0 - here.s_o)
    T, force = 1.0 / here.slope[0], np.empty((2, 2))
    for a in range(2):
        v, q = 2.0 / 3.0 * ds_o * y.V[a, last], y.Q[a, last] / 3.0
        force[0, a] = T * here.slope[a] + near * sides[0, a] - v + q * (2.0 * ds_o * ds_o * near - dds_o)
        force[1, a] = T * here.slope[a] + far * sides[1, a] - v - q * (2.0 * ds_o * ds_o * far + dds_o)
        for i in range(last + 1):
            rate = y.A[a, i] + cable.damping * y.V[a, i]
            force[0, a] += rate * x.behind[i]
            force[1, a] -= rate * (x.mass[last, i] - x.behind[i])
    return taut(force[0], behind, T, alpha), taut(force[1], ahead, T, alpha)


@compiled
def by_force(on, thrust, velocity, p, behind, ahead, turn, defect, side):
    """Derivative of the defect of `car` by the force behind (0) or ahead; turn : lam/N."""
    moved, got = np.empty((2, 2)), np.empty(2)
    slope = behind if side == 0 else ahead
    square = slope[0] * slope[0] + slope[1] * slope[1]
    for a in range(2):
        for b in range(2):
            moved[0, b], moved[1, b] = behind[b], ahead[b]
        for b in range(2):
            moved[side, b] += STEP * ((1.0 if a == b else 0.0) - slope[a] * slope[b] / square)
        got[a] = turn * (car(on, thrust, velocity, p, moved[0], moved[1]).defect - defect) / STEP
    return got[0], got[1]


@inner
def motion(here, y):
    """p., p.. - sigma j, and r' behind and ahead of the car by the slopes of the basis, (2,) each."""
    x = here.x
    last, p = x.f.size - 1, acceleration(x, y.Q, y.V, y.A)
    velocity, behind, ahead = np.empty(2), np.empty(2), np.empty(2)
    for a in range(2):
        along, speed = here.slope[a], 0.0
        for i in range(last + 1):
            along += y.Q[a, i] * x.f_s[i]
            speed += y.V[a, i] * x.f[i]
        velocity[a] = speed + here.ds_o * along
        behind[a] = along + y.Q[a, last] / here.s_o
        ahead[a] = along - y.Q[a, last] / (1.0 - here.s_o)
        p[a] += here.load[a]
    return velocity, p, behind, ahead


@inner
def line(past, first, t):
    """p. (2,) at t, linear between rows of `past`."""
    i = first + 1
    while past[i, 0] < t:
        i += 1
    w = (t - past[i - 1, 0]) / (past[i, 0] - past[i - 1, 0])
    return (1.0 - w) * past[i - 1, 1] + w * past[i, 1], (1.0 - w) * past[i - 1, 2] + w * past[i, 2]


@compiled
def averaged(past, first, last, least):
    """The car's mean acceleration from velocities over a window.

    past : rows t and p.;  least : length of the window
    Return the first row still wanted, t of the last, the acceleration then, and its rate.
    """
    t = past[last, 0]
    window = max(least, LEAST_WINDOW * (t - past[last - 1, 0])) if last > first else least
    while last > first + 1 and past[first + 1, 0] <= t - window:
        first += 1
    since = past[first, 0]
    if since > t - window:  # from rest
        span = t - since if t > since else math.inf
        ax, ay = (past[last, 1] - past[first, 1]) / span, (past[last, 2] - past[first, 2]) / span
        return float(first), t, ax, ay, 0.0, 0.0
    half = 0.5 * window
    ox, oy = line(past, first, t - window)
    mx, my = line(past, first, t - half)
    ax, ay, jx, jy = past[last, 1] - mx, past[last, 2] - my, mx - ox, my - oy
    jx, jy = (ax - jx) / half**2, (ay - jy) / half**2
    return float(first), t, ax / half + 0.5 * half * jx, ay / half + 0.5 * half * jy, jx, jy


@inner
def roll(here, y, sides, cable, on, thrust, R):
    """Add the cable's inertia and the car to R (2, n); return it as `Rolled`.

    tau belongs to the tension from equilibrium: slopes of sines are inaccurate on a short side.
    """
    velocity, p, behind, ahead = motion(here, y)
    p[1] += on.sigma
    turns = recover(here, y, sides, cable, behind, ahead)
    out = car(on, thrust, velocity, p, behind, ahead)
    by_behind = by_force(on, thrust, velocity, p, behind, ahead, turns[0], out.defect, 0)
    by_ahead = by_force(on, thrust, velocity, p, behind, ahead, turns[1], out.defect, 1)
    p[0], p[1] = out.Cx, out.Cy
    add_inertia(here.x, y.Q, y.V, y.A, cable.damping, p, R)
    return Rolled(out, by_behind, by_ahead)


@inner
def pulls(phi, gram):
    """Derivative of int (N t - T t_static) ds by Q, (2, 2, 2, n): side, its field, Q's."""
    n, m = phi.shape
    both, sums, out = np.zeros((6, m)), np.empty((6, n)), np.empty((2, 2, 2, n))
    for q in range(m):
        first = 0 if phi[n - 1, q] > 0.0 else 3
        for i in range(3):
            both[first + i, q] = gram[i, q]
    multiply(both, phi, True, sums)
    for side in range(2):
        for a in range(2):
            for b in range(2):
                for k in range(n):
                    out[side, a, b, k] = sums[3 * side + a + b, k]
    return out


@inner
def row(here, rolled, pulls, on, damping, c, into):
    """The car's row of the tangent, (2 n + 1,)."""
    x, ds_o, (c0, c1, c2), near, far = here.x, here.ds_o, c, 1.0 / here.s_o, 1.0 / (1.0 - here.s_o)
    n, mu, car = x.f.size, on.mu, rolled.car
    rub = car.cos_phi * math.copysign(on.rub, on.rub * car.pressing) if math.isnan(on.ax) else 0.0
    along = car.tx - rub * car.ty, car.ty + rub * car.tx
    for b in range(2):
        behind, ahead = rolled.behind[b], rolled.ahead[b]
        for j in range(n):
            own = along[b] * mu * (c2 * x.f[j] + c1 * x.f_v[j] + c0 * x.f_q[j])
            by_a = behind * x.behind[j] - ahead * (x.mass[n - 1, j] - x.behind[j])
            by_q = 0.0
            for a in range(2):
                by_q += rolled.behind[a] * near * pulls[0, a, b, j] + rolled.ahead[a] * far * pulls[1, a, b, j]
            into[b * n + j] = own + (c2 + c1 * damping) * by_a + c0 * by_q
        by_v = -2.0 / 3.0 * ds_o * (behind + ahead)
        by_q = 2.0 * ds_o * ds_o * (behind * near - ahead * far) - (here.dds_o + damping * ds_o) * (behind + ahead)
        into[b * n + n - 1] += c1 * by_v + c0 * by_q / 3.0
