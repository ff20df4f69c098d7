"""Design numbers of a ropeway in SI with bars: extremes over a run.

Forces are means over an axial round trip, which ropes and load cells feel; `peak` is the raw extreme.
The steepest angle at a support is the largest one to the horizontal, up or down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from cablefem.newmark import scheme
from cablefem.response import Array, Response
from cablefem.scene import Scene
from cablefem.scene.bodies import Wheels
from cablefem.scene.cable import Rope
from validation.core.agreement import Agreement, Bound, BoundPart
from validation.core.clearances import Clearances, Track, clearance_tracks, obstacle_and_ground_profiles
from validation.core.ladder import Ladder, max_distance
from validation.core.measures import (
    last_time_valid_in_all,
    position_where_mass_outruns_waves,
    time_means_between,
    time_span_for_extremes,
)
from validation.core.order import FIRST
from validation.core.quantities import unit_of
from validation.core.scene_data import ROUNDING, SceneData
from validation.core.store import nulls_for_nonfinite
from validation.core.wheels import rope_stresses_under_wheel

Number = dict[str, Any]
Tracks = Callable[[Response], list[Track]]


@dataclass(frozen=True, slots=True)
class Quantity:
    sign: float  # +1: largest, -1: smallest
    tracks: Tracks
    inner: bool = False  # meaningless at the ends of range and cable
    anywhere: bool = False  # taken up to the end of the run, with gaps between its samples


def _tracks_at_mass(*signals: Callable[[Response], Array]) -> Tracks:
    return lambda r: [Track(r.t, of(r), r.s_o) for of in signals]


def _driving_tracks(mode: str, of: Callable[[Array], Array] = np.positive) -> Tracks:
    """The force along the rope that drives a car: of a haul rope, or a free car's thrust; none in another mode."""
    return lambda r: [Track(r.t, of(r.F_haul), r.s_o)] if r.drive == mode else []


def _magnitude(reaction: Array) -> Array:
    return np.asarray(np.hypot(reaction[:, 0], reaction[:, 1]))


def _angle_to_horizontal(reaction: Array) -> Array:
    """Angle [deg] of a reaction (n, 2) to the horizontal."""
    return np.degrees(np.arctan2(np.abs(reaction[:, 1]), np.abs(reaction[:, 0])))


def _tracks_at_support(side: str, of: Callable[[Array], Array] = _magnitude) -> Tracks:
    """A signal of a reaction (n, 2)."""

    def tracks(r: Response) -> list[Track]:
        s = np.full(r.t.size, r.length if side == "right" else 0.0)
        return [Track(r.t, of(getattr(r, f"reaction_{side}")), s)]

    return tracks


def _tension_tracks(r: Response) -> list[Track]:
    at_mass = _tracks_at_mass(lambda r: r.T_behind, lambda r: r.T_ahead)(r)
    return [
        *at_mass,
        Track(r.fields.t, r.fields.T, r.fields.s),
        *_tracks_at_support("left")(r),
        *_tracks_at_support("right")(r),
    ]


def _depth_tracks(r: Response) -> list[Track]:
    return [Track(r.t, r.y, r.s_o), Track(r.fields.t, r.fields.y + r.fields.v, r.fields.s)]


def _horizontal_part(reaction: Array) -> Array:
    return np.abs(reaction[:, 0])


def _vertical_part(reaction: Array) -> Array:
    return np.abs(reaction[:, 1])


QUANTITIES: dict[str, Quantity] = {
    "tension_max": Quantity(1.0, _tension_tracks),
    "tension_min": Quantity(-1.0, _tension_tracks),
    "reaction_left_max": Quantity(1.0, _tracks_at_support("left")),
    "reaction_left_horizontal_max": Quantity(1.0, _tracks_at_support("left", _horizontal_part)),
    "reaction_left_vertical_max": Quantity(1.0, _tracks_at_support("left", _vertical_part)),
    "reaction_right_max": Quantity(1.0, _tracks_at_support("right")),
    "reaction_right_horizontal_max": Quantity(1.0, _tracks_at_support("right", _horizontal_part)),
    "reaction_right_vertical_max": Quantity(1.0, _tracks_at_support("right", _vertical_part)),
    "contact_max": Quantity(1.0, _tracks_at_mass(lambda r: r.F_contact)),
    "contact_min": Quantity(-1.0, _tracks_at_mass(lambda r: r.F_contact)),
    "haul_force_max": Quantity(1.0, _driving_tracks("haul", np.abs)),
    "haul_force_min": Quantity(-1.0, _driving_tracks("haul")),
    "thrust_max": Quantity(1.0, _driving_tracks("free", np.abs)),
    "thrust_min": Quantity(-1.0, _driving_tracks("free")),
    "deepest_point": Quantity(1.0, _depth_tracks, inner=True),
    "mass_deepest": Quantity(1.0, _tracks_at_mass(lambda r: r.y), inner=True),
    "mass_deflection_max": Quantity(1.0, _tracks_at_mass(lambda r: r.v)),
    "speed_max": Quantity(1.0, _tracks_at_mass(lambda r: r.speed)),
    "angle_left": Quantity(1.0, _tracks_at_support("left", _angle_to_horizontal)),
    "angle_right": Quantity(1.0, _tracks_at_support("right", _angle_to_horizontal)),
}  # fmt: skip


_scene_of_toml = lru_cache(maxsize=4)(Scene.from_toml)


@lru_cache(maxsize=4)
def _axial_round_trip(toml: str, length: float) -> float:
    """Of an axial wave [s]."""
    return SceneData(toml, length).round_trip


def quantities_of_run(r: Response) -> dict[str, Quantity]:
    """Quantities of a run, with clearances, which are computed once for each run of a ladder."""
    scene = _scene_of_toml(r.scene_toml)
    computed: dict[int, Clearances] = {}

    def clearance_track(key: tuple[str, str], r: Response) -> list[Track]:
        if id(r) not in computed:
            computed[id(r)] = clearance_tracks(scene, r)
        return [computed[id(r)][key]]

    named = dict(QUANTITIES)
    for ground in obstacle_and_ground_profiles(scene):
        for body in ("rope", "car"):
            named[f"clearance_{body}_min:{ground}"] = Quantity(
                -1.0, partial(clearance_track, (body, ground)), anywhere=True
            )
    if "sag_growth" in demands_of_limits(scene):
        named["sag_car_max"] = Quantity(1.0, _car_sag_tracks)
    if scene.mass is not None and scene.mass.wheels is not None:
        for name in rope_stresses_under_wheel(scene.cable, scene.mass.wheels, np.ones(1), np.ones(1)):
            sign = -1.0 if name.endswith("min") else 1.0
            named[name] = Quantity(sign, partial(_stress_tracks, scene.cable, scene.mass.wheels, name))
    return named


def _stress_tracks(rope: Rope, wheels: Wheels, name: str, r: Response) -> list[Track]:
    """A design number of the rope behind and ahead of the car."""
    Q = r.F_contact / wheels.count
    return [Track(r.t, rope_stresses_under_wheel(rope, wheels, N, Q)[name], r.s_o) for N in (r.T_behind, r.T_ahead)]


def demands_of_limits(scene: Scene) -> set[str]:
    """What the limits of a scene ask for."""
    if scene.limits is None:
        return set()
    return {rule["demand"] for rule in scene.limits.rules(scene.supports.span)}


def _car_sag_tracks(r: Response) -> list[Track]:
    """Depth of the car below the chord."""
    f = r.fields
    return [Track(r.t, r.y - r.x * f.y[-1] / f.x[-1], r.s_o)]


def _numbers_for_limits(scene: Scene) -> Iterator[Number]:
    """Numbers that limits need: largest sag at the car at rest, extremes of the timetable."""
    asked = demands_of_limits(scene)
    if "sag_growth" in asked:
        from validation.core.quasi_static import Statics  # splines are slow to load

        count = 2001  # places of the car at rest
        points = scene.length * Statics(scene.groups)(np.linspace(0.0, 1.0, count)).car_point  # (n, 2)
        sag = points[:, 1] - points[:, 0] * scene.supports.drop / scene.supports.span
        interpolation = 1e-5  # of the sag, of `Statics` and between these places
        yield _number_row("sag_car_rest", float(sag.max()), interpolation * float(sag.max()), "m")
    motion = scene.groups.motion
    if scene.travel is None or scene.travel.kind == "table" or motion is None:
        return
    unit = scene.length / scene.time_scale**2
    begin = 0.0
    rates = []
    samples = 21  # accelerations are linear in a phase
    for phase, (_, end) in enumerate(motion.phases):
        rates += [motion.at(float(t), phase)[2] * unit for t in np.linspace(begin, end, samples)]
        begin = end
    if "acceleration" in asked:
        yield _number_row("acceleration_max", max(0.0, *rates), 0.0, "m/s2")
    if "deceleration" in asked:
        yield _number_row("deceleration_max", max(0.0, *(-rate for rate in rates)), 0.0, "m/s2")


def _number_row(quantity: str, value: float | None, bar: float, unit: str, **where: float | None) -> Number:
    """A design number; None: unknown, not applicable, or a clearance of what the car never passes.

    where : t [s]; s_o of the mass, static x, and s on the cable [m]; `peak`, the raw extreme of a force.
    """
    empty = dict.fromkeys(("t", "s_o", "x", "s", "peak", "bar_peak"))
    return {"quantity": quantity, "value": value, "bar": nulls_for_nonfinite(bar), "unit": unit, **empty, **where}


def _safety_factor_number(r: Response, numbers: list[Number]) -> Iterator[Number]:
    load = _scene_of_toml(r.scene_toml).cable.breaking_load
    tension = next((number for number in numbers if number["quantity"] == "tension_max"), None)
    if load is None or tension is None:
        return
    bar = math.inf if tension["bar"] is None else load * tension["bar"] / tension["value"] ** 2
    where = {name: tension[name] for name in ("t", "s_o", "x", "s")}
    yield _number_row("safety_factor_min", load / tension["value"], bar, "", **where)


def design_numbers(ladder_or_run: Ladder | Response, counterpart: Ladder | None = None) -> list[Number]:
    """The `design` rows: known design numbers, of a ladder with its own bars.

    counterpart : the other solver's; extremes are then taken as far as both go.
    """
    ladder = ladder_or_run if isinstance(ladder_or_run, Ladder) else None
    r = ladder_or_run.finest if isinstance(ladder_or_run, Ladder) else ladder_or_run
    other = None if counterpart is None else counterpart.finest
    numbers = []
    for name, signal in signals_of_run(r, other).items():
        number = _design_number(name, signal, r, ladder)
        if number is not None:
            numbers.append(number)
    numbers += _safety_factor_number(r, numbers)
    tilt = _scene_of_toml(r.scene_toml).wind_tilt
    if tilt is not None:
        numbers.append(_number_row("wind_tilt", tilt, 0.0, "deg"))
    numbers += _numbers_for_limits(_scene_of_toml(r.scene_toml))
    return [*numbers, *_slack_onset_number(r, other, ladder)]


def signals_of_run(r: Response, other: Response | None = None) -> dict[str, Signal]:
    """What the extremes of a run are taken of, as far as both runs go."""
    span = time_span_for_extremes(r, other)
    everything = (float(r.t[0]), last_time_valid_in_all(r, other or r))
    round_trip = _axial_round_trip(r.scene_toml, r.length)
    out = {}
    for name, quantity in quantities_of_run(r).items():
        means = unit_of(name) in ("N", "deg", "Pa") or name == "tension_over_wheel_min"  # what follows a force
        out[name] = Signal(quantity, everything if quantity.anywhere else span, round_trip if means else 0.0)
    return out


def widened_numbers(numbers: Sequence[Number], others: Sequence[Number]) -> list[Number]:
    """Design numbers with bars of at least the gap to the other solver's."""
    other = {row["quantity"]: row for row in others}
    rows = []
    for number in numbers:
        changed = dict(number)
        for name, bar in (("value", "bar"), ("peak", "bar_peak")):
            gap = _number_gap(name, number, other.get(number["quantity"]))
            if gap is not None and number[bar] is not None:
                changed[bar] = max(number[bar], gap)
        rows.append(changed)
    return rows


def _number_gap(name: str, number: Number, other: Number | None) -> float | None:
    """Distance of two solvers in a design number; None where one of them does not know it."""
    if other is None or number[name] is None or other[name] is None:
        return None
    return float(abs(number[name] - other[name]))


def design_gap_rows(a: Ladder, b: Ladder, tolerance: float) -> Iterator[Agreement]:
    """Shown rows of two solvers' design numbers with their own bars, over the larger value."""
    other = {row["quantity"]: row for row in b.finest.design}
    for number in a.finest.design:
        counterpart = other.get(number["quantity"])
        gap = _number_gap("value", number, counterpart)
        if counterpart is None or gap is None:
            continue
        size = max(abs(number["value"]), abs(counterpart["value"])) or 1.0
        bars = []
        for x, row in ((a, number), (b, counterpart)):
            bars.append(
                BoundPart(x.finest.method, math.inf if row["bar"] is None else row["bar"] / size, "coarser runs")
            )
        bound = Bound("error bars", tuple(bars))
        yield Agreement("design gap", gap / size, bound, law=number["quantity"], required=tolerance, decides=False)


def _design_number(name: str, signal: Signal, r: Response, ladder: Ladder | None) -> Number | None:
    unit = unit_of(name)
    period = signal.period
    found = signal.extreme(r)
    if found is None:
        return _number_row(name, None, math.inf, unit) if name.startswith("clearance_") else None
    if signal.quantity.inner and _is_at_end_of_span(found, r, signal.span):
        return None  # no extreme in the range
    count = 9  # times around an extreme at which two runs are compared
    near = np.clip(found.t + np.linspace(-1.0, 1.0, count) * max(period, found.step), *signal.span)
    bar = math.inf
    if ladder is not None:
        bar = _bar_of_extreme(signal, found, near, ladder, FIRST if period else math.inf)
    where = {
        "t": found.t,
        "s_o": float(np.interp(found.t, r.t, r.s_o)),
        "x": float(np.interp(found.s, r.fields.s, r.fields.x)),
        "s": found.s,
    }
    if unit != "N":
        return _number_row(name, found.value, bar, unit, **where)
    raw = replace(signal, period=0.0)
    bar_peak = math.inf
    if ladder is not None and not _damps_axial_waves(r):  # else coarser runs do not show the error of axial waves
        bar_peak = _bar_of_extreme(raw, found, near, ladder, FIRST)
    return _number_row(name, found.value, bar, unit, **where, peak=raw.value(r), bar_peak=nulls_for_nonfinite(bar_peak))


def _damps_axial_waves(r: Response) -> bool:
    """Whether the rule of a run damps axial waves."""
    return scheme(r.settings["scheme"], rho_inf=r.settings.get("rho_inf", 1.0)).damps


def _bar_of_extreme(signal: Signal, found: _Extreme, near: Array, ladder: Ladder, order: float) -> float:
    """Bar of an extreme and of the signal near it."""
    bar = ladder.bar(signal.value, max_distance, order)
    if found.step > 0.0:
        bar = max(bar, ladder.bar(partial(signal.values_at, found.track, near), max_distance, order))
    return bar + found.between


@dataclass(frozen=True, slots=True)
class _Extreme:
    value: float
    t: float
    s: float
    track: int
    between: float  # possible excess between samples
    step: float  # [s] between samples


@dataclass(frozen=True, slots=True)
class Signal:
    """A quantity in a range of times [s], as a mean over a period."""

    quantity: Quantity
    span: tuple[float, float]
    period: float

    def samples(self, track: Track) -> tuple[Array, Array, Array]:
        """Times, values and s, (n,) each: means over the period, extremes along the cable."""
        if track.value.ndim == 1:
            t, value, s = self._samples_in_span(track)
            if t.size == 0:
                return t, t, t
            if self.period and t.size > 2:
                low, high = (np.clip(t + half * self.period, t[0], t[-1]) for half in (-0.5, 0.5))
                value = time_means_between(t, value[:, None], low, high)[:, 0]
            return t, value, s
        rows = (track.t >= self.span[0] * (1.0 - ROUNDING)) & (track.t <= self.span[1] * (1.0 + ROUNDING))
        rows &= np.isfinite(track.value).all(axis=1)
        t = track.t[rows]
        value = track.value[rows]
        if t.size == 0:
            return t, t, t
        if self.period:  # at least over neighbouring frames
            sums = np.concatenate([0.0 * value[:1], np.cumsum(value, axis=0)])
            k = np.arange(t.size)
            first = np.minimum(np.searchsorted(t, t - 0.5 * self.period), np.maximum(k - 1, 0))
            last = np.maximum(np.searchsorted(t, t + 0.5 * self.period, side="right"), np.minimum(k + 2, t.size))
            value = (sums[last] - sums[first]) / (last - first)[:, None]
        at = (self.quantity.sign * value).argmax(axis=1)
        return t, value[np.arange(t.size), at], track.s[at]

    def _samples_in_span(self, track: Track) -> tuple[Array, Array, Array]:
        """Times, values and s in the range, its ends included, where the signal is finite."""
        has_value = np.isfinite(track.value)
        t = track.t[has_value]
        value = track.value[has_value]
        s = track.s[has_value]
        rows = (t >= self.span[0] * (1.0 - ROUNDING)) & (t <= self.span[1] * (1.0 + ROUNDING))
        inside = t[rows]
        if self.quantity.anywhere or inside.size == 0:
            return inside, value[rows], s[rows]
        ends = np.clip(self.span, t[0], t[-1])
        distinct = np.abs(ends - inside[[0, -1]]) > ROUNDING * self.span[1]
        at = np.concatenate([ends[:1][distinct[:1]], inside, ends[1:][distinct[1:]]])
        return at, np.interp(at, t, value), np.interp(at, t, s)

    def extreme(self, r: Response) -> _Extreme | None:
        """The largest value times the quantity's sign over all its tracks, the first of those equal up to rounding.

        None without samples.
        """
        found = None
        sign = self.quantity.sign
        rise = 0.25  # of the larger neighbouring step: a parabola's rise above its highest sample
        for i, track in enumerate(self.quantity.tracks(r)):
            t, value, s = self.samples(track)
            if t.size == 0:
                continue
            largest = float((sign * value).max())
            rounding = ROUNDING * abs(largest)
            if found is not None and largest <= sign * found.value + rounding:
                continue
            k = int((sign * value >= largest - rounding).argmax())
            around = slice(max(0, k - 1), k + 2)
            between = 0.0
            if track.value.ndim > 1:
                between = rise * float(np.abs(value[around] - value[k]).max())
            step = float(np.ptp(t[around]))
            found = _Extreme(float(value[k]), float(t[k]), float(s[k]), i, between, step)
        return found

    def value(self, r: Response) -> float:
        found = self.extreme(r)
        return math.nan if found is None else found.value

    def values_at(self, track: int, near: Array, r: Response) -> Array:
        """Values (n,) of a track at the times `near`; nan of a run that ends before."""
        t, value, _ = self.samples(self.quantity.tracks(r)[track])
        if t.size == 0 or t[-1] < min(near[-1], r.t[-1]) - np.ptp(near):
            return np.full(near.shape, math.nan)
        return np.interp(near, t, value)


def _is_at_end_of_span(found: _Extreme, r: Response, span: tuple[float, float]) -> bool:
    ends = min(found.t - span[0], span[1] - found.t) <= 0.5 * found.step
    return bool(ends or not 0.0 < found.s < r.length)


def _slack_onset_number(r: Response, other: Response | None, ladder: Ladder | None) -> Iterator[Number]:
    """Where slack begins, if before waves are slower than the mass in either run: no bar holds from there on."""
    if r.slack_onset is None or r.slack_onset > min(
        position_where_mass_outruns_waves(r), position_where_mass_outruns_waves(other or r)
    ):
        return

    def onset_or_nan(x: Response) -> float:
        return math.nan if x.slack_onset is None else x.slack_onset

    bar = math.inf
    if ladder is not None:
        bar = ladder.bar(onset_or_nan, max_distance, FIRST) + float(np.diff(r.s_o).max()) / r.length
    s_o = r.slack_onset * r.length
    where: dict[str, float | None] = {"t": float(np.interp(s_o, r.s_o, r.t)), "s_o": s_o}
    if r.slack_at is not None:
        s = r.slack_at * r.length
        where |= {"x": float(np.interp(s, r.fields.s, r.fields.x)), "s": s}
    yield _number_row("slack_onset", r.slack_onset, bar, "s_o/l", **where)
