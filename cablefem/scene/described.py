"""What scenes and lines share: a name, surroundings, and their files."""

import html
import itertools
import re
import tomllib
from collections.abc import Container, Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import tomli_w

from cablefem.scene.errors import SceneError, did_you_mean, short_text
from cablefem.scene.fields import Name, OneLine, Part, Positive, described_field
from cablefem.scene.limits import Limits
from cablefem.scene.surroundings import replace_ground_file_by_points

_FILES = resources.files(__package__) / "library"
# first in a list
_FIRST = ("level", "cruise", "inclined", "bare", "tramway", "zipline")
_SCENES = sorted(file.name.removesuffix(".toml") for file in _FILES.iterdir() if file.name.endswith(".toml"))
LINES = sorted(file.name.removesuffix(".toml") for file in (_FILES / "lines").iterdir())
OF_ONE_SPAN = (
    "this needs one span with [supports]; a line of [[contact]] takes run, check and find, in motion advise and chart"
)
LIBRARY = (*_FIRST, *(name for name in _SCENES if name not in _FIRST))
BUILT_IN = (*LIBRARY, *LINES)
RELATIVE = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?%")


def library_text(name: str) -> str:
    """The TOML of a built-in scene or line, with comments."""
    if name not in BUILT_IN:
        raise SceneError([f"scene = {short_text(name)}: no built-in scene.{did_you_mean(name, BUILT_IN)}"])
    folder = _FILES / "lines" if name in LINES else _FILES
    return (folder / f"{name}.toml").read_text(encoding="utf-8")


def scene_text_and_name(name_or_path: str | Path) -> tuple[str, str]:
    """Text and name of a built-in scene or of a TOML file."""
    if not isinstance(name_or_path, str | Path):
        raise TypeError(f"scene must be the name of a built-in one or the path of a TOML file, got {name_or_path!r}")
    text = str(name_or_path)
    if text in BUILT_IN:
        return library_text(text), text
    path = Path(name_or_path)
    try:
        content = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise SceneError(
            [f"scene = {short_text(text)}: no built-in scene, no file.{did_you_mean(text, BUILT_IN)}"]
        ) from None
    except (OSError, ValueError) as error:  # a folder, no permission, not UTF-8
        why = error.strerror if isinstance(error, OSError) else error
        raise SceneError([f"scene = {short_text(text)}: must be a readable TOML file ({why})"]) from None
    return content, re.sub(r"[^\w.-]+", "-", path.stem).strip(".-") or "scene"


def parse_toml(text: str) -> dict[str, Any]:
    """The content of a TOML; SceneError where it is none."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        end = f"at line {text.count(chr(10)) + 1}, column {len(text) - text.rfind(chr(10))}, where it ends"
        raise SceneError([f"not valid TOML: {str(error).replace('at end of document', end)}"]) from None
    except (ValueError, RecursionError):  # a number of thousands of digits, thousands of brackets
        raise SceneError(["not valid TOML: a number or a nesting beyond all bounds"]) from None


class Described(Part):
    """A file of a scene or of a line."""

    built_in: ClassVar[Sequence[str]]  # names

    name: Name = described_field("[-] name of its folder of results; of a file, the file's name", "scene")
    title: OneLine = described_field("[-] what it is, on one line", "")
    gravity: Positive = described_field("[m/s2] g", 9.81)
    limits: Limits | None = described_field("[-] what the answer is held against", None)

    @property
    def _headline(self) -> str:
        return f"{self.name}: {self.title}" if self.title else self.name

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self}>"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"

    @classmethod
    def load(cls, name_or_path: str | Path) -> Self:
        """A built-in one or that of a TOML file; SceneError with all faults, TypeError for what is no text or path."""
        text, name = scene_text_and_name(name_or_path)
        return cls.from_toml(text, name=name, folder=Path(name_or_path).parent)

    @classmethod
    def from_toml(cls, text: str, *, name: str = "scene", folder: Path = Path()) -> Self:
        """What a TOML text describes, a file of the ground in `folder`; SceneError with all its faults."""
        data = parse_toml(text)
        replace_ground_file_by_points(data, folder)
        return cls(**{"name": name, **data})

    @classmethod
    def library(cls) -> dict[str, str]:
        """Names and titles of the built-in ones."""
        return {name: parse_toml(library_text(name))["title"] for name in cls.built_in}

    def to_toml(self) -> str:
        """A file that reads back as this."""
        return tomli_w.dumps(self._toml_tables())

    def _toml_tables(self, replaced_keys: Container[str] = ()) -> dict[str, Any]:
        """Its TOML tables, without what new values of the dotted keys `replaced_keys` replace."""
        return {"name": self.name, **self.model_dump(exclude_none=True, exclude_defaults=True)}

    def replace(self, changes: Mapping[str, Any]) -> Self:
        """The same with other values of some dotted keys; SceneError with all faults.

        A new length, sag or tension of the rope replaces the old one. A CSV of the ground is one of the working folder.
        scene.replace({"mass.mass": 60.0, "drive.brake.0.force": 600.0, "obstacle.tree.top": 21.0})
        line.replace({"contact.valley.tension": 4e5})
        """
        refuse_changes_without_keys(changes)
        data = self._toml_tables(changes)
        cable = data["cable"]
        product = cable.get("E", 0.0) * cable.get("section", 0.0)
        if {"cable.E", "cable.section"} & changes.keys() and cable["EA"] == product:
            del cable["EA"]  # it follows
        for key, value in changes.items():
            set_dotted_key(data, key, value)
        replace_ground_file_by_points(data, Path())
        return type(self)(**data)

    def variants(self, grid: Mapping[str, Iterable[Any]]) -> list[Self]:
        """The same for all combinations of values of dotted keys; the last key changes fastest."""
        lists = grid.values() if isinstance(grid, Mapping) else [None]
        if any(isinstance(x, str | Mapping) or not np.iterable(x) for x in lists):
            raise TypeError(f"grid must map each dotted key to a list of values, got {grid!r}")
        return [self.replace(dict(zip(grid, values, strict=True))) for values in itertools.product(*lists)]


def refuse_changes_without_keys(changes: object) -> None:
    """TypeError for changes that are no mapping of dotted keys."""
    if not isinstance(changes, Mapping) or not all(isinstance(key, str) for key in changes):
        raise TypeError(f"changes must be a mapping of dotted keys to values, got {changes!r}")


def set_dotted_key(data: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key; list items by name or number, "+1%" is relative; SceneError for an unknown key."""
    before, _, last = key.rpartition(".")
    table: Any = data
    for name in before.split(".") if before else ():
        table = table.setdefault(name, {}) if isinstance(table, dict) else _find_list_entry(table, name, key)
    if not isinstance(table, dict):
        raise SceneError([f"{key}: {_why_no_table(table, before, last)}"])
    relative = isinstance(value, str) and RELATIVE.fullmatch(value)
    table[last] = _number_changed_by_percent(table, last, key, value) if relative else value


def _find_list_entry(tables: Any, name: str, key: str) -> Any:
    """The table of that name or number in a list of tables; SceneError if there is none."""
    known = []
    for i, table in enumerate(tables if isinstance(tables, list | tuple) else ()):
        if isinstance(table, dict):
            if name in (table.get("name"), str(i)):
                return table
            known.append(str(table.get("name", i)))
    raise SceneError([f"{key}: the scene has no such entry.{did_you_mean(name, known) if known else ''}"])


def _why_no_table(content: Any, name: str, last: str) -> str:
    """Why the content of a key is no table with a key `last`, and what to write instead."""
    if not isinstance(content, list | tuple) or not content:
        return f"{name} is no table"
    if isinstance(content[0], dict):
        return f"{name} is a list; write {name}.0.{last}, or its name for the 0"
    return f"{name} is a list; write all of it, as {name}={short_text(list(content))}"


def _number_changed_by_percent(table: dict[str, Any], name: str, key: str, percent: str) -> float:
    """The number of that name, changed by "+1%"; SceneError if it is not given."""
    now = table.get(name)
    if not isinstance(now, int | float):
        given = [name for name, number in table.items() if isinstance(number, int | float)]
        what = f"relative to a number, which the scene does not give.{did_you_mean(name, given)}"
        raise SceneError([f"{key} = {percent}: {what}"])
    return now * (1.0 + float(percent[:-1]) / 100.0)
