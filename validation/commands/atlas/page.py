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

MAPS = store.read_packaged_toml(__package__, "maps.toml")
CLASSES: dict[str, tuple[str, str, str]] = MAPS["classes"]
CAUSES: dict[str, tuple[str, str, str, str]] = MAPS["causes"]


def sections(folder: Path) -> list[Section]:
    atlas = store.read_json(folder / "atlas.json")
    return render_sections(
        __package__, maps=[_map_content(atlas, m) for m in atlas["maps"]], catalogue=atlas["catalogue"]
    )


def _map_content(atlas: dict[str, Any], m: dict[str, Any]) -> dict[str, Any]:
    """A map with its figures, its cells by class, and these by method."""
    cells = {(c["method"], c["x"], c["y"]): c for c in atlas["cells"] if c["map"] == m["name"]}
    classes = [name for name in CLASSES if name != "not computed"]
    counts = Counter(cell["class"] for cell in cells.values())
    rows = []
    for method in m["methods"]:
        count = Counter(cell["class"] for cell in cells.values() if cell["method"] == method)
        rows.append({"method": method} | {name: count[name] for name in classes})
    figures = [_draw_map(m, method, cells) for method in m["methods"]]
    return m | {"figures": figures, "counts": {name: counts[name] for name in classes}, "rows": rows}


def _draw_map(m: dict[str, Any], method: str, cells: dict[Any, Any]) -> Markup:
    """The figure of a method's cells on a map; cells : by method, x and y."""
    xs = m["x"]["values"]
    ys = m["y"]["values"]
    grid = {(i, j): cells.get((method, x, y), UNKNOWN) for i, x in enumerate(xs) for j, y in enumerate(ys)}
    counts = Counter(cell["class"] for cell in grid.values())
    shown = [name for name in CLASSES if counts[name]]
    fig, ax = figure_with_axes(height=3.6)
    with report_style():
        for (i, j), cell in grid.items():
            _draw_cell(ax, i, j, cell)
        _draw_theory_curves(ax, m)
        _set_axes(ax, m)
        ax.set_title(method)
        key = _legend_patches(shown, {cell["cause"] for cell in grid.values()})
        key += ax.get_legend_handles_labels()[0]
        fig.legend(handles=key, loc="outside lower center", ncols=2, fontsize=7.5)
    tally = ", ".join(f"{counts[name]} {name}" for name in shown)
    return captioned_figure(fig, escape(f"{m['title']}: {method}"), label=f"Map of {method}: {tally}")


UNKNOWN = {"class": "not computed", "cause": None}


def _set_axes(ax: Any, m: dict[str, Any]) -> None:
    xs, ys = ([f"{value:g}" for value in m[axis]["values"]] for axis in "xy")
    ax.set_xticks(range(len(xs)), xs, rotation=45)
    ax.set_yticks(range(len(ys)), ys)
    ax.set(xlim=(-0.5, len(xs) - 0.5), ylim=(-0.5, len(ys) - 0.5))
    x, y = (m[axis]["name"] for axis in "xy")
    ax.set(xlabel=MAPS["names"].get(x, x), ylabel=MAPS["names"].get(y, y))
    ax.grid(False)


def _legend_patches(classes: list[str], causes: set[str | None]) -> list[Patch]:
    looks = [CLASSES[name] for name in classes]
    for name, (letter, badge, _, words) in CAUSES.items():
        if name in causes:
            looks.append((badge, "", f"{letter}: {words}"))
    return [Patch(facecolor=colour, hatch=hatch, edgecolor=GREY, label=words) for colour, hatch, words in looks]


def _draw_cell(ax: Any, i: int, j: int, cell: dict[str, Any]) -> None:
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


def _draw_theory_curves(ax: Any, m: dict[str, Any]) -> None:
    """Draw the curves of theory."""

    def cell_index(values: list[float], x: Any) -> Any:
        """Cell numbers, interpolated by logarithms."""
        return np.interp(np.log(x), np.log(values), np.arange(len(values)), left=np.nan, right=np.nan)

    xs = m["x"]["values"]
    ys = m["y"]["values"]
    if m["name"] == "speed-mass":
        ax.axvline(cell_index(xs, 1.0), color=BLUE, linestyle="--", label="V = wave speed")
    elif m["name"] == "sag-stiffness":
        # L^2 = sigma^2 alpha = 4 pi^2, sigma = 8 sag/span for a flat parabola
        sag = np.geomspace(xs[0], xs[-1], 200)
        stiff = 4.0 * np.pi**2 / (8.0 * sag) ** 2
        inside = (stiff >= ys[0]) & (stiff <= ys[-1])
        x = cell_index(xs, sag[inside])
        y = cell_index(ys, stiff[inside])
        ax.plot(x, y, color=BLUE, linestyle="--", label="Irvine $L^2=4π^2$")
