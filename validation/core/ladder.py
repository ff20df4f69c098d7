"""Error bars from a run and coarser runs of one method."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from cablefem.response import Response
from validation.core.agreement import Agreement, Bound, BoundPart
from validation.core.measures import NotComparable
from validation.core.order import error_bar
from validation.core.view import View

ROUNDING = 1e-12  # of the scale of any quantity
Run = TypeVar("Run")  # Response, or LineRun
Functional = Callable[[Any], Any]  # of a run
Distance = Callable[[Any, Any], Any]  # distance of two values


def identity(r: Response) -> Response:
    return r


def max_distance(a: Any, b: Any) -> float:
    return float(np.max(np.abs(np.subtract(a, b)), initial=0.0))


def error_bars_of_at_least_gap(
    row: dict[str, Any], other: dict[str, Any] | None, bar_of: dict[str, str]
) -> dict[str, float]:  # fmt: skip
    """The known bars of a row, each at least the gap to the other solver's value; bar_of : its key by the value's."""
    bars = {}
    for name, bar in bar_of.items():
        if other is not None and None not in (row[bar], row[name], other[name]):
            bars[bar] = max(row[bar], abs(row[name] - other[name]))
    return bars


@dataclass(frozen=True, slots=True)
class Branch(Generic[Run]):
    """Coarser runs in space or time: half and quarter, if there are any."""

    runs: tuple[Run, ...]
    ratios: tuple[float, ...]  # times coarser than the run before
    order: float  # nominal, of the path

    def error_bar(self, finest: Run, functional: Functional, distance: Distance, order: float) -> Any:
        """The bar of the finest run in this direction; infinite without a half."""
        if not self.runs:
            return math.inf
        try:
            half = functional(self.runs[0])
            change = distance(functional(finest), half)
        except NotComparable:
            return math.inf
        change_before = 0.0
        for quarter in self.runs[1:2]:
            with contextlib.suppress(NotComparable):
                change_before = distance(half, functional(quarter))
        change_before = np.nan_to_num(change_before, nan=0.0, posinf=0.0)
        return error_bar(change, change_before, self.ratios, min(self.order, order))

    def finest_half_and_quarter_values(self, finest: Run, functional: Functional) -> list[float]:
        """Values of the finest run, of half and of a quarter, up to the first that is not known."""
        values = [float(functional(run)) for run in (finest, *self.runs[:2])]
        return list(itertools.takewhile(math.isfinite, values))


@dataclass(frozen=True, slots=True)
class Ladder(Generic[Run]):
    """Runs of one method on one scene, and their bars."""

    finest: Run
    space: Branch[Run]
    time: Branch[Run]
    start_gap: Any = 0.0  # (x, y) of the start from a run that resolves its distance from the support; over deflection

    @classmethod
    def of_one_run(cls, run: Run) -> Ladder[Run]:
        """Without coarser runs: bars are infinite."""
        none: Branch[Run] = Branch((), (), 0.0)
        return cls(run, none, none)

    @property
    def runs(self) -> tuple[Run, ...]:
        return self.finest, *self.space.runs, *self.time.runs

    def map(self, change: Callable[[Any], Run]) -> Ladder[Run]:
        """A ladder of all runs, changed."""
        space, time = (replace(x, runs=tuple(map(change, x.runs))) for x in (self.space, self.time))
        return replace(self, finest=change(self.finest), space=space, time=time)

    def only_runs_covering(self, view: View) -> Ladder[Run]:
        """A ladder without coarser runs that end before the view does, and without those coarser than them."""

        def covering(branch: Branch[Any]) -> Branch[Any]:
            runs = tuple(itertools.takewhile(view.is_reached_by, branch.runs))
            return replace(branch, runs=runs)

        return replace(self, space=covering(self.space), time=covering(self.time))

    def error_bars_in_space_and_time(
        self, functional: Functional, distance: Distance = max_distance, order: float = math.inf
    ) -> tuple[Any, Any]:
        """The parts of `error_bar`."""
        in_space = self.space.error_bar(self.finest, functional, distance, order)
        in_time = self.time.error_bar(self.finest, functional, distance, order)
        return in_space, in_time

    def error_bar(self, functional: Functional, distance: Distance = max_distance, order: float = math.inf) -> Any:
        """The error bar of a functional of the finest run.

        functional : a number or series;  distance : of two values, an array for a bar of each value.
        order : the largest that is credited, if less than the path's.
        """
        return sum(self.error_bars_in_space_and_time(functional, distance, order))

    def yes_no_error_bars_in_space_and_time(self, functional: Functional) -> tuple[float, float]:
        """The parts of the bar of a yes or no: 0 where coarser runs answer as the finest does, else infinite."""

        def bar(coarser: Branch[Run]) -> float:
            answers = {functional(run) for run in coarser.runs}
            return 0.0 if answers == {functional(self.finest)} else math.inf

        return bar(self.space), bar(self.time)


def row_with_error_bars(
    quantity: str, gap: float, ladders: Sequence[Ladder], parts: Sequence[tuple[float, float]], required: float
) -> Agreement:  # fmt: skip
    """The row of a gap of two ladders;  parts : of both bars, in space and time."""
    bars = []
    for ladder, in_space_and_time in zip(ladders, parts, strict=True):
        bars.append(BoundPart(ladder.finest.method, max(ROUNDING, sum(in_space_and_time)), "coarser runs"))
    return Agreement(quantity, gap, Bound("error bars", tuple(bars)), required=required, parts=tuple(parts))


class Goal(NamedTuple):
    """An error bar and the target that refinement brings it down to.

    parts : of the bar in space and time;  order : the largest that is credited.
    """

    parts: tuple[float, float]
    target: float
    order: float = math.inf

    @property
    def bar(self) -> float:
        return sum(self.parts)

    @property
    def bar_over_target(self) -> float:
        return self.bar / self.target
