"""The judge of both solvers: verdicts, studies and reports.  `validation.check` is what `cablefem check` computes.

Nothing is loaded before it is used.  A first argument `scene` may also be the name
of a built-in scene or the path of a TOML file.
"""

import functools
import importlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar, cast

if TYPE_CHECKING:
    from validation.commands.check.study import check, check_solver
    from validation.commands.find.study import find
    from validation.commands.run.study import quasi_static_with_bars as _quasi_static_with_bars
    from validation.commands.run.study import run_with_bars as _run_with_bars
    from validation.commands.sweep.engine import sweep as _sweep
    from validation.core.assertions import assert_agree
    from validation.core.foreign import ForeignPath
    from validation.core.running import run as _run

_HOME = {
    "run": "core.running",
    "run_with_bars": "commands.run.study",
    "find": "commands.find.study",
    "sweep": "commands.sweep.engine",
    "quasi_static_with_bars": "commands.run.study",
    "assert_agree": "core.assertions",
    "check_solver": "commands.check.study",
    "advice": "commands.advise.study",
    "ForeignPath": "core.foreign",
} | {name: f"commands.{name}.study" for name in ("advise", "atlas", "chart", "check", "modes", "paper")}

__all__ = [
    "ForeignPath",
    "assert_agree",
    "check",
    "check_solver",
    "find",
    "quasi_static_with_bars",
    "run",
    "run_with_bars",
    "sweep",
]


# what computes a line of several contacts; {} is motion or line, at rest
_LINE = {
    "run_with_bars": ("commands.run.{}", "answer_line"),
    "check": ("commands.check.{}", "check_line"),
    "quasi_static_with_bars": ("commands.run.quasi", "answer_line_quasi_statically"),
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return accepting_scene_names(_import_from_validation(_HOME[name], name))


def _import_from_validation(module: str, name: str) -> Any:
    return getattr(importlib.import_module(f"validation.{module}"), name)


P = ParamSpec("P")
Result = TypeVar("Result")


def accepting_scene_names(function: Callable[Concatenate[Any, P], Result]) -> Callable[Concatenate[Any, P], Result]:
    """Let a function of a scene, or of a study, take its name or file, too; a line where it computes lines.

    SceneError for another line, TypeError for what is meant for one span.
    """
    first = next(iter(inspect.signature(function).parameters), "") if inspect.isfunction(function) else ""
    if first not in ("scene", "study"):
        return function

    @functools.wraps(function)
    def load_and_call(of: Any, *args: P.args, **kwargs: P.kwargs) -> Result:
        """See the function that is wrapped."""
        from cablefem.scene import Scene
        from cablefem.scene.line import Line
        from cablefem.scene.short import load_line_or_none

        kind = Scene if first == "scene" else _import_from_validation("commands.sweep.study", "Study")
        if isinstance(of, str | Path):
            of = (function.__name__ in _LINE and load_line_or_none(of)) or kind.load(of)
        if isinstance(of, Line):
            return cast(Result, _line_counterpart(function, of, args, kwargs)(of, *args, **kwargs))
        if not isinstance(of, kind):
            raise TypeError(f"{first} must be a {kind.__name__}, its name or its file, got {of!r}")
        _refuse_second_of_other_kind(of, kwargs.get("second"))
        return function(of, *args, **kwargs)

    return load_and_call


def _line_counterpart(
    function: Callable[..., Any], line: Any, args: tuple[Any, ...], kwargs: dict[str, Any]
) -> Callable[..., Any]:
    """What computes a line in place of this function; its arguments must fit."""
    from cablefem.scene import SceneError
    from cablefem.scene.described import OF_ONE_SPAN

    if function.__name__ not in _LINE:
        raise SceneError([OF_ONE_SPAN])
    home, of_line = _LINE[function.__name__]
    solve: Callable[..., Any] = _import_from_validation(home.format("motion" if line.moves else "line"), of_line)
    documented = inspect.signature(function).parameters
    own = inspect.signature(solve)
    taken = [x for x in own.parameters.values() if x.name == "line" or x.name in documented]
    try:
        bound = own.replace(parameters=taken).bind(line, *args, **kwargs)
    except TypeError as error:
        names = ", ".join(x.name for x in taken[1:])
        only = f", only {names}" if names else ""
        raise TypeError(f"a line takes no method and no settings{only}: {error}") from None
    _refuse_second_of_other_kind(line, bound.arguments.get("second"))
    return solve


def _refuse_second_of_other_kind(first: Any, second: Any) -> None:
    """Raise TypeError unless the second solver's scene or line, if there is one, is of the kind of the first one's."""
    if second is None:
        return
    from cablefem.scene import Scene
    from cablefem.scene.line import Line

    kind = Scene if isinstance(first, Scene) else Line
    if not isinstance(second, kind):
        raise TypeError(f"second must be a {kind.__name__}, as the first; got {second!r}")
    if getattr(second, "moves", None) != getattr(first, "moves", None):
        raise TypeError("second must be at rest or in motion as the first")


if TYPE_CHECKING:
    quasi_static_with_bars = accepting_scene_names(_quasi_static_with_bars)
    run = accepting_scene_names(_run)
    run_with_bars = accepting_scene_names(_run_with_bars)
    sweep = accepting_scene_names(_sweep)


def command_names() -> list[str]:
    return sorted(found.parent.name for found in Path(__file__).parent.glob("commands/*/__init__.py"))


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_HOME})
