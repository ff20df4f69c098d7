"""What a command printed of a line, and what its outcome says of the motion."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from validation.core.readback.limits import LIMIT_VERDICT, limit_row_faults, scope_sentences
from validation.core.readback.stored import Faults, Row, read_json, read_words, worst_verdict
from validation.core.readback.texts import cell_texts, contents_of_tags, plain_text
from validation.core.scene_data import read_columns

COUNTED = "comparisons of two solvers agree", "laws hold", "kinds of printed numbers are as computed"
TOUCHES = -1e-6  # [m] a rope that ends on the ground does not hit it


def printed_line_faults(printed: Sequence[str], html_text: str, folder: Path) -> Faults:
    """Faults of what a command printed of a line: rows must stand on its page, sentences be those of the files.

    The tables of the page have readers of their own.  folder : of the line's files, below agreement.json of a check.
    """
    summary = read_json(folder / "summary.json")
    judged = read_json(folder.parent / "agreement.json")["rows"] if folder.name.endswith("-check") else []
    scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    sentences = {*_sentences_beside_tables(summary, judged), *_scope_sentences(scene, at_rest="positions" in summary)}
    if plain_text(summary["outcome"]) in plain_text(html_text):
        sentences.add(f"{summary['scene']}: {summary['outcome']}")
    lines = {tuple(map(plain_text, re.split(" {2,}", text.strip()))): text.strip() for text in printed}
    for table in contents_of_tags("table", html_text):
        rows = [tuple(filter(None, cell_texts(row))) for row in contents_of_tags("tr", table)]
        shown = [lines.pop(row) for row in rows if row in lines]
        sentences.add(f"{len(rows) - len(shown)} more in the report" if shown else "")
    for cells, text in lines.items():
        if re.match(LIMIT_VERDICT, cells[-1]):
            yield from limit_row_faults(cells, summary["limits"])
        elif text.partition("; not so: ")[0] not in sentences:
            yield f"printed: {text!r} is neither on the page nor in the files"


def _sentences_beside_tables(summary: Row, judged: Sequence[Row]) -> Iterator[str]:
    """What is printed beside the tables: verdict, cost, counts of what agrees, positions without rest."""
    seconds = f"{summary['seconds']:.1f} s"
    if "positions" in summary:
        count = summary["positions"]
        yield f"{count} position{'s' if count != 1 else ''} in {seconds}"
        for x in summary["refused"]:
            yield f"position {x['position']}: {x['reason']}"
        yield f"and {len(summary['refused']) - 3} more positions without rest"
    else:
        settings = ", ".join(f"{value} {name}" for name, value in summary["settings"].items())
        yield f"{summary['method']}, {settings}; {seconds}"
    if judged:
        yield read_words("page", "assets/verdicts.toml")[worst_verdict(judged) or "not comparable"]
        yield "; ".join(_counts(judged))


def _scope_sentences(scene: Row, at_rest: bool) -> Iterator[str]:
    """What the texts of the limits are for, and whether the line is that."""
    cars = scene.get("car", [])
    modes = {"rest"} if at_rest else {car.get("drive", {}).get("mode", "grip") for car in cars}
    yield from scope_sentences(scene.get("limits", {}).get("use", []), modes)
    if all("at" in car for car in cars):
        yield "at the given positions of the cars; without `at` each number is that of its worst place"


def _counts(judged: Sequence[Row]) -> Iterator[str]:
    """How many comparisons, laws and printed numbers agree."""
    groups: dict[str, list[str]] = {words: [] for words in COUNTED}
    for x in judged:
        of_law = x["allowed_because"].startswith("law")
        groups[COUNTED[2 if x["quantity"] == "printed" else int(of_law)]].append(x["verdict"])
    for words, verdicts in groups.items():
        if verdicts:
            yield f"{verdicts.count('agree')} of {len(verdicts)} {words}"


def outcome_faults(folder: Path) -> Faults:
    """Faults of the outcome of a line in motion: its kind, where the cars end, what is hit, the largest tension."""
    summary = read_json(folder / "summary.json")
    scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    design = {number["quantity"]: number for number in summary["design"]}
    t = read_columns(folder / "contacts.csv")["t"][-1]
    hit = [x for x in design.values() if x["quantity"].startswith("clearance") and _upper(x) < TOUCHES]
    same = 1e-9  # relative
    events = [x for x in summary["events"] if abs(x["t"] - t) <= same * t]
    kind = _outcome_kind(summary, design, hit, events)
    if summary["outcome_kind"] != kind:
        yield f"outcome: {summary['outcome_kind']} where the files say {kind}"
    tension = design["tension_max"]
    parts = [f"largest tension {tension['value'] / 1e3:.1f} kN at {tension['t']:.1f} s"]
    for x in hit:
        over = x["quantity"].partition(":")[2].rpartition(" over ")[2]  # the name alone of what the rope hits
        parts.append(f"hits {over} by {-x['value']:.2f} m")
    if summary["status"] == "complete":
        parts += _parts_of_end(folder, scene, summary["events"])
    for part in parts:
        if part not in summary["outcome"]:
            yield f"outcome: {summary['outcome']!r} does not say {part!r}"


def _outcome_kind(summary: Row, design: dict[str, Row], hit: Sequence[Row], events: Sequence[Row]) -> str:
    """The kind of outcome that numbers and events say; the first that holds."""
    if summary["status"] != "complete":
        return "incomplete"
    if "safety_factor_min" in design and _upper(design["safety_factor_min"]) < 1.0:
        return "breaks"
    if hit:
        return "collides"
    return "ends" if events else "arrives"


def _parts_of_end(folder: Path, scene: Row, events: Sequence[Row]) -> Iterator[str]:
    """When and how a run ends, where each car is then, and since when if it stays there."""
    for file in folder.glob("path-*.csv"):
        name = file.stem.removeprefix("path-")
        path = read_columns(file)
        yield f"{name} at x = {path['x'][-1]:.1f} m"
        yield from _stop_sentences(name, path, events, scene["car"])
    t = path["t"][-1]
    at_end = [x["event"] for x in events if x["t"] >= t * (1.0 - 1e-9)]
    yield f"{at_end[-1]} after {t:.1f} s" if at_end else f"ends after {t:.1f} s"


def _stop_sentences(name: str, path: dict[str, Any], events: Sequence[Row], cars: Sequence[Row]) -> list[str]:
    """Where and when a car has stopped that has not moved since, before the end of the run."""
    t = path["t"]
    before_end = t[-1] * (1.0 - 1e-9)
    stops = [x["t"] for x in events if x["event"] == f"{name} stops" and x["t"] < before_end]
    if not stops:
        return []
    drive = next(car for car in cars if car["name"] == name)["drive"]
    s, x = (np.interp(stops[-1], t, path[column]) for column in ("s_o", "x"))
    if abs(path["s_o"][-1] - s) > drive.get("rest_distance", 0.01):
        return []
    return [f"{name} stops at x = {x:.1f} m after {stops[-1]:.1f} s"]


def _upper(number: Row) -> float:
    return float(number["value"] + (number["bar"] or 0.0))
