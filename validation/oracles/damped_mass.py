"""A mass, or a force, at constant speed on a damped taut string, with all reflections.

    w_tt - w_xx + c w_t = F(t) delta(x - xi),  w(0, t) = w(1, t) = 0,  at rest for t <= 0,  xi = s0 + V t,
    y = w(xi, t) = int_0^t G(xi(t), xi(t'), t - t') F(t') dt',   mu y'' = P - F,
    G(x, x', tau) = sum over k of +-(1/2) e^(-c tau/2) I_0((c/2) sqrt(tau^2 - z^2)) H(tau - |z|),
    z = x - x' + 2 k (+) and x + x' + 2 k (-).

Source: the telegraph equation's Green function, with images
Validity: 0 < xi < 1, |V| < 1, c >= 0
Accuracy: 4e-8 of P at n = 150 equal steps, c <= 4
Group: Damped cables
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_triangular
from scipy.special import i0e

from validation.oracles import moving_force
from validation.oracles.case import Array, Crossing, level_string_groups, travel_from_inside_string

NODE, WEIGHT = np.polynomial.legendre.leggauss(3)


def green_integrals_over_steps(t: Array, *, V: float, s0: float, damping: float) -> Array:
    """int G dt' over each step (columns) at times t[1:] (rows), (n - 1, n - 1), lower triangular."""
    h = t[1]
    now = t[1:, None]
    before = t[None, :-1]
    total = np.zeros((t.size - 1, t.size - 1))
    farthest = 1 + int(t[-1])
    numbers = range(-farthest, farthest + 1)  # of the images that can be heard
    images = [(2.0 * k, V, 1.0) for k in numbers]
    images += [(2.0 * (s0 + k), -V, -1.0) for k in numbers]
    for z0, rate, sign in images:  # z = z0 + V t - rate t'
        z = z0 + V * now
        from_behind = (now - z) / (1.0 - rate)
        from_ahead = (now + z) / (1.0 + rate)
        heard = np.minimum(from_behind, from_ahead)  # what was sent before this t'
        length = np.clip(heard - before, 0.0, h)
        for node, weight in zip(NODE, WEIGHT, strict=True):
            sent = before + 0.5 * (1.0 + node) * length
            tau = now - sent
            distance = z - rate * sent
            root = 0.5 * damping * np.sqrt(np.clip(tau**2 - distance**2, 0.0, None))
            decay = np.exp(root - 0.5 * damping * tau)
            total += 0.25 * sign * weight * length * i0e(root) * decay
    return np.tril(total)


def load_displacement(t: Array, *, mu: float, P: float, V: float, s0: float, c: float) -> Array:
    """y at equal steps t; mu = 0: of the force."""
    G = green_integrals_over_steps(t, V=V, s0=s0, damping=c)
    F = np.full(t.size - 1, P)
    if mu > 0.0:
        h = t[1]
        own = np.tril(h / mu * (t[1:, None] - t[None, :-1] - 0.5 * h))
        fall = P * t[1:] ** 2 / (2.0 * mu)
        F = solve_triangular(G + own, fall, lower=True)
    return np.append(0.0, G @ F)


@cache
def extrapolated_load_displacement(t_end: float, **parameters: float) -> CubicSpline:
    """y(t): errors fall like 1/n^2."""
    t = np.linspace(0.0, t_end, 151)
    coarse = load_displacement(t, **parameters)
    fine = load_displacement(np.linspace(0.0, t_end, 301), **parameters)[::2]
    return CubicSpline(t, (4.0 * fine - coarse) / 3.0)


def cases() -> Iterator[Crossing]:
    """Comparisons with the solvers, wrong ones among them."""
    mu = 0.5
    sigma = 0.2
    s0 = 0.3
    V = 0.4
    end = 1.5
    groups = level_string_groups(travel_from_inside_string(s0, V, 0.0), mu, sigma)

    def damped_crossing(name: str, c: float, c_exact: float, load: str = "mass", **kind: Any) -> Crossing:
        """A crossing with damping c against the exact path with damping `c_exact`."""
        exact = extrapolated_load_displacement(1.75, mu=mu * (load == "mass"), P=mu * sigma, V=V, s0=s0, c=c_exact)
        damped = replace(groups, damping=c)
        return Crossing(name=name, groups=damped, exact=exact, load=load, start_position=s0, until=s0 + V * end, **kind)

    yield damped_crossing("mass, damping 1", 1.0, 1.0)
    yield damped_crossing("mass, damping 4", 4.0, 4.0)
    yield damped_crossing("mass, damping 4, told 3.9", 4.0, 3.9, expected="disagree")
    yield damped_crossing("force, damping 9", 9.0, 9.0, load="force", because=moving_force.FRONT, max_order=1.0)
