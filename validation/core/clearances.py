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


Clearances = dict[tuple[str, str], list[Track]]  # by "rope" or "car", and by name of what is cleared


def clearance_tracks(scene: Scene, r: Response) -> Clearances:
    """Free heights [m] of "rope" and "car" above each obstacle and the ground; negative: it hits; nan: unknown.

    Of the rope at the car, empty where that never passes, and at its lowest in each frame.
    An obstacle is a ground of one point.
    """
    below = 0.0 if scene.mass is None else scene.mass.below
    f = r.fields
    frames = rope_and_mass_at_frames(r)
    rope = np.stack([frames.x, frames.y], axis=2)  # (k, m + 1, 2)
    support_x = 0.0, scene.supports.span
    tracks = {}
    for name, ground in obstacle_and_ground_profiles(scene).items():
        at_car = heights_along_path(r.t, r.x, r.y, r.s_o, ground)
        heights, x = min_rope_heights(rope, ground, support_x)
        of_rope = Track(f.t, np.where(np.isinf(heights), np.nan, heights), np.interp(x, f.x, f.s))
        tracks["rope", name] = [at_car, of_rope]
        tracks["car", name] = [at_car._replace(value=at_car.value - below)]
    return tracks


def heights_along_path(t: Array, x: Array, y: Array, s: Array, ground: Array) -> Track:
    """Heights of a path (n,) over a ground (m, 2) [x, depth]: at points and where it passes a corner.

    s : positions along the rope.
    """
    corners, depth = ground.T
    path = np.stack([t, x, y, s])  # (4, n)
    parts = [path[:, (x >= corners[0]) & (x <= corners[-1])]]
    for corner in corners:
        left = x < corner
        i = np.flatnonzero(left[:-1] != left[1:])  # steps before it passes the corner
        w = (corner - x[i]) / (x[i + 1] - x[i])
        parts.append(path[:, i] + w * (path[:, i + 1] - path[:, i]))
    times, at, y_at, s_at = np.concatenate(parts, axis=1)
    order = np.argsort(times, kind="stable")
    return Track(*(values[order] for values in (times, np.interp(at, corners, depth) - y_at, s_at)))


def min_rope_heights(rope: Array, ground: Array, support_x: tuple[float, float]) -> tuple[Array, Array]:
    """Smallest height (n,) [m] of a rope (n, k, 2) over the ground (m, 2), and its x: at a corner of either; or inf.

    support_x : x of the supports; ground beyond them is not beneath the rope.
    """
    corners, depth = ground.T
    x, y = np.moveaxis(rope, 2, 0)  # (n, k)
    over = (x >= corners[0]) & (x <= corners[-1])
    at_points = np.where(over, np.interp(x, corners, depth) - y, np.inf)
    beneath = (corners >= support_x[0]) & (corners <= support_x[1])
    at_corners = depth[beneath] - rope_depths(rope, corners[beneath])  # (n, corners)
    heights = np.concatenate([at_points, at_corners], axis=1)
    positions = np.concatenate([x, np.broadcast_to(corners[beneath], at_corners.shape)], axis=1)
    lowest = heights.argmin(axis=1)[:, None]
    return np.take_along_axis(heights, lowest, axis=1)[:, 0], np.take_along_axis(positions, lowest, axis=1)[:, 0]


def rope_depths(points: Array, x: Array) -> Array:
    """Depths (n, k) [m] at x (k,) [m] of the rope through points (n, m, 2)."""
    depths = [np.interp(x, *at_one_time.T) for at_one_time in points]
    return np.reshape(depths, (len(points), x.size))
