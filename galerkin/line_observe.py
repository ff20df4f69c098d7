"""The motion of a line by sines: tensions from the balance of pieces, energies and powers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import legendre

from cablefem.line_in_motion import positions_for_brakes_between_jumps
from cablefem.motion import CarMotion, ContactMotion, LineMotion, Turning, WheelMotion
from cablefem.newmark import State, stack_states
from cablefem.scene.contacts import Array, Contact, MovingLine
from cablefem.shoes import OffRopeState, contacts_with_shoe_forces, downward_normals, off_rope_motion_and_powers
from galerkin import kernels
from galerkin.bodies import Body, CarBody, ContactState, Counterweight, Friction, PointCar, length
from galerkin.kernels import LineValues
from galerkin.segments import Layout

if TYPE_CHECKING:
    from galerkin.line_off_rope import CarOnShoeOffRope
    from galerkin.lines import LineSines


class RopeHistory(NamedTuple):
    """The rope at n instants, and what acts on its contacts."""

    contact_values: Array  # (n, contacts, 26)
    positions: Array  # s of the contacts (n, contacts)
    points: Array  # at the stations (n, m, 2), NaN beyond the ends
    tension: Array  # (n, m)
    energies: Array  # kinetic, strain, potential (3, n) [J]


def observe(system: LineSines, states: Sequence[State], s: Array) -> LineMotion:
    """The motion at all states and at the stations s (m,)."""
    line = system.line
    Z = _coordinates_of_states(system, states)
    rope = _rope_history(system, Z, s)
    energies = rope.energies
    powers: dict[str, Array] = {}
    if line.rope.damping:
        powers["damping"] = -2.0 * line.rope.damping * energies[0]
    cars = []
    contacts = []
    for k, (contact, body) in enumerate(zip(line.contacts_and_wheels, system.equations.bodies, strict=True)):
        at = system.equations.contact_state(rope.contact_values, k)
        energies += body.energies(at)
        if isinstance(body, CarBody):
            positions = rope.positions[:, k : k + body.contacts]
            cars.append(_car_motion(body, positions, at))
            powers |= _car_powers(system, k, states, positions[:, -1], at)
        elif isinstance(contact, Contact):
            contacts.append(_contact_motion(line, contact, body, rope.positions[:, k], at))
        if isinstance(body, Counterweight):
            powers[f"{contact.name} weight"] = _counterweight_power(line, body, at)
    for car in system.off_rope.values():
        at = _contact_state_off_rope(car, states, Z)
        motion, own_powers = _motion_and_powers_off_rope(line, car, states, at, tuple(contacts))
        cars.append(motion)
        powers |= own_powers
        energies += car.body.energies(at)
    kinetic, strain, potential = energies
    loaded = contacts_with_shoe_forces(line, tuple(cars), tuple(contacts))
    return LineMotion(
        t=np.array([x.t for x in states]), cars=tuple(cars), contacts=loaded, s=s, points=rope.points,
        tension=rope.tension, kinetic=kinetic, strain=strain, potential=potential, powers=powers,
    )  # fmt: skip


def _coordinates_of_states(system: LineSines, states: Sequence[State]) -> Array:
    """All coordinates with their rates (3, n, layout.size)."""
    t, q, v, a, phases = stack_states(states)
    Z = np.empty((3, t.size, system.layout.size))
    for phase in np.unique(phases).tolist():
        of = phases == phase
        Z[:, of] = system.all_coordinates_from_unknowns(t[of], q[of], v[of], a[of], phase)
    return Z


def _rope_history(system: LineSines, Z: Array, s: Array) -> RopeHistory:
    """The rope with coordinates Z (3, n, .) and at the stations s (m,), computed for few instants at once."""
    layout = system.layout
    n = Z.shape[1]
    contact_values = np.empty((n, layout.contacts, ContactState.size))
    positions = np.empty((n, layout.contacts))
    points = np.empty((n, s.size, 2))
    tension = np.empty((n, s.size))
    energies = np.empty((3, n))
    integration = _legendre_integration_matrix(layout)
    at_once = 64
    no_friction = np.zeros((at_once, layout.contacts, len(Friction._fields)))
    for first in range(0, n, at_once):
        some = slice(first, first + at_once)
        values = system.equations.evaluate(np.ascontiguousarray(Z[:, some]), no_friction)
        contact_values[some] = values.contact_values.real
        positions[some] = values.Z[0][:, layout.s]
        energies[:, some] = _rope_energies(layout, values)
        integrals = integration @ values.inertia_and_weight
        kernels.set_points_and_tensions(
            layout.coordinates, values.Z[0], integrals, values.rope_rows[-2], s, points[some], tension[some]
        )
    beyond = (s < positions[:, :1]) | (s > positions[:, -1:])
    points[beyond] = np.nan
    tension[beyond] = np.nan
    return RopeHistory(contact_values, positions, points, tension, energies)


def _contact_state_off_rope(car: CarOnShoeOffRope, states: Sequence[State], Z: Array) -> ContactState:
    """What acts on a car off the rope at all states, with coordinates Z."""
    t = np.array([x.t for x in states])
    phases = np.array([x.phase for x in states])
    values = np.empty((t.size, 1, ContactState.size))
    for phase in np.unique(phases).tolist():
        of = phases == phase
        values[of] = car.contact_state(t[of], Z[:, of], phase).values
    return ContactState(values)


def _motion_and_powers_off_rope(
    line: MovingLine,
    car: CarOnShoeOffRope,
    states: Sequence[State],
    at: ContactState,
    contacts: tuple[ContactMotion, ...],
) -> tuple[CarMotion, dict[str, Array]]:
    """Motion and powers of a car off the rope, from what acts on it at all states."""
    body = car.body
    powers = body.drag_drive_and_swing_powers(at)
    powers.pop(body.driven, None)  # by the motion along the rail
    points = np.stack([at.p, at.dp, at.ddp], axis=1)
    turning = _turning_motion(body, at, ())
    off_rope = OffRopeState(points, body.force_needed_from_rope(at), powers, turning)
    return off_rope_motion_and_powers(line, body.car, states, off_rope, contacts)


def _car_powers(system: LineSines, k: int, states: Sequence[State], s: Array, at: ContactState) -> dict[str, Array]:
    """Powers (n,) [W] of a car at contact k of the rope, named as in `LineMotion`; s (n,) of its front wheel."""
    line = system.line
    body = system.cars[k]
    name = body.car.name
    drive = body.car.drive
    wheels = at.wheels
    x = wheels[-1]
    powers = {f"{name} {cause}": power for cause, power in body.drag_drive_and_swing_powers(at).items()}
    if drive.mode == "grip":
        kink = _material_force(line, x.ahead, x.ds) - _material_force(line, x.behind, x.ds)
        powers[f"{name} grip"] = -kink * x.ds
        return powers
    times = np.array([state.t for state in states])
    reached = positions_for_brakes_between_jumps(times, s)
    rolling = drive.mu_r if body.car.rail is None else 0.0  # a shoe has no friction
    resisting = rolling * np.abs(body.normal_wheel_loads(at)) + body.brake_forces_of_wheels(reached)
    phases, phase_of_state = np.unique([state.phase for state in states], return_inverse=True)
    power = np.zeros(s.size)
    for wheel, force in zip(wheels, resisting.T, strict=True):
        sign = np.sign(wheel.ds)
        if body.car.travel is not None:  # rope that creeps under a standing car does not turn its friction
            sign = np.array([line.travel_direction(body.car, phase) for phase in phases.tolist()])[phase_of_state]
        power -= wheel.mean_stretch * force * sign * wheel.ds
    powers[f"{name} friction"] = power
    if drive.mode == "free":
        hold = system.holds[k] * drive.remaining_hold_fraction(times)
        powers[f"{name} hold"] = x.mean_stretch * hold * x.ds
    return powers


def _counterweight_power(line: MovingLine, body: Counterweight, at: ContactState) -> Array:
    """Power (n,) [W] of the energy that enters with the rope over the pulley."""
    entering = _material_force(line, at.behind + at.ahead, at.ds) - line.weight_per_length * at.p[:, 1]
    return body.outward * at.ds * entering


def _car_motion(body: CarBody, s: Array, at: ContactState) -> CarMotion:
    """A car with the positions s (n, wheels); of two wheels x is the front one."""
    car = body.car
    wheels = at.wheels
    x = wheels[-1]
    loads = body.normal_wheel_loads(at)
    haul_force = grip_force = np.full(len(s), np.nan)
    if car.drive.mode == "haul":
        haul_force = at.F
    if car.drive_mode_or_haul_x == "grip":
        grip_force = body.tangential_force_on_last_wheel(at) / x.cos_phi
    shoe_force = np.zeros(len(s))
    if car.rail is not None and isinstance(body, PointCar):
        on_shoe = body.force_on_rope(x) + body.force_needed_from_rope(x)
        shoe_force = -(downward_normals(car.rail, x.p[:, 0]) * on_shoe).sum(axis=1)
    wheel_motions = []
    if len(wheels) > 1:
        for i, side in enumerate(("rear", "front")):
            wheel_motions.append(_wheel_motion(f"{car.name}.{side}", wheels[i], s[:, i], loads[:, i]))
    return CarMotion(
        name=car.name, s=s[:, -1], ds=x.ds, point=x.p, velocity=x.dp, acceleration=x.ddp,
        tension_behind=length(at.behind), tension_ahead=length(x.ahead), slope_behind=at.slope_behind,
        slope_ahead=x.slope_ahead, haul_force=haul_force, grip_force=grip_force,
        contact_force=loads.sum(axis=-1), shoe_force=shoe_force, turning=_turning_motion(body, at, wheel_motions),
    )  # fmt: skip


def _turning_motion(body: CarBody, at: ContactState, wheels: Sequence[WheelMotion]) -> Turning | None:
    """How the body turns, if it does; wheels : rear and front, if it stands on two."""
    if not body.turns:
        return None
    centre, _ = body.turning_body_centre_and_velocity(at)
    return Turning(
        angle=at.angle[:, 0], rate=at.dangle[:, 0], acceleration=at.ddangle[:, 0], centre=centre, wheels=tuple(wheels),
    )  # fmt: skip


def _wheel_motion(name: str, x: ContactState, s: Array, load: Array) -> WheelMotion:
    return WheelMotion(
        name=name, s=s, ds=x.ds, point=x.p, load=load, tension_behind=length(x.behind),
        tension_ahead=length(x.ahead), slope_behind=x.slope_behind, slope_ahead=x.slope_ahead,
    )  # fmt: skip


def _contact_motion(line: MovingLine, contact: Contact, body: Body, s: Array, x: ContactState) -> ContactMotion:
    """A support with s (n,) of the rope there."""
    none = np.full(s.size, np.nan)
    rise = none
    behind = length(x.behind)
    ahead = length(x.ahead)
    pressure = x.ahead - x.behind
    if isinstance(body, Counterweight):
        rise = (s - s[0]) * body.lift
    if contact is line.contacts[0]:
        behind = none
    elif contact is line.contacts[-1]:
        ahead = none
    else:  # the rope turns there
        flow = (line.rope.mass_per_length * x.ds**2)[:, None]
        pressure -= flow * (x.slope_ahead - x.slope_behind)
    return ContactMotion(
        name=contact.name, kind=contact.kind, s=s, ds=x.ds, point=x.p, tension_behind=behind, tension_ahead=ahead,
        pressure=pressure, rise=rise,
    )  # fmt: skip


def _material_force(line: MovingLine, force: Array, ds: Array) -> Array:
    """W - N |r'| + rho ds^2 |r'|^2/2 (n,) [N] beside a contact with this N t."""
    rope = line.rope
    N = length(force)
    stretch = 1.0 + N / rope.EA
    W = 0.5 * N**2 / rope.EA
    return W - N * stretch + 0.5 * rope.mass_per_length * (ds * stretch) ** 2


def _rope_energies(layout: Layout, values: LineValues) -> Array:
    """Kinetic, strain and potential energy (3, n) [J]."""
    rope = layout.line.rope
    tables = layout.tables
    s, ds = values.Z[:2, :, layout.s]  # (n, contacts)
    h = np.diff(s)[..., None]
    dxi = -(ds[:, :-1, None] + tables.points * np.diff(ds)[..., None]) / h  # of a point of the rope
    u, du = values.Z[:2, :, layout.columns[:, :-2]].reshape(2, *h.shape[:2], -1, 2)
    slopes = tables.of_q[: tables.points.size]
    velocity = tables.B @ du + dxi[..., None] * (slopes @ u)  # (n, S, G, 2)
    depth = (tables.B @ u)[..., 1]
    kinetic = 0.5 * rope.mass_per_length * (velocity**2).sum(axis=-1)
    strain = 0.5 * values.N**2 / rope.EA
    potential = -layout.line.weight_per_length * depth
    densities = np.stack([kinetic, strain, potential])  # (3, n, S, G)
    return (tables.weights * h * densities).sum(axis=(-2, -1))


def _legendre_integration_matrix(layout: Layout) -> Array:
    """Legendre coefficients (G + 1, G) of int_0^xi f from f at the points."""
    tables = layout.tables
    orders = np.arange(tables.points.size)
    values = legendre.legvander(2.0 * tables.points - 1.0, orders[-1])  # (G, orders)
    coefficients = (values * tables.weights[:, None] * (2.0 * orders + 1.0)).T
    return np.asarray(0.5 * legendre.legint(coefficients, lbnd=-1.0, axis=0))
