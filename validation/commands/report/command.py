from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from validation import terminal
from validation.core import store

PLACE = 12
EXAMPLE = "cablefem report"
# What a full report consists of, in the order of its pages; the folder of each command is its scene or itself.
PARTS = (
    ("check", "level"), ("check", "cruise"), ("check", "inclined"), ("paper",), ("oracles",), ("chart", "level"),
    ("advise", "level", "--tol", "1e-2"), ("modes", "bare"), ("atlas",),
)  # fmt: skip


def command(
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help=f"Folder of all results. Default: {store.ROOT}.")
    ] = None,
) -> int:
    """Run what is missing and gather all results in one HTML file.

    Each part is a command of its own, with its results in DIR/SCENE; finished parts are taken as they are, so an
    interrupted report goes on where it stopped. Writes DIR/report.html. DIR may also be the folder of one result: then
    only this is gathered.
    """
    from validation.cli import main

    root = store.ROOT if out is None else out
    if not set(store.results(root)) - {"report"}:
        store.claim(root, "report", "report", ["report.html"], among=True)
        store.ROOT, before = root, store.ROOT
        try:
            missing = [part for part in PARTS if not store.finished(root / _folder(part), part[0])]
            for i, part in enumerate(missing):
                terminal.say(f"part {i + 1} of {len(missing)}: cablefem {' '.join(part)}", style="bold")
                if main(list(part)) == 130:
                    raise KeyboardInterrupt
                terminal.say()
        finally:
            store.ROOT = before
    return _gathered(root)


def _folder(part: tuple[str, ...]) -> str:
    return part[min(1, len(part) - 1)]


def _gathered(root: Path) -> int:
    """Write the report of all finished results in a folder and in its subfolders."""
    from validation import report
    from validation.page import page

    order = [(part[0], _folder(part)) for part in PARTS]
    done = [
        (command, folder)
        for folder in [root, *sorted(root.glob("*/"))]
        for command in store.results(folder)
        if store.finished(folder, command)
    ]
    done.sort(key=lambda x: order.index((x[0], x[1].name)) if (x[0], x[1].name) in order else len(order))
    sections = [
        replace(s, id=f"{folder.name}-{s.id}", title=f"{folder.name}: {s.title}")
        for command, folder in done for s in report.kept(folder, command)
    ]  # fmt: skip
    if not sections:
        raise store.Refused(f"{root} holds no finished results to report")
    page.render("cablefem", sections, root / "report.html")
    report.tell(sections)
    terminal.say(f"written to {root}: report.html")
    return 0
