"""Answers and verdicts in a few lines, for several commands."""

from collections.abc import Sequence
from typing import Literal

from cablefem.response import Response
from cablefem.scene import Scene
from cablefem.scene.line import Line
from validation.core import limits as judge
from validation.core.agreement import Agreement
from validation.core.answers import averaging_time_sentence, crosswind_scope_text, outcome_of_run
from validation.core.measures import broke_in_compared_part
from validation.core.methods import find_method
from validation.core.quantities import design_row_texts, key_numbers, limit_row_texts, text_with_error_bar
from validation.page import terminal
from validation.page.answer import EVENTS
from validation.page.page import Row


def print_agreements(agreements: Sequence[Agreement]) -> None:
    """Print a table of gaps, allowed gaps and verdicts, one row per quantity."""
    cells = []
    for agreement in agreements:
        row = agreement.to_json()
        name = " ".join(row[key] for key in ("quantity", "law", "with") if row.get(key))
        numbers = [_number_or_dash(row.get(key), ".1e") for key in ("gap", "allowed", "asked_for")]
        where = _number_or_dash(row.get("where"), ".3f")
        cells.append([name, *numbers, where, row["verdict"] or "shown"])
    columns = ["quantity", "gap", "allowed", "asked for", "at s_o/l", "verdict"]
    terminal.print_table(columns, cells, right=columns[1:5])


def _number_or_dash(value: float | None, digits: str) -> str:
    return "-" if value is None else format(value, digits)


def print_run_summary(scene: Scene, r: Response) -> None:
    """Print what became of a run: outcome, events, the numbers that matter, wind left out, slack onset."""
    terminal.print_text(f"{r.scene}: {outcome_of_run(scene, r).sentence}", style="bold")
    print_limits(scene, judge.limit_rows(scene, r.design, r.events))
    print_last_five_events([x for x in r.events if x["event"] in EVENTS[1:]])  # without the release
    numbers = key_numbers(r.design)
    print_design_numbers(numbers)
    if numbers:
        terminal.print_text(f"  {averaging_time_sentence(r)}; path.csv has each time step")
    if wind := crosswind_scope_text(scene, r.model):
        terminal.print_text(f"  {wind}", style="yellow")
    onset = next((row for row in r.design if row["quantity"] == "slack_onset"), None)
    if onset is not None:
        bar = onset["bar"]
        at = text_with_error_bar(onset["value"] * r.length, bar and bar * r.length)
        after = "the rope carries no compression"
        if r.law == "elastic":
            after = "this elastic law carries compression, and means nothing"
        terminal.print_text(f"  slack somewhere from car at {at} m on; from there on {after}")


def print_limits(scene: Scene | Line, judged: Sequence[Row]) -> None:
    """Print verdicts on limits, and what their texts are for."""
    if judged:
        cells = [limit_row_texts(row) for row in judged]
        terminal.print_table(list(cells[0]), [list(cell.values()) for cell in cells])
    for sentence in judge.limit_scope_sentences(scene):
        terminal.print_text(f"  {sentence}")


def print_design_numbers(design: Sequence[Row]) -> None:
    """Print design numbers, one per row."""
    texts = [design_row_texts(x) for x in design]
    width = max((len(x["what"]) for x in texts), default=0)
    for x in texts:
        at = f", at {x['at']}" if x["at"] else ""
        when = f" after {x['t']}" if x["t"] else ""
        terminal.print_text(f"  {x['what']:<{width}}  {x['value']}{at}{when}")


def print_last_five_events(events: Sequence[Row]) -> None:
    """Print the last five events, one per row."""
    for x in events[-5:]:
        t = text_with_error_bar(x["t"], x.get("bar_t"))
        s_o = text_with_error_bar(x["s_o"], x.get("bar_s_o"))
        speed = ""
        if x["event"] not in ("stop", "turn"):
            bar = x.get("bar_speed")
            speed = f" with {text_with_error_bar(3.6 * x['speed'], bar and 3.6 * bar)} km/h"
        terminal.print_text(f"  {x['event'].replace('_', ' '):<10}  after {t} s at {s_o} m{speed}")


def print_method_and_flags(r: Response) -> None:
    """Print method, settings, time and path error of a run, and its flags, which are reasons for doubt."""
    text = "  by the quasi-static model, which leaves out the inertia of the rope: that is in its bars"
    if r.model != "quasi-static":
        bar = "" if r.path_error is None else f"; path ± {r.path_error * r.path_scale:.2g} m"
        settings = ", ".join(_nondefault_settings_and_options(r))
        text = f"  by {r.method} ({settings}) in {r.seconds:.2g} s{bar}"
    terminal.print_text(text)
    for flag in r.flags:
        terminal.print_text(f"  {flag}", style="yellow")


def _nondefault_settings_and_options(r: Response) -> list[str]:
    """Resolution, steps, and all that is not the default of a run."""
    method = find_method(r.method)
    always = (method.resolution.setting, "steps")
    texts = []
    for key, value in r.settings.items():
        if key in always or value != method.all_settings[key].default:
            texts.append(f"{key}={value}")
    for name, usual in {"model": "full", "load": "mass", "law": "auto"}.items():
        value = getattr(r, name)
        if value != usual:
            texts.append(value)
    return texts


def print_broken_runs(*runs: Response) -> Literal[0, 2]:
    """Print which runs broke before slack and the end of the comparison; the exit code is 2 if there is one, else 0."""
    broken = [r for r in runs if broke_in_compared_part(r)]
    terminal.print_faults([f"{r.method} broke with the car at {r.s_o[-1]:.1f} m: {r.reason}" for r in broken])
    return 2 if broken else 0
