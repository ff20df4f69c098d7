"""A line by sines where a car passes an end of a shoe: the state by the functions between the contacts of then."""

from __future__ import annotations

import numpy as np

from cablefem.newmark import State
from cablefem.scene.contacts import Array
from cablefem.shoes import Passage, line_and_snapshot_after_passage, line_snapshot
from galerkin.lines import LineSines
from galerkin.segments import Layout, basis_functions


def system_after_passage(system: LineSines, passage: Passage, x: State) -> tuple[LineSines, State]:
    """The line after a passage, and its state by least squares."""
    old, before = system.layout, system.coordinates_with_rates(x)
    names = [c.name for c in system.line.contacts_and_wheels]
    jets = before[:, np.stack([old.x, old.y], axis=1)]  # (3, contacts, 2)
    over = {car.name: system.car_point_and_rates(car.name, x) for car in system.line.over}
    now = line_snapshot(system.line, jets, before[:, old.s], over, lambda s: rope_at(old, before, np.array([s]))[:, 0])
    line, now = line_and_snapshot_after_passage(system.line, passage, x.t, x.phase, now)
    new = LineSines(line, old.functions - 2)
    layout = new.layout
    Z = new.prescribed(x.t, x.phase)
    for k, contact in enumerate(new.line.contacts_and_wheels):
        name = contact.name
        Z[:2, layout.s[k]] = now.s[name], now.ds[name]
        Z[:2, [layout.x[k], layout.y[k]]] = now.points[name][:2]
        if name not in names:
            continue
        j = names.index(name)
        Z[:2, layout.moving[k, 2:]] = before[:2, old.moving[j, 2:]]
        if j in system.free_cars:
            new.frictions[k] = system.frictions[j]
        if j in system.holds:
            new.holds[k] = system.holds[j]
    angles = _cabin_angles(system)
    for name, slot in _cabin_angles(new).items():
        Z[:2, slot] = before[:2, angles[name]]
    layout.set_followers(Z)
    if passage.car in system.layout.angle_off_rope and passage.car not in layout.angle_off_rope:
        # its velocity may jump; moments about the hanger keep their balance
        k, body = [c.name for c in new.line.contacts_and_wheels].index(passage.car), system.off_rope[passage.car].body
        angle = Z[0, layout.angle[k]]
        jump = Z[1, [layout.x[k], layout.y[k]]] - over[passage.car][1]
        along = jump @ np.array([np.cos(angle), -np.sin(angle)])
        Z[1, layout.angle[k]] -= body.m * body.h * along / body.about_hanger
    for i in range(layout.segments):
        _fit_coefficients(old, before, layout, Z, i)
    free = new.equations.free
    q, v = np.where(new.equations.forces, 0.0, Z[:2, free])
    state = State(x.t, q, v, np.zeros(new.n_dof), x.phase)
    new.begin_step(state)
    return new, new.with_acceleration(state)


def _cabin_angles(system: LineSines) -> dict[str, int]:
    """Coordinates of the angles of cabins that swing, by car."""
    cars = [(k, body.car) for k, body in system.cars.items() if body.car.hanger is not None]
    return {car.name: int(system.layout.angle[k]) for k, car in cars} | system.layout.angle_off_rope


def rope_at(layout: Layout, Z: Array, s: Array) -> Array:
    """r, r' and the velocity at fixed s (3, m, 2) at the points s (m,)."""
    at, ds = Z[:2, layout.s]
    i = np.clip(np.searchsorted(at, s, side="right") - 1, 0, layout.segments - 1)
    h = at[i + 1] - at[i]
    xi = (s - at[i]) / h
    B, slopes = basis_functions(xi, layout.functions - 2)[:2, :, None]  # (m, 1, M)
    u, du = Z[:2, layout.columns[i, :-2]].reshape(2, s.size, -1, 2)
    slope = (slopes @ u)[:, 0] / h[:, None]
    moved = ds[i] + xi * (ds[i + 1] - ds[i])
    return np.stack([(B @ u)[:, 0], slope, (B @ du)[:, 0] - moved[:, None] * slope])


def _fit_coefficients(old: Layout, before: Array, layout: Layout, Z: Array, i: int) -> None:
    """Set the functions of segment i in Z: nearest slopes, and then nearest velocities at fixed xi."""
    columns = layout.columns[i, :-2].reshape(-1, 2)
    (a, b), (da, db) = Z[:2, layout.s[[i, i + 1]]]
    _, slope, velocity = rope_at(old, before, a + layout.points * (b - a))
    moved = da + layout.points * (db - da)
    part = layout.functions_of[i]
    inner = slice(part.start // 2, layout.functions)
    root = np.sqrt(layout.weights)[:, None]
    wanted = slope * (b - a)
    for order, table in enumerate((layout.B[1], layout.B[0])):
        if order:
            wanted = velocity + moved[:, None] * (layout.B[1] @ Z[0, columns]) / (b - a)
        ends = table[:, -2:] @ Z[order, columns[-2:]]
        Z[order, columns[inner]] = np.linalg.lstsq(root * table[:, inner], root * (wanted - ends), rcond=None)[0]
