"""The page of `cablefem advise`: what to run, why nothing less will do, and the whole ladder as evidence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from validation.page.figures import BLACK, DASHES, GREEN, GREY, MARKERS, ORANGE, SKY, panels, style
from validation.page.page import (
    Section,
    callout,
    details,
    figure,
    gallery,
    missing,
    number,
    percent,
    table,
)

# one colour per cable, one line per load
COLOURS = {"string": ORANGE, "sagged": SKY, "stretching": GREEN, "full": BLACK}
LOADS = {"force": DASHES[1], "mass": "-"}
ABOUT = {
    "string": "taut string, constant tension",
    "sagged": "linear sagging cable, one tension for the whole cable",
    "stretching": "sagging cable with finite slopes, one tension for the whole cable",
    "full": "both displacements, tension varies along the cable",
}


def sections(folder: Path) -> list[Section]:
    """Return the advice, the ladder with its figures, and the methods tried for the model advised."""
    path = folder / "advice.json"
    if not path.exists():
        return [Section("advise", "Least model", missing("advice.json", "Run cablefem advise SCENE --tol X."))]
    x = json.loads(path.read_text(encoding="utf-8"))
    return [_rolling(x)] if "least" in x else [_advice(x), _ladder(x), _methods(x)]


def _rolling(x: dict[str, Any]) -> Section:
    """What a car that rolls needs: a sentence each, and the ladder."""
    html = Markup("<ul>{}</ul>").format(Markup("").join(Markup("<li>{}</li>").format(word) for word in x["words"]))
    heads = {"model": "model"} | {need: f"{need} off by" for need in x["least"]} | {"seconds": "time [s]"}
    rows = [
        {"model": r["model"], "seconds": r["seconds"]} | {need: percent(r["gaps"][need]) for need in x["least"]}
        for r in x["rungs"]
    ]
    said = f"Least model within {percent(x['tol'])}: "
    said += "; ".join(f"{need}, {model}" for need, model in x["least"].items()) + "."
    verdict = "agree" if x["meets"] else "not comparable"
    return Section("advise", "Least model", html + table(rows, heads), verdict, said)


def _name(line: dict[str, Any]) -> str:
    return f"{line['model']} + {line['load']}"


def _settings(line: dict[str, Any]) -> str:
    return ", ".join(f"{v} {k}" for k, v in line["settings"].items())


def _advice(x: dict[str, Any]) -> Section:
    tol, path = percent(x["tol"]), x["for_path"]
    run = f"by {x['method']} with {_settings(x)} ({number(x['seconds'], 2)} s)"
    if x["meets"]:
        said = f"Within {tol} of the full model in path and tension: {_name(x)}, {run}."
    else:
        said = (
            f"No cheaper model than {_name(x)} is within {tol} in path and tension, and its finest run, {run}, is not "
        )
        said += "sure to be."
    enough = f"by {path['method']} with {_settings(path)} ({number(path['seconds'], 2)} s)"
    if _name(path) != _name(x):
        said += f" For the path alone {_name(path)} is enough, {enough}."
    elif x["model"] == "full":
        said += " No cheaper model is enough, not even for the path alone"
        said += f", which takes it {enough}." if path["meets"] and not x["meets"] else "."
    html = Markup("<h3>What the scene needs</h3><ul>{}</ul>").format(
        Markup("").join(Markup("<li>{}</li>").format(_typeset(word)) for word in x["words"])
    )
    if not x["meets"]:
        html += callout("The tolerance is not met with certainty: see the last sentence above.", "not comparable")
    html += Markup("<p><small>{}</small></p>").format(
        f"Tolerance of the path: of the largest deflection of the mass over sₒ/l = {x['range'][0]:.2f} to "
        f"{x['range'][1]:.2f}. Tension: rms over cable and time, off the mass, of the horizontal tension H at rest. "
        f"All runs of this advice together took as long as {number(x['cost_in_full_runs'], 2)} of the finest full one."
    )
    verdict = "agree" if x["meets"] else "not comparable"
    return Section("advise", "Least model", html, verdict, said)


def _typeset(text: str) -> str:
    return text.replace("s_o/l", "sₒ/l")


def _ladder(x: dict[str, Any]) -> Section:
    rows = []
    for rung in x["rungs"]:
        full, broke = rung["model"] == "full", rung["path_error"] is None
        word = "too close to say" if not rung["certain"] else "yes" if rung["within"] else "no"
        rows.append({
            "rung": _name(rung), "run": _settings(rung), "path": "broke" if broke else percent(rung["path_error"]),
            "next": percent(rung["path_to_next"]), "tension": percent(rung["tension_error"]),
            "seconds": rung["seconds"],
            "path_only": "own error" if full else "yes" if rung["within_path"] else "no",
            "both": "own error" if full else word,
        })  # fmt: skip
    heads = {
        "rung": "cable + load", "run": "run with", "path": "path error", "next": "path, to the next rung",
        "tension": "tension error",
        "path_only": "enough for the path", "both": "enough for path and tension", "seconds": "time [s]",
    }  # fmt: skip
    about = "; ".join(f"{model}: {text}" for model, text in ABOUT.items())
    html = Markup("<p><small>{}.</small></p>").format(
        f"{about}. A force is the weight of the mass without its inertia. Errors against the finest full run; the line "
        "of the full model shows its own error at the next coarser resolution"
    )
    html += table(rows, heads)
    if x["full"]["path_bar"] is not None:
        html += gallery(_cost_figure(x), _path_figure(x))
    tried = len(x["rungs"])
    summary = f"{tried} models tried, from a taut string under a force to the full cable." if tried > 1 else (
        "Nothing could be compared: only the full model was run."
    )  # fmt: skip
    return Section("advise-ladder", "The ladder of models", html, None, summary)


def _cost_figure(x: dict[str, Any]) -> Markup:
    return figure(
        _draw_cost(x),
        Markup(
            "Distance of every model to the full one over its computing time. Circles: path; squares: tension. Hollow: "
            "force; filled: mass. Grey line: the tolerance. The full model stands at its own error. A model far off is "
            "run no finer than it takes to see that."
        ),
        label="error against cost: " + ", ".join(
            f"{_name(r)} {percent(r['path_error'])} in {number(r['seconds'], 2)} s" for r in x["rungs"]
        ),
    )  # fmt: skip


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


def _path_figure(x: dict[str, Any]) -> Markup:
    return figure(
        _draw_paths(x),
        "What each model says of the path of the mass: its deflection from the static cable, over the largest one of "
        "the full model. Past the end of the range (grey) nothing is compared.",
        label="paths of the mass by all models",
    )


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
    html = table(rows, heads, stack=True) + details(
        "What the errors are held against",
        Markup("<p>{}</p>").format(
            f"The finest full run: {full['method']} with {_settings(full | {'settings': _told(full)})}, known to "
            f"{percent(full['path_bar'])} of the deflection and {percent(full['tension_bar'])} of H, from its gap to a "
            "run with half the resolution and half the steps."
        ),
    )
    found = f"{len(rows)} runs of {_name(x)}; the cheapest one that meets the tolerance is advised."
    return Section("advise-methods", "Method, resolution and step", html, None, found)


def _told(full: dict[str, Any]) -> dict[str, Any]:
    return {k: full["settings"][k] for k in ("elements", "steps")}
