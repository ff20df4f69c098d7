"""What ends the run of a line, and cars that roll freely."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

import cablefem as cf
from cablefem.catenary_line import solve
from cablefem.elements.system import LineElements
from cablefem.newmark import StepFailure, Work, integrate, integrate_blocks, scheme, step_times_by_phase
from cablefem.scene.contacts import AT_REST
from cablefem.scene.line import Line
from cablefem.scene.moving import line_in_motion
from galerkin.lines import LineSines
from tests.motion.lines import LEFT, Smooth, anchor, car, line, run_and_observe, saddle

ZIP = {"mass_per_length": 1.1, "EA": 1.2e6, "length": 151.0}


def rider_line(t_end: float = 30.0, **drive: float):
    return line(
        ZIP, LEFT, car("rider", 95.0, None, "free", start=15.0, **drive), anchor("right", 150.0, 3.0), t_end=t_end
    )


def event_names_and_end_time(scene, steps: int) -> tuple[list[str], float]:
    """Names of the events and the time of the last state."""
    system, work = LineElements(scene, elements=3), Work()
    blocks = list(integrate_blocks(system, scheme("radau"), step_times_by_phase(system, steps), work=work))
    last = blocks[-1][-1]
    return [event.name for event in work.events], last.t


def test_a_free_rider_keeps_the_account_of_energy():
    x = run_and_observe(LineElements(rider_line(8.0, mu_r=0.02, k=0.3, wind=-2.0), elements=4), 320)
    work = np.append(0.0, cumulative_simpson(sum(x.powers.values()), x=x.t))
    np.testing.assert_allclose(x.energy - x.energy[0], work, atol=5e-4 * np.ptp(x.energy))
    at = x.cars[0]
    assert at.s[-1] > 60.0
    np.testing.assert_allclose(at.tension_behind[40:], at.tension_ahead[40:], rtol=5e-3)


def test_friction_stops_a_rider_or_holds_it():
    names, t = event_names_and_end_time(rider_line(mu_r=0.15), 300)
    assert names == ["rider stops", AT_REST]
    assert 5.0 < t < 29.0
    with pytest.raises(StepFailure, match="friction or brakes hold rider where it begins"):
        LineElements(rider_line(mu_r=0.9)).start(0, None)


@pytest.mark.parametrize("system", [LineElements, lambda scene: LineSines(scene, 6)])
def test_a_thrust_moves_a_car_that_its_brake_alone_would_hold(system):
    def sled(thrust):
        times = ((0.0, thrust), (5.0, thrust))
        contact = car("sled", 95.0, None, "free", start=75.0, thrust_table=times, brakes=((0.0, 1500.0),))
        return system(line(ZIP, LEFT, contact, anchor("right", 150.0, 3.0), t_end=1.0))

    assert run_and_observe(sled(3000.0), 20).cars[0].ds[-1] > 5.0
    with pytest.raises(StepFailure, match="friction or brakes hold sled where it begins"):
        sled(1000.0).start(0, None)


def test_a_brake_is_reached_in_both_wings_and_acts_from_there_on():
    scene = rider_line(8.0, mu_r=0.02, brakes=((40.0, 100.0),))
    times = []
    for system in (LineElements(scene, elements=3), LineSines(scene, 6)):
        work = Work()
        states = list(integrate(system, scheme("radau"), step_times_by_phase(system, 80), work=work))
        assert [event.name for event in work.events] == ["rider brakes"]
        times.append(work.events[0].t)
        x = system.observe(states, np.array([1.0]))
        at = x.cars[0]
        braked = at.s > 40.0
        speed = at.ds * np.linalg.norm(at.slope_ahead, axis=1)
        friction = -(0.02 * np.abs(at.contact_force) + 100.0 * braked) * speed
        clear = np.abs(x.t - times[-1]) > 1e-9
        np.testing.assert_allclose(x.powers["rider friction"][clear], friction[clear], rtol=1e-2, atol=1.0)
    assert times[0] == pytest.approx(times[1], abs=1e-3)


def test_two_cars_that_meet_end_the_run():
    contacts = car("one", 95.0, None, "free", start=15.0), car("two", 80.0, None, "free", start=30.0, mu_r=0.04)
    names, _ = event_names_and_end_time(line(ZIP, LEFT, *contacts, anchor("right", 150.0, 3.0), t_end=30.0), 300)
    assert names == ["one meets two"]


def test_the_outcome_says_where_a_run_ends_and_from_where_on_bars_are_no_bound():
    fast = {"drive.mode": "haul", "travel.top_speed": 300.0, "travel.acceleration": 100.0, "travel.deceleration": 100.0}
    sled = Line.load("two-cars").replace({f"car.up.{key}": value for key, value in fast.items()} | {
        "car.up.travel.to": 820.0, "car.down.travel.from": 860.0, "car.down.travel.to": 850.0,
    })  # fmt: skip
    sentence = cf.run(sled).outcome.sentence
    assert "up is faster than transverse waves from x = " in sentence
    assert "with up at x = " in sentence
    assert "this ends the run for all cars" in sentence


@pytest.mark.parametrize("name", ["rocket-trolley", "two-cars", "over-tower"])
def test_both_solvers_name_events_alike(name):
    """Of two wheels they did not: a trolley that came to a support was a disagreement."""
    scene = line_in_motion(Line.load(name), solve)
    assert sorted(LineElements(scene, elements=2).events) == sorted(LineSines(scene, 3).events)


def test_a_car_reaches_a_saddle_a_meter_before_it():
    rope = {"mass_per_length": 9.0, "EA": 1.4e8, "length": 824.0}
    scene = line(rope, LEFT, car("up", 2000.0, Smooth(385.0, 5.0, 4.0)), saddle("tower", 400.0, -30.0),
                 anchor("right", 820.0, -20.0))  # fmt: skip
    names, t = event_names_and_end_time(scene, 60)
    assert names == ["up reaches tower"]
    assert 5.0 < t < 6.0


def test_a_saddle_that_would_have_to_hold_the_rope_down_is_refused():
    rope = {"mass_per_length": 9.0, "EA": 1.4e8, "length": 824.0}
    contacts = LEFT, saddle("tower", 400.0, 30.0), anchor("right", 820.0, -20.0)
    with pytest.raises(StepFailure, match="the smallest pressure on a saddle -"):
        LineElements(line(rope, *contacts)).start(0, None)
