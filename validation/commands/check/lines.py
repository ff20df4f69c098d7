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


def refuse_before_check(points: list[GridPoint], second: Line | None, self_test: bool) -> None:
    """Refuse a second line that is another one, and a self-test without a car."""
    if second is not None and any(_compared_parts(point.scene) != _compared_parts(second) for point in points):
        raise store.Refused("--second: must be a line with the same contacts, cars and positions")
    if self_test and not points[0].scene.car:
        raise store.Refused("--self-test: plants its fault in the mass of a car; must have one")


def check_write_and_print_lines(
    points: list[GridPoint], tol: float | None, tol_tension: float | None, out: Path | None, second: Line | None,
    require: bool,
) -> tuple[int, list[Any]]:  # fmt: skip
    """Check lines at rest or in motion, write and print them; return the exit code and the answer, of a grid none.

    second : a line for the second solver alone, or None.
    """
    module = _checking_module(points[0].scene)
    results: list[Any] = []

    def check_one(line: Line, report: Any) -> Any:
        how = {"report": report} if line.moves else {}  # at rest it takes a second
        results.append(module.check_line(line, module.TOL if tol is None else tol, tol_tension, second, **how))
        return results[-1]

    return answer_and_report_lines("check", points, out, check_one, require), results


def print_sensitivity_and_run_self_test(
    line: Line, results: list[Any], tol: float | None, tol_tension: float | None, sensitive: bool, self_test: bool
) -> bool:
    """Print what checks would notice, and whether a planted fault is seen; True without a self-test."""
    module = _checking_module(line)
    for result in results if sensitive else ():
        changes = module.detectable_relative_changes(result)
        terminal.print_text(f"  {sensitivity.detectable_changes_sentence(changes)}")
    if not self_test:
        return True
    tol = module.TOL if tol is None else tol
    faulty = selftest.check_with_mass_fault(module.check_line, line, tol, tol_tension)
    return selftest.print_whether_fault_is_seen(faulty.verdict, faulty.methods[1], tol)


def _checking_module(line: Line) -> Any:
    """The module that checks it."""
    return motion if line.moves else at_rest


def _compared_parts(line: Line) -> list[tuple[str, ...]]:
    """Names and kinds of contacts, and of each car its name and, at rest, the shoe that it is on at every position."""
    out: list[tuple[str, ...]] = [(c.name, c.kind) for c in line.contact]
    for car in line.car:
        positions = () if line.moves else range(line.position_count)
        shoes = [line.saddle_with_shoe_at(line.position_of(car, i)) for i in positions]
        out.append((car.name, *(shoe.name if shoe else "" for shoe in shoes)))
    return out
