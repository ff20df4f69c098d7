"""What a line on elements does: `LineMotion` from a history of states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cablefem.elements.bodies import CarData, forces_on_cars
from cablefem.elements.off_rope import CarOffRope
from cablefem.elements.reference import lagrange_element, shape_polynomials
from cablefem.elements.segments import Motion, dot
from cablefem.elements.trolley import Trolley
from cablefem.motion import CarMotion, ContactMotion, LineMotion, Turning, WheelMotion
from cablefem.newmark import Array, State
from cablefem.scene.contacts import Car, Contact
from cablefem.shoes import OffRopeState, add_shoe_forces, downward_normals, off_rope_motion_and_powers

if TYPE_CHECKING:
    from cablefem.elements.system import LineElements


class _History:
    """All states of a run at once: n times, K segments."""

    def __init__(self, system: LineElements, states: Sequence[State]) -> None:
        self.system, self.segments = system, system.segments
        self.t = np.array([x.t for x in states])
        self.phase = [x.phase for x in states]
        coordinates = [system.coordinates_from_unknowns(*x) for x in states]
        motions = [system.segment_motion(x) for x in coordinates]
        self.q, self.v, self.a = (np.array([x[i] for x in coordinates]) for i in range(3))  # (n, size)
        self.all = Motion(*(np.concatenate([m[i] for m in motions]) for i in range(6)))  # n K segments
        self.points = self.segments.points(self.all)
        nodal_rows, ends = self.segments.residual(self.points)
        self.ends = self.split_by_time(ends)  # (2, n, K) rows of s
        slopes = self.segments.slopes_at_ends(self.all)
        self.slopes = self.split_by_time(slopes)  # (2, n, K, 2)
        self._set_end_forces(nodal_rows, slopes)

    def split_by_time(self, x: Array) -> Array:
        """(e, n K, ...) as (e, n, K, ...)."""
        return x.reshape(2, self.t.size, -1, *x.shape[2:])

    def _set_end_forces(self, nodal_rows: Array, end_slopes: Array) -> None:
        """N t at the ends of the segments (2, n, K, 2), by their balance, and rows of the end nodes."""
        ds, v = self.all.ds.T[..., None], self.all.v[:, [0, -1]].swapaxes(0, 1)
        flow = self.segments.rho * ds * (v - ds * end_slopes)
        rows = nodal_rows[:, [0, -1]].swapaxes(0, 1)
        self.balance_rows = self.split_by_time(rows)
        self.end_forces = self.split_by_time(np.stack([-(rows[0] + flow[0]), rows[1] - flow[1]]))

    def contact_points(self, k: int, x: Array) -> Array:
        """Points of contact k (n, 2), from coordinates (n, size)."""
        return x[:, 2 * self.system.node[k] + np.arange(2)]

    def behind_and_ahead(self, k: int, x: Array) -> tuple[Array, Array]:
        """Behind and ahead of contact k, of (2, n, K, ...); nan beyond the rope."""
        none = np.full_like(x[0, :, 0], np.nan)
        behind = x[1, :, k - 1] if k > 0 else none
        ahead = x[0, :, k] if k < x.shape[2] else none
        return behind, ahead

    def integral(self, density: Array) -> Array:
        """int density ds over the rope (n,), of (n K, G)."""
        return ((density * self.points.h) @ self.segments.weights).reshape(self.t.size, -1).sum(axis=1)


def observe(system: LineElements, states: Sequence[State], s: Array) -> LineMotion:
    """What the states show at the stations s (m,)."""
    x = _History(system, states)
    p = x.points
    kinetic = x.integral(0.5 * system.segments.rho * dot(p.w, p.w))
    powers: dict[str, Array] = {}
    strain, potential = x.integral(p.W), -x.integral(system.segments.q * p.y)
    contacts = tuple(_contact_motion(x, k, c) for k, c in zip(system.supports, system.line.supports, strict=True))
    for k in (0, -1):
        contact = system.line.supports[k]
        if contact.stiffness is not None:
            away = x.contact_points(k, x.q) - contact.point
            strain = strain + 0.5 * np.sum(np.array(contact.stiffness) * away**2, axis=1)
        if contact.force is not None:
            slot = system.s[k]
            force = system.counterweight_row(k, x.v[:, slot], x.a[:, slot])
            powers[f"{contact.name} weight"] = -force * x.v[:, slot]
    cars = _car_motions(x, powers) if system.cars else ()
    for off_rope in system.off_rope.values():
        state = _state_off_rope(x, off_rope, states)
        motion, powers_off = off_rope_motion_and_powers(system.line, off_rope.car, states, state, contacts)
        powers |= powers_off
        cars += (motion,)
    for car, motion in zip((*system.line.cars, *system.line.over), cars, strict=True):
        kinetic = kinetic + _car_kinetic_energy(car, motion)
        potential = potential - car.mass * system.line.gravity * motion.point[:, 1]
        if motion.turning is not None:
            hung = car.mass if car.hanger is None else car.hanger.mass
            below = motion.turning.centre - motion.point
            potential = potential - hung * system.line.gravity * below[:, 1]
    points, tension = _points_and_tensions(x, s)
    return LineMotion(
        t=x.t, cars=cars, contacts=add_shoe_forces(system.line, cars, contacts), s=s, points=points, tension=tension,
        kinetic=kinetic, strain=strain, potential=potential, powers=powers,
    )  # fmt: skip


def _car_kinetic_energy(car: Car, motion: CarMotion) -> Array:
    """Kinetic energy (n,) [J] of a car."""
    turning, body = motion.turning, car.hanger or car.wheels
    if turning is None or body is None:
        return 0.5 * car.mass * dot(motion.velocity, motion.velocity)
    mass = car.mass if car.hanger is None else car.hanger.mass
    below = turning.centre - motion.point
    # a swing forward turns from down to the right, a pitch from the right to down
    sense = 1.0 if car.hanger is None else -1.0
    across = sense * np.stack([-below[:, 1], below[:, 0]], axis=1)
    centre = motion.velocity + turning.rate[:, None] * across
    at_point = (car.mass - mass) * dot(motion.velocity, motion.velocity)
    return 0.5 * (at_point + mass * dot(centre, centre) + body.inertia * turning.rate**2)


def _contact_motion(x: _History, k: int, contact: Contact) -> ContactMotion:
    slot = x.system.s[k]
    behind, ahead = x.behind_and_ahead(k, x.end_forces)
    pressure = -np.sum(np.nan_to_num(x.behind_and_ahead(k, x.balance_rows)), axis=0)
    rise = np.full(x.t.size, np.nan)
    if contact.force is not None:
        taken_in = (x.q[:, slot] - x.q[0, slot]) * (1.0 if k else -1.0)
        rise = (1.0 + contact.force / x.system.line.rope.EA) * taken_in
    return ContactMotion(
        name=contact.name, kind=contact.kind, s=x.q[:, slot], ds=x.v[:, slot], point=x.contact_points(k, x.q),
        tension_behind=np.linalg.norm(behind, axis=1), tension_ahead=np.linalg.norm(ahead, axis=1), pressure=pressure,
        rise=rise,
    )  # fmt: skip


def _car_motions(x: _History, powers: dict[str, Array]) -> tuple[CarMotion, ...]:
    """Motion of the cars; adds their powers."""
    system = x.system
    ks, slots = np.array(system.cars), system.s[system.cars]
    behind, ahead = x.slopes[1][:, ks - 1], x.slopes[0][:, ks]  # of two wheels at the front one
    velocity, acceleration = (np.stack([x.contact_points(k, z) for k in ks], axis=1) for z in (x.v, x.a))
    F_and_swing = np.zeros((x.t.size, ks.size, 4))
    F_and_swing[:, system.of_force, 0] = x.a[:, system.force]
    F_and_swing[:, system.of_swing, 1:] = np.stack([z[:, system.swing] for z in (x.q, x.v, x.a)], axis=2)
    data = _car_data(x, x.q[:, slots], x.v[:, slots])
    on = forces_on_cars(data, np.concatenate([behind, ahead, velocity, acceleration, F_and_swing], axis=2))
    trolleys = {trolley.i: trolley for trolley in system.trolleys}
    along = np.sum(on.tau * velocity, axis=2)
    rows = x.ends[1][:, ks - 1] + x.ends[0][:, ks]
    none = np.full(x.t.size, np.nan)
    out = []
    for i, (k, car) in enumerate(zip(ks.tolist(), system.line.cars, strict=True)):
        ds = x.v[:, slots[i]]
        if i in trolleys:
            out.append(_trolley_motion(x, trolleys[i], data, rows[:, i], powers))
            continue
        grips, hauled = car.drive_kind == "grip", car.drive.mode == "haul"
        powers[f"{car.name} friction"] = on.stretch[:, i] * on.friction[:, i] * ds
        powers[f"{car.name} drag"] = on.air_power[:, i]
        point = x.contact_points(k, x.q)
        turning = None if car.hanger is None else _swing_motion(F_and_swing[:, i, 1:], point, data.arm[i])
        if turning is not None:
            powers[f"{car.name} swing"] = -data.resistance[i] * turning.rate**2
        if grips:
            powers[f"{car.name} grip"] = rows[:, i] * ds
            del powers[f"{car.name} friction"], powers[f"{car.name} drag"]
        if hauled:
            powers[f"{car.name} haul"] = on.haul[:, i] * along[:, i]
        if car.drive_kind == "free":
            powers[f"{car.name} thrust"] = data.thrust[:, i] * along[:, i]
            powers[f"{car.name} hold"] = on.stretch[:, i] * data.hold[:, i] * ds
        tension = [np.linalg.norm(z, axis=1) for z in x.behind_and_ahead(k, x.end_forces)]
        from_rope = np.sum(x.behind_and_ahead(k, x.balance_rows), axis=0)
        on_shoe = _force_on_shoe(car, point, from_rope + on.contact[:, i])
        out.append(CarMotion(
            name=car.name, s=x.q[:, slots[i]], ds=ds, point=point, velocity=velocity[:, i],
            acceleration=acceleration[:, i], tension_behind=tension[0], tension_ahead=tension[1],
            slope_behind=behind[:, i], slope_ahead=ahead[:, i], haul_force=on.haul[:, i] if hauled else none,
            grip_force=rows[:, i] / on.stretch[:, i] if grips else none, contact_force=on.normal[:, i],
            shoe_force=on_shoe, turning=turning,
        ))  # fmt: skip
    return tuple(out)


def _state_off_rope(x: _History, off_rope: CarOffRope, states: Sequence[State]) -> OffRopeState:
    """A car off the rope at all states."""
    name, hanger, z = off_rope.car.name, off_rope.car.hanger, np.array([x.q, x.v, x.a])
    points = np.array([x.system.car_point_and_rates(name, state) for state in states])
    on, powers, turning = off_rope.forces(points, z), dict[str, Array](), None
    if not off_rope.grips:
        powers["drag"] = on.air_power[:, 0]
    if hanger is not None:
        turning = _swing_motion(z[..., off_rope.swing].T, points[:, 0], hanger.length)
        powers["swing"] = -off_rope.resistance * turning.rate**2
    return OffRopeState(points, on.contact[:, 0], powers, turning)


def _swing_motion(history: Array, point: Array, arm: float) -> Turning:
    """Swing of a cabin; history : its angle, rate and acceleration (n, 3); arm [m] from the point (n, 2)."""
    angle, rate, faster = history.T
    out_of = arm * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    return Turning(angle=angle, rate=rate, acceleration=faster, centre=point + out_of)


def _force_on_shoe(car: Car, point: Array, missing: Array) -> Array:
    """Force (n,) [N] of a car on the shoe that guides it; missing : what the rope does not give (n, 2)."""
    if car.rail is None:
        return np.zeros(len(point))
    return -dot(missing, downward_normals(car.rail, point[:, 0]))


def _trolley_motion(x: _History, trolley: Trolley, data: CarData, grip: Array, powers: dict[str, Array]) -> CarMotion:
    """Motion of a car on two wheels; adds its powers.  grip : row of s of the front wheel (n,)."""
    system, car, pair = x.system, trolley.car, [trolley.k - 1, trolley.k]
    nodes, slots = np.array(pair), system.s[pair]
    P = x.balance_rows[1][:, nodes - 1] + x.balance_rows[0][:, nodes]
    n = x.t.size
    on = trolley.forces(data, trolley.force_inputs((x.q, x.v, x.a), P.reshape(n, 4)))
    sides = trolley.rope_slopes(x.q).reshape(n, 2, 2, 2)  # of each wheel, behind and ahead
    s, ds = x.q[:, slots], x.v[:, slots]
    tensions = [[np.linalg.norm(z, axis=1) for z in x.behind_and_ahead(k, x.end_forces)] for k in pair]
    wheels = tuple(
        WheelMotion(
            name=system.line.contacts_and_wheels[k].name, s=s[:, j], ds=ds[:, j],
            point=x.contact_points(k, x.q), load=on.loads[j],
            tension_behind=tensions[j][0], tension_ahead=tensions[j][1], slope_behind=sides[:, j, 0],
            slope_ahead=sides[:, j, 1],
        )
        for j, k in enumerate(pair)
    )  # fmt: skip
    angle, rate, faster = (z[:, trolley.body[2]] for z in (x.q, x.v, x.a))
    centre = x.contact_points(trolley.k, x.q) + np.stack(on.centre, axis=1)
    turning = Turning(angle=angle, rate=rate, acceleration=faster, centre=centre, wheels=wheels)
    none = np.full(n, np.nan)
    grips, hauled = car.drive_kind == "grip", car.drive.mode == "haul"
    if grips:
        powers[f"{car.name} grip"] = grip * ds[:, 1]
    else:
        powers[f"{car.name} friction"] = on.friction[0] * ds[:, 0] + on.friction[1] * ds[:, 1]
        powers[f"{car.name} drag"] = on.drag
    if hauled:
        powers[f"{car.name} haul"] = on.haul
    if car.drive_kind == "free":
        powers[f"{car.name} thrust"] = on.thrust
        powers[f"{car.name} hold"] = on.hold * ds[:, 1]
    velocity, acceleration = (x.contact_points(trolley.k, z) for z in (x.v, x.a))
    return CarMotion(
        name=car.name, s=s[:, 1], ds=ds[:, 1], point=wheels[1].point, velocity=velocity, acceleration=acceleration,
        tension_behind=wheels[0].tension_behind, tension_ahead=wheels[1].tension_ahead,
        slope_behind=wheels[0].slope_behind, slope_ahead=wheels[1].slope_ahead,
        haul_force=car.mass * x.a[:, trolley.force] if hauled else none,
        grip_force=grip / on.stretch if grips else none, contact_force=on.loads[0] + on.loads[1],
        shoe_force=np.zeros(n), turning=turning,
    )  # fmt: skip


def _car_data(x: _History, s: Array, ds: Array) -> CarData:
    """Data of the cars at all times, (n, cars)."""
    system = x.system
    each = [system.car_data(t, phase) for t, phase in zip(x.t.tolist(), x.phase, strict=True)]
    changing: dict[str, Any] = {name: np.array([getattr(y, name) for y in each]) for name in ("thrust", "hold")}
    drives = [car.drive for car in system.line.cars]
    before_jump = np.append(np.diff(x.t) <= 0.0, False)
    s = s - 1e-9 * before_jump[:, None]  # of two states at a brake the first is short of it
    brakes = [drive.brake_force(s[:, i]) + 0.0 * ds[:, i] for i, drive in enumerate(drives)]
    rear = [drive.rear_brake_force(s[:, i]) + 0.0 * ds[:, i] for i, drive in enumerate(drives)]
    sign = np.where(ds == 0.0, each[0].sign, np.sign(ds))
    return each[0]._replace(**changing, brake=np.stack(brakes, axis=1), rear_brake=np.stack(rear, axis=1), sign=sign)


def _points_and_tensions(x: _History, s: Array) -> tuple[Array, Array]:
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
    tension = x.system.line.rope.EA * (np.linalg.norm(slope, axis=2) - 1.0)
    points[~inside], tension[~inside] = np.nan, np.nan
    return points, tension
