"""A line at rest, on the terminal and on its page."""

import csv
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array
from validation.core import store
from validation.core.quantities import scale_of
from validation.page import terminal
from validation.page.answer.many import Column, Columns, Row, label, table_of
from validation.page.page import VERDICTS, Section, asset, drawn
from validation.page.plot import BLACK, BLUE, COLORS, DASHED, DOTTED, GREY, Panel, plot, side

SAID = tomllib.loads(asset("line.toml"))
WORDS: dict[str, dict[str, str]] = SAID["quantity"]
RECHECKED = ("laws_si", "printed")  # rows from the TOML alone
GRID = ("tension_max", "safety_factor", "load", "haul", "rise", "clearance_rope", "clearance_car")


def kind_of(name: str) -> str:
    """The quantity in a name, without extreme and contact."""
    kind, _, of = name.partition(":")
    return kind if kind in WORDS and not of else kind.removesuffix("_max").removesuffix("_min")


def named(name: str) -> str:
    return WORDS[kind_of(name)]["words"].format(name.partition(":")[2])


def value_of(value: float, unit: str) -> str:
    """A value with its unit, to a millimetre or a newton."""
    factor, words = (1.0, unit) if unit == "m" else scale_of(np.array([value]), unit)
    words = {"deg": "°", "": ""}.get(words, f" {words}")
    return f"{round(factor * value, 3) + 0.0:.3f}{words}"  # no -0.000


def pairs(design: Sequence[Row]) -> list[Row]:
    """One row per quantity: largest and smallest value, and the cars' positions then."""
    out: dict[str, Row] = {}
    for d in sorted(design, key=lambda d: list(WORDS).index(kind_of(d["quantity"]))):
        words = named(d["quantity"])
        row = out.setdefault(words, {"quantity": words, "largest": "", "smallest": ""})
        cars = ", ".join(f"{name} {x:.0f}" for name, x in d["at"].items())
        is_smallest = d["quantity"].partition(":")[0].endswith("_min")
        value = value_of(d["value"], d["unit"])
        row["smallest" if is_smallest else "largest"] = f"{value} ({cars})" if cars else value
        if is_smallest and row["largest"].partition(" (")[0] == value:
            row["largest"] = value
            row["smallest"] = "the same"
    return list(out.values())


def tell(line: Any, outcome: str, design: Sequence[Row], refused: Sequence[Row], most: int = 14) -> None:
    terminal.say(f"{line.name}: {outcome}", style="bold")
    few = ("tension", "tension_behind", "tension_ahead", "pressure", "pressure_down", "load")
    first = pairs([d for d in design if kind_of(d["quantity"]) not in few])
    terminal.table(["quantity", "largest (cars at x [m])", "smallest"], [list(x.values()) for x in first[:most]])
    if len(first) > most:
        terminal.say(f"  {len(first) - most} more in the report")
    for x in refused[:3]:
        terminal.say(f"  position {x['position']}: {x['reason']}", style="bold red")
    if len(refused) > 3:
        terminal.say(f"  and {len(refused) - 3} more positions without rest", style="bold red")


def columns(rows: Sequence[Row], keys: Sequence[str]) -> Columns:
    names = dict.fromkeys(name for x in rows for name in x if kind_of(name) in GRID and name not in keys)
    words = ("outcome", "status", "verdict", "why")
    last = [name for name in words if any(x.get(name) not in (None, "complete") for x in rows)]
    heads = {key: key for key in keys} | {n: _head(n) for n in names} | {name: name for name in last}
    return {name: Column(head, digits=6) for name, head in heads.items()}


def _head(name: str) -> str:
    unit = WORDS[kind_of(name)]["unit"]
    smallest = name.partition(":")[0].endswith("_min")
    which = "smallest " if smallest else "largest "
    if kind_of(name) in ("tension_max", "safety_factor"):
        which = ""
    return which + named(name) + (f" [{unit}]" if unit else "")


def sections(folder: Path, rows: Sequence[Row] = (), verdict: str | None = None) -> list[Section]:
    """Pages of the line in a folder; rows and verdict of a check."""
    summary, ropes = (store.read(folder / f"{name}.json") for name in ("summary", "ropes"))
    line = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    with (folder / "positions.csv").open(encoding="utf-8", newline="") as file:
        positions = list(csv.DictReader(file))
    over = list(_over(line["car"][0]["name"], positions)) if summary["positions"] > 1 else []
    kind = {"breaks": "disagree", "collides": "disagree"}.get(summary["outcome_kind"])
    return drawn(
        "validation.page", "assets/line.html", id=folder.name, verdict=verdict, refused=summary["refused"],
        outcome=summary["outcome"], alarm=kind, side=_side(line, ropes, positions), design=pairs(summary["design"]),
        over=over, compared=[x for x in rows if x["quantity"] not in RECHECKED],
        rechecked=[x for x in rows if x["quantity"] in RECHECKED],
    )  # fmt: skip


def _floats(positions: Sequence[Row], name: str) -> Array:
    return np.array([float(x[name]) if x.get(name) else np.nan for x in positions])


def _side(line: Row, ropes: Row, positions: Sequence[Row]) -> Markup:
    told = {name: np.array(values) for name, values in ropes["profile"].items()}
    x = told["x"]
    end = float(told["x"][-1])
    ground = np.array(line.get("ground", [])).reshape(-1, 2)
    obstacles = line.get("obstacle", [])
    p = Panel("depth [m]", "", down=True)
    cars = [
        (car, _floats(positions, f"x:{car['name']}"), _floats(positions, f"depth:{car['name']}"))
        for car in line.get("car", [])
    ]
    depths = [told["y_highest"], told["y_lowest"], ground[:, 1], np.array([o["top"] for o in obstacles])]
    p.fit([*depths, *(y + car.get("below", 0.0) for car, _, y in cars)], pad=0.14)
    caption = side(p, 1.12 * end, ground, [(o["name"], o["at"], o["top"]) for o in obstacles])
    p.bands.append((x, told["y_highest"], told["y_lowest"], "#0072b233"))
    p.line(x, told["y_rest"], GREY, DOTTED, 1.4, "empty rope")
    for depth in ropes["depths"].values():
        p.line(x, np.array(depth), BLUE, "", 1.0, "rope at some positions; shaded: at all")
    for (car, at, y), color in zip(cars, COLORS[1:] * len(cars), strict=False):
        p.line(at, y + car.get("below", 0.0), color, DASHED, 1.8, f"lowest point of {car['name']}")
        if at.size == 1:
            p.dots.append((float(at[0]), float(y[0]), color, True))
    for c in line["contact"]:
        p.dots.append((c["at"][0], c["at"][1], BLACK, c["kind"] in ("anchor", "saddle")))
        away = -1.0 if c["at"][0] > 0.9 * end else 1.0 if c["at"][0] < 0.1 * end else 0.0
        p.labels.append((c["at"][0] + away * 0.04 * end, c["at"][1] - 0.05 * (p.high - p.low), c["name"]))
    return plot([p], (-0.06 * end, 1.06 * end), "x [m]", caption, wide=True)


def _over(car: str, positions: Sequence[Row]) -> Iterator[Markup]:
    """One figure per kind of quantity, over the place of the first car."""
    at = _floats(positions, f"x:{car}")
    reach = float(np.nanmin(at)), float(np.nanmax(at))
    for title, kinds in SAID["over"].items():
        values = {name: _floats(positions, name) for name in positions[0] if name.partition(":")[0] in kinds}
        if not values:
            continue
        factor, unit = scale_of(np.concatenate(list(values.values())), WORDS[kinds[0]]["unit"])
        p = Panel(f"[{unit}]" if unit else "", "", 140.0)
        p.fit([factor * v for v in values.values()])
        for (name, v), color in zip(values.items(), COLORS * len(values), strict=False):
            p.line(at, factor * v, color, "", 1.8, named(name))
        yield plot([p], reach, f"x of {car} [m]", title)


def _lowest(rows: Sequence[Row], paths: Sequence[Any], keys: Sequence[str]) -> Markup:
    drawn = [(np.array(path), x) for path, x in zip(paths, rows, strict=True) if path]
    p = Panel("depth [m]", "", 180.0, down=True)
    p.fit([depth for (_, depth), _ in drawn], pad=0.05)
    for ((at, depth), x), color in zip(drawn, COLORS * len(drawn), strict=False):
        p.line(at, depth, color, "", 1.4, label(x, keys))
    end = float(drawn[0][0][0, -1])
    return plot([p], (0.0, end), "x [m]", "The lowest place of the rope over all positions.", wide=True)


def grid(folder: Path) -> list[Section]:
    stored = store.read(folder / "grid.json")
    rows = stored["rows"]
    keys = stored["keys"]
    html = [table_of(rows, columns(rows, keys), keys[0])]
    if any(stored["paths"]):
        html.append(_lowest(rows, stored["paths"], keys))
    text = f"{len(rows)} lines, {sum(x['status'] != 'complete' for x in rows)} incomplete."
    worst = next((v for v in VERDICTS if any(x.get("verdict") == v for x in rows)), None)
    return [Section(folder.name, "All of them", Markup("\n").join(html), worst, text)]
