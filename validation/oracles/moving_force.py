"""A constant force that crosses a taut string at constant speed.

    v_tt - v_xx = P delta(x - V t),  v(0, t) = v(1, t) = 0,  at rest at t = 0.

G(x, z) = min(x, z)(1 - max(x, z)) is continued as Go(x, z), odd and of period 2 in z:
    t <= 1/V:  v = P/(1-V^2) [ G(x, Vt) - V Go(x, t) ],             V = 1:  (P/2) [ G(x, t) - t dG/dz(x, t) ]
    t > 1/V:   v = P V/(1-V^2) [ Go(x, t - 1/V + 1) - Go(x, t) ],   V = 1:  -(P/2) dGo/dz(x, t)

Source: Fryba 1972
Validity: 0 <= x <= 1, t >= 0, V > 0
Accuracy: rounding over |1 - V^2|; V = 1 itself is exact
Group: A force on a taut string
"""

import numpy as np
from numpy.typing import ArrayLike

from cablefem.scene import ConstantSpeed
from validation.oracles.case import MU, SIGMA, Array, Crossing, level, needs


def displacement(x: ArrayLike, t: ArrayLike, *, P: float, V: float) -> Array:
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    needs("0 <= x <= 1 on the string, t >= 0, speed > 0", x >= 0.0, x <= 1.0, t >= 0.0, V > 0.0)
    inside = t * V <= 1.0
    if V == 1.0:
        return np.where(inside, 0.5 * P * (green(x, t) - t * _green_slope(x, t)), -0.5 * P * _green_slope(x, t))
    during = (green(x, V * t) - V * green(x, t)) / (1.0 - V * V)
    after = V * (green(x, t - 1.0 / V + 1.0) - green(x, t)) / (1.0 - V * V)
    return P * np.where(inside, during, after)


def green(x: Array, z: Array) -> Array:
    """Go(x, z)."""
    z = np.mod(z, 2.0)
    sign, z = np.where(z > 1.0, -1.0, 1.0), np.where(z > 1.0, 2.0 - z, z)
    return sign * np.minimum(x, z) * (1.0 - np.maximum(x, z))


def _green_slope(x: Array, z: Array) -> Array:
    """dGo/dz; at z = x ahead."""
    z = np.mod(z, 2.0)
    return np.where(np.minimum(z, 2.0 - z) <= x, 1.0 - x, -x)


FRONT = "a force without inertia sends off a front with a jump of slope at once"


def cases() -> list[Crossing]:
    def at(V: float, told: str = "") -> Crossing:
        return Crossing(
            name=f"speed {V:g}{told}", groups=level(ConstantSpeed(speed=V).motion(1.0)), load="force",
            exact=lambda t: displacement(V * t, t, P=MU * SIGMA, V=V),
            methods=("following-p1", "following-p2", "fourier", "fourier-kink"), because=FRONT, at_most=1.0,
            orders={"following-p2": 1.2, "fourier-kink": 1.5},
        )  # fmt: skip

    return [at(0.37), at(0.95, ", near the wave speed")]
