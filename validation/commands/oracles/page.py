"""The page of `cablefem oracles`: what was held against what, how fast errors fall, and which rows had to fail."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from validation.core import store
from validation.oracles.case import BEST
from validation.page.figures import DASHES, MARKERS, PALETTE, captioned_figure, figure_with_axes, report_style
from validation.page.page import Section, render_sections
from validation.page.plot import GREY

Row = dict[str, Any]


def sections(folder: Path) -> list[Section]:
    content = store.read_json(folder / "oracles.json")
    rows = content["rows"]
    case = _case_of_all_methods(rows)
    ladders = _rows_by_wing([row for row in rows if row["case"] == case])
    return render_sections(__package__, content=content, ladders=ladders, draw=_draw_errors, figure=captioned_figure)


def _case_of_all_methods(rows: list[Row]) -> str | None:
    """The case that every method goes through; None of a small part without such a case."""
    case, count = Counter(row["case"] for row in rows).most_common(1)[0]
    return case if count > len(BEST) else None


def _rows_by_wing(rows: list[Row]) -> dict[str, list[Row]]:
    wings: dict[str, list[Row]] = {}
    for row in rows:
        wing = "Elements" if row["ladder"][0].startswith("elements") else "Galerkin"
        wings.setdefault(wing, []).append(row)
    return wings


@report_style()
def _draw_errors(rows: Sequence[Row], title: str) -> Figure:
    fig, ax = figure_with_axes(height=3.9)
    for i, row in enumerate(rows):
        pairs = [(n, e) for n, e in zip(row["sizes"], row["errors"], strict=True) if e is not None]
        n, e = np.array(pairs, float).reshape(-1, 2).T  # none of a row that broke
        result = "" if row["observed_order"] is None else f", order {row['observed_order']:.1f}"
        if row["expected"] != "agree":
            result = ", wrong"
        k = (i + i // 7) % 7
        look = {"color": PALETTE[i % 7], "linestyle": DASHES[k], "marker": MARKERS[k]}
        ax.loglog(n, e, label=row["method"] + result, **look)
    sizes = np.array(ax.get_xlim())
    coarsest_errors = [row["errors"][0] or 0.0 for row in rows if row["expected"] == "agree"]
    start = 0.35 * max(coarsest_errors, default=1.0)
    for p in (1, 2):
        slope = start * (sizes[0] / sizes) ** p
        ax.loglog(sizes, slope, color=GREY, linewidth=0.8, linestyle="-", zorder=0, scaley=False)
        ax.annotate(str(p), (sizes[1], slope[1]), (3, -3), textcoords="offset points", color=GREY, fontsize=9)
    ticks = (5, 10, 20, 40, 80)
    ax.set_xticks(ticks, list(map(str, ticks)))
    ax.minorticks_off()
    ax.set_xlim(*sizes)
    ax.set_xlabel("resolution [–]")
    ax.set_ylabel("rms error / largest deflection [–]")
    ax.set_title(title)
    fig.legend(loc="outside lower center", ncols=2, fontsize=8.5)
    return fig
