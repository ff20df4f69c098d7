"""Free damped cables: the modes of a shallow one, and a string that is plucked.

Modes e^(i w t):  w_n = i c/2 + sqrt(W_n^2 - c^2/4), W_n by `irvine`.
Pulled aside by a force P at p, and let go at t = 0:

    y = e^(-c t/2) sum of 2 P sin^2(n pi p)/(n pi)^2 [ cos(w t) + c/(2 w) sin(w t) ],  w = sqrt(n^2 pi^2 - c^2/4).

High terms have w = n pi, and the sum (P/2) [ Go(p, p + t) + Go(p, p - t) ] (`moving_force`).

Source: Irvine & Caughey 1974 with damping; telegraph equation
Validity: small sag; c < 2 pi
Accuracy: modes rounding; string 1e-7 of P
Group: Damped cables
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from cablefem.scene.motion import rest_motion
from validation.oracles import irvine
from validation.oracles.case import BARE, BEST, MU, SIGMA, Array, Case, Law, Modes, Solvers, level_string_groups
from validation.oracles.moving_force import continued_green_function

END = 2.5  # of the string's motion


def damped_frequencies(undamped: Array, c: float) -> Any:
    """w_n, complex, of the undamped frequencies W_n."""
    return 0.5j * c + np.sqrt(undamped**2 - 0.25 * c**2 + 0j)


def displacement_at_released_point(t: Array, *, P: float, p: float, c: float) -> Array:
    """Displacement at p, of the shape of t, of a string that a force P has held there."""
    terms = 400
    n = np.pi * np.arange(1.0, terms + 1.0)
    w = np.sqrt(n**2 - 0.25 * c**2)
    phase = np.multiply.outer(t, w)
    undamped_phase = np.multiply.outer(t, n)
    late = np.cos(phase) + 0.5 * c / w * np.sin(phase) - np.cos(undamped_phase)
    at = np.array(p)
    to_right = continued_green_function(at, p + t)
    to_left = continued_green_function(at, p - t)
    undamped = 0.5 * P * (to_right + to_left)
    amplitudes = 2.0 * P * np.sin(n * p) ** 2 / n**2
    return np.exp(-0.5 * c * t) * (undamped + late @ amplitudes)


def cases() -> Iterator[Case]:
    """Comparisons with the solvers, wrong ones among them."""
    yield _free_vibration("four modes of the level cable, model sagged", 0.1)
    yield _free_vibration("the same, told 0.099", 0.099, expected="disagree")
    yield _released_string("plucked string, damping 0.8", 0.8)
    yield _released_string("the same, told 0.7", 0.7, expected="disagree")


def _free_vibration(name: str, c_exact: float, **kind: Any) -> Modes:
    """Frequencies and decays of a cable with damping 0.1 against those with damping `c_exact`."""
    undamped = irvine.lowest_frequencies(irvine.irvine_parameter(BARE.sigma, BARE.alpha), 4)
    exact = damped_frequencies(undamped, c_exact)
    groups = replace(BARE, damping=0.1)
    why = "stationary values: twice the degree; sines against their own ends"
    return Modes(name=name, groups=groups, model="sagged", exact=exact, order=3.0, because=why, methods=BEST, **kind)


def _released_string(name: str, c_exact: float, **kind: Any) -> Law:
    """A string let go with damping 0.8 against one with damping `c_exact`."""
    P = MU * SIGMA
    p = 0.3
    groups = replace(level_string_groups(rest_motion(p, END)), damping=0.8)
    why = "the kink runs away from the node or hat it starts on"

    def defect(solvers: Solvers, method: str, settings: dict[str, Any]) -> Array:
        t, y = solvers.release_string(method, groups, p, END, **settings)
        exact = displacement_at_released_point(t, P=P, p=p, c=c_exact)
        return (y - exact) / (P * p * (1.0 - p))

    return Law(name=name, defect=defect, order=1.0, because=why, **kind)
