"""Faults that a check once passed, planted one at a time: each turns the row it concerns."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.validation.pairs import LEVEL, right_answers
from validation.core import recomputed
from validation.core.agreement import DEFAULT_TOL, Verdict, worst_deciding_verdict
from validation.core.measures import relative_path_gap
from validation.core.rows import ALONG, AXIAL_MEAN, compare, compare_answers, tolerance_of_quantity_kind, worse_law_rows
from validation.core.running import run

TOLERANCE = partial(tolerance_of_quantity_kind, tol=DEFAULT_TOL, tol_tension=None)


def rows_by_name(rows):
    return {(row.quantity, row.law): row for row in rows}


def compared_rows(a, b, **kind):
    return rows_by_name(compare(LEVEL, a, b, **kind))


def rows_between_answers(a, b, tol=DEFAULT_TOL, tol_tension=None):
    """Rows of both answers, without laws."""
    return rows_by_name(
        compare_answers(LEVEL, a, b, partial(tolerance_of_quantity_kind, tol=tol, tol_tension=tol_tension))
    )


def verdicts_of_quantity(found, quantity):
    return {row.verdict for (name, _), row in found.items() if name == quantity}


def fault_in_fields(*names):
    """Return a fault by its size: these fields wrong by a share."""

    def of(share):
        def change(r):
            wrong = {name: (1.0 + share) * getattr(r.fields, name) for name in names}
            return replace(r, fields=replace(r.fields, **wrong))

        return change

    return of


def fault_at_mass(share):
    return lambda r: replace(r, T_behind=(1.0 + share) * r.T_behind, T_ahead=(1.0 + share) * r.T_ahead)


def fault_at_supports(share):
    both = ("reaction_left", "reaction_right")
    return lambda r: replace(r, **{name: (1.0 + share) * getattr(r, name) for name in both})


def fault_in_time(share):
    def change(r):
        at = r.t - share * r.t[-1]
        return replace(r, u=np.interp(at, r.t, r.u), v=np.interp(at, r.t, r.v))

    return change


def with_slack_at(place):
    return lambda r: replace(r, slack_onset=place, slack_at=0.5, switched=place)


# what is wrong in one wing alone (0: elements, 1: sines) -> the rows that must disagree, from which share on;
# and from which share on the whole disagrees, by laws at first
FAULTS = {
    "slack falsely called": (0, with_slack_at, {"slack_onset"}, 0.40, 0.40),
    "tension at the mass": (1, fault_at_mass, {"tension_behind", "tension_ahead"}, 0.035, 0.01),
    "displacement along x": (0, fault_in_fields("u"), {"displacement"}, 0.10, 0.01),
    "displacement across": (1, fault_in_fields("v"), {"displacement"}, 0.05, 0.01),
    "velocity across": (0, fault_in_fields("dv"), {"velocity"}, 0.04, 0.03),
    "tension field": (1, fault_in_fields("T"), {"tension"}, 0.05, 0.01),
    "reactions": (0, fault_at_supports, {"reactions"}, 0.035, 0.035),
    "path late, of the time": (1, fault_in_time, {"path_max", "path_rms"}, 0.002, 0.001),
}


def test_right_answers_agree():
    found = compared_rows(*right_answers(), tol=1e-2)
    off = [
        (row.quantity, row.law, row.gap, row.allowed)
        for row in found.values()
        if row.decides and row.verdict is not Verdict.AGREE
    ]
    assert worst_deciding_verdict(list(found.values())) is Verdict.AGREE, off
    assert {name for name, _ in found} == {
        "path_max", "path_rms", "path_slack", "speed", "tension", "tension_behind", "tension_ahead", "reactions",
        "contact", "displacement", "velocity", "energy", "impulse", "laws_si", "slack_onset", "tension_min",
    }  # fmt: skip
    assert {key for key, row in found.items() if not row.decides} == {
        ("speed", ""), ("tension_behind", ""), ("tension_ahead", ""), ("reactions", ""), ("contact", ""),
        ("velocity", ""), ("velocity", ALONG), ("velocity", "up to the mass"), ("tension_min", "least tension"),
        ("path_slack", ""),
    }  # fmt: skip


def answers_with_fault(wing, change):
    return [e.map(change) if i == wing else e for i, e in enumerate(right_answers())]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_one_wing_turns_its_rows_and_a_smaller_one_the_verdict(fault):
    wing, change, expected, share, smaller = FAULTS[fault]
    of = compared_rows if "velocity" in expected else rows_between_answers  # a law sees it
    found = of(*answers_with_fault(wing, change(share)))
    for quantity in expected:
        assert Verdict.DISAGREE in verdicts_of_quantity(found, quantity), [
            (row.law, row.gap, row.allowed) for (name, _), row in found.items() if name == quantity
        ]
    if smaller != share:
        found = compared_rows(*answers_with_fault(wing, change(smaller)))
    assert worst_deciding_verdict(list(found.values())) is Verdict.DISAGREE


def test_a_slack_onset_told_by_both_is_held_against_their_tension():
    """Between them nothing is apart; the least tension says better."""
    a, b = (e.map(with_slack_at(0.40)) for e in right_answers())
    found = compared_rows(a, b)
    assert found[("slack_onset", "")].verdict is Verdict.AGREE
    assert found[("laws_si", "slack onset")].verdict is Verdict.DISAGREE
    assert rows_between_answers(a, right_answers()[1])[("slack_onset", "")].verdict is Verdict.DISAGREE


@pytest.mark.parametrize(("fall", "apart"), [(1e3, 0.03), (0.1, 0.003)])
def test_slack_onsets_are_apart_by_place_at_a_steep_front_and_by_tension_on_a_gentle_slope(fall, apart):
    def slack(onset):
        def change(r):
            least = np.clip(fall * (onset - r.s_o / r.length), -1.0, 1.0) * r.horizontal_tension
            return replace(with_slack_at(onset)(r), tension_min=least)

        return change

    a, b = right_answers()
    row = rows_between_answers(a.map(slack(0.50)), b.map(slack(0.53)))[("slack_onset", "")]
    assert row.gap == pytest.approx(apart, rel=0.1)
    assert row.where == 0.50
    assert row.verdict is Verdict.DISAGREE
    assert rows_between_answers(a.map(slack(0.50)), b.map(slack(0.50)))[("slack_onset", "")].gap < 1e-3


@pytest.mark.parametrize(("fall", "verdict"), [(1e3, Verdict.AGREE), (0.1, Verdict.DISAGREE)])
def test_a_tension_a_tenth_of_H_off_is_no_other_slack_onset_at_a_steep_front(fall, verdict):
    def slack(r):
        least = np.clip(fall * (0.5 - r.s_o / r.length), -1.0, 1.0) + 0.1
        return replace(with_slack_at(0.5)(r), tension_min=least * r.horizontal_tension)

    a, b = right_answers()
    assert compared_rows(a.map(slack), b.map(slack))[("laws_si", "slack onset")].verdict is verdict


def test_an_answer_that_breaks_in_the_window_leaves_the_rest_too_coarse():
    a, b = right_answers()
    short = run(LEVEL, "following-p2", until=0.4, **{k: a.finest.settings[k] for k in ("elements", "steps", "scheme")})
    found = rows_between_answers(replace(a, finest=replace(short, status="incomplete", cause="Newton stalled")), b)
    assert found[("range", "")].verdict is Verdict.TOO_COARSE
    assert ("range", "") not in rows_between_answers(a, b)


def test_a_wrong_path_of_the_slack_cable_is_seen():
    def sinks(r):
        return replace(r, v=r.v * (1.0 + 4.0 * np.maximum(0.0, r.s_o / r.length - 0.83)))

    a, b = right_answers()
    assert rows_between_answers(a, b, tol=1e-2)[("path_slack", "")].verdict is Verdict.AGREE
    assert rows_between_answers(a.map(sinks), b)[("path_slack", "")].verdict is Verdict.DISAGREE


def test_a_printed_error_below_the_gap_to_the_other_solver_is_seen():
    a, b = (e.finest for e in right_answers())
    gap = relative_path_gap(a, b, (0.02, 0.8)).largest

    def wrong(**errors):
        return {x.law for x in recomputed.recomputed_error_rows(replace(a, **errors), b) if not x.gap <= x.allowed}

    assert wrong(path_error=1.01 * gap, tension_error=1.0) == set()
    assert wrong(path_error=0.9 * gap, tension_error=0.0) == {"path_error", "tension_error"}


def test_a_run_compared_with_itself_is_no_check():
    a, _ = right_answers()
    found = compare_answers(LEVEL, a, a, TOLERANCE)
    assert worst_deciding_verdict(found) is Verdict.NOT_COMPARABLE
    assert [row.quantity for row in found].count("independence") == 2  # one wing, and the same numbers


def test_bars_wider_than_what_is_asked_are_too_coarse():
    found = rows_between_answers(*right_answers(), tol=1e-2, tol_tension=1e-4)
    assert found[("tension_ahead", AXIAL_MEAN)].verdict is Verdict.TOO_COARSE
    assert worst_deciding_verdict(list(found.values())) is Verdict.TOO_COARSE
    assert rows_between_answers(*right_answers(), tol=1e-5)[("path_max", "")].verdict is Verdict.TOO_COARSE


def with_fault_past(place, **factors):
    """Multiply what comes after a place s_o/l."""

    def change(r):
        later = r.s_o > place * r.length
        wild = {n: np.where(later, k, 1.0) * getattr(r, n) for n, k in factors.items()}
        return replace(r, **wild)

    return change


@pytest.mark.parametrize(("since", "verdict"), [(0.801, Verdict.AGREE), (0.77, Verdict.DISAGREE)])
def test_means_over_an_axial_round_trip_end_with_the_window(since, verdict):
    """Past it a run may be anything; its companions end there."""
    a, b = right_answers()
    wild = a.map(with_fault_past(since, T_behind=7.0))
    assert rows_between_answers(wild, b)[("tension_behind", AXIAL_MEAN)].verdict is verdict


def one_sample_late(x):
    return np.concatenate([x[:1], x[:-1]])


def with_fields_frame_late(r):
    names = ("u", "v", "du", "dv", "T")
    return replace(r, fields=replace(r.fields, **{name: one_sample_late(getattr(r.fields, name)) for name in names}))


def with_mean_slopes(r):
    mean = 0.5 * (r.slope_behind + r.slope_ahead)
    return replace(r, slope_behind=mean, slope_ahead=mean)


# what is wrong in both wings at once, which no row between them can show
OF_BOTH = {
    "displacement along x 1 % wrong": fault_in_fields("u")(0.01),
    "displacement and its velocity along x 1 % wrong": fault_in_fields("u", "du")(0.01),
    "all fields one frame late": with_fields_frame_late,
    "sides of the mass exchanged": lambda r: replace(r, T_behind=r.T_ahead, T_ahead=r.T_behind),
    "one slope for both sides": with_mean_slopes,
    "vertical reaction on the right 2 % wrong": lambda r: replace(r, reaction_right=r.reaction_right * [1.0, 1.02]),
}


@pytest.mark.parametrize("fault", OF_BOTH)
def test_a_fault_of_both_wings_turns_a_law_and_the_verdict(fault):
    found = list(worse_law_rows(LEVEL, *(e.map(OF_BOTH[fault]) for e in right_answers()), TOLERANCE))
    assert worst_deciding_verdict(found) is Verdict.DISAGREE


def test_velocities_along_the_cable_wrong_in_both_wings_are_shown_only():
    """Two percent turn the velocity up to the mass, a row of which nothing is asked."""
    found = compared_rows(*(e.map(fault_in_fields("du")(0.02)) for e in right_answers()), tol=1e-2)
    assert found[("velocity", "up to the mass")].verdict is Verdict.DISAGREE
    assert worst_deciding_verdict(list(found.values())) is Verdict.AGREE
