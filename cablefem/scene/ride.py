"""The quasi-static ride: the car on the curve of its places at rest, its load path P(s).

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
from typing import Any

import numpy as np

from cablefem.scene.bisection import bisected
from cablefem.scene.drive import Drive
from cablefem.scene.statics import NoRest, gripped, nodes

HORIZON = 1e3  # [l sqrt(rho/H)] longest ride
LASTS = 10.0  # longest ride over the quasi-static one
STICKS = 1e-13  # over H: smaller forces are rounding


class LoadPath:
    """Curve on which the car rolls: P, P', P'', holding force Pi', stretch <lam>."""

    def __init__(self, s, place, slope, bend, hold, stretch) -> None:
        from scipy.interpolate import CubicHermiteSpline, CubicSpline  # slow to import

        self.s = s
        self.place: Callable = CubicHermiteSpline(s, place, slope)
        columns = [CubicHermiteSpline(s, slope, bend).c, CubicSpline(s, np.stack([hold, stretch], -1)).c]
        self._c = np.concatenate(columns, axis=2)
        self._nodes = s.tolist()

    def __call__(self, s: float) -> tuple[float, float, float, float, float, float]:
        """(P'_x, P'_y, P''_x, P''_y, Pi', <lam>) at s."""
        i = min(max(bisect.bisect_right(self._nodes, s) - 1, 0), len(self._nodes) - 2)
        x = s - self._nodes[i]
        c3, c2, c1, c0 = self._c[:, i]
        px, py, hold, stretch = (c0 + x * (c1 + x * (c2 + x * c3))).tolist()
        bx, by = (c1 + x * (2.0 * c2 + 3.0 * x * c3))[:2].tolist()
        return px, py, bx, by, hold, stretch

    @classmethod
    def loaded(cls, groups) -> LoadPath:
        """The elastic catenary of two pieces; groups: mu, alpha, sigma, c."""
        r = gripped(nodes(), groups)
        return cls(r.s, r.place, r.along, r.bend, r.hold, r.stretch)

    @classmethod
    def empty(cls, groups) -> LoadPath:
        s = nodes()
        _, xp, yp, xpp, ypp = groups.static(s)
        place = np.stack(groups.shape(s), -1)
        hold = -groups.mu * groups.sigma * yp
        return cls(s, place, np.stack([xp, yp], -1), np.stack([xpp, ypp], -1), hold, np.ones_like(s))

    @classmethod
    def chord(cls, groups) -> LoadPath:
        s = nodes()
        slope = np.stack(groups.shape(1.0))
        ones = np.ones_like(s)
        hold = -groups.mu * groups.sigma * slope[1] * ones
        return cls(s, s[:, None] * slope, ones[:, None] * slope, np.zeros((s.size, 2)), hold, math.hypot(*slope) * ones)


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
        return self.sections[-1][1] if self.sections else 0.0

    def at(self, t) -> tuple[np.ndarray, np.ndarray]:
        """(s_o, ds_o) at times t."""
        t = np.clip(np.asarray(t, dtype=float), 0.0, self.duration)
        which = np.clip(np.searchsorted([t0 for t0, _, _ in self.sections], t, side="right") - 1, 0, None)
        out = np.empty((2, *t.shape))
        for k in np.unique(which):
            mine = which == k
            out[:, mine] = self.sections[k][2](t[mine])
        return out[0], out[1]

    def speed(self, t) -> np.ndarray:
        """|P'| |ds_o| at times t."""
        s, v = self.at(t)
        return np.abs(v) * np.linalg.norm(self.path.place(s, 1), axis=-1)

    @cached_property
    def top_speed(self) -> float:
        return float(np.max(self.speed(np.linspace(0.0, self.duration, 2001)))) if self.sections else 0.0


class Forces:
    """Forces on a car on a load path; `brakes` counts those reached."""

    def __init__(self, path: LoadPath, mu: float, sigma: float, drive: Drive) -> None:
        self.path = path
        self.mu = mu
        self.sigma = sigma
        self.drive = drive
        self.begin_hold = path(drive.start)[4]
        self.places = [place for place, _ in drive.brakes]
        self.level = [0.0, *np.cumsum([force for _, force in drive.brakes]).tolist()]

    def at(self, t: float, s: float, v: float, phase: int) -> tuple[float, float, float, float]:
        """Force without friction, normal load without brakes, mu |P'|^2, <lam>."""
        drive = self.drive
        mu = self.mu
        px, py, bx, by, hold, stretch = self.path(s)
        p2 = px * px + py * py
        p = math.sqrt(p2)
        rx = px * v - drive.wind
        ry = py * v
        drag = -drive.k * math.hypot(rx, ry)
        along = float(drive.thrust(t, phase)) * p + drag * (rx * px + ry * py)
        normal = (mu * (bx * v * v) - drag * rx) * py - (mu * (by * v * v - self.sigma) - drag * ry) * px
        free = along - hold + drive.hold(t) * self.begin_hold - mu * (px * bx + py * by) * v * v
        return free, abs(normal) / p, mu * p2, stretch

    def stands(self, t: float, s: float, phase: int, brakes: int) -> float:
        """Signed force beyond what friction and brakes hold; else 0."""
        free, normal, _, stretch = self.at(t, s, 0.0, phase)
        most = stretch * (self.drive.mu_r * normal + self.level[brakes]) + STICKS
        return math.copysign(max(0.0, abs(free) - most), free)

    def loose(self, t: float, s: float, phase: int, brakes: int) -> tuple[float, int] | None:
        """When and in which phase a car at rest begins to move; None: never."""
        phases = self.drive.phases
        for k in range(phase, len(phases)):
            t0 = max(t, phases[k][0])
            t1 = phases[k][1]
            if self.stands(t0, s, k, brakes):
                return t0, k
            grid = np.linspace(t0, t1, 33) if math.isfinite(t1) else np.array([t0, t0])
            for a, b in itertools.pairwise(grid):
                if self.stands(b, s, k, brakes):
                    return bisected(lambda t: abs(self.stands(t, s, k, brakes)) - 1e-300, a, b), k  # noqa: B023
        return None

    def ways(self) -> tuple[tuple[float, int], ...]:
        """`Drive.ways` by the forces of the last phase."""
        drive = self.drive
        last = len(self.drive.phases) - 1
        t = drive.phases[last][0]
        low = drive.back_place
        high = drive.end_place
        marks = sorted({low, high, *(x for x in (*self.path.s[::8].tolist(), *self.places) if low < x < high)})
        out: list[tuple[float, int]] = []

        def way(s: float, brakes: int) -> int:
            force = self.stands(t, s, last, brakes)
            return (force > 0.0) - (force < 0.0)

        for a, b in itertools.pairwise(marks):
            brakes = bisect.bisect_right(self.places, a)
            before = way(a, brakes)
            after = way(b, brakes)
            out.append((a, before))
            if before != after:
                leaves = bisected(lambda s: abs(way(s, brakes) - before) - 0.5, a, b)  # noqa: B023
                comes = bisected(lambda s: 0.5 - abs(way(s, brakes) - after), a, b)  # noqa: B023
                if before > after and comes >= leaves:
                    out.append((leaves, 0))
                out.append((comes, after))
        return tuple(next(same) for _, same in itertools.groupby(out, key=lambda x: x[1]))


class _Rolling:
    def __init__(self, path: LoadPath, mu: float, sigma: float, drive: Drive, turns: float) -> None:
        self.path = path
        self.drive = drive
        self.turns = turns
        self.forces = Forces(path, mu, sigma, drive)
        self.t = 0.0
        self.s = drive.start
        self.v = 0.0
        self.phase = 0
        self.sign = 0.0  # of the motion that friction opposes
        self.brakes = bisect.bisect_right(self.forces.places, drive.start)  # number reached
        self.end = min(drive.end_time, HORIZON)
        self.events: list[Event] = []
        self.sections: list[tuple[float, float, Callable]] = []

    def to_its_end(self) -> Ride:
        going = True
        while going and self.t < self.end:
            going = (self.v != 0.0 or self._depart()) and self._react(self._roll())
        return Ride(self.path, tuple(self.events), tuple(self.sections))

    def _log(self, name: str) -> None:
        px, py, *_ = self.path(self.s)
        self.events.append(Event(name, self.t, self.s, abs(self.v) * math.hypot(px, py)))

    def _depart(self) -> bool:
        s = self.s
        forces = self.forces
        go = forces.loose(self.t, s, self.phase, self.brakes)
        if go is None:
            self._log("stop")
        if go is None or go[0] >= self.end:
            return False
        if go[0] > self.t:
            self.sections.append((self.t, go[0], lambda t: np.stack([np.full_like(t, s), np.zeros_like(t)])))
        self.t, self.phase = go
        ahead = forces.stands(self.t, s, self.phase, self.brakes) or forces.at(self.t + 1e-9, s, 0.0, self.phase)[0]
        before = self.sign
        self.sign = math.copysign(1.0, ahead)
        if before * self.sign < 0.0:
            self._log("turn")
            self.turns -= 1
        return self.turns > 0

    def _next_brake(self) -> tuple[str, float]:
        """Event and place of the next brake ahead; the car turns at a standstill only."""
        places = self.forces.places
        if self.sign > 0.0:
            return "brake", places[self.brakes] if self.brakes < len(places) else math.inf
        return "brake off", places[self.brakes - 1] if self.brakes else -math.inf

    def _watches(self) -> dict[str, Callable]:
        """Values that end the motion where they fall through zero."""
        drive = self.drive
        brake, place = self._next_brake()

        def slow(t, y):
            """Negative where the car is slow, and would stay."""
            px, py, *_ = self.path(y[0])
            over = abs(y[1]) * math.hypot(px, py) - drive.rest_speed
            return over if drive.stays(y[0]) else max(over, drive.rest_speed)

        watches: dict[str, Any] = {
            "still": lambda t, y: self.sign * y[1],
            "arrival": lambda t, y: drive.end_place - y[0],
            "back": lambda t, y: y[0] - drive.back_place,
        }
        if drive.ways and self.phase == len(drive.phases) - 1:
            watches["rest"] = slow
        if math.isfinite(place):
            watches[brake] = lambda t, y: self.sign * (place - y[0])
        for watch in watches.values():
            watch.terminal = True
            watch.direction = -1.0
        return watches

    def _roll(self) -> str | None:
        from scipy.integrate import solve_ivp

        phase = self.phase
        sign = self.sign
        forces = self.forces
        mu_r = self.drive.mu_r
        brake = forces.level[self.brakes]

        def rate(t: float, y: np.ndarray) -> list[float]:
            free, normal, inertia, stretch = forces.at(t, y[0], y[1], phase)
            return [y[1], (free - sign * stretch * (mu_r * normal + brake)) / inertia]

        span = (self.t, min(self.end, self.drive.phases[phase][1]))
        watches = self._watches()
        run = solve_ivp(
            rate, span, [self.s, self.v], "DOP853", rtol=1e-10, atol=1e-12, dense_output=True,
            events=[*watches.values()],
        )  # fmt: skip
        if not run.success:
            raise NoRest(f"the quasi-static ride cannot go on at s_o = {run.y[0, -1]:.4g}: {run.message}")
        event = next((name for name, times in zip(watches, run.t_events, strict=True) if times.size), None)
        end = float(run.t[-1])
        brake, place = self._next_brake()
        if event != brake and sign * (run.y[0, -1] - place) > 0.0:  # there and back in one step
            end = bisected(lambda t: sign * (place - run.sol(t)[0]), self.t, end)
            event = brake
        self.sections.append((self.t, end, run.sol))
        self.t = end
        self.s, self.v = run.sol(end).tolist()
        return event

    def _react(self, event: str | None) -> bool:
        if event is None:
            self._next_phase()
        elif event in ("still", "rest"):
            self.v = 0.0
        elif event == "brake":
            self.s = self.forces.places[self.brakes]
            self.brakes = self.brakes + 1
        elif event == "brake off":
            self.s = self.forces.places[self.brakes - 1]
            self.brakes = self.brakes - 1
        else:
            self.s = self.drive.end_place if event == "arrival" else self.drive.back_place
        if event in ("rest", "brake", "arrival", "back"):
            self._log("stop" if event == "rest" else event)
        return event not in ("rest", "arrival", "back")

    def _next_phase(self) -> None:
        if self.t < self.end:
            table = self.drive.thrust_table
            names = {self.drive.release: "release"} | ({table[-1][0]: "thrust_end"} if table else {})
            if self.t in names:
                self._log(names[self.t])
            self.phase += 1


def ride(path: LoadPath, mu: float, sigma: float, drive: Drive, turns: float = math.inf) -> Ride:
    """Roll until arrival, final rest, `turns` turns, or the end of time."""
    return _Rolling(path, mu, sigma, drive, turns).to_its_end()


def quasi_static(groups, drive: Drive) -> tuple[Ride, Drive]:
    """The ride on the loaded cable, and the drive with `nominal` and `end_time`.

    A swinging ride of open end is over at its second turn.
    """
    path = LoadPath.loaded(groups)
    drive = replace(drive, ways=Forces(path, groups.mu, groups.sigma, drive).ways())
    first = ride(path, groups.mu, groups.sigma, drive, math.inf if math.isfinite(drive.end_time) else 2)
    nominal = first.duration or min(1.0, drive.end_time)  # a car that stays
    if math.isfinite(drive.end_time):
        return first, replace(drive, nominal=nominal)
    drive = replace(drive, nominal=nominal, end_time=LASTS * nominal)
    if first.events and first.events[-1].event == "turn":
        first = ride(path, groups.mu, groups.sigma, drive)
    return first, drive
