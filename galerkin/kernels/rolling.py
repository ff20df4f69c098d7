"""A car that rolls: its balance along the mean tangent, and that row of the tangent."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from galerkin.kernels.cable import (
    Array,
    RealTangentFactors,
    acceleration_along_mass_path,
    add_inertia_and_mass_force,
)
from galerkin.kernels.dense import set_matrix_product
from galerkin.kernels.instant import (
    CableSines,
    Instant,
    Kinematics,
    MassTerms,
    kinematics_in_row,
    kinematics_of_free_car,
    mass_terms_at,
)
from galerkin.law import compiled, inner

if TYPE_CHECKING:
    from galerkin.bases.kink import InertiaTerms
    from galerkin.kernels.cable import Cable
    from galerkin.kernels.steps import Workspace

STUCK = 0
FREE = 1
HAULED = 2
MIN_TENSION = 1e-3  # over H, of a taut cable
STEP = 1e-6  # of difference quotients
MIN_WINDOW = 6.0  # [steps] shortest window of `mean_acceleration_and_rate`


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
    """How a car rolls, and its loads."""

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
    def needed_force_along_rope(self) -> float:
        """f of the balance tau . C = f cos(phi)."""
        return (self.tx * self.Cx + self.ty * self.Cy) / self.cos_phi


NO_CAR = Car(*(0.0,) * 14)


class CarInputs(NamedTuple):
    """What fixes the forces on a rolling car."""

    at_mass: MassTerms
    coefficients: Coefficients
    side_forces: Array  # of `Workspace`
    cable: Cable
    loads: CarLoads
    thrust: float  # or the haul force


class MotionAtCar(NamedTuple):
    """Motion of the car, and the cable beside it."""

    velocity: Array  # p. (2,)
    acceleration: Array  # p.. (2,)
    slopes: Array  # r' of both sides (2, 2)
    stretch_over_tension: Array  # lam/N of both sides (2,), 0 where slack


class MeanAcceleration(NamedTuple):
    """The car's mean acceleration over a window, and its rate."""

    first: float  # first row of the velocities that is still wanted
    t: float
    ax: float  # at t
    ay: float
    jx: float
    jy: float


class CarHistory(NamedTuple):
    """A car between two events."""

    t: Array  # (m,) times at which the steps are balanced; (0,): one step without events
    thrust: Array  # (m,) there
    past: Array  # (k + m, 3) for `mean_acceleration_and_rate`, m rows still empty
    window: float
    mean_acceleration: Array  # (6,) `MeanAcceleration` for the last step; zeros at first
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
def coefficients_of_state(state: Array, n: int) -> Coefficients:
    """Views of the state (3, n_dof)."""
    Q = state[0, : 2 * n].reshape(2, n)
    V = state[1, : 2 * n].reshape(2, n)
    A = state[2, : 2 * n].reshape(2, n)
    return Coefficients(Q, V, A)


def car_from_motion(loads: CarLoads, thrust: Any, velocity: Any, acceleration: Any, slopes: Any) -> Car:
    """The car from p., p.. (2,) and r' of both sides (2, 2), or of n instants (2, n), (2, 2, n).

    thrust : may be the haul force
    """
    behind = slopes[0]
    ahead = slopes[1]
    mx = 0.5 * (behind[0] + ahead[0])
    my = 0.5 * (behind[1] + ahead[1])
    size = np.hypot(mx, my)
    tx = mx / size
    ty = my / size
    stretch = 0.5 * (np.hypot(behind[0], behind[1]) + np.hypot(ahead[0], ahead[1]))
    x = velocity[0] - loads.wind
    y = velocity[1]
    air = -loads.drag * np.hypot(x, y)
    drag_x = air * x
    drag_y = air * y
    Cx = loads.mu * acceleration[0] - thrust * tx - drag_x
    Cy = loads.mu * (acceleration[1] - loads.sigma) - thrust * ty - drag_y
    pressing = ty * Cx - tx * Cy
    cos_phi = size / stretch
    normal = pressing
    if not math.isnan(loads.ax):
        normal = ty * (loads.mu * loads.ax - drag_x) - tx * (loads.mu * (loads.ay - loads.sigma) - drag_y)
    resisting = loads.hold / stretch + loads.brake + loads.friction * np.abs(normal)
    defect = tx * Cx + ty * Cy - cos_phi * resisting
    vx = velocity[0]
    vy = velocity[1]
    speed = tx * vx + ty * vy
    return Car(Cx, Cy, tx, ty, cos_phi, stretch, drag_x, drag_y, pressing, defect, speed, vx, vy, normal)


compiled_car_from_motion = compiled(car_from_motion)


@inner
def stretch_over_tension_if_taut(force: Array, slope: Array, T: float, alpha: float) -> float:
    """lam/N where the cable carries the force N t (2,); 0 where it is slack, r' (2,) = slope points elsewhere."""
    N = math.hypot(force[0], force[1])
    if not (N > MIN_TENSION and force[0] * slope[0] + force[1] * slope[1] > 0.0):
        return 0.0
    return (1.0 + (N - T) / alpha) / N


@inner
def side_length(at_mass: MassTerms, side: int) -> float:
    """Length of the cable behind (0) or ahead (1) of the car."""
    return at_mass.s_o if side == 0 else 1.0 - at_mass.s_o


@inner
def hat_overlap_on_side(terms: InertiaTerms, side: int, k: int) -> float:
    """int hat Phi_k ds behind (0) or ahead (1) of the car."""
    return terms.behind[k] if side == 0 else terms.mass[-1, k] - terms.behind[k]


@inner
def car_velocity_acceleration_and_slopes(
    at_mass: MassTerms, coefficients: Coefficients, sigma: float
) -> tuple[Array, Array, Array]:
    """p., p.. (2,), and r' of both sides (2, 2) by the slopes of the basis."""
    terms = at_mass.inertia
    last = terms.f.size - 1
    p = acceleration_along_mass_path(terms, coefficients.Q, coefficients.V, coefficients.A)
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
def car_motion_by_equilibrium(inputs: CarInputs) -> MotionAtCar:
    """`car_velocity_acceleration_and_slopes` with r' by the tension from equilibrium.

    Slopes of sines are inaccurate on a short side.
    """
    at_mass, coefficients, side_forces, cable, _, _ = inputs
    velocity, p, slopes = car_velocity_acceleration_and_slopes(at_mass, coefficients, cable.sigma)
    terms = at_mass.inertia
    ds_o = at_mass.ds_o
    ratios = np.empty(2)
    T = 1.0 / at_mass.slope[0]
    last = terms.f.size - 1
    force = np.empty(2)
    for side in range(2):
        h = side_length(at_mass, side)
        sign = 1.0 - 2.0 * side
        bends = sign * 2.0 * ds_o * ds_o / h - at_mass.dds_o - cable.damping * ds_o
        for a in range(2):
            force[a] = T * at_mass.slope[a] + side_forces[side, a] / h
            force[a] += (bends * coefficients.Q[a, last] - 2.0 * ds_o * coefficients.V[a, last]) / 3.0
            for i in range(last + 1):
                rate = coefficients.A[a, i] + cable.damping * coefficients.V[a, i]
                force[a] += sign * hat_overlap_on_side(terms, side, i) * rate
        ratios[side] = stretch_over_tension_if_taut(force, slopes[side], T, cable.alpha)
        if ratios[side] != 0.0:
            slopes[side, 0] = ratios[side] * force[0]
            slopes[side, 1] = ratios[side] * force[1]
    return MotionAtCar(velocity, p, slopes, ratios)


@inner
def past_velocity_at(past: Array, first: int, t: float) -> tuple[float, float]:
    """p. at t, linear between rows of `past`; the search begins after row `first`."""
    i = first + 1
    while past[i, 0] < t:
        i += 1
    w = (t - past[i - 1, 0]) / (past[i, 0] - past[i - 1, 0])
    return (1.0 - w) * past[i - 1, 1] + w * past[i, 1], (1.0 - w) * past[i - 1, 2] + w * past[i, 2]


@compiled
def mean_acceleration_and_rate(past: Array, first: int, last: int, min_window: float) -> MeanAcceleration:
    """The car's mean acceleration at row `last`, from its velocities over a window before it, and its rate.

    past : rows t and p.;  min_window : length of the window;  first : row where the search for its begin starts
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
        return MeanAcceleration(float(first), t, ax, ay, 0.0, 0.0)
    half = 0.5 * window
    ox, oy = past_velocity_at(past, first, t - window)
    mx, my = past_velocity_at(past, first, t - half)
    dx = past[last, 1] - mx
    dy = past[last, 2] - my
    jx = (dx - (mx - ox)) / half**2
    jy = (dy - (my - oy)) / half**2
    ax = dx / half + 0.5 * half * jx
    ay = dy / half + 0.5 * half * jy
    return MeanAcceleration(float(first), t, ax, ay, jx, jy)


@inner
def inputs_of_car(at_mass: MassTerms, ride: Ride, sines: CableSines, workspace: Workspace) -> CarInputs:
    """`CarInputs` of the state that is balanced."""
    coefficients = coefficients_of_state(workspace.balanced, at_mass.inertia.f.size)
    thrust = workspace.balanced[2, -1] if ride.mode == HAULED else ride.thrust
    return CarInputs(at_mass, coefficients, workspace.side_forces, sines.cable, ride.loads, thrust)


@inner
def add_inertia_and_car_force_return_car(inputs: CarInputs, R: Array) -> Car:
    """Add the cable's inertia and the car to R (2, n); return the car."""
    x = car_motion_by_equilibrium(inputs)
    car = compiled_car_from_motion(inputs.loads, inputs.thrust, x.velocity, x.acceleration, x.slopes)
    C = np.empty(2)
    C[0] = car.Cx
    C[1] = car.Cy
    add_inertia_and_mass_force(inputs.at_mass.inertia, inputs.coefficients, inputs.cable.damping, C, R)
    return car


@inner
def side_force_derivatives_by_amplitude(phi: Array, weighted_stiffness: Array) -> Array:
    """Derivative of `side_forces` of `Workspace` by Q, (6, n): xx, xy, yy behind, and ahead."""
    n, m = phi.shape
    both = np.zeros((6, m))
    sums = np.empty((6, n))
    for q in range(m):
        first = 0 if phi[n - 1, q] > 0.0 else 3
        for i in range(3):
            both[first + i, q] = weighted_stiffness[i, q]
    set_matrix_product(both, phi, True, sums)
    return sums


@inner
def defect_derivatives_by_forces(inputs: CarInputs, defect: float) -> Array:
    """Derivative of the car's defect by the forces N t of both sides, (2, 2), by differences."""
    velocity, p, slopes, ratios = car_motion_by_equilibrium(inputs)
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
            moved = compiled_car_from_motion(inputs.loads, inputs.thrust, velocity, p, slopes)
            out[side, a] = ratios[side] * (moved.defect - defect) / STEP
        slopes[side, 0] = rx
        slopes[side, 1] = ry
    return out


@inner
def set_workspace_tangent_row_of_car(
    now: Instant, ride: Ride, sines: CableSines, workspace: Workspace, car: Car, c: RealTangentFactors
) -> None:
    """Set the car's row of the tangent, last of `Workspace.K`."""
    at_mass = now.at_mass
    loads = ride.loads
    damping = sines.cable.damping
    c0, c1, c2 = c
    terms = at_mass.inertia
    ds_o = at_mass.ds_o
    n = terms.f.size
    row = workspace.K[2 * n]
    sums = side_force_derivatives_by_amplitude(now.points.phi, workspace.weighted_stiffness)
    by = defect_derivatives_by_forces(inputs_of_car(at_mass, ride, sines, workspace), car.defect)
    friction = 0.0
    if math.isnan(loads.ax):
        friction = car.cos_phi * math.copysign(loads.friction, loads.friction * car.pressing)
    along = car.tx - friction * car.ty, car.ty + friction * car.tx
    for b in range(2):
        for j in range(n):
            row[b * n + j] = along[b] * loads.mu * (c2 * terms.f[j] + c1 * terms.f_v[j] + c0 * terms.f_q[j])
        for side in range(2):
            h = side_length(at_mass, side)
            sign = 1.0 - 2.0 * side
            for j in range(n):
                row[b * n + j] += (c2 + c1 * damping) * sign * by[side, b] * hat_overlap_on_side(terms, side, j)
                for a in range(2):
                    row[b * n + j] += c0 / h * by[side, a] * sums[3 * side + a + b, j]
            bends = sign * 2.0 * ds_o * ds_o / h - at_mass.dds_o - damping * ds_o
            row[b * n + n - 1] += by[side, b] * (c0 * bends - c1 * 2.0 * ds_o) / 3.0


@inner
def complete_residual_return_car(
    at_mass: MassTerms, ride: Ride, sines: CableSines, workspace: Workspace, R: Array
) -> Car:
    """Add the cable's inertia and the car to the internal force R (2, n), and set the car's row; return the car."""
    n = R.shape[1]
    for a in range(2):
        for i in range(n):
            workspace.internal[a, i] = R[a, i]
    car = add_inertia_and_car_force_return_car(inputs_of_car(at_mass, ride, sines, workspace), R)
    workspace.r[2 * n] = sines.cable.mu * workspace.balanced[2, 2 * n] if ride.mode == STUCK else car.defect
    return car


@inner
def complete_workspace_tangent_with_car(
    now: Instant, ride: Ride, sines: CableSines, workspace: Workspace, car: Car, c: RealTangentFactors
) -> None:
    """Set row and column of the car in K of `Workspace`; car : of `complete_residual_return_car`.

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
    set_workspace_tangent_row_of_car(now, ride, sines, workspace, car, c)
    if ride.mode == HAULED:
        for i in range(n):
            K[i, last] = -c2 * car.tx * at_mass.inertia.f[i]
            K[n + i, last] = -c2 * car.ty * at_mass.inertia.f[i]
        K[last, last] = -c2
    elif c1 + c2 != 0.0:
        h = STEP / (c1 + c2)
        R = np.zeros((2, n))
        moved = mass_terms_at(sines, (at_mass.s_o, at_mass.ds_o + h * c1, at_mass.dds_o + h * c2))
        other = add_inertia_and_car_force_return_car(inputs_of_car(moved, ride, sines, workspace), R)
        K[last, last] = (other.defect - car.defect) / h
        for a in range(2):
            for i in range(n):
                K[a * n + i, last] = (R[a, i] + workspace.internal[a, i] - workspace.r[a * n + i]) / h


@compiled
def car_by_slopes_without_thrust(loads: CarLoads, sines: CableSines, kinematics: Kinematics, state: Array) -> Car:
    """The car at a state, rows q, v, a, by the slopes of the basis and without thrust."""
    coefficients = coefficients_of_state(state, sines.left.size + 1)
    at_mass = mass_terms_at(sines, kinematics)
    velocity, p, slopes = car_velocity_acceleration_and_slopes(at_mass, coefficients, sines.cable.sigma)
    return compiled_car_from_motion(loads, 0.0, velocity, p, slopes)


@inner
def update_history_return_ride(
    ride: Ride | None, history: CarHistory | None, rule: Array, i: int, car: Car
) -> Ride | None:
    """The `Ride` of step i; the velocity of a free car, `car` at the start of the step, is added to its history."""
    if ride is None or history is None or history.t.size == 0 or ride.mode == HAULED:
        return ride
    past = history.past
    newest = past.shape[0] - history.t.size + i
    past[newest, 0] = history.t[i] - rule[0, 4] * rule[0, 1]
    past[newest, 1] = car.vx
    past[newest, 2] = car.vy
    mean = mean_acceleration_and_rate(past, int(history.mean_acceleration[0]), newest, history.window)
    for k in range(6):
        history.mean_acceleration[k] = mean[k]
    return ride_at_time(ride, history.mean_acceleration, history.t[i], history.thrust[i])


@inner
def car_at_step_end(
    ride: Ride | None,
    history: CarHistory | None,
    sines: CableSines,
    kinematics: Array,
    rule: Array,
    i: int,
    end_state: Array,
) -> Car:
    """The car at the end of step i; a hauled one where the step is balanced."""
    if ride is None or history is None or history.t.size == 0:
        return NO_CAR
    if ride.mode == HAULED:
        return car_by_slopes_without_thrust(ride.loads, sines, kinematics_in_row(kinematics, i), end_state)
    t = history.t[i] + (1.0 - rule[0, 4]) * rule[0, 1]
    loads = ride_at_time(ride, history.mean_acceleration, t, 0.0).loads
    return car_by_slopes_without_thrust(loads, sines, kinematics_of_free_car(end_state), end_state)


@inner
def ride_at_time(ride: Ride, mean_acceleration: Array, t: float, thrust: float) -> Ride:
    """`Ride` at t, with the mean acceleration, (6,) of `MeanAcceleration`, extrapolated to t."""
    d = t - mean_acceleration[1]
    loads = ride.loads
    ax = mean_acceleration[2] + d * mean_acceleration[4]
    ay = mean_acceleration[3] + d * mean_acceleration[5]
    loads = CarLoads(loads.mu, loads.sigma, loads.drag, loads.wind, loads.hold, loads.friction, loads.brake, ax, ay)
    return Ride(ride.mode, loads, thrust)


@inner
def has_event(ride: Ride | None, history: CarHistory | None, end_state: Array, car: Car) -> bool:
    """Whether a step with this end state, and car there, passes an event of the `CarHistory`."""
    if ride is None or history is None or history.t.size == 0:
        return False
    if not (history.lifted_off or max(car.pressing, car.normal) > 0.0):
        return True
    if ride.mode == HAULED:
        return False
    s_o, ds_o, _ = kinematics_of_free_car(end_state)
    leaves = not history.low < s_o < history.high
    turns = history.sign != 0.0 and not history.sign * ds_o > 0.0
    slow = not history.forward * car.speed > history.slow
    return leaves or turns or slow
