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
    return render_sections(
        __package__, chart=chart, free=chart.get("drive") == "free", fastest=chart.get("fastest", []),
        front=our_pareto_rows, charts=partial(_work_precision_charts, chart), without_dot=_failed_rows_by_series(chart),
    )  # fmt: skip


def _error_label(chart: dict[str, Any], quantity: str) -> str:
    if quantity == "tension":
        return "rms error of the tension / H"
    free = chart.get("drive") == "free"
    return "distance of the rider / (length / 10)" if free else "error of the mass path / deflection"


def _chart_title(r: Row) -> str:
    """The title of the chart that shows a row: each has few enough lines."""
    if r["kind"] != "method":
        known = {"integrator": "integration in time", "model": "cheaper models"}
        return known.get(r["kind"], "by tolerance, and other codes")
    wing = METHODS[r["method"]].wing
    if wing == "elements":
        return "elements, fixed mesh" if "fixed" in r["series"] else "elements"
    return "Galerkin" if wing == "galerkin" else "other methods"


def _work_precision_charts(chart: dict[str, Any], quantity: str, work: str) -> Iterator[Markup]:
    """Figures, each with few enough lines; over unknowns those of our own methods alone."""
    groups: dict[str, dict[str, list[Row]]] = {}
    for r in _rows_with_dots(chart, quantity, work):
        if work == "seconds" or r["kind"] in OURS:
            groups.setdefault(_chart_title(r), {}).setdefault(r["series"], []).append(r)
    for title, lines in groups.items():
        yield captioned_figure(
            draw_work_precision(chart, quantity, work, title, lines),
            f"{title.capitalize()}: {_error_label(chart, quantity)}",
        )


def _rows_with_dots(chart: dict[str, Any], quantity: str, work: str) -> list[Row]:
    return [r for r in chart["rows"] if r["status"] == "ok" and r[f"{quantity}_error"] and r[work]]


@report_style()
def draw_work_precision(
    chart: dict[str, Any], quantity: str, work: str, title: str, lines: dict[str, list[Row]]
) -> Figure:
    """Draw a work-precision chart, logarithmic, in the same frame for all of a page."""
    error = f"{quantity}_error"
    fig, ax = figure_with_axes(height=4.4)
    dots = _rows_with_dots(chart, quantity, work)
    best = our_pareto_rows(dots, quantity, work)
    ax.plot(*_columns(best, work, error), color="#c8c8c8", linewidth=6.0, solid_capstyle="round", zorder=1)
    ends: list[tuple[Row, str, int]] = []
    for i, (name, rows) in enumerate(lines.items()):
        colour = PALETTE[i % len(PALETTE)]
        marker = MARKERS[i % len(MARKERS)]
        dash = DASHES[i % len(DASHES)]
        ax.plot(*_columns(rows, work, error), marker, color=colour, alpha=0.25, markersize=3.5, zorder=2)
        best = pareto_rows(rows, quantity, work)
        ax.plot(*_columns(best, work, error), marker=marker, color=colour, linestyle=dash, label=name, zorder=3)
        ends += [(best[k], colour, 1 if k == 0 else -1) for k in dict.fromkeys((0, len(best) - 1))]
    _set_axes(ax, [r[work] for r in dots], [r[error] for r in dots], chart["reference"].get(error))
    ax.set(title=title, xlabel=WORK[work], ylabel=_error_label(chart, quantity))
    fig.legend(loc="outside lower center", ncols=2)
    fig.draw_without_rendering()
    taken: list[Bbox] = []
    for row, colour, up in ends:
        _write_label(ax, _settings_text(row), (row[work], row[error]), colour, up, taken)
    return fig


def _set_axes(ax: Axes, work: list[float], errors: list[float], floor: float | None) -> None:
    """Set the axes for the page; grey: below the reference's error."""
    ax.set(xscale="log", yscale="log", xlim=(0.4 * min(work), 3.0 * max(work)))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())
    if floor:
        ax.axhspan(1e-12, floor, color=GREY, alpha=0.18, linewidth=0)
    ax.set_ylim(0.5 * min(*errors, 1.5 * (floor or math.inf)), 2.0 * min(max(errors), 3.0))


def _columns(rows: Sequence[Row], *names: str) -> list[list[float]]:
    return [[row[name] for row in rows] for name in names]


def _settings_text(row: Row) -> str:
    """Settings at a dot: resolution · steps, or the tolerance."""
    settings = row["settings"]
    if "tol" in settings:
        return f"tol {settings['tol']:g}"
    return " · ".join(str(v) for v in settings.values() if not isinstance(v, str))


def _write_label(ax: Axes, text: str, at: tuple[float, float], colour: str, up: int, taken: list[Bbox]) -> None:
    """Write a text at a dot, above or (up = -1) below, where free."""
    note = ax.annotate(
        text, at, (3, -9), textcoords="offset points", fontsize=7.0, color=BLACK, va="center",
        bbox={"boxstyle": "round,pad=0.12", "fc": "white", "ec": colour, "lw": 0.5, "alpha": 0.8}, zorder=4,
    )  # fmt: skip
    note.set_in_layout(False)
    for y, right in product((9, -9, 20, -20, 31, -31, 42, -42), (True, False)):
        note.xyann = (3 if right else -3, up * y)
        note.set_horizontalalignment("left" if right else "right")
        box = note.get_window_extent().padded(2.0)
        if all(ax.bbox.contains(*corner) for corner in (box.p0, box.p1)) and not box.count_overlaps(taken):
            break
    taken.append(box)


def _failed_rows_by_series(chart: dict[str, Any]) -> list[Row]:
    """The runs without a dot: one row per line of the chart and status."""
    grouped: dict[tuple[str, str], list[Row]] = {}
    for r in chart["rows"]:
        if r["status"] != "ok":
            grouped.setdefault((r["series"], r["status"]), []).append(r)
    return [rows[0] | {"rows": rows} for rows in grouped.values()]
