"""Lines at rest and in motion: what their answers have in common, and how they are stored and printed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

from cablefem.response import write_json
from cablefem.scene import SceneError
from cablefem.scene.line import Line
from validation.core import limits, store
from validation.core.agreement import Agreement, Verdict, excess_over_tolerance_sentence, worst_deciding_verdict
from validation.core.answers import Outcome
from validation.core.sidebyside import Progress, no_progress
from validation.page import line as at_rest
from validation.page import motion, report, terminal
from validation.page.answer import many as table
from validation.page.options import GridPoint

TOUCHES = -1e-6  # [m] a rope that ends on the ground does not hit it
Row = dict[str, Any]
Solve = Callable[[Line, Progress], "LineAnswers"]  # reports the fraction done, and what


@dataclass(frozen=True, kw_only=True, repr=False)
class LineAnswers:
    """A line and its numbers; of a check also the judged rows."""

    line: Line
    design: list[Row]
    rows: list[Agreement] = field(default_factory=list)

    def __repr__(self) -> str:
        result = self.verdict.value if self.verdict else self.status
        return f"Answers({self.line.name}: {result}; {self.outcome.sentence})"

    @property
    def verdict(self) -> Verdict | None:
        """Of all rows; None if nothing was compared."""
        return worst_deciding_verdict(self.rows) if self.rows else None

    @property
    def limits(self) -> list[Row]:
        """Verdicts on the limits of the line."""
        return limits.limit_rows(self.line, self.design)

    @property
    def tension_max(self) -> Row:
        """The largest tension."""
        return next(d for d in self.design if d["quantity"] == "tension_max")

    @property
    def status(self) -> Literal["complete", "incomplete"]:
        """Complete: every position has a rest, or the motion came to its end."""
        raise NotImplementedError

    @property
    def outcome(self) -> Outcome:
        """What becomes of the line, worst first."""
        raise NotImplementedError

    @property
    def methods(self) -> list[str]:
        """Names of both solvers."""
        raise NotImplementedError

    @property
    def method(self) -> str:
        """Name of the solver of the numbers."""
        return self.methods[0]

    @property
    def curve_for_grid_page(self) -> list[list[float]] | None:
        """What a page of many lines draws of this one: x and depth, or None."""
        return None

    def write(self, folder: Path | str, seconds: float | None = None) -> None:
        """Write the files; seconds : of the computation, if they are known."""
        raise NotImplementedError

    def comparison_in_words(self, row: Agreement) -> str:
        """What a row compares."""
        return f"{row.quantity} {row.law}".strip()

    def output_faults(self, folder: Path, html: str) -> list[str]:
        """Faults of the files and of the page, as sentences."""
        return []

    def print_answer(self, seconds: float) -> None:
        """Print outcome, limits and design numbers."""
        raise NotImplementedError

    def table_row(self) -> Row:
        """The row of a table of lines, without the design numbers."""
        row: Row = {"outcome": self.outcome.sentence, "status": self.status, **limits.worst_limit_columns(self.limits)}
        return row | ({"verdict": self.verdict.value} if self.verdict else {})


def answer_and_report_lines(
    command: str, points: Sequence[GridPoint], out: Path | None, solve: Solve, require_limits: bool,
    at_rest: bool = False,
) -> int:  # fmt: skip
    """Answer a line or a grid, store, draw and print it; return the exit code.

    at_rest : answers of lines in motion are states of rest.
    1 where solvers or files do not agree, or a required limit fails; 2 where a run broke or a position has no rest.
    """
    line: Line = points[0].scene
    moves = line.moves and not at_rest
    if len(points) > 1:
        rows = _answer_line_grid(command, points, moves, out, solve)
    else:
        rows = [_answer_one_line(command, line, moves, out, solve)]
    if any(x.get("verdict", "agree") != "agree" or x.get("faults") for x in rows):
        return 1
    if any(x["status"] != "complete" for x in rows):
        return 2
    return int(require_limits and limits.any_scene_may_break_limits(rows))


def _answer_one_line(command: str, line: Line, moves: bool, out: Path | None, solve: Solve) -> Row:
    """Solve a line, write, draw and print its answer, and read it back; return its row with the number of faults."""
    from validation.core.readback import line_terminal_faults  # slow to import

    home = f"motion-{command}" if moves else {"run": "rest", "check": "rest-check"}[command]
    with terminal.progress_bars() as progress:
        progress(line.name, 0.0)
        begun = perf_counter()
        result = solve(line, partial(progress, line.name))
        seconds = perf_counter() - begun
    folder = store.claim_and_clear_folder(
        out, command, line, [home, "agreement.json"] if command == "check" else [home]
    )
    result.write(folder / home, seconds)
    if result.verdict:
        verdict = result.verdict.value
        rows = [row.to_json() for row in result.rows]
        agreement = {"verdict": verdict, "methods": result.methods, "rows": rows, "limits": result.limits}
        write_json(folder / "agreement.json", agreement)
    with terminal.copy_printed_lines() as printed:
        if result.verdict:
            terminal.print_verdict(result.verdict.value)
        result.print_answer(seconds)
        if result.rows:
            terminal.print_text(f"  {_agreement_counts_sentence(result)}")
            if result.verdict is Verdict.TOO_COARSE and (excess := excess_over_tolerance_sentence(result.rows)):
                terminal.print_text(f"  {excess}")
    report.write_report_and_mark_finished(folder, command)
    html = "".join(f"{section.summary}{section.html}" for section in report.read_stored_sections(folder, command))
    faults = [*result.output_faults(folder / home, html), *line_terminal_faults(printed, html, folder / home)]
    report.report_read_back_faults(folder, command, faults)
    terminal.print_text(f"  written to {folder}: report.html, {home}/")
    return result.table_row() | {"faults": len(faults)}


def _agreement_counts_sentence(result: LineAnswers) -> str:
    """How many comparisons agree, laws hold and printed numbers are as computed, and the worst of the others."""
    rows = result.rows
    printed = [row for row in rows if row.quantity == "printed"]
    laws = [row for row in rows if row.bound.kind == "law" and row not in printed]
    comparisons = [row for row in rows if row.bound.kind != "law"]
    parts = []
    for group, words in (
        (comparisons, "comparisons of two solvers agree"),
        (laws, "laws hold"),
        (printed, "kinds of printed numbers are as computed"),
    ):
        if group:
            agreeing = sum(row.verdict is Verdict.AGREE for row in group)
            parts.append(f"{agreeing} of {len(group)} {words}")
    wrong = [result.comparison_in_words(row) for row in rows if row.verdict is not Verdict.AGREE]
    if wrong:
        parts.append(f"not so: {', '.join(wrong[:4])}")
    return "; ".join(parts)


def _answer_line_grid(
    command: str, points: Sequence[GridPoint], moves: bool, out: Path | None, solve: Solve
) -> list[Row]:  # fmt: skip
    def row_and_curve(point: GridPoint) -> tuple[Row, Any]:
        try:
            result = solve(point.scene, no_progress)
        except (store.Refused, SceneError) as error:
            return {"status": "incomplete", "why": str(error)}, None
        row = result.table_row() | {d["quantity"]: d["value"] for d in result.design}
        return row, store.nulls_for_nonfinite(result.curve_for_grid_page)

    line = points[0].scene
    kind = "motion" if moves else "rest"
    columns = motion.motion_table_columns if moves else at_rest.rest_table_columns
    return table.answer_and_store_grid(command, f"grid-{kind}-{command}", line, points, out, row_and_curve, columns)
