"""Numbers that the claims speak of, each from one response, or from one and its reference."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, RegularGridInterpolator
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core import measures

READINGS = ("v", "y + v")  # "path" may mean the displacement of the mass or its place
LATEST = 0.83  # s_o/l: the level cable goes slack from there on


def series(r: Response, reading: str) -> Array:
    """Return the path in one of its READINGS, (n,) [m], positive downward."""
    return r.v if reading == "v" else r.y


def extrema(r: Response, reading: str) -> list[tuple[float, str, float]]:
    """Return (s_o/l, "max" | "min", value) of every turning point; downward is positive.

    Turns shallower than half a percent of the largest value do not count.
    """
    curve, places = _level_places(r, reading, 0.05, LATEST)
    values = curve(places)
    deep = 0.005 * np.abs(curve(np.linspace(0.05, LATEST, 4000))).max()
    found = [
        (float(places[i]), kind, float(values[i]))
        for sign, kind in ((1.0, "max"), (-1.0, "min"))
        for i in find_peaks(sign * values, prominence=deep)[0]
    ]
    return sorted(found)


def _level_places(r: Response, reading: str, start: float, end: float) -> tuple[CubicSpline, Array]:
    """Return the path as a function of s_o/l, and where it may be extreme between two places, both included."""
    curve = CubicSpline(r.s_o / r.length, series(r, reading))
    roots = curve.derivative().roots(extrapolate=False)
    return curve, np.array([start, *roots[(roots > start) & (roots < end)], end])


def place_of(r: Response, reading: str, near: float, kind: str | None = None) -> float:
    """Return s_o/l of the turning point nearest to a place; nan without any."""
    places = [s for s, k, _ in extrema(r, reading) if kind in (None, k)]
    return min(places, key=lambda s: abs(s - near), default=float("nan"))


def place_of_largest(r: Response, reading: str, end: float = LATEST) -> float:
    """Return s_o/l where the path is lowest, up to `end`."""
    curve, places = _level_places(r, reading, 0.0, min(end, r.reached))
    return float(places[np.argmax(curve(places))])


def largest(r: Response, reading: str, end: float = LATEST) -> float:
    """Return the largest value of the path [m], up to `end`."""
    return float(series(r, reading)[r.s_o <= end * r.length].max())


def frames(r: Response, low: float, high: float) -> slice:
    """Return the frames with s_o/l in [low, high]."""
    inside = np.flatnonzero((r.fields.s_o >= (low - 1e-9) * r.length) & (r.fields.s_o <= (high + 1e-9) * r.length))
    return slice(int(inside[0]), int(inside[-1]) + 1)


def tension_level(r: Response) -> tuple[Array, Array]:
    """Return s_o/l and the median tension along the cable over H of every frame."""
    return r.fields.s_o / r.length, np.median(r.fields.T_pointwise, axis=1) / r.horizontal_tension


def highest_tension(r: Response) -> float:
    place, level = tension_level(r)
    return float(level[place <= 0.5].max())


def tension_spread(r: Response, low: float, high: float) -> float:
    """Return how far the median tension departs from its mean over those frames, relative to the mean."""
    level = tension_level(r)[1][frames(r, low, high)]
    return float(np.abs(level / level.mean() - 1.0).max())


def unevenness(r: Response, low: float, high: float, *, sides: bool = False, width: float = 0.05) -> float:
    """Return rms of T along the cable about its mean (of each side of the mass), over that mean: median over frames.

    Within `width` of the mass is left out.
    """
    return float(np.median(unevennesses(r, low, high, sides=sides, width=width)))


def unevennesses(r: Response, low: float, high: float, *, sides: bool = False, width: float = 0.05) -> Array:
    """Return the same for every frame with s_o/l in [low, high]."""
    out = []
    s = r.fields.s / r.length
    rows = frames(r, low, high)
    for row, s_o in zip(r.fields.T_pointwise[rows], r.fields.s_o[rows] / r.length, strict=True):
        away = np.abs(s - s_o) >= width
        parts = [away & (s < s_o), away & (s > s_o)] if sides else [away]
        out.append(np.mean([np.mean((row[p] / row[p].mean() - 1.0) ** 2) for p in parts if p.any()]))
    return np.sqrt(out)


def ripple(r: Response, reference: Response, near: float, far: float, window: tuple[float, float]) -> float:
    """Return rms of T - T_reference over H at stations whose distance from the mass lies in [near, far] l."""
    place, i, j = measures.common_frames(r, reference)
    inside = (place >= window[0]) & (place <= window[1])
    distance = np.abs(r.fields.s[None, :] / r.length - place[inside][:, None])
    gap = (r.fields.T_pointwise[i[inside]] - reference.fields.T_pointwise[j[inside]])[
        (distance >= near) & (distance <= far)
    ]
    return float(np.sqrt(np.mean((gap / reference.horizontal_tension) ** 2)))


def wiggle(r: Response, near: float, far: float, window: tuple[float, float]) -> float:
    """Return rms of T less its running mean over a tenth of the cable, over H; distances from the mass as in `ripple`.

    The mean stops at the mass, where T jumps.
    """
    s, half = r.fields.s / r.length, round(0.05 * (r.fields.s.size - 1))
    parts = []
    for row, s_o in zip(
        r.fields.T_pointwise[frames(r, *window)], r.fields.s_o[frames(r, *window)] / r.length, strict=True
    ):
        for side in (s < s_o, s > s_o):
            if np.count_nonzero(side) > 2 * half:
                fast = row[side] - uniform_filter1d(row[side], 2 * half + 1)
                distance = np.abs(s[side] - s_o)
                whole = slice(half, -half)  # where the mean has all its stations
                parts.append(fast[whole][(distance[whole] >= near) & (distance[whole] <= far)])
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)) / r.horizontal_tension)


def turns(r: Response, window: tuple[float, float]) -> float:
    """Return the number of crests and troughs of T along the cable deeper than 0.005 H, mean over frames."""
    rows = r.fields.T_pointwise[frames(r, *window)] / r.horizontal_tension
    return float(np.mean([sum(find_peaks(x * sign, prominence=0.005)[0].size for sign in (1, -1)) for x in rows]))


def tension_jump(r: Response, low: float, high: float) -> float:
    """Return the mean step of tension across the mass, ahead less behind, over H."""
    rows = frames(r, low, high)
    return float(np.mean(r.fields.T_ahead_pointwise[rows] - r.fields.T_behind_pointwise[rows]) / r.horizontal_tension)


def meeting(r: Response) -> float:
    """Return s_o/l at which the first wave meets the mass after its reflection at the far support.

    A transverse front runs at sqrt(N/rho), integrated through the computed tension from the entry on.
    """
    f = r.fields
    t = np.concatenate([[0.0], f.t])
    T = np.concatenate([np.ones_like(f.T_pointwise[:1]), np.maximum(f.T_pointwise, 0.0) / r.horizontal_tension])
    tension = RegularGridInterpolator((t, f.s / r.length), T)
    speed = 1.0 / Scene.from_toml(r.scene_toml).time_scale  # sqrt(H/rho)/l
    mass = CubicSpline(r.t, r.s_o / r.length)

    def front(t: float, x: Array) -> Array:
        s = 1.0 - abs(1.0 - x[0])  # unfolded at the far support
        return np.array([speed * np.sqrt(tension((min(t, f.t[-1]), np.clip(s, 0.0, 1.0))))]).ravel()

    def meets(t: float, x: Array) -> float:
        return 2.0 - x[0] - float(mass(t))

    meets.terminal = True  # type: ignore[attr-defined]
    done = solve_ivp(front, (0.0, float(f.t[-1])), [0.0], events=meets, rtol=1e-6, atol=1e-8, max_step=f.t[0])
    return float(mass(done.t_events[0][0])) if done.t_events[0].size else float("nan")
