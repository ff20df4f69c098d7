"""Pages of commands gathered in one file: each command draws its own (`page.sections`), and they are kept as drawn."""

from __future__ import annotations

import importlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from markupsafe import Markup

from cablefem.response import write_json
from validation import terminal
from validation.core import store
from validation.page import page
from validation.page.page import Section


def write(folder: Path, command: str) -> None:
    """Write report.html from all results in a folder, those of this command drawn anew."""
    sections = [s for other in store.results(folder) for s in (drawn if other == command else kept)(folder, other)]
    title = store.title(folder) or next((s.title for s in sections), folder.name)
    page.render(title, sections, folder / "report.html")


def drawn(folder: Path, command: str) -> list[Section]:
    """Return the pages about a command's results, and keep them; some commands have none."""
    home = f"validation.commands.{command}.page"
    try:
        sections: list[Section] = importlib.import_module(home).sections(folder)
    except ModuleNotFoundError as error:
        if error.name != home:
            raise
        return []
    write_json(_file(folder, command), [asdict(section) for section in sections])
    return sections


def kept(folder: Path, command: str) -> list[Section]:
    """Return the pages as they were drawn when the command finished: drawing takes most of a report's time."""
    try:
        pages = json.loads(_file(folder, command).read_text(encoding="utf-8"))
        return [Section(**page | {"html": Markup(page["html"]), "scripts": tuple(page["scripts"])}) for page in pages]
    except (OSError, ValueError, TypeError, KeyError):
        return drawn(folder, command)


def tell(sections: Sequence[Section]) -> None:
    """Print what pages have found, one line for each that found something."""
    cells = [[s.title, s.verdict or "", s.summary] for s in sections if s.verdict or s.summary]
    terminal.table(["page", "verdict", "found"], cells)


def _file(folder: Path, command: str) -> Path:
    return folder / f".{command}.pages.json"
