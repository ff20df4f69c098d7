"""Exact answers of damped cables: published digits, their equations, each other."""

import math

import numpy as np
import pytest

from validation.oracles import damped_mass, damped_string, irvine
from validation.oracles.case import BARE

# path of a mass, mu = 0.5, P = 0.1, V = 0.4, from rest at 0.3, at t = 0.3, 0.6, 0.9, 1.2, 1.5 (another program)
PATHS = {
    0.0: (0.00626493, 0.01863397, 0.03284155, 0.04430265, 0.03665942),
    1.0: (0.00618063, 0.01775632, 0.02983824, 0.03873531, 0.03170635),
    4.0: (0.00594543, 0.01556161, 0.02328048, 0.02774943, 0.02312286),
}


@pytest.mark.parametrize("c", PATHS)
def test_a_mass_on_a_damped_string(c):
    y = damped_mass.extrapolated_load_displacement(1.5, mu=0.5, P=0.1, V=0.4, s0=0.3, c=c)
    np.testing.assert_allclose(y([0.3, 0.6, 0.9, 1.2, 1.5]), PATHS[c], rtol=0.0, atol=6e-8)
    wrong = damped_mass.extrapolated_load_displacement(1.5, mu=0.5, P=0.1, V=0.4, s0=0.3, c=c + 0.01)
    assert abs(wrong(1.2) - PATHS[c][3]) > 1e-5


def test_a_force_presses_a_long_damped_string_to_a_steady_depth():
    """P/(c V), as far as the supports, 0.3 and 0.42 away, are not felt."""
    depth = damped_mass.extrapolated_load_displacement(0.4, mu=0.0, P=0.1, V=0.7, s0=0.3, c=200.0)
    assert depth(0.4) == pytest.approx(0.1 / (200.0 * 0.7), rel=1e-3)
    assert depth(0.2) == pytest.approx(depth(0.4), rel=5e-3)


def test_damped_modes_satisfy_the_complex_equation():
    """tan(k/2) = k/2 - (4/L^2) (k/2)^3 with k^2 = w^2 - i w c, or k = 2 n pi."""
    L2 = irvine.irvine_parameter(BARE.sigma, BARE.alpha)
    found = damped_string.damped_frequencies(irvine.lowest_frequencies(L2, 4), 0.1)
    assert found[0] == pytest.approx(5.34955550 + 0.05j, abs=1e-5)
    half = 0.5 * np.sqrt(found**2 - 0.1j * found)
    assert np.abs(np.tan(half[[0, 2]]) - half[[0, 2]] + 4.0 / L2 * half[[0, 2]] ** 3).max() < 1e-9
    assert np.abs(half[[1, 3]] - math.pi * np.array([1.0, 2.0])).max() < 1e-12


@pytest.mark.parametrize("c", [0.0, 0.8, 4.0])
def test_a_plucked_string_is_what_a_step_of_force_leaves(c):
    """Letting go adds the answer to -P: the static shape less what P raises from rest."""
    t = np.linspace(0.0, 2.5, 301)
    raised = damped_mass.load_displacement(t, mu=0.0, P=0.2, V=0.0, s0=0.3, c=c)
    got = damped_string.displacement_at_released_point(t, P=0.2, p=0.3, c=c)
    np.testing.assert_allclose(got, 0.2 * 0.3 * 0.7 - raised, rtol=0.0, atol=2e-5)
    assert np.abs(damped_string.displacement_at_released_point(t, P=0.2, p=0.3, c=c + 0.05) - got).max() > 1e-4
