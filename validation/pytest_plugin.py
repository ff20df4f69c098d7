"""Fixtures for the tests of a cable solver: scenes by name, agreement as an assertion, the full cross-check.

Loaded by every pytest run of an environment that has this package, so nothing is imported before a fixture is used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

_KEY = "cablefem agreement"


@pytest.fixture(scope="session")
def cable_scene() -> Callable[[str], Any]:
    """A factory: cable_scene("level") is the built-in scene of that name, or the one in that TOML file."""
    from cablefem import Scene

    return Scene.load


@pytest.fixture
def assert_agree(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """`validation.assert_agree`, told in the summary at the end of the session."""
    from validation.core import assertions

    def asserted(a: Any, b: Any, **bounds: Any) -> Any:
        names = f"{a.method} and {b.method}"
        try:
            rows = assertions.assert_agree(a, b, **bounds)
        except AssertionError as error:
            _tell(request, f"{names}: {str(error).splitlines()[-1].strip()}", "disagree")
            raise
        _tell(request, f"{names}: {_worst(rows)}", "agree")
        return rows

    return asserted


@pytest.fixture
def cable_check(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """A function of a scene, and a solver of one's own: `validation.check_solver`, asserted and told in the summary.

    cable_check("level", solver) holds solver(scene) -> (s_o, v) or (s_o, v, u) against both built-in solvers, which
    are run once per session and scene; cable_check("level") holds these against one another.
    """
    from validation.commands.check.study import check, check_solver
    from validation.core import assertions, foreign
    from validation.core.agreement import Verdict, overall

    kept = request.config.stash.setdefault(_CHECKS, {})

    def checked(scene: Any, solver: Any = None, *, tol: float = 1e-3, with_tol: float = foreign.WITH_TOL) -> Any:
        from cablefem import Scene

        scene = scene if isinstance(scene, Scene) else Scene.load(scene)
        key = (scene.to_toml(), tol)
        if key not in kept:
            kept[key] = check(scene, tol=tol)
        result = kept[key]
        if solver is not None:
            result = check_solver(scene, solver, tol=tol, with_tol=with_tol, ours=result)
        party, rows = f"{result.a.run.method} and {result.b.run.method}", result.rows
        if solver is not None:  # its own rows, and whether there is one path to hold it against
            rows = [row for row in rows if row.party or row.quantity == "path_max"]
            party = rows[-1].party
        verdict = overall(rows)
        _tell(request, f"{scene.name}, {party}: {_worst(rows)}", verdict.value)
        failed = [row for row in rows if row.verdict is not Verdict.AGREE]
        if failed:
            raise AssertionError(
                "\n".join([f"{scene.name}: {verdict.value}", *(f"  {assertions.told(row)}" for row in failed)])
            )
        return result

    return checked


_CHECKS: pytest.StashKey[dict[Any, Any]] = pytest.StashKey()


def _worst(rows: Any) -> str:
    """Return the row that uses most of what it was allowed."""
    row = max(rows, key=lambda row: row.gap / row.allowed if row.allowed > 0.0 else 0.0)
    return f"{row.quantity} {row.gap:.2g} of {row.allowed:.2g} allowed"


def _tell(request: pytest.FixtureRequest, text: str, verdict: str) -> None:
    # User properties travel with the reports, also from the workers of pytest-xdist.
    request.node.user_properties.append((_KEY, f"{verdict:<14} {text}"))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """List the agreement checks that were made."""
    told = [
        f"{value}  ({report.nodeid})"
        for reports in terminalreporter.stats.values() for report in reports
        if getattr(report, "when", None) == "call"
        for key, value in report.user_properties if key == _KEY
    ]  # fmt: skip
    if told:
        terminalreporter.section("agreement of cable solvers")
        for line in told:
            terminalreporter.line(line)
