"""Tables of paths good to 1e-6 against cheap runs of either wing."""

import dataclasses
import math

import numpy as np
import pytest

from cablefem import Scene
from tests.validation.tables import PLACES, TABLES, Path101, Track, ladder_to_the_end, largest_nearby, read_table
from validation.core.running import run

CHEAP = {
    "following-p4": {"scheme": "radau", "elements": 3, "steps": 800},
    "fourier-kink": {"scheme": "trapezoidal", "terms": 10, "steps": 500},
}


def used_share_of_bars(found: Path101, table: Path101) -> float:
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
    found = Path101.of(ladder_to_the_end(scene, method, CHEAP[method]))
    assert used_share_of_bars(found, table) <= 1.0
    # twin: the same table of a mass that came a little later
    widest = np.nanmax(found.bar[0, 0.9 * table.reaches >= PLACES])
    late = dataclasses.replace(table.track, place=table.track.place + np.array([0.0, 2.5 * widest]))
    assert used_share_of_bars(found, dataclasses.replace(table, track=late)) > 1.0


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


def test_the_same_ride_a_little_later_passes_the_same_places():
    _, table = read_table(TABLES[0])
    early = table.track
    late = dataclasses.replace(early, t=early.t + 0.01)
    place, time = early.gap(late)
    known = np.isfinite(early.t)
    np.testing.assert_allclose(place[known], 0.0, atol=1e-12)
    np.testing.assert_allclose(time[known], 0.01, atol=1e-12)


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
    (wide,) = largest_nearby(gap)
    assert math.isnan(wide[0])
    assert np.array_equal(np.flatnonzero(wide > 0.0), np.arange(5, 16))
