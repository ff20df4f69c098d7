"""The loaded cable at rest, over l and H: two pieces with N = T + alpha eps, T of the empty cable."""

import math
from dataclasses import dataclass

import numpy as np

from cablefem.scene.drive import FARTHEST_END, NEAREST_START

# nodes of a load path; Gauss points a side, for an error of 3e-8 l
NODES = 160
POINTS = 24
ITERATIONS = 60  # of Newton's method, and for the direction of a rolling car


class NoRest(ArithmeticError):
    """The loaded cable at rest was not found."""


@dataclass(frozen=True)
class Rest:
    """The loaded cable at rest with the car at s; arrays (n,) or (n, 2), y down."""

    s: np.ndarray
    left: np.ndarray  # N r'/lam at the left support
    jump: np.ndarray  # at the car, ahead minus behind
    place: np.ndarray  # P
    behind: np.ndarray  # tension
    ahead: np.ndarray
    slope_behind: np.ndarray  # r' at the car
    slope_ahead: np.ndarray
    along: np.ndarray  # P' = dP/ds
    bend: np.ndarray  # P''
    hold: np.ndarray  # Pi' = [N lam - W], of grip or friction
    haul: np.ndarray  # of the rope, along the mean tangent

    @property
    def stretch(self) -> np.ndarray:
        """<lam>, mean of both sides."""
        return 0.5 * (np.linalg.norm(self.slope_behind, axis=1) + np.linalg.norm(self.slope_ahead, axis=1))


def nodes(nearest: float | None = None) -> np.ndarray:
    """Places for a load path, uniform in log(s/(1 - s)), up to `nearest` of both supports."""
    near, far = (0.5 * NEAREST_START, 0.5 * (1.0 - FARTHEST_END)) if nearest is None else (nearest, nearest)
    y = np.linspace(math.log(near), -math.log(far), NODES if nearest is None else 2 * NODES)
    return 1.0 / (1.0 + np.exp(-y))


def gripped(s, groups) -> Rest:
    """The rest of a car that grips."""
    s = np.atleast_1d(np.asarray(s, dtype=float))
    x = _Pieces(s, np.array([0.0, -groups.mu * groups.sigma]) * np.ones((s.size, 1)), groups)
    (_, r0, D0, ds0), (_, r1, D1, ds1) = x.sides
    A = x.moments()[1]
    z = -np.linalg.solve(A, (r0 - r1)[..., None])[..., 0]  # d(left)/ds
    bent = ds0 - ds1 + 2.0 * _times(D0 - D1, z) + x.second(z)
    zz = -np.linalg.solve(A, bent[..., None])[..., 0]
    place, B = x.moments(x.behind)
    bend = ds0 + 2.0 * _times(D0, z) + x.second(z, x.behind) + _times(B, zz)
    return x.rest(place, r0 + _times(B, z), bend, np.zeros_like(s))


def hauled(s, groups) -> Rest:
    """Rest of a car that rolls, hangs on a rope along the mean tangent tau, and is about to move on.

    haul = rub - mu sigma tau_y, rub = mu_r mu sigma |tau_x| |<r'>|/<lam>, by iteration. P' is that of a spline.
    """
    from scipy.interpolate import CubicSpline

    s = np.atleast_1d(np.asarray(s, dtype=float))
    weight = groups.mu * groups.sigma
    x = None
    tau = np.stack(groups.static(s)[1:3], -1)
    rub = np.zeros_like(s)
    for _ in range(ITERATIONS):
        haul = rub - weight * tau[:, 1]
        jump = [0.0, -weight] - haul[:, None] * tau
        x = _Pieces(s, jump, groups, None if x is None else x.left)
        (_, r0, _, _), (_, r1, _, _) = x.sides
        before = tau
        mean = np.linalg.norm(r0 + r1, axis=1)
        tau = (r0 + r1) / mean[:, None]
        stretch = np.linalg.norm(r0, axis=1) + np.linalg.norm(r1, axis=1)
        rub = groups.drive.mu_r * weight * np.abs(tau[:, 0]) * mean / stretch
        if np.max(np.abs(tau - before)) <= 1e-12:
            break
    else:
        raise NoRest("the direction of the rope that holds the car was not found")
    place = x.moments(x.behind)[0]
    path = CubicSpline(s, place) if s.size > 3 else lambda s, n: np.full((s.size, 2), np.nan)
    return x.rest(place, path(s, 1), path(s, 2), haul)


class _Pieces:
    """int lam n/N ds = (span, drop) for n = left - (0, sigma s), plus the jump ahead of the car.

    lam/N = q/N + 1/alpha, q = 1 - T/alpha.  Newton steps minimise int (q N + N^2/(2 alpha)) ds - left.(span, drop).
    """

    def __init__(self, s: np.ndarray, jump: np.ndarray, groups, left: np.ndarray | None = None) -> None:
        x, w = np.polynomial.legendre.leggauss(POINTS)
        x = 0.5 * (1.0 + x)
        w = 0.5 * w
        self.s = s
        self.jump = jump
        self.alpha = groups.alpha
        points = np.concatenate([s[:, None] * x, s[:, None] + (1.0 - s[:, None]) * x], axis=1)
        self.weights = np.concatenate([s[:, None] * w, (1.0 - s[:, None]) * w], axis=1)
        self.behind = np.arange(2 * POINTS) < POINTS
        self.load = np.where(self.behind, 0.0, jump.T[:, :, None])  # n - left: (2, n, points)
        self.load[1] -= groups.sigma * points
        self.q = 1.0 - groups.static(points)[0] / self.alpha
        ends = np.stack(groups.shape(1.0))
        if left is None:  # direction of the empty cable, tension guessed
            left = np.stack([np.full_like(s, math.sqrt(1.0 + 0.5 * groups.mu)), groups.c - jump[:, 1] * (1.0 - s)], -1)
        self.left = left
        for _ in range(ITERATIONS):
            g, A = self.moments()
            dz = np.linalg.solve(A, (ends - g)[..., None])[..., 0]
            size = np.linalg.norm(dz, axis=1) / (1.0 + np.linalg.norm(self.left, axis=1))
            if np.any(size > 1e-4):  # nearer, full steps are safe
                here = self.left
                slope = ((ends - g) * dz).sum(1)
                step = np.ones_like(s)
                for _ in range(ITERATIONS):
                    self.left = here + step[:, None] * dz
                    uphill = ((self.moments()[0] - ends) * dz).sum(1) > 0.5 * slope
                    if not uphill.any():
                        break
                    step = np.where(uphill, 0.5 * step, step)
                self.left = here
                dz *= step[:, None]
            self.left = self.left + dz
            if np.all(size <= 1e-9):  # rounding next
                break
        else:
            raise NoRest(f"the cable at rest under the car was not found at s_o = {s[np.argmax(size)]:.4g}")
        self.sides = []  # each: N, r', dr'/dn, dr'/ds at constant left
        self.T = T = groups.static(s)[0]
        dT = -groups.sigma * (groups.c - groups.sigma * s) / T
        q = 1.0 - T / self.alpha
        behind = self.left - np.stack([np.zeros_like(s), groups.sigma * s], -1)
        for n in (behind, behind + jump):
            N = np.linalg.norm(n, axis=1)
            e = n / N[:, None]
            f = q / N + 1.0 / self.alpha
            D = f[:, None, None] * np.eye(2) - (q / N)[:, None, None] * e[:, :, None] * e[:, None, :]
            ds = -groups.sigma * D[:, :, 1] - (dT / self.alpha)[:, None] * e
            self.sides.append((N, f[:, None] * n, D, ds))

    def rest(self, place: np.ndarray, along: np.ndarray, bend: np.ndarray, haul: np.ndarray) -> Rest:
        (N0, r0, _, _), (N1, r1, _, _) = self.sides
        hold = N1 - N0 + ((N1 - self.T) ** 2 - (N0 - self.T) ** 2) / (2.0 * self.alpha)
        return Rest(self.s, self.left, self.jump, place, N0, N1, r0, r1, along, bend, hold, haul)

    def moments(self, part=slice(None)) -> tuple[np.ndarray, np.ndarray]:
        """int r' and int dr'/dn over some points: (n, 2), (n, 2, 2)."""
        nx, ny = self.left.T[:, :, None] + self.load[:, :, part]
        w = self.weights[:, part]
        n2 = nx * nx + ny * ny
        i1 = w * self.q[:, part] / np.sqrt(n2)
        i3 = i1 / n2
        one = w.sum(1) / self.alpha
        g = np.stack([(v * (i1 + w / self.alpha)).sum(1) for v in (nx, ny)], -1)
        xy = -(i3 * nx * ny).sum(1)
        A = np.stack([(i3 * ny * ny).sum(1) + one, xy, xy, (i3 * nx * nx).sum(1) + one], -1)
        return g, A.reshape(-1, 2, 2)

    def second(self, z: np.ndarray, part=slice(None)) -> np.ndarray:
        """int d2r'/dn^2 [z, z] over some points: (n, 2)."""
        n = np.moveaxis(self.left.T[:, :, None] + self.load[:, :, part], 0, -1)
        N = np.linalg.norm(n, axis=-1)[..., None]
        nz = n @ z[:, :, None]
        w = (self.weights[:, part] * self.q[:, part])[..., None] / N**3
        return (w * (-2.0 * nz * z[:, None] - (z**2).sum(1)[:, None, None] * n + 3.0 * nz**2 * n / N**2)).sum(1)


def _times(B: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (B @ y[..., None])[..., 0]
