"""Compiled rows of `segments` and `bodies`, and their tangent as a bordered band."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.compiled import compiling_decorator
from cablefem.newmark import Array

compiled, inner = compiling_decorator(__file__), compiling_decorator(__file__, inner=True)
INPUTS = 12  # of `car_forces`, see `bodies`


class Mesh(NamedTuple):
    """Equal elements of a segment."""

    phi: Array  # (points, n_loc)
    phi_xi: Array
    weights: Array  # (points,)
    xi: Array  # (elements, points)
    dofs: NDArray[np.int64]  # (elements, n_loc)
    ends: Array  # (2, nn) slopes at both ends


class Rope(NamedTuple):
    rho: float
    q: float


class Cars(NamedTuple):
    """Cars on one contact each; arrays (m,) unless stated."""

    contacts: NDArray[np.int64]
    forces: NDArray[np.int64]  # slots of F/M, or -1
    swings: NDArray[np.int64]  # slots of phi, or -1
    gravity: float
    data: Array  # (1 or instants, m, 12) the first twelve of `bodies.Cars`


class Border(NamedTuple):
    """A bordered band, see `bordered.Bordered`."""

    ab: Array
    columns: Array
    rows: Array
    corner: Array


@inner
def add(m, i, j, value):
    n = m.ab.shape[1]
    b = (m.ab.shape[0] - 1) // 3
    if i < n and j < n:
        m.ab[2 * b + i - j, j] += value
    elif i < n:
        m.columns[i, j - n] += value
    elif j < n:
        m.rows[i - n, j] += value
    else:
        m.corner[i - n, j - n] += value


@inner
def interpolate(mesh, q, v, a, first, e, g, f):
    """Fill f (10,) with r, r_xi, v, v_xi, a at point g of element e; first : slot of the segment's first node."""
    f[:] = 0.0
    for i in range(mesh.dofs.shape[1]):
        slot = first + 2 * mesh.dofs[e, i]
        for x in range(2):
            f[x] += mesh.phi[g, i] * q[slot + x]
            f[2 + x] += mesh.phi_xi[g, i] * q[slot + x]
            f[4 + x] += mesh.phi[g, i] * v[slot + x]
            f[6 + x] += mesh.phi_xi[g, i] * v[slot + x]
            f[8 + x] += mesh.phi[g, i] * a[slot + x]


@compiled
def add_rows_and_set_loads(mesh, rope, law, cars, q, v, a, rows, loads_and_min_tension):
    """Add the rows of all segments and cars at n instants to rows (n, size).

    q, v, a : (n, size) of all coordinates; law : (3, K, G) EA, N_r, W_r.
    loads_and_min_tension : (n, m + 1), is set: loads of the m cars, then the smallest tension.
    """
    for i in range(rows.shape[0]):
        loads_and_min_tension[i, -1] = add_segments(mesh, rope, law, q[i], v[i], a[i], rows[i])
        add_cars_and_set_loads(mesh, law.shape[1], cars, i, q[i], v[i], a[i], rows[i], loads_and_min_tension[i])


@inner
def add_segments(mesh, rope, law, q, v, a, rows):
    """Add the rows of the segments to rows (size,); return the smallest tension."""
    count = law.shape[1]
    elements, n_loc = mesh.dofs.shape
    nn = mesh.ends.shape[1]
    S = 2 * (count * (nn - 1) + 1)
    f, by_a, by_b, lowest = np.empty(10), np.empty(2), np.empty(2), np.inf
    for k in range(count):
        h, dh = q[S + k + 1] - q[S + k], v[S + k + 1] - v[S + k]
        for e in range(elements):
            for g in range(mesh.weights.size):
                interpolate(mesh, q, v, a, 2 * k * (nn - 1), e, g, f)
                xi, weight = mesh.xi[e, g], mesh.weights[g]
                c = v[S + k] * (1.0 - xi) + v[S + k + 1] * xi
                dc = a[S + k] * (1.0 - xi) + a[S + k + 1] * xi
                EA, N_0, W_0 = law[:, k, e * mesh.weights.size + g]
                size = np.sqrt(f[2] ** 2 + f[3] ** 2)
                lam = size / h
                N = N_0 + EA * (lam - 1.0)
                lowest = min(lowest, N)
                W = W_0 + (N_0 + 0.5 * EA * (lam - 1.0)) * (lam - 1.0)
                momentum, kinetic = 0.0, 0.0
                for x in range(2):
                    w = f[4 + x] - c / h * f[2 + x]
                    dw = f[8 + x] - c / h * f[6 + x] + (c * dh / h - dc) / h * f[2 + x]
                    by_a[x] = rope.rho * (h * dw + dh * w)
                    by_b[x] = rope.rho * c * w + N * f[2 + x] / size
                    momentum += dw * f[2 + x] + w * f[6 + x]
                    kinetic += 0.5 * w * w + c / h * w * f[2 + x]
                by_a[1] -= rope.q * h
                for i in range(n_loc):
                    slot = 2 * (k * (nn - 1) + mesh.dofs[e, i])
                    for x in range(2):
                        rows[slot + x] += weight * (mesh.phi[g, i] * by_a[x] + mesh.phi_xi[g, i] * by_b[x])
                material = W - N * lam - rope.q * f[1] - rope.rho * kinetic
                rows[S + k] -= weight * (material + (1.0 - xi) * rope.rho * momentum)
                rows[S + k + 1] += weight * (material - xi * rope.rho * momentum)
    return lowest


@inner
def car_forces(car, gravity, y, out):
    """C, Q, the load on the rope and the row of phi into out (5,) from y (INPUTS,), see `bodies`.

    car : the first twelve of `bodies.Cars`.
    """
    mass, k, wind, mu, thrust, brake, hold, sign, lever, arm, inertia, resistance = car
    mx, my = 0.5 * (y[0] + y[2]), 0.5 * (y[1] + y[3])
    size = np.sqrt(mx * mx + my * my)
    tx, ty = mx / size, my / size
    cos, sin = np.cos(y[9]), np.sin(y[9])
    ax, ay = y[4] + arm * y[10] * cos - wind, y[5] - arm * y[10] * sin
    drag = k * np.sqrt(ax * ax + ay * ay + 1e-24)
    along = mass * y[8] + thrust
    faster, slung = lever * y[11], lever * y[10] * y[10]
    out[0] = mass * y[6] - along * tx + drag * ax + faster * cos - slung * sin
    out[1] = mass * (y[7] - gravity) - along * ty + drag * ay - faster * sin - slung * cos
    about_hinge = lever * (y[6] * cos - y[7] * sin + gravity * sin)
    out[4] = inertia * y[11] + about_hinge + resistance * y[10] + arm * drag * (ax * cos - ay * sin)
    normal = out[0] * ty - out[1] * tx
    out[3] = normal
    if normal.real < 0.0:
        normal = -normal
    stretch = 0.5 * (np.sqrt(y[0] * y[0] + y[1] * y[1]) + np.sqrt(y[2] * y[2] + y[3] * y[3]))
    out[2] = stretch * (hold - (mu * normal + brake) * sign)


@inner
def set_slopes_and_motion_at_car(mesh, count, cars, j, q, v, a, y):
    """Fill y (INPUTS,) for car j."""
    k, force, swing = cars.contacts[j], cars.forces[j], cars.swings[j]
    nn = mesh.ends.shape[1]
    S = 2 * (count * (nn - 1) + 1)
    y[:] = 0.0
    for side in range(2):  # behind, ahead
        segment, shapes = k - 1 + side, mesh.ends[1 - side]
        h = q[S + segment + 1] - q[S + segment]
        for i in range(nn):
            for x in range(2):
                y[2 * side + x] += shapes[i] * q[2 * (segment * (nn - 1) + i) + x] / h
    for x in range(2):
        slot = 2 * k * (nn - 1) + x
        y[4 + x], y[6 + x] = v[slot], a[slot]
    if force >= 0:
        y[8] = a[force]
    if swing >= 0:
        y[9], y[10], y[11] = q[swing], v[swing], a[swing]


@inner
def add_cars_and_set_loads(mesh, count, cars, i, q, v, a, rows, loads):
    """Add C, - Q and rows of phi of the cars at instant i; set their loads on the rope, the first m."""
    nn = mesh.ends.shape[1]
    S = 2 * (count * (nn - 1) + 1)
    y, out = np.empty(INPUTS, np.complex128), np.empty(5, np.complex128)
    data = cars.data[min(i, cars.data.shape[0] - 1)]
    for j in range(cars.contacts.size):
        k, swing = cars.contacts[j], cars.swings[j]
        set_slopes_and_motion_at_car(mesh, count, cars, j, q, v, a, y)
        car_forces(data[j], cars.gravity, y, out)
        rows[2 * k * (nn - 1)] += out[0].real
        rows[2 * k * (nn - 1) + 1] += out[1].real
        rows[S + k] -= out[2].real
        loads[j] = out[3].real
        if swing >= 0:
            rows[swing] += out[4].real


@inner
def add_car_tangent(mesh, count, cars, q, v, a, factors, matrix):
    c0, c1, c2, of_force = factors
    nn = mesh.ends.shape[1]
    S = 2 * (count * (nn - 1) + 1)
    y, out = np.empty(INPUTS, np.complex128), np.empty(5, np.complex128)
    by = np.zeros((4, INPUTS))
    for i in range(cars.contacts.size):
        k, force, swing = cars.contacts[i], cars.forces[i], cars.swings[i]
        set_slopes_and_motion_at_car(mesh, count, cars, i, q, v, a, y)
        for j in range(INPUTS if swing >= 0 else 9):
            y[j] += 1e-30j
            car_forces(cars.data[0, i], cars.gravity, y, out)
            y[j] = y[j].real
            by[0, j], by[1, j], by[2, j] = out[0].imag / 1e-30, out[1].imag / 1e-30, -out[2].imag / 1e-30
            by[3, j] = out[4].imag / 1e-30
        node = 2 * k * (nn - 1)
        for row in range(4 if swing >= 0 else 3):
            slot = (node, node + 1, S + k, swing)[row]
            for side in range(2):
                segment, shapes = k - 1 + side, mesh.ends[1 - side]
                h = q[S + segment + 1] - q[S + segment]
                by_h = 0.0
                for x in range(2):
                    factor = by[row, 2 * side + x] * c0 / h
                    by_h -= factor * y[2 * side + x].real
                    for m in range(nn):
                        if shapes[m] != 0.0:
                            add(matrix, slot, 2 * (segment * (nn - 1) + m) + x, factor * shapes[m])
                add(matrix, slot, S + segment + 1, by_h)
                add(matrix, slot, S + segment, -by_h)
            for x in range(2):
                add(matrix, slot, node + x, by[row, 4 + x] * c1 + by[row, 6 + x] * c2)
            if force >= 0:
                add(matrix, slot, force, by[row, 8] * of_force)
            if swing >= 0:
                add(matrix, slot, swing, by[row, 9] * c0 + by[row, 10] * c1 + by[row, 11] * c2)


@compiled
def add_tangent(mesh, rope, law, cars, q, v, a, c, matrix):
    """Add c0 d/dq + c1 d/dv + c2 d/da of the rows at one instant, q, v, a (size,), see `Segments.tangent`.

    c : c0, c1, c2, and the factor of forces F/M
    """
    add_rope_tangent(mesh, rope, law, q, v, a, c, matrix)
    add_car_tangent(mesh, law.shape[1], cars, q, v, a, c, matrix)


@inner
def add_rope_tangent(mesh, rope, law, q, v, a, factors, matrix):
    c0, c1, c2, _ = factors
    count = law.shape[1]
    elements, n_loc = mesh.dofs.shape
    nn = mesh.ends.shape[1]
    S = 2 * (count * (nn - 1) + 1)
    f = np.empty(10)
    w, dw = np.empty(2), np.empty(2)
    w_s, dw_s = np.empty(2), np.empty(2)
    rho = rope.rho
    ab, columns, rows = matrix.ab, matrix.columns, matrix.rows
    diagonal = 2 * ((ab.shape[0] - 1) // 3)
    for k in range(count):
        h, dh = q[S + k + 1] - q[S + k], v[S + k + 1] - v[S + k]
        for e in range(elements):
            for g in range(mesh.weights.size):
                interpolate(mesh, q, v, a, 2 * k * (nn - 1), e, g, f)
                xi, weight = mesh.xi[e, g], mesh.weights[g]
                c = v[S + k] * (1.0 - xi) + v[S + k + 1] * xi
                dc = a[S + k] * (1.0 - xi) + a[S + k + 1] * xi
                EA, N_0 = law[:2, k, e * mesh.weights.size + g]
                size = np.sqrt(f[2] ** 2 + f[3] ** 2)
                lam = size / h
                N = N_0 + EA * (lam - 1.0)
                tx, ty = f[2] / size, f[3] / size
                for x in range(2):
                    w[x] = f[4 + x] - c / h * f[2 + x]
                    dw[x] = f[8 + x] - c / h * f[6 + x] + (c * dh / h - dc) / h * f[2 + x]
                # nodes by nodes
                vv = weight * rho * (h * c2 + dh * c1)
                vs = -weight * rho * (dc * c0 + c * c1)
                sv = weight * rho * c * c1
                ss = weight * (N / lam - rho * c * c) / h * c0
                along = weight * (EA - N / lam) / h * c0
                for j in range(n_loc):
                    column = 2 * (k * (nn - 1) + mesh.dofs[e, j])
                    u, d = mesh.phi[g, j], mesh.phi_xi[g, j]
                    by_p, by_s, outer = vv * u + vs * d, sv * u + ss * d, along * d
                    xx, xy, yy = by_s + outer * tx * tx, outer * tx * ty, by_s + outer * ty * ty
                    for i in range(n_loc):
                        row = diagonal + 2 * (k * (nn - 1) + mesh.dofs[e, i]) - column
                        p, s = mesh.phi[g, i] * by_p, mesh.phi_xi[g, i]
                        ab[row, column] += p + s * xx
                        ab[row, column + 1] += p + s * yy
                        ab[row - 1, column + 1] += s * xy
                        ab[row + 1, column] += s * xy
                dot_w = (w[0] * f[2] + w[1] * f[3]) / h
                for end in range(2):
                    sign, psi = 2.0 * end - 1.0, xi if end else 1.0 - xi
                    h_s, dh_s, c_s, dc_s = sign * c0, sign * c1, psi * c1, psi * c2
                    lam_s = -lam * h_s / h
                    first = c * h_s / h - c_s
                    second = dc * h_s / h - dc_s + (c_s * dh + c * dh_s) / h - 2.0 * c * dh * h_s / h**2
                    momentum, kinetic = 0.0, 0.0
                    for x in range(2):
                        t = tx if x == 0 else ty
                        w_s[x] = first * f[2 + x] / h
                        dw_s[x] = second * f[2 + x] / h + first / h * f[6 + x]
                        by_a = rho * (h_s * dw[x] + h * dw_s[x] + dh_s * w[x] + dh * w_s[x])
                        by_a -= rope.q * h_s * x
                        by_b = rho * (c_s * w[x] + c * w_s[x]) + EA * lam_s * t
                        # the row of s by this coordinate
                        of_a = (
                            -rho * (psi * (c2 * f[2 + x] + c1 * f[6 + x]) + sign * c1 * (w[x] + c / h * f[2 + x]))
                            - sign * rope.q * c0 * x
                        )
                        moved = (
                            ((c * dh / h - dc) / h * c0 - c1 * c / h) * f[2 + x]
                            + c0 * dw[x] - c0 * c / h * f[6 + x] + c1 * w[x]
                        )  # fmt: skip
                        of_b = -rho * (psi * moved - sign * c0 * (c / h) ** 2 * f[2 + x])
                        of_b -= c0 * sign * lam * EA / h * t
                        for i in range(n_loc):
                            slot = 2 * (k * (nn - 1) + mesh.dofs[e, i]) + x
                            p, s = weight * mesh.phi[g, i], weight * mesh.phi_xi[g, i]
                            columns[slot, k + end] += p * by_a + s * by_b
                            rows[k + end, slot] += p * of_a + s * of_b
                        momentum += dw_s[x] * f[2 + x] + w_s[x] * f[6 + x]
                        kinetic += w[x] * w_s[x] + c * w_s[x] * f[2 + x] / h
                    kinetic += (c_s - c * h_s / h) * dot_w
                    material = -lam * EA * lam_s - rho * kinetic
                    for other in range(2):
                        e2, psi2 = 2.0 * other - 1.0, xi if other else 1.0 - xi
                        matrix.corner[k + other, k + end] += weight * (e2 * material - rho * psi2 * momentum)
