"""One report from the pages of many commands; each command draws its own (`page.sections`)."""

import importlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

from markupsafe import Markup

from cablefem.response import write_json
from validation.core import readback, store
from validation.page import page, terminal
from validation.page.options import small
from validation.page.page import Section, callout


def write(folder: Path, command: str, faults: Sequence[str] = ()) -> None:
    """Draw and keep the pages of a command, write report.html with those of all finished ones, and mark it finished.

    faults : of what is written; they come first.
    """
    drawn: list[Section] = importlib.import_module(f"validation.commands.{command}.page").sections(folder)
    if faults:
        said = Markup("").join(callout(fault, "disagree") for fault in faults)
        drawn = [Section("read-back", "What was written is not what was computed", said, "disagree"), *drawn]
    write_json(store.pages(folder, command), [asdict(section) for section in drawn])
    done = [other for other in store.results(folder) if other == command or store.finished(folder, other)]
    sections = _apart((other, s) for other in done for s in (drawn if other == command else kept(folder, other)))
    title = store.title(folder) or next((s.title for s in sections), folder.name)
    page.render(title, sections, folder / "report.html")
    store.finish(folder, command)


def read_back(command: str, of: readback.Stored, lines: Sequence[str]) -> int:
    """Read files, page and printed lines back; faults come first on the page, and 1 is returned."""
    text = (of.folder / store.REPORT).read_text(encoding="utf-8")
    faults = [*readback.files(of), *readback.page(text, command, of), *readback.terminal(lines, of)]
    if faults:
        write(of.folder, command, faults)
        terminal.complain([f"not what was computed: {fault}" for fault in faults[:5]])
    return int(bool(faults))


def kept(folder: Path, command: str) -> list[Section]:
    try:
        pages = store.read(store.pages(folder, command))
        return [Section(**page | {"html": Markup(page["html"]), "scripts": tuple(page["scripts"])}) for page in pages]
    except (OSError, ValueError, TypeError, KeyError):
        told = callout(f"Its pages are gone or of another version; run cablefem {command} again.", "not comparable")
        return [Section(command, command, told)]


def _apart(pages: Iterable[tuple[str, Section]]) -> list[Section]:
    """An id used by two commands gets the command's name."""
    out: dict[str, Section] = {}
    for command, section in pages:
        own = section.id if section.id not in out else f"{section.id}-{command}"
        out[own] = replace(section, id=own)
    return list(out.values())


Part = tuple[str, ...]  # a command and its arguments


@contextmanager
def missing(root: Path | None, parts: Sequence[Part]) -> Iterator[tuple[Path, list[Part]]]:
    """Give the folder of all results, where commands in the `with` block write, and the parts it lacks.

    A folder with the results of one scene lacks nothing.
    """
    root = store.ROOT if root is None else root
    if set(store.results(root)) - {"report"}:
        yield root, []
        return
    store.claim(root, "report", "report", ["report.html"])
    store.ROOT, before = root, store.ROOT
    try:
        yield root, [part for part in parts if not store.finished(root / _place(part)[1], part[0])]
    finally:
        store.ROOT = before


def broken(part: Part, faults: Sequence[str]) -> Section:
    """The page of a part that ended without a result."""
    command, name = _place(part)
    reason = callout("; ".join(faults), "disagree")
    title = f"cablefem {' '.join(part)}"
    return Section(f"{name}-{command}-broken", title, reason, "disagree", "It ended without a result.")


def gather(root: Path, parts: Sequence[Part], broken: Sequence[Section] = ()) -> bool:
    """Write the report of all finished results in a folder and its subfolders, these parts first.

    The first pages of all scenes of a command come before the rest, what broke before all.
    Return whether anything on it is red.
    """
    order = [_place(part) for part in parts]
    done = [
        (command, folder)
        for folder in [root, *sorted(root.glob("*/"))]
        for command in store.results(folder)
        if store.finished(folder, command)
    ]
    done.sort(key=lambda x: order.index((x[0], x[1].name)) if (x[0], x[1].name) in order else len(order))
    commands = list(dict.fromkeys(command for command, _ in done))
    pages = [
        (commands.index(command), i > 0, replace(s, id=f"{folder.name}-{s.id}", title=f"{folder.name}: {s.title}"))
        for command, folder in done for i, s in enumerate(kept(folder, command))
    ]  # fmt: skip
    sections = [*broken, *_apart((commands[i], section) for i, _, section in sorted(pages, key=lambda x: x[:2]))]
    if not sections:
        raise store.Refused(f"{root} holds no finished results to report")
    page.render("cablefem", sections, root / "report.html")
    tell(sections)
    terminal.say(f"written to {root}: report.html")
    return any(section.verdict == "disagree" for section in sections)


def _place(part: Part) -> tuple[str, str]:
    """The command, and the folder of its results: its scene's, or its own."""
    command, *arguments = part
    if arguments and not arguments[0].startswith("-"):
        return command, arguments[0]
    return command, small(command, "--quick" in arguments)


def tell(sections: Sequence[Section]) -> None:
    cells = [[s.title, s.verdict or "", s.summary] for s in sections if s.verdict or s.summary]
    terminal.table(["page", "verdict", "found"], cells)
