"""The page of `cablefem advise`: what each need takes, the paths by all models, and the methods tried."""

from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from validation.core import store
from validation.page.page import Section, render_sections
from validation.page.plot import BLACK, DASHED, GREEN, ORANGE, SKY, Panel, svg_figure

# one colour per cable, dashes for a force
COLOURS = {"string": ORANGE, "sagged": SKY, "stretching": GREEN}


def sections(folder: Path) -> list[Section]:
    x = store.read_json(folder / "advice.json")
    if "bodies" in x:
        return render_sections(__package__, "lines.html", x=x)
    rungs = [r for r in x["rungs"] if "v" in r]
    drawing = _plot_paths(x, rungs) if len(rungs) > 1 else ""
    return render_sections(__package__, x=x, drawing=drawing)


def _plot_paths(x: dict[str, Any], rungs: list[dict[str, Any]]) -> Markup:
    position = np.array(x["place"])
    end = x["range"][1]
    paths = [np.array(rung["v"], dtype=float) for rung in rungs]
    full = paths[-1][position <= end + 1e-9]
    size = np.nanmax(np.abs(full))
    p = Panel("deflection, down [–]", "Path of the mass", height=240.0, down=True)
    for rung, v in zip(rungs, paths, strict=True):
        dash = DASHED if rung["load"] == "force" else ""
        colour = COLOURS.get(rung["model"], BLACK)
        p.add_curve(position, v / size, colour, dash, 2.0, rung["name"])
    p.fit_y_axis([np.clip(v / size, -3.0, 5.0) for v in paths])
    caption = "Deflection from the static cable by each model, over the largest one of the full model."
    return svg_figure([p], (0.0, end), "place of the mass sₒ/l [–]", caption, wide=True)
