"""Verdicts on limits, from the design numbers and the TOML."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from validation.core.readback.stored import Faults, Row, read_package_toml
from validation.core.readback.texts import rows_of_each_table, shows_design_number
from validation.core.scene_data import GROUND, ROUNDING

LIMIT_VERDICT = r"(met|not met|too close to tell|cannot be judged: .*|not computed.*)$"


def expected_scope_sentences(names: Iterable[str], *either: set[str]) -> Iterator[str]:
    """What texts of limits are for, and whether a scene whose cars move in either of these sets of modes is that."""
    for name in names:
        text = read_package_toml("cablefem.scene", "limits.toml")["text"][name]
        inside = any(modes <= set(text["modes"]) for modes in either)
        outside = "" if inside else "; this scene is outside its scope"
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
    demanded = _StoredDemandValues(scene, design, events)
    for row in rows:
        demand = next(key for key in words if re.fullmatch(words[key][0].format(".*"), row["demand"]))
        if [row["side"], row["unit"]] != words[demand][1:3]:
            yield f"{row['demand']}: {row['side']} in {row['unit']}"
        if not _is_limit_stated(demand, row, scene, shipped["text"].values()):
            yield f"{row['demand']}: {row['limit']} is not the limit of {row['source']}"
        yield from _limit_verdict_faults(row, demanded.value_of_demand(demand, row))
    sources = [row["source"] for row in rows]
    for name in scene.get("limits", {}).get("use", []):
        if not any(source.startswith(shipped["text"][name]["source"]) for source in sources):
            yield f"{name}: none of its limits is printed"


def _is_limit_stated(demand: str, row: Row, scene: Row, regulations: Iterable[Row]) -> bool:
    """Whether the scene, or a rule of a regulation that applies to it, states the limit of a row."""
    limits = scene.get("limits", {})
    if row["source"] == "the scene":
        return bool(limits.get(demand) == row["limit"])
    kind = _kind_of_obstacle_or_ground(row, scene)
    for regulation in regulations:
        for rule in regulation["limit"]:
            same = (demand, row["limit"]) == (rule["demand"], rule["limit"])
            fits = kind is None or rule.get("kind") in (None, kind)
            applies = rule.get("when") in (None, *limits.get("when", []))
            if same and fits and applies and row["source"] == f"{regulation['source']}, {rule['clause']}":
                return True
    return False


def _kind_of_obstacle_or_ground(row: Row, scene: Row) -> str | None:
    """The kind that the scene gives to what a demanded clearance is over; None without one."""
    kinds = {x["name"]: x.get("kind") for x in scene.get("obstacle", [])}
    kinds[GROUND] = scene["limits"].get("ground")
    return kinds.get(row["demand"].removeprefix(OVER))


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


class _StoredDemandValues:
    """Values that demands limit, from a scene's TOML, its stored design numbers and events."""

    def __init__(self, scene: Row, design: Sequence[Row], events: Sequence[Row]) -> None:
        self.scene = scene
        self.events = events
        self.by_kind: dict[str, dict[str, float]] = {}  # then by obstacle or contact
        for number in design:
            if number["value"] is not None:
                kind, _, of = number["quantity"].partition(":")
                self.by_kind.setdefault(kind, {})[of] = number["value"]
        if "breaking_load" in scene["cable"]:
            self.by_kind["breaking_load"] = {"": scene["cable"]["breaking_load"]}

    def value_of_demand(self, demand: str, row: Row) -> float | None:
        """The value of a demand; None where it is unknown."""
        if demand == "clearance":
            return self._min_clearance(row)
        if demand == "arrival_speed":
            return next((x["speed"] for x in self.events if x["event"] in ("brake", "arrival")), None)
        if demand == "swing_along":
            swings = [*self._values_of_kind("swing_max"), *self._values_of_kind("swing_min")]
            return float(np.tan(np.radians(np.abs(swings).max()))) if swings else None
        if demand in NUMBERS:
            return self._extreme(demand)
        return self._ratio(demand) if demand in RATIOS else None

    def _values_of_kind(self, kind: str) -> Collection[float]:
        return self.by_kind.get(kind, {}).values()

    def _extreme(self, demand: str) -> float | None:
        """The number of a demand; of knees under load, of the last contact before the end or of the others."""
        values = self._values_of_kind(NUMBERS[demand])
        if demand in ("knee_loaded", "knee_last"):
            last = self.scene["contact"][-2]["name"] if "contact" in self.scene else ""
            of_last = demand == "knee_last"
            knees = self.by_kind.get(NUMBERS[demand], {})
            values = [x for contact, x in knees.items() if (contact == last) is of_last]
        extreme = min if demand in ("knee_empty", "tension_over_wheel") else max
        return extreme(values, default=None)

    def _ratio(self, demand: str) -> float | None:
        """The ratio of two numbers that a demand names; None without both."""
        numerators, denominators = map(self._values_of_kind, RATIOS[demand])
        if not numerators or not denominators:
            return None
        ratio = min(numerators) / max(denominators)
        return ratio - 1.0 if demand == "sag_growth" else ratio

    def _min_clearance(self, row: Row) -> float | None:
        """The smallest clearance over a row's obstacle or ground; None if its text needs a kind that nobody gave."""
        if row["source"] != "the scene" and _kind_of_obstacle_or_ground(row, self.scene) is None:
            return None
        name = row["demand"].removeprefix(OVER)
        over = []
        for kind, numbers in self.by_kind.items():
            if kind.startswith("clearance"):
                over += [x for key, x in numbers.items() if key.split(" over ")[-1] == name]
        return min(over, default=None)


LIMITS = "limit|value|demanded|by|verdict"  # columns
