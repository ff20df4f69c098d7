"""The static cable against its differential equation, its supports, extended precision and a chain of links."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.chebyshev import Chebyshev

from cablefem.scene.catenary import Z_MAX, Z_MIN, Catenary, length_range, sag_range, shape, static, tension_range

SPANS = st.floats(3.0, 5000.0)
SLOPES = st.floats(-60.0, 60.0)  # degrees
SAG_RATIOS = st.floats(1e-5, 0.5)
WEIGHTS = st.floats(0.3, 200.0)  # N/m


@st.composite
def catenaries(draw):
    span, slope = draw(SPANS), draw(SLOPES)
    drop = span * math.tan(math.radians(slope))
    return Catenary.from_sag(span, drop, draw(WEIGHTS), draw(SAG_RATIOS) * span)


def equilibrium_defect(x, y, tension, weight, length):
    """Largest defect of (T x')' = 0, (T y')' + weight = 0 over the weight and of |r'| = 1, all at 41 Chebyshev points.

    Only values of x(s), y(s), T(s) are used: their derivatives come from interpolation.
    """

    def through(f):
        return Chebyshev.interpolate(f, 60, domain=[0.0, length])

    xs, ys, s = through(x).deriv(), through(y).deriv(), length * np.linspace(0.03, 0.97, 41)
    horizontal = through(lambda s: tension(s) * xs(s)).deriv()
    vertical = through(lambda s: tension(s) * ys(s)).deriv()
    defects = horizontal(s) / weight, vertical(s) / weight + 1.0, np.hypot(xs(s), ys(s)) - 1.0
    return max(float(np.max(np.abs(defect))) for defect in defects)


@pytest.mark.parametrize(("slope", "sag_ratio"), [(0.0, 0.021), (0.0, 0.5), (37.0, 0.13), (-60.0, 0.5), (60.0, 0.03)])
def test_the_catenary_solves_its_differential_equation_9(slope, sag_ratio):
    span = 730.0
    cable = Catenary.from_sag(span, span * math.tan(math.radians(slope)), 8.3, sag_ratio * span)
    defect = equilibrium_defect(cable.x, cable.y, cable.tension, cable.weight, cable.length)
    # two derivatives of a polynomial of degree 60 lose a factor 60^4 = 1.3e7 of 16 digits, times T/(weight l) < 40
    assert defect < 6e-8


def test_the_equilibrium_check_sees_a_wrong_tension_and_a_wrong_shape():
    cable = Catenary.from_sag(730.0, 210.0, 8.3, 31.0)
    wrong = (
        (cable.x, cable.y, lambda s: cable.tension(s) * (1.0 + 1e-5 * s / cable.length)),
        (cable.x, lambda s: cable.y(s) + 1e-4 * s * (cable.length - s) / cable.length, cable.tension),
        (lambda s: cable.x(s) * (1.0 + 1e-5), cable.y, cable.tension),
    )
    for x, y, tension in wrong:
        assert equilibrium_defect(x, y, tension, cable.weight, cable.length) > 2e-6


@given(catenaries())
@settings(deadline=None, max_examples=60)
def test_the_catenary_ends_at_its_supports(cable):
    s = np.array([0.0, cable.length])
    np.testing.assert_allclose(cable.x(s), [0.0, cable.span], rtol=0.0, atol=2e-13 * cable.length)
    np.testing.assert_allclose(cable.y(s), [0.0, cable.drop], rtol=0.0, atol=2e-13 * cable.length)


@given(catenaries(), st.lists(st.floats(0.0, 1.0), min_size=2, max_size=7))
@settings(deadline=None, max_examples=60)
def test_static_and_shape_belong_together(cable, places):
    """T x' = 1, T y' = c - sigma s, unit tangent, and the second derivatives are those of the first ones."""
    s = np.array(places)
    T, xp, yp, xpp, ypp = static(s, cable.sigma, cable.c)
    np.testing.assert_allclose(T * xp, 1.0, rtol=1e-14)
    np.testing.assert_allclose(T * yp, cable.c - cable.sigma * s, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(np.hypot(xp, yp), 1.0, rtol=1e-14)
    # the tangent turns: x' x'' + y' y'' = 0, and the curvature is sigma/T^2
    np.testing.assert_allclose(xp * xpp + yp * ypp, 0.0, atol=1e-14 * (1.0 + cable.sigma))
    np.testing.assert_allclose(np.hypot(xpp, ypp), cable.sigma / T**2, rtol=1e-13)
    np.testing.assert_allclose(cable.tension(s * cable.length), cable.horizontal_tension * T, rtol=1e-13)
    x, y = shape(s, cable.sigma, cable.c)
    np.testing.assert_allclose(cable.y(s * cable.length) / cable.length, y, atol=1e-14)
    # T = T_0 - sigma y: the tension of a catenary grows with height alone
    np.testing.assert_allclose(T, math.hypot(1.0, cable.c) - cable.sigma * y, rtol=1e-13)
    assert np.all(np.diff(x[np.argsort(s)]) >= -1e-14)  # neighbours in floating point differ by rounding


@given(catenaries())
@settings(deadline=None, max_examples=60)
def test_length_sag_and_tension_lead_to_the_same_cable(cable):
    by_tension = Catenary(cable.span, cable.drop, cable.weight, cable.horizontal_tension)
    assert by_tension.sag == pytest.approx(cable.sag, rel=1e-13)
    by_length = Catenary.from_length(cable.span, cable.drop, cable.weight, cable.length)
    # a length is known to rounding; l - chord, which alone fixes H (H ~ slack^-1/2), loses the factor l/slack
    tolerance = 1e-14 + 4.0 * np.finfo(float).eps * cable.length / cable.slack
    assert by_length.horizontal_tension == pytest.approx(cable.horizontal_tension, rel=tolerance)
    assert by_length.sag == pytest.approx(cable.sag, rel=tolerance)


def exactly(span, drop, weight, tension):
    """(l - chord, c, sag) of a catenary in 50 digits, straight from y = a cosh."""
    with mpmath.workdps(50):
        b, h, a = mpmath.mpf(span), mpmath.mpf(drop), mpmath.mpf(tension) / mpmath.mpf(weight)
        z = b / (2 * a)
        left = mpmath.asinh(h / (2 * a * mpmath.sinh(z))) + z  # asinh of y'/x' at the left support
        length = a * (mpmath.sinh(left) - mpmath.sinh(left - 2 * z))
        deepest = mpmath.asinh(h / b)
        sag = a * (mpmath.cosh(left) - mpmath.cosh(deepest)) - h / b * a * (left - deepest)
        return float(length - mpmath.hypot(b, h)), float(mpmath.sinh(left)), float(sag)


@pytest.mark.parametrize("slope", [0.0, 1e-3, 12.0, -60.0, 84.0])
@pytest.mark.parametrize("z", [Z_MIN, 5e-7, 1e-4, 0.084, 0.93, 1.7, Z_MAX])
def test_every_digit_of_a_taut_and_of_a_deep_cable(slope, z):
    span, weight = 1234.5, 6.7
    cable = Catenary(span, span * math.tan(math.radians(slope)), weight, weight * span / (2.0 * z))
    slack, c, sag = exactly(cable.span, cable.drop, cable.weight, cable.horizontal_tension)
    assert cable.slack == pytest.approx(slack, rel=1e-14)
    # c is a difference on a steeply rising cable: sinh(theta_m + z) with theta_m = -3 at 84 degrees
    assert cable.c == pytest.approx(c, rel=1e-14, abs=1e-15)
    assert cable.sag == pytest.approx(sag, rel=2e-13)


def test_a_sigma_of_a_millionth_keeps_its_slack_where_the_plain_difference_loses_it():
    cable = Catenary(1000.0, 170.0, 3.0, 3.0e9)
    slack, _, _ = exactly(1000.0, 170.0, 3.0, 3.0e9)
    assert cable.sigma == pytest.approx(1e-6, rel=0.02)
    assert cable.slack == pytest.approx(slack, rel=1e-14)
    # the twin, and why `slack` is not length - chord: 16 digits of l leave 3 of the slack
    assert abs((cable.length - cable.chord) / slack - 1.0) > 1e-4


@given(catenaries())
@settings(deadline=None, max_examples=40)
def test_no_point_hangs_deeper_below_the_chord_than_the_sag(cable):
    s = np.linspace(0.0, cable.length, 4001)
    depth = cable.y(s) - cable.drop / cable.span * cable.x(s)
    # x and y are rounded to l eps, steep chords multiply that by their slope < 2; the grid misses (1/4000)^2 of the top
    assert np.max(depth) == pytest.approx(cable.sag, rel=1e-6, abs=1e-12 * cable.length)
    assert cable.slack > 0.0
    lowest = cable.y(
        np.clip(
            cable.length * min(max(cable.c / cable.sigma, 0.0), 1.0) + np.array([-1e-3, 0.0, 1e-3]) * cable.length,
            0.0,
            cable.length,
        )
    )
    assert lowest[1] >= max(lowest) - 1e-13 * cable.length


def test_a_polyline_through_the_catenary_has_its_length_and_sag():
    cable = Catenary.from_sag(410.0, -95.0, 21.0, 57.0)
    x, y = (f(np.linspace(0.0, cable.length, 20001)) for f in (cable.x, cable.y))
    # chords miss (curvature x segment)^2/24 of an arc: (sigma/20000)^2/24 = 1e-10
    assert np.hypot(np.diff(x), np.diff(y)).sum() == pytest.approx(cable.length, rel=5e-10)
    assert np.max(y - cable.drop / cable.span * x) == pytest.approx(57.0, rel=1e-8)


@pytest.mark.parametrize("flip", [1.0, -1.0])
def test_a_chain_of_links_laid_on_the_catenary_is_in_equilibrium_under_refinement(flip):
    """In absolute coordinates: link forces T(s) along the links and nodal weights balance to second order.

    With the weight upside down (the twin) nothing balances.
    """
    cable = Catenary.from_sag(410.0, -95.0, 21.0, 57.0)
    defects = []
    for n in (40, 80, 160, 320):
        s = np.linspace(0.0, cable.length, n + 1)
        links = np.diff([cable.x(s), cable.y(s)])
        forces = cable.tension(0.5 * (s[1:] + s[:-1])) * links / np.hypot(*links)
        unbalanced = np.diff(forces) + flip * cable.weight * cable.length / n * np.array([[0.0], [1.0]])
        defects.append(np.max(np.abs(unbalanced)) * n / (cable.weight * cable.length))
    if flip < 0.0:
        assert min(defects) > 1.0
        return
    orders = np.log2(np.array(defects[:-1]) / defects[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.15)
    assert defects[-1] < 1e-4


def test_shallow_cables_hang_in_the_parabola_of_irvine():
    cable = Catenary(640.0, 130.0, 14.0, 9.1e5)
    parabola = 14.0 * 640.0 * cable.chord / (8.0 * 9.1e5)
    # the catenary is deeper by a part of order sigma^2 = 1e-4
    assert cable.sag == pytest.approx(parabola, rel=1e-4)
    assert cable.sag != pytest.approx(parabola, rel=1e-7)


@pytest.mark.parametrize("drop", [0.0, 730.0, -1900.0])
def test_the_ends_of_the_admissible_ranges_are_admissible_and_nothing_beyond(drop):
    span, weight = 1100.0, 5.2
    for make, (low, high) in (
        (Catenary.from_length, length_range(span, drop)),
        (Catenary.from_sag, sag_range(span, drop)),
    ):
        for value in (low, high):
            assert Z_MIN * 0.999 < make(span, drop, weight, value).z < Z_MAX * 1.001
        for value in (0.999 * low, 1.001 * high, math.nan, -1.0):
            with pytest.raises(ValueError, match="outside"):
                make(span, drop, weight, value)
    low, high = tension_range(span, weight)
    assert Catenary(span, drop, weight, low).z == pytest.approx(Z_MAX)
    assert Catenary(span, drop, weight, high).z == pytest.approx(Z_MIN)
