"""Compiled inner loops of the full cable: stress at points, internal force and what its tangent is made of.

Common arguments
    T         (m,) static tension;  r_static (2, m) rows x', y' of the static shape
    slope     (2, m) w' = (u', v')
    alpha, law  EA/H, and the index of the law in `galerkin.law.LAWS`
"""

from __future__ import annotations

import math

import numpy as np

from galerkin.law import compiled, tension

ELASTIC = 0


@compiled
def at_point(T, xp, yp, ux, vy, alpha, law):
    """N, W, N t - T t_static (2), k, d, |r'| and the elastic T + alpha eps, whatever the law.

    The tangent of N t is k I + d r' r'^T, k = N/|r'|, d = (dN/deps |r'| - N)/|r'|^3 of (28)-(32).  The force is formed
    as (k - T) X' + k w', k - T = ((N - T) - T eps)/|r'|: nothing cancels next to the hanging cable.
    """
    e = (2.0 * xp + ux) * ux + (2.0 * yp + vy) * vy
    stretch = math.sqrt(1.0 + e)
    eps = e / (1.0 + stretch)  # sqrt(1 + e) - 1 without cancellation
    N, dN, W = tension(eps, T, alpha, law)
    k = N / stretch
    d = (dN - k) / (stretch * stretch)
    excess = (N - T - T * eps) / stretch
    return N, W, excess * xp + k * ux, excess * yp + k * vy, k, d, tension(eps, T, alpha, ELASTIC)[0]


@compiled
def stress(T, r_static, slope, alpha, law):
    """Rows N, W, N t - T t_static (2), and the three entries of its tangent, xx, xy, yy: (7, m)."""
    out = np.empty((7, T.size))
    for i in range(T.size):
        xp, yp, ux, vy = r_static[0, i], r_static[1, i], slope[0, i], slope[1, i]
        N, W, fx, fy, k, d, _ = at_point(T[i], xp, yp, ux, vy, alpha, law)
        rx, ry = xp + ux, yp + vy
        out[0, i], out[1, i], out[2, i], out[3, i] = N, W, fx, fy
        out[4, i], out[5, i], out[6, i] = k + d * rx * rx, d * rx * ry, k + d * ry * ry
    return out


@compiled
def balance(phi, weights, T, r_static, Q, alpha, law, force, gram, pull):
    """Internal force (2, n) of coefficients Q (2, n) over slopes phi (n, m) with Gauss weights (m,).

    gram : (2, 2, m) receives the weighted tangent at the points;  pull : (m,) the elastic T + alpha eps
    """
    slope = Q @ phi
    for i in range(weights.size):
        xp, yp, ux, vy = r_static[0, i], r_static[1, i], slope[0, i], slope[1, i]
        _, _, fx, fy, k, d, pull[i] = at_point(T[i], xp, yp, ux, vy, alpha, law)
        rx, ry, w = xp + ux, yp + vy, weights[i]
        gram[0, 0, i], gram[1, 1, i] = w * (k + d * rx * rx), w * (k + d * ry * ry)
        gram[0, 1, i] = gram[1, 0, i] = w * (d * rx * ry)
        slope[0, i], slope[1, i] = w * fx, w * fy
    force[:] = slope @ phi.T


@compiled
def survey(phi, weights, T, r_static, Q, alpha, law, internal):
    """int W ds, the least N and the index of its point; the last row of phi is the hat, rising behind the mass.

    internal : (2, 2) receives int (N t - T t_static) ds behind and ahead of the mass, each a column
    """
    slope = Q @ phi
    energy, least, at = 0.0, math.inf, 0
    internal[:] = 0.0
    for i in range(weights.size):
        N, W, fx, fy, _, _, _ = at_point(T[i], r_static[0, i], r_static[1, i], slope[0, i], slope[1, i], alpha, law)
        side = 0 if phi[-1, i] > 0.0 else 1
        internal[0, side] += weights[i] * fx
        internal[1, side] += weights[i] * fy
        energy += weights[i] * W
        if least > N:
            least, at = N, i
    return energy, least, at


@compiled
def car(mu, sigma, drag, wind, thrust, velocity, acceleration, behind, ahead):
    """What acts on a rolling car; all vectors (2,), r' behind and ahead of it.

    C = mu (p.. - sigma j) - F_ext (2), tau (2), cos(phi), <lam>, and the force of the air (2).
    """
    mx, my = 0.5 * (behind[0] + ahead[0]), 0.5 * (behind[1] + ahead[1])
    size = math.hypot(mx, my)
    tx, ty = mx / size, my / size
    stretch = 0.5 * (math.hypot(behind[0], behind[1]) + math.hypot(ahead[0], ahead[1]))
    x, y = velocity[0] - wind, velocity[1]
    speed = -drag * math.hypot(x, y)
    Cx = mu * acceleration[0] - thrust * tx - speed * x
    Cy = mu * (acceleration[1] - sigma) - thrust * ty - speed * y
    return Cx, Cy, tx, ty, size / stretch, stretch, speed * x, speed * y
