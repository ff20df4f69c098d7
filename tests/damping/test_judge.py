"""Damped answers before the judge: both wings agree, laws by the file alone see a wrong rate, faults are seen."""

import functools
from dataclasses import replace

import pytest

from cablefem import Scene
from tests.validation.ladders import ladder_without_coarser_runs, run_ladder
from tests.validation.test_laws import row_by_law
from validation.commands.check.study import check
from validation.core.running import run

LEVEL = Scene.load("level").replace({"cable.damping": 0.02})
RIDER = Scene.load("zipline").replace({"wind.across": 5.0, "cable.diameter": 0.012})


SCENES = {"level": LEVEL, "zipline": RIDER, "to-rest": Scene.load("to-rest")}


@functools.cache
def coarse_ladder(name):
    how = {"elements": 12, "steps": 1200, "until": 0.3} if name == "level" else {"elements": 8, "steps": 600}
    return run_ladder(SCENES[name], **how)


@functools.cache
def rider_check():
    return check(RIDER, tol=1e-2)


def broken_laws(name, *claims, factor=3.0):
    """Laws with a verdict that the runs break if they claim to be of a scene with other values."""
    told = SCENES[name].replace(dict(claims)).to_toml()
    found = row_by_law(coarse_ladder(name).map(lambda r: replace(r, scene_toml=told)), (0.02, 0.3))
    return {law for law, h in found.items() if h.decides and not h.gap <= factor * h.allowed}


@pytest.mark.parametrize("name", ["level", "zipline", pytest.param("to-rest", marks=pytest.mark.slow)])
def test_right_answers_keep_every_law(name):
    assert broken_laws(name, factor=2.0) == set()


def test_the_front_of_a_sudden_start_is_no_defect_of_the_tension():
    """A front has no thickness: at the start itself the tension next to the car is off by 1e-3 of H on any mesh."""
    begin = SCENES["to-rest"].replace({"drive.end": {"time": 2.0}})
    r = run(begin, "following-p2", elements=12, steps=100)
    assert row_by_law(ladder_without_coarser_runs(r))["tension up to the mass"].gap < 1e-5


def test_laws_see_a_rate_that_both_wings_have_wrong():
    assert {"power", "momentum of the cable"} <= broken_laws("level", ("cable.damping", 0.022))
    assert "power" in broken_laws("zipline", ("wind.across", 5.05))
    assert "momentum of the cable" in broken_laws("level", ("cable.damping", 0.0))


def test_the_ledger_has_what_damping_took():
    r = coarse_ladder("level").finest
    assert r.powers["lost_viscous"].max() <= 0.0
    assert coarse_ladder("zipline").finest.powers.keys() == {
        "thrust",
        "drag",
        "friction",
        "brake",
        "hold",
        "lost_viscous",
    }
    assert run(Scene.load("level"), "following-p2", elements=2, steps=20).powers == {}


@pytest.mark.slow
def test_a_check_agrees_and_sees_a_fault_of_the_rate():
    right = check(LEVEL, tol=1e-2)
    assert right.verdict.value == "agree"
    told = check(LEVEL, tol=1e-2, second=LEVEL.replace({"cable.damping": 0.03}))
    assert told.verdict.value == "disagree"


@pytest.mark.slow
def test_the_tilt_is_a_design_number_that_the_judge_computes_again():
    result = rider_check()
    tilt = next(x for x in result.a.finest.design if x["quantity"] == "wind_tilt")
    assert tilt["value"] == pytest.approx(RIDER.wind_tilt)
    (row,) = (row for row in result.rows if (row.quantity, row.law) == ("design", "wind_tilt"))
    assert row.verdict.value == "agree"
    assert not any(x["quantity"] == "wind_tilt" for x in run(LEVEL, "following-p2", elements=2, steps=20).design)


@pytest.mark.slow
def test_the_bar_of_an_event_in_a_check_is_at_least_the_gap():
    result = rider_check()
    assert result.a.finest.events
    for event, other in zip(result.a.finest.events, result.b.finest.events, strict=True):
        assert event["event"] == other["event"]
        for name in ("t", "s_o", "speed"):
            assert abs(event[name] - other[name]) <= event[f"bar_{name}"]
