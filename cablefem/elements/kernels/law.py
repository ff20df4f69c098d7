"""The constitutive law."""

import math
from typing import NamedTuple

from cablefem.elements.kernels import inner

ELASTIC = 0.0
TENSION_ONLY = 1.0


class PointForce(NamedTuple):
    """f = N t - T X' at a point of the cable, t = r'/|r'|; df/dw' = geometric I + material r' r'^T."""

    x: float
    y: float
    geometric: float
    material: float
    N: float
    energy: float  # W
    strain: float  # |r'| - 1


@inner
def tension_stiffness_energy(strain: float, T: float, alpha: float, law: float) -> tuple[float, float, float]:
    """Return N = T + alpha strain, dN/dstrain and W = int N dstrain (3)-(4); tension-only: N >= 0."""
    N = T + alpha * strain
    if law == TENSION_ONLY and N <= 0.0:
        return 0.0, 0.0, -0.5 * T * T / alpha
    return N, alpha, (T + 0.5 * alpha * strain) * strain


@inner
def force_at_point(xp: float, yp: float, T: float, du: float, dv: float, alpha: float, law: float) -> PointForce:
    """The force at X' = (xp, yp) and w' = (du, dv)."""
    rx = xp + du
    ry = yp + dv
    stretch = math.sqrt(rx * rx + ry * ry)
    strain = (2.0 * (xp * du + yp * dv) + du * du + dv * dv) / (stretch + 1.0)
    N, dN, W = tension_stiffness_energy(strain, T, alpha, law)
    inverse = 1.0 / stretch
    geometric = N * inverse
    material = (dN - geometric) * (inverse * inverse)
    excess = ((N - T) - T * strain) * inverse
    return PointForce(excess * xp + geometric * du, excess * yp + geometric * dv, geometric, material, N, W, strain)
