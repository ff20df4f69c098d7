"""Free cars that friction or a brake holds while others move."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from cablefem.catenary_line import solve
from cablefem.elements.system import LineElements
from cablefem.line_in_motion import positions_for_brakes_between_jumps
from cablefem.newmark import Work, integrate, scheme, step_times_by_phase
from cablefem.scene.contacts import AT_REST
from cablefem.scene.line import Line
from cablefem.scene.moving import line_in_motion
from galerkin.lines import LineSines
from tests.motion.lines import BODIES, broken_laws
from validation.commands.check.motion import check_line, compare_and_check_laws
from validation.commands.run.motion import ELEMENTS, SINES, LineRuns, events_without_rattling, motion_answers
from validation.core.agreement import worst_deciding_verdict
from validation.core.motion_laws import every_nth_step
from validation.core.motion_rows import LineRun, LineTolerance, law_row, relative_unbalanced_work
from validation.core.readback import moving_line_outcome_faults

ROPE = """
[cable]
mass_per_length = 1.1
EA = 1.2e6
length = 302.0
[[contact]]
name = "left"
kind = "anchor"
at = [0.0, 0.0]
[[contact]]
name = "right"
kind = "anchor"
at = [300.0, 20.0]
"""


def rider_toml(name, mass, start, brake):
    """A free car: mass [kg], start [m], and brake from [m] with a force [N]."""
    return f"""
[[car]]
name = "{name}"
mass = {mass}
[car.drive]
mode = "free"
start = {start}
rolling_friction = 0.02
drag_area = 0.5
brake = [{{from = {brake[0]}, force = {brake[1]}}}]
end = {{time = 30.0}}
"""


def line_of_rider(drive):
    """A rider of 90 kg alone."""
    text = ROPE + '[[car]]\nname = "rider"\nmass = 90.0\ndrive = {mode = "free"}\n'
    return Line.from_toml(text).replace({f"car.rider.drive.{key}": value for key, value in drive.items()})


RIDERS = ROPE + rider_toml("rear", 80.0, 8.0, (60.0, 500.0)) + rider_toml("ahead", 95.0, 40.0, (220.0, 300.0))
FRICTION = "friction that holds cars"
PLACES = "places of events"
WINGS = {
    "elements": lambda scene, n: LineElements(scene, elements=n),
    "sines": lambda scene, n: LineSines(scene, 2 * n),
}


@pytest.fixture(scope="module")
def line():
    return Line.from_toml(RIDERS)


@pytest.fixture(scope="module")
def ladders(line):
    first = LineRuns(ELEMENTS, line)
    return first.ladder(2, 2), LineRuns(SINES, line, first).ladder(2, 2)


def event_times_and_motion(wing, line, n, steps):
    """Events and motion."""
    system, work = WINGS[wing](line_in_motion(line, solve), n), Work()
    states = list(integrate(system, scheme("radau"), step_times_by_phase(system, steps), work=work))
    return {event.name: event.t for event in work.events}, system.observe(states, np.array([1.0]))


@pytest.mark.parametrize("wing", WINGS)
def test_the_run_goes_on_past_a_rider_that_its_brake_holds(line, wing):
    times, x = event_times_and_motion(wing, line, 2, 240)
    assert list(times) == ["rear brakes", "rear stops", "ahead brakes", "ahead stops", AT_REST]
    assert times["rear stops"] == pytest.approx(9.33, abs=0.02)
    rear, ahead = x.cars
    held = x.t > times["rear stops"]
    assert np.ptp(rear.s[held]) == 0.0
    assert not x.powers["rear friction"][held].any()
    assert np.ptp(rear.point[held, 1]) > 0.1  # the rope moves with it
    assert np.ptp(ahead.s[held]) > 100.0


@pytest.mark.parametrize("wing", WINGS)
def test_a_rider_that_friction_holds_has_stopped_and_does_not_stop_again(line, wing):
    system = WINGS[wing](line_in_motion(line, solve), 1)
    x = system.start(0, None)
    stops = system.events.index("rear stops")
    assert np.isfinite(system.event_values(x)[stops])
    rear = system.stops[0]
    system.set_friction_and_forget_event_values(rear, system.reached[rear], 0.0)
    assert system.event_values(x)[stops] == np.inf


def test_both_solvers_and_the_laws_agree_on_it(line, ladders):
    rows = compare_and_check_laws(line, *ladders, LineTolerance(2e-2, 0.1))
    assert worst_deciding_verdict(rows).value == "agree"
    assert FRICTION in {row.law.rpartition(",")[0] for row in rows}
    for ladder in ladders:
        assert np.abs(relative_unbalanced_work(ladder.finest)).max() < 1e-3


@pytest.mark.slow
def test_a_check_agrees(line):
    assert worst_deciding_verdict(check_line(line).rows).value == "agree"


def test_a_brake_of_another_force_in_one_solver_is_seen(line, ladders):
    """A car of another mass: test_check.py."""
    wrong = line.replace({"car.rear.drive.brake.0.force": "+5%"})
    other = LineRuns(SINES, wrong, LineRuns(ELEMENTS, line)).ladder(2, 2)
    rows = compare_and_check_laws(line, ladders[0], other, LineTolerance(2e-2, 0.1))
    assert worst_deciding_verdict(rows).value == "disagree"


def test_a_rider_that_stays_though_its_brake_is_too_weak_is_seen_by_the_law_of_friction(line, ladders):
    """It needs about 130 N in the mean, and its wheels rub with 16 N."""
    weaker = line.replace({"car.rear.drive.brake.0.force": 10.0})
    for ladder in ladders:
        assert FRICTION in broken_laws(weaker.to_toml(), ladder)


def test_a_brake_that_begins_elsewhere_or_not_at_all_is_seen_by_the_law_of_places(line, ladders):
    """Both solvers would agree on it, and the work of a metre of brake is a hundredth of all work."""
    elsewhere = line.replace({"car.rear.drive.brake.0.from": 61.0})
    without = line.replace({"car.rear.drive.brake": []})
    for ladder in ladders:
        assert PLACES not in broken_laws(line.to_toml(), ladder)
        assert PLACES in broken_laws(elsewhere.to_toml(), ladder)
        assert PLACES in broken_laws(without.to_toml(), ladder)


def test_a_brake_acts_from_its_event_on_though_the_step_there_overshoots():
    t = np.array([0.0, 1.0, 2.0, 2.0, 3.0, 4.0, 4.0, 5.0])
    s = np.array([0.0, 5.0, 10.0, 10.0, 12.0, 10.0, 10.0, 8.0]) + 1e-6  # reaches 10 m, and leaves it again
    acts = positions_for_brakes_between_jumps(t, s) >= 10.0
    assert acts.tolist() == [False, False, False, True, True, True, False, False]
    t = np.array([0.0, 1.0, 1.0, 2.0, 2.0, 3.0])
    s = np.array([0.0, 10.0, 10.0, 20.0, 20.0, 25.0]) + 1e-6  # two brakes within one step
    position = positions_for_brakes_between_jumps(t, s)
    assert (position >= 10.0).tolist() == [False, False, True, True, True, True]
    assert (position >= 20.0).tolist() == [False, False, False, False, True, True]


def test_a_law_is_no_surer_than_its_sampling_where_the_largest_defect_happens_to_stay(ladders):
    """Waves that stations are too far apart for move a defect at each time, and hardly its largest value."""
    ladder = ladders[0]
    t = ladder.finest.motion.t

    def defect(run, every=1):
        sampled_coarsely = run.motion.s.shape != ladder.finest.motion.s.shape
        return (1e-4 * np.sin(t) * (-1.0 if sampled_coarsely else 1.0))[every_nth_step(t, every)]

    row = law_row(ladder, "laws_si", "waves", defect, t[-1])
    assert row.bound.parts[1].value == pytest.approx(2.0 * row.gap)


@pytest.mark.parametrize(
    ("event", "until"),
    [("rider reaches right", 2.97), ("rider meets other", 1.98), ("rider stops", 2.99), (None, 2.99)],
)
def test_what_a_car_runs_into_is_compared_until_a_hundredth_of_the_span_is_left(event, until):
    """Waves between them get shorter than any step."""
    t = np.linspace(0.0, 3.0, 301)
    bodies = {"rider": 100.0 * t, "other": 400.0 - 100.0 * t, "left": 0.0 * t, "right": 300.0 + 0.0 * t}
    named = [SimpleNamespace(name=name, s=s) for name, s in bodies.items()]
    last = t <= (1.995 if event == "rider meets other" else 2.995)  # a metre before
    for body in named:
        body.s = body.s[last]
    run = LineRun(
        method="", settings={}, motion=SimpleNamespace(t=t[last], cars=named[:2], contacts=named[2:]),
        events=((event, t[last][-1]),) if event else (), reason=None, period=0.1, instants=t, n_dof=1, work=Work(),
        seconds=0.0,
    )  # fmt: skip
    assert run.comparable_until == pytest.approx(until, abs=0.011)  # a step


def test_a_defect_counts_up_to_the_end_of_what_is_compared(ladders):
    t = ladders[0].finest.motion.t

    def row(when):
        jump = np.where(t > when, 0.01, 0.0)
        return law_row(
            ladders[0],
            "laws_si",
            "jump",
            lambda run, every=1: jump[every_nth_step(t, every)][: run.motion.t.size],
            10.0,
        )

    assert row(10.0).gap == 0.0
    assert row(9.0).gap == 0.01


def test_energy_of_a_ride_without_friction_and_drag_is_over_what_it_takes_from_its_weight():
    free = line_of_rider({"start": 20.0, "end": {"time": 12.0}})
    assert np.abs(relative_unbalanced_work(LineRuns(ELEMENTS, free).run(2, 2))).max() < 1e-3


def test_a_stop_in_a_strong_brake_is_refined_in_time_until_it_agrees():
    """Its time errs by the steps, not by the mesh."""
    brake = [{"from": 120.0, "force": 500.0}]
    strong = line_of_rider({"start": 8.0, "rolling_friction": 0.02, "brake": brake, "end": {"time": 40.0}})
    assert worst_deciding_verdict(check_line(strong, tol=4e-3).rows).value == "agree"


@pytest.mark.parametrize("wing", WINGS)
def test_the_wave_of_another_brake_tears_a_rider_loose(line, wing):
    """It runs along the unstretched rope at sqrt(EA/rho)."""
    brakes = {"car.rear.drive.brake.0.from": 30.0, "car.rear.drive.brake.0.force": 240.0}
    times, x = event_times_and_motion(wing, line.replace(brakes | {"car.ahead.drive.brake.0.force": 1500.0}), 8, 480)
    assert times["rear breaks loose"] > times["ahead brakes"]
    first = np.searchsorted(x.t, times["ahead brakes"])
    moved = x.t[np.flatnonzero((x.t > times["ahead brakes"]) & (x.cars[0].ds != 0.0))[0]]
    way = x.cars[1].s[first] - x.cars[0].s[first]
    assert moved - times["ahead brakes"] == pytest.approx(way / np.sqrt(1.2e6 / 1.1), abs=0.03)
    assert 0.02 < x.cars[0].s[-1] - x.cars[0].s[first] < 1.0


def test_a_car_on_two_wheels_is_held_too():
    """A sled stops in its brake while a cabin goes on; its rear wheel rolls by what the rope between both stretches."""
    text = BODIES.replace("times = [0.0, 9.0]", "times = [0.0, 1.0]").replace("force = 1e3", "force = 1.8e3")
    scene = Line.from_toml(text.replace("to = 303.0", "to = 316.0"))
    runs = [LineRuns(solver, scene).run(2, 2) for solver in (ELEMENTS, SINES)]
    for run in runs:
        assert [name for name, _ in run.events] == ["sled brakes", "sled stops"]
        sled = run.motion.cars[0]
        held = run.motion.t > run.events[-1][1]
        assert np.ptp(sled.s[held]) < 1e-3
        assert np.ptp(sled.turning.wheels[0].s[held]) < 1e-3
        assert np.abs(relative_unbalanced_work(run)).max() < 1e-3
    assert runs[0].events[-1][1] == pytest.approx(runs[1].events[-1][1], abs=2e-3)


def test_the_outcome_says_where_a_rider_stays_and_is_read_back(line, ladders, tmp_path):
    result = motion_answers(line, *ladders)
    assert result.outcome.sentence.startswith("rear stops at x = 84.5 m after 9.3 s; ahead stops at x = 227.")
    result.write(tmp_path, 0.0)
    assert list(moving_line_outcome_faults(tmp_path)) == []
    file = tmp_path / "summary.json"
    summary = json.loads(file.read_text())
    file.write_text(json.dumps(summary | {"outcome": summary["outcome"].replace("x = 84.5", "x = 48.5")}))
    assert len(list(moving_line_outcome_faults(tmp_path))) == 1


@pytest.mark.parametrize("stop", [None, 21.3])
def test_a_run_that_ends_before_its_cars_are_at_rest_is_seen(line, ladders, tmp_path, stop):
    """Of the rider ahead, who stops half a second before the end, no stop is written, or one just before the end."""
    motion_answers(line, *ladders).write(tmp_path, 0.0)
    file = tmp_path / "summary.json"
    summary = json.loads(file.read_text())
    *events, last = summary["events"]
    assert last["event"] == "ahead stops"
    if stop is not None:
        events.append(last | {"t": stop})
    file.write_text(json.dumps(summary | {"events": events}))
    early = [
        fault for fault in moving_line_outcome_faults(tmp_path) if "of 30 s, and ahead is not at rest by then" in fault
    ]
    assert len(early) == 1


def test_a_rattle_of_a_car_that_stays_is_no_event():
    """Of what happens within a centimeter the first stop counts, and the last breaking loose of a car that leaves."""
    drive = SimpleNamespace(rest_distance=0.01)
    line = SimpleNamespace(cars_on_rope=[SimpleNamespace(name="a", drive=drive)])
    places = {0.0: 5.0, 1.0: 5.001, 2.0: 5.001, 3.0: 20.0, 4.0: 20.0, 5.0: 20.002, 6.0: 20.002, 8.0: 30.0, 9.0: 30.0}
    motion = SimpleNamespace(t=np.array([*places]), cars=[SimpleNamespace(name="a", s=np.array([*places.values()]))])
    names = [
        "a stops",
        "a breaks loose",
        "a stops",
        "a breaks loose",
        "a stops",
        "a breaks loose",
        "b brakes",
        "a stops",
    ]
    events = list(zip(names, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], strict=True))
    kept = (("a stops", 3.0), ("a breaks loose", 6.0), ("b brakes", 7.0), ("a stops", 8.0))
    assert events_without_rattling(events, line, motion) == kept


def test_a_rider_that_a_slow_release_holds_at_first_sets_out():
    """Waves stop it again and again while the hold goes."""
    held = ROPE + rider_toml("ahead", 95.0, 40.0, (220.0, 300.0)) + "release = 6.0\n"
    alone = Line.from_toml(held)
    run = LineRuns(ELEMENTS, alone).run(2, 2)
    assert [name for name, _ in run.events] == ["ahead brakes", "ahead stops"]


@pytest.mark.parametrize("solver", [ELEMENTS, SINES])
def test_friction_holds_a_rider_until_its_release_leaves_it_more_than_friction(solver):
    """It rolled uphill at first, by friction and the hold together."""
    held = rider_toml("rider", 90.0, 40.0, (220.0, 300.0)) + "release = 6.0\n"
    run = LineRuns(solver, Line.from_toml(ROPE + held)).run(1, 1)
    rider = run.motion.cars[0]
    behind = rider.slope_behind[0] / np.linalg.norm(rider.slope_behind[0])
    ahead = rider.slope_ahead[0] / np.linalg.norm(rider.slope_ahead[0])
    fall = -(behind + ahead)[1] / np.linalg.norm(behind + ahead)
    friction = 0.02 * np.sqrt(1.0 - fall**2) / abs(fall)  # over what pulls the rider
    x = brentq(lambda x: (1.0 - x) ** 2 * (1.0 + 2.0 * x) - 1.0 + friction, 0.0, 1.0)
    assert np.all(rider.ds >= -1e-9)
    moves = run.motion.t[np.flatnonzero(rider.ds > 1e-9)[0]]
    assert moves == pytest.approx(6.0 * x, abs=0.3)
    assert np.all(rider.ds[run.motion.t < 6.0 * x - 0.3] == 0.0)


TURNING = """
[cable]
mass_per_length = 0.329
EA = 3.206e+06
tension = {at = "top", value = 1.257e+04}
[[contact]]
name = "top"
kind = "anchor"
at = [0.0, 0.0]
[[contact]]
name = "bottom"
kind = "anchor"
at = [598.4, 43.98]
[[car]]
name = "rider"
mass = 59.0
drive = {mode = "free", start = 5.01, rolling_friction = 0.0134, drag_area = 0.60, end = {time = 80.0}}
"""


@pytest.mark.parametrize("method", [ELEMENTS, SINES], ids=lambda method: method.name)
def test_a_rider_turns_at_one_time_however_long_the_steps(method):
    """Friction nearly holds him: 0.15 s more of it at the turn delay him by 0.3 s for the rest of the ride."""
    runs = LineRuns(method, Line.from_toml(TURNING))
    coarse, fine = (runs.run(4, steps) for steps in (1, 4))
    assert [name for name, _ in coarse.events] == ["rider stops", "rider breaks loose"]
    assert runs.grid[0][1] > 0.4  # [s] longer than he sticks
    np.testing.assert_allclose([t for _, t in coarse.events], [t for _, t in fine.events], rtol=0.0, atol=2e-3)
    for name in ("point", "velocity"):
        at_end = [getattr(run.motion.cars[0], name)[-1] for run in (coarse, fine)]
        np.testing.assert_allclose(*at_end, rtol=0.0, atol=2e-3)
