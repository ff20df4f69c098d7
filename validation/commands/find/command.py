import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from validation.core import store
from validation.page import options, terminal

EXAMPLE = 'cablefem find zipline mass.mass=40:200 --so-that "arrival.speed <= 16 km/h"'
SO_THAT = "NAME <= NUMBER UNIT, NAME >= NUMBER UNIT, outcome = KIND, limits met; several joined by and."
FOR = "Another key with several values: one answer for each, as a curve."
ALL_OF = "The condition must hold for each of these values."
MODEL = "quasi-static or full: of the search; a line has one model."


def command(
    scene: options.SceneName,
    key: Annotated[str, typer.Argument(metavar="KEY=LOW:HIGH", help="A key of the scene, and its range.")],
    so_that: Annotated[str, typer.Option("--so-that", metavar="CONDITION", help=SO_THAT)],
    set_: options.Set = None,
    other: Annotated[str | None, typer.Option("--for", metavar="KEY=VALUES", help=FOR)] = None,
    all_of: Annotated[list[str] | None, typer.Option("--all-of", metavar="KEY=VALUES", help=ALL_OF)] = None,
    model: Annotated[str, typer.Option(metavar="NAME", help=MODEL)] = "quasi-static",
    limits: options.LimitNames = None,
    check: Annotated[bool, typer.Option("--check/--no-check", help="Run both solvers at the answer.")] = True,
    out: options.Out = None,
) -> int:
    """Find the largest or smallest value of one key for which a condition holds.

    Names are those of summary.json; of events, as arrival.speed at the end of the rope. brake_or_arrival.speed is
    that at a brake, else at the end, as the limit arrival_speed has it. Writes DIR/: find.json, with --for find.csv.

    A few runs bracket each change, bisection narrows it by --model, and both solvers run at the answer: what they
    print is as sure as the number that decides.
    """
    faults = [] if model in ("quasi-static", "full") else [f"--model = {model!r}: must be quasi-static or full"]
    loaded = options.load_line_printing_notes_or_none(scene) or options.load_scene_printing_notes_or_refuse(
        scene, faults, needs_mass=True
    )
    points = options.grid_points_from_options_printing_notes(options.with_limits_of_regulations(loaded, limits), set_)
    if len(points) > 1 or points[0].settings:
        raise store.Refused("--set: one value for each key of the scene; --for takes several")
    name, ends = _parse_key_and_range(key)

    from validation.commands.find import condition, study

    condition.parse_condition(so_that)
    how: Any = {"so_that": so_that, "model": model, "all_of": dict(map(_parse_key_and_values, all_of or []))}
    scene = points[0].scene
    search: Callable[..., Any]
    if other is None:
        search = partial(study.find, scene, {name: ends}, check=check, **how)
        return _search_and_report(scene, search, ["find.json"], out)
    search = partial(study.find_curve, scene, {name: ends}, *_parse_key_and_values(other), **how)
    return _search_and_report(scene, search, ["find.csv", "find.json"], out)


def _search_and_report(scene: Any, search: Callable[..., Any], writes: list[str], out: Path | None) -> int:
    """Search, write and print the result, read it back; return the exit code.

    After Ctrl-C what was computed is written and printed, and KeyboardInterrupt raised.
    """
    from validation.commands.find import study
    from validation.core.readback import find_faults
    from validation.page import report

    with options.claim_and_finish_results(out, "find", scene, writes) as folder:
        try:
            with terminal.progress_bars() as progress:
                result = search(progress=progress)
        except study.Interrupted as stop:
            result = stop.found
        result.write(folder)
        report.write_report_and_mark_finished(folder, "find")
        with terminal.copy_printed_lines() as lines:
            for sentence in result.sentence.splitlines():
                terminal.print_text(sentence, style="bold")
        page = (folder / store.REPORT).read_text(encoding="utf-8")
        wrong = report.report_read_back_faults(folder, "find", list(find_faults(folder, page, lines)))
        if result.interrupted:
            raise KeyboardInterrupt(f"what was computed is in {folder / 'find.json'}")
    return wrong or int(not result.answered)


def _parse_key_and_range(pair: str) -> tuple[str, tuple[float, float]]:
    """Key, low and high of KEY=LOW:HIGH; Refused for anything else."""
    key, _, text = pair.partition("=")
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        raise store.Refused(f"{pair}: must be KEY=LOW:HIGH, as mass.mass=40:200") from None
    if not -math.inf < low < high < math.inf:
        raise store.Refused(f"{pair}: LOW must be below HIGH, both finite")
    return key, (low, high)


def _parse_key_and_values(pair: str) -> tuple[str, list[Any]]:
    """Key and values of KEY=VALUES; Refused for anything else."""
    from validation.core import grid

    try:
        return grid.parse_key_and_values(pair)
    except ValueError as error:
        raise store.Refused(str(error)) from None
