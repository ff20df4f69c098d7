"""Pages of a sweep, from its stored rows: what came out, maps of the design numbers, and every scene to filter."""

import json
import textwrap
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from validation.commands.sweep.engine import frame
from validation.commands.sweep.job import BROKEN, DESIGN
from validation.commands.sweep.study import Study, built_in
from validation.core import store
from validation.core.quantities import named, scale_of, unit_of
from validation.page.figures import panels
from validation.page.page import Section, callout, figure, gallery, number, table

SHOWN = 4000  # rows in the page and dots in a map at most, evenly taken; all are in rows/
MAPS = ("tension_max", "mass_deepest", "contact_min", "haul_force_max", "max_deflection", "path_error")
MULTIPLES = 3


def sections(folder: Path) -> list[Section]:
    """Return the pages; each names what it leaves out."""
    study = Study.load(folder / "study.toml")
    told = store.read(folder / "sweep.json")
    rows = frame(folder)
    return [
        _outcome(study, told, rows),
        _maps(study, rows),
        _explorer(study, told["study"] if told["study"] in built_in() else "study.toml", rows),
    ]


def _outcome(study: Study, told: dict[str, Any], rows: Any) -> Section:
    counts = rows["status"].value_counts()
    html = [_counted(rows, ["status"], "What came of the scenes")]
    short = rows[rows["status"] != "complete"]
    html += [_counted(short, ["status", "cause"], "Why, where not complete")] if len(short) else []
    judged = rows[rows["verdict"].notna()]
    by = ["fault", "verdict"] if "fault" in rows and rows["fault"].notna().any() else ["verdict"]
    html += [_counted(judged, by, "Verdicts")] if len(judged) else []
    for name, most in study.limit.items():
        if name in rows:
            over = int((rows[name] > most).sum())
            html.append(callout(f"{over} of {len(rows)} scenes exceed the limit {name} = {number(most)}."))
    if rows["true_error"].notna().any():
        lines = coverage(rows)
        html.append(table(lines, list(lines[0]), caption="Error bars against finer runs"))
    broken = int(sum(counts.get(x, 0) for x in BROKEN))
    summary = f"{len(rows)} of {len(study)} scenes, {counts.get('complete', 0)} complete, {broken} without an answer"
    return Section("sweep-outcome", study.title or f"Sweep {told['study']}", Markup("\n").join(html), None, summary)


def _counted(rows: Any, by: list[str], caption: str) -> Markup:
    """Return how many scenes have which words, most first."""
    heads = {"verdict": "judged"}
    lines = [
        {heads.get(name, name): None if word != word else word for name, word in zip(by, words, strict=True)}
        | {"scenes": int(n), "part": f"{100.0 * n / len(rows):.1f} %"}
        for words, n in rows.groupby(by, dropna=False).size().sort_values(ascending=False).items()
        for words in [words if len(by) > 1 else [words]]
    ]
    return table(lines, list(lines[0]), caption=caption)


OF = {"path": ("path_error", "true_error", "doubt"), "tension": ("tension_error", "true_tension", "doubt_tension")}


def coverage(rows: Any) -> list[dict[str, Any]]:
    """Do the bars hold?  Judged where the two finer runs differ by less than a third of the bar or of the error."""
    lines = []
    for quantity, (bar, true, doubt) in OF.items():
        known = rows[rows[true].notna()]
        judged = known[known[doubt] <= known[[bar, true]].max(axis=1) / 3.0]
        for name, part in [*judged.groupby("method"), ("all", judged)]:
            short, plain = part[part[true] > part[bar]], part[part["flags"].isna()]
            lines.append({
                "bar of": quantity, "method": name, "held against": len(part),
                "bar holds": f"{100.0 * (1.0 - len(short) / len(part)):.1f} %" if len(part) else "",
                "unflagged": len(plain), "too small and unflagged": int(short["flags"].isna().sum()),
                "bar over true, median": float((part[bar] / part[true]).median()),
                "the same, unflagged": float((plain[bar] / plain[true]).median()),
            })  # fmt: skip
    return lines


def _maps(study: Study, rows: Any) -> Section:
    axes = [a.name for a in study.axes if a.numeric and rows[a.name].nunique() > 1]
    drawn = []
    for quantity in MAPS:
        if quantity in rows and rows[quantity].notna().sum() > 2 and len(axes) > 0:
            drawn.append(_map(study, rows[rows[quantity].notna()], quantity, axes))
    html = gallery(*drawn) if drawn else callout("No numbers to map.")
    limits = ", ".join(f"{k} = {number(v)}" for k, v in study.limit.items())
    said = "One dot a scene. A ring: the cable goes slack on the way. A cross: beyond the limit"
    return Section("sweep-maps", "Maps", Markup("<p>{}{}.</p>{}").format(said, f" {limits}" if limits else "", html))


def _map(study: Study, rows: Any, quantity: str, axes: list[str]) -> Markup:
    rows = rows.iloc[:: max(1, -(-len(rows) // SHOWN))]
    factor, unit = scale_of(rows[quantity].to_numpy(float), unit_of(quantity))
    rows = rows.assign(**{quantity: factor * rows[quantity]})
    called = f"{named(quantity)} [{unit or '–'}]"
    x, y, third, *_ = [*axes, quantity, None] if len(axes) == 1 else [*axes, None]
    parts = _parts(rows[third]) if third else [("", np.ones(len(rows), bool))]
    fig, grid = panels(1, len(parts), height=2.9 if len(parts) == 1 else 2.6, sharey=True, squeeze=False)
    low, high = np.percentile(rows[quantity].to_numpy(float), [1, 99])
    logs = {a.name for a in study.axes if a.log}
    most = factor * study.limit.get(quantity, np.inf)
    for ax, (title, chosen) in zip(grid[0], parts, strict=True):
        part = rows[chosen]
        dots = ax.scatter(part[x], part[y], c=part[quantity], s=14, vmin=low, vmax=high, linewidths=0)
        dots.set_urls([f"#scene-{i}" for i in part.index])
        slack, beyond = part[part["slack_onset"].notna()], part[part[quantity] > most]
        ax.scatter(slack[x], slack[y], s=30, facecolors="none", edgecolors="#d55e00", linewidths=0.7)
        ax.scatter(beyond[x], beyond[y], s=24, marker="x", c="#1a1a1a", linewidths=0.8)
        ax.set_title(title, fontsize=8)
        ax.set(xlabel=x, xscale="log" if x in logs else "linear", yscale="log" if y in logs else "linear")
    grid[0][0].set_ylabel(called if y == quantity else y)
    # longer names than a colour bar is high would be cut off, with their units
    fig.colorbar(dots, ax=list(grid[0]), label=textwrap.fill(called, 24))
    name = f"{named(quantity)[0].upper()}{named(quantity)[1:]}"
    return figure(fig, f"{name} over {x} and {y}" + (f", {third} from left to right" if third else ""))


def _parts(values: Any) -> list[tuple[str, Any]]:
    """Return the third axis in a few parts: its values where they are few, else equal shares of the scenes."""
    distinct = np.unique(values)
    if len(distinct) <= MULTIPLES:
        return [(f"{values.name} = {number(x)}", (values == x).to_numpy()) for x in distinct]
    edges = np.quantile(values, np.linspace(0.0, 1.0, MULTIPLES + 1))
    return [
        (f"{number(a)} to {number(b)}", ((values >= a) & ((values < b) | (b == edges[-1]))).to_numpy())
        for a, b in pairwise(edges)
    ]


def _explorer(study: Study, name: str, rows: Any) -> Section:
    """All scenes as lines across their axes, which can be narrowed; below, a table, each row with its command."""
    taken = rows.iloc[:: max(1, -(-len(rows) // SHOWN))]
    numbers = [c for c in (*DESIGN, "max_deflection", "path_error", "seconds") if taken[c].notna().any()]
    columns = [*(a.name for a in study.axes), *numbers, "status", "verdict", "method"]
    columns = [c for c in dict.fromkeys(columns) if taken[c].notna().any()]
    logs = {a.name for a in study.axes if a.log}
    told = [{"name": c, "log": c in logs, "values": _plain(taken[c])} for c in columns]
    data = {"study": name, "index": taken.index.tolist(), "columns": told}
    script = (resources.files(__package__) / "explorer.js").read_text(encoding="utf-8")
    left_out = "" if len(taken) == len(rows) else f" {len(taken)} of {len(rows)} scenes are shown, evenly taken."
    html = Markup(
        "<p>Drag along an axis to narrow it, double-click to free it.{}</p>"
        '<div class="scroll"><canvas id="sweep-lines" width="1180" height="340" '
        'aria-label="parallel coordinates of all scenes"></canvas></div><p id="sweep-count" aria-live="polite"></p>'
        '<div class="scroll" id="sweep-table"></div><script type="application/json" id="sweep-data">{}</script>'
        "<script>{}</script>"
    ).format(left_out, Markup(json.dumps(data).replace("<", "\\u003c")), Markup(script))
    return Section("sweep-scenes", "Scenes", html)


def _plain(values: Any) -> list[Any]:
    return [None if x is None or x != x else x if isinstance(x, str) else float(f"{x:.5g}") for x in values.tolist()]
