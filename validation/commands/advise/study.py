"""The least model that is enough: a ladder from a taut string under a force to the full cable.

Path: largest |v - v_full| over s_o/l = 0.02 to 0.80 (or to the slack onset), relative to the largest deflection.
Tension: rms of T - T_full over cable and time, off the mass, over H.
The advised model meets both; the least model for the path is reported, too.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from cablefem.response import Response, write_json
from cablefem.scene import Scene
from validation.commands.advise import rolling
from validation.commands.advise.rolling import EDGE, ORDER, REFERENCE, SHARE, finite
from validation.core import measures, store
from validation.core.methods import METHODS, find
from validation.core.order import left
from validation.core.running import run
from validation.core.sidebyside import Progress, silent

# cheap to full
LADDER = (
    ("string", "force"), ("string", "mass"), ("sagged", "force"), ("sagged", "mass"), ("stretching", "force"),
    ("stretching", "mass"), ("full", "mass"),
)  # fmt: skip
FULL = store.shipped(__package__, "ladders.toml")["gripped"]["full"]
FAR = 3.0  # times the tolerance: models further off are not refined

Window = tuple[float, float]


@dataclass(slots=True)
class Rung:
    """A model, its run and its distance to the full one."""

    model: str
    load: str
    run: Response
    path: float = math.inf  # largest |v - v_full|, relative to the largest deflection
    tension: float = math.inf  # rms, relative to H

    def within(self, tol: float, *, tension: bool) -> bool:
        return self.path <= tol and (not tension or self.tension <= tol)

    def certain(self, tol: float, bars: tuple[float, float]) -> bool:
        """Whether an exact full run would decide alike."""
        if self.path > tol + bars[0]:
            return True
        # unresolved waves add as squares
        least = math.sqrt(max(0.0, self.tension**2 - bars[1] ** 2))
        return self.path <= tol - bars[0] and (least > tol or self.tension <= tol)


@dataclass(slots=True)
class Climb:
    """The ladder as far as it was climbed."""

    scene: Scene
    tol: float
    full: list[Response] = field(default_factory=list)  # coarse to fine
    rungs: list[Rung] = field(default_factory=list)  # cheap to rich, without the full one
    window: Window = measures.WINDOW
    bars: tuple[float, float] = (math.inf, math.inf)  # of the finest full run: path, tension
    seconds: float = 0.0  # of all runs

    @property
    def finest(self) -> Response:
        return self.full[-1]

    def least(self, *, tension: bool) -> int:
        """Index in LADDER of the cheapest rung within the tolerance, or of the full one."""
        within = (i for i, rung in enumerate(self.rungs) if rung.within(self.tol, tension=tension))
        return next(within, len(LADDER) - 1)

    def made(self, method: Any, **how: Any) -> Response:
        r = run(self.scene, method, until=measures.WINDOW[1], **how)
        self.seconds += r.seconds
        return r


def advise(scene: Scene, tol: float, out: Path, report: Progress = silent) -> dict[str, Any]:
    """Find the least model of a scene and its cheapest run, and write advice.json.

    tol : of path and tension. An existing advice for the same is kept.
    """
    if not (math.isfinite(tol) and 0.0 < tol < 1.0):
        raise ValueError(f"tol must lie in (0, 1), got {tol!r}")
    if kept := store.stored(out / "advice.json", scene_toml=scene.to_toml(), tol=tol):
        return kept
    content = advice(scene, tol, report)
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "advice.json", content)
    return content


def advice(scene: Scene, tol: float, report: Progress = silent) -> dict[str, Any]:
    """Return the content of advice.json."""
    if scene.drive.mode != "grip":
        return rolling.advice(scene, tol, report)
    for model in ("full", "string"):  # compile first
        run(scene, REFERENCE, model=model, elements=2, steps=8, until=0.3)
    climbed = climb(scene, tol, report)
    both, path = (climbed.least(tension=t) for t in (True, False))
    entries = race(climbed, both, report)
    good = [entry for entry in entries if entry["meets"]]
    best = min(good, key=lambda entry: entry["seconds"]) if good else entries[0]
    finest = climbed.finest
    return {
        "scene": scene.name, "scene_toml": scene.to_toml(), "tol": tol, **best,
        "for_path": _entry(climbed, finest if path == len(climbed.rungs) else climbed.rungs[path].run, tension=False),
        "words": words(climbed) + ([] if best["meets"] else [_short(climbed)]),
        "range": list(climbed.window), "slack_onset": finest.slack_onset,
        "full": {
            "method": REFERENCE, "settings": finest.settings, "path_bar": finite(climbed.bars[0]),
            "tension_bar": finite(climbed.bars[1]), "seconds": finest.seconds, "runs": len(climbed.full),
        },
        "cost_in_full_runs": climbed.seconds / finest.seconds,
        "candidates": entries, "rungs": _rungs(climbed), "place": _PLACE.tolist(),
    }  # fmt: skip


_PLACE = np.linspace(0.0, measures.WINDOW[1], 81)


# --- climbing -------------------------------------------------------------------------------------------------------


def climb(scene: Scene, tol: float, report: Progress) -> Climb:
    """Run the ladder; refine the full model where its own error decides."""
    found = Climb(scene, tol)
    levels = FULL if tol < 1e-3 else FULL[:-1]
    for level, (elements, steps) in enumerate(levels):
        report("full model", level / len(levels))
        found.full.append(found.made(REFERENCE, elements=elements, steps=steps))
        if level == 0 or not _measure_full(found):
            continue
        _climb_cheaper(found, level - 1, report)
        least = found.least(tension=True)
        certain = all(rung.certain(tol, found.bars) for rung in found.rungs[: least + 1])
        if found.bars[0] <= SHARE * tol and certain and (least < len(LADDER) - 1 or found.bars[1] <= tol):
            break
    report("full model", 1.0)
    report("cheaper models", 1.0)
    return found


def _measure_full(found: Climb) -> bool:
    """Set window and bars from the two finest full runs; False without enough overlap."""
    coarse, fine = found.full[-2:]
    try:
        found.window = measures.window_of(coarse, fine)
        if found.window[1] < found.window[0] + EDGE:
            return False
        path, tension = deflection_gap(coarse, fine, found.window), measures.tension_gap(coarse, fine, found.window)
    except measures.NotComparable:
        return False
    before = distance(found.full[-3], coarse, found.window) if len(found.full) > 2 else (0.0, 0.0)
    found.bars = (
        left(path, before[0], (2.0, 2.0), ORDER),
        left(tension, before[1], (2.0, 2.0), 1.0),  # unresolved axial waves
    )
    return True


def _climb_cheaper(found: Climb, level: int, report: Progress) -> None:
    """Run the rungs below coarsely, and finer near the tolerance; measure all."""
    for i, (model, load) in enumerate(LADDER[:-1]):
        report("cheaper models", i / (len(LADDER) - 1))
        for elements, steps in (FULL[0], FULL[level]):
            if i == len(found.rungs):
                r = found.made(REFERENCE, model=model, load=load, elements=elements, steps=steps)
                found.rungs.append(Rung(model, load, r))
            rung = found.rungs[i]
            rung.path, rung.tension = distance(rung.run, found.finest, found.window)
            far = rung.path > FAR * found.tol or (rung.path < found.tol / FAR and rung.tension > FAR * found.tol)
            if far or rung.run.settings["elements"] >= FULL[level][0]:
                break
            rung.run = found.made(REFERENCE, model=model, load=load, elements=FULL[level][0], steps=FULL[level][1])


def distance(r: Response, full: Response, window: Window) -> tuple[float, float]:
    """Path and tension gap to the full run; infinite outside its window."""
    try:
        if r.reached >= window[1]:
            return deflection_gap(r, full, window), measures.tension_gap(r, full, window)
    except measures.NotComparable:
        pass
    return math.inf, math.inf


def deflection_gap(a: Response, b: Response, window: Window) -> float:
    """Largest |v_a - v_b| over the window, relative to the largest |v_b|."""
    coarse, fine = (a, b) if a.t.size <= b.t.size else (b, a)
    inside = measures.inside(coarse, window)
    if np.count_nonzero(inside) < 5:
        raise measures.NotComparable(f"fewer than 5 steps in the window {window}")
    size = np.abs(b.v[b.s_o <= window[1] * b.length]).max()
    return float(np.abs(coarse.v - CubicSpline(fine.t, fine.v)(coarse.t))[inside].max() / size)


# --- the cheapest run of a model --------------------------------------------------------------------------------------


def race(found: Climb, index: int, report: Progress) -> list[dict[str, Any]]:
    """Runs of a rung by all candidates; the climb's finest run comes first.

    Each is refined until within the tolerance or dearer than one that is.
    """
    model, load = LADDER[index]
    made = found.full[::-1] if index == len(LADDER) - 1 else [found.rungs[index].run]
    entries = [_entry(found, r) for r in made]
    candidates = [method for method in METHODS.values() if method.races]
    for i, method in enumerate(candidates):
        report("methods", i / len(candidates))
        for resolution, steps in method.races:
            cheapest = min((e["seconds"] for e in entries if e["meets"]), default=math.inf)
            settings: dict[str, Any] = {method.resolution.setting: resolution, "steps": steps}
            entries.append(_entry(found, found.made(method, model=model, load=load, **settings)))
            # the next costs about twice
            if entries[-1]["meets"] or 2.0 * entries[-1]["seconds"] > min(cheapest, found.finest.seconds):
                break
    report("methods", 1.0)
    return entries


def _entry(found: Climb, r: Response, *, tension: bool = True) -> dict[str, Any]:
    """A run's errors against the finest full run."""
    path, rms = found.bars if r is found.finest else distance(r, found.finest, found.window)
    meets = path <= found.tol and (not tension or rms <= found.tol)
    return {
        "model": r.model, "load": r.load, "method": r.method, "settings": find(r.method).told(r.settings),
        "path_error": finite(path), "tension_error": finite(rms), "seconds": r.seconds, "meets": bool(meets),
    }  # fmt: skip


def _rungs(found: Climb) -> list[dict[str, Any]]:
    """All rungs with distances to the full one; its own is its next coarser run's."""
    lines = [
        _line(rung.run, rung.path, rung.tension) | {
            "within_path": rung.within(found.tol, tension=False), "within": rung.within(found.tol, tension=True),
            "certain": rung.certain(found.tol, found.bars),
        }
        for rung in found.rungs
    ]  # fmt: skip
    coarser = len(found.full) > 1 and found.full[-2].reached >= found.window[1]
    full = found.full[-2] if coarser else found.finest
    errors = distance(full, found.finest, found.window) if coarser else found.bars
    told = {"within_path": True, "within": True, "certain": math.isfinite(found.bars[0])}
    return [*lines, _line(full, *errors) | told]


def _line(r: Response, path: float, tension: float) -> dict[str, Any]:
    reached = _PLACE[r.reached * (1.0 + 1e-9) >= _PLACE] if r.t.size > 3 else _PLACE[:1]
    v = CubicSpline(r.s_o, r.v)(reached * r.length) if r.t.size > 3 else np.zeros(1)
    return {
        "model": r.model, "load": r.load, "method": r.method, "settings": find(r.method).told(r.settings),
        "path_error": finite(path), "tension_error": finite(tension), "seconds": r.seconds,
        "status": r.status, "reason": r.reason, "newton_iterations": r.work["newton_iterations"], "n_dof": r.n_dof,
        "v": [float(f"{x:.6g}") for x in v],
    }  # fmt: skip


# --- words ------------------------------------------------------------------------------------------------------------


def words(found: Climb) -> list[str]:
    """A sentence on each model's error, and its validity."""
    onset = found.finest.slack_onset
    if not math.isfinite(found.bars[0]):
        why = "the full runs do not agree" if onset is None else f"the cable goes slack at s_o/l = {onset:.3f}"
        return [f"Only the full model can be advised: {why}, and there is nothing to compare before."]
    said = [_sentence(rung) for rung in found.rungs]
    if onset is not None and found.window[1] < measures.WINDOW[1]:
        said.append(f"All this holds until the cable goes slack at s_o/l = {found.window[1]:.3f}.")
    unsure = [f"{r.model} + {r.load}" for r in found.rungs if not r.certain(found.tol, found.bars)]
    if unsure:
        said.append(f"Too close to the tolerance to be certain: {', '.join(unsure)}.")
    return said


def _sentence(rung: Rung) -> str:
    name = f"{rung.model} + {rung.load}"
    if not math.isfinite(rung.path):
        return f"{name} breaks at s_o/l = {rung.run.reached:.2f} ({rung.run.cause})."
    return f"{name} is off by {_share(rung.path)} in the path and by {_share(rung.tension, 'H')} in the tension."


def _short(found: Climb) -> str:
    path, tension = found.bars
    return (
        "No run made here is sure to meet the tolerance: the finest one knows the path to within "
        f"{_share(path)} and the tension to within {_share(tension, 'H')}."
    )


def _share(x: float, of: str = "the deflection") -> str:
    return f"{100.0 * x:.2g} percent of {of}" if x < 0.995 else f"{x:.2g} times {of}"
