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
from numpy.typing import ArrayLike
from scipy.integrate import OdeSolution, solve_ivp

from validation.oracles.case import Array, Oracle, positive


def solve(t_end: float, *, mu: float, sigma: float, w0: float, drive: float = 0.0) -> CoupledRide:
    """Integrate (1) from xi(0) = 0, xi'(0) = w0 to t_end."""
    positive(mu=mu, sigma=sigma, t_end=t_end)
    if not (0.0 <= w0 < 1.0 and math.isfinite(drive)):
        raise ValueError(f"the initial speed must lie in [0, 1) and the drive be finite, got {w0!r}, {drive!r}")

    def rate(t: float, q: Array) -> list[float]:
        R = -mu * sigma * math.expm1(-2.0 * t / mu)
        return [q[1], (drive - 0.5 * R * R * q[1] / (1.0 - q[1] ** 2)) / mu]

    run = solve_ivp(rate, (0.0, t_end), [0.0, w0], method="DOP853", rtol=1e-12, atol=1e-14, dense_output=True)
    if not run.success or not np.all(np.abs(run.y[1]) < 1.0):
        raise ValueError(f"the mass comes too close to the wave speed for the integrator: {run.message}")
    return CoupledRide(mu, sigma, run.sol)


@dataclass(frozen=True, slots=True)
class CoupledRide:
    """Travel, path and string of the coupled problem."""

    mu: float
    sigma: float
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


ORACLE = Oracle(
    title="mass sliding freely or driven along a straight string, braked by its waves",
    source="D'Acunto (reference 9 of Al-Qassab et al. 2003), solved here",
    validity="infinite string, start below the wave speed",
    group="Loads and cables that the solvers do not have",
    unreached="a ride starts from the loaded string at rest, not from a straight one; rocket has the same waves",
)
