"""The answer to an inverse question: what was tried, or the curve over another key."""

from pathlib import Path

import numpy as np

from validation.core import store
from validation.page.page import Section, render_sections
from validation.page.plot import BLUE, Panel, svg_figure


def sections(folder: Path) -> list[Section]:
    stored = store.read_json(folder / "find.json")
    rows = stored.get("rows", [])
    figure = ""
    points = [(row["at"], row["value"]) for row in rows if row["value"] is not None]
    if len(points) > 1:
        x, y = np.array(points, float).T
        p = Panel(stored["key"], "", 220.0)
        p.add_curve(x, y, BLUE, "", 1.8)
        p.fit_y_axis([y])
        figure = svg_figure(
            [p], (float(x.min()), float(x.max())), stored["for"], f"{stored['key']} over {stored['for']}."
        )
    for row in stored.get("evaluations", []):
        row["said"] = "; ".join(_observed_text(x) for of_scene in row["read"] for x in of_scene)
    return render_sections(__package__, found=stored, rows=rows, figure=figure)


def _observed_text(value: float | str | None) -> str:
    """A number or a word that a condition looks at."""
    return f"{value:.6g}" if isinstance(value, float) else value or "–"
