"""Tension from equilibrium: the jump law, and the other wing's tension; reactions: tests/damping."""

import numpy as np
import pytest

from cablefem.elements.following import FollowingElements
from galerkin.bases import Daubechies, Fourier
from galerkin.equations import GalerkinSystem
from tests.runs import INCLINED, march_with_positions, observe


def test_the_jump_law_is_the_hats_own_equation():
    """[N t - ds_o^2 r'] = -contact to Newton's tolerance but for the angle of t, which is pointwise."""
    system = GalerkinSystem(INCLINED, Fourier(10), kink=True)
    states, s_o = march_with_positions(system, 200, until=0.5)
    x = observe(system, states)
    ds_o = np.array([system.motion.position_with_rates(t, 0)[1] for t in states.t])[:, None]
    force = system.mu * INCLINED.sigma

    def defect(T_behind, T_ahead):
        def flux(T, r):
            return T[:, None] * r / np.hypot(*r.T)[:, None] - ds_o**2 * r

        jump = flux(T_ahead, x.slope_ahead) - flux(T_behind, x.slope_behind)
        return np.abs(np.sum((jump + x.contact) * x.slope_behind, axis=1))[s_o > 0.05].max() / force

    # along r' behind; the recovered forces themselves, not their sizes, keep it to Newton's tolerance
    assert defect(x.T_behind, x.T_ahead) < 2e-3
    assert defect(x.T_behind_pointwise, x.T_ahead_pointwise) > 0.1


@pytest.mark.parametrize("basis", [Fourier(10), Daubechies(4, 1)], ids=["sines", "db4"])
def test_against_the_slopes_of_elements(basis):
    """Of H, rms; steps stay below what axial waves of a sudden entry would need, so the scene starts from rest."""
    elements = FollowingElements(INCLINED, elements=16, degree=2)
    states, places = march_with_positions(elements, 1000, until=0.82)
    theirs = observe(elements, states)
    states, s_o = march_with_positions(GalerkinSystem(INCLINED, basis, kink=True), 500, until=0.8)
    mine, inside = observe(GalerkinSystem(INCLINED, basis, kink=True), states), s_o > 0.02

    def errors(kind):
        gaps = [
            getattr(mine, side + kind) - np.interp(s_o, places[1:], getattr(theirs, side + "_pointwise")[1:])
            for side in ("T_behind", "T_ahead")
        ]
        return [float(np.sqrt(np.mean(gap[inside] ** 2))) for gap in gaps]

    assert max(errors("")) < 3e-4
    assert min(errors("_pointwise")) > 10.0 * max(errors(""))
