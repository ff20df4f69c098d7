"""What a line on elements does: `LineMotion` from a history of states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cablefem.elements.bodies import Cars, forces
from cablefem.elements.reference import lagrange_element, shape_polynomials
from cablefem.elements.segments import Motion, dot
from cablefem.motion import CarMotion, ContactMotion, LineMotion
from cablefem.newmark import Array, State
from cablefem.scene.contacts import Contact

if TYPE_CHECKING:
    from cablefem.elements.system import LineElements


class _History:
    """All states of a run at once: n times, K segments."""

    def __init__(self, system: LineElements, states: Sequence[State]) -> None:
        self.system, self.segments = system, system.segments
        self.t = np.array([x.t for x in states])
        self.phase = [x.phase for x in states]
        slots = [system.slots(*x) for x in states]
        motions = [system.motion(x) for x in slots]
        self.q, self.v, self.a = (np.array([x[i] for x in slots]) for i in range(3))  # (n, size)
        self.all = Motion(*(np.concatenate([m[i] for m in motions]) for i in range(6)))  # n K segments
        self.points = self.segments.points(self.all)
        nodes, ends = self.segments.residual(self.points)
        self.ends = self.by_time(ends)  # (2, n, K) rows of s
        slopes = self.segments.slopes_at_ends(self.all)
        self.slopes = self.by_time(slopes)  # (2, n, K, 2)
        self._pulls(nodes, slopes)

    def by_time(self, x: Array) -> Array:
        """(e, n K, ...) as (e, n, K, ...)."""
        return x.reshape(2, self.t.size, -1, *x.shape[2:])

    def _pulls(self, nodes: Array, slopes: Array) -> None:
        """N t at the ends of the segments (2, n, K, 2), by their balance, and rows of the end nodes."""
        ds, v = self.all.ds.T[..., None], self.all.v[:, [0, -1]].swapaxes(0, 1)
        flow = self.segments.rho * ds * (v - ds * slopes)
        rows = nodes[:, [0, -1]].swapaxes(0, 1)
        self.rows = self.by_time(rows)
        self.pulls = self.by_time(np.stack([-(rows[0] + flow[0]), rows[1] - flow[1]]))

    def at(self, k: int, x: Array) -> Array:
        """Points of contact k (n, 2), of slots (n, size)."""
        return x[:, 2 * self.system.node[k] + np.arange(2)]

    def beside(self, k: int, x: Array) -> tuple[Array, Array]:
        """Behind and ahead of contact k, of (2, n, K, ...); nan beyond the rope."""
        none = np.full_like(x[0, :, 0], np.nan)
        behind = x[1, :, k - 1] if k > 0 else none
        ahead = x[0, :, k] if k < x.shape[2] else none
        return behind, ahead

    def total(self, density: Array) -> Array:
        """int density ds over the rope (n,), of (n K, G)."""
        return ((density * self.points.h) @ self.segments.weights).reshape(self.t.size, -1).sum(axis=1)


def observe(system: LineElements, states: Sequence[State], s: Array) -> LineMotion:
    """What the states show at the stations s (m,)."""
    x = _History(system, states)
    p, rope = x.points, system.line.rope
    kinetic = x.total(0.5 * system.segments.rho * dot(p.w, p.w))
    powers = {"damping": -2.0 * rope.damping * kinetic} if rope.damping else {}
    strain, potential = x.total(p.W), -x.total(system.segments.q * p.y)
    supports = [k for k in range(len(system.line.contacts)) if k not in system.cars]
    contacts = tuple(_contact(x, k, c) for k, c in zip(supports, system.line.supports, strict=True))
    for k in (0, -1):
        contact = system.line.supports[k]
        if contact.stiffness is not None:
            away = x.at(k, x.q) - contact.point
            strain = strain + 0.5 * np.sum(np.array(contact.stiffness) * away**2, axis=1)
            kinetic = kinetic + 0.5 * (contact.mass or 0.0) * np.sum(x.at(k, x.v) ** 2, axis=1)
        if contact.force is not None:
            slot = system.s[k]
            force = [system.pulley(k, v[slot], a[slot]) for v, a in zip(x.v, x.a, strict=True)]
            powers[f"{contact.name} weight"] = -np.array(force) * x.v[:, slot]
    cars = _cars(x, powers) if system.cars else ()
    for car, k in zip(system.line.cars, system.cars, strict=True):
        kinetic = kinetic + 0.5 * car.mass * np.sum(x.at(k, x.v) ** 2, axis=1)
        potential = potential - car.mass * system.line.gravity * x.at(k, x.q)[:, 1]
    points, tension = _stations(x, s)
    return LineMotion(
        t=x.t, cars=cars, contacts=contacts, s=s, points=points, tension=tension, kinetic=kinetic, strain=strain,
        potential=potential, powers=powers,
    )  # fmt: skip


def _contact(x: _History, k: int, contact: Contact) -> ContactMotion:
    slot = x.system.s[k]
    behind, ahead = x.beside(k, x.pulls)
    pressure = -np.sum(np.nan_to_num(x.beside(k, x.rows)), axis=0)
    rise = np.full(x.t.size, np.nan)
    if contact.force is not None:
        taken_in = (x.q[:, slot] - x.q[0, slot]) * (1.0 if k else -1.0)
        rise = (1.0 + contact.force / x.system.line.rope.EA) * taken_in
    return ContactMotion(
        name=contact.name, kind=contact.kind, s=x.q[:, slot], ds=x.v[:, slot], point=x.at(k, x.q),
        tension_behind=np.linalg.norm(behind, axis=1), tension_ahead=np.linalg.norm(ahead, axis=1), pressure=pressure,
        rise=rise,
    )  # fmt: skip


def _cars(x: _History, powers: dict[str, Array]) -> tuple[CarMotion, ...]:
    """Motion of the cars; adds their powers."""
    system = x.system
    ks, slots = np.array(system.cars), system.s[system.cars]
    behind, ahead = x.slopes[1][:, ks - 1], x.slopes[0][:, ks]
    velocity, acceleration = (np.stack([x.at(k, z) for k in ks], axis=1) for z in (x.v, x.a))
    F = np.zeros((x.t.size, ks.size, 1))
    F[:, system.of_force, 0] = x.a[:, system.force]
    data = _car_data(x, x.q[:, slots], x.v[:, slots])
    on = forces(data, np.concatenate([behind, ahead, velocity, acceleration, F], axis=2))
    along = np.sum(on.tau * velocity, axis=2)
    rows = x.ends[1][:, ks - 1] + x.ends[0][:, ks]
    none = np.full(x.t.size, np.nan)
    out = []
    for i, (k, car) in enumerate(zip(ks.tolist(), system.line.cars, strict=True)):
        ds = x.v[:, slots[i]]
        grips, hauled = car.kind == "grip", car.drive.mode == "haul"
        powers[f"{car.name} friction"] = on.stretch[:, i] * on.friction[:, i] * ds
        powers[f"{car.name} drag"] = np.sum(on.drag[:, i] * velocity[:, i], axis=1)
        if grips:
            powers[f"{car.name} grip"] = rows[:, i] * ds
            del powers[f"{car.name} friction"], powers[f"{car.name} drag"]
        if hauled:
            powers[f"{car.name} haul"] = on.haul[:, i] * along[:, i]
        if car.kind == "free":
            powers[f"{car.name} thrust"] = data.thrust[:, i] * along[:, i]
            powers[f"{car.name} hold"] = on.stretch[:, i] * data.hold[:, i] * ds
        tension = [np.linalg.norm(z, axis=1) for z in x.beside(k, x.pulls)]
        out.append(CarMotion(
            name=car.name, s=x.q[:, slots[i]], ds=ds, point=x.at(k, x.q), velocity=velocity[:, i],
            acceleration=acceleration[:, i], tension_behind=tension[0], tension_ahead=tension[1],
            slope_behind=behind[:, i], slope_ahead=ahead[:, i], haul_force=on.haul[:, i] if hauled else none,
            grip_force=rows[:, i] / on.stretch[:, i] if grips else none, contact_force=on.normal[:, i],
        ))  # fmt: skip
    return tuple(out)


def _car_data(x: _History, s: Array, ds: Array) -> Cars:
    """Data of the cars at all times, (n, cars)."""
    system = x.system
    each = [system.car_data(t, phase) for t, phase in zip(x.t.tolist(), x.phase, strict=True)]
    changing: dict[str, Any] = {name: np.array([getattr(y, name) for y in each]) for name in ("thrust", "hold")}
    brakes = [car.drive.brake(s[:, i]) + 0.0 * ds[:, i] for i, car in enumerate(system.line.cars)]
    sign = np.where(ds == 0.0, each[0].sign, np.sign(ds))
    return each[0]._replace(**changing, brake=np.stack(brakes, axis=1), sign=sign)


def _stations(x: _History, s: Array) -> tuple[Array, Array]:
    """Points (n, m, 2) and tensions (n, m) at s (m,)."""
    segments, elements = x.segments, x.segments.elements
    at = x.q[:, x.system.s]  # (n, K + 1)
    segment = np.array([np.searchsorted(row[1:-1], s, side="left") for row in at])  # (n, m)
    begin, end = (np.take_along_axis(at[:, i:], segment, axis=1) for i in (0, 1))
    xi = (s - begin) / (end - begin)
    inside = (xi >= 0.0) & (xi <= 1.0)
    element = np.clip((xi * elements).astype(int), 0, elements - 1)
    local = xi * elements - element
    shapes = shape_polynomials(lagrange_element(segments.degree)).T
    r = x.all.r.reshape(*at[:, 1:].shape, segments.nn, 2)
    nodal = r[np.arange(at.shape[0])[:, None, None], segment[..., None], segments.dofs[element]]  # (n, m, n_loc, 2)
    points = np.einsum("lnm,nmla->nma", polyval(local, shapes), nodal)
    slope = np.einsum("lnm,nmla->nma", polyval(local, polyder(shapes)), nodal) * (elements / (end - begin))[..., None]
    N_r, _ = x.system.line.rope.at_rest(np.broadcast_to(s, xi.shape))
    tension = N_r + x.system.line.rope.EA * (np.linalg.norm(slope, axis=2) - 1.0)
    points[~inside], tension[~inside] = np.nan, np.nan
    return points, tension
