"""Path of a mass over a cable of given groups, to compare with exact solutions."""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem import newmark
from cablefem.newmark import stack_states
from cablefem.response import Array
from cablefem.scene import Groups
from validation.core.methods import find_method


class DimensionlessPath(NamedTuple):
    """Time, position s_o and deflection v of the mass, each (n,)."""

    t: Array
    s_o: Array
    v: Array


def compute_dimensionless_path(
    groups: Groups, method_name: str, settings: dict[str, Any], *, model: str, load: str, until: float,
    starts_on_cable: bool,
) -> DimensionlessPath:  # fmt: skip
    """Run a method on groups up to s_o = until; v is nan if the run failed.

    starts_on_cable : the mass starts on the cable, not at the support.
    """
    method = find_method(method_name)
    motion = groups.motion
    assert motion is not None
    settings = method.complete_settings(settings)
    system = method.build(groups, settings, model=model, load=load, law="elastic")
    scheme = newmark.scheme(settings["scheme"], newmark_gamma=settings["newmark_gamma"], rho_inf=settings["rho_inf"])
    rest = np.zeros(system.n_dof)
    start = newmark.consistent_acceleration(system, 0.0, rest, rest.copy(), 0) if starts_on_cable else None
    states: list[newmark.State] = []
    try:
        times = newmark.step_times_by_phase(system, settings["steps"])
        for x in newmark.integrate(system, scheme, times, start=start):
            states.append(x)
            if motion.position_with_rates(x.t, x.phase)[0] > until:
                break
    except newmark.NewtonStalled:  # the solution diverged
        return DimensionlessPath(np.zeros(1), np.full(1, until), np.full(1, math.nan))
    history = stack_states(states)
    observed = system.observe(history, np.zeros(0), np.zeros(0, np.intp))
    return DimensionlessPath(history.t, motion.position(history.t), observed.path[:, 1])
