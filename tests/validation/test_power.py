"""What a verdict is worth: a scene told wrongly to one solver is seen, and said to be seen."""

from cablefem import Scene
from validation import check
from validation.commands.check.sensitivity import (
    detectable_changes_sentence,
    detectable_relative_changes,
)
from validation.commands.sweep.families import SOUND, scene_and_fault_key
from validation.page.scene_keys import dotted_keys_and_values

INCLINED = Scene.load("inclined")


def test_a_fault_of_one_percent_is_seen_and_as_small_a_one_as_is_said():
    """The second solver is told another mass: beyond what the sound check says it would notice it disagrees."""
    sound = check(INCLINED, tol=0.1, second=INCLINED)
    assert sound.verdict.value == "agree"
    found = detectable_relative_changes(sound)
    assert {"mass.mass", "cable.EA", "supports.span"} <= set(found)
    assert 0.0 < found["mass.mass"] < 0.05
    assert "mass.mass" in detectable_changes_sentence(found)
    percent = 300.0 * found["mass.mass"]
    fault = check(INCLINED, tol=0.1, second=INCLINED.replace({"mass.mass": f"+{percent:.6f}%"}))
    assert fault.verdict.value == "disagree"


def test_a_fault_below_the_digits_of_a_number_is_any_change_of_it():
    """Rows with a bar of rounding alone, as of timetables and catenaries, printed 1.4e-13 %."""
    found = {"travel.from": 1.4e-15, "cable.EA": 2e-9, "mass.mass": 1.7e-4}
    assert detectable_changes_sentence(found) == "would notice: any change of travel.from, cable.EA, mass.mass 0.017 %"


def test_a_station_on_the_edge_of_the_jump_is_no_disagreement():
    """Stations as far from the car as is left out around it are in or out in both computations of an error."""
    scene, fault = scene_and_fault_key(81126, 40)
    assert fault is None
    assert check(scene, tol=1e-3).verdict.value == "agree"


def test_keys_are_the_numbers_of_the_tables():
    data = {"cable": {"EA": 1e6}, "brake": [{"from": 3.0, "force": 0.0}], "car": [{"name": "up", "at": [1.0, 2.0]}]}
    by_number = {"cable.EA": 1e6, "brake.0.from": 3.0, "brake.0.force": 0.0, "car.0.name": "up", "car.0.at": [1.0, 2.0]}
    assert dict(dotted_keys_and_values(data)) == by_number
    by_name = {key.replace("car.0", "car.up"): value for key, value in by_number.items()}
    assert dict(dotted_keys_and_values(data, by_name=True)) == by_name


def test_cases_of_the_study_are_the_families_in_turn_and_sound_ones_have_no_fault():
    names = [scene_and_fault_key(11, number)[0].name for number in range(6)]
    assert names == 2 * ["gripped", "hauled", "free"]
    assert {scene_and_fault_key(11, number)[1] for number in range(SOUND)} == {None}
    faults = [scene_and_fault_key(11, SOUND + number) for number in range(45)]
    given = {key for _, key in faults}
    assert given >= {"mass.mass", "cable.EA", "cable.mass_per_length"}
    assert {key for key in given if key.startswith("travel.")} & {"travel.speed", "travel.top_speed"}
    assert all(isinstance(scene.replace({key: "+1%"}), Scene) for scene, key in faults if key)
    faults = [scene_and_fault_key(11, SOUND + number, "wide") for number in range(90)]
    assert " ".join(x.name for x, _ in faults[:9]) == "gripped hauled free fibre slack steep iced stopped windy"
    more = {"drive.rolling_friction", "drive.drag_area", "drive.brake.0.force", "supports.drop"}
    assert {key for _, key in faults} >= more
    assert all(isinstance(scene.replace({key: "+1%"}), Scene) for scene, key in faults if key)
    assert (
        scene_and_fault_key(11, 4)[0].to_toml()
        == scene_and_fault_key(11, 4)[0].to_toml()
        != scene_and_fault_key(12, 4)[0].to_toml()
    )
