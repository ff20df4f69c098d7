"""Lines in motion by the quasi-static model: states of rest where the timetables have the cars."""

import json

import numpy as np
import pytest

import cablefem as cf
from cablefem.scene.line import Line
from tests.motion.lines import OVER

TRAMWAY = """
[cable]
mass_per_length = 11.4
EA = 2.1e8
breaking_load = 1.6e6
[[contact]]
name = "weight"
kind = "counterweight"
at = [0.0, 0.0]
tension = 3.8e5
[[contact]]
name = "right"
kind = "anchor"
at = [1200.0, -480.0]
[[car]]
name = "car"
mass = 6000.0
drive = {mode = "haul", drag_area = 8.0, rolling_friction = 0.01}
[car.travel]
kind = "trapezoid"
top_speed = 8.0
acceleration = 0.5
deceleration = 0.5
from = 600.0
to = 645.985263
"""


def numbers_at_last_position(answer):
    return {name: value for name, value in answer.numbers[-1].items() if not name.startswith("on:")}


def test_a_timetable_along_the_rope_ends_at_the_state_of_rest_that_the_text_on_lines_prints():
    """Shared text on lines, section 4: s = 650, the left end of the empty line at s = 4.014737."""
    found = numbers_at_last_position(cf.quasi_static(Line.from_toml(TRAMWAY.replace("from = 600.0", "from = 640.0"))))
    assert found["x:car"] == pytest.approx(640.052271, abs=1e-5)
    assert found["depth:car"] == pytest.approx(-148.607581, abs=1e-5)
    assert found["haul:car"] == pytest.approx(22261.47, abs=0.1)
    assert found["tension_ahead:car"] == pytest.approx(396588.71, abs=0.1)


def test_a_timetable_in_x_over_a_tower_and_the_page_of_what_was_run_last(cablefem, tmp_path):
    (tmp_path / "over.toml").write_text(OVER.replace("to = 170.0", "to = 135.0"))
    assert cablefem("run", "over.toml")[0] == 0
    page = tmp_path / "cablefem-out" / "over" / "report.html"
    assert "The line in motion" in page.read_text()
    code, out, err = cablefem("run", "over.toml", "--model", "quasi-static")
    assert (code, err) == (0, "")
    assert out.startswith("over: quasi-static, without inertia, friction and drag: at rest at ")
    assert "The line at rest" in page.read_text()
    summary = json.loads((page.parent / "rest" / "summary.json").read_text())
    positions = [number["at"]["car"] for number in summary["design"]]
    assert 130.0 <= min(positions) < max(positions) <= 135.0


def test_states_of_rest_pass_the_tower_and_slow_motion_is_near_them():
    line = Line.from_toml(OVER)
    answer = cf.quasi_static(line)
    shoes = [row["on:car"] for row in answer.numbers]
    assert (shoes[0], shoes[len(shoes) // 2], shoes[-1]) == (None, "tower", None)
    x = [row["x:car"] for row in answer.numbers]
    np.testing.assert_allclose([x[0], x[-1]], [130.0, 170.0])
    slow = {"top_speed": 0.5, "acceleration": 0.2, "deceleration": 0.2, "to": 133.0}
    slow_line = line.replace({f"car.car.travel.{key}": value for key, value in slow.items()})
    moved, at_rest = cf.run(slow_line), cf.quasi_static(slow_line)
    assert moved.tension_max["value"] == pytest.approx(at_rest.tension_max["value"], rel=5e-3)


def test_a_car_that_rolls_freely_has_no_timetable(cablefem):
    code, out, err = cablefem("run", "rocket-trolley", "--model", "quasi-static")
    assert (code, out) == (2, "")
    assert "car.sled.drive.mode = 'free'" in err
