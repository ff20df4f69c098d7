"""A force that accelerates or brakes through the wave speed of an infinite string.

    v_tt - v_xx = P(t) delta(x - xi),  at rest at t = 0,  xi = V0 t + a t^2/2,
    v(x, t) = 1/2 int P(s) ds over the s in [0, t] with |x - xi(s)| < t - s.

Source: Flaherty 1968; Sagartz & Forrestal 1975
Validity: infinite string, any V0 and constant a
Accuracy: rounding; within d of the front at the wave speed 1e-16/sqrt(d)
Group: A force on a taut string
"""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from validation.oracles.case import (
    BEST,
    MU,
    SIGMA,
    Array,
    Crossing,
    level_string_groups,
    refuse_unless,
    travel_from_inside_string,
)


def displacement(x: ArrayLike, t: ArrayLike, *, P: float, V0: float = 0.0, a: float) -> Array:
    """v(x, t) of the string, of the common shape of x and t."""
    starts, ends = heard_emission_intervals(x, t, V0=V0, a=a)
    return 0.5 * np.sum(P * ends - P * starts, axis=-1)


def heard_emission_intervals(x: ArrayLike, t: ArrayLike, *, V0: float, a: float) -> tuple[Array, Array]:
    """Starts and ends (..., 5) of the intervals of s heard at (x, t): |x - xi(s)| < t - s."""
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    refuse_unless("V0 and a finite, t >= 0", math.isfinite(V0), math.isfinite(a), t >= 0.0)
    fronts_behind = _quadratic_roots(-0.5 * a, 1.0 - V0, x - t)
    fronts_ahead = _quadratic_roots(0.5 * a, 1.0 + V0, -x - t)
    cuts = [np.zeros_like(t), t]
    for root in (*fronts_behind, *fronts_ahead):
        real = np.where(np.isfinite(root), root, 0.0)
        cuts.append(np.clip(real, 0.0, t))
    edges = np.sort(np.stack(cuts, axis=-1), axis=-1)  # (..., 6)
    starts = edges[..., :-1]
    ends = edges[..., 1:]
    middle = 0.5 * (starts + ends)
    distance = np.abs(x[..., None] - middle * (V0 + 0.5 * a * middle))
    heard = distance < t[..., None] - middle
    return starts, np.where(heard, ends, starts)


def _quadratic_roots(c2: float, c1: float, c0: Array) -> tuple[Array, Array]:
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(c1 * c1 - 4.0 * c2 * c0)
        q = -0.5 * (c1 + math.copysign(1.0, c1) * root)
        return np.divide(q, c2), c0 / q


SUDDEN = "the force begins inside the string: two fronts with a jump of slope"
# no echo before s_o = 0.8
A = 2.6
BEGINS = 0.2


def _displacement_under_force(t: Array) -> Array:
    return displacement(0.5 * A * t * t, t, P=MU * SIGMA, a=A)


string = level_string_groups(travel_from_inside_string(BEGINS, 0.0, A))
slower = partial(
    Crossing, name="up to 0.89 of the wave speed", groups=string, start_position=BEGINS,
    until=BEGINS + 0.8 / (2.0 * A), methods=("fourier", "following-p2"),
)  # fmt: skip
faster = partial(slower, name="through the wave speed", until=0.8, methods=("fourier",))


def cases() -> Iterator[Crossing]:
    """Comparisons with the solvers, wrong ones among them."""
    front = "the front left behind at the wave speed has a vertical tangent"
    unstable = "none: faster than its waves, what rides with the load is unstable, the more the finer"
    force: dict[str, Any] = {"exact": _displacement_under_force, "load": "force"}
    yield slower(**force, because=SUDDEN, max_order=1.0)
    yield faster(**force, because=front, max_order=0.7)
    yield faster(**force, because=unstable, max_order=1.0, methods=BEST, expected="disagree")
