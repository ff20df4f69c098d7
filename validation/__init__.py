"""The judge of both solvers: verdicts, studies and reports.  The public names are those of the commands.

Nothing is loaded before it is used: `import validation` costs nothing.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from validation.assertions import assert_agree, check_solver
    from validation.foreign import ForeignPath
    from validation.run import run
    from validation.studies.adequacy import advise
    from validation.studies.check import check
    from validation.studies.claims import paper
    from validation.studies.modes import modes
    from validation.studies.stability.atlas import atlas
    from validation.studies.workprecision import chart

_HOME = {
    "check": "studies.check",
    "run": "run",
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


class _Package(ModuleType):
    """A package whose public names stay what they are when a submodule of the same name (`run`) is loaded."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"validation.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


sys.modules[__name__].__class__ = _Package
