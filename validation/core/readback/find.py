"""The answer to an inverse question, its page and its files."""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from validation.core.readback.pages import section_html
from validation.core.readback.stored import Faults, Row, read_json, read_words
from validation.core.readback.texts import NUMBER, cell_texts, contents_of_tags, plain_text, shows_value
from validation.core.scene_data import ROUNDING, si_factor

_CLAUSE = re.compile(r"(.+?)\s*(<=|>=|<|>|=)\s*(\S+)\s*(\S*)")
_ANSWER = re.compile(rf"(at most|at least) (about )?({NUMBER}(?: ± {NUMBER})?)(?: (\S+))?; (above|below): ")
EVENT_UNITS = {"t": "s", "s_o": "m", "speed": "m/s"}


def find_faults(folder: Path, html_text: str, printed: Sequence[str]) -> Faults:
    """Faults of find.json, find.csv, their page and what was printed."""
    found = read_json(folder / "find.json")
    section = section_html(html_text, "find", "find")
    rows = [cell_texts(row) for table in contents_of_tags("table", section) for row in contents_of_tags("tr", table)][
        1:
    ]
    if "rows" in found:
        sentences = [f"{found['for']} = {row['of']}: {row['answer']}" for row in _curve_points(found["rows"])]
        yield from _curve_faults(found, folder / "find.csv", rows)
    else:
        sentences = [found["sentence"]]
        yield from _search_faults(found)
        if plain_text("".join(contents_of_tags('p class="summary"', section))) != plain_text(found["sentence"]):
            yield "the page has another answer than find.json"
        yield from _evaluation_faults(found["evaluations"], rows)
    for sentence in sentences:
        if sentence not in printed:
            yield f"{sentence!r} was not printed"


def _evaluation_faults(evaluations: Sequence[Row], shown: Sequence[Sequence[str]]) -> Faults:
    """Faults of the rows of a page: values that were tried, what was read there, and whether the condition holds."""
    tried = [[x["value"], "yes" if x["holds"] else "no", x["outcome"]] for x in evaluations]
    yield from _row_faults([[cells[0], *cells[2:]] for cells in shown], tried)
    for cells, row in zip(shown, evaluations, strict=False):
        yield from _row_faults([cells[1].split("; ")], [list(itertools.chain(*row["read"]))])


def _curve_points(rows: Sequence[Row]) -> list[Row]:
    """Rows of a curve, whose first key is the one that varies."""
    return [dict(zip(("of", "value", "answer"), row.values(), strict=True)) for row in rows]


def _curve_faults(found: Row, table: Path, shown: Sequence[Sequence[str]]) -> Faults:
    """Faults of a curve in find.csv and in the rows of its page."""
    stored = [list(row.values()) for row in found["rows"]]
    expected = [[found["for"], found["key"], "answer"], *stored]
    with table.open(encoding="utf-8", newline="") as file:
        if [*csv.reader(file)] != [["" if x is None else str(x) for x in row] for row in expected]:
            yield "find.csv is not find.json"
    for row in _curve_points(found["rows"]):
        match = _ANSWER.search(row["answer"])
        unknown = row["value"] is None
        if (match is None) is not unknown or (match and not _rounds_to(match, row["value"])):
            yield f"{row['answer']!r} where {row['value']} is stored"
    yield from _row_faults(shown, stored)


def _row_faults(shown: Sequence[Sequence[str]], stored: Sequence[Sequence[Any]]) -> Faults:
    if len(shown) != len(stored):
        yield f"{len(shown)} rows are shown where {len(stored)} are stored"
    for cells, row in zip(shown, stored, strict=False):
        for text, value in zip(cells, row, strict=True):
            if isinstance(value, str) and value:
                good = text == plain_text(value)
            else:
                good = shows_value(text, None if value == "" else value, digits=6)
            if not good:
                yield f"{text} is shown where {value} is stored"


def _rounds_to(match: re.Match[str], value: float) -> bool:
    """Whether an answer in words is a value to its last digit, two of one that is about."""
    bar = match[3].partition(" ± ")[2]
    return shows_value(match[3], value, bar=float(bar) if bar else None, digits=2 if match[2] else 5)


def _search_faults(search: Row) -> Faults:
    """Faults of the values that were tried, of each change between them, and of the sentence."""
    clauses = [_CLAUSE.fullmatch(text.strip()) for text in re.split(r"\band\b", search["condition"])]
    numbers_at = {row["value"]: list(itertools.chain(*row["read"])) for row in search["evaluations"]}
    margins_at = {
        value: list(map(_clause_margin, itertools.cycle(clauses), read)) for value, read in numbers_at.items()
    }
    for row in search["evaluations"]:
        if row["holds"] is not all(margin >= 0.0 for margin in margins_at[row["value"]]):
            yield f"at {row['value']}: holds is {row['holds']} where {margins_at[row['value']]} follow"
    first = search["changes"][0] if search["changes"] else {}
    for name in ("value", "bar", "holds_at", "fails_at"):
        if search[name] != first.get(name):
            yield f"{name} is not that of the first change"
    yield from _faults_of_changes_of_verdict(search, margins_at, numbers_at)


def _faults_of_changes_of_verdict(
    search: Row, margins_at: dict[float, list[float]], numbers_at: dict[float, list[Any]]
) -> Faults:
    """Faults of each change, and of its answer in words."""
    answers = [] if "interrupted" in search["sentence"] else list(_ANSWER.finditer(search["sentence"]))
    if answers and len(answers) != len(search["changes"]):
        yield f"{len(answers)} answers in words of {len(search['changes'])}"
    for i, change in enumerate(search["changes"]):
        yield from _faults_of_change_of_verdict(change, margins_at, numbers_at)
        if answers:
            yield from _answer_faults(answers[i], change)


def _clause_margin(match: re.Match[str] | None, read: Any) -> float:
    """By how much a clause holds; negative or nan: it does not."""
    if match is None or match[2] == "=":
        return 0.0 if read == ("met" if match is None else match[3]) else math.nan
    if read is None:
        return math.nan
    margin = float(read) - float(match[3]) * si_factor(match[4], _unit_in_condition(match[1]))
    return margin if match[2][0] == ">" else -margin


def _unit_in_condition(name: str) -> str:
    """The unit of a design number, of a line too, or of an event; the extreme may be left out."""
    kind, _, of = name.replace(":", ".").partition(".")
    quantities = read_words("core", "quantities.toml")
    units = {x: row[1] for table in ("main", "more") for x, row in quantities[table].items()}
    at_rest = read_words("page", "assets/line.toml")["quantity"]
    for words in (at_rest, read_words("page", "assets/motion.toml")):
        units |= {x: row["unit"] for x, row in words.items() if "unit" in row}
    names = (kind, f"{kind}_min", f"{kind}_max", kind.removesuffix("_min"), kind.removesuffix("_max"))
    return next((units[x] for x in names if x in units), None) or EVENT_UNITS.get(of, "")


def _faults_of_change_of_verdict(
    change: Row, margins_at: dict[float, list[float]], numbers_at: dict[float, list[Any]]
) -> Faults:
    """Faults of a change: where the first number that fails crosses its limit on a chord, and the bar of a check."""
    good, bad = change["holds_at"], change["fails_at"]
    above, below = margins_at[good], margins_at[bad]
    if not all(x >= 0.0 for x in above) or all(x >= 0.0 for x in below):
        yield f"the condition does not change between {good} and {bad}"
    shares = [a / (a - b) for a, b in zip(above, below, strict=False) if b < 0.0 <= a]
    value = good + min(shares, default=0.0) * (bad - good)
    if abs(change["value"] - value) > 1e-9 * abs(value):
        yield f"value {change['value']} where {value} follows"
    if change["checked"] is not None and change["bar"] is not None:
        i, number, of_number = change["checked"]
        slope = abs((numbers_at[bad][i] - numbers_at[good][i]) / (bad - good))
        bar = (abs(number - numbers_at[good][i]) + of_number) / slope
        if abs(change["bar"] - bar) > ROUNDING * bar:
            yield f"bar {change['bar']} where {bar} follows from the check"


def _answer_faults(match: re.Match[str], change: Row) -> Faults:
    at_most = change["fails_at"] > change["holds_at"]
    words = match[1] == ("at most" if at_most else "at least") and match[5] == ("above" if at_most else "below")
    width = max(change["bar"] or 0.0, abs(change["fails_at"] - change["holds_at"]))
    good = _rounds_to(match, change["value"]) if match[2] else shows_value(match[3], change["value"], bar=width)
    if not words or not good or (match[4] or "") != change["unit"]:
        yield f"{match[0]!r} where {change['value']} with the bar {change['bar']} is stored"
