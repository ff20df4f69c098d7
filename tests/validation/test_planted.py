"""Faults that a check once passed, planted one at a time: each turns the row it concerns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.elements.following import FollowingElements
from tests.validation.pairs import LEVEL, altered, answer, right
from validation.commands.check import study
from validation.core.agreement import (
    ALONG,
    AXIAL_MEAN,
    UP_TO,
    Agreement,
    Verdict,
    agree,
    doubts,
    overall,
    settled,
    wanting,
)
from validation.core.bounds import Bound, Part
from validation.core.estimate import Estimated, companions, past_slack
from validation.core.flags import flag
from validation.core.methods import METHODS
from validation.core.richardson import SAFETY
from validation.core.running import run


def rows(a, b, **kind):
    return {(row.quantity, row.law): row for row in agree(LEVEL, a, b, **kind)}


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


def one_step_late(r):
    return replace(r, u=np.r_[0.0, r.u[:-1]], v=np.r_[0.0, r.v[:-1]])


# what is wrong in one wing alone -> the quantities whose rows must disagree
FAULTS = {
    "slack falsely called at 40 %": (slack_at_40, {"slack_onset"}),
    "tension at the mass 5 % wrong": (at_mass, {"tension_behind", "tension_ahead"}),
    "displacement field 10 % wrong": (fields(u=1.1, v=1.1), {"displacement"}),
    "velocity field 10 % wrong": (fields(du=1.1, dv=1.1), {"velocity"}),
    "displacement along x 5 % wrong": (fields(u=1.05), {"displacement"}),
    "displacement across 5 % wrong": (fields(v=1.05), {"displacement"}),
    "velocity along x 10 % wrong": (fields(du=1.1), {"velocity"}),
    "velocity across 5 % wrong": (fields(dv=1.05), {"velocity"}),
    "tension field 5 % wrong": (fields(T=1.05), {"tension"}),
    "reactions 5 % wrong": (
        lambda r: replace(r, reaction_left=1.05 * r.reaction_left, reaction_right=1.05 * r.reaction_right),
        {"reactions"},
    ),
    "path one step late": (one_step_late, {"path_max", "path_rms"}),
}


def test_right_answers_agree():
    found = rows(*right())
    coarse = {key for key, row in found.items() if row.verdict is not Verdict.AGREE}
    # fronts, whose means agree, and slopes at the mass: as coarse as this they say nothing
    assert coarse <= {
        ("tension_ahead", ""),
        ("reactions", ""),
        ("velocity", ALONG),
        ("velocity", UP_TO),
        ("impulse", ""),
    }, [found[key] for key in coarse]
    assert {found[key].verdict for key in coarse} <= {Verdict.TOO_COARSE}
    assert overall([row for row in found.values() if row.quantity != "impulse"]) is Verdict.AGREE
    assert doubts(*right()) == []
    assert {name for name, _ in found} == {
        "path_max", "path_rms", "path_slack", "tension", "tension_behind", "tension_ahead", "reactions",
        "displacement", "velocity", "energy", "impulse", "laws_si", "slack_onset",
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


def test_a_range_that_ends_before_both_onsets_is_not_compared():
    a, b = (altered(e, slack_at_40) for e in right())
    coarse = [replace(e, in_space=slack_at_40(e.in_space)) for e in right()]
    assert ("range", "") not in rows(a, b)  # both say so
    assert rows(*coarse)[("range", "")].verdict is Verdict.NOT_COMPARABLE


class Rod(FollowingElements):
    """From the onset on an elastic law that carries compression, in the place of one that does not."""

    def with_law(self, law):
        return super().with_law("elastic")


class Rubber(FollowingElements):
    """From the onset on a law of half the stiffness."""

    def with_law(self, law):
        soft = replace(self.groups, alpha=0.5 * self.groups.alpha)
        return FollowingElements(soft, elements=self.elements, law=law)


@pytest.mark.parametrize(("kind", "row"), [(Rod, ("laws_si", "compression")), (Rubber, ("path_slack", ""))])
def test_a_wrong_law_of_the_slack_cable_is_seen(kind, row):
    def build(groups, x, **how):
        system = kind(groups, elements=x["elements"], **how)
        system.elements = x["elements"]
        return system

    a, b = right()
    method = replace(METHODS["following-p2"], builder=build)
    settings = {k: a.run.settings[k] for k in ("elements", "steps")}
    wrong = companions(LEVEL, method, known=[a.in_space, a.in_time], until=0.95, **settings)
    wrong = past_slack(LEVEL, method, wrong)
    assert rows(a, b)[row].verdict is Verdict.AGREE
    assert rows(wrong, b)[row].verdict is Verdict.DISAGREE


def test_a_wing_of_first_order_in_time_is_doubted():
    a, b = right()
    found = doubts(altered(a, one_step_late), b)
    assert [(method, flag.kind) for method, flag in found] == [("following-p2", "time order")]


def test_a_twin_by_a_rule_of_higher_order_is_no_measure():
    """Beside Radau IIA any other rule has many times the error; the other way round the doubt stays."""
    a, b = right()
    late = altered(a, one_step_late)

    def by_radau(e):
        return replace(e, run=replace(e.run, settings=e.run.settings | {"scheme": "radau"}))

    assert doubts(late, by_radau(b)) == []
    assert [flag.kind for _, flag in doubts(by_radau(late), b)] == ["time order"]


@pytest.mark.parametrize(("order", "found"), [(1.1, ["time order"]), (1.9, [])])
def test_a_ladder_that_shows_the_order_of_its_scheme_is_not_doubted(order, found):
    a, b = right()
    late = replace(altered(a, one_step_late), order=order)
    assert [flag.kind for _, flag in doubts(late, b)] == found


def test_a_run_compared_with_itself_is_no_check():
    a, _ = right()
    found = agree(LEVEL, a, a)
    assert overall(found) is Verdict.NOT_COMPARABLE
    assert [row.quantity for row in found].count("independence") == 2  # one wing, and the same numbers


def test_bars_wider_than_their_ceiling_are_too_coarse():
    a, b = right()
    found = rows(a, b, tol=5e-3, tol_tension=1e-3)
    assert found[("tension_ahead", AXIAL_MEAN)].verdict is Verdict.TOO_COARSE
    assert overall(list(found.values())) is Verdict.TOO_COARSE
    assert rows(a, b, tol=1e-3)[("path_max", "")].verdict is Verdict.TOO_COARSE
    assert rows(a, b, tol=0.2)[("path_max", "")].verdict is Verdict.AGREE


# --- what both wings share: rows of the laws in SI -----------------------------------------------------------------

INCLINED = Scene.load("inclined")
SAG = Scene.from_groups(sag_ratio=0.03, alpha=700.0, mu=0.4, speed_ratio=0.3, slope=4.0)
WINDOW = (0.02, 0.40)


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
            r = run(scene, method, until=0.42, **{space: count // factor, "steps": steps})
            return change(replace(r, scene_toml=claims.to_toml()))

        fine = ran(1, 400)
        return Estimated(fine, fine, ran(2, 400), ran(1, 200), (SAFETY / (2.0**1.5 - 1.0), SAFETY / 3.0), "halved")

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
    return [row for row in agree(scene, a, b, window=WINDOW) if row.quantity == "laws_si"]


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


def row(gap, *, allowed=1.0, tol=None):
    return Agreement("speed", gap, Bound("error bars", (Part("following-p2", allowed),), tol=tol))


@pytest.mark.parametrize(
    ("gap", "before", "told"),
    [
        (0.9, None, Verdict.AGREE), (1.2, None, Verdict.TOO_COARSE), (3.2, None, Verdict.DISAGREE),
        (1.2, 1.3, Verdict.DISAGREE), (5.0, 5.1, Verdict.DISAGREE),  # refinement leaves it
        (1.2, 2.4, Verdict.TOO_COARSE), (1.2, 0.6, Verdict.DISAGREE),
    ],
)  # fmt: skip
def test_a_disagreement_is_one_that_stays_under_refinement(gap, before, told):
    (found,) = settled([row(gap)], None if before is None else [row(before)])
    assert found.verdict is told, str(found.bound)


@pytest.mark.parametrize(
    ("quantity", "gap", "before", "tol", "told"),
    [
        ("path_rms", 1.2, None, 3.1, Verdict.AGREE), ("place", 1.2, None, 31.0, Verdict.AGREE),
        ("path_rms", 1.2, 2.0, 6.5, Verdict.AGREE),  # three times what refinement took by order 1/2
        ("path_rms", 1.2, None, 2.9, Verdict.TOO_COARSE), ("place", 1.2, None, 29.0, Verdict.TOO_COARSE),
        ("path_rms", 1.2, 2.0, 2.0, Verdict.TOO_COARSE),
        ("path_rms", 1.2, None, 0.0, Verdict.TOO_COARSE),  # bars that are no bound
        ("energy", 1.2, None, 31.0, Verdict.TOO_COARSE),
        ("events", 1.2, 1.3, 3.1, Verdict.AGREE), ("events", 1.2, 1.3, 2.9, Verdict.DISAGREE),  # it stays
        ("events", 1.2, 1.3, 0.0, Verdict.DISAGREE), ("energy", 1.2, 1.3, 31.0, Verdict.DISAGREE),
        ("path_rms", 3.2, None, 31.0, Verdict.DISAGREE), ("path_rms", 3.2, 3.3, 31.0, Verdict.DISAGREE),
    ],
)  # fmt: skip
def test_a_path_agrees_within_three_times_its_bars_where_no_more_is_asked(quantity, gap, before, tol, told):
    earlier = None if before is None else [replace(row(before), quantity=quantity)]
    (found,) = settled([replace(row(gap), quantity=quantity)], earlier, tol=tol)
    assert found.verdict is told, str(found.bound)


@pytest.mark.parametrize(("order", "told"), [(0.55, Verdict.TOO_COARSE), (0.35, Verdict.DISAGREE)])
@pytest.mark.parametrize("ratio", [1.3, 1.5, 2.0])
def test_what_a_refinement_takes_is_read_by_its_ratio(ratio, order, told):
    """A gap of order 1/2 is the answers' own, whatever it was refined by."""
    (found,) = settled([row(1.7)], [row(1.7 * ratio**order)], ratio)
    assert found.verdict is told, str(found.bound)


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
    wild = replace(a, response=past(since, T_behind=7.0)(a.response))
    assert rows(wild, b)[("tension_behind", AXIAL_MEAN)].verdict is told


def test_who_makes_a_row_too_coarse_is_refined():
    first, second = study.SOLVERS
    blunt = Bound("error bars", (Part(first, 0.2), Part(second, 0.9)), tol=1.0)
    rows = [Agreement("path_max", 0.1, blunt), Agreement("speed", 0.1, replace(blunt, tol=None))]
    assert wanting(rows, [first, second]) == [second]
    even = replace(blunt, parts=(Part(first, 0.6), Part(second, 0.6)))
    assert wanting([*rows, Agreement("place", 0.1, even)], [first, second]) == [first, second]
    assert wanting([Agreement("place", 0.1, replace(blunt, tol=5.0))], [first]) == [first]


@pytest.mark.parametrize(
    ("space", "time", "cut", "most", "which"),
    [
        (0.3, 0.1, None, 160, (True, False)), (0.1, 0.3, None, 160, (False, True)),
        (0.3, 0.1, None, 40, (False, True)),  # as fine as the method gets
        (0.3, 0.1, "in_time", 160, (False, True)), (0.1, 0.3, "in_space", 160, (True, False)),
    ],
)  # fmt: skip
def test_a_run_is_refined_where_its_bars_come_from(space, time, cut, most, which):
    method, e = METHODS["fourier-kink"], answer("fourier-kink")
    method = replace(method, resolution=replace(method.resolution, most=most))
    e = replace(e, run=replace(e.run, error_parts={"tension_space": space, "tension_time": time}))
    if cut:
        e = replace(e, **{cut: replace(getattr(e, cut), slack_onset=0.3)})
    finer = study.FINER ** (1.0 / method.resolution.growth), study.FINER
    assert study._coarse(method, e, False) == tuple(x if mine else 1.0 for x, mine in zip(finer, which, strict=True))
    if not cut and most > 40:
        assert study._coarse(method, e, True) == finer


def test_bars_beyond_their_ceiling_disagree_only_far_out():
    assert row(2.9, tol=0.5).verdict is Verdict.TOO_COARSE
    assert row(3.1, tol=0.5).verdict is Verdict.DISAGREE


@pytest.mark.parametrize(("left", "told", "rounds"), [(1.0, Verdict.DISAGREE, 2), (0.0, Verdict.AGREE, 2)])
def test_a_check_refines_both_before_it_says_disagree(monkeypatch, left, told, rounds):
    """A wing that is wrong stays so; one that seems wrong by chance does not."""
    answers, asked = dict(zip(study.SOLVERS, right(), strict=True)), []

    def resolved(scene, method, tol, budget, until, before, finer, progress):
        asked.append(finer)
        off = 1.0 if len(asked) <= 2 else left
        wrong = fields(u=1.0 + 0.1 * off, v=1.0 + 0.1 * off)
        e = answers[method.name] if method.wing == "elements" else altered(answers[method.name], wrong)
        finer = e.run.settings | {"steps": e.run.settings["steps"] + len(asked)}
        return replace(e, run=replace(e.run, path_error=0.9 * tol, flags=[], settings=finer))

    monkeypatch.setattr(study, "_resolved", resolved)
    monkeypatch.setattr(study, "side_by_side", lambda jobs, progress, load: [job(lambda *told: None) for job in jobs])
    assert study.check(LEVEL, tol=0.05).verdict is told
    assert asked == [None] * 2 + [(study.CONFIRMS,) * 2] * (2 * rounds - 2)


@pytest.mark.parametrize(("flagged", "rounds"), [(False, 1), (True, 2)])
def test_a_check_goes_on_where_bars_cover_less_than_the_range(monkeypatch, flagged, rounds):
    answers, asked = dict(zip(study.SOLVERS, right(), strict=True)), []

    def resolved(scene, method, tol, budget, until, before, finer, progress):
        asked.append(finer)
        e = answers[method.name]
        short = [flag("short bar", stop=0.3)] if flagged and len(asked) <= 2 else []
        return replace(e, run=replace(e.run, path_error=0.5 * tol, flags=short))

    monkeypatch.setattr(study, "_resolved", resolved)
    monkeypatch.setattr(study, "side_by_side", lambda jobs, progress, load: [job(lambda *told: None) for job in jobs])
    assert study.check(LEVEL, tol=0.05).verdict is Verdict.AGREE
    assert len(asked) == 2 * rounds


@pytest.mark.parametrize(
    ("kind", "gap", "told", "rounds"),
    [
        (None, 1.7, Verdict.DISAGREE, 2), ("slow waves", 1.7, Verdict.TOO_COARSE, 1),
        ("slow waves", 3.6, Verdict.DISAGREE, 2),
    ],
)  # fmt: skip
def test_bars_that_are_no_bound_prove_nothing_within_three_times(monkeypatch, kind, gap, told, rounds):
    a, b = right()
    marks = [flag(kind, least=0.1, since=0.6, at=0.9)] if kind else []
    asked = []

    def resolved(scene, method, tol, budget, until, before, finer, progress):
        asked.append(finer)
        e = a if method.wing == "elements" else b
        return replace(e, run=replace(e.run, path_error=0.9 * tol, flags=marks))

    monkeypatch.setattr(study, "_resolved", resolved)
    monkeypatch.setattr(study, "side_by_side", lambda jobs, progress, load: [job(lambda *told: None) for job in jobs])
    monkeypatch.setattr(study, "agree", lambda *runs, **kind: [row(gap)])
    assert study.check(LEVEL, tol=0.05).verdict is told
    assert len(asked) == 2 * rounds


def test_a_check_goes_on_from_what_confirmed(monkeypatch):
    """Where the second look leaves rows too coarse, their solvers are refined as after the first."""
    answers, asked = dict(zip(study.SOLVERS, right(), strict=True)), []
    found = iter([[row(1.7)], [row(0.2, tol=0.5)], [row(0.2)]])

    def resolved(scene, method, tol, budget, until, before, finer, progress):
        asked.append(finer)
        e = answers[method.name]
        return replace(e, run=replace(e.run, path_error=0.9 * tol, flags=[]))

    monkeypatch.setattr(study, "_resolved", resolved)
    monkeypatch.setattr(study, "side_by_side", lambda jobs, progress, load: [job(lambda *told: None) for job in jobs])
    monkeypatch.setattr(study, "agree", lambda *runs, **kind: next(found))
    assert study.check(LEVEL, tol=0.05).verdict is Verdict.AGREE
    assert asked[:4] == [None] * 2 + [(study.CONFIRMS,) * 2] * 2
    assert sorted(map(max, asked[4:])) == [1.0, study.FINER]  # that one whose bar is too wide


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
    found = agree(LEVEL, a, b)
    laws = [row for row in found if row.verdict is Verdict.DISAGREE]
    assert {row.quantity for row in laws} <= {"laws_si", "impulse", "energy", "velocity"}
    assert laws, [(row.law, row.gap, row.allowed) for row in found if row.quantity == "laws_si"]
