"""The page of a line in motion: its side view moves, and what it draws is read back."""

import dataclasses
import json
import re

import numpy as np
import pytest

from cablefem.scene.line import Line
from tests.motion.test_check import EVERYTHING
from tests.report.figures import drawn_panels
from validation.commands.run.motion import ELEMENTS, LineRuns, motion_answers
from validation.core.readback import rope_csv_and_side_view_faults
from validation.core.scene_data import conversion_factor_or_nan
from validation.page.motion import motion_sections


@pytest.fixture(scope="module")
def answers_folder_and_page(tmp_path_factory):
    """A coarse answer, its folder and its page."""
    line = Line.from_toml(EVERYTHING)
    result = motion_answers(line, LineRuns(ELEMENTS, line).ladder(1, 1), None)
    folder = tmp_path_factory.mktemp("line") / "motion-run"
    folder.mkdir()
    result.write(folder, 0.0)
    return result, folder, "".join(section.html for section in motion_sections(folder))


def test_the_side_view_has_all_cars_and_weights_in_motion(answers_folder_and_page):
    result, _, html = answers_folder_and_page
    view = json.loads(re.search(r'<script type="application/json">(.*?)</script>', html)[1])
    cable = view["cables"][0]
    assert [x["name"] for x in cable["touching"] if x["readout"]] == ["up", "down"]
    for car, drawn in zip(result.cars, cable["touching"], strict=False):
        assert drawn["x"]["high"] - drawn["x"]["low"] == pytest.approx(np.ptp(car.point[:, 0]), rel=0.01)
    assert [contact["kind"] for contact in view["contacts"]] == ["anchor", "saddle", "counterweight"]
    assert cable["weights"][0]["high"] > cable["weights"][0]["low"]
    assert [path["below"] for path in view["paths"]] == [5.0, 0.0]


def test_what_the_side_view_draws_is_what_was_computed(answers_folder_and_page):
    result, folder, html = answers_folder_and_page
    motion = result.motion
    assert not list(rope_csv_and_side_view_faults(html, folder, motion))
    up, *others = motion.cars
    for wrong, told in (
        (dataclasses.replace(motion, tension=1.001 * motion.tension), "rope.csv: T"),
        (dataclasses.replace(motion, points=motion.points + 0.1), "rope.csv: x"),
        (dataclasses.replace(motion, cars=(dataclasses.replace(up, point=up.point + 0.1), *others)), "up: x"),
    ):
        assert told in "; ".join(rope_csv_and_side_view_faults(html, folder, wrong))


def test_the_page_says_the_scene_as_it_was_read(answers_folder_and_page):
    *_, html = answers_folder_and_page
    values = dict(
        re.findall(r'data-label="key"><div>([^<]*)</div></td>\s*<td[^>]*data-label="value"><div>([^<]*)<', html)
    )
    assert (values["contact.2.tension"], values["contact.2.at"]) == ("430000 N", "(1200, -480) m")
    assert values["car.1.drive.drag_area"] == "12 m²"
    assert "[[contact]]" in html


def test_curves_over_time_are_those_of_the_motion(answers_folder_and_page):
    result, _, html = answers_folder_and_page
    motion = result.motion
    left, saddle, weight = motion.contacts
    expected = {  # by a word of the figure's title, then by curve
        "Tension": {f"at {left.name}": left.tension_ahead, f"at {weight.name}": weight.tension_behind},
        "Haul": {car.name: car.haul_force for car in motion.cars},
        "Contact": {car.name: car.contact_force for car in motion.cars},
        "Rise": {weight.name: weight.rise},
        "Rope": {saddle.name: saddle.s - saddle.s[0]},
        "Pressure": {saddle.name: np.hypot(*saddle.pressure.T)},
        "Speed": {car.name: np.hypot(*car.velocity.T) for car in motion.cars},
    }
    expected["Tension"] |= {f"behind {car.name}": car.tension_behind for car in motion.cars}
    expected["Tension"] |= {f"ahead of {car.name}": car.tension_ahead for car in motion.cars}
    for title, of_curves in expected.items():
        figure = next(part for part in html.split("<figure")[1:] if f'aria-label="{title}' in part)
        (panel,) = drawn_panels(figure)
        known = {name: values for name, values in of_curves.items() if np.isfinite(values).any()}
        assert known
        for name, values in known.items():
            t, y = panel.curves[name]
            factor = conversion_factor_or_nan(panel.unit, {"Rise": "m", "Rope": "m", "Speed": "m/s"}.get(title, "N"))
            assert np.all(np.abs(t - motion.t) < 0.2 * panel.pixel[0])
            assert np.all(np.abs(y - values / factor) < 0.2 * panel.pixel[1]), (title, name)
