"""The command as people meet it: what it prints and writes, how it refuses, and what its exit code says."""

import dataclasses
import json
import re
import subprocess
import sys
import tomllib
import types
from pathlib import Path

import numpy as np
import pytest

from cablefem import Scene
from cablefem.response import Response, write_json
from validation import cli
from validation.commands.check import study as check_study
from validation.core import resolution, running, store
from validation.core.flags import flag
from validation.core.running import run
from validation.page.page import Section

DATA = Path(__file__).parent / "data"
COMMANDS = ("scenes", "check", "run", "methods", "modes", "advise", "chart", "atlas", "oracles", "paper", "report")
QUICK = ("--method", "following-p2", "--set", "elements=4", "--set", "steps=100")


@pytest.fixture
def cablefem(capsys, tmp_path, monkeypatch):
    """Call the command in an empty folder; returns (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        code = cli.main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return code, out, err

    return call


@pytest.fixture(scope="module")
def level_check():
    """Both solvers at 5 percent: a second."""
    return check_study.check("level", tol=5e-2)


@pytest.fixture
def checked(monkeypatch, level_check):
    """Let `check` find at once what it found before, and write the verdict alone: only the command is tested here.

    Returns a function that changes what it finds.
    """
    from validation import paraview
    from validation.commands.check import page as pages

    def find(**changes):
        found = dataclasses.replace(level_check, **changes)
        monkeypatch.setattr(check_study, "check", lambda scene, **how: dataclasses.replace(found, tol=how["tol"]))

    find()
    section = Section("check-verdict", "Verdict", "<p>1</p>", "agree", "both solvers")
    monkeypatch.setattr(pages, "sections", lambda folder: [section])
    monkeypatch.setattr(paraview, "write", lambda response, folder: None)
    monkeypatch.setattr(
        check_study.Check, "write", lambda check, out: write_json(out / "agreement.json", check.agreement())
    )
    return find


def tree(folder):
    """Every file below a folder with its content."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def lines(err):
    assert all(line.startswith("cablefem: ") for line in err.splitlines())
    return [line.removeprefix("cablefem: ") for line in err.splitlines()]


# --- help -----------------------------------------------------------------------------------------------------------


def test_help_lists_every_command_of_the_design_and_so_does_no_argument_at_all(cablefem):
    code, out, err = cablefem("--help")
    assert (code, err) == (0, "")
    assert [line.split()[0] for line in out.partition("Commands:\n")[2].splitlines()[: len(COMMANDS)]] == [
        "scenes", "methods", "run", "check", "modes", "advise", "chart", "atlas", "oracles", "paper", "report",
    ]  # fmt: skip
    assert cablefem() == (0, out, "")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example_and_says_where_it_writes(cablefem, command):
    code, out, err = cablefem(command, "--help")
    assert (code, err) == (0, "")
    assert f"Example: cablefem {command}" in out
    assert "--out DIR" in out
    assert "..." not in out.splitlines()[2]  # the first line is whole


@pytest.mark.parametrize("command", COMMANDS)
def test_the_options_of_an_example_exist(cablefem, command):
    _, out, _ = cablefem(command, "--help")
    example = out.partition("Example: ")[2]
    assert all(word in out.partition("Example: ")[0] for word in example.split() if word.startswith("--"))


def loaded(*arguments):
    """Top-level modules that a call loads in a fresh interpreter."""
    call = [sys.executable, "-X", "importtime", "-m", "validation.cli", *arguments]
    told = subprocess.run(call, capture_output=True, text=True, check=True).stderr
    return {line.rpartition("|")[2].strip().partition(".")[0] for line in told.splitlines()}


def test_help_loads_nothing_that_takes_its_time():
    heavy = {"numpy", "scipy", "skfem", "matplotlib", "numba"}
    assert not loaded("--help") & heavy
    assert not loaded("check", "--help") & heavy
    assert loaded("methods") & heavy  # the probe sees them


# --- scenes and methods ---------------------------------------------------------------------------------------------


def test_scenes_are_listed_one_line_each(cablefem):
    code, out, _ = cablefem("scenes")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()[1:]] == list(Scene.library())
    assert "2002 kg" in out
    assert "Level cable, constant speed" in out


def test_a_scene_is_printed_to_be_copied(cablefem, tmp_path):
    code, out, _ = cablefem("scenes", "inclined")
    assert code == 0
    assert tomllib.loads(out)["supports"]["drop"] == 90.0
    (tmp_path / "mine.toml").write_text(out)
    mine = Scene.load(tmp_path / "mine.toml")
    assert mine.groups == Scene.load("inclined").groups
    code, out, _ = cablefem("scenes", "mine.toml")
    assert code == 0
    assert Scene.from_toml(out) == mine


def test_scenes_are_written_to_a_folder_when_asked(cablefem, tmp_path):
    assert cablefem("scenes", "--out", "all")[0] == 0
    assert {path.stem for path in (tmp_path / "all").glob("*.toml")} == set(Scene.library())
    assert cablefem("scenes", "level", "--out", "one")[0] == 0
    assert (tmp_path / "one" / "level.toml").read_text() == Scene.library_text("level")


def test_methods_are_told_with_settings_meanings_and_defaults(cablefem, tmp_path):
    from validation.core.methods import METHODS

    code, out, _ = cablefem("methods")
    assert code == 0
    for name, method in METHODS.items():
        part = out.partition(f"{name}: {method.title}\n")[2]
        assert part.startswith(f"    use: {method.trust}\n")
    assert "terms=30  sines (1 to 2000)" in out
    assert "scheme=trapezoidal  time integration (trapezoidal|newmark|" in out
    assert cablefem("methods", "--out", "table")[0] == 0
    table = json.loads((tmp_path / "table" / "methods.json").read_text())
    assert table["fourier"]["settings"]["terms"]["default"] == 30
    assert set(table) == set(METHODS)


# --- run ------------------------------------------------------------------------------------------------------------


def test_run_writes_its_files_and_says_what_came_out(cablefem, tmp_path):
    code, out, err = cablefem("run", "level", *QUICK)
    assert (code, err) == (0, "")
    folder = tmp_path / "cablefem-out" / "level" / "following-p2"
    assert {path.name for path in folder.iterdir()} == {
        "path.csv", "tension.csv", "summary.json", "response.npz", "response.xdmf", "mass.xdmf",
    }  # fmt: skip
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["settings"]["elements"] == 4
    assert summary["path_error"] is None
    assert "level, following-p2: elements=4, steps=100\n" in out
    assert f"largest deflection of the mass {summary['max_deflection']:.5g} m" in out
    assert f"slack from s_o/l = {summary['slack_onset']:.3f} on" in out
    assert f"written to {Path('cablefem-out') / 'level' / 'following-p2'}" in out


def test_run_takes_model_load_and_law(cablefem):
    code, out, _ = cablefem(
        "run", "inclined", *QUICK, "--model", "stretching", "--load", "force", "--law", "elastic", "--out", "x"
    )
    assert code == 0
    assert "elements=4, steps=100, stretching, force, elastic" in out
    summary = Response.read(Path("x/following-p2")).summary()
    assert (summary["model"], summary["load"], summary["law"]) == ("stretching", "force", "elastic")


def test_run_with_tol_chooses_the_resolution_and_makes_an_estimate(cablefem):
    code, out, _ = cablefem("run", "inclined", "--method", "following-p2", "--tol", "3e-2", "--out", "x")
    assert code == 0
    summary = json.loads(Path("x/following-p2/summary.json").read_text())
    assert 0.0 < summary["path_error"] <= 3e-2
    assert " +- " in out


def test_a_tolerance_out_of_reach_is_1_and_said(cablefem, monkeypatch, inclined):
    def too_coarse(scene, method, tol, **how):
        raise resolution.TooCoarse("following-p2 reaches 1, not 1e-06", inclined)

    monkeypatch.setattr(resolution, "resolve", too_coarse)
    code, _, err = cablefem("run", "inclined", "--method", "following-p2", "--tol", "1e-6", "--out", "x")
    assert code == 1
    assert lines(err) == ["following-p2 reaches 1, not 1e-06"]
    assert Path("x/following-p2/path.csv").exists()


@pytest.fixture(scope="module")
def inclined():
    return run(Scene.load("inclined"), "following-p2", elements=4, steps=100)


BROKEN = {"status": "incomplete", "reason": "Newton's method stalled; take more steps"}


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({}, 0),
        ({**BROKEN, "slack_onset": None, "cause": "Newton stalled"}, 2),
        ({**BROKEN, "slack_onset": 0.7, "cause": "slack"}, 0),
        ({**BROKEN, "slack_onset": 0.2, "cause": "unstable"}, 2),  # its slack is the instability's own
        ({"flags": [flag("energy", gain=0.4, allowed=0.2)]}, 1),
    ],
)
def test_the_exit_code_of_a_run_says_whether_it_broke_before_the_slack_onset(
    cablefem, monkeypatch, inclined, changes, code
):
    response = dataclasses.replace(inclined, **changes)
    monkeypatch.setattr(running, "run", lambda *names, **how: response)
    found, out, err = cablefem("run", "inclined", *QUICK, "--out", "x")
    assert found == code
    assert Path("x/following-p2/path.csv").exists()  # what was computed is kept
    assert ("following-p2 broke at s_o/l = 0.9" in err) == (code == 2)
    if changes:
        assert "stalled" in out or "gains energy" in out


def test_a_run_that_really_breaks_is_2(cablefem):
    code, _, err = cablefem("run", "level", "--method", "fourier", "--set", "scheme=central-difference",
                            "--set", "terms=20", "--set", "steps=50")  # fmt: skip
    assert code == 2
    assert "fourier broke at s_o/l = 0." in err


# --- check ----------------------------------------------------------------------------------------------------------


def test_check_agrees_and_leaves_everything_in_its_folder(cablefem, tmp_path):
    code, out, err = cablefem("check", "level", "--tol", "5e-2")
    assert (code, err) == (0, "")
    folder = tmp_path / "cablefem-out" / "level"
    for method in check_study.SOLVERS:
        for name in ("path.csv", "tension.csv", "summary.json", "response.xdmf"):
            assert (folder / method / name).exists()
        assert json.loads((folder / method / "summary.json").read_text())["path_error"] is not None
    agreement = json.loads((folder / "agreement.json").read_text())
    assert agreement["verdict"] == "agree"
    quantities = ["path_max", "path_rms", "tension", "jump", "energy", "overshoot"]
    assert [row["quantity"] for row in agreement["rows"]] == quantities
    assert [line.split()[0] for line in out.splitlines()[1:7]] == quantities
    assert "following-p2 and fourier-kink agree over s_o/l = 0.02 to 0.8\n" in out
    assert "slack from s_o/l = 0." in out
    assert "past" in out  # where the answer stops being meaningful
    page = (folder / "report.html").read_text()
    assert page.startswith("<!doctype html>") or page.startswith("<!DOCTYPE html>")
    assert "fourier-kink" in page
    assert Scene.from_toml((folder / "scene.toml").read_text()).groups == Scene.load("level").groups


@pytest.mark.usefixtures("checked")
def test_check_holds_a_third_party_against_ours(cablefem):
    code, out, _ = cablefem("check", "level", "--with", DATA / "exudyn_level.csv", "--tol", "2e-2")
    assert code == 0
    assert "following-p2, fourier-kink and exudyn_level.csv agree" in out
    row = next(line for line in out.splitlines() if line.startswith("path_max exudyn_level.csv"))
    assert row.split()[-1] == "v"  # u and v
    rows = json.loads(Path("cablefem-out/level/agreement.json").read_text())["rows"]
    third = [row for row in rows if row.get("with") == "exudyn_level.csv"]
    assert [row["quantity"] for row in third] == ["path_max", "path_rms"]
    assert Path("cablefem-out/level/with.csv").exists()
    # Without it the second time, nothing of it stays.
    assert cablefem("check", "level", "--tol", "2e-2")[0] == 0
    assert not Path("cablefem-out/level/with.csv").exists()


def planted(tmp_path, factor):
    rows = np.loadtxt(DATA / "opensees_level.csv", delimiter=",", skiprows=1)
    rows[:, 3] *= factor
    np.savetxt(tmp_path / "off.csv", rows, delimiter=",", header="t_s,s_o_over_l,u_over_l,v_over_l_down")
    return tmp_path / "off.csv"


@pytest.mark.usefixtures("checked")
def test_a_third_party_that_is_off_is_1_and_flagged(cablefem, tmp_path):
    code, out, _ = cablefem("check", "level", "--with", planted(tmp_path, 1.05), "--with-tol", "1e-2")
    assert code == 1
    assert "DISAGREE" in out
    row = next(line for line in out.splitlines() if line.startswith("path_max off.csv"))
    assert "disagree" in row


@pytest.mark.usefixtures("checked")
def test_a_third_party_with_v_up_is_named_and_nothing_is_written(cablefem, tmp_path):
    code, _, err = cablefem("check", "level", "--with", planted(tmp_path, -1.0))
    assert code == 2
    assert "off.csv: v points the other way" in lines(err)[0]
    assert lines(err)[0].endswith("name it v_over_l_up")
    assert not Path("cablefem-out").exists()


@pytest.mark.parametrize(("verdict", "code"), [("disagree", 1), ("not comparable", 1), ("agree", 0)])
def test_the_exit_code_of_a_check_is_its_verdict(cablefem, checked, level_check, verdict, code):
    first, *rest = level_check.rows
    other = {
        "agree": first,
        "disagree": dataclasses.replace(first, gap=2.0 * first.allowed),
        "not comparable": dataclasses.replace(first, bound=dataclasses.replace(first.bound, tol=1e-9)),
    }[verdict]
    checked(rows=[other, *rest])
    found, out, _ = cablefem("check", "level")
    assert found == code
    words = {"agree": "agree", "disagree": "DISAGREE", "not comparable": "are NOT COMPARABLE"}
    assert f"following-p2 and fourier-kink {words[verdict]} over" in out
    assert json.loads(Path("cablefem-out/level/agreement.json").read_text())["verdict"] == verdict


def test_a_check_with_a_run_that_broke_is_2(cablefem, checked, level_check):
    run = dataclasses.replace(level_check.b.run, **BROKEN, slack_onset=None, cause="Newton stalled")
    checked(b=dataclasses.replace(level_check.b, run=run))
    code, _, err = cablefem("check", "level")
    assert code == 2
    assert lines(err)[0].startswith("fourier-kink broke at s_o/l = 0.9")


# --- modes ----------------------------------------------------------------------------------------------------------


def test_modes_of_both_solvers_and_the_exact_ones(cablefem):
    code, out, _ = cablefem("modes", "bare")
    assert code == 0
    found = json.loads(Path("cablefem-out/bare/modes.json").read_text())
    # Section 7.1 of the paper, computed to 11 digits: the exact linearised catenary.
    exact = [5.3454766022, 6.2761408254, 9.5728553824, 12.5684221916, 15.7413444234, 18.8571036040, 22.0114146253,
             25.1448878959, 28.2937309199, 31.4323118252]  # fmt: skip
    # The scene's length has 11 digits, its alpha thus 7 of the 844.416 behind these; Galerkin is good to a few 1e-7.
    np.testing.assert_allclose(found["exact"], exact, rtol=2e-8)
    for name in ("elements", "fourier", "wavelet"):
        np.testing.assert_allclose(found[name], exact, rtol=1e-6)
    assert "5.3454766" in out


def test_modes_that_disagree_are_1(cablefem, monkeypatch):
    from cablefem.elements import modes

    right = modes.bare_frequencies
    monkeypatch.setattr(modes, "bare_frequencies", lambda *a, **k: 1.001 * right(*a, **k))
    code, out, _ = cablefem("modes", "inclined")
    assert code == 1
    assert "disagree" in out


# --- studies --------------------------------------------------------------------------------------------------------

STUDIES = {
    "advise": ("adequacy", "advise", ["advise", "level", "--tol", "1e-2"], "level"),
    "chart": ("workprecision", "chart", ["chart", "level"], "level"),
    "atlas": ("stability", "atlas", ["atlas"], "atlas"),
    "oracles": ("exactness", "oracle_table", ["oracles"], "oracles"),
    "paper": ("claims", "paper", ["paper"], "paper"),
}


def stand_in(monkeypatch, command, verdict="agree"):
    """Put a study and its pages in the place of those of a command; returns what the study was called with."""
    _, function, arguments, folder = STUDIES[command]
    calls = []

    def study(*inputs):
        calls.append(inputs)
        inputs[-1]("half", 0.5)
        return {"verdict": verdict}

    pages = types.SimpleNamespace(sections=lambda out: [Section("one", "One", "<p>1</p>", verdict, "this was found")])
    monkeypatch.setitem(sys.modules, f"validation.commands.{command}.study", types.SimpleNamespace(**{function: study}))
    monkeypatch.setitem(sys.modules, f"validation.commands.{command}.page", pages)
    return calls, arguments, Path("cablefem-out") / folder


@pytest.mark.parametrize("command", sorted(STUDIES))
def test_a_study_gets_its_inputs_and_its_findings_are_told(cablefem, monkeypatch, command):
    calls, arguments, folder = stand_in(monkeypatch, command)
    code, out, err = cablefem(*arguments)
    assert (code, err) == (0, "")
    (inputs,) = calls
    assert inputs[-2] == folder
    named = {"advise": ["level", 1e-2], "chart": ["level"]}.get(command, [])
    assert [getattr(x, "name", x) for x in inputs[:-2]] == named
    assert "this was found" in out
    assert "this was found" in (folder / "report.html").read_text()


@pytest.mark.parametrize(("command", "code"), [("oracles", 1), ("paper", 0), ("atlas", 0)])
def test_only_oracles_put_our_solvers_to_the_test(cablefem, monkeypatch, command, code):
    _, arguments, _ = stand_in(monkeypatch, command, verdict="disagree")
    assert cablefem(*arguments)[0] == code


@pytest.mark.usefixtures("checked")
def test_report_runs_what_is_missing_and_gathers_what_is_there(cablefem, monkeypatch):
    monkeypatch.setattr("validation.cli.PARTS", ())
    assert cablefem("report")[0] == 2
    assert cablefem("check", "level")[0] == 0
    calls, _, _ = stand_in(monkeypatch, "atlas")
    monkeypatch.setattr("validation.cli.PARTS", (("check", "level"), ("atlas",)))
    for _ in range(2):  # also a second time, over the first one
        code, out, _ = cablefem("report")
        assert code == 0
        page = Path("cablefem-out/report.html").read_text()
        assert "this was found" in page
        assert "atlas: One" in out
        assert "level: " in out
        assert 'id="atlas-one"' in page
    assert len(calls) == 1  # a finished part is not run again
    # of one folder
    assert cablefem("report", "--out", "cablefem-out/level")[0] == 0
    assert "this was found" not in Path("cablefem-out/level/report.html").read_text()


@pytest.mark.usefixtures("checked")
def test_an_interrupted_part_is_run_again(cablefem, monkeypatch):
    stand_in(monkeypatch, "atlas")
    monkeypatch.setattr("validation.cli.PARTS", (("check", "level"), ("atlas",)))
    study = sys.modules["validation.commands.atlas.study"]

    def interrupted(*inputs):
        raise KeyboardInterrupt

    monkeypatch.setattr(study, "atlas", interrupted)
    assert cablefem("report")[0] == 130
    assert not Path("cablefem-out/report.html").exists()
    stand_in(monkeypatch, "atlas")
    assert cablefem("report")[0] == 0
    assert "this was found" in Path("cablefem-out/report.html").read_text()


def test_report_does_not_write_over_a_strange_file(cablefem, monkeypatch):
    monkeypatch.setattr("validation.cli.PARTS", ())
    _, arguments, _ = stand_in(monkeypatch, "atlas")
    assert cablefem(*arguments)[0] == 0
    Path("cablefem-out/report.html").write_text("mine")
    assert cablefem("report")[0] == 2
    assert Path("cablefem-out/report.html").read_text() == "mine"


# --- folders --------------------------------------------------------------------------------------------------------


def test_a_folder_with_anything_else_in_it_is_refused_and_left_alone(cablefem, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("years of work")
    code, out, err = cablefem("run", "level", *QUICK, "--out", "full")
    assert (code, out) == (2, "")
    assert lines(err) == [
        "full is not empty and holds no result of cablefem; nothing was written; choose another folder with --out"
    ]
    assert tree(tmp_path) == {"full/thesis.tex": b"years of work"}


def test_a_folder_is_for_one_command_and_one_scene(cablefem, tmp_path):
    assert cablefem("modes", "level", "--out", "x")[0] == 0
    before = tree(tmp_path)
    code, _, err = cablefem("run", "level", *QUICK, "--out", "x")
    assert code == 2
    assert "x holds a result of cablefem modes" in err
    code, _, err = cablefem("modes", "inclined", "--out", "x")
    assert code == 2
    assert "x holds results of another scene named level" in err
    assert tree(tmp_path) == before
    assert cablefem("modes", "level", "--out", "x")[0] == 0  # rebuilt


def test_a_scene_that_changed_under_its_name_is_another_scene(cablefem, tmp_path):
    text = Scene.load("level").to_toml()
    (tmp_path / "a.toml").write_text(text)
    assert cablefem("modes", "a.toml")[0] == 0
    (tmp_path / "a.toml").write_text(text.replace("span = 2000.0", "span = 1990.0"))
    code, _, err = cablefem("modes", "a.toml")
    assert code == 2
    assert "another scene named level" in err


@pytest.mark.usefixtures("checked")
def test_commands_share_the_default_folder_of_a_scene_but_no_file(cablefem):
    assert cablefem("modes", "level")[0] == 0
    assert cablefem("check", "level")[0] == 0
    assert cablefem("run", "level", "--method", "fourier", "--set", "terms=8", "--set", "steps=80")[0] == 0
    assert cablefem("check", "level")[0] == 0  # rebuilt
    before = tree(Path("cablefem-out"))
    code, _, err = cablefem("run", "level", *QUICK)  # would write over one half of the check
    assert code == 2
    assert "following-p2 holds a result of cablefem check" in err
    assert tree(Path("cablefem-out")) == before


def test_an_interrupted_result_is_taken_up_again(cablefem, monkeypatch):
    def interrupted(*names, **how):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(running, "run", interrupted)
        code, _, err = cablefem("run", "level", *QUICK, "--out", "x")
    assert code == 130
    assert lines(err) == ["interrupted; files that were written are whole, and the command can be given again"]
    assert cablefem("run", "level", *QUICK, "--out", "x")[0] == 0


@pytest.mark.parametrize(
    ("out", "said"),
    [("file", "file is a file; --out must be a folder"), ("file/x", "cannot write to file/x: Not a directory")],
)
def test_a_folder_that_cannot_be_made_is_said(cablefem, tmp_path, out, said):
    (tmp_path / "file").write_text("mine")
    code, _, err = cablefem("run", "level", *QUICK, "--out", out)
    assert code == 2
    assert lines(err) == [said]
    assert (tmp_path / "file").read_text() == "mine"


def test_a_folder_that_may_not_be_written_is_said(cablefem, monkeypatch):
    def denied(*names, **how):
        raise PermissionError(13, "Permission denied", "x")

    monkeypatch.setattr(Path, "mkdir", denied)
    code, _, err = cablefem("run", "level", *QUICK, "--out", "x")
    assert code == 2
    assert lines(err) == ["cannot write to x: Permission denied"]


def test_a_full_disk_is_said(cablefem, monkeypatch):
    def full(*names):
        raise OSError(28, "No space left on device", "x/following-p2/path.csv")

    monkeypatch.setattr(Response, "write", full)
    code, _, err = cablefem("run", "level", *QUICK, "--out", "x")
    assert code == 2
    assert lines(err) == ["x/following-p2/path.csv: No space left on device"]


def test_a_marker_that_is_none_makes_no_folder_ours(tmp_path):
    for text in ("", "[1]", "{}", "3", '{"scene": ""}'):
        (tmp_path / store.MARKER).write_text(text)
        assert store.results(tmp_path) == []
        with pytest.raises(store.Refused):
            store.claim(tmp_path, "run", "x", ["a"])


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["chek", "level"], ["No such command 'chek'. Did you mean 'check'? (see cablefem --help)"]),
        (["check"], ["Missing argument 'SCENE'. (see cablefem check --help)"]),
        (["check", "level", "--tl", "1"], ["No such option: --tl"]),
        (["check", "level", "--tl", "1"], ["--tol"]),
        (["check", "level", "--tol"], ["'--tol' requires an argument"]),
        (["check", "level", "--tol", "abc"], ["'--tol': 'abc' is no number"]),
        (["check", "level", "--tol", "nan"], ["--tol must lie in [1e-06, 0.2], got nan"]),
        (["check", "level", "--tol", "0.5"], ["--tol must lie in [1e-06, 0.2], got 0.5"]),
        (["check", "level", "--with-tol", "-1"], ["--with-tol must lie in [0, 1], got -1"]),
        (["check", "level", "more"], ["unexpected extra argument"]),
        (["check", "levl"], ["scene = 'levl': no built-in scene, no file. Did you mean level?"]),
        (["check", "bare"], ["scene bare has no [mass] and [travel]: a bare cable is for modes and scenes only"]),
        (["run", "bare", *QUICK], ["scene bare has no [mass] and [travel]"]),
        (["advise", "bare", "--tol", "1e-2"], ["scene bare has no [mass] and [travel]"]),
        (["advise", "level", "--tol", "0"], ["--tol must lie in"]),
        (["chart", "bare"], ["scene bare has no [mass] and [travel]"]),
        (["check", "level", "--with", "no.csv"], ["no.csv: no such file"]),
        (["scenes", "levle"], ["Did you mean level?"]),
        (["run", "level"], ["Missing option '--method'"]),
        (["run", "level", "--method", "fourir"], ["unknown method 'fourir'; did you mean 'fourier'?"]),
        (["run", "level", "--method", "fourier", "--set", "trms=3"], ["fourier has no setting 'trms'"]),
        (["run", "level", "--method", "fourier", "--set", "trms=3"], ["did you mean 'terms'?"]),
        (["run", "level", "--method", "fourier", "--set", "terms=0"], ["terms must lie in [1, 2000], got '0'"]),
        (["run", "level", "--method", "fourier", "--set", "terms=x"], ["terms must be an integer, got 'x'"]),
        (["run", "level", "--method", "fourier", "--set", "rho_inf=nan"], ["rho_inf must lie in [0, 1]"]),
        (["run", "level", "--method", "fourier", "--set", "terms"], ["--set must be KEY=VALUE, got 'terms'"]),
        (["run", "level", "--method", "fourier", "--set", "scheme=newmrk"], ["did you mean 'newmark'?"]),
        (["run", "level", *QUICK, "--tol", "1e-2"], ["--set elements and --tol exclude", "--set steps and --tol"]),
        (["run", "level", "--method", "fixed-p1-naive", "--tol", "1e-2"], ["converges to a wrong answer"]),
        (
            ["run", "levl", "--method", "fourir", "--model", "ful", "--load", "masse", "--law", "x", "--tol", "9"],
            ["--model must be one of full, stretching, sagged, string, got 'ful'; did you mean full?",
             "--load must be one of", "--law must be one of", "--tol must lie in", "unknown method", "scene = 'levl'"],
        ),
    ],
)  # fmt: skip
def test_bad_input_is_one_clear_line_per_fault_and_2_and_nothing_is_written(cablefem, tmp_path, arguments, said):
    code, out, err = cablefem(*arguments)
    assert (code, out) == (2, "")
    found = lines(err)
    for part in said:
        assert sum(part in line for line in found) == 1, (part, found)
    assert len(found) <= len(said)
    assert tree(tmp_path) == {}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gravity = = 3", ["bad.toml: not valid TOML"]),
        ("", ["bad.toml: cable: missing", "bad.toml: supports: missing"]),
        (Scene.library_text("level").replace("mass = 2002", "mas = 2002"), ["mass.mas = 2002", "mass.mass: missing"]),
        (Scene.library_text("level").replace("span = 2000.0", "span = nan"), ["supports.span = nan"]),
    ],
)
def test_a_bad_scene_file_is_told_fault_by_fault_with_its_name(cablefem, tmp_path, text, said):
    (tmp_path / "bad.toml").write_text(text)
    code, out, err = cablefem("check", "bad.toml")
    assert (code, out) == (2, "")
    found = lines(err)
    assert len(found) == len(said)
    for part in said:
        assert any(part in line and line.startswith("bad.toml: ") for line in found), (part, found)


def test_a_fault_of_ours_is_owned_up_to_and_never_looks_like_a_verdict(monkeypatch, capsys):
    monkeypatch.setattr(Scene, "library", lambda: 1 / 0)
    assert cli.main(["scenes"]) == 2
    err = capsys.readouterr().err
    assert "ZeroDivisionError" in err
    assert err.endswith("cablefem: this is a fault of cablefem, not of your input\n")


# --- terminals and pipes --------------------------------------------------------------------------------------------


def test_a_pipe_gets_plain_lines_whatever_the_width(cablefem, monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    _, out, _ = cablefem("scenes")
    assert "\x1b" not in out
    assert out.isascii()
    assert len(out.splitlines()) == len(Scene.library()) + 1
    assert all(line == line.rstrip() for line in out.splitlines())


@pytest.mark.parametrize("columns", [30, 80, 200])
def test_a_terminal_of_any_width_gets_every_word(monkeypatch, capsys, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert cli.main(["scenes"]) == 0
    out = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
    assert max(map(len, out.splitlines())) <= columns
    letters = "".join(out.split())
    for name, title in Scene.library().items():
        assert name in letters
        assert set(title.split()) <= set(out.split())


def test_a_reader_that_leaves_early_is_no_fault(tmp_path):
    shell = f"{sys.executable} -m validation.cli methods | head -n 1"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, cwd=Path(cli.__file__).parents[1])
    assert done.stdout.startswith("following-p1")
    assert done.stderr == ""
