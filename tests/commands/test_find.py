"""The inverse question: its answers hold on one side and fail on the other, and bad questions are one sentence."""

import json
import re
from contextlib import contextmanager
from pathlib import Path

import pytest

import cablefem as cf
from tests.commands.test_files import undocumented_keys
from validation.commands.find import page as find_page
from validation.commands.find.condition import parse_condition
from validation.core import readback
from validation.core.quasi_static import quasi_static
from validation.core.store import Refused
from validation.page import terminal

ZIPLINE = cf.Scene.load("zipline")
RIDER = ZIPLINE.replace({"mass.mass": 50.0, "drive.wind": -4.0})
GROUND = [[0.0, 12.0], [97.0, 39.118], [182.0, 62.176], [250.0, 87.842], [305.0, 119.0]]
SKYLINE = cf.Line.load("skyline").replace({"cable.breaking_load": 4e5, "ground": GROUND})


def test_which_tension_lets_a_light_rider_reach_the_brake_against_the_wind():
    found = cf.find(RIDER, {"cable.horizontal_tension": (12e3, 18e3)}, so_that="brake.speed >= 0.5 m/s", check=False)
    assert len(found.changes) == 1
    above, below = (
        quasi_static(RIDER.replace({"cable.horizontal_tension": found.value + dH})).events[0] for dH in (2.0, -2.0)
    )
    assert above["event"] == "brake"
    assert above["speed"] >= 0.5
    assert below["event"] != "brake" or below["speed"] < 0.5
    assert "at least" in found.sentence


@pytest.mark.slow
def test_which_brake_force_stops_the_heavy_rider_and_lets_the_light_one_in():
    both = {"mass.mass": [40.0, 120.0]}
    asked = "stop.s_o >= 385.7 m and stop.s_o <= 398 m"
    found = cf.find(ZIPLINE, {"drive.brake.0.force": (400.0, 1600.0)}, so_that=asked, all_of=both, check=False)
    assert len(found.changes) == 2  # too weak, then too strong
    assert "it changes 2 times" in found.sentence
    weakest, strongest = (change.value for change in found.changes)
    stop = {}
    for mass, force in ((120.0, weakest), (40.0, strongest)):
        events = quasi_static(ZIPLINE.replace({"mass.mass": mass, "drive.brake.0.force": force})).events
        stop[mass] = next(x["s_o"] for x in events if x["event"] in ("stop", "arrival"))
    assert stop[120.0] == pytest.approx(398.0, abs=0.01)
    assert stop[40.0] == pytest.approx(385.7, abs=0.01)


@pytest.mark.slow
def test_the_heaviest_load_of_a_skyline_with_its_bar_from_the_check():
    asked = "clearance_car >= 2 m and safety_factor >= 3"
    found = cf.find(SKYLINE, {"car.carriage.mass": (500.0, 6000.0)}, so_that=asked)
    change = found.changes[0]
    assert change.verdict == "agree"
    assert change.bar is not None
    assert change.bar < 1.0
    at, beyond = (cf.run(SKYLINE.replace({"car.carriage.mass": change.value + d})).design for d in (0.0, 1.0))
    room = [
        min(x["value"] - limit for x in rows for kind, limit in (("clearance_car", 2.0), ("safety_factor", 3.0))
            if x["quantity"].startswith(kind))
        for rows in (at, beyond)
    ]  # fmt: skip
    assert room[0] == pytest.approx(0.0, abs=1e-5)
    assert room[1] < 0.0


def test_the_speed_from_which_an_emergency_stop_keeps_the_haul_rope_taut():
    stop = {"time": 50.0, "deceleration": 4.0}
    travel = {"kind": "trapezoid", "top_speed": 8.0, "acceleration": 0.3, "deceleration": 0.3, "stop": stop}
    tramway = cf.Scene.load("tramway").replace({"travel": travel})
    found = cf.find(tramway, {"travel.top_speed": (4.0, 10.0)}, so_that="haul_force_min >= 0 kN", check=False)
    below, above = (
        quasi_static(tramway.replace({"travel.top_speed": found.value + dV})).F_haul.min() for dV in (-0.1, 0.1)
    )
    assert below * above < 0.0


def scale_entry(at, key, factor=1.01):
    at[key] *= factor


def evaluation_at_change(x):
    return next(row for row in x["evaluations"] if row["value"] == x["changes"][0]["holds_at"])


FAULTS = {
    "value": lambda x: scale_entry(x["changes"][0], "value"),
    "first value": lambda x: scale_entry(x, "value"),
    "bar": lambda x: scale_entry(x["changes"][0], "bar"),
    "number of the check": lambda x: scale_entry(x["changes"][0]["checked"], 1),
    "tried value": lambda x: scale_entry(x["evaluations"][3], "value"),
    "number that was read": lambda x: scale_entry(evaluation_at_change(x)["read"][0], 0),
    "limit": lambda x: x.update(condition="tension_max <= 25.25 kN"),
    "holds": lambda x: x["evaluations"][0].update(holds=False),
    "side": lambda x: x.update(sentence=x["sentence"].replace("at most", "at least")),
    "word": lambda x: x["evaluations"][0].update(outcome="crashes"),
}


def test_each_planted_fault_of_an_answer_is_seen(cablefem):
    Path("begin.toml").write_text(ZIPLINE.replace({"drive.end": {"place": 30.0}}).to_toml())
    given = ("find", "begin.toml", "cable.horizontal_tension=12e3:30e3", "--so-that", "tension_max <= 25 kN")
    code, out, _ = cablefem(*given, "--out", "x")
    assert code == 0
    page = Path("x/report.html").read_text()
    printed = out.splitlines()
    assert list(readback.find_faults(Path("x"), page, printed)) == []
    assert undocumented_keys(Path("x/find.json")) == []
    right = json.loads(Path("x/find.json").read_text())
    for plant in FAULTS.values():
        wrong = json.loads(json.dumps(right))
        plant(wrong)
        Path("x/find.json").write_text(json.dumps(wrong))
        assert list(readback.find_faults(Path("x"), page, printed))
    Path("x/find.json").write_text(json.dumps(right))
    number = re.search(r"at most (\d+)", right["sentence"])[1]
    other = f"{1.01 * float(number):.0f}"
    assert list(readback.find_faults(Path("x"), page.replace(number, other), printed))
    assert list(readback.find_faults(Path("x"), page, [text.replace(number, other) for text in printed]))


@pytest.mark.parametrize("more", [(), ("--for", "mass.mass=80,90")])
def test_an_answer_with_both_signs_of_comparison_is_read_back(cablefem, more):
    """Where "<=" holds nowhere, ">" follows it in the sentence: together they are no tag of HTML."""
    Path("begin.toml").write_text(ZIPLINE.replace({"drive.end": {"place": 30.0}}).to_toml())
    given = ("cable.horizontal_tension=28e3:30e3", "--so-that", "tension_max <= 25 kN", *more)
    code, out, err = cablefem("find", "begin.toml", *given, "--out", "x")
    assert "tension_max <= 25 kN holds nowhere" in out
    assert "(tension_max > 25 kN)" in out
    assert code == 1  # no answer
    assert "not what was computed" not in err


def test_words_are_bisected_and_a_condition_that_never_changes_says_what_happens():
    found = cf.find(RIDER, {"cable.horizontal_tension": (12e3, 18e3)}, so_that="outcome = stuck", check=False)
    assert found.changes[0].fails_at > found.changes[0].holds_at
    never = cf.find(RIDER, {"mass.mass": (49.0, 51.0)}, so_that="outcome = arrives", check=False)
    assert never.value is None
    assert "holds nowhere in the range; at 49: " in never.sentence


def test_riders_who_arrive_slowly_are_found_between_those_too_fast_and_those_who_do_not_arrive():
    """With more friction a rider is slower on arrival, then gets stuck: few values of the key lie between."""
    never = ZIPLINE.replace({"drive.brake": []})
    slow = "arrival.speed <= 3 km/h"
    found = cf.find(never, {"drive.rolling_friction": (0.0, 0.2)}, so_that=slow, check=False)
    assert len(found.changes) == 2
    least, most = (change.value for change in found.changes)
    for friction, arrives_slowly in ((least - 1e-3, False), (0.5 * (least + most), True), (most + 1e-3, False)):
        ride = cf.quasi_static(never.replace({"drive.rolling_friction": friction}))
        speeds = [e["speed"] for e in ride.events if e["event"] == "arrival"]
        assert (bool(speeds) and 3.6 * speeds[0] <= 3.0) is arrives_slowly


def test_the_command_stores_the_answer_and_a_value_that_fails_does_not_hold(cablefem):
    Path("bad.toml").write_text(RIDER.to_toml())
    code, out, _ = cablefem(
        "find", "bad.toml", "drive.start=2:500", "--so-that", "brake.speed >= 0.1 km/h", "--no-check", "--out", "x"
    )  # fmt: skip
    stored = json.loads(Path("x/find.json").read_text())
    assert code == (0 if stored["changes"] else 1)
    assert any("drive.start" in x["outcome"] and not x["holds"] for x in stored["evaluations"])
    assert stored["sentence"] in out
    assert 'id="find"' in Path("x/report.html").read_text()


@pytest.mark.parametrize(
    ("count", "more"), [(6, ()), pytest.param(20, ("--for", "mass.mass=60,80,100"), marks=pytest.mark.slow)]
)
def test_ctrl_c_leaves_what_was_computed(cablefem, monkeypatch, count, more):
    shown = []

    @contextmanager
    def interrupting():
        def show(label, done):
            shown.append(label)
            if len(shown) == count:
                raise KeyboardInterrupt

        yield show

    monkeypatch.setattr(terminal, "progress_bars", interrupting)
    Path("zip.toml").write_text(ZIPLINE.replace({"cable.sag": 5.0}).to_toml())
    code, out, err = cablefem(
        "find", "zip.toml", "cable.sag=4:8", "--so-that", "tension_max <= 20 kN", "--no-check", *more, "--out", "x"
    )  # fmt: skip
    assert code == 130
    assert err == "cablefem: interrupted; what was computed is in x/find.json\n"
    stored = json.loads(Path("x/find.json").read_text())
    if more:
        assert 0 < len(stored["rows"]) < 3
        assert Path("x/find.csv").read_text().count("\n") == 1 + len(stored["rows"])
    else:
        tried = {x["value"]: x["holds"] for x in stored["evaluations"]}
        assert tried[4.0] is False
        assert stored["sentence"] in out
        assert "interrupted; tension_max <= 20 kN changes between" in out
    assert 'id="find"' in Path("x/report.html").read_text()


@pytest.mark.parametrize("values", [(80.0, 120.0, 160.0), ("haul", "grip", "free")])
def test_a_curve_has_units_and_the_bars_that_are_known(tmp_path, values):
    answers = zip(values, (4.0, 5.0, None), (0.5, None, None), strict=True)
    rows = [{"at": at, "value": value, "bar": bar, "answer": ""} for at, value, bar in answers]
    curve = {"for": "mass.mass", "key": "cable.sag", "for_unit": "kg", "unit": "m", "rows": rows}
    (tmp_path / "find.json").write_text(json.dumps(curve))
    (section,) = find_page.sections(tmp_path)
    assert "mass.mass [kg]" in section.html
    assert "cable.sag [m]" in section.html
    figures = section.html.count("<figure")
    assert figures == isinstance(values[0], float)  # there is no axis of words
    assert section.html.count('class="c"') == 2 * figures  # the curve and one bar
    assert ("Circles: the bar is unknown" in section.html) is bool(figures)


@pytest.mark.slow
def test_the_curve_of_two_keys(cablefem):
    given = ("cable.sag=4:8", "--so-that", "safety_factor >= 4", "--for", "mass.mass=80,120")
    Path("zip.toml").write_text(ZIPLINE.replace({"cable.sag": 5.0, "cable.breaking_load": 9e4}).to_toml())
    code, out, _ = cablefem("find", "zip.toml", *given, "--out", "x")
    assert code == 0
    light, heavy = (json.loads(Path("x/find.json").read_text())["rows"][i]["value"] for i in (0, 1))
    assert heavy > light  # a heavier rider needs more sag
    table = Path("x/find.csv").read_text()
    assert table.startswith("mass.mass,cable.sag,bar,answer")
    page = Path("x/report.html").read_text()
    assert page.count("cable.sag [m]") >= 3  # axis, caption and table
    assert page.count("mass.mass [kg]") >= 3
    printed = out.splitlines()
    assert list(readback.find_faults(Path("x"), page, printed)) == []
    Path("x/find.csv").write_text(table.replace("\n80,", "\n81,"))
    assert list(readback.find_faults(Path("x"), page, printed)) == ["find.csv is not find.json"]
    assert list(readback.find_faults(Path("x"), page.replace(f">{heavy:.6g}<", f">{1.01 * heavy:.6g}<"), printed))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("mass.mass=200:40", "outcome = arrives"), "LOW must be below HIGH"),
        (("mass.mass=40:inf", "outcome = arrives"), "LOW must be below HIGH, both finite"),
        (("mass.mass", "outcome = arrives"), "must be KEY=LOW:HIGH"),
        (("mass.mass=40:200", "outcome = arrives and speed >"), "cannot read 'speed >'"),
        (("mass.mass=40:200", "outcome = arrive"), "unknown kind of outcome. Did you mean arrives? Known: breaks, "),
        (("mass.mass=40:200", "spede_max >= 3 m/s"), "unknown name. Did you mean speed_max?"),
        (("mass.mass=40:200", "arrival.sped >= 3 m/s"), "Known: arrival.s_o, arrival.speed, arrival.t."),
        (("mass.mass=40:200", "speed_max >= 3 kN"), "unit 'kN'; speed_max is in m/s"),
        (("mass.mass=40:200", "tension_max <= 30 m"), "unit 'm'; tension_max is in N"),  # no milli
        (("mass.mass=40:200", "limits met"), "limits met: none are given"),
        (("mass.mas=40:200", "outcome = arrives"), "mass.mas"),
    ],
)  # fmt: skip
def test_a_bad_question_is_one_sentence(cablefem, arguments, words):
    code, out, err = cablefem("find", "zipline", arguments[0], "--so-that", arguments[1])
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert words in err


def test_a_depth_that_is_largest_at_an_end_is_refused_and_the_advice_helps():
    """A light car that climbs is deepest at its start: that does not make the condition fail there."""
    climbing = cf.Scene.load("tramway")
    range_of_mass = {"mass.mass": (50.0, 30e3)}
    with pytest.raises(
        Refused, match=r"at mass\.mass = 50 .* mass_deepest has no value; must be clearance_rope or clearance_car"
    ):
        cf.find(climbing, range_of_mass, so_that="mass_deepest <= 40 m", check=False)
    over_ground = climbing.replace({"ground": [[-1.0, 40.0], [climbing.supports.span + 1.0, 40.0]]})
    found = cf.find(over_ground, range_of_mass, so_that="clearance_car >= 0 m", check=False)
    assert "holds everywhere" in found.sentence


@pytest.mark.parametrize("keys", ["mass.mass", {}, {"mass.mass": (40.0,)}])
def test_keys_from_python_are_one_key_and_its_range(keys):
    with pytest.raises(Refused, match=r"must be one key and its range, as \{'mass.mass': \(40, 200\)\}"):
        cf.find("zipline", keys, so_that="outcome = arrives")


def test_a_condition_on_a_number_that_only_lines_have_is_read_back(cablefem):
    Path("sky.toml").write_text(SKYLINE.to_toml())
    given = ("find", "sky.toml", "car.carriage.mass=500:4000", "--so-that", "haul_min:carriage >= -8 kN", "--no-check")
    given += ("--out", "x")
    code, out, err = cablefem(*given)
    assert (code, err) == (0, "")
    assert "at most" in out
    stored = json.loads(Path("x/find.json").read_text())
    assert float(out.partition(" ± ")[2].partition(" ")[0]) == pytest.approx(stored["bar"], rel=0.05)


@pytest.mark.parametrize(
    ("condition", "known"),
    [("arrival.speed <= 2 m/s", "Known: clearance_car, "), ("haul_min.car >= 1 kN", "Known: haul_min.carriage.")],
)
def test_a_line_at_rest_has_no_events_and_names_what_it_has_of_a_kind(condition, known):
    with pytest.raises(Refused, match=known) as refusal:
        cf.find(SKYLINE, {"car.carriage.mass": (500.0, 4000.0)}, so_that=condition, check=False)
    assert "arrival" not in str(refusal.value).partition("Known")[2]


def test_a_line_without_a_check_is_answered_by_one_solver():
    found = cf.find(SKYLINE, {"car.carriage.mass": (500.0, 9000.0)}, so_that="safety_factor >= 3", check=False)
    assert found.sentence.endswith("by one solver alone")


def test_units_are_those_that_are_printed():
    clause = parse_condition("arrival.speed <= 10 km/h")[0]
    assert clause.limit_in_unit_or_refused("m/s") == pytest.approx(10.0 / 3.6)
    assert parse_condition("tension_max <= 30 kN")[0].limit_in_unit_or_refused("N") == 30e3


def test_without_a_check_the_bar_is_what_the_quasi_static_model_leaves_out():
    strong = ZIPLINE.replace({"cable.breaking_load": 9e4})
    found = cf.find(strong, {"mass.mass": (40.0, 200.0)}, so_that="safety_factor >= 4.5", check=False)
    change = found.changes[0]
    assert "by the quasi-static model alone" in change.sentence
    # the bar holds the mass at which the full model has the factor
    at = {side: strong.replace({"mass.mass": change.value + side * change.bar}) for side in (-1.0, 1.0)}
    factors = {
        side: design_number(cf.run(scene, elements=6, steps=400, bars=False), "safety_factor_min")
        for side, scene in at.items()
    }
    assert factors[-1.0] > 4.5 > factors[1.0]
    assert change.bar < 20.0


def design_number(r, quantity):
    return next(row["value"] for row in r.design if row["quantity"] == quantity)


def test_a_limit_within_the_bar_is_named_as_the_reason_with_its_number():
    strong = ZIPLINE.replace({"cable.breaking_load": 9e4, "limits": {"safety_factor": 4.5}})
    found = cf.find(strong, {"mass.mass": (40.0, 200.0)}, so_that="limits met", check=False)
    assert re.fullmatch(
        r"breaking load over largest tension 4\.\d+ ± 0\.\d+, at least 4\.5 \(the scene\): too close to tell",
        found.changes[0].fails,
    )
    never = cf.find(strong, {"mass.mass": (190.0, 200.0)}, so_that="limits met", check=False)
    assert never.sentence.count("(breaking load over largest tension") == 2


@pytest.mark.slow
def test_limits_are_met_by_the_full_model_where_its_bars_say_so():
    strong = ZIPLINE.replace({"cable.breaking_load": 9e4, "limits": {"safety_factor": 4.5}})
    found = cf.find(strong, {"mass.mass": (40.0, 41.0)}, so_that="limits met", model="full", check=False)
    assert "limits met holds everywhere" in found.sentence


def test_the_speed_at_a_brake_or_the_end_is_the_one_of_the_limit():
    headwinds = {"drive.wind": (-1.0, 0.0)}
    limited = ZIPLINE.replace({"mass.mass": 40.0, "limits": {"arrival_speed": 30.0}})
    for condition in ("brake_or_arrival.speed <= 30 m/s", "limits met"):
        found = cf.find(limited, headwinds, so_that=condition, check=False)
        assert "holds everywhere" in found.sentence
    end = cf.find(limited, headwinds, so_that="arrival.speed <= 30 m/s", check=False)
    assert "holds nowhere" in end.sentence
    assert end.sentence.count("there is no arrival.speed: stops in the brake") == 2
