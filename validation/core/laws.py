"""A judge that knows mechanics by itself: responses against the laws of mechanics and the scene's TOML, all in SI.

Nothing of the solvers, nothing of the scene package: the numbers are read with tomllib, the rest is in the response.
So it sees what both wings share: groups, static shape, travel, units, sampling.

Every law is a defect that is zero for the exact answer, part of a scale of its own.  What a right answer leaves is its
resolution (told by its companions) and the sampling of its fields (told by leaving out every second station).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, simpson
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from cablefem.response import Array, Response

OFTEN = 0.2  # of the time a transverse wave takes along the cable, that may lie between frames which tell velocities
EVERY = 6  # frames from one end of a window to the next: 0.06 of the travel
ROUNDING = 1e-9  # of the scale: stations and splines of static shapes
SIDE = 1e-6  # of a step, beside an event
NEXT = 0.01  # of the length, next to a support
TRAPEZOIDS = 1e-4  # of the scale: impulses over steps across which an acceleration jumps
# Times what half the resolution and half the steps change: a defect falls with an order between 1/2 and 1 where a ride
# begins or changes of a sudden.
SAFETY = 2.5
DOWN = np.array([0.0, 1.0])

Window = tuple[float, float]


class Given:
    """A scene's own numbers, SI, as its TOML has them."""

    def __init__(self, toml: str) -> None:
        x = tomllib.loads(toml)
        cable, supports = x["cable"], x["supports"]
        self.gravity: float = x.get("gravity", 9.81)
        self.rho: float = cable["mass_per_length"]
        self.EA: float = cable["EA"]
        self.span, self.drop = supports["span"], supports["drop"]
        self.mass: float = x["mass"]["mass"]
        self.weight = self.mass * self.gravity
        # "length", "sag" or "horizontal_tension" and its value
        self.asked = next((name, cable[name]) for name in ("length", "sag", "horizontal_tension") if name in cable)
        self.travel, self.drive = x.get("travel", {}), x.get("drive", {})


@dataclass(frozen=True, slots=True)
class Defect:
    """What is missing from a law: at places s_o/l (nan where there is none), part of the law's scale."""

    place: Array  # (k,)
    value: Array  # (k, c)

    @property
    def rms(self) -> Array:
        """Of all components together and of each, over the places, (1 + c,)."""
        each = np.mean(self.value**2, axis=0)
        return np.sqrt(np.append(each.sum(), each))

    def changed(self, other: Defect) -> Array:
        """Return the rms of its distance to another run's, (1 + c,); nan where that ends early."""
        same = other.value.shape == self.value.shape
        return Defect(self.place, other.value - self.value).rms if same else math.nan * self.rms


@dataclass(frozen=True, slots=True)
class Held:
    """A law held against a run: its rms defect, what may be left of it, and where it is largest (s_o/l)."""

    law: str
    gap: float  # nan where the response does not say what the law asks for
    sampling: float  # what the stations leave: twice what every second one changes
    changed: float  # by half the resolution and half the steps together; nan where a companion ends early
    where: float | None


def hold(r: Response, window: Window, companions: Sequence[Response] = ()) -> Iterator[Held]:
    """Hold every law that a response can be held against, over a window of s_o/l, the cable at rest first.

    Where one of several components by itself is more than what may be left of it, that is told: a sharp one shows what
    blunt ones would hide.
    """
    case, sparse = Mechanics(r, window), Mechanics(_thinned(r), window, every=2)
    others = [Mechanics(c, window) for c in companions]
    for name, law in LAWS.items():
        if not law.concerns(case):
            continue
        found = law.defect(case)
        if not (found.place.size and np.isfinite(found.value).all()):
            yield Held(name, math.nan, math.nan, math.nan, None)
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
        yield Held(name, rms, sampled, left, None if math.isnan(at) else at)


Finds = Callable[["Mechanics"], Defect]


@dataclass(frozen=True, slots=True)
class Law:
    """One law of mechanics: its defect, what a right answer's defect depends on, and whom it concerns."""

    defect: Finds
    asks: str  # "nothing" of a run, its "stations", or its "resolution"
    concerns: Callable[[Mechanics], bool]


LAWS: dict[str, Law] = {}


def _law(asks: str, concerns: Callable[[Mechanics], bool] = lambda m: True) -> Callable[[Finds], Finds]:
    def listed(defect: Finds) -> Finds:
        LAWS[defect.__name__.replace("_", " ")] = Law(defect, asks, concerns)
        return defect

    return listed


def _thinned(r: Response) -> Response:
    """Return the response with every second station of its fields."""
    f = r.fields
    rows = {name: getattr(f, name)[::2] for name in ("s", "x", "y", "T_static")}
    columns = {name: getattr(f, name)[:, ::2] for name in ("u", "v", "du", "dv", "T", "T_pointwise")}
    return replace(r, fields=replace(f, **rows, **columns))


@dataclass(frozen=True, slots=True)
class _Side:
    """One side of the mass at one frame, from support to mass or from mass to support; m nodes."""

    s: Array
    place: Array  # (m, 2)
    velocity: Array  # (m, 2) at fixed s
    rest: Array  # (m, 2) place at rest
    T_static: Array  # (m,)
    T: Array  # (m,)

    @classmethod
    def of(cls, rows: Array) -> _Side:
        s, place, velocity, rest, T_static, T = np.split(rows, [1, 3, 5, 7, 8], axis=1)
        return cls(s[:, 0], place, velocity, rest, T_static[:, 0], T[:, 0])


def _rolls(m: Mechanics) -> bool:
    return m.r.drive != "grip"


def _sees_swings(m: Mechanics) -> bool:
    """Return whether frames follow each other closely enough for a velocity to be summed."""
    between = float(np.diff(m.r.fields.t[m.frames[0] : m.frames[-1]]).max(initial=0.0))
    return between <= OFTEN * m.r.length * math.sqrt(m.given.rho / m.r.horizontal_tension)


def _knows_strain(m: Mechanics) -> bool:
    """Return whether a pointwise tension is told: a solver may know the one from equilibrium alone."""
    return m.r.model == "full" and not np.array_equal(m.r.T_behind, m.r.T_behind_pointwise, equal_nan=True)


class Mechanics:
    """The laws, held against one response over a window of s_o/l; each returns its defect.

    every : so-manieth frame of the velocity of the cable is looked at.
    """

    def __init__(self, r: Response, window: Window, every: int = 1) -> None:
        self.r, self.window, self.every, self.given = r, window, every, Given(r.scene_toml)

    # --- the cable at rest -----------------------------------------------------------------------------
    @cached_property
    def curve(self) -> CubicSpline:
        """Place (x, y) of the cable at rest over s."""
        f = self.r.fields
        return CubicSpline(f.s, np.stack([f.x, f.y], axis=1))

    @_law("stations")
    def ends_at_rest(self) -> Defect:
        """The cable ends at its supports; over the span."""
        f, given = self.r.fields, self.given
        return _static(*(np.array([f.x[0], f.y[0], f.x[-1] - given.span, f.y[-1] - given.drop]) / given.span))

    @_law("stations")
    def length_at_rest(self) -> Defect:
        """Stations count the length of the curve, from none to all of it, and that is the length asked for; over it."""
        s, asked = self.r.fields.s, self.given.asked
        off = [s[0], float(np.abs(np.cumsum(_arcs(self.curve, s)[0]) - s[1:]).max()), s[-1] - self.r.length]
        off += [s[-1] - asked[1]] if asked[0] == "length" else []
        return _static(*(np.array(off) / s[-1]))

    @_law("stations")
    def shape_at_rest(self) -> Defect:
        """Sag below the chord, or horizontal tension, as asked for; over itself.  A length has its own law."""
        (name, value), f = self.given.asked, self.r.fields
        if name == "sag":
            below = CubicSpline(f.s, f.y - self.given.drop / self.given.span * f.x)
            found = max([0.0, *below(below.derivative().roots(extrapolate=False)).tolist()])
        else:
            found = self.r.horizontal_tension if name == "horizontal_tension" else value
        return _static(found / value - 1.0)

    @_law("stations")
    def forces_at_rest(self) -> Defect:
        """T x' = H all along, over H; T y' falls by rho g per metre, the supports carry the weight, over rho g l."""
        s, H, weight = self.r.fields.s, self.r.horizontal_tension, self.given.rho * self.given.gravity
        force = self.r.fields.T_static[:, None] * self.curve(s, 1)
        falls = force[0, 1] - force[:, 1] - weight * s
        return _static(np.abs(force[:, 0] - H).max() / H, np.abs(falls).max() / (weight * s[-1]))

    # --- windows -----------------------------------------------------------------------------------------
    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """Which steps lie in the window, off the supports."""
        r, (low, high) = self.r, self.window
        return (r.s_o >= max(low, ROUNDING) * r.length) & (r.s_o <= min(high, 1.0 - ROUNDING) * r.length)

    @cached_property
    def frames(self) -> NDArray[np.intp]:
        """Indices of the frames at which windows begin and end."""
        at, (low, high) = self.r.fields.s_o / self.r.length, self.window
        inside = np.flatnonzero((at >= low * (1.0 - 1e-9)) & (at <= high * (1.0 + 1e-9)))
        return inside[:: min(EVERY, max(1, inside.size // 4))]

    @property
    def t(self) -> Array:
        """Instants of the frames."""
        return self.r.fields.t[self.frames]

    @property
    def lasts(self) -> float:
        """Mean time of a window."""
        return float(np.mean(np.diff(self.t)))

    def _at_frames(self, values: Array) -> Array:
        """Interpolate what is given at every step (n, c) to the frames (k, c)."""
        return np.stack([np.interp(self.t, self.r.t, column) for column in values.T], axis=1)

    def _over_windows(self, kept: Array, scale: float) -> Defect:
        """Return the change over each window of what ought not to change (k, c), over a scale."""
        at = self.r.fields.s_o[self.frames] / self.r.length
        return Defect(0.5 * (at[1:] + at[:-1]), np.diff(kept, axis=0) / scale)

    def _impulse_of(self, force: Array) -> Array:
        """Return the integral of a force (n, c) over time up to the frames (k, c); nan if it is not known."""
        if not np.isfinite(force[1:-1]).all():
            return np.full((self.t.size, force.shape[1]), math.nan)
        t, force = self._on_both_sides(np.nan_to_num(force))  # nan on the supports
        total = cumulative_trapezoid(force, t, axis=0, initial=0.0)
        return CubicHermiteSpline(t, total, force, axis=0)(self.t)

    def _on_both_sides(self, force: Array) -> tuple[Array, Array]:
        """Return times and force with a second value at events, where it may jump: the step there has but one."""
        t = self.r.t
        for event in self.r.events:
            i = int(np.argmin(np.abs(t - event["t"])))
            if not 1 < i < t.size - 2:
                continue
            before, after = (np.abs(np.diff(force[[i, j]], axis=0)).max() for j in (i - 1, i + 1))
            # the smaller change is that of the side the value is from
            other, at = (i - 1, i) if after < before else (i + 1, i + 1)
            beside = t[i] + SIDE * (t[other] - t[i])
            t, force = np.insert(t, at, beside), np.insert(force, at, force[other], axis=0)
        return t, force

    # --- travel and drive --------------------------------------------------------------------------------
    @cached_property
    def pace(self) -> Array:
        """ds_o/dt at every step (n,)."""
        return CubicSpline(self.r.t, self.r.s_o)(self.r.t, 1)

    @_law("stations", lambda m: m.r.drive != "free")
    def travel(self) -> Defect:
        """s_o(t) is the travel that the TOML asks for; over the length."""
        r, law, drive, l = self.r, self.given.travel, self.given.drive, self.r.fields.s[-1]
        start, way = 0.0, l
        if r.drive == "haul":
            start = drive.get("start", 0.01 * l)
            way = drive.get("end", {}).get("place", 0.99 * l) - start
        inside = (r.s_o / r.length >= self.window[0]) & (r.s_o / r.length <= self.window[1])
        t, s = r.t[inside], r.s_o[inside]
        if law["kind"] == "table":
            times, places = np.array(law["times"]), np.array(law["positions"]) + start
            known = (times >= t[0]) & (times <= t[-1])
            off = CubicSpline(r.t, r.s_o)(times[known]) - places[known]
            return Defect(places[known] / l, off[:, None] / l)
        if law["kind"] == "constant_speed":
            # after a ramp from rest, with an acceleration that falls to zero at its end
            T = 1.5 * law.get("entry_ramp", 0.0) / law["speed"]
            x = np.minimum(t / T, 1.0) if T else np.ones(t.size)
            want = law["speed"] * (T * (x**2 - x**3 / 3.0) + np.maximum(t - T, 0.0))
        elif law["kind"] == "constant_acceleration":
            want = law.get("initial_speed", 0.0) * t + 0.5 * law["acceleration"] * t**2
        else:
            V, third = law["top_speed"], way / 3.0
            a, t1 = 0.5 * V * V / third, 2.0 * third / V
            t2 = t1 + third / V
            left = np.clip(t2 + t1 - t, 0.0, t1)
            want = np.where(t < t1, 0.5 * a * t**2, np.where(t < t2, third + V * (t - t1), way - 0.5 * a * left**2))
        return Defect(s / l, (s - start - want)[:, None] / l)

    @_law("stations", _rolls)
    def drive(self) -> Defect:
        """The car begins, brakes and arrives where the TOML says, is let go and driven as long and as hard as it says.

        Each event is where and as fast as the car is then; over length, time, top speed and largest thrust.
        """
        r, drive, l, T = self.r, self.given.drive, self.r.fields.s[-1], self.r.t[-1]
        times, forces = self._thrust
        start = drive.get("start", 0.01 * l)
        off = [(r.s_o[0] - start) / l]
        told = {
            "release": ("t", T, [drive.get("release", 0.0)]), "thrust_end": ("t", T, times[-1:].tolist()),
            "brake": ("s_o", l, [brake["from"] for brake in drive.get("brake", [])]),
            "arrival": ("s_o", l, [drive.get("end", {}).get("place", 0.99 * l)]),
            "back": ("s_o", l, [0.5 * min(start, 0.01 * l)]),
        }  # fmt: skip
        for x in r.events:
            off.append((np.interp(x["t"], r.t, r.s_o) - x["s_o"]) / l)
            off.append((np.interp(x["t"], r.t, r.speed) - x["speed"]) / float(r.speed.max()))
            of, scale, wanted = told.get(x["event"], ("t", 1.0, []))
            off += [min(abs(x[of] - y) for y in wanted) / scale] if wanted else []
        if r.drive == "free" and times.size:
            smooth = np.abs(r.t[:, None] - times).min(axis=1) > SIDE * T
            off.append(np.abs(r.F_haul - self._pull)[smooth].max() / float(np.abs(forces).max()))
        return _static(*off)

    @cached_property
    def _thrust(self) -> tuple[Array, Array]:
        """Times and forces of the TOML's thrust, none where there is none."""
        thrust = self.given.drive.get("thrust", 0.0)
        if not isinstance(thrust, dict):
            thrust = {"times": [0.0, math.inf], "forces": 2 * [thrust]} if thrust else {"times": [], "forces": []}
        return np.array(thrust["times"], float), np.array(thrust["forces"], float)

    @cached_property
    def _pull(self) -> Array:
        """Force from outside along the mean tangent (n,): the TOML's thrust on a free car, else what the run says."""
        times, forces = self._thrust
        if self.r.drive != "free" or not times.size:
            return np.nan_to_num(self.r.F_haul) if self.r.drive == "haul" else np.zeros(self.r.t.size)
        if math.isinf(times[-1]):
            return np.full(self.r.t.size, forces[0])
        return np.interp(self.r.t, times, forces, left=0.0, right=0.0)

    @cached_property
    def _drag(self) -> Array:
        """Drag of the TOML (n, 2) [N]."""
        drive = self.given.drive
        k = 0.5 * drive.get("air_density", 1.2) * drive.get("drag_area", 0.0)
        past = self.r.velocity - [drive.get("wind", 0.0), 0.0]
        return -k * np.hypot(past[:, 0], past[:, 1])[:, None] * past

    @cached_property
    def _rub(self) -> tuple[Array, Array]:
        """Rolling friction and brakes (n,) [N], against the motion along the cable."""
        r, drive = self.r, self.given.drive
        shoes = [x["force"] * (r.s_o >= x["from"]) for x in drive.get("brake", [])]
        return drive.get("rolling_friction", 0.0) * np.abs(r.F_contact), np.sum([np.zeros(r.t.size), *shoes], axis=0)

    # --- the mass, at steps --------------------------------------------------------------------------------
    @_law("stations")
    def place_of_the_mass(self) -> Defect:
        """p = X(s_o) + w; over the largest deflection."""
        r, k = self.r, self.inside
        off = np.stack([r.x - r.u, r.y - r.v], axis=1)[k] - self.curve(r.s_o[k])
        return Defect(r.s_o[k] / r.length, off / r.max_deflection)

    @_law("stations", _knows_strain)
    def strain_at_the_mass(self) -> Defect:
        """Pointwise tension is that at rest plus EA (|r'| - 1), and not below none where the law says so; over H."""
        r, k, f = self.r, self.inside, self.r.fields
        T, off = CubicSpline(f.s, f.T_static)(r.s_o[k]), []
        for slope, told in ((r.slope_behind, r.T_behind_pointwise), (r.slope_ahead, r.T_ahead_pointwise)):
            N = T + self.given.EA * (np.hypot(*slope[k].T) - 1.0)
            off.append(told[k] - (np.maximum(N, 0.0) if r.law == "tension-only" else N))
        return Defect(r.s_o[k] / r.length, np.stack(off, axis=1) / r.horizontal_tension)

    @_law("resolution")
    def speed_of_the_mass(self) -> Defect:
        """The way of the mass is the integral of its velocity; over top speed times the window."""
        r = self.r
        kept = self._at_frames(np.stack([r.x, r.y], axis=1)) - self._impulse_of(r.velocity)
        return self._over_windows(kept, float(r.speed.max()) * self.lasts)

    def _of_mass(self, pull: Array) -> Defect:
        """Return what is missing from the momentum of the mass under the cable's pull (n, 2)."""
        r, weight = self.r, self.given.weight
        force = pull + weight * DOWN
        if r.drive != "grip":  # haul rope or thrust, and drag
            mean = r.slope_behind + r.slope_ahead
            force = force + self._pull[:, None] * mean / np.hypot(*mean.T)[:, None] + self._drag
        known = np.isfinite(force[1:-1]).all()
        impulse = cumulative_trapezoid(np.nan_to_num(force), r.t, axis=0, initial=0.0) if known else math.nan
        return self._over_windows(self._at_frames(self.given.mass * r.velocity - impulse), weight * self.lasts)

    @_law("resolution")
    def momentum_of_the_mass(self) -> Defect:
        """M (v_2 - v_1) is the impulse of weight, contact force and what acts from outside; over M g times window."""
        return self._of_mass(-self.r.contact)

    @_law("resolution")
    def impulse(self) -> Defect:
        """M (v_2 - v_1) with the cable's pull [ N t - rho ds_o^2 r' ] by both tensions; over M g times the window."""
        pull = np.zeros((self.r.t.size, 2))
        for sign, T, slope in self._both():
            pull += sign * (T / np.hypot(*slope.T) - self.given.rho * self.pace**2)[:, None] * slope
        return self._of_mass(pull)

    def _both(self) -> Iterator[tuple[float, Array, Array]]:
        """Give sign, tension and slope behind and ahead of the mass, so that the sum is what is ahead less behind."""
        yield -1.0, self.r.T_behind, self.r.slope_behind
        yield 1.0, self.r.T_ahead, self.r.slope_ahead

    @_law("resolution", _rolls)
    def tension_on_both_sides(self) -> Defect:
        """A car that rolls has the same tension on both sides but for friction and brakes; over M g times the window.

        [N] (1 - rho ds_o^2/EA) = -(mu_r |contact| + brakes) sign(ds_o); while it is held or stands it may differ.  A
        window in which a brake or a thrust jumps is left out: the step there has but one of the two values.
        """
        r, given = self.r, self.given
        rubs = np.sum(self._rub, axis=0) * np.sign(self.pace)
        apart = (r.T_ahead - r.T_behind) * (1.0 - given.rho * self.pace**2 / given.EA) + rubs
        kept = self._over_windows(self._impulse_of(apart[:, None]), given.weight * self.lasts)
        rolls = np.abs(np.interp(self.t, r.t, self.pace)) > 0.05 * np.abs(self.pace).max()
        rolls &= self.t >= given.drive.get("release", 0.0)
        jumps = np.histogram([x["t"] for x in r.events], self.t)[0] > 0
        return Defect(kept.place, np.where((rolls[1:] & rolls[:-1] & ~jumps)[:, None], kept.value, 0.0))

    # --- the cable, at frames ------------------------------------------------------------------------------
    @cached_property
    def sides(self) -> list[tuple[_Side, _Side]]:
        """Both sides of the mass at the frames."""
        r, f, at = self.r, self.r.fields, self.r.fields.s_o[self.frames]
        static = np.stack([f.x, f.y, f.T_static], axis=1)
        rest = CubicSpline(f.s, static)(at)
        place = rest[:, :2] + np.stack([f.mass_u, f.mass_v], axis=1)[self.frames]
        # the material at the mass: dp/dt = r_t + ds_o r' on either side
        moves = [self._at_frames(r.velocity - self.pace[:, None] * slope) for slope in (r.slope_behind, r.slope_ahead)]
        out = []
        for i, k in enumerate(self.frames):
            columns = f.s, f.x + f.u[k], f.y + f.v[k], f.du[k], f.dv[k], *static.T, f.T[k]
            rows = np.stack(columns, axis=1)
            behind, ahead = (
                np.concatenate([[at[i]], place[i], moves[side][i], rest[i], [T[k]]])[None]
                for side, T in enumerate((f.T_behind, f.T_ahead))
            )
            pair = [rows[f.s < at[i] * (1.0 - 1e-9)], behind], [ahead, rows[f.s > at[i] * (1.0 + 1e-9)]]
            out.append((_Side.of(np.concatenate(pair[0])), _Side.of(np.concatenate(pair[1]))))
        return out

    def _along(self, of: Callable[[_Side], Array]) -> Array:
        """Return the integral over both sides of a density (m,) or (m, c), at the frames (k, ...)."""
        return np.array([sum(simpson(of(x), x=x.s, axis=0) for x in pair) for pair in self.sides])

    @_law("nothing", lambda m: m.r.switched is not None or m.r.law == "tension-only")
    def compression(self) -> Defect:
        """A cable that carries none is under none; over H."""
        f = self.r.fields
        T = f.T_pointwise[f.s_o / self.r.length > (self.r.switched or 0.0)]
        return _static(min(0.0, float(T.min(initial=0.0))) / self.r.horizontal_tension)

    @_law("resolution")
    def fields_at_the_mass(self) -> Defect:
        """What frames say of the mass is what steps do; over the largest deflection."""
        r, f = self.r, self.r.fields
        steps = CubicSpline(r.t, np.stack([r.s_o, r.u, r.v], axis=1))(self.t)
        off = np.stack([f.s_o, f.mass_u, f.mass_v], axis=1)[self.frames] - steps
        return Defect(f.s_o[self.frames] / r.length, off / r.max_deflection)

    def _up_to_the_mass(self, of: Callable[[_Side], Array]) -> tuple[Array, ...]:
        """Return what a field (m,) or (m, c) is at the mass and what it misses when it goes on to there, (k, 2 c).

        Next to a support, where stations are few and waves from there not yet apart, none of either.
        """
        found = []
        for pair in self.sides:
            rows = [(x.s[::way][:3], of(x)[::way][:3]) for x, way in zip(pair, (-1, 1), strict=True)]
            far = min(s.size for s, _ in rows) > 2 and min(np.ptp(x.s) for x in pair) > NEXT * self.r.length
            told = [far * y[0] for _, y in rows]
            goes_on = [y[1] + (y[1] - y[2]) * (s[0] - s[1]) / (s[1] - s[2]) if far else 0.0 * y[0] for s, y in rows]
            found.append((told, np.subtract(told, goes_on)))
        return tuple(np.reshape(x, (len(found), -1)) for x in zip(*found, strict=True))

    @_law("resolution")
    def tension_up_to_the_mass(self) -> Defect:
        """Tension along the cable goes on to that at the mass, in the mean over the frames; over H."""
        _, off = self._up_to_the_mass(lambda x: x.T)
        return _static(*(off.mean(axis=0) / self.r.horizontal_tension))

    @_law("resolution")
    def velocity_up_to_the_mass(self) -> Defect:
        """Velocity of the cable goes on to that at the mass, each way by itself; over its rms there."""
        told, off = self._up_to_the_mass(lambda x: x.velocity)
        return Defect(self.r.fields.s_o[self.frames] / self.r.length, off / np.sqrt(np.mean(told**2, axis=0)))

    @_law("resolution", _sees_swings)
    def integral_of_the_velocity(self) -> Defect:
        """What the cable moves across itself at rest is the integral of its velocity, both weighted by half a sine.

        Over the rms of that.  Along it, and in shorter waves, it swings to and fro between two frames.
        """
        f, last = self.r.fields, (self.frames.size - 1) // 2 * 2
        of, step = np.arange(self.frames[0], self.frames[last] + 1), 2 * int(self.frames[1] - self.frames[0])
        tangent, sine = self.curve(f.s, 1), np.sin(math.pi / f.s[-1] * f.s)
        w, dw = ((tangent[:, 0] * b[of] - tangent[:, 1] * a[of]) @ sine for a, b in ((f.u, f.v), (f.du, f.dv)))
        way = cumulative_trapezoid(dw[:: self.every], f.t[of[:: self.every]], axis=0, initial=0.0)
        time, at = np.diff(f.t[of[::step]]), f.s_o[of[::step]] / self.r.length
        off = np.diff(w[::step] - way[:: step // self.every], axis=0) / np.mean(time)
        return Defect(0.5 * (at[1:] + at[:-1]), off[:, None] / math.sqrt(float(np.mean(dw**2))))

    @_law("resolution")
    def stretch(self) -> Defect:
        """Mean tension of a piece is that at rest plus EA times the piece's strain by the sampled curve; over H.

        Pieces are the shorter side and both halves of the longer one: the ends of a side lie on support and mass,
        whatever the fields are between, and in shorter pieces the ripples of a basis have no mean.
        """
        off = []
        for pair in self.sides:
            longer = max(pair, key=lambda x: x.s[-1] - x.s[0])
            for x in pair:
                moved, rest = _lengths(x.s, x.place, x.rest)
                strain = np.cumsum(np.append(0.0, moved - rest))
                rise = CubicSpline(x.s, x.T - x.T_static).antiderivative()(x.s)
                ends = [0, x.s.size // 2, -1] if x is longer else [0, -1]
                off += (np.diff((rise - self.given.EA * strain)[ends]) / np.diff(x.s[ends])).tolist()
        at = self.r.fields.s_o[self.frames] / self.r.length
        return Defect(at, np.reshape(off, (-1, 3)) / self.r.horizontal_tension)

    @_law("resolution")
    def momentum_of_the_cable(self) -> Defect:
        """rho int r. ds changes by the impulse of reactions, weight and mass; over all weight times the window."""
        r, rho = self.r, self.given.rho
        weight = rho * self.given.gravity * r.fields.s[-1]
        force = r.reaction_left + r.reaction_right + r.contact + weight * DOWN
        kept = rho * self._along(lambda x: x.velocity) - self._impulse_of(force)
        return self._over_windows(kept, (weight + self.given.weight) * self.lasts)

    @_law("resolution")
    def moment_of_momentum(self) -> Defect:
        """rho int r x r. ds about the left support changes by the moments' impulse; over all weight, span, window."""
        r, given, t = self.r, self.given, self.t
        weight = given.rho * given.gravity
        spin = given.rho * self._along(lambda x: _cross(x.place, x.velocity))
        lever = weight * self._along(lambda x: x.place[:, 0])
        right = np.array([given.span, given.drop])
        moment = _cross(right, r.reaction_right) + _cross(np.stack([r.x, r.y], axis=1), r.contact)
        own = CubicSpline(t, lever).antiderivative()(t) if t.size > 3 else cumulative_trapezoid(lever, t, initial=0.0)
        kept = (spin - own)[:, None] - self._impulse_of(moment[:, None])
        return self._over_windows(kept, (weight * r.fields.s[-1] + given.weight) * given.span * self.lasts)

    # --- energy; all over weight times largest deflection ---------------------------------------------------
    @cached_property
    def _energies(self) -> Array:
        """Kinetic energy, that of weight and that of strain at the frames (k, 3) [J], W = (N^2 - T^2)/(2 EA)."""
        r, given = self.r, self.given

        def density(x: _Side) -> Array:
            kinetic = 0.5 * given.rho * np.sum(x.velocity**2, axis=1)
            strain = (x.T**2 - x.T_static**2) / (2.0 * given.EA)
            return np.stack([kinetic, -given.rho * given.gravity * x.place[:, 1], strain], axis=1)

        of_mass = [0.5 * given.mass * np.sum(r.velocity**2, axis=1), -given.weight * r.y, np.zeros(r.t.size)]
        return self._at_frames(np.stack(of_mass, axis=1)) + self._along(density)

    @property
    def _work(self) -> float:
        return self.given.weight * self.r.max_deflection

    @_law("resolution")
    def energy(self) -> Defect:
        """Energy of cable and mass changes by the work of the drive."""
        kept = self._energies.sum(axis=1)[:, None] - self._impulse_of(self._power_of_all[:, None])
        return self._over_windows(kept, self._work)

    @_law("resolution", lambda m: bool(np.isfinite(m.r.kinetic).any()))
    def parts_of_the_energy(self) -> Defect:
        """Energies change as the run says, and their sum is that of all."""
        r = self.r
        told = np.stack([r.kinetic, r.potential, r.strain, r.energy], axis=1)
        own = np.concatenate([self._energies, self._at_frames(np.sum(told[:, :3], axis=1)[:, None])], axis=1)
        return self._over_windows(self._at_frames(told) - own, self._work)

    @_law("resolution")
    def power(self) -> Defect:
        """Work of drive and outside forces is what the run says, each and all."""
        r, own = self.r, self._powers
        apart = [r.power - self._power_of_all, *(r.powers[name] - own[name] for name in own if name in r.powers)]
        return self._over_windows(self._impulse_of(np.stack(apart, axis=1)), self._work)

    @property
    def _power_of_all(self) -> Array:
        return np.sum(list(self._powers.values()), axis=0)

    @cached_property
    def _powers(self) -> dict[str, Array]:
        """What drive and outside forces put in, by name (n,) [W].

        That of a grip is ds_o (-contact . <r'> + <N t> . [r'] - [W]).  Rolling friction and brakes take their force
        times |ds_o| times the mean stretch; what holds a car at its start is then the difference of tensions there.
        """
        r, drive = self.r, self.given.drive
        mean, jump = 0.5 * (r.slope_behind + r.slope_ahead), r.slope_ahead - r.slope_behind
        if r.drive == "grip":
            work = -np.sum(r.contact * mean, axis=1)
            for sign, T, slope in self._both():
                work += 0.5 * T / np.hypot(*slope.T) * np.sum(slope * jump, axis=1)
                work -= sign * T**2 / (2.0 * self.given.EA)  # that at rest is the same on both sides
            return {"grip": self.pace * work}
        stretch = 0.5 * (np.hypot(*r.slope_behind.T) + np.hypot(*r.slope_ahead.T))
        along = np.sum(mean * r.velocity, axis=1) / np.hypot(*mean.T)
        friction, brakes = (-rub * stretch * np.abs(self.pace) for rub in self._rub)
        x = np.minimum(r.t / drive["release"], 1.0) if drive.get("release") else np.ones(r.t.size)
        return {
            "thrust" if r.drive == "free" else "haul": self._pull * along, "friction": friction, "brake": brakes,
            "drag": np.sum(self._drag * r.velocity, axis=1),
            "hold": (r.T_ahead - r.T_behind)[0] * stretch * (1.0 - x) ** 2 * (1.0 + 2.0 * x) * self.pace,
        }  # fmt: skip


def _static(*values: float) -> Defect:
    return Defect(np.array([math.nan]), np.array([values]).reshape(1, -1))


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _arcs(curve: CubicSpline, s: Array) -> Array:
    """Return the lengths of curves (x, y, ...) between nodes, (curves, m - 1): three Gauss points each."""
    at, weights = np.polynomial.legendre.leggauss(3)
    h = 0.5 * np.diff(s)
    slope = curve(s[:-1, None] + h[:, None] * (1.0 + at), 1)
    return h * (np.hypot(slope[..., ::2], slope[..., 1::2]).transpose(2, 0, 1) @ weights)


def _lengths(s: Array, *places: Array) -> Array:
    """Return the lengths of curves between their nodes, (curves, m - 1): cubic splines', or chords' where few."""
    if s.size < 4:
        return np.array([np.hypot(*np.diff(place, axis=0).T) for place in places])
    return _arcs(CubicSpline(s, np.concatenate(places, axis=1)), s)
