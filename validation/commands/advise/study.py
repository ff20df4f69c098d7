"""The simplest model that is enough for each need, and its cheapest run.

A car that grips: from a taut string under a force to the full cable.
A free car: quasi-static rides on the chord, the empty cable, the loaded cable.
A hauled car: the cable at rest, and a car that grips.

path : largest distance in v, over the largest v.
tension : rms over cable and time, off the mass, over H.
timetable : largest distance in position over the length, in speed over its largest, and in duration.
haul force : largest distance of means over an axial round trip, over the largest force.

The tolerance holds for path and timetable, ten times as much for forces: as in `check --tol`.
"""

import itertools
import math
import time
from collections.abc import Iterator
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
from cablefem.scene.ride import roll_ride
from validation.core import store
from validation.core.ladder import Goal, Ladder
from validation.core.measures import JUMP_WIDTH, NotComparable, rms_tension_gap_over_H, series_gap
from validation.core.methods import METHODS, Method, find_method
from validation.core.order import FIRST
from validation.core.quasi_static import Statics, quasi_static
from validation.core.refine import (
    BUDGET,
    Gap,
    TooCoarse,
    gap_error_bar_parts,
    refine_to_tolerance,
    refine_until_goal_met,
)
from validation.core.rows import tolerance_of_quantity_kind
from validation.core.running import run
from validation.core.sidebyside import Progress, no_progress
from validation.core.view import View

Row = dict[str, Any]  # of advice.json
REFERENCE = "following-p2"
SHARE = 0.25  # of the tolerance: for the full run's error
POSITIONS = np.linspace(0.0, 1.0, 101)  # s_o/l of drawn paths
# models of cable and load, cheap to full
LADDER = (*itertools.product(("string", "sagged", "stretching"), ("force", "mass")), ("full", "mass"))


def _largest_relative_gap(name: str, a: Response, b: Response, view: View, means: bool = False) -> float:
    """Largest gap of a series, over its largest value in b; means : of means over an axial round trip."""
    mean_over = view.axial_round_trip if means else 0.0
    gap = series_gap(a, b, view.window, attrgetter(name), mean_over, largest=True)
    return gap / float(np.nanmax(np.abs(getattr(b, name))))


def _relative_position_or_speed_gap(a: Response, b: Response, view: View) -> float:
    """Largest gap in position over the length, or in speed over its largest."""
    position = series_gap(a, b, view.window, attrgetter("s_o"), largest=True) / b.length
    return max(position, _largest_relative_gap("speed", a, b, view))


def _tension_gap(a: Response, b: Response, view: View) -> float:
    return rms_tension_gap_over_H(a, b, view.window)


FORCE_NEEDS = ("tension", "haul force")
ByNeed = dict[str, float]
# need -> distance of two runs, and the largest order credited
NEEDS: dict[str, tuple[Gap, float]] = {
    "timetable": (_relative_position_or_speed_gap, math.inf),
    "path": (partial(_largest_relative_gap, "v"), math.inf),
    "tension": (_tension_gap, 1.0),
    "haul force": (partial(_largest_relative_gap, "F_haul", means=True), 1.0),
}
NEEDS_OF_DRIVE = {
    "grip": ("path", "tension"),
    "free": ("timetable", "path", "tension"),
    "haul": ("path", "tension", "haul force"),
}


def relative_tolerances_by_need(scene: Scene, tol: float) -> ByNeed:
    """The tolerance of each need of a scene, relative, from that of the path."""
    needs = NEEDS_OF_DRIVE[scene.drive.mode]
    return {need: tolerance_of_quantity_kind("force" if need in FORCE_NEEDS else "path", tol, None) for need in needs}


@dataclass(frozen=True, slots=True, eq=False)
class Rung:
    """A model, its gaps to the full one (of the full one its bars), and its run where it has one."""

    model: str
    load: str
    seconds: float
    gaps: ByNeed  # by need; inf where it says nothing
    run: Response | None = None

    @property
    def name(self) -> str:
        return f"{self.model} + {self.load}" if (self.model, self.load) in LADDER else self.model

    def meets_tolerances(self, tolerances: ByNeed) -> bool:
        return all(gap <= tolerances[need] for need, gap in self.gaps.items())

    def to_json(self, tolerances: ByNeed) -> Row:
        """The rung as it is stored."""
        out: Row = {
            "name": self.name, "model": self.model, "load": self.load, "seconds": self.seconds,
            "path_error": self.gaps["path"], "tension_error": self.gaps["tension"], "gaps": self.gaps,
            "meets": self.meets_tolerances(tolerances), "method": None, "settings": {},
        }  # fmt: skip
        r = self.run
        if r is not None:
            settings = find_method(r.method).resolution_and_steps(r.settings)
            out["method"] = r.method
            out["settings"] = settings | {"scheme": r.settings["scheme"]}
            if r.drive != "free":
                v = np.interp(POSITIONS, r.s_o / r.length, r.v, right=math.nan)
                out["v"] = [float(f"{x:.6g}") for x in v]
        return store.nulls_for_nonfinite(out)


def advise(scene: Scene, tol: float, out: Path, report: Progress = no_progress) -> Row:
    """Write advice.json for a tolerance of the path; an advice that is stored for the same is returned.

    Raises ValueError for a tolerance outside (0, 1).
    """
    if not (math.isfinite(tol) and 0.0 < tol < 1.0):
        raise ValueError(f"tol must lie in (0, 1), got {tol!r}")
    file = out / "advice.json"
    stored = store.read_json_or_empty(file, scene_toml=scene.to_toml(), asked=relative_tolerances_by_need(scene, tol))
    if stored:
        return stored
    content = advice(scene, tol, report)
    write_json(file, content)
    return content


def advice(scene: Scene, tol: float, report: Progress = no_progress) -> Row:
    """The content of advice.json: the cheapest run that meets the tolerance, and all that was compared with it."""
    tolerances = relative_tolerances_by_need(scene, tol)
    view = View.of_scene(scene)
    ladder = _refine_full_model_within_budget(scene, view, tol, tolerances, report)
    full = ladder.finest
    bars = {need: sum(gap_error_bar_parts(ladder, view, *NEEDS[need])) for need in tolerances}
    rungs = [Rung("full", "mass", full.seconds, bars, full)]
    if all(map(math.isfinite, bars.values())):
        view = view.cut_to_valid_range(full)
        rungs = [*_cheaper_rungs(scene, full, view, report), *rungs]
    simplest = {}  # rung that is enough, by need
    for need, limit in tolerances.items():
        simplest[need] = next((rung for rung in rungs if rung.gaps[need] <= limit), rungs[-1])
    best = max(simplest.values(), key=rungs.index)
    candidates = [best]
    if full.drive == "grip":
        candidates += _rungs_of_racing_methods(scene, best, full, view, tolerances, report)
    meeting = (rung for rung in candidates if rung.meets_tolerances(tolerances))
    cheapest = min(meeting, key=attrgetter("seconds"), default=best)
    content = {"scene": scene.name, "scene_toml": scene.to_toml(), "tol": tol, "asked": tolerances, "drive": full.drive}
    content |= cheapest.to_json(tolerances)
    content["least"] = {need: rung.name for need, rung in simplest.items()}
    content |= {"range": list(view.window), "slack_onset": full.slack_onset}
    content["wheelbase"] = _wheelbase_at_path_tolerance(full, tolerances["path"])
    content["full"] = rungs[-1].to_json(tolerances)
    content["candidates"] = [rung.to_json(tolerances) for rung in candidates]
    content["rungs"] = [rung.to_json(tolerances) for rung in rungs]
    content["place"] = POSITIONS.tolist()
    return content


def _wheelbase_at_path_tolerance(r: Response, tol: float) -> float:
    """Distance b [m] of two wheels whose m g cos(beta) b/(4 N) is the tolerance of the path."""
    kink = 2.0 * r.F_contact / (r.T_behind + r.T_ahead)  # (n,)
    max_deflection = np.nanmax(np.abs(r.v))
    return float(4.0 * tol * max_deflection / np.nanmax(kink))


def _refine_full_model_within_budget(
    scene: Scene, view: View, tol: float, tolerances: ByNeed, report: Progress
) -> Ladder:  # fmt: skip
    """The full model, as fine as tolerance and budget allow."""
    progress = partial(report, "full model")
    budget = SHARE * BUDGET
    try:
        ladder = refine_to_tolerance(
            scene, REFERENCE, SHARE * tol, budget=budget, progress=progress, until=view.last_needed_relative_position
        )
    except TooCoarse as error:
        return error.ladder

    def worst_goal(ladder: Ladder) -> Goal:
        """The need whose bar exceeds its share most."""
        goals = []
        for need, limit in tolerances.items():
            goals.append(Goal(gap_error_bar_parts(ladder, view, *NEEDS[need]), SHARE * limit, FIRST))
        return max(goals, key=lambda goal: goal.bar_over_target)

    return refine_until_goal_met(scene, ladder, worst_goal, budget=budget, until=view.last_needed_relative_position)


def _cheaper_rungs(scene: Scene, full: Response, view: View, report: Progress) -> Iterator[Rung]:
    """Yield the rungs below the full one, cheap to rich."""
    if scene.drive.mode == "free":
        yield from _quasi_static_ride_rungs(scene, full)
        return
    if scene.drive.mode == "haul":
        yield _hauled_statics_rung(scene, full, view)
        gripping = scene.variant(drive={"mode": "grip"})
        gripped = _run_after_warm_up(gripping, REFERENCE, view, **full.settings)
        yield Rung("grip", "mass", gripped.seconds, relative_gaps_by_need(gripped, full, view), gripped)
        return
    for i, (model, load) in enumerate(LADDER[:-1]):
        report("cheaper models", (i + 1) / (len(LADDER) - 1))
        r = _run_after_warm_up(scene, REFERENCE, view, model=model, load=load, **full.settings)
        yield Rung(model, load, r.seconds, relative_gaps_by_need(r, full, view), r)


def _run_after_warm_up(scene: Scene, method: str | Method, view: View, **how: Any) -> Response:
    """A run as far as the view needs it, after a short one, so that its time has no compiling in it."""
    how["until"] = view.last_needed_relative_position
    run(scene, method, **how | {"steps": 8})
    return run(scene, method, **how)


def relative_gaps_by_need(r: Response, full: Response, view: View) -> ByNeed:
    """Distances to the full run by need; infinite where a run says nothing, or ends before the range."""
    out = dict.fromkeys(NEEDS_OF_DRIVE[full.drive], math.inf)
    if not view.is_reached_by(r):
        return out
    for need in out:
        gap, _ = NEEDS[need]
        with suppress(NotComparable):
            out[need] = gap(r, full, view)
    return out


def _quasi_static_ride_rungs(scene: Scene, full: Response) -> Iterator[Rung]:
    """Yield the quasi-static rides of a free car; the one on the loaded cable has path and tension, too."""
    g = scene.groups
    l = scene.length
    tau = scene.time_scale
    paths = {
        "chord": LoadPath.on_chord,
        "empty cable": LoadPath.on_empty_cable,
        "quasi-static": LoadPath.on_loaded_cable,
    }
    for model, path_of in paths.items():
        begin = time.perf_counter()
        rolled = roll_ride(path_of(g), g.mu, g.sigma, g.drive)
        seconds = time.perf_counter() - begin
        gaps = dict.fromkeys(NEEDS_OF_DRIVE["free"], math.inf)
        if model == "quasi-static":
            gaps |= _relative_gaps_of_statics(scene, full)
        if rolled.sections:
            end = rolled.duration * tau
            t = full.t[full.t <= end] / tau
            s_o = rolled.position_and_speed(t)[0]
            speed = rolled.point_speed(t) * l / tau
            position_gap = np.abs(s_o - full.s_o[: t.size] / l).max()
            speed_gap = np.abs(speed - full.speed[: t.size]).max() / full.speed.max()
            duration_gap = abs(end / full.t[-1] - 1.0)
            gaps["timetable"] = float(max(position_gap, speed_gap, duration_gap))
        yield Rung(model, "mass", seconds, gaps)


def _hauled_statics_rung(scene: Scene, full: Response, view: View) -> Rung:
    """The cable at rest at each position of a hauled car."""
    begin = time.perf_counter()
    r = quasi_static(scene)
    seconds = time.perf_counter() - begin
    dt = (full.t[-1] - full.t[0]) / (full.t.size - 1)
    instants = max(1, round(view.axial_round_trip / dt))
    mean = uniform_filter1d(full.F_haul, instants, mode="nearest")
    at_rest = np.interp(full.s_o, r.s_o, r.F_haul)
    largest_gap = np.nanmax(np.abs(mean - at_rest))
    gaps = _relative_gaps_of_statics(scene, full)
    gaps["haul force"] = float(largest_gap / np.nanmax(np.abs(full.F_haul)))
    return Rung("statics", "mass", seconds, gaps)


def _relative_gaps_of_statics(scene: Scene, full: Response) -> ByNeed:
    """Distance of the cable at rest from the full run, at equal positions."""
    l = scene.length
    g = scene.groups
    statics = Statics(g)
    here = statics(full.s_o / l)
    empty = g.coordinates(here.s)[1]
    v = l * (here.car_point[:, 1] - empty)  # (n,)
    path = np.abs(v - full.v).max() / np.abs(full.v).max()

    s = full.fields.s / l
    s_o = full.fields.s_o / l
    off_mass = np.abs(s - s_o[:, None]) > JUMP_WIDTH  # (frames, stations)
    gap = statics.tension_at_stations(s, s_o) - full.fields.T / scene.horizontal_tension
    tension = np.sqrt(np.mean(gap[off_mass] ** 2))
    return {"path": float(path), "tension": float(tension)}


def _rungs_of_racing_methods(
    scene: Scene, best: Rung, full: Response, view: View, tolerances: ByNeed, report: Progress
) -> Iterator[Rung]:  # fmt: skip
    """Yield runs of a model by all methods that race, refined until one meets the tolerances or costs too much."""
    candidates = [method for method in METHODS.values() if method.advise_settings]
    cheapest = full.seconds
    for i, method in enumerate(candidates):
        report("methods", (i + 1) / len(candidates))
        for resolution, steps in method.advise_settings:
            settings: dict[str, Any] = {method.resolution.setting: resolution, "steps": steps}
            r = _run_after_warm_up(scene, method, view, model=best.model, load=best.load, **settings)
            rung = Rung(best.model, best.load, r.seconds, relative_gaps_by_need(r, full, view), r)
            yield rung
            if rung.meets_tolerances(tolerances):
                cheapest = min(cheapest, r.seconds)
                break
            if 2.0 * r.seconds > cheapest:  # the next costs about twice
                break
