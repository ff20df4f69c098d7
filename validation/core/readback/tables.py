"""Tables of a page against the stored JSON files."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from validation.core.readback.limits import LIMITS
from validation.core.readback.stored import ORDER, SHOWN_AS, Faults, Row, StoredResults, read_words, worst_verdict
from validation.core.readback.texts import (
    cell_texts,
    comparison_words,
    contents_of_tags,
    parse_number,
    plain_text,
    quantity_words,
    shows_decimals,
    shows_number,
    shows_value,
)
from validation.core.scene_data import ROUNDING, ice_mass, mean_around


def number_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    name, value, when, car_at, at = cells
    name = re.sub(r" \(\d+ more, larger\)$", "", name)  # after the smallest of several clearances
    row = next((x for x in of.design if quantity_words(x) == name), None)
    if row is None:
        yield f"{name}: no such design number"
        return
    if not shows_number(value, row):
        yield f"{name}: {value} where {row['value']} {row['unit']} with the bar {row.get('bar')} is stored"
    where = row if row["value"] is not None else {}
    t = where.get("t")
    if when != "" if t is None else not shows_value(when, t, "s", digits=4):
        yield f"{name}: after {when} where {t} s is stored"
    for text, s in ((car_at, where.get("s_o")), (at, where.get("s"))):
        if not shows_decimals(text, s, "m", 1):
            yield f"{name}: at {text} where {s} m is stored"


def line_number_faults(html_text: str, design: Sequence[Row]) -> Faults:
    """Faults of the table of design numbers of a line in motion, which shows all of them."""
    shown = _shown_numbers(html_text)
    words = read_words("page", "assets/motion.toml")
    for number in design:
        kind, _, of = number["quantity"].partition(":")
        name = plain_text(words[kind]["words"].format(of))
        value, at = shown.get(name, ("", ""))
        when, _, where = at.removesuffix(" along the rope").partition(", ")
        good = shows_number(value, number) and shows_value(when, number["t"], "s", digits=4)
        if not good or not shows_decimals(where, number["s_o"], "m", 1):
            stored = f"{number['value']:.6g} {number['unit']} with the bar {number['bar']} at {number['t']:.6g} s"
            yield f"page: {name}: {value} at {at or 'no time'} where {stored} is stored"


def _shown_numbers(html_text: str) -> dict[str, tuple[str, str]]:
    """Value and time of each design number in the table of a page."""
    for table in contents_of_tags("table", html_text):
        head, *rows = [cell_texts(row) for row in contents_of_tags("tr", table)] or [[]]
        if head == ["quantity", "value", "at"]:
            return {name: (value, at) for name, value, at in rows}
    return {}


def _support_load_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    """Components of what a support carries at one instant: means over an axial round trip."""
    side, when, right, down = cells
    run = of.stored_run(0)
    t_max = next(x["t"] for x in of.design if x["quantity"] == f"reaction_{side}_max")
    cable = run["scene"]["cable"]
    period = 2.0 * run["rest"]["length"] * math.sqrt((cable["mass_per_length"] + ice_mass(cable)) / cable["EA"])
    force = -run[f"reaction_{side}"]  # (n, 2)
    known = np.isfinite(force).all(axis=1)
    mean = mean_around(run["t"][known], force[known], np.array([t_max]), period)[0]
    good = shows_value(right, mean[0], "N", digits=4) and shows_value(down, mean[1], "N", digits=4)
    if not good or not shows_value(when, t_max, "s", digits=4):
        yield f"{side} support: {right}, {down} after {when} where {mean} N after {t_max} s follow"


def event_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    event, t, s_o, speed = cells
    texts = [f"{t} s", f"{s_o} m", f"{speed} km/h"]
    for row in of.events:
        shown = [
            text[0] == " " or shows_value(text, row[name], unit, bar=row.get(f"bar_{name}"))
            for text, name, unit in zip(texts, ("t", "s_o", "speed"), ("s", "m", "m/s"), strict=True)
        ]
        if row["event"].replace("_", " ") == event and all(shown):
            return
    yield f"{event} {', '.join(texts)}: no such event is stored"


def _comparison_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    name, verdict, *numbers, where, counts = cells
    for row in of.rows:
        words = [comparison_words(row), row["verdict"] or "–", "asked" if row["asked"] else "shown only"]
        at = row.get("where")
        if (
            [name, verdict.lstrip("✓✗≈? "), counts] == words
            and shows_gaps(numbers, row, 3)
            and (where == "–" if at is None else shows_decimals(where, at, "", 3))
        ):
            return
    yield f"{' | '.join(cells)}: no such comparison in agreement.json"


def shows_gaps(texts: Sequence[str], row: Row, digits: int) -> bool:
    """Whether texts show gap, bars and tolerance of a comparison."""
    values = [row.get(name) for name in ("gap", "allowed", "asked_for")]
    return all(shows_value(text, value, digits=digits) for text, value in zip(texts, values, strict=True))


def _group_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    group, verdict, text = cells
    groups = read_words("commands.check", "words.toml")["groups"]
    others = {row["quantity"] for row in of.rows}.difference(*groups.values())
    rows = [row for row in of.rows if row["asked"] and row["quantity"] in groups.get(group, others)]
    worst = worst_verdict(rows) or "–"
    if verdict.lstrip("✓✗≈? ") != worst:
        yield f"{group}: {verdict} where {worst} is the worst verdict"
    for name in ORDER:
        count = sum(row["verdict"] == name for row in rows)
        words = SHOWN_AS.get(name, name)
        if count and not re.search(rf"\b{count} {words}", text):
            yield f"{group}: {text!r} where {count} {words}"


def _cost_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    method, *counts, seconds, reached = cells
    i = of.methods.index(method)
    summary = of.summaries[i]
    for name, text in zip(("n_dof", "steps", "newton_iterations"), counts, strict=True):
        if int(text.replace(" ", "")) != summary[name]:
            yield f"{name} of {method}: {text} where {summary[name]} is stored"
    if not shows_value(seconds, summary["seconds"], digits=3):
        yield f"seconds of {method}: {seconds} where {summary['seconds']} is stored"
    if not shows_decimals(reached, float(of.stored_run(i)["s_o"][-1]), "m", 1):
        yield f"{method} computed up to {reached}, which is not where its path ends"


def _setting_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    name, text, _ = cells
    values = [(x | x["settings"]).get(name) for x in of.summaries]
    if text not in [f"{value:g}" if isinstance(value, float) else str(value) for value in values]:
        yield f"{name} = {text} where {values} is stored"


def _fact_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    """What follows from the scene: length, tension and sag of the rope at rest, and how fast the car is."""
    name, text = cells
    run = of.stored_run(0)
    x = run["fields.x"]
    y = run["fields.y"]
    length = run["rest"]["length"]
    H = run["rest"]["horizontal_tension"]
    first, _, second = text.partition(", ")
    if name == "rope between the supports":
        good = shows_value(first, length, "m", digits=6)
    elif name == "horizontal tension at rest":
        good = shows_value(first, H, "N", digits=4)
    elif name == "sag at rest":
        below = CubicSpline(run["fields.s"], y - y[-1] / x[-1] * x)  # the chord
        sag = float(below(np.linspace(0.0, length, 20001)).max())
        share = second.removesuffix(" of the span")
        good = shows_value(first, sag, "m", digits=4) and shows_value(share, sag / float(x[-1]), digits=2)
    elif name == "top speed over that of waves across the rope":
        cable = run["scene"]["cable"]
        rho = cable["mass_per_length"] + ice_mass(cable)
        if run["scene"].get("drive", {}).get("mode") == "free":  # on the loaded rope
            speed = np.max(np.hypot(*run["velocity"].T))
        else:
            speed = np.max(np.abs(np.diff(run["s_o"]) / np.diff(run["t"])))  # steps are short chords of the travel
        good = abs(parse_number(text.removesuffix(" %")) / 100.0 - speed * math.sqrt(rho / H)) < 0.06
    else:
        of.unread.append(name)
        return
    if not good:
        yield f"{name}: {text}"


def _input_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    key, text, _ = cells
    value: Any = of.stored_run(0)["scene"]
    for name in key.split("."):
        value = value[int(name)] if isinstance(value, list) else value[name]
    if isinstance(value, list) and text.startswith("("):  # a short one, its values
        shown = text.partition(")")[0].removeprefix("(").split(", ")
        good = len(shown) == len(value) and all(map(_shows_input, shown, value))
    else:
        good = _shows_input(text, len(value) if isinstance(value, list) else value)
    if not good:
        yield f"{key}: {text} where {value} was read"


def _shows_input(text: str, value: Any) -> bool:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return abs(parse_number(text.split(" ")[0]) - value) <= ROUNDING * abs(value)
    return text.startswith(str(value))


def no_faults(text: Any, of: StoredResults) -> Faults:
    """Words alone."""
    return iter(())


def count_faults(text: str, of: StoredResults) -> Faults:
    """Counts of comparisons of two solvers, of laws, and of numbers computed twice."""
    kinds = dict.fromkeys(("energy", "impulse", "laws_si"), "laws")
    kinds |= dict.fromkeys(("design", "outcome"), "printed numbers") | {"deep": ""}
    verdicts: dict[str, list[str]] = {}
    for row in of.rows:
        if row["asked"] and not row.get("with"):
            kind = kinds.get(row["quantity"], "comparisons of two solvers")
            verdicts.setdefault(kind, []).append(row["verdict"])
    verdicts.pop("", None)
    for kind, each in verdicts.items():
        good = each.count("agree")
        words = f"{good} {kind}" if good == len(each) else f"{good} of {len(each)} {kind}"
        if not re.search(rf"(?<!of )\b{words}\b", text):
            yield f"{text!r} where {words} agree or hold"


def _verification_row_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    """A number in the terms of ASME V&V 20, whose row has no fault either."""
    name, printed, in_space, in_time, other, gap, uncertainty = cells
    row = next((x for x in of.agreement["verification"] if quantity_words(x) == name), None)
    if row is None:
        yield f"{name}: not in the verification"
        return
    good = [
        shows_number(printed, row),
        shows_number(other, row | {"value": row["other"], "bar": row["bar_other"]}),
        *(
            shows_value(text, row[key], row["unit"], digits=2)
            for text, key in ((gap, "gap"), (uncertainty, "uncertainty"))
        ),
        *(
            text == "not reached" if row[key] is None else shows_decimals(text, row[key], "", 1)
            for text, key in ((in_space, "order_space"), (in_time, "order_time"))
        ),
    ]
    if not all(good):
        yield f"{' | '.join(cells)}: is not what is stored"


TABLES: dict[str, Callable[[Sequence[str], StoredResults], Faults]] = {
    "quantity|value|when|car at|where": number_faults,
    "support|when|to the right|down": _support_load_faults,
    LIMITS: no_faults,  # by `limit_table_faults`
    "quantity|S|order in space|order in time|D||E||validation uncertainty": _verification_row_faults,
    "event|after [s]|at [m]|speed [km/h]": event_faults,
    "comparison|verdict|gap|sum of both bars|asked for|largest at sₒ/l|in the verdict": _comparison_faults,
    "comparison|verdict|of those asked": _group_faults,
    "run|unknowns|steps|Newton iterations|time loop [s]|computed up to": _cost_faults,
    "setting|value|meaning": _setting_faults,
    "shared|checked on its own by": no_faults,
    "question|answer": no_faults,
    "follows from it|value": _fact_faults,
    "key|value|meaning": _input_faults,
}


def table_faults(table: str, of: StoredResults) -> Faults:
    rows = contents_of_tags("tr", table)
    if not rows:  # the side view's, before its script runs
        return
    columns = "|".join(cell_texts(rows[0]))
    reader = TABLES.get(columns)
    if reader is None:
        of.unread.append(columns)
        return
    for row in rows[1:]:
        yield from reader(cell_texts(row), of)
