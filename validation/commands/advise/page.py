"""The page of `cablefem advise`: what each need takes, the paths by all models, and the methods tried."""

from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from validation.core import store
from validation.page.page import Section, details, percent, table
from validation.page.plot import BLACK, DASHED, GREEN, ORANGE, SKY, Panel, plot

# one colour per cable, dashes for a force
COLOURS = {"string": ORANGE, "sagged": SKY, "stretching": GREEN}
MODELS = """string: taut string, constant tension; sagged: linear sagging cable, one tension for the whole cable;
stretching: sagging cable with finite slopes, one tension for the whole cable; full: both displacements, tension varies
along the cable. A force is the weight of the mass without its inertia. The full model stands at its own error bar."""


def sections(folder: Path) -> list[Section]:
    x = store.read(folder / "advice.json")
    least = "; ".join(f"{need}, {name}" for need, name in x["least"].items())
    how = "" if x["method"] is None else f"; cheapest run: {x['method']} with {_settings(x)} ({x['seconds']:.2g} s)"
    said = f"Least model within {percent(x['tol'])}: {least}{how}."
    heads = {"name": "model", **{need: f"{need} off by" for need in x["least"]}, "seconds": "time [s]"}
    needs = Markup("<ul>{}</ul>").format(Markup().join(Markup("<li>{}</li>").format(_signs(w)) for w in x["words"]))
    drawn = [r for r in x["rungs"] if "v" in r]
    body = needs + table(map(_row, x["rungs"]), heads) + (_paths(x, drawn) if len(drawn) > 1 else "")
    if x["drive"] == "grip":
        body += details("The models", Markup("<p>{}</p>").format(MODELS))
    out = [Section("advise", "Least model", body, "agree" if x["meets"] else "not comparable", said)]
    if len(x["candidates"]) > 1:
        heads = {"method": "method", "settings": "settings"} | heads | {"meets": "meets the tolerance"}
        rows = sorted(map(_row, x["candidates"]), key=lambda row: row["seconds"])
        told = f"{len(rows)} runs of {x['name']}; the cheapest one that meets the tolerance is advised."
        out.append(Section("advise-methods", "Method, resolution and step", table(rows, heads, stack=True), None, told))
    return out


def _row(rung: dict[str, Any]) -> dict[str, Any]:
    return rung | {need: percent(gap) for need, gap in rung["gaps"].items()} | {"settings": _settings(rung)}


def _settings(rung: dict[str, Any]) -> str:
    return ", ".join(f"{value} {key}" for key, value in rung["settings"].items())


def _signs(words: str) -> Markup:
    return escape(words.replace("s_o/l", "sₒ/l"))


def _paths(x: dict[str, Any], rungs: list[dict[str, Any]]) -> Markup:
    place, paths = np.array(x["place"]), [np.array(rung["v"], dtype=float) for rung in rungs]
    size = np.nanmax(np.abs(paths[-1][place <= x["range"][1] + 1e-9]))
    p = Panel("deflection, down [–]", "Path of the mass", height=240.0, down=True)
    for rung, v in zip(rungs, paths, strict=True):
        dash = DASHED if rung["load"] == "force" else ""
        p.line(place, v / size, COLOURS.get(rung["model"], BLACK), dash, 2.0, rung["name"])
    p.fit([np.clip(v / size, -3.0, 5.0) for v in paths])
    caption = "Deflection from the static cable by each model, over the largest one of the full model."
    return plot([p], (0.0, x["range"][1]), "place of the mass sₒ/l [–]", caption, wide=True)
