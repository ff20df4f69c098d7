"""Agreement as an assertion: right answers pass, planted faults fail with both numbers, the place and the reason."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import validation
from cablefem import Scene
from tests.line import lines
from tests.validation import sines
from validation import check_solver
from validation.commands.check.line import check_line
from validation.commands.check.testing import asserting_check
from validation.core.foreign import ForeignPath
from validation.core.running import run
from validation.core.store import Refused

LEVEL = Scene.load("level")
OTHER = np.loadtxt(Path(__file__).parent / "data" / "opensees_level.csv", delimiter=",", skiprows=1).T


def stored_opensees_path(scene):
    """A user's solver in another program: here its stored answer."""
    _, s, u, v = OTHER
    return scene.length * s, scene.length * v, scene.length * u


def taut_string_path(scene, method=sines.METHOD, until=None):
    """A user's own solver: sines on a taut string, its moving mass by the chain rule."""
    r = run(scene, method, model="string", law="elastic", waves=20, steps=100, until=until)
    return r.s_o, r.v


@pytest.fixture(scope="module")
def fine_run():
    return run(LEVEL, "following-p2", elements=12, steps=500)


@pytest.fixture(scope="module")
def coarse_run():
    return run(LEVEL, "following-p2", elements=6, steps=300)


# Twenty sines are right to about 1/20 of what one sine misses: two percent.
def test_a_users_solver_agrees_and_without_coriolis_it_is_told_where_it_parts():
    ours = run(LEVEL, "following-p2", model="string", law="elastic", elements=12, steps=400)
    right = ForeignPath.of(LEVEL, *taut_string_path(LEVEL, until=0.4), name="toy")
    (row,) = validation.assert_agree(right, ours, path=4e-2)
    assert 1e-2 < row.gap < 4e-2
    wrong = ForeignPath.of(LEVEL, *taut_string_path(LEVEL, sines.without_coriolis(), until=0.4), name="toy")
    with pytest.raises(AssertionError) as caught:
        validation.assert_agree(wrong, ours, path=4e-2)
    title, line = str(caught.value).splitlines()
    assert title == "toy and following-p2 disagree"
    assert "path_max: gap" in line
    assert "allowed 0.04, largest at s_o/l = 0.4" in line
    assert "asked for: path 0.04" in line
    assert "they part from s_o/l = 0.0" in line  # it grows without bound, from the start


def test_agreement_is_judged_up_to_the_slack_onset_and_says_so(fine_run, coarse_run):
    # 6 elements and 300 steps: 4e-3, as the run's own ladder says
    rows = validation.assert_agree(coarse_run, fine_run, path=1e-2, tension=0.1)
    assert [row.quantity for row in rows] == ["path_max", "tension"]
    early = dataclasses.replace(fine_run, slack_onset=0.5)
    (row,) = validation.assert_agree(coarse_run, early, path=1e-2)
    assert "over s_o/l 0.02 to 0.5, cut at the slack onset" in row.allowed_because


def test_a_shifted_path_is_told_with_both_numbers_and_the_place(fine_run, coarse_run):
    bump = 0.05 * fine_run.max_deflection * np.exp(-(((fine_run.s_o / fine_run.length - 0.4) / 0.05) ** 2))
    off = dataclasses.replace(fine_run, v=fine_run.v + bump, path_error=1e-4)
    with pytest.raises(AssertionError, match=r"largest at s_o/l = 0\.(39|40|41)") as caught:
        validation.assert_agree(off, coarse_run, path=1e-2)
    line = str(caught.value).splitlines()[1]
    assert "they part from s_o/l = 0.3" in line
    assert "error bar of following-p2 0.0001" in line


def test_a_wrong_tension_is_told_with_its_place(fine_run, coarse_run):
    T = fine_run.fields.T.copy()
    T[np.argmin(np.abs(fine_run.fields.s_o / fine_run.length - 0.6))] *= 2.0
    off = dataclasses.replace(fine_run, fields=dataclasses.replace(fine_run.fields, T=T))
    with pytest.raises(AssertionError, match=r"tension: gap .* allowed 0\.1, largest at s_o/l = 0\.600"):
        validation.assert_agree(off, coarse_run, path=1e-2, tension=0.1)


def test_tensions_at_the_mass_are_compared_where_there_is_no_field(fine_run, coarse_run):
    with_tension = ForeignPath(
        method="b", **{n: getattr(fine_run, n) for n in ("length", "t", "s_o", "v", "u", "T_behind", "T_ahead")}
    )
    # fronts pass the mass as spikes: six elements miss some percent of H there
    rows = validation.assert_agree(with_tension, coarse_run, path=1e-2, tension=0.2)
    assert "at the mass" in rows[1].allowed_because
    without = dataclasses.replace(with_tension, T_behind=None)
    with pytest.raises(AssertionError, match="cannot be compared: b brought no tension"):
        validation.assert_agree(without, coarse_run, path=1e-2, tension=0.2)


def test_answers_that_share_nothing_cannot_be_compared(fine_run):
    with pytest.raises(AssertionError, match=r"of different cables: 2002\.37 m and 2004\.4 m long"):
        validation.assert_agree(fine_run, dataclasses.replace(fine_run, length=2004.4))
    with pytest.raises(AssertionError, match="cannot be compared: nothing to compare"):
        validation.assert_agree(fine_run, dataclasses.replace(fine_run, slack_onset=0.01))


def test_the_fixture_checks_a_line_once_and_asserts_its_verdict():
    reports = []
    checked = asserting_check(lambda *words: reports.append(words), {})
    line = lines.line(*lines.WEIGHED, name="weighed")
    assert checked(line) is checked(line)
    assert reports[0] == reports[1]
    assert reports[0][0].startswith("weighed, catenaries and elements: ")
    fault = check_line(line, second=line.replace({"car.grip.mass": "+1%"}))
    with pytest.raises(AssertionError, match=r"weighed: disagree\n  \w+: gap "):
        asserting_check(lambda *words: None, {(line.to_toml(), None): fault})(line)
    with pytest.raises(Refused, match="a solver of your own is compared on one span"):
        checked(line, stored_opensees_path)
    with pytest.raises(AssertionError, match=r"cannot be compared: of lines at rest cf.check compares both solvers"):
        validation.assert_agree(checked(line), checked(line))


@pytest.fixture(scope="module")
def third_party_check():
    """Both of our solvers at ten percent, and a third."""
    return check_solver(LEVEL, stored_opensees_path, tol=0.1)


def test_check_solver_holds_a_solver_against_both_of_ours(third_party_check):
    result = third_party_check
    assert result.verdict.value == "agree"
    assert [row.to_json().get("with") for row in result.rows][-2:] == 2 * ["stored_opensees_path"]
    content = result.agreement()
    assert content["verdict"] == "agree"
    assert content["rows"][-1]["with"] == "stored_opensees_path"
    array = check_solver(LEVEL, lambda scene: np.stack(stored_opensees_path(scene)[:2]), ours=result)
    assert array.verdict.value == "agree"
    again = check_solver(LEVEL, taut_string_path, tol=0.1, ours=result)  # right, but of the taut string
    assert again.verdict.value == "disagree"
    assert sum(row.to_json().get("with") == "taut_string_path" for row in again.rows) == 2


@pytest.mark.parametrize("answer", [None, (1.0,), 3.0])
def test_a_solver_that_returns_no_path_is_told_what_to_return(answer):
    with pytest.raises(Refused, match=r"mine: must return \(s_o, v\) or \(s_o, v, u\), or a Response; got"):
        check_solver(LEVEL, lambda scene: answer, name="mine")


def test_a_solver_with_v_up_is_told_so(third_party_check):
    with pytest.raises(Refused, match="v points the other way") as raised:
        check_solver(
            LEVEL,
            lambda scene: (stored_opensees_path(scene)[0], -stored_opensees_path(scene)[1]),
            ours=third_party_check,
        )
    assert "s_o and v in m, v down; in a file a column may be" in str(raised.value)  # a function has no columns


def test_a_solver_whose_v_is_half_too_large_disagrees(third_party_check, fine_run):
    """A shift of its places was tried, which put two of them on the support: a traceback of an interpolation."""
    fault = check_solver(LEVEL, lambda scene: (fine_run.s_o, 1.5 * fine_run.v), ours=third_party_check)
    assert fault.verdict.value == "disagree"


def test_what_is_no_solver_and_what_is_no_answer_is_told_so(fine_run):
    with pytest.raises(Refused, match="solver = 'following-p2': must be a function of a scene"):
        check_solver(LEVEL, "following-p2")
    with pytest.raises(TypeError, match=r"takes two answers, of cf\.run or cf\.quasi_static; got function"):
        validation.assert_agree(stored_opensees_path, fine_run)


def test_gaps_and_windows_that_are_none_are_refused(fine_run, coarse_run):
    for name, wrong in (
        ("path", True), ("path", "a"), ("path", -1.0), ("tension", 2.0),
        ("window", (0.5, 0.2)), ("window", 3), ("window", "ab"), ("window", (0.2, float("nan"))),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=f"{name} must "):
            validation.assert_agree(fine_run, coarse_run, **{"path": 0.1, name: wrong})
    assert validation.assert_agree(fine_run, coarse_run, path=0.1, window=np.array([0.1, 0.5]))
