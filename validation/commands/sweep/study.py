"""What a sweep asks for: a base scene, axes that vary, a job for every point."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tomli_w
from pydantic import AfterValidator, Field, PlainValidator, PrivateAttr

from cablefem.scene import Scene, SceneError
from cablefem.scene.drive import of_mode
from cablefem.scene.errors import nearest, shown
from cablefem.scene.fields import OneLine, Part, between, integer
from cablefem.scene.line import Line
from validation.commands.sweep import families
from validation.commands.sweep.axes import MOST, Axis, grid, ranges
from validation.core.methods import METHODS, installed
from validation.core.store import Refused

GROUPS = ("sag_ratio", "mu", "alpha", "speed_ratio")  # of `Scene.variant`
FREE = ("slope", "travel", "span", "rho", "gravity")  # besides them, of `Scene.from_groups`: without a base scene
HOW = ("method", "model", "load", "law", "tol")  # of the run, not of the scene


def _known(method: str) -> str:
    names = [*METHODS, *installed()]
    if method not in names:
        raise ValueError(f"unknown.{nearest(method, names)}")
    return method


class Sample(Part):
    """Points of a design of experiments."""

    kind: Literal["sobol", "latin_hypercube", "random"] = "sobol"
    count: Annotated[int, integer(1, MOST)]
    seed: Annotated[int, integer(0, 2**32 - 1)] = 0
    range: Annotated[dict[str, Axis], PlainValidator(ranges)]


class Truth(Part):
    """Runs held against finer ones."""

    every: Annotated[int, integer(1, 1000)]  # every n-th scene
    finer: Annotated[int, integer(1, 1000)]  # so many times, in space and in time


class Study(Part):
    """A sweep as data, named as in its file."""

    title: OneLine = ""
    scene: Scene | None = None  # None: every scene is made from its groups
    job: Literal["run", "check", "advise", "power"] = "run"
    method: Annotated[str, AfterValidator(_known)] | None = None  # None: the cheapest that will do
    settings: dict[str, Any] = Field(default_factory=dict)  # of the method; of job power `families.case`
    tol: Annotated[float, between(1e-6, 0.2)] | None = None
    seconds: Annotated[float, between(0.1, 86_400.0)] = 120.0  # a scene may take
    vary: Annotated[dict[str, Axis], PlainValidator(grid)] | None = None  # the full grid of all axes
    sample: Sample | None = None
    truth: Truth | None = None
    _name: str = PrivateAttr("study")

    @classmethod
    def load(cls, name_or_path: str | Path) -> Study:
        """A built-in study, or that in a TOML file; Refused with one line per fault."""
        path = built_in().get(str(name_or_path), Path(name_or_path))
        try:
            return cls.of(tomllib.loads(path.read_text(encoding="utf-8-sig")), path.stem, path.parent)
        except tomllib.TOMLDecodeError as error:
            raise Refused(f"{name_or_path}: not valid TOML: {error}") from None
        except (OSError, UnicodeDecodeError):
            hint = nearest(str(name_or_path), built_in())
            told = f"study = {shown(str(name_or_path))}: no built-in study, no readable file.{hint}"
            raise Refused(told) from None

    @classmethod
    def of(cls, data: dict[str, Any], name: str = "study", folder: Path = Path()) -> Study:
        """The study in a TOML table; its scene is a name, a table, or a file that is looked for beside it."""
        try:
            scene = data.get("scene")
            if isinstance(scene, str):
                data = data | {"scene": Scene.load(folder / scene if (folder / scene).is_file() else scene)}
            study = cls(**data)
            study._name = name
            if faults := study._faults():
                raise SceneError(faults)
            return study
        except SceneError as error:
            raise Refused([f"{name}: {fault}" for fault in error.faults]) from None

    def _faults(self) -> list[str]:
        """Faults between fields that are sound by themselves."""
        if (self.vary is None) == (self.sample is None):
            return ["exactly one of [vary] (a full grid) and [sample] (a design of experiments) must be given"]
        faults = [] if len(self) <= MOST else [f"vary: {len(self)} scenes; must be at most {MOST}"]
        faults += [fault for name, axis in self.axes.items() for fault in self._faults_of(name, axis)]
        named = {*self.axes, *self.how({})}
        needed = {"run": () if "method" in named else ("tol",), "power": ("tol", "case")}.get(self.job, ("tol",))
        job = f"job {shown(self.job)}" + (" without a method" if self.job == "run" else "")
        faults += [f"{x}: missing; {job} needs it" for x in needed if x not in named]
        return faults

    def _faults_of(self, name: str, axis: Axis) -> list[str]:
        """Faults of an axis' name: no group, no field of the scene, nothing of the run."""
        known = {*GROUPS, *HOW, *(() if self.scene else FREE), *(("case",) if self.job == "power" else ())}
        part, dot, _ = name.partition(".")
        if name not in known and not (dot and part in Scene.field_names()):
            near = nearest(name, known)
            return [f"{name}: must be a field of the scene file (cable.sag) or one of them.{near}"]
        try:
            if dot and self.scene is not None:
                self.scene.replace({name: axis.at(0.0)})
        except SceneError as error:
            return [fault for fault in error.faults if "unknown key" in fault]
        return []

    @property
    def name(self) -> str:
        return self._name

    @property
    def axes(self) -> dict[str, Axis]:
        return self.vary or {} if self.sample is None else self.sample.range

    def to_toml(self) -> str:
        """A study file that reads back as this study.

        Points are numbered by the order of the axes: each is a table, as the writer puts lists before tables.
        """
        given = self.model_dump(exclude={"scene"}, exclude_defaults=True, serialize_as_any=True)
        if self.scene is not None:
            given["scene"] = tomllib.loads(self.scene.to_toml())
        return tomli_w.dumps(given)

    def __len__(self) -> int:
        return self.sample.count if self.sample else math.prod(len(axis.values) for axis in self.axes.values())

    def point(self, index: int) -> dict[str, Any]:
        """Values of the axes at a point, 0 <= index < len(self)."""
        if not 0 <= index < len(self):
            raise Refused(f"scene {index}: {self.name} has the scenes 0 to {len(self) - 1}")
        if self.sample is not None:
            shares = _shares(self.sample.kind, self.sample.count, self.sample.seed, len(self.axes))[index]
            return {name: axis.at(share) for (name, axis), share in zip(self.axes.items(), shares, strict=True)}
        at = np.unravel_index(index, [len(axis.values) for axis in self.axes.values()])
        return {name: axis.values[i] for (name, axis), i in zip(self.axes.items(), at, strict=True)}

    def scene_at(self, point: dict[str, Any]) -> Scene | Line:
        """The scene of a point; SceneError where it has faults."""
        if self.job == "power":
            return self.case(point)[0]
        what = {k: v for k, v in point.items() if k not in HOW}
        dotted = {k: v for k, v in what.items() if "." in k}
        groups = {k: v for k, v in what.items() if "." not in k}
        scene = Scene.from_groups(**groups) if self.scene is None else self.scene
        if "drive.mode" in dotted:
            scene, dotted = _driven(scene, dotted)
        scene = scene.replace(dotted) if dotted else scene
        return scene.variant(**groups) if groups and self.scene is not None else scene

    def case(self, point: dict[str, Any]) -> tuple[Scene | Line, str | None]:
        told = self.settings
        return families.case(told.get("seed", 0), round(point["case"]), told.get("families", "ropeway"))

    def how(self, point: dict[str, Any]) -> dict[str, Any]:
        """The entries of HOW that the study names."""
        named = {key: x for key, x in (("method", self.method), ("tol", self.tol)) if x is not None}
        return named | {k: v for k, v in point.items() if k in HOW}


def _driven(scene: Scene, changes: dict[str, Any]) -> tuple[Scene, dict[str, Any]]:
    """A scene and its changes in another drive.mode, without keys that mean nothing there."""
    mode = changes["drive.mode"]
    known = of_mode(mode)
    drive = {k: x for k, x in scene.drive.model_dump(exclude_defaults=True).items() if k in known} | {"mode": mode}
    left = {k: x for k, x in changes.items() if not k.startswith("drive.") or k.split(".")[1] in known}
    return scene.variant(drive=drive, **({"travel": None} if mode == "free" else {})), left


def built_in() -> dict[str, Path]:
    """Name -> file of the studies that come with the package."""
    folder = Path(str(resources.files(__package__))) / "library"
    return {file.stem: file for file in sorted(folder.glob("*.toml"))}


@cache
def _shares(kind: str, count: int, seed: int, axes: int) -> np.ndarray:
    """All points of a design in the unit cube, (count, axes)."""
    from scipy.stats import qmc

    if kind == "random":
        return np.random.default_rng(seed).random((count, axes))
    if kind == "latin_hypercube":
        return qmc.LatinHypercube(axes, rng=seed).random(count)
    return qmc.Sobol(axes, rng=seed).random_base2(math.ceil(math.log2(count)))[:count]
