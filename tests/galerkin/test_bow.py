"""Bubbles that ride with the hat: their shape, slope and inertia by quadrature, their amplitudes by a cable at rest."""

from __future__ import annotations

import numpy as np
import pytest

from cablefem.scene import statics
from galerkin.bases import Fourier
from galerkin.bases.kink import TravellingKink
from galerkin.bow import add_bows, bent, bow, slopes, table
from tests.runs import LEVEL

TERMS = 7
BOW = bow(LEVEL)
NODES, WEIGHTS = (0.5 * y + (0.5, 0.0)[i] for i, y in enumerate(np.polynomial.legendre.leggauss(60)))


def shape(s, s_o):
    """u and v of the bubbles at s, (2, m)."""
    x = np.where(s < s_o, s / s_o, (1.0 - s) / (1.0 - s_o))
    return np.where(s < s_o, *BOW(s_o)[:, :, None]) * x * (1.0 - x)


@pytest.mark.parametrize(("s_o", "ds_o", "dds_o"), [(0.31, 0.7, -0.4), (0.02, 0.3, 0.9), (0.9, -0.5, 0.2)])
def test_against_quadrature(s_o, ds_o, dds_o):
    """The acceleration at fixed s by differences in time; must fail with another acceleration of the car."""
    h, coefficients = 1e-4 * min(s_o, 1.0 - s_o), bent(table(BOW), s_o, ds_o, dds_o)
    s = np.concatenate([s_o * NODES, 1.0 - (1.0 - s_o) * NODES])
    w = np.concatenate([s_o * WEIGHTS, (1.0 - s_o) * WEIGHTS])
    before, now, after = (shape(s, s_o + ds_o * t + 0.5 * dds_o * t * t) for t in (-h, 0.0, h))
    at_rest = (before - 2.0 * now + after) / h**2
    hat = np.where(s < s_o, s / s_o, (1.0 - s) / (1.0 - s_o))
    Phi = np.vstack([np.sin(np.pi * np.outer(np.arange(1, TERMS + 1), s)), hat])
    want, basis = (w * at_rest) @ Phi.T, TravellingKink(Fourier(TERMS))
    got, wrong = np.zeros((2, 2, TERMS + 1))
    add_bows(basis.carried(s_o, ds_o, dds_o), coefficients, got)
    # h^2 of the fourth derivative, 1e-8 of ds_o^2/h_side^2 of the second, which may be a tenth of it
    np.testing.assert_allclose(got, want, rtol=0.0, atol=1e-5 * np.abs(want).max())
    add_bows(basis.carried(s_o, ds_o, dds_o), bent(table(BOW), s_o, ds_o, -dds_o), wrong)
    assert np.abs(wrong - want).max() > 1e-2 * np.abs(want).max()
    np.testing.assert_allclose(BOW(s_o)[0] / s_o, coefficients[0, 0], rtol=1e-12)
    ahead = (np.array([BOW(s_o + ds_o * x)[1] / (1.0 - s_o - ds_o * x) for x in (-h, h)]) / (2.0 * h)).T @ [-1.0, 1.0]
    np.testing.assert_allclose(coefficients[1, 1], ahead, rtol=1e-5)
    bend = slopes(s, s_o, coefficients[0, 0], coefficients[1, 0])
    e = 1e-6 * min(s_o, 1.0 - s_o)
    inside = np.abs(s - s_o) > e
    np.testing.assert_allclose(
        bend[:, inside], ((shape(s + e, s_o) - shape(s - e, s_o)) / (2.0 * e))[:, inside], rtol=0.0, atol=1e-8
    )


def test_amplitudes_are_half_of_what_turns():
    """The slopes of the two-piece catenary, at a support and at the car, less those of the empty cable."""
    s_o = 0.3
    rest, (xp, yp) = statics.gripped(s_o, LEVEL), LEVEL.static(np.array([0.0, s_o]))[1:3]
    N = np.linalg.norm(rest.left[0])
    support = rest.left[0] / N * (1.0 + (N - LEVEL.static(0.0)[0]) / LEVEL.alpha) - [xp[0], yp[0]]
    turned = support - (rest.slope_behind[0] - [xp[1], yp[1]])
    np.testing.assert_allclose(BOW(s_o)[0], 0.5 * s_o * turned, rtol=1e-5)
