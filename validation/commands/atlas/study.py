"""Maps of where each method can be trusted: every cell a run held against a finer one that is no competitor.

Cells are appended to `cells.jsonl` as they finish, one JSON object a line; what is there is never computed again.
"""

import json
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from cablefem.response import Response, write_json
from cablefem.scene import Scene
from validation.commands.atlas import catalogue, specimens
from validation.core import measures, store
from validation.core.methods import METHODS, find, refined
from validation.core.running import run
from validation.core.sidebyside import spread

CELLS, RESULT = "cells.jsonl", "atlas.json"

GOOD, WRONG = 0.01, 0.1  # path error, over the largest deflection: good up to the first, wrong from the second on
REFERENCE: dict[str, Any] = {"elements": 24, "steps": 2400, "scheme": "generalized-alpha"}
# Half the reference's resolution is run as well: no cell is judged by a reference that moves by more than this part of
# the bound it is held against.
UNSURE = 0.5
EARLIEST = 0.05  # s_o/l: where the reference is slack before, no stretch is left to compare


@dataclass(frozen=True, slots=True)
class Map:
    """One map: two axes, and the methods whose cells are drawn."""

    name: str
    title: str
    x: tuple[str, tuple[float, ...]]
    y: tuple[str, tuple[float, ...]]
    given: tuple[tuple[str, dict[str, Any]], ...] = ()  # none: what the table has for maps

    @property
    def methods(self) -> tuple[tuple[str, dict[str, Any]], ...]:
        """The methods and their settings where the axes do not set them."""
        of_table = ((m, m.survey) for m in METHODS.values() if m.survey)
        return self.given or tuple((m.name, {m.resolution.setting: n, "steps": steps}) for m, (n, steps) in of_table)

    def scene(self, x: float, y: float) -> Scene:
        """The scene of a cell: the level cable with two of its groups changed."""
        level = Scene.load("level")
        if self.name == "speed-mass":
            return level.variant(mu=y, speed_ratio=x)
        if self.name == "sag-stiffness":
            return level.variant(sag_ratio=x, alpha=y, mu=1.0, speed_ratio=0.4)
        if self.name == "schemes":
            return level.variant(sag_ratio=x, alpha=y, mu=0.5, speed_ratio=0.4)
        return level

    def settings(self, x: float, y: float, method: str, fixed: dict[str, Any]) -> dict[str, Any]:
        """The method's settings in a cell; on the map of resolutions x steps, about y unknowns per field."""
        if self.name != "step-resolution":
            return fixed
        space = find(method).resolution
        return {**fixed, "steps": round(x), space.setting: space.with_unknowns(y)}


MAPS: tuple[Map, ...] = (
    Map(
        "speed-mass", "Speed and mass",
        ("V/c", (0.1, 0.2, 0.4, 0.6, 0.8, 0.95, 1.1, 1.5)), ("mu", (0.01, 0.05, 0.2, 1.0, 5.0, 20.0)),
    ),
    Map(
        "step-resolution", "Step and resolution, level cable",
        ("steps", (100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0)), ("unknowns per field", (4.0, 8.0, 16.0, 32.0)),
        (
            ("following-p2", {}), ("fourier-kink", {}), ("fourier", {}), ("fixed-p1-path", {}),
            ("fourier", {"scheme": "central-difference"}), ("fixed-p1-path", {"scheme": "trapezoidal"}),
        ),
    ),
    Map(
        "sag-stiffness", "Sag and stiffness",
        ("sag/span", (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)), ("alpha", (50.0, 250.0, 1e3, 1e4, 1e5, 1e6)),
    ),
    Map(
        "schemes", "Schemes on deep and stiff cables",
        ("sag/span", (0.05, 0.2)), ("alpha", (1e3, 2e4, 1e5)),
        tuple(
            ("following-p2", {"elements": 12, "steps": steps, "scheme": scheme})
            for scheme, steps in (
                ("trapezoidal", 600), ("energy", 600), ("generalized-alpha", 600), ("gauss", 300), ("radau", 200)
            )
        ),
    ),
)  # fmt: skip


def label(method: str, fixed: dict[str, Any]) -> str:
    """Return the name of a method's map: the method, with its scheme where that is not the default."""
    return f"{method}, {fixed['scheme']}" if "scheme" in fixed else method


def atlas(
    out: Path, progress: Callable[[str, float], None] | None = None, *, maps: tuple[Map, ...] = MAPS,
    rows: tuple[catalogue.Row, ...] = catalogue.CATALOGUE,
) -> dict[str, Any]:  # fmt: skip
    """Compute what is missing of the maps, the step limits and the catalogue, and write atlas.json.

    Interrupted, it goes on where it stopped.
    """
    out.mkdir(parents=True, exist_ok=True)
    store = out / CELLS
    done = {item["key"]: item for item in stored(store)}
    jobs = [job for job in _jobs(maps, rows) if _key(job) not in done]
    begin = time.perf_counter()
    with store.open("a", encoding="utf-8") as file:
        already = len(done)

        def kept(i: int, item: dict[str, Any]) -> None:
            file.write("\n" + json.dumps(item, allow_nan=False))  # a line cut off must not swallow the next one
            file.flush()
            os.fsync(file.fileno())
            done[item["key"]] = item
            if progress is not None:
                count = len(done) - already
                left = (time.perf_counter() - begin) / count * (len(jobs) - count)
                progress(f"atlas, about {left:.0f} s left", count / len(jobs))

        spread(_compute, jobs, kept)
    wanted = [_key(job) for job in _jobs(maps, rows)]
    items = [done[key] for key in wanted if key in done]
    result = {
        "maps": [
            {
                "name": m.name, "title": m.title, "x": {"name": m.x[0], "values": list(m.x[1])},
                "y": {"name": m.y[0], "values": list(m.y[1])}, "methods": [label(*x) for x in m.methods],
            }
            for m in maps
        ],
        "good": GOOD, "wrong": WRONG,
        "cells": [cell for item in items if item["kind"] == "cell" for cell in item["cells"]],
        "limits": [item["limit"] for item in items if item["kind"] == "limit"],
        "catalogue": [item["row"] for item in items if item["kind"] == "row"],
    }  # fmt: skip
    write_json(out / RESULT, result)
    if progress is not None:
        progress("atlas", 1.0)
    return result


def stored(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the finished items of a store; a last line cut off by an interruption does not count."""
    if not path.exists():
        return
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            item = json.loads(line)
        except ValueError:
            continue
        if isinstance(item, dict) and "key" in item:
            yield item


# --- jobs -----------------------------------------------------------------------------------------------------------

Job = tuple[str, Any, float, float]  # kind, map or name, x, y

LIMIT_TERMS = (4.0, 8.0, 16.0, 32.0)


def _jobs(maps: tuple[Map, ...], rows: tuple[catalogue.Row, ...]) -> list[Job]:
    cells: list[Job] = [("cell", m, x, y) for m in maps for x in m.x[1] for y in m.y[1]]
    limits: list[Job] = [
        ("limit", "central-difference", n, 0.0) for n in LIMIT_TERMS if any(m.name == "step-resolution" for m in maps)
    ]
    return cells + limits + [("row", row["name"], 0.0, 0.0) for row in rows]


def _key(job: Job) -> str:
    """What identifies a job: with the settings behind it, so that other settings are other cells."""
    kind, what, x, y = job
    if isinstance(what, Map):
        methods = [(m, what.settings(x, y, m, fixed)) for m, fixed in what.methods]
        return json.dumps([kind, what.name, x, y, methods, REFERENCE], sort_keys=True)
    return json.dumps([kind, what, x, y])


def _compute(job: Job) -> dict[str, Any]:
    kind, what, x, y = job
    item: dict[str, Any] = {"key": _key(job), "kind": kind}
    if kind == "cell":
        return item | {"cells": cells(what, x, y)}
    if kind == "limit":
        return item | {"limit": step_limit(round(x))}
    row = next(row for row in catalogue.CATALOGUE if row["name"] == what)
    return item | {"row": store.plain(catalogue.run_row(row))}


# --- a cell ---------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=2)
def _reference(toml: str) -> tuple[Response, float]:
    """The run that cells are held against, and how far half its resolution is from it."""
    scene = Scene.from_toml(toml)
    fine = run(scene, "following-p2", **REFERENCE)
    half = run(scene, "following-p2", **refined(find("following-p2"), REFERENCE, space=0.5, time=0.5))
    try:
        moved = measures.path_gap(half, fine, measures.window_of(half, fine))[0]
    except measures.NotComparable:
        moved = math.inf
    # of second order at least: what is left in the finer one is a third
    return fine, moved / 3.0


def cells(m: Map, x: float, y: float) -> list[dict[str, Any]]:
    """Return the cells of all methods of a map at one place."""
    try:
        scene = m.scene(x, y)
    except ValueError as error:
        return [
            {"map": m.name, "x": x, "y": y, "method": label(*method), "class": "no scene", "cause": None,
             "reached": None, "error": None, "slack_onset": None, "reason": str(error)}
            for method in m.methods
        ]  # fmt: skip
    reference, unsure = _reference(scene.to_toml())
    out = []
    for name, fixed in m.methods:
        settings = m.settings(x, y, name, fixed)
        r = run(scene, name, **settings)
        out.append(
            {"map": m.name, "x": x, "y": y, "method": label(name, fixed), "settings": settings}
            | judged(r, reference, unsure)
        )
    return out


def judged(r: Response, reference: Response, unsure: float) -> dict[str, Any]:
    """Return what a cell shows: how far the run came, its path error, the class of that, and the cause of a failure.

    The error is taken where the reference is not slack.  A method that stops short of that has it up to there, and is
    wrong: it left the question unanswered.  Causes: that of an incomplete run; "unstable" for one that gains energy;
    "slack too early" where the run says slack long before the reference; "too coarse" where only the error shows.
    """
    stop = min(measures.WINDOW[1], math.inf if reference.slack_onset is None else reference.slack_onset)
    out = {"reached": r.reached, "error": None, "slack_onset": r.slack_onset, "cause": r.cause, "reason": r.reason}
    if stop < EARLIEST or reference.reached < stop or _unstable(reference):
        return out | {"class": "not judged", "reason": r.reason or "the reference itself is not to be trusted here"}
    short = r.reached < stop
    try:
        error = measures.path_gap(r, reference, (measures.WINDOW[0], min(stop, r.reached)))[0]
    except (measures.NotComparable, ValueError):
        return out | {"class": "wrong", "cause": r.cause or "too coarse"}
    out["error"] = error
    verdict = "wrong" if short or not error < WRONG else "poor" if error > GOOD else "good"
    if unsure > UNSURE * {"good": GOOD, "poor": WRONG, "wrong": math.inf}[verdict]:
        return out | {"class": "not judged", "reason": f"the reference itself is sure to {unsure:.2g} only"}
    early = r.slack_onset is not None and r.slack_onset < stop - 0.05
    if r.cause is None and verdict != "good":
        out["cause"] = "unstable" if _unstable(r) else "slack too early" if early else "too coarse"
    return out | {"class": verdict}


def _unstable(r: Response) -> bool:
    """Whether a run gained energy before its slack onset; what it did afterwards is outside the comparison."""
    return "energy" in r.flag_kinds


# --- stability limits -------------------------------------------------------------------------------------------------


def step_limit(terms: int) -> dict[str, Any]:
    """Return the longest stable step of central differences as theory and as runs have it; sines, level cable.

    Theory: 2/omega_max of the cable with the mass at mid-span, frozen and at rest.  Runs: bisection between a step that
    reaches s_o/l = 0.3 without gaining energy and one that does not, to 2 percent.
    """
    from galerkin.bases.fourier import Fourier
    from galerkin.equations import GalerkinSystem

    scene = Scene.load("level")
    system = GalerkinSystem(scene.groups, Fourier(terms))
    end = system.phases[-1][1]
    predicted = end * specimens.largest_frequency(system, 0.5 * end) / 2.0

    def stable(steps: float) -> bool:
        r = run(scene, "fourier", terms=terms, steps=round(steps), scheme="central-difference")
        return r.reached > 0.3 and not _unstable(r)

    low, high = 0.7 * predicted, 1.4 * predicted
    while high / low > 1.02:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if stable(middle) else (middle, high)
    return {"terms": terms, "predicted_steps": predicted, "measured_steps": math.sqrt(low * high)}
