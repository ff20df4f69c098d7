"""The data dictionary names every column and key that the commands write, and nothing else."""

import csv
import json
import re
from pathlib import Path

import pytest

import cablefem as cf
from cablefem import Line, Scene
from cablefem.response import PATH_COLUMNS
from tests.commands.calls import QUICK
from tests.commands.test_lines import FEW
from validation.commands.methods.files import data_dictionary_entries


def documented_keys(file):
    """Keys of a file in the dictionary, those of its tables as they stand in the file."""
    own = {e.key for e in data_dictionary_entries() if e.file == file}
    for table in ("design[]", "events[]", "limits[]"):
        if table[:-2] in own:
            own |= {f"{table}.{e.key}" for e in data_dictionary_entries() if e.file == table}
    if file == "advice.json":
        rung = {e.key for e in data_dictionary_entries() if e.file == "rung"}
        own |= rung | {f"{of}.{key}" for of in ("full", "candidates[]", "rungs[]") for key in rung}
    return own


def dotted_keys(content, before=""):
    if isinstance(content, dict):
        for key, value in content.items():
            yield f"{before}{key}"
            yield from dotted_keys(value, f"{before}{key}.")
    elif isinstance(content, list):
        for item in content:
            yield from dotted_keys(item, f"{before.removesuffix('.')}[].")


def undocumented_keys(file):
    """Columns or keys of a file that the dictionary does not have."""
    if file.suffix == ".csv":
        with file.open() as rows:
            written = {name.partition(":")[0] for name in next(csv.reader(rows))}
    else:
        written = set(dotted_keys(json.loads(file.read_text())))
    patterns = [
        re.escape(key).replace(r"\*", "[^.]*" if file.suffix == ".json" else ".*") for key in documented_keys(file.name)
    ]
    return sorted(name for name in written if not any(re.fullmatch(pattern, name) for pattern in patterns))


FEW_POSITIONS = {"car.up.at": [50.0, 700.0], "car.down.at": [488.0, 1138.0]}
BEGIN = Scene.load("zipline").replace({"drive.end": {"place": 60.0}}).to_toml()
WRITTEN = ("path.csv", "tension.csv", "profile.csv", "summary.json")


@pytest.fixture
def result_files(cablefem, without_animation):
    """Files of a run of a car that rolls, of a line, of a grid and of a curve; of one answer: test_find.py."""
    Path("begin.toml").write_text(BEGIN)
    assert cablefem("run", "begin.toml", *QUICK, "--out", "run")[0] == 0
    assert cablefem("check", "two-span", *FEW, "--out", "line")[0] == 0
    cablefem("run", "begin.toml", "--model", "quasi-static", "--set", "mass.mass=60,80", "--out", "grid")
    given = ("begin.toml", "cable.horizontal_tension=12e3:30e3", "--so-that", "tension_max <= 25 kN", "--no-check")
    assert cablefem("find", *given, "--for", "mass.mass=80,90", "--out", "curve")[0] == 0
    return [file for file in Path().rglob("*.*") if file.name in {e.file for e in data_dictionary_entries()}]


def test_every_column_and_key_has_an_entry(result_files):
    assert {file.name for file in result_files} >= {
        *WRITTEN,
        "positions.csv",
        "agreement.json",
        "table.csv",
        "find.json",
        "find.csv",
    }
    assert {str(file): undocumented_keys(file) for file in result_files} == {str(file): [] for file in result_files}


def test_every_design_number_of_a_line_at_rest_has_an_entry():
    documented = documented_keys("quantity")
    sprung = Line.load("two-span").replace(
        {"contact.mountain.kind": "spring", "contact.mountain.stiffness": [1e7, 1e7]}
    )
    written = {row["quantity"].partition(":")[0] for row in cf.run(sprung.replace(FEW_POSITIONS)).design}
    assert "shift_max" in written
    assert written - documented == set()


def test_a_new_key_is_seen(tmp_path):
    (tmp_path / "summary.json").write_text('{"scene": "a", "sway": 1.0, "design": [{"value": 1.0, "mean": 2.0}]}')
    assert undocumented_keys(tmp_path / "summary.json") == ["design[].mean", "sway"]
    (tmp_path / "path.csv").write_text("t,s_o,pitch\n")
    assert undocumented_keys(tmp_path / "path.csv") == ["pitch"]


def test_a_verdict_s_keys_have_an_entry(tmp_path, level_check):
    level_check.write(tmp_path)
    assert undocumented_keys(tmp_path / "agreement.json") == []


def test_an_advice_s_keys_have_an_entry(cablefem, tmp_path):
    Path("begin.toml").write_text(BEGIN)
    assert cablefem("advise", "begin.toml", "--tol", "0.1", "--out", "advice")[0] == 0
    assert undocumented_keys(tmp_path / "advice" / "advice.json") == []


def test_the_dictionary_has_units_and_no_column_that_is_not_written(cablefem):
    code, out, _ = cablefem("methods", "--files")
    assert code == 0
    for name in PATH_COLUMNS:
        assert re.search(rf"^path\.csv +{name} +(s|m|N|m/s) ", out, re.MULTILINE)
    assert {e.key for e in data_dictionary_entries() if e.file == "path.csv"} == set(PATH_COLUMNS)
    assert all(e.unit and e.meaning for e in data_dictionary_entries())
