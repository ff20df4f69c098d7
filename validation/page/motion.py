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
from validation.page.line import figure, limits_from, plot_side, side_of
from validation.page.page import Section, asset, drawn, worst
from validation.page.plot import BLUE, COLORS, DASHED

WORDS: dict[str, dict[str, str]] = tomllib.loads(asset("motion.toml"))
HANGERS = 9  # drawn of a cabin that swings
FEW = (
    "tension_max",
    "clearance_rope",
    "clearance_car",
    "haul_max",
    "contact_min",
    "wheel_min",
    "stress_max",
    "swing_max",
    "swing_min",
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
    """A number with bar and unit; a speed also in km/h."""
    factor, unit = scale_of(np.array([number["value"], number["bar"] or 0.0]), number["unit"])
    bar = None if number["bar"] is None else factor * number["bar"]
    text = f"{with_bar(factor * number['value'], bar)} {unit}".rstrip()
    return f"{text} = {3.6 * number['value']:.4g} km/h" if number["unit"] == "m/s" else text


def rows_of(design: Sequence[Row]) -> list[Row]:
    """Words, value and time of each number, in the order of WORDS."""
    order = list(WORDS)
    ordered = sorted(design, key=lambda d: order.index(d["quantity"].partition(":")[0]))
    return [{"words": named(d["quantity"]), "value": value_of(d), "t": _when(d)} for d in ordered]


def _when(number: Row) -> str:
    """Time of a number, and where its car is then."""
    at = "" if number["s_o"] is None else f", {number['s_o']:.1f} m along the rope"
    return f"{number['t']:.4g} s{at}"


def tell(line: Any, outcome: str, design: Sequence[Row], limits: Sequence[Row] = ()) -> None:
    """Print the outcome, limits, and the first 14 design numbers."""
    terminal.say(f"{line.name}: {outcome}", style="bold")
    telling.limits(line, limits)
    rows = rows_of([d for d in design if d["quantity"].partition(":")[0] in FEW])[:14]
    terminal.table(["quantity", "value", "at"], [list(row.values()) for row in rows])
    if len(design) > len(rows):
        terminal.say(f"  {len(design) - len(rows)} more in the report")


def columns(rows: Sequence[Row], keys: Sequence[str]) -> Columns:
    """Columns of a table: varied values, design numbers of FEW, what became of each line."""
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
    alarm = "disagree" if summary["outcome_kind"] in ("breaks", "collides", "incomplete") else None
    return drawn(
        "validation.page", "assets/motion.html", id=folder.name, verdict=verdict, outcome=summary["outcome"],
        limits=limits_from(folder, summary), alarm=alarm, side=_side(line, _columns(folder / "profile.csv"), paths),
        events=[{"event": e["event"], "at": f"{e['t']:.4g} s"} for e in summary["events"]],
        design=rows_of(summary["design"]),
        by_hand=any("point" in car.get("wheels", {}).values() for car in line["car"]),
        stressed=any(d["quantity"].startswith("stress") for d in summary["design"]),
        over=list(_over(line, contacts, paths)), round_trip=f"{summary['round_trip']:.2g} s",
        compared=[row for row in compared if row not in laws], laws=laws,
    )  # fmt: skip


def _columns(file: Path) -> dict[str, Array]:
    with file.open(encoding="utf-8", newline="") as opened:
        rows = list(csv.DictReader(opened))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def _side(line: Row, profile: dict[str, Array], paths: dict[str, dict[str, Array]]) -> Markup:
    """Envelope of the rope, paths and lowest points of the cars from the side."""
    below = {car["name"]: car.get("below", 0.0) for car in line["car"]}
    p, caption = side_of(line, profile, [path["y"] + below[name] for name, path in paths.items()])
    for edge in ("y_highest", "y_lowest"):
        p.curve(profile["x"], profile[edge], BLUE, "", 0.8, "rope at its highest and lowest")
    for (name, path), color in zip(paths.items(), COLORS[1:] * len(paths), strict=False):
        x = path["x"]
        y = path["y"]
        p.curve(x, y, color, "", 2.0, f"path of {name}")
        if below[name]:
            p.curve(x, y + below[name], color, DASHED, 1.4, f"lowest point of {name}")
        if "swing" in path:
            for i in np.linspace(0, x.size - 1, HANGERS).astype(int):
                swing = np.radians(path["swing"][i])
                hanger = 0.15 * (p.high - p.low) * np.array([np.sin(swing), np.cos(swing)])
                p.curve(x[i] + [0.0, hanger[0]], y[i] + [0.0, hanger[1]], color, "", 1.0)
        p.dots.append((float(x[0]), float(y[0]), color, False))
        p.dots.append((float(x[-1]), float(y[-1]), color, True))
    swings = any("swing" in path for path in paths.values())
    swinging = " Straight lines: how a cabin hangs at equal steps, enlarged." if swings else ""
    return plot_side(p, line, f"{caption} Full dots: where the cars end.{swinging}")


def _over(line: Row, contacts: dict[str, Array], paths: dict[str, dict[str, Array]]) -> Iterator[Markup]:
    """One figure per kind of quantity, over time."""
    t = contacts["t"]
    tensions = {f"at {c['name']}": contacts[f"{c['name']}.tension"] for c in line["contact"]}
    for name, path in paths.items():
        tensions |= {f"behind {name}": path["T_behind"], f"ahead of {name}": path["T_ahead"]}
    saddles = [c["name"] for c in line["contact"] if c["kind"] == "saddle"]
    moving = [c["name"] for c in line["contact"] if c["kind"] in ("saddle", "counterweight")]

    def of_cars(column: str) -> dict[str, Array]:
        return {name: path[column] for name, path in paths.items() if column in path}

    def at_contacts(names: Sequence[str], column: str) -> dict[str, Array]:
        return {name: contacts[f"{name}.{column}"] for name in names}

    wheels = {f"rear wheel of {name}": load for name, load in of_cars("wheel_rear").items()}
    wheels |= {f"front wheel of {name}": load for name, load in of_cars("wheel_front").items()}
    flow = {name: s - s[0] for name, s in at_contacts(moving, "s").items()}
    figures = (
        ("Tension at the ends of each segment of rope.", tensions, "N"),
        ("Haul force; positive where it pulls to the right.", of_cars("F_haul"), "N"),
        ("Contact force.", of_cars("F_contact"), "N"),
        ("Loads of both wheels.", wheels, "N"),
        ("Swing of the cabins forward.", of_cars("swing"), "deg"),
        ("Pitch, front down.", of_cars("pitch"), "deg"),
        ("Rise of the counterweight.", at_contacts(moving, "rise"), "m"),
        ("Rope that has run to the left.", flow, "m"),
        ("Pressure on saddles, of the rope and of a car on the shoe.", at_contacts(saddles, "pressure"), "N"),
        ("Speed of the cars.", of_cars("speed"), "m/s"),
    )
    for title, values, unit in figures:
        known = {name: v for name, v in values.items() if np.isfinite(v).any()}
        if known:
            yield figure(known, unit, t, "time [s]", title)


def grid(folder: Path) -> list[Section]:
    """The page of a grid of lines in motion in a folder."""
    stored = store.read(folder / "grid.json")
    rows = stored["rows"]
    html = table_of(rows, columns(rows, stored["keys"]), stored["keys"][0])
    return [Section(folder.name, "All of them", html, worst(rows), f"{len(rows)} lines in motion.")]
