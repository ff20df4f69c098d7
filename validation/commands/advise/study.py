"""The least model that is enough for each need, and its cheapest run.

A car that grips: from a taut string under a force to the full cable.
A free car: quasi-static rides on the chord, the empty cable, the loaded cable.  A hauled car: the cable at rest, and a
car that grips.

path : largest distance in v, over the largest v.
tension : rms over cable and time, off the mass, over H.
timetable : largest distance in place over the length, in speed over its largest, and in duration.
haul force : largest distance of means over an axial round trip, over the largest force.

Of path and timetable the tolerance is asked, of forces ten times as much: as `check --tol` asks.
"""

import itertools
import math
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from cablefem.response import Response, write_json
from cablefem.scene import LoadPath, Scene
from cablefem.scene.ride import ride
from validation.core import store
from validation.core.ladder import Goal, Ladder
from validation.core.measures import JUMP_WIDTH, NotComparable, series_gap, tension_gap
from validation.core.methods import METHODS, find
from validation.core.order import FIRST
from validation.core.quasi_static import Statics, quasi_static
from validation.core.refine import BUDGET, TooCoarse, parts_of, refine_to_tolerance, refined_until
from validation.core.rows import tolerance_of
from validation.core.running import run
from validation.core.sidebyside import Progress, silent
from validation.core.view import View

REFERENCE = "following-p2"
SHARE = 0.25  # of the tolerance: for the full run's error
PLACE = np.linspace(0.0, 1.0, 101)  # s_o/l of drawn paths
# of cable and load, cheap to full
LADDER = (*itertools.product(("string", "sagged", "stretching"), ("force", "mass")), ("full", "mass"))
Gap = Callable[[Response, Response, View], float]


def _over_largest(name: str, a: Response, b: Response, view: View, axial: float = 0.0) -> float:
    gap = series_gap(a, b, view.window, attrgetter(name), axial, largest=True)
    return gap / float(np.nanmax(np.abs(getattr(b, name))))


def _timetable(a: Response, b: Response, view: View) -> float:
    place = series_gap(a, b, view.window, lambda r: r.s_o, largest=True) / b.length
    return max(place, _over_largest("speed", a, b, view))


FORCES = ("tension", "haul force")
# need -> distance of two runs, and the largest order credited
NEEDS: dict[str, tuple[Gap, float]] = {
    "timetable": (_timetable, math.inf), "path": (partial(_over_largest, "v"), math.inf),
    "tension": (lambda a, b, view: tension_gap(a, b, view.window), 1.0),
    "haul force": (lambda a, b, view: _over_largest("F_haul", a, b, view, view.axial), 1.0),
}  # fmt: skip
OF = {"grip": ("path", "tension"), "free": ("timetable", "path", "tension"), "haul": ("path", "tension", "haul force")}


def required(scene: Scene, tol: float) -> dict[str, float]:
    """What a tolerance of the path asks of each need of the scene."""
    needs = OF[scene.drive.mode]
    return {need: tolerance_of("force" if need in FORCES else "path", tol, None) for need in needs}


@dataclass(frozen=True, slots=True, eq=False)
class Rung:
    """A model, its distances to the full one, and its run where it has one."""

    model: str
    load: str
    seconds: float
    gaps: dict[str, float]  # by need; inf where it says nothing
    run: Response | None = None

    @property
    def name(self) -> str:
        return f"{self.model} + {self.load}" if (self.model, self.load) in LADDER else self.model

    def within(self, asked: dict[str, float]) -> bool:
        return all(gap <= asked[need] for need, gap in self.gaps.items())

    def line(self, asked: dict[str, float]) -> dict[str, Any]:
        r = self.run
        gaps = self.gaps
        settings = {} if r is None else find(r.method).main_settings(r.settings) | {"scheme": r.settings["scheme"]}
        out = {
            "name": self.name, "model": self.model, "load": self.load, "seconds": self.seconds,
            "path_error": gaps["path"], "tension_error": gaps["tension"], "gaps": gaps, "meets": self.within(asked),
            "method": r.method if r else None, "settings": settings,
        }  # fmt: skip
        if r is not None and r.drive != "free":
            v = np.interp(PLACE, r.s_o / r.length, r.v, right=math.nan)
            out["v"] = [float(f"{x:.6g}") for x in v]
        return store.plain(out)


def advise(scene: Scene, tol: float, out: Path, report: Progress = silent) -> dict[str, Any]:
    """Write advice.json, to a tolerance of all that is needed; an advice for the same is kept."""
    if not (math.isfinite(tol) and 0.0 < tol < 1.0):
        raise ValueError(f"tol must lie in (0, 1), got {tol!r}")
    if kept := store.stored(out / "advice.json", scene_toml=scene.to_toml(), asked=required(scene, tol)):
        return kept
    content = advice(scene, tol, report)
    write_json(out / "advice.json", content)
    return content


def advice(scene: Scene, tol: float, report: Progress = silent) -> dict[str, Any]:
    asked = required(scene, tol)
    rungs, full, view = _rungs(scene, tol, asked, report)
    least = {need: next((r for r in rungs if r.gaps[need] <= enough), rungs[-1]) for need, enough in asked.items()}
    best = max(least.values(), key=rungs.index)
    entries = [best, *(_raced(scene, best, full, view, asked, report) if full.drive == "grip" else ())]
    cheapest = min((r for r in entries if r.within(asked)), key=lambda r: r.seconds, default=best)
    return {
        "scene": scene.name, "scene_toml": scene.to_toml(), "tol": tol, "asked": asked, "drive": full.drive,
        **cheapest.line(asked), "least": {need: r.name for need, r in least.items()},
        "range": list(view.window), "slack_onset": full.slack_onset,
        "full": rungs[-1].line(asked), "candidates": [r.line(asked) for r in entries],
        "rungs": [r.line(asked) for r in rungs], "place": PLACE.tolist(),
    }  # fmt: skip


def _rungs(
    scene: Scene, tol: float, asked: dict[str, float], report: Progress
) -> tuple[list[Rung], Response, View]:  # fmt: skip
    view = View.of(scene)
    ladder = _full(scene, view, tol, asked, report)
    full = ladder.run
    bars = {need: sum(parts_of(ladder, view, *NEEDS[need])) for need in asked}
    rungs = [Rung("full", "mass", full.seconds, bars, full)]
    if all(map(math.isfinite, bars.values())):
        view = view.cut(full)
        rungs = [*_lesser(scene, full, view, report), *rungs]
    return rungs, full, view


def _full(scene: Scene, view: View, tol: float, asked: dict[str, float], report: Progress) -> Ladder:
    """The full model, as fine as tolerance and budget allow."""
    told = partial(report, "full model")
    budget = SHARE * BUDGET
    try:
        ladder = refine_to_tolerance(scene, REFERENCE, SHARE * tol, budget=budget, progress=told, until=view.stop)
    except TooCoarse as error:
        return error.ladder

    def worst(ladder: Ladder) -> Goal:
        """The need whose bar exceeds its share most."""
        goals = [Goal(parts_of(ladder, view, *NEEDS[need]), SHARE * enough, FIRST) for need, enough in asked.items()]
        return max(goals, key=lambda goal: goal.excess)

    return refined_until(scene, ladder, worst, budget=budget, until=view.stop)


def _lesser(scene: Scene, full: Response, view: View, report: Progress) -> Iterator[Rung]:
    """Give the rungs below the full one, cheap to rich."""
    if scene.drive.mode == "free":
        yield from _rolled(scene, full)
        return
    if scene.drive.mode == "haul":
        yield _at_rest(scene, full, view)
        gripped = _timed(scene.variant(drive={"mode": "grip"}), REFERENCE, until=view.stop, **full.settings)
        yield Rung("grip", "mass", gripped.seconds, distances(gripped, full, view), gripped)
        return
    for i, (model, load) in enumerate(LADDER[:-1]):
        report("cheaper models", (i + 1) / (len(LADDER) - 1))
        r = _timed(scene, REFERENCE, model=model, load=load, until=view.stop, **full.settings)
        yield Rung(model, load, r.seconds, distances(r, full, view), r)


def _timed(scene: Scene, method: Any, **how: Any) -> Response:
    """A run after a short one, so that its time has no compiling in it."""
    run(scene, method, **how | {"steps": 8})
    return run(scene, method, **how)


def distances(r: Response, full: Response, view: View) -> dict[str, float]:
    """Distances to the full run by need; infinite where a run says nothing, or ends before the range."""
    out = dict.fromkeys(OF[full.drive], math.inf)
    for need in out if view.covers(r) else ():
        with suppress(NotComparable):
            out[need] = NEEDS[need][0](r, full, view)
    return out


def _rolled(scene: Scene, full: Response) -> Iterator[Rung]:
    """Give the quasi-static rides; the one on the loaded cable tells path and tension, too."""
    g = scene.groups
    l = scene.length
    tau = scene.time_scale
    for model, kind in (("chord", LoadPath.chord), ("empty cable", LoadPath.empty), ("quasi-static", LoadPath.loaded)):
        begin = time.perf_counter()
        rolled = ride(kind(g), g.mu, g.sigma, g.drive)
        seconds = time.perf_counter() - begin
        gaps = dict.fromkeys(OF["free"], math.inf) | (_static_gaps(scene, full) if model == "quasi-static" else {})
        if rolled.sections:
            t = full.t[full.t <= rolled.duration * tau] / tau
            place = np.abs(rolled.at(t)[0] - full.s_o[: t.size] / l).max()
            speed = np.abs(rolled.speed(t) * l / tau - full.speed[: t.size]).max() / full.speed.max()
            gaps["timetable"] = float(max(place, speed, abs(rolled.duration * tau / full.t[-1] - 1.0)))
        yield Rung(model, "mass", seconds, gaps)


def _at_rest(scene: Scene, full: Response, view: View) -> Rung:
    begin = time.perf_counter()
    r = quasi_static(scene)
    seconds = time.perf_counter() - begin
    step = (full.t[-1] - full.t[0]) / (full.t.size - 1)
    mean = uniform_filter1d(full.F_haul, max(1, round(view.axial / step)), mode="nearest")
    force = np.nanmax(np.abs(mean - np.interp(full.s_o, r.s_o, r.F_haul))) / np.nanmax(np.abs(full.F_haul))
    return Rung("statics", "mass", seconds, _static_gaps(scene, full) | {"haul force": float(force)})


def _static_gaps(scene: Scene, full: Response) -> dict[str, float]:
    """Distance of the cable at rest from the full run, at equal places."""
    l = scene.length
    H = scene.horizontal_tension
    g = scene.groups
    f = full.fields
    at = Statics(g)
    here = at(full.s_o / l)
    v = l * (here.place[:, 1] - g.shape(here.s)[1])
    s = f.s / l
    s_o = f.s_o / l
    off = np.abs(s - s_o[:, None]) > JUMP_WIDTH
    tension = at.tension(s, s_o) - f.T / H
    return {
        "path": float(np.abs(v - full.v).max() / np.abs(full.v).max()),
        "tension": float(np.sqrt(np.mean(tension[off] ** 2))),
    }


def _raced(
    scene: Scene, best: Rung, full: Response, view: View, asked: dict[str, float], report: Progress
) -> Iterator[Rung]:  # fmt: skip
    """Give runs of a model by all candidates, refined until within the tolerance or dearer than one that is."""
    candidates = [method for method in METHODS.values() if method.races]
    cheapest = full.seconds
    for i, method in enumerate(candidates):
        report("methods", (i + 1) / len(candidates))
        for resolution, steps in method.races:
            settings: dict[str, Any] = {method.resolution.setting: resolution, "steps": steps}
            r = _timed(scene, method, model=best.model, load=best.load, until=view.stop, **settings)
            yield (entry := Rung(best.model, best.load, r.seconds, distances(r, full, view), r))
            cheapest = min(cheapest, r.seconds) if entry.within(asked) else cheapest
            if entry.within(asked) or 2.0 * r.seconds > cheapest:  # the next costs about twice
                break
