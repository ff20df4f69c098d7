"""The answer to an inverse question: what was tried, or the curve over another key."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from validation.commands.find.condition import Row
from validation.core import store
from validation.page.page import Section, render_sections
from validation.page.plot import BLACK, BLUE, Panel, svg_figure


def sections(folder: Path) -> list[Section]:
    stored = store.read_json(folder / "find.json")
    rows = stored.get("rows", [])
    for row in stored.get("evaluations", []):
        row["said"] = "; ".join(_observed_text(x) for of_scene in row["read"] for x in of_scene)
    heads = []
    figure: Markup | str = ""
    if rows:
        pairs = (stored["for"], stored["for_unit"]), (stored["key"], stored["unit"])
        heads = [f"{name} [{unit}]".removesuffix(" []") for name, unit in pairs]
        figure = _curve_figure(rows, *heads)
    return render_sections(__package__, found=stored, rows=rows, heads=heads, figure=figure)


def _curve_figure(rows: Sequence[Row], other: str, key: str) -> Markup | str:
    """Values of a key over those of another one, with their bars; "" of fewer than two, and over words.

    other, key : with their units.
    """
    shown = [row for row in rows if row["value"] is not None]
    if len(shown) < 2 or not all(isinstance(row["at"], int | float) for row in shown):
        return ""
    x = np.array([row["at"] for row in shown], float)
    y = np.array([row["value"] for row in shown], float)
    bar = np.array([row["bar"] for row in shown], float)  # nan for None
    p = Panel("", key, 220.0)
    p.add_curve(x, y, BLUE, "", 1.8)
    for at, value, half in zip(x.tolist(), y.tolist(), bar.tolist(), strict=True):
        known = math.isfinite(half)
        if known:
            ends = np.array([value - half, value + half])
            p.add_curve(np.array([at, at]), ends, BLACK, "", 1.4)
        p.dots.append((at, value, BLUE, known))
    p.fit_y_axis([y, y - bar, y + bar])
    caption = f"{key} over {other}, with error bars of the model of the search."
    if np.isnan(bar).any():
        caption += " Circles: the bar is unknown, or of no use."
    low = float(x.min())
    high = float(x.max())
    margin = 0.03 * (high - low)
    return svg_figure([p], (low - margin, high + margin), other, caption)


def _observed_text(value: float | str | None) -> str:
    """A number or a word that a condition looks at."""
    return f"{value:.6g}" if isinstance(value, float) else value or "–"
