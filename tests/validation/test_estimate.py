"""Error bars from companions: what they are made of, and that they hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from validation.core import estimate as module
from validation.core import measures
from validation.core.estimate import estimated, gaps
from validation.core.richardson import SAFETY
from validation.core.running import run

LEVEL = Scene.load("level")


@pytest.fixture(scope="module")
def sure():
    return run(LEVEL, "following-p4", elements=16, steps=4000, until=0.8)


@pytest.fixture(scope="module")
def estimate():
    return estimated(LEVEL, "following-p2", elements=9, steps=450, until=0.8)


def test_the_bar_holds_the_true_error_and_is_made_of_the_two_gaps(estimate, sure):
    r, window = estimate.run, (0.02, 0.8)
    true = measures.path_gap(r, sure, window)[0]
    assert true <= r.path_error <= 10.0 * true
    assert measures.tension_gap(r, sure, window) <= r.tension_error
    space = measures.path_gap(estimate.in_space, r, window)[0]
    time = measures.path_gap(estimate.in_time, r, window)[0]
    # orders 3/2 and 2 between h and h/2
    assert r.path_error == pytest.approx(SAFETY * (space / (2.0**1.5 - 1.0) + time / 3.0), rel=1e-12)
    assert r.error_parts["path_space"] + r.error_parts["path_time"] == pytest.approx(r.path_error, rel=1e-12)


def test_companions_stop_at_the_window_and_have_half_of_one_thing(estimate):
    assert estimate.in_space.settings["elements"] == 4
    assert estimate.in_time.settings["steps"] == 225
    assert {estimate.in_space.settings["steps"], estimate.in_time.settings["elements"]} == {450, 9}
    for companion in (estimate.in_space, estimate.in_time):
        assert 0.8 <= companion.reached < 0.81


def test_runs_that_are_there_are_not_made_again(estimate, monkeypatch):
    def run(*_, **settings):
        raise AssertionError(f"ran {settings}")

    monkeypatch.setattr(module, "run", run)
    again = module.estimated(LEVEL, "following-p2", known=estimate.runs, elements=9, steps=450, until=0.8)
    assert (again.run.path_error, again.run.tension_error) == (estimate.run.path_error, estimate.run.tension_error)
    with pytest.raises(AssertionError, match="'steps': 225"):
        module.estimated(LEVEL, "following-p2", known=estimate.runs[:2], elements=9, steps=450, until=0.8)


def test_a_companion_that_does_not_cover_the_window_gives_no_bar(estimate):
    short = run(LEVEL, "following-p2", elements=9, steps=225, until=0.5)
    with pytest.raises(measures.NotComparable, match=r"ends at s_o/l = 0\.5"):
        gaps(estimate.run, short)


def test_slack_that_the_companion_does_not_have_gives_no_bar(estimate):
    fine = replace(estimate.run, slack_onset=0.4)
    with pytest.raises(measures.NotComparable, match="in the coarser companion not yet"):
        gaps(fine, estimate.in_time)
    # the same onset in both: the window ends there
    path, _ = gaps(fine, replace(estimate.in_time, slack_onset=0.41))
    assert path == measures.path_gap(estimate.in_time, fine, (0.02, 0.4))[0]


def test_a_companions_own_slack_does_not_cut_the_window(estimate):
    early = replace(estimate.in_time, slack_onset=0.1)
    assert gaps(estimate.run, early) == gaps(estimate.run, estimate.in_time)
    assert np.isfinite(gaps(estimate.run, early)[0])
