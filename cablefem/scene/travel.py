"""Prescribed travel of the mass along the cable, s_o(t): data in SI, and the piecewise polynomial they mean."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from cablefem.scene.fields import NonNegative, Numbers, Part, Positive, Real

# A table cannot tell rest from an entry this slow (rounded positions give as much): below it the mass starts from rest.
AT_REST = 1e-4  # of the largest speed
# The far end of a cable given by its sag is known to the user only in rounded digits.
AT_THE_END = 1e-9  # of the length


@dataclass(frozen=True, slots=True)
class Piece:
    """s_o(t) = sum_k coefficients[k] (t - origin)^k, used from `start` on."""

    start: float
    origin: float
    coefficients: tuple[float, float, float, float]

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Return (s_o, ds_o/dt, d2s_o/dt2) at t."""
        c0, c1, c2, c3 = self.coefficients
        x = t - self.origin
        return c0 + x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + 3.0 * x * c3), 2.0 * c2 + 6.0 * x * c3


@dataclass(frozen=True)
class Motion:
    """The travel as a function: a polynomial of degree <= 3 per piece, in phases between jumps of acceleration.

    Units are those it was built in: SI from `Travel.motion`, lengths over l and times over l sqrt(rho/H) in `Groups`.
    """

    phases: tuple[tuple[float, float], ...]  # consecutive [t0, t1]; the last t1 is the end of travel
    pieces: tuple[tuple[Piece, ...], ...]  # of each phase; the acceleration is continuous within a phase
    end: float  # s_o at the end of travel

    def at(self, t: float, phase: int) -> tuple[float, float, float]:
        """Return (s_o, ds_o/dt, d2s_o/dt2) at t by the polynomials of that phase, also at and beyond its two ends."""
        pieces = self.pieces[phase]
        piece = pieces[0]
        if len(pieces) > 1:
            piece = pieces[max(0, bisect.bisect_right(pieces, t, key=lambda piece: piece.start) - 1)]
        s, ds, dds = piece(t)
        if t == self.phases[-1][1]:
            s = self.end  # exactly, where the polynomial has rounding
        return s, ds, dds

    def position(self, t) -> np.ndarray:
        """s_o at times t, same shape; it stays at its first and last value before and after the travel."""
        t = np.clip(np.asarray(t, dtype=float), 0.0, self.phases[-1][1])
        starts, origins, coefficients = self._flat
        index = np.searchsorted(starts[1:], t, side="right")
        x, c = t - origins[index], coefficients[index]
        s = c[..., 0] + x * (c[..., 1] + x * (c[..., 2] + x * c[..., 3]))
        return np.where(t == self.phases[-1][1], self.end, s)

    def time_at(self, s_o: float) -> float:
        """The time at which the mass is at s_o, to rounding; ValueError where it never comes."""
        from scipy.optimize import brentq

        if not 0.0 <= s_o <= self.end:
            raise ValueError(f"the mass is never at s_o = {s_o!r}: its travel covers [0, {self.end!r}]")
        if s_o in (0.0, self.end):
            return 0.0 if s_o == 0.0 else self.phases[-1][1]
        starts = np.append(self._flat[0], self.phases[-1][1])
        index = int(np.searchsorted(self.position(starts)[1:-1], s_o, side="right"))
        piece = [piece for phase in self.pieces for piece in phase][index]
        low, high = float(starts[index]), float(starts[index + 1])
        if piece(low)[0] >= s_o:  # s_o lies in the rounding of a piece's ends
            return low
        if piece(high)[0] <= s_o:
            return high
        return float(brentq(lambda t: piece(t)[0] - s_o, low, high, xtol=1e-300, rtol=1e-15, maxiter=500))

    @cached_property
    def speeds(self) -> tuple[float, float]:
        """Least and largest ds_o/dt of the travel."""
        speeds = [ds for _, ds in self.speed_samples()]
        return min(speeds), max(speeds)

    def speed_samples(self) -> list[tuple[float, float]]:
        """(t, ds_o/dt) at the ends of all pieces and wherever the speed is stationary inside one."""
        samples = []
        for (_, stop), pieces in zip(self.phases, self.pieces, strict=True):
            for piece, high in zip(pieces, [*(p.start for p in pieces[1:]), stop], strict=True):
                times = [piece.start, high]
                _, _, c2, c3 = piece.coefficients
                if c3 != 0.0 and piece.start < piece.origin - c2 / (3.0 * c3) < high:
                    times.append(piece.origin - c2 / (3.0 * c3))
                samples += [(t, piece(t)[1]) for t in times]
        return samples

    def scaled(self, length: float, time: float) -> Motion:
        """The same motion with lengths measured in `length` and times in `time`."""
        factors = [time**k / length for k in range(4)]
        return Motion(
            tuple((t0 / time, t1 / time) for t0, t1 in self.phases),
            tuple(
                tuple(
                    Piece(p.start / time, p.origin / time, tuple(c * f for c, f in zip(p.coefficients, factors, strict=True)))  # type: ignore[arg-type]
                    for p in pieces
                )
                for pieces in self.pieces
            ),
            self.end / length,
        )

    @cached_property
    def _flat(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        pieces = [piece for phase in self.pieces for piece in phase]
        return (
            np.array([p.start for p in pieces]),
            np.array([p.origin for p in pieces]),
            np.array([p.coefficients for p in pieces]),
        )


def _one_piece(speed: float, acceleration: float, duration: float, length: float) -> Motion:
    """s_o = speed t + acceleration t^2/2 up to s_o = length."""
    piece = Piece(0.0, 0.0, (0.0, speed, 0.5 * acceleration, 0.0))
    return Motion(((0.0, duration),), ((piece,),), length)


class ConstantSpeed(Part):
    """The mass enters at full speed and keeps it: s_o = V t."""

    kind: Literal["constant_speed"] = "constant_speed"
    speed: Positive  # V [m/s]

    def faults(self, length: float) -> list[str]:
        """What is wrong with this travel on a cable of that length [m]."""
        return []

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI."""
        return _one_piece(self.speed, 0.0, length / self.speed, length)

    def faster(self, factor: float) -> Travel:
        """The same law run through `factor` times as fast."""
        return ConstantSpeed(speed=self.speed * factor)


class ConstantAcceleration(Part):
    """s_o = V_o t + a t^2/2 until the far support is reached."""

    kind: Literal["constant_acceleration"] = "constant_acceleration"
    acceleration: Real  # a [m/s^2]
    initial_speed: NonNegative = 0.0  # V_o [m/s]

    def faults(self, length: float) -> list[str]:
        """What is wrong with this travel on a cable of that length [m]."""
        if self.initial_speed == 0.0 and self.acceleration <= 0.0:
            return [f"acceleration = {self.acceleration!r}: must be > 0 when initial_speed is 0, or the mass never moves"]
        least = -0.5 * self.initial_speed**2 / length
        if self.acceleration < least * (1.0 + 1e-12):
            stop = -0.5 * self.initial_speed**2 / self.acceleration
            return [
                f"acceleration = {self.acceleration!r}: the mass stops after {stop:.6g} m of {length:.6g} m; "
                f"must be >= {least:.6g} m/s^2 with initial_speed = {self.initial_speed!r}"
            ]
        return []

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI."""
        v0, a = self.initial_speed, self.acceleration
        v1 = math.sqrt(max(0.0, v0 * v0 + 2.0 * a * length))
        return _one_piece(v0, a, 2.0 * length / (v0 + v1), length)

    def faster(self, factor: float) -> Travel:
        """The same law run through `factor` times as fast."""
        return ConstantAcceleration(
            acceleration=self.acceleration * factor**2, initial_speed=self.initial_speed * factor
        )


class AccelerateCruiseBrake(Part):
    """Law (40): constant acceleration from rest over l/3, cruise at top speed over l/3, braking to rest over l/3."""

    kind: Literal["accelerate_cruise_brake"] = "accelerate_cruise_brake"
    top_speed: Positive  # V_max [m/s]

    def faults(self, length: float) -> list[str]:
        """What is wrong with this travel on a cable of that length [m]."""
        return []

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI: a = 3 V^2/(2 l), times 2l/3V, l/3V, 2l/3V."""
        V, l = self.top_speed, length
        half_a = 0.75 * V * V / l
        t1, t2, t3 = 2.0 * l / (3.0 * V), l / V, 5.0 * l / (3.0 * V)
        return Motion(
            ((0.0, t1), (t1, t2), (t2, t3)),
            (
                (Piece(0.0, 0.0, (0.0, 0.0, half_a, 0.0)),),
                (Piece(t1, t1, (l / 3.0, V, 0.0, 0.0)),),
                (Piece(t2, t3, (l, 0.0, -half_a, 0.0)),),  # written from its end: the last speed is exactly zero
            ),
            l,
        )

    def faster(self, factor: float) -> Travel:
        """The same law run through `factor` times as fast."""
        return AccelerateCruiseBrake(top_speed=self.top_speed * factor)


class Table(Part):
    """The C2 cubic spline through (times, positions), not-a-knot at its ends.

    An entry slower than 1e-4 of the largest speed counts as rest, and a stop likewise; the travel may end before the
    far support. A wait on the way is refused: a smooth curve through equal positions runs backwards.
    """

    kind: Literal["table"] = "table"
    times: Numbers  # [s], from 0, strictly increasing
    positions: Numbers  # s_o [m], from 0, strictly increasing, at most the length of the cable

    @classmethod
    def raw_faults(cls, data: dict) -> list[str]:
        """Faults of the two columns as data, whatever the cable."""
        try:
            times, positions = (np.asarray(data[name], dtype=float) for name in ("times", "positions"))
        except (KeyError, TypeError, ValueError):
            return []  # said by the fields themselves
        faults = []
        if times.ndim != 1 or positions.ndim != 1 or not (np.isfinite(times).all() and np.isfinite(positions).all()):
            return []
        if times.size != positions.size:
            faults.append(f"positions: {positions.size} values for {times.size} times; must be as many")
        for name, column in (("times", times), ("positions", positions)):
            if column.size and column[0] != 0.0:
                faults.append(f"{name}[0] = {column[0]}: must be 0, the entry at the left support")
            for i in np.flatnonzero(np.diff(column) <= 0.0)[:1]:
                faults.append(f"{name}[{i + 1}] = {column[i + 1]}: must be > {column[i]}, the value before it")
        return faults

    def faults(self, length: float) -> list[str]:
        """What is wrong with this travel on a cable of that length [m]."""
        last = self.positions[-1]
        if last > length * (1.0 + AT_THE_END):
            return [f"positions[{len(self.positions) - 1}] = {last!r}: must be <= {length!r}, the length of the cable"]
        motion = self.motion(length)
        _, top = motion.speeds
        t_slow, slow = min(motion.speed_samples(), key=lambda sample: sample[1])
        if slow < -1e-12 * top:
            return [
                f"positions: the smooth curve through the table runs backwards at t = {t_slow:.6g} s "
                f"({slow:.3g} m/s); must be >= 0 throughout: give points closer together there"
            ]
        _, ds, dds = motion.at(0.0, 0)
        if ds == 0.0 and dds * motion.phases[-1][1] <= AT_REST * top:
            return ["positions: the mass enters with neither speed nor acceleration; must have one of them at t = 0"]
        if max(s for s in (motion.at(t, 0)[0] for t, _ in motion.speed_samples())) > motion.end * (1.0 + 1e-12):
            return [f"positions: the smooth curve through the table leaves the cable; must be <= {length!r}"]
        return []

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI."""
        from scipy.interpolate import CubicSpline

        t, s = np.array(self.times), np.array(self.positions)
        if abs(s[-1] - length) <= AT_THE_END * length:
            s[-1] = length
        ends: list = ["not-a-knot", "not-a-knot"]
        spline = CubicSpline(t, s, bc_type=tuple(ends))
        slopes = spline(t, 1)
        for i in (0, -1):
            if abs(slopes[i]) < AT_REST * np.max(np.abs(slopes)):
                ends[i] = (1, 0.0)
        spline = CubicSpline(t, s, bc_type=tuple(ends))
        pieces = []
        for t0, c in zip(t, spline.c.T, strict=False):
            c3, c2, c1, c0 = (float(value) for value in c)
            pieces.append(Piece(float(t0), float(t0), (c0, c1, c2, c3)))
        if ends[0] != "not-a-knot":  # rest is exact
            first = pieces[0]
            pieces[0] = Piece(first.start, first.origin, (0.0, 0.0, *first.coefficients[2:]))
        return Motion(((0.0, float(t[-1])),), (tuple(pieces),), float(s[-1]))

    def faster(self, factor: float) -> Travel:
        """The same law run through `factor` times as fast."""
        return Table(times=tuple(t / factor for t in self.times), positions=self.positions)


Travel = Annotated[
    ConstantSpeed | ConstantAcceleration | AccelerateCruiseBrake | Table, Field(discriminator="kind")
]
