"""Verdicts on limits: a demand, the computed value with its bar, and on which side of the limit they lie.

A limit within the bar is "too close to tell".
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cablefem.scene import Scene
from cablefem.scene.limits import DEMANDS, TEXTS, Limits
from cablefem.scene.line import Line
from cablefem.scene.surroundings import GROUND

MET = "met"
NOT_MET = "not met"
TOO_CLOSE = "too close to tell"
Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Value:
    """A computed value with its bar, of what it holds; nan: unknown, and why."""

    value: float
    bar: float = 0.0
    of: str = ""
    why: str = ""


def unknown_value(why: str) -> Value:
    return Value(math.nan, why=why)


def limit_rows(scene: Scene | Line, design: Sequence[Row], events: Sequence[Row] = ()) -> list[Row]:
    """One row for each limit of a scene; none without [limits].

    design, events : numbers of an answer with their bars; an unknown bar leaves the verdict open.
    """
    if scene.limits is None:
        return []
    values = _DemandedValues(scene, scene.limits, design, events)
    out: list[Row] = []
    open_rows = set()  # of each text one row for what cannot be judged
    for rule in scene.limits.applicable_rules(values.span):
        words, side, unit, _ = DEMANDS[rule["demand"]]
        for value in values.values_for_rule(rule):
            row = {
                "demand": words.format(value.of), "source": rule["source"], "side": side, "limit": rule["limit"],
                "value": None if math.isnan(value.value) else value.value,
                "bar": value.bar if math.isfinite(value.bar) else None, "unit": unit,
                "verdict": _limit_verdict(value, rule["limit"], side),
            }  # fmt: skip
            key = (rule["text"], row["demand"], row["verdict"])
            if row["value"] is not None or key not in open_rows:
                out.append(row)
                open_rows.add(key)
    return out


def _limit_verdict(value: Value, limit: float, side: str) -> str:
    if math.isnan(value.value):
        return value.why if value.why.startswith("not computed") else f"cannot be judged: {value.why}"
    room = value.value - limit if side == "at least" else limit - value.value
    if abs(room) < value.bar or math.isinf(value.bar):
        return TOO_CLOSE
    return MET if room >= 0.0 else NOT_MET


def worst_row(rows: Sequence[Row]) -> Row | None:
    """The first row that is not met, else that is too close, else that is met."""
    for verdict in (NOT_MET, TOO_CLOSE, MET):
        for row in rows:
            if row["verdict"] == verdict:
                return row
    return None


def worst_limit_columns(rows: Sequence[Row]) -> Row:
    """Columns of a table of scenes: the worst verdict, and its limit; none without limits."""
    if not rows:
        return {}
    first = worst_row(rows)
    if first is None:
        return {"limits_met": "cannot be judged", "limits_worst": rows[0]["demand"]}
    return {"limits_met": first["verdict"], "limits_worst": f"{first['demand']} ({first['source']})"}


def any_limit_fails(rows: Sequence[Row]) -> bool:
    """Whether a limit is not met, or too close to tell."""
    return any(row["verdict"] in (NOT_MET, TOO_CLOSE) for row in rows)


def columns_fail(rows: Sequence[Row]) -> bool:
    """The same of a table of scenes."""
    return any(row.get("limits_met") in (NOT_MET, TOO_CLOSE) for row in rows)


def scope_sentences(scene: Scene | Line) -> list[str]:
    """What each text is for, and whether a scene is that; sentences."""
    if scene.limits is None:
        return []
    out = []
    for name in scene.limits.use:
        text = TEXTS[name]
        outside = "" if _drive_modes(scene) <= set(text["modes"]) else "; this scene is outside its scope"
        out.append(f"{text['source']}: for {text['scope']}{outside}")
    if isinstance(scene, Line) and not scene.moves and all(car.at is not None for car in scene.car):
        out.append("at the given positions of the cars; without `at` each number is that of its worst place")
    return out


def _drive_modes(scene: Scene | Line) -> set[str]:
    if isinstance(scene, Scene):
        return {scene.drive.mode}
    return {car.mode for car in scene.car} if scene.moves else {"rest"}


class _DemandedValues:
    """Values of demands from the numbers of an answer."""

    def __init__(
        self, scene: Scene | Line, limits: Limits, design: Sequence[Row], events: Sequence[Row]
    ) -> None:  # fmt: skip
        self.scene = scene
        self.limits = limits
        self.design = [x for x in design if x["value"] is not None]
        self.events = events
        self.at_rest = isinstance(scene, Line) and not scene.moves
        self.span = scene.supports.span if isinstance(scene, Scene) else _longest_span(scene)

    def values_for_rule(self, rule: Row) -> list[Value]:
        """Values that a rule is for, one for each obstacle of a clearance; unknown ones say why."""
        demand = rule["demand"]
        if demand == "clearance":
            return list(self._clearances(rule))
        found = getattr(self, f"_{demand}", lambda: None)()
        return [unknown_value(DEMANDS[demand][3]) if found is None else found]

    def _numbers_of_kind(self, kind: str) -> list[Value]:
        """Numbers of a kind; a line at rest is exact without a bar."""
        rows = [x for x in self.design if x["quantity"].partition(":")[0] == kind]
        default = 0.0 if self.at_rest else math.inf
        return [Value(x["value"], default if x["bar"] is None else x["bar"], x["quantity"]) for x in rows]

    def _largest(self, kind: str) -> Value | None:
        return max(self._numbers_of_kind(kind), key=lambda x: x.value, default=None)

    def _smallest(self, kind: str) -> Value | None:
        return min(self._numbers_of_kind(kind), key=lambda x: x.value, default=None)

    def _safety_factor(self) -> Value | None:
        load = self.scene.cable.breaking_load
        return _ratio_with_bar(None if load is None else Value(load), self._largest("tension_max"))

    def _tension_over_contact(self) -> Value | None:
        """Smallest tension over largest contact force."""
        return _ratio_with_bar(self._smallest("tension_min"), self._largest("contact_max"))

    def _tension_over_wheel(self) -> Value | None:
        return self._smallest("tension_over_wheel_min")

    def _sag_growth(self) -> Value | None:
        moving = self._largest("sag_car_max")
        growth = _ratio_with_bar(moving, self._largest("sag_car_rest"))
        return None if growth is None else Value(growth.value - 1.0, growth.bar)

    def _swing_along(self) -> Value | None:
        """Tangent of the largest swing of a cabin to either side."""
        largest = max(
            [*self._numbers_of_kind("swing_max"), *self._numbers_of_kind("swing_min")],
            key=lambda x: abs(x.value),
            default=None,
        )
        if largest is None:
            return None
        tangent = math.tan(math.radians(abs(largest.value)))
        return Value(tangent, math.radians(largest.bar) * (1.0 + tangent**2))

    def _arrival_speed(self) -> Value | None:
        event = next((x for x in self.events if x["event"] in ("brake", "arrival")), None)
        if event is None:
            return None
        bar = event.get("bar_speed")
        return Value(event["speed"], math.inf if bar is None else bar)

    def _knee_empty(self) -> Value | None:
        return self._smallest("knee_empty_min")

    def _knee_loaded(self) -> Value | None:
        inner = [x for x in self._numbers_of_kind("knee_max") if x.of != self._last_knee]
        return max(inner, key=lambda x: x.value, default=None)

    def _knee_last(self) -> Value | None:
        return next((x for x in self._numbers_of_kind("knee_max") if x.of == self._last_knee), None)

    @property
    def _last_knee(self) -> str:
        return f"knee_max:{self.scene.contact[-2].name}" if isinstance(self.scene, Line) else ""

    def _acceleration(self) -> Value | None:
        return self._largest("acceleration_max")

    def _deceleration(self) -> Value | None:
        return self._largest("deceleration_max")

    def _speed(self) -> Value | None:
        return self._largest("speed_max")

    def _clearances(self, rule: Row) -> Iterator[Value]:
        grounds = {o.name: o.kind for o in self.scene.obstacle}
        if self.scene.ground:
            grounds[GROUND] = self.limits.ground
        for name, kind in grounds.items():
            key = "limits.ground" if name == GROUND else f"obstacle.{name}.kind"
            if "kind" in rule and kind is None:
                yield Value(math.nan, of=name, why=f"give {key}")
            elif rule.get("kind", kind) == kind:
                yield min(
                    self._clearances_over(name), key=lambda x: x.value, default=unknown_value(DEMANDS["clearance"][3])
                )

    def _clearances_over(self, name: str) -> list[Value]:
        """Clearances over an obstacle or the ground, of rope and cars."""
        out = []
        for kind in {x["quantity"].partition(":")[0] for x in self.design}:
            for value in self._numbers_of_kind(kind) if kind.startswith("clearance") else ():
                if value.of.partition(":")[2].split(" over ")[-1] == name:
                    out.append(Value(value.value, value.bar, name))
        return out


def _ratio_with_bar(above: Value | None, below: Value | None) -> Value | None:
    if above is None or below is None:
        return None
    value = above.value / below.value
    return Value(value, abs(above.bar / below.value) + abs(value * below.bar / below.value))


def _longest_span(line: Line) -> float:
    places = [contact.at[0] for contact in line.contact]
    return max(b - a for a, b in itertools.pairwise(places))
