"""One report from the pages of many commands; each command draws its own (`page.sections`)."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from cablefem.response import write_json
from validation.core import store
from validation.page import page, terminal
from validation.page.page import Section, callout

if TYPE_CHECKING:
    from validation.core.readback import StoredResults


def write_report(folder: Path, command: str, faults: Sequence[str] = ()) -> None:
    """Draw and store the pages of a command, write report.html with those of all finished ones, mark it finished.

    faults : of what is written; they come first.
    """
    drawn: list[Section] = importlib.import_module(f"validation.commands.{command}.page").sections(folder)
    if faults:
        text = Markup("").join(callout(fault, "disagree") for fault in faults)
        drawn.insert(0, Section("read-back", "What was written is not what was computed", text, "disagree"))
    write_json(store.pages_file(folder, command), [asdict(section) for section in drawn])
    done = [
        other for other in store.commands_with_results(folder) if other == command or store.is_finished(folder, other)
    ]
    sections = _with_own_ids((other, section) for other in done for section in stored_pages(folder, other))
    title = store.scene_title(folder) or next((s.title for s in sections), folder.name)
    page.write_page(title, sections, folder / "report.html")
    store.mark_finished(folder, command)


def read_back_outputs(command: str, of: StoredResults, lines: Sequence[str]) -> int:
    """Read files, page and printed lines back; faults come first on the page, and 1 is returned."""
    from validation.core import readback  # slow to import

    text = (of.folder / store.REPORT).read_text(encoding="utf-8")
    faults = [*readback.file_faults(of), *readback.page_faults(text, command, of), *readback.terminal_faults(lines, of)]
    return report_faults(of.folder, command, faults)


def report_faults(folder: Path, command: str, faults: Sequence[str]) -> int:
    """Draw a page that begins with faults and complain of them; 1 if there are any."""
    if faults:
        write_report(folder, command, faults)
        terminal.print_faults([f"not what was computed: {fault}" for fault in faults[:5]])
    return int(bool(faults))


def stored_pages(folder: Path, command: str) -> list[Section]:
    """The stored pages of a command, or one that says why there are none."""
    try:
        pages = store.read_json(store.pages_file(folder, command))
        return [Section(**page | {"html": Markup(page["html"]), "scripts": tuple(page["scripts"])}) for page in pages]
    except (OSError, ValueError, TypeError, KeyError):
        text = callout(f"Its pages are gone or of another version; run cablefem {command} again.", "not comparable")
        return [Section(command, command, text)]


def _with_own_ids(pages: Iterable[tuple[str, Section]]) -> list[Section]:
    """Sections that name their command; of an id used by two commands it is a part."""
    out: dict[str, Section] = {}
    for command, section in pages:
        own = section.id if section.id not in out else f"{section.id}-{command}"
        out[own] = replace(section, id=own, command=command)
    return list(out.values())


Part = tuple[str, ...]  # a command and its arguments


@contextmanager
def missing_parts(root: Path | None, parts: Sequence[Part]) -> Iterator[tuple[Path, list[Part]]]:
    """Give the folder of all results, where commands in the `with` block write, and the parts it lacks.

    A folder with the results of one scene lacks nothing.
    """
    before = store.ROOT
    root = root or before
    if set(store.commands_with_results(root)) - {"report"}:
        yield root, []
        return
    store.claim_folder(root, "report", "report", ["report.html"])
    store.ROOT = root
    try:
        yield root, [part for part in parts if not store.is_finished(root / _folder_of_part(part), part[0])]
    finally:
        store.ROOT = before


def section_of_broken_part(part: Part, faults: Sequence[str]) -> Section:
    """The page of a part that ended without a result."""
    id = f"{_folder_of_part(part)}-{part[0]}-broken"
    title = f"cablefem {' '.join(part)}"
    reason = callout("; ".join(faults), "disagree")
    return Section(id, title, reason, "disagree", "It ended without a result.")


def write_combined_report(root: Path, parts: Sequence[Part], broken: Sequence[Section] = ()) -> list[Section]:
    """Write the report of all finished results in a folder and its subfolders, these parts first.

    The first pages of all scenes of a command come before the rest, what broke before all.
    Return all its sections, in their order.
    """
    pages: dict[str, tuple[list[Section], list[Section]]] = {}  # of each command: first ones, others
    for command, folder in _finished_results(root, parts):
        for i, s in enumerate(stored_pages(folder, command)):
            section = replace(s, id=f"{folder.name}-{s.id}", title=f"{folder.name}: {s.title}")
            pages.setdefault(command, ([], []))[min(i, 1)].append(section)
    ordered = [(command, s) for command, (first, others) in pages.items() for s in first + others]
    sections = [*broken, *_with_own_ids(ordered)]
    if not sections:
        raise store.Refused(f"{root} holds no finished results to report")
    page.write_page("cablefem", sections, root / "report.html")
    print_findings(sections)
    terminal.print_text(f"written to {root}: report.html")
    return sections


def _finished_results(root: Path, parts: Sequence[Part]) -> list[tuple[str, Path]]:
    """Commands with finished results and their folders, these parts first."""
    rank = {(part[0], _folder_of_part(part)): i for i, part in enumerate(parts)}
    done = []
    for folder in [root, *sorted(root.glob("*/"))]:
        done += [
            (command, folder) for command in store.commands_with_results(folder) if store.is_finished(folder, command)
        ]
    return sorted(done, key=lambda result: rank.get((result[0], result[1].name), len(rank)))


def _folder_of_part(part: Part) -> str:
    """Name of the folder of its results: its scene's, or its own."""
    command, *arguments = part
    if arguments and not arguments[0].startswith("-"):
        return arguments[0]
    return store.study_folder(command, "--quick" in arguments)


def print_findings(sections: Sequence[Section]) -> None:
    cells = [[s.title, s.verdict or "", s.summary] for s in sections if s.verdict or s.summary]
    terminal.print_table(["page", "verdict", "found"], cells)
