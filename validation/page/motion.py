"""A line in motion, on the terminal and on its page."""

import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array
from cablefem.scene.line import Car, Contact, Line
from validation.core import store
from validation.core.quantities import quantity_text
from validation.core.scene_data import read_csv_columns
from validation.page import line as at_rest
from validation.page.answer.many import Columns, Row
from validation.page.line import series_figure, stored_limits_table, table_columns_with_outcome
from validation.page.page import Section, read_asset, render_sections
from validation.page.plot import COLORS
from validation.page.scene_keys import scene_inputs_html
from validation.page.side_view import (
    force_unit,
    obstacles_and_ground,
    pack_array_as_uint16,
    packed_car_path,
    packed_rope_body,
    side_view_player,
    six_digits,
)

WORDS: dict[str, Any] = tomllib.loads(read_asset("motion.toml"))
ROWS: dict[str, str] = WORDS.pop("rows")
GRIPS = " A car that grips rings with the rope: grip and contact force of it are means of such means."
TABLE_QUANTITIES = (
    "tension_max",
    "safety_factor_min",
    "clearance_rope",
    "clearance_car",
    "haul_max",
    "haul_min",
    "contact_min",
    "wheel_min",
    "stress_max",
    "swing_max",
    "swing_min",
    "load_max",
    "rise_max",
    "rise_min",
    "speed_max",
)  # in a table


def motion_unit(quantity: str) -> str:
    unit: str = WORDS[quantity.partition(":")[0]]["unit"]
    return unit


def means_sentence(round_trip: float) -> str:
    """Over what forces among the design numbers are means; round_trip : of an axial wave [s]."""
    return f"forces are means over an axial round trip of the rope, {round_trip:.2g} s"


def motion_quantity_words(quantity: str) -> str:
    kind, _, of = quantity.partition(":")
    words: str = WORDS[kind]["words"]
    return words.format(of)


def comparison_words(quantity: str, subject: str) -> str:
    """What a row of a comparison is of; subject : its car, contact or law."""
    return ROWS[quantity].format(subject) if quantity in ROWS else subject


def design_number_rows(design: Sequence[Row]) -> list[Row]:
    """Words, value and time of each number, in the order of WORDS."""
    order = list(WORDS)
    ordered = sorted(design, key=lambda d: order.index(d["quantity"].partition(":")[0]))
    return [
        {
            "words": motion_quantity_words(d["quantity"]),
            "value": quantity_text(d["value"], d["bar"], d["unit"]),
            "t": _time_and_position_text(d),
        }
        for d in ordered
    ]


def _time_and_position_text(number: Row) -> str:
    """Time of a number, and where its car is then."""
    at = "" if number["s_o"] is None else f", {number['s_o']:.1f} m along the rope"
    return f"{number['t']:.4g} s{at}"


def motion_table_columns(rows: Sequence[Row], keys: Sequence[str]) -> Columns:
    """Columns of a table: varied values, design numbers of TABLE_QUANTITIES, what became of each line."""
    names = dict.fromkeys(name for row in rows for name in row if name.partition(":")[0] in TABLE_QUANTITIES)
    heads = {name: f"{motion_quantity_words(name)} [{motion_unit(name)}]".removesuffix(" []") for name in names}
    return table_columns_with_outcome(rows, keys, heads)


def motion_sections(folder: Path, check_rows: Sequence[Row] = (), verdict: str | None = None) -> list[Section]:
    """Pages of the line in a folder; check_rows, verdict : of a check."""
    summary = store.read_json(folder / "summary.json")
    toml = (folder / "scene.toml").read_text(encoding="utf-8")
    line = tomllib.loads(toml)
    contacts = read_csv_columns(folder / "contacts.csv")
    paths = {car["name"]: read_csv_columns(folder / f"path-{car['name']}.csv") for car in line["car"]}
    compared = _named_comparisons(check_rows)
    laws = [row for row in compared if row["quantity"] in ("laws_si", "energy")]
    alarm = "disagree" if summary["outcome_kind"] in ("breaks", "collides", "incomplete") else None
    return render_sections(
        "validation.page", "assets/motion.html", id=folder.name, verdict=verdict, outcome=summary["outcome"],
        limits=stored_limits_table(folder, summary), alarm=alarm, side=_moving_side_view(folder, contacts, paths),
        events=[{"event": e["event"], "at": f"{e['t']:.4g} s"} for e in summary["events"]],
        design=design_number_rows(summary["design"]),
        by_hand=any("point" in car.get("wheels", {}).values() for car in line["car"]),
        stressed=any(d["quantity"].startswith("stress") for d in summary["design"]),
        over=list(_figures_over_time(line, contacts, paths)), means=means_sentence(summary["round_trip"]),
        grips=GRIPS if any("drive" not in car for car in line["car"]) else "",
        compared=[row for row in compared if row not in laws], laws=laws, as_read=scene_inputs_html(toml, Line),
    )  # fmt: skip


def _named_comparisons(rows: Sequence[Row]) -> list[Row]:
    """Rows of a check, each with its name in words."""
    return [row | {"named": comparison_words(row["quantity"], row.get("law", ""))} for row in rows]


def _moving_side_view(folder: Path, contacts: dict[str, Array], paths: dict[str, dict[str, Array]]) -> Markup:
    """The side view in motion: rope, cars with what hangs and turns, counterweights."""
    line = Line.load(folder / "scene.toml")
    rope = read_csv_columns(folder / "rope.csv")
    t = np.unique(rope["t"])
    s = np.unique(rope["s"])
    steps = np.searchsorted(contacts["t"], t)
    tensions = [contacts[f"{c.name}.tension"][steps, None] for c in (line.contact[0], line.contact[-1])]
    cable = _rope_between_pulleys(line, rope, t.size, tensions)
    range_T = float(cable["T"].min()), float(cable["T"].max())
    frames = {name: {column: values[steps] for column, values in path.items()} for name, path in paths.items()}
    bodies = _packed_cars(line, frames, *force_unit(range_T[1]))
    bodies += [_packed_contact(c, contacts, steps) for c in line.contact if c.kind != "spring"]
    rises = [pack_array_as_uint16(contacts[f"{c.name}.rise"][steps]) for c in _counterweights(line)]
    moving: dict[str, Any] = {name: pack_array_as_uint16(values) for name, values in cable.items()}
    moving |= {"t": pack_array_as_uint16(t), "touching": bodies, "weights": rises}
    data = {
        "line": True,
        "enlarged": any("body" in body for body in bodies),
        "s": six_digits(s),
        "x": [0.0] * s.size,
        "y": [0.0] * s.size,
        **_still_parts_of_side_view(line, read_csv_columns(folder / "profile.csv"), paths),
        "cables": [moving],
        "party": None,
    }
    return side_view_player(data, range_T, " and ".join(paths))


def _counterweights(line: Line) -> list[Contact]:
    return [c for c in line.contact if c.kind == "counterweight"]


def _still_parts_of_side_view(
    line: Line, profile: dict[str, Array], paths: dict[str, dict[str, Array]]
) -> dict[str, Any]:
    """The parts that do not move: rope at rest, envelope, contacts, paths of the cars, obstacles, ground."""
    right = line.contact[-1]
    return {
        "span": right.at[0],
        "drop": right.at[1],
        "rest": [six_digits(profile["x"]), six_digits(profile["y_rest"])],
        "static": [],
        "envelope": [six_digits(profile[name]) for name in ("x", "y_highest", "y_lowest")],
        "contacts": [
            {"x": c.at[0], "y": c.at[1], "kind": c.kind, "name": c.name, "shoe": c.shoe} for c in line.contact
        ],
        "weights": [{"x": c.at[0], "y": c.at[1], "side": 1 if c is right else -1} for c in _counterweights(line)],
        "paths": [packed_car_path(paths[car.name]["x"], paths[car.name]["y"], car.below) for car in line.car],
        "speeds": [],
        "brakes": [],
        **obstacles_and_ground(line),
    }


def _rope_between_pulleys(
    line: Line, rope: dict[str, Array], frames: int, tensions: Sequence[Array]
) -> dict[str, Array]:
    """Tension and points (frames, stations); beyond a pulley as at it.  tensions : (frames, 1) at both ends."""
    s = np.unique(rope["s"])
    is_left = s < s.mean()
    left, right = line.contact[0].at, line.contact[-1].at

    def column(name: str, at_left: Any, at_right: Any) -> Array:
        values = rope[name].reshape(frames, s.size)
        return np.where(np.isnan(values), np.where(is_left, at_left, at_right), values)

    return {"T": column("T", *tensions), "u": column("x", left[0], right[0]), "v": column("y", left[1], right[1])}


def _packed_cars(
    line: Line, frames: dict[str, dict[str, Array]], unit: float, unit_name: str
) -> list[dict[str, Any]]:  # fmt: skip
    """All cars for the side view, one colour each; frames : columns of their paths at the frames, by name."""
    colors = COLORS[1:] * len(line.car)
    return [
        _packed_car(car, frames[car.name], color, unit, unit_name) for car, color in zip(line.car, colors, strict=False)
    ]


def _packed_car(car: Car, path: dict[str, Array], color: str, unit: float, unit_name: str) -> dict[str, Any]:
    """A car for the side view; path : its columns at the frames."""
    forces = {"press on the rope": "F_contact", "haul or thrust": "F_haul"}
    forces |= {"rear wheel": "wheel_rear", "front wheel": "wheel_front"}
    readout = [
        ("deflection [m]", 2, path["v"]),
        (f"tension behind [{unit_name}]", 1, path["T_behind"] / unit),
        (f"tension ahead [{unit_name}]", 1, path["T_ahead"] / unit),
        ("speed [km/h]", 1, 3.6 * path["speed"]),
        *((f"{name} [{unit_name}]", 2, path[column] / unit) for name, column in forces.items() if column in path),
        *((f"{name} [deg]", 1, path[name]) for name in ("swing", "pitch") if name in path),
    ]
    columns = {"s": "s_o", "x": "x", "y": "y", "behind": "T_behind", "ahead": "T_ahead"}
    series = {name: path[column] for name, column in columns.items()}
    how: dict[str, Any] = {"name": car.name, "color": color, "below": car.below}
    for name, body in (("swing", "hangs"), ("pitch", "wheels")):
        if name in path:
            series["turn"] = np.radians(path[name])
            how["body"] = body
    return packed_rope_body(series, readout, **how)


def _packed_contact(contact: Contact, columns: dict[str, Array], steps: Any) -> dict[str, Any]:
    """The rope at a contact, for the side view; columns : of all contacts; steps : indices of the frames."""
    T = columns[f"{contact.name}.tension"][steps]
    x, y = np.broadcast_to(np.array(contact.at)[:, None], (2, T.size))
    series = {"s": columns[f"{contact.name}.s"][steps], "x": x, "y": y, "behind": T, "ahead": T}
    return packed_rope_body(series, name=contact.name)


def _figures_over_time(line: Row, contacts: dict[str, Array], paths: dict[str, dict[str, Array]]) -> Iterator[Markup]:
    """One figure per kind of quantity that is known, over time."""
    for title, (values, unit) in _series_by_title(line, contacts, paths).items():
        known = {name: v for name, v in values.items() if np.isfinite(v).any()}
        if known:
            yield series_figure(known, unit, contacts["t"], "time [s]", title)


def _series_by_title(
    line: Row, contacts: dict[str, Array], paths: dict[str, dict[str, Array]]
) -> dict[str, tuple[dict[str, Array], str]]:
    """Series and their unit, by title."""
    tensions = {f"at {c['name']}": contacts[f"{c['name']}.tension"] for c in line["contact"]}
    for name, path in paths.items():
        tensions |= {f"behind {name}": path["T_behind"], f"ahead of {name}": path["T_ahead"]}
    saddles = [c["name"] for c in line["contact"] if c["kind"] == "saddle"]
    weights = [c["name"] for c in line["contact"] if c["kind"] == "counterweight"]

    def series_of_cars(column: str) -> dict[str, Array]:
        return {name: path[column] for name, path in paths.items() if column in path}

    def series_at_contacts(names: Sequence[str], column: str) -> dict[str, Array]:
        return {name: contacts[f"{name}.{column}"] for name in names}

    wheels = {f"rear wheel of {name}": load for name, load in series_of_cars("wheel_rear").items()}
    wheels |= {f"front wheel of {name}": load for name, load in series_of_cars("wheel_front").items()}
    flow = {name: s - s[0] for name, s in series_at_contacts(saddles, "s").items()}
    return {
        "Tension at the ends of each segment of rope.": (tensions, "N"),
        "Haul force; positive where it pulls to the right.": (series_of_cars("F_haul"), "N"),
        "Contact force.": (series_of_cars("F_contact"), "N"),
        "Force of the cars on shoes; negative where a shoe would have to hold a car down.": (
            series_of_cars("F_shoe"),
            "N",
        ),
        "Loads of both wheels.": (wheels, "N"),
        "Swing of the cabins forward.": (series_of_cars("swing"), "deg"),
        "Pitch, front down.": (series_of_cars("pitch"), "deg"),
        "Rise of the counterweight.": (series_at_contacts(weights, "rise"), "m"),
        "Rope that has run over saddles to the left.": (flow, "m"),
        "Pressure on saddles, of the rope and of a car on the shoe.": (series_at_contacts(saddles, "pressure"), "N"),
        "Speed of the cars.": (series_of_cars("speed"), "m/s"),
    }


def motion_grid_sections(folder: Path) -> list[Section]:
    """The page of a grid of lines in motion in a folder."""
    return at_rest.line_grid_sections(folder, motion_table_columns)
