import math

import numpy as np

from cablefem.newmark.states import Array
from cablefem.newmark.system import System

GROWTH = 1.15  # of steps in ramps


def step_times(system: System, steps: int, *, entry: float = 1.0, exit: float = 1.0) -> list[Array]:
    """Per phase the instants to step on: about `steps` equal steps.

    The last instant is left out, for systems may be singular there.
    entry, exit : first and last step over the uniform one.
    """
    phases = system.phases
    dt = (phases[-1][1] - phases[0][0]) / steps
    grids = []
    for i, (t0, t1) in enumerate(phases):
        ramps = []
        for ramped, fraction in ((i == 0, entry), (i == len(phases) - 1, exit)):
            count = math.ceil(-math.log(fraction) / math.log(GROWTH)) if ramped else 0
            ramps.append(np.minimum(dt, fraction * dt * GROWTH ** np.arange(count)))
        length = sum(float(r.sum()) for r in ramps)
        inner = max(2, round((t1 - t0 - length) / dt)) if length < t1 - t0 else 2
        lengths = np.concatenate([ramps[0], np.full(inner, max((t1 - t0 - length) / inner, dt)), ramps[1][::-1]])
        grid = np.concatenate([[0.0], np.cumsum(lengths)])
        grid = t0 + (t1 - t0) * (grid / grid[-1])
        grid[-1] = t1
        grids.append(grid)
    grids[-1] = grids[-1][:-1]
    return grids
