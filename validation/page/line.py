"""A line at rest, on the terminal and on its page."""

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import starmap
from pathlib import Path

import numpy as np
from markupsafe import Markup

from cablefem.response import Array
from cablefem.scene.line import Contact, Line
from validation.core import store
from validation.core.limits import limit_scope_sentences
from validation.core.quantities import factor_and_prefixed_unit, limit_row_texts
from validation.core.stored_files import read_csv_rows
from validation.page import plot, printing, terminal
from validation.page.answer.many import LIMITS, Column, Columns, StoredGrid, grid_table, key_columns
from validation.page.page import Content, Row, Section, limits_of, read_asset, render_sections, worst_verdict
from validation.page.plot import Panel, SeriesByName
from validation.page.scene_keys import line_inputs_html

_TEXT = tomllib.loads(read_asset("line.toml"))
WORDS: dict[str, dict[str, str]] = _TEXT["quantity"]
RECHECKED = ("laws_si", "printed")  # rows from the TOML alone
TABLE_QUANTITIES: list[str] = _TEXT["table"]


def base_quantity(name: str) -> str:
    """The quantity in a name, without extreme and contact."""
    kind, _, of = name.partition(":")
    return kind if kind in WORDS and not of else kind.removesuffix("_max").removesuffix("_min")


def line_quantity_words(name: str) -> str:
    return WORDS[base_quantity(name)]["words"].format(name.partition(":")[2])


def names_of_extremes(name: str) -> dict[str, str]:
    """Design numbers of a quantity by "max" and "min", or by the only one that matters: `tension_max:tower`."""
    kind, colon, of = name.partition(":")
    only = WORDS[kind].get("only")
    return {word: f"{kind.removesuffix(f'_{word}')}_{word}{colon}{of}" for word in ([only] if only else ("max", "min"))}


def words_of_extremes() -> dict[str, dict[str, str]]:
    """Words and unit of design numbers by kind: largest and smallest of each quantity, or the only one that matters."""
    out = {}
    for name, of in WORDS.items():
        sides = {"max": ", largest", "min": ", smallest"} if "only" not in of else {}
        for word, extreme in names_of_extremes(name).items():
            out[extreme] = of | {"words": of["words"] + sides.get(word, "")}
    return out


def three_decimals_text(value: float, unit: str) -> str:
    """A value with its unit, to a millimetre or a newton."""
    factor = 1.0
    if unit != "m":
        factor, unit = factor_and_prefixed_unit(np.array([value]), unit)
    suffix = {"deg": "°", "": ""}.get(unit, f" {unit}")
    return f"{round(factor * value, 3) + 0.0:.3f}{suffix}"  # no -0.000


def few_cars_text(extreme: Row, form: str) -> str:
    """Where the cars are at an extreme number, each with name and x [m] in a form; "" of many, or of none."""
    most = 4  # cars that are named
    at = extreme["at"]
    return ", ".join(starmap(form.format, at.items())) if len(at) <= most else ""


def extremes_table_rows(design: Sequence[Row]) -> list[Row]:
    """One row per quantity: largest and smallest value, and the cars' positions then."""
    out: dict[str, Row] = {}
    order = list(WORDS)
    for d in sorted(design, key=lambda d: order.index(base_quantity(d["quantity"]))):
        name = d["quantity"]
        words = line_quantity_words(name)
        row = out.setdefault(words, {"quantity": words, "largest": "", "smallest": ""})
        cars = few_cars_text(d, "{} {:.0f}") or (f"position {d['position']}" if d["at"] else "")
        is_smallest = name.partition(":")[0].endswith("_min")
        value = three_decimals_text(d["value"], d["unit"])
        row["smallest" if is_smallest else "largest"] = f"{value} ({cars})" if cars else value
        if is_smallest and row["largest"].partition(" (")[0] == value:
            row["largest"] = value
            row["smallest"] = "the same"
    return list(out.values())


def print_line_summary(
    line: Line, outcome: str, limits: Sequence[Row], design_rows: Sequence[Row], rows_in_report: int
) -> None:
    """Print outcome, limits, and the first 14 rows of design numbers."""
    terminal.print_text(f"{line.name}: {outcome}", style="bold")
    printing.print_limits(line, limits)
    rows = design_rows[:14]
    words = {"largest": "largest (cars at x [m])", "words": "quantity", "t": "at"}
    heads = [words.get(name, name) for name in design_rows[0]]
    terminal.print_table(heads, [list(row.values()) for row in rows])
    remaining = rows_in_report - len(rows)
    if remaining > 0:
        terminal.print_text(f"  {remaining} more in the report")


def rest_table_columns(rows: Sequence[Row], keys: Mapping[str, str]) -> Columns:
    """Columns of a table of lines: varied values, design numbers of TABLE_QUANTITIES, what became of each line."""
    names = dict.fromkeys(name for row in rows for name in row if base_quantity(name) in TABLE_QUANTITIES)
    return table_columns_with_outcome(rows, keys, {name: _column_heading(name) for name in names})


def table_columns_with_outcome(rows: Sequence[Row], keys: Mapping[str, str], number_heads: dict[str, str]) -> Columns:
    """Columns of a table: varied values, numbers with their heads, and what became of each line if it says more."""
    words = []
    for name in ("outcome", "status", *LIMITS, "verdict", "why"):
        if {row.get(name) for row in rows} - {None, "complete"}:
            words.append(name)
    first = [name for name in words if name == "outcome"]  # numbers of many cars fill the width of a page
    heads = {name: name for name in first} | number_heads | {name: name for name in words}
    return key_columns(keys) | {name: Column(head, spec="#.6g") for name, head in heads.items()}


def _column_heading(name: str) -> str:
    kind = base_quantity(name)
    unit = WORDS[kind]["unit"]
    which = "smallest " if name.partition(":")[0].endswith("_min") else "largest "
    if kind in ("tension_max", "safety_factor"):
        which = ""
    return f"{which}{line_quantity_words(name)} [{unit}]".removesuffix(" []")


def read_line_with_content(
    folder: Path, verdict: str | None, *alarming_outcome_kinds: str
) -> tuple[Line, Row, Content]:
    """The line of a folder, its summary, and what pages at rest and in motion show alike.

    alarming_outcome_kinds : kinds of outcomes that are shown as an alarm.
    """
    summary = store.read_json(folder / "summary.json")
    toml = (folder / "scene.toml").read_text(encoding="utf-8")
    line = Line.from_toml(toml)
    content: Content = {"id": folder.name, "verdict": verdict, "outcome": summary["outcome"]}
    content["alarm"] = "disagree" if summary["outcome_kind"] in alarming_outcome_kinds else None
    content["limits"] = limits_of(list(map(limit_row_texts, summary["limits"])), limit_scope_sentences(line))
    content["as_read"] = line_inputs_html(toml)
    return line, summary, content


def rest_sections(folder: Path, check_rows: Sequence[Row] = (), verdict: str | None = None) -> list[Section]:
    """Pages of the line in a folder; check_rows, verdict : of a check."""
    line, summary, content = read_line_with_content(folder, verdict, "breaks", "collides")
    positions = read_csv_rows(folder / "positions.csv")
    content["refused"] = summary["refused"]
    content["side"] = _side_view_figure(line, store.read_json(folder / "ropes.json"), positions)
    content["design"] = extremes_table_rows(summary["design"])
    content["over"] = []
    if summary["positions"] > 1:
        content["over"] = list(_figures_over_position(line.car[0].name, positions))
    content["compared"] = [x for x in check_rows if x["quantity"] not in RECHECKED]
    content["rechecked"] = [x for x in check_rows if x["quantity"] in RECHECKED]
    return render_sections(__package__, "assets/line.html", **content)


def _column_of_floats(positions: Sequence[Row], name: str) -> Array:
    return np.array([float(x[name] or "nan") for x in positions])


def _side_view_without_cars(line: Line, profile: SeriesByName, lowest: Sequence[Array]) -> tuple[Panel, str]:
    """The side view of a line without its cars, and its caption.

    profile : columns of profile.csv;  lowest : depths of the cars' lowest points [m], to fit.
    """
    x = profile["x"]
    highest_of_rope = profile["y_highest"]
    lowest_of_rope = profile["y_lowest"]
    grounds = [np.array(line.ground)] if line.ground else []
    width = 1.12 * float(x[-1])
    depths = [highest_of_rope, lowest_of_rope, *lowest]
    p, caption = plot.side_view_panel(depths, width, grounds, line.obstacle, pad=0.14)
    p.bands.append((x, highest_of_rope, lowest_of_rope, "#0072b233"))
    p.add_curve(x, profile["y_rest"], plot.GREY, plot.DOTTED, 1.4, "empty rope")
    for contact in line.contact:
        _draw_contact(p, contact)
    return p, caption


def _draw_contact(panel: Panel, contact: Contact) -> None:
    """Draw a support, its shoe and its name in a side view."""
    x, depth = contact.at
    is_fixed = contact.kind in ("anchor", "saddle")
    panel.dots.append((x, depth, plot.BLACK, is_fixed))
    if contact.shoe is not None:
        ends = np.array([x - contact.shoe, x + contact.shoe])
        panel.add_curve(ends, np.full(2, depth), plot.BLACK, width=3.0)
    above = depth - 0.05 * (panel.high - panel.low)
    panel.labels.append((x, above, contact.name))


def series_figure(series: SeriesByName, unit: str, x: Array, xlabel: str, title: str) -> Markup:
    """Series in SI over a common axis x (n,)."""
    factor, prefixed = factor_and_prefixed_unit(np.concatenate(list(series.values())), unit)
    scaled = {name: factor * values for name, values in series.items()}
    p = Panel(f"[{prefixed}]" if prefixed else "")
    p.fit_y_axis(list(scaled.values()))
    for i, (name, values) in enumerate(scaled.items()):
        rounds, k = divmod(i, len(plot.COLORS))
        dash = ("", plot.DASHED)[rounds % 2]
        p.add_curve(x, values, plot.COLORS[k], dash, 1.7, name)
    x_range = float(np.nanmin(x)), float(np.nanmax(x))
    return plot.svg_figure([p], x_range, xlabel, title)


def _side_view_figure(line: Line, ropes: Row, positions: Sequence[Row]) -> Markup:
    """Rope at rest and at all positions, cars, supports, ground and obstacles from the side."""
    profile = ropes["profile"].change_values(np.array)
    lowest_of_cars = [_column_of_floats(positions, f"depth:{car.name}") + car.below for car in line.car]
    p, caption = _side_view_without_cars(line, profile, lowest_of_cars)
    for depth in ropes["depths"].values():
        p.add_curve(profile["x"], np.array(depth), plot.BLUE, "", 1.0, "rope at some positions; shaded: at all")
    for car, lowest, color in zip(line.car, lowest_of_cars, plot.COLORS[1:] * len(line.car), strict=False):
        x = _column_of_floats(positions, f"x:{car.name}")
        p.add_curve(x, lowest, color, plot.DASHED, 1.8, f"lowest point of {car.name}")
        if x.size == 1:
            p.dots.append((float(x[0]), float(lowest[0]) - car.below, color, True))
    end, _ = line.contact[-1].at
    return plot.svg_figure([p], (-0.06 * end, 1.06 * end), "x [m]", caption, wide=True)


def _figures_over_position(car: str, positions: Sequence[Row]) -> Iterator[Markup]:
    """One figure per kind of quantity, over the position of the first car."""
    x = _column_of_floats(positions, f"x:{car}")
    for title, kinds in _TEXT["over"].items():
        series = {}
        for name in positions[0]:
            if name.partition(":")[0] not in kinds:
                continue
            values = _column_of_floats(positions, name)
            if np.isfinite(values[1:] + values[:-1]).any():  # a car is over an obstacle at one position
                series[line_quantity_words(name)] = values
        if series:
            yield series_figure(series, WORDS[kinds[0]]["unit"], x, f"x of {car} [m]", title)


def _lowest_point_path_figure(grid: StoredGrid) -> Markup:
    p = Panel("depth [m]", height=180.0, down=True)
    for path, row, color in zip(grid.paths, grid.rows, plot.COLORS * len(grid.rows), strict=False):
        if path:
            x, depth = np.array(path)
            p.add_curve(x, depth, color, "", 1.4, grid.label_of_point(row))
    p.fit_y_axis([curve.y for curve in p.curves], pad=0.05)
    end = float(p.curves[0].x[-1])
    return plot.svg_figure([p], (0.0, end), "x [m]", "The lowest point of the rope over all positions.", wide=True)


def line_grid_sections(
    folder: Path, table_columns: Callable[[Sequence[Row], Mapping[str, str]], Columns] = rest_table_columns
) -> list[Section]:
    """The page of a grid of lines in a folder."""
    grid = StoredGrid.read(folder)
    rows = grid.rows
    html = [grid_table(rows, table_columns(rows, grid.keys))]
    if any(grid.paths):
        html.append(_lowest_point_path_figure(grid))
    incomplete = sum(row["status"] != "complete" for row in rows)
    text = f"{len(rows)} lines, {incomplete} incomplete."
    return [Section(folder.name, "All of them", Markup("\n").join(html), worst_verdict(rows), text)]
