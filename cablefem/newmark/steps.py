import math

import numpy as np

from cablefem.newmark.states import Array
from cablefem.newmark.system import System

GROWTH = 1.15  # of steps in ramps


def step_times_by_phase(
    system: System, steps: int, *, entry_ratio: float = 1.0, exit_ratio: float = 1.0
) -> list[Array]:
    """Per phase the instants to step on: about `steps` equal steps.

    The last instant is left out, for systems may be singular there.
    entry_ratio, exit_ratio : first and last step over the uniform one.
    """
    phases = system.phases
    dt = (phases[-1][1] - phases[0][0]) / steps
    grids = []
    for i, (t0, t1) in enumerate(phases):
        begin = _growing_step_lengths(dt, entry_ratio if i == 0 else 1.0)
        end = _growing_step_lengths(dt, exit_ratio if i == len(phases) - 1 else 1.0)
        uniform = t1 - t0 - float(begin.sum() + end.sum())
        count = max(2, round(uniform / dt))
        inner = np.full(count, max(uniform / count, dt))
        lengths = np.concatenate([begin, inner, end[::-1]])
        grid = np.concatenate([[0.0], np.cumsum(lengths)])
        grid = t0 + (t1 - t0) * (grid / grid[-1])
        grid[-1] = t1
        grids.append(grid)
    grids[-1] = grids[-1][:-1]
    return grids


def _growing_step_lengths(dt: float, first_fraction: float) -> Array:
    """Steps that grow from `first_fraction` dt to dt."""
    count = math.ceil(-math.log(first_fraction) / math.log(GROWTH))
    return np.minimum(dt, first_fraction * dt * GROWTH ** np.arange(count))
