"""Frequencies of lines at rest: cars, counterweights."""

import numpy as np
import pytest
from scipy.linalg import eigh

from cablefem.elements.system import LineElements
from tests.motion.lines import LEFT, RIGHT, ROPE, WEIGHED, line, weight

STRAIGHT = line(
    {"mass_per_length": 8.0, "EA": 1e8}, LEFT, weight(400.0, 0.0, 3e5), gravity=1e-3
)  # along: w tan(w) = rho S/m


def frequencies(system: LineElements) -> np.ndarray:
    x, n = system.start(0, None), system.n_dof
    zero = np.zeros(n)

    def inverse(*c: float) -> np.ndarray:
        _, solve = system.linearise(0.0, x.q, zero, zero, 0, c)
        both = np.array([solve(e) for e in np.eye(n)])
        assert np.abs(both - both.T).max() < 1e-7 * np.abs(both).max(), "not from a Lagrangian"
        return 0.5 * (both + both.T)

    return np.sqrt(eigh(inverse(0.0, 0.0, 1.0), inverse(1.0, 0.0, 0.0), eigvals_only=True))


@pytest.mark.parametrize(
    ("scene", "exact", "tolerance"),
    [
        (WEIGHED, [0.61781632, 2.0816558, 2.3354839], 1e-7),
        (line(ROPE, LEFT, RIGHT), [1.12168304, 2.26609538, 2.37919708, 3.58003800], 2e-6),
        (STRAIGHT, [0.0289107311, np.pi * np.sqrt(3e5 / 8.0 / 1.003) / 400.0 * 1.003], 1e-6),
    ],
    ids=["car and weight", "weight", "straight"],
)
def test_frequencies_of_car_and_counterweight(scene, exact, tolerance):
    np.testing.assert_allclose(frequencies(LineElements(scene))[: len(exact)], exact, rtol=tolerance)
