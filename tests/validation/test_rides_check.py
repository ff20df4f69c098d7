"""Free rides are compared over time: right answers agree, a fault of one wing turns the row it concerns."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from cablefem import Scene
from cablefem.scene.statics import hauled_rest
from tests.scene.test_ride import ZIP
from validation import check
from validation.core.agreement import DEFAULT_TOL, Verdict, worst_deciding_verdict
from validation.core.refine import run_with_error_bars
from validation.core.rows import (
    AXIAL_MEAN,
    compare,
    compare_answers,
    events_with_error_bars,
    events_with_widened_error_bars,
    tolerance_of_quantity_kind,
)

RIDE = Scene.from_toml(ZIP + "rolling_friction = 0.02\nbrake = [{from = 25.0, force = 40.0}]\nend = {place = 45.0}")


@cache
def ride_of_elements():
    return run_with_error_bars(RIDE, "following-p2", elements=10, steps=300)


@cache
def ride_answers():
    return ride_of_elements(), run_with_error_bars(RIDE, "fourier-kink", terms=12, steps=300)


def rows_by_name(found):
    return {(row.quantity, row.law): row for row in found}


def rows_between_answers(a, b):
    """Rows of both answers, without laws."""
    return rows_by_name(
        compare_answers(RIDE, a, b, partial(tolerance_of_quantity_kind, tol=DEFAULT_TOL, tol_tension=None))
    )


def test_sines_tell_by_how_much_they_miss_the_start_of_a_car_close_to_its_support():
    """The coarser runs miss it alike: none has waves as short as its distance from the support."""
    scene = Scene(
        cable={"mass_per_length": 7.6, "EA": 1.4e8, "horizontal_tension": 3.5e5},
        supports={"span": 860.0, "drop": 210.0}, mass={"mass": 4500.0}, drive={"mode": "haul"},
        travel={"kind": "accelerate_cruise_brake", "top_speed": 7.0},
    )  # fmt: skip
    ladder = run_with_error_bars(scene, "fourier-kink", terms=32, steps=120, until=0.1)
    rest = hauled_rest(0.01, scene.groups).car_point[0] * scene.length
    off = np.abs([ladder.finest.x[0], ladder.finest.y[0]] - rest) / ladder.finest.max_deflection
    coarse = ladder.space.runs[0]
    assert abs(coarse.y[0] - ladder.finest.y[0]) / ladder.finest.max_deflection < off[1] / 5.0
    np.testing.assert_allclose(ladder.start_gap, off, rtol=0.15)


def test_both_wings_ride_alike_and_keep_the_laws():
    found = rows_by_name(compare(RIDE, *ride_answers()))
    asked = {key: row for key, row in found.items() if row.decides}
    assert worst_deciding_verdict(list(found.values())) is Verdict.AGREE, [
        (key, row.gap, row.allowed) for key, row in asked.items() if row.verdict is not Verdict.AGREE
    ]
    quantities = {"place", "speed", "events", "contact", "tension_behind", "laws_si", "impulse"}
    assert {name for name, _ in asked} >= quantities
    assert found[("place", "")].gap < 1e-4
    assert {law for name, law in found if name == "events"} == {
        "brake: time", "brake: speed", "arrival: time", "arrival: speed",
    }  # fmt: skip


def events_with_change(r, name, **changes):
    return [x | changes if x["event"] == name else x for x in r.events]


FAULTS = {
    "place 1 % ahead": (lambda r: replace(r, s_o=1.01 * r.s_o), ("place", "")),
    "speed 2 % off": (lambda r: replace(r, velocity=1.02 * r.velocity), ("speed", AXIAL_MEAN)),
    "contact 5 % off": (lambda r: replace(r, contact=1.05 * r.contact), ("contact", AXIAL_MEAN)),
    "arrival a second late": (
        lambda r: replace(r, events=events_with_change(r, "arrival", t=r.events[-1]["t"] + 1.0)),
        ("events", "arrival: time"),
    ),
    "no brake": (
        lambda r: replace(r, events=[x for x in r.events if x["event"] != "brake"]), ("events", "brake"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_one_wing_turns_its_row(fault):
    change, row = FAULTS[fault]
    a, b = ride_answers()
    assert rows_between_answers(a, b.map(change))[row].verdict is Verdict.DISAGREE


def test_an_event_that_not_all_coarser_runs_tell_is_too_coarse():
    a, b = ride_answers()
    early = replace(b.space, runs=tuple(replace(r, events=events_with_change(r, "none")[:1]) for r in b.space.runs))
    late = a.map(lambda r: replace(r, events=[x for x in r.events if x["event"] != "arrival"]))
    assert rows_between_answers(late, b)[("events", "arrival")].verdict is Verdict.DISAGREE
    assert rows_between_answers(late, replace(b, space=early))[("events", "arrival")].verdict is Verdict.TOO_COARSE


@pytest.mark.parametrize(("wrong_from", "verdict"), [(0.9, Verdict.AGREE), (0.5, Verdict.DISAGREE)])
def test_speed_is_compared_until_a_lasting_stop(wrong_from, verdict):
    def stopped(r, factor):
        stop = {"event": "stop", "t": 0.9 * r.t[-1], "s_o": float(r.s_o[-1]), "speed": 0.0}
        late = r.t[:, None] > wrong_from * r.t[-1]
        return replace(r, events=[*r.events, stop], velocity=np.where(late, factor, 1.0) * r.velocity)

    a, b = ride_answers()
    a, b = a.map(lambda r: stopped(r, 1.02)), b.map(lambda r: stopped(r, 1.0))
    assert rows_between_answers(a, b)[("speed", AXIAL_MEAN)].verdict is verdict


def test_events_have_bars():
    a, b = ride_answers()
    events = {x["event"]: x for x in events_with_error_bars(a)}
    for name in ("brake", "arrival"):
        assert 0.0 < events[name]["bar_t"] < 0.05
        assert 0.0 < events[name]["bar_speed"] < 0.05
        other = next(x for x in b.finest.events if x["event"] == name)
        assert abs(other["speed"] - events[name]["speed"]) < 0.05


def test_events_after_the_first_of_their_kind_have_bars_where_coarser_runs_have_them():
    def turning(r, *times):
        return replace(r, events=[{"event": "turn", "t": t, "s_o": 20.0, "speed": 0.0} for t in times])

    def turn_time_bars(*times):
        e = ride_answers()[0].map(lambda r: turning(r, 1.0, 3.0))
        space = replace(e.space, runs=(turning(e.space.runs[0], *times), *e.space.runs[1:]))
        return [x["bar_t"] for x in events_with_error_bars(replace(e, space=space))]

    first, second = turn_time_bars(1.0, 3.1)
    assert second > first + 0.1
    assert turn_time_bars(1.0)[1] is None, "a bar of an event that a coarser run does not know"


def test_bars_of_events_are_at_least_the_gap_to_the_other_solver():
    """An arrival was printed as +- 0.0001 s where the other solver had it a second later."""
    a, b = ride_answers()
    late = b.map(lambda r: replace(r, events=events_with_change(r, "arrival", t=r.events[-1]["t"] + 1.0)))
    own = events_with_error_bars(a)
    other = events_with_error_bars(late)
    for events, others in ((own, other), (other, own)):
        arrival = events_with_widened_error_bars(events, others)[-1]
        assert arrival["event"] == "arrival"
        assert arrival["bar_t"] == abs(own[-1]["t"] - other[-1]["t"]) > 0.9
        assert arrival["bar_speed"] >= abs(own[-1]["speed"] - other[-1]["speed"])
    assert events_with_widened_error_bars(own, []) == own


def test_a_light_rider_near_the_support_starts_at_rest_in_both_wings():
    """Sines too long for his distance from the support did not show it in coarser runs: "disagree" by 1e-6 m."""
    light = Scene.load("zipline").replace({"mass.mass": 40.0, "drive.end": {"time": 2.0}})
    found = check(light, tol=0.1)
    (row,) = (row for row in found.rows if row.law == "car at rest")
    assert row.verdict.value == "agree"
