"""Forces of a cable with its mass, and their banded tangent."""

import math
from typing import Any, NamedTuple

import numpy as np

from cablefem.elements.kernels import compiled, inner
from cablefem.elements.kernels.banded import Tangent
from cablefem.elements.kernels.law import ELASTIC, force_at_point, tension_stiffness_energy
from cablefem.newmark import Array

Factors = tuple[float, float, float]  # of dr/dq, dr/dv, dr/da in a tangent; 0, 0, 0: no tangent is wanted
MinTension = tuple[float, float]  # least mean tension of an element, and the s of its middle


class Mesh(NamedTuple):
    dofs: Any  # (n_el, n_loc) scalar unknowns, -1 on a support
    tab: Any  # (n_el, n_q, 2 + 2 n_loc) xi, weight, shape values, shape d/dxi
    n_left: int  # elements behind the mass
    functions: tuple  # n_loc entries, to unroll loops; or empty
    points: tuple  # the same with n_q


class MassCoupling(NamedTuple):
    """Force of the mass, N^T (m a + c v + k q + load)."""

    dofs: Any  # (n_loc, n_fields)
    shape: Any  # (n_loc,)
    m_row: Any
    c_row: Any
    k_row: Any


class Cable(NamedTuple):
    mesh: Mesh
    law: Any  # (alpha, sigma, c, law); of one field see `add_chord_force_return_tension`
    chord: Any  # True of one field, None of the full cable
    operators: Any  # (8, 2 b + 1, n_dof) diagonals of M^, G^, G^T, H^ of each side; fixed mesh: (1, ...) M
    points: Any  # (9, n_el n_q) workspace: s, r', f, df/dr' (xx, xy, yy), tension
    damping: float  # c_d


class Instant(NamedTuple):
    inputs: Any  # (3 + n_fields,) s_o, ds_o, dds_o, load of `MassCoupling`; s_o = 1 on a fixed mesh
    bands: Any  # (3, 2 b + 1, n_dof) diagonals of M, C and K
    coupling: MassCoupling


@compiled
def set_mass_damping_stiffness_bands(cable: Cable, instant: Instant) -> None:
    """Set the bands of an instant to M, C and K, README.md, 2; on a fixed mesh C = c_d M and K = 0.

    Damping replaces w.. by w.. + c_d w.: dh/dt by dh/dt + c_d h, and dds_o by dds_o + c_d ds_o.
    """
    operators = cable.operators
    bands = instant.bands
    n = instant.bands.shape[2]
    c_d = cable.damping
    s_o = instant.inputs[0]
    ds = instant.inputs[1]
    dds = instant.inputs[2] + c_d * instant.inputs[1]
    bands[:] = 0.0
    moves = operators.shape[0] > 1
    first = instant.coupling.dofs[0, 0] if moves else n
    for side in range(2 if moves else 1):
        h, dh = (s_o, ds) if side == 0 else (1.0 - s_o, -ds)
        flux = ds * ds / h
        dh = dh + c_d * h
        rows = (0, min(n, first + instant.coupling.dofs.shape[1])) if side == 0 else (first, n)
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
def assemble_cable(
    cable: Cable, instant: Instant, x: Array, r: Array, tangent: Tangent, factors: Factors
) -> MinTension:
    """Set the residual r of a cable with its mass at x, rows q, v, a, and the tangent, if it is wanted."""
    r[:] = 0.0
    ab = tangent.ab
    n_fields = instant.coupling.dofs.shape[1]
    add_linear_force_to_residual(instant.bands, n_fields, x, r)
    if is_tangent_required(factors):
        set_linear_tangent_band(instant.bands, n_fields, ab, factors)
    min_tension, min_at = add_internal_force_return_min_tension(
        cable, cable.chord, instant.inputs[0], x[0], r, tangent, factors
    )
    add_mass_coupling(instant.coupling, instant.inputs[3:], x, r, ab, factors)
    return min_tension, min_at


@inner
def is_tangent_required(factors: Factors) -> bool:
    return factors[0] != 0.0 or factors[1] != 0.0 or factors[2] != 0.0


@inner
def add_linear_force_to_residual(bands: Array, n_fields: int, x: Array, r: Array) -> None:
    """Add M a + C v + K q to r."""
    width, n = bands.shape[1:]
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


@inner
def set_linear_tangent_band(bands: Array, n_fields: int, ab: Array, factors: Factors) -> None:
    """Set ab to c2 M + c1 C + c0 K."""
    width, n = bands.shape[1:]
    band = ab.shape[1] // 2
    c0, c1, c2 = factors
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
def add_mass_coupling(coupling: MassCoupling, load: Array, x: Array, r: Array, ab: Array, factors: Factors) -> None:
    """Add the force of the mass to r, and its tangent to ab, if it is wanted."""
    dofs, shape, m_row, c_row, k_row = coupling
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
def add_internal_force_return_min_tension(
    cable: Cable, chord: bool | None, s_o: float, q: Array, r: Array, tangent: Tangent, factors: Factors
) -> MinTension:
    """Add the internal force to r, and its tangent, if it is wanted; chord : of `cable`, an argument for numba."""
    if chord is None:
        set_forces_at_points(cable, s_o, q)
        add_point_forces_to_residual(cable, r)
        if factors[0] != 0.0:
            add_point_stiffness_to_band(cable, s_o, factors[0], tangent.ab)
        return smallest_element_mean_tension(cable, s_o)
    return add_chord_force_return_tension(cable, s_o, q, r, tangent, factors), 0.5  # uniform tension


@inner
def static_slope_and_tension_over_H(law: Array, s: float) -> tuple[float, float, float]:
    """Return x', y' and T of the hanging cable at s."""
    p = law[2] - law[1] * s
    T = math.sqrt(1.0 + p * p)
    xp = 1.0 / T
    return xp, p * xp, T


@inner
def side_begin_and_length(mesh: Mesh, s_o: float, e: int) -> tuple[float, float]:
    """Return the s at which the side of element e begins, and its length, which is ds/dxi."""
    return (0.0, s_o) if e < mesh.n_left else (s_o, 1.0 - s_o)


@inner
def set_forces_at_points(cable: Cable, s_o: float, q: Array) -> None:
    """Set `points` of the full cable: s, r', f, df/dr' and the tension.

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
        s_0, h = side_begin_and_length(mesh, s_o, e)
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
        xp, yp, T = static_slope_and_tension_over_H(law, s[p])
        du = rx[p]
        dv = ry[p]
        x = xp + du
        y = yp + dv
        f = force_at_point(xp, yp, T, du, dv, alpha, kind)
        fx[p] = f.x
        fy[p] = f.y
        rx[p] = x
        ry[p] = y
        j11[p] = f.geometric + f.material * x * x
        j12[p] = f.material * x * y
        j22[p] = f.geometric + f.material * y * y
        N[p] = tension_stiffness_energy(f.strain, T, alpha, ELASTIC)[0]  # below zero where the cable is slack


@inner
def smallest_element_mean_tension(cable: Cable, s_o: float) -> MinTension:
    """Return the smallest of the elements' mean tensions, by T at `points`, and the s of that element's middle."""
    tab = cable.mesh.tab
    N = cable.points[8]
    n_q = len(cable.mesh.points) or tab.shape[1]
    min_tension = math.inf
    min_at = 0.0
    for e in range(tab.shape[0]):
        total = 0.0
        length = 0.0
        for g in range(n_q):
            total += tab[e, g, 1] * N[e * n_q + g]
            length += tab[e, g, 1]
        if min_tension * length > total:
            min_tension = total / length
            begin, h = side_begin_and_length(cable.mesh, s_o, e)
            min_at = begin + 0.5 * h * (tab[e, 0, 0] + tab[e, -1, 0])
    return min_tension, min_at


@inner
def add_point_forces_to_residual(cable: Cable, r: Array) -> None:
    """Add int f . phi' ds to r, f at `points` of the full cable."""
    dofs = cable.mesh.dofs
    tab = cable.mesh.tab
    n_loc = len(cable.mesh.functions) or dofs.shape[1]
    n_q = len(cable.mesh.points) or tab.shape[1]
    fx = cable.points[3]
    fy = cable.points[4]
    for e in range(dofs.shape[0]):
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


@inner
def add_point_stiffness_to_band(cable: Cable, s_o: float, c0: float, ab: Array) -> None:
    """Add c0 times the derivatives of `add_point_forces_to_residual` to ab."""
    dofs = cable.mesh.dofs
    tab = cable.mesh.tab
    n_loc = len(cable.mesh.functions) or dofs.shape[1]
    n_q = len(cable.mesh.points) or tab.shape[1]
    j11 = cable.points[5]
    j12 = cable.points[6]
    j22 = cable.points[7]
    for e in range(dofs.shape[0]):
        per_h = c0 / side_begin_and_length(cable.mesh, s_o, e)[1]
        for i in range(n_loc):
            row = dofs[e, i]
            for k in range(i + 1 if row >= 0 else 0):
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
                add_symmetric_block(ab, row, col, per_h * k11, per_h * k12, per_h * k22)
                if k < i:
                    add_symmetric_block(ab, col, row, per_h * k11, per_h * k12, per_h * k22)


@inner
def add_symmetric_block(ab: Array, row: int, col: int, j11: float, j12: float, j22: float) -> None:
    """Add ((j11, j12), (j12, j22)) to a band at the scalar unknowns (row, col)."""
    at = ab.shape[1] // 2 + 2 * (col - row)
    ab[2 * row, at] += j11
    ab[2 * row, at + 1] += j12
    ab[2 * row + 1, at - 1] += j12
    ab[2 * row + 1, at] += j22


@inner
def add_chord_force_return_tension(
    cable: Cable, s_o: float, q: Array, r: Array, tangent: Tangent, factors: Factors
) -> float:
    """Add the internal force of the one-field models; return the tension along the chord.

    T_chord w' + h (y_n' + kap w'), h = alpha eps, eps = lam int (y_n' w' + kap w'^2 / 2) ds;
    law = (alpha, T_chord, curvature, lam, kap, law), y_n' = curvature (1/2 - s).
    With u = int (y_n' + kap w') phi' ds, or 0 where the cable is slack, the tangent is A + c0 alpha lam u u^T.
    The border has u . x as its unknown.
    """
    mesh = cable.mesh
    slopes = cable.points[0]
    with_sag = cable.points[1]
    ab, border = tangent
    wants = is_tangent_required(factors)
    alpha = cable.law[0]
    T_chord = cable.law[1]
    lam = cable.law[3]
    kap = cable.law[4]
    dofs = mesh.dofs
    tab = mesh.tab
    n_loc = dofs.shape[1]
    n_q = tab.shape[1]
    n = ab.shape[0]
    band = ab.shape[1] // 2
    column = border[0]
    row = border[1]
    eps = set_chord_slopes_return_strain(cable, s_o, q)
    N, dN, _ = tension_stiffness_energy(eps, T_chord, alpha, cable.law[5])
    total = factors[0] + factors[1] + factors[2]  # scales the last row: linear in the factors
    if wants:
        border[:] = 0.0
        column[n] = -total
    for e in range(dofs.shape[0]):
        h = side_begin_and_length(mesh, s_o, e)[1]
        for g in range(n_q):
            weight = tab[e, g, 1]
            w = slopes[e * n_q + g]
            y = with_sag[e * n_q + g]
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
    return tension_stiffness_energy(eps, T_chord, alpha, ELASTIC)[0]


@inner
def set_chord_slopes_return_strain(cable: Cable, s_o: float, q: Array) -> float:
    """Set w' and y_n' + kap w' at `points` 0 and 1 of a one-field model; return eps.

    See `add_chord_force_return_tension`.
    """
    curvature = cable.law[2]
    lam = cable.law[3]
    kap = cable.law[4]
    dofs = cable.mesh.dofs
    tab = cable.mesh.tab
    n_loc = dofs.shape[1]
    n_q = tab.shape[1]
    eps = 0.0
    for e in range(dofs.shape[0]):
        begin, h = side_begin_and_length(cable.mesh, s_o, e)
        for g in range(n_q):
            w = 0.0
            for k in range(n_loc):
                if dofs[e, k] >= 0:
                    w += tab[e, g, 2 + n_loc + k] / h * q[dofs[e, k]]
            y = curvature * (0.5 - (begin + h * tab[e, g, 0]))
            cable.points[0, e * n_q + g] = w
            cable.points[1, e * n_q + g] = y + kap * w
            eps += lam * tab[e, g, 1] * h * (y * w + 0.5 * kap * w * w)
    return eps
