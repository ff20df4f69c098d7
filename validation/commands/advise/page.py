"""The page of `cablefem advise`: the advice and its ladder."""

from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from validation.core import store
from validation.page.figures import DASHES, MARKERS, panels, style
from validation.page.page import Section, details, figure, gallery, percent, plain, table, words
from validation.page.plot import BLACK, GREEN, GREY, ORANGE, SKY

_SAY = words(__package__)

# one colour per cable, one line per load
COLOURS = {"string": ORANGE, "sagged": SKY, "stretching": GREEN, "full": BLACK}
LOADS = {"force": DASHES[1], "mass": "-"}


def sections(folder: Path) -> list[Section]:
    """The advice, the ladder, and the methods tried."""
    x = store.read(folder / "advice.json")
    return [_rolling(x)] if "least" in x else [_advice(x), _ladder(x), _methods(x)]


def _rolling(x: dict[str, Any]) -> Section:
    """The advice for a rolling car, and its ladder."""
    heads = {"model": "model"} | {need: f"{need} off by" for need in x["least"]} | {"seconds": "time [s]"}
    rows = [
        {"model": r["model"], "seconds": r["seconds"]} | {need: percent(r["gaps"][need]) for need in x["least"]}
        for r in x["rungs"]
    ]
    verdict = "agree" if x["meets"] else "not comparable"
    return Section(
        "advise", "Least model", Markup(_SAY.needs(x["words"])) + table(rows, heads), verdict, plain(_SAY.rolling(x))
    )


def _name(line: dict[str, Any]) -> str:
    return plain(_SAY.name(line))


def _settings(line: dict[str, Any]) -> str:
    return plain(_SAY.settings(line["settings"]))


def _advice(x: dict[str, Any]) -> Section:
    verdict = "agree" if x["meets"] else "not comparable"
    return Section("advise", "Least model", Markup(_SAY.advice(x)), verdict, plain(_SAY.said(x, x["for_path"])))


def _ladder(x: dict[str, Any]) -> Section:
    rows = []
    for rung in x["rungs"]:
        full, broke = rung["model"] == "full", rung["path_error"] is None
        word = "too close to say" if not rung["certain"] else "yes" if rung["within"] else "no"
        rows.append({
            "rung": _name(rung), "run": _settings(rung), "path": "broke" if broke else percent(rung["path_error"]),
            "tension": percent(rung["tension_error"]),
            "seconds": rung["seconds"],
            "path_only": "own error" if full else "yes" if rung["within_path"] else "no",
            "both": "own error" if full else word,
        })  # fmt: skip
    heads = {
        "rung": "cable + load", "run": "run with", "path": "path error",
        "tension": "tension error",
        "path_only": "enough for the path", "both": "enough for path and tension", "seconds": "time [s]",
    }  # fmt: skip
    html = Markup(_SAY.ladder()) + table(rows, heads)
    if x["full"]["path_bar"] is not None:
        html += gallery(
            figure(_draw_cost(x), _SAY.cost(), label=plain(_SAY.cost_label(x["rungs"]))),
            figure(_draw_paths(x), _SAY.paths(), label="paths of the mass by all models"),
        )
    return Section("advise-ladder", "The ladder of models", html, None, plain(_SAY.tried(x["rungs"])))


@style()
def _draw_cost(x: dict[str, Any]) -> Figure:
    fig, axes = panels(1, 2, height=3.9, sharey=True)
    rungs = [r for r in x["rungs"] if r["path_error"] is not None]
    for ax, key, marker, title in zip(
        axes, ("path_error", "tension_error"), MARKERS, ("Path", "Tension"), strict=False
    ):
        ax.axhline(x["tol"], color=GREY, linestyle=(0, (6, 3)), linewidth=1.0)
        for rung in rungs:
            colour = COLOURS[rung["model"]]
            ax.loglog(
                rung["seconds"], rung[key], marker, color=colour, markersize=8,
                markerfacecolor=colour if rung["load"] == "mass" else "white",
                label=_name(rung) if ax is axes[0] else None, linestyle="none",
            )  # fmt: skip
        ax.set_title(title)
        ax.set_xlabel("time [s]")
        times = [r["seconds"] for r in rungs]
        ax.set_xlim(0.6 * min(times), 1.7 * max(times))
        ax.margins(y=0.12)
        ticks = _ticks(0.6 * min(times), 1.7 * max(times))
        ax.set_xticks(ticks, [f"{t:g}" for t in ticks])
        ax.minorticks_off()
    axes[0].set_ylabel("error / deflection, / H [–]")
    axes[0].annotate("tolerance", (0.03, x["tol"]), (0, 3), xycoords=("axes fraction", "data"),
                     textcoords="offset points", color=GREY, fontsize=8.5)  # fmt: skip
    fig.legend(loc="outside lower center", ncols=3, fontsize=8.5)
    return fig


def _ticks(low: float, high: float) -> list[float]:
    steps = [m * 10.0**e for e in range(-5, 4) for m in (1.0, 2.0, 5.0)]
    inside = [s for s in steps if low <= s <= high]
    return inside if len(inside) <= 3 else inside[:: (len(inside) + 2) // 3]


@style()
def _draw_paths(x: dict[str, Any]) -> Figure:
    fig, ax = panels(height=3.9)
    full = np.array(x["rungs"][-1]["v"])
    place = np.array(x["place"])
    size = np.abs(full[place[: full.size] <= x["range"][1] + 1e-9]).max()
    for rung in x["rungs"]:
        v = np.array(rung["v"]) / size
        thick = rung["model"] == "full"
        ax.plot(
            place[: v.size], v, color=COLOURS[rung["model"]], linestyle=LOADS[rung["load"]],
            linewidth=2.4 if thick else 1.4, label=_name(rung), zorder=1 if thick else 2,
        )  # fmt: skip
    ax.set_xlim(0.0, place[-1])
    low, high = ax.get_ylim()
    ax.set_ylim(max(low, -3.0), min(high, 5.0))
    ax.invert_yaxis()
    if x["range"][1] < place[-1]:
        ax.axvspan(x["range"][1], place[-1], color="#000000", alpha=0.07, linewidth=0)
    ax.set_xlabel("place of the mass sₒ/l [–]")
    ax.set_ylabel("deflection, down [–]")
    ax.set_title("Path of the mass")
    fig.legend(loc="outside lower center", ncols=3, fontsize=8.5)
    return fig


def _methods(x: dict[str, Any]) -> Section:
    rows = [
        {
            "method": line["method"], "settings": _settings(line), "path": percent(line["path_error"]),
            "tension": percent(line["tension_error"]), "seconds": line["seconds"], "meets": line["meets"],
        } for line in sorted(x["candidates"], key=lambda line: line["seconds"])
    ]  # fmt: skip
    heads = {
        "method": "method", "settings": "settings", "path": "path error", "tension": "tension error",
        "seconds": "time [s]", "meets": "meets the tolerance",
    }  # fmt: skip
    full = x["full"]
    told = {k: full["settings"][k] for k in ("elements", "steps")}
    against = details("What the errors are held against", Markup(_SAY.against(full, told)))
    html = table(rows, heads, stack=True) + against
    return Section("advise-methods", "Method, resolution and step", html, None, plain(_SAY.candidates(rows, x)))
