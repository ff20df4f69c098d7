"""Bare-cable frequencies against exact linear theories."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from galerkin import Daubechies, Fourier, scaled_frequencies
from tests.runs import observed_orders
from validation.oracles import catenary_modes, irvine

BARE = replace(Scene.load("bare").groups, sigma=0.1688832, alpha=844.416, c=0.0844416)  # rounded as in oracles.md


def test_first_ten_of_the_papers_cable():
    """From above and to third order, because sag couples all sines of a kind."""
    exact = catenary_modes.solve_modes(BARE.sigma, BARE.alpha).omega[:10]
    assert exact[0] == pytest.approx(5.3454766022, abs=1e-9)
    excess = np.array([scaled_frequencies(BARE, Fourier(n)) / exact - 1.0 for n in (20, 40, 80)])
    assert np.all((excess[-1] > 0.0) & (excess[-1] < 1e-6))
    assert np.all(np.abs(observed_orders(excess)[-1, :6] - 3.0) < 0.15)


def test_the_papers_wavelets():
    """p = 4, N = 10, 17, 31: paper.md 4; the scaling-function reading stalls."""
    first = [scaled_frequencies(BARE, Daubechies(4, level), n=1)[0] for level in (0, 1, 2)]
    np.testing.assert_allclose(first, [5.34615, 5.34548, 5.34548], rtol=0.0, atol=5e-6)
    assert scaled_frequencies(BARE, Daubechies(4, 2, "scaling"), n=1)[0] > 5.4


def test_linear_theory_of_the_sagged_cable():
    """Irvine & Caughey's symmetric and antisymmetric frequencies; the printed 5.34979."""
    exact = np.sort(irvine.lowest_frequencies(irvine.irvine_parameter(BARE.sigma, BARE.alpha), 4))[:4]
    assert exact[0] == pytest.approx(5.3497920, abs=5e-8)
    sagged = scaled_frequencies(BARE, Fourier(90), model="sagged", n=4)
    np.testing.assert_allclose(sagged, exact, rtol=3e-7)
    assert np.array_equal(scaled_frequencies(BARE, Fourier(90), model="stretching", n=4), sagged)  # the same at rest
    assert abs(scaled_frequencies(BARE, Fourier(90), n=1)[0] - sagged[0]) > 4e-3  # the full cable is another model
