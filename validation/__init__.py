"""The judge of both solvers: verdicts, studies and reports.  `validation.check` is what `cablefem check` computes.

Nothing is loaded before it is used.  A first argument `scene` may also be the name
of a built-in scene or the path of a TOML file.
"""

import functools
import importlib
import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from validation.commands.check.study import check, check_solver
    from validation.commands.run.study import run_with_bars
    from validation.commands.sweep.engine import sweep
    from validation.core.assertions import assert_agree
    from validation.core.foreign import ForeignPath
    from validation.core.quasi_static import quasi_static
    from validation.core.running import run

_HOME = {
    "run": "core.running",
    "run_with_bars": "commands.run.study",
    "sweep": "commands.sweep.engine",
    "quasi_static": "core.quasi_static",
    "assert_agree": "core.assertions",
    "check_solver": "commands.check.study",
    "advice": "commands.advise.study",
    "ForeignPath": "core.foreign",
} | {name: f"commands.{name}.study" for name in ("advise", "atlas", "certify", "chart", "check", "modes", "paper")}

__all__ = ["ForeignPath", "assert_agree", "check", "check_solver", "quasi_static", "run", "run_with_bars", "sweep"]


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _by_name(getattr(importlib.import_module(f"validation.{home}"), name))


_READ = {"scene": ("cablefem.scene", "Scene"), "study": ("validation.commands.sweep.study", "Study")}
# what computes a line of several contacts, at rest
_AT_REST = {"run_with_bars": "validation.commands.run.line:answers", "check": "validation.commands.check.line:checked"}


def _by_name(function: Any) -> Any:
    """Return a function of a scene, or of a study, that takes its name or file, too."""
    first = next(iter(inspect.signature(function).parameters), "") if inspect.isfunction(function) else ""
    if first not in _READ:
        return function

    @functools.wraps(function)
    def named(of: Any, *args: Any, **kwargs: Any) -> Any:
        if first == "scene" and function.__name__ in _AT_REST and (line := _line(of)) is not None:
            home, name = _AT_REST[function.__name__].split(":")
            return getattr(importlib.import_module(home), name)(line, *args, **kwargs)
        if isinstance(of, str | Path):
            home, kind = _READ[first]
            of = getattr(importlib.import_module(home), kind).load(of)
        return function(of, *args, **kwargs)

    return named


def _line(of: Any) -> Any:
    """Return a line at rest, also by its name or file; None of anything else."""
    line = importlib.import_module("cablefem.scene.line")
    if isinstance(of, str | Path):
        return line.Line.load(of) if line.is_line(of) else None
    return of if isinstance(of, line.Line) else None


def command_names() -> list[str]:
    return sorted(found.parent.name for found in Path(__file__).parent.glob("commands/*/__init__.py"))


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_HOME})
