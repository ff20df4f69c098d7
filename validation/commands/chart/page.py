"""Pages of the work-precision chart."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from matplotlib.transforms import Bbox

from validation.commands.chart.front import OURS, Row, our_pareto_rows, pareto_rows
from validation.core import store
from validation.core.methods import METHODS
from validation.page.figures import DASHES, MARKERS, PALETTE, captioned_figure, figure_with_axes, report_style
from validation.page.page import Section, render_sections
from validation.page.plot import BLACK, GREY

WORK = {"seconds": "seconds of the time loop, one core", "unknown_steps": "steps × unknowns"}


def sections(folder: Path) -> list[Section]:
    chart = store.read_json(folder / "chart.json")
    content = {"chart": chart, "free": chart.get("drive") == "free", "fastest": chart.get("fastest", [])}
    content |= {"front": our_pareto_rows, "charts": partial(_work_precision_charts, chart)}
    content["without_dot"] = _one_row_per_failed_series(chart)
    return render_sections(__package__, **content)


def _error_label(chart: Row, quantity: str) -> str:
    if chart.get("drive") == "line":
        tension = "error of mean tensions / largest at the start"
        return tension if quantity == "tension" else "error of the cars' paths / deflection"
    if quantity == "tension":
        return "rms error of the tension / H"
    free = chart.get("drive") == "free"
    return "distance of the rider / (length / 10)" if free else "error of the mass path / deflection"


def _chart_title(r: Row) -> str:
    """The title of the chart that shows a row: each has few enough lines."""
    if r["kind"] != "method":
        known = {"integrator": "integration in time", "model": "cheaper models"}
        return known.get(r["kind"], "by tolerance, and other codes")
    if r["method"] not in METHODS:
        return "both solvers of lines"
    wing = METHODS[r["method"]].wing
    if wing == "elements":
        return "elements, fixed mesh" if "fixed" in r["series"] else "elements"
    return "Galerkin" if wing == "galerkin" else "other methods"


def _work_precision_charts(chart: Row, quantity: str, work: str) -> Iterator[Markup]:
    """Figures, each with few enough lines; over unknowns those of our own methods alone."""
    charts: dict[str, dict[str, list[Row]]] = {}  # rows by title and series
    for r in _rows_with_error_and_work(chart, quantity, work):
        if work == "seconds" or r["kind"] in OURS:
            rows_by_series = charts.setdefault(_chart_title(r), {})
            rows_by_series.setdefault(r["series"], []).append(r)
    for title, rows_by_series in charts.items():
        figure = draw_work_precision(chart, quantity, work, title, rows_by_series)
        yield captioned_figure(figure, f"{title.capitalize()}: {_error_label(chart, quantity)}")


def _rows_with_error_and_work(chart: Row, quantity: str, work: str) -> list[Row]:
    """The rows that are dots of a chart."""
    return [r for r in chart["rows"] if r["status"] == "ok" and r[f"{quantity}_error"] and r[work]]


@report_style()
def draw_work_precision(
    chart: Row, quantity: str, work: str, title: str, rows_by_series: dict[str, list[Row]]
) -> Figure:
    """Draw a work-precision chart, logarithmic, in the same frame for all of a page."""
    error = f"{quantity}_error"
    fig, ax = figure_with_axes(height=4.4)
    dots = _rows_with_error_and_work(chart, quantity, work)
    best = our_pareto_rows(dots, quantity, work)
    ax.plot(*_columns(best, work, error), color="#c8c8c8", linewidth=6.0, solid_capstyle="round", zorder=1)
    labels: list[tuple[Row, str, int]] = []  # dots at ends of lines, colours; 1: above the dot, -1: below it
    for i, (name, rows) in enumerate(rows_by_series.items()):
        colour = PALETTE[i % len(PALETTE)]
        marker = MARKERS[i % len(MARKERS)]
        dash = DASHES[i % len(DASHES)]
        ax.plot(*_columns(rows, work, error), marker, color=colour, alpha=0.25, markersize=3.5, zorder=2)
        best = pareto_rows(rows, quantity, work)
        ax.plot(*_columns(best, work, error), marker=marker, color=colour, linestyle=dash, label=name, zorder=3)
        labels.append((best[0], colour, 1))
        if len(best) > 1:
            labels.append((best[-1], colour, -1))
    all_work, all_errors = _columns(dots, work, error)
    _set_axes(ax, all_work, all_errors, floor=chart["reference"].get(error))
    ax.set(title=title, xlabel=WORK[work], ylabel=_error_label(chart, quantity))
    fig.legend(loc="outside lower center", ncols=2)
    fig.draw_without_rendering()
    taken: list[Bbox] = []
    for row, colour, side in labels:
        taken.append(_write_settings(ax, row, (row[work], row[error]), colour, side, taken))
    return fig


def _set_axes(ax: Axes, work: list[float], errors: list[float], floor: float | None) -> None:
    """Set the axes for the page; grey: below the reference's error."""
    ax.set(xscale="log", yscale="log", xlim=(0.4 * min(work), 3.0 * max(work)))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())
    if floor:
        ax.axhspan(1e-12, floor, color=GREY, alpha=0.18, linewidth=0)
    bottom = min(*errors, 1.5 * (floor or math.inf))
    top = min(max(errors), 3.0)
    ax.set_ylim(0.5 * bottom, 2.0 * top)


def _columns(rows: Sequence[Row], *names: str) -> list[list[float]]:
    return [[row[name] for row in rows] for name in names]


def _settings_text(row: Row) -> str:
    """Settings at a dot: resolution · steps, or the tolerance."""
    settings = row["settings"]
    if "tol" in settings:
        return f"tol {settings['tol']:g}"
    return " · ".join(str(v) for v in settings.values() if not isinstance(v, str))


def _write_settings(ax: Axes, row: Row, dot: tuple[float, float], colour: str, side: int, taken: list[Bbox]) -> Bbox:
    """Write the settings of a row at its dot where no taken box is; return its own box."""
    frame = {"boxstyle": "round,pad=0.12", "fc": "white", "ec": colour, "lw": 0.5, "alpha": 0.8}
    look: dict[str, Any] = {"fontsize": 7.0, "color": BLACK, "va": "center", "bbox": frame, "zorder": 4}
    note = ax.annotate(_settings_text(row), dot, (3, -9), textcoords="offset points", **look)
    note.set_in_layout(False)
    for y, right in product((9, -9, 20, -20, 31, -31, 42, -42), (True, False)):
        note.xyann = (3 if right else -3, side * y)
        note.set_horizontalalignment("left" if right else "right")
        box = note.get_window_extent().padded(2.0)
        inside = ax.bbox.contains(*box.p0) and ax.bbox.contains(*box.p1)
        if inside and not box.count_overlaps(taken):
            break
    return box


def _one_row_per_failed_series(chart: Row) -> list[Row]:
    """The runs without a dot: one row per line of the chart and status."""
    grouped: dict[tuple[str, str], list[Row]] = {}
    for r in chart["rows"]:
        if r["status"] != "ok":
            grouped.setdefault((r["series"], r["status"]), []).append(r)
    return [rows[0] | {"rows": rows} for rows in grouped.values()]
