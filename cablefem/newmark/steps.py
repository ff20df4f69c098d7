"""The instants to step on."""

from __future__ import annotations

import math

import numpy as np

from cablefem.newmark.system import Array, System


def step_times(
    system: System, steps: int, *, entry: float = 1.0, exit: float = 1.0, growth: float = 1.15
) -> list[Array]:
    """Return per phase the instants to step on: about `steps` equal steps, whole ones in each phase.

    The very last instant is left out: a system may lose its meaning there.

    entry, exit : first and last step as fractions of the uniform one; from there steps grow by `growth` each, up to
        the uniform step.  The ramps come on top of `steps`.
    """
    if steps < 2:
        raise ValueError(f"steps must be at least 2, got {steps!r}")
    for name, value in (("entry", entry), ("exit", exit)):
        if not 0.0 < value <= 1.0:
            raise ValueError(f"{name} must lie in (0, 1], got {value!r}")
    phases = system.phases
    dt = (phases[-1][1] - phases[0][0]) / steps
    grids = []
    for i, (t0, t1) in enumerate(phases):
        ramps = []
        for ramped, fraction in ((i == 0, entry), (i == len(phases) - 1, exit)):
            count = math.ceil(-math.log(fraction) / math.log(growth)) if ramped else 0
            ramps.append(np.minimum(dt, fraction * dt * growth ** np.arange(count)))
        length = sum(float(r.sum()) for r in ramps)
        inner = max(2, round((t1 - t0 - length) / dt)) if length < t1 - t0 else 2
        lengths = np.concatenate([ramps[0], np.full(inner, max((t1 - t0 - length) / inner, dt)), ramps[1][::-1]])
        grid = np.concatenate([[0.0], np.cumsum(lengths)])
        grid = t0 + (t1 - t0) * (grid / grid[-1])
        grid[-1] = t1
        grids.append(grid)
    grids[-1] = grids[-1][:-1]
    return grids


# At a thousand steps a ride, steps are these parts of the time since a jump of force and of that to a support, and of
# an axial wave's way while something reacts to it.
SINCE, RINGS, STANDARD = 12.0, 60.0, 1000.0


def part_of_ride(duration: float, axial: float, s_o: float, speed: float, since: float, rubs: bool) -> float:
    """Return which part of a step a rolling car takes at s_o, 0 < s_o < 1: a function of where it is, not of the steps.

    duration : of the ride.  axial : time of axial waves to and fro over the cable; next to a support they come sooner.
    since : after a jump of a force along the cable, which rings; inf where nothing hears that.
    rubs : whether a brake or a hold reacts to what rings as long as it does.
    """
    step, near = duration / STANDARD, min(s_o, 1.0 - s_o)
    there = near / abs(speed) if speed else math.inf
    return min(
        1.0, (since + axial * near) / (SINCE * step), there / (SINCE * step), axial / (RINGS * step) if rubs else 1.0
    )
