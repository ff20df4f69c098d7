"""A line at rest, on the terminal and on its page."""

import csv
import tomllib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array
from cablefem.scene.line import Line
from validation.core import store
from validation.core.limits import scopes
from validation.core.quantities import limit_text, scale_of
from validation.page import telling, terminal
from validation.page.answer.many import LIMITS, Column, Columns, Row, label, table_of
from validation.page.page import Section, asset, drawn, limits_of, worst
from validation.page.plot import BLACK, BLUE, COLORS, DASHED, DOTTED, GREY, Panel, draw_surroundings, plot

_TEXT = tomllib.loads(asset("line.toml"))
WORDS: dict[str, dict[str, str]] = _TEXT["quantity"]
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
    factor = 1.0
    if unit != "m":
        factor, unit = scale_of(np.array([value]), unit)
    suffix = {"deg": "°", "": ""}.get(unit, f" {unit}")
    return f"{round(factor * value, 3) + 0.0:.3f}{suffix}"  # no -0.000


def pairs(design: Sequence[Row]) -> list[Row]:
    """One row per quantity: largest and smallest value, and the cars' positions then."""
    out: dict[str, Row] = {}
    order = list(WORDS)
    for d in sorted(design, key=lambda d: order.index(kind_of(d["quantity"]))):
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


def tell(line: Any, outcome: str, limits: Sequence[Row], printed: Sequence[Row], count: int) -> None:
    """Print outcome, limits, and the first 14 rows of design numbers, of `count` in the report."""
    terminal.say(f"{line.name}: {outcome}", style="bold")
    telling.limits(line, limits)
    rows = printed[:14]
    heads = {"largest": "largest (cars at x [m])", "words": "quantity", "t": "at"}
    terminal.table([heads.get(name, name) for name in printed[0]], [list(row.values()) for row in rows])
    if count > len(rows):
        terminal.say(f"  {count - len(rows)} more in the report")


def columns(rows: Sequence[Row], keys: Sequence[str]) -> Columns:
    """Columns of a table of lines: varied values, design numbers of GRID, what became of each line."""
    names = dict.fromkeys(name for row in rows for name in row if kind_of(name) in GRID)
    return with_ends(rows, keys, {name: _head(name) for name in names})


def with_ends(rows: Sequence[Row], keys: Sequence[str], numbers: dict[str, str]) -> Columns:
    """Columns of a table: varied values, numbers with their heads, and what became of each line if it says more."""
    heads = {key: key for key in keys} | numbers
    for name in ("outcome", "status", *LIMITS, "verdict", "why"):
        if {row.get(name) for row in rows} - {None, "complete"}:
            heads[name] = name
    return {name: Column(head, digits=6) for name, head in heads.items()}


def _head(name: str) -> str:
    kind = kind_of(name)
    unit = WORDS[kind]["unit"]
    which = "smallest " if name.partition(":")[0].endswith("_min") else "largest "
    if kind in ("tension_max", "safety_factor"):
        which = ""
    return f"{which}{named(name)} [{unit}]" if unit else which + named(name)


def sections(folder: Path, rows: Sequence[Row] = (), verdict: str | None = None) -> list[Section]:
    """Pages of the line in a folder; rows and verdict of a check."""
    summary = store.read(folder / "summary.json")
    ropes = store.read(folder / "ropes.json")
    line = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    with (folder / "positions.csv").open(encoding="utf-8", newline="") as file:
        positions = list(csv.DictReader(file))
    over = list(_over(line["car"][0]["name"], positions)) if summary["positions"] > 1 else []
    alarm = "disagree" if summary["outcome_kind"] in ("breaks", "collides") else None
    return drawn(
        __package__,
        "assets/line.html",
        id=folder.name,
        verdict=verdict,
        refused=summary["refused"],
        outcome=summary["outcome"],
        limits=limits_from(folder, summary),
        alarm=alarm,
        side=_side(line, ropes, positions),
        design=pairs(summary["design"]),
        over=over,
        compared=[x for x in rows if x["quantity"] not in RECHECKED],
        rechecked=[x for x in rows if x["quantity"] in RECHECKED],
    )


def limits_from(folder: Path, summary: Row) -> Markup:
    """Stored verdicts on limits, and what their texts are for."""
    line = Line.from_toml((folder / "scene.toml").read_text(encoding="utf-8"))
    return limits_of(list(map(limit_text, summary["limits"])), scopes(line))


def _floats(positions: Sequence[Row], name: str) -> Array:
    return np.array([float(x[name]) if x.get(name) else np.nan for x in positions])


def _surroundings(line: Row, profile: dict[str, Array], lowest: Sequence[Array]) -> tuple[Panel, str]:
    """The side view of a line without its cars, and its caption.

    profile : columns of profile.csv;  lowest : depths of the cars' lowest points [m], to fit.
    """
    x = profile["x"]
    highest_of_rope = profile["y_highest"]
    lowest_of_rope = profile["y_lowest"]
    ground = np.array(line.get("ground", [])).reshape(-1, 2)
    obstacles = [(o["name"], o["at"], o["top"]) for o in line.get("obstacle", [])]
    tops = np.array([top for _, _, top in obstacles])
    p = Panel("depth [m]", "", down=True)
    p.fit([highest_of_rope, lowest_of_rope, ground[:, 1], tops, *lowest], pad=0.14)
    end = float(x[-1])
    caption = draw_surroundings(p, 1.12 * end, ground, obstacles)
    p.bands.append((x, highest_of_rope, lowest_of_rope, "#0072b233"))
    p.curve(x, profile["y_rest"], GREY, DOTTED, 1.4, "empty rope")
    for contact in line["contact"]:
        at, depth = contact["at"]
        p.dots.append((at, depth, BLACK, contact["kind"] in ("anchor", "saddle")))
        if "shoe" in contact:
            p.curve(at + contact["shoe"] * np.array([-1.0, 1.0]), np.array([depth, depth]), BLACK, "", 3.0)
        inwards = float(at < 0.1 * end) - float(at > 0.9 * end)
        p.labels.append((at + inwards * 0.04 * end, depth - 0.05 * (p.high - p.low), contact["name"]))
    return p, caption


def figure(values: dict[str, Array], unit: str, x: Array, xlabel: str, title: str) -> Markup:
    """Series by name, (n,) in SI, over a common axis x (n,)."""
    factor, prefixed = scale_of(np.concatenate(list(values.values())), unit)
    p = Panel(f"[{prefixed}]" if prefixed else "", "", 140.0)
    p.fit([factor * v for v in values.values()])
    for i, (name, v) in enumerate(values.items()):
        dash = ("", DASHED)[i // len(COLORS) % 2]
        p.curve(x, factor * v, COLORS[i % len(COLORS)], dash, 1.7, name)
    return plot([p], (float(np.nanmin(x)), float(np.nanmax(x))), xlabel, title)


def _side(line: Row, ropes: Row, positions: Sequence[Row]) -> Markup:
    """Rope at rest and at all positions, cars, supports, ground and obstacles from the side."""
    profile = {name: np.array(values) for name, values in ropes["profile"].items()}
    cars = [_Car(car, positions) for car in line.get("car", [])]
    p, caption = _surroundings(line, profile, [car.lowest for car in cars])
    for depth in ropes["depths"].values():
        p.curve(profile["x"], np.array(depth), BLUE, "", 1.0, "rope at some positions; shaded: at all")
    for car, color in zip(cars, COLORS[1:] * len(cars), strict=False):
        p.curve(car.x, car.lowest, color, DASHED, 1.8, f"lowest point of {car.name}")
        if car.x.size == 1:
            p.dots.append((float(car.x[0]), float(car.depth[0]), color, True))
    end = line["contact"][-1]["at"][0]
    return plot([p], (-0.06 * end, 1.06 * end), "x [m]", caption, wide=True)


class _Car:
    """A car at all positions: x, depth on the rope and depth of its lowest point, (positions,) [m]."""

    def __init__(self, car: Row, positions: Sequence[Row]) -> None:
        self.name = car["name"]
        self.x = _floats(positions, f"x:{self.name}")
        self.depth = _floats(positions, f"depth:{self.name}")
        self.lowest = self.depth + car.get("below", 0.0)


def _over(car: str, positions: Sequence[Row]) -> Iterator[Markup]:
    """One figure per kind of quantity, over the position of the first car."""
    at = _floats(positions, f"x:{car}")
    for title, kinds in _TEXT["over"].items():
        names = [name for name in positions[0] if name.partition(":")[0] in kinds]
        if names:
            values = {named(name): _floats(positions, name) for name in names}
            yield figure(values, WORDS[kinds[0]]["unit"], at, f"x of {car} [m]", title)


def _lowest_point_plot(rows: Sequence[Row], paths: Sequence[Any], keys: Sequence[str]) -> Markup:
    p = Panel("depth [m]", "", 180.0, down=True)
    for path, row, color in zip(paths, rows, COLORS * len(rows), strict=False):
        if path:
            x, depth = np.array(path)
            p.curve(x, depth, color, "", 1.4, label(row, keys))
    p.fit([curve.y for curve in p.curves], pad=0.05)
    end = float(p.curves[0].x[-1])
    return plot([p], (0.0, end), "x [m]", "The lowest point of the rope over all positions.", wide=True)


def grid(folder: Path, columns: Callable[[Sequence[Row], Sequence[str]], Columns] = columns) -> list[Section]:
    """The page of a grid of lines in a folder."""
    stored = store.read(folder / "grid.json")
    rows = stored["rows"]
    keys = stored["keys"]
    html = [table_of(rows, columns(rows, keys), keys[0])]
    if any(stored["paths"]):
        html.append(_lowest_point_plot(rows, stored["paths"], keys))
    text = f"{len(rows)} lines, {sum(x['status'] != 'complete' for x in rows)} incomplete."
    return [Section(folder.name, "All of them", Markup("\n").join(html), worst(rows), text)]
