"""How far the tension overshoots beside the mass, sampled finely enough for any number of terms.

A sum of N smooth functions meets the kink at the mass with ripples one wavelength 1/N wide.  In the tension alpha
times their square is left, and its size does not depend on N: Gibbs' phenomenon.
"""

from dataclasses import dataclass

import numpy as np

from cablefem.elements.following import FollowingElements
from cablefem.newmark import integrate, scheme, step_times
from cablefem.response import Array
from cablefem.scene import Groups
from galerkin.bases import Basis
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.core.sampling import stacked

PLACES = np.linspace(0.25, 0.75, 11)  # s_o/l at which the tension is looked at
STEPS = 1000
TERMS = {"fourier": (10, 17, 30, 60, 120), "fourier-kink": (10, 30, 60), "wavelet": (10, 17, 31, 59)}
LEVEL = {10: 0, 17: 1, 31: 2, 59: 3}


@dataclass(frozen=True, slots=True)
class Overshoot:
    """Largest |T - T_converged|/H between half a wavelength and two of them from the mass."""

    terms: int
    size: float  # mean over PLACES
    spread: float  # standard error of the mean


def _tensions(system: GalerkinSystem | FollowingElements, distances: Array) -> Array:
    """Return T at s_o -+ each distance (m,) at every one of PLACES, (places, 2 m)."""
    states, wanted = [], list(PLACES)
    for x in integrate(system, scheme("trapezoidal"), step_times(system, STEPS)):
        if system.motion.at(x.t, x.phase)[0] >= wanted[0]:
            states.append(x)
            del wanted[0]
            if not wanted:
                break
    stack = stacked(states)
    s_o = system.motion.position(stack.t)
    return np.array([
        system.observe(stack, np.r_[place - distances[::-1], place + distances], np.array([i])).T_pointwise[0]
        for i, place in enumerate(s_o)
    ])  # fmt: skip


def overshoots(groups: Groups) -> dict[str, list[Overshoot]]:
    """Return the overshoot of every method for every number of terms; the scene must stay taut."""
    return {method: [overshoot(groups, method, terms) for terms in ladder] for method, ladder in TERMS.items()}


def overshoot(groups: Groups, method: str, terms: int) -> Overshoot:
    distances = np.linspace(0.5, 2.0, 120) / terms
    basis: Basis = Daubechies(order=4, level=LEVEL[terms], reading="literal") if method == "wavelet" else Fourier(terms)
    reference = _tensions(FollowingElements(groups, elements=24, degree=2), distances)
    gap = np.abs(_tensions(GalerkinSystem(groups, basis, kink=method.endswith("kink")), distances) - reference)
    sizes = gap.max(axis=1)
    return Overshoot(terms, float(sizes.mean()), float(sizes.std(ddof=1) / np.sqrt(sizes.size)))
