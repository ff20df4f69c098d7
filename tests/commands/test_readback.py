"""What is printed and written is read back: all of it has a reader, and each planted fault is seen."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import pytest

from cablefem.response import Response
from tests.commands.calls import QUICK
from validation import cli
from validation.core import readback
from validation.core.quantities import design_row_texts
from validation.core.readback import tables
from validation.core.readback import terminal as printed_lines
from validation.core.stored_files import read_csv_columns
from validation.page import terminal

CHECKED = ("following-p2", "fourier-kink")
COMMANDS = {
    "a ride": ("run", "zipline", *QUICK),
    "a ride back": ("run", "rollback", *QUICK, "--no-bars"),
    "a hauled car": ("run", "tramway", *QUICK),
    "a car that grips": ("run", "level", *QUICK, "--law", "elastic"),
    "quasi-static": ("run", "zipline", "--model", "quasi-static"),
    "a car that stays": ("run", "zipline", "--model", "quasi-static", "--set", "drive.rolling_friction=0.5"),
    "a steep line": ("run", "zipline", "--model", "quasi-static", "--set", "supports.drop=1200"),
    "a crosswind": ("run", "zipline", "--model", "quasi-static", "--set", "cable.diameter=0.02", "--case", "storm"),
    "a heavy rider": ("run", "zipline", "--model", "quasi-static", "--set", "mass.mass=1e7"),
    "a check of a ride": ("check", "zipline", "--tol", "0.1", "--verbose", "--set", "drive.end.place=60"),
}


@pytest.fixture(scope="module")
def stored_result(tmp_path_factory):
    """What each command stored, printed, and drew: made once, at first use."""
    known = {}

    def result(name):
        if name not in known:
            command, scene, *options = COMMANDS[name]
            folder = tmp_path_factory.mktemp("results") / "x"
            with terminal.copy_printed_lines() as lines:
                assert cli.main([command, scene, *options, "--out", str(folder)]) == 0
            methods = CHECKED if command == "check" else [next(folder.glob("*/summary.json")).parent.name]
            of = readback.StoredResults(folder, methods, judged=command == "check")
            known[name] = command, of, lines, (folder / "report.html").read_text(encoding="utf-8")
        return known[name]

    return result


@pytest.mark.parametrize("name", COMMANDS)
def test_all_that_is_written_and_printed_has_a_reader(stored_result, name):
    command, of, lines, page = stored_result(name)
    assert [
        *readback.faults_of_stored_results(of),
        *readback.page_faults(page, command, of),
        *readback.terminal_faults(lines, of),
    ] == []
    assert of.unread == []
    for method in of.methods:
        written = {file.name for file in (of.folder / method).iterdir()}
        assert written <= readback.FILES.keys()
    path = (of.folder / of.methods[0] / "path.csv").read_text().splitlines()[0]
    assert set(path.split(",")) == readback.path_csv_columns(of.runs[0]).keys()


# --- files ------------------------------------------------------------------------------------------------------------


def enlarge_csv_column(file: Path, column: str) -> None:
    """Make a column of a CSV 1 % larger."""
    head, *lines = file.read_text().splitlines()
    i = head.split(",").index(column)
    rows = [line.split(",") for line in lines]
    for row in rows:
        row[i] = row[i] and repr(1.01 * float(row[i]))
    file.write_text("\n".join([head, *(",".join(row) for row in rows)]) + "\n")


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("tension.csv", "T"), ("tension.csv", "s"), ("profile.csv", "tension_max"), ("profile.csv", "tension_min"),
        ("profile.csv", "y_lowest"), ("profile.csv", "y_highest"), ("path.csv", "x"), ("path.csv", "speed"),
        ("path.csv", "F_contact"), ("path.csv", "T_behind"),
    ],
)  # fmt: skip
def test_a_column_one_percent_off_is_seen(stored_result, name, column):
    _, of, _, _ = stored_result("a ride")
    file = of.folder / of.methods[0] / name
    before = file.read_text()
    enlarge_csv_column(file, column)
    found = list(readback.FILES[name](file, of.runs[0]))
    file.write_text(before)
    assert found
    assert all(fault.startswith(column) for fault in found)


@pytest.mark.parametrize("of_frame", ["displacement", "tension", "velocity"])
def test_an_animation_one_percent_off_is_seen(stored_result, of_frame):
    _, of, _, _ = stored_result("a ride")
    file = of.folder / of.methods[0] / "response.xdmf"
    names = re.findall(rf'Name="{of_frame}".*?response\.h5:/(\w+)', file.read_text(), re.S)

    def scale(factor):
        with h5py.File(file.with_suffix(".h5"), "r+") as data:
            for name in names:
                data[name][...] = factor * data[name][...]

    scale(1.01)
    found = list(readback.FILES[file.name](file, of.runs[0]))
    scale(1.0 / 1.01)
    assert found


def test_a_wrong_number_of_the_summary_is_seen(stored_result):
    _, of, _, _ = stored_result("a ride")
    file = of.folder / of.methods[0] / "summary.json"
    before = file.read_text()
    for key, value in (("reached", 0.97), ("n_dof", 3), ("max_deflection", 3.0), ("news", 1)):
        file.write_text(json.dumps(json.loads(before) | {key: value}))
        assert any(key in fault for fault in readback.FILES[file.name](file, of.runs[0]))
    assert any(fault.startswith(str(file)) for fault in readback.faults_of_stored_results(of))
    file.write_text(before)


@pytest.mark.parametrize(
    "key", ["value", "bar", "other", "bar_other", "gap", "uncertainty", "order_space", "order_time", "levels_space"]
)  # fmt: skip
def test_a_verification_one_percent_off_is_seen(stored_result, key):
    _, of, _, _ = stored_result("a check of a ride")
    rows = of.agreement["verification"]
    assert len(rows) > 10
    assert {row["order_space"] is None for row in rows} == {False, True}  # reached, and not reached
    row = next(row for row in rows if row["order_space"] and row["order_time"] and row["gap"])
    before = row[key]
    row[key] = [before[0], 1.01 * before[1], *before[2:]] if isinstance(before, list) else 1.01 * before
    faults = list(readback.verification_faults(of))
    row[key] = before
    assert faults
    assert all(row["quantity"] in fault for fault in faults)


# --- page and terminal ------------------------------------------------------------------------------------------------

NUMBER = r"(-?[\d.]+)( ?± ?)([\d.]+)( ?kN)"


def enlarged_number(number: str, factor: float) -> str:
    """The number times a factor, with as many decimals."""
    return f"{factor * float(number):.{len(number.partition('.')[2])}f}"


CHANGES = {
    "value": lambda x: f"{enlarged_number(x[1], 1.01)}{x[2]}{x[3]}{x[4]}",
    "unit": lambda x: x[0].replace("kN", "MN"),
    "bar": lambda x: f"{x[1]}{x[2]}{enlarged_number(x[3], 0.2)}{x[4]}",
}


def test_a_run_in_the_folder_of_a_check_is_read_by_its_own_pages(stored_result, tmp_path):
    """It has fewer of them; the check's table of verification was read against the run, which has none."""
    _, of, _, _ = stored_result("a check of a ride")
    shutil.copytree(of.folder, tmp_path / "x")
    same_scene = COMMANDS["a check of a ride"][-2:]
    model = "--model", "quasi-static"
    assert cli.main(["run", "zipline", *model, *same_scene, "--out", str(tmp_path / "x")]) == 0


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize("name", ["a ride", "a check of a ride"])
def test_a_force_with_another_value_unit_or_bar_is_seen(stored_result, name, change):
    command, of, lines, page = stored_result(name)
    spaced = NUMBER.replace(" ?", "[ \u202f]?")
    wrong, count = re.subn(spaced, change, page, count=1)
    assert count == 1
    assert any("largest tension" in fault for fault in readback.page_faults(wrong, command, of))
    text = [re.sub(NUMBER, change, line) if "largest tension" in line else line for line in lines]
    assert len(list(readback.terminal_faults(text, of))) == 1


@pytest.mark.parametrize(
    ("there", "instead", "said"),
    [
        (r"(= )([\d.]+)", r"\g<1>1\2", "top speed"),  # km/h
        (r"arrives", "stuck", "stuck"),
        (r"(brake +after )(\d)", r"\g<1>1\2", "brake"),
        (r"at 0\.0 m", "at 7.0 m", "at 7.0 m"),
        (r"elements=4", "elements=8", "settings"),
        (r"path ± (\d)", r"path ± 1\1", "stored"),
    ],
)
def test_other_words_and_numbers_on_the_terminal_are_seen(stored_result, there, instead, said):
    _, of, lines, _ = stored_result("a ride")
    text = [re.sub(there, instead, line) for line in lines]
    assert text != lines
    assert any(said in fault for fault in readback.terminal_faults(text, of)) or any(said in x for x in of.unread)
    of.unread.clear()


@pytest.mark.parametrize(
    ("there", "instead", "said"),
    [
        (r"(</span> )agree(</span></h2>)", r"\1disagree\2", "verdict"),
        (r"(\d+)( laws hold)", r"1\1\2", "laws"),
        (r"Arrives at", "Stops at", "outcome"),
        (r'(data-label="gap"><div>)', r"\g<1>1", "no such comparison"),
        (r'(data-label="D"><div>)', r"\g<1>1", "is not what is stored"),
        (r'(data-label="order in time"><div>)\d', r"\g<1>9", "is not what is stored"),
        (r'(data-label="\|E\|"><div>)', r"\g<1>1", "is not what is stored"),
        (r'(data-label="at \[m\]"><div>)', r"\g<1>1", "no such event"),
        (r'(data-label="unknowns"><div>)', r"\g<1>1", "n_dof"),
        (r'(drag_area</div></td><td data-label="value"><div>)', r"\g<1>1", "drag_area"),
        (r'(horizontal tension at rest</div></td><td data-label="value"><div>)', r"\g<1>1", "horizontal tension"),
        (r'("text":")(\d+ km/h")', r"\g<1>1\2", "side view"),
        (r'("y":\{"low":)', r"\g<1>1", "side view: y"),
        (r'("paths":\[\{"x":\[[^\]]*\],"y":\[)', r"\g<1>1", "side view: the path"),
        (r'("obstacles":\[)', r'\1{"name":"a","x":1,"top":2}', "obstacles"),
    ],
)  # fmt: skip
def test_other_words_and_numbers_on_the_page_are_seen(stored_result, there, instead, said):
    command, of, _, page = stored_result("a check of a ride")
    wrong, count = re.subn(there, instead, page, count=1)
    assert count == 1
    assert any(said in fault for fault in readback.page_faults(wrong, command, of))


def test_a_clearance_that_is_called_the_smallest_and_is_not_is_seen():
    where = {"t": 1.0, "s_o": 2.0, "s": 3.0, "unit": "m", "bar": None}
    names = ("clearance_car_min:hut", "clearance_car_min:tree", "clearance_rope_min:tree")
    near, far, none = [{"quantity": name, "value": x, **where} for name, x in zip(names, (1.5, 2.5, None), strict=True)]
    stored = SimpleNamespace(design=[far, none, near], unread=[])
    for row, more, sound in ((near, 1, True), (far, 1, False), (near, 2, False)):
        what, value, t, mass, at = design_row_texts(row | {"more": more}).values()
        assert (not [*tables.design_number_faults([what, value, t, mass, at], stored)]) is sound
        faults = printed_lines._design_faults_or_note_unread(f"{what}  {value}, at {at} after {t}", stored)
        assert (not [*faults]) is sound


def test_a_file_that_is_written_wrongly_is_said_first_on_the_page_and_is_1(cablefem, monkeypatch):
    right = Response.write_path_and_tension_csv

    def wrong(r, folder):
        right(replace(r, fields=replace(r.fields, T=1.01 * r.fields.T)), folder)

    monkeypatch.setattr(Response, "write_path_and_tension_csv", wrong)
    code, _, err = cablefem("run", "level", *QUICK, "--no-bars", "--out", "x")
    assert code == 1
    assert "not what was computed: x/following-p2/tension.csv: T is not what was computed" in err
    page = Path("x/report.html").read_text()
    assert page.index('id="read-back"') < page.index('id="answer"')


@pytest.mark.parametrize("rows", ["1,2\n3,4,5\n6", "1,2,3\n4,5,6", "1,2\nx,4"])
def test_a_table_whose_rows_do_not_fit_its_columns_is_not_read(tmp_path, rows):
    file = tmp_path / "table.csv"
    file.write_text(f"a,b\n{rows}\n")
    with pytest.raises(ValueError, match=r"row \d: .*(cells under 2 names|convert)"):
        read_csv_columns(file)
