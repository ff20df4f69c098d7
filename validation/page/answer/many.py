"""Many answers: a table with one row per point of a grid, all paths from the side, their speeds."""

import csv
import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from cablefem.response import Array, Response, atomic_write, write_json, write_text
from cablefem.scene import Scene
from validation.core import limits, store
from validation.core.answers import crosswind_load_factor, outcome_of_run
from validation.core.quantities import factor_and_prefixed_unit, quantity_words
from validation.core.sidebyside import map_in_parallel
from validation.page import plot, report, terminal
from validation.page.options import GridPoint, changes_and_settings
from validation.page.page import Row, Section, details, gallery, html_table, read_asset, versions_footer
from validation.page.plot import Panel
from validation.page.scene_keys import scene_keys_table
from validation.page.side_view import at_most_300_indices, six_digits

DASHES = ("", plot.DASHED, plot.DOTTED, "8 3 2 3")  # one for each value of the keys after the first
POSITIONS = ("rests_at_m", "farthest_m")
LIMITS = ("limits_met", "limits_worst")
_WORDS = tomllib.loads(read_asset("grid.toml"))
HEADS: dict[str, str] = _WORDS["heads"]
ENDS: dict[str, str] = _WORDS["outcomes"]
# columns of a table of runs
NUMBERS = ("tension_max", "safety_factor_min", "haul_force_max", "clearance_rope_min", "clearance_car_min")


@dataclass(frozen=True, slots=True)
class Column:
    """How a column of a grid's table is written."""

    head: str
    factor: float = 1.0
    spec: str = "#.4g"

    def cell_text(self, value: Any) -> str:
        """Text of a value; a dash for a missing one."""
        if value is None:
            return "-"
        if isinstance(value, bool | str | list):
            return str(value)
        if abs(value) < 1e-9:  # rounding
            return "0"
        return format(self.factor * value, self.spec).rstrip(".")


Columns = dict[str, Column]  # by the key of their values
AnswerPoint = Callable[[GridPoint], tuple[Row, Any]]  # row of the table, and path


class StoredGrid(NamedTuple):
    """What grid.json holds."""

    keys: dict[str, str]  # varied, in the order of the options, and what heads their columns
    rows: list[Row]  # one per point
    paths: list[Any]  # one per point, None where there is none

    @classmethod
    def read(cls, folder: Path) -> "StoredGrid":
        stored = store.read_json(folder / "grid.json")
        return cls(stored["keys"], stored["rows"], stored["paths"])

    def label_of_point(self, row: Row) -> str:
        """Its varied values."""
        columns = key_columns(self.keys)
        return ", ".join(f"{key.split('.')[-1]} {column.cell_text(row[key])}" for key, column in columns.items())


def answer_table_row(scene: Scene, r: Response, verdict: str | None = None) -> Row:
    """The table's row of one answer; SI, speeds in km/h."""
    end = outcome_of_run(scene, r)
    out: Row = {"outcome_kind": end.kind, "outcome": end.sentence, "duration_s": round(float(r.t[-1]), 3)}
    if r.drive == "free":
        arrival = limits.first_brake_or_arrival(r.events)
        out["brake_or_arrival_km_h"] = None if arrival is None else 3.6 * arrival["speed"]
        rests = end.kind in ("stuck", "stopped_by_brake")
        stops = [e["s_o"] for e in r.events if e["event"] == "stop"]
        out["rests_at_m"] = stops[-1] if rests else None
        out["farthest_m"] = float(r.s_o.max())
    out |= _worst_table_numbers(r.design)
    out |= limits.worst_limit_columns(limits.limit_rows(scene, r.design, r.events))
    crosswind = crosswind_load_factor(scene)
    if crosswind is not None:
        out["crosswind_load"] = crosswind
    if verdict is not None:
        out["verdict"] = verdict
    return out


def _worst_table_numbers(design: Sequence[Row]) -> Row:
    """The table's design numbers; of several obstacles the worst."""
    out: Row = {}
    for kind in NUMBERS:
        values = [d["value"] for d in design if d["quantity"].split(":")[0] == kind and d["value"] is not None]
        if values:
            out[kind] = max(values) if kind.endswith("max") else min(values)
    return out


def sparse_path_columns(r: Response) -> dict[str, list[float]]:
    """Columns of the path at 300 times at most, to six digits."""
    columns = {"t": r.t, "s_o": r.s_o, "x": r.x, "y": r.y, "kmh": 3.6 * r.speed}
    return {name: six_digits(values[at_most_300_indices(r.t.size)]) for name, values in columns.items()}


def answer_and_store_grid(
    command: str, subfolder: str, scene: Any, points: Sequence[GridPoint], out: Path | None, answer_point: AnswerPoint,
    table_columns: Callable[[list[Row], dict[str, str]], Columns],
) -> list[Row]:  # fmt: skip
    """Answer every point of a grid by a row and its path; store, draw, print and return the rows.

    Writes table.csv, grid.json and scene.toml to `subfolder` of the command's results.  Raises KeyboardInterrupt after
    that where Ctrl-C left points out.
    """
    from cablefem.scene.keys import unit_of_key  # slow to import

    keys = {key: f"{key} [{unit_of_key(type(scene), key)}]".removesuffix(" []") for key in points[0].values}
    folder = store.claim_and_clear_folder(out, command, scene, [subfolder])
    answers = _answer_in_parallel(points, answer_point)
    rows = []
    for i, (row, _) in answers.items():
        values = {key: store.nulls_for_nonfinite(value) for key, value in points[i].values.items()}
        rows.append(values | row)
    grid = StoredGrid(keys, rows, [path for _, path in answers.values()])
    home = folder / subfolder
    write_csv_rows(home / "table.csv", rows)
    write_json(home / "grid.json", grid._asdict())
    write_text(home / "scene.toml", scene.to_toml())
    report.write_report_and_mark_finished(folder, command)
    _print_grid_table(rows, table_columns(rows, keys))
    terminal.print_text(f"  written to {folder}: report.html, {subfolder}/table.csv")
    if len(rows) < len(points):
        raise KeyboardInterrupt(
            f"{len(rows)} of {len(points)} scenes were computed and are written; the same command begins again"
        )
    return rows


def key_columns(keys: Mapping[str, str]) -> Columns:
    """The columns of varied values, as they were given."""
    return {key: Column(head, spec=".10g") for key, head in keys.items()}


def _answer_in_parallel(points: Sequence[GridPoint], answer_point: AnswerPoint) -> dict[int, tuple[Row, Any]]:
    """Answers by the number of the point, with a bar of progress; after Ctrl-C those that there are, if any."""
    answers: dict[int, tuple[Row, Any]] = {}
    many = 50  # scenes: of more the number is said before they start
    if len(points) > many:
        terminal.print_text(f"{len(points)} scenes")
    with terminal.progress_bars() as progress:

        def on_result(i: int, answer: tuple[Row, Any]) -> None:
            answers[i] = answer
            progress("grid", len(answers) / len(points))

        try:
            map_in_parallel(answer_point, points, on_result)
        except KeyboardInterrupt:
            if not answers:
                raise
    return dict(sorted(answers.items()))


def write_csv_rows(file: Path, rows: Sequence[Row]) -> None:
    """Write a CSV with all columns of all rows, empty where a row has none."""
    with atomic_write(file) as temporary, temporary.open("w", encoding="utf-8", newline="") as out:
        names = dict.fromkeys(name for row in rows for name in row)
        writer = csv.DictWriter(out, list(names), restval="")
        writer.writeheader()
        writer.writerows(rows)


def _print_grid_table(rows: list[Row], columns: Columns) -> None:
    heads = [column.head for column in columns.values()]
    cells = []
    numeric = set()
    for row in rows:
        cells.append([column.cell_text(row.get(name)) for name, column in columns.items()])
        numeric |= {column.head for name, column in columns.items() if isinstance(row.get(name), int | float)}
    terminal.print_table(heads, cells, right=list(numeric))


def run_table_columns(rows: list[Row], keys: Mapping[str, str]) -> Columns:
    """Columns of a table of runs: varied values, outcomes, common numbers, verdicts."""
    out = key_columns(keys)
    for name in ("outcome", "brake_or_arrival_km_h", *POSITIONS, *NUMBERS, "crosswind_load", *LIMITS, "verdict"):
        values = [x[name] for x in rows if x.get(name) is not None]
        if not values:
            continue
        if name.startswith(("tension", "haul")):
            factor, unit = factor_and_prefixed_unit(np.array(values), "N")
            out[name] = Column(f"{quantity_words(name)} [{unit}]", factor)
        elif name in POSITIONS:
            out[name] = Column(HEADS[name], spec=".1f")  # as outcomes say them
        else:
            out[name] = Column(HEADS.get(name) or quantity_words(name))
    return out


def grid_table(rows: list[Row], columns: Columns) -> Markup:
    """A grid's table; on a phone a block begins with the first column's head and value."""
    heading_on_phone = next(iter(columns.values())).head
    label = Markup('<span class="phone">{} </span>{}')
    blocks = []
    for row in rows:
        cells = {c.head: c.cell_text(row.get(name)).replace("-", "−") for name, c in columns.items()}
        cells[heading_on_phone] = label.format(heading_on_phone, cells[heading_on_phone])
        blocks.append(cells)
    return html_table(blocks, [c.head for c in columns.values()], stack=True)


def run_grid_sections(folder: Path) -> list[Section]:
    """The page of the grid of runs in a folder."""
    grid = StoredGrid.read(folder)
    rows = grid.rows
    keys = grid.keys
    scene = Scene.from_toml((folder / "scene.toml").read_text(encoding="utf-8"))
    html = [grid_table(rows, run_table_columns(rows, keys))]
    scenes = []
    for row in rows:
        changes, _ = changes_and_settings(scene, {key: row[key] for key in keys})
        scenes.append(scene.replace(changes))
    html.append(gallery(_side_view_figure(scenes, grid), _speed_over_position_figure(grid)))
    html.append(details("What is the same in all of them", scene_keys_table(scene.to_toml(), without=keys)))
    html.append(versions_footer())
    kinds = [x["outcome_kind"] for x in rows]
    summary = ", ".join(f"{kinds.count(kind)} of {len(rows)} {ENDS[kind]}" for kind in dict.fromkeys(kinds))
    return [Section("grid", "All of them", Markup("\n").join(html), None, f"{summary}.")]


def _colours_and_dashes(grid: StoredGrid) -> list[tuple[str, str]]:
    """Colour and dash of each row, by the first key and by the others."""
    first, *others = grid.keys
    looks = []
    colours = _indices_by_first_appearance([json.dumps(row[first]) for row in grid.rows])
    dashes = _indices_by_first_appearance([json.dumps([row[key] for key in others]) for row in grid.rows])
    for i, j in zip(colours, dashes, strict=True):
        looks.append((plot.COLORS[i % len(plot.COLORS)], DASHES[j % len(DASHES)]))
    return looks


def _indices_by_first_appearance(values: Sequence[str]) -> list[int]:
    """Indices of the values in the order of their first appearance."""
    order = list(dict.fromkeys(values))
    return [order.index(value) for value in values]


def _add_path_curves(panel: Panel, grid: StoredGrid, x_column: str, y_column: str) -> None:
    for path, row, look in zip(grid.paths, grid.rows, _colours_and_dashes(grid), strict=True):
        if path:
            x = np.array(path[x_column])
            y = np.array(path[y_column])
            panel.add_curve(x, y, *look, 1.6, grid.label_of_point(row))


def _distinct_empty_ropes(scenes: Sequence[Scene]) -> list[Array]:
    """Points (2, n) of the empty ropes that differ by a millimetre: most grids have one."""
    ropes: dict[tuple[float, ...], Array] = {}
    for scene in scenes:
        s = np.linspace(0.0, scene.length, 101)
        rope = np.stack([scene.catenary.x(s), scene.catenary.y(s)])
        ropes.setdefault(tuple(rope.ravel().round(3).tolist()), rope)
    return list(ropes.values())


def _side_view_figure(scenes: Sequence[Scene], grid: StoredGrid) -> Markup:
    """Empty ropes, paths, grounds and obstacles of the scenes of all rows from the side."""
    span = max(scene.supports.span for scene in scenes)
    ropes = _distinct_empty_ropes(scenes)
    lowest_of_cars = []
    for scene, path in zip(scenes, grid.paths, strict=True):
        if path:
            lowest_of_cars.append(np.array(path["y"]) + (scene.mass.below if scene.mass else 0.0))
    grounds = [np.array(ground) for ground in dict.fromkeys(scene.ground for scene in scenes) if ground]
    obstacles = dict.fromkeys(obstacle for scene in scenes for obstacle in scene.obstacle)
    depths = [*(y for _, y in ropes), *lowest_of_cars]
    p, caption = plot.side_view_panel(depths, span, grounds, obstacles, pad=0.05)
    p.title = "path of the car"
    for x, y in ropes:
        p.add_curve(x, y, plot.GREY, plot.DOTTED, 1.2, "empty rope at rest")
    _add_path_curves(p, grid, "x", "y")
    return plot.svg_figure([p], (0.0, span), "x [m]", caption)


def _speed_over_position_figure(grid: StoredGrid) -> Markup:
    p = Panel("[km/h]", "speed", 180.0)
    _add_path_curves(p, grid, "s_o", "kmh")
    p.fit_y_axis([np.zeros(1), *(curve.y for curve in p.curves)])
    end = max((max(path["s_o"]) for path in grid.paths if path), default=1.0)
    return plot.svg_figure([p], (0.0, end), "metres along the rope", "Speed of the car along the rope.")
