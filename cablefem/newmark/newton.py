import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np


class Newton(NamedTuple):
    """Settings of Newton's method; converged: |r| <= bound = tol force_scale + sqrt(n_dof) force_floor.

    The tangent is used again if |r| falls to `reuse` or less of its value before.
    After `patience` iterations corrections are halved until |r| falls, at most `halvings` times.
    The method stops if `enough` iterations seem too few.
    """

    tol: float = 1e-4
    max_iter: int = 25
    reuse: float = 0.1
    patience: int = 2
    enough: float = math.inf
    halvings: int = 5
    bound: float = 0.0  # `Stepper` sets it

    def hopeless(self, norm: float, before: float, iterations: int) -> bool:
        """Whether |r|, falling at its present rate, is above the bound after `enough` iterations."""
        if self.enough == math.inf or iterations <= self.patience:
            return False
        return norm >= before or norm * (norm / before) ** (self.enough - iterations) > self.bound


STANDARD = Newton()


SERVES = 0.1  # rate of convergence with which the tangent of a step before serves the next one


class StepResult(NamedTuple):
    """|r| at the end of Newton's method, and its work."""

    norm: float
    iterations: int
    factorisations: int
    residuals: int
    serves: bool = False  # whether the last tangent serves the next step, too


def find_root(
    residual: Callable[[], Any], linearise: Callable[[], tuple[Any, Callable]], update: Callable[[Any], None],
    newton: Newton, solve: Any = None,
) -> StepResult:  # fmt: skip
    """Take corrections, `update(x)` subtracts x, until |residual()| <= newton.bound; NaN never converges.

    solve : with the tangent of a step before; a correction by it that does not help is taken back.
        What it leaves is larger than with a new tangent, so one more follows, whose effect is known without a residual.
    """
    norm = math.inf
    factorisations = 0
    residuals = 0
    old = solve is not None
    new_tangent = not old
    if old:
        r = residual()
        residuals += 1
        norm = math.sqrt(r.dot(r))
    for iteration in range(newton.max_iter):
        if new_tangent:
            r, solve = linearise()
            norm = math.sqrt(r.dot(r))
            factorisations += 1
            old = False
        before = norm
        correction = solve(r)
        update(correction)
        for halving in range(newton.halvings + 1):
            if halving:
                correction *= 0.5
                update(-correction)
            r = residual()
            residuals += 1
            norm = math.sqrt(r.dot(r))
            if old or norm < before or (iteration < newton.patience and norm < math.inf):
                break
        if norm <= newton.bound and (not old or norm <= SERVES * max(before, newton.bound)):
            if old:
                update(solve(r))
            break
        if old and not norm < before:
            update(-correction)
        elif not norm < math.inf or (not old and newton.hopeless(norm, before, iteration + 1)):
            break
        new_tangent = not norm <= newton.reuse * before
    serves = norm <= newton.bound and norm <= SERVES * before
    return StepResult(norm, iteration + 1, factorisations, residuals, serves)


def solve_dense(linearise: Callable[[Any], tuple[Any, Any]], x: Any, tol: float = 1e-13) -> Any:
    """x (n,) with r(x) = 0, from a first x, by at most 50 full Newton steps; None if they do not converge.

    linearise : r (n,) and dr/dx (n, n) at x.
    """
    for _ in range(50):
        r, tangent = linearise(x)
        step = np.linalg.solve(tangent, r)
        x = x - step
        if np.abs(step).max() <= tol * (1.0 + np.abs(x).max()):
            return x
    return None
