"""A mass at constant speed on a string without inertia: `moving_mass` for mu -> inf at fixed a, off by 1/mu.

    xi (1 - xi) Y'' + 2 a Y = 8 a xi (1 - xi),   Y(0) = Y'(0) = 0,   xi = V t/l,
    Y = y/(M g l/(4T)) = (4a/(a-1)) xi [ 1 - xi - 2F1((1+r)/2, (1-r)/2; 2; xi) ],   r = sqrt(1 + 8a),
    a = T l/(2 M V^2).

Source: Fryba 1972; Smith 1964
Validity: 0 <= xi <= 1, 0 < a <= 50 but 1
Accuracy: 1e-12 of the largest Y, 1e-15 a/|a-1| near a = 1
Group: A mass on a taut string
"""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import hyp2f1

from cablefem.scene import ConstantSpeed
from validation.oracles.case import SIGMA, Array, Crossing, Limit, Solvers, level, needs


def path(xi: ArrayLike, *, a: float) -> Array:
    xi = np.asarray(xi, float)
    needs("0 <= xi <= 1 on the string, 0 < a <= 50 but 1", 0.0 < a <= 50.0, a != 1.0, xi >= 0.0, xi <= 1.0)
    r = math.sqrt(1.0 + 8.0 * a)
    return 4.0 * a / (a - 1.0) * xi * (1.0 - xi - hyp2f1(0.5 * (1.0 + r), 0.5 * (1.0 - r), 2.0, xi))


def cases() -> list[Limit]:
    a = 0.7

    def deviation(solvers: Solvers, method: str, mu: float) -> Array:
        V = 1.0 / math.sqrt(2.0 * mu * a)
        crossing = Crossing(
            name="", groups=level(ConstantSpeed(speed=V).motion(1.0), mu),
            exact=lambda t: 0.25 * mu * SIGMA * path(np.minimum(V * t, 1.0), a=a),
        )  # fmt: skip
        return crossing.off(solvers.path(crossing, method, steps=round(150.0 / V)))

    return [
        Limit(
            name="limit of a heavy slow mass", refined="mass ratio", values=(5.0, 20.0, 80.0), falls=1.0,
            because="the string's own inertia is 1/(mass ratio) of the moving one", deviation=deviation,
        )
    ]  # fmt: skip
