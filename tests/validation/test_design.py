"""Design numbers: extremes where they are, with bars that hold against a much finer run; the judge recomputes them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.response import Response
from tests.validation.ladders import ladder
from validation.core import readback, recomputed
from validation.core.design import QUANTITIES, design
from validation.core.measures import energy_defect
from validation.core.running import run

RIDER = Scene(
    cable={"mass_per_length": 1.0, "EA": 1.3e7, "sag": 5.0}, supports={"span": 230.0, "drop": 15.0},
    mass={"mass": 75.0},
    drive={
        "mode": "free", "rolling_friction": 0.01, "drag_area": 0.5, "brake": [{"from": 214.0, "force": 400.0}],
    },
)  # fmt: skip
CAMERA = Scene(
    cable={"mass_per_length": 0.08, "EA": 1.5e6, "sag": 2.5}, supports={"span": 200.0}, mass={"mass": 35.0},
    drive={"mode": "haul", "rolling_friction": 0.02}, travel={"kind": "accelerate_cruise_brake", "top_speed": 12.0},
)  # fmt: skip
SCENES = {"level": Scene.load("level"), "rider": RIDER, "camera": CAMERA}
COARSE = {"elements": 12, "steps": 1000}


def numbers(*of):
    return [SimpleNamespace(**row) for row in design(*of)]


@pytest.fixture(scope="module", params=SCENES)
def told(request):
    """A ladder and its design numbers."""
    scene = SCENES[request.param]
    until = {} if scene.drive.mode == "free" else {"until": 0.8}
    found = ladder(scene, **COARSE, **until)
    return scene, found, numbers(found)


def test_bars_hold_against_a_finer_run(told):
    scene, _, known = told
    until = {} if scene.drive.mode == "free" else {"until": 0.8}
    true = {n.quantity: n for n in numbers(run(scene, "following-p2", elements=24, steps=2500, **until))}
    off = [n for n in known if not abs(n.value - true[n.quantity].value) <= n.bar]
    assert off == []
    # and say something: a wide bar would hold as well
    assert sorted(n.bar / abs(n.value) for n in known)[len(known) // 2] < 0.02
    raw = [n for n in known if n.bar_peak is not None]
    assert [n for n in raw if not abs(n.peak - true[n.quantity].peak) <= n.bar_peak] == []


def test_forces_are_means_and_the_raw_peak_lies_beyond(told):
    _, _, known = told
    forces = [n for n in known if n.unit == "N"]
    assert len(forces) >= 8
    for n in forces:
        assert QUANTITIES[n.quantity].sign * (n.peak - n.value) >= -1e-9 * abs(n.value)
    assert all(n.peak is None for n in known if n.unit != "N")


def test_numbers_stand_where_they_occur(told):
    _, found, known = told
    by, r = {n.quantity: n for n in known}, found.finest
    deep = by["mass_deepest"]
    assert deep.value == pytest.approx(float(np.interp(deep.t, r.t, r.y)))
    assert deep.s == deep.s_o == pytest.approx(float(np.interp(deep.t, r.t, r.s_o)))
    assert deep.x == pytest.approx(float(np.interp(deep.s, r.fields.s, r.fields.x)))
    assert by["deepest_point"].value >= deep.value
    assert by["tension_max"].value >= by["reaction_right_max"].value >= by["reaction_right_vertical_max"].value
    assert by["contact_min"].value < by["contact_max"].value


def test_a_peak_has_a_bar_only_where_axial_waves_are_not_damped():
    """A rule that damps them says nothing of the peak by itself."""
    damped = ladder(SCENES["level"], **COARSE, until=0.8, scheme="generalized-alpha", rho_inf=0.5)
    assert {n.bar_peak for n in numbers(damped)} == {None}


def test_a_car_that_only_goes_up_has_no_deepest_point():
    up = CAMERA.replace({"supports.drop": -60.0})
    found = {n.quantity for n in numbers(run(up, "following-p2", elements=6, steps=300, until=0.95))}
    assert not {"deepest_point", "mass_deepest"} & found
    assert {"tension_max", "haul_force_max"} <= found


def test_a_bar_is_no_less_than_the_gap_to_the_twin(told):
    _, found, known = told
    deeper = found.map(lambda r: replace(r, y=r.y + 1.0, v=r.v + 1.0))
    after = {n.quantity: n for n in numbers(found, deeper)}
    assert {n.quantity: n for n in known}["mass_deepest"].bar < 0.1
    assert after["mass_deepest"].bar >= 1.0


def test_without_coarser_runs_there_are_no_bars(told):
    _, found, _ = told
    assert {number.bar for number in numbers(found.finest)} == {None}


def test_a_slack_onset_has_a_bar():
    found = ladder(SCENES["level"], **COARSE, until=0.9)
    (onset,) = (n for n in numbers(found) if n.quantity == "slack_onset")
    assert onset.value == found.finest.slack_onset
    assert 0.0 < onset.bar < 0.05


def test_the_first_steps_of_a_mass_that_enters_from_rest_are_right():
    how = {"elements": 8, "steps": 300, "scheme": "generalized-alpha", "rho_inf": 0.8, "until": 0.1}
    r = run(Scene.load("cruise"), "following-p2", **how)
    assert r.T_behind[1:].min() > 0.7 * r.horizontal_tension
    least = next(x for x in numbers(r) if x.quantity == "tension_min")
    assert least.value > 0.5 * r.horizontal_tension
    assert "hidden slack" not in r.flag_kinds


def test_work_is_summed_up_to_where_the_travel_breaks_and_from_there():
    """A trapezoid across the jump of the haul force is off by half a step of it."""
    r = run(CAMERA, "following-p2", elements=6, steps=600, until=0.8)
    off, blind = (np.abs(energy_defect(x)).max() for x in (r, replace(r, breaks=[])))
    assert off < 0.1 * blind


# --- what is printed, recomputed ------------------------------------------------------------------------------------


def wrong(found):
    """Return what recomputing finds wrong."""
    return {(x.quantity, x.law) for x in found if not x.gap <= x.allowed}


def printed(found, known):
    return replace(found.finest, design=[vars(n) for n in known])


def test_what_is_printed_is_recomputed(told):
    _, found, known = told
    checked = list(recomputed.rows(printed(found, known)))
    assert wrong(checked) == set()
    laws = {x.law for x in checked}
    assert {n.quantity for n in known} - {"slack_onset"} <= laws
    assert {f"{n.quantity} peak" for n in known if n.peak is not None} <= laws


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_design_number_three_percent_off_is_seen(told, quantity):
    _, found, known = told
    r = printed(found, known)
    r.design[:] = [n | {"value": 1.03 * n["value"]} if n["quantity"] == quantity else n for n in r.design]
    bar = next((n.bar / abs(n.value) for n in known if n.quantity == quantity), np.inf)
    assert ((("design", quantity) in wrong(recomputed.rows(r))) is True) or bar > 0.02


@pytest.mark.parametrize("name", ["F_contact", "speed"])
def test_a_derived_quantity_computed_wrongly_is_seen(told, name, monkeypatch, tmp_path):
    """The contact force of a car that grips, or the speed, wrong where both wings share it."""
    right = getattr(Response, name).fget
    _, found, _ = told
    monkeypatch.setattr(Response, name, property(lambda r: 1.02 * right(r)))
    found.finest.write(tmp_path / "following-p2")
    seen = list(readback.files(readback.Stored(tmp_path, ["following-p2"], judged=False)))
    assert any(f"path.csv: {name} is not what was computed" in fault for fault in seen)
