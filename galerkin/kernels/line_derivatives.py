"""Derivatives of the rows of a line in motion at one instant, by all coordinates and by their rates."""

from __future__ import annotations

from typing import Any

import numpy as np

from galerkin.kernels.bodies import depth_with_derivatives, set_balance_rows_and_car_forces
from galerkin.kernels.dense import set_matrix_product
from galerkin.kernels.line import (
    VALUES,
    Line,
    LineValues,
    RopeAtPoints,
    arm_and_derivative,
    evaluate_line,
    motion_of_xi,
    rope_at_points,
)
from galerkin.law import compiled, inner


@inner
def set_derivatives_of_segment(line: Line, Z: Any, rope: RopeAtPoints, values: LineValues, k: int, out: Any) -> None:
    """Set those of the rows of segment k in `out` (3, M, 2, 2 M + 2)."""
    tables = line.tables
    M = tables.tests.shape[0]
    G = tables.points.size
    ends = 5 * M  # columns before: by q for xx, xy and yy, by v, by a; these: by order, axis and end
    tests = np.zeros((2 * G, ends + 12))
    for g in range(G):
        xi = tables.points[g]
        h, dh, dxi, ddxi = motion_of_xi(line, Z, 0, k, xi)
        drift = ddxi + line.damping * dxi
        weight = tables.weights[g]
        mass = weight * line.rho * h
        x = rope.slope[g, 2 * k] / h
        y = rope.slope[g, 2 * k + 1] / h
        stretch = np.sqrt(x * x + y * y)
        across = values.N[0, k, g] / stretch
        along = (line.EA - across) / (stretch * stretch)
        for m in range(M):
            slope = tables.of_q[g, m]
            tests[g, m] = tests[g, 2 * M + m] = mass * (slope * drift + tables.of_q[G + g, m] * dxi * dxi)
            tests[g, 3 * M + m] = mass * (2.0 * slope * dxi + line.damping * tables.B[g, m])
            tests[g, 4 * M + m] = mass * tables.B[g, m]
            tests[G + g, m] = weight / h * slope * (across + along * x * x)
            tests[G + g, M + m] = weight / h * slope * along * x * y
            tests[G + g, 2 * M + m] = weight / h * slope * (across + along * y * y)
        for axis in range(2):
            slope = x if axis == 0 else y
            dslope = (rope.dslope[g, 2 * k + axis] + rope.bend[g, 2 * k + axis] * dxi - slope * dh) / h  # at fixed s
            for end in range(2):
                sign = 2.0 * end - 1.0  # dh/ds of this end
                shift = xi if end == 1 else 1.0 - xi  # of a point at this xi
                c = ends + 2 * axis + end
                by_length = weight * sign * values.inertia_and_weight[0, k, g, axis]
                tests[g, c] = by_length - mass * sign * (2.0 * dslope * dxi + slope * drift)
                tests[g, c + 4] = -mass * (2.0 * (dslope * shift + slope * sign * dxi) + line.damping * slope * shift)
                tests[g, c + 8] = -mass * slope * shift
                tests[G + g, c] = -weight * sign / h * line.EA * slope
    by = np.empty((M, tests.shape[1]))
    set_matrix_product(tables.tests, tests, False, by)
    for m in range(M):
        for axis in range(2):
            for j in range(M):
                out[0, m, axis, 2 * j + axis] = by[m, 2 * axis * M + j]
                out[0, m, axis, 2 * j + 1 - axis] = by[m, M + j]
                for order in range(1, 3):
                    out[order, m, axis, 2 * j + axis] = by[m, (2 + order) * M + j]
                    out[order, m, axis, 2 * j + 1 - axis] = 0.0
            for order in range(3):
                for end in range(2):
                    out[order, m, axis, 2 * M + end] = by[m, ends + 4 * order + 2 * axis + end]


@inner
def add_derivatives_through_contact(
    line: Line, Z: Any, rope: RopeAtPoints, k: int, by: Any, blocks: Any, K: Any
) -> None:
    """Add derivatives of a row by the values of contact k, by (VALUES,), to its K (3, columns)."""
    at = line.at
    M = line.tables.tests.shape[0]
    for side in range(2):  # behind, ahead
        segment = k - 1 + side
        if not 0 <= segment < at.columns.shape[0]:
            continue
        end = 1 - side
        end_slopes = line.tables.of_q[2 * line.tables.points.size + end]
        h = motion_of_xi(line, Z, 0, segment, 0.0).h
        for j in range(2 * M + 2):
            column = line.column[at.columns[segment, j]]
            for axis in range(2):
                by_force = (1.0 - 2.0 * side) * by[2 * side + axis]  # the row at L is - N t
                by_slope = by[4 + 2 * side + axis] / h
                for order in range(3):
                    K[order, column] += by_force * blocks[order, segment, M - 2 + end, axis, j]
                if j >= 2 * M:
                    K[0, column] += (
                        (1.0 if j == 2 * M else -1.0) * by_slope * rope.end_slopes[end, 2 * segment + axis] / h
                    )
                elif j % 2 == axis:
                    K[0, column] += by_slope * end_slopes[j // 2]
    for order in range(3):
        for j in range(5):
            K[order, line.column[at.moving[k, j]]] += by[8 + 5 * order + j]
    K[1, line.column[at.s[k]]] += by[23]
    K[2, line.column[at.s[k]]] += by[24]
    K[2, line.column[at.F[k]]] += by[25]


@inner
def add_derivatives_of_body(
    line: Line, Z: Any, rope: RopeAtPoints, k: int, friction: Any, values: LineValues, blocks: Any, K: Any
) -> None:
    """Add those of the rows of the body at contact k to K (3, rows, columns); by complex steps."""
    body = line.bodies[k]
    x = values.contact_values[0, k:]
    rows = np.empty(5, np.complex128)
    by = np.empty((body.balance_count, VALUES))
    tiny = 1e-30
    for j in range(body.contacts):
        for m in range(VALUES):
            x[j, m] += tiny * 1j
            set_balance_rows_and_car_forces(body, x, friction[k], values.forces_on_cars[0, k], rows)
            x[j, m] = x[j, m].real
            for row in range(body.balance_count):
                by[row, m] = rows[row].imag / tiny
        for row in range(body.balance_count):
            add_derivatives_through_contact(line, Z, rope, k + j, by[row], blocks, K[:, row])


@inner
def add_derivatives_of_dependent_column(K: Any, p: int, x: int, n: float, dn: float, ddn: float) -> None:
    """Add the derivatives by column p to those by column x, where p. = n x., by n and its parts of p. and p.."""
    for row in range(K.shape[1]):
        by_p, by_v, by_a = K[0, row, p], K[1, row, p], K[2, row, p]
        K[0, row, x] += by_p * n + by_v * dn + by_a * ddn
        K[1, row, x] += by_v * n + by_a * (2.0 * dn)
        K[2, row, x] += by_a * n


@inner
def add_derivatives_of_dependent_columns(line: Line, Z: Any, K: Any) -> None:
    """Add the derivatives by what follows from other coordinates to those by these; the third of Y is left out."""
    column = line.column
    for depth in line.at.on_rails:
        x, dx, ddx = Z[0, 0, depth.x], Z[1, 0, depth.x], Z[2, 0, depth.x]
        _, slope, bend = depth_with_derivatives(depth.rail, x)
        add_derivatives_of_dependent_column(K, column[depth.y], column[depth.x], slope, bend * dx, bend * ddx)
    for i in range(line.at.followers.size - 1, -1, -1):
        follower = line.at.followers[i]
        dth, ddth = Z[1, 0, follower.pitch], Z[2, 0, follower.pitch]
        arm, n = arm_and_derivative(follower, Z[0, 0, follower.pitch])
        p = column[follower.p]
        add_derivatives_of_dependent_column(K, p, column[follower.pitch], n, -dth * arm, -(ddth * arm + dth**2 * n))
        add_derivatives_of_dependent_column(K, p, column[follower.c], 1.0, 0.0, 0.0)


@compiled
def evaluate_line_and_set_derivatives(line: Line, Z: Any, frictions: Any, blocks: Any, K: Any) -> LineValues:
    """`evaluate_line` at one instant, and its derivatives K (3, size, columns) by coordinates and their rates.

    blocks : memory (3, S, M, 2, 2 M + 2) for those of the rows of segments
    """
    values = evaluate_line(line, Z, frictions)
    rope = rope_at_points(line, Z)
    S = line.at.columns.shape[0]
    for k in range(S):
        set_derivatives_of_segment(line, Z, rope, values, k, blocks[:, k])
    K[:] = 0.0
    row = 0
    functions = blocks.shape[2] - 2
    for shape in line.shapes:
        segment = shape // (2 * functions)
        function = shape // 2 % functions
        for order in range(3):
            for j in range(blocks.shape[4]):
                column = line.column[line.at.columns[segment, j]]
                K[order, row, column] = blocks[order, segment, function, shape % 2, j]
        row += 1
    for k in range(S + 1):
        rows = line.bodies[k].balance_count
        if rows > 0:
            add_derivatives_of_body(line, Z, rope, k, frictions[0], values, blocks, K[:, row : row + rows])
        row += rows
    add_derivatives_of_dependent_columns(line, Z, K)
    return values
