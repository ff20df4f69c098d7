"""The quasi-static ride as a Response, and its design numbers."""

import json

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from cablefem import Scene
from tests.scene.test_ride import BRAKED, ZIP
from validation.cli import main
from validation.core.design import design
from validation.core.quasi_static import quasi_static
from validation.core.running import run

HAULED = Scene.library_text("tramway")


@pytest.mark.parametrize("text", [ZIP, HAULED, Scene.library_text("level")], ids=["free", "haul", "grip"])
def test_supports_carry_cable_car_and_rope_and_the_car_hangs_on_the_cable(text):
    scene = Scene.from_toml(text)
    r = quasi_static(scene)
    inside = (r.s_o > 1e-3 * r.length) & (r.s_o < (1.0 - 1e-3) * r.length)
    tangent = r.slope_behind + r.slope_ahead
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    # the cable is at rest under the car, whose inertia along the rope is the rope's to overcome
    inertia = scene.mass.mass * (r.acceleration * tangent).sum(1) if scene.drive.mode == "haul" else 0.0
    rope = (np.nan_to_num(r.F_haul) - inertia)[:, None] * tangent
    weight = scene.gravity * (scene.mass.mass + scene.cable.mass_per_length * r.length)
    balance = r.reaction_left + r.reaction_right + [0.0, weight] + rope
    assert np.abs(balance[inside]).max() < 1e-6 * weight  # interpolated between nodes
    if scene.drive.mode == "haul":
        np.testing.assert_allclose(r.T_behind[inside], r.T_ahead[inside], rtol=2e-6)
    f = r.fields
    at_car = np.array([np.interp(s, f.s, v) for s, v in zip(f.s_o, f.v, strict=True)])
    curved = scene.gravity * r.length / scene.wave_speed**2 * (r.length / 200.0) / 8.0  # sag between two stations
    assert np.abs(at_car - f.mass_v).max() < 0.02 * r.max_deflection + curved
    np.testing.assert_allclose(f.v[:, [0, -1]], 0.0, atol=1e-8 * r.length)
    k = 40
    np.testing.assert_allclose(f.T[k, 0], np.interp(f.t[k], r.t, np.linalg.norm(r.reaction_left, axis=1)), rtol=1e-5)
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
    rows = {row["quantity"]: row for row in design(r)}
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
    assert "brake       after 34.796 s at 280 m with 15.646 km/h" in said
    assert "stop        after 35.429 s at 281.37 m" in said
    summary = json.loads((tmp_path / "out/quasi-static/summary.json").read_text())
    assert summary["drive"] == "free"
    assert {row["quantity"] for row in summary["design"]} >= {"speed_max", "reaction_left_max"}
    header, first = (tmp_path / "out/quasi-static/path.csv").read_text().splitlines()[:2]
    assert header.endswith("speed,F_haul,F_contact")
    assert first.startswith("0.0,2.0,")
