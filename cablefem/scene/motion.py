"""The travel s_o(t): a piecewise cubic with exact derivatives."""

from __future__ import annotations

import bisect
import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np


class Piece(NamedTuple):
    """s_o(t) = c0 + c1 x + c2 x^2 + c3 x^3, x = t - origin, from `start` on."""

    start: float
    origin: float
    c0: float
    c1: float
    c2: float
    c3: float = 0.0

    def __call__(self, t: Any) -> Any:
        """(s_o, ds_o/dt, d2s_o/dt2); also on columns of pieces."""
        x = t - self.origin
        ds = self.c1 + x * (2.0 * self.c2 + 3.0 * x * self.c3)
        dds = 2.0 * self.c2 + 6.0 * x * self.c3
        return self.c0 + x * (self.c1 + x * (self.c2 + x * self.c3)), ds, dds


@dataclass(frozen=True)
class Motion:
    """Travel in phases; the acceleration jumps between them. SI, or dimensionless in `Groups`."""

    phases: tuple[tuple[float, float], ...]  # consecutive [t0, t1]
    pieces: tuple[tuple[Piece, ...], ...]  # of each phase
    end_position: float

    @property
    def end_time(self) -> float:
        return self.phases[-1][1]

    @property
    def end_speed(self) -> float:
        return self.position_with_rates(self.end_time, len(self.phases) - 1)[1]

    def position_with_rates(self, t: float, phase: int) -> tuple[float, float, float]:
        """(s_o, ds_o/dt, d2s_o/dt2) by the polynomials of a phase, also beyond its ends."""
        pieces = self.pieces[phase]
        index = bisect.bisect_right(pieces, t, key=lambda piece: piece.start) - 1 if len(pieces) > 1 else 0
        s, ds, dds = pieces[max(0, index)](t)
        if t == self.end_time:
            s = self.end_position  # without rounding
        return s, ds, dds

    def positions_with_rates(self, t: np.ndarray, phase: np.ndarray | int) -> np.ndarray:
        """Of many instants, as `position_with_rates`: rows s_o, ds_o, dds_o, (3, n)."""
        first, last = self._piece_range_by_phase[:, phase]
        piece = np.minimum(np.maximum(self._piece_index(t), first), last)
        out = np.array(self._piece_columns(piece)(t))
        out[0, t == self.end_time] = self.end_position
        return out

    def times_of_mean_positions(self, t0: np.ndarray, t1: np.ndarray, end_weight: float, phase: int) -> np.ndarray:
        """Times (n,) of the mean position end_weight s_o(t1) + (1 - end_weight) s_o(t0): a step is balanced there."""
        first = self.positions_with_rates(t0, phase)[0]
        last = self.positions_with_rates(t1, phase)[0]
        mean = (1.0 - end_weight) * first + end_weight * last
        t = (1.0 - end_weight) * t0 + end_weight * t1
        same = 1e-9  # error over the distance of a step
        for _ in range(20):  # Newton steps
            s, ds, _ = self.positions_with_rates(t, phase)
            far = (np.abs(mean - s) > same * (last - first)) & (ds > 0.0)
            if not far.any():
                break
            better = t + (mean - s) / np.where(far, ds, 1.0)
            t[far] = np.clip(better, t0, t1)[far]
        return t

    @property
    def start_position(self) -> float:
        return self.position_with_rates(0.0, 0)[0]

    def position(self, t: Any) -> np.ndarray:
        """s_o at t, same shape; constant outside the travel."""
        t = np.clip(np.asarray(t, dtype=float), 0.0, self.end_time)
        s, _, _ = self._piece_columns(self._piece_index(t))(t)
        return np.where(t == self.end_time, self.end_position, s)

    def time_at_position(self, s_o: float) -> float:
        """When the mass comes to s_o; ValueError if never."""
        return float(self.times_at_positions(np.array([s_o]))[0])

    def times_at_positions(self, s_o: np.ndarray) -> np.ndarray:
        """`time_at_position` of many positions (n,), by bisection to the last bit."""
        outside = s_o[~((self.start_position <= s_o) & (s_o <= self.end_position))]
        if outside.size:
            travel = f"its travel covers [{self.start_position:g}, {self.end_position!r}]"
            raise ValueError(f"the mass is never at s_o = {outside.tolist()[0]!r}: {travel}")
        times = np.append(self._piece_table[0], self.end_time)
        positions = self.position(times)
        k = np.searchsorted(positions, s_o, side="left")
        low = times[np.where(positions[k] == s_o, k, k - 1)]
        high = times[k]
        middle = 0.5 * (low + high)
        while np.any((low < middle) & (middle < high)):
            early = self.position(middle) < s_o
            low = np.where(early, middle, low)
            high = np.where(early, high, middle)
            middle = 0.5 * (low + high)
        return high

    @cached_property
    def _piece_range_by_phase(self) -> np.ndarray:
        """First and last piece of each phase (2, n)."""
        counts = np.array([len(pieces) for pieces in self.pieces])
        return np.stack([np.cumsum(counts) - counts, np.cumsum(counts) - 1])

    def _piece_index(self, t: Any) -> np.ndarray:
        return np.searchsorted(self._piece_table[0, 1:], t, side="right")

    def _piece_columns(self, index: np.ndarray) -> Piece:
        """The pieces of these numbers, as columns."""
        return Piece(*self._piece_table[:, index])

    @property
    def speeds_where_extreme(self) -> list[tuple[float, float]]:
        """(t, ds_o/dt) wherever the speed can be extreme."""
        samples = []
        for (_, stop), pieces in zip(self.phases, self.pieces, strict=True):
            ends = [*(p.start for p in pieces[1:]), stop]
            for piece, end in zip(pieces, ends, strict=True):
                times = [piece.start, end]
                if piece.c3 != 0.0:
                    extreme = piece.origin - piece.c2 / (3.0 * piece.c3)
                    if piece.start < extreme < end:
                        times.append(extreme)
                samples += [(t, piece(t)[1]) for t in times]
        return samples

    @cached_property
    def top_speed(self) -> float:
        """Largest ds_o/dt."""
        return max(speed for _, speed in self.speeds_where_extreme)

    @property
    def standstill_phases(self) -> list[tuple[float, float]]:
        """Phases [t0, t1] at rest."""
        at_rest = [all(p.c1 == p.c2 == p.c3 == 0.0 for p in pieces) for pieces in self.pieces]
        return list(itertools.compress(self.phases, at_rest))

    def shifted(self, distance: float) -> Motion:
        """The same motion, all positions so much farther."""
        pieces = tuple(tuple(p._replace(c0=p.c0 + distance) for p in pieces) for pieces in self.pieces)
        return Motion(self.phases, pieces, self.end_position + distance)

    def followed_by_stop(self, duration: float, acceleration: float) -> Motion:
        """The same motion, then with `acceleration` to rest after `duration`; 0: at rest."""
        begin = self.end_time
        end = begin + duration
        position, speed, _ = self.position_with_rates(begin, len(self.phases) - 1)
        if acceleration != 0.0:
            position += 0.5 * speed * duration
        piece = Piece(begin, end, position, 0.0, 0.5 * acceleration)
        return Motion((*self.phases, (begin, end)), (*self.pieces, (piece,)), position)

    def cut_at(self, t_end: float) -> Motion:
        """The motion up to t_end."""
        if t_end >= self.end_time:
            return self
        phases = tuple((t0, min(t1, t_end)) for t0, t1 in self.phases if t0 < t_end)
        pieces = tuple(tuple(p for p in pieces if p.start < t_end) for pieces in self.pieces[: len(phases)])
        return Motion(phases, pieces, self.position_with_rates(t_end, len(phases) - 1)[0])

    def in_units(self, length: float, time: float) -> Motion:
        """The motion over these units of length and time."""
        of_coefficients = [length / time**k for k in range(4)]
        units = np.array([time, time, *of_coefficients])  # of the fields of a piece

        def scale(pieces: tuple[Piece, ...]) -> tuple[Piece, ...]:
            return tuple(Piece(*row) for row in (np.array(pieces) / units).tolist())

        phases = tuple((t0 / time, t1 / time) for t0, t1 in self.phases)
        return Motion(phases, tuple(map(scale, self.pieces)), self.end_position / length)

    @cached_property
    def _piece_table(self) -> np.ndarray:
        """start, origin, c0, c1, c2, c3 of all pieces: (6, n)."""
        return np.array(list(itertools.chain(*self.pieces))).T


def rest_motion(position: float, t_end: float) -> Motion:
    """Rest at a position until `t_end`."""
    piece = Piece(0.0, 0.0, position, 0.0, 0.0)
    return Motion(((0.0, t_end),), ((piece,),), position)
