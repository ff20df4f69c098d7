"""The numbers a ropeway is designed with, in SI, each with its bar: extremes over a ride, where and when they occur.

Over the range in which bars exist: up to the end of the window of comparison, of a free ride all of it.  A bar is
what half the resolution and half the steps change, in the extreme itself or at its instant, whichever is more; but not
within the coarser run's step from a break of the travel, across which forces jump.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cablefem.response import Array, Response
from validation.core import measures
from validation.core.estimate import Estimated
from validation.core.quantities import unit_of
from validation.core.richardson import SAFETY


@dataclass(frozen=True, slots=True)
class Number:
    """A design number; t [s] and s_o [m] when it occurs, s [m] where on the cable; bar in its unit, None: unknown."""

    quantity: str
    value: float
    bar: float | None
    unit: str
    t: float | None = None
    s_o: float | None = None
    s: float | None = None

    def row(self) -> dict[str, Any]:
        """Return the row of `design` in summary.json and agreement.json."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class _Track:
    """An extreme over the cable at each instant: value and place s [m], (n,) each."""

    t: Array
    value: Array
    s: Array


@dataclass(frozen=True, slots=True)
class _Quantity:
    sign: float  # +1: the largest is wanted, -1: the least
    tracks: Callable[[Response], list[_Track]]
    force: bool  # of first order, by the axial fronts in it


def _at_mass(r: Response, value: Array) -> _Track:
    return _Track(r.t, value, r.s_o)


def _of_field(r: Response, values: Array, sign: float) -> _Track:
    at = (sign * values).argmax(axis=1)
    return _Track(r.fields.t, values[np.arange(at.size), at], r.fields.s[at])


def _at_support(r: Response, force: Array, right: bool) -> _Track:
    return _Track(r.t, force, np.full(r.t.size, r.length if right else 0.0))


def _tension(sign: float) -> Callable[[Response], list[_Track]]:
    return lambda r: [
        _at_mass(r, r.T_behind), _at_mass(r, r.T_ahead), _of_field(r, r.fields.T, sign),
        _at_support(r, np.hypot(*r.reaction_left.T), False), _at_support(r, np.hypot(*r.reaction_right.T), True),
    ]  # fmt: skip


def _reaction(side: str, of: Callable[[Array], Array]) -> Callable[[Response], list[_Track]]:
    return lambda r: [_at_support(r, of(getattr(r, f"reaction_{side}")), side == "right")]


def _depth(r: Response) -> list[_Track]:
    return [_at_mass(r, r.y), _of_field(r, r.fields.y + r.fields.v, 1.0)]


QUANTITIES: dict[str, _Quantity] = {
    "tension_max": _Quantity(1.0, _tension(1.0), True),
    "tension_min": _Quantity(-1.0, _tension(-1.0), True),
    **{
        f"reaction_{side}_{part}max": _Quantity(1.0, _reaction(side, of), True)
        for side in ("left", "right")
        for part, of in (
            ("", lambda x: np.hypot(x[:, 0], x[:, 1])), ("horizontal_", lambda x: np.abs(x[:, 0])),
            ("vertical_", lambda x: np.abs(x[:, 1])),
        )
    },
    "deepest_point": _Quantity(1.0, _depth, False),
    "mass_deepest": _Quantity(1.0, lambda r: [_at_mass(r, r.y)], False),
    "mass_deflection_max": _Quantity(1.0, lambda r: [_at_mass(r, r.v)], False),
    "contact_max": _Quantity(1.0, lambda r: [_at_mass(r, r.F_contact)], True),
    "contact_min": _Quantity(-1.0, lambda r: [_at_mass(r, r.F_contact)], True),
    "haul_force_max": _Quantity(1.0, lambda r: [_at_mass(r, np.abs(r.F_haul))], True),
    "speed_max": _Quantity(1.0, lambda r: [_at_mass(r, r.speed)], False),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Refinement:
    """A run, a coarser one, and what is left of their gap in the finer: as the path converges, and of first order."""

    fine: Response
    coarse: Response
    of_path: float
    of_force: float


def numbers(e: Estimated, twin: Estimated | None = None) -> list[Number]:
    """Return the design numbers of a run with the bars of its companions, and no less than the gap to its twin.

    twin : the run of the other wing, where there is one.  A quantity that a run does not know is left out.
    """
    runs = [x for x in (e, twin) if x is not None]
    try:
        stop = measures.window_of(*(r for x in runs for r in x.runs))[1]
    except measures.NotComparable:
        return alone(e.run)
    companions = zip((e.in_space, e.in_time), (e.own * e.weights[0], e.weights[1]), strict=True)
    pairs = [Refinement(e.run, coarse, weight, SAFETY) for coarse, weight in companions]
    pairs += [Refinement(e.run, e.loud, 0.0, SAFETY)] if e.loud is not None else []
    return [*_numbers(e.run, pairs, stop, None if twin is None else twin.run), *_onset(e, twin)]


def of_ladder(r: Response, pairs: Sequence[Refinement]) -> list[Number]:
    """Return the design numbers of a run with the bars of the refinements that led to it."""
    try:
        stop = measures.window_of(r)[1]
    except measures.NotComparable:
        return alone(r)
    found = _numbers(r, pairs, stop)
    if r.slack_onset is None:
        return found
    onsets = [(x.fine.slack_onset, x.coarse.slack_onset) for x in pairs]
    apart = [abs(fine - coarse) for fine, coarse in onsets if fine is not None and coarse is not None]
    return [*found, _onset_of(r, apart)]


def _numbers(r: Response, pairs: Sequence[Refinement], stop: float, twin: Response | None = None) -> list[Number]:
    out = []
    runs = [r, *(y for x in pairs for y in (x.fine, x.coarse)), *([] if twin is None else [twin])]
    within = {id(x): (x, _Within.of(x, stop)) for x in runs}  # of the same runs once
    for name, quantity in QUANTITIES.items():
        known = {key: _Known(x, quantity, part) for key, (x, part) in within.items()}
        found = known[id(r)].extreme
        if found is None:
            continue
        weights = [x.of_force if quantity.force else x.of_path for x in pairs]
        bar = sum(w * _change(known[id(x.fine)], known[id(x.coarse)]) for w, x in zip(weights, pairs, strict=True))
        if twin is not None:
            bar = max(bar, _change(known[id(r)], known[id(twin)]))
        bar += found.between
        out.append(replace(found.number, quantity=name, unit=unit_of(name), bar=bar if math.isfinite(bar) else None))
    return out


def design(r: Response) -> list[dict[str, Any]]:
    """Return the rows of `design` of a run without companions."""
    return [number.row() for number in alone(r)]


def alone(r: Response) -> list[Number]:
    """Return the design numbers of a run without companions: without bars."""
    stop = min(measures.WINDOWS[r.drive][1], math.inf if r.slack_onset is None else r.slack_onset)
    within = _Within.of(r, stop)
    found = ((name, _Known(r, quantity, within).extreme) for name, quantity in QUANTITIES.items())
    numbers = [replace(x.number, quantity=name, unit=unit_of(name)) for name, x in found if x is not None]
    if r.slack_onset is not None:
        numbers.append(Number("slack_onset", r.slack_onset, None, "s_o/l", s_o=r.slack_onset * r.length))
    return numbers


@dataclass(frozen=True, slots=True)
class _Extreme:
    number: Number
    track: int
    k: int
    between: float  # what may lie between two instants of its track


@dataclass(frozen=True, slots=True)
class _Within:
    """Places s_o of the steps and frames of a run, and which of them count, up to s_o/l = stop.

    A mass that grips enters a cable at rest: while its side is a few steps long, nothing is resolved there, and
    extremes begin where paths are compared.  A car that rolls hangs there in equilibrium.
    """

    steps: tuple[Array, NDArray[np.bool_]]
    frames: tuple[Array, NDArray[np.bool_]]

    @classmethod
    def of(cls, r: Response, stop: float) -> _Within:
        """Look at a run once for all quantities."""
        low, high = r.length * (measures.WINDOW[0] if r.drive == "grip" else -1.0), stop * r.length * (1.0 + 1e-9)
        steps, frames = ((s, (s >= low) & (s <= high)) for s in (r.s_o, np.interp(r.fields.t, r.t, r.s_o)))
        return cls(steps, frames)


class _Known:
    """The tracks of a quantity in a run, and its extreme within; None where nothing is known."""

    def __init__(self, r: Response, quantity: _Quantity, within: _Within) -> None:
        self.t, self.tracks, self.breaks = r.t, quantity.tracks(r), r.breaks
        self.extreme: _Extreme | None = None
        for i, track in enumerate(self.tracks):
            s_o, inside = within.steps if track.t is r.t else within.frames
            inside = inside & np.isfinite(track.value)
            if not inside.any():
                continue
            k = int(np.where(inside, quantity.sign * track.value, -math.inf).argmax())
            if self.extreme is None or quantity.sign * track.value[k] > quantity.sign * self.extreme.number.value:
                at = float(track.t[k]), float(s_o[k]), float(track.s[k])
                near = slice(max(0, k - 1), k + 2)
                since = np.searchsorted(r.breaks, track.t[near])
                beside = np.abs(track.value[near] - track.value[k])[inside[near] & (since == since[k - near.start])]
                # inside, a parabola's top is at most a quarter of the larger step above its highest sample
                between = (0.25 if beside.size == 3 else 1.0) * float(beside.max())
                self.extreme = _Extreme(Number("", float(track.value[k]), None, "", *at), i, k, between)


NEAR = 5  # steps about an extreme over which runs are compared: axial waves that it sits on come sooner or later


def _change(a: _Known, b: _Known) -> float:
    """Return how far an extreme is from that of another run, and from its values thereabouts."""
    here, there = a.extreme, b.extreme
    if here is None or there is None:
        return math.inf
    mine, track = a.tracks[here.track], b.tracks[here.track]
    known, near = np.isfinite(track.value), slice(max(0, here.k - NEAR), here.k + NEAR + 1)
    if not known.any():
        return math.inf
    t, of = mine.t[near], track.t[known]
    apart = mine.value[near] - np.interp(t, of, track.value[known])
    inside = (t <= min(a.t[-1], b.t[-1])) & np.isfinite(apart)
    for since in a.breaks:
        inside &= (t <= since) | (t >= of[of > since].min(initial=math.inf))
    return max(abs(here.number.value - there.number.value), float(np.abs(apart[inside]).max(initial=0.0)))


def _onset(e: Estimated, twin: Estimated | None) -> list[Number]:
    """Return the slack onset; companions that end before it say nothing of it, half of both or the twin does."""
    r = e.run
    if r.slack_onset is None:
        return []
    others = [c for c in (e.in_space, e.in_time, e.late, None if twin is None else twin.run) if c is not None]
    return [_onset_of(r, [abs(r.slack_onset - c.slack_onset) for c in others if c.slack_onset is not None])]


def _onset_of(r: Response, apart: Sequence[float]) -> Number:
    assert r.slack_onset is not None
    bar = SAFETY * max(apart) + float(np.diff(r.s_o).max()) / r.length if apart else None
    at = r.slack_onset * r.length
    where = None if r.slack_at is None else r.slack_at * r.length
    return Number("slack_onset", r.slack_onset, bar, "s_o/l", float(np.interp(at, r.s_o, r.t)), at, where)
