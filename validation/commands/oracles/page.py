"""The page of `cablefem oracles`: what was held against what, how fast errors fall, and which rows had to fail."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from validation.page.figures import DASHES, GREY, MARKERS, PALETTE, panels, style
from validation.page.page import (
    Section,
    badge,
    details,
    figure,
    gallery,
    missing,
    number,
    percent,
    table,
)

HEADS = {
    "case": "exact answer, case", "method": "method", "result": "verdict", "error": "rms error", "allowed": "allowed",
    "order": "order seen", "expected": "order expected", "why": "because",
}  # fmt: skip


def sections(folder: Path) -> list[Section]:
    """Return the table with its figure, the rows that must fail, and the oracles out of reach."""
    path = folder / "oracles.json"
    if not path.exists():
        return [Section("oracles", "Exact answers", missing("oracles.json", "Run cablefem oracles."))]
    content = json.loads(path.read_text(encoding="utf-8"))
    rows = content["rows"]
    right = [row for row in rows if row["expected"] == "agree"]
    wrong = [row for row in rows if row["expected"] != "agree"]
    return [
        _found(content, right),
        _table(content["oracles"], right),
        _must_fail(wrong),
        _unreached(content["oracles"]),
    ]


def _found(content: dict[str, Any], rows: list[dict[str, Any]]) -> Section:
    bad = [row for row in content["rows"] if row["verdict"] != row["expected"]]
    names = dict.fromkeys(row["oracle"] for row in rows)
    said = f"{len(rows)} pairs of exact answer and method, from {len(names)} exact answers: "
    if content["verdict"] == "not comparable":
        said += "the table is not complete; run cablefem oracles again and it goes on."
    elif bad:
        pairs = "; ".join(f"{row['oracle']} ({row['case']}) with {row['method']}" for row in bad)
        said += f"{len(bad)} not as they should be: {pairs}."
    else:
        said += "all errors lie within the methods' own error bars and fall with the order that theory gives."
    scene = [row for row in rows + content["rows"] if row["case"].startswith("the paper's mass")]
    ladders = list({row["method"]: row for row in scene}.values())
    html = Markup("<p>{}</p>").format(
        "A row agrees if the finest run is as close to the exact answer as its own error bar says (made from "
        "it and a coarser run, without the exact answer), and if refining lowers the error with the order that the "
        "case has in theory. Errors are rms over sₒ/l = 0.02 to 0.80, relative to the largest exact deflection."
    )
    elements = [row for row in ladders if row["ladder"][0].startswith("elements")]
    galerkin = [row for row in ladders if row not in elements]
    parts = ((elements, "Elements"), (galerkin, "Galerkin"))
    html += gallery(*(_convergence(part, title) for part, title in parts if part))
    return Section("oracles", "Exact answers", html, content["verdict"], said)


def _convergence(rows: Sequence[dict[str, Any]], title: str) -> Markup:
    words = ", ".join(f"{row['method']} {number(row['error'], 2)}" for row in rows)
    return figure(
        _draw(rows, title),
        Markup(
            "{}: error of the mass path on a taut string against the exact answer, over the number of "
            "unknowns of a field. Grey: slopes of orders 1 and 2."
        ).format(title),
        label=f"{title}: errors of the finest runs: {words}",
    )  # fmt: skip


@style()
def _draw(rows: Sequence[dict[str, Any]], title: str) -> Figure:
    fig, ax = panels(height=3.9)
    for i, row in enumerate(rows):
        pairs = [(n, e) for n, e in zip(row["sizes"], row["errors"], strict=True) if e is not None]
        n, e = np.array(pairs).T
        seen = "" if row["observed_order"] is None else f", order {row['observed_order']:.1f}"
        if row["expected"] != "agree":
            seen = ", wrong"
        look = {"color": PALETTE[i % 7], "linestyle": DASHES[i % 7], "marker": MARKERS[i % 7]}
        ax.loglog(n, e, label=row["method"] + seen, **look)
    sizes = np.array([min(ax.get_xlim()), max(ax.get_xlim())])
    bottom, top = ax.get_ylim()
    for p in (1, 2):
        start = 0.35 * max((row["errors"][0] for row in rows if row["expected"] == "agree"), default=1.0)
        line = start * (sizes[0] / sizes) ** p
        ax.loglog(sizes, line, color=GREY, linewidth=0.8, linestyle="-", zorder=0)
        ax.annotate(str(p), (sizes[1], line[1]), (3, -3), textcoords="offset points", color=GREY, fontsize=9)
    ax.set_xlim(*sizes)
    ax.set_ylim(bottom, top)
    ticks = [n for n in (5, 10, 20, 40, 80) if sizes[0] <= n <= sizes[1]]
    ax.set_xticks(ticks, [str(n) for n in ticks])
    ax.minorticks_off()
    ax.set_xlabel("resolution [–]")
    ax.set_ylabel("rms error / largest deflection [–]")
    ax.set_title(title)
    fig.legend(loc="outside lower center", ncols=2, fontsize=8.5)
    return fig


def _table(oracles: list[dict[str, Any]], rows: list[dict[str, Any]]) -> Section:
    html = []
    for heading in dict.fromkeys(oracle["group"] for oracle in oracles):
        group = {oracle["name"]: oracle for oracle in oracles if oracle["group"] == heading}
        cells = [_cells(row) for row in rows if row["oracle"] in group]
        if cells:
            sources = "; ".join(f"{o['name']}: {o['title']} ({o['source']})" for o in group.values())
            html.append(Markup("<h3>{}</h3><p><small>{}.</small></p>").format(heading, sources))
            html.append(table(cells, HEADS, stack=True))
    found = f"{len(rows)} rows: error, order and verdict of every method against every exact answer it can meet."
    return Section("oracles-table", "Exact answers against the solvers", Markup("\n").join(html), None, found)


def _cells(row: dict[str, Any]) -> dict[str, Any]:
    as_expected, fails = row["verdict"] == row["expected"], row["expected"] != "agree"
    text = ("fails, as it must" if as_expected else "passes, but must not") if fails else row["verdict"]
    ladder = table(
        [{"run": run, "error": error} for run, error in zip(row["ladder"], row["errors"], strict=True)],
        {"run": "run", "error": "error, rms"},
    )  # fmt: skip
    return {
        "case": Markup("<b>{}</b> {}").format(row["oracle"], row["case"]),
        "method": row["method"],
        "result": badge("agree" if as_expected else "disagree", text),
        "error": number(row["error"], 2) if row["error"] is not None else "broke",
        "allowed": number(row["allowed"], 2),
        "order": number(row["observed_order"], 2) if row["observed_order"] is not None else "none",
        "expected": number(row["expected_order"], 2) if row["expected_order"] is not None else "none",
        "why": details(
            row["because"],
            Markup("<p>Allowed: {}. Largest error of the finest run {}. Refined: {}.</p>{}").format(
                row["allowed_because"], percent(row["worst"]), row["refined"], ladder
            ),
        ),
    }  # fmt: skip


def _must_fail(rows: list[dict[str, Any]]) -> Section:
    html = Markup("<p>{}</p>").format(
        "A comparison that nothing can fail proves nothing. These rows hold a wrong method, a wrong limit or an "
        "incomplete law against an exact answer, or a method where it is known to break."
    ) + table([_cells(row) for row in rows], HEADS, stack=True)
    failed = sum(row["verdict"] == row["expected"] for row in rows)
    found = f"{failed} of {len(rows)} comparisons that must fail do fail."
    return Section("oracles-twins", "Comparisons that must fail", html, None, found)


def _unreached(oracles: list[dict[str, Any]]) -> Section:
    rows = [oracle for oracle in oracles if oracle["unreached"]]
    heads = {"name": "exact answer", "title": "what it answers", "unreached": "why no solver is held against it"}
    html = table(rows, heads, stack=True)
    found = f"{len(rows)} exact answers are for loads or cables that the solvers do not have; tests hold each against "
    return Section("oracles-unreached", "Exact answers out of the solvers' reach", html, None, found + "its equation.")
