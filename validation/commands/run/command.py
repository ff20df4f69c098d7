from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from validation.commands.run import CHOICES, QUASI_STATIC, option_faults, setting_faults
from validation.core import store
from validation.page import options, terminal

if TYPE_CHECKING:
    from validation.commands.run.study import AnsweredRun
    from validation.core.methods import Method

EXAMPLE = "cablefem run zipline --model quasi-static --set mass.mass=40,60,80"
METHOD = "following-p2"
MODEL = "full, stretching, sagged or string; quasi-static needs no method. Of a line: full, or quasi-static."
LAW = "elastic, tension-only, or auto: tension-only from the slack onset on."
TOL = "Choose resolution and steps for a path error of at most X, of mean forces 10 X."


def command(
    scene: options.SceneName,
    method: Annotated[str, typer.Option(metavar="NAME", help="A method (cablefem methods).")] = METHOD,
    set_: options.Set = None,
    model: Annotated[str, typer.Option(metavar="NAME", help=MODEL)] = "full",
    load: Annotated[str, typer.Option(metavar="NAME", help="mass: with its inertia; force: only its weight.")] = "mass",
    law: Annotated[str, typer.Option(metavar="NAME", help=LAW)] = "auto",
    tol: Annotated[float | None, options.number_option("--tol", TOL)] = None,
    bars: Annotated[bool, typer.Option("--bars/--no-bars", help="Error bars from coarser runs.")] = True,
    limits: options.LimitNames = None,
    case: options.Cases = None,
    require: options.RequireLimits = False,
    out: options.Out = None,
) -> int:
    """Run one method on one scene, or on a grid of scenes: what becomes of the ride, in numbers and pictures.

    Writes DIR/METHOD/: path.csv, tension.csv, profile.csv, summary.json, response.npz, and for ParaView response.xdmf
    with its data, response.h5, and mass.xdmf. Beside it report.html. A grid writes table.csv and report.html.
    """
    run_options = {"model": model, "load": load, "law": law}
    if (line := options.load_line_printing_notes_or_none(scene)) is not None:
        others = {f"--{option}": given != CHOICES[option][0] for option, given in run_options.items()}
        others["--model"] = model not in ("full", QUASI_STATIC)
        others |= {"--method": method != METHOD, "--tol": tol is not None, "--no-bars": not bars}
        points = options.line_points_from_options(options.with_limits_of_regulations(line, limits), set_, case, others)
        return _answer_and_report_lines(points, model == QUASI_STATIC, out, require)
    faults: list[str] = []
    chosen = None if model == QUASI_STATIC else _find_method_noting_fault(method, faults)
    faults += option_faults(run_options, tol, chosen, before="--")
    loaded = options.with_limits_of_regulations(
        options.load_scene_printing_notes_or_refuse(scene, faults, needs_mass=True), limits
    )
    points = options.grid_points_from_options_printing_notes(loaded, set_, case)
    for point in points:
        if chosen is None:
            no_settings = "the quasi-static model has no settings; keys of the scene have a dot"
            faults += [f"--set {key}: {no_settings}" for key in point.settings]
        else:
            faults += setting_faults(point.scene, chosen, run_options, point.settings, tol, before="--")
    if faults:
        raise store.Refused(list(dict.fromkeys(faults)))

    from validation.commands.run import study

    def answer_at(point: options.GridPoint, progress: Callable[..., None]) -> "AnsweredRun":
        how = run_options | point.settings
        return study.run_with_design_numbers(point.scene, chosen, tol=tol, bars=bars, progress=progress, **how)

    if len(points) > 1:
        return study.answer_and_store_run_grid(loaded, points, answer_at, out, require)
    return _run_and_report(points[0], QUASI_STATIC if chosen is None else method, answer_at, out, require)


def _answer_and_report_lines(
    points: list[options.GridPoint], quasi_static: bool, out: Path | None, require_limits: bool
) -> int:
    """Answer a line of several contacts, at rest or in motion, or a grid of them; return the exit code."""
    from validation.commands.run import line as at_rest
    from validation.commands.run import motion, quasi
    from validation.commands.run.lines import answer_and_report_lines

    def answer_one(line: Any, report: Any) -> Any:
        if quasi_static:
            return quasi.answer_line_quasi_statically(line)
        return motion.answer_line(line, report=report) if line.moves else at_rest.answer_line(line)

    return answer_and_report_lines("run", points, out, answer_one, require_limits, at_rest=quasi_static)


def _run_and_report(
    point: options.GridPoint, name: str, answer_at: "Callable[..., AnsweredRun]", out: Path | None, require_limits: bool
) -> int:  # fmt: skip
    """Run one scene, write, draw and print its answer, and read it back; return the exit code.

    name : of the method, and of the folder for its files.
    """
    from validation.core import limits
    from validation.core.answers import write_summary_and_profile
    from validation.core.readback import StoredResults
    from validation.core.sidebyside import do_in_background
    from validation.page import printing, report
    from validation.page.answer import write_animations

    scene = point.scene
    folder = store.claim_and_clear_folder(out, "run", scene, [name])
    with terminal.progress_bars() as progress:
        r, missed_tolerance = answer_at(point, partial(progress, name))
        r.summary()  # bars are computed when they are looked at
    with nullcontext() if name == QUASI_STATIC else do_in_background(partial(write_animations, folder, [r])):
        r.write(folder / name)
        write_summary_and_profile(folder / name, scene, r)
        report.write_report_and_mark_finished(folder, "run")
    store.mark_finished_with_files(folder, "run")  # with the animation's files
    with terminal.copy_printed_lines() as lines:
        printing.print_run_summary(scene, r)
        printing.print_method_and_flags(r)
    terminal.print_text(f"  written to {folder}: report.html, {name}/")
    if broken := printing.print_broken_runs(r):
        return broken
    wrong = report.read_back_and_report("run", StoredResults(folder, [name], judged=False), lines)
    if missed_tolerance:
        terminal.print_faults([missed_tolerance])
        return 1
    if require_limits and limits.any_limit_not_surely_met(limits.limit_rows(scene, r.design, r.events)):
        return 1
    # a bar that could not be made is no fault of the run
    return 1 if wrong or any(flag.kind != "no bar" for flag in r.flags) else 0


def _find_method_noting_fault(name: str, faults: list[str]) -> "Method | None":
    """The method of a name; why there is none is added to `faults`."""
    from validation.core.methods import find_method

    try:
        return find_method(name)
    except ValueError as error:
        faults.append(str(error))
        return None
