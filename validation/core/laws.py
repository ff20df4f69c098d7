"""A judge that knows mechanics by itself: responses against the laws of mechanics and the scene's TOML, all in SI.

Nothing of the solvers, nothing of the scene package: the numbers are read with tomllib, the rest is in the response.
So it sees what both wings share: groups, static shape, travel, units, sampling.

Every law is a defect that is zero for the exact answer, part of a scale of its own.  What a right answer leaves is its
resolution (told by its companions) and the sampling of its fields (told by leaving out every second station).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, simpson
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from cablefem.response import Array, Response

EVERY = 4  # frames from one end of a window to the next: 0.04 of the travel
ROUNDING = 1e-9  # of the scale: stations and splines of static shapes
DOWN = np.array([0.0, 1.0])

Window = tuple[float, float]
Frames = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Given:
    """A scene's own numbers, SI, as its TOML has them."""

    gravity: float
    rho: float
    EA: float
    span: float
    drop: float
    mass: float
    asked: tuple[str, float]  # "length", "sag" or "horizontal_tension" and its value
    travel: dict[str, Any]
    drive: dict[str, Any]

    @classmethod
    def read(cls, toml: str) -> Given:
        """Return the numbers in a scene file."""
        x = tomllib.loads(toml)
        cable, supports = x["cable"], x["supports"]
        asked = next(name for name in ("length", "sag", "horizontal_tension") if name in cable)
        return cls(
            x.get("gravity", 9.81), cable["mass_per_length"], cable["EA"], supports["span"], supports["drop"],
            x["mass"]["mass"], (asked, cable[asked]), x.get("travel", {}), x.get("drive", {}),
        )  # fmt: skip

    @property
    def weight(self) -> float:
        """M g [N]."""
        return self.mass * self.gravity


@dataclass(frozen=True, slots=True)
class Defect:
    """What is missing from a law: at places s_o/l (nan where there is none), part of the law's scale."""

    place: Array  # (k,)
    value: Array  # (k, c)

    @property
    def size(self) -> Array:
        """Norm over components (k,)."""
        return np.sqrt(np.sum(np.square(self.value), axis=1))

    @property
    def rms(self) -> float:
        return math.sqrt(float(np.mean(self.size**2)))


Law = Callable[[Response, Given, Window], Defect]


@dataclass(frozen=True, slots=True)
class Held:
    """A law held against a run: the rms defect, what may be left of it, and where it is largest (s_o/l)."""

    law: str
    gap: float
    sampling: float
    where: float | None


def thinned(r: Response) -> Response:
    """Return the response with every second station of its fields."""
    f = r.fields
    rows = {name: getattr(f, name)[::2] for name in ("s", "x", "y", "T_static")}
    columns = {name: getattr(f, name)[:, ::2] for name in ("u", "v", "du", "dv", "T", "T_pointwise")}
    return replace(r, fields=replace(f, **rows, **columns))


def names(r: Response) -> list[str]:
    """Return the laws that a response can be held against, the cable at rest first."""
    return [*REST, *(name for name in MOTION if name != "travel" or r.drive != "free")]


def defect(law: str, r: Response, window: Window) -> Defect:
    """Return the defect of a law over a window of s_o/l."""
    return {**REST, **MOTION}[law](r, Given.read(r.scene_toml), window)


def held(law: str, r: Response, window: Window) -> Held:
    """Hold a law against a run alone; `sampling` is what the stations leave, twice what thinning them changes."""
    found = defect(law, r, window)
    size = found.size
    if not size.size or not np.isfinite(size).all():
        return Held(law, math.nan, math.nan, None)
    coarse = defect(law, thinned(r), window)
    sampling = 2.0 * Defect(found.place, found.value - coarse.value).rms + ROUNDING
    at = float(found.place[size.argmax()])
    return Held(law, found.rms, sampling, at if math.isfinite(at) else None)


def _static(*values: float) -> Defect:
    return Defect(np.array([math.nan]), np.array([values]))


# --- the cable at rest ----------------------------------------------------------------------------------------------


def _curve(r: Response) -> tuple[Array, CubicSpline]:
    f = r.fields
    return f.s, CubicSpline(f.s, np.stack([f.x, f.y], axis=1))


def ends(r: Response, given: Given, _: Window) -> Defect:
    """The cable ends at its supports; over the span."""
    f = r.fields
    first, last = np.array([f.x[0], f.y[0]]), np.array([f.x[-1] - given.span, f.y[-1] - given.drop])
    return _static(*(np.concatenate([first, last]) / given.span))


def length(r: Response, given: Given, _: Window) -> Defect:
    """Stations count the length of the curve, from none to all of it, and that is the length asked for; over it."""
    s, curve = _curve(r)
    arcs = _arcs(curve, s)
    off = [s[0], float(np.abs(np.cumsum(arcs) - s[1:]).max()), s[-1] - r.length]
    if given.asked[0] == "length":
        off.append(s[-1] - given.asked[1])
    return _static(*(np.array(off) / s[-1]))


def shape(r: Response, given: Given, _: Window) -> Defect:
    """Sag below the chord, or horizontal tension, as asked for; over itself."""
    name, value = given.asked
    if name == "horizontal_tension":
        return _static(r.horizontal_tension / value - 1.0)
    if name == "length":
        return _static(0.0)  # `length` has it
    s, curve = _curve(r)
    below = CubicSpline(s, curve(s)[:, 1] - given.drop / given.span * curve(s)[:, 0])
    turns = below.derivative().roots(extrapolate=False)
    deepest = max([0.0, *(float(below(t)) for t in turns if np.isfinite(t))])
    return _static(deepest / value - 1.0)


def rest_forces(r: Response, given: Given, _: Window) -> Defect:
    """T x' = H all along, over H; T y' falls by rho g per metre, the supports carry the weight, over rho g l."""
    s, curve = _curve(r)
    slope = curve(s, 1)
    T, H = r.fields.T_static[:, None] * slope, r.horizontal_tension
    weight = given.rho * given.gravity * s[-1]
    falls = T[0, 1] - T[:, 1] - given.rho * given.gravity * s
    return _static(np.abs(T[:, 0] - H).max() / H, np.abs(falls).max() / weight)


def _arcs(curve: CubicSpline, s: Array) -> Array:
    """Return the length of a curve between nodes (m - 1,): three Gauss points each."""
    x, w = np.polynomial.legendre.leggauss(3)
    h = 0.5 * np.diff(s)
    points = s[:-1, None] + h[:, None] * (1.0 + x)
    slope = curve(points, 1)
    return h * (np.hypot(slope[..., 0], slope[..., 1]) @ w)


# --- the cable in motion --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Side:
    """One side of the mass at one frame, from support to mass or from mass to support; m nodes."""

    s: Array
    place: Array  # (m, 2)
    velocity: Array  # (m, 2) at fixed s
    rest: Array  # (m, 2) place at rest
    T_static: Array  # (m,)
    T: Array  # (m,)


def _chosen(r: Response, window: Window) -> Frames:
    """Return the indices of the frames at which windows begin and end."""
    at = r.fields.s_o / r.length
    inside = np.flatnonzero((at >= window[0] * (1.0 - 1e-9)) & (at <= window[1] * (1.0 + 1e-9)))
    return inside[:: min(EVERY, max(1, inside.size // 4))]


def _sides(r: Response, frames: Frames) -> list[tuple[_Side, _Side]]:
    f = r.fields
    rest = CubicSpline(f.s, np.stack([f.x, f.y, f.T_static], axis=1))
    at, t = f.s_o[frames], f.t[frames]
    pace = CubicSpline(r.t, r.s_o)(t, 1)
    of_mass = np.stack([np.interp(t, r.t, r.velocity[:, i]) for i in (0, 1)], axis=1)
    out = []
    for i, k in enumerate(frames):
        mass_rest = rest(at[i])
        place = np.stack([f.x + f.u[k], f.y + f.v[k]], axis=1)
        mass = mass_rest[:2] + np.array([f.mass_u[k], f.mass_v[k]])
        velocity = np.stack([f.du[k], f.dv[k]], axis=1)
        static = np.stack([f.x, f.y], axis=1)
        sides = []
        for keep, slope, T, behind in (
            (f.s < at[i] * (1.0 - 1e-9), r.slope_behind, f.T_behind[k], True),
            (f.s > at[i] * (1.0 + 1e-9), r.slope_ahead, f.T_ahead[k], False),
        ):
            # the material at the mass: dp/dt = r_t + ds_o r' on either side
            at_mass = of_mass[i] - pace[i] * np.array([np.interp(t[i], r.t, slope[:, j]) for j in (0, 1)])

            def whole(inner: Array, here: Any, behind: bool = behind) -> Array:
                here = np.asarray(here)[None]
                return np.concatenate([inner, here] if behind else [here, inner])

            sides.append(_Side(
                whole(f.s[keep], at[i]), whole(place[keep], mass), whole(velocity[keep], at_mass),
                whole(static[keep], mass_rest[:2]), whole(f.T_static[keep], mass_rest[2]), whole(f.T[k, keep], T),
            ))  # fmt: skip
        out.append((sides[0], sides[1]))
    return out


def stretch(r: Response, given: Given, window: Window) -> Defect:
    """Mean tension of each side is that at rest plus EA times the side's strain, from the sampled curve; over H."""
    frames = _chosen(r, window)
    off = []
    for sides in _sides(r, frames):
        row = []
        for x in sides:
            l = x.s[-1] - x.s[0]
            grown = _length(x.s, x.place) - _length(x.s, x.rest)
            mean = float(simpson(x.T - x.T_static, x=x.s)) / l
            row.append(mean - given.EA * grown / l)
        off.append(row)
    return Defect(r.fields.s_o[frames] / r.length, np.array(off).reshape(-1, 2) / r.horizontal_tension)


def _length(s: Array, place: Array) -> float:
    """Return the length of the curve through nodes of distance h: a cubic spline's, a chord where there are two."""
    if s.size < 4:
        return float(np.hypot(*np.diff(place, axis=0).T).sum())
    return float(_arcs(CubicSpline(s, place), s).sum())


def _outside(r: Response, given: Given) -> Array:
    """Return what acts on the mass besides the cable, (n, 2) [N]: weight, haul rope or thrust, drag of the TOML."""
    force = given.weight * DOWN + np.zeros((r.t.size, 2))
    if r.drive != "grip":
        mean = r.slope_behind + r.slope_ahead
        force += np.nan_to_num(r.F_haul)[:, None] * mean / np.hypot(mean[:, 0], mean[:, 1])[:, None]
        k = 0.5 * given.drive.get("air_density", 1.2) * given.drive.get("drag_area", 0.0)
        past = r.velocity - [given.drive.get("wind", 0.0), 0.0]
        force -= k * np.hypot(past[:, 0], past[:, 1])[:, None] * past
    return force


def _impulse(r: Response, force: Array, at: Array) -> Array:
    """Return the integral of a force (n, c) over time, from the first step to instants `at`."""
    known = np.nan_to_num(force)
    total = cumulative_trapezoid(known, r.t, axis=0, initial=0.0)
    return CubicHermiteSpline(r.t, total, known, axis=0)(at)


def _over_windows(r: Response, frames: Frames, whole: Array, scale: float) -> Defect:
    """Return the change over each window of a quantity (k, c) that ought not to change, over scale times its time."""
    t = r.fields.t[frames]
    middle = 0.5 * (r.fields.s_o[frames][1:] + r.fields.s_o[frames][:-1]) / r.length
    return Defect(middle, np.diff(whole, axis=0) / (scale * np.mean(np.diff(t))))


def _of_mass(r: Response, given: Given, window: Window, pull: Array) -> Defect:
    """Return what is missing from the momentum of the mass; pull (n, 2): force of the cable on it."""
    frames = _chosen(r, window)
    kept = given.mass * r.velocity - cumulative_trapezoid(
        np.nan_to_num(pull) + _outside(r, given), r.t, axis=0, initial=0.0
    )
    at = np.stack([np.interp(r.fields.t[frames], r.t, kept[:, i]) for i in (0, 1)], axis=1)
    return _over_windows(r, frames, at, given.weight)


def momentum_of_the_mass(r: Response, given: Given, window: Window) -> Defect:
    """M (v_2 - v_1) is the impulse of weight, contact force and what acts from outside; over M g times the window."""
    return _of_mass(r, given, window, -r.contact)


def impulse(r: Response, given: Given, window: Window) -> Defect:
    """M (v_2 - v_1) with the cable's pull [ N t - rho ds_o^2 r' ] from both tensions; over M g times the window."""
    pace = CubicSpline(r.t, r.s_o)(r.t, 1)
    pull = np.zeros((r.t.size, 2))
    for sign, T, slope in ((-1.0, r.T_behind, r.slope_behind), (1.0, r.T_ahead, r.slope_ahead)):
        tangent = slope / np.hypot(slope[:, 0], slope[:, 1])[:, None]
        pull += sign * (T[:, None] * tangent - given.rho * (pace**2)[:, None] * slope)
    return _of_mass(r, given, window, pull)


def momentum_of_the_cable(r: Response, given: Given, window: Window) -> Defect:
    """rho int r. ds changes by the impulse of reactions, weight and mass; over all weight times the window."""
    frames = _chosen(r, window)
    kept = np.array([given.rho * sum(simpson(x.velocity, x=x.s, axis=0) for x in sides) for sides in _sides(r, frames)])
    weight = given.rho * given.gravity * r.fields.s[-1]
    force = r.reaction_left + r.reaction_right + r.contact + weight * DOWN
    kept = kept.reshape(-1, 2) - _impulse(r, force, r.fields.t[frames])
    return _known(_over_windows(r, frames, kept, weight + given.weight), force)


def moment_of_momentum(r: Response, given: Given, window: Window) -> Defect:
    """rho int r x r. ds about the left support changes by the moments' impulse; over all weight, span and window."""
    frames = _chosen(r, window)
    weight = given.rho * given.gravity
    spin, lever = [], []
    for sides in _sides(r, frames):
        spin.append(given.rho * sum(float(simpson(_cross(x.place, x.velocity), x=x.s)) for x in sides))
        lever.append(weight * sum(float(simpson(x.place[:, 0], x=x.s)) for x in sides))
    right = np.array([given.span, given.drop])
    place = np.stack([r.x, r.y], axis=1)
    moment = (_cross(right, r.reaction_right) + _cross(place, r.contact))[:, None]
    t = r.fields.t[frames]
    own = CubicSpline(t, lever).antiderivative()(t) if t.size > 3 else cumulative_trapezoid(lever, t, initial=0.0)
    kept = np.array(spin) - own - _impulse(r, moment, t)[:, 0]
    scale = (weight * r.fields.s[-1] + given.weight) * given.span
    return _known(_over_windows(r, frames, kept[:, None], scale), moment)


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _known(found: Defect, force: Array) -> Defect:
    """Return the defect, nan if a force in it is unknown."""
    return found if np.isfinite(force[1:-1]).all() else Defect(found.place, np.full_like(found.value, math.nan))


def energy(r: Response, given: Given, window: Window) -> Defect:
    """Energy of cable and mass changes by the work of the drive; over weight times largest deflection.

    Strain energy from the tension, W = (N^2 - T^2)/(2 EA); power of a grip ds_o (-contact . <r'> + <N t> . [r'] - [W]).
    """
    frames = _chosen(r, window)
    f, weight = r.fields, given.rho * given.gravity
    v = np.stack([np.interp(f.t[frames], r.t, r.velocity[:, i]) for i in (0, 1)], axis=1)
    y = np.interp(f.t[frames], r.t, r.y)
    whole = 0.5 * given.mass * np.sum(v**2, axis=1) - given.weight * y
    for i, sides in enumerate(_sides(r, frames)):
        for x in sides:
            density = 0.5 * given.rho * np.sum(x.velocity**2, axis=1) - weight * x.place[:, 1]
            density += (x.T**2 - x.T_static**2) / (2.0 * given.EA)
            whole[i] += float(simpson(density, x=x.s))
    power = _power(r, given)
    kept = whole[:, None] - _impulse(r, power[:, None], f.t[frames])
    middle = 0.5 * (f.s_o[frames][1:] + f.s_o[frames][:-1]) / r.length
    return _known(Defect(middle, np.diff(kept, axis=0) / (given.weight * r.max_deflection)), power)


def _power(r: Response, given: Given) -> Array:
    """Return what drive and outside forces put in (n,) [W], for a grip from forces and slopes, else as reported."""
    if r.drive != "grip":
        return np.sum(list(r.powers.values()), axis=0) if r.powers else np.full(r.t.size, math.nan)
    pace = CubicSpline(r.t, r.s_o)(r.t, 1)
    mean, jump = 0.5 * (r.slope_behind + r.slope_ahead), r.slope_ahead - r.slope_behind
    pull, stored = np.zeros((r.t.size, 2)), np.zeros(r.t.size)
    for sign, T, slope in ((-1.0, r.T_behind, r.slope_behind), (1.0, r.T_ahead, r.slope_ahead)):
        pull += 0.5 * (T / np.hypot(slope[:, 0], slope[:, 1]))[:, None] * slope
        stored += sign * T**2 / (2.0 * given.EA)  # that at rest is the same on both sides
    return pace * (-np.sum(r.contact * mean, axis=1) + np.sum(pull * jump, axis=1) - stored)


def travel(r: Response, given: Given, window: Window) -> Defect:
    """s_o(t) is the travel that the TOML asks for; over the length."""
    inside = (r.s_o / r.length >= window[0]) & (r.s_o / r.length <= window[1])
    t, s = r.t[inside], r.s_o[inside]
    law, l, start = given.travel, r.fields.s[-1], 0.0
    if r.drive == "haul":
        start = given.drive.get("start", 0.01 * l)
    kind = law["kind"]
    if kind == "table":
        times, places = np.array(law["times"]), np.array(law["positions"]) + start
        known = (times >= t[0]) & (times <= t[-1])
        off = CubicSpline(r.t, r.s_o)(times[known]) - places[known]
        return Defect(places[known] / l, off[:, None] / l)
    if kind == "constant_speed":
        want = law["speed"] * t
    elif kind == "constant_acceleration":
        want = law.get("initial_speed", 0.0) * t + 0.5 * law["acceleration"] * t**2
    else:
        V, third = law["top_speed"], l / 3.0
        a, t1 = 0.5 * V * V / third, 2.0 * third / V
        t2 = t1 + third / V
        left = np.clip(t2 + t1 - t, 0.0, t1)
        want = np.where(t < t1, 0.5 * a * t**2, np.where(t < t2, third + V * (t - t1), l - 0.5 * a * left**2))
    return Defect(s / l, (s - start - want)[:, None] / l)


REST: dict[str, Law] = {
    "ends at rest": ends, "length at rest": length, "shape at rest": shape, "forces at rest": rest_forces,
}  # fmt: skip
MOTION: dict[str, Law] = {
    "travel": travel, "stretch": stretch, "momentum of the mass": momentum_of_the_mass, "impulse": impulse,
    "momentum of the cable": momentum_of_the_cable, "moment of momentum": moment_of_momentum, "energy": energy,
}  # fmt: skip
