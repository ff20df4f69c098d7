"""Dynamics of an elastic cable that carries a moving mass.

    import cablefem as cf

    line = cf.Scene.load("zip.toml")
    print(cf.quasi_static(line).events)
    for rider in line.variants({"mass.mass": [40.0, 80.0]}):
        print(cf.check(rider))

Functions take a scene, the name of a built-in one, or a TOML file; `run` and `check` a `Line` of several spans, too.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cablefem.response import Response
    from cablefem.scene import Scene, SceneError
    from cablefem.scene.line import Line
    from validation import assert_agree, check, find, sweep
    from validation import quasi_static_with_bars as quasi_static
    from validation import run_with_bars as run

__all__ = [
    "Line",
    "Response",
    "Scene",
    "SceneError",
    "__version__",
    "assert_agree",
    "check",
    "find",
    "quasi_static",
    "run",
    "sweep",
]
__version__ = "0.4.0"
_HOME = {
    "Line": "cablefem.scene.line", "Response": "cablefem.response", "Scene": "cablefem.scene",
    "SceneError": "cablefem.scene",
}  # fmt: skip

_NAMED_OTHERWISE = {"run": "run_with_bars", "quasi_static": "quasi_static_with_bars"}  # in `validation`


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    found = getattr(importlib.import_module("validation"), _NAMED_OTHERWISE.get(name, name))
    found.__name__ = found.__qualname__ = name  # for help()
    found.__module__ = __name__  # found here by other processes, as the same object
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
