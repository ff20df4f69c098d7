"""Free vibration of the bare level cable under a time scheme."""

import numpy as np

from cablefem.newmark import scheme
from cablefem.scene import Groups
from validation.commands.atlas.specimens import free_vibration
from validation.commands.paper.runs import SAID

ASKED = SAID["vibration"]


def energy_ratio(groups: Groups, per_period: int, name: str = "trapezoidal") -> float:
    """Largest energy met over the one given; energies above the hanging cable's.

    per_period : steps per period of the first mode (2 pi/5.35).
    """
    dt, steps = 2.0 * np.pi / 5.3454766 / per_period, round(ASKED["periods"] * per_period)
    terms, speed = ASKED["terms"], ASKED["speed"]
    return float(np.nanmax(free_vibration(groups, scheme(name), terms=terms, speed=speed, dt=dt, steps=steps)))
