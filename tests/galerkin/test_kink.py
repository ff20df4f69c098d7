"""The travelling kink's closed forms against quadrature and difference quotients that know only what a hat is."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from galerkin.bases import Daubechies, Fourier
from galerkin.bases.kink import KinkedBasis
from galerkin.kernels import set_stiffness_matrix

# With what the checks' own quadrature allows: phi is analytic, Hoelder 2.6, Hoelder 1.5, and its cells are 1/448.
BASES = [
    pytest.param(Fourier(7), 1e-12, id="sines"),
    pytest.param(Fourier(7, 0.6), 1e-11, id="graded"),
    pytest.param(Daubechies(4, 0), 1e-9, id="db4"),
    pytest.param(Daubechies(2, 1), 1e-7, id="db2"),
]
X, W = leggauss(6)


def gauss_points_of_sides(s_o):
    """Gauss points on each side of the mass, on cells that no wavelet's dyadic points cut (up to 1/7/64)."""
    out = []
    for a, b in ((0.0, s_o), (s_o, 1.0)):
        grid = np.arange(449) / 448.0
        edges = np.concatenate([[a], grid[(grid > a) & (grid < b)], [b]])
        half = 0.5 * np.diff(edges)[:, None]
        out.append(((edges[:-1, None] + half * (1.0 + X)).ravel(), (half * W).ravel()))
    return np.concatenate([p for p, _ in out]), np.concatenate([w for _, w in out])


def hat_function(s, s_o):
    return np.where(s <= s_o, s / s_o, (1.0 - s) / (1.0 - s_o))


def hat_rate(s, s_o, ds_o):
    """dhat/dt at fixed s."""
    return ds_o * np.where(s <= s_o, -s / s_o**2, (1.0 - s) / (1.0 - s_o) ** 2)


@pytest.mark.parametrize(("basis", "tolerance"), BASES)
def test_overlap_at_the_support_is_the_limit(basis, tolerance):
    kink = KinkedBasis(basis, kink=True)
    at, near = kink.hat_overlaps_and_derivatives(np.array([0.0])), kink.hat_overlaps_and_derivatives(np.array([1e-5]))
    for order in (0, 1):  # I and I' change by I'' s, I''' s; rounding of E/s^2 is 1e-7
        np.testing.assert_allclose(at[order], near[order], rtol=0.0, atol=1e-3 * np.abs(near[order]).max())
    np.testing.assert_allclose(at[0], at[1], rtol=1e-15)


@pytest.mark.parametrize(("basis", "tolerance"), BASES)
@pytest.mark.parametrize("s_o", [0.071, 0.29, 0.83])
def test_inertia_against_quadrature(basis, tolerance, s_o):
    """M, 2 A and A. - B by integrating hats; A. by differencing A along a curved motion, B with the hat's rate."""
    ds_o, dds_o, h = 0.37, -0.23, 1e-4

    def place(t):
        return s_o + ds_o * t + 0.5 * dds_o * t * t, ds_o + dds_o * t

    def tables(t):
        at, speed = place(t)
        s, w = gauss_points_of_sides(at)
        Phi = np.column_stack([basis.phi(s), hat_function(s, at)])
        rate = np.column_stack([np.zeros((s.size, basis.n)), hat_rate(s, at, speed)])
        return (w * Phi.T) @ Phi, (w * Phi.T) @ rate, (w * rate.T) @ rate

    M, A, B = tables(0.0)
    dA = (tables(h)[1] - tables(-h)[1]) / (2 * h)
    mass, gyroscopic, centrifugal, *_ = KinkedBasis(basis, kink=True).inertia_terms(s_o, ds_o, dds_o)
    np.testing.assert_allclose(mass, M, rtol=0.0, atol=10.0 * tolerance)
    np.testing.assert_allclose(gyroscopic, 2.0 * A[:, -1], rtol=0.0, atol=10.0 * tolerance)
    assert np.abs(A[:, :-1]).max() == 0.0
    # differences: h^2 of the third derivative of A, which is of order 1/(1 - s_o)^4
    wanted = (dA - B)[:, -1]
    np.testing.assert_allclose(centrifugal, wanted, rtol=0.0, atol=1e-4 * np.abs(wanted).max())
    wrong = KinkedBasis(basis, kink=True).inertia_terms(s_o, ds_o, -dds_o).centrifugal
    assert np.abs(wrong - wanted).max() > 1e-2 * np.abs(wanted).max()  # the check sees a wrong acceleration


@pytest.mark.parametrize(("basis", "tolerance"), BASES)
def test_slopes_stiffness_and_integral(basis, tolerance):
    s_o, kink = 0.618, KinkedBasis(basis, kink=True)
    s, w, table = kink.quadrature_with_slopes(s_o)
    assert np.all(np.diff(s) > 0.0)
    assert abs(w.sum() - 1.0) < 1e-13
    S = kink.stiffness_matrix(s_o)
    # two Gauss points on 1/8 of a cell are what the wavelets' roughness deserves, not what the closed form gives
    coarse = 1e-11 if isinstance(basis, Fourier) else 1e-2
    np.testing.assert_allclose((w * table) @ table.T, S, rtol=0.0, atol=coarse * np.abs(S).max())
    s, w = gauss_points_of_sides(s_o)
    np.testing.assert_allclose(kink.integrals()[:-1], w @ basis.phi(s), rtol=0.0, atol=tolerance)
    assert abs(kink.integrals()[-1] - w @ hat_function(s, s_o)) < 1e-13
    x = kink.inertia_terms(s_o, 0.4, 0.2)
    assert (x.f[-1], x.f_s[-1], x.f_v[-1], x.f_q[-1]) == (1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("grading", [0.0, 0.6])
@pytest.mark.parametrize("s_o", [0.29, 0.97])
def test_share_of_the_side_behind_in_the_overlap(grading, s_o):
    basis = Fourier(7, grading)
    x, (s, w) = KinkedBasis(basis, kink=True).inertia_terms(s_o, 0.37, -0.23), gauss_points_of_sides(s_o)
    Phi = np.column_stack([basis.phi(s), hat_function(s, s_o)])
    np.testing.assert_allclose(x.behind, (w * (s < s_o) * s / s_o) @ Phi, rtol=0.0, atol=1e-12)
    assert np.abs(x.mass[-1] - 2.0 * x.behind).max() > 1e-3  # the other side's share differs


@pytest.mark.parametrize("basis", [Fourier(1), Fourier(7), Fourier(7, 0.6), Fourier(90)], ids=str)
def test_gram_matrix_is_the_plain_product(basis):
    """By sums of cosines, the hat's row and column included, block by block."""
    functions = KinkedBasis(basis, kink=True)
    s, w, table = functions.quadrature_with_slopes(0.273)
    f = w * np.array([np.exp(s), np.cos(5.0 * s), s**2 - 0.3])
    direct = np.einsum("abq,iq,jq->aibj", f[[[0, 1], [1, 2]]], table, table, optimize=True).reshape(2 * functions.n, -1)
    gram = np.empty(direct.shape)
    set_stiffness_matrix(table, f, basis.grading, gram)
    np.testing.assert_allclose(gram, direct, rtol=0.0, atol=1e-14 * (9 + basis.n) * np.abs(direct).max())
    set_stiffness_matrix(table, f[::-1].copy(), basis.grading, gram)
    assert np.abs(gram - direct).max() > 0.1 * np.abs(direct).max()  # which block is which
