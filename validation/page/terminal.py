"""Output while a command works: tables, lines, progress; plain text without a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from validation.core.sidebyside import Progress

_HEARD: list[list[str]] = []  # copies of what is printed
STYLES = {"agree": "green", "disagree": "bold red", "not comparable": "yellow", "too coarse": "yellow"}


def say(text: str = "", style: str = "") -> None:
    """Print a line, on a terminal wrapped below its indent, in a style of rich."""
    for lines in _HEARD:
        lines.append(text)
    console = _console()
    if console is None:
        print(text)
        return
    from rich.padding import Padding
    from rich.text import Text

    words = text.lstrip(" ")
    console.print(Padding(Text(words, style=style), (0, 0, 0, len(text) - len(words)), expand=False))


@contextmanager
def heard() -> Iterator[list[str]]:
    """The lines that are printed in the `with` block."""
    lines: list[str] = []
    _HEARD.append(lines)
    try:
        yield lines
    finally:
        _HEARD.pop()


def complain(faults: Sequence[str]) -> None:
    for fault in faults:
        print(f"cablefem: {fault}", file=sys.stderr)


def faults(error: Exception) -> list[str]:
    """What broke a command, one sentence each."""
    if hasattr(error, "faults"):
        return list(error.faults)
    if isinstance(error, OSError):
        return [f"{error.filename or 'a file'}: {error.strerror}"]
    return [f"this is a fault of cablefem, not of your input ({type(error).__name__}: {error})"]


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[str] = ()) -> None:
    """Print a table; `right` names the right-aligned columns.

    In a pipe every row is one line; on a narrow terminal every cell.
    """
    text = _plain(columns, rows, right)
    for lines in _HEARD:
        lines.extend(text)
    console = _console()
    if console is None:
        print("\n".join(text))
        return
    narrowest = [_longest(x, name in right) for name, *x in zip(columns, columns, *rows, strict=True)]
    if sum(narrowest) + 3 * (len(columns) - 1) > console.width:
        _stacked(columns, rows)
        return
    from rich import box
    from rich.table import Table
    from rich.text import Text

    drawn = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for name, width in zip(columns, narrowest, strict=True):
        drawn.add_column(name, justify="right" if name in right else "left", min_width=width)
    for row in rows:
        drawn.add_row(*(Text(cell, style=STYLES.get(cell, "")) for cell in row))
    console.print(drawn)


def _longest(cells: Sequence[str], whole: bool) -> int:
    """The length of the longest cell, or of the longest word in any."""
    return max(len(word) for cell in cells for word in ([cell] if whole else cell.split() or [""]))


def _stacked(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    for row in rows:
        for name, cell in zip(columns, row, strict=True):
            say(f"{name} {cell}".strip(), style="bold" if name == columns[0] else STYLES.get(cell, ""))


def _plain(columns: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[str]) -> list[str]:
    lines = [columns, *rows]
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    cells = [zip(line, widths, columns, strict=True) for line in lines]
    return ["  ".join(x.rjust(n) if name in right else x.ljust(n) for x, n, name in row).rstrip() for row in cells]


@contextmanager
def progress() -> Iterator[Progress]:
    """Show a bar per label with the time left, on standard error; in a pipe one line a minute."""
    if not sys.stderr.isatty():
        last = [time.monotonic()]

        def line(label: str, done: float, note: str = "") -> None:
            if time.monotonic() - last[0] > 60.0:
                last[0] = time.monotonic()
                print(f"{label}: {done:.0%} {note}".rstrip(), file=sys.stderr, flush=True)

        yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    tasks: dict[str, TaskID] = {}
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeElapsedColumn(),
        TextColumn("left"), TimeRemainingColumn(), TextColumn("{task.fields[note]}"),
        console=Console(stderr=True), transient=True,
    ) as bars:  # fmt: skip

        def show(label: str, done: float, note: str = "") -> None:
            if label not in tasks:
                tasks[label] = bars.add_task(label, total=1.0, note="")
            bars.update(tasks[label], completed=done, note=note)

        yield show


def _console():
    """Rich's console if standard output is a terminal."""
    if not sys.stdout.isatty():
        return None
    from rich.console import Console

    return Console()
