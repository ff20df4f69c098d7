"""What commands have in common: their arguments, what is wrong with them, and the course of a study."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from validation.core import store
from validation.page import terminal

if TYPE_CHECKING:
    from cablefem.scene import Scene

TOL_RANGE = (1e-6, 0.2)


def real(text: str) -> float:
    """Return the number that a text says."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no number") from None


def to(folder: str) -> Any:
    """Return the option for a folder that is `folder` by default."""
    return typer.Option("--out", metavar="DIR", help=f"Folder for the results. Default: {store.ROOT / folder}.")


SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene (cablefem scenes) or a TOML file.")]
Out = Annotated[Path | None, to("SCENE")]


def scene_named(name: str, faults: list[str] | None = None, *, travelling: bool = False) -> Scene:
    """Return the scene, or raise Refused with its faults and those found before."""
    from cablefem.scene import Scene, SceneError

    faults = [] if faults is None else faults
    scene = None
    try:
        scene = Scene.load(name)
        if travelling and scene.mass is None:
            faults.append(f"scene {scene.name} has no [mass] and [travel]: a bare cable is for modes and scenes only")
    except SceneError as error:
        faults += [fault if fault.startswith("scene = ") else f"{name}: {fault}" for fault in error.faults]
    if faults or scene is None:
        raise store.Refused(faults)
    return scene


def tol_faults(tol: float | None) -> list[str]:
    low, high = TOL_RANGE
    return [] if tol is None or low <= tol <= high else [f"--tol must lie in [{low:g}, {high:g}], got {tol:g}"]


@contextmanager
def written(out: Path | None, command: str, scene: Scene | str, names: list[str]) -> Iterator[Path]:
    """Claim the folder of a command that writes these files at once, mark it finished, and tell of it."""
    folder = store.claim(out, command, scene, names)
    yield folder
    store.finish(folder, command)
    terminal.say(f"written to {folder}: {', '.join(names)}")


def study(
    command: str, scene: Scene | str, writes: list[str], out: Path | None, run: Callable[..., Any], *inputs: Any
) -> Any:
    """Run a study, write its pages, print their one-line findings and return what it returned.

    run : called with `inputs`, the folder and the progress.
    """
    from validation.page import report

    folder = store.claim(out, command, scene, writes)
    with terminal.progress() as progress:
        found = run(*inputs, folder, progress)
        report.write(folder, command)
        store.finish(folder, command)
    report.tell(report.kept(folder, command))
    terminal.say(f"written to {folder}: report.html, {', '.join(writes)}")
    return found
