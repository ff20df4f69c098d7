"""The travel of a TOML in SI, as stretches of constant jerk."""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from validation.core.scene_data import ROUNDING, Array

Stretches = list[tuple[float, float, float]]  # duration [s], initial acceleration [m/s2], jerk [m/s3]


class Timetable(NamedTuple):
    """The [travel] and the [drive] of a TOML on a cable of this length [m]."""

    travel: dict[str, Any]
    drive: dict[str, Any]
    length: float

    @property
    def start_position(self) -> float:
        """Where the car begins [m]."""
        rolls = self.drive.get("mode", "grip") != "grip"
        default = 0.01 * self.length if rolls else 0.0
        return float(self.travel.get("from", self.drive.get("start", default)))

    @property
    def arrival_position(self) -> float:
        """Where a car that rolls arrives [m]."""
        return float(self.drive.get("end", {}).get("place", 0.99 * self.length))

    @property
    def farthest_position(self) -> float:
        """Where a travel ends that does not stop before [m]."""
        return self.arrival_position if self.drive.get("mode") == "haul" else self.length

    @property
    def distance(self) -> float:
        """Of the whole travel [m]."""
        return float(self.travel.get("to", self.farthest_position) - self.start_position)

    def positions_at(self, t: Array) -> Array:
        """s_o (n,) [m] at times t (n,), tables excepted."""
        start = self.start_position
        speed, stretches = _start_speed_and_stretches(self.travel, self.distance)
        if "stop" not in self.travel:
            return _position_and_speed(start, speed, stretches, t)[0]
        begin = self.travel["stop"]["time"]
        hard = self.travel["stop"]["deceleration"]
        s, v = _position_and_speed(start, speed, stretches, np.minimum(t, begin))
        x = np.clip(t - begin, 0.0, v / hard)
        return s + x * (v - 0.5 * hard * x)

    @property
    def accelerations_at_stretch_ends(self) -> Array:
        """Accelerations at both ends of each stretch (n,) [m/s2], tables excepted; a stop counts."""
        _, stretches = _start_speed_and_stretches(self.travel, self.distance)
        rates = [0.0]
        for duration, a, jerk in stretches:
            rates += [a, a + jerk * duration if jerk else a]
        if "stop" in self.travel:
            rates.append(-self.travel["stop"]["deceleration"])
        return np.array(rates)

    @property
    def top_speed(self) -> float:
        """Largest ds_o/dt [m/s] until a stop, or the end of the ride."""
        travel = self.travel
        last = travel.get("stop", {}).get("time", math.inf)
        if self.drive.get("mode") == "haul":
            last = min(last, self.drive.get("end", {}).get("time", math.inf))
        distance = self.distance
        if travel["kind"] == "table":
            return _top_speed_of_timetable(travel, distance, last)
        speed, stretches = _start_speed_and_stretches(travel, distance)
        times = np.cumsum([0.0] + [duration for duration, _, _ in stretches])
        if travel["kind"] == "constant_acceleration":  # its stretch has no end
            a = travel["acceleration"]
            times[-1] = 2.0 * distance / (speed + math.sqrt(speed**2 + 2.0 * a * distance)) if a > 0.0 else 0.0
        times = np.where(np.isfinite(times), times, times[-2])  # a cruise has its speed at its start
        _, v = _position_and_speed(0.0, speed, stretches, np.minimum(times, last))
        return float(v.max())


def _top_speed_of_timetable(travel: dict[str, Any], distance: float, last_time: float) -> float:
    """Largest speed [m/s] of the C2 curves through the rows, at rest beside a standstill."""
    t = np.array(travel["times"])
    s = np.array(travel["positions"])
    stands = np.diff(s) == 0.0
    changes = np.flatnonzero(np.diff(stands)) + 1
    top = 0.0
    for i, j in pairwise([0, *changes.tolist(), t.size - 1]):
        if stands[i]:
            continue
        rows = slice(i, j + 1)
        slopes = CubicSpline(t[rows], s[rows])(t[rows], 1)
        negligible = 1e-3  # of the top speed: a table that begins or ends slower does so at rest
        slow = slopes[[0, -1]] < negligible * slopes.max()
        at_rest = slow | [i > 0, j < t.size - 1]
        ends = tuple((1, 0.0) if rests else "not-a-knot" for rests in at_rest)
        curve = CubicSpline(t[rows], s[rows], bc_type=ends)
        extremes = curve.derivative(2).roots(extrapolate=False)
        arrival = curve.solve(distance, extrapolate=False)
        times = np.concatenate([t[rows], extremes, arrival, np.clip([last_time], t[i], t[j])])
        times = times[np.isfinite(times)]
        reached = (times <= last_time) & (curve(times) <= distance * (1.0 + ROUNDING))
        top = max(top, curve(times[reached], 1).max(initial=0.0))
    return float(top)


def _position_and_speed(start: float, speed: float, stretches: Stretches, t: Array) -> tuple[Array, Array]:
    """(n,) each at times t, from a start [m] with a speed [m/s]; at rest after the last stretch."""
    s = np.full(t.shape, start)
    v = np.full(t.shape, speed)
    begin = 0.0
    for duration, a, j in stretches:
        x = np.clip(t - begin, 0.0, duration)
        s = s + x * (v + x * (0.5 * a + x * j / 6.0))
        v = v + x * (a + 0.5 * j * x)
        begin += duration
    return s, v


def _start_speed_and_stretches(law: dict[str, Any], distance: float) -> tuple[float, Stretches]:
    """Speed [m/s] at the start, and what follows, of a [travel] over a distance [m], without its stop."""
    kind = law["kind"]
    if kind == "constant_speed":
        V = law["speed"]
        cruise = (math.inf, 0.0, 0.0)
        T = 1.5 * law.get("entry_ramp", 0.0) / V
        if not T:
            return V, [cruise]
        ramp_to_zero_acceleration = (T, 2.0 * V / T, -2.0 * V / T**2)
        return 0.0, [ramp_to_zero_acceleration, cruise]
    if kind == "constant_acceleration":
        return law.get("initial_speed", 0.0), [(math.inf, law["acceleration"], 0.0)]
    V = law["top_speed"]
    thirds = 1.5 * V * V / distance  # accelerate_cruise_brake: each takes a third of the way
    up = law.get("acceleration", thirds)
    down = law.get("deceleration", thirds)
    jerk = law.get("jerk")

    def ramp(V: float, a: float, sign: float) -> Stretches:
        """From rest to V: acceleration rises, stays, falls; sign -1 runs it backwards."""
        if jerk is None:
            return [(V / a, sign * a, 0.0)]
        peak = min(a, math.sqrt(V * jerk))
        rise = peak / jerk
        hold = V / peak - peak / jerk
        return [(rise, 0.0, sign * jerk), (hold, sign * peak, 0.0), (rise, sign * peak, -sign * jerk)]

    def distance_of_ramps(V: float) -> float:
        durations = [duration for duration, _, _ in ramp(V, up, 1.0) + ramp(V, down, 1.0)]
        return 0.5 * V * sum(durations)

    if distance_of_ramps(V) > distance:
        V = brentq(lambda V: distance_of_ramps(V) - distance, 1e-12 * V, V, xtol=1e-14 * V, rtol=1e-15)
    cruise = ((distance - distance_of_ramps(V)) / V, 0.0, 0.0)
    return 0.0, [*ramp(V, up, 1.0), cruise, *ramp(V, down, -1.0)]
