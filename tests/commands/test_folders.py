"""Where results go, and what is refused."""

import csv
import fcntl
import os
from functools import cache
from pathlib import Path

import pytest

from cablefem import Scene
from cablefem.response import Response
from tests.commands.calls import QUICK, fault_lines, file_contents
from validation.commands.modes import study
from validation.commands.run import study as run_study
from validation.core import store
from validation.page.answer import many

LEVEL = Scene.load("level")
FOURIER = ("--method", "fourier", "--set", "terms=4", "--set", "steps=40", "--no-bars")
EDITED = LEVEL.variant(mu=0.9, name="level").to_toml()

pytestmark = pytest.mark.usefixtures("without_animation")
_frequencies = cache(study.scaled_cable_frequencies)


@pytest.fixture(autouse=True)
def frequencies_found_once(monkeypatch):
    """Let `modes` find the frequencies of a cable once: where they go is tested here."""
    monkeypatch.setattr(study, "scaled_cable_frequencies", _frequencies)


@pytest.mark.parametrize("name", ["following-p2/thesis.tex", "report.html"])
def test_a_file_of_a_name_that_is_to_be_written_is_refused_and_left_alone(cablefem, tmp_path, name):
    (tmp_path / "full" / "following-p2").mkdir(parents=True)
    (tmp_path / "full" / name).write_text("years of work")
    before = file_contents(tmp_path)
    code, out, err = cablefem("run", "level", *QUICK, "--no-bars", "--out", "full")
    assert (code, out) == (2, "")
    assert fault_lines(err) == [
        "full holds following-p2, which this version of cablefem did not write; "
        "nothing was written; choose another folder with --out"
    ]
    assert file_contents(tmp_path) == before


@pytest.mark.parametrize("command", ["run level", "sweep checks", "modes bare", "report"])
@pytest.mark.parametrize("name", ["", " "])
def test_an_empty_name_is_no_folder(cablefem, tmp_path, command, name):
    """A variable of the shell that is not set; results stood in the working folder."""
    code, out, err = cablefem(*command.split(), "--out", name)
    assert (code, out) == (2, "")
    assert f"{name!r} names no folder" in err
    assert file_contents(tmp_path) == {}


def test_a_second_command_at_once_is_kept_out_of_a_folder(cablefem, tmp_path):
    """The page was headed by one scene and held the answer of the other."""
    (tmp_path / "x").mkdir()
    other = os.open(tmp_path / "x", os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)
    code, out, err = cablefem("run", "level", *QUICK, "--no-bars", "--out", "x")
    assert (code, out) == (2, "")
    assert fault_lines(err) == [
        "another command is writing to x; nothing was written; choose another folder with --out"
    ]
    assert file_contents(tmp_path / "x") == {}
    os.close(other)
    assert cablefem("run", "level", *QUICK, "--no-bars", "--out", "x")[0] == 0


def test_results_stand_beside_files_of_ones_own_and_of_other_commands(cablefem, tmp_path):
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "thesis.tex").write_text("years of work")
    assert cablefem("modes", "level", "--out", "x")[0] == 0
    before = file_contents(tmp_path / "x")
    assert cablefem("run", "level", *QUICK, "--no-bars", "--out", "x")[0] == 0
    after = file_contents(tmp_path / "x")
    assert {name: after[name] for name in ("thesis.tex", "modes.json")} == {
        name: before[name] for name in ("thesis.tex", "modes.json")
    }
    page = (tmp_path / "x" / "report.html").read_text()
    assert 'id="answer"' in page
    assert "Frequencies" in page
    assert cablefem("modes", "level", "--out", "x")[0] == 0  # rebuilt


def test_an_edited_scene_replaces_the_results_of_the_same_command(cablefem, tmp_path):
    (tmp_path / "a.toml").write_text(LEVEL.to_toml())
    assert cablefem("run", "a.toml", *QUICK, "--no-bars")[0] == 0
    assert cablefem("run", "a.toml", *FOURIER)[0] == 0
    before = file_contents(tmp_path / "cablefem-out/level")
    (tmp_path / "a.toml").write_text(EDITED)
    assert cablefem("run", "a.toml", *QUICK, "--no-bars")[0] == 0
    after = file_contents(tmp_path / "cablefem-out/level")
    assert not any(name.startswith("fourier/") for name in after)  # it was of the scene before
    assert after["following-p2/path.csv"] != before["following-p2/path.csv"]


def test_what_a_command_did_not_write_outlives_its_results(cablefem, tmp_path):
    (tmp_path / "a.toml").write_text(LEVEL.to_toml())
    assert cablefem("run", "a.toml", *FOURIER, "--out", "x")[0] == 0
    for name in ("notes.txt", "fourier/notes.txt"):
        (tmp_path / "x" / name).write_text("mine")
    assert cablefem("run", "a.toml", *FOURIER, "--out", "x")[0] == 0  # a second time: it does not make them ours
    (tmp_path / "a.toml").write_text(EDITED)
    assert cablefem("run", "a.toml", *QUICK, "--no-bars", "--out", "x")[0] == 0
    after = file_contents(tmp_path / "x")
    assert {name for name in after if not name.startswith("following-p2/")} == {
        "notes.txt", "fourier/notes.txt", "report.html", store.MARKER, ".run.pages.json",
    }  # fmt: skip
    assert after["fourier/notes.txt"] == b"mine"


def test_an_edited_scene_leaves_the_results_of_other_commands(cablefem, tmp_path):
    (tmp_path / "a.toml").write_text(LEVEL.to_toml())
    assert cablefem("modes", "a.toml")[0] == 0
    before = file_contents(Path("cablefem-out"))
    (tmp_path / "a.toml").write_text(EDITED)
    assert cablefem("run", "a.toml", *QUICK, "--no-bars")[0] == 0
    after = file_contents(Path("cablefem-out"))
    assert after["level/modes.json"] == before["level/modes.json"]
    assert store.commands_on_latest_scene(Path("cablefem-out/level")) == ["run"]  # a page shows results of one scene


@pytest.mark.usefixtures("instant_check")
def test_a_command_replaces_results_of_ours_whose_files_it_writes(cablefem):
    """`run` and then `check` was refused."""
    folder = Path("cablefem-out/level")
    assert cablefem("modes", "level")[0] == 0
    assert cablefem("run", "level", *FOURIER)[0] == 0
    assert cablefem("run", "level", *QUICK, "--no-bars")[0] == 0
    for _ in range(2):
        assert cablefem("check", "level", "--tol", "3e-2")[0] == 0
        assert store.commands_on_latest_scene(folder) == ["modes", "check"]
        assert not (folder / "fourier").exists()
        page = (folder / "report.html").read_text()
        assert page.count('id="check-verdict"') == 1
        assert 'id="answer"' not in page
    assert cablefem("run", "level", *QUICK, "--no-bars")[0] == 0  # writes over one half of the check
    assert store.commands_on_latest_scene(folder) == ["modes", "run"]
    assert not (folder / "agreement.json").exists()
    assert 'id="check-verdict"' not in (folder / "report.html").read_text()


def test_an_interrupted_result_is_taken_up_again(cablefem, monkeypatch):
    def interrupted(*names, **how):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(run_study, "run", interrupted)
        code, _, err = cablefem("run", "level", *QUICK, "--no-bars", "--out", "x")
    assert code == 130
    assert fault_lines(err) == ["interrupted; files that were written are whole, and the command can be given again"]
    assert cablefem("run", "level", *QUICK, "--no-bars", "--out", "x")[0] == 0


def test_an_interrupted_grid_keeps_what_was_computed(cablefem, tmp_path, monkeypatch):
    """Hours of checks were lost."""

    def interrupted(work, items, on_result):
        for i in (2, 0):  # processes answer in any order
            on_result(i, work(items[i]))
        raise KeyboardInterrupt

    monkeypatch.setattr(many, "map_in_parallel", interrupted)
    grid = ("--model", "quasi-static", "--set", "mass.mass=60:100:5")
    code, out, err = cablefem("run", "zipline", *grid, "--out", "x")
    assert code == 130
    assert fault_lines(err) == [
        "interrupted; 2 of 5 scenes were computed and are written; the same command begins again"
    ]
    with (tmp_path / "x/grid/table.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert [row["mass.mass"] for row in rows] == ["60.0", "80.0"]
    assert all(row["outcome"] in out for row in rows)
    assert "2 of 2" in (tmp_path / "x/report.html").read_text()


@pytest.mark.parametrize(
    ("out", "said"),
    [("file", "file is a file; --out must be a folder"), ("file/x", "cannot write to file/x: Not a directory")],
)
def test_a_folder_that_cannot_be_made_is_said(cablefem, tmp_path, out, said):
    (tmp_path / "file").write_text("mine")
    code, _, err = cablefem("run", "level", *QUICK, "--no-bars", "--out", out)
    assert code == 2
    assert fault_lines(err) == [said]
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    ("owner", "name", "error", "said"),
    [
        (Path, "mkdir", PermissionError(13, "Permission denied", "x"), "cannot write to x: Permission denied"),
        (Response, "write", OSError(28, "No space left on device", "x/a.csv"), "x/a.csv: No space left on device"),
    ],
)
def test_a_disk_that_takes_no_more_is_said(cablefem, monkeypatch, owner, name, error, said):
    def fails(*given, **how):
        raise error

    monkeypatch.setattr(owner, name, fails)
    code, _, err = cablefem("run", "level", *QUICK, "--no-bars", "--out", "x")
    assert (code, fault_lines(err)) == (2, [said])


def test_a_marker_that_is_none_makes_no_folder_ours(tmp_path):
    older = '{"scene": "", "results": {"run": {"writes": ["a"]}}}'
    for text in ("", "[1]", "{}", "3", '{"scene": ""}', older):
        (tmp_path / store.MARKER).write_text(text)
        (tmp_path / "a").touch()
        assert store.commands_on_latest_scene(tmp_path) == []
        with pytest.raises(store.Refused):
            store.claim_and_clear_folder(tmp_path, "run", "x", ["a"])


@pytest.mark.parametrize(("title", "told"), [("My line", "My line"), ("", "mine")])
def test_results_are_titled_as_their_scene_wherever_they_go(tmp_path, title, told):
    scene = Scene.load("bare").model_copy(update={"name": "mine", "title": title})
    assert (
        store.scene_title(store.claim_and_clear_folder(tmp_path / "elsewhere", "check", scene, ["report.html"])) == told
    )
