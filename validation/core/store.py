"""Folders of results.  A command replaces results of ours; what is not ours is never deleted or written over."""

import fcntl
import json
import math
import os
import tomllib
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from validation.core.stored_files import read_json as read_json

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


def study_folder_name(name: str, quick: bool) -> str:
    """A quick study has a folder of its own."""
    return f"{name}-quick" if quick else name


_held: dict[Path, int] = {}  # descriptors of locked folders


def _close_lock_files_in_fork() -> None:
    """A fork that outlives this process must not hold its folders."""
    for descriptor in _held.values():
        os.close(descriptor)
    _held.clear()


os.register_at_fork(after_in_child=_close_lock_files_in_fork)


def _lock_folder(folder: Path) -> None:
    """Keep other processes out of the folder until `unlock_folder`, or until this one ends."""
    if holds_folder(folder):
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise Refused(f"another command is writing to {folder}; {_REMEDY}") from None
    except OSError:
        pass  # a file system without locks
    _held[folder.resolve()] = descriptor


def holds_folder(folder: Path) -> bool:
    """Whether this process has locked the folder."""
    return folder.resolve() in _held


def unlock_folder(folder: Path) -> None:
    """Let other processes claim the folder."""
    os.close(_held.pop(folder.resolve()))


def claim_and_clear_folder(out: Path | None, command: str, scene: Any, writes: Sequence[str]) -> Path:
    """The folder for a command's results, made, locked and marked.

    Refused if a file that is not ours has one of their names, and while another process holds the folder.
    out : None: cablefem-out/SCENE.
    scene : the Scene, or the command's name.  The command's results of another scene are deleted, and results of
        other commands that have a file in common with the new ones.
    writes : the command's own files and folders.
    """
    name, text = (scene, "") if isinstance(scene, str) else (scene.name, scene.to_toml())
    folder = ROOT / name if out is None else out
    held_before = holds_folder(folder)
    claimed = False
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _lock_folder(folder)
        results = _read_marker(folder).get("results", {})
        _refuse_foreign_files(folder, results, writes)
        for other, result in list(results.items()):
            shared = set(writes) & set(result["writes"])
            outdated = result["scene"] != text if other == command else shared
            if outdated:
                _delete_files_of_result(folder, other, results.pop(other))
        before = results.pop(command, {"writes": [], "files": []})  # the latest command stands last
        results[command] = {
            "scene": text, "writes": sorted({*before["writes"], *writes}), "files": before["files"],
            "foreign": sorted(set(_relative_paths_of_files_below(folder, writes)) - set(before["files"])),
            "finished": False,
        }  # fmt: skip
        _write_marker(folder, {"results": results, "scene": text})
        claimed = True
    except FileExistsError:
        raise Refused(f"{folder} is a file; --out must be a folder") from None
    except OSError as error:
        raise Refused(f"cannot write to {folder}: {error.strerror}") from None
    finally:
        if not (claimed or held_before) and holds_folder(folder):
            unlock_folder(folder)
    return folder


def _refuse_foreign_files(folder: Path, results: dict[str, Any], writes: Sequence[str]) -> None:
    """Raise Refused if a file or folder of these names is there and of no command's results."""
    ours = {name for result in results.values() for name in result["writes"]}
    if results:
        ours.add(REPORT)
    for name in (*writes, REPORT):
        if name not in ours and (folder / name).exists():
            raise Refused(f"{folder} holds {name}, which this version of cablefem did not write; {_REMEDY}")


def _delete_files_of_result(folder: Path, command: str, result: dict[str, Any]) -> None:
    """Delete the files that a command wrote, and folders that are empty then."""
    stored_sections_path(folder, command).unlink(missing_ok=True)
    for name in result["files"]:
        (folder / name).unlink(missing_ok=True)
    for top in result["writes"]:
        for part in [*sorted((folder / top).rglob("*/"), reverse=True), folder / top]:
            if part.is_dir() and not any(part.iterdir()):
                part.rmdir()


def _relative_paths_of_files_below(folder: Path, names: Sequence[str]) -> list[str]:
    """Paths in the folder of files with these names, and of all files in folders with them."""
    found: list[Path] = []
    for name in names:
        found += [x for x in (folder / name, *(folder / name).rglob("*")) if x.is_file()]
    return [str(x.relative_to(folder)) for x in found]


def mark_finished_with_files(folder: Path, command: str) -> None:
    """Note in the folder's marker which files a command wrote; those there before it are not ours."""
    if marker := _read_marker(folder):
        result = marker["results"][command]
        result["files"] = sorted(set(_relative_paths_of_files_below(folder, result["writes"])) - set(result["foreign"]))
        result["finished"] = True
        _write_marker(folder, marker)


def is_finished(folder: Path, command: str) -> bool:
    return bool(_read_marker(folder).get("results", {}).get(command, {}).get("finished"))


def commands_on_latest_scene(folder: Path) -> list[str]:
    """Commands that have results on the scene of the latest one."""
    marker = _read_marker(folder)
    return [command for command, result in marker.get("results", {}).items() if result["scene"] == marker["scene"]]


def scene_title(folder: Path) -> str:
    """Title, else name, of the latest scene; "" without one."""
    scene = tomllib.loads(_read_marker(folder).get("scene", ""))
    return scene.get("title") or scene.get("name") or ""


def stored_sections_path(folder: Path, command: str) -> Path:
    """Where a command's sections of the report are stored."""
    return folder / f".{command}.pages.json"


def read_packaged_toml(package: str | None, name: str) -> dict[str, Any]:
    return tomllib.loads((resources.files(package or "") / name).read_text(encoding="utf-8"))


def _read_marker(folder: Path) -> dict[str, Any]:
    """What the folder's marker says; {} without one, or with an older version's."""
    marker = read_json_or_empty(folder / MARKER)
    if not ({"scene", "results"} <= set(marker) and isinstance(marker["results"], dict)):
        return {}
    ours = all(isinstance(result, dict) and "files" in result for result in marker["results"].values())
    return marker if ours else {}


def _write_marker(folder: Path, marker: dict[str, Any]) -> None:
    from cablefem.response import write_json

    write_json(folder / MARKER, marker)


def read_json_or_empty(file: Path, **entries: Any) -> dict[str, Any]:
    """The JSON object in a file if it has these entries, else {}."""
    try:
        content = read_json(file)
        same = isinstance(content, dict) and all(content[name] == value for name, value in entries.items())
        return content if same else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def compute_and_store_missing(
    file: Path, jobs: dict[str, Any], work: Callable[[Any], Any], report: Callable[[float], None]
) -> dict[str, Any]:
    """work(job) by key; each result is a row of a file and not computed again.

    report : is given the fraction done.
    """
    from validation.core.sidebyside import map_in_parallel

    done = _stored_results(file)
    missing = [key for key in jobs if key not in done]
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as out:

        def append_result(i: int, item: Any) -> None:
            """Append a result to the file."""
            done[missing[i]] = item
            # a line cut off must not swallow this one
            out.write("\n" + json.dumps([missing[i], item], allow_nan=False))
            out.flush()
            report(sum(key in done for key in jobs) / len(jobs))

        map_in_parallel(lambda key: nulls_for_nonfinite(work(jobs[key])), missing, append_result)
    return {key: done[key] for key in jobs}


def _stored_results(file: Path) -> dict[str, Any]:
    """Results by key, one a row [key, result]; without rows that were cut off, and without the file none."""
    done: dict[str, Any] = {}
    rows = file.read_text(encoding="utf-8").splitlines() if file.exists() else ()
    for row in rows:
        try:
            key, result = json.loads(row)
        except (ValueError, TypeError):
            continue
        done[key] = result
    return done


def nulls_for_nonfinite(x: Any) -> Any:
    """x for JSON: None for every number in it that is not finite."""
    if isinstance(x, dict):
        return {name: nulls_for_nonfinite(y) for name, y in x.items()}
    if isinstance(x, list | tuple):
        return [nulls_for_nonfinite(y) for y in x]
    return None if isinstance(x, float) and not math.isfinite(x) else x
