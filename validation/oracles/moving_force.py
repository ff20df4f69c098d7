"""A constant force that crosses a taut string at constant speed.

    v_tt - v_xx = P delta(x - V t),  v(0, t) = v(1, t) = 0,  at rest at t = 0.

G(x, z) = min(x, z)(1 - max(x, z)) is continued as Go(x, z), odd and of period 2 in z:
    t <= 1/V:  v = P/(1-V^2) [ G(x, Vt) - V Go(x, t) ],
    t > 1/V:   v = P V/(1-V^2) [ Go(x, t - 1/V + 1) - Go(x, t) ]

Source: Fryba 1972
Validity: 0 <= x <= 1, t >= 0, V > 0 but 1
Accuracy: rounding over |1 - V^2|
Group: A force on a taut string
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from cablefem.scene import ConstantSpeed
from validation.oracles.case import MU, SIGMA, Array, Crossing, level_string_groups, refuse_unless


def displacement(x: ArrayLike, t: ArrayLike, *, P: float, V: float) -> Array:
    """v(x, t) of the string, of the common shape of x and t."""
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    on_string = (x >= 0.0) & (x <= 1.0)
    refuse_unless("0 <= x <= 1 on the string, t >= 0, speed > 0 but 1", on_string, t >= 0.0, V > 0.0, V != 1.0)
    under_force = continued_green_function(x, V * t)
    first_wave = continued_green_function(x, t)
    last_wave = continued_green_function(x, t - 1.0 / V + 1.0)
    during = (under_force - V * first_wave) / (1.0 - V * V)
    after = V * (last_wave - first_wave) / (1.0 - V * V)
    return P * np.where(t * V <= 1.0, during, after)


def continued_green_function(x: Array, z: Array) -> Array:
    """Go(x, z): G(x, z) continued beyond the supports, odd and of period 2 in z."""
    z = np.mod(z, 2.0)
    sign = np.where(z > 1.0, -1.0, 1.0)
    z = np.where(z > 1.0, 2.0 - z, z)
    return sign * np.minimum(x, z) * (1.0 - np.maximum(x, z))


FRONT = "a force without inertia sends off a front with a jump of slope at once"


def cases() -> Iterator[Crossing]:
    """Comparisons with the solvers, wrong ones among them."""
    yield _crossing_at(0.37)
    yield _crossing_at(0.95, ", near the wave speed")


def _crossing_at(V: float, remark: str = "") -> Crossing:
    def exact(t: Array) -> Array:
        return displacement(V * t, t, P=MU * SIGMA, V=V)

    groups = level_string_groups(ConstantSpeed(speed=V).motion(1.0))
    methods = ("following-p1", "following-p2", "fourier", "fourier-kink")
    orders = {"following-p2": 1.2, "fourier-kink": 1.5}
    return Crossing(
        name=f"speed {V:g}{remark}", groups=groups, load="force", exact=exact, methods=methods,
        because=FRONT, max_order=1.0, orders=orders,
    )  # fmt: skip
