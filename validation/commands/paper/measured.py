"""Measures that claims.toml names; tensions with s_o/l in MOVING by default."""

import math
from collections.abc import Iterator

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, RegularGridInterpolator
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from cablefem.response import Array, Response
from cablefem.scene import Groups, Scene
from galerkin.abscissa import PositionAbscissa
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.core import measures
from validation.oracles import irvine

MOVING = (0.1, 0.8)  # s_o/l
LATEST = 0.83  # s_o/l: beyond it the level cable goes slack


def extrema(r: Response, reading: str) -> list[tuple[float, str]]:
    """(s_o/l, "max" | "min") of every turning point; downward is positive.

    reading : "v", the displacement, or "y + v", the place.
    Turns shallower than half a percent of the largest value do not count.
    """
    curve, places = _level_places(r, reading, 0.05, LATEST)
    values = curve(places)
    deep = 0.005 * np.abs(curve(np.linspace(0.05, LATEST, 4000))).max()
    return sorted(
        (float(places[i]), kind)
        for sign, kind in ((1.0, "max"), (-1.0, "min"))
        for i in find_peaks(sign * values, prominence=deep)[0]
    )


def _level_places(r: Response, reading: str, start: float, end: float) -> tuple[CubicSpline, Array]:
    """The path over s_o/l, and where it may be extreme between two places, both included."""
    curve = CubicSpline(r.s_o / r.length, r.v if reading == "v" else r.y)
    roots = curve.derivative().roots(extrapolate=False)
    return curve, np.array([start, *roots[(roots > start) & (roots < end)], end])


def turn(r: Response, reading: str, near: float, kind: str | None = None) -> float:
    """s_o/l of the nearest turning point; nan without any."""
    places = [s for s, k in extrema(r, reading) if kind in (None, k)]
    return min(places, key=lambda s: abs(s - near), default=math.nan)


def lowest(r: Response, reading: str, end: float = LATEST) -> float:
    curve, places = _level_places(r, reading, 0.0, min(end, r.reached))
    return float(places[np.argmax(curve(places))])


def depth(r: Response, reading: str, end: float = LATEST) -> float:
    """Largest value of the path [m], up to `end`."""
    return float((r.v if reading == "v" else r.y)[r.s_o <= end * r.length].max())


def apart(a: Response, b: Response) -> float:
    """Largest distance of two paths over the largest deflection of the second."""
    return measures.path_gap(a, b, measures.WINDOW)[0]


def unaccounted(r: Response, whole: bool = True) -> float:
    """Energy gained without work, over weight times largest displacement; whole : with M g y(s_o)."""
    scene = Scene.from_toml(r.scene_toml)
    assert scene.mass is not None
    weight = scene.mass.mass * scene.gravity
    defect = measures.energy_defect(r) + (0.0 if whole else weight * (r.y - r.v))
    return float(np.abs(defect[measures.inside(r, measures.WINDOW)]).max() / (weight * r.max_deflection))


def frames(r: Response, low: float, high: float) -> slice:
    """Frames with s_o/l in [low, high]."""
    inside = np.flatnonzero((r.fields.s_o >= (low - 1e-9) * r.length) & (r.fields.s_o <= (high + 1e-9) * r.length))
    return slice(int(inside[0]), int(inside[-1]) + 1)


def moving(r: Response) -> Iterator[tuple[Array, float]]:
    """The tension along the cable and s_o/l of each frame in MOVING."""
    rows = frames(r, *MOVING)
    return zip(r.fields.T_pointwise[rows], r.fields.s_o[rows] / r.length, strict=True)


def level(r: Response, low: float, high: float) -> Array:
    """The median tension along the cable, over H, of every such frame."""
    return np.median(r.fields.T_pointwise[frames(r, low, high)], axis=1) / r.horizontal_tension


def tension_error(r: Response, reference: Response) -> float:
    """Rms error of the tension off the mass, over H."""
    return measures.tension_gap(r, reference, MOVING, "T_pointwise")


def unevenness(r: Response, *, sides: bool = False, width: float = 0.05) -> Array:
    """Rms of T about its mean along the cable (or each side), over that mean, by frame, beyond `width` of the mass."""
    out = []
    s = r.fields.s / r.length
    for row, s_o in moving(r):
        away = np.abs(s - s_o) >= width
        parts = [away & (s < s_o), away & (s > s_o)] if sides else [away]
        out.append(np.mean([np.mean((row[p] / row[p].mean() - 1.0) ** 2) for p in parts if p.any()]))
    return np.sqrt(out)


def wiggle(r: Response, near: float = 0.2, far: float = 1.0) -> float:
    """Rms of T less its running mean over a tenth of the cable on one side, over H, `near` to `far` off the mass."""
    s = r.fields.s / r.length
    half = round(0.05 * (r.fields.s.size - 1))
    parts = []
    for row, s_o in moving(r):
        for side in (s < s_o, s > s_o):
            if np.count_nonzero(side) > 2 * half:
                whole = slice(half, -half)  # where the mean has all its stations
                fast = (row[side] - uniform_filter1d(row[side], 2 * half + 1))[whole]
                distance = np.abs(s[side] - s_o)[whole]
                parts.append(fast[(distance >= near) & (distance <= far)])
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)) / r.horizontal_tension)


def turns(r: Response) -> float:
    """Crests and troughs of T along the cable deeper than 0.005 H, mean over frames."""
    rows = (T / r.horizontal_tension for T, _ in moving(r))
    return float(np.mean([sum(find_peaks(x * sign, prominence=0.005)[0].size for sign in (1, -1)) for x in rows]))


def tension_jump(r: Response) -> float:
    """Mean tension ahead of the mass less that behind it, over H."""
    rows = frames(r, *MOVING)
    return float(np.mean(r.fields.T_ahead_pointwise[rows] - r.fields.T_behind_pointwise[rows]) / r.horizontal_tension)


def meeting(r: Response) -> float:
    """s_o/l at which the transverse front from the entry, of speed sqrt(N/rho), meets the mass after its reflection."""
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
    return float(mass(done.t_events[0][0])) if done.t_events[0].size else math.nan


def linear_theory(sigma: float, alpha: float) -> float:
    """Irvine and Caughey's first frequency of a level cable."""
    return float(irvine.frequencies(irvine.parameter(sigma, alpha), 1)[0])


def static_variation(scene: Scene) -> float:
    """Of the tension along the cable, over H."""
    return float(np.ptp(scene.catenary.tension(np.linspace(0.0, scene.length, 201))) / scene.horizontal_tension)


def wavelet_terms(level: int) -> int:
    """Functions of the paper's set (37)."""
    return Daubechies(order=4, level=level, reading="literal").n


def rate(rows: list[dict[str, float]]) -> tuple[float, float]:
    """The exponent of an overshoot in N, and its bar."""
    first = rows[0]
    last = rows[-1]
    steps = math.log(last["terms"] / first["terms"])
    bar = math.hypot(first["spread"] / first["size"], last["spread"] / last["size"]) / steps
    return math.log(first["size"] / last["size"]) / steps, bar


def start_of_48(groups: Groups, d: float) -> float:
    """Relative distance of (48) from the g'' that balances (45) at s_o = d, for ten sines."""
    system = GalerkinSystem(groups, Fourier(10))
    assert groups.motion is not None
    a = groups.motion.at(0.0, 0)[2]
    _, xp, yp, _, _ = groups.static(np.zeros(1))
    slope = system.basis.basis.phi(np.zeros(1), 1)[0]
    pull = np.array([a * xp[0], a * yp[0] - groups.sigma])
    printed = np.linalg.solve(system.basis.basis.mass(), -groups.mu * np.outer(slope, pull)).T.ravel() / (3.0 * a)
    balanced = PositionAbscissa(system).second_order(np.zeros(system.n_dof), d)
    return float(np.linalg.norm(balanced - printed) / np.linalg.norm(printed))
