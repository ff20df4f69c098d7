"""Maps of where each method can be trusted (maps.toml): every cell is a run compared with a finer one.

Finished cells are stored in cells.jsonl.
"""

import itertools
import json
import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from cablefem.response import Response, write_json
from cablefem.scene import Scene
from validation.commands.atlas import catalogue
from validation.core import measures, store
from validation.core.methods import METHODS, find_method, scaled_settings
from validation.core.running import run
from validation.core.sidebyside import Progress, no_progress

CELLS = "cells.jsonl"
RESULT = "atlas.json"
MAPS = store.read_packaged_toml(__package__, "maps.toml")

Map = dict[str, Any]  # as in maps.toml
Cell = dict[str, Any]
Settings = dict[str, Any]  # of a method


def methods_with_fixed_settings(m: Map) -> list[tuple[str, Settings]]:
    """The methods of a map, with the settings that its axes do not have."""
    if "methods" in m:
        return [tuple(pair) for pair in m["methods"]]
    out = []
    for method in METHODS.values():
        if method.atlas_settings:
            resolution, steps = method.atlas_settings
            fixed = {method.resolution.setting: resolution, "steps": steps}
            out.append((method.name, fixed))
    return out


def scene_of_cell(m: Map, x: float, y: float) -> Scene:
    """The level scene with groups as the map says, which may be x or y; ValueError where there is none."""
    axes = {"x": x, "y": y}
    groups = {name: axes.get(value, value) for name, value in m.get("scene", {}).items()}
    return catalogue.level_scene(**groups)


def settings_of_cell(m: Map, x: float, y: float, method: str, fixed: Settings) -> Settings:
    """The method's settings in a cell, with about y unknowns per field on the map of resolution."""
    if m["name"] != "step-resolution":
        return fixed
    space = find_method(method).resolution
    return {**fixed, "steps": round(x), space.setting: space.value_for_unknowns(y)}


def method_label(method: str, settings: Settings) -> str:
    """The name of a method's map, with its scheme if it has one."""
    return f"{method}, {settings['scheme']}" if "scheme" in settings else method


def atlas(
    out: Path, progress: Progress = no_progress, *, maps: Sequence[Map] = MAPS["map"],
    rows: Sequence[catalogue.Row] = catalogue.CATALOGUE, quick: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Compute what is missing of the maps and the catalogue, and write atlas.json.

    quick : every fifth value of each axis, every fifth row.
    verdict of the result : whether every failure of the catalogue shows, and its remedy works.
    """
    if quick:
        maps = [m | {axis: m[axis] | {"values": m[axis]["values"][1::5]} for axis in "xy"} for m in maps]
        rows = rows[::5]
    jobs = _jobs_by_key(maps, rows)
    results = store.compute_and_store_missing(out / CELLS, jobs, lambda job: job(), partial(progress, "atlas"))
    cells_of_maps = []
    catalogue_rows = []
    for key, result in results.items():
        if json.loads(key)[0] == "cell":
            cells_of_maps += result
        else:
            as_described = result["failure_shown"] and result["remedy_works"]
            catalogue_rows.append(result | {"verdict": "agree" if as_described else "disagree"})
    all_agree = all(row["verdict"] == "agree" for row in catalogue_rows)
    labelled_maps = []
    for m in maps:
        labels = [method_label(*pair) for pair in methods_with_fixed_settings(m)]
        labelled_maps.append(m | {"methods": labels})
    content = {"verdict": "agree" if all_agree else "disagree", "maps": labelled_maps}
    content |= {"good": MAPS["good"], "wrong": MAPS["wrong"], "cells": cells_of_maps, "catalogue": catalogue_rows}
    write_json(out / RESULT, content)
    return content


def _jobs_by_key(maps: Sequence[Map], rows: Sequence[catalogue.Row]) -> dict[str, Callable[[], Any]]:
    """What computes each point of the maps and each row of the catalogue; the key names all that it depends on."""
    jobs: dict[str, Callable[[], Any]] = {}
    for m in maps:
        methods = methods_with_fixed_settings(m)
        for x, y in itertools.product(m["x"]["values"], m["y"]["values"]):
            used = [(name, settings_of_cell(m, x, y, name, fixed)) for name, fixed in methods]
            key = _job_key("cell", m["name"], x, y, used, MAPS["reference"])
            jobs[key] = partial(run_and_judge_methods_at, m, x, y)
    for row in rows:
        jobs[_job_key("row", row["name"])] = partial(catalogue.measure_failure_and_remedy, row)
    return jobs


def _job_key(*parts: Any) -> str:
    return json.dumps(parts, sort_keys=True)


@lru_cache(maxsize=2)
def _reference_run_with_error(toml: str) -> tuple[Response, float]:
    """The run to compare with, and its path error; infinite where that cannot be said."""
    scene = Scene.from_toml(toml)
    method = find_method("following-p2")
    settings = method.complete_settings(MAPS["reference"])
    fine = run(scene, method, **settings)
    half = run(scene, method, **scaled_settings(method, settings, space=0.5, time=0.5))
    try:
        gap = measures.relative_path_gap(half, fine, measures.common_window(half, fine)).largest
        return fine, gap / 3.0  # second order
    except measures.NotComparable:
        return fine, math.inf


def run_and_judge_methods_at(m: Map, x: float, y: float) -> list[Cell]:
    """Run every method at a point of a map and judge it; without a scene there, cells that say why."""
    methods = methods_with_fixed_settings(m)
    cells = [{"map": m["name"], "x": x, "y": y, "method": method_label(*pair)} for pair in methods]
    try:
        scene = scene_of_cell(m, x, y)
    except ValueError as error:
        none = dict.fromkeys(("cause", "reached", "error", "slack_onset"))
        return [cell | none | {"class": "no scene", "reason": str(error)} for cell in cells]
    reference, reference_error = _reference_run_with_error(scene.to_toml())
    for cell, (name, fixed) in zip(cells, methods, strict=True):
        settings = settings_of_cell(m, x, y, name, fixed)
        r = run(scene, name, **settings)
        cell |= {"settings": settings, **judged_cell(r, reference, reference_error)}
    return cells


def judged_cell(r: Response, reference: Response, reference_error: float) -> Cell:
    """A cell: how far the run came, its path error with a class, and the cause of a failure.

    The error is taken up to the slack onset of the reference; a run that stops before is wrong.
    No cell is judged if that onset is before s_o/l = 0.05, or the reference is unsure by half of the bound.
    Causes: of an incomplete run its own; "unstable" with energy gain; "slack too early"; else "too coarse".
    """
    stop = min(measures.WINDOW[1], reference.slack_onset_position_or_inf)
    out = {"reached": r.reached, "error": None, "slack_onset": r.slack_onset, "cause": r.cause, "reason": r.reason}
    if stop < 0.05 or reference.reached < stop or "energy" in reference.flag_kinds:
        return out | {"class": "not judged", "reason": "the reference itself is not to be trusted here"}
    window = measures.WINDOW[0], min(stop, r.reached)
    try:
        error = measures.relative_path_gap(r, reference, window).largest
    except (measures.NotComparable, ValueError):
        error = math.inf
    verdict, bound = _error_class_with_upper_bound(error, r.reached >= stop)
    if reference_error > 0.5 * bound:
        return out | {"class": "not judged", "reason": f"the reference itself is sure to {reference_error:.2g} only"}
    if verdict != "good" and not r.cause:
        out["cause"] = _cause_of_large_error(r, stop)
    return out | {"class": verdict, "error": error}


def _error_class_with_upper_bound(error: float, complete: bool) -> tuple[str, float]:
    """The class of a path error, and the largest error of that class; a run that stops early is wrong."""
    if not complete or error >= MAPS["wrong"]:
        return "wrong", math.inf
    if error > MAPS["good"]:
        return "poor", MAPS["wrong"]
    return "good", MAPS["good"]


def _cause_of_large_error(r: Response, stop: float) -> str:
    """Why a run that did not break is not good."""
    if "energy" in r.flag_kinds:
        return "unstable"
    return "slack too early" if r.slack_onset_position_or_inf < stop - 0.05 else "too coarse"
