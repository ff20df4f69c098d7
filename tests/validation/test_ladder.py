"""Error bars from coarser runs: they hold where errors have an order, and are wide or infinite where none shows."""

import math
from typing import Any

import numpy as np
import pytest

from validation.core.ladder import Branch, Ladder
from validation.core.measures import NotComparable
from validation.core.order import error_bar, observed_order

SAME: Any = lambda r: r  # noqa: E731 - runs of these tests are their own answers


def ladder(finest: Any, space: Any = (), time: Any = (), order: float = 2.0, ratio: float = 2.0) -> Ladder:
    return Ladder(finest, Branch(tuple(space), (ratio,) * 2, order), Branch(tuple(time), (ratio,) * 2, order))


@pytest.mark.parametrize("order", [0.7, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("ratios", [(2.0, 2.0), (1.5, 1.7), (1.9, 1.5)])
def test_a_bar_is_a_little_more_than_an_error_with_an_order(order: float, ratios: tuple[float, float]) -> None:
    error = np.array([1.0, ratios[0] ** order, (ratios[0] * ratios[1]) ** order])
    bar = error_bar(error[1] - error[0], error[2] - error[1], ratios, 2.0)
    assert bar == pytest.approx(1.25, rel=1e-3)


@pytest.mark.parametrize("order", [0.56, 1.6, 4.0])
@pytest.mark.parametrize("ratios", [(2.0, 2.0), (2.0, 2.25), (1.5, 2.2)])
def test_the_order_of_three_values_is_observed(order: float, ratios: tuple[float, float]) -> None:
    """It was none where the coarser runs are further apart than the finer ones."""
    r, coarser = ratios
    values = [1.0, r**order, (r * coarser) ** order]
    assert observed_order(values, ratios) == pytest.approx(order, rel=1e-9)
    assert observed_order([1.0, 2.0, 2.5], ratios) is None  # changes that grow


def test_more_than_the_nominal_order_is_not_credited() -> None:
    assert error_bar(1.0, 12.0, (2.0, 2.0), 2.0) == pytest.approx(1.25 * 12.0 / 4.0 / 3.0)
    assert error_bar(1.0, 4.0, (2.0, 2.0), 2.0) == pytest.approx(1.25 / 3.0)


def test_a_change_that_is_small_by_chance_is_none() -> None:
    assert error_bar(0.2, 1.0, (2.0, 2.0), 1.0) == pytest.approx(1.25 * 0.5)


def test_a_quarter_that_is_far_off_tells_nothing() -> None:
    assert error_bar(1e-3, 1.0, (2.0, 2.0), 2.0) == pytest.approx(3e-3, rel=0.01)


def test_where_no_order_shows_the_bar_is_three_times_the_change() -> None:
    for before in (0.0, 0.5, 1.0, 1.4):
        assert error_bar(1.0, before, (2.0, 2.0), 2.0) == pytest.approx(3.0, rel=0.01)


def test_nothing_that_changes_has_no_bar_and_nan_has_an_infinite_one() -> None:
    assert error_bar(0.0, 0.0, (2.0, 2.0), 2.0) == 0.0
    assert error_bar(math.nan, 1.0, (2.0, 2.0), 2.0) == math.inf


def test_space_and_time_add_and_arrays_have_a_bar_of_each_value() -> None:
    one = ladder(1.0, (1.3, 2.5), (0.9, 0.5))
    assert one.error_bar(SAME) == pytest.approx(1.25 * (0.3 + 0.1) / 3.0)
    many = ladder(np.zeros(2), (np.array([0.3, 0.2]),), (np.array([0.1, 0.0]),))
    assert many.error_bar(SAME, lambda a, b: np.abs(a - b)) == pytest.approx(3.0178 * np.array([0.4, 0.2]), rel=1e-3)


def test_without_a_half_that_tells_the_bar_is_infinite_and_without_a_quarter_no_order_shows() -> None:
    assert ladder(1.0, (), (1.0, 1.0)).error_bar(SAME) == math.inf

    def refuses(a: float, b: float) -> float:
        if max(a, b) > 2.0:
            raise NotComparable("ends early")
        return abs(a - b)

    assert ladder(1.0, (3.0, 1.0), (1.0, 1.0)).error_bar(SAME, refuses) == math.inf
    assert ladder(1.0, (1.5, 3.0), (1.0, 1.0)).error_bar(SAME, refuses) == pytest.approx(1.5, rel=0.01)


def test_a_yes_or_no_is_known_where_all_runs_tell_it_alike() -> None:
    def bars(*runs):
        return ladder(*runs).yes_no_error_bars_in_space_and_time(lambda r: r > 0.0)

    assert bars(1.0, (1.2, 1.4), (1.1, 1.1)) == (0.0, 0.0)
    assert bars(1.0, (1.2, -1.4), (1.1, 1.1)) == (math.inf, 0.0)
    assert bars(1.0, (1.2, 1.4), (-1.1, 1.1)) == (0.0, math.inf)
    assert bars(1.0, (), (1.1, 1.1)) == (math.inf, 0.0)
