"""The static cable against its differential equation, its supports and extended precision."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.chebyshev import Chebyshev

from cablefem.scene.catenary import Z_MAX, Z_MIN, Catenary, coordinates, tension_and_shape_derivatives

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
    T, xp, yp, xpp, ypp = tension_and_shape_derivatives(s, cable.sigma, cable.c)
    np.testing.assert_allclose(T * xp, 1.0, rtol=1e-14)
    np.testing.assert_allclose(T * yp, cable.c - cable.sigma * s, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(np.hypot(xp, yp), 1.0, rtol=1e-14)
    # the tangent turns: x' x'' + y' y'' = 0, and the curvature is sigma/T^2
    np.testing.assert_allclose(xp * xpp + yp * ypp, 0.0, atol=1e-14 * (1.0 + cable.sigma))
    np.testing.assert_allclose(np.hypot(xpp, ypp), cable.sigma / T**2, rtol=1e-13)
    np.testing.assert_allclose(cable.tension(s * cable.length), cable.horizontal_tension * T, rtol=1e-13)
    x, y = coordinates(s, cable.sigma, cable.c)
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
    tolerance = 1e-14 + 4.0 * np.finfo(float).eps * cable.length / cable.excess_over_chord
    assert by_length.horizontal_tension == pytest.approx(cable.horizontal_tension, rel=tolerance)
    assert by_length.sag == pytest.approx(cable.sag, rel=tolerance)


def catenary_in_50_digits(span, drop, weight, tension):
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
    slack, c, sag = catenary_in_50_digits(cable.span, cable.drop, cable.weight, cable.horizontal_tension)
    # of a taut cable length - chord would keep few digits
    assert cable.excess_over_chord == pytest.approx(slack, rel=1e-14)
    # c is a difference on a steeply rising cable: sinh(theta_m + z) with theta_m = -3 at 84 degrees
    assert cable.c == pytest.approx(c, rel=1e-14, abs=1e-15)
    assert cable.sag == pytest.approx(sag, rel=2e-13)


@pytest.mark.parametrize("drop", [0.0, 730.0, -1900.0])
def test_the_ends_of_the_admissible_ranges_are_admissible_and_nothing_beyond(drop):
    span, weight = 1100.0, 5.2
    taut, deep = (Catenary.from_sag_parameter(span, drop, weight, z) for z in (Z_MIN, Z_MAX))
    for make, low, high in (
        (Catenary.from_length, taut.chord * (1.0 + 1e-12), deep.length),
        (Catenary.from_sag, taut.sag, deep.sag),
    ):
        for value in (low, high):
            assert Z_MIN * 0.999 < make(span, drop, weight, value).sag_parameter < Z_MAX * 1.001
        for value in (0.999 * low, 1.001 * high, math.nan, -1.0):
            with pytest.raises(ValueError, match=r"one sign|chord|domain|positive"):
                make(span, drop, weight, value)
    assert (deep.sag_parameter, taut.sag_parameter) == pytest.approx((Z_MAX, Z_MIN))
