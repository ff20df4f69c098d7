"""Verdicts: do two answers agree within what both say of their own errors, and with mechanics?

Every row can disagree, and a row whose bars are wider than its ceiling says nothing ("too coarse").
"""

from __future__ import annotations

import enum
import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.newmark import scheme
from cablefem.response import Array, Flag, Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.bounds import Bound, Part, nothing
from validation.core.estimate import SLACK_END, Estimated
from validation.core.flags import flag
from validation.core.measures import NotComparable, Window
from validation.core.methods import METHODS
from validation.core.richardson import NO_ORDER, SAFETY, UNCONFIRMED, no_order, time_order

if TYPE_CHECKING:
    from validation.core.laws import Held

DEFAULT_TOL = 1e-3
CEILING = 0.05  # of a row's own scale at the default tolerance: bars wider than that say nothing
WIDEST = 0.5  # for looser tolerances, to which ceilings are raised in proportion
TENSION = 10.0  # times the tolerance of the path is that of the tension, of H, unless it is given
# s_o/l by which the compared range may end before 0.80 or both slack onsets
SHORT_RANGE = 0.05


class Verdict(enum.Enum):
    """In the order in which they decide the whole."""

    DISAGREE, NOT_COMPARABLE, TOO_COARSE, AGREE = "disagree", "not comparable", "too coarse", "agree"


@dataclass(frozen=True, slots=True)
class Agreement:
    """One row of a verdict: a gap, and the bound that says how much is allowed and why."""

    quantity: str
    gap: float
    bound: Bound
    where: float | None = None  # s_o/l of the largest gap
    party: str = ""  # the third party that is held against our better solver
    law: str = ""  # of several rows of one quantity, what this one is about

    @property
    def allowed(self) -> float:
        return self.bound.value

    @property
    def allowed_because(self) -> str:
        return str(self.bound)

    @property
    def verdict(self) -> Verdict:
        if not (math.isfinite(self.gap) and math.isfinite(self.allowed)):
            return Verdict.NOT_COMPARABLE
        if self.gap > self.allowed * (1.0 if self.bound.tol is None else NO_ORDER):
            return Verdict.DISAGREE  # of bars beyond a ceiling nobody knows the order: see `settled`
        return Verdict.AGREE if self.bound.tol is None else Verdict.TOO_COARSE

    def row(self) -> dict[str, Any]:
        """Return the row for agreement.json; a number that does not exist is null."""
        return {
            "quantity": self.quantity, "gap": self.gap if math.isfinite(self.gap) else None,
            "allowed": self.allowed if math.isfinite(self.allowed) else None,
            "allowed_because": self.allowed_because, "bound": self.bound.row(), "verdict": self.verdict.value,
            "where": self.where, **({"law": self.law} if self.law else {}),
            **({"with": self.party} if self.party else {}),
        }  # fmt: skip

    def at_most(self, ceiling: float) -> Agreement:
        """Return the row, too coarse where more than the ceiling is allowed."""
        return replace(self, bound=replace(self.bound, tol=ceiling)) if self.allowed > ceiling else self


AXIAL_MEAN = "mean over an axial round trip"  # what a load cell sees: fronts keep the rest from converging pointwise


ALONG, SUMMED, UP_TO = "along the cable", "summed over time", "up to the mass"


def overall(rows: list[Agreement]) -> Verdict:
    """Return the first of disagree, not comparable and too coarse that any row is, else agree; without rows none.

    A row that fronts make too coarse is not asked where the mean of its quantity over their way agrees; the mean of
    the velocity over time is the displacement, frames that are far apart say little of its integral, and where fronts
    pass the mass, stations of where it goes to there.  What letting go and braking send along the cable of a free ride
    rings on for all of it: its tension field is as good as the means at mass and supports.
    """
    verdicts = {row.verdict for row in _asked(rows)} or {Verdict.NOT_COMPARABLE}
    return next(verdict for verdict in Verdict if verdict in verdicts)


def _asked(rows: list[Agreement]) -> list[Agreement]:
    agreed = [row for row in rows if row.verdict is Verdict.AGREE]
    known = {row.quantity for row in agreed if row.law == AXIAL_MEAN}
    known |= {"velocity" for row in agreed if row.quantity == "displacement"}
    rides = any(row.quantity == "place" for row in rows)
    known |= {"tension"} if rides and known >= {"tension_behind", "tension_ahead", "reactions"} else set()
    pointwise = [row for row in rows if row.verdict is Verdict.TOO_COARSE and row.law in ("", ALONG, SUMMED, UP_TO)]
    return [row for row in rows if row not in pointwise or row.quantity not in known]


def wide(rows: list[Agreement]) -> list[Agreement]:
    """Return the rows that are too coarse and have to be mended.

    Who mends a mean over fronts need not mend what they make of the same quantity pointwise.
    """
    coarse = [row for row in _asked(rows) if row.verdict is Verdict.TOO_COARSE]
    means = {row.quantity for row in coarse if row.law == AXIAL_MEAN}
    return [row for row in coarse if row.law or row.quantity not in means]


def wanting(rows: list[Agreement], methods: list[str]) -> list[str]:
    """Return the methods whose own bars are more than half of what a row too coarse may allow; all where none is."""
    bounds = [row.bound for row in wide(rows)]
    found = [
        name for name in methods
        if any(sum(part.value for part in x.parts if part.name == name) > 0.5 * (x.tol or 0.0) for x in bounds)
    ]  # fmt: skip
    return found or methods


# Times the tolerance that is asked of the path: what rows about the path may allow of their own scales, whatever their
# bars were.  The scale of a ride's path is a tenth of the length.
OF_PATH = {"path_max": 1.0, "path_rms": 1.0, "place": 0.1, "speed": 1.0, "events": 1.0}


def settled(
    rows: list[Agreement], before: list[Agreement] | None, ratio: float = 2.0, tol: float = 0.0
) -> list[Agreement]:
    """Return rows in which only such gaps disagree as stay when both answers are refined.

    Of many bars from two grids each some are too small by chance.  A gap that refinement takes away is the answers'
    own: where it falls, three times what halving would take is its bar, and where nothing was refined, or the bars are
    said to be no bound, three times the bars are (Eca & Hoekstra, for whatever shows no order); within either a row is
    too coarse to tell.  One of the path agrees within either if that is no more than was asked for, and within three
    times its bars even if the gap stays: of bars from many grids some are too small by chance, again.

    before : the rows of the same two methods before both were refined; None: they were not.
    ratio : of that refinement; a smaller one takes less of what there is.
    tol : asked of the path; 0: bars that proved too small are no bar for that either.
    """
    earlier = {(row.quantity, row.law): row for row in before or []}
    return [_settled(row, before is None, earlier.get((row.quantity, row.law)), no_order(ratio), tol) for row in rows]


def _settled(row: Agreement, alone: bool, earlier: Agreement | None, times: float, tol: float) -> Agreement:
    if row.verdict is not Verdict.DISAGREE:
        return row
    enough = OF_PATH.get(row.quantity, 0.0) * tol
    parts = tuple(replace(part, value=NO_ORDER * part.value) for part in row.bound.parts)
    wider = replace(row.bound, parts=parts, notes=(*row.bound.notes, f"{NO_ORDER:g} times: no order is confirmed"))
    if not (alone or row.gap <= wider.value <= enough):
        taken = max(0.0, earlier.gap - row.gap) if earlier is not None else 0.0
        wider = Bound("taken", (Part("refinement", times * taken),), {"bars": row.allowed, "times": times})
    if row.gap > wider.value:
        return row
    return replace(row, bound=replace(wider, tol=None if wider.value <= enough else row.allowed))


Gap = Callable[[Response, Response, Window], float]


def agree(
    scene: Scene, a: Estimated, b: Estimated, *, tol: float | None = None, tol_tension: float | None = None,
    window: Window | None = None,
) -> list[Agreement]:  # fmt: skip
    """Compare two estimated runs; every allowed gap is the sum of the two solvers' own error bars.

    What it needs takes longer to load than many a run, and is loaded here: while solvers run, others may load it.

    tol : asked of the mass path: where the bars exceed it, the row is "too coarse"; default 5 percent.
    tol_tension : the same, over H, for tension at the mass and reactions, averaged over an axial wave's way there and
        back; default ten times `tol`.  Pointwise, where fronts ring, it is the ceiling of all other rows: 5 percent,
        and for a looser `tol` in proportion more.
    window : s_o/l; default 0.02 to 0.80 or the slack onset of any of the runs, whichever comes first.
    """
    if tol is not None and tol_tension is None:
        tol_tension = TENSION * tol
    ceiling = min(WIDEST, CEILING * max(1.0, (tol or 0.0) / DEFAULT_TOL))
    rows, slack = list(_independent(a, b)), _slack_onset(a, b).at_most(ceiling)
    try:
        window = measures.window_of(*a.runs, *b.runs, window=window)
    except NotComparable as error:
        return [Agreement("path_max", math.nan, nothing(error)), *rows, slack]
    H, axial = scene.horizontal_tension, 2.0 * scene.length / scene.axial_speed
    kinds = _of_path, _own, _ringing, _first
    on_path, smooth, ringing, raw = (partial(_compared, a, b, window, orders) for orders in kinds)
    where = measures.place_of_gap(a.response, b.response, window)
    path = [replace(on_path("path_max", _path(0)), where=where), on_path("path_rms", _path(1))]
    pointwise, means = [ringing("tension", measures.tension_gap)], []
    for name, of in (
        ("tension_behind", partial(_series, "T_behind", H)), ("tension_ahead", partial(_series, "T_ahead", H)),
        ("reactions", partial(_series, ("reaction_left", "reaction_right"), math.sqrt(2.0) * H)),
    ):  # fmt: skip
        pointwise.append(raw(name, partial(_series_gap, of, 0.0)))
        means.append(ringing(name, partial(_series_gap, of, axial), law=AXIAL_MEAN))
    fields = [smooth("displacement", measures.displacement_gap), smooth("velocity", measures.velocity_gap)]
    fields.append(smooth("displacement", partial(measures.displacement_gap, along=True), law=ALONG))
    fields.append(ringing("velocity", partial(measures.velocity_gap, along=True), law=ALONG))
    held = [_law("energy", _energy_series(scene), a, b, window), *_laws(a, b, window)]
    fields += _ride(scene, a, b, smooth, ringing, axial)
    if any(row.allowed > max(tol_tension or ceiling, ceiling) for row in pointwise):
        slack = _untold(slack)
    waits = 2.0 * axial / float(b.run.t[-1])  # of both: no refinement tells sooner when axial waves let a car stand
    return [
        *(row.at_most(min(tol or ceiling, ceiling)) for row in path),
        *(row.at_most(tol_tension or ceiling) for row in means),
        *(row.at_most(max(tol_tension or ceiling, ceiling)) for row in pointwise),
        *(row.at_most(ceiling + waits * (row.law in WHEN_STILL)) for row in [*fields, *held]),
        *_range(a, b, window), *rows, slack, *(row.at_most(ceiling) for row in _past_slack(a, b)),
    ]  # fmt: skip


# --- two answers ----------------------------------------------------------------------------------------------------

# One-sided slopes at the mass and what rings with axial waves converge with first order: the gap to half the resolution
# and half the steps is what is left.
CHANGED = "the change from half the resolution and half the steps"
FIRST_ORDER = f"{CHANGED}, times {SAFETY}"

# Steps that damp axial waves tell nothing of them, nor do half as many: a run that lets them ring does.
HEARD = f"; and the change from a run in which axial waves ring, times {SAFETY}"

Weights = Callable[[Estimated], tuple[float, float, float, str]]


def _of_path(e: Estimated) -> tuple[float, float, float, str]:
    return (*e.path_weights, 0.0, e.basis)


def _own(e: Estimated) -> tuple[float, float, float, str]:
    """Weights of the changes by half the resolution and half the steps, as for the path where no ladder tells more."""
    return (*e.weights, SAFETY, e.basis)


def _first(e: Estimated) -> tuple[float, float, float, str]:
    return SAFETY, SAFETY, SAFETY, FIRST_ORDER


def _ringing(e: Estimated) -> tuple[float, float, float, str]:
    """Weights for what rings with axial waves: first order in time where steps miss them."""
    missed = "; steps do not resolve axial waves: of first order in them" if e.rings else ""
    return (*e.tension_weights, SAFETY, f"{e.basis}{missed}")


def _compared(
    a: Estimated, b: Estimated, window: Window, weights: Weights, name: str, gap: Gap, law: str = ""
) -> Agreement:
    """Return the gap of two answers and the sum of their bars; a measure that refuses says why."""

    def bar(e: Estimated) -> Part:
        in_space, in_time, heard, basis = weights(e)
        value = in_space * gap(e.run, e.in_space, window) + in_time * gap(e.run, e.in_time, window)
        if heard and e.loud is not None and e.loud.reached >= window[1] * (1.0 - 1e-6):
            value, basis = value + heard * gap(e.run, e.loud, window), basis + HEARD
        return Part(e.run.method, value, basis)

    try:
        return Agreement(name, gap(a.response, b.response, window), Bound("error bars", (bar(a), bar(b))), law=law)
    except NotComparable as why:
        return Agreement(name, math.nan, nothing(why), law=law)


def _path(i: int) -> Gap:
    return lambda x, y, window: measures.path_gap(x, y, window)[i]


def _series(names: str | tuple[str, ...], scale: float, r: Response) -> Array:
    names = (names,) if isinstance(names, str) else names
    return np.concatenate([getattr(r, name).reshape(r.t.size, -1) for name in names], axis=1) / scale


def _series_gap(of: Callable[[Response], Array], axial: float, x: Response, y: Response, window: Window) -> float:
    return measures.series_gap(x, y, window, of, axial)


def _ride(
    scene: Scene, a: Estimated, b: Estimated, smooth: Callable[..., Agreement], ringing: Callable[..., Agreement],
    axial: float,
) -> list[Agreement]:  # fmt: skip
    """Return the rows of a car that rolls: place and speed over time, contact and haul force, events.

    Never ds_o/dt, which rings with axial waves whatever the resolution; |dp/dt| is smooth.
    """
    if a.run.drive == "grip":
        return []
    assert scene.mass is not None
    weight = scene.mass.mass * scene.gravity
    out = []
    for name in ("F_contact", "F_haul"):
        if all(np.isfinite(getattr(e.run, name)).sum() > 3 for e in (a, b)):
            of = partial(_series, name, weight)
            quantity = {"F_contact": "contact", "F_haul": "haul_force"}[name]
            out.append(ringing(quantity, partial(_series_gap, of, axial), law=AXIAL_MEAN))
    if a.run.drive == "free":
        top = float(b.run.speed.max())

        def largest(of: Callable[[Response], Array]) -> Gap:
            return lambda x, y, window: measures.series_gap(x, y, window, of, largest=True)

        out.append(smooth("place", largest(partial(_series, "s_o", scene.length))))
        out.append(ringing("speed", largest(lambda r: _until_stop(r, r.speed / top))))
        out += [row for event in sorted({x["event"] for e in (a, b) for x in e.run.events} & set(EVENTS))
                for row in _event(event, a, b, axial, top)]  # fmt: skip
    return out


def _until_stop(r: Response, values: Array) -> Array:
    """Return values (n,) with nan past a lasting stop: braking ends at once, at a time that axial waves decide."""
    stop = happened("stop", r)
    return values if stop is None else np.where(r.t <= stop["t"], values, math.nan)


EVENTS = ("brake", "arrival", "back", "stop", "turn")  # whose first happening both answers must tell


WHEN_STILL = ("stop: time", "turn: time")


def _event(event: str, a: Estimated, b: Estimated, axial: float, top: float) -> Iterator[Agreement]:
    """Give the gaps of an event's time, over that of the ride, and of the car's speed there, over its largest."""
    for name, scale in (("t", float(b.run.t[-1])), ("speed", top)):
        if name == "speed" and event in ("stop", "turn"):
            continue
        values = [happened(event, e.run) for e in (a, b)]
        law = f"{event}: {'time' if name == 't' else 'speed'}"
        told = [x["t"] for x in values if x is not None]
        broke = [e.run for e, x in zip((a, b), values, strict=True) if x is None and e.run.status != "complete"]
        if broke and broke[0].t[-1] < told[0]:
            yield Agreement("events", math.nan, nothing(f"{broke[0].method} could not go on as far"), law=law)
            continue
        if len(told) < 2:
            alone = Bound("error bars", tuple(Part(e.run.method, 0.0, "an event of one answer alone") for e in (a, b)))
            yield Agreement("events", 1.0, alone, law=law)
            continue
        if any(_past_its_slack(event, e) for e in (a, b)):
            continue
        parts = tuple(Part(e.run.method, _bar(event, e, axial)[name] / scale, FIRST_ORDER) for e in (a, b))
        first, second = (x[name] for x in values if x is not None)
        yield Agreement("events", abs(first - second) / scale, Bound("error bars", parts), law=law)


def _past_its_slack(event: str, e: Estimated) -> bool:
    """Return whether an event comes after the cable is slack, and a companion broke there and never came to it."""
    mine, *others = (happened(event, r) for r in e.runs)
    broke = (x is None and r.status != "complete" for x, r in zip(others, e.runs[1:], strict=True))
    return mine is not None and mine["t"] > e.run.slack_since and any(broke)


def happened(event: str, r: Response, after: int = 0) -> dict[str, Any] | None:
    """Return the first happening of an event, or that after so many."""
    return next(itertools.islice((x for x in r.events if x["event"] == event), after, None), None)


def _bar(event: str, e: Estimated, axial: float, after: int = 0) -> dict[str, float]:
    """Return the bars of an event's t, s_o and speed; a stop comes when axial waves let it, no better.

    A companion in which it does not happen as often says nothing of the others: their bars are infinite.
    """
    mine, *others = (happened(event, r, after) for r in e.runs)
    count = [sum(x["event"] == event for x in r.events) for r in e.runs]
    if after and len(set(count)) > 1:
        others = [None]
    assert mine is not None
    bars = {}
    for name in ("t", "s_o", "speed"):
        apart = [math.inf if x is None else abs(x[name] - mine[name]) for x in others]
        bars[name] = SAFETY * sum(apart) + (axial if name == "t" and event in ("stop", "turn") else 0.0)
    if event in ("brake", "arrival", "back"):  # it comes when the car does: changes up to there may cancel, there
        before = e.run.t <= mine["t"]
        t, coarser = e.run.t[before], (e.in_space, e.in_time)

        def changed(name: str) -> float:
            of_run = getattr(e.run, name)[before]
            return SAFETY * sum(float(np.abs(np.interp(t, c.t, getattr(c, name)) - of_run).max()) for c in coarser)

        bars["speed"] = max(bars["speed"], changed("speed"))
        bars["t"] = max(bars["t"], changed("s_o") / mine["speed"] if mine["speed"] else math.inf)
    return bars


def with_bars(scene: Scene, e: Estimated) -> list[dict[str, Any]]:
    """Return the events of a run with bars: bar_t [s], bar_s_o [m], bar_speed [m/s], None where none can be made."""
    axial, out, seen = 2.0 * scene.length / scene.axial_speed, [], Counter[str]()
    for x in e.run.events:
        known = _bar(x["event"], e, axial, seen[x["event"]])
        seen[x["event"]] += 1
        bars = {f"bar_{n}": v if math.isfinite(v := known.get(n, math.inf)) else None for n in ("t", "s_o", "speed")}
        out.append({**x, **bars})
    return out


def _independent(a: Estimated, b: Estimated) -> Iterator[Agreement]:
    """Give a row where the two answers cannot check each other: of one wing, or the same numbers."""
    wings = {METHODS[e.run.method].wing for e in (a, b) if e.run.method in METHODS}
    if len(wings) == 1 and all(e.run.method in METHODS for e in (a, b)):
        yield Agreement("independence", math.nan, nothing(f"both answers come from the wing {wings.pop()!r}"))
    if np.array_equal(a.response.v, b.response.v) and a.response.v.any():
        yield Agreement("independence", math.nan, nothing("both answers are the same numbers"))


def _onset(r: Response) -> float:
    """Return where a cable goes slack, as far as the window of comparison goes."""
    return min(measures.WINDOWS[r.drive][1], math.inf if r.slack_onset is None else r.slack_onset)


def _slack_onset(a: Estimated, b: Estimated) -> Agreement:
    """Return how far the slack onsets before 0.80 are apart, in s_o/l; no slack before it counts as 0.80."""
    parts = []
    for e in (a, b):
        # an onset is a step, so no better than that
        step = float(np.diff(e.run.s_o).max(initial=0.0)) / e.run.length  # none where a run has found no start
        spread = max(abs(_onset(e.run) - _onset(c)) for c in (e.in_space, e.in_time))
        parts.append(Part(e.run.method, SAFETY * spread + step, FIRST_ORDER))
    gap = abs(_onset(a.run) - _onset(b.run))
    where = min(_onset(a.run), _onset(b.run))
    return Agreement("slack_onset", gap, Bound("error bars", tuple(parts)), where if gap else None)


def _untold(slack: Agreement) -> Agreement:
    """Return the row of slack onsets where tension is too coarse to tell: nor is it told then where it is none.

    By a support, where waves are squeezed, all grids of one answer may call a cable slack that finer ones do not.
    """
    if slack.verdict is not Verdict.DISAGREE:
        return slack
    of = Part("tension", slack.gap, "too coarse to tell where there is none")
    return replace(slack, bound=replace(slack.bound, parts=(*slack.bound.parts, of), tol=slack.allowed))


def _range(a: Estimated, b: Estimated, window: Window) -> Iterator[Agreement]:
    """Give a row where the compared range ends before both slack onsets, or 0.80."""
    wanted = max(_onset(a.run), _onset(b.run))
    if window[1] < wanted - SHORT_RANGE:
        why = f"compared up to s_o/l = {window[1]:.3f} only, while one of the answers goes on taut to {wanted:.3f}"
        yield Agreement("range", wanted - window[1], nothing(why), window[1])


def _past_slack(a: Estimated, b: Estimated) -> Iterator[Agreement]:
    """Give the gap of the paths past the slack onset, where it is largest against what is allowed up to there.

    It is looked for as far as both answers together still know the path to 5 percent.
    """
    if a.late is None or b.late is None:
        return
    from validation.core import trust  # see `agree`

    pairs = [(a.run, a.late), (b.run, b.late)]
    onset = min(r.slack_onset or math.inf for pair in pairs for r in pair)
    end = min([SLACK_END, *(r.reached for pair in pairs for r in pair)])
    if not onset < end:
        return
    place = np.linspace(onset, end, 200)[1:-1]
    bars = [UNCONFIRMED * np.maximum.accumulate(trust.gap(run, late, place)) for run, late in pairs]
    allowed = bars[0] + bars[1]
    known = max(1, int(np.count_nonzero(allowed <= CEILING)))
    gaps = np.maximum.accumulate(trust.gap(a.run, b.run, place))
    worst = int(np.argmax((gaps / allowed)[:known]))
    parts = tuple(
        Part(run.method, float(bar[worst]), LATE.format(place[worst]))
        for (run, _), bar in zip(pairs, bars, strict=True)
    )
    yield Agreement("path_slack", float(gaps[worst]), Bound("error bars", parts), float(place[worst]))


LATE = f"the largest change from half of both up to s_o/l = {{:.3f}}, times {UNCONFIRMED}"

# A wing whose own time error, brought to as many steps, is so many times its twin's steps at a lower order.
MOST_UNLIKE = 4.0
SHORT_OF = 0.5  # by which the order that a ladder shows may fall short of the scheme's
# What says that an error bar may be too small: the verdict stands, but nobody should build on it.
DOUBTS = ("fast", "slow waves", "energy", "hidden slack", "no bar", "short bar", "time order")
UNBOUNDED = ("fast", "slow waves", "hidden slack")  # of these, what the cable does, whatever run tells it


def doubts(a: Estimated, b: Estimated) -> list[tuple[str, Flag]]:
    """Return the methods and flags that say of two answers that their bars may be too small."""
    found = [(e.run.method, f) for e in (a, b) for f in e.run.flags if f.kind in DOUBTS]
    try:
        window = measures.window_of(*a.runs, *b.runs)
        change = [measures.path_gap(e.run, e.in_time, window)[1] for e in (a, b)]
    except NotComparable:
        return found
    steps = [e.run.settings["steps"] for e in (a, b)]
    orders = [scheme(e.run.settings["scheme"]).order for e in (a, b)]
    for e, i in ((a, 0), (b, 1)):
        if orders[i] < orders[1 - i]:
            continue  # a twin of higher order is no measure
        # brought to as many steps by the scheme's second order, and by the first that unresolved fronts have
        ratio = min((change[i] * steps[i] ** p) / (change[1 - i] * steps[1 - i] ** p or math.inf) for p in (1, 2))
        if ratio > MOST_UNLIKE and (e.order is None or e.order < time_order(e.run.settings) - SHORT_OF):
            found.append((e.run.method, flag("time order", ratio=ratio)))
    return found


# --- an answer and mechanics ----------------------------------------------------------------------------------------

Series = Callable[[Response], Array]


TRAPEZOIDS = 1e-4  # of weight times deflection: work summed by trapezoids


def _energy_series(scene: Scene) -> Series:
    assert scene.mass is not None
    weight = scene.mass.mass * scene.gravity
    return lambda r: measures.energy_defect(r)[:, None] / (weight * r.max_deflection)


def _law(name: str, series: Series, a: Estimated, b: Estimated, window: Window) -> Agreement:
    """Hold a law of mechanics, whose exact defect is zero, against each run: its defect must be its error bar.

    Of a ride that comes back from a slack cable, until that was: see `laws.energy`.
    """
    found = []
    for e in (a, b):
        defect, taut = series(e.run), e.run.slack_since
        gap = _rms(defect[measures.inside(e.run, window) & (e.run.t <= taut)])

        def distance(x: Response, y: Response) -> float:
            coarse, fine = (x, y) if x.t.size <= y.t.size else (y, x)
            inside = measures.inside(coarse, window) & (coarse.t <= taut)  # noqa: B023
            return _rms((series(coarse) - measures.at_steps_of(coarse, fine, np.nan_to_num(series(fine))))[inside])

        bar = UNCONFIRMED * (distance(e.run, e.in_space) + distance(e.run, e.in_time)) + TRAPEZOIDS
        basis = f"{CHANGED}, times {UNCONFIRMED}, and {TRAPEZOIDS:g} for trapezoids"
        found.append(Agreement(name, gap, Bound("law", (Part(e.run.method, bar, basis),))))
    return _worse(found)


def _laws(a: Estimated, b: Estimated, window: Window) -> Iterator[Agreement]:
    """Hold both runs against mechanics in SI, as the judge knows it by itself; a row for each law, of the worse run."""
    from validation.core import laws  # see `agree`
    from validation.core.ladder import Branch, Ladder

    found: dict[str, list[Agreement]] = {}
    for e in (a, b):
        space, time = (Branch((x,), (2.0,), 2.0) for x in (e.in_space, e.in_time))
        for x in laws.hold(Ladder(e.run, space, time), window):
            found.setdefault(x.law, []).append(_held(e.run.method, x))
    yield from map(_worse, found.values())


def _held(method: str, x: Held) -> Agreement:
    name, law = x.quantity, "" if x.law == x.quantity else x.law
    if not math.isfinite(x.gap + x.bar):
        return Agreement(name, math.nan, nothing(f"{method} or a companion does not say what it asks for"), law=law)
    parts = Part(method, x.bar, CHANGED), Part(method, x.sampling, "sampling of its fields")
    return Agreement(name, x.gap, Bound("law", parts), x.where, law=law)


def _worse(rows: list[Agreement]) -> Agreement:
    """Return the row with the worse verdict, of equal ones that which leaves less of what it is allowed."""
    order = list(Verdict)
    return min(rows, key=lambda row: (order.index(row.verdict), -row.gap / row.allowed if row.allowed > 0.0 else 0.0))


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(x), axis=-1))))
