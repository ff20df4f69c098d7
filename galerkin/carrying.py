"""A line by sines where a car passes an end of a shoe: the state by the functions between the contacts of then."""

from __future__ import annotations

import numpy as np

from cablefem.newmark import State
from cablefem.scene.contacts import Array
from cablefem.shoes import LineSnapshot, Passage, line_and_snapshot_after_passage, line_snapshot
from galerkin.lines import LineSines
from galerkin.segments import Layout, sines_and_polynomials


def system_after_passage(system: LineSines, passage: Passage, x: State) -> tuple[LineSines, State]:
    """The line after a passage, and its state by least squares."""
    before = system.all_coordinates_with_rates(x)
    points_off_rope = {car.name: system.car_point_and_rates(car.name, x) for car in system.line.cars_off_rope}
    snapshot = _snapshot_of_line(system, before, points_off_rope)
    line, snapshot = line_and_snapshot_after_passage(system.line, passage, x.t, x.phase, snapshot)
    new = LineSines(line, system.layout.terms)
    layout = new.layout
    Z = new.prescribed_coordinates(x.t, x.phase)
    _set_contact_coordinates(new, Z, snapshot)
    _copy_angles_and_centres(system, before, new, Z)
    new.copy_friction_from(system)
    layout.set_dependent_coordinates(Z)
    if passage.car in system.layout.angle_off_rope and passage.car not in layout.angle_off_rope:
        velocity = points_off_rope[passage.car][1]
        _set_cabin_rate_keeping_moment(system, passage.car, velocity, new, Z)
    for i in range(layout.segments):
        _fit_segment(system.layout, before, layout, Z, i)
    equations = new.equations
    q, v = np.where(equations.forces, 0.0, Z[:2, equations.free])
    state = State(x.t, q, v, np.zeros(new.n_dof), x.phase)
    new.set_travel_directions(x.phase)
    new.begin_step(state)
    return new, new.with_acceleration(state)


def _snapshot_of_line(system: LineSines, Z: Array, points_off_rope: dict[str, Array]) -> LineSnapshot:
    """The line with the coordinates Z."""
    layout = system.layout
    points = Z[:, np.stack([layout.x, layout.y], axis=1)]  # with rates (3, contacts, 2)

    def rope(s: float) -> Array:
        return positions_slopes_and_velocities_at(layout, Z, np.array([s]))[:, 0]

    return line_snapshot(system.line, points, Z[:, layout.s], points_off_rope, rope)


def _set_contact_coordinates(new: LineSines, Z: Array, snapshot: LineSnapshot) -> None:
    """Set s and the points of all contacts in Z, with their velocities."""
    layout = new.layout
    for k, contact in enumerate(new.line.contacts_and_wheels):
        Z[:2, layout.s[k]] = snapshot.s[contact.name], snapshot.ds[contact.name]
        Z[:2, [layout.x[k], layout.y[k]]] = snapshot.points[contact.name][:2]


def _copy_angles_and_centres(old: LineSines, before: Array, new: LineSines, Z: Array) -> None:
    """Set angles and centres in Z, with their velocities, to those before."""
    earlier = {contact.name: j for j, contact in enumerate(old.line.contacts_and_wheels)}
    for k, contact in enumerate(new.line.contacts_and_wheels):
        if contact.name in earlier:
            j = earlier[contact.name]
            Z[:2, new.layout.moving[k, 2:]] = before[:2, old.layout.moving[j, 2:]]
    angles = _cabin_angle_indices(old)
    for name, i in _cabin_angle_indices(new).items():
        Z[:2, i] = before[:2, angles[name]]


def _cabin_angle_indices(system: LineSines) -> dict[str, int]:
    """Coordinates of the angles of cabins that swing, by car."""
    cars = [(k, body.car) for k, body in system.cars.items() if body.car.hanger is not None]
    return {car.name: int(system.layout.angle[k]) for k, car in cars} | system.layout.angle_off_rope


def _set_cabin_rate_keeping_moment(old: LineSines, name: str, velocity: Array, new: LineSines, Z: Array) -> None:
    """Set the rate of the cabin of a car that takes the rope: its velocity (2,) may jump, moments do not."""
    layout = new.layout
    body = old.off_rope[name].body
    k = [contact.name for contact in new.line.contacts_and_wheels].index(name)
    angle = Z[0, layout.angle[k]]
    jump = Z[1, [layout.x[k], layout.y[k]]] - velocity
    forward = np.array([np.cos(angle), -np.sin(angle)])
    along = jump @ forward
    Z[1, layout.angle[k]] -= body.m * body.h * along / body.about_hanger


def positions_slopes_and_velocities_at(layout: Layout, Z: Array, s: Array) -> Array:
    """r, r' and the velocity at fixed s (3, m, 2) at the points s (m,)."""
    at, ds = Z[:2, layout.s]
    behind = np.searchsorted(at, s, side="right") - 1
    i = np.clip(behind, 0, layout.segments - 1)
    h = at[i + 1] - at[i]
    xi = (s - at[i]) / h
    ds_of_xi = ds[i] + xi * (ds[i + 1] - ds[i])
    B, slopes = (sines_and_polynomials(xi, layout.terms, order)[:, None] for order in range(2))  # (m, 1, M)
    u, du = Z[:2, layout.columns[i, :-2]].reshape(2, s.size, -1, 2)
    r = (B @ u)[:, 0]
    slope = (slopes @ u)[:, 0] / h[:, None]
    at_fixed_xi = (B @ du)[:, 0]
    velocity = at_fixed_xi - ds_of_xi[:, None] * slope
    return np.stack([r, slope, velocity])


def _fit_segment(old: Layout, before: Array, layout: Layout, Z: Array, i: int) -> None:
    """Set the functions of segment i in Z: nearest slopes, and then nearest velocities at fixed xi."""
    tables = layout.tables
    columns = layout.columns[i, :-2].reshape(-1, 2)
    inner = slice(layout.functions_of[i].start // 2, layout.functions)
    root = np.sqrt(tables.weights)[:, None]
    (a, b), (da, db) = Z[:2, layout.s[[i, i + 1]]]
    s = a + tables.points * (b - a)
    ds = da + tables.points * (db - da)
    _, slope, velocity = positions_slopes_and_velocities_at(old, before, s)

    def fit(order: int, functions: Array, wanted: Array) -> None:
        """Set coefficients or, for order 1, their rates, so that sum B u is nearest to the wanted values (G, 2)."""
        ends = functions[:, -2:] @ Z[order, columns[-2:]]
        of_inner = root * (wanted - ends)
        Z[order, columns[inner]] = np.linalg.lstsq(root * functions[:, inner], of_inner, rcond=None)[0]

    B = tables.B
    slopes = tables.of_q[: tables.points.size]
    h = b - a
    fit(0, slopes, slope * h)
    fit(1, B, velocity + ds[:, None] * (slopes @ Z[0, columns]) / h)
