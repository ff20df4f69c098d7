"""Compiled rows of `segments` and `bodies`, and their tangent as a bordered band."""

from __future__ import annotations

from typing import NamedTuple

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
    """Of m matrices, see `bordered.BandMatrix`."""

    ab: Array  # (m, n, 3 b + 1)
    columns: Array
    rows: Array
    corner: Array


@inner
def set_motion_at_point(line: Line, at: Coordinates, k: int, e: int, g: int, y: Array) -> None:
    """Set y (16,) to r, v, a, r_xi, v_xi, and s, ds, dds at both ends, at point g of element e of segment k."""
    mesh = line.mesh
    first = 2 * k * (mesh.ends.shape[1] - 1)
    y[:10] = 0.0
    for i in range(mesh.dofs.shape[1]):
        slot = first + 2 * mesh.dofs[e, i]
        phi = mesh.phi[g, i]
        phi_xi = mesh.phi_xi[g, i]
        for axis in range(2):
            y[axis] += phi * at.q[slot + axis]
            y[2 + axis] += phi * at.v[slot + axis]
            y[4 + axis] += phi * at.a[slot + axis]
            y[6 + axis] += phi_xi * at.q[slot + axis]
            y[8 + axis] += phi_xi * at.v[slot + axis]
    for end in range(2):
        slot = first_slot_of_s(line) + k + end
        y[10 + end] = at.q[slot]
        y[12 + end] = at.v[slot]
        y[14 + end] = at.a[slot]


@inner
def set_densities(rope: Rope, law: Array, xi: float, y: Array, out: Array) -> None:
    """Set out (7,) to `Segments.row_densities` and the tension, of `set_motion_at_point`; law : (3,)."""
    h = y[11] - y[10]
    dh = y[13] - y[12]
    c = y[12] * (1.0 - xi) + y[13] * xi
    dc = y[14] * (1.0 - xi) + y[15] * xi
    flow = c / h
    slowing = (flow * dh - dc) / h
    size = np.sqrt(y[6] * y[6] + y[7] * y[7])
    lam = size / h
    EA, N_0, W_0 = law
    N = N_0 + EA * (lam - 1.0)
    W = W_0 + (N_0 + 0.5 * EA * (lam - 1.0)) * (lam - 1.0)
    momentum = 0.0 * h
    kinetic = 0.0 * h
    for x in range(2):
        r_xi = y[6 + x]
        w = y[2 + x] - flow * r_xi
        dw = y[4 + x] - flow * y[8 + x] + slowing * r_xi
        out[x] = rope.rho * (h * dw + dh * w)
        out[2 + x] = rope.rho * c * w + N * r_xi / size
        momentum += dw * r_xi + w * y[8 + x]
        kinetic += 0.5 * w * w + flow * w * r_xi
    out[1] -= rope.q * h
    material = W - N * lam - rope.q * y[1] - rope.rho * kinetic
    out[4] = -material - (1.0 - xi) * rope.rho * momentum
    out[5] = material - xi * rope.rho * momentum
    out[6] = N


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
    y = np.empty(16)
    out = np.empty(7)
    lowest = np.inf
    for k in range(line.law.shape[1]):
        for e in range(mesh.dofs.shape[0]):
            tension = 0.0
            for g in range(mesh.weights.size):
                set_motion_at_point(line, at, k, e, g, y)
                set_densities(line.rope, line.law[:, k, e * mesh.weights.size + g], mesh.xi[e, g], y, out)
                weight = mesh.weights[g]
                tension += weight * mesh.dofs.shape[0] * out[6]
                for i in range(mesh.dofs.shape[1]):
                    slot = 2 * (k * (mesh.ends.shape[1] - 1) + mesh.dofs[e, i])
                    for x in range(2):
                        rows[slot + x] += weight * (mesh.phi[g, i] * out[x] + mesh.phi_xi[g, i] * out[2 + x])
                for end in range(2):
                    rows[S + k + end] += weight * out[4 + end]
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
def add_rope_tangents(line: Line, at: Coordinates, factors: Array, matrices: Bands) -> None:
    """Add c0 d/dq + c1 d/dv + c2 d/da of the rows of the segments at one instant, see `Segments.tangent`.

    factors : (m, 3) c0, c1, c2.
    """
    mesh = line.mesh
    y = np.empty(16, np.complex128)
    out = np.empty(7, np.complex128)
    J = np.empty((16, 6))
    by_value = np.empty((2, 6))
    by_slope = np.empty((2, 6))
    by_end = np.empty((2, 6))
    for k in range(line.law.shape[1]):
        for e in range(mesh.dofs.shape[0]):
            for g in range(mesh.weights.size):
                set_motion_at_point(line, at, k, e, g, y)
                for i in range(16):
                    y[i] += 1e-30j
                    set_densities(line.rope, line.law[:, k, e * mesh.weights.size + g], mesh.xi[e, g], y, out)
                    y[i] = y[i].real
                    for row in range(6):
                        J[i, row] = mesh.weights[g] * (out[row].imag / 1e-30)
                for m in range(len(factors)):
                    set_combinations(factors[m], J, by_value, by_slope, by_end)
                    add_point(line, matrices, (m, k, e, g), by_value, by_slope, by_end)


@inner
def set_combinations(factors: Array, J: Array, by_value: Array, by_slope: Array, by_end: Array) -> None:
    """Set derivatives (2, 6) by values and slopes of x and y, and by both ends, of those by the motion J (16, 6)."""
    for b in range(2):
        for row in range(6):
            by_value[b, row] = 0.0
            by_end[b, row] = 0.0
            for order in range(3):
                by_value[b, row] += factors[order] * J[2 * order + b, row]
                by_end[b, row] += factors[order] * J[10 + 2 * order + b, row]
            by_slope[b, row] = factors[0] * J[6 + b, row] + factors[1] * J[8 + b, row]


@inner
def add_point(
    line: Line, matrices: Bands, at: tuple[int, int, int, int], by_value: Array, by_slope: Array, by_end: Array
) -> None:
    """Add to matrix m what point g of element e of segment k gives; at : m, k, e, g."""
    m, k, e, g = at
    mesh = line.mesh
    nodes = mesh.dofs[e]
    first = 2 * k * (mesh.ends.shape[1] - 1)
    diagonal = 2 * (matrices.ab.shape[2] // 3)
    for j in range(nodes.size):
        u = mesh.phi[g, j]
        d = mesh.phi_xi[g, j]
        for b in range(2):
            column = first + 2 * nodes[j] + b
            for end in range(2):
                matrices.rows[m, k + end, column] += u * by_value[b, 4 + end] + d * by_slope[b, 4 + end]
                matrices.columns[m, column, k + end] += u * by_end[end, b] + d * by_end[end, 2 + b]
            for x in range(2):
                of_value = u * by_value[b, x] + d * by_slope[b, x]
                of_slope = u * by_value[b, 2 + x] + d * by_slope[b, 2 + x]
                for i in range(nodes.size):
                    row = first + 2 * nodes[i] + x
                    entry = mesh.phi[g, i] * of_value + mesh.phi_xi[g, i] * of_slope
                    matrices.ab[m, column, diagonal + row - column] += entry
    for end in range(2):
        for other in range(2):
            matrices.corner[m, k + other, k + end] += by_end[end, 4 + other]
