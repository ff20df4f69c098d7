"""Cars that roll by sines: equations, compiled steps, slip and friction; rides of both wings stand in tests/driver."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from cablefem import Scene
from cablefem.newmark import Newton, NewtonStalled, Work, integrate, scheme, stack_states, step_times_by_phase
from cablefem.newmark.newmark_rule import NewmarkRule
from cablefem.scene import ConstantSpeed
from cablefem.scene.drive import Drive
from cablefem.scene.statics import gripped_rest
from galerkin import Daubechies, Fourier, GalerkinSystem, RollingSystem, SystemOverPosition
from tests.galerkin.test_equations import DAMPED, STEEP, random_state
from tests.runs import LEVEL, observe
from tests.scene.test_ride import ROPE, ZIP
from validation import run

RIDER = Scene.from_toml(ZIP)
BRAKED = Scene.from_toml(ZIP + "rolling_friction = 0.02\nbrake = [{from = 280.0, force = 600.0}]\n")
TIME = RIDER.time_scale


def with_end_time(groups, seconds):
    return replace(groups, drive=replace(groups.drive, end_time=seconds / TIME))


def roll_to_end_of_ride(groups, basis, steps, method="generalized-alpha", many_steps=True):
    """A ride as far as it goes: the system, its states, its events."""
    system, work = RollingSystem(groups, basis), Work()
    system.many_steps &= many_steps
    states = stack_states(list(integrate(system, scheme(method), step_times_by_phase(system, steps), work=work)))
    return system, states, work.events


# --- the equations -------------------------------------------------------------------------------------------------
def test_rows_of_the_cable_are_those_of_a_mass_that_grips():
    """The cable's equations do not depend on what moves the car; an outside force enters at the car."""
    s_o, ds_o, dds_o = STEEP.motion.position_with_rates(0.9, 0)
    free = RollingSystem(replace(DAMPED, drive=Drive(mode="free", start=0.4)), Fourier(4), kink=True)
    grips = GalerkinSystem(DAMPED, Fourier(4), kink=True)
    q, v, a = (np.append(y, z) for y, z in zip(random_state(grips, 3), (s_o, ds_o, dds_o), strict=True))
    want = grips.residual(0.9, q[:-1], v[:-1], a[:-1], 0)
    np.testing.assert_allclose(free.residual(0.9, q, v, a, 0)[:-1], want, rtol=0.0, atol=1e-12)
    assert np.abs(free.residual(0.9, q, v, -a, 0)[:-1] - want).max() > 1e-3
    thrust = Drive(mode="free", start=0.4, thrust_table=((0.0, 0.3), (math.inf, 0.3)))
    pulled = RollingSystem(replace(DAMPED, drive=thrust), Fourier(4), kink=True)
    change = (pulled.residual(0.9, q, v, a, 0) - free.residual(0.9, q, v, a, 0))[:-1].reshape(2, -1)
    np.testing.assert_allclose(
        np.hypot(*change), 0.3 * np.abs(free.basis.inertia_terms(s_o, 0.0, 0.0).f), rtol=0.0, atol=1e-12
    )


@pytest.mark.parametrize("rubs", [False, True])
@pytest.mark.parametrize("mode", ["free", "haul"])
def test_the_tangent_of_a_step(mode, rubs):
    """With the weights of a step of 0.2: how drag and friction follow the state is left out.

    And how all follows s_o at fixed rates: here it stays.

    Must fail: other weights.
    """
    drive = Drive(mode=mode, start=0.4, end_time=9.0, **({"mu_r": 0.3, "k": 0.1, "wind": -0.2} if rubs else {}))
    groups = replace(STEEP, drive=drive, motion=ConstantSpeed(speed=0.4).motion(1.0) if mode == "haul" else None)
    system = RollingSystem(groups, Fourier(4))
    c, x, e = (1e-2, 1e-1, 1.0), np.random.default_rng(4).standard_normal(system.n_dof), 1e-5
    q, v, a = random_state(system, 3)
    q[-1], v[-1], a[-1] = 0.43, 0.37, 0.21

    stays = np.append(x[:-1], 0.0) if mode == "free" else x

    def moved(h):
        return system.residual(0.9, *(y + h * w * z for y, w, z in zip((q, v, a), c, (stays, x, x), strict=True)), 0)

    def off(*c):
        _, solve = system.linearise(0.9, q, v, a, 0, c)
        return np.abs(solve((moved(e) - moved(-e)) / (2.0 * e)) - x).max()

    assert off(*c) < (0.1 if rubs else 0.03)
    assert off(1e-2, -1e-1, 1.0) > 0.3


# --- statics -------------------------------------------------------------------------------------------------------
def test_a_short_side_that_sines_do_not_resolve():
    """What holds the car there is known from the catenary of two pieces."""
    groups = replace(LEVEL, drive=Drive(mode="free", start=0.02, end_time=1.0))
    system, hold = RollingSystem(groups, Fourier(30)), gripped_rest(0.02, groups).hold[0]
    system.start(0, None)
    assert abs(system.hold - hold) < 5e-5 * abs(hold)


# --- rides ---------------------------------------------------------------------------------------------------------
def test_many_steps_in_one_go():
    """Friction, brake and stop come as with steps one by one."""
    found = []
    for many_steps in (True, False):
        states, events = roll_to_end_of_ride(
            with_end_time(BRAKED.groups, 45.0), Fourier(8), 400, many_steps=many_steps
        )[1:]
        there = CubicHermiteSpline(states.t, states.q[:, -1], states.v[:, -1])
        found.append((there(np.linspace(0.0, 36.0 / TIME, 200)), [name for name, _ in events][:3]))
    assert found[0][1] == found[1][1]
    assert np.abs(found[0][0] - found[1][0]).max() < 2e-6


def test_a_first_guess_beyond_the_cable_is_a_stalled_step():
    """Nothing is evaluated there: the points of the place asked for last may be more than the step has room for."""
    system = RollingSystem(RIDER.groups, Fourier(8))
    x = system.start(0, None)
    x.q[-1], x.v[-1], x.a[-1] = 0.999, 0.5, 0.0
    system.residual(x.t, np.append(x.q[:-1], 0.5), x.v, x.a, 0)
    for t1, on_it in ((1e-3, True), (0.1, False)):
        work = Work()
        step = NewmarkRule(system, scheme("trapezoidal"), Newton(), work)
        if on_it:
            assert 0.999 < step(x, t1).q[-1] < 1.0
        else:
            with pytest.raises(NewtonStalled):
                step(x, t1)
        assert (work.factorisations > 0) == on_it


def ride_of_100_metres(cable, drop, mass, drive):
    return Scene(
        title="A ride of 100 m", gravity=9.81, cable=cable, supports={"span": 100.0, "drop": drop},
        mass={"mass": mass}, drive={"mode": "free", "drag_area": 0.6} | drive,
    )  # fmt: skip


def ride_up_deep_rope(**drive):
    """Against the wind, let go softly."""
    cable = {"mass_per_length": 1.1, "EA": 1.2e7, "sag": 15.0}
    return ride_of_100_metres(cable, 0.0, 40.0, {"start": 5.0, "release": 0.5} | drive)


def test_slip_that_rings_after_a_sudden_start_is_no_standstill():
    """Both wings start alike, by any steps and rule; ringing taken for a standstill would kick the car."""
    scene = Scene.from_toml(ROPE + "start = 2.0\nrolling_friction = 0.02\nend = {time = 0.1}")
    speeds = [run(scene, "fourier-kink", terms=n, steps=m).speed[-1] for n, m in ((45, 80), (90, 320))]
    speeds += [
        run(scene, "following-p2", elements=30, steps=m, scheme=rule).speed[-1]
        for rule, m in (("radau", 200), ("generalized-alpha", 20), ("generalized-alpha", 2000))
    ]
    assert np.ptp(speeds) < 3e-7 * 24.0  # of the top speed of that ride


@pytest.mark.parametrize(("method", "how"), [("following-p2", {"elements": 6}), ("fourier-kink", {"terms": 12})])
def test_a_brake_next_to_the_start_stops_a_car_before_waves_are_back(method, how):
    """0.7 s on this soft rope, in which slip that rings is no standstill, but one under a brake is."""
    cable, supports = {"mass_per_length": 1.16, "EA": 5.2e5, "sag": 14.2}, {"span": 246.0, "drop": 27.5}
    drive = {"mode": "free", "start": 3.1, "rolling_friction": 0.03, "brake": [{"from": 3.15, "force": 2000.0}]}
    r = run(Scene(cable=cable, supports=supports, mass={"mass": 152.0}, drive=drive), method, steps=300, **how)
    assert [x["event"] for x in r.events] == ["brake", "stop"]
    assert r.events[1]["t"] < 0.3


def test_friction_hears_the_car_soon():
    """Taken over a whole axial round trip, 0.7 s on this soft rope, its acceleration would come too late."""
    cable, supports = {"mass_per_length": 0.8, "EA": 3.5e5, "sag": 14.0}, {"span": 240.0, "drop": 24.0}
    drive = {"mode": "free", "start": 3.0, "rolling_friction": 0.03, "end": {"time": 0.7}}
    scene = Scene(cable=cable, supports=supports, mass={"mass": 100.0}, drive=drive)
    sines = run(scene, "fourier-kink", terms=45, steps=600)
    elements = run(scene, "following-p2", elements=30, steps=700, scheme="radau")
    assert abs(sines.speed[-1] - elements.speed[-1]) < 1e-5 * 12.0  # of the top speed of that ride


def test_ringing_by_the_far_support_is_no_lift_off():
    """There the car's force rings through zero on few steps, and the one over a while does not."""
    cable = {"mass_per_length": 0.6, "EA": 6.6e6, "sag": 2.0}
    short = ride_of_100_metres(cable, 6.0, 80.0, {"start": 1.0, "rolling_friction": 0.02})
    r = run(short, "fourier-kink", terms=60, steps=500, rho_inf=0.9)
    assert np.nanmin(r.F_contact) < 0.0
    assert [x["event"] for x in r.events] == ["arrival"]


def test_a_car_that_lifts_off():
    storm = ride_up_deep_rope(wind=-45.0, thrust=1200.0, end={"place": 80.0})
    a, b = (run(storm, method, steps=400) for method in ("following-p2", "fourier-kink"))
    first, second = (next(x["t"] for x in r.events if x["event"] == "lift_off") for r in (a, b))
    assert first == pytest.approx(second, rel=0.05)
    calm = ride_up_deep_rope(wind=-5.0, end={"time": 8.0})
    assert [x["event"] for x in run(calm, "fourier-kink", steps=400).events] == ["release"]


def test_friction_of_a_hauled_car_goes_by_what_presses_now():
    """On a soft cable an axial wave takes long: a mean over its way belongs to the past, and misses this by 1e-3."""
    text = Scene.library_text("tramway") + "rolling_friction = 0.04\n"
    groups = Scene.from_toml(text.replace("2.52e8", "2.7e7").replace("top_speed = 10.0", "top_speed = 55.0")).groups
    assert 50.0 < groups.alpha < 70.0
    system, states, _ = roll_to_end_of_ride(groups, Fourier(12), 300, "trapezoidal")
    x = observe(system, states)
    tau = x.slope_behind + x.slope_ahead
    tau /= np.hypot(*tau.T)[:, None]
    stretch = 0.5 * (np.hypot(*x.slope_behind.T) + np.hypot(*x.slope_ahead.T))
    cos = 0.5 * np.hypot(*(x.slope_behind + x.slope_ahead).T) / stretch
    along, across = np.sum(tau * x.contact, axis=1), tau[:, 0] * x.contact[:, 1] - tau[:, 1] * x.contact[:, 0]
    inside = (x.s_o > 0.1) & (x.s_o < 0.9)
    assert np.abs(along - 0.04 * cos * np.abs(across))[inside].max() < 1e-4 * system.mu * groups.sigma


def test_the_law_goes_on_in_the_same_mode():
    system = RollingSystem(BRAKED.groups, Fourier(5))
    system.start(0, None)
    system.mode.brakes_reached = 1
    other = system.with_law("tension-only")
    assert (other.law, other.mode.brakes_reached, other.hold) == ("tension-only", 1, system.hold)
    other.mode.brakes_reached = 0
    assert system.mode.brakes_reached == 1


def test_what_cannot_roll():
    groups = RIDER.groups
    with pytest.raises(ValueError, match="no displacement along the cable"):
        RollingSystem(groups, Fourier(5), model="stretching")
    with pytest.raises(ValueError, match="inertia"):
        RollingSystem(groups, Fourier(5), load="force")
    for basis, kink in ((Fourier(5), False), (Daubechies(4, 1), True)):
        with pytest.raises(ValueError, match="take method fourier-kink"):
            RollingSystem(groups, basis, kink=kink)
    with pytest.raises(ValueError, match="no clock"):
        SystemOverPosition(RollingSystem(groups, Fourier(5)))
