"""A line on elements where a car passes an end of a shoe: the state on the mesh between the contacts of then."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cablefem.elements.line_coordinates import Coordinates
from cablefem.elements.reference import lagrange_element, shape_polynomial_coefficients
from cablefem.elements.segments import Segments
from cablefem.elements.system import LineElements
from cablefem.newmark import Array, State, consistent_acceleration
from cablefem.shoes import LineSnapshot, Passage, line_and_snapshot_after_passage, line_snapshot


def system_after_passage(system: LineElements, passage: Passage, x: State) -> tuple[LineElements, State]:
    """The line after a passage, and its state: r interpolated, velocities by least squares."""
    old = system.coordinates_from_unknowns(*x)
    over = {car.name: system.car_point_and_rates(car.name, x) for car in system.line.cars_off_rope}
    line, snapshot = line_and_snapshot_after_passage(
        system.line, passage, x.t, x.phase, _line_snapshot_of(system, old, over)
    )
    new = LineElements(line, elements=system.segments.elements, degree=system.segments.degree, compiled=system.compiled)
    z = new.prescribed_coordinates(x.t, x.phase)
    _copy_body_coordinates(system, old, new, z)
    for k, contact in enumerate(line.contacts_and_wheels):
        z.q[new.s[k]], z.v[new.s[k]] = snapshot.s[contact.name], snapshot.ds[contact.name]
        for i in (0, 1):
            z[i][2 * new.node[k] + np.arange(2)] = snapshot.points[contact.name][i]
    z = new.fill_dependent_coordinates(np.array(z))
    names = [c.name for c in line.contacts_and_wheels]
    if passage.car in system.swing_off_rope and passage.car in names:  # its velocity may jump
        jump = z.v[2 * new.node[names.index(passage.car)] + np.arange(2)] - over[passage.car][1]
        swing = _body_slots_by_car(new)[passage.car]
        z.v[swing] += system.off_rope[passage.car].swing_rate_jump(z.q[swing], jump)
    for k in range(len(names) - 1):
        _fit_segment(system, old, new, z, k)
    for name in ("hold", "signs", "brakes", "rear_brakes"):
        setattr(new, name, _reorder_by_car(system, new, getattr(system, name)))
    new.set_travel_directions(x.phase)
    return new, consistent_acceleration(new, x.t, z.q[new.free], z.v[new.free], x.phase)


def _line_snapshot_of(system: LineElements, z: Coordinates, over: dict[str, Array]) -> LineSnapshot:
    """The line at coordinates z; over : points with rates (3, 2) of cars off the rope."""
    points = np.array(z)[:, 2 * system.node[:, None] + np.arange(2)]

    def rope_at(s: float) -> Array:
        return positions_slopes_and_velocities_at(system, z, np.array([s]))[:, 0]

    return line_snapshot(system.line, points, np.array(z)[:, system.s], over, rope_at)


def _copy_body_coordinates(old: LineElements, before: Coordinates, new: LineElements, z: Coordinates) -> None:
    """Set angles and points of bodies with their rates in z to those of the same cars before."""
    old_slots = _body_slots_by_car(old)
    for name, slots in _body_slots_by_car(new).items():
        if name in old_slots:
            for i in (0, 1):
                z[i][slots] = before[i][old_slots[name]]


def _body_slots_by_car(system: LineElements) -> dict[str, Array]:
    """Slots of swing and of X and th, by car."""
    cars = system.line.cars_on_rope
    swings = {cars[i].name: np.array([slot]) for i, slot in zip(system.of_swing, system.swing, strict=True)}
    swings |= {name: np.array([slot]) for name, slot in system.swing_off_rope.items()}
    return swings | {trolley.car.name: trolley.body for trolley in system.trolleys}


def _reorder_by_car(old: LineElements, new: LineElements, values: Array) -> Array:
    """Values of the old line's cars in the order of the new one's; 0 for others."""
    by_name = {car.name: value for car, value in zip(old.line.cars_on_rope, values.tolist(), strict=True)}
    return np.array([by_name.get(car.name, 0.0) for car in new.line.cars_on_rope])


def _fit_segment(old: LineElements, before: Coordinates, new: LineElements, z: Coordinates, k: int) -> None:
    """Set r and v inside segment k of z by least squares: first the slopes r', then dr/dt = w + c r'."""
    segments = new.segments
    s, ds = z.q[new.s[k : k + 2]], z.v[new.s[k : k + 2]]
    h = s[1] - s[0]
    r, v = (values[: 2 * new.n].reshape(-1, 2)[new.nodes[k]] for values in (z.q, z.v))
    _, slope, w = positions_slopes_and_velocities_at(old, before, segments.psi @ s)
    _fit_inner_unknowns(segments, segments.slopes, r, slope * h)
    _fit_inner_unknowns(segments, segments.values, v, w + (segments.psi @ ds)[:, None] * (segments.slopes @ r) / h)
    for values, fitted in ((z.q, r), (z.v, v)):
        values[: 2 * new.n].reshape(-1, 2)[new.nodes[k]] = fitted


def _fit_inner_unknowns(segments: Segments, table: Array, x: Array, target: Array) -> None:
    """Set the inner unknowns of x (nn, 2), so that table (G, nn) times x is nearest to the target (G, 2)."""
    rest = target - table[:, [0, -1]] @ x[[0, -1]]
    root = np.sqrt(segments.weights)[:, None]
    x[1:-1] = np.linalg.lstsq(root * table[:, 1:-1], root * rest, rcond=None)[0]


def positions_slopes_and_velocities_at(system: LineElements, z: Coordinates, s: Array) -> Array:
    """r, r' and the velocity at fixed s (3, m, 2) at the points s (m,)."""
    segments, at, ds = system.segments, z.q[system.s], z.v[system.s]
    k = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(at) - 2)
    h = (at[k + 1] - at[k])[:, None]
    xi = (s - at[k]) / h[:, 0]
    element = np.clip((xi * segments.elements).astype(int), 0, segments.elements - 1)
    local = xi * segments.elements - element
    shapes = shape_polynomial_coefficients(lagrange_element(segments.degree)).T
    values, slopes = polyval(local, shapes).T, polyval(local, polyder(shapes)).T * segments.elements  # (m, n_loc)
    nodes = system.nodes[k[:, None], segments.dofs[element]]  # (m, n_loc)
    r, v = (values_of[: 2 * system.n].reshape(-1, 2)[nodes] for values_of in (z.q, z.v))
    slope = np.einsum("mn,mna->ma", slopes, r) / h
    c = ds[k] + xi * (ds[k + 1] - ds[k])
    w = np.einsum("mn,mna->ma", values, v) - c[:, None] * slope
    return np.stack([np.einsum("mn,mna->ma", values, r), slope, w])
