"""What a sweep asks for: a base scene, axes that vary, a job for every point; points are numbered once and for all."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.scene import Scene, SceneError
from cablefem.scene.cable import SHAPES
from cablefem.scene.drive import of_mode
from cablefem.scene.errors import nearest, shown
from validation.core.store import Refused

JOBS = ("run", "check", "advise")
DESIGNS = ("sobol", "latin_hypercube", "random")
GROUPS = ("sag_ratio", "mu", "alpha", "speed_ratio")  # of `Scene.variant`
FREE = ("slope", "travel", "span", "rho", "gravity")  # besides them, of `Scene.from_groups`: without a base scene
HOW = ("method", "model", "load", "law", "tol")  # of the run, not of the scene
KEYS = (
    "title", "scene", "job", "method", "settings", "tol", "seconds", "truth", "vary", "sample", "keep", "limit",
)  # fmt: skip
MOST = 10_000_000  # points
SECONDS = 120.0  # a scene may take, unless the study says otherwise


@dataclass(frozen=True, slots=True)
class Axis:
    """One thing that varies: given values, or a range [low, high], by its logarithm if `log`."""

    name: str
    values: tuple[Any, ...] = ()
    low: float = 0.0
    high: float = 0.0
    log: bool = False

    def at(self, share: float) -> Any:
        """Return the value at a share in [0, 1) of the axis."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))

    @property
    def numeric(self) -> bool:
        return all(isinstance(x, int | float) and not isinstance(x, bool) for x in self.values)


@dataclass(frozen=True)
class Study:
    """A sweep as data; `text` is the file itself, which a folder of results keeps."""

    name: str
    text: str
    axes: tuple[Axis, ...]
    title: str = ""
    scene: str | None = None  # TOML of the base scene; None: every scene is made from its groups
    job: str = "run"
    method: str | None = None  # None: the cheapest that will do
    settings: dict[str, Any] = field(default_factory=dict)
    tol: float | None = None
    seconds: float = SECONDS
    truth: tuple[int, int] | None = None  # every so-manieth scene, against a run so many times finer
    design: tuple[str, int, int] | None = None  # kind, count, seed; None: the full grid
    fields: bool = False
    limit: dict[str, float] = field(default_factory=dict)

    @classmethod
    def load(cls, name_or_path: str | Path) -> Study:
        """Return the built-in study of that name or the one in that TOML file; Refused with one line per fault."""
        known, path = built_in(), Path(name_or_path)
        if str(name_or_path) in known:
            name, text, folder = str(name_or_path), known[str(name_or_path)].read_text(encoding="utf-8"), Path()
        else:
            try:
                name, text, folder = path.stem, path.read_text(encoding="utf-8-sig"), path.parent
            except (OSError, ValueError):
                hint = nearest(str(name_or_path), known)
                raise Refused(
                    f"study = {shown(str(name_or_path))}: no built-in study, no readable file.{hint}"
                ) from None
        try:
            return cls.of(tomllib.loads(text), text, name, folder)
        except tomllib.TOMLDecodeError as error:
            raise Refused(f"{name_or_path}: not valid TOML: {error}") from None

    @classmethod
    def of(cls, data: dict[str, Any], text: str = "", name: str = "study", folder: Path = Path()) -> Study:
        """Return the study in a TOML table; scene files are looked for beside it."""
        faults = [f"{key} = {shown(data[key])}: unknown key.{nearest(key, KEYS)}" for key in data if key not in KEYS]
        base = _base(data.get("scene"), folder, faults)
        axes, design = _axes(data, faults)
        for axis in axes:
            _name_fault(axis.name, base, faults)
            if base is not None and "." in axis.name:
                faults += [fault for fault in _faults_of(base, axis) if "unknown key" in fault]
        job = data.get("job", "run")
        if job not in JOBS:
            faults.append(f"job = {shown(job)}: unknown.{nearest(str(job), JOBS)}")
        tol = data.get("tol")
        if tol is not None and not (_number(tol) and 1e-6 <= tol <= 0.2):
            faults.append(f"tol = {shown(tol)}: must be a number from 1e-06 to 0.2")
        method = data.get("method")
        named = [axis.name for axis in axes]
        if tol is None and "tol" not in named and (job != "run" or (method is None and "method" not in named)):
            faults.append(f"tol: missing; job {shown(job)} without a method of its own needs one")
        if method is not None:
            from validation.core.methods import METHODS

            if method not in METHODS:
                faults.append(f"method = {shown(method)}: unknown.{nearest(str(method), METHODS)}")
        seconds = data.get("seconds", SECONDS)
        if not (_number(seconds) and 0.1 <= seconds <= 86_400.0):
            faults.append(f"seconds = {shown(seconds)}: must be a number from 0.1 to 86400, the time a scene may take")
        truth = data.get("truth")
        if truth is not None and not (
            isinstance(truth, dict) and set(truth) == {"every", "finer"}
            and all(isinstance(n, int) and 1 <= n <= 1000 for n in truth.values())
        ):  # fmt: skip
            faults.append(f"truth = {shown(truth)}: must be a table like {{every = 10, finer = 4}} of whole numbers")
        keep, limit = data.get("keep", {}), data.get("limit", {})
        if not (isinstance(keep, dict) and set(keep) <= {"fields"} and isinstance(keep.get("fields", False), bool)):
            faults.append(f"keep = {shown(keep)}: must be a table with fields = true or false")
        if not (isinstance(limit, dict) and all(_number(x) for x in limit.values())):
            faults.append(f"limit = {shown(limit)}: must be a table of design numbers, e.g. tension_max = 4e5")
        if faults:
            raise Refused([f"{name}: {fault}" for fault in faults])
        return cls(
            name, text, tuple(axes), str(data.get("title", "")), None if base is None else base.to_toml(), job, method,
            dict(data.get("settings", {})), tol, float(seconds), truth and (truth["every"], truth["finer"]), design,
            bool(keep.get("fields", False)), dict(limit),
        )  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        """Travel to a worker without the points of all scenes."""
        return {k: v for k, v in vars(self).items() if k != "_shares"}

    # --- points ---------------------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return self.design[1] if self.design else math.prod(len(axis.values) for axis in self.axes)

    @cached_property
    def _shares(self) -> np.ndarray:
        from scipy.stats import qmc

        assert self.design is not None
        kind, count, seed = self.design
        if kind == "random":
            return np.random.default_rng(seed).random((count, len(self.axes)))
        if kind == "latin_hypercube":
            return qmc.LatinHypercube(len(self.axes), rng=seed).random(count)
        return qmc.Sobol(len(self.axes), rng=seed).random_base2(math.ceil(math.log2(max(count, 1))))[:count]

    def point(self, index: int) -> dict[str, Any]:
        """Return the values of the axes at a point, 0 <= index < len(self)."""
        if not 0 <= index < len(self):
            raise Refused(f"scene {index}: {self.name} has the scenes 0 to {len(self) - 1}")
        if self.design:
            return {axis.name: axis.at(share) for axis, share in zip(self.axes, self._shares[index], strict=True)}
        at = np.unravel_index(index, [len(axis.values) for axis in self.axes])
        return {axis.name: axis.values[i] for axis, i in zip(self.axes, at, strict=True)}

    def scene_at(self, point: dict[str, Any]) -> Scene:
        """Return the scene of a point; SceneError where it has faults."""
        what = {k: v for k, v in point.items() if k not in HOW}
        dotted = {k: v for k, v in what.items() if "." in k}
        groups = {k: v for k, v in what.items() if "." not in k}
        scene = Scene.from_groups(**groups) if self.scene is None else Scene.from_toml(self.scene)
        if dotted:
            data = tomllib.loads(scene.to_toml())
            for path, value in dotted.items():
                _put(data, path, value)
            if "drive.mode" in dotted:  # what has no meaning in that mode gives way
                data["drive"] = {k: x for k, x in data["drive"].items() if k in of_mode(data["drive"]["mode"])}
                if data["drive"]["mode"] == "free":
                    data.pop("travel", None)
            scene = Scene(**data)
        return scene.variant(**groups) if groups and self.scene is not None else scene

    def how(self, point: dict[str, Any]) -> dict[str, Any]:
        """Return method, model, load, law and tol of a point, as far as the study names them."""
        named = {key: x for key, x in (("method", self.method), ("tol", self.tol)) if x is not None}
        return named | {k: v for k, v in point.items() if k in HOW}


def built_in() -> dict[str, Any]:
    """Return name -> file of the studies that come with the package."""
    files = sorted((resources.files("validation.commands.sweep") / "library").iterdir(), key=lambda file: file.name)
    return {file.name.removesuffix(".toml"): file for file in files if file.name.endswith(".toml")}


def _number(x: object) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)


def _base(given: Any, folder: Path, faults: list[str]) -> Scene | None:
    if given is None:
        return None
    try:
        beside = folder / str(given)
        return Scene.load(beside if beside.is_file() else str(given))
    except SceneError as error:
        faults += [f"scene: {fault}" for fault in error.faults]
        return None


def _axes(data: dict[str, Any], faults: list[str]) -> tuple[list[Axis], tuple[str, int, int] | None]:
    vary, sample = data.get("vary"), data.get("sample")
    if (vary is None) == (sample is None):
        faults.append("exactly one of [vary] (a full grid) and [sample] (a design of experiments) must be given")
        return [], None
    if vary is not None:
        axes = [axis for name, given in _table(vary, "vary", faults).items() if (axis := _grid(name, given, faults))]
        scenes = math.prod(len(axis.values) for axis in axes)
        if scenes > MOST:
            faults.append(f"vary: {scenes} scenes; must be at most {MOST}")
        return axes, None
    sample = _table(sample, "sample", faults)
    kind: Any = sample.get("kind", "sobol")
    count: Any = sample.get("count")
    seed: Any = sample.get("seed", 0)
    if kind not in DESIGNS:
        faults.append(f"sample.kind = {shown(kind)}: unknown.{nearest(str(kind), DESIGNS)}")
    for name, value, least in (("count", count, 1), ("seed", seed, 0)):
        if not (isinstance(value, int) and not isinstance(value, bool) and least <= value <= MOST):
            faults.append(f"sample.{name} = {shown(value)}: must be a whole number from {least} to {MOST}")
    ranges = _table(sample.get("range", {}), "sample.range", faults)
    if not ranges:
        faults.append("sample.range: missing; must name at least one axis")
    scattered = [axis for name, given in ranges.items() if (axis := _range(name, given, faults))]
    return scattered, (kind, count, seed) if isinstance(count, int) else None


def _table(given: Any, name: str, faults: list[str]) -> dict[str, Any]:
    if isinstance(given, dict):
        return given
    faults.append(f"{name} = {shown(given)}: must be a table")
    return {}


def _grid(name: str, given: Any, faults: list[str]) -> Axis | None:
    if isinstance(given, dict):
        count, axis = given.get("count"), _range(name, {k: v for k, v in given.items() if k != "count"}, faults)
        if not (isinstance(count, int) and 2 <= count <= MOST):
            faults.append(f"vary.{name}.count = {shown(count)}: must be a whole number >= 2")
            return None
        return axis and Axis(name, tuple(axis.at(i / (count - 1)) for i in range(count)))
    if isinstance(given, list) and given:
        return Axis(name, tuple(given))
    faults.append(f"vary.{name} = {shown(given)}: must be a list, or a table with from, to and count")
    return None


def _range(name: str, given: Any, faults: list[str]) -> Axis | None:
    if isinstance(given, list) and len(given) == 2 and all(map(_number, given)):
        given = {"from": given[0], "to": given[1]}
    if isinstance(given, dict) and isinstance(given.get("choices"), list) and given["choices"]:
        return Axis(name, tuple(given["choices"]))
    if not (isinstance(given, dict) and _number(given.get("from")) and _number(given.get("to"))):
        faults.append(f"{name} = {shown(given)}: must be [low, high], or a table with from and to, or with choices")
        return None
    low, high, log = float(given["from"]), float(given["to"]), bool(given.get("log", False))
    if not low < high or (log and low <= 0.0):
        faults.append(f"{name}: from {low:g} to {high:g} must rise{', from above 0 with log' if log else ''}")
        return None
    return Axis(name, (), low, high, log)


def _name_fault(name: str, base: Scene | None, faults: list[str]) -> None:
    known = (*GROUPS, *HOW, *(FREE if base is None else ()))
    if name in known:
        return
    part, dot, _ = name.partition(".")
    if not dot or part not in Scene.field_names():
        faults.append(f"{name}: must be a field of the scene file (cable.sag) or one of them.{nearest(name, known)}")


def _faults_of(base: Scene, axis: Axis) -> list[str]:
    """Return what the base scene says to the axis' first value."""
    data = tomllib.loads(base.to_toml())
    try:
        _put(data, axis.name, axis.at(0.0))
        Scene(**data)
    except SceneError as error:
        return error.faults
    return []


def _put(data: dict[str, Any], path: str, value: Any) -> None:
    """Set a dotted field of a scene's data; another shape of the cable gives way."""
    *parts, last = path.split(".")
    if parts == ["cable"] and last in SHAPES:
        data["cable"] = {k: v for k, v in data["cable"].items() if k not in SHAPES}
    for part in parts:
        data = data.setdefault(part, {})
        if not isinstance(data, dict):
            raise SceneError([f"{path}: {part} is no table"])
    data[last] = value
