import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from cablefem.response import Array, Response
from validation.core import foreign, measures
from validation.core.agreement import Agreement, Bound, BoundPart, Verdict, refuse_out_of_range
from validation.core.foreign import ForeignPath
from validation.core.measures import NotComparable, Window
from validation.core.motion_laws import tension_behind_or_ahead
from validation.core.motion_rows import LineRun, distances, largest_tension_at_start


class LineAnswer(Protocol):
    """An answer to a line in motion."""

    @property
    def method(self) -> str: ...

    @property
    def moved(self) -> LineRun: ...

    @property
    def path_scale(self) -> float:
        """Largest deflection of a car [m]."""


OneSpan = Response | ForeignPath
Answer = OneSpan | LineAnswer


class AllowedGaps(NamedTuple):
    """Relative gaps that are allowed; tension None: not compared."""

    path: float
    tension: float | None


def assert_agree(
    a: Answer, b: Answer, *, path: float = 1e-3, tension: float | None = None, window: Window | None = None
) -> list[Agreement]:
    """Raise AssertionError unless two answers agree in mass path and, if asked, tension; return the rows.

    path : largest path gap, of a line of each car, over the largest deflection of b; of a free ride 0.1 l.
    tension : rms gap of the tension fields, or at the mass, over H; of a line the largest gap of means over an axial
        round trip at cars and contacts, over the largest tension at the start.
    window : s_o/l, by default that of the drive; cut at slack and where an answer ends. Of a line: times [s].
    ValueError for gaps that are no numbers from 0 to 1, and for a window that is no two rising numbers.
    assert_agree(run("level"), run("level", "fourier-kink"), path=3e-3)
    """
    __tracebackhide__ = True  # pytest shows the caller's line
    names = names_of_both_methods_or_raise(a, b)
    refuse_out_of_range("path", path, 0.0, 1.0)
    if tension is not None:
        refuse_out_of_range("tension", tension, 0.0, 1.0)
    window = None if window is None else _window_or_raise(window)
    try:
        rows = _compare_answers(a, b, AllowedGaps(path, tension), window)
    except NotComparable as reason:
        raise AssertionError(f"{names} cannot be compared: {reason}") from None
    if any(row.verdict is not Verdict.AGREE for row in rows):
        differ = isinstance(a, Response) and isinstance(b, Response) and a.scene_toml != b.scene_toml
        other_scene = ", they answer different scenes" if differ else ""
        raise AssertionError(failure_text(f"{names} disagree{other_scene}", rows))
    return rows


def _window_or_raise(window: Any) -> Window:
    """The window; ValueError for what is no two rising numbers."""
    try:
        start, end = map(float, window)
    except (TypeError, ValueError):
        start = end = math.nan
    if not start < end:
        raise ValueError(f"window must be two numbers, the second one larger, got {window!r}")
    return start, end


def names_of_both_methods_or_raise(a: Answer, b: Answer) -> str:
    """The sentence part "A and B" of two answers; TypeError for what is no answer."""
    for x in (a, b):
        if not hasattr(x, "method"):
            raise TypeError(f"assert_agree takes two answers, of cf.run or cf.quasi_static; got {type(x).__name__}")
    return f"{a.method} and {b.method}"


def failure_text(title: str, rows: Sequence[Agreement]) -> str:
    """The title and a line for each row that does not agree."""
    failed = [f"  {agreement_text(row)}" for row in rows if row.verdict is not Verdict.AGREE]
    return "\n".join([title, *failed])


def agreement_text(row: Agreement) -> str:
    """Gap, what is allowed, where the gap is largest, and why."""
    where = row.where if isinstance(row.where, str) or row.where is None else f"s_o/l = {row.where:.3f}"
    at = f", largest at {where}" if where else ""
    return f"{row_name(row)}: gap {row.gap:.3g}, allowed {row.allowed:.3g}{at}; {row.allowed_because}"


def row_name(row: Agreement) -> str:
    """The quantity of a row, with its law or car."""
    return f"{row.quantity} of {row.law}" if row.law else row.quantity


def _compare_answers(a: Answer, b: Answer, allowed: AllowedGaps, window: Window | None) -> list[Agreement]:
    """Rows of two answers of one span, or of two of one line in motion; NotComparable for others."""
    if isinstance(a, OneSpan) and isinstance(b, OneSpan):
        return _compare_one_span(a, b, allowed, window)
    if isinstance(a, OneSpan) or isinstance(b, OneSpan):
        raise NotComparable("one is of one span, the other of a line")
    if not all(isinstance(getattr(x, "moved", None), LineRun) for x in (a, b)):
        raise NotComparable("of lines at rest cf.check compares both solvers")
    return _compare_lines_in_motion(a, b, allowed, window or (0.0, math.inf))


def _compare_lines_in_motion(a: LineAnswer, b: LineAnswer, allowed: AllowedGaps, window: Window) -> list[Agreement]:
    """Rows of the path of each car and, if asked, of the worst tension, at the steps of the coarser run."""
    names, others = (_names_of_cars_and_contacts(x.moved) for x in (a, b))
    if names != others:
        raise NotComparable(f"one has {', '.join(names)}, the other {', '.join(others)}")
    t = _step_times_of_coarser_run(a.moved, b.moved, window)
    over = f"from {t[0]:.4g} to {t[-1]:.4g} s"

    def row(quantity: str, law: str, gap: Array, allowed_gap: float, why: str) -> Agreement:
        k = int(np.argmax(gap))
        bound = Bound("asked for", (BoundPart(quantity.partition("_")[0], allowed_gap),), f"{why}, {over}")
        return Agreement(quantity, float(gap[k]), bound, f"t = {t[k]:.4g} s", law=law)

    why = f"relative to the largest deflection {b.path_scale:.4g} m"
    rows = []
    for car, other in zip(a.moved.motion.cars, b.moved.motion.cars, strict=True):
        gap = distances(_spline_at_times(a.moved, car.point, t), _spline_at_times(b.moved, other.point, t))
        rows.append(row("path_max", car.name, gap / b.path_scale, allowed.path, why))
    if allowed.tension is not None:
        largest = largest_tension_at_start(b.moved.motion)
        why = f"mean over an axial round trip, relative to {largest:.4g} N at the start"
        worst, gap = _worst_mean_tension_gap(a.moved, b.moved, t)
        rows.append(row("tension", worst, gap / largest, allowed.tension, why))
    return rows


def _step_times_of_coarser_run(a: LineRun, b: LineRun, window: Window) -> Array:
    """Steps (n,) [s] of the coarser of two runs of one line in a window; NotComparable for fewer than 5."""
    steps = np.unique(min(a.motion.t, b.motion.t, key=len))
    end = min(window[1], a.end_time, b.end_time)
    t = steps[(steps >= window[0]) & (steps <= end)]
    if t.size < 5:
        raise NotComparable(f"{t.size} steps from {window[0]:g} to {end:g} s, 5 are needed")
    return t


def _names_of_cars_and_contacts(run: LineRun) -> list[str]:
    return [car.name for car in run.motion.cars] + [contact.name for contact in run.motion.contacts]


def _worst_mean_tension_gap(a: LineRun, b: LineRun, t: Array) -> tuple[str, Array]:
    """Where mean tensions at the times t (n,) differ most, and the gap (n,) [N] there."""
    others = _round_trip_mean_tensions(b, t)
    gaps = {where: np.abs(N - others[where]) for where, N in _round_trip_mean_tensions(a, t).items()}
    worst = max(gaps, key=lambda where: float(gaps[where].max()))
    return worst, gaps[worst]


def _round_trip_mean_tensions(run: LineRun, t: Array) -> dict[str, Array]:
    """Tensions (n,) [N] at contacts and cars, means over an axial round trip at the times t (n,), by where they are."""
    motion = run.motion
    tensions = {contact.name: tension_behind_or_ahead(contact) for contact in motion.contacts}
    for car in motion.cars:
        tensions |= {
            f"the rope behind {car.name}": car.tension_behind,
            f"the rope ahead of {car.name}": car.tension_ahead,
        }
    return {where: _spline_at_times(run, run.mean_over_axial_round_trip(N), t) for where, N in tensions.items()}


def _spline_at_times(run: LineRun, values: Array, t: Array) -> Array:
    """Values (n, ...) of a run at times (k,), by splines."""
    once = np.append(True, np.diff(run.motion.t) > 0.0)  # at a jump of forces a time stands twice
    return CubicSpline(run.motion.t[once], values[once])(t)


def _compare_one_span(a: OneSpan, b: OneSpan, allowed: AllowedGaps, window: Window | None) -> list[Agreement]:
    """Rows of path and, if asked, tension; NotComparable for cables of different lengths."""
    if not np.isclose(a.length, b.length, rtol=1e-6, atol=0.0):
        raise NotComparable(f"of different cables: {a.length:.6g} m and {b.length:.6g} m long")
    start, end = window or measures.WINDOWS[a.drive]
    if a.drive != "free":
        start = max(start, *(float(x.s_o[0] / x.length) for x in (a, b)))
    cut = measures.common_window(a, b, window=(start, end))
    rows = [_path_gap_row(a, b, allowed.path, cut)]
    if allowed.tension is not None:
        rows.append(_tension_gap_row(a, b, allowed.tension, cut))
    return rows


def _window_text(window: Window, a: OneSpan, b: OneSpan) -> str:
    onsets = [x.slack_onset for x in (a, b) if x.slack_onset is not None]
    cut = ", cut at the slack onset" if onsets and window[1] == min(onsets) else ""
    return f"s_o/l {window[0]:.3g} to {window[1]:.3g}{cut}"


def _path_gap_row(a: OneSpan, b: OneSpan, allowed: float, window: Window) -> Agreement:
    x, y = (a, b) if a.u is not None and b.u is not None else map(foreign.with_zero_u_and_x, (a, b))
    gap = measures.relative_path_gap(x, y, window)
    why = [f"relative to {b.path_scale_name} {b.path_scale:.4g} m"]
    beyond = gap.positions[gap.distances > allowed]
    if beyond.size:
        why.append(f"they part from s_o/l = {beyond[0]:.3f} on")
    why += [f"rms gap {gap.rms:.3g}", f"over {_window_text(window, a, b)}"]
    for r in (a, b):
        if isinstance(r, Response) and r.path_error is not None:
            why.append(f"error bar of {r.method} {r.path_error:.2g}")
    bound = Bound("asked for", (BoundPart("path", allowed),), "; ".join(why))
    return Agreement("path_max", gap.largest, bound, gap.position_of_largest)


def _tension_gap_row(a: OneSpan, b: OneSpan, allowed: float, window: Window) -> Agreement:
    if isinstance(a, Response) and isinstance(b, Response):
        gap = measures.rms_tension_gap_over_H(a, b, window)
        positions = measures.common_frames(a, b, window).position.tolist()
        worst = max(positions, key=lambda s: measures.rms_tension_gap_over_H(a, b, (s, s)))
        why = f"rms of the field off the mass, over H; over {_window_text(window, a, b)}"
    else:
        for r in (a, b):
            if r.T_behind is None:
                raise NotComparable(f"{r.method} brought no tension")
        H = next(r.horizontal_tension for r in (b, a) if isinstance(r, Response))
        gap = foreign.rms_mass_tension_gap_over_H(a, b, window, H)
        worst = None
        why = "rms at the mass, both sides, relative to H"
    return Agreement("tension", gap, Bound("asked for", (BoundPart("tension", allowed),), why), worst)
