"""The constitutive law: what tension a strain brings, how it grows, what it stores; and the pull that follows."""

import math

from cablefem.elements.kernels import compiled

ELASTIC, TENSION_ONLY = 0.0, 1.0  # laws in the tables of a cable


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
    inverse = 1.0 / stretch  # divisions take longest here
    k_geo = N * inverse
    k_mat = (dN - k_geo) * (inverse * inverse)
    excess = ((N - T) - T * eps) * inverse
    return excess * xp + k_geo * du, excess * yp + k_geo * dv, k_geo, k_mat, N, W, eps
