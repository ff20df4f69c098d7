"""A mass free to slide along an infinite string is braked by the waves it sends, by a law with a closed-form integral.

    v_tt - v_xx = R delta(x - xi),  mu y'' = mu sigma - R,  y = v(xi, t),  mu xi'' = D + R <v_x>,
v down, xi unknown, D a constant drive along the string, <v_x> the mean of the slopes on both sides (a slope falling
ahead drives the mass on). With D = 0 the energy int (v_t^2 + v_x^2)/2 dx + mu (xi'^2 + y'^2)/2 - mu sigma y is
conserved.

D'Acunto (reference 9 of Al-Qassab, Nair & O'Leary 2003) poses the problem; what follows is derived here.  On the
infinite string at rest at t = 0, as long as |xi'| < 1, the mass hears nothing but itself: 2y = int R, so that y and
R do not depend on xi at all,
    y = (sigma mu/2) [ t - (mu/2)(1 - e^(-2t/mu)) ],   R = 2y' = mu sigma (1 - e^(-2t/mu)).
The slopes are R/(2(1 + xi')) behind and -R/(2(1 - xi')) ahead, hence the wave drag
    mu xi'' = D - (R^2/2) xi'/(1 - xi'^2).                                                       (1)
It grows without bound towards the wave speed: the mass stays subsonic.  At a steady speed V, once R has come to the
weight P, D = P^2 V/(2 (1 - V^2)).  For D = 0 (1) separates; with w = xi', E = int_0^t R^2 and the Lambert function W
    w e^(-w^2/2) = z = w0 e^(-w0^2/2) e^(-E/(2 mu)),    w = sqrt(-W(-z^2)).                      (2)
Not derivable in closed form: the finite string, where the reflected waves make (1) a delay equation with
state-dependent delays; there this is the answer until the first reflection is back at the mass.

Validity: 0 <= w0 < 1, infinite string.  Accuracy: the speed (2) to rounding; positions and the driven case by
DOP853 at rtol 1e-12: 1e-11.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import OdeSolution, solve_ivp
from scipy.optimize import brentq
from scipy.special import lambertw

from validation.oracles.case import Oracle

Array = NDArray[np.float64]


def coasting_speed(t: ArrayLike, *, mu: float, sigma: float, w0: float) -> Array:
    """xi'(t) without drive, (2)."""
    _check(mu, sigma, w0)
    t = np.asarray(t, float)
    # E/mu = mu sigma^2 [ t + mu expm1(-2t/mu) - (mu/4) expm1(-4t/mu) ]
    e = mu * sigma**2 * (t + mu * np.expm1(-2.0 * t / mu) - 0.25 * mu * np.expm1(-4.0 * t / mu))
    return np.sqrt(-lambertw(-(w0**2) * np.exp(-(w0**2) - e)).real)


def thrust(V: float, *, P: float) -> float:
    """Force that keeps a weight P going at a steady speed V < 1 on an infinite string."""
    if not 0.0 <= V < 1.0:
        raise ValueError(f"the speed must lie in [0, 1), got {V!r}")
    return 0.5 * P * P * V / (1.0 - V * V)


def solve(t_end: float, *, mu: float, sigma: float, w0: float, drive: float = 0.0) -> CoupledRide:
    """Integrate (1) from xi(0) = 0, xi'(0) = w0 to t_end."""
    _check(mu, sigma, w0)
    if not (math.isfinite(t_end) and t_end > 0.0 and math.isfinite(drive)):
        raise ValueError(f"t_end must be > 0 and drive finite, got {t_end!r}, {drive!r}")

    def rate(t: float, q: Array) -> list[float]:
        R = -mu * sigma * math.expm1(-2.0 * t / mu)
        return [q[1], (drive - 0.5 * R * R * q[1] / (1.0 - q[1] ** 2)) / mu]

    run = solve_ivp(rate, (0.0, t_end), [0.0, w0], method="DOP853", rtol=1e-12, atol=1e-14, dense_output=True)
    if not run.success or not np.all(np.abs(run.y[1]) < 1.0):
        raise ValueError(f"the mass comes too close to the wave speed for the integrator: {run.message}")
    return CoupledRide(mu, sigma, t_end, run.sol)


@dataclass(frozen=True, slots=True)
class CoupledRide:
    """Travel, path and string of the coupled problem."""

    mu: float
    sigma: float
    t_end: float
    _sol: OdeSolution

    def position(self, t: ArrayLike) -> Array:
        """xi(t)."""
        return self._sol(np.asarray(t, float).ravel())[0].reshape(np.shape(t))

    def speed(self, t: ArrayLike) -> Array:
        """xi'(t)."""
        return self._sol(np.asarray(t, float).ravel())[1].reshape(np.shape(t))

    def path(self, t: ArrayLike) -> Array:
        """y(t)."""
        t = np.asarray(t, float)
        return 0.5 * self.sigma * self.mu * (t + 0.5 * self.mu * np.expm1(-2.0 * t / self.mu))

    def force(self, t: ArrayLike) -> Array:
        """R(t)."""
        return -self.mu * self.sigma * np.expm1(-2.0 * np.asarray(t, float) / self.mu)

    def mean_slope(self, t: ArrayLike) -> Array:
        """<v_x> at the mass."""
        w = self.speed(t)
        return -0.5 * self.force(t) * w / (1.0 - w * w)

    def displacement(self, x: ArrayLike, t: ArrayLike) -> Array:
        """v(x, t) = y(tau), tau the time at which the wave now at x left the mass; 0 <= t <= t_end."""
        return np.where((tau := self._left_at(x, t)) > 0.0, self.path(tau), 0.0)

    def gradient(self, x: ArrayLike, t: ArrayLike) -> tuple[Array, Array]:
        """(v_x, v_t) off the mass."""
        x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
        tau, w = (tau := self._left_at(x, t)), self.speed(np.maximum(tau, 0.0))
        half = np.where(tau > 0.0, 0.5 * self.force(np.maximum(tau, 0.0)), 0.0)
        ahead = x > self.position(t)
        v_t = half / np.where(ahead, 1.0 - w, 1.0 + w)
        return np.where(ahead, -v_t, v_t), v_t

    def _left_at(self, x: ArrayLike, t: ArrayLike) -> Array:
        x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
        if np.any(t < 0.0) or np.any(t > self.t_end):
            raise ValueError(f"t must lie in [0, {self.t_end}]")
        out = np.zeros(x.size)
        for i, (xi, ti) in enumerate(zip(x.flat, t.flat, strict=True)):
            sign = 1.0 if xi > self._sol(ti)[0] else -1.0  # ahead: tau - xi(tau) = t - x, behind: tau + xi(tau) = t + x
            target = ti - sign * xi
            if target > 0.0:
                out[i] = brentq(lambda u, s=sign, c=target: u - s * self._sol(u)[0] - c, 0.0, ti, rtol=1e-14)
        return out.reshape(x.shape)


def _check(mu: float, sigma: float, w0: float) -> None:
    for name, value in (("mu", mu), ("sigma", sigma)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be finite and > 0, got {value!r}")
    if not 0.0 <= w0 < 1.0:
        raise ValueError(f"the initial speed must lie in [0, 1), got {w0!r}")


ORACLE = Oracle(
    name="wave-drag",
    title="mass sliding freely or driven along a straight string, braked by its waves",
    source="D'Acunto (reference 9 of Al-Qassab et al. 2003), solved here",
    validity="infinite string, start below the wave speed",
    group="Loads and cables that the solvers do not have",
    answer=solve,
    unreached="a ride starts from the loaded string at rest, not from a straight one; rocket has the same waves",
)
