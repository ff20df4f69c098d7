"""Tension from equilibrium: its balances by plain quadrature, the jump law, and the other wing's tension."""

import numpy as np
import pytest

from cablefem.elements.following import FollowingElements
from cablefem.response import States
from galerkin.bases import Daubechies, Fourier
from galerkin.equations import GalerkinSystem
from tests.galerkin.test_equations import STEEP, halves, random_state, shapes
from tests.runs import INCLINED, march, observe


@pytest.mark.parametrize("basis", [Fourier(5), Daubechies(4, 0)], ids=["sines", "db4"])
@pytest.mark.parametrize("kink", [True, False])
def test_the_balances_by_quadrature(basis, kink):
    """Any state: accelerations at fixed s by differences in time of w itself, forces by their definition."""
    system, t, h = GalerkinSystem(STEEP, basis, kink=kink), 0.9, 1e-3
    q, v, a = random_state(system, 7, 3e-3)
    s_o = system.motion.at(t, 0)[0]
    s, weights = halves(s_o)
    stations = np.array([0.0, 0.21, s_o - 0.01, s_o + 0.01, 1.0])

    def displacement(at, tau):
        moved = (q + tau * v + 0.5 * tau**2 * a).reshape(2, -1)
        return moved @ shapes(system, at, system.motion.at(t + tau, 0)[0])[0].T

    def acceleration(at):
        """Away from the mass: its way in 2 h is 1e-3."""
        sums = (16.0, (h, -h)), (-30.0, (0.0,)), (-1.0, (2 * h, -2 * h))
        return sum(c * sum(displacement(at, tau) for tau in taus) for c, taus in sums) / (12.0 * h**2)

    def internal(at):
        T, *static = STEEP.static(at)[:3]
        r = np.array(static) + q.reshape(2, -1) @ shapes(system, at, s_o)[1].T
        return (T + STEEP.alpha * (np.hypot(*r) - 1.0)) / np.hypot(*r) * r - T * np.array(static)

    def around(f):
        """f without the places that the kink passes while differences are taken: a polynomial goes on there."""
        near = np.abs(s - s_o) < 3e-3
        values = f(s)
        for side in (s < s_o, s > s_o):
            fit = side & ~near & (np.abs(s - s_o) < 0.2)
            for row in values:
                row[side & near] = np.polyval(np.polyfit(s[fit] - s_o, row[fit], 6), s[side & near] - s_o)
        return values

    w_tt, G, behind = around(acceleration), internal(s), s < s_o
    G_behind = (G * weights + w_tt * weights * s)[:, behind].sum(axis=1) / s_o
    G_ahead = (G * weights - w_tt * weights * (1 - s))[:, ~behind].sum(axis=1) / (1 - s_o)
    left = G_behind - (w_tt * weights)[:, behind].sum(axis=1)
    right = G_ahead + (w_tt * weights)[:, ~behind].sum(axis=1)
    x = observe(system, States(np.array([t]), q[None], v[None], a[None], np.zeros(1, int)), stations, [0])
    T, xp, yp, _, _ = STEEP.static(np.array([0.0, s_o, 1.0]))
    rest = T * np.array([xp, yp])
    coarse = 1e-6 if isinstance(basis, Fourier) else 5e-3  # the wavelets' own rule for int G ds
    np.testing.assert_allclose(np.abs(x.T_behind), np.hypot(*(G_behind + rest[:, 1])), rtol=coarse)
    np.testing.assert_allclose(np.abs(x.T_ahead), np.hypot(*(G_ahead + rest[:, 1])), rtol=coarse)
    np.testing.assert_allclose(x.reaction_left[0], -(left + rest[:, 0]), rtol=0.0, atol=coarse)
    np.testing.assert_allclose(x.reaction_right[0], right + rest[:, 2], rtol=0.0, atol=coarse)
    np.testing.assert_allclose(np.abs(x.T[0, [0, -1]]), [np.hypot(*x.reaction_left[0]), np.hypot(*x.reaction_right[0])])
    assert abs(x.T_behind[0] - x.T_behind_pointwise[0]) > 1e-2  # a random state is in no balance


def test_the_jump_law_is_the_hats_own_equation():
    """[N t - ds_o^2 r'] = -contact to Newton's tolerance but for the angle of t, which is pointwise."""
    system = GalerkinSystem(INCLINED, Fourier(10), kink=True)
    states, s_o = march(system, 200, until=0.5)
    x = observe(system, states)
    ds_o = np.array([system.motion.at(t, 0)[1] for t in states.t])[:, None]
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
    states, places = march(elements, 1000, until=0.82)
    theirs = observe(elements, states)
    states, s_o = march(GalerkinSystem(INCLINED, basis, kink=True), 500, until=0.8)
    mine, inside = observe(GalerkinSystem(INCLINED, basis, kink=True), states), s_o > 0.02

    def errors(kind):
        gaps = [
            getattr(mine, side + kind) - np.interp(s_o, places[1:], getattr(theirs, side + "_pointwise")[1:])
            for side in ("T_behind", "T_ahead")
        ]
        return [float(np.sqrt(np.mean(gap[inside] ** 2))) for gap in gaps]

    assert max(errors("")) < 3e-4
    assert min(errors("_pointwise")) > 10.0 * max(errors(""))
