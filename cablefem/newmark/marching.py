"""Systems that take steps with the factors of a step before at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cablefem.newmark.collocation import SAME_STEP
from cablefem.newmark.newton import Newton, StepResult
from cablefem.newmark.states import Array, State, Steps
from cablefem.newmark.system import System
from cablefem.newmark.tableau import Tableau

STEPS_AT_ONCE = 16  # those beyond an event are lost


class Mode(NamedTuple):
    """An eigenvector of the rule with the factors of its tangent, real or complex."""

    weights: Any  # (s,) or none, see `Tableau.to_modes`
    shares: Any  # (s,) or none, see `Tableau.from_modes`
    factors: Any


def _eigenmodes_of_rule(rule: Tableau, solves: Sequence[Any]) -> Iterator[Mode]:
    """The modes of a rule: complex ones and a real one, which is empty if the rule has none.

    So what is compiled for three nodes serves two.
    """
    for value, weights, shares, factors in zip(rule.eigenvalues, rule.to_modes, rule.from_modes.T, solves, strict=True):
        part: Any = np.array if value.imag else np.real
        yield Mode(part(weights).copy(), part(shares).copy(), factors)
    if rule.eigenvalues.imag.all():
        yield Mode(np.empty(0), np.empty(0), _real_parts(solves[0]))


def _real_parts(factors: Any) -> Any:
    """The real parts of all arrays in a tuple."""
    if isinstance(factors, tuple):
        return type(factors)(*map(_real_parts, factors))
    return factors.real.copy() if isinstance(factors, np.ndarray) else factors


class StepsWithFactors(NamedTuple):
    """Steps to take with the factors of a step before, as many as there are results; see `compiled_collocation`."""

    steps: Steps
    results: Array  # (k, 5) to be set, of `StepResult`
    modes: tuple[Mode, ...]
    rule: Tableau
    newton: Newton


class MarchingSystem(System):
    """A subclass defines the next two, and what `System` asks for."""

    reuses_factors = True

    # a and events' values by t, of the last states
    _known_values: Mapping[float, tuple[Array, tuple[float, ...]]] | None = None

    def take_steps_while_factors_serve(self, phase: int, node_times: Array, march: StepsWithFactors) -> int:
        """Take steps; return how many have converged.

        The step after these has its guess, or corrections of it.
        node_times : (k, s)
        """
        raise NotImplementedError

    def event_values_at(self, t: Any, q: Array, v: Array, a: Array, phase: int) -> Array:
        """`event_values` (..., events) at t (...); the others (..., n_dof)."""
        raise NotImplementedError

    def collocate_steps(self, phase: int, steps: Steps, rule: Tableau, newton: Newton) -> Iterator[StepResult]:
        """Take steps, with the factors of a step before as long as they serve."""
        if not self.many_steps:
            yield from super().collocate_steps(phase, steps, rule, newton)
            return
        k = 0
        while k < len(steps.a):
            q, v = steps.ends[k]
            self.begin_step(State(steps.t.item(k), q, v, steps.a[max(k - 1, 0), -1], phase))
            results = self._take_steps_with_kept_factors(phase, steps.section(k, len(steps.a)), rule, newton)
            yield from results
            k += len(results)
            if self.factors is None and k < len(steps.a):
                yield from super().collocate_steps(phase, steps.section(k, k + 1), rule, newton)
                k += 1
                if k < len(steps.a):
                    steps.a[k] = steps.extrapolation[k] @ steps.a[k - 1]

    def _take_steps_with_kept_factors(
        self, phase: int, steps: Steps, rule: Tableau, newton: Newton
    ) -> list[StepResult]:
        """Take steps with the factors of a step before; factors that do not serve the next step are forgotten."""
        factors = self.factors
        self.factors = None
        if factors is None:
            return []
        dt = np.diff(steps.t[: STEPS_AT_ONCE + 1])
        same = np.abs(dt - factors.dt) <= SAME_STEP * dt
        count = int(np.argmin(np.append(same, False)))
        if count == 0:
            return []
        results = np.zeros((count, 5))
        nodes = rule.node_times(steps.t[: count + 1])
        modes = tuple(_eigenmodes_of_rule(rule, factors.solves))
        taken = self.take_steps_while_factors_serve(phase, nodes, StepsWithFactors(steps, results, modes, rule, newton))
        if taken == count and results[-1, 4]:
            self.factors = factors
        if taken == 0:
            return []
        q, v = steps.ends[1 : taken + 1].swapaxes(0, 1)
        t = steps.t[1 : taken + 1]
        a = steps.a[:taken, -1]
        values = self.event_values_at(t, q, v, a, phase)
        self._known_values = dict(zip(t.tolist(), zip(a, map(tuple, values.tolist()), strict=True), strict=True))
        return [StepResult(*row) for row in results[:taken].tolist()]

    def event_values(self, x: State) -> tuple[float, ...]:
        known = (self._known_values or {}).get(x.t)
        if known is None or not np.array_equal(known[0], x.a):
            known = x.a, tuple(self.event_values_at(*x).tolist())
            self._known_values = {x.t: known}
        return known[1]
