"""Verdicts on limits, from the design numbers and the TOML."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from validation.core.readback.stored import Faults, Row, read_words
from validation.core.readback.texts import cell_texts, contents_of_tags, shows_number
from validation.core.scene_data import ROUNDING

LIMIT_VERDICT = r"(met|not met|too close to tell|cannot be judged: .*|not computed.*)$"


def scope_sentences(names: Iterable[str], modes: set[str]) -> Iterator[str]:
    """What texts of limits are for, and whether a scene whose cars move in these modes is that."""
    for name in names:
        text = read_words("cablefem.scene", "limits.toml")["text"][name]
        outside = "" if modes <= set(text["modes"]) else "; this scene is outside its scope"
        yield f"{text['source']}: for {text['scope']}{outside}"


def limit_table_faults(html_text: str, rows: Sequence[Row]) -> Faults:
    """Faults of the tables of limits on a page, which show all stored rows."""
    shown = []
    for table in contents_of_tags("table", html_text):
        rows_of_table = [cell_texts(row) for row in contents_of_tags("tr", table)]
        if rows_of_table and "|".join(rows_of_table[0]) == LIMITS:
            shown += rows_of_table[1:]
    if len(shown) != len(rows):
        yield f"{len(shown)} limits are shown where {len(rows)} are stored"
    for cells in shown:
        yield from limit_row_faults(cells, rows)


def limit_row_faults(cells: Sequence[str], rows: Sequence[Row]) -> Faults:
    for row in rows:
        verdict = cells[4].lstrip("✓✗≈? ")
        if (cells[0], cells[3], verdict) == (row["demand"], row["source"], row["verdict"]):
            side = f"{row['side']} "
            limit = {"value": row["limit"], "unit": row["unit"]}
            good = cells[2].startswith(side) and shows_number(cells[2].removeprefix(side), limit)
            value = cells[1] in ("–", "-") if row["value"] is None else shows_number(cells[1], row)
            if good and value:
                return
    yield f"{' | '.join(cells)}: no such limit is stored"


RATIOS = {  # of demands: numbers whose ratio they are
    "safety_factor": ("breaking_load", "tension_max"), "tension_over_contact": ("tension_min", "contact_max"),
    "sag_growth": ("sag_car_max", "sag_car_rest"),
}  # fmt: skip
NUMBERS = {  # of other demands
    "tension_over_wheel": "tension_over_wheel_min",
    "knee_empty": "knee_empty_min",
    "knee_loaded": "knee_max",
    "knee_last": "knee_max",
    "speed": "speed_max",
    "acceleration": "acceleration_max",
    "deceleration": "deceleration_max",
}
OVER = "smallest clearance over "


def limit_faults(rows: Sequence[Row], scene: Row, design: Sequence[Row], events: Sequence[Row]) -> Faults:
    """Faults of verdicts on limits, from a scene's TOML, the shipped texts and the printed numbers."""
    given = scene.get("limits", {})
    shipped = read_words("cablefem.scene", "limits.toml")
    for row in rows:
        words = shipped["demand"]
        name = next(key for key in words if re.fullmatch(words[key][0].format(".*"), row["demand"]))
        if [row["side"], row["unit"]] != words[name][1:3]:
            yield f"{row['demand']}: {row['side']} in {row['unit']}"
        if not _is_stated(name, row, scene, shipped["text"].values()):
            yield f"{row['demand']}: {row['limit']} is not the limit of {row['source']}"
        yield from _verdict_faults(name, row, scene, design, events)
    sources = [row["source"] for row in rows]
    for name in given.get("use", []):
        if not any(source.startswith(shipped["text"][name]["source"]) for source in sources):
            yield f"{name}: none of its limits is printed"


def _is_stated(name: str, row: Row, scene: Row, texts: Iterable[Row]) -> bool:
    """Whether the scene, or a rule of a text, states the limit of a row."""
    if row["source"] == "the scene":
        return bool(scene.get("limits", {}).get(name) == row["limit"])
    return any(_states_rule(rule, name, row, text, scene) for text in texts for rule in text["limit"])


def _states_rule(rule: Row, name: str, row: Row, text: Row, scene: Row) -> bool:
    """Whether a row states a rule of a text, which is for this obstacle and for what the scene says."""
    same = rule["demand"] == name and rule["limit"] == row["limit"]
    kind = _kinds_of_obstacles(scene).get(row["demand"].removeprefix(OVER))
    fits = rule.get("kind") in (None, kind) or kind is None
    applies = rule.get("when") in (None, *scene["limits"].get("when", []))
    return same and fits and applies and row["source"] == f"{text['source']}, {rule['clause']}"


def _kinds_of_obstacles(scene: Row) -> dict[str, str | None]:
    kinds = {x["name"]: x.get("kind") for x in scene.get("obstacle", [])}
    return kinds | {"the ground": scene["limits"].get("ground")}


def _verdict_faults(name: str, row: Row, scene: Row, design: Sequence[Row], events: Sequence[Row]) -> Faults:
    value = _limit_value(name, row, scene, design, events)
    if value is None or row["value"] is None:
        if value is not row["value"] or not row["verdict"].startswith(("cannot be judged: ", "not computed")):
            yield f"{row['demand']}: {row['value']}, {row['verdict']}, where {value} follows"
        return
    if abs(value - row["value"]) > ROUNDING * abs(value) + ROUNDING:
        yield f"{row['demand']}: {row['value']} where {value} follows"
    margin = value - row["limit"]
    if row["side"] != "at least":
        margin = -margin
    verdict = "met" if margin >= 0.0 else "not met"
    if row["bar"] is None or abs(margin) < row["bar"]:
        verdict = "too close to tell"
    if row["verdict"] != verdict:
        yield f"{row['demand']}: {row['verdict']} where {verdict} follows"


def _limit_value(
    name: str, row: Row, scene: Row, design: Sequence[Row], events: Sequence[Row]
) -> float | None:  # fmt: skip
    """The value of a demand; None where it is unknown."""
    values: Values = {}
    for number in design:
        if number["value"] is not None:
            kind, _, of = number["quantity"].partition(":")
            values.setdefault(kind, {})[of] = number["value"]
    if name == "clearance":
        return _clearance_for_demand(row, values, scene)
    if name == "arrival_speed":
        return next((x["speed"] for x in events if x["event"] in ("brake", "arrival")), None)
    if name == "swing_along":
        swings = [*values.get("swing_max", {}).values(), *values.get("swing_min", {}).values()]
        return float(np.tan(np.radians(np.abs(swings).max()))) if swings else None
    if name in NUMBERS:
        return _extreme_for_demand(name, values.get(NUMBERS[name], {}), scene)
    return _ratio_for_demand(name, values, scene) if name in RATIOS else None


Values = dict[str, dict[str, float]]  # numbers by kind, then by obstacle or contact


def _extreme_for_demand(name: str, numbers: dict[str, float], scene: Row) -> float | None:
    """The number of a demand; of knees under load, of the last contact before the end or of the others."""
    last = scene["contact"][-2]["name"] if "contact" in scene else ""
    if name.startswith("knee_l"):
        numbers = {of: x for of, x in numbers.items() if (of == last) is (name == "knee_last")}
    extreme = min if name in ("knee_empty", "tension_over_wheel") else max
    return extreme(numbers.values(), default=None)


def _ratio_for_demand(name: str, values: Values, scene: Row) -> float | None:
    """The ratio of two numbers that a demand names; the breaking load is the scene's."""
    if "breaking_load" in scene["cable"]:
        values["breaking_load"] = {"": scene["cable"]["breaking_load"]}
    above, below = (values.get(kind, {}).values() for kind in RATIOS[name])
    if not above or not below:
        return None
    ratio = min(above) / max(below)
    return ratio - 1.0 if name == "sag_growth" else ratio


def _clearance_for_demand(row: Row, values: Values, scene: Row) -> float | None:
    name = row["demand"].removeprefix(OVER)
    if _kinds_of_obstacles(scene).get(name) is None and row["source"] != "the scene":
        return None
    clearances = [numbers for kind, numbers in values.items() if kind.startswith("clearance")]
    found = [x for numbers in clearances for of, x in numbers.items() if of.split(" over ")[-1] == name]
    return min(found, default=None)


LIMITS = "limit|value|demanded|by|verdict"  # columns
