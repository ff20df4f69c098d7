"""A line in motion, on the terminal and on its page."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array
from cablefem.scene.line import Contact, Line
from validation.core.quantities import quantity_text
from validation.core.stored_files import Entries, read_csv_columns
from validation.page import side_view
from validation.page.answer.many import Columns
from validation.page.line import line_grid_sections, read_line_with_content, series_figure, table_columns_with_outcome
from validation.page.page import Content, Row, Section, read_asset, render_sections
from validation.page.plot import COLORS, SeriesByName
from validation.page.side_view import packed_series, six_digits

WORDS: Row = tomllib.loads(read_asset("motion.toml"))
ROWS: dict[str, str] = WORDS.pop("rows")
OVER_TIME: dict[str, Row] = WORDS.pop("over")  # figures by title
GRIPS = " A car that grips rings with the rope: grip and contact force of it are means of such means."
TABLE_QUANTITIES: list[str] = WORDS.pop("table")


def motion_unit(quantity: str) -> str:
    return str(WORDS[quantity.partition(":")[0]]["unit"])


def line_averaging_time_sentence(round_trip: float) -> str:
    """Over what forces among the design numbers are means; round_trip : of an axial wave [s]."""
    return f"forces are means over an axial round trip of the rope, {round_trip:.2g} s"


def motion_quantity_words(quantity: str) -> str:
    kind, _, of = quantity.partition(":")
    return str(WORDS[kind]["words"]).format(of)


def comparison_words(quantity: str, subject: str) -> str:
    """What a row of a comparison is of; subject : its car, contact or law."""
    return ROWS[quantity].format(subject) if quantity in ROWS else subject


def design_number_rows(design: Sequence[Row]) -> list[Row]:
    """Words, value and time of each number, in the order of WORDS."""
    order = list(WORDS)
    rows = []
    for d in sorted(design, key=lambda d: order.index(d["quantity"].partition(":")[0])):
        value = quantity_text(d["value"], d["bar"], d["unit"])
        rows.append({"words": motion_quantity_words(d["quantity"]), "value": value, "t": _time_and_position_text(d)})
    return rows


def _time_and_position_text(number: Row) -> str:
    """Time of a number, and where its car is then."""
    at = "" if number["s_o"] is None else f", {number['s_o']:.1f} m along the rope"
    return f"{number['t']:.4g} s{at}"


def motion_table_columns(rows: Sequence[Row], keys: Mapping[str, str]) -> Columns:
    """Columns of a table: varied values, design numbers of TABLE_QUANTITIES, what became of each line."""
    names = dict.fromkeys(name for row in rows for name in row if name.partition(":")[0] in TABLE_QUANTITIES)
    heads = {name: f"{motion_quantity_words(name)} [{motion_unit(name)}]".removesuffix(" []") for name in names}
    return table_columns_with_outcome(rows, keys, heads)


def motion_sections(folder: Path, check_rows: Sequence[Row] = (), verdict: str | None = None) -> list[Section]:
    """Pages of the line in a folder; check_rows, verdict : of a check."""
    line, summary, content = read_line_with_content(folder, verdict, "breaks", "collides", "incomplete")
    design = summary["design"]
    contacts = read_csv_columns(folder / "contacts.csv")
    paths = {car.name: read_csv_columns(folder / f"path-{car.name}.csv") for car in line.car}
    compared = [row | {"named": comparison_words(row["quantity"], row.get("law", ""))} for row in check_rows]
    laws = [row for row in compared if row["quantity"] in ("laws_si", "energy")]
    content["side"] = _moving_side_view(line, folder, contacts, paths)
    content["events"] = [{"event": e["event"], "at": f"{e['t']:.4g} s"} for e in summary["events"]]
    content["design"] = design_number_rows(design)
    content["by_hand"] = "point" in {car.wheels.model for car in line.car if car.wheels}
    content["stressed"] = any(d["quantity"].startswith("stress") for d in design)
    content["over"] = list(_figures_over_time(line, contacts, paths))
    content["means"] = line_averaging_time_sentence(summary["round_trip"])
    content["grips"] = GRIPS if any(car.mode == "grip" for car in line.car) else ""
    content["compared"] = [row for row in compared if row not in laws]
    content["laws"] = laws
    return render_sections(__package__, "assets/motion.html", **content)


def _moving_side_view(line: Line, folder: Path, contacts: Entries, paths: Mapping[str, Entries]) -> Markup:
    """The side view in motion: rope, cars with what hangs and turns, counterweights."""
    rope = read_csv_columns(folder / "rope.csv")
    t = np.unique(rope["t"])
    s = np.unique(rope["s"])
    steps = np.searchsorted(contacts["t"], t)
    at_frames = contacts.change_values(lambda values: values[steps])
    rope_frames = _rope_frames_filled_beyond_pulleys(line, rope, at_frames)
    tensions = rope_frames["T"]
    range_T = float(tensions.min()), float(tensions.max())
    unit = side_view.force_unit(range_T[1])
    bodies = []
    for car, color in zip(line.car, COLORS[1:] * len(line.car), strict=False):
        path = paths[car.name].change_values(lambda values: values[steps])
        bodies.append(side_view.packed_car(path, unit, name=car.name, color=color, below=car.below))
    enlarged = any("body" in body for body in bodies)
    bodies += [_packed_contact(c, at_frames) for c in line.contact if c.kind != "spring"]

    moving = packed_series(rope_frames | {"t": t})
    moving["touching"] = bodies
    rises = [at_frames[f"{c.name}.rise"] for c in line.contact if c.kind == "counterweight"]
    moving["weights"] = [side_view.pack_array_as_uint16(rise) for rise in rises]
    origin = [0.0] * s.size
    data: Content = {"line": True, "enlarged": enlarged, "s": six_digits(s), "x": origin, "y": origin}
    data |= _still_parts_of_side_view(line, read_csv_columns(folder / "profile.csv"), paths)
    data |= {"cables": [moving], "party": None}
    return side_view.side_view_player(data, range_T, " and ".join(paths))


def _still_parts_of_side_view(line: Line, profile: SeriesByName, paths: Mapping[str, SeriesByName]) -> Content:
    """The parts that do not move: rope at rest, envelope, contacts, paths of the cars, obstacles, ground."""
    right = line.contact[-1]
    span, drop = right.at
    rest = [six_digits(profile[name]) for name in ("x", "y_rest")]
    parts: Content = {"span": span, "drop": drop, "rest": rest, "static": []}
    parts["envelope"] = side_view.rope_envelope(profile)
    parts["contacts"] = []
    parts["weights"] = []
    parts["paths"] = []
    for contact in line.contact:
        x, y = contact.at
        parts["contacts"].append({"x": x, "y": y, "kind": contact.kind, "name": contact.name, "shoe": contact.shoe})
        if contact.kind == "counterweight":
            parts["weights"].append({"x": x, "y": y, "side": 1 if contact is right else -1})
    for car in line.car:
        path = paths[car.name]
        parts["paths"].append(side_view.sparse_car_path(path["x"], path["y"], car.below))
    parts |= {"speeds": [], "brakes": []}
    return parts | side_view.obstacles_and_ground(line)


def _rope_frames_filled_beyond_pulleys(line: Line, rope: SeriesByName, at_frames: SeriesByName) -> SeriesByName:
    """Tension and points (frames, stations); rope that is beyond a pulley has the values at it.

    rope : columns of rope.csv, nan beyond a pulley;  at_frames : columns of contacts.csv.
    """
    s = np.unique(rope["s"])
    is_left = s < s.mean()
    left = line.contact[0]
    right = line.contact[-1]

    def filled(column: str, at_left: Any, at_right: Any) -> Array:
        values = rope[column].reshape(-1, s.size)
        at_pulley = np.where(is_left, at_left, at_right)
        return np.where(np.isnan(values), at_pulley, values)

    tension_left = at_frames[f"{left.name}.tension"][:, None]
    tension_right = at_frames[f"{right.name}.tension"][:, None]
    frames = {"T": filled("T", tension_left, tension_right)}
    frames["u"] = filled("x", left.at[0], right.at[0])
    frames["v"] = filled("y", left.at[1], right.at[1])
    return frames


def _packed_contact(contact: Contact, at_frames: SeriesByName) -> Content:
    """The rope at a contact, for the side view; at_frames : columns of all contacts."""
    T = at_frames[f"{contact.name}.tension"]
    x, y = contact.at
    series = {"s": at_frames[f"{contact.name}.s"]}
    series |= {"x": np.full(T.size, x), "y": np.full(T.size, y), "behind": T, "ahead": T}
    return packed_series(series) | {"readout": [], "name": contact.name}


def _figures_over_time(line: Line, contacts: SeriesByName, paths: Mapping[str, SeriesByName]) -> Iterator[Markup]:
    """One figure per kind of quantity that is known, over time."""
    for title, figure in OVER_TIME.items():
        series = _series_of_contacts(line, contacts, figure)
        for name, path in paths.items():
            for column, words in figure.get("cars", {}).items():
                if column in path:
                    series[words.format(name)] = path[column]
        known = {name: values for name, values in series.items() if np.isfinite(values).any()}
        if known:
            yield series_figure(known, figure["unit"], contacts["t"], "time [s]", title)


def _series_of_contacts(line: Line, contacts: SeriesByName, figure: Row) -> SeriesByName:
    """Curves of a figure over time, at its kind of contacts."""
    series = {}
    for contact in line.contact:
        if figure.get("kind", contact.kind) != contact.kind:
            continue
        for column, words in figure.get("contacts", {}).items():
            values = contacts[f"{contact.name}.{column}"]
            if figure.get("from_start"):
                values = values - values[0]
            series[words.format(contact.name)] = values
    return series


def motion_grid_sections(folder: Path) -> list[Section]:
    """The page of a grid of lines in motion in a folder."""
    return line_grid_sections(folder, motion_table_columns)
