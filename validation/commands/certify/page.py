"""How deep a certificate goes, place by place, from stored results."""

from pathlib import Path

import numpy as np
from markupsafe import Markup

from validation.core import store
from validation.page.page import Section, number, table
from validation.page.plot import BLUE, DASHED, DOTTED, GREEN, GREY, VERMILLION, Panel, plot

LOOK = ((VERMILLION, DASHED), (GREEN, DOTTED))


def sections(folder: Path) -> list[Section]:
    x = store.read(folder / "certify.json")
    s_o, answer = np.array(x["table"]["s_o"]), x["ways"][0]["name"]
    p = Panel("over the scale [–]", height=240.0)
    p.line(np.array([0.0, 1.0]), np.full(2, x["tol"]), GREY, "", 1.0, "asked for")
    bar = np.array(x["table"]["bar"], dtype=float)
    p.line(s_o, bar, BLUE, name=f"bar of the table ({answer})")
    drawn = [bar]
    for way, gap, look in zip(x["ways"][1:], x["table"]["gaps"], LOOK, strict=True):
        drawn.append(np.array(gap, dtype=float))
        p.line(s_o, drawn[-1], *look, 1.4, name=f"{way['name']} from it")
    seen = np.concatenate(drawn)
    seen = seen[np.isfinite(seen) & (seen > 0.0)]
    p.log, p.low, p.high = True, 10.0 ** np.floor(np.log10(seen.min())), 2.0 * max(seen.max(), x["tol"])
    figure = plot(
        [p], (0.0, 1.0), "place of the mass sₒ/l [–]",
        f"Over {number(x['scale'], 5)} m, the largest deflection.", wide=True,
    )  # fmt: skip
    columns = {
        "name": "way", "finest": "finest run", "space": "left by space", "time": "left by time",
        "to": f"within {x['tol']:g} to", "end": "ends",
    }  # fmt: skip
    ways = [w | {"finest": ", ".join(f"{k} {v}" for k, v in w["settings"].items() if k != "scheme")} for w in x["ways"]]
    verdicts = [
        {"what": " ".join(row[y] for y in ("quantity", "law", "with") if y in row), **row,
         "because": row["allowed_because"]}
        for row in x["rows"]
    ]  # fmt: skip
    heads = {"what": "held against the table", "gap": "gap", "allowed": "allowed", "where": "at sₒ/l",
             "verdict": "verdict", "because": "because"}  # fmt: skip
    body = figure + table(ways, columns, stack=True) + table(verdicts, heads, sort=True, stack=True)
    summary = f"mass path within {x['tol']:g} to s_o/l = {x['to']:.2f}; {x['ways'][0]['end']}"
    return [Section("certify-path", "Certified path of the mass", Markup(body), x["verdict"], summary)]
