"""Error bars from a run and coarser runs of one method."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cablefem.response import Response
from validation.core.measures import NotComparable
from validation.core.order import left
from validation.core.view import View

Of = Callable[[Response], Any]
Apart = Callable[[Any, Any], Any]


def itself(r: Response) -> Response:
    return r


def largest(a: Any, b: Any) -> float:
    return float(np.max(np.abs(np.subtract(a, b)), initial=0.0))


@dataclass(frozen=True, slots=True)
class Branch:
    """Coarser runs in space or time: half and quarter, if there are any."""

    runs: tuple[Response, ...]
    ratios: tuple[float, ...]  # times coarser than the run before
    order: float  # nominal, of the path

    def left(self, finest: Response, of: Of, apart: Apart, most: float) -> Any:
        """The bar of the finest run in this direction; infinite without a half."""
        if not self.runs:
            return math.inf
        try:
            values = [of(r) for r in (finest, self.runs[0])]
            d = apart(*values)
        except NotComparable:
            return math.inf
        before = 0.0
        for quarter in self.runs[1:2]:
            try:
                before = apart(values[1], of(quarter))
            except NotComparable:
                before = 0.0
        before = np.nan_to_num(before, nan=0.0, posinf=0.0)
        return left(d, before, self.ratios, min(self.order, most))


@dataclass(frozen=True, slots=True)
class Ladder:
    """Runs of one method on one scene, and their bars."""

    finest: Response
    space: Branch
    time: Branch

    @property
    def run(self) -> Response:
        return self.finest

    @property
    def runs(self) -> tuple[Response, ...]:
        return self.finest, *self.space.runs, *self.time.runs

    def map(self, change: Callable[[Any], Response]) -> Ladder:
        """The ladder with all runs changed."""
        space, time = (replace(x, runs=tuple(map(change, x.runs))) for x in (self.space, self.time))
        return Ladder(change(self.finest), space, time)

    def over(self, view: View) -> Ladder:
        """Without runs that end before the view does, and without all coarser ones."""

        def kept(branch: Branch) -> Branch:
            n = next((i for i, r in enumerate(branch.runs) if not view.covers(r)), len(branch.runs))
            return replace(branch, runs=branch.runs[:n])

        return replace(self, space=kept(self.space), time=kept(self.time))

    def parts(self, of: Of, apart: Apart = largest, order: float = math.inf) -> tuple[Any, Any]:
        space, time = (branch.left(self.finest, of, apart, order) for branch in (self.space, self.time))
        return space, time

    def bar(self, of: Of, apart: Apart = largest, order: float = math.inf) -> Any:
        """The error bar of a functional of the finest run.

        of : a number or series;  apart : a distance, an array for a bar of each value.
        order : the most credited, if less than the path's.
        """
        return sum(self.parts(of, apart, order))

    def told(self, of: Of) -> float:
        """The bar of a yes or no: 0 if all runs answer alike, else infinite."""
        answers = [of(r) for r in self.runs]
        alike = len(self.space.runs) > 0 and len(self.time.runs) > 0 and all(x == answers[0] for x in answers)
        return 0.0 if alike else math.inf
