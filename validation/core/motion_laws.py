"""Laws of a line in motion, and a second reading of its files, from the scene's TOML and the motion alone.

Over a window W(t) that vanishes with its slope at both ends, for the rope and all cars together:

    int W'' rho (int r ds) + W' rho [p ds]_ends - W' sum m v dt
        = int W (weights + haul + drag + thrust - pressures) + c_d rho (W' int r ds + W [p ds]_ends) dt
    int W (N - G) + W' (G/g) rise' dt = 0        of a counterweight

Energy less work, from the start: drives, drag, friction, damping of the rope, and at a pulley the rope that enters with
its weight q y:

    dE/dt = -e ds (N + N^2/(2 EA) + q y - rho (ds lam)^2/2),    e = 1 at the right end, -1 at the left one.

Left out: the momentum of the rope that enters, rho ds^2, below 1e-5 of the tension for 0.5 m/s.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.optimize import fsolve

from validation.core.motion_bodies import CarBody, drive_mode, is_hauled_in_x, to_complex, to_vectors
from validation.core.scene_data import (
    DOWN,
    ROUNDING,
    Array,
    HangingRope,
    LineData,
    height_over_at,
    min_height_over,
    obstacle_and_ground_profiles,
    series_faults,
    tension_ratio_and_rope_stresses_at_wheel,
)
from validation.core.stored_files import Entries, damaged_files_are_faults, read_csv_columns
from validation.core.timetable import Timetable

WINDOWS = 12
BRAKE_EVENTS = ("brakes", "leaves a brake")
SHOE_VERBS = ("lands on", "leaves")
TIP = 0.2  # of a shoe: how far from the saddle a car leaves the rope at the latest, and takes it again
# kinds of design numbers, and their columns of a car's file
COLUMN_OF_QUANTITY = {
    "haul": "F_haul",
    "contact": "F_contact",
    "speed": "speed",
    "depth": "y",
    "swing": "swing",
    "pitch": "pitch",
}


class Counterweight(NamedTuple):
    """A counterweight at an end of the rope."""

    outward: float  # e: +1 at the right end, -1 at the left one
    contact_index: int
    table: dict[str, Any]


class LineTables(LineData):
    """A line in motion; lengths along a hot rope are heated ones."""

    def __init__(self, toml: str) -> None:
        super().__init__(toml)
        self.rho = self.mass_per_length / self.heat
        self.q = self.rho * self.gravity
        self.damping_rate = self.data["cable"].get("damping", {"rate": 0.0})["rate"]
        self.cars: dict[str, dict[str, Any]] = {car["name"]: car for car in self.data.get("car", [])}
        for car in self.cars.values():
            for brake in car.get("drive", {}).get("brake", []):
                brake["from"] *= self.heat

    def brake_positions(self, car: str) -> Array:
        """s (n,) [m] at which the brakes of a car begin."""
        return np.array([brake["from"] for brake in self.cars[car].get("drive", {}).get("brake", [])])

    @cached_property
    def length_between_fixed_ends(self) -> float | None:
        """Length [m] of the hot rope, by the TOML's length or tension of the empty line; None: an end or spring moves.

        From contact to contact the tension is that of the span before.
        """
        cable = self.data["cable"]
        if any(contact["kind"] in ("counterweight", "spring") for contact in self.contacts):
            return None
        if "length" in cable:
            return float(cable["length"]) * self.heat
        names = [contact["name"] for contact in self.contacts]
        k = names.index(cable["tension"]["at"])
        points = np.array([contact["at"] for contact in self.contacts], float)
        length = 0.0
        for way in (points[k:], points[k::-1] * [-1.0, 1.0]):
            N = cable["tension"]["value"]
            for end in np.diff(way, axis=0):
                piece, N = self._length_and_far_tension_of_span(end, N)
                length += piece
        return length * self.heat

    def _length_and_far_tension_of_span(self, end: Array, N: float) -> tuple[float, float]:
        """Length [m] of the empty rope from where its tension is N to `end` (2,) from there, and the tension there."""
        q = self.empty_mass_per_length * self.gravity

        def rope_with(length_and_slope: Array) -> HangingRope:
            S, angle = length_and_slope
            return HangingRope.at_lengths(np.array([S]), N * math.cos(angle), N * math.sin(angle), q, self.EA)

        def missed(length_and_slope: Array) -> Array:
            rope = rope_with(length_and_slope)
            return np.array([rope.x[0], rope.y[0]]) - end

        chord = math.hypot(*end)
        found = fsolve(missed, [chord, math.atan2(end[1], end[0]) + 0.5 * q * chord / N])
        return float(found[0]), float(rope_with(found).tension[0])

    @property
    def counterweights(self) -> list[Counterweight]:
        ends = [Counterweight(-1.0, 0, self.contacts[0]), Counterweight(1.0, -1, self.contacts[-1])]
        return [end for end in ends if end.table["kind"] == "counterweight"]


# --- the motion at steps ---------------------------------------------------------------------------------------------


def tension_behind_or_ahead(contact: Any) -> Array:
    """Tension (n,) [N] behind a contact, or that ahead at the left end; a saddle has the same on both sides."""
    behind = contact.tension_behind
    return np.where(np.isnan(behind), contact.tension_ahead, behind)


def mean_tension(contact: Any) -> Array:
    """Mean (n,) [N] of the tensions behind and ahead of a contact or car, or the only one."""
    sides = np.array([contact.tension_behind, contact.tension_ahead])
    return np.where(np.isnan(sides), sides[::-1], sides).mean(axis=0)


class RopeChain(NamedTuple):
    """The rope at n times as k points in order of s: stations, contacts and cars."""

    s: Array  # (n, k)
    points: Array  # (n, k, 2)
    tension: Array  # (n, k), at contacts and cars the mean of both sides


def bodies_on_rope(motion: Any) -> list[Any]:
    """Contacts, cars and rear wheels; a car of two wheels stands for its front one."""
    rear_wheels = [car.turning.wheels[0] for car in motion.cars if car.turning is not None and car.turning.wheels]
    return [*motion.contacts, *motion.cars, *rear_wheels]


def rope_chain(motion: Any) -> RopeChain:
    """The rope of a motion; stations beyond it are put at the first contact."""
    touching = bodies_on_rope(motion)
    first = motion.contacts[0]
    on_rope = np.isfinite(motion.tension)  # (n, stations)
    s = np.where(on_rope, motion.s, first.s[:, None])
    points = np.where(on_rope[..., None], motion.points, first.point[:, None])
    tension = np.where(on_rope, motion.tension, first.tension_ahead[:, None])
    s = np.column_stack([s, *(x.s for x in touching)])
    bodies = np.stack([x.point for x in touching], axis=1)  # (n, bodies, 2)
    points = np.concatenate([points, bodies], axis=1)
    tension = np.column_stack([tension, *(mean_tension(x) for x in touching)])
    order = np.argsort(s, axis=1, kind="stable")
    s = np.take_along_axis(s, order, axis=1)
    points = np.take_along_axis(points, order[..., None], axis=1)
    tension = np.take_along_axis(tension, order, axis=1)
    return RopeChain(s, points, tension)


class SampledMotion:
    """A run at every n-th step (`every`): its bodies, and integrals over the rope as a chain of straight pieces."""

    def __init__(self, line: LineTables, moved: Any, every: int = 1) -> None:
        motion = moved.motion
        self.line = line
        self.events = moved.events
        self.all_times = motion.t
        self.taken = every_nth_step(motion.t, every)
        self.t = motion.t[self.taken]
        self.cars = list(motion.cars)
        self.contacts = list(motion.contacts)
        self.touching = bodies_on_rope(motion)
        self.bodies = [CarBody(line.cars[car.name], car, motion, self.at_samples, line.gravity) for car in self.cars]
        s, points, T = (self.at_samples(values) for values in rope_chain(motion))
        self.rope_at_start = RopeChain(s[0], points[0], T[0])
        ds = np.diff(s, axis=1)  # (n, k - 1)
        middles = 0.5 * (points[:, 1:] + points[:, :-1])
        squared_tension = 0.5 * (T[:, 1:] ** 2 + T[:, :-1] ** 2)
        self.rope_length = ds.sum(axis=1)  # (n,) [m]
        self.rope_moment = (middles * ds[..., None]).sum(axis=1)  # int r ds (n, 2)
        self.rope_depth = (middles[..., 1] * ds).sum(axis=1)  # int y ds (n,)
        self.rope_squared_tension = (squared_tension * ds).sum(axis=1)  # int N^2 ds (n,)
        self.kinetic = self._kinetic_energy_of_rope(motion)
        self.kinetic_of_run = self.at_samples(motion.kinetic)  # of rope and cars
        self.damping_power = self.at_samples(motion.powers.get("damping", 0.0 * motion.t))

    def at_samples(self, values: Array) -> Array:
        return values[self.taken]

    @property
    def turning_bodies(self) -> list[CarBody]:
        """Cabins that swing, and cars on two wheels."""
        return [body for body in self.bodies if body.turning is not None]

    def _kinetic_energy_of_rope(self, motion: Any) -> Array:
        """By the velocities of its stations (n,) [J]."""
        once = np.concatenate([[True], np.diff(self.t) > 0.0])
        points = self.at_samples(motion.points)
        velocity = np.gradient(points[once], self.t[once], axis=0)
        v2 = np.nan_to_num((velocity**2).sum(axis=2))  # (., m)
        length = np.gradient(motion.s)
        rows = np.cumsum(once) - 1
        return 0.5 * self.line.rho * (v2 @ length)[rows]


def pieces_between_jumps(t: Array) -> list[NDArray[np.intp]]:
    """Indices of the times t (n,) in pieces between jumps, at which a time stands twice."""
    return np.split(np.arange(t.size), np.flatnonzero(np.diff(t) <= 0.0) + 1)


def every_nth_step(t: Array, n: int) -> NDArray[np.intp]:
    """Indices of every n-th of the times t, and of both sides of each jump."""
    pieces = [np.append(piece[::n], piece[-1]) for piece in pieces_between_jumps(t)]
    return np.unique(np.concatenate(pieces))


class TimeWindows(NamedTuple):
    """Rows (WINDOWS, n) with `W @ f` = int W f dt of values f (n, ...) at times t, W = (1 - cos x)^2/4 in each window.

    W1, W2 : the same for W' and W''; that of W'' and a linear function is exactly zero.
    """

    W: Array
    W1: Array
    W2: Array

    @classmethod
    def over(cls, t: Array, end_time: float) -> TimeWindows:
        """Windows that are spread over the times t (n,) up to `end_time`."""
        share = 0.25  # length of a window over the run's
        length = share * end_time
        begins = np.linspace(0.0, end_time - length, WINDOWS)[:, None]
        k = 2.0 * math.pi / length
        x = np.clip(k * (t - begins), 0.0, 2.0 * math.pi)  # (WINDOWS, n)
        cos = np.cos(x)
        sin = np.sin(x)
        steps = np.diff(t, prepend=t[0], append=t[-1])
        dt = 0.5 * (steps[1:] + steps[:-1])  # of trapezoids (n,)
        W2 = 0.5 * k**2 * (sin**2 + (1.0 - cos) * cos) * dt
        rows = np.arange(WINDOWS)
        first = np.maximum(np.searchsorted(t, begins[:, 0]) - 1, 0)
        last = np.minimum(np.searchsorted(t, begins[:, 0] + length, side="right"), t.size - 1)
        W2[rows, last] -= np.sum(W2 * (t - t[first, None]), axis=1) / (t[last] - t[first])
        W2[rows, first] -= W2.sum(axis=1)
        return cls(0.25 * (1.0 - cos) ** 2 * dt, 0.5 * k * (1.0 - cos) * sin * dt, W2)

    @property
    def durations(self) -> Array:
        """int W dt (WINDOWS,) [s]."""
        return self.W.sum(axis=1)


def energy_defect_over_all_work(t: Array, energy: Array, kinetic: Array, powers: Sequence[Array]) -> Array:
    """Energy less work since the start (n,), over all work done.

    That is the integrals of |power| of all powers (n,), and by weight the range of the kinetic energy.
    """
    work = cumulative_trapezoid(sum(powers, np.zeros(t.size)), t, initial=0.0)
    all_work = sum(float(np.trapezoid(np.abs(power), t)) for power in powers) + float(np.ptp(kinetic))
    return (energy - energy[0] - work) / (all_work or 1.0)


# --- laws -------------------------------------------------------------------------------------------------------------


def shape_at_start_defects(x: SampledMotion, end_time: float) -> Array:
    """Largest distance (1,) of the rope at the start from catenaries with the length and the ends of its pieces.

    Over its length, beyond rounding. Pieces end at what touches the rope. Forces of the run are not used.
    """
    s, points, _ = x.rope_at_start
    ends = np.flatnonzero(np.isin(s, [body.s[0] for body in x.touching]))
    off = [0.0]
    for a, b in itertools.pairwise(ends):
        if b - a > 1:  # with stations inside
            shape = _catenary_through(s[a : b + 1] - s[a], points[b] - points[a], x.line)
            off.append(float(np.abs(points[a : b + 1] - points[a] - shape).max()))
    return np.array([max(max(off) / float(s[-1] - s[0]) - ROUNDING, 0.0)])


def contact_point_defects(x: SampledMotion, end_time: float) -> Array:
    """Largest distance (1,) of contacts from their points in the TOML, of springs by their force; over the rope."""
    off = [0.0]
    for contact, table in zip(x.contacts, x.line.contacts, strict=True):
        shift = x.at_samples(contact.point) - table["at"]  # (n, 2)
        if table["kind"] == "spring":
            shift = shift - x.at_samples(contact.pressure) / table["stiffness"]
        off.append(float(np.abs(shift).max()))
    s = x.rope_at_start.s
    return np.array([max(max(off) / float(s[-1] - s[0]) - ROUNDING, 0.0)])


def rope_length_defects(x: SampledMotion, end_time: float) -> Array:
    """Distance (1,) of the rope's length from that of the TOML, over it, beyond rounding."""
    expected = x.line.length_between_fixed_ends
    assert expected is not None
    s = x.rope_at_start.s
    return np.array([max(abs(float(s[-1] - s[0]) / expected - 1.0) - ROUNDING, 0.0)])


def _catenary_through(S: Array, end: Array, line: LineTables) -> Array:
    """Points (n, 2) [m] at lengths S (n,) [m] of the rope at rest from the origin to its `end` (2,) at the last one."""

    def points_with(force: Array) -> Array:
        rope = HangingRope.at_lengths(S, force[0], force[1], line.q, line.EA)
        return np.column_stack([rope.x, rope.y])

    chord = float(np.hypot(*end))
    stretched = line.EA * (chord / S[-1] - 1.0)
    guess = max(stretched, line.q * chord) * end / chord + 0.5 * line.q * S[-1] * DOWN
    return points_with(fsolve(lambda force: points_with(force)[-1] - end, guess))


def momentum_defects_by_window(x: SampledMotion, end_time: float) -> Array:
    """Defects (WINDOWS, 2) of the momentum of rope and cars in x and y, over the largest tension."""
    line = x.line
    force = line.q * x.rope_length[:, None] * DOWN  # (n, 2)
    momentum = np.zeros_like(force)  # of cars
    for body in x.bodies:
        weight = 1j * body.data["mass"] * line.gravity
        force += to_vectors(body.force + body.drag + weight)
        momentum += to_vectors(body.momentum)
    for contact in x.contacts:
        force -= x.at_samples(contact.pressure)
    at_ends = [x.at_samples(contact.point * contact.ds[:, None]) for contact in x.contacts]
    entering = line.rho * (at_ends[-1] - at_ends[0])
    touching = [*x.contacts, *x.cars]
    largest = max(float(np.max(x.at_samples(mean_tension(body)))) for body in touching)
    windows = TimeWindows.over(x.t, end_time)
    moment = line.rho * (x.rope_moment - x.rope_moment[0])
    change = windows.W2 @ moment + windows.W1 @ (entering - momentum)
    change -= line.damping_rate * (windows.W1 @ moment + windows.W @ entering)
    return (change - windows.W @ force) / (largest * windows.durations[:, None])


def counterweight_defects_by_window(x: SampledMotion, end_time: float) -> Array:
    """Defects (counterweights, WINDOWS) of their motion, over their forces."""
    line = x.line
    windows = TimeWindows.over(x.t, end_time)
    defects = []
    for outward, k, table in line.counterweights:
        G = table["tension"]
        contact = x.contacts[k]
        N = x.at_samples(tension_behind_or_ahead(contact))
        rise_rate = outward * (1.0 + G / line.EA) * x.at_samples(contact.ds)
        defects.append((windows.W @ (N / G - 1.0) + windows.W1 @ rise_rate / line.gravity) / windows.durations)
    return np.array(defects)


def energy_defects(x: SampledMotion, end_time: float) -> Array:
    """Energy less work since the start (n,), see `energy_defect_over_all_work`."""
    line = x.line
    kinetic = x.kinetic + sum(body.kinetic_energy for body in x.bodies)
    energy = kinetic - line.q * x.rope_depth + x.rope_squared_tension / (2.0 * line.EA)
    powers = [-2.0 * line.damping_rate * x.kinetic]
    for body in x.bodies:
        energy += body.potential_energy
        powers += body.powers
    for contact, table in zip(x.contacts, line.contacts, strict=True):
        if table["kind"] == "spring":
            shift = x.at_samples(contact.point) - table["at"]  # (n, 2)
            energy += 0.5 * (np.array(table["stiffness"]) * shift**2).sum(axis=1)
    for outward, k, table in line.counterweights:
        contact = x.contacts[k]
        N = x.at_samples(mean_tension(contact))
        ds = x.at_samples(contact.ds)
        entering = 0.5 * line.rho * (ds * (1.0 + N / line.EA)) ** 2
        per_length = N + N**2 / (2.0 * line.EA) + line.q * table["at"][1] - entering
        powers.append(-outward * ds * per_length)
    return energy_defect_over_all_work(x.t, energy, kinetic, powers)


def damping_power_defects(x: SampledMotion, end_time: float) -> Array:
    """Largest distance (1,) of the power that damping takes from the rope's motion from that by the TOML's rate."""
    of_rope = x.kinetic_of_run - sum(body.kinetic_energy for body in x.bodies)
    expected = -2.0 * x.line.damping_rate * of_rope
    distance = float(np.abs(x.damping_power - expected).max()) / float(np.abs(expected).max() or 1.0)
    return np.array([max(distance - ROUNDING, 0.0)])


def body_moment_defects_by_window(x: SampledMotion, end_time: float) -> Array:
    """Defects (bodies, WINDOWS) of the moment of momentum of cabins and two-wheel cars, over their weight and size."""
    windows = TimeWindows.over(x.t, end_time)
    defects = []
    for body in x.turning_bodies:
        moment, momentum = body.moment_and_angular_momentum()
        scale = body.masses[1][0] * body.g * body.size
        defects.append((windows.W @ moment + windows.W1 @ momentum) / (scale * windows.durations))
    return np.array(defects)


def turning_body_force_defects_by_window(x: SampledMotion, end_time: float) -> Array:
    """Defects (contacts, WINDOWS) of the forces of cabins and wheels on the rope, by its kinks, over weight."""
    windows = TimeWindows.over(x.t, end_time)
    defects = []
    for body in x.turning_bodies:
        for touching in body.touching:
            defect = touching.force_on_rope - touching.force_on_rope_by_kink(x.line.rho)
            defects.append(np.abs(windows.W @ defect) / (body.data["mass"] * body.g * windows.durations))
    return np.array(defects)


def centre_of_mass_defects(x: SampledMotion, end_time: float) -> Array:
    """Distances beyond rounding of centres of mass from where contacts and angles put them, over the body's size."""
    distances = []
    for body in x.turning_bodies:
        centre = to_complex(x.at_samples(body.turning.centre))
        distances.append(np.max(np.abs(centre - body.c)) / body.size)
    return np.maximum(np.array(distances) - ROUNDING, 0.0)


def relative_holding_force_excesses_by_window(x: SampledMotion, end_time: float) -> Array:
    """Means (cars, WINDOWS) of forces that hold standing cars, beyond friction and brakes, over the weight.

    By the rope's tensions: waves pass the limit for moments; the mean of a car that stays does not.
    """
    windows = TimeWindows.over(x.t, end_time)
    excesses = []
    for body in x.bodies:
        needed = np.abs(windows.W @ (body.held_by_friction * body.touching[-1].along))
        largest = windows.W @ (body.held_by_friction * body.resistance)
        excesses.append((needed - largest) / (body.data["mass"] * body.g * windows.durations))
    return np.maximum(excesses, 0.0)


def timetable_defects(x: SampledMotion, end_time: float) -> Array:
    """Largest distance (1,) of a car from the timetable of the TOML, over the way that it goes."""
    line = x.line
    t = x.t
    defects = [0.0]
    for car in x.cars:
        travel = line.cars[car.name].get("travel")
        if travel is None:
            continue
        in_x = is_hauled_in_x(line.cars[car.name], len(line.contacts))
        positions = x.at_samples(car.point[:, 0] if in_x else car.s / line.heat)
        begin = travel.get("from", 0.0)
        if travel["kind"] == "table":
            rows = np.array(travel["times"]) <= t[-1]
            positions = np.interp(np.array(travel["times"])[rows], t, positions)
            expected = begin + np.array(travel["positions"])[rows]
            way = travel["positions"][-1]
        else:
            way = abs(travel["to"] - begin)
            forward = Timetable(travel | {"from": 0.0, "to": way}, {}, way)
            expected = begin + math.copysign(1.0, travel["to"] - begin) * forward.positions_at(t)
        defects.append(float(np.abs(positions - expected).max()) / way)
    return np.array([max(max(defects) - ROUNDING, 0.0)])


def event_place_defects(x: SampledMotion, end_time: float) -> Array:
    """Largest distance (1,) of cars at events of brakes and shoes from where the TOML has these, over the rope.

    1 if a brake acts at the end, or does not, against the place of its car.  Of a car that rolls and leaves the rope
    before the tip of a shoe: what the rope still gives it, over its weight.  Events are at steps: all of them count.
    """
    length = float(x.contacts[-1].s[0] - x.contacts[0].s[0])
    located_to = 1e-6  # of the length: steps end at events to the tolerance of Newton's method
    defects = [0.0]
    for car in x.cars:
        brakes = x.line.brake_positions(car.name)
        begun, ended = (_times_of_event(x, car, event) for event in BRAKE_EVENTS)
        at_events = np.interp([*begun, *ended], x.all_times, car.s)
        off_brakes = np.abs(brakes - at_events[:, None]).min(axis=1, initial=length)
        defects += [distance / length for distance in (*off_brakes, *_distances_at_shoe_events(x, car))]
        defects += _pressure_of_rope_left(x, car)
        passed = int(np.sum(brakes <= car.s[-1])) - int(np.sum(brakes <= car.s[0]))
        ends_at_brake = np.abs(brakes - car.s[-1]).min(initial=length) <= located_to * length
        defects.append(float(len(begun) - len(ended) != passed and not ends_at_brake))
    return np.array([max(max(defects) - located_to, 0.0)])


def _times_of_event(x: SampledMotion, car: Any, name: str) -> list[float]:
    return [t for event, t in x.events if event == f"{car.name} {name}"]


def _distances_at_shoe_events(x: SampledMotion, car: Any) -> Iterator[float]:
    """Distances [m] of a car from the end of a shoe at events of that shoe."""
    for contact in x.line.contacts:
        shoe = contact.get("shoe")
        if not shoe:
            continue
        times = [t for verb in SHOE_VERBS for t in _times_of_event(x, car, f"{verb} the shoe of {contact['name']}")]
        off_saddle = np.interp(times, x.all_times, car.point[:, 0]) - contact["at"][0]
        yield from np.abs(np.abs(off_saddle) - shoe).tolist()


def _pressure_of_rope_left(x: SampledMotion, car: Any) -> Iterator[float]:
    """Force of the rope on a car as it leaves it, over its weight; or how far the tip of the shoe is, if nearer."""
    data = x.line.cars[car.name]
    grips = drive_mode(data) == "grip"
    for contact in x.line.contacts:
        for t in _times_of_event(x, car, f"leaves the rope at {contact['name']}"):
            before = int(np.searchsorted(x.all_times, t * (1.0 - ROUNDING)))
            off_tip = abs(abs(float(car.point[before, 0]) - contact["at"][0]) / contact["shoe"] - TIP)
            behind, ahead = to_complex(np.stack([car.slope_behind[before], car.slope_ahead[before]]))
            turn = abs(float(np.angle(ahead / behind)))
            of_rope = turn * float(car.tension_behind[before]) / (data["mass"] * x.line.gravity)
            yield off_tip if grips else min(off_tip, of_rope)


def _any_free_car_sticks(line: LineTables, motion: Any) -> bool:
    """Whether friction holds a free car for a while."""
    for car in motion.cars:
        free = drive_mode(line.cars[car.name]) == "free"
        stands = car.ds == 0.0
        if free and np.any(stands[:-1] & stands[1:]):
            return True
    return False


Law = Callable[[SampledMotion, float], Array]  # defects of a run up to a time [s]


def laws_that_apply(line: LineTables, motions: Sequence[Any]) -> dict[str, Law]:
    """Laws of some motions of a line, by name."""
    laws: dict[str, Law] = {
        "points of contacts": contact_point_defects,
        "shape of the rope at the start": shape_at_start_defects,
        "momentum of rope and cars": momentum_defects_by_window,
        "energy and work": energy_defects,
    }
    if any(car.turning is not None for car in motions[0].cars):
        laws["moment of momentum of bodies"] = body_moment_defects_by_window
        laws["forces on kinks of the rope"] = turning_body_force_defects_by_window
        laws["centres of mass"] = centre_of_mass_defects
    if any(_any_free_car_sticks(line, motion) for motion in motions):
        laws["friction that holds cars"] = relative_holding_force_excesses_by_window
    return laws | _laws_of_contacts_and_drives(line)


def _laws_of_contacts_and_drives(line: LineTables) -> dict[str, Law]:
    laws: dict[str, Law] = {}
    if line.damping_rate:
        laws["power of damping"] = damping_power_defects
    if line.length_between_fixed_ends is not None:
        laws["length of the rope"] = rope_length_defects
    if line.counterweights:
        laws["motion of the counterweight"] = counterweight_defects_by_window
    if any("travel" in car for car in line.cars.values()):
        laws["timetables"] = timetable_defects
    braked = any(line.brake_positions(car).size for car in line.cars)
    if braked or any(contact.get("shoe") for contact in line.contacts):
        laws["places of events"] = event_place_defects
    return laws


@damaged_files_are_faults
def faults_of_line_files(folder: Path, motion: Any, design: Sequence[dict[str, Any]], period: float) -> Iterator[str]:
    """Faults of path-NAME.csv, contacts.csv and the design numbers, each a sentence; none where all is as computed.

    period : [s] over which printed forces are means.
    """
    files = _LineFiles(folder, motion, period)
    balance = 1e-3  # of a load by hand: elements balance a car along the rope in the mean over its segments
    for car in motion.cars:
        name = f"path-{car.name}.csv"
        path = files.paths[car.name]
        yield from _column_faults(name, path, _expected_columns_of_car(car, motion))
        yield from [f"{name}: {column} is not there" for column in ("u", "v") if column not in path]
        yield from _column_faults(name, path, _wheel_loads_by_hand(files.line, car, motion), balance)
    for contact in motion.contacts:
        yield from _column_faults("contacts.csv", files.contacts, _expected_columns_of_contact(contact))
    for number in design:
        yield from files.faults_of_design_number(number)


def _expected_columns_of_car(car: Any, motion: Any) -> dict[str, Array]:
    """Columns (n,) of a car's file."""
    x, y = car.point.T
    columns = {
        "t": motion.t, "s_o": car.s, "x": x, "y": y, "F_contact": car.contact_force, "F_haul": car.haul_force,
        "T_behind": car.tension_behind, "T_ahead": car.tension_ahead, "speed": np.hypot(*car.velocity.T),
    }  # fmt: skip
    if car.shoe_force.any():
        columns["F_shoe"] = car.shoe_force
    if car.turning is not None:
        columns["pitch" if car.turning.wheels else "swing"] = np.degrees(car.turning.angle)
        for wheel in car.turning.wheels:
            columns[f"wheel_{wheel.name.rpartition('.')[2]}"] = wheel.load
    return columns


def _expected_columns_of_contact(contact: Any) -> dict[str, Array]:
    """Columns (n,) of contacts.csv."""
    columns = {"s": contact.s, "rise": contact.rise}
    behind = contact.tension_behind  # not by the function that the file is written with
    columns["tension"] = np.where(np.isfinite(behind), behind, contact.tension_ahead)
    columns["pressure"] = np.hypot(*contact.pressure.T)
    return {f"{contact.name}.{name}": values for name, values in columns.items()}


class _LineFiles:
    """What the files of a line in motion say."""

    def __init__(self, folder: Path, motion: Any, period: float) -> None:
        self.folder = folder
        self.line = LineTables((folder / "scene.toml").read_text(encoding="utf-8"))
        self.profiles = obstacle_and_ground_profiles(self.line.data)
        self.near = ROUNDING * self.line.contacts[-1]["at"][0]  # [m]
        self.motion = motion
        self.period = period
        self.paths = {car.name: read_csv_columns(folder / f"path-{car.name}.csv") for car in motion.cars}
        self.contacts = read_csv_columns(folder / "contacts.csv")
        self.t = self.contacts["t"]

    def faults_of_design_number(self, number: dict[str, Any]) -> Iterator[str]:
        """Faults of a design number: it is not the extreme, or not the value at its time, or its car is elsewhere."""
        name = number["quantity"]
        values = self._extreme_and_value_at_time(number)
        allowed = (number["bar"] or 0.0) + 1e-9 * abs(number["value"])
        if not all(abs(value - number["value"]) <= allowed for value in values):
            stored = ", at its time ".join(f"{value:.6g}" for value in values)
            yield f"{name} = {number['value']:.6g}: the files give {stored}"
        path = self.paths.get(name.partition(":")[2].partition(".")[0])
        if path is None:
            return
        s_o = np.interp(number["t"], self.t, path["s_o"])
        distance = abs(s_o - number["s_o"])
        if distance > 1e-9 * number["s_o"]:
            yield f"{name}: the car is not at {number['s_o']:.6g} m then"

    def _extreme_and_value_at_time(self, number: dict[str, Any]) -> list[float]:
        """Of the files: the extreme of a design number, and of a series its value at the number's time."""
        kind, _, of = number["quantity"].partition(":")
        name, _, word = kind.rpartition("_")
        if name == "clearance":
            lowest, then = self._clearances_ever_and_at(kind, of, number["t"])
            same = abs(then - number["value"]) <= self.near  # no mean is taken: to rounding, not to the bar
            return [lowest, then if same else math.inf]
        if name == "safety_factor":
            values = self.line.data["cable"]["breaking_load"] / self._averaged_series("tension")
        else:
            values = self._averaged_series(f"{name}:{of}" if of else name)
        if name in ("grip", "contact") and drive_mode(self.line.cars[of]) == "grip":
            values = _moving_means(self.t, values, self.period)  # a car that grips rings: means of means
        now = self.t == self.t[np.argmin(np.abs(self.t - number["t"]))]
        pick = np.max if word == "max" else np.min
        return [float(pick(values)), float(pick(values[:, now]))]

    def _averaged_series(self, quantity: str) -> Array:
        """Series (k, n) of a quantity, forces averaged over the period; of a load the length of its vector (1, n)."""
        kind = quantity.partition(":")[0]
        values = np.array(self._columns_by_quantity[quantity])
        if kind.startswith(("tension", "haul", "grip", "contact", "load", "wheel", "stress")):
            values = _moving_means(self.t, values, self.period)
        return np.hypot(*values)[None] if kind == "load" else values

    def _clearances_ever_and_at(self, kind: str, body_over_obstacle: str, t: float) -> Iterator[float]:
        """Smallest heights [m] of a car over an obstacle or the ground, ever and at a time; of the rope with the cars.

        kind : clearance_car or clearance_rope.
        """
        body, _, over = body_over_obstacle.rpartition(" over ")
        profile = self.profiles[over]
        below = 0.0
        paths = list(self.paths.values())
        ropes = self._rope_points()
        if kind == "clearance_car":
            below = self.line.cars[body].get("below", 0.0)
            paths = [self.paths[body]]
            ropes = ropes[:, :0]
        curves = [*ropes, *(np.column_stack([path["x"], path["y"]]) for path in paths)]
        yield min(min_height_over(profile, *curve.T) for curve in curves) - below
        points = [[np.interp(t, self.t, path[axis]) for axis in "xy"] for path in paths]
        heights = [height_over_at(profile, x, y, self.near) for x, y in points]
        heights += [min_height_over(profile, *curve.T) for curve in ropes[np.abs(self.t - t) <= ROUNDING * t]]
        yield min(heights) - below

    def _rope_points(self) -> Array:
        """Points (n, k, 2) at steps, nan beyond the rope, in order of s; not by the chain that is written from."""
        motion = self.motion
        wheels = [wheel for car in motion.cars if car.turning is not None for wheel in car.turning.wheels]
        bodies = [*motion.contacts, *motion.cars, *wheels]
        s = np.column_stack([np.tile(motion.s, (motion.t.size, 1)), *(body.s for body in bodies)])
        points = np.concatenate([motion.points, np.stack([body.point for body in bodies], axis=1)], axis=1)
        order = np.argsort(s, axis=1, kind="stable")
        return np.take_along_axis(points, order[..., None], axis=1)

    @cached_property
    def _columns_by_quantity(self) -> Entries:
        """Columns by quantity; of a load its two components."""
        columns = Entries(self.folder, "column of", {"tension": []})
        for contact in self.motion.contacts:
            name = contact.name
            s = self.contacts[f"{name}.s"]
            columns["tension"].append(self.contacts[f"{name}.tension"])
            columns[f"rise:{name}"] = [self.contacts[f"{name}.rise"]]
            columns[f"flow:{name}"] = [s - s[0]]
            columns[f"load:{name}"] = list(contact.pressure.T)
        for car in self.motion.cars:
            path = self.paths[car.name]
            columns["tension"] += [path["T_behind"], path["T_ahead"]]
            columns[f"grip:{car.name}"] = [car.grip_force]
            for kind, column in COLUMN_OF_QUANTITY.items():
                if column in path:
                    columns[f"{kind}:{car.name}"] = [path[column]]
            for side in ("rear", "front"):
                if f"wheel_{side}" in path:
                    columns[f"wheel:{car.name}.{side}"] = [path[f"wheel_{side}"]]
            for kind, stresses in self._rope_stresses_at_wheels(car.name, path).items():
                columns[f"{kind}:{car.name}"] = stresses
        return columns

    def _rope_stresses_at_wheels(self, car_name: str, path: dict[str, Array]) -> dict[str, list[Array]]:
        """Of the rope behind the rear and ahead of the front wheels of a car, by kind."""
        wheels = self.line.cars[car_name].get("wheels", {})
        stresses: dict[str, list[Array]] = {}
        if not wheels:
            return stresses
        for side, N in (("rear", path["T_behind"]), ("front", path["T_ahead"])):
            load = path.get(f"wheel_{side}", 0.5 * path["F_contact"])
            Q = load * 2.0 / wheels.get("count", 2)
            for kind, values in tension_ratio_and_rope_stresses_at_wheel(self.line.data["cable"], wheels, N, Q).items():
                stresses.setdefault(kind, []).append(values)
        return stresses


def _wheel_loads_by_hand(line: LineTables, car: Any, motion: Any) -> dict[str, Array]:
    """Loads (n,) of both wheels of a point car by the balance of moments about its centre of mass."""
    data = line.cars[car.name]
    wheels = data.get("wheels", {})
    if wheels.get("model") != "point" or "base" not in wheels:
        return {}
    body = CarBody(data, car, motion, np.asarray, line.gravity)
    rope = body.touching[0]
    turning = body.moment + wheels.get("below", 0.0) * rope.along * rope.projection
    front = rope.load * (0.5 + wheels.get("ahead", 0.0) / wheels["base"]) + turning / wheels["base"]
    return {"wheel_rear": rope.load - front, "wheel_front": front}


def _column_faults(
    file: str, table: dict[str, Array], expected: dict[str, Array], rounding: float = ROUNDING
) -> Iterator[str]:
    """Faults of the expected columns (n,) of a table."""
    for name, values in expected.items():
        for fault in series_faults(name, table.get(name, np.empty(0)), values, rounding):
            yield f"{file}: {fault}"


def _moving_means(t: Array, rows: Array, period: float) -> Array:
    """Means of rows (k, n) over the `period` around each time, inside the run; they follow splines between jumps."""
    latest = max(t[-1] - period, t[0])
    begins = np.clip(t - 0.5 * period, t[0], latest)
    ends = np.minimum(begins + period, t[-1])
    total = np.zeros_like(rows)
    for part in pieces_between_jumps(t):
        if part.size > 1:
            integral = CubicSpline(t[part], rows[:, part], axis=1).antiderivative()
            begin, end = np.clip([begins, ends], t[part[0]], t[part[-1]])
            total += integral(end) - integral(begin)
    return total / (ends - begins)
