"""Bare cables: every frequency has a shape that satisfies its equation, and the models meet in their limits."""

import math
import sys

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from validation import oracles
from validation.oracles import catenary_modes, irvine

SIGMA, ALPHA = 0.1688832, 844.416


def symmetric_mode(s, W):
    """Shape of a flat cable's symmetric mode of frequency W: 1 - cos(W s) - tan(W/2) sin(W s)."""
    s = np.asarray(s, float)
    return 1.0 - np.cos(W * s) - math.tan(0.5 * W) * np.sin(W * s)


@pytest.mark.parametrize(
    ("sigma", "alpha", "c"), [(SIGMA, ALPHA, None), (0.9, 210.0, 1.3), (2.2, 75.0, 1.1), (0.06473, 323.7, 0.08)]
)
def test_catenary_modes_satisfy_the_differential_equation(sigma, alpha, c):
    """The shapes, differentiated as Chebyshev series, in the strong form; the n^4 of that bounds the digits left."""
    modes = catenary_modes.solve_modes(sigma, alpha, c)
    c = 0.5 * sigma if c is None else c
    p = c - sigma * modes.s
    T = np.sqrt(1.0 + p * p)
    x1, y1 = 1.0 / T, p / T

    def d(f):  # d/ds = cos d/dx
        x = np.arcsinh(c) - np.arcsinh(p)
        points = 2.0 * x / x[-1] - 1.0
        coef = chebyshev.chebfit(points, f, len(points) - 1)
        return x1 * 2.0 * sigma / x[-1] * chebyshev.chebval(points, chebyshev.chebder(coef))

    for W, u, v in zip(modes.omega, modes.u, modes.v, strict=True):
        assert np.abs([u[0], u[-1], v[0], v[-1]]).max() < 1e-12
        stretch = (alpha - T) * (x1 * d(u) + y1 * d(v))
        force = d(T * d(u) + stretch * x1), d(T * d(v) + stretch * y1)
        residual = max(np.abs(force[0] + W * W * u).max(), np.abs(force[1] + W * W * v).max())
        assert residual < 1e-6 * W * W * max(1.0, alpha / 500.0)
        wrong = d(T * d(u) - stretch * x1) + W * W * u
        assert np.abs(wrong).max() > 1e-2 * W * W


def test_catenary_modes_are_as_exact_as_they_say():
    """Against twice as many points, of flat and of very deep cables; half as many (must fail) are not."""
    for sigma, alpha, c in ((SIGMA, ALPHA, None), (1.3, 500.0, 1.1), (36.0, 1e5, 20.0)):
        half, told, fine = (catenary_modes.solve_modes(sigma, alpha, c, degree=n).omega for n in (24, 48, 96))
        np.testing.assert_allclose(told, fine, rtol=1e-11)
        assert np.abs(half / fine - 1.0).max() > 1e-11


def test_irvine_reference_and_limits():
    L2 = irvine.irvine_parameter(SIGMA, ALPHA)
    assert pytest.approx(24.08404, abs=1e-5) == L2
    assert irvine.lowest_frequencies(L2, 1)[0] == pytest.approx(5.3497920, abs=5e-8)
    np.testing.assert_allclose(
        irvine.symmetric_frequencies(1e-9, 4), math.pi * np.array([1.0, 3.0, 5.0, 7.0]), atol=1e-8
    )
    for W in irvine.symmetric_frequencies(L2, 5):
        z = 0.5 * W
        assert math.tan(z) == pytest.approx(z - 4.0 / L2 * z**3, rel=1e-10)
    assert abs(math.tan(2.67489) - (2.67489 + 4.0 / L2 * 2.67489**3)) > 1.0  # the sign of the cubic term matters


@pytest.mark.parametrize("L2", [0.7, 24.08404, 39.9, 900.0])
def test_irvine_modes_satisfy_the_integro_differential_equation(L2):
    """w'' + W^2 w = L^2 int w, ends fixed (h y'' = L^2 int w times -1 moved to the left)."""
    node, weight = np.polynomial.legendre.leggauss(60)
    s, weight = 0.5 * (1.0 + node), 0.5 * weight
    for W in irvine.symmetric_frequencies(L2, 4):
        w = symmetric_mode(s, W)
        assert np.abs(symmetric_mode([0.0, 1.0], W)).max() < 1e-12
        # w'' = W^2 (cos + tan sin) = W^2 (1 - w): the equation is W^2 = L^2 int w
        assert L2 * np.sum(weight * w) == pytest.approx(W * W, rel=1e-9)
        h = 1e-3
        stencil = symmetric_mode(s[:, None] + h * np.arange(-1.0, 2.0), W)
        curvature = stencil @ np.array([1.0, -2.0, 1.0]) / h**2
        assert np.abs(curvature - W * W * (1.0 - w)).max() < 1e-6 * W**4 * np.abs(w).max()  # h^2 w''''/12
    assert L2 * np.sum(weight * symmetric_mode(s, W + 0.1)) != pytest.approx((W + 0.1) ** 2, rel=1e-3)


def test_inextensible_reference_and_constraint():
    W = irvine.symmetric_frequencies(math.inf, 5)
    assert W[0] == pytest.approx(8.986819, abs=5e-7)
    np.testing.assert_allclose(np.tan(0.5 * W), 0.5 * W, rtol=1e-12)
    node, weight = np.polynomial.legendre.leggauss(60)
    for w in W:
        shape = symmetric_mode(0.5 * (1.0 + node), w)
        assert abs(np.sum(weight * shape)) < 1e-12 * np.abs(shape).max()  # the area under the cable stays
    np.testing.assert_allclose(
        irvine.lowest_frequencies(math.inf, 4), [2 * math.pi, W[0], 4 * math.pi, W[1]], rtol=1e-15
    )
    assert abs(np.sum(weight * symmetric_mode(0.5 * (1.0 + node), 8.9))) > 1e-2


@pytest.mark.parametrize("slope", [0.0, 0.7])
def test_a_flat_catenary_that_cannot_stretch_is_the_inextensible_cable(slope):
    def modes(sigma, alpha=math.inf):
        return catenary_modes.solve_modes(sigma, alpha, slope + 0.5 * sigma, count=5).omega / (1.0 + slope**2) ** 0.25

    gap = [np.abs(modes(sigma) - irvine.lowest_frequencies(math.inf, 5)).max() for sigma in (0.12, 0.06)]
    assert gap[0] < 0.05
    assert gap[0] / gap[1] == pytest.approx(4.0, rel=0.3)
    np.testing.assert_allclose(modes(0.12, 1e7), modes(0.12), rtol=1e-3)


def test_parameters_outside_the_validity_are_refused():
    for call in (
        lambda: catenary_modes.solve_modes(-0.1, 500.0),
        lambda: catenary_modes.solve_modes(0.1, float("nan")),
        lambda: catenary_modes.solve_modes(0.1, 500.0, count=40, degree=48),
        lambda: irvine.lowest_frequencies(0.0, 3),
        lambda: irvine.irvine_parameter(0.1, 500.0, 1.2),
        lambda: irvine.lowest_frequencies(math.inf, 0),
    ):
        with pytest.raises(ValueError, match="needed"):
            call()


def test_every_oracle_is_listed_once_and_says_what_it_is():
    found = oracles.find_oracles()
    assert len(found) >= 14
    for name, o in found.items():
        doc = sys.modules[f"validation.oracles.{name.replace('-', '_')}"].__doc__ or ""
        assert "Validity:" in doc, name
        assert "Accuracy:" in doc, name
        assert o.source.split()[0].rstrip(",") in doc, name
