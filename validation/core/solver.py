from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import State, System
from cablefem.response import Array, Observation, States


class Solver(System, Protocol):
    """A dimensionless `System` with a mass.

    `min_tension` decides slack: the least mean over an element or shortest wavelength, so that ripples do not count.
    """

    @property
    def min_tension(self) -> tuple[float, float]:
        """At the last residual or step, and its s."""

    def with_law(self, law: str) -> Solver:
        """The same system under "elastic" or "tension-only"."""

    def position(self, x: State) -> float:
        """s_o of a state."""

    def in_time(self, states: States) -> States:
        """A history over time."""

    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        """Measure a history `in_time`; fields at stations s for the rows `frames`."""

    def path(self, states: States) -> tuple[Array, Array]:
        """s_o (n,) and the displacement of the mass (n, 2) of a history `in_time`."""
