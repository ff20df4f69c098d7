"""The judge of both solvers: verdicts, studies and reports.  `validation.check` is what `cablefem check` computes.

Nothing is loaded before it is used: `import validation` costs nothing.
"""

import importlib
import importlib.util
import pkgutil
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from validation.core.assertions import assert_agree
    from validation.core.foreign import ForeignPath
    from validation.core.running import run

_HOME = {
    "run": "core.running",
    "assert_agree": "core.assertions",
    "check_solver": "commands.check.study",
    "advice": "commands.advise.study",
    "ForeignPath": "core.foreign",
}

__all__ = ["ForeignPath", "assert_agree", "check_solver", "run"]


def __getattr__(name: str) -> Any:
    """Return a public name, or the function of a command's study that is named as the command."""
    if name in _HOME:
        return getattr(importlib.import_module(f"validation.{_HOME[name]}"), name)
    if name in command_names() and importlib.util.find_spec(f"validation.{name}") is None:
        return getattr(importlib.import_module(f"validation.commands.{name}.study"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def command_names() -> list[str]:
    """Return the names of the commands: the folders of validation/commands."""
    return [found.name for found in pkgutil.iter_modules([f"{__path__[0]}/commands"]) if found.ispkg]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *command_names()})
