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
    tops = _x_of_obstacles_and_ground_tops(line)
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


def _x_of_obstacles_and_ground_tops(line: Line) -> list[float]:
    """x [m] of obstacles, and of the ends of the ground and its corners that rise above their neighbours' chord."""
    tops = [o.at for o in line.obstacle]
    if line.ground:
        x, depth = np.transpose(line.ground)
        rises = np.diff(np.diff(depth) / np.diff(x)) > 0.0  # depth points down
        tops += x[[True, *rises.tolist(), True]].tolist()
    return tops


def _with_extreme_positions(line: Line, car: Car) -> Line:
    """The line with a car over each span and at every position where a number is extreme."""
    key = f"car.{car.name}.at"
    first = sorted(set(_positions_to_try_first(line)))
    numbers: dict[float, Row] = {}  # by position; a position without rest has none
    untried = first
    for _ in range(7):  # once, and of parabolas 6 times at most
        rest = line.replace({key: untried}).solve_at_rest(catenary_line.solve)
        numbers |= {x: row or {} for x, row in zip(untried, numbers_by_position(rest), strict=True)}
        extremes, untried = _extreme_positions_and_untried_vertices(numbers)
        if not untried:
            break
    return line.replace({key: sorted({*first, *extremes})})


def _extreme_positions_and_untried_vertices(numbers: dict[float, Row]) -> tuple[list[float], list[float]]:
    """Where a number is largest or smallest, and vertices of parabolas through that and its neighbours.

    Vertices: sorted, without those where a rest was computed already.
    """
    x = np.array(sorted(numbers))
    same = 1e-6 * x[-1]  # [m] positions that are one
    extremes: list[float] = []
    vertices: list[float] = []
    for name in sorted({name for row in numbers.values() for name, value in row.items() if isinstance(value, float)}):
        y = np.array([numbers[position].get(name) for position in x], float)  # None is nan
        for k in {int(np.nanargmax(y)), int(np.nanargmin(y))}:
            extremes.append(float(x[k]))
            near = slice(max(k - 1, 0), k + 2)
            vertex = _parabola_vertex(x[near] - x[k], y[near] - y[k]) + x[k]
            tried = np.array([*numbers, *vertices])
            if x[near][0] < vertex < x[near][-1] and np.abs(tried - vertex).min() > same:
                vertices.append(float(vertex))
    return extremes, sorted(vertices)


def _parabola_vertex(x: np.ndarray, y: np.ndarray) -> float:
    """x of the vertex of the parabola through three points; nan of fewer, and of points on a line."""
    if x.size < 3 or not np.isfinite(y).all():
        return math.nan
    a, b, _ = np.polyfit(x, y, 2)
    return float(-b / (2.0 * a)) if a else math.nan


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
    yield from (x for x in _x_of_obstacles_and_ground_tops(line) if low < x < high)
