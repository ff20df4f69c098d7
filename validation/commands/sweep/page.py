"""Pages of a sweep, from its stored rows: what came out, maps of the design numbers, and every scene to filter."""

import json
import textwrap
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from pandas import qcut

from validation.commands.sweep.engine import frame
from validation.commands.sweep.job import BROKEN, DESIGN
from validation.commands.sweep.study import Study
from validation.core.quantities import named, scale_of, unit_of
from validation.page.figures import panels
from validation.page.page import Section, callout, figure, gallery, number, percent, table

SHOWN = 4000  # rows in the page and dots in a map at most, evenly taken; all are in rows/
MAPS = ("tension_max", "mass_deepest", "contact_min", "haul_force_max", "max_deflection", "path_error")
PARTS = 3  # of a third axis


def sections(folder: Path) -> list[Section]:
    study, rows = Study.load(folder / "study.toml"), frame(folder)
    return [_outcome(study, rows), _maps(study, rows), _explorer(study, folder / "study.toml", rows)]


def _outcome(study: Study, rows: Any) -> Section:
    complete = rows["status"] == "complete"
    html = [_counted(rows, ["status"], "What came of the scenes")]
    html += [] if complete.all() else [_counted(rows[~complete], ["status", "cause"], "Why, where not complete")]
    judged = rows[rows["verdict"].notna()]
    html += (
        [_counted(judged, [*(["fault"] if study.job == "power" else []), "verdict"], "Verdicts")] if len(judged) else []
    )
    for name, most in study.limit.items():
        if name in rows:
            over = int((rows[name] > most).sum())
            html.append(callout(f"{over} of {len(rows)} scenes exceed the limit {name} = {number(most)}."))
    if rows["true_error"].notna().any():
        lines = coverage(rows)
        html.append(table(lines, list(lines[0]), caption="Error bars against finer runs"))
    broken = int(rows["status"].isin(BROKEN).sum())
    summary = f"{len(rows)} of {len(study)} scenes, {complete.sum()} complete, {broken} without an answer"
    return Section("sweep-outcome", study.title or "Sweep", Markup("\n").join(html), None, summary)


def _counted(rows: Any, by: list[str], caption: str) -> Markup:
    """Table of how often each combination of words occurs, most frequent first."""
    counts = rows.value_counts(by, dropna=False).reset_index(name="scenes").rename(columns={"verdict": "judged"})
    counts["part"] = [percent(n / len(rows), 3) for n in counts["scenes"]]
    return table(counts.replace({np.nan: None}).to_dict("records"), list(counts.columns), caption=caption)


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
    logs = {a.name for a in study.axes if a.log}
    known = {quantity: _thinned(rows[rows[quantity].notna()]) for quantity in MAPS if axes and quantity in rows}
    drawn = [_map(of, x, axes, logs, study.limit.get(x, np.inf)) for x, of in known.items() if len(of) > 2]
    html = gallery(*drawn) if drawn else callout("No numbers to map.")
    limits = ", ".join(f"{k} = {number(v)}" for k, v in study.limit.items())
    said = "One dot a scene. A ring: the cable goes slack on the way. A cross: beyond the limit"
    return Section("sweep-maps", "Maps", Markup("<p>{}{}.</p>{}").format(said, f" {limits}" if limits else "", html))


def _thinned(rows: Any) -> Any:
    return rows.iloc[:: max(1, -(-len(rows) // SHOWN))]


def _map(rows: Any, quantity: str, axes: list[str], logs: set[str], most: float) -> Markup:
    """Draw a quantity over the first two axes, or over the only one; a third axis is cut into parts."""
    factor, unit = scale_of(rows[quantity].to_numpy(float), unit_of(quantity))
    rows = rows.assign(**{quantity: factor * rows[quantity]})
    name = f"{named(quantity)} [{unit or '–'}]"
    x, y = (*axes, quantity)[:2]
    parts = _parts(rows, axes[2]) if len(axes) > 2 else [("", rows)]
    fig, grid = panels(1, len(parts), height=2.9 if len(parts) == 1 else 2.6, sharey=True, squeeze=False)
    low, high = np.percentile(rows[quantity].to_numpy(float), [1, 99])
    for ax, (title, part) in zip(grid[0], parts, strict=True):
        dots = ax.scatter(part[x], part[y], c=part[quantity], s=14, vmin=low, vmax=high, linewidths=0)
        dots.set_urls([f"#scene-{i}" for i in part.index])
        slack, beyond = part[part["slack_onset"].notna()], part[part[quantity] > factor * most]
        ax.scatter(slack[x], slack[y], s=30, facecolors="none", edgecolors="#d55e00", linewidths=0.7)
        ax.scatter(beyond[x], beyond[y], s=24, marker="x", c="#1a1a1a", linewidths=0.8)
        ax.set_title(title, fontsize=8)
        ax.set(xlabel=x, xscale="log" if x in logs else "linear", yscale="log" if y in logs else "linear")
    grid[0][0].set_ylabel(name if y == quantity else y)
    # longer names would be cut off
    fig.colorbar(dots, ax=list(grid[0]), label=textwrap.fill(name, 24))
    split = f", {axes[2]} from left to right" if len(axes) > 2 else ""
    return figure(fig, f"{named(quantity)[0].upper()}{named(quantity)[1:]} over {x} and {y}{split}")


def _parts(rows: Any, axis: str) -> list[tuple[str, Any]]:
    """Scenes by an axis: its values where they are few, else in equal shares."""
    if rows[axis].nunique() <= PARTS:
        return [(f"{axis} = {number(x)}", part) for x, part in rows.groupby(axis)]
    shares = qcut(rows[axis], PARTS, duplicates="drop")
    return [(f"{number(x.left)} to {number(x.right)}", part) for x, part in rows.groupby(shares, observed=True)]


def _explorer(study: Study, file: Path, rows: Any) -> Section:
    """All scenes as lines across their axes, which can be narrowed; below, a table, each row with its command."""
    taken = _thinned(rows)
    numbers = [c for c in (*DESIGN, "max_deflection", "path_error", "seconds") if taken[c].notna().any()]
    columns = [*(a.name for a in study.axes), *numbers, "status", "verdict", "method"]
    columns = [c for c in dict.fromkeys(columns) if taken[c].notna().any()]
    logs = {a.name for a in study.axes if a.log}
    told = [{"name": c, "log": c in logs, "values": _plain(taken[c])} for c in columns]
    data = {"study": str(file), "index": taken.index.tolist(), "columns": told}
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
