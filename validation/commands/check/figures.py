"""Figures of a check: two solvers on one scene, the first in blue and solid, the second in vermillion and dashed.

Every function takes one or two stored answers and draws what they have.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.measures import Window
from validation.page.figures import BLACK, BLUE, DIFFERENCE, GREEN, GREY, PURPLE, VERMILLION, panels, style
from validation.page.stored import Solver, Stored

PLACE = "place of the mass sₒ/l [–]"
LOOK: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-", "linewidth": 2.0},
    {"color": VERMILLION, "linestyle": (0, (5, 3)), "linewidth": 1.8},
)


def scale_of(values: Array, unit: str) -> tuple[float, str]:
    """Return a factor and the unit's name with its prefix, so that the largest value has one to four digits."""
    largest = float(np.max(np.abs(values))) if values.size else 0.0
    if unit == "m":
        return (1.0, "m") if largest >= 0.1 or largest == 0.0 else (1e3, "mm")
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if largest >= 2.0 * factor:
            return 1.0 / factor, prefix + unit
    return 1.0, unit


def place(r: Response) -> Array:
    return r.s_o / r.length


def pointwise(a: Response, b: Response) -> tuple[Array, Array]:
    """Return the steps s_o/l of the response that has fewer and |w_a - w_b| of the mass there [m]."""
    coarse, fine = (a, b) if a.t.size <= b.t.size else (b, a)
    both = coarse.t <= fine.t[-1]
    at = measures.at_steps_of(coarse, fine, np.stack([fine.u, fine.v], axis=1))
    return place(coarse)[both], np.hypot(coarse.u - at[:, 0], coarse.v - at[:, 1])[both]


def mark_range(ax: Axes, x: Stored) -> None:
    """Shade what is not compared and draw the slack onset, on an axis of s_o/l."""
    ax.set_xlim(0.0, 1.0)
    for low, high in ((0.0, x.window[0]), (x.window[1], 1.0)):
        ax.axvspan(low, high, color="#000000", alpha=0.07, linewidth=0)
    if x.onset is not None:
        ax.axvline(x.onset, color=BLACK, linewidth=1.0, linestyle=(0, (1, 2)))


def limits(ax: Axes, curves: Sequence[tuple[Array, Array]], window: Window, *, zero: bool = False) -> None:
    """Set the vertical limits from what is compared: later values of a slack cable may leave the frame."""
    inside = [y[(at >= window[0]) & (at <= window[1]) & np.isfinite(y)] for at, y in curves]
    values = np.concatenate([*inside, [0.0]] if zero else inside) if inside else np.array([])
    if values.size:
        low, high = float(values.min()), float(values.max())
        pad = 0.12 * (high - low) or 1.0
        ax.set_ylim(low - pad, high + pad)


def decades(ax: Axes, most: float) -> None:
    """Show four decades below the largest value on a logarithmic scale; equal answers have none to show."""
    if most > 0.0:
        ax.set_yscale("log")
        ax.set_ylim(1e-4 * most, 4.0 * most)


@style()
def reach(x: Stored) -> Figure:
    """How far each answer goes: compared, computed, slack."""
    fig, ax = panels(height=0.75 + 0.42 * len(x.solvers))
    for i, (solver, look) in enumerate(zip(x.solvers, LOOK, strict=False)):
        run = solver.run
        ax.barh(i, run.reached, height=0.28, color=look["color"], alpha=0.35)
        stop = min(x.window[1], run.reached)
        ax.barh(i, stop - x.window[0], left=x.window[0], height=0.28, color=look["color"])
        if run.slack_onset is not None:
            ax.plot([run.slack_onset], [i], marker="X", markersize=9, color=BLACK, linestyle="none")
    ax.set_yticks(range(len(x.solvers)), [s.name for s in x.solvers])
    ax.set_ylim(len(x.solvers) - 0.5, -0.5)
    ax.set_xlim(0.0, 1.0)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(PLACE)
    return fig


@style()
def paths(x: Stored) -> Figure:
    """Depth of the mass below the left support; beneath, distance of the paths, both error bars, what is allowed."""
    both = len(x.solvers) > 1
    drawn = panels(1 + both, height=5.0 if both else 3.0, sharex=True, squeeze=False)
    fig, top = drawn[0], drawn[1][0, 0]
    s = np.linspace(0.0, 1.0, 201)
    top.plot(
        s,
        x.scene.catenary.y(s * x.scene.length),
        color=GREY,
        linewidth=1.2,
        linestyle=(0, (1, 1)),
        label="cable at rest",
    )
    for solver, look in zip(x.solvers, LOOK, strict=False):
        top.plot(place(solver.compared), solver.compared.y, label=solver.name, **look)
    mark_range(top, x)
    top.invert_yaxis()
    top.set_ylabel("depth y [m]")
    if both:
        _distance(drawn[1][1, 0], x)
    drawn[1][-1, 0].set_xlabel(PLACE)
    entries = [entry for ax in drawn[1][:, 0] for entry in zip(*ax.get_legend_handles_labels(), strict=True)]
    handles, labels = zip(*entries, strict=True)
    fig.legend(handles, labels, loc="outside upper left", ncols=2, frameon=False, borderaxespad=0.1)
    return fig


def _distance(ax: Axes, x: Stored) -> None:
    """Draw the distance of two mass paths, in percent of the deflection."""
    a, b = x.solvers
    allowed = x.row("path_max").get("allowed")
    size = b.compared.max_deflection
    largest = 0.0
    for solver, look in zip(x.solvers, LOOK, strict=False):
        bar = local_bar(solver)
        if bar is not None:
            ax.plot(bar[0], 100.0 * bar[1] / size, label=f"error bar, {solver.name}", **{**look, "linewidth": 1.2})
            largest = max(largest, _largest(bar, x.window))
    gap = pointwise(a.compared, b.compared)
    ax.plot(gap[0], 100.0 * gap[1] / size, color=BLACK, linewidth=1.6, linestyle="-", label="distance of the paths")
    top = max(largest / size, _largest(gap, x.window) / size, allowed or 0.0)
    if allowed is not None and x.window[1] > x.window[0]:
        ax.hlines(
            100.0 * allowed, *x.window, color=GREEN, linewidth=2.0, linestyle=(0, (6, 2, 1, 2)), label="allowed at most"
        )
    mark_range(ax, x)
    decades(ax, 100.0 * top)
    ax.set_ylabel("distance [% of v]")


@style()
def deflections(x: Stored) -> Figure:
    """Deflection v and u of the mass from the place it would have on the cable at rest."""
    fig, (top, bottom) = panels(2, height=5.0, sharex=True)
    for ax, name, words in ((top, "v", "down v [m]"), (bottom, "u", "to the right u [m]")):
        for solver, look in zip(x.solvers, LOOK, strict=False):
            ax.plot(place(solver.compared), getattr(solver.compared, name), label=solver.name, **look)
        theirs = None if x.party is None else getattr(x.party, name)
        if x.party is not None and theirs is not None:
            ax.plot(x.party.place, theirs, color=GREEN, linestyle=(0, (1, 1.2)), linewidth=2.2, label=x.party.name)
        mark_range(ax, x)
        ax.set_ylabel(words)
    top.invert_yaxis()
    bottom.set_xlabel(PLACE)
    _legend(fig, top)
    return fig


def local_bar(solver: Solver) -> tuple[Array, Array] | None:
    """Return the places s_o/l and the error bar of the path there [m], from the gaps to both companions."""
    if solver.in_space is None or solver.in_time is None or solver.weights is None:
        return None
    at, space = pointwise(solver.run, solver.in_space)
    at_time, time = pointwise(solver.run, solver.in_time)
    return at, solver.weights[0] * space + solver.weights[1] * np.interp(at, at_time, time)


def _largest(curve: tuple[Array, Array], window: Window) -> float:
    inside = (curve[0] >= window[0]) & (curve[0] <= window[1])
    return float(curve[1][inside].max()) if inside.any() else 0.0


def tension_range(solvers: Sequence[Solver], window: Window) -> tuple[float, float]:
    """Least and largest tension [N] of the fields in the compared range: the ends of the colour scale."""
    low, high = np.inf, 0.0
    for solver in solvers:
        f = solver.compared.fields
        inside = f.s_o <= window[1] * solver.compared.length
        part = f.T[inside] if inside.any() else f.T
        low, high = min(low, float(part.min())), max(high, float(part.max()))
    return max(0.0, low), high


@style()
def tension_fields(solvers: Sequence[Solver], window: Window, onset: float | None) -> Figure:
    """T(s, t) of each solver on one scale of colours, and their difference."""
    low, high = tension_range(solvers, window)
    factor, unit = scale_of(np.array([high]), "N")
    n = len(solvers)
    fig, axes = panels(n + (n > 1), height=0.5 + 2.0 * (n + (n > 1)), sharex=True, squeeze=False)
    axes = axes[:, 0]
    image: Any = None
    for ax, solver in zip(axes, solvers, strict=False):
        f, r = solver.compared.fields, solver.compared
        image = ax.pcolormesh(
            f.t,
            f.s / r.length,
            factor * f.T.T,
            shading="nearest",
            rasterized=True,
            vmin=factor * low,
            vmax=factor * high,
        )
        _on_field(ax, r, window, onset, "white")
        ax.set_title(f"tension, {solver.name}")
    longest = max((s.compared for s in solvers), key=lambda r: float(r.fields.t[-1]))
    axes[0].set_xlim(longest.fields.t[0], longest.fields.t[-1])
    _times_above(axes[0], longest)
    fig.colorbar(image, ax=list(axes[:n]), label=f"T [{unit}]", extend="max", fraction=0.06, pad=0.02)
    if n > 1:
        a, b = (s.compared for s in solvers)
        at, i, j = measures.common_frames(a, b)
        gap = a.fields.T[i] - b.fields.T[j]
        off = np.abs(a.fields.s[None, :] / a.length - at[:, None]) >= measures.JUMP_WIDTH
        inside = ((at >= window[0]) & (at <= window[1]))[:, None] & off
        most = float(np.percentile(np.abs(gap[inside]), 99.5)) if inside.any() else float(np.abs(gap).max())
        most = most or 1.0
        f2, unit2 = scale_of(np.array([most]), "N")
        image = axes[n].pcolormesh(
            a.fields.t[i], a.fields.s / a.length, f2 * gap.T, shading="nearest", rasterized=True, cmap=DIFFERENCE,
            vmin=-f2 * most, vmax=f2 * most,
        )  # fmt: skip
        _on_field(axes[n], a, window, onset, BLACK)
        axes[n].set_title(f"{solvers[0].name} − {solvers[1].name}")
        fig.colorbar(image, ax=axes[n], label=f"difference [{unit2}]", extend="both", fraction=0.06, pad=0.02)
    axes[-1].set_xlabel("time t [s]")
    return fig


def _on_field(ax: Axes, r: Response, window: Window, onset: float | None, color: str) -> None:
    """Draw where the mass is, where the compared range ends and where the cable went slack."""
    ax.grid(visible=False)
    other = BLACK if color == "white" else "white"
    ax.plot(r.t, place(r), color=other, linewidth=2.6, linestyle="-")
    ax.plot(r.t, place(r), color=color, linewidth=1.4, linestyle="-")
    end = float(np.interp(window[1], place(r), r.t))
    ax.axvline(end, color=color, linewidth=1.2, linestyle=(0, (5, 2)))
    if onset is not None:
        ax.axvline(float(np.interp(onset, place(r), r.t)), color=color, linewidth=1.4, linestyle=(0, (1, 1.5)))
    ax.set_ylim(0.0, 1.0)
    ax.set_ylabel("place s/l [–]")


def _times_above(ax: Axes, r: Response) -> None:
    """Tell the place of the mass on an axis above that of time, as densely as the numbers have room."""
    low, high = ax.get_xlim()
    ticks: list[float] = []
    for at in (0.2, 0.4, 0.6, 0.8, 1.0, 0.1, 0.05):
        t = float(np.interp(at, place(r), r.t))
        if low <= t <= high and all(abs(t - np.interp(x, place(r), r.t)) > 0.1 * (high - low) for x in ticks):
            ticks.append(at)
    top = ax.secondary_xaxis("top")
    top.set_xticks(np.interp(ticks, place(r), r.t), [f"{at:g}" for at in ticks])
    top.set_xlabel(PLACE)


@style()
def tension_at_mass(x: Stored) -> Figure:
    """Tension behind and ahead of the mass, and the least anywhere."""
    names = (("T_behind", "behind the mass"), ("T_ahead", "ahead of the mass"), ("tension_min", "least in the cable"))
    fig, axes = panels(3, height=5.2, sharex=True)
    high = max(_largest((place(s.compared), np.nan_to_num(s.compared.T_behind)), x.window) for s in x.solvers)
    factor, unit = scale_of(np.array([high]), "N")
    for ax, (name, words) in zip(axes, names, strict=True):
        curves = []
        for solver, look in zip(x.solvers, LOOK, strict=False):
            r = solver.run if name == "tension_min" else solver.compared
            curves.append((place(r), factor * getattr(r, name)))
            ax.plot(*curves[-1], label=solver.name, **look)
        mark_range(ax, x)
        limits(ax, curves, x.window, zero=name == "tension_min")
        ax.set_title(words)
        ax.set_ylabel(f"T [{unit}]")
    axes[2].axhline(0.0, color=BLACK, linewidth=0.8)
    axes[2].set_xlabel(PLACE)
    _legend(fig, axes[0])
    return fig


@style()
def energy(x: Stored) -> Figure:
    """Energy of cable and mass against the work put in, and what is missing."""
    fig, (top, bottom) = panels(2, height=4.4, sharex=True, height_ratios=(1.3, 1.0))
    inside = [s.run.energy[measures.inside(s.run, x.window)] - s.run.energy[0] for s in x.solvers]
    factor, unit = scale_of(np.concatenate(inside), "J")
    gained, missing = [], []
    for solver, look in zip(x.solvers, LOOK, strict=False):
        r = solver.run
        defect = measures.energy_defect(r)
        gained.append((place(r), factor * (r.energy - r.energy[0])))
        missing.append((place(r), 100.0 * defect / (x.weight * r.max_deflection)))
        top.plot(*gained[-1], label=f"energy, {solver.name}", **look)
        bottom.plot(*missing[-1], **look)
    work = factor * (x.solvers[0].run.energy - x.solvers[0].run.energy[0] - measures.energy_defect(x.solvers[0].run))
    top.plot(
        place(x.solvers[0].run), work, color=BLACK, linewidth=1.2, linestyle=(0, (1, 2)),
        label=f"work put in, {x.solvers[0].name}",
    )  # fmt: skip
    for ax, curves in ((top, gained), (bottom, missing)):
        mark_range(ax, x)
        limits(ax, curves, x.window, zero=True)
    top.set_ylabel(f"since entry [{unit}]")
    bottom.set_ylabel("defect [% of M g v]")
    bottom.set_xlabel(PLACE)
    _legend(fig, top, columns=1)
    return fig


@style()
def jump(x: Stored) -> Figure:
    """Vertical force between cable and mass from the cable's side and from the mass's, and what is missing."""
    assert x.scene.mass is not None
    mass, rho, g = x.scene.mass.mass, x.scene.cable.mass_per_length, x.scene.gravity
    fig, (top, bottom) = panels(2, height=4.4, sharex=True, height_ratios=(1.3, 1.0))
    curves, missing = [], []
    for solver, look in zip(x.solvers, LOOK, strict=False):
        r = solver.run
        defect = measures.jump_defect(r, mass, rho, g)
        inertia = mass * (r.acceleration - np.array([0.0, g]))
        curves.append((place(r), -(defect + inertia)[:, 1] / (mass * g)))
        missing.append((place(r), 100.0 * np.hypot(defect[:, 0], defect[:, 1]) / (mass * g)))
        top.plot(*curves[-1], label=f"cable's pull, {solver.name}", **look)
        bottom.plot(*missing[-1], **look)
    r = x.solvers[0].run
    curves.append((place(r), 1.0 - r.acceleration[:, 1] / g))
    top.plot(
        *curves[-1], color=BLACK, linewidth=1.2, linestyle=(0, (1, 2)), label=f"M (g − d²y/dt²), {x.solvers[0].name}"
    )
    mark_range(top, x)
    limits(top, curves, x.window, zero=True)
    mark_range(bottom, x)
    most = max(_largest((at, np.nan_to_num(y)), x.window) for at, y in missing)
    decades(bottom, most)
    top.set_ylabel("force up [M g]")
    bottom.set_ylabel("defect [% of M g]")
    bottom.set_xlabel(PLACE)
    _legend(fig, top, columns=1)
    return fig


@style()
def refinement(solver: Solver, look: int, x: Stored, words: Sequence[str]) -> Figure:
    """Distance of the finest path to both coarser companions; percent of the deflection."""
    fig, ax = panels(height=2.7)
    size, most = solver.run.max_deflection, 0.0
    pair = zip((solver.in_space, solver.in_time), words, (LOOK[look]["color"], PURPLE), ("-", (0, (5, 2))), strict=True)
    for companion, name, color, dashes in pair:
        if companion is not None:
            curve = pointwise(solver.run, companion)
            most = max(most, _largest(curve, x.window))
            ax.plot(
                curve[0],
                100.0 * curve[1] / size,
                color=color,
                linestyle=dashes,
                linewidth=1.5,
                label=f"to the run with {name}",
            )
    mark_range(ax, x)
    decades(ax, 100.0 * most / size)
    ax.set_ylabel("distance [% of v]")
    ax.set_xlabel(PLACE)
    _legend(fig, ax, columns=1)
    return fig


@style()
def snapshots(scene: Scene, solvers: Sequence[Solver], places: Sequence[float]) -> tuple[Figure, Figure]:
    """The cable and its tension at a few times, one panel each, with the mass."""
    X, l = scene.catenary, scene.length
    factor, unit = scale_of(np.array([tension_range(solvers, (0.0, max(places)))[1]]), "N")
    s, slope = np.linspace(0.0, l, 201), scene.supports.drop / scene.supports.span
    cable, rows = panels(len(places), height=1.0 + 1.05 * len(places), sharex=True, sharey=True, squeeze=False)
    tension, lines = panels(len(places), height=1.0 + 1.05 * len(places), sharex=True, squeeze=False)
    for ax, line, at in zip(rows[:, 0], lines[:, 0], places, strict=True):
        ax.plot(
            X.x(s), X.y(s) - slope * X.x(s), color=GREY, linewidth=1.2, linestyle=(0, (1, 1)), label="cable at rest"
        )
        for solver, look in zip(solvers, LOOK, strict=False):
            f = solver.compared.fields
            k = int(np.argmin(np.abs(f.s_o / l - at)))
            if abs(f.s_o[k] / l - at) > 0.006:
                continue
            left, right = f.s < f.s_o[k], f.s > f.s_o[k]
            at_x, at_y = float(X.x(f.s_o[k]) + f.mass_u[k]), float(X.y(f.s_o[k]) + f.mass_v[k])
            x, y = X.x(f.s) + f.u[k], X.y(f.s) + f.v[k]
            x, y = np.r_[x[left], at_x, x[right]], np.r_[y[left], at_y, y[right]]
            ax.plot(x, y - slope * x, label=solver.name, **look)
            filled = look["color"] if look is LOOK[0] else "none"
            ax.plot(at_x, at_y - slope * at_x, marker="o", color=look["color"], markersize=8, markerfacecolor=filled)
            sides = f.T_behind[k], f.T_ahead[k]
            T = np.r_[f.T[k, left], sides, f.T[k, right]]
            line.margins(y=0.25)
            line.plot(np.r_[f.s[left], [f.s_o[k]] * 2, f.s[right]] / l, factor * T, label=solver.name, **look)
            ax.set_title(f"t = {f.t[k]:.4g} s, sₒ/l = {at:g}")
            line.set_title(f"t = {f.t[k]:.4g} s, sₒ/l = {at:g}")
    rows[0, 0].invert_yaxis()
    rows[0, 0].margins(y=0.15)
    rows[-1, 0].set_xlabel("distance from the left support x [m]")
    cable.supylabel("depth below the line between the supports [m]", fontsize=10)
    lines[-1, 0].set_xlabel("place along the cable s/l [–]")
    tension.supylabel(f"tension T [{unit}]", fontsize=10)
    _legend(cable, rows[0, 0])
    _legend(tension, lines[0, 0])
    return cable, tension


def _legend(fig: Figure, ax: Axes, *, columns: int = 3) -> None:
    """Put the legend above the figure, where it hides nothing."""
    handles, labels = ax.get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside upper left", ncols=columns, frameon=False, borderaxespad=0.1)
