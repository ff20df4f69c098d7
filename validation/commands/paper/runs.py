"""The runs behind the figures (runs.toml): at the paper's resolution, and converged ones with bars."""

import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cablefem.response import Response
from cablefem.scene import Scene
from validation.core import measures, store
from validation.core.ladder import Branch, Ladder, identity
from validation.core.methods import find_method, scaled_settings
from validation.core.running import run
from validation.core.sidebyside import Progress, map_in_parallel

SETTINGS = store.read_packaged_toml(__package__, "runs.toml")


def paper_scenes() -> dict[str, Scene]:
    """The paper's scenes, the level one with Wu & Chen's mu = 2, and (12) taken literally (a rising chord)."""
    level = Scene.load("level")
    inclined = Scene.load("inclined")
    supports = inclined.supports
    rising = inclined.variant(supports=supports.model_copy(update={"drop": -supports.drop}), name="rising")
    heavy = level.variant(mu=2.0, name="level-mu-2")
    return {"level": level, "heavy": heavy, "cruise": Scene.load("cruise"), "inclined": inclined, "rising": rising}


@dataclass(frozen=True, slots=True)
class Reference:
    """A converged run: elements that follow the mass, with coarser ones, and the other solver's run."""

    ladder: Ladder
    cross: Response

    def cross_checked_error_bar(self, value_of_run: Callable[[Response], float]) -> float:
        """Bar of a number, at least the distance to the other solver."""
        distance = abs(value_of_run(self.ladder.finest) - value_of_run(self.cross))
        return max(float(self.ladder.error_bar(value_of_run)), distance)

    @property
    def cross_checked_relative_path_error_bar(self) -> float:
        """Bar of the path in the window, over its largest deflection."""
        window = measures.common_window(*self.ladder.runs, self.cross)

        def gap(a: Response, b: Response) -> float:
            return measures.relative_path_gap(a, b, window).largest

        return max(float(self.ladder.error_bar(identity, gap)), gap(self.cross, self.ladder.finest))


@dataclass(frozen=True, slots=True)
class Runs:
    """All runs by name, references by scene."""

    scenes: dict[str, Scene]
    by_name: dict[str, Response]
    reference: dict[str, Reference]


Job = tuple[str, str, dict[str, Any]]  # scene, method, settings


def planned_runs(quick: bool = False) -> dict[str, Job]:
    """Every run by its folder's name; quick : a quarter of the steps, an eighth of those in position."""
    name, settings = SETTINGS["fine"]
    method = find_method(name)
    fine = method.complete_settings(settings)
    ladder = {"": fine}
    for word, share in (("half", 0.5), ("quarter", 0.25)):
        ladder[f"-{word}-resolution"] = scaled_settings(method, fine, space=share)
        ladder[f"-{word}-steps"] = scaled_settings(method, fine, time=share)
    jobs: dict[str, Job] = {}
    scenes = SETTINGS["references"]
    for scene in scenes:
        jobs |= {f"{scene}-reference{end}": (scene, name, x) for end, x in ladder.items()}
    jobs |= {f"{scene}-cross": (scene, *SETTINGS["cross"]) for scene in scenes}
    jobs |= {run_name: tuple(job) for run_name, job in SETTINGS["runs"].items()}  # after the long ones
    return {run_name: _with_fewer_steps(job) for run_name, job in jobs.items()} if quick else jobs


def _with_fewer_steps(job: Job) -> Job:
    """The job by a quarter of the steps, or an eighth of those in position, which are not compiled."""
    scene, name, settings = job
    method = find_method(name)
    share = 1.0 / 8.0 if settings.get("abscissa") == "s" else 0.25
    return scene, name, scaled_settings(method, method.complete_settings(settings), time=share)


def load_or_make_and_store_runs(out: Path, report: Progress, quick: bool = False) -> Runs:
    """All runs, made in parallel, or read from out/runs/NAME where they are stored."""
    by_name = paper_scenes()
    jobs = planned_runs(quick)

    def run_of(name: str) -> Response:
        scene, method, settings = jobs[name]
        return load_or_run_and_store(out / "runs" / name, by_name[scene], method, settings)

    done = itertools.count(1)
    map_in_parallel(
        lambda name: bool(run_of(name)), list(jobs), lambda i, there: report("runs", next(done) / len(jobs))
    )
    runs = {name: run_of(name) for name in jobs}
    return Runs(by_name, runs, {scene: _reference_of(runs, scene) for scene in SETTINGS["references"]})


def load_or_run_and_store(folder: Path, scene: Scene, method: str, settings: dict[str, Any]) -> Response:
    """The stored run of this scene and settings, made if there is none."""
    as_stored = json.loads(json.dumps(find_method(method).complete_settings(settings)))
    try:
        old = Response.read(folder)
        if (old.scene_toml, old.method, old.settings) == (scene.to_toml(), method, as_stored):
            return old
    except (OSError, ValueError, KeyError, TypeError):
        pass  # none, or of another version
    new = run(scene, method, **settings)
    new.write_npz_and_summary(folder)
    return new


def _reference_of(runs: dict[str, Response], scene: str) -> Reference:
    """The converged run of a scene with its coarser ones and the other solver's, from runs by name."""

    def coarser_branch(what: str, order: float) -> Branch:
        coarser = tuple(runs[f"{scene}-reference-{word}-{what}"] for word in ("half", "quarter"))
        return Branch(coarser, (2.0, 2.0), order)

    space = coarser_branch("resolution", find_method(SETTINGS["fine"][0]).space_order)
    time = coarser_branch("steps", 2.0)
    return Reference(Ladder(runs[f"{scene}-reference"], space, time), runs[f"{scene}-cross"])
