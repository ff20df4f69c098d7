"""Tables of scikit-fem and the compiled kernels against quadrature, energies and dense matrices."""

import numpy as np
import pytest
import skfem
from numpy.polynomial import Polynomial

from cablefem.elements.fixed import FixedElements
from cablefem.elements.following import FollowingElements
from cablefem.elements.kernels.banded import factorise_in_place, solve_factored_in_place
from cablefem.elements.observing import observe_cable
from cablefem.elements.reference import reference_mesh, shape_polynomial_coefficients
from cablefem.newmark import State, stack_states
from tests.runs import LEVEL, basis_values_and_derivatives, crossed_cable

DEGREES = range(1, 9)
SOFT = crossed_cable(mu=0.7, sigma=0.41, c=0.73, alpha=83.0, speed=0.3)


# --- reference meshes ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("degree", DEGREES)
def test_tables_are_those_of_the_very_points(degree):
    """scikit-fem keeps the polynomials of ElementLinePp by the NUMBER of points; the tables must not fall for it."""
    ref, n_loc = reference_mesh(3, degree, 2.3), degree + 1
    tab = ref.forces
    x = tab[:, :, 0] - np.repeat([1.0, 0.0], 3)[:, None]
    dofs, value, grad = basis_values_and_derivatives(ref, x.ravel())
    shape_table, slopes = (tab[:, :, at : at + n_loc].reshape(-1, n_loc).T for at in (2, 2 + n_loc))
    np.testing.assert_array_equal(dofs, np.repeat(ref.dofs, tab.shape[1], axis=0).T)
    # monomials cancel: the rounding is that of their coefficients, found by solving for them; slopes are degree/h times
    rounding = 30.0 * np.finfo(float).eps * np.abs(ref.shapes).sum(axis=1).max()
    np.testing.assert_allclose(value, shape_table, rtol=0.0, atol=rounding)
    np.testing.assert_allclose(grad, slopes, rtol=0.0, atol=rounding * degree / np.diff(ref.knots).min())
    other = basis_values_and_derivatives(ref, np.clip(x.ravel() + 1e-6, -1.0, 1.0))[1]
    assert np.abs(other - shape_table).max() > 1e-7  # the check sees points that are a little off


@pytest.mark.parametrize("degree", DEGREES)
def test_elements_hold_every_polynomial_of_their_degree(degree):
    """Among polynomials that are zero at the supports x = -1 and 1."""
    ref = reference_mesh(3, degree, 2.3)
    x, n = np.linspace(-1.0, 1.0, 120), ref.operators.shape[2]
    dofs, value, grad = basis_values_and_derivatives(ref, x)
    N, N_x = np.zeros((x.size, n + 1)), np.zeros((x.size, n + 1))  # last column: supports
    for k in range(degree + 1):
        N[np.arange(x.size), dofs[k]] += value[k]
        N_x[np.arange(x.size), dofs[k]] += grad[k]
    N, N_x = N[:, :-1], N_x[:, :-1]
    M = ref.operators[0] + ref.operators[1]
    for power in range(max(0, degree - 3), degree):
        of = Polynomial([1.0, 0.0, -1.0]) * Polynomial(np.eye(degree)[power])
        q = np.linalg.lstsq(N, of(x), rcond=None)[0]
        if of.degree() <= degree:
            np.testing.assert_allclose(N @ q, of(x), rtol=0.0, atol=1e-12)
            np.testing.assert_allclose(N_x @ q, of.deriv()(x), rtol=0.0, atol=1e-9)
            # exact integral of the square from the assembled matrix
            square = (of * of).integ()
            rows = [M[degree + d, i] * q[i] * q[i + d] for d in range(-degree, degree + 1)
                    for i in range(max(0, -d), min(n, n - d))]  # fmt: skip
            assert abs(sum(rows) - (square(1.0) - square(-1.0))) < 1e-13
        else:
            assert np.abs(N @ q - of(x)).max() > 1e-9


@pytest.mark.parametrize("elements", [3, 1000])
def test_hermite_tables_are_the_cubics_however_many_elements(elements):
    """Tabulated on a mesh of 1000 elements, scikit-fem's global elements would be off by 6e-6 (12.0.2)."""
    f = FixedElements(LEVEL, elements=elements)
    e = elements - 1
    x = f._mesh.tab[e, :, 0] * elements - e
    cubics = [1 - 3 * x**2 + 2 * x**3, x - 2 * x**2 + x**3, 3 * x**2 - 2 * x**3, x**3 - x**2]
    slopes = [6 * x**2 - 6 * x, 1 - 4 * x + 3 * x**2, 6 * x - 6 * x**2, 3 * x**2 - 2 * x]
    # s = 1 - 1/elements carries a rounding of 1e-16, which is 1e-13 of an element
    np.testing.assert_allclose(f._mesh.tab[e, :, 2:6], np.transpose(cubics), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(f._mesh.tab[e, :, 6:] / elements, np.transpose(slopes), rtol=0.0, atol=1e-11)
    powers = shape_polynomial_coefficients(skfem.ElementLineHermite())
    np.testing.assert_allclose(powers, [[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], atol=1e-13)


# --- forces are gradients of energies --------------------------------------------------------------------------------
def gradient_by_differences(energy, q):
    step = 1e-6 * np.eye(q.size)
    return np.array([(energy(q + e) - energy(q - e)) / 2e-6 for e in step])


@pytest.mark.parametrize("law", ["elastic", "tension-only"])
@pytest.mark.parametrize("model", ["full", "string", "sagged", "stretching"])
def test_the_internal_force_is_the_gradient_of_the_energy(model, law):
    system = FollowingElements(SOFT, elements=2, model=model).tension_only_at_rest_with_clamped_car(0.37).with_law(law)
    q = 0.02 * np.random.default_rng(11).standard_normal(system.n_dof)
    still = 0.0 * q

    def seen(x, of=system):
        return observe_cable(of, np.array([[0.37], [0.0], [0.0]]), stack_states([State(0.5, x, still, still)]))

    def energy(x):
        return float((seen(x).strain + seen(x).potential)[0])

    def pull(of):
        return of.residual(0.5, q, still, still, 0) - of.residual(0.5, still, still, still, 0)

    # central differences: 1e-12 alpha of truncation, 1e-16/1e-6 of rounding
    np.testing.assert_allclose(
        pull(system), gradient_by_differences(energy, q), rtol=0.0, atol=1e-7 * np.abs(pull(system)).max()
    )
    if model == "full":
        assert system.min_tension_and_position[0] > seen(q).tension_min[0] < 0.0
        other = system.with_law("elastic" if law == "tension-only" else "tension-only")
        assert np.abs(pull(other) - pull(system)).max() > 1e-3 * np.abs(pull(system)).max()  # both branches are in it


@pytest.mark.parametrize("degree", [1, 2])
def test_the_least_tension_is_that_of_the_element_that_pulls_least(degree):
    """Of means over the points of each element."""
    system = FollowingElements(SOFT, elements=2, degree=degree).tension_only_at_rest_with_clamped_car(0.37)
    q, ref = 0.02 * np.random.default_rng(11).standard_normal(system.n_dof), system.reference
    system.residual(0.5, q, 0.0 * q, 0.0 * q, 0)
    (begin, h), tab = np.repeat([[0.0, 0.37], [0.37, 0.63]], 2, axis=1)[:, :, None], ref.forces
    held = np.append(q.reshape(-1, 2), [[0.0, 0.0]], axis=0)  # last row: supports
    w_x, w_y = np.einsum("egk,ekf->feg", tab[:, :, degree + 3 :], held[ref.dofs]) / h
    T, xp, yp = SOFT.tension_and_slope(begin + h * tab[:, :, 0])
    N = T + SOFT.alpha * (np.hypot(xp + w_x, yp + w_y) - 1.0)
    means = np.average(N, axis=1, weights=tab[:, :, 1])
    assert system.min_tension_and_position[0] == pytest.approx(means.min(), rel=1e-12)


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("row", [0, 3, 5])
def test_the_solution_of_a_singular_tangent_is_no_number(kind, row):
    ab, border, b = np.zeros((6, 7), kind), np.zeros((3, 7), kind), np.ones(6, kind)
    ab[:, 3], border[0, 6] = 2.0, 1.0
    for singular in (False, True):
        ab[row, 3], x, bordered = 0.0 if singular else 2.0, b.copy(), np.ones(7, kind)
        for matrix, edge, y in ((ab.copy(), None, x), (ab.copy(), border.copy(), bordered)):
            factorise_in_place(matrix, edge)
            solve_factored_in_place(matrix, edge, y)
            assert np.isfinite(y).all() != singular
    ab[row, 3], border[0, 6] = 2.0, 0.0
    factorise_in_place(ab, border)
    solve_factored_in_place(ab, border, bordered)
    assert not np.isfinite(bordered).any()


@pytest.mark.parametrize("kind", [float, complex])
def test_a_banded_tangent_with_its_border_is_solved(kind):
    n, band = 9, 2
    rng = np.random.default_rng(3)
    A = rng.standard_normal((n + 1, n + 1)).astype(kind) + 6.0 * np.eye(n + 1)
    ab, border = np.zeros((n, 2 * band + 1), kind), np.stack([A[:, n], A[n], 0.0 * A[n]])
    for i, j in np.ndindex(n, n):
        if abs(i - j) <= band:
            ab[i, band + j - i] = A[i, j]
        else:
            A[i, j] = 0.0
    b = rng.standard_normal(n + 1).astype(kind)
    x = b.copy()
    factorise_in_place(ab, border)
    solve_factored_in_place(ab, border, x)
    np.testing.assert_allclose(A @ x, b, atol=1e-13)
