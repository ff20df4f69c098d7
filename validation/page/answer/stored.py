"""Stored results of a run or a check."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from cablefem.response import Response
from cablefem.scene import Scene
from validation.core import store
from validation.core.foreign import ForeignPath
from validation.page.answer import EVENTS
from validation.page.page import Row


@dataclass(frozen=True, slots=True)
class StoredAnswer:
    """One or two answers to one scene, and the verdict if there is one."""

    scene: Scene
    runs: tuple[Response, ...]
    agreement: Row = field(default_factory=dict)  # agreement.json; empty for a single run
    third_party: ForeignPath | None = None  # a third party

    @property
    def comparison_rows(self) -> list[Row]:
        return list(self.agreement.get("rows", []))

    @property
    def verdict(self) -> str | None:
        return self.agreement.get("verdict")

    @property
    def design(self) -> list[Row]:
        return list(self.agreement.get("design") or self.runs[0].design)

    @property
    def main_events(self) -> list[Row]:
        """Events of the first solver's run, without rattling before a stop."""
        return [event for event in self.all_events if event["event"] in EVENTS]

    @property
    def all_events(self) -> list[Row]:
        return list(self.agreement.get("events") or self.runs[0].events)

    @property
    def slack_onset_position(self) -> float | None:
        """Position of the mass [m] at the first slack cable of any solver."""
        return min((r.slack_onset * r.length for r in self.runs if r.slack_onset is not None), default=None)

    @property
    def is_free_ride(self) -> bool:
        return self.runs[0].drive == "free"

    def compared_time_range(self, r: Response) -> tuple[float, float]:
        """First and last compared instant [s] of a run."""
        low, high = self.agreement.get("range") or (0.0, 1.0)
        if self.is_free_ride or self.agreement.get("axis") == "time":
            return 0.0, float(r.t[-1])
        ends = np.interp([low * r.length, high * r.length], np.maximum.accumulate(r.s_o), r.t)
        return float(ends[0]), float(ends[1])


def read_stored_check_if_started(folder: Path) -> StoredAnswer | None:
    """The stored results of a check; None where every run broke at its start."""
    agreement = store.read_json(folder / "agreement.json")
    both = [Response.read(folder / name) for name in agreement["methods"][:2]]
    runs = tuple(r for r in both if r.t.size > 1)
    if not runs:
        return None
    scene = Scene.from_toml((folder / "scene.toml").read_text(encoding="utf-8"))
    names = [row["with"] for row in agreement["rows"] if row.get("with")]
    file = folder / "with.csv"
    third_party = replace(ForeignPath.read(file, scene), method=names[0]) if names and file.exists() else None
    return StoredAnswer(scene, runs, agreement, third_party)
