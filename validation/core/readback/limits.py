"""Verdicts on limits, from the design numbers and the TOML."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from validation.core.readback.stored import Faults, Row, read_package_toml
from validation.core.readback.texts import rows_of_each_table, shows_design_number
from validation.core.scene_data import ROUNDING

LIMIT_VERDICT = r"(met|not met|too close to tell|cannot be judged: .*|not computed.*)$"


def expected_scope_sentences(names: Iterable[str], modes: set[str]) -> Iterator[str]:
    """What texts of limits are for, and whether a scene whose cars move in these modes is that."""
    for name in names:
        text = read_package_toml("cablefem.scene", "limits.toml")["text"][name]
        outside = "" if modes <= set(text["modes"]) else "; this scene is outside its scope"
        yield f"{text['source']}: for {text['scope']}{outside}"


def limit_table_faults(html_text: str, rows: Sequence[Row]) -> Faults:
    """Faults of the tables of limits on a page, which show all stored rows."""
    shown = []
    for rows_of_table in rows_of_each_table(html_text):
        if rows_of_table and "|".join(rows_of_table[0]) == LIMITS:
            shown += rows_of_table[1:]
    if len(shown) != len(rows):
        yield f"{len(shown)} limits are shown where {len(rows)} are stored"
    for cells in shown:
        yield from limit_row_faults(cells, rows)


def limit_row_faults(cells: Sequence[str], rows: Sequence[Row]) -> Faults:
    """A fault unless the cells of a shown limit are those of one of the stored rows."""
    if not any(_shows_limit(cells, row) for row in rows):
        yield f"{' | '.join(cells)}: no such limit is stored"


def _shows_limit(cells: Sequence[str], row: Row) -> bool:
    demand, value, limit, source, verdict = cells[:5]
    if (demand, source, verdict.lstrip("✓✗≈? ")) != (row["demand"], row["source"], row["verdict"]):
        return False
    side = f"{row['side']} "
    stored_limit = {"value": row["limit"], "unit": row["unit"]}
    if not (limit.startswith(side) and shows_design_number(limit.removeprefix(side), stored_limit)):
        return False
    return value in ("–", "-") if row["value"] is None else shows_design_number(value, row)


RATIOS = {  # of demands: kinds of the two numbers whose ratio they are
    "safety_factor": ("breaking_load", "tension_max"), "tension_over_contact": ("tension_min", "contact_max"),
    "sag_growth": ("sag_car_max", "sag_car_rest"),
}  # fmt: skip
NUMBERS = {  # of other demands: kind of number
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
    shipped = read_package_toml("cablefem.scene", "limits.toml")
    words = shipped["demand"]
    for row in rows:
        demand = next(key for key in words if re.fullmatch(words[key][0].format(".*"), row["demand"]))
        if [row["side"], row["unit"]] != words[demand][1:3]:
            yield f"{row['demand']}: {row['side']} in {row['unit']}"
        if not _is_limit_stated(demand, row, scene, shipped["text"].values()):
            yield f"{row['demand']}: {row['limit']} is not the limit of {row['source']}"
        yield from _limit_verdict_faults(row, _value_of_demand(demand, row, scene, design, events))
    sources = [row["source"] for row in rows]
    for name in scene.get("limits", {}).get("use", []):
        if not any(source.startswith(shipped["text"][name]["source"]) for source in sources):
            yield f"{name}: none of its limits is printed"


def _is_limit_stated(demand: str, row: Row, scene: Row, regulations: Iterable[Row]) -> bool:
    """Whether the scene, or a rule of a regulation, states the limit of a row."""
    if row["source"] == "the scene":
        return bool(scene.get("limits", {}).get(demand) == row["limit"])
    for regulation in regulations:
        if any(_row_follows_rule(row, demand, rule, regulation, scene) for rule in regulation["limit"]):
            return True
    return False


def _row_follows_rule(row: Row, demand: str, rule: Row, regulation: Row, scene: Row) -> bool:
    """Whether a row states a rule of a regulation, which is for this obstacle and for what the scene says."""
    same = rule["demand"] == demand and rule["limit"] == row["limit"]
    source = f"{regulation['source']}, {rule['clause']}"
    kind = _kinds_of_obstacles_and_ground(scene).get(row["demand"].removeprefix(OVER))
    fits = rule.get("kind") in (None, kind) or kind is None
    applies = rule.get("when") in (None, *scene["limits"].get("when", []))
    return same and fits and applies and row["source"] == source


def _kinds_of_obstacles_and_ground(scene: Row) -> dict[str, str | None]:
    kinds = {x["name"]: x.get("kind") for x in scene.get("obstacle", [])}
    return kinds | {"the ground": scene["limits"].get("ground")}


def _limit_verdict_faults(row: Row, value: float | None) -> Faults:
    """Faults of value and verdict of a row, where this value follows from the numbers."""
    if value is None or row["value"] is None:
        if value is not row["value"] or not row["verdict"].startswith(("cannot be judged: ", "not computed")):
            yield f"{row['demand']}: {row['value']}, {row['verdict']}, where {value} follows"
        return
    if abs(value - row["value"]) > ROUNDING * abs(value) + ROUNDING:
        yield f"{row['demand']}: {row['value']} where {value} follows"
    verdict = _expected_limit_verdict(row, value)
    if row["verdict"] != verdict:
        yield f"{row['demand']}: {row['verdict']} where {verdict} follows"


def _expected_limit_verdict(row: Row, value: float) -> str:
    margin = value - row["limit"]
    if row["side"] != "at least":
        margin = -margin
    if row["bar"] is None or abs(margin) < row["bar"]:
        return "too close to tell"
    return "met" if margin >= 0.0 else "not met"


Values = dict[str, dict[str, float]]  # numbers by kind, then by obstacle or contact


def _value_of_demand(demand: str, row: Row, scene: Row, design: Sequence[Row], events: Sequence[Row]) -> float | None:
    """The value of a demand; None where it is unknown."""
    values: Values = {}
    for number in design:
        if number["value"] is not None:
            kind, _, of = number["quantity"].partition(":")
            values.setdefault(kind, {})[of] = number["value"]
    if demand == "clearance":
        return _min_clearance_for_demand(row, values, scene)
    if demand == "arrival_speed":
        return next((x["speed"] for x in events if x["event"] in ("brake", "arrival")), None)
    if demand == "swing_along":
        swings = [*values.get("swing_max", {}).values(), *values.get("swing_min", {}).values()]
        largest = np.radians(np.max(np.abs(swings), initial=0.0))
        return float(np.tan(largest)) if swings else None
    if demand in NUMBERS:
        return _extreme_for_demand(demand, values.get(NUMBERS[demand], {}), scene)
    return _ratio_for_demand(demand, values, scene) if demand in RATIOS else None


def _extreme_for_demand(demand: str, numbers: dict[str, float], scene: Row) -> float | None:
    """The number of a demand; of knees under load, of the last contact before the end or of the others."""
    if demand in ("knee_loaded", "knee_last"):
        last = scene["contact"][-2]["name"] if "contact" in scene else ""
        of_last = demand == "knee_last"
        numbers = {contact: x for contact, x in numbers.items() if (contact == last) is of_last}
    extreme = min if demand in ("knee_empty", "tension_over_wheel") else max
    return extreme(numbers.values(), default=None)


def _ratio_for_demand(demand: str, values: Values, scene: Row) -> float | None:
    """The ratio of two numbers that a demand names, None without both; the breaking load is the scene's."""
    if "breaking_load" in scene["cable"]:
        values = values | {"breaking_load": {"": scene["cable"]["breaking_load"]}}
    numerators, denominators = (values.get(kind, {}).values() for kind in RATIOS[demand])
    if not numerators or not denominators:
        return None
    ratio = min(numerators) / max(denominators)
    return ratio - 1.0 if demand == "sag_growth" else ratio


def _min_clearance_for_demand(row: Row, values: Values, scene: Row) -> float | None:
    """The smallest clearance over a row's obstacle or ground; None of one whose kind a text needs but nobody gave."""
    name = row["demand"].removeprefix(OVER)
    if _kinds_of_obstacles_and_ground(scene).get(name) is None and row["source"] != "the scene":
        return None
    clearances = [numbers for kind, numbers in values.items() if kind.startswith("clearance")]
    over = []
    for numbers in clearances:
        over += [x for key, x in numbers.items() if key.split(" over ")[-1] == name]
    return min(over, default=None)


LIMITS = "limit|value|demanded|by|verdict"  # columns
