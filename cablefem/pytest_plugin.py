"""Fixtures for tests of a cable solver. All pytest runs load this, so imports wait."""

import importlib
from collections.abc import Callable
from typing import Any

import pytest

_KEY = "cablefem agreement"
_CHECKS: pytest.StashKey[dict[Any, Any]] = pytest.StashKey()


@pytest.fixture(scope="session")
def cable_scene() -> Callable[[str], Any]:
    """cable_scene("level") is a built-in scene or line, or that of a TOML file."""
    from cablefem.scene.short import load_scene_or_line

    def load(name_or_file: str) -> Any:
        __tracebackhide__ = True
        try:
            return load_scene_or_line(name_or_file)
        except ValueError as refused:
            raise refused.with_traceback(None) from None  # without the library's source

    return load


@pytest.fixture
def assert_agree(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """`validation.assert_agree`, listed at the end of the session."""
    return _import_check_testing().reporting_assert_agree(_verdict_recorder(request))


@pytest.fixture
def cable_check(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """`validation.check_solver`, asserted and listed at the end of the session.

    cable_check("level", solver) holds solver(scene) -> (s_o, v) or (s_o, v, u) against both built-in solvers.
    cable_check("level") holds these against one another, of a line in motion or at rest, too.
    """
    return _import_check_testing().asserting_check(
        _verdict_recorder(request), request.config.stash.setdefault(_CHECKS, {})
    )


def _import_check_testing() -> Any:
    """The module `validation.commands.check.testing`; fails the test where another `validation` hides it."""
    try:
        return importlib.import_module("validation.commands.check.testing")
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith("validation"):
            raise
        pytest.fail("a package of this project hides cablefem's own `validation`: its fixtures cannot be used here")


def _verdict_recorder(request: pytest.FixtureRequest) -> Callable[[str, str], None]:
    # user properties reach pytest-xdist
    return lambda text, verdict: request.node.user_properties.append((_KEY, f"{verdict:<14} {text}"))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Add a line on each agreement that the tests asked for."""
    lines = [
        f"{value}  ({report.nodeid})"
        for reports in terminalreporter.stats.values() for report in reports
        if getattr(report, "when", None) == "call"
        for key, value in report.user_properties if key == _KEY
    ]  # fmt: skip
    if lines:
        terminalreporter.section("agreement of cable solvers")
        for line in lines:
            terminalreporter.line(line)
