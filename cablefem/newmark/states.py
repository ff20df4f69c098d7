from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class State(NamedTuple):
    """State at one instant, in a phase of `System.phases`."""

    t: float
    q: Array  # (n_dof,)
    v: Array  # (n_dof,) dq/dt
    a: Array  # (n_dof,) d2q/dt2
    phase: int = 0


class Inside(NamedTuple):
    """Accelerations at collocation nodes."""

    nodes: tuple[float, ...]
    dt: float
    a: Array  # (len(nodes), n_dof)


class Collocated(State):
    """The end of a collocation step."""

    inside: Inside


class Steps(NamedTuple):
    """Collocation steps to take one after another."""

    t: Array  # (m + 1,)
    ends: Array  # (m + 1, 2, n_dof) q and v; all but the first are to be set
    a: Array  # (m, s, n_dof) at the nodes, to be set; the first hold a guess
    further: Array  # (m, s, s) from a step's a to the next guess

    def first(self, m: int) -> "Steps":
        return Steps(self.t[: m + 1], self.ends, self.a[:m], self.further)


Course = list[State]  # the states of a run so far


def stacked(states: Sequence[State]) -> tuple[Array, Array, Array, Array, NDArray[np.intp]]:
    """t (n,), q, v and a (n, n_dof), and phase (n,) of a history."""
    q, v, a = np.array([x[1:4] for x in states]).swapaxes(0, 1)
    return np.array([x.t for x in states]), q, v, a, np.array([x.phase for x in states])
