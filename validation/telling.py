"""What several commands say about responses and verdicts, in a few lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from validation import terminal
from validation.core import measures
from validation.core.methods import find

if TYPE_CHECKING:
    from cablefem.response import Response
    from validation.core.agreement import Agreement


def rows(verdicts: Sequence[Agreement]) -> None:
    """Print rows of a verdict; how bounds came about stands in the files."""
    cells = []
    for row in verdicts:
        gap, allowed = (f"{x:.1e}" if math.isfinite(x) else "-" for x in (row.gap, row.allowed))
        cells.append([
            " ".join(x for x in (row.quantity, row.law, row.party) if x), gap, allowed,
            "-" if row.where is None else f"{row.where:.3f}", row.verdict.value,
            row.bound.line(),
        ])  # fmt: skip
    columns = ["quantity", "gap", "allowed", "at s_o/l", "verdict", "because"]
    if all(row.where is None for row in verdicts):
        columns, cells = columns[:3] + columns[4:], [row[:3] + row[4:] for row in cells]
    terminal.table(columns, cells, right=["gap", "allowed", "at s_o/l"])


def answer(r: Response) -> None:
    """Print what a run was asked for and the few numbers one wants first."""
    at = int(r.v.argmax())
    error = "" if r.path_error is None else f" +- {r.path_error * measures.path_scale(r):.2g}"
    terminal.say(f"{r.scene}, {r.method}: {short(r)}")
    terminal.say(
        f"  largest deflection of the mass {r.max_deflection:.5g}{error} m, "
        f"at s_o/l = {r.s_o[at] / r.length:.3f}, t = {r.t[at]:.4g} s"
    )
    for row in r.design:
        if row["quantity"] != "slack_onset":
            value = f"{row['quantity'].replace('_', ' '):<30}{_barred(row['value'], row['bar'])} {row['unit']}"
            where = f"at s/l = {row['s'] / r.length:.3f} with the mass at {row['s_o'] / r.length:.3f}"
            terminal.say(f"  {value}, {where}")
    for x in r.events:
        if x["event"] in ("brake", "arrival", "stop", "turn", "thrust_end", "lift_off"):
            t, s_o, v = (_barred(x[name], x.get(f"bar_{name}")) for name in ("t", "s_o", "speed"))
            speed = f", {v} m/s = {3.6 * x['speed']:.4g} km/h" if x["event"] not in ("stop", "turn") else ""
            terminal.say(f"  {x['event'].replace('_', ' '):<12}after {t} s at {s_o} m{speed}")
    if r.slack_onset is not None:
        after = {
            "auto": "from there on with the tension-only law",
            "elastic": "where an elastic law carries compression, and what follows means nothing",
            "tension-only": "where the tension-only law lets it hang",
        }[r.law]
        first = "" if r.slack_at is None else f" at s/l = {r.slack_at:.3f} first,"
        terminal.say(f"  slack from s_o/l = {r.slack_onset:.3f} on,{first} {after}")
    terminal.say(f"  {r.status}, to s_o/l = {r.reached:.5g}: {r.work['steps']} steps in {r.seconds:.2g} s")
    for line in map(str, r.flags) if r.reason is None else [r.reason]:
        terminal.say(f"  {line}", style="yellow")


def _barred(value: float, bar: float | None) -> str:
    return f"{value:.5g}" if bar is None else f"{value:.5g} +- {bar:.2g}"


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
