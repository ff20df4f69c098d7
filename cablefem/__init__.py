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
    from cablefem.scene import Scene, SceneError
    from cablefem.scene.line import Line

__all__ = ["Line", "Scene", "SceneError", "__version__", "assert_agree", "check", "quasi_static", "run", "sweep"]
__version__ = "0.3.0"


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = {"Line": "cablefem.scene.line", "Scene": "cablefem.scene", "SceneError": "cablefem.scene"}.get(
        name, "validation"
    )
    return getattr(importlib.import_module(home), "run_with_bars" if name == "run" else name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
