"""The page of a check: the answer in words, how sure it is; never a solver."""

import base64
import io
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cablefem.response import Response
from cablefem.scene import Scene
from tests.report.figures import SCALE_TICK, drawn_panels, values_along_axis
from validation.commands.check import page as check
from validation.core.foreign import ForeignPath
from validation.core.quantities import design_row_texts, factor_and_prefixed_unit
from validation.core.scene_data import conversion_factor_or_nan
from validation.page import page
from validation.page.answer.stored import read_stored_check_if_started
from validation.page.plot import PURPLE
from validation.page.scene_keys import scene_keys_table
from validation.page.side_view import side_view_of_runs

A, B = "following-p2", "fourier-kink"


@pytest.fixture
def check_copy(stored_check: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(stored_check, tmp_path / "level"))


def change_agreement(folder: Path, **changes) -> None:
    """Change agreement.json; a function is given the old value."""
    file = folder / "agreement.json"
    content = json.loads(file.read_text())
    content |= {key: value(content[key]) if callable(value) else value for key, value in changes.items()}
    file.write_text(json.dumps(content))


def section_with_id(folder: Path, name: str) -> page.Section:
    return next(s for s in check.sections(folder) if s.id == name)


def test_a_whole_report(report_file):
    text = report_file.read_text(encoding="utf-8")
    ids = re.findall(r'<section id="([^"]+)"', text)
    assert ids == ["answer", "side-view", "ride", "tension", "scene", "how-sure", "rests"]
    assert len(text.encode()) < 1.5e6
    assert text.count('<svg role="img"') == text.count("<figcaption") >= 5
    assert text.count("&lt;scene&gt;") == 2
    assert re.findall(r"(?i)\bnan\b|\binf(?:inity)?\b|undefined", re.sub(r'"[A-Za-z0-9+/=]{200,}"', "", text)) == []


def quantity_by_title(r):
    """Values (n,) and SI unit of what a panel of the page shows of a run."""
    return {
        "depth below the left support": (r.y, "m"),
        "speed": (r.speed, "m/s"),
        "position along the rope": (r.s_o, "m"),
        "press of the car on the rope": (r.F_contact, "N"),
        "left support": (np.hypot(*r.reaction_left.T), "N"),
        "right support": (np.hypot(*r.reaction_right.T), "N"),
        "behind the car": (r.T_behind, "N"),
        "ahead of the car": (r.T_ahead, "N"),
        "smallest along the rope": (r.tension_min, "N"),
    }


def test_curves_on_the_page_are_the_stored_series_by_the_words_at_their_axes(stored_check, report_file):
    panels = [panel for panel in drawn_panels(report_file.read_text(encoding="utf-8")) if panel.title]
    runs = {r.method: r for r in read_stored_check_if_started(stored_check).runs}
    assert {panel.title for panel in panels} == set(quantity_by_title(runs[A]))
    for panel in panels:
        for method, r in runs.items():
            values, si = quantity_by_title(r)[panel.title]
            y = values / conversion_factor_or_nan(panel.unit, si)
            x = {"time [s]": r.t, "metres along the rope": r.s_o}[panel.over]
            known = np.isfinite(y)
            drawn_x, drawn_y = panel.curves[method]
            assert np.max(np.abs(drawn_x - x[known])) < 0.2 * panel.pixel[0], panel.title
            expected = y[known].clip(drawn_y.min(), drawn_y.max())
            allowed = 0.2 * panel.pixel[1] + 1e-3 * np.abs(expected)  # places of words have a tenth of a pixel
            assert np.all(np.abs(drawn_y - expected) < allowed), panel.title


def test_the_tension_field_has_its_colours_and_numbers_where_they_belong(stored_check, report_file):
    r = read_stored_check_if_started(stored_check).runs[0]
    figure = next(x for x in report_file.read_text().split("<figure") if 'aria-label="Tension over time and' in x)
    (panel,) = drawn_panels(figure)
    unit = re.search(r'text-anchor="end">([^<]*)</text>', figure)[1]
    newtons = conversion_factor_or_nan(unit, "N")
    picture = np.array(Image.open(io.BytesIO(base64.b64decode(re.search(r'base64,([^"]*)', figure)[1]))), float)
    scale = values_along_axis([(float(y) - 4.0, text) for y, text in re.findall(SCALE_TICK, figure)])
    low, high = scale(float(re.search(r'height="([\d.]+)" preserve', figure)[1])), scale(0.0)
    assert len(panel.labels) == 15
    for t, s, text in panel.labels:
        expected = np.interp(s, r.fields.s, r.fields.T[np.abs(r.fields.t - t).argmin()]) / newtons
        assert float(text) == pytest.approx(expected, abs=0.02 * (high - low))
        row = (1.0 - s / r.length) * (len(picture) - 1)
        colour = picture[round(row), round(t / r.t[-1] * (picture.shape[1] - 1))] / 255.0
        assert low + colour * (high - low) == pytest.approx(np.clip(expected, low, high), abs=0.02 * (high - low))


def test_the_outcome_comes_first(check_copy):
    said = section_with_id(check_copy, "answer")
    assert said.verdict == "agree"
    assert re.match(
        r"Crosses the cable in 14\.3 s; the cable goes slack when the mass is at 1\d{3}\.\d m", said.summary
    )
    assert re.search(
        r"11 comparisons of two solvers agree; 20 laws hold; \d+ printed numbers are as computed\.", said.summary
    )
    assert not re.search("[<>&]", said.summary)  # it is printed on terminals too


def test_every_row_is_there_with_its_numbers(check_copy):
    html = section_with_id(check_copy, "how-sure").html
    rows = json.loads((check_copy / "agreement.json").read_text())["rows"]
    for row in rows:
        if row["gap"] is not None:
            assert f"{page.number_text(100.0 * row['gap'])}\u202f%" in html
    assert f"All {len(rows)} comparisons" in html


def test_a_disagreement_is_said_first(check_copy):
    def spoil(rows):
        off = {"verdict": "disagree"}
        return [r | off | {"gap": 4.0 * r["allowed"]} if r["quantity"] == "reactions" else r for r in rows]

    change_agreement(check_copy, rows=spoil, verdict="disagree")
    assert section_with_id(check_copy, "answer").verdict == "disagree"
    assert "disagree" in section_with_id(check_copy, "answer").summary
    group = re.search(r"Forces at the car and the supports.*?</tr>", section_with_id(check_copy, "how-sure").html, re.S)
    assert "badge bad" in group[0]
    assert "reactions" in group[0]


def test_a_third_party_has_its_rows_and_its_path(check_copy):
    party = {"quantity": "path_max", "gap": 0.073, "allowed": 0.0052, "verdict": "disagree", "where": 0.31,
             "with": "other <code>", "notes": ["agrees if its times are shifted by 0.10 s"]}  # fmt: skip
    change_agreement(check_copy, rows=lambda rows: [*rows, party], verdict="disagree")
    path = ForeignPath.of(Scene.load("level"), np.linspace(0.0, 1900.0, 40), np.linspace(0.0, 2.5, 40))
    replace(path, speed=np.full(40, 140.0)).write(check_copy / "with.csv")
    x = read_stored_check_if_started(check_copy)
    assert (x.third_party.method, x.third_party.v.tolist()) == ("other <code>", path.v.tolist())
    how_sure, ride = section_with_id(check_copy, "how-sure").html, section_with_id(check_copy, "ride").html
    said = section_with_id(check_copy, "answer").summary
    assert "disagree." not in said, "our own solvers agree"
    assert said.endswith("as computed. other <code>: DISAGREES with both; agrees if its times are shifted by 0.10 s.")
    assert "path max: other &lt;code&gt;" in how_sure
    assert "other &lt;code&gt;: DISAGREES with both; agrees if its times are shifted by 0.10 s." in how_sure
    assert "distance to other &lt;code&gt;" in how_sure
    assert ride.count("other &lt;code&gt;") == 2, "in the key of both figures of the ride"
    assert ride.count(PURPLE) >= 2 + 2 + 3  # keys; depth and speed over place; and the place over time
    assert '"name":"other \\u003ccode>"' in section_with_id(check_copy, "side-view").html


def test_no_solver_is_loaded(stored_check):
    code = (
        "import sys; from pathlib import Path; from validation.commands.check import page as check\n"
        f"check.sections(Path({str(stored_check)!r}))\n"
        "solvers = 'skfem', 'galerkin', 'cablefem.elements', 'matplotlib.pyplot'\n"
        "bad = [m for m in sys.modules if m.startswith(solvers)]\n"
        "assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(("x", "unit", "told"), [(1163.0, "N", (1.0, "N")), (116312.0, "N", (1e-3, "kN")),
                                                 (0.0047, "m", (1e3, "mm")), (37.7, "m", (1.0, "m")),
                                                 (7.4e6, "J", (1e-6, "MJ")), (0.0, "J", (1.0, "J"))])  # fmt: skip
def test_units_suit_their_numbers(x, unit, told):
    assert factor_and_prefixed_unit(np.array([x]), unit) == told


@pytest.mark.parametrize(
    ("value", "bar", "shown"),
    [
        (-1705.3, 9531.0, "-1.7 ± 9.5 kN"), (1163.0, 131.0, "1160 ± 130 N"), (319468.0, 172.0, "319.47 ± 0.17 kN"),
        (591.2, 17.3, "591 ± 17 N"), (591.2, None, "591.2 N"),
    ],
)  # fmt: skip
def test_a_number_has_the_digits_that_its_bar_leaves(value, bar, shown):
    assert design_row_texts({"quantity": "contact_min", "value": value, "bar": bar, "unit": "N"})["value"] == shown


# --- the side view's data -------------------------------------------------------------------------------------------


def unpacked_array(part: dict) -> np.ndarray:
    steps = np.frombuffer(base64.b64decode(part["data"]), "<u2")
    return part["low"] + steps / 65535.0 * (part["high"] - part["low"])


def side_view_data(stored: Path) -> tuple[dict, Response]:
    r = Response.read(stored / A)
    html = side_view_of_runs(Scene.load("level"), [r], range_T=(1.1e5, 3.3e5))
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', html)[1]), r


def largest_misfit_in_steps(data: dict, r: Response) -> float:
    """Largest error of v along the rope in steps of the 16-bit scale."""
    part = data["cables"][0]["v"]
    v = unpacked_array(part).reshape(-1, len(data["s"]))[1:]  # the first frame is the rope at rest
    step = (part["high"] - part["low"]) / 65535.0
    return float(np.abs(v - r.fields.v[:, :: (r.fields.s.size - 1) // (len(data["s"]) - 1)]).max() / step)


def test_the_side_view_carries_the_stored_answer(stored_check):
    data, r = side_view_data(stored_check)
    cable = data["cables"][0]
    assert len(data["s"]) == 101
    assert largest_misfit_in_steps(data, r) < 0.51
    assert (
        largest_misfit_in_steps(data, replace(r, fields=replace(r.fields, v=r.fields.v + 1e-4 * np.ptp(r.fields.v))))
        > 5.0
    )
    assert unpacked_array(cable["t"])[0] == 0.0
    deflection = cable["touching"][0]["readout"][0]["data"]
    np.testing.assert_allclose(unpacked_array(deflection)[1:], r.fields.mass_v, rtol=0.0, atol=1e-3)
    step = (cable["u"]["high"] - cable["u"]["low"]) / 65535.0
    assert np.abs(unpacked_array(cable["u"])[: len(data["s"])]).max() < 0.51 * step  # at rest before the entry
    assert cable["slack"] == r.slack_onset * r.length


def test_a_name_cannot_end_the_script_of_the_side_view(stored_check):
    r = replace(Response.read(stored_check / A), method="</script><b>")
    html = side_view_of_runs(Scene.load("level"), [r], range_T=(1.1e5, 3.3e5))
    assert html.count("</script>") == 1
    assert "<b>" not in html


def test_a_key_in_a_list_of_tables_has_its_unit_and_meaning():
    html = scene_keys_table(Scene.load("zipline").to_toml())
    assert "<div>385 m</div>" in html
    assert "braking force along the cable" in html
