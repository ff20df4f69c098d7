"""Damping as a scene tells it: ratio, rate and crosswind; what is refused; and the judge's own computation."""

import math

import pytest

from cablefem import Scene, SceneError
from validation.core.scene_data import OneSpanData
from validation.oracles import irvine

LEVEL = Scene.load("level")
BLOWN = {"wind.across": 10.0, "cable.diameter": 0.048}


@pytest.mark.parametrize("name", ["level", "tramway", "kevlar"])
def test_a_ratio_is_of_the_lowest_frequency(name):
    scene = Scene.load(name).replace({"cable.damping": 0.013})
    g = scene.groups
    L2 = irvine.irvine_parameter(g.sigma, g.alpha, g.chord_cos)
    assert scene.irvine == pytest.approx(L2, rel=1e-13)
    lowest = float(irvine.lowest_frequencies(L2, 1)[0]) / math.sqrt(g.chord_cos)
    assert g.damping == pytest.approx(2.0 * 0.013 * lowest, rel=1e-12)
    assert scene.damping * scene.time_scale == pytest.approx(g.damping, rel=1e-14)


def test_a_deep_cable_swings_first_in_two_halves():
    deep = Scene.from_groups(sag_ratio=0.1, alpha=700.0, slope=12.0).replace({"cable.damping": 0.02})
    assert deep.irvine > 4.0 * math.pi**2
    assert deep.groups.damping == pytest.approx(0.04 * 2.0 * math.pi / math.sqrt(deep.groups.chord_cos), rel=1e-12)


def test_crosswind_damps_tilts_and_adds_up():
    tramway = Scene.load("tramway")
    blown = tramway.replace(BLOWN)
    assert blown.damping == pytest.approx(1.2 * 1.2 * 0.048 * 10.0 / (2.0 * 13.3), rel=1e-14)
    tilt = math.degrees(math.atan(13.824 / 130.473))
    assert tramway.replace(BLOWN | {"wind.across": 20.0}).wind_tilt == pytest.approx(tilt, rel=1e-12)
    both = tramway.replace(BLOWN | {"cable.damping": {"rate": 0.02}})
    assert both.damping == pytest.approx(blown.damping + 0.02, rel=1e-14)
    assert blown.catenary == tramway.catenary
    iced = tramway.replace(BLOWN | {"cable.ice": {"thickness": 0.006, "density": 900.0}})
    assert iced.damping == pytest.approx(blown.damping * 60.0 / 48.0 * 13.3 / iced.rho, rel=1e-12)


def test_without_the_keys_nothing_is_damped():
    assert LEVEL.groups.damping == 0.0
    assert LEVEL.wind_tilt is None
    assert "damping" not in LEVEL.to_toml()
    assert LEVEL.replace({"cable.damping": 0.0}).to_toml() == LEVEL.to_toml()
    assert LEVEL.variant(sag_ratio=0.03, mu=0.2).groups.damping == 0.0


@pytest.mark.parametrize("changes", [{"cable.damping": 0.01}, {"cable.damping": {"rate": 0.1}}, BLOWN])
def test_a_damped_scene_is_written_and_kept(changes):
    scene = LEVEL.replace(changes)
    assert Scene.from_toml(scene.to_toml(), name="level") == scene
    other = scene.variant(sag_ratio=0.03)
    assert other.cable.damping == scene.cable.damping
    assert other.damping > 0.0


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"cable.damping": 1.2}, "cable.damping = 1.2: must be a ratio of critical from 0 to 1 (0.01 is 1 %)"),
        ({"cable.damping": -0.1}, "cable.damping = -0.1: must be a ratio of critical from 0 to 1"),
        ({"cable.damping": {"rate": -1.0}}, "cable.damping.rate = -1.0: must be a number >= 0"),
        ({"cable.damping": {"rate": 50.0}}, "cable.damping: damps by 50 1/s in all; must be at most critical, 1.822"),
        ({"wind.across": 5.0}, "cable.diameter: missing; must be given with wind.across"),
        ({"wind.across": -5.0, "cable.diameter": 0.01}, "wind.across = -5.0: must be a number >= 0"),
        (BLOWN | {"wind.vertical": 3.0}, "wind.vertical: not modelled: wind blows across the line, wind.across, or"),
        (BLOWN | {"wind.along": 3.0}, "wind.along: not modelled: along the line wind acts on the car alone"),
        ({"mass.damping": 0.1}, "mass.damping: not modelled: the rope has it, as cable.damping"),
    ],
)
def test_what_is_refused_says_why(changes, told):
    with pytest.raises(SceneError) as raised:
        LEVEL.replace(changes)
    (fault,) = raised.value.faults
    assert fault.startswith(told)


@pytest.mark.parametrize("name", ["level", "tramway", "inclined"])
def test_the_judge_computes_the_rate_again_from_the_file(name):
    ice = {"cable.ice": {"thickness": 0.01, "density": 900.0}}
    for changes in (
        {"cable.damping": 0.05},
        {"cable.damping": {"rate": 0.02}} | BLOWN,
        {"cable.damping": 0.1} | ice | BLOWN,
    ):
        scene = Scene.load(name).replace(changes)
        given = OneSpanData(scene.to_toml(), scene.length)
        assert given.damping_rate_with_wind(scene.length, scene.horizontal_tension) == pytest.approx(
            scene.damping, rel=1e-12
        )
    deep = Scene.from_groups(sag_ratio=0.1, alpha=700.0, mu=0.1, speed_ratio=0.2).replace({"cable.damping": 0.02})
    own = OneSpanData(deep.to_toml(), deep.length).damping_rate_with_wind(deep.length, deep.horizontal_tension)
    assert own == pytest.approx(deep.damping, rel=1e-12)
