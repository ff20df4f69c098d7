"""What a discretised scene answers: all that the judge asks of it, and nothing of how it was discretised."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from cablefem.newmark import State, System
from cablefem.response import Array, Observation, States


class Solver(System, Protocol):
    """A system of the time driver that knows its mass and can be looked at; all of it dimensionless.

    Two tensions go by the word least.  `least_tension` decides when the cable is slack: the least MEAN over what the
    method resolves (an element, a shortest wavelength), because ripples have no mean and a slack cable has.
    `Observation.tension_min` is the least at any POINT: what the discretisation believes, ripples and all.

    A solver that changes over at events has `cablefem.newmark.Watched`'s members as well, one that tells
    the path by itself those of `Pathed`.
    """

    @property
    def least_tension(self) -> tuple[float, float]:
        """Least mean tension at the last residual or step, and its s."""

    def with_law(self, law: str) -> Solver:
        """Return the same system under "elastic" or "tension-only", to go on from a state of this one."""

    def place(self, x: State) -> float:
        """Return s_o of a state."""

    def in_time(self, states: States) -> States:
        """Return a history with time as its independent variable; itself where it has that already."""

    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        """Measure a history `in_time`: at all its instants, and the fields at the stations s for the rows `frames`."""


@runtime_checkable
class Pathed(Protocol):
    """What a solver answers besides that need not be observed while a resolution is looked for."""

    def path(self, states: States) -> tuple[Array, Array]:
        """Return s_o (n,) and the displacement of the mass (n, 2) of a history `in_time`; see `Observation`."""
