"""The command `check` on a line of several contacts, or a grid of them, after its options are read."""

from pathlib import Path
from typing import Any

from cablefem.scene.line import Line
from validation.commands.check import line as at_rest
from validation.commands.check import motion, selftest, sensitivity
from validation.commands.run.lines import answer_and_report_lines
from validation.core import store
from validation.page import terminal
from validation.page.options import GridPoint


def check_lines(
    points: list[GridPoint], tol: float | None, tol_tension: float | None, out: Path | None, second: Line | None,
    *, require: bool, sensitive: bool, self_test: bool,
) -> int:  # fmt: skip
    """Check lines at rest or in motion, write and print them; return the exit code.

    second : a line for the second solver alone, or None.
    """
    moves = points[0].scene.moves
    kind: Any = motion if moves else at_rest
    tol = kind.TOL if tol is None else tol
    if second is not None and any(_compared_parts(point.scene) != _compared_parts(second) for point in points):
        raise store.Refused("--second: must be a line with the same contacts, cars and positions")
    if self_test and not points[0].scene.car:
        raise store.Refused("--self-test: plants its fault in the mass of a car; must have one")
    results: list[Any] = []

    def check_one(line: Line, report: Any) -> Any:
        how = {"report": report} if moves else {}  # at rest it takes a second
        results.append(kind.check_line(line, tol, tol_tension, second, **how))
        return results[-1]

    code = answer_and_report_lines("check", points, out, check_one, require)
    for result in results if sensitive else ():
        changes = kind.detectable_input_changes(result)
        terminal.print_text(f"  {sensitivity.detectable_changes_sentence(changes)}")
    if not self_test:
        return code
    verdict = selftest.line_verdict_with_mass_fault(kind.check_line, points[0].scene, tol, tol_tension)
    return code or int(not selftest.fault_is_seen(verdict, results[0].methods[1], tol))


def _compared_parts(line: Line) -> list[tuple[str, ...]]:
    """Names and kinds of contacts, and of each car its name and, at rest, the shoe that it is on at every position."""
    out: list[tuple[str, ...]] = [(c.name, c.kind) for c in line.contact]
    for car in line.car:
        positions = () if line.moves else range(line.position_count)
        shoes = [line.saddle_with_shoe_at(line.position_of(car, i)) for i in positions]
        out.append((car.name, *(shoe.name if shoe else "" for shoe in shoes)))
    return out
