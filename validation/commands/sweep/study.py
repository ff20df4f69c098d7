"""A sweep as data: a base scene, axes that vary, a job for every point."""

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
from cablefem.scene.drive import drive_keys_of_mode
from cablefem.scene.errors import did_you_mean, short_text
from cablefem.scene.fields import OneLine, Part, integer_between, number_between
from cablefem.scene.keys import keys_containing_name_text
from cablefem.scene.line import Line
from cablefem.scene.scene import PACES
from validation.commands.run import CHOICES, QUASI_STATIC
from validation.commands.sweep import families
from validation.commands.sweep.axes import MAX_POINTS, Axis, Range, parse_grid_axes, parse_sample_axes
from validation.core.agreement import TOL_HIGH, TOL_LOW, range_faults
from validation.core.methods import METHODS, find_method, methods_of_other_packages
from validation.core.store import Refused

GROUPS = ("sag_ratio", "mu", "alpha", "speed_ratio")  # of `Scene.variant`
FREE = ("slope", "travel", "span", "rho", "gravity")  # besides them, of `Scene.from_groups`: without a base scene
Point = dict[str, Any]  # values of the axes by name
RUN_OPTIONS = ("method", "model", "load", "law", "tol")  # of the run, not of the scene
WORDS = {  # what an axis of words takes
    **{name: [x for x in choices if x != QUASI_STATIC] for name, choices in CHOICES.items()},
    "travel": list(PACES),
}
TRAVEL = ("speed", "top_speed", "initial_speed", "acceleration", "deceleration", "times", "positions")
# keys of the scene that an axis without a dot sets
SET_BY = {
    "sag_ratio": ("cable.sag", "cable.length", "cable.horizontal_tension"), "mu": ("mass.mass",),
    "alpha": ("cable.EA", "cable.section"), "speed_ratio": tuple(f"travel.{name}" for name in TRAVEL),
    "slope": ("supports.drop",), "travel": ("travel.kind",), "span": ("supports.span",),
    "rho": ("cable.mass_per_length",),
}  # fmt: skip


def _require_known_method(method: str) -> str:
    """The name of a method that there is."""
    if method in METHODS:
        return method
    names = [*METHODS, *methods_of_other_packages()]
    if method not in names:
        raise ValueError(f"unknown.{did_you_mean(method, names)}")
    return method


class Sample(Part):
    """Points of a design of experiments."""

    kind: Literal["sobol", "latin_hypercube", "random"] = "sobol"
    count: Annotated[int, integer_between(1, MAX_POINTS)]
    seed: Annotated[int, integer_between(0, 2**32 - 1)] = 0
    range: Annotated[dict[str, Axis], PlainValidator(parse_sample_axes)]


class Truth(Part):
    """Which runs are compared with finer ones."""

    every: Annotated[int, integer_between(1, 1000)]  # every n-th scene
    finer: Annotated[int, integer_between(1, 1000)]  # so many times, in space and in time


class Study(Part):
    """A sweep as data, named as in its file."""

    title: OneLine = ""
    scene: Scene | None = None  # None: every scene is made from its groups
    job: Literal["run", "check", "advise", "power"] = "run"
    method: Annotated[str, AfterValidator(_require_known_method)] | None = None  # None: the cheapest that will do
    # of the method; of job power `families.scene_and_fault_key`
    settings: dict[str, Any] = Field(default_factory=dict)
    tol: Annotated[float, number_between(TOL_LOW, TOL_HIGH)] | None = None
    seconds: Annotated[float, number_between(0.1, 86_400.0)] = 120.0  # a scene may take
    vary: Annotated[dict[str, Axis], PlainValidator(parse_grid_axes)] | None = None  # the full grid of all axes
    sample: Sample | None = None
    truth: Truth | None = None
    _name: str = PrivateAttr("study")

    @classmethod
    def load(cls, name_or_path: str | Path) -> Study:
        """A built-in study, or that in a TOML file; Refused with one line per fault."""
        path = built_in_studies().get(str(name_or_path), Path(name_or_path))
        try:
            return cls.from_table(tomllib.loads(path.read_text(encoding="utf-8-sig")), path.stem, path.parent)
        except tomllib.TOMLDecodeError as error:
            raise Refused(f"{name_or_path}: not valid TOML: {error}") from None
        except (OSError, UnicodeDecodeError):
            hint = did_you_mean(str(name_or_path), built_in_studies())
            fault = f"study = {short_text(str(name_or_path))}: no built-in study, no readable file.{hint}"
            raise Refused(fault) from None

    @classmethod
    def from_table(cls, data: dict[str, Any], name: str = "study", folder: Path = Path()) -> Study:
        """The study in a TOML table; its scene is a name, a table, or a file that is looked for beside it."""
        try:
            scene = data.get("scene")
            if isinstance(scene, str):
                file = folder / scene
                data = data | {"scene": Scene.load(file if file.is_file() else scene)}
            study = cls(**data)
            study._name = name
            faults = study._cross_field_faults()
            if faults:
                raise SceneError(faults)
            return study
        except SceneError as error:
            raise Refused([f"{name}: {fault}" for fault in error.faults]) from None

    def _cross_field_faults(self) -> list[str]:
        """Faults between fields each of which is sound."""
        if (self.vary is None) == (self.sample is None):
            return ["exactly one of [vary] (a full grid) and [sample] (a design of experiments) must be given"]
        faults = [] if len(self) <= MAX_POINTS else [f"vary: {len(self)} scenes; must be at most {MAX_POINTS}"]
        for name, axis in self.axes.items():
            faults += self._axis_name_faults(name, axis) or _faults_of_axis_values(name, axis)
        faults += self._method_and_setting_faults()
        faults += self._faults_of_entries_without_meaning()
        faults += self._missing_entry_faults()
        return faults + self._faults_of_keys_set_twice()

    def _missing_entry_faults(self) -> list[str]:
        """Faults of what the job needs, of groups that make a scene, and of a base scene without a mass."""
        named = {*self.axes, *self.run_options({})}
        needed = ["tol", "case"] if self.job == "power" else ["tol"]
        job = f"job {short_text(self.job)}"
        if self.job == "run":
            job += " without a method"
            if "method" in named:
                needed = []
        faults = [f"{x}: missing; {job} needs it" for x in needed if x not in named]
        if self.job == "power":
            return faults
        if self.scene is None:
            why = f"without a base scene, {', '.join(GROUPS)} must be axes"
            return faults + [f"{x}: missing; {why}" for x in GROUPS if x not in named]
        if self.scene.mass is None and not any(name.startswith("mass.") for name in named):
            faults.append(
                f"scene {self.scene.name} has no [mass] and [travel]: a bare cable is for modes and scenes only"
            )
        return faults

    def _faults_of_entries_without_meaning(self) -> list[str]:
        """Faults of entries and axes that the job, or a study with a tolerance, would leave out."""
        given = [name for name in ("method", "settings", "truth", "scene") if getattr(self, name)]
        of_run = ("method", "settings", "truth", *CHOICES)
        without_meaning = {
            "run": (), "check": of_run, "advise": of_run, "power": ("scene", "method", "truth", *CHOICES),
        }[self.job]  # fmt: skip
        named = dict.fromkeys([*given, *self.axes])
        faults = [f"{x}: job {short_text(self.job)} does not take it" for x in named if x in without_meaning]
        if self.job == "power":
            others = [name for name in self.axes if name not in ("case", "tol", *without_meaning)]
            faults += [f"{name}: job 'power' draws its scenes by case" for name in others]
        return faults + self._faults_of_settings_that_tol_chooses()

    def _faults_of_settings_that_tol_chooses(self) -> list[str]:
        """Faults of resolution and steps beside a tolerance."""
        if self.job != "run" or (self.tol is None and "tol" not in self.axes):
            return []
        chosen = {"steps", *(method.resolution.setting for method in METHODS.values())}
        return [f"settings.{x}: tol chooses it; leave one of them out" for x in self.settings if x in chosen]

    def _faults_of_keys_set_twice(self) -> list[str]:
        """Faults of keys of the scene that another axis sets, too; without a base scene all of those do."""
        faults = []
        for group, keys in SET_BY.items():
            if self.scene is None or group in self.axes:
                faults += [f"{key}: {group} sets it, too; leave one of them out" for key in keys if key in self.axes]
        return faults

    def _method_and_setting_faults(self) -> list[str]:
        """Faults of methods on an axis, of settings that no method of the study has, and of their values."""
        axis = self.axes.get("method")
        names = list(axis.values) if axis else [self.method] if self.method else list(METHODS)
        faults = []
        for name in names:
            try:
                _require_known_method(name)
            except ValueError as error:
                faults.append(f"method = {short_text(name)}: {error}")
        if faults:
            return faults
        if self.job == "power":
            return self._faults_of_power_settings()
        methods = [find_method(name) for name in names]
        known = {name: setting for method in methods for name, setting in method.all_settings.items()}
        for name, value in self.settings.items():
            if name not in known:
                faults.append(f"settings.{name}: unknown key.{did_you_mean(name, known)}")
                continue
            try:
                known[name].validated(name, value)
            except ValueError as error:
                faults.append(f"settings.{error}")
        return faults

    def _faults_of_power_settings(self) -> list[str]:
        names = ("seed", "families")
        faults = [f"settings.{x}: unknown key.{did_you_mean(x, names)}" for x in self.settings if x not in names]
        known = [*families.SETS, "lines"]
        drawn = self.settings.get("families", "ropeway")
        if drawn not in known:
            faults.append(f"settings.families = {short_text(drawn)}: unknown.{did_you_mean(str(drawn), known)}")
        seed = self.settings.get("seed", 0)
        if not _is_whole_number(seed):
            faults.append(f"settings.seed = {short_text(seed)}: must be a whole number >= 0")
        return faults

    def _axis_name_faults(self, name: str, axis: Axis) -> list[str]:
        """Faults of an axis' name: no group, no field of the scene, nothing of the run."""
        names = [*GROUPS, *RUN_OPTIONS]
        if not self.scene:
            names += FREE
        if self.job == "power":
            names.append("case")
        part, dot, _ = name.partition(".")
        if name not in names and not (dot and part in Scene.written_field_names()):
            keys = keys_containing_name_text(name, Scene)
            hint = f" {keys[0].upper()}{keys[1:]}." if keys else did_you_mean(name, names)
            return [
                f"{name}: must be a key of the scene with its dot (cable.sag), or another axis (sweep --keys).{hint}"
            ]
        try:
            if dot and self.scene is not None:
                self.scene.replace({name: axis.value_at_share(0.0)})
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
        data = self.model_dump(exclude={"scene"}, exclude_defaults=True, serialize_as_any=True)
        if self.scene is not None:
            data["scene"] = tomllib.loads(self.scene.to_toml())
        return tomli_w.dumps(data)

    def __len__(self) -> int:
        return self.sample.count if self.sample else math.prod(len(axis.values) for axis in self.axes.values())

    def point(self, index: int) -> Point:
        """Values of the axes at a point, 0 <= index < len(self)."""
        if not 0 <= index < len(self):
            raise Refused(f"scene {index}: {self.name} has the scenes 0 to {len(self) - 1}")
        sample = self.sample
        if sample is not None:
            shares = _unit_cube_samples(sample.kind, sample.count, sample.seed, len(self.axes))[index]
            axes = zip(self.axes.items(), shares, strict=True)
            return {name: axis.value_at_share(share) for (name, axis), share in axes}
        at = np.unravel_index(index, [len(axis.values) for axis in self.axes.values()])
        return {name: axis.values[i] for (name, axis), i in zip(self.axes.items(), at, strict=True)}

    def scene_at(self, point: Point) -> Scene | Line:
        """The scene of a point; SceneError where it has faults."""
        if self.job == "power":
            return self.scene_and_fault_key(point)[0]
        dotted = {k: v for k, v in point.items() if "." in k}
        groups = {k: v for k, v in point.items() if "." not in k and k not in RUN_OPTIONS}
        scene = Scene.from_groups(**groups) if self.scene is None else self.scene
        if "drive.mode" in dotted:
            scene, dotted = _in_changed_drive_mode(scene, dotted)
        scene = scene.replace(dotted) if dotted else scene
        return scene.variant(**groups) if groups and self.scene is not None else scene

    def scene_and_fault_key(self, point: Point) -> tuple[Scene | Line, str | None]:
        """The scene of a point of job power, and the key of its planted fault; None: it has none."""
        seed = self.settings.get("seed", 0)
        return families.scene_and_fault_key(seed, round(point["case"]), self.settings.get("families", "ropeway"))

    def run_options(self, point: Point) -> dict[str, Any]:
        """The entries of RUN_OPTIONS that the study names."""
        named = {"method": self.method, "tol": self.tol} | {k: v for k, v in point.items() if k in RUN_OPTIONS}
        return {k: v for k, v in named.items() if v is not None}


def _is_whole_number(x: Any) -> bool:
    rounding = 1e-9  # of equal steps
    is_number = isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)
    return is_number and x >= 0 and abs(x - round(x)) <= rounding


def _faults_of_axis_values(name: str, axis: Axis) -> list[str]:
    """Faults of values of an axis of words, of tolerances, or of cases."""
    values = list(axis.values) if axis.values or not isinstance(axis, Range) else [axis.low, axis.high]
    if name in WORDS:
        return [
            f"{name} = {short_text(x)}: unknown.{did_you_mean(str(x), WORDS[name])}"
            for x in values
            if x not in WORDS[name]
        ]
    if name == "tol":
        return [fault for x in values for fault in range_faults(name, x, TOL_LOW, TOL_HIGH)]
    if name == "case":
        return [f"case = {short_text(x)}: must be a whole number >= 0" for x in values if not _is_whole_number(x)]
    return []


def _in_changed_drive_mode(scene: Scene, changes: dict[str, Any]) -> tuple[Scene, dict[str, Any]]:
    """A scene and its changes in another drive.mode, without keys that mean nothing there."""
    mode = changes["drive.mode"]
    keys = drive_keys_of_mode(mode)
    drive = {k: x for k, x in scene.drive.model_dump(exclude_defaults=True).items() if k in keys} | {"mode": mode}
    others = {k: x for k, x in changes.items() if not k.startswith("drive.") or k.split(".")[1] in keys}
    no_travel: dict[str, Any] = {"travel": None} if mode == "free" else {}
    return scene.variant(drive=drive, **no_travel), others


def built_in_studies() -> dict[str, Path]:
    """Name -> file of the studies that come with the package."""
    folder = Path(str(resources.files(__package__))) / "library"
    return {file.stem: file for file in sorted(folder.glob("*.toml"))}


@cache
def _unit_cube_samples(design: str, count: int, seed: int, axis_count: int) -> np.ndarray:
    """All points of a design of experiments in the unit cube, (count, axis_count)."""
    from scipy.stats import qmc

    if design == "random":
        return np.random.default_rng(seed).random((count, axis_count))
    if design == "latin_hypercube":
        return qmc.LatinHypercube(axis_count, rng=seed).random(count)
    return qmc.Sobol(axis_count, rng=seed).random_base2(math.ceil(math.log2(count)))[:count]
