"""Free heights of rope and car over obstacles and ground.  Depths are in metres below the left support."""

from typing import NamedTuple

import numpy as np

from cablefem.response import Array, Response
from cablefem.scene import Scene
from cablefem.scene.line import Line
from cablefem.scene.surroundings import GROUND


def rope_shapes(r: Response) -> tuple[Array, Array, Array]:
    """x, y [m], tension [N] of the rope with the mass at each frame, (k, m + 1) each."""
    from scipy.interpolate import CubicSpline  # slow to load

    f = r.fields
    x = f.x + f.u
    y = f.y + f.v
    # between two stations the rope at rest is a cubic: a chord would lift the mass off a deep rope
    rest_curve = CubicSpline(f.s, np.stack([f.x, f.y], axis=1))
    mass = rest_curve(f.s_o) + np.stack([f.mass_u, f.mass_v], axis=1)  # (k, 2)
    at_mass = np.fmax(f.T_behind, f.T_ahead)
    s = np.concatenate([np.broadcast_to(f.s, x.shape), f.s_o[:, None]], axis=1)
    order = np.argsort(s, axis=1, kind="stable")
    parts = (np.c_[x, mass[:, 0]], np.c_[y, mass[:, 1]], np.c_[f.T, at_mass])
    return tuple(np.take_along_axis(part, order, axis=1) for part in parts)  # type: ignore[return-value]


class Track(NamedTuple):
    """A signal at one place, (n,), or along the cable, value (n, m) and s (m,)."""

    t: Array  # [s]
    value: Array
    s: Array  # [m] on the rope


def obstacle_profiles(scene: Scene | Line) -> dict[str, Array]:
    """What the ride must clear, each as points [x, depth], (n, 2)."""
    found = {o.name: np.array([[o.at, o.top]]) for o in scene.obstacle}
    return found | ({GROUND: np.array(scene.ground, float)} if scene.ground else {})


Clearances = dict[tuple[str, str], Track]


def clearance_tracks(scene: Scene, r: Response) -> Clearances:
    """Free heights [m] of "rope" and "car" above each obstacle and the ground; negative: it hits; nan: unknown.

    Empty where the car never passes.  An obstacle is a ground of one point.
    """
    below = 0.0 if scene.mass is None else scene.mass.below
    rooms = {}
    for name, ground in obstacle_profiles(scene).items():
        at_car = _height_of_car(r, ground)
        rooms["rope", name] = _joined_by_time(at_car, _min_height_of_rope(r, ground))
        rooms["car", name] = at_car._replace(value=at_car.value - below)
    return rooms


def _joined_by_time(*parts: tuple[Array, ...]) -> Track:
    """Join (times, heights, places) in order of time."""
    t, height, s = (np.concatenate(x) for x in zip(*parts, strict=True))
    order = np.argsort(t, kind="stable")
    return Track(t[order], height[order], s[order])


def _height_of_car(r: Response, ground: Array) -> Track:
    """Height of the rope at the car over the ground (n, 2) [x, depth], at steps and at the ground's points."""
    over = (r.x > ground[0, 0]) & (r.x < ground[-1, 0])
    parts = [(r.t[over], np.interp(r.x[over], *ground.T) - r.y[over], r.s_o[over])]
    for x, depth in ground:
        i = np.flatnonzero((r.x[:-1] < x) != (r.x[1:] < x))
        w = (x - r.x[i]) / (r.x[i + 1] - r.x[i])
        t, y, s_o = (of[i] + w * (of[i + 1] - of[i]) for of in (r.t, r.y, r.s_o))
        parts.append((t, depth - y, s_o))
    return _joined_by_time(*parts)


def _min_height_of_rope(r: Response, ground: Array) -> Track:
    """Least height of the rope over the ground at each frame; nan outside."""
    at, y, _ = rope_shapes(r)
    heights = np.full(len(at), np.nan)
    s = np.full(len(at), np.nan)
    for k, (a, b) in enumerate(zip(at, y, strict=True)):
        x = np.union1d(a, ground[:, 0])
        x = x[(x >= max(a[0], ground[0, 0])) & (x <= min(a[-1], ground[-1, 0]))]
        if x.size:
            free = np.interp(x, *ground.T) - np.interp(x, a, b)
            heights[k] = free.min()
            s[k] = np.interp(x[free.argmin()], r.fields.x, r.fields.s)
    return Track(r.fields.t, heights, s)
