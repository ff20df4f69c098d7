"""The quasi-static run as a Response: the cable at rest under the car.

The car follows the travel; a free car the ride of `cablefem.scene.ride`.

What the model leaves out, the inertia of the rope, gives its error bars. With beta = V/c, c = sqrt(H/rho), a load that
travels along a string deflects it by 1/(1 - beta^2) of what it does at rest: relative errors are about beta^2. A car
that grips enters with its speed, and its weight comes at once: there they are about beta.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cablefem.response import Array, Observation, Response
from cablefem.scene import Groups, Scene
from cablefem.scene.statics import Rest, gripped_rest, hauled_rest, load_path_positions
from validation.core.sampling import (
    OBSERVED,
    STATIONS,
    computed_when_looked_at,
    observation_in_si,
    scene_and_path_in_si,
    times_of_frames,
)
from validation.core.scene_data import DOWN

STEPS = 1001
NEAREST = 1e-6  # s_o/l from a support below which the path of a gripped car needs no statics


class CarKinematics(NamedTuple):
    """Times of steps, s_o and its first two derivatives (n,), dimensionless."""

    t: Array
    s_o: Array
    ds: Array
    dds: Array


def quasi_static(scene: Scene) -> Response:
    """The quasi-static ride; SceneError if its cable at rest is not found.

    quasi_static("zipline").events
    """
    if scene.mass is None:
        raise ValueError(f"scene {scene.name!r} has no car")
    begin = time.perf_counter()
    travel = _car_kinematics(scene)
    statics = Statics(scene.groups, None if scene.ride is None else scene.ride.path.rest)
    work = dict.fromkeys(("rejected", "newton_iterations", "factorisations", "residuals"), 0)
    observe = partial(_observed_fields, scene, statics, travel)
    later = computed_when_looked_at(observe, [name for name in OBSERVED if name != "events"])
    return Response(
        **scene_and_path_in_si(scene, travel.t, travel.s_o, statics.displacement_of_car(travel.s_o)),
        method="quasi-static", model="quasi-static", load="mass", law="elastic", settings={}, reason=None,
        slack_onset=None, slack_at=None, switched=None, events=free_ride_events(scene), n_dof=0,
        work={"steps": travel.t.size - 1, **work}, later=later, seconds=time.perf_counter() - begin,
    )  # fmt: skip


def _observed_fields(scene: Scene, statics: Statics, travel: CarKinematics) -> dict[str, Any]:
    """The fields of a `Response` that are OBSERVED."""
    s = np.linspace(0.0, 1.0, STATIONS)
    n = travel.t.size
    frames = times_of_frames(scene, float(travel.t[-1]))
    at_frames = [np.interp(frames, travel.t, x) for x in travel]
    steps_and_frames = CarKinematics(*map(np.append, travel, at_frames))
    observed = _observe_steps_and_frames(scene.groups, statics, steps_and_frames, n, s)
    return observation_in_si(scene, observed, np.arange(n + frames.size) < n, s)


def _observe_steps_and_frames(
    groups: Groups, statics: Statics, travel: CarKinematics, steps: int, s: Array
) -> Observation:
    """All that is known of the first rows of a travel, its steps, and of the frames after them; s : stations (m,)."""
    t, s_o, ds, dds = travel
    here = statics(s_o)
    velocity = here.along * ds[:, None]
    acceleration = here.along * dds[:, None] + here.bend * (ds**2)[:, None]
    haul = np.full(t.size, np.nan)
    if groups.drive.mode == "haul":
        haul = _haul_force(groups, here, velocity, acceleration)
    kinetic = 0.5 * groups.mu * (velocity**2).sum(1)
    energy = kinetic + statics.potential_energy(s_o)
    power = np.full(t.size, np.nan)
    power[:steps] = np.gradient(energy[:steps], t[:steps])
    tension_min, tension_min_at = _min_tension_and_position(here, groups.sigma)
    return Observation(
        t=t, s_o=s_o, path=statics.displacement_of_car(s_o), path_velocity=velocity, path_acceleration=acceleration,
        slope_behind=here.slope_behind, slope_ahead=here.slope_ahead, T_behind=np.where(s_o > 0.0, here.behind, np.nan),
        T_ahead=np.where(s_o < 1.0, here.ahead, np.nan), tension_min=tension_min, tension_min_at=tension_min_at,
        contact=-here.jump, reaction_left=-here.left_force,
        reaction_right=here.left_force - groups.sigma * DOWN + here.jump, haul=haul, kinetic=kinetic, energy=energy,
        power=power, **_fields_at_frames(statics, groups, s, s_o[steps:], ds[steps:]),
    )  # fmt: skip


def _haul_force(groups: Groups, r: Rest, velocity: Array, acceleration: Array) -> Array:
    """Haul force (n,): holding force, drag and inertia along the mean tangent; velocity and acceleration : (n, 2).

    The contact force they add changes only friction.
    """
    tau = _unit_mean_tangent(r)
    size = np.linalg.norm(r.slope_behind + r.slope_ahead, axis=1)
    air = velocity - [groups.drive.wind, 0.0]  # velocity relative to the air (n, 2)
    air_speed = np.linalg.norm(air, axis=1)[:, None]
    drag = -groups.drive.k * air_speed * air
    more = groups.mu * acceleration - drag
    weight = groups.mu * groups.sigma * tau[:, 0]  # across the tangent (n,)
    contact = weight + more[:, 0] * tau[:, 1] - more[:, 1] * tau[:, 0]
    added = np.abs(contact) - np.abs(weight)
    friction = groups.drive.mu_r * added * size / (2.0 * r.mean_stretch_at_car)
    return r.haul + (more * tau).sum(1) + friction


def _unit_mean_tangent(r: Rest) -> Array:
    """Of both sides of the car (n, 2)."""
    mean = r.slope_behind + r.slope_ahead
    return mean / np.linalg.norm(mean, axis=1)[:, None]


def _car_kinematics(scene: Scene) -> CarKinematics:
    motion = scene.groups.motion
    if motion is None:
        return _free_ride_kinematics(scene)
    t = np.linspace(0.0, motion.end_time, STEPS)
    phase = np.searchsorted([end for _, end in motion.phases[:-1]], t)
    return CarKinematics(t, *motion.positions_with_rates(t, phase))


def _free_ride_kinematics(scene: Scene) -> CarKinematics:
    """With the instants of events, at which forces jump."""
    ride = scene.ride
    assert ride is not None
    t = np.linspace(0.0, ride.duration or scene.groups.drive.nominal, STEPS)
    same = 1e-9  # of the duration: closer instants count as one
    instants = [event.t for event in ride.events if np.abs(t - event.t).min() > same * t[-1]]
    t = np.sort(np.append(t, instants))
    s_o = np.full(t.size, scene.groups.drive.start)
    ds = np.zeros(t.size)
    if ride.sections:
        s_o, ds = ride.position_and_speed(t)
    return CarKinematics(t, s_o, ds, np.gradient(ds, t))


class Statics:
    """The cable at rest over s_o, interpolated between `nodes`; dimensionless.

    rest : at these nodes, if it is known.
    """

    def __init__(self, groups: Groups, rest: Rest | None = None) -> None:
        from scipy.interpolate import CubicSpline  # slow to import

        self._groups = groups
        at_rest = hauled_rest if groups.drive.mode == "haul" else gripped_rest
        nearest = NEAREST if groups.drive.mode == "grip" else None
        r = rest or at_rest(load_path_positions(groups.sigma, nearest), groups)
        self._names = [name for name in Rest.__dataclass_fields__ if name != "s"]
        fields = [getattr(r, name).reshape(r.s.size, -1) for name in self._names]
        self._ends = np.cumsum([columns.shape[1] for columns in fields])  # of the columns of each field
        force = r.hold + r.haul * (_unit_mean_tangent(r) * r.along).sum(1)  # that drives the car along s_o (n,)
        self._spline = CubicSpline(r.s, np.column_stack([*fields, force]))  # one for all: many take twice the time
        self._range = float(r.s[0]), float(r.s[-1])

    def potential_energy(self, s_o: Array) -> Array:
        """Work (n,) of the force that drives the car, from the first node."""
        return self._spline.antiderivative()(s_o)[:, -1]

    def displacement_of_car(self, s_o: Array) -> Array:
        """Displacement of the car (n, 2); none next to a support."""
        hanging = np.stack(self._groups.coordinates(s_o), -1)  # points of the empty cable
        off_supports = (s_o > NEAREST) & (s_o < 1.0 - NEAREST)
        return np.where(off_supports[:, None], self(s_o).car_point - hanging, 0.0)

    def tension_at_stations(self, s: Array, s_o: Array) -> Array:
        """T at stations s (m,) with the car at s_o (k,): (k, m), behind at s = s_o."""
        r = self(s_o)
        ahead = (s > s_o[:, None])[..., None]  # (k, m, 1)
        horizontal, vertical = np.moveaxis(r.left_force[:, None] + ahead * r.jump[:, None], 2, 0)  # (k, m) each
        return np.hypot(horizontal, vertical - self._groups.sigma * s)

    def __call__(self, s: Array) -> Rest:
        """The cable at rest with the car at s (n,)."""
        values = self._spline(np.clip(s, *self._range))
        *fields, _ = np.split(values, self._ends, axis=1)
        vectors_and_scalars = [columns if columns.shape[1] > 1 else columns[:, 0] for columns in fields]
        return Rest(s=np.asarray(s, float), **dict(zip(self._names, vectors_and_scalars, strict=True)))


def _min_tension_and_position(r: Rest, sigma: float) -> tuple[Array, Array]:
    """Smallest tension along the cable and its s, (n,) each: where the force is level, or at an end of a side."""
    force = np.stack([r.left_force, r.left_force + r.jump])  # at s = 0 of both sides (2, n, 2)
    horizontal = force[..., 0]
    vertical = force[..., 1]
    begins = [0.0 * r.s, r.s]
    ends = [r.s, np.ones_like(r.s)]
    s_behind, s_ahead = s = np.clip(vertical / sigma, begins, ends)
    behind, ahead = np.hypot(horizontal, vertical - sigma * s)
    return np.minimum(behind, ahead), np.where(behind <= ahead, s_behind, s_ahead)


def _fields_at_frames(statics: Statics, groups: Groups, s: Array, s_o: Array, ds: Array) -> dict[str, Any]:
    """Displacement, velocity and tension at frames, (k, m) each."""
    hanging = np.stack(groups.coordinates(s), -1)

    def displacement(s_o: Array) -> Array:
        return _station_points(statics(s_o), groups, s) - hanging  # (k, m, 2)

    step = 1e-5
    change = (displacement(s_o + step) - displacement(s_o - step)) / (2.0 * step)  # with s_o
    fields = {"T": statics.tension_at_stations(s, s_o)}
    fields["u"], fields["v"] = np.moveaxis(displacement(s_o), 2, 0)
    fields["du"], fields["dv"] = np.moveaxis(change * ds[:, None, None], 2, 0)
    return fields


def _station_points(r: Rest, groups: Groups, s: Array) -> Array:
    """Points (k, m, 2) of stations s: the integral of r' over pieces that are cut at the car."""
    x, w = np.polynomial.legendre.leggauss(4)  # points between two stations
    stations = np.broadcast_to(s, (r.s.size, s.size))
    ends = np.concatenate([stations, r.s[:, None]], axis=1)
    ends.sort(axis=1)
    half = 0.5 * np.diff(ends)[..., None]  # (k, m, 1)
    p = ends[:, :-1, None] + half * (1.0 + x)  # Gauss points (k, m, POINTS)
    ahead = ends[:, 1:] > r.s[:, None]  # (k, m)
    force = r.left_force[:, None] + ahead[..., None] * r.jump[:, None]  # at s = 0 of each side (k, m, 2)
    horizontal = force[..., :1]  # (k, m, 1)
    vertical = force[..., 1:] - groups.sigma * p  # (k, m, POINTS)
    stretch = 1.0 - groups.static_tension(p) / groups.alpha  # of the empty cable
    tension = np.sqrt(horizontal**2 + vertical**2)
    weights = half * w * (stretch / tension + 1.0 / groups.alpha)  # (k, m, POINTS)
    dx = horizontal[..., 0] * weights.sum(axis=2)  # of each piece (k, m)
    dy = (weights * vertical).sum(axis=2)
    start = np.zeros((r.s.size, 1, 2))
    pieces = np.stack([dx, dy], axis=2)  # (k, m, 2)
    points = np.concatenate([start, np.cumsum(pieces, axis=1)], axis=1)
    index = np.arange(s.size) + (s > r.s[:, None])
    return np.take_along_axis(points, index[..., None], axis=1)


# --- error bars ----------------------------------------------------------------------------------------------------


class InertiaErrors(NamedTuple):
    """Errors of a model without the inertia of the rope."""

    deflection: float  # [m] largest
    error: float  # relative, of deflections and forces
    energy: float  # of the car, over its mass [m^2/s^2]
    late: float  # relative, of times

    @classmethod
    def estimated(cls, scene: Scene, top_speed: float, deflection: float) -> InertiaErrors:
        """Bars by beta, the speed over that of waves, each at least 1.2 times the worst of random scenes."""
        beta = top_speed / scene.wave_speed
        sag = scene.gravity * max(0.0, deflection)
        # from full runs of 22 random scenes the distance was at most 1.3 beta and 2 beta^2
        error = 2.0 * beta if scene.drive.mode == "grip" else 2.5 * beta**2
        energy = 0.5 * sag * beta**2  # at most 0.19 on 14 random rides
        late = sag / scene.wave_speed**2  # at most 0.43 of it
        return cls(max(0.0, deflection), error, energy, late)

    def speed_loss(self, speed: float) -> float:
        """How much slower [m/s] a car is at a speed [m/s] if it lacks the energy."""
        return speed - math.sqrt(max(0.0, speed**2 - 2.0 * self.energy))

    def error_bars_of_event(self, event: dict[str, Any], t: Array, s_o: Array, speed: Array) -> dict[str, float]:
        """Bars of an event in time [s], position [m] and speed [m/s]; t, s_o, speed : of the ride (n,).

        A car stops as much earlier as it takes to lose the energy.
        """
        name = event["event"]
        late = self.late * event["t"]
        bars = {"bar_t": late, "bar_s_o": 0.0, "bar_speed": self.speed_loss(event["speed"])}
        if name in ("release", "thrust_end"):  # its time is prescribed
            bars["bar_t"] = 0.0
            bars["bar_s_o"] = late * event["speed"]
        elif name in ("stop", "turn"):
            fast = np.flatnonzero((t < event["t"]) & (0.5 * speed**2 > self.energy))
            k = int(fast[-1]) if fast.size else 0
            bars["bar_t"] += event["t"] - float(t[k])
            bars["bar_s_o"] = abs(event["s_o"] - float(s_o[k]))
        return bars

    def error_bar_of_number(self, row: dict[str, Any], scene: Scene, tension_max: float) -> float | None:
        """Bar of a design number, in its unit; its own if it has one; None without a value."""
        assert scene.mass is not None
        quantity = row["quantity"]
        value = row["value"]
        weight = scene.mass.mass * scene.gravity
        if value is None or row["bar"] is not None:
            return row["bar"]
        if quantity == "speed_max":
            slope = 4.0 * self.deflection / scene.length
            of_travel = value * self.error * (self.error + slope)
            return self.speed_loss(value) if scene.drive.mode == "free" else of_travel
        if quantity.startswith("contact"):  # the path is the more curved the heavier the car
            return self.error * weight * (1.0 + 2.0 * scene.mu)
        if quantity.startswith("haul_force"):
            return self.error * weight
        scales = {"m": self.deflection, "N": tension_max}
        return self.error * scales.get(row["unit"], abs(value))


def with_inertia_error_bars(scene: Scene, r: Response) -> Response:
    """The quasi-static response with bars of its design numbers and events."""
    inertia = InertiaErrors.estimated(scene, float(r.speed.max()), r.max_deflection)
    tensions = [row["value"] for row in r.design if row["quantity"] == "tension_max"]
    tension_max = max(tensions, default=0.0)
    design = [row | {"bar": inertia.error_bar_of_number(row, scene, tension_max)} for row in r.design]
    events = [event | inertia.error_bars_of_event(event, r.t, r.s_o, r.speed) for event in r.events]
    return replace(r, design=design, events=events)


def free_ride_events(scene: Scene) -> list[dict[str, Any]]:
    """Events of the quasi-static ride of a free car, in SI; none of another car."""
    l = scene.length
    time_scale = scene.time_scale
    rows: list[dict[str, Any]] = []
    for x in scene.ride.events if scene.ride is not None else ():
        speed = x.speed * l / time_scale
        rows.append({"event": x.event, "t": x.t * time_scale, "s_o": x.s_o * l, "speed": speed})
    return rows


def quasi_static_events_with_error_bars(scene: Scene, full_run_deflection: float) -> list[dict[str, Any]]:
    """Events of the quasi-static ride with bars; full_run_deflection : the largest [m] of a run of the full model."""
    ride = scene.ride
    if ride is None:
        return []
    t = np.linspace(0.0, ride.duration, STEPS)
    s_o = np.full(STEPS, scene.length * scene.groups.drive.start)  # [m]
    speed = np.zeros(STEPS)  # [m/s]
    if ride.sections:
        s_o = scene.length * ride.position_and_speed(t)[0]
        speed = scene.length / scene.time_scale * ride.point_speed(t)
    inertia = InertiaErrors.estimated(scene, float(speed.max()), full_run_deflection)
    return [
        event | inertia.error_bars_of_event(event, scene.time_scale * t, s_o, speed)
        for event in free_ride_events(scene)
    ]
