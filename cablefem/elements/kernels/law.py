"""The constitutive law."""

import math

from cablefem.elements.kernels import inner

ELASTIC = 0.0
TENSION_ONLY = 1.0


@inner
def tension(eps, T, alpha, law):
    """Return N = T + alpha eps, dN/deps and W = int N deps (3)-(4); tension-only: N >= 0."""
    N = T + alpha * eps
    if law == TENSION_ONLY and N <= 0.0:
        return 0.0, 0.0, -0.5 * T * T / alpha
    return N, alpha, (T + 0.5 * alpha * eps) * eps


@inner
def force_at_point(xp, yp, T, du, dv, alpha, law):
    """Return f = N t - T X' (2,), df/dw' = k_geo I + k_mat r' r'^T as its factors, N, W, eps; t = r'/|r'|."""
    rx = xp + du
    ry = yp + dv
    stretch = math.sqrt(rx * rx + ry * ry)
    eps = (2.0 * (xp * du + yp * dv) + du * du + dv * dv) / (stretch + 1.0)
    N, dN, W = tension(eps, T, alpha, law)
    inverse = 1.0 / stretch
    k_geo = N * inverse
    k_mat = (dN - k_geo) * (inverse * inverse)
    excess = ((N - T) - T * eps) * inverse
    return excess * xp + k_geo * du, excess * yp + k_geo * dv, k_geo, k_mat, N, W, eps
