"""Overshoot of the tension beside the mass.

A sum of N smooth functions has ripples of wavelength 1/N at the kink.  Their size in the tension does not depend on N
(Gibbs).
"""

import numpy as np

from cablefem.elements.following import FollowingElements
from cablefem.newmark import integrate, scheme, step_times
from cablefem.response import Array
from cablefem.scene import Groups
from galerkin.bases import Basis
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.commands.paper.runs import SAID
from validation.core.sampling import stacked

ASKED = SAID["overshoot"]
PLACES = np.linspace(ASKED["places"]["first"], ASKED["places"]["last"], ASKED["places"]["count"])


def _tensions(system: GalerkinSystem | FollowingElements, distances: Array) -> Array:
    """T at s_o -+ each distance (m,) at every one of PLACES, (places, 2 m)."""
    states = []
    wanted = list(PLACES)
    for x in integrate(system, scheme("trapezoidal"), step_times(system, ASKED["steps"])):
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


def overshoots(groups: Groups, ladders: dict[str, list[int]]) -> dict[str, list[dict[str, float]]]:
    """Overshoots of every method for the numbers of terms of its ladder; the scene must stay taut."""
    return {method: [overshoot(groups, method, terms) for terms in ladder] for method, ladder in ladders.items()}


def overshoot(groups: Groups, method: str, terms: int) -> dict[str, float]:
    """Largest |T - T_converged|/H between half a wavelength and two of them from the mass.

    size : mean over PLACES;  spread : standard error of the mean.
    """
    distances = np.linspace(0.5, 2.0, 120) / terms
    basis: Basis = Fourier(terms) if method != "wavelet" else next(
        w for w in (Daubechies(order=4, level=level, reading="literal") for level in range(9)) if w.n == terms
    )  # fmt: skip
    reference = _tensions(FollowingElements(groups, elements=24, degree=2), distances)
    gap = np.abs(_tensions(GalerkinSystem(groups, basis, kink=method.endswith("kink")), distances) - reference)
    sizes = gap.max(axis=1)
    return {"terms": terms, "size": float(sizes.mean()), "spread": float(sizes.std(ddof=1) / np.sqrt(sizes.size))}
