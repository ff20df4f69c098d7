"""The runs behind the figures: the paper's own resolution, and a converged reference with its error bar."""

import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cablefem.response import Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.estimate import Estimated
from validation.core.methods import find, refined
from validation.core.richardson import SAFETY, left, space_order
from validation.core.running import run
from validation.core.sidebyside import spread

Progress = Callable[[str, float], None]

# Text 6 names Newmark's method "with artificial damping" for wavelets but not its constants; gamma 0.6 is ours.
# Figure 3 has N = 30 sines; figure 4 names no N: the wavelet basis of nearest size has 31.
DAMPED = {"scheme": "newmark"}
OVERDAMPED = {"scheme": "newmark", "newmark_gamma": 1.0}  # what strong damping and long steps do to the tension
RUNS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "level-fourier-30": ("level", "fourier", {"terms": 30, "steps": 2000}),
    "level-wavelet-31": ("level", "wavelet", {"level": 2, "steps": 2000, **DAMPED}),
    "heavy-fourier-30": ("heavy", "fourier", {"terms": 30, "steps": 2000}),
    "cruise-fourier-30": ("cruise", "fourier", {"terms": 30, "steps": 2000}),
    "cruise-wavelet-31": ("cruise", "wavelet", {"level": 2, "steps": 2000, **DAMPED}),
    "inclined-fourier-10": ("inclined", "fourier", {"terms": 10, "steps": 512}),
    "inclined-wavelet-10": ("inclined", "wavelet", {"level": 0, "steps": 512, **DAMPED}),
    "inclined-fourier-17": ("inclined", "fourier", {"terms": 17, "steps": 4096, "abscissa": "s"}),
    "inclined-wavelet-17": ("inclined", "wavelet", {"level": 1, "steps": 4096, "abscissa": "s", **DAMPED}),
    # what else the claims ask for: the same bases with other steps, another independent variable, more terms
    "level-fourier-30-overdamped": ("level", "fourier", {"terms": 30, "steps": 256, **OVERDAMPED}),
    "level-wavelet-31-overdamped": ("level", "wavelet", {"level": 2, "steps": 256, **OVERDAMPED}),
    "inclined-wavelet-10-overdamped": ("inclined", "wavelet", {"level": 0, "steps": 512, **OVERDAMPED}),
    "inclined-fourier-10-fine": ("inclined", "fourier", {"terms": 10, "steps": 4096}),
    "inclined-fourier-10-position": ("inclined", "fourier", {"terms": 10, "steps": 4096, "abscissa": "s"}),
    "inclined-fourier-17-coarser": ("inclined", "fourier", {"terms": 17, "steps": 2048, "abscissa": "s"}),
    "inclined-fourier-59": ("inclined", "fourier", {"terms": 59, "steps": 2000}),
    "level-wavelet-31-undamped": ("level", "wavelet", {"level": 2, "steps": 4000}),
    "inclined-wavelet-17-coarser": ("inclined", "wavelet", {"level": 1, "steps": 2048, "abscissa": "s", **DAMPED}),
    "inclined-wavelet-17-any-step": ("inclined", "wavelet", {"level": 1, "steps": 4111, "abscissa": "s", **DAMPED}),
    "rising-following": ("rising", "following-p2", {"elements": 16, "steps": 1600}),
    "rising-following-coarser": ("rising", "following-p2", {"elements": 8, "steps": 800}),
}

# The converged reference: following elements with companions of half the resolution and half the steps, and sines
# with a travelling kink, which share no formula with them.
FINE = ("following-p2", {"elements": 40, "steps": 4000})
CROSS = ("fourier-kink", {"terms": 50, "steps": 2500})
REFERENCES = ("level", "heavy", "cruise", "inclined")


def scenes() -> dict[str, Scene]:
    """Return the paper's scenes, the level one with Wu & Chen's mu = 2, and (12) taken literally (a rising chord)."""
    level, inclined = Scene.load("level"), Scene.load("inclined")
    rising = inclined.variant(supports=inclined.supports.model_copy(update={"drop": -inclined.supports.drop}))
    return {
        "level": level, "heavy": level.variant(mu=2.0, name="level-mu-2"), "cruise": Scene.load("cruise"),
        "inclined": inclined, "rising": rising.variant(name="rising"),
    }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Reference:
    """A converged run: elements that follow the mass, their companions, and the other solver's run."""

    bars: Estimated
    cross: Response

    @property
    def run(self) -> Response:
        return self.bars.run

    def measured(self, f: Callable[[Response], float]) -> tuple[float, float]:
        """Return a number and its bar: from the companions, and never less than the distance of the other solver."""
        own = self.bars.bar(lambda a, b: abs(f(a) - f(b)))
        return f(self.run), max(own, abs(f(self.run) - f(self.cross)))


@dataclass(frozen=True, slots=True)
class Runs:
    """All runs of the study by name, and the references by scene."""

    scenes: dict[str, Scene]
    by_name: dict[str, Response]
    reference: dict[str, Reference]

    def __getitem__(self, name: str) -> Response:
        return self.by_name[name]


def plan() -> dict[str, tuple[str, str, dict[str, Any]]]:
    """Return every run by its folder's name: scene, method, settings."""
    jobs = dict(RUNS)
    for scene in REFERENCES:
        method, settings = FINE
        fine = find(method).settings(settings)
        jobs[f"{scene}-reference"] = (scene, method, settings)
        jobs[f"{scene}-half-resolution"] = (scene, method, refined(find(method), fine, space=0.5))
        jobs[f"{scene}-half-steps"] = (scene, method, refined(find(method), fine, time=0.5))
        jobs[f"{scene}-cross"] = (scene, *CROSS)
    return jobs


def all_runs(out: Path, report: Progress) -> Runs:
    """Return all runs, each read from out/runs/NAME if it was stored there by the same scene and settings."""
    known, jobs = scenes(), plan()

    def made(name: str) -> Response:
        scene, method, settings = jobs[name]
        return stored(out / "runs" / name, known[scene], method, settings)

    names, done = sorted(jobs, key=lambda name: name in RUNS), itertools.count(1)  # the long ones first
    spread(lambda name: bool(made(name)), names, lambda i, there: report("runs", next(done) / len(names)))
    found = {name: made(name) for name in jobs}
    return Runs(known, found, {scene: _reference(found, scene) for scene in REFERENCES})


def stored(folder: Path, scene: Scene, method: str, settings: dict[str, Any]) -> Response:
    """Return the stored run if it is this very one; else make it and store it."""
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
    fine, half, slow = (found[f"{scene}-{part}"] for part in ("reference", "half-resolution", "half-steps"))
    weights = SAFETY * left(space_order(find(FINE[0]).space_order)), SAFETY * left(2.0)
    bars = Estimated(fine, fine, half, slow, weights, "companions with half the elements and half the steps")
    return Reference(bars, found[f"{scene}-cross"])


def path_bar(reference: Reference) -> float:
    """Return the error bar of the reference's path over the window, relative to its largest deflection."""
    runs = (*reference.bars.runs, reference.cross)
    window = measures.window_of(*runs)
    own = reference.bars.bar(lambda a, b: measures.path_gap(a, b, window)[0])
    return max(own, measures.path_gap(reference.cross, reference.run, window)[0])
