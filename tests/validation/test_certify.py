"""Shipped tables against cheap runs of either wing, and the machinery that makes them."""

import dataclasses
import math

import numpy as np
import pytest

from cablefem import Scene
from validation.commands.certify import study
from validation.commands.certify.study import PLACES, Found, Track, compared, joined, nearby, read_table
from validation.core.climb import laddered
from validation.core.running import run

TABLES = study.tables()
CHEAP = {
    "following-p4": {"scheme": "radau", "elements": 3, "steps": 1600},
    "fourier-kink": {"scheme": "trapezoidal", "terms": 10, "steps": 800},
}


def filling(found: Found, table: Found) -> float:
    """Return the largest part of what is allowed that a run's distance from a table takes."""
    part = found.track.gap(table.track)[0] / (found.bar[0] + table.bar[0])
    return float(np.nanmax(part[(PLACES > 0.0) & (0.9 * table.reaches >= PLACES)]))


@pytest.mark.parametrize(
    ("file", "method"),
    [pytest.param(file, list(CHEAP)[i % 2], id=f"{file.stem} {list(CHEAP)[i % 2]}") for i, file in enumerate(TABLES)],
)
def test_cheap_runs_lie_within_their_own_bar_of_the_shipped_table(file, method):
    toml, table = read_table(file)
    scene = Scene.from_toml(toml)
    assert scene.to_toml() == toml
    found = Found.of(laddered(scene, method, **study.to_the_end(scene), **CHEAP[method]))
    assert filling(found, table) <= 1.0
    # twin: the same table of a mass that came a little later
    widest = np.nanmax(found.bar[0, 0.9 * table.reaches >= PLACES])
    late = dataclasses.replace(table.track, place=table.track.place + np.array([0.0, 2.5 * widest]))
    assert filling(found, dataclasses.replace(table, track=late)) > 1.0


@pytest.mark.parametrize("file", TABLES, ids=lambda file: file.stem)
def test_shipped_tables_say_how_deep_they_go(file):
    _, table = read_table(file)
    known = np.isfinite(table.track.t)
    assert np.all(np.diff(np.flatnonzero(known)) == 1)
    assert np.array_equal(known, np.isfinite(table.bar).all(axis=0))
    assert table.track.t[known][0] >= 0.0
    assert np.all(np.diff(table.track.t[known]) > 0.0)
    # seven digits of the deflection: rounding is below the bar
    assert table.bar[0, known].min() > 0.5e-8 * table.scale


def against(made: study.Certificate, table: Found):
    return compared(made, made.bar, table)


def some_found(shift: float = 0.0) -> Found:
    moved = np.stack([0.1 * np.sin(3.0 * PLACES), 2.0 * np.sin(math.pi * PLACES / 1.1) + shift], axis=1)
    place = moved + np.stack([370.0 * PLACES, 20.0 * PLACES], axis=1)
    t = Track(31.0 * PLACES + shift, place, moved, "it arrives")
    settings = {"elements": 3, "steps": 7, "scheme": "radau"}
    return Found("following-p4 radau", settings, t, np.full((2, 2, 101), 1.5e-6))


def test_a_table_reads_back_as_it_was_written(tmp_path):
    scene = Scene.load("level")
    made = joined(scene, (some_found(), some_found(1e-6), some_found(1e-4)))
    study.write_table(tmp_path / "x.csv", made)
    toml, table = read_table(tmp_path / "x.csv")
    assert toml == scene.to_toml()
    np.testing.assert_allclose(table.track.place, made.answer.track.place, rtol=0.0, atol=1e-8 * made.answer.scale)
    np.testing.assert_allclose(table.bar, made.bar, rtol=0.06)
    ride = dataclasses.replace(made, scene=Scene.load("zipline"))
    assert [row.verdict.value for row in (*against(made, table), *against(ride, table))] == ["agree"] * 3
    shifted = (some_found(1e-5), some_found(1e-5))
    assert [row.verdict.value for row in against(joined(scene, shifted), table)] == ["disagree"]
    assert [row.verdict.value for row in against(joined(ride.scene, shifted), table)] == ["disagree"] * 2


def test_the_bar_is_no_less_than_the_distance_of_two_ways():
    near, far = (joined(Scene.load("level"), (some_found(), some_found(shift))) for shift in (1e-6, 1e-4))
    assert np.array_equal(near.bar, near.answer.bar)
    np.testing.assert_allclose(far.bar, 1e-4, rtol=1e-7)
    assert far.depth(1e-6) == 0.0
    assert near.depth(1.01 * 3e-6 / near.answer.scale) == 1.0


def test_the_same_ride_a_little_later_passes_the_same_places():
    early = some_found().track
    late = dataclasses.replace(early, t=early.t + 0.01)
    np.testing.assert_allclose(early.gap(late), [np.zeros(101), np.full(101, 0.01)], atol=1e-12)


def test_passages_are_those_of_the_run_and_end_where_the_cable_goes_slack():
    r = run(Scene.load("level"), "following-p2", elements=6, steps=400)
    track = Track.of(r)
    k = 40  # one step in four ends at a place of the table
    assert r.s_o[160] == pytest.approx(PLACES[k] * r.length)
    np.testing.assert_allclose(
        [track.t[k], *track.place[k], *track.moved[k]], [x[160] for x in (r.t, r.x, r.y, r.u, r.v)], rtol=1e-9
    )
    assert r.slack_onset is not None
    assert PLACES[np.isfinite(track.t)][-1] == pytest.approx(r.slack_onset, abs=0.01)
    assert track.end.startswith("slack cable at s_o/l = 0.8")


def test_gaps_nearby_count_and_places_without_one_have_none():
    gap = np.zeros((1, 20))
    gap[0, 10], gap[0, 0] = 3.0, math.nan
    (wide,) = nearby(gap)
    assert math.isnan(wide[0])
    assert np.array_equal(np.flatnonzero(wide > 0.0), np.arange(5, 16))
