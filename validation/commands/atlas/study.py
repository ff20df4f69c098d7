"""Maps of where each method can be trusted (maps.toml): every cell is a run compared with a finer one.

Finished cells are stored in cells.jsonl.
"""

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


def methods_of_map(m: Map) -> list[tuple[str, dict[str, Any]]]:
    """The methods of a map, with the settings that its axes do not have."""
    if "methods" in m:
        return [tuple(pair) for pair in m["methods"]]
    out = []
    for method in METHODS.values():
        if method.atlas_settings:
            resolution, steps = method.atlas_settings
            out.append((method.name, {method.resolution.setting: resolution, "steps": steps}))
    return out


def scene_of_cell(m: Map, x: float, y: float) -> Scene:
    """The level scene with groups as the map says, which may be x or y; ValueError where there is none."""
    axes = {"x": x, "y": y}
    return catalogue.level_scene(**{name: axes.get(value, value) for name, value in m.get("scene", {}).items()})


def settings_of_cell(m: Map, x: float, y: float, method: str, fixed: dict[str, Any]) -> dict[str, Any]:
    """The method's settings in a cell, with about y unknowns per field on the map of resolution."""
    if m["name"] != "step-resolution":
        return fixed
    space = find_method(method).resolution
    return {**fixed, "steps": round(x), space.setting: space.value_for_unknowns(y)}


def method_label(method: str, settings: dict[str, Any]) -> str:
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
        maps = [_with_every_fifth_value(m) for m in maps]
        rows = rows[::5]
    jobs = _jobs_by_key(maps, rows)
    results = store.compute_and_store_missing(out / CELLS, jobs, lambda job: job(), partial(progress, "atlas"))
    cells_of_maps = []
    catalogue_rows = []
    for key, result in results.items():
        if json.loads(key)[0] == "cell":
            cells_of_maps += result
        else:
            catalogue_rows.append(_row_with_verdict(result))
    as_described = all(row["verdict"] == "agree" for row in catalogue_rows)
    content = {
        "verdict": "agree" if as_described else "disagree",
        "maps": [m | {"methods": [method_label(*x) for x in methods_of_map(m)]} for m in maps],
        "good": MAPS["good"], "wrong": MAPS["wrong"], "cells": cells_of_maps, "catalogue": catalogue_rows,
    }  # fmt: skip
    write_json(out / RESULT, content)
    return content


def _row_with_verdict(row: catalogue.Row) -> catalogue.Row:
    """A measured row of the catalogue with "agree" where the failure shows and the remedy works."""
    holds = row["failure_shown"] and row["remedy_works"]
    return row | {"verdict": "agree" if holds else "disagree"}


def _with_every_fifth_value(m: Map) -> Map:
    return m | {axis: m[axis] | {"values": m[axis]["values"][1::5]} for axis in "xy"}


def _jobs_by_key(maps: Sequence[Map], rows: Sequence[catalogue.Row]) -> dict[str, Callable[[], Any]]:
    """What computes each point of the maps and each row of the catalogue; the key names all that it depends on."""
    jobs: dict[str, Callable[[], Any]] = {}
    for m in maps:
        for x in m["x"]["values"]:
            for y in m["y"]["values"]:
                used = [(name, settings_of_cell(m, x, y, name, fixed)) for name, fixed in methods_of_map(m)]
                jobs[_job_key("cell", m["name"], x, y, used, MAPS["reference"])] = partial(compute_cells_at, m, x, y)
    jobs |= {_job_key("row", row["name"]): partial(catalogue.measure_failure_and_remedy, row) for row in rows}
    return jobs


def _job_key(*parts: Any) -> str:
    return json.dumps(parts, sort_keys=True)


@lru_cache(maxsize=2)
def _reference_run_with_error(toml: str) -> tuple[Response, float]:
    """The run to compare with, and its path error; infinite where that cannot be said."""
    scene = Scene.from_toml(toml)
    settings = find_method("following-p2").complete_settings(MAPS["reference"])
    fine = run(scene, "following-p2", **settings)
    half = run(scene, "following-p2", **scaled_settings(find_method("following-p2"), settings, space=0.5, time=0.5))
    try:
        gap = measures.relative_path_gap(half, fine, measures.common_window(half, fine)).largest
        return fine, gap / 3.0  # second order
    except measures.NotComparable:
        return fine, math.inf


def compute_cells_at(m: Map, x: float, y: float) -> list[dict[str, Any]]:
    """The cells of all methods at a point of a map."""
    out = [{"map": m["name"], "x": x, "y": y, "method": method_label(*method)} for method in methods_of_map(m)]
    try:
        scene = scene_of_cell(m, x, y)
    except ValueError as error:
        none = dict.fromkeys(("cause", "reached", "error", "slack_onset"))
        return [cell | none | {"class": "no scene", "reason": str(error)} for cell in out]
    for cell, (name, fixed) in zip(out, methods_of_map(m), strict=True):
        cell["settings"] = settings_of_cell(m, x, y, name, fixed)
        cell |= judged_cell(run(scene, name, **cell["settings"]), *_reference_run_with_error(scene.to_toml()))
    return out


def judged_cell(r: Response, reference: Response, reference_error: float) -> dict[str, Any]:
    """A cell: how far the run came, its path error with a class, and the cause of a failure.

    The error is taken up to the slack onset of the reference; a run that stops before is wrong.
    No cell is judged if that onset is before s_o/l = 0.05, or the reference is unsure by half of the bound.
    Causes: of an incomplete run its own; "unstable" with energy gain; "slack too early"; else "too coarse".
    """
    stop = min(measures.WINDOW[1], reference.slack_onset_or_inf)
    out = {"reached": r.reached, "error": None, "slack_onset": r.slack_onset, "cause": r.cause, "reason": r.reason}
    if stop < 0.05 or reference.reached < stop or "energy" in reference.flag_kinds:
        return out | {"class": "not judged", "reason": "the reference itself is not to be trusted here"}
    try:
        error = measures.relative_path_gap(r, reference, (measures.WINDOW[0], min(stop, r.reached))).largest
    except (measures.NotComparable, ValueError):
        error = math.inf
    verdict, bound = _class_of_error(error, r.reached >= stop)
    if reference_error > 0.5 * bound:
        return out | {"class": "not judged", "reason": f"the reference itself is sure to {reference_error:.2g} only"}
    if verdict != "good" and not r.cause:
        out["cause"] = _failure_cause(r, stop)
    return out | {"class": verdict, "error": error}


def _class_of_error(error: float, complete: bool) -> tuple[str, float]:
    """The class of a path error, and the largest error of that class; a run that stops early is wrong."""
    if not complete or error >= MAPS["wrong"]:
        return "wrong", math.inf
    return ("poor", MAPS["wrong"]) if error > MAPS["good"] else ("good", MAPS["good"])


def _failure_cause(r: Response, stop: float) -> str:
    """Why a run that did not break is not good."""
    if "energy" in r.flag_kinds:
        return "unstable"
    return "slack too early" if r.slack_onset_or_inf < stop - 0.05 else "too coarse"
