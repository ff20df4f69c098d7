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

LEVEL = Scene.load("level")
EDITED = LEVEL.variant(mu=0.9, name="level").to_toml()

_modes = cache(lambda toml, modes=study.modes: modes(Scene.from_toml(toml)))


@pytest.fixture(autouse=True)
def found_once(monkeypatch):
    """Let `modes` find the frequencies of a cable once: where they go is tested here."""

    def modes(scene, out, progress):
        found = _modes(scene.to_toml())
        found.write(out)
        return found

    monkeypatch.setattr(study, "modes", modes)


def test_a_folder_with_anything_else_in_it_is_refused_and_left_alone(cablefem, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("years of work")
    code, out, err = cablefem("run", "level", *QUICK, "--out", "full")
    assert (code, out) == (2, "")
    assert lines(err) == [
        "full holds thesis.tex, which this version of cablefem did not write; "
        "nothing was written; choose another folder with --out"
    ]
    assert tree(tmp_path) == {"full/thesis.tex": b"years of work"}


def test_a_folder_is_for_one_command(cablefem, tmp_path):
    assert cablefem("modes", "level", "--out", "x")[0] == 0
    before = tree(tmp_path)
    code, _, err = cablefem("run", "level", *QUICK, "--out", "x")
    assert code == 2
    assert "x holds a result of cablefem modes" in err
    assert tree(tmp_path) == before
    assert cablefem("modes", "level", "--out", "x")[0] == 0  # rebuilt


def test_an_edited_scene_replaces_the_results_of_the_same_command(cablefem, tmp_path):
    (tmp_path / "a.toml").write_text(LEVEL.to_toml())
    assert cablefem("run", "a.toml", *QUICK)[0] == 0
    assert cablefem("run", "a.toml", "--method", "fourier", "--set", "terms=8", "--set", "steps=80")[0] == 0
    before = tree(tmp_path / "cablefem-out/level")
    (tmp_path / "a.toml").write_text(EDITED)
    assert cablefem("run", "a.toml", *QUICK)[0] == 0
    after = tree(tmp_path / "cablefem-out/level")
    assert not any(name.startswith("fourier/") for name in after)  # it was of the scene before
    assert after["following-p2/path.csv"] != before["following-p2/path.csv"]


@pytest.mark.parametrize("name", ["notes.txt", "following-p2/notes.txt"])
def test_a_file_that_a_command_did_not_write_keeps_its_folder_as_it_is(cablefem, tmp_path, name):
    (tmp_path / "a.toml").write_text(LEVEL.to_toml())
    assert cablefem("run", "a.toml", *QUICK, "--out", "x")[0] == 0
    (tmp_path / "x" / name).write_text("mine")
    before = tree(tmp_path / "x")
    (tmp_path / "a.toml").write_text(EDITED)
    code, _, err = cablefem("run", "a.toml", *QUICK, "--out", "x")
    assert code == 2
    assert f"x/{name} was not written by cablefem run; nothing was written" in err
    assert tree(tmp_path / "x") == before


def test_an_edited_scene_leaves_the_results_of_other_commands(cablefem, tmp_path):
    (tmp_path / "a.toml").write_text(LEVEL.to_toml())
    assert cablefem("modes", "a.toml")[0] == 0
    before = tree(Path("cablefem-out"))
    (tmp_path / "a.toml").write_text(EDITED)
    assert cablefem("run", "a.toml", *QUICK)[0] == 0
    after = tree(Path("cablefem-out"))
    assert after["level/modes.json"] == before["level/modes.json"]
    assert store.results(Path("cablefem-out/level")) == ["run"]  # a page shows results of one scene


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
    assert (code, lines(err)) == (2, [said])


def test_a_marker_that_is_none_makes_no_folder_ours(tmp_path):
    older = '{"scene": "", "shared": true, "results": {"run": ["a"]}}'  # of version 0.2.0
    for text in ("", "[1]", "{}", "3", '{"scene": ""}', older):
        (tmp_path / store.MARKER).write_text(text)
        assert store.results(tmp_path) == []
        with pytest.raises(store.Refused):
            store.claim(tmp_path, "run", "x", ["a"])


@pytest.mark.parametrize(("title", "told"), [("My line", "My line"), ("", "mine")])
def test_results_are_titled_as_their_scene_wherever_they_go(tmp_path, title, told):
    scene = Scene.load("bare").model_copy(update={"name": "mine", "title": title})
    assert store.title(store.claim(tmp_path / "elsewhere", "check", scene, ["report.html"])) == told
