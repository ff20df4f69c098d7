"""States of a system."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

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
    extrapolation: Array  # (m, s, s) from a step's a to the next guess

    def section(self, first: int, end: int) -> "Steps":
        return Steps(
            self.t[first : end + 1], self.ends[first : end + 1], self.a[first:end], self.extrapolation[first:end]
        )


class StateBlock(Sequence[State]):
    """States of one phase as arrays: t (m,); q, v, a (m, 3, n_dof)."""

    __slots__ = ("phase", "rows", "t")

    def __init__(self, t: Array, rows: Array, phase: int) -> None:
        self.t = t
        self.rows = rows
        self.phase = phase

    def __len__(self) -> int:
        return self.t.size

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return StateBlock(self.t[i], self.rows[i], self.phase)
        q, v, a = self.rows[i]
        return State(self.t.item(i), q, v, a, self.phase)


class StateHistory(Sequence[State]):
    """The states of a run so far."""

    def __init__(self, states: Iterable[State] = ()) -> None:
        self.blocks: list[StateBlock | list[State]] = []
        self._n = 0
        self.extend(list(states))

    def append(self, x: State) -> None:
        self.extend([x])

    def extend(self, states: Sequence[State]) -> None:
        self._n += len(states)
        if isinstance(states, StateBlock):
            self.blocks.append(states)
        elif self.blocks and isinstance(self.blocks[-1], list):
            self.blocks[-1].extend(states)
        elif states:
            self.blocks.append(list(states))

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return list(self)[i]
        at = range(self._n)[i]
        first = self._n
        for block in reversed(self.blocks):
            first -= len(block)
            if at >= first:
                return block[at - first]

    def __iter__(self) -> Iterator[State]:
        for block in self.blocks:
            yield from block


def _state_arrays(states: Sequence[State]) -> tuple[Array, Array, NDArray[np.intp]]:
    """t (n,), q, v, a (n, 3, n_dof) and phase (n,)."""
    if isinstance(states, StateBlock):
        return states.t, states.rows, np.full(len(states), states.phase)
    t = np.array([x.t for x in states])
    rows = np.array([x[1:4] for x in states])
    return t, rows, np.array([x.phase for x in states])


class States(NamedTuple):
    """n states as arrays, dimensionless but for a line in motion."""

    t: Array  # (n,)
    q: Array  # (n, n_dof)
    v: Array
    a: Array
    phase: NDArray[np.intp]  # (n,)


def stack_states(states: Sequence[State]) -> States:
    """The states as arrays, a row for each."""
    blocks = states.blocks if isinstance(states, StateHistory) else [states]
    t, rows, phase = (np.concatenate(column) for column in zip(*map(_state_arrays, blocks), strict=True))
    return States(t, rows[:, 0], rows[:, 1], rows[:, 2], phase)
