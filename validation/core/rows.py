"""The table of compared quantities, with scales and tolerances."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from cablefem.response import Array, Flag, Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.agreement import APART, DEFAULT_TOL, Agreement, Bound, Part, finite, nothing
from validation.core.ladder import Apart, Ladder, Of, itself, largest
from validation.core.measures import SLACK_END, NotComparable
from validation.core.methods import METHODS
from validation.core.order import FIRST
from validation.core.view import View

Gap = Callable[[Response, Response, View], float]
Series = Callable[[Response], Array]

TENSION = 10.0  # force tolerance over path tolerance: forces are first order, paths second
REST = 0.05  # tolerance of all else
VELOCITY = 0.10  # tolerance of summed velocity against displacement
ROUNDING = 1e-12  # of every scale
AXIAL_MEAN = "mean over an axial round trip"
ALONG = "along the cable"
EVENTS = ("brake", "arrival", "back", "stop", "turn")  # both answers must tell the first of each
DOUBTS = ("fast", "slow waves", "energy", "hidden slack", "no bar")  # flags of bars that may be too small


@dataclass(frozen=True, slots=True)
class Quantity:
    """One line of the table.

    asks : tolerance "path", "force" or "rest"; "" if only shown.  concerns : views with such a row.
    order : the most credited.
    """

    name: str
    gap: Gap
    asks: str
    law: str = ""
    concerns: Callable[[View], bool] = lambda view: True
    order: float = math.inf


def _path(i: int) -> Gap:
    return lambda x, y, view: measures.path_gap(x, y, view.window)[i]


def _of(names: tuple[str, ...], scale: float, r: Response) -> Array:
    return np.concatenate([getattr(r, name).reshape(r.t.size, -1) for name in names], axis=1) / scale


def _series(*names: str, over: str, mean: bool = False, largest: bool = False) -> Gap:

    def gap(x: Response, y: Response, view: View) -> float:
        of: Series = partial(_of, names, getattr(view, over) if over != "top" or view.top else float(y.speed.max()))
        if "speed" in names and view.free:
            of = partial(_until_stop, of)
        return measures.series_gap(x, y, view.window, of, view.axial if mean else 0.0, largest=largest)

    return gap


def _until_stop(of: Series, r: Response) -> Array:
    """Values (n, c) with nan past a lasting stop, whose time depends on axial waves."""
    stop = happened("stop", r)
    values = of(r)
    return values if stop is None else np.where(r.t[:, None] <= stop["t"], values, math.nan)


def _field(gap: Callable[..., float], **how: Any) -> Gap:
    return lambda x, y, view: gap(x, y, view.window, **how)


_rolls = attrgetter("rolls")
TABLE = (
    Quantity("path_max", _path(0), "path"),
    Quantity("path_rms", _path(1), "path"),
    Quantity("place", _series("s_o", over="length", largest=True), "path", concerns=lambda v: v.free),
    Quantity("speed", _series("speed", over="top", mean=True), "path", AXIAL_MEAN, order=FIRST),
    Quantity("tension_behind", _series("T_behind", over="H", mean=True), "force", AXIAL_MEAN),
    Quantity("tension_ahead", _series("T_ahead", over="H", mean=True), "force", AXIAL_MEAN),
    Quantity("reactions", _series("reaction_left", "reaction_right", over="H", mean=True), "force", AXIAL_MEAN),
    Quantity("contact", _series("F_contact", over="weight", mean=True), "force", AXIAL_MEAN, concerns=_rolls),
    Quantity("haul_force", _series("F_haul", over="weight", mean=True), "force", AXIAL_MEAN, concerns=_rolls),
    Quantity("tension", _field(measures.tension_gap), "rest"),
    Quantity("displacement", _field(measures.field_gap), "rest"),
    Quantity("displacement", _field(measures.field_gap, along=True), "rest", ALONG),
    Quantity("speed", _series("speed", over="top", largest=True), ""),
    Quantity("tension_behind", _series("T_behind", over="H"), ""),
    Quantity("tension_ahead", _series("T_ahead", over="H"), ""),
    Quantity("reactions", _series("reaction_left", "reaction_right", over="H"), ""),
    Quantity("contact", _series("F_contact", over="weight"), ""),
    Quantity("haul_force", _series("F_haul", over="weight"), "", concerns=_rolls),
    Quantity("velocity", _field(measures.field_gap, rate=True), ""),
    Quantity("velocity", _field(measures.field_gap, rate=True, along=True), "", ALONG),
)


def asked_of(asks: str, tol: float, tol_tension: float | None) -> float:
    rest = max(REST, 10.0 * tol)
    known = {"path": tol, "force": TENSION * tol if tol_tension is None else tol_tension}
    return known.get(asks, max(VELOCITY, rest) if asks == "velocity" else rest)


def compare(
    scene: Scene, a: Ladder, b: Ladder, *, tol: float = DEFAULT_TOL, tol_tension: float | None = None
) -> list[Agreement]:
    """All rows of two answers to one scene.

    tol : of path, place and mean speed;  tol_tension : of mean forces, default ten times `tol`.
    """
    from validation.core import laws  # loaded while solvers run

    whole = View.of(scene)
    asked = partial(asked_of, tol=tol, tol_tension=tol_tension)
    rows = list(independent(a.finest, b.finest))
    try:
        view = whole.cut(a.finest, b.finest)
    except NotComparable as why:
        return [Agreement("path_max", math.nan, nothing(why)), *rows]
    a = a.over(view)
    b = b.over(view)
    for quantity in TABLE:
        if quantity.concerns(view) and all(_tells(quantity, x.finest, view) for x in (a, b)):
            rows.append(_row(quantity, a, b, view, asked(quantity.asks)))
    rows += _worse_of(row for x in (a, b) for row in laws.hold(x, view.window, view.until, asked))
    if view.free:
        rows += [row for event in EVENTS for row in _event(event, a, b, asked("rest"))]
    rows += [*_range(a, b, view, whole, asked("rest")), _slack_onset(a, b, whole, asked("rest"))]
    unique = scene.groups.internal_damping > 0.0  # else waves of the slack cable have no answer to converge to
    return rows + [replace(row, asked=unique) for row in _past_slack(a, b, view, asked("rest"))]


def forces_left(scene: Scene, ladder: Ladder, tol: float) -> tuple[float, float]:
    """Parts of space and time in the worst bar of a mean force, over what is asked at `tol`."""
    try:
        view = View.of(scene).cut(ladder.finest)
    except NotComparable:
        return 0.0, 0.0
    asked = asked_of("force", tol, None)
    over = ladder.over(view)
    worst = (0.0, 0.0)
    for quantity in TABLE:
        if quantity.asks == "force" and quantity.concerns(view) and _tells(quantity, over.finest, view):
            found = over.parts(itself, partial(_apart, quantity, view))
            worst = max(worst, (found[0] / asked, found[1] / asked), key=sum)
    return worst


def _tells(quantity: Quantity, r: Response, view: View) -> bool:
    try:
        quantity.gap(r, r, view)
    except NotComparable:
        return quantity.name.startswith("path")
    return True


def _apart(quantity: Quantity, view: View, x: Response, y: Response) -> float:
    return quantity.gap(y, x, view)


def _row(quantity: Quantity, a: Ladder, b: Ladder, view: View, asked_for: float) -> Agreement:
    try:
        row = _compared(quantity.name, a, b, asked_for, itself, partial(_apart, quantity, view), quantity.order)
    except NotComparable as why:
        return Agreement(quantity.name, math.nan, nothing(why), law=quantity.law)
    where = measures.path_gap(a.finest, b.finest, view.window)[2] if quantity.name == "path_max" else None
    return replace(row, law=quantity.law, asked=bool(quantity.asks), where=where)


def _compared(
    name: str, a: Ladder, b: Ladder, asked_for: float, of: Of, apart: Apart = largest, order: float = 1.0
) -> Agreement:
    gap = apart(of(b.finest), of(a.finest))
    return _barred(name, gap, a, b, [x.parts(of, apart, order) for x in (a, b)], asked_for)


def _barred(
    name: str, gap: float, a: Ladder, b: Ladder, parts: list[tuple[float, float]], asked_for: float
) -> Agreement:
    bars = tuple(
        Part(x.finest.method, max(ROUNDING, sum(part)), "coarser runs") for x, part in zip((a, b), parts, strict=True)
    )
    return Agreement(name, gap, Bound("error bars", bars), asked_for=asked_for, parts=tuple(parts))


def independent(a: Response, b: Response) -> Iterator[Agreement]:
    """A row if two answers share a wing or their numbers."""
    wings = {METHODS[r.method].wing for r in (a, b) if r.method in METHODS}
    if len(wings) == 1 and all(r.method in METHODS for r in (a, b)):
        yield Agreement("independence", math.nan, nothing(f"both answers come from the wing {wings.pop()!r}"))
    if np.array_equal(a.v, b.v) and a.v.any():
        yield Agreement("independence", math.nan, nothing("both answers are the same numbers"))


# --- events and slack -----------------------------------------------------------------------------------------------


def happened(event: str, r: Response, after: int = 0) -> dict[str, Any] | None:
    """An event of the run, number `after` of its kind, or None."""
    return next(itertools.islice((x for x in r.events if x["event"] == event), after, None), None)


def _of_event(event: str, name: str, scale: float, r: Response, after: int = 0) -> float:
    found = happened(event, r, after)
    if found is None:
        raise NotComparable(f"{r.method} tells no {event}")
    return float(found[name]) / scale


def _event(event: str, a: Ladder, b: Ladder, asked_for: float) -> Iterator[Agreement]:
    runs = a.finest, b.finest
    told = [x for r in runs if (x := happened(event, r)) is not None]
    slack = min(r.slack_since for r in runs)
    if not told or min(x["t"] for x in told) > slack:
        return
    if len(told) < 2:
        bars = [(x.told(lambda r: happened(event, r) is not None), 0.0) for x in (a, b)]
        yield replace(_barred("events", 1.0, a, b, bars, asked_for), law=event)
        return
    for name, what, scale in (("t", "time", runs[1].t[-1]), ("speed", "speed", runs[1].speed.max())):
        if what == "time" or event not in ("stop", "turn"):
            row = _compared("events", a, b, asked_for, partial(_of_event, event, name, float(scale)))
            yield replace(row, law=f"{event}: {what}")


def with_bars(ladder: Ladder) -> list[dict[str, Any]]:
    """A run's events with bars bar_t [s], bar_s_o [m], bar_speed [m/s]; None if unknown."""

    def bar(x: dict[str, Any], name: str, after: int) -> float | None:
        return finite(ladder.bar(partial(_of_event, x["event"], name, 1.0, after=after), order=1.0))

    out = []
    kinds = [x["event"] for x in ladder.finest.events]
    for i, x in enumerate(ladder.finest.events):
        after = kinds[:i].count(x["event"])
        out.append(x | {f"bar_{name}": bar(x, name, after) for name in ("t", "s_o", "speed")})
    return out


def beside(a: Ladder, quasi_static: list[dict[str, Any]], asked_for: float) -> Iterator[Agreement]:
    """Shown rows: time over the ride's, speed over the largest, of events of the full and the quasi-static ride."""
    scales = {"t": ("time", float(a.run.t[-1])), "speed": ("speed", float(a.run.speed.max()))}
    for event in EVENTS[:3]:
        full, static = (next((x for x in of if x["event"] == event), None) for of in (a.run.events, quasi_static))
        if full is None or static is None:
            continue
        for name, (what, scale) in scales.items():
            own = finite(full[f"bar_{name}"])
            other = static[f"bar_{name}"]
            parts = (
                Part(a.run.method, math.inf if own is None else own / scale, "coarser runs"),
                Part("quasi-static", other / scale, "inertia of the rope"),
            )
            gap = abs(full[name] - static[name]) / scale
            law = f"{event}: {what}"
            bound = Bound("error bars", parts)
            yield Agreement("quasi-static", gap, bound, law=law, asked_for=asked_for, asked=False)


def _slack_onset(a: Ladder, b: Ladder, whole: View, asked_for: float) -> Agreement:
    """How far both answers are apart where the first cable goes slack; no slack counts as the window's end.

    Least tensions so far, over H, are falling curves over s_o/l.  Their distance is that of Levy: along a line of
    slope 1 through the onset, so that it is a difference of places at a steep front and of tensions on a gentle slope.
    """
    end = whole.window[1]
    first = min(end, a.finest.slack_from, b.finest.slack_from)

    def passes(r: Response) -> float:
        place = np.maximum.accumulate(r.s_o) / whole.length
        told = r.tension_min / whole.H
        least = np.minimum.accumulate(np.where(place < r.slack_from, told, np.minimum(told, 0.0)))
        n = int(np.searchsorted(place, end))
        last = float(np.interp(end, place, least))
        x = np.append(place[:n], [end, end])
        y = np.append(least[:n], [last, min(0.0, last)])
        return float(np.interp(first, x - y, y))

    return replace(_compared("slack_onset", a, b, asked_for, passes), where=first)


def _range(a: Ladder, b: Ladder, view: View, whole: View, asked_for: float) -> Iterator[Agreement]:
    """A row if an answer breaks before the window ends or the other goes slack."""
    if whole.free:
        broke = any(r.finest.status != "complete" and r.finest.slack_onset is None for r in (a, b))
        missing = max(0.0, 1.0 - view.until / max(float(x.finest.t[-1]) for x in (a, b))) if broke else 0.0
    else:
        missing = min(whole.window[1], a.finest.slack_from, b.finest.slack_from) - view.window[1]
    if missing > 1e-6:
        yield replace(_barred("range", missing, a, b, [(math.inf, 0.0)] * 2, asked_for), where=view.window[1])


def _past_slack(a: Ladder, b: Ladder, view: View, asked_for: float) -> Iterator[Agreement]:
    """Path gap from where both are slack to where the bars exceed the tolerance."""
    from validation.core import trust  # loaded while solvers run

    onset = max(a.finest.slack_from, b.finest.slack_from)
    end = min(SLACK_END, a.finest.reached, b.finest.reached)
    if view.rolls or not onset < end:
        return
    place = np.linspace(onset, end, 200)[1:-1]

    def apart(x: Response, y: Response) -> Array:
        return np.maximum.accumulate(np.nan_to_num(trust.gap(x, y, place), nan=math.inf))

    bars = [x.bar(itself, apart, 1.0) for x in (a, b)]
    allowed = sum(bars) * np.ones(place.size)
    gaps = apart(a.finest, b.finest)
    known = max(1, int(np.count_nonzero(np.maximum.accumulate(allowed) <= asked_for)))
    worst = int(np.argmax((gaps / allowed)[:known]))
    parts = [(float(np.ravel(bar * np.ones(place.size))[worst]), 0.0) for bar in bars]
    row = _barred("path_slack", float(gaps[worst]), a, b, parts, asked_for)
    yield replace(row, where=float(place[worst]))


# --- an answer and mechanics ----------------------------------------------------------------------------------------


def printed(scene: Scene, a: Response, b: Response) -> Iterator[Agreement]:
    """Check what both runs print against its second computation."""
    from validation.core import recomputed
    from validation.core.answers import outcome

    pairs = (a, b), (b, a)
    return _worse_of(row for r, twin in pairs for row in recomputed.rows(r, twin, outcome(scene, r)))


def _worse_of(rows: Iterable[Agreement]) -> Iterator[Agreement]:
    """Of each kind of row the one with the worse verdict, else the one nearer its bound."""
    worst: dict[tuple[str, str], Agreement] = {}
    for row in rows:
        key = row.quantity, row.law
        worst[key] = max(worst.get(key, row), row, key=_badness)
    yield from worst.values()


def _badness(row: Agreement) -> tuple[bool, float]:
    return row.gap > APART * row.allowed, row.gap / row.allowed if row.allowed > 0.0 else 0.0


# --- doubts ---------------------------------------------------------------------------------------------------------


def doubts(*runs: Response) -> list[tuple[str, Flag]]:
    return [(r.method, f) for r in runs for f in r.flags if f.kind in DOUBTS]
