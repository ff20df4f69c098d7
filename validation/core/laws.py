"""Laws of mechanics in SI, checked on a response and the scene's TOML alone: they see faults that both wings share.

A defect is over the law's own scale, zero for the exact answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cablefem.response import Array, Response
from validation.core import rest
from validation.core.agreement import Agreement, Bound, BoundPart
from validation.core.evidence import Evidence, Side, TimeWindows, Window, cross_product
from validation.core.order import FIRST, SAFETY, error_bar
from validation.core.scene_data import DOWN, ROUNDING, ordinate_on_unit_slope, thrust_times_and_forces


class Defect(NamedTuple):
    """Defect of a law at positions s_o/l (nan: anywhere); its size is the rms, or that of the mean."""

    s_o: Array  # (k,)
    value: Array  # (k, c)
    averaged: bool = False

    @property
    def rms_or_mean(self) -> Array:
        """The size (c,)."""
        if self.averaged:
            return np.abs(np.mean(self.value, axis=0))
        return np.sqrt(np.mean(self.value**2, axis=0))

    def column_distances(self, a: Array, b: Array) -> Array:
        """Distance (c,) of two values (k, c) of this law.

        Changes of single frames may cancel in a mean by chance: it is uncertain by their rms over the root of k.
        """
        if a.shape != b.shape or not np.isfinite(b).all():
            return np.full(a.shape[1], math.inf)
        rms = np.sqrt(np.mean((a - b) ** 2, axis=0))
        if not self.averaged:
            return rms
        return np.maximum(np.abs(np.mean(a - b, axis=0)), rms / math.sqrt(len(a)))


NOT_OBSERVED = Defect(np.empty(0), np.empty((0, 1)))  # no frame shows the law


def law_rows_in_si(
    ladder: Any, window: Window, until: float = math.inf, tolerance: Callable[[str], float | None] = lambda kind: None
) -> Iterator[Agreement]:
    """One row for each law that applies to the finest run of a `ladder.Ladder`, of its component of the worst defect.

    window : s_o/l;  until : [s];  tolerance : of a kind of law.
    """
    judged = _EvidenceOfLadder(ladder, window, until)
    for name, law in LAWS.items():
        if law.concerns(judged.finest):
            row = _row_of_worst_component(law, judged)
            label = "" if name == law.quantity else name
            yield replace(row, law=label, required=tolerance(law.tolerance_kind), decides=bool(law.tolerance_kind))


def quasi_static_law_rows(r: Response) -> Iterator[Agreement]:
    """Rows of the laws that a quasi-static run keeps to rounding, as each run does: of its cable, start and events."""
    evidence = Evidence(r, TimeWindows(r.fields.t[::2], r.t))
    interpolation = BoundPart(r.method, 1e-6, "interpolation")  # relative, of the statics
    for name, law in LAWS.items():
        if (law.exact or law.at_start) and law.concerns(evidence):
            gap, of_every_second = (
                float(np.abs(law.defect(x).value).max()) for x in (evidence, evidence.with_halved_fields())
            )
            sampling = BoundPart(r.method, abs(gap - of_every_second), "sampling")
            yield Agreement(law.quantity, gap, Bound("law", (interpolation, sampling)), law=name)


class _EvidenceOfLadder:
    """Evidence of all runs of a ladder, and of half and a quarter of the finest run's steps, and of its stations."""

    def __init__(self, ladder: Any, window: Window, until: float) -> None:
        self.ladder = ladder
        windows = TimeWindows.over_part_of_run(ladder.finest, window, until)
        self.by_run = {id(r): Evidence(r, windows) for r in ladder.runs}
        self.finest = self.by_run[id(ladder.finest)]
        steps = self.finest.without_every_second_step()
        self.sparse_steps = steps, steps.without_every_second_step()
        stations = self.finest.with_halved_fields()
        self.sparse_stations = stations, stations.with_halved_fields()


def _row_of_worst_component(law: Law, judged: _EvidenceOfLadder) -> Agreement:
    """The component of a law's defect that is largest over its bar; nan: no frame shows the law, or it is unknown."""
    defect = law.defect(judged.finest)
    gap = math.nan
    bar = math.inf
    parts = math.nan, 0.0
    where = None
    if defect.s_o.size and np.isfinite(defect.value).all():
        space, time = _space_and_time_error_bars(law, defect, judged)
        time = time + _sampling_error_bars(law, defect, judged.sparse_steps)  # more steps lessen both
        bars = space + time + _sampling_error_bars(law, defect, judged.sparse_stations)
        sizes = defect.rms_or_mean
        i = int((sizes / bars).argmax())
        gap = float(sizes[i])
        if np.isfinite(bars[i]):
            bar = float(bars[i])
        parts = float(space[i]), float(time[i])
        largest = float(defect.s_o[np.abs(defect.value[:, i]).argmax()])
        where = None if math.isnan(largest) else largest
    bound = Bound("law", (BoundPart(judged.ladder.finest.method, bar, "coarser runs and sampling"),))
    return Agreement(law.quantity, gap, bound, where, parts=(parts,))


def _space_and_time_error_bars(law: Law, defect: Defect, judged: _EvidenceOfLadder) -> tuple[Array, Array]:
    """Bars (c,) of a defect in space and time."""
    ladder = judged.ladder
    values = {key: (defect if law.exact else law.defect(x)).value for key, x in judged.by_run.items()}
    space, time = ladder.error_bars_in_space_and_time(lambda r: values[id(r)], defect.column_distances, FIRST)
    components = defect.rms_or_mean.shape
    space = np.broadcast_to(space, components)
    time = np.broadcast_to(time, components)
    if law.at_start:
        space = np.maximum(space, SAFETY * ladder.start_gap)
    return space, time


def _sampling_error_bars(law: Law, defect: Defect, sparse: tuple[Evidence, Evidence]) -> Array:
    """Bars (c,) of a defect by half and a quarter of what it is computed from."""
    half, quarter = (law.defect(x).value for x in sparse)
    change = defect.column_distances(defect.value, half)
    next_change = defect.column_distances(half, quarter)
    return ROUNDING + error_bar(change, next_change, (2.0, 2.0), FIRST)


DefectOf = Callable[[Evidence], Defect]


class Law(NamedTuple):
    defect: DefectOf
    concerns: Callable[[Evidence], bool]
    quantity: str = "laws_si"  # of the row
    tolerance_kind: str = "rest"  # or "velocity" (`rows.tolerance_of_quantity_kind`); "" if only shown
    exact: bool = False  # to rounding in every run
    at_start: bool = False  # of the point (x, y) at which the car starts


LAWS: dict[str, Law] = {}


def _register_law(
    name: str, concerns: Callable[[Evidence], bool] = lambda evidence: True, **options: Any
) -> Callable[[DefectOf], DefectOf]:
    """Decorate the defect of a law: put it into `LAWS` under the name that rows and files show.

    options : other fields of the `Law`.
    """

    def register(defect: DefectOf) -> DefectOf:
        LAWS[name] = Law(defect, concerns, **options)
        return defect

    return register


def _car_rolls(evidence: Evidence) -> bool:
    return evidence.r.drive != "grip"


def _frames_resolve_waves(evidence: Evidence) -> bool:
    """Whether frames follow each other at less than a tenth of a transverse wave's time along the cable."""
    r = evidence.r
    k = evidence.window_frame_indices
    t = r.fields.t[k[0] : k[-1] + 1]
    crossing_time = r.length * math.sqrt(evidence.data.rho / r.horizontal_tension)
    largest = 0.1  # of a transverse wave's time along the cable: rarer frames hide velocities
    return float(np.diff(t).max(initial=0.0)) <= largest * crossing_time


def _can_extrapolate_at_any_frame(evidence: Evidence) -> bool:
    return any(_can_extrapolate_to_mass(pair) for pair in evidence.rope_sides_at_window_times)


def _can_extrapolate_to_mass(sides: tuple[Side, Side]) -> bool:
    """Whether each side has nodes enough to extrapolate the fields to the mass."""
    return all(side.s.size > 4 for side in sides)


def _has_separate_pointwise_tension(evidence: Evidence) -> bool:
    """Whether the run of a full model has tensions by the strain at the mass beside those by balances."""
    r = evidence.r
    return r.model == "full" and not np.array_equal(r.T_behind, r.T_behind_pointwise, equal_nan=True)


def _tension_only_at(r: Response, t: Array) -> NDArray[np.bool_]:
    """At which of the times t (n,) the law excludes compression."""
    if r.switched is None:
        return np.full(t.shape, r.law == "tension-only")
    return t > r.slack_time_or_inf


def _defect_without_position(*values: float) -> Defect:
    """The defect of a law that holds nowhere in particular: one row of these components."""
    return Defect(np.array([math.nan]), np.array([values]).reshape(1, -1))


def _defect_at_window_times(evidence: Evidence, value: Array) -> Defect:
    """The defect of values (k,) or (k, ...) at window times."""
    frames = evidence.window_frame_indices
    s_o = evidence.r.fields.s_o[frames] / evidence.r.length
    return Defect(s_o, value.reshape(frames.size, -1))


def _window_change_defect(evidence: Evidence, conserved: Array, scale: float, t: Array | None = None) -> Defect:
    """Change over each window of a quantity (k, c) that should be conserved, at the times t; over a scale.

    t : (k,) [s], by default the window times.
    """
    r = evidence.r
    times = evidence.windows.frames if t is None else t
    s_o = np.interp(times, r.t, r.s_o) / r.length
    middles = 0.5 * (s_o[1:] + s_o[:-1])
    return Defect(middles, np.diff(conserved, axis=0) / scale)


def _window_change_defect_of_steps(evidence: Evidence, conserved: Array, scale: float) -> Defect:
    """The same of a quantity (n, c) that is known at all steps."""
    t = evidence.windows.steps
    return _window_change_defect(evidence, evidence.interpolate_steps(t, conserved), scale, t)


# --- the cable at rest -----------------------------------------------------------------------------


@_register_law("ends at rest", exact=True)
def cable_ends_at_rest_defect(evidence: Evidence) -> Defect:
    """The cable ends at its supports; over the span."""
    f = evidence.r.fields
    data = evidence.data
    off_left = [f.x[0], f.y[0]]
    off_right = [f.x[-1] - data.span, f.y[-1] - data.drop]
    return _defect_without_position(*(np.array(off_left + off_right) / data.span))


@_register_law("length at rest", exact=True)
def cable_length_at_rest_defect(evidence: Evidence) -> Defect:
    """Stations measure arc length up to the length asked for (heat, ice: unstretched); over it."""
    r = evidence.r
    s = r.fields.s
    name, value = evidence.data.prescribed
    length = r.length
    if name == "length":
        length = value
    elif name == "unstretched":
        strain = CubicSpline(s, r.fields.T_static / evidence.data.EA)
        mean_strain = strain.integrate(s[0], s[-1]) / s[-1]
        length = value * (1.0 + mean_strain)
    arc = np.cumsum(_arc_lengths(evidence.rest_curve(s)))
    off_arc = float(np.abs(arc - s[1:]).max())
    off = np.array([s[0], off_arc, r.length - s[-1], s[-1] - length])
    return _defect_without_position(*(off / s[-1]))


@_register_law("shape at rest", exact=True)
def prescribed_sag_or_tension_defect(evidence: Evidence) -> Defect:
    """Sag or horizontal tension as asked for; over itself."""
    name, value = evidence.data.prescribed
    f = evidence.r.fields
    actual = value
    if name == "sag":
        slope = evidence.data.drop / evidence.data.span
        below_chord = CubicSpline(f.s, f.y - slope * f.x)
        level = below_chord.derivative().roots(extrapolate=False)
        actual = max([0.0, *below_chord(level).tolist()])
    elif name == "horizontal_tension":
        actual = evidence.r.horizontal_tension
    return _defect_without_position(actual / value - 1.0)


@_register_law("forces at rest", exact=True)
def cable_forces_at_rest_defect(evidence: Evidence) -> Defect:
    """T x' = H, over H; T y' falls by rho g per metre, over rho g l."""
    f = evidence.r.fields
    H = evidence.r.horizontal_tension
    weight = evidence.data.rho * evidence.data.gravity
    force = f.T_static[:, None] * evidence.rest_curve(f.s, 1)  # (m, 2)
    off_H = np.abs(force[:, 0] - H).max()
    off_weight = np.abs(force[0, 1] - force[:, 1] - weight * f.s).max()
    return _defect_without_position(off_H / H, off_weight / (weight * f.s[-1]))


# --- travel and drive --------------------------------------------------------------------------------


@_register_law("travel", lambda evidence: evidence.r.drive != "free", exact=True)
def prescribed_travel_defect(evidence: Evidence) -> Defect:
    """s_o(t) is the travel of the TOML; over the length."""
    r = evidence.r
    travel = evidence.data.travel
    l = r.fields.s[-1]
    if travel["kind"] == "table":
        return _defect_without_position(_largest_timetable_position_gap(evidence) / l)
    steps = evidence.steps_in_windows_off_supports
    s = r.s_o[steps]
    off = s - evidence.timetable.positions_at(r.t[steps])
    worst = np.argmax(np.abs(off))
    return Defect(s[worst, None] / l, off[worst, None, None] / l)


def _largest_timetable_position_gap(evidence: Evidence) -> float:
    """Largest gap [m] of s_o to a travel's table, at the ends of its pieces within the windows."""
    r = evidence.r
    travel = evidence.data.travel
    t = r.t[evidence.steps_in_windows_off_supports]
    begin = t[0]
    end = t[-1]
    start = evidence.timetable.start_position
    stop = min(end, travel.get("stop", {}).get("time", math.inf))
    off = [0.0]
    for (low, high), position in zip(pairwise(travel["times"]), travel["positions"][1:], strict=True):
        piece = np.flatnonzero((r.t >= low) & (r.t <= high) & (r.t <= end))
        if piece.size >= 4 and begin <= high <= stop:
            last = piece[-4:]
            cubic = np.polyfit(r.t[last] - high, r.s_o[last], 3)
            off.append(cubic[-1] - (position + start))
    return float(np.abs(off).max())


def _excess_speed_after_stop(evidence: Evidence, stop: float) -> float:
    """Speed [m/s] of a stopped car beyond that of a car at rest, a mean over the last axial round trip since its stop.

    stop : its time [s], which may be the end of the run; see `_largest_speed_at_rest`.
    """
    r = evidence.r
    speed = float(r.speed[-1])
    duration = min(r.t[-1] - stop, evidence.data.round_trip)
    if duration > 0.0:
        before = np.interp(r.t[-1] - duration, r.t, r.s_o)
        speed = abs(r.s_o[-1] - before) / duration
    return max(0.0, speed - 1.01 * _largest_speed_at_rest(evidence))


def _largest_speed_at_rest(evidence: Evidence) -> float:
    """Largest speed [m/s] of a car at rest: `rest_speed`, or F/(2 sqrt(rho EA)) as cable springs back from brakes F."""
    data = evidence.data
    braking = sum(brake["force"] for brake in data.drive.get("brake", []) if brake["from"] <= evidence.r.s_o[-1])
    return float(max(data.drive.get("rest_speed", 1e-3), braking / (2.0 * math.sqrt(data.rho * data.EA))))


def _stop_time(evidence: Evidence) -> float:
    """When [s] friction or brakes first hold a car near where it ends: its slip along the cable turns or ends there.

    Without such a standstill the end of the run.
    """
    r = evidence.r
    drive = evidence.data.drive
    if not drive.get("rolling_friction") and not drive.get("brake"):
        return float(r.t[-1])
    slips = np.diff(r.s_o)
    if not slips.any():  # held from the start
        return float(r.t[0])
    halts = 1 + np.flatnonzero((slips[:-1] != 0.0) & (slips[:-1] * slips[1:] <= 0.0))  # steps
    near = evidence.data.round_trip * _largest_speed_at_rest(evidence)
    at_end = halts[np.abs(r.s_o[halts] - r.s_o[-1]) <= near]
    return float(r.t[at_end[0] if at_end.size else -1])


@_register_law("drive", _car_rolls, exact=True)
def drive_and_event_defect(evidence: Evidence) -> Defect:
    """Start, brakes, arrival and thrust are those of the TOML; over length, time, top speed, thrust."""
    r = evidence.r
    l = r.fields.s[-1]
    off = [(r.s_o[0] - evidence.timetable.start_position) / l, *_relative_event_gaps(evidence)]
    times, forces = thrust_times_and_forces(evidence.data.drive)
    if r.drive == "free" and forces.any():
        smooth = np.abs(r.t[:, None] - times).min(axis=1) > 1e-6 * r.t[-1]
        known = np.isfinite(r.F_haul)  # not in a quasi-static ride
        off_thrust = np.abs(r.F_haul - evidence.thrust_or_haul_force)[smooth & known]
        off.append(off_thrust.max(initial=0.0) / float(np.abs(forces).max()))
    return _defect_without_position(float(np.abs(off).max()))


def _relative_event_gaps(evidence: Evidence) -> list[float]:
    """Gaps of events in position and speed to the run, and to the TOML; over length, top speed and duration."""
    r = evidence.r
    drive = evidence.data.drive
    table = evidence.timetable
    l = r.fields.s[-1]
    thrust_times, _ = thrust_times_and_forces(drive)
    times = {"release": drive.get("release", 0.0), "thrust_end": float(thrust_times[-1])}
    # [m] one of which is that of the event
    positions = {"arrival": [table.arrival_position], "back": [0.5 * min(table.start_position, 0.01 * l)]}
    positions["brake"] = [brake["from"] for brake in drive.get("brake", [])]
    gaps = _missing_or_extra_event_counts(evidence)
    for event in r.events:
        kind = event["event"]
        t = event["t"]
        s_o = event["s_o"]
        speed = np.interp(t, r.t, r.speed)
        if kind == "stop":
            speed = _excess_speed_after_stop(evidence, t)
            gaps.append((t - _stop_time(evidence)) / r.t[-1])
        gaps.append((t - np.clip(t, r.t[0], r.t[-1])) / r.t[-1])  # beyond the run
        gaps.append((np.interp(t, r.t, r.s_o) - s_o) / l)
        gaps.append((speed - event["speed"]) / (float(r.speed.max()) or 1.0))
        if kind in times:
            gaps.append(abs(t - times[kind]) / r.t[-1])
        if positions.get(kind):
            gaps.append(min(abs(s_o - x) for x in positions[kind]) / l)
    return gaps


def _missing_or_extra_event_counts(evidence: Evidence) -> list[float]:
    """How many events of each kind the run lacks, or has too many, by its path and the TOML.

    Brakes that begin at one place count once, each time the car rolls on to them. Of turns see `_relative_turn_gaps`.
    """
    r = evidence.r
    drive = evidence.data.drive
    thrust_times, _ = thrust_times_and_forces(drive)
    near = ROUNDING * r.length
    expected = {"release": _is_during(r, drive.get("release", 0.0)), "thrust_end": _is_during(r, thrust_times[-1])}
    if r.drive == "free":
        expected["arrival"] = int(r.s_o[-1] >= evidence.timetable.arrival_position - near)
    expected["brake"] = 0
    for place in {brake["from"] for brake in drive.get("brake", [])}:
        beyond = r.s_o - place
        sides = np.sign(beyond[np.abs(beyond) > near])
        expected["brake"] += int(np.count_nonzero(np.diff(sides) > 0.0))
    events = [event["event"] for event in r.events]
    return [abs(events.count(kind) - count) for kind, count in expected.items()] + _relative_turn_gaps(r)


def _is_during(r: Response, t: float) -> int:
    return int(0.0 < t <= r.t[-1])


def _relative_turn_gaps(r: Response) -> list[float]:
    """Distances over the length by which a car goes back between two turns, or on after one."""
    s = r.s_o / r.length
    turns = [int(np.argmin(np.abs(r.t - event["t"]))) for event in r.events if event["event"] == "turn"]
    steps = [0, *turns, s.size - 1]
    swing = 1e-3  # shortest way back after a turn
    gaps = []
    for begin, end in pairwise(steps):
        piece = s[begin : end + 1] * np.sign(s[end] - s[begin])
        back = float((np.maximum.accumulate(piece) - piece).max())
        gaps.append(back if back > swing else 0.0)
    for before, turn, after in zip(steps, turns, steps[2:], strict=False):
        around = s[before : after + 1] * np.sign(s[turn] - s[before])
        gaps.append(float(around.max() - around[turn - before]))
    return gaps


def _car_rolls_from_off_supports(evidence: Evidence) -> bool:
    r = evidence.r
    return r.drive != "grip" and 0.0 < r.s_o[0] < r.length


@_register_law("car at rest", _car_rolls_from_off_supports, at_start=True)
def car_start_at_rest_defect(evidence: Evidence) -> Defect:
    """A car that rolls begins where the cable at rest holds it, clamped or on its rope; over the largest deflection."""
    r = evidence.r
    data = evidence.data
    friction = None if r.drive == "free" else data.drive.get("rolling_friction", 0.0)
    cable = rest.empty_cable(data, r)
    expected = rest.car_point_at_rest(cable, float(r.s_o[0]), data.weight, friction)
    off = np.array([r.x[0], r.y[0]]) - expected
    return _defect_without_position(*(off / r.max_deflection))


# --- the mass, at steps --------------------------------------------------------------------------------


@_register_law("place of the mass", exact=True)
def position_less_displacement_defect(evidence: Evidence) -> Defect:
    """p = X(s_o) + w; over the largest deflection."""
    r = evidence.r
    k = evidence.steps_in_windows_off_supports
    at_rest = np.column_stack([r.x - r.u, r.y - r.v])[k]
    off = at_rest - evidence.rest_curve(r.s_o[k])
    return _defect_without_position(float(np.abs(off).max()) / r.max_deflection)


@_register_law("strain at the mass", _has_separate_pointwise_tension, exact=True)
def pointwise_tension_at_mass_defect(evidence: Evidence) -> Defect:
    """Pointwise tension is T + EA (|r'| - 1), cut at zero without compression; over H."""
    r = evidence.r
    k = evidence.steps_in_windows_off_supports
    f = evidence.r.fields
    T = CubicSpline(f.s, f.T_static)(r.s_o[k])
    off = []
    for slope, stored in ((r.slope_behind, r.T_behind_pointwise), (r.slope_ahead, r.T_ahead_pointwise)):
        strain = np.hypot(*slope[k].T) - 1.0
        N = T + evidence.data.EA * strain
        N = np.where(_tension_only_at(r, r.t[k]), np.maximum(N, 0.0), N)
        off.append(np.abs(stored[k] - N).max())
    return _defect_without_position(*(np.array(off) / r.horizontal_tension))


@_register_law("speed of the mass")
def mass_path_from_velocity_defect(evidence: Evidence) -> Defect:
    """The mass moves by the integral of its velocity; over top speed times window."""
    r = evidence.r
    conserved = np.column_stack([r.x, r.y]) - evidence.cumulative_time_integral(r.velocity)
    distance = float(r.speed.max()) * evidence.mean_window_duration
    return _window_change_defect_of_steps(evidence, conserved, distance)


def _mass_momentum_defect(evidence: Evidence, rope_force: Array) -> Defect:
    """Change of the car's momentum by the force of the rope (n, 2) [N] and all others; over M g times window."""
    r = evidence.r
    weight = evidence.data.weight
    force = rope_force + weight * DOWN
    if r.drive != "grip":
        mean = r.slope_behind + r.slope_ahead  # (n, 2)
        drive = evidence.thrust_or_haul_force[:, None] * mean / np.hypot(*mean.T)[:, None]
        force = force + drive + evidence.air_drag_force
    conserved = evidence.data.mass * r.velocity - evidence.cumulative_time_integral(force)
    return _window_change_defect_of_steps(evidence, conserved, weight * evidence.mean_window_duration)


@_register_law("momentum of the mass")
def mass_momentum_by_contact_defect(evidence: Evidence) -> Defect:
    """M (v_2 - v_1) is the impulse of weight, contact and outer forces; over M g times window."""
    return _mass_momentum_defect(evidence, -evidence.r.contact)


def _slope_has_kink(evidence: Evidence) -> bool:
    """Whether r' differs on both sides of the mass: smooth functions show one slope there on any mesh."""
    r = evidence.r
    return not np.allclose(r.slope_behind, r.slope_ahead, rtol=0.0, atol=1e-12)


@_register_law("impulse", _slope_has_kink, quantity="impulse")
def mass_momentum_by_tensions_defect(evidence: Evidence) -> Defect:
    """M (v_2 - v_1) by the force [ N t - rho ds_o^2 r' ] of both tensions; over M g times window."""
    r = evidence.r
    inertial = evidence.data.rho * evidence.travel_speed**2  # (n,)

    def momentum_flux(T: Array, slope: Array) -> Array:
        return (T / np.hypot(*slope.T) - inertial)[:, None] * slope

    behind = momentum_flux(r.T_behind, r.slope_behind)
    ahead = momentum_flux(r.T_ahead, r.slope_ahead)
    return _mass_momentum_defect(evidence, ahead - behind)


@_register_law("tension on both sides", _car_rolls)
def rolling_car_tension_jump_defect(evidence: Evidence) -> Defect:
    """The tension jump at a rolling car is friction plus brakes; over M g times window.

    [N] (1 - rho ds_o^2/EA) = -(mu_r |contact| + brakes) sign(ds_o); at most that for a slow car.
    """
    r = evidence.r
    data = evidence.data
    ds = evidence.travel_speed
    jump = (r.T_ahead - r.T_behind) * (1.0 - data.rho * ds**2 / data.EA)
    resistance = np.sum(evidence.rolling_friction_and_brake_force, axis=0)
    slowest = 0.05  # of the top speed: below it friction's direction is not checked
    rolls = np.abs(ds) > slowest * np.abs(ds).max()
    beyond = np.maximum(np.abs(jump) - resistance, 0.0)
    defect = np.where(rolls, jump + resistance * np.sign(ds), np.sign(jump) * beyond)  # (n,)
    released = r.t >= data.drive.get("release", 0.0)
    impulse = evidence.cumulative_time_integral(np.where(released, defect, 0.0)[:, None])
    return _window_change_defect_of_steps(evidence, impulse, data.weight * evidence.mean_window_duration)


# --- the cable, at frames ------------------------------------------------------------------------------


def _ever_excludes_compression(evidence: Evidence) -> bool:
    return evidence.r.switched is not None or evidence.r.law == "tension-only"


@_register_law("compression", _ever_excludes_compression, exact=True)
def compression_defect(evidence: Evidence) -> Defect:
    """A tension-only cable has no compression; over H."""
    r = evidence.r
    T = r.fields.T_pointwise[_tension_only_at(r, r.fields.t)] / r.horizontal_tension
    return _defect_without_position(float(np.clip(T, -1.0, 0.0).min(initial=0.0)))


@_register_law("least tension", quantity="tension_min", tolerance_kind="")
def min_tension_steps_vs_frames_defect(evidence: Evidence) -> Defect:
    """The smallest tension at steps is that at frames; over H."""
    r = evidence.r
    f = r.fields
    k = evidence.window_frame_indices
    at_mass = np.minimum(f.T_behind[k], f.T_ahead[k])
    of_frames = np.minimum(f.T[k].min(axis=1), at_mass)
    of_steps = evidence.interpolate_steps(evidence.window_times, r.tension_min[:, None])[:, 0]
    return _defect_at_window_times(evidence, (of_steps - of_frames) / r.horizontal_tension)


@_register_law("slack onset")
def slack_onset_defect(evidence: Evidence) -> Defect:
    """The smallest tension falls through zero where slack begins, and in the window not before.

    By how far, in s_o/l, its smallest value so far falls through zero after the onset: see
    `scene_data.ordinate_on_unit_slope`; within two steps.
    """
    r = evidence.r
    steps = evidence.steps_in_windows_off_supports & (r.t > 0.0)
    last = int(np.flatnonzero(steps)[-1])
    end = float(r.t[last])
    steps[last : last + 3] = True
    position = np.maximum.accumulate(r.s_o) / r.length
    start = float(np.interp(min(r.slack_time_or_inf, end), r.t, position))
    # zero is the tension of a law without compression, whose rope would be deeper
    tension = np.where(r.tension_min == 0.0, -1.0, r.tension_min / r.horizontal_tension)
    late = ordinate_on_unit_slope(position[steps], np.minimum.accumulate(tension[steps]), start)
    off = abs(late) if r.slack_time_or_inf <= end else -late
    two_steps = 2.0 * float(np.abs(np.diff(r.s_o)).max()) / r.length
    return _defect_without_position(max(0.0, off - two_steps))


@_register_law("fields at the mass")
def mass_displacement_frames_vs_steps_defect(evidence: Evidence) -> Defect:
    """Displacement of the mass at frames is that at steps; over the largest deflection."""
    r = evidence.r
    f = evidence.r.fields
    at_steps = CubicSpline(r.t, np.column_stack([r.s_o, r.u, r.v]))(evidence.window_times)
    at_frames = np.column_stack([f.s_o, f.mass_u, f.mass_v])[evidence.window_frame_indices]
    off = at_frames - at_steps
    return _defect_at_window_times(evidence, off / r.max_deflection)


class _FieldAtMass(NamedTuple):
    """A field of c components at the mass at window times, of the side behind and of that ahead.

    Both are zero at times at which it cannot be extrapolated.
    """

    values: Array  # (k, 2 c)
    gaps: Array  # (k, 2 c), to the extrapolation from either side


def _field_and_gap_at_mass(evidence: Evidence, field_of_side: Callable[[Side], Array]) -> _FieldAtMass:
    """The field (m,) or (m, c) of a side at the mass, and how continuous it is there."""
    values = []
    gaps = []
    for sides in evidence.rope_sides_at_window_times:
        can_extrapolate = _can_extrapolate_to_mass(sides)
        for side, order in zip(sides, (-1, 1), strict=True):
            s = side.s[::order][:3]  # from the mass on
            y = field_of_side(side)[::order][:3]
            extrapolated = 0.0 * y[0]
            if can_extrapolate:
                step = (y[1] - y[2]) * (s[0] - s[1]) / (s[1] - s[2])
                extrapolated = y[1] + step
            values.append(can_extrapolate * y[0])
            gaps.append(can_extrapolate * y[0] - extrapolated)
    shape = len(evidence.rope_sides_at_window_times), -1
    return _FieldAtMass(np.reshape(values, shape), np.reshape(gaps, shape))


@_register_law("tension up to the mass", _can_extrapolate_at_any_frame)
def tension_continuity_at_mass_defect(evidence: Evidence) -> Defect:
    """Tension along the cable tends to that at the mass, mean over frames after the start; over H."""
    moving = evidence.window_times > 0.0
    if not moving.any():
        return NOT_OBSERVED
    off = _field_and_gap_at_mass(evidence, lambda side: side.T).gaps
    defect = _defect_at_window_times(evidence, off / evidence.r.horizontal_tension)
    return Defect(defect.s_o[moving], defect.value[moving], averaged=True)


@_register_law("up to the mass", _can_extrapolate_at_any_frame, quantity="velocity", tolerance_kind="")
def velocity_continuity_at_mass_defect(evidence: Evidence) -> Defect:
    """Velocity of the cable tends to that at the mass; over its rms."""
    if not np.any(evidence.window_times > 0.0):
        return NOT_OBSERVED
    velocity = _field_and_gap_at_mass(evidence, lambda side: side.velocity)
    size = np.sqrt(np.mean(velocity.values**2, axis=0))
    return _defect_at_window_times(evidence, velocity.gaps / size) if np.all(size > 0.0) else NOT_OBSERVED


@_register_law("displacement from velocity", _frames_resolve_waves, quantity="velocity", tolerance_kind="velocity")
def displacement_from_velocity_defect(evidence: Evidence) -> Defect:
    """Transverse displacement, weighted by half a sine, is the integral of its velocity; over its rms."""
    f = evidence.r.fields
    tangent = evidence.rest_curve(f.s, 1)  # (m, 2)
    sine = np.sin(math.pi / f.s[-1] * f.s)
    w = (tangent[:, 0] * f.v - tangent[:, 1] * f.u) @ sine  # (frames,)
    dw = (tangent[:, 0] * f.dv - tangent[:, 1] * f.du) @ sine
    # a station at the mass has the velocity behind it: the mean of both sides counts
    at = np.searchsorted(f.s, f.s_o * (1.0 - ROUNDING)).clip(max=f.s.size - 1)
    at_station = np.abs(f.s[at] - f.s_o) <= ROUNDING * f.s[-1]
    kink = evidence.r.slope_behind - evidence.r.slope_ahead
    jump = evidence.interpolate_steps(f.t, evidence.travel_speed[:, None] * kink)
    missing = 0.5 * sine[at] * cross_product(tangent[at], jump)
    dw += np.where(at_station, missing, 0.0)
    conserved = w - CubicSpline(f.t, dw).antiderivative()(f.t)
    k = evidence.window_frame_indices
    within = dw[k[0] : k[-1] + 1]
    rms = math.sqrt(float(np.mean(within**2)))
    return _window_change_defect(evidence, conserved[k, None], rms * evidence.mean_window_duration)


@_register_law("stretch")
def tension_from_stretch_defect(evidence: Evidence) -> Defect:
    """Mean tension of half a side is that at rest plus EA times the curve's strain; over H."""
    off = []
    for sides in evidence.rope_sides_at_window_times:
        longer = max(sides, key=lambda side: side.s[-1] - side.s[0])
        for side in sides:
            off += _mean_tensions_less_stretch(side, evidence.data.EA, in_halves=side is longer)
    return _defect_at_window_times(evidence, np.array(off) / evidence.r.horizontal_tension)


def _mean_tensions_less_stretch(side: Side, EA: float, in_halves: bool) -> list[float]:
    """Mean tension [N] over that at rest less EA times the mean strain of the curve, of a side or of its halves."""
    s = side.s
    steps = np.diff(s)
    N = side.T - side.T_static
    elongation = _arc_lengths(side.points) - steps
    missing = 0.5 * steps * (N[1:] + N[:-1]) - EA * elongation
    missing = np.append(0.0, np.cumsum(missing))
    cuts = [0, s.size - 1]
    if in_halves:
        cuts.insert(1, int(np.searchsorted(s, 0.5 * (s[0] + s[-1]))))
    return (np.diff(missing[cuts]) / np.diff(s[cuts])).tolist()


@_register_law("momentum of the cable")
def cable_momentum_defect(evidence: Evidence) -> Defect:
    """rho int r. ds changes by the impulse of all forces; over total weight times window."""
    r = evidence.r
    rho = evidence.data.rho
    weight = rho * evidence.data.gravity * r.fields.s[-1]
    force = r.reaction_left + r.reaction_right + r.contact + weight * DOWN
    cable = evidence.cable_integrals_at_window_times
    momentum = rho * (cable.velocity + evidence.damping_rate_with_wind * cable.points)
    conserved = momentum - evidence.integral_up_to_window_times(force)
    total_weight = weight + evidence.data.weight
    return _window_change_defect(evidence, conserved, total_weight * evidence.mean_window_duration)


@_register_law("moment of momentum")
def cable_angular_momentum_defect(evidence: Evidence) -> Defect:
    """rho int r x r. ds about the left support changes by the impulse of moments; over weight, span and window."""
    r = evidence.r
    data = evidence.data
    weight = data.rho * data.gravity
    right = np.array([data.span, data.drop])
    car = np.column_stack([r.x, r.y])
    moment = cross_product(right, r.reaction_right) + cross_product(car, r.contact)
    own = weight * evidence.lever_integral
    spin = evidence.cable_integrals_at_window_times.spin
    if evidence.damping_rate_with_wind:
        spin = spin + evidence.damping_rate_with_wind * evidence.swept_area_integral
    conserved = (data.rho * spin - own)[:, None] - evidence.integral_up_to_window_times(moment[:, None])
    total_weight = weight * r.fields.s[-1] + data.weight
    return _window_change_defect(evidence, conserved, total_weight * data.span * evidence.mean_window_duration)


# --- energy; all over weight times largest deflection ---------------------------------------------------


def _total_power(powers: dict[str, Array]) -> Array:
    return np.sum(list(powers.values()), axis=0)


@_register_law("energy", quantity="energy")
def energy_balance_defect(evidence: Evidence) -> Defect:
    """Energy of cable and mass changes by the work of the drive, until slack: a snapping cable loses some."""
    power = _total_power(evidence.powers_by_source)[:, None]
    energy = evidence.energies_at_window_times.sum(axis=1)[:, None]
    conserved = energy - evidence.integral_up_to_window_times(power)
    defect = _window_change_defect(evidence, conserved, evidence.energy_scale)
    taut = evidence.window_times[1:] <= evidence.r.slack_time_or_inf
    return Defect(defect.s_o, np.where(taut[:, None], defect.value, 0.0))


@_register_law("parts of the energy", lambda evidence: bool(np.isfinite(evidence.r.kinetic).any()))
def stored_energies_defect(evidence: Evidence) -> Defect:
    """Energies are those of the run, and sum to the total."""
    r = evidence.r
    stored = np.stack([r.kinetic, r.potential, r.strain, r.energy], axis=1)
    sums = np.sum(stored[:, :3], axis=1)[:, None]
    total = evidence.interpolate_steps(evidence.window_times, sums)
    computed = np.concatenate([evidence.energies_at_window_times, total], axis=1)  # (k, 4)
    off = evidence.interpolate_steps(evidence.window_times, stored) - computed
    return _window_change_defect(evidence, off, evidence.energy_scale)


@_register_law("power")
def stored_powers_defect(evidence: Evidence) -> Defect:
    """Work of drive and outer forces is that of the run, each and in total; of a grip by its pointwise tensions."""
    r = evidence.r
    computed = evidence.powers_by_source
    if r.drive == "grip":
        computed = computed | {"grip": evidence.grip_power(r.T_behind_pointwise, r.T_ahead_pointwise)}
    of_sources = [r.powers[name] - computed[name] for name in computed if name in r.powers]
    off = np.stack([r.power - _total_power(computed), *of_sources], axis=1)
    return _window_change_defect_of_steps(evidence, evidence.cumulative_time_integral(off), evidence.energy_scale)


def _arc_lengths(points: Array) -> Array:
    """Arc lengths between nodes (m, 2): chord times 1 + (bend of the tangent)^2/24."""
    chord = np.diff(points, axis=0)
    length = np.hypot(*chord.T)
    bend = np.zeros_like(chord)
    if len(chord) > 1:
        bend = np.gradient(chord / length[:, None], axis=0)
    return length * (1.0 + np.sum(bend**2, axis=1) / 24.0)
