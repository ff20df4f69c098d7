"""How little model is enough: a ladder from a taut string under a force to the full cable, climbed until it holds.

What a tolerance means.  Path: the largest |v - v_full| of the mass over s_o/l = 0.02 to 0.80 (or to the slack onset),
relative to the largest deflection there.  Tension: rms of T - T_full over cable and time, off the mass, over H.
The model advised meets both; the least model for the path alone is reported beside it.
"""

import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from cablefem.response import Response, write_json
from cablefem.scene import Scene
from validation.commands.advise import rolling
from validation.commands.advise.rolling import finite
from validation.core import measures, store
from validation.core.methods import METHODS, find
from validation.core.richardson import SAFETY, left
from validation.core.running import run

# cheap to full; every rung knows something more than those before
LADDER = (
    ("string", "force"), ("string", "mass"), ("sagged", "force"), ("sagged", "mass"), ("stretching", "force"),
    ("stretching", "mass"), ("full", "mass"),
)  # fmt: skip
REFERENCE = "following-p2"  # runs the ladder; the method advised is found afterwards
LADDERS = tomllib.loads((resources.files(__package__) / "ladders.toml").read_text(encoding="utf-8"))
FULL, COARSE = LADDERS["gripped"]["full"], LADDERS["gripped"]["coarse"]
FAR = 3.0  # times the tolerance: a cheaper model is run finer only where it is not so far from the full one
# A full run leaves gap/(2^p - 1): p = 3/2 for the path (fronts), 1 for the tension, whose axial waves are not resolved.
PATH_ORDER, TENSION_ORDER = 1.5, 1.0
SHARE = 0.25  # of the tolerance that the full run's own path error may take
LEAST_WINDOW = 0.05  # s_o/l to be compared at least

Progress = Callable[[str, float], None]
Window = tuple[float, float]


@dataclass(slots=True)
class Rung:
    """One model of the ladder, its run and its distance to the full one."""

    model: str
    load: str
    run: Response
    path: float = math.inf  # largest |v - v_full|, relative to the largest deflection
    tension: float = math.inf  # rms, relative to H

    def within(self, tol: float, *, tension: bool) -> bool:
        return self.path <= tol and (not tension or self.tension <= tol)

    def certain(self, tol: float, bars: tuple[float, float]) -> bool:
        """Return whether a full run without error would decide alike."""
        if self.path > tol + bars[0]:
            return True
        path = self.path <= tol - bars[0]
        # unresolved waves of the full run add to the gap as squares do
        least = math.sqrt(max(0.0, self.tension**2 - bars[1] ** 2))
        return path and (least > tol or self.tension <= tol)


@dataclass(slots=True)
class Climb:
    """The ladder as far as it was climbed."""

    scene: Scene
    tol: float
    full: list[Response] = field(default_factory=list)  # coarse to fine
    rungs: list[Rung] = field(default_factory=list)  # cheap to rich, without the full one
    window: Window = measures.WINDOW
    bars: tuple[float, float] = (math.inf, math.inf)  # of the finest full run: path, tension
    tried: dict[tuple[Any, ...], Response] = field(default_factory=dict)  # candidates for the model advised
    runs: list[Response] = field(default_factory=list)  # all of the climb

    @property
    def finest(self) -> Response:
        return self.full[-1]

    def least(self, *, tension: bool) -> int:
        """Return the index in LADDER of the cheapest rung within the tolerance; the full one if none is."""
        for i, rung in enumerate(self.rungs):
            if rung.within(self.tol, tension=tension):
                return i
        return len(LADDER) - 1


def advise(scene: Scene, tol: float, out: Path, progress: Progress | None = None) -> dict[str, Any]:
    """Find the least model of a scene and its cheapest run, and write advice.json.

    tol : of path and tension, see above.  An advice on the same scene and tolerance that is already there is kept.
    """
    if not (math.isfinite(tol) and 0.0 < tol < 1.0):
        raise ValueError(f"tol must lie in (0, 1), got {tol!r}")
    if kept := store.stored(out / "advice.json", scene_toml=scene.to_toml(), tol=tol):
        return kept
    content = advice(scene, tol, progress)
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "advice.json", content)
    return content


def advice(scene: Scene, tol: float, progress: Progress | None = None) -> dict[str, Any]:
    """Return the content of advice.json."""
    if scene.drive.mode != "grip":
        return rolling.advice(scene, tol, progress)
    report = progress or (lambda label, done: None)
    for model in ("full", "string"):  # the first call of compiled code costs more than a run
        run(scene, REFERENCE, model=model, elements=2, steps=8, until=0.3)
    climbed = climb(scene, tol, report)
    both, path = (climbed.least(tension=t) for t in (True, False))
    best = race(climbed, both, tension=True, report=report)
    for_path = race(climbed, path, tension=False, report=report)
    spent = sum(r.seconds for r in [*climbed.runs, *climbed.tried.values()])
    return {
        "scene": scene.name, "scene_toml": scene.to_toml(), "tol": tol,
        **{k: best[k] for k in _CONTRACT},
        "for_path": {k: for_path[k] for k in _CONTRACT},
        "words": words(climbed) + ([] if best["meets"] else [_short(climbed)]),
        "range": list(climbed.window), "slack_onset": climbed.finest.slack_onset,
        "full": {
            "method": REFERENCE, "settings": climbed.finest.settings, "path_bar": finite(climbed.bars[0]),
            "tension_bar": finite(climbed.bars[1]), "seconds": climbed.finest.seconds, "runs": len(climbed.full),
        },
        "seconds_spent": spent, "cost_in_full_runs": spent / climbed.finest.seconds,
        "candidates": best["candidates"], "rungs": _rungs(climbed), "place": _PLACE.tolist(),
    }  # fmt: skip


_CONTRACT = ("model", "load", "method", "settings", "path_error", "tension_error", "seconds", "meets")
_PLACE = np.linspace(0.0, measures.WINDOW[1], 81)


# --- climbing -------------------------------------------------------------------------------------------------------


def climb(scene: Scene, tol: float, report: Progress) -> Climb:
    """Run the ladder; the full model coarse and fine, finer still where the decision hangs on its own error."""
    found = Climb(scene, tol)
    levels = FULL if tol < 1e-3 else FULL[:-1]
    for level, (elements, steps) in enumerate(levels):
        report("full model", level / len(levels))
        kind: dict[str, Any] = {"elements": elements, "steps": steps, "until": measures.WINDOW[1]}
        found.full.append(run(scene, REFERENCE, **kind, progress=_part(report, "full model", level, len(levels))))
        found.runs.append(found.finest)
        if level == 0 or not _measure_full(found):
            continue
        _climb_cheaper(found, level - 1, report)
        least = found.least(tension=True)
        decided = found.bars[0] <= SHARE * tol and all(
            rung.certain(tol, found.bars) for rung in found.rungs[: least + 1]
        )
        if decided and (least < len(LADDER) - 1 or found.bars[1] <= tol):
            break
    report("full model", 1.0)
    report("cheaper models", 1.0)
    return found


def _part(report: Progress, label: str, i: int, n: int) -> Callable[[float], None]:
    return lambda x: report(label, (i + x) / n)


def _measure_full(found: Climb) -> bool:
    """Set the window and the bars from the two finest full runs; False where they have too little in common."""
    coarse, fine = found.full[-2:]
    try:
        found.window = measures.window_of(coarse, fine)
        if found.window[1] < found.window[0] + LEAST_WINDOW:
            return False
        gaps = deflection_gap(coarse, fine, found.window), measures.tension_gap(coarse, fine, found.window)
    except measures.NotComparable:
        return False
    found.bars = (
        SAFETY * left(PATH_ORDER) * gaps[0],
        SAFETY * left(TENSION_ORDER) * gaps[1],
    )
    return True


def _climb_cheaper(found: Climb, level: int, report: Progress) -> None:
    """Run the rungs below the full one, coarsely first; again, finer, those not far from the tolerance; measure all."""
    for i, (model, load) in enumerate(LADDER[:-1]):
        report("cheaper models", i / (len(LADDER) - 1))
        if i == len(found.rungs):
            found.rungs.append(Rung(model, load, _cheaper(found, model, load, COARSE)))
        rung = found.rungs[i]
        rung.path, rung.tension = distance(rung.run, found.finest, found.window)
        far = rung.path > FAR * found.tol or (rung.path < found.tol / FAR and rung.tension > FAR * found.tol)
        if not far and rung.run.settings["elements"] < FULL[level][0]:
            rung.run = _cheaper(found, model, load, FULL[level])
            rung.path, rung.tension = distance(rung.run, found.finest, found.window)


def _cheaper(found: Climb, model: str, load: str, settings: tuple[int, int]) -> Response:
    elements, steps = settings
    r = run(found.scene, REFERENCE, model=model, load=load, elements=elements, steps=steps, until=measures.WINDOW[1])
    found.runs.append(r)
    return r


def distance(r: Response, full: Response, window: Window) -> tuple[float, float]:
    """Return path and tension gap to the full run; infinite where the run does not cover the window."""
    try:
        if r.reached < window[1]:
            return math.inf, math.inf
        return deflection_gap(r, full, window), measures.tension_gap(r, full, window)
    except measures.NotComparable:
        return math.inf, math.inf


def deflection_gap(a: Response, b: Response, window: Window) -> float:
    """Return the largest |v_a - v_b| of the mass over the window, relative to the largest |v_b| up to its end."""
    return float(np.abs(_difference(a, b, window)[1]).max())


def _difference(a: Response, b: Response, window: Window) -> tuple[Any, Any]:
    coarse, fine = (a, b) if a.t.size <= b.t.size else (b, a)
    inside = measures.inside(coarse, window)
    if np.count_nonzero(inside) < 5:
        raise measures.NotComparable(f"fewer than 5 steps in the window {window}")
    size = np.abs(b.v[b.s_o <= window[1] * b.length]).max()
    gap = (coarse.v - CubicSpline(fine.t, fine.v)(coarse.t)) / size
    return (coarse.s_o / coarse.length)[inside], gap[inside]


# --- the cheapest run of a model --------------------------------------------------------------------------------------


def race(found: Climb, index: int, *, tension: bool, report: Progress) -> dict[str, Any]:
    """Return the cheapest run of a rung that stays within the tolerance of the finest full run, of all candidates.

    Each candidate is refined until it stays within the tolerance or costs more than another that does.
    """
    model, load = LADDER[index]
    # the runs of the climb are there already
    made = found.full if index == len(LADDER) - 1 else [found.rungs[index].run]
    entries = [_entry(found, r, tension=tension) for r in made]
    candidates = [method for method in METHODS.values() if method.races]
    for i, method in enumerate(candidates):
        report("methods", i / len(candidates))
        for resolution, steps in method.races:
            cheapest = min((e["seconds"] for e in entries if e["meets"]), default=math.inf)
            key = (model, load, method.name, resolution, steps)
            if key not in found.tried:
                settings: dict[str, Any] = {method.resolution.setting: resolution, "steps": steps}
                kind: dict[str, Any] = {"model": model, "load": load, "until": measures.WINDOW[1]}
                found.tried[key] = run(found.scene, method, **kind, **settings)
            entries.append(_entry(found, found.tried[key], tension=tension))
            # the next one costs about twice as much
            if entries[-1]["meets"] or 2.0 * entries[-1]["seconds"] > min(cheapest, found.finest.seconds):
                break
    report("methods", 1.0)
    good = [entry for entry in entries if entry["meets"]]
    best = min(good, key=lambda entry: entry["seconds"]) if good else entries[len(made) - 1]
    return {**best, "candidates": entries}


def _entry(found: Climb, r: Response, *, tension: bool) -> dict[str, Any]:
    """Return a run's line: its errors against the finest full run, plus what that one may be off itself (path)."""
    path, rms = distance(r, found.finest, found.window)
    if r is found.finest:
        path, rms = found.bars
    meets = path <= found.tol and (not tension or rms <= found.tol)
    return {
        "model": r.model, "load": r.load, "method": r.method, "settings": find(r.method).told(r.settings),
        "path_error": finite(path), "tension_error": finite(rms), "seconds": r.seconds, "meets": bool(meets),
    }  # fmt: skip


def _rungs(found: Climb) -> list[dict[str, Any]]:
    """Return all rungs with their distance to the full one and to the next one, at one resolution each."""
    lines = []
    chain = [(rung.model, rung.load, rung.run) for rung in found.rungs]
    after = [*(x[2] for x in chain[1:]), found.finest]
    for rung, following in zip(found.rungs, after, strict=False):
        step = distance(rung.run, following, found.window)
        lines.append(_line(rung.run, rung.path, rung.tension, step) | {
            "within_path": rung.within(found.tol, tension=False), "within": rung.within(found.tol, tension=True),
            "certain": rung.certain(found.tol, found.bars),
        })  # fmt: skip
    full = found.full[-2] if len(found.full) > 1 and found.full[-2].reached >= found.window[1] else found.finest
    path, tension = distance(full, found.finest, found.window)
    if full is found.finest:
        path, tension = found.bars
    told = {"within_path": True, "within": True, "certain": math.isfinite(found.bars[0])}
    return [*lines, _line(full, path, tension, None) | told]


def _line(r: Response, path: float, tension: float, step: tuple[float, float] | None) -> dict[str, Any]:
    reached = _PLACE[r.reached * (1.0 + 1e-9) >= _PLACE] if r.t.size > 3 else _PLACE[:1]
    v = CubicSpline(r.s_o, r.v)(reached * r.length) if r.t.size > 3 else np.zeros(1)
    return {
        "model": r.model, "load": r.load, "method": r.method,
        "settings": find(r.method).told(r.settings),
        "path_error": finite(path), "tension_error": finite(tension), "seconds": r.seconds,
        "path_to_next": None if step is None else finite(step[0]),
        "tension_to_next": None if step is None else finite(step[1]),
        "status": r.status, "reason": r.reason, "newton_iterations": r.work["newton_iterations"], "n_dof": r.n_dof,
        "v": [float(f"{x:.6g}") for x in v],
    }  # fmt: skip


# --- words ------------------------------------------------------------------------------------------------------------

# What one rung knows and the one before does not: the two rungs, and what is added, said as a subject.
ADDED = (
    (("string", "mass"), ("sagged", "mass"), "the tension that straightening the sag adds"),
    (("stretching", "force"), ("stretching", "mass"), "the inertia of the mass"),
    (("sagged", "mass"), ("stretching", "mass"), "the stretching by steeper slopes"),
)
WAVES = "motion along the cable (longitudinal waves, tension that varies along it)"


def words(found: Climb) -> list[str]:
    """Return what the scene needs, a sentence for each comparison that was made."""
    end = found.window[1]
    if not math.isfinite(found.bars[0]):
        place = found.finest.slack_onset
        why = f"the cable goes slack at s_o/l = {place:.3f}" if place is not None else "the full runs do not agree"
        return [f"Only the full model can be advised: {why}, and there is nothing to compare before."]
    runs = {(rung.model, rung.load): rung.run for rung in found.rungs}
    said = []
    for without, having, what in ADDED:
        said.append(_sentence(found, runs[without], runs[having], what))
    said.append(_sentence(found, runs["stretching", "mass"], found.finest, WAVES))
    tension = found.rungs[-1].tension
    verb = "does not need" if tension <= found.tol else "needs"
    said.append(
        f"The tension {verb} {WAVES}: without it, it is off by {_share(tension, 'H')} (rms; the full run's own "
        f"{_share(found.bars[1], 'H')})."
    )
    if found.finest.slack_onset is not None and end < measures.WINDOW[1]:
        said.append(f"All this holds until the cable goes slack at s_o/l = {end:.3f}.")
    unsure = [f"{r.model} + {r.load}" for r in found.rungs if not r.certain(found.tol, found.bars)]
    if unsure:
        said.append(f"Too close to the tolerance to be certain: {', '.join(unsure)}.")
    return said


def _sentence(found: Climb, without: Response, having: Response, what: str) -> str:
    """Say whether something matters for the path, by how much, and from where on."""
    what, end = what[0].upper() + what[1:], found.window[1]
    if min(without.reached, having.reached) < end:
        broken = min((without, having), key=lambda r: r.reached)
        return (
            f"{what} matters: {broken.model} + {broken.load} breaks at s_o/l = {broken.reached:.2f} ({broken.cause})."
        )
    place, gap = _difference(without, having, found.window)
    largest = float(np.abs(gap).max())
    if largest <= found.tol:
        return (
            f"{what} does not matter for the path until s_o/l = {end:.2f}: leaving it out moves the path by "
            f"{_share(largest)} at most."
        )
    first = float(place[np.argmax(np.abs(gap) > found.tol)])
    return (
        f"{what} matters for the path from s_o/l = {first:.2f} on: leaving it out moves the path by up to "
        f"{_share(largest)}."
    )


def _short(found: Climb) -> str:
    path, tension = found.bars
    return (
        "No run made here is sure to meet the tolerance: the finest one knows the path to within "
        f"{_share(path)} and the tension to within {_share(tension, 'H')}."
    )


def _share(x: float, of: str = "the deflection") -> str:
    return f"{100.0 * x:.2g} percent of {of}" if x < 0.995 else f"{x:.2g} times {of}"
