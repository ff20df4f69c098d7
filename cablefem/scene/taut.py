"""A first guess: a taut string whose tension falls by q with depth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cablefem.scene.bisection import bisected
from cablefem.scene.line import Case, NoLine


@dataclass(frozen=True, slots=True)
class Start:
    """A first guess of a case with n stations."""

    H: np.ndarray  # (n - 1,) [N] horizontal force of the pieces
    points: np.ndarray  # (n, 2) [m]
    s: np.ndarray  # (n,) [m]


def start(case: Case) -> Start | NoLine:
    """A first guess, or why there is none."""
    try:
        H, points, pieces = _taut(case)
    except NoLine as error:
        return error
    s = np.concatenate([[0.0], np.cumsum(pieces)])
    if math.isnan(case.fixed_s[0]):
        s += case.fixed_s[-1] - s[-1]
    return Start(H, points, s)


def _taut(case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """H, points and lengths of pieces; NoLine where the tension does not carry the case."""
    ends = [k for k in (0, len(case.stations) - 1) if case.stations[k].kind == "counterweight"]
    known = case.tie or ((ends[0], case.stations[ends[0]].force) if ends else None)
    if known is None:
        return _of_length(case, float(case.length or 0.0))
    k, T = known
    try:
        return _string(case, T, k)
    except NoLine:
        raise NoLine(f"a tension of {T:.6g} N at {case.stations[k].name} does not carry it") from None


def _of_length(case: Case, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    def excess(log_T: float) -> float:
        try:
            return float(_string(case, math.exp(log_T), None)[2].sum()) - length
        except NoLine:  # too slack
            return math.inf

    try:
        return _string(case, math.exp(bisected(excess, math.log(1e-6 * case.weight * length), math.log(case.EA))), None)
    except ValueError:
        held = np.array([(p.x, p.y) for p in case.stations if not p.is_car])
        reach = float(np.hypot(*np.diff(held, axis=0).T).sum())
        raise NoLine(f"the rope is too short to reach: {length:.6g} m over {reach:.6g} m of chords") from None
    except NoLine:
        raise NoLine(f"{length:.6g} m of rope hang too slack") from None


def _string(case: Case, T: float, k: int | None, rounds: int = 8) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """H, places and lengths of pieces, for tension T at station k or at the mean depth."""
    x, y = (np.array([getattr(p, axis) for p in case.stations]) for axis in "xy")
    cars = np.array([p.is_car for p in case.stations])
    load = np.array([p.force if p.is_car else 0.0 for p in case.stations])
    chord = np.interp(x, x[~cars], y[~cars])
    run = np.diff(x)
    H = np.full(run.size, T)
    depth = chord
    for _ in range(rounds):
        w = case.weight * np.hypot(1.0, np.diff(depth) / run)
        K = np.diag(np.append(H / run, 0.0) + np.append(0.0, H / run)) - np.diag(H / run, 1) - np.diag(H / run, -1)
        b = load + 0.5 * (np.append(w * run, 0.0) + np.append(0.0, w * run))
        depth = np.where(cars, 0.0, chord)
        depth[cars] = np.linalg.solve(K[np.ix_(cars, cars)], (b - K @ depth)[cars])
        level = depth.mean() if k is None else depth[k]
        N = T + case.weight * (level - 0.5 * (depth[:-1] + depth[1:]) - w * run**2 / (12.0 * H))
        if N.min() <= 0.0:
            raise NoLine("")
        H = N * run / np.hypot(run, np.diff(depth))
    arc = np.hypot(run, np.diff(depth)) + (w / H) ** 2 * run**3 / 24.0
    return H, np.stack([x, depth], axis=1), arc / (1.0 + N / case.EA) / case.heat
