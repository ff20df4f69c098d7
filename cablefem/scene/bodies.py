"""What hangs on a contact of a car or stands on two; equations: `elements/bodies.py`, `elements/trolley.py`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from cablefem.scene.drive import Driving, Thrust
from cablefem.scene.fields import NonNegative, Part, Positive, Real, described_field, integer_between


class Hanger(Part):
    """A cabin that swings below the carriage; its mass is part of the car's."""

    mass: Positive = described_field("[kg] mass that swings, of the car's mass")
    length: Positive = described_field("[m] from the rope to the centre of mass of the cabin")
    gyration: NonNegative = described_field("[m] radius of gyration of the cabin about its centre of mass", 0.0)
    damping: NonNegative = described_field("[-] damping ratio of the swing", 0.0)

    @property
    def inertia(self) -> float:
        """J [kg m2] about the cabin's centre of mass."""
        return self.mass * self.gyration**2

    def damping_moment_per_rate(self, gravity: float) -> float:
        """c [N m s] of the moment - c dphi/dt."""
        about_hinge = self.inertia + self.mass * self.length**2
        return 2.0 * self.damping * math.sqrt(about_hinge * self.mass * gravity * self.length)


class Wheels(Part):
    """Wheels of a rigid car, of which two touch the rope, the front one to the right; or of a point mass."""

    base: NonNegative = described_field("[m] between the wheels, or between two pairs of them; 0: one point", 0.0)
    inertia: NonNegative = described_field("[kg m2] moment of inertia of the car about its centre of mass", 0.0)
    below: Real = described_field("[m] from the line of the wheels down to the centre of mass", 0.0)
    ahead: Real = described_field("[m] of the centre of mass ahead of the middle between the wheels", 0.0)
    model: Literal["rigid", "point"] = described_field(
        "[-] rigid: the car touches the rope at two wheels; point: at one point, loads of wheels are by hand", "rigid"
    )
    count: Annotated[int, integer_between(1, 1000)] = described_field("[-] wheels of the car, which share its load", 2)
    radius: Positive | None = described_field(
        "[m] of a wheel, whose groove bounds how far the rope bends; with cable.wire", None
    )

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults between fields, one line each."""
        faults = []
        if self.model == "rigid":
            missing = [name for name in ("base", "inertia") if getattr(self, name) == 0.0]
            faults = [f"{' and '.join(missing)}: missing; must be > 0 unless model = 'point'"] if missing else []
        if self.base and self.count is not None and self.count % 2:
            faults.append(f"count = {self.count}: must be even, half of the wheels at either end of base")
        return faults


def body_faults(mass: float | None, hanger: Hanger | None, wheels: Wheels | None, drive: Driving | None) -> list[str]:
    """Faults between the tables of one car."""
    if hanger is not None and wheels is not None:
        return ["hanger: too much beside wheels; must be one of both"]
    if hanger is not None and mass is not None and hanger.mass >= mass:
        return [f"hanger.mass = {hanger.mass!r}: must be < {mass:.6g} kg, the mass of the car with it"]
    rigid = wheels is not None and wheels.model == "rigid"
    return [] if drive is None or rigid else _two_wheel_keys_of_point_car_faults(wheels, drive)


def _two_wheel_keys_of_point_car_faults(wheels: Wheels | None, drive: Driving) -> list[str]:
    """Faults of keys of two wheels in the drive of a point car."""
    written = _written_two_wheel_keys(drive)
    if wheels is not None and wheels.base:  # levers count in loads by hand
        return ["drive.thrust.angle: must be 0 with wheels.model = 'point'"] if "thrust.angle" in written else []
    return [f"drive.{name}: of a car on two wheels; must be given with wheels" for name in written]


def _written_two_wheel_keys(drive: Driving) -> list[str]:
    """Keys that only a car on two wheels has, as far as they are written."""
    written = ["hitch"] if drive.hitch is not None else []
    if isinstance(drive.thrust, Thrust):
        written += ["thrust.angle"] if drive.thrust.angle else []
        written += ["thrust.at"] if drive.thrust.at is not None else []
    if any(brake.wheel != "both" for brake in drive.brake or ()):
        written.append("brake.wheel")
    return written


def missing_wire_faults(wire_diameter: float | None, wheels: Wheels | None) -> list[str]:
    """Fault of a radius of wheels on a rope whose wires are unknown."""
    if wire_diameter is not None or wheels is None or wheels.radius is None:
        return []
    return [f"cable.wire: missing; must be given with wheels.radius = {wheels.radius!r}"]
