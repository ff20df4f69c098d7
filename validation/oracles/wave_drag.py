"""A mass free to slide along a string is braked by the waves it sends.

    v_tt - v_xx = R delta(x - xi),  mu y'' = mu sigma - R,  y = v(xi, t),  mu xi'' = D + R <v_x>,

drive D, mean slope <v_x>.  Infinite string, |xi'| < 1, y as in accelerating_mass:
    R = mu sigma (1 - e^(-2t/mu)),   mu xi'' = D - (R^2/2) xi'/(1 - xi'^2).                      (1)
D = 0, w = xi', E = int_0^t R^2, Lambert's function W:
    w = sqrt(-W(-z^2)),    z = w0 e^(-w0^2/2) e^(-E/(2 mu)).                                     (2)

Finite string, sled hauled at speed V from s0, no echoes, W = mu sigma:
    R = W [ 1 + V^2 (1 + 2 mu) - 2 V^2 (1 + mu) e^(-2t/mu) ],
    <v_x> = W (1/2 - s0) + W V (1/2 - t) - R V/(2 (1 - V^2)),
    F = mu x.. - R [ <v_x> + sigma (1/2 - s_o) ],   x.. of the solver's path.                    (3)

Source: D'Acunto (reference 9 of Al-Qassab, Nair & O'Leary 2003), solved here
Validity: 0 <= w0 < 1, infinite string; (3) small slopes, before the first echo
Accuracy: (2) to rounding; positions and the driven case by DOP853, 1e-11
Group: A car that rolls
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import OdeSolution, solve_ivp

from cablefem.scene import ConstantSpeed
from validation.oracles.case import RIDERS, Array, Error, Limit, Solvers, hung, largest_and_rms, positive


def solve(t_end: float, *, mu: float, sigma: float, w0: float, drive: float = 0.0) -> CoupledRide:
    """Integrate (1) from xi = 0, xi' = w0."""
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
    mu: float
    sigma: float
    _sol: OdeSolution

    def position(self, t: ArrayLike) -> Array:
        return self._sol(np.asarray(t, float).ravel())[0].reshape(np.shape(t))

    def speed(self, t: ArrayLike) -> Array:
        return self._sol(np.asarray(t, float).ravel())[1].reshape(np.shape(t))

    def path(self, t: ArrayLike) -> Array:
        t = np.asarray(t, float)
        return 0.5 * self.sigma * self.mu * (t + 0.5 * self.mu * np.expm1(-2.0 * t / self.mu))

    def force(self, t: ArrayLike) -> Array:
        return -self.mu * self.sigma * np.expm1(-2.0 * np.asarray(t, float) / self.mu)


def resistance(t: ArrayLike, *, mu: float, sigma: float, V: float, s0: float, drag: bool = True) -> Array:
    """F - mu x.. of (3) over W^2; drag=False: without the waves of R."""
    t = np.asarray(t, float)
    load = 1.0 + V * V * (1.0 + 2.0 * mu) - 2.0 * V * V * (1.0 + mu) * np.exp(-2.0 * t / mu)
    slope = 0.5 - s0 + V * (0.5 - t) - drag * load * V / (2.0 * (1.0 - V * V))
    return -load * (slope + (0.5 - s0 - V * t) / mu)


def _deviation(solvers: Solvers, method: str, sigma: float, drag: bool = True) -> Error:
    mu, V, s0, t_end = 0.3, 0.4, 0.35, 0.45
    drive = {"mode": "haul", "start": s0, "end": {"place": s0 + V * t_end}}
    scene = hung(sigma, 300.0, mu, drive, travel=ConstantSpeed(speed=V))
    r = solvers.ride(scene, method, steps=400, scheme="generalized-alpha")
    exact = resistance(r.t / scene.time_scale, mu=mu, sigma=sigma, V=V, s0=s0, drag=drag)
    return largest_and_rms((r.F_haul - mu * r.acceleration[:, 0]) / (mu * sigma) ** 2 - exact)


def _case(name: str, drag: bool) -> Limit:
    return Limit(
        name=name, parameter="sigma", values=(3e-1, 1e-1, 3e-2), falls=0.8,
        because="sag and stretch change the waves like sigma", deviation=partial(_deviation, drag=drag),
        methods=RIDERS, expected="agree" if drag else "disagree",
    )  # fmt: skip


def cases() -> list[Limit]:
    return [_case("hauled, taut string: force over (mu sigma)²", True), _case("the same without wave drag", False)]
