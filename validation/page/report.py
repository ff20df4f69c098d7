"""One report from the pages of many commands; each command draws its own (`page.sections`)."""

from __future__ import annotations

import importlib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from markupsafe import Markup

from cablefem.response import write_json
from validation.core import store
from validation.page import page, terminal
from validation.page.page import Section, callout

if TYPE_CHECKING:
    from validation.core.readback import StoredResults


def write_report_and_mark_finished(folder: Path, command: str, faults: Sequence[str] = ()) -> None:
    """Draw and store the pages of a command, write report.html with those of all finished ones, mark it finished.

    The latest command's pages come first.
    faults : of what is written; they come first.
    """
    drawn: list[Section] = importlib.import_module(f"validation.commands.{command}.page").sections(folder)
    if faults:
        text = Markup("").join(callout(fault, "disagree") for fault in faults)
        drawn.insert(0, Section("read-back", "What was written is not what was computed", text, "disagree"))
    write_json(store.stored_sections_path(folder, command), [asdict(section) for section in drawn])
    done = [
        other
        for other in reversed(store.commands_on_latest_scene(folder))
        if other == command or store.is_finished(folder, other)
    ]
    stored = ((other, section) for other in done for section in read_stored_sections(folder, other))
    sections = _with_unique_ids_and_titles(stored)
    title = store.scene_title(folder) or next((s.title for s in sections), folder.name)
    page.write_page(title, sections, folder / "report.html")
    store.mark_finished_with_files(folder, command)


def read_back_and_report(command: str, stored: StoredResults, printed_lines: Sequence[str]) -> Literal[0, 1]:
    """Read files, page and printed lines back; faults come first on the page, and 1 is returned."""
    from validation.core import readback  # slow to import

    text = (stored.folder / store.REPORT).read_text(encoding="utf-8")
    faults = [
        *readback.faults_of_stored_results(stored),
        *readback.page_faults(text, command, stored),
        *readback.terminal_faults(printed_lines, stored),
    ]
    return report_read_back_faults(stored.folder, command, faults)


def report_read_back_faults(folder: Path, command: str, faults: Sequence[str]) -> Literal[0, 1]:
    """Draw a page that begins with faults and print the first five; 1 if there are any."""
    if not faults:
        return 0
    write_report_and_mark_finished(folder, command, faults)
    terminal.print_faults([f"not what was computed: {fault}" for fault in faults[:5]])
    return 1


def read_stored_sections(folder: Path, command: str) -> list[Section]:
    """The stored pages of a command, or one that says why there are none."""
    try:
        pages = store.read_json(store.stored_sections_path(folder, command))
        return [Section(**page | {"html": Markup(page["html"]), "scripts": tuple(page["scripts"])}) for page in pages]
    except (OSError, ValueError, TypeError, KeyError):
        reason = f"Its pages are gone or of another version; run cablefem {command} again."
        return [Section(command, command, callout(reason, "not comparable"), "not comparable", reason)]


def _with_unique_ids_and_titles(pages: Iterable[tuple[str, Section]]) -> list[Section]:
    """Sections that name their command; ids and titles that an earlier command has are told apart by it."""
    out: dict[str, Section] = {}
    titles: dict[str, str] = {}  # command by title
    for command, section in pages:
        own = section.id if section.id not in out else f"{section.id}-{command}"
        title = section.title
        if titles.setdefault(title, command) != command:
            title = f"{title} ({command})"
        out[own] = replace(section, id=own, title=title, command=command)
    return list(out.values())


Part = tuple[str, ...]  # a command and its arguments


def claim_and_list_missing_parts(root: Path, parts: Sequence[Part]) -> list[Part]:
    """Claim the folder of all results, and return the parts that it lacks.

    A folder with the results of one scene lacks nothing.
    """
    if set(store.commands_on_latest_scene(root)) - {"report"}:
        return []
    store.claim_and_clear_folder(root, "report", "report", ["report.html"])
    return [part for part in parts if not store.is_finished(root / folder_name_of_part(part), part[0])]


def section_of_broken_part(part: Part, faults: Sequence[str]) -> Section:
    """The page of a part that ended without a result."""
    id = _id_of_broken_part(folder_name_of_part(part), part[0])
    title = f"cablefem {' '.join(part)}"
    reason = callout("; ".join(faults), "disagree")
    return Section(id, title, reason, "disagree", "It ended without a result.")


def _id_of_broken_part(folder_name: str, command: str) -> str:
    return f"{folder_name}-{command}-broken"


def write_and_print_combined_report(root: Path, parts: Sequence[Part], broken: Sequence[Section] = ()) -> list[Section]:
    """Write the report of all finished results in a folder and its subfolders, these parts first.

    The first pages of all scenes of a command come before the rest, what broke before all.
    Return all its sections, in their order.
    """
    pages: dict[str, tuple[list[Section], list[Section]]] = {}  # of each command: first ones, others
    results = _results_these_parts_first(root, parts)
    finished = [(command, folder) for command, folder in results if store.is_finished(folder, command)]
    for command, folder in finished:
        for i, s in enumerate(read_stored_sections(folder, command)):
            section = replace(s, id=f"{folder.name}-{s.id}", title=f"{folder.name}: {s.title}")
            pages.setdefault(command, ([], []))[min(i, 1)].append(section)
    ordered = [(command, s) for command, (first, others) in pages.items() for s in first + others]
    sections = [*broken, *_with_unique_ids_and_titles(ordered)]
    if not sections:
        raise store.Refused(f"{root} holds no finished results to report")
    page.write_page("cablefem", sections, root / "report.html")
    _print_left_out([result for result in results if result not in finished], {section.id for section in broken})
    print_findings(sections)
    terminal.print_text(f"written to {root}: report.html")
    return sections


def _print_left_out(unfinished: Sequence[tuple[str, Path]], broken_ids: Collection[str]) -> None:
    """Name results that did not finish; broken_ids : of sections that say so already."""
    for command, folder in unfinished:
        if command != "report" and _id_of_broken_part(folder.name, command) not in broken_ids:
            terminal.print_text(f"{folder} is left out: cablefem {command} did not finish there")


def _results_these_parts_first(root: Path, parts: Sequence[Part]) -> list[tuple[str, Path]]:
    """Commands with results in a folder and its subfolders, finished or not, and their folders."""
    rank = {(part[0], folder_name_of_part(part)): i for i, part in enumerate(parts)}
    folders = [root, *sorted(root.glob("*/"))]
    results = [(command, folder) for folder in folders for command in store.commands_on_latest_scene(folder)]
    return sorted(results, key=lambda result: rank.get((result[0], result[1].name), len(rank)))


def folder_name_of_part(part: Part) -> str:
    """Name of the folder of its results: its scene's, or its own."""
    command, *arguments = part
    if arguments and not arguments[0].startswith("-"):
        return arguments[0]
    return store.study_folder_name(command, "--quick" in arguments)


def print_findings(sections: Sequence[Section]) -> None:
    cells = [[s.title, s.verdict or "", s.summary] for s in sections if s.verdict or s.summary]
    terminal.print_table(["page", "verdict", "found"], cells)
