"""The least model for a car that rolls: for timetable, deflection and tension.

free: the ride on the chord, on the empty cable, on the loaded cable (quasi-static), full dynamics.
hauled: the cable at rest under the car, full dynamics of a gripping car, full dynamics.

Timetable: largest distance in place over the length, in speed over its largest, at equal times, and in duration.
Deflection: largest distance in v at equal places, over the largest v.
Tension: rms over cable and frames at equal places, off the car, over H.
Haul force: largest distance of means over an axial round trip, at equal places, over the largest force.
"""

import math
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from cablefem.response import Array, Response
from cablefem.scene import LoadPath, Scene
from cablefem.scene.ride import ride
from validation.core import store
from validation.core.measures import JUMP_WIDTH
from validation.core.order import left
from validation.core.quasi_static import Statics, quasi_static
from validation.core.running import run
from validation.core.sidebyside import Progress

REFERENCE = "following-p2"
FULL = store.shipped(__package__, "ladders.toml")["rolling"]["full"]
ORDER = 1.5  # of the path, which wave fronts reduce; gap/(2^p - 1) is left
SHARE = 0.25  # of the tolerance: for the full run's error
NEEDS = {"free": ("timetable", "deflection", "tension"), "haul": ("deflection", "tension", "haul force")}
EDGE = 0.05  # s_o/l next to a support that is not compared, and the least range that is


@dataclass(slots=True)
class Rung:
    """A model and its distances to the full one; inf where it says nothing."""

    model: str
    seconds: float
    gaps: dict[str, float] = field(default_factory=dict)
    arrival: tuple[str, float, float] | None = None  # event, time [s], speed [m/s]

    def line(self) -> dict[str, Any]:
        gaps = {k: finite(x) for k, x in self.gaps.items()}
        return {
            "model": self.model, "load": "mass", "seconds": self.seconds, "path_error": gaps["deflection"],
            "tension_error": gaps["tension"], "gaps": gaps, "last": self.arrival,
        }  # fmt: skip


def advice(scene: Scene, tol: float, report: Progress) -> dict[str, Any]:
    """Return the content of advice.json for a scene whose car rolls."""
    free = scene.drive.mode == "free"
    finest, bars = _full(scene, tol, report)
    rungs = _free(scene, finest) if free else _hauled(scene, finest)
    rungs.append(Rung("full" if free else "haul", finest.seconds, bars, _last(finest)))
    least = {need: next((r for r in rungs if r.gaps[need] <= tol), rungs[-1]).model for need in bars}
    best = rungs[max(i for i, r in enumerate(rungs) if r.model in least.values())]
    return {
        "scene": scene.name, "scene_toml": scene.to_toml(), "tol": tol, "drive": scene.drive.mode,
        **best.line(), "method": REFERENCE if best.model in ("full", "grip", "haul") else None,
        "settings": {k: finest.settings[k] for k in ("elements", "steps", "scheme")},
        "meets": all(gap <= tol for gap in best.gaps.values()), "least": least,
        "words": _words(scene, tol, rungs, least), "rungs": [r.line() for r in rungs],
    }  # fmt: skip


def _full(scene: Scene, tol: float, report: Progress) -> tuple[Response, dict[str, float]]:
    """A full run as fine as the tolerance needs, and its bars."""
    runs: list[Response] = []
    bars = dict.fromkeys(NEEDS[scene.drive.mode], math.inf)
    for i, (elements, steps) in enumerate(FULL):
        report("full model", i / len(FULL))
        runs.append(run(scene, REFERENCE, elements=elements, steps=steps, scheme="generalized-alpha"))
        if i:
            before, gaps = _gaps(scene, *runs[-3:-1]) if i > 1 else {}, _gaps(scene, *runs[-2:])
            bars = {k: left(gap, before.get(k, 0.0), (2.0, 2.0), ORDER) for k, gap in gaps.items()}
        if all(bar <= SHARE * tol for bar in bars.values()):
            break
    report("full model", 1.0)
    return runs[-1], bars


def finite(x: float) -> float | None:
    return x if math.isfinite(x) else None


def _last(r: Response) -> tuple[str, float, float]:
    if r.events and r.events[-1]["event"] in ("arrival", "back", "stop"):
        e = r.events[-1]
        return str(e["event"]), float(e["t"]), float(e["speed"])
    return "end", float(r.t[-1]), float(r.speed[-1])


# --- the rungs --------------------------------------------------------------------------------------------------------


def _free(scene: Scene, full: Response) -> list[Rung]:
    g, l, tau = scene.groups, scene.length, scene.time_scale
    rungs = []
    for model, kind in (("chord", LoadPath.chord), ("empty cable", LoadPath.empty), ("quasi-static", LoadPath.loaded)):
        begin = time.perf_counter()
        rolled = ride(kind(g), g.mu, g.sigma, g.drive)
        rung = Rung(model, time.perf_counter() - begin)
        rung.gaps = {"timetable": math.inf, "deflection": math.inf, "tension": math.inf}
        if rolled.sections:
            t = full.t[full.t <= rolled.duration * tau] / tau
            place = np.abs(rolled.at(t)[0] - full.s_o[: t.size] / l).max()
            speed = np.abs(rolled.speed(t) * l / tau - full.speed[: t.size]).max() / full.speed.max()
            late = abs(rolled.duration * tau / full.t[-1] - 1.0)
            rung.gaps["timetable"] = float(max(place, speed, late))
        last = rolled.events[-1] if rolled.events else None
        if last is not None and last.event in ("arrival", "back", "stop"):
            rung.arrival = last.event, last.t * tau, last.speed * l / tau
        rungs.append(rung)
    rungs[-1].gaps |= _statics(scene, full)
    return rungs


def _hauled(scene: Scene, full: Response) -> list[Rung]:
    begin = time.perf_counter()
    r = quasi_static(scene)
    statics = Rung("statics", time.perf_counter() - begin, _statics(scene, full))
    size = np.nanmax(np.abs(full.F_haul))
    force = np.interp(full.s_o, r.s_o, r.F_haul)
    statics.gaps["haul force"] = float(np.nanmax(np.abs(_averaged(scene, full, full.F_haul) - force)) / size)
    grip = scene.variant(drive={"mode": "grip"})
    settings = {k: full.settings[k] for k in ("elements", "steps", "scheme")}
    gripped = run(grip, REFERENCE, **settings)
    return [statics, Rung("grip", gripped.seconds, _places(scene, gripped, full) | {"haul force": math.inf})]


def _averaged(scene: Scene, r: Response, values: Array) -> Array:
    """Running mean over an axial round trip."""
    step = (r.t[-1] - r.t[0]) / (r.t.size - 1)
    return uniform_filter1d(values, max(1, round(2.0 * scene.length / scene.axial_speed / step)), mode="nearest")


def _statics(scene: Scene, full: Response) -> dict[str, float]:
    """Distance of the cable at rest from the full run."""
    l, H, g, f = scene.length, scene.horizontal_tension, scene.groups, full.fields
    at = Statics(g)
    here = at(full.s_o / l)
    v = l * (here.place[:, 1] - g.shape(here.s)[1])
    return {
        "deflection": float(np.abs(v - full.v).max() / np.abs(full.v).max()),
        "tension": _rms(f.s / l, f.s_o / l, (H * at.tension(f.s / l, f.s_o / l) - f.T) / H),
    }


def _rms(s: Array, s_o: Array, gap: Array) -> float:
    off = np.abs(s - s_o[:, None]) > JUMP_WIDTH
    return float(np.sqrt(np.mean(gap[off] ** 2)))


def _places(scene: Scene, a: Response, b: Response) -> dict[str, float]:
    """Distance of two prescribed rides at equal places, away from supports."""
    l, H = scene.length, scene.horizontal_tension
    low, high = EDGE * l, (1.0 - EDGE) * min(l, a.s_o[-1], b.s_o[-1])
    inside = (b.s_o >= low) & (b.s_o <= high)
    v = np.interp(b.s_o[inside], a.s_o, a.v)
    marks = (b.fields.s_o >= low) & (b.fields.s_o <= high)
    s_o = b.fields.s_o[marks]
    T = np.stack([np.interp(s_o, a.fields.s_o, column) for column in a.fields.T.T], axis=1)
    return {
        "deflection": float(np.abs(v - b.v[inside]).max() / np.abs(b.v).max()),
        "tension": _rms(b.fields.s / l, s_o / l, (T - b.fields.T[marks]) / H),
    }


def _gaps(scene: Scene, a: Response, b: Response) -> dict[str, float]:
    """Distances of two full runs."""
    found = _places(scene, a, b) if scene.drive.mode == "haul" else _times(scene, a, b)
    if scene.drive.mode == "haul":
        force = np.interp(b.t, a.t, _averaged(scene, a, a.F_haul)) - _averaged(scene, b, b.F_haul)
        found["haul force"] = float(np.nanmax(np.abs(force)) / np.nanmax(np.abs(b.F_haul)))
    return found


def _times(scene: Scene, a: Response, b: Response) -> dict[str, float]:
    l, H = scene.length, scene.horizontal_tension
    both = b.t <= a.t[-1]
    t = b.t[both]
    place = np.abs(np.interp(t, a.t, a.s_o) - b.s_o[both]) / l
    speed = np.abs(np.interp(t, a.t, a.speed) - b.speed[both]) / b.speed.max()
    v = np.abs(np.interp(t, a.t, a.v) - b.v[both]) / np.abs(b.v).max()
    n = min(a.fields.t.size, b.fields.t.size)
    T = (a.fields.T[:n] - b.fields.T[:n]) / H
    return {
        "timetable": float(max(place.max(), speed.max())), "deflection": float(v.max()),
        "tension": _rms(b.fields.s / l, b.fields.s_o[:n] / l, T),
    }  # fmt: skip


# --- words ------------------------------------------------------------------------------------------------------------

TOLD = {
    "chord": "the straight chord", "empty cable": "the empty cable's shape", "full": "the full dynamics",
    "quasi-static": "the quasi-static ride on the loaded cable", "statics": "the cable at rest under the car",
    "grip": "the dynamics of a car that grips the cable", "haul": "the dynamics of the hauled car",
}  # fmt: skip


def _words(scene: Scene, tol: float, rungs: list[Rung], least: dict[str, str]) -> list[str]:
    """A sentence for each need, with distances of lesser models, and one on the end."""
    said = []
    for need, model in least.items():
        known = [r for r in rungs if math.isfinite(r.gaps[need])]
        off = ", ".join(f"{TOLD[r.model]} {100.0 * r.gaps[need]:.2g} percent" for r in known[:-1])
        own = f"its own error bar is {100.0 * known[-1].gaps[need]:.2g} percent"
        short = "" if rungs[-1].gaps[need] <= tol or model != rungs[-1].model else ": none is sure to be within it"
        said.append(f"The {need} needs {TOLD[model]}{short}. Off by: {off}; {TOLD[known[-1].model]}: {own}.")
    ends = [f"{TOLD[r.model]} {r.arrival[0]} after {r.arrival[1]:.2f} s with {r.arrival[2]:.2f} m/s"
            for r in rungs if r.arrival is not None]  # fmt: skip
    if scene.drive.mode == "free" and ends:
        said.append("End of the ride: " + "; ".join(ends) + ".")
    return said
