"""How deep a certificate goes, place by place."""

from pathlib import Path

import numpy as np

from validation.core import store
from validation.page.page import Section, drawn, number
from validation.page.plot import BLUE, DASHED, DOTTED, GREEN, GREY, VERMILLION, Panel, plot

LOOK = ((VERMILLION, DASHED), (GREEN, DOTTED))


def sections(folder: Path) -> list[Section]:
    x = store.read(folder / "certify.json")
    s_o, answer = np.array(x["table"]["s_o"]), x["ways"][0]["name"]
    p = Panel("over the scale [–]", height=240.0)
    p.line(np.array([0.0, 1.0]), np.full(2, x["tol"]), GREY, "", 1.0, "asked for")
    p.line(s_o, np.array(x["table"]["bar"], dtype=float), BLUE, name=f"bar of the table ({answer})")
    for way, gap, look in zip(x["ways"][1:], x["table"]["gaps"], LOOK, strict=True):
        p.line(s_o, np.array(gap, dtype=float), *look, 1.4, name=f"{way['name']} from it")
    seen = np.concatenate([line[1] for line in p.lines])
    seen = seen[np.isfinite(seen) & (seen > 0.0)]
    p.log, p.low, p.high = True, 10.0 ** np.floor(np.log10(seen.min())), 2.0 * seen.max()
    caption = f"Over {number(x['scale'], 5)} m, the largest deflection."
    drawing = plot([p], (0.0, 1.0), "place of the mass sₒ/l [–]", caption, wide=True)
    return drawn(__package__, x=x, drawing=drawing)
