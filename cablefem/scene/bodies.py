"""What hangs on a contact of a car or stands on two; equations: `elements/bodies.py`, `elements/trolley.py`."""

from __future__ import annotations

import math
from typing import Literal

from cablefem.scene.drive import Driving, Thrust
from cablefem.scene.fields import NonNegative, Part, Positive, Real, described


class Hanger(Part):
    """A cabin that swings below the carriage; its mass is part of the car's."""

    mass: Positive = described("[kg] mass that swings, of the car's mass")
    length: Positive = described("[m] from the rope to the centre of mass of the cabin")
    gyration: NonNegative = described("[m] radius of gyration of the cabin about its centre of mass", 0.0)
    damping: NonNegative = described("[-] damping ratio of the swing", 0.0)

    @property
    def inertia(self) -> float:
        """J [kg m2] about the cabin's centre of mass."""
        return self.mass * self.gyration**2

    def resistance(self, gravity: float) -> float:
        """c [N m s] of the moment - c dphi/dt."""
        about_hinge = self.inertia + self.mass * self.length**2
        return 2.0 * self.damping * math.sqrt(about_hinge * self.mass * gravity * self.length)


class Wheels(Part):
    """Two wheels of a rigid car; the front one is to the right."""

    base: Positive = described("[m] between the wheels")
    inertia: Positive = described("[kg m2] moment of inertia of the car about its centre of mass")
    below: Real = described("[m] from the line of the wheels down to the centre of mass", 0.0)
    ahead: Real = described("[m] of the centre of mass ahead of the middle between the wheels", 0.0)
    model: Literal["rigid", "point"] = described("[-] rigid: two wheels touch the rope; point: one does", "rigid")


def body_faults(mass: float | None, hanger: Hanger | None, wheels: Wheels | None, drive: Driving | None) -> list[str]:
    """Faults between the tables of one car."""
    if hanger is not None and wheels is not None:
        return ["hanger: too much beside wheels; must be one of both"]
    if hanger is not None and mass is not None and hanger.mass >= mass:
        return [f"hanger.mass = {hanger.mass!r}: must be < {mass:.6g} kg, the mass of the car with it"]
    rigid = wheels is not None and wheels.model == "rigid"
    if drive is None or rigid:
        return []
    thrust = drive.thrust if isinstance(drive.thrust, Thrust) else None
    written = {
        "hitch": drive.hitch is not None,
        "thrust.angle": thrust is not None and bool(thrust.angle),
        "thrust.at": thrust is not None and thrust.at is not None,
        "brake.wheel": any(brake.wheel != "both" for brake in drive.brake or ()),
    }
    given = [name for name, is_written in written.items() if is_written]
    return [f"drive.{name}: of a car on two wheels; must be given with wheels" for name in given]
