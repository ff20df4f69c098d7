"""Free heights of rope and car over obstacles and ground.  Depths are in metres below the left support."""

from typing import NamedTuple

import numpy as np

from cablefem.response import Array, Response
from cablefem.scene import Scene
from cablefem.scene.line import Line
from cablefem.scene.surroundings import GROUND


class RopeFrames(NamedTuple):
    """The rope with the mass at k frames: m stations and the mass, in order of s."""

    x: Array  # [m] (k, m + 1)
    y: Array
    tension: Array  # [N]


def rope_and_mass_at_frames(r: Response) -> RopeFrames:
    """Points and tension of the rope, at the mass the larger of both sides."""
    from scipy.interpolate import CubicSpline  # slow to load

    f = r.fields
    # between two stations the rope at rest is a cubic: a chord would lift the mass off a deep rope
    rest_curve = CubicSpline(f.s, np.stack([f.x, f.y], axis=1))
    mass = rest_curve(f.s_o) + np.stack([f.mass_u, f.mass_v], axis=1)  # (k, 2)
    s = np.c_[np.broadcast_to(f.s, f.u.shape), f.s_o]
    order = np.argsort(s, axis=1, kind="stable")

    def with_mass(of_rope: Array, of_mass: Array) -> Array:
        """(k, m + 1), in order of s."""
        return np.take_along_axis(np.c_[of_rope, of_mass], order, axis=1)

    x = with_mass(f.x + f.u, mass[:, 0])
    y = with_mass(f.y + f.v, mass[:, 1])
    return RopeFrames(x, y, with_mass(f.T, np.fmax(f.T_behind, f.T_ahead)))


class Track(NamedTuple):
    """A signal at one place, (n,), or along the cable, value (n, m) and s (m,)."""

    t: Array  # [s]
    value: Array
    s: Array  # [m] on the rope


def obstacle_and_ground_profiles(scene: Scene | Line) -> dict[str, Array]:
    """What the ride must clear by name, each as points [x, depth], (n, 2); an obstacle is one point."""
    profiles = {o.name: np.array([[o.at, o.top]]) for o in scene.obstacle}
    if scene.ground:
        profiles[GROUND] = np.array(scene.ground, float)
    return profiles


Clearances = dict[tuple[str, str], Track]  # by "rope" or "car", and by name of what is cleared


def clearance_tracks(scene: Scene, r: Response) -> Clearances:
    """Free heights [m] of "rope" and "car" above each obstacle and the ground; negative: it hits; nan: unknown.

    Empty where the car never passes.  An obstacle is a ground of one point.
    """
    below = 0.0 if scene.mass is None else scene.mass.below
    rope = rope_and_mass_at_frames(r)
    tracks = {}
    for name, ground in obstacle_and_ground_profiles(scene).items():
        at_car = _rope_height_at_car(r, ground)
        tracks["rope", name] = _merged_in_time_order(at_car, _min_rope_height_at_frames(r, rope, ground))
        tracks["car", name] = at_car._replace(value=at_car.value - below)
    return tracks


def _merged_in_time_order(*parts: tuple[Array, ...]) -> Track:
    """One track of several of times (n,), heights (n,) and positions s (n,), in order of time."""
    t, height, s = (np.concatenate(x) for x in zip(*parts, strict=True))
    order = np.argsort(t, kind="stable")
    return Track(t[order], height[order], s[order])


def _rope_height_at_car(r: Response, ground: Array) -> Track:
    """Height of the rope at the car over the ground (n, 2) [x, depth], at steps and at the ground's points."""
    over = (r.x > ground[0, 0]) & (r.x < ground[-1, 0])
    depth_of_ground = np.interp(r.x[over], *ground.T)
    parts = [(r.t[over], depth_of_ground - r.y[over], r.s_o[over])]
    for x, depth in ground:
        is_left = r.x < x
        i = np.flatnonzero(is_left[:-1] != is_left[1:])  # steps before the car passes x
        w = (x - r.x[i]) / (r.x[i + 1] - r.x[i])
        t, y, s_o = (series[i] + w * (series[i + 1] - series[i]) for series in (r.t, r.y, r.s_o))
        parts.append((t, depth - y, s_o))
    return _merged_in_time_order(*parts)


def _min_rope_height_at_frames(r: Response, rope: RopeFrames, ground: Array) -> Track:
    """Smallest height of the rope over the ground at each frame; nan where there is no ground below it."""
    heights = np.full(len(rope.x), np.nan)
    s = np.full(len(rope.x), np.nan)
    x_ground, depth = ground.T
    for k, (x_rope, y_rope) in enumerate(zip(rope.x, rope.y, strict=True)):
        corners = np.union1d(x_rope, x_ground)
        begin = max(x_rope[0], x_ground[0])
        end = min(x_rope[-1], x_ground[-1])
        x = corners[(corners >= begin) & (corners <= end)]
        if x.size:
            height = np.interp(x, x_ground, depth) - np.interp(x, x_rope, y_rope)
            lowest = height.argmin()
            heights[k] = height[lowest]
            s[k] = np.interp(x[lowest], r.fields.x, r.fields.s)
    return Track(r.fields.t, heights, s)
