"""Heat and ice: published numbers, the elastic catenary, and the scene's own rule between them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene, SceneError
from cablefem.scene import Catenary
from tests.validation.ladders import ladder_without_coarser_runs
from validation.core import laws
from validation.core.running import run
from validation.oracles.temperature import (
    catenary_extent,
    heated_length_and_total_weight,
    left_end_force_of_catenary,
    unstretched_length,
)

STEEL = 1.2e-5
RTE = Catenary(480.0, -10.0, 9.55494, 2000.0 * 9.55494)  # H/w = 2000 m at 15 C
RTE_EA, RTE_HEAT = 345.55e-6 * 59e9, 23e-6


def cable_scene(span, drop, rho, EA, shape, *changes, expansion=STEEL):
    text = f"[supports]\nspan = {span}\ndrop = {drop}\n[cable]\nmass_per_length = {rho}\nEA = {EA}\n{shape}\n"
    return Scene.from_toml("\n".join([text, f"expansion = {expansion}", *changes]))


def ice_load(thickness):
    """Weight [N/m] of ice of 6000 N/m3 around 22.4 mm."""
    return 6000.0 * math.pi * thickness * (0.0224 + thickness)


@pytest.mark.parametrize(
    ("change", "H"),
    [
        (["temperature = 25", "reference_temperature = 15"], 18380.111575),
        ([f"ice = {ice_load(0.02) / 9.81}"], 42098.906999),
        (["diameter = 0.0224", f"ice = {{thickness = 0.02, density = {6000 / 9.81}}}"], 42098.906999),
    ],
)
def test_the_scene_agrees_with_rte_within_the_strain(change, H):
    tension = f"horizontal_tension = {RTE.horizontal_tension}"
    scene = cable_scene(480.0, -10.0, 9.55494 / 9.81, RTE_EA, tension, *change, expansion=RTE_HEAT)
    assert scene.horizontal_tension == pytest.approx(H, rel=H / RTE_EA)
    assert scene.horizontal_tension != pytest.approx(RTE.horizontal_tension, rel=10.0 * H / RTE_EA)


def sag_of_level_cable(H, P, S, weight, EA):
    return float(catenary_extent(H, P, 0.5 * S, weight / S, EA)[1])


@pytest.mark.parametrize(
    ("T", "grows", "sag", "digits"),
    [(0.0, False, -6.352, 1e-3), (39.26, True, -8.195, 1e-3), (39.26, False, -8.19405, 2e-6)],
)
def test_code_aster_ssnl114(T, grows, sag, digits):
    """Span and unstretched length 325 m; Code_Aster's formula lets the weight grow with the length."""
    A, L = 2.2783e-4, 325.0
    EA, S = 57e9 * A, L * (1.0 + 23e-6 * T)
    weight = 2844.23 * A * 9.81 * (S if grows else L)
    H, P = left_end_force_of_catenary(L, 0.0, S, weight, EA)
    assert sag_of_level_cable(H, P, S, weight, EA) == pytest.approx(-sag, abs=digits)


def test_the_scene_meets_code_aster_ssnl114():
    A, L = 2.2783e-4, 325.0
    rho, EA = 2844.23 * A, 57e9 * A
    H, P = left_end_force_of_catenary(L, 0.0, L, rho * 9.81 * L, EA)
    shape = f"sag = {sag_of_level_cable(H, P, L, rho * 9.81 * L, EA)!r}"
    length = cable_scene(L, 0.0, rho, EA, shape).length  # stretched: the same weight on more metres
    change = ["temperature = 39.26", "reference_temperature = 0"]
    assert cable_scene(L, 0.0, rho * L / length, EA, shape, *change, expansion=23e-6).sag == pytest.approx(
        8.19405, rel=2e-6
    )


LINES = {
    "zip line, cold": (300.0, 24.0, 1.1, 12e6, "sag = 6.0", -20.0, 20.0, 0.0),
    "zip line, hot": (300.0, 24.0, 1.1, 12e6, "sag = 6.0", 40.0, 20.0, 0.0),
    "tramway, cold": (700.0, -341.0, 13.3, 2.52e8, "horizontal_tension = 450e3", -30.0, 10.0, 0.0),
    "level, iced": (400.0, 0.0, 3.1, 30e6, "sag = 8.0", -5.0, 15.0, 2.0),
}


def scene_and_changed_scene(name):
    *given, T, reference, ice = LINES[name]
    change = [f"temperature = {T}", f"reference_temperature = {reference}"]
    return cable_scene(*given), cable_scene(*given, *change, *([f"ice = {ice}"] if ice else []))


@pytest.mark.parametrize("name", LINES)
def test_the_scene_meets_the_elastic_catenary(name):
    before, after = scene_and_changed_scene(name)
    span, drop, _, EA, *_ = LINES[name]
    S, weight = heated_length_and_total_weight(after, before.length, unstretched_length(before.catenary, EA))
    H, _ = left_end_force_of_catenary(span, drop, S, weight, EA)
    assert after.horizontal_tension == pytest.approx(H, rel=2e-6)
    assert after.horizontal_tension != pytest.approx(before.horizontal_tension, rel=0.02)
    assert after.rho * after.length * after.gravity == pytest.approx(weight, rel=1e-14)


def test_the_reference_temperature_changes_nothing():
    cable = "sag = 6.0"
    plain = cable_scene(300.0, 24.0, 1.1, 12e6, cable)
    same = cable_scene(300.0, 24.0, 1.1, 12e6, cable, "temperature = 11", "reference_temperature = 11")
    assert same.groups == plain.groups
    slightly = cable_scene(300.0, 24.0, 1.1, 12e6, cable, "temperature = 11.001", "reference_temperature = 11")
    assert slightly.horizontal_tension == pytest.approx(plain.horizontal_tension, rel=1e-5)
    assert slightly.horizontal_tension < plain.horizontal_tension


def test_groups_of_a_cold_cable_are_those_of_the_cable_as_it_hangs():
    _, scene = scene_and_changed_scene("tramway, cold")
    for name, value in (("alpha", 700.0), ("sag_ratio", 0.04)):
        other = scene.variant(**{name: value})
        assert getattr(other, name) == pytest.approx(value, rel=1e-12)
        assert other.rho == pytest.approx(scene.rho, rel=1e-14)


@pytest.mark.parametrize("shape", ["sag = 6.0", "length = 301.275191", "horizontal_tension = 20308.4"])
def test_the_judge_hangs_a_cold_iced_cable_by_itself(shape):
    """Its own catenary, from the TOML alone; a run for another temperature or other ice is seen."""
    change = ["temperature = -20", "reference_temperature = 20", "diameter = 0.014"]
    text = "[mass]\nmass = 95.0\n[travel]\nkind = 'constant_speed'\nspeed = 12.0"
    ice = "ice = {thickness = 0.01, density = 800.0}"
    scene = cable_scene(300.0, 24.0, 1.1, 12e6, shape, *change, ice, text)
    r = run(scene, "following-p2", elements=4, steps=60, until=0.3)

    def broken(r):
        seen = laws.law_rows_in_si(ladder_without_coarser_runs(r), (0.02, 0.25))
        return {held.law for held in seen if held.law.endswith("at rest") and held.gap > 1e-8}

    assert broken(r) == set()
    wrongs = {"-20.0": "-19.9", "thickness = 0.01": "thickness = 0.0101", "800.0": "801.0", "1.2e-05": "1.201e-5"}
    for right, wrong in wrongs.items():
        told = scene.to_toml().replace(right, wrong, 1)
        assert told != scene.to_toml()
        assert broken(replace(r, scene_toml=told))


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["temperature = 20"], "cable.reference_temperature: missing; must be given with temperature"),
        (["temperature = 400", "reference_temperature = 20"], "cable.temperature = 400: must be a number from -100"),
        (["ice = 0"], "cable.ice = 0: must be a number > 0"),
        (["ice = {thickness = 0.01, density = 900.0}"], "cable.diameter: missing; must be given with the thickness"),
        (["diameter = 0.01", "ice = {thickness = 0.01}"], "cable.ice.density: missing; must be a number > 0"),
        (["ice = 1e9"], "cable.ice = 1000000000.0: must be less extreme"),
    ],
)
def test_heat_and_ice_that_lack_something_are_refused_in_one_line(lines, expected):
    with pytest.raises(SceneError) as raised:
        cable_scene(300.0, 24.0, 1.1, 12e6, "sag = 6.0", *lines)
    assert [fault for fault in raised.value.faults if fault.startswith(expected)], raised.value.faults


def test_temperature_without_expansion_is_refused():
    text = "[supports]\nspan = 300.0\n[cable]\nmass_per_length = 1.1\nEA = 12e6\nsag = 6.0\n"
    with pytest.raises(SceneError, match="expansion: missing; must be given with temperature"):
        Scene.from_toml(text + "temperature = 3\nreference_temperature = 20")


def test_mean_tension_is_the_integral():
    rows = (300.0, 24.0, 11.0, 2e4), (700.0, -341.0, 130.0, 4.5e5), (100.0, 0.0, 50.0, 600.0), (1e3, 170.0, 3.0, 3e9)
    for row in rows:
        cable = Catenary(*row)
        x, w = np.polynomial.legendre.leggauss(600)
        mean = 0.5 * w @ cable.tension(0.5 * cable.length * (1.0 + x))
        assert cable.mean_tension == pytest.approx(mean, rel=1e-13)
