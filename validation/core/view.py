from __future__ import annotations

import math
from dataclasses import dataclass, replace

from cablefem.response import MassPath
from cablefem.scene import Scene
from validation.core.measures import WINDOWS, Window, common_window, relative_position_where_mass_outruns_waves


@dataclass(frozen=True, slots=True)
class View:
    """What is compared of one scene.

    axis : "place"; "time" for a ride, or a travel with a standstill.
    window : range of s_o/l.  until : [s] end of a ride's comparison; else infinite.
    free : the travel is an answer;  rolls : friction and contact matter.
    """

    axis: str
    window: Window
    free: bool
    reaches_end: bool  # to the end of the travel, with rest
    rolls: bool
    length: float  # [m]
    H: float  # horizontal tension [N]
    weight: float  # of the car [N]
    top_speed: float  # of the travel [m/s]; 0 of a ride
    axial_round_trip: float  # of a wave in the cable [s]
    until: float = math.inf

    @classmethod
    def of_scene(cls, scene: Scene) -> View:
        """The view of a scene, over its whole window."""
        assert scene.mass is not None
        motion = scene.groups.motion
        low, high = WINDOWS[scene.drive.mode]
        axis = "time"
        top_speed = 0.0
        reaches_end = True
        if motion is not None:
            if not motion.standstill_phases:
                axis = "place"
            top_speed = motion.top_speed * scene.length / scene.time_scale
            reaches_end = motion.end_position < high
            high = min(high, motion.end_position)
        return cls(
            axis=axis, window=(low, high), free=motion is None, reaches_end=reaches_end,
            rolls=scene.drive.mode != "grip", length=scene.length, H=scene.horizontal_tension, top_speed=top_speed,
            weight=scene.mass.mass * scene.gravity, axial_round_trip=2.0 * scene.length / scene.axial_speed,
        )  # fmt: skip

    @property
    def last_needed_relative_position(self) -> float | None:
        """s_o/l where coarser runs may end; None: the travel's end."""
        return None if self.reaches_end else self.window[1]

    def cut_where_mass_outruns_waves(self, *finest: MassPath) -> View:
        """The view up to where waves get slower than the mass and steepen: no bar holds from there on."""
        low, high = self.window
        return replace(self, window=(low, min(high, *map(relative_position_where_mass_outruns_waves, finest))))

    def cut_to_valid_range(self, *finest: MassPath) -> View:
        """The view up to steep waves, or where a finest run ends or goes slack; NotComparable if nothing is left."""
        until = min(float(r.t[-1]) for r in finest) if self.free else self.until
        window = self.cut_where_mass_outruns_waves(*finest).window
        return replace(self, window=common_window(*finest, window=window), until=until)

    def is_reached_by(self, r: MassPath) -> bool:
        """Whether a run reaches the end of the comparison."""
        if self.free:
            return r.status == "complete" or bool(r.t[-1] >= self.until)
        return r.reached >= self.window[1] * (1.0 - 1e-6)
