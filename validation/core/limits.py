"""Verdicts on limits: a demand, the computed value with its bar, and on which side of the limit they lie.

A limit within the bar is "too close to tell".
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

from cablefem.scene import Scene
from cablefem.scene.limits import DEMANDS, TEXTS, Limits
from cablefem.scene.line import Line
from cablefem.scene.surroundings import GROUND

MET = "met"
NOT_MET = "not met"
TOO_CLOSE = "too close to tell"
Row = dict[str, Any]


class ValueWithBar(NamedTuple):
    """A computed value with its bar, of equal values the wider one is the larger; nan: unknown, and why."""

    value: float
    bar: float = 0.0
    subject: str = ""  # the design number or obstacle that it belongs to
    why: str = ""


def _smallest_then_widest(number: ValueWithBar) -> tuple[float, float]:
    return number.value, -number.bar


def unknown_value(why: str) -> ValueWithBar:
    return ValueWithBar(math.nan, why=why)


def limit_rows(scene: Scene | Line, design: Sequence[Row], events: Sequence[Row] = ()) -> list[Row]:
    """One row for each limit of a scene; none without [limits].

    design, events : numbers of an answer with their bars; an unknown bar leaves the verdict open.
    """
    if scene.limits is None:
        return []
    values = _ComputedDemandValues(scene, scene.limits, design, events)
    out: list[Row] = []
    open_rows = set()  # of each text one row for what cannot be judged
    for rule in scene.limits.applicable_rules(values.span):
        words, side, unit, _ = DEMANDS[rule["demand"]]
        for value in values.values_for_rule(rule):
            verdict = _limit_verdict(value, rule["limit"], side)
            row = {
                "demand": words.format(value.subject), "source": rule["source"], "side": side, "limit": rule["limit"],
                "value": None if math.isnan(value.value) else value.value,
                "bar": value.bar if math.isfinite(value.bar) else None, "unit": unit, "verdict": verdict,
            }  # fmt: skip
            key = (rule["text"], row["demand"], verdict)
            if row["value"] is not None or key not in open_rows:
                out.append(row)
                open_rows.add(key)
    return out


def _limit_verdict(value: ValueWithBar, limit: float, side: str) -> str:
    """Met, not met, too close to tell, or why it cannot be judged; side : "at least" or "at most"."""
    if math.isnan(value.value):
        return value.why if value.why.startswith("not computed") else f"cannot be judged: {value.why}"
    room = value.value - limit if side == "at least" else limit - value.value
    if abs(room) < value.bar or math.isinf(value.bar):
        return TOO_CLOSE
    return MET if room >= 0.0 else NOT_MET


def first_brake_or_arrival(events: Sequence[Row]) -> Row | None:
    """The event at which a rider comes to a brake, else to the end; None: to neither."""
    return next((x for x in events if x["event"] in ("brake", "arrival")), None)


def worst_judged_row(rows: Sequence[Row]) -> Row | None:
    """The first row that is not met, else that is too close, else that is met; None if none could be judged."""
    for verdict in (NOT_MET, TOO_CLOSE, MET):
        for row in rows:
            if row["verdict"] == verdict:
                return row
    return None


def worst_limit_columns(rows: Sequence[Row]) -> Row:
    """Columns of a table of scenes: the worst verdict, and its limit; none without limits."""
    if not rows:
        return {}
    worst = worst_judged_row(rows)
    if worst is None:
        return {"limits_met": "cannot be judged", "limits_worst": rows[0]["demand"]}
    return {"limits_met": worst["verdict"], "limits_worst": f"{worst['demand']} ({worst['source']})"}


def any_limit_not_surely_met(rows: Sequence[Row]) -> bool:
    """Whether a limit is not met, or too close to tell."""
    return any(row["verdict"] in (NOT_MET, TOO_CLOSE) for row in rows)


def any_scene_may_break_limits(rows: Sequence[Row]) -> bool:
    """Whether a row of a table of scenes has a limit that is not met, or too close to tell."""
    return any(row.get("limits_met") in (NOT_MET, TOO_CLOSE) for row in rows)


def limit_scope_sentences(scene: Scene | Line) -> list[str]:
    """What each text is for, and whether a scene is that; sentences."""
    if scene.limits is None:
        return []
    out = []
    for name in scene.limits.use:
        text = TEXTS[name]
        inside = any(modes <= set(text["modes"]) for modes in _drive_modes(scene))
        outside = "" if inside else "; this scene is outside its scope"
        out.append(f"{text['source']}: for {text['scope']}{outside}")
    if isinstance(scene, Line) and scene.car and not scene.moves:
        out.append("at the positions in positions.csv; a single car without `at` is also where each number is worst")
    return out


def _drive_modes(scene: Scene | Line) -> list[set[str]]:
    """Drive modes of all cars; of a line at rest also "rest", for texts on that alone."""
    if isinstance(scene, Scene):
        return [{scene.drive.mode}]
    if scene.moves:
        return [{car.mode for car in scene.car}]
    of_cars = {"haul" if car.hauled else "grip" for car in scene.car}
    return [{"rest"}, of_cars] if of_cars else [{"rest"}]


class _ComputedDemandValues:
    """Values that demands limit, from the numbers of an answer."""

    def __init__(self, scene: Scene | Line, limits: Limits, design: Sequence[Row], events: Sequence[Row]) -> None:
        self.scene = scene
        self.limits = limits
        self.events = events
        self.at_rest = isinstance(scene, Line) and not scene.moves
        self.span = scene.supports.span if isinstance(scene, Scene) else _longest_span(scene)
        self.numbers: dict[str, list[ValueWithBar]] = {}  # of the design, by kind
        for x in design:
            if x["value"] is not None:
                unknown = 0.0 if self.at_rest else math.inf  # bar of a number without one
                number = ValueWithBar(x["value"], unknown if x["bar"] is None else x["bar"], x["quantity"])
                self.numbers.setdefault(x["quantity"].partition(":")[0], []).append(number)

    def values_for_rule(self, rule: Row) -> list[ValueWithBar]:
        """Values that a rule is for, one for each obstacle of a clearance; unknown ones say why."""
        demand = rule["demand"]
        if demand == "clearance":
            return list(self._smallest_clearances(rule))
        value = None
        if demand in NUMBERS:
            extreme = self._smallest if DEMANDS[demand][1] == "at least" else self._largest
            value = extreme(NUMBERS[demand])
        elif demand in COMPUTED:
            value = COMPUTED[demand](self)
        if value is None:
            only_in_motion = self.at_rest and demand in ONLY_IN_MOTION
            value = unknown_value("not computed: only in motion" if only_in_motion else DEMANDS[demand][3])
        return [value]

    def _largest(self, kind: str) -> ValueWithBar | None:
        return max(self.numbers.get(kind, ()), default=None)

    def _smallest(self, kind: str) -> ValueWithBar | None:
        return min(self.numbers.get(kind, ()), key=_smallest_then_widest, default=None)

    def safety_factor(self) -> ValueWithBar | None:
        """Breaking load over largest tension."""
        load = self.scene.cable.breaking_load
        return _ratio_with_error_bar(None if load is None else ValueWithBar(load), self._largest("tension_max"))

    def tension_over_contact(self) -> ValueWithBar | None:
        """Smallest tension over largest contact force."""
        return _ratio_with_error_bar(self._smallest("tension_min"), self._largest("contact_max"))

    def sag_growth(self) -> ValueWithBar | None:
        """How much larger the largest sag at the car is in motion than at rest."""
        moving = self._largest("sag_car_max")
        growth = _ratio_with_error_bar(moving, self._largest("sag_car_rest"))
        return None if growth is None else ValueWithBar(growth.value - 1.0, growth.bar)

    def swing_tangent(self) -> ValueWithBar | None:
        """Tangent of the largest swing of a cabin to either side."""
        swings = [x for kind in ("swing_max", "swing_min") for x in self.numbers.get(kind, ())]
        if not swings:
            return None
        largest = max(swings, key=lambda x: (abs(x.value), x.bar))
        tangent = math.tan(math.radians(abs(largest.value)))
        return ValueWithBar(tangent, math.radians(largest.bar) * (1.0 + tangent**2))

    def speed_at_brake_or_arrival(self) -> ValueWithBar | None:
        """Speed at the first of these events."""
        event = first_brake_or_arrival(self.events)
        if event is None:
            return None
        bar = event.get("bar_speed")
        return ValueWithBar(event["speed"], math.inf if bar is None else bar)

    def largest_knee(self, at_last_support: bool) -> ValueWithBar | None:
        """Largest knee at the last contact before the end, or at the others."""
        last = f"knee_max:{self.scene.contact[-2].name}" if isinstance(self.scene, Line) else ""
        knees = [x for x in self.numbers.get("knee_max", ()) if (x.subject == last) is at_last_support]
        return max(knees, default=None)

    def _smallest_clearances(self, rule: Row) -> Iterator[ValueWithBar]:
        """The smallest clearance over each obstacle, and the ground, of the rule's kind; unknown where none is."""
        grounds = {o.name: o.kind for o in self.scene.obstacle}
        if self.scene.ground:
            grounds[GROUND] = self.limits.ground
        if not grounds:
            yield ValueWithBar(math.nan, subject="obstacles", why="give obstacles, or the ground")
        for name, kind in grounds.items():
            key = "limits.ground" if name == GROUND else f"obstacle.{name}.kind"
            if "kind" in rule and kind is None:
                yield ValueWithBar(math.nan, subject=name, why=f"give {key}")
            elif rule.get("kind", kind) == kind:
                unknown = unknown_value(DEMANDS["clearance"][3])
                yield min(self._clearances_over(name), key=_smallest_then_widest, default=unknown)

    def _clearances_over(self, name: str) -> Iterator[ValueWithBar]:
        """Clearances over an obstacle or the ground, of rope and cars."""
        for kind, numbers in self.numbers.items():
            for x in numbers if kind.startswith("clearance") else ():
                if x.subject.partition(":")[2].split(" over ")[-1] == name:
                    yield x._replace(subject=name)


ONLY_IN_MOTION = ("tension_over_wheel", "swing_along", "arrival_speed")
# demands and what answers them: the kind of design number whose extreme counts, or a value computed from some
NUMBERS = {
    "acceleration": "acceleration_max", "deceleration": "deceleration_max", "speed": "speed_max",
    "tension_over_wheel": "tension_over_wheel_min", "knee_empty": "knee_empty_min",
}  # fmt: skip
COMPUTED: dict[str, Callable[[_ComputedDemandValues], ValueWithBar | None]] = {
    "safety_factor": _ComputedDemandValues.safety_factor,
    "tension_over_contact": _ComputedDemandValues.tension_over_contact,
    "sag_growth": _ComputedDemandValues.sag_growth,
    "swing_along": _ComputedDemandValues.swing_tangent,
    "arrival_speed": _ComputedDemandValues.speed_at_brake_or_arrival,
    "knee_loaded": partial(_ComputedDemandValues.largest_knee, at_last_support=False),
    "knee_last": partial(_ComputedDemandValues.largest_knee, at_last_support=True),
}


def _ratio_with_error_bar(numerator: ValueWithBar | None, denominator: ValueWithBar | None) -> ValueWithBar | None:
    """The ratio, with the bars of both; None if one is unknown."""
    if numerator is None or denominator is None:
        return None
    value = numerator.value / denominator.value
    bar = abs(numerator.bar / denominator.value) + abs(value * denominator.bar / denominator.value)
    return ValueWithBar(value, bar)


def _longest_span(line: Line) -> float:
    x = [contact.at[0] for contact in line.contact]
    return max(b - a for a, b in itertools.pairwise(x))
