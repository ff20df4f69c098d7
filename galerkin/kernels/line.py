"""Rows of a line in motion at instants, whose equations stand in `galerkin.segments` and `galerkin.line_equations`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from galerkin.kernels.bodies import FORCES, RAIL, depth_with_derivatives, set_balance_rows_and_car_forces
from galerkin.kernels.dense import set_matrix_product
from galerkin.law import compiled, inner

VALUES = 26  # at a contact, see `galerkin.bodies.ContactState`
# coordinate p = c + x cos(pitch) - y sin(pitch), see `galerkin.trolley.Follower`
FOLLOWER = np.dtype([("p", "i8"), ("c", "i8"), ("pitch", "i8"), ("x", "f8"), ("y", "f8")])
ON_RAIL = np.dtype([("y", "i8"), ("x", "i8"), ("rail", RAIL)])


class Tables(NamedTuple):
    """The functions B of a segment at G points."""

    points: Any  # (G,)
    weights: Any
    B: Any  # (G, M)
    of_q: Any  # B', B'' and B' at both ends, (2 G + 2, M)
    tests: Any  # B and B', (M, 2 G)


class Coordinates(NamedTuple):
    """Their numbers, see `galerkin.segments.Layout`."""

    columns: Any  # (S, 2 M + 2)
    moving: Any  # (contacts, 5)
    s: Any  # (contacts,)
    F: Any
    followers: Any  # of `FOLLOWER`
    on_rails: Any  # of `ON_RAIL`


class Line(NamedTuple):
    tables: Tables
    at: Coordinates
    free: Any  # (n,) coordinates of the unknowns
    shapes: Any  # those of the functions between contacts
    column: Any  # of each coordinate in tangents: unknowns, those that follow, and the last of known ones
    bodies: Any  # of `BODY`, (contacts,)
    rho: float
    gravity: float
    EA: float
    damping: float  # c_d of the force -c_d rho r. on the rope
    N: float = 0.0  # of r' = 1


class LineValues(NamedTuple):
    """What acts in a line at n instants; r, N and contact_values are NaN if contacts pass each other along the rope."""

    Z: Any  # coordinates with their rates (3, n, coordinates)
    r: Any  # residual (n, size)
    contact_values: Any  # (n, contacts, VALUES), complex
    N: Any  # (n, S, G)
    inertia_and_weight: Any  # rho (r.. + c_d r. - g j) (n, S, G, 2)
    # int rho (r.. + c_d r. - g j) B + N t . B' ds (M, n, S, 2); the last two are - N t at L and N t at R
    rope_rows: Any
    forces_on_cars: Any  # of `bodies.set_forces_on_car` (n, contacts, FORCES), complex


class RopeAtPoints(NamedTuple):
    """Derivatives of r at fixed xi; columns by instant, segment and axis, (G, 2 n S)."""

    slope: Any  # by xi
    bend: Any  # by xi twice
    dslope: Any  # by xi and time
    a: Any  # by time twice, and c_d times that by time
    end_slopes: Any  # by xi at both ends, (2, 2 n S)


class Stretch(NamedTuple):
    """See `motion_of_xi`."""

    h: float
    dh: float
    dxi: float
    ddxi: float


@inner
def arm_and_derivative(follower: Any, pitch: float) -> tuple[float, float]:
    """p - c, and its derivative by the pitch."""
    cos = np.cos(pitch)
    sin = np.sin(pitch)
    return follower.x * cos - follower.y * sin, -follower.x * sin - follower.y * cos


@compiled
def set_dependent_coordinates(at: Coordinates, Z: Any) -> None:
    """Set what follows from other coordinates in Z (3, n, coordinates)."""
    for i in range(Z.shape[1]):
        for f in at.followers:
            dth = Z[1, i, f.pitch]
            arm, n = arm_and_derivative(f, Z[0, i, f.pitch])
            Z[0, i, f.p] = Z[0, i, f.c] + arm
            Z[1, i, f.p] = Z[1, i, f.c] + dth * n
            Z[2, i, f.p] = Z[2, i, f.c] + Z[2, i, f.pitch] * n - dth**2 * arm
        for depth in at.on_rails:
            dx = Z[1, i, depth.x]
            Y, slope, bend = depth_with_derivatives(depth.rail, Z[0, i, depth.x])
            Z[0, i, depth.y] = Y
            Z[1, i, depth.y] = slope * dx
            Z[2, i, depth.y] = slope * Z[2, i, depth.x] + bend * dx**2


@inner
def allocate_values(line: Line, Z: Any) -> LineValues:
    n = Z.shape[1]
    segments = line.at.columns.shape[0]
    points = line.tables.points.size
    contacts = segments + 1
    return LineValues(
        Z,
        np.full((n, line.free.size), np.nan),
        np.full((n, contacts, VALUES), np.nan + 0j),
        np.full((n, segments, points), np.nan),
        np.empty((n, segments, points, 2)),
        np.empty((line.tables.tests.shape[0], n, segments, 2)),
        np.zeros((n, contacts, FORCES), np.complex128),
    )


@inner
def rope_at_points(line: Line, Z: Any) -> RopeAtPoints:
    tables = line.tables
    columns = line.at.columns
    M = tables.tests.shape[0]
    G = tables.points.size
    n = Z.shape[1]
    S = columns.shape[0]
    coefficients = np.empty((3, M, 2 * n * S))
    for order in range(3):
        for i in range(n):
            for k in range(S):
                for j in range(2 * M):
                    coefficients[order, j // 2, 2 * (i * S + k) + j % 2] = Z[order, i, columns[k, j]]
    by_q = np.empty((2 * G + 2, 2 * n * S))
    by_v = np.empty((G, 2 * n * S))
    by_a = np.empty((G, 2 * n * S))
    set_matrix_product(tables.of_q, coefficients[0], False, by_q)
    set_matrix_product(tables.of_q[:G], coefficients[1], False, by_v)
    set_matrix_product(tables.B, coefficients[2] + line.damping * coefficients[1], False, by_a)
    return RopeAtPoints(by_q[:G], by_q[G : 2 * G], by_v, by_a, by_q[2 * G :])


@inner
def motion_of_xi(line: Line, Z: Any, i: int, k: int, xi: float) -> Stretch:
    """The length of segment k at instant i, and how a point of it at rest moves in xi."""
    L = line.at.columns[k, -2]
    R = line.at.columns[k, -1]
    h = Z[0, i, R] - Z[0, i, L]
    dh = Z[1, i, R] - Z[1, i, L]
    ddh = Z[2, i, R] - Z[2, i, L]
    dxi = -(Z[1, i, L] + xi * dh) / h
    ddxi = -(Z[2, i, L] + 2.0 * dxi * dh + xi * ddh) / h
    return Stretch(h, dh, dxi, ddxi)


@inner
def set_rope_forces_and_rows(line: Line, Z: Any, at: RopeAtPoints, out: LineValues) -> None:
    """Set N, inertia_and_weight and rope_rows."""
    tables = line.tables
    M = tables.tests.shape[0]
    G = tables.points.size
    n, S = out.N.shape[:2]
    tests = np.empty((2 * G, 2 * n * S))
    for i in range(n):
        for k in range(S):
            x = 2 * (i * S + k)
            for g in range(G):
                h, _, dxi, ddxi = motion_of_xi(line, Z, i, k, tables.points[g])
                squared = (at.slope[g, x] / h) ** 2 + (at.slope[g, x + 1] / h) ** 2
                stretch = np.sqrt(squared)
                N = line.N + line.EA * (squared - 1.0) / (stretch + 1.0)
                out.N[i, k, g] = N
                for axis in range(2):
                    moved = (2.0 * at.dslope[g, x + axis] + at.bend[g, x + axis] * dxi) * dxi
                    slope = at.slope[g, x + axis]
                    moved += slope * (ddxi + line.damping * dxi)
                    inertia = line.rho * (at.a[g, x + axis] + moved - axis * line.gravity)
                    out.inertia_and_weight[i, k, g, axis] = inertia
                    tests[g, x + axis] = tables.weights[g] * (h * inertia)
                    tests[G + g, x + axis] = tables.weights[g] * (N / stretch * (slope / h))
    set_matrix_product(tables.tests, tests, False, out.rope_rows.reshape(M, 2 * n * S))


@inner
def set_contact_values(line: Line, Z: Any, end_slopes: Any, out: LineValues) -> None:
    """Set contact_values; end_slopes : of `RopeAtPoints`."""
    at = line.at
    n, S = out.N.shape[:2]
    for i in range(n):
        for k in range(S + 1):
            x = out.contact_values[i, k]
            x[:8] = 0.0
            for side in range(2):  # behind, ahead
                j = k - 1 + side
                if 0 <= j < S:
                    h = Z[0, i, at.s[j + 1]] - Z[0, i, at.s[j]]
                    for axis in range(2):
                        x[2 * side + axis] = (1.0 - 2.0 * side) * out.rope_rows[-1 - side, i, j, axis]
                        x[4 + 2 * side + axis] = end_slopes[1 - side, 2 * (i * S + j) + axis] / h
            for order in range(3):
                for j in range(5):
                    x[8 + 5 * order + j] = Z[order, i, at.moving[k, j]]
            x[23] = Z[1, i, at.s[k]]
            x[24] = Z[2, i, at.s[k]]
            x[25] = Z[2, i, at.F[k]]


@compiled
def evaluate_line(line: Line, Z: Any, frictions: Any) -> LineValues:
    """The line with the coordinates Z (3, n, coordinates); frictions (n, contacts, 5) of `Friction`.

    The rows of cars off the rope are zero.
    """
    out = allocate_values(line, Z)
    S = out.N.shape[1]
    rope = rope_at_points(line, Z)
    set_rope_forces_and_rows(line, Z, rope, out)
    set_contact_values(line, Z, rope.end_slopes, out)
    rows = np.empty(5, np.complex128)
    functions = out.rope_rows.shape[0] - 2
    for i in range(Z.shape[1]):
        r = out.r[i]
        r[:] = 0.0
        row = 0
        for shape in line.shapes:
            r[row] = out.rope_rows[shape // 2 % functions, i, shape // (2 * functions), shape % 2]
            row += 1
        for k in range(S + 1):
            set_balance_rows_and_car_forces(
                line.bodies[k], out.contact_values[i, k:], frictions[i, k], out.forces_on_cars[i, k], rows
            )
            for j in range(line.bodies[k].balance_count):
                r[row] = rows[j].real
                row += 1
    return out


@compiled
def evaluate_line_with_unknowns(line: Line, prescribed: Any, x: Any, frictions: Any) -> LineValues:
    """`evaluate_line` with the unknowns q, v, a in x (n, 3, size); prescribed (3, n, coordinates): all others.

    NaN if contacts pass each other along the rope; a search for rest may pass through such coordinates.
    """
    Z = prescribed.copy()
    for i in range(x.shape[0]):
        for order in range(3):
            for j in range(line.free.size):
                Z[order, i, line.free[j]] = x[i, order, j]
    set_dependent_coordinates(line.at, Z)
    for i in range(x.shape[0]):
        for k in range(line.at.s.size - 1):
            if not Z[0, i, line.at.s[k + 1]] > Z[0, i, line.at.s[k]]:
                return allocate_values(line, Z)
    return evaluate_line(line, Z, frictions)


@compiled
def set_points_and_tensions(
    at: Coordinates, Z: Any, integrals: Any, minus_force_at_left: Any, s: Any, points: Any, tension: Any
) -> None:
    """Set points (n, m, 2) and tensions (n, m) at s (m,), on the segment behind a contact, from N t at its left end.

    Z : coordinates (n, .);  integrals : Legendre coefficients of those of the load over xi (n, S, G + 1, 2)
    """
    M = at.columns.shape[1] // 2 - 1
    B = np.empty(M)
    force = np.empty(2)
    points[:] = 0.0
    for i in range(Z.shape[0]):
        for m in range(s.size):
            k = 0
            while k < at.columns.shape[0] - 1 and Z[i, at.s[k + 1]] < s[m]:
                k += 1
            h = Z[i, at.s[k + 1]] - Z[i, at.s[k]]
            xi = (s[m] - Z[i, at.s[k]]) / h
            set_sines_and_polynomials(xi, B)
            for j in range(2 * M):
                points[i, m, j % 2] += B[j // 2] * Z[i, at.columns[k, j]]
            before = 0.0
            legendre = 1.0
            force[0] = -minus_force_at_left[i, k, 0]
            force[1] = -minus_force_at_left[i, k, 1]
            for j in range(integrals.shape[2]):
                for axis in range(2):
                    force[axis] += h * legendre * integrals[i, k, j, axis]
                following = ((2 * j + 1) * (2.0 * xi - 1.0) * legendre - j * before) / (j + 1)
                before, legendre = legendre, following
            tension[i, m] = np.sqrt(force[0] ** 2 + force[1] ** 2)


@inner
def set_sines_and_polynomials(xi: float, B: Any) -> None:
    """Set the functions (M,) of a segment at xi."""
    twice = 2.0 * np.cos(np.pi * xi)
    before = 0.0
    sine = np.sin(np.pi * xi)
    for j in range(B.size - 4):
        B[j] = sine
        before, sine = sine, twice * sine - before
    B[-4] = xi * (1.0 - xi)
    B[-3] = B[-4] * (1.0 - 2.0 * xi)
    B[-2] = 1.0 - xi
    B[-1] = xi
