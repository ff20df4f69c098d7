"""Figures of a check: two solvers on one scene, the first in blue and solid, the second in vermillion and dashed.

Every function takes stored answers and draws what they have, over the place of the mass, or over time where that is
an answer; `caption` goes below.
"""

from collections.abc import Callable, Sequence

import numpy as np
from markupsafe import Markup

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.commands.check.stored import Solver, Stored
from validation.core import measures
from validation.core.measures import Window
from validation.core.quantities import scale_of
from validation.page.plot import (
    BLACK,
    BLUE,
    DASHED,
    DIFFERENCE,
    DOTTED,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    Panel,
    plot,
)  # fmt: skip

LOOK = ((BLUE, ""), (VERMILLION, DASHED))
Of = Callable[[Response], Array]  # a series of a run, (n,) or (n, c)


def gap_of(a: Response, b: Response, of: Of) -> tuple[Array, Array]:
    """Return the instants of the run with fewer steps, and how far a series of both is apart there, (n,)."""
    coarse, fine = (a, b) if a.t.size <= b.t.size else (b, a)
    both = coarse.t <= fine.t[-1]
    apart = of(coarse) - measures.at_steps_of(coarse, fine, np.nan_to_num(of(fine)))
    return coarse.t[both], np.linalg.norm(apart.reshape(coarse.t.size, -1), axis=1)[both]


def path_of(r: Response) -> Array:
    """Return what is compared: over time places, over places displacements."""
    return np.stack([r.x, r.y] if r.drive == "free" else [r.u, r.v], axis=1)


def bar_of(solver: Solver, of: Of) -> tuple[Array, Array] | None:
    """Return instants and the error bar of a series there, from the gaps to both companions; None without them."""
    if solver.in_space is None or solver.in_time is None or solver.weights is None:
        return None
    (at, space), (at_time, time) = (gap_of(solver.run, c, of) for c in (solver.in_space, solver.in_time))
    return at, solver.weights[0] * space + solver.weights[1] * np.interp(at, at_time, time)


def _largest(x: Stored, r: Response, curve: tuple[Array, Array]) -> float:
    """Return the largest finite value of a curve over instants, in the compared range."""
    at, y = curve
    low, high = x.times(r)
    within = y[(at >= low) & (at <= high) & np.isfinite(y)]
    return float(within.max()) if within.size else 0.0


def _over(x: Stored, r: Response, t: Array | None = None) -> Array:
    """Return what a run's instants are drawn over."""
    t = r.t if t is None else t
    return t if x.free else np.interp(t, r.t, r.s_o) / r.length


def _inside(x: Stored, r: Response, values: Array) -> Array:
    inside = measures.inside(r, x.window)
    return values if x.free or not inside.any() else values[inside]


def _drawn(x: Stored, panels: Sequence[Panel], caption: str) -> Markup:
    """Shade what is not compared, draw the slack onset and the events of a ride, and plot."""
    r = x.solvers[0].run
    end = max(float(s.run.t[-1]) for s in x.solvers) if x.free else 1.0
    for p in panels:
        p.spans += [] if x.free else [(0.0, x.window[0]), (x.window[1], end)]
        if x.onset is not None:
            p.verticals.append((x.time(r, x.onset) if x.free else x.onset, BLACK, DOTTED))
        p.verticals += [(e["t"] if x.free else e["s_o"] / r.length, GREEN, "") for e in x.events]
    return plot(panels, (0.0, end), "time t [s]" if x.free else "place of the mass sₒ/l [–]", caption)


def series(
    x: Stored, rows: Sequence[tuple[str, str, Of]], caption: str, *, height: float = 120.0, bands: bool = False
) -> Markup:
    """Draw series of both solvers below one another: (words, unit, values) each; what is "down" points down.

    bands : with the error bar of each around it.
    """
    panels = []
    for title, unit, of in rows:
        drawn = [(s, s.run if bands else s.compared) for s in x.solvers]
        # limits from what is compared: later values of a slack cable may leave the frame
        inside = [_inside(x, r, of(r)) for _, r in drawn]
        factor, name = scale_of(np.concatenate(inside), unit)
        p = Panel(f"[{name}]", title, height, down="down" in title)
        p.fit([factor * part for part in inside])
        for (solver, r), look in zip(drawn, LOOK, strict=False):
            p.line(_over(x, r), factor * of(r), *look, name=solver.name)
            bar = bar_of(solver, of) if bands else None
            if bar is not None:
                y = np.interp(bar[0], r.t, of(r))
                p.bands.append((_over(x, r, bar[0]), factor * (y - bar[1]), factor * (y + bar[1]), look[0]))
        panels.append(p)
    return _drawn(x, panels, caption)


def paths(x: Stored, caption: str) -> Markup:
    """Depth of the mass below the left support; beneath, distance of the paths, both error bars, what is allowed."""
    p = Panel("depth y [m]", height=160.0, down=True)
    first = x.solvers[0].compared
    rest = x.scene.catenary.y(first.s_o)
    p.line(_over(x, first), rest, GREY, DOTTED, 1.2, "cable at rest")
    for solver, look in zip(x.solvers, LOOK, strict=False):
        p.line(_over(x, solver.compared), solver.compared.y, *look, name=solver.name)
    if x.party is not None:
        p.line(x.party.t if x.free else x.party.place, x.party.y, GREEN, DOTTED, 2.2, x.party.name)
    p.fit([rest, *(s.compared.y for s in x.solvers)], pad=0.05)
    return _drawn(x, [p, _distance(x)] if len(x.solvers) > 1 else [p], caption)


def _of_path(x: Stored) -> str:
    return "distance [% of l/10]" if x.free else "distance [% of v]"


def _distance(x: Stored) -> Panel:
    """Distance of two mass paths, in percent of what gaps are relative to."""
    p = Panel(_of_path(x), height=160.0)
    a, b = (s.compared for s in x.solvers)
    allowed, size, most = x.row("path_max").get("allowed"), x.scale.path_scale, 0.0
    for solver, look in zip(x.solvers, LOOK, strict=False):
        bar = bar_of(solver, path_of)
        if bar is not None:
            p.line(_over(x, solver.run, bar[0]), 100.0 * bar[1] / size, *look, 1.2, f"error bar, {solver.name}")
            most = max(most, _largest(x, solver.run, bar))
    gap = gap_of(a, b, path_of)
    p.line(_over(x, a, gap[0]), 100.0 * gap[1] / size, BLACK, "", 1.6, "distance of the paths")
    if allowed is not None and x.window[1] > x.window[0]:
        ends = np.array(x.times(a) if x.free else x.window)
        p.line(ends, np.full(2, 100.0 * allowed), GREEN, "9 3 2 3", 2.0, "allowed at most")
    p.decades(100.0 * max(most, _largest(x, a, gap), (allowed or 0.0) * size) / size)
    return p


def tension_range(solvers: Sequence[Solver], window: Window) -> tuple[float, float]:
    """Least and largest tension [N] of the fields in the compared range: the ends of the colour scale."""
    low, high = np.inf, 0.0
    for solver in solvers:
        f = solver.compared.fields
        inside = f.s_o <= window[1] * solver.compared.length
        part = f.T[inside] if inside.any() and solver.run.drive != "free" else f.T
        low, high = min(low, float(part.min())), max(high, float(part.max()))
    return max(0.0, low), high


def tension_fields(x: Stored, solvers: Sequence[Solver], caption: str) -> Markup:
    """T(s, t) of each solver on one scale of colours, and their difference."""
    low, high = tension_range(solvers, x.window)
    end = max(float(s.compared.t[-1]) for s in solvers)
    panels = []
    for solver in solvers:
        f = solver.compared.fields
        p = _field(x, solver.compared, f"tension, {solver.name}", f.t, f.T, low, high, end)
        panels.append(p)
    if len(solvers) > 1:
        a, b = (s.compared for s in solvers)
        at, i, j = measures.common_frames(a, b)
        gap = a.fields.T[i] - b.fields.T[j]
        off = np.abs(a.fields.s[None, :] / a.length - at[:, None]) >= measures.JUMP_WIDTH
        inside = ((at >= x.window[0]) & (at <= x.window[1]) | x.free)[:, None] & off
        most = float(np.percentile(np.abs(gap[inside]), 99.5)) if inside.any() else float(np.abs(gap).max(initial=0.0))
        t, most = a.fields.t[i], most or 1.0
        names = f"{solvers[0].name} − {solvers[1].name}"
        panels.append(_field(x, a, names, t, gap, -most, most, end, DIFFERENCE, BLACK))
    return plot(panels, (0.0, end), "time t [s]", caption)


def _field(
    x: Stored, r: Response, title: str, t: Array, T: Array, low: float, high: float, end: float,
    colors: str | None = None, ink: str = "#fff",
) -> Panel:  # fmt: skip
    """Return a field with where the mass is, where the compared range ends and where the cable went slack."""
    factor, unit = scale_of(np.array([low, high]), "N")
    p = Panel("place s/l [–]", title, 150.0, scale=(factor * low, factor * high, unit))
    # columns of equal times: that of the nearest frame, white where there is none any more
    times = np.linspace(0.0, end, 300)
    nearest = np.abs(times[:, None] - t[None, :]).argmin(axis=1)
    p.image = ((T[nearest] - low) / ((high - low) or 1.0)).T[::-1]
    p.colors = colors or p.colors
    for color, width in ((BLACK if ink != BLACK else "#fff", 2.6), (ink, 1.4)):
        p.line(r.t, r.s_o / r.length, color, "", width)
    if not x.free:
        p.verticals.append((x.time(r, x.window[1]), ink, DASHED))
    if x.onset is not None:
        p.verticals.append((x.time(r, x.onset), ink, DOTTED))
    if r.t[-1] < end:
        p.spans.append((float(r.t[-1]), end))
    return p


def energy(x: Stored, caption: str) -> Markup:
    """Energy of cable and mass against the work put in, and what is missing."""
    runs = [s.run for s in x.solvers]
    gained = [r.energy - r.energy[0] for r in runs]
    defects = [measures.energy_defect(r) for r in runs]
    factor, unit = scale_of(np.concatenate([_inside(x, r, y) for r, y in zip(runs, gained, strict=True)]), "J")
    top, bottom = Panel(f"since start [{unit}]"), Panel("defect [% of M g v]", height=110.0)
    for r, y, defect, look in zip(runs, gained, defects, LOOK, strict=False):
        top.line(_over(x, r), factor * y, *look, name=f"energy, {r.method}")
        bottom.line(_over(x, r), 100.0 * defect / (x.weight * r.max_deflection), *look)
    work = factor * (gained[0] - defects[0])
    top.line(_over(x, runs[0]), work, BLACK, DOTTED, 1.2, f"work put in, {runs[0].method}")
    for p in (top, bottom):
        p.fit([_inside(x, r, line[1]) for r, line in zip(runs, p.lines, strict=False)] + [np.zeros(1)])
    return _drawn(x, [top, bottom], caption)


def gripped(x: Stored, caption: str) -> Markup:
    """Tension at a car that rolls, and on both sides of one that grips."""
    assert x.grip is not None
    r, g = x.solvers[0].run, x.grip
    inside = [_inside(x, r, r.T_behind), _inside(x, g, g.T_behind), _inside(x, g, g.T_ahead)]
    factor, unit = scale_of(np.concatenate(inside), "N")
    p = Panel(f"[{unit}]", "tension at the car", 200.0)
    p.fit([factor * part for part in inside])
    p.line(_over(x, r), factor * r.T_behind, BLUE, name="rolling, both sides")
    p.line(_over(x, g), factor * g.T_behind, ORANGE, DASHED, 1.6, "gripping, behind")
    p.line(_over(x, g), factor * g.T_ahead, PURPLE, DASHED, 1.6, "gripping, ahead")
    return _drawn(x, [p], caption)


# part of the energy of a ride -> look
PARTS = {
    "motion": (BLUE, ""), "height": (VERMILLION, DASHED), "stretch": (GREEN, ""), "drag": (PURPLE, ""),
    "friction": (ORANGE, ""), "brake": (BLACK, ""), "thrust": (SKY, DASHED), "haul": (GREY, DASHED),
}  # fmt: skip


def energy_split(x: Stored, caption: str) -> Markup:
    """What becomes of the energy over a ride: motion, height, stretch of the cable, and what outside forces took."""
    r = x.solvers[0].run
    lines = {name: y - y[0] for name, y in (("motion", r.kinetic), ("height", r.potential), ("stretch", r.strain))}
    dt = np.diff(r.t, prepend=r.t[0])
    for name, power in r.powers.items():
        power = np.nan_to_num(power)
        lines[name] = -np.cumsum(0.5 * (power + np.append(power[:1], power[:-1])) * dt)
    factor, unit = scale_of(np.concatenate(list(lines.values())), "J")
    p = Panel(f"since start [{unit}]", height=240.0)
    for name, y in lines.items():
        if np.abs(y).max() > 0.0:
            p.line(_over(x, r), factor * y, *PARTS.get(name, (BLACK, DOTTED)), name=name)
    p.fit([line[1] for line in p.lines])
    return _drawn(x, [p], caption)


def refinement(x: Stored, caption: str) -> Markup:
    """Distance of the finest path of each solver to both its coarser companions, in percent as above."""
    panels = []
    for solver, (color, _) in zip(x.solvers, LOOK, strict=False):
        p, size, most = Panel(_of_path(x), solver.name), solver.run.path_scale, 0.0
        pairs = (solver.in_space, "half the resolution", color, ""), (solver.in_time, "half the steps", PURPLE, DASHED)
        for companion, words, ink, dash in pairs:
            if companion is not None:
                t, gap = gap_of(solver.run, companion, path_of)
                most = max(most, _largest(x, solver.run, (t, gap)))
                p.line(_over(x, solver.run, t), 100.0 * gap / size, ink, dash, 1.5, f"{solver.name}, to {words}")
        p.decades(100.0 * most / size)
        panels.append(p)
    return _drawn(x, panels, caption)


def snapshots(scene: Scene, solvers: Sequence[Solver], places: Sequence[float], caption: str) -> Markup:
    """The cable with the mass at a few times, below the straight line between its supports."""
    X, slope = scene.catenary, scene.supports.drop / scene.supports.span
    p = Panel("below the chord [m]", height=220.0, down=True)
    s = np.linspace(0.0, scene.length, 201)
    p.line(X.x(s), X.y(s) - slope * X.x(s), GREY, DOTTED, 1.2, "cable at rest")
    for solver, look in zip(solvers, LOOK, strict=False):
        f = solver.compared.fields
        for k in dict.fromkeys(int(np.argmin(np.abs(f.s_o / scene.length - at))) for at in places):
            left, right = f.s < f.s_o[k], f.s > f.s_o[k]
            at_x, at_y = float(X.x(f.s_o[k]) + f.mass_u[k]), float(X.y(f.s_o[k]) + f.mass_v[k])
            x, y = X.x(f.s) + f.u[k], X.y(f.s) + f.v[k]
            x, y = np.r_[x[left], at_x, x[right]], np.r_[y[left], at_y, y[right]]
            p.line(x, y - slope * x, *look, 1.2, solver.name)
            p.dots.append((at_x, at_y - slope * at_x, look[0], look is LOOK[0]))
    p.fit([line[1] for line in p.lines])
    return plot([p], (0.0, scene.supports.span), "distance from the left support x [m]", caption)
