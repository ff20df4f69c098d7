"""The page of `cablefem oracles`: what was held against what, how fast errors fall, and which rows had to fail."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from validation.core import store
from validation.page.figures import DASHES, MARKERS, PALETTE, panels, style
from validation.page.page import Section, details, figure, gallery, number, plain, words
from validation.page.plot import GREY

_SAY = words(__package__)


def sections(folder: Path) -> list[Section]:
    content = store.read(folder / "oracles.json")
    rows, oracles = content["rows"], content["oracles"]
    right = [row for row in rows if row["expected"] == "agree"]
    wrong = [row for row in rows if row["expected"] != "agree"]
    bad = [row for row in rows if row["verdict"] != row["expected"]]
    failing = sum(row["verdict"] == row["expected"] for row in wrong)
    found = plain(_SAY.found(content, right, bad))
    return [
        Section("oracles", "Exact answers", _SAY.rule() + _ladders(rows), content["verdict"], found),
        Section("oracles-table", "Exact answers against the solvers", _groups(oracles, right)),
        Section(
            "oracles-twins", "Comparisons that must fail", _SAY.twins() + _SAY.rows([_cells(row) for row in wrong]),
            summary=plain(_SAY.failing(failing, len(wrong))),
        ),
    ]  # fmt: skip


def _groups(oracles: list[dict[str, Any]], rows: list[dict[str, Any]]) -> Markup:
    html = Markup()
    for heading in dict.fromkeys(oracle["group"] for oracle in oracles):
        group = {oracle["name"]: oracle for oracle in oracles if oracle["group"] == heading}
        cells = [_cells(row) for row in rows if row["oracle"] in group]
        html += _SAY.group(heading, group.values(), cells) if cells else ""
    return html


def _cells(row: dict[str, Any]) -> dict[str, Any]:
    def known(x: float | None, else_: str) -> str:
        return else_ if x is None else number(x, 2)

    ladder = [{"run": run, "error": error} for run, error in zip(row["ladder"], row["errors"], strict=True)]
    return {
        "case": _SAY.case(row), "method": row["method"], "result": _SAY.result(row),
        "error": known(row["error"], "broke"), "allowed": number(row["allowed"], 2),
        "order": known(row["observed_order"], "none"), "expected": known(row["expected_order"], "none"),
        "why": details(row["because"], _SAY.why(row, ladder)),
    }  # fmt: skip


def _ladders(rows: list[dict[str, Any]]) -> Markup:
    """Figures of the case that every method goes through."""
    methods = {row["case"]: {r["method"] for r in rows if r["case"] == row["case"]} for row in rows}
    every = max(methods, key=lambda case: len(methods[case]), default="")
    parts: dict[str, list[dict[str, Any]]] = {"Elements": [], "Galerkin": []}
    for row in rows:
        if row["case"] == every:
            parts["Elements" if row["ladder"][0].startswith("elements") else "Galerkin"].append(row)
    return gallery(*(
        figure(_draw(part, title), _SAY.ladders(title), label=f"{title}: errors of the finest runs: " + ", ".join(
            f"{row['method']} {number(row['error'], 2)}" for row in part
        ))
        for title, part in parts.items() if part
    ))  # fmt: skip


@style()
def _draw(rows: Sequence[dict[str, Any]], title: str) -> Figure:
    fig, ax = panels(height=3.9)
    for i, row in enumerate(rows):
        pairs = [(n, e) for n, e in zip(row["sizes"], row["errors"], strict=True) if e is not None]
        n, e = np.array(pairs).T
        seen = "" if row["observed_order"] is None else f", order {row['observed_order']:.1f}"
        if row["expected"] != "agree":
            seen = ", wrong"
        look = {"color": PALETTE[i % 7], "linestyle": DASHES[(i + i // 7) % 7], "marker": MARKERS[(i + i // 7) % 7]}
        ax.loglog(n, e, label=row["method"] + seen, **look)
    sizes = np.array(ax.get_xlim())
    start = 0.35 * max((row["errors"][0] for row in rows if row["expected"] == "agree"), default=1.0)
    for p in (1, 2):
        line = start * (sizes[0] / sizes) ** p
        ax.loglog(sizes, line, color=GREY, linewidth=0.8, linestyle="-", zorder=0, scaley=False)
        ax.annotate(str(p), (sizes[1], line[1]), (3, -3), textcoords="offset points", color=GREY, fontsize=9)
    ticks = (5, 10, 20, 40, 80)
    ax.set_xticks(ticks, list(map(str, ticks)))
    ax.minorticks_off()
    ax.set_xlim(*sizes)
    ax.set_xlabel("resolution [–]")
    ax.set_ylabel("rms error / largest deflection [–]")
    ax.set_title(title)
    fig.legend(loc="outside lower center", ncols=2, fontsize=8.5)
    return fig
