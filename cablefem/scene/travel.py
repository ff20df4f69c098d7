"""Laws of travel to the right, from the left support or `from`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from cablefem.scene.bisection import bisect_zero
from cablefem.scene.fields import (
    NonNegative,
    Numbers,
    Part,
    Positive,
    Real,
    described_field,
    not_rising_faults,
    unequal_length_faults,
)
from cablefem.scene.motion import Motion, Piece

AT_REST = 1e-3  # of the largest speed: a first or last speed below counts as rest
ROUNDING = 1e-9  # of the length or the largest speed: nearer, a travel ends on the support, or at rest
ALONG = "along the cable, in x if hauled on several spans"  # what positions and speeds of a travel are


class Stop(Part):
    """Emergency stop: constant deceleration from `time` on."""

    time: Positive = described_field("[s] at which the stop begins")
    deceleration: Positive = described_field(f"[m/s2] until the mass stands: {ALONG}")


class Law(Part):
    """Base of the laws; each runs from `begin` [m] over a distance [m]."""

    speed_exponents: ClassVar[dict[str, int]] = {}  # powers of pace in the fields

    position: Positive | None = described_field(
        f"[m] position where the mass is let in, in equilibrium: {ALONG}", None, alias="from"
    )
    stop: Stop | None = described_field("[-] emergency stop", None)
    rest: NonNegative = described_field("[s] that the run goes on after the mass has come to rest", 0.0)

    def fault_on_cable(self, distance: float, begin: float = 0.0, length: float = math.inf) -> str:
        """What is wrong with this travel on a cable of this length [m]; empty if nothing is."""
        if fault := self.fields_fault(distance):
            return fault
        law = self.motion_without_stop(distance)
        if begin == 0.0 and law.position_with_rates(0.0, 0)[1:] == (0.0, 0.0):
            jerk = getattr(self, "jerk", None)
            return f"jerk = {jerk!r}: not yet from a support; must be let in on the way by from"
        stopped = self._with_stop_braking(law)
        end = law.end_time
        if self.stop is not None and self.stop.time >= end:
            return f"stop.time = {self.stop.time!r}: must be < {end:.6g} s, the end of the travel"
        if self.stop is not None and stopped.end_position > distance * (1.0 + ROUNDING):
            at_rest = f"the mass comes to rest at {begin + stopped.end_position:.6g} m"
            must = f"must be by {begin + distance:.6g} m"
            return f"stop.deceleration = {self.stop.deceleration!r}: {at_rest}; {must}"
        return self._final_rest_fault(stopped, begin + stopped.end_position, length) if self.rest else ""

    def _final_rest_fault(self, motion: Motion, end: float, length: float) -> str:
        """Fault of a rest after a travel that ends at `end` [m] on a cable of this length [m]."""
        if abs(motion.end_speed) > ROUNDING * motion.top_speed:
            moves = f"the mass still moves with {motion.end_speed:.4g} m/s at the end of its travel"
            return f"rest = {self.rest!r}: {moves}; must stop"
        if end >= length:
            return f"rest = {self.rest!r}: the mass is on the far support then; must stop before {length:.6g} m"
        return ""

    def fields_fault(self, distance: float) -> str:
        """What is wrong with the fields of this law over a distance [m]; empty if nothing is."""
        return ""

    def motion(self, distance: float, begin: float = 0.0) -> Motion:
        """The travel with its stop and final rest, in SI."""
        motion = self._with_stop_braking(self.motion_without_stop(distance))
        if self.rest:
            motion = motion.followed_by_stop(self.rest, 0.0)
        return motion.shifted(begin) if begin else motion

    def _with_stop_braking(self, motion: Motion) -> Motion:
        if self.stop is None:
            return motion
        a = self.stop.deceleration
        begun = motion.cut_at(self.stop.time)
        _, speed, _ = begun.position_with_rates(self.stop.time, len(begun.phases) - 1)
        return begun.followed_by_stop(speed / a, -a) if speed > 0.0 else begun

    def motion_without_stop(self, distance: float) -> Motion:
        """The motion from 0 over a distance [m], in SI."""
        raise NotImplementedError

    def faster(self, factor: float) -> Law:
        """The same law run through `factor` times as fast."""
        changes: dict[str, Any] = {}
        for name, power in self.speed_exponents.items():
            if getattr(self, name):
                changes[name] = getattr(self, name) * factor**power
        if self.stop is not None:
            changes["stop"] = Stop(time=self.stop.time / factor, deceleration=self.stop.deceleration * factor**2)
        return self.model_copy(update=changes)


class ConstantSpeed(Law):
    """s_o = V t (the paper), or after an entry ramp of length L, T = 3 L/(2 V): s_o = V T (x^2 - x^3/3), x = t/T."""

    kind: Literal["constant_speed"] = described_field("[-] law of travel", "constant_speed")
    speed: Positive = described_field(f"[m/s] V: {ALONG}")
    entry_ramp: Positive | None = described_field("[m] L, over which the mass comes to its speed", None)

    def fields_fault(self, distance: float) -> str:
        if self.entry_ramp is not None and self.entry_ramp >= distance:
            return f"entry_ramp = {self.entry_ramp!r}: must be < {distance:.6g} m, the length of the ride"
        return ""

    def motion_without_stop(self, distance: float) -> Motion:
        """The motion from 0 over a distance [m], in SI."""
        V = self.speed
        L = self.entry_ramp
        if L is None:
            return _one_phase_motion(distance / V, [Piece(0.0, 0.0, 0.0, V, 0.0)], distance)
        T = 1.5 * L / V
        ramp = Piece(0.0, 0.0, 0.0, 0.0, V / T, -V / (3.0 * T * T))
        return _one_phase_motion(T + (distance - L) / V, [ramp, Piece(T, T, L, V, 0.0)], distance)

    speed_exponents: ClassVar = {"speed": 1}


class ConstantAcceleration(Law):
    """s_o = V_o t + a t^2/2 up to the far support."""

    kind: Literal["constant_acceleration"] = described_field("[-] law of travel", "constant_acceleration")
    acceleration: Real = described_field(f"[m/s2] a: {ALONG}")
    initial_speed: NonNegative = described_field(f"[m/s] V_o: {ALONG}", 0.0)

    def fields_fault(self, distance: float) -> str:
        """What is wrong with the fields of this law over a distance [m]; empty if nothing is."""
        a = self.acceleration
        v0 = self.initial_speed
        if v0 == 0.0 and a <= 0.0:
            return f"acceleration = {a!r}: must be > 0 m/s^2 with initial_speed = 0, or the mass never moves"
        smallest = -0.5 * v0 * v0 / distance
        if a < smallest * (1.0 + 1e-12):
            stops = f"the mass stops after {-0.5 * v0 * v0 / a:.6g} m of {distance:.6g} m"
            return f"acceleration = {a!r}: must be >= {smallest!r} m/s^2 with initial_speed = {v0!r}, or {stops}"
        return ""

    def motion_without_stop(self, distance: float) -> Motion:
        """The motion from 0 over a distance [m], in SI."""
        a = self.acceleration
        v0 = self.initial_speed
        v1 = math.sqrt(max(0.0, v0 * v0 + 2.0 * a * distance))
        return _one_phase_motion(2.0 * distance / (v0 + v1), [Piece(0.0, 0.0, 0.0, v0, 0.5 * a)], distance)

    speed_exponents: ClassVar = {"acceleration": 2, "initial_speed": 1}


class AccelerateCruiseBrake(Law):
    """The paper's law (40), each part over a third of the distance."""

    kind: Literal["accelerate_cruise_brake"] = described_field(
        "[-] law of travel: the paper's (40), a third of the way each; `trapezoid` takes accelerations",
        "accelerate_cruise_brake",
    )
    top_speed: Positive = described_field(f"[m/s] V_max: {ALONG}")

    def motion_without_stop(self, distance: float) -> Motion:
        """a = 3 V^2/(2 l), durations 2l/3V, l/3V, 2l/3V."""
        a = 1.5 * self.top_speed**2 / distance
        return _ramped_motion(self.top_speed, (a, a), None, distance)

    speed_exponents: ClassVar = {"top_speed": 1}


class Trapezoid(Law):
    """From rest to top speed, cruise, and to rest; with `jerk` the acceleration is continuous.

    Over a short distance the top speed is lower.
    """

    kind: Literal["trapezoid"] = described_field("[-] law of travel", "trapezoid")
    top_speed: Positive = described_field(f"[m/s] largest speed: {ALONG}")
    acceleration: Positive = described_field(f"[m/s2] at the start: {ALONG}")
    deceleration: Positive = described_field(f"[m/s2] at the end: {ALONG}")
    jerk: Positive | None = described_field(
        "[m/s3] largest change of the acceleration; without it the acceleration jumps", None
    )
    to: Positive | None = described_field(
        f"[m] position where the mass comes to rest: {ALONG}; default the end, of one span", None
    )

    def fields_fault(self, distance: float) -> str:
        return "" if distance > 0.0 else f"to = {self.to!r}: must be beyond the start of the travel"

    def motion_without_stop(self, distance: float) -> Motion:
        """The motion from 0 over a distance [m], in SI."""
        V = self.top_speed
        ramps = (self.acceleration, self.deceleration)

        def excess(V: float) -> float:
            return _ramps_distance(V, ramps, self.jerk) - distance

        if excess(V) > 0.0:
            V = bisect_zero(excess, 0.0, V)
        return _ramped_motion(V, ramps, self.jerk, distance)

    speed_exponents: ClassVar = {"top_speed": 1, "acceleration": 2, "deceleration": 2, "jerk": 3}


def _one_phase_motion(duration: float, pieces: list[Piece], end: float) -> Motion:
    return Motion(((0.0, duration),), (tuple(pieces),), end)


def _ramp_change_and_hold_times(V: float, a: float, jerk: float | None) -> tuple[float, float]:
    """Times in which the acceleration changes, and stays, from 0 to V."""
    if jerk is None:
        return 0.0, V / a
    if V == 0.0:
        return 0.0, 0.0
    peak = min(a, math.sqrt(V * jerk))
    return 2.0 * peak / jerk, max(0.0, V / peak - peak / jerk)


def _ramps_distance(V: float, ramps: tuple[float, float], jerk: float | None) -> float:
    """Distance over which both ramps run."""
    return sum(0.5 * V * sum(_ramp_change_and_hold_times(V, a, jerk)) for a in ramps)


def _ramped_motion(V: float, ramps: tuple[float, float], jerk: float | None, distance: float) -> Motion:
    """From rest to V, cruise, and to rest, by the largest accelerations of both ramps."""
    steps = []  # duration, acceleration at its start, jerk
    for sign, a in zip((1.0, -1.0), ramps, strict=True):
        rise, hold = _ramp_change_and_hold_times(V, a, jerk)
        j = sign * (jerk or 0.0)
        peak = sign * a if jerk is None else 0.5 * rise * j
        steps += [(0.5 * rise, 0.0, j), (hold, peak, 0.0), (0.5 * rise, peak, -j)]
    steps.insert(3, ((distance - _ramps_distance(V, ramps, jerk)) / V, 0.0, 0.0))
    t = 0.0
    s = 0.0
    v = 0.0
    pieces: list[Piece] = []
    for x, a, j in steps:
        if x > 0.0:
            pieces.append(Piece(t, t, s, v, 0.5 * a, j / 6.0))
            s += x * (v + x * (0.5 * a + x * j / 6.0))
            v += x * (a + 0.5 * x * j)
            t += x
    last = pieces[-1]  # from the end, where speed is exactly zero
    pieces[-1] = Piece(last.start, t, distance, 0.0, 0.0 if jerk else last.c2, last.c3)
    if jerk is not None:
        return _one_phase_motion(t, pieces, distance)
    times = [p.start for p in pieces] + [t]
    return Motion(tuple(itertools.pairwise(times)), tuple((p,) for p in pieces), distance)


class Table(Law):
    """C2 cubic not-a-knot spline through (times, positions); equal positions are a standstill.

    The car is at rest before and after a standstill. The travel may end before the far support.
    """

    kind: Literal["table"] = described_field("[-] law of travel", "table")
    times: Numbers = described_field("[s] from 0, strictly increasing")
    positions: Numbers = described_field(
        f"[m] distance from the start, {ALONG}: from 0, never decreasing; equal ones are a standstill"
    )

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults between fields, one line each."""
        faults = unequal_length_faults(self.times, "positions", self.positions)
        for name, sign in (("times", ">"), ("positions", ">=")):
            column = getattr(self, name)
            if column and column[0] > 0.0:
                faults.append(f"{name}[0] = {column[0]!r}: must be 0, the start")
            faults += not_rising_faults(name, column, sign)
        return faults

    def fields_fault(self, distance: float) -> str:
        """What is wrong with the fields of this law over a distance [m]; empty if nothing is."""
        if self.positions[-1] > distance * (1.0 + ROUNDING):
            last = f"positions[{len(self.positions) - 1}] = {self.positions[-1]!r}"
            return f"{last}: must be <= {distance!r}, the length of the cable"
        if self.positions[-1] == 0.0:
            return "positions: the mass never moves; must increase somewhere"
        motion = self.motion_without_stop(distance)
        t, slowest = min(motion.speeds_where_extreme, key=lambda sample: sample[1])
        if slowest < -1e-12 * motion.top_speed:
            return self._backwards_fault(t)
        _, ds, dds = motion.position_with_rates(0.0, 0)
        if self.position is None and ds == 0.0 and dds * motion.end_time <= AT_REST * motion.top_speed:
            return "positions: the mass enters without speed and acceleration; must have one of them at t = 0"
        return ""

    def _backwards_fault(self, t: float) -> str:
        """Fault of a curve that runs backwards at t [s]: its rows, and where the speed changes too abruptly for it."""
        k = min(int(np.searchsorted(self.times, t, side="right")), len(self.times) - 1) - 1
        mean = np.diff(self.positions) / np.diff(self.times)
        beside = max((j for j in (k - 1, k + 1) if 0 <= j < mean.size), key=lambda j: abs(mean[j] - mean[k]))
        i = min(beside, k)
        where = f"positions[{k}] = {self.positions[k]!r} to positions[{k + 1}] = {self.positions[k + 1]!r}"
        changes = f"the mean speed changes from {mean[i]:.3g} to {mean[i + 1]:.3g} m/s"
        rows = f"add rows from {self.times[i]:g} to {self.times[i + 2]:g} s that say how it changes"
        return (
            f"{where}: the smooth curve through the table runs backwards at t = {t:.4g} s, for {changes} there; "
            f"{rows}, or equal positions for a standstill"
        )

    def motion_without_stop(self, distance: float) -> Motion:
        """The motion from 0 over a distance [m], in SI."""
        t = np.array(self.times)
        s = np.array(self.positions)
        if abs(s[-1] - distance) <= ROUNDING * distance:
            s[-1] = distance
        at_rest = np.diff(s) == 0.0
        changes = np.flatnonzero(at_rest[1:] != at_rest[:-1]) + 1
        phases: list[tuple[float, float]] = []
        pieces: list[tuple[Piece, ...]] = []
        for i, j in itertools.pairwise([0, *changes.tolist(), t.size - 1]):
            begin = float(t[i])
            phases.append((begin, float(t[j])))
            if at_rest[i]:
                pieces.append((Piece(begin, begin, float(s[i]), 0.0, 0.0),))
            else:
                pieces.append(_spline_pieces(t[i : j + 1], s[i : j + 1], rests=(i > 0, j < t.size - 1)))
        return Motion(tuple(phases), tuple(pieces), float(s[-1]))

    def faster(self, factor: float) -> Law:
        return super().faster(factor).model_copy(update={"times": tuple(t / factor for t in self.times)})


def _spline_pieces(t: np.ndarray, s: np.ndarray, rests: tuple[bool, bool]) -> tuple[Piece, ...]:
    """A spline through s at t; rests : whether it must begin and end at rest."""
    from scipy.interpolate import CubicSpline  # slow to import

    slopes = CubicSpline(t, s)(t, 1)
    at_rest = (slopes[[0, -1]] < AT_REST * slopes.max()) | np.array(rests)  # begin and end; it does not run backwards
    spline = CubicSpline(t, s, bc_type=tuple((1, 0.0) if rest else "not-a-knot" for rest in at_rest))
    if at_rest[0]:  # exactly zero: a very slow start is not a start from rest
        spline.c[2, 0] = 0.0
    coefficients = spline.c[::-1].T  # c0 to c3 (pieces, 4)
    return tuple(Piece(t0, t0, *c) for t0, c in zip(t[:-1].tolist(), coefficients.tolist(), strict=True))


Travel = Annotated[
    ConstantSpeed | ConstantAcceleration | AccelerateCruiseBrake | Trapezoid | Table, Field(discriminator="kind")
]
