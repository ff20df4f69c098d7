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


def pieces(at):
    """Quadrature of both sides, and the hat there."""
    s = np.concatenate([at * NODES, 1.0 - (1.0 - at) * NODES])
    return s, np.concatenate([at * WEIGHTS, (1.0 - at) * WEIGHTS]), np.tile(NODES, 2)


def known(s, behind, at):
    """u and v of the bubbles at s (m,) on known sides of the car, also where the car has passed: (2, m)."""
    x = np.where(behind, s / at, (1.0 - s) / (1.0 - at))
    return np.where(behind, *BOW(at)[:, :, None]) * x * (1.0 - x)


@pytest.mark.parametrize(("s_o", "ds_o", "dds_o"), [(0.31, 0.7, -0.4), (0.02, 0.3, 0.9), (0.9, -0.5, 0.2)])
def test_against_quadrature(s_o, ds_o, dds_o):
    """Inertia by differences in time of int Phi w. ds, less int Phi. w. ds, with the kink's; slopes by those in s.

    Must fail: another acceleration of the car, or without the kink.
    """
    e = 1e-3 * min(s_o, 1.0 - s_o)
    coefficients = bent(table(BOW), s_o, ds_o, dds_o)

    def integrals(t):
        at = s_o + ds_o * t + 0.5 * dds_o * t * t
        s, w, hat = pieces(at)
        behind, speed = np.arange(s.size) < NODES.size, ds_o + dds_o * t
        rate = speed / (2.0 * e) * (known(s, behind, at + e) - known(s, behind, at - e))
        hat_t = speed * np.where(behind, -hat / at, hat / (1.0 - at))
        sines = np.sin(np.pi * np.outer(np.arange(1, TERMS + 1), s))
        return (w * rate) @ np.vstack([sines, hat]).T, (w * rate) @ np.vstack([0.0 * sines, hat_t]).T

    want = (integrals(e)[0] - integrals(-e)[0]) / (2.0 * e) - integrals(0.0)[1]
    carried, got, wrong = TravellingKink(Fourier(TERMS)).carried(s_o, ds_o, dds_o), *np.zeros((2, 2, TERMS + 1))
    kink = np.multiply.outer(ds_o**2 * coefficients[:, 0].sum(axis=0), carried.f)
    add_bows(carried, coefficients, got)
    # e^2 of third derivatives: 1e-6 of what a side that short makes of them
    atol = 1e-4 * np.abs(want).max()
    np.testing.assert_allclose(got + kink, want, rtol=0.0, atol=atol)
    assert np.abs(got - want).max() > 100.0 * atol
    add_bows(carried, bent(table(BOW), s_o, ds_o, -dds_o), wrong)
    assert np.abs(wrong + kink - want).max() > 10.0 * atol
    s, _, _ = pieces(s_o)
    behind, step = s < s_o, 1e-6
    slope = (known(s + step, behind, s_o) - known(s - step, behind, s_o)) / (2.0 * step)
    np.testing.assert_allclose(slopes(s, s_o, *coefficients[:, 0]), slope, rtol=0.0, atol=1e-8)
    over = [BOW(s_o + x)[i] / (s_o + x if i == 0 else 1.0 - s_o - x) for x in (-e, e) for i in (0, 1)]
    np.testing.assert_allclose(coefficients[:, 1], ds_o * (np.array(over[2:]) - over[:2]) / (2.0 * e), rtol=1e-4)


def test_amplitudes_are_half_of_what_turns():
    """The slopes of the two-piece catenary, at a support and at the car, less those of the empty cable."""
    s_o = 0.3
    rest, (xp, yp) = statics.gripped(s_o, LEVEL), LEVEL.static(np.array([0.0, s_o]))[1:3]
    N = np.linalg.norm(rest.left[0])
    support = rest.left[0] / N * (1.0 + (N - LEVEL.static(0.0)[0]) / LEVEL.alpha) - [xp[0], yp[0]]
    turned = support - (rest.slope_behind[0] - [xp[1], yp[1]])
    np.testing.assert_allclose(BOW(s_o)[0], 0.5 * s_o * turned, rtol=1e-5)
