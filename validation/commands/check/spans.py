"""The command `check` on one span, after its options are read: files, page, what is printed, exit code.

What judges and draws is loaded while the solvers run (`study`).
"""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from cablefem.scene import Scene
from validation.commands.check import study
from validation.core import foreign, limits, store
from validation.core.answers import write_summary_and_profile
from validation.core.foreign import ForeignPath
from validation.core.methods import CHECKED
from validation.core.running import run
from validation.core.sidebyside import do_in_background
from validation.page import report, terminal
from validation.page.answer import write_animations
from validation.page.options import GridPoint


def read_vetted_path(file: Path, scene: Scene) -> ForeignPath:
    """Another program's path; Refused for a wrong direction or unit, which a coarse run of our own shows."""
    path = ForeignPath.read(file, scene)
    foreign.refuse_wrong_unit_or_direction(path, run(scene, "following-p2", elements=6, steps=200))
    return path


def check_and_write(
    scene: Scene, third_party: tuple[ForeignPath, float] | None, out: Path | None, **asked: Any
) -> tuple[study.Check, Path]:
    """Check a scene, write and draw everything; return the check and its folder.

    third_party : a path and its tolerance.
    """
    folder = store.claim_and_clear_folder(out, "check", scene, ["agreement.json", "scene.toml", "with.csv", *CHECKED])
    with terminal.progress_bars() as progress:
        result = study.check(scene, progress=progress, **asked)
        progress("writing", 0.0)
        (folder / "with.csv").unlink(missing_ok=True)
        if third_party is not None:
            result = study.with_third_party_rows(result, *third_party)
            third_party[0].write(folder / "with.csv")
        result.write(folder)
        progress("writing", 0.3)
        runs = result.a.finest, result.b.finest
        with do_in_background(partial(write_animations, folder, runs)):
            report.write_report_and_mark_finished(folder, "check")
        for r in runs:
            write_summary_and_profile(folder / r.method, scene, r)
        store.mark_finished_with_files(folder, "check")
        progress("writing", 1.0)
    return result, folder


def print_and_verify_check(
    result: study.Check, folder: Path, *, require: bool, sensitive: bool, self_test: bool, verbose: bool
) -> int:
    """Print a check, read back what was written, and test the judge; return the exit code."""
    from validation.commands.check import selftest, sensitivity, words
    from validation.core.readback import StoredResults
    from validation.page import printing

    with terminal.copy_printed_lines() as lines:
        words.print_check(result, verbose)
    if sensitive:
        changes = sensitivity.detectable_relative_changes(result)
        terminal.print_text(f"  {sensitivity.detectable_changes_sentence(changes)}")
    a, b = result.methods
    terminal.print_text(f"  written to {folder}: report.html, {a}/, {b}/")
    broken = printing.print_broken_runs(result.a.finest, result.b.finest)
    wrong = 0
    if not broken:
        wrong = report.read_back_and_report("check", StoredResults(folder, [a, b], judged=True), lines)
    unmet = require and limits.any_limit_not_surely_met(result.limits)
    sound = result.verdict.value == "agree" and not (result.doubts or wrong or unmet)
    if self_test:
        sound &= selftest.print_whether_fault_is_seen(selftest.run_and_judge_with_mass_fault(result), b, result.tol)
    return broken or int(not sound)


def check_and_write_grid(scene: Scene, points: list[GridPoint], out: Path | None, require: bool, **asked: Any) -> int:
    """Check every scene of a grid and write its table; return the exit code: 1 unless all agree."""
    from validation.page.answer import many

    def row_and_path(point: GridPoint) -> tuple[dict[str, Any], Any]:
        result = study.check(point.scene, **asked)
        r = replace(result.a.finest, design=result.design)
        return many.answer_table_row(point.scene, r, result.verdict.value), many.sparse_path_columns(r)

    rows = many.answer_and_store_grid("check", "grid-check", scene, points, out, row_and_path, many.run_table_columns)
    if require and limits.any_scene_may_break_limits(rows):
        return 1
    return 0 if all(row["verdict"] == "agree" for row in rows) else 1
