"""What every column and key of the files of results means: unit, sign, meaning."""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from validation.core import store
from validation.core.quantities import KNOWN
from validation.page import line, motion


class Entry(NamedTuple):
    file: str
    key: str
    unit: str
    meaning: str


def data_dictionary_entries() -> Iterator[Entry]:
    """The data dictionary; design numbers and quantities of a line have the names that their writers take."""
    for file, keys in store.read_packaged_toml(__package__, "files.toml").items():
        for key, text in keys.items():
            unit, meaning = re.fullmatch(r"\[(.*?)\] (.*)", text).groups()  # type: ignore[union-attr]
            yield Entry(file, key, unit, meaning)
        if file == "design[]":
            for name, (words, unit) in KNOWN.items():
                yield Entry("quantity", name, unit or "-", words.format("an obstacle or the ground"))
            in_motion = {k: of for k, of in motion.WORDS.items() if k not in KNOWN}
            yield from _entries_of_quantities("quantity", in_motion)
            at_rest = line.words_of_extremes()
            known = {*KNOWN, *in_motion}
            yield from _entries_of_quantities("quantity", {k: of for k, of in at_rest.items() if k not in known})
        if file == "positions.csv":
            yield from _entries_of_quantities(file, line.WORDS)


def _entries_of_quantities(file: str, words: dict[str, Any]) -> Iterator[Entry]:
    for name, of in words.items():
        yield Entry(file, name, of["unit"] or "-", of["words"].format("NAME"))
