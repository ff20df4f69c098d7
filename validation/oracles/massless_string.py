"""A mass at constant speed on a string without inertia.

    xi (1 - xi) Y'' + 2 a Y = 8 a xi (1 - xi),   Y(0) = Y'(0) = 0,   xi = V t/l,
    Y = y/(M g l/(4T)),  a = T l/(2 M V^2),  r = sqrt(1 + 8a):

    Y = (4a/(a-1)) [ xi (1-xi) - Phi ],   Phi = xi 2F1((1+r)/2, (1-r)/2; 2; xi),
    a = 1:  Y = (4/3) xi^2 - (8/3) xi (1-xi) ln(1-xi),
    Y(1) = 2 cos(pi r/2)/(pi (a-1)): a jump to the support.

Limit of moving_mass for mu -> inf at fixed a, off by 1/mu.  Method: Mehler's integral,
    Phi = (4 sqrt(xi)/(pi r)) int_0^(pi/2) sin(r beta) sin(psi) dpsi,   sin(beta) = sqrt(xi) sin(psi),
by Gauss panels graded towards pi/2.

Source: Fryba 1972; Smith 1964
Validity: 0 <= xi <= 1, 0 < a <= 1e4
Accuracy: 2e-15 max(10, r, a/|a-1|) of the largest Y
Group: A mass on a taut string
"""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import xlogy

from cablefem.scene import ConstantSpeed
from validation.oracles.case import SIGMA, Array, Crossing, Error, Limit, Solvers, level

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(16)


def path(xi: ArrayLike, *, a: float) -> Array:
    xi = _domain(xi, a)
    if a == 1.0:
        return (4.0 * xi * xi - 8.0 * xi * xlogy(1.0 - xi, 1.0 - xi)) / 3.0
    return 4.0 * a / (a - 1.0) * (xi * (1.0 - xi) - _phi(xi, math.sqrt(1.0 + 8.0 * a)))


def force(xi: ArrayLike, *, a: float) -> Array:
    """R/(M g) for 0 < xi < 1."""
    xi = _domain(xi, a)
    if np.any(xi <= 0.0) or np.any(xi >= 1.0):
        raise ValueError("the contact force is asked for inside the string, 0 < xi < 1")
    return path(xi, a=a) / (4.0 * xi * (1.0 - xi))


def _phi(xi: Array, r: float) -> Array:
    """Phi(xi); delta = pi/2 - psi."""
    edges = [0.5 * math.pi * 2.0**-26]
    for j in range(25, -1, -1):
        end = 0.5 * math.pi * 2.0**-j
        parts = math.ceil(r * (end - edges[-1]) / 8.0)  # 16 points resolve 8 rad
        edges += list(np.linspace(edges[-1], end, parts + 1)[1:])
    lo, hi = np.array([0.0, *edges[:-1]])[:, None], np.array(edges)[:, None]
    delta = (0.5 * (lo + hi) + 0.5 * (hi - lo) * _GAUSS_X).ravel()
    weight = (0.5 * (hi - lo) * _GAUSS_W).ravel() * np.cos(delta)
    x = xi[..., None]
    beta = np.arctan2(np.sqrt(x) * np.cos(delta), np.sqrt((1.0 - x) + x * np.sin(delta) ** 2))
    return 4.0 * np.sqrt(xi) / (math.pi * r) * (np.sin(r * beta) @ weight)


def _domain(xi: ArrayLike, a: float) -> Array:
    xi = np.asarray(xi, float)
    if not 0.0 < a <= 1e4:
        raise ValueError(f"a = T l/(2 M V^2) must lie in (0, 1e4], got {a!r}")
    if np.any(xi < 0.0) or np.any(xi > 1.0):
        raise ValueError("the string is 0 <= xi <= 1")
    return xi


def cases() -> list[Limit]:
    a = 0.7

    def deviation(solvers: Solvers, method: str, mu: float) -> Error:
        V = 1.0 / math.sqrt(2.0 * mu * a)
        crossing = Crossing(
            name="", groups=level(ConstantSpeed(speed=V).motion(1.0), mu), travel=lambda t: V * t,
            exact=lambda t: 0.25 * mu * SIGMA * path(np.minimum(V * t, 1.0), a=a),
        )  # fmt: skip
        return crossing.error(solvers.path(crossing, method, steps=round(150.0 / V)))

    return [
        Limit(
            name="limit of a heavy slow mass", parameter="mass ratio", values=(5.0, 20.0, 80.0), falls=1.0,
            because="the string's own inertia is 1/(mass ratio) of the moving one", deviation=deviation,
        )
    ]  # fmt: skip
