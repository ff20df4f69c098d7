"""Compiled rows of `segments`, and of cars on one contact."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.compiled import compiling_decorator
from cablefem.elements import bodies, segments
from cablefem.elements.line_coordinates import Coordinates
from cablefem.newmark import Array

if TYPE_CHECKING:
    from cablefem.elements.segment_kernels.contacts import Line

compiled = compiling_decorator(bodies.__file__)
inner = compiling_decorator(bodies.__file__, inner=True)

car_forces = inner(bodies.car_forces)
fields_at_point = inner(segments.fields_at_point)
row_densities = inner(segments.row_densities)


class Rope(NamedTuple):
    """A rope of equal elements on each segment."""

    phi: Array  # (points, n_loc)
    phi_xi: Array
    weights: Array  # (points,)
    xi: Array  # (elements, points)
    dofs: NDArray[np.int64]  # (elements, n_loc)
    ends: Array  # (2, nn) slopes at both ends
    rho: float
    q: float
    damping: float


class Cars(NamedTuple):
    """Cars on one contact each, (m,)."""

    contacts: NDArray[np.int64]
    forces: NDArray[np.int64]  # slots of F/M, or -1
    swings: NDArray[np.int64]  # slots of phi, or -1
    loads: NDArray[np.int64]  # numbers of their wheels


@inner
def motion_at_point(line: Line, at: Coordinates, k: int, e: int, g: int) -> Any:
    """What `segments.fields_at_point` takes at point g of element e of segment k."""
    rope = line.rope
    q, v, a = at
    first = 2 * k * (rope.ends.shape[1] - 1)
    r_x = r_y = v_x = v_y = a_x = a_y = 0.0
    x_xi = y_xi = vx_xi = vy_xi = 0.0
    for i in range(rope.dofs.shape[1]):
        slot = first + 2 * rope.dofs[e, i]
        phi = rope.phi[g, i]
        phi_xi = rope.phi_xi[g, i]
        r_x += phi * q[slot]
        r_y += phi * q[slot + 1]
        v_x += phi * v[slot]
        v_y += phi * v[slot + 1]
        a_x += phi * a[slot]
        a_y += phi * a[slot + 1]
        x_xi += phi_xi * q[slot]
        y_xi += phi_xi * q[slot + 1]
        vx_xi += phi_xi * v[slot]
        vy_xi += phi_xi * v[slot + 1]
    s = first_slot_of_s(line) + k
    position = r_x, r_y, x_xi, y_xi, q[s], q[s + 1]
    velocity = v_x, v_y, vx_xi, vy_xi, v[s], v[s + 1]
    return position, velocity, (a_x, a_y, 0.0, 0.0, a[s], a[s + 1])


@inner
def first_slot_of_s(line: Line) -> int:
    """Slot of s of the first contact; those of the nodes come before."""
    return 2 * (line.law.shape[1] * (line.rope.ends.shape[1] - 1) + 1)


@inner
def add_rope_rows_return_min_tension(line: Line, at: Coordinates, rows: Array) -> float:
    """Add the rows of the segments to rows (size,); return the smallest mean tension of an element.

    EA multiplies the error of a strain: at a point a coarse element of a taut rope may be compressed.
    """
    rope = line.rope
    S = first_slot_of_s(line)
    lowest = np.inf
    for k in range(line.law.shape[1]):
        first = 2 * k * (rope.ends.shape[1] - 1)
        for e in range(rope.dofs.shape[0]):
            tension = 0.0
            for g in range(rope.weights.size):
                y = motion_at_point(line, at, k, e, g)
                law = line.law[:, k, e * rope.weights.size + g]
                fields = fields_at_point(rope.damping, (law[0], law[1], law[2]), rope.xi[e, g], y)
                densities = row_densities(rope.rho, rope.q, rope.xi[e, g], fields)
                value_x, value_y, slope_x, slope_y, left, right = densities
                weight = rope.weights[g]
                tension += weight * rope.dofs.shape[0] * fields.N
                for i in range(rope.dofs.shape[1]):
                    slot = first + 2 * rope.dofs[e, i]
                    phi = weight * rope.phi[g, i]
                    phi_xi = weight * rope.phi_xi[g, i]
                    rows[slot] += phi * value_x + phi_xi * slope_x
                    rows[slot + 1] += phi * value_y + phi_xi * slope_y
                rows[S + k] += weight * left
                rows[S + k + 1] += weight * right
            lowest = min(lowest, tension)
    return lowest


@inner
def set_slope_at_segment_end(line: Line, q: Array, segment: int, end: int, out: Array) -> None:
    """Set the first two of out to r' at the left or the right end, 0 or 1, of a segment."""
    rope = line.rope
    S = first_slot_of_s(line)
    h = q[S + segment + 1] - q[S + segment]
    first = 2 * segment * (rope.ends.shape[1] - 1)
    out[0] = 0.0
    out[1] = 0.0
    for node in rope.dofs[-end]:
        for axis in range(2):
            out[axis] += rope.ends[end, node] * q[first + 2 * node + axis] / h


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
        set_slope_at_segment_end(line, q, k - 1 + side, 1 - side, y[2 * side :])
    for x in range(2):
        slot = 2 * k * (line.rope.ends.shape[1] - 1) + x
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
    """Add C, - Q and rows of phi of the cars at instant i; set their loads on the rope."""
    cars = line.cars
    y = np.empty(bodies.INPUTS)
    data = line.car_data[min(i, line.car_data.shape[0] - 1)]
    for j in range(cars.contacts.size):
        set_slopes_and_motion_at_car(line, j, at, y)
        forces = car_forces(data[j], y)
        node = 2 * cars.contacts[j] * (line.rope.ends.shape[1] - 1)
        rows[node] += forces.contact_x
        rows[node + 1] += forces.contact_y
        rows[first_slot_of_s(line) + cars.contacts[j]] -= forces.drive
        loads[cars.loads[j]] = forces.normal
        if cars.swings[j] >= 0:
            rows[cars.swings[j]] += forces.swing
