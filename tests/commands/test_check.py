"""The main job as a command."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

from cablefem import Scene
from tests.commands.calls import BROKEN, fault_lines
from tests.commands.test_lines import FEW
from validation.commands.check import selftest
from validation.core.agreement import no_bound
from validation.core.flags import with_flag
from validation.core.methods import CHECKED

DATA = Path(__file__).parents[1] / "validation" / "data"


def test_check_agrees_and_leaves_everything_in_its_folder(cablefem, tmp_path):
    code, out, err = cablefem("check", "level", "--tol", "3e-2")
    assert (code, err) == (0, "")
    folder = tmp_path / "cablefem-out" / "level"
    for method in CHECKED:
        assert {x.name for x in (folder / method).iterdir()} >= {"path.csv", "tension.csv", "response.xdmf"}
        assert json.loads((folder / method / "summary.json").read_text())["path_error"] is not None
    agreement = json.loads((folder / "agreement.json").read_text())
    assert (agreement["verdict"], agreement["doubts"]) == ("agree", [])
    quantities = {row["quantity"] for row in agreement["rows"]}
    assert quantities - {"path_slack"} == {  # where coarse companions reach beyond the onset
        "path_max", "path_rms", "tension", "tension_behind", "tension_ahead", "reactions",
        "displacement", "velocity", "slack_onset", "energy", "impulse", "laws_si", "speed", "contact", "tension_min",
        "design", "design gap", "outcome",
    }  # fmt: skip
    assert out.startswith("Both solvers agree.\nlevel: crosses the cable in 14.3 s")
    assert all(said in out for said in ("comparisons of two solvers agree; ", "slack somewhere from car at 1"))
    assert len(out.splitlines()) <= 20
    assert re.match(r"(?i)<!doctype html>.*fourier-kink", (folder / "report.html").read_text(), re.S)
    assert Scene.from_toml((folder / "scene.toml").read_text()).groups == Scene.load("level").groups


@pytest.mark.usefixtures("instant_check")
def test_check_holds_a_third_party_against_ours(cablefem):
    code, out, _ = cablefem("check", "level", "--with", DATA / "exudyn_level.csv", "--tol", "2e-2", "--verbose")
    assert code == 0
    assert "exudyn_level.csv: agrees with both" in out
    row = next(line for line in out.splitlines() if line.startswith("path_max exudyn_level.csv"))
    assert row.split()[-1] == "agree"
    rows = json.loads(Path("cablefem-out/level/agreement.json").read_text())["rows"]
    third = [row for row in rows if row.get("with") == "exudyn_level.csv"]
    assert [row["quantity"] for row in third] == ["path_max", "path_rms"]
    assert Path("cablefem-out/level/with.csv").exists()
    # Without it the second time, nothing of it stays.
    assert cablefem("check", "level", "--tol", "2e-2")[0] == 0
    assert not Path("cablefem-out/level/with.csv").exists()


def write_scaled_path(tmp_path, factor):
    rows = np.loadtxt(DATA / "opensees_level.csv", delimiter=",", skiprows=1)
    rows[:, 3] *= factor
    np.savetxt(tmp_path / "off.csv", rows, delimiter=",", header="t_s,s_o_over_l,u_over_l,v_over_l_down")
    return tmp_path / "off.csv"


@pytest.mark.usefixtures("instant_check")
def test_a_third_party_that_is_off_is_1_and_flagged(cablefem, tmp_path):
    code, out, _ = cablefem("check", "level", "--with", write_scaled_path(tmp_path, 1.05), "--with-tol", "1e-2")
    assert code == 1
    assert "off.csv: DISAGREES with both" in out
    assert "path_max off.csv" in out


@pytest.mark.usefixtures("instant_check")
def test_a_third_party_with_v_up_is_named_and_nothing_is_written(cablefem, tmp_path):
    code, _, err = cablefem("check", "level", "--with", write_scaled_path(tmp_path, -1.0))
    assert code == 2
    assert "off.csv: v points the other way" in fault_lines(err)[0]
    assert "if multiplied by -1 " in fault_lines(err)[0]
    assert not Path("cablefem-out").exists()


@pytest.mark.parametrize(("verdict", "code"), [("disagree", 1), ("not comparable", 1), ("too coarse", 1), ("agree", 0)])
def test_the_exit_code_of_a_check_is_its_verdict(cablefem, instant_check, level_check, verdict, code):
    first, *rest = level_check.rows
    other = {
        "agree": first,
        "disagree": dataclasses.replace(first, gap=4.0 * first.allowed),
        "not comparable": dataclasses.replace(first, bound=no_bound("nothing to compare")),
        "too coarse": dataclasses.replace(first, required=1e-9),
    }[verdict]
    instant_check(rows=[other, *rest])
    found, out, _ = cablefem("check", "level")
    assert found == code
    words = {
        "agree": "Both solvers agree.", "disagree": "The solvers DISAGREE", "not comparable": "NOT COMPARABLE",
        "too coarse": "TOO COARSE to tell",
    }  # fmt: skip
    assert out.startswith(words[verdict])
    assert ("times what was asked" in out) is (verdict == "too coarse")
    assert json.loads(Path("cablefem-out/level/agreement.json").read_text())["verdict"] == verdict


def test_a_bar_that_may_be_too_small_is_1_and_said(cablefem, instant_check, level_check):
    run = with_flag(level_check.b.finest, "hidden slack", least=-0.02, since=0.3, at=0.9)
    instant_check(b=dataclasses.replace(level_check.b, finest=run))
    code, out, _ = cablefem("check", "level")
    assert code == 1
    assert "fourier-kink: points of the cable are under compression" in out
    agreement = json.loads(Path("cablefem-out/level/agreement.json").read_text())
    assert (agreement["verdict"], [x["kind"] for x in agreement["doubts"]]) == ("agree", ["hidden slack"])


def test_a_check_with_a_run_that_broke_is_2(cablefem, instant_check, level_check):
    whole = level_check.b.finest
    run = dataclasses.replace(whole, **BROKEN, slack_onset=None, cause="Newton stalled", s_o=0.5 * whole.s_o)
    instant_check(b=dataclasses.replace(level_check.b, finest=run))
    code, _, err = cablefem("check", "level")
    assert code == 2
    assert fault_lines(err)[0].startswith("fourier-kink broke with the car at ")


INCLINED, TWO_SPAN = ("inclined", "--tol", "0.2"), ("two-span", *FEW)


@pytest.mark.parametrize(
    ("scene", "fault", "code", "said"),
    [
        (INCLINED, "+0.001%", 1, "fourier-kink is NOT seen"), (TWO_SPAN, "+1e-13%", 1, "elements is NOT seen"),
        (TWO_SPAN, "+10%", 0, "elements is seen"),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("without_animation")
def test_the_judge_plants_a_fault_in_itself_and_says_whether_it_is_seen(
    cablefem, monkeypatch, scene, fault, code, said
):
    """One percent is seen on a span, too: in .ci/commands."""
    monkeypatch.setitem(selftest.FAULT, "mass.mass", fault)
    found, out, _ = cablefem("check", *scene, "--self-test", "--out", "x")
    assert found == code
    assert f"self-test: 1 % more mass for {said}" in out
