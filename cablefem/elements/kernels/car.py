"""A car that rolls: its place is one more coordinate of the cable's Lagrangian, and a border of the banded tangent."""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import add_stiffness, at_rest, bend_at_rest, slopes
from cablefem.elements.kernels.banded import copy, dot, factorise, solve, subtract
from cablefem.elements.kernels.law import ELASTIC, pull, tension

FREE, HAUL, HELD = 0, 1, 2


class Car(NamedTuple):
    """The car at an instant, and what drives it.  `mode` FREE: the last unknown is s_o; HELD: it stays; HAUL: its
    acceleration is the force F of the rope along the mean tangent, and s_o, ds_o, dds_o are those given here.
    """

    mode: int
    node: int  # its scalar unknown
    mu: float
    sigma: float  # of its weight
    s_o: float
    ds: float
    dds: float
    hold: float  # force along the cable between cable and car: what is left of the one at the start
    thrust: float  # from outside, along the mean tangent
    drag: float  # k
    wind: float  # along x
    friction: float  # mu_r
    brake: float
    heading: float  # +1, -1: friction and brake act against it; 0: they do not act


class Rolling(NamedTuple):
    """What a car that rolls adds to the tangent: a border, column and row of the last unknown, and their solution."""

    n_left: int  # elements left of the car
    inertia: Any  # as `Mesh.tab`, at the points of the inertia
    ends: Any  # (2, n_loc) slopes d/dxi of the functions of the last element behind the car, the first ahead
    border: Any  # (3, n) column, row, and the column solved
    corner: Any  # (1,)


@compiled
def driven(car, now):
    """Return a car as a plain tuple with what an instant brings (3,): hauled s_o, ds_o, dds_o, else hold and thrust."""
    mode, node, mu, sigma, s_o, ds, dds, hold, thrust, drag, wind, friction, brake, heading = car
    if mode == HAUL:
        s_o, ds, dds = now[0], now[1], now[2]
    else:
        hold, thrust = now[0], now[1]
    return mode, node, mu, sigma, s_o, ds, dds, hold, thrust, drag, wind, friction, brake, heading


@compiled
def car_forces(car, tau, stretch, px, py, fx, fy):
    """Return F_ext (2,) without the rope, the normal force n . C (positive: the car presses on the cable) and F_drive.

    tau : unit mean tangent (2,); stretch : mean |r'|; p : velocity; f : mu (p.. - sigma j).  n = (-tau_y, tau_x) points
    down, and C = f - F_ext is the cable's force on the car.
    """
    ux, uy = px - car.wind, py
    drag = -car.drag * math.sqrt(ux * ux + uy * uy)
    ex, ey = drag * ux + car.thrust * tau[0], drag * uy + car.thrust * tau[1]
    normal = (fx - ex) * tau[1] - (fy - ey) * tau[0]
    along = -car.heading * (car.friction * abs(normal) + car.brake)
    return ex, ey, normal, car.hold + stretch * along


@compiled
def motion(car, xp, yp, xpp, ypp, ds, dds, v, a):
    """Return p. and mu (p.. - sigma j), p = X(s_o) + w of the car's node."""
    m = car.node
    px, py = v[2 * m] + xp * ds, v[2 * m + 1] + yp * ds
    fx = car.mu * (a[2 * m] + xp * dds + xpp * ds * ds)
    fy = car.mu * (a[2 * m + 1] + yp * dds + ypp * ds * ds - car.sigma)
    return px, py, fx, fy


@compiled
def mean_tangent(dofs, ends, n_left, s_o, xp, yp, q):
    """Return the unit tangent along the mean of the slopes r' behind and ahead of the car, and the mean of |r'|."""
    mx, my, stretch = 0.0, 0.0, 0.0
    for side in range(2):
        e, h = (n_left - 1, s_o) if side == 0 else (n_left, 1.0 - s_o)
        x, y = xp, yp
        for k in range(dofs.shape[1]):
            d = dofs[e, k]
            if d >= 0:
                x += ends[side, k] * q[2 * d] / h
                y += ends[side, k] * q[2 * d + 1] / h
        mx, my, stretch = mx + 0.5 * x, my + 0.5 * y, stretch + 0.5 * math.sqrt(x * x + y * y)
    size = math.sqrt(mx * mx + my * my)
    return (mx / size, my / size), stretch


@compiled
def roll(mesh, rolling, cable, car, q, v, a, r, ab, c0, c1, c2):
    """Set the residual of the cable with a car that rolls and, unless c0, c1, c2 vanish, its bordered tangent.

    Return the least mean tension of an element and its s, the left side of the row of s_o, the normal force with which
    the car presses on the cable, and the mean |r'| at the car.

    With z = dq/dt phi - c q phi', the velocity of the cable at fixed s, the discrete Lagrangian of (q, s_o) is

        L = sum over sides of h int ( z^2/2 - D ) dxi + mu |p.|^2/2 + mu sigma p_y,  D = W - T X'.w',

    p = X(s_o) + w_m, c = ds_o chi, chi = xi on the left and 1 - xi on the right; s = s_o xi or s_o + h xi, w' = q
    phi_,xi/h.  The rows are Lagrange's equations, the last one that of s_o, with the force F_ext on p and F_drive on
    s_o.  The tangent leaves out what is small: the turning of the mean tangent, and parts of the derivative of the last
    row by s_o itself.
    """
    dofs, tab, fine = mesh.dofs, mesh.tab, rolling.inertia
    n_el, n_loc = dofs.shape
    alpha, law = cable[0], cable[3]
    band = (ab.shape[1] - 1) // 3
    n, m = q.size - 1, car.node
    s_o, ds, dds = (car.s_o, car.ds, car.dds) if car.mode == HAUL else (q[n], v[n], a[n])
    r[:] = 0.0
    tangent = c0 != 0.0 or c1 != 0.0 or c2 != 0.0
    if tangent:
        ab[:] = 0.0
        rolling.border[:] = 0.0
    if not 0.0 < s_o < 1.0:
        r[:] = math.nan  # the norm will tell
        return math.inf, s_o, math.nan, math.nan, math.nan
    column, row = rolling.border[0], rolling.border[1]
    of_s, corner = 0.0, 0.0
    least, where = math.inf, 0.0
    z_of, zt_of = np.empty(n_loc), np.empty(n_loc)
    for e in range(n_el):
        left = e < rolling.n_left
        s_0, h, sign = (0.0, s_o, 1.0) if left else (s_o, 1.0 - s_o, -1.0)
        total, length = 0.0, 0.0
        for g in range(tab.shape[1]):  # the cable's forces
            xi, weight = tab[e, g, 0], tab[e, g, 1]
            chi = xi if left else 1.0 - xi
            s = s_0 + h * xi
            xp, yp, T = at_rest(cable, s)
            xpp, ypp = bend_at_rest(cable, yp, T)
            T_s = -cable[1] * yp
            du, dv = slopes(dofs, tab, q, e, g)
            du, dv = du / h, dv / h
            rx, ry = xp + du, yp + dv
            fx, fy, k_geo, k_mat, N, W, eps = pull(xp, yp, T, du, dv, alpha, law)
            total += weight * tension(eps, T, alpha, ELASTIC)[0]
            length += weight
            # D and its derivative by s at fixed w'; W depends on s through T and |X' + w'|
            D = W - T * (xp * du + yp * dv)
            bend = rx * xpp + ry * ypp
            D_s = (N - T) / alpha * T_s + k_geo * bend - T_s * (xp * du + yp * dv) - T * (xpp * du + ypp * dv)
            of_s += weight * (sign * (D - fx * du - fy * dv) + h * chi * D_s)
            if tangent:  # what f gains with s_o at fixed q
                yx, yy = chi * xpp - sign / h * du, chi * ypp - sign / h * dv
                along = k_mat * (rx * yx + ry * yy) + (0.0 if N == 0.0 else chi * T_s / (1.0 + eps))
                f_sx = c0 * (k_geo * yx + along * rx - chi * (T_s * xp + T * xpp))
                f_sy = c0 * (k_geo * yy + along * ry - chi * (T_s * yp + T * ypp))
                corner += weight * c0 * h * (k_geo * (yx * yx + yy * yy) + k_mat * (rx * yx + ry * yy) ** 2)
                j11 = c0 / h * (k_geo + k_mat * rx * rx)
                j12 = c0 / h * k_mat * rx * ry
                j22 = c0 / h * (k_geo + k_mat * ry * ry)
            for i in range(n_loc):
                d = dofs[e, i]
                if d < 0:
                    continue
                grad = weight * tab[e, g, 2 + n_loc + i]
                r[2 * d] += grad * fx
                r[2 * d + 1] += grad * fy
                if tangent:
                    column[2 * d] += grad * f_sx
                    column[2 * d + 1] += grad * f_sy
                    row[2 * d] += grad * f_sx
                    row[2 * d + 1] += grad * f_sy
                    add_stiffness(dofs, tab, e, g, d, grad, j11, j12, j22, ab)
        for g in range(fine.shape[1]):  # its inertia
            xi, weight = fine[e, g, 0], fine[e, g, 1]
            chi = xi if left else 1.0 - xi
            ux, uy, vx, vy, dvx, dvy, ax, ay = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, grad = fine[e, g, 2 + k], fine[e, g, 2 + n_loc + k]
                    ux += grad * q[2 * d]
                    uy += grad * q[2 * d + 1]
                    vx += phi * v[2 * d]
                    vy += phi * v[2 * d + 1]
                    dvx += grad * v[2 * d]
                    dvy += grad * v[2 * d + 1]
                    ax += phi * a[2 * d]
                    ay += phi * a[2 * d + 1]
            k_s = chi / h  # dz/dds_o = -k_s q_,xi
            k_t = k_s * (dds - sign * ds * ds / h)
            zx, zy = vx - ds * k_s * ux, vy - ds * k_s * uy
            ztx, zty = ax - k_t * ux - ds * k_s * dvx, ay - k_t * uy - ds * k_s * dvy
            of_s -= weight * (
                chi * (dvx * zx + dvy * zy + ux * ztx + uy * zty)
                + sign * (0.5 * (zx * zx + zy * zy) + ds * k_s * (ux * zx + uy * zy))
            )  # fmt: skip
            gx, gy = sign * ds * zx + h * ztx, sign * ds * zy + h * zty
            hx, hy = ds * chi * zx, ds * chi * zy
            for i in range(n_loc):
                d = dofs[e, i]
                if d >= 0:
                    phi, grad = weight * fine[e, g, 2 + i], weight * fine[e, g, 2 + n_loc + i]
                    r[2 * d] += phi * gx + grad * hx
                    r[2 * d + 1] += phi * gy + grad * hy
            if not tangent:
                continue
            # what z and dz/dt gain with s_o, ds_o, dds_o at fixed q
            k_1 = sign * k_s / h
            z_x, z_y = (c0 * ds * k_1 - c1 * k_s) * ux, (c0 * ds * k_1 - c1 * k_s) * uy
            by_u = c1 * 2.0 * ds * k_1 - c2 * k_s - c0 * (ds * ds * k_s / (h * h) - k_1 * (dds - sign * ds * ds / h))
            by_du = c0 * ds * k_1 - c1 * k_s
            zt_x, zt_y = by_u * ux + by_du * dvx, by_u * uy + by_du * dvy
            corner -= weight * (
                chi * (dvx * z_x + dvy * z_y + ux * zt_x + uy * zt_y)
                + sign * (zx * z_x + zy * z_y + ds * k_s * (ux * z_x + uy * z_y) + c1 * k_s * (ux * zx + uy * zy))
            )  # fmt: skip
            g_x = sign * (c1 * zx + ds * z_x + c0 * ztx) + h * zt_x
            g_y = sign * (c1 * zy + ds * z_y + c0 * zty) + h * zt_y
            h_x, h_y = chi * (c1 * zx + ds * z_x), chi * (c1 * zy + ds * z_y)
            k_q = c0 * k_t + c1 * ds * k_s
            for i in range(n_loc):
                phi, grad = fine[e, g, 2 + i], fine[e, g, 2 + n_loc + i]
                z_of[i], zt_of[i] = c1 * phi - c0 * ds * k_s * grad, c2 * phi - k_q * grad
            for i in range(n_loc):
                d = dofs[e, i]
                if d < 0:
                    continue
                phi, grad = weight * fine[e, g, 2 + i], weight * fine[e, g, 2 + n_loc + i]
                column[2 * d] += phi * g_x + grad * h_x
                column[2 * d + 1] += phi * g_y + grad * h_y
                by_z, by_zt, by_grad = weight * z_of[i], weight * chi * zt_of[i], chi * c1 + sign * ds * k_s * c0
                row[2 * d] -= (
                    grad * (c0 * chi * ztx + by_grad * zx) + by_zt * ux
                    + by_z * (chi * dvx + sign * (zx + ds * k_s * ux))
                )  # fmt: skip
                row[2 * d + 1] -= (
                    grad * (c0 * chi * zty + by_grad * zy) + by_zt * uy
                    + by_z * (chi * dvy + sign * (zy + ds * k_s * uy))
                )  # fmt: skip
                of_z, of_zt = phi * sign * ds + grad * ds * chi, phi * h
                for j in range(n_loc):
                    d_j = dofs[e, j]
                    if d_j < 0:
                        continue
                    same = of_z * z_of[j] + of_zt * zt_of[j]
                    at = band + 2 * (d_j - d)
                    ab[2 * d, at] += same
                    ab[2 * d + 1, at] += same
        if least * length > total:
            least, where = total / length, s_0 + 0.5 * h * (tab[e, 0, 0] + tab[e, -1, 0])

    xp, yp, T = at_rest(cable, s_o)
    xpp, ypp = bend_at_rest(cable, yp, T)
    px, py, fx, fy = motion(car, xp, yp, xpp, ypp, ds, dds, v, a)
    tau, stretch = mean_tangent(dofs, rolling.ends, rolling.n_left, s_o, xp, yp, q)
    ex, ey, normal, drive = car_forces(car, tau, stretch, px, py, fx, fy)
    if car.mode == HAUL:
        ex, ey = ex + a[n] * tau[0], ey + a[n] * tau[1]
    r[2 * m] += fx - ex
    r[2 * m + 1] += fy - ey
    of_s += xp * (fx - ex) + yp * (fy - ey) - drive
    r[n] = car.mu * a[n] if car.mode == HELD else of_s
    if not tangent:
        return least, where, of_s, normal, stretch

    at = band
    ux, uy = px - car.wind, py
    size = math.sqrt(ux * ux + uy * uy)
    d11, d12, d22 = 0.0, 0.0, 0.0  # drag by velocity
    if size > 0.0:
        d11, d12, d22 = (
            car.drag * (size + ux * ux / size),
            car.drag * ux * uy / size,
            car.drag * (size + uy * uy / size),
        )
    ab[2 * m, at] += c2 * car.mu + c1 * d11
    ab[2 * m, at + 1] += c1 * d12
    ab[2 * m + 1, at - 1] += c1 * d12
    ab[2 * m + 1, at] += c2 * car.mu + c1 * d22
    # friction follows the normal force, and that the accelerations
    rub = stretch * car.heading * car.friction * (1.0 if normal > 0.0 else -1.0) * car.mu * c2
    row[2 * m] += c2 * car.mu * xp + c1 * (d11 * xp + d12 * yp) + rub * tau[1]
    row[2 * m + 1] += c2 * car.mu * yp + c1 * (d12 * xp + d22 * yp) - rub * tau[0]
    if car.mode == FREE:
        column[2 * m] += car.mu * (c2 * xp + (c1 * 2.0 * ds + c0 * dds) * xpp) + c1 * (d11 * xp + d12 * yp)
        column[2 * m + 1] += car.mu * (c2 * yp + (c1 * 2.0 * ds + c0 * dds) * ypp) + c1 * (d12 * xp + d22 * yp)
        corner += c2 * car.mu + c1 * (d11 * xp * xp + 2.0 * d12 * xp * yp + d22 * yp * yp)
        corner += rub * (xp * tau[1] - yp * tau[0]) + c0 * (xpp * (fx - ex) + ypp * (fy - ey))
    else:
        column[:] = 0.0
        if car.mode == HAUL:
            column[2 * m], column[2 * m + 1] = -c2 * tau[0], -c2 * tau[1]
            corner = -c2 * (xp * tau[0] + yp * tau[1])
        else:
            row[:] = 0.0
            corner = c2 * car.mu
    rolling.corner[0] = corner
    return least, where, of_s, normal, stretch


@compiled
def look(dofs, ends, n_left, cable, car, q, v, a):
    """Return the normal force with which the car presses on the cable, mean |r'|, and p. along the mean tangent.

    And the force of weight, thrust and drag along it, of weight across it, F_ext and the force on s_o.
    """
    car = Car(*car)  # a plain tuple, as in `settle`
    n = q.size - 1
    s_o, ds, dds = (car.s_o, car.ds, car.dds) if car.mode == HAUL else (q[n], v[n], a[n])
    xp, yp, T = at_rest(cable, s_o)
    xpp, ypp = bend_at_rest(cable, yp, T)
    px, py, fx, fy = motion(car, xp, yp, xpp, ypp, ds, dds, v, a)
    tau, stretch = mean_tangent(dofs, ends, n_left, s_o, xp, yp, q)
    ex, ey, normal, drive = car_forces(car, tau, stretch, px, py, fx, fy)
    weight = car.mu * car.sigma
    along = ex * tau[0] + (ey + weight) * tau[1]
    return normal, stretch, px * tau[0] + py * tau[1], along, weight * tau[0], ex, ey, xp * ex + yp * ey + drive


@compiled
def under_way(course, dofs, rolling, cable, car, q, v, a):
    """Return whether nothing has happened to a car yet, so that its next step is like the one before.

    course : (6,) the places between which it has to stay, the signs of ds_o and of its speed that it has to keep (0:
        any), its least speed, and the least force by which it presses on the cable; empty: nothing is looked for here.
    """
    if course.size == 0:
        return True
    s_o, slip = q[q.size - 1], v[q.size - 1]
    if not course[0] < s_o < course[1] or (course[2] != 0.0 and not course[2] * slip > 0.0):
        return False
    seen = look(dofs, rolling.ends, rolling.n_left, cable, car, q, v, a)
    return (course[3] == 0.0 or course[3] * seen[2] > course[4]) and seen[0] > course[5]


@compiled
def kinetic(dofs, tab, n_left, node, mu, cable, q, v, w, momentum, gradient):
    """Set M(q) v and the gradient by q of v . M(q) w / 2 at fixed v and w, cable and car; all (n + 1,), s_o last."""
    n_el, n_loc = dofs.shape
    n = q.size - 1
    s_o, dv, dw = q[n], v[n], w[n]
    momentum[:] = 0.0
    gradient[:] = 0.0
    u, z, y = np.empty(2), np.empty(2), np.empty(2)
    for e in range(n_el):
        left = e < n_left
        h, sign = (s_o, 1.0) if left else (1.0 - s_o, -1.0)
        for g in range(tab.shape[1]):
            xi, weight = tab[e, g, 0], tab[e, g, 1]
            chi = xi if left else 1.0 - xi
            u[:] = 0.0
            z[:] = 0.0
            y[:] = 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, grad = tab[e, g, 2 + k], tab[e, g, 2 + n_loc + k]
                    for i in range(2):
                        u[i] += grad * q[2 * d + i]
                        z[i] += phi * v[2 * d + i] - dv * chi / h * grad * q[2 * d + i]
                        y[i] += phi * w[2 * d + i] - dw * chi / h * grad * q[2 * d + i]
            for i in range(2):  # velocities z, y at fixed s
                momentum[n] -= weight * chi * u[i] * z[i]
                gradient[n] += 0.5 * weight * sign * (z[i] * y[i] + chi / h * u[i] * (dv * y[i] + dw * z[i]))
                for k in range(n_loc):
                    d = dofs[e, k]
                    if d >= 0:
                        momentum[2 * d + i] += weight * h * tab[e, g, 2 + k] * z[i]
                        gradient[2 * d + i] -= 0.5 * weight * chi * tab[e, g, 2 + n_loc + k] * (dv * y[i] + dw * z[i])
    xp, yp, T = at_rest(cable, s_o)
    slope, bend = (xp, yp), bend_at_rest(cable, yp, T)
    for i in range(2):
        pv, pw = v[2 * node + i] + slope[i] * dv, w[2 * node + i] + slope[i] * dw
        momentum[2 * node + i] += mu * pv
        momentum[n] += mu * slope[i] * pv
        gradient[n] += 0.5 * mu * bend[i] * (dv * pw + dw * pv)


@compiled
def factorise_bordered(work, rolling):
    """Factorise the banded tangent and its border; return whether it is regular."""
    column, row, solved = rolling.border[0], rolling.border[1], rolling.border[2]
    regular = factorise(work.ab, work.pivots, True)
    if regular:
        copy(column, solved)
        solve(work.ab, work.pivots, solved)
        rolling.corner[0] -= dot(row, solved)
    return regular and rolling.corner[0] != 0.0


@compiled
def solve_bordered(work, rolling, b):
    """Overwrite b (n + 1,) with the solution for the matrix that `factorise_bordered` has left."""
    x = b[:-1]
    solve(work.ab, work.pivots, x)
    last = (b[-1] - dot(rolling.border[1], x)) / rolling.corner[0]
    subtract(last, rolling.border[2], x)
    b[-1] = last
