"""The quasi-static ride as a Response, and its design numbers."""

import dataclasses
import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from cablefem import Scene
from tests.scene.test_ride import BRAKED, ZIP
from validation.cli import main
from validation.commands.run.study import rechecked_quasi_static_run
from validation.core.agreement import Verdict
from validation.core.answers import outcome_of_run
from validation.core.design import design_numbers
from validation.core.laws import quasi_static_law_rows
from validation.core.quasi_static import quasi_static
from validation.core.recomputed import quasi_static_energy_row
from validation.core.running import run

README = re.search(r"```toml\n(.*?)```", Path("README.md").read_text(encoding="utf-8"), re.DOTALL).group(1)
HAULED = Scene.library_text("tramway")


def test_it_gives_its_path_and_all_else_when_it_is_looked_at():
    r = quasi_static(Scene.load("zipline"))
    assert {"fields", "energy", "T_behind"}.isdisjoint(vars(r))
    again = pickle.loads(pickle.dumps(quasi_static(Scene.load("zipline"))))
    np.testing.assert_array_equal(again.fields.T, r.fields.T)
    np.testing.assert_array_equal(again.v, r.v)


@pytest.mark.parametrize("text", [ZIP, HAULED, Scene.library_text("level")], ids=["free", "haul", "grip"])
def test_supports_carry_cable_car_and_rope_and_the_car_hangs_on_the_cable(text):
    scene = Scene.from_toml(text)
    r = quasi_static(scene)
    f = r.fields
    inside = (r.s_o > 1e-3 * r.length) & (r.s_o < (1.0 - 1e-3) * r.length)
    weight = scene.gravity * (scene.mass.mass + scene.cable.mass_per_length * r.length)
    balance = r.reaction_left + r.reaction_right + [0.0, weight]
    if scene.drive.mode == "haul":
        np.testing.assert_allclose(r.T_behind[inside], r.T_ahead[inside], rtol=2e-6)
        tangent = r.slope_behind + r.slope_ahead
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
        # the cable is at rest under the car, whose inertia along the rope is the rope's to overcome
        inertia = scene.mass.mass * (r.acceleration * tangent).sum(axis=1)
        balance += (r.F_haul - inertia)[:, None] * tangent
    else:
        assert np.isnan(r.F_haul).all()
    assert np.abs(balance[inside]).max() < 1e-6 * weight  # interpolated between nodes
    at_car = [np.interp(s, f.s, v) for s, v in zip(f.s_o, f.v, strict=True)]
    sag_between_stations = scene.gravity * r.length / scene.wave_speed**2 * (r.length / 200.0) / 8.0
    assert np.abs(at_car - f.mass_v).max() < 0.02 * r.max_deflection + sag_between_stations
    np.testing.assert_allclose(f.v[:, [0, -1]], 0.0, atol=1e-8 * r.length)
    k = 40
    reaction = np.interp(f.t[k], r.t, np.linalg.norm(r.reaction_left, axis=1))
    np.testing.assert_allclose(f.T[k, 0], reaction, rtol=1e-5)
    speed = np.gradient(np.stack([r.x, r.y]), r.t, axis=1)
    np.testing.assert_allclose(np.hypot(*speed)[inside], r.speed[inside], rtol=0.0, atol=3e-3 * r.speed.max())


@pytest.mark.parametrize("friction", [0.0, 0.03])
def test_energy_changes_by_what_the_rope_puts_in_and_friction_takes(friction):
    r = quasi_static(Scene.from_toml(f"{HAULED}\nrolling_friction = {friction}"))
    tangent = r.slope_behind + r.slope_ahead
    power = r.F_haul * (tangent * r.velocity).sum(1) / np.linalg.norm(tangent, axis=1)
    power -= friction * r.F_contact * np.gradient(r.s_o, r.t)
    work = cumulative_trapezoid(power, r.t, initial=0.0)
    car = r.kinetic
    rest = r.energy - r.kinetic
    np.testing.assert_allclose(rest + car - rest[0] - car[0], work, atol=1e-3 * np.ptp(work))
    # and that is what lifting car and cable takes: the car alone to a few percent
    assert np.ptp(work) == pytest.approx(8100.0 * 9.81 * np.ptp(r.y), rel=0.02)


@pytest.mark.parametrize("wind", [20.0, 0.0, -20.0])
def test_the_haul_force_feels_wind_and_drag(wind):
    """As the full model does, while the car goes up steadily; without drag it would be the same in all three."""
    scene = Scene.load("tramway").replace({"drive.drag_area": 12.0, "drive.wind": wind})
    full, quick = run(scene, "following-p2", elements=6, steps=300), quasi_static(scene)
    t = np.linspace(0.45, 0.6, 60) * quick.t[-1]
    steady = [float(np.interp(t, r.t, r.F_haul).mean()) for r in (full, quick)]
    assert steady[1] == pytest.approx(steady[0], rel=2e-3)
    still = quasi_static(Scene.load("tramway"))
    without = float(np.interp(t, still.t, still.F_haul).mean())
    assert abs(without - steady[0]) > 5e-3 * steady[0]


def test_design_numbers_stand_where_they_are_said_to_stand():
    r = quasi_static(Scene.from_toml(BRAKED))
    rows = {row["quantity"]: row for row in design_numbers(r)}
    assert {"tension_max", "tension_min", "reaction_left_max", "deepest_point", "contact_min", "speed_max"} <= set(rows)
    assert "haul_force_max" not in rows
    fastest = rows["speed_max"]
    assert np.interp(fastest["t"], r.t, r.speed) == pytest.approx(fastest["value"], rel=1e-12)
    assert rows["tension_max"]["peak"] >= max(r.T_behind.max(), r.fields.T.max())
    assert rows["tension_min"]["peak"] <= r.fields.T.min()
    assert rows["deepest_point"]["value"] >= rows["mass_deepest"]["value"]
    assert [e["event"] for e in r.events] == ["brake", "stop"]


def test_the_command_says_when_and_how_fast(tmp_path, capsys):
    (tmp_path / "ride.toml").write_text(BRAKED, encoding="utf-8")
    args = ["run", str(tmp_path / "ride.toml"), "--model", "quasi-static", "--out", str(tmp_path / "out")]
    assert main(args) == 0
    said = capsys.readouterr().out
    assert re.search(r"brake       after 34\.\d+ ± 0\.\d+ s at 280 m with 15\.6\d* ± 0\.\d+ km/h", said)
    assert re.search(r"stop        after 35\.\d+ ± 0\.\d+ s at 281\.\d+ ± 0\.\d+ m", said)
    summary = json.loads((tmp_path / "out/quasi-static/summary.json").read_text())
    assert summary["drive"] == "free"
    assert {row["quantity"] for row in summary["design"]} >= {"speed_max", "reaction_left_max"}
    header, first = (tmp_path / "out/quasi-static/path.csv").read_text().splitlines()[:2]
    assert header.endswith("speed,F_haul,F_contact")
    assert first.startswith("0.0,2.0,")


def test_a_car_that_friction_holds_has_all_its_extremes_at_the_start():
    """Nothing changes: it said "stop after 0 s" and a largest tension after 2.2 s."""
    scene = Scene.from_toml(README).replace({"drive.rolling_friction": 0.5})
    r = rechecked_quasi_static_run(scene, quasi_static(scene))
    assert [(event["event"], event["t"]) for event in r.events] == [("stop", 0.0)]
    assert {row["t"] for row in r.design if row["value"] is not None} == {0.0}


# --- bars and what checks the ride --------------------------------------------------------------------------------


def test_bars_hold_against_the_full_model():
    """A rider of 120 kg on the README's zip line cleared the tree by 11 mm, and in a full run hit it by 8 mm."""
    scene = Scene.from_toml(README).replace({"mass.mass": 120.0, "cable.temperature": 20.0})
    quick = rechecked_quasi_static_run(scene, quasi_static(scene))
    full = run(scene, "following-p2", elements=8, steps=500, scheme="radau")
    true = {row["quantity"]: row["value"] for row in design_numbers(full)}
    for row in quick.design:
        assert abs(row["value"] - true[row["quantity"]]) <= row["bar"], row
    # and say something: a wide bar would hold as well
    assert sorted(row["bar"] / abs(row["value"]) for row in quick.design)[len(quick.design) // 2] < 0.03
    assert outcome_of_run(scene, quick).sentence.startswith(
        "too close to tell whether it clears tree; stops in the brake"
    )
    happened = {event["event"]: event for event in full.events}
    for event in quick.events:
        for name in ("t", "s_o", "speed"):
            assert abs(event[name] - happened[event["event"]][name]) <= event[f"bar_{name}"] + 1e-9, (event, name)


@pytest.mark.parametrize(
    "fault",
    [
        {"drive.drag_area": 1e-9}, {"drive.wind": 5.0}, {"drive.rolling_friction": 0.0202},
        {"drive.brake": [{"from": 280.0, "force": 606.0}]}, {"mass.mass": 121.0},
    ],
    ids=["no drag", "sign of the wind", "friction", "brake", "mass"],
)  # fmt: skip
def test_energy_along_the_ride_sees_a_fault_in_its_forces(fault):
    scene = Scene.from_toml(README).replace({"mass.mass": 120.0, "cable.temperature": 20.0})
    right, wrong = quasi_static(scene), quasi_static(scene.replace(fault))
    assert quasi_static_energy_row(right).verdict is Verdict.AGREE
    assert quasi_static_energy_row(dataclasses.replace(wrong, scene_toml=right.scene_toml)).verdict is Verdict.DISAGREE


@pytest.mark.parametrize(
    ("fault", "law"),
    [
        ({"cable.sag": 6.006}, "length at rest"), ({"supports.drop": 24.024}, "ends at rest"),
        ({"cable.mass_per_length": 1.1011}, "forces at rest"), ({"mass.mass": 120.12}, "car at rest"),
        ({"drive.brake": [{"from": 280.003, "force": 600.0}]}, "drive"), ({"drive.start": 2.002}, "drive"),
    ],
)  # fmt: skip
def test_laws_of_a_quasi_static_run_see_another_rope_or_brake(fault, law):
    scene = Scene.from_toml(README).replace({"mass.mass": 120.0})
    right, wrong = quasi_static(scene), quasi_static(scene.replace(fault))
    assert {row.verdict for row in quasi_static_law_rows(right)} == {Verdict.AGREE}
    rows = quasi_static_law_rows(dataclasses.replace(wrong, scene_toml=right.scene_toml))
    assert law in [row.law for row in rows if row.verdict is Verdict.DISAGREE]


def test_a_rope_deeper_than_its_span_is_computed_as_well_as_a_taut_one(tmp_path):
    """Between its supports it turns within a thirtieth of its length: Gauss points and nodes must see the turn."""
    scene = Scene.from_toml(README).replace({"cable.sag": 600.0})
    energy = quasi_static_energy_row(quasi_static(scene))
    assert energy.verdict is Verdict.AGREE
    assert energy.gap < 1e-4
    light = quasi_static(scene.replace({"mass.mass": 1e-3, "drive": {"mode": "free"}}))
    assert light.max_deflection < 0.02  # under a gram the rope keeps its shape
    (tmp_path / "deep.toml").write_text(scene.to_toml(), encoding="utf-8")
    assert main(["run", str(tmp_path / "deep.toml"), "--model", "quasi-static", "--out", str(tmp_path / "out")]) == 0


@pytest.mark.parametrize("name", ["rocket", "rollback", "to-rest", "tramway", "level"])
def test_what_a_quasi_static_run_prints_is_as_recomputed(name):
    scene = Scene.load(name)
    assert rechecked_quasi_static_run(scene, quasi_static(scene)).flags == []


BACK = """
[cable]
mass_per_length = 0.6
EA = 5e6
sag = 4.0
[supports]
span = 100.0
[mass]
mass = 80.0
[drive]
mode = "free"
start = 5.0
brake = [{from = 70.0, force = 40.0}, {from = 95.0, force = 300.0}]
end = {time = 45.0}
"""


def test_a_rider_who_rolls_back_out_of_a_brake_has_lost_its_force_on_both_ways():
    r = quasi_static(Scene.from_toml(BACK))
    assert 70.0 < r.s_o.max() < 95.0
    at_middle = np.flatnonzero(np.diff(np.sign(r.s_o - 50.0)))
    there, back = r.speed[at_middle[:2]]
    assert 0.5 * 80.0 * (there**2 - back**2) == pytest.approx(2.0 * 40.0 * (r.s_o.max() - 70.0), rel=0.02)
    assert quasi_static_energy_row(r).verdict is Verdict.AGREE
