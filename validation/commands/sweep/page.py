"""Pages of a sweep: what came out, maps of the design numbers, and every scene to filter."""

import json
import re
import textwrap
from collections.abc import Iterator
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from pandas import qcut

from cablefem.scene import Scene
from cablefem.scene.keys import keys
from validation.commands.sweep.engine import frame
from validation.commands.sweep.job import BROKEN, DESIGN
from validation.commands.sweep.study import Study
from validation.core import store
from validation.core.quantities import KNOWN, named, scale_of, unit_of
from validation.page.answer.many import ENDS
from validation.page.figures import figure, panels
from validation.page.page import Section, drawn, number, percent, table
from validation.page.plot import COLORS

SHOWN = 4000  # most rows in the page and dots in a map, evenly taken
MAPS = ("tension_max", "speed_max", "mass_deepest", "contact_min", "haul_force_max", "max_deflection", "path_error")
PARTS = 3  # of a third axis


def sections(folder: Path) -> list[Section]:
    file = folder / "study.toml"
    study = Study.load(file)
    rows = frame(folder)
    complete = rows["status"] == "complete"
    thin = _thinned(rows)
    packed = Markup(json.dumps(_scenes(study, file, thin)).replace("<", "\\u003c"))
    script = Markup((resources.files(__package__) / "explorer.js").read_text(encoding="utf-8"))
    return drawn(
        __package__, study=study, rows=rows, complete=complete.sum(), broken=rows["status"].isin(BROKEN).sum(),
        unfinished=rows[~complete], judged=rows[rows["verdict"].notna()], counted=_counted,
        bars=coverage(rows) if rows["true_error"].notna().any() else [], maps=list(_maps(study, rows)),
        shown=len(thin), data=packed, script=script,
    )  # fmt: skip


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
            short = part[part[true] > part[bar]]
            plain = part[part["flags"].isna()]
            lines.append({
                "bar of": quantity, "method": name, "held against": len(part),
                "bar holds": f"{100.0 * (1.0 - len(short) / len(part)):.1f} %" if len(part) else "",
                "unflagged": len(plain), "too small and unflagged": int(short["flags"].isna().sum()),
                "bar over true, median": float((part[bar] / part[true]).median()),
                "the same, unflagged": float((plain[bar] / plain[true]).median()),
            })  # fmt: skip
    return lines


def _maps(study: Study, rows: Any) -> Iterator[Markup]:
    axes = [name for name, a in study.axes.items() if a.numeric and rows[name].nunique() > 1]
    logs = {name for name, a in study.axes.items() if a.log}
    if axes and rows["outcome_kind"].notna().any():
        yield _outcomes(_thinned(rows[rows["outcome_kind"].notna()]), axes, logs)
    for quantity in MAPS if axes else ():
        known = _thinned(rows[rows[quantity].notna()])
        if len(known) > 2:
            yield _map(known, quantity, axes, logs)


def _outcomes(rows: Any, axes: list[str], logs: set[str]) -> Markup:
    """Draw what becomes of the car over the first two axes, a colour for each kind."""
    x = axes[0]
    y = axes[1] if len(axes) > 1 else "speed_max"
    fig, grid = panels(1, 1, height=2.9, squeeze=False)
    ax = grid[0][0]
    for i, kind in enumerate(rows["outcome_kind"].value_counts().index):
        part = rows[rows["outcome_kind"] == kind]
        look = {"color": COLORS[i % len(COLORS)], "marker": "o" if i < len(COLORS) else "s"}
        dots = ax.scatter(part[x], part[y], s=14, linewidths=0, label=ENDS.get(kind, kind), **look)
        dots.set_urls([f"#scene-{i}" for i in part.index])
    ax.set(xlabel=_with_unit(x), ylabel=_with_unit(y))
    ax.set(xscale="log" if x in logs else "linear", yscale="log" if y in logs else "linear")
    ax.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure(fig, f"What becomes of the car over {x} and {y}")


@cache
def _units() -> dict[str, str]:
    """Unit of each axis and each number."""
    groups = store.shipped(__package__, "keys.toml")["groups"]
    return {key.name: key.unit for key in keys(Scene)} | {name: unit for name, (unit, _) in groups.items()}


def _with_unit(name: str) -> str:
    """A column with its unit, for an axis or the head of a table."""
    kind = name.partition(":")[0]
    unit = unit_of(name) if kind in KNOWN else {"seconds": "s"}.get(name, _units().get(re.sub(r"\.\d+\.", ".0.", name)))
    return name if unit is None else f"{name} [{unit if unit not in ('', '-') else '–'}]"


def _thinned(rows: Any) -> Any:
    return rows.iloc[:: max(1, -(-len(rows) // SHOWN))]


def _map(rows: Any, quantity: str, axes: list[str], logs: set[str]) -> Markup:
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
        slack = part[part["slack_onset"].notna()]
        ax.scatter(slack[x], slack[y], s=30, facecolors="none", edgecolors="#d55e00", linewidths=0.7)
        ax.set_title(title, fontsize=8)
        ax.set(xlabel=_with_unit(x), xscale="log" if x in logs else "linear", yscale="log" if y in logs else "linear")
    grid[0][0].set_ylabel(name if y == quantity else _with_unit(y))
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


def _scenes(study: Study, file: Path, rows: Any) -> dict[str, Any]:
    """What explorer.js shows: lines of scenes across their axes, and a table with the command of each."""
    columns = [*study.axes, *DESIGN, "max_deflection", "path_error", "seconds"]
    columns = [c for c in dict.fromkeys([*columns, "status", "verdict", "method"]) if rows[c].notna().any()]
    logs = {name for name, a in study.axes.items() if a.log}
    told = [{"name": _with_unit(c), "log": c in logs, "values": _plain(rows[c])} for c in columns]
    return {"study": str(file), "index": rows.index.tolist(), "columns": told}


def _plain(values: Any) -> list[Any]:
    return [None if x is None or x != x else x if isinstance(x, str) else float(f"{x:.5g}") for x in values.tolist()]
