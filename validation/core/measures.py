"""Measures that compare two responses or check one; `window` is a pair of s_o/l."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import scheme
from cablefem.response import Array, Fields, MassPath, Response
from validation.core.methods import METHODS

WINDOW = (0.02, 0.80)  # s_o/l past the start-up, before the layer at the far support
SLACK_END = 0.95  # s_o/l: end for slack cables and hauled cars
WINDOWS = {"grip": WINDOW, "haul": (WINDOW[0], SLACK_END), "free": (0.0, 1.0)}
# |s - s_o|/l left out of tension gaps, where meshes smear the jump; no round number, which stations lie on
JUMP_WIDTH = 0.019999

Window = tuple[float, float]


class NotComparable(ValueError):
    """The responses share no range for the measure."""


def common_window(*responses: MassPath, window: Window | None = None) -> Window:
    """The window, cut where a run goes slack or ends; a free ride may turn back at its end.

    window : of the drive by default.  Raises NotComparable where nothing remains.
    """
    low, high = window or WINDOWS[responses[0].drive]
    ends = [r.slack_from if r.drive == "free" else min(r.slack_from, r.reached) for r in responses]
    end = min(ends)
    cut = min(high, end)
    if cut > low:
        return low, cut
    if not high > low:
        raise NotComparable(f"nothing to compare: from s_o/l = {high:.4f} on waves are slower than the mass")
    first = responses[ends.index(end)]
    what = "is slack" if first.slack_from <= end else "ends"
    raise NotComparable(f"nothing to compare: {first.method} {what} at s_o/l = {end:.4f}, before {low:g}")


def onset_of_steep_waves(r: MassPath) -> float:
    """s_o/l from which waves are slower than the mass and steepen: no bar holds there.  Infinite: nowhere."""
    if not isinstance(r, Response) or (r.method in METHODS and not METHODS[r.method].resolves_waves):
        return math.inf  # without a look at flags, which observes the run
    return min((float(flag.numbers["since"]) for flag in r.flags if flag.kind == "slow waves"), default=math.inf)


def valid_until(*runs: Response) -> float:
    """Time [s] up to which all runs have an answer: their first end, slack onset, or waves slower than the mass."""
    ends = [r.t[-1] for r in runs] + [r.slack_since for r in runs]
    for r in runs:
        if onset_of_steep_waves(r) < r.reached:  # of gripped cars alone, which never turn back
            ends.append(np.interp(onset_of_steep_waves(r) * r.length, r.s_o, r.t))
    return float(min(ends))


def extremes_within(r: Response, other: Response | None) -> tuple[float, float]:
    """Times [s] between which extremes are taken: in the window, as far as both runs go.

    A rolling car begins in equilibrium, so that its start counts.
    """
    end = valid_until(r, other or r)
    if r.drive == "free":
        return float(r.t[0]), end
    limits = r.length * np.array(WINDOWS[r.drive])
    low, high = np.interp(limits, r.s_o, r.t).tolist()
    begin = low if r.drive == "grip" else float(r.t[0])
    return begin, min(end, high)


def steps_in_window(r: MassPath, window: Window) -> NDArray[np.bool_]:
    """Which steps (n,) lie in the window."""
    position = r.s_o / r.length
    return (position >= window[0]) & (position <= window[1] * (1.0 + 1e-12))


def _values_at_steps_of(a: MassPath, b: MassPath, values: Array) -> Array:
    """`values` (n_b, ...) at steps of b, splined to times of a."""
    t = np.clip(a.t, b.t[0], b.t[-1])
    rounding = 1e-12 * b.t[-1]
    steps = np.searchsorted(b.t, t - rounding)
    if np.abs(b.t[steps] - t).max(initial=0.0) <= rounding:
        return values[steps]
    from scipy.interpolate import CubicSpline  # slow to load

    return CubicSpline(b.t, values, axis=0)(t)


def path_distances(a: MassPath, b: MassPath, window: Window) -> tuple[Array, Array, Array]:
    """Times [s], s_o/l, and distance of the paths over b's `path_scale`, (n,) each, at the coarser run's steps.

    Displacements are compared; of a free ride the points x, y.  Raises NotComparable where there are few steps.
    """
    if not b.path_scale > 0.0:
        raise NotComparable("the mass is nowhere below its place at rest: no deflection to relate a gap to")
    coarse, fine = _coarser_first(a, b)
    within = steps_in_window(coarse, window) & (coarse.t <= fine.t[-1] * (1.0 + 1e-12))
    steps = np.count_nonzero(within)
    if steps < 5:
        raise NotComparable(f"{coarse.method} has {steps} steps in the window {window}, 5 are needed")
    u, v = ("x", "y") if coarse.drive == "free" else ("u", "v")
    first, second = (np.stack([getattr(r, u), getattr(r, v)], axis=1) for r in (coarse, fine))  # (n, 2)
    gap = (first - _values_at_steps_of(coarse, fine, second))[within] / b.path_scale
    return coarse.t[within], coarse.s_o[within] / coarse.length, np.hypot(gap[:, 0], gap[:, 1])


def _coarser_first(a: Any, b: Any) -> tuple[Any, Any]:
    """The run with fewer steps, then the other."""
    return (a, b) if a.t.size <= b.t.size else (b, a)


def path_gap(a: MassPath, b: MassPath, window: Window) -> tuple[float, float, float]:
    """The largest of `path_distances`, its rms over time, and the s_o/l of the largest."""
    t, position, distance = path_distances(a, b, window)
    rms = float(np.sqrt(_time_mean(t, distance**2)))
    return float(distance.max()), rms, float(position[distance.argmax()])


def _time_mean(t: Array, values: Array) -> Array:
    """The mean over time of values (n,)."""
    weights = np.gradient(t) if t.size > 1 else None
    return np.asarray(np.average(values, weights=weights))


def common_frames(a: Response, b: Response, window: Window) -> tuple[Array, NDArray[np.intp], NDArray[np.intp]]:
    """s_o/l of the common frames in the window, and their indices in a and b, (k,) each.

    Raises NotComparable where there is none.
    """
    stations = a.fields.s
    if stations.shape != b.fields.s.shape or np.abs(stations - b.fields.s).max() > 1e-9 * a.length:
        raise NotComparable("the tension fields are given at different stations")
    marks = [np.round(r.fields.s_o / r.length, 9) for r in (a, b)]
    stops = any(np.unique(x).size < x.size for x in marks)  # then frames are common at the same instants
    if a.drive == "free" or stops:
        marks = [np.round(r.fields.t / max(a.t[-1], b.t[-1]), 9) for r in (a, b)]
    _, i, j = np.intersect1d(marks[0], marks[1], return_indices=True)
    position = np.round(a.fields.s_o[i] / a.length, 9)
    within = (position >= window[0]) & (position <= window[1])
    if not within.any():
        raise NotComparable(f"no common frame of the fields in the window {window}")
    return position[within], i[within], j[within]


def tension_gap(a: Response, b: Response, window: Window, of: str = "T") -> float:
    """Rms gap of the tension fields `of` over frames in the window, off the mass, over H."""
    position, i, j = common_frames(a, b, window)
    off_mass = np.abs(a.fields.s / a.length - position[:, None]) >= JUMP_WIDTH  # (frames, stations)
    gap = (getattr(a.fields, of)[i] - getattr(b.fields, of)[j])[off_mass]
    return float(np.sqrt(np.mean(gap**2))) / b.horizontal_tension


def series_gap(
    a: Response, b: Response, window: Window, of: Callable[[Response], Array], averaging_time: float = 0.0,
    largest: bool = False,
) -> float:  # fmt: skip
    """Rms (or largest) distance of series of(r), (n,) or (n, c), at the coarser run's steps.

    axial : averaging time [s].  Raises NotComparable where a run has too few values.
    """
    coarse, fine = _coarser_first(a, b)
    within = steps_in_window(coarse, window)
    if not within.any():
        raise NotComparable(f"{coarse.method} has no step in the window {window}")
    t = coarse.t[within & (coarse.t <= fine.t[-1])]
    series = [_finite_values(r, of) for r in (coarse, fine)]
    first, last = _common_span(t, *(times for times, _ in series))
    t = t[(t >= first) & (t <= last)]
    low = np.clip(t - 0.5 * averaging_time, first, last)
    high = np.clip(t + 0.5 * averaging_time, first, last)
    samples = []
    for r, (times, values) in zip((coarse, fine), series, strict=True):
        end = np.searchsorted(times, last) + 1
        if averaging_time:
            samples.append(means_between(times[:end], values[:end], low, high, r.breaks))
        else:
            samples.append(_piecewise_spline(times[:end], values[:end], [event["t"] for event in r.events], low))
    squares = np.sum((samples[0] - samples[1]) ** 2, axis=1)  # of (n, c)
    return float(np.sqrt(squares.max() if largest else _time_mean(t, squares)))


def _common_span(t: Array, *series: Array) -> tuple[float, float]:
    """First and last time that all answers have, none past the last of t; series : their times."""
    if min(times.size for times in series) < 4:
        raise NotComparable("one of the answers does not say it")
    first = float(max(times[0] for times in series))
    last = float(min(t[-1], *(times[-1] for times in series)))
    if not last > first:
        raise NotComparable("both answers say it at one instant")
    return first, last


def _finite_values(r: Response, of: Callable[[Response], Array]) -> tuple[Array, Array]:
    """Times (k,) and values (k, c) of a series where it is finite."""
    values = of(r).reshape(r.t.size, -1)
    finite = np.isfinite(values).all(axis=1)
    return r.t[finite], values[finite]


def means_between(t: Array, values: Array, low: Array, high: Array, breaks: Sequence[float] = ()) -> Array:
    """Means (k, c) of values (n, c), linear in time, between times low and high (k,).

    A break's value is that before the jump; the step after it extrapolates backwards.
    """
    from scipy.interpolate import PPoly

    dt = np.diff(t)[:, None]  # (n - 1, 1)
    begin = values[:-1].copy()
    for i in np.searchsorted(t, np.array(breaks) * (1.0 - 1e-12)).tolist():
        if 0 < i < t.size - 2:
            begin[i] = values[i + 1] - (values[i + 2] - values[i + 1]) * (dt[i] / dt[i + 1])
    slope = (values[1:] - begin) / dt
    area = PPoly(np.stack([slope, begin]), t).antiderivative()
    return (area(high) - area(low)) / (high - low)[:, None]


def _piecewise_spline(t: Array, values: Array, kinks: Sequence[float], at: Array) -> Array:
    """Splines through values (n, c), restarted at kinks against overshoot; at times of t these values."""
    steps = np.searchsorted(t, at).clip(max=t.size - 1)
    if np.array_equal(t[steps], at):
        return values[steps]
    from scipy.interpolate import CubicSpline

    out = np.empty((at.size, values.shape[1]))
    ends = np.unique([0, *np.searchsorted(t, kinks).clip(0, t.size - 1), t.size - 1])
    for a, b in pairwise(ends.tolist()):
        piece = (at >= t[a]) & (at <= t[b])
        out[piece] = CubicSpline(t[a : b + 1], values[a : b + 1], axis=0)(at[piece])
    return out


def field_gap(a: Response, b: Response, window: Window, *, rate: bool = False, along: bool = False) -> float:
    """Rms distance of displacements, or velocities, across (or along) the static cable, over the rms of b.

    Without the station at the mass: rounding decides which of its sides is sampled.
    """

    def component(f: Fields) -> Array:
        """Component at all frames and stations, (k, m)."""
        dx = np.gradient(f.x, f.s)
        dy = np.gradient(f.y, f.s)
        x, y = (f.du, f.dv) if rate else (f.u, f.v)
        moved = dx * x + dy * y if along else dx * y - dy * x
        return moved / np.hypot(dx, dy)

    position, i, j = common_frames(a, b, window)
    off_mass = np.abs(a.fields.s / a.length - position[:, None]) > 1e-6
    first = component(a.fields)[i][off_mass]
    second = component(b.fields)[j][off_mass]
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
    defect = energy_defect(r)[steps_in_window(r, window)]
    gain = np.maximum.accumulate(defect[::-1])[::-1] - defect
    return float(gain.max() / (weight * r.max_deflection))
