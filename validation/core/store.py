"""Where results go: a folder is refused unless it is empty or holds a result of the same command on the same scene."""

import json
import math
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path("cablefem-out")
MARKER = ".cablefem.json"
_REMEDY = "nothing was written; choose another folder with --out"


class Refused(ValueError):
    """Input that cannot be used; `faults` holds one line per fault, and nothing has been run or overwritten."""

    def __init__(self, faults: str | list[str]) -> None:
        super().__init__(faults)
        self.faults = [faults] if isinstance(faults, str) else faults

    def __str__(self) -> str:
        return "\n".join(self.faults)


def claim(out: Path | None, command: str, scene: Any, writes: Sequence[str], *, among: bool = False) -> Path:
    """Return the folder for a command's results, made and marked; raise Refused where something else is in it.

    out : the folder asked for; it belongs to one command. None: cablefem-out/SCENE, which all commands on that
        scene share, each with files of its own.
    scene : the Scene, or the command's name where there is none.
    writes : files and folders inside `out` that are the command's own.
    among : a new folder may hold other things, if not the files to be written.
    """
    from cablefem.response import write_json

    scene_name, text = (scene, "") if isinstance(scene, str) else (scene.name, scene.to_toml())
    folder = ROOT / scene_name if out is None else out
    try:
        folder.mkdir(parents=True, exist_ok=True)
        marker = _marker(folder)
        if marker is None:
            if any((folder / name).exists() for name in writes) if among else any(folder.iterdir()):
                raise Refused(f"{folder} is not empty and holds no result of cablefem; {_REMEDY}")
            marker = {"scene": text, "name": scene_name, "shared": out is None, "results": {}}
        if marker["scene"] != text:
            raise Refused(f"{folder} holds results of another scene named {marker['name']}; {_REMEDY}")
        for other, claimed in marker["results"].items():
            taken = sorted(set(claimed) & set(writes))
            if other != command and (taken or not marker["shared"]):
                what = folder / taken[0] if taken and marker["shared"] else folder
                raise Refused(f"{what} holds a result of cablefem {other}; {_REMEDY}")
        known = marker["results"].get(command, [])
        marker["results"][command] = sorted({*known, *writes})
        marker["finished"] = [done for done in marker.get("finished", []) if done != command]
        write_json(folder / MARKER, marker)
    except FileExistsError:
        raise Refused(f"{folder} is a file; --out must be a folder") from None
    except OSError as error:
        raise Refused(f"cannot write to {folder}: {error.strerror}") from None
    return folder


def finish(folder: Path, command: str) -> None:
    """Mark a command's results as complete, so that a report takes them as they are."""
    from cablefem.response import write_json

    marker = _marker(folder)
    if marker is not None:
        marker["finished"] = sorted({*marker.get("finished", []), command})
        write_json(folder / MARKER, marker)


def finished(folder: Path, command: str) -> bool:
    """Return whether a folder holds complete results of a command."""
    marker = _marker(folder)
    return marker is not None and command in marker.get("finished", [])


def results(folder: Path) -> list[str]:
    """Return the commands whose results a folder holds; none if it is not one of ours."""
    marker = _marker(folder)
    return [] if marker is None else list(marker["results"])


def title(folder: Path) -> str:
    """Return the title of the scene that a folder's results are about, else the scene's name; "" without a scene."""
    scene = tomllib.loads((_marker(folder) or {}).get("scene", ""))
    return scene.get("title") or scene.get("name") or ""


def _marker(folder: Path) -> dict[str, Any] | None:
    try:
        marker = json.loads((folder / MARKER).read_text(encoding="utf-8"))
        return marker if {"scene", "name", "shared", "results"} <= set(marker) else None
    except (OSError, ValueError, TypeError):
        return None


def stored(file: Path, **same: Any) -> dict[str, Any]:
    """Return the JSON object in a file if these of its entries are the same; an empty one otherwise."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        return content if all(content[name] == value for name, value in same.items()) else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def plain(x: Any) -> Any:
    """Return what JSON can hold of it: null for every number that does not exist."""
    if isinstance(x, dict):
        return {name: plain(y) for name, y in x.items()}
    if isinstance(x, list | tuple):
        return [plain(y) for y in x]
    return None if isinstance(x, float) and not math.isfinite(x) else x
