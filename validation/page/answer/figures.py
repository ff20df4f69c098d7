"""Figures of an answer: the first solver in blue and solid, the second in vermillion and dashed.

Places are metres along the rope.
"""

import tomllib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jinja2 import Undefined, UndefinedError
from markupsafe import Markup
from scipy.integrate import cumulative_trapezoid

from cablefem.response import Array, Response
from validation.core.quantities import scale_of
from validation.page.answer.stored import Stored
from validation.page.page import asset, expression
from validation.page.plot import BLACK, BLUE, DASHED, DOTTED, GREEN, PURPLE, VERMILLION, Panel, plot

LOOK = ((BLUE, ""), (VERMILLION, DASHED))
PLACE = "metres along the rope"
TIME = "time [s]"


def _inside(x: Stored, r: Response, t: Array, values: Array) -> Array:
    low, high = x.compared(r)
    inside = (t >= low) & (t <= high)
    return values[inside] if inside.any() else values


def _drawn(x: Stored, panels: Sequence[Panel], caption: str, *, time: bool) -> Markup:
    """Draw panels over time or place, with lines at the events and the slack onset."""
    r = x.runs[0]
    end = max(float((run.t if time else run.s_o).max()) for run in x.runs)
    for p in panels:
        if x.onset is not None:
            p.verticals.append((float(np.interp(x.onset, r.s_o, r.t)) if time else x.onset, BLACK, DOTTED))
        p.verticals += [(e["t"] if time else e["s_o"], GREEN, "") for e in x.events]
    return plot(panels, (0.0, end), TIME if time else PLACE, caption)


def series(x: Stored, rows: Sequence[tuple[str, str, str]], caption: str, *, time: bool) -> Markup:
    """Draw series (words, unit, expression of a run r) below one another; "below" points down."""
    panels = []
    for title, unit, text in rows:
        value = expression(text)

        def of(r: Any, value: Any = value) -> Any:
            return value(r=r)

        # limits from the compared part, before slack
        inside = [_inside(x, r, r.t, of(r)) for r in x.runs]
        factor, name = scale_of(np.concatenate(inside), unit)
        p = Panel(f"[{name}]", title, 110.0, down="below" in title)
        p.fit([factor * part for part in inside])
        for r, look in zip(x.runs, LOOK, strict=False):
            p.line(r.t if time else r.s_o, factor * of(r), *look, name=r.method)
        if x.party is not None and (theirs := _told(x.party, of)) is not None:
            p.line(x.party.t if time else x.party.s_o, factor * theirs, PURPLE, DASHED, 2.2, x.party.method)
        panels.append(p)
    return _drawn(x, panels, caption, time=time)


def _told(party: Any, of: Callable[[Any], Any]) -> Array | None:
    """A series of a third party; None if it lacks it."""
    try:
        found = of(party)
    except (UndefinedError, TypeError):
        return None
    return None if isinstance(found, Undefined) else found


def distance(x: Stored, caption: str) -> Markup:
    a, b = x.runs
    time = x.free
    at, apart = _apart(a, b, time)
    inside = _inside(x, a, a.t, np.pad(apart, (0, a.t.size - apart.size)))
    factor, unit = scale_of(inside, "m")
    p = Panel(f"apart [{unit}]", height=150.0)
    p.line(at, factor * apart, BLACK, "", 1.6, "distance of the paths")
    allowed = x.row("path_max").get("allowed")
    most = factor * float(inside.max(initial=0.0))
    if allowed is not None:
        ends = np.array(x.compared(a)) if time else np.interp(x.compared(a), a.t, a.s_o)
        p.line(ends, np.full(2, factor * allowed * a.path_scale), GREEN, "9 3 2 3", 2.0, "sum of both error bars")
        most = max(most, factor * allowed * a.path_scale)
    if x.party is not None:
        at, theirs = _apart(a, x.party, time)
        p.line(at, factor * theirs, PURPLE, DASHED, 2.2, f"distance to {x.party.method}")
        most = max(most, factor * float(theirs.max(initial=0.0)))
    p.decades(most)
    return _drawn(x, [p], caption, time=time)


def _apart(a: Response, b: Any, time: bool) -> tuple[Array, Array]:
    """The axis and the distance of two paths [m] where both are known, of the components both tell."""
    at, there = (a.t, b.t) if time else (a.s_o, b.s_o)
    both = (at >= there[0]) & (at <= there[-1])
    columns = [c for c in (("x", "y") if time else ("u", "v")) if getattr(b, c) is not None]
    parts = [getattr(a, c)[both] - np.interp(at[both], there, getattr(b, c)) for c in columns]
    return at[both], np.linalg.norm(parts, axis=0)


def tension_range(x: Stored) -> tuple[float, float]:
    """Least and largest tension [N] of the compared part of the fields."""
    parts = [_inside(x, r, r.fields.t, r.fields.T) for r in x.runs]
    return max(0.0, min(float(part.min()) for part in parts)), max(float(part.max()) for part in parts)


def tension_field(x: Stored, r: Response, caption: str, across: int = 5, up: int = 3) -> Markup:
    """Draw tension over time and place, with so many numbers on it across and up."""
    low, high = tension_range(x)
    factor, unit = scale_of(np.array([low, high]), "N")
    f = r.fields
    end = float(r.t[-1])
    p = Panel(PLACE, "", 220.0, low=0.0, high=r.length, scale=(factor * low, factor * high, unit))
    times = np.linspace(0.0, end, 300)
    nearest = np.abs(times[:, None] - f.t[None, :]).argmin(axis=1)
    p.image = ((f.T[nearest] - low) / ((high - low) or 1.0)).T[::-1]
    for color, width in ((BLACK, 2.6), ("#fff", 1.4)):
        p.line(r.t, r.s_o, color, "", width)
    for t in end * (np.arange(across) + 0.5) / across:
        k = int(np.abs(f.t - t).argmin())
        for s in r.length * (np.arange(up) + 0.5) / up:
            p.labels.append((float(t), float(s), f"{factor * np.interp(s, f.s, f.T[k]):.3g}"))
    return plot([p], (0.0, end), TIME, caption)


PARTS: dict[str, list[str]] = tomllib.loads(asset("looks.toml"))["energy"]


def energy_split(x: Stored, caption: str) -> Markup:
    """Draw the energy: motion, height, stretch, and the work of outside forces."""
    r = x.runs[0]
    lines = {name: y - y[0] for name, y in (("motion", r.kinetic), ("height", r.potential), ("stretch", r.strain))}
    for name, power in r.powers.items():
        work = cumulative_trapezoid(np.nan_to_num(power), r.t, initial=0.0)
        lines["damping" if name == "lost_viscous" else name] = -work
    factor, unit = scale_of(np.concatenate(list(lines.values())), "J")
    p = Panel(f"since start [{unit}]", height=200.0)
    for name, y in lines.items():
        if np.abs(y).max() > 0.0:
            color, dash = PARTS.get(name, (BLACK, DOTTED))
            p.line(r.t, factor * y, color, dash, name=name)
    p.fit([line[1] for line in p.lines])
    return _drawn(x, [p], caption, time=True)
