"""Measures that compare two responses or check one; `window` is a pair of s_o/l."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import scheme
from cablefem.response import Array, Fields, MassPath, Response

WINDOW = (0.02, 0.80)  # s_o/l past the start-up, before the layer at the far support
SLACK_END = 0.95  # s_o/l: end for slack cables and hauled cars
WINDOWS = {"grip": WINDOW, "haul": (WINDOW[0], SLACK_END), "free": (0.0, 1.0)}
JUMP_WIDTH = 0.02  # |s - s_o|/l left out of tension gaps, where meshes smear the jump

Window = tuple[float, float]


class NotComparable(ValueError):
    """The responses share no range for the measure."""


def window_of(*responses: MassPath, window: Window | None = None) -> Window:
    """The window (default: of the drive), cut where a run goes slack or ends; a free ride may turn back at its end."""
    low, high = window or WINDOWS[responses[0].drive]
    ends = [min(r.slack_from, r.reached if r.drive != "free" else math.inf) for r in responses]
    if min(high, *ends) > low:
        return low, min(high, *ends)
    first = int(np.argmin(ends))
    what = "is slack" if responses[first].slack_from <= ends[first] else "ends"
    raise NotComparable(
        f"nothing to compare: {responses[first].method} {what} at s_o/l = {min(ends):.4f}, before {low:g}"
    )


def meant_until(*runs: Response) -> float:
    """Time [s] up to which runs say something: the first end, or slack onset, of them."""
    return min(min(float(x.t[-1]), x.slack_since) for x in runs)


def extremes_within(r: Response, twin: Response | None) -> tuple[float, float]:
    """Times [s] between which extremes are taken: in the window, as far as both runs go.

    A rolling car begins in equilibrium, so that its start counts.
    """
    end = meant_until(r, twin or r)
    low, high = (float(np.interp(place * r.length, r.s_o, r.t)) for place in WINDOWS[r.drive])
    return low if r.drive == "grip" else float(r.t[0]), end if r.drive == "free" else min(end, high)


def inside(r: MassPath, window: Window) -> NDArray[np.bool_]:
    place = r.s_o / r.length
    return (place >= window[0]) & (place <= window[1] * (1.0 + 1e-12))


def at_steps_of(a: MassPath, b: MassPath, values: Array) -> Array:
    """`values` (n_b, ...) at steps of b, splined to times of a."""
    when = np.clip(a.t, b.t[0], b.t[-1])
    same = 1e-12 * b.t[-1]
    at = np.searchsorted(b.t, when - same)
    if np.abs(b.t[at] - when).max(initial=0.0) <= same:
        return values[at]
    from scipy.interpolate import CubicSpline  # slow to load

    return CubicSpline(b.t, values, axis=0)(when)


def path_distances(a: MassPath, b: MassPath, window: Window) -> tuple[Array, Array, Array]:
    """Times, s_o/l, and |w_a - w_b| (free ride: of places) over b's `path_scale`, at the coarser steps."""
    if not b.path_scale > 0.0:
        raise NotComparable("the mass is nowhere below its place at rest: no deflection to relate a gap to")
    coarse, fine = (a, b) if a.t.size <= b.t.size else (b, a)
    within = inside(coarse, window) & (coarse.t <= fine.t[-1] * (1.0 + 1e-12))
    if np.count_nonzero(within) < 5:
        raise NotComparable(
            f"{coarse.method} has {np.count_nonzero(within)} steps in the window {window}, 5 are needed"
        )
    names = ("x", "y") if coarse.drive == "free" else ("u", "v")
    c, f = (np.stack([getattr(r, name) for name in names], axis=1) for r in (coarse, fine))
    gap = (c - at_steps_of(coarse, fine, f))[within] / b.path_scale
    return coarse.t[within], coarse.s_o[within] / coarse.length, np.hypot(gap[:, 0], gap[:, 1])


def path_gap(a: MassPath, b: MassPath, window: Window) -> tuple[float, float, float]:
    """The largest of `path_distances`, its rms over time, and the s_o/l of the largest."""
    t, place, size = path_distances(a, b, window)
    return float(size.max()), float(np.sqrt(_over_time(t, size**2))), float(place[size.argmax()])


def _over_time(t: Array, values: Array) -> Array:
    return np.asarray(np.average(values, weights=np.gradient(t) if t.size > 1 else None))


def common_frames(a: Response, b: Response, window: Window) -> tuple[Array, NDArray[np.intp], NDArray[np.intp]]:
    """s_o/l of the common frames in the window, one at least, and their indices in a and b."""
    if a.fields.s.shape != b.fields.s.shape or not np.allclose(a.fields.s, b.fields.s, rtol=0.0, atol=1e-9 * a.length):
        raise NotComparable("the tension fields are given at different stations")
    stands = any(np.unique(np.round(r.fields.s_o / r.length, 9)).size < r.fields.t.size for r in (a, b))
    marks = [r.fields.s_o / r.length for r in (a, b)]
    if a.drive == "free" or stands:  # the same instants
        marks = [r.fields.t / max(a.t[-1], b.t[-1]) for r in (a, b)]
    first, second = (np.round(x, 9) for x in marks)
    _, i, j = np.intersect1d(first, second, return_indices=True)
    place = np.round(a.fields.s_o[i] / a.length, 9)
    within = (place >= window[0]) & (place <= window[1])
    if not within.any():
        raise NotComparable(f"no common frame of the fields in the window {window}")
    return place[within], i[within], j[within]


def tension_gap(a: Response, b: Response, window: Window, of: str = "T") -> float:
    """Rms gap of the tension fields `of` over frames in the window, off the mass, over H."""
    place, i, j = common_frames(a, b, window)
    away = np.abs(a.fields.s / a.length - place[:, None]) >= JUMP_WIDTH
    gap = (getattr(a.fields, of)[i] - getattr(b.fields, of)[j])[away]
    return float(np.sqrt(np.mean(gap**2))) / b.horizontal_tension


def series_gap(
    a: Response, b: Response, window: Window, of: Callable[[Response], Array], axial: float = 0.0,
    largest: bool = False,
) -> float:  # fmt: skip
    """Rms (or largest) distance of series of(r), (n,) or (n, c), at the coarser run's steps.

    axial : averaging time [s].
    """
    coarse, fine = (a, b) if a.t.size <= b.t.size else (b, a)
    within = inside(coarse, window)
    if not within.any():
        raise NotComparable(f"{coarse.method} has no step in the window {window}")
    within &= coarse.t <= fine.t[-1]
    t = coarse.t[within]
    known = [np.isfinite(of(r).reshape(r.t.size, -1)).all(axis=1) for r in (coarse, fine)]
    if not all(k.sum() > 3 for k in known):
        raise NotComparable("one of the answers does not say it")
    # the same times in all runs, none past the window
    last = min(t[-1], coarse.t[known[0]][-1], fine.t[known[1]][-1])
    first = max(coarse.t[known[0]][0], fine.t[known[1]][0])
    t = t[(t >= first) & (t <= last)]
    if not last > first:
        raise NotComparable("both answers say it at one instant")
    low = np.clip(t - 0.5 * axial, first, last)
    high = np.clip(t + 0.5 * axial, first, last)

    def at(r: Response, k: Any) -> Any:
        k = np.flatnonzero(k)[: np.searchsorted(r.t[k], last) + 1]
        when = r.t[k]
        values = of(r).reshape(r.t.size, -1)[k]
        if not axial:
            return _spline(when, values, [x["t"] for x in r.events], low)
        return averaged(when, values, low, high, r.breaks)

    gap: Array = np.sum(np.square(at(coarse, known[0]) - at(fine, known[1])), axis=1)
    return float(np.sqrt(gap.max() if largest else _over_time(t, gap)))


def averaged(t: Array, values: Array, low: Array, high: Array, breaks: Sequence[float] = ()) -> Array:
    """Means (k, c) of the lines through values (n, c) between times low and high (k,).

    A break's value is that before the jump; the step after it extrapolates backwards.
    """
    from scipy.interpolate import PPoly

    begin = values[:-1].copy()
    dt = np.diff(t)[:, None]
    for i in np.searchsorted(t, np.array(breaks) * (1.0 - 1e-12)).tolist():
        if 0 < i < t.size - 2:
            begin[i] = values[i + 1] - (values[i + 2] - values[i + 1]) * (dt[i] / dt[i + 1])
    total = PPoly(np.stack([(values[1:] - begin) / dt, begin]), t).antiderivative()
    return (total(high) - total(low)) / (high - low)[:, None]


def _spline(t: Array, values: Array, kinks: Sequence[float], at: Array) -> Array:
    """Splines through values (n, c), restarted at kinks against overshoot."""
    from scipy.interpolate import CubicSpline

    out = np.empty((at.size, values.shape[1]))
    ends = np.unique([0, *np.searchsorted(t, kinks).clip(0, t.size - 1), t.size - 1])
    for a, b in pairwise(ends.tolist()):
        piece = (at >= t[a]) & (at <= t[b])
        out[piece] = CubicSpline(t[a : b + 1], values[a : b + 1], axis=0)(at[piece])
    return out


def field_gap(a: Response, b: Response, window: Window, *, rate: bool = False, along: bool = False) -> float:
    """Rms distance of displacements, or velocities, across (or along) the static cable, over the rms of b.

    The station at the mass is left out: rounding decides which of its sides is sampled.
    """

    def of(f: Fields) -> Array:
        i = np.gradient(f.x, f.s)
        j = np.gradient(f.y, f.s)
        x, y = (f.du, f.dv) if rate else (f.u, f.v)
        return (i * x + j * y if along else i * y - j * x) / np.hypot(i, j)

    place, i, j = common_frames(a, b, window)
    off = np.abs(a.fields.s / a.length - place[:, None]) > 1e-6
    first = of(a.fields)[i][off]
    second = of(b.fields)[j][off]
    return float(np.sqrt(np.mean((first - second) ** 2) / np.mean(second**2)))


def energy_defect(r: Response) -> Array:
    """(n,) [J]: E(t) - E(0) minus the work of the drive; entry with speed is a jump of force."""
    from validation.core.evidence import integral  # slow to load

    power = r.power[:, None].copy()
    if r.drive == "grip" and r.speed[0] > 0.0 and scheme(r.settings["scheme"]).nodes:
        power[:1] = power[1:2]
    return r.energy - r.energy[0] - integral(r.t, power, r.jumps)[:, 0]


def energy_gain(r: Response, weight: float, window: Window) -> float:
    """Largest energy gained without work between two times in the window, over weight times largest deflection."""
    defect = energy_defect(r)[inside(r, window)]
    gain = np.maximum.accumulate(defect[::-1])[::-1] - defect
    return float(gain.max() / (weight * r.max_deflection))
