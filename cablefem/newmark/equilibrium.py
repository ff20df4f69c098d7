"""States of rest under load, by Newton's method with the tangent K + w M; w falls with the residual."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cablefem.newmark.failures import StepFailure
from cablefem.newmark.states import Array, State
from cablefem.newmark.system import System, consistent_acceleration

WEIGHTS = (0.0, 1e1, 1e3, 1e5)  # [1/time^2] first w
ITERATIONS = 200  # of one attempt
TOL = 1e-12  # of the force scale
ROUNDING = 1e3  # accepted over the bound
APART = 1e-4  # of the shorter side, for differences


def equilibrium(system: System) -> Array:
    """q at rest; StepFailure if none is found."""
    bound = TOL * system.force_scale + math.sqrt(system.n_dof) * system.force_floor
    zero = np.zeros(system.n_dof)
    for first in WEIGHTS:
        q, start, best = zero, math.inf, math.inf
        for i in range(ITERATIONS):
            with np.errstate(over="ignore", invalid="ignore"):
                r, _ = system.linearise(0.0, q, zero, zero, 0, 1.0, 0.0, 0.0)
                norm = float(np.linalg.norm(r))
                start = norm if i == 0 else start
                if norm <= bound or (norm <= ROUNDING * bound and norm >= best):
                    return q
                if not norm < 1e6 * start:
                    break
                best = min(best, norm)
                r, solve = system.linearise(0.0, q, zero, zero, 0, 1.0, 0.0, first * norm / start)
                q = q - solve(r.copy())
    raise StepFailure(0.0, "no rest of the loaded cable was found", "start the car elsewhere")


def begun(system: System, rest: Callable[[float], Array], s_o: float, ds_o: float) -> State:
    """The state of a mass at s_o, at rest or moving through states of rest.

    rest : q with the mass at rest at a place.
    """
    q, d = rest(s_o), APART * min(s_o, 1.0 - s_o)
    v = np.zeros_like(q)
    if ds_o:
        v = (rest(s_o + d) - rest(s_o - d)) * (ds_o / (2.0 * d))
    return consistent_acceleration(system, 0.0, q, v, 0)
