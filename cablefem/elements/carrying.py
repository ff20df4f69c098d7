"""A line on elements where a car passes an end of a shoe: the state on the mesh between the contacts of then."""

from __future__ import annotations

import numpy as np

from cablefem.elements.line_coordinates import Coordinates
from cablefem.elements.segments import Segments
from cablefem.elements.system import LineElements
from cablefem.newmark import Array, State, consistent_acceleration
from cablefem.shoes import LineSnapshot, Passage, line_and_snapshot_after_passage, line_snapshot


def system_after_passage(system: LineElements, passage: Passage, x: State) -> tuple[LineElements, State]:
    """The line after a passage, and its state: r interpolated, velocities by least squares."""
    before = system.all_coordinates_from_unknowns(*x)
    off_rope = {car.name: system.car_point_and_rates(car.name, x) for car in system.line.cars_off_rope}
    snapshot = _line_snapshot_of(system, before, off_rope)
    line, snapshot = line_and_snapshot_after_passage(system.line, passage, x.t, x.phase, snapshot)
    segments = system.segments
    new = LineElements(line, elements=segments.elements, degree=segments.degree)
    z = Coordinates(*new.prescribed_coordinates(x.t, x.phase))
    _copy_body_coordinates(system, before, new, z)
    _set_contact_coordinates(new, snapshot, z)
    z = new.fill_dependent_coordinates(np.array(z))
    if passage.car in system.swing_off_rope:
        _add_jump_of_swing_rate(system, new, passage.car, off_rope[passage.car][1], z)
    for k in range(len(new.nodes)):
        _fit_segment(system, before, new, z, k)
    new.copy_friction_from(system)
    new.set_travel_directions(x.phase)
    state = consistent_acceleration(new, x.t, z.q[new.free], z.v[new.free], x.phase)
    return new, state


def _set_contact_coordinates(new: LineElements, snapshot: LineSnapshot, z: Coordinates) -> None:
    """Set s and points of all contacts with their velocities in z."""
    for k, contact in enumerate(new.line.contacts_and_wheels):
        point, velocity, _ = snapshot.points[contact.name]
        z.q[new.s[k]] = snapshot.s[contact.name]
        z.v[new.s[k]] = snapshot.ds[contact.name]
        z.q[new.xy[k]] = point
        z.v[new.xy[k]] = velocity


def _add_jump_of_swing_rate(old: LineElements, new: LineElements, car: str, velocity: Array, z: Coordinates) -> None:
    """Add to the swing rate in z what the jump of the car's velocity gives; velocity : off the rope (2,)."""
    i = [c.name for c in new.line.cars_on_rope].index(car)
    jump = z.v[new.xy[new.car_contacts[i]]] - velocity
    swing = _body_slots_by_car(new)[car]
    z.v[swing] += old.off_rope[car].swing_rate_jump(z.q[swing], jump)


def _line_snapshot_of(system: LineElements, z: Coordinates, off_rope: dict[str, Array]) -> LineSnapshot:
    """The line at coordinates z; off_rope : points with rates (3, 2) of cars off the rope."""
    with_rates = np.array(z)

    def rope_at(s: float) -> Array:
        return positions_slopes_and_velocities_at(system, z, np.array([s]))[:, 0]

    return line_snapshot(system.line, with_rates[:, system.xy], with_rates[:, system.s], off_rope, rope_at)


def _copy_body_coordinates(old: LineElements, before: Coordinates, new: LineElements, z: Coordinates) -> None:
    """Set angles and points of bodies with their rates in z to those of the same cars before."""
    old_slots = _body_slots_by_car(old)
    for name, slots in _body_slots_by_car(new).items():
        if name in old_slots:
            for i in (0, 1):
                z[i][slots] = before[i][old_slots[name]]


def _body_slots_by_car(system: LineElements) -> dict[str, Array]:
    """Slots of swing and of X and th, by car."""
    slots = {}
    for i, slot in zip(system.of_swing, system.swing.tolist(), strict=True):
        slots[system.line.cars_on_rope[i].name] = np.array([slot])
    for name, slot in system.swing_off_rope.items():
        slots[name] = np.array([slot])
    for trolley in system.trolleys:
        slots[trolley.car.name] = trolley.body
    return slots


def _fit_segment(old: LineElements, before: Coordinates, new: LineElements, z: Coordinates, k: int) -> None:
    """Set r and v inside segment k of z by least squares: first the slopes r', then dr/dt = w + c r'."""
    segments = new.segments
    xy = new.xy_of_nodes[k]
    ends = new.s[k : k + 2]
    h = z.q[ends[1]] - z.q[ends[0]]
    _, slope, w = positions_slopes_and_velocities_at(old, before, segments.psi @ z.q[ends])
    r = z.q[xy]
    _fit_inner_unknowns(segments, segments.slopes, r, slope * h)
    v = z.v[xy]
    c = (segments.psi @ z.v[ends])[:, None]
    of_node = w + c * (segments.slopes @ r) / h
    _fit_inner_unknowns(segments, segments.values, v, of_node)
    z.q[xy] = r
    z.v[xy] = v


def _fit_inner_unknowns(segments: Segments, table: Array, x: Array, target: Array) -> None:
    """Set the inner unknowns of x (nn, 2), so that table (G, nn) times x is nearest to the target (G, 2)."""
    root = np.sqrt(segments.weights)[:, None]
    of_ends = table[:, [0, -1]] @ x[[0, -1]]
    by_inner = root * table[:, 1:-1]
    missing = root * (target - of_ends)
    x[1:-1] = np.linalg.lstsq(by_inner, missing, rcond=None)[0]


def positions_slopes_and_velocities_at(system: LineElements, z: Coordinates, s: Array) -> Array:
    """r, r' and the velocity at fixed s (3, m, 2) at the points s (m,)."""
    segments = system.segments
    ends = z.q[system.s]
    ds = z.v[system.s]
    behind = np.searchsorted(ends, s, side="right") - 1
    k = np.clip(behind, 0, len(ends) - 2)
    h = ends[k + 1] - ends[k]
    xi = (s - ends[k]) / h
    shapes = segments.element_shapes(xi)
    xy = system.xy_of_nodes[k[:, None], shapes.nodes]  # (m, n_loc, 2)
    r = z.q[xy]
    v = z.v[xy]
    by_xi = np.einsum("nm,mna->ma", shapes.slopes * segments.elements, r)
    slope = by_xi / h[:, None]
    c = ds[k] + xi * (ds[k + 1] - ds[k])
    of_node = np.einsum("nm,mna->ma", shapes.values, v)
    points = np.einsum("nm,mna->ma", shapes.values, r)
    return np.stack([points, slope, of_node - c[:, None] * slope])
