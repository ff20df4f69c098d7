"""Pages of the work-precision chart, drawn from chart.json alone."""

import math
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from matplotlib.transforms import Bbox

from validation.commands.chart.front import OURS, Row, best_of, front
from validation.core import store
from validation.core.methods import METHODS
from validation.page import page
from validation.page.figures import DASHES, MARKERS, PALETTE, panels, style
from validation.page.page import Section, figure, gallery, listed, number, percent, plain, table
from validation.page.plot import BLACK, GREY

_SAY = page.words(__package__)

WORK = {"seconds": "seconds of the time loop, one core", "unknown_steps": "steps × unknowns"}


def sections(folder: Path) -> list[Section]:
    chart = store.read(folder / "chart.json")
    charts = _charts(chart, "path"), _charts(chart, "tension")
    return [_fastest(chart), *charts, _work(chart), _failures(chart), _cost(chart)]


def _error(chart: dict[str, Any], quantity: str) -> str:
    """What is plotted as error, in words."""
    if quantity == "tension":
        return "rms error of the tension / H"
    return "distance of the rider / (length / 10)" if _free(chart) else "error of the mass path / deflection"


def _free(chart: dict[str, Any]) -> bool:
    return chart.get("drive") == "free"


def _fastest(chart: dict[str, Any]) -> Section:
    at_errors, reference = chart.get("fastest", []), chart["reference"]
    heads = {"error": "error", "series": "mass path: fastest here", "seconds": "its seconds"}
    heads |= {name: f"{name} takes" for at in at_errors for name in at["peers"]}
    heads |= {"tension": "tension: fastest here", "tension_seconds": "its seconds"}
    told = {key: _told(reference[key]) for key in ("settings", "witness_settings")}
    of = "a tenth of the length" if _free(chart) else "the largest deflection"
    text = _SAY.reference(
        reference | told, reference.get("path_error"), reference.get("witness_path"), of, _free(chart)
    )
    said = ", ".join(
        f"{percent(a['error'])}: {a['series']} in {_seconds(a['seconds'])}" for a in at_errors if a["series"]
    )
    return Section(
        "chart-fastest", "Fastest for a given error",
        table([_at(at) for at in at_errors], heads, stack=True) + Markup(text), None,
        f"Fastest to a path error of {said}." if said else "No method reaches the charted errors.",
    )  # fmt: skip


def _at(at: dict[str, Any]) -> Row:
    """The row of one error: the fastest method, its seconds, and those of other codes."""
    tension, none = at["tension"], "none reaches it"
    row = {"error": percent(at["error"]), "series": at["series"] or none, "seconds": _seconds(at["seconds"])}
    row |= {"tension": tension["series"] or none, "tension_seconds": _seconds(tension["seconds"])}
    return row | {name: _takes(peer) for name, peer in at["peers"].items()}


def _takes(peer: dict[str, Any]) -> str:
    if peer["ratio"] is None:
        return peer["reason"] or _seconds(peer["seconds"])
    return f"{number(peer['ratio'], 2)} times as long ({_seconds(peer['seconds'])})"


def _seconds(x: float | None) -> str:
    if x is None or not math.isfinite(x):
        return "–"
    return f"{number(1e3 * x, 2)} ms" if x < 1.0 else f"{number(x, 2)} s"


def _told(settings: dict[str, Any]) -> str:
    return ", ".join(f"{k} {v}" for k, v in settings.items())


def _group(r: Row) -> str:
    """The title of the chart that shows a row: each has few enough lines."""
    if r["kind"] != "method":
        known = {"integrator": "integration in time", "model": "cheaper models"}
        return known.get(r["kind"], "by tolerance, and other codes")
    wing = METHODS[r["method"]].wing
    if wing == "elements":
        return "elements, fixed mesh" if "fixed" in r["series"] else "elements"
    return "Galerkin" if wing == "galerkin" else "other methods"


def _charts(chart: dict[str, Any], quantity: str) -> Section:
    what = {"path": "mass path", "tension": "tension"}[quantity]
    names = ", ".join(dict.fromkeys(r["series"] for r in front(chart["rows"], quantity)))
    return Section(
        f"chart-{quantity}", f"Speed against accuracy: {what}",
        Markup(_SAY.legend()) + _drawn(chart, quantity, "seconds"), None,
        f"Best of all for the {what}, from quick to exact: {names}." if names else f"No run gave the {what}.",
    )  # fmt: skip


def _work(chart: dict[str, Any]) -> Section:
    found = "The same errors against steps times unknowns, which do not depend on the machine."
    return Section("chart-work", "Countable work", _drawn(chart, "path", "unknown_steps"), None, found)


def _drawn(chart: dict[str, Any], quantity: str, work: str) -> Markup:
    """Charts of all groups; countable work for our own solvers."""
    groups: dict[str, dict[str, list[Row]]] = {}
    for r in _dots(chart, quantity, work):
        if work == "seconds" or r["kind"] in OURS:
            groups.setdefault(_group(r), {}).setdefault(r["series"], []).append(r)
    return gallery(*(
        figure(draw(chart, quantity, work, title, lines), f"{title.capitalize()}: {_error(chart, quantity)}")
        for title, lines in groups.items()
    ))  # fmt: skip


def _dots(chart: dict[str, Any], quantity: str, work: str) -> list[Row]:
    """The rows drawn as dots."""
    return [r for r in chart["rows"] if r["status"] == "ok" and r[f"{quantity}_error"] and r[work]]


@style()
def draw(chart: dict[str, Any], quantity: str, work: str, title: str, lines: dict[str, list[Row]]) -> Figure:
    """Draw a work-precision chart, logarithmic, in the same frame for all of a page."""
    error = f"{quantity}_error"
    fig, ax = panels(height=4.4)
    dots = _dots(chart, quantity, work)
    best = front(dots, quantity, work)
    ax.plot(*_columns(best, work, error), color="#c8c8c8", linewidth=6.0, solid_capstyle="round", zorder=1)
    ends: list[tuple[Row, str, int]] = []
    for i, (name, rows) in enumerate(lines.items()):
        colour, marker, dash = PALETTE[i % len(PALETTE)], MARKERS[i % len(MARKERS)], DASHES[i % len(DASHES)]
        ax.plot(*_columns(rows, work, error), marker, color=colour, alpha=0.25, markersize=3.5, zorder=2)
        best = best_of(rows, quantity, work)
        ax.plot(*_columns(best, work, error), marker=marker, color=colour, linestyle=dash, label=name, zorder=3)
        ends += [(best[k], colour, 1 if k == 0 else -1) for k in dict.fromkeys((0, len(best) - 1))]
    _frame(ax, [r[work] for r in dots], [r[error] for r in dots], chart["reference"].get(error))
    ax.set(title=title, xlabel=WORK[work], ylabel=_error(chart, quantity))
    fig.legend(loc="outside lower center", ncols=2)
    fig.draw_without_rendering()
    taken: list[Bbox] = []
    for row, colour, up in ends:
        _label(ax, _short(row), (row[work], row[error]), colour, up, taken)
    return fig


def _frame(ax: Axes, work: list[float], errors: list[float], floor: float | None) -> None:
    """Set the axes for the page; grey: below the reference's error."""
    ax.set(xscale="log", yscale="log", xlim=(0.4 * min(work), 3.0 * max(work)))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())
    if floor:
        ax.axhspan(1e-12, floor, color=GREY, alpha=0.18, linewidth=0)
    ax.set_ylim(0.5 * min(*errors, 1.5 * (floor or math.inf)), 2.0 * min(max(errors), 3.0))


def _columns(rows: Sequence[Row], *names: str) -> list[list[float]]:
    return [[row[name] for row in rows] for name in names]


def _short(row: Row) -> str:
    """Settings at a dot: resolution · steps, or the tolerance."""
    settings = row["settings"]
    if "tol" in settings:
        return f"tol {settings['tol']:g}"
    return " · ".join(str(v) for v in settings.values() if not isinstance(v, str))


def _label(ax: Axes, text: str, at: tuple[float, float], colour: str, up: int, taken: list[Bbox]) -> None:
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


def _failures(chart: dict[str, Any]) -> Section:
    """The runs without a dot: one row per line of the chart and status."""
    grouped: dict[tuple[str, str], list[Row]] = {}
    for r in chart["rows"]:
        if r["status"] != "ok":
            grouped.setdefault((r["series"], r["status"]), []).append(r)
    rows = [
        {"line": name, "status": status, "reason": those[0]["reason"],
         "settings": "; ".join(_told(r["settings"]) for r in those) or "–"}
        for (name, status), those in grouped.items()
    ]  # fmt: skip
    bad = [r["status"] for r in chart["rows"] if r["status"] != "ok"]
    failed = bad.count("failed")
    html = table(rows, ("line", "status", "settings", "reason"), stack=True) if rows else "<p>None.</p>"
    return Section(
        "chart-failed", "Runs that gave no dot", html, None,
        f"{failed} runs failed; {len(bad) - failed} were not run, for time or because a code is not installed.",
    )  # fmt: skip


def _cost(chart: dict[str, Any]) -> Section:
    rows = [r for r in chart["rows"] if r["status"] == "ok"]
    floor = chart.get("floor")
    html = [Markup(_SAY.floor(floor))] if floor else []
    if chosen := [r for r in rows if r["kind"] == "tolerance"]:
        html.append(_tolerances(chosen))
    html.append(page.details(f"All {len(rows)} dots", _all(rows)))
    machine = ", ".join(f"{k} {v}" for k, v in chart.get("machine", {}).items())
    html.append(Markup("<p><small>{}</small></p>").format(escape(machine)))
    said = plain(_SAY.iteration(floor)) if floor else "Work and seconds of every dot."
    return Section("chart-cost", "What a step costs", Markup("\n").join(html), None, said)


def _tolerances(rows: list[Row]) -> Markup:
    return listed(
        rows,
        {
            "method": lambda r: r["method"], "asked": lambda r: percent(r["settings"]["tol"]),
            "chosen": lambda r: _told(r["chosen"]), "stated error bar": lambda r: percent(r["bar"]),
            "true error": lambda r: percent(r["path_error"]),
            "seconds, all trial runs included": lambda r: _seconds(r["seconds"]),
        },
        caption="A tolerance instead of a resolution", stack=True,
    )  # fmt: skip


def _all(rows: list[Row]) -> Markup:
    return listed(rows, {
        "line": lambda r: r["series"], "settings": lambda r: _told(r["settings"]),
        "path error": lambda r: percent(r["path_error"]), "tension error": lambda r: percent(r["tension_error"]),
        "best of repeats": lambda r: _seconds(r["seconds"]),
        "slowest / best": lambda r: None if not r["spread"] else f"{r['spread']:.2f}",
        "unknowns": lambda r: r["n_dof"], "steps": lambda r: r["steps"],
        "Newton iterations": lambda r: r["newton_iterations"], "factorisations": lambda r: r["factorisations"],
    })  # fmt: skip
