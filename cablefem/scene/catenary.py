"""The static cable in closed form, eqs (9)-(12), in SI and dimensionless.

With p = T y'/H = c - sigma s (lengths over l, forces over H, y down) T = sqrt(1 + p^2), x' = 1/T, y' = p/T.
Nearly equal numbers are never subtracted: a taut cable keeps its digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cablefem.scene.bisection import bisect_zero

# [-] z = rho g b/(2H); sag/span is 7.3 at z = 5; below 1e-9 it is none
Z_MIN = 1e-9
Z_MAX = 5.0
_BRACKET = Z_MIN * (1.0 - 1e-6), Z_MAX * (1.0 + 1e-6)  # with the ends themselves


class TensionAndSlope(NamedTuple):
    """T/H and first derivatives of x and y by s; arrays."""

    T: np.ndarray
    dx: np.ndarray
    dy: np.ndarray


class TensionAndShape(NamedTuple):
    """T/H and derivatives of x and y by s; arrays."""

    T: np.ndarray
    dx: np.ndarray
    dy: np.ndarray
    ddx: np.ndarray
    ddy: np.ndarray


def static_tension(s: Any, sigma: float, c: float) -> np.ndarray:
    """T/H at s in [0, 1]."""
    p = c - sigma * np.asarray(s, dtype=float)
    return np.sqrt(1.0 + p * p)


def tension_and_slope(s: Any, sigma: float, c: float) -> TensionAndSlope:
    """T, x', y' at s in [0, 1]."""
    p = c - sigma * np.asarray(s, dtype=float)
    T = np.sqrt(1.0 + p * p)
    xp = 1.0 / T
    return TensionAndSlope(T, xp, p * xp)


def tension_and_shape_derivatives(s: Any, sigma: float, c: float) -> TensionAndShape:
    """T, x', y', x'', y'' at s in [0, 1]."""
    T, xp, yp = tension_and_slope(s, sigma, c)
    p = c - sigma * np.asarray(s, dtype=float)
    ypp = -sigma * xp * xp * xp  # a power is slow
    return TensionAndShape(T, xp, yp, -p * ypp, ypp)


def coordinates(s: Any, sigma: float, c: float) -> tuple[np.ndarray, np.ndarray]:
    """(x, y) at s: x = (asinh p_0 - asinh p)/sigma, y = (T_0 - T)/sigma = s m, m = (p_0 + p)/(T_0 + T)."""
    s = np.asarray(s, dtype=float)
    p = c - sigma * s
    p0 = c
    T0 = math.hypot(1.0, c)
    T = np.sqrt(1.0 + p * p)
    m = (p0 + p) / (T0 + T)
    # asinh is odd: mirror a rising cable, so that p_0 + T_0 is no difference
    sign = 1.0 if c >= 0.0 else -1.0
    x = -sign * np.log1p(-sign * sigma * s * (1.0 + sign * m) / (sign * p0 + T0)) / sigma
    return x, s * m


@dataclass(frozen=True)
class Catenary:
    """A uniform cable at rest from (0, 0) to (span, drop); y down, SI."""

    span: float  # b [m]
    drop: float  # y(l) [m]
    weight: float  # rho g [N/m] per static arc length
    horizontal_tension: float  # H [N]

    @classmethod
    def from_sag_parameter(cls, span: float, drop: float, weight: float, z: float) -> Catenary:
        """From z = rho g b/(2H)."""
        return cls(span, drop, weight, weight * span / (2.0 * z))

    @classmethod
    def from_length(cls, span: float, drop: float, weight: float, length: float) -> Catenary:
        """By sqrt(l^2 - h^2)/b = sinh(z)/z; ValueError if no z in [Z_MIN, Z_MAX] has this arc length."""
        chord = math.hypot(span, drop)
        if length <= chord:
            raise ValueError(f"length {length} is at most the chord {chord}")
        level = math.sqrt((length - drop) * (length + drop))
        excess = (length - chord) * (length + chord) / (span * (level + span))  # = level/span - 1
        z = bisect_zero(lambda z: math.log(_sinhc_minus_1(z) / excess), *_BRACKET)
        return cls.from_sag_parameter(span, drop, weight, z)

    @classmethod
    def from_sag(cls, span: float, drop: float, weight: float, sag: float) -> Catenary:
        """ValueError if no z in [Z_MIN, Z_MAX] has this sag."""
        z = bisect_zero(lambda z: math.log(_sag_at_parameter(span, drop, z) / sag), *_BRACKET)
        return cls.from_sag_parameter(span, drop, weight, z)

    @property
    def sag_parameter(self) -> float:
        """rho g b/(2H) [-]."""
        return self.weight * self.span / (2.0 * self.horizontal_tension)

    @property
    def chord(self) -> float:
        """Distance of the supports [m]."""
        return math.hypot(self.span, self.drop)

    @cached_property
    def excess_over_chord(self) -> float:
        """l - chord [m]: l^2 - chord^2 = b^2 (S^2 - 1), S = sinh(z)/z."""
        s1 = _sinhc_minus_1(self.sag_parameter)
        square = self.span**2 * s1 * (s1 + 2.0)
        return square / (math.sqrt(self.chord**2 + square) + self.chord)

    @cached_property
    def length(self) -> float:
        """Stretched arc length l [m]."""
        return self.chord + self.excess_over_chord

    @cached_property
    def sigma(self) -> float:
        """rho g l/H [-]."""
        return self.weight * self.length / self.horizontal_tension

    @cached_property
    def c(self) -> float:
        """y'/x' at the left support [-]: sinh(theta_m + z), tanh(theta_m) = h/l."""
        return math.sinh(_mean_asinh_slope(self.span, self.drop, self.sag_parameter) + self.sag_parameter)

    @cached_property
    def sag(self) -> float:
        """Largest vertical distance below the chord [m]."""
        return _sag_at_parameter(self.span, self.drop, self.sag_parameter)

    @property
    def max_tension(self) -> float:
        """Largest tension [N], at the upper support."""
        return float(np.max(self.tension(np.array([0.0, self.length]))))

    @cached_property
    def mean_tension(self) -> float:
        """Mean tension [N]: (p T + asinh p)/(2 sigma), without differences."""
        c = self.c
        end = self.c - self.sigma
        b = self.span / self.length
        h = self.drop / self.length
        tensions = math.hypot(1.0, c) + math.hypot(1.0, end)
        mean = 0.25 * tensions + 0.25 * (c + end) * h + 0.5 * b
        return self.horizontal_tension * mean

    def irvine(self, EA: float) -> float:
        """L^2 = sigma^2 alpha cos^5(slope) [-], Irvine, Cable Structures (1981), 2.4."""
        return self.sigma**2 * EA / self.horizontal_tension * (self.span / self.chord) ** 5

    def x(self, s: Any) -> np.ndarray:
        """Horizontal position [m] at s [m]."""
        return self.length * coordinates(np.asarray(s) / self.length, self.sigma, self.c)[0]

    def y(self, s: Any) -> np.ndarray:
        """Depth below the left support [m] at s [m]."""
        return self.length * coordinates(np.asarray(s) / self.length, self.sigma, self.c)[1]

    def tension(self, s: Any) -> np.ndarray:
        """Tension [N] at s [m]."""
        return self.horizontal_tension * static_tension(np.asarray(s) / self.length, self.sigma, self.c)


def _sinhc_minus_1(z: float) -> float:
    """sinh(z)/z - 1 = sum_k z^2k/(2k+1)!, without cancellation."""
    if abs(z) > 1.0:
        return math.sinh(z) / z - 1.0
    term = total = z * z / 6.0
    for k in range(2, 10):  # z^18/19! = 8e-18
        term *= z * z / (2 * k * (2 * k + 1))
        total += term
    return total


def _mean_asinh_slope(span: float, drop: float, z: float) -> float:
    """Mean theta_m of asinh(y'/x') at the supports: sinh(theta_m) = (h/b)/(sinh(z)/z)."""
    return math.asinh(drop / span / (1.0 + _sinhc_minus_1(z)))


def _sag_at_parameter(span: float, drop: float, z: float) -> float:
    """Sag [m]: (b/2z) [cosh(tm) (cosh z - cosh eta) + sinh(tm) (sinh eta - eta sinh(z)/z)], eta = tm - asinh(h/b)."""
    tm = _mean_asinh_slope(span, drop, z)
    eta = tm - math.asinh(drop / span)
    fall = 2.0 * math.sinh((z + eta) / 2.0) * math.sinh((z - eta) / 2.0)
    tilt = eta * (_sinhc_minus_1(eta) - _sinhc_minus_1(z))
    return span / (2.0 * z) * (math.cosh(tm) * fall + math.sinh(tm) * tilt)
