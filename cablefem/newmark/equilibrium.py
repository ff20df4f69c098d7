"""States of rest under load.

A cable that carries no compression has a convex energy with one minimum.
With compression its energy has other stationary points, which no cable takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cablefem.newmark.failures import StepFailure
from cablefem.newmark.states import Array, State
from cablefem.newmark.system import System, consistent_acceleration

WEIGHT = 1.0  # [1/time^2] w of the first tangent K + w M; it falls with the residual
ITERATIONS = 200
HALVINGS = 30
TOL = 1e-12  # of the force scale
ROUNDING = 1e3  # times the bound is accepted once the residual falls no more
DIFFERENCE = 1e-4  # of the shorter side, to differentiate by s_o

Shorten = Callable[[System, Array, Array, Array], Array]


def solve_equilibrium(system: System) -> Array:
    """q (n_dof,) of minimal energy, which must be convex; StepFailure without convergence."""
    return _solve_equilibrium_from(system, np.zeros(system.n_dof), _halve_step_until_downhill)


def solve_equilibrium_on_haul_rope(system: System, clamped_q: Array) -> Array:
    """q (n_dof,) of a cable and the force, its last unknown, of the rope that holds the car.

    clamped_q : q of the cable with the car clamped to it, which is near.
    The rope turns with the cable, so there is no energy: Newton's steps are not shortened.
    """
    return _solve_equilibrium_from(system, np.append(clamped_q, 0.0), lambda system, q, r, step: step)


def _solve_equilibrium_from(system: System, q: Array, shorten: Shorten) -> Array:
    """q (n_dof,) by Newton's method from q, with steps that `shorten` cuts; StepFailure without convergence."""
    bound = TOL * system.force_scale + math.sqrt(system.n_dof) * system.force_floor
    zero = np.zeros(system.n_dof)
    weight = WEIGHT
    first = smallest = math.inf
    for i in range(ITERATIONS):
        with np.errstate(over="ignore", invalid="ignore"):
            r, solve = system.linearise(0.0, q, zero, zero, 0, (1.0, 0.0, weight))
            norm = float(np.linalg.norm(r))
            stagnates = norm <= ROUNDING * bound and norm >= smallest
            if norm <= bound or stagnates:
                return np.asarray(q - solve(r.copy()))  # one step more, down to rounding
            if not norm < math.inf:
                break
            if i == 0:
                first = norm
            weight = WEIGHT * norm / first
            smallest = min(smallest, norm)
            q = q - shorten(system, q, r, solve(r.copy()))
    raise StepFailure(0.0, "no rest of the loaded cable was found", "start the car elsewhere")


def _halve_step_until_downhill(system: System, q: Array, residual: Array, step: Array) -> Array:
    """The step, halved until the energy rises at its end by at most half as fast as it fell at its start."""
    zero = np.zeros_like(q)
    slope = float(residual @ step)
    for _ in range(HALVINGS):
        if system.residual(0.0, q - step, zero, zero, 0) @ step >= -0.5 * slope:
            break
        step = 0.5 * step
        slope = 0.5 * slope
    return step


def quasi_static_start(system: System, rest_at: Callable[[float], Array], s_o: float, ds_o: float) -> State:
    """The state of a mass at s_o, at rest or moving through states of rest.

    rest_at : q with the mass at rest at an s_o.
    """
    q = rest_at(s_o)
    d = DIFFERENCE * min(s_o, 1.0 - s_o)
    v = np.zeros_like(q)
    if ds_o:
        v = (rest_at(s_o + d) - rest_at(s_o - d)) * (ds_o / (2.0 * d))
    return consistent_acceleration(system, 0.0, q, v, 0)
