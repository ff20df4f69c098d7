"""A step by collocation (Radau IIA, Gauss)."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from cablefem.newmark.collocation import collocate_first_step_by_krylov
from cablefem.newmark.failures import StepFailure
from cablefem.newmark.newton import Newton
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.states import Array, Collocated, Inside, State, Steps
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import System, consistent_acceleration
from cablefem.newmark.tableau import extrapolation_matrix, tableau

REUSE = 0.8  # the tangent is used again if |r| falls to this: a new one helps little
MAX_USEFUL_ITERATIONS = 18.0  # iterations; two half steps cost less


class CollocationRule(Stepper):
    """With a the polynomial through a_j at the nodes t0 + c_j dt, v and q its integrals,

        v_i = v0 + dt sum_j A_ij a_j,   q_i = q0 + c_i dt v0 + dt^2 sum_j (A A)_ij a_j,   r(t_i, q_i, v_i, a_i) = 0 .

    StepFailure where the balance does not determine a at the end (Gauss).
    """

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, newton._replace(reuse=REUSE, enough=MAX_USEFUL_ITERATIONS), work)
        self.rule = tableau(method.nodes)

    def solve_steps(self, x: State, times: Array) -> Iterator[Sequence[State]]:
        """Yield the states at these times one by one, up to the first that does not converge."""
        if not isinstance(x, Collocated):
            return
        steps = self._allocate_collocation_steps(x, times)
        steps.a[0] = steps.extrapolation[0] @ x.inside.a
        for k, result in enumerate(self.system.collocate_steps(x.phase, steps, self.rule, self.newton)):
            if not self.has_converged(result):
                return
            self.count_result(result)
            yield [self._end_state(x.phase, steps, k)]

    def __call__(self, x: State, t1: float) -> State:
        steps = self._allocate_collocation_steps(x, np.array([t1]))
        collocate_steps = self.system.collocate_steps
        tries: list[tuple[Any, Callable]] = [(x.a, collocate_steps)]  # a at the nodes, and how to solve for them
        if isinstance(x, Collocated):
            tries.insert(0, (steps.extrapolation[0] @ x.inside.a, collocate_steps))
        else:
            tries += [(0.0, collocate_steps), (x.a, partial(collocate_first_step_by_krylov, self.system))]
        for guess, solve in tries:
            steps.a[0] = guess
            result = next(iter(solve(x.phase, steps, self.rule, self.newton)))
            self.count_result(result)
            if self.has_converged(result):
                return self._end_state(x.phase, steps, 0)
        raise self.newton_stalled_error(t1, result)

    def _allocate_collocation_steps(self, x: State, times: Array) -> Steps:
        t = np.concatenate([[x.t], times])
        n = x.q.size
        ends = np.empty((t.size, 2, n))
        a = np.empty((times.size, self.rule.c.size, n))
        ends[0, 0] = x.q
        ends[0, 1] = x.v
        dt = t[1:] - t[:-1]
        dt_before = np.append(x.inside.dt if isinstance(x, Collocated) else dt[0], dt[:-1])
        ratios = np.round(dt / dt_before, 9).tolist()  # rounded for the cache
        extrapolation = [extrapolation_matrix(self.method.nodes, ratio) for ratio in ratios]
        return Steps(t, ends, a, np.array(extrapolation))

    def _end_state(self, phase: int, steps: Steps, k: int) -> State:
        """The state at the end of step k."""
        t0, t1 = steps.t[k : k + 2].tolist()
        q, v = steps.ends[k + 1]
        a = steps.a[k]
        if self.rule.c[-1] == 1.0:
            x = Collocated(t1, q, v, a[-1], phase)
        else:
            x = Collocated(*consistent_acceleration(self.system, t1, q, v, phase))
        if not math.isfinite(x.a.sum()):
            raise StepFailure(
                t1, "the balance does not determine the acceleration (a constraint on positions)",
                "take scheme radau, newmark or generalized-alpha",
            )  # fmt: skip
        x.inside = Inside(self.method.nodes, t1 - t0, a)
        return x
