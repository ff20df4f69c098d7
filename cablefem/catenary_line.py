"""A line at rest by exact elastic catenaries between stations.

A piece of length S has the force N t = (H, P) at its left end and (H, P1), P1 = P - q S, at its right end.
With the means Nm of N, Pm of P at both ends and w = q S/(2 Nm) (Irvine, Cable Structures, 1981):

    dx = H S (1/EA + atanh(w)/(w Nm)),   dy = Pm S (1/EA + 1/Nm),   both times 1 + a dT.

A saddle has one tension; at a counterweight it is G. At a gripping car N t jumps by -Mg j, at a hauled one by
-Mg (j - tau tau_y), tau along the sum of both forces, and F = -Mg tau_y.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cablefem.scene.line import Case, LineNotConverged, LineState, NoLineAtRest, Station
from cablefem.scene.taut import first_guess

STEPS = 100  # of Newton's method
LAST = 1e-8  # step over the size of the unknowns; the remaining error is about its square


def _vector_lengths(vectors: np.ndarray) -> np.ndarray:
    """Lengths (..., m) of vectors (..., 2, m), also complex ones."""
    return np.sqrt(vectors[..., 0, :] ** 2 + vectors[..., 1, :] ** 2)


def piece_chord_vectors(left_forces: np.ndarray, lengths: np.ndarray, case: Case) -> np.ndarray:
    """(dx, dy) of pieces (k, 2, m) with forces N t (k, 2, m) at their left ends and lengths S (k, m)."""
    right_forces = _right_end_forces(left_forces, lengths, case)
    N = 0.5 * (_vector_lengths(left_forces) + _vector_lengths(right_forces))  # (k, m)
    w = 0.5 * case.weight * lengths / N
    small = np.abs(w) < 1e-3
    series = 1.0 + w**2 / 3.0 + w**4 / 5.0
    ratio = np.where(small, series, np.arctanh(w) / np.where(small, 1.0, w))  # atanh(w)/w
    middle = 0.5 * (left_forces + right_forces)
    ratios = np.stack([ratio, np.ones_like(ratio)], axis=1)  # of dx and dy (k, 2, m)
    compliance = 1.0 / case.EA + ratios / N[:, None]
    return case.thermal_stretch * lengths[:, None] * middle * compliance


def _right_end_forces(left_forces: np.ndarray, lengths: np.ndarray, case: Case) -> np.ndarray:
    """Forces N t (k, 2, m) at the right ends of pieces, from those at the left ends."""
    H, P = left_forces[:, 0], left_forces[:, 1]
    return np.stack([H, P - case.weight * lengths], axis=1)


class _Stations(NamedTuple):
    """Stations of a line for m sets of unknowns."""

    behind: np.ndarray  # (n, 2, m) force [N]
    ahead: np.ndarray  # (n, 2, m)
    s: np.ndarray  # (n, m) [m]
    points: np.ndarray  # (n, 2, m) [m]


class _CatenaryProblem:
    def __init__(self, case: Case) -> None:
        self.case = case
        self.count = len(case.stations) - 1
        self.s = case.s_or_nan
        self.points = case.points_or_nan
        self.free_s = np.isnan(self.s)
        self.free_points = np.isnan(self.points)
        first = first_guess(case)
        if isinstance(first, NoLineAtRest):
            raise first
        H = first.H
        points = first.points
        s = first.s
        self.H = float(H.mean())
        self.reach = float(np.ptp(points[:, 0]))
        chord = np.diff(points, axis=0)
        force = H[:, None] * chord / chord[:, :1]
        force[:, 1] += 0.5 * case.weight * np.diff(s)
        self.X = np.concatenate([force.ravel(), s[self.free_s], points[self.free_points]])
        self.size = np.where(np.arange(self.X.size) < force.size, self.H, self.reach)

    def stations_of_unknowns(self, X: np.ndarray) -> _Stations:
        """The stations for unknowns X (k, m)."""
        m = X.shape[1]
        forces, s_and_points = np.split(X, [2 * self.count])
        free_s, free_points = np.split(s_and_points, [int(self.free_s.sum())])
        s = np.repeat(self.s[:, None], m, axis=1).astype(X.dtype)
        points = np.repeat(self.points[:, :, None], m, axis=2).astype(X.dtype)
        s[self.free_s] = free_s
        points[self.free_points] = free_points
        left_forces = forces.reshape(self.count, 2, m)
        right_forces = _right_end_forces(left_forces, np.diff(s, axis=0), self.case)
        none = np.zeros((1, 2, m))
        behind = np.concatenate([none, right_forces])
        ahead = np.concatenate([left_forces, none])
        return _Stations(behind, ahead, s, points)

    def residual(self, X: np.ndarray) -> np.ndarray:
        """Residual for X (k, m); lengths over the reach, forces over H."""
        behind, ahead, s, points = self.stations_of_unknowns(X)
        chords = piece_chord_vectors(ahead[:-1], np.diff(s, axis=0), self.case)
        gaps = np.diff(points, axis=0) - chords  # (count, 2, m)
        rows = [gaps.reshape(2 * self.count, -1) / self.reach]
        for k, station in enumerate(self.case.stations):
            rows.append(_station_residuals(station, behind[k], ahead[k], points[k]) / self.H)
        if self.case.prescribed_tension is not None:
            k, tension = self.case.prescribed_tension
            force = ahead[k] if k < self.count else behind[k]
            rows.append((_vector_lengths(force) - tension)[None] / self.H)
        return np.concatenate(rows)

    def line_state(self, X: np.ndarray) -> LineState:
        """The line at rest for the solution X (k,)."""
        behind, ahead, s, points = (part[..., 0] for part in self.stations_of_unknowns(X[:, None]))
        half_chords = piece_chord_vectors(ahead[:-1, :, None], 0.5 * np.diff(s)[:, None], self.case)
        middle = points[:-1] + half_chords[..., 0]
        behind[0] = ahead[-1] = np.nan
        weights = np.array([p.force if p.kind == "hauled" else np.nan for p in self.case.stations])
        haul = -weights * _mean_tangent(behind.T, ahead.T)[1]
        return LineState(self.case, s, points, behind, ahead, haul, middle)


def _station_residuals(p: Station, behind: np.ndarray, ahead: np.ndarray, points: np.ndarray) -> np.ndarray:
    """What the equations (0 to 2, m) of a station leave [N]."""
    if p.kind == "counterweight":  # one force is zero
        return (_vector_lengths(ahead + behind) - p.force)[None]
    if p.kind == "saddle":
        return (_vector_lengths(ahead) - _vector_lengths(behind))[None]
    if p.kind == "anchor":
        return np.empty((0, points.shape[-1]))
    jump = ahead - behind
    if p.stiffness is not None:
        stretch = points - np.array([[p.x], [p.y]])
        return jump - np.array(p.stiffness)[:, None] * stretch
    weight = np.array([[0.0], [p.force]])
    if p.kind == "grips":
        return jump + weight
    tau = _mean_tangent(behind, ahead)
    return jump + weight - p.force * tau[1] * tau


def _mean_tangent(behind: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    both = behind + ahead
    return both / _vector_lengths(both)


@np.errstate(divide="ignore", invalid="ignore")  # of a trial in which a piece hangs plumb, w = 1: it is refused
def _solve_by_newton(problem: _CatenaryProblem, extra_newton_steps: int) -> np.ndarray:
    """Unknowns by damped Newton steps and `extra_newton_steps`; LineNotConverged without convergence."""
    # complex-step differentiation
    X = problem.X
    remaining_steps = extra_newton_steps + 1
    tiny = 1e-30
    smallest_factor = 1e-3  # of damping
    for _ in range(STEPS):
        r = problem.residual(X[:, None])[:, 0]
        shifted = X[:, None] + 1j * tiny * np.diag(problem.size)
        tangent = problem.residual(shifted).imag / tiny
        try:
            step = -np.linalg.solve(tangent, r) * problem.size
        except np.linalg.LinAlgError:
            break
        large = float(np.max(np.abs(step / problem.size)))
        if not np.isfinite(large):
            break
        fraction = 1.0
        while not _is_ordered_and_improved(problem, X + fraction * step, r, near=large < 1e-4):
            fraction *= 0.5
            if fraction < smallest_factor:  # the residual falls no further
                raise LineNotConverged("no state of rest was found")
        X = X + fraction * step
        remaining_steps -= large < LAST
        if remaining_steps == 0:
            return X
    raise LineNotConverged("no state of rest was found")


def _is_ordered_and_improved(problem: _CatenaryProblem, X: np.ndarray, residual_before: np.ndarray, near: bool) -> bool:
    """Whether the stations are in order, and the residual is smaller than before or the solution is `near`."""
    s = problem.stations_of_unknowns(X[:, None]).s
    if not np.all(np.diff(s, axis=0) > 0.0):
        return False
    return near or bool(np.linalg.norm(problem.residual(X[:, None])) < np.linalg.norm(residual_before))


def _solve_case(case: Case, extra_newton_steps: int) -> LineState | NoLineAtRest:
    try:
        problem = _CatenaryProblem(case)
        return problem.line_state(_solve_by_newton(problem, extra_newton_steps))
    except NoLineAtRest as error:
        return error


def solve(cases: Sequence[Case], extra_newton_steps: int = 0) -> list[LineState | NoLineAtRest]:
    """Each case at rest; `extra_newton_steps` : Newton steps beyond convergence."""
    return [_solve_case(case, extra_newton_steps) for case in cases]


def depth_and_tension_at_x(state: LineState, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depth [m] and tension [N] at x (m,) [m]."""
    case = state.case
    piece = np.clip(np.searchsorted(state.points[:, 0], x, side="right") - 1, 0, len(state.s) - 2)
    x_start, y_start = state.points[piece].T
    left_forces = state.ahead[piece]  # (m, 2)
    H, P = left_forces.T
    run = np.diff(state.points[:, 0])[piece]
    S = np.diff(state.s)[piece] * (x - x_start) / run  # from the left ends to x, at first by proportion
    for _ in range(STEPS):  # three steps do
        chord = piece_chord_vectors(left_forces[:, :, None], S[:, None], case)[..., 0]
        N = np.hypot(H, P - case.weight * S)
        x_per_S = case.thermal_stretch * H * (1.0 / N + 1.0 / case.EA)
        off = (x - x_start - chord[:, 0]) / x_per_S
        S = S + off
        if np.abs(off).max(initial=0.0) < LAST:
            break
    return y_start + chord[:, 1], N


def min_tension(state: LineState) -> float:
    """Smallest tension [N]: where the rope is level, or at a station."""
    H, P = state.ahead[:-1].T  # (n - 1,)
    weight = state.case.weight
    level = np.clip(P / weight, 0.0, np.diff(state.s))
    return float(np.hypot(H, P - weight * level).min())


def piece_points_nearest_to_slope(state: LineState, slope: float) -> np.ndarray:
    """Points (n - 1, 2) [m] of the pieces where the rope has a slope dy/dx, or their ends nearest to it."""
    left_forces = state.ahead[:-1]  # (n - 1, 2)
    H, P = left_forces.T
    S = np.clip((P - H * slope) / state.case.weight, 0.0, np.diff(state.s))
    chords = piece_chord_vectors(left_forces[:, :, None], S[:, None], state.case)
    return state.points[:-1] + chords[..., 0]


def sag_between_stations(state: LineState, first: int, last: int) -> float:
    """Largest vertical distance [m] of the rope below the chord of two stations."""
    dx, dy = state.points[last] - state.points[first]
    lowest = piece_points_nearest_to_slope(state, dy / dx)[first:last]  # (last - first, 2)
    run, depth = (lowest - state.points[first]).T
    return float(np.max(depth - run * dy / dx))


def min_rope_clearance(state: LineState, ground: np.ndarray) -> float:
    """Smallest height [m] of the rope over the ground (m, 2) [m] of points x, depth, linear between them.

    The rope sags between stations: it is nearest where it is parallel to the ground, at a corner or at an end.
    """
    x, depth = ground.T
    x_rope = state.points[:, 0]
    parallel = [piece_points_nearest_to_slope(state, slope)[:, 0] for slope in np.diff(depth) / np.diff(x)]
    candidates = np.concatenate([x, x_rope[[0, -1]], *parallel])
    first = max(x[0], x_rope[0])
    last = min(x[-1], x_rope[-1])
    candidates = candidates[(candidates >= first) & (candidates <= last)]
    rope_depth, _ = depth_and_tension_at_x(state, candidates)
    heights = np.interp(candidates, x, depth) - rope_depth
    return float(np.min(heights, initial=np.inf))
