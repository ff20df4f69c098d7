"""A line in motion by one method, its numbers, and the comparison of two methods.

Forces are means over an axial round trip of the rope, on a car that grips means of such means.  Series are compared at
instants that all runs step on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from cablefem.motion import CarMotion, ContactMotion, LineMotion
from cablefem.newmark import Work
from cablefem.response import Array
from cablefem.scene.bodies import Wheels
from cablefem.scene.line import Line, LineRope
from validation.core.agreement import Agreement, Bound, BoundPart, no_bound
from validation.core.clearances import heights_along_path, min_rope_heights, obstacle_and_ground_profiles
from validation.core.ladder import Ladder, max_distance, row_with_error_bars
from validation.core.motion_laws import (
    energy_defect_over_all_work,
    every_nth_step,
    pieces_between_jumps,
    rope_chain,
    tension_behind_or_ahead,
)
from validation.core.order import FIRST
from validation.core.wheels import neglected_wheel_load, rope_stresses_under_wheel

ANGLES = ("swing", "pitch")
FIELDS = 0.05  # smallest tolerance of fields along the rope, and of laws

Series = Callable[[Any], Array]
LineLadder = Ladder["LineRun"]


@dataclass(frozen=True, kw_only=True)
class LineRun:
    """What one method makes of a line."""

    method: str
    settings: dict[str, int]
    motion: LineMotion
    events: tuple[tuple[str, float], ...]  # name and time [s]
    reason: str | None  # why it broke, or None
    period: float  # [s] axial round trip of the rope
    instants: Array  # [s] common to all runs
    n_dof: int
    work: Work  # of its steps
    seconds: float  # [s] of processor time that these took

    @property
    def end_time(self) -> float:
        """Its last time [s]."""
        return float(self.motion.t[-1])

    @property
    def comparable_until(self) -> float:
        """[s] Its end, or where a car meets a contact or a car when a hundredth of their span was last between them.

        Waves between them get ever shorter: no resolution keeps what goes into them.
        """
        met = re.fullmatch("(.+) (?:reaches|meets) (.+)", self.events[-1][0]) if self.events else None
        if met is None:
            return self.end_time
        a, b = (find_body(self, name).s for name in met.groups())
        contacts = np.array([contact.s[-1] for contact in self.motion.contacts])
        low, high = sorted([a[-1], b[-1]])
        span = contacts[contacts >= high].min() - contacts[contacts <= low].max()
        apart = np.flatnonzero(np.abs(a - b) >= 0.01 * span)
        return float(self.motion.t[apart[-1]]) if apart.size else self.end_time

    @cached_property
    def with_every_second_station(self) -> LineRun:
        """The run with every second station of the rope, both ends among them."""
        motion = self.motion
        points = motion.points[:, ::2]
        tension = motion.tension[:, ::2]
        return replace(self, motion=replace(motion, s=motion.s[::2], points=points, tension=tension))

    def at_common_instants(self, values: Array, end_time: float) -> Array:
        """Values (n, ...) at the common instants up to `end_time`; at a jump those before it."""
        rows = np.searchsorted(self.motion.t, self.common_instants_until(end_time) - 1e-9 * self.instants[-1])
        return values[np.minimum(rows, self.motion.t.size - 1)]

    def common_instants_until(self, end_time: float) -> Array:
        """The common instants up to `end_time` [s]."""
        return self.instants[self.instants <= end_time * (1.0 + 1e-12)]

    def mean_over_axial_round_trip(self, values: Array, passes: int = 1) -> Array:
        """Means (n, ...) of values (n, ...) over an axial round trip around each step; two passes: means of means."""
        for _ in range(passes):
            values = moving_means(self.motion.t, values, self.period)
        return values


def moving_means(t: Array, values: Array, period: float) -> Array:
    """Means of values (n, ...) over the `period` around each time t (n,), inside the run.

    Between the times values follow cubic splines, one between two jumps: straight lines cut off axial waves.
    All nan where a value is.
    """
    if not np.isfinite(values).all():
        return np.full_like(values, np.nan)
    pieces = [piece for piece in pieces_between_jumps(t) if piece.size > 1]
    cubics = [CubicSpline(t[piece], values[piece]).c for piece in pieces]
    integral = PPoly(np.concatenate(cubics, axis=1), np.unique(t)).antiderivative()
    latest = max(t[-1] - period, t[0])
    low = np.clip(t - 0.5 * period, t[0], latest)
    high = np.minimum(low + period, t[-1])
    duration = (high - low).reshape(-1, *[1] * (values.ndim - 1))
    return (integral(high) - integral(low)) / duration


class Norm(NamedTuple):
    """What a gap is relative to, and the largest that is allowed."""

    scale: float
    required: float


class Scales(NamedTuple):
    """What gaps are relative to."""

    path: float  # [m] largest deflection of a car from the empty rope
    tension: float  # [N] largest at the start
    weights: dict[str, float]  # [N] by car


class LineTolerance(NamedTuple):
    """Allowed gaps of the path, and of mean forces."""

    path: float
    tension: float

    @property
    def fields(self) -> float:
        """Of fields along the rope."""
        return max(FIELDS, 10.0 * self.path)


def find_body(moved: LineRun, name: str) -> Any:
    """The car or contact of that name."""
    bodies: list[Any] = [*moved.motion.cars, *moved.motion.contacts]
    return next(body for body in bodies if body.name == name)


def series_of_body(name: str, field: str) -> Series:
    """A field (n, ...) of the car or contact of that name, of any run."""
    return lambda moved: getattr(find_body(moved, name), field)


def distances(a: Array, b: Array) -> Array:
    """Distances (n,) of series (n,) or of points (n, k)."""
    difference = np.abs(a - b)
    return difference if difference.ndim == 1 else np.linalg.norm(difference, axis=1)


def largest_tension_at_start(motion: LineMotion) -> float:
    """At the contacts [N]."""
    return max(float(tension_behind_or_ahead(contact)[0]) for contact in motion.contacts)


class LineComparison:
    """Rows that compare two ladders of runs of a line."""

    def __init__(self, a: LineLadder, b: LineLadder, scales: Scales, tolerance: LineTolerance) -> None:
        self.a = a
        self.b = b
        self.scales = scales
        self.tolerance = tolerance
        self.path = Norm(scales.path, tolerance.path)
        self.tension = Norm(scales.tension, tolerance.tension)
        self.compared_until = min(run.comparable_until for ladder in (a, b) for run in ladder.runs)

    def rows(self) -> Iterator[Agreement]:
        """All rows, or one that says that a run ends too early."""
        first = self.a.finest
        min_instants = 3
        if np.count_nonzero(first.instants <= self.compared_until) < min_instants:
            bound = no_bound(f"runs are comparable until {self.compared_until:.4g} s alone")
            yield Agreement("path_max", math.nan, bound, required=self.tolerance.path)
            return
        for car in first.motion.cars:
            yield from self._car_rows(car)
        for contact in first.motion.contacts:
            yield from self._contact_rows(contact)
        yield from self._rope_shape_and_tension_rows()
        for ladder in (self.a, self.b):
            yield law_row(ladder, "energy", "work of all powers", relative_unbalanced_work, self.compared_until)
        yield from self._event_rows()

    def _series_row(
        self, quantity: str, law: str, series: Series, norm: Norm, passes: int = 0, rms: bool = False
    ) -> Agreement:
        """Row of the largest distance, or of its rms, of a series (n,) or (n, k).

        passes : see `LineRun.mean_over_axial_round_trip`.
        """

        def values_at_instants(moved: Any) -> Array:
            means = moved.mean_over_axial_round_trip(series(moved), passes)
            return moved.at_common_instants(means, self.compared_until)

        def size(x: Any) -> float:
            x = np.atleast_1d(x)
            return float(np.sqrt(np.mean(x**2)) if rms else x.max()) / norm.scale

        def gap_size(x: Array, y: Array) -> float:
            return size(distances(x, y))

        a = self.a.finest
        gap = distances(values_at_instants(a), values_at_instants(self.b.finest))
        # of the largest change, as a path's: at single instants a phase that shifts hides the order
        parts = [ladder.error_bars_in_space_and_time(values_at_instants, gap_size) for ladder in (self.a, self.b)]
        row = row_with_error_bars(quantity, size(gap), (self.a, self.b), parts, norm.required)
        when = a.common_instants_until(self.compared_until)[int(np.argmax(gap))]
        return replace(row, law=law, where=None if rms else f"t = {when:.4g} s")

    def _car_rows(self, car: CarMotion) -> Iterator[Agreement]:
        name = car.name
        of = partial(series_of_body, name)
        weight = Norm(self.scales.weights[name], self.tolerance.tension)
        yield self._series_row("path_max", name, of("point"), self.path)
        yield self._series_row("path_rms", name, of("point"), self.path, rms=True)
        for field in ("tension_behind", "tension_ahead"):
            yield self._series_row(field, name, of(field), self.tension, passes=1)
        passes = averaging_passes(car)
        yield self._series_row("contact_force", name, of("contact_force"), weight, passes)
        for field in ("haul_force", "grip_force", "shoe_force"):
            values = getattr(car, field)
            if np.isfinite(values).any() and (field != "shoe_force" or values.any()):
                yield self._series_row(field, name, of(field), weight, passes)
        for column, values in turning_and_wheel_load_series(car).items():

            def of_column(moved: Any, column: str = column) -> Array:
                return turning_and_wheel_load_series(find_body(moved, name))[column]

            if column in ANGLES:
                swept = Norm(float(np.ptp(values)) or 1.0, self.tolerance.tension)
                yield self._series_row(column, name, of_column, swept)
            else:
                yield self._series_row(column, name, of_column, weight, passes=1)

    def _contact_rows(self, contact: ContactMotion) -> Iterator[Agreement]:
        name = contact.name
        of = partial(series_of_body, name)

        def tension(moved: Any) -> Array:
            return tension_behind_or_ahead(find_body(moved, name))

        yield self._series_row("tension", name, tension, self.tension, passes=1)
        yield self._series_row("pressure", name, of("pressure"), self.tension, passes=1)
        if contact.kind in ("saddle", "counterweight"):
            yield self._series_row("flow", name, of("s"), self.path)
        if contact.kind == "counterweight":
            yield self._series_row("rise", name, of("rise"), self.path)
        if contact.kind == "spring":
            yield self._series_row("shift", name, of("point"), self.path)

    def _rope_shape_and_tension_rows(self) -> Iterator[Agreement]:
        """Depth and place of the rope, and its tension, as rms over all stations and instants."""
        runs = [*self.a.runs, *self.b.runs]
        # a station beyond the rope in any run does not count
        on_rope = np.all([np.isfinite(run.motion.tension).all(axis=0) for run in runs], axis=0)

        def points(moved: Any) -> Array:
            return moved.motion.points[:, on_rope].reshape(moved.motion.t.size, -1)

        def tension(moved: Any) -> Array:
            return moved.motion.tension[:, on_rope]

        for quantity, field, scale in (
            ("rope", points, self.scales.path),
            ("rope_tension", tension, self.scales.tension),
        ):
            size = field(runs[0]).shape[1]  # numbers at an instant: their distance is a root of the sum of squares
            norm = Norm(scale * math.sqrt(size), self.tolerance.fields)
            yield self._series_row(quantity, "", field, norm, rms=True)

    def _event_rows(self) -> Iterator[Agreement]:
        """A row of the names and times of the events, if any run has one."""
        ladders = (self.a, self.b)
        if not any(run.events for ladder in ladders for run in ladder.runs):
            return
        a = self.a.finest
        b = self.b.finest
        parts = [ladder.yes_no_error_bars_in_space_and_time(event_names) for ladder in ladders]
        gap = 1.0
        if event_names(a) == event_names(b):
            gap = max_distance(event_times(a), event_times(b)) / self.compared_until
            if a.events and not np.any(parts):
                # a car comes loose where waves of its friction are, whose fronts converge to first order
                parts = [
                    ladder.error_bars_in_space_and_time(lambda run: event_times(run) / self.compared_until, order=FIRST)
                    for ladder in ladders
                ]
        yield row_with_error_bars("events", gap, ladders, parts, self.tolerance.path)


def event_names(moved: LineRun) -> tuple[str, ...]:
    return tuple(name for name, _ in moved.events)


def event_times(moved: LineRun) -> Array:
    return np.array([t for _, t in moved.events])


def relative_unbalanced_work(moved: LineRun, every: int = 1) -> Array:
    """Energy less work since the start (n,), see `energy_defect_over_all_work`;  every : n to take every n-th step."""
    motion = moved.motion
    steps = every_nth_step(motion.t, every)
    powers = [power[steps] for power in motion.powers.values()]
    return energy_defect_over_all_work(motion.t[steps], motion.energy[steps], motion.kinetic[steps], powers)


def law_row(ladder: LineLadder, quantity: str, law: str, defect: Callable[..., Array], end_time: float) -> Agreement:
    """A defect (k,) that is exactly zero; its bar is that of the ladder and those of its sampling, of first order.

    defect : of a run, and of every n-th step of it for n = 2;  end_time : [s] of what counts of a defect over time.
    """
    t = ladder.finest.motion.t
    of_all = defect(ladder.finest)
    of_stations = defect(ladder.finest.with_every_second_station)
    of_steps = defect(ladder.finest, 2)
    all_at_steps = of_all
    over_time = of_all.size == t.size  # else over windows or bodies
    if over_time:
        steps = every_nth_step(t, 2)
        all_at_steps, of_steps = (values[t[steps] <= end_time] for values in (of_all[steps], of_steps))
        of_all, of_stations = (values[t <= end_time] for values in (of_all, of_stations))

    def comparable_defect(moved: LineRun) -> Array:
        values = defect(moved)
        return moved.at_common_instants(values, end_time) if over_time else values

    space, time = ladder.error_bars_in_space_and_time(comparable_defect)
    sampling = max_distance(all_at_steps, of_steps) + max_distance(of_all, of_stations)
    bound = Bound("law", (BoundPart("ladder", space + time), BoundPart("sampling", sampling)))
    law = f"{law}, {ladder.finest.method}"
    return Agreement(quantity, max_distance(of_all, 0.0), bound, law=law, required=FIELDS, parts=((space, time),))


Extreme = tuple[float, float]  # value and time [s]


def extremes_with_times(moved: LineRun, line: Line) -> dict[str, Extreme]:
    """Extremes and their times [s] by quantity; forces are means over an axial round trip."""
    motion = moved.motion
    out: dict[str, Extreme] = {}
    for name, values, words in (*_car_series_with_extremes(moved, line), *_contact_series_with_extremes(moved)):
        if np.isfinite(values).all():
            kind, _, of = name.partition(":")
            out |= {f"{kind}_{word}:{of}": _extreme_and_time(motion.t, values, word) for word in words}
    tensions = [tension_behind_or_ahead(contact) for contact in motion.contacts]
    for car in motion.cars:
        tensions += [car.tension_behind, car.tension_ahead]
    tensions = [moved.mean_over_axial_round_trip(T) for T in tensions]
    largest, when = _extreme_and_time(motion.t, np.max(tensions, axis=0), "max")
    out["tension_max"] = (largest, when)
    out["tension_min"] = _extreme_and_time(motion.t, np.min(tensions, axis=0), "min")
    if line.cable.breaking_load is not None:
        out["safety_factor_min"] = (line.cable.breaking_load / largest, when)
    for name, (times, heights) in clearance_series(motion, line).items():
        out[name] = _extreme_and_time(times, heights, "min")
    return out


def _extreme_and_time(t: Array, values: Array, word: str) -> Extreme:
    """The largest (word "max") or smallest of values (n,), and its time."""
    k = int(np.argmax(values) if word == "max" else np.argmin(values))
    return float(values[k]), float(t[k])


BOTH = ("max", "min")


def _car_series_with_extremes(moved: LineRun, line: Line) -> Iterator[tuple[str, Array, Sequence[str]]]:
    """Quantity, series (n,) and the extremes that count ("max", "min"), of each car."""
    wheels = {car.name: car.wheels for car in line.car}
    for car in moved.motion.cars:
        passes = averaging_passes(car)
        yield f"haul:{car.name}", moved.mean_over_axial_round_trip(car.haul_force), BOTH
        yield f"grip:{car.name}", moved.mean_over_axial_round_trip(car.grip_force, passes), BOTH
        yield f"contact:{car.name}", moved.mean_over_axial_round_trip(car.contact_force, passes), BOTH
        yield f"speed:{car.name}", np.linalg.norm(car.velocity, axis=1), ("max",)
        yield f"depth:{car.name}", car.point[:, 1], ("max",)
        for name, values in turning_and_wheel_load_series(car).items():
            kind, _, wheel = name.partition("_")
            if wheel:
                yield f"{kind}:{car.name}.{wheel}", moved.mean_over_axial_round_trip(values), BOTH
            else:
                yield f"{kind}:{car.name}", values, BOTH
        for kind, values in rope_stresses_at_car(moved, car, line.cable, wheels[car.name]).items():
            name, _, word = kind.rpartition("_")
            yield f"{name}:{car.name}", values, (word,)


def _contact_series_with_extremes(moved: LineRun) -> Iterator[tuple[str, Array, Sequence[str]]]:
    """Quantity, series (n,) and the extremes that count, of each contact."""
    for contact in moved.motion.contacts:
        load = np.linalg.norm(moved.mean_over_axial_round_trip(contact.pressure), axis=1)
        yield f"load:{contact.name}", load, ("max",)
        yield f"rise:{contact.name}", contact.rise, BOTH
        if contact.kind == "saddle":
            yield f"flow:{contact.name}", contact.s - contact.s[0], BOTH


def averaging_passes(car: CarMotion) -> int:
    """How often the mean of forces on a car is taken: twice if the car grips, else once.

    A car that grips rings with the rope in other periods than the round trip, for its mass.  Of a ring of 0.7 round
    trips a mean leaves a fifth, the mean of means a twentieth.
    """
    return 2 if np.isfinite(car.grip_force).any() else 1


def turning_and_wheel_load_series(car: CarMotion) -> dict[str, Array]:
    """Swing, or pitch [deg] and the loads of both wheels [N], by name; of a point by hand, or none."""
    turning = car.turning
    if turning is None:
        return dict(zip(("wheel_rear", "wheel_front"), car.wheel_loads or (), strict=False))
    loads = {f"wheel_{wheel.name.rpartition('.')[2]}": wheel.load for wheel in turning.wheels}
    return {"pitch" if loads else "swing": np.degrees(turning.angle)} | loads


def rope_stresses_at_car(moved: LineRun, car: CarMotion, rope: LineRope, wheels: Wheels | None) -> dict[str, Array]:
    """Design numbers (n,) of the rope at a car, of behind its rear wheels and ahead of its front ones the worse."""
    if wheels is None:
        return {}
    loads = turning_and_wheel_load_series(car)
    out: dict[str, Array] = {}
    for side, N in (("rear", car.tension_behind), ("front", car.tension_ahead)):
        load = loads.get(f"wheel_{side}", 0.5 * car.contact_force)
        Q = load * 2.0 / wheels.count
        for kind, values in rope_stresses_under_wheel(rope, wheels, N, Q).items():
            worse = np.fmin if kind.endswith("min") else np.fmax
            mean = moved.mean_over_axial_round_trip(values)
            out[kind] = worse(out[kind], mean) if kind in out else mean
    return out


def clearance_series(motion: LineMotion, line: Line) -> dict[str, tuple[Array, Array]]:
    """Times [s] and free heights [m] of rope and cars over obstacles and ground, by quantity, where they pass."""
    beneath = obstacle_and_ground_profiles(line)
    below = {car.name: car.below for car in line.car}
    rope = rope_chain(motion).points if beneath else np.empty((motion.t.size, 0, 2))
    ends = 0.0, line.contact[-1].at[0]
    clearances = {}
    for name, ground in beneath.items():
        times = [motion.t]
        heights = [min_rope_heights(rope, ground, ends)[0]]
        for car in motion.cars:
            x, y = car.point.T
            at_car = heights_along_path(motion.t, x, y, car.s, ground)
            if at_car.t.size:
                times.append(at_car.t)
                heights.append(at_car.value)
                clearances[f"clearance_car:{car.name} over {name}"] = at_car.t, at_car.value - below[car.name]
        clearances[f"clearance_rope:{name}"] = np.concatenate(times), np.concatenate(heights)
    return clearances


def error_bars_of_hand_wheel_loads(line: Line, moved: LineRun, numbers: dict[str, Extreme]) -> dict[str, float]:
    """Bars for what wheel loads by hand leave out, by design number: of loads, and of what follows from the largest.

    numbers : the design numbers of the run.
    """
    bars: dict[str, float] = {}
    for car in line.car:
        x = find_body(moved, car.name)
        if car.wheels is None or x.wheel_loads is None:
            continue
        neglected = neglected_wheel_load(car.wheels, car.mass, line.gravity, moved.motion.t, x)
        loads = [f"wheel_{word}:{car.name}.{side}" for word in ("max", "min") for side in ("rear", "front")]
        bars |= dict.fromkeys(loads, neglected)
        share = neglected / max(numbers[name][0] for name in loads)
        bending = f"stress_bending_max:{car.name}"
        ratio = f"tension_over_wheel_min:{car.name}"
        for name, of in {ratio: ratio, bending: bending, f"stress_max:{car.name}": bending}.items():
            bars[name] = share * numbers.get(of, (0.0, 0.0))[0]
    return bars


def design_with_error_bars(
    a: LineLadder, b: LineLadder | None, line: Line, unit_of: Callable[[str], str]
) -> list[dict[str, Any]]:
    """Design numbers of `a` with bars: from coarser runs, and at least the gap to `b`;  unit_of : a design number."""
    ladders = [a] if b is None else [a, b]
    known = {id(run): extremes_with_times(run, line) for ladder in ladders for run in ladder.runs}
    motion = a.finest.motion
    numbers = known[id(a.finest)]
    by_hand = error_bars_of_hand_wheel_loads(line, a.finest, numbers)
    position = {car.name: car.s for car in motion.cars}
    rows: list[dict[str, Any]] = []
    for name, (value, t) in numbers.items():

        def value_of_run(moved: LineRun, name: str = name) -> float:
            return known[id(moved)].get(name, (math.nan, 0.0))[0]

        bar = a.error_bar(value_of_run)
        if b is not None:
            bar = max(bar, abs(value - value_of_run(b.finest)))
        bar += by_hand.get(name, 0.0)
        row = {"quantity": name, "value": value, "bar": bar if math.isfinite(bar) else None, "unit": unit_of(name)}
        car = name.partition(":")[2].partition(".")[0]
        row["t"] = t
        row["s_o"] = float(np.interp(t, motion.t, position[car])) if car in position else None
        rows.append(row)
    return rows
