"""Stick and slip of a car that rolls on a cable, for both solvers.

Friction and brakes act against the slip along the cable. Their sign changes at events only:

    standstill      the car sticks if friction and brakes can hold it, else slips.
    breaking loose  they cannot hold it any more.
    lift_off        it no longer presses on the cable; the ride goes on.

Dimensionless: l = H = rho = 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

from cablefem.newmark import State, System, consistent_acceleration
from cablefem.scene import Groups
from cablefem.scene.drive import RollingCarState

EVENTS = ("standstill", "breaking loose", "turn", "brake", "brake off", "arrival", "back", "lift_off", "stop")


class CarForces(NamedTuple):
    """Forces and speed of a car."""

    normal: float
    speed: float  # along the mean tangent
    along: float  # thrust, drag and weight along it
    across: float  # weight across it


class EventFreeRange(NamedTuple):
    """Bounds within which a free car has no event but lift-off."""

    s_low: float
    s_high: float
    slip_sign: float  # 0: any
    speed_sign: float
    min_speed: float


@dataclass(slots=True)
class Mode:
    """State that events change."""

    sticks: bool = False
    heading: float = 1.0  # sign of the slip
    forward: float = 0.0  # sign of the speed, 0 at first
    brakes_reached: int = 0
    lifted_off: bool = False
    awaits_waves: bool = False  # see `release_car`
    slow_at: float = math.inf  # where, and since when, it is slower than `Drive.rest_speed`
    slow_since: float = 0.0
    stuck_since_slow: bool = False

    @property
    def slip_sign(self) -> float:
        """1 or -1, or 0 while the car sticks."""
        return 0.0 if self.sticks else self.heading


class RollingCar(System):
    """A system whose last unknown is the place s_o of a free car; of a hauled car it watches lift-off only.

    Solvers call `attach_drive_and_reset` once, `reset` and `release_car` at the start.
    """

    short_steps_after_jumps: bool  # short steps after jumps, even without friction
    hold: float  # force at the start

    def attach_drive_and_reset(self, groups: Groups) -> None:
        """Take the drive of a scene, and `reset`."""
        self.drive = groups.drive
        self.sigma = groups.sigma
        self.free = self.drive.mode == "free"
        self.adaptive = self.free
        self.events = EVENTS if self.free else ("lift_off",)
        self.round_trip = 2.0 / math.sqrt(groups.alpha)  # of axial waves
        self.hold = 0.0
        self.reset()

    def car_forces(self, x: State) -> CarForces:
        raise NotImplementedError

    def hold_and_normal_force(self, x: State) -> tuple[float, float]:
        """Force along the cable on a sticking car, and its normal force."""
        raise NotImplementedError

    def with_acceleration(self, x: State) -> State:
        """The state with the accelerations that its balance asks for."""
        return consistent_acceleration(self, x.t, x.q, x.v, x.phase)

    def with_law(self, law: str) -> Self:
        """A copy with another cable law, whose events leave this one as it is."""
        other: Self = super().with_law(law)  # type: ignore[misc]  # of the class that solves
        other.mode = replace(self.mode)
        other._last_event_values = None
        return other

    def reset(self) -> None:
        self.mode = Mode(brakes_reached=sum(position <= self.drive.start for position, _ in self.drive.brakes))
        self.events_from = -math.inf
        self._last_event_values: tuple[State, tuple[float, ...]] | None = None

    def release_car(self, x: State) -> State:
        """The first state of a free ride; until axial waves are back, zeros of the slip are no standstills."""
        x = self.stick_or_slip(x)
        self.mode.awaits_waves = self.friction_or_brake_acts and not self.mode.sticks
        return x

    def state_at_phase_start(self, x: State) -> State:
        return self.stick_or_slip(x) if self.mode.sticks else self.with_acceleration(x)

    @property
    def friction_or_brake_acts(self) -> bool:
        return self.drive.mu_r > 0.0 or self.mode.brakes_reached > 0

    @property
    def brake_force(self) -> float:
        """Force of the brakes that the car has reached."""
        return sum([force for _, force in self.drive.brakes[: self.mode.brakes_reached]], 0.0)

    def max_resistance(self, normal_force: float) -> float:
        """Largest force of friction and brakes."""
        return self.drive.mu_r * abs(normal_force) + self.brake_force

    def friction_margin(self, x: State) -> float:
        """`max_resistance` less the force that holds the car."""
        needed, normal = self.hold_and_normal_force(x)
        return self.max_resistance(normal) - abs(needed)

    def stick_or_slip(self, x: State) -> State:
        """The state at a standstill: the car sticks, or slips if friction and brakes cannot hold it."""
        v = x.v.copy()
        v[-1] = 0.0
        self.mode.sticks = True
        x = self.with_acceleration(x._replace(v=v))
        if self.friction_margin(x) > 0.0:
            self.mode.stuck_since_slow = True
            return x
        return self._start_slipping(x)

    def _start_slipping(self, x: State) -> State:
        needed, _ = self.hold_and_normal_force(x)
        mode = self.mode
        v = x.v.copy()
        force = needed if abs(needed) > 1e-9 * self.force_scale else self.hold
        mode.sticks = False
        mode.heading = -math.copysign(1.0, force)
        v[-1] = mode.heading * 1e-12 if self.friction_or_brake_acts else 0.0  # a first slip arms the standstill event
        return self.with_acceleration(x._replace(v=v))

    def begin_step(self, x: State) -> None:
        """Note where a slow car is, and whether axial waves have come back since it began to slip."""
        if not self.free:
            return
        mode = self.mode
        slip = float(x.v[-1])
        if mode.awaits_waves:
            turned = mode.heading * self.car_forces(x).speed < -self.drive.rest_speed
            answered = x.t >= max(self.drive.start, 1.0 - self.drive.start) * self.round_trip
            if turned or (answered and mode.heading * slip > 0.0):
                self._stop_awaiting_waves(slip)
        if self._moves_too_far_for_rest(x):
            mode.slow_at = float(x.q[-1])
            mode.slow_since = x.t
            mode.stuck_since_slow = mode.sticks
            self._last_event_values = None

    def _stop_awaiting_waves(self, slip: float) -> None:
        self.mode.awaits_waves = False
        self._last_event_values = None
        if slip != 0.0:
            self.mode.heading = math.copysign(1.0, slip)

    def apply_event(self, name: str, x: State) -> State | None:
        """The state after an event; None where the run ends."""
        mode = self.mode
        self._last_event_values = None
        if name in ("arrival", "back", "stop"):
            return None
        if name == "standstill":
            return self.stick_or_slip(x)
        if name == "breaking loose":
            return self._start_slipping(x)
        if name in ("brake", "brake off"):
            mode.brakes_reached += 1 if name == "brake" else -1
            self._stop_awaiting_waves(float(x.v[-1]))  # it may stop the car
            return self.with_acceleration(x)
        if name == "turn":
            mode.forward = -mode.forward
        else:
            mode.lifted_off = True
        return x

    def event_values(self, x: State) -> tuple[float, ...]:
        if x.t <= self.events_from:
            return (1.0,) * len(self.events)
        if self._last_event_values is None or self._last_event_values[0] is not x:
            self._last_event_values = x, self._compute_event_values(x)
        return self._last_event_values[1]

    def _compute_event_values(self, x: State) -> tuple[float, ...]:
        mode = self.mode
        drive = self.drive
        s_o = float(x.q[-1])
        if self.free and not 0.0 < s_o < 1.0:  # off the cable only these have values
            ends = {"arrival": drive.end_position - s_o, "back": s_o - drive.rollback_end_position}
            return tuple(ends.get(name, math.inf) for name in EVENTS)
        forces = self.car_forces(x)
        lift_off = math.inf if mode.lifted_off else forces.normal
        if not self.free:
            return (lift_off,)
        if mode.forward == 0.0 and abs(forces.speed) > drive.rest_speed:
            mode.forward = math.copysign(1.0, forces.speed)
        by_force = self._force_event_values(x, forces)
        by_position = self._position_event_values(s_o)
        return *by_force, *by_position, lift_off, self._time_to_stop_event(x)

    def _force_event_values(self, x: State, forces: CarForces) -> tuple[float, float, float]:
        mode = self.mode
        if mode.sticks:
            return math.inf, self.friction_margin(x), math.inf
        turns = mode.forward and abs(forces.along) > self.max_resistance(forces.across)
        slip = mode.heading * float(x.v[-1]) if self.friction_or_brake_acts and not mode.awaits_waves else math.inf
        return slip, math.inf, mode.forward * forces.speed if turns else math.inf

    def _position_event_values(self, s_o: float) -> tuple[float, float, float, float]:
        drive = self.drive
        mode = self.mode
        n = mode.brakes_reached
        turns_at_standstill_only = self.friction_or_brake_acts and not mode.awaits_waves
        direction = mode.heading if turns_at_standstill_only else 0.0
        ahead = drive.brakes[n][0] - s_o if n < len(drive.brakes) and direction >= 0.0 else math.inf
        back = s_o - drive.brakes[n - 1][0] if n and direction <= 0.0 else math.inf
        return ahead, back, drive.end_position - s_o, s_o - drive.rollback_end_position

    def _moves_too_far_for_rest(self, x: State) -> bool:
        mode = self.mode
        s_o = float(x.q[-1])
        speed = self.drive.rest_speed
        if mode.stuck_since_slow:
            speed = self.drive.rest_speed_in_brakes(s_o, self.round_trip)
        return abs(s_o - mode.slow_at) > speed * max(self.round_trip, x.t - mode.slow_since)

    def _time_to_stop_event(self, x: State) -> float:
        """Time until the car has been slow, and held, for an axial round trip of the last phase."""
        if x.phase < len(self.phases) - 1:
            return math.inf
        remaining = max(self.mode.slow_since, self.phases[-1][0]) + self.round_trip - x.t
        rests = self.drive.is_near_rest_position(float(x.q[-1])) and not self._moves_too_far_for_rest(x)
        return remaining if rests else max(remaining, self.round_trip)

    def step_fraction(self, x: State, since_event: float, time_ahead: float = 0.0) -> float:
        """Fraction of the equal step that the next one may have, see `System.step_fraction`."""
        mode = self.mode
        slip = x.v.item(-1)
        holds = self.drive.has_friction_or_brakes and (mode.brakes_reached > 0 or mode.sticks)
        short_after_jumps = self.short_steps_after_jumps or self.drive.has_friction_or_brakes
        forward = mode.forward if short_after_jumps else 0.0
        since_jump = since_event if short_after_jumps else math.inf
        s_o = x.q.item(-1) + time_ahead * slip
        car = RollingCarState(s_o, slip, forward, since_jump, held=holds)
        return self.drive.step_fraction(self.round_trip, self.sigma, car)

    @property
    def is_event_free_range_known(self) -> bool:
        """Whether `event_free_range` excludes all events."""
        mode = self.mode
        return not self.free or not (mode.sticks or mode.awaits_waves or mode.forward == 0.0)

    def event_free_range(self) -> EventFreeRange:
        """The range of states in which no event happens but lift-off."""
        mode = self.mode
        drive = self.drive
        positions = (0.0, *(position for position, _ in drive.brakes), 1.0)
        n = mode.brakes_reached
        low = max(drive.rollback_end_position, positions[n])
        high = min(drive.end_position, positions[n + 1])
        slip_sign = mode.heading if self.friction_or_brake_acts else 0.0
        return EventFreeRange(low, high, slip_sign, mode.forward, drive.rest_speed)
