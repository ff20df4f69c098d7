"""Conditions on an answer: NAME <= NUMBER UNIT, outcome = KIND and limits met, joined by `and`."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cablefem.response import Response
from cablefem.scene import Scene
from cablefem.scene.errors import did_you_mean
from validation.core.answers import LINE_OUTCOMES, ONE_SPAN_OUTCOMES, Outcome, outcome_of_run
from validation.core.design import DEPTHS
from validation.core.limits import MET, first_brake_or_arrival, limit_rows, worst_judged_row, worst_limit_columns
from validation.core.quantities import limit_row_texts
from validation.core.scene_data import conversion_factor_or_nan
from validation.core.store import Refused
from validation.page.answer import EVENTS

_CLAUSE = re.compile(r"([A-Za-z][\w.: -]*?)\s*(<=|>=|<|>|=)\s*(-?[\d.]+(?:e[+-]?\d+)?|[a-z_]+)\s*(\S*)")
_EXTREME = re.compile(r"_(min|max)(?=\.|$)")
FORMS = "NAME <= NUMBER UNIT, NAME >= NUMBER UNIT, outcome = KIND, limits met"
UNITS = {"t": "s", "s_o": "m", "speed": "m/s"}  # of an event
LIMITS = "limits met"
BRAKE_OR_ARRIVAL = "brake_or_arrival"  # the first of both events, as the limit arrival_speed and tables of runs have it
EVENT_NAMES = (*EVENTS, BRAKE_OR_ARRIVAL)
Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Number:
    value: float
    bar: float | None
    unit: str


@dataclass(frozen=True, slots=True)
class Answer:
    """What is known of a scene: its outcome in a word and a sentence, numbers by name, worst limit.

    Of a scene that cannot be computed the sentence says why.
    """

    kind: str
    sentence: str
    numbers: dict[str, Number]
    limits: str = ""
    worst_limit: str = ""  # with its value; empty: none could be judged

    @classmethod
    def from_rows(
        cls, outcome: Outcome, design: Sequence[Row], events: Sequence[Row], limits: Sequence[Row]
    ) -> "Answer":
        """Names as in summary.json with `.` for `:`, or the kind alone for the extreme of all; of events the first.

        `brake_or_arrival` is the first of these two events.
        Where there is one extreme, `_min` or `_max` may be left out.
        """
        numbers = _numbers_of_design(design) | _numbers_of_events(events)
        worst = worst_judged_row(limits)
        verdict = worst_limit_columns(limits).get("limits_met", "")
        return cls(outcome.kind, outcome.sentence, numbers, verdict, "" if worst is None else _limit_sentence(worst))


def answer_of_run(scene: Scene, r: Response) -> Answer:
    """The answer that a run of one span gives."""
    judged = limit_rows(scene, r.design, r.events)
    return Answer.from_rows(outcome_of_run(scene, r), r.design, r.events, judged)


def _numbers_of_design(design: Sequence[Row]) -> dict[str, Number]:
    """Known design numbers by name, by kind, and without an extreme that is the only one."""
    numbers: dict[str, Number] = {}
    for row in design:
        if row["value"] is not None:
            number = Number(row["value"], row["bar"], row["unit"])
            kind = row["quantity"].partition(":")[0]
            pick = max if kind.endswith("_max") else min
            numbers[_colons_to_dots(row["quantity"])] = number
            numbers[kind] = pick(number, numbers.get(kind, number), key=lambda x: x.value)
    short = [_EXTREME.sub("", name) for name in numbers]
    for name, brief in zip(list(numbers), short, strict=True):
        if short.count(brief) == 1:
            numbers[brief] = numbers[name]
    return numbers


def _numbers_of_events(events: Sequence[Row]) -> dict[str, Number]:
    """Numbers of the first event of each kind, and of the first that is a brake or the arrival."""
    named = {event["event"]: event for event in reversed(events)}
    first = first_brake_or_arrival(events)
    if first is not None:
        named[BRAKE_OR_ARRIVAL] = first
    numbers = {}
    for event_name, event in named.items():
        for name, unit in UNITS.items():
            numbers[f"{event_name}.{name}"] = Number(event.get(name, math.nan), event.get(f"bar_{name}"), unit)
    return numbers


def _limit_sentence(row: Row) -> str:
    """As "top speed 5.1 ± 0.1 m/s = 18.4 ± 0.4 km/h, at most 4 m/s = 14 km/h (the scene): not met"."""
    text = limit_row_texts(row)
    return f"{text['limit']} {text['value']}, {text['demanded']} ({text['by']}): {text['verdict']}"


def _colons_to_dots(name: str) -> str:
    """As `clearance_car.tree` for `clearance_car:tree`."""
    return name.replace(":", ".").rstrip(".")


@dataclass(frozen=True, slots=True)
class Clause:
    """One part of a condition."""

    text: str
    name: str
    sign: float = 0.0  # +1: at least, -1: at most, 0: words
    right: str = ""
    unit: str = ""

    @property
    def needs_events_only(self) -> bool:
        """Whether events or the outcome decide it, without design numbers."""
        return self.name == "outcome" or self.name.partition(".")[0] in EVENT_NAMES

    @property
    def is_about_limits(self) -> bool:
        """Whether all limits must be met: error bars decide it, for within a bar a limit is too close to tell."""
        return self.text == LIMITS

    def number_in(self, answer: Answer) -> Number | None:
        """The number that the clause names; None: the answer has none of this name."""
        return answer.numbers.get(self.name)

    def limit_in_unit_or_refused(self, si_unit: str) -> float:
        """The limit in an SI unit; Refused for one that does not fit."""
        factor = conversion_factor_or_nan(self.unit, si_unit)
        if math.isnan(factor):
            raise Refused(f"--so-that {self.text}: unit {self.unit!r}; {self.name} is in {si_unit or 'no unit'}")
        return float(self.right) * factor

    def value_in(self, answer: Answer) -> float | str | None:
        """What the clause looks at, in SI or in words; None: it is not known."""
        if self.sign:
            number = self.number_in(answer)
            return None if number is None else number.value
        return answer.limits if self.is_about_limits else answer.kind

    def margin(self, answer: Answer) -> float:
        """By how much the clause holds, in SI, 0 for words; negative: it does not; nan: words do not, or no number."""
        if not self.sign:
            return 0.0 if self.value_in(answer) == (MET if self.is_about_limits else self.right) else math.nan
        number = self.number_in(answer)
        return math.nan if number is None else self.sign * (number.value - self.limit_in_unit_or_refused(number.unit))


def parse_condition(condition: str) -> list[Clause]:
    """The clauses of a condition; Refused shows the part that cannot be read."""
    return [_parse_clause(part.strip()) for part in re.split(r"\band\b", condition)]


def _parse_clause(text: str) -> Clause:
    if text == LIMITS:
        return Clause(text, "")
    match = _CLAUSE.fullmatch(text)
    words = match is not None and match[3].isidentifier()
    if match is None or words is not (match[1] == "outcome" and match[2] == "="):
        raise Refused(f"--so-that: cannot read {text!r}; must be {FORMS}")
    if words:
        kinds = dict.fromkeys((*ONE_SPAN_OUTCOMES, *LINE_OUTCOMES))
        if match[3] not in kinds:
            raise Refused(f"--so-that {text}: unknown kind of outcome.{did_you_mean(match[3], kinds)}")
        return Clause(text, "outcome", right=match[3])
    if match[2] == "=":
        raise Refused(f"--so-that: cannot read {text!r}; numbers are compared by <= or >=")
    return Clause(text, _colons_to_dots(match[1]), 1.0 if match[2][0] == ">" else -1.0, match[3], match[4])


def refuse_depth_largest_at_end_of_range(clauses: Sequence[Clause], answer: Answer, where: str) -> None:
    """Refused for a depth that an answer lacks because its largest value is at an end, so that its extreme is unknown.

    where : the value of the key, in words.
    """
    for clause in clauses:
        if clause.name in DEPTHS and answer.numbers and clause.number_in(answer) is None:
            raise Refused(
                f"--so-that {clause.text}: {where} the deepest place is an end of the rope or of what is computed, and "
                f"{clause.name} has no value; must be clearance_rope or clearance_car, over ground or an obstacle there"
            )


def refuse_uncheckable_clauses(clauses: Sequence[Clause], answers: Sequence[Answer], events: Sequence[str]) -> None:
    """Refused for a name that no answer knows and no event has, a unit that does not fit, and limits without any.

    events : names that answers may have, if not at these values.
    """
    limited = any(answer.limits for answer in answers)
    if not limited and any(clause.is_about_limits for clause in clauses):
        raise Refused(f"--so-that {LIMITS}: none are given; must be in [limits] or by --limits")
    for clause in clauses:
        if clause.sign:
            _refuse_unknown_name_or_unit(clause, answers, events)


def _refuse_unknown_name_or_unit(clause: Clause, answers: Sequence[Answer], events: Sequence[str]) -> None:
    """Refused for an unknown name, and a unit that does not fit."""
    names = {name for answer in answers for name in answer.numbers}
    known = _known_names(clause.name, names, events)
    if names and clause.name not in names | known:
        raise Refused(f"--so-that {clause.text}: unknown name.{did_you_mean(clause.name, sorted(known))}")
    for number in map(clause.number_in, answers):
        if number is not None:
            clause.limit_in_unit_or_refused(number.unit)


def _known_names(name: str, names: set[str], events: Sequence[str]) -> set[str]:
    """Of a known kind all names of that kind, else all kinds and numbers of events."""
    kind, dot, _ = name.partition(".")
    of_kind = {name for name in names if name.startswith(f"{kind}.")}
    if dot and of_kind:
        return of_kind
    kinds = {name.partition(".")[0] for name in names} - set(events)
    return kinds | {f"{event}.{name}" for event in events for name in UNITS}
