"""Fixtures for the tests of a cable solver: scenes by name, agreement as an assertion, the full cross-check.

Loaded by every pytest run of an environment that has this package, so nothing is imported before a fixture is used.
"""

import importlib
from collections.abc import Callable
from typing import Any

import pytest

_KEY = "cablefem agreement"
_CHECKS: pytest.StashKey[dict[Any, Any]] = pytest.StashKey()


@pytest.fixture(scope="session")
def cable_scene() -> Callable[[str], Any]:
    """A factory: cable_scene("level") is the built-in scene of that name, or the one in that TOML file."""
    from cablefem import Scene

    return Scene.load


@pytest.fixture
def assert_agree(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """`validation.assert_agree`, told in the summary at the end of the session."""
    return _judge().asserting(_teller(request))


@pytest.fixture
def cable_check(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """A function of a scene, and a solver of one's own: `validation.check_solver`, asserted and told in the summary.

    cable_check("level", solver) holds solver(scene) -> (s_o, v) or (s_o, v, u) against both built-in solvers, which
    are run once per session and scene; cable_check("level") holds these against one another.
    """
    return _judge().checking(_teller(request), request.config.stash.setdefault(_CHECKS, {}))


def _judge() -> Any:
    try:
        return importlib.import_module("validation.commands.check.testing")
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith("validation"):
            raise
        pytest.fail("a package of this project hides cablefem's own `validation`: its fixtures cannot be used here")


def _teller(request: pytest.FixtureRequest) -> Callable[[str, str], None]:
    # User properties travel with the reports, also from the workers of pytest-xdist.
    return lambda text, verdict: request.node.user_properties.append((_KEY, f"{verdict:<14} {text}"))


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
