"""What is compared of a scene: over place or time, from where to where."""

import dataclasses
import math
import tomllib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cablefem import Scene
from validation.core import measures
from validation.core.measures import NotComparable
from validation.core.view import View

TABLE = {"kind": "table", "times": [0.0, 4.0, 8.0], "positions": [0.0, 60.0, 100.0]}


def run_with(**changes: Any) -> Any:
    fields = {"method": "one", "drive": "grip", "t": [0.0, 9.0], "reached": 1.0, "slack_onset": None}
    fields |= {"status": "complete"} | changes
    onset = fields["slack_onset"]
    return SimpleNamespace(**fields, slack_onset_position_or_inf=math.inf if onset is None else onset)


def test_a_travel_is_compared_over_place_and_a_ride_over_time() -> None:
    level, ride = View.of_scene(Scene.load("level")), View.of_scene(Scene.load("zipline"))
    assert (level.axis, level.window, level.free, level.rolls) == ("place", (0.02, 0.80), False, False)
    assert (ride.axis, ride.free, ride.rolls, ride.last_needed_relative_position) == ("time", True, True, None)
    assert View.of_scene(Scene.load("tramway")).rolls


def test_a_travel_that_ends_in_mid_span_is_compared_to_its_end() -> None:
    data = tomllib.loads(Scene.load("level").to_toml()) | {"travel": TABLE}
    scene = Scene(**data)
    assert View.of_scene(scene).window[1] == pytest.approx(100.0 / scene.length)


def test_windows_are_cut_where_a_run_ends_or_is_slack() -> None:
    view = View.of_scene(Scene.load("level"))
    assert view.cut_to_valid_range(run_with(), run_with(slack_onset=0.5)).window == (0.02, 0.5)
    assert view.cut_to_valid_range(run_with(reached=0.999), run_with()).window == (0.02, 0.80)
    with pytest.raises(NotComparable, match="two ends"):
        view.cut_to_valid_range(run_with(), run_with(method="two", reached=0.01))
    with pytest.raises(NotComparable, match=r"one ends at .* before 0\.03"):  # less than two frames
        view.cut_to_valid_range(run_with(reached=0.025))
    short = dataclasses.replace(view, window=(0.02, 0.014))
    with pytest.raises(NotComparable, match="one ends"):  # by its timetable, not for slow waves
        short.cut_to_valid_range(run_with(reached=0.014))
    ride = View.of_scene(Scene.load("zipline")).cut_to_valid_range(
        run_with(drive="free"), run_with(drive="free", t=[0.0, 8.5])
    )
    assert ride.until == 8.5
    assert ride.is_reached_by(run_with(t=[0.0, 8.4]))
    assert not ride.is_reached_by(run_with(t=[0.0, 8.4], status="incomplete"))


def test_a_coarser_run_that_ends_early_covers_nothing() -> None:
    view = dataclasses.replace(View.of_scene(Scene.load("level")), window=(0.02, 0.6))
    assert view.is_reached_by(run_with(reached=0.61))
    assert not view.is_reached_by(run_with(reached=0.59))


@pytest.mark.parametrize("end", [0.44076144159, 0.44076144241])  # rounding the ninth decimal raises one, lowers one
def test_the_frame_in_which_a_car_comes_to_rest_is_compared(end: float) -> None:
    fields = SimpleNamespace(t=np.linspace(0.0, 3.0, 4), s_o=np.array([0.1, 0.3, 0.4, end]), s=np.linspace(0.0, 1.0, 5))
    run: Any = SimpleNamespace(fields=fields, length=1.0, t=fields.t, drive="haul")
    assert measures.common_frames(run, run, (0.02, end)).in_a.tolist() == [0, 1, 2, 3]
