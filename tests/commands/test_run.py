"""One method on one scene."""

import csv
import dataclasses
import json
import math
import re
from pathlib import Path

import pytest

from cablefem import Scene, quasi_static
from cablefem.response import Response
from tests.commands.calls import BROKEN, QUICK, fault_lines
from validation.commands.run import study
from validation.core.flags import make_flag
from validation.core.quantities import design_row_texts
from validation.core.readback.texts import rows_of_each_table, shows_value
from validation.core.refine import TooCoarse, run_with_error_bars
from validation.core.running import run
from validation.page.answer import many

pytestmark = pytest.mark.usefixtures("without_animation")


def test_run_writes_its_files_and_says_what_came_out(cablefem, tmp_path):
    code, out, err = cablefem("run", "level", *QUICK)
    assert (code, err) == (0, "")
    folder = tmp_path / "cablefem-out" / "level" / "following-p2"
    assert {path.name for path in folder.iterdir()} == {
        "path.csv", "tension.csv", "profile.csv", "summary.json", "response.npz",
    }  # fmt: skip
    assert "Answer" in (folder.parent / "report.html").read_text()
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["settings"]["elements"] == 4
    assert 0.0 < summary["path_error"] < 0.5
    assert all(row["bar"] > 0.0 for row in summary["design"] if row["quantity"] == "tension_max")
    assert "by following-p2 (elements=4, steps=100)" in out
    assert out.startswith("level: crosses the cable in 14.3 s")
    assert len(out.splitlines()) <= 20
    numbers = {row["quantity"]: design_row_texts(row)["value"] for row in summary["design"]}
    assert re.search(rf"largest deflection of the car +{re.escape(numbers['mass_deflection_max'])}", out)
    assert " ± " in numbers["mass_deflection_max"]
    assert re.search(rf"largest tension +{re.escape(numbers['tension_max'])}", out)
    assert f"written to {Path('cablefem-out') / 'level'}: report.html" in out


def test_run_without_bars_makes_one_run(cablefem):
    assert cablefem("run", "inclined", *QUICK, "--no-bars", "--out", "x")[0] == 0
    summary = json.loads(Path("x/following-p2/summary.json").read_text())
    assert summary["path_error"] is None
    bars = {row["quantity"]: row["bar"] for row in summary["design"]}
    assert bars.pop("speed_max") == 0.0  # of the timetable
    assert set(bars.values()) == {None}


def test_run_takes_model_load_and_law(cablefem):
    code, out, _ = cablefem(
        "run", "inclined", *QUICK, "--model", "stretching", "--load", "force", "--law", "elastic", "--out", "x"
    )
    assert code == 0
    assert "elements=4, steps=100, stretching, force, elastic" in out
    summary = Response.read(Path("x/following-p2")).summary()
    assert (summary["model"], summary["load"], summary["law"]) == ("stretching", "force", "elastic")


def test_run_with_tol_chooses_the_resolution_and_makes_an_estimate(cablefem):
    code, out, _ = cablefem("run", "inclined", "--tol", "0.1", "--out", "x")
    assert code == 0
    summary = json.loads(Path("x/following-p2/summary.json").read_text())
    assert 0.0 < summary["path_error"] <= 0.1
    assert " ± " in out


def test_a_tolerance_holds_for_the_haul_force_too():
    """It was 43 +- 101 kN from runs of which the coarsest broke: only the path was asked."""
    design = {row["quantity"]: row for row in study.run_with_bars(Scene.load("tramway"), tol=1e-2).design}
    least, most = design["haul_force_min"], design["haul_force_max"]
    assert least["value"] == pytest.approx(24.52e3, rel=1e-3)
    assert least["bar"] < 1e-2 * least["value"]
    assert abs(most["value"] - 41.4e3) < most["bar"] < 0.1 * 8100.0 * 9.81


def test_a_tolerance_out_of_reach_is_1_and_said(cablefem, monkeypatch):
    def too_coarse(scene, method, tol, **how):
        coarse = run_with_error_bars(scene, method, elements=4, steps=60)
        raise TooCoarse(coarse, 1.0, tol)

    monkeypatch.setattr(study, "refine_to_tolerance", too_coarse)
    code, _, err = cablefem("run", "inclined", "--method", "following-p2", "--tol", "1e-6", "--out", "x")
    assert code == 1
    (said,) = fault_lines(err)
    assert said.startswith("following-p2 reaches an error bar of 1 with elements = 4, steps = 60, not the 1e-06 asked")
    assert Path("x/following-p2/path.csv").exists()


@pytest.mark.slow  # 51 scenes
def test_many_scenes_are_announced_before_they_start(cablefem):
    code, out, _ = cablefem("run", "zipline", "--model", "quasi-static", "--set", "mass.mass=60:80:51")
    assert code == 0
    assert out.startswith("51 scenes\n")
    assert not cablefem("run", "zipline", "--model", "quasi-static", "--set", "mass.mass=60,80")[1].startswith("2 sc")


@pytest.mark.parametrize("command", ["run", "check"])
def test_a_key_without_its_dot_is_shown_the_key(cablefem, command):
    code, _, err = cablefem(command, "zipline", "--set", "mass=60")
    assert code == 2
    assert fault_lines(err) == ["--set mass: keys of the scene have a dot; the scene has mass.mass"]


def test_the_ground_is_set_by_points_or_by_a_csv(cablefem, tmp_path):
    Path("g.csv").write_text("0,30\n400,60\n", encoding="ascii")
    arguments = ("run", "zipline", "--model", "quasi-static", "--set")
    said = [cablefem(*arguments, f"ground={ground}") for ground in ("[[0,30],[400,60]]", "g.csv", "nosuch.csv")]
    assert [code for code, *_ in said] == [0, 0, 2]
    assert said[0][1] == said[1][1]
    assert "ground" in said[0][1]
    assert "must be a readable CSV file" in said[2][2]


@pytest.fixture(scope="module")
def inclined_run():
    return run(Scene.load("inclined"), "following-p2", elements=4, steps=100)


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({}, 0),
        ({**BROKEN, "slack_onset": None, "cause": "Newton stalled"}, 2),
        ({**BROKEN, "slack_onset": None, "cause": "past the window"}, 0),
        ({**BROKEN, "slack_onset": 0.2, "cause": "unstable"}, 2),  # its slack is the instability's own
        ({"flags": [make_flag("energy", gain=0.4, allowed=0.2)]}, 1),
    ],
)
def test_the_exit_code_of_a_run_says_whether_it_broke_before_the_slack_onset(
    cablefem, monkeypatch, inclined_run, changes, code
):
    early = "status" in changes and changes["cause"] != "past the window"
    ended = run(Scene.load("inclined"), "following-p2", elements=4, steps=100, until=0.5) if early else inclined_run
    response = dataclasses.replace(ended, **changes)
    monkeypatch.setattr(study, "run", lambda *names, **how: response)
    found, out, err = cablefem("run", "inclined", *QUICK, "--no-bars", "--out", "x")
    assert found == code
    assert Path("x/following-p2/path.csv").exists()  # what was computed is kept
    assert ("following-p2 broke with the car at" in err) == (code == 2)
    if changes:
        reasons = ("stalled", "gains energy", "slack", "past what is compared")
        assert any(reason in out + err for reason in reasons)


def test_a_run_that_really_breaks_is_2(cablefem):
    code, _, err = cablefem("run", "level", "--method", "fourier", "--set", "scheme=central-difference",
                            "--set", "terms=20", "--set", "steps=50")  # fmt: skip
    assert code == 2
    assert "fourier broke with the car at" in err


def test_what_happens_on_a_ride_has_bars(cablefem):
    assert cablefem("run", "rollback", *QUICK, "--out", "x")[0] == 0
    events = json.loads(Path("x/following-p2/summary.json").read_text())["events"]
    assert {x["event"] for x in events} >= {"turn", "stop"}
    assert all(0.0 <= x[f"bar_{name}"] < math.inf for x in events for name in ("t", "s_o", "speed"))
    assert all(x["bar_t"] > 0.0 for x in events)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--method", "fixed-hermite"], "a car that rolls (drive free) needs mass-following elements"),
        (["--model", "string"], "model string has no balance along the cable"),
        (["--load", "force"], "a moving force without mass has no balance along the cable"),
        (["--method", "fourier-kink", "--model", "sagged"], "rolls"),
        (["--method", "fourier"], "a car that rolls needs sines with a hat that travels with it"),
    ],
)
def test_what_a_method_cannot_do_is_a_line_and_nothing_is_written(cablefem, options, said):
    code, _, err = cablefem("run", "zipline", *options)
    assert code == 2
    (line,) = fault_lines(err)
    assert said in line
    assert not Path("cablefem-out").exists()


GRID = ("--set", "mass.mass=60,120", "--set", "drive.wind=-5:0:2")


def test_a_grid_of_scenes_is_a_table_and_a_page(cablefem):
    code, out, err = cablefem("run", "zipline", "--model", "quasi-static", *GRID, "--out", "x")
    assert (code, err) == (0, "")
    rows = list(csv.DictReader(Path("x/grid/table.csv").read_text().splitlines()))
    assert [(row["mass.mass"], row["drive.wind"]) for row in rows] == [
        ("60", "-5.0"), ("60", "0.0"), ("120", "-5.0"), ("120", "0.0"),
    ]  # fmt: skip
    lighter, heavier = (float(rows[i]["brake_or_arrival_km_h"]) for i in (1, 3))
    assert heavier > lighter
    assert float(rows[3]["tension_max"]) > float(rows[1]["tension_max"])
    assert all(row["outcome"] in out for row in rows)
    page = Path("x/report.html").read_text()
    assert "mass 60, wind -5" in page
    assert "1 of 4 got stuck, 2 of 4 stopped in the brake, 1 of 4 arrived." in page


def test_outcome_and_table_round_a_position_alike(cablefem):
    masses = ("--set", "mass.mass=58:64:7")
    code, out, _ = cablefem("run", "zipline", "--model", "quasi-static", *masses, "--out", "x")
    assert code == 0
    stopped = re.findall(r"stops in the brake at ([\d.]+) m, .* after [\d.]+ s +[\d.]+ +([\d.]+)", out)
    assert len(stopped) > 3
    for outcome, table in stopped:
        assert table == outcome
    page = Path("x/report.html").read_text()
    assert all(page.count(table) >= 2 for _, table in stopped)  # outcome and table


def test_printed_forces_say_over_what_time_they_are_means(cablefem):
    code, out, _ = cablefem("run", "zipline", "--model", "quasi-static", "--out", "x")
    assert code == 0
    seconds = 2.0 * Scene.load("zipline").length * math.sqrt(0.589 / 6.62e6)
    for text in (out, Path("x/report.html").read_text()):
        said = re.findall(r"means over an axial round trip, ([\d.]+)\ss", text)
        assert [float(x) for x in said] == [pytest.approx(seconds, rel=0.05)]


def test_one_value_overrides_the_scene(cablefem):
    assert cablefem("run", "zipline", "--model", "quasi-static", "--set", "mass.mass=50", "--out", "x")[0] == 0
    summary = json.loads(Path("x/quasi-static/summary.json").read_text())
    assert summary["outcome"].startswith("stops in the brake at 388.0 m")
    assert summary["outcome_kind"] == "stopped_by_brake"


@pytest.mark.parametrize("pair", ["mass.mass=-5", "mass.weight=3", "drive.wind=x", "mass.mass=1:2", "elements=3"])
def test_a_wrong_value_is_a_line(cablefem, pair):
    code, _, err = cablefem("run", "zipline", "--model", "quasi-static", "--set", pair)
    assert code == 2
    assert "--set" in fault_lines(err)[0]
    assert not Path("cablefem-out").exists()


# --- grids ------------------------------------------------------------------------------------------------------------
def test_a_grid_says_the_units_of_what_varies_and_its_values_as_given(cablefem):
    code, out, _ = cablefem("run", "zipline", "--model", "quasi-static", "--set", "cable.EA=12000000,12000001")
    assert code == 0
    head, first, second = (re.split("  +", row.strip()) for row in out.splitlines()[:3])
    assert (head[0], first[0], second[0]) == ("cable.EA [N]", "12000000", "12000001")


def worst_of(design, kind):
    """The number of a kind for which a designer looks: of several obstacles the smallest clearance."""
    values = [row["value"] for row in design if row["quantity"].partition(":")[0] == kind and row["value"] is not None]
    return min(values) if "clearance" in kind else values[0]


KINDS = {
    "clearance, rope": "clearance_rope_min", "clearance, car": "clearance_car_min",
    "largest tension": "tension_max", "least safety factor": "safety_factor_min",
    "largest haul force": "haul_force_max",
}  # fmt: skip


@pytest.mark.parametrize("name", ["zipline", "tramway"])
def test_a_grid_says_of_each_scene_what_its_run_alone_says(cablefem, name):
    trees = [{"name": "near", "at": 100.0, "top": 60.0}, {"name": "far", "at": 200.0, "top": 75.0}]
    scene = Scene.load(name).replace({"obstacle": trees, "cable.breaking_load": 1.5e6, "mass.below": 1.5})
    Path("mine.toml").write_text(scene.to_toml())
    code, out, _ = cablefem("run", "mine.toml", "--model", "quasi-static", "--set", "mass.mass=80,120", "--out", "x")
    assert code == 0
    table, *_ = rows_of_each_table(Path("x/report.html").read_text())
    printed = [re.split("  +", row.strip()) for row in out.splitlines()[:3]]
    stored = list(csv.DictReader(Path("x/grid/table.csv").read_text().splitlines()))
    for i, mass in enumerate((80.0, 120.0)):
        r = quasi_static(scene.replace({"mass.mass": mass}))
        for shown in (table, printed):
            cells = dict(zip(shown[0], shown[1 + i], strict=True))
            for head, text in cells.items():
                words, _, unit = head.rstrip("]").partition(" [")
                if words in KINDS:
                    value = worst_of(r.design, KINDS[words])
                    assert shows_value(f"{text} {unit}".strip(), value, unit.removeprefix("k"), digits=4)
                    assert float(stored[i][KINDS[words]]) == pytest.approx(value)
            assert len(cells.keys() & {"clearance, rope [m]", "clearance, car [m]", "least safety factor"}) == 3
            if r.drive == "free":
                arrival = next(event for event in r.events if event["event"] in ("brake", "arrival"))
                assert shows_value(f"{cells['at the brake or end [km/h]']} km/h", arrival["speed"], "m/s", digits=4)
                assert shows_value(cells["farthest point [m]"] + " m", r.s_o.max(), "m", digits=4)


def test_a_value_in_another_unit_is_remarked_in_set_too(cablefem):
    code, out, _ = cablefem("run", "zipline", "--model", "quasi-static", "--set", "cable.diameter=20,0.02")
    assert code == 0
    assert out.count("cable.diameter = 20 m is that of no rope; were mm meant? (0.02 m)") == 1


@pytest.mark.parametrize(
    ("value", "text"), [(-1.1e-13, "0"), (17.8, "17.80"), (1234.5, "1234"), (None, "-"), (-0.0012, "-0.001200")]
)
def test_a_cell_has_four_digits_and_no_rounding(value, text):
    assert many.Column("rise [m]").cell_text(value) == text


@pytest.fixture
def drawn_figures(monkeypatch):
    """Panels, range and texts of each figure of a grid's page, in order."""
    figures = []
    draw = many.plot.svg_figure

    def draw_and_keep(*figure, **options):
        figures.append(figure)
        return draw(*figure, **options)

    monkeypatch.setattr(many.plot, "svg_figure", draw_and_keep)
    return figures


def test_the_side_view_of_a_grid_shows_the_ropes_of_its_scenes(cablefem, drawn_figures):
    spans = "supports.span=390,400"
    assert cablefem("run", "zipline", "--model", "quasi-static", "--set", spans, "--set", "mass.mass=60,80")[0] == 0
    (panel,), x_range, *_ = drawn_figures[0]
    assert x_range == (0.0, 400.0)
    ends = [curve.x[-1] for curve in panel.curves if curve.name == "empty rope at rest"]
    assert ends == pytest.approx([390.0, 400.0])


def test_the_side_view_of_a_grid_shows_the_grounds_of_its_scenes(cablefem, drawn_figures):
    """It drew that of the first scene alone."""
    for depth in (40, 60):
        Path(f"{depth}.csv").write_text(f"0, {depth}\n300, {depth + 20}\n")
    assert cablefem("run", "zipline", "--model", "quasi-static", "--set", "ground=40.csv,60.csv")[0] == 0
    (panel,), *_ = drawn_figures[0]
    grounds = [curve.y.tolist() for curve in panel.curves if curve.name == "ground"]
    assert grounds == [[40.0, 60.0], [60.0, 80.0]]
