"""A car that rolls: its balance along the mean tangent, and that row of the tangent."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.kernels.cable import Array, acceleration_on_path, add_inertia
from galerkin.kernels.dense import multiply
from galerkin.kernels.instant import kinematics_in_row, kinematics_of_state, mass_terms
from galerkin.law import compiled, inner

STUCK = 0
FREE = 1
HAULED = 2
MIN_TENSION = 1e-3  # over H, of a taut cable
STEP = 1e-6  # of difference quotients
MIN_WINDOW = 6.0  # least length of the window of `mean_acceleration`, in steps


class CarLoads(NamedTuple):
    """Loads on a rolling car at an instant."""

    mu: float
    sigma: float
    drag: float  # of the air
    wind: float
    hold: float = 0.0  # F_hold
    friction: float = 0.0  # mu_r with the sign of friction
    brake: float = 0.0  # with its sign
    ax: float = 0.0  # mean p.. for the friction; nan: the present one
    ay: float = 0.0


class Ride(NamedTuple):
    mode: int  # FREE, STUCK: the last unknown is s_o; HAULED: its acceleration is the haul force
    loads: CarLoads
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


class CarHistory(NamedTuple):
    """A car between two events."""

    t: Array  # (m,) times at which the steps are balanced; (0,): one step without events
    thrust: Array  # (m,) there
    past: Array  # (k + m, 3) for `mean_acceleration`, m rows still empty
    window: float
    smooth: Array  # (6,) result of `mean_acceleration` for the last step; zeros at first
    low: float  # event: s_o leaves (low, high)
    high: float
    sign: float  # event: ds_o loses this sign; 0: it may turn
    forward: float  # sign of the speed
    slow: float  # event: a lower speed
    lifted_off: bool  # else lift-off is an event


class Coefficients(NamedTuple):
    """Coefficients of a state and their rates, (2, n) each."""

    Q: Array
    V: Array
    A: Array


@inner
def split_state(state, n):
    return Coefficients(
        state[0, : 2 * n].reshape(2, n), state[1, : 2 * n].reshape(2, n), state[2, : 2 * n].reshape(2, n)
    )


def car_from_motion(loads, thrust, velocity, acceleration, sides):
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
    x = velocity[0] - loads.wind
    y = velocity[1]
    air = -loads.drag * np.hypot(x, y)
    Cx = loads.mu * acceleration[0] - thrust * tx - air * x
    Cy = loads.mu * (acceleration[1] - loads.sigma) - thrust * ty - air * y
    pressing = ty * Cx - tx * Cy
    cos_phi = size / stretch
    normal = pressing
    if not math.isnan(loads.ax):
        normal = ty * (loads.mu * loads.ax - air * x) - tx * (loads.mu * (loads.ay - loads.sigma) - air * y)
    defect = tx * Cx + ty * Cy - cos_phi * (loads.hold / stretch + loads.brake + loads.friction * np.abs(normal))
    speed = tx * velocity[0] + ty * velocity[1]
    return Car(
        Cx, Cy, tx, ty, cos_phi, stretch, air * x, air * y, pressing, defect, speed, velocity[0], velocity[1], normal
    )


car = compiled(car_from_motion)


@inner
def set_slope_from_force(force, slope, T, alpha):
    """Replace r' (2,) by that of the force N t; return lam/N, 0 if slack."""
    N = math.hypot(force[0], force[1])
    if not (N > MIN_TENSION and force[0] * slope[0] + force[1] * slope[1] > 0.0):
        return 0.0
    size = (1.0 + (N - T) / alpha) / N
    slope[0] = size * force[0]
    slope[1] = size * force[1]
    return size


@inner
def hat_overlap(terms, side, k):
    """int hat Phi_k ds behind (0) or ahead (1) of the car."""
    return terms.behind[k] if side == 0 else terms.mass[-1, k] - terms.behind[k]


@inner
def car_kinematics(at_mass, coefficients, sigma):
    """p., p.. (2,), and r' of both sides (2, 2) by the slopes of the basis."""
    terms = at_mass.inertia
    last = terms.f.size - 1
    p = acceleration_on_path(terms, coefficients.Q, coefficients.V, coefficients.A)
    velocity = np.empty(2)
    sides = np.empty((2, 2))
    for a in range(2):
        along = at_mass.slope[a]
        speed = 0.0
        for i in range(last + 1):
            along += coefficients.Q[a, i] * terms.f_s[i]
            speed += coefficients.V[a, i] * terms.f[i]
        velocity[a] = speed + at_mass.ds_o * along
        sides[0, a] = along + coefficients.Q[a, last] / at_mass.s_o
        sides[1, a] = along - coefficients.Q[a, last] / (1.0 - at_mass.s_o)
        p[a] += at_mass.load[a]
    p[1] += sigma
    return velocity, p, sides


@inner
def car_kinematics_from_tension(at_mass, coefficients, internal, cable):
    """`car_kinematics` with r' by the tension from equilibrium, and lam/N of both sides.

    Slopes of sines are inaccurate on a short side.  internal : `side_forces` of `set_internal_force`
    """
    velocity, p, slopes = car_kinematics(at_mass, coefficients, cable.sigma)
    terms = at_mass.inertia
    ds_o = at_mass.ds_o
    turns = np.empty(2)
    T = 1.0 / at_mass.slope[0]
    last = terms.f.size - 1
    force = np.empty(2)
    for side in range(2):
        h, sign = (at_mass.s_o, 1.0) if side == 0 else (1.0 - at_mass.s_o, -1.0)
        bends = sign * 2.0 * ds_o * ds_o / h - at_mass.dds_o - cable.damping * ds_o
        for a in range(2):
            force[a] = T * at_mass.slope[a] + internal[side, a] / h
            force[a] += (bends * coefficients.Q[a, last] - 2.0 * ds_o * coefficients.V[a, last]) / 3.0
            for i in range(last + 1):
                force[a] += (
                    sign * hat_overlap(terms, side, i) * (coefficients.A[a, i] + cable.damping * coefficients.V[a, i])
                )
        turns[side] = set_slope_from_force(force, slopes[side], T, cable.alpha)
    return velocity, p, slopes, turns


@inner
def velocity_at(past, first, t):
    """p. (2,) at t, linear between rows of `past`."""
    i = first + 1
    while past[i, 0] < t:
        i += 1
    w = (t - past[i - 1, 0]) / (past[i, 0] - past[i - 1, 0])
    return (1.0 - w) * past[i - 1, 1] + w * past[i, 1], (1.0 - w) * past[i - 1, 2] + w * past[i, 2]


@compiled
def mean_acceleration(past, first, last, min_window):
    """The car's mean acceleration from velocities over a window.

    past : rows t and p.;  min_window : length of the window
    Return the first row still wanted, t of the last, the acceleration then, and its rate.
    """
    t = past[last, 0]
    window = max(min_window, MIN_WINDOW * (t - past[last - 1, 0])) if last > first else min_window
    while last > first + 1 and past[first + 1, 0] <= t - window:
        first += 1
    since = past[first, 0]
    if since > t - window:  # from rest
        span = t - since if t > since else math.inf
        ax = (past[last, 1] - past[first, 1]) / span
        ay = (past[last, 2] - past[first, 2]) / span
        return float(first), t, ax, ay, 0.0, 0.0
    half = 0.5 * window
    ox, oy = velocity_at(past, first, t - window)
    mx, my = velocity_at(past, first, t - half)
    ax = past[last, 1] - mx
    ay = past[last, 2] - my
    jx = mx - ox
    jy = my - oy
    jx = (ax - jx) / half**2
    jy = (ay - jy) / half**2
    return float(first), t, ax / half + 0.5 * half * jx, ay / half + 0.5 * half * jy, jx, jy


@inner
def add_car_and_inertia(at_mass, coefficients, internal, cable, loads, thrust, R):
    """Add the cable's inertia and the car to R (2, n); return the car."""
    velocity, p, slopes, _ = car_kinematics_from_tension(at_mass, coefficients, internal, cable)
    out = car(loads, thrust, velocity, p, slopes)
    p[0] = out.Cx
    p[1] = out.Cy
    add_inertia(at_mass.inertia, coefficients.Q, coefficients.V, coefficients.A, cable.damping, p, R)
    return out


@inner
def side_force_derivatives(phi, gram):
    """Derivative of `side_forces` of `set_internal_force` by Q, (6, n): xx, xy, yy behind, and ahead."""
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
def defect_by_side_forces(at_mass, coefficients, internal, cable, loads, thrust, defect):
    """Derivative of the defect by the forces N t of both sides, (2, 2), by differences."""
    velocity, p, slopes, turns = car_kinematics_from_tension(at_mass, coefficients, internal, cable)
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
            out[side, a] = turns[side] * (car(loads, thrust, velocity, p, slopes).defect - defect) / STEP
        slopes[side, 0] = rx
        slopes[side, 1] = ry
    return out


@inner
def set_car_row(now, ride, sines, workspace, car, c):
    """Set the car's row of the tangent, last of `Workspace.K`."""
    at_mass = now.at_mass
    loads = ride.loads
    damping = sines.cable.damping
    c0, c1, c2 = c
    terms = at_mass.inertia
    ds_o = at_mass.ds_o
    n = at_mass.inertia.f.size
    into = workspace.K[2 * n]
    sums = side_force_derivatives(now.points.phi, workspace.gram)
    coefficients = split_state(workspace.balanced, n)
    by = defect_by_side_forces(
        at_mass,
        coefficients,
        workspace.side_forces,
        sines.cable,
        loads,
        thrust_or_haul_force(ride, workspace),
        car.defect,
    )
    rub = car.cos_phi * math.copysign(loads.friction, loads.friction * car.pressing) if math.isnan(loads.ax) else 0.0
    along = car.tx - rub * car.ty, car.ty + rub * car.tx
    for b in range(2):
        for j in range(n):
            into[b * n + j] = along[b] * loads.mu * (c2 * terms.f[j] + c1 * terms.f_v[j] + c0 * terms.f_q[j])
        for side in range(2):
            h, sign = (at_mass.s_o, 1.0) if side == 0 else (1.0 - at_mass.s_o, -1.0)
            for j in range(n):
                into[b * n + j] += (c2 + c1 * damping) * sign * by[side, b] * hat_overlap(terms, side, j)
                for a in range(2):
                    into[b * n + j] += c0 / h * by[side, a] * sums[3 * side + a + b, j]
            bends = sign * 2.0 * ds_o * ds_o / h - at_mass.dds_o - damping * ds_o
            into[b * n + n - 1] += by[side, b] * (c0 * bends - c1 * 2.0 * ds_o) / 3.0


@inner
def thrust_or_haul_force(ride, workspace):
    return workspace.balanced[2, -1] if ride.mode == HAULED else ride.thrust


@inner
def add_car_and_set_its_row(at_mass, ride, sines, workspace, R):
    """Add the cable's inertia and the car to R (2, n), and set its row of the residual; return the car."""
    n = R.shape[1]
    for a in range(2):
        for i in range(n):
            workspace.internal[a, i] = R[a, i]
    out = add_car_and_inertia(
        at_mass,
        split_state(workspace.balanced, n),
        workspace.side_forces,
        sines.cable,
        ride.loads,
        thrust_or_haul_force(ride, workspace),
        R,
    )
    workspace.r[2 * n] = sines.cable.mu * workspace.balanced[2, 2 * n] if ride.mode == STUCK else out.defect
    return out


@inner
def set_car_tangent(now, ride, sines, workspace, out, c):
    """Set row and column of the car in K of `Workspace` after `add_car_and_set_its_row`, which returned `out`.

    The column of s_o is a difference without dr/ds_o.
    """
    at_mass = now.at_mass
    K = workspace.K
    _, c1, c2 = c
    n = at_mass.inertia.f.size
    last = K.shape[0] - 1
    for i in range(last + 1):
        K[last, i] = K[i, last] = 0.0
    if ride.mode == STUCK:
        K[last, last] = c2 * sines.cable.mu
        return
    set_car_row(now, ride, sines, workspace, out, c)
    if ride.mode == HAULED:
        for i in range(n):
            K[i, last] = -c2 * out.tx * at_mass.inertia.f[i]
            K[n + i, last] = -c2 * out.ty * at_mass.inertia.f[i]
        K[last, last] = -c2
    elif c1 + c2 != 0.0:
        h = STEP / (c1 + c2)
        R = np.zeros((2, n))
        moved = mass_terms(sines, (at_mass.s_o, at_mass.ds_o + h * c1, at_mass.dds_o + h * c2))
        other = add_car_and_inertia(
            moved, split_state(workspace.balanced, n), workspace.side_forces, sines.cable, ride.loads, ride.thrust, R
        )
        K[last, last] = (other.defect - out.defect) / h
        for a in range(2):
            for i in range(n):
                K[a * n + i, last] = (R[a, i] + workspace.internal[a, i] - workspace.r[a * n + i]) / h


@compiled
def car_by_slopes(loads, sines, kinematics, state):
    """`car` at a state, rows q, v, a, by the slopes of the basis and without thrust."""
    velocity, p, sides = car_kinematics(
        mass_terms(sines, kinematics), split_state(state, sines.left.size + 1), sines.cable.sigma
    )
    return car(loads, 0.0, velocity, p, sides)


@inner
def record_car_and_update_ride(ride, history, rule, i, car):
    """Add the car at the start of step i to `past`; return the `Ride` of the step."""
    past = history.past
    newest = history.past.shape[0] - history.t.size + i
    past[newest, 0] = history.t[i] - rule[0, 4] * rule[0, 1]
    past[newest, 1] = car.vx
    past[newest, 2] = car.vy
    smooth = mean_acceleration(past, int(history.smooth[0]), newest, history.window)
    for k in range(6):
        history.smooth[k] = smooth[k]
    return ride_at_time(ride, history.smooth, history.t[i], history.thrust[i])


@inner
def car_at_step_end(ride, history, sines, kinematics, rule, i, end):
    """The car at the end of step i; a hauled one where the step is balanced."""
    if ride.mode == HAULED:
        return car_by_slopes(ride.loads, sines, kinematics_in_row(kinematics, i), end)
    t = history.t[i] + (1.0 - rule[0, 4]) * rule[0, 1]
    return car_by_slopes(ride_at_time(ride, history.smooth, t, 0.0).loads, sines, kinematics_of_state(end), end)


@inner
def ride_at_time(ride, smooth, t, thrust):
    """`Ride` at t, with the mean acceleration by the result of `mean_acceleration`."""
    d = t - smooth[1]
    loads = ride.loads
    ax = smooth[2] + d * smooth[4]
    ay = smooth[3] + d * smooth[5]
    loads = CarLoads(loads.mu, loads.sigma, loads.drag, loads.wind, loads.hold, loads.friction, loads.brake, ax, ay)
    return Ride(ride.mode, loads, thrust)


@inner
def has_event(ride, history, end, car):
    if not (history.lifted_off or max(car.pressing, car.normal) > 0.0):
        return True
    if ride.mode == HAULED:
        return False
    s_o, ds_o, _ = kinematics_of_state(end)
    if not history.low < s_o < history.high or (history.sign != 0.0 and not history.sign * ds_o > 0.0):
        return True
    return not history.forward * car.speed > history.slow
