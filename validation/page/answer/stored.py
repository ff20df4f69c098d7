"""Stored results of a run or a check; missing files are listed."""

import csv
import json
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.response import Array, Response
from cablefem.scene import Scene, SceneError

EVENTS = ("release", "thrust_end", "brake", "turn", "stop", "arrival", "back", "lift_off")


@dataclass(frozen=True, slots=True)
class Party:
    """A third party's mass path."""

    name: str
    t: Array  # (n,) [s]
    s_o: Array  # (n,) [m]
    y: Array  # (n,) [m] down from the left support


@dataclass(frozen=True, slots=True)
class Stored:
    """One or two answers to one scene, and the verdict if there is one."""

    scene: Scene
    runs: tuple[Response, ...]
    agreement: dict[str, Any] = field(default_factory=dict)  # agreement.json; empty for a single run
    party: Party | None = None
    grip: Response | None = None  # hauled car: what a gripping one would have given

    @property
    def rows(self) -> list[dict[str, Any]]:
        return list(self.agreement.get("rows", []))

    @property
    def verdict(self) -> str | None:
        return self.agreement.get("verdict")

    @property
    def design(self) -> list[dict[str, Any]]:
        return list(self.agreement.get("design") or self.runs[0].design)

    @property
    def events(self) -> list[dict[str, Any]]:
        """Events of the first solver's ride, without rattling before a stop."""
        told = self.agreement.get("events") or self.runs[0].events
        return [event for event in told if event["event"] in EVENTS]

    @property
    def names(self) -> str:
        return " and ".join(r.method for r in self.runs)

    @property
    def onset(self) -> float | None:
        """Place of the mass [m] where the first solver found the cable slack."""
        return min((r.slack_onset * r.length for r in self.runs if r.slack_onset is not None), default=None)

    @property
    def free(self) -> bool:
        return self.runs[0].drive == "free"

    def compared(self, r: Response) -> tuple[float, float]:
        """Return first and last compared instant [s] of a run."""
        low, high = self.agreement.get("range") or (0.0, 1.0)
        if self.free or self.agreement.get("axis") == "time":
            return 0.0, float(r.t[-1])
        ends = np.interp([low * r.length, high * r.length], np.maximum.accumulate(r.s_o), r.t)
        return float(ends[0]), float(ends[1])

    def row(self, quantity: str) -> dict[str, Any]:
        """Return our solvers' row of a quantity, or an empty one."""
        return next((r for r in self.rows if r.get("quantity") == quantity and not r.get("with")), {})


def read(folder: Path, faults: list[str]) -> Stored | None:
    """Return the contents of a check's folder, or None without any answer; list missing files in `faults`."""
    agreement = _json(folder / "agreement.json", faults) or {}
    names = agreement.get("methods") or sorted(path.parent.name for path in folder.glob("*/response.npz"))
    runs = tuple(r for name in names[:2] if (r := response(folder / name, faults)) is not None)
    scene = _scene(folder / "scene.toml", runs, faults)
    if not runs or scene is None or scene.mass is None:
        return None
    grip = response(folder / "grip", faults) if runs[0].drive == "haul" and (folder / "grip").exists() else None
    return Stored(scene, runs, agreement, _party(folder / "with.csv", agreement, faults), grip)


def response(folder: Path, faults: list[str]) -> Response | None:
    """Return the answer in a folder; None unless it has two steps."""
    file = f"{folder.name}/response.npz"
    try:
        found = Response.read(folder)
        if found.t.size > 1:
            return found
        faults.append(f"{file} (broke at its start: {found.reason})")
    except OSError:
        faults.append(file)
    except (ValueError, KeyError, TypeError, zipfile.BadZipFile):
        faults.append(f"{file} (not readable)")
    return None


def _json(file: Path, faults: list[str]) -> dict[str, Any] | None:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        if isinstance(content, dict):
            return content
        faults.append(f"{file.name} (holds no table)")
    except OSError:
        faults.append(file.name)
    except ValueError:
        faults.append(f"{file.name} (not readable)")
    return None


def _scene(file: Path, runs: tuple[Response, ...], faults: list[str]) -> Scene | None:
    try:
        text = file.read_text(encoding="utf-8")
    except OSError:
        faults.append(file.name)
        text = runs[0].scene_toml if runs else ""
    try:
        return Scene.from_toml(text)
    except SceneError as error:
        faults.append(f"{file.name} ({error.faults[0]})" if text else file.name)
        return None


def _party(file: Path, agreement: dict[str, Any], faults: list[str]) -> Party | None:
    name = next((str(row["with"]) for row in agreement.get("rows", []) if row.get("with")), None)
    if name is None or not file.exists():
        return None
    try:
        with file.open(encoding="utf-8", newline="") as lines:
            table = list(csv.DictReader(lines))
        t, s_o, y = (np.array([float(row[key]) for row in table]) for key in ("t", "s_o", "y"))
    except (ValueError, KeyError, TypeError):
        faults.append(f"{file.name} (not readable)")
        return None
    return Party(name, t, s_o, y)
