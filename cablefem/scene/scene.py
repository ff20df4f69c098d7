"""What is simulated: cable, supports, mass and travel in SI; symbols: README.md."""

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from cablefem.scene import catenary as _catenary
from cablefem.scene.bodies import Wheels, body_faults, missing_wire_faults
from cablefem.scene.cable import (
    SHAPES,
    Cable,
    Supports,
    catenary_with_heat_and_ice,
    no_catenary_fault,
    reference_catenary,
    stretch_fault,
)
from cablefem.scene.catenary import Catenary
from cablefem.scene.damping import Wind, damping_fault, first_angular_frequency, own_and_wind_damping_rates
from cablefem.scene.described import LIBRARY, OF_ONE_SPAN, Described, library_text, parse_toml
from cablefem.scene.drive import GRIP, NEAREST_START, Drive, DriveMode, Driving
from cablefem.scene.errors import NOT_MODELLED, SceneError
from cablefem.scene.fields import LARGE, NonNegative, Part, Positive, described_field
from cablefem.scene.motion import Motion
from cablefem.scene.ride import Ride, ride_and_completed_drive
from cablefem.scene.statics import NoRest
from cablefem.scene.surroundings import Ground, Obstacles, obstacle_faults
from cablefem.scene.travel import Table, Travel

OF_LINES = "run and check alone take it, from a file"  # a scene with it is a line, see `short.py`
# laws of `Scene.from_groups`, with the key that sets their pace
PACES = {"constant_speed": "speed", "constant_acceleration": "acceleration", "accelerate_cruise_brake": "top_speed"}


class Mass(Part):
    """The moving mass particle."""

    not_modelled: ClassVar = NOT_MODELLED | {"hanger": OF_LINES}
    mass: Positive = described_field("[kg] M, mass of the car")
    below: NonNegative = described_field("[m] how far the lowest part of the car or rider hangs below the cable", 0.0)
    wheels: Wheels | None = described_field("[-] wheels of the car; without base it stays a point of one span", None)

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Fault of wheels that make a scene a line."""
        two = self.wheels is not None and (self.wheels.base or self.wheels.model == "rigid")
        return [f"wheels: not modelled: {OF_LINES}"] if two else []


@dataclass(frozen=True, slots=True)
class Groups:
    """Dimensionless numbers of a scene, over l, H and l sqrt(rho/H)."""

    mu: float  # M/(rho l); 0 without a mass
    alpha: float  # EA/H
    sigma: float  # rho g l/H
    c: float  # y'/x' at s = 0
    chord_cos: float  # of the chord, left to right
    chord_sin: float  # > 0: falls to the right
    motion: Motion | None  # None for a bare cable and for a free ride
    drive: Drive = GRIP
    damping: float = 0.0  # c_d: the force on the cable is -c_d times its momentum

    def static_tension(self, s: Any) -> np.ndarray:
        """T at s."""
        return _catenary.static_tension(s, self.sigma, self.c)

    def tension_and_slope(self, s: Any) -> _catenary.TensionAndSlope:
        """T, x', y' at s."""
        return _catenary.tension_and_slope(s, self.sigma, self.c)

    def tension_and_shape_derivatives(self, s: Any) -> _catenary.TensionAndShape:
        """(T, x', y', x'', y'') at s in [0, 1]."""
        return _catenary.tension_and_shape_derivatives(s, self.sigma, self.c)

    def coordinates(self, s: Any) -> tuple[np.ndarray, np.ndarray]:
        """(x, y) at s in [0, 1]; y down."""
        return _catenary.coordinates(s, self.sigma, self.c)


class Scene(Described):
    """A cable, its supports and the mass that travels along it, in SI.

    Scene.load("zip.toml").replace({"mass.mass": 60.0})
    """

    built_in: ClassVar[Sequence[str]] = LIBRARY
    library_text: ClassVar = staticmethod(library_text)

    cable: Cable = described_field("[-] the cable")
    supports: Supports = described_field("[-] the two fixed ends")
    mass: Mass | None = described_field("[-] the car; a bare cable has neither mass nor travel", None)
    travel: Travel | None = described_field("[-] how the car moves along the cable; not with drive.mode = 'free'", None)
    drive: Driving = described_field("[-] what moves the car", Driving())
    wind: Wind | None = described_field("[-] wind on the cable", None)
    obstacle: Obstacles = ()
    ground: Ground = ()

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults between fields, one line each."""
        present = [name for name in ("mass", "travel") if written_values.get(name) is not None]
        faults = [] if self.drive is None else _mass_or_travel_faults(self.drive.mode, present)
        faults += body_faults(None, None, None, self.drive)
        hung = (self.gravity, self.cable, self.supports)
        if None in hung:
            return faults
        faults += obstacle_faults(self.obstacle or (), self.supports.span)
        faults += missing_wire_faults(self.cable.wire, None if self.mass is None else self.mass.wheels)
        if hanging := no_catenary_fault(*hung):
            return [*faults, hanging]
        return [*faults, *filter(None, self._stretch_damping_and_ride_faults(self.drive or Driving()))]

    def _stretch_damping_and_ride_faults(self, drive: Driving) -> list[str]:
        """Faults of stretch, damping, travel and drive on a cable that hangs; "" where there is none."""
        faults = [
            stretch_fault(self.gravity, self.cable, self.supports),
            damping_fault(*self._damping_arguments),
        ]
        rolling = [f"drive.{fault}" for fault in drive.faults_on_cable(self.length)]
        if self.travel is not None and drive.mode != "free" and not rolling:
            faults.append(_travel_fault(self.travel, drive, self.length, self.axial_speed))
        return faults + rolling

    @property
    def _damping_arguments(self) -> tuple[Catenary, Cable, Wind | None, float]:
        return self.catenary, self.cable, self.wind, self.gravity

    @classmethod
    def from_toml(cls, text: str, *, name: str = "scene", folder: Path = Path()) -> Self:
        """The scene that a TOML describes; SceneError with all its faults, and for a line."""
        if "contact" in parse_toml(text):
            raise SceneError([OF_ONE_SPAN])
        return super().from_toml(text, name=name, folder=folder)

    def _toml_tables(self, replaced_keys: Container[str] = ()) -> dict[str, Any]:
        brief = {"mass", "drive", "wind", "obstacle", "ground", "limits"}
        data = self.model_dump(exclude_none=True, exclude=brief)
        data |= self.model_dump(exclude_none=True, exclude_defaults=True, include=brief)
        for table, name in (("travel", "rest"), ("cable", "damping")):
            if not data.get(table, {}).get(name, 1.0):
                del data[table][name]
        if any(f"cable.{shape}" in replaced_keys for shape in SHAPES):
            data["cable"] = {k: x for k, x in data["cable"].items() if k not in SHAPES}
        return data

    @classmethod
    def from_groups(
        cls, *, sag_ratio: float, alpha: float, slope: float = 0.0, mu: float | None = None,
        speed_ratio: float | None = None, travel: str = "constant_speed", span: float = 1000.0, rho: float = 5.0,
        gravity: float = 9.81, name: str = "scene",
    ) -> Self:  # fmt: skip
        """The SI scene with these groups; a bare cable without mu and speed_ratio.

        slope : of the chord [degrees], positive: falls to the right. travel : one of PACES.
        """
        data: dict[str, Any] = {"supports": {"span": span, "drop": span * math.tan(math.radians(slope))}}
        if mu is not None:
            data["mass"] = Mass(mass=1.0)
        if speed_ratio is not None:
            data["travel"] = {"kind": travel, PACES.get(travel, "speed"): 1.0}
        cable = Cable(mass_per_length=rho, EA=LARGE, sag=sag_ratio * span)
        return cls(name=name, gravity=gravity, cable=cable, **data).variant(mu=mu, alpha=alpha, speed_ratio=speed_ratio)

    def variant(
        self, *, sag_ratio: float | None = None, mu: float | None = None, alpha: float | None = None,
        speed_ratio: float | None = None, **fields: Any,
    ) -> Self:  # fmt: skip
        """This scene with other groups and whole fields (name, travel, ...); all else stays in SI.

        A cable with temperature or ice is then described by its horizontal tension; one with E gets another section
        with another alpha.
        """
        scene = self
        if self.cable.has_heat_or_ice and (sag_ratio, mu, alpha) != (None, None, None):
            scene = scene._cold_with_shape(horizontal_tension=scene.horizontal_tension)
        if sag_ratio is not None:
            scene = scene._cold_with_shape(sag=sag_ratio * scene.supports.span)
        if alpha is not None:
            cable = scene.cable
            changes = {"EA": alpha * scene.horizontal_tension}
            if cable.E is not None:
                section = changes["EA"] / cable.E
                changes = {"section": section, "EA": cable.E * section}  # to rounding, so that it follows both
            fields["cable"] = cable.model_copy(update=changes)
        if mu is not None:
            mass = mu * scene.rho * scene.length
            fields["mass"] = Mass(mass=mass) if scene.mass is None else scene.mass.model_copy(update={"mass": mass})
        if speed_ratio is not None:
            fields["travel"] = scene._travel_with_speed_ratio(speed_ratio)
        return scene.model_copy(update=fields)

    def _travel_with_speed_ratio(self, speed_ratio: float) -> Any:
        """The travel so much faster that it has this speed ratio."""
        if self.travel is None or self.speed_ratio is None:
            why = "a bare cable has no travel, a free ride finds its own"
            raise SceneError([f"speed_ratio = {speed_ratio!r}: {why}"])
        return self.travel.faster(speed_ratio / self.speed_ratio)

    def _cold_with_shape(self, **shape: float) -> Self:
        """This scene, without temperature and ice, hung otherwise."""
        gone = {*SHAPES, "temperature", "reference_temperature", "expansion", "ice"}
        cable = {**self.cable.model_dump(exclude=gone), "mass_per_length": self.rho, **shape}
        return self.model_copy(update={"cable": cable})

    @cached_property
    def catenary(self) -> Catenary:
        """The static cable, eqs (9)-(12)."""
        return catenary_with_heat_and_ice(self.gravity, self.cable, self.supports)

    @property
    def reference_catenary(self) -> Catenary:
        """The static cable without heat and ice."""
        return reference_catenary(self.gravity, self.cable, self.supports)

    @property
    def notes(self) -> list[str]:
        """Remarks on values left out or probably mistaken."""
        drive = self.drive
        notes = []
        if drive.mode == "free" and not (drive.rolling_friction or drive.drag_area):
            notes.append("no friction, no drag given: the fastest possible ride")
        if abs(drive.wind) > 40.0:  # m/s
            kmh = drive.wind / 3.6
            notes.append(f"drive.wind = {drive.wind:g} m/s is a hurricane; were km/h meant? ({kmh:.3g} m/s)")
        return notes + self.cable.notes

    @property
    def rho(self) -> float:
        """Mass per stretched static length [kg/m], with ice and temperature."""
        return self.catenary.weight / self.gravity if self.cable.has_heat_or_ice else self.cable.mass_per_length

    @property
    def length(self) -> float:
        """l [m], stretched static arc length."""
        return self.catenary.length

    @property
    def horizontal_tension(self) -> float:
        """H = T x' [N], eq. (9); the paper's T_o."""
        return self.catenary.horizontal_tension

    @property
    def sag(self) -> float:
        """Largest vertical distance below the chord [m]."""
        return self.catenary.sag

    @property
    def sag_ratio(self) -> float:
        """sag/span [-]."""
        return self.sag / self.supports.span

    @property
    def chord(self) -> float:
        """Distance of the supports [m]."""
        return self.catenary.chord

    @property
    def slope(self) -> float:
        """atan(h/b) [degrees]; positive: falls to the right."""
        return math.degrees(math.atan2(self.supports.drop, self.supports.span))

    @property
    def mu(self) -> float:
        """M/(rho l) [-]; 0 without a mass."""
        return 0.0 if self.mass is None else self.mass.mass / (self.rho * self.length)

    @property
    def alpha(self) -> float:
        """EA/H [-]."""
        return self.cable.EA / self.horizontal_tension

    @property
    def sigma(self) -> float:
        """rho g l/H [-]."""
        return self.catenary.sigma

    @property
    def irvine(self) -> float:
        """L^2 = sigma^2 alpha cos^5(slope) [-], Irvine, Cable Structures (1981), 2.4."""
        return self.catenary.irvine(self.cable.EA)

    @property
    def damping(self) -> float:
        """c_d [1/s]: `cable.damping` and a crosswind's part."""
        return sum(own_and_wind_damping_rates(*self._damping_arguments))

    @property
    def damping_ratio(self) -> float:
        """c_d over critical damping of the first mode of the empty cable [-]."""
        return 0.5 * self.damping / first_angular_frequency(self.catenary, self.cable.EA, self.gravity)

    @property
    def crosswind_force_per_length(self) -> float:
        """Mean force of the wind across the line on the cable [N/m]; 0 without."""
        return 0.0 if self.wind is None else self.wind.force_per_length(self.cable.diameter_with_ice)

    @property
    def wind_tilt(self) -> float | None:
        """Tilt [deg] of the empty cable's plane by a steady crosswind, or None."""
        if self.wind is None:
            return None
        return math.degrees(math.atan(self.crosswind_force_per_length / self.catenary.weight))

    @property
    def wave_speed(self) -> float:
        """sqrt(H/rho) [m/s], of transverse waves at the lowest point."""
        return math.sqrt(self.horizontal_tension / self.rho)

    @property
    def axial_speed(self) -> float:
        """sqrt(EA/rho) [m/s], of longitudinal waves."""
        return math.sqrt(self.cable.EA / self.rho)

    @property
    def time_scale(self) -> float:
        """l sqrt(rho/H) [s], the unit of time."""
        return self.length / self.wave_speed

    @property
    def top_speed(self) -> float | None:
        """Largest speed [m/s], of a free car quasi-static; None without a car."""
        if self.ride is not None:
            return self.ride.top_speed * self.wave_speed
        return None if self._motion_of_travel is None else self._motion_of_travel.top_speed

    @property
    def speed_ratio(self) -> float | None:
        """`top_speed` over sqrt(H/rho) [-]."""
        return None if self.top_speed is None else self.top_speed / self.wave_speed

    @property
    def arrival_time(self) -> float | None:
        """End of the ride [s], of a free car quasi-static; None without a car."""
        if self.ride is not None:
            return self.ride.duration * self.time_scale
        return None if self._motion_of_travel is None else self._motion_of_travel.end_time

    arrival = arrival_time  # its name in 0.3.0

    @cached_property
    def _motion_of_travel(self) -> Motion | None:
        """The travel in m and s, of a hauled car up to the end of its drive; None without a travel."""
        if self.travel is None:
            return None
        begin, distance = _travel_start_and_distance(self.travel, self.drive, self.length)
        motion = self.travel.motion(distance, begin)
        if self.drive.mode != "haul":
            return motion
        end = self.drive.end_position(self.length)
        if motion.end_position > end:
            motion = replace(motion.cut_at(motion.time_at_position(end)), end_position=end)
        return motion if self.drive.end is None else motion.cut_at(self.drive.end.time or math.inf)

    @property
    def ride(self) -> Ride | None:
        """The quasi-static ride of a free car, dimensionless, or None."""
        return None if self._free_ride_and_drive is None else self._free_ride_and_drive[0]

    @cached_property
    def _free_ride_and_drive(self) -> tuple[Ride, Drive] | None:
        if self.drive.mode != "free":
            return None
        try:
            return ride_and_completed_drive(self._groups_with(None, GRIP), self._dimensionless_drive)
        except NoRest as error:
            raise SceneError([f"drive.mode = 'free': {error}"]) from None

    @property
    def _dimensionless_drive(self) -> Drive:
        """The drive of a car that rolls."""
        return self.drive.in_units(self.length, self.time_scale, self.horizontal_tension, self.rho)

    @cached_property
    def groups(self) -> Groups:
        """The scene in dimensionless form."""
        motion = (
            None if self._motion_of_travel is None else self._motion_of_travel.in_units(self.length, self.time_scale)
        )
        if self._free_ride_and_drive is not None:
            return self._groups_with(motion, self._free_ride_and_drive[1])
        if motion is None or self.drive.mode == "grip":
            return self._groups_with(motion, GRIP)
        end = motion.end_time
        drive = replace(
            self._dimensionless_drive,
            start=motion.start_position,
            end_time=end,
            end_position=motion.end_position,
            nominal=end,
        )
        return self._groups_with(motion, drive)

    def _groups_with(self, motion: Motion | None, drive: Drive) -> Groups:
        cos = self.supports.span / self.chord
        sin = self.supports.drop / self.chord
        damping = self.damping * self.time_scale
        return Groups(self.mu, self.alpha, self.sigma, self.catenary.c, cos, sin, motion, drive, damping)

    def __str__(self) -> str:
        lines = [
            self._headline,
            f"  cable   l = {self.length:.6g} m, sag {self.sag:.4g} m ({self.sag_ratio:.3g} of the span), "
            f"H = {self.horizontal_tension:.4g} N, rho = {self.rho:.4g} kg/m, EA = {self.cable.EA:.4g} N",
            f"  chord   span {self.supports.span:.6g} m, drop {self.supports.drop:.4g} m, slope {self.slope:.3g} deg",
        ]
        if self.damping:
            wind = "" if self.wind is None else f", crosswind tilts it by {self.wind_tilt:.3g} deg"
            lines += [f"  damping {self.damping:.4g} 1/s, {self.damping_ratio:.2%} of critical in the first mode{wind}"]
        groups = f"sigma = {self.sigma:.5g}, alpha = {self.alpha:.5g}, Irvine L^2 = {self.irvine:.4g}"
        if self.mass is not None:
            how = "rolls freely" if self.travel is None else self.travel.kind
            by = "" if self.ride is None else " (quasi-static)"
            pace = f"up to {self.top_speed:.4g} m/s, {self.arrival_time:.4g} s"
            lines += [f"  mass    {self.mass.mass:.5g} kg, {how}, {pace}{by}", f"  drive   {self.drive}"]
            groups = f"mu = {self.mu:.4g}, {groups}, V/c = {self.speed_ratio:.3g}"
        return "\n".join([*lines, f"  groups  {groups}"])


def _mass_or_travel_faults(mode: DriveMode, present: list[str]) -> list[str]:
    """Faults of tables [mass] and [travel] that a mode of drive lacks or does not take; present : those written."""
    if mode == "free":
        faults = [] if "mass" in present else ["mass: missing; must be given with drive.mode = 'free'"]
        if "travel" in present:
            faults.append("travel: too much beside drive.mode = 'free', whose travel is an answer; leave it out")
        return faults
    if mode == "haul" and not present:
        return ["mass: missing; must be given, and [travel] too, with drive.mode = 'haul'"]
    if len(present) == 1:
        absent = "travel" if present == ["mass"] else "mass"
        return [f"{absent}: missing; must be given with [{present[0]}] (a bare cable has neither)"]
    return []


def _travel_fault(travel: Any, drive: Driving, length: float, axial_speed: float) -> str:
    """What is wrong with a travel on a cable with this length [m] and axial wave speed [m/s]; empty if nothing is."""
    begin, distance = _travel_start_and_distance(travel, drive, length)
    near = NEAREST_START * length
    end = begin + distance
    if travel.position is not None:
        value = f"travel.from = {travel.position!r}"
        if drive.mode == "haul" and drive.start is not None:
            return f"{value}: too much beside drive.start = {drive.start!r}; give one of them"
        if not near <= begin < end:
            return f"{value}: must be from {near:.6g} m to less than {end:.6g} m, the end of the travel"
    to = getattr(travel, "to", None)
    farthest = drive.end_position(length) if drive.mode == "haul" else length
    if to is not None and to > farthest:
        return f"travel.to = {to!r}: must be at most {farthest:.6g} m, the end of the ride"
    if fault := travel.fault_on_cable(distance, begin, length):
        return f"travel.{fault}"
    top = travel.motion(distance).top_speed
    if top >= axial_speed:
        waves = "the speed sqrt(EA/rho) of longitudinal waves"
        return f"travel: reaches {top:.6g} m/s; must stay < {axial_speed:.6g} m/s, {waves}"
    return ""


def _travel_start_and_distance(travel: Any, drive: Driving, length: float) -> tuple[float, float]:
    """Where the travel begins and the distance of its law, both [m]."""
    begin = 0.0
    end = length
    if drive.mode == "haul":
        begin = drive.start_position(length)
        end = drive.end_position(length)
    if travel.position is not None:
        begin = travel.position
    if isinstance(travel, Table):  # its positions are checked against the cable
        return begin, length if drive.mode == "haul" else length - begin
    return begin, (getattr(travel, "to", None) or end) - begin
