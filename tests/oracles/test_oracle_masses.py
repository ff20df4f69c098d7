"""Moving masses: string, supports and Newton's law hold for each oracle, and the oracles are each other's limits."""

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from cablefem.scene import AccelerateCruiseBrake, ConstantAcceleration, ConstantSpeed, Table
from validation.oracles import accelerating_force, accelerating_mass, moving_mass

from .wave_identity import random_parallelograms, wave_defect

SIGMA = 0.1688832


TRAVELS = {
    "constant": (ConstantSpeed(speed=0.37), 1.3, 0.4),
    "fast and light": (ConstantSpeed(speed=0.9), 0.15, 0.7),
    "slow and heavy": (ConstantSpeed(speed=0.14), 7.0, 0.2),
    "from rest": (ConstantAcceleration(acceleration=0.23), 0.6, 0.3),
    "from rest, heavy": (ConstantAcceleration(acceleration=0.44), 12.0, 0.3),
    "accelerate, cruise, brake": (AccelerateCruiseBrake(top_speed=0.62), 1.7, 0.25),
    "wavy": (Table(times=(0.0, 1.0, 2.0, 3.0, 4.0), positions=(0.0, 0.2, 0.5, 0.8, 0.97)), 0.8, 0.5),
}


def displacement_by_images(motion, impulse, x, t, *, mirror=-1.0):
    """v(x, t) between fixed ends by images; impulse(t) of a force that stays below the wave speed, 0 at t = 0."""
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    total, images = np.zeros(x.shape), math.ceil(0.5 * t.max()) + 1
    for way in 2.0 * np.arange(-images, images + 1):
        for sign in (1.0, mirror):
            side = math.copysign(1.0, sign)
            low, high = np.zeros(x.shape), t.copy()  # the last time at which an image sends what is heard at t
            for _ in range(60):
                middle = 0.5 * (low + high)
                heard = np.abs(x - way - side * motion.position(middle)) <= t - middle
                low, high = np.where(heard, middle, low), np.where(heard, high, middle)
            total += 0.5 * sign * impulse(low)
    return total


def history_at_constant_speed(V, **of):
    return moving_mass.solve_moving_mass(ConstantSpeed(speed=V).motion(1.0), **of)


def test_the_path_has_the_published_digits():
    """Smith; Dyniewicz & Bajer: mu = 1, V^2 = sigma, eleven digits."""
    V, at = math.sqrt(SIGMA), np.array([0.1, 0.3, 0.5, 0.7, 0.9])
    published = [0.004134619735, 0.026411465563, 0.054525087145, 0.078275585253, 0.064301851647]
    np.testing.assert_allclose(
        history_at_constant_speed(V, mu=1.0, sigma=SIGMA).mass_displacement(at / V), published, rtol=0.0, atol=1e-11
    )


@pytest.mark.parametrize("name", TRAVELS)
def test_the_mass_obeys_newton_and_sits_on_the_string_that_its_force_bends(name):
    """The string by images satisfies the wave equation, the supports and the state of rest."""
    travel, mu, sigma = TRAVELS[name]
    motion = travel.motion(1.0)
    ride = moving_mass.solve_moving_mass(motion, mu=mu, sigma=sigma)
    t = np.linspace(0.0, motion.time_at_position(0.95), 401)
    y, size = ride.mass_displacement(t), np.abs(ride.mass_displacement(t)).max()

    def impulse(t):
        """Integral of R."""
        y, F, G = ride.displacement_and_waves(t)
        return 2.0 * (F + G - y)

    def off(**spoiled):
        force = spoiled.pop("force", 1.0)
        v = displacement_by_images(motion, lambda s: force * impulse(s), motion.position(t), t, **spoiled)
        return np.abs(v - y).max() / size

    assert off() < 5e-9
    assert off(force=1.001) > 1e-5
    assert off(mirror=1.0) > 1e-2
    # mu y' = mu sigma t - I, by Simpson's rule: kinks of y'' within its steps
    fine = np.linspace(0.0, t[-1], 20001)
    fallen = 0.5 * sigma * fine**2 - cumulative_simpson(impulse(fine), x=fine, initial=0.0) / mu
    assert np.abs(ride.mass_displacement(fine) - fallen).max() < 1e-8 * size


# --- accelerating mass


@pytest.mark.parametrize(("mu", "a"), [(0.6, 0.7), (2.4, 1.9)])
def test_accelerating_mass_through_the_wave_speed(mu, a):
    sigma = 0.35
    par = {"mu": mu, "sigma": sigma, "a": a}

    def velocity(t):
        """y'(t); at t = 1/a before the blow."""
        u, sign = np.where(a * t <= 1.0, (t, np.ones_like(t)), (np.maximum(2.0 / a - t, 0.0), -np.ones_like(t)))
        return -0.5 * sign * sigma * mu * np.expm1(-2.0 * u / mu)

    def v(x, t):
        starts, ends = accelerating_force.heard_emission_intervals(x, t, V0=0.0, a=a)
        return 0.5 * np.sum(impulse(ends) - impulse(starts), axis=-1)

    def xi(s):
        return 0.5 * a * np.asarray(s) ** 2

    blow = (1.0 / a, 2.0 * mu * float(velocity(1.0 / a)))

    def impulse(s):
        return mu * (sigma * np.asarray(s) - velocity(np.asarray(s)))

    def smooth(s):  # without the blow
        return impulse(s) - np.where(s > 1.0 / a, blow[1], 0.0)

    quads = random_parallelograms(np.random.default_rng(8), 80, x=(-2.0, 4.0), t=(0.0, 2.5 / a), size=1.0, clip=False)
    assert np.abs(wave_defect(v, smooth, xi, quads, 8.0, (1.0 / a,), (blow,))).max() < 1e-11
    assert np.abs(wave_defect(v, smooth, xi, quads, 8.0, (1.0 / a,))).max() > 1e-3  # without the blow
    # the mass is on the string: y is continuous there, the kink has no height
    t = np.array([0.2, 0.7, 1.3, 1.8, 2.2]) / a
    np.testing.assert_allclose(v(xi(t), t), accelerating_mass.mass_displacement(t, **par), atol=1e-12)
    # Newton's law between t = 0, 1/a, 2/a
    h = 1e-4
    y = accelerating_mass.mass_displacement(t[:, None] + h * np.arange(-1.0, 2.0), **par)
    acceleration = y @ np.array([1.0, -2.0, 1.0]) / h**2
    np.testing.assert_allclose(mu * (sigma - acceleration), (impulse(t + h) - impulse(t - h)) / (2.0 * h), atol=1e-6)
    np.testing.assert_allclose((y[:, 2] - y[:, 0]) / (2 * h), velocity(t), atol=1e-6)
    # two opposite jumps of height mu y'(1/a) run away from the place of the passage
    t1, e = 1.4 / a, 1e-9
    for side in (-1.0, 1.0):
        x = 0.5 / a + side * (t1 - 1.0 / a)
        inside, outside = v(x - side * e, t1), v(x + side * e, t1)
        assert inside - outside == pytest.approx(0.5 * blow[1], rel=1e-3)  # beside it a square root, sqrt(e)


# --- travel coupled to the string


def test_parameters_outside_the_validity_are_refused():
    through = ConstantAcceleration(acceleration=1.4).motion(1.0)
    ride = history_at_constant_speed(0.5, mu=1.2, sigma=0.2)
    for call in (
        lambda: moving_mass.solve_moving_mass(through, mu=1.2, sigma=0.2),
        lambda: history_at_constant_speed(0.5, mu=-1.2, sigma=0.2),
        lambda: history_at_constant_speed(0.5, mu=1.2, sigma=float("nan")),
        lambda: ride.mass_displacement(2.1),
        lambda: accelerating_mass.mass_displacement(-0.1, mu=1.0, sigma=0.2, a=0.4),
        lambda: accelerating_mass.mass_displacement(0.1, mu=0.0, sigma=0.2, a=0.4),
    ):
        with pytest.raises(ValueError, match=r"must|holds|string|wave speed|breaks|inside|t >= 0|ended"):
            call()
