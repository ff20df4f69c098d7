"""The travel s_o(t) of the mass: a piecewise cubic with exact derivatives."""

from __future__ import annotations

import bisect
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

MOST, SAME = 20, 1e-9  # Newton steps towards a mean place; its error over the way between


@dataclass(frozen=True, slots=True)
class Piece:
    """s_o(t) = c0 + c1 x + c2 x^2 + c3 x^3, x = t - origin, in use from `start` on."""

    start: float
    origin: float
    c0: float
    c1: float
    c2: float
    c3: float = 0.0

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Return (s_o, ds_o/dt, d2s_o/dt2) at t."""
        x = t - self.origin
        return (
            self.c0 + x * (self.c1 + x * (self.c2 + x * self.c3)),
            self.c1 + x * (2.0 * self.c2 + 3.0 * x * self.c3),
            2.0 * self.c2 + 6.0 * x * self.c3,
        )


@dataclass(frozen=True)
class Motion:
    """The travel in phases, between which the acceleration jumps; SI, or without units in `Groups`."""

    phases: tuple[tuple[float, float], ...]  # consecutive [t0, t1]; the last t1 is the end of travel
    pieces: tuple[tuple[Piece, ...], ...]  # of each phase; inside a phase the acceleration is continuous
    end: float  # s_o at the end of travel

    def at(self, t: float, phase: int) -> tuple[float, float, float]:
        """Return (s_o, ds_o/dt, d2s_o/dt2) at t by the polynomials of that phase, also beyond its ends."""
        pieces = self.pieces[phase]
        index = bisect.bisect_right(pieces, t, key=lambda piece: piece.start) - 1 if len(pieces) > 1 else 0
        s, ds, dds = pieces[max(0, index)](t)
        if t == self.phases[-1][1]:
            s = self.end  # exactly, where the polynomial has rounding
        return s, ds, dds

    def along(self, t: np.ndarray, phase: np.ndarray | int) -> np.ndarray:
        """Return `at` for many instants and their phases, or one phase: rows s_o, ds_o, dds_o, (3, n)."""
        out, c, one = np.empty((3, t.size)), self._columns, isinstance(phase, int)
        for p in (phase,) if one else np.unique(phase).tolist():
            rows, first, count = slice(None) if one else phase == p, sum(map(len, self.pieces[:p])), len(self.pieces[p])
            start = c[0, first : first + count]
            at = first + np.searchsorted(start[1:], t[rows], side="right") if count > 1 else first
            _, origin, c0, c1, c2, c3 = c[:, at]
            x = t[rows] - origin
            out[:, rows] = (
                c0 + x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + 3.0 * x * c3), 2.0 * c2 + 6.0 * x * c3
            )  # fmt: skip
        out[0, t == self.phases[-1][1]] = self.end
        return out

    def between(self, t0: np.ndarray, t1: np.ndarray, w: float, phase: int) -> np.ndarray:
        """Return the instants (n,) at which the place is the mean of those at t0 and t1, weighted 1 - w and w.

        A step that takes means of its unknowns is balanced there.
        """
        if t0.size == 1:  # arrays of one would take ten times as long
            return np.array([self._between(t0.item(), t1.item(), w, phase)])
        first, last = self.along(t0, phase)[0], self.along(t1, phase)[0]
        want, t = (1.0 - w) * first + w * last, (1.0 - w) * t0 + w * t1
        for _ in range(MOST):
            place, pace, _ = self.along(t, phase)
            far = (np.abs(want - place) > SAME * (last - first)) & (pace > 0.0)
            if not far.any():
                break
            t[far] = np.clip(t + (want - place) / np.where(far, pace, 1.0), t0, t1)[far]
        return t

    def _between(self, t0: float, t1: float, w: float, phase: int) -> float:
        first, last, t = self.at(t0, phase)[0], self.at(t1, phase)[0], (1.0 - w) * t0 + w * t1
        want = (1.0 - w) * first + w * last
        for _ in range(MOST):
            place, pace, _ = self.at(t, phase)
            if not (abs(want - place) > SAME * (last - first) and pace > 0.0):
                break
            t = min(max(t + (want - place) / pace, t0), t1)
        return t

    @property
    def begin(self) -> float:
        """s_o at t = 0."""
        return self.pieces[0][0](0.0)[0]

    def position(self, t) -> np.ndarray:
        """s_o at times t, same shape; constant before and after the travel."""
        stop = self.phases[-1][1]
        t = np.clip(np.asarray(t, dtype=float), 0.0, stop)
        start, origin, c0, c1, c2, c3 = self._columns
        k = np.searchsorted(start[1:], t, side="right")
        x = t - origin[k]
        return np.where(t == stop, self.end, c0[k] + x * (c1[k] + x * (c2[k] + x * c3[k])))

    def speed(self, t) -> np.ndarray:
        """ds_o/dt at times t within the travel, same shape; at a jump the later one."""
        start, origin, _, c1, c2, c3 = self._columns
        k = np.searchsorted(start[1:], t, side="right")
        x = np.asarray(t, dtype=float) - origin[k]
        return c1[k] + x * (2.0 * c2[k] + 3.0 * x * c3[k])

    def time_at(self, s_o: float) -> float:
        """The time at which the mass comes to s_o, to rounding; ValueError where it never comes."""
        return float(self.times_at(np.array([s_o]))[0])

    def times_at(self, places: np.ndarray) -> np.ndarray:
        """Return `time_at` of many places (n,), by bisection of all of them together."""
        index, low, high = self._ends_around(places)
        while ((low < (middle := 0.5 * (low + high))) & (middle < high)).any():
            early = self._on(index, middle) < places
            low, high = np.where(early, middle, low), np.where(early, high, middle)
        return high

    def _ends_around(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the pieces on which the mass comes to places (n,), and their ends; ValueError where it never comes."""
        never = [s for s in places.tolist() if not self.begin <= s <= self.end]
        if never:
            raise ValueError(
                f"the mass is never at s_o = {never[0]!r}: its travel covers [{self.begin:g}, {self.end!r}]"
            )
        times = np.append(self._columns[0], self.phases[-1][1])
        known = self.position(times)
        k = np.searchsorted(known, places, side="left")
        index, high = np.maximum(k - 1, 0), times[k]
        # at the piece's end, or within its rounding
        return index, np.where((known[k] == places) | (self._on(index, high) <= places), high, times[index]), high

    def _on(self, index: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Return s_o at times t (n,), each by the polynomial of its piece."""
        _, origin, c0, c1, c2, c3 = self._columns[:, index]
        x = t - origin
        return c0 + x * (c1 + x * (c2 + x * c3))

    @property
    def speeds(self) -> list[tuple[float, float]]:
        """(t, ds_o/dt) wherever the speed can be largest or least."""
        samples = []
        for (_, stop), pieces in zip(self.phases, self.pieces, strict=True):
            for piece, high in zip(pieces, [*(p.start for p in pieces[1:]), stop], strict=True):
                times = [piece.start, high]
                if piece.c3 != 0.0 and piece.start < (turn := piece.origin - piece.c2 / (3.0 * piece.c3)) < high:
                    times.append(turn)
                samples += [(t, piece(t)[1]) for t in times]
        return samples

    @cached_property
    def top_speed(self) -> float:
        """Largest ds_o/dt of the travel."""
        return max(speed for _, speed in self.speeds)

    @property
    def standstills(self) -> list[tuple[float, float]]:
        """Phases [t0, t1] in which the mass stands."""
        still = [all(p.c1 == p.c2 == p.c3 == 0.0 for p in pieces) for pieces in self.pieces]
        return [phase for phase, stands in zip(self.phases, still, strict=True) if stands]

    def shifted(self, start: float) -> Motion:
        """The same motion, begun at `start`."""
        pieces = tuple(tuple(replace(p, c0=p.c0 + start) for p in pieces) for pieces in self.pieces)
        return Motion(self.phases, pieces, self.end + start)

    def then(self, duration: float, acceleration: float) -> Motion:
        """The same motion, brought to rest by that acceleration, or with 0 standing, for `duration`."""
        t = self.phases[-1][1]
        s, v, _ = self.at(t, len(self.phases) - 1)
        end = s if acceleration == 0.0 else s + 0.5 * v * duration
        piece = Piece(t, t + duration, end, 0.0, 0.5 * acceleration)
        return Motion((*self.phases, (t, t + duration)), (*self.pieces, (piece,)), end)

    def until(self, t_end: float) -> Motion:
        """The same motion, broken off at t_end."""
        if t_end >= self.phases[-1][1]:
            return self
        phases = tuple((t0, min(t1, t_end)) for t0, t1 in self.phases if t0 < t_end)
        pieces = tuple(tuple(p for p in pieces if p.start < t_end) for pieces in self.pieces[: len(phases)])
        return Motion(phases, pieces, self.at(t_end, len(phases) - 1)[0])

    def scaled(self, length: float, time: float) -> Motion:
        """The same motion with lengths measured in `length` and times in `time`."""
        v, a = time / length, time * time / length

        def piece(p: Piece) -> Piece:
            return Piece(p.start / time, p.origin / time, p.c0 / length, p.c1 * v, p.c2 * a, p.c3 * a * time)

        phases = tuple((t0 / time, t1 / time) for t0, t1 in self.phases)
        return Motion(phases, tuple(tuple(map(piece, pieces)) for pieces in self.pieces), self.end / length)

    @cached_property
    def _columns(self) -> np.ndarray:
        """start, origin, c0, c1, c2, c3 of all pieces: (6, n)."""
        return np.array([(p.start, p.origin, p.c0, p.c1, p.c2, p.c3) for pieces in self.pieces for p in pieces]).T


def standing(place: float, end: float) -> Motion:
    """Return the motion of what stays at its place until `end`."""
    return Motion(((0.0, end),), ((Piece(0.0, 0.0, place, 0.0, 0.0),),), place)
