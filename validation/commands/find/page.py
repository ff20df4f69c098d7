"""The answer to an inverse question: what was tried, or the curve over another key."""

from pathlib import Path

import numpy as np

from validation.core import store
from validation.page.page import Section, drawn
from validation.page.plot import BLUE, Panel, plot


def sections(folder: Path) -> list[Section]:
    found = store.read(folder / "find.json")
    rows = found.get("rows", [])
    figure = ""
    points = [list(row.values())[:2] for row in rows if list(row.values())[1] is not None]
    if len(points) > 1:
        x, y = np.array(points, float).T
        other, key, _ = rows[0]
        p = Panel(key, "", 220.0)
        p.curve(x, y, BLUE, "", 1.8)
        p.fit([y])
        figure = plot([p], (float(x.min()), float(x.max())), other, f"{key} over {other}.")
    return drawn(__package__, found=found, rows=rows, figure=figure)
