"""Two equal forces that run apart on an infinite string.

    v_tt - v_xx = P [ delta(x - V t) + delta(x + V t) ],  at rest at t = 0;  the force that runs right gives
    (P/2) max(0, min((t-x)/(1-V), (t+x)/(1+V))).

Source: Kanninen & Florence 1967
Validity: infinite string, t >= 0, 0 < V < 1; faster: `accelerating_force`
Accuracy: rounding; over |1 - V| between the force and its wave front
Group: A force on a taut string
"""

import numpy as np
from numpy.typing import ArrayLike

from validation.oracles.accelerating_force import SUDDEN
from validation.oracles.case import MU, SIGMA, Array, Crossing, inside, level, needs


def one_force(x: ArrayLike, t: ArrayLike, *, P: float, V: float) -> Array:
    """v(x, t) under the force at x = V t."""
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    needs("0 < speed < 1, t >= 0", 0.0 < V < 1.0, t >= 0.0)
    return 0.5 * P * np.maximum(0.0, np.minimum((t - x) / (1.0 - V), (t + x) / (1.0 + V)))


def displacement(x: ArrayLike, t: ArrayLike, *, P: float, V: float) -> Array:
    return one_force(x, t, P=P, V=V) + one_force(-np.asarray(x, float), t, P=P, V=V)


def cases() -> list[Crossing]:
    V, begins = 0.55, 0.3
    return [
        Crossing(
            name="one of the two forces, until its waves come back", groups=level(inside(begins, V, 0.0)), load="force",
            exact=lambda t: one_force(V * t, t, P=MU * SIGMA, V=V), begins=begins,
            until=0.6, methods=("following-p1", "following-p2", "fourier", "fourier-kink"), because=SUDDEN, at_most=1.0,
        )
    ]  # fmt: skip
