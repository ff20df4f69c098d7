"""Corrections of Newton's method for many sines with a hat, from the factors of some steps ago.

K = S + the hat's rows and columns + mu f g^T of the mass, S the sines' own.  S is well-conditioned as far as steps
resolve axial waves, and changes slowly: the mass has to go a part of the highest sine's wave.  Hat and mass change all
the time, but are few: a bordered system with S of some steps ago and all else of now preconditions K, which itself is
only applied.  What the sines leave of the hat stands in the hat's place: a hat is nearly a sum of sines, and would
count a thousand times what S has changed by.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from galerkin.kernels.cable import Array
from galerkin.kernels.dense import halve, multiply, solve
from galerkin.law import compiled

# Directions before S is factorised again, which takes as long as some twenty; from 6 to 10 all takes as long.
MOST = 8
# Of the residual, and of Newton's bound, that a correction may leave.  Ten times as much took as long, and left ten
# times as far from what exact corrections find: 1e-7 to 1e-5 of the deflection.
NEARLY, WITHIN = 1e-5, 0.01


class Kept(NamedTuple):
    """S^-1 = half^T half of some steps ago, in single precision."""

    half: Array  # (2 n, 2 n)
    known: Array  # (1,) whether there is one


class Border(NamedTuple):
    """What a tangent has besides S."""

    hat: Array  # (n,) the sum of sines next to the hat
    rows: Array  # (4, 2 n) of what it leaves of the hat, and of the forces at the mass
    solved: Array  # (4, 2 n) S^-1 times the columns
    rest: Array  # (4, 4) what the elimination of the sines leaves
    g: Array  # (n + 1,)


@compiled
def solve_kept(kept, b):
    """S^-1 b of rows b (m, 2 n), in single precision."""
    half = np.empty(b.shape, np.float32)
    out = np.empty(b.shape, np.float32)
    multiply(b, kept.half, True, half)
    multiply(half, kept.half, False, out)
    return out


@compiled
def bordered(here, mu, gram, c0, c1, c2, kept):
    """Return `Border` where `evaluate` has been."""
    phi, x, m = here.at.phi, here.x, here.at.s.size
    n = x.f.size - 1
    hat, slope, weighted, sums = np.empty((1, n)), np.empty((1, m)), np.empty((3, m)), np.empty((3, n))
    for k in range(n):
        hat[0, k] = 2.0 * x.mass[k, n]
    multiply(hat, phi[:n], False, slope)
    own = np.zeros(3)
    for q in range(m):
        left = phi[n, q] - slope[0, q]
        for i in range(3):
            weighted[i, q] = gram[i // 2, (i + 1) // 2, q] * left
            own[i] += weighted[i, q] * left
    multiply(weighted, phi[:n], True, sums)
    g, mass, moves, f, g_hat = np.empty(n + 1), 1.0 / 3.0, c1 * x.gyroscopic[n] + c0 * x.centrifugal[n], 1.0, c2
    g[n] = c2
    columns, rows = np.zeros((4, 2 * n), np.float32), np.zeros((4, 2 * n))
    for k in range(n):
        g[k] = c2 * x.f[k] + c1 * x.f_v[k] + c0 * x.f_q[k]
        drag = c1 * x.gyroscopic[k] + c0 * x.centrifugal[k]
        mass -= 0.5 * hat[0, k] * hat[0, k]
        moves -= hat[0, k] * drag
        f -= hat[0, k] * x.f[k]
        g_hat -= hat[0, k] * g[k]
        for a in range(2):
            for b in range(2):
                rows[a, b * n + k] = c0 * sums[a + b, k]
                columns[a, b * n + k] = c0 * sums[a + b, k] + (drag if a == b else 0.0)
            rows[2 + a, a * n + k] = mu * g[k]
            columns[2 + a, a * n + k] = x.f[k]
    solved = solve_kept(kept, columns)
    rest = np.empty((4, 4))
    for a in range(4):
        for b in range(4):
            total = 0.0
            for k in range(2 * n):
                total -= rows[a, k] * solved[b, k]
            rest[a, b] = total
    for a in range(2):
        for b in range(2):
            rest[a, b] += c0 * own[a + b]
        rest[a, a] += c2 * mass + moves
        rest[a, 2 + a] += f
        rest[2 + a, a] += mu * g_hat
        rest[2 + a, 2 + a] -= 1.0
    return Border(hat[0], rows, solved, rest, g)


@compiled
def precondition(border, kept, r, out):
    """Set out (2, n + 1) to what solves the bordered system for r (2, n + 1)."""
    n = border.hat.size
    sines, right, z = np.empty((1, 2 * n), np.float32), np.empty(4), np.empty(4)
    for a in range(2):
        right[a], right[2 + a] = r[a, n], 0.0
        for k in range(n):
            sines[0, a * n + k] = r[a, k]
            right[a] -= border.hat[k] * r[a, k]
    y = solve_kept(kept, sines)
    for a in range(4):
        for k in range(2 * n):
            right[a] -= border.rows[a, k] * y[0, k]
    solve(border.rest, right, z)
    for a in range(2):
        for k in range(n):
            i, total = a * n + k, 0.0
            for b in range(4):
                total += border.solved[b, i] * z[b]
            out[a, k] = y[0, i] - total - border.hat[k] * z[a]
        out[a, n] = z[a]


@compiled
def apply(here, mu, gram, border, c0, c1, c2, p, out):
    """Set out to K p; p, out (2, n + 1)."""
    phi, x, m = here.at.phi, here.x, here.at.s.size
    n, slope = border.hat.size, np.empty((2, m))
    multiply(p, phi, False, slope)
    for q in range(m):
        u, v = slope[0, q], slope[1, q]
        slope[0, q] = c0 * (gram[0, 0, q] * u + gram[0, 1, q] * v)
        slope[1, q] = c0 * (gram[0, 1, q] * u + gram[1, 1, q] * v)
    multiply(slope, phi, True, out)
    for a in range(2):
        force, hat = 0.0, p[a, n]
        for k in range(n + 1):
            force += border.g[k] * p[a, k]
        for k in range(n + 1):
            moves = c2 * x.mass[k, n] + c1 * x.gyroscopic[k] + c0 * x.centrifugal[k]
            out[a, k] += moves * hat + mu * force * x.f[k]
        for k in range(n):
            out[a, k] += 0.5 * c2 * p[a, k]
            out[a, n] += c2 * x.mass[k, n] * p[a, k]


@compiled
def descend(here, mu, gram, border, kept, r, bound, c0, c1, c2, step):
    """Set step to nearly K^-1 r by generalised conjugate residuals; return whether it came to be."""
    size = r.size
    ways, maps, left = np.empty((MOST, 2, size // 2)), np.empty((MOST, 2, size // 2)), r.copy()
    square = 0.0
    for i in range(size):
        step[i] = 0.0
        square += r[i] * r[i]
    enough = max(NEARLY * math.sqrt(square), WITHIN * bound)
    for k in range(MOST):
        precondition(border, kept, left.reshape(2, size // 2), ways[k])
        apply(here, mu, gram, border, c0, c1, c2, ways[k], maps[k])
        way, image = ways[k].reshape(size), maps[k].reshape(size)
        for j in range(k):
            way_j, image_j, share = ways[j].reshape(size), maps[j].reshape(size), 0.0
            for i in range(size):
                share += image[i] * image_j[i]
            for i in range(size):
                image[i] -= share * image_j[i]
                way[i] -= share * way_j[i]
        square = 0.0
        for i in range(size):
            square += image[i] * image[i]
        if not square > 0.0:
            return False
        over, share = 1.0 / math.sqrt(square), 0.0
        for i in range(size):
            image[i] *= over
            way[i] *= over
            share += left[i] * image[i]
        square = 0.0
        for i in range(size):
            step[i] += share * way[i]
            left[i] -= share * image[i]
            square += left[i] * left[i]
        if math.sqrt(square) <= enough:
            return True
    return False


@compiled
def corrected(here, mu, gram, r, bound, c0, c1, c2, kept, step):
    """Set step to nearly K^-1 r where S of some steps ago serves; return whether it does."""
    if kept.known[0] == 0.0:
        return False
    border = bordered(here, mu, gram, c0, c1, c2, kept)
    return descend(here, mu, gram, border, kept, r, bound, c0, c1, c2, step)


@compiled
def keep(K, c0, c2, kept):
    """Keep the sines' part of the tangent; K : (2 n + 2, 2 n + 2) of `stiffness`."""
    n = K.shape[0] // 2 - 1
    S = np.empty((2 * n, 2 * n), np.float32)
    for i in range(2 * n):
        row = K[i + i // n]
        for k in range(n):
            S[i, k], S[i, n + k] = c0 * row[k], c0 * row[n + 1 + k]
        S[i, i] += 0.5 * c2
    kept.known[0] = halve(S, kept.half)
