"""Error bars from companions: what they are made of, and that they hold."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from validation.core import estimate as module
from validation.core import measures
from validation.core.estimate import confirmed, estimated, weighted, window_of
from validation.core.methods import find
from validation.core.richardson import LEAST_ORDER, NO_ORDER, SAFETY, left, weight
from validation.core.running import run

LEVEL = Scene.load("level")
RUNS = "run", "in_space", "in_time"


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
    # at most the orders 3/2 and 2 between h and h/2
    quarters = [run(LEVEL, "following-p2", elements=n, steps=m, until=0.8) for n, m in ((2, 450), (9, 112))]
    falls = []
    for quarter, half in zip(quarters, (estimate.in_space, estimate.in_time), strict=True):
        before, after = (measures.path_gap(*pair, window)[1] for pair in ((quarter, half), (half, r)))
        falls.append(before / after)
    assert r.path_error == pytest.approx(weight(1.5, falls[0]) * space + weight(2.0, falls[1]) * time, rel=1e-12)
    assert estimate.order == pytest.approx(math.log2(falls[1]))
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
    again = module.companions(LEVEL, find("following-p2"), known=estimate.runs, elements=9, steps=450, until=0.8)
    assert again.run.tension_error == estimate.run.tension_error
    with pytest.raises(AssertionError, match="'steps': 225"):
        module.companions(LEVEL, find("following-p2"), known=estimate.runs[:2], elements=9, steps=450, until=0.8)


def test_a_companion_that_does_not_cover_the_window_gives_no_bar(estimate):
    short = run(LEVEL, "following-p2", elements=9, steps=225, until=0.5)
    with pytest.raises(measures.NotComparable, match=r"ends at s_o/l = 0\.5"):
        window_of(estimate.run, short)


def test_slack_that_the_companion_does_not_have_gives_no_bar(estimate):
    fine = replace(estimate.run, slack_onset=0.4)
    with pytest.raises(measures.NotComparable, match="in the coarser companion not yet"):
        window_of(fine, estimate.in_time)
    # the same onset in both: the window ends there
    assert window_of(fine, replace(estimate.in_time, slack_onset=0.41)) == (0.02, 0.4)


def test_a_companions_own_slack_does_not_cut_the_window(estimate):
    early = replace(estimate.in_time, slack_onset=0.1)
    assert window_of(estimate.run, early) == (0.02, 0.8)


@pytest.mark.parametrize(
    ("fall", "expected"),
    [
        (None, NO_ORDER), (15.0, SAFETY * left(2.0)), (17.0, NO_ORDER), (3.1, SAFETY / 2.1),
        (1.01 * 2.0**LEAST_ORDER, NO_ORDER), (0.7, NO_ORDER), (0.0, NO_ORDER),
    ],
)  # fmt: skip
def test_what_three_runs_show_of_an_order_makes_the_bar(fall, expected):
    assert weight(2.0, fall, 16.0) == pytest.approx(expected, rel=1e-12)


def test_a_path_that_shows_no_order_says_so(estimate):
    """Its gap to half the elements twice what it was before: three times that is the bar, and no bound."""
    method, steps = find("following-p2"), measures.path_gap(estimate.in_time, estimate.run, (0.02, 0.8))[0]
    elements = measures.path_gap(estimate.in_space, estimate.run, (0.02, 0.8))[0]
    shown, lost = confirmed(estimate, method, (2.0, 4.0)).run, confirmed(estimate, method, (0.5, 4.0)).run
    assert ("no order" in shown.flag_kinds, "no order" in lost.flag_kinds) == (False, True)
    assert lost.path_error == pytest.approx(NO_ORDER * elements + SAFETY * steps / 3.0, rel=1e-12)


def test_bars_beyond_a_tenth_credit_no_order(estimate):
    method = find("following-p2")
    far = replace(estimate, in_space=replace(estimate.in_space, v=estimate.in_space.v + 0.2 * estimate.run.v))
    gaps = [measures.path_gap(c, far.run, (0.02, 0.8))[0] for c in (far.in_space, far.in_time)]
    found = confirmed(far, method, (1e3, 1e3)).run
    assert found.path_error == pytest.approx(NO_ORDER * sum(gaps), rel=1e-12)
    assert "coarse" in found.flag_kinds


def test_a_mass_that_is_lifted_all_the_way_has_no_bar(estimate):
    """Relative to no deflection any error would be infinite."""
    lifted = {name: replace(getattr(estimate, name), v=-np.abs(getattr(estimate, name).v)) for name in RUNS}
    r = weighted(replace(estimate, response=lifted["run"], **lifted), 1.0).run
    assert (r.path_error, r.tension_error, r.error_parts) == (None, None, None)
    assert any(x.kind == "no bar" and "no deflection" in str(x) for x in r.flags)
    # twin: what has one has a bar
    assert weighted(estimate, 1.0).run.path_error == pytest.approx(estimate.run.path_error)


def test_a_companion_whose_ride_breaks_off_gives_no_bar(estimate):
    """Up to its end it may be as near as it likes."""
    short = run(LEVEL, "following-p2", elements=4, steps=450, until=0.5)
    free = replace(estimate, run=replace(estimate.run, drive="free"), in_space=replace(short, drive="free"))
    assert weighted(free, 1.0).run.flag_kinds == ["no bar"]
