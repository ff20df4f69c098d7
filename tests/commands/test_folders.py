"""Where results go, and what is refused."""

from functools import cache
from pathlib import Path

import pytest

from cablefem import Scene
from cablefem.response import Response
from tests.commands.calls import QUICK, lines, tree
from validation.commands.modes import study
from validation.commands.run import study as run_study
from validation.core import store

_modes = cache(lambda toml, modes=study.modes: modes(Scene.from_toml(toml)))


@pytest.fixture(autouse=True)
def found_once(monkeypatch):
    """Let `modes` find the frequencies of a cable once: where they go is tested here."""
    monkeypatch.setattr(study, "modes", lambda scene: _modes(scene.to_toml()))


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
        patch.setattr(run_study, "run", interrupted)
        code, _, err = cablefem("run", "level", *QUICK, "--no-bars", "--out", "x")
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


@pytest.mark.parametrize(("title", "told"), [("My line", "My line"), ("", "mine")])
def test_results_are_titled_as_their_scene_wherever_they_go(tmp_path, title, told):
    scene = Scene.load("bare").model_copy(update={"name": "mine", "title": title})
    assert store.title(store.claim(tmp_path / "elsewhere", "check", scene, ["report.html"])) == told
