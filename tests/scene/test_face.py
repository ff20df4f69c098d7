"""`import cablefem as cf`: light, and every public name is there; names of scenes do where scenes do."""

import json
import math
import pickle

import numpy as np
import pytest

import cablefem as cf
import validation


@pytest.mark.parametrize("module", [cf, validation], ids=["cablefem", "validation"])
def test_every_name_listed_is_there_and_says_what_it_does(module):
    for name in dir(module):
        assert getattr(module, name) is not None or name.startswith("__"), name
    for name in set(module.__all__) - {"__version__"}:
        assert getattr(module, name).__doc__, name


def test_names_are_scenes():
    by_name, by_scene = cf.quasi_static("zipline"), cf.quasi_static(cf.Scene.load("zipline"))
    assert by_name.events == by_scene.events
    with pytest.raises(cf.SceneError, match="no built-in scene"):
        cf.quasi_static("zip-lin")
    for module in (cf, validation):
        with pytest.raises(AttributeError, match="no attribute 'rune'"):
            module.rune  # noqa: B018


@pytest.mark.parametrize("load", [cf.Scene.load, cf.Line.load, cf.check, cf.quasi_static])
def test_what_is_neither_name_nor_path_is_refused_in_a_sentence(load):
    for given in (5, None):
        with pytest.raises(TypeError, match=rf"scene must be .*(name|Scene).*, got {given}$"):
            load(given)


@pytest.mark.parametrize("steps", ["10", True, math.nan, math.inf, 10.5])
def test_a_number_of_steps_is_an_integer(steps):
    with pytest.raises(ValueError, match=r"steps must be an integer, got (?!\d+$)"):
        cf.run("level", "fourier", terms=4, steps=steps)


def test_a_scene_of_one_span_is_no_line():
    with pytest.raises(cf.SceneError, match=r"contact: missing; must be a list of tables \[\[contact\]\]"):
        cf.Line.load("zipline")


def test_lines_at_rest_are_taken_too():
    line = cf.Line.load("two-span").replace({"car.up.at": [300.0, 690.0], "car.down.at": [738.0, 1128.0]})
    checked = cf.check(line)
    assert checked.verdict.value == "agree"
    assert "two-span: agree" in repr(checked)
    assert cf.run(line).design[0]["value"] == pytest.approx(checked.design[0]["value"], rel=1e-9)
    assert len(repr(cf.run("two-span"))) < 120
    assert cf.quasi_static(line).design[0]["value"] == pytest.approx(checked.design[0]["value"], rel=1e-9)
    with pytest.raises(TypeError, match="a line takes no method and no settings: too many positional"):
        cf.run(line, "following-p2")
    for of in (line, "two-cars"):
        with pytest.raises(ValueError, match=r"--tol (in m )?must lie in"):
            cf.check(of, tol=7.0)
        with pytest.raises(ValueError, match="--tol-tension must lie in"):
            cf.check(of, tol_tension=-1.0)


def test_scripts_of_0_3_0_find_arrival_and_place():
    scene, line = cf.Scene.load("zipline"), cf.Line.load("two-span")
    assert scene.arrival == scene.arrival_time > 0.0
    assert line.place(line.car[0], 1) == line.position_of(line.car[0], 1) == line.car[0].at[1]


def test_a_line_has_variants_and_says_what_it_is():
    line = cf.Line.load("two-cars")
    assert [x.car[0].mass for x in line.variants({"car.up.mass": [3000.0, 3100.0]})] == [3000.0, 3100.0]
    for text in (repr(line), line._repr_html_()):
        assert "anchor        mountain at x = 900 m, depth -250 m" in text
        assert "car           down, 2400 kg, haul, trapezoid" in text
    for name in cf.Line.library():
        assert len(str(cf.Line.load(name)).splitlines()) > 3


def test_a_new_length_of_a_line_takes_the_place_of_its_tension():
    line = cf.Line.load("two-cars")
    longer = line.replace({"cable.length": 935.0})
    assert longer.cable.tension is None
    assert longer.replace({"cable.tension": {"at": "valley", "value": 4e5}}).cable.length is None
    assert line.replace({"cable.tension.value": 4e5}).cable.tension.at == "mountain"


@pytest.mark.parametrize("grid", [None, 3, [("mass.mass", [1.0])], {"mass.mass": None}, {"mass.mass": np.array(60.0)}])
def test_a_grid_that_is_none_is_refused_in_a_sentence(grid):
    with pytest.raises(TypeError, match="grid must map each dotted key to a list of values"):
        cf.Scene.load("zipline").variants(grid)


def test_keys_of_changes_are_text():
    with pytest.raises(TypeError, match="changes must be a mapping of dotted keys"):
        cf.Scene.load("zipline").replace({3: 4.0})


def test_a_name_is_on_one_line():
    with pytest.raises(cf.SceneError, match="name = 'zip"):
        cf.Scene.load("zipline").replace({"name": "zip\n"})


def test_the_second_scene_is_of_the_kind_of_the_first():
    with pytest.raises(TypeError, match="second must be a Scene"):
        cf.check("level", second="level")
    with pytest.raises(TypeError, match="second must be a Line"):
        cf.check("two-span", second=cf.Scene.load("level"))
    with pytest.raises(TypeError, match="at rest or in motion as the first"):
        cf.check("two-span", second=cf.Line.load("two-cars"))


def test_what_no_method_computes_is_said():
    with pytest.raises(ValueError, match="quasi_static computes it"):
        cf.run("level", model="quasi-static")
    with pytest.raises(ValueError, match="model = None: unknown"):
        cf.run("level", model=None)
    with pytest.raises(ValueError, match="'bare' has no car"):
        cf.check("bare")
    for methods in (None, ("following-p2",), (1, 2)):
        with pytest.raises(ValueError, match=r"methods = .*: must be two|unknown method .1.\."):
            cf.check("level", methods=methods)
    with pytest.raises(ValueError, match=r"until must lie in \[0.8, 1\]"):  # rows beyond would be missing
        cf.check("level", until=0.3)


@pytest.mark.parametrize(
    ("changed", "message"),
    [({"model": "ful"}, "model = 'ful': must be"), ({"so_that": None}, "so_that = None: must be a text"),
     ({"keys": {"mass.mass": ("a", "b")}}, "mass.mass = 'a': must be a finite number"),
     ({"all_of": {"drive.wind": -1.0}}, "all_of = .*lists of values")],
)  # fmt: skip
def test_find_names_what_it_cannot_take(changed, message):
    arguments = {"keys": {"mass.mass": (40.0, 200.0)}, "so_that": "tension_max <= 20 kN"} | changed
    with pytest.raises(ValueError, match=message):
        cf.find("zipline", **arguments)


def test_a_quasi_static_ride_has_design_numbers_with_bars():
    numbers = {row["quantity"]: row for row in cf.quasi_static("zipline").design}
    assert numbers["tension_max"]["value"] > 10.0 * numbers["tension_max"]["bar"] > 0.0


def test_answers_to_lines_are_written_as_others_and_checks_have_an_outcome(tmp_path):
    answer = cf.run("two-span")
    answer.write(str(tmp_path))
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == answer.outcome.sentence
    checked = cf.check("level", tol=0.2, ask="path")
    assert checked.outcome.kind == "crossed"
    assert checked.outcome.sentence in repr(checked)


@pytest.mark.parametrize("name", sorted(set(cf.__all__) - {"__version__"}))
def test_every_public_name_goes_to_other_processes(name):
    assert pickle.loads(pickle.dumps(getattr(cf, name))) is getattr(cf, name)


def test_what_is_no_study_is_refused_in_a_sentence(tmp_path):
    with pytest.raises(TypeError, match="study must be a Study, its name or its file, got 3"):
        cf.sweep(3, tmp_path)
