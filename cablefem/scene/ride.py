"""The quasi-static ride: the car on the curve of its positions at rest, its load path P(s).

Cable and car have the energy Pi(s). The car alone has inertia:

    mu |P'|^2 dds + mu P'.P'' ds^2 = -Pi'(s) + F_ext.P' + <lam> f.

F_ext: thrust and drag. f = -(mu_r N_c + F_b) sign(ds): friction and brake, N_c normal to P'. Dimensionless.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cablefem.scene.bisection import bisect_zero
from cablefem.scene.drive import Drive
from cablefem.scene.statics import NoRest, Rest, gripped_rest, load_path_positions

if TYPE_CHECKING:
    from cablefem.scene.scene import Groups

STICKS = 1e-13  # [H] smaller forces are rounding


def _value_and_slope(cubic: list[float], x: float) -> tuple[float, float]:
    c3, c2, c1, c0 = cubic
    return c0 + x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + 3.0 * x * c3)


class LoadPath:
    """Curve on which the car rolls: P, P', P'', holding force Pi', stretch <lam>.

    rest : what it is made of, if the cable is loaded.
    """

    rest: Rest | None = None

    def __init__(
        self,
        s: np.ndarray,
        points: np.ndarray,
        slope: np.ndarray,
        bend: np.ndarray,
        hold: np.ndarray,
        stretch: np.ndarray,
    ) -> None:
        from scipy.interpolate import CubicHermiteSpline, CubicSpline  # slow to import

        self.s = s
        self.points: Callable = CubicHermiteSpline(s, points, slope)
        slopes = CubicHermiteSpline(s, slope, bend)
        scalars = CubicSpline(s, np.stack([hold, stretch], -1))
        coefficients = np.concatenate([slopes.c, scalars.c], axis=2)  # (4, intervals, 4)
        self._cubics = coefficients.transpose(1, 2, 0).tolist()  # by interval: numbers are faster than small arrays
        self._nodes = s.tolist()

    def __call__(self, s: float) -> tuple[float, float, float, float, float, float]:
        """(P'_x, P'_y, P''_x, P''_y, Pi', <lam>) at s."""
        i = min(max(bisect.bisect_right(self._nodes, s) - 1, 0), len(self._nodes) - 2)
        x = s - self._nodes[i]
        (px, bx), (py, by), (hold, _), (stretch, _) = (_value_and_slope(cubic, x) for cubic in self._cubics[i])
        return px, py, bx, by, hold, stretch

    @classmethod
    def on_loaded_cable(cls, groups: Groups) -> LoadPath:
        """The elastic catenary of two pieces; groups: mu, alpha, sigma, c."""
        r = gripped_rest(load_path_positions(groups.sigma), groups)
        path = cls(r.s, r.car_point, r.along, r.bend, r.hold, r.mean_stretch_at_car)
        path.rest = r
        return path

    @classmethod
    def on_empty_cable(cls, groups: Groups) -> LoadPath:
        """The path along the empty cable's shape."""
        s = load_path_positions(groups.sigma)
        _, xp, yp, xpp, ypp = groups.tension_and_shape_derivatives(s)
        points = np.stack(groups.coordinates(s), -1)
        hold = -groups.mu * groups.sigma * yp
        return cls(s, points, np.stack([xp, yp], -1), np.stack([xpp, ypp], -1), hold, np.ones_like(s))

    @classmethod
    def on_chord(cls, groups: Groups) -> LoadPath:
        """The path along the straight chord."""
        s = load_path_positions(groups.sigma)
        slope = np.stack(groups.coordinates(1.0))
        slopes = np.tile(slope, (s.size, 1))
        hold = np.full_like(s, -groups.mu * groups.sigma * slope[1])
        stretch = np.full_like(s, math.hypot(*slope))
        return cls(s, s[:, None] * slope, slopes, np.zeros_like(slopes), hold, stretch)


@dataclass(frozen=True)
class Event:
    event: str  # "brake" | "turn" | "stop" | "arrival" | "back" | "thrust_end" | "release"
    t: float
    s_o: float
    speed: float  # |dp/dt|


@dataclass(frozen=True)
class Ride:
    """A quasi-static ride, dimensionless."""

    path: LoadPath
    events: tuple[Event, ...]
    sections: tuple[tuple[float, float, Callable[[Any], np.ndarray]], ...]  # t0, t1, (s_o, ds_o) at t

    @property
    def duration(self) -> float:
        """Time at the end of the ride."""
        return self.sections[-1][1] if self.sections else 0.0

    def position_and_speed(self, t: Any) -> tuple[np.ndarray, np.ndarray]:
        """(s_o, ds_o) at times t."""
        t = np.clip(np.asarray(t, dtype=float), 0.0, self.duration)
        begins = [t0 for t0, _, _ in self.sections]
        which = np.clip(np.searchsorted(begins, t, side="right") - 1, 0, None)
        out = np.empty((2, *t.shape))
        for k in np.unique(which):
            inside = which == k
            _, _, solution = self.sections[k]
            out[:, inside] = solution(t[inside])
        return out[0], out[1]

    def point_speed(self, t: Any) -> np.ndarray:
        """|P'| |ds_o| at times t."""
        s, v = self.position_and_speed(t)
        return np.abs(v) * np.linalg.norm(self.path.points(s, 1), axis=-1)

    @cached_property
    def top_speed(self) -> float:
        """Largest `point_speed`, sampled."""
        if not self.sections:
            return 0.0
        return float(np.max(self.point_speed(np.linspace(0.0, self.duration, 2001))))


class ForceBalance(NamedTuple):
    """Of a car at an instant."""

    free: float  # force without friction
    normal_load: float  # contact force normal to the path
    inertia: float  # mu |P'|^2
    stretch: float  # <lam>


class QuasiStaticForces:
    """Forces on a car on a load path."""

    def __init__(self, path: LoadPath, mu: float, sigma: float, drive: Drive) -> None:
        self.path = path
        self.mu = mu
        self.sigma = sigma
        self.drive = drive
        self.start_hold = path(drive.start)[4]
        self.brake_positions = [position for position, _ in drive.brakes]
        forces = [force for _, force in drive.brakes]
        self.brake_force = [0.0, *np.cumsum(forces).tolist()]  # by number of brakes reached

    def force_balance(self, t: float, s: float, v: float, phase: int) -> ForceBalance:
        """Forces on the car at s with the speed v = ds."""
        drive = self.drive
        mu = self.mu
        px, py, bx, by, hold, stretch = self.path(s)
        p2 = px * px + py * py
        p = math.sqrt(p2)
        # velocity in the air, and drag
        rx = px * v - drive.wind
        ry = py * v
        drag = -drive.k * math.hypot(rx, ry)
        along = float(drive.thrust(t, phase)) * p + drag * (rx * px + ry * py)
        # contact force on the car
        fx = mu * (bx * v * v) - drag * rx
        fy = mu * (by * v * v - self.sigma) - drag * ry
        normal = abs(fx * py - fy * px) / p
        free = along - hold + drive.remaining_hold_fraction(t) * self.start_hold - mu * (px * bx + py * by) * v * v
        return ForceBalance(free, normal, mu * p2, stretch)

    def excess_force(self, t: float, s: float, phase: int, brakes_reached: int) -> float:
        """Signed force beyond what friction and brakes hold; else 0."""
        free, normal, _, stretch = self.force_balance(t, s, 0.0, phase)
        resistance = stretch * (self.drive.mu_r * normal + self.brake_force[brakes_reached]) + STICKS
        return math.copysign(max(0.0, abs(free) - resistance), free)

    def departure_time_and_phase(self, t: float, s: float, phase: int, brakes_reached: int) -> tuple[float, int] | None:
        """When and in which phase a car at rest begins to move; None: never."""
        phases = self.drive.phases
        for k in range(phase, len(phases)):
            t0 = max(t, phases[k][0])
            t1 = phases[k][1]
            if self.excess_force(t0, s, k, brakes_reached):
                return t0, k
            if not math.isfinite(t1):
                continue

            def excess(t: float, k: int = k) -> float:
                return abs(self.excess_force(t, s, k, brakes_reached)) - 1e-300

            for a, b in itertools.pairwise(np.linspace(t0, t1, 33)):
                if excess(b) > 0.0:
                    return bisect_zero(excess, a, b), k
        return None

    def departure_directions_by_position(self) -> tuple[tuple[float, int], ...]:
        """`Drive.departure_directions` by the forces of the last phase."""
        last = len(self.drive.phases) - 1
        t = self.drive.phases[last][0]
        low = self.drive.rollback_end_position
        high = self.drive.end_position
        inside = [s for s in (*self.path.s[::8].tolist(), *self.brake_positions) if low < s < high]
        out: list[tuple[float, int]] = []
        for a, b in itertools.pairwise(sorted({low, high, *inside})):
            brakes_reached = bisect.bisect_right(self.brake_positions, a)

            def sign(s: float, brakes_reached: int = brakes_reached) -> int:
                force = self.excess_force(t, s, last, brakes_reached)
                return (force > 0.0) - (force < 0.0)

            before = sign(a)
            after = sign(b)
            out.append((a, before))
            if before == after:
                continue
            begin = bisect_zero(lambda s: abs(sign(s) - before) - 0.5, a, b)  # noqa: B023
            end = bisect_zero(lambda s: 0.5 - abs(sign(s) - after), a, b)  # noqa: B023
            if before > after and end >= begin:
                out.append((begin, 0))
            out.append((end, after))
        return tuple(next(same) for _, same in itertools.groupby(out, key=lambda x: x[1]))


class _RideSolver:
    """The state of a ride while it is computed."""

    def __init__(self, path: LoadPath, mu: float, sigma: float, drive: Drive, max_turns: float) -> None:
        self.path = path
        self.drive = drive
        self.turns_left = max_turns
        self.forces = QuasiStaticForces(path, mu, sigma, drive)
        self.t = 0.0
        self.s = drive.start
        self.v = 0.0
        self.phase = 0
        self.motion_sign = 0.0  # of the motion that friction opposes
        self.brakes_reached = bisect.bisect_right(self.forces.brake_positions, drive.start)
        longest = 1e3  # [l sqrt(rho/H)] longest ride
        self.end = min(drive.end_time, longest)
        self.events: list[Event] = []
        self.sections: list[tuple[float, float, Callable]] = []

    def roll_to_end_of_ride(self) -> Ride:
        """Roll and rest until the ride is over."""
        while self.t < self.end:
            if self.v == 0.0 and not self._rest_until_departure():
                break
            if not self._apply_event(self._roll_to_next_event()):
                break
        return Ride(self.path, tuple(self.events), tuple(self.sections))

    def _log_event(self, name: str) -> None:
        px, py, *_ = self.path(self.s)
        self.events.append(Event(name, self.t, self.s, abs(self.v) * math.hypot(px, py)))

    def _rest_until_departure(self) -> bool:
        """Stay at rest until the forces exceed friction; return whether the car moves on."""
        s = self.s
        forces = self.forces
        departure = forces.departure_time_and_phase(self.t, s, self.phase, self.brakes_reached)
        if departure is None:
            self._log_event("stop")
            return False
        t, phase = departure
        if t >= self.end:
            return False
        if t > self.t:
            self.sections.append((self.t, t, lambda t: np.stack([np.full_like(t, s), np.zeros_like(t)])))
        self.t = t
        self.phase = phase
        ahead = forces.excess_force(self.t, s, self.phase, self.brakes_reached)
        if ahead == 0.0:
            ahead = forces.force_balance(self.t + 1e-9, s, 0.0, self.phase).free
        before = self.motion_sign
        self.motion_sign = math.copysign(1.0, ahead)
        if before * self.motion_sign < 0.0:
            self._log_event("turn")
            self.turns_left -= 1
        return self.turns_left > 0

    def _next_brake(self) -> tuple[str, float]:
        """Event and position of the next brake ahead; the car turns at a standstill only."""
        positions = [-math.inf, *self.forces.brake_positions, math.inf]
        if self.motion_sign > 0.0:
            return "brake", positions[self.brakes_reached + 1]
        return "brake off", positions[self.brakes_reached]

    def _event_functions(self) -> dict[str, Callable]:
        """Values that end the motion where they fall through zero."""
        drive = self.drive
        brake, position = self._next_brake()

        def excess_speed(t, y):
            """Negative where the car is slow, and would stay."""
            px, py, *_ = self.path(y[0])
            excess = abs(y[1]) * math.hypot(px, py) - drive.rest_speed
            return excess if drive.is_near_rest_position(y[0]) else max(excess, drive.rest_speed)

        watches: dict[str, Any] = {
            "still": lambda t, y: self.motion_sign * y[1],
            "arrival": lambda t, y: drive.end_position - y[0],
            "back": lambda t, y: y[0] - drive.rollback_end_position,
        }
        if drive.departure_directions and self.phase == len(drive.phases) - 1:
            watches["rest"] = excess_speed
        if math.isfinite(position):
            watches[brake] = lambda t, y: self.motion_sign * (position - y[0])
        for watch in watches.values():
            watch.terminal = True
            watch.direction = -1.0
        return watches

    def _roll_to_next_event(self) -> str | None:
        """Integrate until the next event or the end of the phase; return the event's name."""
        from scipy.integrate import solve_ivp

        phase = self.phase
        sign = self.motion_sign
        forces = self.forces
        mu_r = self.drive.mu_r
        braking = forces.brake_force[self.brakes_reached]

        def rate(t: float, y: np.ndarray) -> list[float]:
            s, v = y.tolist()
            free, normal, inertia, stretch = forces.force_balance(t, s, v, phase)
            resistance = stretch * (mu_r * normal + braking)
            return [v, (free - sign * resistance) / inertia]

        span = (self.t, min(self.end, self.drive.phases[phase][1]))
        watches = self._event_functions()
        how: dict[str, Any] = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12, "dense_output": True}
        run = solve_ivp(rate, span, [self.s, self.v], events=[*watches.values()], **how)
        if not run.success:
            raise NoRest(f"the quasi-static ride cannot go on at s_o = {run.y[0, -1]:.4g}: {run.message}")
        event = next((name for name, times in zip(watches, run.t_events, strict=True) if times.size), None)
        end = float(run.t[-1])
        brake, position = self._next_brake()
        if event != brake and sign * (run.y[0, -1] - position) > 0.0:  # there and back in one step
            end = bisect_zero(lambda t: sign * (position - run.sol(t)[0]), self.t, end)
            event = brake
        self.sections.append((self.t, end, run.sol))
        self.t = end
        self.s, self.v = run.sol(end).tolist()
        return event

    def _apply_event(self, event: str | None) -> bool:
        """Set the state at an event without rounding; return whether the ride goes on."""
        if event is None:
            self._begin_next_phase()
        elif event in ("still", "rest"):
            self.v = 0.0
        elif event == "brake":
            self.s = self.forces.brake_positions[self.brakes_reached]
            self.brakes_reached += 1
        elif event == "brake off":
            self.brakes_reached -= 1
            self.s = self.forces.brake_positions[self.brakes_reached]
        elif event == "arrival":
            self.s = self.drive.end_position
        else:
            self.s = self.drive.rollback_end_position
        if event in ("rest", "brake", "arrival", "back"):
            self._log_event("stop" if event == "rest" else event)
        return event not in ("rest", "arrival", "back")

    def _begin_next_phase(self) -> None:
        """Count the phase, unless the ride is over, and log why the forces change."""
        if self.t >= self.end:
            return
        table = self.drive.thrust_table
        if table and self.t == table[-1][0]:
            self._log_event("thrust_end")
        elif self.t == self.drive.release:
            self._log_event("release")
        self.phase += 1


def roll_ride(path: LoadPath, mu: float, sigma: float, drive: Drive, max_turns: float = math.inf) -> Ride:
    """Roll until arrival, final rest, so many turns, or the end of time."""
    return _RideSolver(path, mu, sigma, drive, max_turns).roll_to_end_of_ride()


def ride_and_completed_drive(groups: Groups, drive: Drive) -> tuple[Ride, Drive]:
    """The quasi-static ride on the loaded cable, and the drive with directions of departure, `nominal` and `end_time`.

    A swinging ride of open end is over at its second turn.
    """
    path = LoadPath.on_loaded_cable(groups)
    forces = QuasiStaticForces(path, groups.mu, groups.sigma, drive)
    drive = replace(drive, departure_directions=forces.departure_directions_by_position())
    ends = math.isfinite(drive.end_time)
    first = roll_ride(path, groups.mu, groups.sigma, drive, math.inf if ends else 2)
    nominal = first.duration or min(1.0, drive.end_time)  # a car that stays
    if ends:
        return first, replace(drive, nominal=nominal)
    longest = 10.0  # longest ride over the quasi-static one
    drive = replace(drive, nominal=nominal, end_time=longest * nominal)
    if first.events and first.events[-1].event == "turn":
        first = roll_ride(path, groups.mu, groups.sigma, drive)
    return first, drive
