"""A first guess: a taut string whose tension falls by q with depth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cablefem.scene.bisection import bisect_zero
from cablefem.scene.line import Case, NoLineAtRest

WITHIN = 1e-3  # relative, of the tension of a guess


@dataclass(frozen=True, slots=True)
class Start:
    """A first guess of a case with n stations."""

    H: np.ndarray  # (n - 1,) [N] horizontal force of the pieces
    points: np.ndarray  # (n, 2) [m]
    s: np.ndarray  # (n,) [m]


class TautString(NamedTuple):
    """A string that carries the loads of a case with n stations."""

    H: np.ndarray  # (n - 1,) [N] horizontal force of the pieces
    points: np.ndarray  # (n, 2) [m]
    lengths: np.ndarray  # (n - 1,) [m] of the pieces, unstretched


def first_guess(case: Case) -> Start | NoLineAtRest:
    """A first guess, or why there is none."""
    try:
        string = _taut_guess(case)
    except NoLineAtRest as error:
        return error
    s = np.concatenate([[0.0], np.cumsum(string.lengths)])
    if math.isnan(case.s_or_nan[0]):
        s += case.s_or_nan[-1] - s[-1]
    return Start(string.H, string.points, s)


def _taut_guess(case: Case) -> TautString:
    """The string of the tension or length of a case; NoLineAtRest where that does not carry it."""
    prescribed = case.prescribed_tension
    for k in (0, len(case.stations) - 1):
        if prescribed is None and case.stations[k].kind == "counterweight":
            prescribed = k, case.stations[k].force
    if prescribed is None:
        return _taut_guess_for_length(case, float(case.length or 0.0))
    k, T = prescribed
    try:
        return _string_with_tension_at(case, T, k)
    except NoLineAtRest:
        raise NoLineAtRest(f"a tension of {T:.6g} N at {case.stations[k].name} does not carry it") from None


def _taut_guess_for_length(case: Case, length: float) -> TautString:
    def excess(log_T: float) -> float:
        """Length of a catenary with this tension beyond the prescribed one."""
        try:
            return float(_string_with_tension_at(case, math.exp(log_T), None).lengths.sum()) - length
        except NoLineAtRest:  # too slack
            return math.inf

    smallest = math.log(1e-6 * case.weight * length)
    try:
        log_T = bisect_zero(excess, smallest, math.log(case.EA), WITHIN)
        return _string_with_tension_at(case, math.exp(log_T), None)
    except ValueError:
        supports = np.array([(p.x, p.y) for p in case.stations if not p.is_car])
        reach = float(np.hypot(*np.diff(supports, axis=0).T).sum())
        if length < reach:
            raise NoLineAtRest(f"the rope is too short to reach: {length:.6g} m over {reach:.6g} m of chords") from None
        raise NoLineAtRest(
            f"no tension below EA = {case.EA:.6g} N carries the loads on {length:.6g} m of rope"
        ) from None
    except NoLineAtRest:
        raise NoLineAtRest(f"{length:.6g} m of rope hang too slack") from None


def _string_with_tension_at(case: Case, tension: float, at_station: int | None) -> TautString:
    """The string with a tension [N] at a station; None: at the mean depth. NoLineAtRest where it goes slack."""
    x = np.array([p.x for p in case.stations])
    y = np.array([p.y for p in case.stations])
    cars = np.array([p.is_car for p in case.stations])
    load = np.array([p.force if p.is_car else 0.0 for p in case.stations])
    chord = np.interp(x, x[~cars], y[~cars])
    dx = np.diff(x)
    N = H = np.full(dx.size, tension)
    depth = chord
    for _ in range(8):  # of tension and depth in turn, at most
        before = N
        w = case.weight * np.hypot(1.0, np.diff(depth) / dx)  # per horizontal length
        k_x = H / dx
        K = np.diag(_sum_of_pieces_at_stations(k_x)) - np.diag(k_x, 1) - np.diag(k_x, -1)  # (n, n)
        b = load + 0.5 * _sum_of_pieces_at_stations(w * dx)
        depth = np.where(cars, 0.0, chord)
        depth[cars] = np.linalg.solve(K[np.ix_(cars, cars)], (b - K @ depth)[cars])
        level = depth.mean() if at_station is None else depth[at_station]
        middle = 0.5 * (depth[:-1] + depth[1:])
        N = tension + case.weight * (level - middle - w * dx**2 / (12.0 * H))
        if N.min() <= 0.0:
            raise NoLineAtRest("")
        H = N * dx / np.hypot(dx, np.diff(depth))
        if np.abs(N - before).max() <= WITHIN * tension:
            break
    arc = np.hypot(dx, np.diff(depth)) + (w / H) ** 2 * dx**3 / 24.0
    unstretched = arc / (1.0 + N / case.EA) / case.thermal_stretch
    return TautString(H, np.stack([x, depth], axis=1), unstretched)


def _sum_of_pieces_at_stations(pieces: np.ndarray) -> np.ndarray:
    """Sum (n,) of the values of the pieces (n - 1,) that end at a station."""
    return np.convolve(pieces, (1.0, 1.0))
