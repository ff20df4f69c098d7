"""Limits: verdicts with the bar, what is missing, and a second computation that denies a planted fault."""

import json
import math
import re
import tomllib
from pathlib import Path

import pytest

import cablefem as cf
from cablefem.scene import Scene, SceneError
from cablefem.scene.limits import CASES
from cablefem.scene.line import Line
from tests.commands.calls import QUICK
from validation.commands.run.study import rechecked_quasi_static_run
from validation.core import limits, readback, recomputed
from validation.core.quasi_static import quasi_static
from validation.core.readback import plain_text

pytestmark = pytest.mark.usefixtures("without_animation")

ZIP = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8").split("```toml\n")[1].split("```")[0]
TEXTS = {
    "limits.use": ["vorarlberg-goods", "vorarlberg-staff", "france-1974"],
    "mass.wheels": {"model": "point", "count": 8},
}
HUT = {"name": "hut", "at": 300.0, "top": -100.0, "kind": "road"}
TRAMWAY = Scene.load("tramway").replace({**TEXTS, "cable.breaking_load": 2.3e6, "obstacle": [HUT]})


@pytest.fixture(scope="module")
def tramway_ride_and_limits():
    r = rechecked_quasi_static_run(TRAMWAY, quasi_static(TRAMWAY))
    return r, limits.limit_rows(TRAMWAY, r.design, r.events)


def verdict_by_limit(rows):
    return {(row["demand"], row["limit"]): row["verdict"] for row in rows}


def test_numbers_of_texts_are_held_against_the_answer(tramway_ride_and_limits):
    r, rows = tramway_ride_and_limits
    known = {row["quantity"]: row["value"] for row in r.design}
    found = verdict_by_limit(rows)
    assert found["breaking load over largest tension", 3.15] == "not met"
    assert 2.3e6 / known["tension_max"] < 3.15
    assert found["smallest tension over the load of a wheel", 40.0] == "met"
    assert found["acceleration of the timetable", 0.2] == "met"  # 0.196: 1.5 V^2/way of 764 m
    assert found["top speed", 4.0] == "not met"
    assert found["smallest clearance over hut", 4.5] == "met"
    assert ("smallest clearance over hut", 6.0) not in found  # a road is no house
    assert found["swing across the line, its tangent", 0.2] == "not computed: the run is planar"
    assert not r.flags  # the design numbers behind it have a second computation


def test_a_limit_within_the_bar_is_too_close_to_tell(tramway_ride_and_limits):
    r, _ = tramway_ride_and_limits
    tension = next(row for row in r.design if row["quantity"] == "tension_max")
    near = 2.3e6 / (tension["value"] + 0.5 * tension["bar"])
    for factor, verdict in ((1.0, "too close to tell"), (0.97, "met"), (1.03, "not met")):
        scene = TRAMWAY.replace({"limits": {"safety_factor": factor * near}})
        assert [row["verdict"] for row in limits.limit_rows(scene, r.design)] == [verdict]
    without_bar = [row | {"bar": None} for row in r.design]
    scene = TRAMWAY.replace({"limits": {"safety_factor": 1.0}})
    assert limits.limit_rows(scene, without_bar)[0]["verdict"] == "too close to tell"


def test_what_is_missing_is_named():
    scene = Scene.load("tramway").replace(TEXTS | {"obstacle": [HUT | {"kind": None}]})
    bare = scene.replace({"mass.wheels": None})
    r = rechecked_quasi_static_run(bare, quasi_static(bare))
    missing = {row["verdict"] for row in limits.limit_rows(bare, r.design)}
    keys = ("cable.breaking_load", "the car wheels", "obstacle.hut.kind")
    assert {f"cannot be judged: give {key}" for key in keys} <= missing
    with pytest.raises(SceneError, match=r"unknown. Did you mean skyline\? Known: france-1974, "):
        scene.replace({"limits.use": ["skylin"]})


def test_a_clearance_with_nothing_to_clear_is_asked_for():
    """It was left out: "limits met" then, though nobody had said what is below the rope."""
    scene = TRAMWAY.replace({"obstacle": [], "limits.clearance": 2.0})
    r = rechecked_quasi_static_run(scene, quasi_static(scene))
    rows = limits.limit_rows(scene, r.design, r.events)
    found = verdict_by_limit(rows)
    for demanded in (2.0, 2.5):  # the scene's and a text's
        assert found["smallest clearance over obstacles", demanded].startswith("cannot be judged: give obstacles")
    assert not list(readback.limit_faults(rows, tomllib.loads(scene.to_toml()), r.design, r.events))


def test_what_is_not_computed_says_why():
    reasons = [words[3] for words in limits.DEMANDS.values()]
    assert all(": " in reason for reason in reasons if reason.startswith("not computed"))


def test_circumstances_choose_between_numbers_of_a_text():
    scene = TRAMWAY.replace({"limits.when": ["more than two persons", "rare use"]})
    rules = [rule["limit"] for rule in scene.limits.applicable_rules(700.0) if rule["demand"] == "tension_over_wheel"]
    assert rules == [20.0, 50.0]
    short = [rule["limit"] for rule in scene.limits.applicable_rules(90.0) if rule["demand"] == "sag_growth"]
    assert short == [0.15]  # the other text asks it of spans over 100 m


def test_every_shipped_number_has_a_clause_and_every_text_a_link():
    for text in limits.TEXTS.values():
        assert text["source"]
        assert text["link"].startswith("https://")
        assert text["scope"]
        assert all(rule["clause"] and rule["demand"] in limits.DEMANDS for rule in text["limit"])


FAULTS = {
    "another verdict": lambda row: row.update(verdict="met" if row["verdict"] == "not met" else "not met"),
    "another limit": lambda row: row.update(limit=1.01 * row["limit"]),
    "another bar": lambda row: row.update(bar=0.5 * row["bar"] if row["bar"] else 1.0),
    "another value": lambda row: row.update(value=1.01 * row["value"] + 1e-6),
    "another side": lambda row: row.update(side="at most" if row["side"] == "at least" else "at least"),
    "another clause": lambda row: row.update(source=row["source"][:-1] + "9"),
}


@pytest.mark.parametrize("fault", [None, *FAULTS])
def test_verdicts_are_computed_a_second_time(tramway_ride_and_limits, fault):
    r, rows = tramway_ride_and_limits
    toml = tomllib.loads(TRAMWAY.to_toml())
    judged = [row for row in rows if row["value"] is not None]
    assert len(judged) > 8
    for i in range(len(judged)):
        told = json.loads(json.dumps(rows))
        if fault is not None:
            FAULTS[fault](next(row for row in told if row == judged[i]))
        faults = list(readback.limit_faults(told, toml, r.design, r.events))
        assert bool(faults) is (fault is not None)


@pytest.mark.parametrize("when", [[], ["damper", "rare use"]])
def test_a_limit_that_is_left_out_or_does_not_apply_is_seen(tramway_ride_and_limits, when):
    r, _ = tramway_ride_and_limits
    scene = TRAMWAY.replace({"limits.when": when, "limits.safety_factor": 3.0, "limits.clearance": 1.0})
    toml = tomllib.loads(scene.to_toml())
    rows = limits.limit_rows(scene, r.design, r.events)
    assert not list(readback.limit_faults(rows, toml, r.design, r.events))
    for i in range(len(rows)):
        assert list(readback.limit_faults(rows[:i] + rows[i + 1 :], toml, r.design, r.events))
    other = scene.replace({"limits.when": ["more than two persons"]})
    extra = [row for row in limits.limit_rows(other, r.design, r.events) if row not in rows]
    assert extra
    for row in extra:
        assert list(readback.limit_faults([*rows, row], toml, r.design, r.events))


def test_a_wrong_sag_at_rest_is_denied(tramway_ride_and_limits):
    r, _ = tramway_ride_and_limits
    wrong = [row | {"value": 1.001 * row["value"]} if row["quantity"] == "sag_car_rest" else row for row in r.design]
    forged = recomputed.RecomputedNumbers(r, None).number("sag_car_rest")
    assert abs(next(row["value"] for row in wrong if row["quantity"] == "sag_car_rest") - forged) > 5e-4 * forged


@pytest.mark.parametrize(("limit", "code"), [("2.9", 0), ("3.54", 1)])
def test_required_limits_decide_the_exit_code(cablefem, limit, code):
    Path("zip.toml").write_text(ZIP)
    given = ("run", "zip.toml", "--model", "quasi-static", "--set", f"limits.safety_factor={limit}")
    assert cablefem(*given, "--require-limits")[0] == code
    if code:
        assert cablefem(*given)[0] == 0


def test_limits_are_printed_stored_and_read_back(cablefem):
    Path("zip.toml").write_text(ZIP)
    code, out, _ = cablefem("run", "zip.toml", "--model", "quasi-static", "--limits", "zip-line", "--out", "x")
    assert code == 0
    assert "lines of 6 mph (10 km/h) or less" in out
    of = readback.StoredResults(Path("x"), ["quasi-static"], judged=False)
    page = Path("x/report.html").read_text()
    assert [*readback.faults_of_stored_results(of), *readback.page_faults(page, "run", of)] == []
    assert of.unread == []
    file = Path("x/quasi-static/summary.json")
    stored = json.loads(file.read_text())
    stored["limits"][0]["verdict"] = "not met" if stored["limits"][0]["verdict"] == "met" else "met"
    file.write_text(json.dumps(stored))
    forged = readback.StoredResults(Path("x"), ["quasi-static"], judged=False)
    assert any("limits: " in fault for fault in readback.faults_of_stored_results(forged))
    assert any("no such limit" in fault for fault in readback.page_faults(page, "run", forged))
    code, _, err = cablefem("run", "zip.toml", "--limits", "acct")
    assert (code, err.count("\n")) == (2, 1)
    assert "--limits = 'acct': unknown." in err.replace(".use", "")


def test_limits_of_a_line_at_rest_are_printed_and_judged(cablefem):
    code, out, _ = cablefem("check", "skyline", "--limits", "skyline", "--out", "x", "--require-limits")
    assert code == 1
    rows = json.loads(Path("x/agreement.json").read_text())["limits"]
    assert [row["verdict"] for row in rows] == ["cannot be judged: give cable.breaking_load", "not met", "met", "met"]
    assert "smallest knee angle, empty" in out
    assert "at the positions in positions.csv" in out
    page = Path("x/report.html").read_text()
    assert list(readback.limit_table_faults(page, rows)) == []
    value = f"{rows[1]['value']:.5g}"
    for there, instead in ((value, f"{1.01 * rows[1]['value']:.5g}"), ("at least 3", "at least 4"), ("not met", "met")):
        assert there in page
        assert list(readback.limit_table_faults(page.replace(there, instead), rows))
    assert list(readback.limit_table_faults(page, rows[1:]))


@pytest.mark.parametrize(
    ("hauled", "text", "outside"),
    [
        ("true", "vorarlberg-goods", False), ("false", "vorarlberg-goods", True),
        ("true", "skyline", False), ("false", "zip-line", True),
    ],
)  # fmt: skip
def test_a_hauled_load_at_rest_is_within_the_scope_of_texts_on_ropeways_that_haul(cablefem, hauled, text, outside):
    given = ("--set", f"car.carriage.hauled={hauled}", "--limits", text)
    code, out, err = cablefem("run", "skyline", *given, "--out", "x")
    assert (code, err) == (0, "")
    assert ("outside its scope" in out) is outside


@pytest.mark.parametrize("text", ["vorarlberg-goods", "france-1974", "zip-line"])
def test_nothing_is_asked_of_a_car_at_rest_that_it_cannot_have(cablefem, text):
    """Wheels, a hanger and an arrival belong to cars in motion; `at` is refused beside them."""
    code, out, _ = cablefem("run", "skyline", "--limits", text, "--out", "x")
    assert code == 0
    assert "not computed: only in motion" in out
    assert "give the car" not in out
    assert "no rider arrives" not in out


def test_a_bare_rope_is_outside_of_texts_on_cars(cablefem, tmp_path):
    contacts = "".join(f'[[contact]]\nname = "{name}"\nkind = "anchor"\nat = [{x}, 0.0]\n' for name, x in ENDS)
    cable = "[cable]\nmass_per_length = 3.0\nEA = 4e7\nbreaking_load = 5e5\ntension = {at = 'left', value = 5e4}\n"
    (tmp_path / "bare.toml").write_text(cable + contacts)
    code, out, err = cablefem("run", "bare.toml", "--limits", "zip-line", "--out", "x")
    assert (code, err) == (0, "")
    assert "outside its scope" in out


ENDS = (("left", 0.0), ("right", 200.0))


def test_a_grid_has_the_worst_limit_of_each_scene(cablefem):
    Path("zip.toml").write_text(ZIP)
    given = ("--set", "mass.mass=60,120", "--set", "limits.safety_factor=3.5", "--out", "x")
    assert cablefem("run", "zip.toml", "--model", "quasi-static", *given)[0] == 0
    rows = json.loads(Path("x/grid/grid.json").read_text())["rows"]
    assert [row["limits_met"] for row in rows] == ["met", "not met"]
    assert rows[1]["limits_worst"] == "breaking load over largest tension (the scene)"


@pytest.mark.parametrize(("case", "pressure"), [("wind", 300.0), ("storm", 0.7 * 1000.0)])
def test_a_wind_case_is_a_pressure_on_the_face_of_the_rope(case, pressure):
    scene = Scene.load("zipline").replace({"cable.diameter": 0.016, **CASES[case]["set"]})
    assert scene.wind.force_per_length(0.016) == pytest.approx(0.016 * pressure)


def test_a_wind_across_says_what_of_it_is_left_out(cablefem):
    """Tensions in storm are those in calm air: terminal, page and table say so, with the load of the rope."""
    scene = Scene.load("zipline").replace({"cable.diameter": 0.02, **CASES["storm"]["set"]})
    down = 0.589 * 9.81
    factor = math.hypot(0.02 * 700.0, down) / down
    assert scene.wind_tilt == pytest.approx(math.degrees(math.acos(1.0 / factor)), rel=1e-2)  # stretched: lighter
    storm = ("run", "zipline", "--set", "cable.diameter=0.02", "--case", "storm")
    for model, holds in (("quasi-static", "nothing of it"), ("full", "only how it damps the rope")):
        code, out, _ = cablefem(*storm, "--model", model, *(QUICK[2:] if model == "full" else ()), "--out", model)
        assert code == 0
        page = Path(model, "report.html").read_text()
        for text in (out, plain_text(page)):
            said = re.search(rf"the numbers hold {holds}\. Its force .* ([\d.]+) times its weight", text)
            assert float(said[1]) == pytest.approx(factor, rel=1e-2)
    code, out, _ = cablefem(*storm, "--case", "ice", "--model", "quasi-static", "--out", "grid")
    rows = json.loads(Path("grid/grid/grid.json").read_text())["rows"]
    assert [row.get("crosswind_load") for row in rows] == [pytest.approx(factor, rel=1e-2), None]
    assert "left out: load with the wind across over the rope's weight" in out
    assert "times its weight" not in cablefem("run", "zipline", "--model", "quasi-static", "--out", "calm")[1]


def test_load_cases_make_a_grid_and_say_what_is_missing(cablefem):
    ice = 500.0 * math.pi * (0.1**2 - 0.05**2) / 4.0  # kg/m of a ring of 25 mm
    heavier = Scene.load("tramway").replace({"cable.diameter": 0.05, "cable.ice": ice})
    given = ("run", "tramway", "--model", "quasi-static", "--set", "cable.diameter=0.05", "--out", "x")
    assert cablefem(*given, "--case", "ice", "--case", "wind,ice", "--case", "wind")[0] == 0
    rows = json.loads(Path("x/grid/grid.json").read_text())["rows"]
    tension = next(
        row["value"]
        for row in rechecked_quasi_static_run(heavier, quasi_static(heavier)).design
        if row["quantity"] == "tension_max"
    )
    assert [row["case"] for row in rows] == ["ice", "wind"]
    assert rows[0]["tension_max"] == pytest.approx(tension)
    assert rows[1]["tension_max"] < 0.95 * tension
    code, _, err = cablefem("check", "tramway", "--case", "ice")
    assert (code, err.count("\n")) == (2, 1)
    assert "--case ice: cable.diameter: missing" in err
    for unknown in ("icy", ""):
        code, _, err = cablefem("run", "two-span", "--case", unknown)
        assert (code, err.count("\n")) == (2, 1)
        assert f"--case {unknown!r}: unknown. Known: ice, wind, storm" in err


def test_limits_from_python():
    found = cf.Line.load("skyline").replace({"cable.breaking_load": 4e5, "limits.use": ["skyline"]})
    assert [row["verdict"] for row in cf.run(found).limits] == ["met", "not met", "met", "met"]


@pytest.mark.parametrize("factor", [1.0, 1.01])
def test_the_swing_of_a_cabin_is_held_against_its_limit(factor):
    line = Line.load("emergency-stop").replace({"limits": {"use": ["france-1974"]}})
    numbers = {"swing_max:cabin": 10.0, "swing_min:cabin": -20.0}
    design = [{"quantity": name, "value": value, "bar": 0.1, "unit": "deg"} for name, value in numbers.items()]
    (row,) = (row for row in limits.limit_rows(line, design) if row["demand"].startswith("swing along"))
    assert (row["value"], row["verdict"]) == (pytest.approx(math.tan(math.radians(20.0))), "not met")
    row["value"] *= factor
    faults = list(readback.limit_faults([row], tomllib.loads(line.to_toml()), design, []))
    assert any(fault.startswith("swing along") for fault in faults) is (factor != 1.0)
