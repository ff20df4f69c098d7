"""What is seen of states: fields along a following mesh, forces at its ends, energies, pointwise tension.

A history is q, v, a (n, n_dof) and kinematics (n, 3): s_o, ds_o, dds_o.
"""

import math

import numpy as np

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import Mesh, at_rest, follow
from cablefem.elements.kernels.law import ELASTIC, pull, tension


@compiled
def at_instant(spans, n, kinematics, n_left, unused, span):
    """Return the spans of the elements at row n: those given, or where there are none, of a mesh that just follows."""
    if spans.shape[0] > 0:
        return spans[n]
    follow(kinematics[n, 0], kinematics[n, 1], kinematics[n, 2], n_left, unused, span)
    return span


@compiled
def along(mesh, knots, shapes, node, kinematics, spans, s, history, ends, out, speed):
    """Set w, dw/dt at fixed s, w' and f - c^2 w' at s (m,) of a following mesh, out (4, k, m, n_fields); at s_o behind.

    The last is the momentum tested with phi = 1 from the support or the mass up to s, see `end_forces`.

    knots : (2, n_el + 1) of the two sides;  shapes : polynomial coefficients, see `reference.shape_polynomials`;
    kinematics : (k, 3);  spans : (k, 2 n_el, 6) or none;  history : q, v, a, (3, k, n_dof);
    ends : (k, 4, n_fields) of `end_forces`;  speed : (k, m) c.
    """
    n_el, n_loc, n_fields, dofs = knots.shape[1] - 1, shapes.shape[0], out.shape[3], mesh.dofs
    once, whole = np.empty(shapes.shape), np.empty(n_loc)  # coefficients of the antiderivatives, and those at xi = 1
    for k in range(n_loc):
        whole[k] = 0.0
        for m in range(n_loc):
            once[k, m] = shapes[k, m] / (m + 1.0)
            whole[k] += once[k, m]
    begin = np.empty((2 * n_el, n_fields))  # d2/dt2 int w ds from the start of the side up to each element
    value, slope, rate, unused = np.empty((3, n_fields)), np.empty(n_fields), np.empty(n_fields), np.empty((8, 3))
    for frame in range(kinematics.shape[0]):
        s_o, ds, dds = kinematics[frame, 0], kinematics[frame, 1], kinematics[frame, 2]
        span = at_instant(spans, frame, kinematics, n_el, unused, mesh.span)
        for e in range(2 * n_el):
            side, at = e // n_el, e % n_el
            for i in range(n_fields):
                begin[e, i] = 0.0 if at == 0 else begin[e - 1, i]
            for k in range(n_loc if at > 0 else 0):
                part = whole[k] * (knots[side, at] - knots[side, at - 1])
                for j in range(3):
                    factor = part * (span[e - 1, 5] if j == 0 else 2.0 * span[e - 1, 3] if j == 1 else span[e - 1, 1])
                    for i in range(n_fields):
                        d = n_fields * dofs[e - 1, k] + i
                        if d >= 0:
                            begin[e, i] += factor * history[j, frame, d]
        for p in range(s.size):
            behind = s[p] <= s_o and s_o > 0.0
            side = 0 if behind else 1
            at, last = 0, n_el - 1
            while at < last:
                half = (at + last) // 2
                e = side * n_el + half
                if span[e, 0] + span[e, 1] * knots[side, half + 1] < s[p]:
                    at = half + 1
                else:
                    last = half
            e, length = side * n_el + at, knots[side, at + 1] - knots[side, at]
            h, dh, ddh = span[e, 1], span[e, 3], span[e, 5]
            xi = min(knots[side, at + 1], max(knots[side, at], (s[p] - span[e, 0]) / h))
            x, c, dc = (xi - knots[side, at]) / length, span[e, 2] + dh * xi, span[e, 4] + ddh * xi
            for i in range(n_fields):
                value[0, i], value[1, i], value[2, i], slope[i], rate[i] = 0.0, 0.0, 0.0, 0.0, begin[e, i]
            for k in range(n_loc):
                d = n_fields * dofs[e, k]
                if d < 0:
                    continue
                phi, phi_x, part = 0.0, 0.0, 0.0
                for m in range(n_loc - 1, -1, -1):
                    phi_x = phi_x * x + phi
                    phi = phi * x + shapes[k, m]
                    part = part * x + once[k, m]
                part *= x * length
                for i in range(n_fields):
                    q, v, a = history[0, frame, d + i], history[1, frame, d + i], history[2, frame, d + i]
                    value[0, i] += phi * q
                    value[1, i] += phi * v
                    slope[i] += phi_x / (length * h) * q
                    rate[i] += part * (ddh * q + 2.0 * dh * v + h * a)
            for i in range(n_fields):
                if behind:
                    start = ends[frame, 0, i]
                else:
                    d = n_fields * node + i
                    start = ends[frame, 2, i] + 2.0 * ds * history[1, frame, d] + dds * history[0, frame, d]
                out[0, frame, p, i] = value[0, i]
                out[1, frame, p, i] = value[1, i] - c * slope[i]
                out[2, frame, p, i] = slope[i]
                out[3, frame, p, i] = start + rate[i] - 2.0 * c * value[1, i] - dc * value[0, i]
            speed[frame, p] = c


@compiled
def add_end_forces(mesh, n_left, cable, s_o, q, v, a, points, out):
    """Add to out (4, 2) what `end_forces` sums over the cable at an instant, of P2 elements: loops are written out.

    points : (9, n_el n_q) workspace.
    """
    span, dofs, tab = mesh
    s, du, dv, fx, fy, px, py, wx, wy = (
        points[0], points[1], points[2], points[3], points[4], points[5], points[6], points[7], points[8]
    )  # fmt: skip
    for e in range(dofs.shape[0]):
        h, dh = span[e, 1], span[e, 3]
        per_h = 1.0 / h if h > 0.0 else 0.0
        for g in range(2):
            xi = tab[e, g, 0]
            c, dc = span[e, 2] + dh * xi, span[e, 4] + span[e, 5] * xi
            vx, vy, ax, ay, qx, qy, zx, zy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(3):
                d = 2 * dofs[e, k]
                if d >= 0:
                    phi, grad = tab[e, g, 2 + k], tab[e, g, 5 + k]
                    vx += phi * v[d]
                    vy += phi * v[d + 1]
                    ax += phi * a[d]
                    ay += phi * a[d + 1]
                    qx += grad * q[d]
                    qy += grad * q[d + 1]
                    zx += grad * v[d]
                    zy += grad * v[d + 1]
            p = 2 * e + g
            s[p], du[p], dv[p] = span[e, 0] + h * xi, qx * per_h, qy * per_h
            px[p], py[p] = h * ax + dh * vx - dc * qx - c * zx, h * ay + dh * vy - dc * qy - c * zy
            wx[p], wy[p] = c * (vx - c * du[p]), c * (vy - c * dv[p])
    for p in range(s.size):
        xp, yp, T = at_rest(cable, s[p])
        fx[p], fy[p], _, _, _, _, _ = pull(xp, yp, T, du[p], dv[p], cable[0], cable[3])
    for e in range(dofs.shape[0]):
        h, left = span[e, 1], e < n_left
        if h == 0.0:
            continue
        side, near, end = (s_o, 1, 0) if left else (1.0 - s_o, 2, 3)
        for g in range(2):
            p, weight = 2 * e + g, tab[e, g, 1]
            chi, share = (s[p] / side if left else (s[p] - 1.0) / side), h / side
            x = weight * (chi * px[p] + share * (wx[p] + fx[p]))
            y = weight * (chi * py[p] + share * (wy[p] + fy[p]))
            back = -weight if left else weight
            out[near, 0] += x
            out[near, 1] += y
            out[end, 0] += x + back * px[p]
            out[end, 1] += y + back * py[p]


@compiled
def end_forces(mesh, n_left, node, cable, kinematics, spans, rise, q, v, a, ends):
    """Set f - c^2 w' at the left support, behind and ahead of the mass and at the right support, of a history.

    Momentum of a side of a mesh that moves with c, tested with any phi:
    int d(h w.)/dt phi dxi + int (c w. + f) phi' ds = [(f + c w.) phi], w. = dq/dt phi_k - c w'; here with phi = 1 and
    with the phi that rises linearly from 0 at the support to 1 at the mass.  f is the internal force less its static
    part, of the one-field models with N - tau = rise; c is 0 at the supports and ds_o at the mass.

    spans : (n, n_el, 6) or none;  ends : (n, 4, n_fields);  the span of a mesh that just follows is overwritten: one at
    rest is all left of s_o = 1.
    """
    dofs, tab = mesh.dofs, mesh.tab
    n_el, n_loc = dofs.shape
    n_fields = ends.shape[2]
    alpha, law = cable[0], cable[3]
    unused = np.empty((8, 3))
    value, grad, f = np.empty((3, 2)), np.empty((3, 2)), np.empty(2)
    p2 = n_fields == 2 and n_loc == 3 and tab.shape[1] == 2
    points = np.empty((9, n_el * tab.shape[1] if p2 else 0))
    for n in range(rise.size):
        out, s_o = ends[n], kinematics[n, 0]
        span = at_instant(spans, n, kinematics, n_left, unused, mesh.span)
        out[:] = 0.0
        if p2:
            add_end_forces(Mesh(span, dofs, tab), n_left, cable, s_o, q[n], v[n], a[n], points, out)
        for e in range(0 if p2 else n_el):
            left = e < n_left
            h, dh = span[e, 1], span[e, 3]
            if h == 0.0:
                continue
            side, sign = (s_o, 1.0) if left else (1.0 - s_o, -1.0)
            for g in range(tab.shape[1]):
                xi, weight = tab[e, g, 0], tab[e, g, 1]
                s, c, dc = span[e, 0] + h * xi, span[e, 2] + dh * xi, span[e, 4] + span[e, 5] * xi
                chi = (s if left else 1.0 - s) / side
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
                if n_fields == 2:
                    xp, yp, T = at_rest(cable, s)
                    f[0], f[1], _, _, _, _, _ = pull(xp, yp, T, grad[0, 0] / h, grad[0, 1] / h, alpha, law)
                else:  # cable = (alpha, tau, curvature, lam, kap, law)
                    w_s = grad[0, 0] / h
                    f[0] = cable[1] * w_s + rise[n] * (cable[2] * (0.5 - s) + cable[4] * w_s)
                for i in range(n_fields):
                    w_t = value[1, i] - c / h * grad[0, i]
                    momentum = h * value[2, i] + dh * value[1, i] - dc * grad[0, i] - c * grad[1, i]
                    force = weight * (sign * chi * momentum + h / side * (c * w_t + f[i]))
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
            if s_o == 0.0:  # the left part has no length yet
                out[0, i] = out[1, i] = out[2, i]


@compiled
def energies(mesh, fine, n_left, cable, n_fields, kinematics, spans, q, v, parts, least, where):
    """Set energies (3, n): kinetic, of strain, of weight; least tension and its s (n,) of a history.

    mesh : with the points of the forces, spans as in `end_forces`; fine : tab with those of inertia.
    """
    unused = np.empty((8, 3))
    for i in range(least.size):
        span = at_instant(spans, i, kinematics, n_left, unused, mesh.span)
        at = Mesh(span, mesh.dofs, mesh.tab)
        parts[0, i] = kinetic_energy(Mesh(span, mesh.dofs, fine), n_fields, q[i], v[i])
        if n_fields == 2:
            parts[1, i], parts[2, i], least[i], where[i] = cable_energy(at, cable, q[i])
        else:
            parts[1, i], least[i] = chord_energy(at, cable, q[i])


@compiled
def kinetic_energy(mesh, n_fields, q, v):
    """Return int |w.|^2/2 ds, w. = dq/dt phi - c q phi' the velocity at fixed s on a mesh that moves with c."""
    if n_fields == 2 and mesh.dofs.shape[1] == 3 and mesh.tab.shape[1] == 3:
        return kinetic_energy_of_p2(mesh, n_fields, q, v)
    return kinetic_energy_of_any(mesh, n_fields, q, v)


def kinetic_energy_of(fields, n_loc, n_q):
    """Return `kinetic_energy` for elements of so many functions and points, whose loops are written out; 0: for any."""

    @compiled
    def energy(mesh, n_fields, q, v):
        span, dofs, tab = mesh
        known, functions, points = (fields, n_loc, n_q) if fields > 0 else (n_fields, dofs.shape[1], tab.shape[1])
        twice = 0.0
        for e in range(dofs.shape[0]):
            h = span[e, 1]
            if h == 0.0:  # the left part has no length yet
                continue
            for g in range(points):
                c = span[e, 2] + span[e, 3] * tab[e, g, 0]
                flow, weight = c / h, h * tab[e, g, 1]
                for i in range(known):
                    rate = 0.0
                    for k in range(functions):
                        d = known * dofs[e, k] + i
                        if d >= 0:
                            rate += tab[e, g, 2 + k] * v[d] - flow * tab[e, g, 2 + functions + k] * q[d]
                    twice += weight * rate * rate
        return 0.5 * twice

    return energy


kinetic_energy_of_p2, kinetic_energy_of_any = kinetic_energy_of(2, 3, 3), kinetic_energy_of(0, 0, 0)


@compiled
def cable_energy(mesh, cable, q):
    """Return int W ds, -int sigma v ds, the pointwise least tension and its s; full cable."""
    if mesh.dofs.shape[1] == 3 and mesh.tab.shape[1] == 2:
        return cable_energy_of_p2(mesh, cable, q)
    return cable_energy_of_any(mesh, cable, q)


def cable_energy_of(n_loc, n_q):
    """Return `cable_energy` for elements of so many functions and points, as above."""

    @compiled
    def energy(mesh, cable, q):
        span, dofs, tab = mesh
        functions, points = (n_loc, n_q) if n_loc > 0 else (dofs.shape[1], tab.shape[1])
        alpha, sigma, law = cable[0], cable[1], cable[3]
        at = np.empty((5, dofs.shape[0] * points))
        s, du, dv, deep, N = at[0], at[1], at[2], at[3], at[4]
        for e in range(dofs.shape[0]):
            per_h = 1.0 / span[e, 1] if span[e, 1] > 0.0 else 0.0
            for g in range(points):
                x, y, v0 = 0.0, 0.0, 0.0
                for k in range(functions):
                    d = dofs[e, k]
                    if d >= 0:
                        x += tab[e, g, 2 + functions + k] * q[2 * d]
                        y += tab[e, g, 2 + functions + k] * q[2 * d + 1]
                        v0 += tab[e, g, 2 + k] * q[2 * d + 1]
                p = e * points + g
                s[p], du[p], dv[p], deep[p] = span[e, 0] + span[e, 1] * tab[e, g, 0], x * per_h, y * per_h, v0
        for p in range(s.size):
            xp, yp, T = at_rest(cable, s[p])
            _, _, _, _, _, W, eps = pull(xp, yp, T, du[p], dv[p], alpha, law)
            N[p], du[p] = tension(eps, T, alpha, ELASTIC)[0], W
        strain, potential, least, where = 0.0, 0.0, math.inf, 0.0
        for e in range(dofs.shape[0]):
            if span[e, 1] == 0.0:  # the left part has no length yet
                continue
            for g in range(points):
                p, weight = e * points + g, span[e, 1] * tab[e, g, 1]
                if least > N[p]:
                    least, where = N[p], s[p]
                strain += weight * du[p]
                potential -= weight * sigma * deep[p]
        return strain, potential, least, where

    return energy


cable_energy_of_p2, cable_energy_of_any = cable_energy_of(3, 2), cable_energy_of(0, 0)


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
