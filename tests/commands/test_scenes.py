"""Built-in scenes, to read and to copy; the table of methods."""

import json
import tomllib

from cablefem import Scene
from cablefem.scene.line import Line


def test_scenes_are_listed_one_line_each(cablefem):
    code, out, _ = cablefem("scenes")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()[1:]] == [*Scene.library(), *Line.library()]
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


def test_notes_on_a_line_are_no_part_of_its_toml(cablefem, tmp_path):
    hot = {"cable.expansion": 1.2e-5, "cable.reference_temperature": 293.15, "cable.temperature": 293.15}
    (tmp_path / "hot.toml").write_text(Line.load("two-span").replace(hot).to_toml())
    code, out, err = cablefem("scenes", "hot.toml")
    assert code == 0
    assert "293.15" in err
    assert tomllib.loads(out)["cable"]["temperature"] == 293.15


def test_scenes_are_written_to_a_folder_when_asked(cablefem, tmp_path):
    assert cablefem("scenes", "--out", "all")[0] == 0
    assert {path.stem for path in (tmp_path / "all").glob("*.toml")} == {*Scene.library(), *Line.library()}
    assert cablefem("scenes", "level", "--out", "one")[0] == 0
    assert (tmp_path / "one" / "level.toml").read_text() == Scene.library_text("level")


def test_methods_are_told_with_settings_meanings_and_defaults(cablefem, tmp_path):
    from validation.core.methods import METHODS

    code, out, _ = cablefem("methods")
    assert code == 0
    for name, method in METHODS.items():
        part = out.partition(f"{name}: {method.title}\n")[2]
        assert part.startswith(f"    use: {method.use}\n")
    assert "terms=30  sines (1 to 2000)" in out
    assert "scheme=trapezoidal  time integration (trapezoidal|newmark|" in out
    assert cablefem("methods", "--out", "table")[0] == 0
    table = json.loads((tmp_path / "table" / "methods.json").read_text())
    assert table["fourier"]["settings"]["terms"]["default"] == 30
    assert set(table) == set(METHODS)
