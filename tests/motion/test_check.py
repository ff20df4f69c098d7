"""`run` and `check` of lines in motion: what agrees, which faults are seen, files, refusals."""

import csv
import dataclasses
import json
import re

import numpy as np
import pytest

import cablefem as cf
from cablefem.scene import Scene
from cablefem.scene.line import Line
from tests.commands.calls import fault_lines
from tests.motion.lines import BODIES
from validation.commands.check.motion import check_line, compare_and_check_laws, law_rows
from validation.commands.run.motion import ELEMENTS, SINES, LineRuns, answer_line, motion_answers
from validation.core import motion_laws
from validation.core.agreement import worst_deciding_verdict
from validation.core.motion_laws import faults_of_line_files
from validation.core.motion_rows import LineTolerance
from validation.core.readback import moving_line_outcome_faults
from validation.page.motion import motion_sections

EVERYTHING = """
[cable]
mass_per_length = 11.4
EA = 2.1e8
breaking_load = 1.6e6
[[contact]]
name = "valley"
kind = "anchor"
at = [0.0, 0.0]
[[contact]]
name = "tower"
kind = "saddle"
at = [700.0, -310.0]
[[contact]]
name = "mountain"
kind = "counterweight"
at = [1200.0, -480.0]
tension = 4.3e5
[[car]]
name = "up"
mass = 6000.0
travel = {kind = "trapezoid", top_speed = 3.0, acceleration = 0.6, deceleration = 0.6, from = 260.0, to = 275.0}
[[car]]
name = "down"
mass = 4500.0
drive = {mode = "haul", drag_area = 12.0, rolling_friction = 0.01}
travel = {kind = "trapezoid", top_speed = 2.5, acceleration = 0.5, deceleration = 0.5, from = 1050.0, to = 1037.5}
"""
EVERYTHING = (
    EVERYTHING.replace('name = "up"', 'name = "up"\nbelow = 5.0')
    + """
[[obstacle]]
name = "road"
at = 260.0
top = -40.0
[[obstacle]]
name = "hut"
at = 900.0
top = -350.0
"""
)
ASKED = LineTolerance(1e-3, 1e-2)


@pytest.fixture(scope="module")
def line():
    return Line.from_toml(EVERYTHING)


@pytest.fixture(scope="module")
def by_elements(line):
    return LineRuns(ELEMENTS, line).ladder(2, 2)


@pytest.fixture(scope="module")
def by_sines(line):
    return LineRuns(SINES, line).ladder(2, 2)


def check_verdict(*of):
    return worst_deciding_verdict(compare_and_check_laws(*of, ASKED)).value


def with_motion_changed(ladder, change):
    return ladder.map(lambda run: dataclasses.replace(run, motion=change(run.motion)))


@pytest.mark.parametrize(
    "key",
    [
        "car.up.mass", "car.up.travel.acceleration",
        *(
            pytest.param(x, marks=pytest.mark.slow)
            for x in ("cable.mass_per_length", "car.down.mass", "contact.mountain.tension", "gravity")
        ),
    ],
)  # fmt: skip
def test_a_fault_of_a_percent_in_one_solver_is_seen(line, by_sines, key):
    """A car of another acceleration has another timetable; both solvers step on the instants of one."""
    other = line.replace({key: 9.908 if key == "gravity" else "+1%"})
    fault = LineRuns(ELEMENTS, other, LineRuns(SINES, line)).ladder(2, 2)
    assert check_verdict(line, by_sines, fault) == "disagree"


def without_weight_of_rope(motion):
    """The power of a counterweight whose rope enters without its weight q y."""
    weight = motion.contacts[2]
    powers = motion.powers | {"mountain weight": motion.powers["mountain weight"] + 11.4 * 9.81 * -480.0 * weight.ds}
    return dataclasses.replace(motion, powers=powers)


def with_cars_swapped(motion):
    one, other = motion.cars
    cars = dataclasses.replace(other, name=one.name), dataclasses.replace(one, name=other.name)
    return dataclasses.replace(motion, cars=cars)


def with_wrong_haul(motion):
    one, other = motion.cars
    return dataclasses.replace(motion, cars=(one, dataclasses.replace(other, haul_force=1.05 * other.haul_force)))


@pytest.mark.parametrize("fault", [without_weight_of_rope, with_cars_swapped, with_wrong_haul])
def test_a_fault_in_an_answer_is_seen(line, by_elements, by_sines, fault):
    assert check_verdict(line, by_elements, with_motion_changed(by_sines, fault)) == "disagree"


def test_a_fault_that_both_share_is_seen_by_the_laws_alone(line, by_elements, by_sines):
    both = [with_motion_changed(ladder, with_wrong_haul) for ladder in (by_elements, by_sines)]
    wrong = {row.quantity for row in compare_and_check_laws(line, *both, ASKED) if row.verdict.value == "disagree"}
    assert wrong == {"laws_si"}


def test_a_ring_of_a_car_that_grips_is_no_gap_and_a_force_off_by_as_much_is_one(line, by_elements, by_sines):
    """A car and the rope ring in other periods than the rope's round trip."""
    ring = 0.7 * by_sines.finest.period
    force = 0.03 * line.car[0].mass * line.gravity

    def gap(shape):
        def wrong(motion):
            one, other = motion.cars
            grip = one.grip_force + force * shape(2.0 * np.pi * motion.t / ring)
            return dataclasses.replace(motion, cars=(dataclasses.replace(one, grip_force=grip), other))

        rows = compare_and_check_laws(line, by_elements, with_motion_changed(by_sines, wrong), ASKED)
        return next(row.gap for row in rows if row.quantity == "grip_force")

    assert gap(np.sin) < 0.1 * 0.03
    assert gap(np.ones_like) == pytest.approx(0.03, rel=0.1)


def test_a_saddle_a_counterweight_and_two_cars_agree(cablefem, tmp_path):
    (tmp_path / "short.toml").write_text(EVERYTHING)
    code, out, err = cablefem("check", "short.toml", "--tol", "1e-2", "--sensitivity")
    assert (code, err) == (0, "")
    assert out.startswith("Both solvers agree.")
    assert len(out.splitlines()) <= 23
    noticed = re.search(r"would notice: .*car.up.mass (\S+) %", out)
    assert 0.0 < float(noticed[1]) < 1.0
    assert "contact.mountain.tension" in out
    assert "safety factor" in out
    folder = tmp_path / "cablefem-out" / "short"
    files = {path.name for path in (folder / "motion-check").iterdir()}
    tables = {"path-up.csv", "path-down.csv", "contacts.csv", "profile.csv", "rope.csv"}
    assert files == tables | {"scene.toml", "summary.json"}
    with (folder / "motion-check" / "contacts.csv").open(newline="") as file:
        header = next(csv.reader(file))
    assert header[-4:] == ["mountain.s", "mountain.tension", "mountain.pressure", "mountain.rise"]
    stored = json.loads((folder / "agreement.json").read_text())
    asked = {row["quantity"] for row in stored["rows"] if row["asked"]}
    assert {"path_max", "haul_force", "grip_force", "contact_force", "flow", "rise", "pressure", "laws_si"} <= asked
    page = (folder / "report.html").read_text()
    assert "The line in motion" in page
    text = re.sub("<script.*?</script>", "", page, flags=re.DOTALL)  # of the side view: without its packed series
    assert "nan" not in text.lower().split("<svg")[0]


@pytest.fixture(scope="module")
def line_answers(line, by_elements):
    return motion_answers(line, by_elements, None)


def test_answers_to_a_line_are_asserted_to_agree_and_a_fault_is_told_with_its_place(line, line_answers, by_sines):
    def answer_with(change):
        return motion_answers(line, with_motion_changed(by_sines, change), None)

    rows = cf.assert_agree(line_answers, answer_with(lambda motion: motion), path=1e-3, tension=1e-2)
    assert [row.law for row in rows[:2]] == ["up", "down"]

    def lowered(motion):
        up, down = motion.cars
        late = up.point + np.stack([0.0 * motion.t, 0.05 * motion.t / motion.t[-1]], axis=1)
        return dataclasses.replace(motion, cars=(dataclasses.replace(up, point=late), down))

    end = f"{line_answers.t[-1]:.4g}"
    with pytest.raises(AssertionError, match=rf"path_max of up: gap .*, allowed 0.001, largest at t = {end} s"):
        cf.assert_agree(line_answers, answer_with(lowered))
    cf.assert_agree(line_answers, answer_with(lowered), window=(0.0, 0.02 * line_answers.t[-1]))

    def tauter(motion):
        valley, *others = motion.contacts
        ahead = 1.02 * valley.tension_ahead
        return dataclasses.replace(motion, contacts=(dataclasses.replace(valley, tension_ahead=ahead), *others))

    with pytest.raises(AssertionError, match=r"tension of valley: gap 0\.0"):
        cf.assert_agree(line_answers, answer_with(tauter), tension=1e-2)


def test_an_answer_to_a_line_is_not_compared_with_one_of_one_span(line_answers):
    one_span = cf.run("tramway", elements=3, steps=60, bars=False)
    with pytest.raises(AssertionError, match="cannot be compared: one is of one span, the other of a line"):
        cf.assert_agree(line_answers, one_span)


def test_a_wrong_file_and_a_wrong_number_are_found(tmp_path, line_answers):
    folder = tmp_path / "a"
    line_answers.write(folder, 0.0)
    assert not list(faults_of_line_files(folder, line_answers.motion, line_answers.design, line_answers.moved.period))
    wrong = [number | {"value": number["value"] * 1.01 + 2.0 * number["bar"]} for number in line_answers.design]
    faults = list(faults_of_line_files(folder, line_answers.motion, wrong, line_answers.moved.period))
    assert [fault.partition(" = ")[0] for fault in faults] == [number["quantity"] for number in wrong]
    file = folder / "path-up.csv"
    head, *body = file.read_text().splitlines()
    column = head.split(",").index("y")
    table = [row.split(",") for row in body]
    for row in table:
        row[column] = str(1.001 * float(row[column]))
    file.write_text("\n".join([head, *(",".join(row) for row in table)]) + "\n")
    faults = list(faults_of_line_files(folder, line_answers.motion, [], line_answers.moved.period))
    assert [fault.partition(": off")[0] for fault in faults] == ["path-up.csv: y is not what was computed"]


def test_a_clearance_of_another_moment_is_seen(tmp_path, line_answers):
    line_answers.write(tmp_path, 0.0)
    design = [d for d in line_answers.design if d["quantity"].startswith("clearance")]
    later = [d | {"t": 1.001 * d["t"]} for d in design]
    t = line_answers.motion.t
    next_step = [d | {"t": float(t[np.searchsorted(t, d["t"]) + 1])} for d in design]
    for wrong in (later, next_step):
        faults = list(faults_of_line_files(tmp_path, line_answers.motion, wrong, line_answers.moved.period))
        assert [fault.partition(" = ")[0] for fault in faults] == [d["quantity"] for d in design]


def page_html(folder):
    return "".join(section.html for section in motion_sections(folder))


@pytest.mark.parametrize("key", ["value", "bar", "t"])
def test_the_table_of_numbers_on_the_page_is_read_back(tmp_path, line_answers, key):
    line_answers.write(tmp_path, 0.0)
    assert not line_answers.output_faults(tmp_path, page_html(tmp_path))
    summary = json.loads((tmp_path / "summary.json").read_text())
    safety = next(d for d in summary["design"] if d["quantity"] == "safety_factor_min")
    safety[key] *= 1.1
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    (fault,) = line_answers.output_faults(tmp_path, page_html(tmp_path))
    assert fault.startswith("page: safety factor: breaking load over largest tension: ")


def test_the_safety_factor_in_motion_is_the_breaking_load_over_the_largest_tension(line_answers):
    found = {d["quantity"]: d for d in line_answers.design}
    tension = found["tension_max"]
    safety = found["safety_factor_min"]
    assert safety["value"] == pytest.approx(1.6e6 / tension["value"])
    assert safety["bar"] == pytest.approx(safety["value"] * tension["bar"] / tension["value"], rel=0.1)
    assert safety["t"] == tension["t"]


@pytest.mark.parametrize(
    ("bars_beyond", "says", "kind"),
    [(2.0, "the rope is loaded beyond its breaking load", "breaks"),
     (0.5, "too close to tell whether the rope breaks", "arrives"), (-2.0, "ends after", "arrives")],
)  # fmt: skip
def test_a_rope_within_the_bar_of_its_breaking_load_is_too_close_to_tell(
    line, by_elements, line_answers, bars_beyond, says, kind
):  # fmt: skip
    tension = line_answers.tension_max
    load = tension["value"] - bars_beyond * tension["bar"]
    bare = {"cable.breaking_load": load, "obstacle": []}
    outcome = motion_answers(line.replace(bare), by_elements, None).outcome
    assert outcome.sentence.startswith(says)
    assert outcome.kind == kind


@pytest.mark.parametrize(
    ("bars_beyond", "says"),
    [(2.0, "would collide: up hits road by"), (0.5, "too close to tell whether up clears road")],
)
def test_a_car_within_the_bar_of_an_obstacle_is_too_close_to_tell(line, by_elements, line_answers, bars_beyond, says):
    clearance = next(d for d in line_answers.design if d["quantity"] == "clearance_car:up over road")
    top = -40.0 - clearance["value"] - bars_beyond * clearance["bar"]
    outcome = motion_answers(line.replace({"obstacle.road.top": top}), by_elements, None).outcome
    assert says in outcome.sentence


def test_cars_and_rope_in_motion_clear_what_they_pass(line_answers):
    """The rope moves with the car over the road; no car passes the hut."""
    found = {d["quantity"]: d["value"] for d in line_answers.design if d["quantity"].startswith("clearance")}
    assert found.keys() == {"clearance_rope:road", "clearance_rope:hut", "clearance_car:up over road"}
    up = line_answers.cars[0].point
    passing = np.interp(260.0, up[:, 0], up[:, 1])
    assert found["clearance_car:up over road"] == pytest.approx(-40.0 - passing - 5.0, abs=1e-9)
    assert found["clearance_rope:road"] <= found["clearance_car:up over road"] + 5.0 + 1e-9


def test_ground_beyond_the_supports_is_not_beneath_the_rope(line, by_elements):
    """A survey often goes on behind the stations, where the slope may be higher than the last support."""
    valley = [[0.0, 300.0], [1200.0, 300.0]]
    survey = [[-300.0, -900.0], [-1.0, -900.0], *valley, [1201.0, -900.0], [1500.0, -900.0]]
    clearances = []
    for ground in (valley, survey):
        design = motion_answers(line.replace({"ground": ground}), by_elements, None).design
        clearances.append(next(d["value"] for d in design if d["quantity"] == "clearance_rope:the ground"))
    assert clearances[0] == clearances[1] > 0.0


def test_a_line_in_motion_says_where_its_cars_are(line_answers):
    assert [car.name for car in line_answers.cars] == ["up", "down"]
    assert line_answers.contacts[2].rise[0] == 0.0
    assert np.all(np.diff(line_answers.cars[0].s) >= 0.0)


@pytest.mark.slow
def test_a_fault_told_to_one_solver_by_the_command(cablefem, tmp_path):
    (tmp_path / "short.toml").write_text(EVERYTHING)
    code, out, _ = cablefem("check", "short.toml", "--tol", "1e-2", "--second-set", "car.down.mass=+5%")
    assert code == 1
    assert out.startswith("The solvers DISAGREE")


HEAVY = EVERYTHING.replace("mass = 6000.0", "mass = 40000.0")
CROSSED = EVERYTHING.replace("from = 1050.0, to = 1037.5", "from = 690.0, to = 200.0")
CARS = EVERYTHING.split("[[car]]\n")
SWAPPED = "[[car]]\n".join([CARS[0], CARS[2], CARS[1]])
CLOSE = EVERYTHING.replace("from = 1050.0, to = 1037.5", "from = 238.2, to = 230.0")
SHORT = EVERYTHING.replace('kind = "counterweight"', 'kind = "anchor"').replace("tension = 4.3e5\n", "")
SHORT = SHORT.replace("EA = 2.1e8", "EA = 2.1e8\nlength = 500.0")
RUBBING = EVERYTHING.replace('kind = "saddle"', 'kind = "saddle"\nfriction = 0.1')
TWICE = EVERYTHING.replace('kind = "anchor"', 'kind = "counterweight"\ntension = 4e5')
MEETING = """
[cable]
mass_per_length = 11.4
EA = 2.1e8
length = 1300.0
[[contact]]
name = "valley"
kind = "anchor"
at = [0.0, 0.0]
[[contact]]
name = "mountain"
kind = "anchor"
at = [1200.0, -480.0]
[[car]]
name = "up"
mass = 6000.0
travel = {kind = "trapezoid", top_speed = 7.0, acceleration = 1.0, deceleration = 1.0, from = 200.0, to = 700.0}
[[car]]
name = "down"
mass = 4500.0
drive = {mode = "haul"}
travel = {kind = "trapezoid", top_speed = 7.0, acceleration = 1.0, deceleration = 1.0, from = 1000.0, to = 500.0}
"""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (HEAVY, "car.up.mass: M g = 392400 N; must be < 376"),
        (CROSSED, "cars are listed from left to right and cannot pass"),
        (SWAPPED, "to the right of down; must be >= 1 m; cars are listed from left to right and cannot pass"),
        (CLOSE, "must be >= 1 m; cars are listed from left to right"),
        (SHORT, "the rope is too short to reach: 500 m over 1293.68 m of chords"),
        (RUBBING, "without friction"),
        (TWICE, "two counterweights"),
        (MEETING, "cars are listed from left to right and cannot pass"),
    ],
)  # fmt: skip
def test_what_cannot_move_is_refused_in_one_sentence(cablefem, tmp_path, text, says):
    (tmp_path / "bad.toml").write_text(text)
    code, out, err = cablefem("check", "bad.toml")
    assert (code, out) == (2, "")
    assert says in err
    assert len(fault_lines(err)) == 1
    assert not (tmp_path / "cablefem-out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two-cars", "counterweight", "over-tower", "rocket-trolley"])
def test_built_in_lines_agree(name):
    assert check_line(Line.load(name)).verdict.value == "agree"


def test_both_solvers_resolve_the_waves_that_a_pitching_car_sends():
    """On a rope too coarse for them they gave pitches 3 % apart."""
    line = Line.load("rocket-trolley").replace({"car.sled.drive.end.time": 1.5})
    first = LineRuns(ELEMENTS, line)
    runs = [x.run(4, 1) for x in (first, LineRuns(SINES, line, first))]
    one, other = (run.at_common_instants(run.motion.cars[0].turning.angle, 1.5) for run in runs)
    np.testing.assert_allclose(one, other, atol=1e-3 * np.ptp(one))


def test_a_run_of_one_span_has_its_car_and_supports_as_a_line_has():
    r = cf.run("tramway", elements=3, steps=60, bars=False)
    car, left, right = r.cars[0], *r.contacts
    assert car.s is r.s_o
    np.testing.assert_array_equal(car.point, np.stack([r.x, r.y], axis=1))
    np.testing.assert_array_equal(car.haul_force, r.F_haul)
    np.testing.assert_allclose(car.ds[5:-5], np.gradient(r.s_o, r.t)[5:-5], rtol=0.1, atol=0.3)
    # what rope and car weigh hangs on both supports, but for inertia
    weight = (r.contact[:, 1] + left.pressure[:, 1] + right.pressure[:, 1])[0]
    assert weight > 0.0
    np.testing.assert_array_equal(left.tension_ahead, np.linalg.norm(r.reaction_left, axis=1))


def test_files_and_numbers_hold_swing_pitch_and_wheel_loads(tmp_path):
    line = Line.from_toml(BODIES)
    result = motion_answers(line, LineRuns(ELEMENTS, line).ladder(1, 1), None)
    result.write(tmp_path, 0.0)
    assert not list(faults_of_line_files(tmp_path, result.motion, result.design, result.moved.period))
    names = {number["quantity"] for number in result.design}
    assert {"swing_max:cabin", "pitch_min:sled", "wheel_min:sled.rear", "wheel_max:sled.front"} <= names
    for file, column in (("path-sled.csv", "pitch"), ("path-sled.csv", "wheel_rear"), ("path-cabin.csv", "swing")):
        text = (tmp_path / file).read_text()
        (tmp_path / file).write_text(text.replace(column, "gone", 1))
        faults = list(faults_of_line_files(tmp_path, result.motion, [], result.moved.period))
        assert len(faults) == 1
        assert faults[0].startswith(f"{file}: {column} ")
        (tmp_path / file).write_text(text)


def test_a_grip_that_is_written_out_is_read_back_as_one_that_is_not(tmp_path):
    """Its forces are means of means; rows of a check called them other than computed."""
    line = Line.from_toml(EVERYTHING.replace('name = "up"', 'name = "up"\ndrive = {mode = "grip"}'))
    result = motion_answers(line, LineRuns(ELEMENTS, line).ladder(1, 1), None)
    result.write(tmp_path, 0.0)
    assert not list(faults_of_line_files(tmp_path, result.motion, result.design, result.moved.period))


def test_a_thrust_that_ends_does_no_work_at_its_last_time():
    """The law's sampling had half a step of it too much."""
    line = Line.from_toml(BODIES.replace("times = [0.0, 9.0]", "times = [0.0, 1.0]"))
    moved = LineRuns(ELEMENTS, line).run(1, 1)
    sampled = motion_laws.SampledMotion(motion_laws.LineTables(line.to_toml()), moved)
    assert np.abs(motion_laws.momentum_defects_by_window(sampled, moved.end_time)).max() < 3e-4


RIDER = {
    "cable": {"mass_per_length": 0.9, "EA": 8e6, "length": 253.0},
    "contact": [
        {"name": "low", "kind": "anchor", "at": [0.0, 0.0]}, {"name": "high", "kind": "anchor", "at": [250.0, -20.0]},
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("drive", "kind"),
    [
        ({"start": 245.0, "end": {"time": 5.0}}, "rolling"),
        ({"start": 40.0, "thrust": -300.0}, "rolls_back"),
        ({"start": 100.0, "thrust": 500.0}, "arrives"),
        ({"start": 245.0, "rolling_friction": 0.05}, "stuck"),
        ({"start": 40.0, "thrust": 300.0, "brake": [{"from": 80.0, "force": 700.0}]}, "stopped_by_brake"),
        ({"start": 20.0, "brake": [{"from": 130.0, "force": 15.0}], "end": {"time": 40.0}}, "rolling"),
    ],
)
def test_the_outcome_of_a_rider_on_a_line_is_of_the_kind_it_has_on_one_span(drive, kind, tmp_path):
    rider = {"name": "rider", "mass": 90.0, "drive": {"mode": "free", "end": {"time": 60.0}, "drag_area": 1.0} | drive}
    line = Line(**RIDER, car=[rider])
    answers = motion_answers(line, LineRuns(ELEMENTS, line).ladder(1, 1), None)
    assert answers.outcome.kind == kind
    answers.write(tmp_path, 1.0)
    assert list(moving_line_outcome_faults(tmp_path)) == []


def test_a_rider_swings_and_comes_to_rest_as_on_one_span():
    """Friction takes it where it turns, and cannot hold it there once the rope has answered."""
    drive = {"start": 245.0, "rolling_friction": 0.02, "drag_area": 0.5, "end": {"time": 200.0}}
    line = Line(**RIDER, car=[{"name": "rider", "mass": 90.0, "drive": drive | {"mode": "free"}}])
    unstretched, stretched = 253.0, 253.152
    span = Scene(
        cable={"mass_per_length": 0.9, "EA": 8e6, "length": stretched}, supports={"span": 250.0, "drop": -20.0},
        mass={"mass": 90.0}, drive=drive | {"mode": "free", "start": 245.0 * stretched / unstretched},
    )  # fmt: skip
    on_line = LineRuns(ELEMENTS, line).run(1, 1)
    on_span = cf.run(span, "following-p2", elements=8, steps=400)
    assert on_line.end_time == pytest.approx(on_span.t[-1], rel=2e-3)
    assert on_line.motion.cars[0].point[-1, 0] == pytest.approx(on_span.x[-1], abs=0.3)


def test_a_brake_lets_go_of_a_rider_who_rolls_back_before_it():
    """In steps taken together, too; a brake that went on would stop him by more than a metre earlier."""
    drive = {"mode": "free", "start": 20.0, "brake": [{"from": 135.0, "force": 2.0}], "end": {"time": 40.0}}
    line = Line(**RIDER, car=[{"name": "rider", "mass": 90.0, "drive": drive}])

    def step_by_step(moving, n):
        system = ELEMENTS.system(moving, n)
        system.many_steps = False
        return system

    many = LineRuns(ELEMENTS, line).run(1, 1).motion.cars[0].s
    single = LineRuns(dataclasses.replace(ELEMENTS, system=step_by_step), line).run(1, 1).motion.cars[0].s
    assert many[-1] < 100.0 < 135.0 < many.max()
    assert many[-1] == pytest.approx(single[-1], abs=0.1)


@pytest.mark.parametrize("wing", [ELEMENTS, SINES])
def test_a_brake_lets_go_where_it_begins(wing):
    """The law of energy, which takes the brake's reach from the TOML, sees a step of its work too much."""
    drive = {"mode": "free", "start": 20.0, "brake": [{"from": 130.0, "force": 15.0}], "end": {"time": 30.0}}
    line = Line(**RIDER, car=[{"name": "rider", "mass": 90.0, "drive": drive}])
    run = LineRuns(wing, line).run(1, 1)
    at = [float(run.motion.cars[0].s[run.motion.t == t][0]) for _, t in run.events]
    assert [name for name, _ in run.events][0::3] == ["rider brakes", "rider leaves a brake"]
    np.testing.assert_allclose(at[0::3], 130.0, atol=1e-6)
    sampled = motion_laws.SampledMotion(motion_laws.LineTables(line.to_toml()), run)
    assert np.abs(motion_laws.energy_defects(sampled, run.end_time)).max() < 0.012


def test_a_haul_force_is_within_its_bar_however_long_the_rest():
    haul = []
    for rest in (16.0, 160.0):
        line = Line.load("emergency-stop").replace({"car.cabin.travel.rest": rest})
        haul.append(next(d for d in answer_line(line).design if d["quantity"] == "haul_max:cabin"))
    assert abs(haul[1]["value"] - haul[0]["value"]) < haul[0]["bar"] + haul[1]["bar"]


def test_a_ride_is_the_same_however_long_its_end_time_waits():
    def ride(end_time):
        drive = {"mode": "free", "start": 245.0, "rolling_friction": 0.02, "drag_area": 0.5, "end": {"time": end_time}}
        line = Line(**RIDER, car=[{"name": "rider", "mass": 90.0, "drive": drive}])
        return LineRuns(ELEMENTS, line).run(1, 2)

    short = ride(100.0)
    long = ride(3000.0)
    assert short.reason is long.reason is None
    assert long.end_time == pytest.approx(short.end_time, rel=1e-3)
    assert long.motion.t.size < 1.5 * short.motion.t.size


def test_a_contact_elsewhere_than_in_the_file_is_seen(line, by_elements, by_sines):
    told = line.replace({"contact.tower.at": [700.0, -310.01]})
    rows = law_rows(told.to_toml(), [by_elements, by_sines], by_elements.finest.end_time)
    broken = {row.law for row in rows if row.verdict.value == "disagree"}
    assert broken >= {f"points of contacts, {solver}" for solver in ("elements", "sines")}


@pytest.mark.parametrize("told", [{"cable.mass_per_length": 11.4114}, {"cable.EA": 2.1021e8}])
def test_a_thousandth_of_mass_or_stiffness_changes_the_rope_at_the_start(line, by_elements, by_sines, told):
    rows = law_rows(line.replace(told).to_toml(), [by_elements, by_sines], by_elements.finest.end_time)
    broken = {row.law for row in rows if row.verdict.value == "disagree"}
    assert {f"shape of the rope at the start, {solver}" for solver in ("elements", "sines")} <= broken


@pytest.mark.parametrize(
    ("told", "broken"),
    [(0.3, set()), (0.0, {"momentum of rope and cars, sines"}), (0.303, {"power of damping, sines"})],
)
def test_laws_read_the_damping_of_a_rope_from_the_file(line, told, broken):
    damped = Line.from_toml(line.to_toml().replace("[cable]\n", "[cable]\ndamping = {rate = 0.3}\n"))
    ladder = LineRuns(SINES, damped).ladder(2, 2)
    rows = law_rows(damped.to_toml().replace("rate = 0.3", f"rate = {told}"), [ladder], ladder.finest.motion.t[-1])
    assert {row.law for row in rows if row.verdict.value == "disagree"} == broken
