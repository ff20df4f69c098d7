"""The page of `cablefem paper`: every claim with its verdict, then the paper's figures redone.

figures.toml holds its words and looks, and says which stored runs each figure shows.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from cablefem.response import Response
from cablefem.scene import Scene
from validation.commands.paper.judged import render_sentence
from validation.core import store
from validation.core.quantities import text_with_error_bar
from validation.page.figures import captioned_figure, figure_with_axes, report_style
from validation.page.page import Section, number_text, render_sections, typeset_error_bar_and_minus
from validation.page.plot import BLACK, BLUE, GREY

FIGURES = store.read_packaged_toml(__package__, "figures.toml")
Table = dict[str, Any]  # of figures.toml or claims.json
LOOKS: dict[str, Table] = FIGURES["looks"]
STATIC = LOOKS["static"] | {"label": "static"}
DOTTED = {"color": GREY, "linewidth": 0.8, "linestyle": (0, (1, 2))}

Shown = list[tuple[Response, Table]]  # runs and their looks


def sections(folder: Path) -> list[Section]:
    content = store.read_json(folder / "claims.json")

    @cache
    def stored_response(name: str) -> Response:
        return Response.read(folder / "runs" / name)

    parts = []
    for part in FIGURES["section"]:
        drawn = [_draw_figure(figure, content, stored_response) for figure in part["figure"]]
        parts.append(part | {"drawn": drawn})
    names = FIGURES["scenes"]
    references = [x | {"name": names[scene]} for scene, x in content["references"].items()]
    return render_sections(
        __package__,
        content=content,
        parts=parts,
        references=references,
        value=_value_text,
        text_with_error_bar=text_with_error_bar,
    )


def _value_text(value: float | None, quantity: Table, bar: float | None = None) -> str:
    """A value to the digits of its bar; without one to those that differ from the ends of the range."""
    if value is None:
        return "–"
    if bar and bar > 1e-6 * abs(value):
        return typeset_error_bar_and_minus(text_with_error_bar(value, bar))
    ends = quantity["low"], quantity["high"]
    distances = [abs(value / end - 1.0) for end in ends if end and end != value]
    digits = 2 - np.floor(np.log10(min(distances, default=1.0)))
    return number_text(value, int(np.clip(digits, 3, 8)))


def _draw_figure(figure: Table, content: Table, stored_response: Callable[[str], Response]) -> Markup:
    """Draw a figure of figures.toml with its caption."""
    claims = {claim["id"]: claim for claim in content["claims"]}

    def converged_value(claim: str, i: int = 0) -> float:
        return claims[claim]["quantities"][i]["converged"]

    runs = []
    for name, look, label in figure.get("of", ()):
        runs.append((stored_response(name), LOOKS[look] | {"label": label}))
    caption = render_sentence(figure["caption"], {"converged": converged_value})
    name = figure["draw"]
    with report_style():
        drawn = OF_NUMBERS[name](content) if name in OF_NUMBERS else OF_RUNS[name](figure, runs)
        return captioned_figure(drawn, caption, label=figure["label"])


def _draw_frequencies(content: Table) -> Figure:
    frequencies = content["frequencies"]
    linear = frequencies["linear_theory"]
    exact = frequencies["exact"]
    fig, (top, bottom) = figure_with_axes(2, 1, height=5.0, sharex=True)
    top.axhline(linear, **STATIC | {"label": f"linear theory {linear:.5f}"})
    top.axhline(exact, color=BLACK, linewidth=1.0, linestyle="-", label=f"exact catenary {exact:.5f}")
    bottom.axhline(linear / exact - 1.0, **STATIC)
    for name in ("fourier", "wavelet"):
        look = FIGURES["ladders"][name]
        n = np.array(frequencies[name]["terms"])
        omega = np.array(frequencies[name]["omega_1"])
        top.plot(n, omega, "-", **look)
        bottom.semilogy(n, omega / exact - 1.0, "-", **look)
    top.set(ylabel="ω₁ l √(ρ/H)", xlim=(0, 62), ylim=(5.343, 5.375))
    bottom.set(xlabel="number of terms N", ylabel="relative error of ω₁")
    top.legend()
    return fig


def _shade_slack(ax: Any, r: Response) -> None:
    if r.slack_onset is not None:
        ax.axvspan(r.slack_onset, 1.0, color="#f2e6c4", zorder=0, label="cable slack somewhere")


def _draw_paths(figure: Table, runs: Shown) -> Figure:
    """Draw the path of the mass in one reading, over s_o/l; the first run says where the cable is slack."""
    first = runs[0][0]
    reading = figure["reading"]
    fig, ax = figure_with_axes(height=3.4)
    _shade_slack(ax, first)
    for position in figure.get("marks", ()):
        ax.axvline(position, **DOTTED)
    if reading == "y + v":
        s = np.linspace(0.0, first.length, 201)
        y = Scene.from_toml(first.scene_toml).catenary.y(s)
        ax.plot(s / first.length, y / first.length, **STATIC)
    for r, look in runs:
        path = r.v if reading == "v" else r.y
        ax.plot(r.s_o / r.length, path / r.length, **look)
    ax.invert_yaxis()
    ax.set(xlabel="place of the mass sₒ/l", ylabel=f"{reading}, over l (down)", xlim=(0.0, 1.0))
    ax.set_title(figure.get("title", ""))
    fig.legend(loc="outside lower center", ncols=2, fontsize=8.0)
    return fig


def _draw_along_cable(figure: Table, runs: Shown) -> Figure:
    """Draw shapes or tensions along the cable, one panel for each position of the mass."""
    first = runs[0][0]
    scene = Scene.from_toml(first.scene_toml)
    positions = figure["places"]
    fig, axes = figure_with_axes(len(positions), 1, height=1.15 + 1.25 * len(positions), sharex=True, sharey=True)
    draw = _draw_shapes if figure["draw"] == "shapes" else _draw_tensions
    for ax, position in zip(axes, positions, strict=True):
        draw(ax, scene, runs, position)
        t = first.fields.t[_nearest_frame(first, position)] / scene.time_scale
        ax.set_title(f"sₒ/l = {position:g}   (t* = {t:.2f})", fontsize=9)
    if figure["draw"] == "shapes":
        axes[0].invert_yaxis()
    elif "top" in figure:
        axes[0].set_ylim(0.0, figure["top"])
    axes[-1].set_xlabel("place on the cable s/l")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize=8.0)
    return fig


def _draw_shapes(ax: Any, scene: Scene, runs: Shown, position: float) -> None:
    """Draw the cable, with the mass of the first run."""
    l = scene.length
    static = scene.catenary
    first = runs[0][0].fields
    ax.plot(first.s / l, static.y(first.s) / l, **STATIC)
    for r, look in runs:
        s = r.fields.s
        y = static.y(s) + r.fields.v[_nearest_frame(r, position)]
        ax.plot(s / l, y / l, **look)
    i = _nearest_frame(runs[0][0], position)
    s_o = first.s_o[i]
    y_mass = static.y(np.array([s_o]))[0] + first.mass_v[i]
    ax.plot(s_o / l, y_mass / l, "o", color=BLACK, markersize=5)
    ax.set_ylabel("y + v, over l")


def _draw_tensions(ax: Any, scene: Scene, runs: Shown, position: float) -> None:
    l = scene.length
    H = scene.horizontal_tension
    s = runs[0][0].fields.s
    ax.plot(s / l, scene.catenary.tension(s) / H, **STATIC)
    for r, look in runs:
        T = r.fields.T_pointwise[_nearest_frame(r, position)]
        ax.plot(r.fields.s / l, T / H, **look)
    ax.axvline(position, **DOTTED)
    ax.set_ylabel("T/H")


def _nearest_frame(r: Response, position: float) -> int:
    """The frame next to s_o/l."""
    distances = np.abs(r.fields.s_o / r.length - position)
    return int(np.argmin(distances))


def _draw_median_tensions(figure: Table, runs: Shown) -> Figure:
    fig, ax = figure_with_axes(height=3.2)
    _shade_slack(ax, runs[0][0])
    for r, look in runs:
        median = np.median(r.fields.T_pointwise, axis=1) / r.horizontal_tension
        ax.plot(r.fields.s_o / r.length, median, **look)
    ax.axhspan(2.5, 2.7, color="#dbe8f3", zorder=0, label="2.6 ± 0.1")
    ax.set(xlabel="place of the mass sₒ/l", ylabel="median of T/H along the cable", xlim=(0, 1), ylim=(0, 3.4))
    ax.legend(fontsize=8.0)
    return fig


def _draw_travel_with_rates(figure: Table, runs: Shown) -> Figure:
    """Draw acceleration, speed and position of the mass over time."""
    motion = Scene.from_toml(runs[0][0].scene_toml).groups.motion
    assert motion is not None
    fig, axes = figure_with_axes(3, 1, height=4.2, sharex=True)
    for k, (t0, t1) in enumerate(motion.phases):
        t = np.linspace(t0, t1, 60)
        positions_with_rates = [motion.position_with_rates(float(x), k) for x in t]
        s_o, ds_o, dds_o = np.array(positions_with_rates).T
        for ax, values in zip(axes, (dds_o, ds_o, s_o), strict=True):
            ax.plot(t, values, color=BLUE, linestyle="-")
    for ax, name in zip(axes, ("aₒ*", "Vₒ*", "sₒ*"), strict=True):
        ax.set_ylabel(name)
    axes[2].set_xlabel("t*")
    return fig


def _draw_overshoot(content: Table) -> Figure:
    fig, ax = figure_with_axes(height=3.2)
    for method, ladder in content["overshoot"].items():
        n = [x["terms"] for x in ladder]
        sizes = [x["size"] for x in ladder]
        bars = [x["spread"] for x in ladder]
        ax.errorbar(n, sizes, bars, linestyle="-", capsize=2, **FIGURES["ladders"][method])
    ax.set(xscale="log", yscale="log", xlabel="number of terms N", ylabel="|T − T converged|/H beside the mass")
    ax.legend(fontsize=8.0)
    return fig


def _draw_rides_by_thrust_angle(content: Table) -> Figure:
    rides = content["outlook"]
    x = rides["x"]
    fig, (top, bottom) = figure_with_axes(2, 1, height=5.0, sharex=True)
    for angle, color in FIGURES["angles"].items():
        ride = rides[angle]
        loads = ride["loads"]
        top.plot(x, ride["change"], "-", color=color, label=f"thrust at {angle}°")
        bottom.plot(x, loads["wheel_front"], "-", color=color)
        bottom.plot(x, loads["wheel_rear"], "--", color=color)
    top.invert_yaxis()
    top.set(ylabel="change of the path [m]")
    bottom.set(xlabel="x [m]", ylabel="wheel load over weight")
    top.legend()
    return fig


OF_NUMBERS: dict[str, Callable[[Table], Figure]] = {  # of claims.json
    "frequencies": _draw_frequencies, "overshoot": _draw_overshoot, "outlook": _draw_rides_by_thrust_angle,
}  # fmt: skip
OF_RUNS: dict[str, Callable[[Table, Shown], Figure]] = {
    "paths": _draw_paths, "shapes": _draw_along_cable, "tensions": _draw_along_cable, "levels": _draw_median_tensions,
    "law": _draw_travel_with_rates,
}  # fmt: skip
