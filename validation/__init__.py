"""The judge of both solvers: verdicts, studies and reports.  The public names are those of the commands.

Nothing is loaded before it is used: `import validation` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from validation.commands.advise.study import advise
    from validation.commands.atlas.study import atlas
    from validation.commands.chart.study import chart
    from validation.commands.check.study import check, check_solver
    from validation.commands.modes.study import modes
    from validation.commands.paper.study import paper
    from validation.core.assertions import assert_agree
    from validation.core.foreign import ForeignPath
    from validation.core.running import run

_HOME = {
    "check": "commands.check.study",
    "run": "core.running",
    "modes": "commands.modes.study",
    "advise": "commands.advise.study",
    "chart": "commands.chart.study",
    "atlas": "commands.atlas.study",
    "paper": "commands.paper.study",
    "assert_agree": "core.assertions",
    "check_solver": "commands.check.study",
    "ForeignPath": "core.foreign",
}

__all__ = ["ForeignPath", "advise", "assert_agree", "atlas", "chart", "check", "check_solver", "modes", "paper", "run"]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"validation.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
