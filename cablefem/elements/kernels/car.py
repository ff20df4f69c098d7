"""The row of a car that rolls: Lagrange's equation of its position s_o, the last unknown.

The discrete Lagrangian of (q, s_o) is

    L = sum over sides of h int ( w.^2/2 - D ) dxi + mu |p.|^2/2 + mu sigma p_y,  D = W - T X'.w',

with w. = dq/dt phi - c q phi', c = ds_o chi, w' = q phi,xi / h and the car's place p = X(s_o) + w.
Forces F_ext on p and F_drive on s_o act, too.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import compiled, inner
from cablefem.elements.kernels.balance import (
    Cable,
    Factors,
    Instant,
    Mesh,
    assemble_cable,
    is_tangent_required,
    set_mass_damping_stiffness_bands,
    side_begin_and_length,
    static_slope_and_tension_over_H,
)
from cablefem.elements.kernels.banded import Tangent, dot, set_banded_product
from cablefem.elements.kernels.law import force_at_point
from cablefem.newmark import Array

FREE = 0
HAUL = 1
HELD = 2


class Car(NamedTuple):
    """A car between two events.

    `mode` FREE: s_o is unknown.  HELD: ds_o is constant.  HAUL: see `rolling`.
    What drives it at an instant, `drive_inputs` (3,): hauled s_o, ds_o, dds_o; else the force along the cable that
    still holds it, the outer force along the mean tangent, and 0.
    """

    mode: int
    node: int  # scalar unknown
    mu: float
    sigma: float
    drag: float  # k
    wind: float  # along x
    friction: float  # mu_r
    brake: float
    heading: float  # sign of the slip against which friction and brake act; 0: none


class CarOnMesh(NamedTuple):
    car: Car
    slopes: Any  # (2, n_loc) shape d/dxi behind and ahead
    bounds: Any  # see `car_has_had_no_event`


class ForcesOnCar(NamedTuple):
    s_o: float
    ds: float
    dds: float
    slope: tuple  # (2,) X' at the car
    bend: tuple  # (2,) X''
    tau: tuple  # (2,) unit mean tangent
    stretch: float  # mean |r'| of both sides
    velocity: tuple  # (2,) p.
    inertia: tuple  # (2,) f = mu (p.. - sigma j)
    outside: tuple  # (2,) F_ext without the rope
    normal: float  # n . (f - F_ext), n = (-tau_y, tau_x) downwards
    drive: float  # F_drive on s_o


class CarBalance(NamedTuple):
    min_tension: float  # see `balance.MinTension`
    min_at: float
    row: float  # left side of the row of s_o
    normal: float  # force between car and cable


@inner
def mean_tangent_and_stretch(
    mesh: Mesh, slopes: Array, s_o: float, xp: float, yp: float, q: Array
) -> tuple[tuple[float, float], float]:
    """Return the unit vector along the mean r' of both sides of the car, and the mean |r'|; (xp, yp) : X' there."""
    mx = 0.0
    my = 0.0
    stretch = 0.0
    for side in range(2):
        e, h = (mesh.n_left - 1, s_o) if side == 0 else (mesh.n_left, 1.0 - s_o)
        x = xp
        y = yp
        for k in range(mesh.dofs.shape[1]):
            d = mesh.dofs[e, k]
            if d >= 0:
                x += slopes[side, k] * q[2 * d] / h
                y += slopes[side, k] * q[2 * d + 1] / h
        mx = mx + 0.5 * x
        my = my + 0.5 * y
        stretch = stretch + 0.5 * math.sqrt(x * x + y * y)
    size = math.sqrt(mx * mx + my * my)
    return (mx / size, my / size), stretch


@compiled
def forces_on_car(cable: Cable, car: Car, drive_inputs: Array, slopes: Array, x: Array) -> ForcesOnCar:
    """Forces at x, rows q, v, a;  drive_inputs : see `Car`;  slopes : see `CarOnMesh`."""
    q = x[0]
    v = x[1]
    a = x[2]
    n = q.size - 1
    m = 2 * car.node
    if car.mode == HAUL:
        s_o = drive_inputs[0]
        ds = drive_inputs[1]
        dds = drive_inputs[2]
        hold = 0.0
        thrust = 0.0
    else:
        s_o = q[n]
        ds = v[n]
        dds = a[n]
        hold = drive_inputs[0]
        thrust = drive_inputs[1]
    xp, yp, T = static_slope_and_tension_over_H(cable.law, s_o)
    xpp = cable.law[1] * yp / (T * T)
    ypp = -cable.law[1] / (T * T * T)
    tau, stretch = mean_tangent_and_stretch(cable.mesh, slopes, s_o, xp, yp, q)
    px = v[m] + xp * ds
    py = v[m + 1] + yp * ds
    fx = car.mu * (a[m] + xp * dds + xpp * ds * ds)
    fy = car.mu * (a[m + 1] + yp * dds + ypp * ds * ds - car.sigma)
    drag = -car.drag * math.sqrt((px - car.wind) ** 2 + py * py)
    ex = drag * (px - car.wind) + thrust * tau[0]
    ey = drag * py + thrust * tau[1]
    normal = (fx - ex) * tau[1] - (fy - ey) * tau[0]
    drive = hold - stretch * car.heading * (car.friction * abs(normal) + car.brake)
    return ForcesOnCar(
        s_o, ds, dds, (xp, yp), (xpp, ypp), tau, stretch, (px, py), (fx, fy), (ex, ey), normal, drive
    )  # fmt: skip


@compiled
def assemble_cable_and_car(
    cable: Cable, rolling_car: CarOnMesh, instant: Instant, x: Array, r: Array, tangent: Tangent, factors: Factors
) -> CarBalance:
    """Set the residual of cable and car and, unless the factors are 0, its bordered tangent.

    instant.inputs : `drive_inputs` of `Car`.  The tangent omits the turning of the mean tangent.
    """
    car = rolling_car.car
    forces = forces_on_car(cable, rolling_car.car, instant.inputs, rolling_car.slopes, x)
    n = x.shape[1] - 1
    m = 2 * car.node
    tau = forces.tau
    s_o = forces.s_o
    if not 0.0 < s_o < 1.0:
        r[:] = math.nan
        return CarBalance(math.inf, s_o, math.nan, math.nan)
    rope = x[2, n] if car.mode == HAUL else 0.0
    cx = forces.inertia[0] - forces.outside[0] - rope * tau[0]
    cy = forces.inertia[1] - forces.outside[1] - rope * tau[1]
    inputs = np.empty(5)
    inputs[0] = s_o
    inputs[1] = forces.ds
    inputs[2] = forces.dds
    inputs[3] = cx - car.mu * x[2, m]
    inputs[4] = cy - car.mu * x[2, m + 1]
    at_car = Instant(inputs, instant.bands, instant.coupling)
    set_mass_damping_stiffness_bands(cable, at_car)
    min_tension, min_at = assemble_cable(cable, at_car, x, r, tangent, factors)
    if is_tangent_required(factors):
        tangent.border[:] = 0.0
    add_strain_force_to_car_row(cable, s_o, r, tangent.border, factors[0])
    add_cable_inertia_to_car_row(cable, m, forces, x, r, tangent.border, factors)
    r[n] += forces.slope[0] * cx + forces.slope[1] * cy - forces.drive
    row = r[n]
    if car.mode == HELD:
        r[n] = car.mu * x[2, n]
    if is_tangent_required(factors):
        add_car_tangent(car, forces, (cx, cy), tangent, factors)
    return CarBalance(min_tension, min_at, row, forces.normal)


@inner
def add_strain_force_to_car_row(cable: Cable, s_o: float, r: Array, border: Array, c0: float) -> None:
    """Add what the strain of the cable gives to the row of s_o, the last one; add its tangent to the border."""
    mesh = cable.mesh
    law = cable.law
    at = cable.points
    column = border[0]
    row = border[1]
    n_q = mesh.tab.shape[1]
    n_loc = mesh.dofs.shape[1]
    alpha = law[0]
    sigma = law[1]
    total = 0.0
    for e in range(mesh.dofs.shape[0]):
        h = side_begin_and_length(mesh, s_o, e)[1]
        sign = 1.0 if e < mesh.n_left else -1.0
        for g in range(n_q):
            xi = mesh.tab[e, g, 0]
            weight = mesh.tab[e, g, 1]
            p = e * n_q + g
            chi = xi if e < mesh.n_left else 1.0 - xi
            xp, yp, T = static_slope_and_tension_over_H(law, at[0, p])
            xpp = sigma * yp / (T * T)
            ypp = -sigma / (T * T * T)
            T_s = -sigma * yp
            rx = at[1, p]
            ry = at[2, p]
            du = rx - xp
            dv = ry - yp
            f = force_at_point(xp, yp, T, du, dv, alpha, law[3])
            static = xp * du + yp * dv
            D_s = (f.N - T) / alpha * T_s + f.geometric * (rx * xpp + ry * ypp)
            D_s = D_s - T_s * static - T * (xpp * du + ypp * dv)
            total += weight * (sign * (f.energy - T * static - f.x * du - f.y * dv) + h * chi * D_s)
            if c0 == 0.0:
                continue
            yx = chi * xpp - sign / h * du
            yy = chi * ypp - sign / h * dv
            bend = f.material * (rx * yx + ry * yy)
            along = bend + (0.0 if f.N == 0.0 else chi * T_s / (1.0 + f.strain))
            f_sx = c0 * (f.geometric * yx + along * rx - chi * (T_s * xp + T * xpp))
            f_sy = c0 * (f.geometric * yy + along * ry - chi * (T_s * yp + T * ypp))
            column[-1] += weight * c0 * h * (f.geometric * (yx * yx + yy * yy) + bend * (rx * yx + ry * yy))
            for i in range(n_loc):
                d = mesh.dofs[e, i]
                if d >= 0:
                    grad = weight * mesh.tab[e, g, 2 + n_loc + i]
                    column[2 * d] += grad * f_sx
                    column[2 * d + 1] += grad * f_sy
                    row[2 * d] += grad * f_sx
                    row[2 * d + 1] += grad * f_sy
    r[-1] += total


@inner
def add_cable_inertia_to_car_row(
    cable: Cable, node: int, forces: ForcesOnCar, x: Array, r: Array, border: Array, factors: Factors
) -> None:
    """Add what inertia and damping of the cable give to the row of s_o; add their tangent to the border.

    node : number of the first unknown at the car.
    """
    operators = cable.operators
    n = operators.shape[2]
    c_d = cable.damping
    ds = forces.ds
    dds = forces.dds + c_d * forces.ds
    c0 = factors[0]
    c1 = factors[1]
    c2 = factors[2] + c_d * factors[1]
    q = x[0]
    v = x[1]
    column = border[0]
    row = border[1]
    y = np.empty((10, n))
    total = 0.0
    corner = 0.0
    Mv = y[0]
    Gq = y[1]
    Gv = y[2]
    Hq = y[3]
    terms = y[4]
    Ma = y[5]
    GTv = y[6]
    GTa = y[7]
    Hv = y[8]
    a = y[9]
    for i in range(n):
        a[i] = x[2, i] + c_d * v[i]
    for side in range(2):
        h, sign = (forces.s_o, 1.0) if side == 0 else (1.0 - forces.s_o, -1.0)
        flow = ds / h
        speed_up = dds / h
        rows = (0, node + 2) if side == 0 else (node, n)
        M = operators[side]
        G = operators[2 + side]
        GT = operators[4 + side]
        H = operators[6 + side]
        set_banded_product(M, rows, v, Mv)
        set_banded_product(G, rows, q, Gq)
        set_banded_product(G, rows, v, Gv)
        set_banded_product(H, rows, q, Hq)
        for i in range(rows[0], rows[1]):
            of_H = (speed_up - 0.5 * sign * flow * flow) * q[i] + 2.0 * flow * v[i]
            terms[i] = of_H * Hq[i] - 0.5 * sign * v[i] * Mv[i] - a[i] * Gq[i] - v[i] * Gv[i]
        for i in range(rows[0], rows[1]):
            total += terms[i]
        if not is_tangent_required(factors):
            continue
        set_banded_product(M, rows, a, Ma)
        set_banded_product(GT, rows, v, GTv)
        set_banded_product(GT, rows, a, GTa)
        set_banded_product(H, rows, v, Hv)
        qHq = dot(Hq, q)
        qHv = dot(Hq, v)
        corner += c0 * (flow * flow / h * qHq - sign / h * (speed_up * qHq + 2.0 * flow * qHv))
        corner += (c1 * (2.0 * qHv - sign * flow * qHq) + c2 * qHq) / h
        for i in range(rows[0], rows[1]):
            by_v = sign * Mv[i] - Gv[i] - 2.0 * flow * Hq[i]
            column[i] += c0 * sign * (Ma[i] + flow * flow * Hq[i]) + c1 * (by_v + GTv[i]) - c2 * Gq[i]
            by_q = (2.0 * speed_up - sign * flow * flow) * Hq[i] + 2.0 * flow * Hv[i] - GTa[i]
            row[i] += c0 * by_q - c1 * (sign * Mv[i] + Gv[i] + GTv[i] - 2.0 * flow * Hq[i]) - c2 * Gq[i]
    if is_tangent_required(factors):
        column[n] += corner
    r[-1] += total


@inner
def add_car_tangent(
    car: Car, forces: ForcesOnCar, contact_force: tuple[float, float], tangent: Tangent, factors: Factors
) -> None:
    """Add what the forces on the car give to the tangent; contact_force : of the car on the cable, before friction."""
    ab, border = tangent
    m = 2 * car.node
    c0, c1, c2 = factors
    at = ab.shape[1] // 2
    xp, yp = forces.slope
    xpp, ypp = forces.bend
    tau = forces.tau
    column = border[0]
    row = border[1]
    ux = forces.velocity[0] - car.wind
    uy = forces.velocity[1]
    size = math.sqrt(ux * ux + uy * uy)
    per = car.drag / size if size > 0.0 else 0.0
    d11 = c1 * per * (size * size + ux * ux)
    d12 = c1 * per * ux * uy
    d22 = c1 * per * (size * size + uy * uy)
    ab[m, at] += d11
    ab[m, at + 1] += d12
    ab[m + 1, at - 1] += d12
    ab[m + 1, at] += d22
    dx = d11 * xp + d12 * yp
    dy = d12 * xp + d22 * yp
    side = 1.0 if forces.normal > 0.0 else -1.0
    friction = forces.stretch * car.heading * car.friction * side * car.mu * c2
    row[m] += c2 * car.mu * xp + dx + friction * tau[1]
    row[m + 1] += c2 * car.mu * yp + dy - friction * tau[0]
    if car.mode == FREE:
        by_s = car.mu * (c1 * 2.0 * forces.ds + c0 * forces.dds)
        column[m] += car.mu * c2 * xp + by_s * xpp + dx
        column[m + 1] += car.mu * c2 * yp + by_s * ypp + dy
        column[-1] += c2 * car.mu + dx * xp + dy * yp
        column[-1] += friction * (xp * tau[1] - yp * tau[0]) + c0 * (xpp * contact_force[0] + ypp * contact_force[1])
        return
    column[:] = 0.0
    if car.mode == HAUL:
        column[m] = -c2 * tau[0]
        column[m + 1] = -c2 * tau[1]
        column[-1] = -c2 * (xp * tau[0] + yp * tau[1])
    else:
        row[:] = 0.0
        column[-1] = c2 * car.mu


@inner
def car_has_had_no_event(cable: Cable, rolling_car: CarOnMesh | None, drive_inputs: Array, x: Array) -> bool:
    """Return whether a car at x has had no event; True without a car.

    rolling_car.bounds : (6,) or empty: bounds of s_o, signs of ds_o and of speed (0: any), smallest speed and normal
        force.
    """
    if rolling_car is None:
        return True
    bounds = rolling_car.bounds
    if bounds.size == 0:
        return True
    s_o = x[0, -1]
    slip = x[1, -1]
    if not bounds[0] < s_o < bounds[1] or (bounds[2] != 0.0 and not bounds[2] * slip > 0.0):
        return False
    forces = forces_on_car(cable, rolling_car.car, drive_inputs, rolling_car.slopes, x)
    speed = forces.velocity[0] * forces.tau[0] + forces.velocity[1] * forces.tau[1]
    return (bounds[3] == 0.0 or bounds[3] * speed > bounds[4]) and forces.normal > bounds[5]
