"""Scenes: the paper's data, the groups, round trips and variants."""

import math
import pickle
from importlib import resources

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cablefem import Scene, SceneError
from cablefem.scene import ConstantSpeed

BUILT_IN = list(Scene.library())
TRAVELS = ("constant_speed", "constant_acceleration", "accelerate_cruise_brake")


@st.composite
def scene_numbers(draw):
    """The random scenes of the project: sag/span 0.005-0.2, slope 0-45 deg, mu 0.05-5, alpha 50-1e4, V/c 0.1-0.8."""
    return {
        "sag_ratio": draw(st.floats(0.005, 0.2)),
        "slope": draw(st.floats(-45.0, 45.0)),
        "mu": draw(st.floats(0.05, 5.0)),
        "alpha": draw(st.floats(50.0, 1e4)),
        "speed_ratio": draw(st.floats(0.1, 0.8)),
        "travel": draw(st.sampled_from(TRAVELS)),
        "span": draw(st.floats(20.0, 4000.0)),
        "rho": draw(st.floats(0.2, 30.0)),
        "gravity": draw(st.floats(1.5, 25.0)),
    }


def test_level_is_the_paper_s_cable():
    scene = Scene.load("level")
    ((t0, t1),) = scene.groups.motion.phases
    V = math.sqrt(scene.sigma)
    for found, known, digits in (
        (scene.length, 2002.3720103, 1e-15), (scene.sigma, 0.1688832, 1e-8),  # the seven printed digits
        (scene.alpha, 844.416, 5e-8), (scene.sigma / scene.alpha, 1.0 / 5000.0, 1e-14), (scene.mu, 1.0, 1e-15),
        (scene.irvine, 24.08404, 2e-6),  # sigma^2 alpha of the rounded values
        (V, 0.41095, 2e-5), (scene.speed_ratio, V, 1e-14),
        (scene.groups.motion.position_with_rates(t0, 0)[1], V, 1e-14),
        (t1, 1.0 / V, 1e-14), (scene.arrival_time, t1 * scene.time_scale, 1e-14),
    ):  # fmt: skip
        assert found == pytest.approx(known, rel=digits)


def test_cruise_and_bare_are_the_same_cable():
    level = Scene.load("level").groups
    for name in ("cruise", "bare"):
        groups = Scene.load(name).groups
        assert (groups.sigma, groups.alpha, groups.c) == (level.sigma, level.alpha, level.c)
    bare = Scene.load("bare")
    assert (bare.mass, bare.travel, bare.mu, bare.groups.motion) == (None, None, 0.0, None)
    assert (bare.top_speed, bare.speed_ratio, bare.arrival_time) == (None, None, None)
    cruise = Scene.load("cruise")
    assert cruise.groups.motion.top_speed == pytest.approx(math.sqrt(cruise.sigma), rel=1e-14)
    assert len(cruise.groups.motion.phases) == 3


def test_inclined_is_the_paper_s_cable_with_its_right_support_lower():
    scene = Scene.load("inclined")
    assert scene.supports.drop == 90.0
    assert scene.groups.chord_sin > 0.0
    assert scene.catenary.y(scene.length) == pytest.approx(90.0, rel=1e-14)
    assert scene.sigma == pytest.approx(0.06473, abs=5e-6)
    assert scene.alpha == pytest.approx(323.7, abs=0.05)
    s, ds, dds = scene.groups.motion.position_with_rates(0.0, 0)
    assert (s, ds) == (0.0, 0.0)
    assert dds == pytest.approx(scene.sigma, rel=1e-14)  # a = g: s_o* = sigma t*^2/2


@pytest.mark.parametrize("name", ["tramway", "zipline", "kevlar"])
def test_scenes_from_life_are_ridden_far_below_the_wave_speed_and_hang_tightly(name):
    scene = Scene.load(name)
    assert "Assumed" in Scene.library_text(name)
    assert 0.01 < scene.speed_ratio < 0.3
    assert 0.01 < scene.sag_ratio < 0.06
    assert 0.1 < scene.mu < 1.0
    assert 1e-3 < 1.0 / scene.alpha < 5e-3  # static strain of steel and aramid ropes in use


def test_the_library_lists_every_file_and_only_these():
    folder = resources.files("cablefem.scene") / "library"
    files = [entry.name for entry in folder.iterdir() if entry.is_file()]
    assert sorted(BUILT_IN) == sorted(name.removesuffix(".toml") for name in files)
    assert BUILT_IN[:4] == ["level", "cruise", "inclined", "bare"]
    assert all(Scene.library().values())
    with pytest.raises(SceneError, match="Did you mean zipline"):
        Scene.library_text("zip-line")


@given(scene_numbers())
@settings(deadline=None, max_examples=60)
def test_from_groups_gives_the_groups_asked_for(choice):
    scene = Scene.from_groups(**choice)
    for name in ("sag_ratio", "slope", "mu", "alpha", "speed_ratio"):
        assert getattr(scene, name) == pytest.approx(choice[name], rel=1e-12, abs=1e-12), name
    assert (scene.travel.kind, scene.gravity) == (choice["travel"], choice["gravity"])
    assert Scene.from_toml(scene.to_toml()) == scene
    groups = scene.groups
    assert (groups.mu, groups.alpha, groups.sigma) == (scene.mu, scene.alpha, scene.sigma)
    assert math.hypot(groups.chord_cos, groups.chord_sin) == pytest.approx(1.0, rel=1e-15)
    x, y = groups.coordinates(1.0)
    chord = scene.chord / scene.length
    np.testing.assert_allclose([x, y], [groups.chord_cos * chord, groups.chord_sin * chord], rtol=0.0, atol=1e-13)
    assert groups.motion.end_position == 1.0
    assert groups.motion.top_speed == pytest.approx(choice["speed_ratio"], rel=1e-12)
    assert scene.wave_speed * math.sqrt(scene.alpha) == pytest.approx(scene.axial_speed, rel=1e-14)


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_scenes_round_trip_and_differ_when_changed(name):
    scene = Scene.load(name)
    text = scene.to_toml()
    again = Scene.from_toml(text)
    assert again == scene
    assert again.to_toml() == text
    assert again.groups == scene.groups
    assert pickle.loads(pickle.dumps(scene)) == Scene(**scene.model_dump()) == scene
    changed = scene.variant(alpha=1.01 * scene.alpha)
    assert changed != scene
    assert Scene.from_toml(changed.to_toml()) == changed


def test_a_scene_file_is_named_after_itself_unless_it_says_otherwise(tmp_path):
    text = Scene.library_text("cruise")
    path = tmp_path / "my first scene (copy).toml"
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())  # as Windows editors leave it
    scene = Scene.load(path)
    assert scene.name == "my-first-scene-copy"
    assert scene.groups == Scene.load("cruise").groups
    path.write_text('name = "other"\n' + text, encoding="utf-8")
    assert Scene.load(str(path)).name == "other"


def test_variant_changes_what_it_names_and_keeps_the_rest_in_si():
    scene = Scene.load("tramway")
    other = scene.variant(mu=0.31, alpha=777.0, speed_ratio=0.12, name="other")
    assert (other.name, other.title) == ("other", scene.title)
    np.testing.assert_allclose([other.mu, other.alpha, other.speed_ratio], [0.31, 777.0, 0.12], rtol=1e-14)
    assert (other.cable.horizontal_tension, other.supports) == (scene.cable.horizontal_tension, scene.supports)
    assert other.travel.kind == scene.travel.kind
    deeper = scene.variant(sag_ratio=0.09, mu=0.31)
    np.testing.assert_allclose([deeper.sag_ratio, deeper.mu], [0.09, 0.31], rtol=1e-13)
    assert (deeper.cable.EA, deeper.travel) == (scene.cable.EA, scene.travel)
    assert deeper.horizontal_tension < 0.4 * scene.horizontal_tension
    slow = scene.variant(travel=ConstantSpeed(speed=3.5))
    assert slow.top_speed == 3.5
    of_wires = scene.replace({"cable.E": 1.6e11, "cable.section": scene.cable.EA / 1.6e11}).variant(alpha=777.0)
    assert (of_wires.alpha, of_wires.cable.E) == (pytest.approx(777.0, rel=1e-14), 1.6e11)
    with pytest.raises(SceneError, match="bare cable has no travel"):
        Scene.load("bare").variant(speed_ratio=0.2)
    with pytest.raises(SceneError, match=r"^EA = -"):
        scene.variant(alpha=-3.0)


def test_a_section_of_a_scene_with_another_alpha_may_be_changed():
    scene = Scene.load("tramway")
    of_wires = scene.replace({"cable.E": 1.6e11, "cable.section": scene.cable.EA / 1.6e11})
    for alpha in np.linspace(400.0, 900.0, 40):
        cable = of_wires.variant(alpha=alpha).replace({"cable.section": 1e-3}).cable
        assert pytest.approx(1.6e8) == cable.EA


def test_groups_are_computed_once_and_a_scene_is_frozen():
    scene = Scene.load("inclined")
    assert scene.groups is scene.groups
    assert scene.catenary is scene.catenary
    assert scene == Scene.load("inclined")  # whatever has been computed from it
    assert hash(scene) == hash(Scene.load("inclined"))
    with pytest.raises(ValueError, match="frozen"):
        scene.gravity = 1.62
    with pytest.raises(AttributeError):
        scene.groups.mu = 3.0


def test_a_scene_prints_its_data_and_its_groups():
    text = str(Scene.load("level"))
    pieces = ("level: Level cable", "l = 2002.37 m", "mu = 1,", "sigma = 0.16888,", "alpha = 844.42", "V/c = 0.411")
    assert all(piece in text for piece in pieces)
    assert "mass" not in str(Scene.load("bare")).split("\n", 1)[1]
    assert repr(Scene.load("bare")).startswith("<Scene bare:")
