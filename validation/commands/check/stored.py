"""What a check left in its folder, as far as it is there; what is not is named."""

import csv
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.response import Array, Response
from cablefem.scene import Scene, SceneError
from validation.core import measures
from validation.core.measures import NotComparable, Window

EVENTS = ("release", "thrust_end", "brake", "turn", "stop", "arrival", "back", "lift_off")


@dataclass(frozen=True, slots=True)
class Solver:
    """One solver's part of a check."""

    run: Response  # the finest run
    compared: Response  # what the verdict is about: the run, or its extrapolation
    in_space: Response | None  # companion with half the resolution; the error bar comes from both
    in_time: Response | None  # with half the steps
    weights: tuple[float, float] | None  # of the gaps to them in the error bar
    basis: str

    @property
    def name(self) -> str:
        return self.run.method


@dataclass(frozen=True, slots=True)
class Party:
    """A third party's mass path."""

    name: str
    t: Array  # (n,) [s]
    place: Array  # (n,) s_o/l
    y: Array  # (n,) [m] down from the left support


@dataclass(frozen=True, slots=True)
class Stored:
    """A check as stored: one or two answers, the verdict if there is one."""

    scene: Scene
    solvers: tuple[Solver, ...]
    verdict: str
    rows: tuple[dict[str, Any], ...]  # of agreement.json
    tol: float | None
    window: Window  # s_o/l
    party: Party | None
    design: tuple[dict[str, Any], ...]  # of agreement.json
    doubts: tuple[dict[str, Any], ...]
    grip: Response | None = None  # of a hauled car: what a car that grips the cable would have said

    @property
    def onset(self) -> float | None:
        """s_o/l at which the first of the solvers found the cable slack."""
        return min((s.run.slack_onset for s in self.solvers if s.run.slack_onset is not None), default=None)

    @property
    def names(self) -> str:
        return " and ".join(s.name for s in self.solvers)

    @property
    def parties(self) -> list[str]:
        """Third parties that are judged."""
        return list(dict.fromkeys(str(row["with"]) for row in self.rows if row.get("with")))

    @property
    def scale(self) -> Response:
        """The answer whose path gaps are relative to."""
        return self.solvers[-1].compared

    @property
    def free(self) -> bool:
        """Whether the travel is an answer: then everything is compared over time."""
        return self.solvers[0].run.drive == "free"

    @property
    def events(self) -> list[dict[str, Any]]:
        """What happened on a ride, by the first solver; a car that rattles before it stops is no event."""
        return [event for event in self.solvers[0].run.events if event["event"] in EVENTS]

    def times(self, r: Response) -> tuple[float, float]:
        """Return the instants [s] between which a run is compared: a free ride as a whole."""
        if self.free:
            return 0.0, float(r.t[-1])
        return self.time(r, self.window[0]), self.time(r, self.window[1])

    def time(self, r: Response, at: float) -> float:
        """Return the instant [s] at which a run first comes to s_o/l = at, or its last one."""
        there = r.s_o >= at * r.length
        i = int(np.argmax(there))
        if not there[i]:
            return float(r.t[-1])
        return float(np.interp(at * r.length, r.s_o[max(i - 1, 0) : i + 1], r.t[max(i - 1, 0) : i + 1]))

    @property
    def weight(self) -> float:
        """M g [N]."""
        return 0.0 if self.scene.mass is None else self.scene.mass.mass * self.scene.gravity

    def row(self, quantity: str) -> dict[str, Any]:
        """Return our solvers' row of that quantity; empty if there is none."""
        return next((r for r in self.rows if r.get("quantity") == quantity and not r.get("with")), {})


def read(folder: Path, faults: list[str]) -> Stored | None:
    """Return what a folder holds, or None without any answer; append to `faults` what is missing or unreadable."""
    agreement = _json(folder / "agreement.json", faults) or {}
    names = agreement.get("methods") or sorted(path.parent.name for path in folder.glob("*/response.npz"))
    solvers = tuple(s for name in names[:2] if (s := _solver(folder / name, faults)) is not None)
    scene = _scene(folder / "scene.toml", solvers, faults)
    if not solvers or scene is None or scene.mass is None:
        return None
    rows = tuple(row for row in agreement.get("rows", []) if isinstance(row, dict))
    return Stored(
        scene, solvers, agreement.get("verdict", "not comparable"), rows, agreement.get("tol"),
        _window(agreement, solvers), _party(folder / "with.csv", rows, scene.length, faults),
        tuple(agreement.get("design", ())), tuple(agreement.get("doubts", ())),
        _response(folder / "grip", faults) if solvers[0].run.drive == "haul" else None,
    )  # fmt: skip


def _json(file: Path, faults: list[str]) -> dict[str, Any] | None:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        if isinstance(content, dict):
            return content
        faults.append(f"{_named(file)} (holds no table)")
    except OSError:
        faults.append(_named(file))
    except ValueError:
        faults.append(f"{_named(file)} (not readable)")
    return None


def _named(file: Path) -> str:
    """Return the end of a path that tells it from its like: METHOD/half-steps/response.npz."""
    if file.name not in ("response.npz", "estimate.json"):
        return file.name
    return "/".join(file.parts[-3:] if file.parent.name in _PARTS else file.parts[-2:])


_PARTS = ("half-resolution", "half-steps", "extrapolated")


def _solver(folder: Path, faults: list[str]) -> Solver | None:
    run = _response(folder, faults, 2)
    if run is None:
        return None
    estimate = _json(folder / "estimate.json", faults) or {}
    better = _response(folder / "extrapolated", faults, 2) if (folder / "extrapolated").exists() else None
    weights = estimate.get("weights")
    return Solver(
        run, better or run, _response(folder / "half-resolution", faults), _response(folder / "half-steps", faults),
        (float(weights[0]), float(weights[1])) if weights else None, estimate.get("basis", ""),
    )  # fmt: skip


def _response(folder: Path, faults: list[str], steps: int = 4) -> Response | None:
    """Return the answer in a folder; None unless it has so many steps."""
    file = folder / "response.npz"
    try:
        found = Response.read(folder)
        if found.t.size >= steps:
            return found
        faults.append(f"{_named(file)} (broke after {found.t.size} steps: {found.reason})")
    except OSError:
        faults.append(_named(file))
    except (ValueError, KeyError, TypeError, zipfile.BadZipFile):
        faults.append(f"{_named(file)} (not readable)")
    return None


def _scene(file: Path, solvers: tuple[Solver, ...], faults: list[str]) -> Scene | None:
    try:
        text = file.read_text(encoding="utf-8")
    except OSError:
        faults.append(file.name)
        text = solvers[0].run.scene_toml if solvers else ""
    try:
        return Scene.from_toml(text)
    except SceneError as error:
        faults.append(f"{file.name} ({error.faults[0]})" if text else file.name)
        return None


def _window(agreement: dict[str, Any], solvers: tuple[Solver, ...]) -> Window:
    if "range" in agreement:
        low, high = agreement["range"]
        return float(low), float(high)
    try:
        return measures.window_of(*(s.run for s in solvers))
    except NotComparable:
        return measures.WINDOW[0], measures.WINDOW[0]


def _party(file: Path, rows: tuple[dict[str, Any], ...], length: float, faults: list[str]) -> Party | None:
    name = next((str(row["with"]) for row in rows if row.get("with")), None)
    if name is None or not file.exists():
        return None
    try:
        with file.open(encoding="utf-8", newline="") as lines:
            table = list(csv.DictReader(lines))
        t, place, y = (np.array([float(row[key]) for row in table]) for key in ("t", "s_o", "y"))
    except (ValueError, KeyError, TypeError):
        faults.append(f"{file.name} (not readable)")
        return None
    return Party(name, t, place / length, y)
