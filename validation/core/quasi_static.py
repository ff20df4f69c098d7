"""The quasi-static ride as a Response: the cable at rest under the car.

The ride is the travel, for free cars that of `cablefem.scene.ride`.

What the model leaves out, the inertia of the rope, gives its error bars. With beta = V/c, c = sqrt(H/rho), a load that
travels along a string deflects it by 1/(1 - beta^2) of what it does at rest: relative errors are about beta^2. A car
that grips enters with its speed, and its weight comes at once: there they are about beta.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from cablefem.response import Array, Observation, Response
from cablefem.scene import Groups, Scene
from cablefem.scene.catenary import shape, static
from cablefem.scene.statics import Rest, gripped, hauled, nodes
from validation.core.sampling import STATIONS, frame_times, in_si

ROWS = 1001
POINTS = 4  # Gauss points between two stations
# Error bars over beta or beta^2. On 22 random scenes the distance from full runs was at most 1.3 and 2.0.
GRIPS = 2.0
ROLLS = 2.5
ENERGY = 0.5  # of the car, over g times beta^2 of the deflection; at most 0.19 on 14 random rides
TIME = 1.0  # over g rho/H times the deflection; at most 0.43
SAME = 1e-9  # of the duration: instants that are one
# [l] nearer to a support, a gripped car's place needs no statics
NEAREST = 1e-6


def quasi_static(scene: Scene) -> Response:
    """The quasi-static ride; SceneError if its cable at rest is not found.

    quasi_static("zipline").events
    """
    if scene.mass is None:
        raise ValueError(f"scene {scene.name!r} has no car")
    begin = time.perf_counter()
    g = scene.groups
    s = np.linspace(0.0, 1.0, STATIONS)
    travel = _travel(scene)
    n = travel[0].size
    frames = frame_times(scene, float(travel[0][-1]))
    # steps, then frames
    t, s_o, ds, dds = (np.append(x, np.interp(frames, travel[0], x)) for x in travel)
    at = Statics(g)
    here = at(s_o)
    moving = here.along * ds[:, None]
    down = np.array([0.0, 1.0])
    near = (s_o > NEAREST) & (s_o < 1.0 - NEAREST)
    path = np.where(near[:, None], here.place - np.stack(shape(s_o, g.sigma, g.c), -1), 0.0)
    acceleration = here.along * dds[:, None] + here.bend * (ds**2)[:, None]
    kinetic = 0.5 * g.mu * (moving**2).sum(1)
    energy = kinetic + at.energy(s_o)
    least, least_at = _least(here, g.sigma)
    seen = Observation(
        t=t, s_o=s_o, path=path, path_velocity=moving, path_acceleration=acceleration,
        slope_behind=here.slope_behind, slope_ahead=here.slope_ahead,
        T_behind=np.where(s_o > 0.0, here.behind, np.nan), T_ahead=np.where(s_o < 1.0, here.ahead, np.nan),
        energy=energy, power=np.append(np.gradient(energy[:n], t[:n]), np.full(frames.size, np.nan)), kinetic=kinetic,
        tension_min=least, tension_min_at=least_at, reaction_left=-here.left,
        reaction_right=here.left - g.sigma * down + here.jump, contact=-here.jump,
        haul=_haul(g, here, moving, acceleration) if g.drive.mode == "haul" else np.full(t.size, np.nan),
        **_fields(at, g, s, s_o[n:], ds[n:]),
    )  # fmt: skip
    return Response(
        **in_si(scene, seen, np.arange(t.size) < n, s), method="quasi-static", settings={}, model="quasi-static",
        load="mass", law="elastic", reason=None, slack_onset=None, slack_at=None, switched=None,
        events=events_of(scene),
        work={"steps": n - 1, "rejected": 0, "newton_iterations": 0, "factorisations": 0, "residuals": 0},
        n_dof=0, seconds=time.perf_counter() - begin,
    )  # fmt: skip


def _haul(g: Groups, r: Rest, velocity: Array, acceleration: Array) -> Array:
    """Haul force (n,): holding force, drag and inertia along the mean tangent.

    The contact force they add changes only friction.
    """
    tau = _mean_tangent(r)
    size = np.linalg.norm(r.slope_behind + r.slope_ahead, axis=1)
    wind = velocity - [g.drive.wind, 0.0]
    drag = -g.drive.k * np.linalg.norm(wind, axis=1)[:, None] * wind
    more = g.mu * acceleration - drag
    press = g.mu * g.sigma * tau[:, 0] + more[:, 0] * tau[:, 1] - more[:, 1] * tau[:, 0]
    rub = g.drive.mu_r * (np.abs(press) - g.mu * g.sigma * np.abs(tau[:, 0])) * size / (2.0 * r.stretch)
    return r.haul + (more * tau).sum(1) + rub


def _mean_tangent(r: Rest) -> Array:
    mean = r.slope_behind + r.slope_ahead
    return mean / np.linalg.norm(mean, axis=1)[:, None]


def _travel(scene: Scene) -> tuple[Array, Array, Array, Array]:
    motion = scene.groups.motion
    if motion is None:
        assert scene.ride is not None
        t = np.linspace(0.0, scene.ride.duration or scene.groups.drive.nominal, ROWS)
        happened = [e.t for e in scene.ride.events if np.abs(t - e.t).min() > SAME * t[-1]]
        t = np.sort(np.concatenate([t, happened]))  # forces jump there
        start = np.full(t.size, scene.groups.drive.start)
        s_o, ds = scene.ride.at(t) if scene.ride.sections else (start, 0.0 * t)
        return t, s_o, ds, np.gradient(ds, t)
    t = np.linspace(0.0, motion.phases[-1][1], ROWS)
    phase = np.searchsorted([t1 for _, t1 in motion.phases[:-1]], t)
    found = np.array([motion.at(float(x), int(k)) for x, k in zip(t, phase, strict=True)])
    return t, found[:, 0], found[:, 1], found[:, 2]


class Statics:
    """The cable at rest over s_o, interpolated between `nodes`; dimensionless."""

    def __init__(self, groups: Groups) -> None:
        self._sigma = groups.sigma
        places = nodes(NEAREST if groups.drive.mode == "grip" else None)
        r = (hauled if groups.drive.mode == "haul" else gripped)(places, groups)
        self._of = {name: CubicSpline(r.s, getattr(r, name)) for name in Rest.__dataclass_fields__ if name != "s"}
        self.energy = CubicSpline(r.s, r.hold + r.haul * (_mean_tangent(r) * r.along).sum(1)).antiderivative()
        self._range = float(r.s[0]), float(r.s[-1])

    def tension(self, s: Array, s_o: Array) -> Array:
        """T at stations s (m,) with the car at s_o (k,): (k, m), behind at s = s_o."""
        r = self(s_o)
        n = r.left[:, None] + (s > s_o[:, None])[..., None] * r.jump[:, None]
        return np.hypot(n[..., 0], n[..., 1] - self._sigma * s)

    def __call__(self, s: Array) -> Rest:
        at = np.clip(s, *self._range)
        return Rest(s=np.asarray(s, float), **{name: of(at) for name, of in self._of.items()})


def _least(r: Rest, sigma: float) -> tuple[Array, Array]:
    n = np.stack([r.left, r.left + r.jump])
    at = np.clip(n[..., 1] / sigma, [0.0 * r.s, r.s], [r.s, np.ones_like(r.s)])
    N = np.hypot(n[..., 0], n[..., 1] - sigma * at)
    return N.min(axis=0), np.where(N[0] <= N[1], at[0], at[1])


def _fields(at: Statics, g: Groups, s: Array, s_o: Array, ds: Array) -> dict[str, Any]:
    """Displacement, velocity and tension at frames, (k, m) each."""
    x, w = np.polynomial.legendre.leggauss(POINTS)
    X = np.stack(shape(s, g.sigma, g.c), -1)

    def cable(r: Rest) -> Array:
        """Places of the stations: the integral of r' over pieces cut at the car."""
        cuts = np.sort(np.concatenate([np.broadcast_to(s, (r.s.size, s.size)), r.s[:, None]], axis=1), axis=1)
        half = 0.5 * np.diff(cuts)[..., None]
        p = cuts[:, :-1, None] + half * (1.0 + x)
        ahead = p > r.s[:, None, None]
        n = r.left[:, None, None] + ahead[..., None] * r.jump[:, None, None]
        n[..., 1] -= g.sigma * p
        f = half * w * ((1.0 - static(p, g.sigma, g.c)[0] / g.alpha) / np.hypot(*n.T).T + 1.0 / g.alpha)
        steps = (f[..., None] * n).sum(axis=2)
        places = np.concatenate([np.zeros((r.s.size, 1, 2)), np.cumsum(steps, axis=1)], axis=1)
        index = np.arange(s.size) + (s > r.s[:, None])
        return np.take_along_axis(places, index[..., None], axis=1)

    step = 1e-5
    w, later, before = (cable(at(s_o + d)) - X for d in (0.0, step, -step))
    moves = (later - before) / (2.0 * step) * ds[:, None, None]
    return {"u": w[..., 0], "v": w[..., 1], "du": moves[..., 0], "dv": moves[..., 1], "T": at.tension(s, s_o)}


# --- error bars ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Inertia:
    """What the inertia of the rope, which the model leaves out, is worth."""

    deflection: float  # [m] largest
    error: float  # relative, of deflections and forces
    energy: float  # of the car, over its mass [m^2/s^2]
    late: float  # relative, of times

    @classmethod
    def of(cls, scene: Scene, top_speed: float, deflection: float) -> Inertia:
        beta = top_speed / scene.wave_speed
        sag = scene.gravity * max(0.0, deflection)
        error = GRIPS * beta if scene.drive.mode == "grip" else ROLLS * beta**2
        return cls(max(0.0, deflection), error, ENERGY * sag * beta**2, TIME * sag / scene.wave_speed**2)

    def slower(self, speed: float) -> float:
        """How much slower [m/s] a car is that lacks the energy."""
        return speed - math.sqrt(max(0.0, speed**2 - 2.0 * self.energy))

    def event_bars(self, event: dict[str, Any], t: Array, s_o: Array, speed: Array) -> dict[str, float]:
        """Bars of an event in time [s], place [m] and speed [m/s]; t, s_o, speed : of the ride (n,).

        A car stops as much earlier as it takes to lose the energy.
        """
        when = event["t"]
        name = event["event"]
        bars = {"bar_t": self.late * when, "bar_s_o": 0.0, "bar_speed": self.slower(event["speed"])}
        if name in ("release", "thrust_end"):  # at a time, not at a place
            return bars | {"bar_t": 0.0, "bar_s_o": self.late * when * event["speed"]}
        if name in ("stop", "turn"):
            fast = np.flatnonzero((t < when) & (0.5 * speed**2 > self.energy))
            k = int(fast[-1]) if fast.size else 0
            earlier = when - float(t[k])
            nearer = abs(event["s_o"] - float(s_o[k]))
            return bars | {"bar_t": bars["bar_t"] + earlier, "bar_s_o": nearer}
        return bars


def with_error_bars(scene: Scene, r: Response) -> Response:
    """The quasi-static response with bars of its design numbers and events."""
    assert scene.mass is not None
    inertia = Inertia.of(scene, float(r.speed.max()), r.max_deflection)
    error = inertia.error
    weight = scene.mass.mass * scene.gravity
    largest = max((row["value"] for row in r.design if row["quantity"] == "tension_max"), default=0.0)

    def bar(row: dict[str, Any]) -> float | None:
        quantity = row["quantity"]
        value = row["value"]
        if value is None or quantity == "wind_tilt":
            return row["bar"]
        if quantity == "speed_max":
            slope = 4.0 * inertia.deflection / scene.length
            return inertia.slower(value) if r.drive == "free" else value * error * (error + slope)
        if quantity.startswith("contact"):  # the path is the more curved the heavier the car
            return error * weight * (1.0 + 2.0 * scene.mu)
        if quantity.startswith("haul_force"):
            return error * weight
        return error * {"m": inertia.deflection, "N": largest}.get(row["unit"], abs(value))

    events = [event | inertia.event_bars(event, r.t, r.s_o, r.speed) for event in r.events]
    return replace(r, design=[row | {"bar": bar(row)} for row in r.design], events=events)


def events_of(scene: Scene) -> list[dict[str, Any]]:
    """Events of the quasi-static ride of a free car; none of another."""
    l = scene.length
    tau = scene.time_scale
    ride = scene.ride
    if ride is None:
        return []
    return [{"event": e.event, "t": e.t * tau, "s_o": e.s_o * l, "speed": e.speed * l / tau} for e in ride.events]


def events_beside(scene: Scene, deflection: float) -> list[dict[str, Any]]:
    """Events of the quasi-static ride with bars; deflection : largest, of a full run [m]."""
    if scene.ride is None:
        return []
    l = scene.length
    tau = scene.time_scale
    t = np.linspace(0.0, scene.ride.duration, ROWS)
    place, speed = (scene.ride.at(t)[0], scene.ride.speed(t)) if scene.ride.sections else (0.0 * t, 0.0 * t)
    inertia = Inertia.of(scene, float(speed.max()) * l / tau, deflection)
    return [x | inertia.event_bars(x, tau * t, l * place, speed * l / tau) for x in events_of(scene)]
