"""Frequencies of the bare cable."""

from pathlib import Path

from validation.core import store
from validation.page.page import Section, drawn


def sections(folder: Path) -> list[Section]:
    return drawn(__package__, omega=store.read(folder / "modes.json"))
