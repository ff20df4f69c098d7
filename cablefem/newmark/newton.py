import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

FAST = 0.1  # rate of convergence with which the tangent of a step before serves the next one


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

    def needs_too_many_iterations(self, norm: float, norm_before: float, iterations: int) -> bool:
        """Whether |r|, falling at its present rate, is above the bound after `enough` iterations."""
        if self.enough == math.inf or iterations <= self.patience:
            return False
        return norm >= norm_before or norm * (norm / norm_before) ** (self.enough - iterations) > self.bound


STANDARD = Newton()


class StepResult(NamedTuple):
    """|r| at the end of Newton's method, and its work."""

    norm: float
    iterations: int
    factorisations: int
    residuals: int
    serves_next_step: bool = False  # whether the last tangent serves the next step, too


def find_root(
    residual: Callable[[], Any], linearise: Callable[[], tuple[Any, Callable]], subtract: Callable[[Any], None],
    newton: Newton, earlier_solve: Any = None,
) -> StepResult:  # fmt: skip
    """Subtract corrections until |residual()| <= newton.bound; NaN never converges.

    earlier_solve : solution with the tangent of a step before, which is tried first.
    """
    norm = math.inf
    before = 0.0
    iterations = factorisations = residuals = 0
    if earlier_solve is not None:
        tried, converged = _correct_by_earlier_tangent(residual, earlier_solve, subtract, newton)
        if converged:
            return tried
        norm, iterations, _, residuals, _ = tried
    new_tangent = True
    while iterations < newton.max_iter:
        if new_tangent:
            r, solve = linearise()
            norm = math.sqrt(r.dot(r))
            factorisations += 1
        before = norm
        norm_allowed = math.inf if iterations < newton.patience else before
        r, norm, evaluations = _correct_with_halvings(residual, subtract, solve(r), norm_allowed, newton.halvings)
        residuals += evaluations
        iterations += 1
        converged = norm <= newton.bound
        if converged or not norm < math.inf or newton.needs_too_many_iterations(norm, before, iterations):
            break
        new_tangent = norm > newton.reuse * before
    serves = norm <= newton.bound and norm <= FAST * before
    return StepResult(norm, iterations, factorisations, residuals, serves)


def _correct_with_halvings(
    residual: Callable[[], Any], subtract: Callable[[Any], None], correction: Any, norm_allowed: float, halvings: int
) -> tuple[Any, float, int]:
    """Take a correction, halved until |r| < `norm_allowed`; return r, |r|, and how often it was evaluated."""
    subtract(correction)
    for halving in range(halvings + 1):
        if halving:
            correction *= 0.5
            subtract(-correction)
        r = residual()
        norm = math.sqrt(r.dot(r))
        if norm < norm_allowed:
            break
    return r, norm, halving + 1


def _correct_by_earlier_tangent(
    residual: Callable[[], Any], solve: Callable[[Any], Any], subtract: Callable[[Any], None], newton: Newton
) -> tuple[StepResult, bool]:
    """Corrections with the tangent of a step before while |r| falls to `reuse` or less; and whether they converged.

    One that does not help is taken back.  What they leave is larger than with a new tangent, so a last one follows,
    whose effect is known without a residual.
    """
    r = residual()
    norm = math.sqrt(r.dot(r))
    iterations = 0
    while iterations < newton.max_iter:
        before = norm
        correction = solve(r)
        subtract(correction)
        r = residual()
        norm = math.sqrt(r.dot(r))
        iterations += 1
        if norm <= newton.bound and norm <= FAST * max(before, newton.bound):
            subtract(solve(r))
            return StepResult(norm, iterations, 0, iterations + 1, norm <= FAST * before), True
        if not norm < before:
            subtract(-correction)
        if not norm <= newton.reuse * before:
            break
    return StepResult(norm, iterations, 0, iterations + 1), False


def solve_newton_dense(linearise: Callable[[Any], tuple[Any, Any]], first_guess: Any) -> Any | None:
    """x (n,) with r(x) = 0, from a first guess, by at most 50 full Newton steps; None if they do not converge.

    linearise : r (n,) and dr/dx (n, n) at x.
    """
    tolerance = 1e-13  # of x
    x = first_guess
    for _ in range(50):
        r, tangent = linearise(x)
        step = np.linalg.solve(tangent, r)
        x = x - step
        if np.abs(step).max() <= tolerance * (1.0 + np.abs(x).max()):
            return x
    return None
