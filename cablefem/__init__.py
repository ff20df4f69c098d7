"""Dynamics of an elastic cable that carries a moving mass; `from cablefem import Scene` is where one starts."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cablefem.scene import Scene, SceneError

__all__ = ["Scene", "SceneError", "__version__"]
__version__ = "0.3.0"


def __getattr__(name: str) -> Any:
    """Load the scene on first use: `import cablefem` itself costs nothing."""
    if name in ("Scene", "SceneError"):
        import cablefem.scene

        return getattr(cablefem.scene, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
