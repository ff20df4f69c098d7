"""Cars that roll, by both wings: rides whose ends are known, places of rest, energy, and forces on both sides."""

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from cablefem import Scene
from cablefem.scene.statics import gripped_rest, hauled_rest
from tests.scene.test_ride import ZIP as RIDER
from validation import run

WINGS = {"following-p2": {"elements": 6}, "fourier-kink": {"terms": 15}}
every = pytest.mark.parametrize("method", WINGS)


def run_scene(method, toml, **how):
    return run(Scene.from_toml(toml), method, **WINGS[method] | {"scheme": "generalized-alpha"} | how)


def rms(x):
    return float(np.sqrt(np.mean(x**2)))


@pytest.mark.parametrize("how", [{"steps": 500}, {"steps": 100, "scheme": "radau"}], ids=["generalized-alpha", "radau"])
@every
def test_a_rider_is_where_the_reference_has_him_after_half_a_minute(method, how):
    """At 284.744 m by 20 + 20 elements of degree 4 and 16000 steps; a rider one percent heavier is elsewhere."""
    allowed = 1e-5 if method == "following-p2" else 4e-5  # of the length
    text = RIDER + "end = {time = 30.0}\n"
    r = run_scene(method, text, **how)
    assert abs(r.s_o[-1] - 284.744) < allowed * r.length
    other = run_scene(method, text.replace("mass = 95.0", "mass = 96.0"), **how)
    assert abs(other.s_o[-1] - 284.744) > 2.0 * allowed * r.length


@every
def test_a_rider_is_braked_and_stops(method):
    """At 35.43 s, told once he has stood still for an axial round trip."""
    text = RIDER + "rolling_friction = 0.02\nbrake = [{from = 280.0, force = 600.0}]\nend = {time = 45.0}\n"
    r = run_scene(method, text, steps=1000)
    brake, stop = r.events
    assert (brake["event"], stop["event"]) == ("brake", "stop")
    assert brake["t"] == pytest.approx(34.800, abs=2e-3)
    assert stop["s_o"] == pytest.approx(281.375, abs=2e-3 if method == "following-p2" else 0.03)
    round_trip = 2.0 * r.length / Scene.from_toml(text).axial_speed
    assert stop["t"] == pytest.approx(35.43, abs=0.02)  # the cable rings: 10 ms is what it is worth
    assert r.t[-1] - stop["t"] < 2.0 * round_trip, "the run goes on after the stop"
    braked, moving = r.s_o >= 280.0, np.gradient(r.s_o, r.t) > 0.0
    assert np.all(r.powers["brake"][~braked] == 0.0)
    assert all(r.powers[name][moving].max() <= 0.0 for name in ("brake", "friction", "drag"))
    weight = 95.0 * 9.81 * r.length
    assert np.ptp(r.energy - cumulative_trapezoid(r.power, r.t, initial=0.0)) < 1e-3 * weight
    assert np.ptp(r.energy - 0.8 * cumulative_trapezoid(r.power, r.t, initial=0.0)) > 8e-3 * weight


@every
def test_friction_holds_a_car_or_lets_it_go(method):
    held = run_scene(method, RIDER + "rolling_friction = 0.5\n", steps=100)
    assert [x["event"] for x in held.events] == ["stop"]
    assert np.ptp(held.s_o) == 0.0
    assert np.abs(held.v - held.v[0]).max() < 1e-8 * held.length
    gone = run_scene(method, RIDER + "rolling_friction = 0.02\nend = {time = 3.0}\n", steps=100)
    assert gone.s_o[-1] > gone.s_o[0]


@every
def test_a_rider_who_turns_and_one_who_arrives(method):
    """The far end is too high for him: he turns there, and again at the near one."""
    deep = RIDER.replace("sag = 6.0", "sag = 12.0").replace("drop = 15.0", "drop = -2.0")
    r = run_scene(method, deep.replace("start = 2.0", "start = 6.0") + "end = {time = 70.0}\n", steps=700)
    assert [x["event"] for x in r.events] == ["turn", "turn"]
    for x in r.events:
        assert r.speed[int(np.argmin(np.abs(r.t - x["t"])))] < 0.02 * r.speed.max()
    assert np.ptp(r.energy - cumulative_trapezoid(r.power, r.t, initial=0.0)) < 2e-3 * 95.0 * 9.81 * r.length
    there = run_scene(method, RIDER + "end = {place = 60.0}\n", steps=100)
    assert [x["event"] for x in there.events] == ["arrival"]
    assert there.s_o[-1] == pytest.approx(60.0, rel=1e-11)


@every
def test_both_sides_pull_alike_unless_there_is_friction_and_the_contact_is_normal(method):
    """Let go gently; over H and over the weight."""

    def found(friction):
        r = run_scene(method, RIDER + f"release = 1.0\nend = {{time = 20.0}}\n{friction}", steps=600)
        late = r.t > 3.0
        tangent = r.slope_behind + r.slope_ahead
        along = np.sum(tangent * r.contact, axis=1) / np.hypot(*tangent.T)
        return rms((r.T_ahead - r.T_behind)[late]) / r.horizontal_tension, rms(along[late]) / (95.0 * 9.81)

    free, rubbed = found(""), found("rolling_friction = 0.02\n")
    assert free[0] < 5e-5
    assert free[1] < 2e-4
    assert min(rubbed) > 10.0 * max(free)


@pytest.mark.parametrize(("EA", "mass", "length", "start"), [(3e5, 60.0, 104.0, 5.0), (3e5, 60.0, 104.0, 20.0)])
@pytest.mark.parametrize("mode", ["free", "haul"])
@every
def test_a_heavy_car_on_a_light_rope_begins_at_its_stable_rest(method, mode, EA, mass, length, start):
    """By the catenary of two pieces; other places without slope of the energy, with folds, are metres away."""
    scene = Scene(
        cable={"mass_per_length": 0.023, "EA": EA, "length": length}, supports={"span": 100.0, "drop": 10.0},
        mass={"mass": mass}, drive={"mode": mode, "rolling_friction": 0.02, "start": start},
        travel=None if mode == "free" else {"kind": "constant_acceleration", "acceleration": 0.1},
    )  # fmt: skip
    rest = (gripped_rest if mode == "free" else hauled_rest)(start / scene.length, scene.groups)
    r = run(scene, method, until=1e-6 + start / scene.length, **WINGS[method])
    np.testing.assert_allclose([r.x[0], r.y[0]], rest.car_point[0] * scene.length, rtol=0.0, atol=0.005)


TRAMWAY = Scene.load("tramway")


@every
def test_a_run_to_a_place_before_the_first_phase_ends_is_the_beginning_of_a_longer_one(method):
    runs = [run(TRAMWAY, method, until=until, steps=60, **WINGS[method]) for until in (0.02, 0.3)]
    assert runs[0].status == "complete"
    n = runs[0].t.size
    assert 0.02 * TRAMWAY.length <= runs[0].s_o[-1] < runs[1].s_o[n]
    np.testing.assert_allclose(runs[0].y, runs[1].y[:n], rtol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.03])
@pytest.mark.parametrize(("place", "force", "tension"), [(0.25, 31.0, 766.5), (0.50, 34.9, 822.0), (0.75, 38.6, 767.0)])
@every
def test_a_rope_holds_a_tramway_car_and_overcomes_its_friction_before_it_moves(method, place, force, tension, friction):
    """kN.  Else friction jumps with the first step, and the rope with it: the car rides on the cable."""
    change = {"drive.start": place * TRAMWAY.length, "travel.top_speed": 0.1, "drive.rolling_friction": friction}
    scene = TRAMWAY.replace(change)
    r = run(scene, method, until=place + 1e-4, steps=200, **WINGS[method])
    H, exact = scene.horizontal_tension, hauled_rest(place, scene.groups)
    weight = scene.mass.mass * scene.gravity
    assert r.F_haul[0] == pytest.approx(exact.haul[0] * H, abs=2e-4 * weight)
    ends = [r.T_behind[0], r.T_ahead[0]]
    assert ends == pytest.approx([exact.behind[0] * H, exact.ahead[0] * H], abs=2e-4 * weight)
    if friction:
        assert ends[0] - ends[1] > 0.02 * weight
    else:
        assert [1e-3 * r.F_haul[0], *(1e-3 * x for x in ends)] == pytest.approx([force, tension, tension], abs=0.06)


@every
def test_a_hauled_car_costs_what_its_rope_gives_less_drag_and_friction(method):
    """At speed from the start it leaves along the path of its places at rest."""
    travel = '[travel]\nkind = "constant_speed"\nspeed = 6.0\n'
    text = Scene.library_text("tramway").split("[drive]")[0].split("[travel]")[0] + travel
    scene = Scene.from_toml(f'{text}[drive]\nmode = "haul"\nrolling_friction = 0.02\ndrag_area = 12.0\n')
    r = run(scene, method, steps=300, **WINGS[method])
    at, h = r.s_o[0] / r.length, 1e-4
    near = [hauled_rest(x, scene.groups).car_point[0] for x in (at - h, at + h)]
    speed = np.gradient(r.s_o, r.t)[0]
    np.testing.assert_allclose(r.velocity[0], speed * (near[1] - near[0]) / (2.0 * h), rtol=5e-3)
    inside = r.t < 0.9 * r.t[-1]
    given, hauls = (cumulative_trapezoid(power, r.t, initial=0.0) for power in (r.power, r.powers["haul"]))
    assert np.ptp((r.energy - given)[inside]) < 5e-3 * np.ptp(r.energy[inside])
    assert np.ptp((r.energy - hauls)[inside]) > 1e-2 * np.ptp(r.energy[inside])
    assert np.mean((r.T_behind - r.T_ahead)[inside]) == pytest.approx(0.02 * np.mean(r.F_contact[inside]), rel=0.03)
    lifting = r.F_haul[inside].mean() / (scene.mass.mass * scene.gravity)
    assert lifting == pytest.approx(math.sin(math.radians(26.0)), abs=0.03)
