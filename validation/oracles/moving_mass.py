"""A mass with any travel below (or above) the wave speed on a taut string, with all reflections.

    v_tt - v_xx = R(t) delta(x - xi(t)),  v(0, t) = v(1, t) = 0,  at rest for t <= 0,
    mu y'' = mu sigma - R,  y(t) = v(xi(t), t),  y(0) = y'(0) = 0.

v = f(t+x) - f(t-x) behind the mass, v = g(t-x) - g(t+x-2) ahead of it.
With A = t - xi, B = t + xi, F(t) = f(B), G(t) = g(A):

    y = F - F(t1) = G - G(t2),   B(t1) = A(t),   A(t2) = B(t) - 2,   F(<0) = G(<0) = 0,              (1)
    y' = sigma t - (2/mu) (y + F(t1) + G(t2)).                                                       (2)

t1, t2: times of sending of the waves now back from the near and far support.
(2) follows from (1 - xi'^2)[v_x] = -R and int R = mu (sigma t - y').

At the far support fronts accumulate at T - t = s, s/Q, s/Q^2, ..., Q = (1+V)/(1-V).
The path ends at a height w0 above it, with R ~ (2 w0/ln Q)/s on average.

Method: collocation of degree 32 in t between arrivals of fronts, in s for the second half.

Limit of a sagging cable for sigma -> 0 at fixed V, mu, alpha: this answer with sigma (1 + V^2).

Source: Smith 1964; Dyniewicz & Bajer 2009
Validity: 0 <= xi <= 1, |xi'| < 1 throughout, or xi' >= 1 throughout (then y = 0)
Accuracy: for mu 0.1 to 20, speeds 0.1 to 0.95, of the maxima: path 1e-13, string 1e-10, R 1e-6
Group: A mass on a taut string
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from cablefem.scene import AccelerateCruiseBrake, ConstantAcceleration, ConstantSpeed, Groups, Motion, Scene
from validation.oracles.case import BEST, MU, SIGMA, Array, Crossing, Error, Limit, Solvers, level, positive

DEGREE = 32
TAIL = 1e-13  # last coefficients over the largest


class MarchStalled(ArithmeticError):
    def __init__(self, t: float, t_end: float, excess: float) -> None:
        self.t, self.t_end, self.excess = t, t_end, excess
        super().__init__(
            f"the march stalled at t = {t:.6g} of {t_end:.6g}: the last coefficients of its shortest step are "
            f"{excess:.2g} times what is allowed; is the acceleration of the travel given all its breaks?"
        )


@dataclass(frozen=True, slots=True)
class Travel:
    """Place of the mass for 0 <= t <= t_end."""

    position: Callable[[Array], Array]  # xi(t)
    speed: Callable[[Array], Array]  # xi'(t)
    t_end: float  # usually xi(t_end) = 1
    breaks: tuple[float, ...] = ()  # jumps of acceleration

    def to_go(self, s: Array) -> Array:
        """1 - xi(t_end - s), without cancellation as s -> 0."""
        s = np.asarray(s, float)
        near = min(0.1, self.t_end - max(self.breaks, default=0.0))
        left = 1.0 - float(self.position(np.array([self.t_end]))[0])
        rest = left if abs(left) > 1e-12 else 0.0
        short = rest + s * (self.speed(self.t_end - np.minimum(s, near)[..., None] * _GAUSS_X) @ _GAUSS_W)
        return np.where(s <= near, short, 1.0 - self.position(self.t_end - s))


_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(20)
_GAUSS_X, _GAUSS_W = 0.5 * (1.0 + _GAUSS_X), 0.5 * _GAUSS_W


def constant_speed(V: float) -> Travel:
    positive(speed=V)
    return Travel(lambda t: V * t, lambda t: np.full(np.shape(t), V), 1.0 / V)


def travel_of(motion: Motion) -> Travel:
    starts = sorted({piece.start for pieces in motion.pieces for piece in pieces})
    return Travel(motion.position, motion.speed, motion.phases[-1][1], tuple(starts[1:]))


def solve(travel: Travel, *, mu: float, sigma: float, reach: float = 1e-3) -> Ride | SupersonicRide:
    """March (1), (2) along the travel.

    reach : distance to the far support at which the march ends if the mass comes to rest there.
    Raises ValueError outside the validity, MarchStalled where the travel is not smooth between its breaks.
    """
    positive(mu=mu, sigma=sigma, reach=reach, t_end=travel.t_end)
    edges = np.array([0.0, *sorted(travel.breaks), travel.t_end])
    if not np.all(np.diff(edges) > 0.0):
        raise ValueError(f"breaks must lie inside (0, t_end), each once, got {travel.breaks!r}")
    t = np.concatenate([np.linspace(a, b, 257) for a, b in pairwise(edges)])
    xi, speed = travel.position(t), travel.speed(t)
    if not (np.all(xi >= -1e-12) and np.all(xi <= 1.0 + 1e-12)):
        raise ValueError(f"the travel leaves the string: position from {xi.min()!r} to {xi.max()!r}")
    if np.all(speed >= 1.0):
        return SupersonicRide(mu * sigma)
    if not np.all(np.abs(speed) < 1.0):
        raise ValueError(f"the travel passes through the wave speed 1: speed from {speed.min()!r} to {speed.max()!r}")
    return _March(travel, mu, sigma).run(reach)


# --- the march

_X = -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
_K = np.arange(DEGREE + 1)
_TO_COEF = np.linalg.inv(np.cos(_K * np.arccos(_X)[:, None]))  # values -> coefficients
_TO_INTEGRAL = np.stack(  # values -> integrals from -1
    [np.polynomial.chebyshev.chebval(_X, np.polynomial.chebyshev.chebint(c, lbnd=-1.0)) for c in _TO_COEF.T], axis=1
)
_DIFF = np.stack([np.append(np.polynomial.chebyshev.chebder(e), 0.0) for e in np.eye(DEGREE + 1)], axis=1)


def _cheb(x: Array) -> Array:
    return np.cos(_K * np.arccos(np.clip(x, -1.0, 1.0))[:, None])


def _invert(
    value: Callable[[Array], Array], slope: Callable[[Array], Array], target: Array, lo: float, hi: float
) -> Array:
    """Solve value(x) = target on [lo, hi] for increasing value."""
    target = np.asarray(target, float)
    a, b = np.full(target.shape, lo), np.full(target.shape, hi)
    x = np.clip(a + (target - value(a)) / np.maximum(slope(a), 1e-3), a, b)
    for _ in range(100):
        r = value(x) - target
        if np.all(np.abs(r) <= 4e-16 * (np.abs(x) + np.abs(target))):
            break
        a, b = np.where(r <= 0.0, x, a), np.where(r >= 0.0, x, b)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = x - r / slope(x)
        x = np.where((new >= a) & (new <= b), new, 0.5 * (a + b))
    return x


class _Pieces:
    """Piecewise Chebyshev series of (y, F, G) in t or -s."""

    def __init__(self, start: float) -> None:
        self.edge, self.coef, self.n = np.full(65, start), np.zeros((64, 3, DEGREE + 1)), 0

    def append(self, end: float, coef: Array) -> None:
        if self.n == len(self.coef):
            self.edge = np.concatenate([self.edge, np.zeros(self.n)])
            self.coef = np.concatenate([self.coef, np.zeros_like(self.coef)])
        self.coef[self.n] = coef
        self.n += 1
        self.edge[self.n] = end

    def at(self, z: Array, derivative: bool = False) -> Array:
        """(n, 3), from the right at edges."""
        i = np.clip(np.searchsorted(self.edge[: self.n + 1], z, side="right") - 1, 0, self.n - 1)
        a, b = self.edge[i], self.edge[i + 1]
        c = self.coef[i]
        if derivative:
            c = (c @ _DIFF.T) * (2.0 / (b - a))[:, None, None]
        return np.einsum("nfk,nk->nf", c, _cheb(((z - a) - (b - z)) / (b - a)))


class _History:
    """y, F, G so far: first half in t, second in -s."""

    def __init__(self, travel: Travel) -> None:
        self.middle = 0.5 * travel.t_end
        self.early, self.late = _Pieces(0.0), _Pieces(-self.middle)

    def at(self, t: Array, s: Array, derivative: bool = False) -> Array:
        """(n, 3); 0 for t < 0."""
        out = np.zeros((len(t), 3))
        e, l = (t >= 0.0) & (t <= self.middle), t > self.middle
        if e.any():
            out[e] = self.early.at(t[e], derivative)
        if l.any():
            out[l] = self.late.at(-s[l], derivative)
        return out


class _March:
    """t near the start, s = T - t near the end."""

    def __init__(self, travel: Travel, mu: float, sigma: float) -> None:
        self.travel, self.mu, self.sigma, self.past = travel, mu, sigma, _History(travel)
        self.B0 = self.B(np.zeros(1))[0]
        self.zeta0 = travel.t_end - travel.to_go(np.array([travel.t_end]))[0]

    def A(self, s: Array) -> Array:
        return self.travel.t_end - 1.0 - s + self.travel.to_go(s)

    def B(self, t: Array) -> Array:
        return t + self.travel.position(t)

    def back(self, eta: Array) -> Array:
        """t with B(t) = eta."""
        return _invert(self.B, lambda t: 1.0 + self.travel.speed(t), eta, 0.0, self.travel.t_end)

    def ahead(self, zeta: Array) -> Array:
        """s with s - to_go(s) = zeta."""
        go, speed, T = self.travel.to_go, self.travel.speed, self.travel.t_end
        return _invert(lambda s: s - go(s), lambda s: 1.0 - speed(T - s), zeta, 0.0, T)

    def fronts(self, s_last: float) -> tuple[Array, Array]:
        """Arrivals (t, s) of fronts from t = 0 and the breaks, reflected at one support only."""
        travel, T = self.travel, self.travel.t_end
        start = np.array([0.0, *travel.breaks])
        A_last = float(self.A(np.array([s_last]))[0])
        gap_last = s_last + float(travel.to_go(np.array([s_last]))[0])
        all_s = [T - start]
        t = start[self.B(start) > 0.0]
        while (t := t[self.B(t) < A_last]).size:
            s = self.ahead(T - 1.0 - self.B(t))
            all_s.append(s)
            t = T - s
        s = T - start
        while (s := s[(zeta := s - travel.to_go(s)) > gap_last]).size:
            zeta = zeta[zeta > gap_last]
            s = _invert(lambda z: z + travel.to_go(z), lambda z: 1.0 + travel.speed(T - z), zeta, 0.0, T)
            all_s.append(s)
        s = np.sort(np.concatenate(all_s))[::-1]
        return T - s, s

    def _last(self, reach: float) -> float:
        """Least s of the march: 0 short of the far support, else where the mass is still moving, or within reach."""
        travel, T = self.travel, self.travel.t_end
        if float(travel.to_go(np.zeros(1))[0]) != 0.0:
            return 0.0
        if float(travel.speed(np.array([T]))[0]) > 0.0:
            return 1e-16 * T
        return float(_invert(travel.to_go, lambda s: travel.speed(T - s), np.array([reach]), 0.0, T)[0])

    def run(self, reach: float) -> Ride:
        travel, T, past = self.travel, self.travel.t_end, self.past
        s_last = self._last(reach)
        front_t, front_s = self.fronts(s_last)
        scale = 1e-3 * self.sigma * min(0.25 * self.mu, 0.5 * T * T)
        y0 = worst = 0.0
        for late in (False, True):
            pieces = past.late if late else past.early
            stop = -s_last if late else past.middle
            marks = np.append(-front_s[front_s < past.middle] if late else front_t[front_t < past.middle], stop)
            z = pieces.edge[0]
            h = 0.25 * min(self.mu, 1.0)
            while z < stop:
                # fronts ahead, up to rounding
                room = marks[np.searchsorted(marks, z + 1e-13 * abs(z) + (0.0 if late else 1e-15 * T), side="right") :]
                gap = (room[0] if room.size else stop) - z
                h = gap if h > 0.6 * gap else h
                coef, h, scale, tail, excess = self._resolved(y0, z, h, late, scale)
                worst = max(worst, tail / scale)
                end = z + h if h < gap else float(room[0] if room.size else stop)
                pieces.append(end, coef)
                y0 = float(coef[0].sum())
                z = end
                h *= min(2.0, 0.9 * max(excess, 1e-12) ** (-1.0 / DEGREE))
        return Ride(travel, self.mu, self.sigma, T - s_last, y0, worst, self)

    def _resolved(
        self, y0: float, z: float, h: float, late: bool, scale: float
    ) -> tuple[Array, float, float, float, float]:
        """Shorten the step until its last coefficients are small.

        Returns coefficients, step, largest value so far, tail of y, tail over the allowed one.
        """
        T = self.travel.t_end
        first = z == 0.0 and float(self.travel.position(np.zeros(1))[0]) == 0.0
        # G counts 2 s/mu in the path
        slack = min(1e6, max(1.0, min(self.mu, 1.0) / abs(z))) if late else 1.0
        while True:
            coef = self._first_step(h) if first else self._step(y0, z, z + h, late)
            size = max(scale, float(np.abs(coef).max()))
            tail = np.abs(coef[:, -3:]).max(axis=1)
            excess = max(tail[0], tail[1] / slack, tail[2] / slack) / (TAIL * size)
            if excess <= 1.0:
                return coef, h, size, float(tail[0]), excess
            h *= 0.6
            if not h > 1e-6 * (abs(z) if late else T):
                raise MarchStalled(float(T + z if late else z), T, excess)

    def _first_step(self, h: float) -> Array:
        """(y, F, G) (3, DEGREE+1) on [0, h] from the support, before any front.

        G = y, F = (mu/2)(sigma t - y'), w = y'':  mean of w over [t1, t] + 2 y/(mu (t - t1)) = sigma.
        """
        n, mu, sigma = DEGREE - 1, self.mu, self.sigma
        t = 0.5 * h * (1.0 - np.cos(np.pi * (np.arange(n) + 0.5) / n))
        xi = self.travel.position
        t1 = self.back(t - xi(t))
        delay = xi(t) + xi(t1)
        mean, y_over_t2 = np.zeros((n, n)), np.zeros((n, n))
        for theta, weight in zip(_GAUSS_X, _GAUSS_W, strict=True):
            mean += weight * _cheb(2.0 * (t1 + theta * delay) / h - 1.0)[:, :n]
            y_over_t2 += weight * (1.0 - theta) * _cheb(2.0 * theta * t / h - 1.0)[:, :n]
        w = np.linalg.solve(mean + (2.0 * t * t / (mu * delay))[:, None] * y_over_t2, np.full(n, sigma))
        dy = np.polynomial.chebyshev.chebint(w, lbnd=-1.0, scl=0.5 * h)
        y = np.polynomial.chebyshev.chebint(dy, lbnd=-1.0, scl=0.5 * h)
        F = -0.5 * mu * np.append(dy, 0.0)
        F[:2] += 0.25 * mu * sigma * h
        return np.stack([y, F, y])

    def _step(self, y0: float, za: float, zb: float, late: bool) -> Array:
        """(y, F, G) (3, DEGREE+1) on [za, zb] of t (late: of -s)."""
        T, h, mu = self.travel.t_end, zb - za, self.mu
        z = 0.5 * (za + zb) + 0.5 * h * _X
        z[0], z[-1] = za, zb
        t, s = (T + z, -z) if late else (z, T - z)
        go = self.travel.to_go(s) if late else 1.0 - self.travel.position(t)
        n = DEGREE + 1

        eta = T - 1.0 - s + go if late else t - (1.0 - go)  # A(t) = B(t1)
        zeta = s + go  # = s2 - to_go(s2)
        t1, s2 = np.full(n, -1.0), np.full(n, T + 1.0)
        hit1, hit2 = eta > self.B0, zeta < self.zeta0
        t1[hit1], s2[hit2] = self.back(eta[hit1]), self.ahead(zeta[hit2])

        known, inverse = [], []
        for tau, rest, field, hit in ((t1, T - t1, 1, hit1), (T - s2, s2, 2, hit2)):
            k, P = np.zeros(n), np.zeros((n, n))
            zr = -rest if late else tau
            inside, outside = hit & (zr > za), hit & ~(zr > za)
            k[outside] = self.past.at(tau[outside], rest[outside])[:, field]
            P[inside] = _cheb(((zr[inside] - za) - (zb - zr[inside])) / h) @ _TO_COEF
            inverse.append(np.linalg.inv(np.eye(n) - P) if inside.any() else np.eye(n))
            known.append(k)
        L1, L2 = inverse
        c = L1 @ known[0] + L2 @ known[1]  # F + G = (L1 + L2) y + c
        Q, push = 0.5 * h * _TO_INTEGRAL, self.sigma * t - (2.0 / mu) * c
        y = np.linalg.solve(np.eye(n) + (2.0 / mu) * Q @ (L1 + L2 - np.eye(n)), y0 + Q @ push)
        return np.stack([y, L1 @ (y + known[0]), L2 @ (y + known[1])]) @ _TO_COEF.T


# --- the answer


@dataclass(frozen=True, slots=True)
class Ride:
    travel: Travel
    mu: float
    sigma: float
    t_last: float  # end of the march
    exit_path: float  # y at t_last
    tail: float  # of y, over the largest value
    _march: _March

    def _fields(self, t: ArrayLike, derivative: bool = False) -> tuple[Array, Array]:
        t = np.asarray(t, float)
        if np.any(t < 0.0) or np.any(t > self.t_last):
            raise ValueError(f"t must lie in [0, {self.t_last}]")
        flat = np.atleast_1d(t).ravel()
        return self._march.past.at(flat, self.travel.t_end - flat, derivative), t

    def path(self, t: ArrayLike) -> Array:
        """y(t)."""
        q, t = self._fields(t)
        return q[:, 0].reshape(t.shape)

    def path_velocity(self, t: ArrayLike) -> Array:
        """y'(t), from (2)."""
        q, t = self._fields(t)
        return self.sigma * t - (2.0 / self.mu) * (q[:, 1] + q[:, 2] - q[:, 0]).reshape(t.shape)

    def impulse(self, t: ArrayLike) -> Array:
        """Integral of R."""
        q, t = self._fields(t)
        return 2.0 * (q[:, 1] + q[:, 2] - q[:, 0]).reshape(t.shape)

    def force(self, t: ArrayLike) -> Array:
        """R(t), the contact force."""
        q, t = self._fields(t, derivative=True)
        return 2.0 * (q[:, 1] + q[:, 2] - q[:, 0]).reshape(t.shape)


@dataclass(frozen=True, slots=True)
class SupersonicRide:
    """y = 0; force P = mu sigma."""

    P: float

    def path(self, t: ArrayLike) -> Array:
        return np.zeros(np.shape(t))

    def force(self, t: ArrayLike) -> Array:
        return np.full(np.shape(t), self.P)


# --- cases


def cases() -> list[Crossing | Limit]:
    def ride(name: str, motion: Motion, mu: float = MU) -> Crossing:
        exact = solve(travel_of(motion), mu=mu, sigma=SIGMA).path
        groups, finer = level(motion, mu), 3.0 if mu < 0.5 else 1.0
        return Crossing(name=name, groups=groups, travel=motion.position, exact=exact, finer=finer)

    def steady(mu: float, V: float) -> Crossing:
        return ride(f"mass ratio {mu:g}, speed {V:g}", ConstantSpeed(speed=V).motion(1.0), mu)

    slow = ConstantAcceleration(acceleration=0.23).motion(1.0)
    brake = AccelerateCruiseBrake(top_speed=0.55).motion(1.0)
    return [
        _paper(), steady(0.2, 0.6), steady(5.0, 0.37), steady(MU, 0.9), ride("from rest, acceleration 0.23", slow),
        ride("accelerate, cruise, brake", brake), *(_small_sag(model) for model in ("sagged", "stretching", "full")),
        _small_sag("stretching", plain=True),
    ]  # fmt: skip


def _heavier(groups: Groups, V: float) -> float:
    return groups.sigma * (1.0 + V * V)


def _paper() -> Crossing:
    groups = Scene.load("level").groups
    assert groups.motion is not None
    sigma = _heavier(groups, groups.motion.at(0.0, 0)[1])
    return Crossing(
        name="the paper's mass and speed, g (1 + V²)", scene="level", groups=groups, travel=groups.motion.position,
        exact=solve(travel_of(groups.motion), mu=groups.mu, sigma=sigma).path, methods=None,
    )  # fmt: skip


def _small_sag(model: str, *, plain: bool = False) -> Limit:
    V = 0.45
    motion = ConstantSpeed(speed=V).motion(1.0)

    def deviation(solvers: Solvers, method: str, sigma: float) -> Error:
        groups = level(motion, sigma=sigma)
        exact = solve(travel_of(motion), mu=groups.mu, sigma=sigma if plain else _heavier(groups, V)).path
        crossing = Crossing(name="", groups=groups, travel=motion.position, exact=exact, model=model)
        return crossing.error(solvers.path(crossing, method))

    told = "plain g instead of g (1 + V²)" if plain else "g (1 + V²)"
    return Limit(
        name=f"limit of small sag, model {model}, {told}", parameter="sag", values=(0.02, 0.01, 0.005), falls=2.0,
        because="the tension that the sag adds goes like alpha sigma²", deviation=deviation,
        methods=("following-p2",) if plain else BEST, expected="disagree" if plain else "agree",
    )  # fmt: skip
