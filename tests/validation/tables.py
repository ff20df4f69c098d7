"""Paths good to 1e-6, as tables: passages of the mass at places along the rope, with error bars.

Made by elements of degree 4 and 2 and by sines, of which each was refined until its bar was met; bars are at least the
distance of two ways.  Seven digits of the largest deflection.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core.ladder import Ladder
from validation.core.refine import RunsOfMethod

NEARBY = 5  # places on either side whose gaps count, as a gap may cross zero
PLACES = np.arange(101) / 100.0  # s_o/l
TABLES = sorted((Path(__file__).parents[1] / "data" / "paths").glob("*.csv"))


@dataclass(frozen=True, slots=True)
class Track:
    """When and where the mass passes the PLACES first; nan where it does not."""

    t: Array  # (101,) [s]
    place: Array  # (101, 2) [m] x and y
    moved: Array  # (101, 2) [m] u and v
    end: str  # why it ends

    @classmethod
    def of(cls, r: Response) -> Track:
        """Passages of a run up to the slack onset, by splines over place."""
        s_o = np.round(r.s_o / r.length, 12)
        farthest_before = np.maximum.accumulate(np.append(-1.0, s_o[:-1]))
        first = (s_o > farthest_before) & (r.t < r.slack_time_or_inf)
        path = np.stack([r.t, r.x, r.y, r.u, r.v], axis=1)
        t, x, y, u, v = CubicSpline(s_o[first], path[first], extrapolate=False)(PLACES).T
        end = "it arrives"
        if r.slack_onset is not None:
            end = f"slack cable at s_o/l = {r.slack_onset:.3f}"
        elif r.reason is not None:
            end = f"{r.reason} at s_o/l = {r.reached:.3f}"
        return cls(t, np.stack([x, y], axis=1), np.stack([u, v], axis=1), end)

    def gap(self, other: Track) -> Array:
        """(2, 101) distances in place [m] and time [s]."""
        distance = np.linalg.norm(self.place - other.place, axis=1)
        return np.stack([distance, np.abs(self.t - other.t)])


@dataclass(frozen=True, slots=True)
class Path101:
    """A run, or a table, with its bar."""

    track: Track
    bar: Array  # (2, 101) in place [m] and time [s]; not finite where coarser runs ended

    @classmethod
    def of(cls, ladder: Ladder) -> Path101:
        bars = ladder.error_bars_in_space_and_time(Track.of, lambda a, b: largest_nearby(a.gap(b)))
        parts = [np.broadcast_to(x, (2, 101)) for x in bars]
        return cls(Track.of(ladder.finest), np.sum(parts, axis=0))

    @property
    def scale(self) -> float:
        """Largest distance from the static cable [m]."""
        return float(np.nanmax(np.linalg.norm(self.track.moved, axis=1)))

    @property
    def reaches(self) -> float:
        return float(PLACES[np.isfinite(self.track.t)][-1])


def ladder_to_the_end(scene: Scene, method: str, settings: dict[str, Any]) -> Ladder:
    """A run and coarser runs to the end of the travel: tables go on past the range that a check compares."""
    runs = RunsOfMethod(scene, method, settings)
    runs.window_end = None
    return runs.compute_ladder(runs.method.settings_for_scene(scene.groups, settings))


def largest_nearby(gap: Array) -> Array:
    """Largest value around each place (last axis); nan where that place has none."""
    largest = maximum_filter1d(np.nan_to_num(gap), 2 * NEARBY + 1, axis=1, mode="constant")
    return np.where(np.isfinite(gap), largest, np.nan)


def read_table(file: Path) -> tuple[str, Path101]:
    """The scene of a table as TOML, and its path."""
    lines = file.read_text(encoding="utf-8").splitlines()
    notes = [line[1:].removeprefix(" ") for line in lines if line.startswith("#")]
    toml = "\n".join(notes[notes.index("scene:") + 1 :]) + "\n"
    place, *columns = np.loadtxt(lines[len(notes) + 1 :], delimiter=",", unpack=True)
    rows = np.full((PLACES.size, 7), np.nan)
    rows[np.round(100.0 * place).astype(int)] = np.transpose(columns)
    end = next(note.removeprefix("ends: ") for note in notes if note.startswith("ends: "))
    track = Track(t=rows[:, 0], place=rows[:, 1:3], moved=rows[:, 3:5], end=end)
    # rewritten, as the order of tables may differ
    return Scene.from_toml(toml).to_toml(), Path101(track, bar=rows[:, 5:].T)
