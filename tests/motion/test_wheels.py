"""Loads of the wheels of a point car by hand, and stresses of the rope under a wheel."""

import dataclasses
import math
import re

import numpy as np
import pytest

from cablefem.elements.rest import coordinates_at_rest, resting_coordinates_with_forces
from cablefem.elements.system import LineElements
from cablefem.motion import CarMotion
from cablefem.scene import Scene, SceneError
from cablefem.scene.bodies import Wheels
from cablefem.scene.contacts import Car
from cablefem.scene.drive import Drive
from cablefem.scene.line import Line
from cablefem.scene.short import load_line_or_none
from tests.commands.test_files import undocumented_keys
from tests.motion.lines import BODIES
from tests.motion.test_bodies import tram_line
from tests.motion.test_scene import SPAN
from validation.commands.advise import page
from validation.commands.advise.lines import advise_on_line_and_write
from validation.commands.run.motion import ELEMENTS, LineRuns, motion_answers
from validation.core.motion_laws import faults_of_line_files
from validation.core.wheels import neglected_wheel_load, rear_and_front_loads_by_hand, rope_stresses_under_wheel

NONE = np.array([math.nan])


@pytest.mark.parametrize(("brakes", "rear", "front"), [(0.0, 816.75, 4088.25), (3000.0, 1566.75, 3338.25)])
def test_loads_of_wheels_on_a_taut_level_string(brakes, rear, front):
    """R_1 + R_2 = m g and -1.3 R_1 + 0.7 R_2 = 0.2 T - 0.5 sum B, with T = 9 kN."""
    names = "s ds tension_behind tension_ahead haul_force grip_force shoe_force"
    still = dict.fromkeys(names.split(), NONE)
    level = np.array([[1.0, 0.0]])
    x = CarMotion(
        name="sled", **still, point=level, velocity=0.0 * level, acceleration=(9000.0 - brakes) / 500.0 * level,
        slope_behind=level, slope_ahead=level, contact_force=np.array([500.0 * 9.81]),
    )  # fmt: skip
    sled = Car(name="sled", mass=500.0, drive=Drive(mode="free", thrust_at=(-1.0, -0.2)))
    wheels = Wheels(base=2.0, below=0.5, ahead=0.3, model="point")
    loads = rear_and_front_loads_by_hand(wheels, sled, x, np.array([9000.0]), 9.81)
    np.testing.assert_allclose(loads, [[rear], [front]], rtol=1e-12)


@pytest.mark.parametrize(("front", "exact"), [(100.0, [20957.54, 54020.46]), (402.0, [16213.34, 55940.54])])
def test_loads_by_hand_of_a_trolley_at_rest_are_two_percent_of_its_weight_off_and_say_so(front, exact):
    whole = tram_line(front - 2.0)
    wheels = whole.cars_on_rope[0].wheels
    point = dataclasses.replace(whole.cars_on_rope[0], wheels=None)
    system = LineElements(dataclasses.replace(whole, contacts=(whole.contacts[0], point, whole.contacts[2])))
    q = coordinates_at_rest(system, 0.0, 0)
    start = system.start(0, None)._replace(
        q=q[system.free], a=resting_coordinates_with_forces(system, q).a[system.free]
    )
    x = system.observe([start], np.array([1.0])).cars[0]
    loads = rear_and_front_loads_by_hand(wheels, point, x, np.zeros(1), 9.81)
    bar = neglected_wheel_load(wheels, 8100.0, 9.81, np.zeros(1), dataclasses.replace(x, wheel_loads=loads))
    assert bar < 0.025 * 8100.0 * 9.81
    np.testing.assert_allclose(np.ravel(loads), exact, rtol=0.0, atol=bar)


def test_the_bending_stress_is_that_of_a_bar_and_of_loose_wires_under_tension():
    """A long beam under tension N bends at a force Q by M = (Q/2) sqrt(EI/N)."""
    E, N, Q = 1.6e11, 2e5, 9e3
    for count, diameter in ((1, 0.03), (50, 0.004)):
        A = 0.25 * math.pi * diameter**2
        EI = E * A * diameter**2 / 16.0  # of one wire, which carries its part of N and Q
        M = 0.5 * Q / count * math.sqrt(EI / (N / count))
        rope = Line.from_toml(BODIES).cable.model_copy(update={"E": E, "section": count * A, "EA": E * count * A})
        at = rope_stresses_under_wheel(rope, Wheels(model="point"), np.array([N]), np.array([Q]))
        assert at["stress_bending_max"][0] == pytest.approx(M * 0.5 * diameter / (EI / E))
        assert at["stress_max"][0] == pytest.approx(at["stress_bending_max"][0] + N / (count * A))
        assert at["tension_over_wheel_min"][0] == pytest.approx(N / Q)


def test_a_groove_bounds_how_far_the_rope_bends():
    rope = Line.from_toml(BODIES).replace({"cable.E": 1.6e11, "cable.section": 9e7 / 1.6e11, "cable.wire": 3e-3}).cable
    at = [
        rope_stresses_under_wheel(rope, Wheels(model="point", radius=R), *np.array([[1e5], [1e4]])) for R in (0.1, 1.0)
    ]
    assert at[0]["stress_bending_max"][0] == pytest.approx(1e4 / rope.section * math.sqrt(1.6e11 * rope.section / 1e5))
    assert at[1]["stress_bending_max"][0] == pytest.approx(1.6e11 * 3e-3 / 2.0)


POINTS = BODIES.replace("below = 0.5}", 'below = 0.5, model = "point", count = 4, radius = 0.1}').replace(
    "EA = 9e7", "E = 1.6e11\nsection = 5.625e-4\nwire = 3e-3"
).replace(", angle = 5.0", ", at = [-0.5, 0.2]").replace(', wheel = "rear"', "")  # fmt: skip


def test_loads_and_stresses_have_a_second_computation_that_sees_faults(tmp_path):
    line = Line.from_toml(POINTS.replace("time = 2.0", "time = 1.0"))
    result = motion_answers(line, LineRuns(ELEMENTS, line).ladder(2, 2), None)
    result.write(tmp_path, 0.0)

    def faults(design=result.design):
        return {re.split(" = |: the|: off", fault)[0] for fault in faults_of_line_files(
            tmp_path, result.motion, design, result.moved.period
        )}  # fmt: skip

    assert not faults()
    assert {f"wheel_{x}:sled.{y}" for x in ("min", "max") for y in ("rear", "front")} <= {
        number["quantity"] for number in result.design if number["bar"] is not None
    }
    numbers = {number["quantity"]: number for number in result.design}
    load = max((numbers[f"wheel_max:sled.{x}"] for x in ("rear", "front")), key=lambda x: x["value"])
    stress = numbers["stress_bending_max:sled"]
    assert stress["bar"] > 0.9 * stress["value"] * load["bar"] / load["value"] > 0.0  # no surer than the load
    columns = {f"path-sled.csv: wheel_{x} is not what was computed" for x in ("rear", "front")}
    stress = {f"{kind}:sled" for kind in ("stress_bending_max", "stress_max")}
    for fault, seen in (
        ({"car.sled.wheels.below": 0.55}, columns),
        ({"car.sled.wheels.ahead": 0.02}, columns),
        ({"car.sled.drive.thrust.at": [-0.5, 0.25]}, columns),
        ({"cable.section": 5.7e-4, "cable.EA": 9e7}, {"stress_axial_max:sled"}),
        ({"car.sled.wheels.count": 10}, {"tension_over_wheel_min:sled", *stress}),
    ):
        (tmp_path / "scene.toml").write_text(line.replace(fault).to_toml())
        assert seen <= faults(), fault
    (tmp_path / "scene.toml").write_text(line.to_toml())
    for key, quantity in (("t", "wheel_min:sled.rear"), ("s_o", "stress_max:sled"), ("value", "stress_max:sled")):
        wrong = [n | ({key: 1.2 * n[key] + 0.1} if n["quantity"] == quantity else {}) for n in result.design]
        assert faults(wrong) == {quantity}, key


SCENE = """
[cable]
mass_per_length = 13.3
E = 160e9
section = 1.575e-3
horizontal_tension = 450e3
[supports]
span = 700.0
drop = -341.0
[mass]
mass = 8100.0
wheels = {model = "point", count = 8}
[travel]
kind = "accelerate_cruise_brake"
top_speed = 10.0
"""


def test_stiffness_is_that_of_the_section():
    scene = Scene.from_toml(SCENE)
    assert pytest.approx(2.52e8) == scene.cable.EA
    assert pytest.approx(1.89e8) == scene.replace({"cable.E": 1.2e11}).cable.EA


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("E = 160e9", "E = 160e9\nEA = 2.3e8", "cable.EA = 230000000.0: must be E section = 2.52e+08 N within 2%, or"),
        ("E = 160e9", "EA = 2.52e8", "cable.E: missing; must be given with section"),
        ("count = 8", "count = 8, radius = 0.2", "cable.wire: missing; must be given with wheels.radius = 0.2"),
        ("count = 8", "count = 0", "mass.wheels.count = 0: must be a whole number from 1 to 1000"),
        ("count = 8", "count = 3, base = 2.0", "mass.wheels.count = 3: must be even"),
        ('model = "point", ', "", "mass.wheels.base and inertia: missing; must be > 0 unless model = 'point'"),
        ("count = 8", "base = 2.0", "mass.wheels: not modelled: run and check alone take it"),
    ],
)  # fmt: skip
def test_a_fault_of_wheels_and_section_is_one_sentence(old, new, fault):
    with pytest.raises(SceneError) as error:
        Scene.from_toml(SCENE.replace(old, new))
    assert len(error.value.faults) == 1
    assert error.value.faults[0].startswith(fault)


def test_a_point_car_takes_no_thrust_at_an_angle():
    with pytest.raises(SceneError, match=r"drive.thrust.angle: must be 0 with wheels.model = 'point'"):
        Line.from_toml(POINTS.replace("at = [-0.5, 0.2]", "angle = 5.0"))


def advice(folder, *changes):
    text = SPAN.replace("top_speed = 7.0", "top_speed = 2.0")
    for old, new in changes:
        text = text.replace(old, new)
    (folder / "span.toml").write_text(text)
    found = advise_on_line_and_write(load_line_or_none(folder / "span.toml"), 1e-2, folder)
    assert not undocumented_keys(folder / "advice.json")
    return {row["need"]: row for row in found["bodies"]}, *found["periods"], page.sections(folder)[1].summary


def test_a_trolley_without_moments_may_be_a_point_where_it_starts_and_stops_gently(tmp_path):
    level = ("below = 3.0, ahead = 0.2", "below = 0.0"), ("-2.0]", "0.0]")
    gentle = ("acceleration = 0.5", "acceleration = 0.15"), ("deceleration = 3.0", "deceleration = 0.15")
    rows, period, summary = advice(tmp_path, *level, *gentle)
    # m g cos(beta) b/(4 N) on the tramway, whose ends are fixed: the rope that two wheels save lets it sag by a fifth
    assert rows["path"]["formula"] == pytest.approx(0.0867, rel=0.05)
    assert 0.75 * rows["path"]["formula"] < rows["path"]["run"] < rows["path"]["formula"]
    assert all(row["enough"] for row in rows.values())
    assert period["short"]
    assert period["ramp"] == pytest.approx(2.0 / 0.15)
    assert summary.startswith("A point mass is enough within")


def test_a_trolley_may_not_be_a_point_where_it_stops_at_once(tmp_path):
    rows, period, summary = advice(tmp_path)
    for wheel in ("wheel rear", "wheel front"):
        assert rows[wheel]["allowed"] < rows[wheel]["run"] < rows[wheel]["formula"]
    assert not period["short"]
    assert summary.startswith("A point mass is not enough (")


def test_a_cabin_that_is_stopped_may_not_be_a_point(tmp_path):
    found = advise_on_line_and_write(Line.load("emergency-stop"), 1e-2, tmp_path)
    haul = next(row for row in found["bodies"] if row["need"] == "haul force")
    assert not haul["enough"]
    assert haul["run"] == pytest.approx(haul["formula"], rel=0.15)
    assert not found["periods"][0]["short"]
    assert page.sections(tmp_path)[1].verdict == ""  # the answer is no, not that nothing could be compared
