"""Pages of a sweep: what came out, maps of the design numbers, and every scene to filter."""

import json
import math
import re
import shlex
import textwrap
from collections.abc import Iterator
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from pandas import DataFrame, qcut

from cablefem.scene import Scene
from cablefem.scene.keys import list_keys
from validation.commands.sweep.engine import read_rows
from validation.commands.sweep.job import BROKEN, reason_on_one_line
from validation.commands.sweep.study import Study
from validation.core import store
from validation.core.quantities import KNOWN, TEXTS, factor_and_prefixed_unit, quantity_words, unit_of
from validation.page.answer.many import ENDS
from validation.page.figures import captioned_figure, figure_with_axes
from validation.page.page import Section, html_table, number_text, percent_text, render_sections
from validation.page.plot import COLORS

MAPS = (
    "clearance_rope_min", "clearance_car_min", "tension_max", "safety_factor_min", "speed_max", "mass_deepest",
    "contact_min", "haul_force_max", "max_deflection", "path_error",
)  # fmt: skip


def sections(folder: Path) -> list[Section]:
    file = folder / "study.toml"
    study = Study.load(file)
    rows = read_rows(folder)
    rows["end"] = _outcome_words_by_scene(rows)
    complete = rows["status"] == "complete"
    refused = rows["status"] == "refused"
    broken = rows["status"].isin(BROKEN)
    unfinished = rows[~complete]
    few = 5
    first = unfinished[unfinished["reason"].notna()].head(few)
    reasons = [{"scene": i, "reason": reason_on_one_line(x["status"], x["reason"])} for i, x in first.iterrows()]
    bars = error_bar_coverage_rows(rows) if rows["true_error"].notna().any() else []
    maps = list(_draw_maps(study, rows))
    shown = _thinned_rows(rows)
    data = json.dumps(_explorer_data(study, file, shown)).replace("<", "\\u003c")
    script = (resources.files(__package__) / "explorer.js").read_text(encoding="utf-8")
    return render_sections(
        __package__, study=study, rows=rows, complete=complete.sum(), refused=refused.sum(), broken=broken.sum(),
        unfinished=unfinished, reasons=reasons,
        judged=rows[rows["verdict"].notna()], counted=_count_table, bars=bars, maps=maps, shown=len(shown),
        data=Markup(data), script=Markup(script),
    )  # fmt: skip


def _outcome_words_by_scene(rows: DataFrame) -> Any:
    """What becomes of the car of each scene in words, and whether something is in its way; none of a scene without."""
    hits = rows["outcome"].astype(object).fillna("").str.contains("would hit ")
    return np.where(hits, "would hit; ", "") + rows["outcome_kind"].map(ENDS)


def _count_table(rows: DataFrame, by: list[str], caption: str) -> Markup:
    """Table of how often each combination of words occurs, most frequent first."""
    counts = rows.value_counts(by, dropna=False).reset_index(name="scenes")
    counts = counts.rename(columns={"verdict": "judged"})
    counts["part"] = [percent_text(n / len(rows), 3) for n in counts["scenes"]]
    records = counts.replace({np.nan: None}).to_dict("records")
    return html_table(records, list(counts.columns), caption=caption)


OF = {"path": ("path_error", "true_error", "doubt"), "tension": ("tension_error", "true_tension", "doubt_tension")}


def error_bar_coverage_rows(rows: DataFrame) -> list[dict[str, Any]]:
    """Table rows that say whether the bars hold, by method.

    Judged where the two finer runs differ by less than a third of the bar or of the error.
    """
    out = []
    for quantity, (bar, true, doubt) in OF.items():
        largest = rows[[bar, true]].max(axis=1)
        judged = rows[rows[doubt] <= largest / 3.0]  # no doubt, no row
        for name, part in [*judged.groupby("method"), ("all", judged)]:
            too_small = part[true] > part[bar]
            unflagged = part["flags"].isna()
            ratio = part[bar] / part[true]
            holds = f"{100.0 * (1.0 - too_small.sum() / len(part)):.1f} %" if len(part) else ""
            out.append({
                "bar of": quantity, "method": name, "held against": len(part), "bar holds": holds,
                "unflagged": int(unflagged.sum()), "too small and unflagged": int((too_small & unflagged).sum()),
                "bar over true, median": float(ratio.median()),
                "the same, unflagged": float(ratio[unflagged].median()),
            })  # fmt: skip
    return out


def _draw_maps(study: Study, rows: DataFrame) -> Iterator[Markup]:
    axes = [name for name, axis in study.axes.items() if axis.numeric and rows[name].nunique() > 1]
    if not axes:
        return
    log_axes = _logarithmic_axes(study)
    ended = rows[rows["end"].notna()]
    if len(ended):
        yield _draw_outcomes(_thinned_rows(ended), axes, log_axes)
    for quantity in MAPS:
        computed = _thinned_rows(rows[rows[quantity].notna()])
        if len(computed) > 2:
            yield _draw_map(computed, quantity, axes, log_axes)


def _logarithmic_axes(study: Study) -> set[str]:
    return {name for name, axis in study.axes.items() if axis.log}


def _draw_dots(ax: Any, rows: DataFrame, x: str, y: str, log_axes: set[str], **looks: Any) -> Any:
    """Draw a dot for each scene, a link to its row; x, y : columns."""
    dots = ax.scatter(rows[x], rows[y], s=14, linewidths=0, **looks)
    dots.set_urls([f"#scene-{i}" for i in rows.index])
    x_scale, y_scale = ("log" if name in log_axes else "linear" for name in (x, y))
    ax.set(xlabel=_label_with_unit(x), xscale=x_scale, yscale=y_scale)
    return dots


def _draw_outcomes(rows: DataFrame, axes: list[str], log_axes: set[str]) -> Markup:
    """Draw what becomes of the car over the first two axes, a colour for each kind."""
    x = axes[0]
    y = axes[1] if len(axes) > 1 else "speed_max"
    fig, ax = figure_with_axes()
    for i, end in enumerate(rows["end"].value_counts().index):
        part = rows[rows["end"] == end]
        marker = "o" if i < len(COLORS) else "s"
        _draw_dots(ax, part, x, y, log_axes, color=COLORS[i % len(COLORS)], marker=marker, label=end)
    ax.set_ylabel(_label_with_unit(y))
    ax.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return captioned_figure(fig, f"What becomes of the car over {x} and {y}")


@cache
def _unit_by_name() -> dict[str, str]:
    """Unit of each axis and each number."""
    out = {key.name: key.unit for key in list_keys(Scene)}
    groups = store.read_packaged_toml(__package__, "keys.toml")["groups"]
    return out | {name: unit for name, (unit, _) in groups.items()}


def _label_with_unit(name: str) -> str:
    """Name of a column with its unit, for an axis or the head of a table."""
    if name == "seconds":
        unit: str | None = "s"
    elif name.partition(":")[0] in KNOWN:
        unit = unit_of(name)
    else:
        unit = _unit_by_name().get(re.sub(r"\.\d+\.", ".0.", name))
    if unit is None:
        return name
    return f"{name} [–]" if unit in ("", "-") else f"{name} [{unit}]"


def _thinned_rows(rows: DataFrame) -> DataFrame:
    """Every n-th row, so that at most 4000 are in the page or dots in a map."""
    most = 4000
    return rows.iloc[:: max(1, -(-len(rows) // most))]


def _draw_map(rows: DataFrame, quantity: str, axes: list[str], log_axes: set[str]) -> Markup:
    """Draw a quantity over the first two axes, or over the only one; a third axis is cut into parts."""
    factor, unit = factor_and_prefixed_unit(rows[quantity].to_numpy(float), unit_of(quantity))
    rows = rows.assign(**{quantity: factor * rows[quantity]})
    words = quantity_words(f"{quantity}:obstacles and ground")  # the name of one, where it has one
    name = f"{words} [{unit or '–'}]"
    x, y = (*axes, quantity)[:2]
    parts = [("", rows)]
    split = ""
    if len(axes) > 2:
        parts = _split_by_axis(rows, axes[2])
        split = f", {axes[2]} from left to right"
    height = 2.9 if len(parts) == 1 else 2.6
    fig, grid = figure_with_axes(1, len(parts), height=height, sharey=True, squeeze=False)
    low, high = np.percentile(rows[quantity].to_numpy(float), [1, 99])
    for ax, (title, part) in zip(grid[0], parts, strict=True):
        dots = _draw_dots(ax, part, x, y, log_axes, c=part[quantity], vmin=low, vmax=high)
        slack = part[part["slack_onset"].notna()]
        ax.scatter(slack[x], slack[y], s=30, facecolors="none", edgecolors="#d55e00", linewidths=0.7)
        ax.set_title(title, fontsize=8)
    if len(parts) > 1:  # one for all: side by side they overlap
        for ax in grid[0]:
            ax.set_xlabel("")
        fig.supxlabel(_label_with_unit(x), fontsize="medium")
    grid[0][0].set_ylabel(name if y == quantity else _label_with_unit(y))
    # longer names would be cut off
    fig.colorbar(dots, ax=list(grid[0]), label=textwrap.fill(name, 24))
    return captioned_figure(fig, f"{words[0].upper()}{words[1:]} over {x} and {y}{split}")


def _split_by_axis(rows: DataFrame, axis: str) -> list[tuple[str, DataFrame]]:
    """Scenes by an axis: its values where they are few, else in equal shares."""
    parts = 3  # of a third axis
    if rows[axis].nunique() <= parts:
        return [(f"{axis} = {number_text(x)}", part) for x, part in rows.groupby(axis)]
    out = []
    for _, part in rows.groupby(qcut(rows[axis], parts, duplicates="drop"), observed=True):
        title = f"{number_text(part[axis].min())} to {number_text(part[axis].max())}"  # qcut's ends lie outside
        out.append((title, part))
    return out


def _explorer_data(study: Study, file: Path, rows: DataFrame) -> dict[str, Any]:
    """What explorer.js shows: curves of scenes across their axes, and a table with the command of each."""
    names = [
        *study.axes,
        "end",
        *TEXTS["main"],
        "tension_min",
        "contact_min",
        "slack_onset",
        "max_deflection",
        "path_error",
        "seconds",
        "status",
        "verdict",
        "not_agreed",
        "method",
    ]
    log_axes = _logarithmic_axes(study)
    columns = []
    for name in dict.fromkeys(names):
        if rows[name].notna().any():
            values = list(map(_rounded_json_value, rows[name].tolist()))
            columns.append({"name": _label_with_unit(name), "log": name in log_axes, "values": values})
    return {"study": shlex.quote(str(file)), "index": rows.index.tolist(), "columns": columns}


def _rounded_json_value(value: str | float | None) -> str | float | None:
    """A word as it is, a number to five digits, None for nan."""
    if isinstance(value, str):
        return value
    return None if value is None or math.isnan(value) else float(f"{value:.5g}")
