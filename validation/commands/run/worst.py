"""Positions of cars at rest that are added to those of a line: over what they pass, and where numbers are extreme."""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from cablefem import catenary_line
from cablefem.scene.line import Car, Line
from validation.commands.run.line import numbers_by_position
from validation.commands.run.lines import Row


def with_added_positions(line: Line) -> Line:
    """The line with its cars also over every obstacle and top of the ground that they pass between two positions.

    A car without `at` is over each span, and at every position where a number is extreme.
    """
    car = next((car for car in line.car if car.at is None), None)
    return _with_positions_over_tops(line) if car is None else _with_extreme_positions(line, car)


def _with_positions_over_tops(line: Line) -> Line:
    """The line with a position for each top that a car passes between two, the other cars in proportion."""
    tops = _tops_below(line)
    given = np.array([[line.position_of(car, i) for car in line.car] for i in range(line.position_count)])  # (n, cars)
    positions = [given[0]]
    for before, after in itertools.pairwise(given):
        at_tops = {1.0: after}  # by share of the way
        for (k, (a, b)), x in itertools.product(enumerate(zip(before, after, strict=True)), tops):
            if min(a, b) < x < max(a, b):
                share = float((x - a) / (b - a))
                between = at_tops.setdefault(share, before + share * (after - before))
                between[k] = x  # without rounding
        positions += [at_tops[share] for share in sorted(at_tops)]
    if len(positions) == len(given):
        return line
    x_by_car = np.transpose(positions).tolist()
    return line.replace({f"car.{car.name}.at": x for car, x in zip(line.car, x_by_car, strict=True)})


def _tops_below(line: Line) -> list[float]:
    """x [m] of obstacles, and of the ends of the ground and its corners that rise above their neighbours' chord."""
    tops = [o.at for o in line.obstacle]
    if line.ground:
        x, depth = np.transpose(line.ground)
        rises = np.diff(np.diff(depth) / np.diff(x)) > 0.0  # depth points down
        tops += x[[True, *rises.tolist(), True]].tolist()
    return tops


def _with_extreme_positions(line: Line, car: Car) -> Line:
    """The line with a car over each span and at every position where a number is extreme."""
    positions = _NumbersByCarPosition(line, f"car.{car.name}.at")
    first = sorted(set(_positions_to_try_first(line)))
    positions.solve_at(first)
    for _ in range(6):  # of parabolas, at most
        vertices = positions.untried_parabola_vertices()
        if not vertices:
            break
        positions.solve_at(vertices)
    return positions.line_with_car_at([*first, *positions.positions_of_extreme_numbers()])


def _positions_to_try_first(line: Line) -> Iterator[float]:
    """Positions over each span, the middles of shoes, obstacles and tops of the ground."""
    low = 0.0
    high = line.contact[-1].at[0]
    count = 17  # positions in each span that are tried first
    near = 1e-3  # of a span: closest to an end of the rope
    for left, right in itertools.pairwise(line.contact):
        a = left.at[0]
        b = right.at[0]
        gap = near * (b - a)
        yield from np.linspace(a + (left.shoe or gap) + gap, b - (right.shoe or gap) - gap, count).tolist()
        if left.shoe is not None:
            yield from (a - left.shoe, a, a + left.shoe)
    yield from (x for x in _tops_below(line) if low < x < high)


class _NumbersByCarPosition:
    """Numbers of a line by position of its car; a position without rest has none."""

    def __init__(self, line: Line, key: str) -> None:
        self.line = line
        self.key = key
        self.rows: dict[float, Row] = {}

    def line_with_car_at(self, positions: list[float]) -> Line:
        return self.line.replace({self.key: sorted(set(positions))})

    def solve_at(self, positions: list[float]) -> None:
        """Compute the numbers at these positions, and store them in `rows`."""
        rest = self.line_with_car_at(positions).solve_at_rest(catenary_line.solve)
        for x, row in zip(sorted(set(positions)), numbers_by_position(rest), strict=True):
            self.rows[x] = row or {}

    def _curves_with_extreme_index(self) -> Iterator[tuple[np.ndarray, np.ndarray, int]]:
        """Yield positions and values (n,) of each number with the index of its largest, and again with its smallest."""
        x = np.array(sorted(self.rows))
        names = {name for row in self.rows.values() for name, value in row.items() if isinstance(value, float)}
        for name in sorted(names):
            y = np.array([self.rows[position].get(name) for position in x], float)  # None is nan
            if np.isfinite(y).any():
                yield x, y, int(np.nanargmax(y))
                yield x, y, int(np.nanargmin(y))

    def positions_of_extreme_numbers(self) -> list[float]:
        return [float(x[k]) for x, _, k in self._curves_with_extreme_index()]

    def untried_parabola_vertices(self) -> list[float]:
        """Vertices of parabolas through each extreme and its neighbours, where nothing was solved yet."""
        out: list[float] = []
        same = 1e-6  # of the line: positions that are one
        for x, y, k in self._curves_with_extreme_index():
            if not 0 < k < x.size - 1 or not np.isfinite(y[k - 1 : k + 2]).all():
                continue
            a, b = np.polyfit(x[k - 1 : k + 2] - x[k], y[k - 1 : k + 2] - y[k], 2)[:2]
            vertex = float(x[k] - b / (2.0 * a)) if a else math.nan
            tried = np.array([*self.rows, *out])
            if x[k - 1] < vertex < x[k + 1] and np.abs(tried - vertex).min() > same * x[-1]:
                out.append(vertex)
        return out
