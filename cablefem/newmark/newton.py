import math
from collections.abc import Callable
from typing import Any, NamedTuple


class Newton(NamedTuple):
    """Settings of Newton's method; converged: |r| <= bound = tol force_scale + sqrt(n_dof) force_floor.

    The tangent is kept if |r| falls to `reuse` or less.  After `patience` iterations corrections are
    halved until |r| falls, at most `halvings` times.  The method stops if `enough` iterations seem too few.
    """

    tol: float = 1e-4
    max_iter: int = 25
    reuse: float = 0.1
    patience: int = 2
    enough: float = math.inf
    halvings: int = 5
    bound: float = 0.0  # `Stepper` sets it

    def hopeless(self, norm: float, before: float, iterations: int) -> bool:
        tried = self.enough < math.inf and iterations > self.patience
        return tried and norm * (norm / before) ** (self.enough - iterations) > self.bound


STANDARD = Newton()


class StepResult(NamedTuple):
    norm: float
    iterations: int
    factorisations: int
    residuals: int


def find_root(
    residual: Callable[[], Any], linearise: Callable[[], tuple[Any, Callable]], update: Callable[[Any], None],
    newton: Newton,
) -> StepResult:  # fmt: skip
    """Take corrections, `update(x)` subtracts x, until |residual()| <= newton.bound; NaN never converges."""
    norm = math.inf
    factorisations = 0
    residuals = 0
    anew = True
    for iteration in range(newton.max_iter):
        if anew:
            r, solve = linearise()
            norm = math.sqrt(r.dot(r))
            factorisations += 1
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
            if norm < before or (iteration < newton.patience and norm < math.inf):
                break
        if norm <= newton.bound or not norm < math.inf or newton.hopeless(norm, before, iteration + 1):
            break
        anew = norm > newton.reuse * before
    return StepResult(norm, iteration + 1, factorisations, residuals)
