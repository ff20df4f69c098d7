"""A step of Newmark's family with generalised-alpha."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from cablefem.newmark.newton import Newton
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.states import Array, State, StateBlock
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import System


class NewmarkRule(Stepper):
    """q1 = q0 + dt v0 + dt^2 [ (1/2 - beta) a0 + beta a1 ],  v1 = v0 + dt [ (1 - gamma) a0 + gamma a1 ],  r = 0."""

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, newton, work)
        self._rule = np.eye(3, 5)  # see `System.solve_step`
        self._rule[:, 4] = 1.0 - method.alpha_f, 1.0 - method.alpha_f, 1.0 - method.alpha_m

    def _set(self, rule: Array, dt: Any, goes_on: float) -> None:
        beta = self.method.newmark_beta
        gamma = self.method.newmark_gamma
        rule[..., 0, 1] = dt
        rule[..., 0, 2] = dt * dt * (0.5 - beta + goes_on * beta)
        rule[..., 1, 2] = dt * (1.0 - gamma + goes_on * gamma)
        rule[..., 2, 2] = goes_on
        rule[..., 0, 3] = dt * dt * beta
        rule[..., 1, 3] = dt * gamma
        rule[..., 2, 3] = 1.0

    def _instants(self, t0: Array, t1: Array, phase: int) -> Array:
        if self.method.alpha_f == 0.0:
            return t1
        w = 1.0 - self.method.alpha_f
        return self.system.between(t0, t1, w, phase)

    def solve_steps(self, x: State, times: Array) -> Iterator[Sequence[State]]:
        begin = np.concatenate([[x.t], times[:-1]])
        t = self._instants(begin, times, x.phase)
        rules = np.repeat(self._rule[None], times.size, axis=0)
        self._set(rules, times - begin, 1.0)
        now, told = self.system.solve_steps(t, x.phase, np.array([x.q, x.v, x.a]), rules, self.newton)
        n = len(now)
        stretch = StateBlock(times[:n], now, x.phase)
        seen = int(np.searchsorted(stretch.t, self.system.events_from, side="right")) if self.system.events else n
        for part in [slice(0, seen)] * (seen > 0) + [slice(k, k + 1) for k in range(seen, n)]:
            self.count(*told[part, 1:4].sum(axis=0).astype(int).tolist())
            yield stretch[part]

    def __call__(self, x: State, t1: float) -> State:
        dt = t1 - x.t
        start = np.array([x.q, x.v, x.a])
        t = float(self._instants(np.array([x.t]), np.array([t1]), x.phase)[0])
        now = np.empty_like(start)
        for goes_on in (1.0, 0.0):
            self._set(self._rule, dt, goes_on)
            done = self.system.solve_step(t, x.phase, start, now, self._rule, self.newton)
            if self.balanced(done):
                return State(t1, now[0], now[1], now[2], x.phase)
        raise self.stalled(t1, done)
