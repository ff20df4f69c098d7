"""Frequencies of the bare cable."""

from pathlib import Path

from validation.core import store
from validation.page.page import Section, render_sections


def sections(folder: Path) -> list[Section]:
    return render_sections(__package__, content=store.read_json(folder / "modes.json"))
