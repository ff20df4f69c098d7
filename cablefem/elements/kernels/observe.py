"""What is seen of states: fields along a following mesh, forces at its ends, energies, pointwise tension.

A history is q, v, a (n, n_dof) and kinematics (n, 3): s_o, ds_o, dds_o.
"""

import math

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import Mesh, at_rest, follow, slopes
from cablefem.elements.kernels.law import ELASTIC, pull, tension


@compiled
def along(knots, shapes, dofs, node, kinematics, s, history, ends, out):
    """Set w, dw/dt at fixed s, w' and f - c^2 w' at s (m,) of a following mesh, out (4, k, m, n_fields); at s_o behind.

    The last is the momentum tested with phi = 1 from the support or the mass up to s, see `end_forces`.

    knots : (2, n_el + 1) of the two sides;  shapes : polynomial coefficients, see `reference.shape_polynomials`;
    kinematics : (k, 3);  history : q, v, a, (3, k, n_dof);  ends : (k, 4, n_fields) of `end_forces`.
    """
    n_el, n_loc, n_fields = knots.shape[1] - 1, shapes.shape[0], out.shape[3]
    once, whole = np.empty(shapes.shape), np.empty(n_loc)  # coefficients of the antiderivatives, and those at xi = 1
    for k in range(n_loc):
        whole[k] = 0.0
        for m in range(n_loc):
            once[k, m] = shapes[k, m] / (m + 1.0)
            whole[k] += once[k, m]
    begin = np.empty((2 * n_el, 3, n_fields))  # int q, v, a dxi from the start of the side up to each element
    value, slope, total = np.empty((3, n_fields)), np.empty((3, n_fields)), np.empty((3, n_fields))
    for frame in range(kinematics.shape[0]):
        s_o, ds, dds = kinematics[frame, 0], kinematics[frame, 1], kinematics[frame, 2]
        for e in range(2 * n_el):
            side, at = e // n_el, e % n_el
            for j in range(3):
                for i in range(n_fields):
                    begin[e, j, i] = 0.0 if at == 0 else begin[e - 1, j, i]
            for k in range(n_loc if at > 0 else 0):
                part = whole[k] * (knots[side, at] - knots[side, at - 1])
                for j in range(3):
                    for i in range(n_fields):
                        d = n_fields * dofs[e - 1, k] + i
                        if d >= 0:
                            begin[e, j, i] += part * history[j, frame, d]
        for p in range(s.size):
            behind = s[p] <= s_o and s_o > 0.0
            side, s_0, h, sign = (0, 0.0, s_o, 1.0) if behind else (1, s_o, 1.0 - s_o, -1.0)
            xi = min(1.0, max(0.0, (s[p] - s_0) / h))
            at, last = 0, n_el - 1
            while at < last:
                half = (at + last) // 2
                if knots[side, half + 1] < xi:
                    at = half + 1
                else:
                    last = half
            e, length = side * n_el + at, knots[side, at + 1] - knots[side, at]
            x, chi = (xi - knots[side, at]) / length, xi if behind else 1.0 - xi
            for j in range(3):
                for i in range(n_fields):
                    value[j, i], slope[j, i], total[j, i] = 0.0, 0.0, begin[e, j, i]
            for k in range(n_loc):
                d = n_fields * dofs[e, k]
                if d < 0:
                    continue
                phi, phi_x, part = 0.0, 0.0, 0.0
                for m in range(n_loc - 1, -1, -1):
                    phi_x = phi_x * x + phi
                    phi = phi * x + shapes[k, m]
                    part = part * x + once[k, m]
                for j in range(3):
                    for i in range(n_fields):
                        value[j, i] += phi * history[j, frame, d + i]
                        slope[j, i] += phi_x / (length * h) * history[j, frame, d + i]
                        total[j, i] += part * x * length * history[j, frame, d + i]
            for i in range(n_fields):
                moved = chi * (2.0 * ds * value[1, i] + dds * value[0, i])
                if behind:
                    start = ends[frame, 0, i]
                else:
                    d = n_fields * node + i
                    start = ends[frame, 2, i] + 2.0 * ds * history[1, frame, d] + dds * history[0, frame, d]
                rate = h * total[2, i] + sign * (2.0 * ds * total[1, i] + dds * total[0, i])
                out[0, frame, p, i] = value[0, i]
                out[1, frame, p, i] = value[1, i] - ds * chi * slope[0, i]
                out[2, frame, p, i] = slope[0, i]
                out[3, frame, p, i] = start + rate - moved


@compiled
def end_forces(mesh, n_left, node, cable, kinematics, rise, q, v, a, ends):
    """Set f - c^2 w' at the left support, behind and ahead of the mass and at the right support, of a history.

    Momentum of a side of a following mesh, tested with any phi(xi):
    d/dt int w. phi + int c w. phi' + int f phi' = [(f + c w.) phi], w. = dq/dt phi_k - c w'; here with phi = 1 and with
    the phi that is 1 at the mass and 0 at the support.  f is the internal force less its static part, of the one-field
    models with N - tau = rise; c is 0 at the supports and ds_o at the mass.

    ends : (n, 4, n_fields);  the span of the mesh, which follows, is overwritten: one at rest is all left of s_o = 1.
    """
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    n_fields = ends.shape[2]
    alpha, law = cable[0], cable[3]
    unused = np.empty((8, 3))
    value, grad, f = np.empty((3, 2)), np.empty((3, 2)), np.empty(2)
    for n in range(rise.size):
        out, dds = ends[n], kinematics[n, 2]
        follow(kinematics[n, 0], kinematics[n, 1], dds, n_left, unused, span)
        out[:] = 0.0
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
                            value[1, i] += phi * v[n, at]
                            value[2, i] += phi * a[n, at]
                            grad[0, i] += phi_x * q[n, at]
                            grad[1, i] += phi_x * v[n, at]
                s = s_0 + h * xi
                if n_fields == 2:
                    xp, yp, T = at_rest(cable, s)
                    f[0], f[1], _, _, _, _, _ = pull(xp, yp, T, grad[0, 0] / h, grad[0, 1] / h, alpha, law)
                else:  # cable = (alpha, tau, curvature, lam, kap, law)
                    w_s = grad[0, 0] / h
                    f[0] = cable[1] * w_s + rise[n] * (cable[2] * (0.5 - s) + cable[4] * w_s)
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
        for i in range(n_fields):
            moved = kinematics[n, 1] * v[n, n_fields * node + i]
            out[1, i] -= moved
            out[2, i] -= moved
            if kinematics[n, 0] == 0.0:  # the left part has no length yet
                out[0, i] = out[1, i] = out[2, i]


@compiled
def energies(mesh, fine, n_left, cable, n_fields, kinematics, q, v, parts, least, where):
    """Set energies (3, n): kinetic, of strain, of weight; least tension and its s (n,) of a history.

    mesh : with the points of the forces, its span as in `end_forces`; fine : tab with those of inertia.
    """
    unused = np.empty((8, 3))
    inert = Mesh(mesh.span, mesh.dofs, fine)
    for i in range(least.size):
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
