"""Second computation of what a run prints: design numbers and the outcome, within bars.

It reads the TOML, the path and the stored fields, and imports nothing that writes them.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.optimize import brentq

from cablefem.response import Array, Response
from validation.core.agreement import Agreement, Bound, BoundPart, no_bound
from validation.core.evidence import Evidence, TimeWindows, cross_product, cumulative_integral
from validation.core.measures import (
    JUMP_WIDTH,
    SLACK_END,
    broke_in_compared_part,
    last_time_valid_in_all,
    relative_position_where_mass_outruns_waves,
    time_span_for_extremes,
)
from validation.core.rest import car_point_at_rest, empty_cable
from validation.core.scene_data import (
    ROUNDING,
    OneSpanData,
    height_over_at,
    is_within,
    means_around_times,
    min_height_over,
    obstacle_and_ground_profiles,
    tension_ratio_and_rope_stresses_at_wheel,
)
from validation.core.timetable import Timetable


def _recomputed_row(
    r: Response, quantity: str, law: str, gap: float, allowed: float, where: float | None = None
) -> Agreement:
    """Gap of a printed to a recomputed value, over its largest size; where : s_o/l."""
    bound = Bound("law", (BoundPart(r.method, allowed, "printed bar and sampling"),))
    return Agreement(quantity, gap, bound, where, law=law)


def recomputed_rows(
    r: Response, counterpart: Response | None = None, outcome: tuple[str, str] | None = None
) -> Iterator[Agreement]:
    """Rows of design numbers, of errors of path and tension, and of an outcome's kind and sentence."""
    yield from recomputed_design_rows(r, counterpart)
    if counterpart is not None:
        yield from recomputed_error_rows(r, counterpart)
    if outcome is not None:
        yield recomputed_outcome_row(r, counterpart, *outcome)


def recomputed_design_rows(r: Response, counterpart: Response | None = None) -> Iterator[Agreement]:
    """Rows of design numbers and peaks against a second computation, in the range of both runs."""
    numbers = RecomputedNumbers(r, counterpart)
    for row in r.design:
        quantity = row["quantity"]
        peaks = [False] if row.get("peak") is None else [False, True]
        for peak in peaks:
            if numbers.has_second_computation(quantity):
                expected = numbers.number(quantity, averaged=not peak)
                size = max(numbers.largest_size(quantity), abs(expected or 0.0)) or 1.0
                of_number = _printed_number_row(r, row, expected, size, peak)
                if peak:
                    yield of_number
                else:
                    elsewhere = numbers.gap_at_printed_place(row) / size
                    yield replace(of_number, gap=max(of_number.gap, elsewhere))
            else:
                yield Agreement("design", math.nan, no_bound("printed without a second computation"), law=quantity)


def _printed_number_row(r: Response, row: dict[str, Any], expected: float | None, size: float, peak: bool) -> Agreement:
    """The value or the peak of a printed row against the expected one;  size : of the largest such value."""
    printed = row["peak" if peak else "value"]
    bar = row["bar_peak" if peak else "bar"] or 0.0
    law = row["quantity"] + (" peak" if peak else "")
    where = None if row["s_o"] is None else row["s_o"] / r.length
    if printed is None or expected is None:
        return _recomputed_row(r, "design", law, 0.0 if printed is expected else 1.0, ROUNDING, where)
    return _recomputed_row(r, "design", law, abs(printed - expected) / size, bar / size + ROUNDING, where)


FROM_TOML = ("sag_car_rest", "acceleration_max", "deceleration_max")


class SignalOverTime(NamedTuple):
    """A signal of times (n,) at positions along the rope: values (n,) at s (n,), or (n, m) at s (m,)."""

    t: Array
    value: Array
    s: Array  # [m]


Signals = list[SignalOverTime]
# felt as means over an axial round trip
FORCES = ("tension", "reaction", "contact", "haul_force", "thrust", "angle", "stress", "car_deceleration")


class RecomputedNumbers:
    """Second computations of design numbers from stored fields, path and TOML."""

    def __init__(self, r: Response, counterpart: Response | None) -> None:
        self.r = r
        self.data = OneSpanData(r.scene_toml, r.length)
        self.timetable = Timetable(self.data.travel, self.data.drive, r.length)
        self.signals = _signals_by_kind(r, self.data)
        self.time_span = time_span_for_extremes(r, counterpart)
        self.until = last_time_valid_in_all(r, counterpart or r)
        self.profiles = obstacle_and_ground_profiles(self.data.scene)

    def _signals_of_number(self, kind: str) -> Signals | None:
        without_extreme = kind.removesuffix("_max").removesuffix("_min")
        return self.signals.get(kind) or self.signals.get(without_extreme)

    def has_second_computation(self, quantity: str) -> bool:
        """Whether a quantity has a second computation."""
        kind, _, name = quantity.partition(":")
        if name:
            return kind in ("clearance_rope_min", "clearance_car_min") and name in self.profiles
        return kind in ("safety_factor_min", "slack_onset", *FROM_TOML) or self._signals_of_number(kind) is not None

    def number(self, quantity: str, averaged: bool = True) -> float | None:
        """A number in SI, or None where there is none;  averaged : forces over an axial round trip."""
        kind, _, name = quantity.partition(":")
        if kind == "slack_onset":
            return self.r.slack_onset  # which a law holds against the tension
        if name:
            return self._min_clearance(self.profiles[name], of_car=kind == "clearance_car_min")
        if kind == "sag_car_rest":
            return _max_sag_of_car_at_rest(self.r, self.data)
        if kind in FROM_TOML:
            rates = self.timetable.accelerations_at_stretch_ends
            return max(0.0, *(rates if kind == "acceleration_max" else -rates))
        if kind == "safety_factor_min":
            tension = self._extreme_of_signals("tension_max", averaged=True)
            return None if tension is None else self.data.cable["breaking_load"] / tension
        if kind == "speed_max" and self.r.drive != "free":
            of_timetable = self.timetable.top_speed
            return max(of_timetable, self._extreme_of_signals(kind, averaged) or 0.0)
        return self._extreme_of_signals(kind, averaged)

    def largest_size(self, quantity: str) -> float:
        """Largest size of the values of which a number is an extreme; 0 where it is of none."""
        signals = self._signals_of_number(quantity) or []
        return max((float(np.nanmax(np.abs(signal.value), initial=0.0)) for signal in signals), default=0.0)

    def _extreme_of_signals(self, kind: str, averaged: bool) -> float | None:
        """Smallest or largest value of a signal over the time span; None where nothing is known."""
        values = np.concatenate([x.value.ravel() for x in self._means_of_signals(kind, averaged)])
        if not values.size:
            return None
        return float(values.min() if kind.endswith("_min") else values.max())

    def _means_of_signals(self, kind: str, averaged: bool) -> Signals:
        signals = self._signals_of_number(kind) or []
        period = self.data.round_trip if averaged and kind.startswith(FORCES) else 0.0
        return [_moving_means(signal, self.time_span, period) for signal in signals if signal.t.size]

    def gap_at_printed_place(self, row: dict[str, Any]) -> float:
        """Gap of a printed number to the value at the time and position that are printed with it; infinite: none there.

        0 of what has no signal of its own: the top speed of a timetable, the slack onset.
        """
        r = self.r
        kind, _, name = row["quantity"].partition(":")
        of_timetable = kind == "speed_max" and r.drive != "free"
        if of_timetable or row.get("t") is None:
            return 0.0
        near = ROUNDING * r.length
        if self._is_off_rope(row, near):
            return math.inf
        if name:  # no mean is taken: to rounding, not to the bar
            heights = self._heights_at_place(self.profiles[name], row, near, of_car=kind == "clearance_car_min")
            return 0.0 if any(abs(row["value"] - height) <= near for height in heights) else math.inf
        values = self._values_at_place(kind, row, near)
        return 0.0 if kind == "slack_onset" else min((abs(row["value"] - value) for value in values), default=math.inf)

    def _is_off_rope(self, row: dict[str, Any], near: float) -> bool:
        """Whether at a row's time the car is not at its s_o, or its s not at its x at rest, up to `near` [m]."""
        r = self.r
        car_s = np.interp(row["t"], r.t, r.s_o)
        if row["s"] is None:
            return bool(abs(row["s_o"] - car_s) > near)
        x_at_rest = np.interp(row["s"], r.fields.s, r.fields.x)
        return bool(max(abs(row["s_o"] - car_s), abs(row["x"] - x_at_rest)) > near)

    def _values_at_place(self, kind: str, row: dict[str, Any], near: float) -> list[float]:
        """Values of a kind of number at a row's time and position, up to `near` [m]."""
        is_safety = kind == "safety_factor_min"
        means = self._means_of_signals("tension_max" if is_safety else kind, averaged=True)
        values = [x for signal in means if signal.t.size for x in _values_at(signal, row["t"], row["s"], near)]
        return [self.data.cable["breaking_load"] / tension for tension in values] if is_safety else values

    def _heights_at_place(self, profile: Array, row: dict[str, Any], near: float, of_car: bool) -> Iterator[float]:
        """Heights [m] over a profile at a row's time and place: of the car if it is there, of the rope at a frame."""
        r = self.r
        if abs(row["s"] - row["s_o"]) <= near:
            x, y = (np.interp(row["t"], r.t, values) for values in (r.x, r.y))
            below = self.data.scene["mass"].get("below", 0.0) if of_car else 0.0
            yield height_over_at(profile, x, y, near) - below
        frame = int(np.argmin(np.abs(r.fields.t - row["t"])))
        if not of_car and is_within(r.fields.t[frame], row["t"], row["t"]):
            yield height_over_at(profile, row["x"], np.interp(row["x"], *self._rope_at_frame(frame)), near)

    def _min_clearance(self, profile: Array, of_car: bool) -> float | None:
        """Smallest height [m] of car or rope over an obstacle or the ground; None: never above it."""
        r = self.r
        steps = r.t <= self.until
        heights = [min_height_over(profile, r.x[steps], r.y[steps])]
        if not of_car:
            heights += self._min_heights_of_rope(profile)
        below = self.data.scene["mass"].get("below", 0.0) if of_car else 0.0
        return min(heights) - below if math.isfinite(min(heights)) else None

    def _min_heights_of_rope(self, profile: Array) -> list[float]:
        """Smallest height [m] of the rope over a profile at each frame; inf where it is never above it."""
        frames = np.flatnonzero(self.r.fields.t <= self.until).tolist()
        return [min_height_over(profile, *self._rope_at_frame(k)) for k in frames]

    @cached_property
    def _car_at_frames(self) -> Array:
        """Points (k, 2) of the car."""
        f = self.r.fields
        rest_curve = CubicSpline(f.s, np.column_stack([f.x, f.y]))
        return np.asarray(rest_curve(f.s_o) + np.column_stack([f.mass_u, f.mass_v]))

    def _rope_at_frame(self, k: int) -> tuple[Array, Array]:
        """x and y (m,) of the rope with the car at a frame by its index, in order of x; it reaches both supports."""
        f = self.r.fields
        car = self._car_at_frames[k]
        x = np.append(f.x + f.u[k], car[0])
        y = np.append(f.y + f.v[k], car[1])
        x[0] = min(x[0], 0.0)  # an obstacle may stand right at a support
        x[-2] = max(x[-2], self.data.span)
        order = np.argsort(x)
        return x[order], y[order]


def _max_sag_of_car_at_rest(r: Response, data: OneSpanData) -> float:
    """Largest depth below the chord of a car at rest: a parabola through the largest of some places."""
    friction = data.drive.get("rolling_friction", 0.0) if r.drive == "haul" else None
    s_o = r.length * np.linspace(0.02, 0.98, 49)
    cable = empty_cable(data, r)
    points = [car_point_at_rest(cable, float(s), data.weight, friction) for s in s_o]
    x, y = np.array(points).T
    sag = y - x * data.drop / data.span
    k = int(np.clip(np.nanargmax(sag), 1, s_o.size - 2))
    around = slice(k - 1, k + 2)
    a, b, c = np.polyfit(x[around], sag[around], 2)
    return float(c - b * b / (4.0 * a))


def _signals_by_kind(r: Response, data: OneSpanData) -> dict[str, Signals]:
    """Signals of each kind of design number."""
    f = r.fields
    at_steps = _signals_at_car(r, data)
    signals: dict[str, Signals] = {}
    for name, values in at_steps.items():
        signals[name] = [SignalOverTime(r.t, values, r.s_o)]
    tensions = [SignalOverTime(r.t, T, r.s_o) for T in (r.T_behind, r.T_ahead)]
    tensions.append(SignalOverTime(f.t, f.T, f.s))
    for side, force, s in (("left", r.reaction_left, 0.0), ("right", r.reaction_right, r.length)):
        horizontal, vertical = np.abs(force.T)
        size = np.hypot(horizontal, vertical)
        s_support = np.full(r.t.shape, s)
        tensions.append(SignalOverTime(r.t, size, s_support))
        components = {"": size, "_horizontal": horizontal, "_vertical": vertical}
        for name, values in components.items():
            signals[f"reaction_{side}{name}"] = [SignalOverTime(r.t, values, s_support)]
        angle = np.degrees(np.arcsin(vertical / size))
        signals[f"angle_{side}"] = [SignalOverTime(r.t, angle, s_support)]
    wheels = data.scene["mass"].get("wheels", {})
    for N in (r.T_behind, r.T_ahead) if wheels else ():
        load = at_steps["contact"] / wheels.get("count", 2)
        for kind, values in tension_ratio_and_rope_stresses_at_wheel(data.cable, wheels, N, load).items():
            signals.setdefault(kind, []).append(SignalOverTime(r.t, values, r.s_o))
    signals["tension"] = tensions
    signals["deepest_point"] = [SignalOverTime(r.t, r.y, r.s_o), SignalOverTime(f.t, f.y + f.v, f.s)]
    return signals


def _signals_at_car(r: Response, data: OneSpanData) -> dict[str, Array]:
    """Signals (n,) of the car at steps, and the tilt of the wind."""
    tilt = math.degrees(math.atan(data.crosswind_force_per_length() / (data.rho * data.gravity)))
    driving = "thrust" if r.drive == "free" else "haul_force"
    speed = _speed(r)
    signals = {"wind_tilt": np.full(r.t.shape, tilt), "contact": _contact_force(r), "speed": speed}
    signals[driving] = np.abs(r.F_haul)
    signals[f"{driving}_min"] = r.F_haul
    signals["mass_deflection"] = r.v
    signals["mass_deepest"] = r.y
    signals["sag_car"] = r.y - r.x * data.drop / data.span
    if r.drive == "free":
        along = r.velocity / np.where(speed > 0.0, speed, math.inf)[:, None]
        signals["car_deceleration"] = -np.sum(along * r.acceleration, axis=1)
    return signals


def _speed(r: Response) -> Array:
    return np.asarray(np.sqrt(np.sum(r.velocity**2, axis=1)))


def _contact_force(r: Response) -> Array:
    """Force of the mass on the cable across the mean tangent (n,), positive down."""
    tangent = r.slope_behind + r.slope_ahead
    return cross_product(tangent, r.contact) / np.sqrt(np.sum(tangent**2, axis=1))


def _moving_means(signal: SignalOverTime, time_span: tuple[float, float], period: float) -> SignalOverTime:
    """Means of a signal over a period around all times in a time span; of fields over frames."""
    known = np.isfinite(signal.value.reshape(signal.t.size, -1)).all(axis=1)
    t = signal.t[known]
    values = signal.value[known]
    inside = is_within(t, *time_span)
    if values.ndim == 2:
        return SignalOverTime(t[inside], _means_of_frames(t[inside], values[inside], period), signal.s)
    s = signal.s[known]
    if inside.any():  # up to the ends of the range
        begin, end = np.clip(time_span, t[0], t[-1])
        between = t[inside & (t > begin) & (t < end)]
        times = np.unique(np.concatenate([[begin], between, [end]]))
        values = np.interp(times, t, values)
        s = np.interp(times, t, s)
        t = times
    if period and t.size >= 3:
        values = means_around_times(t, values, t, period)
    return SignalOverTime(t, values, s)


def _values_at(signal: SignalOverTime, t: float, s: float, near: float) -> list[float]:
    """Values of a signal at a time and position, up to `near` [m]; of a field at one of its frames and stations."""
    if signal.value.ndim == 2:
        frame = int(np.argmin(np.abs(signal.t - t)))
        station = int(np.argmin(np.abs(signal.s - s)))
        is_there = is_within(signal.t[frame], t, t) and abs(signal.s[station] - s) <= near
        return [float(signal.value[frame, station])] if is_there else []
    is_there = abs(np.interp(t, signal.t, signal.s) - s) <= near
    return [float(np.interp(t, signal.t, signal.value))] if is_there else []


def _means_of_frames(t: Array, values: Array, period: float) -> Array:
    """Means (n, m) over frames within a period, at least one on either side."""
    if not period or t.size < 3:
        return values
    k = np.arange(t.size)
    close = np.abs(t[:, None] - t) <= 0.5 * period  # (n, n)
    near = close | (np.abs(k[:, None] - k) <= 1)
    return np.asarray(near @ values / near.sum(axis=1)[:, None])


# --- errors of path and tension -----------------------------------------------------------------------------------


def recomputed_error_rows(r: Response, counterpart: Response) -> Iterator[Agreement]:
    """Rows of what path_error and tension_error lack to the distance from the other solver."""
    if r.error_window is None or counterpart.error_window is None or r.path_error is None:
        return
    lows, highs = zip(r.error_window, counterpart.error_window, strict=True)
    window = max(lows), min(highs)
    distance = _relative_path_distance(r, counterpart, window, degree=3)
    by_other_spline = _relative_path_distance(r, counterpart, window, degree=5)
    allowed = abs(by_other_spline - distance) + ROUNDING
    yield _recomputed_row(r, "design", "path_error", max(0.0, distance - r.path_error), allowed)
    if r.tension_error is not None:
        missing = max(0.0, _rms_tension_distance_over_H(r, counterpart, window) - r.tension_error)
        yield _recomputed_row(r, "design", "tension_error", missing, ROUNDING)


def _relative_path_distance(r: Response, counterpart: Response, window: tuple[float, float], degree: int) -> float:
    """Largest distance of the car in two runs, at the steps of the coarser one, over the scale of the path.

    degree : of the spline through the finer run.
    """
    coarse, fine = sorted((r, counterpart), key=lambda x: x.t.size)
    low, high = window
    position = coarse.s_o / coarse.length
    in_window = (position >= low) & (position <= high * (1.0 + ROUNDING))
    rows = in_window & (coarse.t <= fine.t[-1])
    names = ("x", "y") if r.drive == "free" else ("u", "v")
    squares = np.zeros(np.count_nonzero(rows))
    for name in names:
        spline = make_interp_spline(fine.t, getattr(fine, name), k=degree)
        offset = getattr(coarse, name)[rows] - spline(coarse.t[rows])
        squares += offset**2
    scale = max(0.1 * x.length if x.drive == "free" else x.max_deflection for x in (r, counterpart))
    largest = np.sqrt(squares).max(initial=0.0)
    return float(largest) / scale


def _rms_tension_distance_over_H(r: Response, counterpart: Response, window: tuple[float, float]) -> float:
    """Rms distance of the tensions at common frames, off the car, over H; 0 without common frames."""
    a = r.fields
    b = counterpart.fields
    stands = bool(np.any(np.diff(a.s_o) <= ROUNDING * r.length))
    axis = "t" if r.drive == "free" or stands else "s_o"
    marks = getattr(b, axis)
    squares = [np.empty(0)]
    for k, mark in enumerate(getattr(a, axis)):
        j = int(np.argmin(np.abs(marks - mark)))
        at = a.s_o[k] / r.length
        in_window = window[0] - ROUNDING <= at <= window[1] + ROUNDING
        if in_window and abs(marks[j] - mark) <= ROUNDING * marks[-1]:
            off_car = np.abs(a.s / r.length - at) >= JUMP_WIDTH
            squares.append((a.T[k] - b.T[j])[off_car] ** 2)
    of_all_frames = np.concatenate(squares)
    return math.sqrt(of_all_frames.mean()) / r.horizontal_tension if of_all_frames.size else 0.0


# --- the outcome --------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class ExpectedOutcome:
    """What an outcome must say: its kind, its numbers in order, and its parts without numbers."""

    kind: str
    numbers: list[float]  # nan: unknown
    parts: list[str] = field(default_factory=list)

    def matches(self, kind: str, sentence: str) -> bool:
        """Whether a printed outcome has this kind, these numbers to the last digit, and these parts."""
        text = sentence.split(": ", 2)[-1] if kind == "breaks" else sentence
        parts = [part for part in text.split("; ") if part.startswith(("would hit", "too close"))]
        printed = [float(x) for x in re.findall(r"-?\d+\.\d+", sentence)]
        if kind == "incomplete":  # the reason may hold numbers
            printed = printed[: len(self.numbers)]
        if (kind, parts, len(printed)) != (self.kind, self.parts, len(self.numbers)):
            return False
        digit = 0.06  # half of the last printed digit, and what a search for a time leaves
        return not np.any(np.abs(np.subtract(printed, self.numbers)) > digit)


def recomputed_outcome_row(r: Response, counterpart: Response | None, kind: str, sentence: str) -> Agreement:
    """An outcome against the last event, the TOML's brakes and travel, breaking load and clearances."""
    numbers = RecomputedNumbers(r, counterpart)
    expected = _expected_outcome_of_motion(r, numbers.timetable)
    bars = {row["quantity"]: row["bar"] or 0.0 for row in r.design}
    expected.parts = _obstacle_hit_sentences(numbers, bars)
    if expected.kind != "incomplete" and _lifts_off_unnoticed(numbers, bars):
        expected.numbers = [math.nan, math.nan, *expected.numbers]
    if "safety_factor_min" in bars:
        _add_broken_rope_to(expected, numbers, bars["safety_factor_min"])
    return _recomputed_row(r, "outcome", "", 0.0 if expected.matches(kind, sentence) else 1.0, ROUNDING)


def _expected_outcome_of_motion(r: Response, table: Timetable) -> ExpectedOutcome:
    """How the car's motion ends, after where it first lifts off."""
    if broke_in_compared_part(r):
        return ExpectedOutcome("incomplete", [float(r.s_o[-1]), float(r.t[-1])])
    free = r.drive == "free"
    end = _expected_outcome_of_free_ride(r, table.drive) if free else _expected_outcome_of_travel(r, table)
    first = next((event for event in r.events if event["event"] == "lift_off"), None)
    if first is not None:
        end.numbers = [first["s_o"], first["t"], *end.numbers]
    return end


def _expected_outcome_of_free_ride(r: Response, drive: dict[str, Any]) -> ExpectedOutcome:
    """The end of a free ride, by its last event."""
    speed = 3.6 * _speed(r)  # [km/h]
    ends = [event for event in r.events if event["event"] in ("arrival", "back", "stop")]
    if not ends:
        last_time = float(r.t[-1])
        if r.status == "complete":
            last_time = drive.get("end", {}).get("time", last_time)
        return ExpectedOutcome("rolling", [last_time, float(r.s_o[-1]), float(speed[-1])])
    last = ends[-1]
    t = last["t"]
    s_o = last["s_o"]
    if last["event"] == "arrival":
        return ExpectedOutcome("arrives", [s_o, t, float(np.interp(t, r.t, speed))])
    farthest = float(np.max(r.s_o))
    if last["event"] == "back":
        return ExpectedOutcome("rolls_back", [t, farthest])
    first = min((brake["from"] for brake in drive.get("brake", [])), default=math.inf)
    if s_o >= first:
        return ExpectedOutcome("stopped_by_brake", [s_o, s_o - first, t])
    braked = any(x["event"] == "brake" for x in r.events)
    before = [] if braked or math.isinf(first) else [first - s_o]
    return ExpectedOutcome("stuck", [*before, s_o, t, farthest])


def _expected_outcome_of_travel(r: Response, table: Timetable) -> ExpectedOutcome:
    """The end of a prescribed travel, by the TOML."""
    last, duration = _travel_end_and_duration(table)
    # a law and a design number judge the onset itself; here its text is compared
    onset = r.slack_onset_position_or_inf  # s_o/l
    if onset > SLACK_END:
        onset = math.inf
    ended_past_comparison = r.status != "complete" and math.isinf(onset)
    onset = min(onset, relative_position_where_mass_outruns_waves(r))
    slack = [onset * r.length] if math.isfinite(onset) else []
    if ended_past_comparison:
        slack.insert(0, float(r.s_o[-1]))
    if last < 0.999 * table.farthest_position:
        return ExpectedOutcome("stopped", [last, duration, *slack])
    ends = [table.start_position, last] if r.drive == "haul" else []
    return ExpectedOutcome("crossed", [*ends, duration, *slack])


def _travel_end_and_duration(table: Timetable) -> tuple[float, float]:
    """Where [m] a travel ends, and its duration [s]; nan where a table has none."""
    law = table.travel
    end = table.farthest_position
    start = table.start_position
    if law["kind"] == "table":
        last = min(end, law["positions"][-1] + start)
        known = last < end and "stop" not in law
        return last, law["times"][law["positions"].index(law["positions"][-1])] if known else math.nan

    def position_at(t: float) -> float:
        return float(table.positions_at(np.array([t]))[0])

    late = 1.0
    while position_at(late) < end and position_at(2.0 * late) > position_at(late):
        late *= 2.0
    last = min(end, position_at(late))
    near = start + (1.0 - ROUNDING) * (last - start)  # a car comes to rest slowly
    duration = float(brentq(lambda t: position_at(t) - near, 0.0, late))
    limit = table.drive.get("end", {}).get("time", math.inf)
    return (last, duration) if duration <= limit else (position_at(limit), limit)


def _obstacle_hit_sentences(numbers: RecomputedNumbers, bars: dict[str, float]) -> list[str]:
    """What is hit, and what is closer than its printed bar."""
    hit = []
    near = []
    for name in numbers.profiles:
        low = high = math.inf
        for quantity in (f"clearance_rope_min:{name}", f"clearance_car_min:{name}"):
            value = numbers.number(quantity)
            if value is not None:
                bar = bars.get(quantity, 0.0)
                low = min(low, value - bar)
                high = min(high, value + bar)
        if high < 0.0:
            hit.append(name)
        elif low < 0.0:
            near.append(name)
    parts = {"would hit ": hit, "too close to tell whether it clears ": near}
    return [words + " and ".join(names) for words, names in parts.items() if names]


def _lifts_off_unnoticed(numbers: RecomputedNumbers, bars: dict[str, float]) -> bool:
    """Whether a car that rolls has no event of lifting off where its mean contact force is negative beyond its bar."""
    r = numbers.r
    may_lift_off = r.drive != "grip" and r.model != "quasi-static" and "contact_min" in bars
    if not may_lift_off or any(event["event"] == "lift_off" for event in r.events):
        return False
    contact = numbers.number("contact_min")
    return contact is not None and contact + bars["contact_min"] < 0.0


def _add_broken_rope_to(expected: ExpectedOutcome, numbers: RecomputedNumbers, bar: float) -> None:
    """Put a breaking rope into what an outcome must say;  bar : of the safety factor."""
    factor = numbers.number("safety_factor_min")
    assert factor is not None
    if factor + bar < 1.0:
        load = numbers.data.cable["breaking_load"] / 1e3
        expected.kind = "breaks"
        expected.numbers = [load / factor, load, *expected.numbers]
    elif factor - bar < 1.0:
        expected.parts.insert(0, "too close to tell whether the rope breaks")


# --- the quasi-static ride ----------------------------------------------------------------------------------------


STATICS = 1e-5  # of the energy: interpolation of the cable at rest


def quasi_static_energy_row(r: Response) -> Agreement:
    """The energy along a quasi-static ride against the work of the forces of the TOML.

    The car has kinetic energy, the rope has none. The gap is over the car's weight times the range of its depth, or
    times its deflection where it hardly moves.
    """
    evidence = Evidence(r, TimeWindows(r.fields.t[::2], r.t))
    gap = _relative_unexplained_energy(evidence)
    thin = evidence.without_every_second_step().with_halved_fields()
    sampling = float(np.abs(gap - _relative_unexplained_energy(thin)).max())
    allowed = 3.0 * sampling + STATICS
    k = int(np.abs(gap).argmax())
    where = float(r.fields.s_o[evidence.window_frame_indices][k] / r.length)
    return _recomputed_row(r, "energy", "quasi-static", float(np.abs(gap[k])), allowed, where)


def _relative_unexplained_energy(evidence: Evidence) -> Array:
    """Energy at frames (k,) beyond that at the start and the work since, over the scale."""
    r = evidence.r
    data = evidence.data
    speed = _speed(r)
    of_car = 0.5 * data.mass * speed**2 - data.weight * r.y
    of_rope = evidence.cable_integrals_at_window_times.energies[:, 1:].sum(axis=1)  # without its motion (k,)
    energy = np.interp(evidence.window_times, r.t, of_car) + of_rope
    powers = dict(evidence.powers_by_source)
    powers["friction"] = _quasi_static_friction_power(evidence)
    if r.drive == "free":  # thrust acts along the path
        powers["thrust"] = evidence.thrust_or_haul_force * speed * np.sign(evidence.travel_speed)
    power = np.sum([*powers.values()], axis=0)
    work_at_steps = cumulative_integral(r.t, power[:, None], r.force_jump_times)[:, 0]
    work = np.interp(evidence.window_times, r.t, work_at_steps)
    unexplained = energy - work
    scale = data.weight * max(np.ptp(r.y), r.max_deflection)
    return np.asarray((unexplained - unexplained[0]) / scale)


def _quasi_static_friction_power(evidence: Evidence) -> Array:
    """Power (n,) [W] of rolling friction, by the force of the rope across the path."""
    r = evidence.r
    data = evidence.data
    speed = _speed(r)[:, None]
    along = np.divide(r.velocity, speed, out=np.zeros_like(r.velocity), where=speed > 0.0)  # the path (n, 2)
    free_of_weight = r.acceleration - [0.0, data.gravity]
    rope_force = data.mass * free_of_weight - evidence.air_drag_force  # (n, 2)
    normal = np.abs(cross_product(along, rope_force))
    coefficient = data.drive.get("rolling_friction", 0.0)
    return -coefficient * normal * evidence.mean_stretch * np.abs(evidence.travel_speed)
