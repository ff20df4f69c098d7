"""Tables of a page against the stored JSON files."""

import math
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from validation.core.readback.files import time_of_slack_or_slow_waves
from validation.core.readback.limits import LIMITS
from validation.core.readback.stored import (
    ORDER,
    SHOWN_AS,
    Faults,
    Row,
    Run,
    StoredResults,
    read_package_toml,
    worst_asked_verdict,
)
from validation.core.readback.texts import (
    comparison_words,
    parse_number,
    plain_text,
    quantity_words,
    rows_of_each_table,
    rows_of_table,
    shows_decimals,
    shows_design_number,
    shows_value,
)
from validation.core.scene_data import ROUNDING, ice_mass_per_length, means_around_times


def design_number_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    """Faults of a shown design number: value with bar, time, positions of car and of the number along the rope."""
    name, value, when, car_at, at = cells
    several = re.search(r" \((\d+) more, larger\)$", name)  # after the smallest of several clearances
    name = name[: several.start()] if several else name
    row = next((x for x in stored.design if quantity_words(x) == name), None)
    if row is None:
        yield f"{name}: no such design number"
        return
    if several and int(several[1]) != _number_of_larger_clearances(row, stored.design):
        yield f"{name}: {several[1]} more and larger are said, which are not those that are stored"
    if not shows_design_number(value, row):
        yield f"{name}: {value} where {row['value']} {row['unit']} with the bar {row.get('bar')} is stored"
    where = row if row["value"] is not None else {}
    t = where.get("t")
    good = when == "" if t is None else shows_value(when, t, "s", digits=4)
    if not good:
        yield f"{name}: after {when} where {t} s is stored"
    for text, s in ((car_at, where.get("s_o")), (at, where.get("s"))):
        if not shows_decimals(text, s, "m", 1):
            yield f"{name}: at {text} where {s} m is stored"


def _number_of_larger_clearances(smallest: Row, design: Sequence[Row]) -> int:
    """How many other clearances are stored, all of them larger; -1: one is smaller."""
    values = [x["value"] for x in design if x["quantity"].startswith("clearance_") and x["value"] is not None]
    return len(values) - 1 if smallest["value"] == min(values, default=None) else -1


def motion_design_table_faults(html_text: str, design: Sequence[Row]) -> Faults:
    """Faults of the table of design numbers of a line in motion, which shows all of them."""
    shown: dict[str, list[str]] = {}  # value, and time and place, by words
    for rows in rows_of_each_table(html_text):
        if rows and rows[0] == ["quantity", "value", "at"]:
            shown = {name: value_and_place for name, *value_and_place in rows[1:]}
    words = read_package_toml("page", "assets/motion.toml")
    for number in design:
        kind, _, of = number["quantity"].partition(":")
        name = plain_text(words[kind]["words"].format(of))
        value, at = shown.get(name, ["", ""])
        when, _, where = at.removesuffix(" along the rope").partition(", ")
        good = shows_design_number(value, number) and shows_value(when, number["t"], "s", digits=4)
        if not good or not shows_decimals(where, number["s_o"], "m", 1):
            stored = f"{number['value']:.6g} {number['unit']} with the bar {number['bar']} at {number['t']:.6g} s"
            yield f"page: {name}: {value} at {at or 'no time'} where {stored} is stored"


def _support_load_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    """Components of what a support carries at one instant: means over an axial round trip."""
    side, when, right, down = cells
    run = stored.runs[0]
    t_max = next(x["t"] for x in stored.design if x["quantity"] == f"reaction_{side}_max")
    force = -run[f"reaction_{side}"]  # (n, 2)
    known = np.isfinite(force).all(axis=1)
    mean = means_around_times(run["t"][known], force[known], np.array([t_max]), stored.scene_data.round_trip)[0]
    good = [
        shows_value(right, mean[0], "N", digits=4),
        shows_value(down, mean[1], "N", digits=4),
        shows_value(when, t_max, "s", digits=4),
    ]
    if not all(good):
        yield f"{side} support: {right}, {down} after {when} where {mean} N after {t_max} s follow"


def event_row_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    """A fault unless an event with these numbers is stored; an empty cell fits all."""
    event, t, s_o, speed = cells
    texts = [f"{t} s", f"{s_o} m", f"{speed} km/h"]
    same_kind = [row for row in stored.events if row["event"].replace("_", " ") == event]
    if not any(_shows_event(texts, row) for row in same_kind):
        yield f"{event} {', '.join(texts)}: no such event is stored"


def _shows_event(texts: Sequence[str], row: Row) -> bool:
    """Whether texts show time, position and speed of an event."""
    for text, name, unit in zip(texts, ("t", "s_o", "speed"), ("s", "m", "m/s"), strict=True):
        is_empty = text[0] == " "
        if not is_empty and not shows_value(text, row[name], unit, bar_shown=row.get(f"bar_{name}")):
            return False
    return True


def _comparison_row_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    if not any(_shows_comparison(cells, row) for row in stored.rows):
        yield f"{' | '.join(cells)}: no such comparison in agreement.json"


def _shows_comparison(cells: Sequence[str], row: Row) -> bool:
    name, verdict, *numbers, where, counts = cells
    words = [comparison_words(row), row["verdict"] or "–", "asked" if row["asked"] else "shown only"]
    if [name, verdict.lstrip("✓✗≈? "), counts] != words:
        return False
    if not shows_gap_error_bars_and_tolerance(numbers, row, 3):
        return False
    at = row.get("where")
    return where == "–" if at is None else shows_decimals(where, at, "", 3)


def shows_gap_error_bars_and_tolerance(texts: Sequence[str], row: Row, digits: int) -> bool:
    """Whether texts show gap, bars and tolerance of a comparison."""
    values = [row.get(name) for name in ("gap", "allowed", "asked_for")]
    return all(shows_value(text, value, digits=digits) for text, value in zip(texts, values, strict=True))


def _verdict_group_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    """Faults of the worst verdict of a group of comparisons, and of the counts of each verdict."""
    group, verdict, text = cells
    groups = read_package_toml("commands.check", "words.toml")["groups"]
    others = {row["quantity"] for row in stored.rows}.difference(*groups.values())
    rows = [row for row in stored.rows if row["asked"] and row["quantity"] in groups.get(group, others)]
    worst = worst_asked_verdict(rows) or "–"
    if verdict.lstrip("✓✗≈? ") != worst:
        yield f"{group}: {verdict} where {worst} is the worst verdict"
    for name in ORDER:
        count = sum(row["verdict"] == name for row in rows)
        words = SHOWN_AS.get(name, name)
        if count and not re.search(rf"\b{count} {words}", text):
            yield f"{group}: {text!r} where {count} {words}"


def _run_cost_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    """Faults of a method's unknowns, steps, Newton iterations and seconds, and of where its path ends."""
    method, *counts, seconds, reached = cells
    i = stored.methods.index(method)
    summary = stored.summaries[i]
    for name, text in zip(("n_dof", "steps", "newton_iterations"), counts, strict=True):
        if int(text.replace(" ", "")) != summary[name]:
            yield f"{name} of {method}: {text} where {summary[name]} is stored"
    if not shows_value(seconds, summary["seconds"], digits=3):
        yield f"seconds of {method}: {seconds} where {summary['seconds']} is stored"
    if not shows_decimals(reached, float(stored.runs[i]["s_o"][-1]), "m", 1):
        yield f"{method} computed up to {reached}, which is not where its path ends"


def _setting_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    name, text, _ = cells
    values = [(x | x["settings"]).get(name) for x in stored.summaries]
    expected = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
    if text not in expected:
        yield f"{name} = {text} where {values} is stored"


def _shows_stored_number(name: str, unit: str, digits: int, text: str, run: Run) -> bool:
    return shows_value(text.partition(", ")[0], run["rest"][name], unit, digits=digits)


def _shows_sag_at_rest(text: str, run: Run) -> bool:
    x = run["fields.x"]
    y = run["fields.y"]
    below_chord = CubicSpline(run["fields.s"], y - y[-1] / x[-1] * x)
    s = np.linspace(0.0, run["rest"]["length"], 20001)
    sag = float(below_chord(s).max())
    first, _, second = text.partition(", ")
    share = second.removesuffix(" of the span")
    return shows_value(first, sag, "m", digits=4) and shows_value(share, sag / float(x[-1]), digits=2)


def _shows_top_speed_over_waves(text: str, run: Run) -> bool:
    """Whether a text shows, in percent, the car's top speed over the speed of transverse waves at rest."""
    cable = run["scene"]["cable"]
    rho = cable["mass_per_length"] + ice_mass_per_length(cable)
    if run["scene"].get("drive", {}).get("mode") == "free":  # on the loaded rope
        lift_offs = [event["t"] for event in run["rest"]["events"] if event["event"] == "lift_off"]
        on_rope = run["t"] <= min([time_of_slack_or_slow_waves(run), *lift_offs])
        speeds = np.hypot(*run["velocity"][on_rope].T)
    else:
        speeds = np.abs(np.diff(run["s_o"]) / np.diff(run["t"]))  # steps are short chords of the travel
    ratio = np.max(speeds, initial=0.0) * math.sqrt(rho / run["rest"]["horizontal_tension"])
    shown = parse_number(text.removesuffix(" %")) / 100.0
    return bool(abs(shown - ratio) < 0.06)


FACTS: dict[str, Callable[[str, Run], bool]] = {  # that follow from the scene
    "rope between the supports": partial(_shows_stored_number, "length", "m", 6),
    "horizontal tension at rest": partial(_shows_stored_number, "horizontal_tension", "N", 4),
    "sag at rest": _shows_sag_at_rest,
    "top speed over that of waves across the rope": _shows_top_speed_over_waves,
}


def _fact_faults_or_note_unread(cells: Sequence[str], stored: StoredResults) -> Faults:
    name, text = cells
    if name not in FACTS:
        stored.unread.append(name)
    elif not FACTS[name](text, stored.runs[0]):
        yield f"{name}: {text}"


def _input_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    """Faults of a value of the TOML: a number, a word, a short list or the length of a list."""
    key, text, _ = cells
    value: Any = stored.runs[0]["scene"]
    for name in key.split("."):
        value = value[int(name)] if isinstance(value, list) else value[name]
    if not isinstance(value, list):
        good = _shows_input(text, value)
    elif text.startswith("("):  # a short one, its values
        shown = text.partition(")")[0].removeprefix("(").split(", ")
        good = len(shown) == len(value) and all(map(_shows_input, shown, value))
    else:
        good = _shows_input(text, len(value))
    if not good:
        yield f"{key}: {text} where {value} was read"


def _shows_input(text: str, value: Any) -> bool:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return abs(parse_number(text.split(" ")[0]) - value) <= ROUNDING * abs(value)
    return text.startswith(str(value))


def no_faults_in_words(text: Any, stored: StoredResults) -> Faults:
    """None: these texts are words alone, without a stored number."""
    return iter(())


def verdict_count_faults(text: str, stored: StoredResults) -> Faults:
    """Counts of comparisons of two solvers, of laws, and of numbers computed twice."""
    kinds = dict.fromkeys(("energy", "impulse", "laws_si"), "laws")
    kinds |= dict.fromkeys(("design", "outcome"), "printed numbers")
    verdicts: dict[str, list[str]] = {}
    for row in stored.rows:
        if row["asked"] and not row.get("with") and row["quantity"] != "deep":
            kind = kinds.get(row["quantity"], "comparisons of two solvers")
            verdicts.setdefault(kind, []).append(row["verdict"])
    for kind, each in verdicts.items():
        good = each.count("agree")
        words = f"{good} {kind}" if good == len(each) else f"{good} of {len(each)} {kind}"
        if not re.search(rf"(?<!of )\b{words}\b", text):
            yield f"{text!r} where {words} agree or hold"


def _verification_row_faults(cells: Sequence[str], stored: StoredResults) -> Faults:
    """A number in the terms of ASME V&V 20, whose row has no fault either."""
    name, printed, in_space, in_time, other, gap, uncertainty = cells
    row = next((x for x in stored.agreement["verification"] if quantity_words(x) == name), None)
    if row is None:
        yield f"{name}: not in the verification"
        return
    good = [
        shows_design_number(printed, row),
        shows_design_number(other, row | {"value": row["other"], "bar": row["bar_other"]}),
        shows_value(gap, row["gap"], row["unit"], digits=2),
        shows_value(uncertainty, row["uncertainty"], row["unit"], digits=2),
        _shows_order(in_space, row["order_space"]),
        _shows_order(in_time, row["order_time"]),
    ]
    if not all(good):
        yield f"{' | '.join(cells)}: is not what is stored"


def _shows_order(text: str, order: float | None) -> bool:
    return text == "not reached" if order is None else shows_decimals(text, order, "", 1)


TABLES: dict[str, Callable[[Sequence[str], StoredResults], Faults]] = {
    "quantity|value|when|car at|where": design_number_faults,
    "support|when|to the right|down": _support_load_faults,
    LIMITS: no_faults_in_words,  # by `limit_table_faults`
    "quantity|S|order in space|order in time|D||E||validation uncertainty": _verification_row_faults,
    "event|after [s]|at [m]|speed [km/h]": event_row_faults,
    "comparison|verdict|gap|sum of both bars|asked for|largest at sₒ/l|in the verdict": _comparison_row_faults,
    "comparison|verdict|of those asked": _verdict_group_faults,
    "run|unknowns|steps|Newton iterations|time loop [s]|computed up to": _run_cost_faults,
    "setting|value|meaning": _setting_faults,
    "shared|checked on its own by": no_faults_in_words,
    "question|answer": no_faults_in_words,
    "follows from it|value": _fact_faults_or_note_unread,
    "key|value|meaning": _input_faults,
}


def table_faults_or_note_unread(html_table: str, stored: StoredResults) -> Faults:
    """Faults of the rows of a table of a page; one without a reader is noted as unread."""
    rows = rows_of_table(html_table)
    if not rows:  # the side view's, before its script runs
        return
    columns = "|".join(rows[0])
    reader = TABLES.get(columns)
    if reader is None:
        stored.unread.append(columns)
        return
    for cells in rows[1:]:
        yield from reader(cells, stored)
