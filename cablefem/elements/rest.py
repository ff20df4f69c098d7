"""A line at rest with its cars held, by Newton's method; the start of a run."""

from __future__ import annotations

import itertools

import numpy as np

from cablefem.elements.bodies import CarLoadsAndMasses
from cablefem.elements.line_balance import LineBalance
from cablefem.elements.line_coordinates import Coordinates, Mask
from cablefem.elements.segments import Law
from cablefem.newmark import Array, StepFailure
from cablefem.scene.contacts import Car, Contact, MovingLine, Wheel
from cablefem.scene.line import Case, NoLineAtRest, Station, needed_counterweight_text
from cablefem.scene.taut import Start, first_guess

SOFTENING = 8  # stages of EA up to its value
EXACT = 1e-10  # last step over the reach


def coordinates_at_rest(
    system: LineBalance, t: float, phase: int, time_shift: float = 0.0, guess: Array | None = None
) -> Array:
    """Coordinates (size,) at rest with the cars held where they are at t, and F/M of hauled cars.

    time_shift : [s] moves prescribed cars on by their velocity.  guess : coordinates at rest to begin from.
    Raises StepFailure where no state of rest was found.
    """
    positions, velocities, _ = system.prescribed_coordinates(t, phase)
    free = system.free.copy()
    q = positions + time_shift * velocities
    for i in system.free_cars:
        slot = system.slot_of_s(i)
        free[slot] = False
        q[slot] = system.line.cars_on_rope[i].drive.start
    if guess is not None:
        q[free] = guess[free]
        return _solve_rest_by_newton(system, t, phase, q, free, system.law, EXACT)
    N = _set_guess_and_return_tensions(system, q, free)
    rough = 1e-3  # last step over the reach, of a soft rope
    for stage in range(SOFTENING):
        law = _soft_law(system, N, stage / SOFTENING)
        q = _solve_rest_by_newton(system, t, phase, q, free, law, rough)
    return _solve_rest_by_newton(system, t, phase, q, free, system.law, EXACT)


def resting_coordinates_with_forces(system: LineBalance, q: Array) -> Coordinates:
    """All coordinates at rest at q (size,); F/M acts as the acceleration of its slot."""
    z = np.zeros((3, system.size))
    z[0] = q
    z[2, system.force] = q[system.force]
    return system.fill_dependent_coordinates(z)


def car_loads_at_rest(system: LineBalance, t: float, phase: int) -> CarLoadsAndMasses:
    """Cars at rest in the wind; hauled ones are about to move."""
    cars = system.car_loads_and_masses(t, phase)
    hauled = np.array([car.travel is not None for car in system.line.cars_on_rope])
    none = np.zeros(hauled.size)
    at_rest = cars._replace(thrust=none, brake=none, rear_brake=none, hold=none)
    return at_rest._replace(sign=cars.sign * hauled)


def _solve_rest_by_newton(
    system: LineBalance, t: float, phase: int, q: Array, free: Mask, law: Array, tolerance: float
) -> Array:
    """Coordinates at rest, from q near them, with this law of the rope.

    tolerance : of the last step, over the reach of the line.  Raises StepFailure if it is not met.
    """
    points = np.array([c.point for c in system.line.supports])
    reach = float(np.ptp(points[:, 0]))
    bound = system.force_floor * np.sqrt(system.n_dof)
    cars = car_loads_at_rest(system, t, phase)
    moving = free.copy()
    moving[system.force] = False

    def rows(q: Array) -> Array:
        x = resting_coordinates_with_forces(system, q)
        return system.balance_rows_storing_loads(t, x, phase, cars=cars, law=law)[free]

    def damped_step(q: Array, step: Array, before: float) -> tuple[Array, Array, float]:
        """q and its rows after the fraction of a step that makes the rows smaller, and that fraction."""
        smallest_fraction = 1e-4
        fraction = 1.0
        while True:
            trial = q - fraction * step
            with np.errstate(all="ignore"):
                r = rows(trial)
            norm = np.linalg.norm(r)
            if norm < max(1e3 * bound, before) or fraction < smallest_fraction:
                return trial, r, fraction
            fraction *= 0.5

    r = rows(q)
    for _ in range(60):  # of a stage
        x = resting_coordinates_with_forces(system, q)
        solve = system.rest_solver(x, law, cars, free)
        step = np.zeros(system.size)
        step[free] = solve(r)
        q, r, fraction = damped_step(q, step, float(np.linalg.norm(r)))
        if not np.isfinite(q).all():
            break
        largest_step = np.abs(step[moving]).max(initial=0.0)
        if largest_step <= tolerance * reach and fraction == 1.0:
            return q
    raise StepFailure(t, "no rest of the loaded line was found", "compare the rope's length with its contacts")


def _soft_law(system: LineBalance, N: Array, fraction: float) -> Array:
    """The law (3, K, G) N = N_ref + EA_soft (lam - lam_ref), which keeps the length of a rope under N_ref (K,)."""
    law = Law(*system.law)
    N_ref = N[:, None]
    softest = 5.0  # first EA over the tension
    soft = np.minimum(law.EA, softest * N_ref)
    EA = law.EA**fraction * soft ** (1.0 - fraction)
    more = N_ref / law.EA
    N_r = N_ref - EA * more
    W_r = (0.5 * (law.EA - EA) * more - N_r) * more
    return np.array([EA, N_r, W_r])


def _set_guess_and_return_tensions(system: LineBalance, q: Array, free: Mask) -> Array:
    """Set free ones of q to parabolas between guessed contacts; return tensions (K,) of the segments."""
    guess = _guess_contact_points_and_tensions(system, q, free)
    points = guess.points.copy()
    s = np.where(free[system.s], guess.s, q[system.s])
    q[system.s] = s
    for trolley in system.trolleys:
        rear, front = points[[trolley.k - 1, trolley.k]]
        chord = front - rear
        body = [*front, np.arctan2(*chord[::-1])]
        # nodes nearer to the rear wheel than it moves would fold the rope
        points[trolley.k - 1] = front - trolley.wheels.base / np.hypot(*chord) * chord
        q[trolley.body] = np.where(free[trolley.body], body, q[trolley.body])
    dx, dy = np.diff(points, axis=0).T
    sag = system.line.weight_per_length * np.diff(s) * dx / (8.0 * guess.H)
    nodal = _nodes_on_parabolas(system, points, sag)
    coordinates = np.flatnonzero(free[: 2 * system.n])
    q[coordinates] = nodal.ravel()[coordinates]
    return guess.H * np.hypot(dx, dy) / dx


def _guess_contact_points_and_tensions(system: LineBalance, q: Array, free: Mask) -> Start:
    """Points and s of the contacts and horizontal tensions, such that prescribed s in q are nearly met.

    Raises StepFailure where no rope can hold the cars.
    """
    line = system.line
    x = _guess_contact_x(system, q)
    near = 1e-4  # change of x over the reach
    for _ in range(8):  # guess x from s, at most
        stations = tuple(_station_of(c, x[k], line.gravity) for k, c in enumerate(line.contacts_and_wheels))
        case = Case(stations, line.weight_per_length, line.rope.EA, length=line.rope.length)
        guess = _guess_or_raise(case, line)
        moved = np.zeros_like(x)
        for k in system.car_contacts:
            slot = system.s[k]
            if not free[slot]:
                moved[k] = q[slot] - guess.s[k]
        for trolley in system.trolleys:
            moved[trolley.k - 1] = moved[trolley.k]
        if np.abs(moved).max() <= near * np.ptp(x):
            break
        x = _clipped_and_sorted_cars(system, x + moved)
    return guess


def _guess_or_raise(case: Case, line: MovingLine) -> Start:
    guess = first_guess(case)
    if isinstance(guess, NoLineAtRest):
        needed = needed_counterweight_text([case], line.solve) if line.solve else ""
        raise StepFailure(0.0, str(guess), needed.removeprefix("; ") or "give more rope or less load")
    return guess


def _nodes_on_parabolas(system: LineBalance, points: Array, sag: Array) -> Array:
    """Nodes (n, 2) on parabolas between the contacts; sag (K,) in the middle of each segment."""
    chord = np.diff(points, axis=0)
    xi = np.linspace(0.0, 1.0, system.segments.elements + 1)
    nodal = np.zeros((system.n, 2))
    for k, nodes in enumerate(system.nodes):
        ends = nodes[:: system.segments.degree]
        nodal[ends] = points[k] + xi[:, None] * chord[k]
        nodal[ends, 1] += 4.0 * sag[k] * xi * (1.0 - xi)
        if system.segments.degree == 2:
            left = nodal[nodes[:-1:2]]
            right = nodal[nodes[2::2]]
            nodal[nodes[1::2]] = 0.5 * (left + right)
    return nodal


def _station_of(contact: Contact | Car | Wheel, x: float, gravity: float) -> Station:
    """A contact as a station of a line at rest; a car is at x, and its weight acts there."""
    if not isinstance(contact, Contact):
        car, share = (contact.car, 0.5) if isinstance(contact, Wheel) else (contact, 1.0)
        kind = "hauled" if car.drive_mode_or_haul_x == "haul_x" else "grips"
        return Station(contact.name, kind, x, np.nan, share * car.mass * gravity)
    x, y = contact.point
    return Station(contact.name, contact.kind, x, y, contact.force or 0.0, contact.stiffness)


def _guess_contact_x(system: LineBalance, q: Array) -> Array:
    """Guessed x (contacts,), with cars of prescribed s in q at that length along the chords of the supports."""
    line = system.line
    points = np.array([c.point for c in line.supports])
    chords = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(chords)])
    begin = 0.0
    if line.supports[0].kind == "counterweight":
        begin = (line.rope.length or 0.0) - along[-1]
    x = np.zeros(len(line.contacts_and_wheels))
    x[system.support_contacts] = points[:, 0]
    for i, car in enumerate(line.cars_on_rope):
        position = q[system.slot_set_by_travel(i)]
        is_x = car.drive_mode_or_haul_x == "haul_x"
        x[system.car_contacts[i]] = position if is_x else np.interp(position - begin, along, points[:, 0])
    for trolley in system.trolleys:
        x[trolley.k - 1] = x[trolley.k] - trolley.wheels.base
    return _clipped_and_sorted_cars(system, x)


def _clipped_and_sorted_cars(system: LineBalance, x: Array) -> Array:
    """x with the cars clipped to their span and sorted, a little apart."""
    out = x.copy()
    for i, j in itertools.pairwise(system.support_contacts):
        margin = 1e-3 * (x[j] - x[i])
        cars = slice(i + 1, j)
        in_span = np.clip(x[cars], x[i] + margin, x[j] - margin)
        out[cars] = np.sort(in_span) + 1e-6 * margin * np.arange(j - i - 1)
    return out
