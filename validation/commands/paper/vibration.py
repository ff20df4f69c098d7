"""Free vibration of the bare level cable under a time scheme."""

import contextlib
from dataclasses import replace

import numpy as np

from cablefem.newmark import State, StepFailure, consistent_acceleration, integrate, scheme
from cablefem.scene import Groups
from cablefem.scene.motion import standing
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.commands.paper.runs import SAID
from validation.core.sampling import stacked

ASKED = SAID["vibration"]


def energy_ratio(groups: Groups, per_period: float, name: str = "trapezoidal") -> float:
    """Largest energy met over the one given; energies above the hanging cable's.

    per_period : steps per period of the first mode (2 pi/5.35).
    """
    period = 2.0 * np.pi / 5.3454766
    end = ASKED["periods"] * period
    system = GalerkinSystem(replace(groups, mu=0.0, motion=standing(0.5, end)), Fourier(ASKED["terms"]))
    v = np.zeros(system.n_dof)
    v[ASKED["terms"]] = ASKED["speed"]
    start = consistent_acceleration(system, 0.0, np.zeros(system.n_dof), v, 0)
    grid = np.arange(0.0, end, period / per_period)
    states, none = [start], np.zeros(0)
    with contextlib.suppress(StepFailure):
        for state in integrate(system, scheme(name), [grid], start=start):
            states.append(state)
    stack, still = stacked(states), stacked([State(0.0, *np.zeros((3, system.n_dof)))])
    with np.errstate(over="ignore", invalid="ignore"):
        energy, (rest,) = (system.observe(x, none, none.astype(int)).energy for x in (stack, still))
    return float(np.nanmax((energy - rest) / (energy[0] - rest)))
