"""Studies, and the report that gathers them."""

import json
import re
import sys
import types
from pathlib import Path

import pytest

from cablefem import Scene
from tests.commands.calls import QUICK
from validation.commands.run import page as run_page
from validation.core import store
from validation.page import report
from validation.page.page import Section

STUDIES = {
    "advise": ("adequacy", "advise", ["advise", "level", "--tol", "1e-2"], "level"),
    "chart": ("workprecision", "chart", ["chart", "level"], "level"),
    "atlas": ("stability", "atlas", ["atlas"], "atlas"),
    "oracles": ("exactness", "write_oracle_table", ["oracles"], "oracles"),
    "paper": ("claims", "paper", ["paper"], "paper"),
}


def replace_study(monkeypatch, command, verdict="agree"):
    """Put a study and its pages in the place of those of a command; returns what the study was called with."""
    _, function, arguments, folder = STUDIES[command]
    calls = []

    def study(*inputs, **how):
        calls.append(inputs)
        inputs[-1]("half", 0.5)
        return {"verdict": verdict}

    pages = types.SimpleNamespace(sections=lambda out: [Section("one", "One", "<p>1</p>", verdict, "this was found")])
    monkeypatch.setitem(sys.modules, f"validation.commands.{command}.study", types.SimpleNamespace(**{function: study}))
    monkeypatch.setitem(sys.modules, f"validation.commands.{command}.page", pages)
    return calls, arguments, Path("cablefem-out") / folder


@pytest.mark.parametrize("command", sorted(STUDIES))
def test_a_study_gets_its_inputs_and_its_findings_are_told(cablefem, monkeypatch, command):
    calls, arguments, folder = replace_study(monkeypatch, command)
    code, out, err = cablefem(*arguments)
    assert (code, err) == (0, "")
    (inputs,) = calls
    assert inputs[-2] == folder
    named = {"advise": ["level", 1e-2], "chart": ["level"]}.get(command, [])
    assert [getattr(x, "name", x) for x in inputs[:-2]] == named
    assert "this was found" in out
    assert "this was found" in (folder / "report.html").read_text()
    written = out.split(f"written to {folder}: ")[1].split()
    assert all((folder / name.rstrip(",")).exists() for name in written)


@pytest.mark.parametrize(("command", "code"), [("oracles", 1), ("paper", 0), ("atlas", 1)])
def test_exact_answers_and_the_catalogue_put_our_solvers_to_the_test(cablefem, monkeypatch, command, code):
    _, arguments, _ = replace_study(monkeypatch, command, verdict="disagree")
    assert cablefem(*arguments)[0] == code


@pytest.mark.usefixtures("instant_check")
def test_report_runs_what_is_missing_and_gathers_what_is_there(cablefem, monkeypatch):
    monkeypatch.setattr("validation.commands.report.command.PARTS", ())
    assert cablefem("report")[0] == 2
    assert cablefem("check", "level")[0] == 0
    calls, _, _ = replace_study(monkeypatch, "atlas")
    monkeypatch.setattr("validation.commands.report.command.PARTS", (("check", "level"), ("atlas",)))
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


@pytest.mark.usefixtures("instant_check")
def test_an_interrupted_part_is_run_again(cablefem, monkeypatch):
    replace_study(monkeypatch, "atlas")
    monkeypatch.setattr("validation.commands.report.command.PARTS", (("check", "level"), ("atlas",)))
    study = sys.modules["validation.commands.atlas.study"]

    def interrupted(*inputs, **how):
        raise KeyboardInterrupt

    monkeypatch.setattr(study, "atlas", interrupted)
    assert cablefem("report")[0] == 130
    assert not Path("cablefem-out/report.html").exists()
    with monkeypatch.context() as nothing_to_run:
        nothing_to_run.setattr("validation.commands.report.command.PARTS", ())
        code, out, _ = cablefem("report")
    assert code == 0
    assert "atlas did not finish" in out
    replace_study(monkeypatch, "atlas")
    assert cablefem("report")[0] == 0
    assert "this was found" in Path("cablefem-out/report.html").read_text()


def test_a_part_that_breaks_is_red_and_the_others_are_there(cablefem, monkeypatch):
    replace_study(monkeypatch, "atlas")

    def broken(*inputs, **how):
        raise ValueError("zero-size array to reduction operation")

    monkeypatch.setattr(sys.modules["validation.commands.atlas.study"], "atlas", broken)
    monkeypatch.setattr("validation.commands.report.command.PARTS", (("atlas",), ("modes", "bare")))
    code, out, _ = cablefem("report")
    page = Path("cablefem-out/report.html").read_text()
    assert code == 1
    assert "It ended without a result." in out
    assert 'class="badge bad"' in page
    assert "zero-size array" in page
    assert 'id="bare-modes-frequencies"' in page
    replace_study(monkeypatch, "atlas")  # mended
    assert cablefem("report")[0] == 0
    assert "badge bad" not in Path("cablefem-out/report.html").read_text()


def test_a_report_of_something_red_is_not_fine_even_when_nothing_is_left_to_run(cablefem, monkeypatch):
    replace_study(monkeypatch, "oracles", verdict="disagree")
    monkeypatch.setattr("validation.commands.report.command.PARTS", (("oracles",),))
    assert [cablefem("report")[0] for _ in range(2)] == [1, 1]


def test_report_does_not_write_over_a_strange_file(cablefem, monkeypatch):
    monkeypatch.setattr("validation.commands.report.command.PARTS", ())
    _, arguments, _ = replace_study(monkeypatch, "atlas")
    assert cablefem(*arguments)[0] == 0
    Path("cablefem-out/report.html").write_text("mine")
    assert cablefem("report")[0] == 2
    assert Path("cablefem-out/report.html").read_text() == "mine"


def test_verdicts_of_all_scenes_come_before_what_is_behind_them(tmp_path, monkeypatch):
    parts = (("check", "level"), ("check", "tramway"), ("paper",))
    for command, name in (("paper", "paper"), ("check", "tramway"), ("check", "level")):
        folder = tmp_path / name
        folder.mkdir()
        (folder / store.MARKER).write_text(
            json.dumps({"scene": "", "results": {command: {"scene": "", "writes": [], "files": [], "finished": True}}})
        )
    two = [Section(name, name.capitalize(), "<p>1</p>") for name in ("verdict", "path")]
    monkeypatch.setattr(report, "read_stored_sections", lambda folder, command: two)
    report.write_and_print_combined_report(tmp_path, parts)
    page = (tmp_path / "report.html").read_text()
    order = ["level-verdict", "tramway-verdict", "level-path", "tramway-path", "paper-verdict", "paper-path"]
    places = [page.index(f'id="{name}"') for name in order]
    assert places == sorted(places)


def test_two_commands_on_one_scene_may_have_pages_of_one_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in ("check", "run"):
        folder = store.claim_and_clear_folder(None, command, Scene.load("bare"), [command])
        store.mark_finished_with_files(folder, command)
    one = [Section("answer", "The answer", "<p>1</p>")]
    monkeypatch.setattr(report, "read_stored_sections", lambda folder, command: one)
    monkeypatch.setattr(run_page, "sections", lambda folder: one)
    report.write_report_and_mark_finished(folder, "run")
    page = (folder / "report.html").read_text()
    assert page.count('id="answer"') == page.count('id="answer-check"') == 1
    contents = page[page.index("<nav") : page.index("</nav>")]
    links = re.findall(r'<a href="#([^"]*)">([^<]*)</a>', contents)
    assert links == [("answer", "The answer"), ("answer-check", "The answer (check)")]
    assert contents.index("<details") > contents.index("The answer")  # those of the check are folded
    assert re.search(r"<h2[^>]*>The answer \(check\)", page)


def test_the_page_begins_with_the_latest_command(cablefem):
    run = ("run", "level", *QUICK, "--no-bars", "--out", "x")
    for arguments, first in ((("modes", "level", "--out", "x"), "modes-frequencies"), (run, "answer"), (run, "answer")):
        assert cablefem(*arguments)[0] == 0
        page = Path("x/report.html").read_text()
        assert re.search(r'<section id="([^"]*)"', page)[1] == first
    assert 'id="modes-frequencies"' in page


@pytest.mark.parametrize("damage", [lambda text: text[:500], lambda text: text.replace('"agree"', '"perhaps"')])
def test_a_result_whose_pages_are_damaged_is_named_beside_the_others(cablefem, monkeypatch, damage):
    monkeypatch.setattr("validation.commands.report.command.PARTS", ())
    for name in ("bare", "level"):
        assert cablefem("modes", name, "--out", f"r/{name}")[0] == 0
    pages = store.stored_sections_path(Path("r/level"), "modes")
    pages.write_text(damage(pages.read_text()))
    code, out, _ = cablefem("report", "--out", "r")
    assert code == 0
    assert "bare: Frequencies of the bare cable" in out
    assert "level: " in out
    assert Path("r/report.html").read_text().count("<section") == 2
