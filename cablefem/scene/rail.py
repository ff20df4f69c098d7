"""The path of a car over the shoe of a saddle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

GAUSS = np.polynomial.legendre.leggauss(12)  # of arc lengths


class RailEnd(NamedTuple):
    """A point of a path with slope and curvature."""

    x: float
    y: float
    slope: float  # dy/dx
    bend: float = 0.0  # d2y/dx2 [1/m]


@dataclass(frozen=True)
class Rail:
    """y = Y(x), of degree five between two ends; y down.

    A car that grips, off the rope, goes on along it from `begin` by `stretch` times the rope that it passes.
    """

    saddle: str
    begin: RailEnd
    end: RailEnd
    s: float = 0.0  # [m] of the car at `begin`, from the saddle
    stretch: float = 1.0

    @cached_property
    def coefficients(self) -> tuple[float, ...]:
        """c_k of Y = sum of c_k u^k, u = (x - x_begin)/L."""
        x0, y0, slope0, bend0 = self.begin
        x1, y1, slope1, bend1 = self.end
        L = x1 - x0
        c1 = slope0 * L
        c2 = 0.5 * bend0 * L**2
        # what the quadratic part leaves at the end, of Y and its derivatives by u
        D = y1 - y0 - c1 - c2
        E = slope1 * L - c1 - 2.0 * c2
        F = bend1 * L**2 - 2.0 * c2
        return y0, c1, c2, 10.0 * D - 4.0 * E + 0.5 * F, -15.0 * D + 7.0 * E - F, 6.0 * D - 3.0 * E + 0.5 * F

    def depth_with_derivatives(self, x: Any) -> tuple[Any, Any, Any]:
        """Y, Y' and Y'' at x."""
        L = self.end.x - self.begin.x
        u = (x - self.begin.x) / L
        Y = first = half_second = 0.0
        for coefficient in reversed(self.coefficients):
            half_second = half_second * u + first
            first = first * u + Y
            Y = Y * u + coefficient
        return Y, first / L, 2.0 * half_second / L**2

    def y_with_rates(self, x_with_rates: Any) -> Any:
        """y and its rates (3, ...) of a car at x with its rates (3, ...)."""
        x, dx, ddx = x_with_rates
        Y, slope, bend = self.depth_with_derivatives(x)
        return np.array([Y, slope * dx, slope * ddx + bend * dx**2])

    def x_with_rates(self, s_from_saddle_with_rates: Any) -> Any:
        """x and its rates (3, n) of a car off the rope that grips so far from the saddle, (3, n) with its rates."""
        s, ds, dds = s_from_saddle_with_rates
        distance = self.stretch * (s - self.s)
        nodes, weights = GAUSS
        begin = self.begin.x
        x = begin + distance
        for _ in range(20):  # from an arc length to its x, by Newton's method
            half = 0.5 * (x - begin)
            slopes = self.depth_with_derivatives(begin + half * (1.0 + nodes[:, None]))[1]  # (points, n)
            arc = half * (weights @ np.hypot(1.0, slopes))
            change = (arc - distance) / np.hypot(1.0, self.depth_with_derivatives(x)[1])
            x -= change
            if np.abs(change).max() < 1e-12:  # [m]
                break
        _, slope, bend = self.depth_with_derivatives(x)
        size = np.hypot(1.0, slope)
        dx = self.stretch * ds / size
        return np.array([x, dx, (self.stretch * dds - dx**2 * slope * bend / size) / size])
