"""A line on elements where a car passes an end of a shoe: the state on the mesh between the contacts of then."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cablefem.elements.reference import lagrange_element, shape_polynomials
from cablefem.elements.segments import Segments
from cablefem.elements.system import Coordinates, LineElements
from cablefem.newmark import Array, State, consistent_acceleration
from cablefem.shoes import Passage, line_and_snapshot_after_passage, line_snapshot


def system_after_passage(system: LineElements, passage: Passage, x: State) -> tuple[LineElements, State]:
    """The line after a passage, and its state: r interpolated, velocities by least squares."""
    old = system.coordinates_with_rates(*x)
    jets = np.array(old)[:, 2 * system.node[:, None] + np.arange(2)]
    over = {car.name: system.car_point_and_rates(car.name, x) for car in system.line.over}
    now = line_snapshot(
        system.line, jets, np.array(old)[:, system.s], over, lambda s: rope_at(system, old, np.array([s]))[:, 0]
    )
    line, now = line_and_snapshot_after_passage(system.line, passage, x.t, x.phase, now)
    new = LineElements(line, elements=system.segments.elements, degree=system.segments.degree, compiled=system.compiled)
    z = new.prescribed_coordinates(x.t, x.phase)
    own, before = _slots_by_car(new), _slots_by_car(system)
    for name, slots in own.items():
        if name in before:
            for i in (0, 1):
                z[i][slots] = old[i][before[name]]
    names = [c.name for c in line.contacts_and_wheels]
    for k, name in enumerate(names):
        z.q[new.s[k]], z.v[new.s[k]] = now.s[name], now.ds[name]
        for i in (0, 1):
            z[i][2 * new.node[k] + np.arange(2)] = now.points[name][i]
    z = new.fill_dependent_coordinates(np.array(z))
    if passage.car in system.swing_off_rope and passage.car in names:  # its velocity may jump
        jump = z.v[2 * new.node[names.index(passage.car)] + np.arange(2)] - over[passage.car][1]
        swing = own[passage.car]
        z.v[swing] += system.off_rope[passage.car].swing_by_jump(z.q[swing], jump)
    for k in range(len(names) - 1):
        _carry_segment(system, old, new, z, k)
    new.hold = _values_of_cars(system, new, system.hold)
    new.signs = _values_of_cars(system, new, system.signs)
    new.brakes = _values_of_cars(system, new, system.brakes)
    new.rear_brakes = _values_of_cars(system, new, system.rear_brakes)
    new.set_directions(x.phase)
    return new, consistent_acceleration(new, x.t, z.q[new.free], z.v[new.free], x.phase)


def _slots_by_car(system: LineElements) -> dict[str, Array]:
    """Slots of swing and of X and th, by car."""
    cars = system.line.cars
    swings = {cars[i].name: np.array([slot]) for i, slot in zip(system.of_swing, system.swing, strict=True)}
    swings |= {name: np.array([slot]) for name, slot in system.swing_off_rope.items()}
    return swings | {trolley.car.name: trolley.body for trolley in system.trolleys}


def _values_of_cars(old: LineElements, new: LineElements, values: Array) -> Array:
    by_name = {car.name: value for car, value in zip(old.line.cars, values.tolist(), strict=True)}
    return np.array([by_name.get(car.name, 0.0) for car in new.line.cars])


def _carry_segment(old: LineElements, before: Coordinates, new: LineElements, z: Coordinates, k: int) -> None:
    """Set r and v inside segment k of z: the slopes r', and then dr/dt = w + c r', at best."""
    segments = new.segments
    s, ds = z.q[new.s[k : k + 2]], z.v[new.s[k : k + 2]]
    h = s[1] - s[0]
    r, v = (values[: 2 * new.n].reshape(-1, 2)[new.nodes[k]] for values in (z.q, z.v))
    _, slope, w = rope_at(old, before, segments.psi @ s)
    _fit_inner_unknowns(segments, segments.slopes, r, slope * h)
    _fit_inner_unknowns(segments, segments.values, v, w + (segments.psi @ ds)[:, None] * (segments.slopes @ r) / h)
    for values, fitted in ((z.q, r), (z.v, v)):
        values[: 2 * new.n].reshape(-1, 2)[new.nodes[k]] = fitted


def _fit_inner_unknowns(segments: Segments, table: Array, x: Array, to: Array) -> None:
    """Set the inner unknowns of x (nn, 2), so that table (G, nn) times x is nearest to (G, 2)."""
    rest = to - table[:, [0, -1]] @ x[[0, -1]]
    root = np.sqrt(segments.weights)[:, None]
    x[1:-1] = np.linalg.lstsq(root * table[:, 1:-1], root * rest, rcond=None)[0]


def rope_at(system: LineElements, z: Coordinates, s: Array) -> Array:
    """r, r' and the velocity at fixed s (3, m, 2) at the points s (m,)."""
    segments, at, ds = system.segments, z.q[system.s], z.v[system.s]
    k = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(at) - 2)
    h = (at[k + 1] - at[k])[:, None]
    xi = (s - at[k]) / h[:, 0]
    element = np.clip((xi * segments.elements).astype(int), 0, segments.elements - 1)
    local = xi * segments.elements - element
    shapes = shape_polynomials(lagrange_element(segments.degree)).T
    values, slopes = polyval(local, shapes).T, polyval(local, polyder(shapes)).T * segments.elements  # (m, n_loc)
    nodes = system.nodes[k[:, None], segments.dofs[element]]  # (m, n_loc)
    r, v = (values_of[: 2 * system.n].reshape(-1, 2)[nodes] for values_of in (z.q, z.v))
    slope = np.einsum("mn,mna->ma", slopes, r) / h
    c = ds[k] + xi * (ds[k + 1] - ds[k])
    w = np.einsum("mn,mna->ma", values, v) - c[:, None] * slope
    return np.stack([np.einsum("mn,mna->ma", values, r), slope, w])
