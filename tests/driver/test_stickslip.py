"""Stick and slip on tracks whose motion is known exactly."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cablefem import Scene, quasi_static, run
from cablefem.newmark import Newton, State, Work, integrate, scheme
from cablefem.scene.drive import Drive
from cablefem.stickslip import CarForces, RollingCar
from tests.validation.test_laws import TOML, broken_laws, run_ladder

MU, SIGMA = 0.7, 0.9
WEIGHT = MU * SIGMA


class Block(RollingCar):
    """A block on a rigid track: mu s.. = weight sin(slope(s)) + thrust - c s. - (mu_r weight cos + brakes) sign(s.)."""

    short_steps_after_jumps = False

    def __init__(self, slope, damping=0.0, **drive):
        usual = {"nominal": 1.0, "rest_speed": 1e-4, "rest_distance": 1e-3, "end_position": 0.95, "end_time": 10.0}
        drive = Drive(**{"mode": "free"} | usual | drive)
        self.slope, self.damping, self.n_dof, self.phases = slope, damping, 1, drive.phases
        self.force_scale, self.force_floor = WEIGHT, 1e-15
        self.attach_drive_and_reset(SimpleNamespace(drive=drive, sigma=SIGMA, alpha=400.0))

    def along(self, t, s, v, phase):
        return WEIGHT * math.sin(self.slope(s)) + float(self.drive.thrust(t, phase)) - self.damping * v

    def start(self, phase, state):
        if state is not None:
            return self.state_at_phase_start(state._replace(phase=phase))
        self.reset()
        return self.release_car(State(0.0, np.array([self.drive.start]), np.zeros(1), np.zeros(1), 0))

    def residual(self, t, q, v, a, phase):
        if self.mode.sticks:
            return MU * a
        rub = self.mode.heading * self.max_resistance(WEIGHT * math.cos(self.slope(q[0])))
        return MU * a - self.along(t, q[0], v[0], phase) + rub

    def linearise(self, t, q, v, a, phase, c):
        _, c1, c2 = c
        return self.residual(t, q, v, a, phase), lambda r: r / (MU * c2 + self.damping * c1)

    def car_forces(self, x):
        across = WEIGHT * math.cos(self.slope(x.q[0]))
        return CarForces(across, float(x.v[0]), self.along(x.t, x.q[0], 0.0, x.phase), across)

    def hold_and_normal_force(self, x):
        return -self.along(x.t, x.q[0], 0.0, x.phase), WEIGHT * math.cos(self.slope(x.q[0]))


def last_state_and_event_times(block, steps=400):
    """Return the last state of a ride, and its events by name."""
    work, times = Work(), [np.linspace(t0, t1, steps) for t0, t1 in block.phases]
    last = list(integrate(block, scheme("trapezoidal"), times, newton=Newton(tol=1e-13), work=work))[-1]
    found = {}
    for e in work.events:
        found.setdefault(e.name, []).append(e.t)
    return last, found


def braked_block_with_answer():
    """On an incline of 0.3, friction 0.05, down to a brake: rest zones as statics has them, then the exact answer."""
    brake, from_, start = 0.4, 0.5, 0.2
    block = Block(
        lambda s: 0.3, start=start, mu_r=0.05, brakes=((from_, brake),), departure_directions=((0.0, 1), (from_, 0))
    )
    a = SIGMA * (math.sin(0.3) - 0.05 * math.cos(0.3))
    b = brake / MU - a
    v = math.sqrt(2.0 * a * (from_ - start))
    return block, {"brake": v / a, "standstill": v / a + v / b}, from_ + v * v / (2.0 * b)


def test_friction_and_a_brake_bring_a_block_to_rest():
    block, times, place = braked_block_with_answer()
    last, found = last_state_and_event_times(block)
    for name, t in times.items():
        assert found[name] == pytest.approx([t], abs=1e-5)
    assert last.q[0] == pytest.approx(place, abs=1e-6)
    assert found["stop"] == pytest.approx([times["standstill"] + block.round_trip], rel=0.1)
    assert last.t == found["stop"][0]
    assert last.v[0] == 0.0


def test_a_block_breaks_loose_when_the_pull_exceeds_friction():
    """Held at first by friction, on a slope too gentle to slide on; thrust grows linearly in time."""
    slope, mu_r, rate = 0.1, 0.3, 0.25
    loose, table = WEIGHT * (mu_r * math.cos(slope) - math.sin(slope)) / rate, ((0.0, 0.0), (9.0, 9.0 * rate))
    block = Block(
        lambda s: slope,
        start=0.2,
        mu_r=mu_r,
        thrust_table=table,
        departure_directions=((0.0, 1),),
        end_time=loose + 0.9,
    )
    last, found = last_state_and_event_times(block)
    assert found["breaking loose"] == pytest.approx([loose], abs=1e-9)
    assert list(found) == ["breaking loose"]
    assert last.q[0] == pytest.approx(0.2 + rate * 0.9**3 / (6.0 * MU), abs=1e-5)


def test_a_block_turns_where_friction_cannot_hold_it_and_comes_back_slower():
    """Uphill it is slowed by weight and friction, downhill driven by weight less friction."""
    slope, mu_r, start, push, ends = -0.4, 0.1, 0.3, 0.6, 0.8
    table = ((0.0, push), (ends, push))
    block = Block(lambda s: slope, start=start, mu_r=mu_r, thrust_table=table, departure_directions=((0.0, -1),))
    weight, rub = SIGMA * math.sin(-slope), SIGMA * mu_r * math.cos(slope)
    up = push / MU - weight - rub
    v, s = up * ends, start + 0.5 * up * ends**2
    turn, top = ends + v / (weight + rub), s + 0.5 * v**2 / (weight + rub)
    down = weight - rub
    back = turn + math.sqrt(2.0 * (top - block.drive.rollback_end_position) / down)
    _, found = last_state_and_event_times(block)
    assert found["standstill"] == pytest.approx([turn], abs=1e-5)
    assert found["turn"] == pytest.approx([turn], abs=1e-3)
    assert found["back"] == pytest.approx([back], abs=1e-4)


@pytest.mark.parametrize("friction", [0.0, 0.05])
def test_a_block_that_creeps_into_a_valley_is_at_rest_there(friction):
    """Overdamped, s -> s* like exp(-k t/c): never at s*, but soon within `rest_distance` and below `rest_speed`."""
    bottom, k, c = 0.6, 0.5, 30.0  # sin(slope) = k (bottom - s)
    edge = bottom - math.tan(math.atan(friction)) / k  # where friction takes over, to first order
    directions = ((0.0, 1), (edge, 0), (2 * bottom - edge, -1))
    block = Block(
        lambda s: math.asin(k * (bottom - s)),
        c,
        start=0.2,
        mu_r=friction,
        departure_directions=directions,
        end_time=2000.0,
    )
    last, found = last_state_and_event_times(block, steps=3000)
    assert list(found)[-1] == "stop"
    assert abs(last.q[0] - edge) <= 2e-3
    moves = WEIGHT * k * 1e-3 / c  # speed where it is within rest_distance
    assert moves < 1e-4
    assert found["stop"][0] == pytest.approx(c / (WEIGHT * k) * math.log((edge - 0.2) / 1e-3), rel=0.05)


def test_a_block_that_rolls_on_does_not_stop():
    block = Block(lambda s: 0.3, start=0.2, mu_r=0.05, end_position=0.9, departure_directions=((0.0, 1),))
    _, found = last_state_and_event_times(block)
    a = SIGMA * (math.sin(0.3) - 0.05 * math.cos(0.3))
    assert list(found) == ["arrival"]
    assert found["arrival"] == pytest.approx([math.sqrt(2.0 * 0.7 / a)], abs=1e-5)


def test_the_laws_hold_of_a_ride_that_a_brake_ends():
    found = run_ladder(Scene.from_toml(TOML.replace("force = 40.0", "force = 900.0")), elements=6, steps=200)
    assert not broken_laws(found)
    assert [x["event"] for x in found.finest.events][-2:] == ["brake", "stop"]
    assert found.finest.events[-1]["speed"] == 0.0


KID = """
cable = {mass_per_length = 0.42, EA = 4.6e6, length = 61.0, damping = 0.01}
supports = {span = 60.0, drop = 2.4}
mass = {mass = 30.0}

[drive]
mode = "free"
start = 1.0
rolling_friction = 0.015
drag_area = 0.35
wind = -3.0
brake = [{from = 52.0, force = 100.0}]
"""


def test_a_child_whom_a_brake_holds_is_at_rest_though_the_rope_bounces():
    """Waves of a light rope move her by millimetres; a brake that holds her statically has stopped her."""
    scene = Scene.from_toml(KID)
    by_energy = quasi_static(scene).events[-1]
    stop = run(scene, "following-p2", elements=8, steps=400).events[-1]
    assert by_energy["event"] == stop["event"] == "stop"
    assert stop["s_o"] == pytest.approx(by_energy["s_o"], abs=0.1)
    assert stop["t"] == pytest.approx(by_energy["t"], abs=0.2)
