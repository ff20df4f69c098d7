"""The quasi-static ride as a Response: the cable at rest under the car.

The ride is the travel, for free cars that of `cablefem.scene.ride`.
"""

import time
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
# [l] nearer to a support, a gripped car's place needs no statics
NEAREST = 1e-6


def quasi_static(scene: Scene) -> Response:
    """The quasi-static ride; SceneError if its cable at rest is not found.

    quasi_static("zipline").events
    """
    if scene.mass is None:
        raise ValueError(f"scene {scene.name!r} has no car")
    begin = time.perf_counter()
    g, s = scene.groups, np.linspace(0.0, 1.0, STATIONS)
    travel = _travel(scene)
    n, frames = travel[0].size, frame_times(scene, float(travel[0][-1]))
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
    l, tau = scene.length, scene.time_scale
    events = [] if scene.ride is None else [
        {"event": e.event, "t": e.t * tau, "s_o": e.s_o * l, "speed": e.speed * l / tau} for e in scene.ride.events
    ]  # fmt: skip
    return Response(
        **in_si(scene, seen, np.arange(t.size) < n, s), method="quasi-static", settings={}, model="quasi-static",
        load="mass", law="elastic", reason=None, slack_onset=None, slack_at=None, switched=None, events=events,
        work={"steps": n - 1, "rejected": 0, "newton_iterations": 0, "factorisations": 0, "residuals": 0},
        n_dof=0, seconds=time.perf_counter() - begin,
    )  # fmt: skip


def _haul(g: Groups, r: Rest, velocity: Array, acceleration: Array) -> Array:
    """Haul force (n,): holding force, drag and inertia along the mean tangent.

    The contact force they add changes only friction.
    """
    tau, size = _mean_tangent(r), np.linalg.norm(r.slope_behind + r.slope_ahead, axis=1)
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
        s_o, ds = scene.ride.at(t) if scene.ride.sections else (np.full(ROWS, scene.groups.drive.start), np.zeros(ROWS))
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
