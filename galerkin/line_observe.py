"""The motion of a line by sines: tensions from the balance of pieces, energies and powers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import legendre

from cablefem.motion import CarMotion, ContactMotion, LineMotion, Turning, WheelMotion
from cablefem.newmark import State
from cablefem.scene.contacts import Array, Contact, MovingLine
from cablefem.shoes import OffRopeState, add_shoe_forces, downward_normals, off_rope_motion_and_powers
from galerkin.bodies import Body, CarBody, ContactState, Counterweight, Friction, PointCar, length
from galerkin.segments import Layout, Rope, basis_functions

if TYPE_CHECKING:
    from galerkin.lines import LineSines


def observe(system: LineSines, states: Sequence[State], s: Array) -> LineMotion:
    """The motion at all states and at the stations s (m,)."""
    layout, line, n = system.layout, system.line, len(states)
    contact_values = np.empty((n, layout.contacts, ContactState.size))
    positions = np.empty((n, layout.contacts))
    points, tension = np.empty((n, s.size, 2)), np.empty((n, s.size))
    energies = np.empty((3, n))
    integrals = _integration_matrix(layout)
    at_once = 64  # states
    for first in range(0, n, at_once):
        some = slice(first, first + at_once)
        Z = np.stack([system.coordinates_with_rates(x) for x in states[some]], axis=1)
        rope = Rope(layout, Z)
        contact_values[some], positions[some] = system.equations.contact_values(rope, Z), Z[0][:, layout.s]
        energies[:, some] = _rope_energies(rope)
        points[some], tension[some] = _points_and_tensions(rope, Z, s, integrals)
    beyond = (s < positions[:, :1]) | (s > positions[:, -1:])
    points[beyond], tension[beyond] = np.nan, np.nan

    powers: dict[str, Array] = {}
    cars, contacts = [], []
    times = np.array([x.t for x in states])
    before_jump = np.append(times[1:] <= times[:-1], False)
    for k, (contact, body) in enumerate(zip(line.contacts_and_wheels, system.equations.bodies, strict=True)):
        at, position = system.equations.contact_state(contact_values, k), positions[:, k]
        energies += body.energies(at)
        if isinstance(body, CarBody):
            hold = system.holds.get(k, 0.0) * np.array([body.car.drive.remaining_hold_fraction(x.t) for x in states])
            of_car = positions[:, k : k + body.contacts]
            cars.append(_car_motion(body, of_car, at))
            reached = of_car[:, -1] - 1e-9 * before_jump  # of two states at a brake the first is short of it
            powers |= _car_powers(line, body, reached, at, hold)
        elif isinstance(contact, Contact):
            contacts.append(_contact_motion(line, contact, body, position, at))
        if isinstance(body, Counterweight):
            entering = _energy_flux(line, at.behind + at.ahead, at.ds) - line.weight_per_length * at.p[:, 1]
            powers[f"{contact.name} weight"] = body.outward * at.ds * entering
    for car, (body, *_) in zip(line.over, system.off_rope.values(), strict=True):
        each = [(np.array([x.t]), system.coordinates_with_rates(x)[:, None], x.phase) for x in states]
        at = ContactState(np.concatenate([system.state_off_rope(car, *one).values for one in each]))
        powers_off = {cause: power for cause, power in body.powers(at).items() if cause != body.driven}
        jets = np.stack([at.p, at.dp, at.ddp], axis=1)
        off_rope = OffRopeState(jets, body.contact_force(at), powers_off, _turning(body, at, ()))
        motion, own_powers = off_rope_motion_and_powers(line, car, states, off_rope, tuple(contacts))
        powers |= own_powers
        cars.append(motion)
        energies += body.energies(at)
    kinetic, strain, potential = energies
    loaded = add_shoe_forces(line, tuple(cars), tuple(contacts))
    return LineMotion(
        t=times, cars=tuple(cars), contacts=loaded, s=s, points=points,
        tension=tension, kinetic=kinetic, strain=strain, potential=potential, powers=powers,
    )  # fmt: skip


def _car_motion(body: CarBody, s: Array, at: Any) -> CarMotion:
    """A car with the positions s (n, wheels); of two wheels x is the front one."""
    car, wheels = body.car, body.wheels(at)
    rear, x = wheels[0], wheels[-1]
    none, pressing = np.full(len(s), np.nan), body.wheel_loads(at)
    hauled, grips = car.drive.mode == "haul", car.drive_kind == "grip"
    on_shoe = np.zeros(len(s))
    if car.rail is not None and isinstance(body, PointCar):
        on_shoe = -(downward_normals(car.rail, x.p[:, 0]) * (body.force_on_rope(x) + body.contact_force(x))).sum(axis=1)
    both = () if len(wheels) == 1 else zip(("rear", "front"), wheels, s.T, pressing.T, strict=True)
    turning = _turning(body, at, [_wheel_motion(f"{car.name}.{name}", *of) for name, *of in both])
    return CarMotion(
        name=car.name, s=s[:, -1], ds=x.ds, point=x.p, velocity=x.dp, acceleration=x.ddp,
        tension_behind=length(rear.behind), tension_ahead=length(x.ahead), slope_behind=rear.slope_behind,
        slope_ahead=x.slope_ahead, haul_force=rear.F if hauled else none,
        grip_force=body.rope_force_along(at) / x.projection if grips else none, contact_force=pressing.sum(axis=-1),
        shoe_force=on_shoe, turning=turning,
    )  # fmt: skip


def _turning(body: CarBody, at: Any, wheels: Sequence[WheelMotion]) -> Turning | None:
    """How the body turns, if it does; wheels : rear and front, if it stands on two."""
    if not body.turns:
        return None
    x = body.wheels(at)[0]
    return Turning(
        angle=x.angle[:, 0], rate=x.dangle[:, 0], acceleration=x.ddangle[:, 0], centre=body.centre_of_mass(at)[0],
        wheels=tuple(wheels),
    )  # fmt: skip


def _wheel_motion(name: str, x: ContactState, s: Array, load: Array) -> WheelMotion:
    return WheelMotion(
        name=name, s=s, ds=x.ds, point=x.p, load=load, tension_behind=length(x.behind),
        tension_ahead=length(x.ahead), slope_behind=x.slope_behind, slope_ahead=x.slope_ahead,
    )  # fmt: skip


def _car_powers(line: MovingLine, body: CarBody, s: Array, at: Any, hold: Array) -> dict[str, Array]:
    name, drive = body.car.name, body.car.drive
    wheels = body.wheels(at)
    x = wheels[-1]
    powers = {f"{name} {cause}": power for cause, power in body.powers(at).items()}
    if drive.mode == "grip":
        kink = _energy_flux(line, x.ahead, x.ds) - _energy_flux(line, x.behind, x.ds)
        return powers | {f"{name} grip": -kink * x.ds}
    rolling = drive.mu_r if body.car.rail is None else 0.0  # a shoe has no friction
    resisting = body.friction_and_brakes(body.wheel_loads(at), Friction(rolling, body.brake_forces_by_wheel(s)))
    lost = [wheel.stretch * resisting[..., i] * np.abs(wheel.ds) for i, wheel in enumerate(wheels)]
    powers[f"{name} friction"] = -sum(lost, np.zeros(s.size))
    if drive.mode == "free":
        powers[f"{name} hold"] = x.stretch * hold * x.ds
    return powers


def _contact_motion(line: MovingLine, contact: Contact, body: Body, s: Array, x: ContactState) -> ContactMotion:
    none = np.full(s.size, np.nan)
    rise, behind, ahead = none, length(x.behind), length(x.ahead)
    pressure = x.ahead - x.behind
    if isinstance(body, Counterweight):
        rise = (s - s[0]) * body.lift
    if contact is line.contacts[0]:
        behind = none
    elif contact is line.contacts[-1]:
        ahead = none
    else:  # the rope turns there
        pressure -= (line.rope.mass_per_length * x.ds**2)[:, None] * (x.slope_ahead - x.slope_behind)
    return ContactMotion(
        name=contact.name, kind=contact.kind, s=s, ds=x.ds, point=x.p, tension_behind=behind, tension_ahead=ahead,
        pressure=pressure, rise=rise,
    )  # fmt: skip


def _energy_flux(line: MovingLine, force: Array, ds: Array) -> Array:
    """W - N |r'| + rho ds^2 |r'|^2/2 (n,) [N] beside a contact with this N t."""
    rope, N = line.rope, length(force)
    stretch = 1.0 + N / rope.EA
    return 0.5 * N**2 / rope.EA - N * stretch + 0.5 * rope.mass_per_length * (ds * stretch) ** 2


def _rope_energies(rope: Rope) -> Array:
    """Kinetic, strain and potential energy (3, n) [J]."""
    line, law = rope.layout.line, rope.law
    w = rope.layout.weights * rope.h[0]
    kinetic = 0.5 * line.rope.mass_per_length * (rope.r[1] ** 2).sum(axis=-1)
    densities = np.stack(
        [kinetic, 0.5 * line.rope.EA * (law.stretch - 1.0) ** 2, -line.weight_per_length * rope.r[0, ..., 1]]
    )
    return (w * densities).sum(axis=(-2, -1))


def _integration_matrix(layout: Layout) -> Array:
    """Legendre coefficients (G + 1, G) of int_0^xi f from f at the points."""
    count = layout.points.size
    values = legendre.legvander(2.0 * layout.points - 1.0, count - 1)  # (G, count)
    coefficients = (values * layout.weights[:, None] * (2.0 * np.arange(count) + 1.0)).T
    return np.asarray(0.5 * legendre.legint(coefficients, lbnd=-1.0, axis=0))


def _points_and_tensions(rope: Rope, Z: Array, s: Array, integrals: Array) -> tuple[Array, Array]:
    """Points (n, m, 2) and tensions (n, m) at s, on the segment behind a contact: N t at L and the load from there."""
    layout = rope.layout
    at = Z[0][:, layout.s]  # (n, contacts)
    row = np.arange(len(at))[:, None]
    i = np.sum(at[:, 1:-1, None] < s, axis=1)  # (n, m)
    xi = (s - at[row, i]) / rope.h[0, row, i, 0]
    u = Z[0][:, layout.columns[:, :-2]].reshape(len(at), layout.segments, -1, 2)
    B = basis_functions(xi.ravel(), layout.functions - 2)[0].reshape(*xi.shape, -1)
    points = (B[..., None, :] @ u[row, i])[..., 0, :]
    sums = (integrals @ rope.load)[row, i]  # (n, m, coefficients, 2)
    legendres = legendre.legvander(2.0 * xi - 1.0, len(integrals) - 1)
    load = rope.h[0, row, i] * (legendres[..., None, :] @ sums)[..., 0, :]
    return points, length(load - rope.rows[row, i, -2])
