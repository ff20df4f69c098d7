"""Figures of an answer: the first solver in blue and solid, the second in vermillion and dashed.

Positions are metres along the rope.
"""

import tomllib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jinja2 import Undefined, UndefinedError
from markupsafe import Markup
from scipy.integrate import cumulative_trapezoid

from cablefem.response import Array, Response
from validation.core.quantities import factor_and_prefixed_unit
from validation.page.answer.stored import StoredAnswer
from validation.page.page import compile_template_expression, read_asset
from validation.page.plot import BLACK, BLUE, DASHED, DOTTED, GREEN, PURPLE, VERMILLION, Panel, svg_figure

LOOKS = ((BLUE, ""), (VERMILLION, DASHED))
POSITION = "metres along the rope"
TIME = "time [s]"


def _values_at_compared_times(answer: StoredAnswer, r: Response, t: Array, values: Array) -> Array:
    """The values (n,) at times t (n,) that are compared, all if none is."""
    low, high = answer.compared_time_range(r)
    inside = (t >= low) & (t <= high)
    return values[inside] if inside.any() else values


def _time_or_position(r: Any, over_time: bool) -> Array:
    return r.t if over_time else r.s_o


def _figure_with_events(answer: StoredAnswer, panels: Sequence[Panel], caption: str, *, over_time: bool) -> Markup:
    """Draw panels over time or position, with verticals at the events and the slack onset."""
    r = answer.runs[0]
    end = max(float(_time_or_position(run, over_time).max()) for run in answer.runs)
    key = "t" if over_time else "s_o"
    verticals = [(event[key], GREEN, "") for event in answer.main_events]
    onset = answer.slack_onset_position
    if onset is not None:
        if over_time:
            onset = float(np.interp(onset, r.s_o, r.t))
        verticals.append((onset, BLACK, DOTTED))
    for panel in panels:
        panel.verticals = verticals
    return svg_figure(panels, (0.0, end), TIME if over_time else POSITION, caption)


def plot_series(answer: StoredAnswer, rows: Sequence[tuple[str, str, str]], caption: str, *, over_time: bool) -> Markup:
    """Draw series (words, unit, expression of a run r) below one another; "below" points down."""
    panels = []
    for title, unit, text in rows:
        values_of = compile_template_expression(text)
        panels.append(_series_panel(answer, title, unit, values_of, over_time))
    return _figure_with_events(answer, panels, caption, over_time=over_time)


def _series_panel(answer: StoredAnswer, title: str, unit: str, values_of: Callable[..., Any], over_time: bool) -> Panel:
    # limits from the compared part, before slack
    series = [values_of(r=r) for r in answer.runs]
    inside = [_values_at_compared_times(answer, r, r.t, x) for r, x in zip(answer.runs, series, strict=True)]
    factor, name = factor_and_prefixed_unit(np.concatenate(inside), unit)
    p = Panel(f"[{name}]", title, 110.0, down="below" in title)
    p.fit_y_axis([factor * values for values in inside])
    for r, x, look in zip(answer.runs, series, LOOKS, strict=False):
        p.add_curve(_time_or_position(r, over_time), factor * x, *look, name=r.method)
    other = answer.third_party
    if other is not None:
        values = _third_party_series(other, values_of)
        if values is not None:
            _add_third_party_curve(p, other, _time_or_position(other, over_time), factor * values)
    return p


def _add_third_party_curve(panel: Panel, third_party: Any, x: Array, y: Array, name_prefix: str = "") -> None:
    panel.add_curve(x, y, PURPLE, DASHED, 2.2, name_prefix + third_party.method)


def _third_party_series(third_party: Any, values_of: Callable[..., Any]) -> Array | None:
    """A series of a third party; None if it lacks it."""
    try:
        values = values_of(r=third_party)
    except (UndefinedError, TypeError):
        return None
    return None if isinstance(values, Undefined) else values


def plot_path_distance_with_error_bars(answer: StoredAnswer) -> Markup:
    """Draw the distance of both paths, of a third party's too, and the sum of both error bars."""
    a, b = answer.runs
    over_time = answer.is_free_ride
    abscissa, gap = _abscissa_and_path_distance(a, b, over_time)
    gap_at_all_times = np.pad(gap, (0, a.t.size - gap.size))
    inside = _values_at_compared_times(answer, a, a.t, gap_at_all_times)
    factor, unit = factor_and_prefixed_unit(inside, "m")
    p = Panel(f"apart [{unit}]", height=150.0)
    p.add_curve(abscissa, factor * gap, BLACK, "", 1.6, "distance of the paths")
    largest = float(inside.max(initial=0.0))
    bars = _sum_of_path_error_bars(answer)
    if bars is not None:
        ends = np.array(answer.compared_time_range(a))
        if not over_time:
            ends = np.interp(ends, a.t, a.s_o)
        p.add_curve(ends, np.full(2, factor * bars), GREEN, "9 3 2 3", 2.0, "sum of both error bars")
        largest = max(largest, bars)
    if answer.third_party is not None:
        abscissa, gap = _abscissa_and_path_distance(a, answer.third_party, over_time)
        _add_third_party_curve(p, answer.third_party, abscissa, factor * gap, "distance to ")
        largest = max(largest, float(gap.max(initial=0.0)))
    p.show_four_log_decades(factor * largest)
    return _figure_with_events(answer, [p], "How far the two paths of the car are apart.", over_time=over_time)


def _sum_of_path_error_bars(answer: StoredAnswer) -> float | None:
    """Sum of both solvers' error bars of the path [m]."""
    for row in answer.comparison_rows:
        if row["quantity"] == "path_max" and not row.get("with"):  # another program
            return None if row["allowed"] is None else row["allowed"] * answer.runs[0].path_scale
    return None


def _abscissa_and_path_distance(a: Response, b: Any, over_time: bool) -> tuple[Array, Array]:
    """Time or position, and the distance of two paths [m] where both exist, of the components that b has."""
    at = _time_or_position(a, over_time)
    of_b = _time_or_position(b, over_time)
    both = (at >= of_b[0]) & (at <= of_b[-1])
    parts = []
    for name in ("x", "y") if over_time else ("u", "v"):
        other = getattr(b, name)
        if other is not None:
            other = np.interp(at[both], of_b, other)
            parts.append(getattr(a, name)[both] - other)
    return at[both], np.linalg.norm(parts, axis=0)


def compared_tension_range(answer: StoredAnswer) -> tuple[float, float]:
    """Smallest and largest tension [N] of the compared part of the fields."""
    parts = []
    for r in answer.runs:
        parts.append(_values_at_compared_times(answer, r, r.fields.t, r.fields.T).ravel())
    T = np.concatenate(parts)
    return max(0.0, float(T.min())), float(T.max())


def plot_tension_field(answer: StoredAnswer, r: Response, caption: str) -> Markup:
    """Draw tension over time and position, with five numbers on it across and three up."""
    low, high = compared_tension_range(answer)
    factor, unit = factor_and_prefixed_unit(np.array([low, high]), "N")
    f = r.fields
    end = float(r.t[-1])
    p = Panel(POSITION, height=220.0, high=r.length)
    p.scale = (factor * low, factor * high, unit)
    times = np.linspace(0.0, end, 300)
    nearest = np.abs(times[:, None] - f.t).argmin(axis=1)  # frame of each time
    share = (f.T[nearest] - low) / ((high - low) or 1.0)  # (times, stations)
    p.image = share.T[::-1]
    for color, width in ((BLACK, 2.6), ("#fff", 1.4)):
        p.add_curve(r.t, r.s_o, color, "", width)
    label_times = end * (np.arange(5) + 0.5) / 5
    label_positions = r.length * (np.arange(3) + 0.5) / 3
    for t in label_times:
        k = int(np.abs(f.t - t).argmin())
        for s in label_positions:
            T = factor * np.interp(s, f.s, f.T[k])
            p.labels.append((float(t), float(s), f"{T:.3g}"))
    return svg_figure([p], (0.0, end), TIME, caption)


PARTS: dict[str, list[str]] = tomllib.loads(read_asset("looks.toml"))["energy"]


def plot_energy_since_start(answer: StoredAnswer, caption: str) -> Markup:
    """Draw the energy: motion, height, stretch, and the work of outside forces."""
    r = answer.runs[0]
    energies = {"motion": r.kinetic, "height": r.potential, "stretch": r.strain}
    energies = {name: y - y[0] for name, y in energies.items()}
    for name, power in r.powers.items():
        work = cumulative_trapezoid(np.nan_to_num(power), r.t, initial=0.0)
        energies["damping" if name == "lost_viscous" else name] = -work
    factor, unit = factor_and_prefixed_unit(np.concatenate(list(energies.values())), "J")
    p = Panel(f"since start [{unit}]", height=200.0)
    for name, y in energies.items():
        if np.abs(y).max() > 0.0:
            color, dash = PARTS.get(name, (BLACK, DOTTED))
            p.add_curve(r.t, factor * y, color, dash, name=name)
    p.fit_y_axis([curve.y for curve in p.curves])
    return _figure_with_events(answer, [p], caption, over_time=True)
