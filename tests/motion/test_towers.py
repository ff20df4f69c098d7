"""Cars that run over the shoes of towers."""

import dataclasses
import functools
import re

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from cablefem.catenary_line import solve
from cablefem.scene.errors import SceneError
from cablefem.scene.line import Line
from cablefem.scene.moving import line_in_motion
from cablefem.shoes import Passage
from tests.motion.lines import OVER, broken_laws
from validation.commands.check.motion import compare_and_check_laws
from validation.commands.run.motion import ELEMENTS, SINES, LineRuns, merge_instants, motion_answers
from validation.core.agreement import worst_deciding_verdict
from validation.core.motion_rows import LineTolerance
from validation.core.stored_files import read_csv_columns

WEIGHT = 1200.0 * 9.81
EVENTS = ["lands on the shoe of", "leaves the rope at", "takes the rope behind", "leaves the shoe of"]
HAULED = Line.from_toml(OVER)
GRIPS = Line.from_toml(OVER.replace('drive = {mode = "haul", drag_area = 2.0}', ""))


@functools.cache
def line_runs(method, drive):
    return LineRuns(method, {"hauled": HAULED, "grips": GRIPS}[drive])


@pytest.fixture(
    scope="module", params=[(method, drive) for method in (ELEMENTS, SINES) for drive in ("hauled", "grips")]
)
def motion_over_tower(request):
    return line_runs(*request.param).run(2, 2)


def test_a_car_lands_on_the_shoe_leaves_the_rope_takes_it_and_leaves_the_shoe(motion_over_tower):
    assert [name for name, _ in motion_over_tower.events] == [f"car {does} tower" for does in EVENTS]
    x = motion_over_tower.motion.cars[0].point[:, 0]
    at = np.interp([t for _, t in motion_over_tower.events], motion_over_tower.motion.t, x)
    np.testing.assert_allclose(np.delete(at, 1), [145.0, 151.0, 155.0], atol=0.02)
    assert 147.0 < at[1] < 149.02
    if np.isfinite(motion_over_tower.motion.cars[0].grip_force[0]):
        assert at[1] == pytest.approx(149.0, abs=0.02)


def test_the_rope_never_pulls_a_car_that_rolls_down_before_it_leaves(motion_over_tower):
    x = motion_over_tower.motion
    car = x.cars[0]
    if np.isfinite(car.grip_force[0]):
        pytest.skip("a grip holds the rope")
    before = x.t < dict(motion_over_tower.events)["car leaves the rope at tower"]
    assert (car.contact_force - car.shoe_force)[before].min() > -1e-3 * WEIGHT


def test_instants_on_a_shoe_that_differ_by_rounding_are_one():
    """A step of 1e-15 s would be extrapolated to the next one, 1e13 times as long."""
    grid = np.linspace(0.0, 1.0, 11)
    finer = 0.1 + 1e-15 + np.linspace(0.0, 0.4, 9)
    merged = merge_instants(grid, finer)
    assert np.isin(grid, merged).all()
    np.testing.assert_allclose(merged, [0.0, *np.linspace(0.1, 0.5, 9), 0.6, 0.7, 0.8, 0.9, 1.0], atol=1e-14)


def test_no_step_is_a_rounding_error():
    """The spline of a mean would have the slope of a jump there, and the mean a bar of 1e5 times the force."""
    t = LineRuns(SINES, Line.load("over-tower")).run(2, 1).motion.t
    steps = np.diff(t)
    assert steps[steps > 0.0].min() > 1e-9 * t[-1]


def test_the_shoe_does_no_work(motion_over_tower):
    x = motion_over_tower.motion
    work = cumulative_trapezoid(sum(x.powers.values()), x.t, initial=0.0)
    np.testing.assert_allclose(x.energy - x.energy[0], work, atol=8e-3 * np.ptp(x.energy))


def test_neither_path_nor_velocity_of_a_car_steps_at_an_event(motion_over_tower):
    """The shoe would need an impulse; a car that grips goes along the rope by the stretch of its other side."""
    x = motion_over_tower.motion
    jumps = np.flatnonzero(np.diff(x.t) == 0.0)
    car = x.cars[0]
    hauled = np.isfinite(car.haul_force[0])
    assert np.abs(np.diff(car.point, axis=0)[jumps]).max() < (1e-9 if hauled else 0.01)
    assert np.abs(np.diff(car.velocity, axis=0)[jumps]).max() < (1e-9 if hauled else 5e-4)


def test_the_tower_carries_rope_and_car(motion_over_tower):
    """Off the rope all of the car, less what its path turns it down."""
    x = motion_over_tower.motion
    car = x.cars[0]
    off = np.abs(car.point[:, 0] - 150.0) < 0.99
    np.testing.assert_allclose(car.shoe_force[off], car.contact_force[off])
    rope = x.contacts[1].tension_behind
    kink = np.max(x.contacts[1].pressure[off, 1] - car.shoe_force[off]) / np.mean(rope[off])
    assert 0.1 < kink < 0.3
    assert (car.shoe_force[np.abs(car.point[:, 0] - 150.0) > 5.01] == 0.0).all()


def test_a_car_passes_leftwards_as_rightwards():
    mirrored = HAULED.replace({"car.car.travel.from": 170.0, "car.car.travel.to": 130.0})
    there, back = (of.run(1, 1) for of in (line_runs(ELEMENTS, "hauled"), LineRuns(ELEMENTS, mirrored)))
    assert [name for name, _ in back.events] == [f"car {does} tower" for does in EVENTS]
    one, other = there.motion.cars[0], back.motion.cars[0]
    np.testing.assert_allclose(one.point[:, 0], 300.0 - other.point[:, 0], atol=1e-6)
    np.testing.assert_allclose(one.point[:, 1], other.point[:, 1], atol=1e-5)
    np.testing.assert_allclose(one.shoe_force, other.shoe_force, atol=1e-3 * WEIGHT)


def test_a_shoe_that_would_have_to_hold_a_car_down_is_said_first_with_its_column(tmp_path):
    fast = HAULED.replace({"car.car.travel.top_speed": 9.0})
    ladder = LineRuns(ELEMENTS, fast).ladder(1, 1)
    answers = motion_answers(fast, ladder, None)
    said = answers.outcome.sentence
    found = re.match(
        r"the shoe of tower would have to hold the car 'car' down with (0.\d\d) of its weight at x = .* "
        r"\((\w+) in (path-car.csv)\); about (\d+) % of", said,
    )  # fmt: skip
    assert found is not None
    share, column, file, percent = found.groups()
    answers.write(tmp_path, 0.0)
    smallest = read_csv_columns(tmp_path / file)[column].min()
    assert smallest == pytest.approx(-float(share) * WEIGHT, abs=0.006 * WEIGHT)
    slower = fast.replace({"car.car.travel.top_speed": 9.0 * float(percent) / 100.0})
    assert min(LineRuns(ELEMENTS, slower).run(1, 1).motion.cars[0].shoe_force) > -0.03 * WEIGHT


@pytest.fixture(scope="module")
def ladder():
    return line_runs(SINES, "hauled").ladder(2, 2)


def without_turning_force(motion):
    """The car's path is bent, and the force that bends it is missing on the shoe."""
    car, tower = motion.cars[0], motion.contacts[1]
    tau = car.velocity / np.maximum(np.hypot(*car.velocity.T), 1e-3)[:, None]
    normal = tau[:, ::-1] * [-1.0, 1.0]
    missing = 1200.0 * np.sum(normal * car.acceleration, axis=1) * (car.shoe_force != 0.0)
    pressure = tower.pressure + missing[:, None] * normal
    wrong = dataclasses.replace(tower, pressure=pressure)
    return dataclasses.replace(motion, contacts=(motion.contacts[0], wrong, motion.contacts[2]))


def test_a_car_that_bends_its_path_without_force_is_seen(ladder):
    assert not broken_laws(HAULED.to_toml(), ladder)
    wrong = ladder.map(lambda run: dataclasses.replace(run, motion=without_turning_force(run.motion)))
    assert broken_laws(HAULED.to_toml(), wrong) == {"momentum of rope and cars"}


def test_a_car_that_leaves_the_rope_before_this_lets_it_go_is_seen(ladder):
    def early(run):
        return dataclasses.replace(run, events=tuple((e, t - 0.3 * ("leaves the rope" in e)) for e, t in run.events))

    assert broken_laws(HAULED.to_toml(), ladder.map(early)) == {"places of events"}


@pytest.mark.slow
def test_a_shoe_a_tenth_longer_in_one_solver_is_seen(ladder):
    line = HAULED.replace({"contact.tower.shoe": 5.5})
    fault = LineRuns(SINES, line, line_runs(SINES, "hauled")).ladder(2, 2)
    rows = compare_and_check_laws(HAULED, ladder, fault, LineTolerance(1e-3, 1e-2))
    assert worst_deciding_verdict(rows).value == "disagree"


SECOND = OVER[OVER.index("[[car]]") :].replace('"car"', '"next"').replace("130.0, to = 170.0", "138.0, to = 178.0")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (OVER.replace("mass = 1200.0", "mass = 6000.0"), r"car.car.mass = 6000 kg: M g/N = 0.\d+ at the shoe of tower"),
        (OVER.replace("shoe = 5.0", ""), "contact.tower.shoe: missing; must be given where a car passes, here car"),
        (OVER.replace("from = 130.0", "from = 147.0"), "car.car: begins on the shoe of tower; must begin beside it"),
        (
            OVER.replace("from = 130.0, to = 170.0", "from = 150.3, to = 170.0").replace("shoe = 5.0", "shoe = 0.2"),
            "car.car: begins 0.3 m from tower; must be >= 1 m",
        ),
        (OVER + SECOND, "car.next.travel: on the shoe of tower together with car at t = "),
        (
            OVER + "[car.wheels]\nbase = 2.0\ninertia = 900.0\nbelow = 1.0",
            "car.car.wheels: tower is in the way; two wheels stay on one span",
        ),
    ],
)
def test_what_cannot_run_over_a_shoe_is_refused(text, says):
    with pytest.raises(SceneError, match=says) as error:
        line_in_motion(Line.from_toml(text), solve)
    assert len(error.value.faults) == 1


@pytest.mark.parametrize("method", [ELEMENTS, SINES])
def test_a_shoe_has_no_friction(method):
    rolling = Line.from_toml(OVER.replace("drag_area = 2.0", "drag_area = 2.0, rolling_friction = 0.02"))
    motion = LineRuns(method, rolling).run(1, 1).motion
    on_shoe = motion.cars[0].shoe_force != 0.0
    assert (motion.powers["car friction"][on_shoe] == 0.0).all()
    assert (motion.powers["car friction"][~on_shoe] < 0.0).sum() > 10


def test_a_car_behind_a_saddle_does_not_leave_the_rope_that_it_has_just_taken():
    """Where rounding puts it beyond the tip of the shoe, on rope that the shoe holds down."""
    saddle = next(c for c in line_in_motion(HAULED, solve).contacts if c.name == "tower")
    passage = Passage("car", "leaves the rope at", saddle, ends_with_pressure=True)
    assert passage.distance_to_go(149.5, 4.0, turn=-1e-3) < 0.0 < passage.distance_to_go(151.0 + 1e-12, 4.0, turn=-1e-3)


def test_a_cabin_that_stops_on_a_shoe_keeps_every_law():
    """The shoe pushes across the path of the car, which a standing one has, too."""
    text = OVER.replace("to = 170.0", "to = 148.0, rest = 3.0").replace("top_speed = 6.0", "top_speed = 3.0")
    text += "[car.hanger]\nmass = 1000.0\nlength = 3.0"
    assert broken_laws(text, LineRuns(ELEMENTS, Line.from_toml(text)).ladder(2, 4)) == set()
