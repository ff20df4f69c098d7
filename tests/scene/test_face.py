"""`import cablefem as cf`: light, and every public name is there; names of scenes do where scenes do."""

import math

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
    with pytest.raises(TypeError, match="a line takes no method and no settings, only rest: too many positional"):
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
