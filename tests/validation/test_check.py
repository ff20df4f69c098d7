"""The check agrees for right solvers and disagrees when a fault is planted in one of them, by substitution."""

import dataclasses
import re

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cablefem import Scene
from tests.validation import sines
from validation.commands.check import study
from validation.commands.check.study import check
from validation.commands.run.study import run_with_bars
from validation.core.agreement import (
    FACTOR_DISAGREE,
    Agreement,
    Bound,
    BoundPart,
    Verdict,
    excess_over_tolerance_sentence,
    worst_deciding_verdict,
)
from validation.core.ladder import Ladder
from validation.core.methods import METHODS
from validation.core.refine import run_with_error_bars
from validation.core.rows import compare

LEVEL = Scene.load("level")
ELEMENTS = {"elements": 16, "steps": 1000, "scheme": "generalized-alpha"}
SINES = {"terms": 36, "steps": 1000, "scheme": "generalized-alpha"}


@pytest.fixture(scope="module")
def right_answers() -> tuple[Ladder, Ladder]:
    """Two answers as a check ends with."""
    return run_with_error_bars(LEVEL, "following-p2", **ELEMENTS), run_with_error_bars(LEVEL, "fourier-kink", **SINES)


@pytest.mark.parametrize(("wing", "group"), [(0, "mu"), (1, "alpha")], ids=["elements", "sines"])
def test_a_planted_fault_turns_the_verdict(right_answers, wing, group):
    """The mass, or EA, off by one percent; a wrong equation of motion: test_conformance.py."""
    method = METHODS[right_answers[wing].finest.method]

    def build(groups, x, **how):
        return method.build(dataclasses.replace(groups, **{group: 1.01 * getattr(groups, group)}), x, **how)

    wrong = run_with_error_bars(LEVEL, dataclasses.replace(method, build=build), **(SINES if wing else ELEMENTS))
    rows = compare(LEVEL, *((right_answers[0], wrong) if wing else (wrong, right_answers[1])))
    assert worst_deciding_verdict(rows) is Verdict.DISAGREE
    path = next(r for r in rows if r.quantity == "path_rms")
    assert path.verdict is Verdict.DISAGREE, (path.gap, path.allowed)


def agreement_row(gap: float, bars: tuple[float, float], required: float, decides: bool = True) -> Agreement:
    parts = tuple(BoundPart(name, bar) for name, bar in zip(("a", "b"), bars, strict=True))
    return Agreement("speed", gap, Bound("error bars", parts), required=required, decides=decides)


INF = float("inf")


@pytest.mark.parametrize(
    ("gap", "bars", "required", "verdict"),
    [
        (0.2, (0.3, 0.4), 1.0, Verdict.AGREE), (0.9, (0.3, 0.4), 1.0, Verdict.AGREE),
        (0.2, (0.8, 0.4), 1.0, Verdict.TOO_COARSE), (1.1, (0.3, 0.4), 1.0, Verdict.TOO_COARSE),
        (FACTOR_DISAGREE * 0.7 + 0.01, (0.3, 0.4), 9.0, Verdict.DISAGREE),
        (FACTOR_DISAGREE * 0.7 - 0.01, (0.3, 0.4), 9.0, Verdict.AGREE),
        (1.0, (0.0, 0.0), 9.0, Verdict.DISAGREE), (1.0, (INF, 0.0), 9.0, Verdict.TOO_COARSE),
    ],
)  # fmt: skip
def test_the_rule_has_three_lines(gap, bars, required, verdict):
    assert agreement_row(gap, bars, required).verdict is verdict


def test_the_whole_is_the_first_of_disagree_too_coarse_and_agree_of_asked_rows():
    agrees, coarse, apart = (
        agreement_row(0.0, (0.1, 0.1), 1.0),
        agreement_row(0.0, (5.0, 0.1), 1.0),
        agreement_row(9.0, (0.1, 0.1), 1.0),
    )
    assert worst_deciding_verdict([agrees]) is Verdict.AGREE
    assert worst_deciding_verdict([agrees, coarse]) is Verdict.TOO_COARSE
    assert worst_deciding_verdict([agrees, coarse, apart]) is Verdict.DISAGREE
    assert worst_deciding_verdict([agrees, dataclasses.replace(apart, decides=False)]) is Verdict.AGREE
    assert worst_deciding_verdict([]) is Verdict.NOT_COMPARABLE


def with_larger_tolerance(row, factor):
    return dataclasses.replace(row, required=factor * row.required)


def test_rows_that_are_too_coarse_say_how_far_they_exceed_what_was_asked():
    rows = [
        agreement_row(0.2, (3.0, 0.2), 1.0),
        agreement_row(0.1, (4.0, 4.0), 5.0),
        agreement_row(0.0, (0.1, 0.1), 1.0),
    ]
    excess = float(re.search(r"up to (\S+) times", excess_over_tolerance_sentence(rows))[1])
    for factor, verdict in ((1.1, Verdict.AGREE), (0.9, Verdict.TOO_COARSE)):
        assert worst_deciding_verdict([with_larger_tolerance(row, factor * excess) for row in rows]) is verdict
    assert excess_over_tolerance_sentence(rows[2:]) is None
    assert excess_over_tolerance_sentence([agreement_row(0.2, (INF, 0.1), 1.0)]) is None


def test_a_row_says_its_bars_and_what_was_asked():
    row = agreement_row(0.2, (0.3, INF), 1.0).to_json()
    assert (row["bar_a"], row["bar_b"], row["allowed"]) == (0.3, None, None)
    assert (row["asked_for"], row["asked"], row["verdict"]) == (1.0, True, "too coarse")
    assert agreement_row(0.2, (0.3, 0.1), 1.0, decides=False).to_json()["verdict"] is None


def test_check_meets_its_tolerance_and_writes_the_contract(tmp_path):
    import json

    result = check("inclined", tol=3e-2)
    assert result.verdict is Verdict.AGREE, [(r.quantity, r.gap, r.allowed) for r in result.rows]
    result.write(tmp_path)
    content = json.loads((tmp_path / "agreement.json").read_text())
    assert content["verdict"] == "agree"
    assert content["range"] == [0.02, 0.8]
    for row in content["rows"]:
        assert set(row) >= {"quantity", "gap", "allowed", "bar_a", "bar_b", "asked_for", "asked", "verdict", "where"}
    for method in content["methods"]:
        assert {f.name for f in (tmp_path / method).iterdir()} >= {"path.csv", "tension.csv", "summary.json"}
        assert json.loads((tmp_path / method / "summary.json").read_text())["path_error"] <= 1.5e-2
    run = result.a.finest
    place = np.linspace(0.6, 0.95, 3501)  # between the steps: the bottom is flat
    lowest = place[np.argmax(CubicSpline(run.s_o / run.length, run.y)(place))]
    assert abs(lowest - 0.80) < 0.01  # the paper's figure 8
    assert repr(result).startswith("Check(inclined: agree, ")
    assert "\n" not in repr(result)
    assert all(part in result._repr_html_() for part in ("<svg", "largest tension", "crosses the cable"))


@pytest.mark.parametrize("tol", [0.0, -1e-3, 0.5, float("nan")])
def test_a_tolerance_out_of_range_is_named(tol):
    with pytest.raises(ValueError, match="tol must lie in"):
        check("level", tol=tol)


def test_a_disagreement_is_looked_at_once_more_finer_in_space_and_time_and_then_it_is_said(monkeypatch):
    rounds, compare = [], study.compare_answers

    def watched(scene, a, b, asked):
        rounds.append([a.finest.settings, b.finest.settings])
        return compare(scene, a, b, asked)

    monkeypatch.setattr(study, "compare_answers", watched)
    result = check(LEVEL, second=LEVEL.variant(mu=1.2 * LEVEL.mu), tol=0.1, ask="path")
    assert result.verdict is Verdict.DISAGREE
    for before, after, name in zip(*rounds[-2:], ("elements", "terms"), strict=True):
        assert after["steps"] == pytest.approx(1.5 * before["steps"], abs=1.0)
        assert after[name] == pytest.approx(1.5 * before[name], abs=1.0)


def test_refinement_goes_on_when_a_finer_run_does_away_with_a_disagreement(monkeypatch):
    """A gap beyond bars that are too small by chance, then bars that are too large, then answers as they are."""
    compare, verdicts = study.compare_answers, []
    changes = [lambda row: {"gap": 9.0 * row.allowed}, lambda row: {"required": 0.7 * row.allowed}]

    def changed_at_first(scene, a, b, asked):
        rows = compare(scene, a, b, asked)
        if len(verdicts) < len(changes):
            rows[0] = dataclasses.replace(rows[0], **changes[len(verdicts)](rows[0]))
        verdicts.append(worst_deciding_verdict(rows[:1]))
        return rows

    monkeypatch.setattr(study, "compare_answers", changed_at_first)
    assert check(LEVEL, tol=0.1, ask="path").verdict is Verdict.AGREE
    assert verdicts[:2] == [Verdict.DISAGREE, Verdict.TOO_COARSE]
    assert len(verdicts) > 2


def test_what_is_too_coarse_is_refined_where_its_bar_comes_from(right_answers):
    methods = [METHODS["following-p2"], METHODS["fourier-kink"]]

    def finer(*parts, larger=True, decides=True):
        bars = tuple(BoundPart(m.name, sum(p)) for m, p in zip(methods, parts, strict=True))
        wide = Agreement("speed", 0.1, Bound("error bars", bars), required=0.5, decides=decides, parts=parts)
        sides = [study._MethodOnScene(LEVEL, m, 1e-2, float("inf"), None) for m in methods]
        return [side.finer_settings(ladder, [wide], larger) for side, ladder in zip(sides, right_answers, strict=True)]

    sines = (0.0, 0.01), (0.9, 0.01)
    first, second = finer(*sines)
    assert first is None
    assert second["terms"] > SINES["terms"]
    assert second["steps"] > SINES["steps"]
    assert finer(*sines, decides=False) == [None, None]
    assert finer(*sines, larger=False) == [None, None]  # the larger bar alone is more than what is asked
    first, second = finer((0.0, 0.2), (0.4, 0.0), larger=False)
    assert first["steps"] > ELEMENTS["steps"]
    assert second is None


def test_required_of_the_path_alone_forces_and_laws_are_shown():
    """A fault in the path is seen where it alone is asked for: by the second look at a disagreement."""
    found = check("level", tol=0.1, tol_tension=1e-6, ask="path")
    assert found.verdict is Verdict.AGREE
    assert {row.quantity for row in found.rows if row.decides} <= {"path_max", "path_rms", "place", "speed"}
    assert any(row.verdict is Verdict.TOO_COARSE for row in found.rows if not row.decides)
    with pytest.raises(ValueError, match=r"ask = 'pth': unknown\. Did you mean path"):
        check("level", ask="pth")


@pytest.mark.parametrize("methods", ["following-p2", ("following-p2",), ("following-p2", "fourier-kink", "fourier")])
def test_a_check_is_of_two_methods(methods):
    with pytest.raises(ValueError, match=r"methods = .*: must be two, one of each wing"):
        check("level", methods=methods)


def test_smooth_functions_are_not_wrong_for_the_kink_that_they_do_not_show():
    assert check(Scene.load("cruise"), tol=0.2, methods=("following-p2", "fourier")).verdict is Verdict.AGREE


def test_a_method_of_ones_own_runs_without_a_name():
    ours = run_with_bars(LEVEL, sines.METHOD, waves=6, steps=60)
    assert ours.method == "my-sines"
