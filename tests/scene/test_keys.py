"""What a scene file may hold is read off the models; what is not modelled says so; other scenes from one."""

import tomllib

import pytest

from cablefem import Scene, SceneError
from cablefem.scene import ConstantSpeed
from cablefem.scene.keys import json_schema, list_keys, unit_of_key
from cablefem.scene.line import Line
from cablefem.scene.short import LineOfOneSpan
from tests.scene.test_faults import GOOD, TRAVEL, scene_faults
from tests.scene.test_timetables import OBSTACLES

FREE = GOOD.replace(f"[travel]\n{TRAVEL}", '[drive]\nmode = "free"\n')


@pytest.mark.parametrize("part", [Scene, Line])
def test_every_key_has_a_unit_a_meaning_and_a_range(part):
    found = {(key.name, key.kind): key for key in list_keys(part)}
    assert len(found) == len(list(list_keys(part)))
    for key in found.values():
        assert key.unit, key
        assert key.admits, key
        assert key.meaning or key.name.split(".")[-1] in ("mass", "gravity"), key


def test_a_line_of_one_span_has_units_of_both_ways_to_write_it():
    """A grid of `mass.mass`, and an answer of find, had no unit where the car has wheels or a cabin."""
    keys = ("mass.mass", "supports.drop", "travel.top_speed", "car.car.mass", "cable.length")
    assert [unit_of_key(LineOfOneSpan, key) for key in keys] == ["kg", "m", "m/s", "kg", "m"]


def test_keys_are_those_that_scenes_read():
    found = {key.name: key for key in list_keys(Scene)}
    assert (found["cable.EA"].unit, found["cable.EA"].default) == ("N", "-")
    assert (found["drive.air_density"].default, found["wind.drag_coefficient"].default) == ("1.2", "1.2")
    assert (found["cable.damping"].unit, found["cable.damping"].default) == ("-", "0.0")
    assert (found["cable.damping.rate"].unit, found["cable.damping.rate"].default) == ("1/s", "required")
    assert found["travel.jerk"].unit == "m/s3"
    assert found["travel.jerk"].kind == "trapezoid"
    assert found["travel.from"].short_admits == "> 0"
    assert "road" in found["obstacle.0.kind"].short_admits
    assert {"drive.brake.0.from", "drive.thrust.times", "obstacle.0.top", "ground", "travel.stop.time"} <= found.keys()
    assert not any("place" in name and "end" not in name for name in found), "keys are as they are written"


def test_keys_of_a_travel_stand_once_and_name_the_axis_of_lines_of_several_spans():
    keys = [key for key in list_keys(Line) if key.name.startswith("car.0.travel.")]
    assert [key.kind for key in keys if key.name == "car.0.travel.from"] == [""]
    positions = {key.name.rpartition(".")[2]: key.meaning for key in keys}
    for name in ("from", "to", "positions"):
        assert "along the cable, in x if hauled on several spans" in positions[name]


def test_speeds_and_accelerations_of_a_travel_name_the_axis_too():
    rates = [x for x in list_keys(Line) if x.name.startswith("car.0.travel.") and x.unit in ("m/s", "m/s2")]
    assert {x.name.rpartition(".")[2] for x in rates} >= {"speed", "top_speed", "acceleration", "deceleration"}
    for key in rates:
        assert "along the cable, in x if hauled on several spans" in key.meaning, key.name


def test_the_key_of_a_shoe_says_on_what_curve_a_car_runs_there():
    shoe = next(key for key in list_keys(Line) if key.name == "contact.0.shoe")
    for words in ("degree five", "slope and curvature"):
        assert words in shoe.meaning


def test_a_printed_key_is_taken_by_replace():
    scene = Scene.from_toml(FREE + "brake = [{from = 280.0, force = 300.0}]" + OBSTACLES)
    for name in ("mass.mass", "drive.brake.0.force", "obstacle.0.top", "supports.drop"):
        assert name in {key.name for key in list_keys(Scene)}
        assert scene.replace({name: 31.5}) != scene
    with pytest.raises(SceneError, match=r"write drive.brake.0.force"):
        scene.replace({"drive.brake.force": 400.0})


def schema_violations(value, rule, where="", known=None):
    """Return where a value breaks a JSON schema, as far as this project's schemas go."""
    known = known or rule["$defs"]
    if "$ref" in rule:
        return schema_violations(value, known[rule["$ref"].split("/")[-1]], where, known)
    if options := rule.get("anyOf") or rule.get("oneOf"):
        told = [schema_violations(value, option, where, known) for option in options]
        return [] if [] in told else told[0]
    kinds = {"object": dict, "array": list, "string": str, "number": int | float, "boolean": bool}
    asked = rule.get("type", ())
    if asked and not any(isinstance(value, kinds[x]) for x in ([asked] if isinstance(asked, str) else asked)):
        return [where]
    if "enum" in rule or "const" in rule:
        return [] if value in rule.get("enum", [rule.get("const")]) else [where]
    if isinstance(value, dict):
        own = rule["properties"]
        missing = [f"{where}.{key}" for key in rule.get("required", ()) if key not in value]
        inner = [
            x for key in value.keys() & own for x in schema_violations(value[key], own[key], f"{where}.{key}", known)
        ]
        return [*missing, *inner, *(f"{where}.{key}" for key in value.keys() - own)]
    if isinstance(value, list):
        return [
            x
            for i, item in enumerate(value)
            for x in schema_violations(item, rule.get("items", {}), f"{where}[{i}]", known)
        ]
    return [where] if "minimum" in rule and not value >= rule["minimum"] else []


@pytest.mark.parametrize("name", Scene.library())
def test_built_in_scenes_keep_the_schema(name):
    assert schema_violations(tomllib.loads(Scene.library_text(name)), json_schema(Scene)) == []


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("EA = 4e6", "ea = 4e6", ".cable.ea"),
        ("EA = 4e6", "EA = -1", ".cable.EA"),
        ("span = 320.0", "", ".supports.span"),
    ],
)
def test_the_schema_sees_what_the_scene_refuses(old, new, where):
    text = GOOD.replace(old, new)
    assert where in schema_violations(tomllib.loads(text), json_schema(Scene))
    with pytest.raises(SceneError):
        Scene.from_toml(text)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("EA = 4e6", "EA = 4e6\nbending = 3.0", "cable.bending: not modelled: the cable bends without resistance"),
        ("drop = 25.0", "drop = 25.0\ncounterweight = 1e4", "supports.counterweight: not modelled: the two ends of"),
        ("EA = 4e6", "EA = 4e6\ncreep = 1e-4", "cable.creep: not modelled: the cable keeps its unstretched length"),
        ("mass = 75.0", "mass = [75.0, 60.0]", "mass.mass = [75.0, 60.0]: not modelled: one car rides on the cable"),
        ("mass = 75.0", "mass = 75.0\nhanger = 2.0", "mass.hanger: not modelled: run and check alone take it"),
    ],
)
def test_what_is_not_modelled_is_said(old, new, expected):
    (line,) = scene_faults(GOOD.replace(old, new, 1) if "mass" not in old else GOOD.replace("mass = 75.0", new))
    assert line.startswith(expected)


def test_a_temperature_in_kelvin_is_remarked():
    warm = GOOD.replace("EA = 4e6", "EA = 4e6\ntemperature = 35.0\nreference_temperature = 20.0\nexpansion = 1.2e-5")
    assert Scene.from_toml(warm).notes == []
    (note,) = Scene.from_toml(warm.replace("35.0", "293.15")).notes
    assert note.startswith("cable.temperature = 293.15 C")
    assert note.endswith("were kelvin meant? (20 C)")


@pytest.mark.parametrize(
    ("rope", "meant"),
    [
        ("EA = 4e6\ndiameter = 12.0", "cable.diameter = 12 m is that of no rope; were mm meant? (0.012 m)"),
        ("E = 1e11\nsection = 66.2", "cable.section = 66.2 m2 is that of no rope; were mm2 meant? (6.62e-05 m2)"),
    ],
)
def test_a_rope_measured_in_mm_is_remarked(rope, meant):
    assert Scene.from_toml(GOOD.replace("EA = 4e6", rope)).notes == [meant]


def test_a_modulus_in_GPa_is_refused_as_what_was_written():
    fault, *_ = scene_faults(GOOD.replace("EA = 4e6", "E = 100.0\nsection = 50e-6"))
    assert fault.startswith("cable.EA = 0.005 (E section): must be > ")


def test_a_ride_without_friction_and_a_hurricane_are_remarked():
    assert Scene.from_toml(GOOD).notes == []
    assert Scene.from_toml(FREE).notes == ["no friction, no drag given: the fastest possible ride"]
    assert Scene.from_toml(FREE + "rolling_friction = 0.02").notes == []
    (note,) = Scene.from_toml(FREE + "drag_area = 0.5\nwind = -45").notes
    assert "were km/h meant? (-12.5 m/s)" in note


def test_other_scenes_by_dotted_keys():
    scene = Scene.from_toml(FREE + "drag_area = 0.5\nbrake = [{from = 280.0, force = 300.0}]" + OBSTACLES)
    other = scene.replace({"mass.mass": 60.0, "drive.brake.0.force": 400.0, "obstacle.tree.top": 20.0})
    assert (other.mass.mass, other.drive.brake[0].force, other.obstacle[0].top) == (60.0, 400.0, 20.0)
    assert other.replace({"mass.mass": 75.0, "drive.brake.0.force": 300.0, "obstacle.tree.top": 22.0}) == scene
    assert scene.replace({"mass.mass": "+10%"}).mass.mass == pytest.approx(82.5)
    grid = scene.variants({"mass.mass": [40.0, 80.0], "drive.wind": [-8.0, -4.0, 0.0]})
    assert [(x.mass.mass, x.drive.wind) for x in grid[:4]] == [(40.0, -8.0), (40.0, -4.0), (40.0, 0.0), (80.0, -8.0)]
    assert len(grid) == 6
    for wrong in ({"mass.mass": -3.0}, {"mass.weight": 3.0}, {"drive.brake.4.force": 1.0}, {"obstacle.hut.top": 1.0}):
        with pytest.raises(SceneError) as raised:
            scene.replace(wrong)
        assert len(raised.value.faults) == 1


def test_a_copy_of_a_scene_is_checked_and_a_dump_goes_back_in():
    scene = Scene.from_toml(FREE + "brake = [{from = 280.0, force = 300.0}]\nend = {place = 300.0}")
    assert Scene(**scene.model_dump()) == scene
    with pytest.raises(SceneError, match=r"^mass = 5000.0: must be a table \[mass\]"):
        scene.model_copy(update={"mass": 5000.0})
    slow = Scene.from_toml(GOOD).model_copy(update={"travel": ConstantSpeed(speed=3.0)})
    assert slow.top_speed == 3.0
    assert slow.groups != Scene.from_toml(GOOD).groups
