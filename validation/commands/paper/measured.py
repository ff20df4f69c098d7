"""Measures that claims.toml names; tensions with s_o/l in MID_TRAVEL by default."""

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, RegularGridInterpolator
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from cablefem.response import Array, Response
from cablefem.scene import Groups, Scene
from galerkin.abscissa import SystemOverPosition
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.core import measures
from validation.oracles import irvine

MID_TRAVEL = (0.1, 0.8)  # s_o/l
LATEST = 0.83  # s_o/l: beyond it the level cable goes slack


def turning_points(r: Response, reading: Literal["v", "y + v"]) -> list[tuple[float, str]]:
    """(s_o/l, "max" | "min") of every turning point; downward is positive.

    reading : "v", the displacement, or "y + v", the point.
    Turns shallower than half a percent of the largest value do not count.
    """
    start = 0.05  # s_o/l
    curve = _path_spline(r, reading)
    candidates = _candidate_extremes(curve, start, LATEST)
    depths = curve(candidates)
    prominence = 0.005 * np.abs(curve(np.linspace(start, LATEST, 4000))).max()
    out = []
    for sign, kind in ((1.0, "max"), (-1.0, "min")):
        peaks = find_peaks(sign * depths, prominence=prominence)[0]
        out += [(float(s_o), kind) for s_o in candidates[peaks]]
    return sorted(out)


def _path_spline(r: Response, reading: Literal["v", "y + v"]) -> CubicSpline:
    """The path over s_o/l."""
    return CubicSpline(r.s_o / r.length, r.v if reading == "v" else r.y)


def _candidate_extremes(curve: CubicSpline, start: float, end: float) -> Array:
    """Where a curve may be extreme between two positions, both included."""
    level = curve.derivative().roots(extrapolate=False)
    inner = level[(level > start) & (level < end)]
    return np.array([start, *inner, end])


def nearest_turning_point(r: Response, reading: Literal["v", "y + v"], near: float, kind: str | None = None) -> float:
    """s_o/l of the nearest turning point; nan without any."""
    turns = [s for s, k in turning_points(r, reading) if kind in (None, k)]
    return min(turns, key=lambda s: abs(s - near), default=math.nan)


def lowest_point_position(r: Response, reading: Literal["v", "y + v"], end_over_length: float = LATEST) -> float:
    """s_o/l of the lowest point of the path."""
    curve = _path_spline(r, reading)
    candidates = _candidate_extremes(curve, 0.0, min(end_over_length, r.reached))
    return float(candidates[np.argmax(curve(candidates))])


def max_depth(r: Response, reading: Literal["v", "y + v"], end_over_length: float = LATEST) -> float:
    """Largest value of the path [m], up to a position s_o/l."""
    path = r.v if reading == "v" else r.y
    return float(path[r.s_o <= end_over_length * r.length].max())


def relative_path_distance(a: Response, b: Response) -> float:
    """Largest distance of two paths over the largest deflection of the second."""
    return measures.relative_path_gap(a, b, measures.WINDOW).largest


def relative_energy_defect(r: Response, with_static_depth: bool = True) -> float:
    """Largest energy without work, over weight times largest displacement; with_static_depth : with M g y(s_o)."""
    scene = Scene.from_toml(r.scene_toml)
    assert scene.mass is not None
    weight = scene.mass.mass * scene.gravity
    defect = measures.energy_defect_in_joules(r)
    if not with_static_depth:
        static_depth = r.y - r.v
        defect = defect + weight * static_depth
    largest = np.abs(defect[measures.steps_in_window(r, measures.WINDOW)]).max()
    return float(largest / (weight * r.max_deflection))


def frames_between_positions(r: Response, low: float, high: float) -> slice:
    """Frames with s_o/l in [low, high]."""
    position = r.fields.s_o / r.length
    inside = np.flatnonzero((position >= low - 1e-9) & (position <= high + 1e-9))
    return slice(int(inside[0]), int(inside[-1]) + 1)


def tension_profiles_mid_travel(r: Response) -> Iterator[tuple[Array, float]]:
    """The tension along the cable and s_o/l of each frame in MID_TRAVEL."""
    rows = frames_between_positions(r, *MID_TRAVEL)
    return zip(r.fields.T_pointwise[rows], r.fields.s_o[rows] / r.length, strict=True)


def median_tensions_over_H(r: Response, low: float, high: float) -> Array:
    """The median along the cable of the tension over H, of each frame with s_o/l in [low, high]."""
    T = r.fields.T_pointwise[frames_between_positions(r, low, high)]
    return np.median(T, axis=1) / r.horizontal_tension


def rms_tension_error_over_H(r: Response, reference: Response) -> float:
    """Rms error of the tension off the mass, over H."""
    return measures.rms_tension_gap_over_H(r, reference, MID_TRAVEL, "T_pointwise")


def tension_unevenness(r: Response, *, by_side: bool = False, min_distance_from_mass: float = 0.05) -> Array:
    """Rms of T about its mean along the cable (or each side), over that mean, by frame.

    min_distance_from_mass : over l.
    """
    out = []
    s = r.fields.s / r.length
    for row, s_o in tension_profiles_mid_travel(r):
        off_mass = np.abs(s - s_o) >= min_distance_from_mass
        parts = [off_mass]
        if by_side:
            parts = [off_mass & (s < s_o), off_mass & (s > s_o)]
        tensions = [row[part] for part in parts if part.any()]
        variances = [np.mean((T / T.mean() - 1.0) ** 2) for T in tensions]
        out.append(np.mean(variances))
    return np.sqrt(out)


def tension_ripple_over_H(
    r: Response, *, min_distance_from_mass: float = 0.2, max_distance_from_mass: float = 1.0
) -> float:
    """Rms of T less its running mean over a tenth of the cable on one side, over H; distances from the mass, over l."""
    s = r.fields.s / r.length
    half = round(0.05 * (s.size - 1))
    inner = slice(half, -half)  # where the mean has all its stations
    parts = []
    for row, s_o in tension_profiles_mid_travel(r):
        for side in (s < s_o, s > s_o):
            if np.count_nonzero(side) > 2 * half:
                T = row[side]
                ripple = (T - uniform_filter1d(T, 2 * half + 1))[inner]
                distance = np.abs(s[side] - s_o)[inner]
                parts.append(ripple[(distance >= min_distance_from_mass) & (distance <= max_distance_from_mass)])
    rms = np.sqrt(np.mean(np.concatenate(parts) ** 2))
    return float(rms / r.horizontal_tension)


def mean_count_of_tension_extremes(r: Response) -> float:
    """Crests and troughs of T along the cable deeper than 0.005 H, mean over frames."""
    counts = []
    for row, _ in tension_profiles_mid_travel(r):
        T = row / r.horizontal_tension
        crests = find_peaks(T, prominence=0.005)[0]
        troughs = find_peaks(-T, prominence=0.005)[0]
        counts.append(crests.size + troughs.size)
    return float(np.mean(counts))


def mean_tension_jump_over_H(r: Response) -> float:
    """Mean over frames of the tension ahead of the mass less that behind it, over H."""
    jump = r.fields.T_ahead_pointwise - r.fields.T_behind_pointwise
    return float(np.mean(jump[frames_between_positions(r, *MID_TRAVEL)]) / r.horizontal_tension)


def reflected_front_meeting_position(r: Response) -> float:
    """s_o/l at which the transverse front from the entry, of speed sqrt(N/rho), meets the mass after its reflection."""
    f = r.fields
    end = float(f.t[-1])
    taut = np.maximum(f.T_pointwise, 0.0) / r.horizontal_tension
    T = np.concatenate([np.ones_like(taut[:1]), taut])  # (frames + 1, stations)
    tension = RegularGridInterpolator((np.append(0.0, f.t), f.s / r.length), T)
    speed = 1.0 / Scene.from_toml(r.scene_toml).time_scale  # sqrt(H/rho)/l
    mass = CubicSpline(r.t, r.s_o / r.length)

    def front_speed(t: float, x: Array) -> Array:
        s = np.clip(1.0 - abs(1.0 - x[0]), 0.0, 1.0)  # unfolded at the far support
        return speed * np.sqrt(tension((min(t, end), s))).ravel()

    def distance_to_mass(t: float, x: Array) -> float:
        return 2.0 - x[0] - float(mass(t))

    distance_to_mass.terminal = True  # type: ignore[attr-defined]
    front = solve_ivp(front_speed, (0.0, end), [0.0], events=distance_to_mass, rtol=1e-6, atol=1e-8, max_step=f.t[0])
    times = front.t_events[0]
    return float(mass(times[0])) if times.size else math.nan


def linear_first_frequency(sigma: float, alpha: float) -> float:
    """Irvine and Caughey's first frequency of a level cable."""
    return float(irvine.lowest_frequencies(irvine.irvine_parameter(sigma, alpha), 1)[0])


def static_tension_range_over_H(scene: Scene) -> float:
    """Range of the tension along the cable at rest, over H."""
    T = scene.catenary.tension(np.linspace(0.0, scene.length, 201))
    return float(np.ptp(T) / scene.horizontal_tension)


def wavelet_terms(level: int) -> int:
    """Number of functions of the paper's set (37) up to a level."""
    return Daubechies(order=4, level=level, reading="literal").n


def overshoot_exponent_and_bar(rows: list[dict[str, float]]) -> tuple[float, float]:
    """The exponent of an overshoot in N, and its bar."""
    first = rows[0]
    last = rows[-1]
    ratio = math.log(last["terms"] / first["terms"])
    exponent = math.log(first["size"] / last["size"]) / ratio
    bar = math.hypot(first["spread"] / first["size"], last["spread"] / last["size"]) / ratio
    return exponent, bar


def start_formula_error(groups: Groups, s_o: float) -> float:
    """Relative distance of (48) from the g'' that balances (45) at s_o, for ten sines."""
    sines = Fourier(10)
    system = GalerkinSystem(groups, sines)
    assert groups.motion is not None
    a = groups.motion.position_with_rates(0.0, 0)[2]
    _, xp, yp = groups.tension_and_slope(np.zeros(1))
    slope = sines.phi(np.zeros(1), 1)[0]
    force = np.array([a * xp[0], a * yp[0] - groups.sigma])
    load = -groups.mu * np.outer(slope, force)  # (terms, 2)
    printed = np.linalg.solve(sines.mass_matrix(), load).T.ravel() / (3.0 * a)
    balanced = SystemOverPosition(system).second_derivative_at_rest_start(np.zeros(system.n_dof), s_o)
    return float(np.linalg.norm(balanced - printed) / np.linalg.norm(printed))
