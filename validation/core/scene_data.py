"""What second computations share: a scene's numbers, units, ice, means, and distances of curves and series."""

import math
import tomllib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROUNDING = 1e-9  # relative, of static splines and of times in different runs
DOWN = np.array([0.0, 1.0])
GROUND = "the ground"  # its name beside those of obstacles

PREFIXES = {"": 1.0, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9}
FACTORS = {("km/h", "m/s"): 1.0 / 3.6, ("%", ""): 0.01, ("°", "deg"): 1.0}


def conversion_factor_or_nan(printed_unit: str, to_unit: str) -> float:
    """What a number in a printed unit, or in none, is multiplied by to be in `to_unit`; nan if they do not fit."""
    if (printed_unit, to_unit) in FACTORS:
        return FACTORS[printed_unit, to_unit]
    if printed_unit in ("", to_unit):
        return 1.0
    if to_unit == "" or not printed_unit.endswith(to_unit):
        return math.nan
    return PREFIXES.get(printed_unit.removesuffix(to_unit), math.nan)


def ice_mass_per_length(cable: dict[str, Any]) -> float:
    """Mass per length [kg/m] of the ice of a TOML's cable."""
    ice = cable.get("ice", 0.0)
    if not isinstance(ice, dict):
        return float(ice)
    thickness = ice["thickness"]
    return float(ice["density"] * math.pi * thickness * (cable["diameter"] + thickness))


def thermal_stretch(cable: dict[str, Any]) -> float:
    """1 + a_T (T - T_0) of a TOML's cable; 1 if it has no temperature."""
    if "temperature" not in cable:
        return 1.0
    warmer = cable["temperature"] - cable["reference_temperature"]
    return float(1.0 + cable["expansion"] * warmer)


def tension_ratio_and_rope_stresses_at_wheel(
    cable: dict[str, Any], wheels: dict[str, Any], N: Array, Q: Array
) -> dict[str, Array]:
    """N/Q and stresses [Pa] (n,) of a TOML's cable under a wheel with the load Q; nan where it is slack."""
    out = {"tension_over_wheel": N / np.maximum(Q, 1e-6 * N)}
    if "E" in cable:
        taut = np.where(N > 0.0, N, math.nan)
        bending = Q * np.sqrt(cable["E"] / (cable["section"] * taut))
        if "wire" in cable and "radius" in wheels:
            largest = 0.5 * cable["E"] * cable["wire"] / wheels["radius"]
            bending = np.minimum(bending, largest)
        out["stress_axial"] = taut / cable["section"]
        out["stress_bending"] = bending
        out["stress"] = out["stress_axial"] + bending
    return out


def means_around_times(t: Array, values: Array, at: Array, period: float) -> Array:
    """Means of a signal (n,) or (n, c) over a period around times (k,), within the signal's own range."""
    from scipy.interpolate import make_interp_spline  # slow to import

    total = make_interp_spline(t, values, k=1).antiderivative()
    begin = np.clip(at - 0.5 * period, t[0], t[-1])
    end = np.clip(at + 0.5 * period, t[0], t[-1])
    duration = (end - begin).reshape(-1, *[1] * (values.ndim - 1))
    integral = total(end) - total(begin)
    return integral / duration


def is_within(t: Array, begin: float, end: float) -> NDArray[np.bool_]:
    """Which of the times t lie from begin to end, up to rounding."""
    return (t >= begin * (1.0 - ROUNDING)) & (t <= end * (1.0 + ROUNDING))


def max_depth_at(at: Array, x: Array, y: Array) -> Array:
    """Deepest y of a polyline (n,) at each x of `at` (m,); -inf where it does not pass."""
    low = np.minimum(x[:-1], x[1:])
    high = np.maximum(x[:-1], x[1:])
    depths = np.full(at.size, -math.inf)
    for j, x_j in enumerate(at):
        i = np.flatnonzero((low <= x_j) & (x_j <= high) & (low < high))  # pieces over x_j
        w = (x_j - x[i]) / (x[i + 1] - x[i])
        crossings = y[i] + w * (y[i + 1] - y[i])
        depths[j] = crossings.max(initial=-math.inf)
    return depths


def min_height_over(profile: Array, x: Array, y: Array) -> float:
    """Smallest height [m] of a polyline (n,) over a profile (m, 2) of x and depth; inf where it is never above it."""
    corners, depth = profile.T
    over = (x >= corners[0]) & (x <= corners[-1])
    at_vertices = np.interp(x[over], corners, depth) - y[over]
    at_corners = depth - max_depth_at(corners, x, y)
    return float(min(at_vertices.min(initial=math.inf), at_corners.min()))


def height_over_at(profile: Array, x: float, y: float, near: float) -> float:
    """Height [m] of a point over a profile (m, 2); inf where it is not above it, up to `near` [m]."""
    corners, depth = profile.T
    if not corners[0] - near <= x <= corners[-1] + near:
        return math.inf
    return float(np.interp(x, corners, depth) - y)


def obstacle_and_ground_profiles(scene: dict[str, Any]) -> dict[str, Array]:
    """Points (n, 2) of x and depth [m] of a TOML's obstacles, each one point, and of its ground, by name."""
    profiles = {}
    for obstacle in scene.get("obstacle", []):
        profiles[obstacle["name"]] = np.array([[obstacle["at"], obstacle["top"]]], float)
    if scene.get("ground"):
        profiles[GROUND] = np.array(scene["ground"], float)
    return profiles


def thrust_times_and_forces(drive: dict[str, Any]) -> tuple[Array, Array]:
    """Times [s] and forces [N] of a TOML's thrust; a constant one never ends."""
    thrust = drive.get("thrust", 0.0)
    if not isinstance(thrust, dict):
        thrust = {"times": [0.0, math.inf], "forces": [thrust, thrust]}
    return np.array(thrust["times"], float), np.array(thrust["forces"], float)


def air_drag_factor(drive: dict[str, Any]) -> float:
    """rho_air c_D A/2 [N s^2/m^2] of a car, by its TOML."""
    return float(0.5 * drive.get("air_density", 1.2) * drive.get("drag_area", 0.0))


def series_faults(
    name: str, written: Array, expected: Array, rounding: float = ROUNDING, scale: float | None = None
) -> Iterator[str]:
    """A fault if a series, or where it is nan, differs; rounding : over a scale, by default the largest value."""
    same_rows = written.shape == expected.shape and np.array_equal(np.isnan(written), np.isnan(expected))
    if not same_rows:
        yield f"{name} has other rows than were computed"
        return
    off = float(np.nanmax(np.abs(written - expected), initial=0.0))
    scale = scale or float(np.nanmax(np.abs(expected), initial=0.0)) or 1.0
    if off > rounding * scale:
        yield f"{name} is not what was computed: off by {off:.3g} of {scale:.3g}"


class HangingRope(NamedTuple):
    """Points and tensions (n,) of a rope that hangs from a point: see `line_laws`."""

    x: Array  # [m] from there
    y: Array
    tension: Array  # [N]

    @classmethod
    def at_lengths(cls, S: Array, H: Any, P: Any, q: float, EA: float) -> "HangingRope":
        """At unstretched lengths S (n,) [m] from the point, with the force H, P [N] there."""
        P1 = P - q * S
        N = np.hypot(H, P)
        N1 = np.hypot(H, P1)
        turned = np.arcsinh(P / H) - np.arcsinh(P1 / H)
        return cls(H * S / EA + H / q * turned, (P * S - 0.5 * q * S**2) / EA + (N - N1) / q, N1)


class LineData:
    """What laws of a line at rest and in motion read of its TOML, SI."""

    def __init__(self, toml: str) -> None:
        self.data = tomllib.loads(toml)
        cable = self.data["cable"]
        self.gravity: float = self.data.get("gravity", 9.81)
        self.contacts: list[dict[str, Any]] = self.data["contact"]
        self.EA: float = cable["EA"]
        self.empty_mass_per_length: float = cable["mass_per_length"]
        self.mass_per_length = self.empty_mass_per_length + ice_mass_per_length(cable)  # [kg/m]
        self.heat = thermal_stretch(cable)


class OneSpanData:
    """A scene's numbers from its TOML, SI; `length` is that at rest."""

    def __init__(self, toml: str, length: float) -> None:
        x = tomllib.loads(toml)
        self.scene = x
        cable = x["cable"]
        supports = x["supports"]
        self.gravity: float = x.get("gravity", 9.81)
        self.rho: float = cable["mass_per_length"]
        self.EA: float = cable["EA"]
        self.span = supports["span"]
        self.drop = supports["drop"]
        self.mass: float = x["mass"]["mass"]
        self.weight = self.mass * self.gravity
        name = next(name for name in ("length", "sag", "horizontal_tension") if name in cable)
        self.prescribed: tuple[str, float] = name, cable[name]
        self.travel = x.get("travel", {})
        self.drive = x.get("drive", {})
        self.cable = cable
        self.wind = x.get("wind", {})
        if "ice" in cable or "temperature" in cable:
            weight = self.rho * self.gravity
            l, mean_tension = _catenary_length_and_mean_tension(self.span, self.drop, weight, *self.prescribed)
            self.rho = (self.rho + ice_mass_per_length(cable)) * l / length
            natural = l / (1.0 + mean_tension / self.EA)
            self.prescribed = "unstretched", natural * thermal_stretch(cable)
        self.round_trip = 2.0 * length * math.sqrt(self.rho / self.EA)  # of an axial wave [s]

    def _crosswind_drag_factor(self) -> float:
        """rho_air c_D d/2 [N s^2/m^3], d with ice."""
        ice = self.cable.get("ice")
        thickness = ice["thickness"] if isinstance(ice, dict) else 0.0
        d = self.cable["diameter"] + 2.0 * thickness
        air = self.wind.get("air_density", 1.2)
        c_D = self.wind.get("drag_coefficient", 1.2)
        return 0.5 * air * c_D * d

    def crosswind_force_per_length(self) -> float:
        """Of the wind's mean speed, per length [N/m]."""
        return self._crosswind_drag_factor() * self.wind["across"] ** 2 if self.wind else 0.0

    def damping_rate_with_wind(self, length: float, H: float) -> float:
        """Force over momentum of the cable [1/s]; its own and the crosswind's."""
        own = self.cable.get("damping", 0.0)
        if not (own or self.wind):
            return 0.0
        ratio, rate = (0.0, own["rate"]) if isinstance(own, dict) else (own, 0.0)
        own_rate = rate + 2.0 * ratio * self._lowest_sagged_cable_angular_frequency(length, H)
        of_wind = self._crosswind_drag_factor() * self.wind["across"] if self.wind else 0.0
        return own_rate + of_wind / self.rho

    def _lowest_sagged_cable_angular_frequency(self, length: float, H: float) -> float:
        """Of the empty cable [rad/s]; in units of sqrt(tau/rho)/l antisymmetric 2 pi, symmetric

        1 + sum over odd n of 8 L^2/(n^2 pi^2 (n^2 pi^2 - w^2)) = 0.
        """
        cos = self.span / math.hypot(self.span, self.drop)
        n = math.pi * np.arange(1.0, 20001.0, 2.0)
        weight_over_H = self.rho * self.gravity * length / H
        L2 = weight_over_H**2 * self.EA / H * cos**5

        def sums(w: float) -> float:
            terms = 8.0 * L2 / (n**2 * (n**2 - w**2))
            return 1.0 + float(np.sum(terms))

        w = 2.0 * math.pi
        if sums(w) > 0.0:
            from scipy.optimize import brentq  # slow to import

            w = float(brentq(sums, math.pi * (1.0 + 1e-12), w, xtol=1e-12))
        return w * math.sqrt(H / cos / self.rho) / length


def _catenary_length_and_mean_tension(
    span: float, drop: float, weight: float, name: str, value: float
) -> tuple[float, float]:
    """Length [m] and mean tension [N] of a catenary;  name, value : "length", "sag" or "horizontal_tension".

    u = asinh(slope) falls by span/a; ds = a cosh(u) du, T = H cosh(u).
    """

    def catenary(a: float) -> tuple[float, float, float, float]:
        """Length, sag, and u at the middle and half its range, of the catenary with a = H/weight."""
        half = 0.5 * span / a
        middle = math.asinh(drop / (2.0 * a * math.sinh(half)))
        deepest = math.asinh(drop / span)
        left = middle + half
        fallen = a * (math.cosh(left) - math.cosh(deepest))
        sag = fallen - drop / span * a * (left - deepest)
        return 2.0 * a * math.cosh(middle) * math.sinh(half), sag, middle, half

    a = value / weight
    if name != "horizontal_tension":
        from scipy.optimize import brentq  # slow to import

        which = 0 if name == "length" else 1

        def excess(log_a: float) -> float:
            return catenary(math.exp(log_a))[which] - value

        log_a = brentq(excess, math.log(0.1 * span), math.log(1e6 * span))
        a = math.exp(log_a)
    length, _, middle, half = catenary(a)
    squares = half + 0.5 * math.sinh(2.0 * half) * math.cosh(2.0 * middle)  # integral of cosh(u)^2
    return length, a * weight * squares * a / length


def ordinate_on_unit_slope(position: Array, tension: Array, start: float) -> float:
    """T/H at which the falling curve of tensions over positions (n,) meets the slope of 1 through (start, 0).

    A distance (Levy's) in s_o/l and T/H: of positions at a steep front, of tensions on a gentle slope.
    """
    return float(np.interp(start, position - tension, tension))
