"""A step of Newmark's family with generalised-alpha."""

import itertools
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
        self._rule[:2, 4] = 1.0 - method.alpha_f
        self._rule[2, 4] = 1.0 - method.alpha_m

    def _fill_rules(self, rules: Array, dt: Any, guess: float) -> None:
        """Set rules (..., 3, 5) of steps dt; guess : the first a1 over a0."""
        beta = self.method.newmark_beta
        gamma = self.method.newmark_gamma
        rules[..., 0, 1] = dt
        rules[..., 0, 2] = dt * dt * (0.5 - beta + guess * beta)
        rules[..., 1, 2] = dt * (1.0 - gamma + guess * gamma)
        rules[..., 2, 2] = guess
        rules[..., 0, 3] = dt * dt * beta
        rules[..., 1, 3] = dt * gamma
        rules[..., 2, 3] = 1.0

    def _balance_times(self, t0: Array, t1: Array, phase: int) -> Array:
        """Times of the balance in steps from t0 to t1, (n,)."""
        if self.method.alpha_f == 0.0:
            return t1
        return self.system.balance_times(t0, t1, 1.0 - self.method.alpha_f, phase)

    def solve_steps(self, x: State, times: Array) -> Iterator[Sequence[State]]:
        """Yield the states at these times in blocks, each up to an event; all by one call of the system."""
        begin = np.concatenate([[x.t], times[:-1]])
        t = self._balance_times(begin, times, x.phase)
        rules = np.repeat(self._rule[None], times.size, axis=0)
        self._fill_rules(rules, times - begin, 1.0)
        start = np.array([x.q, x.v, x.a])
        ends, results = self.system.solve_steps(t, x.phase, start, rules, self.newton)
        n = len(ends)
        block = StateBlock(times[:n], ends, x.phase)
        without_event = n
        if self.system.events:
            without_event = int(np.searchsorted(block.t, self.system.events_from, side="right"))
        group_edges = [0, *range(max(1, without_event), n), n]
        for first, end in itertools.pairwise(group_edges):
            if end > first:
                work = results[first:end, 1:4].sum(axis=0).astype(int)
                self.count_work(*work.tolist())
                yield block[first:end]

    def __call__(self, x: State, t1: float) -> State:
        dt = t1 - x.t
        start = np.array([x.q, x.v, x.a])
        t = float(self._balance_times(np.array([x.t]), np.array([t1]), x.phase)[0])
        end = np.empty_like(start)
        for guess in (1.0, 0.0):
            self._fill_rules(self._rule, dt, guess)
            result = self.system.solve_step(t, x.phase, start, end, self._rule, self.newton)
            self.count_result(result)
            if self.has_converged(result):
                return State(t1, end[0], end[1], end[2], x.phase)
        raise self.newton_stalled_error(t1, result)
