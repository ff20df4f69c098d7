"""A solver's equations integrated by scipy instead of the time driver."""

import numpy as np
from scipy.integrate import solve_ivp

from cablefem.newmark import State
from cablefem.response import Array
from validation.core.solver import Solver


def integrated(system: Solver, first: State, t: Array, rule: str, *, rtol: float) -> Array:
    """q and v (n_t, 2n) at times t by a rule of scipy, in the phase of the first state.

    Raises ArithmeticError.
    """
    n, zero = system.n_dof, np.zeros(system.n_dof)

    def rate(t: float, y: Array) -> Array:
        r, solve = system.linearise(t, y[:n], y[n:], zero, first.phase, 0.0, 0.0, 1.0)
        return np.concatenate([y[n:], -solve(r)])

    start = np.concatenate([first.q, first.v])
    answer = solve_ivp(rate, (first.t, t[-1]), start, rule, t_eval=t, rtol=rtol, atol=1e-10)
    if not answer.success:
        raise ArithmeticError(answer.message)
    return answer.y.T
