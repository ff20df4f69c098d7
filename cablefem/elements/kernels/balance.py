"""Forces of a cable with its mass, and their banded tangent."""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import compiled, inner
from cablefem.elements.kernels.law import ELASTIC, force_at_point, tension


class Mesh(NamedTuple):
    dofs: Any  # (n_el, n_loc) scalar unknowns, -1 on a support
    tab: Any  # (n_el, n_q, 2 + 2 n_loc) xi, weight, shape values, shape d/dxi
    n_left: int  # elements behind the mass
    functions: tuple  # n_loc entries, to unroll loops; or empty
    points: tuple  # the same with n_q


class Contact(NamedTuple):
    """Force of the mass, N^T (m a + c v + k q + load)."""

    dofs: Any  # (n_loc, n_fields)
    shape: Any  # (n_loc,)
    m_row: Any
    c_row: Any
    k_row: Any


class Cable(NamedTuple):
    mesh: Mesh
    law: Any  # (alpha, sigma, c, law); of one field see `add_chord`
    chord: Any  # True of one field, None of the full cable
    operators: Any  # (8, 2 b + 1, n_dof) diagonals of M^, G^, G^T, H^ of each side; fixed mesh: (1, ...) M
    points: Any  # (9, n_el n_q) workspace: s, r', f, df/dr' (xx, xy, yy), tension
    damping: float  # c_d


class Instant(NamedTuple):
    inputs: Any  # (3 + n_fields,) s_o, ds_o, dds_o, load of `Contact`; s_o = 1 on a fixed mesh
    bands: Any  # (3, 2 b + 1, n_dof) diagonals of M, C and K
    contact: Contact


@compiled
def assemble_inertia_and_damping(cable, now):
    """Set the diagonals of M, C and K, README.md, 2; on a fixed mesh C = c_d M and K = 0.

    Damping replaces w.. by w.. + c_d w.: dh/dt by dh/dt + c_d h, and dds_o by dds_o + c_d ds_o.
    """
    operators = cable.operators
    bands = now.bands
    n = now.bands.shape[2]
    c_d = cable.damping
    s_o = now.inputs[0]
    ds = now.inputs[1]
    dds = now.inputs[2] + c_d * now.inputs[1]
    bands[:] = 0.0
    moves = operators.shape[0] > 1
    first = now.contact.dofs[0, 0] if moves else n
    for side in range(2 if moves else 1):
        h, dh = (s_o, ds) if side == 0 else (1.0 - s_o, -ds)
        flux = ds * ds / h
        dh = dh + c_d * h
        rows = (0, min(n, first + now.contact.dofs.shape[1])) if side == 0 else (first, n)
        for d in range(bands.shape[1]):
            M = operators[side, d]
            m = bands[0, d]
            c = bands[1, d]
            k = bands[2, d]
            for i in range(rows[0], rows[1]):
                m[i] += h * M[i]
                c[i] += dh * M[i]
            if not moves:
                continue
            G = operators[2 + side, d]
            GT = operators[4 + side, d]
            H = operators[6 + side, d]
            for i in range(rows[0], rows[1]):
                c[i] += ds * (GT[i] - G[i])
                k[i] -= dds * G[i] + flux * H[i]


@compiled
def assemble(cable, now, x, r, tangent, factors):
    """Set the residual r at x, rows q, v, a, and, unless the factors are 0, the tangent.

    Return the least mean tension of an element and its s.
    """
    r[:] = 0.0
    ab = tangent.ab
    add_banded(now.bands, now.contact.dofs.shape[1], x, r, ab, factors)
    min_tension, min_at = add_internal(cable, cable.chord, now.inputs[0], x[0], r, tangent, factors)
    add_contact(now.contact, now.inputs[3:], x, r, ab, factors)
    return min_tension, min_at


@inner
def is_tangent_required(factors):
    return factors[0] != 0.0 or factors[1] != 0.0 or factors[2] != 0.0


@inner
def add_banded(bands, n_fields, x, r, ab, factors):
    """Add M a + C v + K q and its tangent."""
    width, n = bands.shape[1:]
    band = ab.shape[1] // 2
    c0, c1, c2 = factors
    q = x[0]
    v = x[1]
    a = x[2]
    for d in range(width):
        away = (d - width // 2) * n_fields
        first = max(0, -away)
        last = min(n, n - away)
        m = bands[0, d, first:last]
        c = bands[1, d, first:last]
        k = bands[2, d, first:last]
        of_q = q[first + away : last + away]
        of_v = v[first + away : last + away]
        of_a = a[first + away : last + away]
        to = r[first:last]
        for i in range(to.size):  # contiguous slices: vectorised
            to[i] += m[i] * of_a[i] + c[i] * of_v[i] + k[i] * of_q[i]
    if not is_tangent_required(factors):
        return
    ab[:] = 0.0
    blend = np.empty(n)
    for d in range(width):
        m = bands[0, d]
        c = bands[1, d]
        k = bands[2, d]
        at = band + (d - width // 2) * n_fields
        for i in range(n):
            blend[i] = c2 * m[i] + c1 * c[i] + c0 * k[i]
        for i in range(n):
            ab[i, at] = blend[i]


@inner
def add_contact(contact, load, x, r, ab, factors):
    dofs, shape, m_row, c_row, k_row = contact
    band = ab.shape[1] // 2
    c0, c1, c2 = factors
    for f in range(dofs.shape[1]):
        force = load[f]
        for j in range(dofs.shape[0]):
            d = dofs[j, f]
            force += m_row[j] * x[2, d] + c_row[j] * x[1, d] + k_row[j] * x[0, d]
        for i in range(dofs.shape[0]):
            row = dofs[i, f]
            r[row] += shape[i] * force
            for j in range(dofs.shape[0] if is_tangent_required(factors) else 0):
                ab[row, band + dofs[j, f] - row] += shape[i] * (c2 * m_row[j] + c1 * c_row[j] + c0 * k_row[j])


@inner
def add_internal(cable, chord, s_o, q, r, tangent, factors):
    if chord is None:
        set_strain_at_points(cable, s_o, q)
        return add_forces(cable, s_o, r, tangent.ab, factors[0])
    return add_chord(cable, s_o, q, r, tangent, factors), 0.5  # uniform tension


@inner
def hanging_cable_at(law, s):
    """Return x', y' and T of the hanging cable at s."""
    p = law[2] - law[1] * s
    T = math.sqrt(1.0 + p * p)
    xp = 1.0 / T
    return xp, p * xp, T


@inner
def element_map(mesh, s_o, e):
    """Return s at xi = 0 and ds/dxi of an element."""
    return (0.0, s_o) if e < mesh.n_left else (s_o, 1.0 - s_o)


@inner
def set_strain_at_points(cable, s_o, q):
    """Set the points of the full cable.

    Two loops: the second one is vectorised.
    """
    mesh = cable.mesh
    law = cable.law
    at = cable.points
    n_loc = len(mesh.functions) or mesh.dofs.shape[1]
    n_q = len(mesh.points) or mesh.tab.shape[1]
    s = at[0]
    rx = at[1]
    ry = at[2]
    fx = at[3]
    fy = at[4]
    j11 = at[5]
    j12 = at[6]
    j22 = at[7]
    N = at[8]
    alpha = law[0]
    kind = law[3]
    for e in range(mesh.dofs.shape[0]):
        s_0, h = element_map(mesh, s_o, e)
        per_h = 1.0 / h
        for g in range(n_q):
            x = 0.0
            y = 0.0
            for k in range(n_loc):
                d = mesh.dofs[e, k]
                if d >= 0:
                    grad = mesh.tab[e, g, 2 + n_loc + k]
                    x += grad * q[2 * d]
                    y += grad * q[2 * d + 1]
            p = e * n_q + g
            s[p] = s_0 + h * mesh.tab[e, g, 0]
            rx[p] = x * per_h
            ry[p] = y * per_h
    for p in range(s.size):
        xp, yp, T = hanging_cable_at(law, s[p])
        du = rx[p]
        dv = ry[p]
        x = xp + du
        y = yp + dv
        fx[p], fy[p], k_geo, k_mat, _, _, eps = force_at_point(xp, yp, T, du, dv, alpha, kind)
        rx[p] = x
        ry[p] = y
        j11[p] = k_geo + k_mat * x * x
        j12[p] = k_mat * x * y
        j22[p] = k_geo + k_mat * y * y
        N[p] = tension(eps, T, alpha, ELASTIC)[0]  # below zero where the cable is slack


@inner
def add_block(ab, row, col, j11, j12, j22):
    at = ab.shape[1] // 2 + 2 * (col - row)
    ab[2 * row, at] += j11
    ab[2 * row, at + 1] += j12
    ab[2 * row + 1, at - 1] += j12
    ab[2 * row + 1, at] += j22


@inner
def add_forces(cable, s_o, r, ab, c0):
    """Add int f . phi' ds and, unless c0 = 0, its tangent; return the least mean tension and its s."""
    dofs = cable.mesh.dofs
    tab = cable.mesh.tab
    at = cable.points
    n_loc = len(cable.mesh.functions) or dofs.shape[1]
    n_q = len(cable.mesh.points) or tab.shape[1]
    fx = at[3]
    fy = at[4]
    j11 = at[5]
    j12 = at[6]
    j22 = at[7]
    N = at[8]
    min_tension = math.inf
    min_at = 0.0
    for e in range(dofs.shape[0]):
        s_0, h = element_map(cable.mesh, s_o, e)
        total = 0.0
        length = 0.0
        per_h = c0 / h
        for g in range(n_q):
            total += tab[e, g, 1] * N[e * n_q + g]
            length += tab[e, g, 1]
        if min_tension * length > total:
            min_tension = total / length
            min_at = s_0 + 0.5 * h * (tab[e, 0, 0] + tab[e, -1, 0])
        for i in range(n_loc):
            row = dofs[e, i]
            if row < 0:
                continue
            x = 0.0
            y = 0.0
            for g in range(n_q):
                grad = tab[e, g, 1] * tab[e, g, 2 + n_loc + i]
                x += grad * fx[e * n_q + g]
                y += grad * fy[e * n_q + g]
            r[2 * row] += x
            r[2 * row + 1] += y
            for k in range(i + 1 if c0 != 0.0 else 0):
                col = dofs[e, k]
                if col < 0:
                    continue
                k11 = 0.0
                k12 = 0.0
                k22 = 0.0
                for g in range(n_q):
                    p = e * n_q + g
                    both = tab[e, g, 1] * tab[e, g, 2 + n_loc + i] * tab[e, g, 2 + n_loc + k]
                    k11 += both * j11[p]
                    k12 += both * j12[p]
                    k22 += both * j22[p]
                add_block(ab, row, col, per_h * k11, per_h * k12, per_h * k22)
                if k < i:
                    add_block(ab, col, row, per_h * k11, per_h * k12, per_h * k22)
    return min_tension, min_at


@inner
def add_chord(cable, s_o, q, r, tangent, factors):
    """Add the internal force of the one-field models; return the tension along the chord.

    T_chord w' + h (y_n' + kap w'), h = alpha eps, eps = lam int (y_n' w' + kap w'^2 / 2) ds;
    law = (alpha, T_chord, curvature, lam, kap, law), y_n' = curvature (1/2 - s).
    With u = int (y_n' + kap w') phi' ds, or 0 where the cable is slack, the tangent is A + c0 alpha lam u u^T.
    The border has u . x as its unknown.
    """
    mesh = cable.mesh
    at = cable.points
    ab, border = tangent
    wants = is_tangent_required(factors)
    alpha = cable.law[0]
    T_chord = cable.law[1]
    curvature = cable.law[2]
    lam = cable.law[3]
    kap = cable.law[4]
    dofs = mesh.dofs
    tab = mesh.tab
    n_el, n_loc = dofs.shape
    n_q = tab.shape[1]
    n = ab.shape[0]
    band = ab.shape[1] // 2
    eps = 0.0
    column = border[0]
    row = border[1]
    for e in range(n_el):
        s_0, h = element_map(mesh, s_o, e)
        for g in range(n_q):
            w = 0.0
            for k in range(n_loc):
                if dofs[e, k] >= 0:
                    w += tab[e, g, 2 + n_loc + k] / h * q[dofs[e, k]]
            y = curvature * (0.5 - (s_0 + h * tab[e, g, 0]))
            at[0, e * n_q + g] = w
            at[1, e * n_q + g] = y + kap * w
            eps += lam * tab[e, g, 1] * h * (y * w + 0.5 * kap * w * w)
    N, dN, _ = tension(eps, T_chord, alpha, cable.law[5])
    total = factors[0] + factors[1] + factors[2]  # scales the last row: linear in the factors
    if wants:
        border[:] = 0.0
        column[n] = -total
    for e in range(n_el):
        h = element_map(mesh, s_o, e)[1]
        for g in range(n_q):
            weight = tab[e, g, 1]
            w = at[0, e * n_q + g]
            y = at[1, e * n_q + g]
            stiffness = factors[0] * weight / h * (T_chord + kap * (N - T_chord))
            for i in range(n_loc):
                of = dofs[e, i]
                gi = tab[e, g, 2 + n_loc + i]
                if of < 0:
                    continue
                r[of] += weight * gi * (T_chord * w + (N - T_chord) * y)
                if not wants:
                    continue
                column[of] += factors[0] * lam * dN * weight * gi * y
                row[of] += total * weight * gi * y
                for j in range(n_loc):
                    if dofs[e, j] >= 0:
                        ab[of, band + dofs[e, j] - of] += gi * tab[e, g, 2 + n_loc + j] * stiffness
    return tension(eps, T_chord, alpha, ELASTIC)[0]
