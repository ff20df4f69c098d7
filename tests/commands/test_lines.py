"""`run` and `check` of lines at rest: files, verdicts, refusals, grids."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from cablefem import Line, Scene
from tests.commands.calls import fault_lines
from tests.line.lines import THREE, TRAMWAY, car, contact, line
from validation.commands.check.line import check_line
from validation.core.readback import line_terminal_faults, moving_line_outcome_faults

FEW = ("--set", "car.up.at=[50,300,698,704]", "--set", "car.down.at=[488,702,900,1142]")


def csv_rows(file):
    with file.open(newline="") as opened:
        return list(csv.DictReader(opened))


def summary_and_design_values(folder):
    summary = json.loads((folder / "summary.json").read_text())
    return summary, {d["quantity"]: d["value"] for d in summary["design"]}


def test_run_writes_its_files(cablefem, tmp_path):
    code, out, err = cablefem("run", "two-span", *FEW)
    assert (code, err) == (0, "")
    folder = tmp_path / "cablefem-out" / "two-span" / "rest"
    told = {path.name for path in folder.iterdir()}
    assert {"positions.csv", "profile.csv", "summary.json", "scene.toml"} <= told
    found = csv_rows(folder / "positions.csv")
    # a car on the shoe of the tower has no haul force and no tension
    assert [(row["position"], row["on:up"], bool(row["haul:up"])) for row in found] == [
        ("1", "", True), ("2", "", True), ("3", "tower", False), ("4", "tower", False),
    ]  # fmt: skip
    assert found[1]["on:down"] == "tower"
    profile = csv_rows(folder / "profile.csv")
    assert all(float(row["y_highest"]) <= float(row["y_lowest"]) + 1e-9 for row in profile)
    assert "largest tension" in out
    assert len(out.splitlines()) <= 20
    page = (folder.parent / "report.html").read_text()
    assert "The line at rest" in page
    assert "nan" not in page.lower().split("<svg")[0]


def test_design_numbers_of_a_line(cablefem, tmp_path):
    (tmp_path / "one.toml").write_text(line(*TRAMWAY, name="tramway").to_toml())
    assert cablefem("run", "one.toml")[0] == 0
    assert summary_and_design_values(tmp_path / "cablefem-out" / "tramway" / "rest")[1][
        "rise_max:weight"
    ] == pytest.approx(10.837, abs=1e-3)
    assert cablefem("run", "two-span")[0] == 0
    summary, design = summary_and_design_values(tmp_path / "cablefem-out" / "two-span" / "rest")
    assert summary["status"] == "complete"
    assert design["safety_factor_min"] == pytest.approx(1.6e6 / design["tension_max"], rel=1e-9)
    assert design["pressure_down_min:tower"] == pytest.approx(78.1e3, abs=50.0)
    assert design["pressure_down_max:tower"] == pytest.approx(132.7e3, abs=50.0)


def test_a_bare_line_prints_no_rise_and_no_car_on_a_shoe_that_is_not_there(cablefem, tmp_path):
    scene = Scene.library_text("two-span").partition("[[car]]")[0]
    (tmp_path / "bare.toml").write_text(scene.replace("shoe = 6.0", ""))
    code, out, _ = cablefem("run", "bare.toml")
    assert code == 0
    assert "rise of" not in out
    assert "shoe" not in out


def test_check_agrees(cablefem, tmp_path):
    code, out, _ = cablefem("check", "two-span", *FEW)
    assert code == 0
    assert out.startswith("Both solvers agree.")
    stored = json.loads((tmp_path / "cablefem-out" / "two-span" / "agreement.json").read_text())
    assert stored["verdict"] == "agree"
    told = {row["quantity"]: row for row in stored["rows"]}
    assert {"place", "rope_place", "s", "tension_behind", "tension_ahead", "pressure", "haul"} <= set(told)
    assert all(row["gap"] <= 1e-6 for row in told.values() if row["unit"] == "m")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("car.grip.mass", 4000.04),
        ("contact.first.at", [400.0, -30.0001]),
    ],
)  # fmt: skip
def test_a_fault_told_to_one_solver_disagrees(key, value):
    sound = line(*THREE)
    assert check_line(sound, 1e-6, 1e-6, second=sound.replace({key: value})).verdict.value == "disagree"


def test_a_sound_line_agrees():
    assert check_line(line(*THREE), 1e-6, 1e-6).verdict.value == "agree"


def test_both_tensions_count_where_a_car_that_grips_is_at_a_station_of_the_profile(cablefem, tmp_path):
    """The tension jumps there, and which side a station is on is rounding: once the solvers \"disagreed\" over it."""
    scene = line(
        {"mass_per_length": 3.4, "EA": 5.5e7, "tension": {"at": "left", "value": 9e4}},
        contact("left", "anchor", 0.0, 0.0),
        contact("right", "anchor", 400.0, -80.0),
        *(car(name, 600.0, at, hauled=False) for name, at in (("A", 90.0), ("B", 300.0))),
    )
    (tmp_path / "grip.toml").write_text(scene.to_toml())
    code, out, _ = cablefem("check", "grip.toml")
    assert code == 0, out
    profile = {float(row["x"]): row for row in csv_rows(next(tmp_path.rglob("profile.csv")))}
    jump = float(profile[90.0]["tension_max"]) - float(profile[90.0]["tension_min"])
    rise = float(profile[88.0]["y_lowest"]) - float(profile[92.0]["y_lowest"])
    weight_along_rope = 600.0 * 9.81 * rise / np.hypot(4.0, rise)
    assert jump == pytest.approx(weight_along_rope, rel=1e-2)


def test_a_grid_is_a_table_with_one_row_a_line(cablefem, tmp_path):
    code, _, err = cablefem(
        "run", "two-span", *FEW, "--set", "car.up.mass=5000,6000,8000", "--set", "car.down.mass=+1%"
    )
    assert (code, err) == (0, "")
    found = csv_rows(tmp_path / "cablefem-out" / "two-span" / "grid-rest-run" / "table.csv")
    haul = [float(row["haul_max:up"]) for row in found]
    assert len(haul) == 3
    assert np.all(np.diff(haul) > 0.0)


def test_a_grid_of_lines_is_checked(cablefem, tmp_path):
    code, out, _ = cablefem("check", "two-span", *FEW, "--set", "car.up.mass=5000,6000")
    assert code == 0, out
    assert "report.html" in out
    found = csv_rows(tmp_path / "cablefem-out" / "two-span" / "grid-rest-check" / "table.csv")
    assert [row["verdict"] for row in found] == ["agree", "agree"]


def test_a_position_without_rest_leaves_the_others(cablefem, tmp_path):
    rope, left, first, second, right, *_ = THREE
    heavy = car("car", 12000.0, [200.0, 920.0])
    given = line({**rope, "length": 1023.0}, left, {**first, "at": [400.0, 6.0]}, second, right, heavy, name="lifts")
    (tmp_path / "lifts.toml").write_text(given.to_toml())
    code, out, _ = cablefem("run", "lifts.toml")
    assert code == 2
    assert "the rope lifts off first" in out
    summary, _ = summary_and_design_values(tmp_path / "cablefem-out" / "lifts" / "rest")
    assert summary["status"] == "incomplete"
    assert [x["position"] for x in summary["refused"]] == [2]


@pytest.mark.parametrize(
    "command",
    [
        ("modes", "two-span"), ("advise", "two-span", "--tol", "1e-2"),
        ("run", "two-span", "--method", "fourier"),
        ("run", "two-span", "--model", "string"), ("check", "two-span", "--deep"),
        ("run", "two-span", "--set", "elements=8"), ("run", "two-span", "--no-bars"),
        ("check", "two-span", "--verbose"),
    ],
)  # fmt: skip
def test_what_moves_is_refused_in_one_line(cablefem, tmp_path, command):
    code, out, err = cablefem(*command)
    assert (code, out) == (2, "")
    assert "this needs one span with [supports]" in err
    assert len(fault_lines(err)) == 1
    assert not (tmp_path / "cablefem-out").exists()


def test_a_self_test_without_a_car_is_refused(cablefem, tmp_path):
    (tmp_path / "bare.toml").write_text(line(*[x for x in THREE if "mass" not in x]).to_toml())
    code, out, err = cablefem("check", "bare.toml", "--self-test")
    assert (code, out) == (2, "")
    assert "--self-test: plants its fault in the mass of a car" in err


def test_a_rope_of_a_line_measured_in_mm_is_remarked(cablefem):
    line = Line.load("two-span").replace({"cable.diameter": 45.0})
    Path("thick.toml").write_text(line.to_toml())
    code, out, err = cablefem("run", "thick.toml")
    assert (code, err) == (0, "")
    assert out.startswith("two-span: cable.diameter = 45 m is that of no rope; were mm meant? (0.045 m)")


@pytest.mark.parametrize("tol", ["1e-10", "0.1", "nan"])
def test_tolerance_of_a_line(cablefem, tol):
    code, _, err = cablefem("check", "two-span", "--tol", tol)
    assert code == 2
    assert "--tol in m must lie in [1e-09, 0.01]" in err


def test_check_with_a_fault_told_to_one_solver(cablefem):
    code, out, _ = cablefem("check", "two-span", *FEW, "--second-set", "cable.EA=+0.1%")
    assert code == 1
    assert out.startswith("The solvers DISAGREE")


PRINTED = {"at rest": ("rest", "two-span", *FEW), "in motion": ("motion-run", "counterweight")}


@pytest.mark.parametrize("kind", PRINTED)
def test_what_is_printed_of_a_line_is_read_back(cablefem, tmp_path, kind):
    """On the terminal: other numbers, cars, units, verdicts, counts and sentences than those of page and files."""
    home, scene, *changes = PRINTED[kind]
    code, out, err = cablefem("run", scene, *changes, "--limits", "france-1974")
    assert (code, err) == (0, "")
    folder = tmp_path / "cablefem-out" / scene
    html = (folder / "report.html").read_text(encoding="utf-8")
    printed = out.splitlines()[:-1]  # without where it is written
    means = "forces are means over an axial round trip of the rope"
    assert (out.count(means), html.count(means.capitalize())) == ((1, 1) if kind == "in motion" else (0, 0))
    assert list(line_terminal_faults(printed, html, folder / home)) == []
    number = re.compile(r"\d+\.\d\d+|\d+ more|\d+ s$|\d+ positions|\d+ elements")
    for i, text in enumerate(printed):
        wrong = number.sub(lambda x: x[0].replace(x[0][0], str((int(x[0][0]) + 1) % 10), 1), text, count=1)
        for planted in (wrong, text.replace(" kN", " N", 1), text.replace("  met", "  not met")):
            if planted != text:
                assert list(line_terminal_faults([*printed[:i], planted, *printed[i + 1 :]], html, folder / home))


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("arrives", "ends"),
        ("x = 498.2 m", "x = 489.2 m"),
        ("kN at 49.4 s", "kN at 94.4 s"),
        ("52.0 s", "25.0 s"),
    ],
)
def test_another_outcome_of_a_motion_is_seen(cablefem, tmp_path, right, wrong):
    assert cablefem("run", "counterweight")[0] == 0
    folder = tmp_path / "cablefem-out" / "counterweight" / "motion-run"
    assert list(moving_line_outcome_faults(folder)) == []
    file = folder / "summary.json"
    file.write_text(file.read_text().replace(right, wrong))
    assert len(list(moving_line_outcome_faults(folder))) == 1


def test_what_is_hit_in_motion_is_read_back_without_false_alarm(cablefem, tmp_path):
    ground = "ground = [[0.0, 20.0], [600.0, -235.0], [1200.0, -460.0]]\n"
    (tmp_path / "low.toml").write_text(ground + Scene.library_text("counterweight"))
    code, out, err = cablefem("run", "low.toml")
    assert (code, err) == (0, "")
    assert re.match("low: would collide: car hits the ground by .* m; would collide: the rope hits the ground by", out)
