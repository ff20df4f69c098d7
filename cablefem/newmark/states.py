"""States of a system."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple, overload

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


class Stretch(Sequence[State]):
    """States of one phase as arrays."""

    __slots__ = ("phase", "rows", "t")

    def __init__(self, t: Array, rows: Array, phase: int) -> None:
        self.t, self.rows, self.phase = t, rows, phase  # (m,); q, v, a (m, 3, n_dof)

    def __len__(self) -> int:
        return self.t.size

    @overload
    def __getitem__(self, i: int) -> State: ...
    @overload
    def __getitem__(self, i: slice) -> "Stretch": ...
    def __getitem__(self, i: int | slice) -> "State | Stretch":
        if isinstance(i, slice):
            return Stretch(self.t[i], self.rows[i], self.phase)
        q, v, a = self.rows[i]
        return State(self.t.item(i), q, v, a, self.phase)

    def __iter__(self) -> Iterator[State]:
        for t, (q, v, a) in zip(self.t.tolist(), self.rows, strict=True):
            yield State(t, q, v, a, self.phase)


class Course(Sequence[State]):
    """The states of a run so far."""

    def __init__(self, states: Iterable[State] = ()) -> None:
        self.parts: list[Stretch | list[State]] = []
        self._n = 0
        self.extend(list(states))

    def append(self, x: State) -> None:
        self.extend([x])

    def extend(self, states: Sequence[State]) -> None:
        self._n += len(states)
        if isinstance(states, Stretch):
            self.parts.append(states)
        elif self.parts and isinstance(self.parts[-1], list):
            self.parts[-1].extend(states)
        elif states:
            self.parts.append(list(states))

    def __len__(self) -> int:
        return self._n

    @overload
    def __getitem__(self, i: int) -> State: ...
    @overload
    def __getitem__(self, i: slice) -> list[State]: ...
    def __getitem__(self, i: int | slice) -> State | list[State]:
        if isinstance(i, slice):
            return list(self)[i]
        if not -self._n <= i < self._n:
            raise IndexError(f"state {i} of {self._n}")
        i += self._n if i < 0 else 0
        end = self._n
        for part in reversed(self.parts):
            end -= len(part)
            if i >= end:
                return part[i - end]
        raise AssertionError

    def __iter__(self) -> Iterator[State]:
        for part in self.parts:
            yield from part


class Stacked:
    """States as arrays over time."""

    def __init__(self, states: Sequence[State]) -> None:
        self._parts: Sequence[Sequence[State]] = states.parts if isinstance(states, Course) else [states]

    def _joined(self, many: Callable[[Stretch], Any], one: Callable[[State], Any]) -> Any:
        return np.concatenate([many(x) if isinstance(x, Stretch) else np.array([*map(one, x)]) for x in self._parts])

    @cached_property
    def t(self) -> Array:
        """(n,)."""
        return self._joined(lambda x: x.t, lambda x: x.t)

    @cached_property
    def q(self) -> Array:
        """(n, n_dof)."""
        return self._joined(lambda x: x.rows[:, 0], lambda x: x.q)

    @cached_property
    def v(self) -> Array:
        """(n, n_dof)."""
        return self._joined(lambda x: x.rows[:, 1], lambda x: x.v)

    @cached_property
    def a(self) -> Array:
        """(n, n_dof)."""
        return self._joined(lambda x: x.rows[:, 2], lambda x: x.a)

    @cached_property
    def phase(self) -> NDArray[np.intp]:
        """(n,)."""
        return self._joined(lambda x: np.full(len(x), x.phase), lambda x: x.phase)
