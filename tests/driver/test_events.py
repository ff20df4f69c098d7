"""Events of small systems whose instants are known."""

import math

import numpy as np
import pytest

from cablefem.newmark import EndlessEvents, Newton, StepFailure, Work, integrate, scheme
from cablefem.newmark.march import MAX_EVENTS
from tests.driver.systems import Alarms, Ball, Rubbed

TIGHT = Newton(tol=1e-13)
TRAPEZOIDAL = scheme("trapezoidal")


def states_and_events(system, steps, method=TRAPEZOIDAL):
    """Return the states, and the events."""
    work = Work()
    end = system.phases[-1][1]
    return list(integrate(system, method, [np.linspace(0.0, end, steps + 1)], newton=TIGHT, work=work)), work.events


def contact_times(ball, end):
    """The exact instants of contact: sqrt(2 h/g) (1 + 2 e + 2 e^2 + ...)."""
    t, flight, out = 0.0, math.sqrt(2.0 * ball.q0 / ball.g), []
    t += flight
    while t < end:
        out.append(t)
        flight *= ball.restitution
        t += 2.0 * flight
    return out


@pytest.mark.parametrize("name", ["trapezoidal", "generalized-alpha", "radau", "gauss"])
def test_a_ball_bounces_when_it_must(name):
    """Free fall is of second degree in t, which these rules follow exactly: so are the instants, to rounding."""
    ball = Ball(end=3.6)
    _, events = states_and_events(ball, 17, scheme(name))
    assert [e.name for e in events] == ["ground"] * 4
    np.testing.assert_allclose([e.t for e in events], contact_times(ball, 3.6), rtol=0.0, atol=1e-13)
    few, many = (states_and_events(Ball(end=1.1), steps, scheme(name))[0][-1].q[0] for steps in (11, 170))
    assert many == pytest.approx(few, abs=1e-13)  # a bounce put at the end of its step: 0.03 off


def test_states_of_events_and_of_the_grid_are_there_as_before_the_change():
    states, events = states_and_events(Ball(end=3.6), 17)
    at = {x.t: x for x in states}
    assert all(at[e.t].v[0] < 0.0 for e in events)
    assert set(np.linspace(0.0, 3.6, 18)) < set(at)
    assert (np.diff([x.t for x in states]) > 0.0).all()
    assert all(x.q[0] > -1e-14 for x in states)


class Tossed(Ball):
    """A ball thrown upwards, that is caught at its top beyond a mark."""

    events = ("top", "mark")
    passed = False

    def event_values(self, x):
        return float(x.v[0]), math.inf if self.passed else 0.9 - float(x.q[0])

    def apply_event(self, name, x):
        self.passed |= name == "mark"
        return None if name == "top" else x


def test_a_mark_passed_and_left_again_in_one_step_is_no_less_passed():
    """s = v t - g t^2/2 is at 0.9 of its top v^2/(2 g) = 1 at t = (1 - sqrt(0.1)) v/g."""
    ball = Tossed(height=0.0, g=2.0, end=3.0)
    ball.v0 = 2.0
    _, events = states_and_events(ball, 1)
    assert [e.name for e in events] == ["mark", "top"]
    np.testing.assert_allclose([e.t for e in events], [1.0 - math.sqrt(0.1), 1.0], rtol=0.0, atol=1e-7)


def test_who_stops_at_an_event_and_goes_on_has_it_happen():
    """A law that switches at the instant of an arrival must not leave the car running on."""
    whole, events = states_and_events(Ball(end=3.6), 17)
    ball, work, times = Ball(end=3.6), Work(), [np.linspace(0.0, 3.6, 18)]
    begun = []
    for x in integrate(ball, TRAPEZOIDAL, times, newton=TIGHT, work=work):
        begun.append(x)
        if x.t == events[1].t:
            break
    begun += integrate(ball, TRAPEZOIDAL, times, newton=TIGHT, work=work, start=begun[-1])
    assert work.events == events
    assert [(x.t, *x.q, *x.v) for x in begun] == [(x.t, *x.q, *x.v) for x in whole]


def test_a_ball_that_comes_to_rest_by_ever_more_bounces_ends_with_a_typed_error():
    ball = Ball(restitution=0.5, end=4.0)
    limit = math.sqrt(2.0 * ball.q0 / ball.g) * (1.0 + 0.5) / (1.0 - 0.5)
    with pytest.raises(EndlessEvents, match=f"more than {MAX_EVENTS} events") as caught:
        states_and_events(ball, 10)
    # twenty bounces of the last step are 2^-20 of the time that was left
    assert caught.value.t == pytest.approx(limit, abs=1e-5)


def test_a_ball_that_bounces_on_and_on_ends_with_a_typed_error():
    ball = Ball(restitution=1.0, end=2000.0)
    with pytest.raises(EndlessEvents, match="more than 200 events"):
        states_and_events(ball, 4000)


@pytest.mark.parametrize("steps", [60, 160])
def test_dry_friction_takes_the_same_from_every_swing_and_holds_the_last_one(steps):
    """Turning points at (-1)^n (q0 - 2 n f/k); the trapezoidal rule keeps the energy of a swing, so they are exact."""
    rubbed = Rubbed(m=1.7, k=5.3, q0=1.0, v0=-1e-300, friction=0.8, end=6.0)
    states, events = states_and_events(rubbed, steps)
    drop = 2.0 * 0.8 / 5.3
    turns = [1.0 - drop, -(1.0 - 2.0 * drop), 1.0 - 3.0 * drop]
    at = {x.t: x.q[0] for x in states}
    assert len(events) == 3
    np.testing.assert_allclose([at[e.t] for e in events], -np.array(turns), rtol=0.0, atol=1e-11)
    assert abs(turns[-1]) < 0.8 / 5.3  # where the spring is too weak
    stuck = [x for x in states if x.t > events[-1].t]
    assert len(stuck) > 5
    assert max(abs(x.q[0] - at[events[-1].t]) for x in stuck) < 1e-13
    half_period = math.pi * math.sqrt(1.7 / 5.3)
    # the rule's period is too long by (omega dt)^2 / 12
    late = (6.0 / steps) ** 2 * 5.3 / 1.7 / 12.0
    np.testing.assert_allclose(np.diff([0.0] + [e.t for e in events]), half_period * (1.0 + late), rtol=0.1 * late)


def test_an_event_at_a_steps_end_costs_no_step():
    grid = np.linspace(0.0, 1.0, 11)
    for shift in (0.0, 1e-17, -1e-17, 3e-16, -3e-16):
        states, events = states_and_events(Alarms(bell=lambda t, at=0.3 + shift: at - t), 10)
        assert len(events) == 1
        assert len(states) == 11
        np.testing.assert_allclose([x.t for x in states], grid, rtol=0.0, atol=1e-15)
        assert events[0].t in [x.t for x in states]


def test_events_of_one_step_come_in_their_order():
    states, events = states_and_events(
        Alarms(late=lambda t: 0.37 - t, early=lambda t: 0.31 - t, between=lambda t: 0.35 - t**1.5), 10
    )
    assert [e.name for e in events] == ["early", "late", "between"]  # 0.35^(2/3) = 0.497 is another step's
    states, events = states_and_events(
        Alarms(late=lambda t: 0.37 - t, early=lambda t: 0.31 - t, between=lambda t: 0.2 - t**1.5), 10
    )
    assert [e.name for e in events] == ["early", "between", "late"]
    np.testing.assert_allclose([e.t for e in events], [0.31, 0.2 ** (2.0 / 3.0), 0.37], rtol=1e-15)
    assert {e.t for e in events} <= {x.t for x in states}


def test_events_at_one_instant_are_passed_one_after_another_while_they_hold():
    _, events = states_and_events(Alarms(a=lambda t: 0.45 - t, b=lambda t: 3.0 * (0.45 - t)), 10)
    assert sorted(e.name for e in events) == ["a", "b"]
    assert abs(events[0].t - events[1].t) < 1e-15

    class Either(Alarms):
        """The first event that is passed calls the other one off."""

        gone = False

        def event_values(self, x):
            return (np.inf, np.inf) if self.gone else super().event_values(x)

        def apply_event(self, name, x):
            self.gone = True
            return x

    _, events = states_and_events(Either(a=lambda t: 0.45 - t, b=lambda t: 0.45 - t), 10)
    assert len(events) == 1


def test_touching_zero_is_an_event_at_the_end_of_a_step_only():
    """What steps do not see is no event."""
    _, events = states_and_events(Alarms(touch=lambda t: (t - 0.33) ** 2), 10)
    assert events == []
    states, events = states_and_events(Alarms(touch=lambda t: (10.0 * t - 5.0) ** 2), 10)
    assert [(e.name, e.t) for e in events] == [("touch", 0.5)]
    assert len(states) == 11


def test_what_is_not_armed_does_not_happen():
    alarms = Alarms(low=lambda t: -1.0, off=lambda t: np.inf, fall=lambda t: np.inf if t < 0.5 else -1.0)
    assert states_and_events(alarms, 10)[1] == []


def test_an_event_may_end_the_run():
    states, events = states_and_events(Alarms(over=lambda t: 0.4321 - t), 10)
    assert states[-1].t == events[-1].t == pytest.approx(0.4321, rel=1e-15)
    assert len(states) == 6


def test_an_event_without_a_value_is_a_failure():
    with pytest.raises(StepFailure, match="'lost' has no value"):
        states_and_events(Alarms(lost=lambda t: math.nan if t > 0.5 else 1.0), 10)


def test_a_value_whose_sign_rounding_turns_from_look_to_look_is_an_event_all_the_same():
    looks = []

    def brink(t):
        looks.append(t)
        return -1.0 if t > 0.45 else 1e-17 if looks.count(t) < 3 else -1e-17

    _, events = states_and_events(Alarms(brink=brink), 10)
    assert [e.name for e in events] == ["brink"]
    assert events[0].t == pytest.approx(0.45, abs=1e-12)


@pytest.mark.parametrize("name", ["trapezoidal", "radau"])
def test_a_sign_that_holds_for_the_step_is_told_at_its_beginning(name):
    """Friction by the sign of v at a step's beginning: the standstill inside the step is then met by every rule."""

    class Untold(Rubbed):
        def start(self, phase, state):
            x = super().start(phase, state)
            self.sign = 1.0  # forgotten
            return x

    class Told(Untold):
        def begin_step(self, x):
            if self.sign:
                self.sign = np.sign(x.v[0]) or self.sign

    kind = {"m": 1.7, "k": 5.3, "q0": 1.0, "v0": -1e-300, "friction": 0.8, "end": 2.5}
    states, events = states_and_events(Told(**kind), 60, scheme(name))
    at = {x.t: x.q[0] for x in states}
    # the first two rules keep the energy of a linear swing, the third to its order
    assert at[events[0].t] == pytest.approx(-(1.0 - 2.0 * 0.8 / 5.3), abs=1e-7 if name == "radau" else 1e-11)
    assert states_and_events(Untold(**kind), 60, scheme(name))[1] == []  # the twin: pushed on by its friction
