"""Files of results as they are read: what is not there or no number is a fault that names file and field."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import Any


class DamagedFileError(ValueError):
    """A file of results without what it must have; `faults`: one sentence of file and field."""

    def __init__(self, file: Path, fault: object) -> None:
        super().__init__(f"{file}: {fault}; the file is damaged: compute it anew")
        self.file = file
        self.faults = [str(self)]


class Entries(dict[str, Any]):
    """Entries of a file by name; DamagedFileError of one that is not there."""

    def __init__(self, file: Path, kind: str, entries: Any) -> None:
        super().__init__(entries)
        self._file = file
        self._kind = kind

    def __missing__(self, name: str) -> Any:
        raise DamagedFileError(self._file, f"{self._kind} {name} is not there")

    def change_values(self, change: Callable[[Any], Any]) -> Entries:
        """Entries of the same file with changed values."""
        return Entries(self._file, self._kind, {name: change(value) for name, value in self.items()})


def json_of_text(file: Path, text: str) -> Any:
    """What a JSON text says, objects as Entries; `file` : where it is from."""
    try:
        return json.loads(text, object_hook=lambda entries: Entries(file, "key", entries))
    except json.JSONDecodeError as error:
        raise DamagedFileError(file, error) from None


def _text_of_file(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise DamagedFileError(file, error) from None


def read_json(file: Path) -> Any:
    """What a JSON file says, objects as Entries.  Raises DamagedFileError."""
    return json_of_text(file, _text_of_file(file))


def read_csv_columns(file: Path) -> Entries:
    """Columns (n,) of a CSV of numbers; empty cells are nan.

    Raises DamagedFileError where there is no row, a row has another length or a cell is no number.
    """
    import numpy as np  # slow to load

    header, *lines = _text_of_file(file).rstrip().split("\n")
    if not lines:
        raise DamagedFileError(file, "no rows")
    names = next(csv.reader([header]))
    rows = [line.split(",") for line in lines]
    table = np.empty((len(rows), len(names)))
    for i, cells in enumerate(rows):
        where = f"row {i + 2}"
        if len(cells) != len(names):
            raise DamagedFileError(file, f"{where}: {len(cells)} cells under {len(names)} names")
        try:
            table[i] = [float(cell or "nan") for cell in cells]
        except ValueError as error:
            raise DamagedFileError(file, f"{where}: {error}") from None
    return Entries(file, "column", zip(names, table.T.copy(), strict=True))


def read_csv_rows(file: Path) -> list[dict[str, str]]:
    """Rows of a CSV, cells as text by column, each as Entries.  Raises DamagedFileError as `read_csv_columns` does."""
    rows: list[dict[str, str]] = []
    for i, row in enumerate(csv.DictReader(_text_of_file(file).splitlines())):
        if None in row or None in row.values():
            raise DamagedFileError(file, f"row {i + 2}: not as many cells as names")
        rows.append(Entries(file, "column", row))
    return rows


def damaged_files_are_faults(reader: Callable[..., Iterator[str]]) -> Callable[..., Iterator[str]]:
    """A reader of files whose last fault is what it lacked, if it lacked something."""

    @wraps(reader)
    def faults(*args: Any) -> Iterator[str]:
        try:
            yield from reader(*args)
        except DamagedFileError as damage:
            yield from damage.faults

    return faults
