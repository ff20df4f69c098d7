"""Output while a command works: tables, text, progress; plain text without a terminal."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from validation.core.sidebyside import Progress

_COPIES: list[list[str]] = []  # of what is printed
STYLES = {"agree": "green", "disagree": "bold red", "not comparable": "yellow", "too coarse": "yellow"}
STYLES |= {"met": "green", "not met": "bold red", "too close to tell": "yellow"}


def print_verdict(verdict: str) -> None:
    """Print the verdict on a whole check as a sentence."""
    from validation.core import store

    sentences = store.read_packaged_toml(__package__, "assets/verdicts.toml")
    print_text(sentences[verdict], style=STYLES[verdict])


def print_text(text: str = "", style: str = "") -> None:
    """Print text, on a terminal wrapped below its indent, in a style of rich."""
    for copy in _COPIES:
        copy.append(text)
    console = _rich_console()
    if console is None:
        print(text)
        return
    from rich.padding import Padding
    from rich.text import Text

    words = text.lstrip(" ")
    console.print(Padding(Text(words, style=style), (0, 0, 0, len(text) - len(words)), expand=False))


@contextmanager
def copy_printed_lines() -> Iterator[list[str]]:
    """The lines that are printed in the `with` block."""
    copy: list[str] = []
    _COPIES.append(copy)
    try:
        yield copy
    finally:
        _COPIES.pop()


def print_faults(faults: Sequence[str]) -> None:
    for fault in faults:
        print(f"cablefem: {fault}", file=sys.stderr)


def fault_sentences(error: Exception) -> list[str]:
    """What broke a command, one sentence each."""
    if hasattr(error, "faults"):
        return list(error.faults)
    if isinstance(error, OSError):
        return [f"{error.filename or 'a file could not be read or written'}: {error.strerror or error}"]
    whose = _method_package_of(error) or "cablefem"
    return [f"this is a fault of {whose}, not of your input ({type(error).__name__}: {error})"]


def _method_package_of(error: Exception) -> str:
    """The package of a method that is not ours, in whose code an error came up, or ""."""
    from importlib.metadata import entry_points  # slow to load

    from validation.core.methods import ENTRY_POINTS

    packages = {point.module.partition(".")[0] for point in entry_points(group=ENTRY_POINTS)}
    modules = (frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__))
    return next((name for module in modules if (name := module.partition(".")[0]) in packages), "")


def print_table(columns: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[str] = ()) -> None:
    """Print a table; `right` names the right-aligned columns.

    In a pipe every row is one line; on a narrow terminal every cell.
    """
    text = _aligned_lines(columns, rows, right)
    for copy in _COPIES:
        copy.extend(text)
    console = _rich_console()
    if console is None:
        print("\n".join(text))
        return
    narrowest = [_min_column_width(column, column[0] in right) for column in zip(columns, *rows, strict=True)]
    if sum(narrowest) + 3 * (len(columns) - 1) > console.width:
        _print_stacked_cells(columns, rows)
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


def _min_column_width(column: Sequence[str], unbroken: bool) -> int:
    """Width of the longest cell, or of the longest word where cells may break."""
    words = column if unbroken else " ".join(column).split()
    return max(map(len, words), default=0)


def _print_stacked_cells(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    for row in rows:
        for name, cell in zip(columns, row, strict=True):
            print_text(f"{name} {cell}".strip(), style="bold" if name == columns[0] else STYLES.get(cell, ""))


def _aligned_lines(columns: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[str]) -> list[str]:
    aligned = []
    for name, *cells in zip(columns, columns, *rows, strict=True):
        width = max(map(len, cells))
        aligned.append([cell.rjust(width) if name in right else cell.ljust(width) for cell in cells])
    return ["  ".join(row).rstrip() for row in zip(*aligned, strict=True)]


@contextmanager
def progress_bars() -> Iterator[Progress]:
    """Show a bar per label with the remaining time, on standard error; in a pipe one row a minute."""
    if not sys.stderr.isatty():
        last = time.monotonic()

        def show_text(label: str, done: float, note: str = "") -> None:
            """Print a row at most once a minute."""
            nonlocal last
            if time.monotonic() - last > 60.0:
                last = time.monotonic()
                print(f"{label}: {done:.0%} {note}".rstrip(), file=sys.stderr, flush=True)

        yield show_text
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    tasks: dict[str, TaskID] = {}
    columns = [
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("remaining"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    ]
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:

        def show(label: str, done: float, note: str = "") -> None:
            """Move the bar of a label."""
            if label not in tasks:
                tasks[label] = bars.add_task(label, total=1.0, note="")
            bars.update(tasks[label], completed=done, note=note)

        yield show


def _rich_console() -> Console | None:
    """Rich's console if standard output is a terminal."""
    if not sys.stdout.isatty():
        return None
    from rich.console import Console

    return Console()
