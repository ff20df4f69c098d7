"""A step by collocation (Radau IIA, Gauss)."""

import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from cablefem.newmark.collocation import collocate_coupled
from cablefem.newmark.failures import StepFailure
from cablefem.newmark.newton import Newton
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.states import Array, Collocated, Inside, State, Steps
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import System, consistent_acceleration
from cablefem.newmark.tableau import further, tableau

# keep the tangent if |r| falls to this: a new one helps little
REUSE = 0.8
ENOUGH = 18.0  # iterations; two half steps cost less


class CollocationRule(Stepper):
    """With a the polynomial through a_j at the nodes t0 + c_j dt, v and q its integrals,

        v_i = v0 + dt sum_j A_ij a_j,   q_i = q0 + c_i dt v0 + dt^2 sum_j (A A)_ij a_j,   r(t_i, q_i, v_i, a_i) = 0 .

    StepFailure where the balance does not determine a at the end (Gauss).
    """

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, newton._replace(reuse=REUSE, enough=ENOUGH), work)
        self.rule = tableau(method.nodes)

    def solve_steps(self, x: State, times: Array) -> Iterator[Sequence[State]]:
        if not isinstance(x, Collocated):
            return
        t, ends, a, go_on = steps = self._steps(x, times)
        a[0] = go_on[0] @ x.inside.a
        for k, done in enumerate(self.system.collocate(x.phase, steps, self.rule, self.newton)):
            if not done.norm <= self.bound:
                return
            self.balanced(done)
            yield [self._end(x.phase, t[k : k + 2], ends[k + 1], a[k])]

    def __call__(self, x: State, t1: float) -> State:
        steps = self._steps(x, np.array([t1]))
        one = self.system.collocate
        if isinstance(x, Collocated):
            tries = [(steps.further[0] @ x.inside.a, one), (x.a, one)]
        else:
            tries = [(x.a, one), (0.0, one), (x.a, partial(collocate_coupled, self.system))]
        for steps.a[0], solver in tries:
            done = next(iter(solver(x.phase, steps, self.rule, self.newton)))
            if self.balanced(done):
                return self._end(x.phase, steps.t, steps.ends[1], steps.a[0])
        raise self.stalled(t1, done)

    def _steps(self, x: State, times: Array) -> Steps:
        t = np.concatenate([[x.t], times])
        s = self.rule.c.size
        ends = np.empty((t.size, 2, x.q.size))
        a = np.empty((times.size, s, x.q.size))
        ends[0, 0] = x.q
        ends[0, 1] = x.v
        dt = t[1:] - t[:-1]
        before = np.concatenate([[x.inside.dt if isinstance(x, Collocated) else dt[0]], dt[:-1]])
        ratios = np.round(dt / before, 9).tolist()  # rounded for the cache
        return Steps(t, ends, a, np.array([further(self.method.nodes, ratio) for ratio in ratios]))

    def _end(self, phase: int, t: Array, end: Array, a: Array) -> State:
        t0, t1 = t.tolist()
        if self.rule.c[-1] == 1.0:
            x = Collocated(t1, end[0], end[1], a[-1], phase)
        else:
            x = Collocated(*consistent_acceleration(self.system, t1, end[0], end[1], phase))
        if not math.isfinite(x.a.sum()):
            raise StepFailure(
                t1, "the balance does not determine the acceleration (a constraint on positions)",
                "take scheme radau, newmark or generalized-alpha",
            )  # fmt: skip
        x.inside = Inside(self.method.nodes, t1 - t0, a)
        return x
