"""Design numbers of a ropeway in SI with bars: extremes over a run.

Forces and decelerations are means over an axial round trip, which ropes and load cells feel; `peak` is the raw extreme.
The steepest angle at a support is the largest one to the horizontal, up or down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from cablefem.newmark import scheme
from cablefem.response import Array, Response
from cablefem.scene import Scene
from cablefem.scene.bodies import Wheels
from cablefem.scene.cable import Rope
from validation.core.agreement import Agreement, Bound, BoundPart
from validation.core.clearances import Clearances, Track, clearance_tracks, obstacle_and_ground_profiles
from validation.core.ladder import Ladder, error_bars_of_at_least_gap, max_distance
from validation.core.measures import (
    last_time_valid_in_all,
    relative_position_where_mass_outruns_waves,
    relative_slack_onset_before_far_support,
    time_means_between,
    time_span_for_extremes,
)
from validation.core.order import FIRST
from validation.core.quantities import unit_of
from validation.core.scene_data import ROUNDING, OneSpanData, is_within
from validation.core.store import nulls_for_nonfinite
from validation.core.wheels import rope_stresses_under_wheel

Number = dict[str, Any]
Tracks = Callable[[Response], list[Track]]
DEPTHS = ("deepest_point", "mass_deepest")  # meaningless at the ends of range and cable


def _tracks_at_mass(*signals: Callable[[Response], Array]) -> Tracks:
    return lambda r: [Track(r.t, signal(r), r.s_o) for signal in signals]


def _driving_force_tracks(drive_mode: str, change: Callable[[Array], Array] = np.positive) -> Tracks:
    """The force along the rope that drives a car: of a haul rope, or a free car's thrust; none in another mode."""

    def tracks(r: Response) -> list[Track]:
        if r.drive != drive_mode:
            return []
        return [Track(r.t, change(r.F_haul), r.s_o)]

    return tracks


def _free_car_deceleration_tracks(r: Response) -> list[Track]:
    """The rate -v.a/|v| [m/s2] at which a free car loses speed, 0 at rest; none of other cars."""
    if r.drive != "free":
        return []
    speed = r.speed
    lost = -np.sum(r.velocity * r.acceleration, axis=1)
    rate = np.divide(lost, speed, out=np.zeros_like(speed), where=speed > 0.0)
    return [Track(r.t, rate, r.s_o)]


def _degrees_to_horizontal(reaction: Array) -> Array:
    """Angle [deg] of a reaction (n, 2) to the horizontal."""
    horizontal, vertical = np.abs(reaction.T)
    return np.degrees(np.arctan2(vertical, horizontal))


def _tracks_at_support(
    side: str, component: Callable[[Array], Array] = lambda reaction: np.hypot(*reaction.T)
) -> Tracks:
    """A component of the reaction at a support."""

    def tracks(r: Response) -> list[Track]:
        s = np.full(r.t.size, r.length if side == "right" else 0.0)
        return [Track(r.t, component(getattr(r, f"reaction_{side}")), s)]

    return tracks


def _tension_tracks(r: Response) -> list[Track]:
    tracks = _tracks_at_mass(lambda r: r.T_behind, lambda r: r.T_ahead)(r)
    tracks.append(Track(r.fields.t, r.fields.T, r.fields.s))
    for side in ("left", "right"):
        tracks += _tracks_at_support(side)(r)
    return tracks


def _depth_tracks(r: Response) -> list[Track]:
    f = r.fields
    return [Track(r.t, r.y, r.s_o), Track(f.t, f.y + f.v, f.s)]


def _reaction_tracks(side: str) -> dict[str, Tracks]:
    return {
        f"reaction_{side}_max": _tracks_at_support(side),
        f"reaction_{side}_horizontal_max": _tracks_at_support(side, lambda reaction: np.abs(reaction[:, 0])),
        f"reaction_{side}_vertical_max": _tracks_at_support(side, lambda reaction: np.abs(reaction[:, 1])),
    }


TRACKS: dict[str, Tracks] = {
    "tension_max": _tension_tracks,
    "tension_min": _tension_tracks,
    **_reaction_tracks("left"),
    **_reaction_tracks("right"),
    "contact_max": _tracks_at_mass(lambda r: r.F_contact),
    "contact_min": _tracks_at_mass(lambda r: r.F_contact),
    "haul_force_max": _driving_force_tracks("haul", np.abs),
    "haul_force_min": _driving_force_tracks("haul"),
    "thrust_max": _driving_force_tracks("free", np.abs),
    "thrust_min": _driving_force_tracks("free"),
    "deepest_point": _depth_tracks,
    "mass_deepest": _tracks_at_mass(lambda r: r.y),
    "mass_deflection_max": _tracks_at_mass(lambda r: r.v),
    "speed_max": _tracks_at_mass(lambda r: r.speed),
    "car_deceleration_max": _free_car_deceleration_tracks,
    "angle_left": _tracks_at_support("left", _degrees_to_horizontal),
    "angle_right": _tracks_at_support("right", _degrees_to_horizontal),
}


_scene_of_toml = lru_cache(maxsize=4)(Scene.from_toml)


@lru_cache(maxsize=4)
def axial_round_trip_time(toml: str, length: float) -> float:
    """Time [s] of an axial wave to the other support and back."""
    return OneSpanData(toml, length).round_trip


def design_tracks(scene: Scene) -> dict[str, Tracks]:
    """Signals of each design quantity of a scene, with clearances, which are computed once for each run of a ladder."""
    computed: dict[int, Clearances] = {}

    def clearances(key: tuple[str, str], r: Response) -> list[Track]:
        if id(r) not in computed:
            computed[id(r)] = clearance_tracks(scene, r)
        return computed[id(r)][key]

    tracks = dict(TRACKS)
    for name in obstacle_and_ground_profiles(scene):
        for body in ("rope", "car"):
            tracks[f"clearance_{body}_min:{name}"] = partial(clearances, (body, name))
    if "sag_growth" in demands_of_limits(scene):
        tracks["sag_car_max"] = _car_sag_tracks
    if scene.mass is not None and scene.mass.wheels is not None:
        one = np.ones(1)
        for name in rope_stresses_under_wheel(scene.cable, scene.mass.wheels, one, one):
            tracks[name] = partial(_stress_tracks_behind_and_ahead, scene.cable, scene.mass.wheels, name)
    return tracks


def _stress_tracks_behind_and_ahead(rope: Rope, wheels: Wheels, stress_name: str, r: Response) -> list[Track]:
    """A stress of the rope under a wheel, by the tension behind the car and by that ahead."""
    Q = r.F_contact / wheels.count  # [N] of one wheel
    stresses = [rope_stresses_under_wheel(rope, wheels, N, Q)[stress_name] for N in (r.T_behind, r.T_ahead)]
    return [Track(r.t, stress, r.s_o) for stress in stresses]


def demands_of_limits(scene: Scene) -> set[str]:
    """Names of the numbers that the limits of a scene ask for."""
    if scene.limits is None:
        return set()
    return {rule["demand"] for rule in scene.limits.applicable_rules(scene.supports.span)}


def _car_sag_tracks(r: Response) -> list[Track]:
    """Depth of the car below the chord."""
    f = r.fields
    chord = r.x * f.y[-1] / f.x[-1]
    return [Track(r.t, r.y - chord, r.s_o)]


def _design_numbers_for_limits(scene: Scene) -> Iterator[Number]:
    """Numbers that only limits need: largest sag at the car at rest, extremes of the timetable."""
    asked = demands_of_limits(scene)
    if "sag_growth" in asked:
        yield _design_number_of_sag_at_rest(scene)
    if scene.travel is None or scene.travel.kind == "table":
        return
    rates = _accelerations_of_timetable(scene)
    for demand, sign in (("acceleration", 1.0), ("deceleration", -1.0)):
        if demand in asked and rates:
            yield _design_row(f"{demand}_max", max(0.0, *(sign * rate for rate in rates)), 0.0, "m/s2")


def _design_number_of_sag_at_rest(scene: Scene) -> Number:
    """The largest depth below the chord of a car that hangs at rest, over all its positions."""
    from validation.core.quasi_static import Statics  # splines are slow to load

    count = 2001  # positions of the car
    at_rest = Statics(scene.groups)(np.linspace(0.0, 1.0, count))
    x, y = scene.length * at_rest.car_point.T
    sag = float((y - x * scene.supports.drop / scene.supports.span).max())
    interpolation = 1e-5  # of the sag, of `Statics` and between these positions
    return _design_row("sag_car_rest", sag, interpolation * sag, "m")


def _accelerations_of_timetable(scene: Scene) -> list[float]:
    """Accelerations [m/s2] of the travel at both ends of its phases, between which they are linear."""
    motion = scene.groups.motion
    if motion is None:
        return []
    ends = np.array(motion.phases)  # (n, 2)
    phase = np.repeat(np.arange(len(ends)), 2)
    _, _, accelerations = motion.positions_with_rates(ends.ravel(), phase)
    return (accelerations * scene.length / scene.time_scale**2).tolist()


def _design_row(quantity: str, value: float | None, bar: float, unit: str, **where: float | None) -> Number:
    """A design number; None: unknown, not applicable, or a clearance of what the car never passes.

    where : t [s]; s_o of the mass, static x, and s on the cable [m]; `peak`, the raw extreme of a force.
    """
    empty = dict.fromkeys(("t", "s_o", "x", "s", "peak", "bar_peak"))
    return {"quantity": quantity, "value": value, "bar": nulls_for_nonfinite(bar), "unit": unit, **empty, **where}


def _safety_factor_numbers(scene: Scene, numbers: list[Number]) -> Iterator[Number]:
    """Breaking load over largest tension; none if one of them is unknown."""
    load = scene.cable.breaking_load
    for tension in numbers:
        if load is not None and tension["quantity"] == "tension_max":
            bar = math.inf if tension["bar"] is None else load * tension["bar"] / tension["value"] ** 2
            where = {name: tension[name] for name in ("t", "s_o", "x", "s")}
            yield _design_row("safety_factor_min", load / tension["value"], bar, "", **where)


def design_numbers(ladder_or_run: Ladder | Response, counterpart: Ladder | None = None) -> list[Number]:
    """The `design` rows: known design numbers, of a ladder with its own bars.

    counterpart : the other solver's; extremes are then taken as far as both go.
    """
    ladder = ladder_or_run if isinstance(ladder_or_run, Ladder) else Ladder.of_one_run(ladder_or_run)
    r = ladder.finest
    other = None if counterpart is None else counterpart.finest
    scene = _scene_of_toml(r.scene_toml)
    signals = signals_over_common_time(r, other).values()
    extremes = [_design_number_of_extreme(signal, ladder) for signal in signals]
    numbers = [number for number in extremes if number is not None]
    numbers = _with_top_speed_of_timetable(scene, numbers)
    numbers += _safety_factor_numbers(scene, numbers)
    if scene.wind_tilt is not None:
        numbers.append(_design_row("wind_tilt", scene.wind_tilt, 0.0, "deg"))
    numbers += _design_numbers_for_limits(scene)
    slack_onset = _slack_onset_design_number(ladder, other)
    return numbers if slack_onset is None else [*numbers, slack_onset]


def _with_top_speed_of_timetable(scene: Scene, numbers: list[Number]) -> list[Number]:
    """The numbers, with the timetable's top speed where that of the path, which is taken off the supports, is less."""
    motion = scene.groups.motion
    if motion is None:
        return numbers
    known = {number["quantity"]: number for number in numbers}
    assert scene.top_speed is not None
    if "speed_max" not in known or known["speed_max"]["value"] < scene.top_speed:
        t, _ = max(motion.speeds_where_extreme, key=lambda sample: sample[1])
        s_o = float(motion.position(t)) * scene.length
        where = {"t": t * scene.time_scale, "s_o": s_o, "s": s_o, "x": float(scene.catenary.x(s_o))}
        known["speed_max"] = _design_row("speed_max", scene.top_speed, 0.0, unit_of("speed_max"), **where)
    return list(known.values())


def signals_over_common_time(r: Response, other: Response | None = None) -> dict[str, Signal]:
    """Signals of a run by design quantity, over the times that both runs cover; forces as means over a round trip."""
    time_span = time_span_for_extremes(r, other)
    until_valid = (float(r.t[0]), last_time_valid_in_all(r, other or r))
    round_trip = axial_round_trip_time(r.scene_toml, r.length)
    signals = {}
    for name, tracks in design_tracks(_scene_of_toml(r.scene_toml)).items():
        follows_force = unit_of(name) in ("N", "deg", "Pa", "m/s2") or name == "tension_over_wheel_min"
        times = until_valid if name.startswith("clearance_") else time_span
        signals[name] = Signal(name, tracks, times, round_trip if follows_force else 0.0)
    return signals


def widen_error_bars_to_gaps(numbers: Sequence[Number], others: Sequence[Number]) -> list[Number]:
    """Design numbers with bars of at least the gap to the other solver's."""
    other = {row["quantity"]: row for row in others}
    bars = {"value": "bar", "peak": "bar_peak"}
    return [number | error_bars_of_at_least_gap(number, other.get(number["quantity"]), bars) for number in numbers]


def design_gap_rows(a: Ladder, b: Ladder, tolerance: float) -> Iterator[Agreement]:
    """Shown rows of two solvers' design numbers with their own bars, over the larger value."""
    other = {row["quantity"]: row for row in b.finest.design}
    for number in a.finest.design:
        counterpart = other.get(number["quantity"])
        if counterpart is None or None in (number["value"], counterpart["value"]):
            continue
        gap = abs(number["value"] - counterpart["value"])
        size = max(abs(number["value"]), abs(counterpart["value"])) or 1.0
        bars = []
        for ladder, row in ((a, number), (b, counterpart)):
            bar = math.inf if row["bar"] is None else row["bar"] / size
            bars.append(BoundPart(ladder.finest.method, bar, "coarser runs"))
        bound = Bound("error bars", tuple(bars))
        yield Agreement("design gap", gap / size, bound, law=number["quantity"], required=tolerance, decides=False)


def _design_number_of_extreme(signal: Signal, ladder: Ladder) -> Number | None:
    """The extreme of a signal, a force with its peak; None: there is none inside the range.

    Of a clearance without samples the row of an unknown value.
    """
    r = ladder.finest
    quantity = signal.name
    unit = unit_of(quantity)
    extreme = signal.extreme(r)
    if extreme is None:
        return _design_row(quantity, None, math.inf, unit) if signal.is_clearance else None
    if quantity in DEPTHS and _is_at_boundary(extreme, r, signal.time_span):
        return None
    bar = _error_bar_of_extreme(signal, extreme, signal.period, ladder, FIRST if signal.period else math.inf)
    s_o = float(np.interp(extreme.t, r.t, r.s_o))
    x = float(np.interp(extreme.s, r.fields.s, r.fields.x))
    peak: dict[str, float | None] = {}
    if unit == "N":
        raw = signal._replace(period=0.0)
        bar_peak = math.inf
        # coarser runs of a rule that damps axial waves do not show their error
        if ladder.runs[1:] and not scheme(r.settings["scheme"], rho_inf=r.settings.get("rho_inf", 1.0)).damps:
            bar_peak = _error_bar_of_extreme(raw, extreme, signal.period, ladder, FIRST)
        peak = {"peak": raw.extreme_value_or_nan(r), "bar_peak": nulls_for_nonfinite(bar_peak)}
    return _design_row(quantity, extreme.value, bar, unit, t=extreme.t, s=extreme.s, s_o=s_o, x=x, **peak)


def _error_bar_of_extreme(signal: Signal, extreme: _Extreme, period: float, ladder: Ladder, order: float) -> float:
    """Bar of an extreme, and of the signal at times near it, up to a period or a step apart."""
    bar = ladder.error_bar(signal.extreme_value_or_nan, max_distance, order)
    if extreme.step > 0.0:
        count = 9  # times at which two runs are compared
        times = extreme.t + np.linspace(-1.0, 1.0, count) * max(period, extreme.step)
        values = partial(signal.averaged_values_at, extreme.track, np.clip(times, *signal.time_span))
        bar = max(bar, ladder.error_bar(values, max_distance, order))
    return bar + extreme.between


class _Extreme(NamedTuple):
    value: float
    t: float  # [s]
    s: float  # [m] on the rope
    track: int  # its index
    between: float  # possible excess between samples
    step: float  # [s] between samples


class Signal(NamedTuple):
    """A design number by its definition: the extreme of signals of a run, the smallest if its name says min.

    time_span : [s].  period : [s] of means; 0: of the signals as they are.
    """

    name: str
    tracks: Tracks
    time_span: tuple[float, float]
    period: float

    @property
    def sign(self) -> float:
        """+1: largest, -1: smallest."""
        return -1.0 if self.name.partition(":")[0].endswith("_min") else 1.0

    @property
    def is_clearance(self) -> bool:
        """Whether it is taken up to the end of the run, with gaps between its samples."""
        return self.name.startswith("clearance_")

    def averaged_samples(self, track: Track) -> Track:
        """A track (n,) of means over the period, of values along the cable their extremes."""
        if track.value.ndim > 1:
            return self._extremes_along_cable(track)
        t, value, s = self._samples_in_time_span(track)
        if self.period and t.size > 2:
            low = np.clip(t - 0.5 * self.period, t[0], t[-1])
            high = np.clip(t + 0.5 * self.period, t[0], t[-1])
            value = time_means_between(t, value[:, None], low, high)[:, 0]
        return Track(t, value, s)

    def _extremes_along_cable(self, track: Track) -> Track:
        """Extremes (n,) along the cable of the means over the period, at frames without nan."""
        rows = is_within(track.t, *self.time_span)
        rows &= np.isfinite(track.value).all(axis=1)
        t = track.t[rows]
        value = track.value[rows]
        if t.size == 0:
            return Track(t, t, t)
        if self.period:  # at least over neighbouring frames
            sums = np.concatenate([0.0 * value[:1], np.cumsum(value, axis=0)])
            k = np.arange(t.size)
            half = 0.5 * self.period
            before = np.maximum(k - 1, 0)
            after = np.minimum(k + 2, t.size)
            first = np.minimum(np.searchsorted(t, t - half), before)
            last = np.maximum(np.searchsorted(t, t + half, side="right"), after)
            value = (sums[last] - sums[first]) / (last - first)[:, None]
        at = (self.sign * value).argmax(axis=1)
        return Track(t, value[np.arange(t.size), at], track.s[at])

    def _samples_in_time_span(self, track: Track) -> Track:
        """Samples in the time span, its ends included, where the signal is finite."""
        has_value = np.isfinite(track.value)
        t = track.t[has_value]
        value = track.value[has_value]
        s = track.s[has_value]
        rows = is_within(t, *self.time_span)
        inside = t[rows]
        if self.is_clearance or inside.size == 0:
            return Track(inside, value[rows], s[rows])
        ends = np.clip(self.time_span, t[0], t[-1])
        distinct = np.abs(ends - inside[[0, -1]]) > ROUNDING * self.time_span[1]
        at = np.concatenate([ends[:1][distinct[:1]], inside, ends[1:][distinct[1:]]])
        return Track(at, np.interp(at, t, value), np.interp(at, t, s))

    def extreme(self, r: Response) -> _Extreme | None:
        """The largest value times the sign over all its tracks, the first of those equal up to rounding.

        None without samples.
        """
        extreme = None
        sign = self.sign
        rise = 0.25  # of the larger neighbouring step: a parabola's rise above its highest sample
        for i, track in enumerate(self.tracks(r)):
            t, value, s = self.averaged_samples(track)
            if t.size == 0:
                continue
            largest = float((sign * value).max())
            rounding = ROUNDING * abs(largest)
            if extreme is not None and largest <= sign * extreme.value + rounding:
                continue
            k = int((sign * value >= largest - rounding).argmax())
            around = slice(max(0, k - 1), k + 2)
            between = 0.0
            if track.value.ndim > 1:
                between = rise * float(np.abs(value[around] - value[k]).max())
            step = float(np.ptp(t[around]))
            extreme = _Extreme(float(value[k]), float(t[k]), float(s[k]), i, between, step)
        return extreme

    def extreme_value_or_nan(self, r: Response) -> float:
        extreme = self.extreme(r)
        return math.nan if extreme is None else extreme.value

    def averaged_values_at(self, track: int, times: Array, r: Response) -> Array:
        """Values (n,) of a track by its index at times; nan of a run that ends before."""
        t, value, _ = self.averaged_samples(self.tracks(r)[track])
        needed = min(times[-1], r.t[-1]) - np.ptp(times)
        if t.size == 0 or t[-1] < needed:
            return np.full(times.shape, math.nan)
        return np.interp(times, t, value)


def _is_at_boundary(extreme: _Extreme, r: Response, time_span: tuple[float, float]) -> bool:
    at_end_of_time = min(extreme.t - time_span[0], time_span[1] - extreme.t) <= 0.5 * extreme.step
    return bool(at_end_of_time or not 0.0 < extreme.s < r.length)


def _slack_onset_design_number(ladder: Ladder, other: Response | None) -> Number | None:
    """Where slack begins, if before waves are slower than the mass in either run: no bar holds from there on."""
    r = ladder.finest
    onset = relative_slack_onset_before_far_support(r)
    if math.isinf(onset) or onset > min(relative_position_where_mass_outruns_waves(x) for x in (r, other or r)):
        return None

    def onset_or_nan(x: Response) -> float:
        return math.nan if x.slack_onset is None else x.slack_onset

    step = float(np.diff(r.s_o).max()) / r.length
    bar = ladder.error_bar(onset_or_nan, max_distance, FIRST) + step
    s_o = onset * r.length
    t = float(np.interp(s_o, r.s_o, r.t))
    s = x = None
    if r.slack_at is not None:
        s = r.slack_at * r.length
        x = float(np.interp(s, r.fields.s, r.fields.x))
    return _design_row("slack_onset", onset, bar, "s_o/l", t=t, s_o=s_o, s=s, x=x)
