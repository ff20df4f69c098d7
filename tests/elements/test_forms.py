"""The compiled internal force and its tangent against the forms that say what they are."""

from __future__ import annotations

import numpy as np
import pytest
import skfem

from cablefem.elements.forms import internal_force, internal_tangent
from cablefem.elements.kernels.balance import Cable, Mesh, add_forces, stretch
from cablefem.elements.kernels.law import ELASTIC, TENSION_ONLY
from cablefem.elements.reference import force_order, lagrange_element, reference

CABLE = (323.7, 0.41, 0.73)  # alpha, sigma, c
KNOTS = np.array([0.0, 0.13, 0.4, 0.55, 1.0])


def by_forms(degree, q, law):
    """Return force and tangent of `forms` at q (n, 2), unknowns along s; law as in `kernels`."""
    alpha, sigma, c = CABLE
    mesh = skfem.MeshLine(KNOTS)
    scalar = skfem.Basis(mesh, lagrange_element(degree), intorder=force_order(degree))
    basis = skfem.Basis(mesh, skfem.ElementVector(lagrange_element(degree), 2), intorder=force_order(degree))
    s = np.asarray(scalar.global_coordinates())[0]
    along = np.empty(scalar.N, dtype=int)  # as in `reference`
    n = mesh.nelements
    along[scalar.element_dofs[0]], along[scalar.element_dofs[1]] = degree * np.arange(n), degree * np.arange(1, n + 1)
    for k in range(2, degree + 1):
        along[scalar.element_dofs[k]] = degree * np.arange(n) + k - 1
    # scalar unknown of each vector unknown, and its component
    number = np.empty((basis.N, 2), dtype=int)
    for k in range(degree + 1):
        for f in range(2):
            number[basis.element_dofs[2 * k + f]] = np.stack([along[scalar.element_dofs[k]], np.full(n, f)], axis=1)
    order = np.argsort(2 * number[:, 0] + number[:, 1])
    x = np.empty(basis.N)
    x[order] = q.ravel()
    p = c - sigma * s
    T = np.hypot(1.0, p)
    w = {"T": T, "alpha": alpha, "X_s": np.stack([1.0 / T, p / T]), "law": law}
    w["w_s"] = basis.interpolate(x).grad[:, 0]
    force, tangent = internal_force.assemble(basis, **w), internal_tangent.assemble(basis, **w).toarray()
    return force[order], tangent[np.ix_(order, order)]


def by_kernel(degree, q, law):
    ref = reference(KNOTS, degree, pull_at_end=True)
    n, band, known = q.size, 2 * degree + 1, ((0,) * 3, (0,) * 2) if degree == 2 else ((), ())
    mesh = Mesh(ref.dofs, ref.forces, KNOTS.size - 1, *known)
    of = Cable(mesh, np.array([*CABLE, law]), None, np.empty((1, 1, 1)), np.empty((9, ref.forces[..., 0].size)))
    r, ab = np.zeros(n), np.zeros((n, 3 * band + 1))
    stretch(of, 1.0, q.ravel())
    add_forces(of, 1.0, r, ab, 1.0)
    tangent = np.array([[ab[i, band + j - i] if abs(i - j) <= band else 0.0 for j in range(n)] for i in range(n)])
    return r, tangent


@pytest.mark.parametrize("law", [ELASTIC, TENSION_ONLY])
@pytest.mark.parametrize("degree", [1, 2, 4])
def test_kernels_sum_the_forms_to_rounding(degree, law):
    rng = np.random.default_rng(41 + degree)
    q = 0.02 * rng.standard_normal((4 * degree + 1, 2))
    force, tangent = by_forms(degree, q, law)
    r, ab = by_kernel(degree, q, law)
    # rounding: strains of slopes of order one, times alpha, times shape slopes up to 8 degree^2
    np.testing.assert_allclose(r, force, rtol=0.0, atol=1e-13 * np.abs(force).max())
    np.testing.assert_allclose(ab, tangent, rtol=0.0, atol=1e-13 * np.abs(tangent).max())
    # twins: the other law, and a state that is a little off
    other = by_forms(degree, q, TENSION_ONLY - law)
    assert np.abs(other[0] - r).max() > 1e-3 * np.abs(r).max(), "no point is slack: the test shows nothing"
    moved = by_forms(degree, 1.000001 * q, law)
    assert np.abs(moved[0] - r).max() > 1e-8 * np.abs(r).max()
    assert np.abs(moved[1] - ab).max() > 1e-8 * np.abs(ab).max()
