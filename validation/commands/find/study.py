"""The largest or smallest value of one key of a scene for which a condition holds.

Some runs over the range bracket each change; bisection narrows it, and a check judges the answer.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.response import write_json
from cablefem.scene import Scene, SceneError
from cablefem.scene.errors import short_text
from cablefem.scene.keys import unit_of_key
from cablefem.scene.line import Line
from cablefem.scene.short import load_line_or_none
from validation.commands.find.condition import (
    EVENT_NAMES,
    Answer,
    Clause,
    Row,
    answer_of_run,
    parse_condition,
    refuse_depth_largest_at_end_of_range,
    refuse_uncheckable_clauses,
)
from validation.core import store
from validation.core.answers import outcome_of_run
from validation.core.quantities import text_with_error_bar
from validation.core.sidebyside import Progress, no_progress
from validation.core.store import Refused
from validation.page.answer.many import write_csv_rows

if TYPE_CHECKING:
    from validation.commands.run.lines import LineAnswers

BRACKETS = 8  # parts of the range that are looked at
HALVINGS = 12  # of a part in which the condition changes, at most
FAILED = "failed"  # kind of an answer that could not be computed


@dataclass(frozen=True, slots=True)
class Threshold:
    """Value of the key at which a condition changes: the answer, neighbours that hold and fail, and how sure it is."""

    value: float
    holds_at: float
    fails_at: float
    fails: str  # what happens there
    bar: float | None = None  # of the key; None: unknown, or as wide as the range
    verdict: str = ""  # of the check
    unit: str = ""
    search_model: str = ""  # in words
    # index among the rooms of the number that decides, that number at `holds_at`, its bar
    checked: tuple[int, float, float | None] | None = None

    @property
    def interval_width(self) -> float:
        """Distance of both neighbours: what bisection left open."""
        return abs(self.fails_at - self.holds_at)

    @property
    def sentence(self) -> str:
        """The answer with its bar, what happens beyond it, and what the check says."""
        side, beyond = ("at most", "above") if self.fails_at > self.holds_at else ("at least", "below")
        sure = f"the check: {self.verdict}" if self.verdict else f"by {self.search_model} alone"
        if self.bar is None and (self.verdict or self.checked):
            text = f"about {float(f'{self.value:.2g}'):g}"
            sure += ", but its error bar leaves no digit of that"
        else:
            text = text_with_error_bar(self.value, self.interval_width if self.bar is None else self.bar)
            sure += "" if self.bar is not None else ", whose own error is not known"
        return f"{side} {f'{text} {self.unit}'.rstrip()}; {beyond}: {self.fails}; {sure}"


@dataclass(frozen=True)
class FindResult:
    """The answer to an inverse question."""

    key: str
    condition: str
    changes: list[Threshold]
    tried_rows: list[Row] = field(default_factory=list)  # values, whether the condition holds, what happens
    interrupted: bool = False

    @property
    def value(self) -> float | None:
        """The answer; None where the condition never changes."""
        return self.changes[0].value if self.changes else None

    @property
    def answered(self) -> bool:
        return bool(self.changes)

    @property
    def sentence(self) -> str:
        """All values at which the condition changes, or that it never does."""
        if self.interrupted:
            between = [
                f"between {a['value']:.6g} and {b['value']:.6g}"
                for a, b in itertools.pairwise(self.tried_rows) if a["holds"] is not b["holds"]
            ]  # fmt: skip
            return f"{self.key}: interrupted; {self.condition} changes {' and '.join(between) or 'nowhere so far'}"
        if not self.changes:
            always = "everywhere" if self.tried_rows[0]["holds"] else "nowhere"
            ends = "; ".join(
                f"at {x['value']:g}: {_outcome_and_failure_text(x)}" for x in (self.tried_rows[0], self.tried_rows[-1])
            )
            return f"{self.key}: {self.condition} holds {always} in the range; {ends}"
        many = f" (it changes {len(self.changes)} times)" if len(self.changes) > 1 else ""
        return f"{self.key}{many}: " + "; and ".join(change.sentence for change in self.changes)

    def write(self, folder: Path) -> None:
        write_json(folder / "find.json", store.nulls_for_nonfinite(self.to_json()))

    def to_json(self) -> Row:
        """Content of find.json."""
        names = ("value", "bar", "holds_at", "fails_at", "fails", "verdict", "unit", "checked")
        changes = [{name: getattr(change, name) for name in names} for change in self.changes]
        first = changes[0] if changes else dict.fromkeys(names)
        content: Row = {"key": self.key}
        content |= {name: first[name] for name in ("value", "bar", "holds_at", "fails_at")}
        content |= {"condition": self.condition, "sentence": self.sentence, "changes": changes}
        content |= {"evaluations": self.tried_rows, "check": first["verdict"]}
        return content


@dataclass(frozen=True)
class Curve:
    """Answers for values of another key: rows of that value, of the key's with its bar or None, of the answer."""

    other: str
    key: str
    units: tuple[str, str]  # of the other key and of the key
    rows: list[Row]
    interrupted: bool = False

    @property
    def answered(self) -> bool:
        """Whether any value of the other key has an answer."""
        return any(row["value"] is not None for row in self.rows)

    @property
    def sentence(self) -> str:
        return "\n".join(f"{self.other} = {row['at']}: {row['answer']}" for row in self.rows)

    def write(self, folder: Path) -> None:
        names = {"at": self.other, "value": self.key, "bar": "bar", "answer": "answer"}
        write_csv_rows(folder / "find.csv", [{names[name]: x for name, x in row.items()} for row in self.rows])
        other_unit, unit = self.units
        content = {"for": self.other, "key": self.key, "for_unit": other_unit, "unit": unit, "rows": self.rows}
        write_json(folder / "find.json", content)


def find(
    scene_or_line: Scene | Line | str | Path, keys: Mapping[str, Sequence[float]], *, so_that: str,
    model: str = "quasi-static", all_of: Mapping[str, Sequence[Any]] | None = None, check: bool = True,
    progress: Progress = no_progress,
) -> FindResult:  # fmt: skip
    """The value of one key, from low to high, at which a condition begins or ceases to hold.

    scene_or_line : or a built-in name, or a file.
    so_that : as "outcome = arrives and clearance_car.tree >= 1.5 m"; names as in summary.json.
    model : of the search, quasi-static or full; a line has one model.  all_of : the condition must hold for each value.
    check : both solvers run at the answer; their number gives the bar of the key, else that of the model.
    Ctrl-C raises Interrupted, whose `found` has what was computed.
    find("zipline", {"mass.mass": (40.0, 200.0)}, so_that="arrival.speed <= 16 km/h")
    """
    scene = scene_or_line
    if not isinstance(scene, Scene | Line):
        scene = load_line_or_none(scene) or Scene.load(scene)
    key, low, high = _one_key_and_range_or_refused(keys)
    _refuse_bad_arguments(so_that, model, all_of)
    search = _Search(scene, key, parse_condition(so_that), model, all_of or {}, progress, high - low)
    values = [low + (high - low) * i / BRACKETS for i in range(BRACKETS + 1)]
    changes: list[Threshold] = []
    try:
        search.refuse_uncheckable_condition([low, high])
        within = [search.value_between_where_it_holds(a, b) for a, b in itertools.pairwise(values)]
        values = sorted([*values, *(value for value in within if value is not None)])
        for a, b in itertools.pairwise(values):
            if search.condition_holds_at(a) is not search.condition_holds_at(b):
                changes.append(search.bisect_threshold(a, b))
        changes = [search.with_error_bar_and_verdict(threshold, check) for threshold in changes]
    except KeyboardInterrupt:
        raise Interrupted(FindResult(key, so_that, changes, search.tried_rows(), interrupted=True)) from None
    return FindResult(key, so_that, changes, search.tried_rows())


def _outcome_and_failure_text(tried: Mapping[str, Any]) -> str:
    """What happens at a value that was tried, and what does not hold there."""
    if not tried["fails"] or tried["fails"] == tried["outcome"]:
        return str(tried["outcome"])
    if tried["outcome"] in tried["fails"]:
        return str(tried["fails"])
    return f"{tried['outcome']} ({tried['fails']})"


def _one_key_and_range_or_refused(keys: Mapping[str, Sequence[float]]) -> tuple[str, float, float]:
    try:
        ((key, (low, high)),) = keys.items()
    except (AttributeError, TypeError, ValueError):
        raise Refused(
            f"keys = {short_text(keys)}: must be one key and its range, as {{'mass.mass': (40, 200)}}"
        ) from None
    for end in (low, high):
        if isinstance(end, bool) or not isinstance(end, Real) or not math.isfinite(end):
            raise Refused(f"{key} = {short_text(end)}: must be a finite number")
    if not low < high:
        raise Refused(f"{key} = {low:g}:{high:g}: LOW must be below HIGH")
    return key, low, high


def _refuse_bad_arguments(so_that: object, model: object, all_of: object) -> None:
    """Raise Refused for a condition that is no text, an unknown model, and values that are no lists."""
    if not isinstance(so_that, str):
        raise Refused(f"so_that = {short_text(so_that)}: must be a text, as 'tension_max <= 18 kN'")
    if model not in ("quasi-static", "full"):
        raise Refused(f"model = {short_text(model)}: must be quasi-static or full")
    lists = all_of.values() if isinstance(all_of, Mapping) else [] if all_of is None else [None]
    if any(not isinstance(values, list | tuple | np.ndarray) for values in lists):
        raise Refused(f"all_of = {short_text(all_of)}: must map dotted keys to lists of values")


class Interrupted(KeyboardInterrupt):
    """A search that was interrupted; `found` is what it had computed."""

    def __init__(self, result: FindResult | Curve) -> None:
        super().__init__()
        self.found = result


@dataclass
class _Search:
    """Answers at values of one key, each computed once, and whether the condition holds there."""

    scene: Any
    key: str
    clauses: list[Clause]
    model: str
    all_of: Mapping[str, Sequence[Any]]
    progress: Progress
    width: float  # of the range
    answers_by_value: dict[float, list[Answer]] = field(default_factory=dict)

    def scenes_at(self, value: float) -> list[Any]:
        """Scenes at a value of the key, one for each combination of `all_of`."""
        scenes = []
        for combination in itertools.product(*self.all_of.values()):
            changes = dict(zip(self.all_of, combination, strict=True))
            scenes.append(self.scene.replace({self.key: value, **changes}))
        return scenes

    def answers_at(self, value: float) -> list[Answer]:
        """Answers at a value of the key; a scene or run that fails says why."""
        if value not in self.answers_by_value:
            try:
                only_events = all(clause.needs_events_only for clause in self.clauses)
                bars = any(clause.is_about_limits for clause in self.clauses)
                self.answers_by_value[value] = [
                    answer_by_model(scene, self.model, only_events, bars=bars) for scene in self.scenes_at(value)
                ]
            except (SceneError, Refused, ArithmeticError) as error:
                self.answers_by_value[value] = [Answer(FAILED, str(error).splitlines()[0], {})]
            for answer in self.answers_by_value[value]:
                refuse_depth_largest_at_end_of_range(self.clauses, answer, f"at {self.key} = {value:.6g}")
            done = len(self.answers_by_value) / (BRACKETS + HALVINGS + 1.0)
            self.progress(f"{self.key} = {value:.6g}", min(0.9, done))
        return self.answers_by_value[value]

    def tried_rows(self) -> list[Row]:
        """What happens at each value that was tried."""
        rows = []
        for value, answers in sorted(self.answers_by_value.items()):
            sentence = "; ".join(dict.fromkeys(answer.sentence for answer in answers))
            read = [[clause.value_in(answer) for clause in self.clauses] for answer in answers]
            holds = self.condition_holds_at(value)
            fails = "" if holds else self._unmet_condition_text(value)
            rows.append({"value": value, "holds": holds, "outcome": sentence, "fails": fails, "read": read})
        return rows

    def refuse_uncheckable_condition(self, range_ends: Sequence[float]) -> None:
        """Refused where no end has an answer, or the condition names what their answers do not know."""
        answers = [answer for value in range_ends for answer in self.answers_at(value)]
        if all(answer.kind == FAILED for answer in answers):
            fault = answers[0].sentence
            raise Refused(fault if fault.startswith((f"{self.key} ", f"{self.key}:")) else f"{self.key}: {fault}")
        refuse_uncheckable_clauses(self.clauses, answers, () if isinstance(self.scene, Line) else EVENT_NAMES)

    def margins_at(self, value: float) -> list[float]:
        """Margin of each clause in each answer, see `Clause.margin`; those of an answer follow one another."""
        return [clause.margin(answer) for answer in self.answers_at(value) for clause in self.clauses]

    def condition_holds_at(self, value: float) -> bool:
        return all(room >= 0.0 for room in self.margins_at(value))

    def value_between_where_it_holds(self, a: float, b: float) -> float | None:
        """A value at which the condition holds, between two at which it fails; None: none was found.

        Looked for where a part of the condition begins or ceases to hold or to have a number: a rider who is ever
        slower on arrival no longer arrives at all.
        """
        if self.condition_holds_at(a) or self.condition_holds_at(b):
            return None
        at_ends = zip(self._known_and_holding_at(a), self._known_and_holding_at(b), strict=False)
        for i, (before, after) in enumerate(at_ends):
            low, high = a, b
            for _ in range(HALVINGS if before != after else 0):
                middle = 0.5 * (low + high)
                if self.condition_holds_at(middle):
                    return middle
                if self._known_and_holding_at(middle)[i : i + 1] == [before]:
                    low = middle
                else:
                    high = middle
        return None

    def _known_and_holding_at(self, value: float) -> list[tuple[bool, bool]]:
        """Of each margin, whether it is known and whether it holds."""
        return [(math.isfinite(room), room >= 0.0) for room in self.margins_at(value)]

    def bisect_threshold(self, a: float, b: float) -> Threshold:
        """The threshold between two values, by bisection; of numbers linear in the last interval."""
        holds_at, fails_at = (a, b) if self.condition_holds_at(a) else (b, a)
        narrow = 1e-3  # of a part: numbers are linear in it
        for _ in range(HALVINGS):
            share = self._crossing_share(holds_at, fails_at)
            if math.isfinite(share) and abs(fails_at - holds_at) < narrow * (b - a):
                break
            steps = [0.5] if math.isnan(share) else [share - 0.01, share + 0.01]  # on both sides of the zero of a chord
            for x in [holds_at + step * (fails_at - holds_at) for step in steps if 0.0 < step < 1.0]:
                if self.condition_holds_at(x):
                    holds_at = x
                else:
                    fails_at = x
        share = self._crossing_share(holds_at, fails_at)
        value = holds_at if math.isnan(share) else holds_at + share * (fails_at - holds_at)
        fails = self._unmet_condition_text(fails_at)
        unit = unit_of_key(type(self.scene), self.key)
        one_solver = self.model == "full" or isinstance(self.scene, Line)
        search_model = "one solver" if one_solver else "the quasi-static model"
        return Threshold(value, holds_at, fails_at, fails, unit=unit, search_model=search_model)

    def _crossing_share(self, holds_at: float, fails_at: float) -> float:
        """Where the first number that fails crosses its limit, over the interval; nan where words decide."""
        pairs = zip(self.margins_at(holds_at), self.margins_at(fails_at), strict=False)
        shares = [above / (above - below) for above, below in pairs if below < 0.0 <= above]
        return min(shares, default=math.nan)

    def _unmet_condition_text(self, value: float) -> str:
        """What does not hold at a value: a number beyond its limit, or what happens."""
        count = len(self.clauses)
        i = next(i for i, room in enumerate(self.margins_at(value)) if not room >= 0.0)
        answers = self.answers_at(value)
        answer = answers[min(i // count, len(answers) - 1)]
        clause = self.clauses[i % count]
        if answer.kind == FAILED:
            return answer.sentence
        if clause.is_about_limits:
            return answer.worst_limit or f"no limit can be judged: {answer.sentence}"
        if not clause.sign:
            return answer.sentence
        if clause.number_in(answer) is None:
            return f"there is no {clause.name}: {answer.sentence}"
        return f"{clause.name} {'<' if clause.sign > 0.0 else '>'} {clause.right} {clause.unit}".rstrip()

    def with_error_bar_and_verdict(self, threshold: Threshold, by_check: bool) -> Threshold:
        """The threshold with its bar: that of the number over its slope, or a range that the full model confirms.

        by_check : by both solvers, else by the model of the search, which leaves words without a bar.
        """
        before = self.margins_at(threshold.holds_at)
        after = self.margins_at(threshold.fails_at)
        i, numeric = _deciding_margin(before, after)
        count = len(self.clauses)
        clause = self.clauses[i % count]
        scene = self.scenes_at(threshold.holds_at)[min(i // count, len(before) // count - 1)]
        for answer, verdict in self._answers_with_verdicts(scene, by_check):
            threshold = replace(threshold, verdict=verdict)
            number = clause.number_in(answer) if numeric else None
            if number is None:
                return self._with_error_bar_by_full_model(threshold) if by_check else threshold
            slope = abs(after[i] - before[i]) / threshold.interval_width
            off = abs(clause.margin(answer) - before[i])
            bar = math.inf if number.bar is None else max((off + number.bar) / slope, threshold.interval_width)
            useful = bar < self.width / BRACKETS
            threshold = replace(threshold, bar=bar if useful else None, checked=(i, number.value, number.bar))
            if useful or isinstance(scene, Line):
                break
        return threshold

    def _answers_with_verdicts(self, scene: Any, by_check: bool) -> Iterator[tuple[Answer, str]]:
        """Answers that have bars, with the verdict: of checks, each finer, or of the search without one."""
        if not by_check:
            yield answer_by_model(scene, self.model, bars=True), ""
            return
        tolerances = (5e-3, 1e-3)  # of the path in the check at the answer: finer if its bar is of no use
        for tol in tolerances:
            self.progress("check", 0.95)
            yield checked_answer_and_verdict(scene, tol)

    def _with_error_bar_by_full_model(self, threshold: Threshold) -> Threshold:
        """The threshold with half of a range at whose ends the full model says the same, if one was found."""
        full = replace(self, model="full", answers_by_value={})
        side = math.copysign(1.0, threshold.fails_at - threshold.holds_at)
        widenings = 10  # of the range around an answer in words, until the full model confirms it
        for k in range(widenings):
            half = self.width / 2.0 ** (widenings - k)
            inner, outer = threshold.value - side * half, threshold.value + side * half
            if full.condition_holds_at(inner) and not full.condition_holds_at(outer):
                return replace(threshold, bar=half)
        return threshold


def _deciding_margin(where_it_holds: Sequence[float], where_it_fails: Sequence[float]) -> tuple[int, bool]:
    """Index of the margin that decides a change, and whether it is a number on both sides; else words decide."""
    for i, (held, failed) in enumerate(zip(where_it_holds, where_it_fails, strict=False)):
        if failed < 0.0 <= held:
            return i, True
    return next(i for i, failed in enumerate(where_it_fails) if not failed >= 0.0), False


def answer_by_model(scene: Any, model: str, only_events: bool = False, *, bars: bool) -> Answer:
    """The answer of the model of the search.

    only_events : without design numbers and bars.  bars : of the full model, too.
    """
    if isinstance(scene, Line):
        from validation import run_with_bars

        of_line: Any = run_with_bars(scene)
        return _line_answer(of_line)
    if model == "full":
        from validation import run_with_bars

        r = run_with_bars(scene, bars=bars)
    else:
        from validation.core.design import design_numbers
        from validation.core.quasi_static import quasi_static, with_inertia_error_bars

        r = quasi_static(scene)
        if only_events:
            return Answer.from_rows(outcome_of_run(scene, r), (), r.events, ())
        r = with_inertia_error_bars(scene, replace(r, design=design_numbers(r)))
    return answer_of_run(scene, r)


def _line_answer(numbers: LineAnswers) -> Answer:
    """The answer of a line; at rest a number without a bar is exact."""
    rows = numbers.design
    if not numbers.line.moves:
        rows = [row | {"bar": row["bar"] or 0.0} for row in rows]
    return Answer.from_rows(numbers.outcome, rows, (), numbers.limits)


def checked_answer_and_verdict(scene: Any, path_tol_of_span: float) -> tuple[Answer, str]:
    """The answer of both solvers, and their verdict; path_tol_of_span : a line of several has its own."""
    from validation import check

    if isinstance(scene, Line):
        check_line: Any = check
        of_line = check_line(scene)
        return _line_answer(of_line), of_line.verdict.value
    both = check(scene, tol=path_tol_of_span)
    return answer_of_run(scene, replace(both.a.finest, design=both.design)), both.verdict.value


def find_curve(
    scene: Any, keys: Mapping[str, Sequence[float]], other_key: str, values: Sequence[Any], **how: Any
) -> Curve:
    """Find for each value of another key, by the model of the search; `how` as in `find`."""
    rows: list[Row] = []
    (key,) = keys
    units = (unit_of_key(type(scene), other_key), unit_of_key(type(scene), key))
    for value in values:
        try:
            result = find(scene.replace({other_key: value}), keys, check=False, **how)
        except KeyboardInterrupt:
            raise Interrupted(Curve(other_key, key, units, rows, interrupted=True)) from None
        bar = result.changes[0].bar if result.changes else None
        rows.append({"at": value, "value": result.value, "bar": bar, "answer": result.sentence})
    return Curve(other_key, key, units, rows)
