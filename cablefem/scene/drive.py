"""What moves the car: grip, haul or free; see README.md, rule 4."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from cablefem.scene.errors import short_text
from cablefem.scene.fields import (
    REAL,
    NonNegative,
    Numbers,
    Pair,
    Part,
    Positive,
    Real,
    Reals,
    described_field,
    exactly_one_faults,
    list_of_tables_like,
    not_rising_faults,
    number_between,
    number_or_table_type,
    unequal_length_faults,
)

# [l] range of a rolling car: forces grow like one over the distance to a support
NEAREST_START = 1e-4
FARTHEST_END = 0.99
START = 0.01  # [l] where a rolling car begins by default
ONLY = {  # modes that alone have a key
    **dict.fromkeys(("release", "thrust", "brake", "rest_speed", "rest_distance"), "free"),
    "hitch": "haul",
}
UNUSED_KEYS = {  # why other keys have no meaning
    "grip": "where the car takes its travel from [travel] and nothing else; leave it out, or take haul or free",
    "haul": "where the rope supplies whatever force the travel needs; leave it out, or take free",
    "free": "where no rope hauls the car; leave it out, or take haul",
}


DriveMode = Literal["grip", "haul", "free"]


class Thrust(Part):
    """Force along the mean tangent, linear between its times, else zero."""

    times: Numbers = described_field("[s] strictly increasing")
    forces: Reals = described_field("[N] positive to the right")
    angle: Annotated[float, number_between(-90.0, 90.0)] = described_field(
        "[deg] of two wheels: above the line of the wheels", 0.0
    )
    at: Pair | None = described_field("[m] of two wheels: where it acts, ahead of and below the centre of mass", None)

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        return unequal_length_faults(self.times, "forces", self.forces) + not_rising_faults("times", self.times)


class Brake(Part):
    """A shoe that acts against the motion to the right of a position; several add up."""

    position: Positive = described_field("[m] position along the cable: it brakes to the right of it", alias="from")
    force: Positive = described_field("[N] braking force along the cable")
    wheel: Literal["rear", "front", "both"] = described_field(
        "[-] of two wheels: which brakes; both: with half each", "both"
    )

    @property
    def rear_wheel_force(self) -> float:
        """Force [N] at the rear one of two wheels."""
        return self.force * {"rear": 1.0, "front": 0.0, "both": 0.5}[self.wheel]


class End(Part):
    """Where or when the run ends: exactly one of both."""

    time: Positive | None = described_field("[s] at which the ride ends; on a line it must be given", None)
    place: Positive | None = described_field("[m] position along the cable that counts as arrival, of one span", None)

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        return exactly_one_faults(("time", "place"), written_values)


def drive_keys_of_mode(mode: DriveMode) -> tuple[str, ...]:
    """Names of the table [drive] with a meaning in a mode."""
    if mode == "grip":
        return ("mode",)
    names = Driving.written_field_names()
    return tuple(name for name in names if mode not in UNUSED_KEYS or ONLY.get(name, mode) == mode)


class Driving(Part):
    """The table [drive]."""

    mode: DriveMode = described_field("[-] grip, haul or free: what moves the car", "grip")
    start: Positive | None = described_field("[m] position of the car at the start; default 1 % of the length", None)
    release: NonNegative = described_field("[s] over which the force that holds a free car goes", 0.0)
    rolling_friction: Annotated[float, number_between(0.0, 1.0)] = described_field(
        "[-] friction over contact force", 0.0
    )
    drag_area: NonNegative = described_field("[m2] drag coefficient times area of the car", 0.0)
    air_density: Positive = described_field("[kg/m3] density of the air", 1.2)
    wind: Real = described_field("[m/s] along x on the car alone; negative is a headwind", 0.0)
    thrust: number_or_table_type(REAL, Thrust) = described_field("[N] force along the cable", 0.0)  # type: ignore[valid-type]
    brake: Annotated[tuple[Brake, ...], list_of_tables_like("{from = ..., force = ...}")] = described_field(
        "[-] brakes, in order", ()
    )
    end: End | None = described_field("[-] where or when the ride is over", None)
    hitch: Pair | None = described_field(
        "[m] of two wheels: of the haul rope, ahead of and below the centre of mass", None
    )
    rest_speed: Positive = described_field(
        "[m/s] a slower car is at rest where friction or the valley holds it; one that a brake has held, too, "
        "below brake force / (2 sqrt(mass_per_length EA)), by which the cable springs back",
        1e-3,
    )
    rest_distance: Positive = described_field(
        "[m] from its static position of rest in which a slow car is at rest", 0.01
    )

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults of keys without meaning in the mode, one line each."""
        meaningful = drive_keys_of_mode(self.mode)
        written: dict[str, str] = {}  # all that is not the default
        faults = []
        for name, field in type(self).model_fields.items():
            if name == "mode" or written_values.get(name) in (None, field.default):
                continue
            written[name] = f"{name} = {short_text(written_values[name])}"
            if name not in meaningful:
                faults.append(f"{written[name]}: has no meaning with mode = {self.mode!r}, {UNUSED_KEYS[self.mode]}")
        if "drag_area" not in written and self.mode != "grip":
            why = "acts through drag alone; must be given with drag_area"
            faults += [f"{written[name]}: {why}" for name in ("wind", "air_density") if name in written]
        return faults

    def faults_on_cable(self, length: float) -> list[str]:
        """Faults on a cable of this length [m]."""
        if self.mode == "grip":
            return []
        near = NEAREST_START * length
        far = FARTHEST_END * length
        end = self.end_position(length)
        faults = []
        last = min(end, far)
        if end > far:
            must = f"must be < {far:.6g} m, {FARTHEST_END:g} of the length of the cable"
            faults.append(f"end.place = {end!r}: {must}: next to the support no answer converges")
        if not near <= self.start_position(length) < last:
            must = f"must be from {near:.6g} to {last:.6g} m, between the left support and the end of the ride"
            faults.append(f"start = {self.start!r}: {must}")
        for i, brake in enumerate(self.brake):
            if brake.position >= length:
                faults.append(
                    f"brake[{i}].from = {brake.position!r}: must be < {length:.6g} m, the length of the cable"
                )
        return faults

    def start_position(self, length: float) -> float:
        """Where the car begins [m]."""
        return START * length if self.start is None else self.start

    def end_position(self, length: float) -> float:
        """Where a rolling car arrives [m]."""
        return FARTHEST_END * length if self.end is None or self.end.place is None else self.end.place

    @property
    def thrust_over_time(self) -> list[tuple[float, float]]:
        """Times [s] and forces [N] of the thrust; none without thrust."""
        if isinstance(self.thrust, Thrust):
            return list(zip(self.thrust.times, self.thrust.forces, strict=True))
        return [(0.0, self.thrust), (math.inf, self.thrust)] if self.thrust else []

    def in_units(self, length: float, time: float, force: float, rho: float) -> Drive:
        """The drive of a rolling car over these units of m, s, N and kg/m."""
        brakes = sorted((brake.position / length, brake.force / force) for brake in self.brake)
        rear_brakes = sorted((brake.position / length, brake.rear_wheel_force / force) for brake in self.brake)
        end_time = math.inf if self.end is None or self.end.time is None else self.end.time
        thrust_angle = 0.0
        thrust_at = None
        if isinstance(self.thrust, Thrust):
            thrust_angle = math.radians(self.thrust.angle)
            thrust_at = self.thrust.at
        return Drive(
            mode=self.mode,
            start=self.start_position(length) / length,
            release=self.release / time,
            mu_r=self.rolling_friction,
            k=self.air_density * self.drag_area / (2.0 * rho),
            wind=self.wind * time / length,
            thrust_table=tuple((t / time, f / force) for t, f in self.thrust_over_time),
            brakes=tuple(brakes),
            end_time=end_time / time,
            end_position=self.end_position(length) / length,
            rest_speed=self.rest_speed * time / length,
            rest_distance=self.rest_distance / length,
            hitch=self.hitch or (0.0, 0.0),
            thrust_angle=thrust_angle,
            thrust_at=thrust_at or (0.0, 0.0),
            rear_brakes=tuple(rear_brakes),
        )

    def __str__(self) -> str:
        fields = type(self).model_fields
        words = [f"{name} {value}" for name, value in self if name != "mode" and value != fields[name].default]
        return ", ".join([self.mode, *words])


class RollingCarState(NamedTuple):
    """What bounds the steps of a rolling car."""

    s_o: float
    speed: float
    forward: float  # sign of the motion
    since_jump: float  # time after a jump of force
    held: bool  # whether a brake or a hold acts


@dataclass(frozen=True)
class Drive:
    """The same over l, H and l sqrt(rho/H)."""

    mode: DriveMode = "grip"
    start: float = 0.0
    release: float = 0.0
    mu_r: float = 0.0  # rolling friction
    k: float = 0.0  # rho_air c_d A/(2 rho): drag is -k |dp - wind i| (dp - wind i)
    wind: float = 0.0
    thrust_table: tuple[tuple[float, float], ...] = ()  # (t, force)
    brakes: tuple[tuple[float, float], ...] = ()  # (s_o, force), by s_o
    end_time: float = math.inf
    end_position: float = 1.0
    nominal: float = math.inf  # quasi-static duration; steps are nominal/steps
    rest_speed: float = 0.0
    rest_distance: float = 0.0
    # of two wheels; points [m] ahead of and below the centre of mass
    hitch: tuple[float, float] = (0.0, 0.0)
    thrust_angle: float = 0.0  # [rad] above the line of the wheels
    thrust_at: tuple[float, float] = (0.0, 0.0)
    rear_brakes: tuple[tuple[float, float], ...] = ()  # of `brakes` the force at the rear wheel
    # from s_o on, the direction in which a car at rest sets out: 1, 0 or -1
    departure_directions: tuple[tuple[float, int], ...] = ()

    @property
    def rollback_end_position(self) -> float:
        """A run that rolls back is over here."""
        return 0.5 * min(self.start, START)

    @cached_property
    def phases(self) -> tuple[tuple[float, float], ...]:
        """Consecutive [t0, t1] of smooth forces."""
        breaks = {self.release, *(t for t, _ in self.thrust_table)}
        inside = sorted(t for t in breaks if 0.0 < t < self.end_time)
        return tuple(zip([0.0, *inside], [*inside, self.end_time], strict=True))

    def thrust(self, t: Any, phase: Any) -> Any:
        """Thrust at t; any shapes."""
        value, slope, t0 = self._thrust_slope_and_start_by_phase[:, phase]
        return value + slope * (t - t0)

    def remaining_hold_fraction(self, t: Any) -> Any:
        """Share of the force that still holds the car at t, of any shape: (1 - x)^2 (1 + 2 x), x = t/release."""
        if self.release == 0.0:
            return 0.0 * t
        x = np.minimum(t / self.release, 1.0)
        return (1.0 - x) ** 2 * (1.0 + 2.0 * x)

    def brake_force(self, s_o: Any) -> Any:
        """Force of all brakes that reach s_o; any shape."""
        return sum(force * (s_o >= position) for position, force in self.brakes)

    def rest_speed_in_brakes(self, s_o: float, axial_round_trip: float) -> float:
        """`rest_speed`, or where it is larger F/(2 sqrt(rho EA)), by which cable springs back from brakes that held."""
        return max(self.rest_speed, self.brake_force(s_o) * axial_round_trip / 4.0)

    def rear_brake_force(self, s_o: Any) -> Any:
        """Of `brake_force` the part at the rear one of two wheels."""
        return sum(force * (s_o >= position) for position, force in self.rear_brakes)

    def brake_positions_around(self, s_o: float) -> tuple[float, float]:
        """Where the last brake up to s_o begins, and the next one beyond it; infinite where there is none."""
        behind = [position for position, _ in self.brakes if position <= s_o]
        ahead = [position for position, _ in self.brakes if position > s_o]
        return max(behind, default=-math.inf), min(ahead, default=math.inf)

    @property
    def has_friction_or_brakes(self) -> bool:
        """Whether friction or a brake acts."""
        return self.mu_r > 0.0 or bool(self.brakes)

    def departure_direction(self, s_o: float) -> int:
        """Direction in which a car at rest at s_o sets out under the last thrust: 1, -1, or 0."""
        i = bisect.bisect_right(self.departure_directions, (s_o, math.inf)) - 1
        return self.departure_directions[i][1] if i >= 0 else 0

    def is_near_rest_position(self, s_o: float) -> bool:
        """Whether s_o is within `rest_distance` of a position of rest."""
        d = self.rest_distance
        ends = [*(s for s, _ in self.departure_directions[1:]), math.inf]
        zones = [
            (begin, end)
            for (begin, direction), end in zip(self.departure_directions, ends, strict=True)
            if direction == 0
        ]
        return any(begin - d <= s_o <= end + d for begin, end in zones)

    def step_fraction(self, axial_round_trip: float, sigma: float, car: RollingCarState) -> float:
        """The fraction of a step, 1/1000 of the run, that a rolling car takes at s_o.

        A step is at most 1/12 of the time since a jump of force and of that to a support.
        It is at most 1/60 of the transverse round trip ahead.
        It is at most half the time until friction may turn, but there not less than 1/240 of the axial round trip.
        """
        step = self.nominal / 1000.0
        near = min(car.s_o, 1.0 - car.s_o)
        limits = [(car.since_jump + axial_round_trip * near) / 12.0]
        if car.speed:
            limits.append(near / abs(car.speed) / 12.0)
        if car.forward:
            ahead = car.s_o if car.forward < 0.0 else 1.0 - car.s_o
            limits.append(2.0 * ahead / 60.0)
        rings = axial_round_trip / 240.0
        # friction turns nowhere where the car would set out again in the same direction
        halts = self.mu_r > 0.0 and car.forward * self.departure_direction(car.s_o) <= 0.0
        if car.held:
            limits.append(rings)
        elif halts:
            limits.append(max(abs(car.speed) / sigma / 2.0, rings))
        return min(1.0, min(limits) / step)

    @cached_property
    def _thrust_slope_and_start_by_phase(self) -> np.ndarray:
        """Thrust, its slope and the time at the start of each phase: (3, n)."""
        out = np.zeros((3, len(self.phases)))
        for i, (t0, t1) in enumerate(self.phases):
            out[2, i] = t0
            for (a, fa), (b, fb) in itertools.pairwise(self.thrust_table):
                if a <= t0 and t1 <= b:
                    slope = (fb - fa) / (b - a) if fa != fb else 0.0
                    out[:2, i] = fa + slope * (t0 - a), slope
        return out


GRIP = Drive()
