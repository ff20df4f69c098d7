"""What a line in motion needs: speed against accuracy of both solvers, and whether states of rest will do."""

import json

import pytest

from cablefem.scene.line import Line
from tests.commands.test_files import undocumented_keys
from tests.motion.test_quasi_static import TRAMWAY
from validation.commands.advise import page as advice_page
from validation.commands.advise.lines import advise_on_line_and_write
from validation.commands.chart import lines
from validation.commands.chart import page as chart_page
from validation.commands.chart.lines import chart_line_and_write
from validation.commands.run import motion

SLOW = TRAMWAY.replace("top_speed = 8.0", "top_speed = 0.8").replace("eration = 0.5", "eration = 0.02")
HARD = TRAMWAY.replace("eration = 0.5", "eration = 4.0")


@pytest.mark.parametrize(("toml", "enough"), [(SLOW, True), (HARD, False)])
def test_states_of_rest_do_for_slow_travel_and_not_for_hard_starts_and_stops(tmp_path, toml, enough):
    found = advise_on_line_and_write(Line.from_toml(toml), 1e-2, tmp_path)
    assert all(row["enough"] for row in found["at_rest"]) is enough
    (haul,) = (row for row in found["at_rest"] if row["need"] == "haul force")
    friction = 0.01 * 6000.0 * 9.81
    assert haul["run"] == pytest.approx(6000.0 * (0.02 if enough else 4.0) + friction, rel=0.2)
    assert {row["car"] for row in found["at_rest"]} == {"weight", "right", "car"}
    assert not undocumented_keys(tmp_path / "advice.json")
    (section,) = advice_page.sections(tmp_path)  # a car without cabin or two wheels is a point
    assert section.summary.startswith(f"States of rest are {'enough' if enough else 'not enough ('}")


def test_a_car_that_rolls_freely_has_no_timetable_for_states_of_rest(tmp_path):
    free = (
        TRAMWAY[: TRAMWAY.index("drive =")]
        + 'drive = {mode = "free", start = 600.0, rolling_friction = 0.01, end = {time = 10.0}}\n'
    )
    found = advise_on_line_and_write(Line.from_toml(free), 1e-2, tmp_path)
    assert found["at_rest"] == []
    assert "car.car.drive.mode = 'free'" in found["no_rest"]
    assert "no model here" in advice_page.sections(tmp_path)[0].summary


@pytest.fixture(scope="module")
def charted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chart")
    return chart_line_and_write(Line.from_toml(HARD), folder, ladder=((1, 1), (2, 2))), folder


def rows_by_settings(chart, name):
    """Rows of a series by multiples of the coarsest resolution and of the fewest steps."""
    rows = [row for row in chart["rows"] if row["series"] == name and row["status"] == "ok"]
    least = {key: min(row["settings"][key] for row in rows) for key in rows[0]["settings"]}
    return {tuple(value // least[key] for key, value in row["settings"].items()): row for row in rows}


def test_both_solvers_of_a_line_come_nearer_the_finer_they_are(charted):
    for name in ("elements", "sines"):
        rows = rows_by_settings(charted[0], name)
        for error in ("path_error", "tension_error"):
            assert rows[2, 2][error] < 0.5 * rows[1, 1][error]
    assert charted[0]["reference"]["witness_path"] < 1e-4


def test_a_run_that_is_the_reference_has_no_error(tmp_path):
    """No time leaves a reference that is among the charted runs: its distance from itself says nothing."""
    chart = chart_line_and_write(Line.from_toml(HARD), tmp_path, budget=1e-9, ladder=((2, 2),))
    (row,) = (row for row in chart["rows"] if row["series"] == "elements")
    assert row["settings"] == chart["reference"]["settings"]
    assert (row["status"], row["path_error"]) == ("failed", None)
    assert "it is the reference" in row["reason"]


def test_a_chart_of_a_line_ends_within_its_budget_and_names_the_runs_that_it_left_out(tmp_path, monkeypatch):
    """By a clock that a step moves on: no line of the chart may begin what does not end in time."""
    now = [0.0]

    integrate_blocks = motion.integrate_blocks

    def slow_steps(*args, **options):
        for states in integrate_blocks(*args, **options):
            now[0] += len(states)
            yield states

    monkeypatch.setattr(motion, "perf_counter", lambda: now[0])
    monkeypatch.setattr(lines, "perf_counter", lambda: now[0])
    monkeypatch.setattr(motion, "integrate_blocks", slow_steps)
    line = Line.from_toml(HARD)
    lines.chart_line_and_write(line, tmp_path, budget=1e-9)
    of_reference = now[0]
    budget = 1.2 * of_reference
    chart = lines.chart_line_and_write(line, tmp_path, budget=budget)
    one_run = 0.25 * of_reference  # it takes 7 of them: 2 x 2, 1 and 1, and is cut between steps only
    assert budget - one_run < now[0] - of_reference < budget + one_run
    left_out = [row for row in chart["rows"] if row["status"] == "not run"]
    assert all("its share of the time" in row["reason"] for row in left_out)
    page = chart_page.sections(tmp_path)[0].summary
    assert f"{len(left_out)} of {len(chart['rows'])} runs did not fit" in page


def test_a_scheme_of_first_order_halves_its_error_with_half_the_steps(charted):
    rows = rows_by_settings(charted[0], "scheme newmark")
    assert rows[2, 2]["path_error"] == pytest.approx(0.5 * rows[1, 1]["path_error"], rel=0.3)
    assert rows_by_settings(charted[0], "elements")[2, 2]["path_error"] < rows[2, 2]["path_error"]


def test_states_of_rest_are_a_model_on_the_chart_of_a_line(charted):
    (row,) = (row for row in charted[0]["rows"] if row["kind"] == "model")
    full = rows_by_settings(charted[0], "elements")[1, 1]
    assert full["path_error"] < 0.1 * row["path_error"]


def test_the_page_of_a_line_s_chart_says_whose_errors_they_are(charted, tmp_path):
    rows = [row for row in charted[0]["rows"] if row["kind"] == "method"]  # each kind is a figure
    (tmp_path / "chart.json").write_text(json.dumps(charted[0] | {"rows": rows}))
    page = "".join(section.html for section in chart_page.sections(tmp_path))
    assert "Both solvers of lines: error of the cars&#39; paths / deflection" in page
