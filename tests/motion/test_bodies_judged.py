"""Which planted faults of cabins and of cars on two wheels the laws of a check see."""

import dataclasses
import re

import numpy as np
import pytest

from cablefem import catenary_line
from cablefem.scene.line import Line
from tests.motion.lines import BODIES, OVER, broken_laws
from validation.commands.check.motion import compare_and_check_laws
from validation.commands.run.motion import ELEMENTS, SINES, LineRuns
from validation.core.agreement import worst_deciding_verdict
from validation.core.motion_laws import LineTables
from validation.core.motion_rows import LineTolerance

MOMENT, KINKS, CENTRES = "moment of momentum of bodies", "forces on kinks of the rope", "centres of mass"
ENERGY = "energy and work"


@pytest.fixture(scope="module")
def line():
    return Line.from_toml(BODIES)


@pytest.fixture(scope="module")
def ladder(line):
    return LineRuns(SINES, line).ladder(2, 2)


def test_sines_keep_all_laws(line, ladder):
    assert not broken_laws(line.to_toml(), ladder)


def test_rope_that_creeps_under_a_standing_car_does_not_turn_its_friction():
    """A car hauled in x stands, rope runs over the saddle to and fro: friction stays that of the last motion."""
    cabin = {
        "car.0.hanger": {"mass": 900.0, "length": 3.0, "damping": 0.05},
        "car.0.drive": {"mode": "haul", "rolling_friction": 0.02},
        "car.0.travel.from": 60.0, "car.0.travel.to": 70.0, "car.0.travel.rest": 3.0,
    }  # fmt: skip
    stands = Line.from_toml(OVER).replace(cabin)
    ladder = LineRuns(SINES, stands).ladder(2, 2)
    for motion in (ladder.finest.motion, LineRuns(ELEMENTS, stands).run(2, 2).motion):
        ds = motion.cars[0].ds
        assert np.min(ds[motion.t > motion.t[-1] - 3.0]) < 0.0
        assert np.all(motion.powers["car friction"] * ds <= 0.0)  # a force to the left
    assert not broken_laws(stands.to_toml(), ladder)


def test_nothing_is_counted_that_the_line_does_not_have(line, ladder):
    """Neither a counterweight nor an event: a row on them could not fail."""
    rows = compare_and_check_laws(line, ladder, ladder, LineTolerance(1e-3, 1e-2))
    assert not {row.law.rpartition(",")[0] for row in rows} & {"motion of the counterweight"}
    assert not [row for row in rows if row.quantity == "events" and not ladder.finest.events]


@pytest.mark.parametrize(
    ("fault", "seen"),
    [
        ({"cable.length": 402.0004}, {"length of the rope"}),
        ({"car.sled.wheels.ahead": 0.05}, {MOMENT, CENTRES}),
        ({"car.sled.wheels.below": 0.55}, {MOMENT, CENTRES}),
        ({"car.cabin.hanger.length": 3.05}, {MOMENT, CENTRES, ENERGY}),
        ({"car.cabin.hanger.damping": 0.06}, {MOMENT, ENERGY}),
        ({"car.sled.drive.brake.0.wheel": "front"}, {KINKS}),
    ],
)
def test_a_body_that_is_not_that_of_the_toml_is_seen(line, ladder, fault, seen):
    assert broken_laws(line.replace(fault).to_toml(), ladder) == seen


def test_the_length_of_a_rope_follows_from_its_tension_at_any_contact():
    line = Line.from_toml(OVER)
    state = line.solve_empty_line(catenary_line.solve)
    for station, tensions in zip(state.case.stations, state.station_tensions, strict=True):
        told = {"at": station.name, "value": float(np.nanmax(tensions))}
        toml = re.sub(r"\nlength = .*", f'\ntension = {{at = "{told["at"]}", value = {told["value"]}}}', OVER)
        assert LineTables(toml).length_between_fixed_ends == pytest.approx(300.8, rel=1e-12)


def without_turning_inertia(motion, with_turning):
    """The cabin's acceleration, or the part phi.^2 of it alone, is missing in the forces of its carriage."""
    sled, cabin = motion.cars
    x = cabin.turning
    e1, e2 = np.exp(-1j * x.angle), 1j * np.exp(-1j * x.angle)
    missing = 2100.0 * (with_turning * x.acceleration * e1 - x.rate**2 * e2)
    tau = (cabin.slope_behind + cabin.slope_ahead) @ [1.0, 1j]
    part = missing * np.conj(tau / np.abs(tau))
    wrong = dataclasses.replace(
        cabin, contact_force=cabin.contact_force + part.imag, haul_force=cabin.haul_force - part.real
    )
    return dataclasses.replace(motion, cars=(sled, wrong))


@pytest.mark.parametrize("with_turning", [1.0, 0.0])
def test_a_carriage_that_does_not_feel_how_its_cabin_swings_is_seen(line, ladder, with_turning):
    wrong = ladder.map(lambda run: dataclasses.replace(run, motion=without_turning_inertia(run.motion, with_turning)))
    assert broken_laws(line.to_toml(), wrong) == {"momentum of rope and cars", ENERGY, KINKS}


@pytest.mark.slow
def test_a_thrust_a_degree_off_in_one_solver_is_seen(line, ladder):
    fault = LineRuns(SINES, line.replace({"car.sled.drive.thrust.angle": 6.0}), LineRuns(SINES, line)).ladder(2, 2)
    rows = compare_and_check_laws(line, ladder, fault, LineTolerance(1e-3, 1e-2))
    assert worst_deciding_verdict(rows).value == "disagree"
