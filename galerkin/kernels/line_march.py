"""Compiled collocation steps of a line with the factors of a step before, see `newmark.compiled_collocation`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cablefem.newmark.compiled_collocation import march_while_factors_serve
from galerkin.kernels.line import Line, evaluate_line_with_unknowns
from galerkin.law import compiled, inner

if TYPE_CHECKING:
    from cablefem.newmark import StepsWithFactors
    from galerkin.line_equations import BlockInverse


class LineInSteps(NamedTuple):
    """A line and what is prescribed at the nodes of steps."""

    line: Line
    prescribed: Any  # see `evaluate_line_with_unknowns`, (m, 3, s, coordinates)
    frictions: Any  # (m, s, contacts, 5)


@compiled
def take_steps_while_factors_serve(line: LineInSteps, moving: Any, steps: StepsWithFactors) -> int:
    """See `march_while_factors_serve`; moving (n_dof,): whether an unknown is of no car that sticks."""
    return march_while_factors_serve(set_residuals, solve_in_place, line, np.arange(moving.size), moving, steps)


@inner
def set_residuals(line: LineInSteps, k: int, x: Any, r: Any) -> None:
    """Set the residuals r (s, n_dof) of the nodes of step k; x (s, 3, n_dof)."""
    values = evaluate_line_with_unknowns(line.line, line.prescribed[k], x, line.frictions[k])
    for i in range(r.shape[0]):
        for j in range(r.shape[1]):
            r[i, j] = values.r[i, j]


@inner
def solve_in_place(inverse: BlockInverse, b: Any) -> None:
    """Overwrite b (n_dof,) with the solution."""
    edges = inverse.edges
    blocks = inverse.blocks
    from_contacts = inverse.from_contacts
    contacts = inverse.contacts
    n = blocks.shape[0]
    x = np.zeros_like(b)
    for i in range(n, b.size):
        for j in range(b.size):
            x[i] += contacts[i - n, j] * b[j]
    for k in range(edges.size - 1):
        for i in range(edges[k], edges[k + 1]):
            for j in range(edges[k], edges[k + 1]):
                x[i] += blocks[i, j] * b[j]
            for j in range(n, b.size):
                x[i] -= from_contacts[i, j - n] * x[j]
    for i in range(b.size):
        b[i] = x[i]
