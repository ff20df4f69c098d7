"""Compiled inner loops of the cable elements: the law, forces, banded tangents, Newton's method, energies.

The forces are those of `forms`, which says what they are; here is how they are summed fast, from tables that scikit-fem
filled on the reference meshes.  A step of these small systems costs more in interpreter than in arithmetic otherwise.

Common arguments
    q, v, a   (n_dof,)  unknowns, field index running fastest: dof * n_fields + field
    mesh      `Mesh`
    cable     (alpha, sigma, c, law) of the full cable, see `tension`, or `add_chord`'s
    ab        (n_dof, 3 b + 1) rows of a matrix of half-width b: ab[i, b + j - i] = A[i, j]; the last b columns are
              empty until rows are exchanged
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

compiled: Any = njit(cache=True, error_model="numpy")  # no test for a zero divisor: norms catch NaN and infinity


class Mesh(NamedTuple):
    """Elements at an instant, each in the xi of its side of the mass."""

    span: Any  # (n_el, 4) s at xi = 0, ds/dxi, mesh velocity at xi = 0, d/dxi of it
    dofs: Any  # (n_el, n_loc) scalar unknowns, -1 on a support
    tab: Any  # (n_el, n_q, 2 + 2 n_loc) xi, weight, shape values, shape d/dxi


class Contact(NamedTuple):
    """The mass on its cable, N^T (m a + c v + k q + load): shape functions N and rows m, c, k over the dofs."""

    dofs: Any  # (n_loc, n_fields)
    shape: Any  # (n_loc,)
    m_row: Any
    c_row: Any
    k_row: Any
    load: Any  # (n_fields,)


class Tangent(NamedTuple):
    """Workspace of a banded tangent and its factors; of the one-field models with `add_chord`'s increment."""

    ab: Any
    pivots: Any  # (2, n_dof) see `factorise`
    increment: Any  # (n_dof,) or empty
    coupled: Any


ELASTIC, TENSION_ONLY = 0.0, 1.0  # laws in the tables of a cable


# --- the law ----------------------------------------------------------------------------------------------------------
@compiled
def tension(eps, T, alpha, law):
    """Return N = T + alpha eps, dN/deps and W = int N deps (3)-(4); tension-only: N >= 0, a cable that cannot push.

    T : static tension, at eps = 0.  Past eps = -T/alpha a slack cable has given back all that it had stored.
    """
    N = T + alpha * eps
    if law == TENSION_ONLY and N <= 0.0:
        return 0.0, 0.0, -0.5 * T * T / alpha
    return N, alpha, (T + 0.5 * alpha * eps) * eps


@compiled
def pull(xp, yp, T, du, dv, alpha, law):
    """Return f = N t - T X' (2,), its derivative (k_geo I + k_mat r' r'^T) by w', N, W, eps; r' = X' + w', t = r'/|r'|.

    N t = (N/|r'|) r'; the static part is taken off without cancellation: f = 0 to the last bit where w' = 0.
    """
    rx, ry = xp + du, yp + dv
    stretch = math.sqrt(rx * rx + ry * ry)
    eps = (2.0 * (xp * du + yp * dv) + du * du + dv * dv) / (stretch + 1.0)
    N, dN, W = tension(eps, T, alpha, law)
    k_geo = N / stretch
    k_mat = (dN - k_geo) / (stretch * stretch)
    excess = ((N - T) - T * eps) / stretch
    return excess * xp + k_geo * du, excess * yp + k_geo * dv, k_geo, k_mat, N, W, eps


@compiled
def pulls(static, T, slope, alpha, law, force, N, W):
    """Set N t (n, 2), N and W (n,) where the static slope and tension are X' (n, 2), T (n,), the slope r' (n, 2)."""
    for i in range(T.size):
        xp, yp = static[i, 0], static[i, 1]
        fx, fy, _, _, N[i], W[i], _ = pull(xp, yp, T[i], slope[i, 0] - xp, slope[i, 1] - yp, alpha, law)
        force[i, 0], force[i, 1] = fx + T[i] * xp, fy + T[i] * yp


# --- forces and their tangents ----------------------------------------------------------------------------------------


@compiled
def follow(s_o, ds, dds, n_left, coefficients, span):
    """Set the factors of M^, G^, G^T, H^, left and right each, in M, C and K of a following mesh, and its spans."""
    coefficients[:] = 0.0
    for side in range(2):
        h, dh = (s_o, ds) if side == 0 else (1.0 - s_o, -ds)
        coefficients[side, 0] = h
        coefficients[side, 1] = dh
        coefficients[2 + side, 1] = -ds
        coefficients[2 + side, 2] = -dds
        coefficients[4 + side, 1] = ds
        coefficients[6 + side, 2] = -ds * ds / h
    for e in range(span.shape[0]):
        left = e < n_left
        span[e, 0] = 0.0 if left else s_o
        span[e, 1] = s_o if left else 1.0 - s_o
        span[e, 2] = 0.0 if left else ds
        span[e, 3] = ds if left else -ds


@compiled
def combine(operators, coefficients, bands):
    """Set the bands of M, C and K: sums of operators with their factors at this instant.

    operators : (n_op, n, 2 b + 1);  coefficients : (n_op, 3);  bands : (3, n, 2 b + 1).
    """
    bands[:] = 0.0
    for o in range(operators.shape[0]):
        for k in range(3):
            factor = coefficients[o, k]
            if factor != 0.0:
                for i in range(bands.shape[1]):
                    for j in range(bands.shape[2]):
                        bands[k, i, j] += factor * operators[o, i, j]


@compiled
def add_banded(bands, n_fields, q, v, a, r, ab, tangent, c0, c1, c2):
    """Add M a + C v + K q and its tangent for scalar operators shared by all fields; bands : (3, n, 2 b + 1)."""
    _, n, width = bands.shape
    b = width // 2
    band = (ab.shape[1] - 1) // 3
    for i in range(n):
        row = i * n_fields
        for k in range(max(0, b - i), min(width, n + b - i)):
            away = (k - b) * n_fields
            m, c, stiffness = bands[0, i, k], bands[1, i, k], bands[2, i, k]
            for at in range(row, row + n_fields):
                r[at] += m * a[at + away] + c * v[at + away] + stiffness * q[at + away]
            if tangent:
                x = c2 * m + c1 * c + c0 * stiffness
                for at in range(row, row + n_fields):
                    ab[at, band + away] += x


@compiled
def add_contact(contact, q, v, a, r, ab, tangent, c0, c1, c2):
    """Add the mass, see `Contact`."""
    dofs, shape, m_row, c_row, k_row, load = contact
    band = (ab.shape[1] - 1) // 3
    for f in range(dofs.shape[1]):
        force = load[f]
        for j in range(dofs.shape[0]):
            d = dofs[j, f]
            force += m_row[j] * a[d] + c_row[j] * v[d] + k_row[j] * q[d]
        for i in range(dofs.shape[0]):
            row = dofs[i, f]
            r[row] += shape[i] * force
            if tangent:
                for j in range(dofs.shape[0]):
                    ab[row, band + dofs[j, f] - row] += shape[i] * (c2 * m_row[j] + c1 * c_row[j] + c0 * k_row[j])


@compiled
def add_catenary(mesh, cable, q, r, ab, tangent, c0):
    """Add int (N t - T X') . phi' ds of the full cable; return the least mean tension of an element and its s."""
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    alpha, sigma, slope, law = cable[0], cable[1], cable[2], cable[3]
    band = (ab.shape[1] - 1) // 3
    least = math.inf
    where = 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        total = 0.0
        length = 0.0
        for g in range(tab.shape[1]):
            s = s_0 + h * tab[e, g, 0]
            weight = tab[e, g, 1]
            p = slope - sigma * s
            T = math.sqrt(1.0 + p * p)
            xp, yp = 1.0 / T, p / T
            du = 0.0
            dv = 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    grad = tab[e, g, 2 + n_loc + k]
                    du += grad * q[2 * d]
                    dv += grad * q[2 * d + 1]
            du /= h
            dv /= h
            fx, fy, k_geo, k_mat, _, _, eps = pull(xp, yp, T, du, dv, alpha, law)
            total += weight * tension(eps, T, alpha, ELASTIC)[0]  # below zero where the cable is slack
            length += weight
            if tangent:
                rx, ry = xp + du, yp + dv
                scale = c0 * weight / h
                j11 = scale * (k_geo + k_mat * rx * rx)
                j12 = scale * k_mat * rx * ry
                j22 = scale * (k_geo + k_mat * ry * ry)
            for i in range(n_loc):
                row = dofs[e, i]
                if row < 0:
                    continue
                gi = tab[e, g, 2 + n_loc + i]
                r[2 * row] += weight * gi * fx
                r[2 * row + 1] += weight * gi * fy
                if tangent:
                    for j in range(n_loc):
                        col = dofs[e, j]
                        if col < 0:
                            continue
                        gg = gi * tab[e, g, 2 + n_loc + j]
                        at = band + 2 * (col - row)
                        ab[2 * row, at] += gg * j11
                        ab[2 * row, at + 1] += gg * j12
                        ab[2 * row + 1, at - 1] += gg * j12
                        ab[2 * row + 1, at] += gg * j22
        if least * length > total:
            least, where = total / length, s_0 + 0.5 * h * (tab[e, 0, 0] + tab[e, -1, 0])
    return least, where


@compiled
def add_chord(mesh, chord, q, r, ab, increment, tangent, c0):
    """Add the internal force of the one-field models; return the tension along the chord, N = tau + h.

    Tested with phi': tau w' + h (y_n' + kap w'), h = alpha eps, eps = lam int (y_n' w' + kap w'^2 / 2) ds;
    chord = (alpha, tau, curvature, lam, kap, law), y_n' = curvature (1/2 - s).  With the tangent `increment` (n_dof,)
    receives int (y_n' + kap w') phi' ds: the tangent is banded plus lam dN/deps increment increment^T.
    """
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    alpha, tau, curvature, lam, kap, law = chord[0], chord[1], chord[2], chord[3], chord[4], chord[5]
    band = (ab.shape[1] - 1) // 3
    eps = 0.0
    n_q = tab.shape[1]
    slope = np.empty((n_el, n_q))
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        for g in range(n_q):
            w = 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    w += tab[e, g, 2 + n_loc + k] * q[d]
            w /= h
            slope[e, g] = w
            y = curvature * (0.5 - (s_0 + h * tab[e, g, 0]))
            eps += tab[e, g, 1] * h * (y * w + 0.5 * kap * w * w)
    eps *= lam
    N, dN, _ = tension(eps, tau, alpha, law)
    h_t = N - tau
    if tangent:
        increment[:] = 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        for g in range(n_q):
            weight = tab[e, g, 1]
            w = slope[e, g]
            y = curvature * (0.5 - (s_0 + h * tab[e, g, 0])) + kap * w
            f = tau * w + h_t * y
            stiffness = c0 * weight / h * (tau + kap * h_t)
            for i in range(n_loc):
                row = dofs[e, i]
                if row < 0:
                    continue
                gi = tab[e, g, 2 + n_loc + i]
                r[row] += weight * gi * f
                if tangent:
                    if dN > 0.0:
                        increment[row] += weight * gi * y
                    for j in range(n_loc):
                        col = dofs[e, j]
                        if col >= 0:
                            ab[row, band + col - row] += gi * tab[e, g, 2 + n_loc + j] * stiffness
    return tension(eps, tau, alpha, ELASTIC)[0]


@compiled
def assemble(bands, mesh, cable, contact, q, v, a, r, work, tangent, c0, c1, c2):
    """Set the residual of the cable with its mass and, if asked, the banded tangent; return as `add_catenary`.

    One field per node is a one-field model, `add_chord`, whose tension is least at no place in particular.
    """
    n_fields = contact.dofs.shape[1]
    r[:] = 0.0
    if tangent:
        work.ab[:] = 0.0
    add_banded(bands, n_fields, q, v, a, r, work.ab, tangent, c0, c1, c2)
    if n_fields == 2:
        least, where = add_catenary(mesh, cable, q, r, work.ab, tangent, c0)
    else:
        least, where = add_chord(mesh, cable, q, r, work.ab, work.increment, tangent, c0), 0.5
    add_contact(contact, q, v, a, r, work.ab, tangent, c0, c1, c2)
    return least, where


# --- banded solutions -------------------------------------------------------------------------------------------------
KEEP = 0.1  # a diagonal pivot stays while it is at least this part of its column's largest: rows then keep their width


@compiled
def factorise(ab, pivots):
    """Factorise a banded matrix in place, P A = L U, and return whether it is regular.

    Gaussian elimination with threshold pivoting (Duff, Erisman & Reid 1986, section 5.2): the tangents here are nearly
    always diagonally strong, and a row that keeps its place brings no new column in.  LAPACK's dgbtrf spends most of
    its time on calls for bands this narrow.

    pivots : (2, n); row exchanged with each row, and the last column that each row of U reaches.
    """
    n, width = ab.shape
    band = (width - 1) // 3
    for i in range(n):  # rows inside an element do not reach as far as the band
        last = min(n - 1, i + band)
        while last > i and ab[i, band + last - i] == 0.0:
            last -= 1
        pivots[1, i] = last
    for i in range(n):
        last = min(n - 1, i + band)
        largest, at = abs(ab[i, band]), i
        own = largest
        for k in range(i + 1, last + 1):
            size = abs(ab[k, band + i - k])
            if size > largest:
                largest, at = size, k
        if not (largest > 0.0 and largest < math.inf):
            return False
        if own >= KEEP * largest:
            at = i
        pivots[0, i] = at
        if at != i:
            end = max(pivots[1, i], pivots[1, at])
            for j in range(i, end + 1):
                x = ab[i, band + j - i]
                ab[i, band + j - i] = ab[at, band + j - at]
                ab[at, band + j - at] = x
            pivots[1, i], pivots[1, at] = pivots[1, at], pivots[1, i]
        reach = pivots[1, i]
        inverse = 1.0 / ab[i, band]
        for k in range(i + 1, last + 1):
            below = ab[k, band + i - k]
            if below != 0.0:
                factor = below * inverse
                ab[k, band + i - k] = factor
                shift = band - k
                for j in range(i + 1, reach + 1):
                    ab[k, shift + j] -= factor * ab[i, band - i + j]
                if reach > pivots[1, k]:
                    pivots[1, k] = reach
    return True


@compiled
def solve(ab, pivots, b):
    """Overwrite b (n,) with A^-1 b, A as `factorise` left it."""
    n, width = ab.shape
    band = (width - 1) // 3
    for i in range(n):
        at = pivots[0, i]
        x = b[at]
        if at != i:
            b[at] = b[i]
            b[i] = x
        for k in range(i + 1, min(n, i + band + 1)):
            b[k] -= ab[k, band + i - k] * x
    for i in range(n - 1, -1, -1):
        x = b[i]
        for j in range(i + 1, pivots[1, i] + 1):
            x -= ab[i, band + j - i] * b[j]
        b[i] = x / ab[i, band]


@compiled
def coupling(chord):
    """Return alpha lam, the strength of `add_chord`'s increment in the tangent; meaningless for the full cable."""
    return chord[0] * chord[3]


@compiled
def factorise_coupled(work, strength):
    """Factorise A + strength increment increment^T, A banded; return whether it is regular.

    Sherman & Morrison: a uniform tension increment couples all nodes through one vector.  The full cable has no such
    vector, its increment is empty.
    """
    regular = factorise(work.ab, work.pivots)
    if regular and work.increment.size > 0:
        work.coupled[:] = work.increment
        solve(work.ab, work.pivots, work.coupled)
        work.coupled[:] *= strength / (1.0 + strength * dot(work.increment, work.coupled))
    return regular


@compiled
def solve_coupled(work, b):
    """Overwrite b (n,) with the solution for the matrix that `factorise_coupled` has left."""
    solve(work.ab, work.pivots, b)
    if work.increment.size > 0:
        b -= dot(work.increment, b) * work.coupled


@compiled
def dot(a, b):
    """Return the scalar product; a call of BLAS takes longer at this length."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


# --- a car that rolls: its place is one more coordinate ---------------------------------------------------------------
FREE, HAUL, HELD = 0, 1, 2


class Car(NamedTuple):
    """The car at an instant, and what drives it.  `mode` FREE: the last unknown is s_o; HELD: it stays; HAUL: its
    acceleration is the force F of the rope along the mean tangent, and s_o, ds_o, dds_o are those given here.
    """

    mode: int
    node: int  # its scalar unknown
    mu: float
    sigma: float  # of its weight
    s_o: float
    ds: float
    dds: float
    hold: float  # force along the cable between cable and car: what is left of the one at the start
    thrust: float  # from outside, along the mean tangent
    drag: float  # k
    wind: float  # along x
    friction: float  # mu_r
    brake: float
    heading: float  # +1, -1: friction and brake act against it; 0: they do not act


class Rolling(NamedTuple):
    """What a car that rolls adds to the tangent: a border, column and row of the last unknown, and their solution."""

    n_left: int  # elements left of the car
    ends: Any  # (2, n_loc) slopes d/dxi of the functions of the last element behind the car, the first ahead
    border: Any  # (3, n) column, row, and the column solved
    corner: Any  # (1,)


@compiled
def car_forces(car, tau, stretch, px, py, fx, fy):
    """Return F_ext (2,) without the rope, the normal force n . C (positive: the car presses on the cable) and F_drive.

    tau : unit mean tangent (2,); stretch : mean |r'|; p : velocity; f : mu (p.. - sigma j).  n = (-tau_y, tau_x) points
    down, and C = f - F_ext is the cable's force on the car.
    """
    ux, uy = px - car.wind, py
    drag = -car.drag * math.sqrt(ux * ux + uy * uy)
    ex, ey = drag * ux + car.thrust * tau[0], drag * uy + car.thrust * tau[1]
    normal = (fx - ex) * tau[1] - (fy - ey) * tau[0]
    along = -car.heading * (car.friction * abs(normal) + car.brake)
    return ex, ey, normal, car.hold + stretch * along


@compiled
def mean_tangent(dofs, ends, n_left, s_o, xp, yp, q):
    """Return the unit tangent along the mean of the slopes r' behind and ahead of the car, and the mean of |r'|."""
    mx, my, stretch = 0.0, 0.0, 0.0
    for side in range(2):
        e, h = (n_left - 1, s_o) if side == 0 else (n_left, 1.0 - s_o)
        x, y = xp, yp
        for k in range(dofs.shape[1]):
            d = dofs[e, k]
            if d >= 0:
                x += ends[side, k] * q[2 * d] / h
                y += ends[side, k] * q[2 * d + 1] / h
        mx, my, stretch = mx + 0.5 * x, my + 0.5 * y, stretch + 0.5 * math.sqrt(x * x + y * y)
    size = math.sqrt(mx * mx + my * my)
    return (mx / size, my / size), stretch


@compiled
def roll(mesh, rolling, cable, car, q, v, a, r, ab, tangent, c0, c1, c2):
    """Set the residual of the cable with a car that rolls and, if asked, its bordered tangent.

    Return the least mean tension of an element and its s, the left side of the row of s_o, the normal force with which
    the car presses on the cable, and the mean |r'| at the car.

    With z = dq/dt phi - c q phi', the velocity of the cable at fixed s, the discrete Lagrangian of (q, s_o) is

        L = sum over sides of h int ( z^2/2 - D ) dxi + mu |p.|^2/2 + mu sigma p_y,  D = W - T X'.w',

    p = X(s_o) + w_m, c = ds_o chi, chi = xi on the left and 1 - xi on the right; s = s_o xi or s_o + h xi, w' = q
    phi_,xi/h.  The rows are Lagrange's equations, the last one that of s_o, with the force F_ext on p and F_drive on
    s_o.  The tangent leaves out what is small: the turning of the mean tangent, and parts of the derivative of the last
    row by s_o itself.
    """
    dofs, tab = mesh.dofs, mesh.tab
    n_el, n_loc = dofs.shape
    alpha, sigma, slope, law = cable[0], cable[1], cable[2], cable[3]
    band = (ab.shape[1] - 1) // 3
    n, m = q.size - 1, car.node
    s_o, ds, dds = (car.s_o, car.ds, car.dds) if car.mode == HAUL else (q[n], v[n], a[n])
    r[:] = 0.0
    if tangent:
        ab[:] = 0.0
        rolling.border[:] = 0.0
    if not 0.0 < s_o < 1.0:
        r[:] = math.nan  # the norm will tell
        return math.inf, s_o, math.nan, math.nan, math.nan
    column, row = rolling.border[0], rolling.border[1]
    of_s, corner = 0.0, 0.0
    least, where = math.inf, 0.0
    z_of, zt_of = np.empty(n_loc), np.empty(n_loc)
    for e in range(n_el):
        left = e < rolling.n_left
        s_0, h, sign = (0.0, s_o, 1.0) if left else (s_o, 1.0 - s_o, -1.0)
        total, length = 0.0, 0.0
        for g in range(tab.shape[1]):
            xi, weight = tab[e, g, 0], tab[e, g, 1]
            chi = xi if left else 1.0 - xi
            s = s_0 + h * xi
            p = slope - sigma * s
            T = math.sqrt(1.0 + p * p)
            xp, yp = 1.0 / T, p / T
            T_s, xpp, ypp = -sigma * yp, sigma * p / (T * T * T), -sigma / (T * T * T)
            ux, uy, vx, vy, dvx, dvy, ax, ay = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, grad = tab[e, g, 2 + k], tab[e, g, 2 + n_loc + k]
                    ux += grad * q[2 * d]
                    uy += grad * q[2 * d + 1]
                    vx += phi * v[2 * d]
                    vy += phi * v[2 * d + 1]
                    dvx += grad * v[2 * d]
                    dvy += grad * v[2 * d + 1]
                    ax += phi * a[2 * d]
                    ay += phi * a[2 * d + 1]
            k_s = chi / h  # dz/dds_o = -k_s q_,xi
            k_t = k_s * (dds - sign * ds * ds / h)
            zx, zy = vx - ds * k_s * ux, vy - ds * k_s * uy
            ztx, zty = ax - k_t * ux - ds * k_s * dvx, ay - k_t * uy - ds * k_s * dvy
            du, dv = ux / h, uy / h
            rx, ry = xp + du, yp + dv
            fx, fy, k_geo, k_mat, N, W, eps = pull(xp, yp, T, du, dv, alpha, law)
            total += weight * tension(eps, T, alpha, ELASTIC)[0]
            length += weight
            # D and its derivative by s at fixed w'; W depends on s through T and |X' + w'|
            D = W - T * (xp * du + yp * dv)
            bend = rx * xpp + ry * ypp
            D_s = (N - T) / alpha * T_s + k_geo * bend - T_s * (xp * du + yp * dv) - T * (xpp * du + ypp * dv)
            of_s += weight * (
                sign * (D - fx * du - fy * dv) + h * chi * D_s
                - chi * (dvx * zx + dvy * zy + ux * ztx + uy * zty)
                - sign * (0.5 * (zx * zx + zy * zy) + ds * k_s * (ux * zx + uy * zy))
            )  # fmt: skip
            gx, gy = sign * ds * zx + h * ztx, sign * ds * zy + h * zty
            hx, hy = ds * chi * zx + fx, ds * chi * zy + fy
            for i in range(n_loc):
                d = dofs[e, i]
                if d >= 0:
                    phi, grad = weight * tab[e, g, 2 + i], weight * tab[e, g, 2 + n_loc + i]
                    r[2 * d] += phi * gx + grad * hx
                    r[2 * d + 1] += phi * gy + grad * hy
            if not tangent:
                continue
            # what z, dz/dt and f gain with s_o, ds_o, dds_o at fixed q
            k_1 = sign * k_s / h
            yx, yy = chi * xpp - sign / h * du, chi * ypp - sign / h * dv
            along = k_mat * (rx * yx + ry * yy) + (0.0 if N == 0.0 else chi * T_s / (1.0 + eps))
            f_sx = k_geo * yx + along * rx - chi * (T_s * xp + T * xpp)
            f_sy = k_geo * yy + along * ry - chi * (T_s * yp + T * ypp)
            z_x, z_y = (c0 * ds * k_1 - c1 * k_s) * ux, (c0 * ds * k_1 - c1 * k_s) * uy
            by_u = c1 * 2.0 * ds * k_1 - c2 * k_s - c0 * (ds * ds * k_s / (h * h) - k_1 * (dds - sign * ds * ds / h))
            by_du = c0 * ds * k_1 - c1 * k_s
            zt_x, zt_y = by_u * ux + by_du * dvx, by_u * uy + by_du * dvy
            corner += weight * (
                c0 * h * (k_geo * (yx * yx + yy * yy) + k_mat * (rx * yx + ry * yy) ** 2)
                - chi * (dvx * z_x + dvy * z_y + ux * zt_x + uy * zt_y)
                - sign * (zx * z_x + zy * z_y + ds * k_s * (ux * z_x + uy * z_y) + c1 * k_s * (ux * zx + uy * zy))
            )  # fmt: skip
            g_x = sign * (c1 * zx + ds * z_x + c0 * ztx) + h * zt_x
            g_y = sign * (c1 * zy + ds * z_y + c0 * zty) + h * zt_y
            h_x = chi * (c1 * zx + ds * z_x) + c0 * f_sx
            h_y = chi * (c1 * zy + ds * z_y) + c0 * f_sy
            j11 = c0 / h * (k_geo + k_mat * rx * rx)
            j12 = c0 / h * k_mat * rx * ry
            j22 = c0 / h * (k_geo + k_mat * ry * ry)
            k_q = c0 * k_t + c1 * ds * k_s
            for i in range(n_loc):
                phi, grad = tab[e, g, 2 + i], tab[e, g, 2 + n_loc + i]
                z_of[i], zt_of[i] = c1 * phi - c0 * ds * k_s * grad, c2 * phi - k_q * grad
            for i in range(n_loc):
                d = dofs[e, i]
                if d < 0:
                    continue
                phi, grad = weight * tab[e, g, 2 + i], weight * tab[e, g, 2 + n_loc + i]
                column[2 * d] += phi * g_x + grad * h_x
                column[2 * d + 1] += phi * g_y + grad * h_y
                by_z, by_zt, by_grad = weight * z_of[i], weight * chi * zt_of[i], chi * c1 + sign * ds * k_s * c0
                row[2 * d] += (
                    grad * (c0 * (f_sx - chi * ztx) - by_grad * zx) - by_zt * ux
                    - by_z * (chi * dvx + sign * (zx + ds * k_s * ux))
                )  # fmt: skip
                row[2 * d + 1] += (
                    grad * (c0 * (f_sy - chi * zty) - by_grad * zy) - by_zt * uy
                    - by_z * (chi * dvy + sign * (zy + ds * k_s * uy))
                )  # fmt: skip
                of_z, of_zt = phi * sign * ds + grad * ds * chi, phi * h
                for j in range(n_loc):
                    d_j = dofs[e, j]
                    if d_j < 0:
                        continue
                    same = of_z * z_of[j] + of_zt * zt_of[j]
                    gg = grad * tab[e, g, 2 + n_loc + j]
                    at = band + 2 * (d_j - d)
                    ab[2 * d, at] += same + gg * j11
                    ab[2 * d, at + 1] += gg * j12
                    ab[2 * d + 1, at - 1] += gg * j12
                    ab[2 * d + 1, at] += same + gg * j22
        if least * length > total:
            least, where = total / length, s_0 + 0.5 * h * (tab[e, 0, 0] + tab[e, -1, 0])

    p = slope - sigma * s_o
    T = math.sqrt(1.0 + p * p)
    xp, yp, xpp, ypp = 1.0 / T, p / T, sigma * p / (T * T * T), -sigma / (T * T * T)
    px, py = v[2 * m] + xp * ds, v[2 * m + 1] + yp * ds
    fx = car.mu * (a[2 * m] + xp * dds + xpp * ds * ds)
    fy = car.mu * (a[2 * m + 1] + yp * dds + ypp * ds * ds - car.sigma)
    tau, stretch = mean_tangent(dofs, rolling.ends, rolling.n_left, s_o, xp, yp, q)
    ex, ey, normal, drive = car_forces(car, tau, stretch, px, py, fx, fy)
    if car.mode == HAUL:
        ex, ey = ex + a[n] * tau[0], ey + a[n] * tau[1]
    r[2 * m] += fx - ex
    r[2 * m + 1] += fy - ey
    of_s += xp * (fx - ex) + yp * (fy - ey) - drive
    r[n] = car.mu * a[n] if car.mode == HELD else of_s
    if not tangent:
        return least, where, of_s, normal, stretch

    at = band
    ux, uy = px - car.wind, py
    size = math.sqrt(ux * ux + uy * uy)
    d11, d12, d22 = 0.0, 0.0, 0.0  # drag by velocity
    if size > 0.0:
        d11, d12, d22 = (
            car.drag * (size + ux * ux / size),
            car.drag * ux * uy / size,
            car.drag * (size + uy * uy / size),
        )
    ab[2 * m, at] += c2 * car.mu + c1 * d11
    ab[2 * m, at + 1] += c1 * d12
    ab[2 * m + 1, at - 1] += c1 * d12
    ab[2 * m + 1, at] += c2 * car.mu + c1 * d22
    # friction follows the normal force, and that the accelerations
    rub = stretch * car.heading * car.friction * (1.0 if normal > 0.0 else -1.0) * car.mu * c2
    row[2 * m] += c2 * car.mu * xp + c1 * (d11 * xp + d12 * yp) + rub * tau[1]
    row[2 * m + 1] += c2 * car.mu * yp + c1 * (d12 * xp + d22 * yp) - rub * tau[0]
    if car.mode == FREE:
        column[2 * m] += car.mu * (c2 * xp + (c1 * 2.0 * ds + c0 * dds) * xpp) + c1 * (d11 * xp + d12 * yp)
        column[2 * m + 1] += car.mu * (c2 * yp + (c1 * 2.0 * ds + c0 * dds) * ypp) + c1 * (d12 * xp + d22 * yp)
        corner += c2 * car.mu + c1 * (d11 * xp * xp + 2.0 * d12 * xp * yp + d22 * yp * yp)
        corner += rub * (xp * tau[1] - yp * tau[0]) + c0 * (xpp * (fx - ex) + ypp * (fy - ey))
    else:
        column[:] = 0.0
        if car.mode == HAUL:
            column[2 * m], column[2 * m + 1] = -c2 * tau[0], -c2 * tau[1]
            corner = -c2 * (xp * tau[0] + yp * tau[1])
        else:
            row[:] = 0.0
            corner = c2 * car.mu
    rolling.corner[0] = corner
    return least, where, of_s, normal, stretch


@compiled
def look(dofs, ends, n_left, cable, car, q, v, a):
    """Return the normal force with which the car presses on the cable, mean |r'|, and p. along the mean tangent.

    And the force of weight, thrust and drag along it, of weight across it, F_ext and the force on s_o.
    """
    car = Car(*car)  # a plain tuple, as in `settle`
    n, m, sigma = q.size - 1, car.node, cable[1]
    s_o, ds, dds = (car.s_o, car.ds, car.dds) if car.mode == HAUL else (q[n], v[n], a[n])
    p = cable[2] - sigma * s_o
    T = math.sqrt(1.0 + p * p)
    xp, yp, bend = 1.0 / T, p / T, sigma * ds * ds / (T * T * T)
    px, py = v[2 * m] + xp * ds, v[2 * m + 1] + yp * ds
    fx = car.mu * (a[2 * m] + xp * dds + p * bend)
    fy = car.mu * (a[2 * m + 1] + yp * dds - bend - car.sigma)
    tau, stretch = mean_tangent(dofs, ends, n_left, s_o, xp, yp, q)
    ex, ey, normal, drive = car_forces(car, tau, stretch, px, py, fx, fy)
    weight = car.mu * car.sigma
    along = ex * tau[0] + (ey + weight) * tau[1]
    return normal, stretch, px * tau[0] + py * tau[1], along, weight * tau[0], ex, ey, xp * ex + yp * ey + drive


@compiled
def kinetic(mesh, n_left, node, mu, cable, q, v, w, momentum, gradient):
    """Set M(q) v and the gradient by q of v . M(q) w / 2 at fixed v and w, cable and car; all (n + 1,), s_o last."""
    dofs, tab = mesh.dofs, mesh.tab
    n_el, n_loc = dofs.shape
    n = q.size - 1
    s_o, dv, dw = q[n], v[n], w[n]
    momentum[:] = 0.0
    gradient[:] = 0.0
    u, z, y = np.empty(2), np.empty(2), np.empty(2)
    for e in range(n_el):
        left = e < n_left
        h, sign = (s_o, 1.0) if left else (1.0 - s_o, -1.0)
        for g in range(tab.shape[1]):
            xi, weight = tab[e, g, 0], tab[e, g, 1]
            chi = xi if left else 1.0 - xi
            u[:] = 0.0
            z[:] = 0.0
            y[:] = 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, grad = tab[e, g, 2 + k], tab[e, g, 2 + n_loc + k]
                    for i in range(2):
                        u[i] += grad * q[2 * d + i]
                        z[i] += phi * v[2 * d + i] - dv * chi / h * grad * q[2 * d + i]
                        y[i] += phi * w[2 * d + i] - dw * chi / h * grad * q[2 * d + i]
            for i in range(2):  # velocities z, y at fixed s
                momentum[n] -= weight * chi * u[i] * z[i]
                gradient[n] += 0.5 * weight * sign * (z[i] * y[i] + chi / h * u[i] * (dv * y[i] + dw * z[i]))
                for k in range(n_loc):
                    d = dofs[e, k]
                    if d >= 0:
                        momentum[2 * d + i] += weight * h * tab[e, g, 2 + k] * z[i]
                        gradient[2 * d + i] -= 0.5 * weight * chi * tab[e, g, 2 + n_loc + k] * (dv * y[i] + dw * z[i])
    p = cable[2] - cable[1] * s_o
    T = math.sqrt(1.0 + p * p)
    slope, bend = (1.0 / T, p / T), (cable[1] * p / (T * T * T), -cable[1] / (T * T * T))
    for i in range(2):
        pv, pw = v[2 * node + i] + slope[i] * dv, w[2 * node + i] + slope[i] * dw
        momentum[2 * node + i] += mu * pv
        momentum[n] += mu * slope[i] * pv
        gradient[n] += 0.5 * mu * bend[i] * (dv * pw + dw * pv)


@compiled
def factorise_bordered(work, rolling):
    """Factorise the banded tangent and its border; return whether it is regular."""
    column, row, solved = rolling.border
    regular = factorise(work.ab, work.pivots)
    if regular:
        solved[:] = column
        solve(work.ab, work.pivots, solved)
        rolling.corner[0] -= dot(row, solved)
    return regular and rolling.corner[0] != 0.0


@compiled
def solve_bordered(work, rolling, b):
    """Overwrite b (n + 1,) with the solution for the matrix that `factorise_bordered` has left."""
    x = b[:-1]
    solve(work.ab, work.pivots, x)
    last = (b[-1] - dot(rolling.border[1], x)) / rolling.corner[0]
    x -= last * rolling.border[2]
    b[-1] = last


# --- Newton's method --------------------------------------------------------------------------------------------------
@compiled
def correct(start, rule, share, da, now, balanced):
    """Take share da off the rows q, v, a of the step's end, and set where the balance is taken; (3, n)."""
    for i in range(3):
        part, w = share * rule[i, 3], rule[i, 4]
        for j in range(da.size):
            now[i, j] -= part * da[j]
            balanced[i, j] = w * now[i, j] + (1.0 - w) * start[i, j]


@compiled
def settle(grip, ride, mesh, cable, work, start, now, rule, bound, max_iter, reuse, patience):
    """Find the end of a step by Newton's method as `cablefem.newmark.iterate` does, compiled with the balance.

    grip : operators, coefficients, bands and `Contact` of a mass whose place is given, or None.
    ride : `Rolling` and `Car` of one that rolls, or None; numba compiles what is there only.
    mesh, work and the rest as plain tuples: it is slow to take in named ones.
    Return |r|, iterations, factorisations, residuals, the least tension and its s.
    """
    mesh, work = Mesh(*mesh), Tangent(*work)
    n = start.shape[1]
    balanced, r, da = np.empty((3, n)), np.empty(n), np.zeros(n)
    q, v, a = balanced[0], balanced[1], balanced[2]
    if grip is not None:
        bands, contact = grip[2], Contact(*grip[3])
        combine(grip[0], grip[1], bands)
    if ride is not None:
        rolling, car = Rolling(*ride[0]), Car(*ride[1])
    for i in range(3):
        for j in range(n):
            now[i, j] = rule[i, 0] * start[0, j] + rule[i, 1] * start[1, j] + rule[i, 2] * start[2, j]
    c0, c1, c2 = rule[0, 3] * rule[0, 4], rule[1, 3] * rule[1, 4], rule[2, 3] * rule[2, 4]
    norm, factorisations, residuals, anew, regular = 0.0, 0, 0, True, True
    for iteration in range(max_iter):
        if anew:
            correct(start, rule, 0.0, da, now, balanced)
            if grip is not None:
                assemble(bands, mesh, cable, contact, q, v, a, r, work, True, c0, c1, c2)
                regular = factorise_coupled(work, c0 * coupling(cable))
            if ride is not None:
                roll(mesh, rolling, cable, car, q, v, a, r, work.ab, True, c0, c1, c2)
                regular = factorise_bordered(work, rolling)
            norm = math.sqrt(dot(r, r))
            factorisations += 1
        before = norm
        if not regular:  # pivots may never have been set
            r[:] = math.nan  # the norm will tell
        elif grip is not None:
            solve_coupled(work, r)
        elif ride is not None:
            solve_bordered(work, rolling, r)
        da[:] = r
        for halving in range(6):
            correct(start, rule, 1.0 if halving == 0 else -(0.5**halving), da, now, balanced)
            if grip is not None:
                least, where = assemble(bands, mesh, cable, contact, q, v, a, r, work, False, c0, c1, c2)
            if ride is not None:
                least, where, _, _, _ = roll(mesh, rolling, cable, car, q, v, a, r, work.ab, False, c0, c1, c2)
            residuals += 1
            norm = math.sqrt(dot(r, r))
            if norm < before or (iteration < patience and norm < math.inf):
                break
        if norm <= bound or not norm < math.inf:
            break
        anew = norm > reuse * before
    return norm, iteration + 1, factorisations, residuals, least, where


# --- observation ------------------------------------------------------------------------------------------------------
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
    alpha, sigma, slope, law = cable[0], cable[1], cable[2], cable[3]
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
                p = slope - sigma * s
                T = math.sqrt(1.0 + p * p)
                f[0], f[1], _, _, _, _, _ = pull(1.0 / T, p / T, T, grad[0, 0] / h, grad[0, 1] / h, alpha, law)
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
        at[0] = 0.0
        at[1] = total[side, low]
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
def cable_energy(mesh, cable, q, v):
    """Return int |w.|^2/2 ds, int W ds, -int sigma v ds, the pointwise least tension and its s; full cable.

    w. = dq/dt phi - c q phi', the velocity at fixed s on a mesh that moves with c.
    """
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    alpha, sigma, slope, law = cable[0], cable[1], cable[2], cable[3]
    kinetic, strain, potential = 0.0, 0.0, 0.0
    least = math.inf
    where = 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        for g in range(tab.shape[1]):
            xi = tab[e, g, 0]
            s = s_0 + h * xi
            c = span[e, 2] + span[e, 3] * xi
            p = slope - sigma * s
            T = math.sqrt(1.0 + p * p)
            du, dv, v0, ut, vt = 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, grad = tab[e, g, 2 + k], tab[e, g, 2 + n_loc + k] / h
                    du += grad * q[2 * d]
                    dv += grad * q[2 * d + 1]
                    v0 += phi * q[2 * d + 1]
                    ut += phi * v[2 * d] - c * grad * q[2 * d]
                    vt += phi * v[2 * d + 1] - c * grad * q[2 * d + 1]
            _, _, _, _, _, W, eps = pull(1.0 / T, p / T, T, du, dv, alpha, law)
            N = tension(eps, T, alpha, ELASTIC)[0]
            if least > N:
                least, where = N, s
            weight = tab[e, g, 1] * h
            kinetic += weight * 0.5 * (ut * ut + vt * vt)
            strain += weight * W
            potential -= weight * sigma * v0
    return kinetic, strain, potential, least, where


@compiled
def chord_energy(mesh, chord, q, v):
    """Return int w.^2/2 ds, int tau w'^2/2 ds + W - tau eps of the one-field models, and the tension tau + h."""
    span, dofs, tab = mesh
    n_el, n_loc = dofs.shape
    alpha, tau, curvature, lam, kap = chord[0], chord[1], chord[2], chord[3], chord[4]
    kinetic, strain = 0.0, 0.0
    eps = 0.0
    for e in range(n_el):
        s_0, h = span[e, 0], span[e, 1]
        for g in range(tab.shape[1]):
            xi = tab[e, g, 0]
            c = span[e, 2] + span[e, 3] * xi
            w, wt = 0.0, 0.0
            for k in range(n_loc):
                d = dofs[e, k]
                if d >= 0:
                    phi, grad = tab[e, g, 2 + k], tab[e, g, 2 + n_loc + k] / h
                    w += grad * q[d]
                    wt += phi * v[d] - c * grad * q[d]
            weight = tab[e, g, 1] * h
            y = curvature * (0.5 - (s_0 + h * xi))
            eps += weight * lam * (y * w + 0.5 * kap * w * w)
            kinetic += weight * 0.5 * wt * wt
            strain += weight * 0.5 * tau * w * w
    W = tension(eps, tau, alpha, chord[5])[2]
    return kinetic, strain + (W - tau * eps), tension(eps, tau, alpha, ELASTIC)[0]
