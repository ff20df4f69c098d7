"""A line in motion, on the terminal and on its page."""

import csv
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array
from validation.core import store
from validation.core.quantities import scale_of, with_bar
from validation.page import telling, terminal
from validation.page.answer.many import LIMITS, Column, Columns, Row, table_of
from validation.page.line import limits_from
from validation.page.page import VERDICTS, Section, asset, drawn
from validation.page.plot import BLACK, BLUE, COLORS, DASHED, DOTTED, GREY, Panel, plot, side

WORDS: dict[str, dict[str, str]] = tomllib.loads(asset("motion.toml"))
FEW = (
    "tension_max",
    "clearance_rope",
    "clearance_car",
    "haul_max",
    "contact_min",
    "load_max",
    "rise_max",
    "speed_max",
)  # in a table


def unit_of(quantity: str) -> str:
    return WORDS[quantity.partition(":")[0]]["unit"]


def named(quantity: str) -> str:
    kind, _, of = quantity.partition(":")
    return WORDS[kind]["words"].format(of)


def value_of(number: Row) -> str:
    factor, unit = scale_of(np.array([number["value"], number["bar"] or 0.0]), number["unit"])
    bar = None if number["bar"] is None else factor * number["bar"]
    text = f"{with_bar(factor * number['value'], bar)} {unit}".rstrip()
    return f"{text} = {3.6 * number['value']:.4g} km/h" if number["unit"] == "m/s" else text


def rows_of(design: Sequence[Row]) -> list[Row]:
    """Words, value and time of each number, in the order of WORDS."""
    order = list(WORDS)
    ordered = sorted(design, key=lambda d: order.index(d["quantity"].partition(":")[0]))
    return [{"words": named(d["quantity"]), "value": value_of(d), "t": f"{d['t']:.4g} s"} for d in ordered]


def tell(line: Any, outcome: str, design: Sequence[Row], limits: Sequence[Row] = (), most: int = 14) -> None:
    terminal.say(f"{line.name}: {outcome}", style="bold")
    telling.limits(line, limits)
    rows = rows_of([d for d in design if d["quantity"].partition(":")[0] in FEW])
    terminal.table(["quantity", "value", "at"], [list(row.values()) for row in rows[:most]])
    if len(design) > len(rows[:most]):
        terminal.say(f"  {len(design) - len(rows[:most])} more in the report")


def columns(rows: Sequence[Row], keys: Sequence[str]) -> Columns:
    names = dict.fromkeys(name for row in rows for name in row if name.partition(":")[0] in FEW)
    words = ("outcome", "status", *LIMITS, "verdict")
    heads = {key: key for key in keys} | {name: f"{named(name)} [{unit_of(name)}]" for name in names}
    heads |= {name: name for name in words if any(name in row for row in rows)}
    return {name: Column(head, digits=6) for name, head in heads.items()}


def sections(folder: Path, rows: Sequence[Row] = (), verdict: str | None = None) -> list[Section]:
    """Pages of the line in a folder; rows and verdict of a check."""
    summary = store.read(folder / "summary.json")
    line = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    contacts = _columns(folder / "contacts.csv")
    paths = {car["name"]: _columns(folder / f"path-{car['name']}.csv") for car in line["car"]}
    compared = [row | {"named": f"{row['quantity']} {row.get('law', '')}".replace("_", " ")} for row in rows]
    laws = [row for row in compared if row["quantity"] in ("laws_si", "energy")]
    alarm = {"breaks": "disagree", "collides": "disagree", "incomplete": "disagree"}.get(summary["outcome_kind"])
    return drawn(
        "validation.page", "assets/motion.html", id=folder.name, verdict=verdict, outcome=summary["outcome"],
        limits=limits_from(folder, summary), alarm=alarm, side=_side(line, _columns(folder / "profile.csv"), paths),
        design=rows_of(summary["design"]),
        over=list(_over(line, contacts, paths)), round_trip=f"{summary['round_trip']:.2g} s",
        compared=[row for row in compared if row not in laws], laws=laws,
    )  # fmt: skip


def _columns(file: Path) -> dict[str, Array]:
    with file.open(encoding="utf-8", newline="") as opened:
        rows = list(csv.DictReader(opened))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def _side(line: Row, profile: dict[str, Array], paths: dict[str, dict[str, Array]]) -> Markup:
    x = profile["x"]
    end = float(x[-1])
    ground = np.array(line.get("ground", [])).reshape(-1, 2)
    obstacles = line.get("obstacle", [])
    p = Panel("depth [m]", "", down=True)
    below = {car["name"]: car.get("below", 0.0) for car in line["car"]}
    depths = [profile["y_highest"], profile["y_lowest"], ground[:, 1], np.array([o["top"] for o in obstacles])]
    p.fit([*depths, *(path["y"] + below[name] for name, path in paths.items())], pad=0.14)
    caption = side(p, 1.12 * end, ground, [(o["name"], o["at"], o["top"]) for o in obstacles])
    p.bands.append((x, profile["y_highest"], profile["y_lowest"], "#0072b233"))
    p.curve(x, profile["y_rest"], GREY, DOTTED, 1.4, "empty rope")
    for edge in ("y_highest", "y_lowest"):
        p.curve(x, profile[edge], BLUE, "", 0.8, "rope at its highest and lowest")
    for (name, path), color in zip(paths.items(), COLORS[1:] * len(paths), strict=False):
        p.curve(path["x"], path["y"], color, "", 2.0, f"path of {name}")
        if below[name]:
            p.curve(path["x"], path["y"] + below[name], color, DASHED, 1.4, f"lowest point of {name}")
        p.dots.append((float(path["x"][0]), float(path["y"][0]), color, False))
        p.dots.append((float(path["x"][-1]), float(path["y"][-1]), color, True))
    for c in line["contact"]:
        p.dots.append((c["at"][0], c["at"][1], BLACK, c["kind"] in ("anchor", "saddle")))
        shift = 0.0
        if c["at"][0] < 0.1 * end:
            shift = 0.04 * end
        elif c["at"][0] > 0.9 * end:
            shift = -0.04 * end
        p.labels.append((c["at"][0] + shift, c["at"][1] - 0.05 * (p.high - p.low), c["name"]))
    return plot([p], (-0.06 * end, 1.06 * end), "x [m]", f"{caption} Full dots: where the cars end.", wide=True)


def _over(line: Row, contacts: dict[str, Array], paths: dict[str, dict[str, Array]]) -> Iterator[Markup]:
    """One figure per kind of quantity, over time."""
    t = contacts["t"]
    tensions = {f"at {c['name']}": contacts[f"{c['name']}.tension"] for c in line["contact"]}
    for name, path in paths.items():
        tensions |= {f"behind {name}": path["T_behind"], f"ahead of {name}": path["T_ahead"]}
    saddles = [c["name"] for c in line["contact"] if c["kind"] == "saddle"]
    runs = [c["name"] for c in line["contact"] if c["kind"] in ("saddle", "counterweight")]
    figures = (
        ("Tension at the ends of each segment of rope.", tensions, "N"),
        ("Haul force; positive where it pulls to the right.", {n: p["F_haul"] for n, p in paths.items()}, "N"),
        ("Contact force.", {n: p["F_contact"] for n, p in paths.items()}, "N"),
        ("Rise of the counterweight.", {c: contacts[f"{c}.rise"] for c in runs}, "m"),
        ("Rope that has run to the left.", {c: contacts[f"{c}.s"] - contacts[f"{c}.s"][0] for c in runs}, "m"),
        ("Pressure of the rope on saddles.", {c: contacts[f"{c}.pressure"] for c in saddles}, "N"),
        ("Speed of the cars.", {n: p["speed"] for n, p in paths.items()}, "m/s"),
    )
    for title, values, unit in figures:
        shown = {name: v for name, v in values.items() if np.isfinite(v).any()}
        if not shown:
            continue
        factor, prefixed = scale_of(np.concatenate(list(shown.values())), unit)
        p = Panel(f"[{prefixed}]", "", 140.0)
        p.fit([factor * v for v in shown.values()])
        dashes = ("", DASHED)
        for i, (name, v) in enumerate(shown.items()):
            p.curve(t, factor * v, COLORS[i % len(COLORS)], dashes[i // len(COLORS) % 2], 1.6, name)
        yield plot([p], (float(t[0]), float(t[-1])), "time [s]", title)


def grid(folder: Path) -> list[Section]:
    stored = store.read(folder / "grid.json")
    rows = stored["rows"]
    html = table_of(rows, columns(rows, stored["keys"]), stored["keys"][0])
    worst = next((v for v in VERDICTS if any(x.get("verdict") == v for x in rows)), None)
    return [Section(folder.name, "All of them", html, worst, f"{len(rows)} lines in motion.")]
