"""Folders of results.  A command replaces its own results and leaves everything else alone."""

import json
import math
import shutil
import tomllib
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

ROOT = Path("cablefem-out")
MARKER = ".cablefem.json"
REPORT = "report.html"  # of all commands in a folder
_REMEDY = "nothing was written; choose another folder with --out"


class Refused(ValueError):
    """Unusable input, one line per fault; nothing was run or overwritten."""

    def __init__(self, faults: str | list[str]) -> None:
        super().__init__(faults)
        self.faults = [faults] if isinstance(faults, str) else faults

    def __str__(self) -> str:
        return "\n".join(self.faults)


def claim(out: Path | None, command: str, scene: Any, writes: Sequence[str], *, among: bool = False) -> Path:
    """The folder for a command's results, made and marked; Refused if something is in the way.

    out : one command's folder; None: cablefem-out/SCENE, shared by all commands.
    scene : the Scene, or the command's name; results of another are deleted, unless foreign files are among them.
    writes : the command's own files and folders.  among : a new folder may hold other files.
    """
    name, text = (scene, "") if isinstance(scene, str) else (scene.name, scene.to_toml())
    folder = ROOT / name if out is None else out
    try:
        folder.mkdir(parents=True, exist_ok=True)
        marker = _marker(folder)
        if not marker:
            there = sorted(x.name for x in folder.iterdir())
            if strange := [name for name in there if name in writes or not among]:
                raise Refused(f"{folder} holds {strange[0]}, which this version of cablefem did not write; {_REMEDY}")
            marker = {"shared": out is None, "results": {}}
        _keep_out(folder, marker, command, writes)
        old = marker["results"].get(command, {"scene": text, "writes": []})
        if old["scene"] != text:
            _delete(folder, marker, command)
            old = {"writes": []}
        marker["results"][command] = {"scene": text, "writes": sorted({*old["writes"], *writes}), "finished": None}
        _write(folder, marker | {"scene": text})
    except FileExistsError:
        raise Refused(f"{folder} is a file; --out must be a folder") from None
    except OSError as error:
        raise Refused(f"cannot write to {folder}: {error.strerror}") from None
    return folder


def _keep_out(folder: Path, marker: dict[str, Any], command: str, writes: Sequence[str]) -> None:
    for other, result in marker["results"].items():
        taken = sorted(set(result["writes"]) & set(writes)) if marker["shared"] else [""]
        if other != command and taken:
            raise Refused(f"{folder / taken[0]} holds a result of cablefem {other}; {_REMEDY}")


def _delete(folder: Path, marker: dict[str, Any], command: str) -> None:
    """Delete a command's results; Refused if the folder holds foreign files."""
    result = marker["results"][command]
    present = set(_files(folder, result["writes"]))
    others = {name for other in marker["results"].values() for name in other["writes"]}
    ours = {*others, MARKER, REPORT, *(pages(folder, other).name for other in marker["results"])}
    strange = [x.name for x in folder.iterdir() if x.name not in ours]
    strange += present - set(result["finished"] or present)
    if strange:
        raise Refused(f"{folder / min(strange)} was not written by cablefem {command}; {_REMEDY}")
    for path in (folder / name for name in (*result["writes"], pages(folder, command).name)):
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def _files(folder: Path, names: Sequence[str]) -> list[str]:
    found = [x for name in names for x in (folder / name, *(folder / name).rglob("*")) if x.is_file()]
    return sorted(str(x.relative_to(folder)) for x in found)


def finish(folder: Path, command: str) -> None:
    if marker := _marker(folder):
        result = marker["results"][command]
        result["finished"] = _files(folder, result["writes"])
        _write(folder, marker)


def finished(folder: Path, command: str) -> bool:
    return _marker(folder).get("results", {}).get(command, {}).get("finished") is not None


def results(folder: Path) -> list[str]:
    """Commands with results on the latest scene."""
    marker = _marker(folder)
    return [command for command, result in marker.get("results", {}).items() if result["scene"] == marker["scene"]]


def title(folder: Path) -> str:
    scene = tomllib.loads(_marker(folder).get("scene", ""))
    return scene.get("title") or scene.get("name") or ""


def pages(folder: Path, command: str) -> Path:
    return folder / f".{command}.pages.json"


def shipped(package: str | None, name: str) -> dict[str, Any]:
    return tomllib.loads((resources.files(package or "") / name).read_text(encoding="utf-8"))


def read(file: Path) -> Any:
    return json.loads(file.read_text(encoding="utf-8"))


def _marker(folder: Path) -> dict[str, Any]:
    """What the folder's marker says; {} without one, or with an older version's."""
    marker = stored(folder / MARKER)
    known = {"scene", "shared", "results"} <= set(marker) and isinstance(marker["results"], dict)
    return marker if known and all(isinstance(x, dict) for x in marker["results"].values()) else {}


def _write(folder: Path, marker: dict[str, Any]) -> None:
    from cablefem.response import write_json

    write_json(folder / MARKER, marker)


def stored(file: Path, **same: Any) -> dict[str, Any]:
    """The JSON object in a file if it has the entries `same`, else {}."""
    try:
        content = read(file)
        known = isinstance(content, dict) and all(content[name] == value for name, value in same.items())
        return content if known else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def each_once(
    file: Path, jobs: dict[str, Any], work: Callable[[Any], Any], report: Callable[[float], None]
) -> dict[str, Any]:
    """work(job) by key; each result is kept in a file and not computed again."""
    from validation.core.sidebyside import spread

    done: dict[str, Any] = {}
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        try:
            key, item = json.loads(line)
        except (ValueError, TypeError):
            continue
        done[key] = item
    missing = [key for key in jobs if key not in done]
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as out:

        def keep(i: int, item: Any) -> None:
            done[missing[i]] = item
            # a line cut off must not swallow this one
            out.write("\n" + json.dumps([missing[i], item], allow_nan=False))
            out.flush()
            report(sum(key in done for key in jobs) / len(jobs))

        spread(lambda key: plain(work(jobs[key])), missing, keep)
    return {key: done[key] for key in jobs}


def plain(x: Any) -> Any:
    """x for JSON: null for non-finite numbers."""
    if isinstance(x, dict):
        return {name: plain(y) for name, y in x.items()}
    if isinstance(x, list | tuple):
        return [plain(y) for y in x]
    return None if isinstance(x, float) and not math.isfinite(x) else x
