"""What a run or a check printed."""

import math
import re
from collections.abc import Callable, Sequence

import numpy as np

from validation.core.readback.limits import LIMIT_VERDICT, expected_limit_scope_sentences, limit_row_faults
from validation.core.readback.stored import (
    Faults,
    StoredResults,
    expected_excess_sentences,
    read_package_toml,
    worst_asked_verdict,
)
from validation.core.readback.tables import (
    design_number_faults,
    event_row_faults,
    no_faults_in_words,
    shows_gap_error_bars_and_tolerance,
    verdict_count_faults,
)
from validation.core.readback.texts import quantity_words, shows_value


def _printed_limit_faults(text: str, stored: StoredResults) -> Faults:
    yield from limit_row_faults(re.split("  +", text), stored.limits)


def terminal_faults(printed: Sequence[str], stored: StoredResults) -> Faults:
    """Faults of what a run or a check printed."""
    sentences = {f"{stored.summaries[0]['scene']}: {stored.outcome}"}  # printed as they are stored
    for summary in stored.summaries:
        sentences |= set(summary["flags"])
    for doubt in stored.agreement.get("doubts", []):
        sentences.add(f"{doubt['method']}: {doubt['words']}")
    if stored.agreement:
        sentences.add(read_package_toml("page", "assets/verdicts.toml")[stored.verdict_on_both_solvers])
        sentences |= set(expected_excess_sentences(row for row in stored.rows if not row.get("with")))
    for text in printed:
        if text.strip() and text.strip() not in sentences:
            readers = (read for pattern, read in LINE_CHECKS if re.match(pattern, text))
            reader = next(readers, _design_faults_or_note_unread)
            yield from reader(text.strip(), stored)


def _design_faults_or_note_unread(text: str, stored: StoredResults) -> Faults:
    """Faults of a printed design number, of two names that begin alike the longer one; else it is noted as unread."""
    rows = [row for row in stored.design if text.startswith(f"{quantity_words(row)} ")]
    if not rows:
        stored.unread.append(text)
        return
    row = max(rows, key=lambda x: len(quantity_words(x)))
    rest = text.removeprefix(quantity_words(row))
    parts = re.fullmatch(r"( \(\d+ more, larger\))? *(.*?)(?:, at ([\d.-]+ m))?(?: after (\S+ s))?", rest)
    assert parts is not None
    more, value, at, when = parts.groups("")
    car = f"{row['s_o']:.1f} m" if row.get("s_o") is not None and row["value"] is not None else ""
    yield from design_number_faults([quantity_words(row) + more, value, when, car, at], stored)


def _event_faults_or_note_unread(text: str, stored: StoredResults) -> Faults:
    """Faults of a printed event; one that no row has is noted as unread."""
    parts = re.fullmatch(r"(.*?) +after (.*) s at (.*) m(?: with (.*) km/h)?", text)
    if parts is None or parts[1].replace(" ", "_") not in [row["event"] for row in stored.events]:
        stored.unread.append(text)
    else:
        yield from event_row_faults(parts.groups(""), stored)


def _printed_slack_faults(text: str, stored: StoredResults) -> Faults:
    length = stored.runs[0]["rest"]["length"]
    number = text.removeprefix("slack somewhere from car at ").partition(" on;")[0]
    for row in stored.design:
        if row["quantity"] == "slack_onset" and row["value"] is not None:
            bar = (row["bar"] or 0.0) * length
            if shows_value(number, row["value"] * length, "m", bar_shown=bar):
                return
    yield f"{text!r} is not the stored slack onset"


def crosswind_faults(text: str, stored: StoredResults) -> Faults:
    """Faults of what is said of wind across the line: its speed, both loads of the rope and their factor."""
    data = stored.scene_data
    across = data.crosswind_force_per_length()
    down = data.rho * data.gravity
    expected = [data.wind["across"], across, down, math.hypot(across, down) / down]
    holds = "nothing of it" if stored.summaries[0]["model"] == "quasi-static" else "only how it damps the rope"
    shown = [float(number) for number in re.findall(r"\d[\d.]*(?:e[+-]\d+)?", text)]
    same = 1e-3  # relative, of four digits
    good = len(shown) == len(expected) and np.allclose(shown, expected, rtol=same, atol=0.0)
    if not good or holds not in text:
        yield f"{text!r}: {expected} follow, and the numbers hold {holds}"


def _averaging_time_faults(text: str, stored: StoredResults) -> Faults:
    """Faults of the seconds over which forces, and decelerations of a free car, are means."""
    round_trip = stored.scene_data.round_trip
    shown = re.search(r"round trip, (.* s);", text)
    if shown is None or not shows_value(shown[1], round_trip, "s", digits=2):
        yield f"{text!r}: the round trip takes {round_trip:.3g} s"
    if ("decelerations" in text) is not (stored.runs[0]["rest"]["drive"] == "free"):
        yield f"{text!r}: decelerations are printed of free cars alone"


def _limit_scope_faults(text: str, stored: StoredResults) -> Faults:
    """What a text is for, and whether the scene is that."""
    names = read_package_toml("cablefem.scene", "limits.toml")["text"]
    mode = stored.runs[0]["rest"]["drive"]
    if text not in expected_limit_scope_sentences(names, {mode}):
        yield f"{text!r} is no scope of a text"


def _printed_method_and_cost_faults(text: str, stored: StoredResults) -> Faults:
    """Faults of a run's method, settings, seconds and bar of the path."""
    parts = re.fullmatch(r"by (\S+) \((.*)\) in (\S+) s(?:; path ± (\S+) m)?", text)
    run = stored.summaries[0]
    if parts is None or parts[1] != run["method"]:
        yield f"{text!r} is not the stored run"
        return
    settings = {f"{key}={value}" for key, value in run["settings"].items()}
    options = {run["model"], run["load"], run["law"]}
    if not set(parts[2].split(", ")) <= settings | options:
        yield f"{parts[2]!r} are not the stored settings"
    bar = None if run["path_error"] is None else run["path_error"] * run["path_scale"]
    if not shows_value(parts[3], run["seconds"], digits=2) or not shows_value(parts[4] or "–", bar, digits=2):
        yield f"{text!r}: {run['seconds']} s and {bar} m are stored"


def _printed_comparison_faults(text: str, stored: StoredResults) -> Faults:
    """Name, gap, bars, tolerance, where, verdict."""
    name, *cells, verdict = re.split("  +", text)
    for row in stored.rows:
        words = " ".join(row[key] for key in ("quantity", "law", "with") if row.get(key))
        if (name, verdict) == (words, row["verdict"] or "shown") and shows_gap_error_bars_and_tolerance(
            cells[:3], row, 2
        ):
            return
    yield f"{text!r} is no comparison in agreement.json"


def _printed_third_party_faults(text: str, stored: StoredResults) -> Faults:
    words = read_package_toml("commands.check", "words.toml")["third"]
    for party in {row["with"] for row in stored.rows if row.get("with")}:
        worst = worst_asked_verdict(row for row in stored.rows if row.get("with") == party)
        if text.startswith(f"{party}: {words[worst or 'not comparable']}"):
            return
    yield f"{text!r} is no verdict on another program"


LINE_CHECKS: tuple[tuple[str, Callable[[str, StoredResults], Faults]], ...] = (
    (r"  wind of ", crosswind_faults),
    (r"  forces(?:, decelerations)? and angles of the rope are means", _averaging_time_faults),
    (r"  slack somewhere from car at ", _printed_slack_faults),
    (r"  by the quasi-static model|  Nothing could be compared|  written to |quantity +gap", no_faults_in_words),
    (r"  by \S+ \(", _printed_method_and_cost_faults),
    (r"limit  +value", no_faults_in_words),
    (rf"\S.*  {LIMIT_VERDICT}", _printed_limit_faults),
    (r"  [^:]*: for .*", _limit_scope_faults),
    (r"  \d+ (of \d+ )?(comparisons|laws|printed)", verdict_count_faults),
    (r"  \S.*: (agrees|DISAGREES|is too coarse|cannot be compared)", _printed_third_party_faults),
    (r"\S.*(  +(-|\d\S*)){4}  (agree|disagree|too coarse|not comparable|shown)$", _printed_comparison_faults),
    (r"  \S.* after \S+( ± \S+)? s at .* m", _event_faults_or_note_unread),
)
