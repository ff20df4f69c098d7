"""Second computation of what a run prints: design numbers and the outcome, within bars.

It reads the TOML, the path and the stored fields, and imports nothing that writes them.
"""

import math
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq

from cablefem.response import Array, Response
from validation.core import timetable
from validation.core.agreement import Agreement, Bound, Part, nothing
from validation.core.evidence import ROUNDING, Evidence, Given, Windows, cross, integral
from validation.core.measures import JUMP_WIDTH, extremes_within, meant_until


def _row(r: Response, quantity: str, law: str, gap: float, allowed: float, where: float | None = None) -> Agreement:
    """Gap of a printed to a recomputed value, over its largest size; where : s_o/l."""
    return Agreement(
        quantity, gap, Bound("law", (Part(r.method, allowed, "printed bar and sampling"),)), where, law=law
    )


def rows(r: Response, twin: Response | None = None, told: tuple[str, str] | None = None) -> Iterator[Agreement]:
    """Check design numbers, errors of path and tension, and an outcome's kind and sentence."""
    yield from design(r, twin)
    if twin is not None:
        yield from errors(r, twin)
    if told is not None:
        yield ending(r, twin, *told)


def design(r: Response, twin: Response | None = None) -> Iterator[Agreement]:
    """Check design numbers against a second computation, in the range of both runs."""
    readings = Readings(r, twin)
    for row in r.design:
        quantity = row["quantity"]
        where = None if row["s_o"] is None else row["s_o"] / r.length
        for name, bar, law in (("value", "bar", ""), ("peak", "bar_peak", " peak")):
            if law and row.get(name) is None:
                continue
            if not readings.knows(quantity):
                yield Agreement("design", math.nan, nothing("printed without a second computation"), law=quantity)
                continue
            right = readings.of(quantity, raw=bool(law))
            if row[name] is None or right is None:
                gap = 0.0 if row[name] is right else 1.0
                allowed = ROUNDING
            else:
                size = abs(right) or 1.0
                gap = abs(row[name] - right) / size
                allowed = (row[bar] or 0.0) / size + ROUNDING
            yield _row(r, "design", quantity + law, gap, allowed, where)


Signals = list[tuple[Array, Array]]  # times (n,), values (n,) or (n, m)


class Readings:
    """Second computations of design numbers from stored fields, path and TOML."""

    def __init__(self, r: Response, twin: Response | None) -> None:
        self.r = r
        self.given = Given(r.scene_toml, r.length)
        self.signals = _signals(r)
        self.span = extremes_within(r, twin)
        self.taut = float(r.t[0]), meant_until(r, twin or r)
        self.rooms = Surroundings(r)

    def knows(self, quantity: str) -> bool:
        kind, _, name = quantity.partition(":")
        extreme = kind.removesuffix("_max").removesuffix("_min")
        if kind in ("clearance_rope_min", "clearance_car_min"):
            return name in self.rooms.profiles
        return kind in ("safety_factor_min", "slack_onset") or kind in self.signals or extreme in self.signals

    def of(self, quantity: str, raw: bool = False) -> float | None:
        """A number in SI, or None where there is none; raw: without means over an axial round trip."""
        kind, _, name = quantity.partition(":")
        if kind == "slack_onset":
            slack = np.flatnonzero(self.r.tension_min[1:] < 0.0)
            return float(self.r.s_o[1:][slack[0]] / self.r.length) if slack.size else None
        if kind.startswith("clearance_"):
            return self.rooms.smallest(kind == "clearance_car_min", name, self.taut)
        if kind == "safety_factor_min":
            tension = self.of("tension_max")
            return None if tension is None else self.given.cable["breaking_load"] / tension
        signals = self.signals.get(kind) or self.signals[kind.removesuffix("_max").removesuffix("_min")]
        means = 0.0 if raw or not kind.startswith(FORCES) else self.given.round_trip
        found = np.concatenate([_means(t, v, self.span, means).ravel() for t, v in signals if t.size])
        if not found.size:
            return None
        return float(found.min() if kind.endswith("_min") else found.max())


FORCES = ("tension", "reaction", "contact", "haul_force", "angle")  # felt as means over an axial round trip


class Surroundings:
    """Obstacles and ground of the TOML, and the heights of rope and car over them."""

    def __init__(self, r: Response) -> None:
        scene = tomllib.loads(r.scene_toml)
        # points (n, 2): x and depth [m]
        self.profiles = {o["name"]: np.array([[o["at"], o["top"]]], float) for o in scene.get("obstacle", [])}
        if scene.get("ground"):
            self.profiles["the ground"] = np.array(scene["ground"], float)
        self.r = r
        self.below = scene["mass"].get("below", 0.0)

    def smallest(self, car: bool, name: str, span: tuple[float, float]) -> float | None:
        """Smallest height [m] over an obstacle or the ground between two times; None: never above it."""
        profile = self.profiles[name]
        heights = [self._under_car(profile, span)] + ([] if car else [self._under_rope(profile, span)])
        found = np.concatenate(heights) - (self.below if car else 0.0)
        return float(found.min()) if found.size else None

    def _under_car(self, profile: Array, span: tuple[float, float]) -> Array:
        """Heights of the rope at the car: at steps above the profile, and where it passes a point of it."""
        r = self.r
        over = (r.x > profile[0, 0]) & (r.x < profile[-1, 0]) & (r.t >= span[0]) & (r.t <= span[1])
        at_steps = np.interp(r.x[over], profile[:, 0], profile[:, 1]) - r.y[over]
        passes = []
        for x, depth in profile:
            ahead = r.x >= x
            i = np.flatnonzero(ahead[1:] != ahead[:-1])
            part = (x - r.x[i]) / np.diff(r.x)[i]
            t, y = ((1.0 - part) * of[i] + part * of[i + 1] for of in (r.t, r.y))
            passes.append((depth - y)[(t >= span[0]) & (t <= span[1])])
        return np.concatenate([at_steps, *passes])

    def _under_rope(self, profile: Array, span: tuple[float, float]) -> Array:
        """Heights of the rope at frames: at its stations, at the car, and above the profile's points."""
        f = self.r.fields
        frames = np.flatnonzero((f.t >= span[0]) & (f.t <= span[1]))
        heights = [np.empty(0)]
        for k in frames:
            x = np.append(f.x + f.u[k], np.interp(f.s_o[k], f.s, f.x) + f.mass_u[k])
            y = np.append(f.y + f.v[k], np.interp(f.s_o[k], f.s, f.y) + f.mass_v[k])
            order = np.argsort(x)
            above = (x >= profile[0, 0]) & (x <= profile[-1, 0])
            heights.append(np.interp(x[above], profile[:, 0], profile[:, 1]) - y[above])
            reached = (profile[:, 0] >= x.min()) & (profile[:, 0] <= x.max())
            heights.append(profile[reached, 1] - np.interp(profile[reached, 0], x[order], y[order]))
        return np.concatenate(heights)


def _signals(r: Response) -> dict[str, Signals]:
    f = r.fields
    given = Given(r.scene_toml, r.length)
    tilt = math.degrees(math.atan(given.blown(2) / (given.rho * given.gravity)))
    known: dict[str, Signals] = {
        "wind_tilt": [(r.t, np.full(r.t.shape, tilt))],
        "tension": [(r.t, r.T_behind), (r.t, r.T_ahead), (f.t, f.T)],
    }
    for side, force in (("left", r.reaction_left), ("right", r.reaction_right)):
        horizontal, vertical = np.abs(force.T)
        size = np.sqrt(horizontal**2 + vertical**2)
        parts = {"": size, "_horizontal": horizontal, "_vertical": vertical}
        known |= {f"reaction_{side}{part}": [(r.t, x)] for part, x in parts.items()}
        known["tension"].append((r.t, size))
        known[f"angle_{side}"] = [(r.t, np.degrees(np.arcsin(vertical / size)))]
    at_mass = {
        "contact": _press(r), "haul_force": np.abs(r.F_haul), "haul_force_min": r.F_haul, "mass_deflection": r.v,
        "speed": np.sqrt(np.sum(r.velocity**2, axis=1)),
    }  # fmt: skip
    known |= {name: [(r.t, x)] for name, x in at_mass.items()}
    deep: Signals = [(r.t, r.y), (f.t, f.y + f.v)]
    return known | {"mass_deepest": deep[:1], "deepest_point": deep}


def _press(r: Response) -> Array:
    """Force of the mass on the cable across the mean tangent (n,), positive down."""
    tangent = r.slope_behind + r.slope_ahead
    return cross(tangent, r.contact) / np.sqrt(np.sum(tangent**2, axis=1))


def _means(t: Array, v: Array, span: tuple[float, float], period: float) -> Array:
    known = np.isfinite(v.reshape(t.size, -1)).all(axis=1)
    t = t[known]
    v = v[known]
    rows = (t >= span[0] * (1.0 - ROUNDING)) & (t <= span[1] * (1.0 + ROUNDING))
    if v.ndim == 2:
        return _means_of_frames(t[rows], v[rows], period)
    if rows.any():  # up to the ends of the range
        signal = make_interp_spline(t, v, k=1)
        ends = np.clip(span, t[0], t[-1])
        t = np.unique(np.concatenate([ends, t[rows & (t > ends[0]) & (t < ends[1])]]))
        v = signal(t)
    else:
        t = t[rows]
        v = v[rows]
    if not period or t.size < 3:
        return v
    total = make_interp_spline(t, v, k=1).antiderivative()
    low = np.clip(t - 0.5 * period, t[0], t[-1])
    high = np.clip(t + 0.5 * period, t[0], t[-1])
    return np.asarray((total(high) - total(low)) / (high - low))


def _means_of_frames(t: Array, v: Array, period: float) -> Array:
    """Means over frames within a period, at least one on either side."""
    if not period or t.size < 3:
        return v
    k = np.arange(t.size)
    near = (np.abs(t[:, None] - t) <= 0.5 * period) | (np.abs(k[:, None] - k) <= 1)
    return np.asarray(near @ v / near.sum(axis=1)[:, None])


# --- errors of path and tension -----------------------------------------------------------------------------------


def errors(r: Response, twin: Response) -> Iterator[Agreement]:
    """Check that path_error and tension_error are at least the distance to the other solver."""
    if r.error_window is None or twin.error_window is None or r.path_error is None:
        return
    window = max(r.error_window[0], twin.error_window[0]), min(r.error_window[1], twin.error_window[1])
    distances = [_path_distance(r, twin, window, k) for k in (3, 5)]
    allowed = abs(distances[1] - distances[0]) + ROUNDING
    yield _row(r, "design", "path_error", max(0.0, distances[0] - r.path_error), allowed)
    if r.tension_error is not None:
        missing = max(0.0, _tension_distance(r, twin, window) - r.tension_error)
        yield _row(r, "design", "tension_error", missing, ROUNDING)


def _path_distance(r: Response, twin: Response, window: tuple[float, float], k: int) -> float:
    """Largest distance of the car in two runs, at the steps of the coarser one, over the scale of the path."""
    coarse, fine = sorted((r, twin), key=lambda x: x.t.size)
    place = coarse.s_o / coarse.length
    rows = (place >= window[0]) & (place <= window[1] * (1.0 + ROUNDING)) & (coarse.t <= fine.t[-1])
    names = ("x", "y") if r.drive == "free" else ("u", "v")
    apart = [
        getattr(coarse, name)[rows] - make_interp_spline(fine.t, getattr(fine, name), k=k)(coarse.t[rows])
        for name in names
    ]
    scale = max(0.1 * x.length if x.drive == "free" else x.max_deflection for x in (r, twin))
    return float(np.sqrt(apart[0] ** 2 + apart[1] ** 2).max(initial=0.0)) / scale


def _tension_distance(r: Response, twin: Response, window: tuple[float, float]) -> float:
    """Rms distance of the tensions at common frames, off the car, over H."""
    a = r.fields
    b = twin.fields
    of_time = r.drive == "free"
    squares = []
    for k in range(a.t.size):
        marks, mark = (b.t, a.t[k]) if of_time else (b.s_o, a.s_o[k])
        j = int(np.argmin(np.abs(marks - mark)))
        place = a.s_o[k] / r.length
        same = abs(marks[j] - mark) <= ROUNDING * marks[-1]
        if same and window[0] - ROUNDING <= place <= window[1] + ROUNDING:
            off = np.abs(a.s / r.length - place) >= JUMP_WIDTH
            squares.append((a.T[k] - b.T[j])[off] ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares)))) / r.horizontal_tension if squares else 0.0


# --- the outcome --------------------------------------------------------------------------------------------------

DIGIT = 0.06  # half of the last printed digit, and what a search for a time leaves


@dataclass(slots=True)
class Ending:
    """What an outcome must say: its kind, its numbers in order, and its parts without numbers."""

    kind: str
    numbers: list[float]  # nan: unknown
    parts: list[str] = field(default_factory=list)

    def fits(self, kind: str, sentence: str) -> bool:
        told = sentence.split(": ", 2)[-1] if kind == "breaks" else sentence
        parts = [part for part in told.split("; ") if part.startswith(("would hit", "too close"))]
        printed = [float(x) for x in re.findall(r"-?\d+\.\d+", sentence)]
        if self.kind == "incomplete":  # the reason may hold numbers
            printed = printed[: len(self.numbers)]
        alike = len(printed) == len(self.numbers) and not any(
            abs(x - y) > DIGIT for x, y in zip(printed, self.numbers, strict=True)
        )
        return alike and kind == self.kind and parts == self.parts


def ending(r: Response, twin: Response | None, kind: str, sentence: str) -> Agreement:
    """Check an outcome against the last event, the TOML's brakes and travel, breaking load and clearances."""
    readings = Readings(r, twin)
    right = _end_of_ride(r, readings) if r.drive == "free" else _end_of_travel(r, readings)
    if r.status != "complete" and r.slack_onset is None:
        right = Ending("incomplete", [float(r.s_o[-1]), float(r.t[-1])])
    right.parts = _contacts(r, readings)
    _break(r, readings, right)
    return _row(r, "outcome", "", 0.0 if right.fits(kind, sentence) else 1.0, ROUNDING)


def _end_of_ride(r: Response, readings: Readings) -> Ending:
    """The end of a free ride, by its last event."""
    speed = np.sqrt(np.sum(r.velocity**2, axis=1))
    last = next((x for x in reversed(r.events) if x["event"] in ("arrival", "back", "stop")), None)
    if last is None:
        return Ending("rolling", [float(r.t[-1]), float(r.s_o[-1]), 3.6 * float(speed[-1])])
    t = last["t"]
    place = last["s_o"]
    if last["event"] == "arrival":
        return Ending("arrives", [place, t, 3.6 * float(np.interp(t, r.t, speed))])
    if last["event"] == "back":
        return Ending("rolls_back", [t])
    first = min((brake["from"] for brake in readings.given.drive.get("brake", [])), default=math.inf)
    if place >= first:
        return Ending("stopped_by_brake", [place, place - first, t])
    never = math.isfinite(first) and not any(x["event"] == "brake" for x in r.events)
    return Ending("stuck", [first - place, place, t] if never else [place, t])


def _end_of_travel(r: Response, readings: Readings) -> Ending:
    """The end of a prescribed travel, by the TOML."""
    law = readings.given.travel
    drive = readings.given.drive
    hauled = drive.get("mode") == "haul"
    start = timetable.begins(law, drive, r.length)
    end = drive.get("end", {}).get("place", 0.99 * r.length) if hauled else r.length
    lasts, last = _travelled(law, drive, r.length, start, end)
    onset = readings.of("slack_onset")
    slack = [] if onset is None else [onset * r.length]
    if last < 0.999 * end:
        return Ending("stopped", [last, lasts, *slack])
    return Ending("crossed", [*([start, last] if hauled else []), lasts, *slack])


def _travelled(law: dict[str, Any], drive: dict[str, Any], length: float, start: float, end: float) -> list[float]:
    """Duration [s] and end [m] of a travel; nan where a table does not say it."""
    if law["kind"] == "table":
        last = min(end, law["positions"][-1] + start)
        return [law["times"][-1] if last < end and "stop" not in law else math.nan, last]

    def place(t: float) -> float:
        return float(timetable.places(law, drive, length, np.array([t]))[0])

    late = 1.0
    while place(late) < end and place(2.0 * late) > place(late):
        late *= 2.0
    last = min(end, place(late))
    near = start + (1.0 - ROUNDING) * (last - start)  # a car comes to rest slowly
    lasts = float(brentq(lambda t: place(t) - near, 0.0, late))
    limit = drive.get("end", {}).get("time", math.inf) if drive.get("mode") == "haul" else math.inf
    return [lasts, last] if lasts <= limit else [limit, place(limit)]


def _bars(r: Response) -> dict[str, float]:
    """Printed bars of design numbers."""
    return {row["quantity"]: row["bar"] or 0.0 for row in r.design}


def _contacts(r: Response, readings: Readings) -> list[str]:
    """What is hit, and what is closer than its printed bar."""
    bars = _bars(r)
    hit = []
    near = []
    for name in readings.rooms.profiles:
        possible = []
        for kind in ("clearance_rope_min", "clearance_car_min"):
            value = readings.of(f"{kind}:{name}")
            if value is not None:
                bar = bars.get(f"{kind}:{name}", 0.0)
                possible.append((value - bar, value + bar))
        lowest, highest = (min((x[i] for x in possible), default=math.inf) for i in (0, 1))
        if highest < 0.0:
            hit.append(name)
        elif lowest < 0.0:
            near.append(name)
    parts = [f"would hit {' and '.join(hit)}"] if hit else []
    return parts + ([f"too close to tell whether it clears {' and '.join(near)}"] if near else [])


def _break(r: Response, readings: Readings, right: Ending) -> None:
    """Put a breaking rope into what an outcome must say."""
    bar = _bars(r).get("safety_factor_min")
    if bar is None:
        return
    factor = readings.of("safety_factor_min")
    load = readings.given.cable["breaking_load"]
    assert factor is not None
    if factor + bar < 1.0:
        right.kind = "breaks"
        right.numbers = [load / factor / 1e3, load / 1e3, *right.numbers]
    elif factor - bar < 1.0:
        right.parts = ["too close to tell whether the rope breaks", *right.parts]


# --- the quasi-static ride ----------------------------------------------------------------------------------------


def energy_of_ride(r: Response) -> Agreement:
    """Check the energy along a quasi-static ride against the work of the forces of the TOML.

    The car has kinetic energy, the rope has none. The gap is over the car's weight times the range of its depth.
    """
    m = Evidence(r, Windows(r.fields.t[::2], r.t))
    gap, coarse = (_unexplained(x) for x in (m, m.thinned()))
    allowed = 3.0 * float(np.abs(gap - coarse).max()) + STATICS
    k = int(np.abs(gap).argmax())
    return _row(
        r, "energy", "quasi-static", float(np.abs(gap[k])), allowed, float(r.fields.s_o[m.frames][k] / r.length)
    )


STATICS = 1e-5  # of the energy: interpolation of the cable at rest


def _unexplained(m: Evidence) -> Array:
    """Energy at frames (k,) beyond that at the start and the work since, over the scale."""
    r = m.r
    given = m.given
    car = 0.5 * given.mass * np.sum(r.velocity**2, axis=1) - given.weight * r.y
    energy = np.interp(m.t, r.t, car) + m.along["energies"][:, 1:].sum(axis=1)  # without the rope's motion
    speed = np.sqrt(np.sum(r.velocity**2, axis=1))[:, None]
    along = np.divide(r.velocity, speed, out=np.zeros_like(r.velocity), where=speed > 0.0)  # the path (n, 2)
    pressed = given.mass * (r.acceleration - [0.0, given.gravity]) - m.drag  # force of the rope on the car (n, 2)
    normal = np.abs(cross(along, pressed))
    stretch = 0.5 * (np.hypot(*r.slope_behind.T) + np.hypot(*r.slope_ahead.T))
    friction = -given.drive.get("rolling_friction", 0.0) * normal * stretch * np.abs(m.pace)
    powers = m.powers | {"friction": friction}
    if r.drive == "free":  # thrust acts along the path
        powers["thrust"] = m.pull * speed[:, 0] * np.sign(m.pace)
    power = np.sum([*powers.values()], axis=0)
    work = np.interp(m.t, r.t, integral(r.t, power[:, None], r.jumps)[:, 0])
    unexplained = energy - work
    return np.asarray((unexplained - unexplained[0]) / (given.weight * np.ptp(r.y)))
