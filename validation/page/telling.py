"""What several commands say about responses and verdicts, in a few lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from validation.core.methods import find
from validation.core.quantities import told, with_bar
from validation.page import terminal

if TYPE_CHECKING:
    from cablefem.response import Response
    from validation.core.agreement import Agreement


def rows(verdicts: Sequence[Agreement]) -> None:
    """Print rows of a verdict, laws that hold as one, and below the table why a bound is what it is where one bites."""
    cells = []
    for row, name in _condensed(verdicts):
        gap, allowed = (f"{x:.1e}" if math.isfinite(x) else "-" for x in (row.gap, row.allowed))
        cells.append([name, gap, allowed, "-" if row.where is None else f"{row.where:.3f}", row.verdict.value])
    columns = ["quantity", "gap", "allowed", "at s_o/l", "verdict"]
    if all(row.where is None for row in verdicts):
        columns, cells = columns[:3] + columns[4:], [row[:3] + row[4:] for row in cells]
    terminal.table(columns, cells, right=["gap", "allowed", "at s_o/l"])
    for row in verdicts:
        if row.verdict.value != "agree":
            terminal.say(f"  {_name(row)}: {row.bound.line()}", style=terminal.STYLES[row.verdict.value])


def _condensed(verdicts: Sequence[Agreement]) -> list[tuple[Agreement, str]]:
    """Return rows and their names; of the laws in SI that hold only the one nearest to its limit."""
    held = [row for row in verdicts if row.quantity == "laws_si" and row.verdict.value == "agree"]
    nearest = max(held, key=lambda row: row.gap / row.allowed if row.allowed else 0.0, default=None)
    return [
        (row, _name(row) if row is not nearest or len(held) < 2 else f"{_name(row)}; {len(held) - 1} more hold")
        for row in verdicts
        if row not in held or row is nearest
    ]


def _name(row: Agreement) -> str:
    return " ".join(x for x in (row.quantity, row.law, row.party) if x)


def answer(r: Response) -> None:
    """Print what a run was asked for, its design numbers, what happened on the way, and how far it went."""
    terminal.say(f"{r.scene}, {r.method}: {short(r)}")
    numbers([row for row in r.design if row["quantity"] != "slack_onset"], r.length)
    if r.path_error is not None:
        everywhere = "" if r.drive == "free" else " wherever paths are compared"
        terminal.say(f"  mass path ± {r.path_error * r.path_scale:.2g} m{everywhere}")
    events([x for x in r.events if x["event"] != "release"])
    if r.slack_onset is not None:
        after = {
            "auto": "from there on with the tension-only law",
            "elastic": "where an elastic law carries compression, and what follows means nothing",
            "tension-only": "where the tension-only law lets it hang",
        }[r.law]
        first = "" if r.slack_at is None else f" at s/l = {r.slack_at:.3f} first,"
        bar = next((row["bar"] for row in r.design if row["quantity"] == "slack_onset"), None)
        terminal.say(f"  slack from s_o/l = {with_bar(r.slack_onset, bar)} on,{first} {after}")
    terminal.say(f"  {r.status}, to s_o/l = {r.reached:.5g}: {r.work['steps']} steps in {r.seconds:.2g} s")
    for line in map(str, r.flags) if r.reason is None else [r.reason]:
        terminal.say(f"  {line}", style="yellow")


def numbers(rows: Sequence[dict[str, Any]], length: float) -> None:
    """Print design numbers."""
    heads = {"what": "design number", "value": "value", "t": "when", "mass": "mass at s_o/l", "at": "at s/l"}
    cells = [[row[key] for key in heads] for row in (told(x, length) for x in rows)]
    terminal.table(list(heads.values()), cells, right=list(heads.values())[2:])


def events(happened: Sequence[dict[str, Any]]) -> None:
    """Print what happened on the way, a line each."""
    for x in happened:
        t, s_o = (with_bar(x[name], x.get(f"bar_{name}")) for name in ("t", "s_o"))
        v, bar = x["speed"], x.get("bar_speed")
        speed = f", {with_bar(v, bar)} m/s = {with_bar(3.6 * v, bar and 3.6 * bar)} km/h"
        speed = "" if x["event"] in ("stop", "turn") else speed
        terminal.say(f"  {x['event'].replace('_', ' '):<12}after {t} s at {s_o} m{speed}")


def short(r: Response) -> str:
    """Return what a run was asked for, less what every run has by default."""
    method = find(r.method)
    told = {
        key: value for key, value in r.settings.items()
        if key in (method.resolution.setting, "steps") or value != method.knobs[key].default
    }  # fmt: skip
    kinds = [kind for kind, usual in ((r.model, "full"), (r.load, "mass"), (r.law, "auto")) if kind != usual]
    return ", ".join([f"{key}={value}" for key, value in told.items()] + kinds)


def broken(*responses: Response) -> int:
    """Return 2 and say so where a run broke before the slack onset, else 0; an unstable run's slack is no slack."""
    bad = [r for r in responses if r.status != "complete" and (r.slack_onset is None or r.cause == "unstable")]
    terminal.complain([f"{r.method} broke at s_o/l = {r.reached:.4g}: {r.reason}" for r in bad])
    return 2 if bad else 0
