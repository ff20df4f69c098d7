"""Pages about where methods fail: maps and the failure catalogue."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from matplotlib.patches import Patch

from validation.core import store
from validation.page.figures import captioned_figure, figure_with_axes, report_style
from validation.page.page import Section, render_sections
from validation.page.plot import BLUE, GREY

Map = dict[str, Any]
Cell = dict[str, Any]
MAPS = store.read_packaged_toml(__package__, "maps.toml")
CLASSES: dict[str, tuple[str, str, str]] = MAPS["classes"]
CAUSES: dict[str, tuple[str, str, str, str]] = MAPS["causes"]


def sections(folder: Path) -> list[Section]:
    atlas = store.read_json(folder / "atlas.json")
    maps = [_map_with_figures_and_counts(m, atlas["cells"]) for m in atlas["maps"]]
    return render_sections(__package__, maps=maps, catalogue=atlas["catalogue"])


def _map_with_figures_and_counts(m: Map, all_cells: list[Cell]) -> Map:
    """A map with its figures, its cells by class, and these by method."""
    cells = {(c["method"], c["x"], c["y"]): c for c in all_cells if c["map"] == m["name"]}
    classes = [name for name in CLASSES if name != "not computed"]
    rows = []
    for method in m["methods"]:
        of_method = Counter(cell["class"] for cell in cells.values() if cell["method"] == method)
        rows.append({"method": method} | {name: of_method[name] for name in classes})
    counts = {name: sum(row[name] for row in rows) for name in classes}
    figures = [_draw_map(m, method, cells) for method in m["methods"]]
    return m | {"figures": figures, "counts": counts, "rows": rows}


def _draw_map(m: Map, method: str, cells: dict[Any, Cell]) -> Markup:
    """The figure of a method's cells on a map; cells : by method, x and y."""
    xs = m["x"]["values"]
    ys = m["y"]["values"]
    counts: Counter[str] = Counter()
    causes: set[str | None] = set()
    fig, ax = figure_with_axes(height=3.6)
    with report_style():
        for i, x in enumerate(xs):
            for j, y in enumerate(ys):
                cell = cells.get((method, x, y), UNKNOWN)
                counts[cell["class"]] += 1
                causes.add(cell["cause"])
                _draw_cell(ax, i, j, cell)
        shown = [name for name in CLASSES if counts[name]]
        _draw_theory_curves(ax, m)
        _set_axes(ax, m)
        ax.set_title(method)
        curves, _ = ax.get_legend_handles_labels()
        handles = [*_legend_patches(shown, causes), *curves]
        fig.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=7.5)
    tally = ", ".join(f"{counts[name]} {name}" for name in shown)
    return captioned_figure(fig, escape(f"{m['title']}: {method}"), label=f"Map of {method}: {tally}")


UNKNOWN = {"class": "not computed", "cause": None}


def _set_axes(ax: Any, m: Map) -> None:
    """Label the numbered cells with the values of the map, and the axes with their names."""
    x = [f"{value:g}" for value in m["x"]["values"]]
    y = [f"{value:g}" for value in m["y"]["values"]]
    ax.set_xticks(range(len(x)), x, rotation=45)
    ax.set_yticks(range(len(y)), y)
    ax.set_xlim(-0.5, len(x) - 0.5)
    ax.set_ylim(-0.5, len(y) - 0.5)
    names = MAPS["names"]
    ax.set_xlabel(names.get(m["x"]["name"], m["x"]["name"]))
    ax.set_ylabel(names.get(m["y"]["name"], m["y"]["name"]))
    ax.grid(False)


def _legend_patches(classes: list[str], causes: set[str | None]) -> list[Patch]:
    patches = []
    for name in classes:
        colour, hatch, words = CLASSES[name]
        patches.append(Patch(facecolor=colour, hatch=hatch, edgecolor=GREY, label=words))
    for cause, (letter, badge, _, words) in CAUSES.items():
        if cause in causes:
            patches.append(Patch(facecolor=badge, edgecolor=GREY, label=f"{letter}: {words}"))
    return patches


def _draw_cell(ax: Any, i: int, j: int, cell: Cell) -> None:
    """Draw a cell in the colour of its class, with the letter of its cause and how far the run came."""
    colour, hatch, _ = CLASSES[cell["class"]]
    look = {"facecolor": colour, "hatch": hatch, "edgecolor": "white", "linewidth": 0.5}
    ax.fill_between([i - 0.5, i + 0.5], j - 0.5, j + 0.5, **look)
    cause = cell["cause"]
    if cause is not None:
        letter, badge, ink, _ = CAUSES[cause]
        reached = cell["reached"]
        if reached is not None and reached < 0.995 and cause != "too coarse":
            letter += f"\n{reached:.2f}"
        box = {"facecolor": badge, "edgecolor": "white", "linewidth": 0.5, "pad": 1.2}
        ax.text(i, j, letter, ha="center", va="center", fontsize=7.5, color=ink, bbox=box)


def _fractional_cell_number(values: list[float], x: Any) -> Any:
    """Number of the cell where an axis with these values reaches x, interpolated by logarithms; nan outside."""
    numbers = np.arange(len(values))
    return np.interp(np.log(x), np.log(values), numbers, left=np.nan, right=np.nan)


def _draw_theory_curves(ax: Any, m: Map) -> None:
    """Draw the wave speed on the map of speed and mass, Irvine's crossover on that of sag and stiffness."""
    xs = m["x"]["values"]
    ys = m["y"]["values"]
    if m["name"] == "speed-mass":
        ax.axvline(_fractional_cell_number(xs, 1.0), color=BLUE, linestyle="--", label="V = wave speed")
    elif m["name"] == "sag-stiffness":
        # L^2 = sigma^2 alpha = 4 pi^2, sigma = 8 sag/span for a flat parabola
        sag = np.geomspace(xs[0], xs[-1], 200)
        alpha = 4.0 * np.pi**2 / (8.0 * sag) ** 2
        inside = (alpha >= ys[0]) & (alpha <= ys[-1])
        x = _fractional_cell_number(xs, sag[inside])
        y = _fractional_cell_number(ys, alpha[inside])
        ax.plot(x, y, color=BLUE, linestyle="--", label="Irvine $L^2=4π^2$")
