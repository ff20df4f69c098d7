from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import State, States, System
from cablefem.response import Array, Observation


class Solver(System, Protocol):
    """A dimensionless `System` with a mass.

    `min_tension_and_position` decides slack.  It is the least mean over an element or a shortest wavelength, so that
    ripples do not count.
    """

    @property
    def min_tension_and_position(self) -> tuple[float, float]:
        """At the last residual or step: the smallest tension and its s."""

    def with_law(self, law: str) -> Solver:
        """The same system under "elastic" or "tension-only"."""

    def position(self, x: State) -> float:
        """s_o of a state."""

    def states_over_time(self, states: States) -> States:
        """The states as functions of time, where the system's own variable may be s_o."""

    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        """Measure `states_over_time`; fields at stations s for the rows `frames`."""

    def mass_positions_and_displacements(self, states: States) -> tuple[Array, Array]:
        """s_o (n,) and the displacement of the mass (n, 2), of `states_over_time`."""
