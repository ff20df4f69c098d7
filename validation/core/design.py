"""Design numbers of a ropeway in SI with bars: extremes over a ride.

Forces are means over an axial round trip, which ropes and load cells feel; `peak` is the raw extreme.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np

from cablefem.newmark import scheme
from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core.agreement import finite
from validation.core.answers import Track, clearances, grounds
from validation.core.evidence import ROUNDING, Given
from validation.core.ladder import Ladder, largest
from validation.core.measures import averaged, extremes_within
from validation.core.order import FIRST
from validation.core.quantities import unit_of

NEAR = 9  # times around an extreme at which two runs are compared
BETWEEN = 0.25  # of the larger neighbouring step: a parabola's rise above its highest sample


Number = dict[str, Any]
Tracks = Callable[[Response], list[Track]]


@dataclass(frozen=True, slots=True)
class Quantity:
    sign: float  # +1: largest, -1: least
    tracks: Tracks
    inner: bool = False  # meaningless at the ends of range and cable


def _at_mass(*signals: Callable[[Response], Array]) -> Tracks:
    return lambda r: [Track(r.t, of(r), r.s_o) for of in signals]


def _size(x: Array) -> Array:
    return np.asarray(np.hypot(x[:, 0], x[:, 1]))


def _at_support(side: str, of: Callable[[Array], Array] = _size) -> Tracks:
    """A signal of a reaction (n, 2)."""
    return lambda r: [Track(r.t, of(getattr(r, f"reaction_{side}")), np.full(r.t.size, (side == "right") * r.length))]


def _tension(r: Response) -> list[Track]:
    at_mass = _at_mass(lambda r: r.T_behind, lambda r: r.T_ahead)(r)
    return [*at_mass, Track(r.fields.t, r.fields.T, r.fields.s), *_at_support("left")(r), *_at_support("right")(r)]


def _depth(r: Response) -> list[Track]:
    return [Track(r.t, r.y, r.s_o), Track(r.fields.t, r.fields.y + r.fields.v, r.fields.s)]


QUANTITIES: dict[str, Quantity] = {
    "tension_max": Quantity(1.0, _tension),
    "tension_min": Quantity(-1.0, _tension),
    **{
        f"reaction_{side}_{part}max": Quantity(1.0, _at_support(side, of))
        for side in ("left", "right")
        for part, of in (
            ("", _size), ("horizontal_", lambda x: np.abs(x[:, 0])), ("vertical_", lambda x: np.abs(x[:, 1])),
        )
    },
    "contact_max": Quantity(1.0, _at_mass(lambda r: r.F_contact)),
    "contact_min": Quantity(-1.0, _at_mass(lambda r: r.F_contact)),
    "haul_force_max": Quantity(1.0, _at_mass(lambda r: np.abs(r.F_haul))),
    "haul_force_min": Quantity(-1.0, _at_mass(lambda r: r.F_haul)),
    "deepest_point": Quantity(1.0, _depth, inner=True),
    "mass_deepest": Quantity(1.0, _at_mass(lambda r: r.y), inner=True),
    "mass_deflection_max": Quantity(1.0, _at_mass(lambda r: r.v)),
    "speed_max": Quantity(1.0, _at_mass(lambda r: r.speed)),
}  # fmt: skip


def _angle(side: str) -> Tracks:
    """Angle [deg] of the rope at a support, positive downhill."""
    out = 1.0 if side == "right" else -1.0
    return _at_support(side, lambda x: np.degrees(np.arctan2(out * x[:, 1], out * x[:, 0])))


def _clearance(of: str, name: str) -> Tracks:
    return lambda r: [clearances(_scene(r.scene_toml), r)[of, name]]


_scene = lru_cache(maxsize=4)(Scene.from_toml)


def quantities(r: Response) -> dict[str, Quantity]:
    """Quantities of a run, with rope angles and clearances."""
    asked = dict(QUANTITIES)
    for side in ("left", "right"):
        tracks = _angle(side)
        steep = float(tracks(r)[0].value[0])
        asked[f"angle_{side}"] = Quantity(-1.0 if steep < 0.0 else 1.0, tracks)
    for name in grounds(_scene(r.scene_toml)):
        for of in ("rope", "car"):
            asked[f"clearance_{of}_min:{name}"] = Quantity(-1.0, _clearance(of, name))
    return asked


def _told(quantity: str, value: float | None, bar: float, unit: str, **where: float | None) -> Number:
    """A design number; None: unknown, not applicable, or a clearance of what the car never passes.

    where : t [s]; s_o of the mass, static x, and s on the cable [m]; `peak`, the raw extreme of a force.
    """
    empty = dict.fromkeys(("t", "s_o", "x", "s", "peak", "bar_peak"))
    return {"quantity": quantity, "value": value, "bar": finite(bar), "unit": unit, **empty, **where}


def _safety(r: Response, found: list[Number]) -> Iterator[Number]:
    load = _scene(r.scene_toml).cable.breaking_load
    for T in found:
        if load is not None and T["quantity"] == "tension_max":
            bar = math.inf if T["bar"] is None else load * T["bar"] / T["value"] ** 2
            where = {k: T[k] for k in ("t", "s_o", "x", "s")}
            yield _told("safety_factor_min", load / T["value"], bar, "", **where)


def design(of: Ladder | Response, twin: Ladder | None = None) -> list[Number]:
    """The `design` rows: known design numbers, of a ladder with bars of at least the gap to the twin's."""
    r, ladder = (of.finest, of) if isinstance(of, Ladder) else (of, None)
    other = None if twin is None else twin.finest
    span = extremes_within(r, other)
    found = [x for name, asked in quantities(r).items() if (x := _number(name, asked, r, span, ladder, other))]
    tilt = _scene(r.scene_toml).wind_tilt
    still = [] if tilt is None else [_told("wind_tilt", tilt, 0.0, "deg")]
    return [*found, *_safety(r, found), *still, *_onset(r, ladder, other)]


def _number(
    name: str, quantity: Quantity, r: Response, span: tuple[float, float], ladder: Ladder | None, twin: Response | None
) -> Number | None:
    unit = unit_of(name)
    period = Given(r.scene_toml, r.length).round_trip if unit in ("N", "deg") else 0.0  # an angle follows a force
    mean, raw = _Signal(quantity, span, period), _Signal(quantity, span, 0.0)
    found = mean.extreme(r)
    if found is None:
        return _told(name, None, math.inf, unit) if name.startswith("clearance_") else None
    late = unit == "deg" and span[1] - found.t <= 0.5 * period + found.step
    if late or (quantity.inner and _at_an_end(found, r, span)):
        return None  # no extreme in the range
    bar = bar_peak = math.inf
    if ladder is not None:
        near = np.clip(found.t + np.linspace(-1.0, 1.0, NEAR) * max(period, found.step), *span)
        bar = _bar(mean, found, near, ladder, twin, FIRST if period else math.inf)
        rule = scheme(r.settings["scheme"], rho_inf=r.settings.get("rho_inf", 1.0))
        if not rule.damps:  # else coarser runs do not show the error of axial waves
            bar_peak = _bar(raw, found, near, ladder, twin, FIRST)
    t, s = found.t, found.s
    place, x = float(np.interp(t, r.t, r.s_o)), float(np.interp(s, r.fields.s, r.fields.x))
    peak = {"peak": raw.value(r), "bar_peak": finite(bar_peak)} if unit == "N" else {}
    return _told(name, found.value, bar, unit, t=t, s_o=place, x=x, s=s, **peak)


def _bar(signal: _Signal, found: _Extreme, near: Array, ladder: Ladder, twin: Response | None, order: float) -> float:
    """Bar of an extreme and of the signal near it; at least the gap to the twin's."""
    of = [signal.value] + ([partial(signal.beside, found.track, near)] if found.step > 0.0 else [])
    bar = max(ladder.bar(x, largest, order) for x in of) + found.between
    return max(bar, 0.0 if twin is None else abs(signal.value(ladder.finest) - signal.value(twin)))


@dataclass(frozen=True, slots=True)
class _Extreme:
    value: float
    t: float
    s: float
    track: int
    between: float  # possible excess between samples
    step: float  # [s] between samples


@dataclass(frozen=True, slots=True)
class _Signal:
    """A quantity in a range of times [s], as a mean over a period."""

    quantity: Quantity
    span: tuple[float, float]
    period: float

    def samples(self, track: Track) -> tuple[Array, Array, Array]:
        """Times, values and places: means over the period, extremes along the cable."""
        rows = (track.t >= self.span[0] * (1.0 - ROUNDING)) & (track.t <= self.span[1] * (1.0 + ROUNDING))
        finite = np.isfinite(track.value)
        rows &= finite if finite.ndim == 1 else finite.all(axis=1)
        t, value = track.t[rows], track.value[rows]
        if t.size == 0:
            return t, t, t
        if value.ndim == 1:
            if self.period and t.size > 2:
                low, high = (np.clip(t + half * self.period, t[0], t[-1]) for half in (-0.5, 0.5))
                value = averaged(t, value[:, None], low, high)[:, 0]
            return t, value, track.s[rows]
        if self.period:  # at least over neighbouring frames
            sums = np.concatenate([0.0 * value[:1], np.cumsum(value, axis=0)])
            k = np.arange(t.size)
            first = np.minimum(np.searchsorted(t, t - 0.5 * self.period), np.maximum(k - 1, 0))
            last = np.maximum(np.searchsorted(t, t + 0.5 * self.period, side="right"), np.minimum(k + 2, t.size))
            value = (sums[last] - sums[first]) / (last - first)[:, None]
        at = (self.quantity.sign * value).argmax(axis=1)
        return t, value[np.arange(t.size), at], track.s[at]

    def extreme(self, r: Response) -> _Extreme | None:
        found, sign = None, self.quantity.sign
        for i, track in enumerate(self.quantity.tracks(r)):
            t, value, s = self.samples(track)
            if t.size == 0:
                continue
            k = int((sign * value).argmax())
            if found is None or sign * value[k] > sign * found.value:
                beside = slice(max(0, k - 1), k + 2)
                between = BETWEEN * float(np.abs(value[beside] - value[k]).max()) if track.value.ndim > 1 else 0.0
                found = _Extreme(float(value[k]), float(t[k]), float(s[k]), i, between, float(np.ptp(t[beside])))
        return found

    def value(self, r: Response) -> float:
        found = self.extreme(r)
        return math.nan if found is None else found.value

    def beside(self, track: int, near: Array, r: Response) -> Array:
        """Values (n,) of a track at the times `near`; nan of a run that ends before."""
        t, value, _ = self.samples(self.quantity.tracks(r)[track])
        there = t.size and t[-1] >= min(near[-1], r.t[-1]) - np.ptp(near)
        return np.interp(near, t, value) if there else math.nan * near


def _at_an_end(found: _Extreme, r: Response, span: tuple[float, float]) -> bool:
    ends = min(found.t - span[0], span[1] - found.t) <= 0.5 * found.step
    return bool(ends or not 0.0 < found.s < r.length)


def _onset(r: Response, ladder: Ladder | None, twin: Response | None) -> Iterator[Number]:
    if r.slack_onset is None:
        return

    def onset(x: Response) -> float:
        return math.nan if x.slack_onset is None else x.slack_onset

    bar = math.inf
    if ladder is not None:
        bar = ladder.bar(onset, largest, FIRST) + float(np.diff(r.s_o).max()) / r.length
        bar = max(bar, 0.0 if twin is None else abs(r.slack_onset - onset(twin)))
    at = r.slack_onset * r.length
    s = None if r.slack_at is None else r.slack_at * r.length
    x = None if s is None else float(np.interp(s, r.fields.s, r.fields.x))
    t = float(np.interp(at, r.s_o, r.t))
    yield _told("slack_onset", r.slack_onset, bar, "s_o/l", t=t, s_o=at, x=x, s=s)
