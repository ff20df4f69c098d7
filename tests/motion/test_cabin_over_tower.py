"""Cabins that swing, of cars that run over the shoe of a tower."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from cablefem.elements.system import LineElements
from cablefem.newmark import Work
from cablefem.scene.line import Line
from tests.motion.lines import OVER, broken_laws, last_of_equal_steps
from validation.commands.check.motion import compare_and_check_laws
from validation.commands.run.motion import ELEMENTS, SINES, LineRuns
from validation.core.agreement import worst_deciding_verdict
from validation.core.motion_rows import LineTolerance

G = 9.81
CABIN = OVER + "[car.hanger]\nmass = 900.0\nlength = 3.0\ngyration = 1.0\ndamping = 0.03\n"
ROLLING = CABIN.replace("drag_area = 2.0", "drag_area = 2.0, rolling_friction = 0.01")
HAULED = Line.from_toml(ROLLING)
GRIPS = Line.from_toml(CABIN.replace('drive = {mode = "haul", drag_area = 2.0}', ""))


@functools.cache
def line_runs(method, line):
    return LineRuns(method, {"hauled": HAULED, "grips": GRIPS}[line])


@pytest.mark.parametrize("line", ["hauled", "grips"])
@pytest.mark.parametrize("method", [ELEMENTS, SINES])
def test_the_cabin_over_the_tower_is_a_pendulum_on_the_path_of_its_car(method, line):
    """J phi.. + c phi. + m h (a_x cos phi + (g - a_y) sin phi) = h drag . e1, integrated along the path alone."""
    motion = line_runs(method, line).run(2, 2).motion
    car, t = motion.cars[0], motion.t
    off = np.flatnonzero(car.shoe_force == car.contact_force)
    off = off[car.shoe_force[off] != 0.0][1:-1]
    assert off.size > 4
    m, h, J = 900.0, 3.0, 900.0 * (3.0**2 + 1.0**2)
    c = 2.0 * 0.03 * np.sqrt(J * m * G * h)
    k = 0.5 * 1.2 * 2.0 if line == "hauled" else 0.0
    velocity, acceleration = (CubicSpline(t[off], x[off]) for x in (car.velocity, car.acceleration))

    def rates(at, x):
        phi, rate = x
        forward = np.array([np.cos(phi), -np.sin(phi)])
        air = velocity(at) + h * rate * forward
        drag = -k * np.hypot(*air) * air
        hanging = m * h * (acceleration(at) @ forward + G * np.sin(phi))
        return rate, (h * drag @ forward - c * rate - hanging) / J

    turning = car.turning
    begin = turning.angle[off[0]], turning.rate[off[0]]
    phi = solve_ivp(rates, t[off[[0, -1]]], begin, t_eval=t[off], rtol=1e-10, atol=1e-12).y[0]
    np.testing.assert_allclose(turning.angle[off], phi, atol=2e-3 * np.ptp(turning.angle))


@pytest.mark.parametrize("line", ["hauled", "grips"])
@pytest.mark.parametrize("method", [ELEMENTS, SINES])
def test_moments_about_the_hanger_balance_through_all_events(method, line):
    """Where the car takes the rope its velocity jumps a little, and J dphi/dt + m h v . e1 does not."""
    run = line_runs(method, line).run(2, 2)
    at = [t for _, t in run.events]
    assert len(at) == 4
    t, car = run.motion.t, run.motion.cars[0]
    forward = np.stack([np.cos(car.turning.angle), -np.sin(car.turning.angle)], axis=1)
    momentum = 900.0 * ((3.0**2 + 1.0**2) * car.turning.rate + 3.0 * np.sum(car.velocity * forward, axis=1))
    for event in at:
        before, after = np.flatnonzero(t == event)[[0, -1]]
        np.testing.assert_allclose(car.turning.angle[before], car.turning.angle[after], atol=1e-9)
        np.testing.assert_allclose(momentum[before], momentum[after], atol=1e-6)


@pytest.mark.slow
def test_both_solvers_agree_on_a_cabin_over_a_tower():
    elements = line_runs(ELEMENTS, "hauled")
    ladders = elements.ladder(4, 4), LineRuns(SINES, HAULED, elements).ladder(4, 4)
    assert worst_deciding_verdict(compare_and_check_laws(HAULED, *ladders, LineTolerance(2e-3, 2e-2))).value == "agree"


def with_cabin_held(motion):
    """The cabin keeps its angle while its car is off the rope."""
    car = motion.cars[0]
    off = (car.shoe_force != 0.0) & (car.shoe_force == car.contact_force)
    first = int(np.flatnonzero(off)[0])
    angle = np.where(off, car.turning.angle[first], car.turning.angle)
    rate = np.where(off, 0.0, car.turning.rate)
    out_of = 3.0 * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    turning = dataclasses.replace(car.turning, angle=angle, rate=rate, centre=car.point + out_of)
    return dataclasses.replace(motion, cars=(dataclasses.replace(car, turning=turning),))


def test_a_cabin_that_does_not_swing_over_the_tower_is_seen():
    sound = line_runs(ELEMENTS, "hauled").ladder(2, 2)
    assert not broken_laws(HAULED.to_toml(), sound)
    wrong = sound.map(lambda run: dataclasses.replace(run, motion=with_cabin_held(run.motion)))
    assert "moment of momentum of bodies" in broken_laws(HAULED.to_toml(), wrong)


def test_many_steps_at_once_on_a_shoe_are_the_single_ones():
    runs = line_runs(ELEMENTS, "hauled")
    _, (fast, start), _ = runs._march_one_system(ELEMENTS.system(runs.line, 2), None, runs.grid, Work())
    slow = LineElements(fast.line, elements=2)
    slow.many_steps = False
    slow.set_travel_directions(start.phase)
    x, want = (last_of_equal_steps(system, start, 0.02, 8) for system in (fast, slow))
    for of_x, of_want in zip(x[1:4], want[1:4], strict=True):
        np.testing.assert_allclose(of_x, of_want, rtol=0.0, atol=1e-8 * np.abs(of_want).max())
