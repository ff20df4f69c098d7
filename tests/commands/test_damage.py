"""Files of results without a column or a key: a fault that names both, whoever reads them."""

import csv
import json
import shutil
from functools import partial
from pathlib import Path

import pytest

from cablefem.scene.line import Line
from tests.commands.calls import QUICK
from tests.motion.test_check import EVERYTHING
from validation import cli
from validation.commands.run.line import answer_line
from validation.commands.run.motion import ELEMENTS, LineRuns, motion_answers
from validation.core import line_laws, readback
from validation.core.stored_files import DamagedFileError, read_csv_columns, read_csv_rows, read_json
from validation.page import line, motion


def texts_without_each_field(file):
    """The text of a CSV without each column, of a JSON file without each key, of lists in the first entry alone."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".csv":
        rows = list(csv.reader(text.splitlines()))
        for k, name in enumerate(rows[0]):
            yield name, "\n".join(",".join(row[:k] + row[k + 1 :]) for row in rows) + "\n"
        return
    content = json.loads(text)
    for entries, key in list(_keys_below(content)):
        value = entries.pop(key)
        yield key, json.dumps(content)
        entries[key] = value


def _keys_below(content):
    if isinstance(content, dict):
        for key, value in content.items():
            yield content, key
            yield from _keys_below(value)
    elif isinstance(content, list) and content:
        yield from _keys_below(content[0])


def faults_of_damaged_files(folder, readers, damaged="*"):
    """What readers say, by file and field that is gone."""
    said = {}
    for file in sorted(folder.rglob(damaged)):
        if file.suffix not in (".csv", ".json") or file.name.startswith("."):
            continue
        whole = file.read_text(encoding="utf-8")
        for name, text in texts_without_each_field(file):
            file.write_text(text, encoding="utf-8")
            for reader in readers:
                try:
                    faults = [str(fault) for fault in reader()]
                except DamagedFileError as damage:
                    faults = damage.faults
                said.setdefault((file.name, name), []).extend(faults)
        file.write_text(whole, encoding="utf-8")
    return said


def assert_columns_are_missed(said):
    unseen = []
    for (file, name), faults in said.items():
        parts = (file, *name.split(":"))
        if file.endswith(".csv") and not any(all(part in fault for part in parts) for fault in faults):
            unseen.append((file, name, faults))
    assert unseen == []


def test_files_of_a_line_at_rest(tmp_path):
    few = {"car.up.at": [50.0, 500.0], "car.down.at": [488.0, 1142.0]}
    result = answer_line(Line.load("two-span").replace(few))
    result.write(tmp_path, 0.0)
    html = "".join(f"{section.summary}{section.html}" for section in line.rest_sections(tmp_path))

    def laws():
        rows = line_laws.printed_number_rows(result.line.to_toml(), result.rest, tmp_path, html, line.WORDS)
        return [f"{row.law}: {row.where}" for row in rows if row.gap > 1.0]

    def pages():
        line.rest_sections(tmp_path)
        return ()

    assert_columns_are_missed(faults_of_damaged_files(tmp_path, [laws, pages]))


def test_files_of_a_line_in_motion(tmp_path):
    given = Line.from_toml(EVERYTHING)
    result = motion_answers(given, LineRuns(ELEMENTS, given).ladder(1, 1), None)
    result.write(tmp_path, 0.0)
    html = "".join(f"{section.summary}{section.html}" for section in motion.motion_sections(tmp_path))
    readers = [
        partial(result.output_faults, tmp_path, html),
        partial(readback.line_terminal_faults, [], html, tmp_path),
        lambda: motion.motion_sections(tmp_path) and (),
    ]
    assert_columns_are_missed(faults_of_damaged_files(tmp_path, readers))


def test_files_of_one_span(tmp_path):
    assert cli.main(["run", "level", *QUICK, "--out", str(tmp_path)]) == 0
    (whole,) = [file.parent for file in tmp_path.glob("*/summary.json")]

    def read(folder):
        yield from readback.faults_of_stored_results(readback.StoredResults(folder, [whole.name], judged=False))

    for damaged in ("path.csv", "tension.csv", "profile.csv", "summary.json"):  # without others, which take their time
        alone = tmp_path / Path(damaged).stem
        (alone / whole.name).mkdir(parents=True)
        for name in {damaged, "summary.json", "response.npz"}:
            shutil.copy(whole / name, alone / whole.name)
        assert list(read(alone)) == []
        assert_columns_are_missed(faults_of_damaged_files(alone, [partial(read, alone)], damaged))


@pytest.mark.parametrize("content", [b"x,y\n", b"", b"x,y\n1.0,\xff\n"])
@pytest.mark.parametrize("read", [read_csv_columns, read_csv_rows, read_json])
def test_a_file_that_ends_too_early_or_is_no_text_is_named(tmp_path, read, content):
    file = tmp_path / "file"
    file.write_bytes(content)
    if read is read_csv_rows and b"1.0" not in content:
        assert read(file) == []  # of no position
        return
    with pytest.raises(DamagedFileError, match="file: "):
        read(file)


@pytest.mark.parametrize("row", ["1", "1,2,3"])
def test_a_row_of_another_length_is_named(tmp_path, row):
    file = tmp_path / "positions.csv"
    file.write_text(f"a,b\n1,2\n{row}\n")
    with pytest.raises(DamagedFileError, match=r"positions.csv: row 3: not as many cells"):
        read_csv_rows(file)


def test_a_cell_that_is_no_number_is_named_with_its_row(tmp_path):
    file = tmp_path / "profile.csv"
    file.write_text("x,y\n1.0,2.0\n3.0,much\n")
    with pytest.raises(DamagedFileError, match=r"profile.csv: row 3: .*'much'"):
        read_csv_columns(file)
