"""How the answers of one scene are compared: over which axis and range, and on which scales."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from cablefem.response import MassPath
from cablefem.scene import Scene
from validation.core.measures import WINDOWS, NotComparable, Window


@dataclass(frozen=True, slots=True)
class View:
    """What is compared of one scene.

    axis : "place" for a travel that only goes forward; "time" for a ride, or a travel that stands still on its way.
    window : s_o/l from which and to which is compared; (0, 1) of a ride.
    until : [s] to which is compared; of a ride where the shorter finest run ends, else infinite.
    free : whether the travel is an answer; rolls : whether the car rolls, so that friction and contact matter.
    """

    axis: str
    window: Window
    free: bool
    ends: bool  # whether it is compared to the end of the travel, rest after a stop included
    rolls: bool
    length: float  # [m]
    H: float  # horizontal tension [N]
    weight: float  # of the car [N]
    top: float  # largest speed of the travel [m/s]; 0 of a ride, which tells it
    axial: float  # time [s] of an axial wave along the cable and back
    until: float = math.inf

    @classmethod
    def of(cls, scene: Scene) -> View:
        """Return the view of a scene with a mass."""
        assert scene.mass is not None
        motion, (low, high) = scene.groups.motion, WINDOWS[scene.drive.mode]
        stops = motion is not None and motion.end < high
        high = motion.end if motion is not None and stops else high
        return cls(
            axis="time" if motion is None or motion.standstills else "place", window=(low, high),
            free=motion is None, ends=motion is None or stops,
            rolls=scene.drive.mode != "grip", length=scene.length, H=scene.horizontal_tension,
            top=0.0 if motion is None else motion.top_speed * scene.length / scene.time_scale,
            weight=scene.mass.mass * scene.gravity, axial=2.0 * scene.length / scene.axial_speed,
        )  # fmt: skip

    @property
    def stop(self) -> float | None:
        """s_o/l beyond which coarser runs need not go; None where the travel is compared to its end."""
        return None if self.ends else self.window[1]

    def cut(self, *finest: MassPath) -> View:
        """Return the view cut where one of the finest runs ends, or has a slack cable.

        Raises NotComparable where nothing is left.
        """
        low, high = self.window
        slack = [r.slack_onset for r in finest if r.slack_onset is not None]
        stop = min([high, *slack, *(() if self.free else (r.reached for r in finest))])
        until = min(float(r.t[-1]) for r in finest) if self.free else self.until
        if not stop > low:
            short = min(finest, key=lambda r: min(r.reached, math.inf if r.slack_onset is None else r.slack_onset))
            what = "ends" if short.slack_onset is None else "is slack"
            raise NotComparable(f"nothing to compare: {short.method} {what} at s_o/l = {stop:.4f}, before {low:g}")
        return replace(self, window=(low, stop), until=until)

    def covers(self, r: MassPath) -> bool:
        """Return whether a coarser run goes as far as is compared; a ride that ends well is complete."""
        if self.free:
            return r.status == "complete" or bool(r.t[-1] >= self.until)
        return r.reached >= self.window[1] * (1.0 - 1e-6)
