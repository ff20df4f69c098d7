"""Design numbers: extremes where they are, with bars that hold against a much finer run; the judge recomputes them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.response import Response
from tests.validation.ladders import run_ladder
from validation.core import readback, recomputed
from validation.core.agreement import Verdict
from validation.core.answers import outcome_of_run
from validation.core.design import (
    TRACKS,
    design_gap_rows,
    design_numbers,
    signals_over_common_time,
    widen_error_bars_to_gaps,
)
from validation.core.measures import energy_defect_in_joules, time_span_for_extremes
from validation.core.quasi_static import quasi_static
from validation.core.refine import run_with_error_bars
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
COARSE = {"elements": 8, "steps": 600}


def design_rows(*of):
    return [SimpleNamespace(**row) for row in design_numbers(*of)]


def rows_by_quantity(*of):
    return {row.quantity: row for row in design_rows(*of)}


@pytest.fixture(scope="module", params=SCENES)
def ladder_with_numbers(request):
    """A ladder and its design numbers."""
    scene = SCENES[request.param]
    until = {} if scene.drive.mode == "free" else {"until": 0.8}
    ladder = run_ladder(scene, **COARSE, **until)
    return scene, ladder, design_rows(ladder)


def test_bars_hold_against_a_finer_run(ladder_with_numbers):
    scene, _, numbers = ladder_with_numbers
    until = {} if scene.drive.mode == "free" else {"until": 0.8}
    finer = rows_by_quantity(run(scene, "following-p2", elements=16, steps=1500, **until))
    assert [n for n in numbers if not abs(n.value - finer[n.quantity].value) <= n.bar] == []
    # and say something: a wide bar would hold as well
    relative_bars = sorted(n.bar / abs(n.value) for n in numbers)
    assert relative_bars[len(numbers) // 2] < 0.02
    peaks = [n for n in numbers if n.bar_peak is not None]
    assert [n for n in peaks if not abs(n.peak - finer[n.quantity].peak) <= n.bar_peak] == []


def test_forces_are_means_and_the_raw_peak_lies_beyond(ladder_with_numbers):
    _, _, numbers = ladder_with_numbers
    forces = [n for n in numbers if n.unit == "N"]
    assert len(forces) >= 8
    for n in forces:
        sign = -1.0 if n.quantity.endswith("_min") else 1.0
        assert sign * (n.peak - n.value) >= -1e-9 * abs(n.value)
    assert all(n.peak is None for n in numbers if n.unit != "N")


def test_numbers_stand_where_they_occur(ladder_with_numbers):
    _, ladder, numbers = ladder_with_numbers
    r = ladder.finest
    by = {n.quantity: n for n in numbers}
    deep = by["mass_deepest"]
    assert deep.value == pytest.approx(float(np.interp(deep.t, r.t, r.y)))
    assert deep.s == deep.s_o == pytest.approx(float(np.interp(deep.t, r.t, r.s_o)))
    assert deep.x == pytest.approx(float(np.interp(deep.s, r.fields.s, r.fields.x)))
    assert by["deepest_point"].value >= deep.value
    assert by["tension_max"].value >= by["reaction_right_max"].value >= by["reaction_right_vertical_max"].value
    assert by["contact_min"].value < by["contact_max"].value


def test_a_peak_has_a_bar_only_where_axial_waves_are_not_damped():
    """A rule that damps them says nothing of the peak by itself."""
    damped = run_ladder(SCENES["level"], **COARSE, until=0.8, scheme="generalized-alpha", rho_inf=0.5)
    assert {n.bar_peak for n in design_rows(damped)} == {None}


def test_clearances_at_a_far_support_have_bars_and_the_support_itself_an_exact_one():
    """Coarser runs ended before the mast, and the rope's lowest height was compared with that at the car."""
    mast = {"name": "mast", "at": 197.0, "top": 12.0}
    scene = CAMERA.replace({"obstacle": [mast], "ground": [[0.0, 30.0], [100.0, 40.0], [200.0, 9.0]]})
    found = rows_by_quantity(run_with_error_bars(scene, "following-p2", **COARSE))
    finer = rows_by_quantity(run(scene, "following-p2", elements=16, steps=1500))
    for body in ("rope", "car"):
        row = found[f"clearance_{body}_min:mast"]
        assert abs(row.value - finer[row.quantity].value) <= row.bar < 0.01
    support = found["clearance_rope_min:the ground"]
    assert (support.value, support.bar) == (pytest.approx(9.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))


def test_an_obstacle_at_a_support_is_as_far_below_the_rope_as_below_the_support():
    scene = RIDER.replace({"obstacle": [{"name": "hut", "at": 230.0, "top": 18.0}]})
    r = run(scene, "following-p2", **COARSE)
    r = replace(r, design=design_numbers(r))
    hut = next(row for row in r.design if row["quantity"] == "clearance_rope_min:hut")
    assert hut["value"] == pytest.approx(3.0, abs=1e-6)
    assert wrong_quantities(recomputed.recomputed_design_rows(r)) == set()


def test_a_car_that_only_goes_up_has_no_deepest_point():
    up = CAMERA.replace({"supports.drop": -60.0})
    by = rows_by_quantity(run(up, "following-p2", elements=6, steps=300, until=0.95))
    assert {"deepest_point", "mass_deepest"}.isdisjoint(by)
    assert {"tension_max", "haul_force_max"} <= set(by)


def test_a_brake_stops_a_car_as_hard_as_its_speed_and_way_say():
    """v^2 = 2 a d in a brake of one force, which is far larger than the weight's part along the rope."""
    braked = Scene.load("zipline").replace({"drive.brake.0.force": 1500.0})
    r = quasi_static(braked)
    speed, stop = (next(e for e in r.events if e["event"] == name) for name in ("brake", "stop"))
    way = stop["s_o"] - speed["s_o"]
    hardest = rows_by_quantity(r)["car_deceleration_max"]
    assert hardest.value == pytest.approx(speed["speed"] ** 2 / (2.0 * way), rel=0.05)
    hauled = run(CAMERA, "following-p2", elements=6, steps=300, until=0.5)
    assert "car_deceleration_max" not in rows_by_quantity(hauled)


def test_what_drives_a_free_car_is_its_thrust():
    """9 kN in the scene; no rope hauls it."""
    by = rows_by_quantity(run(Scene.load("rocket"), "following-p2", elements=6, steps=300, until=0.3))
    assert by["thrust_max"].value == pytest.approx(9000.0, rel=1e-9)
    assert {"haul_force_max", "haul_force_min"}.isdisjoint(by)


def test_a_thrust_that_is_zero_for_a_while_is_as_computed():
    """Its mean over an axial round trip is zero to rounding, which no bar of its own size covers."""
    thrust = {"times": [2.0, 5.0, 9.0], "forces": [0.0, 80.0, 0.0]}
    r = run(RIDER.replace({"drive.thrust": thrust}), "following-p2", elements=8, steps=500)
    r = replace(r, design=design_numbers(r))
    least = next(row for row in r.design if row["quantity"] == "thrust_min")
    assert least["value"] == 0.0
    off = replace(r, design=[least | {"value": -1e-15}])
    assert wrong_quantities(recomputed.recomputed_design_rows(r)) == set()
    assert wrong_quantities(recomputed.recomputed_design_rows(off)) == set()


def test_a_bar_is_no_less_than_the_gap_to_the_twin(ladder_with_numbers):
    _, ladder, numbers = ladder_with_numbers
    deeper = ladder.map(lambda r: replace(r, y=r.y + 1.0, v=r.v + 1.0))
    own = design_numbers(ladder, deeper)
    other = design_numbers(deeper, ladder)
    widened = {row["quantity"]: row["bar"] for row in widen_error_bars_to_gaps(own, other)}
    assert {n.quantity: n for n in numbers}["mass_deepest"].bar < 0.1
    assert widened["mass_deepest"] == pytest.approx(1.0, abs=0.02)
    ladders = [replace(x, finest=replace(x.finest, design=n)) for x, n in ((ladder, own), (deeper, other))]
    rows = {row.law: row for row in design_gap_rows(*ladders, 0.05)}
    assert rows["mass_deepest"].verdict is Verdict.DISAGREE  # by the solvers' own bars
    assert rows["tension_max"].verdict is Verdict.AGREE
    assert not any(row.decides for row in rows.values())


def test_without_coarser_runs_there_are_no_bars(ladder_with_numbers):
    _, ladder, _ = ladder_with_numbers
    assert {number.bar for number in design_rows(ladder.finest)} == {None}


def test_extremes_reach_to_the_end_of_the_range_that_they_name():
    """The speed of `inclined` at 0.8 of the length was that of one step before: 176.48 m/s instead of 177.59."""
    coarse, fine = (run(Scene.load("inclined"), "following-p2", elements=8, steps=n, until=0.8) for n in (300, 900))
    top, top_of_fine = (signals_over_common_time(r)["speed_max"].extreme(r) for r in (coarse, fine))
    assert top.s == pytest.approx(0.8 * coarse.length, rel=1e-6)
    assert top.value == pytest.approx(top_of_fine.value, rel=2e-4)


@pytest.mark.parametrize("name", ["tramway", "zipline"])
def test_the_steepest_angle_is_the_largest_up_or_down(name):
    """It was the steepest in the direction that the rope had at first."""
    r = quasi_static(Scene.load(name))
    by = rows_by_quantity(r)
    begin, end = time_span_for_extremes(r, None)
    inside = (r.t >= begin) & (r.t <= end)
    for side, force in (("left", r.reaction_left), ("right", r.reaction_right)):
        horizontal, vertical = force[inside].T
        steepest = np.abs(np.degrees(np.arctan(vertical / horizontal))).max()
        assert by[f"angle_{side}"].value == pytest.approx(steepest, rel=1e-2)


def test_a_slack_onset_has_a_bar():
    ladder = run_ladder(SCENES["level"], elements=12, steps=1000, until=0.9)
    onset = rows_by_quantity(ladder)["slack_onset"]
    assert onset.value == ladder.finest.slack_onset
    assert 0.0 < onset.bar < 0.05


def test_the_first_steps_of_a_mass_that_enters_from_rest_are_right():
    how = {"elements": 8, "steps": 300, "scheme": "generalized-alpha", "rho_inf": 0.8, "until": 0.1}
    r = run(Scene.load("cruise"), "following-p2", **how)
    assert r.T_behind[1:].min() > 0.7 * r.horizontal_tension
    assert rows_by_quantity(r)["tension_min"].value > 0.5 * r.horizontal_tension
    assert "hidden slack" not in r.flag_kinds


def test_work_is_summed_up_to_where_the_travel_breaks_and_from_there():
    """A trapezoid across the jump of the haul force is off by half a step of it."""
    r = run(CAMERA, "following-p2", elements=6, steps=600, until=0.8)
    off, blind = (np.abs(energy_defect_in_joules(x)).max() for x in (r, replace(r, breaks=[])))
    assert off < 0.1 * blind


# --- what is printed, recomputed ------------------------------------------------------------------------------------


def wrong_quantities(rows):
    """Return what recomputing finds wrong."""
    return {(row.quantity, row.law) for row in rows if not row.gap <= row.allowed}


def response_with_numbers(ladder, numbers):
    return replace(ladder.finest, design=[vars(n) for n in numbers])


def test_what_is_printed_is_recomputed(ladder_with_numbers):
    _, ladder, numbers = ladder_with_numbers
    rows = list(recomputed.recomputed_rows(response_with_numbers(ladder, numbers)))
    assert wrong_quantities(rows) == set()
    laws = {row.law for row in rows}
    assert {n.quantity for n in numbers} <= laws
    assert {f"{n.quantity} peak" for n in numbers if n.peak is not None} <= laws


@pytest.mark.parametrize("quantity", TRACKS)
def test_a_design_number_three_percent_off_is_seen(ladder_with_numbers, quantity):
    _, ladder, numbers = ladder_with_numbers
    r = response_with_numbers(ladder, numbers)
    r.design[:] = [n | {"value": 1.03 * n["value"]} for n in r.design if n["quantity"] == quantity]
    bar = next((n.bar / abs(n.value) for n in numbers if n.quantity == quantity), np.inf)
    assert bar > 0.02 or ("design", quantity) in wrong_quantities(recomputed.recomputed_design_rows(r))


@pytest.mark.parametrize("name", ["t", "s", "s_o", "x"])
def test_a_design_number_that_is_said_to_be_elsewhere_is_seen(ladder_with_numbers, name):
    _, ladder, numbers = ladder_with_numbers
    r = response_with_numbers(ladder, numbers)
    r.design[:] = [n | {name: 0.97 * n[name]} if n["quantity"] == "tension_max" else n for n in r.design]
    moved = next(n for n in numbers if n.quantity == "tension_max")
    wrong = wrong_quantities(recomputed.recomputed_design_rows(r))
    assert wrong == ({("design", "tension_max")} if getattr(moved, name) else set())


def test_a_design_number_of_another_moment_is_seen(ladder_with_numbers):
    _, ladder, numbers = ladder_with_numbers
    r = response_with_numbers(ladder, numbers)
    k = r.t.size // 3
    s_o = float(r.s_o[k])
    elsewhere = {"t": float(r.t[k]), "s": s_o, "s_o": s_o, "x": float(np.interp(s_o, r.fields.s, r.fields.x))}
    r.design[:] = [n | elsewhere if n["quantity"] == "mass_deflection_max" else n for n in r.design]
    assert wrong_quantities(recomputed.recomputed_design_rows(r)) == {("design", "mass_deflection_max")}


@pytest.fixture(scope="module")
def ride_with_all_numbers():
    """A ride over trees and ground in crosswind, with all numbers that its scene can have."""
    scene = RIDER.replace({
        "mass.below": 2.0, "cable.breaking_load": 90e3, "cable.diameter": 0.015, "wind": {"across": 5.0},
        "obstacle": [{"name": "tree 1", "at": 110.0, "top": 13.0}, {"name": "hut", "at": 226.0, "top": 20.0}],
        "ground": [[50.0, 30.0], [120.0, 19.0], [200.0, 33.0]], "mass.wheels": {"model": "point", "radius": 0.02},
        "cable.E": 1.3e11, "cable.section": 1e-4, "cable.wire": 1e-3,
    })  # fmt: skip
    r = run(scene, "following-p2", elements=8, steps=500)
    return scene, replace(r, design=design_numbers(r))


def test_every_printed_number_has_a_second_computation(ride_with_all_numbers):
    scene, r = ride_with_all_numbers
    rows = list(recomputed.recomputed_rows(r, None, outcome_of_run(scene, r)))
    assert {row["quantity"] for row in r.design} <= {row.law for row in rows}
    assert {"wind_tilt", "safety_factor_min", "clearance_car_min:tree 1"} <= {row.law for row in rows}
    assert wrong_quantities(rows) == set()
    r = replace(r, design=[*r.design, r.design[0] | {"quantity": "knot_max"}])
    assert wrong_quantities(recomputed.recomputed_design_rows(r)) == {("design", "knot_max")}


def multiplied_by(factor):
    return lambda value: factor * value


def shifted_by(shift):
    return lambda value: value + shift


@pytest.mark.parametrize(
    ("quantity", "fault"),
    [
        ("clearance_rope_min:tree 1", shifted_by(1.0)), ("clearance_rope_min:the ground", shifted_by(1.0)),
        ("clearance_car_min:the ground", shifted_by(-1.0)),
        ("clearance_car_min:tree 1", shifted_by(2.0)),  # feet ignored
        ("safety_factor_min", multiplied_by(1.01)), ("wind_tilt", multiplied_by(1.01)),
        ("angle_right", multiplied_by(-1.0)),
        *((f"stress{kind}_max", multiplied_by(1.01)) for kind in ("", "_axial", "_bending")),
        ("tension_over_wheel_min", multiplied_by(1.01)), ("car_deceleration_max", multiplied_by(1.01)),
    ],
)  # fmt: skip
def test_a_wrong_design_number_is_seen(ride_with_all_numbers, quantity, fault):
    _, r = ride_with_all_numbers
    changed = [row | {"value": fault(row["value"])} for row in r.design if row["quantity"] == quantity]
    assert wrong_quantities(recomputed.recomputed_design_rows(replace(r, design=changed))) == {("design", quantity)}


@pytest.mark.parametrize("place", ["t", "s", "s_o", "x"])
@pytest.mark.parametrize(
    "quantity",
    ["clearance_rope_min:the ground", "clearance_rope_min:tree 1", "clearance_car_min:tree 1", "safety_factor_min"],
)
def test_a_number_that_is_said_to_be_elsewhere_is_seen(ride_with_all_numbers, quantity, place):
    _, r = ride_with_all_numbers
    changed = [row | {place: row[place] + 0.1} if row["quantity"] == quantity else row for row in r.design]
    assert wrong_quantities(recomputed.recomputed_design_rows(replace(r, design=changed))) == {("design", quantity)}


def test_a_clearance_of_another_moment_is_seen(ride_with_all_numbers):
    _, r = ride_with_all_numbers
    quantity = "clearance_car_min:the ground"
    clearance = next(row for row in r.design if row["quantity"] == quantity)
    k = int(np.searchsorted(r.t, clearance["t"])) + 1
    s_o = float(r.s_o[k])
    next_step = {"t": float(r.t[k]), "s": s_o, "s_o": s_o, "x": float(np.interp(s_o, r.fields.s, r.fields.x))}
    changed = [row | next_step if row["quantity"] == quantity else row for row in r.design]
    assert wrong_quantities(recomputed.recomputed_design_rows(replace(r, design=changed))) == {("design", quantity)}


def test_an_outcome_is_recomputed(ride_with_all_numbers):
    scene, r = ride_with_all_numbers
    kind, said = outcome_of_run(scene, r)
    assert kind == "stopped_by_brake"
    assert said.startswith("would hit ")
    for other in (
        ("stuck", said), (kind, said.replace("would hit", "clears")), (kind, said.replace("tree 1", "hut")),
        (kind, said.replace("stops in the brake at 2", "stops in the brake at 3")),
    ):  # fmt: skip
        assert wrong_quantities([recomputed.recomputed_outcome_row(r, None, *other)]) == {("outcome", "")}


@pytest.mark.parametrize("load", [90e3, 8e3, None])
def test_an_arrival_its_speed_and_a_break_are_recomputed(load):
    scene = Scene.load("zipline").replace({"cable.breaking_load": load} if load else {})
    r = quasi_static(scene)
    r = replace(r, design=design_numbers(r))
    kind, said = outcome_of_run(scene, r)
    assert kind == ("breaks" if load == 8e3 else "arrives")
    assert wrong_quantities([recomputed.recomputed_outcome_row(r, None, kind, said)]) == set()
    speed = said.split(" with ")[1].removesuffix(" km/h")
    faster = said.replace(speed, f"{1.01 * float(speed):.1f}")
    for other in (("stuck", said), (kind, faster)):
        assert wrong_quantities([recomputed.recomputed_outcome_row(r, None, *other)]) == {("outcome", "")}


@pytest.mark.parametrize("name", ["level", "inclined", "tramway", "kevlar", "rollback", "rocket"])
def test_outcomes_of_built_in_scenes_are_as_recomputed(name):
    scene = Scene.load(name)
    r = quasi_static(scene)
    r = replace(r, design=design_numbers(r))
    assert wrong_quantities([recomputed.recomputed_outcome_row(r, None, *outcome_of_run(scene, r))]) == set()


@pytest.mark.parametrize("name", ["F_contact", "speed"])
def test_a_derived_quantity_computed_wrongly_is_seen(name, monkeypatch, tmp_path):
    """The contact force of a car that grips, or the speed, wrong where both wings share it."""
    right = getattr(Response, name).fget
    monkeypatch.setattr(Response, name, property(lambda r: 1.02 * right(r)))
    run(SCENES["level"], "following-p2", elements=4, steps=100).write(tmp_path / "following-p2")
    faults = list(readback.faults_of_stored_results(readback.StoredResults(tmp_path, ["following-p2"], judged=False)))
    assert any(f"path.csv: {name} is not what was computed" in fault for fault in faults)


ACCELERATING = {"kind": "constant_acceleration", "acceleration": 2.0}
TABLE = {
    "kind": "table", "times": [0.0, 10.0, 20.0, 30.0, 45.0, 55.0], "positions": [0.0, 20.0, 30.0, 30.0, 90.0, 190.0],
}  # fmt: skip


@pytest.mark.parametrize("travel", [ACCELERATING, TABLE, {**TABLE, "stop": {"time": 53.5, "deceleration": 9.0}}])
def test_the_top_speed_is_that_of_the_whole_timetable(travel):
    """Paths end at 0.8 of the rope: a car that grows faster up to the far support had the speed that it has there."""
    scene = Scene(
        cable={"mass_per_length": 1.0, "EA": 1.3e7, "horizontal_tension": 40e3}, supports={"span": 200.0},
        mass={"mass": 20.0}, travel=travel,
    )  # fmt: skip
    top = scene.top_speed
    if travel is ACCELERATING:
        top = np.sqrt(2.0 * 2.0 * scene.length)
    ladder = run_ladder(scene, elements=4, steps=200)
    for numbers in (rows_by_quantity(ladder), rows_by_quantity(quasi_static(scene))):
        assert numbers["speed_max"].value == pytest.approx(top, rel=1e-9)
    assert recomputed.RecomputedNumbers(ladder.finest, None).number("speed_max") == pytest.approx(top, rel=1e-9)
