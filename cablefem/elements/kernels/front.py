"""Elements that gather around a front: where they are at an instant, and what they weigh."""

import math

import numpy as np

from cablefem.elements.kernels import compiled

NEAR = 1e-9  # of the length: a last correction of a knot, which its velocity and acceleration need not see


@compiled
def bent(t, line, p):
    """Return place, velocity and acceleration on a polyline with corners (m, 2), times and places, rounded within p."""
    n = line.shape[0]
    c = (line[1, 1] - line[0, 1]) / (line[1, 0] - line[0, 0])
    y, dy, ddy = line[0, 1] + c * (t - line[0, 0]), c, 0.0
    for j in range(1, n - 1):
        after = (line[j + 1, 1] - line[j, 1]) / (line[j + 1, 0] - line[j, 0])
        turn, d = after - c, t - line[j, 0]
        z = math.exp(-abs(d) / p)
        part = (1.0 if d > 0.0 else z) / (1.0 + z)
        y += turn * (max(d, 0.0) + p * math.log(1.0 + z))
        dy += turn * part
        ddy += turn * part * (1.0 - part) / p
        c = after
    return y, dy, ddy


@compiled
def gathered(s, centres, p):
    """Return W, W_s, W_t, W_ss, W_st, W_tt of W = s + sum_j 1/(1 + exp(-(s - y_j)/p)); centres (4, 3) y, dy, ddy."""
    W, W_s, W_t, W_ss, W_st, W_tt = s, 1.0, 0.0, 0.0, 0.0, 0.0
    for j in range(4):
        y, dy, ddy = centres[j, 0], centres[j, 1], centres[j, 2]
        z = math.exp(-abs(s - y) / p)
        part = (1.0 if s > y else z) / (1.0 + z)
        first = part * (1.0 - part) / p
        second = first * (1.0 - 2.0 * part) / p
        W += part
        W_s += first
        W_t -= first * dy
        W_ss += second
        W_st -= second * dy
        W_tt += second * dy * dy - first * ddy
    return W, W_s, W_t, W_ss, W_st, W_tt


@compiled
def gather(xi, ends, mass, y, p, knots):
    """Set places, velocities and accelerations of the knots of a side, (n + 1, 3), which have equal parts of W.

    ends : (2, 3) those of its ends, which mirror the front y (3,), so that it always has all its elements;
    mass : which of them is at the mass, where some elements always are.
    """
    last, centres, total = xi.size - 1, np.empty((4, 3)), np.empty((2, 3))
    centres[3] = ends[mass]
    for i in range(3):
        centres[0, i], centres[1, i], centres[2, i] = y[i], 2.0 * ends[0, i] - y[i], 2.0 * ends[1, i] - y[i]
    for k in range(2):
        c, dc = ends[k, 1], ends[k, 2]
        W, W_s, W_t, W_ss, W_st, W_tt = gathered(ends[k, 0], centres, p)
        total[k] = W, W_s * c + W_t, W_s * dc + W_ss * c * c + 2.0 * W_st * c + W_tt
        knots[k * last] = ends[k]
    for i in range(1, last):
        of = (1.0 - xi[i]) * total[0] + xi[i] * total[1]
        low, high = knots[i - 1, 0], ends[1, 0]
        s = low if i == 1 else min(2.0 * low - knots[i - 2, 0], high)  # first guess: as long as the one before
        while True:  # Newton's method, kept between bounds that close in
            W, W_s, W_t, W_ss, W_st, W_tt = gathered(s, centres, p)
            if of[0] > W:
                low = s
            else:
                high = s
            step = (of[0] - W) / W_s
            s += step
            if abs(step) <= NEAR:
                break
            if not low < s < high:
                s = 0.5 * (low + high)
                if not low < s < high:
                    break
        c = (of[1] - W_t) / W_s
        knots[i, 0], knots[i, 1], knots[i, 2] = s, c, (of[2] - W_tt - 2.0 * W_st * c - W_ss * c * c) / W_s


@compiled
def follow_fronts(xi, lines, p, t, kinematics, spans):
    """Set the spans (n, n_el, 6) of elements left and right of the mass at times t (n,), see `balance.Mesh`.

    xi : (2, n_el / 2 + 1) of the two sides;  lines : polylines of the fronts on them;  kinematics : (n, 3) of the mass.
    """
    of, ends = np.empty((xi.shape[1], 3)), np.zeros((3, 3))
    ends[2, 0] = 1.0
    for n in range(t.size):
        ends[1] = kinematics[n]
        for side in range(2):
            y = bent(t[n], lines[side], p)
            gather(xi[side], ends[side : side + 2], 1 - side, y, p, of)
            for e in range(xi.shape[1] - 1):
                span, length = spans[n, side * (xi.shape[1] - 1) + e], xi[side, e + 1] - xi[side, e]
                for k in range(3):
                    rate = (of[e + 1, k] - of[e, k]) / length
                    span[2 * k], span[2 * k + 1] = of[e, k] - rate * xi[side, e], rate


@compiled
def weigh(span, dofs, fine, n_fields, bands):
    """Set the diagonals of M, C and K (3, 2 b + 1, n) of elements with these spans, all fields.

    M = int phi_i phi_j ds,  C = dM/dt - G + G^T,  K = -(dG/dt + H),
    G = int c phi_i phi_j' ds,  H = int c^2 phi_i' phi_j' ds.
    """
    bands[:] = 0.0
    n_loc, b = dofs.shape[1], bands.shape[1] // 2
    for e in range(dofs.shape[0]):
        h, dh = span[e, 1], span[e, 3]
        if h == 0.0:  # the left part has no length yet
            continue
        for g in range(fine.shape[1]):
            xi, w = fine[e, g, 0], fine[e, g, 1]
            c, dc = span[e, 2] + dh * xi, span[e, 4] + span[e, 5] * xi
            for i in range(n_loc):
                row = dofs[e, i]
                if row < 0:
                    continue
                phi, phi_x = fine[e, g, 2 + i], fine[e, g, 2 + n_loc + i]
                for j in range(n_loc):
                    col = dofs[e, j]
                    if col < 0:
                        continue
                    eta, eta_x = fine[e, g, 2 + j], fine[e, g, 2 + n_loc + j]
                    m = w * phi * eta
                    damping = dh * m + w * c * (phi_x * eta - phi * eta_x)
                    stiffness = -w * (dc * phi * eta_x + c * c / h * phi_x * eta_x)
                    for k in range(n_fields):
                        at = row * n_fields + k
                        bands[0, b + col - row, at] += h * m
                        bands[1, b + col - row, at] += damping
                        bands[2, b + col - row, at] += stiffness
