"""Measures that compare two responses or check one; `window` is a pair of s_o/l."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import scheme
from cablefem.response import Array, Fields, MassPath, Response
from validation.core.methods import METHODS
from validation.core.scene_data import ROUNDING

WINDOW = (0.02, 0.80)  # s_o/l past the start-up, before the layer at the far support
SLACK_END = 0.95  # s_o/l: end for slack cables and hauled cars
WINDOWS = {"grip": WINDOW, "haul": (WINDOW[0], SLACK_END), "free": (0.0, 1.0)}
# |s - s_o|/l left out of tension gaps, where meshes smear the jump; no round number, which stations lie on
JUMP_WIDTH = 0.019999

Window = tuple[float, float]
Series = Callable[[Response], Array]  # (n,) or (n, c) of a run's steps


class RelativePathGap(NamedTuple):
    """At steps (n,): time [s], s_o/l, and the distance of two paths over the scale of the second."""

    t: Array
    positions: Array
    distances: Array

    @property
    def largest(self) -> float:
        return float(self.distances.max())

    @property
    def rms(self) -> float:
        """Over time."""
        return float(np.sqrt(_time_mean(self.t, self.distances**2)))

    @property
    def position_of_largest(self) -> float:
        """s_o/l."""
        return float(self.positions[self.distances.argmax()])


class CommonFrames(NamedTuple):
    """s_o/l of frames that two runs share, and their indices in both, (k,) each."""

    position: Array
    in_a: NDArray[np.intp]
    in_b: NDArray[np.intp]


class NotComparable(ValueError):
    """The responses share no range for the measure."""


def common_window(*responses: MassPath, window: Window | None = None) -> Window:
    """The window, cut where a run goes slack or ends; a free ride may turn back at its end.

    window : of the drive by default.  Raises NotComparable where nothing remains.
    """
    low, high = window or WINDOWS[responses[0].drive]
    ends = [
        r.slack_onset_position_or_inf if r.drive == "free" else min(r.slack_onset_position_or_inf, r.reached)
        for r in responses
    ]
    end = min(ends)
    cut = min(high, end)
    two_frames = 0.01  # of the fields, which laws of mechanics need, in s_o/l
    begin = low + two_frames
    if cut >= begin:
        return low, cut
    if high < end * (1.0 - ROUNDING):
        raise NotComparable(f"nothing to compare: from s_o/l = {high:.4f} on waves are slower than the mass")
    first = responses[ends.index(end)]
    what = "is slack" if first.slack_onset_position_or_inf <= end else "ends"
    raise NotComparable(f"nothing to compare: {first.method} {what} at s_o/l = {end:.4f}, before {begin:g}")


def relative_position_where_mass_outruns_waves(r: MassPath) -> float:
    """s_o/l from which waves are slower than the mass and steepen: no bar holds there.  Infinite: nowhere."""
    if not isinstance(r, Response):
        return math.inf
    if r.method in METHODS and not METHODS[r.method].tells_waves_from_ripples:
        return math.inf  # without a look at flags, which observes the run
    onsets = [float(flag.numbers["since"]) for flag in r.flags if flag.kind == "slow waves"]
    return min(onsets, default=math.inf)


def broke_in_compared_part(r: Response) -> bool:
    """Whether a run broke before slack and the end of the comparison."""
    if r.status == "complete" or (r.slack_onset is not None and r.cause != "unstable"):
        return False
    return r.drive == "free" or r.reached < WINDOWS[r.drive][1]


def last_time_valid_in_all(*runs: Response) -> float:
    """Time [s] up to which all runs have an answer: their first end, slack onset, or waves slower than the mass."""
    ends = [r.t[-1] for r in runs] + [r.slack_time_or_inf for r in runs]
    for r in runs:
        onset = relative_position_where_mass_outruns_waves(r)
        if onset < r.reached:  # of gripped cars alone, which never turn back
            ends.append(np.interp(onset * r.length, r.s_o, r.t))
    return float(min(ends))


def time_span_for_extremes(r: Response, other: Response | None) -> tuple[float, float]:
    """Times [s] between which extremes are taken: in the window, as far as both runs go.

    A rolling car begins in equilibrium, so that its start counts.
    """
    end = last_time_valid_in_all(r, other or r)
    if r.drive == "free":
        return float(r.t[0]), end
    limits = r.length * np.array(WINDOWS[r.drive])
    low, high = np.interp(limits, r.s_o, r.t).tolist()
    begin = low if r.drive == "grip" else float(r.t[0])
    return begin, min(end, high)


def relative_slack_onset_before_far_support(r: MassPath) -> float:
    """s_o/l from which the cable is slack, of a prescribed travel before `SLACK_END`; infinite: nowhere.

    Next to the far support no run converges, and one that grows there beyond all bounds looks slack.
    """
    onset = r.slack_onset_position_or_inf
    return math.inf if r.drive != "free" and onset > SLACK_END else onset


def steps_in_window(r: MassPath, window: Window) -> NDArray[np.bool_]:
    """Whether each step (n,) lies in the window."""
    position = r.s_o / r.length
    return (position >= window[0]) & (position <= window[1] * (1.0 + 1e-12))


def relative_path_gap(a: MassPath, b: MassPath, window: Window) -> RelativePathGap:
    """Distances of the paths over b's `path_scale`, at the steps in the window of the run with fewer.

    Displacements are compared; of a free ride the points x, y.  Raises NotComparable where there are few steps.
    """
    if not b.path_scale > 0.0:
        raise NotComparable("the mass is nowhere below its place at rest: no deflection to relate a gap to")
    coarse, fine = sorted((a, b), key=lambda r: r.t.size)
    within = steps_in_window(coarse, window) & (coarse.t <= fine.t[-1] * (1.0 + 1e-12))
    steps = np.count_nonzero(within)
    if steps < 5:
        raise NotComparable(f"{coarse.method} has {steps} steps in the window {window}, 5 are needed")
    components = ("x", "y") if coarse.drive == "free" else ("u", "v")
    first, second = (np.stack([getattr(r, name) for name in components], axis=1) for r in (coarse, fine))  # (n, 2)
    gap = first - _piecewise_spline(fine.t, second, (), np.clip(coarse.t, fine.t[0], fine.t[-1]))
    dx, dy = gap[within].T / b.path_scale
    position = coarse.s_o[within] / coarse.length
    return RelativePathGap(coarse.t[within], position, np.hypot(dx, dy))


def _time_mean(t: Array, values: Array) -> float:
    """The mean over time of values (n,)."""
    weights = np.gradient(t) if t.size > 1 else None
    return float(np.average(values, weights=weights))


def common_frames(a: Response, b: Response, window: Window) -> CommonFrames:
    """The frames of the fields in the window that both runs have.  Raises NotComparable where there is none."""
    stations = a.fields.s
    others = b.fields.s
    same = stations.shape == others.shape and np.abs(stations - others).max() <= 1e-9 * a.length
    if not same:
        raise NotComparable("the tension fields are given at different stations")
    marks = [np.round(r.fields.s_o / r.length, 9) for r in (a, b)]
    stops = any(np.unique(x).size < x.size for x in marks)  # then frames are common at the same instants
    if a.drive == "free" or stops:
        last = max(a.t[-1], b.t[-1])
        marks = [np.round(r.fields.t / last, 9) for r in (a, b)]
    _, i, j = np.intersect1d(marks[0], marks[1], return_indices=True)
    position = np.round(a.fields.s_o[i] / a.length, 9)
    low, high = np.round(window, 9)  # a frame at the end of the window is in it
    within = (position >= low) & (position <= high)
    if not within.any():
        raise NotComparable(f"no common frame of the fields in the window {window}")
    return CommonFrames(position[within], i[within], j[within])


def rms_tension_gap_over_H(a: Response, b: Response, window: Window, field: str = "T") -> float:
    """Rms gap of two tension fields over frames in the window, off the mass, over H;  field : a name of `Fields`."""
    frames = common_frames(a, b, window)
    off_mass = np.abs(a.fields.s / a.length - frames.position[:, None]) >= JUMP_WIDTH  # (frames, stations)
    first = getattr(a.fields, field)[frames.in_a]
    second = getattr(b.fields, field)[frames.in_b]
    gap = (first - second)[off_mass]
    return float(np.sqrt(np.mean(gap**2))) / b.horizontal_tension


def series_gap(
    a: Response, b: Response, window: Window, series: Series, averaging_time: float = 0.0, largest: bool = False
) -> float:  # fmt: skip
    """Rms (or largest) distance of a series of two runs, in its unit, at the steps of the run with fewer.

    averaging_time : [s] of the means that are compared.  Raises NotComparable where a run has too few values.
    """
    coarse, fine = sorted((a, b), key=lambda r: r.t.size)
    within = steps_in_window(coarse, window)
    if not within.any():
        raise NotComparable(f"{coarse.method} has no step in the window {window}")
    t = coarse.t[within & (coarse.t <= fine.t[-1])]
    known = [_finite_times_and_values(r, series) for r in (coarse, fine)]
    first, last = _common_time_span(t, *(times for times, _ in known))
    t = t[(t >= first) & (t <= last)]
    low = np.clip(t - 0.5 * averaging_time, first, last)
    high = np.clip(t + 0.5 * averaging_time, first, last)
    samples = []
    for r, (times, values) in zip((coarse, fine), known, strict=True):
        end = np.searchsorted(times, last) + 1
        times = times[:end]
        values = values[:end]
        if averaging_time:
            sample = time_means_between(times, values, low, high, r.breaks)
        else:
            kinks = [event["t"] for event in r.events]
            sample = _piecewise_spline(times, values, kinks, low)
        samples.append(sample)
    squares = np.sum((samples[0] - samples[1]) ** 2, axis=1)  # of (n, c)
    return float(np.sqrt(squares.max() if largest else _time_mean(t, squares)))


def _common_time_span(t: Array, *known_times: Array) -> tuple[float, float]:
    """First and last time that all series have, none past the last of t.  Raises NotComparable where there is none."""
    if min(times.size for times in known_times) < 4:
        raise NotComparable("one of the answers does not say it")
    first = float(max(times[0] for times in known_times))
    last = float(min(t[-1], *(times[-1] for times in known_times)))
    if not last > first:
        raise NotComparable("both answers say it at one instant")
    return first, last


def _finite_times_and_values(r: Response, series: Series) -> tuple[Array, Array]:
    """Times (k,) and values (k, c) of a series where it is finite."""
    values = series(r).reshape(r.t.size, -1)
    finite = np.isfinite(values).all(axis=1)
    return r.t[finite], values[finite]


def time_means_between(t: Array, values: Array, low: Array, high: Array, breaks: Sequence[float] = ()) -> Array:
    """Means (k, c) of values (n, c), linear in time, between times low and high (k,).

    A break's value is that before the jump; the step after it extrapolates backwards.
    """
    from scipy.interpolate import PPoly

    dt = np.diff(t)[:, None]  # (n - 1, 1)
    begin = values[:-1].copy()
    for i in np.searchsorted(t, np.array(breaks) * (1.0 - 1e-12)).tolist():
        if 0 < i < t.size - 2:
            change_after = values[i + 2] - values[i + 1]
            begin[i] = values[i + 1] - change_after * (dt[i] / dt[i + 1])
    slope = (values[1:] - begin) / dt
    area = PPoly(np.stack([slope, begin]), t).antiderivative()
    durations = (high - low)[:, None]
    return (area(high) - area(low)) / durations


def _piecewise_spline(t: Array, values: Array, kinks: Sequence[float], times: Array) -> Array:
    """Values (k, c) at times by splines through (n, c), restarted at kinks against overshoot; at times of t exact."""
    rounding = 1e-12 * t[-1]
    steps = np.searchsorted(t, times - rounding).clip(max=t.size - 1)
    if np.abs(t[steps] - times).max(initial=0.0) <= rounding:
        return values[steps]
    from scipy.interpolate import CubicSpline  # slow to load

    out = np.empty((times.size, values.shape[1]))
    last = t.size - 1
    inner = np.searchsorted(t, kinks).clip(0, last)
    ends = np.unique([0, *inner, last])
    for a, b in pairwise(ends.tolist()):
        piece = (times >= t[a]) & (times <= t[b])
        spline = CubicSpline(t[a : b + 1], values[a : b + 1], axis=0)
        out[piece] = spline(times[piece])
    return out


def relative_displacement_gap(
    a: Response, b: Response, window: Window, *, velocity: bool = False, along_cable: bool = False
) -> float:
    """Rms distance of displacements, or velocities, across (or along) the static cable, over the rms of b.

    Without the station at the mass: rounding decides which of its sides is sampled.
    """

    def component(f: Fields) -> Array:
        """Component at all frames and stations, (k, m)."""
        dx = np.gradient(f.x, f.s)
        dy = np.gradient(f.y, f.s)
        x, y = (f.du, f.dv) if velocity else (f.u, f.v)
        scaled = dx * x + dy * y if along_cable else dx * y - dy * x
        return scaled / np.hypot(dx, dy)

    frames = common_frames(a, b, window)
    off_mass = np.abs(a.fields.s / a.length - frames.position[:, None]) > 1e-6
    first = component(a.fields)[frames.in_a][off_mass]
    second = component(b.fields)[frames.in_b][off_mass]
    return float(np.sqrt(np.mean((first - second) ** 2) / np.mean(second**2)))


def energy_defect_in_joules(r: Response) -> Array:
    """(n,) [J]: E(t) - E(0) minus the work of the drive; entry with speed is a jump of force."""
    from validation.core.evidence import cumulative_integral  # slow to load

    power = r.power[:, None].copy()
    enters_with_speed = r.drive == "grip" and r.speed[0] > 0.0
    if enters_with_speed and scheme(r.settings["scheme"]).nodes:
        power[:1] = power[1:2]
    work = cumulative_integral(r.t, power, r.force_jump_times)[:, 0]
    return r.energy - r.energy[0] - work


def max_relative_energy_gain(r: Response, weight: float, window: Window) -> float:
    """Largest energy gained without work between two times in the window, over weight times largest deflection."""
    defect = energy_defect_in_joules(r)[steps_in_window(r, window)]
    largest_later = np.maximum.accumulate(defect[::-1])[::-1]
    gain = largest_later - defect
    return float(gain.max() / (weight * r.max_deflection))
