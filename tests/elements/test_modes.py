"""Frequencies of the bare cable against eleven digits of the linearised catenary, Irvine & Caughey, and the string."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cablefem.elements.modes import scaled_frequencies
from tests.runs import LEVEL, STEEP, crossed_cable
from validation.oracles import catenary_modes, irvine

# collocation of the linearised catenary, u and v; sigma = 0.1688832, alpha = 844.416 (Henghold; Wu & Chen)
EXACT = np.array([
    5.3454766022, 6.2761408254, 9.5728553824, 12.5684220916, 15.7413444238, 18.8571036040, 22.0114146253,
    25.1448878959, 28.2937309199, 31.4323118252,
])  # fmt: skip
PAPER = replace(LEVEL, sigma=0.1688832, alpha=844.416, c=0.0844416, motion=None)


def test_the_first_ten_frequencies_of_the_catenary():
    np.testing.assert_allclose(scaled_frequencies(PAPER), EXACT, rtol=1e-9)
    assert scaled_frequencies(PAPER, elements=20, n=30)[-1] == pytest.approx(91.4217, abs=5e-5)  # the first axial one
    stiffer = scaled_frequencies(replace(PAPER, alpha=844.5))
    assert np.abs(stiffer / EXACT - 1.0).max() > 1e-5  # the check sees a stiffness off by 1e-4


@pytest.mark.parametrize(("degree", "elements"), [(1, 60), (2, 20), (4, 6)])
def test_frequencies_converge_from_above_with_twice_the_degree(degree, elements):
    coarse, fine = (scaled_frequencies(PAPER, elements=e, degree=degree, n=4) for e in (elements, 2 * elements))
    errors = coarse / EXACT[:4] - 1.0, fine / EXACT[:4] - 1.0
    # an eigenvalue solver loses eps times (largest over lowest frequency)^2, 1e-10: read a hundred times above it
    readable = errors[1] > 1e-8
    assert readable[2:].all()
    assert np.all(np.abs(np.log2(errors[0] / errors[1])[readable] - 2.0 * degree) < 0.3)


@pytest.mark.parametrize("groups", [STEEP, crossed_cable(mu=0.7, sigma=1.9, c=1.1, alpha=57.0, speed=0.3)])
def test_steep_and_deep_cables(groups):
    exact = catenary_modes.solve_modes(groups.sigma, groups.alpha, groups.c, count=8).omega
    # modes of a deep cable are less smooth
    np.testing.assert_allclose(scaled_frequencies(groups, n=8), exact, rtol=1e-7)


@pytest.mark.parametrize("groups", [PAPER, STEEP])
@pytest.mark.parametrize("model", ["sagged", "stretching"])
def test_irvine_and_caughey(model, groups):
    """The parabola along the chord, tension H/cos: L^2 = alpha sigma^2 cos^5."""
    L2 = irvine.irvine_parameter(groups.sigma, groups.alpha, groups.chord_cos)
    exact = irvine.lowest_frequencies(L2, 10) / math.sqrt(groups.chord_cos)
    np.testing.assert_allclose(scaled_frequencies(groups, model=model), exact, rtol=1e-9)
    assert abs(scaled_frequencies(groups)[0] / exact[0] - 1.0) > 5e-4  # the catenary is another cable
    string = np.pi * np.arange(1, 8) / math.sqrt(groups.chord_cos)  # tight along its chord
    np.testing.assert_allclose(scaled_frequencies(groups, model="string", n=7), string, rtol=1e-9)
