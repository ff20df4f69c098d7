"""Global bases of the Galerkin wing: each claim against an evaluation that shares only the formula with the code.

The witness for wavelets is mpmath in 60 digits: filters from the roots of Daubechies' polynomial, derivatives by the
unfactored masks 2 h and 4 h, integrals by the mask h/2 with the value 1 right of the support.
"""

import itertools
from functools import cache

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.legendre import leggauss

from galerkin.bases import Basis, Daubechies, Fourier

WITNESS_DIGITS = 60  # the mask 4 h multiplies rounding by 2 per binary digit: 60 of them cost 18 digits

ORDERS = range(2, 9)


# --- the witness -----------------------------------------------------------------------------------------------


@cache
def witness_filter(p):
    """h of Daubechies' order p, sum 2, from the roots of sum_k binom(p-1+k, k) y^k outside the unit circle."""
    h = [mp.mpf(1)]
    c = [mp.binomial(p - 1 + k, k) for k in range(p)]
    for start in np.roots([float(x) for x in c[::-1]]):
        y = mp.findroot(lambda y: mp.fsum(x * y**k for k, x in enumerate(c)), mp.mpc(complex(start)))
        z = 1 - 2 * y + mp.sqrt((1 - 2 * y) ** 2 - 1)  # (z + 1/z)/2 = 1 - 2 y
        z = z if abs(z) > 1 else 1 / z
        h = [a - b / z for a, b in zip([*h, 0], [0, *h], strict=True)]
    for _ in range(p):
        h = [a + b for a, b in zip([*h, 0], [0, *h], strict=True)]
    return [2 * mp.re(c) / mp.re(sum(h)) for c in h]


@cache
def witness_at_integers(p, derivative):
    """phi, phi' (derivative 1) or the integral of phi (derivative -1) at 0 .. R-1."""
    h, R = witness_filter(p), 2 * p - 1
    scale = mp.mpf(2) ** derivative
    A, b = mp.matrix(R - 1, R - 1), mp.matrix(R - 1, 1)
    for i in range(1, R):
        for k in range(R + 1):
            if 0 < 2 * i - k < R:
                A[i - 1, 2 * i - k - 1] += scale * h[k]
            elif 2 * i - k >= R and derivative < 0:
                b[i - 1] -= scale * h[k]
        A[i - 1, i - 1] -= 1
    if derivative >= 0:  # an eigenvector: sum phi = 1, or sum k phi'(k) = -1
        for i in range(1, R):
            A[R - 2, i - 1] = mp.mpf(i) ** derivative
        b[R - 2] = (-1) ** derivative
    return [mp.mpf(0), *mp.lu_solve(A, b)]


@cache
def witness_at_unit_shifts(p, x, derivative):
    """phi (or its derivative, or its integral) at x, x + 1, .. x + R - 1 for an exact mpf 0 <= x < 1."""
    h, R = witness_filter(p), 2 * p - 1
    if x == 0:
        return witness_at_integers(p, derivative)
    digit = int(2 * x)
    v = witness_at_unit_shifts(p, 2 * x - digit, derivative)
    at = [v[q] if q < R else int(derivative < 0) for q in range(2 * R)]
    scale = mp.mpf(2) ** derivative
    return [scale * mp.fsum(h[k] * at[2 * i - k + digit] for k in range(min(R, 2 * i + digit) + 1)) for i in range(R)]


def witness_wavelet(p, y, derivative):
    """theta (-1), psi (0) or psi' (1) at an exact mpf y, psi(y) = sum (-1)^k h_(R-k) phi(2y - k)."""
    h, R = witness_filter(p), 2 * p - 1

    def phi(y):
        if y <= 0 or y >= R:
            return mp.mpf(int(y > 0 and derivative < 0))
        return witness_at_unit_shifts(p, y - int(y), derivative)[int(y)]

    return mp.mpf(2) ** derivative * sum((-1) ** k * h[R - k] * phi(2 * y - k) for k in range(R + 1))


def scales_and_shifts(p, level):
    """(j, k) of the paper's functions, (37)."""
    R = 2 * p - 1
    return [(-1, k) for k in range(1 - R, p)] + [(j, k) for j in range(level) for k in range(p - R, 2**j * R - p + 1)]


def paper_basis_functions(p, level, s, derivative=0):
    """Theta_jk of (39) at x = R s rounded to a float, or its derivative with respect to s, (n_s, count)."""
    R, columns = 2 * p - 1, []
    with mp.workdps(WITNESS_DIGITS):
        for j, k in scales_and_shifts(p, level):
            two_j, left = mp.mpf(2) ** j, witness_wavelet(p, mp.mpf(-k), -1)
            rise = witness_wavelet(p, two_j * R - k, -1) - left
            line = (lambda x, a=left, b=rise: a + x / R * b, lambda x, b=rise: b / R, lambda x: 0)[derivative]
            scale = mp.mpf(R) ** derivative / mp.sqrt(two_j)
            columns.append([
                float(scale * (witness_wavelet(p, two_j * x - k, derivative - 1) * two_j**derivative - line(x)))
                for x in (mp.mpf(float(at) * R) for at in s)
            ])  # fmt: skip
    return np.array(columns).T


def quadrature_of_sides(basis, cut):
    """The rules on both sides of a mass."""
    s, w, _ = basis.quadrature_with_kinked_slopes(cut)
    left = s < cut
    return (s[left], w[left]), (s[~left], w[~left])


# --- fine rules ----------------------------------------------------------------------------------------------------


def composite_gauss(edges, n):
    """n Gauss points between any two neighbouring edges."""
    x, w = leggauss(n)
    h = np.diff(edges)
    return (edges[:-1, None] + 0.5 * h[:, None] * (1.0 + x)).ravel(), (0.5 * h[:, None] * w).ravel()


def fine_quadrature(basis, a=0.0, b=1.0, pieces=512):
    """Two points on each of `pieces` parts of a cell, cut at a and b; for sines 12 points per half wave: rounding."""
    if isinstance(basis, Fourier):
        return composite_gauss(np.linspace(a, b, basis.n + 1), 12)
    grid = np.arange(pieces * basis.cell_count + 1) / (pieces * basis.cell_count)
    return composite_gauss(np.concatenate([[a], grid[(grid > a) & (grid < b)], [b]]), 2)


def fine_quadrature_error(basis, exponent, pieces=512):
    """Relative error to expect of `fine_quadrature`: pieces^-(exponent + 1), at best order 4; of a Hoelder exponent."""
    return 1e-13 if isinstance(basis, Fourier) else 1e-13 + 10.0 * float(pieces) ** -min(exponent + 1.0, 4.0)


# --- the paper's functions ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("p", "level"), [(2, 0), (3, 1), (4, 2), (5, 0), (8, 0)])
def test_the_basis_spans_the_papers_functions_with_their_derivatives(p, level):
    """Over each function's own maximum, at any float; the witness takes the same rounding of R s."""
    basis, grid = Daubechies(p, level), np.arange(65) / 64.0
    values = paper_basis_functions(p, level, grid)
    values /= (size := np.abs(values).max(axis=0))
    weights, mirrored = (np.linalg.lstsq(basis.phi(s), values, rcond=None)[0] for s in (grid, 1.0 - grid))
    rounding = 1e-12 if p <= 6 else 1e-11  # the functions of high orders are nearly dependent
    assert np.abs(basis.phi(grid) @ weights - values).max() < rounding
    assert np.abs(basis.phi(1.0 - grid) @ mirrored - values).max() > 1e-3  # twin: the mirrored filter
    anywhere = np.append(np.random.default_rng(100 + p).random(2), [] if p == 3 else 7.7e-13)  # its Theta'' is rough
    allowed = 1e-11 if p <= 6 and level < 2 else 1e-8  # rounding of the weights, on kernels without fused products too
    for derivative in range(3 if p > 2 else 2):
        largest = np.abs(basis.phi(grid, derivative) @ weights).max(axis=0)
        gap = basis.phi(anywhere, derivative) @ weights - paper_basis_functions(p, level, anywhere, derivative) / size
        assert np.abs(gap / largest).max() < allowed


def test_there_is_no_second_derivative_for_order_two():
    with pytest.raises(KeyError):
        Daubechies(2, 1).phi(np.array([0.4]), 2)
    assert [Daubechies(p).has_second_derivative for p in (2, 3, 4, 5)] == [False, False, True, True]


# --- the set: count, rank, span, approximation -------------------------------------------------------------------


def test_the_literal_set_is_independent():
    for p, level in itertools.product(ORDERS, range(5)):
        assert Daubechies(p, level).n == 2**level * (2 * p - 1) + p - 1 == len(scales_and_shifts(p, level))


def test_shifted_reading_shows_its_lost_rank():
    """psi on [1-p, p]; ranks confirmed by elimination in 80 digits."""
    bases = [Daubechies(4, level, "shifted") for level in range(3)]
    counts = [len(scales_and_shifts(4, level)) for level in range(3)]
    assert [(count, b.n) for count, b in zip(counts, bases, strict=True)] == [(10, 7), (17, 13), (31, 25)]
    assert bases[2].phi(np.array([0.2, 0.7])).shape == (2, 25)


def relative_sine_error(basis):
    """|f - best|/|f| in the H1 seminorm, f = sin pi s; int f' phi' = pi^2 int f phi, a smooth integral."""
    s, w = fine_quadrature(basis, pieces=16)
    best = np.linalg.solve(basis.stiffness_matrix(), np.pi**2 * (w * np.sin(np.pi * s)) @ basis.phi(s))
    return float(np.sqrt(2.0 * w @ (np.cos(np.pi * s) - basis.phi(s, 1) @ best / np.pi) ** 2))


def test_literal_set_converges_and_scaling_reading_stalls():
    """Four vanishing moments: the best approximation of a smooth slope gains nearly four binary digits a level."""
    literal = np.array([relative_sine_error(Daubechies(4, level)) for level in range(5)])
    assert np.all(literal[1:] < literal[:-1] / 10.0)
    assert literal[0] < 2e-3
    scaling = [relative_sine_error(Daubechies(4, level, "scaling")) for level in range(4)]
    assert min(scaling) > 0.1
    assert min(relative_sine_error(Daubechies(4, level, "shifted")) for level in range(3)) > 0.5


# --- what every basis promises -----------------------------------------------------------------------------------


BASES = [
    Fourier(7),
    Fourier(23),
    *(Daubechies(p, level) for p, level in [(2, 0), (2, 3), (3, 1), (4, 0), (4, 1), (4, 3), (6, 1), (8, 0), (10, 0)]),
]
every_basis = pytest.mark.parametrize("basis", BASES, ids=repr)


def hoelder_exponent(basis):
    """Hoelder exponent of phi' (Fourier: any)."""
    return {2: 0.55, 3: 1.08}.get(basis.order, 1.6) if isinstance(basis, Daubechies) else 5.0


@every_basis
def test_functions_vanish_at_both_supports(basis: Basis):
    ends = basis.phi(np.array([0.0, 1.0]))
    assert ends.shape == (2, basis.n)
    assert abs(ends).max() < 1e-14 * basis.n * max(1.0, abs(basis.phi(np.linspace(0, 1, 51))).max())


@pytest.mark.parametrize("basis", [*BASES, Fourier(1), Fourier(400)], ids=repr)
def test_slopes_on_both_sides_of_a_mass_are_the_slopes(basis: Basis):
    s, _, table = basis.quadrature_with_kinked_slopes(0.371)
    slopes = basis.phi(s, 1)
    np.testing.assert_allclose(table[:-1].T, slopes, rtol=0.0, atol=1e-14 * basis.n * np.abs(slopes).max())


@every_basis
def test_each_function_is_the_integral_of_the_next(basis: Basis):
    """From the second primitive to phi'' (phi' where it is too rough), over a piece that ends at no special places."""
    a, b = 0.1373, 0.8119
    s, w = fine_quadrature(basis, a, b)
    for m in range(-1, 3 if basis.has_second_derivative else 2):
        rise, integral = np.diff(basis.phi(np.array([a, b]), m - 1), axis=0)[0], w @ basis.phi(s, m)
        allowed = fine_quadrature_error(basis, hoelder_exponent(basis) + 1 - m) * abs(basis.phi(s, m)).max()
        assert abs(integral - rise).max() < allowed
        assert abs(2.0 * integral - rise).max() > allowed  # the twin


@every_basis
def test_mass_stiffness_and_integral_against_a_fine_rule(basis: Basis):
    """phi'^2 is no smoother than phi', so this rule sees the stiffness to 1e-6 only."""
    s, w = fine_quadrature(basis)
    values, slopes = basis.phi(s), basis.phi(s, 1)
    mass, size = values.T @ (w[:, None] * values), abs(basis.mass_matrix()).max()
    assert abs(mass - basis.mass_matrix()).max() < fine_quadrature_error(basis, hoelder_exponent(basis) + 1.0) * size
    assert (
        abs(1.0001 * mass - basis.mass_matrix()).max()
        > fine_quadrature_error(basis, hoelder_exponent(basis) + 1.0) * size
    )
    allowed = fine_quadrature_error(basis, hoelder_exponent(basis) + 1.0) * abs(values).max()
    assert abs(w @ values - basis.integrals()).max() < allowed
    stiffness = slopes.T @ (w[:, None] * slopes) - basis.stiffness_matrix()
    assert (
        abs(stiffness).max()
        < fine_quadrature_error(basis, hoelder_exponent(basis)) * abs(basis.stiffness_matrix()).max()
    )


@settings(max_examples=20, deadline=None)
@given(cut=st.floats(1e-6, 1.0 - 1e-6), which=st.integers(0, len(BASES) - 1))
def test_pieces_of_a_rule_add_up_to_the_cable(cut, which):
    """Weights positive, points inside, 1 and s exact on each piece wherever the mass is."""
    for (a, b), (s, w) in zip(((0.0, cut), (cut, 1.0)), quadrature_of_sides(BASES[which], cut), strict=True):
        assert np.all(w > 0.0)
        assert s.min() >= a
        assert s.max() <= b
        assert abs(w.sum() - (b - a)) < 1e-14
        assert abs(w @ s - 0.5 * (b * b - a * a)) < 1e-14


def test_sine_rules_are_exact_on_each_side_and_n_plus_12_points_are_not():
    basis = Fourier(60)

    def gap(rules):
        return (
            max(
                abs(
                    sum(basis.phi(s, 1).T @ (w[:, None] * basis.phi(s, 1)) for s, w in rules) - basis.stiffness_matrix()
                ).ravel()
            )
            / basis.stiffness_matrix().max()
        )

    for cut in (0.02, 0.4, 0.97):
        assert gap(quadrature_of_sides(basis, cut)) < 1e-12
    assert gap([basis.quadrature()]) < 1e-12
    few = leggauss(basis.n + 12)
    assert gap([(0.97 * 0.5 * (1.0 + few[0]), 0.97 * 0.5 * few[1]), quadrature_of_sides(basis, 0.97)[1]]) > 1e-2


# --- refusals ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("s", [-1e-9, 1.0 + 1e-9, np.nan])
def test_places_off_the_cable_are_refused(s):
    with pytest.raises(ValueError, match=r"s must lie in \[0, 1\]"):
        Daubechies(4, 1).phi(np.array([0.5, s]))
