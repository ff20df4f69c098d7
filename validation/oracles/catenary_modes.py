"""Frequencies and modes of an elastic catenary, both displacements, any sag and slope.

    w_tt = [ A w' ]',  A = T I + (alpha - T) r' r'^T,  r' = (1, p)/T,  p = c - sigma s,  T = sqrt(1 + p^2),

w = 0 at both ends.  With J = int_0^s at Chebyshev points:
    w = W^2 [ J A^-1 ( (int A^-1)^-1 (int A^-1 J w) - J w ) ].

Source: Henghold, Russell & Morgan 1977; Wu & Chen 1989
Validity: any sag, slope and stiffness: sigma > 0, alpha > 0 or inf
Accuracy: 1e-11 relative for ten modes at degree = 48
Group: Frequencies of the bare cable
"""

import math
from dataclasses import dataclass

import numpy as np

from validation.oracles.case import BARE, Array, chebyshev_points_and_matrices, refuse_unless
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
    points, _, integral = chebyshev_points_and_matrices(degree)
    s = 0.5 * (1.0 + points)
    J = 0.5 * integral
    total = J[-1]
    p = c - sigma * s
    T = np.sqrt(1.0 + p * p)
    ex = 1.0 / T
    ey = p / T
    d = 1.0 / alpha - 1.0 / T
    B = np.array([[1.0 / T + d * ex * ex, d * ex * ey], [d * ex * ey, 1.0 / T + d * ey * ey]])  # A^-1, (2, 2, degree+1)
    BJ = np.block([[B[i, j][:, None] * J for j in range(2)] for i in range(2)])
    ends = np.kron(np.eye(2), total)
    n0 = np.linalg.solve(B @ total, ends @ BJ)
    K = np.kron(np.eye(2), J) @ (np.concatenate([B[0].T, B[1].T]) @ n0 - BJ)
    value, vector = np.linalg.eig(K)
    order = np.argsort(-value.real)[:count]
    real = np.abs(value[order].imag).max() <= 1e-9 * value[order[0]].real and value[order[-1]].real > 0.0
    refuse_unless("more points (degree), which resolve the frequencies", real)
    w = vector[:, order].real.T
    peak = np.abs(w).argmax(axis=1)
    w /= w[np.arange(count), peak][:, None]
    return Modes(1.0 / np.sqrt(value[order].real), s, w[:, : degree + 1], w[:, degree + 1 :])


def cases() -> list[ModesCase]:
    exact = solve_modes(BARE.sigma, BARE.alpha, BARE.c, count=4).omega
    return [ModesCase(name="first four, model full", groups=BARE, model="full", exact=exact)]
