"""The compiled balance of mass-following elements against the forms that say what it is."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem.elements.following import FollowingElements
from cablefem.elements.forms import assemble_residual
from tests.runs import CRUISE, crossed_cable

SOFT = replace(crossed_cable(mu=0.7, sigma=0.41, c=0.73, alpha=83.0, speed=0.35), damping=0.6)


@pytest.mark.parametrize("law", ["elastic", "tension-only"])
@pytest.mark.parametrize(("degree", "groups", "t"), [(1, CRUISE, 1.1), (2, SOFT, 1.07), (4, CRUISE, 0.4)])
def test_kernels_sum_the_forms_to_rounding(degree, groups, t, law):
    system = FollowingElements(groups, elements=3, degree=degree, grading=1.6, law=law)
    rng = np.random.default_rng(41 + degree)
    x = np.array([size * rng.standard_normal(system.n_dof) for size in (0.02, 0.3, 0.7)])
    want, r = assemble_residual(system, x, t, 0), system.residual(t, *x, 0)
    # rounding: strains of slopes of order one, times alpha, times shape slopes up to 8 degree^2
    np.testing.assert_allclose(r, want, rtol=0.0, atol=1e-13 * np.abs(want).max())
    # twins: the other law, and a state that is a little off
    other = assemble_residual(system.with_law("elastic" if law == "tension-only" else "tension-only"), x, t, 0)
    assert np.abs(other - r).max() > 1e-3 * np.abs(r).max(), "no point is slack: the test shows nothing"
    for k in range(3):
        moved = x.copy()
        moved[k] *= 1.0 + 1e-4
        assert np.abs(assemble_residual(system, moved, t, 0) - r).max() > 1e-9 * np.abs(r).max()
