"""Free vibration of the bare cable under a time scheme."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from cablefem import newmark
from cablefem.newmark import Newton, Scheme, State, consistent_acceleration, stack_states
from cablefem.response import Array
from cablefem.scene import Groups
from cablefem.scene.motion import rest_motion
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.commands.paper.runs import SETTINGS


def relative_free_vibration_energy(
    groups: Groups, scheme: Scheme, *, terms: int, speed: float, sine: int = 1, dt: float, steps: int
) -> Array:
    """Energy of a bare cable after every step over that at the start, (n,); short if the run broke.

    Above the hanging cable's.  speed : at the start, of one sine of `terms`.
    """
    end = dt * steps
    bare = replace(groups, mu=0.0, motion=rest_motion(0.5, end))
    system = GalerkinSystem(bare, Fourier(terms))
    at_rest = State(0.0, *np.zeros((3, system.n_dof)))
    v = np.zeros(system.n_dof)
    v[terms + sine - 1] = speed
    start = consistent_acceleration(system, 0.0, at_rest.q, v, 0)
    times = np.linspace(0.0, end, steps + 1)
    newton = Newton(tol=1e-9, max_iter=40)
    states = [at_rest, start]
    with suppress(newmark.StepFailure):
        states.extend(newmark.integrate(system, scheme, [times], newton=newton, start=start))
    with np.errstate(over="ignore", invalid="ignore"):
        history = system.observe(stack_states(states), np.zeros(0), np.zeros(0, np.intp))
        energy = history.energy - history.energy[0]
        return energy[1:] / energy[1]


def max_relative_vibration_energy(groups: Groups, steps_per_period: int, scheme_name: str = "trapezoidal") -> float:
    """Largest energy of the bare cable in free vibration, over that at the start.

    steps_per_period : of the first mode.
    """
    settings = SETTINGS["vibration"]
    energy = relative_free_vibration_energy(
        groups,
        newmark.scheme(scheme_name),
        terms=settings["terms"],
        speed=settings["speed"],
        dt=2.0 * np.pi / 5.3454766 / steps_per_period,
        steps=round(settings["periods"] * steps_per_period),
    )
    return float(np.nanmax(energy))
