"""A car that rolls: its balance along the mean tangent, and that row of the tangent."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.kernels.cable import Array, acceleration, add_inertia
from galerkin.kernels.dense import multiply
from galerkin.kernels.places import free_place, ground_at, place_of
from galerkin.law import compiled, inner

STUCK = 0
FREE = 1
HAULED = 2
LEAST_PULL = 1e-3  # over H, of a taut cable
STEP = 1e-6  # of difference quotients
LEAST_WINDOW = 6.0  # least length of the window of `averaged`, in steps


class Rolling(NamedTuple):
    """Loads on a rolling car at an instant."""

    mu: float
    sigma: float
    drag: float  # of the air
    wind: float
    hold: float = 0.0  # F_hold
    rub: float = 0.0  # mu_r with the sign of friction
    brake: float = 0.0  # with its sign
    ax: float = 0.0  # mean p.. for the friction; nan: the present one
    ay: float = 0.0


class Ride(NamedTuple):
    mode: int  # FREE, STUCK: the last unknown is s_o; HAULED: its acceleration is the haul force
    on: Rolling
    thrust: float


class Car(NamedTuple):
    """Forces and motion of a rolling car at an instant."""

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


NO_CAR = Car(*(0.0,) * 14)


class Course(NamedTuple):
    """A car between two events."""

    t: Array  # (m,) times at which the steps are balanced; (0,): one step without events
    thrust: Array  # (m,) there
    past: Array  # (k + m, 3) for `averaged`, m rows still empty
    window: float
    smooth: Array  # (6,) result of `averaged` for the last step; zeros at first
    low: float  # event: s_o leaves (low, high)
    high: float
    sign: float  # event: ds_o loses this sign; 0: it may turn
    forward: float  # sign of the speed
    slow: float  # event: a lower speed
    lifted: bool  # else lift-off is an event


class Coefficients(NamedTuple):
    """Coefficients of a state and their rates, (2, n) each."""

    Q: Array
    V: Array
    A: Array


@inner
def coefficients(state, n):
    return Coefficients(
        state[0, : 2 * n].reshape(2, n), state[1, : 2 * n].reshape(2, n), state[2, : 2 * n].reshape(2, n)
    )


def weighed_car(on, thrust, velocity, acceleration, sides):
    """The car from p., p.. (2,) and r' of both sides (2, 2), or of n instants (2, n), (2, 2, n).

    thrust : may be the haul force
    """
    behind = sides[0]
    ahead = sides[1]
    mx = 0.5 * (behind[0] + ahead[0])
    my = 0.5 * (behind[1] + ahead[1])
    size = np.hypot(mx, my)
    tx = mx / size
    ty = my / size
    stretch = 0.5 * (np.hypot(behind[0], behind[1]) + np.hypot(ahead[0], ahead[1]))
    x = velocity[0] - on.wind
    y = velocity[1]
    air = -on.drag * np.hypot(x, y)
    Cx = on.mu * acceleration[0] - thrust * tx - air * x
    Cy = on.mu * (acceleration[1] - on.sigma) - thrust * ty - air * y
    pressing = ty * Cx - tx * Cy
    cos_phi = size / stretch
    normal = pressing
    if not math.isnan(on.ax):
        normal = ty * (on.mu * on.ax - air * x) - tx * (on.mu * (on.ay - on.sigma) - air * y)
    defect = tx * Cx + ty * Cy - cos_phi * (on.hold / stretch + on.brake + on.rub * np.abs(normal))
    speed = tx * velocity[0] + ty * velocity[1]
    return Car(
        Cx, Cy, tx, ty, cos_phi, stretch, air * x, air * y, pressing, defect, speed, velocity[0], velocity[1], normal
    )


car = compiled(weighed_car)


@inner
def taut(force, slope, T, alpha):
    """Replace r' (2,) by that of the force N t; return lam/N, 0 if slack."""
    N = math.hypot(force[0], force[1])
    if not (N > LEAST_PULL and force[0] * slope[0] + force[1] * slope[1] > 0.0):
        return 0.0
    size = (1.0 + (N - T) / alpha) / N
    slope[0] = size * force[0]
    slope[1] = size * force[1]
    return size


@inner
def share(x, side, k):
    """int hat Phi_k ds behind (0) or ahead (1) of the car."""
    return x.behind[k] if side == 0 else x.mass[-1, k] - x.behind[k]


@inner
def motion(here, y, sigma):
    """p., p.. (2,), and r' of both sides (2, 2) by the slopes of the basis."""
    x = here.x
    last = x.f.size - 1
    p = acceleration(x, y.Q, y.V, y.A)
    velocity = np.empty(2)
    sides = np.empty((2, 2))
    for a in range(2):
        along = here.slope[a]
        speed = 0.0
        for i in range(last + 1):
            along += y.Q[a, i] * x.f_s[i]
            speed += y.V[a, i] * x.f[i]
        velocity[a] = speed + here.ds_o * along
        sides[0, a] = along + y.Q[a, last] / here.s_o
        sides[1, a] = along - y.Q[a, last] / (1.0 - here.s_o)
        p[a] += here.load[a]
    p[1] += sigma
    return velocity, p, sides


@inner
def recovered(here, y, internal, cable):
    """`motion` with r' by the tension from equilibrium, and lam/N of both sides.

    Slopes of sines are inaccurate on a short side.  internal : `sides` of `balance`
    """
    velocity, p, slopes = motion(here, y, cable.sigma)
    x = here.x
    ds_o = here.ds_o
    turns = np.empty(2)
    T = 1.0 / here.slope[0]
    last = x.f.size - 1
    force = np.empty(2)
    for side in range(2):
        h, sign = (here.s_o, 1.0) if side == 0 else (1.0 - here.s_o, -1.0)
        bends = sign * 2.0 * ds_o * ds_o / h - here.dds_o - cable.damping * ds_o
        for a in range(2):
            force[a] = T * here.slope[a] + internal[side, a] / h
            force[a] += (bends * y.Q[a, last] - 2.0 * ds_o * y.V[a, last]) / 3.0
            for i in range(last + 1):
                force[a] += sign * share(x, side, i) * (y.A[a, i] + cable.damping * y.V[a, i])
        turns[side] = taut(force, slopes[side], T, cable.alpha)
    return velocity, p, slopes, turns


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
        ax = (past[last, 1] - past[first, 1]) / span
        ay = (past[last, 2] - past[first, 2]) / span
        return float(first), t, ax, ay, 0.0, 0.0
    half = 0.5 * window
    ox, oy = line(past, first, t - window)
    mx, my = line(past, first, t - half)
    ax = past[last, 1] - mx
    ay = past[last, 2] - my
    jx = mx - ox
    jy = my - oy
    jx = (ax - jx) / half**2
    jy = (ay - jy) / half**2
    return float(first), t, ax / half + 0.5 * half * jx, ay / half + 0.5 * half * jy, jx, jy


@inner
def roll(here, y, internal, cable, on, thrust, R):
    """Add the cable's inertia and the car to R (2, n); return the car."""
    velocity, p, slopes, _ = recovered(here, y, internal, cable)
    out = car(on, thrust, velocity, p, slopes)
    p[0] = out.Cx
    p[1] = out.Cy
    add_inertia(here.x, y.Q, y.V, y.A, cable.damping, p, R)
    return out


@inner
def pulls(phi, gram):
    """Derivative of `sides` of `balance` by Q, (6, n): xx, xy, yy behind, and ahead."""
    n, m = phi.shape
    both = np.zeros((6, m))
    sums = np.empty((6, n))
    for q in range(m):
        first = 0 if phi[n - 1, q] > 0.0 else 3
        for i in range(3):
            both[first + i, q] = gram[i, q]
    multiply(both, phi, True, sums)
    return sums


@inner
def by_force(here, y, internal, cable, on, thrust, defect):
    """Derivative of the defect by the forces N t of both sides, (2, 2), by differences."""
    velocity, p, slopes, turns = recovered(here, y, internal, cable)
    out = np.empty((2, 2))
    for side in range(2):
        rx = slopes[side, 0]
        ry = slopes[side, 1]
        square = rx * rx + ry * ry
        for a in range(2):
            turned = -(rx if a == 0 else ry) / square
            slopes[side, 0] = rx + STEP * turned * rx
            slopes[side, 1] = ry + STEP * turned * ry
            slopes[side, a] += STEP
            out[side, a] = turns[side] * (car(on, thrust, velocity, p, slopes).defect - defect) / STEP
        slopes[side, 0] = rx
        slopes[side, 1] = ry
    return out


@inner
def row(here, ride, line, of, car, c):
    """Set the car's row of the tangent, last of `Space.K`."""
    ground = here.ground
    on = ride.on
    damping = line.cable.damping
    c0, c1, c2 = c
    x = ground.x
    ds_o = ground.ds_o
    n = ground.x.f.size
    into = of.K[0, 2 * n]
    sums = pulls(here.at.phi, of.gram)
    y = coefficients(of.balanced, n)
    by = by_force(ground, y, of.sides, line.cable, on, pulled(ride, of), car.defect)
    rub = car.cos_phi * math.copysign(on.rub, on.rub * car.pressing) if math.isnan(on.ax) else 0.0
    along = car.tx - rub * car.ty, car.ty + rub * car.tx
    for b in range(2):
        for j in range(n):
            into[b * n + j] = along[b] * on.mu * (c2 * x.f[j] + c1 * x.f_v[j] + c0 * x.f_q[j])
        for side in range(2):
            h, sign = (ground.s_o, 1.0) if side == 0 else (1.0 - ground.s_o, -1.0)
            for j in range(n):
                into[b * n + j] += (c2 + c1 * damping) * sign * by[side, b] * share(x, side, j)
                for a in range(2):
                    into[b * n + j] += c0 / h * by[side, a] * sums[3 * side + a + b, j]
            bends = sign * 2.0 * ds_o * ds_o / h - ground.dds_o - damping * ds_o
            into[b * n + n - 1] += by[side, b] * (c0 * bends - c1 * 2.0 * ds_o) / 3.0


@inner
def pulled(ride, of):
    return of.balanced[2, -1] if ride.mode == HAULED else ride.thrust


@inner
def ride_on(ground, ride, line, of, R):
    """Add the cable's inertia and the car to R (2, n), and set its row of the residual; return the car."""
    n = R.shape[1]
    for a in range(2):
        for i in range(n):
            of.internal[a, i] = R[a, i]
    out = roll(ground, coefficients(of.balanced, n), of.sides, line.cable, ride.on, pulled(ride, of), R)
    of.r[2 * n] = line.cable.mu * of.balanced[2, 2 * n] if ride.mode == STUCK else out.defect
    return out


@inner
def ride_tangent(here, ride, line, of, out, c):
    """Set row and column of the car in K of `Space` after `ride_on`, which returned `out`.

    The column of s_o is a difference without dr/ds_o.
    """
    ground = here.ground
    K = of.K[0]
    _, c1, c2 = c
    n = ground.x.f.size
    last = K.shape[0] - 1
    for i in range(last + 1):
        K[last, i] = K[i, last] = 0.0
    if ride.mode == STUCK:
        K[last, last] = c2 * line.cable.mu
        return
    row(here, ride, line, of, out, c)
    if ride.mode == HAULED:
        for i in range(n):
            K[i, last] = -c2 * out.tx * ground.x.f[i]
            K[n + i, last] = -c2 * out.ty * ground.x.f[i]
        K[last, last] = -c2
    elif c1 + c2 != 0.0:
        h = STEP / (c1 + c2)
        R = np.zeros((2, n))
        moved = ground_at(line, (ground.s_o, ground.ds_o + h * c1, ground.dds_o + h * c2))
        other = roll(moved, coefficients(of.balanced, n), of.sides, line.cable, ride.on, ride.thrust, R)
        K[last, last] = (other.defect - out.defect) / h
        for a in range(2):
            for i in range(n):
                K[a * n + i, last] = (R[a, i] + of.internal[a, i] - of.r[a * n + i]) / h


@compiled
def seen(on, line, place, state):
    """`car` at a state, rows q, v, a, by the slopes of the basis and without thrust."""
    velocity, p, sides = motion(ground_at(line, place), coefficients(state, line.left.size + 1), line.cable.sigma)
    return car(on, 0.0, velocity, p, sides)


@inner
def begin_step(ride, course, rule, i, car):
    """Add the car at the start of step i to `past`; return the `Ride` of the step."""
    past = course.past
    newest = course.past.shape[0] - course.t.size + i
    past[newest, 0] = course.t[i] - rule[0, 4] * rule[0, 1]
    past[newest, 1] = car.vx
    past[newest, 2] = car.vy
    smooth = averaged(past, int(course.smooth[0]), newest, course.window)
    for k in range(6):
        course.smooth[k] = smooth[k]
    return at_time(ride, course.smooth, course.t[i], course.thrust[i])


@inner
def end_step(ride, course, line, places, rule, i, end):
    """The car at the end of step i; a hauled one where the step is balanced."""
    if ride.mode == HAULED:
        return seen(ride.on, line, place_of(places, i), end)
    t = course.t[i] + (1.0 - rule[0, 4]) * rule[0, 1]
    return seen(at_time(ride, course.smooth, t, 0.0).on, line, free_place(end), end)


@inner
def at_time(ride, smooth, t, thrust):
    """`Ride` at t, with the mean acceleration by the result of `averaged`."""
    d = t - smooth[1]
    on = ride.on
    ax = smooth[2] + d * smooth[4]
    ay = smooth[3] + d * smooth[5]
    on = Rolling(on.mu, on.sigma, on.drag, on.wind, on.hold, on.rub, on.brake, ax, ay)
    return Ride(ride.mode, on, thrust)


@inner
def has_event(ride, course, end, car):
    if not (course.lifted or max(car.pressing, car.normal) > 0.0):
        return True
    if ride.mode == HAULED:
        return False
    s_o, ds_o, _ = free_place(end)
    if not course.low < s_o < course.high or (course.sign != 0.0 and not course.sign * ds_o > 0.0):
        return True
    return not course.forward * car.speed > course.slow
