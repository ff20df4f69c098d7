"""The loaded cable at rest, over l and H: two pieces with N = T + alpha eps, T of the empty cable."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.scene.drive import FARTHEST_END, NEAREST_START

if TYPE_CHECKING:
    from cablefem.scene.scene import Groups

NODES = 160  # of a load path, for each panel
POINTS = 24  # of Gauss a side, for each panel: for an error of 3e-8 l
ITERATIONS = 60  # of Newton's method, and for the direction of a rolling car


class NoRest(ArithmeticError):
    """The loaded cable at rest was not found."""


@dataclass(frozen=True)
class Rest:
    """The loaded cable at rest with the car at s; arrays (n,) or (n, 2), y down."""

    s: np.ndarray
    left_force: np.ndarray  # N r'/lam at the left support
    jump: np.ndarray  # at the car, ahead minus behind
    car_point: np.ndarray  # P, (x, y) of the car
    behind: np.ndarray  # tension
    ahead: np.ndarray
    slope_behind: np.ndarray  # r' at the car
    slope_ahead: np.ndarray
    along: np.ndarray  # P' = dP/ds
    bend: np.ndarray  # P''
    hold: np.ndarray  # Pi' = [N lam - W], of grip or friction
    haul: np.ndarray  # of the rope, along the mean tangent

    @property
    def mean_stretch_at_car(self) -> np.ndarray:
        """<lam> at the car, mean of both sides."""
        behind = np.linalg.norm(self.slope_behind, axis=1)
        ahead = np.linalg.norm(self.slope_ahead, axis=1)
        return 0.5 * (behind + ahead)


def _panel_count(sigma: float) -> int:
    """Number of panels: one up to sag/span 0.8; a deeper cable bends more sharply, within 1/sigma of its length."""
    panel = 5.4  # [-] sigma of a panel: by how much y'/x' of the empty cable may change over it
    return math.ceil(sigma / panel)


def load_path_positions(sigma: float, nearest_to_supports: float | None = None) -> np.ndarray:
    """Positions s of a load path, uniform in log(s/(1 - s)); `nearest_to_supports`: distance of the first and last."""
    nodes = NODES * _panel_count(sigma)
    begin = 0.5 * NEAREST_START
    end = 0.5 * (1.0 - FARTHEST_END)
    if nearest_to_supports is not None:
        begin = end = nearest_to_supports
        nodes = 2 * nodes
    y = np.linspace(math.log(begin), -math.log(end), nodes)
    return 1.0 / (1.0 + np.exp(-y))


def gripped_rest(s: Any, groups: Groups) -> Rest:
    """The rest of a car that grips at s (n,)."""
    s = np.atleast_1d(np.asarray(s, dtype=float))
    weight = np.tile([0.0, -groups.mu * groups.sigma], (s.size, 1))
    x = _TwoPieceStatics(s, weight, groups)
    behind, ahead = x.sides
    _, A = x.spans_and_derivatives_by_force()
    z = -_solve_each(A, behind.slope - ahead.slope)  # d(left)/ds (n, 2)
    jump = behind.by_s - ahead.by_s + 2.0 * _multiply_each(behind.by_n - ahead.by_n, z)
    zz = -_solve_each(A, jump + x.second_derivative_integral(z))  # d2(left)/ds2 (n, 2)
    point, B = x.spans_and_derivatives_by_force(x.behind)
    along = behind.slope + _multiply_each(B, z)
    bend = (
        behind.by_s
        + 2.0 * _multiply_each(behind.by_n, z)
        + x.second_derivative_integral(z, x.behind)
        + _multiply_each(B, zz)
    )
    return x.rest_with_path(point, along, bend, np.zeros_like(s))


def hauled_rest(s: Any, groups: Groups) -> Rest:
    """Rest of a car that rolls, hangs on a rope along the mean tangent tau, and is about to move on.

    haul = friction - mu sigma tau_y, friction = mu_r mu sigma |tau_x| |<r'>|/<lam>, by iteration.
    P' is that of a spline.  Raises NoRest without convergence.
    """
    from scipy.interpolate import CubicSpline

    s = np.atleast_1d(np.asarray(s, dtype=float))
    weight = groups.mu * groups.sigma
    left_force = None
    tau = np.stack(groups.tension_and_slope(s)[1:], -1)  # (n, 2)
    friction = np.zeros_like(s)
    for _ in range(ITERATIONS):
        haul = friction - weight * tau[:, 1]
        x = _TwoPieceStatics(s, [0.0, -weight] - haul[:, None] * tau, groups, left_force)
        left_force = x.left_force
        before = tau
        behind, ahead = x.sides
        mean = np.linalg.norm(behind.slope + ahead.slope, axis=1)
        tau = (behind.slope + ahead.slope) / mean[:, None]
        stretch = np.linalg.norm(behind.slope, axis=1) + np.linalg.norm(ahead.slope, axis=1)
        friction = groups.drive.mu_r * weight * np.abs(tau[:, 0]) * mean / stretch
        if np.max(np.abs(tau - before)) <= 1e-12:
            break
    else:
        raise NoRest("no direction of the rope that holds the car was found")
    point, _ = x.spans_and_derivatives_by_force(x.behind)
    if s.size <= 3:
        unknown = np.full((s.size, 2), np.nan)
        return x.rest_with_path(point, unknown, unknown, haul)
    path = CubicSpline(s, point)
    return x.rest_with_path(point, path(s, 1), path(s, 2), haul)


@dataclass(frozen=True, slots=True)
class _Side:
    """The cable at the car, on one side of it."""

    N: np.ndarray  # (n,) tension
    slope: np.ndarray  # (n, 2) r'
    by_n: np.ndarray  # (n, 2, 2) dr'/dn
    by_s: np.ndarray  # (n, 2) dr'/ds at constant left


class _TwoPieceStatics:
    """int lam n/N ds = (span, drop) for n = left - (0, sigma s), plus the jump ahead of the car.

    lam/N = q/N + 1/alpha, q = 1 - T/alpha.  Newton steps minimise int (q N + N^2/(2 alpha)) ds - left.(span, drop).
    """

    def __init__(self, s: np.ndarray, jump: np.ndarray, groups: Groups, left_force: np.ndarray | None = None) -> None:
        x, w = _gauss_rule(groups.sigma)
        at = s[:, None]
        rest = 1.0 - at
        self.s = s
        self.jump = jump
        self.alpha = groups.alpha
        points = np.concatenate([at * x, at + rest * x], axis=1)  # (n, points)
        self.weights = np.concatenate([at * w, rest * w], axis=1)
        self.behind = np.arange(2 * x.size) < x.size
        self.load = np.where(self.behind, 0.0, jump.T[:, :, None])  # n - left: (2, n, points)
        self.load[1] -= groups.sigma * points
        self.q = 1.0 - groups.static_tension(points) / self.alpha
        ends = np.stack(groups.coordinates(1.0))
        if left_force is None:  # direction of the empty cable, tension guessed
            horizontal = np.full_like(s, math.sqrt(1.0 + 0.5 * groups.mu))
            left_force = np.stack([horizontal, groups.c - jump[:, 1] * (1.0 - s)], -1)
        self.left_force = left_force
        for _ in range(ITERATIONS):
            g, A = self.spans_and_derivatives_by_force()
            dz = _solve_each(A, ends - g)
            size = np.linalg.norm(dz, axis=1) / (1.0 + np.linalg.norm(self.left_force, axis=1))
            if np.any(size > 1e-4):  # nearer, full steps are safe
                dz *= self._downhill_step_lengths(dz, ends, g)[:, None]
            self.left_force = self.left_force + dz
            if np.all(size <= 1e-9):  # rounding next
                break
        else:
            raise NoRest(f"no cable at rest under the car was found at s_o = {s[np.argmax(size)]:.4g}")
        self.T = groups.static_tension(s)
        behind = self.left_force - np.stack([np.zeros_like(s), groups.sigma * s], -1)
        self.sides = self._car_side(behind, groups), self._car_side(behind + jump, groups)

    def _downhill_step_lengths(self, dz: np.ndarray, ends: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Step (n,) along dz, halved while the integral that Newton's method minimises still rises."""
        start = self.left_force
        slope = ((ends - g) * dz).sum(1)
        step = np.ones_like(self.s)
        for _ in range(ITERATIONS):
            self.left_force = start + step[:, None] * dz
            uphill = ((self.spans_and_derivatives_by_force()[0] - ends) * dz).sum(1) > 0.5 * slope
            if not uphill.any():
                break
            step = np.where(uphill, 0.5 * step, step)
        self.left_force = start
        return step

    def _car_side(self, n: np.ndarray, groups: Groups) -> _Side:
        """The cable at the car, from its force n (n, 2)."""
        dT = -groups.sigma * (groups.c - groups.sigma * self.s) / self.T
        N = np.linalg.norm(n, axis=1)
        e = n / N[:, None]
        q = (1.0 - self.T / self.alpha) / N
        f = q + 1.0 / self.alpha
        of_direction = q[:, None, None] * e[:, :, None] * e[:, None, :]
        by_n = f[:, None, None] * np.eye(2) - of_direction
        by_s = -groups.sigma * by_n[:, :, 1] - (dT / self.alpha)[:, None] * e
        return _Side(N, f[:, None] * n, by_n, by_s)

    def rest_with_path(self, point: np.ndarray, along: np.ndarray, bend: np.ndarray, haul: np.ndarray) -> Rest:
        """The state of rest, with P, P', P'' and the haul force."""
        behind, ahead = self.sides
        N0 = behind.N
        N1 = ahead.N
        hold = N1 - N0 + ((N1 - self.T) ** 2 - (N0 - self.T) ** 2) / (2.0 * self.alpha)
        sides = (N0, N1, behind.slope, ahead.slope)
        return Rest(self.s, self.left_force, self.jump, point, *sides, along, bend, hold, haul)

    def spans_and_derivatives_by_force(self, points: Any = slice(None)) -> tuple[np.ndarray, np.ndarray]:
        """int r' and int dr'/dn over some points: (n, 2), (n, 2, 2)."""
        nx, ny = self.left_force.T[:, :, None] + self.load[:, :, points]
        w = self.weights[:, points]
        n2 = nx * nx + ny * ny
        i1 = w * self.q[:, points] / np.sqrt(n2)
        i3 = i1 / n2
        one = w.sum(1) / self.alpha
        f = i1 + w / self.alpha
        g = np.stack([(f * nx).sum(1), (f * ny).sum(1)], -1)
        xx = (i3 * ny * ny).sum(1) + one
        xy = -(i3 * nx * ny).sum(1)
        yy = (i3 * nx * nx).sum(1) + one
        return g, np.stack([xx, xy, xy, yy], -1).reshape(-1, 2, 2)

    def second_derivative_integral(self, z: np.ndarray, points: Any = slice(None)) -> np.ndarray:
        """int d2r'/dn^2 [z, z] over some points: (n, 2)."""
        forces = self.left_force.T[:, :, None] + self.load[:, :, points]
        n = np.moveaxis(forces, 0, -1)  # (n, points, 2)
        N = np.linalg.norm(n, axis=-1)[..., None]
        nz = n @ z[:, :, None]  # (n, points, 1)
        z2 = (z**2).sum(1)[:, None, None]
        wq = self.weights[:, points] * self.q[:, points]
        w = wq[..., None] / N**3
        along_z = -2.0 * nz * z[:, None]
        along_n = (3.0 * nz**2 / N**2 - z2) * n
        return (w * (along_z + along_n)).sum(1)


def _gauss_rule(sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights on [0, 1], Gauss's on equal panels.

    1/N has poles at about 1/sigma from the cable, so that the error is exp(-2 POINTS asinh(2 panels/sigma)).
    """
    panels = _panel_count(sigma)
    x, w = np.polynomial.legendre.leggauss(POINTS)
    starts = np.arange(panels)[:, None]
    points = (starts + 0.5 * (1.0 + x)) / panels  # (panels, points)
    return points.ravel(), np.tile(0.5 * w / panels, panels)


def _multiply_each(B: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (B @ y[..., None])[..., 0]


def _solve_each(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.linalg.solve(A, y[..., None])[..., 0]
