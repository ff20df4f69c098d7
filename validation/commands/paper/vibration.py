"""Free vibration of the bare cable under a time scheme."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from cablefem import newmark
from cablefem.newmark import Newton, Scheme, State, consistent_acceleration
from cablefem.response import Array
from cablefem.scene import Groups
from cablefem.scene.motion import rest_motion
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.commands.paper.runs import SETTINGS
from validation.core.sampling import stack_states


def relative_free_vibration_energy(
    groups: Groups, scheme: Scheme, *, terms: int, speed: float, sine: int = 1, dt: float, steps: int
) -> Array:
    """Energy of a bare cable after every step over that at the start, (n,); short if the run broke.

    Above the hanging cable's.  speed : at the start, of one sine of `terms`.
    """
    system = GalerkinSystem(replace(groups, mu=0.0, motion=rest_motion(0.5, dt * steps)), Fourier(terms))
    v = np.zeros(system.n_dof)
    v[terms + sine - 1] = speed
    states = [consistent_acceleration(system, 0.0, np.zeros_like(v), v, 0)]
    times = np.linspace(0.0, dt * steps, steps + 1)
    newton = Newton(tol=1e-9, max_iter=40)
    with suppress(newmark.StepFailure):
        states.extend(newmark.integrate(system, scheme, [times], newton=newton, start=states[0]))
    at_rest_state = State(0.0, *np.zeros((3, system.n_dof)))
    with np.errstate(over="ignore", invalid="ignore"):
        energy = system.observe(stack_states([at_rest_state, *states]), np.zeros(0), np.zeros(0, np.intp)).energy
        return (energy[1:] - energy[0]) / (energy[1] - energy[0])


def max_relative_vibration_energy(groups: Groups, steps_per_period: int, scheme_name: str = "trapezoidal") -> float:
    """Largest energy of the bare cable in free vibration, over that at the start.

    steps_per_period : of the first mode.
    """
    swing = SETTINGS["vibration"]
    dt = 2.0 * np.pi / 5.3454766 / steps_per_period
    steps = round(swing["periods"] * steps_per_period)
    how = {"terms": swing["terms"], "speed": swing["speed"], "dt": dt, "steps": steps}
    return float(np.nanmax(relative_free_vibration_energy(groups, newmark.scheme(scheme_name), **how)))
