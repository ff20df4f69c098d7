"""Pages about where methods fail: maps, step limits against theory, the failure catalogue."""

from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from matplotlib.patches import Patch

from validation.core import store
from validation.page.figures import panels, style
from validation.page.page import Section, figure, plain, words
from validation.page.plot import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION

_SAY = words(__package__)

# class of a cell -> colour, hatch and words; lightness falls from good to wrong, so that print in grey keeps the order
CLASSES = {
    "good": (SKY, "", "good: error up to 1 percent"),
    "poor": (ORANGE, "..", "poor: up to 10 percent"),
    "wrong": (VERMILLION, "xx", "wrong: more, or no answer"),
    "not judged": ("#dddddd", "", "not judged: reference unsure"),
    "no scene": ("#bbbbbb", "--", "no such scene"),
    None: ("#ffffff", "", "not computed"),
}
# cause of a failure -> letter and colour of its badge, words
CAUSES = {
    "too coarse": ("c", "#ffffff", "too coarse"), "unstable": ("u", PURPLE, "unstable: gains energy"),
    "slack": ("s", BLUE, "stopped on the slack cable"), "slack too early": ("e", GREEN, "slack too early"),
    "Newton stalled": ("n", BLACK, "Newton's method stalled"), "step underflow": ("t", "#8c6d31", "step underflow"),
    "no start": ("o", GREY, "no start"),
}  # fmt: skip
NAMES = {"mu": "mass ratio mu", "V/c": "speed ratio V/c", "alpha": "stiffness alpha"}


def sections(folder: Path) -> list[Section]:
    """Return the pages about the atlas stored in a folder."""
    atlas = store.read(folder / "atlas.json")
    pages = [_map(atlas, m) for m in atlas["maps"]]
    if atlas["limits"]:
        pages.append(_limits(atlas))
    if atlas["catalogue"]:
        pages.append(_catalogue(atlas))
    return pages


def _map(atlas: dict[str, Any], m: dict[str, Any]) -> Section:
    cells = {(c["method"], c["x"], c["y"]): c for c in atlas["cells"] if c["map"] == m["name"]}
    figures = [_figure(atlas, m, method, cells) for method in m["methods"]]
    total = len(m["methods"]) * len(m["x"]["values"]) * len(m["y"]["values"])
    counts = {name: sum(c["class"] == name for c in cells.values()) for name in CLASSES if name}
    rows = [
        {"method": method, **{name: sum(c["class"] == name for c in cells.values() if c["method"] == method)
                              for name in counts}}
        for method in m["methods"]
    ]  # fmt: skip
    found = plain(_SAY.computed(len(cells), total, counts))
    return Section(f"atlas-{m['name']}", m["title"], _SAY.map(figures, rows, counts), None, found)


def _figure(atlas: dict[str, Any], m: dict[str, Any], method: str, cells: dict[Any, Any]) -> Markup:
    xs, ys = m["x"]["values"], m["y"]["values"]
    fig, ax = panels(height=3.6)
    grid = [(i, j, cells.get((method, x, y))) for i, x in enumerate(xs) for j, y in enumerate(ys)]
    kinds = [cell and cell["class"] for _, _, cell in grid]
    shown = [name for name in CLASSES if name in kinds]
    causes = {cell["cause"] for _, _, cell in grid if cell}
    with style():
        for i, j, cell in grid:
            _cell(ax, i, j, cell)
        _curves(ax, atlas, m, method)
        ax.set_xticks(range(len(xs)), [f"{x:g}" for x in xs], rotation=45)
        ax.set_yticks(range(len(ys)), [f"{y:g}" for y in ys])
        ax.set(xlim=(-0.5, len(xs) - 0.5), ylim=(-0.5, len(ys) - 0.5), title=method)
        ax.set_xlabel(NAMES.get(m["x"]["name"], m["x"]["name"]))
        ax.set_ylabel(NAMES.get(m["y"]["name"], m["y"]["name"]))
        ax.grid(False)
        handles = _key(shown, causes)
        handles += ax.get_legend_handles_labels()[0]
        fig.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=7.5)
    tally = ", ".join(f"{kinds.count(k)} {k or 'not computed'}" for k in shown)
    return figure(fig, escape(f"{m['title']}: {method}"), label=f"Map of {method}: {tally}")


def _key(classes: list[str | None], causes: set[str]) -> list[Patch]:
    badges = [CAUSES[name] for name in CAUSES if name in causes]
    looks = [CLASSES[name] for name in classes] + [(badge, "", f"{c}: {words}") for c, badge, words in badges]
    return [Patch(facecolor=colour, hatch=hatch, edgecolor=GREY, label=words) for colour, hatch, words in looks]


def _cell(ax: Any, i: int, j: int, cell: dict[str, Any] | None) -> None:
    """Draw a cell in the colour of its class, with the letter of its cause and how far the run came."""
    colour, hatch, _ = CLASSES[cell["class"] if cell else None]
    how = {"facecolor": colour, "hatch": hatch, "edgecolor": "white", "linewidth": 0.5}
    ax.fill_between([i - 0.5, i + 0.5], j - 0.5, j + 0.5, **how)
    if cell is None:
        ax.text(i, j, "·", ha="center", va="center", color=GREY)
    elif cell["cause"] is not None:
        letter, badge, _ = CAUSES[cell["cause"]]
        if cell["reached"] is not None and cell["reached"] < 0.995 and cell["cause"] != "too coarse":
            letter += f"\n{cell['reached']:.2f}"
        ink = BLACK if badge in ("#ffffff", PURPLE) else "white"
        box = {"facecolor": badge, "edgecolor": "white", "linewidth": 0.5, "pad": 1.2}
        ax.text(i, j, letter, ha="center", va="center", fontsize=7.5, color=ink, bbox=box)


def _curves(ax: Any, atlas: dict[str, Any], m: dict[str, Any], method: str) -> None:
    """Draw what theory says: on axes that count cells, between their logarithms."""

    def place(values: list[float], x: Any) -> Any:
        return np.interp(np.log(x), np.log(values), np.arange(len(values)), left=np.nan, right=np.nan)

    xs, ys = m["x"]["values"], m["y"]["values"]
    if m["name"] == "speed-mass":
        ax.axvline(place(xs, 1.0), color=BLUE, linestyle="--", label="V = wave speed")
    elif m["name"] == "sag-stiffness":
        # L^2 = sigma^2 alpha = 4 pi^2, sigma = 8 sag/span for a flat parabola
        sag = np.geomspace(xs[0], xs[-1], 200)
        stiff = 4.0 * np.pi**2 / (8.0 * sag) ** 2
        inside = (stiff >= ys[0]) & (stiff <= ys[-1])
        ax.plot(place(xs, sag[inside]), place(ys, stiff[inside]), color=BLUE, linestyle="--", label="Irvine $L^2=4π^2$")
    elif method.endswith("central-difference") and atlas["limits"]:
        terms = [limit["terms"] for limit in atlas["limits"]]
        for key, colour, dash, words in (
            ("predicted_steps", BLUE, "--", "limit by theory"), ("measured_steps", PURPLE, ":", "limit measured"),
        ):  # fmt: skip
            steps = [limit[key] for limit in atlas["limits"]]
            how = {"color": colour, "linestyle": dash, "marker": "o", "markersize": 3, "label": words}
            ax.plot(place(xs, steps), place(ys, terms), **how)


def _limits(atlas: dict[str, Any]) -> Section:
    rows = [{**limit, "ratio": limit["measured_steps"] / limit["predicted_steps"]} for limit in atlas["limits"]]
    off = max(abs(row["ratio"] - 1.0) for row in rows)
    verdict = "agree" if off <= 0.05 else "disagree"
    return Section("atlas-limits", "Explicit steps", _SAY.limits(rows), verdict, plain(_SAY.off(off)))


def _catalogue(atlas: dict[str, Any]) -> Section:
    rows = [
        row | {
            "verdict": "agree" if row["failure_shown"] and row["remedy_works"] else "disagree",
            "case": f"{row['scene']}: {row['method']}", "failure": _SAY.values(row["failure"]),
            "cure": _SAY.values(row["cure"]),
        }
        for row in atlas["catalogue"]
    ]  # fmt: skip
    shown = sum(row["verdict"] == "agree" for row in rows)
    verdict, found = "agree" if shown == len(rows) else "disagree", plain(_SAY.shown(shown, len(rows)))
    return Section("atlas-catalogue", "Known ways to fail", _SAY.catalogue(rows), verdict, found)
