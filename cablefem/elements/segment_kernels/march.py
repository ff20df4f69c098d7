"""Compiled collocation steps of a line with the factors of a step before, see `newmark.compiled_collocation`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.elements.bordered import BandFactors
from cablefem.elements.kernels.banded import solve_factored_band_in_place
from cablefem.elements.segment_kernels.balance import compiled, inner
from cablefem.elements.segment_kernels.contacts import Line, Slots, set_dependent_coordinates, set_rows_and_loads
from cablefem.newmark import Array
from cablefem.newmark.compiled_collocation import march_while_factors_serve
from cablefem.newmark.marching import StepsWithFactors

if TYPE_CHECKING:
    from cablefem.elements.line_balance import CoordinateSolve


class System(NamedTuple):
    line: Line
    slots: Slots  # of unknowns (n_dof,)
    prescribed: Array  # (m, 3, s, size) coordinates with rates at the nodes of steps


@compiled
def take_steps_while_factors_serve(system: System, moving: NDArray[np.bool_], steps: StepsWithFactors) -> int:
    """See `march_while_factors_serve`; moving (size,): whether a slot is one of an unknown, of no car that sticks."""
    return march_while_factors_serve(set_residuals, solve_in_place, system, system.slots, moving, steps)


@inner
def set_residuals(system: System, k: int, x: Array, r: Array) -> None:
    """Set the residuals r (s, size) of the nodes of step k from unknowns with their rates x (s, 3, n_dof)."""
    line = system.line
    nodes = r.shape[0]
    z = system.prescribed[k].copy()
    for i in range(nodes):
        for order in range(3):
            for j in range(x.shape[2]):
                z[order, i, system.slots[j]] = x[i, order, j]
    set_dependent_coordinates(line.trolleys, line.rails, z)
    loads = np.empty((nodes, line.cars.loads.size + 2 * line.trolleys.loads.size + 1))
    set_rows_and_loads(line, k * nodes, z, r, loads)


@inner
def solve_in_place(of_unknowns: CoordinateSolve, b: Array) -> None:
    """Overwrite b (size,) with the solution for all coordinates."""
    solve_bordered_in_place(of_unknowns.factors, b)


@compiled
def solve_bordered_in_place(factors: BandFactors, b: Array) -> None:
    """Overwrite b (size,) with the solution."""
    n = factors.band.shape[0]
    solve_factored_band_in_place(factors.band, b[:n])
    right = np.empty_like(b[n:])
    for i in range(right.size):
        x = b[n + i]
        row = factors.rows[i]
        for j in range(n):
            x -= row[j] * b[j]
        right[i] = x
    for i in range(right.size):
        x = 0.0 * b[0]
        for k in range(right.size):
            x += factors.inverse[i, k] * right[k]
        b[n + i] = x
        column = factors.from_border[i]
        for j in range(n):
            b[j] -= column[j] * x
