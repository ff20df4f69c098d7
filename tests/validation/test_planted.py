"""Faults that a check once passed, planted one at a time: each turns the row it concerns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from tests.validation.pairs import LEVEL, altered, answer, right
from validation.core.agreement import Verdict, overall
from validation.core.ladder import Branch, Ladder
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
        "contact", "displacement", "velocity", "energy", "impulse", "laws_si", "slack_onset",
    }  # fmt: skip
    assert {key for key, row in found.items() if not row.asked} == {
        ("speed", ""), ("tension_behind", ""), ("tension_ahead", ""), ("reactions", ""), ("contact", ""),
        ("velocity", ""), ("velocity", ALONG), ("velocity", UP_TO),
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


def test_a_slack_cable_that_one_answer_alone_tells_is_a_fault_and_both_is_none():
    a, b = (altered(e, slack_at_40) for e in right())
    assert rows(a, b)[("slack_onset", "")].verdict is Verdict.AGREE
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


# --- what both wings share: rows of the laws in SI -----------------------------------------------------------------

INCLINED = Scene.load("inclined")
SAG = Scene.from_groups(sag_ratio=0.03, alpha=700.0, mu=0.4, speed_ratio=0.3, slope=4.0)


def wrong(scene, *, catenary=None, **groups):
    """Return a scene whose groups or hanging cable are wrong: both wings get them."""
    other = scene.variant()
    if catenary:
        other.__dict__["catenary"] = replace(scene.catenary, **catenary)
    else:
        other.__dict__["groups"] = replace(scene.groups, **groups)
    return other


def pair(scene, claims, change=lambda r: r):
    """Run both wings coarsely on one scene; the responses claim to be of another, and are changed."""

    def estimate(method, space, count):
        def ran(factor, steps):
            r = run(
                scene,
                method,
                until=0.42 if factor == 1 and steps == 400 else 0.45,
                **{space: count // factor, "steps": steps},
            )
            return change(replace(r, scene_toml=claims.to_toml()))

        return Ladder(ran(1, 400), Branch((ran(2, 400),), (2.0,), 1.5), Branch((ran(1, 200),), (2.0,), 2.0))

    return estimate("following-p2", "elements", 10), estimate("fourier-kink", "terms", 20)


def tension_in_newtons(r):
    f = r.fields
    names = ("T", "T_behind", "T_ahead", "T_static")
    f = replace(f, **{n: 1.01 * getattr(f, n) for n in names})
    return replace(r, fields=f, T_behind=1.01 * r.T_behind, T_ahead=1.01 * r.T_ahead)


H = LEVEL.horizontal_tension
SHARED = {
    "H from the length 0.5 % off": (LEVEL, wrong(LEVEL, catenary={"horizontal_tension": 1.005 * H}), None),
    "mu 1 % off": (LEVEL, wrong(LEVEL, mu=1.01 * LEVEL.mu), None),
    "alpha 5 % off": (LEVEL, wrong(LEVEL, alpha=1.05 * LEVEL.alpha), None),
    "sigma 1 % off": (LEVEL, wrong(LEVEL, sigma=1.01 * LEVEL.sigma), None),
    "EA 5 % off": (LEVEL, LEVEL.variant(alpha=0.95 * LEVEL.alpha), None),
    "sag 2 % off": (SAG, wrong(SAG, catenary={"horizontal_tension": SAG.horizontal_tension / 1.02}), None),
    "sign of the drop": (INCLINED, wrong(INCLINED, catenary={"drop": -INCLINED.supports.drop}), None),
    "tensions in N 1 % too large": (LEVEL, LEVEL, tension_in_newtons),
}


def laws_of(a, b, scene):
    return [row for row in compare(scene, a, b) if row.quantity == "laws_si"]


def test_right_answers_keep_the_laws():
    assert {row.verdict for row in laws_of(*pair(LEVEL, LEVEL), LEVEL)} == {Verdict.AGREE}


@pytest.mark.parametrize("fault", SHARED)
def test_what_both_wings_share_turns_a_law(fault):
    scene, other, change = SHARED[fault]
    found = laws_of(*pair(other, scene, change or (lambda r: r)), scene)
    assert Verdict.DISAGREE in {row.verdict for row in found}, [(row.law, row.gap, row.allowed) for row in found]


def test_a_wrong_unit_of_time_turns_a_law(monkeypatch):
    scale = Scene.time_scale.fget
    monkeypatch.setattr(Scene, "time_scale", property(lambda self: 1.01 * scale(self)))
    found = laws_of(*pair(LEVEL.variant(), LEVEL), LEVEL)
    assert Verdict.DISAGREE in {row.verdict for row in found}


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
