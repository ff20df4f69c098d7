"""Extrapolated answers: only where the order is seen, and their bar holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from validation import run
from validation.core import measures
from validation.core.estimate import estimated
from validation.core.extrapolation import SEEN, extrapolated, of_runs

LEVEL = Scene.load("level")
HOW = {"elements": 3, "until": 0.6}
WINDOW = (0.02, 0.58)


@pytest.fixture(scope="module")
def answer():
    return extrapolated(LEVEL, "following-p2", steps=1600, **HOW)


@pytest.fixture(scope="module")
def truth():
    """The same elements, their time all but resolved: fifth order, 1e-8."""
    return run(LEVEL, "following-p2", scheme="radau", steps=1200, **HOW)


def test_where_the_order_is_seen_the_extrapolant_is_better_and_within_its_bar(answer, truth):
    assert answer.seen
    assert max(abs(p - 2.0) for p in answer.observed) <= SEEN
    error = measures.path_gap(answer.response, truth, WINDOW)[0]
    plain = measures.path_gap(answer.runs[0], truth, WINDOW)[0]
    assert error < 0.35 * plain
    assert error <= answer.path_bar < plain


def test_a_run_that_does_not_belong_to_the_ladder_is_no_order(answer):
    """The twin: the finest run moved by a part of the gap, and a ladder that has come to its end."""
    fine, half, quarter = answer.runs
    moved = replace(fine, v=fine.v + 0.7 * (measures.at_steps_of(fine, half, half.v) - fine.v))
    found = of_runs((moved, half, quarter), 2.0)
    assert not found.seen
    assert [f.kind for f in found.response.flags if f.kind == "not extrapolated"] == ["not extrapolated"]
    assert np.array_equal(found.response.v, moved.v)
    assert not of_runs((fine, fine, quarter), 2.0).seen
    assert not of_runs(answer.runs, 1.0).seen


def test_few_steps_after_a_sudden_entry_show_no_order():
    found = extrapolated(LEVEL, "following-p2", steps=48, **HOW)
    assert not found.seen
    assert found.path_bar == np.inf
    assert np.array_equal(found.response.v, found.runs[0].v)


def test_bars_of_space_and_time_are_put_together(answer):
    e = estimated(LEVEL, "following-p2", known=answer.runs, steps=1600, **HOW)
    assert e.in_time.t.size == answer.runs[1].t.size
    r = answer.with_bars(e)
    assert r.path_error == pytest.approx(e.run.error_parts["path_space"] + answer.path_bar)
    assert r.error_parts["tension_time"] == answer.tension_bar
    assert np.array_equal(r.v, answer.response.v)
    unseen = replace(answer, path_bar=np.inf)
    assert np.array_equal(unseen.with_bars(e).v, e.run.v)
    assert unseen.with_bars(e).path_error == e.run.path_error


def test_steps_that_cannot_be_halved_twice_are_refused():
    with pytest.raises(ValueError, match="at least 8"):
        extrapolated(LEVEL, "following-p2", steps=6)
