"""Compiled sums and fields along the cable."""

import math

from cablefem.elements.kernels import compiled
from cablefem.elements.kernels.balance import at_rest, side_of, stretch
from cablefem.elements.kernels.law import tension


@compiled
def strains(cable, s_o, q, energy, least, where, force):
    """Set energy and tension of the full cable for q (n, n_dof).

    energy : (n,) int W ds;  least, where : (n,) least N (below 0: slack) and its s;
    force : (n, 2, 2) int f dxi of each side.
    """
    mesh, law, at = cable.mesh, cable.law, cable.points
    n_q = mesh.tab.shape[1]
    for n in range(s_o.size):
        stretch(cable, s_o[n], q[n])
        energy[n], least[n], where[n] = 0.0, math.inf, 0.0
        force[n] = 0.0
        for e in range(mesh.dofs.shape[0]):
            h, side = side_of(mesh, s_o[n], e)[1], 0 if e < mesh.n_left else 1
            for g in range(n_q if h > 0.0 else 0):  # the mass at the left support
                p, weight = e * n_q + g, mesh.tab[e, g, 1]
                N, T = at[8, p], at_rest(law, at[0, p])[2]
                if least[n] > N:
                    least[n], where[n] = N, at[0, p]
                energy[n] += weight * h * tension((N - T) / law[0], T, law[0], law[3])[2]
                force[n, side, 0] += weight * at[3, p]
                force[n, side, 1] += weight * at[4, p]


@compiled
def fields(mesh, shapes, e, x, of, out):
    """Set out (4, k, m, n_fields) to q, v, dq/dx and int r dx, at x (k, m) in elements e (k, m).

    of : (4, k, n, n_fields) q, v, r behind the mass and r ahead.
    """
    n_loc = shapes.shape[0]
    for k in range(e.shape[0]):
        for p in range(e.shape[1]):
            at, rate = x[k, p], 2 if e[k, p] < mesh.n_left else 3
            for i in range(out.shape[3]):
                out[0, k, p, i], out[1, k, p, i], out[2, k, p, i], out[3, k, p, i] = 0.0, 0.0, 0.0, 0.0
            for l in range(n_loc):
                d = mesh.dofs[e[k, p], l]
                if d < 0:
                    continue
                phi, phi_x, integral = 0.0, 0.0, 0.0
                for m in range(n_loc - 1, -1, -1):
                    phi_x = phi_x * at + phi
                    phi = phi * at + shapes[l, m]
                    integral = integral * at + shapes[l, m] / (m + 1.0)
                for i in range(out.shape[3]):
                    out[0, k, p, i] += phi * of[0, k, d, i]
                    out[1, k, p, i] += phi * of[1, k, d, i]
                    out[2, k, p, i] += phi_x * of[0, k, d, i]
                    out[3, k, p, i] += at * integral * of[rate, k, d, i]
