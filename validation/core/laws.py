"""Laws of mechanics in SI, checked on a response and the scene's TOML alone: they see faults that both wings share.

A defect is over the law's own scale, zero for the exact answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cablefem.response import Array, Response
from validation.core import rest, timetable
from validation.core.agreement import Agreement, Bound, BoundPart
from validation.core.evidence import Evidence, Side, Window, Windows, cross_product
from validation.core.order import FIRST, SAFETY, error_bar
from validation.core.scene_data import ROUNDING

MAX_FRAME_INTERVAL = 0.1  # of a transverse wave's time along the cable: rarer frames hide velocities
MIN_ROLLING_SPEED = 0.05  # of the top speed: below it friction's direction is not checked
DOWN = np.array([0.0, 1.0])


@dataclass(frozen=True, slots=True)
class Defect:
    """Defect of a law at positions s_o/l (nan: anywhere); its size is the rms, or that of the mean."""

    s_o: Array  # (k,)
    value: Array  # (k, c)
    averaged: bool = False

    @property
    def size(self) -> Array:
        if self.averaged:
            return np.abs(np.mean(self.value, axis=0))
        return np.sqrt(np.mean(self.value**2, axis=0))

    def distance(self, a: Array, b: Array) -> Array:
        """Distance (c,) of two values (k, c) of this law.

        Changes of single frames may cancel in a mean by chance: it is uncertain by their rms over the root of k.
        """
        if a.shape != b.shape or not np.isfinite(b).all():
            return np.full(a.shape[1], math.inf)
        rms = np.sqrt(np.mean((a - b) ** 2, axis=0))
        if not self.averaged:
            return rms
        return np.maximum(np.abs(np.mean(a - b, axis=0)), rms / math.sqrt(len(a)))


NOT_OBSERVED = Defect(np.empty(0), np.empty((0, 1)))  # no frame shows the law


def check_laws_in_si(
    ladder: Any, window: Window, until: float = math.inf, tolerance: Callable[[str], float | None] = lambda asks: None
) -> Iterator[Agreement]:
    """Check the finest run of a `ladder.Ladder` by all laws that apply; of each the component with the worst defect.

    window : s_o/l;  until : [s];  tolerance : of what a law asks.
    """
    finest = ladder.finest
    windows = replace(Windows.over_part_of_run(finest, window, until), far=min(r.reached for r in ladder.runs))
    known = {id(x): Evidence(x, windows) for x in ladder.runs}
    case = known[id(finest)]
    steps, stations = case.without_every_second_step(), case.without_every_second_station()
    sparse_steps = steps, steps.without_every_second_step()
    sparse_stations = stations, stations.without_every_second_station()
    for name, law in LAWS.items():
        if not law.concerns(case):
            continue
        defect = law.defect(case)
        gap = math.nan
        bar = math.inf
        parts = (math.nan, 0.0)
        at = math.nan
        if defect.s_o.size and np.isfinite(defect.value).all():
            space, time = _bars_of_defect(law, defect, ladder, known)
            time = time + _sampling_bars(law, defect, sparse_steps)  # more steps lessen both
            bars = space + time + _sampling_bars(law, defect, sparse_stations)
            worst = int((defect.size / bars).argmax())
            gap = float(defect.size[worst])
            parts = (float(space[worst]), float(time[worst]))
            bar = float(bars[worst]) if np.isfinite(bars[worst]) else math.inf
            at = float(defect.s_o[np.abs(defect.value[:, worst]).argmax()])
        yield Agreement(
            law.of, gap, Bound("law", (BoundPart(finest.method, bar, "coarser runs and sampling"),)),
            where=None if math.isnan(at) else at, law="" if name == law.of else name, required=tolerance(law.asks),
            decides=bool(law.asks), parts=(parts,),
        )  # fmt: skip


def _bars_of_defect(law: Law, defect: Defect, ladder: Any, known: dict[int, Evidence]) -> tuple[Array, Array]:
    """Bars (c,) of a defect in space and time."""
    defects = {key: (defect if law.exact else law.defect(x)).value for key, x in known.items()}
    space, time = ladder.bar_parts(lambda x: defects[id(x)], defect.distance, FIRST)
    space, time = (np.broadcast_to(x, defect.size.shape) for x in (space, time))
    if law.at_start:
        space = np.maximum(space, SAFETY * ladder.start_gap)
    return space, time


def _sampling_bars(law: Law, defect: Defect, sparse: tuple[Evidence, Evidence]) -> Array:
    """Bars (c,) of a defect by half and a quarter of what it is computed from."""
    half, quarter = (law.defect(x).value for x in sparse)
    changes = defect.distance(defect.value, half), defect.distance(half, quarter)
    return ROUNDING + error_bar(*changes, (2.0, 2.0), FIRST)


DefectOf = Callable[[Evidence], Defect]


@dataclass(frozen=True, slots=True)
class Law:
    defect: DefectOf
    concerns: Callable[[Evidence], bool]
    of: str
    asks: str  # tolerance "rest" or "velocity" (`rows.tolerance_of`); "" if only shown
    exact: bool  # to rounding in every run
    at_start: bool  # of the place (x, y) at which the car starts


LAWS: dict[str, Law] = {}


def _register_law(
    concerns: Callable[[Evidence], bool] = lambda m: True,
    of: str = "laws_si",
    asks: str = "rest",
    exact: bool = False,
    at_start: bool = False,
) -> Callable[[DefectOf], DefectOf]:
    def register(defect: DefectOf) -> DefectOf:
        LAWS[defect.__name__.replace("_", " ")] = Law(defect, concerns, of, asks, exact, at_start)
        return defect

    return register


def _car_rolls(m: Evidence) -> bool:
    return m.r.drive != "grip"


def _frames_resolve_waves(m: Evidence) -> bool:
    between = float(np.diff(m.r.fields.t[m.window_frames[0] : m.window_frames[-1] + 1]).max(initial=0.0))
    return between <= MAX_FRAME_INTERVAL * m.r.length * math.sqrt(m.data.rho / m.r.horizontal_tension)


def _mass_leaves_supports(m: Evidence) -> bool:
    return any(_can_extrapolate(pair) for pair in m.sides)


def _can_extrapolate(pair: tuple[Side, Side]) -> bool:
    """Whether the fields can be extrapolated to the mass."""
    return all(x.s.size > 4 for x in pair)


def _knows_strain(m: Evidence) -> bool:
    return m.r.model == "full" and not np.array_equal(m.r.T_behind, m.r.T_behind_pointwise, equal_nan=True)


def _excludes_compression(r: Response, t: Array) -> NDArray[np.bool_]:
    """Times at which the law excludes compression."""
    if r.switched is None:
        return np.full(t.shape, r.law == "tension-only")
    return t > r.slack_since


def _defect_at_rest(*values: float) -> Defect:
    return Defect(np.array([math.nan]), np.array([values]).reshape(1, -1))


def _defect_at_frames(m: Evidence, value: Array) -> Defect:
    return Defect(m.r.fields.s_o[m.window_frames] / m.r.length, value.reshape(m.window_frames.size, -1))


def _defect_of_change(m: Evidence, conserved: Array, scale: float, t: Array | None = None) -> Defect:
    """Change of a conserved quantity (k, c) over each window, over a scale."""
    at = np.interp(m.windows.frames if t is None else t, m.r.t, m.r.s_o) / m.r.length
    return Defect(0.5 * (at[1:] + at[:-1]), np.diff(conserved, axis=0) / scale)


def _defect_of_change_at_steps(m: Evidence, conserved: Array, scale: float) -> Defect:
    return _defect_of_change(m, m.interpolated_at(m.windows.steps, conserved), scale, m.windows.steps)


# --- the cable at rest -----------------------------------------------------------------------------


@_register_law(exact=True)
def ends_at_rest(m: Evidence) -> Defect:
    """The cable ends at its supports; over the span."""
    f = m.r.fields
    data = m.data
    return _defect_at_rest(*(np.array([f.x[0], f.y[0], f.x[-1] - data.span, f.y[-1] - data.drop]) / data.span))


@_register_law(exact=True)
def length_at_rest(m: Evidence) -> Defect:
    """Stations measure arc length up to the length asked for (heat, ice: unstretched); over it."""
    s = m.r.fields.s
    name, value = m.data.prescribed
    strain = CubicSpline(s, m.r.fields.T_static / m.data.EA).integrate(s[0], s[-1]) / s[-1]
    length = {"length": value, "unstretched": value * (1.0 + strain)}.get(name, m.r.length)
    counted = float(np.abs(np.cumsum(_arc_lengths(m.rest_curve(s))) - s[1:]).max())
    return _defect_at_rest(*(np.array([s[0], counted, m.r.length - s[-1], s[-1] - length]) / s[-1]))


@_register_law(exact=True)
def shape_at_rest(m: Evidence) -> Defect:
    """Sag or horizontal tension as asked for; over itself."""
    name, value = m.data.prescribed
    f = m.r.fields
    if name == "sag":
        below = CubicSpline(f.s, f.y - m.data.drop / m.data.span * f.x)
        hung = max([0.0, *below(below.derivative().roots(extrapolate=False)).tolist()])
    else:
        hung = m.r.horizontal_tension if name == "horizontal_tension" else value
    return _defect_at_rest(hung / value - 1.0)


@_register_law(exact=True)
def forces_at_rest(m: Evidence) -> Defect:
    """T x' = H, over H; T y' falls by rho g per metre, over rho g l."""
    s = m.r.fields.s
    H = m.r.horizontal_tension
    weight = m.data.rho * m.data.gravity
    force = m.r.fields.T_static[:, None] * m.rest_curve(s, 1)
    falls = force[0, 1] - force[:, 1] - weight * s
    return _defect_at_rest(np.abs(force[:, 0] - H).max() / H, np.abs(falls).max() / (weight * s[-1]))


# --- travel and drive --------------------------------------------------------------------------------


@_register_law(lambda m: m.r.drive != "free", exact=True)
def travel(m: Evidence) -> Defect:
    """s_o(t) is the travel of the TOML; over the length."""
    r = m.r
    law = m.data.travel
    drive = m.data.drive
    l = m.r.fields.s[-1]
    t = r.t[m.steps_in_windows]
    s = r.s_o[m.steps_in_windows]
    start = timetable.start_position(law, drive, l)
    if law["kind"] == "table":
        stop = min(t[-1], law.get("stop", {}).get("time", math.inf))
        off = [0.0]
        for (a, b), position in zip(pairwise(law["times"]), law["positions"][1:], strict=True):
            piece = (r.t >= a) & (r.t <= b) & (r.t <= t[-1])
            if piece.sum() >= 4 and t[0] <= b <= stop:
                off.append(np.polyfit(r.t[piece][-4:] - b, r.s_o[piece][-4:], 3)[-1] - (position + start))
        return _defect_at_rest(float(np.abs(off).max()) / l)
    want = timetable.positions_at(law, drive, l, t)
    worst = np.argmax(np.abs(s - want))
    return Defect(s[worst, None] / l, (s - want)[worst, None, None] / l)


def _speed_after_stop(m: Evidence) -> float:
    """Speed [m/s] above `rest_speed` of a stopped car, over its last axial round trip."""
    r = m.r
    duration = min(r.t[-1] - r.t[0], m.data.round_trip)
    distance = abs(r.s_o[-1] - np.interp(r.t[-1] - duration, r.t, r.s_o))
    return max(0.0, distance / duration - 1.01 * m.data.drive.get("rest_speed", 1e-3)) if duration else 0.0


@_register_law(_car_rolls, exact=True)
def drive(m: Evidence) -> Defect:
    """Start, brakes, arrival and thrust are those of the TOML; over length, time, top speed, thrust."""
    r = m.r
    drive = m.data.drive
    l = m.r.fields.s[-1]
    T = m.r.t[-1]
    times, forces = m.thrust_history
    start = timetable.start_position(m.data.travel, drive, l)
    off = [(r.s_o[0] - start) / l]
    expected = {
        "release": ("t", T, [drive.get("release", 0.0)]), "thrust_end": ("t", T, times[-1:].tolist()),
        "brake": ("s_o", l, [brake["from"] for brake in drive.get("brake", [])]),
        "arrival": ("s_o", l, [drive.get("end", {}).get("place", 0.99 * l)]),
        "back": ("s_o", l, [0.5 * min(start, 0.01 * l)]),
    }  # fmt: skip
    for x in r.events:
        off.append((np.interp(x["t"], r.t, r.s_o) - x["s_o"]) / l)
        speed = _speed_after_stop(m) if x["event"] == "stop" else np.interp(x["t"], r.t, r.speed)
        off.append((speed - x["speed"]) / float(r.speed.max()))
        of, scale, wanted = expected.get(x["event"], ("t", 1.0, []))
        off += [min(abs(x[of] - y) for y in wanted) / scale] if wanted else []
    if r.drive == "free" and forces.any():
        smooth = np.abs(r.t[:, None] - times).min(axis=1) > 1e-6 * T
        off.append(np.abs(r.F_haul - m.thrust_force)[smooth].max() / float(np.abs(forces).max()))
    return _defect_at_rest(float(np.abs(off).max()))


@_register_law(lambda m: _car_rolls(m) and 0.0 < m.r.s_o[0] < m.r.length, at_start=True)
def car_at_rest(m: Evidence) -> Defect:
    """A car that rolls begins where the cable at rest holds it, clamped or on its rope; over the largest deflection."""
    r = m.r
    data = m.data
    friction = None if r.drive == "free" else data.drive.get("rolling_friction", 0.0)
    supports = (data.span, data.drop)
    weights = (data.rho * data.gravity, data.weight)
    want = rest.car_position_at_rest(
        supports, data.EA, weights[0], r.length, r.horizontal_tension, float(r.s_o[0]), weights[1], friction
    )
    off = np.array([r.x[0], r.y[0]]) - want
    return _defect_at_rest(*(off / r.max_deflection))


# --- the mass, at steps --------------------------------------------------------------------------------


@_register_law(exact=True)
def place_of_the_mass(m: Evidence) -> Defect:
    """p = X(s_o) + w; over the largest deflection."""
    r = m.r
    k = m.steps_in_windows
    off = np.stack([r.x - r.u, r.y - r.v], axis=1)[k] - m.rest_curve(r.s_o[k])
    return _defect_at_rest(float(np.abs(off).max()) / r.max_deflection)


@_register_law(_knows_strain, exact=True)
def strain_at_the_mass(m: Evidence) -> Defect:
    """Pointwise tension is T + EA (|r'| - 1), cut at zero without compression; over H."""
    r = m.r
    k = m.steps_in_windows
    f = m.r.fields
    T = CubicSpline(f.s, f.T_static)(r.s_o[k])
    off = []
    for slope, stored in ((r.slope_behind, r.T_behind_pointwise), (r.slope_ahead, r.T_ahead_pointwise)):
        N = T + m.data.EA * (np.hypot(*slope[k].T) - 1.0)
        off.append(stored[k] - np.where(_excludes_compression(r, r.t[k]), np.maximum(N, 0.0), N))
    return _defect_at_rest(*(np.abs(np.array(off)).max(axis=1) / r.horizontal_tension))


@_register_law()
def speed_of_the_mass(m: Evidence) -> Defect:
    """The mass moves by the integral of its velocity; over top speed times window."""
    r = m.r
    return _defect_of_change_at_steps(
        m, np.stack([r.x, r.y], axis=1) - m.impulse(r.velocity), float(r.speed.max()) * m.window_duration
    )


def _momentum_defect_of_mass(m: Evidence, force: Array) -> Defect:
    """Change of the car's momentum by the force of the rope (n, 2) [N] and all others; over M g times window."""
    r = m.r
    weight = m.data.weight
    force = force + weight * DOWN
    if r.drive != "grip":
        mean = r.slope_behind + r.slope_ahead
        force = force + m.thrust_force[:, None] * mean / np.hypot(*mean.T)[:, None] + m.air_drag
    return _defect_of_change_at_steps(m, m.data.mass * r.velocity - m.impulse(force), weight * m.window_duration)


@_register_law()
def momentum_of_the_mass(m: Evidence) -> Defect:
    """M (v_2 - v_1) is the impulse of weight, contact and outer forces; over M g times window."""
    return _momentum_defect_of_mass(m, -m.r.contact)


@_register_law(of="impulse")
def impulse(m: Evidence) -> Defect:
    """M (v_2 - v_1) by the force [ N t - rho ds_o^2 r' ] of both tensions; over M g times window."""

    def force(T: Array, slope: Array) -> Array:
        return (T / np.hypot(*slope.T) - m.data.rho * m.travel_speed**2)[:, None] * slope

    return _momentum_defect_of_mass(m, force(m.r.T_ahead, m.r.slope_ahead) - force(m.r.T_behind, m.r.slope_behind))


@_register_law(_car_rolls)
def tension_on_both_sides(m: Evidence) -> Defect:
    """The tension jump at a rolling car is friction plus brakes; over M g times window.

    [N] (1 - rho ds_o^2/EA) = -(mu_r |contact| + brakes) sign(ds_o); at most that for a slow car.
    """
    r = m.r
    data = m.data
    jump = (r.T_ahead - r.T_behind) * (1.0 - data.rho * m.travel_speed**2 / data.EA)
    resistance = np.sum(m.rolling_friction_and_brakes, axis=0)
    rolls = np.abs(m.travel_speed) > MIN_ROLLING_SPEED * np.abs(m.travel_speed).max()
    of_slow = np.sign(jump) * np.maximum(np.abs(jump) - resistance, 0.0)
    defect = np.where(rolls, jump + resistance * np.sign(m.travel_speed), of_slow)  # (n,)
    released = r.t >= data.drive.get("release", 0.0)
    return _defect_of_change_at_steps(
        m, m.impulse(np.where(released, defect, 0.0)[:, None]), data.weight * m.window_duration
    )


# --- the cable, at frames ------------------------------------------------------------------------------


@_register_law(lambda m: m.r.switched is not None or m.r.law == "tension-only", exact=True)
def compression(m: Evidence) -> Defect:
    """A tension-only cable has no compression; over H."""
    T = m.r.fields.T_pointwise[_excludes_compression(m.r, m.r.fields.t)] / m.r.horizontal_tension
    return _defect_at_rest(float(np.clip(T, -1.0, 0.0).min(initial=0.0)))


@_register_law(of="tension_min", asks="")
def least_tension(m: Evidence) -> Defect:
    """The least tension at steps is that at frames; over H."""
    f = m.r.fields
    k = m.window_frames
    field = np.minimum(f.T[k].min(axis=1), np.minimum(f.T_behind[k], f.T_ahead[k]))
    return _defect_at_frames(
        m, (m.interpolated_at(m.t, m.r.tension_min[:, None])[:, 0] - field) / m.r.horizontal_tension
    )


@_register_law()
def slack_onset(m: Evidence) -> Defect:
    """The least tension of the window so far falls through zero where slack begins, and does not before.

    The distance of that place to the falling curve, along a slope of 1 in s_o/l and T/H: a difference of places at a
    steep front, of tensions on a gentle slope, as between both solvers.  Within two steps.
    """
    r = m.r
    inside = np.flatnonzero(m.steps_in_windows & (r.t > 0.0))
    steps = slice(inside[0], inside[-1] + 3)
    position = np.maximum.accumulate(r.s_o[steps]) / r.length  # (n,)
    least = np.minimum.accumulate(r.tension_min[steps]) / r.horizontal_tension
    onset = int(np.searchsorted(r.t[steps], r.slack_since))
    reached = onset < position.size and position[onset] <= m.windows.far
    place = position[onset] if reached else position[inside[-1] - inside[0]]
    height = float(np.interp(place, position - least, least))
    two_steps = 2.0 * float(np.abs(np.diff(r.s_o)).max()) / r.length
    return _defect_at_rest(max(0.0, (abs(height) if reached else -height) - two_steps))


@_register_law()
def fields_at_the_mass(m: Evidence) -> Defect:
    """Displacement of the mass at frames is that at steps; over the largest deflection."""
    r = m.r
    f = m.r.fields
    steps = CubicSpline(r.t, np.stack([r.s_o, r.u, r.v], axis=1))(m.t)
    off = np.stack([f.s_o, f.mass_u, f.mass_v], axis=1)[m.window_frames] - steps
    return _defect_at_frames(m, off / r.max_deflection)


def _values_and_gaps_at_mass(m: Evidence, of: Callable[[Side], Array]) -> tuple[Array, ...]:
    """A field (m,) or (m, c) at the mass, and its gap to the extrapolation from either side; (k, 2 c)."""
    fields = []
    for pair in m.sides:
        rows = [(x.s[::order][:3], of(x)[::order][:3]) for x, order in zip(pair, (-1, 1), strict=True)]
        far = _can_extrapolate(pair)
        at_mass = [far * y[0] for _, y in rows]
        goes_on = [y[1] + (y[1] - y[2]) * (s[0] - s[1]) / (s[1] - s[2]) if far else 0.0 * y[0] for s, y in rows]
        fields.append((at_mass, np.subtract(at_mass, goes_on)))
    return tuple(np.reshape(x, (len(fields), -1)) for x in zip(*fields, strict=True))


@_register_law(_mass_leaves_supports)
def tension_up_to_the_mass(m: Evidence) -> Defect:
    """Tension along the cable tends to that at the mass, mean over frames after the start; over H."""
    if not np.any(m.t > 0.0):
        return NOT_OBSERVED
    _, off = _values_and_gaps_at_mass(m, lambda x: x.T)
    moving = m.t > 0.0
    s_o = m.r.fields.s_o[m.window_frames] / m.r.length
    return Defect(s_o[moving], off[moving] / m.r.horizontal_tension, averaged=True)


@_register_law(_mass_leaves_supports, of="velocity", asks="")
def up_to_the_mass(m: Evidence) -> Defect:
    """Velocity of the cable tends to that at the mass; over its rms."""
    if not np.any(m.t > 0.0):
        return NOT_OBSERVED
    at_mass, off = _values_and_gaps_at_mass(m, lambda x: x.velocity)
    size = np.sqrt(np.mean(at_mass**2, axis=0))
    return _defect_at_frames(m, off / size) if np.all(size > 0.0) else NOT_OBSERVED


@_register_law(_frames_resolve_waves, of="velocity", asks="velocity")
def displacement_from_velocity(m: Evidence) -> Defect:
    """Transverse displacement, weighted by half a sine, is the integral of its velocity; over its rms."""
    f = m.r.fields
    tangent = m.rest_curve(f.s, 1)
    sine = np.sin(math.pi / f.s[-1] * f.s)
    w, dw = ((tangent[:, 0] * b - tangent[:, 1] * a) @ sine for a, b in ((f.u, f.v), (f.du, f.dv)))
    # a station at the mass has the velocity behind it: the mean of both sides counts
    at = np.searchsorted(f.s, f.s_o * (1.0 - ROUNDING)).clip(max=f.s.size - 1)
    jump = m.interpolated_at(f.t, m.travel_speed[:, None] * (m.r.slope_behind - m.r.slope_ahead))
    missing = 0.5 * sine[at] * (tangent[at, 0] * jump[:, 1] - tangent[at, 1] * jump[:, 0])
    dw += np.where(np.abs(f.s[at] - f.s_o) <= ROUNDING * f.s[-1], missing, 0.0)
    conserved = w - CubicSpline(f.t, dw).antiderivative()(f.t)
    within = dw[m.window_frames[0] : m.window_frames[-1] + 1]
    return _defect_of_change(
        m, conserved[m.window_frames, None], math.sqrt(float(np.mean(within**2))) * m.window_duration
    )


@_register_law()
def stretch(m: Evidence) -> Defect:
    """Mean tension of half a side is that at rest plus EA times the curve's strain; over H."""
    off = []
    for pair in m.sides:
        longer = max(pair, key=lambda x: x.s[-1] - x.s[0])
        for x in pair:
            steps = np.diff(x.s)
            N = x.T - x.T_static
            stretched = _arc_lengths(x.points) - steps + m.data.tau * x.lengthening
            missing = 0.5 * steps * (N[1:] + N[:-1]) - m.data.EA * stretched
            missing = np.append(0.0, np.cumsum(missing))
            middle = np.searchsorted(x.s, 0.5 * (x.s[0] + x.s[-1]))
            cuts = np.array([0, middle, x.s.size - 1] if x is longer else [0, x.s.size - 1])
            off += (np.diff(missing[cuts]) / np.diff(x.s[cuts])).tolist()
    return _defect_at_frames(m, np.array(off) / m.r.horizontal_tension)


@_register_law()
def momentum_of_the_cable(m: Evidence) -> Defect:
    """rho int r. ds changes by the impulse of all forces; over total weight times window."""
    r = m.r
    rho = m.data.rho
    weight = rho * m.data.gravity * r.fields.s[-1]
    force = r.reaction_left + r.reaction_right + r.contact + weight * DOWN
    conserved = rho * (
        m.cable_integrals["velocity"] + m.damping * m.cable_integrals["points"]
    ) - m.impulse_at_window_ends(force)
    return _defect_of_change(m, conserved, (weight + m.data.weight) * m.window_duration)


@_register_law()
def moment_of_momentum(m: Evidence) -> Defect:
    """rho int r x r. ds about the left support changes by the impulse of moments; over weight, span and window."""
    r = m.r
    data = m.data
    t = m.t
    weight = data.rho * data.gravity
    right = np.array([data.span, data.drop])
    moment = cross_product(right, r.reaction_right) + cross_product(np.stack([r.x, r.y], axis=1), r.contact)
    lever = m.cable_integrals["points"][:, 0]
    moves = m.cable_integrals["velocity"][:, 0]
    h = np.diff(t)
    own = weight * (0.5 * h * (lever[1:] + lever[:-1]) - h**2 / 12.0 * np.diff(moves))  # by cubics
    spin = data.rho * (
        m.cable_integrals["spin"] + m.damping * m.swept_area_integral if m.damping else m.cable_integrals["spin"]
    )
    conserved = (spin - np.append(0.0, np.cumsum(own)))[:, None] - m.impulse_at_window_ends(moment[:, None])
    return _defect_of_change(m, conserved, (weight * r.fields.s[-1] + data.weight) * data.span * m.window_duration)


# --- energy; all over weight times largest deflection ---------------------------------------------------


def _total_power(powers: dict[str, Array]) -> Array:
    return np.sum(list(powers.values()), axis=0)


@_register_law(of="energy")
def energy(m: Evidence) -> Defect:
    """Energy of cable and mass changes by the work of the drive, until slack: a snapping cable loses some."""
    conserved = m.energies.sum(axis=1)[:, None] - m.impulse_at_window_ends(_total_power(m.powers)[:, None])
    defect = _defect_of_change(m, conserved, m.energy_scale)
    return Defect(defect.s_o, np.where((m.t[1:] <= m.r.slack_since)[:, None], defect.value, 0.0))


@_register_law(lambda m: bool(np.isfinite(m.r.kinetic).any()))
def parts_of_the_energy(m: Evidence) -> Defect:
    """Energies are those of the run, and sum to the total."""
    r = m.r
    stored = np.stack([r.kinetic, r.potential, r.strain, r.energy], axis=1)
    own = np.concatenate([m.energies, m.interpolated_at(m.t, np.sum(stored[:, :3], axis=1)[:, None])], axis=1)
    return _defect_of_change(m, m.interpolated_at(m.t, stored) - own, m.energy_scale)


@_register_law()
def power(m: Evidence) -> Defect:
    """Work of drive and outer forces is that of the run, each and in total; of a grip by its pointwise tensions."""
    r = m.r
    own = m.powers
    if r.drive == "grip":
        own = own | {"grip": m.grip_power(r.T_behind_pointwise, r.T_ahead_pointwise) + m.layer_loss}
    off = [r.power - _total_power(own), *(r.powers[name] - own[name] for name in own if name in r.powers)]
    return _defect_of_change_at_steps(m, m.impulse(np.stack(off, axis=1)), m.energy_scale)


@_register_law(lambda m: m.data.tau > 0.0)
def internal_losses(m: Evidence) -> Defect:
    """Internal damping takes EA tau (deps/dt)^2 along the taut cable, and the layer's loss; over its rms."""
    own = m.interpolated_at(m.t, m.layer_loss[:, None])[:, 0]
    shortest = 0.5 * float(np.diff(m.r.fields.s).max())
    for k, pair in enumerate(m.sides):
        for x in pair:
            steps = np.diff(x.s)
            long = steps > shortest  # next to the mass a difference quotient is all error
            own[k] += m.data.EA * m.data.tau * np.sum(x.lengthening[long] ** 2 / steps[long])
    stored = m.interpolated_at(m.t, m.powers["lost_internal"][:, None])[:, 0]
    taut = m.t <= m.r.slack_since
    return _defect_at_frames(m, np.where(taut, own + stored, 0.0) / math.sqrt(float(np.mean(own[taut] ** 2))))


def _arc_lengths(points: Array) -> Array:
    """Arc lengths between nodes (m, 2): chord times 1 + (bend of the tangent)^2/24."""
    chord = np.diff(points, axis=0)
    length = np.hypot(*chord.T)
    bend = np.gradient(chord / length[:, None], axis=0) if len(chord) > 1 else np.zeros((1, 2))
    return np.asarray(length * (1.0 + np.sum(bend**2, axis=1) / 24.0))
