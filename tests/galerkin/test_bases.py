"""Global bases of the Galerkin wing: each claim against an evaluation that shares only the formula with the code.

The witness for wavelets is mpmath in 60 digits: filters from the roots of Daubechies' polynomial, derivatives by the
unfactored masks 2 h and 4 h, integrals by the mask h/2 with the value 1 right of the support.
"""

from functools import lru_cache

import mpmath as mp
import numpy as np
import pytest
import pywt
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.legendre import leggauss

from galerkin.bases import Basis, Daubechies, Fourier
from galerkin.bases.daubechies import _mother, _printed, _sums

WITNESS_DIGITS = 60  # the mask 4 h multiplies rounding by 2 per binary digit: 60 of them cost 18 digits

ORDERS = range(2, 11)
places = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=5).map(np.array)


# --- the witness -----------------------------------------------------------------------------------------------


@lru_cache(maxsize=32)
def witness_filter(p, mirrored=False):
    """h of Daubechies' order p, sum 2, from the roots of sum_k binom(p-1+k, k) y^k outside the unit circle."""
    with mp.workdps(WITNESS_DIGITS):
        poly = [mp.mpf(1)]
        c = [mp.binomial(p - 1 + k, k) for k in range(p)]
        for start in np.roots([float(a) for a in c[::-1]]):
            y = mp.mpc(complex(start))
            for _ in range(8):  # Newton: from 1e-12, squared each time
                y -= mp.fsum(c[k] * y**k for k in range(p)) / mp.fsum(k * c[k] * y ** (k - 1) for k in range(1, p))
            z = 1 - 2 * y + mp.sqrt((1 - 2 * y) ** 2 - 1)  # (z + 1/z)/2 = 1 - 2 y
            z = z if abs(z) > 1 else 1 / z
            poly = [a - b / z for a, b in zip([*poly, 0], [0, *poly], strict=True)]
        for _ in range(p):
            poly = [a + b for a, b in zip([*poly, 0], [0, *poly], strict=True)]
        poly = [2 * mp.re(c) / mp.re(sum(poly)) for c in poly]
        return tuple(poly[::-1] if mirrored else poly)


@lru_cache(maxsize=64)
def witness_start(p, derivative, mirrored):
    """phi, phi' (derivative 1) or the integral of phi (derivative -1) at 0 .. R-1."""
    h, R = witness_filter(p, mirrored), 2 * p - 1
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


@lru_cache(maxsize=4096)
def witness_walk(p, x, derivative, mirrored):
    """phi (or its derivative, or its integral) at x, x + 1, .. x + R - 1 for an exact mpf 0 <= x < 1."""
    h, R = witness_filter(p, mirrored), 2 * p - 1
    if x == 0:
        return witness_start(p, derivative, mirrored)
    digit = int(2 * x)
    v = witness_walk(p, 2 * x - digit, derivative, mirrored)
    beyond = 1 if derivative < 0 else 0
    at = [v[q] if q < R else beyond for q in range(2 * R)]
    scale = mp.mpf(2) ** derivative
    return [scale * mp.fsum(h[k] * at[2 * i - k + digit] for k in range(min(R, 2 * i + digit) + 1)) for i in range(R)]


def witness_phi(p, y, derivative, mirrored=False):
    """phi (or its derivative, or its integral) at an exact mpf y."""
    if y <= 0 or y >= 2 * p - 1:
        return mp.mpf(1 if y > 0 and derivative < 0 else 0)
    cell = int(mp.floor(y))
    return witness_walk(p, y - cell, derivative, mirrored)[cell]


def witness_psi(p, y, derivative, mirrored=False):
    """theta (-1), psi (0) or psi' (1) at an exact mpf y, psi(y) = sum (-1)^k h_(R-k) phi(2y - k)."""
    h, R = witness_filter(p, mirrored), 2 * p - 1
    return mp.mpf(2) ** derivative * sum(
        (-1) ** k * h[R - k] * witness_phi(p, 2 * y - k, derivative, mirrored) for k in range(R + 1)
    )


def witness_printed(p, j, k, s, derivative, mirrored=False):
    """Theta_jk of (39) at x = R s rounded to a float, or its derivative with respect to s; s a float."""
    with mp.workdps(WITNESS_DIGITS):
        R = 2 * p - 1
        x, two_j = mp.mpf(s * R), mp.mpf(2) ** j
        rise = witness_psi(p, two_j * R - k, -1, mirrored) - witness_psi(p, mp.mpf(-k), -1, mirrored)
        value = witness_psi(p, two_j * x - k, derivative - 1, mirrored) * two_j**derivative
        if derivative == 0:
            value -= witness_psi(p, mp.mpf(-k), -1, mirrored) + x / R * rise
        elif derivative == 1:
            value -= rise / R
        return float(value * mp.mpf(R) ** derivative / mp.sqrt(two_j))


def printed(basis, s, derivative=0):
    """Theta_jk(R s) as printed in (39) or its derivative with respect to s, (n_s, count), by j, then k."""
    c = _printed(basis.order, basis.level, basis.reading)
    mean = _sums(basis.order, basis.level, c)(np.array([1.0]), -1)
    return _sums(basis.order, basis.level, c - mean)(s, derivative - 1)


def sides(basis, cut):
    """The rules on both sides of a mass."""
    s, w, _ = basis.split(cut)
    left = s < cut
    return (s[left], w[left]), (s[~left], w[~left])


def printed_places(p, level):
    """(j, k) in the order of the columns, (37)."""
    R = 2 * p - 1
    return [(-1, k) for k in range(1 - R, p)] + [(j, k) for j in range(level) for k in range(p - R, 2**j * R - p + 1)]


def witness_gap(basis, s, derivative, mirrored=False):
    """Largest gap of the printed functions to the witness at s, relative to each function's own maximum."""
    mine = printed(basis, s, derivative)
    size = np.abs(printed(basis, np.linspace(0.0, 1.0, 8 * basis.cells + 1), derivative)).max(axis=0)
    theirs = np.array(
        [
            [
                witness_printed(basis.order, j, k, float(x), derivative, mirrored)
                for j, k in printed_places(basis.order, basis.level)
            ]
            for x in s
        ]
    )
    return float((np.abs(mine - theirs) / size).max())


def test_the_witness_satisfies_what_defines_daubechies_filters():
    for p in (2, 5, 10):
        h = witness_filter(p)
        with mp.workdps(WITNESS_DIGITS):
            for shift in range(p):
                dot = mp.fsum(a * b for a, b in zip(h[2 * shift :], h, strict=False))
                assert abs(dot - 2 * (shift == 0)) < mp.mpf(10) ** -40
            for r in range(p):
                assert abs(mp.fsum((-1) ** k * mp.mpf(k) ** r * h[k] for k in range(2 * p))) < mp.mpf(10) ** -35


# --- fine rules ----------------------------------------------------------------------------------------------------


def composite_gauss(edges, n):
    """n Gauss points between any two neighbouring edges."""
    x, w = leggauss(n)
    h = np.diff(edges)
    return (edges[:-1, None] + 0.5 * h[:, None] * (1.0 + x)).ravel(), (0.5 * h[:, None] * w).ravel()


def fine_rule(basis, a=0.0, b=1.0, pieces=512):
    """Two points on each of `pieces` parts of a cell, cut at a and b; for sines 12 points per half wave: rounding."""
    if isinstance(basis, Fourier):
        return composite_gauss(np.linspace(a, b, basis.n + 1), 12)
    grid = np.arange(pieces * basis.cells + 1) / (pieces * basis.cells)
    return composite_gauss(np.concatenate([[a], grid[(grid > a) & (grid < b)], [b]]), 2)


def fine_rule_error(basis, exponent, pieces=512):
    """Relative error to expect of `fine_rule`: pieces^-(exponent + 1), at best order 4, for a Hoelder exponent."""
    return 1e-13 if isinstance(basis, Fourier) else 1e-13 + 10.0 * float(pieces) ** -min(exponent + 1.0, 4.0)


# --- filters and the scaling function ----------------------------------------------------------------------------


@pytest.mark.parametrize("p", ORDERS)
def test_filters_are_right_to_the_last_bit_of_every_tap(p):
    exact = np.array([float(tap) for tap in witness_filter(p)])
    np.testing.assert_allclose(_mother(p).h, exact, rtol=3e-16)  # 1.5 units in the last place
    np.testing.assert_allclose(_mother(p).h, np.sqrt(2.0) * np.array(pywt.Wavelet(f"db{p}").rec_lo), rtol=1e-14)
    assert abs(_mother(p).h - exact[::-1]).max() > 0.1  # the twin: the mirrored filter is another one


@settings(max_examples=25, deadline=None)
@given(p=st.integers(2, 10), s=places)
def test_scaling_functions_reproduce_polynomials(p, s):
    """sum_l phi(y - l) = 1 and sum_l l phi(y - l) = y - m_1, m_1 = 1/2 sum k h_k; a shifted first moment fails."""
    R = 2 * p - 1
    phi = _sums(p, 1, np.eye(3 * R - 1))(s, 0)  # phi(y - l), l = 1-R .. 2R-1, y = 2 R s
    y, l, m1 = 2 * R * s, np.arange(1 - R, 2 * R), 0.5 * np.arange(R + 1) @ _mother(p).h
    inside = s < 1.0  # phi(y - 2R) = phi(0) = 0 is not in the sum, and is not missed
    np.testing.assert_allclose(phi.sum(axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(phi @ l, y - m1, atol=1e-13 * R)
    assert np.all(abs(phi @ l - (y - m1 + 0.01))[inside] > 5e-3)


@pytest.mark.parametrize("p", ORDERS)
def test_wavelets_inside_the_cable_have_vanishing_moments(p):
    """int x^r psi = 0 for r < p: the r-th primitive of theta ends at 0; for order 2 the second does not."""
    basis, R, grid = Daubechies(p, 2), 2 * p - 1, np.linspace(0.0, 1.0, 97)
    inside = [0 <= k <= (2**j - 1) * R for j, k in printed_places(p, 2)]
    for r in (1, 2):
        far = printed(basis, grid, -r)
        relative = abs(far[-1]) / abs(far).max(axis=0)
        assert relative[~np.array(inside)].max() > 0.5  # cut by a support: no such moments
        if r < p:
            assert relative[inside].max() < 1e-12
        else:
            assert relative[inside].min() > 0.5


# --- the printed functions against the witness -------------------------------------------------------------------


@pytest.mark.parametrize("p", ORDERS)
def test_printed_functions_and_derivatives_equal_the_witness_at_random_places(p):
    """(39) and its derivatives to 2e-14 of each function's own maximum (5e-15 measured), tails of 1e-19 included."""
    s = np.random.default_rng(100 + p).random(2)
    for level in (0, 1) if p < 7 else (0,):  # the witness takes its time with long filters
        for derivative in range(3 if p > 2 else 2):
            assert witness_gap(Daubechies(p, level), s, derivative) < 2e-14


@settings(max_examples=25, deadline=None)
@given(s=st.sampled_from([0.0, 0.5, 1.0]) | st.floats(1e-7, 1.0), p=st.integers(3, 5), level=st.integers(0, 2))
def test_second_derivatives_equal_the_witness_at_any_float(s, p, level):
    """Theta'' is only Hoelder 0.6 for p = 4, 0.09 for p = 3: the witness takes the same rounding of R s."""
    assert witness_gap(Daubechies(p, level), np.array([s]), 2) < 2e-14


def test_places_next_to_a_support():
    """Places are cut after 80 binary digits: Theta'' of order 4 moves by 2^(-80 0.6) = 3e-15 at most."""
    for s in (3.1e-9, 7.7e-13, 2.0**-60):
        assert witness_gap(Daubechies(4, 1), np.array([s]), 2) < 2e-14


def test_a_mirrored_filter_or_a_moved_place_is_another_basis():
    basis, s = Daubechies(4, 1), np.array([0.3137, 0.781])
    assert witness_gap(basis, s, 0, mirrored=True) > 0.1
    assert abs(printed(basis, s, 2) - printed(basis, s + 1e-12, 2)).max() > 1e-9 * abs(printed(basis, s, 2)).max()


def test_there_is_no_second_derivative_for_order_two():
    for ask in (
        lambda: Daubechies(2, 1).phi(np.array([0.4]), 2),
        lambda: printed(Daubechies(2, 1), np.array([0.4]), 2),
    ):
        with pytest.raises(ValueError, match=r"order 2 has derivatives -2 \.\. 1"):
            ask()
    assert [Daubechies(p).smooth for p in (2, 3, 4, 5)] == [False, False, True, True]


# --- the set: count, rank, span, approximation -------------------------------------------------------------------


@pytest.mark.parametrize("p", ORDERS)
@pytest.mark.parametrize("level", range(5))
def test_literal_set_is_independent_and_spans_the_printed_functions(p, level):
    basis = Daubechies(p, level)
    assert basis.n == 2**level * (2 * p - 1) + p - 1 == len(printed_places(p, level))
    if basis.n > 100:  # spans of larger sets only cost time
        return
    s = np.linspace(0.0, 1.0, 6 * basis.cells + 1)
    value, slope = printed(basis, s), printed(basis, s, 1)
    weights, *_ = np.linalg.lstsq(basis.phi(s), value / abs(value).max(axis=0), rcond=None)
    slope /= abs(value).max(axis=0)
    assert abs(basis.phi(s) @ weights - value / abs(value).max(axis=0)).max() < 1e-12
    assert abs(basis.phi(s, 1) @ weights - slope).max() < 1e-12 * abs(slope).max()


def test_shifted_reading_shows_its_lost_rank():
    """psi on [1-p, p]; ranks confirmed by elimination in 80 digits."""
    bases = [Daubechies(4, level, "shifted") for level in range(3)]
    counts = [len(printed_places(4, level)) for level in range(3)]
    assert [(count, b.n) for count, b in zip(counts, bases, strict=True)] == [(10, 7), (17, 13), (31, 25)]
    assert bases[2].phi(np.array([0.2, 0.7])).shape == (2, 25)


def sine_error(basis):
    """|f - best|/|f| in the H1 seminorm, f = sin pi s; int f' phi' = pi^2 int f phi, a smooth integral."""
    s, w = fine_rule(basis, pieces=16)
    best = np.linalg.solve(basis.stiffness(), np.pi**2 * (w * np.sin(np.pi * s)) @ basis.phi(s))
    return float(np.sqrt(2.0 * w @ (np.cos(np.pi * s) - basis.phi(s, 1) @ best / np.pi) ** 2))


def test_literal_set_converges_and_scaling_reading_stalls():
    """Four vanishing moments: the best approximation of a smooth slope gains nearly four binary digits a level."""
    literal = np.array([sine_error(Daubechies(4, level)) for level in range(5)])
    assert np.all(literal[1:] < literal[:-1] / 10.0)
    assert literal[0] < 2e-3
    scaling = [sine_error(Daubechies(4, level, "scaling")) for level in range(4)]
    assert min(scaling) > 0.1
    assert min(sine_error(Daubechies(4, level, "shifted")) for level in range(3)) > 0.5


# --- what every basis promises -----------------------------------------------------------------------------------


BASES = [
    Fourier(7),
    Fourier(23),
    *(Daubechies(p, level) for p, level in [(2, 0), (2, 3), (3, 1), (4, 0), (4, 1), (4, 3), (6, 1), (8, 0), (10, 0)]),
]
every_basis = pytest.mark.parametrize("basis", BASES, ids=repr)


def roughness(basis):
    """Hoelder exponent of phi' (Fourier: any)."""
    return {2: 0.55, 3: 1.08}.get(basis.order, 1.6) if isinstance(basis, Daubechies) else 5.0


@every_basis
def test_functions_vanish_at_both_supports(basis: Basis):
    ends = basis.phi(np.array([0.0, 1.0]))
    assert ends.shape == (2, basis.n)
    assert abs(ends).max() < 1e-14 * basis.n * max(1.0, abs(basis.phi(np.linspace(0, 1, 51))).max())


def cut_table(basis, cut=0.371):
    """The points on both sides of a mass, and phi' there by `split`."""
    s, _, table = basis.split(cut)
    return s, table[:-1]


long_tables = pytest.mark.parametrize("basis", [*BASES, Fourier(1), Fourier(2), Fourier(400)], ids=repr)


@long_tables
def test_long_tables_of_slopes_are_the_slopes(basis: Basis):
    """Wavelets: to the bit, also where they are looked up. Sines: to eps of the largest angle, which both sides round.

    An angle that is off by 10 eps of itself is seen.
    """
    s, table = cut_table(basis)
    if isinstance(basis, Daubechies):
        np.testing.assert_array_equal(table.T, basis.phi(s, 1))
        assert np.isin(s, basis.quadrature()[0]).sum() >= s.size - 4  # the lookup is what is tested
        return
    k, eps = np.arange(1, basis.n + 1), np.finfo(float).eps
    allowed = 2.0 * eps * (k * np.pi) ** 2 + eps * k * np.pi
    assert np.all(abs(table.T - basis.phi(s, 1)) <= allowed)
    assert np.any(abs(table.T - basis.phi(s * (1.0 + 10.0 * eps), 1)) > allowed)


@every_basis
def test_each_function_is_the_integral_of_the_next(basis: Basis):
    """From the second primitive to phi'' (phi' where it is too rough), over a piece that ends at no special places."""
    a, b = 0.1373, 0.8119
    s, w = fine_rule(basis, a, b)
    for m in range(-1, 3 if basis.smooth else 2):
        rise, integral = np.diff(basis.phi(np.array([a, b]), m - 1), axis=0)[0], w @ basis.phi(s, m)
        allowed = fine_rule_error(basis, roughness(basis) + 1 - m) * abs(basis.phi(s, m)).max()
        assert abs(integral - rise).max() < allowed
        assert abs(2.0 * integral - rise).max() > allowed  # the twin


@every_basis
def test_mass_stiffness_and_integral_against_a_fine_rule(basis: Basis):
    """phi'^2 is no smoother than phi', so this rule sees the stiffness to 1e-6 only; the next test sees it to 1e-11."""
    s, w = fine_rule(basis)
    values, slopes = basis.phi(s), basis.phi(s, 1)
    mass, size = values.T @ (w[:, None] * values), abs(basis.mass()).max()
    assert abs(mass - basis.mass()).max() < fine_rule_error(basis, roughness(basis) + 1.0) * size
    assert abs(1.0001 * mass - basis.mass()).max() > fine_rule_error(basis, roughness(basis) + 1.0) * size
    allowed = fine_rule_error(basis, roughness(basis) + 1.0) * abs(values).max()
    assert abs(w @ values - basis.integral()).max() < allowed
    stiffness = slopes.T @ (w[:, None] * slopes) - basis.stiffness()
    assert abs(stiffness).max() < fine_rule_error(basis, roughness(basis)) * abs(basis.stiffness()).max()


@pytest.mark.parametrize(("p", "allowed"), [(3, 7e-8), (4, 6e-10), (5, 3e-11), (8, 1e-12)])
def test_stiffness_is_the_identity_on_a_very_fine_rule(p, allowed):
    """2^13 parts of a cell: 10 parts^-(exponent + 1), exponent 1.08, 1.61, 1.96; rounding for order 8."""
    basis = Daubechies(p, 0)
    s, w = fine_rule(basis, pieces=2**13)
    slopes = basis.phi(s, 1)
    assert abs(slopes.T @ (w[:, None] * slopes) - basis.stiffness()).max() < allowed


@settings(max_examples=20, deadline=None)
@given(cut=st.floats(1e-6, 1.0 - 1e-6), which=st.integers(0, len(BASES) - 1))
def test_pieces_of_a_rule_add_up_to_the_cable(cut, which):
    """Weights positive, points inside, 1 and s exact on each piece wherever the mass is."""
    for (a, b), (s, w) in zip(((0.0, cut), (cut, 1.0)), sides(BASES[which], cut), strict=True):
        assert np.all(w > 0.0)
        assert s.min() >= a
        assert s.max() <= b
        assert abs(w.sum() - (b - a)) < 1e-14
        assert abs(w @ s - 0.5 * (b * b - a * a)) < 1e-14


def rule_error(basis, rule, fine):
    """|error| of int e^-s f' phi_n' ds in the dual norm over its norm, f = best approximation of sin 2 pi s."""

    def load(s, w):
        slope = basis.phi(s, 1)
        return ((w * np.exp(-s) * (slope @ c)) @ slope) / np.sqrt(np.diag(basis.stiffness()))

    c = np.linalg.solve(basis.stiffness(), (fine[1] * np.sin(2.0 * np.pi * fine[0])) @ basis.phi(fine[0]))
    exact = load(*fine)
    return float(np.linalg.norm(load(*rule) - exact) / np.linalg.norm(exact))


def rules_of(basis, cut):
    return basis.quadrature(), basis.split(cut)[:2]


@pytest.mark.parametrize(
    ("basis", "allowed"),
    [
        (Fourier(17), 1e-11),
        (Fourier(60), 1e-11),
        (Daubechies(2, 2), 1e-3),
        (Daubechies(3, 1), 3e-4),
        (Daubechies(4, 0), 5e-4),
        (Daubechies(4, 1), 2e-4),
        (Daubechies(4, 2), 2e-4),
        (Daubechies(6, 1), 2e-4),
    ],
    ids=repr,
)
def test_rules_resolve_products_of_slopes_wherever_the_mass_is(basis, allowed):
    """Allowed: about twice the worst of 6 places measured; a few hundred points cannot do more for a rough psi."""
    fine = fine_rule(basis, pieces=256)
    for cut in (0.003, 0.31, 0.77, 0.996):
        for rule in rules_of(basis, cut):
            assert rule_error(basis, rule, fine) < allowed
    coarse = composite_gauss(np.linspace(0.0, 1.0, basis.n // 2 + 2), 2)
    assert rule_error(basis, coarse, fine) > 10.0 * allowed  # the twin: about one point per function


def test_sine_rules_are_exact_on_each_side_and_n_plus_12_points_are_not():
    basis = Fourier(60)

    def gap(rules):
        return (
            max(
                abs(
                    sum(basis.phi(s, 1).T @ (w[:, None] * basis.phi(s, 1)) for s, w in rules) - basis.stiffness()
                ).ravel()
            )
            / basis.stiffness().max()
        )

    for cut in (0.02, 0.4, 0.97):
        assert gap(sides(basis, cut)) < 1e-12
    assert gap([basis.quadrature()]) < 1e-12
    few = leggauss(basis.n + 12)
    assert gap([(0.97 * 0.5 * (1.0 + few[0]), 0.97 * 0.5 * few[1]), sides(basis, 0.97)[1]]) > 1e-2


# --- refusals ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("s", [-1e-9, 1.0 + 1e-9, np.nan])
def test_places_off_the_cable_are_refused(s):
    with pytest.raises(ValueError, match=r"s must lie in \[0, 1\]"):
        Daubechies(4, 1).phi(np.array([0.5, s]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Daubechies(1), "order must be 2 .. 10"),
        (lambda: Daubechies(4, -1), "level must be 0 .. 8"),
        (lambda: Daubechies(4, 1.5), "level must be 0 .. 8"),
        (lambda: Daubechies(4, 0, "mirrored"), "literal, scaling"),
        (lambda: Fourier(0), "at least 1"),
        (lambda: Fourier(3, 1.0), "grading must lie in"),
    ],
)
def test_impossible_bases_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
