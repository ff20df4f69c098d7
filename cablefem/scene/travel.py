"""Laws of travel, as written in a scene: the mass enters at the left support at t = 0 and runs to the right."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from cablefem.scene.fields import NonNegative, Numbers, Part, Positive, Real
from cablefem.scene.motion import Motion, Piece

# A table cannot tell rest from so slow an entry: the end slope of a spline through twenty points is off by as much.
AT_REST = 1e-3  # of the largest speed
# Someone who gives the sag knows the length of the cable, and thus the far end of the travel, in rounded digits only.
AT_THE_END = 1e-9  # of the length


def _column(values: object) -> np.ndarray | None:
    """The numbers as an array (n,), n > 1; None when they are none, which their field reports."""
    try:
        column = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return None
    return column if column.ndim == 1 and column.size > 1 else None


class Law(Part):
    """What a law of travel answers, once the length of the cable is known."""

    def faults(self, length: float) -> list[str]:
        """What is wrong with this travel on a cable of that length [m]."""
        return []

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI."""
        raise NotImplementedError

    def faster(self, factor: float) -> Law:
        """The same law run through `factor` times as fast."""
        raise NotImplementedError


class ConstantSpeed(Law):
    """s_o = V t: the mass enters at full speed and keeps it (the paper), or comes to it over an entry ramp.

    Entering at full speed sends a kink along the cable at once, which is followed with many steps and fades only by
    reflection. Over a ramp of length L, T = 3 L/(2 V), the mass starts from rest with the acceleration 2 V/T, which
    falls to zero: s_o = V T (x^2 - x^3/3), x = t/T; speed and acceleration are smooth where it meets V. At a tenth of
    the wave speed a ramp over a twentieth of the length divides the path's error by 7 at the same cost.
    """

    kind: Literal["constant_speed"] = "constant_speed"
    speed: Positive  # V [m/s]
    entry_ramp: Positive | None = None  # L [m]; the paper has none

    def faults(self, length: float) -> list[str]:
        """What is wrong with this travel on a cable of that length [m]."""
        if self.entry_ramp is not None and self.entry_ramp >= length:
            return [f"entry_ramp = {self.entry_ramp!r}: must be < {length:.6g} m, the length of the ride"]
        return []

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI."""
        V, L = self.speed, self.entry_ramp
        if L is None:
            return Motion(((0.0, length / V),), ((Piece(0.0, 0.0, 0.0, V, 0.0),),), length)
        T = 1.5 * L / V
        ramp = Piece(0.0, 0.0, 0.0, 0.0, V / T, -V / (3.0 * T * T))
        return Motion(((0.0, T + (length - L) / V),), ((ramp, Piece(T, T, L, V, 0.0)),), length)

    def faster(self, factor: float) -> ConstantSpeed:
        """The same law run through `factor` times as fast."""
        return ConstantSpeed(speed=self.speed * factor, entry_ramp=self.entry_ramp)


class ConstantAcceleration(Law):
    """s_o = V_o t + a t^2/2 up to the far support."""

    kind: Literal["constant_acceleration"] = "constant_acceleration"
    acceleration: Real  # a [m/s^2]
    initial_speed: NonNegative = 0.0  # V_o [m/s]

    def faults(self, length: float) -> list[str]:
        """What is wrong with this travel on a cable of that length [m]."""
        a, v0 = self.acceleration, self.initial_speed
        if v0 == 0.0 and a <= 0.0:
            return [f"acceleration = {a!r}: must be > 0 m/s^2 with initial_speed = 0, or the mass never moves"]
        least = -0.5 * v0 * v0 / length
        if a < least * (1.0 + 1e-12):
            return [
                f"acceleration = {a!r}: must be >= {least!r} m/s^2 with initial_speed = {v0!r}, "
                f"or the mass stops after {-0.5 * v0 * v0 / a:.6g} m of {length:.6g} m"
            ]
        return []

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI."""
        a, v0 = self.acceleration, self.initial_speed
        v1 = math.sqrt(max(0.0, v0 * v0 + 2.0 * a * length))
        return Motion(((0.0, 2.0 * length / (v0 + v1)),), ((Piece(0.0, 0.0, 0.0, v0, 0.5 * a),),), length)

    def faster(self, factor: float) -> ConstantAcceleration:
        """The same law run through `factor` times as fast."""
        return ConstantAcceleration(
            acceleration=self.acceleration * factor**2, initial_speed=self.initial_speed * factor
        )


class AccelerateCruiseBrake(Law):
    """Law (40): constant acceleration from rest over l/3, cruise at top speed over l/3, braking to rest over l/3."""

    kind: Literal["accelerate_cruise_brake"] = "accelerate_cruise_brake"
    top_speed: Positive  # V_max [m/s]

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI: a = 3 V^2/(2 l), durations 2l/3V, l/3V, 2l/3V."""
        V, l = self.top_speed, length
        half_a = 0.75 * V * V / l
        t1, t2, t3 = 2.0 * l / (3.0 * V), l / V, 5.0 * l / (3.0 * V)
        return Motion(
            ((0.0, t1), (t1, t2), (t2, t3)),
            (
                (Piece(0.0, 0.0, 0.0, 0.0, half_a),),
                (Piece(t1, t1, l / 3.0, V, 0.0),),
                (Piece(t2, t3, l, 0.0, -half_a),),  # written from its end: the last speed is exactly zero
            ),
            l,
        )

    def faster(self, factor: float) -> AccelerateCruiseBrake:
        """The same law run through `factor` times as fast."""
        return AccelerateCruiseBrake(top_speed=self.top_speed * factor)


class Table(Law):
    """The C2 cubic spline through (times, positions), not-a-knot at its ends.

    An entry or a last speed below 1e-3 of the largest one counts as rest. The travel may end before the far support.
    A wait on the way is refused, since the curve through equal positions runs backwards.
    """

    kind: Literal["table"] = "table"
    times: Numbers  # [s], from 0, strictly increasing
    positions: Numbers  # s_o [m], from 0, strictly increasing, at most the length of the cable

    @classmethod
    def faults_between(cls, data: dict[str, Any]) -> list[str]:
        """The two columns start at zero, increase strictly and are of one length."""
        columns = {name: column for name in ("times", "positions") if (column := _column(data.get(name))) is not None}
        faults = []
        if len(columns) == 2 and columns["times"].size != columns["positions"].size:
            faults.append(f"positions: {columns['positions'].size} values; must be {columns['times'].size}, as times")
        for name, column in columns.items():
            if column[0] > 0.0:
                faults.append(f"{name}[0] = {float(column[0])!r}: must be 0, the entry at the left support")
            for i in np.flatnonzero(np.diff(column) <= 0.0)[:1]:
                faults.append(
                    f"{name}[{i + 1}] = {float(column[i + 1])!r}: must be > {float(column[i])!r}, the one before it"
                )
        return faults

    def faults(self, length: float) -> list[str]:
        """What is wrong with this travel on a cable of that length [m]."""
        if self.positions[-1] > length * (1.0 + AT_THE_END):
            last = f"positions[{len(self.positions) - 1}] = {self.positions[-1]!r}"
            return [f"{last}: must be <= {length!r}, the length of the cable"]
        motion = self.motion(length)
        t, slowest = min(motion.speeds, key=lambda sample: sample[1])
        if slowest < -1e-12 * motion.top_speed:
            return [
                f"positions: the smooth curve through them runs backwards at t = {t:.6g} s ({slowest:.3g} m/s); "
                "must run >= 0 m/s throughout: give more points there"
            ]
        _, ds, dds = motion.at(0.0, 0)
        if ds == 0.0 and dds * motion.phases[-1][1] <= AT_REST * motion.top_speed:
            return ["positions: the mass enters without speed and acceleration; must have one of them at t = 0"]
        return []

    def motion(self, length: float) -> Motion:
        """The travel over a cable of that length [m], in SI."""
        from scipy.interpolate import CubicSpline  # half of the time that importing a scene would take

        t, s = np.array(self.times), np.array(self.positions)
        if abs(s[-1] - length) <= AT_THE_END * length:
            s[-1] = length
        slopes = CubicSpline(t, s)(t, 1)
        rest = np.abs(slopes[[0, -1]]) < AT_REST * np.max(np.abs(slopes))
        spline = CubicSpline(t, s, bc_type=tuple((1, 0.0) if still else "not-a-knot" for still in rest))
        # Entered exactly, since a start from rest is another start than a very slow one.
        spline.c[2, 0] = 0.0 if rest[0] else spline.c[2, 0]
        pieces = tuple(
            Piece(t0, t0, c0, c1, c2, c3)
            for t0, (c3, c2, c1, c0) in zip(t[:-1].tolist(), spline.c.T.tolist(), strict=True)
        )
        return Motion(((0.0, float(t[-1])),), (pieces,), float(s[-1]))

    def faster(self, factor: float) -> Table:
        """The same law run through `factor` times as fast."""
        return Table(times=tuple(t / factor for t in self.times), positions=self.positions)


Travel = Annotated[ConstantSpeed | ConstantAcceleration | AccelerateCruiseBrake | Table, Field(discriminator="kind")]
