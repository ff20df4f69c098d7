from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from validation.core import store
from validation.page import options, terminal

if TYPE_CHECKING:
    from cablefem.response import Response
    from cablefem.scene import Scene
    from cablefem.scene.line import Line
    from validation.commands.check.study import Check
    from validation.core.foreign import ForeignPath

EXAMPLE = "cablefem check my.toml --tol 1e-4 --with other.csv"
TOL = "Asked of the path's error, over its largest deflection. Default: 1e-3; of a line at rest 1e-6 m."
TOL_TENSION = "Asked of the tension, over H. Default: 10 times --tol."
ASK = "all, or path: path, position and speed of the car decide, all else is shown."
SECOND = "Scene the second solver is told: a planted fault."
SECOND_SET = "The same by a key of the scene: mass.mass=+1%."


class Extras(NamedTuple):
    """What is done beside the comparison; the exit code depends on the first two."""

    require_limits: bool
    self_test: bool
    sensitivity: bool
    verbose: bool


def command(
    scene: options.SceneName,
    tol: Annotated[float | None, options.number_option("--tol", TOL)] = None,
    tol_tension: Annotated[float | None, options.number_option("--tol-tension", TOL_TENSION)] = None,
    other: Annotated[Path | None, typer.Option("--with", metavar="FILE", help="Another program's path as CSV.")] = None,
    with_tol: Annotated[float, options.number_option("--with-tol", "Allowed to it beside our own error bar.")] = 5e-3,
    set_: options.Set = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Print every comparison.")] = False,
    deep: Annotated[bool, typer.Option("--deep", help="Compare other programs, too.")] = False,
    second: Annotated[Path | None, typer.Option("--second", metavar="FILE", help=SECOND)] = None,
    second_set: Annotated[list[str] | None, typer.Option("--second-set", metavar="KEY=VALUE", help=SECOND_SET)] = None,
    sensitive: Annotated[
        bool, typer.Option("--sensitivity", help="Smallest error of each key that is detected.")
    ] = False,
    self_test: Annotated[bool, typer.Option("--self-test", help="Add 1 % to one mass: must be detected.")] = False,
    ask: Annotated[str, typer.Option("--ask", metavar="WHAT", help=ASK)] = "all",
    limits: options.LimitNames = None,
    case: options.Cases = None,
    require: options.RequireLimits = False,
    out: options.Out = None,
) -> int:
    """Run two solvers that share no formula on one scene, or on a grid of scenes; do they agree?

    Writes DIR/: report.html, agreement.json, scene.toml and one folder per method. A grid writes table.csv and
    report.html.

    Every number has a bar: what its solver expects to be wrong with it. Beyond three times both bars the solvers
    disagree. Else, if gap or bars exceed what was asked, the comparison is too coarse. Else they agree.

    FILE has columns t [s] or s_o [m], v [m] positive down, and u [m] if known; of a free ride t, x and y from the left
    support, y down. Other units and directions are told by the name: s_o_over_l, t_ms, v_over_l, v_mm, y_up, ...
    """
    extras = Extras(require, self_test, sensitive, verbose)
    if (line := options.load_line_or_refuse(scene)) is not None:
        others = {"--ask": ask != "all", "--with": other is not None, "--deep": deep, "--verbose": verbose}
        points = options.line_points_from_options(options.with_limits_of_regulations(line, limits), set_, case, others)
        second_scene = _scene_of_second_solver(points[0].scene, second, second_set)
        return _check_lines(points, tol, tol_tension, out, second_scene, extras)
    faults = _option_faults(tol, tol_tension, with_tol, ask)
    loaded = options.with_limits_of_regulations(options.load_scene_or_refuse(scene, faults, needs_mass=True), limits)
    points = _grid_of_scenes(loaded, set_, case)
    settings = {"tol": 1e-3 if tol is None else tol, "tol_tension": tol_tension, "ask": ask}
    if len(points) > 1:
        if other is not None:
            raise store.Refused("--with: holds one path against one scene; leave it out of a grid")
        return _check_grid(loaded, points, out, require, **settings)
    loaded = points[0].scene
    third = None if other is None else (_read_vetted_path(other, loaded), with_tol)
    result, folder = _check_and_write(
        loaded, third, out, deep=deep, second=_scene_of_second_solver(loaded, second, second_set), **settings
    )
    return _print_and_verify_check(result, folder, extras)


def _option_faults(tol: float | None, tol_tension: float | None, with_tol: float, ask: str) -> list[str]:
    """What is wrong with these options, one sentence each."""
    faults = [
        *options.tolerance_faults(tol), *options.tolerance_faults(tol_tension, "--tol-tension", 1e-6, 1.0),
        *options.tolerance_faults(with_tol, "--with-tol", 0.0, 1.0),
    ]  # fmt: skip
    return faults if ask in ("all", "path") else [*faults, f"--ask = {ask!r}: must be all or path"]


def _print_and_verify_check(result: "Check", folder: Path, extras: Extras) -> int:
    """Print a check, read back what was written, and test the judge; return the exit code."""
    from validation.commands.check import words
    from validation.core import limits as judge
    from validation.core.readback import StoredResults
    from validation.page import printing, report

    with terminal.copy_printed_lines() as lines:
        words.print_check(result, extras.verbose)
    if extras.sensitivity:
        from validation.commands.check import sensitivity

        changes = sensitivity.detectable_input_changes(result)
        terminal.print_text(f"  {sensitivity.detectable_changes_sentence(changes)}")
    a = result.a.finest
    b = result.b.finest
    terminal.print_text(f"  written to {folder}: report.html, {a.method}/, {b.method}/")
    broken = printing.print_broken_runs(a, b)
    wrong = 0
    if not broken:
        stored = StoredResults(folder, [a.method, b.method], judged=True)
        wrong = report.read_back_and_report("check", stored, lines)
    unmet = extras.require_limits and judge.any_limit_not_surely_met(result.limits)
    sound = result.verdict.value == "agree" and not (result.doubts or wrong or unmet)
    if extras.self_test:
        from validation.commands.check import selftest

        verdict = selftest.verdict_with_mass_fault(result)
        terminal.print_text(f"  {selftest.self_test_sentence(verdict, b.method, result.tol)}")
        sound = sound and verdict.value == "disagree"
    return broken or int(not sound)


def _check_lines(
    points: list[options.GridPoint], tol: float | None, tol_tension: float | None, out: Path | None, second: Any,
    extras: Extras,
) -> int:  # fmt: skip
    """Check a line of several contacts, at rest or in motion, or a grid of them, and print it; return the exit code.

    second : a line for the second solver alone, or None.
    """
    from validation.commands.check import line as at_rest
    from validation.commands.check import motion
    from validation.commands.run.lines import answer_and_report_lines

    line = points[0].scene
    kind: Any = motion if line.moves else at_rest
    tol = kind.TOL if tol is None else tol
    kind.refuse_tolerances_out_of_range(tol, tol_tension)
    kind.refuse_unlike_second_line(points, second)
    if extras.self_test and not line.car:
        raise store.Refused("--self-test: plants its fault in the mass of a car; must have one")
    results: list[Any] = []

    def check_one(line: Any, report: Any) -> Any:
        how = {"report": report} if line.moves else {}  # at rest it takes a second
        results.append(kind.check_line(line, tol, tol_tension, second, **how))
        return results[-1]

    code = answer_and_report_lines("check", points, out, check_one, extras.require_limits)
    if extras.sensitivity:
        from validation.commands.check import sensitivity

        for result in results:
            changes = kind.detectable_input_changes(result)
            terminal.print_text(f"  {sensitivity.detectable_changes_sentence(changes)}")
    if not extras.self_test:
        return code
    from validation.commands.check import selftest

    verdict = selftest.line_verdict_with_mass_fault(kind.check_line, line, tol, tol_tension)
    terminal.print_text(f"  {selftest.self_test_sentence(verdict, kind.SECOND, tol)}")
    return code or int(verdict.value != "disagree")


def _grid_of_scenes(scene: "Scene", set_pairs: list[str] | None, cases: list[str] | None) -> list[options.GridPoint]:
    """Scenes of a grid; Refused for settings of a method."""
    points = options.grid_points_from_options(scene, set_pairs, cases)
    if settings := sorted({key for point in points for key in point.settings}):
        raise store.Refused(f"--set {settings[0]}: check chooses its settings; keys of the scene have a dot")
    return points


def _read_vetted_path(file: Path, scene: "Scene") -> "ForeignPath":
    """Another program's path; Refused for a wrong direction or unit, which a coarse run of our own shows."""
    from validation.core import foreign
    from validation.core.running import run

    path = foreign.ForeignPath.read(file, scene)
    foreign.refuse_wrong_unit_or_direction(path, run(scene, "following-p2", elements=6, steps=200))
    return path


def _check_and_write(
    scene: "Scene", third_party: "tuple[ForeignPath, float] | None", out: Path | None, **settings: Any
) -> "tuple[Check, Path]":
    """Check a scene, write and draw everything; return the check and its folder.

    third_party : a path and its tolerance.
    """
    from validation.commands.check import study
    from validation.core.answers import write_summary_and_profile
    from validation.core.methods import CHECKED
    from validation.core.sidebyside import do_in_background
    from validation.page import report

    folder = store.claim_and_clear_folder(out, "check", scene, ["agreement.json", "scene.toml", "with.csv", *CHECKED])
    with terminal.progress_bars() as progress:
        result = study.check(scene, progress=progress, **settings)
        progress("writing", 0.0)
        (folder / "with.csv").unlink(missing_ok=True)
        if third_party is not None:
            result = study.with_third_party(result, *third_party)
            third_party[0].write(folder / "with.csv")
        result.write(folder)
        progress("writing", 0.3)
        runs = result.a.finest, result.b.finest
        with do_in_background(partial(_write_paraview_files_of_both, folder, runs)):
            report.write_report_and_finish(folder, "check")
        for r in runs:
            write_summary_and_profile(folder / r.method, scene, r)
        store.mark_finished_with_files(folder, "check")
        progress("writing", 1.0)
    return result, folder


def _scene_of_second_solver(scene: Any, file: Path | None, set_pairs: list[str] | None) -> "Scene | Line | None":
    """The scene for the second solver; None if the same."""
    name = str(file)
    other = scene
    if file is not None:
        other = options.load_line_or_refuse(name) or options.load_scene_or_refuse(name, needs_mass=True)
    try:
        points = options.grid_points_from_options(other, set_pairs)
    except store.Refused as error:
        raise store.Refused([fault.replace("--set", "--second-set", 1) for fault in error.faults]) from None
    if len(points) > 1 or points[0].settings:
        raise store.Refused("--second-set: one value for each key of the scene, as mass.mass=+1%")
    if file is None and not set_pairs:
        return None
    changed: Scene | Line = points[0].scene
    return changed


def _write_paraview_files_of_both(folder: Path, runs: "tuple[Response, ...]") -> None:
    from validation.page import paraview  # slow to load

    for run in runs:
        paraview.write_paraview_files(run, folder / run.method)


def _check_grid(
    scene: "Scene", points: list[options.GridPoint], out: Path | None, require_limits: bool, **settings: Any
) -> int:
    """Check every scene of a grid and write its table; return the exit code: 1 unless all agree."""
    from validation.commands.check import study
    from validation.core.limits import any_scene_may_break_limits
    from validation.page.answer import many

    def row_and_path(point: options.GridPoint) -> tuple[dict[str, Any], Any]:
        result = study.check(point.scene, **settings)
        r = replace(result.a.finest, design=result.design)
        return many.answer_table_row(point.scene, r, result.verdict.value), many.sparse_path_columns(r)

    rows = many.answer_and_store_grid("check", "grid-check", scene, points, out, row_and_path, many.run_table_columns)
    if require_limits and any_scene_may_break_limits(rows):
        return 1
    return 0 if all(row["verdict"] == "agree" for row in rows) else 1
