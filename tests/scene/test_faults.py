"""Every fault of a scene: one line, with the field, its value and what is admissible; all of them at once."""

import pickle
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cablefem import Scene, SceneError
from cablefem.scene import Cable
from cablefem.scene.keys import list_keys

GOOD = """
gravity = 3.7
[cable]
mass_per_length = 2.5
EA = 4e6
length = 330.0
[supports]
span = 320.0
drop = 25.0
[mass]
mass = 75.0
[travel]
kind = "constant_speed"
speed = 14.0
"""
TRAVEL = 'kind = "constant_speed"\nspeed = 14.0'
NUMBER = "from 1e-12 to 1e+15"
SHAPES = "exactly one of length, sag, horizontal_tension must be given"
KINDS = "constant_speed, constant_acceleration, accelerate_cruise_brake, trapezoid, table"
CABLE_KEYS = (
    "Known: damping, length, sag, horizontal_tension, mass_per_length, EA, E, section, wire, "
    "diameter, breaking_load, temperature, "
    "reference_temperature, expansion, ice."
)
SCENE_KEYS = "Known: cable, supports, mass, travel, drive, wind, obstacle, ground, name, title, gravity, limits."
# The bounds below were computed apart, in 30 digits: chord hypot(320, 25), catenaries of z = 1e-9 and z = 5,
# and H sqrt(1 + c^2) of the good scene.
CHORD = "320.97507691408066"
LENGTHS = "must be from 320.97507691440165 to 4749.07 with these supports"


def scene_faults(text):
    with pytest.raises(SceneError) as raised:
        Scene.from_toml(text)
    assert str(raised.value) == "\n".join(raised.value.faults)
    assert raised.value.__suppress_context__ or raised.value.__context__ is None  # no library's traceback below it
    return raised.value.faults


def test_the_good_scene_is_good():
    assert Scene.from_toml(GOOD).length == pytest.approx(330.0, rel=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        # numbers that are none, or none that a cable can have
        ("EA = 4e6", 'EA = "stiff"', [f"cable.EA = 'stiff': must be a number > 0, {NUMBER}"]),
        ("EA = 4e6", "EA = true", [f"cable.EA = True: must be a number > 0, {NUMBER}"]),
        ("EA = 4e6", "EA = nan", [f"cable.EA = nan: must be a number > 0, {NUMBER}"]),
        ("EA = 4e6", "EA = 1e16", [f"cable.EA = 1e+16: must be a number > 0, {NUMBER}"]),
        ("EA = 4e6", "", [f"cable.EA: missing; must be a number > 0, {NUMBER}"]),
        ("gravity = 3.7", "gravity = 1979-05-27", [
            f"gravity = datetime.date(1979, 5, 27): must be a number > 0, {NUMBER}",
        ]),
        ("drop = 25.0", "drop = -inf", ["supports.drop = -inf: must be a number from -1e+15 to 1e+15"]),
        ("speed = 14.0", "speed = 1e-13", [f"travel.speed = 1e-13: must be a number > 0, {NUMBER}"]),
        # the cable's one definition, and what has no catenary
        ("length = 330.0", "", [f"cable.length: missing; {SHAPES}"]),
        ("length = 330.0", "length = 330.0\nsag = 8", [f"cable.sag = 8: too much beside length = 330.0; {SHAPES}"]),
        ("length = 330.0", "length = 300.0", [
            f"cable.length = 300.0: {LENGTHS} (the supports are {CHORD} m apart)",
        ]),
        ("length = 330.0", "length = 320.975076914081", [
            f"cable.length = 320.975076914081: {LENGTHS} (for a cable this taut give sag or horizontal_tension)",
        ]),
        ("length = 330.0", "sag = 1e-9", [
            "cable.sag = 1e-09: must be from 8.02438e-08 to 2342.84 with these supports",
        ]),
        ("length = 330.0", "horizontal_tension = 1e-3", [
            "cable.horizontal_tension = 0.001: must be from 296 to 1.48e+12 with these supports",
        ]),
        ("drop = 25.0", "drop = -4e3", ["supports.drop = -4000.0: must be from -3200 to 3200, 10 spans"]),
        ("EA = 4e6", "EA = 500", [
            "cable.EA = 500.0: must be > 4042.41 N, the largest static tension with cable.length = 330.0, "
            "or the cable hangs at more than twice its unstretched length",
        ]),
        # words
        ("length = 330.0", "lenght = 330.0", [
            f"cable.lenght = 330.0: unknown key. Did you mean length? {CABLE_KEYS}",
            f"cable.length: missing; {SHAPES}",
        ]),
        # keys of other meanings are no hints: damping is of the cable in air, expansion of heat, EA no area
        ("EA = 4e6", "EA = 4e6\ninternal_damping = 3", [f"cable.internal_damping = 3: unknown key. {CABLE_KEYS}"]),
        ("EA = 4e6", "EA = 4e6\narea = 3", [f"cable.area = 3: unknown key. {CABLE_KEYS}"]),
        ("EA = 4e6", "EA = 4e6\ntension = 3",
         [f"cable.tension = 3: unknown key. Did you mean horizontal_tension? {CABLE_KEYS}"]),
        ("EA = 4e6", "EA = 4e6\nea = 3", [f"cable.ea = 3: unknown key. Did you mean EA? {CABLE_KEYS}"]),
        ("[supports]", "[suports]", [
            "supports: missing; must be a table [supports]",
            "suports = {'span': 320.0, 'drop': 25.0}: unknown key. Did you mean supports? " + SCENE_KEYS,
        ]),
        ("gravity = 3.7", r'title = "a\nb"', [r"title = 'a\nb': must be text on one line"]),
        ("gravity = 3.7", 'name = "../../x"', [
            "name = '../../x': must be letters, digits, '_', '-' and '.', the first no '-' or '.'",
        ]),
        (TRAVEL, 'kind = "constant_sped"\nspeed = 14.0', [
            f"travel.kind = 'constant_sped': unknown. Did you mean constant_speed? Known: {KINDS}.",
        ]),
        (TRAVEL, "speed = 14.0", [f"travel.kind: missing; must be one of {KINDS}"]),
        # parts that are none, or only half of the pair
        ("[mass]\nmass = 75.0", "[[mass]]\nmass = 75.0", [
            "mass = [{'mass': 75.0}]: not modelled: one car rides on the cable; a line at rest with [[contact]] has it",
        ]),
        (f"[travel]\n{TRAVEL}", "", ["travel: missing; must be given with [mass] (a bare cable has neither)"]),
        ("[mass]\nmass = 75.0", "", ["mass: missing; must be given with [travel] (a bare cable has neither)"]),
        # travel
        (TRAVEL, 'kind = "constant_acceleration"', [
            "travel.acceleration: missing; must be a number from -1e+15 to 1e+15",
        ]),
        (TRAVEL, 'kind = "constant_acceleration"\nacceleration = 0', [
            "travel.acceleration = 0.0: must be > 0 m/s^2 with initial_speed = 0, or the mass never moves",
        ]),
        (TRAVEL, 'kind = "constant_acceleration"\nacceleration = -0.2\ninitial_speed = 11', [
            "travel.acceleration = -0.2: must be >= -0.18333333333333332 m/s^2 with initial_speed = 11.0, "
            "or the mass stops after 302.5 m of 330 m",
        ]),
        (TRAVEL, 'kind = "accelerate_cruise_brake"\ntop_speed = 14\nspeed = 1', [
            "travel.speed = 1: unknown key. Did you mean top_speed? Known: kind, top_speed, from, stop, rest.",
        ]),
        ("speed = 14.0", "speed = 1300.0", [
            "travel: reaches 1300 m/s; must stay < 1264.91 m/s, the speed sqrt(EA/rho) of longitudinal waves",
        ]),
        # tables
        (TRAVEL, 'kind = "table"\ntimes = [0]\npositions = "0, 5"', [
            "travel.times = [0]: must be a list of at least two numbers",
            "travel.positions = '0, 5': must be a list of at least two numbers",
        ]),
        (TRAVEL, 'kind = "table"\ntimes = [0, 1, 2]\npositions = [0, 5]', [
            "travel.positions: 2 values; must be 3, as times",
        ]),
        (TRAVEL, 'kind = "table"\ntimes = [1, 2, 2]\npositions = [3, 9, 8]', [
            "travel.times[0] = 1.0: must be 0, the start",
            "travel.times[2] = 2.0: must be > 2.0, the one before it",
            "travel.positions[0] = 3.0: must be 0, the start",
            "travel.positions[2] = 8.0: must be >= 9.0, the one before it",
        ]),
        (TRAVEL, 'kind = "table"\ntimes = [0, true]\npositions = [0, nan]', [
            f"travel.times[1] = True: must be a number >= 0: 0, or {NUMBER}",
            f"travel.positions[1] = nan: must be a number >= 0: 0, or {NUMBER}",
        ]),
        (TRAVEL, 'kind = "table"\ntimes = [0, 1, 2]\npositions = [0, 100, 331]', [
            "travel.positions[2] = 331.0: must be <= 330.0, the length of the cable",
        ]),
        (TRAVEL, 'kind = "table"\ntimes = [0, 1, 2, 3, 4, 5]\npositions = [0, 5, 90, 91, 92, 170]', [
            "travel.positions[2] = 90.0 to positions[3] = 91.0: the smooth curve through the table runs backwards "
            "at t = 2.876 s, for the mean speed changes from 85 to 1 m/s there; "
            "add rows from 1 to 3 s that say how it changes, or equal positions for a standstill",
        ]),
        (TRAVEL, 'kind = "table"\ntimes = [0, 1, 2, 3, 4]\npositions = [0, 1, 8, 27, 64]', [
            "travel.positions: the mass enters without speed and acceleration; must have one of them at t = 0",
        ]),
    ],
)  # fmt: skip
def test_a_fault_is_one_line_with_field_value_and_range(old, new, expected):
    assert GOOD.count(old) == 1
    assert scene_faults(GOOD.replace(old, new)) == expected


def test_all_faults_come_at_once_from_every_table():
    text = GOOD
    for old, new in (
        ("gravity = 3.7", "gravity = -3.7\ntitel = 'x'"),
        ("EA = 4e6", "EA = 0"),
        ("span = 320.0", "span = 'far'"),
        ("mass = 75.0", "mass = nan"),
        ("speed = 14.0", "sped = 14.0"),
    ):
        text = text.replace(old, new)
    assert [line.split(":")[0] for line in scene_faults(text)] == [
        "gravity = -3.7", "cable.EA = 0", "supports.span = 'far'", "mass.mass = nan", "travel.speed",
        "travel.sped = 14.0", "titel = 'x'",
    ]  # fmt: skip


def test_faults_between_sound_parts_are_said_beside_those_of_other_parts():
    text = GOOD.replace("length = 330.0", "length = 300.0").replace("mass = 75.0", "mass = -1.0")
    assert [line.split(":")[0] for line in scene_faults(text)] == ["mass.mass = -1.0", "cable.length = 300.0"]
    text = GOOD.replace("EA = 4e6", "EA = 500").replace(
        TRAVEL, 'kind = "table"\ntimes = [0, 1, 2]\npositions = [0, 1, 400]'
    )
    assert [line.split(":")[0] for line in scene_faults(text)] == ["cable.EA = 500.0", "travel.positions[2] = 400.0"]


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("[cable\nEA = 3", "line 1, column 7"),
        ("gravity = 9.81\n\nEA = = 3", "line 3, column 6"),
        ("gravity = ", "line 1, column 11"),
        ("a = 1\nb = [1,", "line 2, column 8"),
        ("a = 1\na = 2", "line 2, column 6"),
        ("a = " + "[" * 5000, "nesting"),
        ("a = " + "1" * 5000, "number"),
    ],
)
def test_broken_toml_is_located(text, where):
    (line,) = scene_faults(text)
    assert line.startswith("not valid TOML: ")
    assert where in line


def test_keys_in_the_place_of_tables_are_named():
    assert scene_faults("cable = 5\ntravel = 6\nmass = 2.5") == [
        "cable = 5: must be a table [cable]",
        "supports: missing; must be a table [supports]",
        "mass = 2.5: must be a table [mass]",
        "travel = 6: must be a table [travel]",
    ]


def test_an_integer_of_four_hundred_digits_is_shown_shortened():
    (line,) = scene_faults(GOOD.replace("gravity = 3.7", "gravity = " + "1" * 400))
    assert len(line) < 130
    assert line.startswith("gravity = 1111")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("levle", "scene = 'levle': no built-in scene, no file. Did you mean level? Known: level, cruise,"),
        ("Inclined", "scene = 'Inclined': no built-in scene, no file. Did you mean inclined?"),
        ("nowhere/at-all.toml", "scene = 'nowhere/at-all.toml': no built-in scene, no file. Known: level,"),
        ("x" * 4000, "scene = 'xxxx"),
        ("a\0b", "scene = 'a\\x00b': must be a readable TOML file"),
        ("", "scene = '': must be a readable TOML file (Is a directory)"),
    ],
)
def test_unknown_scenes_suggest_the_nearest(name, expected):
    with pytest.raises(SceneError) as raised:
        Scene.load(name)
    (line,) = raised.value.faults
    assert line.startswith(expected)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(GOOD.encode() + b"# caf\xe9\n")
    with pytest.raises(SceneError, match=r"must be a readable TOML file \('utf-8' codec"):
        Scene.load(path)


def test_python_callers_get_the_same_lines():
    with pytest.raises(SceneError) as raised:
        Cable(mass_per_length=-1, EA=2.0, sag=3.0, horizontal_tension=5.0)
    assert raised.value.faults == [
        f"mass_per_length = -1: must be a number > 0, {NUMBER}",
        f"horizontal_tension = 5.0: too much beside sag = 3.0; {SHAPES}",
    ]
    assert isinstance(raised.value, ValueError)
    assert pickle.loads(pickle.dumps(raised.value)).faults == raised.value.faults
    with pytest.raises(SceneError, match=r"^cable: missing; must be a table \[cable\]"):
        Scene()
    for wrong in ({"sag_ratio": -0.1}, {"slope": 90.0}, {"mu": 0.0}, {"span": float("nan")}, {"travel": "rocket"}):
        with pytest.raises(SceneError):
            Scene.from_groups(**{"sag_ratio": 0.03, "alpha": 350.0, "mu": 0.4, "speed_ratio": 0.2, **wrong})


KNOWN = ["constant_acceleration", "table", 1e-12, 1e15, 1e-3, 320.0, [0.0, 1.0, 2.0], "haul", "free"]
PLAIN = st.floats() | st.integers() | st.booleans() | st.text(max_size=5) | st.none() | st.sampled_from(KNOWN)
VALUES = PLAIN | st.lists(PLAIN, max_size=4) | st.dictionaries(st.text(max_size=5), PLAIN, max_size=2)
TABLES = {
    table: [key.name.split(".")[1] for key in list_keys(Scene) if key.name.startswith(f"{table}.")]
    for table in ("cable", "supports", "mass", "travel", "drive")
}


def test_a_key_of_several_lines_is_one_fault_of_one_line():
    with pytest.raises(SceneError) as refused:
        Scene(**tomllib.loads(GOOD) | {"a\nb": 1})
    assert [fault.partition(":")[0] for fault in refused.value.faults] == ["'a\\nb' = 1"]


@given(st.data())
@settings(deadline=None, max_examples=200)
def test_whatever_is_in_a_scene_it_is_a_scene_or_a_list_of_lines(data):
    """No input leads to another exception, a pydantic text, a second line in a fault, or a scene without groups."""
    scene = tomllib.loads(GOOD)
    for _ in range(data.draw(st.integers(1, 3))):
        table = data.draw(st.sampled_from([*TABLES, "top"]))
        if table == "top":
            scene[data.draw(st.sampled_from([*TABLES, "gravity", "title", "name", "other"]))] = data.draw(VALUES)
        elif isinstance(scene.setdefault(table, {}), dict):
            scene[table] = {**scene[table], data.draw(st.sampled_from(TABLES[table])): data.draw(VALUES)}
    try:
        made = Scene(**scene)
    except SceneError as error:
        lines = error.faults
    else:
        assert made.groups.sigma > 0.0
        assert Scene.from_toml(made.to_toml()) == made
        return
    assert lines
    for line in lines:
        assert not any(foreign in line for foreign in ("\n", "pydantic", "Input should be"))
