"""What becomes of a ride, what it clears, where the rope hangs; by the quasi-static model, which is exact enough."""

import dataclasses
import json
import tomllib

import numpy as np
import pytest

from cablefem import Scene
from tests.scene.test_ride import CREEPER
from validation.core import answers, recomputed
from validation.core.agreement import Verdict
from validation.core.answers import outcome_of_run, write_summary_and_profile
from validation.core.clearances import clearance_tracks
from validation.core.design import design_numbers
from validation.core.quantities import design_row_texts, key_numbers
from validation.core.quasi_static import quasi_static
from validation.core.running import Run, run

LINE = CREEPER.replace({"mass.mass": 80.0, "mass.below": 2.0, "drive.wind": 0.0})


def scene_with_changes(**changes):
    return LINE.replace({key.replace("__", "."): value for key, value in changes.items()})


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({}, "stopped_by_brake", "stops in the brake at 396.9 m, 1.9 m into it"),
        ({"drive__wind": -8.0}, "stuck", "never reaches the brake: comes to rest 116"),
        ({"drive__wind": -8.0, "drive__brake": []}, "stuck", "gets stuck: comes to rest at 278"),
        ({"drive__wind": -20.0}, "stuck", "never reaches the brake"),
        ({"drive__brake": [], "drive__end": {"place": 380.0}}, "arrives", "arrives at 380.0 m after"),
        ({"drive__end": {"time": 10.0}}, "rolling", "still rolls after 10.0 s"),
    ],
)
def test_the_outcome_is_one_sentence(changes, kind, words):
    found = answers.outcome_of_run(s := scene_with_changes(**changes), quasi_static(s))
    assert found.kind == kind
    assert found.sentence.startswith(words)


def test_a_car_that_sticks_or_turns_back_says_how_far_it_came():
    s = scene_with_changes(drive__wind=-8.0)
    r = quasi_static(s)
    assert answers.outcome_of_run(s, r).sentence.endswith(f", the farthest point is {r.s_o.max():.1f} m")
    s = Scene.load("rollback")
    r = quasi_static(s)
    farthest = max(event["s_o"] for event in r.events)
    assert f", the farthest point is {farthest:.1f} m" in answers.outcome_of_run(s, r).sentence


def test_a_car_that_lifts_off_says_so_before_what_has_no_meaning():
    """On a rope this long the car meets the far side too steeply; what follows is a car that is held down."""
    scene = Scene(
        cable={"mass_per_length": 0.95, "EA": 1.17e7, "length": 340.0},
        supports={"span": 320.0, "drop": 60.0},
        mass={"mass": 100.0},
        drive={"mode": "free", "start": 2.0, "rolling_friction": 0.015, "drag_area": 0.55, "end": {"time": 16.0}},
    )
    r = run(scene, "following-p2", elements=10, steps=400)
    kind, sentence = answers.outcome_of_run(scene, r)
    event = next(x for x in r.events if x["event"] == "lift_off")
    assert sentence.startswith(f"the car lifts off at {event['s_o']:.1f} m after {event['t']:.1f} s; if it were held ")
    row = recomputed.recomputed_outcome_row(r, None, kind, sentence)
    assert row.verdict is Verdict.AGREE
    wrong = sentence.replace(f"{event['t']:.1f}", f"{event['t'] + 0.2:.1f}")
    assert recomputed.recomputed_outcome_row(r, None, kind, wrong).verdict is not Verdict.AGREE
    upwards = np.where(r.t > 0.5 * event["t"], -1.0, 1.0)[:, None] * r.contact
    for contact, verdict in (r.contact, Verdict.AGREE), (upwards, Verdict.DISAGREE):
        without_event = dataclasses.replace(r, contact=contact, events=[])
        with_numbers = dataclasses.replace(without_event, design=design_numbers(without_event))
        end = answers.outcome_of_run(scene, with_numbers)
        assert recomputed.recomputed_outcome_row(with_numbers, None, *end).verdict is verdict


def test_a_free_ride_that_still_rolls_has_the_time_of_its_scene():
    scene = scene_with_changes(drive__end={"time": 10.0})
    r = quasi_static(scene)
    end = answers.outcome_of_run(scene, r)
    assert recomputed.recomputed_outcome_row(r, None, *end).verdict is Verdict.AGREE
    longer = scene.replace({"drive.end.time": 10.2}).to_toml()
    late = dataclasses.replace(r, scene_toml=longer)
    assert recomputed.recomputed_outcome_row(late, None, *end).verdict is Verdict.DISAGREE


def test_a_hauled_car_and_a_prescribed_stop():
    tramway = Scene.load("tramway")
    found = answers.outcome_of_run(tramway, quasi_static(tramway))
    assert found.kind == "crossed"
    assert found.sentence.startswith("is hauled from 7.8 m to 771.9 m in ")
    data = tomllib.loads(tramway.to_toml()) | {
        "travel": {"kind": "table", "times": [0.0, 20.0, 60.0], "positions": [0.0, 60.0, 292.2]}
    }
    halfway = Scene(**data)
    found = answers.outcome_of_run(halfway, quasi_static(halfway))
    assert (found.kind, found.sentence) == ("stopped", "stops at 300.0 m after 60.0 s")


@pytest.mark.parametrize(
    "travel",
    [
        {"kind": "trapezoid", "top_speed": 10.0, "acceleration": 1.0, "deceleration": 1.0, "to": 307.8, "rest": 8.0},
        {"kind": "table", "times": [0, 10, 20, 30, 40, 60], "positions": [0, 46.9, 150, 253.1, 300, 300]},
    ],
)  # fmt: skip
def test_a_car_stops_when_it_comes_to_rest_and_not_when_the_run_ends(travel):
    data = tomllib.loads(Scene.load("tramway").to_toml()) | {"travel": travel | {"from": 7.8}}
    scene = Scene(**data)
    ride = quasi_static(scene)
    kind, sentence = answers.outcome_of_run(scene, ride)
    assert (kind, sentence) == ("stopped", "stops at 307.8 m after 40.0 s")
    assert recomputed.recomputed_outcome_row(ride, None, kind, sentence).verdict is Verdict.AGREE


def scene_with_tree(top):
    return scene_with_changes(obstacle=[{"name": "tree", "at": 180.0, "top": top}])


def test_a_tree_is_hit_by_feet_first_and_then_by_the_rope():
    r = quasi_static(scene_with_tree(22.0))
    found = clearance_tracks(scene_with_tree(22.0), r)
    (at_car, frames), (car,) = found["rope", "tree"], found["car", "tree"]
    depth = np.interp(180.0, r.x, r.y)  # the rope is deepest there when the car passes
    assert car.value == pytest.approx([22.0 - depth - 2.0], rel=0.0, abs=1e-6)
    assert at_car.value == pytest.approx([22.0 - depth], rel=0.0, abs=1e-6)
    assert frames.value.min() == pytest.approx(22.0 - depth, rel=0.0, abs=0.5)
    assert frames.value.max() > 22.0 - 22.8  # the empty rope passes it 22.7 m below the start
    for top, hit in ((20.0, ["tree"]), (depth + 1.0, ["tree"]), (depth + 2.5, [])):
        said = answers.outcome_of_run(scene_with_tree(top), quasi_static(scene_with_tree(top))).sentence
        assert said.startswith("would hit tree; ") is bool(hit)


def test_a_rope_beyond_its_breaking_load_does_not_arrive():
    """8000 kg on a zip line arrived with 72.5 km/h, a safety factor of 0.47 in the lines below."""
    s = scene_with_changes(
        mass__mass=8000.0, cable__breaking_load=90e3, obstacle=[{"name": "tree", "at": 180.0, "top": 22.0}]
    )
    found = answers.outcome_of_run(s, quasi_static(s))
    assert found.kind == "breaks"
    assert found.sentence.startswith("the rope breaks: ")
    assert ", breaking load 90.0 kN; if it held: would hit tree; arrives at " in found.sentence
    strong = s.replace({"cable.breaking_load": 1e6})
    assert answers.outcome_of_run(strong, quasi_static(strong)).kind == "arrives"


@pytest.mark.parametrize(
    ("quantity", "value", "words"),
    [
        ("clearance_car_min:tree", -0.01, "too close to tell whether it clears tree; stops"),
        ("clearance_car_min:tree", -0.03, "would hit tree; stops"), ("clearance_car_min:tree", 0.03, "stops"),
        ("safety_factor_min", 1.01, "too close to tell whether the rope breaks; stops"),
        ("safety_factor_min", 0.97, "the rope breaks: "),
    ],
)  # fmt: skip
def test_what_is_closer_than_its_bar_is_too_close_to_tell(quantity, value, words):
    s = scene_with_changes(cable__breaking_load=90e3, obstacle=[{"name": "tree", "at": 180.0, "top": 30.0}])
    r = quasi_static(s)
    changed = [row | {"value": value, "bar": 0.02} if row["quantity"] == quantity else row for row in design_numbers(r)]
    assert answers.outcome_of_run(s, dataclasses.replace(r, design=changed)).sentence.startswith(words)


def test_a_profile_holds_nothing_past_the_slack_onset():
    """`level` had 7.7e6 N of noise in it, where its largest tension is 319 kN."""
    r = run(Scene.load("level"), "following-p2", elements=12, steps=600, scheme="generalized-alpha")
    taut = r.fields.t <= r.slack_time_or_inf
    assert r.fields.T[~taut].max() > 1.5 * r.fields.T[taut].max()
    assert answers.profile_columns(r)["tension_max"].max() <= r.fields.T[taut].max() * 1.05


def test_a_rider_who_never_comes_there_does_not_hit_it():
    s = scene_with_changes(obstacle=[{"name": "roof", "at": 410.0, "top": 32.5}])
    (at_car, frames), (car,) = clearance_tracks(s, quasi_static(s)).values()
    assert at_car.value.size == car.value.size == 0
    assert frames.value.size > 10


def test_ground_is_linear_and_says_nothing_outside_its_points():
    s = scene_with_changes(ground=[[100.0, 40.0], [200.0, 30.0], [300.0, 50.0]])
    r = quasi_static(s)
    (rope, _), (car,) = clearance_tracks(s, r).values()
    inside = (r.x >= 100.0) & (r.x <= 300.0)
    at_steps = np.isin(car.t, r.t)
    assert at_steps.sum() == inside.sum()
    assert car.t.size == at_steps.sum() + 3  # where it passes a point of the ground
    there = np.interp(r.x[inside], [100.0, 200.0, 300.0], [40.0, 30.0, 50.0]) - r.y[inside] - 2.0
    np.testing.assert_allclose(car.value[at_steps], there, rtol=0.0, atol=1e-12)
    assert np.nanmin(rope.value) >= np.nanmin(car.value) + 2.0 - 1e-6
    assert np.interp(rope.s[np.nanargmin(rope.value)], r.fields.s, r.fields.x) == pytest.approx(200.0, rel=0.0, abs=1.0)


def test_the_profile_holds_every_place_of_the_car():
    r = quasi_static(scene_with_changes())
    p = answers.profile_columns(r)
    assert (p["y_highest"] <= p["y_rest"] + 1e-9).all()
    assert (p["y_lowest"] >= p["y_rest"] - 1e-9).all()
    assert (np.interp(r.x, p["x"], p["y_lowest"]) >= r.y - 1e-2).all()
    assert p["tension_max"].max() == pytest.approx(r.fields.T.max(), rel=2e-3)
    flat = answers.profile_columns(quasi_static(scene_with_changes(mass__mass=0.01)))
    assert np.ptp(flat["y_lowest"] - flat["y_rest"]) < 1e-3  # without a rider the rope stays at rest


def test_the_profile_holds_the_way_to_a_turn_of_the_car():
    """The last step before a turn was left out: a sound check read back a profile that was "not what was computed"."""
    there_and_back = {
        "t": np.arange(4.0),
        "x": np.array([0.0, 200.0, 390.0, 210.0]),
        "y": np.array([0.0, 60.0, 80.0, 0.0]),
    }
    p = answers.profile_columns(dataclasses.replace(quasi_static(scene_with_changes()), **there_and_back))
    on_the_way = (p["x"] > 200.0) & (p["x"] < 390.0)
    way = np.interp(p["x"][on_the_way], there_and_back["x"][:3], there_and_back["y"][:3])
    np.testing.assert_allclose(p["y_lowest"][on_the_way], way, rtol=1e-12, atol=0.0)


def test_a_clearance_of_what_is_never_passed_is_null(tmp_path):
    """The command ended in a trace where a rider stopped before the tree."""
    scene = Scene.load("rollback").replace({"obstacle": [{"name": "tree", "at": 299.0, "top": 30.0}]})
    r = quasi_static(scene)
    rows = {d["quantity"]: d for d in design_numbers(r)}
    assert rows["clearance_car_min:tree"]["value"] is None
    assert rows["clearance_rope_min:tree"]["value"] > 0.0
    r = dataclasses.replace(r, design=list(rows.values()))
    write_summary_and_profile(tmp_path, scene, r)
    kept = json.loads((tmp_path / "summary.json").read_text())["design"]
    assert {"clearance_car_min:tree": None}.items() <= {d["quantity"]: d["value"] for d in kept}.items()
    assert design_row_texts(rows["clearance_car_min:tree"])["value"] == "the car never passes"
    assert "clearance_car_min:tree" not in {d["quantity"] for d in key_numbers(kept)}
    assert "hit" not in outcome_of_run(scene, r).sentence


@pytest.mark.parametrize("steps", [300, 301, 304, 305, 309, 311])
def test_a_run_that_ends_where_it_falls_slack_says_so(steps):
    """The position of the onset is rounded: some of these runs end just before it, some just past it."""
    steep = Scene.from_groups(sag_ratio=0.0164, slope=38.76, mu=0.884, alpha=6350.0, speed_ratio=0.66)
    onset = Run(steep, "fourier-kink", terms=8, steps=steps).run_to(0.95).slack_onset_position_or_inf
    r = Run(steep, "fourier-kink", terms=8, steps=steps).run_to(onset)
    assert r.reached == pytest.approx(r.slack_onset_position_or_inf, abs=1e-12)
    said = outcome_of_run(steep, r)
    assert "goes slack" in said.sentence
    assert recomputed.recomputed_outcome_row(r, None, said.kind, said.sentence).verdict is Verdict.AGREE


@pytest.mark.parametrize(
    ("changes", "clause"),
    [
        ({"slack_onset": 0.96}, ""),  # a run that blows up beside the far support
        ({"status": "incomplete", "reason": "Newton's method stalled", "slack_onset": 0.96}, "ends at"),
        ({"status": "incomplete", "reason": "Newton's method stalled", "cause": "Newton stalled"}, "ends at"),
        ({"slack_onset": 0.85}, "goes slack when the mass is at"),
    ],
)
def test_what_happens_beside_the_far_support_is_no_outcome(changes, clause):
    """No answer converges there: a car of 2 kN slackened a rope of 60 kN, or the outcome was that the run broke."""
    scene = Scene(
        cable={"mass_per_length": 2.0, "EA": 2e7, "horizontal_tension": 60e3}, supports={"span": 300.0, "drop": 30.0},
        mass={"mass": 200.0}, travel={"kind": "constant_speed", "speed": 20.0},
    )  # fmt: skip
    r = run(scene, "fourier-kink", terms=10, steps=300)
    assert (r.status, r.slack_onset) == ("complete", None)
    r = dataclasses.replace(r, **changes)
    end = outcome_of_run(scene, r)
    crosses = f"crosses the cable in {scene.length / 20.0:.1f} s"
    assert (end.kind, end.sentence[: len(crosses)]) == ("crossed", crosses)
    assert clause in end.sentence
    assert ("; " in end.sentence) is bool(clause)
    assert recomputed.recomputed_outcome_row(r, None, *end).verdict is Verdict.AGREE
    onsets = [row for row in design_numbers(r) if row["quantity"] == "slack_onset"]
    assert bool(onsets) is (r.slack_onset == 0.85)
