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


class Band(NamedTuple):
    """A bordered band, see `bordered.BandMatrix`."""

    ab: Array
    columns: Array
    rows: Array
    corner: Array


@inner
def set_values_at_point(mesh: Mesh, x: Coordinates, first: int, e: int, g: int, f: Array) -> None:
    """Set f (10,) to r, r_xi, v, v_xi, a at point g of element e; first : slot of the segment's first node."""
    q, v, a = x
    f[:] = 0.0
    for i in range(mesh.dofs.shape[1]):
        slot = first + 2 * mesh.dofs[e, i]
        for axis in range(2):
            f[axis] += mesh.phi[g, i] * q[slot + axis]
            f[2 + axis] += mesh.phi_xi[g, i] * q[slot + axis]
            f[4 + axis] += mesh.phi[g, i] * v[slot + axis]
            f[6 + axis] += mesh.phi_xi[g, i] * v[slot + axis]
            f[8 + axis] += mesh.phi[g, i] * a[slot + axis]


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
    mesh, rope, law, _ = line
    q, v, a = at
    count = law.shape[1]
    elements, n_loc = mesh.dofs.shape
    nn = mesh.ends.shape[1]
    S = first_slot_of_s(line)
    f = np.empty(10)
    by_a = np.empty(2)
    by_b = np.empty(2)
    lowest = np.inf
    for k in range(count):
        h = q[S + k + 1] - q[S + k]
        dh = v[S + k + 1] - v[S + k]
        for e in range(elements):
            tension = 0.0
            for g in range(mesh.weights.size):
                set_values_at_point(mesh, at, 2 * k * (nn - 1), e, g, f)
                xi = mesh.xi[e, g]
                weight = mesh.weights[g]
                c = v[S + k] * (1.0 - xi) + v[S + k + 1] * xi
                dc = a[S + k] * (1.0 - xi) + a[S + k + 1] * xi
                EA, N_0, W_0 = law[:, k, e * mesh.weights.size + g]
                size = np.sqrt(f[2] ** 2 + f[3] ** 2)
                lam = size / h
                N = N_0 + EA * (lam - 1.0)
                tension += weight * elements * N
                W = W_0 + (N_0 + 0.5 * EA * (lam - 1.0)) * (lam - 1.0)
                momentum = 0.0
                kinetic = 0.0
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
def add_tangent(
    mesh: Mesh, rope: Rope, law: Array, at: Coordinates, factors: tuple[float, float, float], matrix: Band
) -> None:
    """Add c0 d/dq + c1 d/dv + c2 d/da of the rows of the segments at one instant, see `Segments.tangent`."""
    q, v, a = at
    c0, c1, c2 = factors
    count = law.shape[1]
    elements, n_loc = mesh.dofs.shape
    nn = mesh.ends.shape[1]
    S = 2 * (count * (nn - 1) + 1)
    f = np.empty(10)
    w = np.empty(2)
    dw = np.empty(2)
    w_s = np.empty(2)
    dw_s = np.empty(2)
    rho = rope.rho
    ab = matrix.ab
    columns = matrix.columns
    rows = matrix.rows
    diagonal = 2 * ((ab.shape[0] - 1) // 3)
    for k in range(count):
        h = q[S + k + 1] - q[S + k]
        dh = v[S + k + 1] - v[S + k]
        for e in range(elements):
            for g in range(mesh.weights.size):
                set_values_at_point(mesh, at, 2 * k * (nn - 1), e, g, f)
                xi = mesh.xi[e, g]
                weight = mesh.weights[g]
                c = v[S + k] * (1.0 - xi) + v[S + k + 1] * xi
                dc = a[S + k] * (1.0 - xi) + a[S + k + 1] * xi
                EA, N_0 = law[:2, k, e * mesh.weights.size + g]
                size = np.sqrt(f[2] ** 2 + f[3] ** 2)
                lam = size / h
                N = N_0 + EA * (lam - 1.0)
                tx = f[2] / size
                ty = f[3] / size
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
                    u = mesh.phi[g, j]
                    d = mesh.phi_xi[g, j]
                    by_p = vv * u + vs * d
                    by_s = sv * u + ss * d
                    outer = along * d
                    xx = by_s + outer * tx * tx
                    xy = outer * tx * ty
                    yy = by_s + outer * ty * ty
                    for i in range(n_loc):
                        row = diagonal + 2 * (k * (nn - 1) + mesh.dofs[e, i]) - column
                        p = mesh.phi[g, i] * by_p
                        s = mesh.phi_xi[g, i]
                        ab[row, column] += p + s * xx
                        ab[row, column + 1] += p + s * yy
                        ab[row - 1, column + 1] += s * xy
                        ab[row + 1, column] += s * xy
                dot_w = (w[0] * f[2] + w[1] * f[3]) / h
                for end in range(2):
                    sign = 2.0 * end - 1.0
                    psi = xi if end else 1.0 - xi
                    h_s = sign * c0
                    dh_s = sign * c1
                    c_s = psi * c1
                    dc_s = psi * c2
                    lam_s = -lam * h_s / h
                    first = c * h_s / h - c_s
                    second = dc * h_s / h - dc_s + (c_s * dh + c * dh_s) / h - 2.0 * c * dh * h_s / h**2
                    momentum = 0.0
                    kinetic = 0.0
                    for x in range(2):
                        t = tx if x == 0 else ty
                        w_s[x] = first * f[2 + x] / h
                        dw_s[x] = second * f[2 + x] / h + first / h * f[6 + x]
                        by_a = rho * (h_s * dw[x] + h * dw_s[x] + dh_s * w[x] + dh * w_s[x])
                        by_a -= rope.q * h_s * x
                        by_b = rho * (c_s * w[x] + c * w_s[x]) + EA * lam_s * t
                        # the row of s by this coordinate
                        carried = psi * (c2 * f[2 + x] + c1 * f[6 + x])
                        of_a = -rho * (carried + sign * c1 * (w[x] + c / h * f[2 + x])) - sign * rope.q * c0 * x
                        by_r_xi = (c * dh / h - dc) / h * c0 - c1 * c / h
                        moved = by_r_xi * f[2 + x] + c0 * dw[x] - c0 * c / h * f[6 + x] + c1 * w[x]
                        of_b = -rho * (psi * moved - sign * c0 * (c / h) ** 2 * f[2 + x])
                        of_b -= c0 * sign * lam * EA / h * t
                        for i in range(n_loc):
                            slot = 2 * (k * (nn - 1) + mesh.dofs[e, i]) + x
                            p = weight * mesh.phi[g, i]
                            s = weight * mesh.phi_xi[g, i]
                            columns[slot, k + end] += p * by_a + s * by_b
                            rows[k + end, slot] += p * of_a + s * of_b
                        momentum += dw_s[x] * f[2 + x] + w_s[x] * f[6 + x]
                        kinetic += w[x] * w_s[x] + c * w_s[x] * f[2 + x] / h
                    kinetic += (c_s - c * h_s / h) * dot_w
                    material = -lam * EA * lam_s - rho * kinetic
                    for other in range(2):
                        e2 = 2.0 * other - 1.0
                        psi2 = xi if other else 1.0 - xi
                        matrix.corner[k + other, k + end] += weight * (e2 * material - rho * psi2 * momentum)
