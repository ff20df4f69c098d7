"""What a line on elements does: `LineMotion` from a history of states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cablefem.elements.bodies import INPUTS, CarLoadsAndMasses, ForcesOnCars, forces_on_cars
from cablefem.elements.off_rope import CarOffRope
from cablefem.elements.reference import lagrange_element, shape_polynomial_coefficients
from cablefem.elements.segments import Motion, dot
from cablefem.elements.trolley import Trolley
from cablefem.motion import CarMotion, ContactMotion, LineMotion, Turning, WheelMotion
from cablefem.newmark import Array, State
from cablefem.scene.contacts import Car, Contact
from cablefem.shoes import OffRopeState, contacts_with_shoe_forces, downward_normals, off_rope_motion_and_powers

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
        self.points = self.segments.fields_of_motion(self.all)
        nodal_rows, ends = self.segments.node_and_end_rows(self.points)
        self.ends = self.split_by_time(ends)  # (2, n, K) rows of s
        slopes = self.segments.slopes_at_ends(self.all)
        self.slopes = self.split_by_time(slopes)  # (2, n, K, 2)
        self._set_end_forces(nodal_rows, slopes)

    def split_by_time(self, values: Array) -> Array:
        """(e, n K, ...) as (e, n, K, ...)."""
        return values.reshape(2, self.t.size, -1, *values.shape[2:])

    def _set_end_forces(self, nodal_rows: Array, end_slopes: Array) -> None:
        """N t at the ends of the segments (2, n, K, 2), by their balance, and rows of the end nodes."""
        ds, v = self.all.ds.T[..., None], self.all.v[:, [0, -1]].swapaxes(0, 1)
        flow = self.segments.rho * ds * (v - ds * end_slopes)
        rows = nodal_rows[:, [0, -1]].swapaxes(0, 1)
        self.balance_rows = self.split_by_time(rows)
        self.end_forces = self.split_by_time(np.stack([-(rows[0] + flow[0]), rows[1] - flow[1]]))

    def contact_points(self, k: int, coordinates: Array) -> Array:
        """Points of contact k (n, 2), or their rates, from coordinates (n, size)."""
        return coordinates[:, 2 * self.system.node[k] + np.arange(2)]

    def behind_and_ahead(self, k: int, segment_ends: Array) -> tuple[Array, Array]:
        """Values beside contact k, of those at the ends of segments (2, n, K, ...); nan beyond the rope."""
        none = np.full_like(segment_ends[0, :, 0], np.nan)
        behind = segment_ends[1, :, k - 1] if k > 0 else none
        ahead = segment_ends[0, :, k] if k < segment_ends.shape[2] else none
        return behind, ahead

    def integral_over_rope(self, density: Array) -> Array:
        """int density ds over the rope (n,), of (n K, G)."""
        return ((density * self.points.h) @ self.segments.weights).reshape(self.t.size, -1).sum(axis=1)


def observe_line(system: LineElements, states: Sequence[State], s: Array) -> LineMotion:
    """What the states show, with the rope at the stations s (m,)."""
    x = _History(system, states)
    contacts = tuple(_contact_motion(x, k, c) for k, c in zip(system.supports, system.line.supports, strict=True))
    cars, car_powers = _car_motions_and_powers(x)
    powers = _counterweight_powers(x) | car_powers
    for off_rope in system.off_rope.values():
        state = _state_off_rope(x, off_rope, states)
        motion, powers_off = off_rope_motion_and_powers(system.line, off_rope.car, states, state, contacts)
        powers |= powers_off
        cars += (motion,)
    p = x.points
    kinetic = x.integral_over_rope(0.5 * system.segments.rho * dot(p.w, p.w))
    potential = -x.integral_over_rope(system.segments.q * p.y)
    for car, motion in zip((*system.line.cars_on_rope, *system.line.cars_off_rope), cars, strict=True):
        kinetic = kinetic + _car_kinetic_energy(car, motion)
        potential = potential - car.mass * system.line.gravity * motion.point[:, 1]
        if motion.turning is not None:
            hung = car.mass if car.hanger is None else car.hanger.mass
            below = motion.turning.centre - motion.point
            potential = potential - hung * system.line.gravity * below[:, 1]
    points, tension = _rope_points_and_tensions(x, s)
    return LineMotion(
        t=x.t, cars=cars, contacts=contacts_with_shoe_forces(system.line, cars, contacts),
        s=s, points=points, tension=tension,
        kinetic=kinetic, strain=_rope_and_spring_energy(x), potential=potential, powers=powers,
    )  # fmt: skip


def _rope_and_spring_energy(x: _History) -> Array:
    """Energy (n,) [J] of the rope and of springs at its ends."""
    energy = x.integral_over_rope(x.points.W)
    for k in (0, -1):
        support = x.system.line.supports[k]
        if support.stiffness is not None:
            away = x.contact_points(k, x.q) - support.point
            energy = energy + 0.5 * np.sum(np.array(support.stiffness) * away**2, axis=1)
    return energy


def _counterweight_powers(x: _History) -> dict[str, Array]:
    """Power (n,) [W] of each counterweight on the rope, by "NAME weight"."""
    powers = {}
    for k in (0, -1):
        support = x.system.line.supports[k]
        if support.force is not None:
            slot = x.system.s[k]
            force = x.system.counterweight_row(k, x.v[:, slot], x.a[:, slot])
            powers[f"{support.name} weight"] = -force * x.v[:, slot]
    return powers


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


def _car_motions_and_powers(x: _History) -> tuple[tuple[CarMotion, ...], dict[str, Array]]:
    """Motion of the cars on the rope, and powers (n,) [W] by "NAME force"."""
    system = x.system
    if not system.cars:
        return (), {}
    k = np.array(system.cars)
    slots = system.s[k]
    cars = _car_loads_and_masses_over_time(x, x.q[:, slots], x.v[:, slots])
    inputs = _car_force_inputs(x)
    on = forces_on_cars(cars, inputs)
    rows = x.ends[1][:, k - 1] + x.ends[0][:, k]
    trolleys = {trolley.i: trolley for trolley in system.trolleys}
    motions = []
    powers: dict[str, Array] = {}
    for i, car in enumerate(system.line.cars_on_rope):
        if i in trolleys:
            motion, of_car = _trolley_motion_and_powers(x, trolleys[i], cars, rows[:, i])
        else:
            motion, of_car = _point_car_motion_and_powers(x, i, cars, inputs[:, i], on, rows[:, i])
        motions.append(motion)
        powers |= {f"{car.name} {force}": power for force, power in of_car.items()}
    return tuple(motions), powers


def _car_force_inputs(x: _History) -> Array:
    """Inputs (n, cars, INPUTS) of `bodies.forces_on_cars`; of two wheels those of the front one."""
    system, k = x.system, np.array(x.system.cars)
    inputs = np.zeros((x.t.size, k.size, INPUTS))
    inputs[..., 0:2] = x.slopes[1][:, k - 1]
    inputs[..., 2:4] = x.slopes[0][:, k]
    for first, z in ((4, x.v), (6, x.a)):
        inputs[..., first : first + 2] = np.stack([x.contact_points(contact, z) for contact in k], axis=1)
    inputs[:, system.of_force, 8] = x.a[:, system.force]
    inputs[:, system.of_swing, 9:12] = np.stack([z[:, system.swing] for z in (x.q, x.v, x.a)], axis=2)
    return inputs


def _point_car_motion_and_powers(
    x: _History, i: int, cars: CarLoadsAndMasses, inputs: Array, on: ForcesOnCars, row: Array
) -> tuple[CarMotion, dict[str, Array]]:
    """Motion of car i, which stands on one contact, and its powers; inputs (n, INPUTS), and its row of s (n,)."""
    k, car = x.system.cars[i], x.system.line.cars_on_rope[i]
    slot = x.system.s[k]
    ds, velocity = x.v[:, slot], inputs[:, 4:6]
    grips, hauled = car.drive_kind == "grip", car.drive.mode == "haul"
    point, along = x.contact_points(k, x.q), np.sum(on.tau[:, i] * velocity, axis=1)
    turning = None if car.hanger is None else _swing_motion(inputs[:, 9:12], point, cars.arm[i])
    powers = {}
    if not grips:
        powers["friction"] = on.stretch[:, i] * on.friction[:, i] * ds
        powers["drag"] = on.air_power[:, i]
    if turning is not None:
        powers["swing"] = -cars.resistance[i] * turning.rate**2
    if grips:
        powers["grip"] = row * ds
    if hauled:
        powers["haul"] = on.haul[:, i] * along
    if car.drive_kind == "free":
        powers["thrust"] = cars.thrust[:, i] * along
        powers["hold"] = on.stretch[:, i] * cars.hold[:, i] * ds
    tension = [np.linalg.norm(z, axis=1) for z in x.behind_and_ahead(k, x.end_forces)]
    from_rope = np.sum(x.behind_and_ahead(k, x.balance_rows), axis=0)
    none = np.full(x.t.size, np.nan)
    motion = CarMotion(
        name=car.name, s=x.q[:, slot], ds=ds, point=point, velocity=velocity, acceleration=inputs[:, 6:8],
        tension_behind=tension[0], tension_ahead=tension[1], slope_behind=inputs[:, 0:2], slope_ahead=inputs[:, 2:4],
        haul_force=on.haul[:, i] if hauled else none, grip_force=row / on.stretch[:, i] if grips else none,
        contact_force=on.normal[:, i], shoe_force=_force_on_shoe(car, point, from_rope + on.contact[:, i]),
        turning=turning,
    )  # fmt: skip
    return motion, powers


def _state_off_rope(x: _History, off_rope: CarOffRope, states: Sequence[State]) -> OffRopeState:
    """A car off the rope at all states."""
    name = off_rope.car.name
    hanger = off_rope.car.hanger
    z = np.array([x.q, x.v, x.a])
    points = np.array([x.system.car_point_and_rates(name, state) for state in states])
    on = off_rope.forces(points, z)
    powers: dict[str, Array] = {}
    turning = None
    if not off_rope.grips:
        powers["drag"] = on.air_power[:, 0]
    if hanger is not None:
        turning = _swing_motion(z[..., off_rope.swing].T, points[:, 0], hanger.length)
        powers["swing"] = -off_rope.resistance * turning.rate**2
    return OffRopeState(points, on.contact[:, 0], powers, turning)


def _swing_motion(swing: Array, point: Array, arm: float) -> Turning:
    """Swing of a cabin, from its angle, rate and acceleration (n, 3); arm [m] from the point (n, 2)."""
    angle, rate, acceleration = swing.T
    below = arm * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    return Turning(angle=angle, rate=rate, acceleration=acceleration, centre=point + below)


def _force_on_shoe(car: Car, point: Array, missing_force: Array) -> Array:
    """Force (n,) [N] of a car on the shoe that guides it, 0 without one; missing_force : not from the rope (n, 2)."""
    if car.rail is None:
        return np.zeros(len(point))
    return -dot(missing_force, downward_normals(car.rail, point[:, 0]))


def _trolley_motion_and_powers(
    x: _History, trolley: Trolley, cars: CarLoadsAndMasses, row: Array
) -> tuple[CarMotion, dict[str, Array]]:
    """Motion of a car on two wheels, and its powers; row : of s of the front wheel (n,)."""
    car, pair = trolley.car, np.array([trolley.k - 1, trolley.k])
    P = x.balance_rows[1][:, pair - 1] + x.balance_rows[0][:, pair]
    n = x.t.size
    on = trolley.forces(cars, trolley.force_inputs((x.q, x.v, x.a), P.reshape(n, 4)))
    rear, front = _wheel_motions(x, trolley, on.loads)
    angle, rate, angular_acceleration = (z[:, trolley.body[2]] for z in (x.q, x.v, x.a))
    turning = Turning(
        angle=angle, rate=rate, acceleration=angular_acceleration, centre=front.point + np.stack(on.centre, axis=1),
        wheels=(rear, front),
    )  # fmt: skip
    grips, hauled = car.drive_kind == "grip", car.drive.mode == "haul"
    if grips:
        powers = {"grip": row * front.ds}
    else:
        powers = {"friction": on.friction[0] * rear.ds + on.friction[1] * front.ds, "drag": on.drag}
    if hauled:
        powers["haul"] = on.haul
    if car.drive_kind == "free":
        powers["thrust"] = on.thrust
        powers["hold"] = on.hold * front.ds
    velocity, acceleration = (x.contact_points(trolley.k, z) for z in (x.v, x.a))
    none = np.full(n, np.nan)
    motion = CarMotion(
        name=car.name, s=front.s, ds=front.ds, point=front.point, velocity=velocity, acceleration=acceleration,
        tension_behind=rear.tension_behind, tension_ahead=front.tension_ahead, slope_behind=rear.slope_behind,
        slope_ahead=front.slope_ahead, haul_force=car.mass * x.a[:, trolley.force] if hauled else none,
        grip_force=row / on.stretch if grips else none, contact_force=on.loads[0] + on.loads[1],
        shoe_force=np.zeros(n), turning=turning,
    )  # fmt: skip
    return motion, powers


def _wheel_motions(x: _History, trolley: Trolley, loads: Sequence[Array]) -> list[WheelMotion]:
    """Of the rear wheel and of the front one."""
    sides = trolley.rope_slopes_at_wheels(x.q).reshape(x.t.size, 2, 2, 2)  # of each wheel, behind and ahead
    wheels = []
    for j, k in enumerate((trolley.k - 1, trolley.k)):
        slot = x.system.s[k]
        behind, ahead = (np.linalg.norm(z, axis=1) for z in x.behind_and_ahead(k, x.end_forces))
        wheels.append(WheelMotion(
            name=x.system.line.contacts_and_wheels[k].name, s=x.q[:, slot], ds=x.v[:, slot],
            point=x.contact_points(k, x.q), load=loads[j], tension_behind=behind, tension_ahead=ahead,
            slope_behind=sides[:, j, 0], slope_ahead=sides[:, j, 1],
        ))  # fmt: skip
    return wheels


def _car_loads_and_masses_over_time(x: _History, s: Array, ds: Array) -> CarLoadsAndMasses:
    """Data of the cars at all times, (n, cars)."""
    system = x.system
    each = [system.car_loads_and_masses(t, phase) for t, phase in zip(x.t.tolist(), x.phase, strict=True)]
    changing: dict[str, Any] = {name: np.array([getattr(y, name) for y in each]) for name in ("thrust", "hold")}
    drives = [car.drive for car in system.line.cars_on_rope]
    before_jump = np.append(np.diff(x.t) <= 0.0, False)
    s = s - 1e-9 * before_jump[:, None]  # of two states at a brake the first is short of it
    brakes = [drive.brake_force(s[:, i]) + 0.0 * ds[:, i] for i, drive in enumerate(drives)]
    rear = [drive.rear_brake_force(s[:, i]) + 0.0 * ds[:, i] for i, drive in enumerate(drives)]
    sign = np.where(ds == 0.0, each[0].sign, np.sign(ds))
    return each[0]._replace(**changing, brake=np.stack(brakes, axis=1), rear_brake=np.stack(rear, axis=1), sign=sign)


def _rope_points_and_tensions(x: _History, s: Array) -> tuple[Array, Array]:
    """Points (n, m, 2) and tensions (n, m) at s (m,)."""
    segments, elements = x.segments, x.segments.elements
    at = x.q[:, x.system.s]  # (n, K + 1)
    segment = np.array([np.searchsorted(row[1:-1], s, side="left") for row in at])  # (n, m)
    begin, end = (np.take_along_axis(at[:, i:], segment, axis=1) for i in (0, 1))
    xi = (s - begin) / (end - begin)
    inside = (xi >= 0.0) & (xi <= 1.0)
    element = np.clip((xi * elements).astype(int), 0, elements - 1)
    local = xi * elements - element
    shapes = shape_polynomial_coefficients(lagrange_element(segments.degree)).T
    r = x.all.r.reshape(*at[:, 1:].shape, segments.nn, 2)
    nodal = r[np.arange(at.shape[0])[:, None, None], segment[..., None], segments.dofs[element]]  # (n, m, n_loc, 2)
    points = np.einsum("lnm,nmla->nma", polyval(local, shapes), nodal)
    slope = np.einsum("lnm,nmla->nma", polyval(local, polyder(shapes)), nodal) * (elements / (end - begin))[..., None]
    tension = x.system.line.rope.EA * (np.linalg.norm(slope, axis=2) - 1.0)
    points[~inside], tension[~inside] = np.nan, np.nan
    return points, tension
