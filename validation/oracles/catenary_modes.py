"""Frequencies and modes of an elastic catenary, both displacements, any sag and slope.

    w_tt = [ A w' ]',  A = T I + (alpha - T) r' r'^T,  r' = (1, p)/T,  p = c - sigma s,  T = sqrt(1 + p^2),

w = 0 at both ends.  With J = int_0^s:
    w = W^2 [ J A^-1 ( (int A^-1)^-1 (int A^-1 J w) - J w ) ].
At Chebyshev points of the horizontal distance x, ds = T dx: there T = cosh(asinh(c) - sigma x) is smooth at any sag.

Source: Henghold, Russell & Morgan 1977; Wu & Chen 1989
Validity: any sag, slope and stiffness: sigma > 0, alpha > 0 or inf
Accuracy: 1e-11 relative for ten modes at degree = 48 up to sigma = 40; 1e-9 at sigma = 400
Group: Frequencies of the bare cable
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from validation.oracles.case import BARE, Array, chebyshev_points_and_integrals, refuse_unless
from validation.oracles.case import Modes as ModesCase


@dataclass(frozen=True, slots=True)
class Modes:
    omega: Array  # (count,) ascending
    s: Array  # (n+1,)
    u: Array  # (count, n+1) shapes, largest displacement 1
    v: Array


def solve_modes(sigma: float, alpha: float, c: float | None = None, *, count: int = 10, degree: int = 48) -> Modes:
    """The first `count` modes; c = None: a level cable; alpha = inf: inextensible."""
    c = 0.5 * sigma if c is None else c
    refuse_unless("sigma > 0, alpha > 0, a finite c", 0.0 < sigma < math.inf, alpha > 0.0, math.isfinite(c))
    refuse_unless("1 <= count <= degree/2", 1 <= count <= degree // 2)
    points, integrals = chebyshev_points_and_integrals(degree)
    slope_angle = math.asinh(c)  # of the left end, hyperbolic
    span = (slope_angle - math.asinh(c - sigma)) / sigma
    x = 0.5 * span * (1.0 + points)
    p = np.sinh(slope_angle - sigma * x)
    T = np.sqrt(1.0 + p * p)
    J = 0.5 * span * integrals * T
    total = J[-1]
    along = np.array([np.ones_like(p), p]) / T  # r' (2, degree + 1)
    B = np.eye(2)[:, :, None] / T + (1.0 / alpha - 1.0 / T) * along[:, None] * along  # A^-1, (2, 2, degree + 1)
    BJ = np.block([[B_ij[:, None] * J for B_ij in row] for row in B])
    ends = np.kron(np.eye(2), total)
    n0 = np.linalg.solve(B @ total, ends @ BJ)
    strain = np.concatenate([B[0].T, B[1].T]) @ n0 - BJ  # (2 degree + 2, 2 degree + 2)
    K = np.kron(np.eye(2), J) @ strain
    value, vector = np.linalg.eig(K)
    order = np.argsort(-value.real)[:count]
    value = value[order]
    is_real = np.abs(value.imag).max() <= 1e-9 * value[0].real
    refuse_unless("more points (degree), which resolve the frequencies", is_real, value[-1].real > 0.0)
    w = vector[:, order].real.T
    peak = np.abs(w).argmax(axis=1)
    w /= w[np.arange(count), peak][:, None]
    u, v = np.split(w, 2, axis=1)
    return Modes(1.0 / np.sqrt(value.real), J.sum(axis=1), u, v)


def cases() -> Iterator[ModesCase]:
    exact = solve_modes(BARE.sigma, BARE.alpha, BARE.c, count=4).omega
    yield ModesCase(name="first four, model full", groups=BARE, model="full", exact=exact)
