"""Free rides are compared over time: right answers agree, a fault of one wing turns the row it concerns."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.response import MassPath
from tests.scene.test_ride import ZIP
from tests.validation.pairs import altered, right
from validation.core import measures
from validation.core.agreement import (
    ALONG,
    AXIAL_MEAN,
    UP_TO,
    Agreement,
    Bound,
    Part,
    Verdict,
    _slack_onset,
    agree,
    overall,
    with_bars,
)  # fmt: skip
from validation.core.design import numbers
from validation.core.estimate import RESOLVED, estimated, rings
from validation.core.methods import find
from validation.core.resolution import resolved
from validation.core.running import run
from validation.core.sampling import _turns

RIDE = Scene.from_toml(ZIP + "rolling_friction = 0.02\nbrake = [{from = 25.0, force = 40.0}]\nend = {place = 45.0}")


@cache
def pair():
    return (
        estimated(RIDE, "following-p2", elements=16, steps=500),
        estimated(RIDE, "fourier-kink", terms=16, steps=500),
    )


def rows(a, b):
    return {(row.quantity, row.law): row for row in agree(RIDE, a, b)}


def test_both_wings_ride_alike_and_keep_the_laws():
    found = rows(*pair())
    verdicts = {key: row.verdict for key, row in found.items() if row.verdict is not Verdict.AGREE}
    coarse = {("impulse", ""), ("velocity", ALONG), ("velocity", UP_TO)}
    assert set(verdicts) <= coarse, {key: (found[key].gap, found[key].allowed) for key in verdicts}
    quantities = {name for name, _ in found}
    assert quantities >= {"place", "speed", "events", "contact", "tension_behind", "laws_si", "impulse"}
    assert found[("place", "")].gap < 1e-4
    assert found[("speed", "")].gap < 2e-3
    assert {law for name, law in found if name == "events"} == {
        "brake: time", "brake: speed", "arrival: time", "arrival: speed",
    }  # fmt: skip


def event(r, name, **changes):
    return [x | changes if x["event"] == name else x for x in r.events]


FAULTS = {
    "place 1 % ahead": (lambda r: replace(r, s_o=1.01 * r.s_o), ("place", "")),
    "speed 2 % off": (lambda r: replace(r, velocity=1.02 * r.velocity), ("speed", "")),
    "contact 5 % off": (lambda r: replace(r, contact=1.05 * r.contact), ("contact", AXIAL_MEAN)),
    "arrival a second late": (
        lambda r: replace(r, events=event(r, "arrival", t=r.events[-1]["t"] + 1.0)), ("events", "arrival: time"),
    ),
    "no brake": (
        lambda r: replace(r, events=[x for x in r.events if x["event"] != "brake"]), ("events", "brake: time"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_one_wing_turns_its_row(fault):
    change, row = FAULTS[fault]
    a, b = pair()
    assert rows(a, altered(b, change))[row].verdict is Verdict.DISAGREE


def test_a_rides_tension_field_is_asked_only_where_means_do_not_agree():
    """What rings along the cable of a ride never ends; of a prescribed travel the field is asked for itself."""

    def row(quantity, gap, bar, law=""):
        return Agreement(quantity, gap, Bound("error bars", (Part("a", bar, "made up"),)), law=law).at_most(0.05)

    means = [row(x, 0.001, 0.01, AXIAL_MEAN) for x in ("tension_behind", "tension_ahead", "reactions")]
    place, coarse, apart = row("place", 0.0, 0.01), row("tension", 0.02, 0.1), row("tension", 0.5, 0.04)
    assert overall([place, *means, coarse]) is Verdict.AGREE
    assert overall([*means, coarse]) is Verdict.TOO_COARSE
    assert overall([place, *means[1:], coarse]) is Verdict.TOO_COARSE
    assert overall([place, *means, apart]) is Verdict.DISAGREE


@pytest.mark.parametrize(
    ("status", "verdict"), [("incomplete", Verdict.NOT_COMPARABLE), ("complete", Verdict.DISAGREE)]
)
def test_an_event_after_the_end_of_a_run_that_broke_is_nobodys_fault(status, verdict):
    a, b = pair()
    a = altered(a, lambda r: replace(r, events=event(r, "brake", t=r.t[-1] + 1.0)))
    b = altered(b, lambda r: replace(r, status=status, events=[x for x in r.events if x["event"] != "brake"]))
    assert rows(a, b)[("events", "brake: time")].verdict is verdict


@pytest.mark.parametrize(("slack", "asked"), [(0.1, False), (None, True)])
def test_an_event_past_the_slack_that_broke_a_companion_is_not_asked(slack, asked):
    a, b = (altered(e, lambda r: replace(r, slack_onset=slack, switched=slack)) for e in pair())
    early = [x for x in b.in_space.events if x["event"] != "arrival"]
    b = replace(b, in_space=replace(b.in_space, status="incomplete", events=early))
    row = rows(a, b).get(("events", "arrival: time"))
    assert (row is not None) is asked
    assert row is None or row.verdict is Verdict.NOT_COMPARABLE


@pytest.mark.parametrize(("off", "verdict"), [(0.0, Verdict.DISAGREE), (0.3, Verdict.TOO_COARSE)])
def test_where_tension_is_not_told_neither_is_slack(off, verdict):
    """One answer and its companions go slack; the other does not; off : tension of the coarser companion, over H."""
    a, b = pair()
    a = altered(a, lambda r: replace(r, slack_onset=0.1))
    loose = replace(a.in_space, T_ahead=a.in_space.T_ahead + off * a.run.horizontal_tension)
    assert rows(replace(a, in_space=loose), b)[("slack_onset", "")].verdict is verdict


@pytest.mark.parametrize(("coarse", "verdict"), [(0.0, Verdict.AGREE), (0.06, Verdict.TOO_COARSE)])
def test_the_time_of_a_stop_is_asked_no_better_than_axial_waves_tell(coarse, verdict):
    """Bars of 0.07 of the ride, all of it two waves' ways; or so much more by what a companion changes."""
    waits = 2.0 * RIDE.length / RIDE.axial_speed / pair()[0].run.t[-1]
    soft = RIDE.variant(alpha=RIDE.alpha * (waits / 0.035) ** 2)

    def stopped(e, late):
        def at(r, t):
            return replace(r, events=[*r.events, {"event": "stop", "t": t, "s_o": float(r.s_o[-1]), "speed": 0.0}])

        end = 0.9 * e.run.t[-1]
        run, in_space, in_time = at(e.run, end), at(e.in_space, end - late * e.run.t[-1]), at(e.in_time, end)
        return replace(e, response=run, run=run, in_space=in_space, in_time=in_time)

    a, b = pair()
    found = {(row.quantity, row.law): row for row in agree(soft, stopped(a, coarse), stopped(b, 0.0))}
    row = found[("events", "stop: time")]
    assert row.allowed == pytest.approx(0.07 + 1.5 * coarse, rel=0.02)
    assert row.verdict is verdict


@pytest.mark.parametrize(("wrong_from", "verdict"), [(0.9, Verdict.AGREE), (0.5, Verdict.DISAGREE)])
def test_speed_is_compared_until_a_lasting_stop(wrong_from, verdict):
    def stopped(r, factor):
        stop = {"event": "stop", "t": 0.9 * r.t[-1], "s_o": float(r.s_o[-1]), "speed": 0.0}
        late = r.t[:, None] > wrong_from * r.t[-1]
        return replace(r, events=[*r.events, stop], velocity=np.where(late, factor, 1.0) * r.velocity)

    a, b = pair()
    a, b = altered(a, lambda r: stopped(r, 1.02)), altered(b, lambda r: stopped(r, 1.0))
    assert rows(a, b)[("speed", "")].verdict is verdict


@pytest.mark.parametrize(("since", "verdict"), [(0.7, Verdict.AGREE), (0.3, Verdict.DISAGREE)])
def test_energy_is_kept_until_the_cable_is_slack(since, verdict):
    """A slack cable loses energy as it snaps taut, and steps that damp lose more: a ride that comes back from one did.

    The rider reaches his farthest place halfway, and loses energy from `since` on.
    """

    def swings(r):
        place = r.length * (0.2 + 0.3 * np.sin(np.pi * r.t / r.t[-1]))
        slack = float(place[np.searchsorted(r.t, 0.6 * r.t[-1])]) / r.length
        lost = RIDE.mass.mass * RIDE.gravity * r.max_deflection * np.maximum(0.0, r.t / r.t[-1] - since)
        return replace(r, s_o=place, slack_onset=slack, switched=slack, energy=r.energy - lost)

    a, b = (altered(e, swings) for e in pair())
    assert 0.59 < a.run.slack_since / a.run.t[-1] < 0.61
    assert rows(a, b)[("energy", "")].verdict is verdict


def swing(late=0.0, since=0.0, wide=1.0, blur=0.05, method="a"):
    """A rider who swings from one fifth of a cable to the other, turning after 10 s, `late` from an instant on."""
    t = np.linspace(0.0, 40.0, 401)
    at = np.maximum(0.0, t - late * (t > since))
    s_o = 100.0 * (0.5 - 0.3 * wide * np.cos(np.pi * at / 10.0))
    none = np.zeros_like(t)
    return MassPath(
        method=method, settings={}, drive="free", slack_onset=None, length=100.0, t=t, s_o=s_o, x=s_o, y=none, u=none,
        v=none, work={}, blur=blur,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("other", "seen"),
    [
        ({"late": 0.09, "since": 10.0}, 0.0), ({"late": 0.04, "since": 10.0, "method": "a"}, 0.0),
        ({"late": 0.2, "since": 10.0}, 0.1), ({"late": 0.09, "since": 10.0, "method": "a"}, 0.04),
        ({"late": 0.09, "since": 5.0}, 0.09),  # before the turn
        ({"late": 0.09, "since": 10.0, "blur": 0.0}, 0.04),  # one of both alone
        ({"wide": 1.01}, 0.03 * 10.0 / (3.0 * np.pi)),  # in m, as everything over the top speed
    ],
)  # fmt: skip
def test_instants_after_a_turn_against_friction_are_open(other, seen):
    """Both of two methods, one of runs of the same: places are as asked where the car turns, before, and off its path.

    seen : gap over the top speed [s].
    """
    found = measures.path_gap(swing(), swing(**{"method": "b"} | other), (0.0, 1.0))[0]
    assert found * 10.0 / (3.0 * np.pi) == pytest.approx(seen, abs=2e-3)


def test_rides_with_friction_or_brakes_alone_have_open_instants():
    axial = 2.0 * RIDE.length / RIDE.axial_speed
    assert run(RIDE, "following-p2", elements=3, steps=50).blur == pytest.approx(0.05 * axial)
    assert run(Scene.from_toml(ZIP), "following-p2", elements=3, steps=50).blur == 0.0
    assert run(Scene.load("level"), "following-p2", elements=3, steps=50).blur == 0.0


def test_what_most_steps_are_taken_in_is_not_most_of_a_ride():
    """A brake that rings takes most of the steps of a ride, and a tenth of its time."""
    t = np.concatenate([np.linspace(0.0, 0.9, 91), np.linspace(0.9, 1.0, 1001)[1:]])
    assert measures._over_time(t, (t > 0.9).astype(float)) == pytest.approx(0.1, abs=0.01)
    enough = 2.0 * RIDE.length / RIDE.axial_speed / RESOLVED
    for longer, missed in ((2.0, True), (0.5, False)):  # than the long steps may be
        assert rings(RIDE, SimpleNamespace(t=longer * enough * t / 0.01)) is missed


def test_events_and_design_numbers_have_bars():
    a, b = pair()
    told = {x["event"]: x for x in with_bars(RIDE, a)}
    for name in ("brake", "arrival"):
        assert 0.0 < told[name]["bar_t"] < 0.05
        assert 0.0 < told[name]["bar_speed"] < 0.05
        other = next(x for x in b.run.events if x["event"] == name)
        assert abs(other["speed"] - told[name]["speed"]) < 0.05
    speed = next(number for number in numbers(a, b) if number.quantity == "speed_max")
    assert speed.value == pytest.approx(float(np.max(a.run.speed)))
    assert 0.0 < speed.bar < 0.05


def test_events_after_the_first_of_their_kind_have_bars_where_all_runs_have_them():
    a, _ = pair()

    def turning(r, *times):
        return replace(r, events=[{"event": "turn", "t": t, "s_o": 20.0, "speed": 0.0} for t in times])

    def told(*times):
        fine, in_time = turning(a.run, 1.0, 3.0), turning(a.in_time, 1.0, 3.0)
        e = replace(a, run=fine, in_space=turning(a.in_space, *times), in_time=in_time)
        return [x["bar_t"] for x in with_bars(RIDE, e)]

    first, second = told(1.0, 3.1)
    assert second > first + 0.1
    assert told(1.0)[1] is None, "a bar of an event that a companion does not know"


def test_a_turn_is_one_after_which_the_car_goes_back_and_no_rattle():
    t = np.linspace(0.0, 4.0 * np.pi, 4001)
    assert list(_turns(t, 0.5 - 0.3 * np.cos(t))) == pytest.approx([np.pi, 2.0 * np.pi, 3.0 * np.pi], abs=0.01)
    assert not list(_turns(t, 0.1 + 0.05 * t + 4e-4 * np.sin(300.0 * t)))


def test_heavy_cars_that_turn_against_friction_take_more_steps():
    """By the waves they make, up to twice as many; the others' steps are those of the table."""
    groups, method = RIDE.groups, find("fourier-kink")
    usual = method.settings_on(groups, {})["steps"]

    def steps(mu, method=method, **drive):
        return method.settings_on(replace(groups, mu=mu, drive=replace(groups.drive, **drive)), {})["steps"]

    assert Scene.load("rollback").groups.drive.turns
    assert not groups.drive.turns
    assert [steps(mu, turns=True) / usual for mu in (0.3, 1.0, 9.0)] == pytest.approx([1.0, 1.6, 2.0])
    assert steps(1.0) == steps(1.0, turns=True, mu_r=0.0) == usual
    assert len({steps(mu, find("following-p2"), turns=True) for mu in (0.3, 9.0)}) == 1


def test_means_over_an_axial_round_trip_end_with_the_window():
    """Next to the far support, beyond it, forces grow faster than bars from within it tell."""
    scene = Scene.load("tramway")
    r = run(scene, "following-p2", elements=4, steps=150)
    axial, window = 20.0 * 2.0 * scene.length / scene.axial_speed, (0.02, 0.9)
    place = r.s_o / r.length
    past, inside = (np.where((place > x) & (place < y), 1e6, 0.0) for x, y in ((0.91, 1.0), (0.8, 0.9)))

    def gap(more):
        other = replace(r, F_haul=r.F_haul + more)
        return measures.series_gap(r, other, window, lambda x: x.F_haul, axial)

    assert gap(past) == 0.0
    assert gap(inside) > 1e5


def test_a_run_that_found_no_start_has_a_slack_onset_all_the_same():
    a, b = right()
    still = altered(b, lambda r: replace(r, s_o=r.s_o[:1]))
    assert _slack_onset(a, still).bound.value > 0.0


def test_means_of_forces_take_the_jump_at_a_break_as_one():
    """At the step of a break a force is told as it is before; a line from there to the next step is none of it."""
    t = np.array([0.0, 0.3, 0.7, 1.0, 1.6, 2.0, 2.7, 3.1])
    F = np.where(t <= 1.0, 2.0 + 0.5 * t, 7.0 - 1.5 * t)[:, None]
    at = np.array([0.4, 1.0, 1.3, 1.6, 2.9])
    exact = np.where(at <= 1.0, 2.0 * at + 0.25 * at**2, 2.25 + 7.0 * (at - 1.0) - 0.75 * (at**2 - 1.0))
    np.testing.assert_allclose(measures._summed(t, F, [1.0], at)[:, 0], exact, rtol=0.0, atol=1e-12)
    assert np.abs(measures._summed(t, F, [], at)[:, 0] - exact).max() > 0.5


def test_bars_of_what_rings_hear_the_axial_waves_that_long_steps_damp():
    """A ladder of Radau's few steps tells of the path, and next to nothing of what a break of the travel lets ring."""
    scene = Scene.load("tramway")
    e = resolved(scene, "following-p2", 1.5e-4, until=0.95)
    assert e.run.settings["scheme"] == "radau"
    fine = run(scene, "following-p4", elements=8, steps=6000, scheme="generalized-alpha", rho_inf=0.9, until=0.95)
    reference = replace(e, response=fine, run=fine, in_space=fine, in_time=fine, loud=None)

    def missed(e):
        found = [x for x in agree(scene, e, reference) if x.quantity not in ("energy", "impulse", "laws_si")]
        return {(x.quantity, x.law) for x in found if x.gap > x.allowed}

    heard, deaf = missed(e), missed(replace(e, loud=None))
    assert not heard
    assert deaf >= {("contact", AXIAL_MEAN), ("velocity", ALONG)}
