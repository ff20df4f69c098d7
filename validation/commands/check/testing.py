"""Assertions for the fixtures of `cablefem.pytest_plugin`, with their margins."""

from collections.abc import Callable, Sequence
from typing import Any

import validation
from cablefem.scene import Scene
from cablefem.scene.line import Line
from cablefem.scene.short import load_scene_or_line
from validation.commands.check.study import check_solver
from validation.core import assertions
from validation.core.agreement import Agreement, Verdict, refuse_out_of_range, worst_deciding_verdict
from validation.core.foreign import WITH_TOL
from validation.core.measures import NotComparable
from validation.core.store import Refused

Report = Callable[[str, str], None]  # subject and verdict


def reporting_assert_agree(report: Report) -> Callable[..., list[Agreement]]:
    """`assert_agree` that also reports the answers' names and the worst row."""

    def asserted(a: Any, b: Any, **bounds: Any) -> list[Agreement]:
        """See `assert_agree`."""
        __tracebackhide__ = True
        names = assertions.names_of_both_methods_or_raise(a, b)
        try:
            rows = assertions.assert_agree(a, b, **bounds)
        except AssertionError as error:
            what, _, _ = str(error).splitlines()[-1].strip().partition("; ")
            compared = not isinstance(error.__context__, NotComparable)
            report(f"{names}: {what}", "disagree" if compared else "not comparable")
            raise
        except ValueError as refused:
            raise refused.with_traceback(None) from None  # without the library's source
        report(f"{names}: {_worst_row_text(rows)}", "agree")
        return rows

    return asserted


def asserting_check(report: Report, earlier_checks: dict[Any, Any]) -> Callable[..., Any]:
    """`check` or `check_solver` that asserts and reports; checks are stored in `earlier_checks` and made once."""

    def checked(scene: Any, solver: Any = None, *, tol: float | None = None, with_tol: float = WITH_TOL) -> Any:
        """The check of a scene or line, or of a user's solver on a scene; AssertionError unless all rows agree.

        tol : that of `cablefem check` by default.
        """
        __tracebackhide__ = True
        try:
            refuse_out_of_range("with_tol", with_tol, 0.0, 1.0)  # before the check is computed
            scene = _load_scene_or_line_or_refuse(scene, solver)
            result = _check_and_store_once(scene, tol, earlier_checks)
        except ValueError as refused:
            raise refused.with_traceback(None) from None  # without the library's source
        names = " and ".join(result.methods)
        rows = reported = result.rows
        if solver is not None:
            result = _check_users_solver(scene, solver, with_tol, result)
            reported = [row for row in result.rows if row.third_party]
            names = reported[-1].third_party
            # and whether a path was comparable
            rows = [row for row in result.rows if row.third_party or row.quantity == "path_max"]
        verdict = worst_deciding_verdict(rows)
        report(f"{scene.name}, {names}: {_worst_row_text(reported)}", verdict.value)
        if verdict is not Verdict.AGREE:
            raise AssertionError(assertions.failure_text(f"{scene.name}: {verdict.value}", rows))
        return result

    return checked


def _load_scene_or_line_or_refuse(scene: Any, solver: Any) -> Scene | Line:
    """The scene or line, or that of a name or file; Refused for a line with a user's solver."""
    scene = scene if isinstance(scene, Scene | Line) else load_scene_or_line(scene)
    if isinstance(scene, Line) and solver is not None:
        own = "a solver of your own is compared on one span, this is a line of contacts"
        raise Refused(f"{scene.name}: {own}")
    return scene


def _check_and_store_once(scene: Any, tol: float | None, earlier_checks: dict[Any, Any]) -> Any:
    """The check of a scene or line by a tolerance, made if it is not among the earlier ones."""
    key = (scene.to_toml(), tol)
    if key not in earlier_checks:
        tolerance: dict[str, Any] = {} if tol is None else {"tol": tol}
        earlier_checks[key] = validation.check(scene, **tolerance)
    return earlier_checks[key]


def _check_users_solver(scene: Any, solver: Any, with_tol: float, ours: Any) -> Any:
    """`check_solver` with a short traceback."""
    __tracebackhide__ = True
    try:
        return check_solver(scene, solver, with_tol=with_tol, ours=ours)
    except Refused as refused:  # without the library's source
        raise Refused(refused.faults) from None


def _worst_row_text(rows: Sequence[Agreement]) -> str:
    """The row with the largest gap over what is allowed."""
    row = max(rows, key=lambda row: row.gap / row.allowed if row.allowed > 0.0 else 0.0)
    return f"{assertions.row_name(row)} {row.gap:.2g} of {row.allowed:.2g} allowed"
