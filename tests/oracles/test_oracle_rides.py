"""Cars that roll: each exact answer in its own equation, with a twin that is wrong on purpose."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from cablefem import Scene
from cablefem.scene.statics import gripped_rest
from validation.oracles import ellipse, incline, rest, rocket, wave_drag


@pytest.mark.parametrize("factor", [1.0, 1.01])
def test_the_bead_on_an_ellipse_obeys_newton_with_equal_tensions(factor):
    """p.. = g j + N (e1 + e2), e1 and e2 towards the supports; with N 1 % off (must fail) it does not."""
    bead = ellipse.Ellipse(D=0.93, g=1.7)
    start = 0.22
    t = np.linspace(0.0, 2.2, 4001)
    s_o = bead.position_at_time(t, start)
    p = np.stack(bead.point(s_o), -1)
    path = CubicSpline(t, p)
    right = np.array([bead.D, 0.0])
    np.testing.assert_allclose(np.linalg.norm(p, axis=1), s_o, rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(right - p, axis=1), 1.0 - s_o, rtol=1e-9)
    pull = -p / s_o[:, None] + (right - p) / (1.0 - s_o)[:, None]
    N = factor * bead.tension(s_o, start)
    inner = slice(5, -5)
    missing = np.abs(path(t, 2) - [0.0, bead.g] - N[:, None] * pull)[inner].max()
    assert (missing < 1e-4 * bead.g) == (factor == 1.0)
    np.testing.assert_allclose(np.linalg.norm(path(t, 1), axis=1), bead.speed(s_o, start), atol=1e-6)
    rate = bead.speed(s_o, start) * np.sqrt(1.0 - bead.b**2 / (s_o * (1.0 - s_o)))
    np.testing.assert_allclose(np.abs(CubicSpline(t, s_o)(t, 1)), rate, atol=1e-6)


def test_small_swings_of_the_bead():
    bead = ellipse.Ellipse(D=0.93, g=1.7)
    crossing = brentq(lambda t: float(bead.position_at_time(np.array(t), 0.499)) - 0.5, 0.1, 3.0)
    assert crossing == pytest.approx(0.5 * math.pi / math.sqrt(bead.g * bead.b / 0.25), rel=1e-5)
    with pytest.raises(ValueError, match="0 < D < 1"):
        ellipse.Ellipse(D=1.1, g=1.0)


@pytest.mark.parametrize("factor", [1.0, 1.003])
def test_a_bead_on_a_string_that_gives_way_bounces(factor):
    """omega^2 = d2/dn2 of EA (r1 + r2 - 1)^2/2 across the path; with a time 0.3 % off (must fail) not."""
    bead, at, stiffness, h = ellipse.Ellipse(D=0.93, g=1.7), 0.27, 40.0, 1e-4
    right = np.array([bead.D, 0.0])
    along = np.subtract(bead.point(at + h), bead.point(at - h))
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)

    def energy(n):
        p = np.array(bead.point(at)) + n * across
        return 0.5 * stiffness * bead.g * (np.linalg.norm(p) + np.linalg.norm(right - p) - 1.0) ** 2

    omega = math.sqrt((energy(h) - 2.0 * energy(0.0) + energy(-h)) / h**2)
    assert (
        abs(factor * float(bead.transverse_bounce_period(at, stiffness)) * omega / (2.0 * math.pi) - 1.0) < 1e-4
    ) == (factor == 1.0)


@pytest.mark.parametrize("factor", [1.0, 1.003])
def test_drag_on_an_incline_obeys_newton(factor):
    given = {"mass": 0.31, "g": 0.7, "sin": 0.23, "drag_factor": 1.4}
    t = np.linspace(0.0, 6.0, 3001)
    s = incline.distance_with_drag(t, **given)
    v = CubicSpline(t, s)(t, 1)
    a = CubicSpline(t, v)(t, 1)[5:-5]
    missing = np.abs(a - given["g"] * given["sin"] + factor * given["drag_factor"] / given["mass"] * v[5:-5] ** 2).max()
    assert (missing < 1e-6) == (factor == 1.0)
    assert incline.terminal_speed(**given) == pytest.approx(v[-1], rel=1e-2)


@pytest.mark.parametrize("factor", [1.0, 1.003])
def test_a_car_with_friction_and_a_brake_obeys_newton(factor):
    """mu s.. = mu g (sin - mu_r cos) - F_b [s > s_b] but at the brake; with F_b 0.3 % off (must fail) not."""
    given = {"mass": 0.31, "g": 0.7, "sin": 0.23, "rolling_friction": 0.06, "brake_force": 0.2}
    t = np.linspace(0.0, incline.time_and_position_of_stop(0.53, **given)[0], 4001)[1:-1]
    s, h = incline.distance_with_brake(t, 0.53, **given), t[1] - t[0]
    a = (s[2:] - 2.0 * s[1:-1] + s[:-2]) / h**2
    away = np.abs(s[1:-1] - 0.53) > 1e-3
    force = 0.31 * 0.7 * (0.23 - 0.06 * math.sqrt(1.0 - 0.23**2)) - factor * 0.2 * (s[1:-1] > 0.53)
    assert (np.abs(0.31 * a - force)[away].max() < 1e-6) == (factor == 1.0)


def test_friction_and_brake_take_all_that_the_weight_has_given():
    mu, g, sin, mu_r, F_b, s_b = 0.31, 0.7, 0.23, 0.06, 0.2, 0.53
    t, s = incline.time_and_position_of_stop(s_b, mass=mu, g=g, sin=sin, rolling_friction=mu_r, brake_force=F_b)
    weight, cos = mu * g, math.sqrt(1.0 - sin**2)
    assert weight * sin * s == pytest.approx(mu_r * weight * cos * s + F_b * (s - s_b), rel=1e-13)
    given = {"mass": mu, "g": g, "sin": sin, "rolling_friction": mu_r, "brake_force": F_b}
    v_b = math.sqrt(2.0 * g * (sin - mu_r * cos) * s_b)
    after = incline.distance_with_brake(np.array([t, t + 1.0]), s_b, **given)
    assert after[0] == after[1] == pytest.approx(s, rel=1e-14)
    at = v_b / (g * (sin - mu_r * cos))  # of the brake: place and speed on both sides
    both = incline.distance_with_brake(at + np.array([-2e-6, -1e-6, 1e-6, 2e-6]), s_b, **given)
    assert both[1] == pytest.approx(s_b, abs=2e-6) == both[2]
    np.testing.assert_allclose([both[1] - both[0], both[3] - both[2]], 1e-6 * v_b, rtol=1e-4)
    with pytest.raises(ValueError, match="must hold"):
        incline.time_and_position_of_stop(s_b, mass=mu, g=g, sin=sin, rolling_friction=mu_r, brake_force=0.01)


@pytest.mark.parametrize("wrong", [False, True], ids=["rocket", "gripped"])
def test_the_rocket_s_string_carries_what_its_newton_law_needs(wrong):
    """R from the path by d'Alembert, slopes from the waves on both sides; without the thrust's lift (must fail) not."""
    mu, sigma, a, s0 = 0.37, 0.011, 0.83, 0.42
    sled = rocket.solve_depth_under_thrust(0.71, mu=mu, sigma=sigma, a=a, s0=s0)
    weight = mu * sigma
    t = np.linspace(0.0, 0.71, 4001)
    force = CubicSpline(t, 2.0 * sled(t)[1] + weight * (1.0 - (1.0 - 2.0 * s0) * a * t))
    impulse = force.antiderivative()

    def depth(x, now):
        """w(x, t): the rest shape, what the sled has sent since, less what would have kept that shape."""
        tent = weight * (x * (1.0 - s0) if x < s0 else s0 * (1.0 - x))
        left = brentq(lambda u: now - u - abs(x - (s0 + 0.5 * a * u * u)), -1.0, now, xtol=1e-15)
        return tent + 0.5 * impulse(max(left, 0.0)) - 0.5 * weight * max(now - abs(x - s0), 0.0)

    for now in (0.2, 0.45, 0.68):
        x, h = s0 + 0.5 * a * now * now, 1e-5
        assert depth(x, now) == pytest.approx(sled(now)[0], abs=1e-9 * weight)
        ahead = (depth(x + 2 * h, now) - depth(x + h, now)) / h
        behind = (depth(x - h, now) - depth(x - 2 * h, now)) / h
        mean = 0.5 * (ahead + behind)
        assert mean == pytest.approx(rocket._mean_slope(a * now, sled(now)[1], weight, s0), abs=1e-4 * weight)
        ddw = float(CubicSpline(t, sled(t)[1])(now, 1))
        V, y_s = a * now, sigma * (0.5 - x)
        lift = 0.0 if wrong else mu * a * (y_s + mean)
        needs = weight - mu * (ddw - sigma * V * V + y_s * a) + lift
        off = abs(float(force(now)) - needs) / weight
        assert (off < 1e-4) != wrong
    with pytest.raises(ValueError, match="echo"):
        rocket.solve_depth_under_thrust(1.1, mu=mu, sigma=sigma, a=0.1, s0=s0)
    with pytest.raises(ValueError, match="a t_end < 1"):
        rocket.solve_depth_under_thrust(0.7, mu=mu, sigma=sigma, a=1.5, s0=s0)


def test_beside_a_car_at_rest_the_cable_slopes_alike_on_both_sides():
    scene = Scene.from_toml(rest.ZIP)
    g = scene.groups
    at = rest.relative_rest_position(g)
    assert at == pytest.approx(0.784932735, abs=1e-9)
    r = gripped_rest(at, g)
    down = r.left_force[0, 1] - g.sigma * at
    assert down == pytest.approx(0.5 * g.mu * g.sigma, rel=1e-9)
    assert abs(gripped_rest(at + 1e-4, g).hold[0]) > 1e-7
    with pytest.raises(ValueError, match="different signs"):
        rest.relative_rest_position(g, 0.1, 0.2)


@pytest.mark.parametrize("drag", [True, False], ids=["waves", "forgotten"])
def test_a_hauled_sled_feels_the_waves_that_it_sends(drag):
    """R and its slopes from d'Alembert's field at both sides of the sled; without the drag (must fail) not."""
    mu, sigma, V, s0, now = 0.37, 0.011, 0.43, 0.36, 0.31
    weight, t = mu * sigma, np.linspace(0.0, 0.5, 2001)
    load = weight * (1.0 + V * V * (1.0 + 2.0 * mu) - 2.0 * V * V * (1.0 + mu) * np.exp(-2.0 * t / mu))
    impulse = CubicSpline(t, load).antiderivative()

    def depth(x, now):
        """w(x, t): the tent at rest and its motion, what the sled has sent since, less what would keep the tent."""
        tent = weight * (x * (1.0 - s0) if x < s0 else s0 * (1.0 - x))
        a, b = x - now, x + now  # int of V dtent/ds_o between them
        moved = 0.5 * V * weight * (-0.5 * (s0**2 - a**2) + (b - s0) - 0.5 * (b**2 - s0**2))
        left = brentq(lambda u: now - u - abs(x - s0 - V * u), -1.0, now, xtol=1e-15)
        return tent + moved + 0.5 * impulse(max(left, 0.0)) - 0.5 * weight * max(now - abs(x - s0), 0.0)

    def along(now):
        return depth(s0 + V * now, now)

    x, h = s0 + V * now, 1e-4
    ddw = (along(now + h) - 2.0 * along(now) + along(now - h)) / h**2
    R = float(np.interp(now, t, load))
    assert weight - mu * (ddw - sigma * V * V) == pytest.approx(R, abs=1e-4 * weight)
    mean = (depth(x + 2 * h, now) - depth(x + h, now) + depth(x - h, now) - depth(x - 2 * h, now)) / (2.0 * h)
    force = -R * (mean + sigma * (0.5 - x)) / weight**2
    assert (
        abs(wave_drag.wave_resistance_over_weight_squared(now, mu=mu, V=V, s0=s0, drag=drag) - force) < 1e-3
    ) == drag
