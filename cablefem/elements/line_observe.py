"""What a line on elements does: `LineMotion` from a history of states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cablefem.elements.bodies import CarLoadsAndMasses, ForcesOnCars, counterweight_balance_row, forces_on_cars
from cablefem.elements.line_coordinates import Coordinates, Mask
from cablefem.elements.off_rope import CarOnShoeOffRope
from cablefem.elements.segments import Motion, dot
from cablefem.elements.trolley import Trolley
from cablefem.line_in_motion import positions_for_brakes_between_jumps
from cablefem.motion import CarMotion, ContactMotion, LineMotion, Turning, WheelMotion
from cablefem.newmark import Array, State, stack_states
from cablefem.scene.contacts import Car, Contact
from cablefem.shoes import OffRopeState, contacts_with_shoe_forces, downward_normals, off_rope_motion_and_powers

if TYPE_CHECKING:
    from cablefem.elements.system import LineElements

Powers = dict[str, Array]  # (n,) [W] by force
FORCES_OF_DRIVE = {
    "grip": ("swing", "grip"),
    "haul": ("friction", "drag", "swing", "haul"),
    "free": ("friction", "drag", "swing", "thrust", "hold"),
}


class _History:
    """All states of a run at once: n times, K segments."""

    def __init__(self, system: LineElements, states: Sequence[State]) -> None:
        self.system = system
        self.segments = system.segments
        self.t, q, v, a, self.phase = stack_states(states)
        self.none = np.full(self.t.size, np.nan)
        coordinates = np.empty((3, self.t.size, system.size))
        for phase, of in self.states_by_phase():
            coordinates[:, of] = system.all_coordinates_from_unknowns(self.t[of], q[of], v[of], a[of], phase)
        self.coordinates = Coordinates(*coordinates)  # (n, size) each
        self.q, self.v, self.a = self.coordinates
        motion = system.segment_motion(self.coordinates)
        self.motion = Motion(*(x.reshape(-1, *x.shape[2:]) for x in motion))  # of n K segments
        self.points = self.segments.fields_of_motion(self.motion)
        nodal_rows, end_rows = self.segments.rows_of_nodes_and_segment_ends(self.points)
        self.end_rows = self.split_by_time(end_rows)  # (2, n, K) of s
        self._set_forces_and_rows_at_segment_ends(nodal_rows)

    def states_by_phase(self) -> list[tuple[int, Mask]]:
        """Each phase, and which states are in it."""
        return [(phase, self.phase == phase) for phase in np.unique(self.phase).tolist()]

    def split_by_time(self, values: Array) -> Array:
        """(e, n K, ...) as (e, n, K, ...)."""
        return values.reshape(2, self.t.size, -1, *values.shape[2:])

    def _set_forces_and_rows_at_segment_ends(self, nodal_rows: Array) -> None:
        """N t at the ends of the segments (2, n, K, 2), by their balance, and rows of the end nodes."""
        ds = self.motion.ds.T[..., None]
        v = self.motion.v[:, [0, -1]].swapaxes(0, 1)
        slopes = self.system.slopes_at_segment_ends(self.q).reshape(v.shape)
        momentum_flux = self.segments.rho * ds * (v - ds * slopes)
        rows = nodal_rows[:, [0, -1]].swapaxes(0, 1)
        at_left = -(rows[0] + momentum_flux[0])
        at_right = rows[1] - momentum_flux[1]
        self.end_node_rows = self.split_by_time(rows)
        self.forces_at_segment_ends = self.split_by_time(np.stack([at_left, at_right]))

    def contact_points(self, k: int, coordinates: Array) -> Array:
        """Points of contact k (n, 2), or their rates, from coordinates (n, size)."""
        return coordinates[:, self.system.xy[k]]

    def behind_and_ahead(self, k: int, segment_ends: Array) -> tuple[Array, Array]:
        """Values beside contact k, of those at the ends of segments (2, n, K, ...); nan beyond the rope."""
        none = np.full_like(segment_ends[0, :, 0], np.nan)
        behind = segment_ends[1, :, k - 1] if k > 0 else none
        ahead = segment_ends[0, :, k] if k < segment_ends.shape[2] else none
        return behind, ahead

    def row_of_contact(self, k: int, segment_ends: Array) -> Array:
        """The row of contact k: the sum of those of the segments beside it (2, n, K, ...)."""
        row = np.zeros_like(segment_ends[0, :, 0])
        if k > 0:
            row += segment_ends[1, :, k - 1]
        if k < segment_ends.shape[2]:
            row += segment_ends[0, :, k]
        return row

    def tensions_beside(self, k: int) -> tuple[Array, Array]:
        """Tension (n,) behind and ahead of contact k; nan beyond the rope."""
        behind, ahead = self.behind_and_ahead(k, self.forces_at_segment_ends)
        return np.linalg.norm(behind, axis=1), np.linalg.norm(ahead, axis=1)

    def integral_over_rope(self, density: Array) -> Array:
        """int density ds over the rope (n,), of (n K, G)."""
        of_segments = (density * self.points.h) @ self.segments.weights
        return of_segments.reshape(self.t.size, -1).sum(axis=1)


class _CarsInMotion(NamedTuple):
    """Of all cars on the rope at all times, (n, cars, ...); without meaning for those on two wheels."""

    data: CarLoadsAndMasses
    slopes_and_motion: Array  # see `bodies.INPUTS`; of two wheels those of the front one
    forces: ForcesOnCars


def observe_line(system: LineElements, states: Sequence[State], s: Array) -> LineMotion:
    """What the states show, with the rope at the stations s (m,)."""
    x = _History(system, states)
    line = system.line
    supports = zip(system.support_contacts, line.supports, strict=True)
    contacts = tuple(_support_motion(x, k, support) for k, support in supports)
    cars, car_powers = _car_motions_and_powers(x)
    powers = _counterweight_powers(x) | car_powers
    for off_rope in system.off_rope.values():
        state = _state_off_rope(x, off_rope)
        motion, powers_off = off_rope_motion_and_powers(line, off_rope.car, states, state, contacts)
        powers |= powers_off
        cars.append(motion)
    speed_squared = x.points.w_x**2 + x.points.w_y**2
    kinetic = x.integral_over_rope(0.5 * system.segments.rho * speed_squared)
    if line.rope.damping:
        powers["damping"] = -2.0 * line.rope.damping * kinetic
    potential = -x.integral_over_rope(system.segments.q * x.points.depth)
    for car, motion in zip(line.all_cars, cars, strict=True):
        kinetic = kinetic + _car_kinetic_energy(car, motion)
        potential = potential - car.mass * line.gravity * motion.point[:, 1]
        if motion.turning is not None:
            hung = car.mass if car.hanger is None else car.hanger.mass
            below = motion.turning.centre - motion.point
            potential = potential - hung * line.gravity * below[:, 1]
    points, tension = _rope_points_and_tensions(x, s)
    contacts = contacts_with_shoe_forces(line, tuple(cars), contacts)
    return LineMotion(
        t=x.t,
        cars=tuple(cars),
        contacts=contacts,
        s=s,
        points=points,
        tension=tension,
        kinetic=kinetic,
        strain=_strain_energy_of_rope_and_springs(x),
        potential=potential,
        powers=powers,
    )


def _strain_energy_of_rope_and_springs(x: _History) -> Array:
    """Energy (n,) [J] of the rope and of springs at its ends."""
    energy = x.integral_over_rope(x.points.W)
    for k in (0, -1):
        support = x.system.line.supports[k]
        if support.stiffness is not None:
            away = x.contact_points(k, x.q) - support.point
            energy = energy + 0.5 * np.sum(np.array(support.stiffness) * away**2, axis=1)
    return energy


def _counterweight_powers(x: _History) -> Powers:
    """Power of each counterweight on the rope, by "NAME weight"."""
    powers = {}
    system = x.system
    ends = [end for end in (system.line.supports[0], system.line.supports[-1]) if end.force is not None]
    for end, slot, numbers in zip(ends, system.weights, system.weight_numbers, strict=True):
        ds = x.v[:, slot]
        powers[f"{end.name} weight"] = -counterweight_balance_row(numbers, ds, x.a[:, slot]) * ds
    return powers


def _car_kinetic_energy(car: Car, motion: CarMotion) -> Array:
    """Kinetic energy (n,) [J] of a car."""
    turning = motion.turning
    body = car.hanger or car.wheels
    if turning is None or body is None:
        return 0.5 * car.mass * dot(motion.velocity, motion.velocity)
    mass = car.mass if car.hanger is None else car.hanger.mass
    below = turning.centre - motion.point
    # a swing forward turns from down to the right, a pitch from the right to down
    sense = 1.0 if car.hanger is None else -1.0
    across = sense * np.stack([-below[:, 1], below[:, 0]], axis=1)
    centre = motion.velocity + turning.rate[:, None] * across
    at_point = (car.mass - mass) * dot(motion.velocity, motion.velocity)
    at_centre = mass * dot(centre, centre)
    return 0.5 * (at_point + at_centre + body.inertia * turning.rate**2)


def _support_motion(x: _History, k: int, support: Contact) -> ContactMotion:
    slot = x.system.s[k]
    s = x.q[:, slot]
    tension_behind, tension_ahead = x.tensions_beside(k)
    rise = x.none
    if support.force is not None:
        taken_in = (s - s[0]) * (1.0 if k else -1.0)
        rise = (1.0 + support.force / x.system.line.rope.EA) * taken_in
    return ContactMotion(
        name=support.name,
        kind=support.kind,
        s=s,
        ds=x.v[:, slot],
        point=x.contact_points(k, x.q),
        tension_behind=tension_behind,
        tension_ahead=tension_ahead,
        pressure=-x.row_of_contact(k, x.end_node_rows),
        rise=rise,
    )


def _car_motions_and_powers(x: _History) -> tuple[list[CarMotion], Powers]:
    """Motion of the cars on the rope, and powers by "NAME force"."""
    system = x.system
    if not system.car_contacts:
        return [], {}
    data = _car_loads_over_time(x)
    slopes_and_motion = system.slopes_and_motion_at_cars(x.coordinates)
    cars = _CarsInMotion(data, slopes_and_motion, forces_on_cars(data, slopes_and_motion))
    trolleys = {trolley.i: trolley for trolley in system.trolleys}
    motions = []
    powers: Powers = {}
    for i, car in enumerate(system.line.cars_on_rope):
        if i in trolleys:
            motion, of_car = _trolley_motion_and_powers(x, trolleys[i], data)
        else:
            motion = _point_car_motion(x, i, cars)
            of_car = _point_car_powers(x, i, cars, motion)
        motions.append(motion)
        powers |= {f"{car.name} {force}": power for force, power in of_car.items()}
    return motions, powers


def _point_car_motion(x: _History, i: int, cars: _CarsInMotion) -> CarMotion:
    """Motion of car i, which stands on one contact."""
    k = x.system.car_contacts[i]
    car = x.system.line.cars_on_rope[i]
    forces = cars.forces
    own = cars.slopes_and_motion[:, i]
    slopes = own[:, 0:2], own[:, 2:4]
    contact = _wheel_motion(x, car.name, k, forces.normal[:, i], slopes)
    missing_force = x.row_of_contact(k, x.end_node_rows) + forces.contact[:, i]
    shoe = _force_on_shoe(car, contact.point, missing_force)
    turning = None
    if car.hanger is not None:
        turning = _swing_motion(own[:, 9:12], contact.point, cars.data.arm[i])
    return _car_motion(
        x,
        car,
        k,
        (contact, contact),
        turning,
        haul=forces.haul[:, i],
        grip=x.row_of_contact(k, x.end_rows) / forces.stretch[:, i],
        contact=contact.load,
        shoe=shoe,
    )


def _car_motion(
    x: _History,
    car: Car,
    k: int,
    wheels: Sequence[WheelMotion],
    turning: Turning | None,
    *,
    haul: Array,
    grip: Array,
    contact: Array,
    shoe: Array,
) -> CarMotion:
    """Motion of a car from its rear and its front wheel, which is contact k; a car on one contact has it twice.

    haul and grip : [N] (n,) each, of which the car has that of its drive, or none.
    """
    rear, front = wheels
    return CarMotion(
        name=car.name,
        s=front.s,
        ds=front.ds,
        point=front.point,
        velocity=x.contact_points(k, x.v),
        acceleration=x.contact_points(k, x.a),
        tension_behind=rear.tension_behind,
        tension_ahead=front.tension_ahead,
        slope_behind=rear.slope_behind,
        slope_ahead=front.slope_ahead,
        haul_force=haul if car.drive.mode == "haul" else x.none,
        grip_force=grip if car.drive_mode_or_haul_x == "grip" else x.none,
        contact_force=contact,
        shoe_force=shoe,
        turning=turning,
    )


def _point_car_powers(x: _History, i: int, cars: _CarsInMotion, motion: CarMotion) -> Powers:
    """Powers of the forces on car i, which stands on one contact, by force."""
    data = cars.data
    forces = cars.forces
    stretch = forces.stretch[:, i]
    along = np.sum(forces.tau[:, i] * motion.velocity, axis=1)
    row_of_s = x.row_of_contact(x.system.car_contacts[i], x.end_rows)
    powers = {
        "friction": stretch * forces.friction[:, i] * motion.ds,
        "drag": forces.air_power[:, i],
        "grip": row_of_s * motion.ds,
        "haul": forces.haul[:, i] * along,
        "thrust": data.thrust[:, i] * along,
        "hold": stretch * data.hold[:, i] * motion.ds,
    }
    if motion.turning is not None:
        powers["swing"] = -data.resistance[i] * motion.turning.rate**2
    return _only_powers_of_drive(x.system.line.cars_on_rope[i], powers)


def _only_powers_of_drive(car: Car, powers: Powers) -> Powers:
    """Those of the powers that a car has by its drive."""
    return {force: powers[force] for force in FORCES_OF_DRIVE[car.drive.mode] if force in powers}


def _state_off_rope(x: _History, off_rope: CarOnShoeOffRope) -> OffRopeState:
    """A car off the rope at all states."""
    car = off_rope.car
    z = np.array(x.coordinates)
    points = np.empty((x.t.size, 3, 2))
    for phase, of in x.states_by_phase():
        points[of] = off_rope.points_with_rates(x.t[of], z[:, of], phase)
    forces = off_rope.forces(points, z)
    powers: Powers = {}
    turning = None
    if not off_rope.grips:
        powers["drag"] = forces.air_power[:, 0]
    if car.hanger is not None:
        turning = _swing_motion(z[..., off_rope.swing].T, points[:, 0], car.hanger.length)
        powers["swing"] = -off_rope.resistance * turning.rate**2
    return OffRopeState(points, forces.contact[:, 0], powers, turning)


def _swing_motion(swing: Array, point: Array, arm: float) -> Turning:
    """Swing of a cabin, from its angle, rate and acceleration (n, 3); arm [m] from the point (n, 2)."""
    angle, rate, acceleration = swing.T
    below = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    return Turning(angle=angle, rate=rate, acceleration=acceleration, centre=point + arm * below)


def _force_on_shoe(car: Car, point: Array, missing_force: Array) -> Array:
    """Force (n,) [N] of a car on the shoe that guides it, 0 without one; missing_force : not from the rope (n, 2)."""
    if car.rail is None:
        return np.zeros(len(point))
    return -dot(missing_force, downward_normals(car.rail, point[:, 0]))


def _trolley_motion_and_powers(x: _History, trolley: Trolley, data: CarLoadsAndMasses) -> tuple[CarMotion, Powers]:
    """Motion of a car on two wheels, and its powers by force."""
    car = trolley.car
    k = trolley.k
    rear_row = x.row_of_contact(k - 1, x.end_node_rows)
    front_row = x.row_of_contact(k, x.end_node_rows)
    rope_rows = np.concatenate([rear_row, front_row], axis=1)
    inputs = trolley.force_inputs(x.coordinates, rope_rows)
    forces = trolley.forces(data, inputs)
    wheels = []
    slopes = [*trolley.rope_slopes_at_wheels(x.q).swapaxes(0, 1)]  # (n, 2) each
    loads = forces.rear.load, forces.front.load
    for j, wheel in enumerate((k - 1, k)):
        name = x.system.line.contacts_and_wheels[wheel].name
        wheels.append(_wheel_motion(x, name, wheel, loads[j], slopes[2 * j : 2 * j + 2]))
    rear, front = wheels
    pitch = trolley.body[2]
    centre = front.point + np.stack([forces.body.centre_x, forces.body.centre_y], axis=1)
    turning = Turning(
        angle=x.q[:, pitch],
        rate=x.v[:, pitch],
        acceleration=x.a[:, pitch],
        centre=centre,
        wheels=(rear, front),
    )
    row_of_s = x.row_of_contact(k, x.end_rows)
    haul = car.mass * x.a[:, trolley.force] if trolley.force >= 0 else x.none
    motion = _car_motion(
        x,
        car,
        k,
        wheels,
        turning,
        haul=haul,
        grip=row_of_s / forces.front.stretch,
        contact=rear.load + front.load,
        shoe=np.zeros(x.t.size),
    )
    powers = {
        "friction": forces.rear.friction * rear.ds + forces.front.friction * front.ds,
        "drag": forces.body.drag,
        "grip": row_of_s * front.ds,
        "haul": forces.body.haul,
        "thrust": forces.body.thrust,
        "hold": forces.hold * front.ds,
    }
    return motion, _only_powers_of_drive(car, powers)


def _wheel_motion(x: _History, name: str, k: int, load: Array, slopes: Sequence[Array]) -> WheelMotion:
    """Motion of contact k of a car; slopes : behind and ahead (n, 2)."""
    slot = x.system.s[k]
    tension_behind, tension_ahead = x.tensions_beside(k)
    slope_behind, slope_ahead = slopes
    return WheelMotion(
        name=name,
        s=x.q[:, slot],
        ds=x.v[:, slot],
        point=x.contact_points(k, x.q),
        load=load,
        tension_behind=tension_behind,
        tension_ahead=tension_ahead,
        slope_behind=slope_behind,
        slope_ahead=slope_ahead,
    )


def _car_loads_over_time(x: _History) -> CarLoadsAndMasses:
    """Data of the cars at all times, (n, cars)."""
    system = x.system
    slots = system.s[system.car_contacts]
    ds = x.v[:, slots]
    thrust = np.zeros_like(ds)
    hold = np.zeros_like(ds)
    for phase, of in x.states_by_phase():
        data = system.car_loads_and_masses(x.t[of], phase)
        thrust[of] = data.thrust
        hold[of] = data.hold
    s = positions_for_brakes_between_jumps(x.t, x.q[:, slots])
    brake = np.zeros_like(s)
    rear_brake = np.zeros_like(s)
    for i, car in enumerate(system.line.cars_on_rope):
        brake[:, i] = car.drive.brake_force(s[:, i])
        rear_brake[:, i] = car.drive.rear_brake_force(s[:, i])
    sign = np.where(ds == 0.0, data.sign, np.sign(ds))
    for i, car in enumerate(system.line.cars_on_rope):
        if car.travel is not None:  # rope that creeps under a standing car does not turn its friction
            for phase, of in x.states_by_phase():
                sign[of, i] = system.line.travel_direction(car, phase)
    return data._replace(thrust=thrust, hold=hold, brake=brake, rear_brake=rear_brake, sign=sign)


def _rope_points_and_tensions(x: _History, s: Array) -> tuple[Array, Array]:
    """Points (n, m, 2) and tensions (n, m) at s (m,)."""
    ends = x.q[:, x.system.s]  # (n, K + 1)
    segment = np.array([np.searchsorted(row[1:-1], s, side="left") for row in ends])  # (n, m)
    begin = np.take_along_axis(ends, segment, axis=1)
    h = np.take_along_axis(ends[:, 1:], segment, axis=1) - begin
    xi = (s - begin) / h
    shapes = x.segments.element_shapes(xi)
    r = x.motion.r.reshape(x.t.size, -1, x.segments.nn, 2)  # (n, K, nn, 2)
    instant = np.arange(x.t.size)[:, None, None]
    nodal = r[instant, segment[..., None], shapes.nodes]  # (n, m, n_loc, 2)
    points = np.einsum("lnm,nmla->nma", shapes.values, nodal)
    by_element = np.einsum("lnm,nmla->nma", shapes.slopes, nodal)
    slope = by_element * (x.segments.elements / h)[..., None]
    strain = np.linalg.norm(slope, axis=2) - 1.0
    tension = x.system.line.rope.EA * strain
    beyond = ~((xi >= 0.0) & (xi <= 1.0))
    points[beyond] = np.nan
    tension[beyond] = np.nan
    return points, tension
