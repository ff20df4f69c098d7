"""Shipped tables against cheap runs of either wing, and the machinery that makes them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from cablefem import Scene
from validation.commands.certify import study
from validation.commands.certify.study import Found, Track, Way, against, joined, measured, nearby, read_table
from validation.core.methods import find

TABLES = study.tables()
CHEAP = (Way("following-p4", "radau", (3, 1600), 0.0), Way("fourier-kink", "trapezoidal", (10, 800), 0.0))


def filling(found: Found, table: study.Table) -> float:
    """Return the largest part of what is allowed that a run's distance from a table takes."""
    t = found.track
    gap, bar = t.gap(table.track)[0], study.at(t.k, table.bar, table.track.k)[0]
    return float(np.nanmax((gap / (found.bar[0] + bar))[(t.k > 0) & (t.k <= 0.9 * table.track.k[-1])]))


@pytest.mark.parametrize("way", CHEAP, ids=lambda way: way.name)
@pytest.mark.parametrize("file", TABLES, ids=lambda file: file.stem)
def test_cheap_runs_lie_within_their_own_bar_of_the_shipped_table(file, way):
    table = read_table(file)
    scene = Scene.from_toml(table.scene)
    assert scene.to_toml() == table.scene
    found = measured(scene, way)
    assert filling(found, table) <= 1.0
    # twin: the same table of a mass that came a little later
    widest = np.nanmax(found.bar[0, found.track.k <= 0.9 * table.track.k[-1]])
    late = dataclasses.replace(table.track, place=table.track.place + np.array([0.0, 2.5 * widest]))
    assert filling(found, dataclasses.replace(table, track=late)) > 1.0


@pytest.mark.parametrize("file", TABLES, ids=lambda file: file.stem)
def test_shipped_tables_say_how_deep_they_go(file):
    table = read_table(file)
    assert np.all(np.diff(table.track.k) == 1.0)
    assert np.isfinite(table.bar).all()
    assert table.track.t[0] >= 0.0
    assert np.all(np.diff(table.track.t) > 0.0)
    # seven digits of the deflection: rounding is below the bar
    assert table.bar[0].min() > 0.5e-8 * table.scale


def some_found(shift: float = 0.0, way: Way = CHEAP[0]) -> Found:
    k = np.arange(101.0)
    moved = np.stack([0.1 * np.sin(0.03 * k), 2.0 * np.sin(math.pi * k / 110.0) + shift], axis=1)
    place = moved + np.stack([3.7 * k, 0.2 * k], axis=1)
    t = Track(k, 0.31 * k + shift, place, moved, "it arrives")
    return Found(way, {"elements": 3, "steps": 7, "scheme": "radau"}, t, np.full((2, 101), 3e-6), (1e-6, 5e-7), 2.0)


def test_a_table_reads_back_as_it_was_written(tmp_path):
    scene = Scene.load("level")
    made = joined(scene, (some_found(), some_found(1e-6), some_found(1e-4)))
    study.write_table(tmp_path / "x.csv", made)
    table = read_table(tmp_path / "x.csv")
    assert table.scene == scene.to_toml()
    np.testing.assert_allclose(table.track.place, made.answer.track.place, rtol=0.0, atol=1e-8 * made.answer.scale)
    np.testing.assert_allclose(table.bar, made.bar, rtol=0.06)
    ride = dataclasses.replace(made, scene=Scene.load("zipline"))
    assert [row.verdict.value for row in (*against(table, made), *against(table, ride))] == ["agree"] * 3
    shifted = (some_found(1e-5), some_found(1e-5))
    assert [row.verdict.value for row in against(table, joined(scene, shifted))] == ["disagree"]
    assert [row.verdict.value for row in against(table, joined(ride.scene, shifted))] == ["disagree"] * 2


def test_the_bar_is_no_less_than_the_distance_of_two_ways():
    near, far = (joined(Scene.load("level"), (some_found(), some_found(shift))) for shift in (1e-6, 1e-4))
    assert np.array_equal(near.bar, near.answer.bar)
    np.testing.assert_allclose(far.bar, 1e-4, rtol=1e-7)
    assert far.depth(1e-6) == 0.0
    assert near.depth(3e-6 / 2.0) == 1.0


def test_the_same_ride_a_little_later_passes_the_same_places():
    early = some_found().track
    late = dataclasses.replace(early, t=early.t + 0.01)
    np.testing.assert_allclose(early.gap(late), [np.zeros(101), np.full(101, 0.01)], atol=1e-12)


@pytest.mark.parametrize("space_left", [0.0, 1e-3])
def test_what_is_left_in_time_is_measured_on_the_finest_mesh(monkeypatch, space_left):
    """A model whose error in time is seen by fine elements only, as that of waves that coarse ones do not carry."""

    def made(scene, method, settings):
        n, steps = settings["elements"], settings["steps"]
        error = space_left / n**2 + (1e-3 * (1600.0 / steps) ** 2 if n > 8 else 0.0)
        track = some_found(error).track
        return dataclasses.replace(track, t=0.31 * track.k)

    monkeypatch.setattr(study, "track", made)
    found = study.climb(Scene.load("level"), Way("following-p4", "radau", (8, 1600), 4e4))
    n, steps = found.settings["elements"], found.settings["steps"]
    assert (n > 8) == (space_left > 0.0)
    error = space_left / n**2 + (1e-3 * (1600.0 / steps) ** 2 if n > 8 else 0.0)
    assert np.nanmin(found.bar[0]) >= error


def test_gaps_nearby_count_and_places_without_one_have_none():
    gap = np.zeros(20)
    gap[10], gap[0] = 3.0, math.nan
    wide = nearby(gap)
    assert math.isnan(wide[0])
    assert np.array_equal(np.flatnonzero(wide > 0.0), np.arange(5, 16))


def test_a_hauled_car_goes_no_further_than_its_steps_do():
    scene, method = Scene.load("tramway"), find("following-p2")
    ends = [
        study.track(scene, method, method.settings({"elements": 8, "steps": 800, "scheme": scheme})).end
        for scheme in ("gauss", "radau")
    ]
    assert ends[0].startswith("steps too long at s_o/l = 0.9")
    assert ends[1] == "it arrives"
