"""Prescribed travel: the laws, and s_o, ds_o/dt, d2s_o/dt2 against one another."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cablefem.scene import AccelerateCruiseBrake, ConstantAcceleration, ConstantSpeed, Motion, SceneError, Table

LENGTH = 730.0  # m


def timetable_of_law(law, t):
    return Table(times=tuple(t), positions=tuple(law(t)))


LAWS = {
    "speed": ConstantSpeed(speed=23.0),
    "ramp": ConstantSpeed(speed=23.0, entry_ramp=90.0),
    "from rest": ConstantAcceleration(acceleration=1.7),
    "faster": ConstantAcceleration(acceleration=0.4, initial_speed=11.0),
    "slower": ConstantAcceleration(acceleration=-0.4, initial_speed=31.0),
    "law (40)": AccelerateCruiseBrake(top_speed=19.0),
    "table": timetable_of_law(lambda t: 40.0 * t + 55.0 * (1.0 - np.cos(0.6 * t)), np.linspace(0.0, 14.0, 57)),
    "table from rest": timetable_of_law(lambda t: 3.1 * t**2 / (1.0 + 0.05 * t), np.linspace(0.0, 14.0, 29)),
}


def kinematic_defect(motion):
    """Largest gap between (ds_o, dds_o) of `at` and central differences of s_o and ds_o, over the mean speed.

    Taken inside every polynomial piece, because across a knot of the spline the third derivative jumps;
    `position` must agree with it, too.
    """
    duration = motion.end_time
    h, defect = 1e-5 * duration, 0.0
    for phase, ((_, stop), pieces) in enumerate(zip(motion.phases, motion.pieces, strict=True)):
        knots = [*(piece.start for piece in pieces), stop]
        for t in np.concatenate([np.linspace(t0 + 2.0 * h, t1 - 2.0 * h, 5) for t0, t1 in itertools.pairwise(knots)]):
            (s0, v0, _), (s, v, a), (s1, v1, _) = (motion.position_with_rates(t + dt, phase) for dt in (-h, 0.0, h))
            gaps = (
                (v - (s1 - s0) / (2.0 * h)) * duration,
                (a - (v1 - v0) / (2.0 * h)) * duration**2,
                s - float(motion.position(t)),
            )
            defect = max(defect, *(abs(gap) / motion.end_position for gap in gaps))
    return defect


@pytest.mark.parametrize("name", LAWS)
def test_speed_and_acceleration_are_derivatives_of_the_position(name):
    # rounding eps/h = 2e-11 and, for a cubic's third derivative, h^2 d3s/6, both relative to the mean speed
    assert kinematic_defect(LAWS[name].motion(LENGTH)) < 5e-8


@pytest.mark.parametrize("wrong", [(1e-6, 0.0, 0.0), (0.0, 1e-6, 0.0), (0.0, 0.0, 1e-5)])
def test_the_kinematic_check_sees_a_wrong_position_speed_or_acceleration(wrong):
    class Bent(Motion):
        def position_with_rates(self, t, phase):
            values, scale = super().position_with_rates(t, phase), self.end_time
            return tuple(
                v + w * self.end_position / scale**k for k, (v, w) in enumerate(zip(values, wrong, strict=True))
            )

    motion = LAWS["law (40)"].motion(LENGTH)
    assert kinematic_defect(Bent(motion.phases, motion.pieces, motion.end_position)) > 5e-7


@pytest.mark.parametrize("name", LAWS)
def test_a_travel_starts_at_the_left_support_and_never_turns(name):
    motion = LAWS[name].motion(LENGTH)
    assert motion.phases[0][0] == 0.0
    assert motion.position_with_rates(0.0, 0)[0] == 0.0
    for (_, t1), (t2, _) in zip(motion.phases[:-1], motion.phases[1:], strict=True):
        assert t1 == t2
    t = np.linspace(0.0, motion.end_time, 1001)
    s = motion.position(t)
    assert np.all(np.diff(s) > 0.0)
    assert s[-1] == motion.end_position <= LENGTH
    assert motion.position_with_rates(t[-1], len(motion.phases) - 1)[0] == motion.end_position
    assert max(motion.position_with_rates(ti, 0)[1] for ti in t if ti <= motion.phases[0][1]) <= motion.top_speed * (
        1.0 + 1e-14
    )
    np.testing.assert_array_equal(motion.position([-3.0, 1.1 * t[-1]]), [0.0, motion.end_position])
    if name not in ("table", "table from rest"):
        assert motion.end_position == LENGTH


@pytest.mark.parametrize("name", LAWS)
@given(fraction=st.floats(0.0, 1.0))
@settings(deadline=None, max_examples=10)
def test_time_at_inverts_position(name, fraction):
    motion = LAWS[name].motion(LENGTH)
    s = fraction * motion.end_position
    t = motion.time_at_position(s)
    assert motion.times_at_positions(np.array([s])).tolist() == [t]
    assert 0.0 <= t <= motion.end_time
    assert float(motion.position(t)) == pytest.approx(s, rel=1e-13, abs=1e-13 * LENGTH)


def test_time_at_names_the_range_of_the_travel():
    motion = LAWS["law (40)"].motion(LENGTH)
    assert motion.time_at_position(0.0) == 0.0
    assert motion.time_at_position(LENGTH) == motion.end_time
    for s in (-1e-9, 730.1, math.nan):
        with pytest.raises(ValueError, match=r"covers \[0, 730.0\]"):
            motion.time_at_position(s)


def test_the_laws_take_the_times_of_the_textbook():
    assert LAWS["speed"].motion(LENGTH).phases == ((0.0, LENGTH / 23.0),)
    ((_, t),) = LAWS["from rest"].motion(LENGTH).phases
    assert t == pytest.approx(math.sqrt(2.0 * LENGTH / 1.7), rel=1e-15)
    ((_, t),) = LAWS["slower"].motion(LENGTH).phases
    assert t == pytest.approx((31.0 - math.sqrt(31.0**2 - 2.0 * 0.4 * LENGTH)) / 0.4, rel=1e-13)


def test_law_40_has_three_thirds_and_stops_exactly():
    V, motion = 19.0, LAWS["law (40)"].motion(LENGTH)
    a = 1.5 * V**2 / LENGTH
    (_, t1), (_, t2), (_, t3) = motion.phases
    np.testing.assert_allclose([t1, t2 - t1, t3 - t2], LENGTH / V * np.array([2 / 3, 1 / 3, 2 / 3]), rtol=1e-14)
    np.testing.assert_allclose(motion.position([t1, t2]), [LENGTH / 3, 2 * LENGTH / 3], rtol=1e-14)
    # the acceleration is one-sided: each phase has its own at the common instant
    np.testing.assert_allclose(
        [motion.position_with_rates(t1, 0), motion.position_with_rates(t1, 1)],
        [(LENGTH / 3, V, a), (LENGTH / 3, V, 0.0)],
    )
    np.testing.assert_allclose(
        [motion.position_with_rates(t2, 1), motion.position_with_rates(t2, 2)],
        [(2 * LENGTH / 3, V, 0), (2 * LENGTH / 3, V, -a)],
    )
    assert motion.position_with_rates(t3, 2)[:2] == (LENGTH, 0.0)
    assert motion.position_with_rates(t3, 2)[2] == pytest.approx(-a, rel=1e-14)
    assert motion.top_speed == pytest.approx(V, rel=1e-14)


def test_at_continues_the_polynomial_of_its_phase_beyond_its_ends():
    motion = LAWS["law (40)"].motion(LENGTH)
    t1 = motion.phases[0][1]
    assert motion.position_with_rates(t1 + 0.3, 0)[1] == pytest.approx(
        19.0 + 0.3 * motion.position_with_rates(t1, 0)[2], rel=1e-14
    )
    assert motion.position_with_rates(t1 - 0.3, 1)[0] == pytest.approx(LENGTH / 3 - 0.3 * 19.0, rel=1e-14)


def test_a_table_of_a_cubic_is_that_cubic():
    t = np.array([0.0, 1.3, 2.2, 4.1, 5.7, 8.0])
    motion = timetable_of_law(lambda t: 17.0 * t + 2.3 * t**2 - 0.11 * t**3, t).motion(LENGTH)
    for ti in np.linspace(0.0, 8.0, 31):
        exact = (17.0 * ti + 2.3 * ti**2 - 0.11 * ti**3, 17.0 + 4.6 * ti - 0.33 * ti**2, 4.6 - 0.66 * ti)
        np.testing.assert_allclose(motion.position_with_rates(ti, 0), exact, rtol=1e-11, atol=1e-11)
    # the speed turns inside a piece, at t = 2.3/0.33 = 6.97
    assert motion.top_speed == pytest.approx(17.0 + 2.3**2 / 0.33, rel=1e-12)


@pytest.mark.parametrize("digits", [13, 3])
def test_a_table_of_a_start_from_rest_starts_exactly_at_rest(digits):
    t = np.linspace(0.0, 20.0, 21)
    motion = timetable_of_law(lambda t: np.round(0.9 * t**2, digits), t).motion(LENGTH)
    s, ds, dds = motion.position_with_rates(0.0, 0)
    assert (s, ds) == (0.0, 0.0)
    # rounding to 1e-3 m, over steps of 1 s, leaves the acceleration of the spline known to a few 1e-3 m/s^2
    assert dds == pytest.approx(1.8, abs=8e-3)
    slow = timetable_of_law(lambda x: 0.2 * x + 0.9 * x**2, t).motion(LENGTH)
    assert slow.position_with_rates(0.0, 0)[1] == pytest.approx(0.2, rel=1e-9), "a slow but real entry"


def test_short_tables_are_a_line_and_a_parabola():
    assert Table(times=(0.0, 4.0), positions=(0.0, 60.0)).motion(LENGTH).position_with_rates(1.0, 0) == (
        15.0,
        15.0,
        0.0,
    )
    motion = Table(times=(0.0, 1.0, 3.0), positions=(0.0, 2.0, 18.0)).motion(LENGTH)
    np.testing.assert_allclose(motion.position_with_rates(2.0, 0), (8.0, 8.0, 4.0), rtol=1e-13)


def test_a_table_ends_exactly_on_the_cable_when_its_last_digit_is_rounded():
    motion = Table(times=(0.0, 1.0, 2.0), positions=(0.0, 300.0, LENGTH * (1.0 + 3e-10))).motion(LENGTH)
    assert motion.end_position == LENGTH


@pytest.mark.parametrize("name", LAWS)
def test_a_motion_is_the_same_in_other_units(name):
    motion = LAWS[name].motion(LENGTH)
    length, time = 89.0, 0.37
    scaled = motion.in_units(length, time)
    assert kinematic_defect(scaled) < 5e-8
    for phase, (t0, t1) in enumerate(motion.phases):
        for t in (t0, 0.4 * t0 + 0.6 * t1, t1):
            expected = np.array(motion.position_with_rates(t, phase)) * [1.0 / length, time / length, time**2 / length]
            np.testing.assert_allclose(scaled.position_with_rates(t / time, phase), expected, rtol=1e-12, atol=1e-12)
    half = 0.5 * motion.end_position
    assert scaled.time_at_position(half / length) == pytest.approx(motion.time_at_position(half) / time, rel=1e-13)


@pytest.mark.parametrize("name", LAWS)
def test_faster_runs_the_same_law_in_less_time(name):
    motion, faster = LAWS[name].motion(LENGTH), LAWS[name].faster(1.9).motion(LENGTH)
    t = np.linspace(0.0, motion.end_time, 17)
    np.testing.assert_allclose(faster.position(t / 1.9), motion.position(t), rtol=1e-11, atol=1e-10)
    assert faster.top_speed == pytest.approx(1.9 * motion.top_speed, rel=1e-11)


def test_a_brake_that_just_reaches_the_far_support_is_admissible_and_a_harder_one_is_not():
    limit = -0.5 * 13.0**2 / LENGTH
    just = ConstantAcceleration(acceleration=limit, initial_speed=13.0)
    assert just.fault_on_cable(LENGTH) == ""
    motion = just.motion(LENGTH)
    assert motion.end_position == LENGTH
    assert motion.end_speed == pytest.approx(0.0, abs=1e-6)
    fault = ConstantAcceleration(acceleration=1.01 * limit, initial_speed=13.0).fault_on_cable(LENGTH)
    assert f"must be >= {limit!r} m/s^2" in fault


def test_laws_refuse_nonsense_where_they_are_made():
    with pytest.raises(SceneError, match=r"^speed = -3: must be a number > 0"):
        ConstantSpeed(speed=-3)
    with pytest.raises(SceneError, match=r"^times\[1\] = 0.0: must be > 0.0"):
        Table(times=(0, 0), positions=(0, 1))


def test_an_entry_ramp_begins_at_rest_and_meets_the_speed_with_a_smooth_acceleration():
    law = LAWS["ramp"]
    motion, T = law.motion(LENGTH), 1.5 * 90.0 / 23.0
    assert len(motion.phases) == 1
    assert motion.position_with_rates(0.0, 0) == (0.0, 0.0, pytest.approx(2.0 * 23.0 / T, rel=1e-14))
    np.testing.assert_allclose(
        motion.position_with_rates(T * (1.0 - 1e-12), 0), (90.0, 23.0, 0.0), rtol=1e-10, atol=1e-10
    )
    np.testing.assert_allclose(motion.position_with_rates(T, 0), (90.0, 23.0, 0.0), rtol=1e-14, atol=1e-14)
    assert motion.end_time == pytest.approx(T + 640.0 / 23.0, rel=1e-14)
    assert motion.top_speed == pytest.approx(23.0, rel=1e-14)
    assert law.faster(2.0).entry_ramp == 90.0
    assert "entry_ramp = 800.0: must be < 730 m" in ConstantSpeed(speed=3.0, entry_ramp=800.0).fault_on_cable(LENGTH)
