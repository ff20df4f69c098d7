"""Verdicts on limits, from the design numbers and the TOML."""

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from validation.core.readback.stored import Faults, Row, read_package_toml
from validation.core.readback.texts import rows_of_each_table, shows_design_number
from validation.core.scene_data import GROUND, ROUNDING

LIMIT_VERDICT = r"(met|not met|too close to tell|cannot be judged: .*|not computed.*)$"


def expected_limit_scope_sentences(names: Iterable[str], *either: set[str]) -> Iterator[str]:
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


class _StatedLimit(NamedTuple):
    """A limit that the scene, or a text that it names, states for it."""

    demand: str
    words: str  # of the demand, and of what a clearance is over
    limit: float
    source: str
    text: str  # its source without the clause


def limit_faults(rows: Sequence[Row], scene: Row, design: Sequence[Row], events: Sequence[Row]) -> Faults:
    """Faults of verdicts on limits, from a scene's TOML, the shipped texts and the printed numbers."""
    words = read_package_toml("cablefem.scene", "limits.toml")["demand"]
    stated = {(limit.words, limit.limit, limit.source): limit for limit in _stated_limits(scene)}
    demanded = _StoredDemandValues(scene, design, events)
    for row in rows:
        limit = stated.get((row["demand"], row["limit"], row["source"]))
        if limit is None:
            yield f"{row['demand']}: {row['limit']} is not the limit of {row['source']}"
            continue
        if [row["side"], row["unit"]] != words[limit.demand][1:3]:
            yield f"{row['demand']}: {row['side']} in {row['unit']}"
        yield from _limit_verdict_faults(row, demanded.value_of_demand(limit.demand, row))
    shown = {(row["demand"], row["limit"], row["source"]) for row in rows}
    unjudged = [row for row in rows if row["value"] is None]  # of each text once
    for key, limit in stated.items():
        once = any(row["demand"] == limit.words and row["source"].startswith(limit.text) for row in unjudged)
        if key not in shown and not once:
            yield f"{limit.words}: {limit.limit} of {limit.source} is not printed"


def _stated_limits(scene: Row) -> Iterator[_StatedLimit]:
    """All limits of a scene: its own, and of its texts those for its span, grounds and circumstances."""
    shipped = read_package_toml("cablefem.scene", "limits.toml")
    limits = scene.get("limits", {})
    kinds = _kinds_of_obstacles_and_ground(scene) or {"obstacles": None}
    for demand, (words, *_) in shipped["demand"].items():
        if demand in limits:
            for name in kinds if "{}" in words else [""]:
                yield _StatedLimit(demand, words.format(name), limits[demand], "the scene", "the scene")
    for text in map(shipped["text"].get, limits.get("use", [])):
        for rule in _rules_that_apply(text, limits.get("when", []), _longest_span(scene)):
            kind = rule.get("kind")
            words = shipped["demand"][rule["demand"]][0]
            names = [name for name, of in kinds.items() if None in (kind, of) or kind == of]
            for name in names if "{}" in words else [""]:
                source = f"{text['source']}, {rule['clause']}"
                yield _StatedLimit(rule["demand"], words.format(name), rule["limit"], source, text["source"])


def _rules_that_apply(text: Row, when: Sequence[str], span: float) -> Iterator[Row]:
    """Limits of a text for a longest span [m] and these circumstances, whose own rules replace the general ones."""
    special = [(rule["demand"], rule.get("kind")) for rule in text["limit"] if rule.get("when") in when]
    for rule in text["limit"]:
        general = (rule["demand"], rule.get("kind")) not in special
        if span > rule.get("span_above", 0.0) and (rule["when"] in when if "when" in rule else general):
            yield rule


def _longest_span(scene: Row) -> float:
    """The longest span [m] between neighbouring contacts."""
    if "supports" in scene:
        return float(scene["supports"]["span"])
    return float(np.diff([contact["at"][0] for contact in scene["contact"]]).max())


def _kinds_of_obstacles_and_ground(scene: Row) -> dict[str, str | None]:
    """The kind that the scene gives to each obstacle and its ground, by name; None without one."""
    kinds = {x["name"]: x.get("kind") for x in scene.get("obstacle", [])}
    if scene.get("ground"):
        kinds[GROUND] = scene.get("limits", {}).get("ground")
    return kinds


class _ValueAndBar(NamedTuple):
    value: float
    bar: float


def _limit_verdict_faults(row: Row, expected: _ValueAndBar | None) -> Faults:
    """Faults of value, bar and verdict of a row, where these follow from the numbers."""
    if expected is None or row["value"] is None:
        if expected is not row["value"] or not row["verdict"].startswith(("cannot be judged: ", "not computed")):
            yield f"{row['demand']}: {row['value']}, {row['verdict']}, where {expected} follows"
        return
    value, bar = expected
    if abs(value - row["value"]) > ROUNDING * abs(value) + ROUNDING:
        yield f"{row['demand']}: {row['value']} where {value} follows"
    printed_bar = math.inf if row["bar"] is None else row["bar"]
    if printed_bar != bar and not abs(printed_bar - bar) <= ROUNDING * bar + ROUNDING:
        yield f"{row['demand']}: ± {row['bar']} where ± {bar} follows"
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
        moves = "contact" not in scene or any("at" not in car and "hauled" not in car for car in scene.get("car", []))
        self.without_bar = math.inf if moves else 0.0  # a line at rest is exact
        self.by_kind: dict[str, dict[str, _ValueAndBar]] = {}  # then by obstacle or contact
        for number in design:
            if number["value"] is not None:
                kind, _, of = number["quantity"].partition(":")
                self.by_kind.setdefault(kind, {})[of] = self._value_and_error_bar(number, "value", "bar")
        if "breaking_load" in scene["cable"]:
            self.by_kind["breaking_load"] = {"": _ValueAndBar(scene["cable"]["breaking_load"], 0.0)}

    def _value_and_error_bar(self, row: Row, value: str, bar: str) -> _ValueAndBar:
        known = row.get(bar)
        return _ValueAndBar(row[value], self.without_bar if known is None else known)

    def value_of_demand(self, demand: str, row: Row) -> _ValueAndBar | None:
        """The value of a demand; None where it is unknown."""
        if demand == "arrival_speed":
            first = next((x for x in self.events if x["event"] in ("brake", "arrival")), None)
            return None if first is None else self._value_and_error_bar(first, "speed", "bar_speed")
        if demand == "swing_along":
            swings = [*self._design_numbers_of_kind("swing_max"), *self._design_numbers_of_kind("swing_min")]
            return _tangent_of_widest(swings) if swings else None
        if demand in RATIOS:
            return self._ratio_of_demand(demand)
        values = self._numbers_of_demand(demand, row)
        if not values:
            return None
        return _smallest(values) if row["side"] == "at least" else max(values)

    def _design_numbers_of_kind(self, kind: str) -> Collection[_ValueAndBar]:
        return self.by_kind.get(kind, {}).values()

    def _numbers_of_demand(self, demand: str, row: Row) -> Collection[_ValueAndBar]:
        """Numbers of which one is limited; of knees under load, of the last contact before the end or of the others."""
        if demand == "clearance":
            return self._clearances_of_row(row)
        numbers = self.by_kind.get(NUMBERS.get(demand, ""), {})
        if demand in ("knee_loaded", "knee_last"):
            last = self.scene["contact"][-2]["name"] if "contact" in self.scene else ""
            of_last = demand == "knee_last"
            return [x for contact, x in numbers.items() if (contact == last) is of_last]
        return numbers.values()

    def _ratio_of_demand(self, demand: str) -> _ValueAndBar | None:
        """The ratio of two numbers that a demand names, relative bars added; None without both."""
        numerators, denominators = map(self._design_numbers_of_kind, RATIOS[demand])
        if not numerators or not denominators:
            return None
        above = _smallest(numerators)
        below = max(denominators)
        ratio = above.value / below.value
        bar = (above.bar + abs(ratio) * below.bar) / abs(below.value)
        return _ValueAndBar(ratio - 1.0 if demand == "sag_growth" else ratio, bar)

    def _clearances_of_row(self, row: Row) -> list[_ValueAndBar]:
        """Clearances over a row's obstacle or ground; none if its text needs a kind that nobody gave."""
        name = row["demand"].removeprefix(OVER)
        over: list[_ValueAndBar] = []
        if row["source"] != "the scene" and _kinds_of_obstacles_and_ground(self.scene).get(name) is None:
            return over
        for kind, numbers in self.by_kind.items():
            if kind.startswith("clearance"):
                over += [x for key, x in numbers.items() if key.split(" over ")[-1] == name]
        return over


def _smallest(values: Collection[_ValueAndBar]) -> _ValueAndBar:
    """The smallest value, of equal ones that with the widest bar."""
    return min(values, key=lambda x: (x.value, -x.bar))


def _tangent_of_widest(swings: Sequence[_ValueAndBar]) -> _ValueAndBar:
    """Tangent of the swing [deg] that is widest to either side, d tan = d angle / cos^2."""
    widest = max(swings, key=lambda x: (abs(x.value), x.bar))
    angle = np.radians(abs(widest.value))
    return _ValueAndBar(float(np.tan(angle)), float(np.radians(widest.bar) / np.cos(angle) ** 2))


LIMITS = "limit|value|demanded|by|verdict"  # columns
