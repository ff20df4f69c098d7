"""The judge of both solvers: verdicts, studies and reports.  The public names are those of the commands.

Nothing is loaded before it is used: `import validation` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from validation.assertions import assert_agree, check_solver
    from validation.foreign import ForeignPath
    from validation.running import run
    from validation.studies.adequacy import advise
    from validation.studies.check import check
    from validation.studies.claims import paper
    from validation.studies.modes import modes
    from validation.studies.stability.atlas import atlas
    from validation.studies.workprecision import chart

_HOME = {
    "check": "studies.check",
    "run": "running",
    "modes": "studies.modes",
    "advise": "studies.adequacy",
    "chart": "studies.workprecision",
    "atlas": "studies.stability",
    "paper": "studies.claims",
    "assert_agree": "assertions",
    "check_solver": "assertions",
    "ForeignPath": "foreign",
}

__all__ = ["ForeignPath", "advise", "assert_agree", "atlas", "chart", "check", "check_solver", "modes", "paper", "run"]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"validation.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
