"""Overshoot of the tension beside the mass.

A sum of N smooth functions has ripples of wavelength 1/N at the kink.  Their size in the tension does not depend on N
(Gibbs).
"""

import numpy as np

from cablefem.elements.following import FollowingElements
from cablefem.newmark import State, integrate, scheme, stack_states, step_times_by_phase
from cablefem.response import Array
from cablefem.scene import Groups
from galerkin.bases import Basis
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.commands.paper.runs import SETTINGS

OVERSHOOT = SETTINGS["overshoot"]
POSITIONS = np.linspace(*(OVERSHOOT["places"][end] for end in ("first", "last", "count")))


def _tensions_beside_mass_at_positions(system: GalerkinSystem | FollowingElements, offsets: Array) -> Array:
    """Run the system: T at s_o -+ each offset (m,) when the mass passes each of POSITIONS, (positions, 2 m)."""
    states: list[State] = []
    times = step_times_by_phase(system, OVERSHOOT["steps"])
    for x in integrate(system, scheme("trapezoidal"), times):
        if system.motion.position_with_rates(x.t, x.phase)[0] >= POSITIONS[len(states)]:
            states.append(x)
            if len(states) == POSITIONS.size:
                break
    history = stack_states(states)
    out = []
    for i, s_o in enumerate(system.motion.position(history.t)):
        s = np.r_[s_o - offsets[::-1], s_o + offsets]
        out.append(system.observe(history, s, np.array([i])).T_pointwise[0])
    return np.array(out)


def _wavelet_basis(terms: int) -> Basis:
    """The paper's set of so many wavelets."""
    sets = (Daubechies(order=4, level=level, reading="literal") for level in range(9))
    return next(wavelets for wavelets in sets if wavelets.n == terms)


def tension_overshoot_over_H(groups: Groups, method: str, terms: int) -> dict[str, float]:
    """Largest |T - T_converged|/H between half a wavelength and two of them from the mass.

    size : mean over POSITIONS;  spread : standard error of the mean.
    """
    offsets = np.linspace(0.5, 2.0, 120) / terms
    basis: Basis = _wavelet_basis(terms) if method == "wavelet" else Fourier(terms)
    few_terms = GalerkinSystem(groups, basis, kink=method.endswith("kink"))
    converged = FollowingElements(groups, elements=24, degree=2)
    T = _tensions_beside_mass_at_positions(few_terms, offsets)
    T_converged = _tensions_beside_mass_at_positions(converged, offsets)
    sizes = np.abs(T - T_converged).max(axis=1)  # (positions,)
    standard_error = sizes.std(ddof=1) / np.sqrt(sizes.size)
    return {"terms": terms, "size": float(sizes.mean()), "spread": float(standard_error)}
