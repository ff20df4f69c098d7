"""The answer to an inverse question, its page and its files."""

import csv
import itertools
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from validation.core.readback.pages import section_html
from validation.core.readback.stored import Faults, Row
from validation.core.readback.texts import (
    NUMBER,
    contents_of_tags,
    plain_text,
    rows_of_each_table,
    shows_value,
    with_plain_signs,
)
from validation.core.scene_data import ROUNDING, conversion_factor_or_nan
from validation.core.stored_files import damaged_files_are_faults, read_json

_CLAUSE = re.compile(r"(.+?)\s*(<=|>=|<|>|=)\s*(\S+)\s*(\S*)")
_ANSWER = re.compile(rf"(at most|at least) (about )?({NUMBER}(?: ± {NUMBER})?)(?: (\S+))?; (above|below): ")
SI_UNITS = ("m/s2", "m/s", "N", "Pa", "m", "s", "deg", "")  # of numbers in conditions


@damaged_files_are_faults
def find_faults(folder: Path, html_text: str, printed: Sequence[str]) -> Faults:
    """Faults of find.json, find.csv, their page and what was printed."""
    answer = read_json(folder / "find.json")
    section = section_html(html_text, "find", "find")
    rows = [*itertools.chain(*rows_of_each_table(section))][1:]  # below the names of the columns
    if "rows" in answer:
        points = [CurvePoint(*row.values()) for row in answer["rows"]]
        sentences = [f"{answer['for']} = {point.parameter}: {point.answer}" for point in points]
        yield from _curve_faults(answer, points, folder / "find.csv", rows)
    else:
        sentences = [answer["sentence"]]
        yield from _search_faults(answer)
        summary = plain_text("".join(contents_of_tags('p class="summary"', section)))
        if summary != with_plain_signs(answer["sentence"]):
            yield "the page has another answer than find.json"
        yield from _evaluation_row_faults(answer["evaluations"], rows)
    for sentence in sentences:
        if sentence not in printed:
            yield f"{sentence!r} was not printed"


def _evaluation_row_faults(evaluations: Sequence[Row], shown: Sequence[Sequence[str]]) -> Faults:
    """Faults of the rows of a page: values that were tried, what was read there, and whether the condition holds."""
    tried = [[x["value"], "yes" if x["holds"] else "no", x["outcome"]] for x in evaluations]
    yield from _shown_row_faults([[cells[0], *cells[2:]] for cells in shown], tried)
    for cells, row in zip(shown, evaluations, strict=False):
        numbers = [*itertools.chain(*row["read"])]
        yield from _shown_row_faults([cells[1].split("; ")], [numbers])


class CurvePoint(NamedTuple):
    """The answer for one value of the parameter that varies along a curve."""

    parameter: Any
    value: Any  # None: unknown
    bar: Any  # None: unknown
    answer: str


def _curve_faults(curve: Row, points: list[CurvePoint], table: Path, shown: Sequence[Sequence[str]]) -> Faults:
    """Faults of a curve in find.csv and in the rows of its page."""
    expected = [(curve["for"], curve["key"], "bar", "answer"), *points]
    with table.open(encoding="utf-8", newline="") as file:
        written = [*csv.reader(file)]
    if written != [["" if x is None else str(x) for x in row] for row in expected]:
        yield "find.csv is not find.json"
    for point in points:
        match = _ANSWER.search(point.answer)
        if match is None:
            good = point.value is None
        else:
            good = point.value is not None and _answer_shows_value(match, point.value)
        if not good:
            yield f"{point.answer!r} where {point.value} is stored"
    yield from _shown_row_faults(shown, [[point.parameter, point.value, point.answer] for point in points])


def _shown_row_faults(shown: Sequence[Sequence[str]], stored: Sequence[Sequence[Any]]) -> Faults:
    """Faults of the cells of shown rows, words as they are stored and numbers to six digits."""
    if len(shown) != len(stored):
        yield f"{len(shown)} rows are shown where {len(stored)} are stored"
    for cells, row in zip(shown, stored, strict=False):
        for text, value in zip(cells, row, strict=True):
            if isinstance(value, str) and value:
                good = text == with_plain_signs(value)
            else:
                good = shows_value(text, None if value == "" else value, digits=6)
            if not good:
                yield f"{text} is shown where {value} is stored"


def _answer_shows_value(match: re.Match[str], value: float) -> bool:
    """Whether an answer in words shows a value to its last digit; to two digits if it says "about"."""
    bar = match[3].partition(" ± ")[2]
    return shows_value(match[3], value, bar_shown=float(bar) if bar else None, digits=2 if match[2] else 5)


def _search_faults(search: Row) -> Faults:
    """Faults of the values that were tried, of each change between them, and of the sentence."""
    clauses = [_CLAUSE.fullmatch(text.strip()) for text in re.split(r"\band\b", search["condition"])]
    numbers_at = {}
    margins_at = {}
    for row in search["evaluations"]:
        value = row["value"]
        numbers = [*itertools.chain(*row["read"])]
        margins = [*map(_margin_of_clause_or_limits, itertools.cycle(clauses), numbers)]
        if row["holds"] is not all(margin >= 0.0 for margin in margins):
            yield f"at {value}: holds is {row['holds']} where {margins} follow"
        numbers_at[value] = numbers
        margins_at[value] = margins
    first = search["changes"][0] if search["changes"] else {}
    for name in ("value", "bar", "holds_at", "fails_at"):
        if search[name] != first.get(name):
            yield f"{name} is not that of the first change"
    yield from _change_and_answer_faults(search, margins_at, numbers_at)


def _change_and_answer_faults(
    search: Row, margins_at: dict[float, list[float]], numbers_at: dict[float, list[Any]]
) -> Faults:
    """Faults of each change, and of its answer in words."""
    answers = [] if "interrupted" in search["sentence"] else list(_ANSWER.finditer(search["sentence"]))
    if answers and len(answers) != len(search["changes"]):
        yield f"{len(answers)} answers in words of {len(search['changes'])}"
    for i, change in enumerate(search["changes"]):
        yield from _change_faults(change, margins_at, numbers_at)
        if answers:
            yield from _answer_text_faults(answers[i], change)


def _margin_of_clause_or_limits(clause: re.Match[str] | None, read: Any) -> float:
    """By how much a clause holds for what was read; negative or nan: it does not.  None: limits, to be met."""
    if clause is None:
        return 0.0 if read == "met" else math.nan
    if clause[2] == "=":
        return 0.0 if read == clause[3] else math.nan
    if read is None:
        return math.nan
    bound = float(clause[3]) * _factor_to_si(clause[4])
    margin = float(read) - bound
    return margin if clause[2][0] == ">" else -margin


def _factor_to_si(unit: str) -> float:
    """What a number in a printed unit, or in none, is multiplied by to be in SI; nan of an unknown unit."""
    factors = [conversion_factor_or_nan(unit, si) for si in SI_UNITS]
    return next((factor for factor in factors if not math.isnan(factor)), math.nan)


def _change_faults(change: Row, margins_at: dict[float, list[float]], numbers_at: dict[float, list[Any]]) -> Faults:
    """Faults of a change: where the first number that fails crosses its limit on a chord, and the bar of a check."""
    good = change["holds_at"]
    bad = change["fails_at"]
    above = margins_at[good]
    below = margins_at[bad]
    if not all(x >= 0.0 for x in above) or all(x >= 0.0 for x in below):
        yield f"the condition does not change between {good} and {bad}"
    shares = [a / (a - b) for a, b in zip(above, below, strict=False) if b < 0.0 <= a]
    value = good + min(shares, default=0.0) * (bad - good)
    if abs(change["value"] - value) > 1e-9 * abs(value):
        yield f"value {change['value']} where {value} follows"
    if change["checked"] is not None and change["bar"] is not None:
        i, number, of_number = change["checked"]
        slope = abs((numbers_at[bad][i] - numbers_at[good][i]) / (bad - good))
        bar = max((abs(number - numbers_at[good][i]) + of_number) / slope, abs(change["fails_at"] - good))
        if abs(change["bar"] - bar) > ROUNDING * bar:
            yield f"bar {change['bar']} where {bar} follows from the check"


def _answer_text_faults(match: re.Match[str], change: Row) -> Faults:
    """A fault unless an answer in words has the side, the value, its bar and unit of a change of verdict."""
    holds_below = change["fails_at"] > change["holds_at"]
    words = ("at most", "above") if holds_below else ("at least", "below")
    if match[2]:  # about
        good = _answer_shows_value(match, change["value"])
    else:
        interval = abs(change["fails_at"] - change["holds_at"])
        good = shows_value(match[3], change["value"], bar_shown=interval if change["bar"] is None else change["bar"])
    if match.group(1, 5) != words or not good or (match[4] or "") != change["unit"]:
        yield f"{match[0]!r} where {change['value']} with the bar {change['bar']} is stored"
