"""The table of compared quantities, with scales and tolerances."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.agreement import (
    DEFAULT_TOL,
    FACTOR_DISAGREE,
    FORCES,
    Agreement,
    Bound,
    BoundPart,
    no_bound,
)
from validation.core.ladder import (
    Distance,
    Functional,
    Goal,
    Ladder,
    error_bars_of_at_least_gap,
    identity,
    max_distance,
    row_with_error_bars,
)
from validation.core.measures import SLACK_END, NotComparable
from validation.core.methods import METHODS
from validation.core.order import FIRST
from validation.core.scene_data import ordinate_on_unit_slope
from validation.core.store import nulls_for_nonfinite
from validation.core.view import View

Gap = Callable[[Response, Response, View], float]
Tolerance = Callable[[str], float]
Event = dict[str, Any]

AXIAL_MEAN = "mean over an axial round trip"
ALONG = "along the cable"
EVENTS = ("brake", "arrival", "back", "stop", "turn")  # both answers must have the first of each


def _any_car(view: View) -> bool:
    return True


class Quantity(NamedTuple):
    """One compared quantity.

    tolerance_kind : "path", "force" or "rest"; "" if only shown.  concerns : views that have the quantity.
    order : the most credited.
    """

    name: str
    gap: Gap
    tolerance_kind: str
    law: str = ""
    concerns: Callable[[View], bool] = _any_car
    order: float = math.inf


def _gap_of_path(part: str) -> Gap:
    """part : "largest" or "rms"."""
    return lambda x, y, view: getattr(measures.relative_path_gap(x, y, view.window), part)


def _gap_of_series(*names: str, over: str, mean: bool = False, largest: bool = False) -> Gap:
    """The rms (or largest) gap of series of a response.

    over : the scale, a field of the view.  mean : of means over an axial round trip.
    """

    def gap_of_runs(x: Response, y: Response, view: View) -> float:
        """Distance of the series of two runs."""
        scale = getattr(view, over)
        if over == "top_speed" and not scale:  # of a ride
            scale = float(y.speed.max())

        def series(r: Response) -> Array:
            """The named series side by side (n, c), over the scale."""
            columns = [getattr(r, name).reshape(r.t.size, -1) for name in names]
            values = np.concatenate(columns, axis=1) / scale
            stop = find_event("stop", r.events) if "speed" in names and view.free else None
            # past a lasting stop, whose time depends on axial waves, speeds are not compared
            return values if stop is None else np.where(r.t[:, None] <= stop["t"], values, math.nan)

        averaging_time = view.axial_round_trip if mean else 0.0
        return measures.series_gap(x, y, view.window, series, averaging_time, largest=largest)

    return gap_of_runs


def _gap_of_fields(gap: Callable[..., float], **options: bool) -> Gap:
    return lambda x, y, view: gap(x, y, view.window, **options)


_displacement_gap = partial(_gap_of_fields, measures.relative_displacement_gap)
_rolls = attrgetter("rolls")
_free = attrgetter("free")


def _force_quantities(mean: bool) -> list[Quantity]:
    """Forces at the car and the supports: judged as means over an axial round trip, else only shown.

    What a gripped car presses on the cable is only shown.
    """
    kind = "force" if mean else ""
    law = AXIAL_MEAN if mean else ""

    def force(name: str, *series: str, over: str, concerns: Callable[[View], bool] = _any_car) -> Quantity:
        return Quantity(name, _gap_of_series(*series, over=over, mean=mean), kind, law, concerns)

    return [
        force("tension_behind", "T_behind", over="H"),
        force("tension_ahead", "T_ahead", over="H"),
        force("reactions", "reaction_left", "reaction_right", over="H"),
        force("contact", "F_contact", over="weight", concerns=_rolls if mean else _any_car),
        force("haul_force", "F_haul", over="weight", concerns=lambda view: view.rolls and not view.free),
        force("thrust", "F_haul", over="weight", concerns=_free),
    ]


TABLE = (
    Quantity("path_max", _gap_of_path("largest"), "path"),
    Quantity("path_rms", _gap_of_path("rms"), "path"),
    Quantity("place", _gap_of_series("s_o", over="length", largest=True), "path", concerns=_free),
    Quantity("speed", _gap_of_series("speed", over="top_speed", mean=True), "path", AXIAL_MEAN, order=FIRST),
    *_force_quantities(mean=True),
    Quantity("tension", _gap_of_fields(measures.rms_tension_gap_over_H), "rest"),
    Quantity("displacement", _displacement_gap(), "rest"),
    Quantity("displacement", _displacement_gap(along_cable=True), "rest", ALONG),
    Quantity("speed", _gap_of_series("speed", over="top_speed", largest=True), ""),
    *_force_quantities(mean=False),
    Quantity("velocity", _displacement_gap(velocity=True), ""),
    Quantity("velocity", _displacement_gap(velocity=True, along_cable=True), "", ALONG),
)


def tolerance_of_quantity_kind(kind: str, tol: float, tol_tension: float | None) -> float:
    """The tolerance of a kind of quantity: "path", "force", "velocity", or any other."""
    if kind == "path":
        return tol
    if kind == "force":
        return FORCES * tol if tol_tension is None else tol_tension
    smallest = 0.1 if kind == "velocity" else 0.05  # velocity : summed, against displacement
    return max(smallest, 10.0 * tol)


def compare(
    scene: Scene, a: Ladder, b: Ladder, *, tol: float = DEFAULT_TOL, tol_tension: float | None = None
) -> list[Agreement]:
    """All rows of two answers to one scene, laws of mechanics among them.

    tol : of path, place and mean speed;  tol_tension : of mean forces, default ten times `tol`.
    """
    tolerance = partial(tolerance_of_quantity_kind, tol=tol, tol_tension=tol_tension)
    return compare_answers(scene, a, b, tolerance) + worse_law_rows(scene, a, b, tolerance)


def compare_answers(scene: Scene, a: Ladder, b: Ladder, tolerance: Tolerance) -> list[Agreement]:
    """The rows that compare two answers;  tolerance : of a kind of quantity, as `tolerance_of_quantity_kind`."""
    full = View.of_scene(scene).cut_where_mass_outruns_waves(a.finest, b.finest)
    rows = list(missing_independence_rows(a.finest, b.finest))
    try:
        view = full.cut_to_valid_range(a.finest, b.finest)
    except NotComparable as why:
        return [Agreement("path_max", math.nan, no_bound(why)), *rows]
    a = a.only_runs_covering(view)
    b = b.only_runs_covering(view)
    for quantity in TABLE:
        if quantity.concerns(view) and all(_gap_is_known(quantity, x.finest, view) for x in (a, b)):
            rows.append(_quantity_row(quantity, a, b, view, tolerance(quantity.tolerance_kind)))
    if view.free:
        for event in EVENTS:
            rows += _event_rows(event, a, b, tolerance("rest"))
    rows += _incomplete_range_rows(a, b, view, full, tolerance("rest"))
    rows.append(_slack_onset_row(a, b, full, tolerance("rest")))
    rows += _path_past_slack_rows(a, b, view, tolerance("rest"))
    return rows


def worse_law_rows(scene: Scene, a: Ladder, b: Ladder, tolerance: Tolerance) -> list[Agreement]:
    """The rows of laws of mechanics, each of the answer that keeps it worse; none if there is nothing to compare."""
    from validation.core import laws  # loaded while solvers run

    try:
        view = View.of_scene(scene).cut_to_valid_range(a.finest, b.finest)
    except NotComparable:
        return []
    ladders = a.only_runs_covering(view), b.only_runs_covering(view)
    rows: list[Agreement] = []
    for ladder in ladders:
        rows += laws.law_rows_in_si(ladder, view.window, view.until, tolerance)
    return list(_worse_row_of_each_quantity(rows))


def worst_force_goal(scene: Scene, ladder: Ladder, tol: float) -> Goal:
    """The bar of the mean force that most exceeds what is asked of forces at a path tolerance `tol`."""
    required = tolerance_of_quantity_kind("force", tol, None)
    worst = Goal((0.0, 0.0), required, FIRST)
    try:
        view = View.of_scene(scene).cut_to_valid_range(ladder.finest)
    except NotComparable:
        return worst
    ladder = ladder.only_runs_covering(view)
    for quantity in TABLE:
        is_force = quantity.tolerance_kind == "force" and quantity.concerns(view)
        if is_force and _gap_is_known(quantity, ladder.finest, view):
            parts = ladder.error_bars_in_space_and_time(identity, partial(_gap_in_view, quantity, view))
            worst = max(worst, Goal(parts, required, FIRST), key=lambda goal: goal.bar_over_target)
    return worst


def _gap_is_known(quantity: Quantity, r: Response, view: View) -> bool:
    """Whether a run has the quantity in the view; paths count as known, so that their row says why not."""
    try:
        quantity.gap(r, r, view)
    except NotComparable:
        return quantity.name.startswith("path")
    return True


def _gap_in_view(quantity: Quantity, view: View, fine: Response, coarse: Response) -> float:
    return quantity.gap(coarse, fine, view)


def _quantity_row(quantity: Quantity, a: Ladder, b: Ladder, view: View, required: float) -> Agreement:
    gap = partial(_gap_in_view, quantity, view)
    try:
        row = _functional_row(quantity.name, a, b, required, identity, gap, quantity.order)
    except NotComparable as why:
        return Agreement(quantity.name, math.nan, no_bound(why), law=quantity.law)
    where = None
    if quantity.name == "path_max":
        where = measures.relative_path_gap(a.finest, b.finest, view.window).position_of_largest
    return replace(row, law=quantity.law, decides=bool(quantity.tolerance_kind), where=where)


def _functional_row(
    name: str, a: Ladder, b: Ladder, required: float, functional: Functional, distance: Distance = max_distance,
    order: float = 1.0,
) -> Agreement:  # fmt: skip
    """The distance of a functional of both runs, with its bars;  order : the most credited."""
    gap = distance(functional(b.finest), functional(a.finest))
    parts = [ladder.error_bars_in_space_and_time(functional, distance, order) for ladder in (a, b)]
    return row_with_error_bars(name, gap, (a, b), parts, required)


def missing_independence_rows(a: Response, b: Response) -> Iterator[Agreement]:
    """A row if two answers share a wing, and one if they share their numbers."""
    ours = [METHODS[r.method] for r in (a, b) if r.method in METHODS]
    wings = {method.wing for method in ours}
    if len(wings) == 1 and len(ours) == 2:
        yield Agreement("independence", math.nan, no_bound(f"both answers come from the wing {wings.pop()!r}"))
    if np.array_equal(a.v, b.v) and a.v.any():
        yield Agreement("independence", math.nan, no_bound("both answers are the same numbers"))


# --- events and slack -----------------------------------------------------------------------------------------------


def find_event(event: str, events: Sequence[Event], index: int = 0) -> Event | None:
    """An event by its kind and its index among those of its kind, or None."""
    of_kind = [x for x in events if x["event"] == event]
    return of_kind[index] if index < len(of_kind) else None


def _numbered_events(events: Sequence[Event]) -> Iterator[tuple[Event, int]]:
    """Each event and its index among those of its kind."""
    counts: Counter[str] = Counter()
    for event in events:
        yield event, counts[event["event"]]
        counts[event["event"]] += 1


def _scaled_event_value(event: str, name: str, scale: float, r: Response, index: int = 0) -> float:
    """An entry of an event over a scale.  Raises NotComparable where the run has no such event."""
    row = find_event(event, r.events, index)
    if row is None:
        raise NotComparable(f"{r.method} has no {event}")
    return float(row[name]) / scale


def _event_rows(event: str, a: Ladder, b: Ladder, required: float) -> Iterator[Agreement]:
    """Rows of its time and speed, or one that only one run has it; none past a slack onset."""
    runs = a.finest, b.finest
    both = [find_event(event, r.events) for r in runs]
    instants = [x["t"] for x in both if x is not None]
    if not instants or min(instants) > min(r.slack_time_or_inf for r in runs):
        return
    if len(instants) < 2:
        yield _unpaired_event_row(event, a, b, required)
        return
    scales = _event_scales(runs[1])
    if event in ("stop", "turn"):
        del scales["speed"]
    for name, (what, scale) in scales.items():
        value = partial(_scaled_event_value, event, name, scale)
        row = _functional_row("events", a, b, required, value)
        yield replace(row, law=f"{event}: {what}")


def _unpaired_event_row(event: str, a: Ladder, b: Ladder, required: float) -> Agreement:
    """The row of an event that only one run has."""

    def has_event(r: Response) -> bool:
        return find_event(event, r.events) is not None

    parts = [ladder.yes_no_error_bars_in_space_and_time(has_event) for ladder in (a, b)]
    return replace(row_with_error_bars("events", 1.0, (a, b), parts, required), law=event)


def _event_scales(r: Response) -> dict[str, tuple[str, float]]:
    """What is compared of an event, in words, and over what: duration [s], top speed [m/s]."""
    return {"t": ("time", float(r.t[-1])), "speed": ("speed", float(r.speed.max()))}


EVENT_BARS = {"t": "bar_t", "s_o": "bar_s_o", "speed": "bar_speed"}


def events_with_error_bars(ladder: Ladder) -> list[Event]:
    """A run's events with bars bar_t [s], bar_s_o [m], bar_speed [m/s]; None if unknown."""
    barred = []
    for event, index in _numbered_events(ladder.finest.events):
        bars = {}
        for name, bar in EVENT_BARS.items():
            value = partial(_scaled_event_value, event["event"], name, 1.0, index=index)
            bars[bar] = nulls_for_nonfinite(ladder.error_bar(value, order=FIRST))
        barred.append(event | bars)
    return barred


def events_with_widened_error_bars(events: Sequence[Event], others: Sequence[Event]) -> list[Event]:
    """Events with bars of at least the gap to the same event of the other solver."""
    widened = []
    for event, index in _numbered_events(events):
        other = find_event(event["event"], others, index)
        widened.append(event | error_bars_of_at_least_gap(event, other, EVENT_BARS))
    return widened


def quasi_static_event_rows(a: Ladder, quasi_static: list[Event], required: float) -> Iterator[Agreement]:
    """Shown rows of events of the full and the quasi-static ride: time over duration, speed over top speed."""
    scales = _event_scales(a.finest)
    for event in EVENTS[:3]:
        full = find_event(event, a.finest.events)
        static = find_event(event, quasi_static)
        if full is None or static is None:
            continue
        for name, (what, scale) in scales.items():
            bar = full[EVENT_BARS[name]]
            of_full = BoundPart(a.finest.method, math.inf if bar is None else bar / scale, "coarser runs")
            of_static = BoundPart("quasi-static", static[EVENT_BARS[name]] / scale, "inertia of the rope")
            gap = abs(full[name] - static[name]) / scale
            bound = Bound("error bars", (of_full, of_static))
            law = f"{event}: {what}"
            yield Agreement("quasi-static", gap, bound, law=law, required=required, decides=False)


def _slack_onset_row(a: Ladder, b: Ladder, full: View, required: float) -> Agreement:
    """Row of the distance of both answers where the first cable goes slack; no slack counts as the window's end.

    Smallest tensions so far, over H, are falling curves over s_o/l; see `scene_data.ordinate_on_unit_slope`.
    """
    end = full.window[1]
    first = min(end, a.finest.slack_onset_position_or_inf, b.finest.slack_onset_position_or_inf)

    def crossing_ordinate(r: Response) -> float:
        """Ordinate at which the falling curve of a run meets the slope of 1 through the onset."""
        position = np.maximum.accumulate(r.s_o) / full.length  # (n,)
        tension = r.tension_min / full.H
        slack = position >= r.slack_onset_position_or_inf
        smallest = np.minimum.accumulate(np.where(slack, np.minimum(tension, 0.0), tension))
        at_end = float(np.interp(end, position, smallest))
        inside = position < end  # beyond, the curve drops to slack
        x = np.append(position[inside], [end, end])
        y = np.append(smallest[inside], [at_end, min(0.0, at_end)])
        return ordinate_on_unit_slope(x, y, first)

    return replace(_functional_row("slack_onset", a, b, required, crossing_ordinate), where=first)


def _incomplete_range_rows(a: Ladder, b: Ladder, view: View, full: View, required: float) -> Iterator[Agreement]:
    """A row if an answer breaks before the window ends or the other goes slack."""
    runs = a.finest, b.finest
    missing = 0.0
    if not full.free:
        onset = min(r.slack_onset_position_or_inf for r in runs)
        missing = min(full.window[1], onset) - view.window[1]
    elif any(r.status != "complete" and r.slack_onset is None for r in runs):
        longest = max(float(r.t[-1]) for r in runs)
        missing = max(0.0, 1.0 - view.until / longest)
    if missing > 1e-6:
        unknown = [(math.inf, 0.0)] * 2
        yield replace(row_with_error_bars("range", missing, (a, b), unknown, required), where=view.window[1])


def _path_past_slack_rows(a: Ladder, b: Ladder, view: View, required: float) -> Iterator[Agreement]:
    """Path gap from where both are slack to where the bars exceed the tolerance."""
    from validation.core import trust  # loaded while solvers run

    onset = max(a.finest.slack_onset_position_or_inf, b.finest.slack_onset_position_or_inf)
    end = min(SLACK_END, a.finest.reached, b.finest.reached)
    if view.rolls or not onset < end:
        return
    positions = np.linspace(onset, end, 200)[1:-1]  # s_o/l, (n,)

    def largest_so_far(x: Response, y: Response) -> Array:
        distances = trust.path_distances_over_deflection(x, y, positions)
        return np.maximum.accumulate(np.nan_to_num(distances, nan=math.inf))

    bar_a, bar_b = (np.broadcast_to(x.error_bar(identity, largest_so_far, FIRST), positions.shape) for x in (a, b))
    allowed = bar_a + bar_b
    gaps = largest_so_far(a.finest, b.finest)
    within = int(np.count_nonzero(np.maximum.accumulate(allowed) <= required))
    worst = int(np.argmax((gaps / allowed)[: max(1, within)]))
    parts = [(float(bar[worst]), 0.0) for bar in (bar_a, bar_b)]
    row = row_with_error_bars("path_slack", float(gaps[worst]), (a, b), parts, required)
    yield replace(row, decides=False, where=float(positions[worst]))


# --- an answer and mechanics ----------------------------------------------------------------------------------------


def worse_recomputed_rows(scene: Scene, a: Response, b: Response) -> Iterator[Agreement]:
    """Rows of what both runs print against its second computation, of each kind the worse one."""
    from validation.core import recomputed
    from validation.core.answers import outcome_of_run

    rows: list[Agreement] = []
    for r, counterpart in ((a, b), (b, a)):
        rows += recomputed.recomputed_rows(r, counterpart, outcome_of_run(scene, r))
    return _worse_row_of_each_quantity(rows)


def _worse_row_of_each_quantity(rows: Iterable[Agreement]) -> Iterator[Agreement]:
    """The one with the worse verdict, else the one nearer its bound."""
    worst: dict[tuple[str, str], Agreement] = {}
    for row in rows:
        key = row.quantity, row.law
        worst[key] = max(worst.get(key, row), row, key=_disagreement_and_relative_gap)
    yield from worst.values()


def _disagreement_and_relative_gap(row: Agreement) -> tuple[bool, float]:
    """Whether it disagrees, and its gap over the bound."""
    disagrees = row.gap > FACTOR_DISAGREE * row.allowed
    return disagrees, row.gap / row.allowed if row.allowed > 0.0 else 0.0
