"""Answers and verdicts in a few lines, for several commands."""

from collections.abc import Sequence
from typing import Any

from cablefem.response import Response
from cablefem.scene import Scene
from validation.core.agreement import Agreement
from validation.core.answers import outcome
from validation.core.measures import WINDOWS
from validation.core.methods import find
from validation.core.quantities import matter, told, with_bar
from validation.page import terminal
from validation.page.answer import EVENTS


def rows(verdicts: Sequence[Agreement]) -> None:
    cells = []
    for row in (r.row() for r in verdicts):
        name = " ".join(row[key] for key in ("quantity", "law", "with") if row.get(key))
        numbers = [f"{row[key]:.1e}" if row.get(key) is not None else "-" for key in ("gap", "allowed", "asked_for")]
        where = "-" if row.get("where") is None else f"{row['where']:.3f}"
        cells.append([name, *numbers, where, row["verdict"] or "shown"])
    columns = ["quantity", "gap", "allowed", "asked for", "at s_o/l", "verdict"]
    terminal.table(columns, cells, right=columns[1:5])


def answer(scene: Scene, r: Response) -> None:
    terminal.say(f"{r.scene}: {outcome(scene, r).sentence}", style="bold")
    events([x for x in r.events if x["event"] in EVENTS[1:]])  # without the release
    numbers(matter(r.design))
    if r.slack_onset is not None:
        bar = next((row["bar"] for row in r.design if row["quantity"] == "slack_onset"), None)
        at = with_bar(r.slack_onset * r.length, bar and bar * r.length)
        elastic = "this elastic law carries compression, and means nothing"
        after = elastic if r.law == "elastic" else "the rope carries no compression"
        terminal.say(f"  slack somewhere from car at {at} m on; from there on {after}")


def numbers(design: Sequence[dict[str, Any]]) -> None:
    lines = [told(x) for x in design]
    width = max((len(line["what"]) for line in lines), default=0)
    for line in lines:
        at = f", at {line['at']}" if line["at"] else ""
        when = f" after {line['t']}" if line["t"] else ""
        terminal.say(f"  {line['what']:<{width}}  {line['value']}{at}{when}")


def events(happened: Sequence[dict[str, Any]], most: int = 5) -> None:
    """Print events, one per line; the last ones if there are many."""
    for x in happened[-most:]:
        t, s_o = (with_bar(x[name], x.get(f"bar_{name}")) for name in ("t", "s_o"))
        v = 3.6 * x["speed"]
        bar = x.get("bar_speed")
        speed = "" if x["event"] in ("stop", "turn") else f" with {with_bar(v, bar and 3.6 * bar)} km/h"
        terminal.say(f"  {x['event'].replace('_', ' '):<10}  after {t} s at {s_o} m{speed}")


def work(r: Response) -> None:
    """Print method, settings and reach of a run, and reasons for doubt."""
    if r.model == "quasi-static":
        terminal.say("  by the quasi-static model, which leaves out the inertia of the rope: that is in its bars")
        for line in map(str, r.flags):
            terminal.say(f"  {line}", style="yellow")
        return
    method = find(r.method)
    settings = {
        key: value for key, value in r.settings.items()
        if key in (method.resolution.setting, "steps") or value != method.knobs[key].default
    }  # fmt: skip
    kinds = [kind for kind, usual in ((r.model, "full"), (r.load, "mass"), (r.law, "auto")) if kind != usual]
    told = ", ".join([*(f"{key}={value}" for key, value in settings.items()), *kinds])
    bar = "" if r.path_error is None else f"; path ± {r.path_error * r.path_scale:.2g} m"
    terminal.say(f"  by {r.method} ({told}) in {r.seconds:.2g} s{bar}")
    for line in map(str, r.flags):
        terminal.say(f"  {line}", style="yellow")


def broken(*responses: Response) -> int:
    """Return 2 with a message if a run broke before slack and the end of the comparison, else 0."""
    bad = [
        r for r in responses
        if r.status != "complete" and (r.slack_onset is None or r.cause == "unstable")
        and (r.drive == "free" or r.reached < WINDOWS[r.drive][1])
    ]  # fmt: skip
    terminal.complain([f"{r.method} broke with the car at {r.s_o[-1]:.1f} m: {r.reason}" for r in bad])
    return 2 if bad else 0
