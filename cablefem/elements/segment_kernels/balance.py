"""Compiled rows of `segments` and `bodies`, and their tangent as a bordered band."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.compiled import compiling_decorator
from cablefem.elements import bodies
from cablefem.newmark import Array

compiled = compiling_decorator(bodies.__file__)
inner = compiling_decorator(bodies.__file__, inner=True)

car_forces = inner(bodies.car_forces)


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
    damping: float


class Cars(NamedTuple):
    """Cars on one contact each; arrays (m,) unless stated."""

    contacts: NDArray[np.int64]
    forces: NDArray[np.int64]  # slots of F/M, or -1
    swings: NDArray[np.int64]  # slots of phi, or -1
    data: Array  # (1 or instants, m, 13) the first of `bodies.CarLoadsAndMasses`


class Line(NamedTuple):
    """A rope in K segments, with cars."""

    mesh: Mesh  # of each segment
    rope: Rope
    law: Array  # (3, K, G) EA, N_r, W_r
    cars: Cars


class Coordinates(NamedTuple):
    """All coordinates with their rates, (size,) or (n, size) each; see `line_coordinates`."""

    q: Array
    v: Array
    a: Array


class Bands(NamedTuple):
    """See `bordered.BandDerivatives`."""

    ab: Array  # (3, n, 2 b + 1); of one order (n, 2 b + 1), and the others alike
    columns: Array
    rows: Array
    corner: Array


@inner
def motion_at_point(line: Line, at: Coordinates, k: int, e: int, g: int) -> Any:
    """r, v, a, r_xi, v_xi, and s, ds, dds at both ends (16,), at point g of element e of segment k."""
    mesh = line.mesh
    q, v, a = at
    first = 2 * k * (mesh.ends.shape[1] - 1)
    r_x = r_y = v_x = v_y = a_x = a_y = 0.0
    r_xi_x = r_xi_y = v_xi_x = v_xi_y = 0.0
    for i in range(mesh.dofs.shape[1]):
        slot = first + 2 * mesh.dofs[e, i]
        phi = mesh.phi[g, i]
        phi_xi = mesh.phi_xi[g, i]
        r_x += phi * q[slot]
        r_y += phi * q[slot + 1]
        v_x += phi * v[slot]
        v_y += phi * v[slot + 1]
        a_x += phi * a[slot]
        a_y += phi * a[slot + 1]
        r_xi_x += phi_xi * q[slot]
        r_xi_y += phi_xi * q[slot + 1]
        v_xi_x += phi_xi * v[slot]
        v_xi_y += phi_xi * v[slot + 1]
    s = first_slot_of_s(line) + k
    ends = q[s], q[s + 1], v[s], v[s + 1], a[s], a[s + 1]
    return (r_x, r_y, v_x, v_y, a_x, a_y, r_xi_x, r_xi_y, v_xi_x, v_xi_y, *ends)


class PointFields(NamedTuple):
    """See `segments.PointFields`."""

    h: float
    dh: float
    c: float
    flow: float  # c/h
    slowing: float  # -d(c/h)/dt
    w_x: float
    w_y: float
    dw_x: float
    dw_y: float
    size: float  # |r_xi|
    lam: float
    N: float
    W: float


@inner
def fields_at_point(rope: Rope, law: Array, xi: float, y: Any) -> PointFields:
    """Fields of `motion_at_point`; law : (3,)."""
    h = y[11] - y[10]
    dh = y[13] - y[12]
    c = y[12] * (1.0 - xi) + y[13] * xi
    dc = y[14] * (1.0 - xi) + y[15] * xi
    per_h = 1.0 / h
    flow = c * per_h
    slowing = (flow * dh - dc) * per_h
    w_x = y[2] - flow * y[6]
    w_y = y[3] - flow * y[7]
    dw_x = y[4] - flow * y[8] + slowing * y[6] + rope.damping * w_x
    dw_y = y[5] - flow * y[9] + slowing * y[7] + rope.damping * w_y
    size = np.sqrt(y[6] * y[6] + y[7] * y[7])
    lam = size * per_h
    EA, N_0, W_0 = law
    N = N_0 + EA * (lam - 1.0)
    W = W_0 + (N_0 + 0.5 * EA * (lam - 1.0)) * (lam - 1.0)
    return PointFields(h, dh, c, flow, slowing, w_x, w_y, dw_x, dw_y, size, lam, N, W)


@inner
def densities(rope: Rope, xi: float, y: Any, p: PointFields) -> Any:
    """`Segments.row_densities` (6,) of `motion_at_point` and its fields."""
    momentum = p.dw_x * y[6] + p.dw_y * y[7] + p.w_x * y[8] + p.w_y * y[9]
    kinetic = 0.5 * (p.w_x * p.w_x + p.w_y * p.w_y) + p.flow * (p.w_x * y[6] + p.w_y * y[7])
    material = p.W - p.N * p.lam - rope.q * y[1] - rope.rho * kinetic
    per_size = p.N / p.size
    return (
        rope.rho * (p.h * p.dw_x + p.dh * p.w_x),
        rope.rho * (p.h * p.dw_y + p.dh * p.w_y) - rope.q * p.h,
        rope.rho * p.c * p.w_x + per_size * y[6],
        rope.rho * p.c * p.w_y + per_size * y[7],
        -material - (1.0 - xi) * rope.rho * momentum,
        material - xi * rope.rho * momentum,
    )


@inner
def set_density_changes(rope: Rope, EA: float, xi: float, y: Any, p: PointFields, d: Array, out: Array) -> None:
    """Set out (6,) to the derivative of `densities` along a change d (16,) of y."""
    h = d[11] - d[10]
    dh = d[13] - d[12]
    c = d[12] * (1.0 - xi) + d[13] * xi
    dc = d[14] * (1.0 - xi) + d[15] * xi
    per_h = 1.0 / p.h
    flow = (c - p.flow * h) * per_h
    slowing = (flow * p.dh + p.flow * dh - dc - p.slowing * h) * per_h
    w_x = d[2] - flow * y[6] - p.flow * d[6]
    w_y = d[3] - flow * y[7] - p.flow * d[7]
    dw_x = d[4] - flow * y[8] - p.flow * d[8] + slowing * y[6] + p.slowing * d[6] + rope.damping * w_x
    dw_y = d[5] - flow * y[9] - p.flow * d[9] + slowing * y[7] + p.slowing * d[7] + rope.damping * w_y
    size = (y[6] * d[6] + y[7] * d[7]) * (1.0 / p.size)
    N = EA * per_h * (size - p.lam * h)
    momentum = dw_x * y[6] + dw_y * y[7] + w_x * y[8] + w_y * y[9]
    momentum += p.dw_x * d[6] + p.dw_y * d[7] + p.w_x * d[8] + p.w_y * d[9]
    kinetic = p.w_x * w_x + p.w_y * w_y + flow * (p.w_x * y[6] + p.w_y * y[7])
    kinetic += p.flow * (w_x * y[6] + w_y * y[7] + p.w_x * d[6] + p.w_y * d[7])
    material = -p.lam * N - rope.q * d[1] - rope.rho * kinetic  # dW = N dlam
    per_size = p.N / p.size
    turn = (N - per_size * size) * (1.0 / p.size)
    out[0] = rope.rho * (h * p.dw_x + p.h * dw_x + dh * p.w_x + p.dh * w_x)
    out[1] = rope.rho * (h * p.dw_y + p.h * dw_y + dh * p.w_y + p.dh * w_y) - rope.q * h
    out[2] = rope.rho * (c * p.w_x + p.c * w_x) + turn * y[6] + per_size * d[6]
    out[3] = rope.rho * (c * p.w_y + p.c * w_y) + turn * y[7] + per_size * d[7]
    out[4] = -material - (1.0 - xi) * rope.rho * momentum
    out[5] = material - xi * rope.rho * momentum


@inner
def first_slot_of_s(line: Line) -> int:
    """Slot of s of the first contact; those of the nodes come before."""
    return 2 * (line.law.shape[1] * (line.mesh.ends.shape[1] - 1) + 1)


@compiled
def add_rows_and_set_loads(line: Line, x: Coordinates, rows: Array, loads_and_min_tension: Array) -> None:
    """Add the rows of all segments and cars at n instants to rows (n, size).

    loads_and_min_tension : (n, m + 1), is set: loads of the m cars, then the smallest mean tension of an element.
    """
    for i in range(rows.shape[0]):
        at = Coordinates(x.q[i], x.v[i], x.a[i])
        loads_and_min_tension[i, -1] = add_rope_rows_return_min_tension(line, at, rows[i])
        add_car_rows_and_set_loads(line, i, at, rows[i], loads_and_min_tension[i])


@inner
def add_rope_rows_return_min_tension(line: Line, at: Coordinates, rows: Array) -> float:
    """Add the rows of the segments to rows (size,); return the smallest mean tension of an element.

    EA multiplies the error of a strain: at a point a coarse element of a taut rope may be compressed.
    """
    mesh = line.mesh
    S = first_slot_of_s(line)
    lowest = np.inf
    for k in range(line.law.shape[1]):
        first = 2 * k * (mesh.ends.shape[1] - 1)
        for e in range(mesh.dofs.shape[0]):
            tension = 0.0
            for g in range(mesh.weights.size):
                y = motion_at_point(line, at, k, e, g)
                fields = fields_at_point(line.rope, line.law[:, k, e * mesh.weights.size + g], mesh.xi[e, g], y)
                value_x, value_y, slope_x, slope_y, left, right = densities(line.rope, mesh.xi[e, g], y, fields)
                weight = mesh.weights[g]
                tension += weight * mesh.dofs.shape[0] * fields.N
                for i in range(mesh.dofs.shape[1]):
                    slot = first + 2 * mesh.dofs[e, i]
                    phi = weight * mesh.phi[g, i]
                    phi_xi = weight * mesh.phi_xi[g, i]
                    rows[slot] += phi * value_x + phi_xi * slope_x
                    rows[slot + 1] += phi * value_y + phi_xi * slope_y
                rows[S + k] += weight * left
                rows[S + k + 1] += weight * right
            lowest = min(lowest, tension)
    return lowest


@inner
def set_slope_at_end(line: Line, q: Array, segment: int, end: int, out: Array) -> None:
    """Set the first two of out to r' at the left or the right end, 0 or 1, of a segment."""
    mesh = line.mesh
    S = first_slot_of_s(line)
    h = q[S + segment + 1] - q[S + segment]
    first = 2 * segment * (mesh.ends.shape[1] - 1)
    out[0] = 0.0
    out[1] = 0.0
    for node in mesh.dofs[-end]:
        for axis in range(2):
            out[axis] += mesh.ends[end, node] * q[first + 2 * node + axis] / h


@inner
def set_slopes_and_motion_at_car(line: Line, j: int, at: Coordinates, y: Array) -> None:
    """Set y (INPUTS,), the inputs of `bodies.forces_on_cars`, for car j."""
    cars = line.cars
    q, v, a = at
    k = cars.contacts[j]
    force = cars.forces[j]
    swing = cars.swings[j]
    y[:] = 0.0
    for side in range(2):  # behind, ahead
        set_slope_at_end(line, q, k - 1 + side, 1 - side, y[2 * side :])
    for x in range(2):
        slot = 2 * k * (line.mesh.ends.shape[1] - 1) + x
        y[4 + x] = v[slot]
        y[6 + x] = a[slot]
    if force >= 0:
        y[8] = a[force]
    if swing >= 0:
        y[9] = q[swing]
        y[10] = v[swing]
        y[11] = a[swing]


@inner
def add_car_rows_and_set_loads(line: Line, i: int, at: Coordinates, rows: Array, loads: Array) -> None:
    """Add C, - Q and rows of phi of the cars at instant i; set their loads on the rope, the first m."""
    cars = line.cars
    y = np.empty(bodies.INPUTS)
    data = cars.data[min(i, cars.data.shape[0] - 1)]
    for j in range(cars.contacts.size):
        set_slopes_and_motion_at_car(line, j, at, y)
        forces = car_forces(data[j], y)
        node = 2 * cars.contacts[j] * (line.mesh.ends.shape[1] - 1)
        rows[node] += forces.contact_x
        rows[node + 1] += forces.contact_y
        rows[first_slot_of_s(line) + cars.contacts[j]] -= forces.drive
        loads[j] = forces.normal
        if cars.swings[j] >= 0:
            rows[cars.swings[j]] += forces.swing


@compiled
def add_rope_derivatives(line: Line, at: Coordinates, out: Bands) -> None:
    """Add those of the rows of the segments at one instant, see `Segments.derivatives`."""
    mesh = line.mesh
    change = np.empty(16)
    by_value = np.empty((2, 6))
    by_slope = np.empty((2, 6))
    by_end = np.empty((2, 6))
    for k in range(line.law.shape[1]):
        for e in range(mesh.dofs.shape[0]):
            for g in range(mesh.weights.size):
                law = line.law[:, k, e * mesh.weights.size + g]
                xi = mesh.xi[e, g]
                y = motion_at_point(line, at, k, e, g)
                fields = fields_at_point(line.rope, law, xi, y)
                for order in range(3):
                    for b in range(2):
                        for first, orders, of in ((0, 3, by_value[b]), (6, 2, by_slope[b]), (10, 3, by_end[b])):
                            change[:] = 0.0
                            if order < orders:
                                change[first + 2 * order + b] = mesh.weights[g]
                            set_density_changes(line.rope, law[0], xi, y, fields, change, of)
                    matrix = Bands(out.ab[order], out.columns[order], out.rows[order], out.corner[order])
                    add_point(line, matrix, (k, e, g), by_value, by_slope, by_end)


@inner
def add_point(
    line: Line, matrix: Bands, at: tuple[int, int, int], by_value: Array, by_slope: Array, by_end: Array
) -> None:
    """Add what point g of element e of segment k gives; at : k, e, g."""
    k, e, g = at
    mesh = line.mesh
    nodes = mesh.dofs[e]
    first = 2 * k * (mesh.ends.shape[1] - 1)
    diagonal = matrix.ab.shape[1] // 2
    for j in range(nodes.size):
        u = mesh.phi[g, j]
        d = mesh.phi_xi[g, j]
        for b in range(2):
            column = first + 2 * nodes[j] + b
            for end in range(2):
                matrix.rows[k + end, column] += u * by_value[b, 4 + end] + d * by_slope[b, 4 + end]
                matrix.columns[column, k + end] += u * by_end[end, b] + d * by_end[end, 2 + b]
            for x in range(2):
                of_value = u * by_value[b, x] + d * by_slope[b, x]
                of_slope = u * by_value[b, 2 + x] + d * by_slope[b, 2 + x]
                for i in range(nodes.size):
                    row = first + 2 * nodes[i] + x
                    entry = mesh.phi[g, i] * of_value + mesh.phi_xi[g, i] * of_slope
                    matrix.ab[row, diagonal + column - row] += entry
    for end in range(2):
        for other in range(2):
            matrix.corner[k + other, k + end] += by_end[end, 4 + other]
