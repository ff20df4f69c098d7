"""Faults that a check once passed, planted one at a time: each turns the row it concerns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.validation.pairs import LEVEL, altered, answer, right
from validation.core.agreement import Verdict, overall
from validation.core.rows import ALONG, AXIAL_MEAN, UP_TO, compare
from validation.core.running import run


def rows(a, b, **kind):
    return {(row.quantity, row.law): row for row in compare(LEVEL, a, b, **kind)}


def verdict(found, quantity):
    return {row.verdict for (name, _), row in found.items() if name == quantity}


def fields(**factors):
    def change(r):
        return replace(r, fields=replace(r.fields, **{n: k * getattr(r.fields, n) for n, k in factors.items()}))

    return change


def at_mass(r):
    return replace(r, T_behind=1.05 * r.T_behind, T_ahead=1.05 * r.T_ahead)


def slack_at_40(r):
    return replace(r, slack_onset=0.40, slack_at=0.5, switched=0.40)


def late_by_a_hundredth(r):
    at = r.t - 0.01 * r.t[-1]
    return replace(r, u=np.interp(at, r.t, r.u), v=np.interp(at, r.t, r.v))


# what is wrong in one wing alone -> the quantities whose rows must disagree
FAULTS = {
    "slack falsely called at 40 %": (slack_at_40, {"slack_onset"}),
    "tension at the mass 5 % wrong": (at_mass, {"tension_behind", "tension_ahead"}),
    "displacement field 10 % wrong": (fields(u=1.1, v=1.1), {"displacement"}),
    "velocity field 20 % wrong": (fields(du=1.2, dv=1.2), {"velocity"}),
    "displacement along x 15 % wrong": (fields(u=1.15), {"displacement"}),
    "displacement across 5 % wrong": (fields(v=1.05), {"displacement"}),
    "velocity across 20 % wrong": (fields(dv=1.2), {"velocity"}),
    "tension field 5 % wrong": (fields(T=1.05), {"tension"}),
    "reactions 5 % wrong": (
        lambda r: replace(r, reaction_left=1.05 * r.reaction_left, reaction_right=1.05 * r.reaction_right),
        {"reactions"},
    ),
    "path a hundredth of the time late": (late_by_a_hundredth, {"path_max", "path_rms"}),
}


def test_right_answers_agree():
    found = rows(*right(), tol=1e-2)
    off = [
        (row.quantity, row.law, row.gap, row.allowed)
        for row in found.values()
        if row.asked and row.verdict is not Verdict.AGREE
    ]
    assert overall(list(found.values())) is Verdict.AGREE, off
    assert {name for name, _ in found} == {
        "path_max", "path_rms", "path_slack", "speed", "tension", "tension_behind", "tension_ahead", "reactions",
        "contact", "displacement", "velocity", "energy", "impulse", "laws_si", "slack_onset", "tension_min",
    }  # fmt: skip
    assert {key for key, row in found.items() if not row.asked} == {
        ("speed", ""), ("tension_behind", ""), ("tension_ahead", ""), ("reactions", ""), ("contact", ""),
        ("velocity", ""), ("velocity", ALONG), ("velocity", UP_TO), ("tension_min", "least tension"),
    }  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_one_wing_turns_its_rows(fault):
    change, expected = FAULTS[fault]
    pair, wing = list(right()), list(FAULTS).index(fault) % 2
    pair[wing] = altered(pair[wing], change)
    found = rows(*pair)
    for quantity in expected:
        assert Verdict.DISAGREE in verdict(found, quantity), [
            (row.law, row.gap, row.allowed) for (name, _), row in found.items() if name == quantity
        ]
    assert overall(list(found.values())) is Verdict.DISAGREE


def test_a_slack_onset_told_by_both_is_held_against_their_tension():
    """Between them nothing is apart; the least tension says better."""
    a, b = (altered(e, slack_at_40) for e in right())
    assert rows(a, b)[("slack_onset", "")].verdict is Verdict.AGREE
    assert rows(a, b)[("laws_si", "slack onset")].verdict is Verdict.DISAGREE
    assert rows(a, right()[1])[("slack_onset", "")].verdict is Verdict.DISAGREE


def test_an_answer_that_breaks_in_the_window_leaves_the_rest_too_coarse():
    a, b = right()
    short = run(LEVEL, "following-p2", until=0.4, **{k: a.run.settings[k] for k in ("elements", "steps", "scheme")})
    found = rows(replace(a, finest=replace(short, status="incomplete", cause="Newton stalled")), b)
    assert found[("range", "")].verdict is Verdict.TOO_COARSE
    assert ("range", "") not in rows(a, b)


def test_a_wrong_path_of_the_slack_cable_is_seen():
    def sinks(r):
        return replace(r, v=r.v * (1.0 + 4.0 * np.maximum(0.0, r.s_o / r.length - 0.83)))

    a, b = right()
    assert rows(a, b, tol=1e-2)[("path_slack", "")].verdict is Verdict.AGREE
    assert rows(altered(a, sinks), b)[("path_slack", "")].verdict is Verdict.DISAGREE


def test_a_run_compared_with_itself_is_no_check():
    a, _ = right()
    found = compare(LEVEL, a, a)
    assert overall(found) is Verdict.NOT_COMPARABLE
    assert [row.quantity for row in found].count("independence") == 2  # one wing, and the same numbers


def test_bars_wider_than_what_is_asked_are_too_coarse():
    found = rows(*right(), tol=1e-2, tol_tension=1e-4)
    assert found[("tension_ahead", AXIAL_MEAN)].verdict is Verdict.TOO_COARSE
    assert overall(list(found.values())) is Verdict.TOO_COARSE
    assert rows(*right(), tol=1e-5)[("path_max", "")].verdict is Verdict.TOO_COARSE


def test_the_level_answers_are_those_of_the_methods_in_the_check():
    from validation.commands.check.study import SOLVERS

    assert tuple(answer(name).run.method for name in SOLVERS) == SOLVERS


def past(place, **factors):
    """Multiply what comes after a place s_o/l."""

    def change(r):
        later = r.s_o > place * r.length
        wild = {n: np.where(later, k, 1.0) * getattr(r, n) for n, k in factors.items()}
        return replace(r, **wild)

    return change


@pytest.mark.parametrize(("since", "told"), [(0.801, Verdict.AGREE), (0.77, Verdict.DISAGREE)])
def test_means_over_an_axial_round_trip_end_with_the_window(since, told):
    """Past it a run may be anything; its companions end there."""
    a, b = right()
    wild = altered(a, past(since, T_behind=7.0))
    assert rows(wild, b)[("tension_behind", AXIAL_MEAN)].verdict is told


def late(x):
    return np.concatenate([x[:1], x[:-1]])


def changed(**of):
    def change(r):
        return replace(r, fields=replace(r.fields, **{name: f(getattr(r.fields, name)) for name, f in of.items()}))

    return change


def mean_slopes(r):
    mean = 0.5 * (r.slope_behind + r.slope_ahead)
    return replace(r, slope_behind=mean, slope_ahead=mean)


# what is wrong in both wings at once, which no row between them can show
OF_BOTH = {
    "displacement along x 5 % wrong": fields(u=1.05),
    "displacement and its velocity along x 5 % wrong": fields(u=1.05, du=1.05),
    "velocity along x 10 % wrong": fields(du=1.1),
    "all fields one frame late": changed(u=late, v=late, du=late, dv=late, T=late),
    "sides of the mass exchanged": lambda r: replace(r, T_behind=r.T_ahead, T_ahead=r.T_behind),
    "one slope for both sides": mean_slopes,
    "vertical reaction on the right 5 % wrong": lambda r: replace(r, reaction_right=r.reaction_right * [1.0, 1.05]),
}


@pytest.mark.parametrize("fault", OF_BOTH)
def test_a_fault_of_both_wings_turns_a_law(fault):
    a, b = (altered(e, OF_BOTH[fault]) for e in right())
    found = compare(LEVEL, a, b)
    laws = [row for row in found if row.verdict is Verdict.DISAGREE]
    assert {row.quantity for row in laws} <= {"laws_si", "impulse", "energy", "velocity"}
    assert laws, [(row.law, row.gap, row.allowed) for row in found if row.quantity == "laws_si"]
