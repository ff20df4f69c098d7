"""A judge that knows mechanics by itself: responses against the laws of mechanics and the scene's TOML, all in SI.

It sees what both wings share: groups, static shape, travel, units, sampling.

Every law is a defect that is zero for the exact answer, part of a scale of its own.  What a right answer leaves is its
resolution (told by its companions) and the sampling of its fields (told by leaving out every second station).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import BarycentricInterpolator, CubicSpline
from scipy.linalg import solve_banded

from cablefem.response import Array, Response
from validation.core import timetable
from validation.core.evidence import ROUNDING, SIDE, Defect, Evidence, Side, Window, cross

OFTEN = 0.2  # of the time a transverse wave takes along the cable, that may lie between frames which tell velocities
NEXT = 0.01  # of the length, next to a support
TRAPEZOIDS = 1e-4  # of the scale: impulses over steps across which an acceleration jumps
# Times what half the resolution and half the steps change: a defect falls with an order between 1/2 and 1 where a ride
# begins or changes of a sudden.
SAFETY = 2.5
DOWN = np.array([0.0, 1.0])


@dataclass(frozen=True, slots=True)
class Held:
    """A law held against a run: its rms defect, what may be left of it, and where it is largest (s_o/l)."""

    law: str
    quantity: str  # whose row it is
    gap: float  # nan where the response does not say what the law asks for
    sampling: float  # what the stations leave: twice what every second one changes
    changed: float  # by half the resolution and half the steps together; nan where a companion ends early
    where: float | None


def hold(r: Response, window: Window, companions: Sequence[Response] = ()) -> Iterator[Held]:
    """Hold every law that a response can be held against, over a window of s_o/l, the cable at rest first.

    As long as all of them go: of two rides that come to rest one may be said to have stopped, the other not yet.

    Where one of several components by itself is more than what may be left of it, that is told: a sharp one shows what
    blunt ones would hide.
    """
    last = min(x.fields.t[-1] if x.fields.t.size else 0.0 for x in (r, *companions))
    case, sparse = Evidence(r, window, last=last), Evidence(_thinned(r), window, every=2, last=last)
    others = [Evidence(c, window, last=last) for c in companions]
    for name, law in LAWS.items():
        if not law.concerns(case):
            continue
        found = law.defect(case)
        if not (found.place.size and np.isfinite(found.value).all()):
            yield Held(name, law.of, math.nan, math.nan, math.nan, None)
            continue
        resolved = law.asks == "resolution"
        changed = np.sum([0.0 * found.rms, *(found.changed(law.defect(c)) for c in others if resolved)], axis=0)
        sampling = ROUNDING + (TRAPEZOIDS if resolved else 0.0) + 0.0 * found.rms
        if law.asks != "nothing":
            sampling += 2.0 * found.changed(law.defect(sparse))
        over = found.rms / (sampling + SAFETY * changed)
        worst = int(over.argmax()) if over.max() > 1.0 else 0
        at = float(found.place[np.sum(found.value**2, axis=1).argmax()])
        rms, sampled, left = (float(x[worst]) for x in (found.rms, sampling, changed))
        yield Held(name, law.of, rms, sampled, left, None if math.isnan(at) else at)


Finds = Callable[[Evidence], Defect]


@dataclass(frozen=True, slots=True)
class Law:
    """One law of mechanics: its defect, what a right answer's defect depends on, whom it concerns, whose row it is."""

    defect: Finds
    asks: str  # "nothing" of a run, its "stations", or its "resolution"
    concerns: Callable[[Evidence], bool]
    of: str


LAWS: dict[str, Law] = {}


def _law(
    asks: str, concerns: Callable[[Evidence], bool] = lambda m: True, of: str = "laws_si"
) -> Callable[[Finds], Finds]:
    def listed(defect: Finds) -> Finds:
        LAWS[defect.__name__.replace("_", " ")] = Law(defect, asks, concerns, of)
        return defect

    return listed


def _thinned(r: Response) -> Response:
    """Return the response with every second station of its fields."""
    f = r.fields
    rows = {name: getattr(f, name)[::2] for name in ("s", "x", "y", "T_static")}
    columns = {name: getattr(f, name)[:, ::2] for name in ("u", "v", "du", "dv", "T", "T_pointwise")}
    return replace(r, fields=replace(f, **rows, **columns))


def _rolls(m: Evidence) -> bool:
    return m.r.drive != "grip"


def _sees_swings(m: Evidence) -> bool:
    """Return whether frames follow each other closely enough for a velocity to be summed."""
    between = float(np.diff(m.r.fields.t[m.frames[0] : m.frames[-1]]).max(initial=0.0))
    return between <= OFTEN * m.r.length * math.sqrt(m.given.rho / m.r.horizontal_tension)


def _off_supports(m: Evidence) -> bool:
    """Return whether the mass is ever so far from them that something can be said of the cable beside it."""
    return any(_has_room(m, pair) for pair in m.sides)


def _has_room(m: Evidence, pair: tuple[Side, Side]) -> bool:
    """Return whether neither support is next to the mass, where stations are few and waves from there not yet apart."""
    return all(x.s.size > 2 and np.ptp(x.s) > NEXT * m.r.length for x in pair)


def _knows_strain(m: Evidence) -> bool:
    """Return whether a pointwise tension is told: a solver may know the one from equilibrium alone."""
    return m.r.model == "full" and not np.array_equal(m.r.T_behind, m.r.T_behind_pointwise, equal_nan=True)


def _carries_none(r: Response, t: Array) -> NDArray[np.bool_]:
    """Return at which instants the cable's law carries no compression: all, none, or those after the first slack."""
    if r.switched is None:
        return np.full(t.shape, r.law == "tension-only")
    return t > r.slack_since


# --- the cable at rest -----------------------------------------------------------------------------


@_law("stations")
def ends_at_rest(m: Evidence) -> Defect:
    """The cable ends at its supports; over the span."""
    f, given = m.r.fields, m.given
    return _static(*(np.array([f.x[0], f.y[0], f.x[-1] - given.span, f.y[-1] - given.drop]) / given.span))


@_law("stations")
def length_at_rest(m: Evidence) -> Defect:
    """Stations count the length of the curve, from none to all of it, and that is the length asked for; over it.

    With temperature or ice the unstretched length is asked for, with the strain of the mean tension.
    """
    s, asked = m.r.fields.s, m.given.asked
    off = [s[0], float(np.abs(np.cumsum(_arcs(m.curve, s)) - s[1:]).max()), s[-1] - m.r.length]
    if asked[0] == "unstretched":
        strain = CubicSpline(s, m.r.fields.T_static / m.given.EA).integrate(s[0], s[-1]) / s[-1]
        off.append(s[-1] / (1.0 + strain) - asked[1])
    off += [s[-1] - asked[1]] if asked[0] == "length" else []
    return _static(*(np.array(off) / s[-1]))


@_law("stations")
def shape_at_rest(m: Evidence) -> Defect:
    """Sag below the chord, or horizontal tension, as asked for; over itself.  A length has its own law."""
    (name, value), f = m.given.asked, m.r.fields
    if name == "sag":
        below = CubicSpline(f.s, f.y - m.given.drop / m.given.span * f.x)
        found = max([0.0, *below(below.derivative().roots(extrapolate=False)).tolist()])
    else:
        found = m.r.horizontal_tension if name == "horizontal_tension" else value  # lengths have their own law
    return _static(found / value - 1.0)


@_law("stations")
def forces_at_rest(m: Evidence) -> Defect:
    """T x' = H all along, over H; T y' falls by rho g per metre, the supports carry the weight, over rho g l."""
    s, H, weight = m.r.fields.s, m.r.horizontal_tension, m.given.rho * m.given.gravity
    force = m.r.fields.T_static[:, None] * m.curve(s, 1)
    falls = force[0, 1] - force[:, 1] - weight * s
    return _static(np.abs(force[:, 0] - H).max() / H, np.abs(falls).max() / (weight * s[-1]))


# --- travel and drive --------------------------------------------------------------------------------


@_law("stations", lambda m: m.r.drive != "free")
def travel(m: Evidence) -> Defect:
    """s_o(t) is the travel that the TOML asks for; over the length."""
    r, law, drive, l = m.r, m.given.travel, m.given.drive, m.r.fields.s[-1]
    inside = (r.s_o / r.length >= m.window[0]) & (r.s_o / r.length <= m.window[1])
    t, s = r.t[inside], r.s_o[inside]
    if law["kind"] != "table":
        return Defect(s / l, (s - timetable.places(law, drive, l, t))[:, None] / l)
    times, asked = np.array(law["times"]), np.array(law["positions"]) + timetable.begins(law, drive, l)
    known = (times >= t[0]) & (times <= min(t[-1], law.get("stop", {}).get("time", math.inf)))
    off = _before(r.t, r.s_o, times)[known] - asked[known]
    return Defect(asked[known] / l, off[:, None] / l)


def _before(t: Array, values: Array, knots: Array) -> Array:
    """Return values (n,) at knots, between which they are cubic: by four steps of the piece before, else by a spline.

    A spline through all steps rounds the knots off: by 3e-9 of the length at 660 steps.
    """
    out = CubicSpline(t, values)(knots)
    for i, (last, knot) in enumerate(pairwise(knots), start=1):
        near = np.flatnonzero((t >= last) & (t <= knot))[-4:]
        if near.size == 4:
            out[i] = BarycentricInterpolator(t[near], values[near])(knot)
    return out


@_law("stations", _rolls)
def drive(m: Evidence) -> Defect:
    """The car begins, brakes and arrives where the TOML says, is let go and driven as long and as hard as it says.

    Each event is where and as fast as the car is then, and a stop has no speed.  Over length, time, top speed and
    largest thrust.
    """
    r, drive, l, T = m.r, m.given.drive, m.r.fields.s[-1], m.r.t[-1]
    times, forces = m.thrust
    start = timetable.begins(m.given.travel, drive, l)
    off = [(r.s_o[0] - start) / l]
    told = {
        "release": ("t", T, [drive.get("release", 0.0)]), "thrust_end": ("t", T, times[-1:].tolist()),
        "brake": ("s_o", l, [brake["from"] for brake in drive.get("brake", [])]),
        "arrival": ("s_o", l, [drive.get("end", {}).get("place", 0.99 * l)]),
        "back": ("s_o", l, [0.5 * min(start, 0.01 * l)]),
    }  # fmt: skip
    for x in r.events:
        off.append((np.interp(x["t"], r.t, r.s_o) - x["s_o"]) / l)
        speed = 0.0 if x["event"] == "stop" else np.interp(x["t"], r.t, r.speed)
        off.append((speed - x["speed"]) / float(r.speed.max()))
        of, scale, wanted = told.get(x["event"], ("t", 1.0, []))
        off += [min(abs(x[of] - y) for y in wanted) / scale] if wanted else []
    if r.drive == "free" and times.size:
        smooth = np.abs(r.t[:, None] - times).min(axis=1) > SIDE * T
        off.append(np.abs(r.F_haul - m.pull)[smooth].max() / float(np.abs(forces).max()))
    return _static(*off)


# --- the mass, at steps --------------------------------------------------------------------------------


@_law("stations")
def place_of_the_mass(m: Evidence) -> Defect:
    """p = X(s_o) + w; over the largest deflection."""
    r, k = m.r, m.inside
    off = np.stack([r.x - r.u, r.y - r.v], axis=1)[k] - m.curve(r.s_o[k])
    return Defect(r.s_o[k] / r.length, off / r.max_deflection)


@_law("stations", _knows_strain)
def strain_at_the_mass(m: Evidence) -> Defect:
    """Pointwise tension is that at rest plus EA (|r'| - 1), and not below none where the law says so; over H."""
    r, k, f = m.r, m.inside, m.r.fields
    T, off = CubicSpline(f.s, f.T_static)(r.s_o[k]), []
    for slope, told in ((r.slope_behind, r.T_behind_pointwise), (r.slope_ahead, r.T_ahead_pointwise)):
        N = T + m.given.EA * (np.hypot(*slope[k].T) - 1.0)
        off.append(told[k] - np.where(_carries_none(r, r.t[k]), np.maximum(N, 0.0), N))
    return Defect(r.s_o[k] / r.length, np.stack(off, axis=1) / r.horizontal_tension)


@_law("resolution")
def speed_of_the_mass(m: Evidence) -> Defect:
    """The way of the mass is the integral of its velocity; over top speed times the window."""
    r = m.r
    kept = m.at_frames(np.stack([r.x, r.y], axis=1)) - m.impulse_of(r.velocity)
    return m.over_windows(kept, float(r.speed.max()) * m.lasts)


def _of_mass(m: Evidence, pull: Array) -> Defect:
    """Return what is missing from the momentum of the mass under the cable's pull (n, 2)."""
    r, weight = m.r, m.given.weight
    force = pull + weight * DOWN
    if r.drive != "grip":  # haul rope or thrust, and drag
        mean = r.slope_behind + r.slope_ahead
        force = force + m.pull[:, None] * mean / np.hypot(*mean.T)[:, None] + m.drag
    known = np.isfinite(force[1:-1]).all()
    impulse = cumulative_trapezoid(np.nan_to_num(force), r.t, axis=0, initial=0.0) if known else math.nan
    return m.over_windows(m.at_frames(m.given.mass * r.velocity - impulse), weight * m.lasts)


@_law("resolution")
def momentum_of_the_mass(m: Evidence) -> Defect:
    """M (v_2 - v_1) is the impulse of weight, contact force and what acts from outside; over M g times window."""
    return _of_mass(m, -m.r.contact)


@_law("resolution", of="impulse")
def impulse(m: Evidence) -> Defect:
    """M (v_2 - v_1) with the cable's pull [ N t - rho ds_o^2 r' ] by both tensions; over M g times the window."""
    pull = np.zeros((m.r.t.size, 2))
    for sign, T, slope in m.both():
        pull += sign * (T / np.hypot(*slope.T) - m.given.rho * m.pace**2)[:, None] * slope
    return _of_mass(m, pull)


@_law("resolution", _rolls)
def tension_on_both_sides(m: Evidence) -> Defect:
    """A car that rolls has the same tension on both sides but for friction and brakes; over M g times the window.

    [N] (1 - rho ds_o^2/EA) = -(mu_r |contact| + brakes) sign(ds_o); while it is held or stands it may differ.  A
    window in which a brake or a thrust jumps is left out: the step there has but one of the two values.
    """
    r, given = m.r, m.given
    rubs = np.sum(m.rub, axis=0) * np.sign(m.pace)
    apart = (r.T_ahead - r.T_behind) * (1.0 - given.rho * m.pace**2 / given.EA) + rubs
    kept = m.over_windows(m.impulse_of(apart[:, None]), given.weight * m.lasts)
    rolls = np.abs(np.interp(m.t, r.t, m.pace)) > 0.05 * np.abs(m.pace).max()
    rolls &= m.t >= given.drive.get("release", 0.0)
    jumps = np.histogram([x["t"] for x in r.events], m.t)[0] > 0
    return Defect(kept.place, np.where((rolls[1:] & rolls[:-1] & ~jumps)[:, None], kept.value, 0.0))


# --- the cable, at frames ------------------------------------------------------------------------------


@_law("nothing", lambda m: m.r.switched is not None or m.r.law == "tension-only")
def compression(m: Evidence) -> Defect:
    """A cable that carries none is under none; over H."""
    T = m.r.fields.T_pointwise[_carries_none(m.r, m.r.fields.t)]
    return _static(min(0.0, float(T.min(initial=0.0))) / m.r.horizontal_tension)


@_law("resolution")
def fields_at_the_mass(m: Evidence) -> Defect:
    """What frames say of the mass is what steps do; over the largest deflection."""
    r, f = m.r, m.r.fields
    steps = CubicSpline(r.t, np.stack([r.s_o, r.u, r.v], axis=1))(m.t)
    off = np.stack([f.s_o, f.mass_u, f.mass_v], axis=1)[m.frames] - steps
    return Defect(f.s_o[m.frames] / r.length, off / r.max_deflection)


def _at_and_up_to(m: Evidence, of: Callable[[Side], Array]) -> tuple[Array, ...]:
    """Return what a field (m,) or (m, c) is at the mass and what it misses when it goes on to there, (k, 2 c).

    Next to a support none of either.
    """
    found = []
    for pair in m.sides:
        rows = [(x.s[::way][:3], of(x)[::way][:3]) for x, way in zip(pair, (-1, 1), strict=True)]
        far = _has_room(m, pair)
        told = [far * y[0] for _, y in rows]
        goes_on = [y[1] + (y[1] - y[2]) * (s[0] - s[1]) / (s[1] - s[2]) if far else 0.0 * y[0] for s, y in rows]
        found.append((told, np.subtract(told, goes_on)))
    return tuple(np.reshape(x, (len(found), -1)) for x in zip(*found, strict=True))


@_law("resolution", _off_supports)
def tension_up_to_the_mass(m: Evidence) -> Defect:
    """Tension along the cable goes on to that at the mass, in the mean over the frames; over H."""
    _, off = _at_and_up_to(m, lambda x: x.T)
    return _static(*(off.mean(axis=0) / m.r.horizontal_tension))


@_law("resolution", _off_supports, of="velocity")
def up_to_the_mass(m: Evidence) -> Defect:
    """Velocity of the cable goes on to that at the mass, each way by itself; over its rms there."""
    told, off = _at_and_up_to(m, lambda x: x.velocity)
    return Defect(m.r.fields.s_o[m.frames] / m.r.length, off / np.sqrt(np.mean(told**2, axis=0)))


@_law("resolution", _sees_swings, of="velocity")
def summed_over_time(m: Evidence) -> Defect:
    """What the cable moves across itself at rest is the integral of its velocity, both weighted by half a sine.

    Over the rms of that.  Along it, and in shorter waves, it swings to and fro between two frames.
    """
    f, last = m.r.fields, (m.frames.size - 1) // 2 * 2
    of, step = np.arange(m.frames[0], m.frames[last] + 1), 2 * int(m.frames[1] - m.frames[0])
    tangent, sine = m.curve(f.s, 1), np.sin(math.pi / f.s[-1] * f.s)
    w, dw = ((tangent[:, 0] * b[of] - tangent[:, 1] * a[of]) @ sine for a, b in ((f.u, f.v), (f.du, f.dv)))
    way = cumulative_trapezoid(dw[:: m.every], f.t[of[:: m.every]], axis=0, initial=0.0)
    time, at = np.diff(f.t[of[::step]]), f.s_o[of[::step]] / m.r.length
    off = np.diff(w[::step] - way[:: step // m.every], axis=0) / np.mean(time)
    return Defect(0.5 * (at[1:] + at[:-1]), off[:, None] / math.sqrt(float(np.mean(dw**2))))


@_law("resolution")
def stretch(m: Evidence) -> Defect:
    """Mean tension of a piece is that at rest plus EA times the piece's strain by the sampled curve; over H.

    Pieces are the shorter side and both halves of the longer one: the ends of a side lie on support and mass,
    whatever the fields are between, and in shorter pieces the ripples of a basis have no mean.
    """
    sides = [x for pair in m.sides for x in pair]
    s, ends = np.concatenate([x.s for x in sides]), np.cumsum([x.s.size for x in sides])
    curves = np.concatenate([np.concatenate([x.place for x in sides]), np.concatenate([x.rest for x in sides])], axis=1)
    moved, rest, N = _pieces(s, curves, np.concatenate([x.T - x.T_static for x in sides]), ends)
    missing = np.append(0.0, np.cumsum(N - m.given.EA * (moved - rest)))
    off = []
    for i, pair in enumerate(m.sides):
        longer = max(pair, key=lambda x: x.s[-1] - x.s[0])
        for k, x in enumerate(pair, start=2 * i):
            first = ends[k] - x.s.size
            cuts = np.array([0, x.s.size // 2, x.s.size - 1] if x is longer else [0, x.s.size - 1])
            off += (np.diff(missing[first + cuts]) / np.diff(x.s[cuts])).tolist()
    at = m.r.fields.s_o[m.frames] / m.r.length
    return Defect(at, np.reshape(off, (-1, 3)) / m.r.horizontal_tension)


@_law("resolution")
def momentum_of_the_cable(m: Evidence) -> Defect:
    """rho int r. ds changes by the impulse of reactions, weight and mass; over all weight times the window."""
    r, rho = m.r, m.given.rho
    weight = rho * m.given.gravity * r.fields.s[-1]
    force = r.reaction_left + r.reaction_right + r.contact + weight * DOWN
    kept = rho * m.along["velocity"] - m.impulse_of(force)
    return m.over_windows(kept, (weight + m.given.weight) * m.lasts)


@_law("resolution")
def moment_of_momentum(m: Evidence) -> Defect:
    """rho int r x r. ds about the left support changes by the moments' impulse; over all weight, span, window."""
    r, given, t = m.r, m.given, m.t
    weight = given.rho * given.gravity
    spin = given.rho * m.along["spin"]
    lever = weight * m.along["place"][:, 0]
    right = np.array([given.span, given.drop])
    moment = cross(right, r.reaction_right) + cross(np.stack([r.x, r.y], axis=1), r.contact)
    own = CubicSpline(t, lever).antiderivative()(t) if t.size > 3 else cumulative_trapezoid(lever, t, initial=0.0)
    kept = (spin - own)[:, None] - m.impulse_of(moment[:, None])
    return m.over_windows(kept, (weight * r.fields.s[-1] + given.weight) * given.span * m.lasts)


# --- energy; all over weight times largest deflection ---------------------------------------------------


@_law("resolution")
def energy(m: Evidence) -> Defect:
    """Energy of cable and mass changes by the work of the drive, until the cable is slack: it loses some as it snaps.

    Steps that damp lose that and more, however short they are.
    """
    kept = m.energies.sum(axis=1)[:, None] - m.impulse_of(m.power_of_all[:, None])
    found = m.over_windows(kept, m.work)
    return replace(found, value=np.where((m.t[1:] <= m.r.slack_since)[:, None], found.value, 0.0))


@_law("resolution", lambda m: bool(np.isfinite(m.r.kinetic).any()))
def parts_of_the_energy(m: Evidence) -> Defect:
    """Energies change as the run says, and their sum is that of all."""
    r = m.r
    told = np.stack([r.kinetic, r.potential, r.strain, r.energy], axis=1)
    own = np.concatenate([m.energies, m.at_frames(np.sum(told[:, :3], axis=1)[:, None])], axis=1)
    return m.over_windows(m.at_frames(told) - own, m.work)


@_law("resolution")
def power(m: Evidence) -> Defect:
    """Work of drive and outside forces is what the run says, each and all."""
    r, own = m.r, m.powers
    apart = [r.power - m.power_of_all, *(r.powers[name] - own[name] for name in own if name in r.powers)]
    return m.over_windows(m.impulse_of(np.stack(apart, axis=1)), m.work)


def _static(*values: float) -> Defect:
    return Defect(np.array([math.nan]), np.array([values]).reshape(1, -1))


Counts = NDArray[np.int_]
GAUSS = np.polynomial.legendre.leggauss(3)


def _arcs(curve: Callable[..., Array], s: Array) -> Array:
    """Return lengths of a curve (x, y) between nodes, (m - 1,)."""
    at, weights = GAUSS
    h = 0.5 * np.diff(s)
    slope = curve(s[:-1, None] + h[:, None] * (1.0 + at), 1)
    return np.asarray(h * (np.hypot(slope[..., 0], slope[..., 1]) @ weights))


def _pieces(s: Array, curves: Array, values: Array, ends: Counts) -> tuple[Array, Array, Array]:
    """Return lengths of two curves (x, y, x, y) (n, 4) between nodes, and integrals of values (n,); each (n - 1,).

    By splines, one after another, each of which ends before these nodes; nothing lies between two of them.  Curves of
    less than four nodes are straight between them.
    """
    h, counts = np.diff(s), np.diff(ends, prepend=0)
    between = ends[:-1] - 1
    h[between] = 1.0
    y = np.concatenate([curves, values[:, None]], axis=1)
    rises = np.diff(y, axis=0) / h[:, None]
    slopes = _slopes(h, rises, ends, counts)
    at, weights = 0.5 * (1.0 + GAUSS[0]), 0.5 * GAUSS[1]
    shares = np.stack([6.0 * at * (1.0 - at), 1.0 - at * (4.0 - 3.0 * at), at * (3.0 * at - 2.0)], axis=1)
    steep = np.einsum("gk,kmc->gmc", shares, np.stack([rises[:, :4], slopes[:-1, :4], slopes[1:, :4]]))
    straight = np.flatnonzero(np.repeat(counts < 4, counts)[:-1])
    steep[:, straight] = rises[straight, :4]
    lengths = h[:, None] * np.einsum("g,gmk->mk", weights, np.hypot(steep[..., ::2], steep[..., 1::2]))
    area = h * (0.5 * (values[1:] + values[:-1]) + h * (slopes[:-1, 4] - slopes[1:, 4]) / 12.0)
    for x in (lengths, area):
        x[between] = 0.0
    return lengths[:, 0], lengths[:, 1], area


def _slopes(h: Array, rises: Array, ends: Counts, counts: Counts) -> Array:
    """Return slopes (n, c) of not-a-knot cubic splines, from steps h and rises over them, (n - 1,) and (n - 1, c).

    A parabola of three nodes, a line of two; all in one go: a spline by itself takes scipy a tenth of a millisecond.
    """
    n = h.size + 1
    lower, middle, upper, right = np.zeros(n), np.ones(n), np.zeros(n), np.zeros((n, rises.shape[1]))
    h0, h1, r0, r1 = h[:-1], h[1:], rises[:-1], rises[1:]
    lower[1:-1], middle[1:-1], upper[1:-1] = h1, 2.0 * (h0 + h1), h0
    right[1:-1] = 3.0 * (h1[:, None] * r0 + h0[:, None] * r1)
    for way, nodes, off, outer in ((1, ends - counts, upper, lower), (-1, ends - 1, lower, upper)):
        outer[nodes] = 0.0
        for few in (2, 3):
            node = nodes[counts == few]
            middle[node], off[node], right[node] = 1.0, few - 2.0, (few - 1.0) * rises[node - (way < 0)]
        node = nodes[counts > 3]
        piece = node - (way < 0)
        near, both = h[piece][:, None], (h[piece] + h[piece + way])[:, None]
        middle[node], off[node] = h[piece + way], both[:, 0]
        right[node] = (near + 2.0 * both) * (both - near) / both * rises[piece] + near**2 / both * rises[piece + way]
    bands = np.stack([np.append(0.0, upper[:-1]), middle, np.append(lower[1:], 0.0)])
    return np.asarray(solve_banded((1, 1), bands, right, overwrite_ab=True, overwrite_b=True, check_finite=False))
