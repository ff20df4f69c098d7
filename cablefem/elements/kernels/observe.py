"""What is seen of states: fields and recovered forces along a following mesh, energies, pointwise tension.

A history is q, v, a (n, n_dof) and kinematics (n, 3): s_o, ds_o, dds_o; `frames` are rows of it.
"""

import math

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import Mesh, at_rest, follow, slopes
from cablefem.elements.kernels.law import ELASTIC, pull, tension


@compiled
def locate(knots, s_o, s):
    """Return side, its length, xi, element, its length in xi and the place in it of s; the element behind at a knot."""
    side = 0 if s <= s_o and s_o > 0.0 else 1
    s_0, h = (0.0, s_o) if side == 0 else (s_o, 1.0 - s_o)
    xi = min(1.0, max(0.0, (s - s_0) / h))
    low, high = 0, knots.shape[1] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if knots[side, middle] < xi:
            low = middle
        else:
            high = middle
    length = knots[side, low + 1] - knots[side, low]
    return side, h, xi, low, length, (xi - knots[side, low]) / length


@compiled
def sample(knots, shapes, dofs, s_o, ds, s, q, v, out):
    """Set w, dw/dt at fixed s and w' at the places s (m,) of a following mesh, out (3, m, n_fields); at s_o behind.

    knots : (2, n_el + 1) of the two sides;  shapes : polynomial coefficients, see `reference.shape_polynomials`.
    """
    n_el, n_loc = knots.shape[1] - 1, shapes.shape[0]
    n_fields = out.shape[2]
    out[:] = 0.0
    for p in range(s.size):
        side, h, xi, low, length, x = locate(knots, s_o, s[p])
        pull = ds * (xi if side == 0 else 1.0 - xi)
        for k in range(n_loc):
            d = dofs[side * n_el + low, k]
            if d < 0:
                continue
            value, slope = 0.0, 0.0
            for m in range(n_loc - 1, -1, -1):
                slope = slope * x + value
                value = value * x + shapes[k, m]
            slope /= length * h
            for f in range(n_fields):
                w = q[n_fields * d + f]
                out[0, p, f] += value * w
                out[1, p, f] += value * v[n_fields * d + f] - pull * slope * w
                out[2, p, f] += slope * w


@compiled
def samples(knots, shapes, dofs, kinematics, frames, s, q, v, out):
    """Set `sample` of the frames of a history, out (k, 3, m, n_fields)."""
    for k in range(frames.size):
        i = frames[k]
        sample(knots, shapes, dofs, kinematics[i, 0], kinematics[i, 1], s, q[i], v[i], out[k])


@compiled
def end_forces(mesh, n_left, node, cable, dds, rise, q, v, a, out):
    """Set f - c^2 w' at the left support, behind and ahead of the mass and at the right support; out (4, n_fields).

    Momentum of a side of a following mesh, tested with any phi(xi):
    d/dt int w. phi + int c w. phi' + int f phi' = [(f + c w.) phi], w. = dq/dt phi_k - c w'; here with phi = 1 and with
    the phi that is 1 at the mass and 0 at the support.  f is the internal force less its static part, of the one-field
    models with N - tau = rise; c is 0 at the supports and ds_o at the mass.
    """
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    n_fields = out.shape[1]
    alpha, law = cable[0], cable[3]
    out[:] = 0.0
    value, grad = np.empty((3, 2)), np.empty((3, 2))
    f = np.empty(2)
    for e in range(n_el):
        left = e < n_left
        s_0, h = span[e, 0], span[e, 1]
        if h == 0.0:
            continue
        ds, sign = (span[e, 3], 1.0) if left else (span[e, 2], -1.0)
        for g in range(tab.shape[1]):
            xi, weight = tab[e, g, 0], tab[e, g, 1]
            chi = xi if left else 1.0 - xi
            value[:] = 0.0
            grad[:] = 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, phi_x = tab[e, g, 2 + k], tab[e, g, 2 + n_loc + k]
                    for i in range(n_fields):
                        at = n_fields * d + i
                        value[1, i] += phi * v[at]
                        value[2, i] += phi * a[at]
                        grad[0, i] += phi_x * q[at]
                        grad[1, i] += phi_x * v[at]
            s = s_0 + h * xi
            if n_fields == 2:
                xp, yp, T = at_rest(cable, s)
                f[0], f[1], _, _, _, _, _ = pull(xp, yp, T, grad[0, 0] / h, grad[0, 1] / h, alpha, law)
            else:  # cable = (alpha, tau, curvature, lam, kap, law)
                w_s = grad[0, 0] / h
                f[0] = cable[1] * w_s + rise * (cable[2] * (0.5 - s) + cable[4] * w_s)
            for i in range(n_fields):
                w_t = value[1, i] - ds * chi / h * grad[0, i]
                momentum = h * value[2, i] + sign * ds * value[1, i] - chi * (dds * grad[0, i] + ds * grad[1, i])
                force = weight * (sign * chi * momentum + ds * chi * w_t + f[i])
                if left:
                    out[1, i] += force
                    out[0, i] += force - weight * momentum
                else:
                    out[2, i] += force
                    out[3, i] += force + weight * momentum
    ds = span[-1, 2]
    for i in range(n_fields):
        out[1, i] -= ds * v[n_fields * node + i]
        out[2, i] -= ds * v[n_fields * node + i]


@compiled
def sample_forces(knots, shapes, dofs, node, s_o, ds, dds, s, q, v, a, ends, out):
    """Set f - c^2 w' (m, n_fields) at the places s (m,) of a following mesh: the balance with phi = 1 up to there.

    ends : of `end_forces`.
    """
    n_el, n_loc = knots.shape[1] - 1, shapes.shape[0]
    n_fields = out.shape[1]
    total = np.zeros((2, n_el + 1, 3, n_fields))  # int of q, v, a from the start of the side to each knot, over h
    history = (q, v, a)
    for side in range(2):
        for e in range(n_el):
            length = knots[side, e + 1] - knots[side, e]
            for j in range(3):
                for i in range(n_fields):
                    total[side, e + 1, j, i] = total[side, e, j, i]
            for k in range(n_loc):
                d = dofs[side * n_el + e, k]
                whole = 0.0
                for m in range(n_loc):
                    whole += shapes[k, m] / (m + 1.0)
                if d >= 0:
                    for j in range(3):
                        for i in range(n_fields):
                            total[side, e + 1, j, i] += whole * length * history[j][n_fields * d + i]
    at = np.empty((2, 3, n_fields))
    for p in range(s.size):
        side, h, xi, low, length, x = locate(knots, s_o, s[p])
        chi, sign = (xi, 1.0) if side == 0 else (1.0 - xi, -1.0)
        for j in range(3):
            for i in range(n_fields):
                at[0, j, i], at[1, j, i] = 0.0, total[side, low, j, i]
        for k in range(n_loc):
            d = dofs[side * n_el + low, k]
            if d < 0:
                continue
            value, part = 0.0, 0.0
            for m in range(n_loc - 1, -1, -1):
                value = value * x + shapes[k, m]
                part = part * x + shapes[k, m] / (m + 1.0)
            part *= x * length
            for j in range(3):
                for i in range(n_fields):
                    at[0, j, i] += value * history[j][n_fields * d + i]
                    at[1, j, i] += part * history[j][n_fields * d + i]
        for i in range(n_fields):
            carried = chi * (dds * at[0, 0, i] + ds * at[0, 1, i])
            if side == 1:
                carried -= dds * q[n_fields * node + i] + ds * v[n_fields * node + i]
            rate = h * at[1, 2, i] + sign * (2.0 * ds * at[1, 1, i] + dds * at[1, 0, i]) - carried
            start = ends[0, i] if side == 0 else ends[2, i] + ds * v[n_fields * node + i]
            out[p, i] = start + rate - ds * chi * at[0, 1, i]


@compiled
def carried(mesh, n_left, node, cable, knots, shapes, kinematics, rise, frames, s, q, v, a, ends, along):
    """Set `end_forces` of a history, ends (n, 4, n_fields), and `sample_forces` of its frames, along (k, m, n_fields).

    mesh : following; its span is overwritten.
    """
    unused = np.empty((8, 3))
    for i in range(rise.size):
        follow(kinematics[i, 0], kinematics[i, 1], kinematics[i, 2], n_left, unused, mesh.span)
        end_forces(mesh, n_left, node, cable, kinematics[i, 2], rise[i], q[i], v[i], a[i], ends[i])
        if kinematics[i, 0] == 0.0:  # the left part has no length yet
            for f in range(ends.shape[2]):
                ends[i, 0, f] = ends[i, 1, f] = ends[i, 2, f]
    for k in range(frames.size):
        i = frames[k]
        s_o, ds, dds = kinematics[i, 0], kinematics[i, 1], kinematics[i, 2]
        sample_forces(knots, shapes, mesh.dofs, node, s_o, ds, dds, s, q[i], v[i], a[i], ends[i], along[k])


@compiled
def energies(mesh, fine, n_left, cable, n_fields, kinematics, q, v, parts, least, where):
    """Set energies (3, n): kinetic, of strain, of weight; least tension and its s (n,) of a history.

    mesh : with the points of the forces; fine : tab with those of inertia.
    n_left : None where the mesh rests; else its span is overwritten.
    """
    unused = np.empty((8, 3))
    inert = Mesh(mesh.span, mesh.dofs, fine)
    for i in range(least.size):
        if n_left is not None:
            follow(kinematics[i, 0], kinematics[i, 1], 0.0, n_left, unused, mesh.span)
        parts[0, i] = kinetic_energy(inert, n_fields, q[i], v[i])
        if n_fields == 2:
            parts[1, i], parts[2, i], least[i], where[i] = cable_energy(mesh, cable, q[i])
        else:
            parts[1, i], least[i] = chord_energy(mesh, cable, q[i])


@compiled
def kinetic_energy(mesh, n_fields, q, v):
    """Return int |w.|^2/2 ds, w. = dq/dt phi - c q phi' the velocity at fixed s on a mesh that moves with c."""
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    twice = 0.0
    for e in range(n_el):
        h = span[e, 1]
        if h == 0.0:  # the left part has no length yet
            continue
        for g in range(tab.shape[1]):
            c = span[e, 2] + span[e, 3] * tab[e, g, 0]
            for i in range(n_fields):
                rate = 0.0
                for k in range(n_loc):
                    d = n_fields * dofs[e, k] + i
                    if d >= 0:
                        rate += tab[e, g, 2 + k] * v[d] - c / h * tab[e, g, 2 + n_loc + k] * q[d]
                twice += h * tab[e, g, 1] * rate * rate
    return 0.5 * twice


@compiled
def cable_energy(mesh, cable, q):
    """Return int W ds, -int sigma v ds, the pointwise least tension and its s; full cable."""
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    alpha, sigma, law = cable[0], cable[1], cable[3]
    strain, potential = 0.0, 0.0
    least = math.inf
    where = 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        if h == 0.0:  # the left part has no length yet
            continue
        for g in range(tab.shape[1]):
            s = s_0 + h * tab[e, g, 0]
            xp, yp, T = at_rest(cable, s)
            du, dv = slopes(dofs, tab, q, e, g)
            v0 = 0.0
            for k in range(n_loc):
                if dofs[e, k] >= 0:
                    v0 += tab[e, g, 2 + k] * q[2 * dofs[e, k] + 1]
            _, _, _, _, _, W, eps = pull(xp, yp, T, du / h, dv / h, alpha, law)
            N = tension(eps, T, alpha, ELASTIC)[0]
            if least > N:
                least, where = N, s
            weight = tab[e, g, 1] * h
            strain += weight * W
            potential -= weight * sigma * v0
    return strain, potential, least, where


@compiled
def chord_energy(mesh, chord, q):
    """Return int tau w'^2/2 ds + W - tau eps of the one-field models, and the tension tau + h."""
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    alpha, tau, curvature, lam, kap = chord[0], chord[1], chord[2], chord[3], chord[4]
    strain, eps = 0.0, 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        if h == 0.0:  # the left part has no length yet
            continue
        for g in range(tab.shape[1]):
            w = 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    w += tab[e, g, 2 + n_loc + k] / h * q[d]
            weight = tab[e, g, 1] * h
            y = curvature * (0.5 - (s_0 + h * tab[e, g, 0]))
            eps += weight * lam * (y * w + 0.5 * kap * w * w)
            strain += weight * 0.5 * tau * w * w
    W = tension(eps, tau, alpha, chord[5])[2]
    return strain + (W - tau * eps), tension(eps, tau, alpha, ELASTIC)[0]
