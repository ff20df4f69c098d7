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
from validation.core.ladder import Branch, Ladder
from validation.core.methods import find, refined
from validation.core.running import run
from validation.core.sidebyside import Progress, in_parallel

SAID = store.shipped(__package__, "runs.toml")


def scenes() -> dict[str, Scene]:
    """The paper's scenes, the level one with Wu & Chen's mu = 2, and (12) taken literally (a rising chord)."""
    level = Scene.load("level")
    inclined = Scene.load("inclined")
    rising = inclined.variant(supports=inclined.supports.model_copy(update={"drop": -inclined.supports.drop}))
    return {
        "level": level, "heavy": level.variant(mu=2.0, name="level-mu-2"), "cruise": Scene.load("cruise"),
        "inclined": inclined, "rising": rising.variant(name="rising"),
    }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Reference:
    """A converged run: elements that follow the mass, with coarser ones, and the other solver's run."""

    ladder: Ladder
    cross: Response

    def bar(self, f: Callable[[Response], float]) -> float:
        """Bar of a number, at least the distance to the other solver."""
        return max(float(self.ladder.bar(f)), abs(f(self.ladder.run) - f(self.cross)))

    @property
    def path_bar(self) -> float:
        """Bar of the path in the window, over its largest deflection."""
        window = measures.window_of(*self.ladder.runs, self.cross)

        def apart(a: Response, b: Response) -> float:
            return measures.path_gap(a, b, window)[0]

        return max(float(self.ladder.bar(lambda r: r, apart)), apart(self.cross, self.ladder.run))


@dataclass(frozen=True, slots=True)
class Runs:
    """All runs by name, references by scene."""

    scenes: dict[str, Scene]
    by_name: dict[str, Response]
    reference: dict[str, Reference]


def plan(quick: bool = False) -> dict[str, tuple[str, str, dict[str, Any]]]:
    """Every run by its folder's name: scene, method, settings; quick : a quarter of the steps."""
    name, settings = SAID["fine"]
    method = find(name)
    fine = method.settings(settings)
    ladder = {"": fine}
    for word, share in (("half", 0.5), ("quarter", 0.25)):
        ladder[f"-{word}-resolution"] = refined(method, fine, space=share)
        ladder[f"-{word}-steps"] = refined(method, fine, time=share)
    jobs = {f"{scene}-reference{end}": (scene, name, x) for scene in SAID["references"] for end, x in ladder.items()}
    jobs |= {f"{scene}-cross": (scene, *SAID["cross"]) for scene in SAID["references"]}
    jobs |= {name: tuple(given) for name, given in SAID["runs"].items()}  # after the long ones
    return {name: _hastened(job) for name, job in jobs.items()} if quick else jobs


def _hastened(job: tuple[str, str, dict[str, Any]]) -> tuple[str, str, dict[str, Any]]:
    scene, name, settings = job
    method = find(name)
    return scene, name, refined(method, method.settings(settings), time=0.25)


def all_runs(out: Path, report: Progress, quick: bool = False) -> Runs:
    """All runs, stored in out/runs/NAME."""
    known = scenes()
    jobs = plan(quick)

    def made(name: str) -> Response:
        scene, method, settings = jobs[name]
        return stored(out / "runs" / name, known[scene], method, settings)

    names = list(jobs)
    done = itertools.count(1)
    in_parallel(lambda name: bool(made(name)), names, lambda i, there: report("runs", next(done) / len(names)))
    found = {name: made(name) for name in jobs}
    return Runs(known, found, {scene: _reference(found, scene) for scene in SAID["references"]})


def stored(folder: Path, scene: Scene, method: str, settings: dict[str, Any]) -> Response:
    """The stored run of this scene and settings, made if there is none."""
    wanted = (scene.to_toml(), method, json.loads(json.dumps(find(method).settings(settings))))
    try:
        old = Response.read(folder)
        if (old.scene_toml, old.method, old.settings) == wanted:
            return old
    except (OSError, ValueError, KeyError, TypeError):
        pass  # none, or of another version
    new = run(scene, method, **settings)
    new.write(folder)
    return new


def _reference(found: dict[str, Response], scene: str) -> Reference:
    def branch(what: str, order: float) -> Branch:
        runs = tuple(found[f"{scene}-reference-{word}-{what}"] for word in ("half", "quarter"))
        return Branch(runs, (2.0, 2.0), order)

    space = branch("resolution", find(SAID["fine"][0]).space_order)
    time = branch("steps", 2.0)
    return Reference(Ladder(found[f"{scene}-reference"], space, time), found[f"{scene}-cross"])
